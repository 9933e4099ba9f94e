/* Configurations of parts compared with all configurations of the nearest of all votes; modes;
 * empty input, coincident votes, very many. */
#include "tests/voting.h"

#include "src/parts/part_configuration_work.h"

enum { NEAREST = 64 };

static cairn_part_configuration_vote *vote(voting *v, int32_t bundle, double x, double y,
                                           double scale, double gain)
{
    cairn_part_configuration_vote *made = &v->votes[v->count];

    memset(made, 0, sizeof *made);
    made->bundle = bundle;
    made->chain = v->count++;
    made->centre.x = (cairn_real)x;
    made->centre.y = (cairn_real)y;
    made->scale = (cairn_real)scale;
    made->weight = (cairn_real)gain;
    made->to = 20;
    return made;
}

/* Some about a few places, the others anywhere; few chains, so that parts compete for them. */
static void vote_at_random(voting *v, int32_t count, int32_t bundles, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 4);

    for (int32_t i = 0; i < count; i++) {
        double x = (double)cairn_random_uniform(&random, -400, 400),
               y = (double)cairn_random_uniform(&random, 0, 300);
        double scale = exp((double)cairn_random_uniform(&random, 3, 6));
        double gain = (double)cairn_random_uniform(&random, CAIRN_REAL(0.1), 1);
        int32_t bundle = cairn_random_below(&random, bundles),
                place = cairn_random_below(&random, 5);
        cairn_part_configuration_vote *made;

        if (place < 3) {
            scale = 60 * (place + 1) * exp(0.15 * (double)cairn_random_normal(&random));
            x = 100 * place + 0.08 * scale * (double)cairn_random_normal(&random);
            y = 90 + 0.08 * scale * (double)cairn_random_normal(&random);
        }
        made = vote(v, bundle, x, y, scale, gain);
        made->chain = cairn_random_below(&random, 12);
        made->from = cairn_random_uniform(&random, 0, 60);
        made->to = made->from + cairn_random_uniform(&random, 5, 40);
        made->closed_length = made->chain % 3 == 0 ? 80 : 0;
    }
}

/* ---- Reference implementation: all votes sorted by distance, all configurations ---- */

typedef struct slow_search {
    const voting *v;
    int32_t near[NEAREST], count, bundles, chosen[NEAREST], parts, best_votes[NEAREST], best_parts;
    int32_t seed;
    double best;
} slow_search;

static void place_of(const voting *v, int32_t seed, int32_t i, double place[3])
{
    const cairn_part_configuration_vote *s = &v->votes[seed], *o = &v->votes[i];
    double size = (double)v->params.centre_tolerance * (double)s->scale;

    place[0] = ((double)o->centre.x - (double)s->centre.x) / size;
    place[1] = ((double)o->centre.y - (double)s->centre.y) / size;
    place[2] = log((double)o->scale / (double)s->scale) / (double)v->params.scale_tolerance;
}

static double squared_of(const voting *v, int32_t seed, int32_t i)
{
    double place[3];

    place_of(v, seed, i, place);
    return place[0] * place[0] + place[1] * place[1] + place[2] * place[2];
}

/* The K nearest within reach, one after the other. */
static void find_nearest(slow_search *s)
{
    const voting *v = s->v;
    int32_t used[VOTES] = {0};

    for (s->count = 0; s->count < v->params.nearest; s->count++) {
        double least = (double)v->params.search_radius * (double)v->params.search_radius;
        int32_t best = -1;

        for (int32_t i = 0; i < v->count; i++)
            if (!used[i] && (best < 0 ? squared_of(v, s->seed, i) <= least
                                      : squared_of(v, s->seed, i) < least)) {
                least = squared_of(v, s->seed, i);
                best = i;
            }
        if (best < 0)
            return;
        used[best] = 1;
        s->near[s->count] = best;
    }
}

