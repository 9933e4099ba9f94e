/* Configurations as written, compared with all subsets of the nearest of all votes. */
#include "tests/voting.h"

#include <stdlib.h>

enum { MAX_COUNT = 60, SETS = 200000 };

static cairn_part_configuration_params written(int32_t votes)
{
    cairn_part_configuration_params params = cairn_part_configuration_as_written();

    params.max_votes = votes;
    return params;
}

/* Integer centres, so that some are equally near; scales, intervals and rounds, which must not
 * matter; few chains. */
static void vote_at_random(voting *v, int32_t count, int32_t bundles, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 4);

    for (v->count = 0; v->count < count; v->count++) {
        cairn_part_configuration_vote *made = &v->votes[v->count];

        memset(made, 0, sizeof *made);
        made->bundle = cairn_random_below(&random, bundles);
        made->chain = cairn_random_below(&random, 9);
        made->centre.x = (cairn_real)cairn_random_below(&random, 12);
        made->centre.y = (cairn_real)cairn_random_below(&random, 12);
        made->scale = cairn_random_uniform(&random, 1, 500);
        made->weight = (cairn_real)(1 + cairn_random_below(&random, 64)) / 64;
        made->from = cairn_random_uniform(&random, 0, 60);
        made->to = made->from + cairn_random_uniform(&random, 0, 40);
        made->closed_length = made->chain % 2 == 0 ? 80 : 0;
    }
}

/* ---- Reference implementation ---- */

typedef struct slow_search {
    const voting *v;
    int32_t near[64], count, bundles;
    uint64_t *sets; /* of votes, each once */
    double *sums;
    int32_t set_count;
    int32_t seed;
} slow_search;

static double apart(const voting *v, int32_t a, int32_t b)
{
    return hypot((double)v->votes[a].centre.x - (double)v->votes[b].centre.x,
                 (double)v->votes[a].centre.y - (double)v->votes[b].centre.y);
}

static void find_nearest(slow_search *s)
{
    uint64_t used = 0;

    for (s->count = 0; s->count < s->v->params.nearest && s->count < s->v->count; s->count++) {
        int32_t best = -1;

        for (int32_t i = 0; i < s->v->count; i++)
            if (!(used >> i & 1) &&
                (best < 0 || apart(s->v, s->seed, i) < apart(s->v, s->seed, best)))
                best = i;
        used |= UINT64_C(1) << best;
        s->near[s->count] = best;
    }
}

static void try_all(slow_search *s, int32_t bundle, uint64_t set, uint64_t chains, int32_t parts,
                    double sum)
{
    const voting *v = s->v;

    if (bundle < s->bundles) {
        try_all(s, bundle + 1, set, chains, parts, sum);
        for (int32_t i = 0; i < s->count; i++) {
            const cairn_part_configuration_vote *vote = &v->votes[s->near[i]];

            if (vote->bundle == bundle && !(chains >> vote->chain & 1))
                try_all(s, bundle + 1, set | UINT64_C(1) << s->near[i],
                        chains | UINT64_C(1) << vote->chain, parts + 1, sum + (double)vote->weight);
        }
        return;
    }
    if (parts < v->params.min_parts || sum < (double)v->params.min_sum)
        return;
    for (int32_t i = 0; i < s->set_count; i++)
        if (s->sets[i] == set)
            return;
    assert_true(s->set_count < SETS);
    s->sums[s->set_count] = sum;
    s->sets[s->set_count++] = set;
}

static uint64_t set_of(const cairn_part_configuration_result *r, int32_t k)
{
    uint64_t set = 0;

    for (int32_t i = 0; i < r->found[k].count; i++)
        set |= UINT64_C(1) << r->votes[r->found[k].first + i];
    return set;
}

static int greater_first(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;

    return x < y ? 1 : x > y ? -1 : 0;
}

/* All of them, each once, by their sums; beyond max_found the greatest sums. */
static void makes_every_configuration(void **state)
{
    static const int32_t nearest[] = {20, 8, 20, 12, 5, 64}, bundles[] = {4, 3, 1, 5, 4, 2};
    static const double sums[] = {2.25, 0, 0, 1.5, 0.5, 1}, fewer[] = {100, 5, 1, 37, 64, 9};
    uint64_t *sets = malloc(SETS * sizeof *sets);
    double *found = malloc(SETS * sizeof *found);
    int64_t all = 0;

    (void)state;
    for (uint64_t round = 0; round < 6; round++) {
        cairn_part_configuration_params params = written(MAX_COUNT);
        slow_search s = {.bundles = bundles[round], .sets = sets, .sums = found};
        cairn_part_configuration_result r;
        voting v;

        params.nearest = nearest[round];
        params.min_sum = (cairn_real)sums[round];
        params.min_parts = round == 3 ? 2 : 1;
        params.max_found = 1 << 14;
        start(&v, &params);
        vote_at_random(&v, round == 5 ? 50 : 40, bundles[round], round);
        s.v = &v;
        for (s.seed = 0; s.seed < v.count; s.seed++) {
            find_nearest(&s);
            try_all(&s, 0, 0, 0, 0, 0);
        }
        r = run(&v);
        assert_true(s.set_count > 20);
        assert_int_equal(r.count, s.set_count);
        assert_int_equal(r.enumerated_count, s.set_count);
        assert_int_equal(r.truncated_count, 0);
        assert_int_equal(r.seed_count, v.count);
        for (int32_t k = 0; k < r.count; k++) {
            int32_t i = 0;

            while (i < s.set_count && sets[i] != set_of(&r, k))
                i++;
            assert_true(i < s.set_count);
            sets[i] = 0;
            assert_near(r.found[k].score, found[i], 1e-5);
            assert_true(k == 0 || r.found[k].score <= r.found[k - 1].score);
        }
        all += r.count;
        test_pool_free(&v.pool);
        /* Sums are of sixty-fourths: exact. */
        qsort(found, (size_t)s.set_count, sizeof *found, greater_first);
        params.max_found = (int32_t)fewer[round];
        start(&v, &params);
        vote_at_random(&v, round == 5 ? 50 : 40, bundles[round], round);
        r = run(&v);
        assert_int_equal(r.enumerated_count, s.set_count);
        assert_int_equal(r.count, s.set_count < params.max_found ? s.set_count : params.max_found);
        for (int32_t k = 0; k < r.count; k++)
            assert_true((double)r.found[k].score == found[k]);
        test_pool_free(&v.pool);
    }
    assert_true(all > 1000);
    free(sets);
    free(found);
}

