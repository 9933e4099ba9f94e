/* Detection curves: small cases by hand, many compared with a reference implementation. */
#include "tests/test.h"

#include <math.h>

#include "cairn/detection_curve.h"
#include "cairn/random.h"

enum { MAX_COUNT = 60 };
static const double ROUNDING = NUMBER(1e-15, 1e-6);

static void curves_by_hand(void **state)
{
    cairn_detection_curve_event e[] = {{1, 0}, {5, 1}, {3, 1}, {3, 0}, {4, 0}};
    cairn_detection_curve_point p[5];

    (void)state;
    assert_ok(cairn_detection_curve(e, 5, 2, 4, p, NULL));
    /* 5 hit; 4 false; 3 false before 3 hit; 1 false. */
    assert_near(p[0].recall, 0.25, 0);
    assert_near(p[0].precision, 1, 0);
    assert_near(p[2].recall, 0.25, 0);
    assert_near(p[2].precision, 1.0 / 3, ROUNDING);
    assert_near(p[2].score, 3, 0);
    assert_near(p[3].recall, 0.5, 0);
    assert_near(p[4].false_per_image, 1.5, 0);
    assert_near(cairn_detection_curve_rate_at(p, 5, CAIRN_REAL(0.5)), 0.25, 0);
    assert_near(cairn_detection_curve_rate_at(p, 5, 1), 0.5, 0);
    assert_near(cairn_detection_curve_rate_at(p, 0, 1), 0, 0);
    assert_near(cairn_detection_curve_precision_at(p, 5, CAIRN_REAL(0.5)), 0.5, 0);
    assert_near(cairn_detection_curve_precision_at(p, 5, CAIRN_REAL(0.51)), 0, 0);
    /* 1 at recalls 0, 0.1, 0.2; 0.5 at 0.3, 0.4, 0.5. */
    assert_near(cairn_detection_curve_average_precision(p, 5), 4.5 / 11, ROUNDING);
    assert_near(cairn_detection_curve_average_precision(p, 0), 0, 0);
}

static void shares_of_boxes(void **state)
{
    static const cairn_real objects[3][4] = {{0, 0, 10, 10}, {0, 0, 10, 8}, {20, 0, 30, 10}};
    static const cairn_real box[4] = {0, 0, 10, 9}, off[4] = {40, 40, 50, 50};
    static const cairn_real point[4] = {3, 3, 3, 3};
    int32_t taken[3] = {0, 0, 0};
    cairn_real share;

    (void)state;
    assert_near(cairn_detection_curve_overlap(objects[0], objects[1]), 0.8, ROUNDING);
    assert_near(cairn_detection_curve_overlap(objects[0], objects[2]), 0, 0);
    assert_near(cairn_detection_curve_overlap(point, point), 0, 0);
    assert_int_equal(cairn_detection_curve_object(objects, taken, 3, box, &share), 0);
    assert_near(share, 0.9, ROUNDING);
    taken[0] = 1;
    assert_int_equal(cairn_detection_curve_object(objects, taken, 3, box, &share), 1);
    assert_int_equal(cairn_detection_curve_object(objects, taken, 3, off, &share), -1);
    assert_near(share, 0, 0);
}

/* Counted anew for every score. */
static void agrees_with_the_reference_implementation(void **state)
{
    cairn_random random = cairn_random_seed(3, 1);

    (void)state;
    for (int32_t round = 0; round < 50; round++) {
        cairn_detection_curve_event e[MAX_COUNT];
        cairn_detection_curve_point p[MAX_COUNT];
        int32_t count = 1 + cairn_random_below(&random, MAX_COUNT), hits = 0;

        for (int32_t i = 0; i < count; i++) {
            e[i].score = (cairn_real)(i + cairn_random_below(&random, 2 * MAX_COUNT));
            e[i].hit = cairn_random_below(&random, 2);
            hits += e[i].hit;
        }
        assert_ok(cairn_detection_curve(e, count, 7, hits + 1, p, NULL));
        for (int32_t i = 0; i < count; i++) {
            int32_t above = 0, right = 0;

            /* The last of its score: all detections of the same score count. */
            if (i + 1 < count && p[i + 1].score == p[i].score)
                continue;
            for (int32_t k = 0; k < count; k++) {
                above += e[k].score >= p[i].score;
                right += e[k].score >= p[i].score && e[k].hit;
            }
            assert_near(p[i].recall, (double)right / (hits + 1), ROUNDING);
            assert_near(p[i].precision, (double)right / above, ROUNDING);
            assert_near(p[i].false_per_image, (above - right) / 7.0, ROUNDING);
            assert_int_equal(p[i].detections, above);
        }
    }
}

