/* Defaults that neither a table of parameters nor the comment of a field holds: nested params that
 * differ from the defaults of their module, params as written or for a size, structs of the host. All
 * others are compared with the comments of their headers (tools/docs-defaults.sh). */
#include "tests/test.h"

#include "cairn/filter_mapper.h"
#include "cairn/map_file.h"
#include "cairn/object_detect.h"
#include "cairn/occupancy_grid.h"
#include "cairn/place_map.h"
#include "cairn/pose_graph.h"
#include "cairn/report.h"
#include "cairn/skeleton_grouping.h"
#include "cairn/virtual_align.h"

typedef struct value {
    const char *name;
    double is, should_be;
} value;

#define VALUE(field, should_be)                                                                    \
    {                                                                                              \
#field, (double)(field), should_be                                                         \
    }
#define assert_values(table)          check(table, sizeof(table) / sizeof *(table))
#define assert_same(params, expected) assert_memory_equal(&(params), &(expected), sizeof(expected))

static void check(const value *table, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (!(table[i].is >= table[i].should_be - 1e-7 && table[i].is <= table[i].should_be + 1e-7))
            fail_msg("%s is %.9g, not %.9g", table[i].name, table[i].is, table[i].should_be);
}

#define DEGREES(angle) ((angle) * (CAIRN_PI / 180))

/* ---- Nested params ---- */

static void a_scan_fits_lines_by_the_defaults_of_the_polyline(void **state)
{
    const cairn_scan_params scan = cairn_scan_default();
    const cairn_polyline_params line = cairn_polyline_default();

    (void)state;
    assert_same(scan.fit, line);
}

static void the_mapper_tunes_scan_icp_and_force_field(void **state)
{
    const cairn_mapper_params p = cairn_mapper_default();
    cairn_scan_params scan = cairn_scan_default();
    cairn_icp_params icp = cairn_icp_default();
    cairn_force_field_params field = cairn_force_field_default();

    (void)state;
    scan.max_points = 1024;
    icp.weak_ratio = CAIRN_REAL(0.03);
    icp.max_iterations = 25;
    field.sigma_start = CAIRN_REAL(0.04);
    field.sigma_end = CAIRN_REAL(0.02);
    field.dt_start = CAIRN_REAL(0.01);
    field.dt_end = CAIRN_REAL(0.005);
    field.roi = CAIRN_FORCE_FIELD_ROI_NONE;
    field.max_steps = 10;
    assert_same(p.scan, scan);
    assert_same(p.icp, icp);
    assert_same(p.field, field);
}

static void the_place_map_tunes_match_consensus_and_aligner(void **state)
{
    const cairn_place_map_params map = cairn_place_map_default();
    cairn_scan_match_params match = cairn_scan_match_default();
    cairn_pose_consensus_params consensus = cairn_pose_consensus_default();
    cairn_aligner_params aligner = cairn_aligner_default();

    (void)state;
    match.max_candidates = 768;
    match.vote_once = 0;
    match.max_hypotheses = 40;
    consensus.max_hypotheses = 4096;
    consensus.min_ambiguous_weight = CAIRN_REAL(1e-5);
    consensus.significant_support = 12;
    aligner.max_segments = 4096;
    aligner.max_fill = 8192;
    assert_same(map.match, match);
    assert_same(map.consensus, consensus);
    assert_same(map.aligner, aligner);
}

static void virtual_scans_tune_hough_and_rectangles(void **state)
{
    const cairn_virtual_scan_params scans = cairn_virtual_scan_default();
    cairn_hough_params hough = cairn_hough_default();
    cairn_rectangle_params rectangle = cairn_rectangle_default();
    const cairn_ellipse_params ellipse = cairn_ellipse_default();

    (void)state;
    hough.angles = 72;
    hough.distances = 128;
    hough.distance_step = CAIRN_REAL(0.1);
    hough.angle_tolerance = DEGREES(4);
    hough.separation_angle = DEGREES(6);
    hough.spacing = CAIRN_REAL(0.2);
    hough.min_votes = 10;
    rectangle.merge_distance = CAIRN_REAL(0.15);
    rectangle.merge_gap = 3;
    rectangle.max_angle_error = DEGREES(10);
    rectangle.min_side = 1;
    rectangle.min_side_coverage = CAIRN_REAL(0.3);
    rectangle.min_coverage = CAIRN_REAL(0.55);
    assert_same(scans.hough, hough);
    assert_same(scans.rectangle, rectangle);
    assert_same(scans.ellipse, ellipse);
}

