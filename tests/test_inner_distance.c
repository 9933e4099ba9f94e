/* Inner distances compared with shortest paths over all pairs of vertices; notches, crossing
 * sides, refusals. */
#include "tests/test.h"

#include <math.h>

#include "cairn/inner_distance.h"

enum { ITEM_COUNT = 120 };

static const double tolerance = NUMBER(1e-9, 2e-4);

static cairn_vec2 at(double x, double y)
{
    cairn_vec2 v = {(cairn_real)x, (cairn_real)y};

    return v;
}

typedef struct measuring {
    cairn_pool pool;
    cairn_inner_distance *inner;
} measuring;

static measuring new_measuring(int32_t points, int32_t fill)
{
    cairn_inner_distance_params params = {.max_points = points, .fill_holes = fill};
    measuring m;

    m.pool = test_pool(cairn_inner_distance_memory(&params));
    assert_ok(cairn_inner_distance_create(&m.inner, &m.pool, &params));
    return m;
}

static cairn_inner_distance_result measure(measuring *m, const cairn_curve *outlines, int32_t count)
{
    cairn_budget budget = {INT32_MAX};

    assert_ok(cairn_inner_distance_begin(m->inner, outlines, count));
    assert_ok(cairn_inner_distance_step(m->inner, &budget));
    return cairn_inner_distance_read(m->inner);
}

/* ---- Reference implementation: all segments with all sides, sums over all vertices ---- */

/* All vertices and sides of a shape. */
typedef struct graph {
    double x[ITEM_COUNT], y[ITEM_COUNT], d[ITEM_COUNT][ITEM_COUNT];
    int32_t next[ITEM_COUNT], count;
} graph;

static double side_of_line(const graph *g, int32_t i, int32_t k, int32_t v)
{
    double dx = g->x[k] - g->x[i], dy = g->y[k] - g->y[i];

    return (dx * (g->y[v] - g->y[i]) - dy * (g->x[v] - g->x[i])) / hypot(dx, dy);
}

static int lies_between(const graph *g, int32_t i, int32_t k, int32_t v)
{
    double dx = g->x[k] - g->x[i], dy = g->y[k] - g->y[i];
    double along = dx * (g->x[v] - g->x[i]) + dy * (g->y[v] - g->y[i]);

    return fabs(side_of_line(g, i, k, v)) < NUMBER(1e-11, 1e-4) && along > 0 &&
           along < dx * dx + dy * dy;
}

/* By the even-odd rule over all outlines, holes included. */
static int is_inside(const graph *g, double x, double y)
{
    int inside = 0;

    for (int32_t v = 0; v < g->count; v++) {
        double ax = g->x[v], ay = g->y[v], bx = g->x[g->next[v]], by = g->y[g->next[v]];

        if ((ay > y) != (by > y) && x < ax + (y - ay) / (by - ay) * (bx - ax))
            inside = !inside;
    }
    return inside;
}

static int slow_visible(const graph *g, int32_t i, int32_t k)
{
    if (g->next[i] == k || g->next[k] == i)
        return 1;
    for (int32_t v = 0; v < g->count; v++) {
        int32_t w = g->next[v];

        if (v != i && v != k && lies_between(g, i, k, v))
            return 0;
        if (v == i || v == k || w == i || w == k)
            continue;
        if (side_of_line(g, i, k, v) * side_of_line(g, i, k, w) < 0 &&
            side_of_line(g, v, w, i) * side_of_line(g, v, w, k) < 0)
            return 0;
    }
    return is_inside(g, (g->x[i] + g->x[k]) / 2, (g->y[i] + g->y[k]) / 2);
}

static void slow_measure(graph *g, const cairn_curve *outlines, int32_t count)
{
    g->count = 0;
    for (int32_t o = 0; o < count; o++)
        for (int32_t i = 0, first = g->count; i < outlines[o].count; i++, g->count++) {
            g->x[g->count] = (double)outlines[o].points[i].x;
            g->y[g->count] = (double)outlines[o].points[i].y;
            g->next[g->count] = i + 1 < outlines[o].count ? g->count + 1 : first;
        }
    for (int32_t i = 0; i < g->count; i++)
        for (int32_t k = 0; k < g->count; k++)
            g->d[i][k] = i == k                  ? 0
                         : slow_visible(g, i, k) ? hypot(g->x[i] - g->x[k], g->y[i] - g->y[k])
                                                 : 1e9;
    for (int32_t over = 0; over < g->count; over++)
        for (int32_t i = 0; i < g->count; i++)
            for (int32_t k = 0; k < g->count; k++)
                g->d[i][k] = fmin(g->d[i][k], g->d[i][over] + g->d[over][k]);
}