/* Near and distant votes of any scale are combined when they are among the K nearest; a chain only
 * once. */
static void has_no_other_gates(void **state)
{
    cairn_part_configuration_params params = written(MAX_COUNT);
    cairn_part_configuration_result r;
    voting v;

    (void)state;
    params.min_sum = 3;
    start(&v, &params);
    memset(v.votes, 0, sizeof v.votes);
    v.count = 3;
    for (int32_t i = 0; i < 3; i++) {
        v.votes[i] = (cairn_part_configuration_vote){
            i, i, {(cairn_real)(5000 * i), 0}, i == 1 ? 1 : 900, 1, 0, 20, 0};
        v.votes[i].weight = 1;
    }
    r = run(&v);
    assert_int_equal(r.count, 1);
    assert_int_equal(r.found[0].count, 3);
    assert_int_equal(r.found[0].seed, 0);
    v.votes[2].chain = 1;
    v.votes[2].from = 100;
    v.votes[2].to = 120;
    assert_int_equal(run(&v).count, 0);
    test_pool_free(&v.pool);
}

/* Fewer votes than K, one vote, none; very many configurations end by max_nodes, which is
 * reported. */
static void is_bounded(void **state)
{
    cairn_part_configuration_params params = written(MAX_COUNT);
    cairn_part_configuration_result r;
    voting v;

    (void)state;
    start(&v, &params);
    v.count = 0;
    assert_int_equal(run(&v).count, 0);
    vote_at_random(&v, 1, 1, 1);
    r = run(&v);
    assert_int_equal(r.count, 1);
    assert_int_equal(r.found[0].count, 1);
    vote_at_random(&v, 2, 1, 1);
    assert_int_equal(run(&v).count, 2);
    test_pool_free(&v.pool);
    params.nearest = 64;
    params.max_nodes = 1000;
    params.max_found = 16;
    start(&v, &params);
    vote_at_random(&v, MAX_COUNT, 30, 3);
    r = run(&v);
    assert_int_equal(r.truncated_count, MAX_COUNT);
    assert_int_equal(r.node_count, 1000 * MAX_COUNT);
    assert_int_equal(r.count, 16);
    test_pool_free(&v.pool);
}

/* ---- Budgets and refusals ---- */

static void does_not_depend_on_budgets(void **state)
{
    cairn_part_configuration_params params = written(MAX_COUNT);
    voting v;

    (void)state;
    params.nearest = 12;
    params.max_found = 100;
    start(&v, &params);
    vote_at_random(&v, 30, 4, 9);
    assert_any_budget(&v);
    assert_int_equal(cairn_part_configuration_read(v.configurator).count, 100);
    test_pool_free(&v.pool);
}

/* The params must be refused by a rule between parameters. */
static void assert_refused(const cairn_part_configuration_params *params, const char *rule)
{
    cairn_object_fault fault = {.module = NULL};

    assert_status(cairn_part_configuration_check(params, &fault), CAIRN_BAD_ARGUMENT);
    assert_string_equal(fault.rule, rule);
    assert_int_equal(cairn_part_configuration_memory(params), 0);
}

/* Rules between parameters; tests/test_object.c has the ranges. */
static void refuses_bad_params(void **state)
{
    cairn_part_configuration_params good = written(MAX_COUNT), bad = good;

    (void)state;
    bad.max_votes = 8193;
    assert_refused(&bad, "max_votes: at most 8192 as written");
    bad = good;
    bad.search = CAIRN_PART_SEARCH_MODES;
    assert_refused(&bad, "search: CAIRN_PART_SEARCH_NEAREST as written");
    good.max_votes = 40;
    good.max_found = 2;
    test_every_pool_size(create, &good, cairn_part_configuration_memory(&good));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(makes_every_configuration),
        cmocka_unit_test(has_no_other_gates),
        cmocka_unit_test(is_bounded),
        cmocka_unit_test(does_not_depend_on_budgets),
        cmocka_unit_test(refuses_bad_params),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
