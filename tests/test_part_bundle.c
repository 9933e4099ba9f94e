/* Bundles of outline fragments compared with a reference implementation; degenerate outlines,
 * refusals. */
#include "tests/test.h"

#include <math.h>

#include "cairn/curve_evolution.h"
#include "cairn/part_bundle.h"

enum { MAX_COUNT = 96 };

typedef struct bundling {
    cairn_pool pool;
    cairn_part_bundle_builder *builder;
    cairn_vec2 points[MAX_COUNT];
    int32_t count;
    const cairn_part_bundle_cut *cuts;
    int32_t cut_count;
} bundling;

static void start(bundling *b, cairn_part_bundle_params params)
{
    b->pool = test_pool(cairn_part_bundle_memory(&params));
    assert_ok(cairn_part_bundle_create(&b->builder, &b->pool, &params));
    b->cuts = NULL;
    b->cut_count = 0;
}

static cairn_part_bundle_params small_params(void)
{
    cairn_part_bundle_params params = cairn_part_bundle_default();

    params.max_points = MAX_COUNT;
    return params;
}

/* A star with `tips` different tips, seen from inside. */
static void draw_star(bundling *b, int32_t tips, int32_t count)
{
    b->count = count;
    for (int32_t i = 0; i < count; i++) {
        double a = 6.283185307179586 * i / count, r = 10 + 4 * cos(tips * a) + 1.5 * sin(a);

        b->points[i].x = (cairn_real)(r * cos(a));
        b->points[i].y = (cairn_real)(r * sin(a));
    }
}

static cairn_part_bundle_model run(bundling *b)
{
    cairn_budget budget = {INT32_MAX};

    assert_ok(cairn_part_bundle_begin(b->builder, b->points, b->count, b->cuts, b->cut_count));
    assert_null(cairn_part_bundle_read(b->builder).fragments);
    assert_ok(cairn_part_bundle_step(b->builder, &budget));
    return cairn_part_bundle_read(b->builder);
}

/* ---- Reference implementation: walks along the outline, in double ---- */

static double side(const bundling *b, int32_t i)
{
    const cairn_vec2 *p = &b->points[i], *q = &b->points[(i + 1) % b->count];

    return hypot((double)(q->x - p->x), (double)(q->y - p->y));
}

static double walk(const bundling *b, int32_t from, int32_t to)
{
    double length = 0;

    for (int32_t i = from; i != to; i = (i + 1) % b->count)
        length += side(b, i);
    return length;
}

static double whole(const bundling *b)
{
    return walk(b, 0, b->count - 1) + side(b, b->count - 1);
}

/* The place at a distance along the outline from a vertex. */
static void place_at(const bundling *b, int32_t from, double far, double place[2])
{
    int32_t i = from;

    while (far > side(b, i)) {
        far -= side(b, i);
        i = (i + 1) % b->count;
    }
    far = side(b, i) > 0 ? far / side(b, i) : 0;
    place[0] =
        (double)b->points[i].x + far * (double)(b->points[(i + 1) % b->count].x - b->points[i].x);
    place[1] =
        (double)b->points[i].y + far * (double)(b->points[(i + 1) % b->count].y - b->points[i].y);
}

static void assert_fragment(const bundling *b, const cairn_part_bundle_model *m, int32_t index)
{
    const cairn_part_bundle_fragment *f = &m->fragments[index];
    double length = walk(b, f->from, f->to), pieces = 0;

    assert_near(f->length, length, NUMBER(1e-9, 1e-3));
    assert_int_equal(f->first, index * m->samples_each);
    for (int32_t i = 0; i < m->vertex_count; i++)
        if (f->pieces >> i & 1)
            pieces += (double)m->piece_length[i];
    assert_near(pieces, length, NUMBER(1e-9, 1e-3));
    assert_true(f->pieces >> m->vertex_count == 0);
    for (int32_t k = 0; k < m->samples_each; k++) {
        const cairn_oriented_point *s = &m->samples[f->first + k];
        double place[2], ahead[2], far = length * k / (m->samples_each - 1);

        place_at(b, f->from, fmin(far, length * (1 - 1e-9)), place);
        assert_near(s->position.x, place[0], NUMBER(1e-6, 1e-3));
        assert_near(s->position.y, place[1], NUMBER(1e-6, 1e-3));
        assert_near(cairn_vec2_norm(s->direction), 1, NUMBER(1e-12, 1e-5));
        if (k + 1 < m->samples_each) {
            place_at(b, f->from, far + length * 1e-4, ahead);
            assert_true((double)s->direction.x * (ahead[0] - place[0]) +
                            (double)s->direction.y * (ahead[1] - place[1]) >
                        0);
        }
    }
}

