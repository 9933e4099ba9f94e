/* The redundancy of scans compared with counting all pairs of points. */
#include "tests/test.h"

#include <math.h>

#include "cairn/random.h"
#include "cairn/scan_redundancy.h"

enum { SCANS = 7, WALLS = 5, MAX_COUNT = 40 };

/* A set of scans with walls in all directions around neighbouring places. */
typedef struct world {
    cairn_pool pool;
    cairn_scan_set *set;
    cairn_pose pose[SCANS + 1];
} world;

/* One scan: walls of up to `points` points 0.1 m apart. */
static void add_scan(world *w, cairn_random *random, int32_t walls, int32_t points)
{
    cairn_oriented_point point[WALLS * MAX_COUNT];
    cairn_segment segment[WALLS];
    int32_t first[WALLS + 1] = {0};
    cairn_scan_view view = {0};

    for (int32_t k = 0; k < walls; k++) {
        int32_t count = cairn_random_below(random, points + 1);
        cairn_real angle = cairn_random_uniform(random, -3, 3);
        cairn_vec2 start, along = {cairn_cos(angle), cairn_sin(angle)};

        start.x = cairn_random_uniform(random, -2, 2);
        start.y = cairn_random_uniform(random, -2, 2);
        first[k + 1] = first[k] + count;
        segment[k].a = start;
        segment[k].b = cairn_vec2_add(start, cairn_vec2_scale(along, (cairn_real)count / 10));
        for (int32_t i = 0; i < count; i++) {
            point[first[k] + i].position =
                cairn_vec2_add(start, cairn_vec2_scale(along, (cairn_real)i / 10));
            point[first[k] + i].direction = along;
        }
    }
    view.segments = segment;
    view.first_point = first;
    view.points = point;
    view.segment_count = walls;
    view.point_count = first[walls];
    assert_ok(cairn_scan_set_add(w->set, &view, NULL, NULL));
}

static world make_world(uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 1);
    cairn_scan_set_params params = {.max_scans = SCANS + 1,
                                    .max_segments = (SCANS + 1) * WALLS,
                                    .max_points = (SCANS + 1) * WALLS * MAX_COUNT,
                                    .spacing = 0};
    world w;

    memset(&w, 0, sizeof w);
    w.pool = test_pool(1 << 20);
    assert_ok(cairn_scan_set_create(&w.set, &w.pool, &params));
    for (int32_t i = 0; i < SCANS; i++) {
        add_scan(&w, &random, WALLS, MAX_COUNT);
        w.pose[i].x = cairn_random_uniform(&random, -1, 1);
        w.pose[i].y = cairn_random_uniform(&random, -1, 1);
        w.pose[i].theta = cairn_random_uniform(&random, -3, 3);
    }
    return w;
}

static cairn_scan_redundancy_params small_params(void)
{
    cairn_scan_redundancy_params params = cairn_scan_redundancy_default();

    params.max_scans = SCANS + 1;
    params.max_points = (SCANS + 1) * WALLS * MAX_COUNT;
    return params;
}

static cairn_scan_redundancy *make_cover(world *w, cairn_scan_redundancy_params params)
{
    cairn_scan_redundancy *cover;

    assert_ok(cairn_scan_redundancy_create(&cover, &w->pool, &params));
    return cover;
}

static void run(cairn_scan_redundancy *cover, int32_t units, int64_t *used)
{
    cairn_status status = CAIRN_MORE;

    *used = 0;
    while (status == CAIRN_MORE) {
        cairn_budget budget = {units};

        status = cairn_scan_redundancy_step(cover, &budget);
        assert_true(budget.left >= 0);
        *used += units - budget.left;
    }
    assert_int_equal(status, CAIRN_OK);
}

