/* Internals of the module polyline, shared by its files: the components that are fitted, and the
 * state between steps. */
#ifndef CAIRN_SHAPES_POLYLINE_WORK_H
#define CAIRN_SHAPES_POLYLINE_WORK_H

#include "cairn/polyline.h"
#include "cairn/small_matrix.h"
#include "src/base/object.h"
#include "src/base/step.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_polyline_parameters;

/* Points per block; the points of a block share one list of candidate components. */
#define POLYLINE_BLOCK_POINTS 8

/* Bits of the Morton code per axis: levels of the quadtree. */
#define POLYLINE_MORTON_BITS 20

/* Searches for initial components: one of all points, then two of the outliers. */
#define POLYLINE_INITIAL_ROUNDS 3

/* Half width of the gate of a component, in widths of the Gaussian. exp(-POLYLINE_GATE^2 / 2) is
 * the weight of the outlier hypothesis in the E-step. */
#define POLYLINE_GATE           3
#define POLYLINE_OUTLIER_WEIGHT CAIRN_REAL(0.011108996538242306)

/* Weighted moments of points in the frame of a component: sum of weights, of coordinates (m), and
 * of products of coordinates (m^2). */
typedef struct polyline_sums {
    cairn_real weight;
    cairn_real v[3];
    cairn_sym3 vv;
} polyline_sums;

/* Mixture component: a line with its extent, the points mid + t axis[0], low <= t <= high. axis[1]
 * and axis[2] complete a right-handed frame; in the plane axis[2] is (0, 0, 1). All moments are
 * taken in this frame, in which the distances to the line are small numbers. Lengths are in m. */
typedef struct polyline_component {
    /* Origin and axes of the frame. */
    cairn_real mid[3], axis[3][3];
    /* Ends along axis[0]. */
    cairn_real low, high;
    /* Largest gap beyond each end that the next point may leave. */
    cairn_real reach_low, reach_high;
    /* Bounding box of the component enlarged by both reaches. */
    cairn_real box_min[3], box_max[3];
    /* Own points, those closest to this component: mean in this frame, ... */
    cairn_real own_mean[3];
    /* ... sums of squares along and across the line about the mean, in m^2, ... */
    cairn_real tt, sse;
    /* ... and number. */
    int32_t count;
    /* Moments of all points, weighted by their responsibilities. */
    polyline_sums soft_sums;
} polyline_component;

struct cairn_polyline {
    /* Resume points of the fit, and of its current phase; what follows on the last iteration. */
    int32_t resume, phase_resume, follows;
    /* Eighths of a work unit that are used but not yet charged. */
    int32_t eighths_used;
    /* Cursors of the current phase: a point or component, and a component; first and behind the
     * last point of a cell, run or block. */
    int32_t cursor, other, first, last;
    /* Start of the part of order[] that is sorted or searched. */
    int32_t list_start;
    int32_t point_count, component_count, next_count;

    /* [max_points] Points as given, and in canonical order, in m. */
    cairn_real (*raw_points)[3];
    cairn_real (*points)[3];
    /* [max_points] Morton code of each raw point; later of each outlier. */
    uint64_t *morton;
    /* [max_points] Raw indices in canonical order; later canonical indices by component and
     * position. */
    int32_t *order;
    /* [max_points] Second buffer of the merge sort. */
    int32_t *merge_buffer;
    /* [max_points] Raw index of each point. */
    int32_t *raw_index;
    /* [max_points] Component to which a point is assigned, -1: outlier. */
    int32_t *component_of;
    /* [max_points] Position along that component, in m. */
    cairn_real *position;
    /* Bounding boxes of the blocks, in m. */
    cairn_real (*block_min)[3], (*block_max)[3];
    /* [max_segments] each: components of this and of the next iteration. */
    polyline_component *components, *next;
    /* [max_segments] E-step: candidate components of the current block. */
    int32_t *candidate_list;
    /* [max_segments] E-step: weight of the current point for each candidate, ... */
    cairn_real *candidate_weight;
    /* ... and its coordinates in the candidate's frame, in m. */
    cairn_real (*candidate_local)[3];
    /* Result: segments, and labels of the points. */
    cairn_polyline_segment *segments;
    int32_t *label;

