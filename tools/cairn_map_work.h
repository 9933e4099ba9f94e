/* What the two ways of cairn map share: by the mapper (cairn_map.c) and by its particles
 * (cairn_map_filter.c). */
#ifndef CAIRN_TOOLS_CAIRN_MAP_WORK_H
#define CAIRN_TOOLS_CAIRN_MAP_WORK_H

#include "cairn/mapper.h"
#include "tools/cairn_map_input.h"
#include "tools/cairn_map_output.h"

#define MAP_PROGRAM "cairn map"

typedef struct map_settings {
    const char *log; /* the first one */
    const char *logs[MAP_LOGS_MOST];
    const char *folder, *pool, *report;
    int32_t log_count;
    int64_t max_keys, window, seed, particles;
    double resolution, range, range_max;
    double sweep; /* s; 0: as the log says */
    int32_t no_odometry, quiet, release;
} map_settings;

/* Where a scan hangs, for its pose in the end. */
typedef struct map_place {
    cairn_pose key_scan;
    int32_t key;
} map_place;

/* Keeps what the mapper made of scan `index`, which is done. 0 when there is no memory. */
int map_keep(const map_input *input, const cairn_mapper *mapper, int32_t index, map_scan *scan,
             map_place *place);

/* The scan that the mapper is given. */
cairn_scan_input map_scan_input(const map_settings *s, const map_input *input, int32_t index);

/* What cairn map writes, but for its graph and player. */
map_output map_output_of(const map_settings *s, map_scan *scans, int32_t count);

/* Too many key scans: says so, and how to have more. */
int map_refuse_keys(const map_settings *s, int32_t max_keys);

/* Maps and writes by particles; front: the mapper that goes ahead. *full is set, and no line
 * printed, when its key scans have more points or segments than there is room for. */
int map_by_filter(const map_settings *s, const map_input *input, const cairn_mapper_params *front,
                  map_scan *scans, map_place *places, int32_t *full);

#endif