static void cuts_by_the_rule(void **state)
{
    (void)state;
    for (int32_t tips = 2; tips < 7; tips++)
        for (int32_t longest = 1; longest <= 3; longest++) {
            cairn_part_bundle_params params = small_params();
            cairn_curve_evolution_params evolution_params = {.max_points = MAX_COUNT};
            cairn_pool pool = test_pool(cairn_curve_evolution_memory(&evolution_params));
            cairn_budget budget = {INT32_MAX};
            cairn_curve_evolution *evolution;
            cairn_part_bundle_model m;
            int32_t vertices = 0, at = 0;
            bundling b;

            params.max_pieces = longest;
            params.bundles = 2 + tips % 3;
            params.pieces_each = 1 + tips % 2;
            start(&b, params);
            draw_star(&b, tips, MAX_COUNT - 5 * tips);
            m = run(&b);
            assert_ok(cairn_curve_evolution_create(&evolution, &pool, &evolution_params));
            assert_ok(cairn_curve_evolution_begin(evolution, b.points, b.count));
            assert_ok(cairn_curve_evolution_step(evolution, &budget));
            for (int32_t i = 0; i < b.count; i++)
                if (cairn_curve_evolution_read(evolution).rank[i] <
                    (params.bundles * params.pieces_each < 3 ? 3
                                                             : params.bundles * params.pieces_each))
                    assert_int_equal(m.vertices[vertices++], i);
            assert_int_equal(m.vertex_count, vertices);
            assert_int_equal(m.bundle_count, params.bundles);
            assert_near(m.length, whole(&b), NUMBER(1e-9, 1e-3));
            for (int32_t i = 0; i < vertices; i++)
                for (int32_t pieces = 1; pieces <= longest && pieces < vertices; pieces++, at++) {
                    const cairn_part_bundle_fragment *f = &m.fragments[at];
                    double middle = i > 0 ? walk(&b, m.vertices[0], m.vertices[i]) : 0;

                    assert_int_equal(f->from, m.vertices[i]);
                    assert_int_equal(f->to, m.vertices[(i + pieces) % vertices]);
                    middle = fmod(middle + walk(&b, f->from, f->to) / 2, whole(&b));
                    assert_int_equal(f->bundle,
                                     (int32_t)floor(middle / whole(&b) * params.bundles));
                    assert_fragment(&b, &m, at);
                }
            assert_int_equal(m.fragment_count, at);
            test_pool_free(&b.pool);
            test_pool_free(&pool);
        }
}

static void cuts_by_hand(void **state)
{
    static const cairn_part_bundle_cut cuts[] = {
        {3, 20, 0}, {20, 40, 2}, {50, 3, 3}, {3, 40, 0}, {40, 20, 1}};
    static const int32_t vertices[] = {3, 20, 40, 50};
    static const uint32_t pieces[] = {1, 2, 8, 3, 13};
    cairn_part_bundle_model m;
    bundling b;

    (void)state;
    start(&b, small_params());
    draw_star(&b, 5, 60);
    b.cuts = cuts;
    b.cut_count = 5;
    m = run(&b);
    assert_int_equal(m.fragment_count, 5);
    assert_int_equal(m.vertex_count, 4);
    assert_int_equal(m.bundle_count, 4);
    for (int32_t i = 0; i < 4; i++) {
        assert_int_equal(m.vertices[i], vertices[i]);
        assert_near(m.piece_length[i], walk(&b, vertices[i], vertices[(i + 1) % 4]),
                    NUMBER(1e-9, 1e-3));
    }
    for (int32_t k = 0; k < 5; k++) {
        assert_int_equal(m.fragments[k].from, cuts[k].from);
        assert_int_equal(m.fragments[k].to, cuts[k].to);
        assert_int_equal(m.fragments[k].bundle, cuts[k].bundle);
        assert_int_equal(m.fragments[k].pieces, pieces[k]);
        assert_fragment(&b, &m, k);
    }
    test_pool_free(&b.pool);
}