    /* Sizes of the result that read() returns. */
    int32_t result_points, result_segments;
    /* Bounding box of the points, and its longest side, in m. */
    cairn_real box_min[3], box_max[3], box_side;
    /* Side of the smallest cell of the Morton code, in m. */
    cairn_real cell_size;
    /* Noise of the points, and current, first and last width of the Gaussian of the E-step, in
     * m. */
    cairn_real sigma, width, width_first, width_last;
    /* Cosine of merge_angle. */
    cairn_real merge_cosine;
    /* Largest motion of an end in this iteration, in m. */
    cairn_real max_end_motion;
    /* 1: this iteration split, merged or dropped components; 1: the fit converged; components
     * dropped. */
    int32_t has_changed, converged, dropped;
    /* Round of the search for initial components. */
    int32_t initial_round;
    /* Start of the outliers in order[]. */
    int32_t outliers_start;
    cairn_polyline_measure measure;

    /* 1: points may be added; 1: the result is complete. */
    int32_t is_open, is_complete;
    cairn_polyline_params params;

    /* State of a phase; no two of these phases are under way at a time. */
    union {
        /* Merge sort: the sorted runs and the buffer to which they are merged; items; bounds of the
         * two runs that are merged; positions in both runs and in the output. */
        struct {
            int32_t *from, *to;
            int32_t count, start, middle, end, left, right, out;
        } sort;
        /* E-step: number of candidates, closest candidate, candidate that may grow to the current
         * point, and 1 while components may grow; sum of the weights; squared distances of the
         * closest and of the growing candidate, in m^2. */
        struct {
            int32_t candidate_count, best, growing, is_growing;
            cairn_real weight_sum, best_squared, growing_squared;
        };
        /* Initial components and runs: moments of the points, in the frame of the component that is
         * made. */
        struct {
            polyline_sums sums;
            polyline_component made_component;
            /* Initial components: level of the cell, pass over it, and half width of the band, in
             * m. */
            int32_t level, pass;
            cairn_real limit;
            /* Runs: moments of the points left of the tried split, and left of the best split; sum
             * of squares of both sides of the best split, in m^2, and the point before the split,
             * -1: none; component of the next run in order when none was split, 0 at first. */
            polyline_sums left_sums, best_left_sums;
            cairn_real best_sse;
            int32_t best_split, next_component;
        };
        /* 1: this pass over the pairs of components merged a pair. */
        int32_t has_merged;
    };
};

/* Operations charged at a time in loops over points and components. */
#define POLYLINE_GROUP 4

/* Coordinates of a point in the frame of a component, in m. */
inline void cairn_polyline_to_local(const polyline_component *component, int32_t dim,
                                    const cairn_real p[3], cairn_real local[3])
{
    cairn_real dx = p[0] - component->mid[0], dy = p[1] - component->mid[1], dz;

    local[0] = component->axis[0][0] * dx + component->axis[0][1] * dy;
    local[1] = component->axis[1][0] * dx + component->axis[1][1] * dy;
    local[2] = 0;
    if (dim == 2)
        return;
    dz = p[2] - component->mid[2];
    local[0] += component->axis[0][2] * dz;
    local[1] += component->axis[1][2] * dz;
    local[2] = component->axis[2][0] * dx + component->axis[2][1] * dy + component->axis[2][2] * dz;
}

/* Adds a point v of a weight to moments. */
inline void cairn_polyline_add_point(polyline_sums *sums, const cairn_real v[3], cairn_real weight)
{
    cairn_real t = weight * v[0], p = weight * v[1], q = weight * v[2];

    sums->weight += weight;
    sums->v[0] += t;
    sums->v[1] += p;
    sums->vv.xx += t * v[0];
    sums->vv.xy += t * v[1];
    sums->vv.yy += p * v[1];
    if (q == 0) /* always in the plane */
        return;
    sums->v[2] += q;
    sums->vv.xz += t * v[2];
    sums->vv.yz += p * v[2];
    sums->vv.zz += q * v[2];
}

