/* Fragments found along chains: the place of a drawn fragment, comparison with complete tables of
 * all pairs, empty input, very much input. */
#include "tests/test.h"

#include <math.h>

#include "cairn/fragment_match.h"

enum { CORNERS = 60, CHAINS = 40, POINTS = 24, SAMPLES = 20 };

typedef struct matching {
    cairn_pool pool, model_pool;
    cairn_fragment_match_params params;
    cairn_fragment_matcher *matcher;
    cairn_part_bundle_model model;
    cairn_vec2 outline[CORNERS];
    cairn_vec2 points[CHAINS][CORNERS];
    cairn_curve chains[CHAINS];
    int32_t chain_count;
} matching;

/* A shape with three different humps, about 1 across. */
static void draw_outline(matching *m)
{
    for (int32_t i = 0; i < CORNERS; i++) {
        double a = 2 * 3.14159265358979 * i / CORNERS,
               r = 0.35 + 0.1 * cos(3 * a) + 0.06 * sin(2 * a);

        m->outline[i].x = (cairn_real)(r * cos(a));
        m->outline[i].y = (cairn_real)(1.3 * r * sin(a));
    }
}

static cairn_fragment_match_params small_params(void)
{
    cairn_fragment_match_params params = cairn_fragment_match_default();

    params.max_fragments = 32;
    params.max_chains = CHAINS;
    params.max_samples = 1024;
    params.min_scale = 60;
    params.max_scale = 240;
    params.min_step = 2;
    return params;
}

static void start(matching *m, const cairn_fragment_match_params *params)
{
    cairn_part_bundle_params parts = cairn_part_bundle_default();
    cairn_part_bundle_builder *builder;
    cairn_budget budget = {INT32_MAX};

    draw_outline(m);
    m->params = *params;
    m->chain_count = 0;
    m->model_pool = test_pool(cairn_part_bundle_memory(&parts));
    assert_ok(cairn_part_bundle_create(&builder, &m->model_pool, &parts));
    assert_ok(cairn_part_bundle_begin(builder, m->outline, CORNERS, NULL, 0));
    assert_ok(cairn_part_bundle_step(builder, &budget));
    m->model = cairn_part_bundle_read(builder);
    m->pool = test_pool(cairn_fragment_match_memory(params));
    assert_ok(cairn_fragment_match_create(&m->matcher, &m->pool, params));
}

static void end(matching *m)
{
    test_pool_free(&m->pool);
    test_pool_free(&m->model_pool);
}

/* A separate chain shaped like the outline between two vertices, of given scale and place. */
static void draw_chain(matching *m, int32_t from, int32_t count, double scale, double x, double y,
                       int reversed)
{
    cairn_vec2 *p = m->points[m->chain_count];

    for (int32_t i = 0; i < count; i++) {
        const cairn_vec2 *o = &m->outline[(from + (reversed ? count - 1 - i : i)) % CORNERS];

        p[i].x = (cairn_real)(x + scale * (double)o->x);
        p[i].y = (cairn_real)(y + scale * (double)o->y);
    }
    m->chains[m->chain_count++] = (cairn_curve){p, count, count == CORNERS};
}

/* Random walks. */
static void draw_clutter(matching *m, int32_t chains, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 1);

    for (int32_t c = 0; c < chains; c++) {
        cairn_vec2 *p = m->points[m->chain_count];
        double angle = (double)cairn_random_uniform(&random, -3, 3), length;

        p[0].x = cairn_random_uniform(&random, 0, 400);
        p[0].y = cairn_random_uniform(&random, 0, 300);
        for (int32_t i = 1; i < POINTS; i++) {
            angle += (double)cairn_random_normal(&random) * 0.35;
            length = (double)cairn_random_uniform(&random, 3, 12);
            p[i].x = p[i - 1].x + (cairn_real)(length * cos(angle));
            p[i].y = p[i - 1].y + (cairn_real)(length * sin(angle));
        }
        m->chains[m->chain_count++] = (cairn_curve){p, POINTS, c % 4 == 3};
    }
}

