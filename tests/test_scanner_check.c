/* Check of the scanner's set-up: drives of the simulation made wrong on purpose. Each fault is
 * found, nothing else is, and the correction that was found makes the check silent. */
#include "src/host/maps/scanner_check_run.h"

#include <math.h>

#include "src/host/logs/scan_log_correction.h"
#include "tests/drive.h"

/* Scans of a drive; a sweep is found less surely than the other faults. */
enum { SCANS = 60, SCANS_OF_SWEEP = 110 };
enum { BEAMS = 361 };

#define DEGREE (3.14159265358979323846 / 180)

/* ---- Logs ---- */

/* A drive of a robot as a log. */
static cairn_scan_log simulate(sim_scene scene, uint64_t seed, int32_t length, double scan_time)
{
    sim_arena_options where = sim_arena_default();
    sim_survey_options how = sim_survey_default();
    cairn_scan_log log;
    sim_arena *arena;
    sim_survey *survey;
    const sim_scan *scans;
    int32_t count;
    float *range;

    where.scene = scene;
    where.seed = how.seed = seed;
    how.drive = length;
    how.drive_distance = 0.4;
    how.drive_turn = 0.3;
    how.beams = BEAMS;
    how.fov = 3.14159265;
    how.scan_time = scan_time;
    arena = sim_arena_create(&where, NULL, 0);
    assert_non_null(arena);
    survey = sim_survey_create(arena, &how, NULL, 0);
    assert_non_null(survey);
    scans = sim_survey_scans(survey, &count);
    memset(&log, 0, sizeof log);
    log.has_odometry = 1;
    log.scans.record = calloc((size_t)count, sizeof *log.scans.record);
    log.scans.range = range = malloc((size_t)count * (size_t)how.beams * sizeof *range);
    assert_non_null(log.scans.record);
    assert_non_null(range);
    for (int32_t i = 0; i < count; i++, range += how.beams) {
        cairn_carmen_log_record *record = &log.scans.record[log.scans.count++];

        memcpy(range, scans[i].range, (size_t)how.beams * sizeof *range);
        record->count = record->scan.count = how.beams;
        record->range = record->scan.range = range;
        record->scan.angle_min = (float)scans[i].angle_min;
        record->scan.angle_step = (float)scans[i].angle_step;
        record->scan.range_min = (float)scans[i].range_min;
        record->scan.range_max = (float)scans[i].range_max;
        record->scan.range_sigma = (float)scans[i].range_sigma;
        record->scan.base_sensor = pose_of(scans[i].base_sensor);
        record->robot = pose_of(scans[i].odometry);
        record->stamp_ns = record->scan.stamp_ns = scans[i].stamp_ns;
    }
    sim_survey_free(survey);
    sim_arena_free(arena);
    log.scans.info.odometry_length = length;
    return log;
}

static cairn_scanner_check_result check_of(const cairn_scan_log *log)
{
    cairn_scanner_check_result check;

    assert_ok(cairn_scanner_check_run(&check, log, NULL));
    return check;
}

/* Fails unless the faults are those whose bits are set. */
static void assert_faults(const cairn_scanner_check_result *check, int32_t bits)
{
    int32_t found = 0;

    for (int i = 0; i < CAIRN_SCANNER_CHECK_FAULTS; i++)
        found |= cairn_scanner_check_has(check, (cairn_scanner_check_fault)i) << i;
    assert_int_equal(found, bits);
}

/* Makes a log wrong by a correction that is the inverse of the right one. Fails unless the check
 * finds the faults whose bits are set. */
static cairn_scanner_check_result check_of_wrong(cairn_scan_log *log,
                                                 const cairn_scan_correction *wrong, int32_t bits)
{
    cairn_scanner_check_result check;

    assert_ok(cairn_scan_log_correct(log, wrong));
    /* it is not known that a scan takes time */
    for (int32_t i = 0; i < log->scans.count; i++)
        log->scans.record[i].scan.time_step = 0;
    check = check_of(log);
    assert_faults(&check, bits);
    return check;
}

