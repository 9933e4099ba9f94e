/* Robust pose graphs: compared with the solutions one by one, wrong links rejected, graphs that are
 * split or too large, budgets, refusals. */
#include "tests/test.h"

#include "cairn/pose_graph_robust.h"

enum { POSES = 40, BAD = 5, LINKS = 2 * POSES - 3 + BAD };

/* A graph of a drive around a circle, with links to the next two poses and some wrong ones; and an
 * optimizer. */
typedef struct fixture {
    cairn_pose_graph_params params;
    cairn_pose_graph_robust_params robust_params;
    int32_t bad;
    cairn_pool pool;
    cairn_pose initial[POSES];
    cairn_pose_graph *graph;
    cairn_pose_graph_robust *robust;
} fixture;

static fixture default_fixture(int32_t bad)
{
    fixture f = {.params = cairn_pose_graph_default(),
                 .robust_params = cairn_pose_graph_robust_default(),
                 .bad = bad};

    f.params.max_poses = f.robust_params.max_poses = POSES;
    f.params.max_links = LINKS;
    return f;
}

static cairn_pose true_pose(int32_t i)
{
    cairn_pose step = {1, 0, 2 * CAIRN_PI / POSES}, pose = cairn_pose_identity();

    while (i-- > 0)
        pose = cairn_pose_compose(pose, step);
    return pose;
}

static void add_link(fixture *f, cairn_random *random, int32_t first, int32_t second,
                     cairn_pose first_second)
{
    static const cairn_sym3 information = {2500, 0, 0, 2500, 0, 10000};

    first_second.x += cairn_random_normal(random) / 50;
    first_second.y += cairn_random_normal(random) / 50;
    first_second.theta += cairn_random_normal(random) / 100;
    assert_ok(cairn_pose_graph_add_link(f->graph, first, second, first_second, information));
}

static void open_fixture(fixture *f)
{
    cairn_random random = cairn_random_seed(31, 1);

    f->pool = test_pool(cairn_pose_graph_memory(&f->params, NULL) +
                        cairn_pose_graph_robust_memory(&f->robust_params));
    assert_ok(cairn_pose_graph_create(&f->graph, &f->pool, &f->params, NULL));
    assert_ok(cairn_pose_graph_robust_create(&f->robust, &f->pool, &f->robust_params));
    for (int32_t i = 0; i < POSES; i++) {
        f->initial[i] = true_pose(i);
        f->initial[i].x += cairn_random_normal(&random) / 40;
        f->initial[i].y += cairn_random_normal(&random) / 40;
        assert_ok(cairn_pose_graph_add_pose(f->graph, f->initial[i]));
    }
    for (int32_t i = 0; i < POSES; i++)
        for (int32_t k = i + 1; k <= i + 2 && k < POSES; k++)
            add_link(f, &random, i, k, cairn_pose_between(true_pose(i), true_pose(k)));
    for (int32_t i = 0; i < f->bad; i++) {
        cairn_pose wrong = {-3, 2 * (cairn_real)i, 1};

        add_link(f, &random, 3 * i, 3 * i + 20, wrong);
    }
}

static cairn_status begin(void *context)
{
    fixture *f = context;

    for (int32_t i = 0; i < POSES; i++)
        assert_ok(cairn_pose_graph_set_pose(f->graph, i, f->initial[i]));
    return cairn_pose_graph_robust_begin(f->robust, f->graph);
}

static cairn_status step(void *context, cairn_budget *budget)
{
    return cairn_pose_graph_robust_step(((fixture *)context)->robust, budget);
}

static uint64_t result_hash(void *context)
{
    const fixture *f = context;
    uint64_t hash = TEST_HASH_START;

    for (int32_t i = 0; i < POSES; i++) {
        cairn_pose pose = cairn_pose_graph_pose(f->graph, i);

        hash = test_hash(hash, &pose, sizeof pose);
    }
    for (int32_t i = 0; i < cairn_pose_graph_read(f->graph).links; i++) {
        cairn_pose_graph_link link = cairn_pose_graph_link_of(f->graph, i);

        hash = test_hash(hash, &link.chi2, sizeof link.chi2);
        hash = test_hash(hash, &link.is_excluded, sizeof link.is_excluded);
    }
    return hash;
}

static cairn_pose_graph_robust_result run(fixture *f)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(begin(f));
    assert_ok(step(f, &budget));
    return cairn_pose_graph_robust_read(f->robust);
}

/* One solution from the current poses. */
static void solve(fixture *f, cairn_pose_graph_kernel kernel)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(cairn_pose_graph_set_kernel(f->graph, kernel, 3));
    assert_ok(cairn_pose_graph_solve(f->graph));
    assert_ok(cairn_pose_graph_step(f->graph, &budget));
}