static void alignment_with_virtual_scans_tunes_field_and_hypotheses(void **state)
{
    const cairn_virtual_align_params align = cairn_virtual_align_default();
    const cairn_weak_direction_params weak_direction = cairn_weak_direction_default();
    const value values[] = {
        VALUE(align.field.sigma_start, 0.9), VALUE(align.field.mode, CAIRN_FORCE_FIELD_SPRINGS),
        VALUE(align.field.sigma_end, 0.03),  VALUE(align.field.oriented_below, 0.9),
        VALUE(align.field.max_steps, 15),    VALUE(align.field.potential, 0),
        VALUE(align.field.roi, 0),           VALUE(align.hypotheses.spacing, 0.3),
        VALUE(align.hypotheses.weight, 3),
    };

    (void)state;
    assert_values(values);
    assert_same(align.weak_direction, weak_direction);
}

/* ---- As written, in float, and for a size ---- */

static void a_pose_graph_in_float_converges_earlier(void **state)
{
    const cairn_pose_graph_params graph = cairn_pose_graph_default();

    (void)state;
    assert_near(graph.converged_decrease * 100000, NUMBER(1e-4, 1), 1e-7);
}

static void skeletons_as_written(void **state)
{
    const cairn_skeleton_grouping_params p = cairn_skeleton_grouping_as_written();
    cairn_skeleton_grouping_params written = cairn_skeleton_grouping_default();

    (void)state;
    written.mode = CAIRN_MODE_AS_WRITTEN;
    written.max_centres = 8000;
    written.max_points = 32768;
    written.max_parts = 512;
    written.max_steps = 256;
    written.particle_count = 50;
    written.radius_sigma = 2;
    written.symmetry_sigma = DEGREES(10);
    written.stop_log_odds = 2;
    written.min_log_odds = 12;
    assert_same(p, written);
}

static void a_mapper_by_particles_for_a_number_of_keyframes_beams_and_particles(void **state)
{
    const cairn_filter_mapper_params p = cairn_filter_mapper_default_for(9, 181, 4);
    cairn_filter_mapper_params sized = cairn_filter_mapper_default();

    (void)state;
    sized.particles = 4;
    sized.front = cairn_mapper_default_for(9, 181);
    assert_same(p, sized);
    assert_int_equal(p.front.max_keyframes, 9);
    assert_int_equal(p.front.scan.max_beams, 181);
}

static void objects_of_an_image_of_a_size(void **state)
{
    const cairn_object_detect_params detect = cairn_object_detect_default(300, 400);
    const value values[] = {
        VALUE(detect.min_size, 50),
        VALUE(detect.max_size, 500),
        VALUE(detect.max_width, 300),
        VALUE(detect.max_height, 400),
    };

    (void)state;
    assert_values(values);
}

/* ---- Without params ---- */

static void maps_and_their_pictures(void **state)
{
    const cairn_occupancy_grid_thresholds thresholds = cairn_occupancy_grid_thresholds_default();
    const cairn_map_file map = cairn_map_file_default();
    const cairn_report_map report = cairn_report_map_default();
    const value values[] = {
        VALUE(thresholds.occupied, 0.25),
        VALUE(thresholds.free, 0.1),
        VALUE(map.width, 0),
        VALUE(map.height, 0),
        VALUE(map.resolution, 0.05),
        VALUE(map.origin.x, 0),
        VALUE(map.origin.y, 0),
        VALUE(map.origin.theta, 0),
        VALUE(map.negate, 0),
        VALUE(map.occupied_threshold, 0.65),
        VALUE(map.free_threshold, 0.196),
        VALUE(map.mode, CAIRN_MAP_FILE_TRINARY),
        VALUE(map.pixel != NULL, 0),
        VALUE(map.occupancy != NULL, 0),
        VALUE(report.connect, 1),
        VALUE(report.colour_scans, 0),
        VALUE(report.max_elements, 20000),
        VALUE(report.width, 1200),
    };

    (void)state;
    assert_values(values);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_scan_fits_lines_by_the_defaults_of_the_polyline),
        cmocka_unit_test(the_mapper_tunes_scan_icp_and_force_field),
        cmocka_unit_test(the_place_map_tunes_match_consensus_and_aligner),
        cmocka_unit_test(virtual_scans_tune_hough_and_rectangles),
        cmocka_unit_test(alignment_with_virtual_scans_tunes_field_and_hypotheses),
        cmocka_unit_test(a_pose_graph_in_float_converges_earlier),
        cmocka_unit_test(skeletons_as_written),
        cmocka_unit_test(a_mapper_by_particles_for_a_number_of_keyframes_beams_and_particles),
        cmocka_unit_test(objects_of_an_image_of_a_size),
        cmocka_unit_test(maps_and_their_pictures),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
