/* skeleton_grouping: contours and skeletons of the symmetric parts of an image at once, with no
 * model of what they are of.
 *
 * Adluru 2008, chapter 3: pairs of edgels that face each other across a disc have their centre
 * points (CPs); lines through CPs in (x, y, radius) whose edgels lie like mirror images of each
 * other on both sides are where particles start. A particle walks along the axis, disc by disc, and
 * lengthens the contour on both sides; what it gains is the logarithm of how much likelier its
 * edgels are as a contour with an axis than as edgels strewn evenly. Parts are ranked by that sum,
 * those that share contours rival for them, and those whose axes lead into each other are an
 * object. Image coordinates, pixels.
 *
 * Of the default's particles little depends: one finds the same parts as 16, with radii 1.4 % off
 * in place of 0.9 % (docs/accuracy.md).
 *
 * CAIRN_MODE_AS_WRITTEN is the chapter as it is printed, and nothing else: centre points of all
 * pairs of edgels; EM lines; for each mirror symmetric line two filters, one each way along it,
 * whose first particles are the CPs about the line; followers from all pairs of edgels in two
 * circles of radius C sigma, equally likely; weights (3.7) to (3.9); N heaviest of all followers
 * with their weights, residual resampling when N_eff < N / 2; the walk of the heaviest particle is
 * the part. Parts do not rival for edgels, are not smoothed and not joined: each is an object of
 * its own, with two free ends. Contrast, slopes, `detection` and `flip` are not used. Choices,
 * where the text is silent, contradicts itself or has a misprint:
 * - (3.8) prints h = |...| - min(delta_t - delta_(t-1), 0), which punishes a symmetry that
 *   improves; + max(..., 0) is used, as in section 2.4.2. Angles between the normals n are those
 *   between the ways from the edgels to the CP.
 * - "Approximately tangential": the mean deviation of a pair is at most `symmetry`, each normal
 *   within 75 degrees of the chord.
 * - Of more CPs than max_centres every other one is dropped; circles of more than 48 edgels, and
 *   particles with more than 256 followers, are thinned evenly.
 * - The first pose has no heading: it is the line's direction, once each way.
 * - The contour is extended by C sigma, the circle lies about the end of that. Explored: inside the
 *   polygon of both contours.
 * - "By a wide margin": 3 R sigma off the range. A range that is not given is proposed from the
 *   radii of the CPs (by hand in the text).
 * - Gaussians are of their greatest value: their units (1 / (rad px^2)) would make any part the
 *   less likely the longer it is, where the text says the opposite. For the same reason a step of
 *   exp(-0.5) of the greatest value leaves the likelihood of a part as it is.
 * - Delta_p bounds (3.7) of the heaviest particle's last step, which then is no part of the walk;
 *   p_min bounds the product over a part. One number for both cannot be meant: every part ends when
 *   the first is reached.
 * - N, D sigma, C sigma, R sigma, Delta_p and p_min are not given: those of
 *   cairn_skeleton_as_written().
 *
 *     begin(edgels) -> step(budget) until CAIRN_OK -> read() */
#ifndef CAIRN_SKELETON_GROUPING_H
#define CAIRN_SKELETON_GROUPING_H

#include "cairn/edgel.h"
#include "cairn/polyline.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_skeleton_params {
    /* pixels, 1 ... 8192 (640 and 480) */
    int32_t max_width, max_height;
    /* 1 ... 2^24 (40,000) */
    int32_t max_edgels;
    /* CPs, 1 ... 2^20: of more, one in so many (4000) */
    int32_t max_centres;
    /* through CPs, also while they are fitted, and starts, 1 ... 4096 (256) */
    int32_t max_lines;
    /* 1 ... 4096 (256) */
    int32_t max_parts;
    /* of the axes of all parts, 1 ... 2^20 (8192); 2 max_steps + 1 of them free for each walk */
    int32_t max_points;
    /* of a walk, 1 ... 1024 (96) */
    int32_t max_steps;
    /* 1 ... 1024 (16) */
    int32_t particles;
    /* CAIRN_MODE_DEFAULT or CAIRN_MODE_AS_WRITTEN, see below */
    int32_t mode;
    /* rad, > 0, D sigma: of directions, and of the loss of symmetry (20 degrees) */
    cairn_real duality;
    /* px, > 0, C sigma: how far a step looks for edgels (8) */
    cairn_real reach;
    /* share of the radius, > 0, R sigma: how far it may lie off the range (0.2); as written px */
    cairn_real radius;
    /* rad, > 0: deviation of edgels from the way to their centre (8 degrees); as written the
     * most */
    cairn_real symmetry;
    /* 0 ... 1, neither: share of a contour that is seen (0.9) */
    cairn_real detection;
    /* 0 ... 1, neither: share of places where a contour's brighter side changes (0.05) */
    cairn_real flip;
    /* >= 0: log odds of an edgel e times as steep as the mean one (6); as written not used */
    cairn_real contrast;
    /* > 0: a walk ends when it has lost so much log odds since its best (10); as written -log
     * Delta_p */
    cairn_real stop;
    /* >= 0: of a part that is reported (20); as written log p_min */
    cairn_real min_log_odds;
    /* 0 ... 1: share of a line's CPs that are mirror images about it (0.6) */
    cairn_real min_mirror;
    uint64_t seed;
} cairn_skeleton_params;

