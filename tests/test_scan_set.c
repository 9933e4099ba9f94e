/* Sets of scans: storage of points in both representations, removal, compaction, refusals. */
#include "tests/test.h"

#include <math.h>

#include "cairn/scan_set.h"

/* A scan of two segments, one of them without points, and of a third with one point. */
struct example {
    cairn_segment segments[3];
    int32_t first_point[4];
    cairn_oriented_point points[4];
    cairn_real mass[4];
    cairn_scan_view view;
};

static void set_point(cairn_oriented_point *p, double x, double y, double dx, double dy)
{
    p->position.x = (cairn_real)x;
    p->position.y = (cairn_real)y;
    p->direction.x = (cairn_real)dx;
    p->direction.y = (cairn_real)dy;
}

static void make_example(struct example *e)
{
    static const int32_t first_point[4] = {0, 3, 3, 4};

    memset(e, 0, sizeof *e);
    memcpy(e->first_point, first_point, sizeof first_point);
    e->segments[0].a.x = 1;
    e->segments[0].b.x = 3;
    e->segments[2].a.y = 4;
    e->segments[2].b.y = 5;
    set_point(&e->points[0], 1, 0, 2, 0);
    set_point(&e->points[1], 2, 0, 1, 0);
    set_point(&e->points[2], 3, 0, 1, 0);
    set_point(&e->points[3], 0, 4, 0.6, 0.8);
    for (int i = 0; i < 4; i++)
        e->mass[i] = (cairn_real)(i + 1);
    e->view.segments = e->segments;
    e->view.first_point = e->first_point;
    e->view.points = e->points;
    e->view.segment_count = 3;
    e->view.point_count = 4;
    e->view.sensor.x = 1;
    e->view.sensor.y = -1;
}

static cairn_status create_with(void *params, cairn_pool *pool)
{
    cairn_scan_set *set;

    return cairn_scan_set_create(&set, pool, params);
}

static void test_params_and_memory(void **state)
{
    cairn_scan_set_params good = {.max_scans = 2, .max_segments = 3, .max_points = 5, .spacing = 0},
                          p;
    cairn_pool pool = test_pool(cairn_scan_set_memory(&good));
    (void)state;
    p = good;
    p.max_scans = 1 << 20;
    assert_true(cairn_scan_set_memory(&p) > (size_t)1 << 24);
    p = good;
    p.max_segments = 1 << 24;
    assert_true(cairn_scan_set_memory(&p) > (size_t)1 << 28);
    p = good;
    p.max_points = 1 << 24;
    assert_true(cairn_scan_set_memory(&p) > (size_t)1 << 26);
    assert_status(cairn_scan_set_create(NULL, &pool, &good), CAIRN_BAD_ARGUMENT);
    assert_int_equal(pool.used, 0);
    test_pool_free(&pool);
    test_every_pool_size(create_with, &good, cairn_scan_set_memory(&good));
    good.spacing = CAIRN_REAL(0.1);
    test_every_pool_size(create_with, &good, cairn_scan_set_memory(&good));
    for (p.max_scans = 1; p.max_scans < 60; p.max_scans += 7)
        for (p.max_segments = 1; p.max_segments < 500; p.max_segments += 31)
            for (p.max_points = 1; p.max_points < 5000; p.max_points += 333) {
                p.spacing = 0;
                assert_int_equal(cairn_scan_set_memory(&p),
                                 CAIRN_SCAN_SET_BYTES(p.max_scans, p.max_points, p.max_segments));
                p.spacing = 1;
                assert_int_equal(
                    cairn_scan_set_memory(&p),
                    CAIRN_SCAN_SET_BITS_BYTES(p.max_scans, p.max_points, p.max_segments));
            }
}

