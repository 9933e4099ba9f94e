/* Linear assignment compared with all pairings and with the Hungarian method; budgets, memory,
 * refusals. */
#include "tests/test.h"

#include <math.h>

#include "cairn/assignment.h"

enum { SIDE = 24 };

typedef struct pairing {
    cairn_pool pool;
    cairn_assignment *assignment;
    cairn_real cost[SIDE * SIDE];
    int32_t rows, columns;
} pairing;

static void start(pairing *p, int32_t most_rows, int32_t most_columns)
{
    cairn_assignment_params params = {.max_rows = most_rows, .max_columns = most_columns};

    p->pool = test_pool(cairn_assignment_memory(&params));
    assert_ok(cairn_assignment_create(&p->assignment, &p->pool, &params));
}

static void draw(pairing *p, cairn_random *random, int32_t rows, int32_t columns, int32_t levels)
{
    p->rows = rows;
    p->columns = columns;
    for (int32_t i = 0; i < rows * columns; i++)
        p->cost[i] = levels > 0 ? (cairn_real)cairn_random_below(random, levels) - 2
                                : cairn_random_uniform(random, -3, 10);
}

static cairn_assignment_result run(pairing *p)
{
    cairn_budget budget = {INT32_MAX};

    assert_ok(cairn_assignment_begin(p->assignment, p->cost, p->rows, p->columns));
    assert_int_equal(cairn_assignment_read(p->assignment).pairs, 0);
    assert_ok(cairn_assignment_step(p->assignment, &budget));
    return cairn_assignment_read(p->assignment);
}

/* Each pair once, as many as possible, and the reported sum. */
static void assert_pairs(const pairing *p, const cairn_assignment_result *r)
{
    int32_t used[SIDE] = {0}, pairs = 0;
    double sum = 0;

    assert_int_equal(r->rows, p->rows);
    for (int32_t i = 0; i < p->rows; i++) {
        assert_in_range(r->column[i] + 1, 0, p->columns);
        if (r->column[i] < 0)
            continue;
        assert_int_equal(used[r->column[i]]++, 0);
        pairs++;
        sum += (double)p->cost[i * p->columns + r->column[i]];
    }
    assert_int_equal(pairs, p->rows < p->columns ? p->rows : p->columns);
    assert_int_equal(r->pairs, pairs);
    assert_near(r->total_cost, sum, NUMBER(1e-12, 1e-4));
}

/* ---- Reference implementation: all pairings ---- */

static double least_of(const pairing *p, int32_t row, uint32_t used, int32_t skips)
{
    double least = 1e30;

    if (row == p->rows)
        return 0;
    if (skips > 0)
        least = least_of(p, row + 1, used, skips - 1);
    for (int32_t j = 0; j < p->columns; j++)
        if ((used >> j & 1) == 0)
            least = fmin(least, (double)p->cost[row * p->columns + j] +
                                    least_of(p, row + 1, used | 1U << j, skips));
    return least;
}

static double brute_force(const pairing *p)
{
    return least_of(p, 0, 0, p->rows > p->columns ? p->rows - p->columns : 0);
}

static void is_as_cheap_as_the_best_of_all_pairings(void **state)
{
    cairn_random random = cairn_random_seed(4, 1);
    pairing p;

    (void)state;
    start(&p, 7, 7);
    for (int trial = 0; trial < 400; trial++) {
        int32_t rows = 1 + cairn_random_below(&random, 6),
                columns = 1 + cairn_random_below(&random, 6);
        cairn_assignment_result r;

        draw(&p, &random, rows, columns, trial % 2 == 0 ? 4 : 0);
        r = run(&p);
        assert_pairs(&p, &r);
        assert_near(r.total_cost, brute_force(&p), NUMBER(1e-12, 1e-4));
    }
    test_pool_free(&p.pool);
}

/* ---- Larger ones: the Hungarian method on the padded square table, by its equality graph ---- */

/* Searches a free column along edges without slack. */
static int augment(const double *cost, const double *u, const double *v, int32_t n, int32_t row,
                   int32_t *seen, int32_t *row_of)
{
    for (int32_t j = 0; j < n; j++)
        if (!seen[j] && fabs(cost[row * n + j] - u[row] - v[j]) < 1e-9) {
            seen[j] = 1;
            if (row_of[j] < 0 || augment(cost, u, v, n, row_of[j], seen, row_of)) {
                row_of[j] = row;
                return 1;
            }
        }
    return 0;
}

