/* Private state of the scan_match module. */
#ifndef CAIRN_SCANS_SCAN_MATCH_WORK_H
#define CAIRN_SCANS_SCAN_MATCH_WORK_H

#include "cairn/registration.h"
#include "cairn/scan_match.h"
#include "src/base/object.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_scan_match_parameters;

enum {
    /* direction bins of the full circle for voting */
    SCAN_MATCH_DIRECTION_BINS = 72,
    /* strips of the target's bounding box, the second sort key */
    SCAN_MATCH_STRIPS = 16,
    /* quantization steps per cell side of the vote accumulator */
    SCAN_MATCH_CELL_STEPS = 256,
    SCAN_MATCH_MAX_SIDE = 256,
    SCAN_MATCH_MAX_CELLS = SCAN_MATCH_MAX_SIDE * SCAN_MATCH_MAX_SIDE,
    /* cells of a window without extent */
    SCAN_MATCH_MIN_CELLS = 25,
    /* query points that vote, at most */
    SCAN_MATCH_MAX_QUERY_POINTS = 256,
    /* target samples tested in the query's visibility profile, at most */
    SCAN_MATCH_MAX_TARGET_SAMPLES = 192,
    SCAN_MATCH_STAGES = 3,
    /* parts of a work unit */
    SCAN_MATCH_PARTS_PER_UNIT = 16
};

/* cell side of the vote accumulator, in spacings */
static const cairn_real SCAN_MATCH_CELL_SPACINGS = 2;

/* Spatial hash grid of oriented points, wrapped around: point sets of any extent in fixed memory.
 * Points of one cell, and of the cells of a row, are contiguous. */
typedef struct scan_match_index {
    cairn_oriented_point *points; /* [count], sorted by cell */
    int32_t *start;               /* [side * side + 1] */
    int32_t side;                 /* cells, a power of two */
    int32_t count;
    cairn_real cell, per_metre; /* cell side, m, and its reciprocal */
} scan_match_index;

/* Nearest-neighbour query: position, direction and least cosine; result. */
typedef struct scan_match_search {
    cairn_vec2 p, direction;
    cairn_real cosine;
    cairn_real nearest; /* squared distance, m^2 */
    const cairn_oriented_point *best;
} scan_match_search;

/* Visibility profile of a part, in its own frame, with its ranges. */
typedef struct scan_match_view {
    cairn_visibility visibility;
    /* the target in the frame of the part; of the target's views */
    cairn_transform part_target;
    uint16_t range[CAIRN_VISIBILITY_BINS];
} scan_match_view;

/* A quantized position: integers, so that a vote costs a few integer operations. */
typedef struct scan_match_position {
    int32_t x, y;
} scan_match_position;

typedef struct scan_match_candidate {
    cairn_pose pose;
    cairn_real score;
    int32_t order; /* tie-break */
} scan_match_candidate;

/* Vote accumulator (Hough voting) over positions of the query's origin, for one heading. */
typedef struct scan_match_accumulator {
    uint16_t *cell;    /* [capacity] all 0 between rotations */
    uint16_t *touched; /* [capacity] cells that are not 0 */
    int32_t touched_count;
    int32_t width, height;
    cairn_vec2 origin;    /* corner of the grid */
    cairn_real cell_size; /* side of a cell, m */
    int32_t rotations, rotation;
    cairn_real first_angle, angle_step;
    cairn_transform rotation_transform;
    uint16_t quantized_heading; /* heading of the rotation, quantized as query_angle */
    int32_t stride;             /* stride over the query points that vote */
    int32_t count_shift;        /* bits by which the count is shifted in a cell */
    int32_t max_candidates;     /* candidates to keep */
} scan_match_accumulator;

typedef struct scan_match_stage {
    int32_t points;                  /* query points, at most */
    int32_t iterations;              /* iterations, at most */
    int32_t keep;                    /* hypotheses for the next stage */
    int32_t dense;                   /* 1: use the query's dense points, if it has any */
    cairn_real gate_start, gate_end; /* distance gate, in spacings */
} scan_match_stage;

