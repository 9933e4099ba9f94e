/* Defaults. Those of the modules whose parameters are declared in a table are compared with the
 * comments of their headers (tools/docs-defaults.sh); the force field has its own test. */
#include "tests/test.h"

#include "cairn/aligner.h"
#include "cairn/carmen_log.h"
#include "cairn/contour_grouping.h"
#include "cairn/inner_distance.h"
#include "cairn/self_similarity.h"
#include "cairn/fragment_match.h"
#include "cairn/part_bundle.h"
#include "cairn/part_configuration.h"
#include "cairn/shape_context.h"
#include "cairn/filter_mapper.h"
#include "cairn/map_file.h"
#include "cairn/map_merge.h"
#include "cairn/mapper.h"
#include "cairn/object_detect.h"
#include "cairn/occupancy_grid.h"
#include "cairn/place_map.h"
#include "cairn/pose_consensus.h"
#include "cairn/pose_graph.h"
#include "cairn/report.h"
#include "cairn/scan_match.h"
#include "cairn/shape_model.h"
#include "cairn/skeleton_grouping.h"
#include "cairn/virtual_align.h"
#include "cairn/vision.h"

typedef struct value {
    const char *name;
    double is, should_be;
} value;

#define VALUE(field, should_be)                                                                    \
    {                                                                                              \
#field, (double)(field), should_be                                                         \
    }
#define assert_values(table) check(table, sizeof(table) / sizeof *(table))

static void check(const value *table, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (!(table[i].is >= table[i].should_be - 1e-7 && table[i].is <= table[i].should_be + 1e-7))
            fail_msg("%s is %.9g, not %.9g", table[i].name, table[i].is, table[i].should_be);
}

static const double DEGREE = 3.14159265358979323846 / 180;

static void of_map_merging(void **state)
{
    cairn_map_merge_params p = cairn_map_merge_default();
    const value values[] = {
        VALUE(p.max_maps, 16),
        VALUE(p.max_cells, 2560000),
        VALUE(p.max_map_cells, 160000),
        VALUE(p.max_points, 4096),
        VALUE(p.max_segments, 256),
        VALUE(p.max_corners, 48),
        VALUE(p.max_modes, 6),
        VALUE(p.particles, 100),
        VALUE(p.perception, CAIRN_MAP_MERGE_LIKELIHOOD_RATIO),
        VALUE(p.correlation_length, 10),
        VALUE(p.min_score, 6),
        VALUE(p.min_margin, 3),
        VALUE(p.seed, 1),
    };

    (void)state;
    assert_values(values);
}

static void of_aligning(void **state)
{
    cairn_aligner_params p = cairn_aligner_default();
    const value values[] = {
        VALUE(p.max_scans, 64),
        VALUE(p.max_segments, 1024),
        VALUE(p.max_short_segments, 256),
        VALUE(p.max_points, 4096),
        VALUE(p.max_hypotheses, 1536),
        VALUE(p.max_fill, 2048),
        VALUE(p.max_cells, 25600),
        VALUE(p.max_initial_error, 0.6),
        VALUE(p.max_initial_angle_error, 35 * DEGREE),
        VALUE(p.max_range, 30),
        VALUE(p.range_sigma, 0.01),
        VALUE(p.free_space_penalty, 1.5),
        VALUE(p.oriented, 1),
        VALUE(p.max_relocalizations, 2),
        VALUE(p.max_iterations, 10),
        VALUE(p.min_log_likelihood_ratio, 1),
        VALUE(p.observable_sigma, 0.05),
        VALUE(p.observable_sigma_theta, DEGREE),
    };

    (void)state;
    assert_values(values);
}

