/* Line regression by definition and by search; merging of segments. */
#include "tests/test.h"

#include <math.h>

#include "cairn/line.h"

#define COUNT 40
#define PI    3.14159265358979323846

/* Weighted sum of squared distances to the line through `mean` at `angle`. */
static double cost(const cairn_vec2 *points, const cairn_real *weights, int count, cairn_vec2 mean,
                   double angle)
{
    double sum = 0;

    for (int i = 0; i < count; i++) {
        double across = (double)(points[i].y - mean.y) * cos(angle) -
                        (double)(points[i].x - mean.x) * sin(angle);

        sum += (double)weights[i] * across * across;
    }
    return sum;
}

/* The reference implementation: the mean by definition, the angle by search. */
static void fit_against_search(double angle, double offset, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 1);
    cairn_vec2 points[COUNT];
    cairn_real weights[COUNT];
    double x = 0, y = 0, mass = 0, best = 0, least = 1e300, low = 1e300, high = -1e300;
    cairn_line line;

    for (int i = 0; i < COUNT; i++) {
        double t = (double)cairn_random_uniform(&random, -3, 5);
        double d = 0.05 * (double)cairn_random_normal(&random);

        points[i].x = (cairn_real)(offset + t * cos(angle) - d * sin(angle));
        points[i].y = (cairn_real)(t * sin(angle) + d * cos(angle));
        weights[i] = i % 7 == 3 ? 0 : cairn_random_uniform(&random, CAIRN_REAL(0.2), 2);
        mass += (double)weights[i];
        x += (double)(weights[i] * points[i].x);
        y += (double)(weights[i] * points[i].y);
    }
    assert_ok(cairn_line_fit(points, weights, COUNT, &line));
    assert_near(line.mass, mass, NUMBER(1e-12, 1e-4));
    assert_near(line.mean.x, x / mass, NUMBER(1e-12, 1e-4));
    assert_near(line.mean.y, y / mass, NUMBER(1e-12, 1e-4));
    for (int i = 0; i <= 200000; i++) {
        double a = -PI / 2 + PI * i / 200000, c = cost(points, weights, COUNT, line.mean, a);

        if (c < least) {
            least = c;
            best = a;
        }
    }
    assert_near(fabs((double)line.direction.x * sin(best) - (double)line.direction.y * cos(best)),
                0, 1e-4);
    assert_near(line.rms, sqrt(least / mass), 1e-5);
    assert_near(cairn_vec2_norm(line.direction), 1, NUMBER(1e-14, 1e-6));
    assert_true(line.direction.x > 0 || (line.direction.x >= 0 && line.direction.y > 0));
    for (int i = 0; i < COUNT; i++) {
        double along = (double)cairn_vec2_dot(line.direction, cairn_vec2_sub(points[i], line.mean));

        if (weights[i] > 0) {
            low = fmin(low, along);
            high = fmax(high, along);
        }
    }
    assert_near(line.low, low, NUMBER(1e-12, 1e-5));
    assert_near(line.high, high, NUMBER(1e-12, 1e-5));
    {
        cairn_segment segment = cairn_line_segment(&line);

        assert_near(segment.a.x, (double)line.mean.x + low * (double)line.direction.x,
                    NUMBER(1e-12, 1e-4));
        assert_near(segment.a.y, (double)line.mean.y + low * (double)line.direction.y,
                    NUMBER(1e-12, 1e-4));
        assert_near(segment.b.x, (double)line.mean.x + high * (double)line.direction.x,
                    NUMBER(1e-12, 1e-4));
        assert_near(segment.b.y, (double)line.mean.y + high * (double)line.direction.y,
                    NUMBER(1e-12, 1e-4));
    }
}

static void test_fit(void **state)
{
    (void)state;
    for (int i = 0; i < 12; i++)
        fit_against_search(0.55 * i, i % 3, (uint64_t)i);
}

static void test_fit_without_weights(void **state)
{
    cairn_vec2 points[4] = {{0, 0}, {1, 1}, {2, 0}, {3, 1}};
    cairn_real ones[4] = {1, 1, 1, 1};
    cairn_line a, b;

    (void)state;
    assert_ok(cairn_line_fit(points, NULL, 4, &a));
    assert_ok(cairn_line_fit(points, ones, 4, &b));
    assert_memory_equal(&a, &b, sizeof a);
    assert_near(a.mass, 4, 0);
    /* A vertical line runs upwards. */
    points[0].x = points[1].x = 2;
    points[1].y = -3;
    assert_ok(cairn_line_fit(points, NULL, 2, &a));
    assert_near(a.direction.x, 0, 0);
    assert_near(a.direction.y, 1, 0);
    assert_near(a.high - a.low, 3, NUMBER(1e-15, 1e-6));
}

