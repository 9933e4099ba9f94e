/* The mapper without odometry: along corridors, and after intervals without scans. */
#include "tests/drive.h"

#include <math.h>

#include "cairn/random.h"

enum { BEAMS = 181, MOST_WALLS = 96 };

static const double PI_180 = 3.14159265358979323846 / 180; /* rad: beams of a degree */
static const double HALF_WIDTH = 1, DOOR_EVERY = 3, DOOR_WIDTH = 0.9;

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

/* A side of the corridor from x to to_x, with doors set back by `depth`. */
static void add_side(walls *w, double y, double depth, double x, double to_x)
{
    double back = y > 0 ? y + depth : y - depth;

    for (; x < to_x - DOOR_EVERY / 2; x += DOOR_EVERY) {
        double door = x + DOOR_EVERY - DOOR_WIDTH;

        add_wall(w, x, y, door, y);
        add_wall(w, door, y, door, back);
        add_wall(w, door, back, x + DOOR_EVERY, back);
        add_wall(w, x + DOOR_EVERY, back, x + DOOR_EVERY, y);
    }
}

/* A corridor along x, far longer than what the scanner's beams hit densely. */
static walls corridor(double depth)
{
    walls w = {.count = 0};

    if (depth > 0) {
        add_side(&w, HALF_WIDTH, depth, -10, 20);
        add_side(&w, -HALF_WIDTH, depth, -11, 19);
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
static void look(const walls *w, cairn_pose pose, double step, cairn_random *random, float *ranges)
{
    for (int32_t i = 0; i < BEAMS; i++) {
        double angle = (double)pose.theta + step * (i - BEAMS / 2), nearest = 30;

        for (int32_t k = 0; k < w->count; k++)
            nearest = fmin(nearest, range_to(&w->wall[k], (double)pose.x, (double)pose.y, angle));
        ranges[i] =
            (float)(nearest < 30 ? nearest + 0.01 * (double)cairn_random_uniform(random, -1, 1)
                                 : (double)INFINITY);
    }
}

static cairn_scan_input input_of(const float *ranges, double step, int64_t stamp_ns)
{
    cairn_scan_input input = {
        .range = ranges,
        .count = BEAMS,
        .angle_min = (float)(-step * (BEAMS / 2)),
        .angle_step = (float)step,
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

/* Maps a drive without odometry from the origin; step: rad, below 0 clockwise; budget: units of a
 * call. Returns the mapper after the last scan; *truth: the last pose. */
static cairn_mapper *map_drive(cairn_pool *pool, const cairn_mapper_params *params, const walls *w,
                               const motion *motions, int32_t count, double step, int32_t budget,
                               cairn_pose *truth)
{
    cairn_mapper *mapper = new_mapper(pool, params);
    cairn_random random = cairn_random_seed(3, 0);
    int64_t stamp = 0;

    *truth = cairn_pose_identity();
    for (int32_t i = 0; i < count; i++) {
        float ranges[BEAMS];
        cairn_pose moved = {(cairn_real)motions[i].ahead, 0, (cairn_real)motions[i].turn};
        cairn_scan_input input;
        cairn_budget left = {budget};
        cairn_status status;

        *truth = cairn_pose_compose(*truth, moved);
        stamp += motions[i].span;
        look(w, *truth, step, &random, ranges);
        input = input_of(ranges, step, stamp);
        assert_taken(cairn_mapper_add(mapper, &input, NULL, NULL));
        while ((status = cairn_mapper_step(mapper, &left)) == CAIRN_MORE)
            left.left = budget;
        assert_ok(status);
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
static double corridor_error(double depth, int32_t scans, double step, double *sigma)
{
    cairn_mapper_params params = small_params();
    walls w = corridor(depth);
    motion motions[CORRIDOR_SCANS];
    cairn_pool pool;
    cairn_pose truth;
    cairn_mapper *mapper;
    cairn_mapper_result result;

    corridor_drive(motions);
    mapper = map_drive(&pool, &params, &w, motions, scans, step, CAIRN_UNBOUNDED, &truth);
    result = cairn_mapper_read(mapper);
    assert_int_equal(cairn_mapper_measure(mapper).unobservable, scans);
    test_pool_free(&pool);
    *sigma = sqrt((double)result.covariance[0]);
    return fabs((double)(result.map_scan.x - truth.x));
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
        cairn_mapper *mapper =
            map_drive(&pool, &params, &w, motions, 12, PI_180, budgets[i], &truth);

        results[i] = cairn_mapper_read(mapper);
        units[i] = cairn_mapper_measure(mapper).units;
        test_pool_free(&pool);
        assert_memory_equal(&results[i].map_scan, &results[0].map_scan, sizeof results[i].map_scan);
        assert_memory_equal(results[i].covariance, results[0].covariance,
                            sizeof results[i].covariance);
        assert_int_equal(units[i], units[0]);
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
    mapper = map_drive(&pool, &params, &w, motions, GAP_SCANS, PI_180, CAIRN_UNBOUNDED, &truth);
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(doors_show_the_motion_along_a_corridor),
        cmocka_unit_test(a_corridor_that_shows_nothing_is_said_to_be_unobservable),
        cmocka_unit_test(small_budgets_give_the_same_bits),
        cmocka_unit_test(after_an_interval_the_search_has_the_units_of_the_missing_scans),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
