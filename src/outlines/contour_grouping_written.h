/* Shared definitions of the mode as written of contour_grouping. */
#ifndef CAIRN_OUTLINES_CONTOUR_GROUPING_WRITTEN_H
#define CAIRN_OUTLINES_CONTOUR_GROUPING_WRITTEN_H

#include "cairn/symmetric_point.h"
#include "src/outlines/contour_grouping_work.h"

/* Greatest number of new segments considered for extending a side, the nearest ones; candidates
 * that there is memory for, for each particle on average. */
enum {
    CONTOUR_GROUPING_WRITTEN_MAX_EXTENSIONS = 31,
    CONTOUR_GROUPING_WRITTEN_CANDIDATES_PER_PARTICLE = 100
};

/* State of a particle: the current symmetric point, its two segments and their open ends. */
typedef struct contour_grouping_written_state {
    /* px, current and first symmetric point: x_t and x_1 */
    cairn_vec2 centre, start;
    /* px, rad */
    cairn_real radius, deviation;
    /* nats, sum over the trajectory of the logarithms of (2.11) times (2.13) over
     * stop_likelihood */
    cairn_real log_posterior;
    /* nats, mass (2.11) of the last step; 0 for the first point */
    cairn_real log_mass;
    /* segment indices on the left and right of the direction of travel */
    int32_t segment[2];
    /* open ends: twice the segment index, plus one for its second end */
    int32_t end[2];
    /* 0: the model's path is followed from its start, 1: from its end */
    int32_t is_reversed;
    /* nearest model sample, k of (2.12), counted from where the path is followed */
    int32_t sample;
} contour_grouping_written_state;

/* One side of the contour so far, as a polyline through both ends of each segment. */
typedef struct contour_grouping_written_side {
    cairn_vec2 *vertex; /* [2 * max_steps] px */
    int32_t vertex_count;
} contour_grouping_written_side;

/* A candidate segment for extending a side. */
typedef struct contour_grouping_written_extension {
    cairn_real gap;   /* px, distance from the side's open end */
    int32_t open_end; /* index of the new open end */
    int32_t is_kept;  /* 1: the side keeps its segment */
} contour_grouping_written_extension;

struct contour_grouping_written {
    cairn_symmetric_point_set *set;
    /* grid of all segment ends: 2 i and 2 i + 1 belong to segment i */
    cairn_point_grid *ends;
    /* grid of the ends of strong chains */
    cairn_point_grid *chain_ends;
    /* [slot_count] hash table from pairs of segments to symmetric points, -1: empty */
    int32_t *pair_slots;
    /* [max_tokens] latest stamp of each segment (mark by generation) */
    int32_t *segment_stamp;
    /* [max_objects * max_steps] recorded trajectories, by slot */
    cairn_contour_grouping_disc *trajectories;
    /* [max_objects] slot of each object of the result */
    int32_t *trajectory_slot;
    /* [max_steps] states of the current particle's history */
    const contour_grouping_written_state **history;
    contour_grouping_written_side side[2];
    /* [4 * max_steps] px, explored region: left side, then right side reversed */
    cairn_vec2 *polygon;
    /* parameters of the symmetric points in this image */
    cairn_symmetric_point_params points;
    /* slot_count: a power of two; stamp: the current generation */
    int32_t slot_count, stamp;
    int32_t history_count, polygon_count;
    /* slot, symmetric point, segment end, start state, particle or object of the current loop */
    int32_t cursor;
    /* CAIRN_CONTOUR_GROUPING_...: termination reason */
    int32_t end_reason;
    /* work units of the current proposal */
    int32_t proposal_units;
    /* start states with a positive mass */
    int32_t start_count;
    /* initial particles sampled so far */
    int32_t sampled_count;
    /* px, searched size */
    cairn_real size;
    /* mean radius of the model's path, share of the size */
    cairn_real mean_radius;
    /* sum of all start masses, and of those already passed in sampling */
    cairn_real mass_sum, passed_mass;
    /* nats, logarithm of stop_likelihood */
    cairn_real log_stop;
    int32_t dropped_candidates;
    cairn_random random;
};

/* Position of a segment end, px: index 2 i is the first and 2 i + 1 the second end of segment i. */
static inline cairn_vec2 contour_grouping_written_end(const cairn_contour_grouping *grouping,
                                                      int32_t end)
{
    const cairn_segment *s = &grouping->input.segments[end / 2];

    return end % 2 ? s->b : s->a;
}

/* Takes the arrays and nested objects of the mode; `grouping` is NULL from a counting pool. */
void cairn_contour_grouping_take_written(cairn_contour_grouping *grouping, cairn_pool *pool,
                                         const cairn_contour_grouping_params *params);

/* Validation of the input, and the begin of the search. */
cairn_status cairn_contour_grouping_written_check(const cairn_contour_grouping *grouping,
                                                  const cairn_contour_grouping_input *input);
void cairn_contour_grouping_written_begin(cairn_contour_grouping *grouping);

/* ---- Steps: each returns 1 when done; 0 when the budget is used up, or when `status` was set to
 * an error ---- */

/* The search. */
int cairn_contour_grouping_search_written(cairn_contour_grouping *grouping, cairn_budget *budget);

/* The phases of which it has files of their own: the tables of symmetric points and ends, the
 * resulting objects. */
int cairn_contour_grouping_written_index(cairn_contour_grouping *grouping, cairn_budget *budget);
int cairn_contour_grouping_written_finish(cairn_contour_grouping *grouping, cairn_budget *budget);

/* ---- Results ---- */

void cairn_contour_grouping_written_read(const cairn_contour_grouping *grouping,
                                         cairn_contour_grouping_result *result);

cairn_contour_grouping_particle
cairn_contour_grouping_written_particle(const cairn_contour_grouping *grouping,
                                        const cairn_particle *particle);

/* Disc of the trajectory that a state stands for. */
cairn_contour_grouping_disc
cairn_contour_grouping_written_disc(const cairn_contour_grouping *grouping,
                                    const contour_grouping_written_state *state);

/* Callbacks of the particle filter. */
cairn_particle_filter_model cairn_contour_grouping_written_model(cairn_contour_grouping *grouping);

/* Work units of one likelihood evaluation. */
int32_t cairn_contour_grouping_written_likelihood_units(const cairn_contour_grouping *grouping);

/* Log-likelihood (2.13) of a state, without the mass of its step; *sample is k of (2.12). */
cairn_real cairn_contour_grouping_written_likelihood(const cairn_contour_grouping *grouping,
                                                     const contour_grouping_written_state *state,
                                                     int32_t *sample);

/* Symmetric point of two segments, NULL: none. */
const cairn_symmetric_point *
cairn_contour_grouping_written_point(const cairn_contour_grouping *grouping, int32_t first,
                                     int32_t second);

/* Records the trajectory of a particle when it is the best of its mode. */
void cairn_contour_grouping_written_record(cairn_contour_grouping *grouping, int32_t index);

#endif
