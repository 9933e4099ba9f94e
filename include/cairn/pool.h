/* pool: fixed memory supplied by the caller: a bump allocator (arena), and a pool of blocks of
 * equal size.
 *
 * All objects of cairn are allocated from a pool; the library has no other memory. The bump
 * allocator hands out aligned allocations one behind the other from one region. Objects are created
 * in the region and never freed one by one. A mark records the state of the pool; a release frees
 * all allocations since the mark. A split makes a child pool with a lifetime of its own. Under
 * AddressSanitizer every allocation is followed by a poisoned redzone, which _memory() counts.
 *
 *     init(array) -> _create() of each object ... -> steps for ever
 *     mark() -> _create() of objects for one job -> ... -> release(): all of them are gone */
#ifndef CAIRN_POOL_H
#define CAIRN_POOL_H

#include "cairn/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Alignment of allocations, in bytes. Sizes are rounded up to a multiple, on every target. */
#define CAIRN_ALIGN 16

/* Bytes of the poisoned redzone behind each allocation. */
#if defined(__SANITIZE_ADDRESS__)
#define CAIRN_POOL_REDZONE 32
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define CAIRN_POOL_REDZONE 32
#endif
#endif
#ifndef CAIRN_POOL_REDZONE
#define CAIRN_POOL_REDZONE 0
#endif

/* Bytes that an allocation of `count` elements of `size` bytes takes, rounding and redzone
 * included, as a constant expression. */
#define CAIRN_ALLOCATION_BYTES(count, size)                                                        \
    (((((size_t)(count)) * (size_t)(size) + (CAIRN_ALIGN - 1)) / CAIRN_ALIGN) * CAIRN_ALIGN +      \
     CAIRN_POOL_REDZONE)

/* ---- Bump allocator ---- */

/* Bump allocator over one region of memory. The fields are open for reading only. */
typedef struct cairn_pool {
    /* First byte of the region. NULL: a counting pool, which adds up sizes and allocates
     * nothing. */
    unsigned char *base;
    /* Bytes of the region. */
    size_t size;
    /* Bytes allocated. */
    size_t used;
    /* Largest value of `used` so far, in bytes. */
    size_t peak;
    /* Number of requests that were refused because the pool had too few bytes left. */
    uint32_t refused;
    /* Number of marks that are not yet released. */
    uint32_t marks;
} cairn_pool;

/* State of a pool, to which the pool can be released. */
typedef struct cairn_mark {
    /* Bytes allocated at the time of the mark. */
    size_t used;
    /* Number of the mark, from 1; marks are released last in, first out. */
    uint32_t index;
} cairn_mark;

/* Programs that mix the double and the float library must not link. */
#ifdef CAIRN_FLOAT
#define cairn_pool_init cairn_pool_init_float
#endif

/* Makes the `bytes` bytes at `memory` a pool. The start is rounded up and the size down to a
 * multiple of CAIRN_ALIGN: an array declared _Alignas(CAIRN_ALIGN), of _memory() bytes, loses none.
 * The memory must outlive the pool and all objects in it. CAIRN_BAD_ARGUMENT: NULL, or less than
 * CAIRN_ALIGN aligned bytes. CAIRN_BAD_BUILD: the library was compiled with contracted
 * multiply-adds or flushes subnormal numbers to zero, so its results would differ from the
 * documented ones. */
CAIRN_CHECKED cairn_status cairn_pool_init(cairn_pool *pool, void *memory, size_t bytes);

/* Makes *pool a counting pool: allocations return NULL and only their sizes are added to `used`,
 * which saturates at SIZE_MAX. _create() of an object adds its size and returns CAIRN_NO_MEMORY. */
void cairn_pool_init_counting(cairn_pool *pool);

/* Adds `need` bytes, the _memory() of a nested object, to a counting pool. A need of 0 (params that
 * _create() would refuse) counts as an overflow.
 *
 * counting: a counting pool
 * need: bytes */
void cairn_pool_count(cairn_pool *counting, size_t need);

/* Bytes that a counting pool has added up, 0 after an overflow: the value that _memory()
 * returns.
 *
 * counting: a counting pool */
