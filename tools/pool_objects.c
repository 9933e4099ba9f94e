/* Table of all objects that take memory from a pool. */
#include "tools/pool_objects.h"

#include <string.h>

#include "cairn/aligner.h"
#include "cairn/appearance.h"
#include "cairn/assignment.h"
#include "cairn/boundary.h"
#include "cairn/contour_grouping.h"
#include "cairn/contour_search.h"
#include "cairn/curve_evolution.h"
#include "cairn/edge_chain.h"
#include "cairn/edge_segment.h"
#include "cairn/edgel.h"
#include "cairn/filter_mapper.h"
#include "cairn/inner_distance.h"
#include "cairn/lum.h"
#include "cairn/map_merge.h"
#include "cairn/map_vote.h"
#include "cairn/mapper.h"
#include "cairn/object_detect.h"
#include "cairn/occupancy_grid.h"
#include "cairn/particle_filter.h"
#include "cairn/place_map.h"
#include "cairn/pose_graph.h"
#include "cairn/pose_graph_robust.h"
#include "cairn/scan_map.h"
#include "cairn/scan_redundancy.h"
#include "cairn/angle_step.h"
#include "cairn/scanner_check.h"
#include "cairn/self_similarity.h"
#include "cairn/sequence.h"
#include "cairn/fragment_match.h"
#include "cairn/part_bundle.h"
#include "cairn/part_configuration.h"
#include "cairn/shape_context.h"
#include "cairn/shape_model.h"
#include "cairn/silhouette.h"
#include "cairn/skeleton_grouping.h"
#include "cairn/symmetric_point.h"
#include "cairn/virtual_align.h"

/* The params of any object. */
typedef struct any_params {
    _Alignas(16) unsigned char bytes[POOL_PARAMS_BYTES];
} any_params;

