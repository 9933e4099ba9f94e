/* SuiteSparse compared with the built-in solver: the same solutions, covariances and poses;
 * refusals. */
#include "tests/test.h"

#include <math.h>
#include <sys/resource.h>

#include "cairn/sparse_solver.h"

enum { POSES = 40, LINKS = 90, FILL = 800 };

static const double TOLERANCE = NUMBER(1e-9, 2e-4);

static int open_or_say_so(cairn_sparse_solver **solver)
{
    cairn_status status = cairn_sparse_solver_open(solver);

    if (status == CAIRN_UNSUPPORTED) {
        print_message("SuiteSparse is not installed: left out\n");
        return 0;
    }
    assert_ok(status);
    return 1;
}

static cairn_pose_graph_solver builtin(cairn_pool *pool)
{
    cairn_block_solver_params params = {.max_poses = POSES, .max_links = LINKS, .max_fill = FILL};
    cairn_block_solver *solver;

    *pool = test_pool(cairn_block_solver_memory(&params));
    assert_ok(cairn_block_solver_create(&solver, pool, &params));
    return cairn_pose_graph_solver_of(solver);
}

static cairn_status run(const cairn_pose_graph_solver *face)
{
    cairn_budget budget = {0};
    cairn_status status = face->step(face->context, &budget);

    assert_int_equal(status, CAIRN_MORE);
    assert_int_equal(face->read(face->context).running, 1);
    do {
        budget.left = 1000;
        status = face->step(face->context, &budget);
    } while (status == CAIRN_MORE);
    assert_int_equal(face->read(face->context).running, 0);
    return status;
}

/* A random positive definite system, the same in every solver; pairs are linked in both directions
 * and twice. */
static void give_system(const cairn_pose_graph_solver *face, uint64_t seed, cairn_real prior)
{
    cairn_random random = cairn_random_seed(seed, 0);

    assert_ok(face->begin(face->context, POSES));
    for (int32_t l = 0; l < LINKS; l++) {
        int32_t a = l < POSES - 1 ? l : cairn_random_below(&random, POSES);
        int32_t b =
            l < POSES - 1 ? l + 1 : (a + 1 + cairn_random_below(&random, POSES - 1)) % POSES;

        if (l % 7 == 6)
            assert_ok(face->add_link(face->context, 1 + l % (POSES - 1), l % (POSES - 1)));
        else
            assert_ok(face->add_link(face->context, a, b));
    }
    assert_ok(face->analyze(face->context));
    assert_ok(run(face));
    random = cairn_random_seed(seed, 0);
    for (int32_t i = 0; i < POSES; i++) {
        cairn_sym3 block = {prior, prior / 4, 0, prior, prior / 5, prior};

        assert_ok(face->add_pose_block(face->context, i, block));
    }
    for (int32_t l = 0; l < LINKS; l++) {
        int32_t a = l < POSES - 1 ? l : cairn_random_below(&random, POSES);
        int32_t b =
            l < POSES - 1 ? l + 1 : (a + 1 + cairn_random_below(&random, POSES - 1)) % POSES;
        cairn_sym3 first = cairn_sym3_zero(), second = cairn_sym3_zero();
        cairn_real block[9] = {0};
        cairn_random values = cairn_random_seed(seed, (uint64_t)l + 1);

        if (l % 7 == 6) {
            a = 1 + l % (POSES - 1);
            b = l % (POSES - 1);
        }
        for (int k = 0; k < 4; k++) {
            cairn_real u[3], v[3];

            for (int c = 0; c < 3; c++) {
                u[c] = cairn_random_uniform(&values, -1, 1);
                v[c] = cairn_random_uniform(&values, -1, 1);
            }
            cairn_sym3_add_outer(&first, u, 1);
            cairn_sym3_add_outer(&second, v, 1);
            for (int r = 0; r < 9; r++)
                block[r] += u[r / 3] * v[r % 3];
        }
        assert_ok(face->add_pose_block(face->context, a, first));
        assert_ok(face->add_pose_block(face->context, b, second));
        assert_ok(face->add_link_block(face->context, l, block));
    }
}

