/* Map merging: maps that overlap and maps that do not, scores by all pairs of cells, budgets,
 * refusals. */
#include "tests/merging.h"
#include "tests/world.h"

#include "src/merging/map_merge_work.h"

static cairn_map_merge_map map_of(const view *v)
{
    cairn_map_merge_map map = {{v->cells, SIDE, SIDE, SIDE}, (cairn_real)v->resolution, {0, 0, 0}};

    /* Not the origin of the view's frame, which is in the middle. */
    map.origin.x = map.origin.y = -(cairn_real)(SIDE * v->resolution / 2);
    return map;
}

/* ---- A merging ---- */

static cairn_map_merge_params small_params(void)
{
    cairn_map_merge_params p = cairn_map_merge_default();

    p.max_maps = 4;
    p.max_map_cells = SIDE * SIDE;
    p.max_cells = 4 * SIDE * SIDE;
    p.max_points = 600;
    p.max_segments = 128;
    p.particles = 20;
    return p;
}

struct fixture {
    cairn_pool pool;
    cairn_map_merge *merge;
};

static struct fixture merge_with(const cairn_map_merge_params *p)
{
    struct fixture f;

    f.pool = test_pool(cairn_map_merge_memory(p));
    assert_ok(cairn_map_merge_create(&f.merge, &f.pool, p));
    return f;
}

static void merge_views(cairn_map_merge *merge, view *const *views, int32_t count,
                        int32_t reference)
{
    cairn_map_merge_clear(merge);
    for (int32_t i = 0; i < count; i++) {
        cairn_map_merge_map map = map_of(views[i]);

        assert_ok(cairn_map_merge_add(merge, &map, NULL));
    }
    assert_ok(cairn_map_merge_begin(merge, reference, NULL));
    run(merge, CAIRN_UNBOUNDED);
}

static cairn_pose truth_of(const view *reference, const view *v)
{
    cairn_pose a = {(cairn_real)reference->x, (cairn_real)reference->y,
                    (cairn_real)reference->theta};
    cairn_pose b = {(cairn_real)v->x, (cairn_real)v->y, (cairn_real)v->theta};

    return cairn_pose_between(a, b);
}

static void assert_placed(const cairn_map_merge *merge, int32_t map, cairn_pose truth,
                          double metres)
{
    cairn_map_merge_placed p = cairn_map_merge_of(merge, map);

    assert_int_equal(p.verdict, CAIRN_MAP_MERGE_PLACED);
    assert_near(p.reference_map.x, truth.x, metres);
    assert_near(p.reference_map.y, truth.y, metres);
    assert_near(remainder((double)(p.reference_map.theta - truth.theta), 2 * PI), 0, metres / 3);
}

static void free_views(view **views, int32_t count)
{
    for (int32_t i = 0; i < count; i++)
        free(views[i]);
}

/* From the left to the right, `apart` m from each other. */
static void three_views_apart(const world *w, view **views, double apart)
{
    views[0] = draw(w, -apart, 0, 0.3, -7.2, 3.7 - apart, 0.05, 0);
    views[1] = draw(w, 0, 0.2, -2.1, -3.2, 3.2, 0.05, 0);
    views[2] = draw(w, apart, 0.3, 1.4, apart - 3.8, 7.2, 0.05, 0);
}

static void three_views(const world *w, view **views)
{
    three_views_apart(w, views, 4);
}

/* ---- Refusals ---- */

/* Rules between parameters; tests/test_object.c has the ranges. */
static void test_params_are_refused(void **state)
{
    cairn_map_merge_params good = small_params(), p;
    cairn_pool pool = test_pool(cairn_map_merge_memory(&good));
    cairn_map_merge *merge;

    (void)state;
#define REFUSED(field, value)                                                                      \
    p = good;                                                                                      \
    p.field = value;                                                                               \
    assert_int_equal(cairn_map_merge_memory(&p), 0);                                               \
    assert_status(cairn_map_merge_create(&merge, &pool, &p), CAIRN_BAD_ARGUMENT)
    REFUSED(max_map_cells, good.max_cells + 1);
#undef REFUSED
    assert_int_equal(cairn_map_merge_memory(NULL), 0);
    assert_status(cairn_map_merge_create(NULL, &pool, &good), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_merge_create(&merge, NULL, &good), CAIRN_BAD_ARGUMENT);
    assert_int_equal(pool.used, 0);
    test_pool_free(&pool);
}

/* The nested objects take all params that are in range. */
static void test_the_largest_params_are_accepted(void **state)
{
    cairn_map_merge_params p = cairn_map_merge_default();

    (void)state;
    p.max_maps = 64;
    p.max_modes = 32;
    p.particles = 4096;
    assert_ok(cairn_map_merge_check(&p, NULL));
    assert_true(cairn_map_merge_memory(&p) > 0);
    p.mode = CAIRN_MODE_AS_WRITTEN;
    p.perception = CAIRN_MAP_MERGE_IMAGES;
    assert_ok(cairn_map_merge_check(&p, NULL));
    assert_true(cairn_map_merge_memory(&p) > 0);
}

static void test_memory_is_exact(void **state)
{
    cairn_map_merge_params p = small_params();

    (void)state;
    p.max_maps = 1;
    p.max_cells = p.max_map_cells = 4;
    p.max_points = 64;
    p.max_segments = p.max_corners = p.max_modes = p.particles = 1;
    test_every_pool_size(create, &p, cairn_map_merge_memory(&p));
}

