/* Internals of the module rectangle, shared by rectangle.c (sides and pairs) and rectangle_match.c
 * (rectangles). */
#ifndef CAIRN_SHAPES_RECTANGLE_WORK_H
#define CAIRN_SHAPES_RECTANGLE_WORK_H

#include "cairn/rectangle.h"
#include "src/base/object.h"
#include "src/base/step.h"
#include "src/containers/heap.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_rectangle_parameters;

/* Positions per side of a rectangle in the bit set of its coverage. */
#define RECTANGLE_COVERAGE_BITS 64

/* A sort of indices, ascending by key, ties by index. */
typedef struct rectangle_sorter {
    /* Permutation that is sorted. */
    int32_t *index;
    /* Keys, by index. */
    const cairn_real *key;
    heap_sorting sorting;
} rectangle_sorter;

/* Side: segments merged into one. */
typedef struct rectangle_side {
    /* The merged segment. */
    cairn_segment segment;
    /* Its unit direction. */
    cairn_vec2 direction;
    /* Sum of the lengths of its segments, in m. */
    cairn_real mass;
    /* Angle of its direction modulo pi, in [0, pi) rad. */
    cairn_real slope;
    /* Its segments in `order`: their number, and the first of them, or the end once they are
     * listed. */
    int32_t first, count;
} rectangle_side;

/* Two parallel sides that face each other. */
typedef struct rectangle_pair {
    int32_t side[2];
    cairn_rectangle_kind kind;
    /* Angle of the mean direction, in [0, pi) rad. */
    cairn_real slope;
} rectangle_pair;

/* Candidate of a rectangle. */
typedef struct rectangle_candidate {
    cairn_rectangle rectangle;
    /* Unit axes along and across theta. */
    cairn_vec2 u, v;
    /* Sine of the largest angular deviation of a side from its axis, as a fraction of that of
     * max_angle_error. */
    cairn_real deviation;
    /* Bit set of the covered positions of each side. */
    uint64_t coverage[4];
    /* Next side, and next segment of the side, whose coverage is marked. */
    int32_t side_index, segment_cursor;
} rectangle_candidate;

struct cairn_rectangle_set {
    /* Sines of merge_angle and max_angle_error. */
    cairn_real sine_merge_angle, sine_max_angle_error;
    /* [max_segments] Segments by decreasing length, then by side. */
    int32_t *order;
    /* [max_segments] Side of a segment, -1: none. */
    int32_t *side_of_segment;
    /* [max_segments] Negative length of a segment, in m: its sorting key. */
    cairn_real *length_key;
    /* [max_sides] Sides, their order by slope, and their slopes. */
    rectangle_side *sides;
    int32_t *side_order;
    cairn_real *side_key;
    /* [max_pairs] Pairs, their order by slope, and their slopes. */
    rectangle_pair *pairs;
    int32_t *pair_order;
    cairn_real *pair_key;
    /* [max_rectangles] each: rectangles of the search that runs, by decreasing score, and of the
     * last search. */
    cairn_rectangle *found;
    cairn_rectangle *result;
    int32_t segment_count, ordered_count, side_count, pair_count, found_count, result_count;
    /* Sides, pairs and rectangles dropped. */
    int32_t found_dropped, result_dropped;

    /* Input of the search. */
    const cairn_segment *segments;
    /* 1: a search is under way; CAIRN_OK, or the status of the first segment that is refused. */
    int32_t is_running;
    cairn_status outcome;
    /* Resume points of the search and of its phase; units charged for the next operation so far. */
    int32_t resume, phase_resume, units_charged;
    /* Current item of the phase, and the one with which it is compared. */
    int32_t cursor, compared;
    /* State of a phase; no two of these phases are under way at a time. */
    union {
        rectangle_sorter sorter;
        /* Merging: closest side of the current segment so far, -1: none, and its distance in m. */
        struct {
            int32_t closest;
            cairn_real closest_distance;
        };
        /* Matching: position of the first pair that is compared with the current one, and the
         * rectangle of both. */
        struct {
            int32_t first_compared;
            rectangle_candidate candidate;
        };
    };
    cairn_rectangle_params params;
};

/* Returns 1 and sets *made when two sides face each other, else 0. */
int cairn_rectangle_make_pair(const struct cairn_rectangle_set *set, int32_t first, int32_t second,
                              rectangle_pair *made);

/* Last phase of a search: makes rectangles of two pairs. Returns 1 when done and 0 when the budget is
 * used up. */
int cairn_rectangle_match(struct cairn_rectangle_set *set, cairn_budget *budget);

/* a - b of two angles modulo pi, in [0, pi) rad. */
static inline cairn_real cairn_rectangle_angle_difference(cairn_real a, cairn_real b)
{
    cairn_real difference = a - b;

    return difference < 0 ? difference + CAIRN_PI : difference;
}

#endif
