/* The angle step of a scanner from overlapping scans: drives of the simulation with true poses, whose
 * step is stated right or wrong. */
#include "cairn/angle_step.h"

#include "cairn/scan_correction.h"
#include "tests/drive.h"

#define DEGREE (3.14159265358979323846 / 180)

enum { SCANS = 120, BEAMS = 180, PAIRS = 600 };

/* ---- Drives ---- */

/* A drive with scans that state a step, and the object that estimates it. */
typedef struct fixture {
    sim_arena *arena;
    sim_survey *survey;
    cairn_scanner_check_scan scans[SCANS];
    cairn_pool pool;
    cairn_angle_step_params params;
    cairn_angle_step *angle_step;
} fixture;

/* stated, of_truth: field of view from the first to the last beam, in degrees */
static void open_fixture(fixture *f, sim_scene scene, uint64_t seed, double of_truth, double stated)
{
    sim_arena_options where = sim_arena_default();
    sim_survey_options how = sim_survey_default();
    const sim_scan *scans;
    int32_t count;

    where.scene = scene;
    where.seed = how.seed = seed;
    how.drive = SCANS;
    how.beams = BEAMS;
    how.fov = of_truth * DEGREE;
    f->arena = sim_arena_create(&where, NULL, 0);
    assert_non_null(f->arena);
    f->survey = sim_survey_create(f->arena, &how, NULL, 0);
    assert_non_null(f->survey);
    scans = sim_survey_scans(f->survey, &count);
    assert_int_equal(count, SCANS);
    memset(f->scans, 0, sizeof f->scans);
    for (int32_t i = 0; i < SCANS; i++) {
        cairn_scan_input *input = &f->scans[i].input;

        input->range = scans[i].range;
        input->count = BEAMS;
        input->angle_min = (float)(-0.5 * stated * DEGREE);
        input->angle_step = (float)(stated * DEGREE / (BEAMS - 1));
        input->range_min = (float)scans[i].range_min;
        input->range_max = (float)scans[i].range_max;
        input->base_sensor = pose_of(scans[i].base_sensor);
        f->scans[i].robot = pose_of(scans[i].truth);
    }
    f->params = cairn_angle_step_default();
    f->params.max_beams = BEAMS;
    f->params.max_pairs = PAIRS;
    f->pool = test_pool(cairn_angle_step_memory(&f->params));
    assert_ok(cairn_angle_step_create(&f->angle_step, &f->pool, &f->params));
}

static void close_fixture(fixture *f)
{
    test_pool_free(&f->pool);
    sim_survey_free(f->survey);
    sim_arena_free(f->arena);
}

static cairn_status begin(fixture *f)
{
    return cairn_angle_step_begin(f->angle_step, f->scans, SCANS, NULL);
}

static cairn_angle_step_result run_by(cairn_angle_step *angle_step, int32_t units)
{
    cairn_budget budget = {0};
    cairn_status status;

    assert_status(cairn_angle_step_step(angle_step, &budget), CAIRN_MORE);
    do {
        budget.left = units;
        status = cairn_angle_step_step(angle_step, &budget);
    } while (status == CAIRN_MORE);
    assert_ok(status);
    assert_ok(cairn_angle_step_step(angle_step, &budget)); /* nothing left to do */
    return cairn_angle_step_read(angle_step);
}

/* Fails unless a drive gives the step, and is taken for the mistake or not. */
static void assert_estimate(sim_scene scene, uint64_t seed, double of_truth, double stated,
                            int32_t is_mistake)
{
    static fixture f;
    cairn_angle_step_result found;
    cairn_real mistake;

    open_fixture(&f, scene, seed, of_truth, stated);
    assert_ok(begin(&f));
    found = run_by(f.angle_step, CAIRN_UNBOUNDED);
    mistake = cairn_angle_step_mistake(&f.scans[0].input);
    assert_true(found.pairs >= 30 && found.ratio.is_known);
    assert_true(found.ratio.sigma < CAIRN_REAL(0.0013));
    assert_true(cairn_abs(found.ratio.value - (cairn_real)(of_truth / stated)) <
                3 * found.ratio.sigma);
    assert_near(found.logged, stated * DEGREE / (BEAMS - 1), 1e-7);
    assert_int_equal(cairn_angle_step_is_mistake(&found, mistake), is_mistake);
    close_fixture(&f);
}