static void test_scans_are_copied(void **state)
{
    cairn_scan_set_params params = {
        .max_scans = 3, .max_segments = 7, .max_points = 9, .spacing = 0};
    cairn_pool pool = test_pool(cairn_scan_set_memory(&params));
    cairn_scan_set *set;
    cairn_scan_view nothing;
    struct example e;
    cairn_fault fault = {7, "before"};

    (void)state;
    memset(&nothing, 0, sizeof nothing);
    make_example(&e);
    assert_ok(cairn_scan_set_create(&set, &pool, &params));
    assert_int_equal(set->scan_count + set->segment_count + set->point_count, 0);
    assert_ok(cairn_scan_set_add(set, &e.view, NULL, &fault));
    assert_null(fault.message);
    assert_int_equal(fault.index, -1);
    assert_ok(cairn_scan_set_add(set, &nothing, NULL, NULL));
    assert_ok(cairn_scan_set_add(set, &e.view, e.mass, &fault));
    assert_int_equal(set->scan_count, 3);
    assert_int_equal(set->segment_count, 6);
    assert_int_equal(set->point_count, 8);

    for (int scan = 0; scan < 3; scan += 2) {
        const cairn_scan_set_scan *s = &set->scans[scan];
        int32_t segment = scan == 0 ? 0 : 3, point = scan == 0 ? 0 : 4;

        assert_int_equal(s->first_segment, segment);
        assert_int_equal(s->end_segment, segment + 3);
        assert_int_equal(s->first_point, point);
        assert_int_equal(s->end_point, point + 4);
        assert_near(s->sensor.x, 1, 0);
        assert_near(s->sensor.y, -1, 0);
        assert_near(s->centroid.x, 1.5, 1e-6);
        assert_near(s->centroid.y, 1, 1e-6);
        /* (.25 + 1) + (.25 + 1) + (2.25 + 1) + (2.25 + 9) = 17; (0 + 1) + (1 + 1) + (4 + 1) + (1 +
         * 25) = 34 */
        assert_near(s->centroid_spread, 4.25, 1e-5);
        assert_near(s->sensor_spread, 8.5, 1e-5);
        for (int32_t i = 0; i < 3; i++) {
            const cairn_scan_set_segment *t = &set->segments[segment + i];

            assert_int_equal(t->scan, scan);
            assert_int_equal(t->first_point, point + e.first_point[i]);
            assert_int_equal(t->end_point, point + e.first_point[i + 1]);
            assert_memory_equal(&t->segment, &e.segments[i], sizeof t->segment);
            assert_near(t->direction.x, i == 0 ? 1 : i == 1 ? 0 : 0.6, 1e-6);
            assert_near(t->direction.y, i == 2 ? 0.8 : 0, 1e-6);
        }
        for (int32_t i = 0; i < 4; i++) {
            assert_near(set->points[point + i].x, e.points[i].position.x, 0);
            assert_near(set->points[point + i].y, e.points[i].position.y, 0);
            assert_near(set->mass[point + i], scan == 0 ? 1 : i + 1, 0);
        }
    }
    assert_int_equal(set->scans[1].first_point, 4);
    assert_int_equal(set->scans[1].end_point, 4);
    assert_int_equal(set->scans[1].first_segment, set->scans[1].end_segment);
    assert_near(set->scans[1].centroid.x, 0, 0);
    assert_near(set->scans[1].centroid_spread, 0, 0);
    assert_near(set->scans[1].sensor_spread, 0, 0);

    cairn_scan_set_clear(set);
    assert_int_equal(set->scan_count + set->segment_count + set->point_count, 0);
    assert_ok(cairn_scan_set_add(set, &e.view, NULL, NULL));
    assert_int_equal(set->scans[0].first_point, 0);
    test_pool_free(&pool);
}