size_t cairn_pool_counted(const cairn_pool *counting);

/* Allocates `count` elements of `size` bytes, not cleared. Returns NULL when too few bytes are left
 * (`refused` is incremented, nothing is allocated), and always from a counting pool. A count or
 * size of 0 gives a valid pointer that must not be dereferenced. Constant time.
 *
 * count: number of elements
 * size: bytes of an element */
void *cairn_pool_take(cairn_pool *pool, size_t count, size_t size);

/* Allocates one element of `size` bytes, as cairn_pool_take(). */
static inline void *cairn_pool_take_one(cairn_pool *pool, size_t size)
{
    return cairn_pool_take(pool, 1, size);
}

/* Bytes left in the pool. */
size_t cairn_pool_remaining(const cairn_pool *pool);

/* 1 when at least `bytes` bytes are left; else 0, and `refused` is incremented. Every _create()
 * checks with this function before its first allocation, so a failure leaves the pool as it was.
 *
 * bytes: sum of the allocations to come */
CAIRN_CHECKED int32_t cairn_pool_has_capacity(cairn_pool *pool, size_t bytes);

/* Records the state of the pool in *mark. CAIRN_BAD_ARGUMENT: NULL. Constant time.
 *
 * mark: set to the state */
CAIRN_CHECKED cairn_status cairn_pool_mark(cairn_pool *pool, cairn_mark *mark);

/* Frees all allocations since the mark. Objects and child pools made since must not be used again;
 * only AddressSanitizer notices. Marks are released last in, first out. CAIRN_BAD_ARGUMENT:
 * NULL, a later mark is not yet released, or this mark is already released. Constant time. */
CAIRN_CHECKED cairn_status cairn_pool_release(cairn_pool *pool, cairn_mark mark);

/* Allocates `bytes` bytes (rounded up to CAIRN_ALIGN, plus the redzone) from `pool` and makes them
 * a pool of their own. CAIRN_BAD_ARGUMENT: NULL, a counting pool, 0 bytes. CAIRN_NO_MEMORY.
 *
 * child: becomes the pool of the allocated bytes
 * bytes: size of the child, > 0 */
CAIRN_CHECKED cairn_status cairn_pool_split(cairn_pool *pool, cairn_pool *child, size_t bytes);

/* ---- Block pool ---- */

/* Pool of blocks of one size with a free list, for items that are allocated and freed in any
 * order. */
typedef struct cairn_block_pool cairn_block_pool;

/* Bytes for `count` blocks of `block_bytes` bytes each. 0 when either is 0, count is above
 * INT32_MAX - 1, or the sum overflows. */
size_t cairn_block_pool_memory(size_t block_bytes, size_t count);

/* Creates a block pool of free blocks. CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. Cost: linear in
 * count.
 *
 * block_bytes: bytes of a block, > 0
 * count: number of blocks, 1 ... INT32_MAX - 1 */
CAIRN_CHECKED cairn_status cairn_block_pool_create(cairn_block_pool **blocks, cairn_pool *pool,
                                                   size_t block_bytes, size_t count);

/* Allocates a block, not cleared. Returns NULL when all blocks are in use. Constant time. */
void *cairn_block_pool_take(cairn_block_pool *blocks);

/* Frees a block. CAIRN_BAD_ARGUMENT: the pointer is not a block of this pool, or the block is not
 * in use. Constant time. */
CAIRN_CHECKED cairn_status cairn_block_pool_give(cairn_block_pool *blocks, void *block);

/* Usage of a block pool, in blocks. */
typedef struct cairn_block_pool_usage {
    /* Blocks in all. */
    int32_t count;
    /* Blocks in use. */
    int32_t used;
    /* Largest value of `used` so far. */
    int32_t peak;
    /* Number of requests that were refused because all blocks were in use. */
    uint32_t refused;
} cairn_block_pool_usage;

/* Returns the usage of a block pool. */
cairn_block_pool_usage cairn_block_pool_read(const cairn_block_pool *blocks);

#ifdef __cplusplus
}
#endif

#endif
