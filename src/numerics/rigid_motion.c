/* Gauss-Newton step for one pose, with unobservable directions removed.
 *
 * Method:
 * 1. The observed information matrix is rotated into its eigenbasis, in which the unobservable
 *    directions are the first rows and columns.
 * 2. These rows and columns are set to zero (solution remapping).
 * 3. The prior's information is added, and the sum is solved or inverted.
 *
 * Source: Zhang, Kaess and Singh, On degeneracy of optimization-based state estimation problems,
 * 2016. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/rigid_motion.h"

extern inline void cairn_rigid_motion_add_residual(cairn_rigid_motion_equations *equations,
                                                   const cairn_real row[3], cairn_real error,
                                                   cairn_real weight);

/* Least information in any direction, in 1/m^2: a standard deviation of 100 m. */
static const cairn_real MIN_INFORMATION = CAIRN_REAL(1e-4);

cairn_rigid_motion cairn_rigid_motion_at(cairn_pose map_body, cairn_vec2 centre, cairn_real radius)
{
    cairn_rigid_motion motion;

    motion.centre = centre;
    motion.radius = radius;
    motion.map_body = map_body;
    motion.transform = cairn_transform_of(map_body);
    return motion;
}

void cairn_rigid_motion_jacobian(const cairn_rigid_motion *motion, cairn_vec2 axis,
                                 cairn_vec2 body_point, cairn_real row[3])
{
    cairn_vec2 arm =
        cairn_transform_direction(motion->transform, cairn_vec2_sub(body_point, motion->centre));

    row[0] = axis.x;
    row[1] = axis.y;
    row[2] = cairn_vec2_dot(axis, cairn_vec2_left_perp(arm)) / motion->radius;
}

cairn_rigid_motion_basis cairn_rigid_motion_basis_of(cairn_sym3 information, cairn_real min_ratio)
{
    cairn_rigid_motion_basis basis;
    cairn_real values[3];

    cairn_sym3_eigen(information, values, basis.vectors);
    basis.inverse_condition = cairn_max(values[0], 0) / values[2];
    basis.unobservable = 0;
    while (basis.unobservable < 2 && values[basis.unobservable] < min_ratio * values[2])
        basis.unobservable++;
    return basis;
}

cairn_rigid_motion_equations cairn_rigid_motion_prior(const cairn_rigid_motion *motion,
                                                      const cairn_rigid_motion_pose_prior *prior)
{
    const cairn_vec2 origin = {0, 0};
    cairn_transform mean = cairn_transform_of(prior->mean);
    cairn_vec2 offset = {motion->map_body.x - mean.x, motion->map_body.y - mean.y};
    cairn_vec2 axes[2] = {{mean.cosine, mean.sine}, {-mean.sine, mean.cosine}};
    cairn_real sigmas[3] = {prior->sigma_x, prior->sigma_y, prior->sigma_theta};
    cairn_rigid_motion_equations equations = {cairn_sym3_zero(), {0, 0, 0}};

    for (int k = 0; k < 3; k++) {
        cairn_real weight = 1 / (sigmas[k] * sigmas[k]), error, row[3] = {0, 0, 0};

        if (k < 2) {
            error = cairn_vec2_dot(axes[k], offset);
            cairn_rigid_motion_jacobian(motion, axes[k], origin, row);
        } else {
            error = cairn_wrap_angle(motion->map_body.theta - prior->mean.theta);
            row[2] = 1 / motion->radius;
        }
        cairn_rigid_motion_add_residual(&equations, row, error, weight);
    }
    return equations;
}

/* Coordinates in the eigenbasis of a motion v. */
static void to_basis(const cairn_rigid_motion_basis *basis, const cairn_real v[3],
                     cairn_real out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = cairn_dot3(basis->vectors[i], v);
}

/* The motion with the coordinates v in the eigenbasis. */
static void from_basis(const cairn_rigid_motion_basis *basis, const cairn_real v[3],
                       cairn_real out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] =
            basis->vectors[0][k] * v[0] + basis->vectors[1][k] * v[1] + basis->vectors[2][k] * v[2];
}

/* A symmetric matrix in the eigenbasis: V m V^T with the eigenvectors as rows of V. */
static cairn_sym3 sym3_to_basis(const cairn_rigid_motion_basis *basis, cairn_sym3 m)
{
    cairn_real columns[3][3];
    cairn_sym3 out;

    for (int i = 0; i < 3; i++) {
        cairn_real product[3];

        cairn_sym3_times(m, basis->vectors[i], product);
        to_basis(basis, product, columns[i]);
    }
    out.xx = columns[0][0];
    out.xy = columns[1][0];
    out.xz = columns[2][0];
    out.yy = columns[1][1];
    out.yz = columns[2][1];
    out.zz = columns[2][2];
    return out;
}

/* Information matrix in the eigenbasis, zero along the unobservable directions. */
static cairn_sym3 observable_part(const cairn_rigid_motion_basis *basis, cairn_sym3 information)
{
    cairn_sym3 m = sym3_to_basis(basis, information);

    if (basis->unobservable > 0)
        m.xx = m.xy = m.xz = 0;
    if (basis->unobservable > 1)
        m.yy = m.yz = 0;
    return m;
}

