/* rigid_motion: Gauss-Newton step for one pose: Jacobian rows, normal equations, unobservable
 * directions, priors, covariances, and the adjoint that moves these between frames.
 *
 * Small motions of a body are parametrized about a centre (best the centroid of its points) as
 * (dx, dy, radius * dtheta) in the map's frame: three lengths in m. They are comparable with each
 * other when `radius` is about the size of the body. */
#ifndef CAIRN_RIGID_MOTION_H
#define CAIRN_RIGID_MOTION_H

#include "cairn/small_matrix.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Estimate of a pose, and the point about which its small motions are parametrized. */
typedef struct cairn_rigid_motion {
    /* Centre of rotation of small motions, in the body's frame, in m. */
    cairn_vec2 centre;
    /* Lever arm that converts rad into m, in m, > 0. */
    cairn_real radius;
    /* Current estimate: maps the body into the map. */
    cairn_pose map_body;
    /* The rigid transform of map_body. */
    cairn_transform transform;
} cairn_rigid_motion;

/* Gaussian prior of a pose, with independent errors along x, y and theta in the frame of the
 * mean. */
typedef struct cairn_rigid_motion_pose_prior {
    /* Mean, in the map. */
    cairn_pose mean;
    /* Standard deviations along and across the mean's heading, in m, > 0. */
    cairn_real sigma_x, sigma_y;
    /* Standard deviation of the heading, in rad, > 0. */
    cairn_real sigma_theta;
} cairn_rigid_motion_pose_prior;

/* Normal equations information * motion = -gradient, for a small motion in m. */
typedef struct cairn_rigid_motion_equations {
    /* Information matrix J^T W J, in 1/m^2 for weights of 1/m^2. */
    cairn_sym3 information;
    /* Gradient J^T W e of half the weighted sum of squared residuals. */
    cairn_real gradient[3];
} cairn_rigid_motion_equations;

/* Eigenbasis of an information matrix: directions of motion, from the least to the most
 * observable. */
typedef struct cairn_rigid_motion_basis {
    /* Unit eigenvectors, the least observable first. */
    cairn_real vectors[3][3];
    /* Smallest eigenvalue over the largest: the inverse condition number, 0 ... 1. */
    cairn_real inverse_condition;
    /* Number of unobservable directions, 0 ... 2: the first eigenvectors. */
    int32_t unobservable;
} cairn_rigid_motion_basis;

/* An estimate at a pose. centre: in the body's frame, in m. radius: in m, > 0. */
cairn_rigid_motion cairn_rigid_motion_at(cairn_pose map_body, cairn_vec2 centre, cairn_real radius);

/* Row of the Jacobian: the derivative of a body point's coordinate along the unit vector `axis`
 * (in the map) with respect to the small motion. body_point: in the body's frame, in m.
 *
 * row: set to the derivatives by the step's three entries
 * motion: the estimate
 * axis: unit vector in the map */
void cairn_rigid_motion_jacobian(const cairn_rigid_motion *motion, cairn_vec2 axis,
                                 cairn_vec2 body_point, cairn_real row[3]);

/* Adds a residual to normal equations.
 *
 * equations: normal equations, initially zero
 * row: row of the Jacobian
 * error: the residual, m
 * weight: its weight, 1 over a variance or without unit, >= 0 */
inline void cairn_rigid_motion_add_residual(cairn_rigid_motion_equations *equations,
                                            const cairn_real row[3], cairn_real error,
                                            cairn_real weight)
{
    cairn_sym3_add_outer(&equations->information, row, weight);
    for (int k = 0; k < 3; k++)
        equations->gradient[k] += weight * error * row[k];
}

/* Eigenbasis of the observed information. A direction is unobservable when its eigenvalue is less
 * than min_ratio, in [0, 1), of the largest eigenvalue, which must be positive. At most two
 * directions are unobservable.
 *
 * min_ratio: >= 0, < 1 */
cairn_rigid_motion_basis cairn_rigid_motion_basis_of(cairn_sym3 information, cairn_real min_ratio);

/* Normal equations of the prior at the current estimate, an argument of solve() and
 * covariance().
 *
 * motion: the current estimate
 * prior: mean and standard deviations */
cairn_rigid_motion_equations cairn_rigid_motion_prior(const cairn_rigid_motion *motion,
                                                      const cairn_rigid_motion_pose_prior *prior);

/* Solves for the Gauss-Newton step: the observed normal equations plus the prior's (NULL: none).
 * Unobservable directions are removed from the observed equations (solution remapping, Zhang, Kaess
 * and Singh 2016): along these the prior decides, or the motion is 0. A step longer than max_step m
 * is scaled to max_step. Returns 1 with the step set, or 0 when the equations are singular. Cost:
 * about 5 units.
 *
 * basis: eigenbasis of the observed information
 * observed: observed normal equations
 * prior: normal equations of the prior; NULL: none
 * step: set to the step: translation in x and y, and rotation times radius, m */
int32_t cairn_rigid_motion_solve(const cairn_rigid_motion_basis *basis,
                                 const cairn_rigid_motion_equations *observed,
                                 const cairn_rigid_motion_equations *prior, cairn_real max_step,
                                 cairn_real step[3]);

/* Applies a step to the estimate: rotates map_body about the centre by step[2] / radius and
 * translates it by (step[0], step[1]), in m.
 *
 * motion: the estimate, which is moved
 * step: translation in x and y, and rotation times radius, m */
void cairn_rigid_motion_move(cairn_rigid_motion *motion, const cairn_real step[3]);

/* Covariance of a small motion of frame b, over (x, y, theta) in that frame, as a motion in frame a:
 * Ad C Ad^T with Ad = (R, (y, -x)^T; 0, 1), the adjoint of SE(2) at a_b (Barfoot, State estimation
 * for robotics, section 7.2).
 *
 * covariance: of the motion in frame b */
cairn_sym3 cairn_rigid_motion_adjoint(cairn_pose a_b, cairn_sym3 covariance);

/* The same for frames with parallel axes.
 *
 * a_b: origin of frame b in frame a, m
 * covariance: of the motion in frame b */
cairn_sym3 cairn_rigid_motion_shift(cairn_vec2 a_b, cairn_sym3 covariance);

/* Covariance of map_body over (x, y, theta) in the map's frame, row-major, in m^2, m rad and rad^2:
 * the inverse of the information, which is the observed information without its unobservable
 * directions plus the prior's (NULL: none). basis or observed NULL: no observations. A direction
 * without information gets a standard deviation of 100 m of motion about the centre. Cost: about 5
 * units.
 *
 * covariance: [3][3] set to the covariance
 * motion: the estimate
 * basis: eigenbasis of the observed information
 * observed: observed information
 * prior: normal equations of the prior; NULL: none */
void cairn_rigid_motion_covariance(const cairn_rigid_motion *motion,
                                   const cairn_rigid_motion_basis *basis,
                                   const cairn_sym3 *observed,
                                   const cairn_rigid_motion_equations *prior,
                                   cairn_real covariance[9]);

#ifdef __cplusplus
}
#endif

#endif