static void test_full(void **state)
{
    static const cairn_scan_set_params small[3] = {{1, 9, 9, 0}, {9, 5, 9, 0}, {9, 9, 7, 0}};
    static const char *const what[3] = {"scans", "segments", "points"};
    struct example e;

    (void)state;
    make_example(&e);
    for (int i = 0; i < 3; i++) {
        cairn_pool pool = test_pool(cairn_scan_set_memory(&small[i]));
        cairn_scan_set *set;
        cairn_fault fault;

        assert_ok(cairn_scan_set_create(&set, &pool, &small[i]));
        assert_ok(cairn_scan_set_add(set, &e.view, NULL, &fault));
        assert_fault(&fault, cairn_scan_set_add(set, &e.view, NULL, &fault), CAIRN_FULL, -1);
        assert_non_null(strstr(fault.message, what[i]));
        assert_int_equal(fault.index, -1);
        assert_int_equal(set->scan_count, 1);
        test_pool_free(&pool);
    }
    /* Full to the last one. */
    {
        cairn_scan_set_params exact = {
            .max_scans = 2, .max_segments = 6, .max_points = 8, .spacing = 0};
        cairn_pool pool = test_pool(cairn_scan_set_memory(&exact));
        cairn_scan_set *set;

        assert_ok(cairn_scan_set_create(&set, &pool, &exact));
        assert_ok(cairn_scan_set_add(set, &e.view, NULL, NULL));
        assert_ok(cairn_scan_set_add(set, &e.view, NULL, NULL));
        test_pool_free(&pool);
    }
}

static void test_bad_scans_are_refused(void **state)
{
    const cairn_real nan = (cairn_real)NAN, infinity = (cairn_real)INFINITY,
                     far = CAIRN_REAL(1.1e6);
    cairn_scan_set_params params = {
        .max_scans = 3, .max_segments = 9, .max_points = 12, .spacing = 0};
    cairn_pool pool = test_pool(cairn_scan_set_memory(&params));
    cairn_scan_set *set;
    struct example e;
    cairn_fault fault;

    (void)state;
    assert_ok(cairn_scan_set_create(&set, &pool, &params));
#define REFUSED(change, status, place)                                                             \
    make_example(&e);                                                                              \
    change;                                                                                        \
    fault.message = NULL;                                                                          \
    assert_status(cairn_scan_set_add(set, &e.view, e.mass, &fault), status);                       \
    assert_non_null(fault.message);                                                                \
    assert_int_equal(fault.index, place);                                                          \
    assert_status(cairn_scan_set_add(set, &e.view, e.mass, NULL), status);                         \
    assert_int_equal(set->scan_count + set->segment_count + set->point_count, 0)
    REFUSED(e.view.segment_count = -1, CAIRN_BAD_ARGUMENT, -1);
    REFUSED(e.view.point_count = -1, CAIRN_BAD_ARGUMENT, -1);
    REFUSED(e.view.segments = NULL, CAIRN_BAD_ARGUMENT, -1);
    REFUSED(e.view.first_point = NULL, CAIRN_BAD_ARGUMENT, -1);
    REFUSED(e.view.points = NULL, CAIRN_BAD_ARGUMENT, -1);
    REFUSED(e.view.segment_count = 0, CAIRN_BAD_ARGUMENT, 0);
    REFUSED(e.first_point[0] = 1, CAIRN_BAD_ARGUMENT, 0);
    REFUSED(e.first_point[0] = -1, CAIRN_BAD_ARGUMENT, 0);
    REFUSED(e.first_point[2] = 2, CAIRN_BAD_ARGUMENT, 1);
    REFUSED(e.first_point[3] = 5, CAIRN_BAD_ARGUMENT, 3);
    REFUSED(e.view.point_count = 3, CAIRN_BAD_ARGUMENT, 3);
    REFUSED(e.view.segment_count = 1, CAIRN_BAD_ARGUMENT, 1);
    REFUSED(e.view.sensor.x = nan, CAIRN_NOT_FINITE, -1);
    REFUSED(e.view.sensor.y = far, CAIRN_BAD_ARGUMENT, -1);
    REFUSED(e.segments[2].a.x = infinity, CAIRN_NOT_FINITE, 2);
    REFUSED(e.segments[1].a.y = nan, CAIRN_NOT_FINITE, 1);
    REFUSED(e.segments[0].b.x = nan, CAIRN_NOT_FINITE, 0);
    REFUSED(e.segments[2].b.y = -infinity, CAIRN_NOT_FINITE, 2);
    REFUSED(e.segments[2].a.x = far, CAIRN_BAD_ARGUMENT, 2);
    REFUSED(e.segments[1].b.y = -far, CAIRN_BAD_ARGUMENT, 1);
    REFUSED(e.points[3].position.x = nan, CAIRN_NOT_FINITE, 3);
    REFUSED(e.points[2].position.y = infinity, CAIRN_NOT_FINITE, 2);
    REFUSED(e.points[1].direction.x = nan, CAIRN_NOT_FINITE, 1);
    REFUSED(e.points[1].direction.y = nan, CAIRN_NOT_FINITE, 1);
    REFUSED(e.points[3].position.x = -far, CAIRN_BAD_ARGUMENT, 3);
    REFUSED(e.points[3].direction.y = far, CAIRN_BAD_ARGUMENT, 3);
    REFUSED(e.mass[1] = nan, CAIRN_NOT_FINITE, 1);
    REFUSED(e.mass[3] = 0, CAIRN_BAD_ARGUMENT, 3);
    REFUSED(e.mass[2] = far, CAIRN_BAD_ARGUMENT, 2);
#undef REFUSED
    make_example(&e);
    assert_fault(&fault, cairn_scan_set_add(NULL, &e.view, NULL, &fault), CAIRN_BAD_ARGUMENT, -1);
    assert_fault(&fault, cairn_scan_set_add(set, NULL, NULL, &fault), CAIRN_BAD_ARGUMENT, -1);
    test_pool_free(&pool);
}