/* The log of a scanner that is mounted elsewhere than it says. */
static void mount_elsewhere(cairn_scan_log *log, cairn_pose base_sensor)
{
    for (int32_t i = 0; i < log->scans.count; i++)
        log->scans.record[i].robot =
            cairn_pose_compose(log->scans.record[i].robot, cairn_pose_inverse(base_sensor));
}

/* Corrects what was found, after which nothing is found. Frees the log. */
static void assert_mended(cairn_scan_log *log, const cairn_scanner_check_result *check)
{
    cairn_scan_correction mend = cairn_scan_correction_none();
    cairn_scanner_check_result again;

    mend.range_scale = check->range_scale;
    mend.flips = check->flips;
    if (cairn_scanner_check_has(check, CAIRN_SCANNER_CHECK_STEP))
        mend.angle_step = check->step.value * check->angle_step;
    if (cairn_scanner_check_has(check, CAIRN_SCANNER_CHECK_SWEEP))
        mend.sweep = check->sweep_found.value;
    mend.has_sensor = cairn_scanner_check_has(check, CAIRN_SCANNER_CHECK_SENSOR);
    mend.base_sensor.x = check->x.value;
    mend.base_sensor.y = check->y.value;
    mend.base_sensor.theta = check->theta.value;
    assert_ok(cairn_scan_log_correct(log, &mend));
    again = check_of(log);
    assert_faults(&again, 0);
    cairn_scan_log_free(log);
}

/* ---- Tests of whole logs ---- */

static void clean_drives_have_no_fault(void **state)
{
    static const sim_scene scenes[] = {SIM_RESCUE, SIM_OFFICE};

    (void)state;
    for (size_t i = 0; i < sizeof scenes / sizeof *scenes; i++) {
        cairn_scan_log log = simulate(scenes[i], 5 + i, SCANS, 0);
        cairn_scanner_check_result check = check_of(&log);

        assert_faults(&check, 0);
        assert_true(check.pairs > SCANS / 2 && check.turns > 20 && check.walls > 200);
        assert_true(check.turn.is_known && check.step.is_known && check.sweep_found.is_known);
        assert_true(check.x.is_known && check.theta.is_known && check.distance.is_known);
        cairn_scan_log_free(&log);
    }
}

static void a_scanner_upside_down_is_found(void **state)
{
    cairn_scan_correction wrong = cairn_scan_correction_none();
    cairn_scan_log log = simulate(SIM_OFFICE, 7, SCANS, 0);
    cairn_scanner_check_result check;

    (void)state;
    wrong.flips = 1;
    check = check_of_wrong(&log, &wrong, 1 << CAIRN_SCANNER_CHECK_FLIP);
    assert_near(check.turn.value, -1, 0.05);
    cairn_scan_log_free(&log);
}

static void ranges_in_another_unit_are_found(void **state)
{
    static const double units[] = {0.001, 100};

    (void)state;
    for (size_t i = 0; i < sizeof units / sizeof *units; i++) {
        cairn_scan_correction wrong = cairn_scan_correction_none();
        cairn_scan_log log = simulate(SIM_OFFICE, 8, SCANS, 0);
        cairn_scanner_check_result check;

        wrong.range_scale = (cairn_real)(1 / units[i]);
        check = check_of_wrong(&log, &wrong, 1 << CAIRN_SCANNER_CHECK_RANGES);
        assert_near((double)check.range_scale / units[i], 1, NUMBER(1e-12, 1e-6));
        cairn_scan_log_free(&log);
    }
}

static void without_odometry_ranges_in_mm_are_found_by_their_median(void **state)
{
    cairn_scan_correction wrong = cairn_scan_correction_none();
    cairn_scan_log log = simulate(SIM_OFFICE, 8, SCANS, 0);
    cairn_scanner_check_result check;

    (void)state;
    log.has_odometry = 0;
    wrong.range_scale = 1000;
    check = check_of_wrong(&log, &wrong, 1 << CAIRN_SCANNER_CHECK_RANGES);
    assert_near(check.range_scale, 0.001, NUMBER(1e-12, 1e-9));
    assert_false(check.distance.is_known);
    cairn_scan_log_free(&log);
}

