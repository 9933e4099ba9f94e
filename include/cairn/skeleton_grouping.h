/* skeleton_grouping: joint particle-filter grouping of contours and skeletons (medial axes) of
 * locally symmetric parts, without a shape model. Image coordinates, px.
 *
 * Method (default):
 * 1. Centre points (CPs), as chapter 3 calls symmetric points: centres of discs that touch a pair
 *    of edgels that face each other.
 * 2. Expectation-maximization fits lines to the CPs in (x, y, radius).
 * 3. Seeding: lines whose edgels are mirror symmetric about them.
 * 4. A particle filter follows the axis, disc by disc, and extends the contour on both sides.
 *    The gain of a step is the log-likelihood ratio of its edgels, symmetric contour against
 *    uniform background clutter.
 * 5. Parts are ranked by the sum of their gains. Parts that share contours compete for them.
 * 6. Parts whose axes continue into each other are joined to an object.
 *
 * Ablation (docs/lab/skeleton.md): the number of particles matters little. One particle finds the
 * same parts as 16, with radius errors of 1.4 % instead of 0.9 %.
 *
 * Limits: an axis is found from its two sides, so round blobs, which have no axis direction, are
 * found only in part. Contours closer to each other than two steps merge.
 *
 * CAIRN_MODE_AS_WRITTEN follows the chapter. CPs come from all pairs of edgels. Each
 * mirror-symmetric line has two filters, one in each direction, whose first particles are the CPs
 * near the line. Followers are all pairs of edgels in two circles of radius C sigma, equally
 * likely, with weights (3.7) to (3.9). The N heaviest followers keep their weights; residual
 * resampling comes after that when N_eff < N / 2. The trajectory of the heaviest particle is the
 * part. Parts do not compete for edgels and are neither smoothed nor joined: each is an object with
 * two free ends. contrast_weight, edgel slopes, detection_probability and polarity_flip_probability
 * are unused.
 *
 * Choices where the thesis states nothing, or is contradictory or misprinted:
 * - (3.8) prints h = |...| - min(delta_t - delta_(t-1), 0), which penalizes an improving symmetry;
 *   + max(..., 0) is used, as in section 2.4.2. Angles between the normals n are angles between the
 *   vectors from the edgels to the CP.
 * - "Approximately tangential": the mean deviation of a pair is at most symmetry_sigma, each normal
 *   within 75 degrees of the chord.
 * - Beyond max_centres every other CP is dropped and the stride doubles: one in 2^k is kept.
 *   Circles of more than 48 edgels, and particles with more than 256 followers, are subsampled
 *   evenly.
 * - Expectation-maximization has the constants of the default mode. A line is mirror symmetric when
 *   60 % of its CPs have their edgels on both sides, at distances that agree within 20 %. Its first
 *   particles are N of these CPs, evenly.
 * - The first pose has no heading: the line's direction is used, once each way.
 * - The contour is extended by C sigma; the search circle is centred at the extended end. The
 *   explored region is the interior of the polygon of both contours.
 * - "By a wide margin": 3 R sigma outside the range. A range that is not given is proposed from the
 *   radii of the CPs (set by hand in the thesis).
 * - Gaussians are relative to their maximum: their units (1 / (rad px^2)) would make a longer part
 *   less likely, contrary to the thesis. For the same reason the log-likelihood of a step has the
 *   offset 0.5: exp(-0.5) of the maximum leaves the likelihood of a part unchanged.
 * - Delta_p ends a trajectory: it bounds (3.7) of the heaviest particle's last step, which is then
 *   excluded. p_min accepts a part: it bounds the product over its steps. If both bounded the same
 *   product, every part would end at Delta_p and a greater p_min reject it.
 * - N, D sigma, C sigma, R sigma, Delta_p and p_min are not given: see
 *   cairn_skeleton_grouping_as_written().
 *
 * Source: Adluru 2008, chapter 3.
 *
 *     begin(edgels) -> step(budget) until CAIRN_OK -> read() */
#ifndef CAIRN_SKELETON_GROUPING_H
#define CAIRN_SKELETON_GROUPING_H