#define MEMORY_OF(module)                                                                          \
    static size_t module##_memory(const void *params)                                              \
    {                                                                                              \
        _Static_assert(sizeof(cairn_##module##_params) <= POOL_PARAMS_BYTES,                       \
                       "params of " #module);                                                      \
        return cairn_##module##_memory(params);                                                    \
    }
#define MODULE(module)                                                                             \
    static void module##_set_default(void *params)                                                 \
    {                                                                                              \
        *(cairn_##module##_params *)params = cairn_##module##_default();                           \
    }                                                                                              \
    MEMORY_OF(module)

/* Ranges and creation of a module whose parameters are declared in a table; those of an object whose
 * type is not named as the module. */
#define CHECKED_AS(module, type, ...)                                                              \
    extern const cairn_parameters cairn_##module##_parameters;                                     \
    static cairn_status module##_check(const void *params, cairn_object_fault *fault)              \
    {                                                                                              \
        return cairn_##module##_check(params, fault);                                              \
    }                                                                                              \
    static cairn_status module##_create(cairn_pool *pool, const void *params, int has_object)      \
    {                                                                                              \
        type *object;                                                                              \
                                                                                                   \
        return cairn_##module##_create(has_object ? &object : NULL, pool, __VA_ARGS__);            \
    }
#define CHECKED(module) CHECKED_AS(module, cairn_##module, params)

/* Module whose parameters are declared in a table. */
#define DECLARED(module)                                                                           \
    MODULE(module)                                                                                 \
    CHECKED(module)
#define DECLARED_AS(module, type)                                                                  \
    MODULE(module)                                                                                 \
    CHECKED_AS(module, type, params)

DECLARED(aligner)
DECLARED_AS(appearance, cairn_appearance_field)
DECLARED(assignment)
DECLARED(block_solver)
DECLARED(contour_grouping)
DECLARED(contour_search_tokenizer)
DECLARED_AS(corner, cairn_corner_set)
DECLARED_AS(edge_chain, cairn_edge_chain_set)
DECLARED_AS(edge_segment, cairn_edge_segment_set)
DECLARED_AS(edgel, cairn_edgel_set)
DECLARED(boundary)
DECLARED(curve_evolution)
DECLARED(inner_distance)
DECLARED(self_similarity)
DECLARED(filter_mapper)
DECLARED(force_field)
DECLARED(hough)
DECLARED(icp)
DECLARED(lum)
DECLARED(map_merge)
DECLARED(map_vote)
DECLARED(mapper)
DECLARED_AS(fragment_match, cairn_fragment_matcher)
DECLARED_AS(part_bundle, cairn_part_bundle_builder)
DECLARED_AS(part_configuration, cairn_part_configurator)
MODULE(particle_filter)
DECLARED(place_map)
DECLARED(polyline)
DECLARED(pose_consensus)
DECLARED_AS(rectangle, cairn_rectangle_set)
DECLARED_AS(ellipse, cairn_ellipse_set)
DECLARED(scan)
DECLARED(scan_redundancy)
DECLARED(scan_match)
DECLARED(pose_graph_robust)
DECLARED(scan_map)
DECLARED(scanner_check)
DECLARED(angle_step)
DECLARED(sequence)
DECLARED(shape_model_builder)
DECLARED(shape_context)
DECLARED(silhouette)
DECLARED(skeleton_grouping)
DECLARED_AS(symmetric_point, cairn_symmetric_point_set)
DECLARED(virtual_align)
DECLARED(virtual_scan)
DECLARED(weak_direction)

/* Objects whose defaults are those of an image. */
enum { IMAGE_WIDTH = 320, IMAGE_HEIGHT = 240 };
#define IMAGE_DEFAULT(module)                                                                      \
    static void module##_set_default(void *params)                                                 \
    {                                                                                              \
        *(cairn_##module##_params *)params = cairn_##module##_default(IMAGE_WIDTH, IMAGE_HEIGHT);  \
    }

IMAGE_DEFAULT(contour_search)
MEMORY_OF(contour_search)
CHECKED(contour_search)
IMAGE_DEFAULT(object_detect)
MEMORY_OF(object_detect)
CHECKED_AS(object_detect, cairn_object_detector, params)

/* The field has the params of the detector. */
static size_t object_detect_field_memory(const void *params)
{
    return cairn_object_detect_field_memory(params);
}

static cairn_status object_detect_field_create(cairn_pool *pool, const void *params, int has_object)
{
    cairn_object_detect_field *field;

    return cairn_object_detect_field_create(has_object ? &field : NULL, pool, params);
}

static void object_detect_by_parts_set_default(void *params)
{
    cairn_object_detect_params detect = cairn_object_detect_default(IMAGE_WIDTH, IMAGE_HEIGHT);

    detect.method = CAIRN_OBJECT_DETECT_PARTS;
    *(cairn_object_detect_params *)params = detect;
}

static void object_detect_as_written_set_default(void *params)
{
    *(cairn_object_detect_params *)params =
        cairn_object_detect_as_written(IMAGE_WIDTH, IMAGE_HEIGHT);
}

/* Objects without _default(): all capacities are set here. */
MEMORY_OF(point_grid)
CHECKED(point_grid)
MEMORY_OF(box_sweep)
CHECKED(box_sweep)
MEMORY_OF(distance_map)
CHECKED(distance_map)
MEMORY_OF(scan_set)
CHECKED(scan_set)
MEMORY_OF(occupancy_grid)
CHECKED(occupancy_grid)

/* A model that is never run. */
static cairn_status no_propose(void *context, cairn_particle_filter *filter, int32_t index,
                               cairn_budget *budget)
{
    (void)context, (void)filter, (void)index, (void)budget;
    return CAIRN_OK;
}

static cairn_status no_likelihood(void *context, const cairn_particle_filter *filter, int32_t index,
                                  const void *state, cairn_real *log_likelihood,
                                  cairn_budget *budget)
{
    (void)context, (void)filter, (void)index, (void)state, (void)budget;
    *log_likelihood = 0;
    return CAIRN_OK;
}

static const cairn_particle_filter_model no_model = {.propose = no_propose,
                                                     .likelihood = no_likelihood};

CHECKED_AS(particle_filter, cairn_particle_filter, params, &no_model)

static void point_grid_set_default(void *params)
{
    cairn_point_grid_params grid = {.max_points = 1000, .cell_size = 1};

    *(cairn_point_grid_params *)params = grid;
}

static void box_sweep_set_default(void *params)
{
    cairn_box_sweep_params sweep = {.max_boxes = 1000};

    *(cairn_box_sweep_params *)params = sweep;
}

static void distance_map_set_default(void *params)
{
    cairn_distance_map_params map = {.max_width = 100};

    *(cairn_distance_map_params *)params = map;
}

static void scan_set_set_default(void *params)
{
    cairn_scan_set_params set = {
        .max_scans = 64, .max_segments = 1024, .max_points = 8192, .spacing = 0};

    *(cairn_scan_set_params *)params = set;
}

/* One row of cells. */
static void occupancy_grid_set_default(void *params)
{
    cairn_occupancy_grid_params grid = cairn_occupancy_grid_default();

    grid.height = 1;
    *(cairn_occupancy_grid_params *)params = grid;
}

static void written_skeleton_set_default(void *params)
{
    *(cairn_skeleton_grouping_params *)params = cairn_skeleton_grouping_as_written();
}

/* With the built-in solver. */
static void pose_graph_set_default(void *params)
{
    *(cairn_pose_graph_params *)params = cairn_pose_graph_default();
}

static size_t pose_graph_memory(const void *params)
{
    return cairn_pose_graph_memory(params, NULL);
}

CHECKED_AS(pose_graph, cairn_pose_graph, params, NULL)

static void spaced_force_field_set_default(void *params)
{
    cairn_force_field_params field = cairn_force_field_spaced((cairn_real)0.125);

    field.mode = CAIRN_FORCE_FIELD_SPRINGS;
    field.max_bonds = 100;
    *(cairn_force_field_params *)params = field;
}

static void virtual_align_as_written_set_default(void *params)
{
    *(cairn_virtual_align_params *)params = cairn_virtual_align_as_written();
}

static void written_map_merge_set_default(void *params)
{
    *(cairn_map_merge_params *)params = cairn_map_merge_as_written();
}

static void written_part_configuration_set_default(void *params)
{
    *(cairn_part_configuration_params *)params = cairn_part_configuration_as_written();
}

#define OBJECT(module)                                                                             \
    .name = #module, .set_default = module##_set_default, .memory = module##_memory
#define HAS(module, name, field)                                                                   \
    {                                                                                              \
        name, #field, offsetof(cairn_##module##_params, field)                                     \
    }

#define DECLARATION(module)                                                                        \
    .parameters = &cairn_##module##_parameters, .check = module##_check, .create = module##_create

const pool_object pool_objects[] = {
    {OBJECT(scan),
     3,
     {HAS(scan, "beam", max_beams), HAS(scan, "segment", max_segments),
      HAS(scan, "point", max_points)},
     DECLARATION(scan)},
    {OBJECT(scan_set),
     3,
     {HAS(scan_set, "scan", max_scans), HAS(scan_set, "segment", max_segments),
      HAS(scan_set, "point", max_points)},
     DECLARATION(scan_set)},
    {OBJECT(scan_redundancy),
     2,
     {HAS(scan_redundancy, "scan", max_scans), HAS(scan_redundancy, "point", max_points)},
     DECLARATION(scan_redundancy)},
    {OBJECT(polyline),
     2,
     {HAS(polyline, "point", max_points), HAS(polyline, "segment", max_segments),
      HAS(polyline, "dimension", dim)},
     DECLARATION(polyline)},
    {OBJECT(sequence),
     2,
     {HAS(sequence, "element of the first", max_first),
      HAS(sequence, "element of the second", max_second)},
     DECLARATION(sequence)},
    {OBJECT(icp), 1, {HAS(icp, "point of the target", max_target)}, DECLARATION(icp)},
    {OBJECT(scan_match),
     1,
     {HAS(scan_match, "point of the target", max_target), HAS(scan_match, "dense point", max_dense),
      HAS(scan_match, "view", max_views), HAS(scan_match, "point of the query", max_query),
      HAS(scan_match, "hypothesis", max_hypotheses), HAS(scan_match, "candidate", max_candidates),
      HAS(scan_match, "cell", max_cells)},
     DECLARATION(scan_match)},
    {OBJECT(scanner_check),
     1,
     {HAS(scanner_check, "beam", max_beams), HAS(scanner_check, "point", max_points),
      HAS(scanner_check, "segment", max_segments), HAS(scanner_check, "pair of scans", max_pairs),
      HAS(scanner_check, "wall", max_walls)},
     DECLARATION(scanner_check)},
    {OBJECT(angle_step),
     1,
     {HAS(angle_step, "beam", max_beams), HAS(angle_step, "pair of scans", max_pairs)},
     DECLARATION(angle_step)},
    {OBJECT(corner),
     2,
     {HAS(corner, "segment", max_segments), HAS(corner, "corner", max_corners)},
     DECLARATION(corner)},
    {OBJECT(pose_graph),
     3,
     {HAS(pose_graph, "pose", max_poses), HAS(pose_graph, "link", max_links),
      HAS(pose_graph, "block of fill", max_fill)},
     DECLARATION(pose_graph)},
    {OBJECT(pose_graph_robust),
     1,
     {HAS(pose_graph_robust, "pose", max_poses)},
     DECLARATION(pose_graph_robust)},
    {OBJECT(lum),
     4,
     {HAS(lum, "scan", max_scans), HAS(lum, "point", max_points), HAS(lum, "link", max_links),
      HAS(lum, "block of fill", max_fill), HAS(lum, "registration", sequential_registration)},
     DECLARATION(lum)},
    {OBJECT(pose_consensus),
     2,
     {HAS(pose_consensus, "node", max_nodes), HAS(pose_consensus, "hypothesis", max_hypotheses),
      HAS(pose_consensus, "candidate", max_candidates),
      HAS(pose_consensus, "alternative", max_alternatives)},
     DECLARATION(pose_consensus)},
    {OBJECT(force_field),
     4,
     {HAS(force_field, "scan", max_scans), HAS(force_field, "segment", max_segments),
      HAS(force_field, "point", max_points), HAS(force_field, "corner", max_corners),
      HAS(force_field, "bond", max_bonds), HAS(force_field, "extra point", max_extra)},
     DECLARATION(force_field)},
    {OBJECT(aligner),
     5,
     {HAS(aligner, "scan", max_scans), HAS(aligner, "segment", max_segments),
      HAS(aligner, "point", max_points), HAS(aligner, "hypothesis", max_hypotheses),
      HAS(aligner, "block of fill", max_fill), HAS(aligner, "short segment", max_short_segments),
      HAS(aligner, "cell", max_cells)},
     DECLARATION(aligner)},
    {OBJECT(occupancy_grid), 1, {HAS(occupancy_grid, "cell", width)}, DECLARATION(occupancy_grid)},
    {OBJECT(scan_map), 1, {HAS(scan_map, "cell", max_cells)}, DECLARATION(scan_map)},
    {OBJECT(mapper),
     3,
     {HAS(mapper, "keyframe", max_keyframes),
      HAS(mapper, "keyframe segment", max_keyframe_segments),
      HAS(mapper, "key point", max_keyframe_points), HAS(mapper, "local point", max_local_points),
      HAS(mapper, "closure", loop.max_loops), HAS(mapper, "block of fill", loop.max_fill),
      HAS(mapper, "beam", scan.max_beams)},
     DECLARATION(mapper)},
    {OBJECT(filter_mapper),
     0,
     {HAS(filter_mapper, "keyframe", front.max_keyframes),
      HAS(filter_mapper, "particle", particles), HAS(filter_mapper, "candidate", candidates),
      HAS(filter_mapper, "point of a local map", max_local_points)},
     DECLARATION(filter_mapper)},
    {OBJECT(edge_chain),
     2,
     {HAS(edge_chain, "edge pixel", max_edges), HAS(edge_chain, "chain", max_chains)},
     DECLARATION(edge_chain)},
    {OBJECT(edge_segment),
     2,
     {HAS(edge_segment, "line", max_lines), HAS(edge_segment, "segment", max_segments)},
     DECLARATION(edge_segment)},
    {OBJECT(assignment),
     0,
     {HAS(assignment, "row", max_rows), HAS(assignment, "column", max_columns)},
     DECLARATION(assignment)},
    {OBJECT(shape_context),
     0,
     {HAS(shape_context, "point", max_points)},
     DECLARATION(shape_context)},
    {OBJECT(part_bundle),
     0,
     {HAS(part_bundle, "point", max_points),
      HAS(part_bundle, "sample of a fragment", samples_each)},
     DECLARATION(part_bundle)},
    {OBJECT(fragment_match),
     3,
     {HAS(fragment_match, "fragment", max_fragments), HAS(fragment_match, "chain", max_chains),
      HAS(fragment_match, "sample of a chain", max_samples),
      HAS(fragment_match, "match of a fragment", matches_per_fragment),
      HAS(fragment_match, "sample of a fragment", samples_per_fragment)},
     DECLARATION(fragment_match)},
    {OBJECT(part_configuration),
     2,
     {HAS(part_configuration, "vote", max_votes),
      HAS(part_configuration, "configuration", max_found)},
     DECLARATION(part_configuration)},
    {OBJECT(curve_evolution),
     1,
     {HAS(curve_evolution, "point", max_points)},
     DECLARATION(curve_evolution)},
    {OBJECT(inner_distance),
     0,
     {HAS(inner_distance, "point", max_points)},
     DECLARATION(inner_distance)},
    {OBJECT(self_similarity),
     0,
     {HAS(self_similarity, "point", outline_samples),
      HAS(self_similarity, "point of holes", hole_samples)},
     DECLARATION(self_similarity)},
    {OBJECT(boundary),
     1,
     {HAS(boundary, "column", max_width), HAS(boundary, "region", max_regions),
      HAS(boundary, "point", max_corners)},
     DECLARATION(boundary)},
    {OBJECT(silhouette),
     1,
     {HAS(silhouette, "pixel of ink", max_ink), HAS(silhouette, "column", max_width),
      HAS(silhouette, "outline", max_outlines)},
     DECLARATION(silhouette)},
    {OBJECT(edgel),
     1,
     {HAS(edgel, "edgel", max_edgels), HAS(edgel, "column", max_width)},
     DECLARATION(edgel)},
    {OBJECT(symmetric_point),
     2,
     {HAS(symmetric_point, "segment", max_segments), HAS(symmetric_point, "point", max_points)},
     DECLARATION(symmetric_point)},
    {OBJECT(contour_grouping),
     0,
     {HAS(contour_grouping, "token", max_tokens), HAS(contour_grouping, "particle", particles),
      HAS(contour_grouping, "sample of the outline", max_outline),
      HAS(contour_grouping, "object", max_objects)},
     DECLARATION(contour_grouping)},
    {OBJECT(skeleton_grouping),
     2,
     {HAS(skeleton_grouping, "edgel", max_edgels), HAS(skeleton_grouping, "centre", max_centres),
      HAS(skeleton_grouping, "line", max_lines), HAS(skeleton_grouping, "part", max_parts),
      HAS(skeleton_grouping, "disc", max_points),
      HAS(skeleton_grouping, "particle", particle_count)},
     DECLARATION(skeleton_grouping)},
    {.name = "skeleton_as_written",
     .set_default = written_skeleton_set_default,
     .memory = skeleton_grouping_memory,
     2,
     {HAS(skeleton_grouping, "edgel", max_edgels), HAS(skeleton_grouping, "centre", max_centres),
      HAS(skeleton_grouping, "line", max_lines), HAS(skeleton_grouping, "part", max_parts),
      HAS(skeleton_grouping, "disc", max_points),
      HAS(skeleton_grouping, "particle", particle_count)}},
    {OBJECT(contour_search_tokenizer),
     0,
     {HAS(contour_search_tokenizer, "edge pixel", max_edges),
      HAS(contour_search_tokenizer, "chain", max_chains),
      HAS(contour_search_tokenizer, "line", max_lines),
      HAS(contour_search_tokenizer, "token", max_segments)},
     DECLARATION(contour_search_tokenizer)},
    {OBJECT(contour_search),
     0,
     {HAS(contour_search, "segment", max_segments),
      HAS(contour_search, "sample of the outline", grouping.max_outline),
      HAS(contour_search, "candidate of a band", grouping.max_objects)},
     DECLARATION(contour_search)},
    {OBJECT(object_detect),
     0,
     {HAS(object_detect, "segment", max_segments), HAS(object_detect, "candidate", candidates),
      HAS(object_detect, "sample of the outline", max_outline),
      HAS(object_detect, "peak", max_peaks)},
     DECLARATION(object_detect)},
    {.name = "object_detect_by_parts",
     .set_default = object_detect_by_parts_set_default,
     .memory = object_detect_memory,
     0,
     {HAS(object_detect, "segment", max_segments), HAS(object_detect, "chain", max_chains)}},
    {.name = "object_detect_as_written",
     .set_default = object_detect_as_written_set_default,
     .memory = object_detect_memory,
     0,
     {HAS(object_detect, "segment", max_segments), HAS(object_detect, "chain", max_chains),
      HAS(object_detect, "detection", max_detections)}},
    {.name = "object_detect_field",
     .set_default = object_detect_set_default,
     .memory = object_detect_field_memory,
     0,
     {HAS(object_detect, "segment", max_segments)},
     .parameters = &cairn_object_detect_parameters,
     .check = object_detect_check,
     .create = object_detect_field_create},
    {OBJECT(appearance),
     0,
     {HAS(appearance, "patch", max_patches), HAS(appearance, "word", max_words)},
     DECLARATION(appearance)},
    {OBJECT(shape_model_builder),
     0,
     {HAS(shape_model_builder, "point", outline_samples),
      HAS(shape_model_builder, "sample", path_samples),
      HAS(shape_model_builder, "path", max_paths)},
     DECLARATION(shape_model_builder)},
    {OBJECT(block_solver),
     0,
     {HAS(block_solver, "pose", max_poses), HAS(block_solver, "link", max_links),
      HAS(block_solver, "block of fill", max_fill)},
     DECLARATION(block_solver)},
    {OBJECT(point_grid), 0, {HAS(point_grid, "point", max_points)}, DECLARATION(point_grid)},
    {OBJECT(box_sweep), 0, {HAS(box_sweep, "box", max_boxes)}, DECLARATION(box_sweep)},
    {OBJECT(distance_map), 0, {HAS(distance_map, "column", max_width)}, DECLARATION(distance_map)},
    {OBJECT(hough),
     0,
     {HAS(hough, "line", max_lines), HAS(hough, "angle", angles),
      HAS(hough, "distance", distances)},
     DECLARATION(hough)},
    {OBJECT(rectangle),
     0,
     {HAS(rectangle, "segment", max_segments), HAS(rectangle, "side", max_sides),
      HAS(rectangle, "pair", max_pairs), HAS(rectangle, "rectangle", max_rectangles)},
     DECLARATION(rectangle)},
    {OBJECT(ellipse),
     0,
     {HAS(ellipse, "ellipse", max_ellipses), HAS(ellipse, "cell of a side", cells)},
     DECLARATION(ellipse)},
    {OBJECT(particle_filter),
     0,
     {HAS(particle_filter, "particle alive", max_particles),
      HAS(particle_filter, "follower", max_followers),
      HAS(particle_filter, "candidate", max_candidates), HAS(particle_filter, "state", max_blocks),
      HAS(particle_filter, "byte of a state", state_bytes)},
     DECLARATION(particle_filter)},
    {OBJECT(place_map),
     0,
     {HAS(place_map, "place", max_places), HAS(place_map, "scan", max_scans),
      HAS(place_map, "point of a place", max_place_points),
      HAS(place_map, "beam of a place", max_place_beams),
      HAS(place_map, "place to match with", recent_places),
      HAS(place_map, "hypothesis", consensus.max_hypotheses),
      HAS(place_map, "decoupling", decoupled)},
     DECLARATION(place_map)},
    {OBJECT(weak_direction),
     0,
     {HAS(weak_direction, "scan", max_scans), HAS(weak_direction, "wall", max_walls),
      HAS(weak_direction, "part", max_submaps)},
     DECLARATION(weak_direction)},
    {OBJECT(virtual_scan),
     0,
     {HAS(virtual_scan, "scan", max_scans), HAS(virtual_scan, "point", max_points),
      HAS(virtual_scan, "segment", max_segments), HAS(virtual_scan, "hypothesis", max_hypotheses),
      HAS(virtual_scan, "virtual point", max_virtual),
      HAS(virtual_scan, "detector", max_detectors)},
     DECLARATION(virtual_scan)},
    {OBJECT(virtual_align),
     0,
     {HAS(virtual_align, "scan", aligner.max_scans),
      HAS(virtual_align, "segment", aligner.max_segments),
      HAS(virtual_align, "point", aligner.max_points),
      HAS(virtual_align, "virtual point", hypotheses.max_virtual)},
     DECLARATION(virtual_align)},
    {OBJECT(map_merge),
     0,
     {HAS(map_merge, "map", max_maps), HAS(map_merge, "cell", max_cells),
      HAS(map_merge, "cell of a map", max_map_cells), HAS(map_merge, "point", max_points),
      HAS(map_merge, "segment", max_segments), HAS(map_merge, "corner", max_corners),
      HAS(map_merge, "mode", max_modes), HAS(map_merge, "particle", particles)},
     DECLARATION(map_merge)},
    {OBJECT(map_vote), 1, {HAS(map_vote, "map", max_maps)}, DECLARATION(map_vote)},
    {.name = "map_merge_as_written",
     .set_default = written_map_merge_set_default,
     .memory = map_merge_memory,
     0,
     {HAS(map_merge, "map", max_maps), HAS(map_merge, "cell", max_cells),
      HAS(map_merge, "mode", max_modes), HAS(map_merge, "particle", particles)}},
    {.name = "force_field_spaced",
     .set_default = spaced_force_field_set_default,
     .memory = force_field_memory,
     0,
     {HAS(force_field, "scan", max_scans), HAS(force_field, "segment", max_segments),
      HAS(force_field, "point", max_points), HAS(force_field, "corner", max_corners),
      HAS(force_field, "bond", max_bonds), HAS(force_field, "extra point", max_extra)}},
    {.name = "virtual_align_as_written",
     .set_default = virtual_align_as_written_set_default,
     .memory = virtual_align_memory,
     0,
     {HAS(virtual_align, "scan", aligner.max_scans),
      HAS(virtual_align, "segment", aligner.max_segments),
      HAS(virtual_align, "point", aligner.max_points),
      HAS(virtual_align, "virtual point", hypotheses.max_virtual)}},
    {.name = "part_configuration_written",
     .set_default = written_part_configuration_set_default,
     .memory = part_configuration_memory,
     1,
     {HAS(part_configuration, "configuration", max_found)}},
    {.name = NULL},
};

size_t pool_object_bytes(const pool_object *object, const int32_t *values, int32_t count)
{
    any_params params;

    memset(&params, 0, sizeof params);
    object->set_default(&params);
    for (int32_t k = 0; k < count; k++)
        memcpy((char *)&params + object->capacities[k].offset, &values[k], sizeof values[k]);
    return object->memory(&params);
}

int32_t pool_object_default(const pool_object *object, int32_t capacity)
{
    any_params params;
    int32_t value;

    memset(&params, 0, sizeof params);
    object->set_default(&params);
    memcpy(&value, (const char *)&params + object->capacities[capacity].offset, sizeof value);
    return value;
}
