/* Output files of cairn align and cairn map: poses.csv, map.pgm with map.yaml,
 * map.svg, the page of --report, and of a mapped log poses.tum and graph.g2o. */
#ifndef CAIRN_TOOLS_CAIRN_MAP_OUTPUT_H
#define CAIRN_TOOLS_CAIRN_MAP_OUTPUT_H

#include "cairn/carmen_log.h"
#include "cairn/file_error.h"
#include "cairn/occupancy_grid.h"
#include "cairn/pose_graph_file.h"
#include "cairn/report.h"
#include "cairn/scan.h"
#include "src/host/base/json_writer.h"

/* A scan of the log with its result. */
typedef struct map_scan {
    int64_t line, stamp_ns;
    cairn_pose before, after;
    cairn_real covariance[9]; /* row-major over x, y, theta; NaN: not known */
    cairn_real support;       /* NaN: not known */
    const char *verdict;      /* constant text */
    uint8_t low_confidence;   /* 1: drawn in red */

    /* Sensor data in the frame of the scan. */
    cairn_vec2 sensor;
    float *beam;  /* [2 beam_count] x and y of the end points of beams, hits and no returns */
    uint8_t *hit; /* [beam_count] 1: hit, 0: free */
    cairn_vec2 *point;
    cairn_segment *segment;
    int32_t beam_count, point_count, segment_count;
} map_scan;

typedef struct map_output {
    const char *title, *subtitle;
    /* [count] */
    map_scan *scan;
    int32_t count;
    /* title of the poses before; NULL: the poses of the log */
    const char *before;
    /* 1: the poses are a path */
    int32_t in_order;
    /* 1: the picture after shows the grid, otherwise the walls of the scans */
    int32_t grid_panel;
    /* m */
    double resolution;
    /* m, maximum range of beams entered into the grid */
    double range;
    /* m: beams without return free what they passed when the scanner sees no farther than this.
     * One that sees farther would have seen the room's wall: there is glass, or the beam is lost */
    double clear;
    /* 1: they pass walls, too; 0: they end before the first cell that is occupied by the beams that
     * returned */
    int32_t through_walls;
    /* player that receives the grid; NULL: no page */
    cairn_report_player *player;
    /* path of the page, in any folder */
    const char *report;
    /* pose graph, written with poses.tum as graph.g2o; NULL: neither file is written */
    const cairn_pose_graph_file *graph;
} map_output;

/* Arrays for `count` scans, all unknown; NULL when there is no memory. */
map_scan *map_scans_new(int32_t count);
void map_scans_free(map_scan *scan, int32_t count);

/* Copies the sensor data of a scan and replaces an earlier copy. Returns 0 when there is no
 * memory. */
int32_t map_scan_copy(map_scan *scan, const cairn_scan_view *view);

/* Transforms beam i of a scan to the map and clips it at the output's range; *hit: 1 when its end
 * is a hit within the range. Returns 0 for a beam that says nothing: of zero length, or without
 * return and longer than `clear`. */
int32_t map_beam(const map_output *output, const map_scan *scan, int32_t i, cairn_transform map_s,
                 cairn_vec2 *from, cairn_vec2 *to, int32_t *hit);

/* Writes scan, stamp_ns, x, y, theta, covariance and verdict of a pose. covariance: [9] row-major
 * over x, y, theta; NULL: not known. */
void map_write_pose(cairn_json_writer *json, int32_t scan, int64_t stamp_ns, cairn_pose pose,
                    const cairn_real *covariance, const char *verdict);

/* Writes the poses of all scans after mapping: "poses": [...]. */
void map_write_poses(cairn_json_writer *json, const map_scan *scan, int32_t count);

/* An occupancy grid on the heap; memory is released with free(). */
typedef struct map_grid {
    cairn_occupancy_grid *grid;
    void *memory;
} map_grid;

/* Sets the grid's params to contain all poses and beams, at the output's resolution. CAIRN_FULL:
 * too many cells. */
CAIRN_CHECKED cairn_status map_grid_layout(const map_output *output,
                                           cairn_occupancy_grid_params *params,
                                           cairn_file_error *error);

/* Creates the grid and adds all beams. CAIRN_NO_MEMORY, and the grid's statuses. */
CAIRN_CHECKED cairn_status map_grid_make(const map_output *output,
                                         const cairn_occupancy_grid_params *params, map_grid *made,
                                         cairn_file_error *error);

/* Checks whether map_output_write can write there, before the computation. Creates nothing.
 * report: NULL for none. */
CAIRN_CHECKED cairn_status map_output_check(const char *folder, int32_t with_graph,
                                            const char *report, cairn_file_error *error);

/* Writes all files into the folder, which is made when it is missing; on failure it is as it
 * was. Then writes the page; on failure the files of the folder are new and the page is as it
 * was. */
CAIRN_CHECKED cairn_status map_output_write(const map_output *output, const char *folder,
                                            cairn_file_error *error);

#endif