/* ---- Points generated from the ends of segments ---- */

enum { WALLS = 6, MAX_COUNT = 400 };

/* The points of walls as the scan module makes them: every `spacing`, centred, those with a bit of
 * `support`. */
struct walls {
    cairn_segment segments[WALLS];
    int32_t first_point[WALLS + 1];
    cairn_oriented_point points[MAX_COUNT];
    cairn_scan_view view;
};

static void make_walls(struct walls *w, uint64_t seed, double spacing)
{
    cairn_random random = cairn_random_seed(seed, 3);

    memset(w, 0, sizeof *w);
    w->view.segments = w->segments;
    w->view.first_point = w->first_point;
    w->view.points = w->points;
    w->view.segment_count = WALLS;
    for (int i = 0; i < WALLS; i++) {
        cairn_real gaps = i % 2 ? CAIRN_REAL(0.3) : 0;
        cairn_vec2 along, direction;
        cairn_real length;
        int32_t places;

        w->segments[i].a.x = cairn_random_uniform(&random, -5, 5);
        w->segments[i].a.y = cairn_random_uniform(&random, -5, 5);
        w->segments[i].b.x =
            w->segments[i].a.x + cairn_random_uniform(&random, -1, 1) * (cairn_real)(i + 1);
        w->segments[i].b.y =
            w->segments[i].a.y + cairn_random_uniform(&random, -1, 1) * (cairn_real)(i + 1);
        along = cairn_vec2_sub(w->segments[i].b, w->segments[i].a);
        length = cairn_vec2_norm(along);
        direction = cairn_vec2_unit(along);
        places = (int32_t)floor((double)(length / (cairn_real)spacing)) + 1;
        for (int32_t k = 0; k < places; k++) {
            cairn_real at = (length - (cairn_real)(places - 1) * (cairn_real)spacing) / 2 +
                            (cairn_real)k * (cairn_real)spacing;
            cairn_oriented_point *p = &w->points[w->view.point_count];

            if (cairn_random_uniform(&random, 0, 1) < gaps)
                continue;
            p->position = cairn_vec2_add(w->segments[i].a, cairn_vec2_scale(direction, at));
            p->direction = direction;
            w->view.point_count++;
        }
        w->first_point[i + 1] = w->view.point_count;
    }
}

