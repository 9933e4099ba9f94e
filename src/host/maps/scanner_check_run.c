/* Check of the scanner of a whole log, and estimate of the angle step of a mapped one. */
#include "src/base/build.h"

#include <stdlib.h>
#include <string.h>

#include "src/host/base/interruption.h"
#include "src/host/maps/capacity.h"
#include "src/host/maps/placed_scan.h"
#include "src/host/maps/scanner_check_run.h"

/* Keyframes of the map and of its window, as those of cairn map. */
enum { MAX_KEYFRAMES = 4096, WINDOW = 8 };

/* Memory of a check. */
typedef struct check_memory {
    cairn_scanner_check_scan *scans;
    void *pool;
} check_memory;

/* The default, with capacity for the longest scan. */
static cairn_scanner_check_params params_for(const cairn_carmen_log_scans *scans)
{
    cairn_scanner_check_params params = cairn_scanner_check_default();

    params.max_beams = 1;
    for (int32_t i = 0; i < scans->count; i++)
        if (scans->record[i].count > params.max_beams)
            params.max_beams = scans->record[i].count;
    return params;
}

static void copy_scans(cairn_scanner_check_scan *scans, const cairn_carmen_log_scans *from)
{
    for (int32_t i = 0; i < from->count; i++) {
        scans[i].input = from->record[i].scan;
        scans[i].input.stamp_ns = from->record[i].stamp_ns;
        scans[i].robot = from->record[i].robot;
    }
}

static cairn_status create(cairn_scanner_check **check, check_memory *memory,
                           const cairn_carmen_log_scans *scans)
{
    cairn_scanner_check_params params = params_for(scans);
    size_t bytes = cairn_scanner_check_memory(&params) + CAIRN_ALIGN;
    cairn_status status;
    cairn_pool pool;

    memory->scans = malloc(((size_t)scans->count + 1) * sizeof *memory->scans);
    memory->pool = malloc(bytes);
    if (memory->scans == NULL || memory->pool == NULL)
        return CAIRN_NO_MEMORY;
    status = cairn_pool_init(&pool, memory->pool, bytes);
    return status == CAIRN_OK ? cairn_scanner_check_create(check, &pool, &params) : status;
}

/* Steps to the end, or until the call is to end: CAIRN_MORE. */
static cairn_status run_to_end(cairn_scanner_check *check)
{
    cairn_status status;

    do {
        cairn_budget budget = {.left = CAIRN_INTERRUPTION_UNITS};

        status = cairn_scanner_check_step(check, &budget);
    } while (status == CAIRN_MORE && !cairn_interruption_is_requested());
    return status;
}

/* ---- The angle step ---- */

static int32_t most_beams(const cairn_scanner_check_scan *scans, int32_t count)
{
    int32_t most = 1;

    for (int32_t i = 0; i < count; i++)
        if (scans[i].input.count > most)
            most = scans[i].input.count;
    return most;
}

/* The default, with capacity for the longest scan. */
static cairn_status create_angle_step(cairn_angle_step **angle_step, void **memory,
                                      const cairn_scanner_check_scan *scans, int32_t count)
{
    cairn_angle_step_params params = cairn_angle_step_default();
    cairn_status status;
    cairn_pool pool;
    size_t bytes;

    params.max_beams = most_beams(scans, count);
    bytes = cairn_angle_step_memory(&params) + CAIRN_ALIGN;
    *memory = malloc(bytes);
    if (*memory == NULL)
        return CAIRN_NO_MEMORY;
    status = cairn_pool_init(&pool, *memory, bytes);
    return status == CAIRN_OK ? cairn_angle_step_create(angle_step, &pool, &params) : status;
}

cairn_status cairn_angle_step_run(cairn_angle_step_result *result,
                                  const cairn_scanner_check_scan *scans, int32_t count,
                                  cairn_fault *fault)
{
    cairn_angle_step *angle_step = NULL;
    void *memory = NULL;
    cairn_status status = create_angle_step(&angle_step, &memory, scans, count);

    memset(result, 0, sizeof *result);
    (void)cairn_refuse(fault, -1, NULL, status);
    if (status == CAIRN_OK)
        status = cairn_angle_step_begin(angle_step, scans, count, fault);
    if (status == CAIRN_OK)
        do {
            cairn_budget budget = {.left = CAIRN_INTERRUPTION_UNITS};

            status = cairn_angle_step_step(angle_step, &budget);
        } while (status == CAIRN_MORE && !cairn_interruption_is_requested());
    if (status == CAIRN_OK)
        *result = cairn_angle_step_read(angle_step);
    free(memory);
    return status;
}

/* ---- The map ---- */

/* A drive that is mapped. */
typedef struct drive_map {
    cairn_mapper *mapper;
    void *pool;
    cairn_scan_place *places; /* [count] */
} drive_map;

