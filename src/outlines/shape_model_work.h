/* Internal structures of module shape_model. */
#ifndef CAIRN_CONTOUR_SEARCH_SHAPE_MODEL_WORK_H
#define CAIRN_CONTOUR_SEARCH_SHAPE_MODEL_WORK_H

#include "cairn/shape_model.h"

/* Least number of samples of an outline and of a path. */
enum { SHAPE_MODEL_MIN_OUTLINE_SAMPLES = 16, SHAPE_MODEL_MIN_PATH_SAMPLES = 3 };

/* An arc of outline samples waiting for a path search: `count` samples from `start`; the whole
 * outline if closed. */
typedef struct shape_model_arc {
    int32_t start, count;
    int32_t is_closed;
    /* Parent path and branch sample of the resulting path. */
    int32_t parent, branch;
} shape_model_arc;

/* A pair of outline samples on a path, counted from arc.start; negative or beyond the end where
 * the arc wraps around. */
typedef struct shape_model_pair {
    int32_t low, high;
} shape_model_pair;

/* Phase of a construction (shape_model.c). */
typedef int32_t shape_model_phase;

struct cairn_shape_model_builder {
    cairn_shape_model_builder_params params;
    /* All outlines, consecutively. */
    cairn_oriented_point *outline;
    /* [outline_samples^2] Gain of each pair of the current outline; below 0: asymmetric. */
    cairn_real *gain;
    /* [3][outline_samples] Dynamic-programming values for gaps g, g - 1, g - 2. */
    cairn_real *dp_value;
    /* [outline_samples^2] Predecessor move of each cell (gap, low). */
    uint8_t *dp_move;
    /* [2 * outline_samples] Pairs of the found path, from its start. */
    shape_model_pair *path_pairs;
    cairn_shape_model_sample *samples;
    cairn_shape_model_path *paths;
    /* Waiting arcs, the longest first. */
    shape_model_arc arcs[CAIRN_SHAPE_MODEL_MAX_PATHS];
    /* First sample of each outline in outline[]. */
    int32_t outline_first[CAIRN_SHAPE_MODEL_MAX_OUTLINES + 1];
    /* Length of each outline, units of the size. */
    cairn_real outline_length[CAIRN_SHAPE_MODEL_MAX_OUTLINES];
    /* Length of all outlines, units of the size. */
    cairn_real total_length;
    /* Size and origin of the model in the units of the input outline. */
    cairn_real size;
    cairn_vec2 origin;
    int32_t outline_count, sample_count, path_count, arc_count, path_pair_count;
    /* The current outline. */
    int32_t outline_index;
    /* PAIRS: pair index; SEARCH: cell index of (gap, low). */
    int32_t cursor;
    /* SEARCH: gap and low of the best path end so far. */
    int32_t best_end[2];
    /* Value of the best path so far. */
    cairn_real best_value;
    shape_model_phase phase;
    /* Work units charged for the next work item. */
    int32_t units_charged;
};

/* Returns the number of samples of the current outline. */
static inline int32_t shape_model_points(const cairn_shape_model_builder *builder)
{
    return builder->outline_first[builder->outline_index + 1] -
           builder->outline_first[builder->outline_index];
}

/* Returns the index in outline[] of position `i` of an arc. */
static inline int32_t shape_model_point(const cairn_shape_model_builder *builder,
                                        const shape_model_arc *arc, int32_t i)
{
    int32_t n = shape_model_points(builder), at = (arc->start + i) % n;

    return builder->outline_first[builder->outline_index] + (at < 0 ? at + n : at);
}

/* Returns the greatest number of samples of all paths. */
int32_t cairn_shape_model_max_samples(const cairn_shape_model_builder_params *params);

/* Computes the disc of two samples, contact 1 at `low`; returns 0 if it does not exist or is not
 * inside. */
int cairn_shape_model_disc(const cairn_shape_model_builder *builder, int32_t low, int32_t high,
                           cairn_shape_model_sample *disc);

/* Returns the gain of pair (low, high), indices in outline[]. */
cairn_real cairn_shape_model_gain(const cairn_shape_model_builder *builder, int32_t low,
                                  int32_t high);

/* Searches the longest path of an arc into path_pairs[]: begin, then step until it does not
 * return CAIRN_MORE. */
void cairn_shape_model_search_begin(cairn_shape_model_builder *builder);
cairn_status cairn_shape_model_search_step(cairn_shape_model_builder *builder,
                                           const shape_model_arc *arc, cairn_budget *budget);

/* Resamples path_pairs[] to a path and adds arcs of the remaining outline. */
void cairn_shape_model_add_path(cairn_shape_model_builder *builder, const shape_model_arc *arc);

/* Inserts a waiting arc, the longest first; without capacity the shortest is dropped. */
void cairn_shape_model_add_arc(cairn_shape_model_builder *builder, shape_model_arc arc);

#endif
