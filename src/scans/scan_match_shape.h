/* Private state of the shape modes of scan_match. */
#ifndef CAIRN_SCANS_SCAN_MATCH_SHAPE_H
#define CAIRN_SCANS_SCAN_MATCH_SHAPE_H

#include "cairn/sequence.h"
#include "src/scans/scan_match_variants.h"
#include "src/scans/scan_match_work.h"

enum { SCAN_MATCH_SHAPE_BINS = CAIRN_SCAN_MATCH_BINS };

typedef struct scan_match_shape_descriptor {
    uint8_t bin[SCAN_MATCH_SHAPE_BINS]; /* angular histogram; 255: the fullest bin */
} scan_match_shape_descriptor;

/* Pairs without a jump between them; the next segment's first pair ends it. */
typedef struct scan_match_shape_segment {
    int32_t first;
    /* 1: consistent with the current main segment; selected with the best one */
    int32_t is_consistent, is_selected;
} scan_match_shape_segment;

typedef struct scan_match_shape_sums {
    int32_t pairs, overlap;
    cairn_real distance, overlap_distance;
    cairn_vec2 from, to;
    cairn_real cross, dot;
} scan_match_shape_sums;

struct scan_match_shape {
    cairn_sequence *sequence;
    /* [max_target], [max_query] */
    scan_match_shape_descriptor *target, *query;
    /* [max_target] target part of each target point */
    int32_t *target_part;
    /* first point of the current part */
    int32_t part_first;
    /* as written: 1: an iteration adds up pairs, 0: it measures their quality */
    int32_t is_summing;
    /* [max_query] query points in the current rotation */
    cairn_oriented_point *rotated_query;
    /* [max_query] */
    cairn_sequence_pair *pairs;
    /* [max_query + 1] */
    scan_match_shape_segment *segments;
    int32_t pair_count, segment_count;
    /* 1: the collinear filter passes points with nothing but a straight line about them, too */
    int32_t with_lines;
    /* Rotations. */
    /* position of the start */
    cairn_vec2 shift;
    cairn_transform rotation_transform;
    /* angle of the last rotation, whose common subsequence is stored */
    cairn_real first_angle, step, rotated_angle;
    int32_t rotation, rotations, is_fine;
    /* The translation of this rotation. */
    cairn_vec2 best_shift;
    cairn_real best_distance;
    int32_t most_pairs, overlap;
    /* Best result of all rotations, then of ICP. */
    cairn_pose best, last;
    cairn_real best_angle;
    int32_t best_overlap, best_with_lines, last_overlap;
    /* 1: the best rotation is replayed, for the reported pairs */
    int32_t is_replay;
    cairn_real last_mean;
    cairn_real gate, overlap_gate;
    int32_t iteration;
    scan_match_shape_sums sums;
};

/* Steps of the mode; the modes after AS_WRITTEN_COMMON are parts of AS_WRITTEN. */
static inline int32_t cairn_scan_match_is_as_written(const cairn_scan_match *match)
{
    return match->params.mode == CAIRN_SCAN_MATCH_AS_WRITTEN ||
           match->params.mode >= CAIRN_SCAN_MATCH_AS_WRITTEN_COMMON;
}

static inline int32_t cairn_scan_match_has_collinear_filter(const cairn_scan_match *match)
{
    return match->params.mode != CAIRN_SCAN_MATCH_SHAPE_COMMON &&
           match->params.mode != CAIRN_SCAN_MATCH_SHAPE_LINES &&
           match->params.mode != CAIRN_SCAN_MATCH_AS_WRITTEN_COMMON &&
           match->params.mode != CAIRN_SCAN_MATCH_AS_WRITTEN_LINES;
}

static inline int32_t cairn_scan_match_has_segment_filter(const cairn_scan_match *match)
{
    return match->params.mode != CAIRN_SCAN_MATCH_SHAPE_COMMON &&
           match->params.mode != CAIRN_SCAN_MATCH_SHAPE_COLINEAR &&
           match->params.mode != CAIRN_SCAN_MATCH_AS_WRITTEN_COMMON &&
           match->params.mode != CAIRN_SCAN_MATCH_AS_WRITTEN_COLINEAR;
}

static inline int32_t cairn_scan_match_has_icp(const cairn_scan_match *match)
{
    return match->params.mode == CAIRN_SCAN_MATCH_SHAPE ||
           match->params.mode == CAIRN_SCAN_MATCH_SHAPE_LINES ||
           match->params.mode == CAIRN_SCAN_MATCH_AS_WRITTEN ||
           match->params.mode == CAIRN_SCAN_MATCH_AS_WRITTEN_LINES;
}

int32_t cairn_scan_match_shape_describe_target(cairn_scan_match *match);
void cairn_scan_match_shape_begin(cairn_scan_match *match);
int32_t cairn_scan_match_shape_rotate(cairn_scan_match *match);
cairn_status cairn_scan_match_shape_align(cairn_scan_match *match, cairn_budget *budget);
int32_t cairn_scan_match_shape_filter(cairn_scan_match *match);
int32_t cairn_scan_match_shape_segment(cairn_scan_match *match);
int32_t cairn_scan_match_shape_translate(cairn_scan_match *match);
int32_t cairn_scan_match_shape_overlap(cairn_scan_match *match);
int32_t cairn_scan_match_shape_has_ended(const cairn_scan_match *match);
/* Restores the winning rotation and filters. Returns 1 when its common subsequence is stored, so
 * that only the filters remain. */
int32_t cairn_scan_match_shape_restore_best(cairn_scan_match *match);
void cairn_scan_match_shape_icp_begin(cairn_scan_match *match);
int32_t cairn_scan_match_shape_icp(cairn_scan_match *match);
/* Returns the target point nearest to query point q mapped by `transform`, of a direction within 10
 * degrees and within the gate; NULL: none. *p: the query point in the target's frame. */
const cairn_oriented_point *cairn_scan_match_shape_nearest(cairn_scan_match *match,
                                                           const cairn_oriented_point *point,
                                                           cairn_transform transform,
                                                           cairn_real gate, cairn_vec2 *p,
                                                           cairn_real *distance);
/* Adds a pair to the sums of ICP. */
void cairn_scan_match_shape_add_pair(scan_match_shape_sums *sums, cairn_vec2 p, cairn_vec2 partner,
                                     cairn_real distance);
/* Returns the pose moved by the least-squares motion of the pairs (closed form). */
cairn_pose cairn_scan_match_shape_move(const scan_match_shape_sums *sums, cairn_pose pose);

/* scan_match_written.c: one query point, or the end of a pass; returns 1 at the end of the ICP. */
void cairn_scan_match_written_icp_begin(cairn_scan_match *match, cairn_pose start);
int32_t cairn_scan_match_written_icp(cairn_scan_match *match);

#endif
