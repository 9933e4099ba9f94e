/* placed_scan: scans at their poses, and the map file that their beams make. Internal to the host
 * library and its programs. */
#ifndef CAIRN_HOST_PLACED_SCAN_H
#define CAIRN_HOST_PLACED_SCAN_H

#include "cairn/map_file.h"
#include "cairn/mapper.h"
#include "cairn/occupancy_grid.h"
#include "cairn/scan.h"
#include "cairn/scan_map.h"

/* A scan of a log with its result. */
typedef struct cairn_placed_scan {
    int64_t line, stamp_ns;
    cairn_pose before, after;
    cairn_real covariance[9]; /* row-major over x, y, theta; NaN: not known */
    cairn_real support;       /* NaN: not known */
    cairn_real map_sigma;     /* m: of the position in the map; NaN: not known */
    const char *verdict;      /* constant text */
    uint8_t low_confidence;   /* 1: drawn in red */

    /* Sensor data in the frame of the scan. */
    cairn_vec2 sensor;
    float *beam;  /* [2 beam_count] x and y of the end points of beams, hits and no returns */
    uint8_t *hit; /* [beam_count] 1: hit, 0: free */
    cairn_vec2 *point;
    cairn_segment *segment;
    int32_t beam_count, point_count, segment_count;
} cairn_placed_scan;

/* Arrays for `count` scans, all unknown; NULL when there is no memory. */
cairn_placed_scan *cairn_placed_scans_new(int32_t count);
void cairn_placed_scans_free(cairn_placed_scan *scan, int32_t count);

/* Copies the sensor data of a scan and replaces an earlier copy. Returns 0 when there is no
 * memory. */
int32_t cairn_placed_scan_copy(cairn_placed_scan *scan, const cairn_scan_view *view);

/* ---- The mapper's scans ---- */

/* Pose of a scan relative to its reference keyframe. */
typedef struct cairn_scan_place {
    cairn_pose keyframe_scan;
    int32_t keyframe;
} cairn_scan_place;

/* Copies the mapper's result for its last scan: sensor data, place, covariance, support, verdict.
 * Returns 0 when there is no memory. */
int32_t cairn_placed_scan_take(cairn_placed_scan *scan, cairn_scan_place *place,
                               const cairn_mapper *mapper);

/* The name of a verdict in poses.csv. */
const char *cairn_placed_scan_verdict(cairn_mapper_verdict verdict);

/* Reattaches places[0 ... count - 1] after the culling of a keyframe. */
void cairn_scan_places_reattach(cairn_scan_place *places, int32_t count,
                                cairn_mapper_culling culling);

/* The current pose of a scan: that of its reference keyframe composed with its relative pose. */
cairn_pose cairn_scan_place_pose(const cairn_mapper *mapper, const cairn_scan_place *place);

/* Sets the poses `after` of scans[0 ... count - 1] to the current ones, and map_sigma of each to that of
 * its reference keyframe. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_placed_scans_place(cairn_placed_scan *scans,
                                                    const cairn_scan_place *places, int32_t count,
                                                    const cairn_mapper *mapper);

/* ---- The map ---- */

/* Scans at their poses `after`, and how their beams enter a map. */
typedef struct cairn_placed_scan_map {
    const cairn_placed_scan *scan; /* [count] */
    int32_t count;
    /* m */
    double resolution;
    /* max_cells is set to that of the grid. */
    cairn_scan_map_params beams;
} cairn_placed_scan_map;

/* Returns the beams of a scan at its pose `after`; the arrays stay those of the scan. */
cairn_scan_map_scan cairn_placed_scan_beams(const cairn_placed_scan *scan);

/* An occupancy grid on the heap; memory is released with free(). */
typedef struct cairn_heap_grid {
    cairn_occupancy_grid *grid;
    void *memory;
} cairn_heap_grid;

/* Sets the grid's params to contain all poses and beams, at the map's resolution. CAIRN_FULL: too
 * many cells. */
CAIRN_CHECKED cairn_status cairn_placed_scan_map_layout(const cairn_placed_scan_map *map,
                                                        cairn_occupancy_grid_params *params,
                                                        cairn_file_error *error);

/* Creates the grid and adds all beams. CAIRN_NO_MEMORY, and the grid's statuses. */
CAIRN_CHECKED cairn_status cairn_placed_scan_map_grid(const cairn_placed_scan_map *map,
                                                      const cairn_occupancy_grid_params *params,
                                                      cairn_heap_grid *made,
                                                      cairn_file_error *error);

/* Makes the map file, to be freed by cairn_map_file_free(). Statuses of both. */
CAIRN_CHECKED cairn_status cairn_placed_scan_map_make(const cairn_placed_scan_map *map,
                                                      cairn_map_file *file,
                                                      cairn_file_error *error);

#endif
