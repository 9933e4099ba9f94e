/* Private state of the shape modes of scan_match. */
#ifndef CAIRN_SCANS_SCAN_MATCH_SHAPE_H
#define CAIRN_SCANS_SCAN_MATCH_SHAPE_H

#include "cairn/sequence.h"
#include "src/scans/scan_match_variants.h"
#include "src/scans/scan_match_work.h"

enum { SCAN_MATCH_SHAPE_BINS = CAIRN_SCAN_MATCH_BINS };

/* cosine of 10 degrees: similar directions */
static const cairn_real SCAN_MATCH_SIMILAR_COSINE = CAIRN_REAL(0.98480775);

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

/* Histogram of a point that is being counted. */
typedef struct scan_match_histogram {
    const cairn_oriented_point *points;
    /* the point; those of its scan are first ... end - 1, of which `next` is counted next */
    int32_t point, first, end, next;
    cairn_transform rotation; /* of the bearings */
    int32_t count[SCAN_MATCH_SHAPE_BINS];
} scan_match_histogram;

/* A pass over the query's points: overlap with the target, and pairs for a motion. */
typedef struct scan_match_shape_pass {
    cairn_transform target_query;
    cairn_real gate, pair_gate; /* m: greatest distance, and that of a pair, < 0: none */
    int32_t point;
    scan_match_shape_sums sums;
} scan_match_shape_pass;

/* The ICP: the pose before the last motion, its overlap, -1: none yet, and the mean distance
 * there. */
typedef struct scan_match_shape_icp {
    cairn_pose last;
    int32_t last_overlap, iteration;
    cairn_real last_mean;
} scan_match_shape_icp;

struct scan_match_shape {
    cairn_sequence *sequence;
    /* [max_target], [max_query] */
    scan_match_shape_descriptor *target, *query;
    /* [max_target] target part of each target point */
    int32_t *target_part;
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
    int32_t most_pairs;
    /* Best result of all rotations, then of ICP. */
    cairn_pose best;
    cairn_real best_angle;
    int32_t best_overlap, best_with_lines;
    /* m: distances up to which points of the best result overlap, and those of the last match with
     * this target, 0: none yet */
    cairn_real gate, overlap_gate;
    /* State of the parts: points whose histogram is made, ... */
    scan_match_histogram histogram;
    /* ... pair that is filtered, segment that is tested, ... */
    int32_t filtered, tested;
    /* ... overlap and ICP. */
    scan_match_shape_pass pass;
    scan_match_shape_icp icp;
};

/* Steps of the mode; AS_WRITTEN and its parts are the odd ones. */
static inline int32_t cairn_scan_match_is_as_written(const cairn_scan_match *match)
{
    return match->params.mode & 1;
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

/* Sets the rotations of a search; without any, the pose that an ICP alone starts from. */
void cairn_scan_match_shape_begin(cairn_scan_match *match);
void cairn_scan_match_shape_begin_icp(cairn_scan_match *match, cairn_pose start);

/* ---- Phases: each returns 1 when done and 0 when the budget is used up ---- */

/* Descriptors of the target. */
int cairn_scan_match_shape_describe_target(cairn_scan_match *match, cairn_budget *budget);

/* The best pose of all rotations, and the pairs of the winning rotation and filters. */
int cairn_scan_match_shape_search(cairn_scan_match *match, cairn_budget *budget);

/* The ICP from that pose: scan_match_shape_icp.c. */
int cairn_scan_match_shape_icp(cairn_scan_match *match, cairn_budget *budget);

/* The same as written: scan_match_written.c. */
int cairn_scan_match_written_icp(cairn_scan_match *match, cairn_budget *budget);

/* ---- Passes and motions ---- */

/* Part: a pass over the query's points. */
int cairn_scan_match_shape_pass(cairn_scan_match *match, cairn_budget *budget);

/* Starts the ICP. */
void cairn_scan_match_shape_start_icp(cairn_scan_match *match);

/* Starts a pass of the ICP in its pose; see scan_match_shape_pass. */
void cairn_scan_match_shape_start_pass(scan_match_shape *shape, cairn_real gate,
                                       cairn_real pair_gate);

/* Returns 1, and restores the last pose, when the overlap has fallen and the mean distance has
 * risen since. Otherwise stores both. */
int cairn_scan_match_shape_rolls_back(scan_match_shape *shape);

/* Moves the pose by the least-squares motion of the pairs (closed form). */
void cairn_scan_match_shape_move(scan_match_shape *shape);

#endif
