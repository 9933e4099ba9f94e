/* What the parts of scan_match share. */
#ifndef CAIRN_SCAN_MATCH_WORK_H
#define CAIRN_SCAN_MATCH_WORK_H

#include "cairn/rigid_motion.h"
#include "cairn/scan_match.h"

enum {
    /* bins of the full circle by which points vote */
    MATCH_DIRECTIONS = 72,
    /* strips of the target's box by which they are sorted, too */
    MATCH_COLUMNS = 16,
    /* parts of a cell of the votes */
    MATCH_SPOTS = 256,
    /* bins of a profile */
    MATCH_BEARINGS = 256,
    MATCH_SIDE_MOST = 256,
    MATCH_CELLS_MOST = MATCH_SIDE_MOST * MATCH_SIDE_MOST,
    /* of a window without extent */
    MATCH_CELLS_LEAST = 25,
    /* query points that vote, at most */
    MATCH_VOTERS = 256,
    /* target points that are looked for in the query's free space, at most */
    MATCH_WITNESSES = 192,
    MATCH_STAGES = 3,
    /* parts of a unit */
    MATCH_PART = 16
};

static const cairn_real MATCH_CELL = 2; /* spacings, side of a cell of the votes */

/* Oriented points by cells of a grid that is wrapped around: point sets of any extent in fixed
 * memory, points of one cell and of the cells of a row side by side. */
typedef struct match_index {
    cairn_oriented_point *points; /* [count], sorted by cell */
    int32_t *start;               /* [side * side + 1] */
    int32_t side;                 /* cells, a power of two */
    int32_t count;
    cairn_real cell, per_metre; /* side of a cell, m, and 1 / that */
} match_index;

/* A search for the nearest point: where, of what direction, how near in cosine; what was found. */
typedef struct match_search {
    cairn_vec2 p, direction;
    cairn_real cosine;
    cairn_real nearest; /* squared distance */
    const cairn_oriented_point *best;
} match_search;

/* How far a sensor saw by bearing, in the frame of the target (or of the query). */
typedef struct match_profile {
    cairn_vec2 sensor;
    float range[MATCH_BEARINGS]; /* m, the least of the bin; negative: nothing known */
} match_profile;

/* A position in parts of a cell of the votes: whole numbers, so that a vote costs a few integer
 * operations. */
typedef struct match_spot {
    int32_t x, y;
} match_spot;

typedef struct match_candidate {
    cairn_pose pose;
    cairn_real score;
    int32_t order; /* that breaks ties */
} match_candidate;

/* Where query points vote for the position of the query's origin. */
typedef struct match_votes {
    uint16_t *cell;    /* [capacity] all 0 between rotations */
    uint16_t *touched; /* [capacity] cells that are not 0 */
    int32_t touched_count;
    int32_t width, height;
    cairn_vec2 origin; /* corner of the grid */
    cairn_real side;   /* of a cell, m */
    int32_t rotations, rotation;
    cairn_real first_angle, angle_step;
    cairn_transform turn;
    uint16_t heading; /* its angle, as of query_turn */
    int32_t stride;   /* of the query points that vote */
    int32_t shift;    /* of the votes in a cell */
    int32_t most;     /* candidates to keep */
} match_votes;

/* Point-to-line sums over the pairs of one iteration. */
typedef struct match_sums {
    cairn_sym3 lines;
    cairn_sym3 cross; /* of the normals of both points of each pair */
    cairn_real gradient[3];
    cairn_real weight, squares, psi_squares, slopes;
    int32_t pairs;
} match_sums;

typedef struct match_stage {
    int32_t points;                  /* of the query, at most */
    int32_t iterations;              /* at most */
    int32_t keep;                    /* poses that go on */
    int32_t dense;                   /* 1: the query's dense points, if there are any */
    cairn_real gate_start, gate_end; /* m, in spacings */
} match_stage;

typedef struct match_fit {
    cairn_rigid_motion motion;
    const cairn_oriented_point *points; /* of the query */
    int32_t count, stride;
    const match_index *index; /* of the target */
    int32_t iteration;
    cairn_real gate, sigma;
    match_sums sums;
} match_fit;

/* Points of one hypothesis by what they say. */
typedef struct match_tally {
    int32_t asked;                                 /* query points */
    cairn_real closeness;                          /* sum over those explained */
    int32_t explained, contradicted;               /* of the query */
    int32_t target_explained, target_contradicted; /* of the target's witnesses */
} match_tally;

/* Matching by shape: scan_match_shape.h. */
typedef struct match_shape match_shape;

typedef int32_t match_phase;
enum {
    MATCH_IDLE = 0,
    MATCH_RESET,
    MATCH_COUNT, /* target points by cell and by direction */
    MATCH_SUM,   /* their places */
    MATCH_PLACE,
    MATCH_VOTE,
    MATCH_PEAKS,
    MATCH_CHOOSE, /* the peaks that are refined */
    MATCH_FIT,
    MATCH_TALLY,
    MATCH_RANK,
    MATCH_SHAPE_TARGET,
    MATCH_SHAPE_TURN,
    MATCH_SHAPE_ALIGN,
    MATCH_SHAPE_FILTER,
    MATCH_SHAPE_SEGMENT,
    MATCH_SHAPE_TRANSLATE,
    MATCH_SHAPE_OVERLAP,
    MATCH_SHAPE_ICP,
    MATCH_DONE
};

