/* Robust registration: its sums beside the plain formulas, its covariance beside the spread of many
 * registrations, outliers, and directions that nothing observes. */
#include "tests/test.h"

#include <math.h>

#include "cairn/registration.h"

enum { POINTS = 60, ITERATIONS = 12, RUNS = 400 };

/* m: noise of a point across its line */
static const cairn_real NOISE_M = CAIRN_REAL(0.02);

/* Corresponding points of a body and lines of the map, for one registration. */
typedef struct pairs {
    cairn_vec2 body[POINTS], line[POINTS], normal[POINTS];
    int count;
} pairs;

/* Pairs at a true pose, on the walls of a room whose normals have the given directions. */
static pairs pairs_on(cairn_random *random, cairn_pose truth, const cairn_vec2 *normals, int walls)
{
    pairs made = {.count = POINTS};

    for (int i = 0; i < POINTS; i++) {
        cairn_vec2 n = normals[i % walls], along = cairn_vec2_left_perp(n), at;

        at = cairn_vec2_add(cairn_vec2_scale(n, 2),
                            cairn_vec2_scale(along, cairn_random_uniform(random, -3, 3)));
        made.normal[i] = n;
        made.line[i] = at;
        at = cairn_vec2_add(at, cairn_vec2_scale(n, NOISE_M * cairn_random_normal(random)));
        made.body[i] = cairn_pose_point(cairn_pose_inverse(truth), at);
    }
    return made;
}

static cairn_registration begin_at(cairn_pose start)
{
    const cairn_vec2 centre = {0, 0};
    cairn_registration r = {
        .motion = cairn_rigid_motion_at(start, centre, 2),
        .gate = 1,
        .sigma = CAIRN_REAL(0.5),
        .min_sigma = CAIRN_REAL(0.001),
    };

    return r;
}

static cairn_real error_of(const cairn_registration *r, const pairs *p, int i)
{
    cairn_vec2 moved = cairn_transform_point(r->motion.transform, p->body[i]);

    return cairn_vec2_dot(p->normal[i], cairn_vec2_sub(moved, p->line[i]));
}

static void add_all(cairn_registration *r, const pairs *p)
{
    cairn_real row[3];

    r->sums = (cairn_registration_sums){.pairs = 0};
    for (int i = 0; i < p->count; i++)
        (void)cairn_registration_add_pair(r, p->body[i], p->normal[i], error_of(r, p, i), row);
}

/* Iterates to the end; returns 0 when the equations could not be solved. */
static int registered(cairn_registration *r, const pairs *p, cairn_real min_ratio,
                      const cairn_rigid_motion_pose_prior *prior, cairn_rigid_motion_basis *basis)
{
    for (int i = 0; i < ITERATIONS; i++) {
        cairn_real step[3];

        add_all(r, p);
        cairn_registration_update_sigma(r);
        *basis = cairn_rigid_motion_basis_of(r->sums.equations.information, min_ratio);
        if (!cairn_registration_move(r, basis, &r->sums.equations, r->sigma * r->sigma, prior,
                                     step))
            return 0;
    }
    return 1;
}

static const cairn_vec2 ROOM[3] = {{1, 0}, {0, 1}, {CAIRN_REAL(0.6), CAIRN_REAL(-0.8)}};

/* Each sum beside its formula, in long double. */
static void test_a_residual_of_the_scale_has_half_the_weight(void **state)
{
    (void)state;
    assert_near(cairn_registration_cauchy(0, 3), 1, 0);
    assert_near(cairn_registration_cauchy(9, 3), 0.5, 0);
    assert_near(cairn_registration_cauchy(36, 3), 0.2, 1e-7);
    assert_near(cairn_registration_weight(36, 3), 1 / (1 + 36 / (2.385 * 2.385 * 9)), 1e-7);
}

static void test_sums_are_those_of_the_formulas(void **state)
{
    cairn_random random = cairn_random_seed(5, 0);
    cairn_pose truth = {CAIRN_REAL(0.3), CAIRN_REAL(-0.2), CAIRN_REAL(0.4)}, start = {0, 0, 0};
    pairs p = pairs_on(&random, truth, ROOM, 3);
    cairn_registration r = begin_at(start);
    long double weight = 0, squares = 0, psi_squares = 0, slopes = 0, xx = 0, gradient = 0, scale;

    (void)state;
    add_all(&r, &p);
    for (int i = 0; i < POINTS; i++) {
        long double e = (long double)error_of(&r, &p, i), c = 2.385L * (long double)r.sigma,
                    n = (long double)p.normal[i].x, w = 1 / (1 + e * e / (c * c));

        weight += w;
        squares += w * e * e;
        psi_squares += w * e * w * e;
        slopes += (1 - e * e / (c * c)) * w * w;
        xx += w * n * n;
        gradient += w * e * n;
    }
    assert_int_equal(r.sums.pairs, POINTS);
    assert_near(r.sums.weight, weight, NUMBER(1e-10, 1e-3));
    assert_near(r.sums.squares, squares, NUMBER(1e-10, 1e-3));
    assert_near(r.sums.psi_squares, psi_squares, NUMBER(1e-10, 1e-3));
    assert_near(r.sums.psi_derivatives, slopes, NUMBER(1e-10, 1e-3));
    assert_near(r.sums.equations.information.xx, xx, NUMBER(1e-10, 1e-3));
    assert_near(r.sums.equations.gradient[0], gradient, NUMBER(1e-10, 1e-3));
    scale = psi_squares / (POINTS - 3) * (weight / POINTS) / (slopes / POINTS * slopes / POINTS);
    assert_near(cairn_registration_information_scale(&r), 1 / scale,
                (double)(1 / scale) * NUMBER(1e-9, 1e-3));
    cairn_registration_update_sigma(&r);
    assert_near(r.sigma, sqrtl(1.26L * squares / weight), NUMBER(1e-10, 1e-4));
}

