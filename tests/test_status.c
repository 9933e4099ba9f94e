/* Every status has a text of its own, and the numbers are fixed. */
#include "tests/test.h"

static void every_status_has_its_text(void **state)
{
    static const struct {
        cairn_status status;
        int32_t number;
        const char *word; /* that its text must hold */
    } all[] = {
        {CAIRN_OK, 0, "done"},
        {CAIRN_MORE, 1, "step"},
        {CAIRN_BAD_ARGUMENT, -1, "argument"},
        {CAIRN_NOT_FINITE, -2, "finite"},
        {CAIRN_NO_MEMORY, -3, "memory"},
        {CAIRN_FULL, -4, "capacity"},
        {CAIRN_EMPTY, -5, "nothing"},
        {CAIRN_BAD_FORMAT, -6, "format"},
        {CAIRN_TRUNCATED, -7, "ends"},
        {CAIRN_UNSUPPORTED, -8, "supported"},
        {CAIRN_IO, -9, "output"},
        {CAIRN_BAD_BUILD, -10, "built"},
        {CAIRN_BUSY, -11, "worked on"},
    };
    const size_t count = sizeof all / sizeof *all;

    (void)state;
    for (size_t i = 0; i < count; i++) {
        const char *text = cairn_status_text(all[i].status);

        assert_int_equal(all[i].status, all[i].number);
        assert_non_null(strstr(text, all[i].word));
        assert_int_not_equal(text[strlen(text) - 1], '.');
        for (size_t j = 0; j < i; j++)
            assert_string_not_equal(text, cairn_status_text(all[j].status));
    }
    assert_string_equal(cairn_status_text(2), "unknown status");
    assert_string_equal(cairn_status_text(-12), "unknown status");
    assert_string_equal(cairn_status_text(INT32_MIN), "unknown status");
}

static void expensive_items_are_charged_over_several_calls(void **state)
{
    cairn_budget budget = {0};
    int32_t charged = 0;

    (void)state;
    assert_false(cairn_budget_charge(&budget, &charged, 1));
    budget.left = -3;
    assert_false(cairn_budget_charge(&budget, &charged, 1));
    assert_int_equal(budget.left, -3);
    budget.left = 2;
    assert_false(cairn_budget_charge(&budget, &charged, 5));
    assert_int_equal(budget.left, 0);
    budget.left = 7;
    assert_true(cairn_budget_charge(&budget, &charged, 5));
    assert_int_equal(budget.left, 4);
    assert_true(cairn_budget_charge(&budget, &charged, 4));
    assert_int_equal(budget.left + charged, 0);
    assert_true(cairn_budget_charge(&budget, &charged, 0));
}

static void a_refusal_fills_in_the_fault(void **state)
{
    cairn_fault fault = {5, NULL};

    (void)state;
    assert_status(cairn_refuse(&fault, INT64_MAX, "what", CAIRN_FULL), CAIRN_FULL);
    assert_true(fault.index == INT64_MAX);
    assert_string_equal(fault.message, "what");
    assert_status(cairn_refuse(NULL, 0, "what", CAIRN_EMPTY), CAIRN_EMPTY);
}

static void a_budget_gives_as_many_units_as_it_has(void **state)
{
    cairn_budget budget = {0};

    (void)state;
    assert_int_equal(cairn_budget_take(&budget, 1), 0);
    budget.left = -3;
    assert_int_equal(cairn_budget_take(&budget, 1), 0);
    assert_int_equal(budget.left, -3);
    budget.left = 5;
    assert_int_equal(cairn_budget_take(&budget, 0), 0);
    assert_int_equal(cairn_budget_take(&budget, -2), 0);
    assert_int_equal(budget.left, 5);
    assert_int_equal(cairn_budget_take(&budget, 3), 3);
    assert_int_equal(budget.left, 2);
    assert_int_equal(cairn_budget_take(&budget, INT32_MAX), 2);
    assert_int_equal(budget.left, 0);
}

static void units_spent_may_leave_a_budget_below_0(void **state)
{
    cairn_budget budget = {4};

    (void)state;
    cairn_budget_spend(&budget, 0);
    assert_int_equal(budget.left, 4);
    cairn_budget_spend(&budget, 7);
    assert_int_equal(budget.left, -3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_status_has_its_text),
        cmocka_unit_test(expensive_items_are_charged_over_several_calls),
        cmocka_unit_test(a_refusal_fills_in_the_fault),
        cmocka_unit_test(a_budget_gives_as_many_units_as_it_has),
        cmocka_unit_test(units_spent_may_leave_a_budget_below_0),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
