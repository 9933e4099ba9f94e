/* shape_model: what an object looks like: the axes of its symmetry, with the radii of the discs
 * along them.
 *
 * From the outline of one object (a silhouette, a drawing) come its symmetry set, the centres of
 * all discs that touch it twice, and the longest path through it, sampled evenly: each sample is
 * a displacement from the start of the path and a radius (Adluru 2008, section 2.5). What the
 * longest path leaves out, a leg or a handle, has paths of its own, joined to it where they
 * branch off. All lengths of a model are in units of its size, the diagonal of the box about its
 * outlines. */
#ifndef CAIRN_SHAPE_MODEL_H
#define CAIRN_SHAPE_MODEL_H

#include "cairn/curve.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The most outlines and paths of a model. */
#define CAIRN_SHAPE_OUTLINES 8
#define CAIRN_SHAPE_PATHS    8
/* And of the gaps of a drawing that are kept. */
#define CAIRN_SHAPE_GAPS 8

/* One disc on a path. The frame has its origin in the middle of the box about the outlines.
 * Sides: 0 to the left of the path in image coordinates (y down) when it is walked from its
 * first sample to its last, 1 to the right. */
typedef struct cairn_shape_sample {
    cairn_vec2 centre;
    /* > 0 */
    cairn_real radius;
    /* rad, of the normals from the way to the centre: how symmetric it is there */
    cairn_real deviation;
    /* where the disc touches, with the direction of the outline in the sense of the walk */
    cairn_oriented_point side[2];
    /* of the length of all outlines, for which each side stands */
    cairn_real share[2];
} cairn_shape_sample;

typedef struct cairn_shape_path {
    /* samples[first ... first + count - 1] */
    int32_t first, count;
    /* the path that it branches off, of a lower index; -1: none */
    int32_t parent;
    /* the sample of the parent next to which it begins, -1 without a parent */
    int32_t branch;
    /* of the length of all outlines that lies on its sides */
    cairn_real share;
} cairn_shape_path;

/* A model, open: as read from a builder or from a file. Path 0 is the longest; walked from its
 * end it is a model as well. */
typedef struct cairn_shape_model {
    const cairn_shape_sample *samples; /* [sample_count] */
    const cairn_shape_path *paths;     /* [path_count] */
    /* Even samples of all outlines, each round so that its inside lies on the side of
     * cairn_vec2_left(direction). */
    const cairn_oriented_point *outline; /* [outline_count] */
    int32_t sample_count, path_count, outline_count;
    cairn_real size;   /* what 1 was in the units of the outline, > 0 */
    cairn_vec2 origin; /* and where the origin was there */
    /* Middles of gaps of the drawing, over which its outline was closed: the object goes on
     * there, as at legs. */
    cairn_vec2 gaps[CAIRN_SHAPE_GAPS];
    int32_t gap_count; /* 0 ... CAIRN_SHAPE_GAPS; a builder's model has none */
} cairn_shape_model;

/* Adluru 2008, section 2.5: D_k, the displacement of sample k of a path from its first one. */
static inline cairn_vec2 cairn_shape_displacement(const cairn_shape_model *model, int32_t path,
                                                  int32_t k)
{
    const cairn_shape_sample *first = &model->samples[model->paths[path].first];

    return cairn_vec2_sub(first[k].centre, first->centre);
}

/* CAIRN_OK: a model that can be grouped with: finite, at least one path, every path of at least
 * one sample, within samples[], its parent before it, radii and size above 0, directions of
 * length 1 (to 1e-3), shares 0 ... 1, gaps 0 ... CAIRN_SHAPE_GAPS. CAIRN_BAD_ARGUMENT,
 * CAIRN_NOT_FINITE; *fault, when not NULL, says which sample or path. Cost: linear. */
CAIRN_CHECKED cairn_status cairn_shape_model_check(const cairn_shape_model *model,
                                                   cairn_fault *fault);

/* Samples of the first of a model's outlines, 0 ... outline_count: the first sample that lies
 * more than 3 mean distances off begins another one. Cost: linear. */
int32_t cairn_shape_first_outline(const cairn_shape_model *model);

typedef struct cairn_shape_builder_params {
    /* along all outlines together, 16 ... 1024 (128) */
    int32_t points;
    /* of a path that holds all of the outline, 4 ... 256; of others in proportion, at least 3
     * (32) */
    int32_t samples;
    /* 1 ... CAIRN_SHAPE_PATHS (8); 1: the longest path only, as in the thesis */
    int32_t max_paths;
    /* rad, > 0, < pi/2: less symmetric points are no part of the symmetry set (20 degrees) */
    cairn_real max_deviation;
    /* rad, > 0: deviation that still counts as symmetric (10 degrees) */
    cairn_real sigma;
    /* 0 ... 1, of a radius: so far the outline stays off; 0: any disc (0.8) */
    cairn_real overlap;
    /* > 0 ... 1, of an outline: shorter parts get no path of their own (0.08) */
    cairn_real min_share;
} cairn_shape_builder_params;

typedef struct cairn_shape_builder cairn_shape_builder;

/* The values in brackets above. */
cairn_shape_builder_params cairn_shape_builder_default(void);

/* 0 for params that create() would refuse. Grows with the square of the points. */
size_t cairn_shape_builder_memory(const cairn_shape_builder_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_shape_builder_create(cairn_shape_builder **builder,
                                                      cairn_pool *pool,
                                                      const cairn_shape_builder_params *params);

/* Starts on the outlines of one object, in either sense of rotation; they are sampled here and
 * need not stay. CAIRN_BAD_ARGUMENT: NULL, count outside 1 ... CAIRN_SHAPE_OUTLINES, an outline
 * that is not closed. CAIRN_NOT_FINITE. CAIRN_EMPTY: an outline without area. Cost: linear in
 * the vertices. */
CAIRN_CHECKED cairn_status cairn_shape_builder_begin(cairn_shape_builder *builder,
                                                     const cairn_curve *outlines, int32_t count);

/* Goes on. CAIRN_MORE: the budget is used up. CAIRN_OK: the model stands, or nothing was begun.
 * CAIRN_EMPTY: nothing of the outlines is symmetric; given up. About points^3 / 16 units for the
 * discs, and points^2 for each path that is looked for. */
CAIRN_CHECKED cairn_status cairn_shape_builder_step(cairn_shape_builder *builder,
                                                    cairn_budget *budget);

/* All zero until step() returns CAIRN_OK; its arrays are valid until the next begin(). */
cairn_shape_model cairn_shape_builder_read(const cairn_shape_builder *builder);

#ifdef __cplusplus
}
#endif

#endif
