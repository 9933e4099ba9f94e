/* Virtual scans of walls drawn by hand. */
#include "tests/test.h"

#include <math.h>

#include "cairn/virtual_scan.h"

#define PI     3.14159265358979323846
#define DEGREE (PI / 180)

enum { MOST_WALLS = 16, MOST_POINTS = 2000 };

/* Walls in the map, as a scan at a pose sees them. */
struct drawing {
    cairn_segment segments[MOST_WALLS];
    int32_t first[MOST_WALLS + 1];
    cairn_oriented_point points[MOST_POINTS];
    int32_t walls;
    cairn_pose pose;
};

static struct drawing drawing_at(double x, double y, double theta)
{
    struct drawing d;

    memset(&d, 0, sizeof d);
    d.pose.x = (cairn_real)x;
    d.pose.y = (cairn_real)y;
    d.pose.theta = (cairn_real)theta;
    return d;
}

/* A wall from a to b with a point every 0.1 m, the first after 0.05. */
static void wall(struct drawing *d, double ax, double ay, double bx, double by)
{
    cairn_transform scan_map = cairn_transform_of(cairn_pose_inverse(d->pose));
    double length = hypot(bx - ax, by - ay);
    cairn_vec2 a = {(cairn_real)ax, (cairn_real)ay}, b = {(cairn_real)bx, (cairn_real)by};
    cairn_vec2 along = {(cairn_real)((bx - ax) / length), (cairn_real)((by - ay) / length)};
    int32_t at = d->first[d->walls];

    d->segments[d->walls].a = cairn_transform_point(scan_map, a);
    d->segments[d->walls].b = cairn_transform_point(scan_map, b);
    for (double t = 0.05; t < length; t += 0.1, at++) {
        assert_true(at < MOST_POINTS);
        d->points[at].position = cairn_transform_point(
            scan_map, cairn_vec2_add(a, cairn_vec2_scale(along, (cairn_real)t)));
        d->points[at].direction = cairn_transform_direction(scan_map, along);
    }
    d->first[++d->walls] = at;
}

struct fixture {
    cairn_pool pool, set_pool;
    cairn_scan_set *set;
    cairn_virtual_scan *v;
    cairn_pose poses[64];
};

static struct fixture fixture_with(const cairn_virtual_scan_params *params)
{
    cairn_scan_set_params set_params = {
        .max_scans = 64, .max_segments = 512, .max_points = 8192, .spacing = 0};
    struct fixture f;

    memset(&f, 0, sizeof f);
    f.set_pool = test_pool(cairn_scan_set_memory(&set_params));
    assert_ok(cairn_scan_set_create(&f.set, &f.set_pool, &set_params));
    f.pool = test_pool(cairn_virtual_scan_memory(params));
    assert_ok(cairn_virtual_scan_create(&f.v, &f.pool, params));
    return f;
}

static struct fixture default_fixture(void)
{
    cairn_virtual_scan_params p = cairn_virtual_scan_default();

    return fixture_with(&p);
}

static void end_fixture(struct fixture *f)
{
    test_pool_free(&f->pool);
    test_pool_free(&f->set_pool);
}

static void put(struct fixture *f, const struct drawing *d)
{
    cairn_scan_view view;
    int32_t slot = cairn_scan_set_next(f->set);

    memset(&view, 0, sizeof view);
    view.segments = d->segments;
    view.first_point = d->first;
    view.points = d->points;
    view.segment_count = d->walls;
    view.point_count = d->first[d->walls];
    assert_ok(cairn_scan_set_add(f->set, &view, NULL, NULL));
    f->poses[slot] = d->pose;
}

static void give(struct fixture *f, double sigma)
{
    assert_ok(cairn_virtual_scan_begin(f->v, (cairn_real)sigma));
    for (int32_t i = 0; i < f->set->scan_count; i++)
        assert_ok(cairn_virtual_scan_add_scan(f->v, f->set, i, f->poses[i]));
}

static const cairn_virtual_scan_hypothesis *detect(struct fixture *f, double sigma, int32_t *count)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    give(f, sigma);
    assert_ok(cairn_virtual_scan_step(f->v, &budget));
    return cairn_virtual_scan_hypotheses(f->v, count);
}

/* ---- Lines ---- */

