#include "tests/test.h"

#include <math.h>

#include "cairn/contour_grouping.h"

#define PI     3.14159265358979323846
#define DEGREE (PI / 180)

enum { WIDTH = 320, HEIGHT = 240, MOST = 400, SIDES = 7 };

/* A lamp: nothing in it is alike upside down or from behind. */
static const double lamp[SIDES][2] = {{-10, -40}, {14, -40}, {26, 0}, {6, 4}, {10, 40}, {-14, 40}, {-4, 4}};

typedef struct scene {
    cairn_segment lines[MOST];
    int32_t count;
} scene;

typedef struct finder {
    cairn_pool pool;
    cairn_shape_builder *builder;
    cairn_grouping *grouping;
    cairn_grouping_params params;
    cairn_shape_model model;
} finder;

static void add_line(scene *s, double ax, double ay, double bx, double by)
{
    cairn_segment line = {{(cairn_real)ax, (cairn_real)ay}, {(cairn_real)bx, (cairn_real)by}};

    assert_true(s->count < MOST);
    s->lines[s->count++] = line;
}

/* The lamp's sides in pieces of some 8 px, those of number `from` to `to` - 1 only. Indices of its segments are in order. */
static void add_lamp(scene *s, double x, double y, double scale, double turn, int from, int to)
{
    for (int i = from; i < to; i++) {
        const double *a = lamp[i], *b = lamp[(i + 1) % SIDES];
        int parts = (int)ceil(hypot(b[0] - a[0], b[1] - a[1]) * scale / 8);

        for (int k = 0; k < parts; k++) {
            double t = (double)k / parts, u = (k + 1.0) / parts, px[2], py[2];

            for (int e = 0; e < 2; e++) {
                double w = e ? u : t, mx = a[0] + w * (b[0] - a[0]), my = a[1] + w * (b[1] - a[1]);

                px[e] = x + scale * (cos(turn) * mx - sin(turn) * my);
                py[e] = y + scale * (sin(turn) * mx + cos(turn) * my);
            }
            add_line(s, px[0], py[0], px[1], py[1]);
        }
    }
}

static void add_clutter(scene *s, int32_t count, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 3);

    for (int32_t i = 0; i < count; i++) {
        double x = (double)cairn_random_uniform(&random, 10, WIDTH - 10);
        double y = (double)cairn_random_uniform(&random, 10, HEIGHT - 10);
        double turn = (double)cairn_random_uniform(&random, 0, (cairn_real)PI);
        double half = (double)cairn_random_uniform(&random, 2, 8);

        add_line(s, x - half * cos(turn), y - half * sin(turn), x + half * cos(turn), y + half * sin(turn));
    }
}

static cairn_grouping_params small_params(void)
{
    cairn_grouping_params p = cairn_grouping_default();

    p.max_width = WIDTH;
    p.max_height = HEIGHT;
    p.max_tokens = 800;
    p.particles = 40;
    return p;
}

static finder new_finder(const cairn_grouping_params *params)
{
    cairn_shape_builder_params shape = cairn_shape_builder_default();
    cairn_vec2 v[SIDES];
    cairn_curve outline = {v, SIDES, 1};
    cairn_budget budget = {INT32_MAX};
    finder f;

    for (int i = 0; i < SIDES; i++) {
        v[i].x = (cairn_real)lamp[i][0];
        v[i].y = (cairn_real)lamp[i][1];
    }
    f.params = *params;
    f.pool = test_pool(cairn_shape_builder_memory(&shape) + cairn_grouping_memory(params));
    assert_ok(cairn_shape_builder_create(&f.builder, &f.pool, &shape));
    assert_ok(cairn_grouping_create(&f.grouping, &f.pool, params));
    assert_ok(cairn_shape_builder_begin(f.builder, &outline, 1));
    assert_ok(cairn_shape_builder_step(f.builder, &budget));
    f.model = cairn_shape_builder_read(f.builder);
    return f;
}