/* Both representations give the same bits, in whatever order the points are read. */
static void assert_same_sets(const cairn_scan_set *kept, const cairn_scan_set *made)
{
    assert_int_equal(kept->scan_count, made->scan_count);
    assert_int_equal(kept->segment_count, made->segment_count);
    assert_int_equal(kept->point_count, made->point_count);
    for (int32_t i = 0; i < kept->scan_count; i++) {
        const cairn_scan_set_scan *a = &kept->scans[i], *b = &made->scans[i];

        assert_int_equal(a->in_use, b->in_use);
        if (!a->in_use)
            continue;
        assert_int_equal(a->first_segment, b->first_segment);
        assert_int_equal(a->end_point, b->end_point);
        assert_true(a->centroid.x == b->centroid.x && a->centroid_spread == b->centroid_spread);
        assert_true(a->sensor_spread == b->sensor_spread);
    }
    for (int32_t i = 0; i < kept->segment_count; i++) {
        const cairn_scan_set_segment *a = &kept->segments[i], *b = &made->segments[i];
        int32_t count = a->end_point - a->first_point;
        cairn_vec2 points[MAX_COUNT];

        assert_int_equal(a->first_point, b->first_point);
        assert_int_equal(a->end_point, b->end_point);
        assert_int_equal(a->scan, b->scan);
        assert_true(a->direction.x == b->direction.x && a->direction.y == b->direction.y);
        if (a->scan < 0)
            continue;
        for (int32_t first = 0; first <= count; first += 1 + first / 3) {
            int32_t some = (count - first) / (1 + first % 2);

            cairn_scan_set_read(made, i, first, some, points);
            assert_memory_equal(points, kept->points + a->first_point + first,
                                (size_t)some * sizeof *points);
            cairn_scan_set_read(kept, i, first, some, points);
            assert_memory_equal(points, kept->points + a->first_point + first,
                                (size_t)some * sizeof *points);
        }
    }
}

static void test_points_are_made(void **state)
{
    cairn_scan_set_params params = {
        .max_scans = 5, .max_segments = 5 * WALLS, .max_points = 5 * MAX_COUNT, .spacing = 0};
    size_t kept_bytes = cairn_scan_set_memory(&params);
    cairn_pool pool = test_pool(2 * kept_bytes);
    cairn_scan_set *kept, *made;
    struct walls w;
    cairn_fault fault;
    cairn_real mass[MAX_COUNT];

    (void)state;
    assert_ok(cairn_scan_set_create(&kept, &pool, &params));
    params.spacing = CAIRN_REAL(0.07);
    assert_true(cairn_scan_set_memory(&params) < kept_bytes / 5);
    assert_ok(cairn_scan_set_create(&made, &pool, &params));
    for (uint64_t seed = 0; seed < 5; seed++) {
        make_walls(&w, seed, 0.07);
        assert_true(w.view.point_count > 100);
        assert_ok(cairn_scan_set_add(kept, &w.view, NULL, NULL));
        assert_ok(cairn_scan_set_add(made, &w.view, NULL, &fault));
    }
    assert_same_sets(kept, made);

    /* Segments of another form are refused. */
    cairn_scan_set_clear(made);
    make_walls(&w, 1, 0.07);
    for (int i = 0; i < MAX_COUNT; i++)
        mass[i] = 1;
    assert_fault(&fault, cairn_scan_set_add(made, &w.view, mass, &fault), CAIRN_BAD_ARGUMENT, -1);
    assert_non_null(strstr(fault.message, "mass"));
    w.points[7].position.x += CAIRN_REAL(1e-3);
    assert_fault(&fault, cairn_scan_set_add(made, &w.view, NULL, &fault), CAIRN_BAD_ARGUMENT, 7);
    make_walls(&w, 1, 0.07);
    w.points[w.first_point[5] + 3].position.y += CAIRN_REAL(1e-3);
    assert_fault(&fault, cairn_scan_set_add(made, &w.view, NULL, &fault), CAIRN_BAD_ARGUMENT,
                 w.first_point[5] + 3);
    make_walls(&w, 1, 0.07);
    { /* out of order */
        cairn_oriented_point swap = w.points[w.first_point[4]];

        w.points[w.first_point[4]] = w.points[w.first_point[4] + 1];
        w.points[w.first_point[4] + 1] = swap;
        assert_fault(&fault, cairn_scan_set_add(made, &w.view, NULL, &fault), CAIRN_BAD_ARGUMENT,
                     w.first_point[4] + 1);
    }
    make_walls(&w, 1, 0.08);
    assert_fault(&fault, cairn_scan_set_add(made, &w.view, NULL, &fault), CAIRN_BAD_ARGUMENT, 0);
    assert_int_equal(made->scan_count + made->segment_count + made->point_count + made->word_count,
                     0);
    /* A wall without a point takes no words. */
    make_walls(&w, 1, 0.07);
    w.view.segment_count = 1;
    w.view.point_count = w.first_point[1] = 0;
    assert_ok(cairn_scan_set_add(made, &w.view, NULL, NULL));
    assert_int_equal(made->segment_count, 1);
    assert_int_equal(made->word_count, 0);
    cairn_scan_set_clear(made);
    /* A wall with memory for every point but not for every place. */
    make_walls(&w, 1, 0.07);
    w.segments[0].b.x = w.segments[0].a.x + 9000;
    w.first_point[1] = 1;
    for (int i = 2; i <= WALLS; i++)
        w.first_point[i] = 1;
    w.view.point_count = 1;
    assert_fault(&fault, cairn_scan_set_add(made, &w.view, NULL, &fault), CAIRN_FULL, -1);
    assert_non_null(strstr(fault.message, "places"));
    test_pool_free(&pool);
}