typedef struct scan_match_fit {
    cairn_registration robust; /* point to line */
    /* information of the normals of both points of each pair, see scan_match_fit.c */
    cairn_sym3 cross;
    const cairn_oriented_point *points; /* query points */
    int32_t count, stride;
    const scan_match_index *index; /* grid of the target points */
    int32_t iteration;
} scan_match_fit;

/* Inliers and free-space violations of one hypothesis. */
typedef struct scan_match_inlier_count {
    int32_t query_points; /* query points tested */
    cairn_real fit_sum;   /* sum of the inliers' weights by distance */
    /* query points on a surface, and in the target's free space */
    int32_t inliers, violations;
    /* target samples on the boundary of the query's visibility profile, and in its free space */
    int32_t target_inliers, target_violations;
} scan_match_inlier_count;

/* State of the shape modes: scan_match_shape.h. */
typedef struct scan_match_shape scan_match_shape;

typedef int32_t scan_match_phase;
enum {
    SCAN_MATCH_IDLE = 0,
    SCAN_MATCH_RESET, /* empty grids of the target */
    SCAN_MATCH_COUNT, /* target points by cell and by direction (counting sort) */
    SCAN_MATCH_SUM,   /* prefix sums */
    SCAN_MATCH_PLACE,
    SCAN_MATCH_VOTE,            /* votes of one heading */
    SCAN_MATCH_PEAKS,           /* peaks of one heading */
    SCAN_MATCH_CHOOSE,          /* non-maximum suppression of the candidates */
    SCAN_MATCH_FIT,             /* refinement of a hypothesis */
    SCAN_MATCH_SCORE,           /* inliers and violations of a hypothesis */
    SCAN_MATCH_RANK,            /* pruning, or the decision */
    SCAN_MATCH_SHAPE_TARGET,    /* histograms of the target */
    SCAN_MATCH_SHAPE_TURN,      /* next rotation, histograms of the query */
    SCAN_MATCH_SHAPE_ALIGN,     /* longest common subsequence */
    SCAN_MATCH_SHAPE_FILTER,    /* collinear filter */
    SCAN_MATCH_SHAPE_SEGMENT,   /* segment filter */
    SCAN_MATCH_SHAPE_TRANSLATE, /* translation of the segments */
    SCAN_MATCH_SHAPE_OVERLAP,   /* scan overlap */
    SCAN_MATCH_SHAPE_ICP,
    SCAN_MATCH_DONE
};

struct cairn_scan_match {
    cairn_scan_match_params params;
    /* The target. */
    /* [max_target] in the order of add_target() */
    cairn_oriented_point *target;
    /* [max_dense] */
    cairn_oriented_point *dense;
    /* [max_views] */
    scan_match_view *views;
    int32_t target_count, dense_count, view_count, part_count;
    /* 1: a part has no dense points */
    int32_t lacks_dense;
    int32_t is_indexed;
    /* grid of `target` */
    scan_match_index index;
    /* grid of `dense` */
    scan_match_index dense_index;
    /* [max_target] quantized positions of `target`, sorted by direction, then by strip */
    scan_match_position *by_direction;
    /* first position of each direction and strip */
    int32_t direction_start[SCAN_MATCH_DIRECTION_BINS * SCAN_MATCH_STRIPS + 1];
    cairn_vec2 target_low, target_high, target_sum;
    /* strips divide the longer side of the target's bounding box, ... */
    int32_t strips_along_y;
    /* ... each 2^strip_bits quantization steps wide */
    int32_t strip_bits;
    /* The query. */
    cairn_scan_match_part query;
    scan_match_view *query_view;
    /* 1: the query has a visibility profile */
    int32_t query_has_view;
    /* [MAX_QUERY_POINTS] angle of a voting point's direction, 65536 to the full circle */
    uint16_t *query_angle;
    cairn_pose start;
    cairn_scan_match_window window;
    int32_t has_window;
    /* Gaussian prior of the window: variance of the uniform distribution */
    cairn_rigid_motion_pose_prior prior;
    cairn_vec2 centroid;
    cairn_real radius;
    /* m: greatest distance of a query point from the origin */
    cairn_real query_extent;
    /* The search. */
    scan_match_accumulator votes;
    /* [max_candidates] bounded heap with the worst on top, then sorted */
    scan_match_candidate *candidates;
    int32_t candidate_count;
    scan_match_shape *shape; /* NULL in mode CORRELATIVE */
    /* The refinement. */
    cairn_scan_match_hypothesis *hypotheses; /* [max_candidates] */
    int32_t hypothesis_count;
    int32_t stage;
    scan_match_fit fit;
    scan_match_inlier_count inlier_count;
    cairn_transform target_query, query_target; /* target_query, query_target */
    int32_t query_stride, target_stride;
    /* State of the steps. */
    scan_match_phase phase;
    int32_t index_in_phase, hypothesis_index;
    int32_t parts_due; /* parts of units of finished items, not yet charged */
    cairn_scan_match_result result;
    cairn_scan_match_measure measure;
};

