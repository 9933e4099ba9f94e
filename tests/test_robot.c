/* The robot of the firmware and its flight recorder, and `cairn replay` of what it wrote. */
#include <math.h>
#include <pthread.h>

#include "firmware/recorder.h"
#include "firmware/robot.h"
#include "tests/programs.h"
#include "tests/test.h"

enum { SWEEPS = 5, BEAMS = 121, MEMORY = 400 * 1024, STREAM = 64 * 1024 };

/* Sweeps of a room of 4 x 3 m from places that lie in it, with poses that are a little wrong. */
typedef struct walk {
    float range[SWEEPS][BEAMS];
    robot_sweep sweep[SWEEPS];
} walk;

static float range_to_wall(cairn_real x, cairn_real y, cairn_real angle)
{
    cairn_real c = cairn_cos(angle), s = cairn_sin(angle);
    cairn_real to_x = c > 0 ? (4 - x) / c : c < 0 ? -x / c : 100, to_y = s > 0 ? (3 - y) / s : s < 0 ? -y / s : 100;

    return (float)cairn_min(to_x, to_y);
}

static void make_walk(walk *w, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 1);

    for (int32_t i = 0; i < SWEEPS; i++) {
        robot_sweep *sweep = &w->sweep[i];
        cairn_real x = 1 + (cairn_real)i / 2, y = cairn_random_uniform(&random, 1, 2);
        cairn_real theta = cairn_random_uniform(&random, -3, 3);

        sweep->range = w->range[i];
        sweep->count = BEAMS;
        sweep->angle_min = -3.0f;
        sweep->angle_step = 0.05f;
        for (int32_t k = 0; k < BEAMS; k++)
            w->range[i][k] = range_to_wall(
                x, y, theta + (cairn_real)sweep->angle_min + (cairn_real)k * (cairn_real)sweep->angle_step);
        sweep->pose.x = x + cairn_random_uniform(&random, -CAIRN_REAL(0.05), CAIRN_REAL(0.05));
        sweep->pose.y = y;
        sweep->pose.theta = theta + cairn_random_uniform(&random, -CAIRN_REAL(0.03), CAIRN_REAL(0.03));
    }
    w->range[1][7] = (float)INFINITY;
    w->range[2][9] = (float)NAN;
    w->range[3][11] = 0;
}

static robot_params room_params(void)
{
    robot_params params;

    memset(&params, 0, sizeof params);
    params.range_max = 8;
    params.range_sigma = 0.01f;
    params.scan = cairn_scan_default();
    params.scan.max_beams = BEAMS;
    params.scan.max_segments = 32;
    params.scan.max_points = 200;
    params.field = cairn_force_field_default();
    params.field.max_scans = SWEEPS;
    params.field.max_points = SWEEPS * 150;
    params.field.max_segments = SWEEPS * 8;
    params.field.max_corners = 32;
    params.field.max_steps = 10;
    params.grid = cairn_occupancy_grid_default();
    params.grid.width = 30;
    params.grid.height = 25;
    params.grid.resolution = CAIRN_REAL(0.2);
    params.grid.origin.x = params.grid.origin.y = -1;
    return params;
}

typedef struct stream {
    unsigned char bytes[STREAM];
    uint32_t used;
} stream;

static void append(void *context, const void *data, uint32_t bytes)
{
    stream *s = context;

    if (s == NULL)
        return;
    assert_true(bytes <= STREAM - s->used);
    memcpy(s->bytes + s->used, data, bytes);
    s->used += bytes;
}

typedef struct flown {
    cairn_pose pose[SWEEPS];
    uint32_t hash, ticks;
} flown;

/* The whole run of a walk, a sweep every `arrival` ticks; budgets take turns when `second` differs. */
static flown fly(const walk *w, int32_t arrival, int32_t first, int32_t second, stream *s)
{
    static const robot none;
    unsigned char *memory = malloc(MEMORY);
    robot r = none;
    robot_params params = room_params();
    recorder recording;
    flown result = {.hash = ROBOT_HASH_START};
    cairn_status status = CAIRN_MORE;

    assert_non_null(memory);
    if (s != NULL)
        s->used = 0;
    assert_int_equal(robot_create(&r, memory, MEMORY, &params), CAIRN_OK);
    recorder_begin(&recording, append, s, &params, MEMORY);
    while (status == CAIRN_MORE) {
        cairn_budget budget = {r.ticks % 3 == 2 ? second : first};
        robot_work work;

        if (!r.finished && (int32_t)r.ticks >= arrival * r.offered &&
            robot_offer(&r, &w->sweep[r.offered]) == CAIRN_OK) {
            recorder_sweep(&recording, &w->sweep[r.offered - 1]);
            if (r.offered == SWEEPS) {
                robot_finish(&r);
                recorder_finish(&recording);
            }
        }
        recorder_tick(&recording, budget.left);
        status = robot_tick(&r, &budget, &work);
        result.hash = robot_hash(&r, result.hash);
        assert_true(r.ticks < 200000);
    }
    assert_int_equal(status, CAIRN_OK);
    recorder_end(&recording, r.ticks, result.hash);
    result.ticks = r.ticks;
    assert_int_equal(cairn_force_field_pose_count(r.field), SWEEPS);
    for (int32_t i = 0; i < SWEEPS; i++)
        result.pose[i] = cairn_force_field_pose(r.field, i);
    free(memory);
    return result;
}

