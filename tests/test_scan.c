/* Line fit of a scan: motion during the sweep compared with small steps, segments and points,
 * budgets, refusals. */
#include "tests/test.h"

#include <math.h>

#include "cairn/scan.h"

#define PI        3.14159265358979323846
#define MAX_BEAMS 2000

/* ---- A scanner that moves during its sweep ---- */

typedef struct sweep {
    float range[MAX_BEAMS], angle[MAX_BEAMS];
    cairn_scan_input input;
} sweep;

/* Range from a sensor pose to the nearest wall at `angle`; infinity when there is none. */
static double cast(const cairn_segment *walls, int count, double x, double y, double angle)
{
    double dx = cos(angle), dy = sin(angle), nearest = (double)INFINITY;

    for (int k = 0; k < count; k++) {
        double ex = (double)(walls[k].b.x - walls[k].a.x),
               ey = (double)(walls[k].b.y - walls[k].a.y);
        double px = (double)walls[k].a.x - x, py = (double)walls[k].a.y - y,
               cross = dx * ey - dy * ex;
        double r = (px * ey - py * ex) / cross, t = (px * dy - py * dx) / cross;

        if (fabs(cross) > 1e-12 && r > 0 && t >= 0 && t <= 1 && r < nearest)
            nearest = r;
    }
    return nearest;
}

/* The base after the fraction f of a motion of constant twist, by many small steps: the reference
 * implementation. */
static void drive(double v, double w, double f, double *x, double *y, double *theta)
{
    enum { STEPS = 2000 };

    *x = *y = *theta = 0;
    for (int i = 0; i < STEPS; i++) {
        double middle = *theta + w * f / STEPS / 2;

        *x += v * f / STEPS * cos(middle);
        *y += v * f / STEPS * sin(middle);
        *theta += w * f / STEPS;
    }
}

/* Sweeps while the base drives v forward and turns by w in all, the sensor mounted at (mx, my,
 * mt). */
static void take_scan(sweep *s, const cairn_segment *walls, int count, int beams, double first,
                      double step, double v, double w, const double mount[3])
{
    double x, y, theta;

    memset(&s->input, 0, sizeof s->input);
    for (int i = 0; i < beams; i++) {
        double sx, sy;

        drive(v, w, beams > 1 ? (double)i / (beams - 1) : 0, &x, &y, &theta);
        sx = x + mount[0] * cos(theta) - mount[1] * sin(theta);
        sy = y + mount[0] * sin(theta) + mount[1] * cos(theta);
        s->range[i] =
            (float)cast(walls, count, sx, sy,
                        theta + mount[2] + (double)((float)first + (float)i * (float)step));
    }
    s->input.range = s->range;
    s->input.count = beams;
    s->input.angle_min = (float)first;
    s->input.angle_step = (float)step;
    s->input.range_min = 0.05F;
    s->input.range_max = 30;
    s->input.range_sigma = 0.01F;
    s->input.stamp_ns = 1234567890123;
    s->input.base_sensor.x = (cairn_real)mount[0];
    s->input.base_sensor.y = (cairn_real)mount[1];
    s->input.base_sensor.theta = (cairn_real)mount[2];
    drive(v, w, 1, &x, &y, &theta);
    s->input.motion.x = (cairn_real)x;
    s->input.motion.y = (cairn_real)y;
    s->input.motion.theta = (cairn_real)theta;
}

static void add_noise(sweep *s, double sigma, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 1);

    for (int i = 0; i < s->input.count; i++)
        s->range[i] += (float)(sigma * (double)cairn_random_normal(&random));
}

static cairn_segment wall(double ax, double ay, double bx, double by)
{
    cairn_segment s = {{(cairn_real)ax, (cairn_real)ay}, {(cairn_real)bx, (cairn_real)by}};
    return s;
}

static const double AT_BASE[3] = {0, 0, 0};

/* ---- The object under test ---- */

static _Alignas(CAIRN_ALIGN) unsigned char memory[2 << 20];
static cairn_pool pool;
static cairn_scan *scanner;

static int setup(void **state)
{
    cairn_scan_params params = cairn_scan_default();

    (void)state;
    params.max_beams = MAX_BEAMS;
    memset(memory, 0xa5, sizeof memory);
    assert_ok(cairn_pool_init(&pool, memory, sizeof memory));
    assert_ok(cairn_scan_create(&scanner, &pool, &params));
    return 0;
}

static cairn_scan_view take_with(cairn_scan *scan, const cairn_scan_input *input, int32_t budget)
{
    cairn_budget left = {budget};
    cairn_fault fault;
    cairn_status status;
    int64_t used = 0;

    assert_ok(cairn_scan_begin(scan, input, &fault));
    assert_null(fault.message);
    assert_int_equal(fault.index, -1);
    while ((status = cairn_scan_step(scan, &left)) == CAIRN_MORE) {
        assert_int_equal(cairn_scan_read(scan).beam_count, 0);
        assert_int_equal(cairn_scan_read(scan).point_count, 0);
        assert_true(left.left > -7);
        used += budget - left.left;
        left.left = budget;
    }
    assert_ok(status);
    used += budget - left.left;
    assert_int_equal(cairn_scan_measured(scan).units, used);
    return cairn_scan_read(scan);
}

static cairn_scan_view take(const cairn_scan_input *input)
{
    return take_with(scanner, input, CAIRN_UNBOUNDED);
}

