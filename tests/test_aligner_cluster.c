/* Clusters of the aligner: frames of scans when their cluster is rotated, and the circles by which
 * neighbours are found. */
#include "tests/test.h"

#include <math.h>

#include "src/alignment/aligner_work.h"
#include "tests/rooms.h"

enum { SCANS = 12 };

/* Scans of a room with a pillar; the origin of each frame is `off` m from the sensor. */
static cairn_aligner *take_scans(cairn_pool *pool, uint64_t seed, cairn_real off)
{
    cairn_scan_params scan_params = cairn_scan_default();
    cairn_aligner_params params = cairn_aligner_default();
    cairn_pool scan_pool = test_pool(cairn_scan_memory(&scan_params));
    cairn_random random = cairn_random_seed(seed, 3);
    rooms_room room = {.count = 0};
    cairn_aligner *aligner;
    cairn_scan *scan;

    rooms_add_box(&room, 0, 0, 40, 6);
    rooms_add_box(&room, 18, 2, 19, 3);
    params.max_points = 8192;
    params.max_segments = 2048;
    *pool = test_pool(cairn_aligner_memory(&params));
    assert_ok(cairn_aligner_create(&aligner, pool, &params));
    assert_ok(cairn_scan_create(&scan, &scan_pool, &scan_params));
    for (int32_t i = 0; i < SCANS; i++) {
        cairn_pose pose = {cairn_random_uniform(&random, 1, 17),
                           cairn_random_uniform(&random, 1, 5),
                           cairn_random_uniform(&random, -3, 3)};
        cairn_budget budget = {CAIRN_UNBOUNDED};
        rooms_scan taken;
        cairn_scan_input input;
        cairn_scan_view view;

        if (i % 2)
            pose.x += 22;
        input = rooms_take_scan(&room, pose, seed + (uint64_t)i, &taken);
        input.base_sensor.x += off;
        assert_ok(cairn_scan_begin(scan, &input, NULL));
        assert_ok(cairn_scan_step(scan, &budget));
        view = cairn_scan_read(scan);
        assert_ok(cairn_aligner_add_scan(aligner, &view, pose, NULL));
    }
    test_pool_free(&scan_pool);
    return aligner;
}

/* The extent of a scan reaches from the origin of its frame to the far side of its circle, in
 * which everything lies. */
static void nothing_lies_beyond_the_extent(void **state)
{
    static const cairn_real offs[] = {0, CAIRN_REAL(0.3), 5};

    (void)state;
    for (size_t k = 0; k < sizeof offs / sizeof *offs; k++) {
        cairn_pool pool;
        cairn_aligner *aligner = take_scans(&pool, 11 + k, offs[k]);

        for (int32_t i = 0; i < SCANS; i++) {
            const aligner_scan *s = &aligner->scans[i];
            double extent = hypot((double)s->middle.x, (double)s->middle.y) + (double)s->radius;

            assert_near((double)s->extent, extent, NUMBER(1e-12, 1e-5));
            assert_true(cairn_aligner_points_of(aligner, i) > 0);
            for (int32_t p = s->first_point; p < s->end_point; p++) {
                cairn_vec2 at = aligner->points[p].position;
                double from = hypot((double)(at.x - s->middle.x), (double)(at.y - s->middle.y));

                assert_true(from <= (double)s->radius * (1 + 1e-5));
                assert_true(hypot((double)at.x, (double)at.y) <= (double)s->extent * (1 + 1e-5));
            }
        }
        test_pool_free(&pool);
    }
}

/* Scans are candidate pairs when one may show a point of the other, whatever the extents of distant
 * ones. */
static void candidate_pairs_are_those_that_may_overlap(void **state)
{
    cairn_pool pool;
    cairn_aligner *aligner = take_scans(&pool, 21, 0);
    cairn_budget budget = {CAIRN_UNBOUNDED};
    int32_t met = 0;

    (void)state;
    assert_ok(cairn_aligner_begin(aligner));
    assert_int_equal(cairn_aligner_find_neighbours(aligner, &budget), 1);
    for (int32_t i = 0; i < SCANS; i++)
        for (int32_t j = 0; j < SCANS; j++)
            if (i != j &&
                cairn_aligner_may_overlap(aligner, i, j, aligner->poses[i], aligner->poses[j])) {
                assert_true(cairn_aligner_has_neighbour(aligner, i, j, ALIGNER_MAX_NEIGHBOURS));
                met++;
            }
    assert_in_range(met, SCANS, SCANS * (SCANS - 1));
    test_pool_free(&pool);
}

/* The pending motion of a scan is rotated with the cluster in which it joins another. */
static void pending_motions_turn_with_their_cluster(void **state)
{
    cairn_transform same = {0, 0, 1, 0},
                    turned = cairn_transform_of((cairn_pose){3, -2, CAIRN_REAL(0.7)});
    static const cairn_real rows[3][3] = {
        {1, 0, CAIRN_REAL(0.5)}, {CAIRN_REAL(0.6), CAIRN_REAL(0.8), -1}, {0, 1, 2}};
    cairn_real before[3], after[3];
    cairn_pool pool;
    cairn_aligner *aligner = take_scans(&pool, 31, 0);
    aligner_sums *pull = &aligner->scans[3].normal_equations;
    int32_t fixed = 0;

    (void)state;
    assert_ok(cairn_aligner_begin(aligner));
    for (int32_t i = 1; i < 3; i++)
        fixed = cairn_aligner_merge_clusters(aligner, i, fixed, same);
    for (int k = 0; k < 3; k++) {
        cairn_sym3_add_outer(&pull->equations.information, rows[k], (cairn_real)(k + 1));
        pull->equations.gradient[k] = CAIRN_REAL(0.1) * (cairn_real)(k - 3);
    }
    pull->pairs = 3;
    assert_true(cairn_aligner_solve(pull, before));
    assert_int_equal(cairn_aligner_merge_clusters(aligner, 3, fixed, turned), fixed);
    assert_true(cairn_aligner_solve(pull, after));
    assert_near((double)after[0], (double)(turned.cosine * before[0] - turned.sine * before[1]),
                NUMBER(1e-12, 1e-5));
    assert_near((double)after[1], (double)(turned.sine * before[0] + turned.cosine * before[1]),
                NUMBER(1e-12, 1e-5));
    assert_near((double)after[2], (double)before[2], NUMBER(1e-12, 1e-5));
    test_pool_free(&pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nothing_lies_beyond_the_extent),
        cmocka_unit_test(candidate_pairs_are_those_that_may_overlap),
        cmocka_unit_test(pending_motions_turn_with_their_cluster),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