/* When every sweep comes after all is done with the one before, the budgets do not matter. */
static void budgets_do_not_matter(void **state)
{
    walk w;
    flown a, b;

    (void)state;
    make_walk(&w, 1);
    a = fly(&w, 3000, 1000, 1000, NULL);
    b = fly(&w, 3000, 70, 3000, NULL);
    assert_true(a.ticks != b.ticks);
    assert_memory_equal(a.pose, b.pose, sizeof a.pose);
}

static void the_same_run_has_the_same_hash(void **state)
{
    walk w, other;
    flown a, b, c;

    (void)state;
    make_walk(&w, 1);
    make_walk(&other, 2);
    a = fly(&w, 5, 200, 90, NULL);
    b = fly(&w, 5, 200, 90, NULL);
    c = fly(&other, 5, 200, 90, NULL);
    assert_int_equal(a.hash, b.hash);
    assert_int_equal(a.ticks, b.ticks);
    assert_true(a.hash != c.hash);
}

static void scans_move_towards_each_other(void **state)
{
    walk w;
    flown a;

    (void)state;
    make_walk(&w, 3);
    a = fly(&w, 5, 500, 500, NULL);
    assert_memory_equal(&a.pose[0], &w.sweep[0].pose, sizeof a.pose[0]);
    for (int32_t i = 1; i < SWEEPS; i++)
        assert_true(memcmp(&a.pose[i], &w.sweep[i].pose, sizeof a.pose[i]) != 0);
}

static void offers_wait_their_turn(void **state)
{
    static unsigned char memory[MEMORY];
    static robot r;
    robot_params params = room_params();
    cairn_budget budget = {1};
    robot_work work;
    walk w;

    (void)state;
    make_walk(&w, 1);
    params.field.max_scans = 1;
    assert_int_equal(robot_create(&r, memory, 1024, &params), CAIRN_NO_MEMORY);
    params.field.max_scans = ROBOT_SCANS + 1;
    assert_int_equal(robot_create(&r, memory, sizeof memory, &params), CAIRN_BAD_ARGUMENT);
    params.field.max_scans = 1;
    assert_int_equal(robot_create(&r, memory, sizeof memory, &params), CAIRN_OK);
    assert_int_equal(robot_tick(&r, &budget, &work), CAIRN_MORE);
    assert_int_equal(work, ROBOT_IDLE);
    assert_int_equal(robot_offer(&r, &w.sweep[0]), CAIRN_OK);
    assert_int_equal(robot_offer(&r, &w.sweep[1]), CAIRN_MORE);
    assert_int_equal(robot_tick(&r, &budget, &work), CAIRN_MORE);
    assert_int_equal(work, ROBOT_ADD);
    assert_int_equal(robot_offer(&r, &w.sweep[1]), CAIRN_MORE);
    do {
        budget.left = 1000;
        assert_int_equal(robot_tick(&r, &budget, &work), CAIRN_MORE);
    } while (work == ROBOT_FIT);
    assert_int_equal(robot_offer(&r, &w.sweep[1]), CAIRN_FULL);
}

/* A sweep that the library refuses ends the run with its status and leaves the robot as it was. */
static void a_bad_sweep_is_refused(void **state)
{
    static unsigned char memory[MEMORY];
    static robot r;
    robot_params params = room_params();
    cairn_budget budget = {1000};
    robot_sweep bad;
    robot_work work;
    walk w;

    (void)state;
    make_walk(&w, 1);
    bad = w.sweep[0];
    bad.angle_min = (float)NAN;
    assert_int_equal(robot_create(&r, memory, sizeof memory, &params), CAIRN_OK);
    assert_int_equal(robot_offer(&r, &bad), CAIRN_OK);
    assert_int_equal(robot_tick(&r, &budget, &work), CAIRN_NOT_FINITE);
    assert_int_equal(work, ROBOT_ADD);
    assert_int_equal(r.taken, 0);
}

