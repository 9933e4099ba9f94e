/* map_quality: evaluation of maps and poses: map entropy, beam likelihood, pose errors, relation
 * errors. */
#ifndef CAIRN_MAP_QUALITY_H
#define CAIRN_MAP_QUALITY_H

#include "cairn/occupancy_grid.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Quadrants of a grid, sides halved and rounded down; north is up. */
enum {
    /* north-west: lower columns, upper rows */
    CAIRN_MAP_QUALITY_QUADRANT_NW,
    /* north-east: upper columns, upper rows */
    CAIRN_MAP_QUALITY_QUADRANT_NE,
    /* south-east: upper columns, lower rows */
    CAIRN_MAP_QUALITY_QUADRANT_SE,
    /* south-west: lower columns, lower rows */
    CAIRN_MAP_QUALITY_QUADRANT_SW,
    /* number of quadrants */
    CAIRN_MAP_QUALITY_QUADRANTS
};

/* Entropy of an occupancy grid, in all and by quadrant. */
typedef struct cairn_map_quality_entropy {
    /* nats: entropy -sum p log p + (1 - p) log(1 - p) over the observed cells */
    cairn_real total;
    /* nats: entropy by quadrant, indexed by CAIRN_MAP_QUALITY_QUADRANT_... */
    cairn_real quadrant[CAIRN_MAP_QUALITY_QUADRANTS];
    /* number of observed cells */
    int64_t cells;
} cairn_map_quality_entropy;

/* Adds the entropy of rows first_row ... first_row + rows - 1 to *entropy, which the caller sets to
 * 0 before. p is the probability that a beam stops on a chord as long as the cell's side. Compare
 * only maps of one resolution. CAIRN_BAD_ARGUMENT: NULL, or rows outside the grid. Cost: linear in
 * the cells of these rows. Source: Adluru 2008, section 10.
 *
 * first_row, rows: range of rows
 * entropy: sums to which the entropy is added */
CAIRN_CHECKED cairn_status cairn_map_quality_entropy_add(const cairn_occupancy_grid *grid,
                                                         int32_t first_row, int32_t rows,
                                                         cairn_map_quality_entropy *entropy);

/* Computes the log-likelihood of a beam: it passes all cells before its end and, when hit is not 0,
 * stops in the cell of its end, each by its chord. The likelihood is mixed with `least`, in (0, 1),
 * the uniform likelihood of unmodelled causes. Unobserved cells let beams pass. The part outside
 * the grid counts as passed, an end there as never. CAIRN_BAD_ARGUMENT: NULL, or `least`.
 * CAIRN_NOT_FINITE. Cost: linear in the cells on the beam. Source: Eliazar and Parr 2004.
 *
 * from, to: m: start and end of the beam
 * log_likelihood: set to the logarithm, nats
 * hit: 0: the beam ends without a surface
 * least: uniform likelihood, > 0, < 1 */
CAIRN_CHECKED cairn_status cairn_map_quality_beam_likelihood(const cairn_occupancy_grid *grid,
                                                             cairn_vec2 from, cairn_vec2 to,
                                                             int32_t hit, cairn_real least,
                                                             cairn_real *log_likelihood);

/* Mean absolute errors of a trajectory. */
typedef struct cairn_map_quality_pose_errors {
    cairn_real x, y;  /* m, mean absolute errors */
    cairn_real theta; /* rad, mean absolute error */
} cairn_map_quality_pose_errors;

/* Computes the mean absolute errors E(x), E(y), E(theta) after both trajectories are moved so that
 * their first poses are the identity. estimate, truth: [count]. CAIRN_BAD_ARGUMENT: NULL.
 * CAIRN_EMPTY: count < 1. CAIRN_NOT_FINITE. Cost: linear in count.
 *
 * errors: set to the errors */
CAIRN_CHECKED cairn_status cairn_map_quality_pose_errors_of(const cairn_pose *estimate,
                                                            const cairn_pose *truth, int32_t count,
                                                            cairn_map_quality_pose_errors *errors);

/* Sums over relations; the caller sets them to 0 before the first. */
typedef struct cairn_map_quality_relation_sums {
    /* number of relations */
    int64_t count;
    /* sums of translation errors in m and of absolute rotation errors in rad */
    cairn_real distance, angle;
    /* sums of their squares, m^2 and rad^2 */
    cairn_real distance_squared, angle_squared;
} cairn_map_quality_relation_sums;

/* Adds the error of a relation: the difference between a reference relative pose, second in the
 * frame of first, and that of the two estimated poses (Kümmerle et al. 2009). CAIRN_BAD_ARGUMENT:
 * NULL. CAIRN_NOT_FINITE.
 *
 * sums: sums to which the error is added
 * reference: true pose of the second scan in the frame of the first */
CAIRN_CHECKED cairn_status cairn_map_quality_relation_add(cairn_map_quality_relation_sums *sums,
                                                          cairn_pose reference,
                                                          cairn_pose map_first,
                                                          cairn_pose map_second);

/* Statistics of the errors of relations. */
typedef struct cairn_map_quality_relation_errors {
    /* m, m, m^2: mean, standard deviation, mean square */
    cairn_real distance_mean, distance_sd, distance_squared;
    /* rad, rad, rad^2: likewise */
    cairn_real angle_mean, angle_sd, angle_squared;
} cairn_map_quality_relation_errors;

/* Returns the statistics of the sums; all 0 without relations. */
cairn_map_quality_relation_errors
cairn_map_quality_relation_errors_of(const cairn_map_quality_relation_sums *sums);

#ifdef __cplusplus
}
#endif

#endif