static void of_hypotheses(void **state)
{
    cairn_virtual_scan_params v = cairn_virtual_scan_default();
    cairn_virtual_align_params align = cairn_virtual_align_default();
    const value values[] = {
        VALUE(v.max_scans, 64),
        VALUE(v.max_points, 4096),
        VALUE(v.max_segments, 1024),
        VALUE(v.max_hypotheses, 64),
        VALUE(v.max_virtual, 4096),
        VALUE(v.max_detectors, 2),
        VALUE(v.lines, 1),
        VALUE(v.rectangles, 1),
        VALUE(v.ellipses, 1),
        VALUE(v.stride, 2),
        VALUE(v.spacing, 0.1),
        VALUE(v.weight, 1),
        VALUE(v.distance_per_sigma, 0.3),
        VALUE(v.angle_per_sigma, 0.2),
        VALUE(v.min_scans, 2),
        VALUE(v.min_wall_length, 0.5),
        VALUE(v.hough.angles, 72),
        VALUE(v.hough.distances, 128),
        VALUE(v.hough.distance_step, 0.1),
        VALUE(v.hough.angle_tolerance, 4 * DEGREE),
        VALUE(v.hough.separation_angle, 6 * DEGREE),
        VALUE(v.hough.spacing, 0.2),
        VALUE(v.hough.min_votes, 10),
        VALUE(v.rectangle.merge_distance, 0.15),
        VALUE(v.rectangle.merge_gap, 3),
        VALUE(v.rectangle.max_angle_error, 10 * DEGREE),
        VALUE(v.rectangle.min_side, 1),
        VALUE(v.rectangle.min_side_coverage, 0.3),
        VALUE(v.ellipse.cells, 96),
        VALUE(align.field.sigma_start, 0.9),
        VALUE(align.field.mode, CAIRN_FORCE_FIELD_SPRINGS),
        VALUE(align.field.sigma_end, 0.03),
        VALUE(align.field.oriented_below, 0.9),
        VALUE(align.field.max_steps, 15),
        VALUE(align.field.potential, 0),
        VALUE(align.field.roi, 0),
        VALUE(align.hypotheses.spacing, 0.3),
        VALUE(align.hypotheses.weight, 3),
        VALUE(align.weak_direction.use_thickness, 1),
        VALUE(align.weak_direction.max_scans, 64),
        VALUE(align.weak_direction.max_walls, 1024),
        VALUE(align.weak_direction.max_submaps, 24),
        VALUE(align.weak_direction.weak_sigma, 0.03),
        VALUE(align.weak_direction.max_cross_sigma, 0.05),
        VALUE(align.weak_direction.max_sigma_theta, DEGREE),
        VALUE(align.weak_direction.translation_step, 0.02),
        VALUE(align.weak_direction.thickness_sigma, 0.02),
        VALUE(align.rebuild_interval, 8),
        VALUE(align.max_rounds, 2),
        VALUE(align.use_aligner, 1),
    };

    (void)state;
    assert_values(values);
}

static void of_lines_and_scans(void **state)
{
    cairn_polyline_params line = cairn_polyline_default();
    cairn_scan_params scan = cairn_scan_default();
    const value values[] = {
        VALUE(line.dim, 2),
        VALUE(line.max_points, 1024),
        VALUE(line.max_segments, 256),
        VALUE(line.min_points, 4),
        VALUE(line.max_iterations, 20),
        VALUE(line.min_length, 0.08),
        VALUE(line.sigma, 0.01),
        VALUE(line.width_first, 0.04),
        VALUE(line.width_last, 0.02),
        VALUE(line.width_decay, 0.5),
        VALUE(line.gap, 0.25),
        VALUE(line.gap_factor, 3),
        VALUE(line.gap_max, 1.5),
        VALUE(line.merge_angle, 0.26),
        VALUE(line.merge_distance, 0.1),
        VALUE(line.segment_penalty, 20),
        VALUE(line.tolerance, 0.001),
    };

    (void)state;
    assert_values(values);
    assert_memory_equal(&scan.fit, &line, sizeof line);
}

static void of_graphs(void **state)
{
    cairn_pose_graph_params graph = cairn_pose_graph_default();
    const value values[] = {
        VALUE(graph.converged_decrease * 100000, NUMBER(1e-4, 1)),
    };

    (void)state;
    assert_values(values);
}

