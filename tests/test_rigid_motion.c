/* Normal equations, priors and covariances of a pose, compared with differences; unobservable
 * directions. */
#include "tests/test.h"

#include <math.h>

#include "cairn/rigid_motion.h"

static cairn_rigid_motion random_motion(cairn_random *random)
{
    cairn_pose pose;
    cairn_vec2 centre;

    pose.x = cairn_random_uniform(random, -5, 5);
    pose.y = cairn_random_uniform(random, -5, 5);
    pose.theta = cairn_random_uniform(random, -3, 3);
    centre.x = cairn_random_uniform(random, -4, 4);
    centre.y = cairn_random_uniform(random, -4, 4);
    return cairn_rigid_motion_at(pose, centre, cairn_random_uniform(random, CAIRN_REAL(0.5), 3));
}

/* A positive definite matrix with eigenvalues of the order of 1 to 10. */
static cairn_sym3 random_information(cairn_random *random)
{
    cairn_sym3 m = {1, 0, 0, 1, 0, 1};

    for (int i = 0; i < 4; i++) {
        cairn_real v[3];

        for (int k = 0; k < 3; k++)
            v[k] = cairn_random_uniform(random, -1, 1);
        cairn_sym3_add_outer(&m, v, 2);
    }
    return m;
}

static void random_step(cairn_random *random, cairn_real size, cairn_real step[3])
{
    for (int k = 0; k < 3; k++)
        step[k] = cairn_random_uniform(random, -size, size);
}

/* The centre moves by the step's shift, the body turns by its third component divided by the
 * radius. */
static void test_move(void **state)
{
    cairn_random random = cairn_random_seed(41, 0);

    (void)state;
    for (int k = 0; k < 30; k++) {
        cairn_rigid_motion motion = random_motion(&random), before = motion;
        cairn_real step[3];
        cairn_vec2 a, b;

        random_step(&random, 2, step);
        cairn_rigid_motion_move(&motion, step);
        a = cairn_pose_point(before.map_body, before.centre);
        b = cairn_pose_point(motion.map_body, before.centre);
        assert_near(b.x - a.x, step[0], NUMBER(1e-12, 1e-5));
        assert_near(b.y - a.y, step[1], NUMBER(1e-12, 1e-5));
        assert_near(cairn_wrap_angle(motion.map_body.theta - before.map_body.theta -
                                     step[2] / before.radius),
                    0, NUMBER(1e-12, 1e-5));
        assert_near(motion.transform.x, motion.map_body.x, 0);
        assert_near(motion.transform.y, motion.map_body.y, 0);
        assert_near(motion.transform.sine, sin((double)motion.map_body.theta), 1e-6);
        assert_near(motion.transform.cosine, cos((double)motion.map_body.theta), 1e-6);
        assert_true(motion.map_body.theta <= CAIRN_PI && motion.map_body.theta > -CAIRN_PI);
    }
}

/* Rows compared with differences of moved points. */
static void test_row(void **state)
{
    cairn_random random = cairn_random_seed(42, 0);
    cairn_real h = NUMBER(1e-6, 1e-2f);

    (void)state;
    for (int k = 0; k < 30; k++) {
        cairn_rigid_motion motion = random_motion(&random);
        cairn_vec2 point, axis;
        cairn_real row[3], angle = cairn_random_uniform(&random, -3, 3);

        point.x = cairn_random_uniform(&random, -4, 4);
        point.y = cairn_random_uniform(&random, -4, 4);
        axis.x = cairn_cos(angle);
        axis.y = cairn_sin(angle);
        cairn_rigid_motion_jacobian(&motion, axis, point, row);
        for (int i = 0; i < 3; i++) {
            cairn_rigid_motion plus = motion, minus = motion;
            cairn_real step[3] = {0, 0, 0};
            cairn_vec2 moved;

            step[i] = h;
            cairn_rigid_motion_move(&plus, step);
            step[i] = -h;
            cairn_rigid_motion_move(&minus, step);
            moved = cairn_vec2_sub(cairn_pose_point(plus.map_body, point),
                                   cairn_pose_point(minus.map_body, point));
            assert_near(cairn_vec2_dot(moved, axis) / (2 * h), row[i], NUMBER(1e-8, 2e-3));
        }
    }
}

