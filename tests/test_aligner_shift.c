/* Joint translations of the aligner: a hall of niches, of which a group of scans is put off along
 * it. */
#include "tests/test.h"

#include <math.h>

#include "cairn/aligner.h"
#include "src/alignment/aligner_work.h"
#include "tests/rooms.h"

enum { IN_FIRST = 5, IN_HALL = 10, AWAY = IN_HALL, SCANS = IN_HALL + 2, HYPOTHESES = 24 * SCANS };

/* m: longer ranges are cut off, so that the two ends of the hall see little of each other */
static const float FAR = 4.2F;
/* rad: the hall in the map, oblique to its axes */
static const cairn_real TURN = CAIRN_REAL(0.4);

/* The first IN_FIRST scans are at one end of the hall, the others at its other end; those from AWAY on
 * are in a room far away. */
static const cairn_pose truth[SCANS] = {{CAIRN_REAL(1.2), CAIRN_REAL(0.9), 0},
                                        {CAIRN_REAL(2.1), CAIRN_REAL(2.3), 2},
                                        {CAIRN_REAL(3.0), CAIRN_REAL(1.0), -1},
                                        {CAIRN_REAL(3.6), CAIRN_REAL(2.1), 1},
                                        {CAIRN_REAL(2.5), CAIRN_REAL(1.8), 3},
                                        {CAIRN_REAL(6.4), CAIRN_REAL(1.1), 0},
                                        {CAIRN_REAL(7.2), CAIRN_REAL(2.2), -2},
                                        {CAIRN_REAL(8.1), CAIRN_REAL(0.9), 1},
                                        {CAIRN_REAL(8.7), CAIRN_REAL(2.1), 2},
                                        {CAIRN_REAL(7.6), CAIRN_REAL(1.9), -3},
                                        {60, 60, 3},
                                        {61, 61, 2}};

struct bed {
    cairn_pool pool;
    cairn_aligner *aligner;
    cairn_transform before[SCANS];
};

static rooms_room make_hall(void)
{
    rooms_room hall = {.count = 0};

    rooms_add_box(&hall, 0, 0, 10, 3);
    rooms_add_box(&hall, 58, 58, 62, 63);
    for (int k = 0; k < 6; k++) {
        double x = 1.7 + 1.3 * k;

        rooms_add_wall(&hall, x, 0, x, 0.5);
        rooms_add_wall(&hall, x + 0.6, 2.6, x + 0.6, 3);
    }
    return hall;
}

static void add_scans(cairn_aligner *aligner)
{
    cairn_scan_params params = cairn_scan_default();
    cairn_pool pool = test_pool(cairn_scan_memory(&params));
    const cairn_pose map_hall = {1, -2, TURN};
    rooms_room hall = make_hall();
    cairn_scan *scan;

    assert_ok(cairn_scan_create(&scan, &pool, &params));
    for (int32_t i = 0; i < SCANS; i++) {
        cairn_budget budget = {CAIRN_UNBOUNDED};
        rooms_scan taken;
        cairn_scan_input input = rooms_take_scan(&hall, truth[i], (uint64_t)i + 1, &taken);
        cairn_scan_view view;

        for (int32_t k = 0; k < ROOMS_BEAMS; k++)
            if (taken.range[k] > FAR)
                taken.range[k] = (float)NAN;
        assert_ok(cairn_scan_begin(scan, &input, NULL));
        assert_ok(cairn_scan_step(scan, &budget));
        view = cairn_scan_read(scan);
        assert_ok(
            cairn_aligner_add_scan(aligner, &view, cairn_pose_compose(map_hall, truth[i]), NULL));
    }
    test_pool_free(&pool);
}

static struct bed make_bed(int32_t max_hypotheses)
{
    cairn_aligner_params params = cairn_aligner_default();
    struct bed bed;