/* Invariants of every view. */
static void assert_sound(cairn_scan_view view, double spacing, double support)
{
    assert_int_equal(view.first_point[0], 0);
    assert_int_equal(view.first_point[view.segment_count], view.point_count);
    for (int32_t k = 0; k < view.segment_count; k++) {
        cairn_segment s = view.segments[k];
        cairn_vec2 along = cairn_vec2_unit(cairn_vec2_sub(s.b, s.a)),
                   left = cairn_vec2_left_perp(along);
        double length = (double)cairn_segment_length(s);
        double margin = (length - floor(length / spacing) * spacing) / 2, last = -1;

        /* The sensor is on the left. */
        assert_true(cairn_vec2_dot(left, cairn_vec2_sub(view.sensor, s.a)) > 0);
        for (int32_t i = view.first_point[k]; i < view.first_point[k + 1]; i++) {
            cairn_oriented_point p = view.points[i];
            double t = (double)cairn_vec2_dot(along, cairn_vec2_sub(p.position, s.a)),
                   nearest = 1e9;
            double place = (t - margin) / spacing;

            assert_near(cairn_segment_distance(s, p.position), 0, 1e-5);
            assert_near(p.direction.x, along.x, 1e-6);
            assert_near(p.direction.y, along.y, 1e-6);
            assert_near(place, floor(place + 0.5), 1e-3);
            assert_true(t > last);
            last = t;
            for (int32_t b = 0; b < view.beam_count; b++)
                if (view.beams[b].kind == CAIRN_SCAN_BEAM_HIT &&
                    cairn_segment_distance(s, view.beams[b].to) < CAIRN_REAL(0.07))
                    nearest = fmin(nearest, fabs((double)cairn_vec2_dot(
                                                     along, cairn_vec2_sub(view.beams[b].to, s.a)) -
                                                 t));
            assert_true(nearest <= support + 1e-3);
        }
    }
}

static double line_error(cairn_segment s, cairn_segment truth)
{
    cairn_vec2 v = cairn_vec2_unit(cairn_vec2_sub(truth.b, truth.a));

    return fmax(fabs((double)cairn_vec2_cross(v, cairn_vec2_sub(s.a, truth.a))),
                fabs((double)cairn_vec2_cross(v, cairn_vec2_sub(s.b, truth.a))));
}

/* ---- Beams ---- */

/* Whatever the former contents of the memory. The first test of the group. */
static void test_new_object_is_empty(void **state)
{
    cairn_scan_view view = cairn_scan_read(scanner);
    cairn_budget budget = {10};

    (void)state;
    assert_int_equal(view.beam_count, 0);
    assert_int_equal(view.segment_count, 0);
    assert_int_equal(view.point_count, 0);
    assert_int_equal(view.first_point[0], 0);
    assert_ok(cairn_scan_step(scanner, &budget));
    assert_int_equal(budget.left, 10);
}

static void test_kinds_of_beams(void **state)
{
    static const float NOTHING = NAN, FAR = INFINITY;
    float range[9] = {NOTHING, FAR, -FAR, 0, -1, 0.0499F, 0.05F, 30, 30.01F};
    static const cairn_scan_beam_kind KIND[9] = {
        CAIRN_SCAN_BEAM_UNKNOWN, CAIRN_SCAN_BEAM_FREE,    CAIRN_SCAN_BEAM_UNKNOWN,
        CAIRN_SCAN_BEAM_UNKNOWN, CAIRN_SCAN_BEAM_UNKNOWN, CAIRN_SCAN_BEAM_UNKNOWN,
        CAIRN_SCAN_BEAM_HIT,     CAIRN_SCAN_BEAM_HIT,     CAIRN_SCAN_BEAM_FREE};
    cairn_scan_input input;
    cairn_scan_view view;
    cairn_scan_measure measure;

    (void)state;
    memset(&input, 0, sizeof input);
    input.range = range;
    input.count = 9;
    input.angle_min = -1;
    input.angle_step = 0.25F;
    input.range_min = 0.05F;
    input.range_max = 30;
    input.base_sensor.x = 1;
    input.base_sensor.y = 2;
    view = take(&input);
    assert_int_equal(view.beam_count, 9);
    assert_int_equal(view.segment_count, 0);
    assert_int_equal(view.point_count, 0);
    for (int i = 0; i < 9; i++) {
        double length = KIND[i] == CAIRN_SCAN_BEAM_FREE  ? 30
                        : KIND[i] == CAIRN_SCAN_BEAM_HIT ? (double)range[i]
                                                         : 0;

        assert_int_equal(view.beams[i].kind, KIND[i]);
        assert_near(view.beams[i].from.x, 1, 0);
        assert_near(view.beams[i].from.y, 2, 0);
        assert_near(view.beams[i].to.x, 1 + length * cos(-1 + 0.25 * i), NUMBER(1e-12, 1e-5));
        assert_near(view.beams[i].to.y, 2 + length * sin(-1 + 0.25 * i), NUMBER(1e-12, 1e-5));
    }
    measure = cairn_scan_measured(scanner);
    assert_int_equal(measure.hits, 2);
    assert_int_equal(measure.free, 2);
    assert_int_equal(measure.unknown, 5);
    assert_int_equal(measure.unassigned_hits, 2);
    assert_int_equal(measure.dropped_segments, 0);
}

