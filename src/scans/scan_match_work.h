/* Private state of the scan_match module. */
#ifndef CAIRN_SCANS_SCAN_MATCH_WORK_H
#define CAIRN_SCANS_SCAN_MATCH_WORK_H

#include "cairn/registration.h"
#include "cairn/scan_match.h"
#include "src/base/object.h"
#include "src/base/step.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_scan_match_parameters;

enum {
    /* direction bins of the full circle for voting */
    SCAN_MATCH_DIRECTION_BINS = 72,
    /* strips of the target's bounding box, the second sort key */
    SCAN_MATCH_STRIPS = 16,
    /* strips of all direction bins */
    SCAN_MATCH_DIRECTION_CELLS = SCAN_MATCH_DIRECTION_BINS * SCAN_MATCH_STRIPS,
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
    /* direction bins of the target that agree with a query point's: its own and 3 to both sides */
    SCAN_MATCH_AGREEING_BINS = 7,
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

/* Nearest-neighbour query of a point in a grid, row by row from its own one outwards. */
typedef struct scan_match_search {
    const scan_match_index *index;
    cairn_vec2 p, direction;          /* the query point in the target's frame */
    cairn_real cosine;                /* least cosine of the directions */
    cairn_real gate;                  /* m: rows within it are visited */
    cairn_real above, below;          /* m: distances of the next rows */
    int32_t up, down;                 /* the next rows */
    cairn_real nearest;               /* squared distance, m^2 */
    const cairn_oriented_point *best; /* NULL: none so far */
} scan_match_search;

/* Points of the target that are being sorted into a grid: the evenly spaced ones, then the dense
 * ones. */
typedef struct scan_match_sorting {
    int32_t is_dense;
    /* cell of the grid, or point */
    int32_t cell, point;
} scan_match_sorting;

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
    /* query point that votes, and entry of `touched` that is tested for a peak */
    int32_t point, touch;
    /* corner of the grid relative to the query point, and the positions in by_direction that it
     * votes with */
    scan_match_position corner;
    struct {
        int32_t first, end;
    } ranges[SCAN_MATCH_AGREEING_BINS];
    int32_t range_count, pair_count;
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
    int32_t point; /* query point that is paired */
} scan_match_fit;

/* Inliers and free-space violations of one hypothesis. */
typedef struct scan_match_scoring {
    cairn_transform target_query, query_target;
    /* query point, view of the target and target point that are tested, and stride over the last */
    int32_t point, view, sample, sample_stride;
    int32_t query_points; /* query points tested */
    cairn_real fit_sum;   /* sum of the inliers' weights by distance */
    /* query points on a surface, and in the target's free space */
    int32_t inliers, violations;
    /* target samples on the boundary of the query's visibility profile, and in its free space */
    int32_t target_inliers, target_violations;
} scan_match_scoring;

/* State of the shape modes: scan_match_shape.h. */
typedef struct scan_match_shape scan_match_shape;

typedef int32_t scan_match_state;
enum { SCAN_MATCH_IDLE = 0, SCAN_MATCH_RUNNING, SCAN_MATCH_DONE };

struct cairn_scan_match {
    /* State of the steps, and what they use most. */
    /* resume points of the match, of its current phase and of a part of that */
    struct {
        int32_t run, phase, part;
    } resume;
    /* units charged for the operation that waits */
    int32_t units_charged;
    /* parts of a unit that are charged and not used: the rest of the last charge, and what
     * operations were charged that cost less, as is known only behind them */
    int32_t parts_ahead;
    scan_match_state state;
    int32_t stage, hypothesis; /* of STAGES, and the hypothesis that is refined */
    int32_t hypothesis_count, candidate_count;
    int32_t suppressed; /* candidates that have passed the non-maximum suppression or not */
    int32_t target_count, dense_count, view_count, part_count;
    /* 1: a part has no dense points */
    int32_t lacks_dense;
    int32_t is_indexed;
    /* 1: the query has a visibility profile */
    int32_t query_has_view;
    int32_t has_window;

