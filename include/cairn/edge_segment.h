/* edge_segment: scale-adaptive edge segments: polylines of edge chains, cut at the ends of other
 * segments and joined at junctions.
 *
 * The tokens of contour grouping (Adluru 2008, section 2). The polylines of the chains are cut at
 * the projections of the ends of nearby segments. Segments stay long where an image is clean and
 * become short in clutter. Where two segments meet, a short virtual segment is added with the mean
 * of their directions. Image coordinates, pixels. */
#ifndef CAIRN_EDGE_SEGMENT_H
#define CAIRN_EDGE_SEGMENT_H

#include "cairn/edge_chain.h"
#include "cairn/geometry.h"
#include "cairn/neighbours.h"
#include "cairn/object.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Straight piece of a contour, or a virtual segment at a junction. */
typedef struct cairn_edge_segment {
    /* px, directed along the chain; a virtual segment has the length min_piece and is centred on
     * the junction */
    cairn_segment line;
    /* index of its chain, -1: virtual */
    int32_t chain;
    /* indices in pixels[] of its first and last pixel; last is below first when it crosses the end
     * of a closed chain. Virtual segment: indices of the two joined segments */
    int32_t first, last;
    /* strength of its chain, 0 ... 255; virtual segment: the lower of the two */
    cairn_real strength;
} cairn_edge_segment;

/* Parameters; defaults in brackets. */
typedef struct cairn_edge_segment_params {
    /* 1 ... 2^26 (10,000): capacity for polyline segments before cutting */
    int32_t max_lines;
    /* 1 ... 2^28 (40,000): capacity for segments */
    int32_t max_segments;
    /* px, > 0 (1.5): greatest distance of a chain's pixel from its polyline */
    cairn_real tolerance;
    /* px, >= 2 (4): least length of a piece after a cut */
    cairn_real min_piece;
    /* px, >= 0 (0): look-ahead L; 0: mean + half the standard deviation of the lengths, at least
     * 5 */
    cairn_real look_ahead;
    /* px, >= 0 (6): two segments form a junction when the crossing of their lines is within this
     * distance of an end of both; 0: no virtual segments */
    cairn_real junction_distance;
    /* rad, 0 ... pi (20 degrees): least turning angle of a junction; flatter ones get no virtual
     * segment */
    cairn_real min_junction_angle;
} cairn_edge_segment_params;

/* Extractor of edge segments, and the segments of its last image. */
typedef struct cairn_edge_segment_set cairn_edge_segment_set;

/* Returns the default parameters. */
cairn_edge_segment_params cairn_edge_segment_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_edge_segment_check(const cairn_edge_segment_params *params,
                                                    cairn_object_fault *fault);

/* Returns the bytes that create() takes from the pool, about 90 per line and 48 (float 36) per
 * segment; 0 for params that create() would refuse. */
size_t cairn_edge_segment_memory(const cairn_edge_segment_params *params);

/* Creates a segment set in the pool. CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_edge_segment_create(cairn_edge_segment_set **set, cairn_pool *pool,
                                                     const cairn_edge_segment_params *params);

/* Starts on a set of chains and discards earlier results. The chains must stay valid until step()
 * returns CAIRN_OK. CAIRN_BAD_ARGUMENT: NULL, or negative counts. Constant time.
 *
 * chains: chains of an image */
CAIRN_CHECKED cairn_status cairn_edge_segment_begin(cairn_edge_segment_set *set,
                                                    const cairn_edge_chain_result *chains);

/* Resumes the segmentation. CAIRN_MORE: the budget is exhausted. CAIRN_OK: the segments are
 * complete, or nothing was begun. CAIRN_FULL: more lines or segments than the capacities.
 * CAIRN_BAD_ARGUMENT: a chain of fewer than two pixels or not within pixels[]. Both errors end the
 * run without segments. Cost: polylines take about one unit per four pixels of a chain and level of
 * bisection (in the worst case, a spiral, per segment); cuts take about one unit per segment end
 * within twice the look-ahead of a line. */
CAIRN_CHECKED cairn_status cairn_edge_segment_step(cairn_edge_segment_set *set,
                                                   cairn_budget *budget);

/* Segments chain by chain, along the chain; virtual segments last. */
typedef struct cairn_edge_segment_result {
    /* [count] */
    const cairn_edge_segment *segments;
    /* number of segments; the last virtual_count of them are virtual */
    int32_t count, virtual_count;
    /* polyline segments before cutting */
    int32_t line_count;
    /* px: look-ahead L, mean + half the standard deviation of the lengths before cutting */
    cairn_real look_ahead;
    /* px: mean length of the non-virtual segments, at least 5 */
    cairn_real mean_length;
} cairn_edge_segment_result;

/* Returns the result; empty until step() returns CAIRN_OK; valid until the next begin(). */
cairn_edge_segment_result cairn_edge_segment_read(const cairn_edge_segment_set *set);

#ifdef __cplusplus
}
#endif

#endif