static void of_places(void **state)
{
    cairn_place_map_params map = cairn_place_map_default();
    cairn_scan_match_params match = cairn_scan_match_default();
    cairn_pose_consensus_params consensus = cairn_pose_consensus_default();
    cairn_aligner_params aligner = cairn_aligner_default();
    const value values[] = {
        VALUE(map.mode, CAIRN_PLACE_MAP_CONSENSUS),
        VALUE(map.max_places, 16),
        VALUE(map.max_scans, 64),
        VALUE(map.max_place_points, 1024),
        VALUE(map.max_place_beams, 2048),
        VALUE(map.recent_places, 3),
        VALUE(map.rematch_rounds, 4),
        VALUE(map.refinement_sweeps, 10),
        VALUE(map.decoupled, 0),
        VALUE(map.visibility_reach, 8),
        VALUE(map.visibility_cell, 0.05),
        VALUE(map.visibility_margin, 0.1),
        VALUE(map.surface_nats, 0.05),
        VALUE(map.dynamic_nats, 0.25),
        VALUE(map.opposite_face_nats, 0.3),
        VALUE(map.rough_surface_nats, 0.65),
        VALUE(map.free_area_nats, 1.6),
        VALUE(map.free_space_penalty, 0.6),
        VALUE(map.dynamic_factor, 0.05),
        VALUE(map.chance_nats, 0),
        VALUE(map.match.mode, (double)match.mode),
        VALUE(map.match.max_candidates, 768),
        VALUE(map.match.vote_once, 0),
        VALUE(map.match.max_hypotheses, 40),
        VALUE(map.match.spacing, (double)match.spacing),
        VALUE(map.match.min_sigma, (double)match.min_sigma),
        VALUE(map.match.weak_ratio, (double)match.weak_ratio),
        VALUE(map.aligner.max_segments, 4096),
        VALUE(map.aligner.max_fill, 8192),
        VALUE(map.aligner.max_initial_error, (double)aligner.max_initial_error),
        VALUE(map.aligner.range_sigma, (double)aligner.range_sigma),
        VALUE(map.consensus.max_hypotheses, 4096),
    };

    (void)state;
    assert_values(values);
    consensus.max_hypotheses = 4096;
    consensus.min_ambiguous_weight = CAIRN_REAL(1e-5);
    consensus.significant_support = 12;
    assert_memory_equal(&map.consensus, &consensus, sizeof consensus);
}

static void of_the_mapper_by_particles(void **state)
{
    cairn_filter_mapper_params p = cairn_filter_mapper_default(),
                               sized = cairn_filter_mapper_default_for(9, 181, 4);
    const value values[] = {
        VALUE(p.particles, 30),
        VALUE(p.candidates, 6),
        VALUE(p.scored_points, 60),
        VALUE(p.local_keyframes, 10),
        VALUE(p.max_local_points, 2048),
        VALUE(p.recent_keyframes, 25),
        VALUE(p.local_radius, 4),
        VALUE(p.motion_distance, 0.05),
        VALUE(p.motion_turn, 0.05),
        VALUE(p.motion_distance_min, 0.02),
        VALUE(p.motion_turn_min, 0.01),
        VALUE(p.match_sigma, 0.0025),
        VALUE(p.match_sigma_theta, 0.001),
        VALUE(p.min_overlap, 0.3),
        VALUE(p.sigma, 0.07),
        VALUE(p.max_point_cost, 3),
        VALUE(p.independent_points, 8),
        VALUE(p.seed, 1),
        VALUE(sized.particles, 4),
        VALUE(sized.candidates, 6),
        VALUE(p.front.max_keyframes, 1024),
        VALUE(p.front.keyframe_distance, 0.5),
        VALUE(sized.front.max_keyframes, 9),
        VALUE(sized.front.scan.max_beams, 181),
    };

    (void)state;
    assert_values(values);
}

