/* The mapper without odometry: along corridors, and after intervals without scans. */
#include "tests/drive.h"

#include <math.h>

#include "cairn/random.h"
#include "src/maps/mapper_work.h"

enum { BEAMS = 181, MOST_BEAMS = 721, MOST_WALLS = 320 };

static const double PI_180 = 3.14159265358979323846 / 180; /* rad: beams of a degree */
static const double HALF_WIDTH = 1;

/* Beams of half a circle; step: rad, below 0 clockwise. Of gap beams in a row, in turn, the ranges
 * are unknown, 0: of none. */
typedef struct scanner {
    int32_t beams;
    double step;
    int32_t gap;
} scanner;

/* Doors at equal distances, set back by `depth`. */
typedef struct door_row {
    double every, width, depth;
} door_row;

typedef struct wall {
    double x, y, to_x, to_y;
} wall;

typedef struct walls {
    wall wall[MOST_WALLS];
    int32_t count;
} walls;

static void add_wall(walls *w, double x, double y, double to_x, double to_y)
{
    wall next = {x, y, to_x, to_y};

    assert_true(w->count < MOST_WALLS);
    w->wall[w->count++] = next;
}

/* A side of the corridor from x to to_x. */
static void add_side(walls *w, double y, const door_row *doors, double x, double to_x)
{
    double back = y > 0 ? y + doors->depth : y - doors->depth;

    for (; x < to_x - doors->every / 2; x += doors->every) {
        double door = x + doors->every - doors->width;

        add_wall(w, x, y, door, y);
        add_wall(w, door, y, door, back);
        add_wall(w, door, back, x + doors->every, back);
        add_wall(w, x + doors->every, back, x + doors->every, y);
    }
}

/* A corridor along x, far longer than what the scanner's beams hit densely. */
static walls corridor(double depth)
{
    const door_row doors = {3, 0.9, depth};
    walls w = {.count = 0};

    if (depth > 0) {
        add_side(&w, HALF_WIDTH, &doors, -10, 20);
        add_side(&w, -HALF_WIDTH, &doors, -11, 19);
    } else {
        add_wall(&w, -200, HALF_WIDTH, 200, HALF_WIDTH);
        add_wall(&w, -200, -HALF_WIDTH, 200, -HALF_WIDTH);
    }
    return w;
}

static double range_to(const wall *s, double x, double y, double angle)
{
    double c = cos(angle), n = sin(angle), dx = s->to_x - s->x, dy = s->to_y - s->y,
           across = c * dy - n * dx;
    double range = ((s->x - x) * dy - (s->y - y) * dx) / across,
           share = ((s->x - x) * n - (s->y - y) * c) / across;

    return fabs(across) > 1e-12 && range > 0 && share >= 0 && share <= 1 ? range : (double)INFINITY;
}

/* Fills in the ranges of a scan of half a circle, with noise of +-1 cm. */
static void look(const walls *w, cairn_pose pose, const scanner *by, cairn_random *random,
                 float *ranges)
{
    const int32_t middle = by->beams / 2;

    for (int32_t i = 0; i < by->beams; i++) {
        double angle = (double)pose.theta + by->step * (i - middle), nearest = 30;

        for (int32_t k = 0; k < w->count; k++)
            nearest = fmin(nearest, range_to(&w->wall[k], (double)pose.x, (double)pose.y, angle));
        ranges[i] =
            (float)(nearest < 30 ? nearest + 0.01 * (double)cairn_random_uniform(random, -1, 1)
                                 : (double)INFINITY);
        if (by->gap > 0 && i / by->gap % 4 == 1)
            ranges[i] = (float)NAN;
    }
}

static cairn_scan_input input_of(const float *ranges, const scanner *by, int64_t stamp_ns)
{
    const int32_t middle = by->beams / 2;
    cairn_scan_input input = {
        .range = ranges,
        .count = by->beams,
        .angle_min = (float)(-by->step * middle),
        .angle_step = (float)by->step,
        .range_max = 30,
        .stamp_ns = stamp_ns,
    };

    return input;
}

