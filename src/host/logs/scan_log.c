/* Reader of scans of any format.
 *
 * Method: the format is detected by the first bytes (bags), by the first character (JSON of CSM)
 * and by the first lines (tables; everything else is a CARMEN log). The format's reader does the
 * rest; the scans of CSM are converted to records. */
#include "src/base/build.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/csm_scan.h"
#include "cairn/range_table.h"
#include "src/host/logs/carmen_log_reader.h"
#include "src/host/logs/carmen_log_summary.h"
#include "src/host/logs/log_parameters.h"
#include "src/host/logs/scan_log_work.h"

/* Period of scans of CSM without stamps. */
static const int64_t SCAN_PERIOD_NS = 100000000;

static const cairn_host_parameter rows[] = {
    LOG_PARAMETERS(cairn_scan_log_params),
};

const cairn_host_parameters cairn_scan_log_parameters =
    CAIRN_HOST_PARAMETERS(cairn_scan_log_params, rows);

cairn_scan_log_params cairn_scan_log_default(void)
{
    cairn_scan_log_params params;

    cairn_host_parameters_preset(&cairn_scan_log_parameters, &params);
    return params;
}

/* ---- Scans of CSM ---- */

/* Counts the rays of all scans; *has_odometry: all scans have it. */
static size_t count_rays(const cairn_csm_scan_list *list, int32_t *has_odometry)
{
    size_t rays = 0;

    *has_odometry = 1;
    for (int32_t i = 0; i < list->count; i++) {
        rays += (size_t)list->scan[i].scan.count;
        *has_odometry &= list->scan[i].has_odometry;
    }
    return rays;
}

/* Converts a scan; beam: space for its ranges and bearings. */
static void convert_scan(const cairn_csm_scan *scan, int32_t index, float *beam,
                         cairn_carmen_log_record *record)
{
    size_t count = (size_t)scan->scan.count;

    memcpy(beam, scan->scan.range, count * sizeof *beam);
    memcpy(beam + count, scan->scan.angle, count * sizeof *beam);
    record->kind = CAIRN_CARMEN_LOG_SCAN;
    record->count = scan->scan.count;
    record->line = scan->line;
    record->robot = record->laser = scan->odometry;
    record->scan = scan->scan;
    record->scan.range = record->range = beam;
    record->scan.angle = beam + count;
    if (!scan->has_stamp)
        record->scan.stamp_ns = index * SCAN_PERIOD_NS;
    record->stamp_ns = record->scan.stamp_ns;
}

/* Converts the scans of a file. */
static cairn_status convert_csm(cairn_scan_log *log, const cairn_csm_scan_list *list,
                                const char *path, cairn_file_error *error)
{
    cairn_carmen_log_scans *scans = &log->scans;
    size_t rays = count_rays(list, &log->has_odometry), at = 0;

    scans->record = calloc((size_t)list->count, sizeof *scans->record);
    scans->range = malloc((2 * rays + 1) * sizeof *scans->range);
    if (scans->record == NULL || scans->range == NULL)
        return cairn_file_error_system(error, path, "read", ENOMEM);
    for (; scans->count < list->count; scans->count++) {
        convert_scan(&list->scan[scans->count], scans->count, scans->range + at,
                     &scans->record[scans->count]);
        at += 2 * (size_t)list->scan[scans->count].scan.count;
    }
    cairn_carmen_log_summarize(scans);
    memcpy(scans->info.origin, list->origin, sizeof list->origin);
    scans->info.lines = list->count;
    scans->info.fixed_mounting = 1;
    return CAIRN_OK;
}

static cairn_status load_csm(cairn_scan_log *log, const char *path,
                             const cairn_scan_log_params *params, cairn_file_error *error)
{
    cairn_csm_scan_params csm = {.range_max = params->range_max,
                                 .range_sigma = params->range_sigma};
    cairn_csm_scan_list list;
    cairn_status status;

    status = cairn_csm_scan_load(&list, path, &csm, error);
    if (status != CAIRN_OK)
        return status;
    log->scans.info.range_max = list.range_max;
    status = convert_csm(log, &list, path, error);
    cairn_csm_scan_list_free(&list);
    return status;
}

/* ---- The format ---- */

/* Detects a format of text. *kind: CSM when the first character that is no white space opens a JSON
 * object or array. */
