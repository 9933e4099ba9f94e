/* Virtual scans as written: algorithm 2 step by step, with a virtual scan in every iteration; the
 * strength of lines by their points; rooms. */
#include "tests/four_rooms.h"

/* Algorithm 2 for rooms: the constants of section 7.4.2 with all lengths multiplied by six, 30
 * units of 0.03 m for 15 cm. */
static cairn_virtual_align_params rooms_params(int32_t steps)
{
    cairn_virtual_align_params p = cairn_virtual_align_as_written();

    p.aligner.max_scans = 8;
    p.aligner.max_segments = 256;
    p.aligner.max_points = 3000;
    p.field.sigma_start *= 6;
    p.field.sigma_end *= 6;
    p.field.sigma_step = (p.field.sigma_start - p.field.sigma_end) / (cairn_real)(steps - 1);
    p.field.dt_start *= 6;
    p.field.dt_end *= 6;
    p.field.max_steps = steps;
    return p;
}

/* ---- Algorithm 2, line by line ---- */

struct reference {
    cairn_pool pool;
    cairn_force_field *field;
    cairn_virtual_scan *hypotheses;
    cairn_pose pose[SCANS];
    int32_t with_hypotheses; /* iterations */
};

static void reference_runs(struct reference *t, const cairn_virtual_align_params *params,
                           const struct rooms *r)
{
    cairn_force_field_params field = params->field;
    cairn_virtual_scan_params hypotheses = params->hypotheses;
    int32_t count = 0;

    memset(t, 0, sizeof *t);
    field.max_scans = hypotheses.max_scans = params->aligner.max_scans;
    field.max_segments = hypotheses.max_segments = params->aligner.max_segments;
    field.max_points = hypotheses.max_points = params->aligner.max_points;
    field.max_extra = hypotheses.max_virtual;
    t->pool = test_pool(cairn_force_field_memory(&field) + cairn_virtual_scan_memory(&hypotheses));
    assert_ok(cairn_force_field_create(&t->field, &t->pool, &field));
    assert_ok(cairn_virtual_scan_create(&t->hypotheses, &t->pool, &hypotheses));
    for (int32_t i = 0; i < SCANS; i++) { /* 1 */
        cairn_scan_view view = fit(&r->scans[i]);

        assert_ok(cairn_force_field_add_scan(t->field, &view, NULL, r->start[i], NULL));
    }
    do { /* line 3, without a virtual scan at first */
        cairn_budget budget = {CAIRN_UNBOUNDED};
        const cairn_oriented_point *points;
        const cairn_real *weights;

        t->with_hypotheses += count > 0;
        assert_ok(cairn_force_field_iterate(t->field, &budget)); /* 4 and 8 */
        budget.left = CAIRN_UNBOUNDED;
        assert_ok(cairn_virtual_scan_begin(t->hypotheses, cairn_force_field_read(t->field).sigma));
        for (int32_t i = 0; i < SCANS; i++) /* 5 */
            assert_ok(cairn_virtual_scan_add_scan(t->hypotheses, cairn_force_field_scans(t->field),
                                                  i, cairn_force_field_pose(t->field, i)));
        assert_ok(cairn_virtual_scan_step(t->hypotheses, &budget)); /* 6 */
        points = cairn_virtual_scan_points(t->hypotheses, &weights, &count);
        assert_ok(cairn_force_field_set_extra(t->field, points, weights, count));    /* 7 */
    } while (cairn_force_field_read(t->field).verdict == CAIRN_FORCE_FIELD_RUNNING); /* 9 */
    for (int32_t i = 0; i < SCANS; i++)
        t->pose[i] = cairn_force_field_pose(t->field, i);
}