/* ---- Tests ---- */

static void a_field_of_view_that_is_one_beam_too_wide_is_found(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 3; seed++) {
        assert_estimate(SIM_OFFICE, seed, 179, 180, 1);
        assert_estimate(SIM_RESCUE, seed, 179, 180, 1);
    }
}

/* Simulated scanners have their first and last beam at the ends of a round field of view. */
static void a_right_log_that_looks_like_the_mistake_is_left_alone(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 3; seed++) {
        assert_estimate(SIM_OFFICE, seed, 180, 180, 0);
        assert_estimate(SIM_RESCUE, seed, 180, 180, 0);
    }
}

static void another_wrong_step_is_estimated_but_is_not_the_mistake(void **state)
{
    (void)state;
    assert_estimate(SIM_OFFICE, 5, 182, 180, 0);
    assert_estimate(SIM_OFFICE, 6, 177, 179, 0);
}

static void only_n_round_steps_over_n_beams_look_like_the_mistake(void **state)
{
    static const struct {
        int32_t beams;
        double step, mistake; /* degrees */
    } cases[] = {
        {180, 180.0 / 179, 1},
        {360, 180.0 / 359, 0.5},
        {1080, 270.0 / 1079, 0.25},
        {180, 1, 0},
        {181, 1, 0},
        {361, 0.5, 0},
        {1081, 0.25, 0},
        {683, 360.0 / 1024, 0},
        {181, 180.0 / 181, 0},
        {180, 1.003, 0},
        {2, 0.1, 0},
        {1, 1, 0},
        {360, -180.0 / 359, 0.5},
    };
    cairn_scan_input scan;

    (void)state;
    memset(&scan, 0, sizeof scan);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        scan.count = cases[i].beams;
        scan.angle_step = (float)(cases[i].step * DEGREE);
        scan.angle_min = -0.5f * (float)scan.count * scan.angle_step;
        assert_near(cairn_angle_step_mistake(&scan), cases[i].mistake * DEGREE, 1e-6);
    }
}

static void uncertain_or_small_deviations_are_no_mistake(void **state)
{
    cairn_angle_step_result result = {
        .pairs = 500, .logged = 1, .ratio = {CAIRN_REAL(0.9944), CAIRN_REAL(0.0008), 1}};
    cairn_real mistake = CAIRN_REAL(0.9944);

    (void)state;
    assert_int_equal(cairn_angle_step_is_mistake(&result, mistake), 1);
    assert_int_equal(cairn_angle_step_is_mistake(&result, 0), 0);
    result.ratio.sigma = CAIRN_REAL(0.0015);
    assert_int_equal(cairn_angle_step_is_mistake(&result, mistake), 0);
    result.ratio.sigma = CAIRN_REAL(0.0008);
    result.ratio.value = CAIRN_REAL(0.9900);
    assert_int_equal(cairn_angle_step_is_mistake(&result, mistake), 0);
    result.ratio.value = mistake;
    result.ratio.is_known = 0;
    assert_int_equal(cairn_angle_step_is_mistake(&result, mistake), 0);
    result.ratio = (cairn_scanner_check_value){CAIRN_REAL(0.9985), CAIRN_REAL(0.0001), 1};
    assert_int_equal(cairn_angle_step_is_mistake(&result, CAIRN_REAL(0.9985)), 0);
}

static void a_drive_that_does_not_move_says_nothing(void **state)
{
    static fixture f;
    cairn_angle_step_result found;

    (void)state;
    open_fixture(&f, SIM_OFFICE, 1, 179, 180);
    for (int32_t i = 0; i < SCANS; i++)
        f.scans[i].robot = cairn_pose_identity();
    assert_ok(begin(&f));
    found = run_by(f.angle_step, CAIRN_UNBOUNDED);
    assert_int_equal(found.pairs, 0);
    assert_int_equal(found.ratio.is_known, 0);
    close_fixture(&f);
}