static void test_scan_without_return(void **state)
{
    sweep s;
    cairn_scan_view view;

    (void)state;
    take_scan(&s, NULL, 0, 181, -PI / 2, PI / 180, 0, 0, AT_BASE);
    view = take(&s.input);
    assert_int_equal(view.beam_count, 181);
    assert_int_equal(view.segment_count, 0);
    assert_int_equal(view.point_count, 0);
    assert_int_equal(view.first_point[0], 0);
    for (int i = 0; i < 181; i++)
        assert_int_equal(view.beams[i].kind, CAIRN_SCAN_BEAM_FREE);
    s.input.count = 1; /* at no fraction of the motion */
    s.input.motion.x = 1;
    view = take(&s.input);
    assert_int_equal(view.beam_count, 1);
    assert_near(view.beams[0].from.x, 0, 0);
    assert_near(view.beams[0].to.y, -30, 1e-4);
}

/* Starts and ends of beams on an arc, with a mounted sensor, compared with the reference
 * implementation. */
static void test_motion_of_beams(void **state)
{
    static const double MOUNT[3] = {0.2, -0.1, 0.4};
    static const double MOTIONS[6][2] = {{0, 0},      {0.5, 0},    {0, 1},
                                         {0.5, -1.5}, {1, 1.9e-3}, {-0.4, 3}};
    cairn_segment walls[4] = {wall(-4, -3, 4, -3), wall(4, -3, 4, 3), wall(4, 3, -4, 3),
                              wall(-4, 3, -4, -3)};
    sweep s;

    (void)state;
    for (int m = 0; m < 6; m++) {
        cairn_scan_view view;

        take_scan(&s, walls, 4, 91, -2, 4.0 / 90, MOTIONS[m][0], MOTIONS[m][1], MOUNT);
        view = take(&s.input);
        assert_near(view.sensor.x, 0.2, 1e-6);
        assert_near(view.sensor.y, -0.1, 1e-6);
        for (int i = 0; i < 91; i++) {
            double x, y, theta;

            double error = NUMBER(1e-8 + 2e-7 * MOTIONS[m][1] * MOTIONS[m][1], 1e-5);

            drive(MOTIONS[m][0], MOTIONS[m][1], i / 90.0, &x, &y, &theta);
            assert_near(view.beams[i].from.x, x + 0.2 * cos(theta) + 0.1 * sin(theta), error);
            assert_near(view.beams[i].from.y, y + 0.2 * sin(theta) - 0.1 * cos(theta), error);
            /* On one of the walls. */
            assert_near(fmin(fabs(fabs((double)view.beams[i].to.x) - 4),
                             fabs(fabs((double)view.beams[i].to.y) - 3)),
                        0, NUMBER(2e-6, 2e-5));
        }
    }
}

/* A wall swept in 0.1 s at 1 rad/s is where the motionless scan has it, and rotated by 0.1 rad
 * without the correction. */
static void test_wall_while_turning(void **state)
{
    cairn_segment truth = wall(2, -1.5, 2, 1.5);
    sweep still, moved;
    cairn_segment a, b;
    cairn_scan_view view;

    (void)state;
    take_scan(&still, &truth, 1, 361, -PI / 3, 2 * PI / 3 / 360, 0, 0, AT_BASE);
    take_scan(&moved, &truth, 1, 361, -PI / 3, 2 * PI / 3 / 360, 0.05, 0.1, AT_BASE);
    view = take(&still.input);
    assert_int_equal(view.segment_count, 1);
    a = view.segments[0];
    view = take(&moved.input);
    assert_int_equal(view.segment_count, 1);
    b = view.segments[0];
    assert_near(line_error(b, truth), 0, 1e-3);
    assert_near(b.a.x, a.a.x, 1e-3);
    assert_near(b.b.x, a.b.x, 1e-3);
    assert_near(b.a.y, a.a.y, 0.02);
    assert_near(b.b.y, a.b.y, 0.02);
    for (int i = 0; i < 361; i++)
        if (view.beams[i].kind == CAIRN_SCAN_BEAM_HIT)
            assert_near(view.beams[i].to.x, 2, NUMBER(1e-6, 1e-5));
    moved.input.motion = cairn_pose_identity();
    view = take(&moved.input);
    assert_true(line_error(view.segments[view.segment_count - 1], truth) > 0.05);
}

/* ---- Segments and points ---- */

static const double ROOM[5][4] = {
    {-3, -2, 5, -2}, {5, -2, 5, 4}, {5, 4, -3, 4}, {-3, 4, -3, -2}, {1.2, 1.5, 2.2, 1.1}};

static void set_room_walls(cairn_segment walls[5])
{
    for (int i = 0; i < 5; i++)
        walls[i] = wall(ROOM[i][0], ROOM[i][1], ROOM[i][2], ROOM[i][3]);
}

static void test_room(void **state)
{
    cairn_segment walls[5];
    sweep s;
    cairn_scan_view view;

    (void)state;
    set_room_walls(walls);
    for (uint64_t seed = 0; seed < 5; seed++) {
        int found = 0;

        take_scan(&s, walls, 5, 361, -PI, 2 * PI / 360, 0, 0, AT_BASE);
        add_noise(&s, 0.01, seed);
        view = take(&s.input);
        assert_sound(view, 0.1, 0.2);
        assert_int_equal(view.segment_count, 5);
        assert_in_range(view.point_count, 240, 300);
        assert_int_equal(view.stamp_ns, 1234567890123);
        for (int32_t k = 0; k < view.segment_count; k++)
            for (int i = 0; i < 5; i++)
                found |= (line_error(view.segments[k], walls[i]) < 0.02) << i;
        assert_int_equal(found, 31);
        /* Counter-clockwise from -pi. */
        for (int32_t k = 0; k + 1 < view.segment_count; k++) {
            cairn_vec2 p = view.segments[k].a, q = view.segments[k + 1].a;

            assert_true(atan2((double)p.y, (double)p.x) < atan2((double)q.y, (double)q.x) ||
                        k == 0);
        }
        assert_true(cairn_scan_measured(scanner).fit_converged);
        assert_in_range(cairn_scan_measured(scanner).unassigned_hits, 0, 20);
        assert_in_range(cairn_scan_measured(scanner).fit_iterations, 3, 20);
        assert_int_equal(cairn_scan_measured(scanner).hits, 361);
    }
}

