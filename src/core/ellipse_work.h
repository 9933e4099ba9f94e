/* What the files of the ellipse room share. */
#ifndef CAIRN_CORE_ELLIPSE_WORK_H
#define CAIRN_CORE_ELLIPSE_WORK_H

#include "cairn/ellipse.h"

enum { ELLIPSE_UNKNOWNS = 5 };

/* Normal equations of a conic A u^2 + B u v + C v^2 + D u + E v = 1, (u, v) from `origin` in
 * units of `scale`. */
typedef struct cairn_conic_sums {
    cairn_vec2 origin;
    cairn_real scale; /* m */
    cairn_real weight;
    cairn_real matrix[ELLIPSE_UNKNOWNS][ELLIPSE_UNKNOWNS]; /* its lower triangle */
    cairn_real right[ELLIPSE_UNKNOWNS];
} cairn_conic_sums;

/* An ellipse and what belongs to it: what is alike for all points that are held against it. */
typedef struct cairn_ellipse_gate {
    cairn_ellipse ellipse;
    cairn_transform map_ellipse;
    /* m from the outline */
    cairn_real distance;
    /* of the angle between directions */
    cairn_real sine;
    /* m^2 from the centre: what is nearer or farther is off by more than the distance */
    cairn_real inner, outer;
} cairn_ellipse_gate;

typedef int32_t ellipse_phase;
enum {
    ELLIPSE_IDLE,
    ELLIPSE_BOUNDS,
    ELLIPSE_CLEAR,
    ELLIPSE_VOTE,
    ELLIPSE_SMOOTH,
    ELLIPSE_PEAKS,
    ELLIPSE_FIT,
    ELLIPSE_THIN
};

/* Passes over the points for each peak. */
enum { ELLIPSE_RADIUS, ELLIPSE_COARSE, ELLIPSE_MIDDLE, ELLIPSE_FINE, ELLIPSE_SUPPORT };

enum { ELLIPSE_RADII = 64, ELLIPSE_ARCS = 64, ELLIPSE_LEAST_ARCS = 8 };

typedef struct ellipse_peak {
    cairn_real votes;
    int32_t square, row, column;
} ellipse_peak;

struct cairn_ellipse_set {
    cairn_ellipse_params params;
    int32_t squares;     /* 2: of rooms, of columns; 1: of both */
    cairn_real *votes;   /* [squares * cells * cells], row by row */
    ellipse_peak *peaks; /* [max_ellipses], the highest first */
    int32_t peak_count, work_dropped;
    cairn_ellipse *work, *done; /* [max_ellipses] each, the most votes first */
    int32_t work_count, done_count, done_dropped;

    const cairn_oriented_point *points;
    const cairn_real *weights;
    int32_t count;
    ellipse_phase phase;
    int32_t cursor; /* point, cell or line of cells to be done next */
    int32_t paid;   /* units towards the item at hand */
    cairn_box box;
    cairn_vec2 corner; /* middle of the first cell */
    cairn_real cell;   /* m */
    int32_t reach;     /* cells about a peak */
    cairn_real sine;   /* of the angle tolerance */

    /* peak at hand */
    int32_t item;
    int32_t pass;
    cairn_ellipse fit;
    /* weight by distance from the peak, the last for most_radius */
    cairn_real radii[ELLIPSE_RADII];
    /* of the fit, in this pass */
    cairn_ellipse_gate gate;
    cairn_conic_sums sums;
    int32_t arc_count;
    /* ELLIPSE_SUPPORT: of points on the ellipse, and their squared distances */
    cairn_real weight, squared;
    /* of the outline that points cover */
    uint32_t arcs[ELLIPSE_ARCS / 32];
};

static inline cairn_real cairn_ellipse_weight(const cairn_ellipse_set *set, int32_t i)
{
    return set->weights != NULL ? set->weights[i] : 1;
}

/* ---- ellipse_refine.c ---- */

/* Begins with the peak at hand. */
void cairn_ellipse_start_peak(cairn_ellipse_set *set);

/* All peaks from that at hand on, into the list in work. */
cairn_status cairn_ellipse_refine(cairn_ellipse_set *set, cairn_budget *budget);

/* ---- ellipse_fit.c ---- */

cairn_ellipse_gate cairn_ellipse_gate_of(const cairn_ellipse *ellipse, cairn_real distance,
                                         cairn_real sine);

/* As cairn_ellipse_has(); *off: m from the outline. */
int32_t cairn_ellipse_lets_in(const cairn_ellipse_gate *gate, const cairn_oriented_point *point,
                              cairn_real *off);

/* 1: a point lies too far off whatever its direction. 0: it may belong to the ellipse. */
static inline int32_t cairn_ellipse_is_far(const cairn_ellipse_gate *gate, cairn_vec2 point)
{
    cairn_vec2 from = {point.x - gate->map_ellipse.x, point.y - gate->map_ellipse.y};
    cairn_real squared = cairn_vec2_norm_squared(from);

    return squared < gate->inner || squared > gate->outer;
}

/* No points yet, about an ellipse. */
cairn_conic_sums cairn_conic_begin(const cairn_ellipse *about);

/* A point and its unit direction. */
void cairn_conic_add(cairn_conic_sums *sums, const cairn_oriented_point *point, cairn_real weight);

/* Centre and axes of the conic; 0 and the ellipse unchanged when it is none. */
int32_t cairn_conic_solve(const cairn_conic_sums *sums, cairn_ellipse *ellipse);

#endif