static cairn_fragment_match_result run(matching *m)
{
    cairn_budget budget = {INT32_MAX};

    assert_ok(cairn_fragment_match_begin(m->matcher, &m->model, m->chains, m->chain_count));
    assert_ok(cairn_fragment_match_step(m->matcher, &budget));
    return cairn_fragment_match_read(m->matcher);
}

/* ---- The place of a drawn fragment ---- */

static void finds_drawn_fragments(void **state)
{
    static const double scales[] = {80, 113, 200};

    (void)state;
    for (int32_t k = 0; k < 12; k++) {
        cairn_fragment_match_params params = small_params();
        double scale = scales[k % 3];
        cairn_fragment_match_result r;
        matching m;
        int32_t good = 0;

        start(&m, &params);
        draw_clutter(&m, k % 4, (uint64_t)k);
        /* Of the whole outline, and of half of it, in both senses. */
        draw_chain(&m, 7 * k, k < 6 ? CORNERS : CORNERS / 2, scale, 200, 150, k % 2);
        r = run(&m);
        for (int32_t i = 0; i < r.count; i++) {
            const cairn_fragment_match *f = &r.matches[i];

            assert_true(i == 0 || f->fragment >= r.matches[i - 1].fragment);
            assert_true(f->similarity >= params.min_similarity && f->similarity <= 1);
            if (f->chain != m.chain_count - 1 || f->similarity < CAIRN_REAL(0.85) ||
                m.model.fragments[f->fragment].length < m.model.length / 5)
                continue;
            good++;
            assert_int_equal(f->reversed, k % 2);
            assert_near(f->scale, scale, 0.15 * scale);
            assert_near(f->centroid.x, 200 + scale * (double)m.model.centroid.x, 0.15 * scale);
            assert_near(f->centroid.y, 150 + scale * (double)m.model.centroid.y, 0.15 * scale);
            assert_true(f->rms_residual < CAIRN_REAL(0.04) * (cairn_real)scale);
            assert_near(f->to - f->from, scale * (double)m.model.fragments[f->fragment].length,
                        0.2 * scale);
        }
        assert_in_range(good, k < 6 ? 6 : 1, r.count);
        end(&m);
    }
}

/* A straight chain matches a straight fragment at many scales: the largest is taken, at which the
 * whole chain is used. */
static void prefers_the_larger_scale(void **state)
{
    static const cairn_vec2 square[] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
    static const cairn_part_bundle_cut cut[] = {{0, 1, 0}};
    cairn_part_bundle_params parts = cairn_part_bundle_default();
    cairn_fragment_match_params params = small_params();
    cairn_part_bundle_builder *builder;
    cairn_budget budget = {INT32_MAX};
    cairn_fragment_match_result r;
    matching m;

    (void)state;
    start(&m, &params);
    test_pool_free(&m.model_pool);
    m.model_pool = test_pool(cairn_part_bundle_memory(&parts));
    assert_ok(cairn_part_bundle_create(&builder, &m.model_pool, &parts));
    assert_ok(cairn_part_bundle_begin(builder, square, 4, cut, 1));
    assert_ok(cairn_part_bundle_step(builder, &budget));
    m.model = cairn_part_bundle_read(builder);
    m.points[0][0] = (cairn_vec2){10, 20};
    m.points[0][1] = (cairn_vec2){210, 20};
    m.chains[m.chain_count++] = (cairn_curve){m.points[0], 2, 0};
    r = run(&m);
    assert_int_equal(r.count, 1);
    assert_near(r.matches[0].similarity, 1, 0);
    assert_true(r.matches[0].scale > CAIRN_REAL(200 / 1.19) &&
                r.matches[0].scale < CAIRN_REAL(200.001));
    assert_near(r.matches[0].rms_residual, 0, NUMBER(1e-9, 1e-3));
    assert_near(r.matches[0].centroid.y, 20 + (double)r.matches[0].scale / 2, 1e-3);
    end(&m);
}