static void of_the_mapper(void **state)
{
    cairn_mapper_params p = cairn_mapper_default();
    cairn_scan_params scan = cairn_scan_default();
    cairn_icp_params icp = cairn_icp_default();
    cairn_force_field_params field = cairn_force_field_default();
    const value values[] = {
        VALUE(p.scan.max_points, 1024),
        VALUE(p.max_keyframes, 1024),
        VALUE(p.cull_keyframes, 0),
        VALUE(p.max_keyframe_segments, 32768),
        VALUE(p.max_keyframe_points, 131072),
        VALUE(p.max_local_points, 4096),
        VALUE(p.local_keyframes, 15),
        VALUE(p.local_recent, 3),
        VALUE(p.local_span, 25),
        VALUE(p.search, 1),
        VALUE(p.search_units, 155000),
        VALUE(p.window_units, 32000),
        VALUE(p.keyframe_min_overlap, 0.6),
        VALUE(p.motion_distance, 0.3),
        VALUE(p.motion_turn, 0.3),
        VALUE(p.motion_distance_min, 0.03),
        VALUE(p.motion_turn_min, 0.02),
        VALUE(p.local_radius, 4),
        VALUE(p.loop.max_loops, 4096),
        VALUE(p.loop.max_fill, 32768),
        VALUE(p.loop.units_per_scan, 8000),
        VALUE(p.loop.target_keyframes, 9),
        VALUE(p.loop.min_keyframe_gap, 25),
        VALUE(p.loop.min_consistent, 3),
        VALUE(p.loop.candidate_radius, 3),
        VALUE(p.loop.search_radius, 4),
        VALUE(p.loop.local_search_radius, 0.6),
        VALUE(p.loop.min_log_odds, 2),
        VALUE(p.loop.max_free_space_violation, 0.1),
        VALUE(p.loop.sigma, 0.01),
        VALUE(p.loop.sigma_theta, 0.004),
        VALUE(p.loop.max_chi2, 50),
        VALUE(p.keyframe_distance, 0.5),
        VALUE(p.keyframe_angle, 0.5),
        VALUE(p.window, 8),
        VALUE(p.window_free, 3),
        VALUE(p.odometry_distance, 0.3),
        VALUE(p.odometry_turn, 0.3),
        VALUE(p.odometry_distance_min, 0.01),
        VALUE(p.odometry_turn_min, 0.005),
        VALUE(p.min_overlap, 0.3),
        VALUE(p.field.sigma_start, 0.04),
        VALUE(p.field.sigma_end, 0.02),
        VALUE(p.field.dt_start, 0.01),
        VALUE(p.field.dt_end, 0.005),
        VALUE(p.field.roi, 0),
        VALUE(p.field.max_steps, 10),
        /* All other fields equal the modules' own defaults. */
        VALUE(p.field.mode, (double)field.mode),
        VALUE(p.field.max_scans, (double)field.max_scans),
        VALUE(p.field.max_segments, (double)field.max_segments),
        VALUE(p.field.max_points, (double)field.max_points),
        VALUE(p.field.max_corners, (double)field.max_corners),
        VALUE(p.field.sigma_step, (double)field.sigma_step),
        VALUE(p.field.dt_factor, (double)field.dt_factor),
        VALUE(p.field.reach, (double)field.reach),
        VALUE(p.field.sensor_below, (double)field.sensor_below),
        VALUE(p.field.roi_radius, (double)field.roi_radius),
        VALUE(p.field.roi_mass, (double)field.roi_mass),
        VALUE(p.field.corner_distance, (double)field.corner_distance),
        VALUE(p.field.corner_min_opening, (double)field.corner_min_opening),
        VALUE(p.field.corner_max_opening, (double)field.corner_max_opening),
        VALUE(p.field.potential, (double)field.potential),
        VALUE(p.field.stop_relocation, (double)field.stop_relocation),
    };

    (void)state;
    icp.weak_ratio = CAIRN_REAL(0.03);
    icp.max_iterations = 25;
    assert_values(values);
    scan.max_points = p.scan.max_points;
    assert_memory_equal(&p.scan, &scan, sizeof scan);
    assert_memory_equal(&p.icp, &icp, sizeof icp);
}