    /* [max_target] in the order of add_target() */
    cairn_oriented_point *target;
    /* [max_dense] */
    cairn_oriented_point *dense;
    /* [max_views] */
    scan_match_view *views;
    cairn_scan_match_hypothesis *hypotheses; /* [max_candidates] */
    /* [max_candidates] bounded heap with the worst on top, then sorted */
    scan_match_candidate *candidates;
    scan_match_shape *shape; /* NULL in mode CORRELATIVE */
    /* The target. */
    /* [max_target] quantized positions of `target`, sorted by direction, then by strip */
    scan_match_position *by_direction;
    /* strips divide the longer side of the target's bounding box, ... */
    int32_t strips_along_y;
    /* ... each 2^strip_bits quantization steps wide */
    int32_t strip_bits;
    cairn_vec2 target_low, target_high, target_sum;
    /* grid of `target` */
    scan_match_index index;
    /* grid of `dense` */
    scan_match_index dense_index;
    /* The query. */
    scan_match_view *query_view;
    /* [MAX_QUERY_POINTS] angle of a voting point's direction, 65536 to the full circle */
    uint16_t *query_angle;
    cairn_scan_match_part query;
    cairn_pose start;
    cairn_scan_match_window window;
    /* Gaussian prior of the window: variance of the uniform distribution */
    cairn_rigid_motion_pose_prior prior;
    cairn_vec2 centroid;
    cairn_real radius;
    /* m: greatest distance of a query point from the origin */
    cairn_real query_extent;
    /* The search. */
    scan_match_accumulator votes;
    scan_match_search search;
    /* The refinement. */
    scan_match_fit fit;
    scan_match_scoring scoring;
    cairn_scan_match_result result;
    cairn_scan_match_measure measure;
    cairn_scan_match_params params;
    scan_match_sorting sorting;
    /* first position of each direction and strip */
    int32_t direction_start[SCAN_MATCH_DIRECTION_CELLS + 1];
};

/* ---- scan_match_charge.c ---- */

/* Charges what parts_ahead lacks for an operation. */
int cairn_scan_match_charge_more(cairn_scan_match *match, cairn_budget *budget, int32_t parts);

/* Charges an operation of `parts` of a unit; returns 1 when it may be done, 0 when the budget is
 * used up. */
inline int cairn_scan_match_charge(cairn_scan_match *match, cairn_budget *budget, int32_t parts)
{
    if (match->parts_ahead < parts && !cairn_scan_match_charge_more(match, budget, parts))
        return 0;
    match->parts_ahead -= parts;
    return 1;
}

/* Place of return of a step: it continues when the operation that follows is charged.
 *
 * point: field of match->resume
 * parts: of a unit; at least those of the operation: what it does not use, it adds to
 *        parts_ahead */
#define SCAN_MATCH_CHARGE(point, parts)                                                            \
    CAIRN_STEP_UNTIL(match->resume.point, cairn_scan_match_charge(match, budget, parts))

/* ---- Phases: each returns 1 when done and 0 when the budget is used up ---- */

/* scan_match_vote.c: candidates by voting, best first. */
int cairn_scan_match_vote(cairn_scan_match *match, cairn_budget *budget);

/* scan_match_rank.c: candidates that pass the non-maximum suppression become hypotheses. */
int cairn_scan_match_suppress(cairn_scan_match *match, cairn_budget *budget);

/* scan_match_fit.c: a stage of the refinement of all hypotheses. */
int cairn_scan_match_refine(cairn_scan_match *match, cairn_budget *budget);

/* ---- Operations ---- */

/* scan_match_index.c */
size_t cairn_scan_match_index_cells(int32_t max_points);
/* Sets the size of the grid, whose starts the caller resets. */
void cairn_scan_match_index_open(scan_match_index *index, int32_t max_points, int32_t count,
                                 cairn_real cell);
void cairn_scan_match_index_count(scan_match_index *index, cairn_vec2 p);
void cairn_scan_match_index_place(scan_match_index *index, cairn_oriented_point p);
/* Starts the search for the nearest point of the grid to a query point.
 *
 * target_query: maps the query point
 * cosine: least cosine of the directions
 * gate: greatest distance, m */
void cairn_scan_match_search_begin(scan_match_search *search, const scan_match_index *index,
                                   const cairn_transform *target_query,
                                   const cairn_oriented_point *point, cairn_real cosine,
                                   cairn_real gate);
/* Continues match->search; returns 1 when `best` and `nearest` are found, 0 when the budget is used
 * up. */
int cairn_scan_match_search_nearest(cairn_scan_match *match, cairn_budget *budget);
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

/* scan_match_vote.c: places the grid and the headings of a search. */
void cairn_scan_match_votes_begin(cairn_scan_match *match);
void cairn_scan_match_clear_votes(cairn_scan_match *match);

/* scan_match_rank.c */
int32_t cairn_scan_match_ranks_before(const scan_match_candidate *a, const scan_match_candidate *b);
void cairn_scan_match_insert_candidate(cairn_scan_match *match,
                                       const scan_match_candidate *candidate, int32_t most);
void cairn_scan_match_sort_candidates(cairn_scan_match *match);
void cairn_scan_match_select(cairn_scan_match *match, int32_t keep);
void cairn_scan_match_decide(cairn_scan_match *match);

#endif