static void same_solutions_and_covariances(void **state)
{
    cairn_sparse_solver *sparse;
    cairn_pose_graph_solver face[2];
    cairn_real b[3 * POSES];
    cairn_pool pool;
    int32_t compared = 0;

    (void)state;
    if (!open_or_say_so(&sparse))
        return;
    face[0] = cairn_sparse_solver_interface(sparse);
    face[1] = builtin(&pool);
    for (uint64_t seed = 1; seed < 6; seed++) {
        for (int32_t i = 0; i < 3 * POSES; i++)
            b[i] = (cairn_real)(i % 11) - 5;
        for (int k = 0; k < 2; k++) {
            give_system(&face[k], seed, CAIRN_REAL(0.5));
            assert_ok(face[k].factor(face[k].context));
            assert_ok(run(&face[k]));
            assert_int_equal(face[k].read(face[k].context).state, CAIRN_BLOCK_SOLVER_FACTORED);
            assert_ok(face[k].solve(face[k].context, b));
            assert_ok(run(&face[k]));
        }
        for (int32_t i = 0; i < POSES; i++) {
            cairn_real x[2][3];

            for (int k = 0; k < 2; k++)
                assert_ok(face[k].solution(face[k].context, i, x[k]));
            for (int c = 0; c < 3; c++)
                assert_near(x[0][c], x[1][c], TOLERANCE * (1 + fabs((double)x[1][c])));
        }
        for (int k = 0; k < 2; k++) {
            assert_ok(face[k].invert(face[k].context));
            assert_ok(run(&face[k]));
        }
        for (int32_t i = 0; i < POSES; i++)
            for (int32_t j = 0; j < POSES; j++) {
                cairn_real z[2][9];

                assert_ok(face[0].covariance(face[0].context, i, j, z[0]));
                if (face[1].covariance(face[1].context, i, j, z[1]) != CAIRN_OK)
                    continue;
                compared++;
                for (int c = 0; c < 9; c++)
                    assert_near(z[0][c], z[1][c], TOLERANCE * 10);
            }
    }
    assert_true(compared > 5 * POSES);
    assert_true(cairn_sparse_solver_memory(sparse) > 10000);
    cairn_sparse_solver_close(sparse);
    test_pool_free(&pool);
}

/* A whole graph: the poses agree to 1e-6. */
static void same_poses(void **state)
{
    cairn_pose_graph_params params = cairn_pose_graph_default();
    const cairn_sym3 information = {400, 30, 10, 300, -20, 900};
    cairn_pose_graph *graph[2];
    cairn_sparse_solver *sparse;
    cairn_pose_graph_solver face;
    cairn_pool pool[2];

    (void)state;
    if (!open_or_say_so(&sparse))
        return;
    face = cairn_sparse_solver_interface(sparse);
    for (int k = 0; k < 2; k++) {
        const cairn_pose_graph_solver *own = k == 0 ? &face : NULL;
        cairn_random random = cairn_random_seed(5, 0);
        cairn_budget budget = {CAIRN_UNBOUNDED};

        pool[k] = test_pool(cairn_pose_graph_memory(&params, own));
        assert_ok(cairn_pose_graph_create(&graph[k], &pool[k], &params, own));
        for (int32_t i = 0; i < 100; i++) {
            int32_t row = i / 10;
            cairn_pose pose = {(cairn_real)(i - 10 * row), (cairn_real)row, 0};

            assert_ok(cairn_pose_graph_add_pose(graph[k], pose));
        }
        for (int32_t i = 0; i < 100; i++)
            for (int32_t step = 1; step <= 10; step += 9) {
                cairn_pose z = {step == 1, step == 10, 0};

                z.x += cairn_random_uniform(&random, CAIRN_REAL(-0.1), CAIRN_REAL(0.1));
                z.theta += cairn_random_uniform(&random, CAIRN_REAL(-0.1), CAIRN_REAL(0.1));
                if (i + step < 100 && (step == 10 || i % 10 < 9))
                    assert_ok(cairn_pose_graph_add_link(graph[k], i, i + step, z, information));
            }
        assert_ok(cairn_pose_graph_solve(graph[k]));
        assert_ok(cairn_pose_graph_step(graph[k], &budget));
        assert_int_equal(cairn_pose_graph_read(graph[k]).verdict, CAIRN_POSE_GRAPH_CONVERGED);
    }
    for (int32_t i = 0; i < 100; i++) {
        cairn_pose a = cairn_pose_graph_pose(graph[0], i), b = cairn_pose_graph_pose(graph[1], i);

        assert_near(a.x, b.x, NUMBER(1e-6, 2e-2));
        assert_near(a.y, b.y, NUMBER(1e-6, 2e-2));
        assert_near(a.theta, b.theta, NUMBER(1e-6, 2e-2));
    }
    cairn_sparse_solver_close(sparse);
    test_pool_free(&pool[0]);
    test_pool_free(&pool[1]);
}

