/* What the files of the polyline room share: the pieces that are fitted, and the state between
 * steps. */
#ifndef CAIRN_CORE_POLYLINE_WORK_H
#define CAIRN_CORE_POLYLINE_WORK_H

#include "cairn/polyline.h"
#include "cairn/small_matrix.h"

/* Points of a block share one list of candidate pieces. */
#define POLYLINE_BLOCK 8

/* Bits of the Morton code per axis. */
#define POLYLINE_LEVELS 20

/* Searches for first pieces: of all points, then twice of those without one. */
#define POLYLINE_ROUNDS 3

/* Half width of the band in which a piece claims points, in s. exp(-POLYLINE_CLAIM^2 / 2) is the
 * weight of "no piece at all". */
#define POLYLINE_CLAIM 3
#define POLYLINE_NOISE CAIRN_REAL(0.011108996538242306)

/* Weighted sums of points in some frame. */
typedef struct polyline_sums {
    cairn_real n;
    cairn_real v[3];
    cairn_sym3 vv;
} polyline_sums;

/* A line with its extent: points mid + t axis[0], low <= t <= high. axis[1] and axis[2] complete
 * a right-handed frame; in the plane axis[2] is (0, 0, 1). All sums are taken in this frame,
 * where distances to the line are small numbers. */
typedef struct polyline_piece {
    cairn_real mid[3], axis[3][3];
    cairn_real low, high;
    cairn_real reach_low, reach_high;  /* how far beyond its ends the next point may lie */
    cairn_real box_min[3], box_max[3]; /* of the piece with its reach */
    /* Of its own points, those that no piece is nearer to: */
    cairn_real own[3];  /* mean, in this frame */
    cairn_real tt, sse; /* sums of squares along and across the line about that mean */
    int32_t count;
    polyline_sums soft; /* of all points, each with its responsibility */
} polyline_piece;

typedef enum polyline_phase {
    POLYLINE_KEYS,
    POLYLINE_SORT_POINTS,
    POLYLINE_GATHER,
    POLYLINE_LIST,
    POLYLINE_SORT_LIST,
    POLYLINE_INITIAL,
    POLYLINE_EXPECT,
    POLYLINE_MAXIMIZE,
    POLYLINE_PROJECT,
    POLYLINE_SORT_SUPPORT,
    POLYLINE_SUPPORT,
    POLYLINE_MERGE,
    POLYLINE_COMPACT, /* and back to POLYLINE_EXPECT */
    POLYLINE_CLAIM_POINTS,
    POLYLINE_WRITE,
    POLYLINE_DONE
} polyline_phase;

struct cairn_polyline {
    cairn_polyline_params params;
    /* Points: as given, then in canonical order. */
    cairn_real (*raw)[3];
    cairn_real (*point)[3];
    /* [max_points] Morton code of raw points */
    uint64_t *key;
    /* [max_points] raw indices in canonical order, later canonical indices by piece and place */
    int32_t *order;
    /* [max_points] the other half of the merge sort */
    int32_t *spare;
    /* [max_points] raw index of each point */
    int32_t *source;
    /* [max_points] piece that claims a point, -1 none */
    int32_t *owner;
    /* [max_points] place on that piece */
    cairn_real *along;
    cairn_real (*block_min)[3], (*block_max)[3];
    /* Pieces of this and of the next iteration. */
    polyline_piece *pieces, *next;
    int32_t *candidate;
    cairn_real *weight;     /* [max_segments] of the point at hand for each candidate, ... */
    cairn_real (*local)[3]; /* ... and where it is in the candidate's frame */
    cairn_polyline_segment *segments;
    int32_t *label;

    int32_t count, piece_count, next_count;
    int32_t shown_points, shown_segments; /* what read() shows */
    cairn_real low[3], high[3], side;     /* box of the points, and its longest side */
    cairn_real cell;                      /* side of the smallest cell of the Morton code */
    cairn_real sigma, s, s_first, s_last;
    cairn_real merge_cosine;
    cairn_real moved; /* farthest that an end moved in this iteration */
    int32_t changed, converged, left_out;
    int32_t round;     /* of searches for first pieces */
    int32_t base;      /* where the part of order[] that is sorted or searched starts */
    int32_t unclaimed; /* where that of the points without a piece starts */
    cairn_polyline_measure measure;

