/* Private state of the aligner module. */
#ifndef CAIRN_ALIGNMENT_ALIGNER_WORK_H
#define CAIRN_ALIGNMENT_ALIGNER_WORK_H

#include "cairn/aligner.h"
#include "cairn/registration.h"
#include "cairn/rigid_motion.h"
#include "cairn/visibility.h"
#include "src/base/object.h"
#include "src/base/step.h"
#include "src/containers/heap.h"
#include "src/containers/min_cut.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_aligner_parameters;

enum {
    /* bins of a visibility profile */
    ALIGNER_VIEW_BINS = 512,
    /* sectors of these bins, as coarse bearings */
    ALIGNER_VIEW_SECTORS = 32,
    /* direction bins of the wall index */
    ALIGNER_WALL_DIRECTIONS = 16,
    /* hash buckets of the wall index, by direction and position */
    ALIGNER_WALL_BUCKETS = 1024,
    /* hypotheses per block whose best one is stored */
    ALIGNER_HYPOTHESIS_BLOCK = 32,
    /* consecutive points in one bounding circle */
    ALIGNER_PATCH_POINTS = 8,
    /* relative poses of one pair that are compared */
    ALIGNER_MAX_TRIALS = 12,
    /* hypotheses stored per pair, at most */
    ALIGNER_MAX_KEPT_PER_PAIR = 4,
    /* nearest scans of each scan, ... */
    ALIGNER_NEAREST_SCANS = 24,
    /* ... and with the scans that it is among the nearest of, at most */
    ALIGNER_MAX_NEIGHBOURS = 48,
    /* raster cells per shift */
    ALIGNER_CELLS_PER_SHIFT = 4,
    /* peaks of a relocalization that are refined, ... */
    ALIGNER_MAX_PEAKS = 12,
    /* ... and translations along the walls */
    ALIGNER_MAX_TRANSLATIONS = 16,
    /* iteration of the joint solution from which the segments' walls are fixed */
    ALIGNER_FIXED_ASSOCIATION_FROM = 7
};

/* m: lever arm that weights rotations against translations */
#define ALIGNER_ARM_M CAIRN_REAL(1.5)

/* Work units: a unit is about three point lookups, or eight pairs of distant scans. */
enum { ALIGNER_POINTS_PER_UNIT = 3, ALIGNER_FAR_PAIRS_PER_UNIT = 8 };

/* Place of return of a step: it continues when the operation that follows is charged.
 *
 * point: field of the resume points */
#define ALIGNER_CHARGE(point, units)                                                               \
    CAIRN_STEP_UNTIL(aligner->resume.point, cairn_aligner_charge(aligner, budget, units))

/* The same for items of a loop that cost little: one unit is charged before items 0, each, 2 each,
 * ... */
#define ALIGNER_CHARGE_EVERY(point, each, i)                                                       \
    do {                                                                                           \
        if ((i) % (each) == 0)                                                                     \
            ALIGNER_CHARGE(point, 1);                                                              \
    } while (0)

/* Resume points of the alignment, of its current phase, of a part of the phase and of an item of
 * the part; of an evaluation, of a relaxation, and of what evaluates the initial poses. */
typedef struct aligner_resume {
    uint16_t align, phase, iteration, part, item, evaluation, relax, prior, sigmas;
} aligner_resume;

/* A segment of a scan, in its frame, with the moments of its hits. */
typedef struct aligner_segment {
    cairn_vec2 a, direction;
    cairn_real length;
    cairn_real weight;      /* sum of 1 / variance across the line; 0: no hits */
    cairn_vec2 mean;        /* weighted mean of the hits, m */
    cairn_sym2 scatter;     /* scatter matrix: weighted squares about the mean */
    cairn_real min_scatter; /* its least eigenvalue: squares across the hits' own best line */
    int32_t scan, wall;     /* wall: -1 none */
    int32_t is_short;       /* 1: a short segment of a few hits, its own direction is poor */
} aligner_segment;

typedef struct aligner_point {
    cairn_vec2 position;
    int32_t segment;
} aligner_point;

/* Bounding circle of consecutive points. */
typedef struct aligner_patch {
    cairn_vec2 middle;
    cairn_real radius;
} aligner_patch;

/* A candidate neighbour. */
typedef struct aligner_neighbour {
    cairn_real nearness;
    int32_t scan;
} aligner_neighbour;

/* Visibility profile of a scan with its arrays; surfaces are the segments, counted from the scan's
 * first. */