#include "cairn/edgel.h"
#include "cairn/object.h"
#include "cairn/polyline.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Parameters; defaults in brackets. */
typedef struct cairn_skeleton_grouping_params {
    /* px, 1 ... 8192 (640 and 480): largest image */
    int32_t max_width, max_height;
    /* 1 ... 2^24 (40,000): capacity of edgels */
    int32_t max_edgels;
    /* 1 ... 2^20 (4000): capacity of CPs. Of more edgels than half of it one in N is paired; as
     * written one CP in 2^k is kept. */
    int32_t max_centres;
    /* 1 ... 4096 (256): capacity of lines through CPs, also during fitting, and of seeds */
    int32_t max_lines;
    /* 1 ... 4096 (256): capacity of parts */
    int32_t max_parts;
    /* 1 ... 2^20 (8192): capacity of axis points of all parts. A trajectory needs 2 max_steps + 1
     * free points. */
    int32_t max_points;
    /* 1 ... 1024 (96): greatest number of steps of a trajectory */
    int32_t max_steps;
    /* 1 ... 1024 (16): particles of a filter */
    int32_t particle_count;
    /* CAIRN_MODE_DEFAULT or CAIRN_MODE_AS_WRITTEN (CAIRN_MODE_DEFAULT): method, see above */
    int32_t mode;
    /* rad, > 0 (20 degrees): D sigma: standard deviation of contour directions and of the loss of
     * symmetry per step; the thesis calls the relation of contour and skeleton duality */
    cairn_real duality_sigma;
    /* px, > 0 (8): C sigma: standard deviation of the step length and search radius of a step */
    cairn_real step_sigma;
    /* share of the radius, > 0 (0.2): R sigma: standard deviation of the distance of a radius to
     * the range; as written px */
    cairn_real radius_sigma;
    /* rad, > 0 (8 degrees): standard deviation of the angle between an edgel's normal and the
     * vector to its CP; as written the greatest mean angle */
    cairn_real symmetry_sigma;
    /* > 0, < 1 (0.9): detection probability: share of a contour that has edgels; 1 - probability of
     * occlusion */
    cairn_real detection_probability;
    /* > 0, < 1 (0.05): probability that the contrast polarity changes from one contour point to the
     * next */
    cairn_real polarity_flip_probability;
    /* >= 0 (6): log odds per unit of ln(slope / mean slope) of an edgel; unused as written */
    cairn_real contrast_weight;
    /* nats, > 0 (10): a trajectory ends when its log odds fall this much below their maximum; as
     * written -log Delta_p */
    cairn_real stop_log_odds;
    /* nats, >= 0 (20): least log odds of a reported part; as written log p_min */
    cairn_real min_log_odds;
    /* 0 ... 1 (0.6): least share of a line's CPs that are mirror symmetric about it */
    cairn_real min_mirror_ratio;
    /* any (1): seed of the random numbers */
    uint64_t seed;
} cairn_skeleton_grouping_params;

/* Grouping of edgels to symmetric parts. */
typedef struct cairn_skeleton_grouping cairn_skeleton_grouping;

/* Returns the default parameters. */
cairn_skeleton_grouping_params cairn_skeleton_grouping_default(void);

/* Returns CAIRN_MODE_AS_WRITTEN: 8000 CPs, 512 parts of 32,768 points, 256 steps, 50 particles,
 * R sigma 2 px, symmetry 10 degrees, Delta_p exp(-2), p_min exp(12), D sigma and C sigma as in
 * the default. */