/* Two scans with a wall each, collinear, far apart. */
static void walls_of_two_scans_make_a_line(void **state)
{
    (void)state;
    for (int32_t turn = 0; turn < 12; turn++) {
        struct fixture f = default_fixture();
        double angle = turn * 30 * DEGREE + 0.1, dx = cos(angle), dy = sin(angle);
        struct drawing one = drawing_at(1, 2, 0.5), other = drawing_at(-3, 4, 2);
        const cairn_virtual_scan_hypothesis *h;
        const cairn_oriented_point *points;
        const cairn_real *weights;
        int32_t count, point_count;

        wall(&one, 5, 5, 5 + 2 * dx, 5 + 2 * dy);
        put(&f, &one);
        (void)detect(&f, 0.2, &count);
        assert_int_equal(count, 0); /* a wall of a single scan makes none */
        wall(&other, 5 + 6 * dx, 5 + 6 * dy, 5 + 8 * dx, 5 + 8 * dy);
        put(&f, &other);
        h = detect(&f, 0.2, &count);
        assert_int_equal(count, 1);
        assert_int_equal(h->kind, CAIRN_VIRTUAL_SCAN_LINE);
        assert_int_equal(h->observing_scans, 2);
        assert_near(h->strength, 0.5, 0.05); /* 4 of 8 m are seen */
        assert_near(h->weight, h->strength, 0);
        points = cairn_virtual_scan_points(f.v, &weights, &point_count);
        assert_int_equal(h->first_point, 0);
        assert_int_equal(h->end_point, point_count);
        assert_in_range(point_count, 77, 80);
        for (int32_t i = 0; i < point_count; i++) {
            double x = (double)points[i].position.x - 5, y = (double)points[i].position.y - 5;

            assert_near(y * dx - x * dy, 0, NUMBER(1e-6, 1e-4));
            assert_near(x * dx + y * dy, 4 + (i - (point_count - 1) / 2.0) * 0.1, 0.11);
            assert_near(points[i].direction.x, dx, NUMBER(1e-6, 1e-4));
            assert_near(points[i].direction.y, dy, NUMBER(1e-6, 1e-4));
            assert_near(weights[i], h->weight, 0);
        }
        for (int32_t i = 1; i < point_count; i++)
            assert_near(hypot((double)(points[i].position.x - points[i - 1].position.x),
                              (double)(points[i].position.y - points[i - 1].position.y)),
                        0.1, 1e-5);
        assert_int_equal(cairn_virtual_scan_dropped(f.v), 0);
        end_fixture(&f);
    }
}

/* The walls of a third scan, one on each side, are of the line up to the support distance. */
static void walls_at_the_support_distance_are_of_the_line(void **state)
{
    static const double distance[2] = {0.0625, 0.0626};

    (void)state;
    for (int k = 0; k < 2; k++) {
        cairn_virtual_scan_params p = cairn_virtual_scan_default();
        struct drawing one = drawing_at(0, 0, 0), other = drawing_at(0, 0, 0),
                       third = drawing_at(0, 0, 0);
        const cairn_virtual_scan_hypothesis *h;
        struct fixture f;
        int32_t count;

        p.hough.support_distance = CAIRN_REAL(0.0625);
        f = fixture_with(&p);
        wall(&one, 0, 0, 3, 0);
        wall(&other, 4, 0, 7, 0);
        wall(&third, 3, distance[k], 4, distance[k]);
        wall(&third, 3, -distance[k], 4, -distance[k]);
        put(&f, &one);
        put(&f, &other);
        put(&f, &third);
        h = detect(&f, 0, &count);
        assert_int_equal(count, 1);
        assert_int_equal(h->observing_scans, k == 0 ? 3 : 2);
        end_fixture(&f);
    }
}

/* The greater the error of the scans, the farther apart may be the walls of which a line is made:
 * 0.3 sigma to each side. */
static void tolerances_follow_sigma(void **state)
{
    static const struct {
        double sigma, apart, turn;
        int32_t lines;
    } cases[] = {{0, 0.04, 0, 1},  {0, 0.2, 0, 0},   {0.5, 0.2, 0, 1},
                 {0.5, 0.5, 0, 0}, {1.0, 0.4, 0, 1}, {0, 0, 8, 0},
                 {0.8, 0, 8, 1},   {0.8, 0, 14, 0},  {1e5, 0, 25, 1}};

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct fixture f = default_fixture();
        struct drawing one = drawing_at(0, -1, 0), other = drawing_at(4, -1, 0);
        double turn = cases[i].turn * DEGREE, at = cases[i].apart;
        int32_t count;

        wall(&one, 0, 0, 3, 0);
        if (turn > 0)
            wall(&other, 2.5 - cos(turn), -sin(turn), 2.5 + cos(turn), sin(turn));
        else
            wall(&other, 3, at, 6, at);
        put(&f, &one);
        put(&f, &other);
        (void)detect(&f, cases[i].sigma, &count);
        if (count != cases[i].lines)
            fail_msg("case %d: %d lines", (int)i, (int)count);
        end_fixture(&f);
    }
}

static void short_walls_do_not_count(void **state)
{
    cairn_virtual_scan_params p = cairn_virtual_scan_default();
    struct fixture f = fixture_with(&p);
    struct drawing one = drawing_at(0, -1, 0), other = drawing_at(4, -1, 0),
                   third = drawing_at(1, 1, 1);
    const cairn_virtual_scan_hypothesis *h;
    int32_t count;

    (void)state;
    wall(&one, 0, 0, 3, 0);
    wall(&other, 4, 0, 4.3, 0);
    put(&f, &one);
    put(&f, &other);
    (void)detect(&f, 0.1, &count);
    assert_int_equal(count, 0);
    wall(&third, 5, 0, 5.6, 0);
    put(&f, &third);
    h = detect(&f, 0.1, &count);
    assert_int_equal(count, 1);
    assert_int_equal(h->observing_scans, 2);
    end_fixture(&f);
    /* Three of them are requested. */
    p.min_scans = 3;
    f = fixture_with(&p);
    put(&f, &one);
    put(&f, &other);
    put(&f, &third);
    (void)detect(&f, 0.1, &count);
    assert_int_equal(count, 0);
    wall(&other, 6, 0, 6.4, 0);
    other.pose = drawing_at(4, -1, 0).pose;
    end_fixture(&f);
    f = fixture_with(&p);
    put(&f, &one);
    put(&f, &other);
    put(&f, &third);
    h = detect(&f, 0.1, &count);
    assert_int_equal(count, 1);
    assert_int_equal(h->observing_scans, 3);
    end_fixture(&f);
}

/* ---- Rectangles ---- */