static double prior_cost(const cairn_rigid_motion_pose_prior *prior, cairn_pose pose)
{
    cairn_pose off = cairn_pose_between(prior->mean, pose);

    return 0.5 *
           (pow((double)(off.x / prior->sigma_x), 2) + pow((double)(off.y / prior->sigma_y), 2) +
            pow((double)(off.theta / prior->sigma_theta), 2));
}

/* Gradient and information of the prior compared with differences of its cost. */
static void test_prior(void **state)
{
    cairn_random random = cairn_random_seed(43, 0);
    double h = NUMBER(1e-4, 3e-2);

    (void)state;
    for (int k = 0; k < 30; k++) {
        cairn_rigid_motion motion = random_motion(&random);
        cairn_pose off = {CAIRN_REAL(0.2), CAIRN_REAL(-0.1), CAIRN_REAL(0.15)};
        cairn_rigid_motion_pose_prior prior = {motion.map_body, CAIRN_REAL(0.5), CAIRN_REAL(0.8),
                                               CAIRN_REAL(0.3)};
        cairn_rigid_motion_equations equations;
        cairn_real m[3][3];

        if (k % 2)
            prior.mean = cairn_pose_compose(motion.map_body, off);
        if (k % 4 == 3)
            prior.mean.theta = cairn_wrap_angle(prior.mean.theta + 2 * CAIRN_PI);
        equations = cairn_rigid_motion_prior(&motion, &prior);
        m[0][0] = equations.information.xx;
        m[0][1] = m[1][0] = equations.information.xy;
        m[0][2] = m[2][0] = equations.information.xz;
        m[1][1] = equations.information.yy;
        m[1][2] = m[2][1] = equations.information.yz;
        m[2][2] = equations.information.zz;
        for (int i = 0; i < 3; i++) {
            double cost[2];

            for (int side = 0; side < 2; side++) {
                cairn_rigid_motion moved = motion;
                cairn_real step[3] = {0, 0, 0};

                step[i] = (cairn_real)(side ? h : -h);
                cairn_rigid_motion_move(&moved, step);
                cost[side] = prior_cost(&prior, moved.map_body);
            }
            assert_near((cost[1] - cost[0]) / (2 * h), equations.gradient[i], NUMBER(1e-4, 0.2));
            /* At the mean the cost is its information. */
            if (k % 2 == 0)
                assert_near((cost[1] + cost[0]) / (h * h), m[i][i],
                            NUMBER(1e-3, 0.05) * (double)m[i][i]);
            for (int j = 0; k % 2 == 0 && j < i; j++) {
                cairn_rigid_motion moved = motion;
                cairn_real step[3] = {0, 0, 0};
                double both;

                step[i] = step[j] = (cairn_real)h;
                cairn_rigid_motion_move(&moved, step);
                both = 2 * prior_cost(&prior, moved.map_body) / (h * h);
                assert_near(both, m[i][i] + m[j][j] + 2 * m[i][j],
                            NUMBER(1e-2, 0.2) * (double)(m[i][i] + m[j][j]));
            }
        }
    }
}

static void multiply(cairn_sym3 m, const cairn_real v[3], cairn_real out[3])
{
    out[0] = m.xx * v[0] + m.xy * v[1] + m.xz * v[2];
    out[1] = m.xy * v[0] + m.yy * v[1] + m.yz * v[2];
    out[2] = m.xz * v[0] + m.yz * v[1] + m.zz * v[2];
}

/* Without unobservable directions the step solves the sum of the equations; a step cut short keeps
 * its direction. */