/* ---- Reference implementation: complete tables, in double ---- */

static double turn_between(double a, double b)
{
    double turn = fabs(a - b);

    return turn > 3.14159265358979 ? 2 * 3.14159265358979 - turn : turn;
}

static void angles_of(const cairn_vec2 *p, int32_t count, int32_t closed, double *angles)
{
    cairn_vec2 directions[2048];
    cairn_curve curve = {p, count, closed};

    assert_ok(cairn_curve_tangents(&curve, 1, directions));
    for (int32_t i = 0; i < count; i++)
        angles[i] = atan2((double)directions[i].y, (double)directions[i].x);
}

static double align(const matching *m, const double *a, int32_t n, const double *b, int32_t count,
                    int32_t columns)
{
    static double table[SAMPLES + 1][4096];
    double best = 0;

    memset(table, 0, sizeof table);
    for (int32_t i = 1; i <= n; i++)
        for (int32_t j = 1; j <= columns; j++) {
            double pair =
                1 - turn_between(a[i - 1], b[(j - 1) % count]) / (double)m->params.zero_score_angle;
            double sum = fmax(table[i - 1][j - 1] + pair,
                              fmax(table[i - 1][j], table[i][j - 1]) - (double)m->params.gap_cost);

            table[i][j] = fmax(sum, 0);
            best = fmax(best, table[i][j]);
        }
    return best / n;
}

/* The best similarity of a fragment and a chain in one sense. */
static double slow_similarity(const matching *m, int32_t fragment, int32_t chain, int32_t reversed)
{
    const cairn_part_bundle_fragment *f = &m->model.fragments[fragment];
    const cairn_curve *c = &m->chains[chain];
    int32_t n = m->model.samples_each;
    double own[SAMPLES], theirs[2048], best = 0;
    double slack =
        sqrt(fmax(1, (double)(m->params.step_ratio * m->params.min_scale / m->params.max_scale)));
    cairn_vec2 places[2048];

    for (int32_t i = 0; i < n; i++)
        places[i] = m->model.samples[f->first + (reversed ? n - 1 - i : i)].position;
    angles_of(places, n, 0, own);
    for (double step = (double)m->params.min_step; step < 1000;
         step *= (double)m->params.step_ratio) {
        double scale = step * (n - 1) / (double)f->length;
        int32_t steps = (int32_t)((double)cairn_curve_length(c) / step),
                closed = c->closed && steps >= n;

        if (scale * slack < (double)m->params.min_scale ||
            scale > (double)m->params.max_scale * slack || steps < 1)
            continue;
        assert_ok(cairn_curve_resample(c, places, NULL, closed || c->closed ? steps : steps + 1));
        if (c->closed && !closed)
            places[steps] = c->points[0];
        angles_of(places, closed ? steps : steps + 1, closed, theirs);
        best = fmax(best, align(m, own, n, theirs, closed ? steps : steps + 1,
                                closed ? steps + n - 1 : steps + 1));
    }
    return best;
}

