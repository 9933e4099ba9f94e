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
    cairn_scan_set_params good = {2, 3, 5}, p;
    cairn_pool pool = test_pool(cairn_scan_set_memory(&good));
    cairn_scan_set *set;

    (void)state;
#define REFUSED(field, value)                                                                                          \
    p = good;                                                                                                          \
    p.field = value;                                                                                                   \
    assert_int_equal(cairn_scan_set_memory(&p), 0);                                                                    \
    assert_status(cairn_scan_set_create(&set, &pool, &p), CAIRN_BAD_ARGUMENT)
    REFUSED(max_scans, 0);
    REFUSED(max_scans, (1 << 20) + 1);
    REFUSED(max_segments, 0);
    REFUSED(max_segments, (1 << 24) + 1);
    REFUSED(max_points, -1);
    REFUSED(max_points, (1 << 24) + 1);
#undef REFUSED
    p = good;
    p.max_scans = 1 << 20;
    assert_true(cairn_scan_set_memory(&p) > (size_t)1 << 24);
    p = good;
    p.max_segments = 1 << 24;
    assert_true(cairn_scan_set_memory(&p) > (size_t)1 << 28);
    p = good;
    p.max_points = 1 << 24;
    assert_true(cairn_scan_set_memory(&p) > (size_t)1 << 26);
    assert_int_equal(cairn_scan_set_memory(NULL), 0);
    assert_status(cairn_scan_set_create(NULL, &pool, &good), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_scan_set_create(&set, NULL, &good), CAIRN_BAD_ARGUMENT);
    assert_int_equal(pool.used, 0);
    test_pool_free(&pool);
    test_every_pool_size(create_with, &good, cairn_scan_set_memory(&good));
    for (p.max_scans = 1; p.max_scans < 60; p.max_scans += 7)
        for (p.max_segments = 1; p.max_segments < 500; p.max_segments += 31)
            for (p.max_points = 1; p.max_points < 5000; p.max_points += 333)
                assert_int_equal(cairn_scan_set_memory(&p),
                                 CAIRN_SCAN_SET_BYTES(p.max_scans, p.max_points, p.max_segments));
}

static void test_scans_are_copied(void **state)
{
    cairn_scan_set_params params = {3, 7, 9};
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
    assert_null(fault.what);
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
        /* (.25 + 1) + (.25 + 1) + (2.25 + 1) + (2.25 + 9) = 17; (0 + 1) + (1 + 1) + (4 + 1) + (1 + 25) = 34 */
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
            assert_near(t->spacing, i == 0 ? 1 : 0, 1e-6);
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

/* Even points to a thousandth of their distance, along the direction and not against it. */
static void test_spacing(void **state)
{
    static const struct {
        double x, y, direction, spacing;
    } cases[] = {{2, 0, 1, 1},      {2.0009, 0, 1, 1}, {2.002, 0, 1, 0},  {1.998, 0, 1, 0},
                 {2, 0.0009, 1, 1}, {2, 0.002, 1, 0},  {2, -0.002, 1, 0}, {2, 0, -1, 0}};
    cairn_scan_set_params params = {1, 3, 4};
    cairn_pool pool = test_pool(cairn_scan_set_memory(&params));
    cairn_scan_set *set;
    struct example e;

    (void)state;
    assert_ok(cairn_scan_set_create(&set, &pool, &params));
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        make_example(&e);
        set_point(&e.points[1], cases[i].x, cases[i].y, 1, 0);
        e.points[0].direction.x = (cairn_real)cases[i].direction;
        cairn_scan_set_clear(set);
        assert_ok(cairn_scan_set_add(set, &e.view, NULL, NULL));
        assert_near(set->segments[0].spacing, cases[i].spacing, 1e-6);
    }
    /* Two are even if they lie as their direction says. */
    e.first_point[1] = e.first_point[2] = 2;
    e.first_point[3] = e.view.point_count = 3;
    set_point(&e.points[0], 1, 0, 1, 0);
    set_point(&e.points[1], 1.5, 0, 1, 0);
    cairn_scan_set_clear(set);
    assert_ok(cairn_scan_set_add(set, &e.view, NULL, NULL));
    assert_near(set->segments[0].spacing, 0.5, 1e-6);
    /* Points on each other. */
    make_example(&e);
    for (int k = 0; k < 3; k++)
        set_point(&e.points[k], 1, 0, 1, 0);
    cairn_scan_set_clear(set);
    assert_ok(cairn_scan_set_add(set, &e.view, NULL, NULL));
    assert_near(set->segments[0].spacing, 0, 0);
    test_pool_free(&pool);
}

static void test_full(void **state)
{
    static const cairn_scan_set_params small[3] = {{1, 9, 9}, {9, 5, 9}, {9, 9, 7}};
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
        assert_status(cairn_scan_set_add(set, &e.view, NULL, &fault), CAIRN_FULL);
        assert_non_null(strstr(fault.what, what[i]));
        assert_int_equal(fault.index, -1);
        assert_int_equal(set->scan_count, 1);
        test_pool_free(&pool);
    }
    /* Full to the last one. */
    {
        cairn_scan_set_params exact = {2, 6, 8};
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
    const cairn_real nan = (cairn_real)NAN, infinity = (cairn_real)INFINITY, far = CAIRN_REAL(1.1e6);
    cairn_scan_set_params params = {3, 9, 12};
    cairn_pool pool = test_pool(cairn_scan_set_memory(&params));
    cairn_scan_set *set;
    struct example e;
    cairn_fault fault;

    (void)state;
    assert_ok(cairn_scan_set_create(&set, &pool, &params));
#define REFUSED(change, status, place)                                                                                 \
    make_example(&e);                                                                                                  \
    change;                                                                                                            \
    fault.what = NULL;                                                                                                 \
    assert_status(cairn_scan_set_add(set, &e.view, e.mass, &fault), status);                                           \
    assert_non_null(fault.what);                                                                                       \
    assert_int_equal(fault.index, place);                                                                              \
    assert_status(cairn_scan_set_add(set, &e.view, e.mass, NULL), status);                                             \
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
    assert_status(cairn_scan_set_add(NULL, &e.view, NULL, &fault), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_scan_set_add(set, NULL, NULL, &fault), CAIRN_BAD_ARGUMENT);
    test_pool_free(&pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_params_and_memory),
        cmocka_unit_test(test_scans_are_copied),
        cmocka_unit_test(test_spacing),
        cmocka_unit_test(test_full),
        cmocka_unit_test(test_bad_scans_are_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