static void assert_as_slow(measuring *m, const cairn_curve *outlines, int32_t count)
{
    cairn_inner_distance_result r = measure(m, outlines, count);
    double greatest = 0;
    static graph g;

    slow_measure(&g, outlines, count);
    assert_int_equal(r.count, outlines[0].count);
    for (int32_t i = 0; i < r.count; i++)
        for (int32_t k = 0; k < r.count; k++) {
            assert_near(r.distance[i * r.stride + k], g.d[i][k], tolerance);
            greatest = fmax(greatest, g.d[i][k]);
        }
    assert_near(r.max_distance, greatest, tolerance);
}

static cairn_curve closed(const cairn_vec2 *points, int32_t count)
{
    cairn_curve c = {points, count, 1};

    return c;
}

/* ---- Shapes ---- */

static cairn_curve star(cairn_vec2 *p, int32_t count, uint64_t seed, double scale, int clockwise)
{
    cairn_random random = cairn_random_seed(seed, 0);

    for (int32_t i = 0; i < count; i++) {
        double turn = (clockwise ? -2 : 2) * 3.14159265358979 * i / count;
        double r = scale * (double)cairn_random_uniform(&random, 5, 20);

        p[i] = at(30 + r * cos(turn), 20 + r * sin(turn));
    }
    return closed(p, count);
}

static cairn_curve spiral(cairn_vec2 *p, int32_t count, double turns, int clockwise)
{
    int32_t half = count / 2;

    for (int32_t i = 0; i < half; i++) {
        double turn = 6.2831853 * turns * i / (half - 1), inner = 3 + 2 * turn,
               outer = 7 + 2 * turn;
        int32_t low = clockwise ? count - 1 - i : i, high = clockwise ? i : count - 1 - i;

        p[high] = at(inner * cos(turn), inner * sin(turn));
        p[low] = at(outer * cos(turn), outer * sin(turn));
    }
    return closed(p, count);
}

/* Even samples of a comb of pixels: nearly all of them are collinear with others, and teeth are
 * aligned. */
static cairn_curve comb(cairn_vec2 *p)
{
    static const int8_t corner[][2] = {{0, 0}, {9, 0}, {9, 6}, {7, 6}, {7, 2}, {5, 2},
                                       {5, 6}, {3, 6}, {3, 2}, {2, 2}, {2, 6}, {0, 6}};
    enum { CORNERS = sizeof corner / sizeof *corner };
    int32_t n = 0;

    for (int32_t i = 0; i < CORNERS; i++) {
        const int8_t *a = corner[i], *b = corner[(i + 1) % CORNERS];
        int32_t steps = abs(b[0] - a[0]) + abs(b[1] - a[1]);

        for (int32_t k = 0; k < steps; k++)
            p[n++] = at(0.1 * (a[0] + (double)(b[0] - a[0]) * k / steps),
                        0.1 * (a[1] + (double)(b[1] - a[1]) * k / steps));
    }
    return closed(p, n);
}

static void spirals_and_stars(void **state)
{
    measuring m = new_measuring(ITEM_COUNT, 0);
    cairn_vec2 p[ITEM_COUNT];
    cairn_curve c;

    (void)state;
    for (int clockwise = 0; clockwise < 2; clockwise++) {
        for (int turns = 1; turns < 4; turns++) {
            c = spiral(p, 90 + 4 * turns, 0.7 * turns, clockwise);
            assert_as_slow(&m, &c, 1);
        }
        for (uint64_t seed = 0; seed < 8; seed++) {
            c = star(p, 3 + 9 * (int32_t)seed, seed, 1, clockwise);
            assert_as_slow(&m, &c, 1);
        }
        c = comb(p);
        assert_as_slow(&m, &c, 1);
    }
    test_pool_free(&m.pool);
}

