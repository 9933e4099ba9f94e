/* What the parts of contour_grouping's mode as written share. */
#ifndef CAIRN_CONTOUR_CONTOUR_GROUPING_WRITTEN_H
#define CAIRN_CONTOUR_CONTOUR_GROUPING_WRITTEN_H

#include "cairn/symmetric_point.h"
#include "src/contour/contour_grouping_work.h"

/* Segments that a side may be extended by, the nearest ones, and the pairs of them. */
enum { WRITTEN_CHOICE = 10, WRITTEN_PAIRS = WRITTEN_CHOICE * WRITTEN_CHOICE };

/* One state of a particle: the symmetric point, its two segments, and the open end of each. */
typedef struct grouping_written_state {
    /* px: x_t and x_1 */
    cairn_vec2 centre, start;
    cairn_real radius, deviation;
    cairn_real log_posterior;
    /* on the left and right of the walk */
    int32_t segment[2];
    /* index of the open end: twice the segment, and one more at its second end */
    int32_t end[2];
    /* 0: along the model's path, 1: from its end */
    int32_t way;
    /* k of (2.12) */
    int32_t sample;
} grouping_written_state;

/* A side of the contour so far: the first and the last end of each segment in turn. */
typedef struct written_side {
    cairn_vec2 *vertex; /* [2 * max_steps] */
    int32_t count;
} written_side;

/* A segment that a side may be extended by. */
typedef struct written_extension {
    cairn_real gap; /* px */
    int32_t open;   /* index of the end that is open then */
} written_extension;

struct grouping_written {
    cairn_symmetric_point_set *set;
    /* of all segments: 2 i and 2 i + 1 are those of segment i */
    cairn_point_grid *ends;
    /* [slots] hash of pairs of segments to symmetric points, -1: empty */
    int32_t *slot;
    /* [max_tokens] 1: an end lies about an end of a strong chain */
    uint8_t *is_start;
    /* [max_tokens] the last look that the segment was part of */
    int32_t *stamp;
    /* [max_objects * max_steps] of each place for an object */
    cairn_grouping_disc *walk;
    /* [max_objects] of each object of the result */
    int32_t *place;
    /* [max_steps] of the current particle */
    const grouping_written_state **past;
    written_side side[2];
    /* [4 * max_steps] */
    cairn_vec2 *polygon;
    /* of pairs of segments in this image */
    cairn_symmetric_point_params points;
    /* slots: a power of two; look: number of the last one */
    int32_t slots, look;
    int32_t past_count, polygon_count;
    /* 1: the masses of the starts are summed up */
    int32_t is_drawing;
    /* 1: the set has been given the segments */
    int32_t is_set;
    /* CAIRN_GROUPING_... */
    int32_t end;
    /* units of the proposal that is being paid */
    int32_t cost;
    /* starts that were drawn from */
    int32_t seeds;
    int32_t draws;
    /* 1: the filter has made a step, and its particles are looked at */
    int32_t is_keeping;
    /* px, that is searched */
    cairn_real size;
    /* of the model's path, in sizes */
    cairn_real mean_radius;
    /* of the masses of all starts, of those that were passed */
    cairn_real sum, drawn;
    cairn_real log_stop;
    cairn_random random;
};

/* An end of a segment, px: index 2 i is the first and 2 i + 1 the second end of segment i. */
static inline cairn_vec2 grouping_written_end(const cairn_grouping *grouping, int32_t end)
{
    const cairn_segment *s = &grouping->input.segments[end / 2];

    return end % 2 ? s->b : s->a;
}

/* The pool's pieces; the phases, in order; what stays in memory of (2.12) and (2.13). */
struct grouping_written *cairn_grouping_written_carve(cairn_pool *pool,
                                                      const cairn_grouping_params *params,
                                                      cairn_grouping *grouping);
cairn_status cairn_grouping_written_check(const cairn_grouping *grouping,
                                          const cairn_grouping_input *input);
void cairn_grouping_written_begin(cairn_grouping *grouping);
cairn_status cairn_grouping_written_points(cairn_grouping *grouping, cairn_budget *budget);
cairn_status cairn_grouping_written_index(cairn_grouping *grouping, cairn_budget *budget);
cairn_status cairn_grouping_written_seed(cairn_grouping *grouping, cairn_budget *budget);
cairn_status cairn_grouping_written_run_filter(cairn_grouping *grouping, cairn_budget *budget);
cairn_status cairn_grouping_written_finish(cairn_grouping *grouping, cairn_budget *budget);

void cairn_grouping_written_read(const cairn_grouping *grouping, cairn_grouping_result *result);

cairn_grouping_particle cairn_grouping_written_particle(const cairn_grouping *grouping,
                                                        const cairn_particle *particle);

/* The filter's callbacks. */
cairn_particle_model cairn_grouping_written_model(cairn_grouping *grouping);

/* Units of one likelihood. */
int32_t cairn_grouping_written_likelihood_units(const cairn_grouping *grouping);

/* The log of (2.13) of a symmetric point for a walk that started at `start`; *sample is k of
 * (2.12). */
cairn_real cairn_grouping_written_likelihood(const cairn_grouping *grouping,
                                             const grouping_written_state *s, int32_t *sample);

/* The symmetric point of two segments, NULL: there is none. */
const cairn_symmetric_point *cairn_grouping_written_point(const cairn_grouping *grouping,
                                                          int32_t first, int32_t second);

/* Keeps the walk of a particle when it is the best of its mode. */
void cairn_grouping_written_record(cairn_grouping *grouping, int32_t index);

#endif