static void test_solve(void **state)
{
    cairn_random random = cairn_random_seed(44, 0);

    (void)state;
    for (int k = 0; k < 30; k++) {
        cairn_rigid_motion_equations observed, prior;
        cairn_rigid_motion_basis basis;
        cairn_real step[4] = {0, 0, 0, 9}, cut[4] = {0, 0, 0, 9}, left[3], more[3] = {0, 0, 0},
                   length, dot;

        observed.information = random_information(&random);
        prior.information = random_information(&random);
        random_step(&random, 5, observed.gradient);
        random_step(&random, 5, prior.gradient);
        basis = cairn_rigid_motion_basis_of(observed.information, CAIRN_REAL(0.001));
        assert_int_equal(basis.unobservable, 0);
        assert_true(basis.inverse_condition > CAIRN_REAL(0.02) && basis.inverse_condition <= 1);
        assert_int_equal(
            cairn_rigid_motion_solve(&basis, &observed, k % 2 ? &prior : NULL, 1000, step), 1);
        multiply(observed.information, step, left);
        if (k % 2)
            multiply(prior.information, step, more);
        for (int i = 0; i < 3; i++)
            assert_near(left[i] + more[i] + observed.gradient[i] + (k % 2 ? prior.gradient[i] : 0),
                        0, NUMBER(1e-11, 1e-4));
        length = cairn_sqrt(step[0] * step[0] + step[1] * step[1] + step[2] * step[2]);
        assert_true(
            cairn_rigid_motion_solve(&basis, &observed, k % 2 ? &prior : NULL, length / 4, cut));
        dot = cut[0] * step[0] + cut[1] * step[1] + cut[2] * step[2];
        assert_near(dot, length * length / 4, NUMBER(1e-11, 1e-4));
        assert_near(cairn_sqrt(cut[0] * cut[0] + cut[1] * cut[1] + cut[2] * cut[2]), length / 4,
                    NUMBER(1e-11, 1e-4));
        assert_near(step[3] + cut[3], 18, 0); /* three numbers are written */
    }
}

/* Unobservable directions: no motion without a prior; with one the prior's own, whatever the
 * gradient there. */
static void test_weak_directions(void **state)
{
    const cairn_real diagonal = cairn_sqrt(CAIRN_REAL(0.5));
    const cairn_real u[3] = {diagonal, diagonal, 0}, v[3] = {diagonal, -diagonal, 0},
                     w[3] = {0, 0, 1};
    cairn_rigid_motion_equations observed = {cairn_sym3_zero(), {3, -2, 5}},
                                 prior = {cairn_sym3_zero(), {1, 3, 1}};
    cairn_rigid_motion_basis basis;
    cairn_real step[3];

    (void)state;
    cairn_sym3_add_outer(&observed.information, u, CAIRN_REAL(0.5));
    cairn_sym3_add_outer(&observed.information, v, 40);
    cairn_sym3_add_outer(&observed.information, w, 100);
    prior.information.xx = prior.information.yy = 4;
    prior.information.zz = 2;

    basis = cairn_rigid_motion_basis_of(observed.information, CAIRN_REAL(0.01));
    assert_int_equal(basis.unobservable, 1);
    assert_near(basis.inverse_condition, 0.005, 1e-6);
    assert_near(cairn_abs(basis.vectors[0][0] + basis.vectors[0][1]), 2 * diagonal, 1e-6);
    assert_near(basis.vectors[0][2], 0, 1e-6);
    assert_true(cairn_rigid_motion_solve(&basis, &observed, NULL, 100, step));
    assert_near(step[0] + step[1], 0, 1e-6);
    assert_near(step[0] - step[1], -5.0 / 40, 1e-6);
    assert_near(step[2], -0.05, 1e-6);
    assert_true(cairn_rigid_motion_solve(&basis, &observed, &prior, 100, step));
    assert_near(step[0] + step[1], -4.0 / 4, 1e-6);
    assert_near(step[0] - step[1], -3.0 / 44, 1e-6);
    assert_near(step[2], -6.0 / 102, 1e-6);

    assert_int_equal(
        cairn_rigid_motion_basis_of(observed.information, CAIRN_REAL(0.0049)).unobservable, 0);
    basis = cairn_rigid_motion_basis_of(observed.information, CAIRN_REAL(0.5));
    assert_int_equal(basis.unobservable, 2);
    assert_true(cairn_rigid_motion_solve(&basis, &observed, NULL, 100, step));
    assert_near(step[0], 0, 1e-6);
    assert_near(step[1], 0, 1e-6);
    assert_near(step[2], -0.05, 1e-6);
    assert_true(cairn_rigid_motion_solve(&basis, &observed, &prior, 100, step));
    assert_near(step[0], -0.25, 1e-6);
    assert_near(step[1], -0.75, 1e-6);

    /* A single direction is never unobservable; without any information there is no solution. */
    observed.information = cairn_sym3_zero();
    cairn_sym3_add_outer(&observed.information, v, 7);
    basis = cairn_rigid_motion_basis_of(observed.information, CAIRN_REAL(0.9));
    assert_int_equal(basis.unobservable, 2);
    basis.unobservable = 0;
    step[0] = 9;
    assert_int_equal(cairn_rigid_motion_solve(&basis, &observed, NULL, 100, step), 0);
    assert_near(step[0], 9, 0);
}