/* Adds the information of a prior, which may be NULL, to an information matrix in the eigenbasis. */
static cairn_sym3 with_prior(const cairn_rigid_motion_basis *basis, cairn_sym3 information,
                             const cairn_rigid_motion_equations *prior)
{
    return prior != NULL ? cairn_sym3_add(information, sym3_to_basis(basis, prior->information))
                         : information;
}

int32_t cairn_rigid_motion_solve(const cairn_rigid_motion_basis *basis,
                                 const cairn_rigid_motion_equations *observed,
                                 const cairn_rigid_motion_equations *prior, cairn_real max_step,
                                 cairn_real step[3])
{
    cairn_sym3 information =
        with_prior(basis, observable_part(basis, observed->information), prior);
    cairn_real rhs[3], step_in_basis[3], length;

    to_basis(basis, observed->gradient, rhs);
    for (int i = 0; i < 3; i++)
        rhs[i] = i < basis->unobservable ? 0 : -rhs[i];
    if (prior != NULL) {
        cairn_real prior_gradient[3];

        to_basis(basis, prior->gradient, prior_gradient);
        for (int i = 0; i < 3; i++)
            rhs[i] -= prior_gradient[i];
    } else {
        /* Equations of zero motion along the unobservable directions. */
        if (basis->unobservable > 0)
            information.xx = information.zz;
        if (basis->unobservable > 1)
            information.yy = information.zz;
    }
    if (!cairn_sym3_solve(information, rhs, step_in_basis))
        return 0;
    from_basis(basis, step_in_basis, step);
    length = cairn_sqrt(cairn_dot3(step_in_basis, step_in_basis));
    if (length > max_step)
        for (int k = 0; k < 3; k++)
            step[k] *= max_step / length;
    return 1;
}

void cairn_rigid_motion_move(cairn_rigid_motion *motion, const cairn_real step[3])
{
    cairn_vec2 before = cairn_transform_direction(motion->transform, motion->centre), after;
    cairn_pose *pose = &motion->map_body;

    pose->theta = cairn_wrap_angle(pose->theta + step[2] / motion->radius);
    motion->transform = cairn_transform_of(*pose);
    after = cairn_transform_direction(motion->transform, motion->centre);
    pose->x += before.x + step[0] - after.x;
    pose->y += before.y + step[1] - after.y;
    motion->transform.x = pose->x;
    motion->transform.y = pose->y;
}

cairn_sym3 cairn_rigid_motion_shift(cairn_vec2 a_b, cairn_sym3 covariance)
{
    cairn_sym3 out = covariance;
    cairn_real x = a_b.x, y = a_b.y;

    out.xx = covariance.xx + 2 * y * covariance.xz + y * y * covariance.zz;
    out.yy = covariance.yy - 2 * x * covariance.yz + x * x * covariance.zz;
    out.xy = covariance.xy - x * covariance.xz + y * covariance.yz - x * y * covariance.zz;
    out.xz = covariance.xz + y * covariance.zz;
    out.yz = covariance.yz - x * covariance.zz;
    return out;
}

cairn_sym3 cairn_rigid_motion_adjoint(cairn_pose a_b, cairn_sym3 covariance)
{
    cairn_vec2 position = {a_b.x, a_b.y};

    return cairn_rigid_motion_shift(position, cairn_sym3_rotate_by(covariance, a_b.theta));
}

void cairn_rigid_motion_covariance(const cairn_rigid_motion *motion,
                                   const cairn_rigid_motion_basis *basis,
                                   const cairn_sym3 *observed,
                                   const cairn_rigid_motion_equations *prior,
                                   cairn_real covariance[9])
{
    static const cairn_rigid_motion_basis axes = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, 0, 0};
    cairn_vec2 arm =
        cairn_vec2_left_perp(cairn_transform_direction(motion->transform, motion->centre));
    cairn_sym3 information = cairn_sym3_zero();
    cairn_real values[3], inner[3][3];

    if (basis == NULL || observed == NULL)
        basis = &axes;
    else
        information = observable_part(basis, *observed);
    cairn_sym3_eigen(with_prior(basis, information, prior), values, inner);
    memset(covariance, 0, 9 * sizeof covariance[0]);
    for (int i = 0; i < 3; i++) {
        cairn_real variance = 1 / cairn_max(values[i], MIN_INFORMATION), about_centre[3], pose[3];

        /* Lever arm: a rotation about the centre also moves the origin of the body. */
        from_basis(basis, inner[i], about_centre);
        pose[2] = about_centre[2] / motion->radius;
        pose[0] = about_centre[0] - arm.x * pose[2];
        pose[1] = about_centre[1] - arm.y * pose[2];
        for (int k = 0; k < 9; k++)
            covariance[k] += variance * pose[k / 3] * pose[k % 3];
    }
}