/* A step of a drive: motion since the scan before, ns since then. */
typedef struct motion {
    double ahead, turn;
    int64_t span;
} motion;

/* Maps a scan from a pose. */
static void map_scan(cairn_mapper *mapper, const walls *w, cairn_pose pose, const scanner *by,
                     int64_t stamp, int32_t budget, cairn_random *random)
{
    float ranges[MOST_BEAMS];
    cairn_scan_input input = input_of(ranges, by, stamp);
    cairn_budget left = {budget};
    cairn_status status;

    look(w, pose, by, random, ranges);
    assert_taken(cairn_mapper_add(mapper, &input, NULL, NULL));
    while ((status = cairn_mapper_step(mapper, &left)) == CAIRN_MORE)
        left.left = budget;
    assert_ok(status);
}

/* Maps a drive without odometry from the origin; budget: units of a call. Returns the mapper after the last scan; *truth: the last pose. */
static cairn_mapper *map_drive(cairn_pool *pool, const cairn_mapper_params *params, const walls *w,
                               const motion *motions, int32_t count, const scanner *by,
                               int32_t budget, cairn_pose *truth)
{
    cairn_mapper *mapper = new_mapper(pool, params);
    cairn_random random = cairn_random_seed(3, 0);
    int64_t stamp = 0;

    *truth = cairn_pose_identity();
    for (int32_t i = 0; i < count; i++) {
        cairn_pose moved = {(cairn_real)motions[i].ahead, 0, (cairn_real)motions[i].turn};

        *truth = cairn_pose_compose(*truth, moved);
        stamp += motions[i].span;
        map_scan(mapper, w, *truth, by, stamp, budget, &random);
    }
    return mapper;
}

/* ---- Corridors ---- */

enum { AHEAD = 30, STANDING = 30, BACK = 20, CORRIDOR_SCANS = 1 + AHEAD + STANDING + BACK };

/* Ahead with 0.1 m a scan, standing, and back with 0.06 m. */
static void corridor_drive(motion *motions)
{
    for (int32_t i = 0; i < CORRIDOR_SCANS; i++) {
        motions[i].ahead = i == 0 ? 0 : i <= AHEAD ? 0.1 : i <= AHEAD + STANDING ? 0 : -0.06;
        motions[i].turn = 0;
        motions[i].span = 200000000;
    }
}

/* Error along the corridor after a number of scans, m; *sigma: stated. */
static double corridor_error_by(double depth, int32_t scans, const scanner *by, double *sigma)
{
    cairn_mapper_params params = small_params();
    walls w = corridor(depth);
    motion motions[CORRIDOR_SCANS];
    cairn_pool pool;
    cairn_pose truth;
    cairn_mapper *mapper;
    cairn_mapper_result result;

    params.scan.max_beams = by->beams;
    corridor_drive(motions);
    mapper = map_drive(&pool, &params, &w, motions, scans, by, CAIRN_UNBOUNDED, &truth);
    result = cairn_mapper_read(mapper);
    if (by->beams == BEAMS && by->gap == 0)
        assert_int_equal(cairn_mapper_measure(mapper).unobservable, scans);
    test_pool_free(&pool);
    *sigma = sqrt((double)result.covariance[0]);
    return fabs((double)(result.map_scan.x - truth.x));
}

static double corridor_error(double depth, int32_t scans, double step, double *sigma)
{
    const scanner by = {BEAMS, step, 0};

    return corridor_error_by(depth, scans, &by, sigma);
}

