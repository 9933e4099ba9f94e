/* map_quality: how good a map and its poses are: entropy, likelihood of beams, pose errors,
 * relations. */
#ifndef CAIRN_MAP_QUALITY_H
#define CAIRN_MAP_QUALITY_H

#include "cairn/occupancy_grid.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Quadrants of a grid, halves rounded down; north is up. */
enum {
    CAIRN_QUADRANT_NW,
    CAIRN_QUADRANT_NE,
    CAIRN_QUADRANT_SE,
    CAIRN_QUADRANT_SW,
    CAIRN_QUADRANTS
};

typedef struct cairn_map_entropy {
    /* -sum p log p + (1 - p) log(1 - p), natural log, over the cells that beams have seen */
    cairn_real whole;
    cairn_real quadrant[CAIRN_QUADRANTS];
    /* seen */
    int64_t cells;
} cairn_map_entropy;

/* Adds the cells of rows first_row ... first_row + rows - 1 to *entropy, which is all 0 at
 * first. p is the probability that a beam stops on a chord as long as the cell's side. Compare
 * maps of one resolution only. CAIRN_BAD_ARGUMENT: NULL, rows outside the grid. Cost: linear in
 * the cells of these rows. Source: Adluru 2008, section 10. */
CAIRN_CHECKED cairn_status cairn_map_entropy_add(const cairn_occupancy_grid *grid,
                                                 int32_t first_row, int32_t rows,
                                                 cairn_map_entropy *entropy);

/* Logarithm of the probability of a beam: that it passes all cells before its end and, when hit
 * is not 0, stops in the cell of its end, each by its chord; mixed with `least`, in (0, 1), for
 * what no map explains. Cells never seen let beams pass. The part of a beam outside the grid
 * counts as passed, an end there as never. CAIRN_BAD_ARGUMENT: NULL, least. CAIRN_NOT_FINITE.
 * Cost: the cells on the beam. Source: Eliazar and Parr 2004. */
CAIRN_CHECKED cairn_status cairn_map_beam_likelihood(const cairn_occupancy_grid *grid,
                                                     cairn_vec2 from, cairn_vec2 to, int32_t hit,
                                                     cairn_real least, cairn_real *log_likelihood);

typedef struct cairn_pose_errors {
    cairn_real x, y;  /* m, mean of absolute differences */
    cairn_real theta; /* rad */
} cairn_pose_errors;

/* E(x), E(y), E(theta) after both sets have been moved so that their first poses are the
 * identity. estimate, truth: [count]. CAIRN_BAD_ARGUMENT: NULL. CAIRN_EMPTY: count < 1.
 * CAIRN_NOT_FINITE. Cost: linear. */
CAIRN_CHECKED cairn_status cairn_pose_errors_of(const cairn_pose *estimate, const cairn_pose *truth,
                                                int32_t count, cairn_pose_errors *errors);

/* Sums over relations, all 0 at first. */
typedef struct cairn_relation_sums {
    int64_t count;
    /* of the differences: lengths in m, absolute angles in rad */
    cairn_real distance, angle;
    /* of these */
    cairn_real distance_squared, angle_squared;
} cairn_relation_sums;

/* Adds the difference of a reference relative pose, second seen from first, and the estimated
 * poses of the two (Kümmerle et al. 2009). CAIRN_BAD_ARGUMENT: NULL. CAIRN_NOT_FINITE. */
CAIRN_CHECKED cairn_status cairn_relation_add(cairn_relation_sums *sums, cairn_pose reference,
                                              cairn_pose map_first, cairn_pose map_second);

typedef struct cairn_relation_errors {
    /* m, m, m^2: mean, standard deviation, mean square */
    cairn_real distance_mean, distance_sd, distance_squared;
    /* rad */
    cairn_real angle_mean, angle_sd, angle_squared;
} cairn_relation_errors;

/* All 0 without relations. */
cairn_relation_errors cairn_relation_errors_of(const cairn_relation_sums *sums);

#ifdef __cplusplus
}
#endif

#endif