static void finds_the_middle_of_the_line(void **state)
{
    static const cairn_vec2 triangle[] = {{0, 0}, {4, 0}, {0, 3}};
    cairn_part_bundle_model m;
    bundling b;

    (void)state;
    start(&b, small_params());
    memcpy(b.points, triangle, sizeof triangle);
    b.count = 3;
    m = run(&b);
    assert_near(m.length, 12, NUMBER(1e-12, 1e-5));
    assert_near(m.centroid.x, (4 * 2 + 5 * 2) / 12.0, NUMBER(1e-12, 1e-5));
    assert_near(m.centroid.y, (5 * 1.5 + 3 * 1.5) / 12.0, NUMBER(1e-12, 1e-5));
    assert_int_equal(m.vertex_count, 3);
    assert_int_equal(m.fragment_count, 6);
    /* Coincident vertices make sides of zero length, of which there are no fragments. */
    b.points[3] = b.points[2];
    b.count = 4;
    m = run(&b);
    for (int32_t k = 0; k < m.fragment_count; k++)
        assert_true(m.fragments[k].length > 0);
    test_pool_free(&b.pool);
}

/* ---- Budgets ---- */

static cairn_status begin_star(void *context)
{
    bundling *b = context;

    return cairn_part_bundle_begin(b->builder, b->points, b->count, b->cuts, b->cut_count);
}

static cairn_status step_star(void *context, cairn_budget *budget)
{
    bundling *b = context;

    return cairn_part_bundle_step(b->builder, budget);
}

static uint64_t result_hash(void *context)
{
    bundling *b = context;
    cairn_part_bundle_model m = cairn_part_bundle_read(b->builder);
    uint64_t hash = TEST_HASH_START;

    for (int32_t k = 0; k < m.fragment_count; k++) {
        hash = test_hash(hash, &m.fragments[k].from, 3 * sizeof(int32_t));
        hash = test_hash(hash, &m.fragments[k].length, sizeof(cairn_real));
    }
    return test_hash(hash, m.samples,
                     (size_t)(m.fragment_count * m.samples_each) * sizeof *m.samples);
}

static void does_not_depend_on_budgets(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    cairn_budget all = {INT32_MAX};
    bundling b;
    test_stepped object = {begin_star, step_star, result_hash, &b};
    uint64_t hash;

    (void)state;
    start(&b, small_params());
    draw_star(&b, 4, 80);
    assert_ok(begin_star(&b));
    assert_ok(step_star(&b, &all));
    assert_ok(step_star(&b, &all));
    hash = result_hash(&b);
    assert_golden(test_hash(hash, &all.left, sizeof all.left), UINT64_C(0xd76b209d8bc73680),
                  UINT64_C(0xc05ae754e374089c));
    for (int i = 0; i < 3; i++) {
        int32_t used = 0;
        cairn_status status;

        assert_ok(begin_star(&b));
        do {
            cairn_budget budget = {budgets[i]};

            status = step_star(&b, &budget);
            used += budgets[i] - budget.left;
        } while (status == CAIRN_MORE);
        assert_ok(status);
        assert_int_equal(used, INT32_MAX - all.left);
        assert_true(result_hash(&b) == hash);
    }
    test_begins_anew(&object, 7);
    test_pool_free(&b.pool);
}

/* ---- Refusals ---- */

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_part_bundle_builder *builder;

    return cairn_part_bundle_create(&builder, pool, context);
}

/* tests/test_object.c has the ranges. */
static void fits_its_pool(void **state)
{
    cairn_part_bundle_params good = small_params();
    cairn_pool pool = test_pool(1 << 20);

    (void)state;
    assert_status(cairn_part_bundle_create(NULL, &pool, &good), CAIRN_BAD_ARGUMENT);
    good.max_points = 8;
    good.samples_each = 2;
    test_every_pool_size(create, &good, cairn_part_bundle_memory(&good));
    test_pool_free(&pool);
}

