/* part_bundle: the parts of an outline, and which of them stand for the same piece of it.
 *
 * Discrete curve evolution leaves the vertices that matter; the arcs between them are the
 * outline's fragments, longer ones overlapping shorter ones. A bundle holds fragments that
 * compete: of each bundle at most one is in an image (Adluru 2008, section 5.2.1). */
#ifndef CAIRN_PART_BUNDLE_H
#define CAIRN_PART_BUNDLE_H

#include "cairn/geometry.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The most bundles and pieces, and fragments of a model. */
#define CAIRN_PART_BUNDLES   8
#define CAIRN_PART_PIECES    32
#define CAIRN_PART_FRAGMENTS 96

typedef struct cairn_part_fragment {
    /* vertices of the outline as it was given: from one to the other, on in their order */
    int32_t from, to;
    /* 0 ... bundles - 1 */
    int32_t bundle;
    /* bit i: it runs over piece i, from vertex i of the model to the next */
    uint32_t pieces;
    /* samples[first ... first + samples_each - 1] */
    int32_t first;
    /* in the unit of the outline */
    cairn_real length;
} cairn_part_fragment;

/* A model, open: valid until the builder's next begin(). */
typedef struct cairn_part_model {
    /* [fragment_count] by their first vertex, then by length; those by hand in the order of the
     * cuts. */
    const cairn_part_fragment *fragments;
    /* even ones of each fragment, with the outline's direction */
    const cairn_oriented_point *samples;
    /* [vertex_count] of the outline, in its order: where pieces begin */
    const int32_t *vertices;
    /* [vertex_count] in the unit of the outline */
    const cairn_real *piece_length;
    int32_t fragment_count, samples_each, vertex_count, bundles;
    /* of the outline */
    cairn_real length;
    /* of the outline, by length */
    cairn_vec2 centroid;
} cairn_part_model;

typedef struct cairn_part_bundle_params {
    int32_t max_points;   /* of an outline, 3 ... 4096 (256) */
    int32_t bundles;      /* 1 ... CAIRN_PART_BUNDLES (4) */
    int32_t pieces_each;  /* 1 ... 4: vertices that are left, for each bundle (2) */
    int32_t longest;      /* 1 ... 3: pieces of a fragment at most (3) */
    int32_t samples_each; /* 2 ... 64 (20) */
} cairn_part_bundle_params;

typedef struct cairn_part_builder cairn_part_builder;

/* The values in brackets above. */
cairn_part_bundle_params cairn_part_bundle_default(void);

/* 0 for params that create() would refuse. */
size_t cairn_part_bundle_memory(const cairn_part_bundle_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_part_bundle_create(cairn_part_builder **builder, cairn_pool *pool,
                                                    const cairn_part_bundle_params *params);

/* A fragment by hand. */
typedef struct cairn_part_cut {
    /* vertices of the outline, not the same */
    int32_t from, to;
    /* 0 ... CAIRN_PART_BUNDLES - 1: there are none without a fragment below the last */
    int32_t bundle;
} cairn_part_cut;

/* Starts on a closed outline, copied. cuts: [cut_count] fragments by hand, whose ends are the
 * model's vertices; NULL: by rule: the arcs of one to `longest` consecutive pieces, in the
 * bundle in whose share of the outline their middle lies; shares are counted from the model's
 * first vertex. What ran before is dropped. CAIRN_BAD_ARGUMENT: NULL, fewer than 3 points; cuts
 * that are not as said above, or no cut. CAIRN_FULL: more points than the params say, more than
 * CAIRN_PART_FRAGMENTS cuts or CAIRN_PART_PIECES vertices of them. CAIRN_NOT_FINITE: a
 * coordinate that is not finite, or beyond 1e9. CAIRN_EMPTY: an outline or a cut without length.
 * Cost: linear in points, times cuts. */
CAIRN_CHECKED cairn_status cairn_part_bundle_begin(cairn_part_builder *builder,
                                                   const cairn_vec2 *points, int32_t count,
                                                   const cairn_part_cut *cuts, int32_t cut_count);

/* Goes on. CAIRN_MORE: the budget is used up. CAIRN_OK: the model stands, or nothing was begun.
 * By rule the units of curve_evolution, and one for four of the points and three times the
 * vertices; for each fragment one for four points and samples. */
CAIRN_CHECKED cairn_status cairn_part_bundle_step(cairn_part_builder *builder,
                                                  cairn_budget *budget);

/* All zero until step() returns CAIRN_OK. */
cairn_part_model cairn_part_bundle_read(const cairn_part_builder *builder);

#ifdef __cplusplus
}
#endif

#endif