    /* Where the phase at hand stands. Its cursors start at 0; what they count is said where they
     * are used. */
    polyline_phase phase;
    int32_t stage, at, other, inner, first, last, level;
    int32_t part; /* eighths of a unit that are used but not yet charged */
    int32_t candidates, best, adopter, adopting;
    cairn_real total, least, adopter_least;
    polyline_sums sum, left, best_left;
    cairn_real best_sse;
    int32_t best_at;
    polyline_piece made;
    struct {
        int32_t stage, swapped, start, middle, end, left, right, out;
    } sort;
};

/* Charges `eighths` of a unit; 0 when the budget is used up and the item at hand must wait. */
static inline int polyline_pay(cairn_polyline *x, cairn_budget *budget, int32_t eighths)
{
    if (budget->left <= 0)
        return 0;
    x->part += eighths;
    if (x->part >= 8) {
        int32_t units = x->part / 8;

        budget->left -= units;
        x->measure.units += units;
        x->part -= 8 * units;
    }
    return 1;
}

/* The same for up to four items, at every fourth of those that cost so little that asking for
 * each would show: `i` is the one at hand, before `end`. */
static inline int polyline_pay_four(cairn_polyline *x, cairn_budget *budget, int32_t i, int32_t end,
                                    int32_t eighths)
{
    return i % 4 != 0 || polyline_pay(x, budget, (end - i < 4 ? end - i : 4) * eighths);
}

/* Coordinates of a point in the frame of a piece. */
void cairn_polyline_local(const polyline_piece *k, int32_t dim, const cairn_real p[3],
                          cairn_real local[3]);

void cairn_polyline_sum(polyline_sums *m, const cairn_real v[3], cairn_real weight);

/* Sum of squares across the regression line of sums taken in a frame nearly along that line. */
cairn_real cairn_polyline_residual(const polyline_sums *m);

/* Turns the frame of a piece to the principal axis of sums taken in that frame, keeping its
 * sense; its ends stay. */
void cairn_polyline_fit(polyline_piece *k, const polyline_sums *m, int32_t dim);

/* Makes a piece of sums of its own points, taken in its frame: regression on t, then own, tt,
 * sse, count. low and high are places in the old frame and are carried over. */
void cairn_polyline_fit_own(polyline_piece *k, const polyline_sums *m, int32_t dim);

/* Sets box_min and box_max. */
void cairn_polyline_box(polyline_piece *k);

/* The place at t along the line of a piece; its ends are at low and high. */
void cairn_polyline_place(const polyline_piece *k, cairn_real t, cairn_real place[3]);

/* Sum of squares that a second line must save, for n points of which two lines leave `sse`. */
cairn_real cairn_polyline_worth(const cairn_polyline *x, cairn_real n, cairn_real sse);

/* Appends to list[*count]; when it is full, the piece of fewest points gives way. */
void cairn_polyline_keep(cairn_polyline *x, polyline_piece *list, int32_t *count,
                         const polyline_piece *k);

/* The phases; each returns 1 when it is through and 0 when the budget is used up. */
int cairn_polyline_keys(cairn_polyline *x, cairn_budget *budget);
int cairn_polyline_sort(cairn_polyline *x, cairn_budget *budget);
int cairn_polyline_gather(cairn_polyline *x, cairn_budget *budget);
int cairn_polyline_list(cairn_polyline *x, cairn_budget *budget);
int cairn_polyline_initial(cairn_polyline *x, cairn_budget *budget);
int cairn_polyline_expect(cairn_polyline *x, cairn_budget *budget);
int cairn_polyline_maximize(cairn_polyline *x, cairn_budget *budget);
int cairn_polyline_support(cairn_polyline *x, cairn_budget *budget);
int cairn_polyline_merge(cairn_polyline *x, cairn_budget *budget);

#endif