static void a_wrong_angle_step_is_found_with_and_without_odometry(void **state)
{
    static const double factors[] = {0.98, 1.5};

    (void)state;
    for (size_t i = 0; i < sizeof factors / sizeof *factors; i++)
        for (int32_t has_odometry = 0; has_odometry <= (factors[i] < 1.1); has_odometry++) {
            cairn_scan_correction wrong = cairn_scan_correction_none();
            cairn_scan_log log = simulate(SIM_OFFICE, 9, SCANS, 0);
            cairn_scanner_check_result check;

            /* a large error is found by the turns of the odometry */
            log.has_odometry = factors[i] < 1.1 ? has_odometry : 1;
            wrong.angle_step = (cairn_real)(factors[i] * 0.5 * DEGREE);
            check = check_of_wrong(&log, &wrong, 1 << CAIRN_SCANNER_CHECK_STEP);
            assert_near((double)check.step.value * factors[i], 1, 0.004);
            assert_true(check.step.sigma > 0 && check.step.sigma < CAIRN_REAL(0.002));
            assert_mended(&log, &check);
        }
}

static void a_small_error_of_the_step_needs_overlapping_scans(void **state)
{
    static const double factors[] = {0.992, 1.008};

    (void)state;
    for (size_t i = 0; i < sizeof factors / sizeof *factors; i++) {
        cairn_scan_correction wrong = cairn_scan_correction_none();
        cairn_scan_log log = simulate(SIM_OFFICE, 9, SCANS_OF_SWEEP, 0);
        cairn_scanner_check_result check;

        wrong.angle_step = (cairn_real)(factors[i] * 0.5 * DEGREE);
        check = check_of_wrong(&log, &wrong, 1 << CAIRN_SCANNER_CHECK_STEP);
        assert_int_equal(cairn_scanner_check_needs_overlap(&check), 1);
        assert_true(check.overlap_step.is_known);
        assert_near((double)check.overlap_step.value * factors[i], 1, 0.002);
        check.overlap_step.is_known = 0;
        assert_faults(&check, 0);
        cairn_scan_log_free(&log);
    }
}

/* Ranges whose error grows with their square bend walls as a wrong step does. */
static void walls_bent_by_errors_of_the_ranges_are_no_wrong_step(void **state)
{
    const float per_metre = 0.006F;
    cairn_scan_log log = simulate(SIM_OFFICE, 9, SCANS_OF_SWEEP, 0);
    cairn_scanner_check_result check;

    (void)state;
    for (int32_t i = 0; i < log.scans.count * BEAMS; i++)
        log.scans.range[i] *= 1 + per_metre * log.scans.range[i];
    check = check_of(&log);
    assert_int_equal(cairn_scanner_check_needs_overlap(&check), 1);
    assert_true(check.overlap_step.is_known);
    assert_int_equal(cairn_scanner_check_has(&check, CAIRN_SCANNER_CHECK_STEP), 0);
    cairn_scan_log_free(&log);
}

static void estimates_of_the_step_must_agree(void **state)
{
    /* per thousand: step of walls, that of overlapping scans (0: unknown), both with a standard
     * deviation of 1; whether it needs the other, and is found */
    static const int cases[][4] = {
        {995, 0, 1, 0},     {995, 994, 1, 1},   {995, 999, 1, 0},   {1008, 1005, 1, 1},
        {1008, 1003, 1, 0}, {1008, 1013, 1, 0}, {1003, 1003, 0, 0}, {980, 0, 0, 1},
        {980, 1000, 0, 1},  {1000, 995, 0, 0},
    };

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        cairn_scanner_check_result check;

        memset(&check, 0, sizeof check);
        check.range_scale = 1;
        check.step =
            (cairn_scanner_check_value){(cairn_real)(cases[i][0] / 1000.0), CAIRN_REAL(0.001), 1};
        check.overlap_step = (cairn_scanner_check_value){(cairn_real)(cases[i][1] / 1000.0),
                                                         CAIRN_REAL(0.001), cases[i][1] > 0};
        assert_int_equal(cairn_scanner_check_needs_overlap(&check), cases[i][2]);
        assert_int_equal(cairn_scanner_check_has(&check, CAIRN_SCANNER_CHECK_STEP), cases[i][3]);
    }
    assert_int_equal(cairn_scanner_check_needs_overlap(NULL), 0);
}