/* Compared with the inverse of the sum, mapped to the body's origin by differences of moved
 * poses. */
static void test_covariance(void **state)
{
    cairn_random random = cairn_random_seed(45, 0);
    double h = NUMBER(1e-6, 1e-2);

    (void)state;
    for (int k = 0; k < 20; k++) {
        cairn_rigid_motion motion = random_motion(&random);
        cairn_sym3 information = random_information(&random), total = information, inverse;
        cairn_rigid_motion_equations prior = {random_information(&random), {0, 0, 0}};
        cairn_rigid_motion_basis basis =
            cairn_rigid_motion_basis_of(information, CAIRN_REAL(0.0001));
        cairn_real covariance[10];
        double by[3][3], expected, inner[3][3];

        if (k % 2) {
            total.xx += prior.information.xx;
            total.xy += prior.information.xy;
            total.xz += prior.information.xz;
            total.yy += prior.information.yy;
            total.yz += prior.information.yz;
            total.zz += prior.information.zz;
        }
        assert_true(cairn_sym3_inverse(total, &inverse));
        inner[0][0] = (double)inverse.xx;
        inner[0][1] = inner[1][0] = (double)inverse.xy;
        inner[0][2] = inner[2][0] = (double)inverse.xz;
        inner[1][1] = (double)inverse.yy;
        inner[1][2] = inner[2][1] = (double)inverse.yz;
        inner[2][2] = (double)inverse.zz;
        for (int i = 0; i < 3; i++) {
            cairn_rigid_motion plus = motion, minus = motion;
            cairn_real step[3] = {0, 0, 0};

            step[i] = (cairn_real)h;
            cairn_rigid_motion_move(&plus, step);
            step[i] = (cairn_real)-h;
            cairn_rigid_motion_move(&minus, step);
            by[0][i] = (double)(plus.map_body.x - minus.map_body.x) / (2 * h);
            by[1][i] = (double)(plus.map_body.y - minus.map_body.y) / (2 * h);
            by[2][i] =
                (double)cairn_wrap_angle(plus.map_body.theta - minus.map_body.theta) / (2 * h);
        }
        covariance[9] = 7;
        cairn_rigid_motion_covariance(&motion, &basis, &information, k % 2 ? &prior : NULL,
                                      covariance);
        assert_near(covariance[9], 7, 0);
        for (int i = 0; i < 9; i++) {
            expected = 0;
            for (int j = 0; j < 9; j++)
                expected += by[i / 3][j / 3] * inner[j / 3][j % 3] * by[i % 3][j % 3];
            assert_near(covariance[i], expected, NUMBER(1e-7, 2e-2));
        }
    }
}