static void test_calls_are_refused(void **state)
{
    cairn_map_merge_params p = small_params();
    struct fixture f;
    uint8_t cells[8] = {0};
    cairn_map_merge_map map = {{cells, 4, 2, 4}, CAIRN_REAL(0.05), {0, 0, 0}}, bad;
    const int32_t order[2] = {0, 1}, twice[2] = {0, 0}, beyond[2] = {0, 2}, other[2] = {1, 0};
    cairn_pose nowhere = {(cairn_real)NAN, 0, 0}, pose;
    cairn_budget budget = {1};
    cairn_map_merge_pair_score score;
    cairn_fault fault;
    cairn_real evidence;

    (void)state;
    p.max_maps = 2;
    p.max_cells = 15;
    p.max_map_cells = 9;
    f = merge_with(&p);
    cairn_map_merge_clear(f.merge);
    assert_status(cairn_map_merge_begin(f.merge, 0, NULL), CAIRN_EMPTY);
    assert_status(cairn_map_merge_begin(NULL, 0, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_merge_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_merge_step(f.merge, NULL), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_map_merge_step(f.merge, &budget));
    assert_int_equal(budget.left, 1);
    assert_fault(&fault, cairn_map_merge_add(NULL, &map, &fault), CAIRN_BAD_ARGUMENT, -1);
    assert_fault(&fault, cairn_map_merge_add(f.merge, NULL, &fault), CAIRN_BAD_ARGUMENT, -1);
#define REFUSED(field, value, status)                                                              \
    bad = map;                                                                                     \
    bad.field = value;                                                                             \
    assert_fault(&fault, cairn_map_merge_add(f.merge, &bad, &fault), status, -1)
    REFUSED(cells.data, NULL, CAIRN_BAD_ARGUMENT);
    REFUSED(cells.width, 0, CAIRN_BAD_ARGUMENT);
    REFUSED(resolution, 0, CAIRN_BAD_ARGUMENT);
    REFUSED(resolution, (cairn_real)NAN, CAIRN_NOT_FINITE);
    REFUSED(resolution, (cairn_real)INFINITY, CAIRN_NOT_FINITE);
    REFUSED(origin.theta, (cairn_real)NAN, CAIRN_NOT_FINITE);
    REFUSED(cells.height, 3, CAIRN_FULL);
#undef REFUSED
    assert_ok(cairn_map_merge_add(f.merge, &map, NULL));
    /* 16 of 15 cells */
    assert_fault(&fault, cairn_map_merge_add(f.merge, &map, &fault), CAIRN_FULL, -1);
    map.cells.width = 3;
    assert_ok(cairn_map_merge_add(f.merge, &map, NULL));
    map.cells.width = map.cells.height = 1;
    assert_fault(&fault, cairn_map_merge_add(f.merge, &map, &fault), CAIRN_FULL, -1);
    assert_status(cairn_map_merge_guess(f.merge, 2, cairn_pose_identity()), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_merge_guess(f.merge, -1, cairn_pose_identity()), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_merge_guess(NULL, 0, cairn_pose_identity()), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_merge_guess(f.merge, 1, nowhere), CAIRN_NOT_FINITE);
    assert_status(cairn_map_merge_begin(f.merge, 2, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_merge_begin(f.merge, -1, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_merge_begin(f.merge, 0, twice), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_merge_begin(f.merge, 0, beyond), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_merge_begin(f.merge, 0, other), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_merge_score(f.merge, 0, 1, cairn_pose_identity(), &score),
                  CAIRN_BAD_ARGUMENT);
    assert_int_equal(cairn_map_merge_read(f.merge).maps, 0);
    assert_ok(cairn_map_merge_begin(f.merge, 0, order));
    assert_fault(&fault, cairn_map_merge_add(f.merge, &map, &fault), CAIRN_BAD_ARGUMENT, -1);
    assert_status(cairn_map_merge_guess(f.merge, 1, cairn_pose_identity()), CAIRN_BAD_ARGUMENT);
    /* nothing is known in these maps: all cells are walls */
    run(f.merge, 3);
    assert_int_equal(cairn_map_merge_read(f.merge).maps, 2);
    assert_int_equal(cairn_map_merge_read(f.merge).placed, 1);
    assert_int_equal(cairn_map_merge_of(f.merge, 1).verdict, CAIRN_MAP_MERGE_EMPTY);
    assert_status(cairn_map_merge_score(f.merge, 0, 2, cairn_pose_identity(), &score),
                  CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_merge_score(f.merge, -1, 0, cairn_pose_identity(), &score),
                  CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_merge_score(f.merge, 0, 1, cairn_pose_identity(), NULL),
                  CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_merge_score(f.merge, 0, 1, nowhere, &score), CAIRN_NOT_FINITE);
    assert_ok(cairn_map_merge_score(f.merge, 0, 1, cairn_pose_identity(), &score));
    assert_near(score.psi, 0, 0);
    assert_int_equal(cairn_map_merge_mode(f.merge, 0, 1, 0, &pose, &evidence), 0);
    assert_int_equal(cairn_map_merge_mode(f.merge, 0, 0, 0, &pose, &evidence), 0);
    test_pool_free(&f.pool);
}

/* ---- Maps that overlap ---- */

static int32_t placed_of_27(world (*make)(uint64_t seed), double apart)
{
    cairn_map_merge_params p = small_params();
    struct fixture f = merge_with(&p);
    int32_t placed = 0;

    for (uint64_t seed = 1; seed <= 3; seed++) {
        world w = make(seed);
        view *views[3];

        three_views_apart(&w, views, apart);
        for (int32_t reference = 0; reference < 3; reference++) {
            cairn_map_merge_result r;

            merge_views(f.merge, views, 3, reference);
            r = cairn_map_merge_read(f.merge);
            assert_int_equal(r.maps, 3);
            assert_int_equal(r.reference, reference);
            assert_true(r.units > 0 && r.hypotheses > 0);
            placed += r.placed;
            for (int32_t i = 0; i < 3; i++)
                if (cairn_map_merge_of(f.merge, i).verdict == CAIRN_MAP_MERGE_PLACED)
                    assert_placed(f.merge, i, truth_of(views[reference], views[i]), 0.06);
            assert_int_equal(cairn_map_merge_of(f.merge, reference).rank, 0);
            assert_near(cairn_map_merge_of(f.merge, reference).error_probability, 0, 0);
        }
        free_views(views, 3);
    }
    test_pool_free(&f.pool);
    return placed;
}

static void test_maps_come_together(void **state)
{
    (void)state;
    assert_true(placed_of_27(rooms, 4) >= 24);
}

static void test_maps_without_a_straight_wall_come_together(void **state)
{
    (void)state;
    assert_int_equal(placed_of_27(cave, 2.6), 27);
}

static void test_known_order_and_other_resolution(void **state)
{
    const int32_t order[3] = {1, 0, 2};
    cairn_map_merge_params p = small_params();
    struct fixture f = merge_with(&p);
    world w = rooms(2);
    view *views[3];

    (void)state;
    three_views(&w, views);
    free(views[2]);
    views[2] = draw(&w, 4, 0.3, 1.4, 0.2, 7.2, 0.07, 0);
    cairn_map_merge_clear(f.merge);
    for (int32_t i = 0; i < 3; i++) {
        cairn_map_merge_map map = map_of(views[i]);

        assert_ok(cairn_map_merge_add(f.merge, &map, NULL));
    }
    assert_ok(cairn_map_merge_begin(f.merge, 1, order));
    run(f.merge, CAIRN_UNBOUNDED);
    for (int32_t i = 0; i < 3; i++) {
        assert_placed(f.merge, i, truth_of(views[1], views[i]), 0.08);
        assert_int_equal(cairn_map_merge_of(f.merge, order[i]).rank, i);
    }
    free_views(views, 3);
    test_pool_free(&f.pool);
}

/* Lengths are counted in cells of the first map: the same images with other cell sizes give the
 * same places, scaled. */
static void test_size_of_cells_is_only_a_unit(void **state)
{
    cairn_map_merge_params p = small_params();
    struct fixture f = merge_with(&p);
    world w = rooms(1);
    view *views[3];
    cairn_pose before[3];

    (void)state;
    three_views(&w, views);
    merge_views(f.merge, views, 3, 0);
    for (int32_t i = 0; i < 3; i++) {
        before[i] = cairn_map_merge_of(f.merge, i).reference_map;
        views[i]->resolution = 0.4;
    }
    merge_views(f.merge, views, 3, 0);
    for (int32_t i = 0; i < 3; i++) {
        cairn_pose after = cairn_map_merge_of(f.merge, i).reference_map;

        assert_int_equal(cairn_map_merge_of(f.merge, i).verdict, CAIRN_MAP_MERGE_PLACED);
        assert_near(after.x, before[i].x * 8, NUMBER(1e-6, 0.05));
        assert_near(after.y, before[i].y * 8, NUMBER(1e-6, 0.05));
        assert_near(after.theta, before[i].theta, NUMBER(1e-9, 1e-3));
    }
    free_views(views, 3);
    test_pool_free(&f.pool);
}

static void test_budgets_do_not_matter(void **state)
{
    static const int32_t units[] = {1, 7, 1000};
    cairn_map_merge_params p = small_params();
    struct fixture f = merge_with(&p);
    world w = rooms(1);
    view *views[3];
    uint64_t expected;

    (void)state;
    three_views(&w, views);
    merge_views(f.merge, views, 3, 0);
    expected = hash_of(f.merge, 3);
    assert_golden(expected, UINT64_C(0xa2e38048ef11c738), UINT64_C(0x1e6a9458945931f8));
    for (int k = 0; k < 3; k++) {
        assert_ok(cairn_map_merge_begin(f.merge, 0, NULL));
        run(f.merge, units[k]);
        assert_true(hash_of(f.merge, 3) == expected);
    }
    free_views(views, 3);
    test_pool_free(&f.pool);
}

/* Stages that begin without units keep the result of the stage before. */
static void test_a_stage_is_charged_before_it_begins(void **state)
{
    cairn_map_merge_params p = small_params();
    struct fixture f = merge_with(&p);
    cairn_map_merge_placed before[MAP_MERGE_MAX_MAPS];
    cairn_budget none = {0};
    world w = rooms(1);
    view *views[3];
    int32_t particles;

    (void)state;
    three_views(&w, views);
    merge_views(f.merge, views, 3, 0);
    memcpy(before, f.merge->placed, sizeof before);
    f.merge->placed[1].rank = before[1].rank = 7;
    assert_int_equal(cairn_map_merge_verify(f.merge, &none), 0);
    assert_memory_equal(f.merge->placed, before, sizeof before);
    particles = cairn_particle_filter_count(f.merge->filter);
    assert_true(particles > 1);
    assert_int_equal(cairn_map_merge_run_filter(f.merge, &none), 0);
    assert_int_equal(cairn_particle_filter_count(f.merge->filter), particles);
    assert_int_equal(none.left, 0);
    free_views(views, 3);
    test_pool_free(&f.pool);
}

static cairn_status begin_merge(void *context)
{
    return cairn_map_merge_begin(context, 0, NULL);
}

static cairn_status step_merge(void *context, cairn_budget *budget)
{
    return cairn_map_merge_step(context, budget);
}

static uint64_t hash_merge(void *context)
{
    return hash_of(context, 3);
}

static void test_begun_anew(void **state)
{
    cairn_map_merge_params p = small_params();
    struct fixture f = merge_with(&p);
    world w = rooms(1);
    view *views[3];
    test_stepped object = {begin_merge, step_merge, hash_merge, f.merge};

    (void)state;
    three_views(&w, views);
    merge_views(f.merge, views, 3, 0);
    test_begins_anew(&object, 12);
    free_views(views, 3);
    test_pool_free(&f.pool);
}

static void test_a_guess_is_kept(void **state)
{
    cairn_map_merge_params p = small_params();
    struct fixture f = merge_with(&p);
    world w = rooms(3);
    view *views[2] = {draw(&w, 0, 0, 0.1, -3, 3, 0.05, 0), draw(&w, 1, 0, 0.7, -2, 4, 0.05, 0)};
    cairn_pose truth = truth_of(views[0], views[1]), off = truth;

    (void)state;
    cairn_map_merge_clear(f.merge);
    for (int32_t i = 0; i < 2; i++) {
        cairn_map_merge_map map = map_of(views[i]);

        assert_ok(cairn_map_merge_add(f.merge, &map, NULL));
    }
    off.x += CAIRN_REAL(0.02);
    assert_ok(cairn_map_merge_guess(f.merge, 1, off));
    assert_ok(cairn_map_merge_begin(f.merge, 0, NULL));
    run(f.merge, CAIRN_UNBOUNDED);
    assert_placed(f.merge, 1, truth, 0.04);
    off.x += 3; /* a wrong one does no harm */
    off.theta += 1;
    assert_ok(cairn_map_merge_guess(f.merge, 1, off));
    assert_ok(cairn_map_merge_begin(f.merge, 0, NULL));
    run(f.merge, CAIRN_UNBOUNDED);
    assert_placed(f.merge, 1, truth, 0.04);
    free_views(views, 2);
    test_pool_free(&f.pool);
}

static void test_no_more_corners_than_allowed(void **state)
{
    world w = rooms(1);
    view *views[3];

    (void)state;
    three_views(&w, views);
    for (int32_t most = 1; most <= 3; most++) {
        cairn_map_merge_params p = small_params();
        struct fixture f;

        p.max_corners = most;
        f = merge_with(&p);
        merge_views(f.merge, views, 3, 0);
        for (int32_t i = 0; i < 3; i++)
            assert_int_equal(cairn_map_merge_of(f.merge, i).corners, most);
        test_pool_free(&f.pool);
    }
    free_views(views, 3);
}

/* A guess counts as a mode of its own unless the search has found the same one; either map may be
 * the reference. */
static void test_a_guess_is_a_candidate_at_its_pose(void **state)
{
    cairn_map_merge_params p = small_params();
    struct fixture f;
    world w = rooms(3);
    view *views[2] = {draw(&w, 0, 0, 0.1, -3, 3, 0.05, 0), draw(&w, 1, 0, 0.7, -2, 4, 0.05, 0)};

    (void)state;
    p.max_modes = 1;
    f = merge_with(&p);
    for (int32_t reference = 0; reference < 2; reference++)
        for (int32_t wrong = 0; wrong < 2; wrong++) {
            cairn_pose guess = truth_of(views[reference], views[1 - reference]);

            cairn_map_merge_clear(f.merge);
            for (int32_t i = 0; i < 2; i++) {
                cairn_map_merge_map map = map_of(views[i]);

                assert_ok(cairn_map_merge_add(f.merge, &map, NULL));
            }
            guess.x += CAIRN_REAL(0.02) + (cairn_real)wrong;
            assert_ok(cairn_map_merge_guess(f.merge, 1 - reference, guess));
            assert_ok(cairn_map_merge_begin(f.merge, reference, NULL));
            run(f.merge, CAIRN_UNBOUNDED);
            assert_int_equal(cairn_map_merge_of(f.merge, 1 - reference).modes, 1 + wrong);
        }
    free_views(views, 2);
    test_pool_free(&f.pool);
}

/* ---- Maps that do not overlap ---- */

static void test_unrelated_maps_are_refused(void **state)
{
    cairn_map_merge_params p = small_params();
    struct fixture f = merge_with(&p);

    (void)state;
    for (uint64_t seed = 1; seed <= 2; seed++) {
        world w = rooms(seed), other = rooms(seed + 100);
        view *views[4];

        three_views(&w, views);
        free(views[2]);
        views[2] = draw(&other, 4, 0.3, 1.4, 1.2, 7.2, 0.05, 0);
        views[3] = draw(&w, 4, 0, 0.5, 1.2, 7.2, 0.05, 1);
        merge_views(f.merge, views, 4, 0);
        assert_placed(f.merge, 1, truth_of(views[0], views[1]), 0.06);
        for (int32_t i = 2; i < 4; i++) {
            cairn_map_merge_placed placed = cairn_map_merge_of(f.merge, i);

            assert_int_not_equal(placed.verdict, CAIRN_MAP_MERGE_PLACED);
            assert_true(placed.error_probability > CAIRN_REAL(0.05));
            assert_true(placed.rank >= 2);
        }
        free_views(views, 4);
    }
    test_pool_free(&f.pool);
}

/* A map that shares nothing with those before it is deferred until its neighbour is placed. */
static void test_a_map_may_come_too_early(void **state)
{
    const int32_t order[3] = {0, 2, 1};
    cairn_map_merge_params p = small_params();
    struct fixture f = merge_with(&p);

    (void)state;
    for (uint64_t seed = 1; seed <= 5; seed++) {
        world w = rooms(seed);
        view *views[3];

        three_views(&w, views);
        cairn_map_merge_clear(f.merge);
        for (int32_t i = 0; i < 3; i++) {
            cairn_map_merge_map map = map_of(views[i]);

            assert_ok(cairn_map_merge_add(f.merge, &map, NULL));
        }
        assert_ok(cairn_map_merge_begin(f.merge, 0, order));
        run(f.merge, CAIRN_UNBOUNDED);
        for (int32_t i = 1; i < 3; i++)
            assert_placed(f.merge, i, truth_of(views[0], views[i]), 0.06);
        free_views(views, 3);
    }
    test_pool_free(&f.pool);
}

static void test_coarser_cells(void **state)
{
    uint8_t cells[15] = {0, 254, 205, 254, 254, 205, 205, 254, 254, 254, 77, 205, 205, 205, 0},
            out[6];
    cairn_raster_u8_view fine = {cells, 5, 3, 5};
    cairn_raster_u8 coarse = {out, 3, 2, 3}, wrong = coarse;
    const uint8_t expected[6] = {0, 254, 254, 205, 205, 0};
    uint8_t same_cells[10];
    cairn_raster_u8_view part = {cells, 5, 2, 5};
    cairn_raster_u8 same = {same_cells, 5, 2, 5};

    (void)state;
    assert_ok(cairn_map_merge_coarsen(part, 1, same));
    assert_memory_equal(same_cells, cells, 10);
    assert_ok(cairn_map_merge_coarsen(fine, 2, coarse));
    assert_memory_equal(out, expected, 6);
    assert_status(cairn_map_merge_coarsen(fine, 0, coarse), CAIRN_BAD_ARGUMENT);
    wrong.width = 2;
    assert_status(cairn_map_merge_coarsen(fine, 2, wrong), CAIRN_BAD_ARGUMENT);
    wrong = coarse;
    wrong.height = 1;
    assert_status(cairn_map_merge_coarsen(fine, 2, wrong), CAIRN_BAD_ARGUMENT);
    wrong.data = NULL;
    assert_status(cairn_map_merge_coarsen(fine, 2, wrong), CAIRN_BAD_ARGUMENT);
    fine.data = NULL;
    assert_status(cairn_map_merge_coarsen(fine, 2, coarse), CAIRN_BAD_ARGUMENT);
}

/* Nothing is known of a map that could not be placed, whatever was at its index before. */
static void assert_nothing_in(const cairn_map_merge *merge, int32_t map)
{
    cairn_map_merge_placed p = cairn_map_merge_of(merge, map);

    assert_int_equal(p.verdict, CAIRN_MAP_MERGE_EMPTY);
    assert_near(p.reference_map.x, 0, 0);
    assert_near(p.reference_map.y, 0, 0);
    assert_near(p.reference_map.theta, 0, 0);
    assert_near(p.support, 0, 0);
    assert_near(p.competing_support, 0, 0);
    assert_near(p.error_probability, 1, 0);
    assert_int_equal(p.neighbours, 0);
    assert_int_equal(p.modes, 0);
}

static void test_nothing_in_a_map(void **state)
{
    cairn_map_merge_params p = small_params();
    struct fixture f = merge_with(&p);
    world w = rooms(1), none = {.top = 8, .bottom = -8};
    view *views[4];

    (void)state;
    three_views(&w, views);
    merge_views(f.merge, views, 3, 0);
    assert_int_equal(cairn_map_merge_of(f.merge, 2).verdict, CAIRN_MAP_MERGE_PLACED);
    free(views[2]);
    views[2] = draw(&none, 0, 0, 0, -7, 7, 0.05, 0); /* no wall */
    views[3] = draw(&w, 50, 0, 0, 40, 60, 0.05, 0);  /* all unknown */
    merge_views(f.merge, views, 4, 0);
    assert_int_equal(cairn_map_merge_of(f.merge, 1).verdict, CAIRN_MAP_MERGE_PLACED);
    assert_nothing_in(f.merge, 2);
    assert_nothing_in(f.merge, 3);
    merge_views(f.merge, &views[3], 1, 0); /* alone */
    assert_int_equal(cairn_map_merge_read(f.merge).placed, 1);
    free_views(views, 4);
    test_pool_free(&f.pool);
}

/* Half a metre of overlap is tried at least: no translation of two maps that are smaller. */
static void test_maps_without_a_translation(void **state)
{
    enum { WIDTH = 14, HEIGHT = 6 };
    static uint8_t cells[2][WIDTH * HEIGHT];
    const int32_t walls[2] = {10, 6};
    cairn_map_merge_params p = small_params();
    struct fixture f = merge_with(&p);

    (void)state;
    cairn_map_merge_clear(f.merge);
    for (int32_t i = 0; i < 2; i++) {
        cairn_map_merge_map map = {{cells[i], WIDTH, HEIGHT, WIDTH}, CAIRN_REAL(0.05), {0, 0, 0}};

        memset(cells[i], CAIRN_OCCUPANCY_GRID_UNKNOWN, sizeof cells[i]);
        memset(cells[i] + 2 * WIDTH + 2, CAIRN_OCCUPANCY_GRID_OCCUPIED, (size_t)walls[i]);
        memset(cells[i] + 3 * WIDTH + 2, CAIRN_OCCUPANCY_GRID_FREE, (size_t)walls[i]);
        assert_ok(cairn_map_merge_add(f.merge, &map, NULL));
    }
    assert_ok(cairn_map_merge_begin(f.merge, 0, NULL));
    run(f.merge, CAIRN_UNBOUNDED);
    assert_int_equal(f.merge->maps[0].line_count, 1);
    assert_int_equal(f.merge->maps[1].line_count, 1);
    assert_int_equal(cairn_map_merge_read(f.merge).hypotheses, 0);
    assert_int_equal(cairn_map_merge_of(f.merge, 1).verdict, CAIRN_MAP_MERGE_NO_OVERLAP);
    test_pool_free(&f.pool);
}

static void test_identical_maps(void **state)
{
    cairn_map_merge_params p = small_params();
    struct fixture f = merge_with(&p);
    world w = rooms(1);
    view *views[2] = {draw(&w, 0, 0, 0.1, -3, 3, 0.05, 0), draw(&w, 0, 0, 0.1, -3, 3, 0.05, 0)};

    (void)state;
    merge_views(f.merge, views, 2, 0);
    assert_placed(f.merge, 1, cairn_pose_identity(), 0.01);
    free_views(views, 2);
    test_pool_free(&f.pool);
}

/* A straight corridor without ends: the position along it is unobservable. */
static void test_corridor_is_refused(void **state)
{
    cairn_map_merge_params p = small_params();
    struct fixture f = merge_with(&p);
    world w = {.top = 3, .bottom = -3};
    view *views[2];

    (void)state;
    add_box(&w, 0, 0.8, 20, 0.05, 0);
    add_box(&w, 0, -0.8, 20, 0.05, 0);
    views[0] = draw(&w, 0, 0, 0.2, -2.5, 2.5, 0.05, 0);
    views[1] = draw(&w, 1, 0.1, 0.9, -1.5, 3.5, 0.05, 0);
    merge_views(f.merge, views, 2, 0);
    assert_int_not_equal(cairn_map_merge_of(f.merge, 1).verdict, CAIRN_MAP_MERGE_PLACED);
    assert_int_not_equal(cairn_map_merge_of(f.merge, 1).verdict, CAIRN_MAP_MERGE_EMPTY);
    free_views(views, 2);
    test_pool_free(&f.pool);
}

/* A corridor whose end only the second map has: moved away from the first one it contradicts
 * nothing, moved into it it does. So one of the tested translations alone keeps the support, whatever
 * its direction in the frame of the reference. */
static void test_a_corridor_with_one_end_is_refused_in_every_frame(void **state)
{
    enum { HEADINGS = 8 };
    cairn_map_merge_params p = small_params();
    world w = {.top = 3, .bottom = -3};
    struct fixture f;

    (void)state;
    /* the corridor turned round is another place, nearly as good */
    p.min_margin = 0;
    f = merge_with(&p);
    add_box(&w, 0, 0.8, 20, 0.05, 0);
    add_box(&w, 0, -1.1, 20, 0.05, 0);
    add_box(&w, 2.5, 0, 0.05, 0.8, 0);
    for (int32_t i = 0; i < HEADINGS; i++) {
        view *views[2] = {draw(&w, 0, 0, 2 * PI * i / HEADINGS, -2.5, 2.4, 0.05, 0),
                          draw(&w, 0.5, 0.1, 0.9, -2, 2.7, 0.05, 0)};

        merge_views(f.merge, views, 2, 0);
        assert_int_equal(cairn_map_merge_of(f.merge, 1).verdict, CAIRN_MAP_MERGE_UNOBSERVABLE);
        free_views(views, 2);
    }
    test_pool_free(&f.pool);
}

/* ---- Scores by a reference implementation: all pairs of cells ---- */

/* Cells of a class, and whether they belong to the surface (occupied beside free). */
static int is_surface(const view *v, int32_t i)
{
    int32_t x = i % SIDE, y = i / SIDE;

    return v->cells[i] == CAIRN_OCCUPANCY_GRID_OCCUPIED &&
           ((x > 0 && v->cells[i - 1] == CAIRN_OCCUPANCY_GRID_FREE) ||
            (x + 1 < SIDE && v->cells[i + 1] == CAIRN_OCCUPANCY_GRID_FREE) ||
            (y > 0 && v->cells[i - SIDE] == CAIRN_OCCUPANCY_GRID_FREE) ||
            (y + 1 < SIDE && v->cells[i + SIDE] == CAIRN_OCCUPANCY_GRID_FREE));
}

/* s(from, to, c1, c2) with kernel exp(-x^2 / 8), or exact agreement, over all cells of the class
 * (surface of walls). */
static double slow_s(const view *from, const view *to, int32_t dx, int32_t dy, uint8_t c1,
                     uint8_t c2, int exact)
{
    double sum = 0;
    int32_t count = 0;

    for (int32_t i = 0; i < SIDE * SIDE; i++) {
        int32_t x = i % SIDE + dx, y = i / SIDE + dy, least = 1000;

        if (c1 == CAIRN_OCCUPANCY_GRID_OCCUPIED ? !is_surface(from, i) : from->cells[i] != c1)
            continue;
        count++;
        if (x < 0 || y < 0 || x >= SIDE || y >= SIDE)
            continue;
        if (exact) {
            sum += to->cells[y * SIDE + x] == c2;
            continue;
        }
        for (int32_t v = y - 20; v <= y + 20; v++)
            for (int32_t u = x - 20; u <= x + 20; u++)
                if (u >= 0 && v >= 0 && u < SIDE && v < SIDE && to->cells[v * SIDE + u] == c2 &&
                    abs(u - x) + abs(v - y) < least)
                    least = abs(u - x) + abs(v - y);
        sum += least <= 20 ? exp(-least * least / 8.0) : 0;
    }
    return sum / count;
}

static void test_images_equal_the_slow_way(void **state)
{
    cairn_map_merge_params p = small_params();
    struct fixture f;
    world w = rooms(4);
    view *views[2] = {draw(&w, 0, 0, 0, -2, 2, 0.05, 0), draw(&w, 0.5, 0.25, 0, -1, 3, 0.05, 0)};
    const uint8_t class[2] = {CAIRN_OCCUPANCY_GRID_OCCUPIED, CAIRN_OCCUPANCY_GRID_FREE};

    (void)state;
    p.max_points = 1 << 14; /* all cells */
    f = merge_with(&p);
    merge_views(f.merge, views, 2, 0);
    for (int32_t shift = 0; shift < 3; shift++) {
        int32_t dx = 10 - 3 * shift, dy = 5 + 2 * shift;
        cairn_pose pose = {(cairn_real)(dx * 0.05 + 1e-4), (cairn_real)(dy * 0.05 + 1e-4), 0};
        double psi = 0, d = 0;
        cairn_map_merge_pair_score score;

        for (int k = 0; k < 2; k++) {
            psi += slow_s(views[1], views[0], dx, dy, class[k], class[k], 0);
            psi += slow_s(views[0], views[1], -dx, -dy, class[k], class[k], 0);
            d += slow_s(views[1], views[0], dx, dy, class[k], class[1 - k], 1);
            d += slow_s(views[0], views[1], -dx, -dy, class[k], class[1 - k], 1);
        }
        assert_ok(cairn_map_merge_score(f.merge, 0, 1, pose, &score));
        assert_near(score.psi, psi, 0.02);
        assert_near(score.disagreement, d, 0.02);
        assert_near(score.gamma,
                    -log(fmax((double)score.disagreement, 1e-6)) - (double)score.disagreement,
                    1e-4);
        if (shift == 0) { /* the truth */
            assert_true(score.agreeing_wall > 3 && score.free_space_violation < CAIRN_REAL(0.3));
            assert_near(
                score.log_likelihood_ratio,
                (1.7 * (double)score.agreeing_wall - 4 * (double)score.free_space_violation) / 0.5,
                1e-3);
            assert_true(score.overlap > CAIRN_REAL(0.6) && score.overlap < CAIRN_REAL(0.9));
        } else {
            assert_true(score.log_likelihood_ratio < 0);
        }
    }
    free_views(views, 2);
    test_pool_free(&f.pool);
}

/* Runs the filter again, after a merging. */
static int32_t units_of_filter(cairn_map_merge *merge, cairn_map_merge_perception perception)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    merge->params.perception = perception;
    assert_int_equal(cairn_map_merge_run_filter(merge, &budget), 1);
    return CAIRN_UNBOUNDED - budget.left;
}

/* The images of each candidate are charged: half a unit for a point. */
static void test_images_are_charged(void **state)
{
    cairn_map_merge_params p = small_params();
    struct fixture f;
    world w = rooms(1);
    view *views[3];
    int32_t units;

    (void)state;
    p.particles = 1;
    f = merge_with(&p);
    three_views(&w, views);
    merge_views(f.merge, views, 2, 0);
    assert_int_equal(cairn_map_merge_read(f.merge).placed, 2);
    units = units_of_filter(f.merge, CAIRN_MAP_MERGE_LIKELIHOOD_RATIO);
    assert_true(units_of_filter(f.merge, CAIRN_MAP_MERGE_IMAGES) >
                units + f.merge->maps[0].point_count / 2);
    free_views(views, 3);
    test_pool_free(&f.pool);
}

/* The perception of the thesis: fewer places are found, none of the accepted ones is wrong. */
static void test_images_as_perception(void **state)
{
    cairn_map_merge_params p = small_params();
    struct fixture f;
    world w = rooms(1);
    view *views[3];

    (void)state;
    p.perception = CAIRN_MAP_MERGE_IMAGES;
    f = merge_with(&p);
    three_views(&w, views);
    merge_views(f.merge, views, 3, 1);
    for (int32_t i = 0; i < 3; i++)
        if (cairn_map_merge_of(f.merge, i).verdict == CAIRN_MAP_MERGE_PLACED)
            assert_placed(f.merge, i, truth_of(views[1], views[i]), 0.06);
    assert_true(cairn_map_merge_read(f.merge).placed >= 2);
    free_views(views, 3);
    test_pool_free(&f.pool);
}

/* Psi and gamma of a placed map are those relative to the map of largest overlap before it. */
static void test_images_are_scored_where_the_overlap_is_largest(void **state)
{
    cairn_map_merge_params p = small_params();
    struct fixture f;
    world w = rooms(1);
    view *views[3];
    int32_t placed = 0;

    (void)state;
    p.perception = CAIRN_MAP_MERGE_IMAGES;
    f = merge_with(&p);
    three_views_apart(&w, views, 2);
    merge_views(f.merge, views, 3, 1);
    for (const map_merge_state *s = cairn_particle_filter_particle(f.merge->filter, 0).state;
         s != NULL; s = cairn_particle_filter_state_before(s)) {
        cairn_map_merge_pair_score score, wanted = {.overlap = -1};

        for (const map_merge_state *b = cairn_particle_filter_state_before(s); b != NULL;
             b = cairn_particle_filter_state_before(b)) {
            if (s->map < 0 || b->map < 0)
                continue;
            cairn_map_merge_score_at(f.merge, b->map, s->map,
                                     cairn_pose_between(b->reference_map, s->reference_map),
                                     &score);
            placed++;
            if (score.overlap > wanted.overlap)
                wanted = score;
        }
        if (wanted.overlap < 0)
            continue;
        assert_true(wanted.psi > 0);
        assert_true(s->psi == wanted.psi && s->gamma == wanted.gamma);
    }
    assert_int_equal(placed, 1 + 2); /* neighbours of the second and of the third map */
    free_views(views, 3);
    test_pool_free(&f.pool);
}

static void test_modes_can_be_read(void **state)
{
    cairn_map_merge_params p = small_params();
    struct fixture f = merge_with(&p);
    world w = rooms(1);
    view *views[3];
    cairn_pose there, back;
    cairn_real evidence, same, last = CAIRN_REAL_MAX;
    int32_t count = 0;

    (void)state;
    three_views(&w, views);
    merge_views(f.merge, views, 3, 0);
    assert_int_equal(cairn_map_merge_mode(f.merge, 0, 1, 0, &there, &evidence), 1);
    assert_int_equal(cairn_map_merge_mode(f.merge, 1, 0, 0, &back, &same), 1);
    assert_true(evidence == same);
    back = cairn_pose_compose(there, back);
    assert_near(back.x, 0, 1e-5);
    assert_near(back.y, 0, 1e-5);
    for (; cairn_map_merge_mode(f.merge, 0, 1, count, &there, &evidence); count++) {
        assert_true(evidence <= last && evidence > 0);
        last = evidence;
    }
    assert_in_range(count, 1, p.max_modes);
    assert_int_equal(cairn_map_merge_mode(f.merge, 0, 1, -1, &there, &evidence), 0);
    assert_int_equal(cairn_map_merge_mode(f.merge, 0, 3, 0, &there, &evidence), 0);
    for (cairn_map_merge_verdict v = CAIRN_MAP_MERGE_PLACED; v <= CAIRN_MAP_MERGE_UNOBSERVABLE; v++)
        assert_string_not_equal(cairn_map_merge_verdict_text(v),
                                cairn_map_merge_verdict_text(v + 1));
    free_views(views, 3);
    test_pool_free(&f.pool);
}

static uint64_t hash_real(uint64_t hash, cairn_real x)
{
    return test_hash(hash, &x, sizeof x);
}

static uint64_t hash_pose(uint64_t hash, cairn_pose p)
{
    return hash_real(hash_real(hash_real(hash, p.x), p.y), p.theta);
}

/* All readable results of a merging: places, competing hypotheses, scores at them and beside
 * them. */
static uint64_t hash_merging(const cairn_map_merge *merge, int32_t maps)
{
    cairn_map_merge_result result = cairn_map_merge_read(merge);
    uint64_t hash = test_hash(TEST_HASH_START, &result.units, sizeof result.units);

    hash = hash_real(test_hash(hash, &result.hypotheses, sizeof result.hypotheses),
                     result.log_likelihood_ratio);
    for (int32_t b = 0; b < maps; b++) {
        cairn_map_merge_placed placed = cairn_map_merge_of(merge, b);

        hash = test_hash(test_hash(hash, &placed.corners, sizeof placed.corners), &placed.verdict,
                         sizeof placed.verdict);
        hash = hash_real(hash_real(hash_real(hash_pose(hash, placed.reference_map), placed.support),
                                   placed.competing_support),
                         placed.error_probability);
        for (int32_t a = 0; a < b; a++) {
            cairn_pose a_b;
            cairn_real evidence;

            for (int32_t k = 0; cairn_map_merge_mode(merge, a, b, k, &a_b, &evidence); k++) {
                cairn_map_merge_pair_score score;

                hash = hash_real(hash_pose(hash, a_b), evidence);
                a_b.x += CAIRN_REAL(0.06);
                assert_ok(cairn_map_merge_score(merge, a, b, a_b, &score));
                hash = hash_real(
                    hash_real(hash_real(hash, score.log_likelihood_ratio), score.agreeing_wall),
                    score.free_space_violation);
                hash = hash_real(hash_real(hash_real(hash, score.overlap), score.psi),
                                 score.disagreement);
            }
        }
    }
    return hash;
}

/* Surfaces, normals, lines, corners and refinements to their last bit: with default capacities,
 * with fewer points and lines than the maps have, and with a map of coarser cells that is a part of
 * a larger image. */
static void test_bits_stay(void **state)
{
    static const struct {
        uint64_t in_double, in_float;
    } golden[] = {{UINT64_C(0xf6cf7fac603f217a), UINT64_C(0x61d6b9bcce389c9d)},
                  {UINT64_C(0x2b55bd1ac0e932f8), UINT64_C(0x939182cfffc8cbd1)},
                  {UINT64_C(0x2e52f38c4122e116), UINT64_C(0x943ab7b19b23c282)}};

    (void)state;
    for (int k = 0; k < 3; k++) {
        cairn_map_merge_params p = small_params();
        world w = rooms((uint64_t)k + 1);
        struct fixture f;
        view *views[3];

        if (k == 1) {
            p.max_points = 300;
            p.max_segments = 24;
            p.max_corners = 12;
        }
        f = merge_with(&p);
        three_views(&w, views);
        if (k == 2) {
            free(views[1]);
            views[1] = draw(&w, 0, 0.2, -2.1, -3.2, 3.2, 0.08, 0);
        }
        merge_views(f.merge, views, 3, k);
        for (int32_t i = 0; i < 3; i++)
            assert_placed(f.merge, i, truth_of(views[k], views[i]), k < 2 ? 0.03 : 0.06);
        assert_golden(hash_merging(f.merge, 3), golden[k].in_double, golden[k].in_float);
        free_views(views, 3);
        test_pool_free(&f.pool);
    }
}

/* A map whose cells are smaller than it says by 4 % lies on the middle of the other one, although
 * their walls agree better on one side: within 0.034 m in the mean, by lines alone within 0.043 m in
 * double, 0.039 m in float. */
static void test_stretched_maps_lie_in_the_middle(void **state)
{
    enum { WORLDS = 8 };
    cairn_map_merge_params p = small_params();
    struct fixture f = merge_with(&p);
    double sum = 0;

    (void)state;
    for (uint64_t k = 1; k <= WORLDS; k++) {
        world w = rooms(k);
        view *views[2] = {draw(&w, 0, 0, 0.3, -7.2, 7.2, 0.05, 0),
                          draw(&w, 0, 0.2, -2.1, -7.2, 7.2, 0.05, 0)};
        cairn_map_merge_placed placed;
        cairn_pose off;

        views[1]->resolution *= 1.04;
        merge_views(f.merge, views, 2, 0);
        placed = cairn_map_merge_of(f.merge, 1);
        assert_int_equal(placed.verdict, CAIRN_MAP_MERGE_PLACED);
        off = cairn_pose_between(truth_of(views[0], views[1]), placed.reference_map);
        sum += hypot((double)off.x, (double)off.y);
        free_views(views, 2);
    }
    assert_true(sum / WORLDS < 0.034);
    test_pool_free(&f.pool);
}

/* 1 when the last map took steps of the registration of distorted maps: fewer rounds are left than
 * at its start. The merging is not used afterwards. */
static int took_steps_of_distorted_maps(cairn_map_merge *merge)
{
    int32_t left = merge->fit.rounds;

    cairn_map_merge_begin_average(merge, merge->fit.map, merge->fit.pose);
    return left < merge->fit.rounds;
}

static void test_budgets_do_not_matter_to_distorted_maps(void **state)
{
    static const int32_t units[] = {1, 7, 1000};
    cairn_map_merge_params p = small_params();
    struct fixture f = merge_with(&p);
    world w = rooms(1);
    view *views[2] = {draw(&w, 0, 0, 0.3, -7.2, 7.2, 0.05, 0),
                      draw(&w, 0, 0.2, -2.1, -7.2, 7.2, 0.05, 0)};
    uint64_t expected;

    (void)state;
    views[1]->resolution *= 1.04;
    merge_views(f.merge, views, 2, 0);
    expected = hash_of(f.merge, 2);
    for (int k = 0; k < 3; k++) {
        assert_ok(cairn_map_merge_begin(f.merge, 0, NULL));
        run(f.merge, units[k]);
        assert_true(hash_of(f.merge, 2) == expected);
    }
    assert_true(took_steps_of_distorted_maps(f.merge));
    free_views(views, 2);
    test_pool_free(&f.pool);
}

/* Cells of twice the size are no distortion, from whichever map it is seen. */
static void test_coarser_maps_are_not_distorted(void **state)
{
    cairn_map_merge_params p = small_params();
    struct fixture f = merge_with(&p);

    (void)state;
    for (uint64_t k = 1; k <= 4; k++) {
        world w = rooms(k);
        view *views[2] = {draw(&w, 0, 0, 0.3, -7.2, 7.2, 0.05, 0),
                          draw(&w, 0, 0.2, -2.1, -7.2, 7.2, 0.1, 0)};

        for (int32_t reference = 0; reference < 2; reference++) {
            merge_views(f.merge, views, 2, reference);
            assert_placed(f.merge, 1 - reference, truth_of(views[reference], views[1 - reference]),
                          0.03);
            assert_false(took_steps_of_distorted_maps(f.merge));
        }
        free_views(views, 2);
    }
    test_pool_free(&f.pool);
}

/* ---- Error probabilities ---- */

static void test_error_probability_follows_the_ratio_of_the_supports(void **state)
{
    cairn_real before = 1;

    (void)state;
    for (int32_t support = 0; support <= 200; support += 5) {
        cairn_real least = 0;

        for (int32_t competing = 0; competing <= support; competing += 5) {
            cairn_real p =
                cairn_map_merge_error_probability((cairn_real)support, (cairn_real)competing);

            assert_true(p >= least && p >= CAIRN_REAL(0.001) && p < 1);
            least = p;
        }
        /* of two poses of equal support each is wrong as often as not, or more often */
        assert_true(least >= CAIRN_REAL(0.5));
        assert_true(cairn_map_merge_error_probability((cairn_real)support, 0) <= before);
        before = cairn_map_merge_error_probability((cairn_real)support, 0);
    }
    assert_near(before, 0.001, 1e-9);
    /* a pose that contradicts the maps is none */
    assert_near(cairn_map_merge_error_probability(-5, 3), cairn_map_merge_error_probability(0, 3),
                0);
    assert_near(cairn_map_merge_error_probability(3, -5), cairn_map_merge_error_probability(3, 0),
                0);
    /* more wall of both poses does not make the better one more certain */
    assert_true(cairn_map_merge_error_probability(40, 20) > CAIRN_REAL(0.03));
    assert_true(cairn_map_merge_error_probability(400, 200) > CAIRN_REAL(0.03));
}

static void test_placed_maps_have_the_error_probability_of_their_supports(void **state)
{
    cairn_map_merge_params p = small_params();
    struct fixture f = merge_with(&p);
    world w = rooms(1);
    view *views[3];

    (void)state;
    three_views(&w, views);
    merge_views(f.merge, views, 3, 0);
    for (int32_t i = 1; i < 3; i++) {
        cairn_map_merge_placed placed = cairn_map_merge_of(f.merge, i);

        assert_int_equal(placed.verdict, CAIRN_MAP_MERGE_PLACED);
        assert_near(placed.error_probability,
                    cairn_map_merge_error_probability(placed.support, placed.competing_support), 0);
    }
    free_views(views, 3);
    test_pool_free(&f.pool);
}

static void test_maps_are_coarsened_while_their_cells_suffice(void **state)
{
    int32_t k = 0, tries = 0;

    (void)state;
    assert_int_equal(cairn_map_merge_next_coarsening(0, 1), 1);
    assert_int_equal(cairn_map_merge_next_coarsening(0, 800), 1);
    assert_int_equal(cairn_map_merge_next_coarsening(0, 801), 2);
    assert_int_equal(cairn_map_merge_next_coarsening(1, 349), 0);
    assert_int_equal(cairn_map_merge_next_coarsening(1, 350), 2);
    assert_int_equal(cairn_map_merge_next_coarsening(1 << 30, 1 << 14), 0);
    while ((k = cairn_map_merge_next_coarsening(k, 4000)) > 0) {
        assert_in_range(4000 / k, 175, 800);
        tries++;
    }
    assert_int_equal(tries, 4);
}

static void test_a_merging_that_places_more_maps_is_better(void **state)
{
    cairn_map_merge_result best = {.placed = 2, .log_likelihood_ratio = 5}, other = best;
    cairn_map_merge_placed placed = {.error_probability = CAIRN_REAL(0.0095)};

    (void)state;
    assert_false(cairn_map_merge_is_better(&other, &best));
    other.log_likelihood_ratio = 6;
    assert_true(cairn_map_merge_is_better(&other, &best));
    best.placed = 3;
    assert_false(cairn_map_merge_is_better(&other, &best));
    assert_true(cairn_map_merge_is_better(&best, &other));
    assert_true(cairn_map_merge_is_sure(&placed));
    placed.error_probability = CAIRN_REAL(0.01);
    assert_true(cairn_map_merge_is_sure(&placed));
    placed.error_probability = CAIRN_REAL(0.011);
    assert_false(cairn_map_merge_is_sure(&placed));
    placed.error_probability = (cairn_real)NAN;
    assert_false(cairn_map_merge_is_sure(&placed));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_params_are_refused),
        cmocka_unit_test(test_the_largest_params_are_accepted),
        cmocka_unit_test(test_memory_is_exact),
        cmocka_unit_test(test_calls_are_refused),
        cmocka_unit_test(test_maps_come_together),
        cmocka_unit_test(test_maps_without_a_straight_wall_come_together),
        cmocka_unit_test(test_stretched_maps_lie_in_the_middle),
        cmocka_unit_test(test_budgets_do_not_matter_to_distorted_maps),
        cmocka_unit_test(test_coarser_maps_are_not_distorted),
        cmocka_unit_test(test_known_order_and_other_resolution),
        cmocka_unit_test(test_size_of_cells_is_only_a_unit),
        cmocka_unit_test(test_budgets_do_not_matter),
        cmocka_unit_test(test_a_stage_is_charged_before_it_begins),
        cmocka_unit_test(test_begun_anew),
        cmocka_unit_test(test_a_guess_is_kept),
        cmocka_unit_test(test_no_more_corners_than_allowed),
        cmocka_unit_test(test_a_guess_is_a_candidate_at_its_pose),
        cmocka_unit_test(test_unrelated_maps_are_refused),
        cmocka_unit_test(test_a_map_may_come_too_early),
        cmocka_unit_test(test_coarser_cells),
        cmocka_unit_test(test_nothing_in_a_map),
        cmocka_unit_test(test_maps_without_a_translation),
        cmocka_unit_test(test_identical_maps),
        cmocka_unit_test(test_corridor_is_refused),
        cmocka_unit_test(test_a_corridor_with_one_end_is_refused_in_every_frame),
        cmocka_unit_test(test_images_equal_the_slow_way),
        cmocka_unit_test(test_images_are_charged),
        cmocka_unit_test(test_images_as_perception),
        cmocka_unit_test(test_images_are_scored_where_the_overlap_is_largest),
        cmocka_unit_test(test_modes_can_be_read),
        cmocka_unit_test(test_error_probability_follows_the_ratio_of_the_supports),
        cmocka_unit_test(test_placed_maps_have_the_error_probability_of_their_supports),
        cmocka_unit_test(test_bits_stay),
        cmocka_unit_test(test_maps_are_coarsened_while_their_cells_suffice),
        cmocka_unit_test(test_a_merging_that_places_more_maps_is_better),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