static void a_sweep_is_found_in_either_order_of_the_beams(void **state)
{
    static const double sweeps[] = {0.1, -0.1};

    (void)state;
    for (size_t i = 0; i < sizeof sweeps / sizeof *sweeps; i++) {
        cairn_scan_correction wrong = cairn_scan_correction_none();
        cairn_scan_log log = simulate(SIM_OFFICE, 10, SCANS_OF_SWEEP, 0.1);
        cairn_scanner_check_result check;

        wrong.sweep = (cairn_real)sweeps[i];
        check = check_of_wrong(&log, &wrong, 1 << CAIRN_SCANNER_CHECK_SWEEP);
        assert_near(check.sweep_found.value, sweeps[i], 0.015);
        assert_mended(&log, &check);
    }
}

static void a_wrong_pose_of_the_sensor_is_found(void **state)
{
    const cairn_pose base_sensor = {CAIRN_REAL(0.25), CAIRN_REAL(-0.1), (cairn_real)(10 * DEGREE)};
    cairn_scan_log log = simulate(SIM_OFFICE, 11, SCANS, 0);
    cairn_scanner_check_result check;

    (void)state;
    mount_elsewhere(&log, base_sensor);
    check = check_of(&log);
    assert_faults(&check, 1 << CAIRN_SCANNER_CHECK_SENSOR);
    assert_near(check.x.value, base_sensor.x, 0.02);
    assert_near(check.y.value, base_sensor.y, 0.02);
    assert_near(check.theta.value, base_sensor.theta, 0.5 * DEGREE);
    cairn_scan_log_free(&log);
}

static void faults_are_found_together(void **state)
{
    const cairn_pose base_sensor = {CAIRN_REAL(0.25), 0, (cairn_real)(10 * DEGREE)};
    cairn_scan_correction wrong = cairn_scan_correction_none();
    cairn_scan_log log = simulate(SIM_OFFICE, 12, SCANS, 0);
    cairn_scanner_check_result check;

    (void)state;
    mount_elsewhere(&log, base_sensor);
    wrong.flips = 1;
    wrong.range_scale = 1000;
    wrong.angle_step = (cairn_real)(1.02 * 0.5 * DEGREE);
    check = check_of_wrong(&log, &wrong,
                           1 << CAIRN_SCANNER_CHECK_FLIP | 1 << CAIRN_SCANNER_CHECK_RANGES |
                               1 << CAIRN_SCANNER_CHECK_STEP | 1 << CAIRN_SCANNER_CHECK_SENSOR);
    assert_mended(&log, &check);
}

/* Scales what the odometry says of each motion. */
static void scale_odometry(cairn_scan_log *log, cairn_real distance, cairn_real turn)
{
    cairn_pose robot = log->scans.record[0].robot;

    for (int32_t i = 1; i < log->scans.count; i++) {
        cairn_pose motion = cairn_pose_between(robot, log->scans.record[i].robot);

        robot = log->scans.record[i].robot;
        motion.x *= distance;
        motion.y *= distance;
        motion.theta *= turn;
        log->scans.record[i].robot = cairn_pose_compose(log->scans.record[i - 1].robot, motion);
    }
}

