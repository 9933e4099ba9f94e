/* Objects declared once: a table of the parameters, from which follow defaults and validation, and
 * one function that allocates the arrays, from which follow the bytes and the object.
 *
 * A module has, of its own:
 *
 *     const cairn_parameters cairn_x_parameters      the table: default and range of each parameter
 *     cairn_x_check()                                ranges, and rules between parameters
 *     build()                                        object, arrays and nested objects
 *
 * and the same short functions as all others: _default() presets from the table, _memory() runs
 * build() over a counting pool, _create() admits and runs build() over the pool.
 *
 * Limits: a table has the parameters that are int32_t or cairn_real. What is of another type (a
 * seed, params of a nested object) is set in _default() and validated in _check(). */
#ifndef CAIRN_CORE_OBJECT_H
#define CAIRN_CORE_OBJECT_H

#include "cairn/object.h"
#include "cairn/pool.h"

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
    /* Offset of the field, and of an int32_t that is not 0 where the parameter is in use;
     * CAIRN_ALWAYS. */
    uint16_t at, when;
    /* CAIRN_PARAMETER_... */
    int32_t type;
    cairn_parameter_value preset, lowest, highest;
} cairn_parameter;

/* `when` of a parameter that is always in use. */
#define CAIRN_ALWAYS UINT16_MAX

/* Table of the parameters of an object. */
typedef struct cairn_parameters {
    /* Name of the module. */
    const char *module;
    const cairn_parameter *rows;
    /* Number of rows, and bytes of the params struct. */
    uint16_t count, size;
} cairn_parameters;

/* The table of `rows`, of the params struct of a type. */
#define CAIRN_PARAMETERS(module_name, params, table)                                               \
    {                                                                                              \
        .module = (module_name), .rows = (table), .count = sizeof(table) / sizeof *(table),        \
        .size = sizeof(params)                                                                     \
    }

/* Rows: the field of a params struct, its default, and its range. The second of each kind is in use
 * only where another field, an int32_t, is not 0. */
#define CAIRN_INTEGER_IF(params, name, in_use, is, from, to)                                       \
    {                                                                                              \
        .field = #name, .at = (uint16_t)offsetof(params, name), .when = (in_use),                  \
        .type = _Generic(((params *)0)->name, int32_t                                              \
                         : CAIRN_PARAMETER_INTEGER),                                               \
        .preset = {.integer = (is)}, .lowest = {.integer = (from)}, .highest = {                   \
            .integer = (to)                                                                        \
        }                                                                                          \
    }
#define CAIRN_NUMBER_ROW(params, name, in_use, kind, is, from, to)                                 \
    {                                                                                              \
        .field = #name, .at = (uint16_t)offsetof(params, name), .when = (in_use),                  \
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

/* `when`: in use where the field is not 0. */
#define CAIRN_WHEN(params, name) ((uint16_t)offsetof(params, name))

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
 * object is NULL, only its bytes. */
#define CAIRN_TAKE(object, pool, field, count)                                                     \
    do {                                                                                           \
        void *taken_ = cairn_pool_take(pool, (size_t)(count), sizeof *(object)->field);            \
                                                                                                   \
        if ((object) != NULL)                                                                      \
            (object)->field = taken_;                                                              \
    } while (0)

/* Creates a nested object by an expression that returns a status; from a counting pool, where object
 * is NULL, counts only its `bytes`. */
#define CAIRN_TAKE_BY(object, pool, bytes, creation)                                               \
    do {                                                                                           \
        if ((object) != NULL) {                                                                    \
            cairn_status made_ = (creation);                                                       \
                                                                                                   \
            CAIRN_ASSERT(made_ == CAIRN_OK);                                                       \
            (void)made_;                                                                           \
        } else {                                                                                   \
            cairn_pool_count(pool, bytes);                                                         \
        }                                                                                          \
    } while (0)

/* Creates a nested object of a module for the pointer object->field; from a counting pool, where
 * object is NULL, counts only its bytes. */
#define CAIRN_TAKE_OBJECT(object, pool, field, module, params)                                     \
    CAIRN_TAKE_BY(object, pool, cairn_##module##_memory(params),                                   \
                  cairn_##module##_create(&(object)->field, pool, params))

/* The status of _create() before the first allocation: CAIRN_BAD_ARGUMENT when a pointer is NULL or
 * `need`, the object's _memory(), is 0; CAIRN_NO_MEMORY when the pool has fewer bytes left. */
cairn_status cairn_object_admit(const void *object, cairn_pool *pool, size_t need);

#endif
