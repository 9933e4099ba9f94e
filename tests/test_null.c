/* Steps refuse, where the header says so, a missing object or budget. Of creation: test_object.c. */
#include "tests/test.h"

#include "cairn/assignment.h"
#include "cairn/boundary.h"
#include "cairn/curve_evolution.h"
#include "cairn/edge_chain.h"
#include "cairn/edge_segment.h"
#include "cairn/edgel.h"
#include "cairn/fragment_match.h"
#include "cairn/inner_distance.h"
#include "cairn/scanner_check.h"
#include "cairn/self_similarity.h"
#include "cairn/map_merge.h"
#include "cairn/map_vote.h"
#include "cairn/mapper.h"
#include "cairn/part_bundle.h"
#include "cairn/part_configuration.h"
#include "cairn/place_map.h"
#include "cairn/pose_graph_robust.h"
#include "cairn/scan_map.h"
#include "cairn/scan_redundancy.h"
#include "cairn/sequence.h"
#include "cairn/shape_context.h"
#include "cairn/shape_model.h"
#include "cairn/silhouette.h"
#include "cairn/skeleton_grouping.h"
#include "cairn/symmetric_point.h"
#include "cairn/virtual_align.h"

/* type: of the object, without cairn_. */
#define STEPS(module, type)                                                                        \
    static void test_##module##_step(void **state)                                                 \
    {                                                                                              \
        cairn_##module##_params params = cairn_##module##_default();                               \
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
    X(map_vote, map_vote)                                                                          \
    X(mapper, mapper)                                                                              \
    X(part_bundle, part_bundle_builder)                                                            \
    X(part_configuration, part_configurator)                                                       \
    X(place_map, place_map)                                                                        \
    X(polyline, polyline)                                                                          \
    X(pose_consensus, pose_consensus)                                                              \
    X(pose_graph_robust, pose_graph_robust)                                                        \
    X(rectangle, rectangle_set)                                                                    \
    X(scan, scan)                                                                                  \
    X(scan_map, scan_map)                                                                          \
    X(scan_redundancy, scan_redundancy)                                                            \
    X(scan_match, scan_match)                                                                      \
    X(scanner_check, scanner_check)                                                                \
    X(sequence, sequence)                                                                          \
    X(shape_model_builder, shape_model_builder)                                                    \
    X(shape_context, shape_context)                                                                \
    X(silhouette, silhouette)                                                                      \
    X(skeleton_grouping, skeleton_grouping)                                                        \
    X(symmetric_point, symmetric_point_set)                                                        \
    X(virtual_align, virtual_align)                                                                \
    X(virtual_scan, virtual_scan)                                                                  \
    X(weak_direction, weak_direction)

STEPPED(STEPS)

#define STEP_TEST(module, type) cmocka_unit_test(test_##module##_step),

int main(void)
{
    const struct CMUnitTest tests[] = {STEPPED(STEP_TEST)};

    return cmocka_run_group_tests(tests, NULL, NULL);
}