static cairn_grouping_input input_of(const finder *f, const scene *s)
{
    cairn_grouping_input in = {
        .segments = s->lines,
        .count = s->count,
        .width = WIDTH,
        .height = HEIGHT,
        .model = &f->model,
        .min_size = (cairn_real)0.6 * f->model.size,
        .max_size = (cairn_real)1.6 * f->model.size,
        .min_turn = (cairn_real)(-20 * DEGREE),
        .max_turn = (cairn_real)(20 * DEGREE),
        .mean_length = 8,
    };

    return in;
}

static cairn_grouping_result group(finder *f, const cairn_grouping_input *in)
{
    cairn_budget budget = {INT32_MAX};

    assert_ok(cairn_grouping_begin(f->grouping, in));
    assert_int_equal(cairn_grouping_read(f->grouping).token_count, 0);
    assert_ok(cairn_grouping_step(f->grouping, &budget));
    return cairn_grouping_read(f->grouping);
}

/* The share of the segments first ... last - 1 that an object has, and of its own that are among them. */
static void shares(const cairn_grouping_result *r, int32_t object, int32_t first, int32_t last, double *recall,
                   double *precision)
{
    const cairn_grouped_object *o = &r->objects[object];
    int32_t among = 0;

    for (int32_t i = 0; i < o->count; i++) {
        int32_t s = r->segments[o->first + i];

        among += s >= first && s < last;
        for (int32_t k = 0; k < i; k++)
            assert_true(r->segments[o->first + k] != s);
    }
    *recall = (double)among / (last - first);
    *precision = o->count > 0 ? (double)among / o->count : 0;
}

/* Where the frame of the model comes to lie: its origin is the middle of the box. */
static void assert_lies(const finder *f, const cairn_grouped_object *o, double x, double y, double scale, double turn)
{
    double mx = (double)f->model.origin.x * scale, my = (double)f->model.origin.y * scale;

    assert_near(o->origin.x, x + cos(turn) * mx - sin(turn) * my, 2);
    assert_near(o->origin.y, y + sin(turn) * mx + cos(turn) * my, 2);
    assert_near((double)o->size / ((double)f->model.size * scale), 1, 0.04);
    assert_near(o->turn, turn, 3 * DEGREE);
}

static void it_is_found_in_clutter_at_any_size_and_turn(void **state)
{
    static const double where[4][4] = {
        {160, 120, 1, 0}, {90, 100, 0.7, 12 * DEGREE}, {200, 130, 1.5, -12 * DEGREE}, {60, 60, 1.1, 5 * DEGREE}};
    cairn_grouping_params params = small_params();
    finder f = new_finder(&params);

    (void)state;
    for (int i = 0; i < 4; i++) {
        const double *w = where[i];
        scene s = {.count = 0};
        cairn_grouping_result r;
        cairn_grouping_input in;
        double recall, precision;
        int32_t own;

        add_lamp(&s, w[0], w[1], w[2], w[3], 0, SIDES);
        own = s.count;
        add_clutter(&s, 150, (uint64_t)i);
        in = input_of(&f, &s);
        r = group(&f, &in);
        assert_int_equal(r.object_count, 1);
        assert_lies(&f, &r.objects[0], w[0], w[1], w[2], w[3]);
        shares(&r, 0, 0, own, &recall, &precision);
        assert_true(recall >= 0.9);
        assert_true(precision >= 0.8);
        assert_true(r.objects[0].score > (cairn_real)0.8 && r.objects[0].score <= 1);
        assert_near(r.best, r.objects[0].score, 0);
        assert_true(r.starts > 0 && r.steps == f.model.sample_count - 1);
        assert_true(r.objects[0].seen > f.model.sample_count * 2 / 3 && r.objects[0].seen <= f.model.sample_count);
        for (int32_t k = 0; k < r.steps; k++) {
            assert_true(r.trace[k].particles >= 1 && r.trace[k].particles <= params.particles);
            assert_true(r.trace[k].n_eff >= (cairn_real)0.99 && r.trace[k].log_likelihood <= 0);
        }
    }
    test_pool_free(&f.pool);
}