/* A room; each of two scans sees an L of it. */
static void draw_room(struct fixture *f, double width, int32_t is_box)
{
    struct drawing one = drawing_at(1, 1, 0.2), other = drawing_at(3, 2, -1);

    if (is_box) {
        wall(&one, width, 0, 0, 0);
        wall(&one, width, 3, width, 0);
        wall(&other, 0, 3, width, 3);
        wall(&other, 0, 0, 0, 3);
    } else {
        wall(&one, 0, 0, width, 0);
        wall(&one, width, 0, width, 3);
        wall(&other, width, 3, 0, 3);
        wall(&other, 0, 3, 0, 0);
    }
    put(f, &one);
    put(f, &other);
}

static void rooms_are_rectangles(void **state)
{
    (void)state;
    for (int32_t is_box = 0; is_box < 2; is_box++) {
        struct fixture f = default_fixture();
        const cairn_virtual_scan_hypothesis *h;
        const cairn_oriented_point *points;
        const cairn_real *weights;
        int32_t count, point_count, on[4] = {0, 0, 0, 0};

        draw_room(&f, 4, is_box);
        h = detect(&f, 0, &count);
        assert_int_equal(count, 1);
        assert_int_equal(h->kind, CAIRN_VIRTUAL_SCAN_RECTANGLE);
        assert_near(h->strength, 1, 1e-3);
        assert_near(h->weight, h->strength, 0);
        points = cairn_virtual_scan_points(f.v, &weights, &point_count);
        assert_in_range(point_count, 140, 144);
        for (int32_t i = 0; i < point_count; i++) {
            double x = (double)points[i].position.x, y = (double)points[i].position.y;
            /* The free side is on the left: inside of a room. */
            double to_left =
                (double)points[i].direction.x * (1.5 - y) - (double)points[i].direction.y * (2 - x);

            assert_true(is_box ? to_left < 0 : to_left > 0);
            on[0] += fabs(y) < 1e-4;
            on[1] += fabs(x - 4) < 1e-4;
            on[2] += fabs(y - 3) < 1e-4;
            on[3] += fabs(x) < 1e-4;
            assert_near(weights[i], h->weight, 0);
        }
        /* Corners lie on two of them. */
        assert_in_range(on[0], 40, 43);
        assert_in_range(on[1], 30, 33);
        assert_in_range(on[2], 40, 43);
        assert_in_range(on[3], 30, 33);
        end_fixture(&f);
    }
}

/* An arc of a round room about (1, 2), the free side inside, as a chain of points on one wall. */
static void draw_arc(struct drawing *d, double radius, double from, double to)
{
    cairn_transform scan_map = cairn_transform_of(cairn_pose_inverse(d->pose));
    int32_t at = d->first[d->walls], count = (int32_t)(radius * (to - from) / 0.1);

    for (int32_t i = 0; i <= count; i++, at++) {
        double angle = from + (to - from) * i / count;
        cairn_vec2 p = {(cairn_real)(1 + radius * cos(angle)),
                        (cairn_real)(2 + radius * sin(angle))};
        cairn_vec2 along = {(cairn_real)-sin(angle), (cairn_real)cos(angle)};

        d->points[at].position = cairn_transform_point(scan_map, p);
        d->points[at].direction = cairn_transform_direction(scan_map, along);
    }
    d->segments[d->walls].a = d->points[d->first[d->walls]].position;
    d->segments[d->walls].b = d->points[at - 1].position;
    d->first[++d->walls] = at;
}

/* Three scans of a third of a round room each make an ellipse, which is a full one; one scan alone
 * does not. */
static void round_rooms_are_ellipses(void **state)
{
    cairn_virtual_scan_params p = cairn_virtual_scan_default();

    (void)state;
    p.lines = p.rectangles = 0;
    p.stride = 1;
    for (int scans = 1; scans <= 3; scans += 2) {
        struct fixture f = fixture_with(&p);
        const cairn_virtual_scan_hypothesis *h;
        const cairn_oriented_point *points;
        const cairn_real *weights;
        int32_t count, point_count, walls = scans == 1 ? 16 : 8;

        for (int i = 0; i < scans; i++) {
            struct drawing d = drawing_at(i, 2, i);

            for (int k = 0; k < walls; k++) /* short, each of about one direction */
                draw_arc(&d, 1.5, 2 * PI * (i + k / (double)walls) / scans,
                         2 * PI * (i + (k + 1.0) / walls) / scans);
            put(&f, &d);
        }
        h = detect(&f, 0.05, &count);
        assert_int_equal(count, scans == 3);
        points = cairn_virtual_scan_points(f.v, &weights, &point_count);
        if (scans == 3) {
            assert_int_equal(h->kind, CAIRN_VIRTUAL_SCAN_ELLIPSE);
            assert_int_equal(h->observing_scans, 3);
            assert_true(h->strength > (cairn_real)0.7 && h->weight == h->strength);
            assert_int_equal(h->first_point, 0);
            assert_int_equal(h->end_point, point_count);
            assert_int_equal(point_count, 95); /* 9.42 m, 0.1 m apart */
        }
        for (int32_t i = 0; i < point_count; i++) {
            double x = (double)points[i].position.x - 1, y = (double)points[i].position.y - 2;

            assert_near(hypot(x, y), 1.5, 0.03);
            assert_near(weights[i], h->weight, 0);
            assert_true((double)points[i].direction.x * -y + (double)points[i].direction.y * x >
                        1.45);
        }
        end_fixture(&f);
        if (scans == 3) { /* capacity for half of it; then none; then not requested */
            for (int k = 0; k < 2; k++) {
                cairn_virtual_scan_params less = p;

                less.max_virtual = k == 0 ? 40 : p.max_virtual;
                less.ellipses = k == 0;
                f = fixture_with(&less);
                for (int i = 0; i < scans; i++) {
                    struct drawing d = drawing_at(i, 2, i);

                    for (int j = 0; j < 8; j++)
                        draw_arc(&d, 1.5, 2 * PI * (i + j / 8.0) / 3,
                                 2 * PI * (i + (j + 1) / 8.0) / 3);
                    put(&f, &d);
                }
                (void)detect(&f, 0.05, &count);
                (void)cairn_virtual_scan_points(f.v, &weights, &point_count);
                assert_int_equal(count, k == 0);
                assert_int_equal(point_count, k == 0 ? 40 : 0);
                assert_int_equal(cairn_virtual_scan_dropped(f.v), k == 0 ? 55 : 0);
                end_fixture(&f);
            }
        }
    }
}