static void a_wrong_odometry_is_found(void **state)
{
    cairn_scan_log log = simulate(SIM_OFFICE, 13, SCANS, 0);
    cairn_scanner_check_result check;

    (void)state;
    scale_odometry(&log, CAIRN_REAL(1.25), 1);
    check = check_of(&log);
    assert_faults(&check, 1 << CAIRN_SCANNER_CHECK_DISTANCE);
    assert_near(check.distance.value, 1 / 1.25, 0.03);
    cairn_scan_log_free(&log);
}

/* The angle step that these turns would have bends the walls: it is not taken. */
static void wrong_turns_of_the_odometry_are_no_wrong_step(void **state)
{
    static const double scales[] = {0.7, 1.4};

    (void)state;
    for (size_t i = 0; i < sizeof scales / sizeof *scales; i++) {
        cairn_scan_log log = simulate(SIM_OFFICE, 14, SCANS, 0);
        cairn_scanner_check_result check;

        scale_odometry(&log, 1, (cairn_real)scales[i]);
        check = check_of(&log);
        assert_faults(&check, 1 << CAIRN_SCANNER_CHECK_TURN);
        assert_near((double)check.turn_scale.value * scales[i], 1, 0.04);
        assert_near(check.step.value, 1, 0.004);
        cairn_scan_log_free(&log);
    }
}

static void stamps_and_repeated_scans_are_found(void **state)
{
    cairn_scan_log log = simulate(SIM_OFFICE, 14, SCANS, 0);
    cairn_scanner_check_result check;

    (void)state;
    for (int32_t i = 10; i < log.scans.count; i += 10) {
        memcpy(&log.scans.range[i * BEAMS], &log.scans.range[(i - 1) * BEAMS],
               BEAMS * sizeof *log.scans.range);
        memcpy(&log.scans.range[(i + 1) * BEAMS], &log.scans.range[(i - 1) * BEAMS],
               BEAMS * sizeof *log.scans.range);
        log.scans.record[i].stamp_ns = log.scans.record[i - 1].stamp_ns;
        log.scans.record[i + 2].stamp_ns -= INT64_C(100000000000);
    }
    check = check_of(&log);
    assert_int_equal(check.repeated, 10);
    assert_int_equal(check.constant, 5);
    assert_int_equal(check.backward, 5);
    assert_faults(&check, 1 << CAIRN_SCANNER_CHECK_STAMPS | 1 << CAIRN_SCANNER_CHECK_REPEATED);
    cairn_scan_log_free(&log);
}

static void one_scan_a_still_robot_and_blind_scans_say_nothing(void **state)
{
    cairn_scan_log log = simulate(SIM_OFFICE, 15, SCANS, 0);
    cairn_scanner_check_result check;

    (void)state;
    log.scans.count = 1;
    check = check_of(&log);
    assert_faults(&check, 0);
    assert_int_equal(check.pairs, 0);
    assert_false(check.turn.is_known || check.x.is_known || check.step.is_known);
    log.scans.count = SCANS;
    log.scans.info.odometry_length = 0;
    for (int32_t i = 0; i < SCANS; i++)
        log.scans.record[i].robot = cairn_pose_identity();
    check = check_of(&log);
    assert_faults(&check, 0);
    assert_false(check.has_odometry || check.turn.is_known || check.x.is_known);
    assert_true(check.step.is_known);
    for (int32_t i = 0; i < SCANS * BEAMS; i++)
        log.scans.range[i] = INFINITY;
    check = check_of(&log);
    assert_faults(&check, 0);
    assert_int_equal(check.walls, 0);
    cairn_scan_log_free(&log);
}

static void the_median_is_that_of_the_sorted_ranges(void **state)
{
    cairn_scan_log log = simulate(SIM_RESCUE, 16, SCANS, 0);
    double quartile[3];

    (void)state;
    for (int32_t beams = 0; beams < 4; beams++) {
        cairn_scanner_check_result check;

        /* from one return to four */
        for (int32_t i = 0; i < SCANS; i++)
            log.scans.record[i].count = log.scans.record[i].scan.count = 1;
        log.scans.count = 1 + beams;
        assert_ok(cairn_scan_log_quartiles(&log, quartile));
        check = check_of(&log);
        assert_near(check.median_range, quartile[1], 0);
    }
    for (int32_t i = 0; i < SCANS; i++)
        log.scans.record[i].count = log.scans.record[i].scan.count = BEAMS;
    log.scans.count = SCANS;
    assert_ok(cairn_scan_log_quartiles(&log, quartile));
    assert_near(check_of(&log).median_range, quartile[1], 0);
    cairn_scan_log_free(&log);
}