static void recordings_play_back(void **state)
{
    static stream s;
    static const char *const program = sizeof(cairn_real) == 8 ? "cairn" : "cairn-float";
    char expected[64];
    walk w;
    flown a;
    outcome o;

    (void)state;
    make_walk(&w, 4);
    a = fly(&w, 7, 300, 120, &s);
    files_write("flight.rec", s.bytes, s.used);
    (void)snprintf(expected, sizeof expected, "ticks %u, recorded %u\nhash %08x", (unsigned)a.ticks, (unsigned)a.ticks,
                   (unsigned)a.hash);
    /* Either program plays either recording. */
    for (int32_t i = 0; i < 2; i++) {
        o = programs_run("%s replay @/flight.rec", i == 0 ? program : "cairn");
        assert_int_equal(o.code, 0);
        assert_holds(o.out, expected);
        assert_holds(o.out, ": the same run");
        assert_holds(o.out, "pose 4 ");
    }
    s.bytes[s.used - 1] ^= 1;
    files_write("flight.rec", s.bytes, s.used);
    o = programs_run("cairn replay --quiet @/flight.rec");
    assert_int_equal(o.code, 2);
    assert_holds(o.out, ": NOT the same run");
    assert_null(strstr(o.out, "pose"));
}

static void damaged_recordings_are_refused(void **state)
{
    static stream s;
    const uint32_t params_at = 20, sweep_at = params_at + (uint32_t)sizeof(robot_params);
    const struct {
        uint32_t at;
        unsigned char byte;
        const char *said;
    } damage[] = {
        {0, 'X', "byte 4: not a flight recording, expected CRNR"},
        {4, 2, "byte 8: a version that is not known, expected 1"},
        {8, 3, "byte 20: reals are neither of 4 nor of 8 bytes"},
        {12, 1, "out of pool memory"},
        {16, 1, "parameters of another size"},
        {sweep_at, 'X', "an unknown record, expected S, T, F or E"},
        {sweep_at + 7, 1, "too many beams or sweeps"},
    };
    walk w;
    outcome o;

    (void)state;
    make_walk(&w, 4);
    (void)fly(&w, 7, 300, 120, &s);
    for (size_t i = 0; i < sizeof damage / sizeof *damage; i++) {
        unsigned char was[4];

        memcpy(was, s.bytes + damage[i].at, sizeof was);
        if (damage[i].at == 12)
            memset(s.bytes + 12, 0, 4);
        s.bytes[damage[i].at] = damage[i].byte;
        files_write("flight.rec", s.bytes, s.used);
        memcpy(s.bytes + damage[i].at, was, sizeof was);
        o = programs_run("%s replay @/flight.rec", sizeof(cairn_real) == 8 ? "cairn" : "cairn-float");
        if (damage[i].at != 12) {
            assert_int_equal(o.code, 2);
            assert_holds(o.err, damage[i].said);
        } else {
            assert_true(o.code != 0);
        }
    }
    for (uint32_t cut = 0; cut < s.used; cut += 1 + s.used / 17) {
        files_write("flight.rec", s.bytes, cut);
        o = programs_run("cairn replay @/flight.rec");
        assert_int_equal(o.code, 2);
        assert_holds(o.err, "flight.rec: byte ");
    }
    o = programs_run("cairn replay @/none.rec");
    assert_int_equal(o.code, 2);
    o = programs_run("cairn replay @");
    assert_int_equal(o.code, 2);
    assert_holds(o.err, "Is a directory\n");
    o = programs_run("cairn replay");
    assert_int_equal(o.code, 2);
    assert_holds(o.err, "no recording, expected FILE");
}

/* ---- Threads: objects in different pools share nothing ---- */

static void *fly_in_thread(void *argument)
{
    flown *result = argument;
    walk w;

    make_walk(&w, result->ticks);
    *result = fly(&w, 6, 400, 150, NULL);
    return NULL;
}

static void threads_do_not_meet(void **state)
{
    enum { THREADS = 4 };
    pthread_t thread[THREADS];
    flown alone[THREADS], together[THREADS];

    (void)state;
    for (uint32_t i = 0; i < THREADS; i++) {
        alone[i].ticks = together[i].ticks = i + 1;
        (void)fly_in_thread(&alone[i]);
    }
    for (int32_t i = 0; i < THREADS; i++)
        assert_int_equal(pthread_create(&thread[i], NULL, fly_in_thread, &together[i]), 0);
    for (int32_t i = 0; i < THREADS; i++) {
        assert_int_equal(pthread_join(thread[i], NULL), 0);
        assert_int_equal(together[i].hash, alone[i].hash);
    }
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(budgets_do_not_matter),          cmocka_unit_test(the_same_run_has_the_same_hash),
        cmocka_unit_test(scans_move_towards_each_other),  cmocka_unit_test(offers_wait_their_turn),
        cmocka_unit_test(a_bad_sweep_is_refused),         cmocka_unit_test(recordings_play_back),
        cmocka_unit_test(damaged_recordings_are_refused), cmocka_unit_test(threads_do_not_meet),
    };

    programs_find(argc, argv);
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
