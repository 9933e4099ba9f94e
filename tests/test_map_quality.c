/* Entropy, likelihood of a beam through cells with unequal chords, pose errors and relations, all
 * by hand. */
#include "tests/test.h"

#include <math.h>

#include "cairn/map_quality.h"

static const double TOLERANCE = NUMBER(1e-6, 1e-5);

static cairn_occupancy_grid *new_grid(cairn_pool *pool, int32_t width, int32_t height)
{
    cairn_occupancy_grid_params params = {
        .width = width, .height = height, .resolution = 1, .origin = {0, 0}};
    cairn_occupancy_grid *grid;

    *pool = test_pool(cairn_occupancy_grid_memory(&params));
    assert_ok(cairn_occupancy_grid_create(&grid, pool, &params));
    return grid;
}

static cairn_vec2 at(double x, double y)
{
    cairn_vec2 p = {(cairn_real)x, (cairn_real)y};

    return p;
}

static double entropy_of(double p)
{
    return -p * log(p) - (1 - p) * log(1 - p);
}

static void entropy_by_quadrants(void **state)
{
    /* Five wide and three high: the south is one row, the west two columns. */
    const cairn_vec2 cell[4] = {{0, 2}, {2, 1}, {4, 0}, {1, 0}};
    cairn_map_quality_entropy entropy, none;
    cairn_occupancy_grid *grid;
    cairn_pool pool;
    double whole = 0;

    (void)state;
    memset(&entropy, 0, sizeof entropy);
    none = entropy;
    grid = new_grid(&pool, 5, 3);
    for (int q = 0; q < 4; q++)
        for (int k = 0; k <= q + 1; k++) { /* one hit, q + 2 beams of 0.8 m */
            double x = (double)cell[q].x + 0.1, y = (double)cell[q].y + 0.5;

            assert_ok(cairn_occupancy_grid_add_beam(grid, at(x, y), at(x + 0.8, y), k == 0));
        }
    assert_ok(cairn_map_quality_entropy_add(grid, 0, 1, &entropy));
    assert_int_equal(entropy.cells, 2);
    assert_ok(cairn_map_quality_entropy_add(grid, 1, 2, &entropy));
    assert_int_equal(entropy.cells, 4);
    for (int q = 0; q < 4; q++) {
        double h = entropy_of(1 - exp(-1 / (0.8 * (q + 2))));

        assert_near(entropy.quadrant[q], h, TOLERANCE);
        whole += h;
    }
    assert_near(entropy.total, whole, TOLERANCE);
    assert_ok(cairn_map_quality_entropy_add(grid, 3, 0, &none));
    assert_int_equal(none.cells, 0);
    assert_status(cairn_map_quality_entropy_add(NULL, 0, 1, &none), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_quality_entropy_add(grid, 0, 1, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_quality_entropy_add(grid, -1, 1, &none), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_quality_entropy_add(grid, 0, -1, &none), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_quality_entropy_add(grid, 2, 2, &none), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_quality_entropy_add(grid, 4, 0, &none), CAIRN_BAD_ARGUMENT);
    test_pool_free(&pool);
}

static void a_beam_through_unequal_chords(void **state)
{
    /* From (0.5, 0.25) with slope 1/2: x = 1 at a quarter, y = 1 (x = 2) at three quarters, end
     * (2.5, 1.25). */
    const double length = sqrt(5.0), chord[3] = {0.25 * length, 0.5 * length, 0.25 * length};
    const double hits[3] = {1, 2, 3}, beams[3] = {4, 5, 6}, least = 0.001;
    double passed = 0, last = 0;
    cairn_occupancy_grid *grid;
    cairn_real log_p;
    cairn_pool pool;

    (void)state;
    grid = new_grid(&pool, 4, 3);
    for (int c = 0; c < 3; c++) {
        double x = c, y = c == 2 ? 1 : 0;

        for (int k = 0; k < (int)beams[c]; k++)
            assert_ok(cairn_occupancy_grid_add_beam(grid, at(x + 0.2, y + 0.9),
                                                    at(x + 0.7, y + 0.9), k < (int)hits[c]));
        last = chord[c] * hits[c] / (0.5 * beams[c]);
        passed += c < 2 ? last : 0;
    }
    assert_ok(cairn_map_quality_beam_likelihood(grid, at(0.5, 0.25), at(2.5, 1.25), 1,
                                                (cairn_real)least, &log_p));
    assert_near(log_p, log(least + (1 - least) * exp(-passed) * (1 - exp(-last))), TOLERANCE);
    assert_ok(cairn_map_quality_beam_likelihood(grid, at(0.5, 0.25), at(2.5, 1.25), 0,
                                                (cairn_real)least, &log_p));
    assert_near(log_p, log(least + (1 - least) * exp(-passed - last)), TOLERANCE);
    /* Ends beyond the grid, beside it, in cells never seen. */
    assert_ok(cairn_map_quality_beam_likelihood(grid, at(3.5, 2.5), at(9, 2.5), 1,
                                                (cairn_real)least, &log_p));
    assert_near(log_p, log(least), TOLERANCE);
    assert_ok(cairn_map_quality_beam_likelihood(grid, at(3.5, 2.5), at(9, 2.5), 0,
                                                (cairn_real)least, &log_p));
    assert_near(log_p, 0, TOLERANCE);
    assert_ok(cairn_map_quality_beam_likelihood(grid, at(-3, -3), at(-9, -3), 0, (cairn_real)least,
                                                &log_p));
    assert_near(log_p, 0, TOLERANCE);
    assert_ok(cairn_map_quality_beam_likelihood(grid, at(-3, -3), at(-9, -3), 1, (cairn_real)least,
                                                &log_p));
    assert_near(log_p, log(least), TOLERANCE);
    /* Half a metre of beam, one hit. */
    assert_ok(cairn_occupancy_grid_add_beam(grid, at(0.2, 2.5), at(0.7, 2.5), 1));
    assert_ok(cairn_map_quality_beam_likelihood(grid, at(0.1, 2.5), at(0.9, 2.5), 0,
                                                (cairn_real)least, &log_p));
    assert_near(log_p, log(least + (1 - least) * exp(-0.8 / 0.5)), TOLERANCE);
    /* A hit of zero length stops every beam. */
    assert_ok(cairn_occupancy_grid_add_beam(grid, at(3.5, 2.5), at(3.5, 2.5), 1));
    assert_ok(cairn_map_quality_beam_likelihood(grid, at(2.5, 2.5), at(3.5, 2.5), 1,
                                                (cairn_real)least, &log_p));
    assert_near(log_p, 0, TOLERANCE);
    assert_ok(cairn_map_quality_beam_likelihood(grid, at(2.5, 2.5), at(3.5, 2.5), 0,
                                                (cairn_real)least, &log_p));
    assert_near(log_p, log(least), TOLERANCE);
    assert_status(
        cairn_map_quality_beam_likelihood(NULL, at(0, 0), at(1, 1), 1, CAIRN_REAL(0.1), &log_p),
        CAIRN_BAD_ARGUMENT);
    assert_status(
        cairn_map_quality_beam_likelihood(grid, at(0, 0), at(1, 1), 1, CAIRN_REAL(0.1), NULL),
        CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_quality_beam_likelihood(grid, at(0, 0), at(1, 1), 1, 0, &log_p),
                  CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_quality_beam_likelihood(grid, at(0, 0), at(1, 1), 1, 1, &log_p),
                  CAIRN_BAD_ARGUMENT);
    assert_status(
        cairn_map_quality_beam_likelihood(grid, at(0, 0), at(1, 1), 1, (cairn_real)NAN, &log_p),
        CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_quality_beam_likelihood(grid, at(0, 0), at((double)NAN, 1), 1,
                                                    CAIRN_REAL(0.1), &log_p),
                  CAIRN_NOT_FINITE);
    test_pool_free(&pool);
}

static void pose_errors(void **state)
{
    /* The same path in a frame rotated by 90 degrees, except for the last pose. */
    cairn_pose truth[3] = {{1, 1, 0}, {2, 1, 1}, {2, 3, CAIRN_REAL(3.1)}};
    cairn_pose estimate[3] = {{5, 5, CAIRN_PI / 2}, {5, 6, CAIRN_PI / 2 + 1}, {0, 0, 0}};
    /* truth: (1, 2, 3.1) */
    const cairn_pose last = {CAIRN_REAL(1.5), CAIRN_REAL(1.7), CAIRN_REAL(-3.0)};
    cairn_map_quality_pose_errors e;

    (void)state;
    estimate[2] = cairn_pose_compose(estimate[0], last);
    assert_ok(cairn_map_quality_pose_errors_of(estimate, truth, 3, &e));
    assert_near(e.x, 0.5 / 3, TOLERANCE);
    assert_near(e.y, 0.3 / 3, TOLERANCE);
    assert_near(e.theta, (2 * 3.14159265358979 - 6.1) / 3, TOLERANCE);
    assert_ok(cairn_map_quality_pose_errors_of(estimate, truth, 1, &e));
    assert_true(e.x == 0 && e.y == 0 && e.theta == 0);
    assert_ok(cairn_map_quality_pose_errors_of(estimate, truth, 3, &e));
    assert_status(cairn_map_quality_pose_errors_of(NULL, truth, 3, &e), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_quality_pose_errors_of(estimate, NULL, 3, &e), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_quality_pose_errors_of(estimate, truth, 3, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_quality_pose_errors_of(estimate, truth, 0, &e), CAIRN_EMPTY);
    truth[2].y = (cairn_real)NAN;
    assert_status(cairn_map_quality_pose_errors_of(estimate, truth, 3, &e), CAIRN_NOT_FINITE);
    truth[2].y = 3;
    estimate[1].theta = (cairn_real)NAN;
    assert_status(cairn_map_quality_pose_errors_of(estimate, truth, 3, &e), CAIRN_NOT_FINITE);
    assert_near(e.x, 0.5 / 3, TOLERANCE);
}

static void relations(void **state)
{
    const cairn_pose first = {3, 4, 2}, reference = {1, 2, CAIRN_REAL(0.5)},
                     bad = {0, 0, (cairn_real)NAN};
    const double distance[2] = {0.5, 0.1}, angle[2] = {-0.2, 0.6};
    cairn_map_quality_relation_sums sums;
    cairn_map_quality_relation_errors e;

    (void)state;
    memset(&sums, 0, sizeof sums);
    e = cairn_map_quality_relation_errors_of(&sums);
    assert_true(e.distance_mean == 0 && e.distance_sd == 0 && e.distance_squared == 0);
    assert_true(e.angle_mean == 0 && e.angle_sd == 0 && e.angle_squared == 0);
    for (int k = 0; k < 2; k++) {
        cairn_pose off = {(cairn_real)(0.6 * distance[k]), (cairn_real)(-0.8 * distance[k]),
                          (cairn_real)angle[k]};
        cairn_pose second = cairn_pose_compose(first, cairn_pose_compose(reference, off));

        assert_ok(cairn_map_quality_relation_add(&sums, reference, first, second));
    }
    e = cairn_map_quality_relation_errors_of(&sums);
    assert_near(e.distance_mean, 0.3, TOLERANCE);
    assert_near(e.distance_sd, 0.2, TOLERANCE);
    assert_near(e.distance_squared, 0.13, TOLERANCE);
    assert_near(e.angle_mean, 0.4, TOLERANCE);
    assert_near(e.angle_sd, 0.2, TOLERANCE);
    assert_near(e.angle_squared, 0.2, TOLERANCE);
    assert_status(cairn_map_quality_relation_add(NULL, reference, first, first),
                  CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_quality_relation_add(&sums, bad, first, first), CAIRN_NOT_FINITE);
    assert_status(cairn_map_quality_relation_add(&sums, reference, bad, first), CAIRN_NOT_FINITE);
    assert_status(cairn_map_quality_relation_add(&sums, reference, first, bad), CAIRN_NOT_FINITE);
    assert_int_equal(sums.count, 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(entropy_by_quadrants),
        cmocka_unit_test(a_beam_through_unequal_chords),
        cmocka_unit_test(pose_errors),
        cmocka_unit_test(relations),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
