/* Models of outlines: paths of known shapes, sides and shares; refusals. */
#include "tests/test.h"

#include <math.h>

#include "cairn/shape_model.h"

enum { MAX_COUNT = 400 };

static cairn_vec2 at(double x, double y)
{
    cairn_vec2 p = {(cairn_real)x, (cairn_real)y};

    return p;
}

typedef struct shape {
    cairn_pool pool;
    cairn_shape_model_builder *builder;
    cairn_shape_model_builder_params params;
} shape;

static shape new_shape(int32_t max_paths)
{
    shape s;

    s.params = cairn_shape_model_builder_default();
    s.params.outline_samples = 128;
    s.params.max_paths = max_paths;
    s.pool = test_pool(cairn_shape_model_builder_memory(&s.params));
    assert_ok(cairn_shape_model_builder_create(&s.builder, &s.pool, &s.params));
    return s;
}

static cairn_shape_model build(shape *s, const cairn_curve *outlines, int32_t count)
{
    cairn_budget budget = {INT32_MAX};
    cairn_shape_model model;
    cairn_fault fault;

    assert_ok(cairn_shape_model_builder_begin(s->builder, outlines, count));
    assert_ok(cairn_shape_model_builder_step(s->builder, &budget));
    model = cairn_shape_model_builder_read(s->builder);
    assert_ok(cairn_shape_model_check(&model, &fault));
    return model;
}

/* 100 x 40 with a leg of 30 x 10 below it; without the leg when it has no length. */
static int32_t box_with_leg(cairn_vec2 *v, double leg)
{
    int32_t n = 0;

    v[n++] = at(0, 0);
    v[n++] = at(100, 0);
    v[n++] = at(100, 40);
    if (leg > 0) {
        v[n++] = at(75, 40);
        v[n++] = at(75, 40 + leg);
        v[n++] = at(63, 40 + leg);
        v[n++] = at(63, 40);
    }
    v[n++] = at(0, 40);
    return n;
}

/* A bar: its middle line, radii of half its width, sides and shares unchanged. */
static void a_bar_has_its_middle_line(void **state)
{
    shape s = new_shape(1);
    cairn_vec2 v[8];
    cairn_curve outline = {v, box_with_leg(v, 0), 1};
    cairn_shape_model m = build(&s, &outline, 1);
    double size = hypot(100, 40);
    int32_t on_middle = 0;

    (void)state;
    assert_int_equal(m.path_count, 1);
    assert_near(m.size, size, 1e-4);
    assert_near(m.origin.x, 50, 1e-4);
    assert_near(m.origin.y, 20, 1e-4);
    assert_int_equal(m.outline_count, 128);
    assert_true(m.paths[0].count >= 8);
    for (int32_t k = 0; k < m.paths[0].count; k++) {
        const cairn_shape_model_sample *d = &m.samples[m.paths[0].first + k];

        if (fabs((double)d->centre.x) * size > 25)
            continue;
        on_middle++;
        assert_near(d->centre.y, 0, 0.01);
        assert_near(d->radius, 20 / size, 0.01);
        for (int32_t side = 0; side < 2; side++) {
            assert_near(fabs((double)d->contact[side].position.y), 20 / size, 1e-3);
            assert_near(cairn_vec2_norm(cairn_vec2_sub(d->contact[side].position, d->centre)),
                        d->radius, 1e-3);
        }
        /* To the left with y down, and both in the sense of the walk. */
        assert_true(cairn_vec2_cross(d->contact[0].direction,
                                     cairn_vec2_sub(d->contact[0].position, d->centre)) < 0);
        assert_true(cairn_vec2_cross(d->contact[1].direction,
                                     cairn_vec2_sub(d->contact[1].position, d->centre)) > 0);
        assert_true(cairn_vec2_dot(d->contact[0].direction, d->contact[1].direction) >
                    (cairn_real)0.9);
    }
    assert_true(on_middle >= 3);
    assert_near(cairn_shape_model_displacement(&m, 0, 0).x, 0, 0);
    assert_near(cairn_shape_model_displacement(&m, 0, 3).x,
                m.samples[3].centre.x - m.samples[0].centre.x, 0);
    test_pool_free(&s.pool);
}

/* The whole outline of a disc belongs to its path, at its one centre; sides are opposite to each
 * other in turn. */
