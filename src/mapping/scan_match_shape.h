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
    shape_descriptor *target, *query; /* [max_target], [max_query] */
    int32_t *part_of;                 /* [max_target] number of the part of a target point */
    int32_t part_first;               /* first point of the part at work */
    cairn_oriented_point *turned;     /* [max_query] the query as it lies now */
    cairn_sequence_pair *pairs;       /* [max_query] */
    shape_segment *segments;          /* [max_query + 1] */
    int32_t pair_count, segment_count;
    int32_t with_lines; /* 1: points with nothing but a straight line about them pass the colinear filter, too */
    /* Rotations. */
    cairn_vec2 shift; /* of the start */
    cairn_transform turn;
    cairn_real first_angle, step, turned_angle; /* the last: of the rotation whose common subsequence is known */
    int32_t rotation, rotations, is_fine;
    /* The translation of this rotation. */
    cairn_vec2 best_shift;
    cairn_real best_distance;
    int32_t most_pairs, overlap;
    /* The best of all rotations, then that of ICP. */
    cairn_pose best, last;
    cairn_real best_angle;
    int32_t best_overlap, best_with_lines, last_overlap;
    int32_t is_again; /* 1: the best of the rotations is gone through once more, for the pairs that pictures show */
    cairn_real last_mean;
    cairn_real gate, overlap_gate;
    int32_t iteration;
    shape_sums sums;
};

int32_t cairn_match_shape_target(cairn_scan_match *x);
void cairn_match_shape_begin(cairn_scan_match *x);
int32_t cairn_match_shape_turn(cairn_scan_match *x);
cairn_status cairn_match_shape_align(cairn_scan_match *x, cairn_budget *budget);
int32_t cairn_match_shape_filter(cairn_scan_match *x);
int32_t cairn_match_shape_segment(cairn_scan_match *x);
int32_t cairn_match_shape_translate(cairn_scan_match *x);
int32_t cairn_match_shape_overlap(cairn_scan_match *x);
int32_t cairn_match_shape_is_turned(const cairn_scan_match *x);
/* Back to the rotation and the filters that won. 1: its common subsequence is at hand, the filters are all there is to do. */
int32_t cairn_match_shape_again(cairn_scan_match *x);
void cairn_match_shape_icp_begin(cairn_scan_match *x);
int32_t cairn_match_shape_icp(cairn_scan_match *x);

#endif