struct cairn_scan_match {
    cairn_scan_match_params params;
    /* The target. */
    /* [max_target] as they came */
    cairn_oriented_point *target;
    /* [max_dense] */
    cairn_oriented_point *dense;
    /* [max_views] */
    match_profile *views;
    int32_t target_count, dense_count, view_count, part_count;
    /* 1: a part came without dense points */
    int32_t lacks_dense;
    int32_t is_indexed;
    /* of `target` */
    match_index index;
    /* of `dense` */
    match_index dense_index;
    /* [max_target] positions of `target`, sorted by direction, then by column */
    match_spot *by_direction;
    /* of by_direction */
    int32_t direction_start[MATCH_DIRECTIONS * MATCH_COLUMNS + 1];
    cairn_vec2 target_low, target_high, target_sum;
    /* the longer side of the target's box is cut into columns, ... */
    int32_t columns_along_y;
    /* ... of 2^column_bits parts of a cell */
    int32_t column_bits;
    /* The query. */
    cairn_scan_match_part query;
    match_profile *query_profile;
    /* its beams are known */
    int32_t query_sees;
    /* [MATCH_VOTERS] angle of the direction of a point that votes, 65536 to the full circle */
    uint16_t *query_turn;
    cairn_pose start;
    cairn_scan_match_window window;
    int32_t has_window;
    /* of the window: the variance of a uniform distribution */
    cairn_pose_prior prior;
    cairn_vec2 centroid;
    cairn_real radius;
    /* of the farthest point from the origin, m */
    cairn_real query_reach;
    /* The search. */
    match_votes votes;
    match_candidate *candidates; /* [max_candidates] a heap with the worst on top, then sorted */
    int32_t candidate_count;
    match_shape *shape; /* NULL in the other mode */
    /* The refinement. */
    cairn_scan_match_hypothesis *hypotheses; /* [max_candidates] */
    int32_t hypothesis_count;
    int32_t stage;
    match_fit fit;
    match_tally tally;
    cairn_transform tally_transform, tally_inverse; /* target_query, query_target */
    int32_t tally_stride, witness_stride;
    /* The machine. */
    match_phase phase;
    int32_t at, other;
    int32_t owed; /* parts of units of items done that are not yet paid for */
    cairn_scan_match_result result;
    cairn_scan_match_measure measure;
};

/* Charges the item under way. */
static inline void cairn_match_charge(cairn_scan_match *x, int32_t parts)
{
    x->owed += parts;
}

/* scan_match_index.c */
size_t cairn_match_index_cells(int32_t max_points);
void cairn_match_index_reset(match_index *index, int32_t max_points, int32_t count,
                             cairn_real cell);
void cairn_match_index_count(match_index *index, cairn_vec2 p);
void cairn_match_index_sum(match_index *index, int32_t first, int32_t end);
void cairn_match_index_place(match_index *index, cairn_oriented_point p);
/* The nearest point within the gate that points the same way; NULL: none. *parts grows by the
 * cost. */
const cairn_oriented_point *cairn_match_index_nearest(const match_index *index, match_search *asked,
                                                      cairn_real gate, int32_t *parts);
/* scan_match_spots.c: the target's points by direction and column. */
void cairn_match_spots_reset(cairn_scan_match *x);
void cairn_match_spots_count(cairn_scan_match *x, const cairn_oriented_point *p);
void cairn_match_spots_sum(cairn_scan_match *x);
/* The last point first, so that those of a bin and column stay in their order. */
void cairn_match_spots_place(cairn_scan_match *x, const cairn_oriented_point *p);
match_spot cairn_match_spot(const cairn_scan_match *x, cairn_vec2 p);
/* Column of a coordinate along the longer side of the target's box; those outside are in the
 * first or last. */
int32_t cairn_match_column(const cairn_scan_match *x, match_spot spot);
/* An angle, rad, in 65536ths of the full circle, wrapped. */
uint16_t cairn_match_turn(cairn_real angle);
/* Bin of an angle by which points vote. */
int32_t cairn_match_turn_bin(uint16_t turn);

/* scan_match_free.c */
void cairn_match_profile_clear(match_profile *profile, cairn_vec2 sensor);
void cairn_match_profile_add(match_profile *profile, cairn_vec2 to);
/* 1: the point stands in space that was seen free; -1: it lies where the sensor's sight ended,
 * 0: nothing is known. */
int32_t cairn_match_profile_ask(const match_profile *profile, cairn_vec2 p, cairn_real margin);

/* scan_match_vote.c: one item each; 1 when the phase is through. */
void cairn_match_votes_begin(cairn_scan_match *x);
int32_t cairn_match_vote(cairn_scan_match *x);
int32_t cairn_match_peaks(cairn_scan_match *x);

/* scan_match_step.c: the first phase of a match, or of an alignment by ICP alone. */
void cairn_match_start(cairn_scan_match *x);
void cairn_match_start_icp(cairn_scan_match *x, cairn_pose start);

/* scan_match_fit.c */
void cairn_match_fit_begin(cairn_scan_match *x, cairn_pose pose);
int32_t cairn_match_fit_item(cairn_scan_match *x);
void cairn_match_tally_begin(cairn_scan_match *x);
int32_t cairn_match_tally_item(cairn_scan_match *x);
const match_stage *cairn_match_stage_of(const cairn_scan_match *x);

/* scan_match_rank.c */
int32_t cairn_match_before(const match_candidate *a, const match_candidate *b);
void cairn_match_keep(cairn_scan_match *x, const match_candidate *candidate, int32_t most);
void cairn_match_sort(cairn_scan_match *x);
int32_t cairn_match_choose(cairn_scan_match *x);
void cairn_match_thin(cairn_scan_match *x, int32_t keep);
void cairn_match_judge(cairn_scan_match *x);

#endif