static void it_gives_what_the_solutions_one_by_one_give(void **state)
{
    fixture f = default_fixture(BAD);
    cairn_pose_graph_robust_result result;
    cairn_pose_graph_state last;
    uint64_t hash;

    (void)state;
    open_fixture(&f);
    result = run(&f);
    hash = result_hash(&f);
    last = cairn_pose_graph_read(f.graph);
    assert_int_equal(result.is_robust, 1);
    assert_int_equal(result.outliers, BAD);
    for (int32_t i = 0; i < last.links; i++) {
        assert_int_equal(cairn_pose_graph_link_of(f.graph, i).is_excluded, i >= last.links - BAD);
        assert_ok(cairn_pose_graph_exclude_link(f.graph, i, 0));
    }
    for (int32_t i = 0; i < POSES; i++)
        assert_ok(cairn_pose_graph_set_pose(f.graph, i, f.initial[i]));
    solve(&f, CAIRN_POSE_GRAPH_SQUARE);
    assert_near(cairn_pose_graph_read(f.graph).chi2_initial, result.chi2_initial, 0);
    assert_true(cairn_pose_graph_read(f.graph).chi2 > 100 * last.chi2);
    for (int32_t i = 0; i < POSES; i++)
        assert_ok(cairn_pose_graph_set_pose(f.graph, i, f.initial[i]));
    solve(&f, CAIRN_POSE_GRAPH_GEMAN_MCCLURE);
    for (int32_t i = 0; i < last.links; i++)
        assert_ok(cairn_pose_graph_exclude_link(f.graph, i,
                                                cairn_pose_graph_link_of(f.graph, i).is_outlier));
    solve(&f, CAIRN_POSE_GRAPH_SQUARE);
    assert_true(result_hash(&f) == hash);
    assert_near(cairn_pose_graph_pose(f.graph, 20).y, 12.7, 0.5);
    test_pool_free(&f.pool);
}

static void without_wrong_links_it_is_least_squares(void **state)
{
    fixture f = default_fixture(0);
    cairn_pose_graph_robust_result result;
    uint64_t hash;

    (void)state;
    open_fixture(&f);
    result = run(&f);
    hash = result_hash(&f);
    assert_int_equal(result.is_robust, 0);
    assert_int_equal(result.outliers, 0);
    for (int32_t i = 0; i < POSES; i++)
        assert_ok(cairn_pose_graph_set_pose(f.graph, i, f.initial[i]));
    solve(&f, CAIRN_POSE_GRAPH_SQUARE);
    assert_true(result_hash(&f) == hash);
    test_pool_free(&f.pool);
}

static void with_an_unbounded_threshold_no_link_is_rejected(void **state)
{
    fixture f = default_fixture(BAD);
    cairn_pose_graph_robust_result result;

    (void)state;
    f.robust_params.max_deviations = CAIRN_REAL_MAX;
    open_fixture(&f);
    result = run(&f);
    assert_int_equal(result.is_robust, 0);
    assert_int_equal(result.outliers, 0);
    assert_true(cairn_pose_graph_read(f.graph).chi2 > 1000);
    test_pool_free(&f.pool);
}

static void links_excluded_before_take_part_again(void **state)
{
    fixture f = default_fixture(BAD);
    uint64_t hash;

    (void)state;
    open_fixture(&f);
    (void)run(&f);
    hash = result_hash(&f);
    assert_ok(cairn_pose_graph_exclude_link(f.graph, 0, 1));
    assert_int_equal(run(&f).outliers, BAD);
    assert_true(result_hash(&f) == hash);
    test_pool_free(&f.pool);
}

static void when_the_inliers_split_the_graph_the_robust_poses_remain(void **state)
{
    fixture f = default_fixture(BAD);
    cairn_pose robust[POSES];

    (void)state;
    f.params.max_chi2 = CAIRN_REAL(1e-20); /* every link is an outlier */
    open_fixture(&f);
    assert_int_equal(run(&f).outliers, cairn_pose_graph_read(f.graph).links);
    assert_int_equal(cairn_pose_graph_read(f.graph).verdict, CAIRN_POSE_GRAPH_DISCONNECTED);
    for (int32_t i = 0; i < POSES; i++)
        robust[i] = cairn_pose_graph_pose(f.graph, i);
    for (int32_t i = 0; i < cairn_pose_graph_read(f.graph).links; i++)
        assert_ok(cairn_pose_graph_exclude_link(f.graph, i, 0));
    for (int32_t i = 0; i < POSES; i++)
        assert_ok(cairn_pose_graph_set_pose(f.graph, i, f.initial[i]));
    solve(&f, CAIRN_POSE_GRAPH_GEMAN_MCCLURE);
    for (int32_t i = 0; i < POSES; i++) {
        cairn_pose pose = cairn_pose_graph_pose(f.graph, i);

        assert_memory_equal(&pose, &robust[i], sizeof pose);
    }
    test_pool_free(&f.pool);
}