static void of_grids(void **state)
{
    cairn_occupancy_grid_params grid = cairn_occupancy_grid_default();
    cairn_occupancy_grid_thresholds thresholds = cairn_occupancy_grid_thresholds_default();
    const value values[] = {
        VALUE(grid.width, 400),      VALUE(grid.height, 400),   VALUE(grid.resolution, 0.05),
        VALUE(grid.origin.x, -10),   VALUE(grid.origin.y, -10), VALUE(thresholds.occupied, 0.25),
        VALUE(thresholds.free, 0.1),
    };

    (void)state;
    assert_values(values);
}

static void of_files(void **state)
{
    cairn_carmen_log_params log = cairn_carmen_log_default();
    cairn_map_file map = cairn_map_file_default();
    cairn_report_map report = cairn_report_map_default();
    const value values[] = {
        VALUE(log.range_max, 0),
        VALUE(log.range_sigma, 0.01),
        VALUE(log.on_fault != NULL, 0),
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

static void of_contours(void **state)
{
    cairn_shape_context_params context = cairn_shape_context_default();
    cairn_part_bundle_params bundle = cairn_part_bundle_default();
    cairn_fragment_match_params match = cairn_fragment_match_default();
    cairn_part_configuration_params configuration = cairn_part_configuration_default();
    cairn_object_detect_params detect = cairn_object_detect_default(300, 400);
    cairn_inner_distance_params inner = cairn_inner_distance_default();
    cairn_self_similarity_params similarity = cairn_self_similarity_default();
    cairn_skeleton_grouping_params skeleton = cairn_skeleton_grouping_default(),
                                   written = cairn_skeleton_grouping_as_written();
    cairn_shape_model_builder_params shape = cairn_shape_model_builder_default();
    cairn_contour_grouping_params group = cairn_contour_grouping_default();
    cairn_vision_canny_params canny = cairn_vision_canny_default();
    const value values[] = {
        VALUE(context.max_points, 128),
        VALUE(context.inner_radius, 0.125),
        VALUE(context.outer_radius, 2),
        VALUE(context.missing_cost, 1),
        VALUE(detect.min_size, 50),
        VALUE(detect.max_size, 500),
        VALUE(detect.mirror, 1),
        VALUE(detect.candidates, 30),
        VALUE(detect.overlap, 0.2),
        VALUE(detect.min_score, 0),
        VALUE(detect.method, CAIRN_OBJECT_DETECT_EVIDENCE),
        VALUE(detect.bundles, CAIRN_OBJECT_DETECT_BUNDLES),
        VALUE(detect.matches, 2),
        VALUE(detect.nearest, 20),
        VALUE(detect.modes_only, 0),
        VALUE(detect.appearance_nearest, 0),
        VALUE(bundle.max_points, 256),
        VALUE(bundle.bundles, 4),
        VALUE(bundle.pieces_each, 2),
        VALUE(bundle.max_pieces, 3),
        VALUE(bundle.samples_each, 20),
        VALUE(match.max_fragments, CAIRN_PART_MAX_FRAGMENTS),
        VALUE(match.samples_per_fragment, 20),
        VALUE(match.max_chains, 10000),
        VALUE(match.max_samples, 4096),
        VALUE(match.matches_per_fragment, 2),
        VALUE(match.min_scale, 24),
        VALUE(match.max_scale, 800),
        VALUE(match.min_step, 1.5),
        VALUE(match.step_ratio, 1.19),
        VALUE(match.zero_score_angle, 22.5 * DEGREE),
        VALUE(match.gap_cost, 0.5),
        VALUE(match.min_similarity, 0.5),
        VALUE(configuration.max_votes, 512),
        VALUE(configuration.nearest, 20),
        VALUE(configuration.min_parts, 2),
        VALUE(configuration.max_found, 64),
        VALUE(configuration.max_nodes, 1000000),
        VALUE(configuration.search, CAIRN_PART_SEARCH_NEAREST),
        VALUE(configuration.centre_tolerance, 0.08),
        VALUE(configuration.scale_tolerance, 0.15),
        VALUE(configuration.search_radius, 3),
        VALUE(configuration.overlap, 0.2),
        VALUE(inner.max_points, 128),
        VALUE(inner.fill_holes, 0),
        VALUE(similarity.mode, CAIRN_MODE_DEFAULT),
        VALUE(similarity.outline_samples, 96),
        VALUE(similarity.hole_samples, 48),
        VALUE(similarity.min_vertices, 5),
        VALUE(similarity.max_vertices, 20),
        VALUE(similarity.tie_ratio, 0.01),
        VALUE(similarity.tie_floor, 0.001),
        VALUE(similarity.separation, 0.05),
        VALUE(skeleton.max_width, 640),
        VALUE(skeleton.max_height, 480),
        VALUE(skeleton.max_edgels, 40000),
        VALUE(skeleton.max_centres, 4000),
        VALUE(skeleton.max_lines, 256),
        VALUE(skeleton.max_parts, 256),
        VALUE(skeleton.max_points, 8192),
        VALUE(skeleton.max_steps, 96),
        VALUE(skeleton.particle_count, 16),
        VALUE(skeleton.mode, CAIRN_MODE_DEFAULT),
        VALUE(skeleton.duality_sigma, 20 * DEGREE),
        VALUE(skeleton.step_sigma, 8),
        VALUE(skeleton.radius_sigma, 0.2),
        VALUE(skeleton.symmetry_sigma, 8 * DEGREE),
        VALUE(skeleton.detection_probability, 0.9),
        VALUE(skeleton.polarity_flip_probability, 0.05),
        VALUE(skeleton.stop_log_odds, 10),
        VALUE(skeleton.min_log_odds, 20),
        VALUE(skeleton.min_mirror_ratio, 0.6),
        VALUE(skeleton.seed, 1),
        VALUE(written.mode, CAIRN_MODE_AS_WRITTEN),
        VALUE(written.max_centres, 8000),
        VALUE(written.max_points, 32768),
        VALUE(written.max_parts, 512),
        VALUE(written.max_steps, 256),
        VALUE(written.particle_count, 50),
        VALUE(written.duality_sigma, 20 * DEGREE),
        VALUE(written.step_sigma, 8),
        VALUE(written.radius_sigma, 2),
        VALUE(written.symmetry_sigma, 10 * DEGREE),
        VALUE(written.stop_log_odds, 2),
        VALUE(written.min_log_odds, 12),
        VALUE(shape.outline_samples, 128),
        VALUE(shape.path_samples, 32),
        VALUE(shape.max_paths, 8),
        VALUE(shape.max_deviation, 20 * DEGREE),
        VALUE(shape.deviation_sigma, 10 * DEGREE),
        VALUE(shape.min_clearance, 0.8),
        VALUE(shape.min_outline_share, 0.08),
        VALUE(group.max_width, 1024),
        VALUE(group.max_height, 1024),
        VALUE(group.max_tokens, 8192),
        VALUE(group.max_samples, 64),
        VALUE(group.max_outline, 512),
        VALUE(group.particles, 300),
        VALUE(group.max_objects, 8),
        VALUE(group.token_length, 10),
        VALUE(group.deform_sigma, 0.025),
        VALUE(group.turn_sigma, 15 * DEGREE),
        VALUE(group.symmetry_sigma, 45 * DEGREE),
        VALUE(group.missing_likelihood, 0.3),
        VALUE(group.stop_likelihood, 0.3),
        VALUE(group.min_score, 0.2),
        VALUE(group.min_evidence, 13),
        VALUE(group.seed, 1),
        VALUE(canny.sigma, 1.4),
        VALUE(canny.low, 3),
        VALUE(canny.high, 8),
    };

    (void)state;
    assert_values(values);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(of_contours),        cmocka_unit_test(of_aligning),
        cmocka_unit_test(of_lines_and_scans), cmocka_unit_test(of_hypotheses),
        cmocka_unit_test(of_graphs),          cmocka_unit_test(of_places),
        cmocka_unit_test(of_the_mapper),      cmocka_unit_test(of_the_mapper_by_particles),
        cmocka_unit_test(of_grids),           cmocka_unit_test(of_files),
        cmocka_unit_test(of_map_merging),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