/* The same ranges in reverse, as an array of angles, and in random order: the same segments, to the
 * last bit. */
static void test_sense_and_order_of_beams(void **state)
{
    static cairn_segment segments[128];
    static cairn_oriented_point points[2048];
    cairn_segment walls[5];
    sweep s, t;
    cairn_scan_view view;
    int32_t count, point_count;

    (void)state;
    set_room_walls(walls);
    take_scan(&s, walls, 5, 361, -3.125, 1.0 / 64, 0, 0, AT_BASE);
    add_noise(&s, 0.01, 3);
    view = take(&s.input);
    assert_sound(view, 0.1, 0.2);
    count = view.segment_count;
    point_count = view.point_count;
    memcpy(segments, view.segments, (size_t)count * sizeof *segments);
    memcpy(points, view.points, (size_t)point_count * sizeof *points);
    for (int mode = 0; mode < 3; mode++) {
        t = s;
        t.input.range = t.range;
        for (int i = 0; i < 361; i++) {
            int from = mode == 0 ? 360 - i : mode == 1 ? i : i * 100 % 361;

            t.range[i] = s.range[from];
            t.angle[i] = -3.125F + (float)from / 64;
        }
        if (mode == 0) {
            t.input.angle_min = -3.125F + 360.0F / 64;
            t.input.angle_step = -1.0F / 64;
        } else {
            t.input.angle = t.angle;
            t.input.angle_min = t.input.angle_step = NAN; /* not read */
        }
        view = take(&t.input);
        assert_int_equal(view.segment_count, count);
        assert_int_equal(view.point_count, point_count);
        assert_memory_equal(view.segments, segments, (size_t)count * sizeof *segments);
        assert_memory_equal(view.points, points, (size_t)point_count * sizeof *points);
    }
}

/* Seen by a sensor that faces backwards at the rear, the room is where it was. */
static void test_mounted_sensor(void **state)
{
    static const double TAIL[3] = {-0.4, 0.15, PI};
    cairn_segment walls[5];
    sweep s;
    cairn_scan_view view;
    int found = 0;

    (void)state;
    set_room_walls(walls);
    take_scan(&s, walls, 5, 361, -PI, 2 * PI / 360, 0, 0, TAIL);
    view = take(&s.input);
    assert_near(view.sensor.x, -0.4, 1e-6);
    assert_near(view.sensor.y, 0.15, 1e-6);
    assert_sound(view, 0.1, 0.2);
    for (int32_t k = 0; k < view.segment_count; k++)
        for (int i = 0; i < 5; i++)
            found |= (line_error(view.segments[k], walls[i]) < 0.01) << i;
    assert_int_equal(found, 31);
}

/* Places along walls of known length, and a hole of 0.22 m, which is no gap but has no support in
 * its middle. */
static void test_spacing_and_support(void **state)
{
    cairn_segment one = wall(3, -1.03, 3, 1.03);
    cairn_segment two[2] = {wall(2, -1, 2, -0.11), wall(2, 0.11, 2, 1)};
    cairn_scan_params params = cairn_scan_default();
    cairn_pool own;
    cairn_scan *fine;
    cairn_scan_view view;
    cairn_real length;
    sweep s;

    (void)state;
    take_scan(&s, &one, 1, 1001, -PI / 2, PI / 1000, 0, 0, AT_BASE);
    view = take(&s.input);
    assert_int_equal(view.segment_count, 1);
    length = cairn_segment_length(view.segments[0]);
    assert_true(length > CAIRN_REAL(2.03) && length < CAIRN_REAL(2.07));
    assert_int_equal(view.point_count, 21);
    assert_near(view.points[0].position.y, -1.0, 0.02);
    assert_near(view.points[20].position.y, 1.0, 0.02);
    assert_near(view.points[0].direction.y, 1, 1e-6);

    params.max_beams = 1100;
    params.spacing = CAIRN_REAL(0.02);
    params.support_distance = CAIRN_REAL(0.05);
    own = test_pool(cairn_scan_memory(&params));
    assert_ok(cairn_scan_create(&fine, &own, &params));
    take_scan(&s, two, 2, 1001, -PI / 2, PI / 1000, 0, 0, AT_BASE);
    s.range[500] = 1.8F; /* belongs to no segment, and supports none */
    view = take_with(fine, &s.input, 1000);
    assert_int_equal(view.segment_count, 1);
    assert_sound(view, 0.02, 0.05);
    for (int32_t i = 0; i < view.point_count; i++)
        assert_true(cairn_abs(view.points[i].position.y) > CAIRN_REAL(0.055));
    assert_in_range(view.point_count, 91, 97);
    test_pool_free(&own);
}