static void is_as_good_as_whole_tables(void **state)
{
    int32_t compared = 0, none = 0;

    (void)state;
    for (uint64_t seed = 0; seed < 3; seed++) {
        cairn_fragment_match_params params = small_params();
        cairn_fragment_match_result r;
        int32_t missed = 0, undecided = 0;
        matching m;

        params.matches_per_fragment = CHAINS;
        params.zero_score_angle = seed == 2 ? CAIRN_REAL(0.7) : params.zero_score_angle;
        params.gap_cost = seed == 1 ? 1 : params.gap_cost;
        start(&m, &params);
        draw_clutter(&m, 11, seed);
        draw_chain(&m, 5, 30, 100, 200, 100, (int)seed % 2);
        r = run(&m);
        for (int32_t f = 0; f < m.model.fragment_count; f++)
            for (int32_t c = 0; c < m.chain_count; c++) {
                double ahead = slow_similarity(&m, f, c, 0), back = slow_similarity(&m, f, c, 1);
                const cairn_fragment_match *found = NULL;

                for (int32_t i = 0; i < r.count; i++)
                    if (r.matches[i].fragment == f && r.matches[i].chain == c) {
                        assert_null(found);
                        found = &r.matches[i];
                    }
                if (found != NULL) {
                    compared++;
                    assert_near(found->similarity, fmax(ahead, back), 0.01);
                    assert_near(found->similarity, found->reversed ? back : ahead, 0.01);
                } else {
                    none++;
                    missed += fmax(ahead, back) > (double)m.params.min_similarity + 0.01;
                    undecided += fmax(ahead, back) > (double)m.params.min_similarity - 0.01;
                }
            }
        /* Without a match nothing resembles the fragment, except where the scale was rejected. */
        assert_in_range(r.candidate_count - r.count, missed, undecided);
        for (int32_t i = 1; i < r.count; i++)
            assert_true(r.matches[i].fragment != r.matches[i - 1].fragment ||
                        r.matches[i].similarity <= r.matches[i - 1].similarity);
        end(&m);
    }
    assert_in_range(compared, 60, 10000);
    assert_in_range(none, 60, 10000);
}

/* However close the limits are, there is a step between them for every fragment. */
static void narrow_limits_lose_little(void **state)
{
    static const double widths[] = {2, 1.1, 1.03, 1};
    int32_t all = 0;

    (void)state;
    for (size_t i = 0; i < sizeof widths / sizeof *widths; i++) {
        cairn_fragment_match_params params = small_params();
        cairn_fragment_match_result r;
        int32_t right = 0;
        matching m;

        params.min_scale = (cairn_real)(100 / widths[i]);
        params.max_scale = (cairn_real)(100 * widths[i]);
        start(&m, &params);
        draw_chain(&m, 0, CORNERS, 100, 200, 150, 0);
        r = run(&m);
        for (int32_t k = 0; k < r.count; k++) {
            double dx = (double)r.matches[k].centroid.x - 200 - 100 * (double)m.model.centroid.x;
            double dy = (double)r.matches[k].centroid.y - 150 - 100 * (double)m.model.centroid.y;

            right += hypot(dx, dy) < 15 && (double)r.matches[k].similarity > 0.8;
        }
        all = i == 0 ? right : all;
        assert_true(all >= 16);
        assert_in_range(right, 3 * all / 4, 24);
        end(&m);
    }
}

/* The best of a longer list are kept, each on its own chain. */
static void keeps_the_best(void **state)
{
    cairn_fragment_match_params params = small_params();
    cairn_fragment_match all[32 * CHAINS];
    cairn_fragment_match_result r;
    int32_t count;
    matching m;

    (void)state;
    params.matches_per_fragment = CHAINS;
    params.min_scale = CAIRN_REAL(0.001);
    params.max_scale = 1000000;
    params.min_step = 4;
    start(&m, &params);
    draw_clutter(&m, CHAINS, 8);
    r = run(&m);
    count = r.count;
    memcpy(all, r.matches, (size_t)count * sizeof *all);
    end(&m);
    params.matches_per_fragment = 3;
    start(&m, &params);
    draw_clutter(&m, CHAINS, 8);
    r = run(&m);
    assert_in_range(r.count, 3 * 10, 3 * 32);
    for (int32_t i = 0, k = 0; i < r.count; i++, k++) {
        if (i > 0 && r.matches[i].fragment != r.matches[i - 1].fragment)
            while (all[k].fragment != r.matches[i].fragment)
                k++;
        while (memcmp(&all[k], &r.matches[i], sizeof *all) != 0)
            assert_in_range(++k, 1, count - 1);
        assert_true(i < 3 || r.matches[i].fragment != r.matches[i - 3].fragment);
    }
    end(&m);
}

