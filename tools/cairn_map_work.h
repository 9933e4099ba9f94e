/* Shared by the parts of cairn map: the mapper on files (cairn_map.c) and on a stream
 * (cairn_map_live.c), its runs (cairn_map_run.c) and results (cairn_map_print.c), the correction of
 * the angle step (cairn_map_step.c), and the particle filter (cairn_map_filter.c). */
#ifndef CAIRN_TOOLS_CAIRN_MAP_WORK_H
#define CAIRN_TOOLS_CAIRN_MAP_WORK_H

#include "cairn/mapper.h"
#include "src/host/maps/capacity.h"
#include "src/host/maps/scanner_check_run.h"
#include "tools/cairn_map_input.h"
#include "tools/cairn_map_output.h"

#define MAP_PROGRAM "cairn map"

/* The angle step of the logs, when cairn map corrects it. */
typedef struct map_angle_step {
    int32_t is_checked, is_corrected;
    double corrected; /* rad */
    cairn_angle_step_result found;
} map_angle_step;

typedef struct map_settings {
    const char *log; /* the first one */
    const char *logs[MAP_MAX_LOGS];
    const char *folder, *pool, *report, *scan_topic, *odometry_topic;
    tool_scanner scanner;
    int32_t log_count;
    int64_t max_keyframes, window, seed, particles;
    double resolution, range, clear, range_max;
    double odometry_sigma; /* m after 3 m; 0: learnt */
    double watch;          /* s; 0: the map is written at the end only */
    int32_t no_odometry, no_loops, json, quiet, cull_keyframes, live, keep_angle_step, shape_prior;
    map_angle_step angle_step;
} map_settings;

/* All keyframes ever created, by number, and the current ones of the mapper. */
typedef struct keyframe_list {
    int32_t *scan;   /* [total] of [capacity] scan index in the log, by keyframe number */
    int32_t *number; /* [present] of [capacity] keyframe number, by index in the mapper */
    int32_t total, present, releases, capacity;
} keyframe_list;

/* A run of the mapper with the results of its scans. */
typedef struct map_run {
    const map_settings *settings;
    cairn_pool pool;
    cairn_mapper *mapper;
    map_scan *scans; /* [count] of [capacity]; NULL unless keeps */
    cairn_scan_place *places;
    int32_t count, capacity;
    int32_t keeps; /* 1: results are kept to be written */
    keyframe_list keys;
    cairn_report_player *player; /* NULL: no report */
    int32_t shown;               /* loop events added to the player */
} map_run;

/* Begins a run with a mapper of the params. scans: their number, for the report. TOOL_OK, or
 * another exit code after a line on standard error; then there is nothing to close. */
int map_run_open(map_run *run, const map_settings *s, const cairn_mapper_params *params,
                 int32_t scans);

/* Maps the next scan; odometry NULL: none. is_last 1: the report gets a frame in any case. Statuses
 * of cairn_mapper_add() and cairn_mapper_step(), CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status map_run_add(map_run *run, const cairn_carmen_log_record *record,
                                       const cairn_pose *odometry, int32_t is_last,
                                       cairn_fault *fault);

/* Steps the mapper until all pending loop closures are decided. An exit code. */
int map_run_settle(map_run *run);

/* Looks for a known mistake of the angle step in logs that look like it, by the poses of the run, and
 * corrects the input: settings->angle_step. An exit code. */
int map_check_angle_step(map_settings *s, const map_run *run, map_input *input);

/* Says on standard error what was corrected. */
void map_print_angle_step(const map_settings *s);

/* Writes what was found, and whether it was corrected: "angle_step". */
void map_write_angle_step(cairn_json_writer *json, const map_settings *s);

/* Writes all files by the current poses. An exit code. */
int map_run_write(map_run *run);

/* Prints the result as the settings say: the summary (with --live on standard error), the JSON
 * object of --json, or nothing. seconds: of the whole run, and of it those of mapping. */
void map_run_print(const map_run *run, int64_t faults, int32_t stamps_back, double seconds,
                   double seconds_to_map);

/* Writes the keys that the mapper and the particle filter have in common. */
void map_write_common(cairn_json_writer *json, const map_settings *s, int32_t scans, int64_t faults,
                      int32_t stamps_back, double seconds, double seconds_to_map,
                      size_t pool_bytes);

void map_run_close(map_run *run);

/* Returns the mapper's params with a capacity of `points` points per keyframe. */
cairn_mapper_params map_params(const map_settings *s, int32_t scans, int32_t beams, int32_t points);

/* Returns the exit code of params that the mapper refuses, after a line on standard error; TOOL_OK
 * for others. */
int map_check_params(const map_settings *s, const cairn_mapper_params *params);

/* Maps the stream on standard input: cairn map -. An exit code. */
int map_live(map_settings *s);

/* Copies the mapper's result for a scan. Returns 0 when there is no memory. */
int map_copy_result(const cairn_carmen_log_record *record, const cairn_mapper *mapper,
                    map_scan *scan, cairn_scan_place *place);

/* Returns a scan as the mapper's input. */
cairn_scan_input map_scan_input(const map_settings *s, const cairn_carmen_log_record *record);

/* Returns the output description of cairn map without graph and player. */
map_output map_output_of(const map_settings *s, map_scan *scans, int32_t count);

/* Prints the error of too many keyframes; returns the exit code. */
int map_refuse_keys(const map_settings *s, int32_t max_keys);

/* Maps and writes by the particle filter; front: params of its front-end mapper. *full is set, and
 * no line printed, when the keyframes exceed its capacity of points or segments. */
int map_by_filter(const map_settings *s, const map_input *input, const cairn_mapper_params *front,
                  int32_t *full);

#endif
