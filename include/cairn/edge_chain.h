/* edge_chain: chains of edge pixels, linked from any picture of edge strengths.
 *
 * The first step from an image to contours (Adluru 2008, section 2): edges are thinned to lines
 * one pixel wide that run along their strongest pixels, and the lines are followed; open ends
 * and junctions part them. Image coordinates: x to the right, y down, (0, 0) the middle of the
 * pixel in the first column and row. */
#ifndef CAIRN_EDGE_CHAIN_H
#define CAIRN_EDGE_CHAIN_H

#include "cairn/pool.h"
#include "cairn/raster.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_edge_pixel {
    int16_t x, y;
} cairn_edge_pixel;

/* Where a chain ends. */
typedef int32_t cairn_edge_end;
enum {
    /* the line stops */
    CAIRN_EDGE_OPEN = 0,
    /* lines meet; the pixel belongs to the chains of all of them */
    CAIRN_EDGE_JUNCTION = 1,
    /* the last pixel is a neighbour of the first: both ends of a closed chain */
    CAIRN_EDGE_CLOSED = 2
};

typedef struct cairn_edge_chain {
    /* pixels[first ... first + count - 1], each a neighbour of the one before */
    int32_t first, count;
    cairn_edge_end from, to;
    /* mean of its pixels, up to 255 */
    cairn_real strength;
} cairn_edge_chain;

typedef struct cairn_edge_chain_params {
    /* pixels, 1 ... CAIRN_RASTER_MAX_SIDE (640 and 480) */
    int32_t max_width, max_height;
    /* pixels that may be edges, 1 ... 2^28 (100,000) */
    int32_t max_edges;
    /* 1 ... 2^28 (10,000) */
    int32_t max_chains;
    /* 1 ... 255; weaker pixels are no edges (1) */
    int32_t min_strength;
    /* pixels, >= 2; shorter chains are dropped (5) */
    int32_t min_length;
    /* pixels beside the junction's, 0 ... 64: side branches up to so long, which thinning leaves
     * on thick edges, are removed before the lines are followed (3) */
    int32_t max_spur;
} cairn_edge_chain_params;

typedef struct cairn_edge_chain_set cairn_edge_chain_set;

/* Upper bound of cairn_edge_chain_memory as a constant expression. */
#define CAIRN_EDGE_CHAIN_BYTES(width, height, edges, chains)                                       \
    (384 + CAIRN_PIECE_BYTES(((size_t)(width) + 2) * ((size_t)(height) + 2), 1) +                  \
     CAIRN_PIECE_BYTES(4096, 4) + CAIRN_PIECE_BYTES(edges, 8) +                                    \
     CAIRN_PIECE_BYTES((size_t)(edges) + 2 * (size_t)(chains) + 2, 4) +                            \
     CAIRN_PIECE_BYTES(chains, sizeof(cairn_edge_chain)))

/* The values in brackets above. */
cairn_edge_chain_params cairn_edge_chain_default(void);

/* 0 for params that create() would refuse. */
size_t cairn_edge_chain_memory(const cairn_edge_chain_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_edge_chain_create(cairn_edge_chain_set **set, cairn_pool *pool,
                                                   const cairn_edge_chain_params *params);

/* Starts on a picture of edge strengths, 0 where there is no edge, which must stay until step()
 * returns CAIRN_OK; what was found before is gone. CAIRN_BAD_ARGUMENT: a bad view. CAIRN_FULL:
 * larger than max_width or max_height. Constant time. */
CAIRN_CHECKED cairn_status cairn_edge_chain_begin(cairn_edge_chain_set *set,
                                                  cairn_raster_u8_view strengths);

/* Goes on. CAIRN_MORE: the budget is used up. CAIRN_OK: the chains stand, or nothing was begun.
 * CAIRN_FULL: more edge pixels than max_edges or more chains than max_chains; given up, and
 * there are no chains. In all about a unit for every four pixels, and some twelve for each edge
 * pixel. */
CAIRN_CHECKED cairn_status cairn_edge_chain_step(cairn_edge_chain_set *set, cairn_budget *budget);

/* Empty until step() returns CAIRN_OK; valid until the next begin(). Open pointers: pixels of
 * all chains one after another. Chains that start at an end or a junction come first, by the row
 * and column of that pixel, then the closed ones by that of their topmost pixel. */
typedef struct cairn_edge_chain_result {
    const cairn_edge_chain *chains; /* [chain_count] */
    const cairn_edge_pixel *pixels; /* [pixel_count] */
    int32_t chain_count, pixel_count;
    int32_t edge_count;  /* edge pixels of the picture, before thinning */
    int32_t short_count; /* chains of at least two pixels that were dropped as too short */
} cairn_edge_chain_result;

cairn_edge_chain_result cairn_edge_chain_read(const cairn_edge_chain_set *set);

#ifdef __cplusplus
}
#endif

#endif
