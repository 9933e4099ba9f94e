/* The objects that take memory from a pool, by the tables of their parameters: defaults, and refusal
 * of every parameter beyond its range. */
#include "tests/test.h"

#include <math.h>

#include "tools/pool_objects.h"

enum { POOL_BYTES = 1 << 20 };

/* Params of an object, and a pool. */
typedef struct param_bed {
    const pool_object *object;
    const cairn_parameter *row;
    _Alignas(16) unsigned char params[POOL_PARAMS_BYTES];
    cairn_pool pool;
} param_bed;

/* Sets the field of the row to a value. */
static void set_integer(param_bed *bed, int32_t value)
{
    memcpy(bed->params + bed->row->at, &value, sizeof value);
}

static void set_number(param_bed *bed, cairn_real value)
{
    memcpy(bed->params + bed->row->at, &value, sizeof value);
}

/* The defaults, with the row in use. */
static void set_default(param_bed *bed)
{
    const int32_t in_use = bed->row->when_is == 0 ? 1 : bed->row->when_is;

    assert_true(bed->object->parameters->size <= POOL_PARAMS_BYTES);
    bed->object->set_default(bed->params);
    if (bed->row->when != CAIRN_ALWAYS)
        memcpy(bed->params + bed->row->when, &in_use, sizeof in_use);
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

/* The fault says the range, and which of its bounds do not belong to it. */
static void assert_range_is_said(const param_bed *bed, const cairn_object_fault *fault)
{
    const cairn_parameter *row = bed->row;
    const int is_integer = row->type == CAIRN_PARAMETER_INTEGER;

    assert_int_equal(strstr(fault->rule, "above lowest") != NULL, excludes_lowest(row));
    assert_int_equal(strstr(fault->rule, "below highest") != NULL, excludes_highest(row));
    assert_near(fault->lowest, is_integer ? (cairn_real)row->lowest.integer : row->lowest.number,
                0);
    assert_near(fault->highest, is_integer ? (cairn_real)row->highest.integer : row->highest.number,
                0);
}

/* The params must be refused by name, by all three functions, and leave the pool as it was. */
static void assert_refused(param_bed *bed)
{
    const char *module = bed->object->parameters->module, *field = bed->row->field;
    cairn_object_fault fault = {.module = NULL};
    size_t used = bed->pool.used;

    if (bed->object->check(bed->params, &fault) != CAIRN_BAD_ARGUMENT || fault.field == NULL ||
        strcmp(fault.field, field) != 0)
        fail_msg("%s.%s: not refused by name, but %s", module, field,
                 fault.field == NULL ? "not at all" : fault.field);
    assert_string_equal(fault.module, module);
    assert_non_null(fault.rule);
    assert_range_is_said(bed, &fault);
    assert_int_equal(bed->object->check(bed->params, NULL), CAIRN_BAD_ARGUMENT);
    assert_int_equal(bed->object->memory(bed->params), 0);
    assert_int_equal(bed->object->create(&bed->pool, bed->params, 1), CAIRN_BAD_ARGUMENT);
    assert_int_equal(bed->pool.used, used);
}

static void check_integer(param_bed *bed)
{
    if (bed->row->lowest.integer > INT32_MIN) {
        set_default(bed);
        set_integer(bed, bed->row->lowest.integer - 1);
        assert_refused(bed);
    }
    if (bed->row->highest.integer < INT32_MAX) {
        set_default(bed);
        set_integer(bed, bed->row->highest.integer + 1);
        assert_refused(bed);
    }
}

/* The largest number below `value`, and the smallest above. */
static cairn_real below(cairn_real value)
{
    return NUMBER((cairn_real)nextafter((double)value, -(double)INFINITY),
                  (cairn_real)nextafterf((float)value, -INFINITY));
}

static cairn_real above(cairn_real value)
{
    return -below(-value);
}

static void check_number(param_bed *bed)
{
    const cairn_parameter *row = bed->row;
    cairn_real refused[] = {
        excludes_lowest(row) ? row->lowest.number : below(row->lowest.number),
        excludes_highest(row) ? row->highest.number : above(row->highest.number),
        (cairn_real)NAN,
        (cairn_real)INFINITY,
        -(cairn_real)INFINITY,
    };

    for (size_t i = 0; i < sizeof refused / sizeof *refused; i++) {
        set_default(bed);
        set_number(bed, refused[i]);
        assert_refused(bed);
    }
}

static void test_every_parameter_beyond_its_range_is_refused_by_name(void **state)
{
    static param_bed bed;
    int32_t rows = 0;

    (void)state;
    bed.pool = test_pool(POOL_BYTES);
    for (bed.object = pool_objects; bed.object->name != NULL; bed.object++)
        for (int32_t i = 0; bed.object->parameters != NULL && i < bed.object->parameters->count;
             i++) {
            bed.row = &bed.object->parameters->list[i];
            if (bed.row->type == CAIRN_PARAMETER_INTEGER)
                check_integer(&bed);
            else
                check_number(&bed);
            rows++;
        }
    print_message("%d parameters\n", (int)rows);
    assert_true(rows > 0);
    test_pool_free(&bed.pool);
}

/* The params must not be refused by the range of the row; a rule may not hold. */
static void assert_bound_belongs(param_bed *bed)
{
    cairn_object_fault fault = {.module = NULL};

    if (bed->object->check(bed->params, &fault) != CAIRN_OK && fault.field != NULL &&
        strcmp(fault.field, bed->row->field) == 0)
        fail_msg("%s.%s: a bound of its range is refused", bed->object->name, fault.field);
}

static void test_the_bounds_of_a_range_belong_to_it(void **state)
{
    static param_bed bed;

    (void)state;
    for (bed.object = pool_objects; bed.object->name != NULL; bed.object++)
        for (int32_t i = 0; bed.object->parameters != NULL && i < bed.object->parameters->count;
             i++) {
            bed.row = &bed.object->parameters->list[i];
            set_default(&bed);
            if (bed.row->type == CAIRN_PARAMETER_INTEGER) {
                set_integer(&bed, bed.row->lowest.integer);
                assert_bound_belongs(&bed);
                set_integer(&bed, bed.row->highest.integer);
            } else {
                set_number(&bed, excludes_lowest(bed.row) ? above(bed.row->lowest.number)
                                                          : bed.row->lowest.number);
                assert_bound_belongs(&bed);
                set_number(&bed, excludes_highest(bed.row) ? below(bed.row->highest.number)
                                                           : bed.row->highest.number);
            }
            assert_bound_belongs(&bed);
        }
}

static void test_the_defaults_are_in_range(void **state)
{
    static param_bed bed;

    (void)state;
    for (bed.object = pool_objects; bed.object->name != NULL; bed.object++) {
        cairn_object_fault fault = {.module = NULL};

        if (bed.object->parameters == NULL)
            continue;
        bed.object->set_default(bed.params);
        if (bed.object->check(bed.params, &fault) != CAIRN_OK)
            fail_msg("%s: %s %s", bed.object->name, fault.field == NULL ? "" : fault.field,
                     fault.rule);
        assert_true(bed.object->memory(bed.params) > 0);
    }
}

static void test_no_object_no_pool_and_no_params_are_refused(void **state)
{
    static param_bed bed;
    size_t before;

    (void)state;
    bed.pool = test_pool(POOL_BYTES);
    before = bed.pool.used;
    for (bed.object = pool_objects; bed.object->name != NULL; bed.object++) {
        cairn_object_fault fault = {.module = NULL};

        if (bed.object->parameters == NULL)
            continue;
        assert_int_equal(bed.object->check(NULL, &fault), CAIRN_BAD_ARGUMENT);
        assert_string_equal(fault.rule, "params: NULL");
        assert_null(fault.field);
        assert_int_equal(bed.object->memory(NULL), 0);
        assert_int_equal(bed.object->create(&bed.pool, NULL, 1), CAIRN_BAD_ARGUMENT);
        bed.object->set_default(bed.params);
        assert_int_equal(bed.object->create(NULL, bed.params, 1), CAIRN_BAD_ARGUMENT);
        assert_int_equal(bed.object->create(&bed.pool, bed.params, 0), CAIRN_BAD_ARGUMENT);
        assert_int_equal(bed.pool.used, before);
    }
    test_pool_free(&bed.pool);
}

static void test_a_counting_pool_adds_up_what_would_be_created(void **state)
{
    static param_bed bed;

    (void)state;
    for (bed.object = pool_objects; bed.object->name != NULL; bed.object++) {
        if (bed.object->parameters == NULL)
            continue;
        bed.object->set_default(bed.params);
        for (int has_object = 0; has_object < 2; has_object++) {
            cairn_pool_init_counting(&bed.pool);
            assert_int_equal(bed.object->create(&bed.pool, bed.params, has_object),
                             CAIRN_NO_MEMORY);
            assert_int_equal(cairn_pool_counted(&bed.pool), bed.object->memory(bed.params));
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_every_parameter_beyond_its_range_is_refused_by_name),
        cmocka_unit_test(test_the_bounds_of_a_range_belong_to_it),
        cmocka_unit_test(test_the_defaults_are_in_range),
        cmocka_unit_test(test_no_object_no_pool_and_no_params_are_refused),
        cmocka_unit_test(test_a_counting_pool_adds_up_what_would_be_created),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