static double hungarian(const pairing *p)
{
    static double cost[SIDE * SIDE];
    int32_t n = p->rows > p->columns ? p->rows : p->columns, row_of[SIDE];
    double u[SIDE], v[SIDE] = {0}, sum = 0;

    for (int32_t i = 0; i < n * n; i++) {
        int32_t row = i / n, column = i % n;

        cost[i] =
            row < p->rows && column < p->columns ? (double)p->cost[row * p->columns + column] : 0;
    }
    for (int32_t i = 0; i < n; i++) {
        u[i] = cost[i * n];
        row_of[i] = -1;
        for (int32_t j = 1; j < n; j++)
            u[i] = fmin(u[i], cost[i * n + j]);
    }
    for (int32_t i = 0; i < n;) {
        int32_t seen[SIDE] = {0}, tree[SIDE] = {0};
        double slack = 1e30;

        if (augment(cost, u, v, n, i, seen, row_of)) {
            i++;
            continue;
        }
        tree[i] = 1;
        for (int32_t j = 0; j < n; j++)
            if (seen[j])
                tree[row_of[j]] = 1;
        for (int32_t r = 0; r < n; r++)
            for (int32_t j = 0; j < n && tree[r]; j++)
                if (!seen[j])
                    slack = fmin(slack, cost[r * n + j] - u[r] - v[j]);
        for (int32_t k = 0; k < n; k++) {
            u[k] += tree[k] ? slack : 0;
            v[k] -= seen[k] ? slack : 0;
        }
    }
    for (int32_t j = 0; j < n; j++)
        sum += cost[row_of[j] * n + j];
    return sum;
}

static void is_as_cheap_as_the_hungarian_method(void **state)
{
    cairn_random random = cairn_random_seed(5, 1);
    pairing p;

    (void)state;
    start(&p, SIDE, SIDE);
    for (int trial = 0; trial < 200; trial++) {
        int32_t rows = 1 + cairn_random_below(&random, SIDE),
                columns = 1 + cairn_random_below(&random, SIDE);
        cairn_assignment_result r;

        draw(&p, &random, rows, columns, trial % 3 == 0 ? 6 : 0);
        r = run(&p);
        assert_pairs(&p, &r);
        assert_near(r.total_cost, hungarian(&p), NUMBER(1e-9, 1e-3));
    }
    test_pool_free(&p.pool);
}

static void gives_equals_to_the_first(void **state)
{
    pairing p;
    cairn_assignment_result r;

    (void)state;
    start(&p, 3, 5);
    p.rows = 3;
    p.columns = 5;
    for (int32_t i = 0; i < 15; i++)
        p.cost[i] = 2;
    r = run(&p);
    for (int32_t i = 0; i < 3; i++)
        assert_int_equal(r.column[i], i);
    assert_near(r.total_cost, 6, 0);
    test_pool_free(&p.pool);
}

/* ---- Budgets ---- */

static cairn_status begin_drawn(void *context)
{
    pairing *p = context;

    return cairn_assignment_begin(p->assignment, p->cost, p->rows, p->columns);
}

static cairn_status step_drawn(void *context, cairn_budget *budget)
{
    pairing *p = context;

    return cairn_assignment_step(p->assignment, budget);
}

static uint64_t result_hash(void *context)
{
    pairing *p = context;
    cairn_assignment_result r = cairn_assignment_read(p->assignment);

    return test_hash(test_hash(TEST_HASH_START, r.column, (size_t)r.rows * sizeof *r.column),
                     &r.total_cost, sizeof r.total_cost);
}

