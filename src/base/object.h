/* Objects declared once: a table of the parameters, from which follow defaults and validation, and
 * one function that allocates the arrays, from which follow the bytes and the object.
 *
 * A module has, of its own:
 *
 *     const cairn_parameters cairn_x_parameters      the table: default and range of each parameter
 *     cairn_x_check()                                ranges, and rules between parameters
 *     build()                                        object, arrays and nested objects
 *
 * and the same short functions as all others: _default() presets from the table, and CAIRN_OBJECT
 * defines _memory(), which runs build() over a counting pool, and _create(), which admits and runs
 * build() over the pool.
 *
 * Limits: a table has the parameters that are int32_t or cairn_real. What is of another type (a
 * seed, params of a nested object) is set in _default() and validated in _check(). */
#ifndef CAIRN_BASE_OBJECT_H
#define CAIRN_BASE_OBJECT_H

#include "cairn/object.h"
#include "cairn/pool.h"
#include "src/base/build.h"

/* ---- Parameters ---- */

/* Type of a parameter, and whether its bounds belong to the range. */
enum {
    /* int32_t, lowest ... highest. */
    CAIRN_PARAMETER_INTEGER,
    /* cairn_real: [lowest, highest], (lowest, highest], [lowest, highest), (lowest, highest). */
    CAIRN_PARAMETER_NUMBER,
    CAIRN_PARAMETER_NUMBER_ABOVE,
    CAIRN_PARAMETER_NUMBER_BELOW,
    CAIRN_PARAMETER_NUMBER_BETWEEN
};

/* Value of a parameter. */
typedef union cairn_parameter_value {
    int32_t integer;
    cairn_real number;
} cairn_parameter_value;

/* Parameter: a field of a params struct. */
typedef struct cairn_parameter {
    const char *field;
    /* Offset of the field, and of the int32_t that says whether it is in use; CAIRN_ALWAYS. In one
     * word with the next two, for flash. */
    unsigned int at : 12, when : 12;
    /* Value of that int32_t where the parameter is in use; 0: any but 0. */
    unsigned int when_is : 5;
    /* CAIRN_PARAMETER_... */
    unsigned int type : 3;
    cairn_parameter_value preset, lowest, highest;
} cairn_parameter;

/* `in_use` and `when` of a parameter that is always in use. */
#define CAIRN_ALWAYS 0xfffU

/* Table of the parameters of an object. */
typedef struct cairn_parameters {
    /* Name of the module. */
    const char *module;
    /* [count] Parameters. */
    const cairn_parameter *list;
    /* Number of parameters, and bytes of the params struct. */
    uint16_t count, size;
} cairn_parameters;

/* The table of a module, from an array of parameters of its params struct. */
#define CAIRN_PARAMETERS(module_name, params, table)                                               \
    CAIRN_PARAMETERS_FROM(module_name, params, table, 0)

/* The same from the parameter `from` of the array on. */
#define CAIRN_PARAMETERS_FROM(module_name, params, table, from)                                    \
    {                                                                                              \
        .module = (module_name), .list = (table) + (from),                                         \
        .count = sizeof(table) / sizeof *(table) - (from), .size = sizeof(params)                  \
    }

/* Rows: the field of a params struct, its default, and its range. Those with `in_use` are in use
 * only where another field, an int32_t, is not 0 (CAIRN_WHEN) or has a value (CAIRN_WHEN_IS). */
#define CAIRN_INTEGER_IF(params, name, in_use, is, from, to)                                       \
    {                                                                                              \
        .field = #name, .at = (uint32_t)offsetof(params, name) & 0xfffU, .when = (in_use)&0xfffU,  \
        .when_is = ((uint32_t)(in_use) >> 16) & 31U,                                               \
        .type = _Generic(((params *)0)->name, int32_t                                              \
                         : CAIRN_PARAMETER_INTEGER),                                               \
        .preset = {.integer = (is)}, .lowest = {.integer = (from)}, .highest = {                   \
            .integer = (to)                                                                        \
        }                                                                                          \
    }
#define CAIRN_NUMBER_ROW(params, name, in_use, kind, is, from, to)                                 \
    {                                                                                              \
        .field = #name, .at = (uint32_t)offsetof(params, name) & 0xfffU, .when = (in_use)&0xfffU,  \
        .when_is = ((uint32_t)(in_use) >> 16) & 31U,                                               \
        .type = _Generic(((params *)0)->name, cairn_real                                           \
                         : (kind)),                                                                \
        .preset = {.number = (is)}, .lowest = {.number = (from)}, .highest = {                     \
            .number = (to)                                                                         \
        }                                                                                          \
    }
#define CAIRN_INTEGER(params, name, is, from, to)                                                  \
    CAIRN_INTEGER_IF(params, name, CAIRN_ALWAYS, is, from, to)
#define CAIRN_NUMBER(params, name, is, from, to)                                                   \
    CAIRN_NUMBER_ROW(params, name, CAIRN_ALWAYS, CAIRN_PARAMETER_NUMBER, is, from, to)
#define CAIRN_NUMBER_ABOVE(params, name, is, from, to)                                             \
    CAIRN_NUMBER_ROW(params, name, CAIRN_ALWAYS, CAIRN_PARAMETER_NUMBER_ABOVE, is, from, to)
#define CAIRN_NUMBER_BELOW(params, name, is, from, to)                                             \
    CAIRN_NUMBER_ROW(params, name, CAIRN_ALWAYS, CAIRN_PARAMETER_NUMBER_BELOW, is, from, to)