/* A far wall whose beams are 0.35 m apart is one segment with points all along. */
static void test_far_wall(void **state)
{
    cairn_segment far = wall(78, -8, 80, 9);
    sweep s;
    cairn_scan_view view;

    (void)state;
    take_scan(&s, &far, 1, 401, -0.2, 0.001 * 4.363323, 0, 0, AT_BASE);
    s.input.range_max = 100;
    add_noise(&s, 0.01, 4);
    view = take(&s.input);
    assert_int_equal(view.segment_count, 1);
    assert_in_range(view.point_count, 168, 173);
}

/* With a smaller capacity of points, `kept` of three walls (the shortest are dropped first) are in
 * the view. */
static void keep_longest(const cairn_scan_input *input, int32_t max_points, int32_t kept)
{
    static const cairn_real SHORTEST[4] = {0, CAIRN_REAL(1.3), CAIRN_REAL(0.8), 0};
    cairn_scan_params params = cairn_scan_default();
    cairn_scan_view view;
    cairn_scan *small;
    cairn_pool own;

    params.max_points = max_points;
    own = test_pool(cairn_scan_memory(&params));
    assert_ok(cairn_scan_create(&small, &own, &params));
    view = take_with(small, input, 50);
    assert_sound(view, 0.1, 0.2);
    assert_int_equal(view.segment_count, kept);
    assert_int_equal(cairn_scan_measured(small).dropped_segments, 3 - kept);
    for (int32_t k = 0; k < kept; k++)
        assert_true(cairn_segment_length(view.segments[k]) > SHORTEST[kept]);
    test_pool_free(&own);
}

static void test_too_many_points(void **state)
{
    static const double COSINE[4] = {1, 0, -1, 0};
    sweep s;

    (void)state;
    /* Rotated by quarter turns, so that the walls are found in any order. */
    for (int quarter = 0; quarter < 4; quarter++) {
        double c = COSINE[quarter], d = COSINE[(quarter + 3) % 4];
        cairn_segment walls[3] = {
            wall(2 * c + 2 * d, 2 * d - 2 * c, 2 * c + 0.95 * d, 2 * d - 0.95 * c),
            wall(3 * c, 3 * d, 3 * c - 1.5 * d, 3 * d + 1.5 * c),
            wall(-3 * d, 3 * c, -0.5 * c - 3 * d, -0.5 * d + 3 * c)};
        int32_t places[3] = {0, 0, 0};
        cairn_scan_view view;

        take_scan(&s, walls, 3, 721, -PI, PI / 360, 0, 0, AT_BASE);
        view = take(&s.input);
        assert_int_equal(view.segment_count, 3);
        for (int32_t k = 0; k < 3; k++) {
            double length = (double)cairn_segment_length(view.segments[k]);

            places[length < 0.8 ? 2 : length < 1.3 ? 1 : 0] = (int32_t)floor(length / 0.1) + 1;
        }
        assert_true(places[0] > places[1] && places[1] > places[2] && places[2] > 3);
        keep_longest(&s.input, places[0] + places[1] + places[2], 3);
        keep_longest(&s.input, places[0] + places[1] + places[2] - 1, 2);
        keep_longest(&s.input, places[0] + places[1], 2);
        keep_longest(&s.input, places[0] + places[1] - 1, 1);
        keep_longest(&s.input, places[0], 1);
        keep_longest(&s.input, places[0] - 1, 0);
    }
}

/* The range error stated by the driver widens the fit. */
static void test_range_sigma(void **state)
{
    cairn_segment truth = wall(4, -3, 4, 3);
    sweep s;
    cairn_scan_view view;
    int32_t uncertain;

    (void)state;
    take_scan(&s, &truth, 1, 361, -PI / 4, PI / 2 / 360, 0, 0, AT_BASE);
    add_noise(&s, 0.05, 5);
    s.input.range_sigma = 0.05F;
    view = take(&s.input);
    assert_int_equal(view.segment_count, 1);
    assert_near(line_error(view.segments[0], truth), 0, 0.03);
    uncertain = cairn_scan_measured(scanner).unassigned_hits;
    assert_in_range(uncertain, 0, 8);
    /* With an assumed noise of 1 cm the result differs. */
    s.input.range_sigma = 0;
    (void)take(&s.input);
    assert_true(cairn_scan_measured(scanner).unassigned_hits > uncertain);
}

/* ---- Budgets, memory, statuses ---- */

static void test_budgets_are_equal(void **state)
{
    static const int32_t BUDGETS[] = {1, 7, 1000};
    static cairn_segment segments[128];
    static cairn_oriented_point points[2048];
    static cairn_scan_beam beams[MAX_BEAMS];
    cairn_segment walls[5];
    cairn_scan_measure cost;
    cairn_scan_view view;
    cairn_budget none = {0};
    int32_t count, point_count;
    sweep s;

    (void)state;
    set_room_walls(walls);
    take_scan(&s, walls, 5, 361, -PI, 2 * PI / 360, 0.05, 0.1, AT_BASE);
    add_noise(&s, 0.01, 6);
    view = take(&s.input);
    cost = cairn_scan_measured(scanner);
    count = view.segment_count;
    point_count = view.point_count;
    memcpy(segments, view.segments, (size_t)count * sizeof *segments);
    memcpy(points, view.points, (size_t)point_count * sizeof *points);
    memcpy(beams, view.beams, 361 * sizeof *beams);
    assert_in_range(cost.units, 5000, 60000);
    for (size_t i = 0; i < sizeof BUDGETS / sizeof *BUDGETS; i++) {
        cairn_scan_measure again;

        view = take_with(scanner, &s.input, BUDGETS[i]);
        again = cairn_scan_measured(scanner);
        assert_int_equal(view.segment_count, count);
        assert_int_equal(view.point_count, point_count);
        assert_memory_equal(view.segments, segments, (size_t)count * sizeof *segments);
        assert_memory_equal(view.points, points, (size_t)point_count * sizeof *points);
        for (int k = 0; k < 361; k++) {
            assert_int_equal(view.beams[k].kind, beams[k].kind);
            assert_memory_equal(&view.beams[k].from, &beams[k].from, sizeof beams[k].from);
            assert_memory_equal(&view.beams[k].to, &beams[k].to, sizeof beams[k].to);
        }
        assert_int_equal(again.units, cost.units);
        assert_int_equal(again.fit_iterations, cost.fit_iterations);
    }
    assert_ok(cairn_scan_begin(scanner, &s.input, NULL));
    assert_status(cairn_scan_step(scanner, &none), CAIRN_MORE);
    assert_int_equal(none.left, 0);
    assert_status(cairn_scan_step(NULL, &none), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_scan_step(scanner, NULL), CAIRN_BAD_ARGUMENT);
}

