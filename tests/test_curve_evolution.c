/* Discrete curve evolution compared with a reference implementation; curves that would cross
 * themselves. */
#include "tests/test.h"

#include <math.h>

#include "cairn/curve_evolution.h"

enum { ITEM_COUNT = 80 };

static cairn_vec2 at(double x, double y)
{
    cairn_vec2 v = {(cairn_real)x, (cairn_real)y};

    return v;
}

typedef struct evolving {
    cairn_pool pool;
    cairn_curve_evolution *evolution;
} evolving;

static evolving new_evolving_in(int32_t points, int32_t mode)
{
    cairn_curve_evolution_params params = {.max_points = points, .mode = mode};
    evolving e;

    e.pool = test_pool(cairn_curve_evolution_memory(&params));
    assert_ok(cairn_curve_evolution_create(&e.evolution, &e.pool, &params));
    return e;
}

static evolving new_evolving(int32_t points)
{
    return new_evolving_in(points, CAIRN_MODE_DEFAULT);
}

static cairn_curve_evolution_result evolve(evolving *e, const cairn_vec2 *points, int32_t count)
{
    cairn_budget budget = {INT32_MAX};

    assert_ok(cairn_curve_evolution_begin(e->evolution, points, count));
    assert_ok(cairn_curve_evolution_step(e->evolution, &budget));
    return cairn_curve_evolution_read(e->evolution);
}

/* ---- Reference implementation: everything anew for each removal ---- */

/* 1 when no two sides of the polygon share a point, except neighbours their vertex. */
static int is_simple(const cairn_vec2 *p, int32_t n)
{
    for (int32_t i = 0; i < n; i++)
        for (int32_t k = i + 1; k < n; k++) {
            cairn_segment a = {p[i], p[(i + 1) % n]}, b = {p[k], p[(k + 1) % n]};

            if (k != i + 1 && (k + 1) % n != i) {
                if (cairn_segments_intersect(a, b))
                    return 0;
            } else if (n > 3) {
                cairn_vec2 shared = k == i + 1 ? p[k] : p[i], from = k == i + 1 ? a.a : a.b,
                           to = k == i + 1 ? b.b : b.a;
                cairn_vec2 u = cairn_vec2_sub(from, shared), v = cairn_vec2_sub(to, shared);

                if (cairn_vec2_cross(u, v) == 0 && cairn_vec2_dot(u, v) > 0)
                    return 0;
            }
        }
    return 1;
}

static int32_t slow_evolution(const cairn_vec2 *points, int32_t count, int32_t mode, int32_t *rank)
{
    int32_t left[ITEM_COUNT], n = count;

    for (int32_t i = 0; i < count; i++)
        left[i] = i;
    while (n > 3) {
        int refused[ITEM_COUNT] = {0};
        int32_t best;

        for (;;) {
            cairn_vec2 rest[ITEM_COUNT];
            cairn_real least = 0;
            int32_t m = 0;

            best = -1;
            for (int32_t k = 0; k < n; k++) {
                cairn_real relevance = cairn_curve_evolution_relevance(
                    points[left[(k + n - 1) % n]], points[left[k]], points[left[(k + 1) % n]]);

                if (!refused[k] && (best < 0 || relevance < least)) {
                    best = k;
                    least = relevance;
                }
            }
            if (best < 0)
                break;
            for (int32_t k = 0; k < n; k++)
                if (k != best)
                    rest[m++] = points[left[k]];
            if (mode == CAIRN_MODE_AS_WRITTEN || is_simple(rest, m))
                break;
            refused[best] = 1;
        }
        if (best < 0)
            break;
        rank[left[best]] = --n;
        for (int32_t k = best; k < n; k++)
            left[k] = left[k + 1];
    }
    for (int32_t k = 0; k < n; k++)
        rank[left[k]] = k;
    return n;
}

static void assert_as_slow_in(evolving *e, const cairn_vec2 *points, int32_t count, int32_t mode)
{
    cairn_curve_evolution_result r = evolve(e, points, count);
    int32_t rank[ITEM_COUNT], least = slow_evolution(points, count, mode, rank);

    assert_int_equal(r.count, count);
    assert_int_equal(r.min_vertices, least);
    for (int32_t i = 0; i < count; i++)
        assert_int_equal(r.rank[i], rank[i]);
}

static void assert_as_slow(evolving *e, const cairn_vec2 *points, int32_t count)
{
    assert_as_slow_in(e, points, count, CAIRN_MODE_DEFAULT);
}

/* A star-shaped polygon: spikes of all lengths. */
static void star(cairn_vec2 *p, int32_t count, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 0);

    for (int32_t i = 0; i < count; i++) {
        double turn = 2 * 3.14159265358979 * i / count,
               r = (double)cairn_random_uniform(&random, 2, 20);

        p[i] = at(r * cos(turn), r * sin(turn));
    }
}

