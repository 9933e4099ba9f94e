/* Sequence alignment compared with whole tables; equal paths, units, refusals. */
#include "tests/test.h"

#include <math.h>

#include "cairn/sequence.h"

enum { MAX_COUNT = 40 };

/* Numbers to compare, and the comparison. */
struct sequences {
    double first[MAX_COUNT], second[MAX_COUNT];
    int32_t first_count, second_count;
    cairn_sequence_kind kind;
    int64_t *comparisons;
};

static double compared(const struct sequences *s, int32_t i, int32_t j)
{
    double d = fabs(s->first[i] - s->second[j]);

    return s->kind == CAIRN_SEQUENCE_LCS ? d < 0.5 : s->kind == CAIRN_SEQUENCE_LOCAL ? 1.5 - d : d;
}

static cairn_real compare(const void *context, int32_t i, int32_t j)
{
    const struct sequences *s = context;

    assert_true(i >= 0 && i < s->first_count && j >= 0 && j < s->second_count);
    if (s->comparisons != NULL)
        (*s->comparisons)++;
    return (cairn_real)compared(s, i, j);
}

/* The score by the whole table. */
static double reference(const struct sequences *s, double gap)
{
    static double table[MAX_COUNT + 1][MAX_COUNT + 1];
    double best = 0;

    for (int32_t i = 0; i <= s->first_count; i++)
        for (int32_t j = 0; j <= s->second_count; j++) {
            double *t = &table[i][j];

            *t = s->kind == CAIRN_SEQUENCE_DTW && i + j > 0 ? 1e9 : 0;
            if (i == 0 || j == 0)
                continue;
            if (s->kind == CAIRN_SEQUENCE_LCS)
                *t = fmax(fmax(table[i - 1][j], table[i][j - 1]),
                          table[i - 1][j - 1] + compared(s, i - 1, j - 1));
            else if (s->kind == CAIRN_SEQUENCE_LOCAL)
                *t = fmax(fmax(0, table[i - 1][j - 1] + compared(s, i - 1, j - 1)),
                          fmax(table[i - 1][j], table[i][j - 1]) - gap);
            else
                *t = compared(s, i - 1, j - 1) +
                     fmin(fmin(table[i - 1][j], table[i][j - 1]), table[i - 1][j - 1]);
            best = fmax(best, *t);
        }
    return s->kind == CAIRN_SEQUENCE_LOCAL ? best : table[s->first_count][s->second_count];
}

/* The score of the pairs, which must be in order and of the kind's form. */
static double score_of(const struct sequences *s, const cairn_sequence_result *result, double gap)
{
    double score = 0;

    for (int32_t k = 0; k < result->count; k++) {
        const cairn_sequence_pair *p = &result->pairs[k];
        double value = compared(s, p->first, p->second);
        int32_t di = k > 0 ? p->first - p[-1].first : 1, dj = k > 0 ? p->second - p[-1].second : 1;

        score += value;
        if (s->kind == CAIRN_SEQUENCE_DTW) {
            assert_true((di == 0 || di == 1) && (dj == 0 || dj == 1) && di + dj > 0);
            continue;
        }
        assert_true(di > 0 && dj > 0);
        if (s->kind == CAIRN_SEQUENCE_LCS)
            assert_true(value > 0);
        else
            score -= gap * (di - 1 + dj - 1);
    }
    if (s->kind == CAIRN_SEQUENCE_DTW) {
        assert_int_equal(result->pairs[0].first, 0);
        assert_int_equal(result->pairs[0].second, 0);
        assert_int_equal(result->pairs[result->count - 1].first, s->first_count - 1);
        assert_int_equal(result->pairs[result->count - 1].second, s->second_count - 1);
    }
    return score;
}

static void draw(struct sequences *s, cairn_random *random, int32_t most)
{
    s->first_count = 1 + cairn_random_below(random, most);
    s->second_count = 1 + cairn_random_below(random, most);
    for (int32_t i = 0; i < MAX_COUNT; i++) {
        int32_t a = cairn_random_below(random, 5), b = cairn_random_below(random, 5);
        double noise = (double)cairn_random_uniform(random, 0, CAIRN_REAL(0.3));

        s->first[i] = a;
        s->second[i] = b + noise;
    }
}