static void kinds_can_be_left_out(void **state)
{
    cairn_virtual_scan_params p = cairn_virtual_scan_default();
    struct drawing more = drawing_at(1, 1, 0);

    (void)state;
    wall(&more, 5, 0, 7, 0);
    for (int32_t kinds = 0; kinds < 4; kinds++) {
        struct fixture f;
        const cairn_virtual_scan_hypothesis *h;
        int32_t count, seen[2] = {0, 0};

        p.lines = (kinds & 1) != 0;
        p.rectangles = (kinds & 2) != 0;
        p.weight = 2;
        f = fixture_with(&p);
        draw_room(&f, 4, 0);
        put(&f, &more); /* continues a wall of the room */
        h = detect(&f, 0, &count);
        for (int32_t i = 0; i < count; i++) {
            seen[h[i].kind]++;
            assert_near(h[i].weight, 2 * h[i].strength, 0);
        }
        assert_int_equal(seen[CAIRN_VIRTUAL_SCAN_LINE], kinds & 1);
        assert_int_equal(seen[CAIRN_VIRTUAL_SCAN_RECTANGLE], kinds >> 1);
        if (count == 2) {
            assert_int_equal(h[0].kind, CAIRN_VIRTUAL_SCAN_LINE);
            assert_int_equal(h[1].first_point, h[0].end_point);
        }
        end_fixture(&f);
    }
}

/* What is no longer in the map is gone. */
static void hypotheses_vanish(void **state)
{
    struct fixture f = default_fixture();
    int32_t count, point_count;
    const cairn_real *weights;

    (void)state;
    draw_room(&f, 4, 0);
    (void)detect(&f, 0, &count);
    assert_int_equal(count, 1);
    f.poses[1].x += 9;
    f.poses[1].y += 7;
    /* The last result stays while the next is computed. */
    give(&f, 0);
    (void)cairn_virtual_scan_hypotheses(f.v, &count);
    assert_int_equal(count, 1);
    (void)detect(&f, 0, &count);
    assert_int_equal(count, 0);
    (void)cairn_virtual_scan_points(f.v, &weights, &point_count);
    assert_int_equal(point_count, 0);
    end_fixture(&f);
}

/* ---- Detectors of the caller ---- */

/* Finds `count` discs of three points each, in as many steps, and fails on request. */
struct discs {
    int32_t count, done, begun, fail_at;
    cairn_virtual_scan_map map;
};

static cairn_status begin_discs(void *state, const cairn_virtual_scan_map *map)
{
    struct discs *d = state;

    d->done = 0;
    d->begun++;
    d->map = *map;
    return d->fail_at == 1 ? CAIRN_EMPTY : CAIRN_OK;
}

static cairn_status step_discs(void *state, cairn_budget *budget)
{
    struct discs *d = state;

    while (d->done < d->count) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        d->done++;
    }
    return d->fail_at == 2 ? CAIRN_FULL : CAIRN_OK;
}

static int32_t count_discs(const void *state)
{
    return ((const struct discs *)state)->done;
}

static int32_t outline_disc(const void *state, int32_t i, cairn_real spacing,
                            cairn_oriented_point *points, int32_t capacity, cairn_real *strength)
{
    int32_t count = capacity < 3 ? capacity : 3;

    (void)state;
    for (int32_t k = 0; k < count; k++) {
        points[k].position.x = (cairn_real)i;
        points[k].position.y = (cairn_real)k * spacing;
        points[k].direction.x = 1;
        points[k].direction.y = 0;
    }
    *strength = CAIRN_REAL(0.25);
    return count;
}