/* A spiral band, half its vertices on either side. */
static void spiral(cairn_vec2 *p, int32_t count)
{
    int32_t half = count / 2;

    for (int32_t i = 0; i < half; i++) {
        double turn = 12.0 * i / half;

        p[i] = at((3 + turn) * cos(turn), (3 + turn) * sin(turn));
        p[count - 1 - i] = at((5 + turn) * cos(turn), (5 + turn) * sin(turn));
    }
}

static void evolves_as_the_reference(void **state)
{
    evolving e = new_evolving(ITEM_COUNT);
    cairn_vec2 p[ITEM_COUNT];

    (void)state;
    for (uint64_t seed = 0; seed < 30; seed++) {
        int32_t count = 3 + (int32_t)(seed * 5 / 2);

        star(p, count, seed);
        assert_as_slow(&e, p, count);
    }
    spiral(p, ITEM_COUNT);
    assert_as_slow(&e, p, ITEM_COUNT);
    test_pool_free(&e.pool);
}

/* The least relevant vertex is always removed, down to a triangle, also where the curve then
 * crosses itself. */
static void as_written_nothing_is_refused(void **state)
{
    evolving e = new_evolving_in(ITEM_COUNT, cairn_curve_evolution_as_written().mode);
    evolving checked = new_evolving(ITEM_COUNT);
    cairn_curve_evolution_result r, other;
    cairn_vec2 p[ITEM_COUNT];
    int32_t differ = 0;

    (void)state;
    for (uint64_t seed = 0; seed < 30; seed++) {
        int32_t count = 3 + (int32_t)(seed * 5 / 2);

        star(p, count, seed);
        assert_as_slow_in(&e, p, count, CAIRN_MODE_AS_WRITTEN);
        assert_int_equal(cairn_curve_evolution_read(e.evolution).min_vertices, 3);
    }
    spiral(p, ITEM_COUNT);
    assert_as_slow_in(&e, p, ITEM_COUNT, CAIRN_MODE_AS_WRITTEN);
    r = cairn_curve_evolution_read(e.evolution);
    other = evolve(&checked, p, ITEM_COUNT);
    for (int32_t i = 0; i < ITEM_COUNT; i++)
        differ += r.rank[i] != other.rank[i];
    assert_true(differ > 0);
    test_pool_free(&e.pool);
    test_pool_free(&checked.pool);
}

/* On pixels: many vertices have equal relevance, and many are collinear. */
static void equals_go_in_their_order(void **state)
{
    evolving e = new_evolving(ITEM_COUNT);
    cairn_curve_evolution_result r;
    cairn_vec2 p[ITEM_COUNT];

    (void)state;
    for (int32_t i = 0; i < 40; i++)
        p[i] = at(i < 10   ? i
                  : i < 20 ? 10
                  : i < 30 ? 30 - i
                           : 0,
                  i < 10   ? 0
                  : i < 20 ? i - 10
                  : i < 30 ? 10
                           : 40 - i);
    assert_as_slow(&e, p, 40);
    r = evolve(&e, p, 40);
    assert_int_equal(r.rank[1], 39);
    assert_int_equal(r.rank[2], 38);
    for (int32_t i = 0; i < 40; i += 10)
        assert_true(r.rank[i] < 4);
    test_pool_free(&e.pool);
}

/* The narrow tooth is removed after its neighbours: without its tip the side would cut through the
 * part that reaches into it. */
static void never_touches_itself(void **state)
{
    evolving e = new_evolving(ITEM_COUNT);
    cairn_vec2 p[ITEM_COUNT];

    (void)state;
    for (uint64_t seed = 40; seed < 60; seed++) {
        cairn_curve_evolution_result r;

        spiral(p, 40 + (int32_t)(seed % 7) * 2);
        star(p, (int32_t)(seed % 3) * 2, seed);
        if (!is_simple(p, 40 + (int32_t)(seed % 7) * 2))
            continue;
        r = evolve(&e, p, 40 + (int32_t)(seed % 7) * 2);
        for (int32_t m = r.min_vertices; m <= r.count; m++) {
            cairn_vec2 level[ITEM_COUNT];
            int32_t n = 0;

            for (int32_t i = 0; i < r.count; i++)
                if (r.rank[i] < m)
                    level[n++] = p[i];
            assert_int_equal(n, m);
            assert_true(is_simple(level, n));
        }
    }
    test_pool_free(&e.pool);
}

/* A side of it runs back over another: nothing can be removed. */
static void initial_contacts_may_stay(void **state)
{
    evolving e = new_evolving(8);
    cairn_vec2 flat[4] = {at(0, 0), at(4, 0), at(1, 0), at(3, 0)};

    (void)state;
    assert_int_equal(evolve(&e, flat, 4).min_vertices, 4);
    assert_int_equal(cairn_curve_evolution_read(e.evolution).rank[3], 3);
    test_pool_free(&e.pool);
}