/* ---- Removal ---- */

/* The scans in the order of arrival, as a list of seeds, compared with sets of both kinds. */
struct ledger {
    uint64_t seed[8];
    int32_t slot[8];
    int32_t count;
};

static void assert_is_ledger(const cairn_scan_set *set, const struct ledger *ledger)
{
    int32_t segment = 0, point = 0, used = 0;

    for (int32_t i = 0; i < set->scan_count; i++)
        used += set->scans[i].in_use;
    assert_int_equal(used, ledger->count);
    for (int32_t i = 0; i < ledger->count; i++) {
        const cairn_scan_set_scan *scan = &set->scans[ledger->slot[i]];
        cairn_vec2 points[MAX_COUNT];
        struct walls w;

        make_walls(&w, ledger->seed[i], 0.07);
        assert_int_equal(scan->first_segment, segment);
        assert_int_equal(scan->first_point, point);
        for (int32_t k = 0; k < WALLS; k++) {
            const cairn_scan_set_segment *s = &set->segments[segment + k];
            int32_t count = w.first_point[k + 1] - w.first_point[k];

            assert_int_equal(s->scan, ledger->slot[i]);
            assert_int_equal(s->end_point - s->first_point, count);
            cairn_scan_set_read(set, segment + k, 0, count, points);
            for (int32_t j = 0; j < count; j++)
                assert_true(points[j].x == w.points[w.first_point[k] + j].position.x &&
                            points[j].y == w.points[w.first_point[k] + j].position.y);
        }
        segment += WALLS;
        point += w.view.point_count;
        assert_int_equal(scan->end_segment, segment);
        assert_int_equal(scan->end_point, point);
    }
}

/* Thousands of scans through few slots: at random an addition, a removal, or a little
 * compaction. */
