/* What takes memory of a pool, and the capacities that say how much: for tools/pool_formulas.c
 * and tests/test_memory.c. */
#ifndef CAIRN_TOOLS_POOL_OBJECTS_H
#define CAIRN_TOOLS_POOL_OBJECTS_H

#include <stddef.h>
#include <stdint.h>

enum { POOL_CAPACITIES = 8 };

typedef struct pool_capacity {
    const char *name, *field;
    size_t offset; /* of an int32_t in the params */
} pool_capacity;

typedef struct pool_object {
    const char *name;
    void (*set_default)(void *params);
    size_t (*memory)(const void *params); /* 0: create() would refuse the params */
    int32_t linear; /* memory is linear in so many of the first capacities, between 1024 and 2048 */
    pool_capacity capacities[POOL_CAPACITIES]; /* up to the first without a name */
} pool_object;

/* Up to the first without a name. */
extern const pool_object pool_objects[];

/* Bytes at the default with `count` capacities set to values; 0: refused. */
size_t pool_object_bytes(const pool_object *object, const int32_t *values, int32_t count);

/* The default of a capacity. */
int32_t pool_object_default(const pool_object *object, int32_t capacity);

#endif