static void ways_lead_round_holes(void **state)
{
    measuring m = new_measuring(ITEM_COUNT, 0), filled = new_measuring(ITEM_COUNT, 1);
    cairn_vec2 box[40], hole[2][30];
    cairn_inner_distance_result r;

    (void)state;
    for (int32_t i = 0; i < 40; i++)
        box[i] = at(i < 10   ? 6 * i
                    : i < 20 ? 60
                    : i < 30 ? 6 * (30 - i)
                             : 0,
                    i < 10   ? 0
                    : i < 20 ? 4 * (i - 10)
                    : i < 30 ? 40
                             : 4 * (40 - i));
    for (int clockwise = 0; clockwise < 2; clockwise++)
        for (uint64_t seed = 0; seed < 6; seed++) {
            cairn_curve shape[3] = {closed(box, 40), star(hole[0], 20, seed, 0.6, clockwise),
                                    closed(hole[1], 4)};

            hole[1][0] = at(50, 10);
            hole[1][1] = at(55, 10);
            hole[1][2] = at(55, 30);
            hole[1][3] = at(50, 30);
            assert_as_slow(&m, shape, 3);
            r = measure(&filled, shape, 3);
            assert_near(r.distance[5 * r.stride + 25], hypot(0, 40), tolerance);
            assert_int_equal(r.stride, 40);
        }
    test_pool_free(&m.pool);
    test_pool_free(&filled.pool);
}

/* A notch in a straight side: the segment along the side passes over it, outside. */
static void notches_are_gone_round(void **state)
{
    static const double corner[8][2] = {{0, 0}, {0, 4}, {10, 4}, {10, 0},
                                        {6, 0}, {6, 3}, {4, 3},  {4, 0}};
    measuring m = new_measuring(8, 0);
    cairn_inner_distance_result r;
    cairn_vec2 p[8];
    cairn_curve c = closed(p, 8);

    (void)state;
    for (int i = 0; i < 8; i++)
        p[i] = at(corner[i][0], corner[i][1]);
    assert_as_slow(&m, &c, 1);
    r = cairn_inner_distance_read(m.inner);
    assert_near(r.distance[0 * r.stride + 3], 2 * 5 + 2, tolerance);
    assert_near(r.distance[7 * r.stride + 4], 3 + 2 + 3, tolerance);
    assert_near(r.distance[1 * r.stride + 2], 10, tolerance);
    test_pool_free(&m.pool);
}

/* Sides that cross: distances stay finite, no longer than along the outline. */
static void crossed_outlines_stay_finite(void **state)
{
    measuring m = new_measuring(8, 0);
    cairn_vec2 p[5] = {at(0, 0), at(10, 10), at(10, 0), at(0, 9), at(-1, 4)};
    cairn_curve c = closed(p, 5);
    cairn_inner_distance_result r = measure(&m, &c, 1);
    double round = (double)cairn_curve_length(&c);

    (void)state;
    for (int32_t i = 0; i < 5; i++)
        for (int32_t k = 0; k < 5; k++) {
            assert_true((double)r.distance[i * r.stride + k] <= round / 2 + 1e-3);
            assert_true((double)r.distance[i * r.stride + k] >=
                        hypot((double)(p[i].x - p[k].x), (double)(p[i].y - p[k].y)) - 1e-3);
        }
    test_pool_free(&m.pool);
}

static uint64_t hash_of(void *context)
{
    cairn_inner_distance_result r = cairn_inner_distance_read(((measuring *)context)->inner);
    uint64_t hash = test_hash(TEST_HASH_START, &r.max_distance, sizeof r.max_distance);

    for (int32_t i = 0; i < r.count; i++)
        hash = test_hash(hash, &r.distance[i * r.stride], (size_t)r.count * sizeof *r.distance);
    return hash;
}

static cairn_status begin_star(void *context)
{
    cairn_vec2 p[60], hole[10];
    cairn_curve shape[2] = {star(p, 60, 3, 2, 0), star(hole, 10, 4, 0.3, 0)};

    return cairn_inner_distance_begin(((measuring *)context)->inner, shape, 2);
}

static cairn_status step(void *context, cairn_budget *budget)
{
    return cairn_inner_distance_step(((measuring *)context)->inner, budget);
}