static cairn_status find_text_kind(cairn_scan_log_kind *kind, const char *path,
                                   cairn_file_error *error)
{
    cairn_range_table_kind table;
    cairn_line_reader *reader;
    const char *line, *token;
    size_t length = 0;
    cairn_status status = cairn_line_reader_open(&reader, path, error);

    if (status != CAIRN_OK)
        return status;
    *kind = CAIRN_SCAN_LOG_CARMEN;
    /* faults are reported by the format's reader */
    do {
        token = "";
        status = cairn_line_reader_next(reader, &line, &length, NULL);
        if (status == CAIRN_OK)
            length = cairn_token_next(&line, line + length, &token);
    } while (status == CAIRN_OK && length == 0);
    if (status == CAIRN_OK && (token[0] == '{' || token[0] == '['))
        *kind = CAIRN_SCAN_LOG_CSM;
    cairn_line_reader_close(reader);
    if (*kind == CAIRN_SCAN_LOG_CSM)
        return CAIRN_OK;
    status = cairn_range_table_find_kind(&table, path, error);
    if (status == CAIRN_OK && table != CAIRN_RANGE_TABLE_NONE)
        *kind = table == CAIRN_RANGE_TABLE_CSV ? CAIRN_SCAN_LOG_CSV : CAIRN_SCAN_LOG_URG;
    return status;
}

/* Loads a format of text. */
static cairn_status load_text(cairn_scan_log *log, const char *path,
                              const cairn_scan_log_params *params, cairn_file_error *error)
{
    cairn_carmen_log_params carmen = {.range_max = params->range_max,
                                      .range_sigma = params->range_sigma,
                                      .on_fault = params->on_fault,
                                      .context = params->context};
    cairn_status status = find_text_kind(&log->kind, path, error);

    if (status == CAIRN_OK && (params->scan_topic != NULL || params->odometry_topic != NULL))
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, path, 0, "no bag, expected one with the topic %s",
            params->scan_topic != NULL ? params->scan_topic : params->odometry_topic);
    if (status != CAIRN_OK)
        return status;
    log->has_odometry = 1;
    switch (log->kind) {
    case CAIRN_SCAN_LOG_CSM:
        return load_csm(log, path, params, error);
    case CAIRN_SCAN_LOG_CSV:
        return cairn_range_table_load(&log->scans, &log->has_odometry, path, CAIRN_RANGE_TABLE_CSV,
                                      &carmen, error);
    case CAIRN_SCAN_LOG_URG:
        return cairn_range_table_load(&log->scans, &log->has_odometry, path, CAIRN_RANGE_TABLE_URG,
                                      &carmen, error);
    default:
        return cairn_carmen_log_load(&log->scans, path, &carmen, error);
    }
}

cairn_status cairn_scan_log_check(const cairn_scan_log_params *params, const char *path,
                                  cairn_file_error *error)
{
    return cairn_host_parameters_check(&cairn_scan_log_parameters, params, path, error);
}

cairn_status cairn_scan_log_load(cairn_scan_log *log, const char *path,
                                 const cairn_scan_log_params *params, cairn_file_error *error)
{
    cairn_scan_log_params standard = cairn_scan_log_default();
    cairn_bag_kind bag;
    cairn_status status = cairn_bag_file_find_kind(&bag, path, error);

    memset(log, 0, sizeof *log);
    if (status != CAIRN_OK)
        return status;
    if (params == NULL)
        params = &standard;
    status = cairn_scan_log_check(params, path, error);
    if (status != CAIRN_OK)
        return status;
    if (bag != CAIRN_BAG_NONE) {
        log->kind = CAIRN_SCAN_LOG_BAG;
        status = cairn_scan_log_load_bag(log, path, bag, params, error);
    } else {
        status = load_text(log, path, params, error);
    }
    if (status != CAIRN_OK)
        cairn_scan_log_free(log);
    return status;
}

static void free_sources(cairn_scan_log_sources *sources)
{
    if (sources == NULL)
        return;
    for (int32_t i = 0; i < sources->topic_count; i++) {
        free(sources->topics[i].name);
        free(sources->topics[i].type);
    }
    free(sources->topics);
    free(sources->sensor_frame);
    free(sources->base_frame);
    free(sources->odometry_frame);
    free(sources);
}

void cairn_scan_log_free(cairn_scan_log *log)
{
    free_sources(log->sources);
    cairn_carmen_log_scans_free(&log->scans);
    memset(log, 0, sizeof *log);
}
