/* Line fitting by extended EM: walls of known position, noise and clutter, budgets, capacities,
 * stored results. */
#include "tests/test.h"

#include <math.h>

#include "cairn/line.h"
#include "cairn/polyline.h"

#define MAX_POINTS 2000
#define PI         3.14159265358979323846

/* ---- Scenes: walls seen by a scanner, or points on them ---- */

typedef struct cloud {
    cairn_vec2 point[MAX_POINTS];
    int32_t wall[MAX_POINTS]; /* wall of the point, -1: clutter */
    int32_t count;
} cloud;

static cairn_segment wall(double ax, double ay, double bx, double by)
{
    cairn_segment s = {{(cairn_real)ax, (cairn_real)ay}, {(cairn_real)bx, (cairn_real)by}};
    return s;
}

/* Hits of `beams` beams from (x, y), all around, with range noise. */
static void take_scan(cloud *c, const cairn_segment *walls, int count, double x, double y,
                      int beams, double noise, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 2);

    c->count = 0;
    for (int i = 0; i < beams; i++) {
        double a = 2 * PI * i / beams, dx = cos(a), dy = sin(a), nearest = 1e9;
        int hit = -1;

        for (int k = 0; k < count; k++) {
            double ex = (double)(walls[k].b.x - walls[k].a.x),
                   ey = (double)(walls[k].b.y - walls[k].a.y);
            double px = (double)walls[k].a.x - x, py = (double)walls[k].a.y - y,
                   cross = dx * ey - dy * ex;
            double r = (px * ey - py * ex) / cross, t = (px * dy - py * dx) / cross;

            if (fabs(cross) > 1e-12 && r > 0 && t >= 0 && t <= 1 && r < nearest) {
                nearest = r;
                hit = k;
            }
        }
        if (hit < 0)
            continue;
        nearest += noise * (double)cairn_random_normal(&random);
        c->point[c->count].x = (cairn_real)(x + nearest * dx);
        c->point[c->count].y = (cairn_real)(y + nearest * dy);
        c->wall[c->count++] = hit;
    }
}

/* `n` even points on a wall, with noise across it. */
static void add_wall_points(cloud *c, cairn_segment s, int n, double noise, int label,
                            cairn_random *random)
{
    cairn_vec2 left = cairn_vec2_left_perp(cairn_vec2_unit(cairn_vec2_sub(s.b, s.a)));

    for (int i = 0; i < n; i++) {
        cairn_vec2 p = cairn_vec2_add(
            s.a, cairn_vec2_scale(cairn_vec2_sub(s.b, s.a), (cairn_real)i / (cairn_real)(n - 1)));

        c->point[c->count] = cairn_vec2_add(
            p, cairn_vec2_scale(left, (cairn_real)noise * cairn_random_normal(random)));
        c->wall[c->count++] = label;
    }
}

static void clutter(cloud *c, int n, cairn_box box, cairn_random *random)
{
    for (int i = 0; i < n; i++) {
        c->point[c->count].x = cairn_random_uniform(random, box.min.x, box.max.x);
        c->point[c->count].y = cairn_random_uniform(random, box.min.y, box.max.y);
        c->wall[c->count++] = -1;
    }
}

static void shuffle(cloud *c, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 3);

    for (int32_t i = c->count - 1; i > 0; i--) {
        int32_t j = cairn_random_below(&random, i + 1), label = c->wall[i];
        cairn_vec2 p = c->point[i];

        c->point[i] = c->point[j];
        c->wall[i] = c->wall[j];
        c->point[j] = p;
        c->wall[j] = label;
    }
}

/* ---- Fits ---- */

static cairn_pool pool;
static cairn_polyline *fitter;

static int setup(void **state)
{
    cairn_polyline_params params = cairn_polyline_default();

    (void)state;
    params.max_points = MAX_POINTS;
    pool = test_pool(cairn_polyline_memory(&params));
    assert_ok(cairn_polyline_create(&fitter, &pool, &params));
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    test_pool_free(&pool);
    return 0;
}

static cairn_polyline_view fit_with(cairn_polyline *polyline, const cloud *c, int32_t budget)
{
    cairn_budget left = {budget};
    cairn_status status;
    int64_t used = 0;

    assert_ok(cairn_polyline_begin(polyline, &c->point[0].x, c->count, NULL));
    while ((status = cairn_polyline_step(polyline, &left)) == CAIRN_MORE) {
        assert_true(left.left > -12);
        assert_int_equal(cairn_polyline_read(polyline).segment_count, 0);
        used += budget - left.left;
        left.left = budget;
    }
    assert_ok(status);
    used += budget - left.left;
    assert_int_equal(cairn_polyline_measured(polyline).units, used);
    return cairn_polyline_read(polyline);
}

static cairn_polyline_view fit(const cloud *c)
{
    return fit_with(fitter, c, CAIRN_UNBOUNDED);
}

static cairn_segment plane(const cairn_polyline_segment *s)
{
    cairn_segment segment = {{s->a[0], s->a[1]}, {s->b[0], s->b[1]}};
    return segment;
}

/* Angle between two segments as lines, and the largest distance of an end of `s` from the line
 * of `truth`. */
static double angle_error(cairn_segment s, cairn_segment truth)
{
    cairn_vec2 u = cairn_vec2_unit(cairn_vec2_sub(s.b, s.a)),
               v = cairn_vec2_unit(cairn_vec2_sub(truth.b, truth.a));

    return fabs(asin(fmax(-1, fmin(1, (double)cairn_vec2_cross(u, v)))));
}

static double line_error(cairn_segment s, cairn_segment truth)
{
    cairn_vec2 v = cairn_vec2_unit(cairn_vec2_sub(truth.b, truth.a));

    return fmax(fabs((double)cairn_vec2_cross(v, cairn_vec2_sub(s.a, truth.a))),
                fabs((double)cairn_vec2_cross(v, cairn_vec2_sub(s.b, truth.a))));
}

/* Index of the segment along `truth` that covers its middle; -1 when there is none. */
static int32_t find(cairn_polyline_view view, cairn_segment truth)
{
    cairn_vec2 middle = cairn_vec2_scale(cairn_vec2_add(truth.a, truth.b), CAIRN_REAL(0.5));

    for (int32_t i = 0; i < view.segment_count; i++)
        if (cairn_segment_distance(plane(&view.segments[i]), middle) < CAIRN_REAL(0.1) &&
            angle_error(plane(&view.segments[i]), truth) < 0.1)
            return i;
    return -1;
}

