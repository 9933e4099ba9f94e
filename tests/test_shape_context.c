/* Shape contexts compared with a reference implementation; whole shapes and parts, degenerate
 * shapes. */
#include "tests/test.h"

#include <math.h>

#include "cairn/shape_context.h"

enum { MAX_COUNT = 24, BINS = 60 };

typedef struct comparing {
    cairn_pool pool;
    cairn_shape_context *context;
    cairn_vec2 first[MAX_COUNT], second[MAX_COUNT];
    cairn_shape_context_input input;
} comparing;

static cairn_shape_context_params small_params(void)
{
    cairn_shape_context_params params = cairn_shape_context_default();

    params.max_points = MAX_COUNT;
    return params;
}

static void start(comparing *c)
{
    cairn_shape_context_params params = small_params();

    memset(&c->input, 0, sizeof c->input);
    params.missing_cost = CAIRN_REAL(0.75);
    c->pool = test_pool(cairn_shape_context_memory(&params));
    assert_ok(cairn_shape_context_create(&c->context, &c->pool, &params));
    c->input.first = c->first;
    c->input.second = c->second;
}

static void draw(comparing *c, cairn_random *random, int32_t first, int32_t second)
{
    c->input.first_count = first;
    c->input.second_count = second;
    for (int32_t i = 0; i < MAX_COUNT; i++) {
        c->first[i].x = cairn_random_uniform(random, -5, 5);
        c->first[i].y = cairn_random_uniform(random, -3, 3);
        c->second[i].x = cairn_random_uniform(random, -40, 40);
        c->second[i].y = cairn_random_uniform(random, -50, 50);
    }
}

static cairn_shape_context_result run(comparing *c)
{
    cairn_budget budget = {INT32_MAX};

    assert_ok(cairn_shape_context_begin(c->context, &c->input));
    assert_int_equal(cairn_shape_context_read(c->context).count, 0);
    assert_ok(cairn_shape_context_step(c->context, &budget));
    return cairn_shape_context_read(c->context);
}

/* ---- Reference implementation, in double ---- */

static double mean_distance(const cairn_vec2 *p, int32_t n)
{
    double sum = 0;

    for (int32_t i = 0; i < n; i++)
        for (int32_t k = 0; k < n; k++)
            sum += hypot((double)(p[i].x - p[k].x), (double)(p[i].y - p[k].y));
    return sum / (n * (n - 1));
}

static void count_context(const cairn_vec2 *p, int32_t n, int32_t at, double mean,
                          double context[BINS])
{
    double counted = 0;

    memset(context, 0, BINS * sizeof *context);
    for (int32_t k = 0; k < n; k++) {
        double dx = (double)(p[k].x - p[at].x), dy = (double)(p[k].y - p[at].y),
               far = hypot(dx, dy) / mean;
        double angle = atan2(dy, dx) * 180 / 3.14159265358979323846;
        int32_t ring = far < 0.125  ? 0
                       : far < 0.25 ? 1
                       : far < 0.5  ? 2
                       : far < 1    ? 3
                       : far < 2    ? 4
                                    : -1;

        if (k == at || ring < 0)
            continue;
        context[ring * 12 + (int32_t)((angle < 0 ? angle + 360 : angle) / 30)] += 1;
        counted += 1;
    }
    for (int32_t k = 0; k < BINS && counted > 0; k++)
        context[k] /= counted;
}

static void reference_costs(const comparing *c, double cost[MAX_COUNT][MAX_COUNT])
{
    const cairn_shape_context_input *in = &c->input;
    double second = mean_distance(c->second, in->second_count);
    double first =
        in->kind == CAIRN_SHAPE_CONTEXT_PART ? second : mean_distance(c->first, in->first_count);

    for (int32_t i = 0; i < in->first_count; i++)
        for (int32_t j = 0; j < in->second_count; j++) {
            double a[BINS], b[BINS];

            count_context(c->first, in->first_count, i, first, a);
            count_context(c->second, in->second_count, j, second, b);
            cost[i][j] = 0;
            for (int32_t k = 0; k < BINS; k++)
                if (a[k] + b[k] > 0)
                    cost[i][j] += (a[k] - b[k]) * (a[k] - b[k]) / (a[k] + b[k]) / 2;
        }
}

