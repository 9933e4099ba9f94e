/* registration: robust point-to-line registration of one rigid motion (iteratively reweighted least
 * squares). Its users search for the corresponding points, and decide when it has converged.
 *
 * Method: a pair of a point q of the body, at p = R q + t, and a line through m with unit normal n
 * has the residual e = n . (p - m).
 * 1. add_pair(): Cauchy weight w = 1 / (1 + (e / (2.385 sigma))^2), and the sums of the normal
 *    equations.
 * 2. update_sigma(): sigma of the residuals, from their weighted mean square.
 * 3. solve(): Gauss-Newton step without the weak directions, in which the prior decides, cut to the
 *    length of the gate, because correspondences beyond the gate are not used.
 * 4. covariance(): that of an M-estimator (Huber 1981, section 7.6), with the weighted information
 *    in place of the plain one: sum(psi^2) / (n - 3) * (sum(w) / n) / (sum(psi') / n)^2 times the
 *    inverse of sum(w J J^T), psi(e) = w e.
 *
 *     { clear sums -> add_pair() ... -> update_sigma() -> solve() } ... -> covariance()
 *
 * Limits: local convergence only. The first sigma is the user's: about what is expected of the
 * residuals at the start. */
#ifndef CAIRN_SCANS_REGISTRATION_H
#define CAIRN_SCANS_REGISTRATION_H

#include "cairn/rigid_motion.h"

/* Normal equations and statistics of the residuals of one iteration. */
typedef struct registration_sums {
    cairn_rigid_motion_equations equations; /* not yet divided by sigma^2 */
    /* sums of w, w e^2, psi^2 and psi' */
    cairn_real weight, squares, psi_squares, psi_derivatives;
    int32_t pairs;
} registration_sums;

/* State of a registration. */
typedef struct registration {
    cairn_rigid_motion motion;
    cairn_real gate;      /* m: greatest distance of corresponding points in this iteration */
    cairn_real sigma;     /* m: scale of the residuals, of the last iteration */
    cairn_real min_sigma; /* m: lower bound of sigma, > 0 */
    registration_sums sums;
} registration;

/* Returns the Cauchy weight of a squared residual. */
cairn_real cairn_registration_weight(cairn_real squared, cairn_real sigma);

/* Returns sigma of residuals with Cauchy weights, from the sums of w e^2 and of w over them. */
cairn_real cairn_registration_sigma(cairn_real squares, cairn_real weight, cairn_real min_sigma);

/* Adds a pair of corresponding points; returns its weight, with its Jacobian in row.
 *
 * body_point: point of the body, in the body's frame
 * normal: unit normal of the line, in the map
 * error: residual, m */
cairn_real cairn_registration_add_pair(registration *r, cairn_vec2 body_point, cairn_vec2 normal,
                                       cairn_real error, cairn_real row[3]);

/* Sets sigma from the residuals of this iteration; at least one pair. */
void cairn_registration_update_sigma(registration *r);

/* Solves for the Gauss-Newton step; returns 0 when no direction is observable and there is no
 * prior.
 *
 * basis: eigenbasis of the information
 * equations: normal equations whose residuals have the given variance, m^2
 * prior: prior of the pose; NULL: none */
int32_t cairn_registration_solve(const registration *r, const cairn_rigid_motion_basis *basis,
                                 const cairn_rigid_motion_equations *equations, cairn_real variance,
                                 const cairn_rigid_motion_pose_prior *prior, cairn_real step[3]);

/* Returns the factor that makes a sum of w J J^T the information of an M-estimator: the reciprocal
 * variance of a residual. */
cairn_real cairn_registration_information_scale(const registration *r);

/* Covariance of the pose.
 *
 * basis: eigenbasis of the information; NULL: too few pairs, the covariance is that of the prior
 * information: sum of w J J^T
 * prior: prior of the pose; NULL: none */
void cairn_registration_covariance(const registration *r, const cairn_rigid_motion_basis *basis,
                                   cairn_sym3 information,
                                   const cairn_rigid_motion_pose_prior *prior,
                                   cairn_real covariance[9]);

#endif