static void kinds_of_the_caller(void **state)
{
    cairn_virtual_scan_params p = cairn_virtual_scan_default();
    struct fixture f;
    struct discs discs = {5, 0, 0, 0, {NULL, NULL, NULL, NULL, 0, 0, 0}},
                 others = {2, 0, 0, 0, {NULL, NULL, NULL, NULL, 0, 0, 0}};
    cairn_virtual_scan_hypothesis_detector d = {&discs, begin_discs, step_discs, count_discs,
                                                outline_disc},
                                           e = d, bad;
    const cairn_virtual_scan_hypothesis *h;
    const cairn_oriented_point *points;
    const cairn_real *weights;
    int32_t count, point_count;

    (void)state;
    p.max_detectors = 2;
    f = fixture_with(&p);
    e.state = &others;
    for (int32_t i = 0; i < 4; i++) {
        bad = d;
        bad.begin = i == 0 ? NULL : d.begin;
        bad.step = i == 1 ? NULL : d.step;
        bad.count = i == 2 ? NULL : d.count;
        bad.outline = i == 3 ? NULL : d.outline;
        assert_status(cairn_virtual_scan_add_detector(f.v, &bad), CAIRN_BAD_ARGUMENT);
    }
    assert_status(cairn_virtual_scan_add_detector(NULL, &d), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_virtual_scan_add_detector(f.v, NULL), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_virtual_scan_add_detector(f.v, &d));
    assert_ok(cairn_virtual_scan_add_detector(f.v, &e));
    assert_status(cairn_virtual_scan_add_detector(f.v, &e), CAIRN_FULL);
    draw_room(&f, 4, 0);
    h = detect(&f, 0, &count);
    assert_int_equal(count, 8);
    assert_int_equal(discs.begun, 1);
    assert_int_equal(discs.map.segment_count, 4);
    assert_int_equal(discs.map.point_count, 70);
    assert_int_equal(discs.map.point_scan[0], 0);
    assert_int_equal(discs.map.point_scan[69], 1);
    assert_int_equal(discs.map.segment_scan[1], 0);
    assert_int_equal(discs.map.segment_scan[2], 1);
    assert_near(discs.map.points[0].position.x, 0.05, 1e-5);
    assert_near(discs.map.points[1].position.x, 0.25, 1e-5);
    assert_near(discs.map.segments[1].b.y, 3, 1e-5);
    points = cairn_virtual_scan_points(f.v, &weights, &point_count);
    for (int32_t i = 1; i < 8; i++) {
        assert_int_equal(h[i].kind, CAIRN_VIRTUAL_SCAN_CALLER + (i > 5));
        assert_near(h[i].strength, 0.25, 0);
        assert_near(h[i].weight, 0.25, 0);
        assert_int_equal(h[i].end_point, h[i].first_point + 3);
        assert_int_equal(h[i].first_point, h[i - 1].end_point);
        assert_near(points[h[i].first_point + 2].position.x, i > 5 ? i - 6 : i - 1, 0);
        assert_near(points[h[i].first_point + 2].position.y, 0.2, 1e-6);
        assert_near(weights[h[i].first_point + 2], 0.25, 0);
    }
    assert_int_equal(h[7].end_point, point_count);
    /* The status of a detector is returned to the caller, and the last result stays. */
    for (int32_t at = 1; at <= 2; at++) {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        others.fail_at = at;
        give(&f, 0);
        assert_status(cairn_virtual_scan_step(f.v, &budget), at == 1 ? CAIRN_EMPTY : CAIRN_FULL);
        assert_ok(cairn_virtual_scan_step(f.v, &budget));
        (void)cairn_virtual_scan_hypotheses(f.v, &count);
        assert_int_equal(count, 8);
    }
    end_fixture(&f);
}

/* ---- Capacities ---- */

static void what_exceeds_capacities(void **state)
{
    cairn_virtual_scan_params p = cairn_virtual_scan_default();
    struct discs discs = {5, 0, 0, 0, {NULL, NULL, NULL, NULL, 0, 0, 0}};
    cairn_virtual_scan_hypothesis_detector d = {&discs, begin_discs, step_discs, count_discs,
                                                outline_disc};
    const cairn_virtual_scan_hypothesis *h;
    const cairn_real *weights;
    struct fixture f;
    int32_t count, point_count, whole;

    (void)state;
    f = fixture_with(&p);
    draw_room(&f, 4, 0);
    (void)detect(&f, 0, &count);
    (void)cairn_virtual_scan_points(f.v, &weights, &whole);
    end_fixture(&f);

    p.max_virtual = whole - 10;
    p.max_hypotheses = 3;
    f = fixture_with(&p);
    assert_ok(cairn_virtual_scan_add_detector(f.v, &d));
    draw_room(&f, 4, 0);
    h = detect(&f, 0, &count);
    (void)cairn_virtual_scan_points(f.v, &weights, &point_count);
    assert_int_equal(point_count, whole - 10);
    assert_int_equal(count, 3);
    assert_int_equal(h[0].end_point, whole - 10);
    assert_int_equal(h[2].end_point, h[2].first_point);
    assert_int_equal(cairn_virtual_scan_dropped(f.v), 10 + 3);
    end_fixture(&f);

    p = cairn_virtual_scan_default();
    p.max_points = 69;
    f = fixture_with(&p);
    draw_room(&f, 4, 0);
    assert_ok(cairn_virtual_scan_begin(f.v, 0));
    assert_ok(cairn_virtual_scan_add_scan(f.v, f.set, 0, f.poses[0]));
    assert_status(cairn_virtual_scan_add_scan(f.v, f.set, 1, f.poses[1]), CAIRN_FULL);
    assert_status(cairn_virtual_scan_add_scan(f.v, f.set, 1, f.poses[1]), CAIRN_FULL);
    end_fixture(&f);
    p.max_points = 70;
    p.max_segments = 3;
    f = fixture_with(&p);
    draw_room(&f, 4, 0);
    assert_ok(cairn_virtual_scan_begin(f.v, 0));
    assert_ok(cairn_virtual_scan_add_scan(f.v, f.set, 0, f.poses[0]));
    assert_status(cairn_virtual_scan_add_scan(f.v, f.set, 1, f.poses[1]), CAIRN_FULL);
    end_fixture(&f);
    p.max_segments = 4;
    f = fixture_with(&p);
    draw_room(&f, 4, 0);
    (void)detect(&f, 0, &count);
    assert_int_equal(count, 1);
    end_fixture(&f);
}