/* The cheapest assignment among all. */
static double least_of(double cost[MAX_COUNT][MAX_COUNT], int32_t rows, int32_t columns,
                       int32_t row, uint32_t used, int32_t skips)
{
    double least = 1e30;

    if (row == rows)
        return 0;
    if (skips > 0)
        least = least_of(cost, rows, columns, row + 1, used, skips - 1);
    for (int32_t j = 0; j < columns; j++)
        if ((used >> j & 1) == 0)
            least = fmin(least, cost[row][j] +
                                    least_of(cost, rows, columns, row + 1, used | 1U << j, skips));
    return least;
}

static void pairs_whole_shapes_at_the_least_cost(void **state)
{
    cairn_random random = cairn_random_seed(11, 1);
    comparing c;

    (void)state;
    start(&c);
    for (int trial = 0; trial < 60; trial++) {
        static double cost[MAX_COUNT][MAX_COUNT];
        int32_t n = 2 + cairn_random_below(&random, 5), m = 2 + cairn_random_below(&random, 5);
        cairn_shape_context_result r;
        double expected, sum = 0;
        int32_t pairs = 0, more = n > m ? n : m;

        draw(&c, &random, n, m);
        c.input.missing_share = trial % 2 == 0 ? 1 : 0;
        reference_costs(&c, cost);
        expected =
            (least_of(cost, n, m, 0, 0, n > m ? n - m : 0) + 0.75 * (n > m ? n - m : m - n)) / more;
        r = run(&c);
        assert_int_equal(r.count, n);
        assert_near(r.distance, expected, NUMBER(1e-12, 1e-5));
        for (int32_t i = 0; i < n; i++)
            if (r.match[i] >= 0) {
                sum += cost[i][r.match[i]];
                pairs++;
            }
        assert_near((sum + 0.75 * (more - pairs)) / more, expected, NUMBER(1e-12, 1e-5));
    }
    test_pool_free(&c.pool);
}

/* In both directions, without examining the pairs; the same when the shapes are exchanged. */
static void measures_both_ways(void **state)
{
    cairn_random random = cairn_random_seed(17, 1);
    comparing c;

    (void)state;
    start(&c);
    for (int trial = 0; trial < 40; trial++) {
        static double cost[MAX_COUNT][MAX_COUNT];
        int32_t n = 2 + cairn_random_below(&random, MAX_COUNT - 1),
                m = 2 + cairn_random_below(&random, MAX_COUNT - 1);
        cairn_shape_context_result r;
        double expected = 0;

        c.input.first = c.first;
        c.input.second = c.second;
        draw(&c, &random, n, m);
        reference_costs(&c, cost);
        for (int32_t i = 0; i < n; i++) {
            double least = 1e30;

            for (int32_t j = 0; j < m; j++)
                least = fmin(least, cost[i][j]);
            expected += least / n;
        }
        for (int32_t j = 0; j < m; j++) {
            double least = 1e30;

            for (int32_t i = 0; i < n; i++)
                least = fmin(least, cost[i][j]);
            expected += least / m;
        }
        r = run(&c);
        assert_near(r.symmetric_distance, expected, NUMBER(1e-12, 1e-5));
        c.input.first = c.second;
        c.input.second = c.first;
        c.input.first_count = m;
        c.input.second_count = n;
        assert_near(run(&c).symmetric_distance, expected, NUMBER(1e-12, 1e-5));
    }
    test_pool_free(&c.pool);
}

static void takes_the_nearest_for_parts(void **state)
{
    cairn_random random = cairn_random_seed(12, 1);
    comparing c;

    (void)state;
    start(&c);
    c.input.kind = CAIRN_SHAPE_CONTEXT_PART;
    for (int trial = 0; trial < 60; trial++) {
        static double cost[MAX_COUNT][MAX_COUNT];
        int32_t n = 2 + cairn_random_below(&random, MAX_COUNT - 1),
                m = 2 + cairn_random_below(&random, MAX_COUNT - 1);
        cairn_shape_context_result r;
        double expected = 0;

        draw(&c, &random, n, m);
        for (int32_t i = 0; i < n; i++)
            c.first[i] = cairn_vec2_scale(c.first[i], 6);
        c.input.missing_share = CAIRN_REAL(0.25) * (cairn_real)(trial % 5);
        reference_costs(&c, cost);
        r = run(&c);
        for (int32_t i = 0; i < n; i++) {
            double least = 1e30;

            for (int32_t j = 0; j < m; j++)
                least = fmin(least, cost[i][j]);
            assert_near(cost[i][r.match[i]], least, NUMBER(1e-12, 1e-6));
            expected += least / n;
        }
        assert_near(r.distance, expected + 0.75 * (double)c.input.missing_share,
                    NUMBER(1e-12, 1e-5));
    }
    test_pool_free(&c.pool);
}

