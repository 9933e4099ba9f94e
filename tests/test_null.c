/* Every object refuses missing arguments: creation without an object pointer, a pool or params;
 * steps, where the header says so, without an object or a budget. */
#include "tests/test.h"

#include "cairn/assignment.h"
#include "cairn/boundary.h"
#include "cairn/curve_evolution.h"
#include "cairn/edge_chain.h"
#include "cairn/edge_segment.h"
#include "cairn/edgel.h"
#include "cairn/fragment_match.h"
#include "cairn/inner_distance.h"
#include "cairn/self_similarity.h"
#include "cairn/lum.h"
#include "cairn/map_merge.h"
#include "cairn/mapper.h"
#include "cairn/occupancy_grid.h"
#include "cairn/part_bundle.h"
#include "cairn/part_configuration.h"
#include "cairn/place_map.h"
#include "cairn/scan_redundancy.h"
#include "cairn/sequence.h"
#include "cairn/shape_context.h"
#include "cairn/shape_model.h"
#include "cairn/skeleton_grouping.h"
#include "cairn/symmetric_point.h"
#include "cairn/virtual_align.h"

/* type: of the object, without cairn_. */
#define CREATES(module, type)                                                                      \
    static void test_##module##_create(void **state)                                               \
    {                                                                                              \
        cairn_##module##_params params = module##_params();                                        \
        cairn_pool pool = test_pool(cairn_##module##_memory(&params));                             \
        size_t before = pool.used;                                                                 \
        cairn_##type *object;                                                                      \
                                                                                                   \
        (void)state;                                                                               \
        assert_status(cairn_##module##_create(NULL, &pool, &params), CAIRN_BAD_ARGUMENT);          \
        assert_status(cairn_##module##_create(&object, NULL, &params), CAIRN_BAD_ARGUMENT);        \
        assert_status(cairn_##module##_create(&object, &pool, NULL), CAIRN_BAD_ARGUMENT);          \
        assert_int_equal(cairn_##module##_memory(NULL), 0);                                        \
        assert_int_equal(pool.used, before);                                                       \
        test_pool_free(&pool);                                                                     \
    }
#define STEPS(module, type)                                                                        \
    CREATES(module, type)                                                                          \
    static void test_##module##_step(void **state)                                                 \
    {                                                                                              \
        cairn_##module##_params params = module##_params();                                        \
        cairn_pool pool = test_pool(cairn_##module##_memory(&params));                             \
        cairn_budget budget = {100};                                                               \
        cairn_##type *object;                                                                      \
                                                                                                   \
        (void)state;                                                                               \
        assert_ok(cairn_##module##_create(&object, &pool, &params));                               \
        assert_status(cairn_##module##_step(NULL, &budget), CAIRN_BAD_ARGUMENT);                   \
        assert_status(cairn_##module##_step(object, NULL), CAIRN_BAD_ARGUMENT);                    \
        assert_int_equal(budget.left, 100);                                                        \
        test_pool_free(&pool);                                                                     \
    }
#define DEFAULT(module)                                                                            \
    static cairn_##module##_params module##_params(void)                                           \
    {                                                                                              \
        return cairn_##module##_default();                                                         \
    }

static cairn_scan_set_params scan_set_params(void)
{
    cairn_scan_set_params params = {
        .max_scans = 4, .max_segments = 40, .max_points = 400, .spacing = 0};

    return params;
}

static cairn_point_grid_params point_grid_params(void)
{
    cairn_point_grid_params params = {.max_points = 100, .cell_size = 1};

    return params;
}

static cairn_box_sweep_params box_sweep_params(void)
{
    cairn_box_sweep_params params = {.max_boxes = 100};

    return params;
}

static cairn_distance_map_params distance_map_params(void)
{
    cairn_distance_map_params params = {.max_width = 100};

    return params;
}

#define STEPPED(X)                                                                                 \
    X(aligner, aligner)                                                                            \
    X(assignment, assignment)                                                                      \
    X(boundary, boundary)                                                                          \
    X(corner, corner_set)                                                                          \
    X(edge_chain, edge_chain_set)                                                                  \
    X(edge_segment, edge_segment_set)                                                              \
    X(curve_evolution, curve_evolution)                                                            \
    X(inner_distance, inner_distance)                                                              \
    X(self_similarity, self_similarity)                                                            \
    X(edgel, edgel_set)                                                                            \
    X(ellipse, ellipse_set)                                                                        \
    X(force_field, force_field)                                                                    \
    X(fragment_match, fragment_matcher)                                                            \
    X(hough, hough)                                                                                \
    X(map_merge, map_merge)                                                                        \
    X(mapper, mapper)                                                                              \
    X(part_bundle, part_bundle_builder)                                                            \
    X(part_configuration, part_configurator)                                                       \
    X(place_map, place_map)                                                                        \
    X(polyline, polyline)                                                                          \
    X(pose_consensus, pose_consensus)                                                              \
    X(rectangle, rectangle_set)                                                                    \
    X(scan, scan)                                                                                  \
    X(scan_redundancy, scan_redundancy)                                                            \
    X(scan_match, scan_match)                                                                      \
    X(sequence, sequence)                                                                          \
    X(shape_model_builder, shape_model_builder)                                                    \
    X(shape_context, shape_context)                                                                \
    X(skeleton_grouping, skeleton_grouping)                                                        \
    X(symmetric_point, symmetric_point_set)                                                        \
    X(virtual_align, virtual_align)                                                                \
    X(virtual_scan, virtual_scan)                                                                  \
    X(weak_direction, weak_direction)

/* Steps whose headers say nothing of missing objects. */
#define OTHERS(X)                                                                                  \
    X(block_solver, block_solver)                                                                  \
    X(icp, icp)                                                                                    \
    X(lum, lum)                                                                                    \
    X(occupancy_grid, occupancy_grid)

#define DEFAULT_OF(module, type) DEFAULT(module)
STEPPED(DEFAULT_OF)
OTHERS(DEFAULT_OF)
STEPPED(STEPS)
OTHERS(CREATES)
CREATES(distance_map, distance_map)
CREATES(scan_set, scan_set)
CREATES(point_grid, point_grid)
CREATES(box_sweep, box_sweep)

#define CREATE_TEST(module, type) cmocka_unit_test(test_##module##_create),
#define STEP_TEST(module, type)   CREATE_TEST(module, type) cmocka_unit_test(test_##module##_step),

int main(void)
{
    const struct CMUnitTest tests[] = {STEPPED(STEP_TEST) OTHERS(CREATE_TEST) CREATE_TEST(
        distance_map, ) CREATE_TEST(scan_set, ) CREATE_TEST(point_grid, ) CREATE_TEST(box_sweep, )};

    return cmocka_run_group_tests(tests, NULL, NULL);
}