typedef struct cairn_skeleton cairn_skeleton;

/* The values in brackets above. */
cairn_skeleton_params cairn_skeleton_default(void);

/* CAIRN_MODE_AS_WRITTEN: 8000 CPs, 512 parts of 32,768 points, 256 steps, 50 particles, R sigma
 * 2 px, symmetry 10 degrees, Delta_p exp(-2), p_min exp(12), D sigma and C sigma as in the
 * default. */
cairn_skeleton_params cairn_skeleton_as_written(void);

/* 0 for params that create() would refuse. */
size_t cairn_skeleton_memory(const cairn_skeleton_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_skeleton_create(cairn_skeleton **skeleton, cairn_pool *pool,
                                                 const cairn_skeleton_params *params);

/* What is to be grouped. */
typedef struct cairn_skeleton_input {
    /* [count], normals of length 1; slopes <= 0: not known, neither steep nor not */
    const cairn_edgel *edgels;
    int32_t count;
    /* px, of the image */
    int32_t width, height;
    /* px, 1 <= min <= max; both 0: proposed from the CPs */
    cairn_real min_radius, max_radius;
} cairn_skeleton_input;

/* Starts on an image; the edgels must stay until step() returns CAIRN_OK; what was found before
 * is gone. CAIRN_BAD_ARGUMENT: NULL, counts, sides or radii that the comments above rule out.
 * CAIRN_NOT_FINITE: a radius. CAIRN_FULL: larger than max_width or max_height, more than
 * max_edgels. Constant time. */
CAIRN_CHECKED cairn_status cairn_skeleton_begin(cairn_skeleton *skeleton,
                                                const cairn_skeleton_input *input);

/* Goes on. CAIRN_MORE: the budget is used up. CAIRN_OK: the parts stand, or nothing was begun.
 * While lines are fitted it may use what an item of `polyline` costs beyond the budget.
 * CAIRN_NOT_FINITE: an edgel; given up, and there are none. The result does not depend on the
 * budgets. Costs a unit for each edgel, for four edgels in reach of one that a CP is looked for
 * for, what `polyline` takes for the CPs, about 150 for each state of each particle's walk and
 * one for four edgels about it, for each part that is chosen one for eight discs of all others,
 * and for it and four points of all parts one. As written: a unit for two edgels in reach of an
 * edgel, and for each particle's step 2,100, two for each pair of edgels ahead and 17 for each
 * step behind it. */
CAIRN_CHECKED cairn_status cairn_skeleton_step(cairn_skeleton *skeleton, cairn_budget *budget);

/* One disc along an axis. */
typedef struct cairn_skeleton_point {
    cairn_vec2 centre;
    cairn_real radius;
    /* on the contour, to the left and to the right of the way along the part (y up) */
    cairn_vec2 touch[2];
    /* -1: none was seen there, the contour is carried on */
    int32_t edgel[2];
} cairn_skeleton_point;

typedef struct cairn_skeleton_part {
    /* points[first ... first + count - 1] */
    int32_t first, count;
    /* its object's index */
    int32_t object;
    /* its first and last point lead into this point of another part; -1: a free end */
    int32_t joint[2];
    /* natural, against the background; as written the logarithm of its likelihood */
    cairn_real log_odds;
} cairn_skeleton_part;

typedef struct cairn_skeleton_object {
    int32_t parts, free_ends;
    cairn_real log_odds; /* sum over its parts */
} cairn_skeleton_object;

/* Empty until step() returns CAIRN_OK; valid until the next begin(). */
typedef struct cairn_skeleton_result {
    /* [point_count] */
    const cairn_skeleton_point *points;
    /* [part_count], the likeliest first */
    const cairn_skeleton_part *parts;
    /* [object_count], the likeliest first */
    const cairn_skeleton_object *objects;
    int32_t point_count, part_count, object_count;
    /* CPs found, lines through them, and those that walks began on */
    int32_t centres, lines, starts;
    /* starts for whose walks max_parts or max_points had no room */
    int32_t left_out;
    /* px, the range that was given or proposed */
    cairn_real min_radius, max_radius;
} cairn_skeleton_result;

cairn_skeleton_result cairn_skeleton_read(const cairn_skeleton *skeleton);

/* ---- What walks started from (Adluru 2008, fig. 3.3); valid as the result is ---- */

/* CP `index` of those that lines were fitted to, in no order. 0: there are no more. */
int32_t cairn_skeleton_centre_point(const cairn_skeleton *skeleton, int32_t index, cairn_vec2 *at,
                                    cairn_real *radius);

/* Mirror symmetric line `index`, that of most CPs first; its third coordinate is the radius. 0:
 * there are no more. */
int32_t cairn_skeleton_mirror_line(const cairn_skeleton *skeleton, int32_t index,
                                   cairn_polyline_segment *line);

#ifdef __cplusplus
}
#endif

#endif