/* 1 when a point of one segment coincides with one of another. */
static int shows(const world *w, cairn_scan_redundancy_params params, int32_t s, int32_t i,
                 int32_t t, int32_t j)
{
    const cairn_scan_set_segment *a = &w->set->segments[s], *b = &w->set->segments[t];
    cairn_transform to_a = cairn_transform_of(w->pose[a->scan]),
                    to_b = cairn_transform_of(w->pose[b->scan]);
    cairn_vec2 p = cairn_transform_point(to_a, w->set->points[a->first_point + i]);
    cairn_vec2 q = cairn_transform_point(to_b, w->set->points[b->first_point + j]);
    cairn_vec2 d = cairn_transform_direction(to_a, a->direction),
               e = cairn_transform_direction(to_b, b->direction);

    return cairn_vec2_norm_squared(cairn_vec2_sub(p, q)) <= params.radius * params.radius &&
           cairn_vec2_dot(d, e) >= cairn_cos(params.direction_gate);
}

static double loss_by_hand(const world *w, cairn_scan_redundancy_params params, int32_t scan)
{
    double loss = 0;

    for (int32_t s = 0; s < w->set->segment_count; s++)
        for (int32_t i = 0; i < w->set->segments[s].end_point - w->set->segments[s].first_point;
             i++) {
            int32_t covering[SCANS + 1] = {0}, scans = 0;

            if (w->set->segments[s].scan != scan)
                continue;
            for (int32_t t = 0; t < w->set->segment_count; t++)
                for (int32_t j = 0;
                     j < w->set->segments[t].end_point - w->set->segments[t].first_point; j++)
                    if (w->set->segments[t].scan >= 0 && w->set->segments[t].scan != scan &&
                        shows(w, params, s, i, t, j))
                        covering[w->set->segments[t].scan] = 1;
            for (int32_t k = 0; k <= SCANS; k++)
                scans += covering[k];
            loss += 1.0 / (1 + scans);
        }
    return loss;
}

static void losses_are_those_by_hand(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 6; seed++) {
        world w = make_world(seed);
        cairn_scan_redundancy_params params = small_params();
        cairn_scan_redundancy *cover;
        int32_t least = 0;
        int64_t used;

        params.radius = CAIRN_REAL(0.1) * (cairn_real)seed;
        params.direction_gate = seed == 6 ? CAIRN_PI : CAIRN_REAL(0.3) * (cairn_real)seed;
        cover = make_cover(&w, params);
        /* Twice: nothing is left over from the first time. */
        for (int32_t again = 0; again < 2; again++) {
            assert_ok(cairn_scan_redundancy_begin(cover, w.set, w.pose));
            run(cover, 1000, &used);
            for (int32_t i = 0; i < SCANS; i++) {
                double known = loss_by_hand(&w, params, i);

                assert_true(fabs((double)cairn_scan_redundancy_loss(cover, i) - known) < 1e-4);
                least = known < loss_by_hand(&w, params, least) ? i : least;
            }
            assert_int_equal(cairn_scan_redundancy_most_redundant(cover, -1), least);
        }
        test_pool_free(&w.pool);
    }
}

/* Of three scans of one wall and two of another the first of the three is chosen; when it is
 * excluded the second. */
static void the_most_redundant_scan_is_culled(void **state)
{
    cairn_scan_redundancy_params params = small_params();
    world w = make_world(1);
    cairn_scan_redundancy *cover;
    cairn_random random = cairn_random_seed(3, 1);
    int64_t used;

    (void)state;
    cairn_scan_set_clear(w.set);
    for (int32_t i = 0; i < 5; i++) {
        cairn_random same = cairn_random_seed(11, 1);

        add_scan(&w, &same, 2, MAX_COUNT);
        w.pose[i] = cairn_pose_identity();
        w.pose[i].x = i % 2 == 0 ? 0 : 50;
    }
    cover = make_cover(&w, params);
    assert_ok(cairn_scan_redundancy_begin(cover, w.set, w.pose));
    assert_int_equal(cairn_scan_redundancy_most_redundant(cover, -1), -1);
    run(cover, 1000, &used);
    assert_true(cairn_scan_redundancy_loss(cover, 0) < cairn_scan_redundancy_loss(cover, 1));
    assert_true(cairn_scan_redundancy_loss(cover, 0) == cairn_scan_redundancy_loss(cover, 4));
    assert_int_equal(cairn_scan_redundancy_most_redundant(cover, -1), 0);
    assert_int_equal(cairn_scan_redundancy_most_redundant(cover, 0), 2);
    /* With two of the three removed the first of the pair is chosen; empty slots have no loss. */
    assert_ok(cairn_scan_set_remove(w.set, 0));
    assert_ok(cairn_scan_set_remove(w.set, 2));
    w.pose[0].x = (cairn_real)NAN;
    assert_ok(cairn_scan_redundancy_begin(cover, w.set, w.pose));
    run(cover, 1000, &used);
    assert_true(cairn_scan_redundancy_loss(cover, 0) == -1 &&
                cairn_scan_redundancy_loss(cover, 2) == -1);
    assert_true(cairn_scan_redundancy_loss(cover, 4) > cairn_scan_redundancy_loss(cover, 3));
    assert_int_equal(cairn_scan_redundancy_most_redundant(cover, -1), 1);
    /* A scan without points is chosen at once. */
    add_scan(&w, &random, 0, MAX_COUNT);
    w.pose[2] = cairn_pose_identity();
    assert_ok(cairn_scan_redundancy_begin(cover, w.set, w.pose));
    run(cover, 1000, &used);
    assert_int_equal(cairn_scan_redundancy_most_redundant(cover, -1), 2);
    test_pool_free(&w.pool);
}