#define CAIRN_NUMBER_BETWEEN(params, name, is, from, to)                                           \
    CAIRN_NUMBER_ROW(params, name, CAIRN_ALWAYS, CAIRN_PARAMETER_NUMBER_BETWEEN, is, from, to)

/* `in_use`: where the field is not 0; where it has a value, 1 ... 31. */
#define CAIRN_WHEN(params, name) ((uint32_t)offsetof(params, name))
#define CAIRN_WHEN_IS(params, name, value)                                                         \
    ((uint32_t)offsetof(params, name) | (uint32_t)(value) << 16)

/* Sets a params struct to its defaults; padding and fields without a row to 0. */
void cairn_parameters_preset(const cairn_parameters *table, void *params);

/* CAIRN_OK when all parameters are in range, else CAIRN_BAD_ARGUMENT; *fault, unless NULL, is set
 * to the first that is not. */
cairn_status cairn_parameters_check(const cairn_parameters *table, const void *params,
                                    cairn_object_fault *fault);

/* A rule between parameters: CAIRN_OK when it holds, else CAIRN_BAD_ARGUMENT and *fault, unless
 * NULL, is set. `rule`: constant text, "width_first: below width_last". */
cairn_status cairn_parameters_require(int holds, const char *module, const char *rule,
                                      cairn_object_fault *fault);

/* ---- Objects ---- */

/* Allocates an object of `size` bytes, all 0; NULL from a counting pool. */
void *cairn_object_take(cairn_pool *pool, size_t size);

/* Allocates an array of `count` elements for the pointer object->field; from a counting pool, where
 * object is NULL, only its bytes. The pool's answer is tested, not the object: by the same test
 * at every array, compilers would write build() twice. */
#define CAIRN_TAKE(object, pool, field, count)                                                     \
    CAIRN_TAKE_FIELD(object, field, cairn_pool_take(pool, (size_t)(count), sizeof *(object)->field))

/* Allocates a table of `rows` rows of `length` elements, likewise; their product may exceed
 * SIZE_MAX. */
#define CAIRN_TAKE_ROWS(object, pool, field, rows, length)                                         \
    CAIRN_TAKE_FIELD(                                                                              \
        object, field,                                                                             \
        cairn_pool_take(pool, (size_t)(rows), (size_t)(length) * sizeof *(object)->field))

/* Sets object->field to allocated memory, unless NULL. */
#define CAIRN_TAKE_FIELD(object, field, allocation)                                                \
    do {                                                                                           \
        void *taken_ = (allocation);                                                               \
                                                                                                   \
        if (taken_ != NULL) {                                                                      \
            CAIRN_ASSERT((object) != NULL);                                                        \
            (object)->field = taken_;                                                              \
        }                                                                                          \
    } while (0)

/* Creates a nested object by a call of its _create(), which adds up the size in a counting pool,
 * where `object` is NULL. */
#define CAIRN_TAKE_BY(object, creation)                                                            \
    do {                                                                                           \
        cairn_status made_ = (creation);                                                           \
                                                                                                   \
        CAIRN_ASSERT(made_ == ((object) != NULL ? CAIRN_OK : CAIRN_NO_MEMORY));                    \
        (void)made_;                                                                               \
    } while (0)

/* Address of object->field; NULL where `object` is NULL. */
#define CAIRN_FIELD(object, field) ((object) != NULL ? &(object)->field : NULL)

/* Creates a nested object of a module for the pointer object->field, likewise. */
#define CAIRN_TAKE_OBJECT(object, pool, field, module, params)                                     \
    CAIRN_TAKE_BY(object, cairn_##module##_create(CAIRN_FIELD(object, field), pool, params))

/* The status of _create() before the first allocation: CAIRN_BAD_ARGUMENT when a pointer is NULL or
 * `need`, the object's _memory(), is 0; CAIRN_NO_MEMORY when the pool has fewer bytes left, and from
 * a counting pool, to which `need` is added. */
cairn_status cairn_object_admit(const void *object, cairn_pool *pool, size_t need);

/* Defines _memory() and _create() of a module, which builds an object of type cairn_<type> by
 * build(pool, params). The declaration at the end lets a semicolon follow. */
#define CAIRN_OBJECT(module, type, build) CAIRN_OBJECT_OF(module, type, build, module)

/* The same of an object that is made by the params of another module. */
#define CAIRN_OBJECT_OF(module, type, build, params_of)                                            \
    size_t cairn_##module##_memory(const cairn_##params_of##_params *params)                       \
    {                                                                                              \
        cairn_pool counting;                                                                       \
                                                                                                   \
        if (cairn_##params_of##_check(params, NULL) != CAIRN_OK)                                   \
            return 0;                                                                              \
        cairn_pool_init_counting(&counting);                                                       \
        (void)build(&counting, params);                                                            \
        return cairn_pool_counted(&counting);                                                      \
    }                                                                                              \
    cairn_status cairn_##module##_create(cairn_##type **object, cairn_pool *pool,                  \
                                         const cairn_##params_of##_params *params)                 \
    {                                                                                              \
        cairn_status status = cairn_object_admit(object, pool, cairn_##module##_memory(params));   \
                                                                                                   \
        if (status == CAIRN_OK)                                                                    \
            *object = build(pool, params);                                                         \
        return status;                                                                             \
    }                                                                                              \
    cairn_status cairn_##module##_create(cairn_##type **object, cairn_pool *pool,                  \
                                         const cairn_##params_of##_params *params)

#endif