    params.max_scans = SCANS;
    params.max_hypotheses = max_hypotheses;
    bed.pool = test_pool(cairn_aligner_memory(&params));
    assert_ok(cairn_aligner_create(&bed.aligner, &bed.pool, &params));
    add_scans(bed.aligner);
    return bed;
}

/* An alignment that has ended with all scans of the hall in one cluster. */
static struct bed align(int32_t max_hypotheses)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    struct bed bed = make_bed(max_hypotheses);

    assert_ok(cairn_aligner_begin(bed.aligner));
    assert_ok(cairn_aligner_step(bed.aligner, &budget));
    assert_int_equal(cairn_aligner_read(bed.aligner).largest_size, IN_HALL);
    memcpy(bed.before, bed.aligner->poses, sizeof bed.before);
    return bed;
}

/* Direction along the hall in the frame of the poses. */
static cairn_vec2 along_hall(const struct bed *bed)
{
    cairn_vec2 x_axis = {1, 0};
    cairn_transform own = cairn_transform_of(truth[0]);

    return cairn_transform_direction(
        cairn_transform_compose(bed->before[0], cairn_transform_inverse(own)), x_axis);
}

/* Puts the scans of the hall from `first` on off along it, and the others back. */
static void begin_shift(struct bed *bed, int32_t first, double off)
{
    cairn_aligner *aligner = bed->aligner;
    cairn_vec2 way = cairn_vec2_scale(along_hall(bed), (cairn_real)off);

    memcpy(aligner->poses, bed->before, sizeof bed->before);
    for (int32_t i = first; i < IN_HALL; i++) {
        aligner->poses[i].x += way.x;
        aligner->poses[i].y += way.y;
    }
    aligner->changed_scans = 0;
}

/* Puts scans off, and translates groups with `units` a step. */
static void shift(struct bed *bed, int32_t first, double off, int32_t units)
{
    cairn_budget budget = {units};

    begin_shift(bed, first, off);
    while (!cairn_aligner_shift(bed->aligner, &budget)) {
        assert_int_equal(budget.left, 0);
        budget.left = units;
    }
}

/* Motion of a scan along the hall since the end of the alignment, m. */
static double moved(const struct bed *bed, int32_t i)
{
    cairn_vec2 motion = {bed->aligner->poses[i].x - bed->before[i].x,
                         bed->aligner->poses[i].y - bed->before[i].y};

    assert_near(cairn_vec2_cross(along_hall(bed), motion), 0, 2e-3);
    return (double)cairn_vec2_dot(along_hall(bed), motion);
}

/* The two groups of scans are off by less than `most`, and each is as it was. */
static void groups_are_apart_by(const struct bed *bed, int32_t first, double least, double most)
{
    for (int32_t i = 0; i < IN_HALL; i++) {
        const cairn_transform *pose = &bed->aligner->poses[i];
        double apart = moved(bed, i) - moved(bed, i < first ? 0 : first);

        assert_near(apart, 0, 1e-4);
        assert_true(pose->cosine == bed->before[i].cosine && pose->sine == bed->before[i].sine);
    }
    assert_true(fabs(moved(bed, first) - moved(bed, 0)) <= most);
    assert_true(fabs(moved(bed, first) - moved(bed, 0)) >= least);
    assert_memory_equal(&bed->aligner->poses[AWAY], &bed->before[AWAY],
                        (SCANS - AWAY) * sizeof bed->before[0]);
}

static void a_group_that_is_off_by_10_cm_moves_back(void **state)
{
    struct bed bed = align(HYPOTHESES);

    (void)state;
    for (int32_t first = 4; first < IN_HALL; first++)
        for (int side = -1; side <= 1; side += 2) {
            shift(&bed, first, 0.1 * side, CAIRN_UNBOUNDED);
            assert_int_equal(bed.aligner->shift.is_full, 0);
            groups_are_apart_by(&bed, first, 0, 0.02);
            assert_true(bed.aligner->changed_scans > 0);
        }
    test_pool_free(&bed.pool);
}

