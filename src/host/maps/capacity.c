/* capacity: parameters of objects with capacities for the scans and maps given. */
#include "src/host/maps/capacity.h"

#include <math.h>

/* Keyframes in buildings have about 100 points and 30 segments. */
enum { FIRST_KEYFRAME_POINTS = 160, POINTS_PER_SEGMENT = 4 };
/* Of the aligner, per scan. */
enum { HYPOTHESES_PER_SCAN = 24, FILL_PER_SCAN = 32 };
/* Memory for links of all pairs would be quadratic in the scans. */
enum { MAX_LINKS_PER_SCAN = 256 };
/* Iterations of Lu and Milios between two searches for links. */
enum { LUM_REBUILD_INTERVAL = 5 };
/* Of the consensus over places. */
enum { HYPOTHESES_PER_PAIR = 34, MAX_CONSENSUS_HYPOTHESES = 1 << 20 };
enum { MAX_MERGE_POINTS = 4096 };

static int32_t least(int64_t a, int32_t b)
{
    return a < b ? (int32_t)a : b;
}

static int32_t at_least_1(int32_t count)
{
    return count > 0 ? count : 1;
}

/* ---- Mapping ---- */

int32_t cairn_capacity_keyframe_points(int32_t points)
{
    int32_t next = points > 0 ? 2 * points : FIRST_KEYFRAME_POINTS;

    return next < 2 * cairn_mapper_default().scan.max_points ? next : 0;
}

cairn_mapper_params cairn_capacity_mapper(const cairn_capacity_mapping *mapping, int32_t scans,
                                          int32_t beams, int32_t points)
{
    cairn_mapper_params params =
        cairn_mapper_default_for(least(mapping->max_keyframes, scans), beams);
    int64_t all = (int64_t)params.max_keyframes * points;

    params.cull_keyframes = mapping->cull_keyframes && mapping->max_keyframes < scans;
    params.window = mapping->window;
    if (mapping->no_loops)
        params.loop.max_loops = params.local_span = 0;
    params.field.potential = 1;
    if (params.window > 0 && params.window_free >= params.window)
        params.window_free = params.window - 1;
    params.max_keyframe_points = least(all + params.scan.max_points, CAIRN_CAPACITY_MAX_POINTS);
    params.max_keyframe_segments =
        least(all / POINTS_PER_SEGMENT + params.scan.max_segments, CAIRN_CAPACITY_MAX_POINTS);
    return params;
}

/* ---- Alignment ---- */

cairn_aligner_params cairn_capacity_aligner(const cairn_capacity_scans *scans, double initial_error,
                                            double initial_angle_error)
{
    cairn_aligner_params params = cairn_aligner_default();

    params.max_scans = scans->scans;
    params.max_segments = scans->segments;
    params.max_points = scans->points;
    params.max_hypotheses = HYPOTHESES_PER_SCAN * scans->scans;
    params.max_fill = FILL_PER_SCAN * scans->scans;
    params.max_initial_error = (cairn_real)initial_error;
    params.max_initial_angle_error = (cairn_real)fmin(initial_angle_error, (double)CAIRN_PI);
    return params;
}

cairn_force_field_params cairn_capacity_force_field(const cairn_capacity_scans *scans,
                                                    int32_t iterations)
{
    cairn_force_field_params params = cairn_force_field_as_written();

    params.max_scans = scans->scans;
    params.max_segments = scans->segments;
    params.max_corners = CAIRN_CAPACITY_CORNERS_PER_SEGMENT * scans->segments;
    params.max_points = scans->points;
    params.max_steps = iterations;
    return params;
}

cairn_lum_params cairn_capacity_lum(const cairn_capacity_scans *scans, int32_t iterations,
                                    int32_t as_written)
{
    cairn_lum_params params = as_written ? cairn_lum_as_written() : cairn_lum_default();
    int64_t count = scans->scans, all = count * (count - 1) / 2, most = count * MAX_LINKS_PER_SCAN;

    params.max_scans = scans->scans;
    params.max_points =
        as_written ? least(count * scans->beams, CAIRN_CAPACITY_MAX_POINTS) : scans->points;
    params.max_links = params.max_fill = (int32_t)(all < most ? all : most) + 1;
    params.max_iterations = iterations;
    if (!as_written) {
        params.rebuild_interval = LUM_REBUILD_INTERVAL;
        params.sequential_registration = 1;
    }
    return params;
}

/* ---- Places ---- */

static int32_t larger(int32_t a, int32_t b)
{
    return a > b ? a : b;
}

void cairn_capacity_add_scan(cairn_capacity_places *places, int32_t place, int32_t points,
                             int32_t beams)
{
    if (place == places->places) {
        places->places++;
        places->own_points = places->own_beams = 0;
    }
    places->own_points += points;
    places->own_beams += beams;
    places->points = larger(places->points, places->own_points);
    places->beams = larger(places->beams, places->own_beams);
}

cairn_place_map_params cairn_capacity_place_map(const cairn_capacity_places *places,
                                                const cairn_capacity_scans *scans, double spacing)
{
    cairn_place_map_params params =
        places->as_written ? cairn_place_map_as_written() : cairn_place_map_default();
    cairn_aligner_params aligner = cairn_aligner_default();
    int32_t pairs = places->places * (places->places - 1) / 2, wanted = HYPOTHESES_PER_PAIR * pairs;

    params.max_places = places->places;
    params.max_scans = scans->scans;
    params.max_place_points =
        places->as_written || places->points == 0 ? places->beams : places->points;
    params.max_place_beams = places->beams;
    if (wanted > params.consensus.max_hypotheses)
        params.consensus.max_hypotheses = least(wanted, MAX_CONSENSUS_HYPOTHESES);
    if (places->as_written)
        return params;
    params.match.spacing = (cairn_real)spacing;
    /* The poses of scans in their places come from odometry at best. */
    params.decoupled = CAIRN_PLACE_MAP_JOINTLY;
    params.aligner = cairn_capacity_aligner(scans, (double)aligner.max_initial_error,
                                            (double)aligner.max_initial_angle_error);
    return params;
}

/* ---- Matching ---- */

cairn_scan_match_params cairn_capacity_scan_match(int32_t target_points, int32_t target_hits,
                                                  int32_t query_points, int32_t as_written)
{
    cairn_scan_match_params params =
        as_written ? cairn_scan_match_as_written() : cairn_scan_match_default();

    params.max_target = at_least_1(target_points);
    params.max_query = at_least_1(query_points);
    if (as_written)
        return params;
    params.max_dense = at_least_1(target_hits);
    params.max_views = 1;
    params.max_hypotheses = CAIRN_CAPACITY_MATCH_HYPOTHESES;
    return params;
}

/* ---- Merging ---- */

cairn_map_merge_params cairn_capacity_map_merge(int32_t count, int32_t cells, int32_t most,
                                                int32_t as_written)
{
    cairn_map_merge_params params =
        as_written ? cairn_map_merge_as_written() : cairn_map_merge_default();

    params.max_maps = count;
    params.max_cells = cells;
    params.max_map_cells = most;
    params.max_points = MAX_MERGE_POINTS;
    return params;
}
