/* pool: fixed memory from the caller, and all that cairn ever has.
 *
 * A bump pool hands out aligned pieces of one block. Objects are created in it and never
 * destroyed one by one; a mark remembers a state to which the pool is later released, a split
 * makes a pool within a pool for another lifetime. Under AddressSanitizer every piece is
 * followed by a poisoned gap, which _memory() counts. */
#ifndef CAIRN_POOL_H
#define CAIRN_POOL_H

#include "cairn/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* All pieces start on such a boundary and all sizes are rounded up to it, on every target. */
#define CAIRN_ALIGN 16

/* Bytes of the poisoned gap behind each piece. */
#if defined(__SANITIZE_ADDRESS__)
#define CAIRN_POOL_GAP 32
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define CAIRN_POOL_GAP 32
#endif
#endif
#ifndef CAIRN_POOL_GAP
#define CAIRN_POOL_GAP 0
#endif

/* Upper bound of what one piece of `count` elements of `size` bytes takes, as a constant
 * expression. */
#define CAIRN_PIECE_BYTES(count, size)                                                             \
    (((((size_t)(count)) * (size_t)(size) + (CAIRN_ALIGN - 1)) / CAIRN_ALIGN) * CAIRN_ALIGN +      \
     CAIRN_POOL_GAP)

/* Open for reading: how much there is, is taken, was taken at most, and how many requests were
 * refused. */
typedef struct cairn_pool {
    unsigned char *base; /* NULL: a counting pool, which measures and hands out nothing */
    size_t size;         /* bytes */
    size_t used;
    size_t peak;
    uint32_t refused;
    uint32_t marks; /* marks that are set and not yet released */
} cairn_pool;

typedef struct cairn_mark {
    size_t used;
    uint32_t index;
} cairn_mark;

/* A mix of double and float users of one program must not link. */
#ifdef CAIRN_FLOAT
#define cairn_pool_init cairn_pool_init_float
#endif

/* Makes `bytes` bytes at `memory` a pool; the start is rounded up and the size down to CAIRN_ALIGN.
 * CAIRN_BAD_ARGUMENT: NULL, or not even one aligned unit. CAIRN_BAD_BUILD: the library runs with
 * contracted multiply-adds or flushes small numbers to zero, and would not give the results that
 * it documents. */
CAIRN_CHECKED cairn_status cairn_pool_init(cairn_pool *pool, void *memory, size_t bytes);

/* A pool that only counts: takes succeed on paper, `used` saturates at SIZE_MAX on overflow. */
void cairn_pool_init_counting(cairn_pool *pool);

/* Counts an object within the object by its _memory(); 0, which says that it would be refused,
 * counts as an overflow. */
void cairn_pool_count(cairn_pool *counting, size_t need);

/* What a _memory() says: the bytes counted, 0 after an overflow. */
size_t cairn_pool_counted(const cairn_pool *counting);

/* `count` elements of `size` bytes, not cleared; NULL when there is no room (or when the pool
 * counts), with `refused` grown and nothing taken. A count or size of 0 gives a valid pointer
 * that must not be read. */
void *cairn_pool_take(cairn_pool *pool, size_t count, size_t size);

/* One element of `size` bytes. */
static inline void *cairn_pool_take_one(cairn_pool *pool, size_t size)
{
    return cairn_pool_take(pool, 1, size);
}

/* Bytes that are left. */
size_t cairn_pool_room(const cairn_pool *pool);

/* 1 when `bytes` more would fit; else 0, counted in `refused`. What every _create() asks before
 * it takes anything, so that a failure leaves the pool as it was. */
CAIRN_CHECKED int32_t cairn_pool_has_room(cairn_pool *pool, size_t bytes);

/* Remembers the state of the pool. */
CAIRN_CHECKED cairn_status cairn_pool_mark(cairn_pool *pool, cairn_mark *mark);

/* Gives back all that was taken since the mark. Marks are released in order, the last one first;
 * CAIRN_BAD_ARGUMENT when another mark is due or the mark was released before. */
CAIRN_CHECKED cairn_status cairn_pool_release(cairn_pool *pool, cairn_mark mark);

/* Takes `bytes` bytes out of `pool` (rounded up to CAIRN_ALIGN, plus the gap) and makes them a
 * pool of their own. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_pool_split(cairn_pool *pool, cairn_pool *child, size_t bytes);

/* Blocks of one size with a free list: for things that come and go. */
typedef struct cairn_block_pool cairn_block_pool;

/* Bytes for `count` blocks of `block_bytes` each; 0 when either is 0, count is above INT32_MAX -
 * 1, or the sum overflows. */
size_t cairn_block_pool_memory(size_t block_bytes, size_t count);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_block_pool_create(cairn_block_pool **blocks, cairn_pool *pool,
                                                   size_t block_bytes, size_t count);

/* One block, not cleared, or NULL when all are in use. Constant time. */
void *cairn_block_pool_take(cairn_block_pool *blocks);

/* Gives a block back. CAIRN_BAD_ARGUMENT when it is not one of these blocks or not in use.
 * Constant time. */
CAIRN_CHECKED cairn_status cairn_block_pool_give(cairn_block_pool *blocks, void *block);

typedef struct cairn_block_pool_usage {
    int32_t count; /* blocks in all */
    int32_t used;
    int32_t peak;
    uint32_t refused;
} cairn_block_pool_usage;

cairn_block_pool_usage cairn_block_pool_read(const cairn_block_pool *blocks);

#ifdef __cplusplus
}
#endif

#endif