static void a_disc_is_swept_once(void **state)
{
    shape s = new_shape(8);
    cairn_vec2 v[120];
    cairn_curve outline = {v, 120, 1};
    cairn_shape_model m;

    (void)state;
    for (int i = 0; i < 120; i++)
        v[i] = at(30 + 10 * cos(i * 2 * 3.14159265 / 120), 40 - 10 * sin(i * 2 * 3.14159265 / 120));
    m = build(&s, &outline, 1);
    assert_int_equal(m.path_count, 1);
    assert_true(m.paths[0].outline_share > (cairn_real)0.8);
    for (int32_t k = 0; k < m.sample_count; k++) {
        assert_near(cairn_vec2_norm(m.samples[k].centre), 0, 0.01);
        assert_near(m.samples[k].radius * m.size, 10, 0.1);
    }
    test_pool_free(&s.pool);
}

/* The longest path comes up the leg into the body. Each corner that it omits has a path of its own,
 * from the branch point to its tip. All together hold the outline except for the tips. */
static void corners_are_branches(void **state)
{
    shape one = new_shape(1), s = new_shape(8);
    cairn_vec2 v[8];
    cairn_curve outline = {v, box_with_leg(v, 36), 1};
    cairn_shape_model m = build(&one, &outline, 1);
    cairn_real share = m.paths[0].outline_share;
    int32_t in_leg = 0;

    (void)state;
    assert_int_equal(m.path_count, 1);
    m = build(&s, &outline, 1);
    assert_near(m.paths[0].outline_share, share, 0);
    for (int32_t k = 0; k < m.paths[0].count; k++)
        in_leg += fabs((double)(m.samples[k].radius * m.size) - 6) < 0.5 &&
                  fabs((double)(m.samples[k].centre.x * m.size + m.origin.x) - 69) < 0.5;
    assert_true(in_leg >= 4);
    assert_int_equal(m.path_count, 4);
    for (int32_t p = 1; p < m.path_count; p++) {
        const cairn_shape_model_sample *from = &m.samples[m.paths[p].first],
                                       *to = from + m.paths[p].count - 1;
        const cairn_shape_model_sample *root = &m.samples[m.paths[0].first + m.paths[p].branch];

        assert_int_equal(m.paths[p].parent, 0);
        assert_true(to->radius < from->radius / 2);
        assert_true(cairn_vec2_norm(cairn_vec2_sub(root->centre, from->centre)) < root->radius);
        share += m.paths[p].outline_share;
    }
    assert_true(share > (cairn_real)0.85 && share <= (cairn_real)1.05);
    test_pool_free(&one.pool);
    test_pool_free(&s.pool);
}

/* Two outlines are one object: the second one's path is attached to the first's. */
static void outlines_are_joined(void **state)
{
    shape s = new_shape(8);
    cairn_vec2 v[2][4] = {{{0, 0}, {60, 0}, {60, 20}, {0, 20}},
                          {{80, 0}, {80, 30}, {70, 30}, {70, 0}}};
    cairn_curve outlines[2] = {{v[0], 4, 1}, {v[1], 4, 1}};
    cairn_shape_model m = build(&s, outlines, 2);
    int32_t joined = 0;

    (void)state;
    assert_int_equal(m.paths[0].parent, -1);
    for (int32_t p = 1; p < m.path_count; p++)
        joined += m.samples[m.paths[p].first].centre.x * m.size > 25 && m.paths[p].parent == 0;
    assert_int_equal(joined, 1);
    /* Samples are even: of 128 those along 160 of 240 px; the second outline is more than 10 px
     * away. */
    assert_int_equal(cairn_shape_model_first_outline(&m), 85);
    m.outline_count = 1;
    assert_int_equal(cairn_shape_model_first_outline(&m), 1);
    m.outline_count = 0;
    assert_int_equal(cairn_shape_model_first_outline(&m), 0);
    test_pool_free(&s.pool);
}

/* A mirrored model has the other sides, the outline in reverse, and its interior on the same side;
 * mirrored again, in place, it is the model. */