static void budgets_do_not_matter(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    measuring m = new_measuring(ITEM_COUNT, 0);
    test_stepped object = {begin_star, step, hash_of, &m};
    cairn_budget all = {INT32_MAX}, none = {0};
    uint64_t hash;

    (void)state;
    assert_ok(begin_star(&m));
    assert_status(step(&m, &none), CAIRN_MORE);
    assert_int_equal(cairn_inner_distance_read(m.inner).count, 0);
    assert_ok(step(&m, &all));
    hash = hash_of(&m);
    assert_golden(test_hash(hash, &all.left, sizeof all.left), UINT64_C(0x3622e46ab42c1020),
                  UINT64_C(0xf31f7e1cdcd26250));
    for (int i = 0; i < 3; i++) {
        int64_t used = 0;
        cairn_status status;

        assert_ok(begin_star(&m));
        do {
            cairn_budget budget = {budgets[i]};

            status = step(&m, &budget);
            used += budgets[i] - budget.left;
        } while (status == CAIRN_MORE);
        assert_ok(status);
        assert_int_equal(used, INT32_MAX - all.left);
        assert_true(hash_of(&m) == hash);
    }
    test_begins_anew(&object, 7);
    test_pool_free(&m.pool);
}

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_inner_distance *inner;

    return cairn_inner_distance_create(&inner, pool, context);
}

static void refusals(void **state)
{
    cairn_inner_distance_params good = {.max_points = 12, .fill_holes = 0};
    measuring m = new_measuring(12, 0);
    cairn_vec2 p[13], hole[4] = {at(29, 19), at(31, 19), at(31, 21), at(29, 21)};
    cairn_curve shape[2] = {star(p, 8, 1, 1, 0), closed(hole, 4)}, kept[2];
    cairn_budget budget = {10};
    uint64_t hash;

    (void)state;
    assert_ok(cairn_inner_distance_step(m.inner, &budget));
    (void)measure(&m, shape, 2);
    hash = hash_of(&m);
    memcpy(kept, shape, sizeof kept);
    assert_status(cairn_inner_distance_begin(NULL, shape, 2), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_inner_distance_begin(m.inner, NULL, 2), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_inner_distance_begin(m.inner, shape, 0), CAIRN_BAD_ARGUMENT);
    for (int i = 0; i < 2; i++) {
        shape[i].points = NULL;
        assert_status(cairn_inner_distance_begin(m.inner, shape, 2), CAIRN_BAD_ARGUMENT);
        memcpy(shape, kept, sizeof kept);
        shape[i].count = 2;
        assert_status(cairn_inner_distance_begin(m.inner, shape, 2), CAIRN_BAD_ARGUMENT);
        memcpy(shape, kept, sizeof kept);
        shape[i].closed = 0;
        assert_status(cairn_inner_distance_begin(m.inner, shape, 2), CAIRN_BAD_ARGUMENT);
        memcpy(shape, kept, sizeof kept);
    }
    shape[0] = star(p, 9, 1, 1, 0);
    assert_status(cairn_inner_distance_begin(m.inner, shape, 2), CAIRN_FULL);
    shape[0] = star(p, 8, 1, 1, 0);
    p[2].x = (cairn_real)NAN;
    assert_status(cairn_inner_distance_begin(m.inner, shape, 2), CAIRN_NOT_FINITE);
    p[2] = at(0, 0);
    p[5].y = (cairn_real)INFINITY;
    assert_status(cairn_inner_distance_begin(m.inner, shape, 2), CAIRN_NOT_FINITE);
    p[5].y = NUMBER((cairn_real)1e200, (cairn_real)1e30);
    assert_status(cairn_inner_distance_begin(m.inner, shape, 2), CAIRN_NOT_FINITE);
    shape[0] = star(p, 8, 1, 1, 0);
    hole[2] = hole[3] = hole[0];
    assert_status(cairn_inner_distance_begin(m.inner, shape, 2), CAIRN_EMPTY);
    assert_true(hash_of(&m) == hash);
    assert_status(cairn_inner_distance_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_inner_distance_step(m.inner, NULL), CAIRN_BAD_ARGUMENT);
    assert_int_equal(cairn_inner_distance_read(NULL).count, 0);
    assert_status(cairn_inner_distance_create(NULL, &m.pool, &good), CAIRN_BAD_ARGUMENT);
    test_every_pool_size(create, &good, cairn_inner_distance_memory(&good));
    test_pool_free(&m.pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(spirals_and_stars),      cmocka_unit_test(ways_lead_round_holes),
        cmocka_unit_test(notches_are_gone_round), cmocka_unit_test(crossed_outlines_stay_finite),
        cmocka_unit_test(budgets_do_not_matter),  cmocka_unit_test(refusals),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