static void the_budget_does_not_matter(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    static cairn_oriented_point whole[5000];
    struct fixture f = default_fixture();
    struct discs discs = {5, 0, 0, 0, {NULL, NULL, NULL, NULL, 0, 0, 0}};
    cairn_virtual_scan_hypothesis_detector d = {&discs, begin_discs, step_discs, count_discs,
                                                outline_disc};
    struct drawing more = drawing_at(1, 1, 0);
    const cairn_oriented_point *points;
    const cairn_real *weights;
    int32_t count, point_count, got;

    (void)state;
    assert_ok(cairn_virtual_scan_add_detector(f.v, &d));
    draw_room(&f, 4, 0);
    wall(&more, 5, 0, 7, 0);
    put(&f, &more);
    (void)detect(&f, 0.1, &count);
    assert_int_equal(count, 7);
    points = cairn_virtual_scan_points(f.v, &weights, &point_count);
    memcpy(whole, points, (size_t)point_count * sizeof *whole);
    for (int i = 0; i < 3; i++) {
        cairn_budget budget = {0};
        cairn_status status;
        int64_t units = 0;

        give(&f, 0.1);
        assert_status(cairn_virtual_scan_step(f.v, &budget), CAIRN_MORE);
        do {
            budget.left = budgets[i];
            status = cairn_virtual_scan_step(f.v, &budget);
            assert_true(budget.left >= 0);
            units += budgets[i] - budget.left;
        } while (status == CAIRN_MORE);
        assert_ok(status);
        points = cairn_virtual_scan_points(f.v, &weights, &got);
        assert_int_equal(got, point_count);
        assert_memory_equal(points, whole, (size_t)got * sizeof *whole);
        assert_int_equal(units, NUMBER(0x54e6, 0x5424));
    }
    end_fixture(&f);
}

/* ---- The bits ---- */

/* Rooms as several segments and isolated walls on a grid of a quarter of a metre, each in one of
 * the given scans. */
static void draw_quarters(struct fixture *f, cairn_random *random)
{
    int32_t scans = 2 + cairn_random_below(random, 3);

    for (int32_t k = 0; k < scans; k++) {
        double x = 0.25 * cairn_random_below(random, 8);
        double y = 0.25 * cairn_random_below(random, 8);
        double theta =
            cairn_random_below(random, 2) == 0 ? (double)cairn_random_uniform(random, -3, 3) : 0;
        struct drawing d = drawing_at(x, y, theta);

        for (int32_t i = 0; i < 5; i++) {
            double at = 1.25 * cairn_random_below(random, 3);
            double from = 0.25 * cairn_random_below(random, 12);
            double to = from + 0.25 * (1 + cairn_random_below(random, 10));
            int32_t quarters = cairn_random_below(random, 9) / 4 - 1;
            double askew = 0.25 * quarters;
            int32_t back = cairn_random_below(random, 4) == 0;

            askew = back || i > 1 ? 0 : askew;
            if (cairn_random_below(random, 2) == 0)
                wall(&d, back ? to : from, at, back ? from : to, at + askew);
            else
                wall(&d, at, back ? from : to, at + askew, back ? to : from);
        }
        put(f, &d);
    }
}

/* A few points and segments, two thirds of the capacity. */
static cairn_virtual_scan_params draw_params(cairn_random *random)
{
    cairn_virtual_scan_params p = cairn_virtual_scan_default();

    p.max_hypotheses = 2 + cairn_random_below(random, 12);
    p.max_virtual = 100 + cairn_random_below(random, 900);
    p.max_scans = 64 * (1 + cairn_random_below(random, 2));
    p.stride = 1 + cairn_random_below(random, 3);
    p.spacing = CAIRN_REAL(0.125) * (cairn_real)(1 + cairn_random_below(random, 2));
    p.weight = CAIRN_REAL(0.5) * (cairn_real)cairn_random_below(random, 4);
    p.distance_per_sigma = CAIRN_REAL(0.25);
    p.angle_per_sigma = CAIRN_REAL(0.25);
    p.min_scans = 1 + cairn_random_below(random, 2);
    p.min_wall_length = CAIRN_REAL(0.25) * (cairn_real)cairn_random_below(random, 4);
    p.hough.angles = 32;
    p.hough.spacing = CAIRN_REAL(0.125);
    p.hough.min_votes = (cairn_real)(3 + cairn_random_below(random, 4));
    p.hough.oriented = cairn_random_below(random, 2);
    p.rectangle.min_side = CAIRN_REAL(0.5);
    p.rectangle.oriented = cairn_random_below(random, 2);
    return p;
}

static uint64_t add_real(uint64_t hash, cairn_real x)
{
    assert_true(x == x);
    return test_hash(hash, &x, sizeof x);
}

static uint64_t add_found(const struct fixture *f, uint64_t hash)
{
    const cairn_virtual_scan_hypothesis *h;
    const cairn_oriented_point *points;
    const cairn_real *weights;
    int32_t count, point_count, dropped;

    h = cairn_virtual_scan_hypotheses(f->v, &count);
    points = cairn_virtual_scan_points(f->v, &weights, &point_count);
    dropped = cairn_virtual_scan_dropped(f->v);
    hash = test_hash(hash, &dropped, sizeof dropped);
    for (int32_t i = 0; i < count; i++) {
        int32_t whole[4] = {h[i].kind, h[i].first_point, h[i].end_point, h[i].observing_scans};

        hash = add_real(add_real(test_hash(hash, whole, sizeof whole), h[i].strength), h[i].weight);
    }
    for (int32_t i = 0; i < point_count; i++) {
        hash = add_real(add_real(hash, points[i].position.x), points[i].position.y);
        hash = add_real(add_real(hash, points[i].direction.x), points[i].direction.y);
        hash = add_real(hash, weights[i]);
    }
    return hash;
}