static void assert_found(cairn_polyline_view view, cairn_segment truth, double angle, double offset,
                         double ends)
{
    int32_t i = find(view, truth);
    cairn_segment s;

    assert_true(i >= 0);
    s = plane(&view.segments[i]);
    assert_near(angle_error(s, truth), 0, angle);
    assert_near(line_error(s, truth), 0, offset);
    assert_near(fmin((double)cairn_vec2_norm(cairn_vec2_sub(s.a, truth.a)),
                     (double)cairn_vec2_norm(cairn_vec2_sub(s.b, truth.a))),
                0, ends);
    assert_near(fmin((double)cairn_vec2_norm(cairn_vec2_sub(s.a, truth.b)),
                     (double)cairn_vec2_norm(cairn_vec2_sub(s.b, truth.b))),
                0, ends);
}

/* Invariants of every view. */
static void assert_sound(cairn_polyline_view view, const cloud *c)
{
    int32_t counts[256] = {0};
    double squares[256] = {0};

    assert_int_equal(view.point_count, c->count);
    for (int32_t i = 0; i < view.point_count; i++) {
        int32_t label = view.label[i];

        assert_in_range(label + 1, 0, view.segment_count);
        if (label < 0)
            continue;
        counts[label]++;
        squares[label] += pow((double)cairn_vec2_cross(
                                  cairn_vec2_unit(cairn_vec2_sub(plane(&view.segments[label]).b,
                                                                 plane(&view.segments[label]).a)),
                                  cairn_vec2_sub(c->point[i], plane(&view.segments[label]).a)),
                              2);
        assert_true(cairn_segment_distance(plane(&view.segments[label]), c->point[i]) <=
                    CAIRN_REAL(0.0601));
    }
    for (int32_t i = 0; i < view.segment_count; i++) {
        assert_int_equal(view.segments[i].count, counts[i]);
        assert_near(view.segments[i].rms, sqrt(squares[i] / counts[i]), 1e-5);
        assert_near(view.segments[i].a[2], 0, 0);
        assert_near(view.segments[i].b[2], 0, 0);
    }
}

static const double ROOM[4][4] = {{-3, -2, 5, -2}, {5, -2, 5, 4}, {5, 4, -3, 4}, {-3, 4, -3, -2}};

static void set_room_walls(cairn_segment walls[4])
{
    for (int i = 0; i < 4; i++)
        walls[i] = wall(ROOM[i][0], ROOM[i][1], ROOM[i][2], ROOM[i][3]);
}

static void test_room_from_inside(void **state)
{
    cairn_segment walls[4];
    cloud c;

    (void)state;
    set_room_walls(walls);
    for (uint64_t seed = 0; seed < 20; seed++) {
        cairn_polyline_view view;

        take_scan(&c, walls, 4, 0.3, 0.2, 361, 0.01, seed);
        view = fit(&c);
        assert_sound(view, &c);
        assert_int_equal(view.segment_count, 4);
        assert_true(view.converged);
        for (int i = 0; i < 4; i++) {
            int32_t here = find(view, walls[i]), next = find(view, walls[(i + 1) % 4]);
            cairn_vec2 corner;

            /* Beams are up to 0.17 m apart at the corners. */
            assert_found(view, walls[i], 0.003, 0.012, 0.2);
            assert_true(cairn_line_intersection(plane(&view.segments[here]),
                                                plane(&view.segments[next]), &corner));
            assert_near(cairn_vec2_norm(cairn_vec2_sub(corner, walls[i].b)), 0, 0.02);
            assert_in_range(view.segments[here].count, 20, 200);
            assert_true(view.segments[here].rms > CAIRN_REAL(0.004) &&
                        view.segments[here].rms < CAIRN_REAL(0.02));
        }
        for (int32_t i = 0; i < c.count; i++)
            if (view.label[i] >= 0 &&
                cairn_segment_distance(walls[(c.wall[i] + 1) % 4], c.point[i]) > CAIRN_REAL(0.08) &&
                cairn_segment_distance(walls[(c.wall[i] + 3) % 4], c.point[i]) > CAIRN_REAL(0.08))
                assert_int_equal(view.label[i], find(view, walls[c.wall[i]]));
    }
}

static void test_box_from_outside(void **state)
{
    cairn_segment walls[4] = {wall(2, -0.4, 2.8, 0.2), wall(2.8, 0.2, 2.2, 1),
                              wall(2.2, 1, 1.4, 0.4), wall(1.4, 0.4, 2, -0.4)};
    cloud c;
    cairn_polyline_view view;

    (void)state;
    take_scan(&c, walls, 4, 0, 0, 720, 0.005, 5);
    view = fit(&c);
    assert_sound(view, &c);
    assert_int_equal(view.segment_count, 2);
    assert_found(view, walls[3], 0.02, 0.012, 0.04);
    assert_found(view, walls[2], 0.03, 0.015, 0.12);
}

static void test_circle_becomes_chords(void **state)
{
    cairn_random random = cairn_random_seed(3, 3);
    cloud c;
    cairn_polyline_view view;

    (void)state;
    c.count = 0;
    for (int i = 0; i < 200; i++) {
        double r = 0.5 + 0.005 * (double)cairn_random_normal(&random);

        c.point[c.count].x = (cairn_real)(2 + r * cos(2 * PI * i / 200));
        c.point[c.count].y = (cairn_real)(1 + r * sin(2 * PI * i / 200));
        c.wall[c.count++] = 0;
    }
    view = fit(&c);
    assert_sound(view, &c);
    assert_in_range(view.segment_count, 5, 12);
    for (int32_t i = 0; i < view.segment_count; i++) {
        assert_true(cairn_segment_length(plane(&view.segments[i])) < CAIRN_REAL(0.75));
        assert_true(view.segments[i].rms < CAIRN_REAL(0.03));
    }
    for (int32_t i = 0, without = 0; i < c.count; i++) {
        without += view.label[i] < 0;
        assert_true(without <= 10);
    }
}

/* A bend too blunt to split, and a step in a wall. */
static void test_bends_and_steps_are_cut(void **state)
{
    cairn_segment bend[2] = {wall(0, 0, 2, 0), wall(2, 0, 4, 0.3)};
    cairn_segment step[2] = {wall(0, 0, 2, 0), wall(2, 0.08, 4, 0.08)};
    cairn_random random = cairn_random_seed(4, 3);
    cloud c;
    cairn_polyline_view view;

    (void)state;
    c.count = 0;
    add_wall_points(&c, bend[0], 60, 0.01, 0, &random);
    add_wall_points(&c, bend[1], 60, 0.01, 1, &random);
    view = fit(&c);
    assert_int_equal(view.segment_count, 2);
    assert_found(view, bend[0], 0.006, 0.012, 0.2);
    assert_found(view, bend[1], 0.006, 0.012, 0.2);
    c.count = 0;
    add_wall_points(&c, step[0], 60, 0.01, 0, &random);
    add_wall_points(&c, step[1], 60, 0.01, 1, &random);
    view = fit(&c);
    assert_int_equal(view.segment_count, 2);
    assert_found(view, step[0], 0.006, 0.012, 0.1);
    assert_found(view, step[1], 0.006, 0.012, 0.1);
}

