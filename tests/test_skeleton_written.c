/* Skeletons of Adluru 2008, chapter 3: results and their weights, culling; little input and very
 * much; budgets. */
#include "tests/skeleton_reference.h"

/* ---- What is found ---- */

/* At any angle, over most of its length by the two walks of a line together. */
static void a_bar_has_its_axis(void **state)
{
    cairn_skeleton_grouping_params params = small_params();
    struct fixture f = with(params);

    (void)state;
    for (int32_t k = 0; k < 4; k++) {
        double turn = 0.7 * k, r = 6 + 1.5 * k, c = cos(turn), s = sin(turn), least = 1e9,
               most = -1e9;
        cairn_polyline_segment line;
        cairn_skeleton_grouping_result found;

        edgel_count = 0;
        add_bar(100 - 45 * c, 80 - 45 * s, 100 + 45 * c, 80 + 45 * s, r, 3 + (uint64_t)k);
        found = run(f.skeleton, 0.8 * r, 1.2 * r);
        check(&found, &params);
        assert_true(found.part_count >= 1 && found.dropped_seed_count == 0);
        for (int32_t i = 0; i < found.point_count; i++) {
            double x = (double)found.points[i].centre.x - 100,
                   y = (double)found.points[i].centre.y - 80;

            assert_near(c * y - s * x, 0, 1.5);
            assert_near(found.points[i].radius, r, 1.5);
            least = fmin(least, c * x + s * y);
            most = fmax(most, c * x + s * y);
        }
        assert_true(most - least > 55);
        assert_true(cairn_skeleton_grouping_mirror_line(f.skeleton, 0, &line));
        assert_near(line.a[2], r, 1);
        assert_near(c * ((double)line.a[1] - 80) - s * ((double)line.a[0] - 100), 0, 1.5);
    }
    test_pool_free(&f.pool);
}

static void clutter_and_bends_are_checked(void **state)
{
    cairn_skeleton_grouping_params params = small_params();
    struct fixture f = with(params);
    cairn_skeleton_grouping_result found;

    (void)state;
    for (uint64_t seed = 1; seed <= 3; seed++) {
        cairn_random random = cairn_random_seed(seed, 8);

        edgel_count = 0;
        add_bar(30, 40, 130, 60, 7, seed);
        for (double t = 0.2; t < 2.6; t += 0.02) {
            double wobble =
                (double)cairn_random_uniform(&random, CAIRN_REAL(-0.2), CAIRN_REAL(0.2));

            add(100 + (50 + wobble) * cos(t), 70 + (50 + wobble) * sin(t), cos(t), sin(t));
            add(100 + (64 + wobble) * cos(t), 70 + (64 + wobble) * sin(t), -cos(t), -sin(t));
        }
        add_noise(250, seed);
        found = run(f.skeleton, seed == 3 ? 0 : 5, seed == 3 ? 0 : 9);
        check(&found, &params);
        assert_true(found.part_count >= 2);
    }
    test_pool_free(&f.pool);
}

/* The steepness of edges, and their brighter side, do not matter. */
static void contrast_does_not_count(void **state)
{
    cairn_skeleton_grouping_params params = small_params();
    struct fixture f = with(params);
    cairn_skeleton_grouping_result found;
    cairn_real first;
    int32_t parts;

    (void)state;
    add_bar(40, 60, 150, 80, 8, 2);
    add_noise(100, 3);
    found = run(f.skeleton, 6, 10);
    first = found.parts[0].log_odds;
    parts = found.part_count;
    for (int32_t i = 0; i < edgel_count; i++) {
        edgels[i].gradient_magnitude = (cairn_real)(1 + i % 7 * 5);
        edgels[i].normal = cairn_vec2_scale(edgels[i].normal, i % 3 ? 1 : -1);
    }
    found = run(f.skeleton, 6, 10);
    assert_int_equal(found.part_count, parts);
    assert_near(found.parts[0].log_odds, first, NUMBER(1e-9, 1e-3));
    test_pool_free(&f.pool);
}

/* ---- Bad and little input ---- */

static void little_or_nothing(void **state)
{
    cairn_skeleton_grouping_params params = small_params();
    struct fixture f = with(params);
    cairn_skeleton_grouping_result found = run(f.skeleton, 5, 10);
    cairn_polyline_segment line;
    cairn_real radius;
    cairn_vec2 at;

    (void)state;
    assert_int_equal(found.part_count, 0);
    assert_int_equal(found.centre_count, 0);
    assert_false(cairn_skeleton_grouping_centre_point(f.skeleton, 0, &at, &radius));
    assert_false(cairn_skeleton_grouping_mirror_line(f.skeleton, 0, &line));
    assert_false(cairn_skeleton_grouping_mirror_line(f.skeleton, -1, &line));
    assert_false(cairn_skeleton_grouping_centre_point(NULL, 0, &at, &radius));
    assert_false(cairn_skeleton_grouping_mirror_line(NULL, 0, &line));
    found = run(f.skeleton, 0, 0);
    assert_int_equal(found.part_count, 0);
    assert_nothing_at_one_place(f.skeleton);
    place_far_edgels();
    found = run(f.skeleton, 5, 10);
    check(&found, &params);
    test_pool_free(&f.pool);
}

