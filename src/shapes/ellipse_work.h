/* Internals of the module ellipse, shared by ellipse.c (votes and peaks), ellipse_refine.c (passes
 * over the points of a peak) and ellipse_fit.c (geometry and conic fitting). */
#ifndef CAIRN_SHAPES_ELLIPSE_WORK_H
#define CAIRN_SHAPES_ELLIPSE_WORK_H

#include "cairn/ellipse.h"
#include "src/base/object.h"
#include "src/base/step.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_ellipse_parameters;

/* Unknowns of a conic. */
enum { ELLIPSE_UNKNOWNS = 5 };

/* Normal equations of the conic A u^2 + B u v + C v^2 + D u + E v = 1, with (u, v) relative to
 * `origin` in units of `scale`. */
typedef struct ellipse_conic_equations {
    /* Origin of (u, v), in m. */
    cairn_vec2 origin;
    /* Unit of (u, v), in m. */
    cairn_real scale;
    /* Sum of the weights of the points. */
    cairn_real weight;
    /* Matrix, lower triangle. */
    cairn_real matrix[ELLIPSE_UNKNOWNS][ELLIPSE_UNKNOWNS];
    /* Right-hand side. */
    cairn_real right[ELLIPSE_UNKNOWNS];
} ellipse_conic_equations;

/* Gate of inliers of an ellipse, precomputed for testing many points. */
typedef struct cairn_ellipse_gate {
    cairn_ellipse ellipse;
    /* Rigid transform of the centre. */
    cairn_transform map_ellipse;
    /* Largest distance from the outline, in m. */
    cairn_real max_distance;
    /* Largest sine of the angle between the directions of point and outline. */
    cairn_real max_sine;
    /* Bounds of the squared distance from the centre, in m^2: points outside cannot pass. */
    cairn_real inner_squared, outer_squared;
} cairn_ellipse_gate;

/* Passes over the points for each peak, in order: radius histogram, three conic fits of narrowing
 * gates, and the support of the result. */
enum {
    ELLIPSE_PASS_RADIUS,
    ELLIPSE_PASS_COARSE,
    ELLIPSE_PASS_MIDDLE,
    ELLIPSE_PASS_FINE,
    ELLIPSE_PASS_SUPPORT
};

/* Bins of the radius histogram, and the bounds of the number of arcs of an outline. */
enum { ELLIPSE_RADIUS_BINS = 64, ELLIPSE_MAX_ARCS = 64, ELLIPSE_MIN_ARCS = 8 };

/* Local maximum of an accumulator. */
typedef struct ellipse_peak {
    /* Votes of its cell, smoothed. */
    cairn_real votes;
    /* Accumulator, row and column of the cell. */
    int32_t layer, row, column;
} ellipse_peak;

struct cairn_ellipse_set {
    cairn_ellipse_params params;
    /* Number of accumulators: 2, one of rooms and one of columns; 1: points are not oriented. */
    int32_t accumulator_count;
    /* [accumulator_count * cells * cells] Votes for centres, row by row. */
    cairn_real *accumulator;
    /* [max_ellipses] Peaks, by decreasing votes. */
    ellipse_peak *peaks;
    /* Number of peaks, and of peaks dropped. */
    int32_t peak_count, found_dropped;
    /* [max_ellipses] each: ellipses of the search that runs, and of the last one, by decreasing
     * votes. */
    cairn_ellipse *found, *result;
    int32_t found_count, result_count, result_dropped;

    /* Input of the search. */
    const cairn_oriented_point *points;
    const cairn_real *weights;
    int32_t count;
    /* 1: a search is under way; CAIRN_OK, or the status of the first point that is refused. */
    int32_t is_running;
    cairn_status outcome;
    /* Resume points of the search and of its phase. */
    int32_t resume, phase_resume;
    /* Next point, cell or line of cells of the phase. */
    int32_t cursor;
    /* Work units charged for the next operation so far. */
    int32_t units_charged;
    /* Bounding box of the points, in m. */
    cairn_box box;
    /* Centre of the first cell, in m. */
    cairn_vec2 first_cell;
    /* Side of a cell, in m. */
    cairn_real cell_size;
    /* Non-maximum suppression radius around a peak, in cells. */
    int32_t nms_radius;
    /* Sine of angle_tolerance. */
    cairn_real max_sine;

    /* Current peak, and pass over the points for this peak. */
    int32_t current_peak;
    int32_t pass;
    /* Current estimate of the ellipse. */
    cairn_ellipse fit;
    /* State of a pass. */
    union {
        /* Radius: weight of the points by distance from the peak; the last bin is max_radius. */
        cairn_real radius_histogram[ELLIPSE_RADIUS_BINS];
        struct {
            /* Gate of the pass. */
            cairn_ellipse_gate gate;
            /* Fits: normal equations of the pass. */
            ellipse_conic_equations equations;
            /* Support: number of arcs of the outline, bit set of those that have an inlier, sum of
             * the weights of the inliers, and weighted sum of their squared distances, in m^2. */
            int32_t arc_count;
            uint32_t arcs[ELLIPSE_MAX_ARCS / 32];
            cairn_real inlier_weight, squared_residuals;
        };
    };
};

/* Weight of point i. */
static inline cairn_real cairn_ellipse_weight(const cairn_ellipse_set *set, int32_t i)
{
    return set->weights != NULL ? set->weights[i] : 1;
}

/* ---- ellipse_refine.c ---- */

/* Refines the peaks to ellipses. Returns 1 when done and 0 when the budget is used up. */
int cairn_ellipse_refine(cairn_ellipse_set *set, cairn_budget *budget);

/* ---- ellipse_fit.c ---- */

/* The gate of an ellipse. distance: in m. */
cairn_ellipse_gate cairn_ellipse_gate_of(const cairn_ellipse *ellipse, cairn_real distance,
                                         cairn_real sine);

/* 1 when an oriented point passes the gate, that is, is an inlier. *distance is set to its signed
 * distance from the outline, in m. */
int32_t cairn_ellipse_gate_passes(const cairn_ellipse_gate *gate, const cairn_oriented_point *point,
                                  cairn_real *distance);

/* Fast rejection: 1 when a point cannot pass the gate, whatever its direction. 0: it may pass. */
static inline int32_t cairn_ellipse_is_outside_gate(const cairn_ellipse_gate *gate,
                                                    cairn_vec2 point)
{
    cairn_vec2 from = {point.x - gate->map_ellipse.x, point.y - gate->map_ellipse.y};
    cairn_real squared = cairn_vec2_norm_squared(from);

    return squared < gate->inner_squared || squared > gate->outer_squared;
}

/* Normal equations without points, in the frame of an ellipse. */
ellipse_conic_equations cairn_ellipse_conic_begin(const cairn_ellipse *about);

/* Adds a point with its unit direction. */
void cairn_ellipse_conic_add(ellipse_conic_equations *equations, const cairn_oriented_point *point,
                             cairn_real weight);

/* Solves for the conic, and sets centre and axes of the ellipse. Returns 1, or 0 with the ellipse
 * unchanged when the conic is not an ellipse. */
int32_t cairn_ellipse_conic_solve(const ellipse_conic_equations *equations, cairn_ellipse *ellipse);

#endif
