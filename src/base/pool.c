/* Bump allocator (arena) and block pool.
 *
 * Method:
 * 1. A counting pool has base NULL and size SIZE_MAX. Every module allocates an object and its
 *    arrays in one function, build(). The same function, run over a counting pool, gives the
 *    object's size.
 * 2. The block pool links free blocks by index in a free list.
 *
 * Limits: no compaction; the bump allocator frees only in reverse order, by marks. */
#include "src/base/build.h"

#include <float.h>
#include <string.h>

#include "cairn/pool.h"
#include "cairn/real.h"

#if CAIRN_POOL_REDZONE > 0
void __asan_poison_memory_region(void const volatile *address, size_t size);
void __asan_unpoison_memory_region(void const volatile *address, size_t size);
#define POISON(address, size)   __asan_poison_memory_region(address, size)
#define UNPOISON(address, size) __asan_unpoison_memory_region(address, size)
#else
#define POISON(address, size)   ((void)0)
#define UNPOISON(address, size) ((void)0)
#endif

/* Sets *bytes to the bytes of an allocation with rounding and redzone. 0 when the size
 * overflows. */
static int allocation_bytes(size_t count, size_t size, size_t *bytes)
{
    if (size != 0 && count > (SIZE_MAX - CAIRN_ALIGN - CAIRN_POOL_REDZONE) / size)
        return 0;
    *bytes = CAIRN_ALLOCATION_BYTES(count, size);
    return 1;
}

/* 1 when a * b + c is not contracted and subnormal results are not flushed to zero. volatile
 * prevents constant folding. */
static int arithmetic_is_faithful(void)
{
    volatile cairn_real a = 1 + CAIRN_REAL_EPSILON;
    volatile cairn_real b = 1 - CAIRN_REAL_EPSILON;
    volatile cairn_real c = -1;
#ifdef CAIRN_FLOAT
    volatile cairn_real tiny = FLT_MIN;
#else
    volatile cairn_real tiny = DBL_MIN;
#endif
    cairn_real x = a, y = b, z = c, t = tiny;
    /* Rounded product: 0; contracted: -epsilon^2. */
    cairn_real sum = x * y + z;
    /* Subnormal, or 0 when flushed. */
    cairn_real half = t / 2;

    return sum == 0 && half > 0;
}

cairn_status cairn_pool_init(cairn_pool *pool, void *memory, size_t bytes)
{
    uintptr_t skip;

    if (pool == NULL || memory == NULL)
        return CAIRN_BAD_ARGUMENT;
    skip = (CAIRN_ALIGN - (uintptr_t)memory % CAIRN_ALIGN) % CAIRN_ALIGN;
    if (bytes < skip + CAIRN_ALIGN)
        return CAIRN_BAD_ARGUMENT;
    if (!arithmetic_is_faithful())
        return CAIRN_BAD_BUILD;

    memset(pool, 0, sizeof *pool);
    pool->base = (unsigned char *)memory + skip;
    pool->size = (bytes - skip) / CAIRN_ALIGN * CAIRN_ALIGN;
    POISON(pool->base, pool->size);
    return CAIRN_OK;
}

void cairn_pool_init_counting(cairn_pool *pool)
{
    memset(pool, 0, sizeof *pool);
    pool->size = SIZE_MAX;
}

void cairn_pool_count(cairn_pool *counting, size_t need)
{
    counting->used =
        need != 0 && need < SIZE_MAX - counting->used ? counting->used + need : SIZE_MAX;
}

size_t cairn_pool_counted(const cairn_pool *counting)
{
    return counting->used == SIZE_MAX ? 0 : counting->used;
}

void *cairn_pool_take(cairn_pool *pool, size_t count, size_t size)
{
    size_t bytes = 0;
    unsigned char *start;
    int fits = allocation_bytes(count, size, &bytes);

    if (pool->base == NULL) {
        pool->used = fits && bytes < SIZE_MAX - pool->used ? pool->used + bytes : SIZE_MAX;
        return NULL;
    }
    if (!fits || bytes > pool->size - pool->used) {
        pool->refused++;
        return NULL;
    }
    start = pool->base + pool->used;
    pool->used += bytes;
    if (pool->used > pool->peak)
        pool->peak = pool->used;
    UNPOISON(start, count * size);
    return start;
}

size_t cairn_pool_remaining(const cairn_pool *pool)
{
    return pool->size - pool->used;
}

int32_t cairn_pool_has_capacity(cairn_pool *pool, size_t bytes)
{
    if (bytes <= pool->size - pool->used)
        return 1;
    pool->refused++;
    return 0;
}

cairn_status cairn_pool_mark(cairn_pool *pool, cairn_mark *mark)
{
    if (pool == NULL || mark == NULL)
        return CAIRN_BAD_ARGUMENT;
    pool->marks++;
    mark->used = pool->used;
    mark->index = pool->marks;
    return CAIRN_OK;
}

cairn_status cairn_pool_release(cairn_pool *pool, cairn_mark mark)
{
    if (pool == NULL || mark.index == 0 || mark.index != pool->marks || mark.used > pool->used)
        return CAIRN_BAD_ARGUMENT;
    pool->marks--;
    if (pool->base != NULL)
        POISON(pool->base + mark.used, pool->used - mark.used);
    pool->used = mark.used;
    return CAIRN_OK;
}