static void a_mirrored_model_has_the_other_sides(void **state)
{
    shape s = new_shape(8);
    cairn_vec2 v[8];
    cairn_curve outline = {v, box_with_leg(v, 36), 1};
    cairn_shape_model m = build(&s, &outline, 1), mirrored;
    static cairn_shape_model_sample samples[MAX_COUNT];
    static cairn_oriented_point points[MAX_COUNT];
    cairn_fault fault;

    (void)state;
    assert_true(m.sample_count <= MAX_COUNT && m.outline_count <= MAX_COUNT);
    m.gaps[0] = at(0.25, 0.5);
    m.gap_count = 1;
    cairn_shape_model_mirror(&m, samples, points, &mirrored);
    assert_ok(cairn_shape_model_check(&mirrored, &fault));
    assert_true(mirrored.gaps[0].x == -m.gaps[0].x && mirrored.gaps[0].y == m.gaps[0].y);
    for (int32_t i = 0; i < m.sample_count; i++) {
        const cairn_shape_model_sample *a = &m.samples[i], *b = &samples[i];

        assert_true(b->centre.x == -a->centre.x && b->centre.y == a->centre.y);
        for (int32_t side = 0; side < 2; side++) {
            cairn_oriented_point from = a->contact[1 - side], to = b->contact[side];

            assert_true(to.position.x == -from.position.x && to.position.y == from.position.y);
            assert_true(to.direction.x == -from.direction.x && to.direction.y == from.direction.y);
            assert_true(b->outline_share[side] == a->outline_share[1 - side]);
        }
    }
    for (int32_t i = 0; i < m.outline_count; i++) {
        cairn_oriented_point from = m.outline[m.outline_count - 1 - i], to = points[i];

        assert_true(to.position.x == -from.position.x && to.position.y == from.position.y);
        assert_true(to.direction.x == from.direction.x && to.direction.y == -from.direction.y);
    }
    cairn_shape_model_mirror(&mirrored, samples, points, &mirrored);
    assert_true(mirrored.gaps[0].x == m.gaps[0].x);
    for (int32_t i = 0; i < m.sample_count; i++)
        assert_true(samples[i].centre.x == m.samples[i].centre.x &&
                    samples[i].contact[0].position.x == m.samples[i].contact[0].position.x &&
                    samples[i].outline_share[0] == m.samples[i].outline_share[0]);
    for (int32_t i = 0; i < m.outline_count; i++)
        assert_true(points[i].position.x == m.outline[i].position.x &&
                    points[i].direction.y == m.outline[i].direction.y);
    test_pool_free(&s.pool);
}

/* Of the paths, with 68, 11.7, 11 and 9 % of the outline, those of at least the least share; arcs of
 * the others are longer. */
static void short_paths_are_left_out(void **state)
{
    shape s = new_shape(8), t = s;
    cairn_vec2 v[8];
    cairn_curve outline = {v, box_with_leg(v, 36), 1};
    cairn_shape_model m = build(&s, &outline, 1), n;

    (void)state;
    t.params.min_outline_share = CAIRN_REAL(0.12);
    t.pool = test_pool(cairn_shape_model_builder_memory(&t.params));
    assert_ok(cairn_shape_model_builder_create(&t.builder, &t.pool, &t.params));
    n = build(&t, &outline, 1);
    assert_true(m.path_count > 1);
    assert_int_equal(n.path_count, 1);
    assert_near(n.paths[0].outline_share, m.paths[0].outline_share, 0);
    test_pool_free(&s.pool);
    test_pool_free(&t.pool);
}

/* Position, size and sense of an outline make no difference to the model. */
static void size_place_and_sense_do_not_matter(void **state)
{
    shape s = new_shape(8), t = new_shape(8);
    cairn_vec2 v[8], w[8];
    cairn_curve outline = {v, box_with_leg(v, 36), 1}, other = {w, outline.count, 1};
    cairn_shape_model m = build(&s, &outline, 1), n;

    (void)state;
    for (int32_t i = 0; i < other.count; i++)
        w[i] = at(1000 + 4 * (double)v[i].x, -300 + 4 * (double)v[i].y);
    n = build(&t, &other, 1);
    assert_near(n.size, 4 * m.size, 1e-3);
    assert_int_equal(n.path_count, m.path_count);
    assert_int_equal(n.sample_count, m.sample_count);
    for (int32_t i = 0; i < m.sample_count; i++) {
        assert_near(n.samples[i].centre.x, m.samples[i].centre.x, NUMBER(1e-9, 1e-3));
        assert_near(n.samples[i].radius, m.samples[i].radius, NUMBER(1e-9, 1e-3));
    }
    for (int32_t i = 0; i < other.count; i++)
        w[i] = v[other.count - 1 - i];
    n = build(&t, &other, 1);
    assert_near(n.paths[0].outline_share, m.paths[0].outline_share, 0.1);
    for (int32_t i = 0; i < n.outline_count; i++) {
        cairn_vec2 in = cairn_vec2_left_perp(n.outline[i].direction), p = n.outline[i].position;
        cairn_vec2 probe = cairn_vec2_add(
            n.origin,
            cairn_vec2_scale(cairn_vec2_add(p, cairn_vec2_scale(in, (cairn_real)0.03)), n.size));

        assert_int_equal(cairn_polygon_contains(v, outline.count, probe), 1);
    }
    test_pool_free(&s.pool);
    test_pool_free(&t.pool);
}