/* ---- Tests of the object ---- */

enum { SHORT_DRIVE = 16, SHORT_BEAMS = 91 };

/* A short drive, of every fourth beam, and a check for it. */
typedef struct fixture {
    cairn_scan_log log;
    float range[SHORT_DRIVE][SHORT_BEAMS];
    cairn_scanner_check_scan scans[SHORT_DRIVE];
    cairn_scanner_check_params params;
    cairn_pool pool;
    cairn_scanner_check *check;
} fixture;

static void open_fixture(fixture *f)
{
    f->log = simulate(SIM_OFFICE, 17, SHORT_DRIVE, 0);
    for (int32_t i = 0; i < SHORT_DRIVE; i++) {
        for (int32_t k = 0; k < SHORT_BEAMS; k++)
            f->range[i][k] = f->log.scans.record[i].range[4 * k];
        f->scans[i].input = f->log.scans.record[i].scan;
        f->scans[i].input.range = f->range[i];
        f->scans[i].input.count = SHORT_BEAMS;
        f->scans[i].input.angle_step *= 4;
        f->scans[i].robot = f->log.scans.record[i].robot;
    }
    f->params = cairn_scanner_check_default();
    f->params.max_beams = SHORT_BEAMS;
    f->params.max_points = 1024;
    f->params.max_segments = 64;
    f->params.max_pairs = 12;
    f->params.max_walls = 8;
    f->pool = test_pool(cairn_scanner_check_memory(&f->params));
    assert_ok(cairn_scanner_check_create(&f->check, &f->pool, &f->params));
}

static void close_fixture(fixture *f)
{
    test_pool_free(&f->pool);
    cairn_scan_log_free(&f->log);
}

static cairn_status begin(fixture *f, cairn_fault *fault)
{
    return cairn_scanner_check_begin(f->check, f->scans, SHORT_DRIVE, 1, fault);
}

static cairn_scanner_check_result run_by(cairn_scanner_check *check, int32_t units)
{
    cairn_budget budget = {0};
    cairn_status status;

    assert_status(cairn_scanner_check_step(check, &budget), CAIRN_MORE);
    do {
        budget.left = units;
        status = cairn_scanner_check_step(check, &budget);
    } while (status == CAIRN_MORE);
    assert_ok(status);
    assert_ok(cairn_scanner_check_step(check, &budget)); /* nothing left to do */
    return cairn_scanner_check_read(check);
}

static void budgets_of_1_7_1000_and_all_give_the_same_bits(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    static fixture f;
    cairn_scanner_check_result whole;
    cairn_scanner_check_measure measure;

    (void)state;
    open_fixture(&f);
    assert_ok(begin(&f, NULL));
    whole = run_by(f.check, CAIRN_UNBOUNDED);
    measure = cairn_scanner_check_measured(f.check);
    assert_true(whole.pairs >= 10 && whole.turns > 0 && whole.walls >= 30);
    assert_true(measure.units > 1000 && measure.rounds >= 2);
    for (size_t i = 0; i < sizeof budgets / sizeof *budgets; i++) {
        cairn_scanner_check_result parts;

        assert_ok(begin(&f, NULL));
        assert_int_equal(cairn_scanner_check_read(f.check).scans, 0);
        parts = run_by(f.check, budgets[i]);
        assert_memory_equal(&parts, &whole, sizeof whole);
        assert_true(cairn_scanner_check_measured(f.check).units == measure.units);
        assert_int_equal(cairn_scanner_check_measured(f.check).rounds, measure.rounds);
    }
    close_fixture(&f);
}