static double slow_score(const slow_search *s)
{
    double mean[3] = {0, 0, 0}, gain = 0, scatter = 0, place[3];

    for (int32_t i = 0; i < s->parts; i++) {
        double g = (double)s->v->votes[s->chosen[i]].weight;

        place_of(s->v, s->seed, s->chosen[i], place);
        gain += g;
        for (int k = 0; k < 3; k++)
            mean[k] += g * place[k];
    }
    for (int32_t i = 0; i < s->parts; i++) {
        place_of(s->v, s->seed, s->chosen[i], place);
        for (int k = 0; k < 3; k++)
            scatter += (double)s->v->votes[s->chosen[i]].weight * pow(place[k] - mean[k] / gain, 2);
    }
    return gain - scatter / 2;
}

static int exclude_each_other(const voting *v, int32_t a, int32_t b)
{
    const cairn_part_configuration_vote *p = &v->votes[a], *q = &v->votes[b];
    double shorter = fmin((double)(p->to - p->from), (double)(q->to - q->from)), sum = 0;

    if (p->chain != q->chain)
        return 0;
    for (int k = p->closed_length > 0 ? -1 : 0; k <= (p->closed_length > 0); k++)
        sum += fmax(
            0, fmin((double)(p->to + (cairn_real)k * p->closed_length), (double)q->to) -
                   fmax((double)(p->from + (cairn_real)k * p->closed_length), (double)q->from));
    return sum > (double)v->params.overlap * shorter;
}

static void try_all(slow_search *s, int32_t bundle)
{
    if (bundle == s->bundles) {
        if (s->parts >= s->v->params.min_parts && slow_score(s) > s->best) {
            s->best = slow_score(s);
            s->best_parts = s->parts;
            memcpy(s->best_votes, s->chosen, sizeof s->chosen);
        }
        return;
    }
    try_all(s, bundle + 1);
    for (int32_t i = 0; i < s->count; i++) {
        int ok = s->v->votes[s->near[i]].bundle == bundle;

        for (int32_t k = 0; k < s->parts && ok; k++)
            ok = !exclude_each_other(s->v, s->near[i], s->chosen[k]);
        if (!ok)
            continue;
        s->chosen[s->parts++] = s->near[i];
        try_all(s, bundle + 1);
        s->parts--;
    }
}

static int has_vote(const cairn_part_configuration_result *r, int32_t k, int32_t vote)
{
    for (int32_t i = 0; i < r->found[k].count; i++)
        if (r->votes[r->found[k].first + i] == vote)
            return 1;
    return 0;
}

/* Every seed's best configuration is found, with its score, and nothing else. */
static void loses_nothing(void **state)
{
    static const int32_t nearest[] = {5, 20, 20, 12, 20, 20}, min_parts[] = {2, 2, 3, 1, 2, 2};
    int32_t configurations = 0;
    int64_t all = 0, visited = 0;

    (void)state;
    for (uint64_t round = 0; round < 6; round++) {
        cairn_part_configuration_params params = cairn_part_configuration_default();
        cairn_part_configuration_result r;
        int32_t confirmed = 0;
        voting v;

        params.max_votes = VOTES;
        params.max_found = VOTES;
        params.nearest = nearest[round];
        params.min_parts = min_parts[round];
        params.search_radius = round == 4 ? 4 : params.search_radius;
        params.centre_tolerance = round == 5 ? CAIRN_REAL(0.3) : params.centre_tolerance;
        start(&v, &params);
        vote_at_random(&v, round == 5 ? 90 : 160, 4, round);
        r = run(&v);
        assert_int_equal(r.seed_count, v.count);
        assert_int_equal(r.truncated_count, 0);
        for (int32_t seed = 0; seed < v.count; seed++) {
            slow_search s = {.v = &v, .seed = seed, .bundles = 4};
            int32_t at = -1;

            find_nearest(&s);
            try_all(&s, 0);
            if (s.best_parts == 0)
                continue;
            for (int32_t k = 0; k < r.count; k++) {
                int same = r.found[k].count == s.best_parts;

                for (int32_t i = 0; i < s.best_parts && same; i++)
                    same = has_vote(&r, k, s.best_votes[i]);
                at = same ? k : at;
            }
            assert_true(at >= 0);
            assert_true((double)r.found[at].score > s.best - NUMBER(1e-9, 1e-4));
            if (r.found[at].seed == seed) {
                confirmed++;
                assert_near(r.found[at].score, s.best, NUMBER(1e-9, 1e-4));
            }
        }
        assert_int_equal(confirmed, r.count);
        for (int32_t k = 1; k < r.count; k++)
            assert_true(r.found[k].score <= r.found[k - 1].score);
        configurations += r.count;
        visited += r.node_count;
        all += (int64_t)v.count * 1296;
        test_pool_free(&v.pool);
    }
    assert_in_range(configurations, 100, 10000);
    assert_true(visited < all / 4);
}

