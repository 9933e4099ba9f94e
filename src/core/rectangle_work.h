/* What the two parts of the rectangle room share. */
#ifndef CAIRN_CORE_RECTANGLE_WORK_H
#define CAIRN_CORE_RECTANGLE_WORK_H

#include "cairn/rectangle.h"

/* Positions of a coverage along a side of a rectangle. */
#define COVER_BITS 64

/* A heap sort in steps: index[0 ... count-1] ascending by key, then by index. */
typedef struct sorter {
    int32_t *index;
    const cairn_real *key; /* by index */
    int32_t count;
    int32_t build, end; /* heaps still to be built, end of the heap */
} sorter;

/* A merged side. */
typedef struct side {
    cairn_segment segment;
    cairn_vec2 direction; /* unit */
    cairn_real mass;      /* m, length of its segments */
    cairn_real slope;     /* of its direction modulo pi, in [0, pi) */
    int32_t first, count; /* its segments in `order` */
} side;

/* Two sides that face each other. */
typedef struct pair {
    int32_t side[2];
    cairn_rectangle_kind kind;
    cairn_real slope; /* of their mean direction, in [0, pi) */
} pair;

/* A rectangle in the making. */
typedef struct candidate {
    cairn_rectangle rectangle;
    /* its axes */
    cairn_vec2 u, v;
    /* sine of the largest angle by which a side is off, in that of params.angle */
    cairn_real deviation;
    uint64_t cover[4];
    /* side and segment to be laid on it next */
    int32_t at, cursor;
} candidate;

typedef int32_t search_phase;
enum {
    RECTANGLE_IDLE,
    RECTANGLE_LENGTHS,
    RECTANGLE_BY_LENGTH,
    RECTANGLE_MERGE,
    RECTANGLE_MEMBERS,
    RECTANGLE_BY_SLOPE,
    RECTANGLE_PAIRS,
    RECTANGLE_BY_PAIR_SLOPE,
    RECTANGLE_MATCH
};

struct cairn_rectangle_set {
    cairn_rectangle_params params;
    cairn_real sine_merge, sine_angle;
    int32_t *order;  /* [max_segments], by length, then by side */
    int32_t *member; /* [max_segments], side of a segment or -1 */
    cairn_real *key; /* [max_segments], minus the length */
    side *sides;     /* [max_sides] */
    int32_t *side_order;
    cairn_real *side_key;
    pair *pairs; /* [max_pairs] */
    int32_t *pair_order;
    cairn_real *pair_key;
    cairn_rectangle *list; /* [max_rectangles], the strongest first, while searching */
    cairn_rectangle *done;
    int32_t segment_count, ordered, side_count, pair_count, list_count, done_count;
    int32_t dropped, done_dropped;

    const cairn_segment *segments;
    search_phase phase;
    int32_t cursor, against; /* of the phase */
    int32_t best;            /* RECTANGLE_MERGE: the side that fits best so far, or -1 */
    cairn_real best_distance;
    int32_t is_open; /* RECTANGLE_MATCH: `open` is to be laid on its sides */
    candidate open;
    int32_t paid;
    sorter sort;
};

/* Whether the two sides make a pair. */
int cairn_rectangle_pair(const struct cairn_rectangle_set *set, int32_t first, int32_t second,
                         pair *made);

/* Matches pairs of pairs; the last phase of a search. */
cairn_status cairn_rectangle_match(struct cairn_rectangle_set *set, cairn_budget *budget);

/* a - b between directions modulo pi, in [0, pi). */
static inline cairn_real cairn_rectangle_turn(cairn_real a, cairn_real b)
{
    cairn_real turn = a - b;

    return turn < 0 ? turn + CAIRN_PI : turn;
}

#endif