/* A hole is a gap when the points beside it are near each other, and none when they are equally far
 * apart. */
static void test_gaps(void **state)
{
    cairn_random random = cairn_random_seed(6, 3);
    cloud c;
    cairn_polyline_view view;

    (void)state;
    for (int i = 0; i < 8; i++) {
        double hole = i < 4 ? 0.15 : 0.35 + 0.2 * i;

        c.count = 0;
        add_wall_points(&c, wall(0, 1, 2, 1.5), 40, 0.01, 0, &random);
        add_wall_points(&c, wall(2 + hole, 1.5 + hole / 4, 4 + hole, 2 + hole / 4), 40, 0.01, 0,
                        &random);
        view = fit(&c);
        assert_int_equal(view.segment_count, i < 4 ? 1 : 2);
    }
    /* 0.35 m apart. */
    c.count = 0;
    add_wall_points(&c, wall(-7, 60, 7, 62), 41, 0.01, 0, &random);
    view = fit(&c);
    assert_int_equal(view.segment_count, 1);
    assert_found(view, wall(-7, 60, 7, 62), 0.003, 0.02, 0.03);
    /* A hole of gap_max is never bridged, however far apart the points are. */
    c.count = 0;
    add_wall_points(&c, wall(0, 0, 6, 0), 9, 0.001, 0, &random);
    add_wall_points(&c, wall(7.6, 0, 13.6, 0), 9, 0.001, 0, &random);
    view = fit(&c);
    assert_int_equal(view.segment_count, 2);
    c.count = 0;
    add_wall_points(&c, wall(0, 0, 6, 0), 9, 0.001, 0, &random);
    add_wall_points(&c, wall(7.4, 0, 13.4, 0), 9, 0.001, 0, &random);
    view = fit(&c);
    assert_int_equal(view.segment_count, 1);
}

/* A wall seen at a grazing angle: distances grow from 1 cm to 0.9 m. */
static void test_grazing_wall(void **state)
{
    cairn_segment far = wall(0.2, -0.8, 9, -0.8);
    cloud c;
    cairn_polyline_view view;

    (void)state;
    take_scan(&c, &far, 1, 0, 0, 720, 0.005, 7);
    assert_true(c.count > 100);
    view = fit(&c);
    assert_int_equal(view.segment_count, 1);
    assert_found(view, far, 0.003, 0.02, 1.0);
}

static void test_near_parallel_walls_stay_apart(void **state)
{
    cairn_segment walls[2] = {wall(1, 0, 1, 2), wall(1.12, 0, 1.12, 2)};
    cairn_random random = cairn_random_seed(8, 3);
    cloud c;
    cairn_polyline_view view;

    (void)state;
    c.count = 0;
    add_wall_points(&c, walls[0], 60, 0.01, 0, &random);
    add_wall_points(&c, walls[1], 60, 0.01, 1, &random);
    view = fit(&c);
    assert_int_equal(view.segment_count, 2);
    assert_found(view, walls[0], 0.01, 0.015, 0.05);
    assert_found(view, walls[1], 0.01, 0.015, 0.05);
}

/* The error of a wall's angle and offset over many draws, compared with the regression of its own
 * points. */
static void test_accuracy_is_that_of_regression(void **state)
{
    cairn_segment truth = wall(1, 1, 2.6, 2.2);
    cairn_random random = cairn_random_seed(1, 4);
    double ours = 0, best = 0, bound;
    cloud c;

    (void)state;
    for (int i = 0; i < 100; i++) {
        cairn_polyline_view view;
        cairn_line line;

        c.count = 0;
        add_wall_points(&c, truth, 60, 0.01, 0, &random);
        assert_ok(cairn_line_fit(c.point, NULL, c.count, &line));
        view = fit(&c);
        assert_int_equal(view.segment_count, 1);
        ours += pow(angle_error(plane(&view.segments[0]), truth), 2);
        best += pow(angle_error(cairn_line_segment(&line), truth), 2);
        assert_near(line_error(plane(&view.segments[0]), cairn_line_segment(&line)), 0, 0.004);
    }
    /* Cramer-Rao bound: sigma / sqrt(sum of squared positions), which are 2 / 59 m apart. */
    bound = 0.01 / sqrt(pow(2.0 / 59, 2) * 60 * (60 * 60 - 1) / 12.0);
    assert_near(sqrt(best / 100), bound, 0.2 * bound);
    assert_true(sqrt(ours / 100) < 1.15 * sqrt(best / 100));
}

/* ---- Order and noise ---- */

static void assert_same(cairn_polyline_view view, const cloud *a,
                        const cairn_polyline_segment *segments, int32_t count, const int32_t *label,
                        const cloud *b)
{
    assert_int_equal(view.segment_count, count);
    assert_memory_equal(view.segments, segments, (size_t)count * sizeof *segments);
    /* The same points have the same labels. */
    for (int32_t i = 0; i < a->count; i++)
        for (int32_t j = 0; j < b->count; j++)
            if (!(a->point[i].x < b->point[j].x) && !(a->point[i].x > b->point[j].x) &&
                !(a->point[i].y < b->point[j].y) && !(a->point[i].y > b->point[j].y))
                assert_int_equal(view.label[i], label[j]);
}

static void test_order_does_not_matter(void **state)
{
    static cairn_polyline_segment segments[256];
    static int32_t label[MAX_POINTS];
    cairn_segment walls[6];
    cairn_box box = {{-3, -2}, {5, 4}};
    cloud c, ordered;

    (void)state;
    set_room_walls(walls);
    walls[4] = wall(2, 1, 2.6, 1.8);
    walls[5] = wall(2.6, 1.8, 2, 2.4);
    for (uint64_t seed = 0; seed < 4; seed++) {
        cairn_random random = cairn_random_seed(seed, 5);
        cairn_polyline_view view;
        int32_t count;

        take_scan(&ordered, walls, 6, 0.3, 0.2, 361, 0.01, seed);
        clutter(&ordered, seed < 2 ? 0 : 90, box, &random);
        for (int i = 0; i < 3; i++) /* places that occur twice */
            ordered.point[ordered.count++] = ordered.point[i * 50];
        view = fit(&ordered);
        count = view.segment_count;
        assert_in_range(count, 6, 20);
        memcpy(segments, view.segments, (size_t)count * sizeof *segments);
        memcpy(label, view.label, (size_t)ordered.count * sizeof *label);
        c = ordered;
        for (uint64_t turn = 0; turn < 5; turn++) {
            shuffle(&c, 10 * seed + turn);
            assert_same(fit(&c), &c, segments, count, label, &ordered);
        }
    }
}

