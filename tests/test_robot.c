/* The robot of the firmware and its flight recorder, and `cairn replay` of its recordings. */
#include <math.h>
#include <pthread.h>

#include "firmware/recorder.h"
#include "firmware/robot.h"
#include "tests/programs.h"
#include "tests/test.h"

enum { SWEEPS = 5, BEAMS = 121, MEMORY = 400 * 1024, STREAM = 64 * 1024 };

/* Sweeps of a 4 x 3 m room from places in it, with slightly wrong poses. */
typedef struct walk {
    float range[SWEEPS][BEAMS];
    robot_sweep sweep[SWEEPS];
    cairn_pose truth[SWEEPS];
} walk;

static float range_to_wall(cairn_real x, cairn_real y, cairn_real angle)
{
    cairn_real c = cairn_cos(angle), s = cairn_sin(angle);
    cairn_real to_x = c > 0   ? (4 - x) / c
                      : c < 0 ? -x / c
                              : 100,
               to_y = s > 0   ? (3 - y) / s
                      : s < 0 ? -y / s
                              : 100;

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
            w->range[i][k] = range_to_wall(x, y,
                                           theta + (cairn_real)sweep->angle_min +
                                               (cairn_real)k * (cairn_real)sweep->angle_step);
        w->truth[i].x = x;
        w->truth[i].y = y;
        w->truth[i].theta = theta;
        sweep->pose.x = x + cairn_random_uniform(&random, -CAIRN_REAL(0.05), CAIRN_REAL(0.05));
        sweep->pose.y = y;
        sweep->pose.theta =
            theta + cairn_random_uniform(&random, -CAIRN_REAL(0.03), CAIRN_REAL(0.03));
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
    params.joint = joint_default();
    params.joint.max_scans = SWEEPS;
    params.joint.max_links = 2 * SWEEPS;
    params.joint.max_fill = 2 * SWEEPS;
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
    cairn_real covariance[SWEEPS][9];
    uint32_t hash, ticks;
    int32_t works[ROBOT_WORKS]; /* ticks of each kind */
} flown;

/* The whole run of a walk, a sweep every `arrival` ticks; budgets alternate when `second`
 * differs. */
static flown fly(const walk *w, int32_t arrival, int32_t first, int32_t second, stream *s)
{
    static const robot none;
    unsigned char *memory = malloc(MEMORY);
    robot r = none;
    robot_params params = room_params();
    recorder recording;
    flown result = {.hash = HASH_START};
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
        result.works[work]++;
        result.hash = robot_hash(&r, result.hash);
        assert_true(r.ticks < 200000);
    }
    assert_int_equal(status, CAIRN_OK);
    recorder_end(&recording, r.ticks, result.hash);
    result.ticks = r.ticks;
    assert_int_equal(cairn_force_field_pose_count(r.field), SWEEPS);
    for (int32_t i = 0; i < SWEEPS; i++) {
        result.pose[i] = robot_pose(&r, i);
        memcpy(result.covariance[i], r.joint.covariances[i], sizeof result.covariance[i]);
    }
    free(memory);
    return result;
}

/* When every sweep arrives after the work on the one before, the budgets do not matter. */
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
    assert_memory_equal(a.covariance, b.covariance, sizeof a.covariance);
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