static void is_algorithm_2(void **state)
{
    static const int32_t units[] = {CAIRN_UNBOUNDED, 1000, 7, 1};
    cairn_virtual_align_params p = rooms_params(4);
    struct rooms r = visit(5);
    struct reference t;

    (void)state;
    reference_runs(&t, &p, &r);
    assert_int_equal(t.with_hypotheses, 3);
    /* Not read as written: */
    p.rebuild_interval = 9;
    p.max_rounds = 0;
    p.use_aligner = 1;
    p.field.roi = 1;
    p.field.oriented_below = 2;
    p.field.mode = CAIRN_FORCE_FIELD_SPRINGS;
    p.hypotheses.mode = CAIRN_MODE_DEFAULT;
    for (size_t k = 0; k < sizeof units / sizeof *units; k++) {
        struct bed bed = bed_with(&p);

        add_rooms(&bed, &r);
        run(bed.align, units[k]);
        if (k == 0)
            run(bed.align, units[k]); /* again: the virtual scan of the first run is dropped */
        assert_int_equal(cairn_virtual_align_read(bed.align).iterations, 4);
        assert_int_equal(cairn_virtual_align_read(bed.align).active_iterations, 3);
        for (int32_t i = 0; i < SCANS; i++) {
            cairn_pose pose = cairn_virtual_align_pose_of(bed.align, i).aligned.map_scan;

            assert_int_equal(cairn_virtual_align_pose_of(bed.align, i).moved, 1);
            assert_memory_equal(&pose, &t.pose[i], sizeof pose);
        }
        test_pool_free(&bed.pool);
    }
    test_pool_free(&t.pool);
    leave(&r);
}

/* Figs 8.9 and 8.10: with virtual scans the rooms come together, without they do not. */
static void rooms_come_together(void **state)
{
    int32_t with = 0, without = 0;

    (void)state;
    for (uint64_t seed = 301; seed < 305; seed++)
        for (int32_t virtual = 0; virtual < 2; virtual ++) {
            cairn_virtual_align_params p = rooms_params(30);
            struct rooms r = visit(seed);
            struct bed bed;

            p.hypotheses.lines = p.hypotheses.rectangles = virtual;
            bed = bed_with(&p);
            add_rooms(&bed, &r);
            run(bed.align, CAIRN_UNBOUNDED);
            *(virtual ? &with : &without) += right(&r, bed.align);
            assert_int_equal(cairn_virtual_align_read(bed.align).active_iterations,
                             virtual ? 29 : 0);
            test_pool_free(&bed.pool);
            leave(&r);
        }
    assert_true(with >= 12);
    assert_true(without <= 9);
}

/* ---- The virtual scan ---- */

/* A wall of a map; its points' directions are off by `turn`. */
static void wall(cairn_scan_view *view, double ax, double ay, double bx, double by, double turn)
{
    static cairn_segment segments[8];
    static int32_t first[9];
    static cairn_oriented_point points[512];
    double length = hypot(bx - ax, by - ay), angle = atan2(by - ay, bx - ax) + turn;
    int32_t at = first[view->segment_count] = view->point_count;

    segments[view->segment_count].a = (cairn_vec2){(cairn_real)ax, (cairn_real)ay};
    segments[view->segment_count].b = (cairn_vec2){(cairn_real)bx, (cairn_real)by};
    for (double t = 0.05; t < length; t += 0.1, at++) {
        points[at].position.x = (cairn_real)(ax + t / length * (bx - ax));
        points[at].position.y = (cairn_real)(ay + t / length * (by - ay));
        points[at].direction.x = (cairn_real)cos(angle);
        points[at].direction.y = (cairn_real)sin(angle);
    }
    first[++view->segment_count] = at;
    view->point_count = at;
    view->segments = segments;
    view->first_point = first;
    view->points = points;
}

/* One scan alone makes lines, of all directions of points; the strength of each is its number of
 * points relative to the largest. */