static void refuses_bad_outlines(void **state)
{
    cairn_budget budget = {INT32_MAX};
    bundling b;

    (void)state;
    start(&b, small_params());
    draw_star(&b, 3, 30);
    assert_status(cairn_part_bundle_begin(NULL, b.points, 30, NULL, 0), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_part_bundle_begin(b.builder, NULL, 30, NULL, 0), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_part_bundle_begin(b.builder, b.points, 1, NULL, 0), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_part_bundle_begin(b.builder, b.points, 2, NULL, 0), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_part_bundle_begin(b.builder, b.points, MAX_COUNT + 1, NULL, 0), CAIRN_FULL);
    b.points[29].x = (cairn_real)NAN;
    assert_status(cairn_part_bundle_begin(b.builder, b.points, 30, NULL, 0), CAIRN_NOT_FINITE);
    assert_ok(cairn_part_bundle_begin(b.builder, b.points, 29, NULL, 0));
    b.points[0].y = CAIRN_REAL(1.1e9);
    assert_status(cairn_part_bundle_begin(b.builder, b.points, 29, NULL, 0), CAIRN_NOT_FINITE);
    for (int32_t i = 0; i < 30; i++)
        b.points[i] = b.points[1];
    assert_status(cairn_part_bundle_begin(b.builder, b.points, 30, NULL, 0), CAIRN_EMPTY);
    assert_ok(cairn_part_bundle_step(b.builder, &budget));
    assert_int_equal(cairn_part_bundle_read(b.builder).vertex_count, 8);
    assert_status(cairn_part_bundle_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_part_bundle_step(b.builder, NULL), CAIRN_BAD_ARGUMENT);
    assert_null(cairn_part_bundle_read(NULL).fragments);
    test_pool_free(&b.pool);
}

static void refuses_bad_cuts(void **state)
{
    static const cairn_part_bundle_cut bad[] = {{-1, 5, 0}, {30, 5, 0}, {5, -1, 0}, {5, 30, 0},
                                                {5, 5, 0},  {1, 5, -1}, {1, 5, 8},  {1, 5, 2}};
    cairn_part_bundle_cut cuts[97];
    bundling b;

    (void)state;
    start(&b, small_params());
    draw_star(&b, 3, 30);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        cuts[0] = (cairn_part_bundle_cut){1, 9, 0};
        cuts[1] = bad[i];
        assert_status(cairn_part_bundle_begin(b.builder, b.points, 30, cuts, 2),
                      CAIRN_BAD_ARGUMENT);
    }
    assert_status(cairn_part_bundle_begin(b.builder, b.points, 30, cuts, 0), CAIRN_BAD_ARGUMENT);
    for (int32_t k = 0; k < 97; k++)
        cuts[k] = (cairn_part_bundle_cut){k % 30, (k + 1) % 30, k % 8};
    assert_status(cairn_part_bundle_begin(b.builder, b.points, 30, cuts, 97), CAIRN_FULL);
    assert_ok(cairn_part_bundle_begin(b.builder, b.points, 30, cuts, 96));
    draw_star(&b, 3, 40);
    for (int32_t k = 0; k < 33; k++)
        cuts[k] = (cairn_part_bundle_cut){k, k + 1 < 33 ? k + 1 : 0, 0};
    assert_status(cairn_part_bundle_begin(b.builder, b.points, 40, cuts, 33), CAIRN_FULL);
    assert_ok(cairn_part_bundle_begin(b.builder, b.points, 40, cuts, 31));
    b.points[1] = b.points[0];
    assert_status(cairn_part_bundle_begin(b.builder, b.points, 40, cuts, 31), CAIRN_EMPTY);
    test_pool_free(&b.pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cuts_by_the_rule),
        cmocka_unit_test(cuts_by_hand),
        cmocka_unit_test(finds_the_middle_of_the_line),
        cmocka_unit_test(does_not_depend_on_budgets),
        cmocka_unit_test(fits_its_pool),
        cmocka_unit_test(refuses_bad_outlines),
        cmocka_unit_test(refuses_bad_cuts),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