/* Sum of squared residuals of the regression line, in m^2, from moments in a frame nearly along
 * that line. */
cairn_real cairn_polyline_residual(const polyline_sums *sums);

/* M-step: rotates the frame of a component to the principal axis of moments in that frame, keeping
 * its sense. The ends keep their positions. */
void cairn_polyline_fit(polyline_component *component, const polyline_sums *sums, int32_t dim);

/* Fits a component to the moments of its own points in its frame: regression on t, then own_mean,
 * tt, sse and count. low and high are positions in the old frame and are converted. */
void cairn_polyline_fit_own(polyline_component *component, const polyline_sums *sums, int32_t dim);

/* Sets the bounding box of a component. */
void cairn_polyline_box(polyline_component *component);

/* The point at t m along the line of a component; its ends are at low and high. */
void cairn_polyline_point_at(const polyline_component *component, cairn_real t,
                             cairn_real point[3]);

/* Model selection: reduction of the sum of squares, in m^2, that justifies a second line, for n
 * points with the sum of squares `sse` about two lines. */
cairn_real cairn_polyline_split_penalty(const cairn_polyline *polyline, cairn_real n,
                                        cairn_real sse);

/* Appends a component to list[*count]. In a full list the component of fewest points is dropped. */
void cairn_polyline_insert(cairn_polyline *polyline, polyline_component *list, int32_t *count,
                           const polyline_component *component);

/* Eighths of a unit by which inserting components in a list of `count` exceeds the cost of their
 * line: those for which no place is left each search the full list. */
static inline int32_t polyline_search_eighths(const cairn_polyline *polyline, int32_t count,
                                              int32_t inserted)
{
    int32_t places = polyline->params.max_segments - count;

    return inserted > places ? (inserted - places) * polyline->params.max_segments : 0;
}

/* 1 when point a comes before point b in an order of the points. */
typedef int (*polyline_order)(const cairn_polyline *polyline, int32_t a, int32_t b);

/* Canonical order of raw points. The order of equal points has no effect on the result. */
int cairn_polyline_point_before(const cairn_polyline *polyline, int32_t a, int32_t b);

/* Order of outliers by Morton code. */
int cairn_polyline_outlier_before(const cairn_polyline *polyline, int32_t a, int32_t b);

/* Order of points by component (outliers last), then by position. */
int cairn_polyline_support_before(const cairn_polyline *polyline, int32_t a, int32_t b);

/* ---- Phases: each returns 1 when done and 0 when the budget is used up ---- */

/* Morton codes of the raw points. */
int cairn_polyline_keys(cairn_polyline *polyline, cairn_budget *budget);

/* Sorts order[list_start ... point_count - 1]. */
int cairn_polyline_sort(cairn_polyline *polyline, cairn_budget *budget, polyline_order before);

/* Points in canonical order, and the bounding boxes of the blocks. */
int cairn_polyline_gather(cairn_polyline *polyline, cairn_budget *budget);

/* Morton codes of the listed points in the shifted cells of the round. */
int cairn_polyline_list_outliers(cairn_polyline *polyline, cairn_budget *budget);

/* Initial components of the listed points. */
int cairn_polyline_initial(cairn_polyline *polyline, cairn_budget *budget);

/* E-step, with growth of the components in the first half of the iterations. */
int cairn_polyline_expect(cairn_polyline *polyline, cairn_budget *budget);

/* Assigns each point to the closest component; none grows. */
int cairn_polyline_assign(cairn_polyline *polyline, cairn_budget *budget);

/* M-step. */
int cairn_polyline_maximize(cairn_polyline *polyline, cairn_budget *budget);

/* Runs without a gap of each component, each split in two where that reduces the residuals enough: the components of the
 * next iteration. */
int cairn_polyline_support(cairn_polyline *polyline, cairn_budget *budget);

/* Merges pairs of components that one line fits. */
int cairn_polyline_merge(cairn_polyline *polyline, cairn_budget *budget);

#endif
