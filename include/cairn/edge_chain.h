/* edge_chain: edge linking. Thins an image of edge strengths to lines one pixel wide and follows
 * them as chains of pixels.
 *
 * The first step from an image to contours (Adluru 2008, section 2). Thinning keeps the strongest
 * pixels of each edge. Open ends and junctions separate the chains. Image coordinates: x to the
 * right, y down; (0, 0) is the centre of the pixel in the first column and row. */
#ifndef CAIRN_EDGE_CHAIN_H
#define CAIRN_EDGE_CHAIN_H

#include "cairn/object.h"
#include "cairn/pool.h"
#include "cairn/raster.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Pixel of a chain, px: column x, row y. */
typedef struct cairn_edge_chain_pixel {
    /* column and row, px */
    int16_t x, y;
} cairn_edge_chain_pixel;

/* The kind of a chain's end. */
typedef int32_t cairn_edge_chain_end;
enum {
    /* an open end of a line */
    CAIRN_EDGE_CHAIN_OPEN = 0,
    /* a junction of lines; its pixel belongs to the chains of all of them */
    CAIRN_EDGE_CHAIN_JUNCTION = 1,
    /* a closed chain (at both ends): the last pixel is a neighbour of the first */
    CAIRN_EDGE_CHAIN_CLOSED = 2
};

/* Chain of neighbouring edge pixels, one pixel wide. */
typedef struct cairn_edge_chain {
    /* pixels[first ... first + count - 1]; consecutive pixels are neighbours */
    int32_t first, count;
    /* kinds of the first and the last end */
    cairn_edge_chain_end from, to;
    /* mean edge strength of its pixels, 0 ... 255 */
    cairn_real strength;
} cairn_edge_chain;

/* Parameters; defaults in brackets. */
typedef struct cairn_edge_chain_params {
    /* px, 1 ... CAIRN_RASTER_MAX_SIDE (640 and 480): largest image */
    int32_t max_width, max_height;
    /* 1 ... 2^28 (100,000): capacity for edge pixels */
    int32_t max_edges;
    /* 1 ... 2^28 (10,000): capacity for chains */
    int32_t max_chains;
    /* 1 ... 255 (1): threshold; weaker pixels are not edges */
    int32_t min_strength;
    /* px, >= 2 (5): shorter chains are dropped */
    int32_t min_length;
    /* px, 0 ... 64 (3): side branches (spurs) up to this length, without the junction's pixel,
     * which thinning leaves on thick edges, are pruned before the lines are followed */
    int32_t max_spur;
} cairn_edge_chain_params;

/* Extractor of edge chains, and the chains of its last image. */
typedef struct cairn_edge_chain_set cairn_edge_chain_set;

/* Upper bound of cairn_edge_chain_memory as a constant expression. */
#define CAIRN_EDGE_CHAIN_BYTES(width, height, edges, chains)                                       \
    (384 + CAIRN_ALLOCATION_BYTES(((size_t)(width) + 2) * ((size_t)(height) + 2), 1) +             \
     CAIRN_ALLOCATION_BYTES(4096, 4) + CAIRN_ALLOCATION_BYTES(edges, 8) +                          \
     CAIRN_ALLOCATION_BYTES((size_t)(edges) + 2 * (size_t)(chains) + 2, 4) +                       \
     CAIRN_ALLOCATION_BYTES(chains, sizeof(cairn_edge_chain)))

/* Returns the default parameters. */
cairn_edge_chain_params cairn_edge_chain_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_edge_chain_check(const cairn_edge_chain_params *params,
                                                  cairn_object_fault *fault);

/* Returns the bytes that create() takes from the pool; 0 for params that create() would refuse. */
size_t cairn_edge_chain_memory(const cairn_edge_chain_params *params);

/* Creates a chain set in the pool. CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_edge_chain_create(cairn_edge_chain_set **set, cairn_pool *pool,
                                                   const cairn_edge_chain_params *params);

/* Starts on an image of edge strengths, 0 where there is no edge, and discards earlier results. The
 * image must stay valid until step() returns CAIRN_OK. CAIRN_BAD_ARGUMENT: an invalid view.
 * CAIRN_FULL: larger than max_width or max_height. Constant time.
 *
 * strengths: image of edge strengths */
CAIRN_CHECKED cairn_status cairn_edge_chain_begin(cairn_edge_chain_set *set,
                                                  cairn_raster_u8_view strengths);

/* Resumes the extraction. CAIRN_MORE: the budget is exhausted. CAIRN_OK: the chains are complete,
 * or nothing was begun. CAIRN_FULL: more edge pixels than max_edges or more chains than max_chains;
 * the extraction ends without chains. Cost: about one unit per four pixels, and twelve per edge
 * pixel. */
CAIRN_CHECKED cairn_status cairn_edge_chain_step(cairn_edge_chain_set *set, cairn_budget *budget);

/* Pixels of all chains one after another. Chains that start at an end or a junction come first,
 * ordered by the row and column of that pixel. Closed chains follow, ordered by their topmost
 * pixel. */
typedef struct cairn_edge_chain_result {
    const cairn_edge_chain *chains;       /* [chain_count] */
    const cairn_edge_chain_pixel *pixels; /* [pixel_count] */
    /* number of chains and of their pixels */
    int32_t chain_count, pixel_count;
    int32_t edge_count;  /* edge pixels of the image, before thinning */
    int32_t short_count; /* chains of at least two pixels dropped as too short */
} cairn_edge_chain_result;

/* Returns the result; empty until step() returns CAIRN_OK; the pointers are valid until the next
 * begin(). */
cairn_edge_chain_result cairn_edge_chain_read(const cairn_edge_chain_set *set);

#ifdef __cplusplus
}
#endif

#endif