static uint64_t hash_of_detection(struct fixture *f, double sigma, uint64_t hash)
{
    cairn_budget budget = {1 << 28};

    give(f, sigma);
    assert_ok(cairn_virtual_scan_step(f->v, &budget));
    return add_found(f, test_hash(hash, &budget.left, sizeof budget.left));
}

static uint64_t hash_of_maps(uint64_t seed)
{
    uint64_t hash = TEST_HASH_START;
    cairn_random random = cairn_random_seed(seed, 0);

    for (int32_t i = 0; i < 30; i++) {
        cairn_virtual_scan_params p = draw_params(&random);
        struct fixture f = fixture_with(&p);
        struct discs discs = {2, 0, 0, 0, {NULL, NULL, NULL, NULL, 0, 0, 0}};
        cairn_virtual_scan_hypothesis_detector d = {&discs, begin_discs, step_discs, count_discs,
                                                    outline_disc};

        if (i % 3 == 0)
            assert_ok(cairn_virtual_scan_add_detector(f.v, &d));
        draw_quarters(&f, &random);
        hash = hash_of_detection(&f, 0.25 * cairn_random_below(&random, 4), hash);
        f.poses[0].x += CAIRN_REAL(0.125);
        hash = hash_of_detection(&f, cairn_random_below(&random, 8), hash);
        end_fixture(&f);
    }
    return hash;
}

static cairn_status begin_map(void *context)
{
    give(context, 0.25);
    return CAIRN_OK;
}

static cairn_status step_map(void *context, cairn_budget *budget)
{
    return cairn_virtual_scan_step(((struct fixture *)context)->v, budget);
}

static uint64_t hash_map(void *context)
{
    return add_found(context, TEST_HASH_START);
}

static void begins_anew(void **state)
{
    cairn_random random = cairn_random_seed(7, 0);
    cairn_virtual_scan_params p = draw_params(&random);
    struct fixture f;
    struct discs discs = {5, 0, 0, 0, {NULL, NULL, NULL, NULL, 0, 0, 0}};
    cairn_virtual_scan_hypothesis_detector d = {&discs, begin_discs, step_discs, count_discs,
                                                outline_disc};
    test_stepped object = {begin_map, step_map, hash_map, &f};

    (void)state;
    p.hough.angles = p.hough.distances = 16;
    p.max_hypotheses = 5;
    f = fixture_with(&p);
    assert_ok(cairn_virtual_scan_add_detector(f.v, &d));
    draw_quarters(&f, &random);
    test_begins_anew(&object, 100);
    end_fixture(&f);
}

static void all_bits_are_kept(void **state)
{
    (void)state;
    assert_golden(hash_of_maps(1), UINT64_C(0xb7412fd9aaddecda), UINT64_C(0x13401cae8a65a20f));
    assert_golden(hash_of_maps(2), UINT64_C(0xb12bc0ddda2125e3), UINT64_C(0x35c6014fcf08fed0));
}

/* ---- Refusals ---- */

static void bad_calls_are_refused(void **state)
{
    struct fixture f = default_fixture();
    cairn_pose far = {CAIRN_REAL(5.0001e5), 0, 0}, edge = {CAIRN_REAL(5e5), CAIRN_REAL(-5e5), 0},
               low = {0, CAIRN_REAL(-5.0001e5), 0}, nan = {0, 0, (cairn_real)NAN};
    cairn_budget budget = {1};
    int32_t count;

    (void)state;
    (void)cairn_virtual_scan_hypotheses(f.v, &count);
    assert_int_equal(count, 0);
    /* nothing was begun */
    assert_ok(cairn_virtual_scan_step(f.v, &budget));
    draw_room(&f, 4, 0);
    /* not begun */
    assert_status(cairn_virtual_scan_add_scan(f.v, f.set, 0, f.poses[0]), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_virtual_scan_begin(NULL, 0), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_virtual_scan_begin(f.v, CAIRN_REAL(-0.1)), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_virtual_scan_begin(f.v, (cairn_real)NAN), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_virtual_scan_begin(f.v, (cairn_real)INFINITY), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_virtual_scan_begin(f.v, CAIRN_REAL(5.0001e5)), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_virtual_scan_begin(f.v, CAIRN_REAL(5e5)));
    assert_ok(cairn_virtual_scan_add_scan(f.v, f.set, 0, edge));
    assert_ok(cairn_virtual_scan_begin(f.v, 0));
    assert_status(cairn_virtual_scan_add_scan(NULL, f.set, 0, f.poses[0]), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_virtual_scan_add_scan(f.v, NULL, 0, f.poses[0]), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_virtual_scan_add_scan(f.v, f.set, -1, f.poses[0]), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_virtual_scan_add_scan(f.v, f.set, 2, f.poses[0]), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_virtual_scan_add_scan(f.v, f.set, 0, far), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_virtual_scan_add_scan(f.v, f.set, 0, low), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_virtual_scan_add_scan(f.v, f.set, 0, nan), CAIRN_NOT_FINITE);
    assert_ok(cairn_scan_set_remove(f.set, 1));
    assert_status(cairn_virtual_scan_add_scan(f.v, f.set, 1, f.poses[1]), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_virtual_scan_add_scan(f.v, f.set, 0, f.poses[0]));
    assert_status(cairn_virtual_scan_step(f.v, &budget), CAIRN_MORE);
    /* too late */
    assert_status(cairn_virtual_scan_add_scan(f.v, f.set, 0, f.poses[0]), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_virtual_scan_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_virtual_scan_step(f.v, NULL), CAIRN_BAD_ARGUMENT);
    end_fixture(&f);
}

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_virtual_scan *v;

    return cairn_virtual_scan_create(&v, pool, context);
}