static void is_zero_for_the_same_shape_at_another_size_and_place(void **state)
{
    cairn_random random = cairn_random_seed(13, 1);
    cairn_shape_context_result r;
    comparing c;

    (void)state;
    start(&c);
    draw(&c, &random, 20, 20);
    for (int32_t i = 0; i < 20; i++) {
        c.second[19 - i].x = 4 * c.first[i].x + 8;
        c.second[19 - i].y = 4 * c.first[i].y - 2;
    }
    r = run(&c);
    assert_near(r.distance, 0, NUMBER(1e-12, 0.01));
    for (int32_t i = 0; i < 20; i++)
        assert_int_equal(r.match[i], 19 - i);
    /* Upside down it is another shape. */
    for (int32_t i = 0; i < 20; i++)
        c.second[i].y = -c.second[i].y;
    r = run(&c);
    assert_true(r.distance > CAIRN_REAL(0.2));
    test_pool_free(&c.pool);
}

/* Coincident points, points far away from all others, points on the borders of sectors. */
static void accepts_unusual_points(void **state)
{
    comparing c;
    cairn_shape_context_result r;
    cairn_budget budget = {INT32_MAX};

    (void)state;
    start(&c);
    memset(c.first, 0, sizeof c.first);
    memset(c.second, 0, sizeof c.second);
    c.input.first_count = c.input.second_count = 16;
    c.first[15].x = c.second[15].x = CAIRN_REAL(1e9);
    c.second[15].y = CAIRN_REAL(-1e9);
    r = run(&c);
    assert_true(r.distance >= 0 && r.distance <= 1);
    c.first[15].x = 0;
    assert_ok(cairn_shape_context_begin(c.context, &c.input));
    assert_status(cairn_shape_context_step(c.context, &budget), CAIRN_EMPTY);
    assert_int_equal(cairn_shape_context_read(c.context).count, 0);
    assert_ok(cairn_shape_context_step(c.context, &budget));
    c.input.kind = CAIRN_SHAPE_CONTEXT_PART;
    r = run(&c);
    assert_true(r.distance >= 0 && r.distance <= 1);
    c.second[15] = c.second[0];
    assert_ok(cairn_shape_context_begin(c.context, &c.input));
    assert_status(cairn_shape_context_step(c.context, &budget), CAIRN_EMPTY);
    test_pool_free(&c.pool);
}

/* ---- Budgets ---- */

static cairn_status begin_drawn(void *context)
{
    comparing *c = context;

    return cairn_shape_context_begin(c->context, &c->input);
}

static cairn_status step_drawn(void *context, cairn_budget *budget)
{
    comparing *c = context;

    return cairn_shape_context_step(c->context, budget);
}

static uint64_t result_hash(void *context)
{
    comparing *c = context;
    cairn_shape_context_result r = cairn_shape_context_read(c->context);

    return test_hash(test_hash(TEST_HASH_START, r.match, (size_t)r.count * sizeof *r.match),
                     &r.distance, sizeof r.distance);
}

static void does_not_depend_on_budgets(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    cairn_random random = cairn_random_seed(14, 1);
    cairn_budget all = {INT32_MAX};
    comparing c;
    test_stepped object = {begin_drawn, step_drawn, result_hash, &c};
    uint64_t hash;

    (void)state;
    start(&c);
    draw(&c, &random, 20, 24);
    assert_ok(begin_drawn(&c));
    assert_ok(step_drawn(&c, &all));
    assert_in_range(INT32_MAX - all.left, 20 * 19 + 24 * 23 + 3 * 20 * 24,
                    2 * (20 * 19 + 24 * 23 + 3 * 20 * 24));
    hash = result_hash(&c);
    assert_golden(test_hash(hash, &all.left, sizeof all.left), UINT64_C(0xf234f68f5b2b0ff5),
                  UINT64_C(0x7424b2c80bf084b0));
    for (int i = 0; i < 3; i++) {
        int32_t used = 0;
        cairn_status status;

        assert_ok(begin_drawn(&c));
        do {
            cairn_budget budget = {budgets[i]};

            status = step_drawn(&c, &budget);
            used += budgets[i] - budget.left;
        } while (status == CAIRN_MORE);
        assert_ok(status);
        assert_int_equal(used, INT32_MAX - all.left);
        assert_true(result_hash(&c) == hash);
    }
    test_begins_anew(&object, 9);
    test_pool_free(&c.pool);
}