static void two_are_found_and_told_apart(void **state)
{
    cairn_grouping_params params = small_params();
    finder f = new_finder(&params);
    scene s = {.count = 0};
    cairn_grouping_input in;
    cairn_grouping_result r;
    double recall, precision;
    int32_t first, second;

    (void)state;
    add_lamp(&s, 80, 120, 1, 0, 0, SIDES);
    first = s.count;
    add_lamp(&s, 230, 110, 1.2, 8 * DEGREE, 0, SIDES);
    second = s.count;
    in = input_of(&f, &s);
    r = group(&f, &in);
    assert_int_equal(r.object_count, 2);
    assert_true(r.objects[0].score >= r.objects[1].score);
    for (int32_t i = 0; i < 2; i++) {
        int left = r.objects[i].origin.x < 150;

        shares(&r, i, left ? 0 : first, left ? first : second, &recall, &precision);
        assert_true(recall >= 0.9);
        assert_near(precision, 1, 0);
    }
    assert_true((r.objects[0].origin.x < 150) != (r.objects[1].origin.x < 150));
    test_pool_free(&f.pool);
}

/* One end is hidden, then the other: what is left is grouped, with a lower score. */
static void a_part_is_enough(void **state)
{
    cairn_grouping_params params = small_params();
    finder f = new_finder(&params);

    (void)state;
    for (int part = 0; part < 2; part++) {
        scene s = {.count = 0};
        cairn_grouping_input in;
        cairn_grouping_result r;

        add_lamp(&s, 150, 110, 1.2, 5 * DEGREE, part ? 2 : 0, part ? 7 : 5);
        add_clutter(&s, 60, (uint64_t)part);
        in = input_of(&f, &s);
        f.params.min_score = (cairn_real)0.5;
        r = group(&f, &in);
        assert_true(r.best > (cairn_real)0.5 && r.best < (cairn_real)0.92);
        if (r.object_count > 0)
            assert_lies(&f, &r.objects[0], 150, 110, 1.2, 5 * DEGREE);
    }
    test_pool_free(&f.pool);
}

/* Not there, upside down, or of another size than asked for: nothing is reported, but for the best score. */
static void what_is_not_there_is_not_found(void **state)
{
    cairn_grouping_params params = small_params();
    finder f = new_finder(&params);
    cairn_grouping_input in;
    cairn_grouping_result r;
    scene s = {.count = 0}, none = {.count = 0};

    (void)state;
    add_clutter(&s, 200, 9);
    in = input_of(&f, &s);
    r = group(&f, &in);
    assert_int_equal(r.object_count, 0);
    assert_true(r.best_evidence < params.min_evidence);
    s.count = 0;
    add_lamp(&s, 160, 120, 1, PI, 0, SIDES);
    in = input_of(&f, &s);
    r = group(&f, &in);
    assert_int_equal(r.object_count, 0);
    in.min_turn = (cairn_real)(170 * DEGREE);
    in.max_turn = (cairn_real)PI;
    r = group(&f, &in);
    assert_int_equal(r.object_count, 1);
    s.count = 0;
    add_lamp(&s, 160, 120, 1, 0, 0, SIDES);
    in = input_of(&f, &s);
    in.min_size = (cairn_real)1.3 * f.model.size;
    r = group(&f, &in);
    assert_int_equal(r.object_count, 0);
    in = input_of(&f, &none);
    r = group(&f, &in);
    assert_int_equal(r.object_count, 0);
    assert_int_equal(r.token_count + r.starts + r.steps, 0);
    test_pool_free(&f.pool);
}

static uint64_t hash_of(const cairn_grouping_result *r)
{
    uint64_t hash = test_hash(TEST_HASH_START, &r->best, sizeof r->best);

    hash = test_hash(hash, r->segments, (size_t)r->objects[0].count * sizeof *r->segments);
    for (int32_t i = 0; i < r->object_count; i++)
        hash = test_hash(hash, &r->objects[i].origin, sizeof r->objects[i].origin);
    for (int32_t i = 0; i < r->steps; i++)
        hash = test_hash(hash, &r->trace[i].n_eff, sizeof r->trace[i].n_eff);
    return hash;
}

