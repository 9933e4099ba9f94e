/* Charges of operations that cost less than a unit. */
#include "src/base/step.h"
#include "tests/test.h"

static void eighths_are_charged_in_whole_units(void **state)
{
    cairn_budget budget = {10};
    int32_t used = 0;
    int64_t units = 0;

    (void)state;
    for (int i = 1; i <= 16; i++) {
        assert_true(cairn_step_charge_eighths(&budget, &used, &units, 3));
        assert_int_equal(budget.left, 10 - 3 * i / 8);
        assert_int_equal(units, 3 * i / 8);
        assert_int_equal(used, 3 * i % 8);
    }
}

static void eighths_do_not_exceed_the_budget(void **state)
{
    cairn_budget budget = {0};
    int32_t used = 0, calls = 1;
    int64_t units = 0;

    (void)state;
    assert_false(cairn_step_charge_eighths(&budget, &used, &units, 1));
    budget.left = -3;
    assert_false(cairn_step_charge_eighths(&budget, &used, &units, 8));
    assert_true(budget.left == -3 && used == 0 && units == 0);
    budget.left = 2;
    while (!cairn_step_charge_eighths(&budget, &used, &units, 60)) {
        assert_int_equal(budget.left, 0);
        budget.left = 2;
        calls++;
    }
    assert_int_equal(calls, 4);
    assert_true(budget.left == 1 && used == 4 && units == 7);
}

static void an_operation_waits_while_the_budget_is_used_up(void **state)
{
    cairn_budget budget = {1};
    int32_t used = 0;
    int64_t units = 0;

    (void)state;
    assert_true(cairn_step_charge_eighths(&budget, &used, &units, 8));
    assert_false(cairn_step_charge_eighths(&budget, &used, &units, 1));
    assert_true(budget.left == 0 && used == 0 && units == 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(eighths_are_charged_in_whole_units),
        cmocka_unit_test(eighths_do_not_exceed_the_budget),
        cmocka_unit_test(an_operation_waits_while_the_budget_is_used_up),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
