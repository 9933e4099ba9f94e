/* shape_model: symmetry-set model of an object's shape: paths in its symmetry set, with the radii
 * of their bitangent discs.
 *
 * Method:
 * 1. Input is the outline of one object (a silhouette or a drawing).
 * 2. The symmetry set is the set of centres of all bitangent discs.
 * 3. The longest path through the symmetry set is sampled evenly. Each sample is a displacement
 *    from the start of the path and a radius (Adluru 2008, section 2.5).
 * 4. Each remaining limb, such as a leg or a handle, has a path of its own, joined to its parent
 *    path at the branch point.
 *
 * All lengths of a model are in units of its size, the diagonal of the bounding box of its
 * outlines.
 *
 * The medial axis is the subset of the symmetry set whose discs are maximal, that is within the
 * shape. Discs of a model need not be: min_clearance sets how far the outline may enter them.
 *
 * Limits: the outlines of an object are processed independently; a hole is treated like another
 * outline, with its interior as object. */
#ifndef CAIRN_SHAPE_MODEL_H
#define CAIRN_SHAPE_MODEL_H

#include "cairn/curve.h"
#include "cairn/object.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Greatest numbers of outlines and paths of a model. */
#define CAIRN_SHAPE_MODEL_MAX_OUTLINES 8
#define CAIRN_SHAPE_MODEL_MAX_PATHS    8
/* Greatest number of stored gaps of a drawing. */
#define CAIRN_SHAPE_MODEL_MAX_GAPS 8

/* One bitangent disc on a path. The origin of the frame is the centre of the bounding box of the
 * outlines. Contact 0 lies to the left of the path from its first to its last sample as the image
 * is seen (y down), contact 1 to the right. */
typedef struct cairn_shape_model_sample {
    /* Centre of the disc, units of the size. */
    cairn_vec2 centre;
    /* Radius, units of the size, > 0. */
    cairn_real radius;
    /* Symmetry error: angle between the outline's normals and the vector to the centre, rad. */
    cairn_real deviation;
    /* Contact points of the disc, with the direction of the outline in the walking direction. */
    cairn_oriented_point contact[2];
    /* Share of the length of all outlines that each contact point represents. */
    cairn_real outline_share[2];
} cairn_shape_model_sample;

/* A path of the skeleton: consecutive samples. */
typedef struct cairn_shape_model_path {
    /* samples[first ... first + count - 1] */
    int32_t first, count;
    /* Index of the parent path, lower than its own; -1: none. */
    int32_t parent;
    /* Sample of the parent at the branch point; -1 without a parent. */
    int32_t branch;
    /* Share of the length of all outlines on the path's two sides. */
    cairn_real outline_share;
} cairn_shape_model_path;

/* A read-only view of a model, from a builder or a file. Path 0 is the longest; its reversal is
 * a model as well. */
typedef struct cairn_shape_model {
    const cairn_shape_model_sample *samples; /* [sample_count] */
    const cairn_shape_model_path *paths;     /* [path_count] */
    /* Equidistant samples of all outlines, each oriented with its interior on the side of
     * cairn_vec2_left_perp(direction): to the right as the image is seen (y down). */
    const cairn_oriented_point *outline; /* [outline_count] */
    /* number of samples, of paths and of outline samples */
    int32_t sample_count, path_count, outline_count;
    cairn_real size;   /* Size of the model in the units of the input outline, > 0. */
    cairn_vec2 origin; /* Origin of the model's frame in the units of the input outline. */
    /* Centres of gaps of the drawing, over which its outline was closed. The object may continue
     * there, as at legs. */
    cairn_vec2 gaps[CAIRN_SHAPE_MODEL_MAX_GAPS];
    int32_t gap_count; /* 0 ... CAIRN_SHAPE_MODEL_MAX_GAPS; 0 in a builder's model. */
} cairn_shape_model;

/* Returns D_k, the displacement of sample k of a path from its first sample (Adluru 2008,
 * section 2.5).
 *
 * model: valid model
 * path, k: indices from 0, within the model */
static inline cairn_vec2 cairn_shape_model_displacement(const cairn_shape_model *model,
                                                        int32_t path, int32_t k)
{
    const cairn_shape_model_sample *first = &model->samples[model->paths[path].first];

    return cairn_vec2_sub(first[k].centre, first->centre);
}