/* Charges the current item. */
static inline void cairn_scan_match_charge(cairn_scan_match *match, int32_t parts)
{
    match->parts_due += parts;
}

/* scan_match_index.c */
size_t cairn_scan_match_index_cells(int32_t max_points);
void cairn_scan_match_index_reset(scan_match_index *index, int32_t max_points, int32_t count,
                                  cairn_real cell);
void cairn_scan_match_index_count(scan_match_index *index, cairn_vec2 p);
void cairn_scan_match_index_sum(scan_match_index *index, int32_t first, int32_t end);
void cairn_scan_match_index_place(scan_match_index *index, cairn_oriented_point p);
/* Returns the nearest point within the distance gate and the direction gate; NULL: none. *parts
 * grows by the cost. */
const cairn_oriented_point *cairn_scan_match_index_nearest(const scan_match_index *index,
                                                           scan_match_search *search,
                                                           cairn_real gate, int32_t *parts);
/* scan_match_positions.c: quantized target positions by direction and strip. */
void cairn_scan_match_positions_reset(cairn_scan_match *match);
void cairn_scan_match_positions_count(cairn_scan_match *match, const cairn_oriented_point *point);
void cairn_scan_match_positions_sum(cairn_scan_match *match);
/* Called with the last point first, so that the sort is stable. */
void cairn_scan_match_positions_place(cairn_scan_match *match, const cairn_oriented_point *point);
scan_match_position cairn_scan_match_quantize(const cairn_scan_match *match, cairn_vec2 p);
/* Returns the strip of a position along the longer side of the target's bounding box; positions
 * outside are in the first or last. */
int32_t cairn_scan_match_strip(const cairn_scan_match *match, scan_match_position q);
/* Returns an angle, rad, quantized to 65536ths of the full circle, wrapped. */
uint16_t cairn_scan_match_quantize_angle(cairn_real angle);
/* Returns the direction bin of a quantized angle. */
int32_t cairn_scan_match_angle_bin(uint16_t turn);

/* scan_match_vote.c: one item each; returns 1 at the end of the phase. */
void cairn_scan_match_votes_begin(cairn_scan_match *match);
int32_t cairn_scan_match_vote_item(cairn_scan_match *match);
int32_t cairn_scan_match_peak_item(cairn_scan_match *match);

/* scan_match_step.c: starts the first phase of a match, or of an ICP alone. */
void cairn_scan_match_start(cairn_scan_match *match);
void cairn_scan_match_start_icp(cairn_scan_match *match, cairn_pose start);

/* scan_match_fit.c */
void cairn_scan_match_fit_begin(cairn_scan_match *match, cairn_pose pose);
int32_t cairn_scan_match_fit_item(cairn_scan_match *match);
void cairn_scan_match_score_begin(cairn_scan_match *match);
int32_t cairn_scan_match_score_item(cairn_scan_match *match);
const scan_match_stage *cairn_scan_match_current_stage(const cairn_scan_match *match);

/* scan_match_rank.c */
int32_t cairn_scan_match_ranks_before(const scan_match_candidate *a, const scan_match_candidate *b);
void cairn_scan_match_insert_candidate(cairn_scan_match *match,
                                       const scan_match_candidate *candidate, int32_t most);
void cairn_scan_match_sort_candidates(cairn_scan_match *match);
int32_t cairn_scan_match_suppress_item(cairn_scan_match *match);
void cairn_scan_match_select(cairn_scan_match *match, int32_t keep);
void cairn_scan_match_decide(cairn_scan_match *match);

#endif
