/* Detection curves: small cases by hand, many compared with a reference implementation, files. */
#include "tests/test.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "cairn/detection_curve.h"
#include "cairn/random.h"
#include "tests/files.h"
#include "tests/xml.h"

enum { MAX_COUNT = 60 };

static void curves_by_hand(void **state)
{
    cairn_detection_curve_event e[] = {{1, 0}, {5, 1}, {3, 1}, {3, 0}, {4, 0}};
    cairn_detection_curve_point p[5];

    (void)state;
    cairn_detection_curve(e, 5, 2, 4, p);
    /* 5 hit; 4 false; 3 false before 3 hit; 1 false. */
    assert_near(p[0].recall, 0.25, 0);
    assert_near(p[0].precision, 1, 0);
    assert_near(p[2].recall, 0.25, 0);
    assert_near(p[2].precision, 1.0 / 3, 1e-15);
    assert_near(p[2].score, 3, 0);
    assert_near(p[3].recall, 0.5, 0);
    assert_near(p[4].false_per_image, 1.5, 0);
    assert_near(cairn_detection_curve_rate_at(p, 5, 0.5), 0.25, 0);
    assert_near(cairn_detection_curve_rate_at(p, 5, 1), 0.5, 0);
    assert_near(cairn_detection_curve_rate_at(p, 0, 1), 0, 0);
    assert_near(cairn_detection_curve_precision_at(p, 5, 0.5), 0.5, 0);
    assert_near(cairn_detection_curve_precision_at(p, 5, 0.51), 0, 0);
    /* 1 at recalls 0, 0.1, 0.2; 0.5 at 0.3, 0.4, 0.5. */
    assert_near(cairn_detection_curve_average_precision(p, 5), 4.5 / 11, 1e-15);
    assert_near(cairn_detection_curve_average_precision(p, 0), 0, 0);
}

static void shares_of_boxes(void **state)
{
    static const double objects[3][4] = {{0, 0, 10, 10}, {0, 0, 10, 8}, {20, 0, 30, 10}};
    static const double box[4] = {0, 0, 10, 9}, off[4] = {40, 40, 50, 50};
    int32_t taken[3] = {0, 0, 0};
    double share;

    (void)state;
    assert_near(cairn_detection_curve_overlap(objects[0], objects[1]), 0.8, 1e-15);
    assert_near(cairn_detection_curve_overlap(objects[0], objects[2]), 0, 0);
    assert_int_equal(cairn_detection_curve_object(objects, taken, 3, box, &share), 0);
    assert_near(share, 0.9, 1e-15);
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
            e[i].score = i + 0.5 * cairn_random_below(&random, 2 * MAX_COUNT) * 2;
            e[i].hit = cairn_random_below(&random, 2);
            hits += e[i].hit;
        }
        cairn_detection_curve(e, count, 7, hits + 1, p);
        for (int32_t i = 0; i < count; i++) {
            int32_t above = 0, right = 0;

            /* The last of its score: all detections of the same score count. */
            if (i + 1 < count && p[i + 1].score == p[i].score)
                continue;
            for (int32_t k = 0; k < count; k++) {
                above += e[k].score >= p[i].score;
                right += e[k].score >= p[i].score && e[k].hit;
            }
            assert_near(p[i].recall, (double)right / (hits + 1), 1e-15);
            assert_near(p[i].precision, (double)right / above, 1e-15);
            assert_near(p[i].false_per_image, (above - right) / 7.0, 1e-15);
            assert_int_equal(p[i].detections, above);
        }
    }
}

/* The interval's ends are where the share is 1.96 sigmas off. */
static void intervals(void **state)
{
    double low, high;

    (void)state;
    for (int32_t n = 1; n < 100; n += 7)
        for (int32_t k = 0; k <= n; k++) {
            double share = (double)k / n;

            cairn_detection_curve_interval(share, n, &low, &high);
            assert_true(low >= 0 && low <= share + 1e-12 && high >= share - 1e-12 && high <= 1);
            assert_near((share - high) * (share - high), 1.96 * 1.96 * high * (1 - high) / n,
                        1e-12);
            assert_near((share - low) * (share - low), 1.96 * 1.96 * low * (1 - low) / n, 1e-12);
        }
}

static void files(void **state)
{
    cairn_detection_curve_event e[] = {{2, 1}, {1, 0}};
    cairn_detection_curve_point p[2];
    cairn_file_error error;
    char *text;

    (void)state;
    cairn_detection_curve(e, 2, 2, 4, p);
    assert_ok(cairn_detection_curve_write(files_path("curve"), "a < b", p, 2, &error));
    text = files_read(files_path("curve.csv"), NULL);
    assert_non_null(text);
    /* Wilson's intervals of 1 in 4 instances, and of 1 in 1 and 1 in 2 detections. */
    assert_string_equal(
        strchr(text, '\n'),
        "\n2.000000,0.250000,0.045586,0.699364,1.000000,0.206543,1.000000,0.000000\n"
        "1.000000,0.250000,0.045586,0.699364,0.500000,0.094529,0.905471,0.500000\n");
    free(text);
    text = files_read(files_path("curve.svg"), NULL);
    assert_non_null(text);
    assert_well_formed(text);
    free(text);
    /* Nothing was detected. */
    assert_ok(cairn_detection_curve_write(files_path("empty"), "none", p, 0, &error));
    assert_status(cairn_detection_curve_write(files_path("nowhere/curve"), "a", p, 2, &error),
                  CAIRN_IO);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(curves_by_hand),
        cmocka_unit_test(shares_of_boxes),
        cmocka_unit_test(agrees_with_the_reference_implementation),
        cmocka_unit_test(intervals),
        cmocka_unit_test(files),
    };

    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
