/* registration: see the header. */
#include "src/base/build.h"

#include <stddef.h>

#include "src/scans/registration.h"

/* Scale of the Cauchy weights at which normal residuals keep 95 % of their information; the
 * weighted mean square of the residuals is then 1 / 1.26 of their variance. */
static const cairn_real CAUCHY_SCALE = CAIRN_REAL(2.385);
static const cairn_real CAUCHY_VARIANCE = CAIRN_REAL(1.26);

/* Least mean of psi': it is small or negative when most residuals are outliers. */
static const cairn_real MIN_PSI_DERIVATIVE = CAIRN_REAL(0.1);

cairn_real cairn_registration_weight(cairn_real squared, cairn_real sigma)
{
    cairn_real scale = CAUCHY_SCALE * sigma;

    return 1 / (1 + squared / (scale * scale));
}

cairn_real cairn_registration_sigma(cairn_real squares, cairn_real weight, cairn_real min_sigma)
{
    return cairn_max(min_sigma, cairn_sqrt(CAUCHY_VARIANCE * squares / weight));
}

cairn_real cairn_registration_add_pair(registration *r, cairn_vec2 body_point, cairn_vec2 normal,
                                       cairn_real error, cairn_real row[3])
{
    registration_sums *sums = &r->sums;
    cairn_real squared = error * error, weight = cairn_registration_weight(squared, r->sigma);

    cairn_rigid_motion_jacobian(&r->motion, normal, body_point, row);
    cairn_rigid_motion_add_residual(&sums->equations, row, error, weight);
    sums->weight += weight;
    sums->squares += weight * squared;
    sums->psi_squares += weight * weight * squared;
    /* psi = w e, 1 - (e / scale)^2 = 2 - 1 / w */
    sums->psi_derivatives += weight * weight * (2 - 1 / weight);
    sums->pairs++;
    return weight;
}

void cairn_registration_update_sigma(registration *r)
{
    r->sigma = cairn_registration_sigma(r->sums.squares, r->sums.weight, r->min_sigma);
}

int32_t cairn_registration_solve(const registration *r, const cairn_rigid_motion_basis *basis,
                                 const cairn_rigid_motion_equations *equations, cairn_real variance,
                                 const cairn_rigid_motion_pose_prior *prior, cairn_real step[3])
{
    cairn_real by = 1 / variance;
    cairn_rigid_motion_equations observed, before;

    observed.information = cairn_sym3_scale(equations->information, by);
    for (int k = 0; k < 3; k++)
        observed.gradient[k] = by * equations->gradient[k];
    if (prior != NULL)
        before = cairn_rigid_motion_prior(&r->motion, prior);
    return cairn_rigid_motion_solve(basis, &observed, prior != NULL ? &before : NULL, r->gate,
                                    step);
}

cairn_real cairn_registration_information_scale(const registration *r)
{
    const registration_sums *sums = &r->sums;
    cairn_real n = (cairn_real)sums->pairs,
               psi_derivative = cairn_max(sums->psi_derivatives / n, MIN_PSI_DERIVATIVE);
    cairn_real scale = sums->psi_squares / cairn_max(n - 3, 1) * (sums->weight / n) /
                       (psi_derivative * psi_derivative);

    return 1 / cairn_max(scale, r->min_sigma * r->min_sigma);
}

void cairn_registration_covariance(const registration *r, const cairn_rigid_motion_basis *basis,
                                   cairn_sym3 information,
                                   const cairn_rigid_motion_pose_prior *prior,
                                   cairn_real covariance[9])
{
    cairn_rigid_motion_equations before;

    if (prior != NULL)
        before = cairn_rigid_motion_prior(&r->motion, prior);
    if (basis != NULL)
        information = cairn_sym3_scale(information, cairn_registration_information_scale(r));
    cairn_rigid_motion_covariance(&r->motion, basis, basis != NULL ? &information : NULL,
                                  prior != NULL ? &before : NULL, covariance);
}
