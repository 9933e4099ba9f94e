/* Copies of arrays on the heap. */
#ifndef CAIRN_HOST_HEAP_COPY_H
#define CAIRN_HOST_HEAP_COPY_H

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* Returns a copy of `count` >= 0 items of `size` bytes, which the caller frees; of none a pointer
 * to be freed, too. NULL: out of memory. */
static inline void *cairn_heap_copy(const void *items, int32_t count, size_t size)
{
    void *copy = malloc(((size_t)count + 1) * size);

    if (copy != NULL && count > 0)
        memcpy(copy, items, (size_t)count * size);
    return copy;
}

#endif