/* Of the shifts by one step the one ahead is tried second: the group moves, not the others. */
static void a_group_moves_alone(void **state)
{
    struct bed bed = align(HYPOTHESES);

    (void)state;
    shift(&bed, IN_FIRST, 0.05, CAIRN_UNBOUNDED);
    groups_are_apart_by(&bed, IN_FIRST, 0, 0.01);
    assert_memory_equal(bed.aligner->poses, bed.before, IN_FIRST * sizeof bed.before[0]);
    assert_int_equal(bed.aligner->changed_scans, IN_HALL - IN_FIRST);
    test_pool_free(&bed.pool);
}

static void scans_in_their_places_stay_there(void **state)
{
    struct bed bed = align(HYPOTHESES);
    int32_t changes = bed.aligner->change_count;

    (void)state;
    shift(&bed, IN_FIRST, 0, CAIRN_UNBOUNDED);
    assert_memory_equal(bed.aligner->poses, bed.before, sizeof bed.before);
    assert_int_equal(bed.aligner->changed_scans, 0);
    assert_int_equal(bed.aligner->change_count, changes);
    test_pool_free(&bed.pool);
}

static void shifts_in_small_budgets_give_the_same_bits(void **state)
{
    static const int32_t budgets[] = {1, 7, 100};
    struct bed bed = align(HYPOTHESES);
    cairn_transform whole[SCANS];

    (void)state;
    for (int side = -1; side <= 1; side += 2) {
        shift(&bed, 6, 0.1 * side, CAIRN_UNBOUNDED);
        memcpy(whole, bed.aligner->poses, sizeof whole);
        for (size_t k = 0; k < sizeof budgets / sizeof *budgets; k++) {
            shift(&bed, 6, 0.1 * side, budgets[k]);
            assert_memory_equal(bed.aligner->poses, whole, sizeof whole);
        }
    }
    test_pool_free(&bed.pool);
}

/* One pair too many for the memory, or just none. */
static void with_more_pairs_than_memory_nothing_moves(void **state)
{
    struct bed bed = align(HYPOTHESES);
    int32_t pairs;

    (void)state;
    shift(&bed, IN_FIRST, 0.1, CAIRN_UNBOUNDED);
    pairs = bed.aligner->shift.pair_count;
    assert_true(pairs > 20 && pairs < bed.aligner->shift.max_pairs);
    for (int32_t lack = 1; lack >= 0; lack--) {
        bed.aligner->shift.max_pairs = pairs - lack;
        shift(&bed, IN_FIRST, 0.1, 7);
        assert_int_equal(bed.aligner->shift.is_full, lack);
        assert_int_equal(bed.aligner->shift.pair_count, pairs - lack);
        groups_are_apart_by(&bed, IN_FIRST, 0.0999 * lack, 0.02 + 0.0801 * lack);
        assert_int_equal(bed.aligner->changed_scans > 0, !lack);
    }
    test_pool_free(&bed.pool);
}

/* The memory of few hypotheses holds few pairs. */
static void few_hypotheses_leave_no_memory_for_the_pairs(void **state)
{
    struct bed bed = align(30);

    (void)state;
    shift(&bed, IN_FIRST, 0.1, CAIRN_UNBOUNDED);
    assert_int_equal(bed.aligner->shift.is_full, 1);
    groups_are_apart_by(&bed, IN_FIRST, 0.0999, 0.1001);
    test_pool_free(&bed.pool);
}

/* ---- Ended early ---- */