static void lines_are_as_strong_as_they_have_points(void **state)
{
    cairn_virtual_scan_params p = cairn_virtual_scan_as_written();
    cairn_scan_set_params set_params = {
        .max_scans = 1, .max_segments = 8, .max_points = 512, .spacing = 0};
    cairn_pool pool, set_pool = test_pool(cairn_scan_set_memory(&set_params));
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_pose pose = {0, 0, 0};
    const cairn_virtual_scan_hypothesis *h;
    const cairn_oriented_point *points;
    const cairn_real *weights;
    cairn_virtual_scan *v;
    cairn_scan_set *set;
    cairn_scan_view view;
    int32_t count, point_count;

    (void)state;
    p.weight = CAIRN_REAL(0.5);
    p.stride = 3; /* not read, as these */
    p.min_scans = 5;
    p.min_wall_length = 100;
    p.ellipses = 1;
    pool = test_pool(cairn_virtual_scan_memory(&p));
    assert_ok(cairn_scan_set_create(&set, &set_pool, &set_params));
    assert_ok(cairn_virtual_scan_create(&v, &pool, &p));
    memset(&view, 0, sizeof view);
    wall(&view, -6, 0.02, 4, 0.02, 0);    /* 100 points */
    wall(&view, -6, 5.02, 0, 5.02, 1.2);  /* 60 */
    wall(&view, 1.02, 8, 1.02, 3, -0.7);  /* 50 */
    wall(&view, -6, -4.02, -3, -4.02, 0); /* 30: too few */
    assert_ok(cairn_scan_set_add(set, &view, NULL, NULL));
    assert_ok(cairn_virtual_scan_begin(v, CAIRN_REAL(0.9)));
    assert_ok(cairn_virtual_scan_add_scan(v, set, 0, pose));
    assert_ok(cairn_virtual_scan_step(v, &budget));
    h = cairn_virtual_scan_hypotheses(v, &count);
    points = cairn_virtual_scan_points(v, &weights, &point_count);
    assert_int_equal(count, 3);
    for (int32_t i = 0; i < count; i++) {
        static const double votes[] = {100, 61, 51}; /* and a point of the wall across */

        assert_int_equal(h[i].kind, CAIRN_VIRTUAL_SCAN_LINE);
        assert_int_equal(h[i].observing_scans, 0);
        assert_near(h[i].strength, votes[i] / 100, 1e-6);
        for (int32_t k = h[i].first_point; k < h[i].end_point; k++)
            assert_near(weights[k], votes[i] / 200, 1e-6); /* weight 0.5 of strength 1 */
        assert_near(cairn_vec2_norm(cairn_vec2_sub(points[h[i].first_point + 1].position,
                                                   points[h[i].first_point].position)),
                    0.1, 1e-5);
    }
    test_pool_free(&pool);
    test_pool_free(&set_pool);
}

/* Four sides make a rectangle whichever side of each is free. */
static void faces_are_not_distinguished(void **state)
{
    cairn_virtual_scan_params p = cairn_virtual_scan_as_written();
    cairn_scan_set_params set_params = {
        .max_scans = 1, .max_segments = 8, .max_points = 512, .spacing = 0};
    cairn_pool pool, set_pool = test_pool(cairn_scan_set_memory(&set_params));
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_pose pose = {1, 2, CAIRN_REAL(0.3)};
    const cairn_virtual_scan_hypothesis *h;
    cairn_virtual_scan *v;
    cairn_scan_set *set;
    cairn_scan_view view;
    int32_t count;

    (void)state;
    p.lines = 0;
    p.rectangle.oriented = 1; /* not read */
    pool = test_pool(cairn_virtual_scan_memory(&p));
    assert_ok(cairn_scan_set_create(&set, &set_pool, &set_params));
    assert_ok(cairn_virtual_scan_create(&v, &pool, &p));
    memset(&view, 0, sizeof view);
    wall(&view, 0, 0, 3, 0, 0);
    wall(&view, 3, 2, 3, 0, 0);
    wall(&view, 0, 2, 3, 2, 0);
    wall(&view, 0, 0, 0, 2, 0);
    assert_ok(cairn_scan_set_add(set, &view, NULL, NULL));
    assert_ok(cairn_virtual_scan_begin(v, 0));
    assert_ok(cairn_virtual_scan_add_scan(v, set, 0, pose));
    assert_ok(cairn_virtual_scan_step(v, &budget));
    h = cairn_virtual_scan_hypotheses(v, &count);
    assert_int_equal(count, 1);
    assert_int_equal(h->kind, CAIRN_VIRTUAL_SCAN_RECTANGLE);
    assert_near(h->strength, 1, 0.03);
    assert_near(h->weight, h->strength, 0);
    test_pool_free(&pool);
    test_pool_free(&set_pool);
}