static void budgets_do_not_matter(void **state)
{
    static const int32_t budgets[] = {7, 1000, 100000};
    cairn_grouping_params params = small_params();
    cairn_budget all = {INT32_MAX};
    finder f;
    cairn_grouping_input in;
    cairn_grouping_result r;
    scene s = {.count = 0};
    int32_t units;
    uint64_t hash;

    (void)state;
    params.particles = 8;
    f = new_finder(&params);
    add_lamp(&s, 160, 120, 1, 0, 0, SIDES);
    add_clutter(&s, 10, 5);
    in = input_of(&f, &s);
    assert_ok(cairn_grouping_begin(f.grouping, &in));
    assert_ok(cairn_grouping_step(f.grouping, &all));
    units = INT32_MAX - all.left;
    r = cairn_grouping_read(f.grouping);
    assert_int_equal(r.object_count, 1);
    hash = hash_of(&r);
    for (int i = 0; i < 3; i++) {
        int64_t used = 0;
        cairn_status status;

        assert_ok(cairn_grouping_begin(f.grouping, &in));
        do {
            cairn_budget budget = {budgets[i]};

            status = cairn_grouping_step(f.grouping, &budget);
            assert_true(budget.left >= 0);
            used += budgets[i] - budget.left;
        } while (status == CAIRN_MORE);
        assert_ok(status);
        r = cairn_grouping_read(f.grouping);
        assert_true(hash_of(&r) == hash);
        assert_int_equal(used, units);
    }
    test_pool_free(&f.pool);
}

static void bad_input_is_refused(void **state)
{
    cairn_grouping_params params = small_params();
    finder f = new_finder(&params);
    scene s = {.count = 0};
    cairn_grouping_input good, in;
    cairn_budget budget = {INT32_MAX};
    cairn_shape_model model = f.model;
    cairn_shape_sample *many;

    (void)state;
    add_lamp(&s, 160, 120, 1, 0, 0, SIDES);
    good = input_of(&f, &s);
    assert_int_equal(group(&f, &good).object_count, 1);
#define REFUSED(change, status)                                                                                        \
    in = good;                                                                                                         \
    change;                                                                                                            \
    assert_status(cairn_grouping_begin(f.grouping, &in), status);                                                      \
    assert_int_equal(cairn_grouping_read(f.grouping).object_count, 1)
    REFUSED(in.count = -1, CAIRN_BAD_ARGUMENT);
    REFUSED(in.segments = NULL, CAIRN_BAD_ARGUMENT);
    REFUSED(in.width = 0, CAIRN_BAD_ARGUMENT);
    REFUSED(in.height = 0, CAIRN_BAD_ARGUMENT);
    REFUSED(in.width = WIDTH + 1, CAIRN_FULL);
    REFUSED(in.height = HEIGHT + 1, CAIRN_FULL);
    REFUSED(in.model = NULL, CAIRN_BAD_ARGUMENT);
    REFUSED(in.min_size = 0, CAIRN_BAD_ARGUMENT);
    REFUSED(in.min_size = (cairn_real)NAN, CAIRN_BAD_ARGUMENT);
    REFUSED(in.max_size = in.min_size / 2, CAIRN_BAD_ARGUMENT);
    REFUSED(in.max_size = (cairn_real)INFINITY, CAIRN_NOT_FINITE);
    REFUSED(in.min_turn = -4, CAIRN_BAD_ARGUMENT);
    REFUSED(in.max_turn = 4, CAIRN_BAD_ARGUMENT);
    REFUSED(in.max_turn = in.min_turn - 1, CAIRN_BAD_ARGUMENT);
    REFUSED(in.min_turn = (cairn_real)NAN, CAIRN_NOT_FINITE);
    REFUSED(in.max_turn = (cairn_real)NAN, CAIRN_NOT_FINITE);
    REFUSED(in.mean_length = 0, CAIRN_BAD_ARGUMENT);
    REFUSED(in.mean_length = (cairn_real)NAN, CAIRN_NOT_FINITE);
    model.sample_count = params.max_samples + 1;
    many = calloc((size_t)model.sample_count, sizeof *many);
    assert_non_null(many);
    model.samples = many;
    for (int32_t i = 0; i < model.sample_count; i++)
        many[i] = f.model.samples[0];
    REFUSED(in.model = &model, CAIRN_FULL);
    free(many);
#undef REFUSED
    assert_status(cairn_grouping_begin(NULL, &good), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_grouping_begin(f.grouping, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_grouping_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_grouping_step(f.grouping, NULL), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_grouping_step(f.grouping, &budget));
    s.lines[2].b.y = (cairn_real)NAN;
    assert_ok(cairn_grouping_begin(f.grouping, &good));
    assert_status(cairn_grouping_step(f.grouping, &budget), CAIRN_NOT_FINITE);
    assert_int_equal(cairn_grouping_read(f.grouping).object_count, 0);
    assert_int_equal(cairn_grouping_read(NULL).steps, 0);
    test_pool_free(&f.pool);
}

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_grouping *g;

    return cairn_grouping_create(&g, pool, context);
}