/* The interval's ends are where the share is 1.96 sigmas off. */
static void intervals(void **state)
{
    const double tolerance = NUMBER(1e-12, 1e-5);
    cairn_real low, high;

    (void)state;
    for (int32_t n = 1; n < 100; n += 7)
        for (int32_t k = 0; k <= n; k++) {
            double share = (double)k / n, a, b;

            cairn_detection_curve_interval((cairn_real)share, n, &low, &high);
            a = (double)low;
            b = (double)high;
            assert_true(a >= 0 && a <= share + tolerance && b >= share - tolerance && b <= 1);
            assert_near((share - b) * (share - b), 1.96 * 1.96 * b * (1 - b) / n, tolerance);
            assert_near((share - a) * (share - a), 1.96 * 1.96 * a * (1 - a) / n, tolerance);
        }
}

static void refuses_bad_events(void **state)
{
    static const cairn_detection_curve_event good[] = {{1, 0}, {3, 1}};
    cairn_detection_curve_event e[2];
    cairn_detection_curve_point p[2];
    cairn_fault fault;

    (void)state;
    for (int k = 0; k < 3; k++) {
        memcpy(e, good, sizeof e);
        e[1].score = (cairn_real)(k == 0 ? NAN : k == 1 ? INFINITY : -INFINITY);
        assert_fault(&fault, cairn_detection_curve(e, 2, 2, 4, p, &fault), CAIRN_NOT_FINITE, 1);
        assert_near(e[0].score, 1, 0); /* not sorted */
    }
    memcpy(e, good, sizeof e);
    e[0].hit = 2;
    assert_fault(&fault, cairn_detection_curve(e, 2, 2, 4, p, &fault), CAIRN_BAD_ARGUMENT, 0);
    memcpy(e, good, sizeof e);
    assert_status(cairn_detection_curve(e, -1, 2, 4, p, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_detection_curve(e, 2, -1, 4, p, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_detection_curve(e, 2, 2, -1, p, NULL), CAIRN_BAD_ARGUMENT);
    assert_fault(&fault, cairn_detection_curve(NULL, 2, 2, 4, p, &fault), CAIRN_BAD_ARGUMENT, -1);
    assert_status(cairn_detection_curve(e, 2, 2, 4, NULL, NULL), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_detection_curve(NULL, 0, 2, 4, NULL, NULL));
}

/* Ties of every length, and lists of every length. */
static void sorts_many_events(void **state)
{
    cairn_random random = cairn_random_seed(9, 2);

    (void)state;
    for (int32_t count = 1; count <= MAX_COUNT; count++) {
        cairn_detection_curve_event e[MAX_COUNT];
        cairn_detection_curve_point p[MAX_COUNT];
        int32_t hits = 0, left = 0;

        for (int32_t i = 0; i < count; i++) {
            e[i].score = (cairn_real)cairn_random_below(&random, 1 + count / 3);
            e[i].hit = cairn_random_below(&random, 2);
            hits += e[i].hit;
        }
        assert_ok(cairn_detection_curve(e, count, 1, 1, p, NULL));
        for (int32_t i = 0; i < count; i++) {
            left += e[i].hit;
            if (i > 0)
                assert_true(e[i - 1].score > e[i].score ||
                            (e[i - 1].score == e[i].score && e[i - 1].hit <= e[i].hit));
            assert_near(p[i].score, e[i].score, 0);
        }
        assert_int_equal(left, hits);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(curves_by_hand),
        cmocka_unit_test(shares_of_boxes),
        cmocka_unit_test(agrees_with_the_reference_implementation),
        cmocka_unit_test(intervals),
        cmocka_unit_test(refuses_bad_events),
        cmocka_unit_test(sorts_many_events),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
