/* Even samples and tangents of polylines, compared with a reference implementation. */
#include "tests/test.h"

#include <math.h>

#include "cairn/curve.h"

enum { ITEM_COUNT = 60, SAMPLES = 97 };

static const double tolerance = NUMBER(1e-11, 1e-4);

static cairn_curve curve_of(const cairn_vec2 *points, int32_t count, int32_t closed)
{
    cairn_curve curve = {points, count, closed};

    return curve;
}

/* A random walk; every seventh vertex twice. */
static void walk(cairn_vec2 *points, int32_t count, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 0);

    for (int32_t i = 0; i < count; i++) {
        points[i].x = cairn_random_uniform(&random, -5, 5);
        points[i].y = cairn_random_uniform(&random, -5, 5);
        if (i % 7 == 6)
            points[i] = points[i - 1];
    }
}

/* ---- Reference implementation: from the start for every sample ---- */

static double side_length(const cairn_curve *c, int32_t i)
{
    const cairn_vec2 *a = &c->points[i], *b = &c->points[(i + 1) % c->count];

    return hypot((double)b->x - (double)a->x, (double)b->y - (double)a->y);
}

static double slow_length(const cairn_curve *c)
{
    double length = 0;

    for (int32_t i = 0; i < c->count - !c->closed; i++)
        length += side_length(c, i);
    return length;
}

static void slow_sample(const cairn_curve *c, double place, double *x, double *y, int32_t *side)
{
    int32_t i = 0;

    while (i + 1 < c->count - !c->closed && place > side_length(c, i))
        place -= side_length(c, i++);
    *side = i;
    place = side_length(c, i) > 0 ? place / side_length(c, i) : 0;
    *x = (double)c->points[i].x +
         place * ((double)c->points[(i + 1) % c->count].x - (double)c->points[i].x);
    *y = (double)c->points[i].y +
         place * ((double)c->points[(i + 1) % c->count].y - (double)c->points[i].y);
}

static void samples_are_even(void **state)
{
    (void)state;
    for (uint64_t seed = 0; seed < 40; seed++) {
        cairn_vec2 points[ITEM_COUNT], samples[SAMPLES], directions[SAMPLES], again[SAMPLES];
        int32_t closed = seed % 2 == 1;
        cairn_curve c = curve_of(points, (int32_t)(3 + seed), closed);
        int32_t count = seed < 20 ? 5 : SAMPLES;

        walk(points, c.count, seed);
        assert_near(cairn_curve_length(&c), slow_length(&c), tolerance);
        assert_ok(cairn_curve_resample(&c, samples, directions, count));
        for (int32_t i = 0; i < count; i++) {
            double x, y, dx, dy;
            int32_t side;

            slow_sample(&c, slow_length(&c) * i / (closed ? count : count - 1), &x, &y, &side);
            assert_near(samples[i].x, x, tolerance);
            assert_near(samples[i].y, y, tolerance);
            assert_near(cairn_vec2_norm(directions[i]), 1, NUMBER(1e-12, 1e-6));
            if (i == 0 || i == count - 1)
                continue;
            dx = (double)c.points[(side + 1) % c.count].x - (double)c.points[side].x;
            dy = (double)c.points[(side + 1) % c.count].y - (double)c.points[side].y;
            assert_near(directions[i].x, dx / hypot(dx, dy), tolerance);
            assert_near(directions[i].y, dy / hypot(dx, dy), tolerance);
        }
        assert_ok(cairn_curve_resample(&c, again, NULL, count));
        assert_memory_equal(again, samples, (size_t)count * sizeof *samples);
    }
}

/* A square with corners on samples, its first and last vertices doubled. */
static void corners_take_the_side_behind(void **state)
{
    static const cairn_vec2 square[] = {{0, 0}, {0, 0}, {2, 0}, {2, 2}, {0, 2}, {0, 2}};
    static const double x[] = {0, 1, 2, 2, 2, 1, 0, 0}, y[] = {0, 0, 0, 1, 2, 2, 2, 1};
    static const double dx[] = {1, 1, 0, 0, -1, -1, 0, 0}, dy[] = {0, 0, 1, 1, 0, 0, -1, -1};
    cairn_curve closed = curve_of(square, 6, 1), open = curve_of(square, 6, 0);
    cairn_vec2 samples[8], directions[8];

    (void)state;
    assert_ok(cairn_curve_resample(&closed, samples, directions, 8));
    for (int k = 0; k < 8; k++) {
        assert_near(samples[k].x, x[k], 0);
        assert_near(samples[k].y, y[k], 0);
        assert_near(directions[k].x, dx[k], 0);
        assert_near(directions[k].y, dy[k], 0);
    }
    assert_ok(cairn_curve_resample(&open, samples, directions, 7));
    for (int k = 0; k < 7; k++) {
        assert_near(samples[k].x, x[k], 0);
        assert_near(samples[k].y, y[k], 0);
        /* The last vertex doubled: the direction stays that of the side before. */
        assert_near(directions[k].x, k == 6 ? -1 : dx[k], 0);
        assert_near(directions[k].y, k == 6 ? 0 : dy[k], 0);
    }
    assert_ok(cairn_curve_resample(&closed, samples, directions, 1));
    assert_near(samples[0].x, 0, 0);
    assert_near(directions[0].x, 1, 0);
    assert_near(cairn_curve_length(&open), 6, 0);
    assert_near(cairn_curve_length(&closed), 8, 0);
}

