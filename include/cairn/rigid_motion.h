/* rigid_motion: Gauss-Newton for one pose: rows, weak directions, priors, steps and covariances.
 *
 * Small motions of a body are taken about a centre of its own (best the centroid of its points)
 * as (dx, dy, radius * dtheta) in the map's frame: three lengths in m, comparable with each
 * other when `radius` is about the size of the body. */
#ifndef CAIRN_RIGID_MOTION_H
#define CAIRN_RIGID_MOTION_H

#include "cairn/small_matrix.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_rigid_motion {
    cairn_vec2 centre; /* in the body's frame, m */
    cairn_real radius; /* m, > 0 */
    cairn_pose map_body;
    cairn_transform transform; /* of map_body */
} cairn_rigid_motion;

/* What is known of a pose beforehand: normal, independent over (x, y, theta) in the frame of the
 * mean itself. */
typedef struct cairn_pose_prior {
    cairn_pose mean;
    cairn_real sigma_x, sigma_y; /* m, > 0 */
    cairn_real sigma_theta;      /* rad, > 0 */
} cairn_pose_prior;

/* Normal equations information * motion = -gradient. */
typedef struct cairn_normal_equations {
    cairn_sym3 information;
    cairn_real gradient[3];
} cairn_normal_equations;

/* Directions of motion by how much the observations tell of them. */
typedef struct cairn_motion_basis {
    cairn_real vectors[3][3]; /* unit eigenvectors of the information, the least observable first */
    cairn_real ratio;         /* information along the first as a share of that along the last */
    int32_t weak;             /* the first 0 ... 2 of them are not observable */
} cairn_motion_basis;

cairn_rigid_motion cairn_rigid_motion_at(cairn_pose map_body, cairn_vec2 centre, cairn_real radius);

/* row: derivative of the coordinate along the unit vector `axis` (in the map) of the body's
 * point. */
void cairn_rigid_motion_row(const cairn_rigid_motion *motion, cairn_vec2 axis,
                            cairn_vec2 body_point, cairn_real row[3]);

/* Eigenvectors of what the observations tell. A direction is weak when it has less than
 * weak_ratio, in [0, 1), of the best one's information, which must be positive. */
cairn_motion_basis cairn_motion_basis_of(cairn_sym3 information, cairn_real weak_ratio);

/* The prior's part of the normal equations, to be passed to solve() and covariance(). */
cairn_normal_equations cairn_rigid_motion_prior(const cairn_rigid_motion *motion,
                                                const cairn_pose_prior *prior);

/* Solves the sum of the observed normal equations and those of the prior (NULL: none). Weak
 * directions are taken out of the observed ones: the prior decides there, or there is no motion
 * (Zhang, Kaess and Singh 2016). A step longer than `limit` m is cut to it. 1 and step set; 0
 * when the equations are singular. Cost: about 5 units. */
int32_t cairn_motion_solve(const cairn_motion_basis *basis, const cairn_normal_equations *observed,
                           const cairn_normal_equations *prior, cairn_real limit,
                           cairn_real step[3]);

/* Moves map_body: turns it about the centre by step[2] / radius and shifts it by (step[0],
 * step[1]). */
void cairn_rigid_motion_move(cairn_rigid_motion *motion, const cairn_real step[3]);

/* Covariance of map_body, row-major over (x, y, theta), in the map's frame: the inverse of the
 * observed information without its weak directions, plus that of the prior (NULL: none). What
 * nothing is known of gets a standard deviation of 100 m of motion about the centre. basis or
 * observed NULL: nothing was observed. Cost: about 5 units. */
void cairn_rigid_motion_covariance(const cairn_rigid_motion *motion,
                                   const cairn_motion_basis *basis, const cairn_sym3 *observed,
                                   const cairn_normal_equations *prior, cairn_real covariance[9]);

#ifdef __cplusplus
}
#endif

#endif