typedef struct aligner_view {
    cairn_visibility visibility;
    uint16_t range[ALIGNER_VIEW_BINS];
    uint8_t surface[ALIGNER_VIEW_BINS];
    /* greatest range of a sector and both beside it, in steps */
    uint16_t sector_max[ALIGNER_VIEW_SECTORS];
} aligner_view;

/* Normal equations of a rigid body's small motion about a centre, in m, m and rad. */
typedef struct aligner_sums {
    cairn_rigid_motion_equations equations;
    int32_t pairs;
} aligner_sums;

typedef struct aligner_scan {
    int32_t first_point, end_point, first_segment, end_segment, first_patch;
    /* bounding circle of sensor and points */
    cairn_vec2 sensor, middle;
    cairn_real radius;
    /* m: from the origin of its frame to the far side of the circle */
    cairn_real extent;
    /* middle of the visible directions, from the sensor */
    cairn_vec2 axis;
    /* cosine and sine of half the field of view; cosine <= 0: half a turn or more */
    cairn_real view_cosine, view_sine;
    cairn_pose initial;
    /* m: from its pose to the initial one, in the map of a joint translation */
    cairn_vec2 initial_offset;
    /* cluster; next member of it, -1 */
    int32_t cluster, next_in_cluster;
    /* 1: weakly observable: it could be translated along its shared walls */
    int32_t is_weak;
    /* 1: one of the reference scans of the covariances */
    int32_t is_reference;
    /* ALIGNER_RELAX_MERGED, ... */
    int32_t relax_state;
    /* equal for scans that were merged into another cluster together */
    int32_t merge_event;
    /* unit direction of the first unknown of the joint solution */
    cairn_vec2 first_axis;
    /* normal equations of its last relaxation, and the gradient accumulated since */
    aligner_sums normal_equations;
    /* 1: anchored by the last completed alignment */
    int32_t was_anchored;
    cairn_real support;
    /* nats: log-likelihood ratio of its pose in the largest cluster, at the last evaluation */
    cairn_real log_likelihood_ratio;
    int32_t neighbour_count;
} aligner_scan;

/* A cluster: scans with known relative poses. */
typedef struct aligner_cluster {
    int32_t head, size;
    int32_t stamp; /* changes with every change of its poses */
} aligner_cluster;

/* Residuals of a cluster's initial poses after its best common motion (gauge): sums over its
 * scans. */
typedef struct aligner_prior_sums {
    int32_t stamp;         /* of the cluster at that time */
    cairn_transform gauge; /* the gauge: nearly the best */
    cairn_vec2 origin;     /* a point near the centre of the scans after it */
    cairn_real count;
    /* sums of positions u relative to the origin, and of errors e */
    cairn_vec2 positions, errors;
    /* sums of u.u, e.e, u.e and of the cross product u x e */
    cairn_real squared_positions, squared_errors, dot_products, cross_products;
    cairn_real sum_angle, sum_angle2;      /* sums of heading errors and of their squares */
    cairn_real cosine, sine;               /* sums of their cosines and sines */
    cairn_real max_error, max_angle_error; /* greatest error along an axis, and of a heading */
    cairn_real radius;                     /* greatest distance of a position from the origin */
    int32_t estimate_stamp; /* stamp at which squares and squares_angle were computed */
    cairn_real squares, squares_angle;
} aligner_prior_sums;

/* A hypothesis of the relative pose of two scans: `first` in the frame of `second`. */
typedef struct aligner_hypothesis {
    int32_t first, second;
    cairn_pose second_first;
    /* nats: log-likelihood ratio of the last evaluation; reduced by competing hypotheses */
    cairn_real score, rank;
    /* stamps of the clusters at that evaluation; -1: none yet */
    int32_t first_stamp, second_stamp;
    int32_t state;
    /* linked lists of the hypotheses of the first and of the second scan, -1; a link is 2 * index +
     * side */
    int32_t next[2];
} aligner_hypothesis;

/* Relaxation state: a scan merged into another cluster, and one that needs relaxation. */
enum { ALIGNER_RELAX_MERGED = 1, ALIGNER_RELAX_DIRTY = 2 };

/* States of a hypothesis. */
enum { ALIGNER_EVALUATED = 1, ALIGNER_COMPARED = 2, ALIGNER_VERIFIED = 3, ALIGNER_REJECTED = 4 };