/* The mean of the votes, weighted by gain; votes of one bundle exclude each other, however well
 * they agree. */
static void says_where(void **state)
{
    cairn_part_configuration_params params = cairn_part_configuration_default();
    cairn_part_configuration_result r;
    voting v;

    (void)state;
    start(&v, &params);
    (void)vote(&v, 0, 100, 50, 200, 1);
    (void)vote(&v, 3, 104, 50, 200, 3);
    (void)vote(&v, 3, 103, 50, 200, 2);
    (void)vote(&v, 7, 400, 50, 200, 9);
    r = run(&v);
    assert_int_equal(r.count, 1);
    assert_int_equal(r.found[0].count, 2);
    assert_int_equal(r.votes[r.found[0].first], 0);
    assert_int_equal(r.votes[r.found[0].first + 1], 1);
    assert_near(r.found[0].centre.x, 103, NUMBER(1e-9, 1e-3));
    assert_near(r.found[0].centre.y, 50, NUMBER(1e-9, 1e-3));
    assert_near(r.found[0].scale, 200, NUMBER(1e-9, 1e-3));
    assert_near(r.found[0].weight_sum, 4, NUMBER(1e-9, 1e-5));
    assert_near(r.found[0].score, 4 - 0.75 * pow(4 / 16.0, 2) / 2, NUMBER(1e-9, 1e-5));
    /* An interval of a chain belongs to one part only; beside it on the chain there may be
     * another. */
    v.votes[1].chain = v.votes[0].chain;
    r = run(&v);
    assert_int_equal(r.found[0].count, 2);
    assert_int_equal(r.votes[r.found[0].first + 1], 2);
    v.votes[1].from = 17;
    v.votes[1].to = 40;
    r = run(&v);
    assert_int_equal(r.votes[r.found[0].first + 1], 1);
    v.votes[0].closed_length = v.votes[1].closed_length = 25;
    r = run(&v);
    assert_int_equal(r.votes[r.found[0].first + 1], 2);
    /* They meet at both ends, at neither for long. */
    v.votes[0].closed_length = v.votes[1].closed_length = 100;
    v.votes[0].from = 0;
    v.votes[0].to = 59;
    v.votes[1].from = 49;
    v.votes[1].to = 110;
    r = run(&v);
    assert_int_equal(r.votes[r.found[0].first + 1], 2);
    test_pool_free(&v.pool);
}

/* Each cluster has one mode; a configuration of each is found. */
static void climbs_to_modes(void **state)
{
    cairn_part_configuration_params params = cairn_part_configuration_default();
    cairn_part_configuration_result r;
    cairn_random random = cairn_random_seed(5, 5);
    voting v;

    (void)state;
    params.search = CAIRN_PART_SEARCH_MODES;
    start(&v, &params);
    for (int32_t i = 0; i < 36; i++)
        (void)vote(&v, i % 4, 100 * (i % 3) + 2 * (double)cairn_random_normal(&random), 80, 100, 1);
    r = run(&v);
    assert_int_equal(r.seed_count, 3);
    assert_int_equal(r.count, 3);
    for (int32_t k = 0; k < 3; k++) {
        assert_int_equal(r.found[k].count, 4);
        assert_near(r.found[k].centre.x, 100 * rint((double)r.found[k].centre.x / 100), 6);
    }
    test_pool_free(&v.pool);
}