/* ---- Empty input, and very much ---- */

static void matches_nothing(void **state)
{
    static const cairn_vec2 one[] = {{5, 5}, {5, 5}, {5, 5}};
    cairn_fragment_match_params params = small_params();
    cairn_part_bundle_fragment none;
    cairn_part_bundle_model empty = {NULL, NULL, NULL, NULL, 0, 20, 0, 4, 0, {0, 0}};
    cairn_fragment_match_result r;
    cairn_budget budget = {INT32_MAX};
    matching m;

    (void)state;
    start(&m, &params);
    assert_int_equal(run(&m).count, 0);
    assert_int_equal(cairn_fragment_match_read(m.matcher).cell_count, 0);
    assert_ok(cairn_fragment_match_begin(m.matcher, &m.model, NULL, 0));
    assert_ok(cairn_fragment_match_step(m.matcher, &budget));
    m.chains[0] = (cairn_curve){one, 1, 0};
    m.chains[1] = (cairn_curve){one, 3, 0};
    m.chains[2] = (cairn_curve){one, 3, 1};
    m.chains[3] = (cairn_curve){NULL, 0, 0};
    m.chain_count = 4;
    r = run(&m);
    assert_int_equal(r.count, 0);
    m.chain_count = 0;
    draw_chain(&m, 0, CORNERS, 100, 100, 100, 0);
    assert_true(run(&m).count > 0);
    /* Fragments of zero length, and a model without fragments. */
    none = m.model.fragments[0];
    none.length = 0;
    m.model.fragments = &none;
    m.model.fragment_count = 1;
    assert_int_equal(run(&m).count, 0);
    m.model = empty;
    assert_int_equal(run(&m).count, 0);
    end(&m);
}

/* 10,000 chains: at most as many cells as they have samples at all steps, twice. */
static void is_bounded(void **state)
{
    enum { ITEM_COUNT = 10000 };
    cairn_fragment_match_params params = small_params();
    cairn_curve *chains = malloc(ITEM_COUNT * sizeof *chains);
    cairn_fragment_match_result r;
    cairn_budget budget = {INT32_MAX};
    int64_t samples = 0;
    matching m;

    (void)state;
    assert_non_null(chains);
    params.max_chains = ITEM_COUNT;
    params.min_scale = 100;
    params.max_scale = 400;
    params.step_ratio = 2;
    start(&m, &params);
    draw_clutter(&m, CHAINS, 3);
    for (int32_t i = 0; i < ITEM_COUNT; i++)
        chains[i] = m.chains[i % CHAINS];
    assert_ok(cairn_fragment_match_begin(m.matcher, &m.model, chains, ITEM_COUNT));
    assert_ok(cairn_fragment_match_step(m.matcher, &budget));
    r = cairn_fragment_match_read(m.matcher);
    for (int32_t i = 0; i < CHAINS; i++)
        for (double step = 2; step < 200; step *= 2)
            samples += ITEM_COUNT / CHAINS *
                       (20 + (int64_t)((double)cairn_curve_length(&m.chains[i]) / step));
    assert_true(r.cell_count > 0 && r.cell_count <= samples * 2 * SAMPLES * m.model.fragment_count);
    assert_true(INT32_MAX - budget.left <= r.cell_count / 4);
    assert_true(r.count <= params.matches_per_fragment * m.model.fragment_count);
    /* Of equal chains the first wins. */
    for (int32_t i = 0; i < r.count; i++)
        assert_in_range(r.matches[i].chain, 0, 2 * CHAINS - 1);
    free(chains);
    end(&m);
}

/* ---- Budgets ---- */

static cairn_status begin_chains(void *context)
{
    matching *m = context;

    return cairn_fragment_match_begin(m->matcher, &m->model, m->chains, m->chain_count);
}

static cairn_status step_chains(void *context, cairn_budget *budget)
{
    matching *m = context;

    return cairn_fragment_match_step(m->matcher, budget);
}