/* The solution is far nearer to the truth than the input, and its covariance is right. */
static void poses_and_covariances_are_right(void **state)
{
    walk w;
    flown a;

    (void)state;
    for (uint64_t seed = 1; seed <= 4; seed++) {
        make_walk(&w, seed);
        a = fly(&w, 5, 500, 500, NULL);
        for (robot_work work = ROBOT_ADD; work < ROBOT_IDLE; work++)
            assert_true(a.works[work] > 0);
        for (int32_t k = 0; k < 9; k++)
            assert_true(a.covariance[0][k] == 0);
        for (int32_t i = 1; i < SWEEPS; i++) {
            cairn_pose found = cairn_pose_between(a.pose[0], a.pose[i]);
            cairn_pose error =
                cairn_pose_between(cairn_pose_between(w.truth[0], w.truth[i]), found);
            const cairn_real *covariance = a.covariance[i];

            assert_true(cairn_abs(error.x) < CAIRN_REAL(0.006) &&
                        cairn_abs(error.y) < CAIRN_REAL(0.006));
            assert_true(cairn_abs(error.theta) < CAIRN_REAL(0.004));
            for (int32_t k = 0; k < 9; k += 4)
                assert_true(covariance[k] > 0 && covariance[k] < CAIRN_REAL(1e-4));
            for (int32_t k = 0; k < 9; k++)
                assert_true(cairn_abs(covariance[k] - covariance[k % 3 * 3 + k / 3]) <
                            CAIRN_REAL(1e-7));
        }
    }
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

static void offers_are_queued(void **state)
{
    static unsigned char memory[MEMORY];
    static robot r;
    robot_params params = room_params();
    cairn_budget budget = {1};
    robot_work work;
    walk w;

    (void)state;
    make_walk(&w, 1);
    params.field.max_scans = params.joint.max_scans = 1;
    assert_int_equal(robot_create(&r, memory, 1024, &params), CAIRN_NO_MEMORY);
    params.field.max_scans = params.joint.max_scans = ROBOT_SCANS + 1;
    assert_int_equal(robot_create(&r, memory, sizeof memory, &params), CAIRN_BAD_ARGUMENT);
    params.field.max_scans = 1;
    assert_int_equal(robot_create(&r, memory, sizeof memory, &params), CAIRN_BAD_ARGUMENT);
    params.joint.max_scans = 1;
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

/* A sweep that the library refuses ends the run with its status and leaves the robot unchanged. */
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

/* ---- The joint solution ---- */

/* The scans of a walk, in the frames of their sensors. */
static cairn_scan_set *make_set(const walk *w, cairn_pool *pool)
{
    cairn_scan_set_params params = {
        .max_scans = SWEEPS, .max_segments = SWEEPS * 8, .max_points = SWEEPS * 150, .spacing = 0};
    cairn_scan_params scan_params = room_params().scan;
    cairn_scan_set *set;
    cairn_scan *scan;

    assert_int_equal(cairn_scan_set_create(&set, pool, &params), CAIRN_OK);
    assert_int_equal(cairn_scan_create(&scan, pool, &scan_params), CAIRN_OK);
    for (int32_t i = 0; i < SWEEPS; i++) {
        const robot_sweep *sweep = &w->sweep[i];
        cairn_scan_input input = {.range = sweep->range,
                                  .count = BEAMS,
                                  .angle_min = sweep->angle_min,
                                  .angle_step = sweep->angle_step,
                                  .range_max = 8,
                                  .range_sigma = 0.01f};
        cairn_budget budget = {CAIRN_UNBOUNDED};
        cairn_scan_view view;

        assert_int_equal(cairn_scan_begin(scan, &input, NULL), CAIRN_OK);
        assert_int_equal(cairn_scan_step(scan, &budget), CAIRN_OK);
        view = cairn_scan_read(scan);
        assert_int_equal(cairn_scan_set_add(set, &view, NULL, NULL), CAIRN_OK);
    }
    return set;
}

static joint_params small_joint(void)
{
    joint_params params = joint_default();

    params.max_scans = SWEEPS;
    params.max_links = 3 * SWEEPS;
    params.max_fill = 3 * SWEEPS;
    return params;
}

/* Solves from the given poses in steps of `units`; returns the total units. */
static int64_t solve_in(joint *optimizer, const cairn_scan_set *set, const walk *w, int32_t count,
                        int32_t units)
{
    cairn_pose given[SWEEPS];
    int64_t used = 0;
    cairn_status status = CAIRN_MORE;

    for (int32_t i = 0; i < SWEEPS; i++)
        given[i] = w->sweep[i].pose;
    assert_int_equal(joint_begin(optimizer, set, given, NULL, count), CAIRN_OK);
    while (status == CAIRN_MORE) {
        cairn_budget budget = {units};

        status = joint_step(optimizer, &budget);
        assert_true(budget.left >= 0);
        used += units - budget.left;
    }
    assert_int_equal(status, CAIRN_OK);
    return used;
}

static void the_solution_does_not_depend_on_budgets(void **state)
{
    static const int32_t units[] = {1, 7, 1000};
    cairn_pool pool = test_pool(MEMORY);
    joint_params params = small_joint();
    cairn_pose known[SWEEPS];
    cairn_real known_covariance[SWEEPS][9];
    cairn_scan_set *set;
    int64_t used;
    joint x;
    walk w;

    (void)state;
    make_walk(&w, 5);
    set = make_set(&w, &pool);
    assert_int_equal(joint_create(&x, &pool, &params), CAIRN_OK);
    used = solve_in(&x, set, &w, SWEEPS, CAIRN_UNBOUNDED);
    memcpy(known, x.poses, sizeof known);
    memcpy(known_covariance, x.covariances, sizeof known_covariance);
    for (size_t k = 0; k < sizeof units / sizeof *units; k++) {
        assert_true(solve_in(&x, set, &w, SWEEPS, units[k]) == used);
        assert_memory_equal(x.poses, known, sizeof known);
        assert_memory_equal(x.covariances, known_covariance, sizeof known_covariance);
    }
    test_pool_free(&pool);
}

/* Fixed scans stay to the bit and are not compared with each other; the free one is aligned with
 * them. */
static void fixed_scans_stay(void **state)
{
    static const int32_t units[] = {CAIRN_UNBOUNDED, 1, 7};
    cairn_pool pool = test_pool(MEMORY);
    joint_params params = small_joint();
    cairn_pose given[SWEEPS], found = {0, 0, 0};
    uint8_t held[SWEEPS];
    cairn_scan_set *set;
    int64_t all;
    joint x;
    walk w;

    (void)state;
    make_walk(&w, 6);
    set = make_set(&w, &pool);
    assert_int_equal(joint_create(&x, &pool, &params), CAIRN_OK);
    all = solve_in(&x, set, &w, SWEEPS, CAIRN_UNBOUNDED);
    for (int32_t i = 0; i < SWEEPS; i++) {
        given[i] = x.poses[i];
        held[i] = i != 2;
    }
    for (int32_t b = 0; b < 3; b++) {
        cairn_status status = CAIRN_MORE;
        cairn_pose settled = given[2];
        int64_t used = 0;

        given[2].x += CAIRN_REAL(0.05);
        given[2].y -= CAIRN_REAL(0.04);
        assert_int_equal(joint_begin(&x, set, given, held, SWEEPS), CAIRN_OK);
        given[2] = settled;
        while (status == CAIRN_MORE) {
            cairn_budget budget = {units[b]};

            status = joint_step(&x, &budget);
            used += units[b] - budget.left;
        }
        assert_int_equal(status, CAIRN_OK);
        assert_true(used < all / 2);
        assert_int_equal(cairn_pose_graph_read(x.graph).links, SWEEPS - 1);
        for (int32_t i = 0; i < SWEEPS; i++) {
            cairn_pose_graph_link link = cairn_pose_graph_link_of(x.graph, i < SWEEPS - 1 ? i : 0);

            assert_true(link.first == 2 || link.second == 2);
            assert_true((x.covariances[i][0] > 0) == (i == 2));
            if (i != 2)
                assert_memory_equal(&x.poses[i], &given[i], sizeof given[i]);
        }
        assert_true(fabs((double)(x.poses[2].x - settled.x)) < 0.01 &&
                    fabs((double)(x.poses[2].y - settled.y)) < 0.01);
        if (b > 0)
            assert_memory_equal(&x.poses[2], &found, sizeof found);
        found = x.poses[2];
    }
    test_pool_free(&pool);
}

/* Information of the later of two scans, the first one fixed, in the map, by differences of every
 * point's error. */
static void add_pair_information(const joint *optimizer, const cairn_scan_set *set,
                                 double information[3][3])
{
    const cairn_scan_set_scan *first = &set->scans[0], *later = &set->scans[1];
    const double h = 1e-4, spread = (double)optimizer->params.spread,
                 sigma = (double)optimizer->params.sigma;

    for (int32_t s = later->first_segment; s < later->end_segment; s++)
        for (int32_t t = first->first_segment; t < first->end_segment; t++) {
            const cairn_scan_set_segment *wall = &set->segments[t], *segment = &set->segments[s];
            cairn_vec2 along = cairn_vec2_unit(cairn_vec2_sub(wall->segment.b, wall->segment.a));
            cairn_real length = cairn_vec2_norm(cairn_vec2_sub(wall->segment.b, wall->segment.a));

            for (int32_t k = segment->first_point; k < segment->end_point; k++) {
                double error[4] = {0};
                double row[3];
                int32_t is_on = 1;

                for (int32_t m = 0; m < 4; m++) {
                    cairn_pose moved = optimizer->poses[1];
                    cairn_vec2 p, direction;
                    double place;

                    moved.x += (cairn_real)(m == 1 ? h : 0);
                    moved.y += (cairn_real)(m == 2 ? h : 0);
                    moved.theta += (cairn_real)(m == 3 ? h : 0);
                    moved = cairn_pose_between(optimizer->poses[0], moved);
                    p = cairn_vec2_sub(cairn_pose_point(moved, set->points[k]), wall->segment.a);
                    direction =
                        cairn_transform_direction(cairn_transform_of(moved), segment->direction);
                    place = (double)cairn_vec2_dot(along, p);
                    error[m] = (double)cairn_vec2_cross(along, p);
                    is_on = is_on && place >= 0 && place <= (double)length &&
                            fabs(error[m]) <= (double)optimizer->params.gate &&
                            (double)cairn_vec2_dot(along, direction) >= 0.95;
                }
                for (int32_t m = 0; m < 3; m++)
                    row[m] = (error[m + 1] - error[0]) / h;
                for (int32_t m = 0; m < 9 && is_on; m++)
                    information[m / 3][m % 3] +=
                        row[m / 3] * row[m % 3] / (sigma * sigma + error[0] * error[0] / 9);
            }
        }
    information[0][0] += 1 / (spread * spread);
    information[1][1] += 1 / (spread * spread);
    information[2][2] +=
        1 / (double)(optimizer->params.spread_angle * optimizer->params.spread_angle);
}

/* With two scans the covariance is the inverse of the information of their one link, up to the
 * motion of the last round. */
static void the_covariance_is_that_of_the_points(void **state)
{
    cairn_pool pool = test_pool(MEMORY);
    joint_params params = small_joint();
    joint x;

    (void)state;
    params.rounds = 6;
    assert_int_equal(joint_create(&x, &pool, &params), CAIRN_OK);
    for (uint64_t seed = 1; seed <= 3; seed++) {
        cairn_mark mark;
        double information[3][3] = {{0}};
        cairn_scan_set *set;
        walk w;

        make_walk(&w, seed);
        assert_int_equal(cairn_pool_mark(&pool, &mark), CAIRN_OK);
        set = make_set(&w, &pool);
        (void)solve_in(&x, set, &w, 2, 1000);
        add_pair_information(&x, set, information);
        for (int32_t i = 0; i < 3; i++)
            for (int32_t j = 0; j < 3; j++) {
                double product = 0;

                for (int32_t k = 0; k < 3; k++)
                    product += information[i][k] * (double)x.covariances[1][3 * k + j];
                assert_true(fabs(product - (i == j)) < 0.05);
            }
        assert_int_equal(cairn_pool_release(&pool, mark), CAIRN_OK);
    }
    test_pool_free(&pool);
}

static void the_joint_solution_refuses_bad_input(void **state)
{
    cairn_pool pool = test_pool(MEMORY), small = test_pool(64);
    cairn_budget budget = {CAIRN_UNBOUNDED};
    joint_params params = small_joint(), bad;
    cairn_pose given[SWEEPS];
    cairn_scan_set *set;
    joint x;
    walk w;

    (void)state;
    make_walk(&w, 1);
    set = make_set(&w, &pool);
    for (int32_t i = 0; i < SWEEPS; i++)
        given[i] = w.sweep[i].pose;
    bad = params;
    bad.max_scans = 0;
    assert_int_equal(joint_create(&x, &pool, &bad), CAIRN_BAD_ARGUMENT);
    bad = params;
    bad.max_links = SWEEPS - 1;
    assert_int_equal(joint_create(&x, &pool, &bad), CAIRN_BAD_ARGUMENT);
    assert_int_equal(joint_create(&x, &small, &params), CAIRN_NO_MEMORY);
    /* Links beyond the capacity are left out; those of neighbours in time come first. */
    params.max_links = SWEEPS;
    assert_int_equal(joint_create(&x, &pool, &params), CAIRN_OK);
    assert_int_equal(joint_begin(&x, set, given, NULL, 0), CAIRN_EMPTY);
    assert_int_equal(joint_begin(&x, set, given, NULL, SWEEPS + 1), CAIRN_FULL);
    assert_int_equal(joint_step(&x, &budget), CAIRN_OK);
    (void)solve_in(&x, set, &w, SWEEPS, 1000);
    assert_true(cairn_pose_graph_read(x.graph).links == SWEEPS);
    for (int32_t i = 1; i < SWEEPS; i++)
        assert_int_equal(cairn_pose_graph_link_of(x.graph, i - 1).second, i);
    /* A factor beyond the memory is reported. */
    params = small_joint();
    params.max_fill = 1;
    assert_int_equal(joint_create(&x, &pool, &params), CAIRN_OK);
    assert_int_equal(joint_begin(&x, set, given, NULL, SWEEPS), CAIRN_OK);
    budget.left = CAIRN_UNBOUNDED;
    assert_int_equal(joint_step(&x, &budget), CAIRN_FULL);
    /* One scan stays where it is. */
    params = small_joint();
    assert_int_equal(joint_create(&x, &pool, &params), CAIRN_OK);
    (void)solve_in(&x, set, &w, 1, 10);
    assert_memory_equal(&x.poses[0], &given[0], sizeof given[0]);
    test_pool_free(&pool);
    test_pool_free(&small);
}

/* ---- Recordings ---- */

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
    (void)snprintf(expected, sizeof expected, "ticks %u, recorded %u\nhash %08x", (unsigned)a.ticks,
                   (unsigned)a.ticks, (unsigned)a.hash);
    /* Both programs replay both recordings. */
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
        {0, 'X', "byte 4: no flight recording, expected CRNR"},
        {4, 2, "byte 8: unknown version, expected 1"},
        {8, 3, "byte 20: reals are neither of 4 nor of 8 bytes"},
        {12, 1, "out of pool memory"},
        {16, 1, "parameters of another size"},
        {sweep_at, 'X', "an unknown record, expected S, T, F or E"},
        {sweep_at + 7, 1, "too many beams or sweeps"},
    };
    char command[600];
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
        o = programs_run("%s replay @/flight.rec",
                         sizeof(cairn_real) == 8 ? "cairn" : "cairn-float");
        if (damage[i].at != 12) {
            assert_int_equal(o.code, 2);
            assert_holds(o.err, damage[i].said);
        } else {
            assert_true(o.code != 0);
        }
    }
    /* More ticks than a run may have. */
    {
        uint32_t ticks[3] = {'T', (1u << 24) + 1, 0};

        memcpy(s.bytes + sweep_at, ticks, sizeof ticks);
        files_write("flight.rec", s.bytes, sweep_at + sizeof ticks);
        o = programs_run("%s replay @/flight.rec",
                         sizeof(cairn_real) == 8 ? "cairn" : "cairn-float");
        assert_int_equal(o.code, 2);
        assert_holds(o.err, "more than 16777216 ticks");
    }
    (void)fly(&w, 7, 300, 120, &s);
    for (uint32_t cut = 0; cut < s.used; cut += 1 + s.used / 17) {
        files_write("flight.rec", s.bytes, cut);
        o = programs_run("cairn replay @/flight.rec");
        assert_int_equal(o.code, 2);
        assert_holds(o.err, "flight.rec: byte ");
    }
    o = programs_run("cairn replay @/none.rec");
    assert_int_equal(o.code, 2);
    assert_holds(o.err, "none.rec: cannot open: No such file or directory\n");
    o = programs_run("cairn replay @");
    assert_int_equal(o.code, 2);
    assert_holds(o.err, "is a folder, expected a regular file\n");
    /* A pipe without a writer would block for ever. */
    assert_int_equal(mkfifo(files_path("pipe.rec"), 0666), 0);
    (void)snprintf(command, sizeof command, "cairn replay '%s'", files_path("pipe.rec"));
    o = programs_run_shell("timeout 20", command, NULL);
    assert_int_equal(o.code, 2);
    assert_holds(o.err, "is a pipe or device, expected a regular file\n");
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
        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(the_same_run_has_the_same_hash),
        cmocka_unit_test(scans_move_towards_each_other),
        cmocka_unit_test(offers_are_queued),
        cmocka_unit_test(a_bad_sweep_is_refused),
        cmocka_unit_test(recordings_play_back),
        cmocka_unit_test(damaged_recordings_are_refused),
        cmocka_unit_test(threads_do_not_meet),
        cmocka_unit_test(poses_and_covariances_are_right),
        cmocka_unit_test(the_solution_does_not_depend_on_budgets),
        cmocka_unit_test(fixed_scans_stay),
        cmocka_unit_test(the_covariance_is_that_of_the_points),
        cmocka_unit_test(the_joint_solution_refuses_bad_input),
    };

    programs_find(argc, argv);
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