/* Validates a model. CAIRN_OK: finite, at least one path, every path of at least one sample,
 * within samples[], its parent before it, radii and size above 0, directions of length 1 (to
 * 1e-3), shares 0 ... 1, gaps 0 ... CAIRN_SHAPE_MODEL_MAX_GAPS. CAIRN_BAD_ARGUMENT,
 * CAIRN_NOT_FINITE: *fault, if not NULL, names the sample or path. Cost: linear. */
CAIRN_CHECKED cairn_status cairn_shape_model_check(const cairn_shape_model *model,
                                                   cairn_fault *fault);

/* Returns the number of samples of a model's first outline, 0 ... outline_count. The first step
 * longer than 3 mean steps begins another outline. Cost: linear.
 *
 * model: a model */
int32_t cairn_shape_model_first_outline(const cairn_shape_model *model);

/* Mirrors a valid model about the vertical axis of its frame. The order of the outline's samples is
 * reversed, so that the interior stays on the same side. The paths are shared. Cost: linear.
 *
 * model: a model
 * samples: [sample_count] set to the mirrored samples; may be the model's own
 * outline: [outline_count] set to the mirrored outline; may be the model's own
 * mirrored: set to a view of the mirrored model; may be the model itself */
void cairn_shape_model_mirror(const cairn_shape_model *model, cairn_shape_model_sample *samples,
                              cairn_oriented_point *outline, cairn_shape_model *mirrored);

/* Parameters; defaults in brackets. */
typedef struct cairn_shape_model_builder_params {
    /* 16 ... 1024 (128): samples along all outlines together */
    int32_t outline_samples;
    /* 4 ... 256 (32): samples of a path that covers the whole outline; other paths in proportion,
     * at least 3 */
    int32_t path_samples;
    /* 1 ... CAIRN_SHAPE_MODEL_MAX_PATHS (8): greatest number of paths; 1: the longest path only, as
     * in the thesis */
    int32_t max_paths;
    /* rad, > 0, < pi/2 (20 degrees): greatest symmetry error of a symmetric point of the symmetry
     * set */
    cairn_real max_deviation;
    /* rad, > 0 (10 degrees): standard deviation of the symmetry error */
    cairn_real deviation_sigma;
    /* share of the radius, 0 ... 1 (0.8): least distance of the outline to a disc's centre; 0: any
     * disc */
    cairn_real min_clearance;
    /* > 0, <= 1 (0.08): least share of an outline for a path of its own */
    cairn_real min_outline_share;
} cairn_shape_model_builder_params;

/* Builder of a shape model from outlines. */
typedef struct cairn_shape_model_builder cairn_shape_model_builder;

/* Returns the default parameters. */
cairn_shape_model_builder_params cairn_shape_model_builder_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_shape_model_builder_check(
    const cairn_shape_model_builder_params *params, cairn_object_fault *fault);

/* Returns the memory of a builder in bytes; 0 for params that create() rejects. Grows with the
 * square of the samples. */
size_t cairn_shape_model_builder_memory(const cairn_shape_model_builder_params *params);

/* Creates a builder. CAIRN_BAD_ARGUMENT: invalid params. CAIRN_NO_MEMORY: the pool is too small. */
CAIRN_CHECKED cairn_status
cairn_shape_model_builder_create(cairn_shape_model_builder **builder, cairn_pool *pool,
                                 const cairn_shape_model_builder_params *params);

/* Starts on the outlines of one object, in either orientation. They are sampled here and may be
 * freed afterwards. CAIRN_BAD_ARGUMENT: NULL, count outside 1 ...
 * CAIRN_SHAPE_MODEL_MAX_OUTLINES, an open outline. CAIRN_NOT_FINITE. CAIRN_EMPTY: an outline
 * without area. Cost: linear in the vertices.
 *
 * outlines: [count] closed outlines */
CAIRN_CHECKED cairn_status cairn_shape_model_builder_begin(cairn_shape_model_builder *builder,
                                                           const cairn_curve *outlines,
                                                           int32_t count);

/* Resumes the computation. CAIRN_MORE: the budget is used up. CAIRN_OK: the model is complete,
 * or nothing was begun. CAIRN_EMPTY: no symmetric point; aborted. Cost: about outline_samples^3
 * / 16 units for the discs, and outline_samples^2 for each path search. */
CAIRN_CHECKED cairn_status cairn_shape_model_builder_step(cairn_shape_model_builder *builder,
                                                          cairn_budget *budget);

/* Returns the model. All zero until step() returns CAIRN_OK; its arrays are valid until the next
 * begin(). */
cairn_shape_model cairn_shape_model_builder_read(const cairn_shape_model_builder *builder);

#ifdef __cplusplus
}
#endif

#endif