static uint64_t hash_of(shape *s)
{
    cairn_shape_model m = cairn_shape_model_builder_read(s->builder);

    return test_hash(
        test_hash(TEST_HASH_START, m.samples, (size_t)m.sample_count * sizeof *m.samples), m.paths,
        (size_t)m.path_count * sizeof *m.paths);
}

static void budgets_do_not_matter(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    shape s = new_shape(8);
    cairn_vec2 v[8];
    cairn_curve outline = {v, box_with_leg(v, 36), 1};
    cairn_budget all = {INT32_MAX};
    int32_t units;
    uint64_t hash;

    (void)state;
    (void)build(&s, &outline, 1);
    hash = hash_of(&s);
    assert_ok(cairn_shape_model_builder_begin(s.builder, &outline, 1));
    assert_int_equal(cairn_shape_model_builder_read(s.builder).path_count, 0);
    assert_ok(cairn_shape_model_builder_step(s.builder, &all));
    units = INT32_MAX - all.left;
    assert_golden(test_hash(hash, &units, sizeof units), UINT64_C(0x3b22009acf3b097b),
                  UINT64_C(0x3a89728b85f1e0e0));
    for (int i = 0; i < 3; i++) {
        int64_t used = 0;
        cairn_status status;

        assert_ok(cairn_shape_model_builder_begin(s.builder, &outline, 1));
        do {
            cairn_budget budget = {budgets[i]};

            status = cairn_shape_model_builder_step(s.builder, &budget);
            assert_true(budget.left >= 0);
            used += budgets[i] - budget.left;
        } while (status == CAIRN_MORE);
        assert_ok(status);
        assert_int_equal(used, units);
        assert_true(hash_of(&s) == hash);
    }
    test_pool_free(&s.pool);
}

