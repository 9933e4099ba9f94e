/* registration: robust registration of one rigid motion by corresponding points (iteratively
 * reweighted least squares). Its users search for the correspondences, and decide when it has
 * converged.
 *
 * A pair of a point q of the body, at p = R q + t in the map, and a line through m with unit normal
 * n has the residual e = n . (p - m). Methods and their sources: src/scans/registration.c.
 *
 *     { clear sums -> add_pair() ... -> update_sigma() -> move() } ... -> covariance() */
#ifndef CAIRN_REGISTRATION_H
#define CAIRN_REGISTRATION_H

#include "cairn/rigid_motion.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Normal equations and statistics of the residuals of one iteration; cleared by setting all to
 * 0. */
typedef struct cairn_registration_sums {
    /* not yet divided by sigma^2 */
    cairn_rigid_motion_equations equations;
    /* sums of w, w e^2, psi^2 and psi', with psi(e) = w e */
    cairn_real weight, squares, psi_squares, psi_derivatives;
    /* number of pairs */
    int32_t pairs;
} cairn_registration_sums;

/* State of a registration. */
typedef struct cairn_registration {
    /* Current estimate. */
    cairn_rigid_motion motion;
    /* m: greatest distance of corresponding points in this iteration. */
    cairn_real gate;
    /* m: scale of the residuals, of the last iteration; the first is about what is expected of
     * them at the start. */
    cairn_real sigma;
    /* m: lower bound of sigma, > 0. */
    cairn_real min_sigma;
    /* Sums of this iteration. */
    cairn_registration_sums sums;
} cairn_registration;

/* Sums over pairs of points, whose residuals are both coordinates of their difference. */
typedef struct cairn_registration_points {
    /* not yet divided by the variance of a residual */
    cairn_rigid_motion_equations equations;
    /* sums of w and w d^2, with the distance d of a pair */
    cairn_real weight, squares;
} cairn_registration_points;

/* Cauchy weight of a residual, 0 ... 1: 1 / (1 + (e / scale)^2).
 *
 * squared: e^2
 * scale: residual of weight 1/2, in the unit of e, > 0 */
cairn_real cairn_registration_cauchy(cairn_real squared, cairn_real scale);

/* Cauchy weight of a residual, 0 ... 1, of the scale 2.385 sigma.
 *
 * squared: e^2
 * sigma: scale of the residuals, in the unit of e, > 0 */
cairn_real cairn_registration_weight(cairn_real squared, cairn_real sigma);

/* Scale of residuals with Cauchy weights.
 *
 * squares: sum of w e^2 over the residuals
 * weight: sum of w over them, > 0
 * min_sigma: lower bound, > 0 */
cairn_real cairn_registration_sigma(cairn_real squares, cairn_real weight, cairn_real min_sigma);

/* Adds a pair of a point and a line; returns its weight.
 *
 * registration: state, whose sums are added to
 * body_point: point of the body, in the body's frame, m
 * normal: unit normal of the line, in the map
 * error: residual, m
 * row: set to its Jacobian */
cairn_real cairn_registration_add_pair(cairn_registration *registration, cairn_vec2 body_point,
                                       cairn_vec2 normal, cairn_real error, cairn_real row[3]);

/* Adds a pair of points.
 *
 * points: sums
 * motion: the current estimate
 * body_point: point of the body, in the body's frame, m
 * difference: its place in the map less that of the other point, m
 * weight: its weight, >= 0 */
void cairn_registration_add_points(cairn_registration_points *points,
                                   const cairn_rigid_motion *motion, cairn_vec2 body_point,
                                   cairn_vec2 difference, cairn_real weight);

/* Sets sigma from the residuals of this iteration; at least one pair.
 *
 * registration: state, with the sums of this iteration */
void cairn_registration_update_sigma(cairn_registration *registration);

/* Moves the pose by the Gauss-Newton step, of at most the gate. Returns 0 and moves nothing when no
 * direction is observable and there is no prior.
 *
 * registration: state
 * basis: eigenbasis of the information; unobservable directions are the prior's
 * equations: normal equations of residuals of the given variance, such as those of the sums
 * variance: m^2, > 0
 * prior: prior of the pose; NULL: none
 * step: set to the step: translation in x and y, and rotation times radius, m */
int32_t cairn_registration_move(cairn_registration *registration,
                                const cairn_rigid_motion_basis *basis,
                                const cairn_rigid_motion_equations *equations, cairn_real variance,
                                const cairn_rigid_motion_pose_prior *prior, cairn_real step[3]);

/* Factor that makes a sum of w J J^T the information of an M-estimator: the reciprocal variance of
 * a residual, 1/m^2.
 *
 * registration: state, with the sums of the last iteration */
cairn_real cairn_registration_information_scale(const cairn_registration *registration);

/* Covariance of the pose over (x, y, theta) in the map's frame, row-major, in m^2, m rad and rad^2.
 *
 * registration: state, with the sums of the last iteration
 * basis: eigenbasis of the information; NULL: too few pairs, the covariance is that of the prior
 * information: sum of w J J^T
 * prior: prior of the pose; NULL: none
 * covariance: [3][3] set to the covariance */
void cairn_registration_covariance(const cairn_registration *registration,
                                   const cairn_rigid_motion_basis *basis, cairn_sym3 information,
                                   const cairn_rigid_motion_pose_prior *prior,
                                   cairn_real covariance[9]);

#ifdef __cplusplus
}
#endif

#endif
