/* edge_segment: chains of edge pixels as straight segments, cut where other segments end, and
 * joined at junctions.
 *
 * The tokens of contour grouping (Adluru 2008, section 2): polylines of the chains are cut at
 * the projections of the ends of segments nearby, so that segments stay long where an image is
 * clean and become short in clutter; a short virtual segment stands where two of them meet, with
 * the mean of their directions. Image coordinates, pixels. */
#ifndef CAIRN_EDGE_SEGMENT_H
#define CAIRN_EDGE_SEGMENT_H

#include "cairn/edge_chain.h"
#include "cairn/geometry.h"
#include "cairn/neighbours.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_edge_segment {
    /* px, along the chain; a virtual one is min_piece long about the point where the two meet */
    cairn_segment line;
    /* index of its chain, -1: virtual */
    int32_t chain;
    /* indices in pixels[] of the first and last pixel that it stands for, last below first where
     * it runs over the end of a closed chain; of a virtual one: the two segments that it joins */
    int32_t first, last;
    /* that of its chain; of a virtual one the lower of the two */
    cairn_real strength;
} cairn_edge_segment;

typedef struct cairn_edge_segment_params {
    /* segments before they are cut, 1 ... 2^26 (10,000) */
    int32_t max_lines;
    /* 1 ... 2^28 (40,000) */
    int32_t max_segments;
    /* px, > 0: no pixel of a chain is farther from its polyline (1.5) */
    cairn_real tolerance;
    /* px, >= 2: no cut makes a shorter piece (4) */
    cairn_real min_piece;
    /* px, >= 0: the look-ahead; 0: mean + deviation / 2 of the lengths, at least 5 (0) */
    cairn_real look_ahead;
    /* px, >= 0: segments meet when the crossing of their lines is so near to an end of both (6);
     * 0: no virtual segments */
    cairn_real junction;
    /* rad, 0 ... pi: below this the two are nearly one and need no virtual one (20 degrees) */
    cairn_real junction_turn;
} cairn_edge_segment_params;

typedef struct cairn_edge_segment_set cairn_edge_segment_set;

/* The values in brackets above. */
cairn_edge_segment_params cairn_edge_segment_default(void);

/* 0 for params that create() would refuse. About 90 bytes a line and 48 (float 36) a segment. */
size_t cairn_edge_segment_memory(const cairn_edge_segment_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_edge_segment_create(cairn_edge_segment_set **set, cairn_pool *pool,
                                                     const cairn_edge_segment_params *params);

/* Starts on chains, which must stay until step() returns CAIRN_OK; what was found before is
 * gone. CAIRN_BAD_ARGUMENT: NULL, or negative counts. Constant time. */
CAIRN_CHECKED cairn_status cairn_edge_segment_begin(cairn_edge_segment_set *set,
                                                    const cairn_edge_chain_result *chains);

/* Goes on. CAIRN_MORE: the budget is used up. CAIRN_OK: the segments stand, or nothing was
 * begun. CAIRN_FULL: more lines or segments than the params say; CAIRN_BAD_ARGUMENT: a chain of
 * fewer than two pixels or not within pixels[]; given up, and there are none. Polylines cost
 * about a unit for every four pixels of a chain and halving of it (at worst, on a spiral, for
 * each of its segments), cuts about a unit for each end within twice the look-ahead of a line. */
CAIRN_CHECKED cairn_status cairn_edge_segment_step(cairn_edge_segment_set *set,
                                                   cairn_budget *budget);

/* Empty until step() returns CAIRN_OK; valid until the next begin(). Chain by chain, along the
 * chain; virtual ones last. */
typedef struct cairn_edge_segment_result {
    /* [count] */
    const cairn_edge_segment *segments;
    /* the last virtual_count of them are virtual */
    int32_t count, virtual_count;
    /* segments before they were cut */
    int32_t line_count;
    /* px: mean + deviation / 2 of the lengths before the cuts */
    cairn_real look_ahead;
    /* px: of the real segments, at least 5 */
    cairn_real mean_length;
} cairn_edge_segment_result;

cairn_edge_segment_result cairn_edge_segment_read(const cairn_edge_segment_set *set);

#ifdef __cplusplus
}
#endif

#endif