/* A fifth of all points is clutter, in no order: the walls are found, and little else. */
static void test_fifth_of_noise(void **state)
{
    cairn_segment walls[5];
    cairn_box box = {{-3, -2}, {5, 4}};
    int32_t spurious = 0;
    double length = 0;
    cloud c;

    (void)state;
    set_room_walls(walls);
    walls[4] = wall(2, 1, 2.6, 1.8);
    for (uint64_t seed = 0; seed < 40; seed++) {
        cairn_random random = cairn_random_seed(seed, 6);
        cairn_polyline_view view;

        take_scan(&c, walls, 5, 0.3, 0.2, 361, 0.01, seed);
        clutter(&c, c.count / 4, box, &random);
        shuffle(&c, seed);
        view = fit(&c);
        assert_sound(view, &c);
        for (int i = 0; i < 4; i++) {
            /* The box hides part of the wall behind it. */
            int32_t k = find(view, walls[i]);

            if (i == 1)
                continue;
            assert_true(k >= 0);
            assert_near(angle_error(plane(&view.segments[k]), walls[i]), 0, 0.006);
            assert_near(line_error(plane(&view.segments[k]), walls[i]), 0, 0.02);
        }
        assert_true(find(view, walls[4]) >= 0);
        assert_near(angle_error(plane(&view.segments[find(view, walls[4])]), walls[4]), 0, 0.06);
        for (int32_t k = 0; k < view.segment_count; k++) {
            int good = 0;

            for (int i = 0; i < 5; i++)
                good = good || (line_error(plane(&view.segments[k]), walls[i]) < 0.06 &&
                                angle_error(plane(&view.segments[k]), walls[i]) < 0.1);
            if (!good) {
                spurious++;
                length += (double)cairn_segment_length(plane(&view.segments[k]));
            }
        }
    }
    /* Less than one in a scan, and short. */
    print_message("spurious segments per scan: %.2f, %.2f m\n", spurious / 40.0, length / 40.0);
    assert_true(spurious < 40);
    assert_true(length < 40 * 0.5);
}

static void test_clutter_alone_gives_little(void **state)
{
    cairn_box box = {{-5, -5}, {5, 5}};
    int32_t found = 0;
    cloud c;

    (void)state;
    for (uint64_t seed = 0; seed < 20; seed++) {
        cairn_random random = cairn_random_seed(seed, 7);

        c.count = 0;
        clutter(&c, 100, box, &random);
        found += fit(&c).segment_count;
    }
    print_message("segments in 100 points of clutter: %.2f\n", found / 20.0);
    assert_true(found <= 20);
}

/* ---- Budgets, costs, capacities ---- */

static void test_budgets_are_equal(void **state)
{
    static const int32_t BUDGETS[] = {1, 2, 3, 7, 50, 1000};
    static cairn_polyline_segment segments[256];
    static int32_t label[MAX_POINTS];
    cairn_segment walls[5];
    cairn_box box = {{-3, -2}, {5, 4}};
    cairn_random random = cairn_random_seed(11, 5);
    cairn_polyline_view view;
    cairn_polyline_measure cost;
    cairn_budget none = {0};
    int32_t count;
    cloud c;

    (void)state;
    set_room_walls(walls);
    walls[4] = wall(2, 1, 2.6, 1.8);
    take_scan(&c, walls, 5, 0.3, 0.2, 181, 0.01, 11);
    clutter(&c, 40, box, &random);
    view = fit(&c);
    count = view.segment_count;
    cost = cairn_polyline_measured(fitter);
    memcpy(segments, view.segments, (size_t)count * sizeof *segments);
    memcpy(label, view.label, (size_t)c.count * sizeof *label);
    assert_in_range(cost.iterations, 3, 20);
    assert_in_range(cost.peak_segments, count, 256);
    assert_in_range(cost.units, 1000, 40000);
    assert_true(cost.merges > 0);
    for (size_t i = 0; i < sizeof BUDGETS / sizeof *BUDGETS; i++) {
        cairn_polyline_measure again;

        view = fit_with(fitter, &c, BUDGETS[i]);
        again = cairn_polyline_measured(fitter);
        assert_same(view, &c, segments, count, label, &c);
        assert_memory_equal(&again, &cost, sizeof cost);
    }
    assert_ok(cairn_polyline_begin(fitter, &c.point[0].x, c.count, NULL));
    assert_status(cairn_polyline_step(fitter, &none), CAIRN_MORE);
    assert_int_equal(none.left, 0);
    assert_int_equal(cairn_polyline_measured(fitter).units, 0);
}

static cairn_status create(void *context, cairn_pool *from)
{
    cairn_polyline *made = NULL;
    cairn_status status = cairn_polyline_create(&made, from, context);

    assert_true((made != NULL) == (status == CAIRN_OK));
    return status;
}

static void test_memory(void **state)
{
    cairn_polyline_params params = cairn_polyline_default();

    (void)state;
    params.max_points = 37;
    params.max_segments = 5;
    test_every_pool_size(create, &params, cairn_polyline_memory(&params));
    params.dim = 3;
    test_every_pool_size(create, &params, cairn_polyline_memory(&params));
}

/* The params with one field set to a value must be refused by a rule. */
#define REFUSED(field, value, expected)                                                            \
    do {                                                                                           \
        cairn_polyline_params p = cairn_polyline_default();                                        \
        cairn_object_fault fault = {.module = NULL};                                               \
        p.field = (value);                                                                         \
        assert_status(cairn_polyline_check(&p, &fault), CAIRN_BAD_ARGUMENT);                       \
        assert_string_equal(fault.rule, expected);                                                 \
        assert_int_equal(cairn_polyline_memory(&p), 0);                                            \
    } while (0)

#define TAKEN(field, value)                                                                        \
    do {                                                                                           \
        cairn_polyline_params p = cairn_polyline_default();                                        \
        p.field = (value);                                                                         \
        assert_true(cairn_polyline_memory(&p) > 0);                                                \
    } while (0)

/* Rules between parameters; tests/test_object.c has the ranges. */
static void test_params(void **state)
{
    cairn_polyline_params good = cairn_polyline_default();

    (void)state;
    assert_status(cairn_polyline_create(NULL, &pool, &good), CAIRN_BAD_ARGUMENT);
    REFUSED(width_first, CAIRN_REAL(0.01), "width_first: at least width_last");
    REFUSED(gap_max, CAIRN_REAL(0.2), "gap_max: at least gap");
    TAKEN(width_first, CAIRN_REAL(0.02));
    TAKEN(gap_max, CAIRN_REAL(0.25));
}