static cairn_sequence *make(cairn_pool *pool, cairn_sequence_params params)
{
    cairn_sequence *sequence;

    *pool = test_pool(cairn_sequence_memory(&params));
    assert_ok(cairn_sequence_create(&sequence, pool, &params));
    return sequence;
}

static void gives_the_score_and_the_path_of_the_whole_table(void **state)
{
    cairn_random random = cairn_random_seed(1, 1);

    (void)state;
    for (cairn_sequence_kind kind = CAIRN_SEQUENCE_LCS; kind <= CAIRN_SEQUENCE_DTW; kind++)
        for (int trial = 0; trial < 300; trial++) {
            cairn_sequence_params params = {.kind = kind,
                                            .max_first = MAX_COUNT,
                                            .max_second = MAX_COUNT,
                                            .gap_cost = trial % 3 == 0 ? 0 : CAIRN_REAL(0.75)};
            cairn_budget budget = {CAIRN_UNBOUNDED};
            int64_t comparisons = 0;
            cairn_sequence_result result;
            struct sequences s;
            cairn_pool pool;
            cairn_sequence *sequence = make(&pool, params);
            double expected;

            s.kind = kind;
            s.comparisons = &comparisons;
            draw(&s, &random, trial < 60 ? 3 : MAX_COUNT);
            expected = reference(&s, (double)params.gap_cost);
            assert_ok(cairn_sequence_begin(sequence, s.first_count, s.second_count, compare, &s));
            assert_int_equal(cairn_sequence_read(sequence).count, 0);
            assert_ok(cairn_sequence_step(sequence, &budget));
            result = cairn_sequence_read(sequence);
            assert_near(result.score, expected, NUMBER(1e-12, 1e-4));
            assert_near(score_of(&s, &result, (double)params.gap_cost), expected,
                        NUMBER(1e-12, 1e-4));
            /* Halving: a table, half a table, a quarter ... */
            assert_true(comparisons <= (int64_t)(s.first_count + 3) * (s.second_count + 3) *
                                           (kind == CAIRN_SEQUENCE_LOCAL ? 5 : 4));
            test_pool_free(&pool);
        }
}

static void finds_what_is_known(void **state)
{
    static const double a[] = {1, 2, 3, 4, 1}, b[] = {3, 4, 1, 2, 1, 3};
    struct sequences s = {{0}, {0}, 5, 6, CAIRN_SEQUENCE_LCS, NULL};
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_pool pool;
    cairn_sequence *sequence = make(&pool, cairn_sequence_default());
    cairn_sequence_result result;

    (void)state;
    memcpy(s.first, a, sizeof a);
    memcpy(s.second, b, sizeof b);
    assert_null(cairn_sequence_read(sequence).pairs);
    assert_ok(cairn_sequence_step(sequence, &budget));
    assert_ok(cairn_sequence_begin(sequence, 5, 6, compare, &s));
    assert_ok(cairn_sequence_step(sequence, &budget));
    result = cairn_sequence_read(sequence);
    assert_int_equal(result.count, 3); /* 3 4 1, or 1 2 3 */
    assert_near(result.score, 3, 0);
    /* While an input is worked on there is no result. */
    assert_ok(cairn_sequence_begin(sequence, 5, 6, compare, &s));
    assert_null(cairn_sequence_read(sequence).pairs);
    assert_int_equal(cairn_sequence_read(sequence).count, 0);
    assert_near(cairn_sequence_read(sequence).score, 0, 0);
    assert_ok(cairn_sequence_begin(sequence, 0, 6, compare, &s));
    assert_ok(cairn_sequence_step(sequence, &budget));
    assert_int_equal(cairn_sequence_read(sequence).count, 0);
    assert_near(cairn_sequence_read(sequence).score, 0, 0);
    assert_ok(cairn_sequence_begin(sequence, 5, 0, compare, &s));
    assert_ok(cairn_sequence_step(sequence, &budget));
    assert_int_equal(cairn_sequence_read(sequence).count, 0);
    test_pool_free(&pool);
}

