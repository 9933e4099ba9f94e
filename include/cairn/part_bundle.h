/* part_bundle: decomposition of a model outline into overlapping fragments, grouped into part
 * bundles.
 *
 * Discrete curve evolution (DCE) selects the outline's significant vertices. The arcs between two
 * vertices are the fragments; longer fragments overlap shorter ones. A bundle holds competing
 * fragments: at most one fragment of each bundle is used in an image (Adluru 2008, section
 * 5.2.1). */
#ifndef CAIRN_PART_BUNDLE_H
#define CAIRN_PART_BUNDLE_H

#include "cairn/geometry.h"
#include "cairn/object.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Greatest numbers of bundles, pieces (arcs between consecutive vertices) and fragments of a
 * model. */
#define CAIRN_PART_MAX_BUNDLES   8
#define CAIRN_PART_MAX_PIECES    32
#define CAIRN_PART_MAX_FRAGMENTS 96

/* Fragment of a model's outline. */
typedef struct cairn_part_bundle_fragment {
    /* vertex indices of the input outline: the fragment runs from one to the other in outline
     * order */
    int32_t from, to;
    /* 0 ... bundles - 1 */
    int32_t bundle;
    /* bit i: the fragment covers piece i, from vertex i of the model to the next */
    uint32_t pieces;
    /* its samples: samples[first ... first + samples_each - 1] */
    int32_t first;
    /* arc length in the unit of the outline */
    cairn_real length;
} cairn_part_bundle_fragment;

/* A part model; its arrays are valid until the builder's next begin(). */
typedef struct cairn_part_bundle_model {
    /* [fragment_count] ordered by first vertex, then by length; manual fragments in the order of
     * the cuts. */
    const cairn_part_bundle_fragment *fragments;
    /* [fragment_count * samples_each] evenly spaced samples of each fragment, with the outline's
     * tangent direction */
    const cairn_oriented_point *samples;
    /* [vertex_count] outline vertices where the pieces begin, in outline order */
    const int32_t *vertices;
    /* [vertex_count] arc length of each piece in the unit of the outline */
    const cairn_real *piece_length;
    /* number of fragments, samples of each, vertices and bundles */
    int32_t fragment_count, samples_each, vertex_count, bundle_count;
    /* arc length of the outline */
    cairn_real length;
    /* length-weighted centroid of the outline */
    cairn_vec2 centroid;
} cairn_part_bundle_model;

/* Parameters; defaults in brackets. */
typedef struct cairn_part_bundle_params {
    /* 3 ... 4096 (256): capacity for outline points */
    int32_t max_points;
    /* 1 ... CAIRN_PART_MAX_BUNDLES (4): number of bundles */
    int32_t bundles;
    /* 1 ... 4 (2): DCE vertices per bundle */
    int32_t pieces_each;
    /* 1 ... 3 (3): greatest number of pieces of a fragment */
    int32_t max_pieces;
    /* 2 ... 64 (20): samples of each fragment */
    int32_t samples_each;
} cairn_part_bundle_params;

/* Builder of part bundles. */
typedef struct cairn_part_bundle_builder cairn_part_bundle_builder;

/* Returns the default parameters. */
cairn_part_bundle_params cairn_part_bundle_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_part_bundle_check(const cairn_part_bundle_params *params,
                                                   cairn_object_fault *fault);

/* Returns the bytes that create() takes from the pool; 0 for params that create() would refuse. */
size_t cairn_part_bundle_memory(const cairn_part_bundle_params *params);

/* Creates a builder in the pool. CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_part_bundle_create(cairn_part_bundle_builder **builder,
                                                    cairn_pool *pool,
                                                    const cairn_part_bundle_params *params);

/* A manually chosen fragment. */
typedef struct cairn_part_bundle_cut {
    /* two different vertex indices of the outline */
    int32_t from, to;
    /* 0 ... CAIRN_PART_MAX_BUNDLES - 1; every bundle below the greatest index has a fragment */
    int32_t bundle;
} cairn_part_bundle_cut;

/* Starts on a closed outline, which is copied, and discards the previous run. cuts: [cut_count]
 * manually chosen fragments, whose ends are the model's vertices. NULL: fragments by rule, all arcs
 * of one to max_pieces consecutive pieces. Such a fragment belongs to the bundle whose share of the
 * outline's length contains its midpoint; the shares are equal and start at the model's first
 * vertex. CAIRN_BAD_ARGUMENT: NULL, fewer than 3 points, invalid cuts or none. CAIRN_FULL: more
 * points than max_points, more than CAIRN_PART_MAX_FRAGMENTS cuts or CAIRN_PART_MAX_PIECES vertices
 * of cuts. CAIRN_NOT_FINITE: a coordinate that is not finite, or beyond 1e9. CAIRN_EMPTY: an
 * outline or a cut of zero length. Cost: linear in points, times cuts.
 *
 * points: [count] vertices of the outline */
CAIRN_CHECKED cairn_status cairn_part_bundle_begin(cairn_part_bundle_builder *builder,
                                                   const cairn_vec2 *points, int32_t count,
                                                   const cairn_part_bundle_cut *cuts,
                                                   int32_t cut_count);

/* Resumes the construction. CAIRN_MORE: the budget is exhausted. CAIRN_OK: the model is complete,
 * or nothing was begun. Cost by rule: the units of curve_evolution, and one per four points plus
 * three times the vertices; per fragment one per four points and samples. */
CAIRN_CHECKED cairn_status cairn_part_bundle_step(cairn_part_bundle_builder *builder,
                                                  cairn_budget *budget);

/* Returns the model; all zero until step() returns CAIRN_OK. */
cairn_part_bundle_model cairn_part_bundle_read(const cairn_part_bundle_builder *builder);

#ifdef __cplusplus
}
#endif

#endif