static void does_not_depend_on_budgets(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    cairn_random random = cairn_random_seed(6, 1);
    cairn_budget all = {INT32_MAX};
    pairing p;
    test_stepped object = {begin_drawn, step_drawn, result_hash, &p};
    uint64_t hash;

    (void)state;
    start(&p, SIDE, SIDE);
    draw(&p, &random, 20, 17, 0);
    assert_ok(begin_drawn(&p));
    assert_ok(step_drawn(&p, &all));
    assert_ok(step_drawn(&p, &all));
    assert_true(INT32_MAX - all.left <= 17 * 17 * 20 / 8);
    hash = result_hash(&p);
    for (int i = 0; i < 3; i++) {
        int32_t used = 0;
        cairn_status status;

        assert_ok(begin_drawn(&p));
        do {
            cairn_budget budget = {budgets[i]};

            status = step_drawn(&p, &budget);
            used += budgets[i] - budget.left;
        } while (status == CAIRN_MORE);
        assert_ok(status);
        assert_int_equal(used, INT32_MAX - all.left);
        assert_true(result_hash(&p) == hash);
    }
    test_begins_anew(&object, 7);
    test_pool_free(&p.pool);
}

/* ---- Refusals ---- */

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_assignment *assignment;

    return cairn_assignment_create(&assignment, pool, context);
}

static void memory_is_as_stated(void **state)
{
    cairn_assignment_params params = {.max_rows = 5, .max_columns = 9},
                            crosswise = {.max_rows = 9, .max_columns = 5},
                            most = {.max_rows = 4096, .max_columns = 4096},
                            least = {.max_rows = 1, .max_columns = 1};
    cairn_assignment *assignment;

    (void)state;
    assert_status(cairn_assignment_create(&assignment, NULL, &params), CAIRN_BAD_ARGUMENT);
    assert_true(cairn_assignment_memory(&most) > 0 && cairn_assignment_memory(&least) > 0);
    test_every_pool_size(create, &params, cairn_assignment_memory(&params));
    test_every_pool_size(create, &crosswise, cairn_assignment_memory(&crosswise));
}

static void refuses_bad_tables(void **state)
{
    const cairn_real bad[] = {(cairn_real)NAN, (cairn_real)INFINITY, -(cairn_real)INFINITY,
                              CAIRN_REAL(1.01e9), CAIRN_REAL(-1.01e9)};
    cairn_budget budget = {INT32_MAX};
    cairn_random random = cairn_random_seed(7, 1);
    pairing p;

    (void)state;
    start(&p, 4, 6);
    draw(&p, &random, 4, 6, 0);
    assert_status(cairn_assignment_begin(NULL, p.cost, 4, 6), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_assignment_begin(p.assignment, NULL, 4, 6), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_assignment_begin(p.assignment, p.cost, 0, 6), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_assignment_begin(p.assignment, p.cost, 4, 0), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_assignment_begin(p.assignment, p.cost, 5, 6), CAIRN_FULL);
    assert_status(cairn_assignment_begin(p.assignment, p.cost, 4, 7), CAIRN_FULL);
    assert_status(cairn_assignment_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_assignment_step(p.assignment, NULL), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_assignment_step(p.assignment, &budget));
    assert_null(cairn_assignment_read(p.assignment).column);
    assert_null(cairn_assignment_read(NULL).column);
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++)
        for (int32_t cell = 0; cell < 24; cell += 5) {
            cairn_real kept = p.cost[cell];

            p.cost[cell] = bad[k];
            assert_ok(cairn_assignment_begin(p.assignment, p.cost, 4, 6));
            assert_status(cairn_assignment_step(p.assignment, &budget), CAIRN_NOT_FINITE);
            assert_int_equal(cairn_assignment_read(p.assignment).pairs, 0);
            assert_ok(cairn_assignment_step(p.assignment, &budget));
            p.cost[cell] = kept;
        }
    p.cost[3] = CAIRN_REAL(1e9);
    p.cost[7] = CAIRN_REAL(-1e9);
    assert_ok(cairn_assignment_begin(p.assignment, p.cost, 4, 6));
    assert_ok(cairn_assignment_step(p.assignment, &budget));
    assert_int_equal(cairn_assignment_read(p.assignment).column[1], 1);
    test_pool_free(&p.pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(is_as_cheap_as_the_best_of_all_pairings),
        cmocka_unit_test(is_as_cheap_as_the_hungarian_method),
        cmocka_unit_test(gives_equals_to_the_first),
        cmocka_unit_test(does_not_depend_on_budgets),
        cmocka_unit_test(memory_is_as_stated),
        cmocka_unit_test(refuses_bad_tables),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