static cairn_status open_map(drive_map *map, const cairn_scanner_check_scan *scans, int32_t count,
                             int32_t points)
{
    const cairn_capacity_mapping mapping = {.max_keyframes = MAX_KEYFRAMES, .window = WINDOW};
    cairn_mapper_params params =
        cairn_capacity_mapper(&mapping, count, most_beams(scans, count), points);
    size_t bytes = cairn_mapper_memory(&params) + CAIRN_ALIGN;
    cairn_status status;
    cairn_pool pool;

    map->places = malloc((size_t)count * sizeof *map->places);
    map->pool = malloc(bytes);
    if (map->places == NULL || map->pool == NULL)
        return CAIRN_NO_MEMORY;
    status = cairn_pool_init(&pool, map->pool, bytes);
    return status == CAIRN_OK ? cairn_mapper_create(&map->mapper, &pool, &params) : status;
}

static void close_map(drive_map *map)
{
    free(map->places);
    free(map->pool);
}

/* Maps all scans. CAIRN_MORE: the call is to end. */
static cairn_status map_scans(drive_map *map, const cairn_scanner_check_scan *scans, int32_t count,
                              int32_t has_odometry)
{
    cairn_status status = CAIRN_OK;

    for (int32_t i = 0; i < count && status == CAIRN_OK; i++) {
        cairn_mapper_result result;

        if (cairn_interruption_is_requested())
            return CAIRN_MORE;
        status = cairn_mapper_map(map->mapper, &scans[i].input,
                                  has_odometry ? &scans[i].robot : NULL, NULL);
        result = cairn_mapper_read(map->mapper);
        map->places[i] = (cairn_scan_place){result.keyframe_scan, result.keyframe};
    }
    if (status == CAIRN_OK)
        do {
            cairn_budget budget = {.left = CAIRN_CAPACITY_SETTLE_UNITS};

            status = cairn_mapper_settle(map->mapper, &budget);
        } while (status == CAIRN_MORE && !cairn_interruption_is_requested());
    return status;
}

/* Replaces the poses of the scans by those of the map that they make. CAIRN_FULL: it needs more
 * points per keyframe. */
static cairn_status place_scans(cairn_scanner_check_scan *scans, int32_t count,
                                int32_t has_odometry, int32_t points)
{
    drive_map map = {NULL, NULL, NULL};
    cairn_status status = open_map(&map, scans, count, points);

    if (status == CAIRN_OK)
        status = map_scans(&map, scans, count, has_odometry);
    for (int32_t i = 0; i < count && status == CAIRN_OK; i++)
        scans[i].robot = cairn_scan_place_pose(map.mapper, &map.places[i]);
    close_map(&map);
    return status;
}

/* ---- The check ---- */

/* With other units or another sense there is no map; they are to be mended first. */
static int needs_map(const cairn_scanner_check_result *result)
{
    return cairn_scanner_check_needs_overlap(result) && result->range_scale == 1 && !result->flips;
}

/* Estimates the step from the map of the drive; not known when it cannot be mapped.
 * CAIRN_NO_MEMORY; CAIRN_MORE: the call is to end. */
static cairn_status confirm_step(cairn_scanner_check_result *result,
                                 cairn_scanner_check_scan *scans, int32_t count,
                                 int32_t has_odometry)
{
    cairn_status status = CAIRN_FULL;
    cairn_angle_step_result overlap;

    for (int32_t points = cairn_capacity_keyframe_points(0); points > 0 && status == CAIRN_FULL;
         points = cairn_capacity_keyframe_points(points))
        status = place_scans(scans, count, has_odometry, points);
    if (status == CAIRN_OK)
        status = cairn_angle_step_run(&overlap, scans, count, NULL);
    if (status == CAIRN_OK)
        result->overlap_step = overlap.ratio;
    return status == CAIRN_NO_MEMORY || status == CAIRN_MORE ? status : CAIRN_OK;
}

cairn_status cairn_scanner_check_run(cairn_scanner_check_result *result, const cairn_scan_log *log,
                                     cairn_fault *fault)
{
    check_memory memory = {NULL, NULL};
    cairn_scanner_check *check = NULL;
    cairn_status status = create(&check, &memory, &log->scans);

    memset(result, 0, sizeof *result);
    (void)cairn_refuse(fault, -1, NULL, status);
    if (status == CAIRN_OK) {
        copy_scans(memory.scans, &log->scans);
        status = cairn_scanner_check_begin(check, memory.scans, log->scans.count, log->has_odometry,
                                           fault);
    }
    if (status == CAIRN_OK)
        status = run_to_end(check);
    if (status == CAIRN_OK)
        *result = cairn_scanner_check_read(check);
    if (status == CAIRN_OK && needs_map(result))
        status = confirm_step(result, memory.scans, log->scans.count, log->has_odometry);
    free(memory.scans);
    free(memory.pool);
    return status;
}