static void test_scans_come_and_go(void **state)
{
    cairn_scan_set_params params = {
        .max_scans = 8, .max_segments = 8 * WALLS, .max_points = 8 * MAX_COUNT, .spacing = 0};
    cairn_random random = cairn_random_seed(9, 9);

    (void)state;
    for (int way = 0; way < 2; way++) {
        struct ledger ledger = {{0}, {0}, 0};
        cairn_scan_set *set;
        cairn_pool pool;
        uint64_t seed = 0;

        params.spacing = way == 0 ? 0 : CAIRN_REAL(0.07);
        pool = test_pool(cairn_scan_set_memory(&params));
        assert_ok(cairn_scan_set_create(&set, &pool, &params));
        for (int step = 0; step < 3000; step++) {
            int32_t what = cairn_random_below(&random, 3);
            cairn_budget budget = {cairn_random_below(&random, 60)}, rest = {CAIRN_UNBOUNDED};
            int32_t given = budget.left;

            if (what == 0) {
                int32_t next = cairn_scan_set_next(set);
                struct walls w;
                cairn_status status;

                make_walls(&w, ++seed, 0.07);
                status = cairn_scan_set_add(set, &w.view, NULL, NULL);
                if (ledger.count == 8)
                    assert_int_equal(next, -1);
                if (status == CAIRN_FULL && ledger.count < 8) {
                    /* Only because of slots not compacted yet. */
                    assert_true(set->needs_packing);
                    assert_ok(cairn_scan_set_pack(set, &rest));
                    status = cairn_scan_set_add(set, &w.view, NULL, NULL);
                }
                assert_int_equal(status, ledger.count == 8 ? CAIRN_FULL : CAIRN_OK);
                if (status == CAIRN_OK) {
                    ledger.seed[ledger.count] = seed;
                    ledger.slot[ledger.count++] = next;
                    assert_true(set->scans[next].in_use);
                }
            } else if (what == 1 && ledger.count > 0) {
                int32_t k = cairn_random_below(&random, ledger.count);

                assert_ok(cairn_scan_set_remove(set, ledger.slot[k]));
                assert_status(cairn_scan_set_remove(set, ledger.slot[k]), CAIRN_BAD_ARGUMENT);
                assert_int_equal(cairn_scan_set_next(set), ledger.slot[k]);
                ledger.count--;
                for (int32_t i = k; i < ledger.count; i++) {
                    ledger.seed[i] = ledger.seed[i + 1];
                    ledger.slot[i] = ledger.slot[i + 1];
                }
            } else {
                cairn_status status = cairn_scan_set_pack(set, &budget);

                assert_true(budget.left >= 0 && budget.left <= given);
                assert_true(status == CAIRN_OK || (status == CAIRN_MORE && budget.left == 0));
                if (status == CAIRN_OK) {
                    assert_false(set->needs_packing);
                    assert_is_ledger(set, &ledger);
                }
            }
            for (int32_t i = 0; i < ledger.count; i++) /* readers see whole scans at all times */
                assert_int_equal(set->segments[set->scans[ledger.slot[i]].first_segment].scan,
                                 ledger.slot[i]);
        }
        assert_true(seed > 500);
        assert_status(cairn_scan_set_remove(NULL, 0), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_scan_set_remove(set, -1), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_scan_set_remove(set, set->scan_count), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_scan_set_pack(NULL, NULL), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_scan_set_pack(set, NULL), CAIRN_BAD_ARGUMENT);
        cairn_scan_set_clear(set);
        assert_int_equal(cairn_scan_set_next(set), 0);
        test_pool_free(&pool);
    }
}

/* The units charged do not depend on the split of the budget. */
static void test_pack_budgets(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000, CAIRN_UNBOUNDED};
    cairn_scan_set_params params = {
        .max_scans = 4, .max_segments = 4 * WALLS, .max_points = 4 * MAX_COUNT, .spacing = 0};
    int32_t expected = 0;

    (void)state;
    for (int b = 3; b >= 0; b--) {
        cairn_pool pool = test_pool(cairn_scan_set_memory(&params));
        cairn_status status = CAIRN_MORE;
        struct ledger ledger = {{2, 4}, {1, 3}, 2};
        cairn_scan_set *set;
        int32_t used = 0;

        assert_ok(cairn_scan_set_create(&set, &pool, &params));
        for (uint64_t seed = 1; seed <= 4; seed++) {
            struct walls w;

            make_walls(&w, seed, 0.07);
            assert_ok(cairn_scan_set_add(set, &w.view, NULL, NULL));
        }
        assert_ok(cairn_scan_set_remove(set, 2));
        assert_ok(cairn_scan_set_remove(set, 0));
        while (status == CAIRN_MORE) {
            cairn_budget budget = {budgets[b]};

            status = cairn_scan_set_pack(set, &budget);
            assert_true(budget.left >= 0);
            used += budgets[b] - budget.left;
        }
        assert_ok(status);
        assert_is_ledger(set, &ledger);
        if (b == 3)
            expected = used;
        assert_true(used > 20);
        assert_int_equal(used, expected);
        test_pool_free(&pool);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_params_and_memory),
        cmocka_unit_test(test_scans_are_copied),
        cmocka_unit_test(test_full),
        cmocka_unit_test(test_bad_scans_are_refused),
        cmocka_unit_test(test_points_are_made),
        cmocka_unit_test(test_scans_come_and_go),
        cmocka_unit_test(test_pack_budgets),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