typedef struct aligner_count {
    /* points on the same surface, on another one, in free space */
    cairn_real same_surface, other_surface, free_space;
    /* share of those on the same surface that lies across the axis of a split count */
    cairn_real across;
} aligner_count;

/* A walk over the patches of a scan that another one may see: their points are counted, or added to
 * normal equations. */
typedef struct aligner_walk {
    int32_t from, to;
    cairn_transform to_from; /* the frame of `from` in that of `to` */
    cairn_real gate;
    aligner_count *count;
    cairn_vec2 axis, to_axis; /* axis of a split count in the map and in the frame of `to`, or 0 */
    cairn_real least;         /* counting ends when the log-likelihood ratio cannot exceed it */
    /* Of normal equations: poses in the map, +1 when `from` moves and -1 when `to` does. */
    aligner_sums *sums; /* NULL: points are counted */
    cairn_transform map_from, map_to;
    cairn_rigid_motion motion;
    cairn_real sign;
    /* next patch; points [at, end) of the current one, and the end of the scan's points */
    int32_t patch, at, end, last;
    int32_t is_added; /* 1: the points [at, end) are added */
    /* segment of the last point, its direction, and its points on the same surface */
    int32_t segment, same;
    cairn_vec2 direction;
    /* lookups of points done, tests of two patches as one; and those charged but not done yet */
    int32_t lookups, lookups_charged;
    int32_t units_charged;
    uint16_t resume, pair_resume;
} aligner_walk;

/* Pairwise evaluation (registration and scoring) of cluster (or single scan) `moving` against
 * cluster `fixed`, at the pose fixed_moving. */
typedef struct aligner_evaluation {
    int32_t is_active;
    int32_t moving, fixed;     /* clusters */
    cairn_transform pose;      /* fixed_moving */
    int32_t round, rounds;     /* rounds of refinement, then one of counting */
    int32_t outer, inner;      /* the clusters, the smaller one first */
    int32_t member, neighbour; /* current member of outer, and which of its neighbours */
    cairn_vec2 centre;
    aligner_sums sums;
    aligner_count count;             /* point counts of the evaluation, ... */
    cairn_real log_likelihood_ratio; /* ... and their log-likelihood ratio, nats */
    cairn_real lower_bound;          /* counting ends when the log-likelihood ratio falls to it */
    cairn_real log_prior;            /* log-likelihood of the initial poses, nats */
    cairn_real weak_direction[3];    /* least observable unit motion about the centre: m, m, rad */
} aligner_evaluation;

/* Relaxation (nonlinear Gauss-Seidel) of the scans of a cluster: all, or the merged and dirty
 * ones. */
typedef struct aligner_relax {
    int32_t is_active, all;
    int32_t second_pass; /* 0: neighbours that the scan was not yet relaxed with, 1: the others */
    int32_t cluster, round, rounds;
    cairn_real gate;
    int32_t scan, neighbour; /* current scan, and which of its neighbours */
    int32_t visited;         /* scans visited */
    aligner_sums sums;
    aligner_sums pairs[ALIGNER_MAX_NEIGHBOURS]; /* normal equations with each neighbour */
} aligner_relax;

typedef struct aligner_peak {
    cairn_pose pose;
    cairn_real score;
} aligner_peak;

/* A wall: a line that segments of several scans share, in the map. */
typedef struct aligner_wall {
    cairn_vec2 normal;
    cairn_real offset, low, high; /* n p = offset; extent along the direction */
    int32_t next_in_bucket;       /* next wall of its bucket, -1 */
    int32_t bucket;               /* its bucket in the wall index */
    cairn_vec2 middle;
    cairn_real weight;
    cairn_sym2 scatter;
    int32_t scan_count; /* scans with a segment on it; 2: two or more */
    int32_t first_scan, node;
} aligner_wall;

/* Item of a phase: scan, neighbour, and two inner counters. */
typedef struct aligner_cursor {
    int32_t scan, neighbour, item, inner;
} aligner_cursor;

/* Estimate of the standard deviations of the initial poses: sums over the clusters so far. */
typedef struct aligner_sigmas {
    int32_t cluster;
    cairn_real squares, squares_angle, count;
} aligner_sigmas;

