/* Internal structures of module shape_model. */
#ifndef CAIRN_OUTLINES_SHAPE_MODEL_WORK_H
#define CAIRN_OUTLINES_SHAPE_MODEL_WORK_H

#include "cairn/shape_model.h"
#include "src/base/object.h"
#include "src/base/step.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_shape_model_builder_parameters;

/* Least number of samples of an outline and of a path. */
enum { SHAPE_MODEL_MIN_OUTLINE_SAMPLES = 16, SHAPE_MODEL_MIN_PATH_SAMPLES = 3 };

/* Gain of a pair of samples without a symmetric point, per length. */
#define SHAPE_MODEL_ASYMMETRIC_GAIN CAIRN_REAL(-0.3)

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
    /* The current outline; outline_count: none is left. */
    int32_t outline_index;
    /* Resume points of the whole and of the search; units charged for the next operation. */
    int32_t resume, search_resume, units_charged;
    /* Pair of samples of the current outline; cell of the search. */
    int32_t low;
    union {
        int32_t high, gap;
    };
    /* Search: gap and low of the best path end so far, and its value. */
    int32_t best_gap, best_low;
    cairn_real best_value;
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

/* Returns the greatest number of samples of all paths: they share an outline, and each has a least
 * number of samples. */
static inline int32_t shape_model_max_samples(const cairn_shape_model_builder_params *params)
{
    return params->path_samples + CAIRN_SHAPE_MODEL_MAX_PATHS * (SHAPE_MODEL_MIN_PATH_SAMPLES + 1);
}

/* Computes the disc of two samples, contact 1 at `low`; returns 0 if it does not exist or is not
 * inside. */
int cairn_shape_model_disc(const cairn_shape_model_builder *builder, int32_t low, int32_t high,
                           cairn_shape_model_sample *disc);

/* Returns the gain of pair (low, high), indices in outline[]. */
cairn_real cairn_shape_model_gain(const cairn_shape_model_builder *builder, int32_t low,
                                  int32_t high);

/* Inserts a waiting arc, the longest first; without capacity the shortest is dropped. */
void cairn_shape_model_add_arc(cairn_shape_model_builder *builder, shape_model_arc arc);

/* Searches the longest path of the longest waiting arc into path_pairs[]; 0: the budget is used
 * up. */
int cairn_shape_model_search(cairn_shape_model_builder *builder, cairn_budget *budget);

/* Removes the longest waiting arc, resamples path_pairs[] to its path, and adds arcs of the
 * remaining outline. */
void cairn_shape_model_add_path(cairn_shape_model_builder *builder);

#endif