static void a_factor_that_is_full_is_extended_and_the_work_resumed(void **state)
{
    fixture f = default_fixture(BAD);
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_pool more;
    uint64_t hash;
    int32_t fill;

    (void)state;
    open_fixture(&f);
    (void)run(&f);
    hash = result_hash(&f);
    test_pool_free(&f.pool);

    f.params.max_fill = 0;
    open_fixture(&f);
    assert_ok(begin(&f));
    assert_status(step(&f, &budget), CAIRN_FULL);
    assert_status(step(&f, &budget), CAIRN_FULL);
    fill = cairn_pose_graph_read(f.graph).fill;
    more = test_pool(cairn_block_solver_extend_memory(fill));
    assert_ok(cairn_pose_graph_extend(f.graph, &more, fill));
    assert_ok(step(&f, &budget));
    assert_true(result_hash(&f) == hash);
    test_pool_free(&more);
    test_pool_free(&f.pool);
}

static void budgets_of_1_7_1000_and_all_give_the_same_bits(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    fixture f = default_fixture(BAD);
    cairn_budget budget = {0};
    uint64_t whole;
    int64_t units;

    (void)state;
    open_fixture(&f);
    assert_ok(step(&f, &budget)); /* nothing was begun */
    (void)run(&f);                /* the solver has the structure of the graph from here on */
    assert_ok(begin(&f));
    assert_status(step(&f, &budget), CAIRN_MORE);
    budget.left = CAIRN_UNBOUNDED;
    assert_ok(step(&f, &budget));
    units = CAIRN_UNBOUNDED - budget.left;
    assert_ok(step(&f, &budget)); /* nothing left to do */
    whole = result_hash(&f);
    assert_golden(test_hash(whole, &units, sizeof units), UINT64_C(0x371f71f70a7be5c6),
                  UINT64_C(0x4db3e56cb5a48023));
    for (size_t i = 0; i < sizeof budgets / sizeof *budgets; i++) {
        int64_t used = 0;
        cairn_status status;

        assert_ok(begin(&f));
        do {
            budget.left = budgets[i];
            status = step(&f, &budget);
            used += budgets[i] - budget.left;
        } while (status == CAIRN_MORE);
        assert_ok(status);
        assert_true(result_hash(&f) == whole);
        assert_true(used == units);
    }
    test_pool_free(&f.pool);
}

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_pose_graph_robust *robust;

    return cairn_pose_graph_robust_create(&robust, pool, context);
}

static void every_smaller_pool_is_refused(void **state)
{
    cairn_pose_graph_robust_params params = cairn_pose_graph_robust_default();

    (void)state;
    params.max_poses = 9;
    test_every_pool_size(create, &params, cairn_pose_graph_robust_memory(&params));
}

static void graphs_that_cannot_be_taken_are_refused(void **state)
{
    fixture f = default_fixture(BAD);

    (void)state;
    f.robust_params.max_poses = POSES - 1;
    open_fixture(&f);
    assert_status(cairn_pose_graph_robust_begin(NULL, f.graph), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pose_graph_robust_begin(f.robust, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(begin(&f), CAIRN_FULL);
    cairn_pose_graph_clear(f.graph);
    assert_status(cairn_pose_graph_robust_begin(f.robust, f.graph), CAIRN_EMPTY);
    assert_ok(cairn_pose_graph_add_pose(f.graph, cairn_pose_identity()));
    assert_ok(cairn_pose_graph_solve(f.graph));
    assert_status(cairn_pose_graph_robust_begin(f.robust, f.graph), CAIRN_BAD_ARGUMENT);
    test_pool_free(&f.pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_gives_what_the_solutions_one_by_one_give),
        cmocka_unit_test(without_wrong_links_it_is_least_squares),
        cmocka_unit_test(with_an_unbounded_threshold_no_link_is_rejected),
        cmocka_unit_test(links_excluded_before_take_part_again),
        cmocka_unit_test(when_the_inliers_split_the_graph_the_robust_poses_remain),
        cmocka_unit_test(a_factor_that_is_full_is_extended_and_the_work_resumed),
        cmocka_unit_test(budgets_of_1_7_1000_and_all_give_the_same_bits),
        cmocka_unit_test(every_smaller_pool_is_refused),
        cmocka_unit_test(graphs_that_cannot_be_taken_are_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