static void budgets_do_not_matter(void **state)
{
    static const int32_t units[] = {1, 7, 1000};
    cairn_real known[SCANS];
    world w = make_world(9);
    cairn_scan_redundancy *cover = make_cover(&w, small_params());
    cairn_budget budget = {0};
    int64_t all, used;

    (void)state;
    assert_ok(cairn_scan_redundancy_begin(cover, w.set, w.pose));
    run(cover, CAIRN_UNBOUNDED, &used);
    assert_ok(cairn_scan_redundancy_begin(cover, w.set, w.pose));
    run(cover, CAIRN_UNBOUNDED, &all);
    assert_int_equal(all, NUMBER(5370, 5551));
    for (int32_t i = 0; i < SCANS; i++)
        known[i] = cairn_scan_redundancy_loss(cover, i);
    for (size_t k = 0; k < sizeof units / sizeof *units; k++) {
        assert_ok(cairn_scan_redundancy_begin(cover, w.set, w.pose));
        assert_int_equal(cairn_scan_redundancy_step(cover, &budget), CAIRN_MORE);
        assert_true(cairn_scan_redundancy_loss(cover, 1) == -1);
        run(cover, units[k], &used);
        assert_int_equal(used, all);
        for (int32_t i = 0; i < SCANS; i++)
            assert_true(cairn_scan_redundancy_loss(cover, i) == known[i]);
    }
    /* Begun anew in the middle. */
    assert_ok(cairn_scan_redundancy_begin(cover, w.set, w.pose));
    budget.left = (int32_t)(all / 2);
    assert_int_equal(cairn_scan_redundancy_step(cover, &budget), CAIRN_MORE);
    assert_ok(cairn_scan_redundancy_begin(cover, w.set, w.pose));
    run(cover, 100, &used);
    for (int32_t i = 0; i < SCANS; i++)
        assert_true(cairn_scan_redundancy_loss(cover, i) == known[i]);
    test_pool_free(&w.pool);
}

/* ---- Refusals ---- */

static void a_radius_without_reciprocal_is_refused(void **state)
{
    cairn_scan_redundancy_params params = small_params();
    cairn_object_fault fault;

    (void)state;
    params.radius = CAIRN_REAL_MIN / 1024;
    assert_status(cairn_scan_redundancy_check(&params, &fault), CAIRN_BAD_ARGUMENT);
    assert_string_equal(fault.field, "radius");
    assert_int_equal(cairn_scan_redundancy_memory(&params), 0);
}

static void the_greatest_params_are_taken(void **state)
{
    cairn_scan_redundancy_params params = small_params();

    (void)state;
    params.max_scans = 1 << 20;
    params.max_points = 1 << 24;
    params.radius = CAIRN_REAL(1e6);
    params.direction_gate = CAIRN_PI;
    assert_true(cairn_scan_redundancy_memory(&params) > 0);
}

static cairn_status create(void *params, cairn_pool *pool)
{
    cairn_scan_redundancy *cover;

    return cairn_scan_redundancy_create(&cover, pool, params);
}