/* ---- Empty input, and very much ---- */

static void finds_nothing(void **state)
{
    cairn_part_configuration_params params = cairn_part_configuration_default();
    cairn_part_configuration_result r;
    cairn_budget budget = {INT32_MAX};
    voting v;

    (void)state;
    start(&v, &params);
    assert_int_equal(run(&v).count, 0);
    assert_ok(cairn_part_configuration_begin(v.configurator, NULL, 0, NULL));
    assert_ok(cairn_part_configuration_step(v.configurator, &budget));
    assert_int_equal(cairn_part_configuration_read(v.configurator).seed_count, 0);
    (void)vote(&v, 0, 100, 50, 200, 1);
    (void)vote(&v, 0, 100, 50, 200, 1);
    (void)vote(&v, 1, 300, 50, 200, 1);
    r = run(&v);
    assert_int_equal(r.count, 0);
    assert_int_equal(r.seed_count, 3);
    test_pool_free(&v.pool);
}

/* All at one place, and the ends of the ranges. */
static void is_bounded(void **state)
{
    cairn_part_configuration_params params = cairn_part_configuration_default();
    cairn_part_configuration_result r;
    voting v;

    (void)state;
    params.nearest = 64;
    params.max_nodes = 100;
    start(&v, &params);
    for (int32_t i = 0; i < VOTES; i++)
        (void)vote(&v, i % 40, 7, 7, 50, 1 + i % 7);
    r = run(&v);
    assert_in_range(r.node_count, 1, 100 * VOTES);
    assert_int_equal(r.truncated_count, VOTES);
    assert_int_equal(r.seed_count, VOTES);
    assert_in_range(r.count, 1, params.max_found);
    v.count = 0;
    for (int32_t i = 0; i < 100; i++)
        (void)vote(&v, i % 4, i % 2 ? 1e6 : -1e6, i % 3 ? 1e6 : -1e6, i % 5 ? 1e-6 : 1e6, 1);
    r = run(&v);
    assert_int_equal(r.seed_count, 100);
    assert_true(r.pair_count <= 100 * 101);
    test_pool_free(&v.pool);
}

/* Few distances are computed between distant votes. */
/* All at one place, so in one bucket: no step examines more votes than it has units. */
static void equal_votes_are_examined_one_by_one(void **state)
{
    cairn_part_configuration_params params = cairn_part_configuration_default();
    cairn_status status = CAIRN_MORE;
    voting v;

    (void)state;
    start(&v, &params);
    for (int32_t i = 0; i < VOTES; i++)
        (void)vote(&v, i % 3, 100, 100, 100, 1);
    assert_ok(cairn_part_configuration_begin(v.configurator, v.votes, v.count, NULL));
    for (int32_t i = 0; i < 100000 && status == CAIRN_MORE; i++) {
        cairn_budget budget = {20};
        int64_t before = v.configurator->pair_count;

        status = cairn_part_configuration_step(v.configurator, &budget);
        assert_in_range(v.configurator->pair_count - before, 0, 20 + 16);
    }
    assert_ok(status);
    test_pool_free(&v.pool);
}

static void searches_the_neighbourhood_only(void **state)
{
    cairn_part_configuration_params params = cairn_part_configuration_default();
    cairn_random random = cairn_random_seed(1, 1);
    voting v;

    (void)state;
    start(&v, &params);
    for (int32_t i = 0; i < VOTES; i++)
        (void)vote(&v, i % 4, (double)cairn_random_uniform(&random, 0, 2000),
                   (double)cairn_random_uniform(&random, 0, 2000), 50, 1);
    assert_true(run(&v).pair_count < VOTES * VOTES / 40);
    test_pool_free(&v.pool);
}

/* ---- Budgets ---- */