static cairn_status create(void *context, cairn_pool *from)
{
    cairn_scan *made = NULL;
    cairn_status status = cairn_scan_create(&made, from, context);

    assert_true((made != NULL) == (status == CAIRN_OK));
    return status;
}

static void test_memory(void **state)
{
    cairn_scan_params params = cairn_scan_default();

    (void)state;
    params.max_beams = 31;
    params.max_segments = 5;
    params.max_points = 77;
    test_every_pool_size(create, &params, cairn_scan_memory(&params));
}

static void test_params(void **state)
{
    cairn_scan_params good = cairn_scan_default(), bad = good;
    cairn_object_fault fault;
    cairn_scan *scan;

    (void)state;
    good.fit.dim = 7; /* not read */
    good.fit.max_points = -1;
    good.fit.max_segments = -1;
    assert_true(cairn_scan_memory(&good) > 0);
    assert_status(cairn_scan_create(NULL, &pool, &good), CAIRN_BAD_ARGUMENT);
    bad.fit.sigma = 0;
    assert_status(cairn_scan_check(&bad, &fault), CAIRN_BAD_ARGUMENT);
    assert_string_equal(fault.module, "polyline");
    assert_string_equal(fault.field, "sigma");
    assert_int_equal(cairn_scan_memory(&bad), 0);
    assert_status(cairn_scan_create(&scan, &pool, &bad), CAIRN_BAD_ARGUMENT);
}

static void assert_refused(const cairn_scan_input *input, cairn_status expected, int64_t index)
{
    cairn_fault fault = {77, NULL};

    assert_status(cairn_scan_begin(scanner, input, &fault), expected);
    assert_non_null(fault.message);
    assert_int_equal(fault.index, index);
    assert_status(cairn_scan_begin(scanner, input, NULL), expected);
}

#define BAD(field, value, status)                                                                  \
    do {                                                                                           \
        cairn_scan_input in = s.input;                                                             \
        in.field = (value);                                                                        \
        assert_refused(&in, status, -1);                                                           \
    } while (0)