static void doors_show_the_motion_along_a_corridor(void **state)
{
    double sigma;

    (void)state;
    for (int s = -1; s <= 1; s += 2) {
        assert_true(corridor_error(0.16, 1 + AHEAD, s * PI_180, &sigma) < 0.15);
        assert_true(corridor_error(0.16, 1 + AHEAD + STANDING, s * PI_180, &sigma) < 0.15);
        assert_true(corridor_error(0.16, CORRIDOR_SCANS, s * PI_180, &sigma) < 0.15);
        assert_true(corridor_error(0.08, CORRIDOR_SCANS, s * PI_180, &sigma) < 0.4);
    }
}

static void a_corridor_that_shows_nothing_is_said_to_be_unobservable(void **state)
{
    double sigma;

    (void)state;
    assert_true(corridor_error(0, 1 + AHEAD, PI_180, &sigma) > 1);
    assert_true(sigma > 0.2);
}

static void small_budgets_give_the_same_bits(void **state)
{
    static const int32_t budgets[] = {CAIRN_UNBOUNDED, 100, 1};
    const scanner by = {BEAMS, PI_180, 0};
    cairn_mapper_params params = small_params();
    walls w = corridor(0.08);
    motion motions[CORRIDOR_SCANS];
    cairn_mapper_result results[3];
    int64_t units[3];

    (void)state;
    corridor_drive(motions);
    for (int i = 0; i < 3; i++) {
        cairn_pool pool;
        cairn_pose truth;
        cairn_mapper *mapper = map_drive(&pool, &params, &w, motions, 12, &by, budgets[i], &truth);

        results[i] = cairn_mapper_read(mapper);
        units[i] = cairn_mapper_measure(mapper).units;
        test_pool_free(&pool);
        assert_memory_equal(&results[i].map_scan, &results[0].map_scan, sizeof results[i].map_scan);
        assert_memory_equal(results[i].covariance, results[0].covariance,
                            sizeof results[i].covariance);
        assert_int_equal(units[i], units[0]);
    }
}

/* Drives along a corridor of equal doors, faster by `faster` from scan to scan, up to `most` a scan.
 * Wherever the ranges decide, the motion of a scan must lie within three of their standard
 * deviations. Returns the number of these scans. */
static int32_t drive_past_doors(const door_row *doors, double faster, double most)
{
    const scanner by = {BEAMS, PI_180, 0};
    cairn_mapper_params params = small_params();
    cairn_random random = cairn_random_seed(5, 0);
    cairn_pose truth = cairn_pose_identity(), before = truth;
    walls w = {.count = 0};
    double step = 0;
    cairn_pool pool;
    cairn_mapper *mapper = new_mapper(&pool, &params);
    int32_t decided = 0;

    add_side(&w, HALF_WIDTH, doors, -6, 9);
    add_side(&w, -HALF_WIDTH, doors, -6, 9);
    for (int32_t i = 0; i < 16; i++) {
        double sigma, error;
        cairn_pose pose;

        map_scan(mapper, &w, truth, &by, 200000000 * (int64_t)i, CAIRN_UNBOUNDED, &random);
        pose = cairn_mapper_read(mapper).map_scan;
        sigma = (double)mapper->current.weak_sigma;
        error = fabs((double)(pose.x - before.x) - step);
        if (sigma < (double)MAPPER_LOW_CONFIDENCE_M) {
            assert_true(error <= 3 * sigma);
            decided++;
        }
        before = pose;
        step = fmin(step + faster, most);
        truth.x += (cairn_real)step;
    }
    assert_true(cairn_pose_is_finite(before));
    test_pool_free(&pool);
    return decided;
}

static const door_row door_rows[] = {
    {0.4, 0.2, 0.1}, {0.6, 0.2, 0.1}, {0.4, 0.2, 0.3}, {0.6, 0.2, 0.3}};

enum { DOOR_ROWS = sizeof door_rows / sizeof *door_rows };

/* A shift by the distance of the doors fits as well; less than half of it is the nearest one. */
static void equal_doors_do_not_mislead(void **state)
{
    int32_t decided = 0;

    (void)state;
    for (size_t k = 0; k < DOOR_ROWS; k++)
        for (int part = 0; part < 4; part++) {
            double most = door_rows[k].every * part / 9;

            decided += drive_past_doors(&door_rows[k], most, most);
        }
    assert_true(decided > 20);
}