static void a_right_unit_is_compared_with_no_other(void **state)
{
    static fixture f;
    int32_t rounds;

    (void)state;
    open_fixture(&f);
    assert_ok(cairn_scanner_check_begin(f.check, f.scans, SHORT_DRIVE, 0, NULL));
    (void)run_by(f.check, CAIRN_UNBOUNDED);
    rounds = cairn_scanner_check_measured(f.check).rounds;
    assert_ok(begin(&f, NULL));
    assert_near(run_by(f.check, CAIRN_UNBOUNDED).range_scale, 1, 0);
    /* the unit of the log alone is compared with the odometry */
    assert_int_equal(cairn_scanner_check_measured(f.check).rounds, rounds + 1);
    close_fixture(&f);
}

static cairn_status begin_again(void *context)
{
    return begin(context, NULL);
}

static cairn_status step_again(void *context, cairn_budget *budget)
{
    return cairn_scanner_check_step(((fixture *)context)->check, budget);
}

static uint64_t hash_of_result(void *context)
{
    cairn_scanner_check_result result = cairn_scanner_check_read(((fixture *)context)->check);

    return test_hash(TEST_HASH_START, &result, sizeof result);
}

static void a_check_begun_anew_knows_nothing_of_the_last_one(void **state)
{
    static fixture f;
    const test_stepped stepped = {begin_again, step_again, hash_of_result, &f};

    (void)state;
    open_fixture(&f);
    test_begins_anew(&stepped, 6);
    close_fixture(&f);
}

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_scanner_check *check;

    return cairn_scanner_check_create(&check, pool, context);
}

static void its_memory_suffices_and_less_is_refused(void **state)
{
    cairn_scanner_check_params params = cairn_scanner_check_default();

    (void)state;
    params.max_beams = 8;
    params.max_points = params.max_segments = 4;
    params.max_pairs = params.max_walls = 2;
    test_every_pool_size(create, &params, cairn_scanner_check_memory(&params));
}