/* Of equally good paths the first; the units, counted by hand for the smallest tables. */
static void takes_the_first_of_equal_paths_in_known_units(void **state)
{
    static const struct known {
        cairn_sequence_kind kind;
        int32_t first_count, second_count;
        double first[5], second[6];
        int32_t units, count;
        cairn_sequence_pair pairs[8];
    } knowns[] = {
        /* take; two nodes forward, two backward, two joins; the move and the end of the walk;
         * take */
        {CAIRN_SEQUENCE_LCS, 1, 1, {1}, {1}, 10, 1, {{0, 0}}},
        {CAIRN_SEQUENCE_DTW, 1, 1, {1}, {3}, 10, 1, {{0, 0}}},
        /* and four nodes to find the end and four to find the start */
        {CAIRN_SEQUENCE_LOCAL, 1, 1, {1}, {1}, 18, 1, {{0, 0}}},
        /* the end lies in the middle of six nodes, the start four nodes before it */
        {CAIRN_SEQUENCE_LOCAL, 1, 2, {1}, {1, 9}, 20, 1, {{0, 0}}},
        {CAIRN_SEQUENCE_LOCAL, 2, 2, {1, 2}, {1, 2}, 53, 2, {{0, 0}, {1, 1}}},
        {CAIRN_SEQUENCE_LCS, 2, 2, {1, 2}, {2, 1}, 36, 1, {{1, 0}}},
        {CAIRN_SEQUENCE_LCS,
         5,
         6,
         {1, 2, 3, 4, 1},
         {3, 4, 1, 2, 1, 3},
         189,
         3,
         {{2, 0}, {3, 1}, {4, 2}}},
        {CAIRN_SEQUENCE_LOCAL,
         5,
         6,
         {1, 2, 3, 4, 1},
         {3, 4, 1, 2, 1, 3},
         135,
         3,
         {{2, 0}, {3, 1}, {4, 2}}},
        {CAIRN_SEQUENCE_DTW, 3, 3, {1, 1, 1}, {1, 1, 1}, 70, 4, {{0, 0}, {1, 0}, {2, 1}, {2, 2}}},
        {CAIRN_SEQUENCE_DTW,
         5,
         6,
         {1, 2, 3, 4, 1},
         {3, 4, 1, 2, 1, 3},
         188,
         8,
         {{0, 0}, {1, 0}, {2, 0}, {3, 1}, {4, 2}, {4, 3}, {4, 4}, {4, 5}}},
    };

    (void)state;
    for (size_t k = 0; k < sizeof knowns / sizeof *knowns; k++) {
        const struct known *known = &knowns[k];
        cairn_sequence_params params = {
            .kind = known->kind, .max_first = 5, .max_second = 6, .gap_cost = 1};
        cairn_budget budget = {CAIRN_UNBOUNDED};
        struct sequences s = {{0}, {0}, known->first_count, known->second_count, known->kind, NULL};
        cairn_pool pool;
        cairn_sequence *sequence = make(&pool, params);
        cairn_sequence_result result;

        memcpy(s.first, known->first, sizeof known->first);
        memcpy(s.second, known->second, sizeof known->second);
        assert_ok(cairn_sequence_begin(sequence, s.first_count, s.second_count, compare, &s));
        assert_ok(cairn_sequence_step(sequence, &budget));
        result = cairn_sequence_read(sequence);
        assert_int_equal(CAIRN_UNBOUNDED - budget.left, known->units);
        assert_int_equal(result.count, known->count);
        assert_memory_equal(result.pairs, known->pairs,
                            (size_t)known->count * sizeof *known->pairs);
        test_pool_free(&pool);
    }
}

static void a_local_alignment_of_unlike_sequences_is_empty(void **state)
{
    struct sequences s = {{1, 1, 1}, {9, 9}, 3, 2, CAIRN_SEQUENCE_LOCAL, NULL};
    cairn_sequence_params params = {
        .kind = CAIRN_SEQUENCE_LOCAL, .max_first = 3, .max_second = 2, .gap_cost = 1};
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_pool pool;
    cairn_sequence *sequence = make(&pool, params);

    (void)state;
    assert_ok(cairn_sequence_begin(sequence, 3, 2, compare, &s));
    assert_ok(cairn_sequence_step(sequence, &budget));
    assert_int_equal(cairn_sequence_read(sequence).count, 0);
    assert_near(cairn_sequence_read(sequence).score, 0, 0);
    test_pool_free(&pool);
}