/* Up to a little less than half of their distance a scan. */
static void equal_doors_do_not_mislead_a_robot_that_gets_faster(void **state)
{
    (void)state;
    for (size_t k = 0; k < DOOR_ROWS; k++)
        (void)drive_past_doors(&door_rows[k], 0.03, 0.45 * door_rows[k].every);
}

/* Other scanners in a corridor of doors. */
static void many_beams_and_gaps_between_them_do_no_harm(void **state)
{
    static const scanner scanners[] = {
        {MOST_BEAMS, 0.25 * 3.14159265358979323846 / 180, 0},
        {MOST_BEAMS, -0.25 * 3.14159265358979323846 / 180, 30},
        {361, 0.5 * 3.14159265358979323846 / 180, 1},
        {BEAMS, 3.14159265358979323846 / 180, 1},
        {BEAMS, -3.14159265358979323846 / 180, 12},
        {BEAMS, 3.14159265358979323846 / 180, 40},
    };

    (void)state;
    for (size_t k = 0; k < sizeof scanners / sizeof *scanners; k++) {
        double sigma, error = corridor_error_by(0.16, 1 + AHEAD, &scanners[k], &sigma);

        assert_true(error < 0.15);
        assert_true(isfinite(sigma));
    }
}

/* ---- Intervals without scans ---- */

/* A room in which no two directions look alike. */
static walls room(void)
{
    walls w = {.count = 0};

    add_wall(&w, -4, -3, 5, -3);
    add_wall(&w, 5, -3, 5, 1);
    add_wall(&w, 5, 1, 2.5, 1);
    add_wall(&w, 2.5, 1, 2.5, 4);
    add_wall(&w, 2.5, 4, -1, 4);
    add_wall(&w, -1, 4, -2.5, 2);
    add_wall(&w, -2.5, 2, -4, 2);
    add_wall(&w, -4, 2, -4, -3);
    add_wall(&w, 1, -1, 1.8, -1.6);
    return w;
}

enum { TURNING = 20, GAP_SCANS = TURNING + 6, SEARCH_UNITS = 50000 };

/* Error of the heading after a turn of 62 degrees within one interval, rad. */
static double turn_error(int64_t span, int32_t search_units)
{
    const scanner by = {BEAMS, PI_180, 0};
    cairn_mapper_params params = small_params();
    walls w = room();
    motion motions[GAP_SCANS];
    cairn_pool pool;
    cairn_pose truth;
    cairn_mapper *mapper;
    double error;

    params.search_units = search_units;
    for (int32_t i = 0; i < GAP_SCANS; i++) {
        motion next = {i < TURNING ? 0.05 : 0, i < TURNING ? -3 * PI_180 : 0, 200000000};

        motions[i] = next;
    }
    motions[0].turn = 0;
    motions[TURNING].turn = -62 * PI_180;
    motions[TURNING].span = span;
    mapper = map_drive(&pool, &params, &w, motions, GAP_SCANS, &by, CAIRN_UNBOUNDED, &truth);
    error = fabs((double)cairn_wrap_angle(cairn_mapper_read(mapper).map_scan.theta - truth.theta));
    test_pool_free(&pool);
    return error;
}

static void after_an_interval_the_search_has_the_units_of_the_missing_scans(void **state)
{
    (void)state;
    assert_true(turn_error(INT64_C(3000000000), SEARCH_UNITS) < 0.02);
    assert_true(turn_error(200000000, SEARCH_UNITS) > 1);
}

/* Intervals of 0.2 s from 1000 s on, one of `odd` ns, 0.2 s again, and at the end 1 s. Returns the
 * usual intervals that the last one counts as. */
