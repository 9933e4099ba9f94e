/* bench/memory: pool memory of objects of typical capacities. */
#include <stdint.h>

#include "bench/bench_json.h"
#include "cairn/aligner.h"
#include "cairn/block_solver.h"
#include "cairn/filter_mapper.h"
#include "cairn/fragment_match.h"
#include "cairn/part_configuration.h"
#include "cairn/hough.h"
#include "cairn/mapper.h"
#include "cairn/occupancy_grid.h"
#include "cairn/place_map.h"
#include "cairn/boundary.h"
#include "cairn/edgel.h"
#include "cairn/inner_distance.h"
#include "cairn/self_similarity.h"
#include "cairn/silhouette.h"
#include "cairn/ellipse.h"
#include "cairn/rectangle.h"
#include "cairn/scan_map.h"
#include "cairn/scan_match.h"
#include "cairn/particle_filter.h"
#include "cairn/sequence.h"
#include "cairn/skeleton_grouping.h"
#include "cairn/weak_direction.h"

static void print(const char *object, const char *capacities, size_t bytes)
{
    bench_json_begin("memory");
    bench_json_text("object", object);
    bench_json_text("capacities", capacities);
    bench_json_integer("bytes", (int64_t)bytes);
    bench_json_end();
}

int main(void)
{
    cairn_scan_params scan = cairn_scan_default();
    cairn_block_solver_params solver = {.max_poses = 3500, .max_links = 5598, .max_fill = 18581};
    cairn_icp_params icp = cairn_icp_default();
    cairn_scan_match_params match = cairn_scan_match_default();
    cairn_hough_params hough = cairn_hough_default();
    cairn_rectangle_params rectangle = cairn_rectangle_default();
    cairn_boundary_params boundary = cairn_boundary_default();
    cairn_edgel_params edgel = cairn_edgel_default();
    cairn_silhouette_params silhouette = cairn_silhouette_default();
    cairn_skeleton_grouping_params skeleton = cairn_skeleton_grouping_default();
    cairn_inner_distance_params inner = cairn_inner_distance_default();
    cairn_self_similarity_params similarity = cairn_self_similarity_default();
    cairn_fragment_match_params fragments = cairn_fragment_match_default();
    cairn_part_configuration_params configurations = cairn_part_configuration_default();
    cairn_ellipse_params ellipse = cairn_ellipse_default();
    cairn_sequence_params sequence = cairn_sequence_default();
    cairn_particle_filter_params filter = cairn_particle_filter_default();
    cairn_force_field_params field = cairn_force_field_default();
    cairn_occupancy_grid_params grid = cairn_occupancy_grid_default();
    cairn_scan_map_params scan_map = cairn_scan_map_default();
    cairn_mapper_params mapper = cairn_mapper_default_for(64, 181);
    cairn_filter_mapper_params rao_blackwell;
    cairn_aligner_params aligner = cairn_aligner_default();
    cairn_pose_consensus_params consensus = cairn_pose_consensus_default();
    cairn_place_map_params places = cairn_place_map_default();
    cairn_weak_direction_params weak_direction = cairn_weak_direction_default();

    scan.max_beams = 181;
    scan.max_points = 256;
    print("scan", "181 beams, 128 segments, 256 points", cairn_scan_memory(&scan));
    scan.max_beams = 401;
    print("scan", "401 beams, 128 segments, 256 points", cairn_scan_memory(&scan));
    print("block_solver", "3500 poses, 5598 links, 18581 blocks",
          cairn_block_solver_memory(&solver));
    print("icp", "4096 target points", cairn_icp_memory(&icp));
    print("scan_match", "2048 target points, 4096 dense ones, 16 views",
          cairn_scan_match_memory(&match));
    match.mode = CAIRN_SCAN_MATCH_SHAPE;
    print("scan_match", "the same, by shape", cairn_scan_match_memory(&match));
    match = cairn_scan_match_as_written();
    print("scan_match", "as written: 4812 target and 1604 query readings",
          cairn_scan_match_memory(&match));
    print("hough", "360 x 256 bins, 32 lines", cairn_hough_memory(&hough));
    print("rectangle", "1024 segments, 256 sides, 2048 pairs, 32 rectangles",
          cairn_rectangle_memory(&rectangle));
    print("ellipse", "2 x 96 x 96 cells, 32 ellipses", cairn_ellipse_memory(&ellipse));
    print("inner_distance", "128 points", cairn_inner_distance_memory(&inner));
    print("self_similarity", "96 points, 48 of holes", cairn_self_similarity_memory(&similarity));
    print("boundary", "640 x 480 pixels, 8192 regions, 262144 points",
          cairn_boundary_memory(&boundary));
    print("edgel", "640 x 480 pixels, 40000 edgels", cairn_edgel_memory(&edgel));
    print("silhouette", "640 x 480 pixels, 32768 pixels of ink, 65536 points",
          cairn_silhouette_memory(&silhouette));
    print("skeleton", "640 x 480 pixels, 40000 edgels, 4000 centres, 256 lines",
          cairn_skeleton_grouping_memory(&skeleton));
    print("fragment_match",
          "96 fragments of 20 samples, 2 matches each, 10000 chains of up to 4096 samples",
          cairn_fragment_match_memory(&fragments));
    print("part_configuration", "512 votes, 64 configurations",
          cairn_part_configuration_memory(&configurations));
    print("sequence", "1024 and 1024 elements", cairn_sequence_memory(&sequence));
    print("particle_filter", "100 particles, 4,096 candidates and blocks of 64 bytes",
          cairn_particle_filter_memory(&filter));
    field.max_scans = 16;
    field.max_points = 2400;
    field.max_segments = field.max_corners = 320;
    print("force_field", "16 scans, 2400 points, 320 segments, 320 corners",
          cairn_force_field_memory(&field));
    field.max_scans = 60;
    field.max_points = 6000;
    field.max_segments = field.max_corners = 900;
    print("force_field", "60 scans, 6000 points, 900 segments, 900 corners",
          cairn_force_field_memory(&field));
    field.spacing = CAIRN_REAL(0.10);
    print("force_field", "as before, points made on the fly", cairn_force_field_memory(&field));
    aligner.max_scans = 60;
    aligner.max_segments = 600;
    aligner.max_points = 3000;
    aligner.max_hypotheses = 24 * 60;
    aligner.max_fill = 32 * 60;
    print("aligner", "60 scans, 600 segments, 3000 points, 1440 hypotheses, 1920 blocks",
          cairn_aligner_memory(&aligner));
    aligner.max_segments = 665;
    aligner.max_short_segments = 60;
    aligner.max_points = 3320;
    aligner.max_hypotheses = aligner.max_fill = 1150;
    print("aligner", "60 scans of 401 beams, what the largest of arenas needs",
          cairn_aligner_memory(&aligner));
    print("weak_direction", "64 scans, 1024 walls, 24 parts",
          cairn_weak_direction_memory(&weak_direction));
    print("pose_consensus", "64 nodes, 1024 hypotheses, 8 candidates",
          cairn_pose_consensus_memory(&consensus));
    print("place_map", "16 places of 1024 points and 2048 beams, 4096 hypotheses",
          cairn_place_map_memory(&places));
    places.decoupled = CAIRN_PLACE_MAP_JOINTLY;
    print("place_map", "the same, scans aligned jointly", cairn_place_map_memory(&places));
    places = cairn_place_map_as_written();
    print("place_map", "as written: 16 places of 2048 readings", cairn_place_map_memory(&places));
    print("occupancy_grid", "400 x 400 cells", cairn_occupancy_grid_memory(&grid));
    print("scan_map", "400 x 400 cells", cairn_scan_map_memory(&scan_map));
    print("mapper", "181 beams, 64 keyframes", cairn_mapper_memory(&mapper));
    mapper = cairn_mapper_default_for(1024, 181);
    print("mapper", "181 beams, 1024 keyframes", cairn_mapper_memory(&mapper));
    rao_blackwell = cairn_filter_mapper_default_for(1024, 181, 30);
    print("filter_mapper", "181 beams, 1024 keyframes, 30 particles",
          cairn_filter_mapper_memory(&rao_blackwell));
    bench_json_begin("memory");
    bench_json_integer("real_bytes", (int64_t)sizeof(cairn_real));
    bench_json_true("summary");
    bench_json_end();
    return 0;
}
