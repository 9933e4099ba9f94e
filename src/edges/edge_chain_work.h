/* Internals of the module edge_chain, shared by edge_chain.c (object, pruning and linking) and
 * edge_chain_thin.c (thinning): pixels and their neighbours. */
#ifndef CAIRN_EDGES_EDGE_CHAIN_WORK_H
#define CAIRN_EDGES_EDGE_CHAIN_WORK_H

#include "cairn/edge_chain.h"
#include "src/base/object.h"
#include "src/base/step.h"

/* Bits of a pixel: its distance, capped, and flags. */
enum {
    EDGE_CHAIN_MAX_DISTANCE = 7,
    EDGE_CHAIN_DISTANCE_MASK = 7,
    EDGE_CHAIN_FLAG_EDGE = 8,
    EDGE_CHAIN_FLAG_QUEUED = 16,
    EDGE_CHAIN_FLAG_USED = 32
};

enum { EDGE_CHAIN_QUEUE_COUNT = 256 * (EDGE_CHAIN_MAX_DISTANCE + 1) };

/* Pixels or queues that are skipped for one work unit. */
enum { EDGE_CHAIN_SKIPPED_PER_UNIT = 16 };

typedef struct edge_chain_queue_entry {
    int32_t pixel, next; /* next: -1 at the end */
} edge_chain_queue_entry;

struct cairn_edge_chain_set {
    /* [(max_height + 2) * (max_width + 2)] */
    uint8_t *flags;
    /* [EDGE_CHAIN_QUEUE_COUNT], -1: empty */
    int32_t *head, *tail;
    /* [max_edges]; a pixel is in one queue at most */
    edge_chain_queue_entry *entries;
    /* [max_edges + 2 * max_chains + 2]: all pixels once, ends again, and those of the current
     * chain */
    cairn_edge_chain_pixel *pixels;
    /* [max_chains] */
    cairn_edge_chain *chains;
    cairn_raster_u8_view strengths;
    /* row stride of flags */
    int32_t stride;
    /* index offsets of the 8 neighbours: east, then clockwise on the screen */
    int32_t neighbour_offset[8];
    /* next pixel of the image, row by row, or next queue */
    int32_t cursor;
    union {
        /* loading and thinning: head of the free list of entries, linked by next, -1: empty; lowest
         * queue that may hold a pixel */
        struct {
            int32_t free_entry, queue;
        };
        /* chains */
        struct {
            /* sum of strengths of the chain being followed */
            int64_t strength_sum;
            /* 1: a chain is being followed, from `start` via `previous` to `current`; 1: it is a
             * loop */
            int32_t is_following, is_loop;
            int32_t start, previous, current;
            /* lines: next neighbour of the cursor's pixel to follow */
            int32_t direction;
        };
    };
    int32_t chain_count, pixel_count, edge_count, short_count;
    /* CAIRN_MORE: in work; CAIRN_OK: the result is complete; else there is none */
    cairn_status status;
    /* resume points of the extraction and of a phase */
    int32_t resume, phase_resume;
    /* work units charged for the current item */
    int32_t units_charged;
    cairn_edge_chain_params params;
};

/* ---- Pixels ---- */

static inline int32_t edge_chain_cell_count(const cairn_edge_chain_set *set)
{
    return set->stride * (set->strengths.height + 2);
}

static inline cairn_edge_chain_pixel edge_chain_pixel_of(const cairn_edge_chain_set *set,
                                                         int32_t cell)
{
    cairn_edge_chain_pixel pixel = {(int16_t)(cell % set->stride - 1),
                                    (int16_t)(cell / set->stride - 1)};

    return pixel;
}

static inline int32_t edge_chain_strength_at(const cairn_edge_chain_set *set, int32_t cell)
{
    cairn_edge_chain_pixel p = edge_chain_pixel_of(set, cell);

    return set->strengths.data[p.y * set->strengths.stride + p.x];
}

/* Bit k: neighbour k is an edge pixel. */
static inline uint32_t edge_chain_neighbours_of(const cairn_edge_chain_set *set, int32_t cell)
{
    uint32_t mask = 0;

    for (int32_t k = 0; k < 8; k++)
        if (set->flags[cell + set->neighbour_offset[k]] & EDGE_CHAIN_FLAG_EDGE)
            mask |= 1U << k;
    return mask;
}

static inline int edge_chain_has_bit(uint32_t mask, int32_t k)
{
    return ((mask >> (k & 7)) & 1U) != 0;
}

static inline int32_t edge_chain_bit_count(uint32_t mask)
{
    int32_t count = 0;

    for (; mask != 0; mask &= mask - 1)
        count++;
    return count;
}

/* ---- edge_chain_thin.c: each returns 1 when done and 0 when the budget is used up ---- */

/* Edge pixels with their distances from the background; status CAIRN_FULL: more than max_edges. */
int cairn_edge_chain_load(cairn_edge_chain_set *set, cairn_budget *budget);

/* Queues of the edge pixels. */
int cairn_edge_chain_fill_queues(cairn_edge_chain_set *set, cairn_budget *budget);

/* Thinning of the edges in the order of the queues. */
int cairn_edge_chain_thin(cairn_edge_chain_set *set, cairn_budget *budget);

#endif