cairn_status cairn_pool_split(cairn_pool *pool, cairn_pool *child, size_t bytes)
{
    void *memory;
    size_t rounded;

    if (pool == NULL || child == NULL || pool->base == NULL || bytes == 0)
        return CAIRN_BAD_ARGUMENT;
    rounded = bytes > SIZE_MAX - CAIRN_ALIGN
                  ? SIZE_MAX
                  : (bytes + CAIRN_ALIGN - 1) / CAIRN_ALIGN * CAIRN_ALIGN;
    memory = cairn_pool_take(pool, rounded, 1);
    if (memory == NULL)
        return CAIRN_NO_MEMORY;
    return cairn_pool_init(child, memory, rounded);
}

/* ---- Block pool ---- */

/* Values of next[i] other than the index of the next free block. A block in use is marked, so a
 * double free is detected. */
enum { FREE_LIST_END = -1, BLOCK_IN_USE = -2 };

struct cairn_block_pool {
    /* [count * stride] Memory of the blocks. */
    unsigned char *blocks;
    /* [count] Free list: index of the next free block, FREE_LIST_END or BLOCK_IN_USE. */
    int32_t *next;
    /* Bytes from a block to the next, and bytes of a block. */
    size_t stride;
    size_t block_bytes;
    /* Number of blocks. */
    int32_t count;
    /* First free block, or FREE_LIST_END. */
    int32_t free;
    /* Blocks in use, and the most so far. */
    int32_t used;
    int32_t peak;
    /* Requests that were refused. */
    uint32_t refused;
};

/* Allocates the object and its arrays; NULL from a counting pool. */
static cairn_block_pool *carve_blocks(cairn_pool *pool, size_t stride, size_t count)
{
    cairn_block_pool *blocks = cairn_pool_take_one(pool, sizeof *blocks);
    int32_t *next = cairn_pool_take(pool, count, sizeof *next);
    unsigned char *data = cairn_pool_take(pool, count, stride);

    if (blocks != NULL) {
        blocks->next = next;
        blocks->blocks = data;
    }
    return blocks;
}

/* Bytes of a block, rounded up to the alignment. */
static size_t block_stride(size_t block_bytes)
{
    return (block_bytes + CAIRN_ALIGN - 1) / CAIRN_ALIGN * CAIRN_ALIGN;
}

size_t cairn_block_pool_memory(size_t block_bytes, size_t count)
{
    cairn_pool counting;

    if (block_bytes == 0 || count == 0 || count >= INT32_MAX ||
        block_bytes > SIZE_MAX - CAIRN_ALIGN)
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve_blocks(&counting, block_stride(block_bytes), count);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_block_pool_create(cairn_block_pool **blocks, cairn_pool *pool,
                                     size_t block_bytes, size_t count)
{
    size_t need = cairn_block_pool_memory(block_bytes, count);
    cairn_block_pool *made;

    if (blocks == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_capacity(pool, need))
        return CAIRN_NO_MEMORY;
    made = carve_blocks(pool, block_stride(block_bytes), count);
    made->stride = block_stride(block_bytes);
    made->block_bytes = block_bytes;
    made->count = (int32_t)count;
    made->free = 0;
    made->used = 0;
    made->peak = 0;
    made->refused = 0;
    for (int32_t i = 0; i < made->count; i++)
        made->next[i] = i + 1 < made->count ? i + 1 : FREE_LIST_END;
    POISON(made->blocks, made->stride * count);
    *blocks = made;
    return CAIRN_OK;
}

void *cairn_block_pool_take(cairn_block_pool *blocks)
{
    int32_t index = blocks->free;
    unsigned char *block;

    if (index == FREE_LIST_END) {
        blocks->refused++;
        return NULL;
    }
    blocks->free = blocks->next[index];
    blocks->next[index] = BLOCK_IN_USE;
    blocks->used++;
    if (blocks->used > blocks->peak)
        blocks->peak = blocks->used;
    block = blocks->blocks + (size_t)index * blocks->stride;
    UNPOISON(block, blocks->block_bytes);
    return block;
}

cairn_status cairn_block_pool_give(cairn_block_pool *blocks, void *block)
{
    uintptr_t offset;
    size_t index;

    if (blocks == NULL || block == NULL || (uintptr_t)block < (uintptr_t)blocks->blocks)
        return CAIRN_BAD_ARGUMENT;
    offset = (uintptr_t)block - (uintptr_t)blocks->blocks;
    index = offset / blocks->stride;
    if (index >= (size_t)blocks->count || offset % blocks->stride != 0 ||
        blocks->next[index] != BLOCK_IN_USE)
        return CAIRN_BAD_ARGUMENT;
    blocks->next[index] = blocks->free;
    blocks->free = (int32_t)index;
    blocks->used--;
    POISON(block, blocks->stride);
    return CAIRN_OK;
}

cairn_block_pool_usage cairn_block_pool_read(const cairn_block_pool *blocks)
{
    cairn_block_pool_usage usage = {blocks->count, blocks->used, blocks->peak, blocks->refused};
    return usage;
}