/* The neighbours of a scan, and the relative poses of a pair that are tried. */
typedef struct aligner_pair_search {
    int32_t second;           /* second scan of the current pair */
    cairn_transform expected; /* its relative pose by the initial poses, ... */
    cairn_real least_cosine;  /* ... and the cosine of the greatest heading error */
    int32_t trial_count, trial_at;
    /* the current trial: end of the segments, or round; pose, points, and normal equations */
    int32_t end;
    cairn_transform pose;
    aligner_count count;
    aligner_sums sums;
    int32_t nearest_count;
    aligner_hypothesis trial[ALIGNER_MAX_TRIALS];
    aligner_neighbour nearest[ALIGNER_NEAREST_SCANS]; /* by falling nearness */
} aligner_pair_search;

/* The best hypothesis, and those that compete with it. */
typedef struct aligner_merging {
    int32_t chosen, side;
    /* scan and link of the next competing hypothesis; links passed; the competing one, -1: none */
    int32_t competing_scan, competing_link, passed, competing;
    cairn_real competing_odds; /* sum of the odds of the compared ones */
    int32_t best;              /* the hypothesis of the greatest rank, -1 */
    cairn_real shift[3];
    cairn_vec2 shift_centre;
} aligner_merging;

/* The raster that a scan is relocalized in, and its turns. */
typedef struct aligner_raster {
    int32_t side, half_window; /* in cells */
    int32_t turns, turn;
    cairn_vec2 corner; /* m */
    cairn_real cell;   /* m */
    /* current scan and bearing; cells [at, last) of the ray that are left, and where it is, in
     * cells */
    int32_t scan, bearing, at, last;
    cairn_vec2 place, step;
} aligner_raster;

/* A scan, or its cluster, that is relocalized or translated. */
typedef struct aligner_move {
    /* direction in which a scan is translated */
    cairn_vec2 weak_direction;
    cairn_pose predicted;
    int32_t peak_count, peak_index;
    cairn_transform previous_pose, best_pose;
    /* log-likelihood ratios: before, of the best pose, and of the second-best one */
    cairn_real before_score, best_score, second_best_score;
    cairn_real line_nats; /* gain of the surfaces on walls so far, nats */
    /* the largest cluster when the search began */
    int32_t largest;
    /* the scan's cluster, -1: the largest one */
    int32_t home;
    /* the cluster that is moved: home as a whole, or scan_count for the scan alone */
    int32_t moving;
    aligner_peak peaks[ALIGNER_MAX_TRANSLATIONS];
} aligner_move;

/* Search for the wall nearest to a segment. */
typedef struct aligner_wall_search {
    const aligner_segment *segment;
    cairn_vec2 a, b, direction; /* the segment in the map */
    cairn_real gate, far;       /* m: gate across, and greatest gap */
    cairn_real slope;           /* tangent of the greatest angle between wall and segment */
    int32_t west, east, south, north, u, v; /* tiles */
    int32_t first, ways, way;               /* directions */
    int32_t next;                           /* next wall of the bucket, -1 */
    int32_t passed;                         /* tiles and walls passed */
    cairn_real least;                       /* least distance, and its wall, -1 */
    int32_t wall;
} aligner_wall_search;

/* Datum of the covariances: they are those after the common motion of the reference scans. */
typedef struct aligner_datum {
    int32_t pass;      /* 1: reference scans by their own walls; 2: by the first pass */
    int32_t column;    /* current coordinate: x, y, rotation */
    int32_t is_spoilt; /* 1: a reference scan has turned out not to be observable */
    cairn_real kept;   /* scans that are observable after the common motion */
    /* weights of a translation and of a rotation: reference scans, m^2 */
    cairn_real count, squares;
    cairn_vec2 centre;
    cairn_real covariance[9]; /* of x, y and the rotation about the centre */
} aligner_datum;

/* Joint least squares over poses and walls. */
typedef struct aligner_joint {
    int32_t round, at;
    /* 1: there is no joint solution */
    int32_t is_skipped;
    aligner_wall_search search;
    heap_sorting sorting;
    /* m: largest step of the solution */
    cairn_real max_step;
    /* 1: no scan is translated any more */
    int32_t translations_done;
    /* 1: joint translations of groups have been tried; the prior at the current pose is narrower */
    int32_t is_damped;
    cairn_real determinant; /* greatest determinant of the scans' information so far */
    /* link of the next segment */
    int32_t link;
    /* gauge of the cluster gauge_part */
    cairn_transform gauge;
    int32_t gauge_part;
    aligner_datum datum;
    /* chi-squared and m^2 above which a segment loses weight */
    cairn_real robust_chi2, robust_squared_distance;
} aligner_joint;