cairn_skeleton_grouping_params cairn_skeleton_grouping_as_written(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_skeleton_grouping_check(
    const cairn_skeleton_grouping_params *params, cairn_object_fault *fault);

/* Returns the memory of an object in bytes; 0 for params that create() rejects. */
size_t cairn_skeleton_grouping_memory(const cairn_skeleton_grouping_params *params);

/* Creates a grouping object. CAIRN_BAD_ARGUMENT: invalid params. CAIRN_NO_MEMORY: the pool is
 * too small. */
CAIRN_CHECKED cairn_status
cairn_skeleton_grouping_create(cairn_skeleton_grouping **skeleton, cairn_pool *pool,
                               const cairn_skeleton_grouping_params *params);

/* The edgels of an image. */
typedef struct cairn_skeleton_grouping_input {
    /* [count] Edgels with unit normals; slope <= 0: unknown, no evidence either way. */
    const cairn_edgel *edgels;
    /* Number of edgels, >= 0. */
    int32_t count;
    /* Size of the image, px. */
    int32_t width, height;
    /* Range of radii, px, 1 <= min <= max; both 0: proposed from the histogram of CP radii. */
    cairn_real min_radius, max_radius;
} cairn_skeleton_grouping_input;

/* Starts on an image and discards the previous result; the edgels must stay valid until step()
 * returns CAIRN_OK. CAIRN_BAD_ARGUMENT: NULL, counts, sides or radii outside the ranges above.
 * CAIRN_NOT_FINITE: a radius. CAIRN_FULL: larger than max_width or max_height, more than
 * max_edgels. Cost: constant.
 *
 * input: edgels, size of the image and radii */
CAIRN_CHECKED cairn_status cairn_skeleton_grouping_begin(
    cairn_skeleton_grouping *skeleton, const cairn_skeleton_grouping_input *input);

/* Resumes the computation. CAIRN_MORE: the budget is used up. CAIRN_OK: the parts are complete, or
 * nothing was begun. CAIRN_NOT_FINITE: an edgel; aborted without a result. The result does not
 * depend on the budgets.
 *
 * Cost in units: 1 for each edgel; 1 for four edgels in reach of an edgel during the CP search;
 * the cost of polyline for the CPs; about 150 for each state of each particle's walk and 1 for
 * four edgels near it; for each chosen part 1 for eight discs of all others, and 1 for four
 * points of all parts. As written: 1 for two edgels in reach of an edgel; for each particle's
 * step 2,100, 2 for each candidate pair of edgels and 17 for each earlier step. */
CAIRN_CHECKED cairn_status cairn_skeleton_grouping_step(cairn_skeleton_grouping *skeleton,
                                                        cairn_budget *budget);

/* One disc along a medial axis, px. */
typedef struct cairn_skeleton_grouping_point {
    /* Centre of the disc, px. */
    cairn_vec2 centre;
    /* Radius of the disc, px. */
    cairn_real radius;
    /* Contact points on the contour. With x along the axis, from point to point, contact[0] has the
     * greater y: as the image is seen (y down), contact[0] is to the right and contact[1] to the
     * left. */
    cairn_vec2 contact[2];
    /* Edgel indices at the contact points; -1: undetected, the contour is interpolated. */
    int32_t edgel[2];
} cairn_skeleton_grouping_point;

/* A part: a piece of an axis with the contours on both sides. */
typedef struct cairn_skeleton_grouping_part {
    /* points[first ... first + count - 1] */
    int32_t first, count;
    /* Index of its object. */
    int32_t object;
    /* Point of another part into which the first and the last point continue; -1: a free end. */
    int32_t joint[2];
    /* Log odds against background clutter, nats; as written the log-likelihood. */
    cairn_real log_odds;
} cairn_skeleton_grouping_part;

/* An object: parts that belong together. */
typedef struct cairn_skeleton_grouping_object {
    /* Number of parts, and of their free ends. */
    int32_t part_count, free_end_count;
    cairn_real log_odds; /* Sum over its parts. */
} cairn_skeleton_grouping_object;

/* The parts and objects. Empty until step() returns CAIRN_OK; valid until the next begin(). */
typedef struct cairn_skeleton_grouping_result {
    /* [point_count] */
    const cairn_skeleton_grouping_point *points;
    /* [part_count] Sorted by decreasing log odds. */
    const cairn_skeleton_grouping_part *parts;
    /* [object_count] Sorted by decreasing log odds. */
    const cairn_skeleton_grouping_object *objects;
    /* Numbers of points, parts and objects. */
    int32_t point_count, part_count, object_count;
    /* Number of CPs, of lines through CPs, and of seeds of trajectories. */
    int32_t centre_count, line_count, seed_count;
    /* Seeds dropped for lack of capacity: max_parts or max_points. */
    int32_t dropped_seed_count;
    /* The given or proposed range of radii, px. */
    cairn_real min_radius, max_radius;
} cairn_skeleton_grouping_result;

/* Returns the skeletons; all zero until step() returns CAIRN_OK. */
cairn_skeleton_grouping_result
cairn_skeleton_grouping_read(const cairn_skeleton_grouping *skeleton);

/* Diagnostics (Adluru 2008, fig. 3.3): CPs and mirror-symmetric lines; valid as long as the
 * result. */

/* Writes CP number index of the line fit, in no order, px; returns 0 beyond the last one.
 *
 * at, radius: set to the position and the radius, px
 * index: index of the CP, from 0 */
int32_t cairn_skeleton_grouping_centre_point(const cairn_skeleton_grouping *skeleton, int32_t index,
                                             cairn_vec2 *at, cairn_real *radius);

/* Writes mirror-symmetric line number index, sorted by decreasing number of CPs; its third
 * coordinate is the radius, px. Returns 0 beyond the last one.
 *
 * index: index of the line, from 0
 * line: set to the line */
int32_t cairn_skeleton_grouping_mirror_line(const cairn_skeleton_grouping *skeleton, int32_t index,
                                            cairn_polyline_segment *line);

#ifdef __cplusplus
}
#endif

#endif