/* The errors of many registrations, squared and over their covariances, are 3 on average; a
 * covariance that is wrong by a factor of 1.3 fails. */
static void test_the_covariance_is_the_spread_of_the_poses(void **state)
{
    cairn_random random = cairn_random_seed(6, 0);
    cairn_pose truth = {CAIRN_REAL(0.2), CAIRN_REAL(-0.1), CAIRN_REAL(0.1)}, start = {0, 0, 0};
    double sum = 0;

    (void)state;
    for (int k = 0; k < RUNS; k++) {
        pairs p = pairs_on(&random, truth, ROOM, 3);
        cairn_registration r = begin_at(start);
        cairn_rigid_motion_basis basis;
        cairn_real covariance[9], error[3], solved[3];
        cairn_sym3 c;

        assert_true(registered(&r, &p, 0, NULL, &basis));
        cairn_registration_covariance(&r, &basis, r.sums.equations.information, NULL, covariance);
        error[0] = r.motion.map_body.x - truth.x;
        error[1] = r.motion.map_body.y - truth.y;
        error[2] = r.motion.map_body.theta - truth.theta;
        c = (cairn_sym3){covariance[0], covariance[1], covariance[2],
                         covariance[4], covariance[5], covariance[8]};
        assert_true(cairn_sym3_solve(c, error, solved));
        for (int i = 0; i < 3; i++)
            sum += (double)(error[i] * solved[i]);
    }
    assert_near(sum / RUNS, 3, 0.5);
}

/* Every tenth pair is wrong by up to 1 m: it loses its weight. */
static void test_outliers_do_not_move_the_pose(void **state)
{
    cairn_random random = cairn_random_seed(7, 0);
    cairn_pose truth = {CAIRN_REAL(0.1), CAIRN_REAL(0.1), CAIRN_REAL(0.05)}, start = {0, 0, 0};
    pairs p = pairs_on(&random, truth, ROOM, 3);
    cairn_registration r = begin_at(start);
    cairn_rigid_motion_basis basis;
    cairn_real row[3];

    (void)state;
    for (int i = 0; i < POINTS; i += 10)
        p.line[i] = cairn_vec2_add(
            p.line[i],
            cairn_vec2_scale(p.normal[i], cairn_random_uniform(&random, CAIRN_REAL(0.4), 1)));
    assert_true(registered(&r, &p, 0, NULL, &basis));
    assert_near(r.motion.map_body.x, truth.x, 0.02);
    assert_near(r.motion.map_body.y, truth.y, 0.02);
    assert_near(r.motion.map_body.theta, truth.theta, 0.01);
    for (int i = 0; i < POINTS; i++) {
        cairn_real weight =
            cairn_registration_add_pair(&r, p.body[i], p.normal[i], error_of(&r, &p, i), row);

        if (i % 10 == 0)
            assert_true(weight < CAIRN_REAL(0.1));
        else
            assert_true(weight > CAIRN_REAL(0.3));
    }
}

/* One wall: along it the pose stays, or the prior decides, and the covariance says so. */
static void test_a_weak_direction_is_left_to_the_prior(void **state)
{
    cairn_random random = cairn_random_seed(8, 0);
    const cairn_vec2 wall = {0, 1};
    const cairn_rigid_motion_pose_prior prior = {
        .mean = {CAIRN_REAL(0.5), 0, 0},
        .sigma_x = CAIRN_REAL(0.1),
        .sigma_y = 1,
        .sigma_theta = 1,
    };
    cairn_pose truth = {CAIRN_REAL(0.5), CAIRN_REAL(0.2), CAIRN_REAL(0.1)},
               start = {CAIRN_REAL(0.1), 0, 0};
    pairs p = pairs_on(&random, truth, &wall, 1);
    cairn_real along[2], covariance[9];

    (void)state;
    for (int with = 0; with < 2; with++) {
        cairn_registration r = begin_at(start);
        cairn_rigid_motion_basis basis;

        assert_true(registered(&r, &p, CAIRN_REAL(0.01), with ? &prior : NULL, &basis));
        assert_int_equal(basis.unobservable, 1);
        assert_near(r.motion.map_body.y, truth.y, 0.02);
        assert_near(r.motion.map_body.theta, truth.theta, 0.01);
        assert_near(r.motion.map_body.x, with ? prior.mean.x : start.x, with ? 0.01 : 0.05);
        cairn_registration_covariance(&r, &basis, r.sums.equations.information,
                                      with ? &prior : NULL, covariance);
        along[with] = cairn_sqrt(covariance[0]);
        assert_true(cairn_sqrt(covariance[4]) < CAIRN_REAL(0.02));
    }
    assert_near(along[0], 100, 10);
    assert_near(along[1], prior.sigma_x, 0.01);
}

