/* host_parameters: params structs of the host library, declared once by a table, from which follow
 * _default() and validation; as src/base/object.h, for fields that are double or int64_t, too.
 * Internal to the host library.
 *
 * Limits: a table has the parameters that are numbers. What is of another type (a text, a callback,
 * a seed) is set in _default(). Numbers are compared in double. */
#ifndef CAIRN_HOST_PARAMETERS_H
#define CAIRN_HOST_PARAMETERS_H

#include <stddef.h>
#include <stdint.h>

#include "cairn/file_error.h"

/* Type of the field of a parameter. */
typedef enum cairn_host_parameter_type {
    CAIRN_HOST_PARAMETER_INT32,
    CAIRN_HOST_PARAMETER_INT64,
    CAIRN_HOST_PARAMETER_FLOAT,
    CAIRN_HOST_PARAMETER_DOUBLE
} cairn_host_parameter_type;

/* Parameter: a field of a params struct. */
typedef struct cairn_host_parameter {
    const char *field;
    /* Offset of the field. */
    size_t at;
    cairn_host_parameter_type type;
    /* 1: the lowest number does not belong to the range itself. */
    int32_t above;
    double preset, lowest, highest;
} cairn_host_parameter;

/* Table of parameters. */
typedef struct cairn_host_parameters {
    /* [count] Parameters. */
    const cairn_host_parameter *list;
    size_t count;
    /* Bytes of the params struct. */
    size_t size;
} cairn_host_parameters;

/* The table of a module, from an array of parameters of its params struct. */
#define CAIRN_HOST_PARAMETERS(params, table)                                                       \
    {                                                                                              \
        .list = (table), .count = sizeof(table) / sizeof *(table), .size = sizeof(params)          \
    }

/* Rows: the field of a params struct, its default, and its range [from, to], or (from, to]. */
#define CAIRN_HOST_ROW(params, name, is_above, is, from, to)                                       \
    {                                                                                              \
        .field = #name, .at = offsetof(params, name),                                              \
        .type = _Generic(((params *)0)->name, int32_t                                              \
                         : CAIRN_HOST_PARAMETER_INT32, int64_t                                     \
                         : CAIRN_HOST_PARAMETER_INT64, float                                       \
                         : CAIRN_HOST_PARAMETER_FLOAT, double                                      \
                         : CAIRN_HOST_PARAMETER_DOUBLE),                                           \
        .above = (is_above), .preset = (double)(is), .lowest = (double)(from),                     \
        .highest = (double)(to)                                                                    \
    }
#define CAIRN_HOST_NUMBER(params, name, is, from, to) CAIRN_HOST_ROW(params, name, 0, is, from, to)
#define CAIRN_HOST_NUMBER_ABOVE(params, name, is, from, to)                                        \
    CAIRN_HOST_ROW(params, name, 1, is, from, to)

/* Sets a params struct to its defaults; padding and fields without a row to 0. */
void cairn_host_parameters_preset(const cairn_host_parameters *table, void *params);

/* CAIRN_OK when all parameters are in range, else CAIRN_BAD_ARGUMENT, and the error names the first
 * that is not, its value and its range.
 *
 * params: NULL: CAIRN_BAD_ARGUMENT
 * path: used in the error */
CAIRN_CHECKED cairn_status cairn_host_parameters_check(const cairn_host_parameters *table,
                                                       const void *params, const char *path,
                                                       cairn_file_error *error);

#endif