static void memory_is_exact(void **state)
{
    cairn_scan_redundancy_params params = small_params();
    cairn_scan_redundancy *cover;
    cairn_pool pool;

    (void)state;
    test_every_pool_size(create, &params, cairn_scan_redundancy_memory(&params));
    pool = test_pool(1 << 16);
    assert_int_equal(cairn_scan_redundancy_create(NULL, &pool, &params), CAIRN_BAD_ARGUMENT);
    assert_int_equal(cairn_scan_redundancy_create(&cover, NULL, &params), CAIRN_BAD_ARGUMENT);
    test_pool_free(&pool);
}

static void begin_refuses_bad_input(void **state)
{
    world w = make_world(2);
    cairn_scan_redundancy_params params = small_params();
    cairn_scan_redundancy *cover = make_cover(&w, params);
    cairn_budget budget = {10};
    cairn_pose kept;
    cairn_real known;
    int64_t used;

    (void)state;
    assert_true(cairn_scan_redundancy_loss(NULL, 0) == -1);
    assert_int_equal(cairn_scan_redundancy_most_redundant(NULL, 0), -1);
    assert_int_equal(cairn_scan_redundancy_most_redundant(cover, -1), -1);
    assert_int_equal(cairn_scan_redundancy_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_int_equal(cairn_scan_redundancy_step(cover, NULL), CAIRN_BAD_ARGUMENT);
    assert_int_equal(cairn_scan_redundancy_step(cover, &budget), CAIRN_OK);
    assert_int_equal(budget.left, 10);
    assert_ok(cairn_scan_redundancy_begin(cover, w.set, w.pose));
    run(cover, 1000, &used);
    known = cairn_scan_redundancy_loss(cover, 3);
    assert_true(known > 0);
    assert_int_equal(cairn_scan_redundancy_begin(NULL, w.set, w.pose), CAIRN_BAD_ARGUMENT);
    assert_int_equal(cairn_scan_redundancy_begin(cover, NULL, w.pose), CAIRN_BAD_ARGUMENT);
    assert_int_equal(cairn_scan_redundancy_begin(cover, w.set, NULL), CAIRN_BAD_ARGUMENT);
    kept = w.pose[3];
    w.pose[3].theta = (cairn_real)NAN;
    assert_int_equal(cairn_scan_redundancy_begin(cover, w.set, w.pose), CAIRN_NOT_FINITE);
    w.pose[3] = kept;
    w.pose[3].x = CAIRN_REAL(-1.1e6);
    assert_int_equal(cairn_scan_redundancy_begin(cover, w.set, w.pose), CAIRN_BAD_ARGUMENT);
    w.pose[3] = kept;
    w.pose[3].y = CAIRN_REAL(1.1e6);
    assert_int_equal(cairn_scan_redundancy_begin(cover, w.set, w.pose), CAIRN_BAD_ARGUMENT);
    assert_true(cairn_scan_redundancy_loss(cover, 3) == known);
    assert_true(cairn_scan_redundancy_loss(cover, -1) == -1 &&
                cairn_scan_redundancy_loss(cover, SCANS) == -1);
    params.max_scans = SCANS - 1;
    cover = make_cover(&w, params);
    assert_int_equal(cairn_scan_redundancy_begin(cover, w.set, w.pose), CAIRN_FULL);
    params.max_scans = SCANS;
    params.max_points = w.set->point_count - 1;
    cover = make_cover(&w, params);
    assert_int_equal(cairn_scan_redundancy_begin(cover, w.set, w.pose), CAIRN_FULL);
    w.pose[3] = kept;
    params.max_points = w.set->point_count;
    cover = make_cover(&w, params);
    assert_ok(cairn_scan_redundancy_begin(cover, w.set, w.pose));
    run(cover, 1000, &used);
    assert_true(cairn_scan_redundancy_loss(cover, 3) == known);
    test_pool_free(&w.pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(losses_are_those_by_hand),
        cmocka_unit_test(the_most_redundant_scan_is_culled),
        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(a_radius_without_reciprocal_is_refused),
        cmocka_unit_test(the_greatest_params_are_taken),
        cmocka_unit_test(memory_is_exact),
        cmocka_unit_test(begin_refuses_bad_input),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