/* Neither pairs nor a prior: no step; with the prior alone its covariance. */
static void test_without_pairs_the_prior_is_all_there_is(void **state)
{
    const cairn_rigid_motion_pose_prior prior = {
        .mean = {1, 2, 0},
        .sigma_x = CAIRN_REAL(0.3),
        .sigma_y = CAIRN_REAL(0.2),
        .sigma_theta = CAIRN_REAL(0.1),
    };
    cairn_registration r = begin_at(prior.mean);
    cairn_real covariance[9];

    (void)state;
    cairn_registration_covariance(&r, NULL, cairn_sym3_zero(), &prior, covariance);
    assert_near(cairn_sqrt(covariance[0]), 0.3, 1e-4);
    assert_near(cairn_sqrt(covariance[4]), 0.2, 1e-4);
    assert_near(cairn_sqrt(covariance[8]), 0.1, 1e-4);
}

/* Pairs of points: the sums beside their formulas; the step brings two points onto their places. */
static void test_pairs_of_points_measure_both_coordinates(void **state)
{
    const cairn_vec2 body[2] = {{1, 2}, {-3, CAIRN_REAL(0.5)}}, centre = {CAIRN_REAL(0.5), -1};
    const cairn_pose start = {CAIRN_REAL(0.4), CAIRN_REAL(0.1), CAIRN_REAL(0.3)},
                     truth = {CAIRN_REAL(0.41), CAIRN_REAL(0.08), CAIRN_REAL(0.31)};
    const cairn_real weights[2] = {1, CAIRN_REAL(0.25)};
    cairn_registration r = {.motion = cairn_rigid_motion_at(start, centre, 2), .gate = 1};
    cairn_registration_points sums = {.weight = 0};
    cairn_rigid_motion_basis basis;
    cairn_real step[3];
    long double squares = 0, turns = 0;

    (void)state;
    for (int i = 0; i < 2; i++) {
        cairn_vec2 at = cairn_pose_point(start, body[i]), arm = cairn_vec2_sub(body[i], centre),
                   difference = cairn_vec2_sub(at, cairn_pose_point(truth, body[i]));

        cairn_registration_add_points(&sums, &r.motion, body[i], difference, weights[i]);
        squares += (long double)weights[i] * (long double)cairn_vec2_norm_squared(difference);
        turns += (long double)weights[i] * (long double)cairn_vec2_norm_squared(arm) / 4;
    }
    assert_near(sums.weight, 1.25, NUMBER(1e-12, 1e-6));
    assert_near(sums.squares, squares, NUMBER(1e-12, 1e-8));
    assert_near(sums.equations.information.xx, 1.25, NUMBER(1e-12, 1e-6));
    assert_near(sums.equations.information.xy, 0, NUMBER(1e-12, 1e-6));
    assert_near(sums.equations.information.yy, 1.25, NUMBER(1e-12, 1e-6));
    assert_near(sums.equations.information.zz, turns, NUMBER(1e-12, 1e-5));
    basis = cairn_rigid_motion_basis_of(sums.equations.information, 0);
    assert_true(cairn_registration_move(&r, &basis, &sums.equations, 1, NULL, step));
    assert_near(r.motion.map_body.x, truth.x, 2e-4);
    assert_near(r.motion.map_body.y, truth.y, 2e-4);
    assert_near(r.motion.map_body.theta, truth.theta, 2e-4);
}

/* A step is not longer than the gate. */
static void test_a_step_is_cut_to_the_gate(void **state)
{
    cairn_random random = cairn_random_seed(9, 0);
    cairn_pose truth = {3, -2, 0}, start = {0, 0, 0};
    pairs p = pairs_on(&random, truth, ROOM, 3);
    cairn_registration r = begin_at(start);
    cairn_rigid_motion_basis basis;
    cairn_real step[3];

    (void)state;
    add_all(&r, &p);
    basis = cairn_rigid_motion_basis_of(r.sums.equations.information, 0);
    assert_true(cairn_registration_move(&r, &basis, &r.sums.equations, 1, NULL, step));
    assert_near(step[0] * step[0] + step[1] * step[1] + step[2] * step[2], r.gate * r.gate, 1e-5);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_residual_of_the_scale_has_half_the_weight),
        cmocka_unit_test(test_sums_are_those_of_the_formulas),
        cmocka_unit_test(test_the_covariance_is_the_spread_of_the_poses),
        cmocka_unit_test(test_outliers_do_not_move_the_pose),
        cmocka_unit_test(test_a_weak_direction_is_left_to_the_prior),
        cmocka_unit_test(test_without_pairs_the_prior_is_all_there_is),
        cmocka_unit_test(test_pairs_of_points_measure_both_coordinates),
        cmocka_unit_test(test_a_step_is_cut_to_the_gate),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