static void refusals(void **state)
{
    const cairn_real nan = (cairn_real)NAN;
    const cairn_sym3 one = {1, 0, 0, 1, 0, 1}, bad = {1, 0, 0, nan, 0, 1},
                     flat = {1, 0, 0, 0, 0, 1};
    cairn_real b[6] = {0}, x[9] = {0};
    cairn_sparse_solver *sparse;
    cairn_pose_graph_solver f;
    cairn_budget budget = {5};

    (void)state;
    cairn_sparse_solver_close(NULL);
    if (!open_or_say_so(&sparse))
        return;
    f = cairn_sparse_solver_interface(sparse);
    assert_ok(f.step(f.context, &budget));
    assert_int_equal(budget.left, 5);
    assert_status(f.add_link(f.context, 0, 1), CAIRN_BAD_ARGUMENT);
    assert_status(f.analyze(f.context), CAIRN_BAD_ARGUMENT);
    assert_status(f.begin(f.context, 0), CAIRN_BAD_ARGUMENT);
    assert_ok(f.begin(f.context, 2));
    assert_status(f.add_link(f.context, 0, 2), CAIRN_BAD_ARGUMENT);
    assert_status(f.add_link(f.context, -1, 1), CAIRN_BAD_ARGUMENT);
    assert_status(f.add_link(f.context, 1, 1), CAIRN_BAD_ARGUMENT);
    assert_ok(f.add_link(f.context, 1, 0));
    assert_status(f.clear(f.context), CAIRN_BAD_ARGUMENT);
    assert_ok(f.analyze(f.context));
    assert_status(f.clear(f.context), CAIRN_BAD_ARGUMENT);
    assert_ok(run(&f));
    assert_int_equal(f.read(f.context).fill, 1);
    assert_status(f.add_link(f.context, 1, 0), CAIRN_BAD_ARGUMENT);
    assert_status(f.add_pose_block(f.context, 2, one), CAIRN_BAD_ARGUMENT);
    assert_status(f.add_pose_block(f.context, 0, bad), CAIRN_NOT_FINITE);
    assert_status(f.add_link_block(f.context, 1, x), CAIRN_BAD_ARGUMENT);
    assert_status(f.add_link_block(f.context, -1, x), CAIRN_BAD_ARGUMENT);
    x[8] = nan;
    assert_status(f.add_link_block(f.context, 0, x), CAIRN_NOT_FINITE);
    assert_status(f.solve(f.context, b), CAIRN_BAD_ARGUMENT);
    assert_status(f.invert(f.context), CAIRN_BAD_ARGUMENT);
    assert_ok(f.add_pose_block(f.context, 0, one));
    assert_ok(f.add_pose_block(f.context, 1, flat));
    assert_ok(f.factor(f.context));
    assert_status(f.factor(f.context), CAIRN_BAD_ARGUMENT);
    assert_ok(run(&f));
    assert_int_equal(f.read(f.context).state, CAIRN_BLOCK_SOLVER_NOT_POSITIVE);
    assert_int_equal(f.read(f.context).failed_pose, 1);
    assert_ok(f.clear(f.context));
    assert_int_equal(f.read(f.context).failed_pose, -1);
    for (int32_t i = 0; i < 2; i++)
        assert_ok(f.add_pose_block(f.context, i, one));
    assert_ok(f.factor(f.context));
    assert_ok(run(&f));
    assert_int_equal(f.read(f.context).failed_pose, -1);
    b[5] = nan;
    assert_status(f.solve(f.context, b), CAIRN_NOT_FINITE);
    assert_status(f.solution(f.context, 0, x), CAIRN_EMPTY);
    assert_status(f.solution(f.context, 2, x), CAIRN_BAD_ARGUMENT);
    assert_status(f.covariance(f.context, 0, 0, x), CAIRN_EMPTY);
    assert_status(f.covariance(f.context, 0, 2, x), CAIRN_BAD_ARGUMENT);
    cairn_sparse_solver_close(sparse);
}

/* One pose with only a diagonal: the outcome of factor(). */
static cairn_block_solver_state state_of_pose(const cairn_pose_graph_solver *f, cairn_sym3 block)
{
    assert_ok(f->begin(f->context, 1));
    assert_ok(f->analyze(f->context));
    assert_ok(run(f));
    assert_ok(f->add_pose_block(f->context, 0, block));
    assert_ok(f->factor(f->context));
    assert_ok(run(f));
    return f->read(f->context).state;
}

/* Every unknown is scaled by its own diagonal, and a solution beyond the range of a cairn_real is
 * reported. */