/* A pair of scans in a joint translation; its ends are those of the edge of the same index. */
typedef struct aligner_shift_pair {
    /* nats: log-likelihood ratio at the current poses; that of the points on surfaces across each
     * direction alone */
    cairn_real base, across[2];
    /* nats: gain when one end moves alone, as evaluated or expected */
    cairn_real gain[2];
    uint8_t is_known[2]; /* 1: evaluated */
    uint8_t has_violation;
} aligner_shift_pair;

/* Joint translations of groups of scans. */
typedef struct aligner_shift {
    int32_t pair_count, max_pairs;
    int32_t is_full; /* 1: there are more pairs than max_pairs */
    cairn_vec2 axis; /* the first direction */
    int32_t direction, round, index;
    int32_t has_gained; /* 1: a set of the round moved */
    cairn_real metres;  /* the current shift */
    /* current pair and end; cuts so far; pairs of the last that had not been evaluated */
    int32_t pair, side, cuts, unknown;
    int32_t is_move; /* 1: the last cut gains enough, all its pairs evaluated */
    aligner_count count;
    min_cut cut;
} aligner_shift;

struct cairn_aligner {
    aligner_resume resume;
    aligner_cursor cursor;
    int32_t scan_count, segment_count, short_segment_count, point_count, patch_count,
        hypothesis_count, wall_count, node_count;
    aligner_scan *scans;
    /* [max_scans + 1] poses in the frame of the cluster; the last for a tried scan */
    cairn_transform *poses;
    /* [max_scans + 1] */
    aligner_cluster *clusters;
    /* [max_scans + 1] */
    aligner_prior_sums *prior_sums;
    aligner_segment *segments;
    aligner_point *points;
    /* [max_scans * ALIGNER_MAX_NEIGHBOURS] */
    uint16_t *neighbours;
    /* [max_hypotheses] */
    aligner_hypothesis *hypotheses;
    /* [shift.max_pairs] in the memory of the hypotheses */
    aligner_shift_pair *shift_pairs;
    min_cut_edge *shift_edges;
    /* [max_scans] */
    min_cut_node *shift_nodes;
    /* [max_scans] first hypothesis of each scan, -1 */
    int32_t *links;
    /* [max_hypotheses / HYPOTHESIS_BLOCK + 1] best hypothesis of each block, -1: none */
    int32_t *best_of_block;
    /* [max_segments + max_short_segments] */
    aligner_wall *walls;
    /* [max_segments + max_short_segments] segments by decreasing weight */
    int32_t *order;
    /* [max_cells] search raster: direction bits and free space */
    uint16_t *cells;
    /* [max_cells / CELLS_PER_SHIFT] votes of each shift */
    int32_t *votes;
    /* [3 * nodes] right-hand side of the joint solution */
    cairn_real *rhs;
    /* [max_scans] */
    cairn_aligner_pose *results;
    cairn_block_solver *solver;
    /* [max_points / ALIGNER_PATCH_POINTS + max_scans] */
    aligner_patch *patches;
    /* [max_scans] */
    aligner_view *views;
    /* standard deviations of the initial poses, as estimated, m and rad */
    cairn_real sigma, sigma_angle;
    /* 1: clusters and poses are those of a completed alignment of the current scans */
    int32_t has_ended;
    /* 1: warm start: only scans that were not placed are relocalized */
    int32_t is_warm_start;
    /* number of changes, the source of stamps */
    int32_t change_count;
    /* the last commit point that iterate() returned at */
    int32_t reported_commit;
    int32_t units_charged;
    int32_t is_running, stops_at_commits;
    aligner_merging merging;
    aligner_sigmas sigmas;
    int32_t visited; /* scans that the prior visits one by one */
    /* rounds of relocalization and passes of translation so far; scans that the last changed */
    int32_t relocalization_rounds, translation_passes, changed_scans;
    cairn_aligner_params params;
    cairn_aligner_result result;
    aligner_raster raster;
    aligner_joint joint;
    aligner_evaluation evaluation;
    aligner_move move;
    aligner_walk walk;
    aligner_pair_search pairs;
    aligner_relax relax;
    aligner_shift shift;
    /* first wall of each bucket, -1; at the end the long walls of each direction */
    int32_t buckets[ALIGNER_WALL_BUCKETS + ALIGNER_WALL_DIRECTIONS];
};

/* Returns a count that changes with every commit point. */
static inline int32_t aligner_commits(const cairn_aligner *aligner)
{
    return aligner->change_count + aligner->result.iterations;
}

/* ---- aligner_charge.c: charges ---- */

