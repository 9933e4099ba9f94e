/* Check of the scanner of a whole log, and estimate of the angle step of a mapped one. */
#include "src/base/build.h"

#include <stdlib.h>
#include <string.h>

#include "src/host/base/interruption.h"
#include "src/host/maps/scanner_check_run.h"

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
    free(memory.scans);
    free(memory.pool);
    return status;
}

/* ---- The angle step ---- */

/* The default, with capacity for the longest scan. */
static cairn_status create_angle_step(cairn_angle_step **angle_step, void **memory,
                                      const cairn_scanner_check_scan *scans, int32_t count)
{
    cairn_angle_step_params params = cairn_angle_step_default();
    cairn_status status;
    cairn_pool pool;
    size_t bytes;

    params.max_beams = 1;
    for (int32_t i = 0; i < count; i++)
        if (scans[i].input.count > params.max_beams)
            params.max_beams = scans[i].input.count;
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
