/* registration: weights, scale, Gauss-Newton step and covariance of a robust registration.
 *
 * Method:
 * 1. add_pair(): Cauchy weight w = 1 / (1 + (e / (2.385 sigma))^2), and the sums of the normal
 *    equations.
 * 2. update_sigma(): sigma of the residuals, from their weighted mean square.
 * 3. move(): Gauss-Newton step without the weak directions, in which the prior decides, cut to the
 *    length of the gate, because correspondences beyond the gate are not used.
 * 4. covariance(): that of an M-estimator (Huber 1981, section 7.6), with the weighted information
 *    in place of the plain one: sum(psi^2) / (n - 3) * (sum(w) / n) / (sum(psi') / n)^2 times the
 *    inverse of sum(w J J^T), psi(e) = w e.
 *
 * Limits: local convergence only. */
#include "src/base/build.h"

#include <stddef.h>

#include "cairn/registration.h"

/* Scale of the Cauchy weights at which normal residuals keep 95 % of their information; the
 * weighted mean square of the residuals is then 1 / 1.26 of their variance. */
static const cairn_real CAUCHY_SCALE = CAIRN_REAL(2.385);
static const cairn_real CAUCHY_VARIANCE = CAIRN_REAL(1.26);

/* Least mean of psi': it is small or negative when most residuals are outliers. */
static const cairn_real MIN_PSI_DERIVATIVE = CAIRN_REAL(0.1);

cairn_real cairn_registration_cauchy(cairn_real squared, cairn_real scale)
{
    return 1 / (1 + squared / (scale * scale));
}

cairn_real cairn_registration_weight(cairn_real squared, cairn_real sigma)
{
    return cairn_registration_cauchy(squared, CAUCHY_SCALE * sigma);
}

cairn_real cairn_registration_sigma(cairn_real squares, cairn_real weight, cairn_real min_sigma)
{
    return cairn_max(min_sigma, cairn_sqrt(CAUCHY_VARIANCE * squares / weight));
}

cairn_real cairn_registration_add_pair(cairn_registration *registration, cairn_vec2 body_point,
                                       cairn_vec2 normal, cairn_real error, cairn_real row[3])
{
    cairn_registration_sums *sums = &registration->sums;
    cairn_real squared = error * error,
               weight = cairn_registration_weight(squared, registration->sigma);

    cairn_rigid_motion_jacobian(&registration->motion, normal, body_point, row);
    cairn_rigid_motion_add_residual(&sums->equations, row, error, weight);
    sums->weight += weight;
    sums->squares += weight * squared;
    sums->psi_squares += weight * weight * squared;
    /* psi = w e, 1 - (e / scale)^2 = 2 - 1 / w */
    sums->psi_derivatives += weight * weight * (2 - 1 / weight);
    sums->pairs++;
    return weight;
}

void cairn_registration_add_points(cairn_registration_points *points,
                                   const cairn_rigid_motion *motion, cairn_vec2 body_point,
                                   cairn_vec2 difference, cairn_real weight)
{
    static const cairn_vec2 axes[2] = {{1, 0}, {0, 1}};
    const cairn_real errors[2] = {difference.x, difference.y};
    cairn_real row[3];

    for (int k = 0; k < 2; k++) {
        cairn_rigid_motion_jacobian(motion, axes[k], body_point, row);
        cairn_rigid_motion_add_residual(&points->equations, row, errors[k], weight);
    }
    points->weight += weight;
    points->squares += weight * cairn_vec2_norm_squared(difference);
}

void cairn_registration_update_sigma(cairn_registration *registration)
{
    registration->sigma = cairn_registration_sigma(
        registration->sums.squares, registration->sums.weight, registration->min_sigma);
}

/* Sets the normal equations of the prior at the current pose and returns them; NULL: none. */
static const cairn_rigid_motion_equations *
prior_equations(const cairn_registration *registration, const cairn_rigid_motion_pose_prior *prior,
                cairn_rigid_motion_equations *equations)
{
    if (prior == NULL)
        return NULL;
    *equations = cairn_rigid_motion_prior(&registration->motion, prior);
    return equations;
}

int32_t cairn_registration_move(cairn_registration *registration,
                                const cairn_rigid_motion_basis *basis,
                                const cairn_rigid_motion_equations *equations, cairn_real variance,
                                const cairn_rigid_motion_pose_prior *prior, cairn_real step[3])
{
    cairn_real by = 1 / variance;
    cairn_rigid_motion_equations observed, before;

    observed.information = cairn_sym3_scale(equations->information, by);
    for (int k = 0; k < 3; k++)
        observed.gradient[k] = by * equations->gradient[k];
    if (!cairn_rigid_motion_solve(basis, &observed, prior_equations(registration, prior, &before),
                                  registration->gate, step))
        return 0;
    cairn_rigid_motion_move(&registration->motion, step);
    return 1;
}

cairn_real cairn_registration_information_scale(const cairn_registration *registration)
{
    const cairn_registration_sums *sums = &registration->sums;
    cairn_real n = (cairn_real)sums->pairs,
               psi_derivative = cairn_max(sums->psi_derivatives / n, MIN_PSI_DERIVATIVE);
    cairn_real scale = sums->psi_squares / cairn_max(n - 3, 1) * (sums->weight / n) /
                       (psi_derivative * psi_derivative);

    return 1 / cairn_max(scale, registration->min_sigma * registration->min_sigma);
}

void cairn_registration_covariance(const cairn_registration *registration,
                                   const cairn_rigid_motion_basis *basis, cairn_sym3 information,
                                   const cairn_rigid_motion_pose_prior *prior,
                                   cairn_real covariance[9])
{
    cairn_rigid_motion_equations before;

    if (basis != NULL)
        information =
            cairn_sym3_scale(information, cairn_registration_information_scale(registration));
    cairn_rigid_motion_covariance(&registration->motion, basis, basis != NULL ? &information : NULL,
                                  prior_equations(registration, prior, &before), covariance);
}