/* Charges an operation: 1 when it may be done; 0 when the budget is used up, or iterate() returns
 * at a commit point. */
int cairn_aligner_charge(cairn_aligner *aligner, cairn_budget *budget, int32_t units);

/* The same for a pass over the scans that reads or sets one field. */
int cairn_aligner_charge_scans(cairn_aligner *aligner, cairn_budget *budget);

/* ---- aligner_beams.c: scans ---- */

void cairn_aligner_fill_scan(cairn_aligner *aligner, const cairn_scan_view *view,
                             cairn_pose initial);

/* ---- aligner_scan.c: pairs of scans ---- */

/* Starts to count the points of `from` by the visibility profile of `to`. */
void cairn_aligner_begin_count(const cairn_aligner *aligner, aligner_walk *walk, int32_t from,
                               int32_t to, cairn_transform to_from, cairn_real gate,
                               aligner_count *count);

/* Splits the count that has begun: points on surfaces across an axis in the frame of `to` are
 * counted apart, too, by the squared sine. */
void cairn_aligner_split_count(aligner_walk *walk, cairn_vec2 axis);

/* Starts to add the point-to-line normal equations of the points of `from`, which moves, against
 * the surfaces of `to`. Both poses and centre are in one frame. */
void cairn_aligner_begin_equations(const cairn_aligner *aligner, aligner_walk *walk, int32_t from,
                                   int32_t to, cairn_transform map_from, cairn_transform map_to,
                                   cairn_real gate, cairn_vec2 centre, aligner_sums *sums);

/* Exchanges the scans of a walk: the points of `to` follow, against `from`. */
void cairn_aligner_turn_walk(const cairn_aligner *aligner, aligner_walk *walk);

/* Steps: the points of one scan, or of both. 1 at the end, 0 when the budget is used up. */
int cairn_aligner_walk_points(const cairn_aligner *aligner, aligner_walk *walk,
                              cairn_budget *budget);
int cairn_aligner_walk_pair(const cairn_aligner *aligner, aligner_walk *walk, cairn_budget *budget);
cairn_real cairn_aligner_log_likelihood_ratio(const cairn_aligner *aligner, aligner_count count);

/* Returns a pose moved by (x, y, rotation) about a centre. */
cairn_transform cairn_aligner_moved(cairn_transform pose, cairn_vec2 centre,
                                    const cairn_real motion[3]);

/* Solves the normal equations; returns 0 with fewer than 3 pairs. */
int32_t cairn_aligner_solve(const aligner_sums *sums, cairn_real motion[3]);

/* Computes eigenvalues and unit eigenvectors of an information over (x, y, rotation), the least
 * observable first; rotations are lengths at ALIGNER_ARM_M. */
void cairn_aligner_eigen(cairn_sym3 information, cairn_real values[3], cairn_real vectors[3][3]);

/* Returns 0 when a circle in the map lies wholly outside a scan's field of view, rotated by up to
 * `turned` rad either way. */
int cairn_aligner_may_see(const aligner_scan *scan, cairn_transform map_scan, cairn_real turned,
                          cairn_vec2 middle, cairn_real radius);

/* Returns the k-th neighbour of a scan: a scan that it is compared with; the relation is
 * symmetric. */
static inline int32_t cairn_aligner_neighbour(const cairn_aligner *aligner, int32_t scan, int32_t k)
{
    return aligner->neighbours[ALIGNER_MAX_NEIGHBOURS * scan + k];
}

/* Returns the units of a look at each neighbour of a scan. */
static inline int32_t cairn_aligner_passing_units(const cairn_aligner *aligner, int32_t scan)
{
    return 1 + aligner->scans[scan].neighbour_count / ALIGNER_FAR_PAIRS_PER_UNIT;
}

/* Returns 1 when the second scan is one of the first `most` neighbours of the first. */
int cairn_aligner_has_neighbour(const cairn_aligner *aligner, int32_t scan, int32_t neighbour,
                                int32_t most);

/* Returns 1 when the bounding circles of two scans overlap and one is in the other's field of
 * view. */
int32_t cairn_aligner_may_overlap(const cairn_aligner *aligner, int32_t i, int32_t j,
                                  cairn_transform map_i, cairn_transform map_j);

/* Returns the number of patches of two scans that the other one may see; j in the frame of i is
 * i_j. */
int32_t cairn_aligner_visible_patches(const cairn_aligner *aligner, int32_t i, int32_t j,
                                      cairn_transform i_j);