static void bad_params_are_refused(void **state)
{
    cairn_grouping_params good = small_params(), p;
    cairn_pool pool = test_pool(64);
    cairn_grouping *g;

    (void)state;
#define REFUSED(field, bad)                                                                                            \
    p = good;                                                                                                          \
    p.field = bad;                                                                                                     \
    assert_int_equal(cairn_grouping_memory(&p), 0);                                                                    \
    assert_status(cairn_grouping_create(&g, &pool, &p), CAIRN_BAD_ARGUMENT)
    REFUSED(max_width, 0);
    REFUSED(max_width, 8193);
    REFUSED(max_height, 0);
    REFUSED(max_height, 8193);
    REFUSED(max_tokens, 0);
    REFUSED(max_tokens, (1 << 20) + 1);
    REFUSED(max_samples, 0);
    REFUSED(max_samples, 1025);
    REFUSED(max_outline, 0);
    REFUSED(max_outline, 4097);
    REFUSED(particles, 0);
    REFUSED(particles, 4097);
    REFUSED(max_objects, 0);
    REFUSED(max_objects, 65);
    REFUSED(token, 0);
    REFUSED(token, (cairn_real)INFINITY);
    REFUSED(deform, 0);
    REFUSED(deform, (cairn_real)NAN);
    REFUSED(turn, 0);
    REFUSED(turn, (cairn_real)INFINITY);
    REFUSED(symmetry, 0);
    REFUSED(symmetry, (cairn_real)NAN);
    REFUSED(missing, 0);
    REFUSED(missing, (cairn_real)1.1);
    REFUSED(stop, 0);
    REFUSED(stop, (cairn_real)1.1);
    REFUSED(min_score, (cairn_real)-0.1);
    REFUSED(min_score, (cairn_real)1.1);
#undef REFUSED
    assert_int_equal(cairn_grouping_memory(NULL), 0);
    assert_status(cairn_grouping_create(NULL, &pool, &good), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_grouping_create(&g, NULL, &good), CAIRN_BAD_ARGUMENT);
    good.particles = 2;
    good.max_tokens = 4;
    good.max_samples = 4;
    good.max_width = good.max_height = 32;
    test_every_pool_size(create, &good, cairn_grouping_memory(&good));
    test_pool_free(&pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_is_found_in_clutter_at_any_size_and_turn),
        cmocka_unit_test(two_are_found_and_told_apart),
        cmocka_unit_test(a_part_is_enough),
        cmocka_unit_test(what_is_not_there_is_not_found),
        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(bad_input_is_refused),
        cmocka_unit_test(bad_params_are_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