static void test_begin_statuses(void **state)
{
    cairn_segment truth = wall(2, -1.5, 2, 1.5);
    const cairn_real nan = (cairn_real)NAN, far = CAIRN_SCAN_EXTENT * CAIRN_REAL(1.01);
    cairn_scan_view before, after;
    cairn_scan_measure cost;
    sweep s;

    (void)state;
    take_scan(&s, &truth, 1, 181, -PI / 2, PI / 180, 0, 0, AT_BASE);
    before = take(&s.input);
    assert_int_equal(before.segment_count, 1);
    cost = cairn_scan_measured(scanner);

    assert_status(cairn_scan_begin(NULL, &s.input, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_scan_begin(scanner, NULL, NULL), CAIRN_BAD_ARGUMENT);
    BAD(range, NULL, CAIRN_BAD_ARGUMENT);
    BAD(count, 0, CAIRN_BAD_ARGUMENT);
    BAD(count, -5, CAIRN_BAD_ARGUMENT);
    BAD(count, MAX_BEAMS + 1, CAIRN_FULL);
    BAD(range_min, NAN, CAIRN_NOT_FINITE);
    BAD(range_max, INFINITY, CAIRN_NOT_FINITE);
    BAD(range_sigma, NAN, CAIRN_NOT_FINITE);
    BAD(time_step, NAN, CAIRN_NOT_FINITE);
    BAD(time_step, INFINITY, CAIRN_NOT_FINITE);
    BAD(range_min, -0.1F, CAIRN_BAD_ARGUMENT);
    BAD(range_min, 30, CAIRN_BAD_ARGUMENT);
    BAD(range_max, 100001, CAIRN_BAD_ARGUMENT);
    BAD(range_sigma, -0.1F, CAIRN_BAD_ARGUMENT);
    BAD(time_step, -0.001F, CAIRN_BAD_ARGUMENT);
    BAD(base_sensor.theta, nan, CAIRN_NOT_FINITE);
    BAD(motion.x, nan, CAIRN_NOT_FINITE);
    BAD(base_sensor.x, far, CAIRN_BAD_ARGUMENT);
    BAD(base_sensor.y, -far, CAIRN_BAD_ARGUMENT);
    BAD(motion.x, -far, CAIRN_BAD_ARGUMENT);
    BAD(motion.y, far, CAIRN_BAD_ARGUMENT);
    BAD(stamp_ns, INT64_C(4000000000000000001), CAIRN_BAD_ARGUMENT);
    BAD(stamp_ns, INT64_MIN, CAIRN_BAD_ARGUMENT);
    BAD(angle_min, NAN, CAIRN_NOT_FINITE);
    BAD(angle_step, INFINITY, CAIRN_NOT_FINITE);
    for (int i = 0; i < 181; i++)
        s.angle[i] = (float)i;
    s.angle[42] = NAN;
    s.input.angle = s.angle;
    assert_refused(&s.input, CAIRN_NOT_FINITE, 42);

    /* None of this changed the last result. */
    after = cairn_scan_read(scanner);
    assert_memory_equal(&before, &after, sizeof before);
    assert_int_equal(cairn_scan_measured(scanner).units, cost.units);
    s.angle[42] = 42;
    s.input.range_max = 100000;
    s.input.range_min = 0;
    s.input.base_sensor.x = CAIRN_SCAN_EXTENT;
    s.input.motion.y = -CAIRN_SCAN_EXTENT;
    s.input.stamp_ns = -INT64_C(4000000000000000000);
    assert_ok(cairn_scan_begin(scanner, &s.input, NULL));
    assert_int_equal(cairn_scan_read(scanner).first_point[0], 0);
}

/* Differences of times do not overflow. */
static void test_time_difference(void **state)
{
    (void)state;
    assert_int_equal(cairn_time_difference(7, -5), 12);
    assert_int_equal(cairn_time_difference(-1, INT64_MAX), INT64_MIN);
    assert_int_equal(cairn_time_difference(-2, INT64_MAX), INT64_MIN);
    assert_int_equal(cairn_time_difference(INT64_MIN, INT64_MAX), INT64_MIN);
    assert_int_equal(cairn_time_difference(0, INT64_MIN), INT64_MAX);
    assert_int_equal(cairn_time_difference(-1, INT64_MIN), INT64_MAX);
    assert_int_equal(cairn_time_difference(INT64_MAX, INT64_MIN), INT64_MAX);
    assert_int_equal(cairn_time_difference(INT64_MIN, INT64_MIN), 0);
}

/* The largest number of beams; the input's arrays may be freed after begin(). */
static void test_hundred_thousand_beams(void **state)
{
    enum { BEAMS = 100000 };
    static float range[BEAMS];
    cairn_scan_params params = cairn_scan_default();
    cairn_segment walls[5];
    cairn_scan_input input;
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_scan_view view;
    cairn_scan *large;
    cairn_pool own;
    sweep s;
    int found = 0;

    (void)state;
    params.max_beams = BEAMS;
    params.max_segments = 2000;
    own = test_pool(cairn_scan_memory(&params));
    assert_ok(cairn_scan_create(&large, &own, &params));
    set_room_walls(walls);
    take_scan(&s, walls, 5, 1, -3.14, 0, 0, 0, AT_BASE);
    input = s.input;
    input.range = range;
    input.count = BEAMS;
    input.angle_step = (float)(6.28 / BEAMS);
    {
        cairn_random random = cairn_random_seed(9, 1);

        for (int i = 0; i < BEAMS; i++)
            range[i] = (float)(cast(walls, 5, 0, 0,
                                    (double)(input.angle_min + (float)i * input.angle_step)) +
                               0.01 * (double)cairn_random_normal(&random));
    }
    assert_ok(cairn_scan_begin(large, &input, NULL));
    memset(range, 0, sizeof range);
    assert_ok(cairn_scan_step(large, &budget));
    view = cairn_scan_read(large);
    assert_int_equal(view.beam_count, BEAMS);
    assert_int_equal(view.segment_count, 5);
    for (int32_t k = 0; k < view.segment_count; k++)
        for (int i = 0; i < 5; i++)
            found |= (line_error(view.segments[k], walls[i]) < 0.01) << i;
    assert_int_equal(found, 31);
    print_message("100,000 beams: %d segments, %d iterations, %.1f units a beam\n",
                  view.segment_count, cairn_scan_measured(large).fit_iterations,
                  (double)cairn_scan_measured(large).units / BEAMS);
    test_pool_free(&own);
}

/* The stored hash of the results. A change of method changes it; a change of machine, compiler or
 * optimization must not. */
static void test_same_bits(void **state)
{
    static float range[400];
    cairn_random random = cairn_random_seed(2008, 2);
    uint64_t hash = TEST_HASH_START;

    (void)state;
    for (int i = 0; i < 30; i++) {
        cairn_scan_input input;
        cairn_scan_view view;
        cairn_scan_measure cost;

        memset(&input, 0, sizeof input);
        input.range = range;
        input.count = 40 + cairn_random_below(&random, 360);
        input.angle_min = -3;
        input.angle_step = i % 4 == 3 ? -0.015625F : 0.015625F;
        input.range_min = 0.5F;
        input.range_max = 8;
        input.range_sigma = i % 5 == 4 ? 0.03F : 0.01F;
        input.base_sensor.x = cairn_random_uniform(&random, -1, 1);
        input.base_sensor.y = cairn_random_uniform(&random, -1, 1);
        input.base_sensor.theta = cairn_random_uniform(&random, -4, 4);
        input.motion.x = cairn_random_uniform(&random, -1, 1);
        input.motion.y = cairn_random_uniform(&random, -1, 1);
        input.motion.theta = i % 3 == 2 ? CAIRN_REAL(0.0005) : cairn_random_uniform(&random, -4, 4);
        /* Walls of a square 3 to 4 m away, with outliers, dropouts and free beams. */
        for (int b = 0; b < input.count; b++) {
            cairn_real sine, cosine, r;
            int32_t kind = cairn_random_below(&random, 30);

            cairn_sincos((cairn_real)input.angle_min + (cairn_real)b * (cairn_real)input.angle_step,
                         &sine, &cosine);
            r = cairn_min(CAIRN_REAL(3.5) / cairn_max(cairn_abs(sine), CAIRN_REAL(0.01)),
                          3 / cairn_max(cairn_abs(cosine), CAIRN_REAL(0.01)));
            r += CAIRN_REAL(0.01) * cairn_random_normal(&random);
            range[b] = kind == 0   ? NAN
                       : kind == 1 ? INFINITY
                       : kind == 2 ? 0.25F
                       : kind == 3 ? (float)(r * cairn_random_unit(&random))
                                   : (float)r;
        }
        view = take(&input);
        cost = cairn_scan_measured(scanner);
        for (int32_t b = 0; b < view.beam_count; b++) {
            hash = test_hash(hash, &view.beams[b].from, sizeof view.beams[b].from);
            hash = test_hash(hash, &view.beams[b].to, sizeof view.beams[b].to);
            hash = test_hash(hash, &view.beams[b].kind, sizeof view.beams[b].kind);
        }
        hash = test_hash(hash, view.segments, (size_t)view.segment_count * sizeof *view.segments);
        hash = test_hash(hash, view.points, (size_t)view.point_count * sizeof *view.points);
        hash = test_hash(hash, view.first_point,
                         (size_t)(view.segment_count + 1) * sizeof *view.first_point);
        hash = test_hash(hash, &view.sensor, sizeof view.sensor);
        hash = test_hash(hash, &cost.hits, sizeof cost.hits);
        hash = test_hash(hash, &cost.free, sizeof cost.free);
        hash = test_hash(hash, &cost.unassigned_hits, sizeof cost.unassigned_hits);
        hash = test_hash(hash, &cost.units, sizeof cost.units);
    }
    print_message("hash 0x%016llx\n", (unsigned long long)hash);
    assert_true(hash == NUMBER(UINT64_C(0x16a30f94106ae951), UINT64_C(0xb12ec4229b69420b)));
}

/* The view of a scan can be used; its segments and points are refused in the tests of the set of
 * scans, its beams here. */
static void test_views_are_checked(void **state)
{
    cairn_scan_beam beam[3];
    cairn_scan_view view;
    cairn_fault fault = {0, "before"};

    (void)state;
    memset(beam, 0, sizeof beam);
    memset(&view, 0, sizeof view);
    assert_ok(cairn_scan_view_check(&view, NULL));
    beam[2].from.x = (cairn_real)9e5;
    view.beams = beam;
    view.beam_count = 3;
    assert_ok(cairn_scan_view_check(&view, &fault));
    assert_fault(&fault, cairn_scan_beams_check(beam, 3, CAIRN_SCAN_EXTENT, &fault),
                 CAIRN_BAD_ARGUMENT, 2);
    assert_string_equal(fault.message, "a beam is too far away");
    assert_ok(cairn_scan_beams_check(beam, 2, CAIRN_SCAN_EXTENT, &fault));
    beam[2].from.x = (cairn_real)1.1e6;
    assert_fault(&fault, cairn_scan_view_check(&view, &fault), CAIRN_BAD_ARGUMENT, 2);
    assert_string_equal(fault.message, "a beam ends farther than 1e6 m");
    beam[1].to.y = (cairn_real)NAN;
    assert_fault(&fault, cairn_scan_view_check(&view, &fault), CAIRN_NOT_FINITE, 1);
    assert_string_equal(fault.message, "a beam is not finite");
    assert_status(cairn_scan_view_check(&view, NULL), CAIRN_NOT_FINITE);
    view.beams = NULL;
    assert_fault(&fault, cairn_scan_view_check(&view, &fault), CAIRN_BAD_ARGUMENT, -1);
    assert_string_equal(fault.message, "a count without its array");
    view.beam_count = -1;
    assert_fault(&fault, cairn_scan_view_check(&view, &fault), CAIRN_BAD_ARGUMENT, -1);
    assert_string_equal(fault.message, "a count is below 0");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_new_object_is_empty),
        cmocka_unit_test(test_kinds_of_beams),
        cmocka_unit_test(test_scan_without_return),
        cmocka_unit_test(test_motion_of_beams),
        cmocka_unit_test(test_wall_while_turning),
        cmocka_unit_test(test_room),
        cmocka_unit_test(test_sense_and_order_of_beams),
        cmocka_unit_test(test_mounted_sensor),
        cmocka_unit_test(test_spacing_and_support),
        cmocka_unit_test(test_far_wall),
        cmocka_unit_test(test_too_many_points),
        cmocka_unit_test(test_range_sigma),
        cmocka_unit_test(test_budgets_are_equal),
        cmocka_unit_test(test_memory),
        cmocka_unit_test(test_params),
        cmocka_unit_test(test_begin_statuses),
        cmocka_unit_test(test_time_difference),
        cmocka_unit_test(test_hundred_thousand_beams),
        cmocka_unit_test(test_views_are_checked),
        cmocka_unit_test(test_same_bits),
    };

    return cmocka_run_group_tests(tests, setup, NULL);
}