/* The digits of a small figure must not be lost in a large offset. */
static void test_fit_far_away(void **state)
{
    cairn_vec2 points[30];
    cairn_line line;

    (void)state;
    for (int i = 0; i < 30; i++) {
        points[i].x = 4096 + (cairn_real)i / 16;
        points[i].y = 2048 + (cairn_real)i / 32;
    }
    assert_ok(cairn_line_fit(points, NULL, 30, &line));
    assert_near(line.direction.y / line.direction.x, 0.5, NUMBER(1e-12, 1e-5));
    assert_near(line.rms, 0, NUMBER(1e-9, 1e-4));
    /* Nor in a point of zero weight. */
    {
        cairn_real weights[30];

        for (int i = 0; i < 30; i++) {
            weights[i] = i == 0 ? 0 : 1;
            points[i].x = (cairn_real)i;
            points[i].y = 1;
        }
        points[0].x = NUMBER(1e12, 1e8f);
        points[0].y = -points[0].x;
        assert_ok(cairn_line_fit(points, weights, 30, &line));
        assert_near(line.mean.x, 15, 0);
        assert_near(line.mean.y, 1, 0);
        assert_near(line.rms, 0, 0);
    }
}

static void test_fit_statuses(void **state)
{
    cairn_vec2 points[3] = {{1, 1}, {1, 1}, {2, 1}};
    cairn_real weights[3] = {1, 1, 0};
    cairn_line line = {{7, 7}, {7, 7}, 7, 7, 7, 7}, before = line;

    (void)state;
    assert_status(cairn_line_fit(NULL, NULL, 3, &line), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_line_fit(points, NULL, 3, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_line_fit(points, NULL, 1, &line), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_line_fit(points, NULL, 2, &line), CAIRN_EMPTY);
    assert_status(cairn_line_fit(points, weights, 3, &line), CAIRN_EMPTY);
    weights[0] = weights[1] = 0;
    assert_status(cairn_line_fit(points, weights, 3, &line), CAIRN_EMPTY);
    weights[1] = -1;
    assert_status(cairn_line_fit(points, weights, 3, &line), CAIRN_BAD_ARGUMENT);
    weights[1] = (cairn_real)NAN;
    assert_status(cairn_line_fit(points, weights, 3, &line), CAIRN_NOT_FINITE);
    points[2].x = (cairn_real)INFINITY;
    assert_status(cairn_line_fit(points, NULL, 3, &line), CAIRN_NOT_FINITE);
    points[2].x = 2;
    points[0].y = (cairn_real)NAN;
    assert_status(cairn_line_fit(points, NULL, 3, &line), CAIRN_NOT_FINITE);
    assert_memory_equal(&line, &before, sizeof line);
}

/* Reference implementation: the regression of many points on both segments. */
static void merge_against_points(cairn_segment a, double mass_a, cairn_segment b, double mass_b)
{
    enum { HALF = 4000 };
    static cairn_vec2 points[2 * HALF];
    static cairn_real weights[2 * HALF];
    cairn_segment merged, heavy = mass_b > mass_a ? b : a;
    cairn_line line;
    cairn_vec2 ends[4];
    double low = 1e300, high = -1e300, sense;

    for (int i = 0; i < HALF; i++) {
        cairn_real t = ((cairn_real)i + CAIRN_REAL(0.5)) / HALF;

        points[i] = cairn_vec2_add(a.a, cairn_vec2_scale(cairn_vec2_sub(a.b, a.a), t));
        points[HALF + i] = cairn_vec2_add(b.a, cairn_vec2_scale(cairn_vec2_sub(b.b, b.a), t));
        weights[i] = (cairn_real)mass_a;
        weights[HALF + i] = (cairn_real)mass_b;
    }
    assert_ok(cairn_line_merge(a, (cairn_real)mass_a, b, (cairn_real)mass_b, &merged));
    assert_ok(cairn_line_fit(points, weights, 2 * HALF, &line));
    sense = cairn_vec2_dot(line.direction, cairn_vec2_sub(heavy.b, heavy.a)) < 0 ? -1 : 1;
    ends[0] = a.a;
    ends[1] = a.b;
    ends[2] = b.a;
    ends[3] = b.b;
    for (int i = 0; i < 4; i++) {
        double along =
            sense * (double)cairn_vec2_dot(line.direction, cairn_vec2_sub(ends[i], line.mean));

        low = fmin(low, along);
        high = fmax(high, along);
    }
    assert_near(merged.a.x, (double)line.mean.x + low * sense * (double)line.direction.x, 2e-3);
    assert_near(merged.a.y, (double)line.mean.y + low * sense * (double)line.direction.y, 2e-3);
    assert_near(merged.b.x, (double)line.mean.x + high * sense * (double)line.direction.x, 2e-3);
    assert_near(merged.b.y, (double)line.mean.y + high * sense * (double)line.direction.y, 2e-3);
}

static void test_merge(void **state)
{
    cairn_segment a = {{0, 0}, {2, CAIRN_REAL(0.1)}},
                  b = {{3, CAIRN_REAL(0.1)}, {5, CAIRN_REAL(0.4)}};
    cairn_segment back = {{5, CAIRN_REAL(0.4)}, {CAIRN_REAL(1.5), CAIRN_REAL(0.2)}};
    cairn_segment upright = {{10, 3}, {10, -2}}, above = {{CAIRN_REAL(10.2), 4}, {10, 6}};

    (void)state;
    merge_against_points(a, 1, b, 1);
    merge_against_points(a, 1, b, 3);
    merge_against_points(a, 2, back, 1);
    merge_against_points(a, 1, back, 2);
    merge_against_points(upright, 5, above, 1);
    merge_against_points(above, 5, upright, 1);
}

/* By hand: collinear segments; the first one's sense among equal masses; two parallel segments at a
 * distance d, whose scatter along is 2 * 4/12 and across d^2/2. */
static void test_merge_known(void **state)
{
    cairn_segment a = {{0, 0}, {2, 0}}, b = {{5, 0}, {3, 0}}, above = {{0, 0}, {2, 0}}, merged;

    (void)state;
    assert_ok(cairn_line_merge(a, 1, b, 1, &merged));
    assert_near(merged.a.x, 0, 1e-6);
    assert_near(merged.b.x, 5, 1e-6);
    assert_ok(cairn_line_merge(a, 1, b, 3, &merged));
    assert_near(merged.a.x, 5, 1e-6);
    assert_near(merged.b.x, 0, 1e-6);
    assert_near(merged.a.y, 0, 1e-6);
    for (int k = 0; k < 2; k++) {
        cairn_real d = k ? CAIRN_REAL(1.18) : CAIRN_REAL(1.13);

        above.a.y = above.b.y = d;
        assert_ok(cairn_line_merge(a, 1, above, 1, &merged));
        assert_near(cairn_abs(merged.b.x - merged.a.x), k ? 0 : 2, 1e-6);
        assert_near(cairn_abs(merged.b.y - merged.a.y), k ? d : 0, 1e-6);
        assert_near(merged.a.y + merged.b.y, d, 1e-6);
    }
}

static void test_merge_statuses(void **state)
{
    cairn_segment a = {{0, 0}, {1, 0}}, point = {{3, 3}, {3, 3}},
                  bad = {{0, 0}, {(cairn_real)NAN, 0}}, merged = a;

    (void)state;
    assert_status(cairn_line_merge(a, 1, a, 1, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_line_merge(a, 0, a, 1, &merged), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_line_merge(a, 1, a, 0, &merged), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_line_merge(a, 1, a, (cairn_real)NAN, &merged), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_line_merge(a, 1, bad, 1, &merged), CAIRN_NOT_FINITE);
    assert_status(cairn_line_merge(bad, 1, a, 1, &merged), CAIRN_NOT_FINITE);
    assert_status(cairn_line_merge(a, 1, a, (cairn_real)INFINITY, &merged), CAIRN_NOT_FINITE);
    assert_status(cairn_line_merge(point, 1, point, 1, &merged), CAIRN_EMPTY);
    assert_memory_equal(&merged, &a, sizeof a);
    assert_ok(cairn_line_merge(a, 1, point, 1, &merged));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_fit),
        cmocka_unit_test(test_fit_without_weights),
        cmocka_unit_test(test_fit_far_away),
        cmocka_unit_test(test_fit_statuses),
        cmocka_unit_test(test_merge),
        cmocka_unit_test(test_merge_known),
        cmocka_unit_test(test_merge_statuses),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