static void does_not_depend_on_budgets(void **state)
{

    (void)state;
    for (int seek = 0; seek < 2; seek++) {
        cairn_part_configuration_params params = cairn_part_configuration_default();
        voting v;

        params.search = seek;
        start(&v, &params);
        vote_at_random(&v, 100, 4, 9);
        assert_any_budget(&v);
        test_pool_free(&v.pool);
    }
}

/* ---- Refusals ---- */

/* tests/test_object.c has the ranges. */
static void fits_its_pool(void **state)
{
    cairn_part_configuration_params good = cairn_part_configuration_default();
    cairn_pool pool = test_pool(1 << 20);

    (void)state;
    assert_status(cairn_part_configuration_create(NULL, &pool, &good), CAIRN_BAD_ARGUMENT);
    good.max_votes = 5;
    good.max_found = 2;
    test_every_pool_size(create, &good, cairn_part_configuration_memory(&good));
    test_pool_free(&pool);
}

static void refuses_bad_votes(void **state)
{
    cairn_part_configuration_params params = cairn_part_configuration_default();
    cairn_budget budget = {INT32_MAX};
    cairn_fault fault;
    voting v;

    (void)state;
    params.max_votes = 14;
    start(&v, &params);
    for (int32_t i = 0; i < 15; i++)
        (void)vote(&v, i % 4, 10, 10, 50, 1);
    assert_fault(&fault, cairn_part_configuration_begin(NULL, v.votes, 1, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    assert_fault(&fault, cairn_part_configuration_begin(v.configurator, NULL, 1, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    assert_fault(&fault, cairn_part_configuration_begin(v.configurator, v.votes, -1, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    assert_fault(&fault, cairn_part_configuration_begin(v.configurator, v.votes, 15, &fault),
                 CAIRN_FULL, -1);
    v.votes[0].bundle = -1;
    v.votes[1].centre.x = (cairn_real)NAN;
    v.votes[2].centre.y = 2000000;
    v.votes[3].scale = 0;
    v.votes[4].scale = (cairn_real)INFINITY;
    v.votes[5].weight = 0;
    v.votes[6].weight = (cairn_real)NAN;
    v.votes[7].weight = 2000000;
    v.votes[8].to = -1;
    v.votes[9].closed_length = -1;
    v.votes[10].from = (cairn_real)NAN;
    v.votes[11].to = (cairn_real)INFINITY;
    v.votes[12].closed_length = (cairn_real)NAN;
    for (int32_t i = 0; i < 13; i++) {
        cairn_part_configuration_vote two[2] = {v.votes[13], v.votes[i]};
        int32_t is_finite = i != 1 && i != 4 && i != 6 && i < 10;

        assert_fault(&fault, cairn_part_configuration_begin(v.configurator, two, 2, &fault),
                     is_finite ? CAIRN_BAD_ARGUMENT : CAIRN_NOT_FINITE, 1);
        assert_fault(&fault, cairn_part_configuration_begin(v.configurator, two + 1, 1, &fault),
                     is_finite ? CAIRN_BAD_ARGUMENT : CAIRN_NOT_FINITE, 0);
    }
    assert_status(cairn_part_configuration_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_part_configuration_step(v.configurator, NULL), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_part_configuration_step(v.configurator, &budget));
    assert_null(cairn_part_configuration_read(v.configurator).found);
    assert_null(cairn_part_configuration_read(NULL).found);
    v.votes[13].to = v.votes[13].from;
    assert_ok(cairn_part_configuration_begin(v.configurator, &v.votes[13], 1, &fault));
    test_pool_free(&v.pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(loses_nothing),
        cmocka_unit_test(says_where),
        cmocka_unit_test(climbs_to_modes),
        cmocka_unit_test(finds_nothing),
        cmocka_unit_test(is_bounded),
        cmocka_unit_test(searches_the_neighbourhood_only),
        cmocka_unit_test(does_not_depend_on_budgets),
        cmocka_unit_test(equal_votes_are_examined_one_by_one),
        cmocka_unit_test(fits_its_pool),
        cmocka_unit_test(refuses_bad_votes),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