/* A line of CPs whose contours end: all particles die at once, and an isolated CP is no part. */
static void all_particles_die(void **state)
{
    cairn_skeleton_grouping_params params = small_params();
    struct fixture f;
    cairn_skeleton_grouping_result found;

    (void)state;
    params.step_sigma = CAIRN_REAL(0.3);
    f = with(params);
    add_bar(40, 60, 150, 80, 8, 2);
    found = run(f.skeleton, 6, 10);
    assert_true(found.centre_count > 100 && found.seed_count > 0);
    assert_int_equal(found.part_count, 0);
    test_pool_free(&f.pool);
}

/* Tens of thousands of CPs, evenly thinned, and circles full of edgels: bounded, and the results
 * are right. */
static void dense_clusters_are_thinned(void **state)
{
    cairn_skeleton_grouping_params params = small_params();
    struct fixture f;
    cairn_skeleton_grouping_result found;
    int32_t listed = 0;
    cairn_real radius;
    cairn_vec2 at;

    (void)state;
    params.max_centres = 1001;
    params.max_steps = 6;
    params.particle_count = 4;
    params.step_sigma = 12;
    f = with(params);
    add_noise(2900, 7);
    found = run(f.skeleton, 4, 20);
    check(&found, &params);
    assert_true(found.centre_count > 10000);
    while (cairn_skeleton_grouping_centre_point(f.skeleton, listed, &at, &radius))
        listed++;
    assert_in_range(listed, 1001 / 2, 1001);
    test_pool_free(&f.pool);
}

static void small_capacities(void **state)
{
    (void)state;
    for (int32_t k = 0; k < 6; k++) {
        cairn_skeleton_grouping_params params = small_params();
        int32_t *field[] = {&params.max_lines, &params.max_parts,      &params.max_points,
                            &params.max_steps, &params.particle_count, &params.max_centres};
        cairn_skeleton_grouping_result found;
        struct fixture f;

        *field[k] = k == 2 ? 2 * params.max_steps + 2 : k == 5 ? 40 : 1;
        f = with(params);
        add_bar(40, 60, 150, 80, 8, 2);
        add_bar(30, 120, 170, 120, 7, 2);
        found = run(f.skeleton, 6, 10);
        check(&found, &params);
        assert_true(k != 1 || (found.part_count == 0 && found.dropped_seed_count > 0));
        assert_true(k != 2 || (found.seed_count == 1 && found.dropped_seed_count > 0));
        assert_true(k != 0 || found.seed_count <= 1);
        test_pool_free(&f.pool);
    }
}

/* ---- Budgets ---- */

static void draw_scene(void)
{
    edgel_count = 0;
    add_bar(40, 60, 110, 75, 8, 2);
    add_noise(60, 3);
}

static void budgets_do_not_matter(void **state)
{
    cairn_skeleton_grouping_params params = small_params();
    struct fixture f;

    (void)state;
    params.particle_count = 4;
    params.max_steps = 20;
    params.max_centres = 300;
    f = with(params);
    draw_scene();
    assert_golden(assert_any_budget(f.skeleton), UINT64_C(0x10af5b3f1778db99),
                  UINT64_C(0xa7d47d245f5fd171));
    test_pool_free(&f.pool);
}

static void it_begins_anew(void **state)
{
    cairn_skeleton_grouping_params params = small_params();
    struct fixture f;
    test_stepped object;

    (void)state;
    params.particle_count = 4;
    params.max_steps = 20;
    params.max_centres = 300;
    f = with(params);
    object = (test_stepped){begin_scene, step_scene, result_hash, f.skeleton};
    draw_scene();
    test_begins_anew(&object, 9);
    test_pool_free(&f.pool);
}

static void memory_is_exactly_as_stated(void **state)
{
    cairn_skeleton_grouping_params params = small_params();

    (void)state;
    params.max_width = params.max_height = 20;
    params.max_edgels = params.max_centres = params.max_points = 9;
    params.max_lines = params.max_parts = params.max_steps = params.particle_count = 1;
    test_every_pool_size(create_in, &params, cairn_skeleton_grouping_memory(&params));
    assert_true(cairn_skeleton_grouping_memory(&params) > 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_bar_has_its_axis),      cmocka_unit_test(clutter_and_bends_are_checked),
        cmocka_unit_test(contrast_does_not_count), cmocka_unit_test(little_or_nothing),
        cmocka_unit_test(all_particles_die),       cmocka_unit_test(dense_clusters_are_thinned),
        cmocka_unit_test(small_capacities),        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(it_begins_anew),          cmocka_unit_test(memory_is_exactly_as_stated),
    };
    return cmocka_run_group_tests_name("skeleton_written", tests, NULL, NULL);
}