static void bad_outlines_are_refused(void **state)
{
    shape s = new_shape(8);
    cairn_vec2 v[4] = {{0, 0}, {10, 0}, {10, 4}, {0, 4}}, flat[3] = {{0, 0}, {5, 5}, {9, 9}};
    cairn_curve outline = {v, 4, 1}, open = {v, 4, 0}, two = {v, 2, 1}, none = {NULL, 4, 1},
                line = {flat, 3, 1};
    cairn_budget budget = {INT32_MAX};

    (void)state;
    (void)build(&s, &outline, 1);
    assert_status(cairn_shape_model_builder_begin(NULL, &outline, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_shape_model_builder_begin(s.builder, NULL, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_shape_model_builder_begin(s.builder, &outline, 0), CAIRN_BAD_ARGUMENT);
    assert_status(
        cairn_shape_model_builder_begin(s.builder, &outline, CAIRN_SHAPE_MODEL_MAX_OUTLINES + 1),
        CAIRN_BAD_ARGUMENT);
    assert_status(cairn_shape_model_builder_begin(s.builder, &open, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_shape_model_builder_begin(s.builder, &two, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_shape_model_builder_begin(s.builder, &none, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_shape_model_builder_begin(s.builder, &line, 1), CAIRN_EMPTY);
    v[2].y = (cairn_real)NAN;
    assert_status(cairn_shape_model_builder_begin(s.builder, &outline, 1), CAIRN_NOT_FINITE);
    v[2].y = 4;
    assert_true(cairn_shape_model_builder_read(s.builder).path_count > 0);
    assert_status(cairn_shape_model_builder_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_shape_model_builder_step(s.builder, NULL), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_shape_model_builder_step(s.builder, &budget));
    assert_int_equal(cairn_shape_model_builder_read(NULL).path_count, 0);
    test_pool_free(&s.pool);
}

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_shape_model_builder *b;

    return cairn_shape_model_builder_create(&b, pool, context);
}

/* tests/test_object.c has the ranges. */
static void a_pool_of_its_bytes_suffices(void **state)
{
    cairn_shape_model_builder_params good = cairn_shape_model_builder_default();
    cairn_pool pool = test_pool(64);

    (void)state;
    assert_status(cairn_shape_model_builder_create(NULL, &pool, &good), CAIRN_BAD_ARGUMENT);
    good.outline_samples = 16;
    test_every_pool_size(create, &good, cairn_shape_model_builder_memory(&good));
    test_pool_free(&pool);
}

static void models_are_checked(void **state)
{
    shape s = new_shape(8);
    cairn_vec2 v[8];
    cairn_curve outline = {v, box_with_leg(v, 36), 1};
    cairn_shape_model good = build(&s, &outline, 1), m;
    static cairn_shape_model_sample samples[MAX_COUNT];
    static cairn_oriented_point points[MAX_COUNT];
    cairn_shape_model_path paths[CAIRN_SHAPE_MODEL_MAX_PATHS];
    cairn_fault fault;

    (void)state;
    assert_true(good.path_count >= 2);
#define CHANGED(change, status, where)                                                             \
    memcpy(samples, good.samples, (size_t)good.sample_count * sizeof *samples);                    \
    memcpy(points, good.outline, (size_t)good.outline_count * sizeof *points);                     \
    memcpy(paths, good.paths, (size_t)good.path_count * sizeof *paths);                            \
    m = good;                                                                                      \
    m.samples = samples;                                                                           \
    m.paths = paths;                                                                               \
    m.outline = points;                                                                            \
    change;                                                                                        \
    assert_fault(&fault, cairn_shape_model_check(&m, &fault), status, where)
    CHANGED(m.samples = NULL, CAIRN_BAD_ARGUMENT, -1);
    CHANGED(m.paths = NULL, CAIRN_BAD_ARGUMENT, -1);
    CHANGED(m.outline = NULL, CAIRN_BAD_ARGUMENT, -1);
    CHANGED(m.sample_count = 0, CAIRN_BAD_ARGUMENT, -1);
    CHANGED(m.path_count = 0, CAIRN_BAD_ARGUMENT, -1);
    CHANGED(m.path_count = 9, CAIRN_BAD_ARGUMENT, -1);
    CHANGED(m.outline_count = 0, CAIRN_BAD_ARGUMENT, -1);
    CHANGED(m.size = 0, CAIRN_BAD_ARGUMENT, -1);
    CHANGED(m.origin.y = (cairn_real)NAN, CAIRN_BAD_ARGUMENT, -1);
    CHANGED(samples[2].centre.x = (cairn_real)NAN, CAIRN_NOT_FINITE, 2);
    CHANGED(samples[2].deviation = (cairn_real)NAN, CAIRN_NOT_FINITE, 2);
    CHANGED(samples[1].radius = 0, CAIRN_BAD_ARGUMENT, 1);
    CHANGED(samples[1].deviation = -1, CAIRN_BAD_ARGUMENT, 1);
    CHANGED(samples[1].outline_share[1] = 2, CAIRN_BAD_ARGUMENT, 1);
    CHANGED(samples[1].outline_share[0] = -1, CAIRN_BAD_ARGUMENT, 1);
    CHANGED(samples[1].contact[1].direction.x = 2, CAIRN_BAD_ARGUMENT, 1);
    CHANGED(samples[1].contact[0].position.y = (cairn_real)NAN, CAIRN_BAD_ARGUMENT, 1);
    CHANGED(points[3].direction.x = (cairn_real)NAN, CAIRN_BAD_ARGUMENT, 3);
    CHANGED(paths[0].first = -1, CAIRN_BAD_ARGUMENT, 0);
    CHANGED(paths[0].count = 0, CAIRN_BAD_ARGUMENT, 0);
    CHANGED(paths[1].count = MAX_COUNT, CAIRN_BAD_ARGUMENT, 1);
    CHANGED(paths[1].parent = 1, CAIRN_BAD_ARGUMENT, 1);
    CHANGED(paths[1].branch = -1, CAIRN_BAD_ARGUMENT, 1);
    CHANGED(paths[1].branch = paths[0].count, CAIRN_BAD_ARGUMENT, 1);
    CHANGED(paths[0].outline_share = 2, CAIRN_BAD_ARGUMENT, 0);
#undef CHANGED
    assert_fault(&fault, cairn_shape_model_check(NULL, &fault), CAIRN_BAD_ARGUMENT, -1);
    test_pool_free(&s.pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_bar_has_its_middle_line),
        cmocka_unit_test(a_disc_is_swept_once),
        cmocka_unit_test(corners_are_branches),
        cmocka_unit_test(outlines_are_joined),
        cmocka_unit_test(a_mirrored_model_has_the_other_sides),
        cmocka_unit_test(short_paths_are_left_out),
        cmocka_unit_test(size_place_and_sense_do_not_matter),
        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(bad_outlines_are_refused),
        cmocka_unit_test(a_pool_of_its_bytes_suffices),
        cmocka_unit_test(models_are_checked),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