/* ---- Params ---- */

static void constants_are_those_of_the_thesis(void **state)
{
    cairn_virtual_align_params p = cairn_virtual_align_as_written(), bad;

    (void)state;
    assert_int_equal(p.mode, CAIRN_MODE_AS_WRITTEN);
    assert_int_equal(p.rebuild_interval, 1);
    assert_int_equal(p.use_aligner, 0);
    assert_int_equal(p.field.mode, CAIRN_FORCE_FIELD_GRADIENT);
    assert_int_equal(p.field.roi, 0);
    assert_int_equal(p.field.max_steps, 100);
    assert_near(p.field.oriented_below, 0, 0);
    assert_near(p.field.sigma_start, 0.15, 1e-7);
    assert_near(p.field.sigma_end, 0.04, 1e-7);
    assert_near(p.field.dt_start, 0.05, 1e-7);
    assert_near(p.field.dt_end, 0.01, 1e-7);
    assert_near(p.field.dt_factor, 0.96, 1e-7);
    assert_int_equal(p.hypotheses.mode, CAIRN_MODE_AS_WRITTEN);
    assert_int_equal(p.hypotheses.ellipses, 0);
    assert_int_equal(p.hypotheses.stride, 1);
    assert_near(p.hypotheses.weight, 1, 0);
    assert_near(p.hypotheses.min_wall_length, 0, 0);
    assert_near(p.hypotheses.spacing, 0.1, 1e-7);
    assert_int_equal(p.hypotheses.rectangle.oriented, 0);
    assert_int_equal(p.hypotheses.hough.mode, CAIRN_MODE_AS_WRITTEN);
    assert_near(p.hypotheses.hough.min_votes, 40, 0);
    bad = p;
    bad.mode = 2;
    assert_int_equal(cairn_virtual_align_memory(&bad), 0);
    bad = p;
    bad.mode = CAIRN_MODE_DEFAULT;
    bad.hypotheses.mode = -1;
    assert_int_equal(cairn_virtual_align_memory(&bad), 0);
    bad.hypotheses.mode = CAIRN_MODE_DEFAULT;
    bad.hypotheses.hough.mode = 7;
    assert_int_equal(cairn_virtual_align_memory(&bad), 0);
    p.aligner.max_scans = 2;
    p.aligner.max_segments = p.aligner.max_points = 5;
    p.aligner.max_hypotheses = p.aligner.max_fill = 4;
    p.aligner.max_cells = 64;
    p.hypotheses.max_virtual = 6;
    p.hypotheses.hough.angles = p.hypotheses.hough.distances = 8;
    p.hypotheses.rectangle.max_pairs = p.hypotheses.rectangle.max_sides = 4;
    test_every_pool_size(create, &p, cairn_virtual_align_memory(&p));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(is_algorithm_2),
        cmocka_unit_test(rooms_come_together),
        cmocka_unit_test(lines_are_as_strong_as_they_have_points),
        cmocka_unit_test(faces_are_not_distinguished),
        cmocka_unit_test(constants_are_those_of_the_thesis),
    };

    return cmocka_run_group_tests_name("virtual_as_written", tests, open_scan, close_scan);
}
