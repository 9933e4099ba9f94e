/* Tables of parameters of the host library: defaults and validation. */
#include "src/base/build.h"

#include <string.h>

#include "src/host/base/host_parameters.h"

static void set_value(void *params, const cairn_host_parameter *row)
{
    void *field = (unsigned char *)params + row->at;
    int32_t whole;
    int64_t long_whole;
    float single;

    switch (row->type) {
    case CAIRN_HOST_PARAMETER_INT32:
        whole = (int32_t)row->preset;
        memcpy(field, &whole, sizeof whole);
        break;
    case CAIRN_HOST_PARAMETER_INT64:
        long_whole = (int64_t)row->preset;
        memcpy(field, &long_whole, sizeof long_whole);
        break;
    case CAIRN_HOST_PARAMETER_FLOAT:
        single = (float)row->preset;
        memcpy(field, &single, sizeof single);
        break;
    case CAIRN_HOST_PARAMETER_DOUBLE:
        memcpy(field, &row->preset, sizeof row->preset);
        break;
    }
}

static double value_of(const void *params, const cairn_host_parameter *row)
{
    const void *field = (const unsigned char *)params + row->at;
    int32_t whole;
    int64_t long_whole;
    float single;
    double number = 0;

    switch (row->type) {
    case CAIRN_HOST_PARAMETER_INT32:
        memcpy(&whole, field, sizeof whole);
        return whole;
    case CAIRN_HOST_PARAMETER_INT64:
        memcpy(&long_whole, field, sizeof long_whole);
        return (double)long_whole;
    case CAIRN_HOST_PARAMETER_FLOAT:
        memcpy(&single, field, sizeof single);
        return (double)single;
    case CAIRN_HOST_PARAMETER_DOUBLE:
        memcpy(&number, field, sizeof number);
        break;
    }
    return number;
}

void cairn_host_parameters_preset(const cairn_host_parameters *table, void *params)
{
    memset(params, 0, table->size);
    for (size_t i = 0; i < table->count; i++)
        set_value(params, &table->list[i]);
}

static int is_integer(const cairn_host_parameter *row)
{
    return row->type == CAIRN_HOST_PARAMETER_INT32 || row->type == CAIRN_HOST_PARAMETER_INT64;
}

/* 1 when a value is in the range of a parameter; a NaN never is. */
static int is_in_range(const cairn_host_parameter *row, double value)
{
    return (row->above ? value > row->lowest : value >= row->lowest) && value <= row->highest;
}

cairn_status cairn_host_parameters_check(const cairn_host_parameters *table, const void *params,
                                         const char *path, cairn_file_error *error)
{
    if (params == NULL)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "no parameters, expected those of _default()");
    for (size_t i = 0; i < table->count; i++) {
        const cairn_host_parameter *row = &table->list[i];
        double value = value_of(params, row);

        if (!is_in_range(row, value))
            return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                        "%s is %.9g, expected %s %s %.9g to %.9g", row->field,
                                        value, is_integer(row) ? "an integer" : "a number",
                                        row->above ? "above" : "from", row->lowest, row->highest);
    }
    return CAIRN_OK;
}