static void tangents_reach_over_vertices(void **state)
{
    (void)state;
    for (int32_t reach = 1; reach < 8; reach++) {
        cairn_vec2 points[ITEM_COUNT], directions[ITEM_COUNT];

        walk(points, ITEM_COUNT, (uint64_t)reach);
        for (int32_t closed = 0; closed < 2; closed++) {
            cairn_curve c = curve_of(points, 17, closed);

            assert_ok(cairn_curve_tangents(&c, reach, directions));
            for (int32_t i = 0; i < c.count; i++) {
                int32_t low = i - reach, high = i + reach;
                double x, y;

                low = closed ? (low + c.count) % c.count : low < 0 ? 0 : low;
                high = closed ? high % c.count : high >= c.count ? c.count - 1 : high;
                x = (double)points[high].x - (double)points[low].x;
                y = (double)points[high].y - (double)points[low].y;
                if (x == 0 && y == 0)
                    continue;
                assert_near(directions[i].x, x / hypot(x, y), tolerance);
                assert_near(directions[i].y, y / hypot(x, y), tolerance);
            }
        }
    }
}

static void where_vertices_coincide_the_last_tangent_stays(void **state)
{
    static const cairn_vec2 points[] = {{1, 1}, {1, 1}, {1, 3}, {1, 1}, {4, 1}};
    static const double x[] = {1, 0, 0, 1, 1}, y[] = {0, 1, 1, 0, 0};
    cairn_curve c = curve_of(points, 5, 0);
    cairn_vec2 directions[5];

    (void)state;
    assert_ok(cairn_curve_tangents(&c, 1, directions));
    for (int k = 0; k < 5; k++) {
        if (k == 3)
            continue;
        assert_near(directions[k].x, x[k], 0);
        assert_near(directions[k].y, y[k], 0);
    }
    assert_near(directions[3].x, 3 / sqrt(13), NUMBER(1e-12, 1e-6));
    assert_near(directions[3].y, -2 / sqrt(13), NUMBER(1e-12, 1e-6));
}

static void bad_input_is_refused(void **state)
{
    cairn_vec2 points[4] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}}, bad[4], same[2] = {{3, 3}, {3, 3}},
               out[8];
    cairn_curve c = curve_of(points, 4, 1), open = curve_of(points, 4, 0),
                broken = curve_of(bad, 4, 0);
    cairn_curve none = curve_of(NULL, 4, 0), empty = curve_of(points, 0, 1),
                point = curve_of(same, 2, 0);
    cairn_curve one = curve_of(points, 1, 0);

    (void)state;
    assert_status(cairn_curve_resample(NULL, out, NULL, 2), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_curve_resample(&none, out, NULL, 2), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_curve_resample(&empty, out, NULL, 2), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_curve_resample(&c, NULL, NULL, 2), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_curve_resample(&c, out, NULL, 0), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_curve_resample(&open, out, NULL, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_curve_resample(&c, out, NULL, (1 << 24) + 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_curve_resample(&point, out, NULL, 2), CAIRN_EMPTY);
    point.closed = 1;
    assert_status(cairn_curve_resample(&point, out, NULL, 2), CAIRN_EMPTY);
    assert_status(cairn_curve_resample(&one, out, NULL, 2), CAIRN_EMPTY);
    assert_status(cairn_curve_tangents(NULL, 1, out), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_curve_tangents(&c, 1, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_curve_tangents(&c, 0, out), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_curve_tangents(&c, 2, out), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_curve_tangents(&open, 3, out));
    assert_status(cairn_curve_tangents(&open, 4, out), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_curve_tangents(&one, 1, out), CAIRN_BAD_ARGUMENT);
    for (int k = 0; k < 4; k++) {
        memcpy(bad, points, sizeof bad);
        *(k % 2 ? &bad[k].x : &bad[k].y) = (cairn_real)(k < 2 ? (double)NAN : (double)INFINITY);
        assert_status(cairn_curve_resample(&broken, out, NULL, 2), CAIRN_NOT_FINITE);
        assert_status(cairn_curve_tangents(&broken, 1, out), CAIRN_NOT_FINITE);
    }
    memcpy(bad, points, sizeof bad);
    bad[0].x = -CAIRN_REAL_MAX;
    bad[1].x = CAIRN_REAL_MAX;
    assert_status(cairn_curve_resample(&broken, out, NULL, 2), CAIRN_NOT_FINITE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(samples_are_even),
        cmocka_unit_test(corners_take_the_side_behind),
        cmocka_unit_test(tangents_reach_over_vertices),
        cmocka_unit_test(where_vertices_coincide_the_last_tangent_stays),
        cmocka_unit_test(bad_input_is_refused),
    };
    return cmocka_run_group_tests_name("curve", tests, NULL, NULL);
}