int32_t cairn_aligner_points_of(const cairn_aligner *aligner, int32_t scan);

int32_t cairn_aligner_is_near(cairn_transform a, cairn_transform b, cairn_real metres,
                              cairn_real cosine);

/* ---- Steps: 1 at the end, 0 when the budget is used up ---- */

/* Finds the neighbours of all scans. */
int cairn_aligner_find_neighbours(cairn_aligner *aligner, cairn_budget *budget);

/* Registers pairs of scans; stores hypotheses. */
int cairn_aligner_register_pairs(cairn_aligner *aligner, cairn_budget *budget);

/* Merges clusters, the most certain hypothesis first. In a later round of relocalization all are
 * evaluated anew, as relocalized scans may let clusters merge. */
int cairn_aligner_merge(cairn_aligner *aligner, cairn_budget *budget);

/* Runs the evaluation, and the relaxation if there is one, that has begun. */
int cairn_aligner_evaluate(cairn_aligner *aligner, cairn_budget *budget);
int cairn_aligner_relax(cairn_aligner *aligner, cairn_budget *budget);

/* Counts the support of all scans. */
int cairn_aligner_count_support(cairn_aligner *aligner, cairn_budget *budget);

/* Relocalizes the scans that fit badly, one round. */
int cairn_aligner_relocalize(cairn_aligner *aligner, cairn_budget *budget);

/* Solves for all poses and walls, and writes the results. */
int cairn_aligner_solve_jointly(cairn_aligner *aligner, cairn_budget *budget);

/* Translates the scans along their weakly observable directions. */
int cairn_aligner_translate(cairn_aligner *aligner, cairn_budget *budget);

/* Translates groups of scans along the directions of the walls. */
int cairn_aligner_shift(cairn_aligner *aligner, cairn_budget *budget);

/* Orders the segments; assigns them to walls. */
int cairn_aligner_sort(cairn_aligner *aligner, cairn_budget *budget);
int cairn_aligner_associate(cairn_aligner *aligner, cairn_budget *budget);

/* ---- aligner_wall.c ---- */

static inline int cairn_aligner_has_fixed_association(const cairn_aligner *aligner)
{
    return aligner->joint.round >= ALIGNER_FIXED_ASSOCIATION_FROM;
}

/* Returns the distance of a segment from a wall, m, gaps added; negative: no association. */
cairn_real cairn_aligner_wall_distance(const cairn_aligner *aligner, const aligner_segment *segment,
                                       const aligner_wall *wall);

/* Starts the search for the wall nearest to a segment, of equal ones the first; a step of it. */
void cairn_aligner_begin_search(cairn_aligner *aligner, const aligner_segment *segment);
int cairn_aligner_find_wall(cairn_aligner *aligner, cairn_budget *budget);

/* Returns the direction along a wall, free side on the left. */
cairn_vec2 cairn_aligner_along(const aligner_wall *wall);

/* Returns 1 when a segment of this direction in the map may be part of a wall. */
int cairn_aligner_same_line(const aligner_wall *wall, const aligner_segment *segment,
                            cairn_vec2 direction);

/* ---- aligner_term.c: segments on their walls ---- */

/* Residual and Jacobian of a segment on its wall. */
typedef struct aligner_term {
    /* m: residual of the mean of its hits */
    cairn_real error;
    /* Jacobian by its scan's pose, ... */
    cairn_real row[3];
    /* ... and by its wall's offset and angle */
    cairn_real column[3];
    /* scatter along the wall, and mixed; these act on the angles only */
    cairn_real along, oblique;
    /* chi-squared, and the robust weight */
    cairn_real chi, scale;
} aligner_term;

/* Returns 1 for a segment on a wall that other scans see, too. */
static inline int aligner_is_shared(const cairn_aligner *aligner, const aligner_segment *segment)
{
    return segment->wall >= 0 && aligner->walls[segment->wall].node >= 0;
}

/* Returns the term of a segment that is on a wall. */
aligner_term cairn_aligner_term_of(const cairn_aligner *aligner, const aligner_segment *segment);

/* Returns the information of a scan's pose, its walls given. */
cairn_sym3 cairn_aligner_own_information(const cairn_aligner *aligner, int32_t scan);

/* ---- aligner_covariance.c ---- */

/* Rotates a translation (or a row over it) into the axes of a scan's unknowns, and back into those
 * of the map. */