/* ---- Refusals ---- */

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_shape_context *made;

    return cairn_shape_context_create(&made, pool, context);
}

/* Rules between parameters; tests/test_object.c has the ranges. */
static void refuses_bad_params(void **state)
{
    cairn_shape_context_params good = small_params(), bad = good;
    cairn_object_fault fault = {.module = NULL};
    cairn_pool pool = test_pool(1 << 20);

    (void)state;
    bad.outer_radius = bad.inner_radius;
    assert_status(cairn_shape_context_check(&bad, &fault), CAIRN_BAD_ARGUMENT);
    assert_string_equal(fault.rule, "outer_radius: above inner_radius");
    assert_int_equal(cairn_shape_context_memory(&bad), 0);
    assert_status(cairn_shape_context_create(NULL, &pool, &good), CAIRN_BAD_ARGUMENT);
    good.max_points = 6;
    test_every_pool_size(create, &good, cairn_shape_context_memory(&good));
    test_pool_free(&pool);
}

static void refuses_bad_input(void **state)
{
    cairn_random random = cairn_random_seed(15, 1);
    cairn_budget budget = {INT32_MAX};
    comparing c;
    cairn_shape_context_input bad[9];
    cairn_real *coordinate[] = {&c.first[3].x, &c.first[0].y, &c.second[7].x, &c.second[2].y};

    (void)state;
    start(&c);
    draw(&c, &random, 8, 8);
    for (int i = 0; i < 9; i++)
        bad[i] = c.input;
    bad[0].first = NULL;
    bad[1].second = NULL;
    bad[2].first_count = 1;
    bad[3].second_count = 1;
    bad[4].kind = -1;
    bad[5].kind = 2;
    bad[6].missing_share = CAIRN_REAL(-0.01);
    bad[7].missing_share = CAIRN_REAL(1.01);
    bad[8].missing_share = (cairn_real)NAN;
    for (int i = 0; i < 9; i++)
        assert_status(cairn_shape_context_begin(c.context, &bad[i]), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_shape_context_begin(NULL, &c.input), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_shape_context_begin(c.context, NULL), CAIRN_BAD_ARGUMENT);
    c.input.first_count = MAX_COUNT + 1;
    assert_status(cairn_shape_context_begin(c.context, &c.input), CAIRN_FULL);
    c.input.first_count = 8;
    c.input.second_count = MAX_COUNT + 1;
    assert_status(cairn_shape_context_begin(c.context, &c.input), CAIRN_FULL);
    c.input.second_count = 8;
    for (int i = 0; i < 4; i++) {
        cairn_real kept = *coordinate[i];

        *coordinate[i] = (cairn_real)NAN;
        assert_status(cairn_shape_context_begin(c.context, &c.input), CAIRN_NOT_FINITE);
        *coordinate[i] = CAIRN_REAL(1.01e9);
        assert_status(cairn_shape_context_begin(c.context, &c.input), CAIRN_NOT_FINITE);
        *coordinate[i] = kept;
    }
    assert_status(cairn_shape_context_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_shape_context_step(c.context, NULL), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_shape_context_step(c.context, &budget));
    assert_null(cairn_shape_context_read(c.context).match);
    assert_null(cairn_shape_context_read(NULL).match);
    test_pool_free(&c.pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pairs_whole_shapes_at_the_least_cost),
        cmocka_unit_test(measures_both_ways),
        cmocka_unit_test(takes_the_nearest_for_parts),
        cmocka_unit_test(is_zero_for_the_same_shape_at_another_size_and_place),
        cmocka_unit_test(accepts_unusual_points),
        cmocka_unit_test(does_not_depend_on_budgets),
        cmocka_unit_test(refuses_bad_params),
        cmocka_unit_test(refuses_bad_input),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
