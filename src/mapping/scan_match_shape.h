/* The state of matching by shape, for the parts of scan_match. */
#ifndef CAIRN_SCAN_MATCH_SHAPE_H
#define CAIRN_SCAN_MATCH_SHAPE_H

#include "cairn/sequence.h"
#include "src/mapping/scan_match_work.h"

enum { SHAPE_BINS = CAIRN_SCAN_MATCH_BINS };

typedef struct shape_descriptor {
    uint8_t bin[SHAPE_BINS]; /* 255: as many points as in the fullest bin */
} shape_descriptor;

/* Pairs without a jump; the next segment's first one ends it. */
typedef struct shape_segment {
    int32_t first;
    int32_t agrees, kept; /* with the main segment at work; with the best one */
} shape_segment;

typedef struct shape_sums {
    int32_t pairs, overlap;
    cairn_real distance, overlap_distance;
    cairn_vec2 from, to;
    cairn_real cross, dot;
} shape_sums;

struct match_shape {
    cairn_sequence *sequence;
    /* [max_target], [max_query] */
    shape_descriptor *target, *query;
    /* [max_target] number of the part of a target point */
    int32_t *part_of;
    /* first point of the part at work */
    int32_t part_first;
    /* as written: 1: pairs of an iteration are summed up, 0: its quality is measured */
    int32_t is_summing;
    /* [max_query] the query as it lies now */
    cairn_oriented_point *turned;
    /* [max_query] */
    cairn_sequence_pair *pairs;
    /* [max_query + 1] */
    shape_segment *segments;
    int32_t pair_count, segment_count;
    /* 1: points with nothing but a straight line about them pass the colinear filter, too */
    int32_t with_lines;
    /* Rotations. */
    /* of the start */
    cairn_vec2 shift;
    cairn_transform turn;
    /* the last: of the rotation whose common subsequence is known */
    cairn_real first_angle, step, turned_angle;
    int32_t rotation, rotations, is_fine;
    /* The translation of this rotation. */
    cairn_vec2 best_shift;
    cairn_real best_distance;
    int32_t most_pairs, overlap;
    /* The best of all rotations, then that of ICP. */
    cairn_pose best, last;
    cairn_real best_angle;
    int32_t best_overlap, best_with_lines, last_overlap;
    /* 1: the best of the rotations is gone through once more, for the pairs that pictures show */
    int32_t is_again;
    cairn_real last_mean;
    cairn_real gate, overlap_gate;
    int32_t iteration;
    shape_sums sums;
};

/* What the mode does; the modes after AS_WRITTEN_COMMON are parts of AS_WRITTEN. */
static inline int32_t cairn_match_is_as_written(const cairn_scan_match *x)
{
    return x->params.mode == CAIRN_SCAN_MATCH_AS_WRITTEN ||
           x->params.mode >= CAIRN_SCAN_MATCH_AS_WRITTEN_COMMON;
}

static inline int32_t cairn_match_has_colinear_filter(const cairn_scan_match *x)
{
    return x->params.mode != CAIRN_SCAN_MATCH_SHAPE_COMMON &&
           x->params.mode != CAIRN_SCAN_MATCH_SHAPE_LINES &&
           x->params.mode != CAIRN_SCAN_MATCH_AS_WRITTEN_COMMON &&
           x->params.mode != CAIRN_SCAN_MATCH_AS_WRITTEN_LINES;
}

static inline int32_t cairn_match_has_segment_filter(const cairn_scan_match *x)
{
    return x->params.mode != CAIRN_SCAN_MATCH_SHAPE_COMMON &&
           x->params.mode != CAIRN_SCAN_MATCH_SHAPE_COLINEAR &&
           x->params.mode != CAIRN_SCAN_MATCH_AS_WRITTEN_COMMON &&
           x->params.mode != CAIRN_SCAN_MATCH_AS_WRITTEN_COLINEAR;
}

static inline int32_t cairn_match_has_icp(const cairn_scan_match *x)
{
    return x->params.mode == CAIRN_SCAN_MATCH_SHAPE ||
           x->params.mode == CAIRN_SCAN_MATCH_SHAPE_LINES ||
           x->params.mode == CAIRN_SCAN_MATCH_AS_WRITTEN ||
           x->params.mode == CAIRN_SCAN_MATCH_AS_WRITTEN_LINES;
}

int32_t cairn_match_shape_target(cairn_scan_match *x);
void cairn_match_shape_begin(cairn_scan_match *x);
int32_t cairn_match_shape_turn(cairn_scan_match *x);
cairn_status cairn_match_shape_align(cairn_scan_match *x, cairn_budget *budget);
int32_t cairn_match_shape_filter(cairn_scan_match *x);
int32_t cairn_match_shape_segment(cairn_scan_match *x);
int32_t cairn_match_shape_translate(cairn_scan_match *x);
int32_t cairn_match_shape_overlap(cairn_scan_match *x);
int32_t cairn_match_shape_is_turned(const cairn_scan_match *x);
/* Back to the rotation and the filters that won. 1: its common subsequence is at hand, the
 * filters are all there is to do. */
int32_t cairn_match_shape_again(cairn_scan_match *x);
void cairn_match_shape_icp_begin(cairn_scan_match *x);
int32_t cairn_match_shape_icp(cairn_scan_match *x);
/* The target point nearest to a query point that lies transformed by `transform`, of a direction
 * within 10 degrees and within the gate; NULL: none. *p: the query point in the target's frame. */
const cairn_oriented_point *cairn_match_shape_partner(cairn_scan_match *x,
                                                      const cairn_oriented_point *q,
                                                      cairn_transform transform, cairn_real gate,
                                                      cairn_vec2 *p, cairn_real *distance);
/* Adds a pair of ICP. */
void cairn_match_shape_add(shape_sums *sums, cairn_vec2 p, cairn_vec2 partner, cairn_real distance);
/* The pose moved by the motion that brings the pairs together. */
cairn_pose cairn_match_shape_moved(const shape_sums *sums, cairn_pose pose);

/* scan_match_written.c: one query point, or the end of a pass; 1 when the alignment ended. */
void cairn_match_written_icp_at(cairn_scan_match *x, cairn_pose start);
int32_t cairn_match_written_icp(cairn_scan_match *x);

#endif