static inline void aligner_into_axes(cairn_vec2 axis, cairn_real shift[2])
{
    cairn_real along = axis.x * shift[0] + axis.y * shift[1];

    shift[1] = axis.x * shift[1] - axis.y * shift[0];
    shift[0] = along;
}

static inline void aligner_out_of_axes(cairn_vec2 axis, cairn_real shift[2])
{
    cairn_real first = axis.x * shift[0] - axis.y * shift[1];

    shift[1] = axis.y * shift[0] + axis.x * shift[1];
    shift[0] = first;
}

/* Sets the datum to the common motion of the reference scans; of all scans of the largest cluster
 * when there are none. */
void cairn_aligner_begin_datum(cairn_aligner *aligner);

/* Sets the right-hand side for the current coordinate of the datum; reads the solution: the
 * covariances of all scans with it. */
void cairn_aligner_set_column(cairn_aligner *aligner);
cairn_status cairn_aligner_read_column(cairn_aligner *aligner);

/* Makes a scan a reference scan of the next datum when it is observable with this one. */
void cairn_aligner_choose_reference(cairn_aligner *aligner, int32_t i);

/* Returns 1 when a reference scan was not observable, and at least .3 of them are left: the datum is
 * to be found again. */
int cairn_aligner_is_datum_spoilt(const cairn_aligner *aligner);

/* Returns 1 when a number of standard deviations of a position is within the limit of an observable
 * one, and the standard deviation of the heading within its own. */
int cairn_aligner_is_observable(const cairn_aligner *aligner, const cairn_real covariance[9],
                                cairn_real sigmas);

/* Sets both covariances of a pose to that of initial poses: variances of x and y, and of the
 * heading. */
void cairn_aligner_set_initial_covariances(cairn_aligner_pose *pose, cairn_real variance,
                                           cairn_real turn);

/* Writes the covariances of a scan's result, rotated by the joint solution's gauge; those of the
 * initial poses outside the largest cluster. */
void cairn_aligner_write_covariances(cairn_aligner *aligner, int32_t i);

/* ---- aligner_joint.c and aligner_translate.c ---- */

/* Moves the current scan into a cluster; takes it out of its cluster, into one of its own. */
void cairn_aligner_take_out(cairn_aligner *aligner);
void cairn_aligner_put_back(cairn_aligner *aligner, int32_t cluster, cairn_transform pose);

/* aligner_cluster.c */
void cairn_aligner_begin_clusters(cairn_aligner *aligner);
/* least: nats; counting stops when the log-likelihood ratio has fallen to it. */
void cairn_aligner_begin_evaluation(cairn_aligner *aligner, int32_t moving, int32_t fixed,
                                    cairn_transform pose, int32_t rounds, cairn_real least);
void cairn_aligner_begin_relax(cairn_aligner *aligner, int32_t cluster, cairn_real gate,
                               int32_t rounds, int32_t all);
void cairn_aligner_insert(cairn_aligner *aligner, int32_t scan, int32_t cluster);
void cairn_aligner_remove(cairn_aligner *aligner, int32_t scan);
int32_t cairn_aligner_largest(const cairn_aligner *aligner);
int32_t cairn_aligner_merge_clusters(cairn_aligner *aligner, int32_t moving, int32_t fixed,
                                     cairn_transform pose);

/* ---- aligner_prior.c ---- */

/* Returns the log-likelihood of the initial poses for the pose of cluster `moving` in `fixed`,
 * nats.
 *
 * visited: NULL, or the scans that it visits one by one are only added up */
cairn_real cairn_aligner_prior(cairn_aligner *aligner, int32_t moving, int32_t fixed,
                               cairn_transform pose, int32_t *visited);

/* Step: the same for the pose of the evaluation. */
int cairn_aligner_find_prior(cairn_aligner *aligner, cairn_budget *budget);

/* Sets the standard deviations of the initial poses to those that the params expect. */
void cairn_aligner_expect_sigmas(cairn_aligner *aligner);

/* Step: estimates them from all clusters. */
int cairn_aligner_estimate_sigmas(cairn_aligner *aligner, cairn_budget *budget);

/* Returns the gauge of a cluster: the least-squares common motion onto its initial poses. Linear in
 * the cluster. */
cairn_transform cairn_aligner_gauge(const cairn_aligner *aligner, int32_t cluster);

/* Called before a scan enters a cluster (sign 1) or leaves it (-1). */
void cairn_aligner_update_prior_sums(cairn_aligner *aligner, int32_t scan, int32_t cluster,
                                     int32_t sign);

#endif