static void budgets_do_not_matter(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    cairn_random random = cairn_random_seed(2, 1);

    (void)state;
    for (cairn_sequence_kind kind = CAIRN_SEQUENCE_LCS; kind <= CAIRN_SEQUENCE_DTW; kind++) {
        cairn_sequence_params params = {.kind = kind,
                                        .max_first = MAX_COUNT,
                                        .max_second = MAX_COUNT,
                                        .gap_cost = CAIRN_REAL(0.5)};
        cairn_budget all = {CAIRN_UNBOUNDED}, none = {0};
        cairn_sequence_pair whole[2 * MAX_COUNT];
        cairn_sequence_result result;
        struct sequences s;
        cairn_pool pool;
        cairn_sequence *sequence = make(&pool, params);
        int32_t count, units;

        s.kind = kind;
        s.comparisons = NULL;
        draw(&s, &random, MAX_COUNT);
        assert_ok(cairn_sequence_begin(sequence, s.first_count, s.second_count, compare, &s));
        assert_status(cairn_sequence_step(sequence, &none), CAIRN_MORE);
        assert_ok(cairn_sequence_step(sequence, &all));
        result = cairn_sequence_read(sequence);
        count = result.count;
        units = CAIRN_UNBOUNDED - all.left;
        memcpy(whole, result.pairs, (size_t)count * sizeof *whole);
        for (int k = 0; k < 3; k++) {
            cairn_status status = CAIRN_MORE;
            int32_t used = 0;

            assert_ok(cairn_sequence_begin(sequence, s.first_count, s.second_count, compare, &s));
            while (status == CAIRN_MORE) {
                cairn_budget budget = {budgets[k]};

                status = cairn_sequence_step(sequence, &budget);
                used += budgets[k] - budget.left;
            }
            assert_ok(status);
            assert_int_equal(used, units);
            result = cairn_sequence_read(sequence);
            assert_int_equal(result.count, count);
            assert_memory_equal(result.pairs, whole, (size_t)count * sizeof *whole);
        }
        test_pool_free(&pool);
    }
}

static void refuses(void **state)
{
    cairn_sequence_params good = {
        .kind = CAIRN_SEQUENCE_LOCAL, .max_first = 3, .max_second = 2, .gap_cost = 1};
    struct sequences s = {{1, 1, 1}, {9, 9}, 3, 2, CAIRN_SEQUENCE_LOCAL, NULL};
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_pool pool;
    cairn_sequence *sequence = make(&pool, good), *made = NULL;

    (void)state;
    assert_status(cairn_sequence_create(&made, NULL, &good), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_sequence_begin(sequence, 3, 2, compare, &s));
    assert_status(cairn_sequence_begin(NULL, 3, 2, compare, &s), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_sequence_begin(sequence, 3, 2, NULL, &s), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_sequence_begin(sequence, -1, 2, compare, &s), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_sequence_begin(sequence, 3, -1, compare, &s), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_sequence_begin(sequence, 4, 2, compare, &s), CAIRN_FULL);
    assert_status(cairn_sequence_begin(sequence, 3, 3, compare, &s), CAIRN_FULL);
    assert_status(cairn_sequence_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_sequence_step(sequence, NULL), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_sequence_step(sequence, &budget));
    test_pool_free(&pool);
}

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_sequence *sequence;

    return cairn_sequence_create(&sequence, pool, context);
}

static void memory_is_as_stated(void **state)
{
    cairn_sequence_params params = {
        .kind = CAIRN_SEQUENCE_DTW, .max_first = 11, .max_second = 5, .gap_cost = 0};

    (void)state;
    test_every_pool_size(create, &params, cairn_sequence_memory(&params));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(gives_the_score_and_the_path_of_the_whole_table),
        cmocka_unit_test(finds_what_is_known),
        cmocka_unit_test(takes_the_first_of_equal_paths_in_known_units),
        cmocka_unit_test(a_local_alignment_of_unlike_sequences_is_empty),
        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(refuses),
        cmocka_unit_test(memory_is_as_stated),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
