/* Table of all objects that allocate from a pool, with the capacities that determine their size.
 * For tools/pool_formulas.c, tests/test_memory.c and tests/test_object.c. */
#ifndef CAIRN_TOOLS_POOL_OBJECTS_H
#define CAIRN_TOOLS_POOL_OBJECTS_H

#include <stddef.h>
#include <stdint.h>

#include "src/base/object.h"

/* POOL_PARAMS_BYTES: capacity for the params of any object. */
enum { POOL_CAPACITIES = 8, POOL_PARAMS_BYTES = 4096 };

typedef struct pool_capacity {
    const char *name, *field;
    size_t offset; /* of an int32_t in the params */
} pool_capacity;

typedef struct pool_object {
    const char *name;
    void (*set_default)(void *params);
    size_t (*memory)(const void *params); /* 0: create() would refuse the params */
    int32_t
        linear; /* number of leading capacities in which memory is linear, between 1024 and 2048 */
    pool_capacity capacities[POOL_CAPACITIES]; /* terminated by an entry without a name */
    const cairn_parameters *parameters;        /* NULL: declared elsewhere */
    cairn_status (*check)(const void *params, cairn_object_fault *fault);
    /* has_object 0: without a pointer to the object */
    cairn_status (*create)(cairn_pool *pool, const void *params, int has_object);
} pool_object;

/* Terminated by an entry without a name. */
extern const pool_object pool_objects[];

/* Returns the bytes at the default params with the first `count` capacities set to values; 0:
 * params rejected. */
size_t pool_object_bytes(const pool_object *object, const int32_t *values, int32_t count);

/* Returns the default of a capacity. */
int32_t pool_object_default(const pool_object *object, int32_t capacity);

#endif
