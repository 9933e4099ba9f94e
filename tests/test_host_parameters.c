/* Tables of parameters of the host library. */
#include "tests/test.h"

#include <math.h>
#include <string.h>

#include "src/host/base/host_parameters.h"

typedef struct example_params {
    int32_t whole;
    int64_t long_whole;
    float single;
    double number;
    const char *name;
} example_params;

static const cairn_host_parameter rows[] = {
    CAIRN_HOST_NUMBER(example_params, whole, 3, -2, 7),
    CAIRN_HOST_NUMBER(example_params, long_whole, 5000000000, 1, INT64_MAX),
    CAIRN_HOST_NUMBER(example_params, single, 0.5, 0, 1),
    CAIRN_HOST_NUMBER_ABOVE(example_params, number, 0.25, 0, 1e6),
};

static const cairn_host_parameters example = CAIRN_HOST_PARAMETERS(example_params, rows);

static void defaults_are_those_of_the_table_and_0_elsewhere(void **state)
{
    example_params params;

    (void)state;
    memset(&params, 0xff, sizeof params);
    cairn_host_parameters_preset(&example, &params);
    assert_int_equal(params.whole, 3);
    assert_true(params.long_whole == INT64_C(5000000000));
    assert_near(params.single, 0.5, 0);
    assert_near(params.number, 0.25, 0);
    assert_null(params.name);
    assert_ok(cairn_host_parameters_check(&example, &params, "here", NULL));
}

static void assert_refused(const example_params *params, const char *text)
{
    cairn_file_error error = {.status = CAIRN_OK};

    assert_status(cairn_host_parameters_check(&example, params, "here", &error),
                  CAIRN_BAD_ARGUMENT);
    assert_int_equal(error.status, CAIRN_BAD_ARGUMENT);
    assert_string_equal(error.text, text);
    assert_status(cairn_host_parameters_check(&example, params, "here", NULL), CAIRN_BAD_ARGUMENT);
}

static void the_message_names_field_value_and_range(void **state)
{
    example_params good, params;

    (void)state;
    cairn_host_parameters_preset(&example, &good);
#define REFUSED(change, text)                                                                      \
    params = good;                                                                                 \
    params.change;                                                                                 \
    assert_refused(&params, "here: " text)
    REFUSED(whole = -3, "whole is -3, expected an integer from -2 to 7");
    REFUSED(whole = 8, "whole is 8, expected an integer from -2 to 7");
    REFUSED(long_whole = 0, "long_whole is 0, expected an integer from 1 to 9.22337204e+18");
    REFUSED(single = 1.5F, "single is 1.5, expected a number from 0 to 1");
    REFUSED(single = NAN, "single is nan, expected a number from 0 to 1");
    REFUSED(number = 0, "number is 0, expected a number above 0 to 1000000");
    REFUSED(number = (double)INFINITY, "number is inf, expected a number above 0 to 1000000");
#undef REFUSED
    assert_refused(NULL, "here: no parameters, expected those of _default()");
}

static void the_bounds_belong_to_the_range(void **state)
{
    example_params params;

    (void)state;
    cairn_host_parameters_preset(&example, &params);
    params.whole = -2;
    params.long_whole = INT64_MAX;
    params.single = 0;
    params.number = 1e-300;
    assert_ok(cairn_host_parameters_check(&example, &params, "here", NULL));
    params.whole = 7;
    params.long_whole = 1;
    params.single = 1;
    params.number = 1e6;
    assert_ok(cairn_host_parameters_check(&example, &params, "here", NULL));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(defaults_are_those_of_the_table_and_0_elsewhere),
        cmocka_unit_test(the_message_names_field_value_and_range),
        cmocka_unit_test(the_bounds_belong_to_the_range),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
