/* capacity: parameters of the objects that map, align, match and merge, with capacities for the
 * scans and maps given, and how those of a keyframe grow. Internal to the host library, its programs
 * and the Python package. */
#ifndef CAIRN_HOST_CAPACITY_H
#define CAIRN_HOST_CAPACITY_H

#include "cairn/aligner.h"
#include "cairn/force_field.h"
#include "cairn/lum.h"
#include "cairn/map_merge.h"
#include "cairn/mapper.h"
#include "cairn/place_map.h"
#include "cairn/scan_match.h"

enum {
    /* Maximum number of points, and of segments, of all scans or keyframes together. */
    CAIRN_CAPACITY_MAX_POINTS = 1 << 24,
    /* Corners of a force field per segment: T and X crossings of a long drive are many more than
     * its segments. */
    CAIRN_CAPACITY_CORNERS_PER_SEGMENT = 16,
    /* Budget of a call of cairn_mapper_settle(): few enough units that no event is overwritten
     * before it is read. */
    CAIRN_CAPACITY_SETTLE_UNITS = 5000,
    CAIRN_CAPACITY_MAX_PLACES = 256,
    /* Hypotheses of a match of two scans. */
    CAIRN_CAPACITY_MATCH_HYPOTHESES = 8,
    CAIRN_CAPACITY_MAX_MAPS = 64
};

/* ---- Mapping ---- */

/* How a log is mapped. */
typedef struct cairn_capacity_mapping {
    int64_t max_keyframes;
    /* 1: the most redundant keyframes are culled beyond max_keyframes */
    int32_t cull_keyframes;
    /* keyframes in the sliding window of the force field; 0: none */
    int32_t window;
    /* 1: no loop closure */
    int32_t no_loops;
} cairn_capacity_mapping;

/* The points per keyframe that mapping starts with (points 0), or tries next after that many were
 * too few; 0: no more. */
int32_t cairn_capacity_keyframe_points(int32_t points);

/* The mapper's params with a capacity of `points` points per keyframe, for a log of `scans` scans
 * of up to `beams` beams. */
cairn_mapper_params cairn_capacity_mapper(const cairn_capacity_mapping *mapping, int32_t scans,
                                          int32_t beams, int32_t points);

/* ---- Alignment ---- */

/* Sizes of the scans of an alignment. */
typedef struct cairn_capacity_scans {
    int32_t scans;
    /* of the scan with most beams */
    int32_t beams;
    /* of all scans together */
    int32_t points, segments;
} cairn_capacity_scans;

/* initial_error, initial_angle_error: bounds of the error of the initial poses, m and rad */
cairn_aligner_params cairn_capacity_aligner(const cairn_capacity_scans *scans, double initial_error,
                                            double initial_angle_error);

/* The force field as written. */
cairn_force_field_params cairn_capacity_force_field(const cairn_capacity_scans *scans,
                                                    int32_t iterations);

/* as_written: Lu and Milios alone, on the hits of the beams */
cairn_lum_params cairn_capacity_lum(const cairn_capacity_scans *scans, int32_t iterations,
                                    int32_t as_written);

/* ---- Places ---- */

/* Sizes of places, whose scans are added in the order of the log. */
typedef struct cairn_capacity_places {
    int32_t as_written;
    int32_t places;
    /* most points and beams of a place */
    int32_t points, beams;
    /* of the last place */
    int32_t own_points, own_beams;
} cairn_capacity_places;

/* Adds the next scan, of the last place or of a new one. */
void cairn_capacity_add_scan(cairn_capacity_places *places, int32_t place, int32_t points,
                             int32_t beams);

/* spacing: of the points along walls, m; not read as written */
cairn_place_map_params cairn_capacity_place_map(const cairn_capacity_places *places,
                                                const cairn_capacity_scans *scans, double spacing);

/* ---- Matching ---- */

/* target_hits: hits of the target with their directions; not read as written */
cairn_scan_match_params cairn_capacity_scan_match(int32_t target_points, int32_t target_hits,
                                                  int32_t query_points, int32_t as_written);

/* ---- Merging ---- */

/* Params for `count` maps of `cells` cells in all, and `most` of the largest one. */
cairn_map_merge_params cairn_capacity_map_merge(int32_t count, int32_t cells, int32_t most,
                                                int32_t as_written);

#endif
