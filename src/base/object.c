/* Tables of parameters, and the first steps of the creation of an object.
 *
 * Method: a field is read and written by its offset. One loop over a table takes a third of the
 * code of separate comparisons. */
#include "src/base/build.h"

#include <string.h>

#include "src/base/object.h"

void cairn_parameters_preset(const cairn_parameters *table, void *params)
{
    memset(params, 0, table->size);
    for (int32_t i = 0; i < table->count; i++) {
        const cairn_parameter *row = &table->list[i];
        unsigned char *field = (unsigned char *)params + row->at;

        if (row->type == CAIRN_PARAMETER_INTEGER)
            memcpy(field, &row->preset.integer, sizeof row->preset.integer);
        else
            memcpy(field, &row->preset.number, sizeof row->preset.number);
    }
}

/* int32_t at an offset of a params struct. */
static int32_t integer_at(const void *params, uint32_t at)
{
    int32_t value;

    memcpy(&value, (const unsigned char *)params + at, sizeof value);
    return value;
}

/* cairn_real at an offset of a params struct. */
static cairn_real number_at(const void *params, uint32_t at)
{
    cairn_real value;

    memcpy(&value, (const unsigned char *)params + at, sizeof value);
    return value;
}

/* 1 when the lowest number, or the highest, does not belong to the range itself. */
static int excludes_lowest(const cairn_parameter *row)
{
    return row->type == CAIRN_PARAMETER_NUMBER_ABOVE || row->type == CAIRN_PARAMETER_NUMBER_BETWEEN;
}

static int excludes_highest(const cairn_parameter *row)
{
    return row->type == CAIRN_PARAMETER_NUMBER_BELOW || row->type == CAIRN_PARAMETER_NUMBER_BETWEEN;
}

/* 1 when a parameter is in range; a NaN never is. */
static int is_in_range(const cairn_parameter *row, const void *params)
{
    if (row->type == CAIRN_PARAMETER_INTEGER) {
        int32_t value = integer_at(params, row->at);

        return value >= row->lowest.integer && value <= row->highest.integer;
    } else {
        cairn_real value = number_at(params, row->at);
        int is_above =
            excludes_lowest(row) ? value > row->lowest.number : value >= row->lowest.number;
        int is_below =
            excludes_highest(row) ? value < row->highest.number : value <= row->highest.number;

        return is_above && is_below;
    }
}

/* The fault of a parameter out of range. */
static cairn_object_fault fault_of(const cairn_parameters *table, const cairn_parameter *row,
                                   const void *params)
{
    cairn_object_fault fault = {.module = table->module, .field = row->field};

    if (row->type == CAIRN_PARAMETER_INTEGER) {
        fault.value = (cairn_real)integer_at(params, row->at);
        fault.lowest = (cairn_real)row->lowest.integer;
        fault.highest = (cairn_real)row->highest.integer;
    } else {
        fault.value = number_at(params, row->at);
        fault.lowest = row->lowest.number;
        fault.highest = row->highest.number;
    }
    fault.rule = row->type == CAIRN_PARAMETER_NUMBER_ABOVE     ? "above lowest, up to highest"
                 : row->type == CAIRN_PARAMETER_NUMBER_BELOW   ? "from lowest, below highest"
                 : row->type == CAIRN_PARAMETER_NUMBER_BETWEEN ? "above lowest, below highest"
                                                               : "lowest ... highest";
    return fault;
}

/* 1 when a parameter is in use. */
static int is_in_use(const cairn_parameter *row, const void *params)
{
    int32_t is;

    if (row->when == CAIRN_ALWAYS)
        return 1;
    is = integer_at(params, row->when);
    return row->when_is == 0 ? is != 0 : is == row->when_is;
}

cairn_status cairn_parameters_check(const cairn_parameters *table, const void *params,
                                    cairn_object_fault *fault)
{
    if (params == NULL)
        return cairn_parameters_require(0, table->module, "params: NULL", fault);
    for (int32_t i = 0; i < table->count; i++) {
        const cairn_parameter *row = &table->list[i];

        if (is_in_use(row, params) && !is_in_range(row, params)) {
            if (fault != NULL)
                *fault = fault_of(table, row, params);
            return CAIRN_BAD_ARGUMENT;
        }
    }
    return CAIRN_OK;
}

cairn_status cairn_parameters_require(int holds, const char *module, const char *rule,
                                      cairn_object_fault *fault)
{
    if (holds)
        return CAIRN_OK;
    if (fault != NULL) {
        memset(fault, 0, sizeof *fault);
        fault->module = module;
        fault->rule = rule;
    }
    return CAIRN_BAD_ARGUMENT;
}

void *cairn_object_take(cairn_pool *pool, size_t size)
{
    void *object = cairn_pool_take_one(pool, size);

    if (object != NULL)
        memset(object, 0, size);
    return object;
}

cairn_status cairn_object_admit(const void *object, cairn_pool *pool, size_t need)
{
    if (pool != NULL && pool->base == NULL) {
        cairn_pool_count(pool, need);
        return CAIRN_NO_MEMORY;
    }
    if (object == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    return cairn_pool_has_capacity(pool, need) ? CAIRN_OK : CAIRN_NO_MEMORY;
}