/* Without information the standard deviation is 100 m. */
static void test_covariance_of_the_unknown(void **state)
{
    cairn_pose pose = {1, 2, CAIRN_REAL(0.3)};
    cairn_vec2 centre = {0, 0};
    cairn_rigid_motion motion = cairn_rigid_motion_at(pose, centre, 2);
    cairn_sym3 information = {0, 0, 0, 100, 0, 400};
    cairn_rigid_motion_pose_prior known = {pose, CAIRN_REAL(0.1), CAIRN_REAL(0.2), CAIRN_REAL(0.3)};
    cairn_rigid_motion_equations prior;
    cairn_rigid_motion_basis basis = cairn_rigid_motion_basis_of(information, CAIRN_REAL(0.1));
    cairn_real covariance[9];

    (void)state;
    cairn_rigid_motion_covariance(&motion, NULL, NULL, NULL, covariance);
    for (int i = 0; i < 9; i++)
        assert_near(covariance[i], i == 0 || i == 4 ? 1e4 : i == 8 ? 2500 : 0, 1e-2);
    cairn_rigid_motion_covariance(&motion, &basis, NULL, NULL, covariance);
    assert_near(covariance[4], 1e4, 1e-2);
    cairn_rigid_motion_covariance(&motion, NULL, &information, NULL, covariance);
    assert_near(covariance[4], 1e4, 1e-2);
    cairn_rigid_motion_covariance(&motion, &basis, &information, NULL, covariance);
    for (int i = 0; i < 9; i++)
        assert_near(covariance[i],
                    i == 0   ? 1e4
                    : i == 4 ? 0.01
                    : i == 8 ? 1.0 / 1600
                             : 0,
                    NUMBER(1e-9, 1e-2));
    motion.map_body.theta = known.mean.theta = 0;
    motion.transform = cairn_transform_of(motion.map_body);
    prior = cairn_rigid_motion_prior(&motion, &known);
    cairn_rigid_motion_covariance(&motion, NULL, NULL, &prior, covariance);
    for (int i = 0; i < 9; i++)
        assert_near(covariance[i], i == 0 ? 0.01 : i == 4 ? 0.04 : i == 8 ? 0.09 : 0, 1e-6);
    cairn_rigid_motion_covariance(&motion, &basis, &information, &prior, covariance);
    assert_near(covariance[0], 0.01, 1e-6);
    assert_near(covariance[4], 1.0 / 125, 1e-6);
}

/* The covariance of a motion in another frame, by differences: C of J motion is J C J^T, where the
 * columns of J are small motions of the body seen from the map. */
static void the_adjoint_moves_covariances_between_frames(void **state)
{
    const cairn_real small = (cairn_real)NUMBER(1e-5, 1e-2);
    cairn_random random = cairn_random_seed(45, 0);

    (void)state;
    for (int trial = 0; trial < 30; trial++) {
        cairn_pose map_body = random_motion(&random).map_body;
        cairn_sym3 covariance = random_information(&random);
        cairn_real jacobian[3][3], in[9], out[9];

        for (int k = 0; k < 3; k++) {
            cairn_pose motion = {k == 0 ? small : 0, k == 1 ? small : 0, k == 2 ? small : 0},
                       back = {-motion.x, -motion.y, -motion.theta}, body_map, after, before;

            body_map = cairn_pose_inverse(map_body);
            after = cairn_pose_compose(cairn_pose_compose(map_body, motion), body_map);
            before = cairn_pose_compose(cairn_pose_compose(map_body, back), body_map);
            jacobian[0][k] = (after.x - before.x) / (2 * small);
            jacobian[1][k] = (after.y - before.y) / (2 * small);
            jacobian[2][k] = (after.theta - before.theta) / (2 * small);
        }
        cairn_sym3_to_full(covariance, in);
        cairn_sym3_to_full(cairn_rigid_motion_adjoint(map_body, covariance), out);
        for (int i = 0; i < 9; i++) {
            cairn_real expected = 0;

            for (int k = 0; k < 9; k++)
                expected += jacobian[i / 3][k / 3] * in[k] * jacobian[i % 3][k % 3];
            assert_near(out[i], expected, NUMBER(1e-6, 0.1));
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_move),
        cmocka_unit_test(test_row),
        cmocka_unit_test(test_prior),
        cmocka_unit_test(test_solve),
        cmocka_unit_test(test_weak_directions),
        cmocka_unit_test(test_covariance),
        cmocka_unit_test(the_adjoint_moves_covariances_between_frames),
        cmocka_unit_test(test_covariance_of_the_unknown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