static void relevance_is_that_of_the_thesis(void **state)
{
    (void)state;
    assert_near(cairn_curve_evolution_relevance(at(0, 0), at(3, 0), at(3, 6)),
                1.5707963267948966 * 2, NUMBER(1e-12, 1e-5));
    assert_near(cairn_curve_evolution_relevance(at(0, 0), at(3, 0), at(9, 0)), 0, 0);
    assert_near(cairn_curve_evolution_relevance(at(0, 0), at(4, 0), at(2, 0)),
                3.141592653589793 * 4 / 3, NUMBER(1e-12, 1e-5));
    assert_near(cairn_curve_evolution_relevance(at(3, 6), at(3, 0), at(0, 0)),
                1.5707963267948966 * 2, NUMBER(1e-12, 1e-5));
    assert_near(cairn_curve_evolution_relevance(at(2, 2), at(2, 2), at(2, 2)), 0, 0);
    assert_near(cairn_curve_evolution_relevance(at(2, 2), at(2, 2), at(5, 2)), 0, 0);
}

static void a_triangle_stays(void **state)
{
    evolving e = new_evolving(3);
    cairn_vec2 p[3] = {at(0, 0), at(5, 0), at(0, 5)};
    cairn_curve_evolution_result r = evolve(&e, p, 3);

    (void)state;
    assert_int_equal(r.min_vertices, 3);
    for (int32_t i = 0; i < 3; i++)
        assert_int_equal(r.rank[i], i);
    test_pool_free(&e.pool);
}

static uint64_t hash_of(void *context)
{
    cairn_curve_evolution_result r = cairn_curve_evolution_read(((evolving *)context)->evolution);

    return test_hash(TEST_HASH_START, r.rank, (size_t)r.count * sizeof *r.rank);
}

static cairn_status begin_star(void *context)
{
    cairn_vec2 p[ITEM_COUNT];

    star(p, ITEM_COUNT, 7);
    return cairn_curve_evolution_begin(((evolving *)context)->evolution, p, ITEM_COUNT);
}

static cairn_status step(void *context, cairn_budget *budget)
{
    return cairn_curve_evolution_step(((evolving *)context)->evolution, budget);
}

static void budgets_do_not_matter(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    evolving e = new_evolving(ITEM_COUNT);
    test_stepped object = {begin_star, step, hash_of, &e};
    cairn_budget all = {INT32_MAX}, none = {0};
    uint64_t hash;

    (void)state;
    assert_ok(begin_star(&e));
    assert_status(step(&e, &none), CAIRN_MORE);
    assert_int_equal(cairn_curve_evolution_read(e.evolution).count, 0);
    assert_ok(step(&e, &all));
    hash = hash_of(&e);
    for (int i = 0; i < 3; i++) {
        int64_t used = 0;
        cairn_status status;

        assert_ok(begin_star(&e));
        do {
            cairn_budget budget = {budgets[i]};

            status = step(&e, &budget);
            used += budgets[i] - budget.left;
        } while (status == CAIRN_MORE);
        assert_ok(status);
        assert_int_equal(used, INT32_MAX - all.left);
        assert_true(hash_of(&e) == hash);
    }
    test_begins_anew(&object, 5);
    test_pool_free(&e.pool);
}

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_curve_evolution *evolution;

    return cairn_curve_evolution_create(&evolution, pool, context);
}

static void refusals(void **state)
{
    cairn_curve_evolution_params good = {.max_points = 8}, large = {.max_points = 4096};
    evolving e = new_evolving(8);
    cairn_budget budget = {10};
    cairn_vec2 p[9];
    uint64_t hash;

    (void)state;
    star(p, 9, 1);
    assert_status(step(&e, &budget), CAIRN_OK);
    (void)evolve(&e, p, 8);
    hash = hash_of(&e);
    assert_status(cairn_curve_evolution_begin(NULL, p, 8), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_curve_evolution_begin(e.evolution, NULL, 8), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_curve_evolution_begin(e.evolution, p, 2), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_curve_evolution_begin(e.evolution, p, 9), CAIRN_FULL);
    p[3].x = (cairn_real)NAN;
    assert_status(cairn_curve_evolution_begin(e.evolution, p, 8), CAIRN_NOT_FINITE);
    p[3].x = 0;
    p[7].y = (cairn_real)INFINITY;
    assert_status(cairn_curve_evolution_begin(e.evolution, p, 8), CAIRN_NOT_FINITE);
    assert_true(hash_of(&e) == hash);
    assert_status(cairn_curve_evolution_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_curve_evolution_step(e.evolution, NULL), CAIRN_BAD_ARGUMENT);
    assert_int_equal(cairn_curve_evolution_read(NULL).count, 0);
    assert_status(cairn_curve_evolution_create(&e.evolution, NULL, &good), CAIRN_BAD_ARGUMENT);
    assert_true(cairn_curve_evolution_memory(&large) > 0);
    test_every_pool_size(create, &good, cairn_curve_evolution_memory(&good));
    test_pool_free(&e.pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(evolves_as_the_reference),
        cmocka_unit_test(as_written_nothing_is_refused),
        cmocka_unit_test(equals_go_in_their_order),
        cmocka_unit_test(never_touches_itself),
        cmocka_unit_test(initial_contacts_may_stay),
        cmocka_unit_test(relevance_is_that_of_the_thesis),
        cmocka_unit_test(a_triangle_stays),
        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(refusals),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