static void budgets_of_1_7_1000_and_all_give_the_same_bits(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    static fixture f;
    cairn_angle_step_result whole;
    int64_t units;

    (void)state;
    open_fixture(&f, SIM_RESCUE, 4, 179, 180);
    assert_ok(begin(&f));
    whole = run_by(f.angle_step, CAIRN_UNBOUNDED);
    units = cairn_angle_step_units(f.angle_step);
    assert_true(whole.pairs > 0);
    for (size_t i = 0; i < sizeof budgets / sizeof *budgets; i++) {
        cairn_angle_step_result parts;

        assert_ok(begin(&f));
        assert_int_equal(cairn_angle_step_read(f.angle_step).pairs, 0);
        parts = run_by(f.angle_step, budgets[i]);
        assert_memory_equal(&parts, &whole, sizeof whole);
        assert_true(cairn_angle_step_units(f.angle_step) == units);
    }
    close_fixture(&f);
}

static cairn_status begin_again(void *context)
{
    return begin(context);
}

static cairn_status step_again(void *context, cairn_budget *budget)
{
    return cairn_angle_step_step(((fixture *)context)->angle_step, budget);
}

static uint64_t hash_of_result(void *context)
{
    cairn_angle_step_result result = cairn_angle_step_read(((fixture *)context)->angle_step);

    return test_hash(TEST_HASH_START, &result, sizeof result);
}

static void an_estimate_begun_anew_knows_nothing_of_the_last_one(void **state)
{
    static fixture f;
    const test_stepped stepped = {begin_again, step_again, hash_of_result, &f};

    (void)state;
    open_fixture(&f, SIM_RESCUE, 4, 179, 180);
    test_begins_anew(&stepped, 6);
    close_fixture(&f);
}

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_angle_step *angle_step;

    return cairn_angle_step_create(&angle_step, pool, context);
}

static void its_memory_suffices_and_less_is_refused(void **state)
{
    cairn_angle_step_params params = cairn_angle_step_default();

    (void)state;
    params.max_beams = 8;
    params.max_pairs = 2;
    test_every_pool_size(create, &params, cairn_angle_step_memory(&params));
}

static void scans_that_cannot_be_used_are_refused_by_their_number(void **state)
{
    static fixture f;
    cairn_fault fault = {-1, NULL};

    (void)state;
    open_fixture(&f, SIM_RESCUE, 4, 179, 180);
    assert_status(cairn_angle_step_begin(NULL, f.scans, SCANS, &fault), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_angle_step_begin(f.angle_step, NULL, 1, &fault), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_angle_step_begin(f.angle_step, f.scans, -1, &fault), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_angle_step_begin(f.angle_step, f.scans, 0, &fault), CAIRN_EMPTY);
    assert_status(cairn_angle_step_step(f.angle_step, NULL), CAIRN_BAD_ARGUMENT);
    f.scans[3].input.count = BEAMS + 1;
    assert_status(cairn_angle_step_begin(f.angle_step, f.scans, SCANS, &fault), CAIRN_FULL);
    assert_int_equal(fault.index, 3);
    f.scans[3].input.count = 0;
    assert_status(cairn_angle_step_begin(f.angle_step, f.scans, SCANS, &fault), CAIRN_BAD_ARGUMENT);
    assert_int_equal(fault.index, 3);
    f.scans[3].input.count = BEAMS;
    f.scans[7].robot.x = (cairn_real)NAN;
    assert_status(cairn_angle_step_begin(f.angle_step, f.scans, SCANS, &fault), CAIRN_NOT_FINITE);
    assert_int_equal(fault.index, 7);
    close_fixture(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_field_of_view_that_is_one_beam_too_wide_is_found),
        cmocka_unit_test(a_right_log_that_looks_like_the_mistake_is_left_alone),
        cmocka_unit_test(another_wrong_step_is_estimated_but_is_not_the_mistake),
        cmocka_unit_test(only_n_round_steps_over_n_beams_look_like_the_mistake),
        cmocka_unit_test(uncertain_or_small_deviations_are_no_mistake),
        cmocka_unit_test(a_drive_that_does_not_move_says_nothing),
        cmocka_unit_test(budgets_of_1_7_1000_and_all_give_the_same_bits),
        cmocka_unit_test(an_estimate_begun_anew_knows_nothing_of_the_last_one),
        cmocka_unit_test(its_memory_suffices_and_less_is_refused),
        cmocka_unit_test(scans_that_cannot_be_used_are_refused_by_their_number),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