static void test_begin_statuses(void **state)
{
    cairn_segment truth = wall(0, 0, 1, 0);
    cairn_random random = cairn_random_seed(1, 1);
    cairn_fault fault;
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_real point[2] = {1, (cairn_real)NAN};
    cloud c;

    (void)state;
    c.count = 0;
    add_wall_points(&c, truth, 30, 0, 0, &random);
    assert_int_equal(fit(&c).segment_count, 1);

    assert_fault(&fault, cairn_polyline_begin(NULL, &c.point[0].x, 1, &fault), CAIRN_BAD_ARGUMENT,
                 -1);
    assert_fault(&fault, cairn_polyline_begin(fitter, NULL, 1, &fault), CAIRN_BAD_ARGUMENT, -1);
    assert_fault(&fault, cairn_polyline_begin(fitter, &c.point[0].x, -1, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    assert_non_null(fault.message);
    assert_fault(&fault, cairn_polyline_begin(fitter, &c.point[0].x, MAX_POINTS + 1, &fault),
                 CAIRN_FULL, MAX_POINTS);
    c.point[17].y = (cairn_real)INFINITY;
    assert_fault(&fault, cairn_polyline_begin(fitter, &c.point[0].x, c.count, &fault),
                 CAIRN_NOT_FINITE, 17);
    assert_non_null(fault.message);
    c.point[17].y = 0;
    c.point[9].x = CAIRN_REAL(-1.01) * CAIRN_POLYLINE_EXTENT;
    assert_fault(&fault, cairn_polyline_begin(fitter, &c.point[0].x, c.count, &fault),
                 CAIRN_BAD_ARGUMENT, 9);
    assert_status(cairn_polyline_begin(fitter, &c.point[0].x, c.count, NULL), CAIRN_BAD_ARGUMENT);
    /* None of this changed the last result. */
    assert_int_equal(cairn_polyline_read(fitter).segment_count, 1);
    assert_ok(cairn_polyline_step(fitter, &budget));
    assert_status(cairn_polyline_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_polyline_step(fitter, NULL), CAIRN_BAD_ARGUMENT);

    assert_status(cairn_polyline_clear(NULL, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_polyline_clear(fitter, 0), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_polyline_clear(fitter, (cairn_real)INFINITY), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_polyline_add(fitter, &c.point[0].x), CAIRN_BAD_ARGUMENT); /* after steps */
    assert_ok(cairn_polyline_clear(fitter, 1));
    assert_int_equal(cairn_polyline_read(fitter).segment_count, 0);
    assert_status(cairn_polyline_add(NULL, &c.point[0].x), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_polyline_add(fitter, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_polyline_add(fitter, point), CAIRN_NOT_FINITE);
    point[0] = (cairn_real)NAN;
    point[1] = 1;
    assert_status(cairn_polyline_add(fitter, point), CAIRN_NOT_FINITE);
    point[0] = 1;
    point[1] = CAIRN_POLYLINE_EXTENT * 2;
    assert_status(cairn_polyline_add(fitter, point), CAIRN_BAD_ARGUMENT);
    point[1] = CAIRN_POLYLINE_EXTENT;
    for (int i = 0; i < MAX_POINTS; i++)
        assert_ok(cairn_polyline_add(fitter, point));
    assert_status(cairn_polyline_add(fitter, point), CAIRN_FULL);
    /* Also after one unit of work. */
    assert_ok(cairn_polyline_clear(fitter, 1));
    assert_ok(cairn_polyline_add(fitter, point));
    assert_ok(cairn_polyline_add(fitter, point));
    budget.left = 1;
    assert_status(cairn_polyline_step(fitter, &budget), CAIRN_MORE);
    assert_status(cairn_polyline_add(fitter, point), CAIRN_BAD_ARGUMENT);
}

/* No point, one, two: no segments, no failure. */
static void test_degenerate_points(void **state)
{
    cairn_polyline_view view;
    cloud c;

    (void)state;
    c.count = 0;
    view = fit(&c);
    assert_int_equal(view.segment_count, 0);
    assert_int_equal(view.point_count, 0);
    assert_true(view.converged);
    assert_ok(cairn_polyline_begin(fitter, NULL, 0, NULL));
    for (int i = 0; i < 100; i++) {
        c.point[i].x = 3;
        c.point[i].y = -1;
        c.wall[i] = 0;
    }
    for (c.count = 1; c.count <= 100; c.count += 33) {
        view = fit(&c);
        assert_int_equal(view.segment_count, 0);
        for (int32_t i = 0; i < c.count; i++)
            assert_int_equal(view.label[i], -1);
    }
    c.count = 100;
    for (int i = 0; i < 50; i++)
        c.point[i].x = 4;
    view = fit(&c);
    for (int32_t i = 0; i < view.segment_count; i++)
        assert_true(cairn_is_finite(view.segments[i].a[0]) &&
                    cairn_is_finite(view.segments[i].rms));
    /* The extreme corners of the allowed range. */
    c.count = 5;
    c.point[0].x = CAIRN_POLYLINE_EXTENT;
    c.point[1].x = -CAIRN_POLYLINE_EXTENT;
    c.point[2].y = CAIRN_POLYLINE_EXTENT;
    view = fit(&c);
    assert_int_equal(view.segment_count, 0);
}

/* Added one by one or all at once gives the same; a scale widens the band. */
static void test_add_and_scale(void **state)
{
    cairn_random random = cairn_random_seed(12, 1);
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_polyline_segment first;
    cairn_polyline_view view;
    cloud c;

    (void)state;
    c.count = 0;
    add_wall_points(&c, wall(0, 0, 3, 1), 80, 0.01, 0, &random);
    first = fit(&c).segments[0];
    assert_ok(cairn_polyline_clear(fitter, 1));
    for (int32_t i = 0; i < c.count; i++)
        assert_ok(cairn_polyline_add(fitter, &c.point[i].x));
    assert_ok(cairn_polyline_step(fitter, &budget));
    assert_memory_equal(&cairn_polyline_read(fitter).segments[0], &first, sizeof first);
    /* Noise of 5 cm. */
    c.count = 0;
    add_wall_points(&c, wall(0, 0, 3, 1), 80, 0.05, 0, &random);
    assert_ok(cairn_polyline_clear(fitter, 5));
    for (int32_t i = 0; i < c.count; i++)
        assert_ok(cairn_polyline_add(fitter, &c.point[i].x));
    assert_ok(cairn_polyline_step(fitter, &budget));
    view = cairn_polyline_read(fitter);
    assert_int_equal(view.segment_count, 1);
    assert_in_range(view.segments[0].count, 78, 80);
    assert_found(view, wall(0, 0, 3, 1), 0.02, 0.05, 0.08);
    /* The scale holds for that fit alone. */
    c.count = 0;
    add_wall_points(&c, wall(0, 0, 3, 1), 80, 0.01, 0, &random);
    assert_true(fit(&c).segments[0].rms < CAIRN_REAL(0.013));
}

static void test_support(void **state)
{
    cairn_polyline_params params = cairn_polyline_default();
    cairn_random random = cairn_random_seed(13, 1);
    cairn_polyline *strict;
    cairn_pool own;
    cloud c;

    (void)state;
    params.max_points = 200;
    params.min_points = 10;
    params.min_length = CAIRN_REAL(0.5);
    own = test_pool(cairn_polyline_memory(&params));
    assert_ok(cairn_polyline_create(&strict, &own, &params));
    c.count = 0;
    add_wall_points(&c, wall(0, 0, 0.9, 0), 9, 0, 0, &random);
    assert_int_equal(fit_with(strict, &c, 100).segment_count, 0);
    c.count = 0;
    add_wall_points(&c, wall(0, 0, 0.9, 0), 10, 0, 0, &random);
    assert_int_equal(fit_with(strict, &c, 100).segment_count, 1);
    c.count = 0;
    add_wall_points(&c, wall(0, 0, 0.45, 0), 30, 0, 0, &random);
    assert_int_equal(fit_with(strict, &c, 100).segment_count, 0);
    c.count = 0;
    add_wall_points(&c, wall(0, 0, 0.55, 0), 30, 0, 0, &random);
    assert_int_equal(fit_with(strict, &c, 100).segment_count, 1);
    test_pool_free(&own);
}

/* With too few segments the ones with the most points are kept. */
static void test_few_segments(void **state)
{
    cairn_polyline_params params = cairn_polyline_default();
    cairn_random random = cairn_random_seed(14, 1);
    cairn_polyline *small;
    cairn_pool own;
    cairn_polyline_view view;
    cloud c;

    (void)state;
    params.max_points = 400;
    params.max_segments = 2;
    own = test_pool(cairn_polyline_memory(&params));
    assert_ok(cairn_polyline_create(&small, &own, &params));
    c.count = 0;
    for (int i = 0; i < 5; i++)
        add_wall_points(&c, wall(5 * i, 0, 5 * i + 1, 1), i == 1 || i == 4 ? 60 : 20, 0.002, i,
                        &random);
    view = fit_with(small, &c, 100);
    assert_int_equal(view.segment_count, 2);
    assert_true(view.dropped > 0);
    assert_found(view, wall(5, 0, 6, 1), 0.01, 0.01, 0.1);
    assert_found(view, wall(20, 0, 21, 1), 0.01, 0.01, 0.1);
    c.count = 0;
    add_wall_points(&c, wall(0, 0, 1, 1), 60, 0.002, 0, &random);
    assert_int_equal(fit_with(small, &c, 100).dropped, 0);
    test_pool_free(&own);
}

/* A list with a place for each component is not searched: with as many places as the fit needs at
 * most it takes the units of one with many. */
static void test_units_of_a_full_list(void **state)
{
    cairn_polyline_params params = cairn_polyline_default();
    cairn_random random = cairn_random_seed(17, 1);
    cairn_polyline_measure measure[2];
    cloud c;

    (void)state;
    c.count = 0;
    for (int i = 0; i < 5; i++)
        add_wall_points(&c, wall(5 * i, 0, 5 * i + 1, 1), 40, 0.002, i, &random);
    params.max_points = 400;
    for (int32_t k = 0; k < 2; k++) {
        cairn_polyline *polyline;
        cairn_pool own;

        params.max_segments = k == 0 ? 64 : measure[0].peak_segments;
        own = test_pool(cairn_polyline_memory(&params));
        assert_ok(cairn_polyline_create(&polyline, &own, &params));
        assert_int_equal(fit_with(polyline, &c, 100).dropped, 0);
        measure[k] = cairn_polyline_measured(polyline);
        test_pool_free(&own);
    }
    assert_int_equal(measure[0].peak_segments, measure[1].peak_segments);
    assert_int_equal(measure[0].units, measure[1].units);
}

/* ---- Space ---- */

static void test_lines_in_space(void **state)
{
    static const double ENDS[4][2][3] = {{{0, 0, 0}, {2, 1, 0.5}},
                                         {{2, 1, 0.5}, {2, 3, 1.5}},
                                         {{-1, 0, 1}, {-1, 0, 3}},
                                         {{0, 0, 0.6}, {2, 1, 1.1}}};
    static cairn_real points[400][3], mixed[400][3];
    static cairn_polyline_segment segments[64];
    cairn_polyline_params params = cairn_polyline_default();
    cairn_random random = cairn_random_seed(15, 1);
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_polyline *space;
    cairn_pool own;
    cairn_polyline_view view;
    int32_t found;

    (void)state;
    params.dim = 3;
    params.max_points = 400;
    params.max_segments = 64;
    own = test_pool(cairn_polyline_memory(&params));
    assert_ok(cairn_polyline_create(&space, &own, &params));
    for (int k = 0; k < 4; k++)
        for (int i = 0; i < 80; i++)
            for (int j = 0; j < 3; j++)
                points[80 * k + i][j] =
                    (cairn_real)(ENDS[k][0][j] + (ENDS[k][1][j] - ENDS[k][0][j]) * i / 79) +
                    CAIRN_REAL(0.005) * cairn_random_normal(&random);
    for (int i = 320; i < 400; i++)
        for (int j = 0; j < 3; j++)
            points[i][j] = cairn_random_uniform(&random, -1, 3);
    assert_ok(cairn_polyline_begin(space, &points[0][0], 400, NULL));
    assert_ok(cairn_polyline_step(space, &budget));
    view = cairn_polyline_read(space);
    assert_in_range(view.segment_count, 4, 5);
    for (int k = 0; k < 4; k++) {
        double nearest = 1e9;

        for (int32_t i = 0; i < view.segment_count; i++) {
            double same = 0, turned = 0;

            for (int j = 0; j < 3; j++) {
                same = fmax(same, fmax(fabs((double)view.segments[i].a[j] - ENDS[k][0][j]),
                                       fabs((double)view.segments[i].b[j] - ENDS[k][1][j])));
                turned = fmax(turned, fmax(fabs((double)view.segments[i].a[j] - ENDS[k][1][j]),
                                           fabs((double)view.segments[i].b[j] - ENDS[k][0][j])));
            }
            nearest = fmin(nearest, fmin(same, turned));
        }
        /* Near the corner a few points are shared; clutter may lengthen a line. */
        assert_near(nearest, 0, 0.12);
    }
    /* In any order and with any budget, to the last bit. */
    found = view.segment_count;
    memcpy(segments, view.segments, (size_t)found * sizeof *segments);
    for (int i = 0; i < 400; i++)
        memcpy(mixed[i], points[(i * 171 + 5) % 400], sizeof mixed[i]);
    assert_ok(cairn_polyline_begin(space, &mixed[0][0], 400, NULL));
    do
        budget.left = 3;
    while (cairn_polyline_step(space, &budget) == CAIRN_MORE);
    view = cairn_polyline_read(space);
    assert_int_equal(view.segment_count, found);
    assert_memory_equal(view.segments, segments, (size_t)found * sizeof *segments);
    test_pool_free(&own);
}

/* A plane figure in space, rotated: the fit must be the rotated fit of the plane. */
static void test_space_agrees_with_plane(void **state)
{
    static cairn_real points[MAX_POINTS][3];
    cairn_polyline_params params = cairn_polyline_default();
    cairn_segment walls[4];
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_polyline *space;
    cairn_pool own;
    cairn_polyline_view view;
    cloud c;

    (void)state;
    params.dim = 3;
    params.max_points = 400;
    own = test_pool(cairn_polyline_memory(&params));
    assert_ok(cairn_polyline_create(&space, &own, &params));
    set_room_walls(walls);
    take_scan(&c, walls, 4, 0.3, 0.2, 361, 0.01, 3);
    for (int32_t i = 0; i < c.count; i++) {
        /* y and z from y by 30 degrees about the x axis */
        points[i][0] = c.point[i].x;
        points[i][1] = c.point[i].y * CAIRN_REAL(0.86602540378443865);
        points[i][2] = c.point[i].y * CAIRN_REAL(0.5);
    }
    assert_ok(cairn_polyline_begin(space, &points[0][0], c.count, NULL));
    assert_ok(cairn_polyline_step(space, &budget));
    view = cairn_polyline_read(space);
    assert_int_equal(view.segment_count, 4);
    for (int i = 0; i < 4; i++) {
        int hits = 0;

        for (int32_t k = 0; k < 4; k++) {
            const cairn_polyline_segment *s = &view.segments[k];
            cairn_segment back = {
                {s->a[0], s->a[1] * CAIRN_REAL(0.86602540378443865) + s->a[2] / 2},
                {s->b[0], s->b[1] * CAIRN_REAL(0.86602540378443865) + s->b[2] / 2}};

            assert_near(s->a[2] * CAIRN_REAL(0.86602540378443865) - s->a[1] / 2, 0, 1e-4);
            assert_near(s->b[2] * CAIRN_REAL(0.86602540378443865) - s->b[1] / 2, 0, 1e-4);
            hits += angle_error(back, walls[i]) < 0.004 && line_error(back, walls[i]) < 0.012;
        }
        assert_int_equal(hits, 1);
    }
    test_pool_free(&own);
}

/* ---- The same bits everywhere ---- */

/* A scene of random walls around the origin, made by cairn's own functions alone, so that it has
 * the same bits on every machine: rays all around, noise, clutter. */
static void random_scene(cloud *c, cairn_random *random)
{
    cairn_segment walls[8];
    int32_t count = 3 + cairn_random_below(random, 6), beams = 60 + cairn_random_below(random, 300);
    cairn_real noise = cairn_random_uniform(random, 0, CAIRN_REAL(0.02));
    cairn_box box = {{-6, -6}, {6, 6}};

    for (int32_t k = 0; k < count; k++) {
        walls[k].a.x = cairn_random_uniform(random, -6, 6);
        walls[k].a.y = cairn_random_uniform(random, -6, 6);
        walls[k].b.x = cairn_random_uniform(random, -6, 6);
        walls[k].b.y = cairn_random_uniform(random, -6, 6);
    }
    c->count = 0;
    for (int32_t i = 0; i < beams; i++) {
        cairn_vec2 d, e;
        cairn_real nearest = 1000;

        cairn_sincos(2 * CAIRN_PI * (cairn_real)i / (cairn_real)beams, &d.y, &d.x);
        for (int32_t k = 0; k < count; k++) {
            cairn_real cross, r, t;

            e = cairn_vec2_sub(walls[k].b, walls[k].a);
            cross = cairn_vec2_cross(d, e);
            r = cairn_vec2_cross(walls[k].a, e) / cross;
            t = cairn_vec2_cross(walls[k].a, d) / cross;
            if (r > 0 && r < nearest && t >= 0 && t <= 1)
                nearest = r;
        }
        nearest += noise * cairn_random_normal(random);
        if (nearest < 100)
            c->point[c->count++] = cairn_vec2_scale(d, nearest);
    }
    clutter(c, cairn_random_below(random, 1 + c->count / 4), box, random);
}

static uint64_t hash_fit(uint64_t hash, cairn_polyline *polyline)
{
    cairn_polyline_view view = cairn_polyline_read(polyline);
    cairn_polyline_measure cost = cairn_polyline_measured(polyline);

    for (int32_t i = 0; i < view.segment_count; i++) {
        hash = test_hash(hash, view.segments[i].a, sizeof view.segments[i].a);
        hash = test_hash(hash, view.segments[i].b, sizeof view.segments[i].b);
        hash = test_hash(hash, &view.segments[i].rms, sizeof view.segments[i].rms);
        hash = test_hash(hash, &view.segments[i].count, sizeof view.segments[i].count);
    }
    hash = test_hash(hash, view.label, (size_t)view.point_count * sizeof *view.label);
    hash = test_hash(hash, &view.converged, sizeof view.converged);
    hash = test_hash(hash, &view.dropped, sizeof view.dropped);
    hash = test_hash(hash, &cost.iterations, sizeof cost.iterations);
    hash = test_hash(hash, &cost.splits, sizeof cost.splits);
    hash = test_hash(hash, &cost.merges, sizeof cost.merges);
    hash = test_hash(hash, &cost.units, sizeof cost.units);
    return test_hash(hash, &cost.peak_segments, sizeof cost.peak_segments);
}

/* The stored hash of the results. A change of method changes it; a change of machine, compiler or
 * optimization must not. */
static void test_same_bits(void **state)
{
    cairn_random random = cairn_random_seed(2008, 1);
    cairn_polyline_params params = cairn_polyline_default();
    cairn_polyline *small, *space;
    cairn_budget budget = {CAIRN_UNBOUNDED};
    uint64_t hash = TEST_HASH_START;
    cairn_pool own;
    cloud c;

    (void)state;
    params.max_points = 600;
    params.max_segments = 12;
    params.min_points = 3;
    params.max_iterations = 7;
    params.merge_distance = CAIRN_REAL(0.02);
    params.merge_angle = CAIRN_REAL(0.1);
    params.min_length = CAIRN_REAL(0.3);
    own = test_pool(2 * cairn_polyline_memory(&params) + 100000);
    assert_ok(cairn_polyline_create(&small, &own, &params));
    params = cairn_polyline_default();
    params.dim = 3;
    params.max_points = 300;
    params.max_segments = 40;
    params.merge_distance = CAIRN_REAL(0.04);
    assert_ok(cairn_polyline_create(&space, &own, &params));
    for (int i = 0; i < 40; i++) {
        random_scene(&c, &random);
        (void)fit(&c);
        hash = hash_fit(hash, fitter);
        (void)fit_with(small, &c, 1 + i % 7);
        hash = hash_fit(hash, small);
    }
    for (int i = 0; i < 20; i++) {
        static cairn_real points[300][3];
        cairn_real ends[6][3];
        int32_t lines = 2 + cairn_random_below(&random, 4);

        for (int k = 0; k <= lines; k++)
            for (int j = 0; j < 3; j++)
                ends[k][j] = cairn_random_uniform(&random, -2, 2);
        for (int p = 0; p < 300; p++) {
            int32_t k = cairn_random_below(&random, lines + 1);
            cairn_real t = cairn_random_unit(&random);

            for (int j = 0; j < 3; j++) {
                cairn_real noise = cairn_random_normal(&random);

                points[p][j] = k == lines ? 2 * noise
                                          : ends[k][j] + t * (ends[k + 1][j] - ends[k][j]) +
                                                CAIRN_REAL(0.008) * noise;
            }
        }
        assert_ok(cairn_polyline_begin(space, &points[0][0], 300, NULL));
        assert_ok(cairn_polyline_step(space, &budget));
        hash = hash_fit(hash, space);
    }
    print_message("hash 0x%016llx\n", (unsigned long long)hash);
    assert_true(hash == NUMBER(UINT64_C(0x47d998e7226f70b6), UINT64_C(0x6eaf27179cf41d77)));
    test_pool_free(&own);
}

/* Walls of an eighth of a metre on a grid, with holes and some doubled points, and params equal to
 * the holes, lengths and distances. */
static void grid_scene(cloud *c, cairn_random *random)
{
    int32_t walls = 2 + cairn_random_below(random, 4);

    c->count = 0;
    for (int32_t k = 0; k < walls; k++) {
        int32_t x = 2 * cairn_random_below(random, 16), y = 2 * cairn_random_below(random, 16);
        int32_t dx = cairn_random_below(random, 3) - 1, dy = dx == 0;
        int32_t count = 4 + cairn_random_below(random, 24);

        for (int32_t i = 0; i < count && c->count < MAX_POINTS; i++) {
            c->point[c->count].x = CAIRN_REAL(0.125) * (cairn_real)x;
            c->point[c->count++].y = CAIRN_REAL(0.125) * (cairn_real)y;
            if (cairn_random_below(random, 10) == 0) {
                int32_t hole = 2 << cairn_random_below(random, 3);

                x += hole * dx;
                y += hole * dy;
            } else if (cairn_random_below(random, 10) > 0) {
                x += dx;
                y += dy;
            }
        }
    }
}

static uint64_t hash_of_grids(void)
{
    cairn_random random = cairn_random_seed(2009, 1);
    uint64_t hash = TEST_HASH_START;

    for (int32_t i = 0; i < 60; i++) {
        cairn_polyline_params params = cairn_polyline_default();
        cairn_polyline *polyline;
        cairn_pool own;
        cloud c;

        params.max_points = MAX_POINTS;
        params.max_segments = 16 + cairn_random_below(&random, 32);
        params.min_points = 3 + cairn_random_below(&random, 3);
        params.max_iterations = 4 + cairn_random_below(&random, 30);
        params.min_length = CAIRN_REAL(0.25) * (cairn_real)cairn_random_below(&random, 3);
        params.width_first = CAIRN_REAL(0.25);
        params.width_last = CAIRN_REAL(0.0625);
        params.width_decay = CAIRN_REAL(0.5);
        params.gap = CAIRN_REAL(0.25);
        params.gap_factor = 2;
        params.gap_max = CAIRN_REAL(0.5) * (cairn_real)(1 + cairn_random_below(&random, 2));
        params.merge_distance = CAIRN_REAL(0.125);
        own = test_pool(cairn_polyline_memory(&params));
        assert_ok(cairn_polyline_create(&polyline, &own, &params));
        for (int32_t k = 0; k < 3; k++) {
            grid_scene(&c, &random);
            (void)fit_with(polyline, &c, CAIRN_UNBOUNDED);
            hash = hash_fit(hash, polyline);
        }
        test_pool_free(&own);
    }
    return hash;
}

static void test_same_bits_on_grids(void **state)
{
    (void)state;
    assert_golden(hash_of_grids(), UINT64_C(0xd3d91f9101a9b04c), UINT64_C(0xdc4221fb50d62d67));
}

static cairn_status begin_cloud(void *context)
{
    const cloud *c = context;

    return cairn_polyline_begin(fitter, &c->point[0].x, c->count, NULL);
}

static cairn_status step_cloud(void *context, cairn_budget *budget)
{
    (void)context;
    return cairn_polyline_step(fitter, budget);
}

static uint64_t hash_cloud(void *context)
{
    (void)context;
    return hash_fit(TEST_HASH_START, fitter);
}

static void test_begun_anew(void **state)
{
    cairn_random random = cairn_random_seed(2010, 1);
    cloud c;
    test_stepped object = {begin_cloud, step_cloud, hash_cloud, &c};

    (void)state;
    random_scene(&c, &random);
    test_begins_anew(&object, 100);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_room_from_inside),
        cmocka_unit_test(test_box_from_outside),
        cmocka_unit_test(test_circle_becomes_chords),
        cmocka_unit_test(test_bends_and_steps_are_cut),
        cmocka_unit_test(test_gaps),
        cmocka_unit_test(test_grazing_wall),
        cmocka_unit_test(test_near_parallel_walls_stay_apart),
        cmocka_unit_test(test_accuracy_is_that_of_regression),
        cmocka_unit_test(test_order_does_not_matter),
        cmocka_unit_test(test_fifth_of_noise),
        cmocka_unit_test(test_clutter_alone_gives_little),
        cmocka_unit_test(test_budgets_are_equal),
        cmocka_unit_test(test_memory),
        cmocka_unit_test(test_params),
        cmocka_unit_test(test_begin_statuses),
        cmocka_unit_test(test_degenerate_points),
        cmocka_unit_test(test_add_and_scale),
        cmocka_unit_test(test_support),
        cmocka_unit_test(test_few_segments),
        cmocka_unit_test(test_units_of_a_full_list),
        cmocka_unit_test(test_lines_in_space),
        cmocka_unit_test(test_space_agrees_with_plane),
        cmocka_unit_test(test_same_bits),
        cmocka_unit_test(test_same_bits_on_grids),
        cmocka_unit_test(test_begun_anew),
    };

    return cmocka_run_group_tests(tests, setup, teardown);
}