static void what_cannot_be_checked_is_refused_by_the_number_of_its_scan(void **state)
{
    static fixture f;
    cairn_scanner_check_scan kept;
    cairn_scanner_check_result before, after;
    cairn_fault fault;

    (void)state;
    open_fixture(&f);
    assert_ok(begin(&f, NULL));
    before = run_by(f.check, CAIRN_UNBOUNDED);
    kept = f.scans[3];
    assert_fault(&fault, cairn_scanner_check_begin(NULL, f.scans, 1, 1, &fault), CAIRN_BAD_ARGUMENT,
                 -1);
    assert_fault(&fault, cairn_scanner_check_begin(f.check, NULL, 1, 1, &fault), CAIRN_BAD_ARGUMENT,
                 -1);
    assert_fault(&fault, cairn_scanner_check_begin(f.check, f.scans, -1, 1, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    assert_fault(&fault, cairn_scanner_check_begin(f.check, f.scans, 0, 1, &fault), CAIRN_EMPTY,
                 -1);
    f.scans[3].input.range = NULL;
    assert_fault(&fault, begin(&f, &fault), CAIRN_BAD_ARGUMENT, 3);
    f.scans[3] = kept;
    f.scans[3].input.count = 0;
    assert_fault(&fault, begin(&f, &fault), CAIRN_BAD_ARGUMENT, 3);
    f.scans[3].input.count = SHORT_BEAMS + 1;
    assert_fault(&fault, begin(&f, &fault), CAIRN_FULL, 3);
    f.scans[3] = kept;
    f.scans[3].input.stamp_ns = CAIRN_SCAN_MAX_STAMP_NS + 1;
    assert_fault(&fault, begin(&f, &fault), CAIRN_BAD_ARGUMENT, 3);
    f.scans[3].input.stamp_ns = -CAIRN_SCAN_MAX_STAMP_NS - 1;
    assert_fault(&fault, begin(&f, &fault), CAIRN_BAD_ARGUMENT, 3);
    f.scans[3] = kept;
    f.scans[3].input.base_sensor.y = (cairn_real)NAN;
    assert_fault(&fault, begin(&f, &fault), CAIRN_NOT_FINITE, 3);
    f.scans[3] = kept;
    f.scans[3].robot.theta = (cairn_real)INFINITY;
    assert_fault(&fault, begin(&f, &fault), CAIRN_NOT_FINITE, 3);
    after = cairn_scanner_check_read(f.check);
    assert_memory_equal(&after, &before, sizeof before);
    /* without odometry poses are not read */
    assert_ok(cairn_scanner_check_begin(f.check, f.scans, SHORT_DRIVE, 0, &fault));
    after = run_by(f.check, CAIRN_UNBOUNDED);
    assert_int_equal(after.moved, 0);
    assert_false(after.has_odometry || after.x.is_known);
    close_fixture(&f);
}

static void steps_below_2_cm_are_not_moves(void **state)
{
    fixture f;

    (void)state;
    open_fixture(&f);
    for (int32_t i = 0; i < SHORT_DRIVE; i++)
        f.scans[i].robot = (cairn_pose){(cairn_real)(0.015 * i), 0, 0};
    assert_ok(begin(&f, NULL));
    assert_int_equal(run_by(f.check, CAIRN_UNBOUNDED).moved, 0);
    for (int32_t i = 0; i < SHORT_DRIVE; i++)
        f.scans[i].robot.x = (cairn_real)(0.025 * i);
    assert_ok(begin(&f, NULL));
    assert_int_equal(run_by(f.check, CAIRN_UNBOUNDED).moved, SHORT_DRIVE - 1);
    close_fixture(&f);
}

static void a_fault_that_there_is_not_is_never_found(void **state)
{
    cairn_scanner_check_result result;

    (void)state;
    memset(&result, 0, sizeof result);
    result.range_scale = 2;
    assert_true(cairn_scanner_check_has(&result, CAIRN_SCANNER_CHECK_RANGES));
    assert_false(cairn_scanner_check_has(&result, CAIRN_SCANNER_CHECK_FAULTS));
    assert_false(cairn_scanner_check_has(&result, -1));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(clean_drives_have_no_fault),
        cmocka_unit_test(a_scanner_upside_down_is_found),
        cmocka_unit_test(ranges_in_another_unit_are_found),
        cmocka_unit_test(without_odometry_ranges_in_mm_are_found_by_their_median),
        cmocka_unit_test(a_wrong_angle_step_is_found_with_and_without_odometry),
        cmocka_unit_test(a_small_error_of_the_step_needs_overlapping_scans),
        cmocka_unit_test(walls_bent_by_errors_of_the_ranges_are_no_wrong_step),
        cmocka_unit_test(estimates_of_the_step_must_agree),
        cmocka_unit_test(a_sweep_is_found_in_either_order_of_the_beams),
        cmocka_unit_test(a_wrong_pose_of_the_sensor_is_found),
        cmocka_unit_test(faults_are_found_together),
        cmocka_unit_test(a_wrong_odometry_is_found),
        cmocka_unit_test(wrong_turns_of_the_odometry_are_no_wrong_step),
        cmocka_unit_test(stamps_and_repeated_scans_are_found),
        cmocka_unit_test(one_scan_a_still_robot_and_blind_scans_say_nothing),
        cmocka_unit_test(the_median_is_that_of_the_sorted_ranges),
        cmocka_unit_test(budgets_of_1_7_1000_and_all_give_the_same_bits),
        cmocka_unit_test(a_right_unit_is_compared_with_no_other),
        cmocka_unit_test(a_check_begun_anew_knows_nothing_of_the_last_one),
        cmocka_unit_test(its_memory_suffices_and_less_is_refused),
        cmocka_unit_test(what_cannot_be_checked_is_refused_by_the_number_of_its_scan),
        cmocka_unit_test(steps_below_2_cm_are_not_moves),
        cmocka_unit_test(a_fault_that_there_is_not_is_never_found),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