#define REFUSED(change)                                                                            \
    do {                                                                                           \
        p = cairn_virtual_scan_default();                                                          \
        change;                                                                                    \
        assert_int_equal(cairn_virtual_scan_memory(&p), 0);                                        \
        assert_status(cairn_virtual_scan_create(&v, &pool, &p), CAIRN_BAD_ARGUMENT);               \
        assert_int_equal(pool.used, 0);                                                            \
    } while (0)

/* Rules between parameters; tests/test_object.c has the ranges. */
static void bad_params_are_refused(void **state)
{
    cairn_virtual_scan_params p = cairn_virtual_scan_default();
    cairn_pool pool = test_pool(cairn_virtual_scan_memory(&p));
    cairn_virtual_scan *v = NULL;

    (void)state;
    REFUSED(p.hough.angles = 0);
    REFUSED(p.rectangle.max_pairs = 0);
    p = cairn_virtual_scan_default();
    assert_int_equal(cairn_virtual_scan_memory(NULL), 0);
    assert_status(cairn_virtual_scan_create(&v, &pool, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_virtual_scan_create(&v, NULL, &p), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_virtual_scan_create(NULL, &pool, &p), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_virtual_scan_create(&v, &pool, &p));
    test_pool_free(&pool);
    /* The ends of the ranges are accepted. */
    p.max_scans = p.max_segments = 1 << 20;
    p.max_points = p.max_virtual = 1 << 24;
    p.max_hypotheses = 1024;
    p.max_detectors = 16;
    p.stride = 1;
    p.spacing = p.weight = p.angle_per_sigma = p.min_wall_length = CAIRN_REAL(1e6);
    p.distance_per_sigma = 1;
    p.min_scans = 1;
    assert_true(cairn_virtual_scan_memory(&p) > 0);
    p.max_points = p.max_virtual = p.max_hypotheses = p.max_scans = p.max_segments = 1;
    p.weight = p.min_wall_length = 0;
    assert_true(cairn_virtual_scan_memory(&p) > 0);
    p = cairn_virtual_scan_default();
    p.max_scans = 3;
    p.max_points = 20;
    p.max_segments = 7;
    p.max_virtual = 9;
    p.max_hypotheses = 2;
    p.max_detectors = 0;
    p.hough.angles = p.hough.distances = 8;
    p.rectangle.max_pairs = p.rectangle.max_sides = 4;
    test_every_pool_size(create, &p, cairn_virtual_scan_memory(&p));
}

/* Params are refused for a field of 0, below its range. */
static void assert_refused_field(cairn_virtual_scan_params p, const char *module, const char *field,
                                 double lowest)
{
    cairn_object_fault refused;

    assert_status(cairn_virtual_scan_check(&p, &refused), CAIRN_BAD_ARGUMENT);
    assert_string_equal(refused.module, module);
    assert_string_equal(refused.field, field);
    assert_near(refused.value, 0, 0);
    assert_near(refused.lowest, lowest, 0);
}

static void refusals_name_the_field_of_a_nested_object(void **state)
{
    cairn_virtual_scan_params hough = cairn_virtual_scan_default(), rectangle = hough,
                              ellipse = hough;
    cairn_object_fault refused;

    (void)state;
    hough.hough.angles = 0;
    assert_refused_field(hough, "hough", "angles", 8);
    rectangle.rectangle.max_pairs = 0;
    assert_refused_field(rectangle, "rectangle", "max_pairs", 1);
    ellipse.ellipse.max_radius = ellipse.ellipse.min_radius;
    assert_status(cairn_virtual_scan_check(&ellipse, &refused), CAIRN_BAD_ARGUMENT);
    assert_string_equal(refused.module, "ellipse");
    assert_null(refused.field);
    assert_string_equal(refused.rule, "max_radius: above min_radius");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(walls_of_two_scans_make_a_line),
        cmocka_unit_test(tolerances_follow_sigma),
        cmocka_unit_test(walls_at_the_support_distance_are_of_the_line),
        cmocka_unit_test(short_walls_do_not_count),
        cmocka_unit_test(rooms_are_rectangles),
        cmocka_unit_test(kinds_can_be_left_out),
        cmocka_unit_test(round_rooms_are_ellipses),
        cmocka_unit_test(hypotheses_vanish),
        cmocka_unit_test(kinds_of_the_caller),
        cmocka_unit_test(what_exceeds_capacities),
        cmocka_unit_test(the_budget_does_not_matter),
        cmocka_unit_test(all_bits_are_kept),
        cmocka_unit_test(begins_anew),
        cmocka_unit_test(bad_calls_are_refused),
        cmocka_unit_test(bad_params_are_refused),
        cmocka_unit_test(refusals_name_the_field_of_a_nested_object),
    };

    return cmocka_run_group_tests_name("virtual_scan", tests, NULL, NULL);
}