static int32_t intervals_after(int64_t odd)
{
    const int64_t usual = 200000000;
    const scanner by = {BEAMS, PI_180, 0};
    cairn_mapper_params params = small_params();
    cairn_random random = cairn_random_seed(7, 0);
    walls w = room();
    cairn_pool pool;
    cairn_mapper *mapper = new_mapper(&pool, &params);
    int64_t stamp = INT64_C(1000000000000);
    int32_t intervals = 0;

    for (int32_t i = 0; i < 16; i++) {
        stamp += i == 10 ? odd : i == 15 ? 5 * usual : usual;
        map_scan(mapper, &w, cairn_pose_identity(), &by, stamp, CAIRN_UNBOUNDED, &random);
        intervals = mapper->previous.intervals;
        if (i < 15 && (i != 10 || odd <= 0))
            assert_int_equal(intervals, 1);
    }
    test_pool_free(&pool);
    return intervals;
}

static void stamps_that_go_back_are_no_intervals(void **state)
{
    (void)state;
    assert_in_range(intervals_after(0), 3, 5);
    assert_in_range(intervals_after(-1), 3, 5);
    assert_in_range(intervals_after(-INT64_C(2000000000)), 3, 5);
    assert_in_range(intervals_after(-CAIRN_SCAN_MAX_STAMP_NS), 3, 5);
}

static void after_a_pause_missing_scans_count_again(void **state)
{
    (void)state;
    assert_in_range(intervals_after(INT64_C(600000000000)), 3, 5);
}

/* Stamps that are equal, go back, or are the farthest ones, along a corridor and in a room. */
static void bad_stamps_do_no_harm(void **state)
{
    static const int64_t bad[] = {0,
                                  0,
                                  200000000,
                                  -1,
                                  -200000000,
                                  -CAIRN_SCAN_MAX_STAMP_NS,
                                  200000000,
                                  CAIRN_SCAN_MAX_STAMP_NS,
                                  1,
                                  -CAIRN_SCAN_MAX_STAMP_NS,
                                  CAIRN_SCAN_MAX_STAMP_NS};
    const scanner by = {BEAMS, PI_180, 0};

    (void)state;
    for (int kind = 0; kind < 2; kind++) {
        cairn_mapper_params params = small_params();
        cairn_random random = cairn_random_seed(6, 0);
        cairn_pose truth = cairn_pose_identity();
        walls w = kind == 0 ? room() : corridor(0.16);
        cairn_pool pool;
        cairn_mapper *mapper = new_mapper(&pool, &params);

        for (size_t i = 0; i < 3 * sizeof bad / sizeof *bad; i++) {
            cairn_pose pose;

            map_scan(mapper, &w, truth, &by, bad[i / 3], CAIRN_UNBOUNDED, &random);
            pose = cairn_mapper_read(mapper).map_scan;
            assert_true(cairn_pose_is_finite(pose));
            assert_true(fabs((double)(pose.x - truth.x)) < 0.2);
            assert_true(fabs((double)(pose.y - truth.y)) < 0.05);
            assert_in_range(mapper->previous.intervals, 1, 100);
            truth.x += CAIRN_REAL(0.04);
        }
        test_pool_free(&pool);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(doors_show_the_motion_along_a_corridor),
        cmocka_unit_test(a_corridor_that_shows_nothing_is_said_to_be_unobservable),
        cmocka_unit_test(equal_doors_do_not_mislead),
        cmocka_unit_test(equal_doors_do_not_mislead_a_robot_that_gets_faster),
        cmocka_unit_test(many_beams_and_gaps_between_them_do_no_harm),
        cmocka_unit_test(small_budgets_give_the_same_bits),
        cmocka_unit_test(after_an_interval_the_search_has_the_units_of_the_missing_scans),
        cmocka_unit_test(stamps_that_go_back_are_no_intervals),
        cmocka_unit_test(after_a_pause_missing_scans_count_again),
        cmocka_unit_test(bad_stamps_do_no_harm),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