static uint64_t result_hash(void *context)
{
    matching *m = context;
    cairn_fragment_match_result r = cairn_fragment_match_read(m->matcher);
    uint64_t hash = test_hash(TEST_HASH_START, &r.cell_count, sizeof r.cell_count);

    for (int32_t i = 0; i < r.count; i++) {
        hash = test_hash(hash, &r.matches[i].fragment, 4 * sizeof(int32_t));
        hash = test_hash(hash, &r.matches[i].similarity, 7 * sizeof(cairn_real));
    }
    return hash;
}

static void does_not_depend_on_budgets(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    cairn_fragment_match_params params = small_params();
    cairn_budget all = {INT32_MAX};
    matching m;
    test_stepped object = {begin_chains, step_chains, result_hash, &m};
    uint64_t hash;

    (void)state;
    start(&m, &params);
    draw_clutter(&m, 4, 2);
    draw_chain(&m, 5, CORNERS, 100, 200, 100, 1);
    assert_ok(begin_chains(&m));
    assert_null(cairn_fragment_match_read(m.matcher).matches);
    assert_ok(step_chains(&m, &all));
    hash = result_hash(&m);
    assert_golden(test_hash(hash, &all.left, sizeof all.left), UINT64_C(0xfcd273be6ee3b870),
                  UINT64_C(0xb175c435b2ff56bc));
    for (int i = 0; i < 3; i++) {
        int32_t used = 0;
        cairn_status status;

        assert_ok(begin_chains(&m));
        do {
            cairn_budget budget = {budgets[i]};

            status = step_chains(&m, &budget);
            assert_true(budget.left >= 0);
            used += budgets[i] - budget.left;
        } while (status == CAIRN_MORE);
        assert_ok(status);
        assert_int_equal(used, INT32_MAX - all.left);
        assert_true(result_hash(&m) == hash);
    }
    test_begins_anew(&object, 5);
    end(&m);
}

/* ---- Refusals ---- */

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_fragment_matcher *matcher;

    return cairn_fragment_match_create(&matcher, pool, context);
}

/* Rules between parameters; tests/test_object.c has the ranges. */
static void refuses_bad_params(void **state)
{
    cairn_fragment_match_params good = small_params(), bad = good;
    cairn_object_fault fault = {.module = NULL};
    cairn_pool pool = test_pool(1 << 20);

    (void)state;
    bad.max_scale = good.min_scale / 2;
    assert_status(cairn_fragment_match_check(&bad, &fault), CAIRN_BAD_ARGUMENT);
    assert_string_equal(fault.rule, "max_scale: at least min_scale");
    assert_int_equal(cairn_fragment_match_memory(&bad), 0);
    assert_status(cairn_fragment_match_create(NULL, &pool, &good), CAIRN_BAD_ARGUMENT);
    good.max_fragments = 2;
    good.max_chains = 3;
    good.max_samples = 8;
    good.samples_per_fragment = 4;
    test_every_pool_size(create, &good, cairn_fragment_match_memory(&good));
    test_pool_free(&pool);
}