static void runs_like(struct bed *bed, const struct bed *fresh)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_aligner_result result, expected = cairn_aligner_read(fresh->aligner);

    assert_ok(cairn_aligner_begin(bed->aligner));
    assert_ok(cairn_aligner_step(bed->aligner, &budget));
    result = cairn_aligner_read(bed->aligner);
    assert_memory_equal(bed->aligner->poses, fresh->aligner->poses,
                        SCANS * sizeof bed->aligner->poses[0]);
    for (int32_t i = 0; i < SCANS; i++) {
        cairn_aligner_pose a = cairn_aligner_pose_of(bed->aligner, i),
                           b = cairn_aligner_pose_of(fresh->aligner, i);

        assert_memory_equal(&a, &b, sizeof a);
    }
    assert_int_equal(result.verdict, expected.verdict);
    assert_int_equal(result.units, expected.units);
    assert_int_equal(result.iterations, expected.iterations);
}

/* Ends a run among its pairs, and in shifts of both directions. */
static void a_run_that_begins_within_the_shifts_of_another_is_a_fresh_one(void **state)
{
    static const struct {
        int32_t pairs, direction, index;
    } stops[] = {{1, -1, 0}, {20, -1, 0}, {0, 0, 0}, {0, 0, 4}, {0, 1, 3}};
    struct bed fresh = align(HYPOTHESES), bed = make_bed(HYPOTHESES);
    aligner_shift *shifts = &bed.aligner->shift;

    (void)state;
    for (size_t k = 0; k < sizeof stops / sizeof *stops; k++) {
        cairn_budget budget = {1};

        shifts->pair_count = 0;
        shifts->direction = shifts->index = -1;
        assert_ok(cairn_aligner_begin(bed.aligner));
        while (shifts->pair_count < stops[k].pairs || shifts->direction != stops[k].direction ||
               (stops[k].direction >= 0 && shifts->index != stops[k].index)) {
            assert_status(cairn_aligner_step(bed.aligner, &budget), CAIRN_MORE);
            budget.left = 1;
        }
        /* the operation that follows is charged in part */
        assert_status(cairn_aligner_step(bed.aligner, &budget), CAIRN_MORE);
        runs_like(&bed, &fresh);
    }
    test_pool_free(&bed.pool);
    test_pool_free(&fresh.pool);
}

/* Ends shifts of a group that is off: within a minimum cut, and after the first motion. The next
 * shifts are like the first, too. */
static void a_run_that_begins_within_a_cut_is_a_fresh_one(void **state)
{
    struct bed fresh = align(HYPOTHESES), bed = align(HYPOTHESES);
    cairn_transform shifted[SCANS];

    (void)state;
    shift(&bed, IN_FIRST, 0.1, CAIRN_UNBOUNDED);
    memcpy(shifted, bed.aligner->poses, sizeof shifted);
    for (int after_motion = 0; after_motion < 2; after_motion++) {
        cairn_budget budget = {1};

        bed.aligner->shift.cut.source = -1;
        begin_shift(&bed, IN_FIRST, 0.1);
        while (after_motion ? bed.aligner->changed_scans == 0 : bed.aligner->shift.cut.source < 2) {
            assert_int_equal(cairn_aligner_shift(bed.aligner, &budget), 0);
            budget.left = 1;
        }
        runs_like(&bed, &fresh);
        shift(&bed, IN_FIRST, 0.1, CAIRN_UNBOUNDED);
        assert_memory_equal(bed.aligner->poses, shifted, sizeof shifted);
    }
    test_pool_free(&bed.pool);
    test_pool_free(&fresh.pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_group_that_is_off_by_10_cm_moves_back),
        cmocka_unit_test(a_group_moves_alone),
        cmocka_unit_test(scans_in_their_places_stay_there),
        cmocka_unit_test(shifts_in_small_budgets_give_the_same_bits),
        cmocka_unit_test(with_more_pairs_than_memory_nothing_moves),
        cmocka_unit_test(few_hypotheses_leave_no_memory_for_the_pairs),
        cmocka_unit_test(a_run_that_begins_within_the_shifts_of_another_is_a_fresh_one),
        cmocka_unit_test(a_run_that_begins_within_a_cut_is_a_fresh_one),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
