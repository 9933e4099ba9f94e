/* Output files of cairn align and cairn map: poses.csv, map.pgm with map.yaml,
 * map.svg, the page of --report, and of a mapped log poses.tum and graph.g2o. */
#ifndef CAIRN_TOOLS_CAIRN_MAP_OUTPUT_H
#define CAIRN_TOOLS_CAIRN_MAP_OUTPUT_H

#include "cairn/carmen_log.h"
#include "cairn/file_error.h"
#include "cairn/pose_graph_file.h"
#include "cairn/report.h"
#include "cairn/scan.h"
#include "src/host/base/json_writer.h"
#include "src/host/maps/placed_scan.h"

/* A scan of the log with its result. */
typedef cairn_placed_scan map_scan;

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
    /* player that receives the grid; NULL: no page */
    cairn_report_player *player;
    /* path of the page, in any folder */
    const char *report;
    /* pose graph, written with poses.tum as graph.g2o; NULL: neither file is written */
    const cairn_pose_graph_file *graph;
} map_output;

/* The scans of an output, and how their beams enter its map. */
cairn_placed_scan_map map_of_output(const map_output *output);

/* Writes scan, stamp_ns, x, y, theta, covariance and verdict of a pose. covariance: [9] row-major
 * over x, y, theta; NULL: not known. */
void map_write_pose(cairn_json_writer *json, int32_t scan, int64_t stamp_ns, cairn_pose pose,
                    const cairn_real *covariance, const char *verdict);

/* Writes the poses of all scans after mapping: "poses": [...]. */
void map_write_poses(cairn_json_writer *json, const map_scan *scan, int32_t count);

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
