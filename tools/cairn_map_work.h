/* Shared by both methods of cairn map: the mapper (cairn_map.c) and the particle filter
 * (cairn_map_filter.c). */
#ifndef CAIRN_TOOLS_CAIRN_MAP_WORK_H
#define CAIRN_TOOLS_CAIRN_MAP_WORK_H

#include "cairn/mapper.h"
#include "tools/cairn_map_input.h"
#include "tools/cairn_map_output.h"

#define MAP_PROGRAM "cairn map"

typedef struct map_settings {
    const char *log; /* the first one */
    const char *logs[MAP_MAX_LOGS];
    const char *folder, *pool, *report;
    int32_t log_count;
    int64_t max_keyframes, window, seed, particles;
    double resolution, range, clear, range_max;
    double sweep; /* s; 0: as the log says */
    int32_t no_odometry, quiet, cull_keyframes;
} map_settings;

/* Pose of a scan relative to its reference keyframe. */
typedef struct map_place {
    cairn_pose keyframe_scan;
    int32_t keyframe;
} map_place;

/* Copies the mapper's result for scan `index`. Returns 0 when there is no memory. */
int map_copy_result(const map_input *input, const cairn_mapper *mapper, int32_t index,
                    map_scan *scan, map_place *place);

/* Returns scan `index` as the mapper's input. */
cairn_scan_input map_scan_input(const map_settings *s, const map_input *input, int32_t index);

/* Returns the output description of cairn map without graph and player. */
map_output map_output_of(const map_settings *s, map_scan *scans, int32_t count);

/* Prints the error of too many keyframes; returns the exit code. */
int map_refuse_keys(const map_settings *s, int32_t max_keys);

/* Maps and writes by the particle filter; front: params of its front-end mapper. *full is set, and
 * no line printed, when the keyframes exceed its capacity of points or segments. */
int map_by_filter(const map_settings *s, const map_input *input, const cairn_mapper_params *front,
                  map_scan *scans, map_place *places, int32_t *full);

#endif