static void one_pose(void **state)
{
    const cairn_sym3 uneven = {CAIRN_REAL(1e-18), 0, 0, 1, 0, CAIRN_REAL(1e18)};
    cairn_sparse_solver *sparse;
    cairn_pose_graph_solver f;
    cairn_real x[3];

    (void)state;
    if (!open_or_say_so(&sparse))
        return;
    f = cairn_sparse_solver_interface(sparse);
    assert_int_equal(state_of_pose(&f, uneven), CAIRN_BLOCK_SOLVER_FACTORED);
    for (int k = 0; k < 3; k++) {
        const cairn_real tiny = (cairn_real)NUMBER(1e-300, 1e-30);
        cairn_sym3 block = {k == 0 ? tiny : 1, 0, 0, k == 1 ? tiny : 1, 0, k == 2 ? tiny : 1};
        cairn_real b[3] = {3, 4, 5};

        assert_int_equal(state_of_pose(&f, block), CAIRN_BLOCK_SOLVER_FACTORED);
        assert_ok(f.solve(f.context, b));
        assert_ok(run(&f));
        assert_ok(f.solution(f.context, 0, x));
        assert_near(x[k] * tiny, b[k], 1e-6);
        b[k] = k == 1 ? -1 / tiny : 1 / tiny;
        assert_ok(f.solve(f.context, b));
        assert_status(run(&f), CAIRN_NOT_FINITE);
        assert_status(f.solution(f.context, 0, x), CAIRN_EMPTY);
    }
    cairn_sparse_solver_close(sparse);
}

/* Pivots of the second of two poses that are `left` rounding errors of its diagonal. */
static void small_pivots(void **state)
{
    const cairn_sym3 one = {1, 0, 0, 1, 0, 1};
    cairn_sparse_solver *sparse;
    cairn_pose_graph_solver f;

    (void)state;
    if (!open_or_say_so(&sparse))
        return;
    f = cairn_sparse_solver_interface(sparse);
    for (int k = 0; k < 6; k++) {
        const cairn_real left = (cairn_real)(k < 3 ? 48 : 96) * (cairn_real)DBL_EPSILON;
        const cairn_sym3 rest = {k % 3 == 0 ? left : 1, 0, 0,
                                 k % 3 == 1 ? left : 1, 0, k % 3 == 2 ? left : 1};
        const cairn_real minus[9] = {-1, 0, 0, 0, -1, 0, 0, 0, -1};

        assert_ok(f.begin(f.context, 2));
        assert_ok(f.add_link(f.context, 0, 1));
        assert_ok(f.analyze(f.context));
        assert_ok(run(&f));
        assert_ok(f.add_pose_block(f.context, 0, one));
        assert_ok(f.add_pose_block(f.context, 1, one));
        assert_ok(f.add_pose_block(f.context, 1, rest));
        assert_ok(f.add_link_block(f.context, 0, minus));
        assert_ok(f.factor(f.context));
        assert_ok(run(&f));
        assert_int_equal(f.read(f.context).state,
                         k < 3 ? CAIRN_BLOCK_SOLVER_NOT_POSITIVE : CAIRN_BLOCK_SOLVER_FACTORED);
    }
    cairn_sparse_solver_close(sparse);
}

/* Memory in use, and that exhaustion is reported. */
static void memory(void **state)
{
    const size_t numbers = 8 * sizeof(int) + 3 * sizeof(double),
                 entries = sizeof(int) + sizeof(double);
    cairn_sparse_solver *sparse;
    cairn_pose_graph_solver f;
    size_t empty;

    (void)state;
    if (!open_or_say_so(&sparse))
        return;
    f = cairn_sparse_solver_interface(sparse);
    empty = cairn_sparse_solver_memory(sparse);
    for (int32_t poses = 1; poses < 8; poses++) {
        size_t n = 3 * (size_t)poses;

        assert_ok(f.begin(f.context, poses));
        assert_ok(f.analyze(f.context));
        assert_ok(run(&f));
        assert_int_equal(f.read(f.context).fill, 0);
        assert_int_equal(cairn_sparse_solver_memory(sparse) - empty,
                         (n + 1) * numbers + (3 * n + 1) * entries + (n + 1) * entries);
    }
#ifndef __SANITIZE_ADDRESS__
    {
        struct rlimit all, little;

        assert_int_equal(getrlimit(RLIMIT_AS, &all), 0);
        little = all;
        little.rlim_cur = (rlim_t)1 << 28;
        assert_int_equal(setrlimit(RLIMIT_AS, &little), 0);
        assert_ok(f.begin(f.context, 1 << 23));
        assert_ok(f.analyze(f.context));
        assert_status(run(&f), CAIRN_NO_MEMORY);
        assert_int_equal(f.read(f.context).state, CAIRN_BLOCK_SOLVER_NEW);
        assert_int_equal(setrlimit(RLIMIT_AS, &all), 0);
    }
#endif
    assert_status(f.begin(f.context, INT32_MAX / 16 + 1), CAIRN_BAD_ARGUMENT);
    assert_ok(f.begin(f.context, INT32_MAX / 16));
    cairn_sparse_solver_close(sparse);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(same_solutions_and_covariances),
        cmocka_unit_test(same_poses),
        cmocka_unit_test(one_pose),
        cmocka_unit_test(small_pivots),
        cmocka_unit_test(memory),
        cmocka_unit_test(refusals),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