static void refuses_bad_input(void **state)
{
    cairn_fragment_match_params params = small_params();
    cairn_budget budget = {INT32_MAX};
    cairn_part_bundle_model bad;
    cairn_part_bundle_fragment odd;
    matching m;

    (void)state;
    params.max_fragments = 24;
    start(&m, &params);
    draw_chain(&m, 0, CORNERS, 100, 200, 100, 0);
    assert_int_equal(m.model.fragment_count, 24);
    assert_status(cairn_fragment_match_begin(NULL, &m.model, m.chains, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_fragment_match_begin(m.matcher, NULL, m.chains, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_fragment_match_begin(m.matcher, &m.model, NULL, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_fragment_match_begin(m.matcher, &m.model, m.chains, -1),
                  CAIRN_BAD_ARGUMENT);
    assert_status(cairn_fragment_match_begin(m.matcher, &m.model, m.chains, CHAINS + 1),
                  CAIRN_FULL);
    /* A fragment of one sample has no direction. */
    bad = m.model;
    bad.samples_each = 1;
    assert_status(cairn_fragment_match_begin(m.matcher, &bad, m.chains, 1), CAIRN_BAD_ARGUMENT);
    bad.samples_each = 21;
    assert_status(cairn_fragment_match_begin(m.matcher, &bad, m.chains, 1), CAIRN_FULL);
    bad = m.model;
    bad.fragment_count = 25;
    assert_status(cairn_fragment_match_begin(m.matcher, &bad, m.chains, 1), CAIRN_FULL);
    bad.fragment_count = -1;
    assert_status(cairn_fragment_match_begin(m.matcher, &bad, m.chains, 1), CAIRN_BAD_ARGUMENT);
    bad = m.model;
    bad.samples = NULL;
    assert_status(cairn_fragment_match_begin(m.matcher, &bad, m.chains, 1), CAIRN_BAD_ARGUMENT);
    bad = m.model;
    bad.centroid.y = (cairn_real)NAN;
    assert_status(cairn_fragment_match_begin(m.matcher, &bad, m.chains, 1), CAIRN_NOT_FINITE);
    bad.centroid.y = 2000000;
    assert_status(cairn_fragment_match_begin(m.matcher, &bad, m.chains, 1), CAIRN_BAD_ARGUMENT);
    bad = m.model;
    odd = m.model.fragments[0];
    odd.length = (cairn_real)INFINITY;
    bad.fragments = &odd;
    bad.fragment_count = 1;
    assert_status(cairn_fragment_match_begin(m.matcher, &bad, m.chains, 1), CAIRN_NOT_FINITE);
    odd.length = -1;
    assert_status(cairn_fragment_match_begin(m.matcher, &bad, m.chains, 1), CAIRN_BAD_ARGUMENT);
    odd.length = 2000000;
    assert_status(cairn_fragment_match_begin(m.matcher, &bad, m.chains, 1), CAIRN_BAD_ARGUMENT);
    odd = m.model.fragments[0];
    odd.first = -1;
    assert_status(cairn_fragment_match_begin(m.matcher, &bad, m.chains, 1), CAIRN_BAD_ARGUMENT);
    m.chains[0].count = -1;
    assert_status(cairn_fragment_match_begin(m.matcher, &m.model, m.chains, 1), CAIRN_BAD_ARGUMENT);
    m.chains[0].count = CORNERS;
    m.points[0][3].x = (cairn_real)INFINITY;
    assert_status(cairn_fragment_match_begin(m.matcher, &m.model, m.chains, 1), CAIRN_NOT_FINITE);
    m.points[0][3].x = 2000000;
    assert_status(cairn_fragment_match_begin(m.matcher, &m.model, m.chains, 1), CAIRN_BAD_ARGUMENT);
    m.points[0][3].x = 3000;
    assert_status(cairn_fragment_match_begin(m.matcher, &m.model, m.chains, 1), CAIRN_FULL);
    assert_status(cairn_fragment_match_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_fragment_match_step(m.matcher, NULL), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_fragment_match_step(m.matcher, &budget));
    assert_null(cairn_fragment_match_read(m.matcher).matches);
    assert_null(cairn_fragment_match_read(NULL).matches);
    end(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(finds_drawn_fragments),
        cmocka_unit_test(prefers_the_larger_scale),
        cmocka_unit_test(is_as_good_as_whole_tables),
        cmocka_unit_test(narrow_limits_lose_little),
        cmocka_unit_test(keeps_the_best),
        cmocka_unit_test(matches_nothing),
        cmocka_unit_test(is_bounded),
        cmocka_unit_test(does_not_depend_on_budgets),
        cmocka_unit_test(refuses_bad_params),
        cmocka_unit_test(refuses_bad_input),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
