/* Writer of a log's scans as a table of ranges. */
#include "src/base/build.h"

#include <inttypes.h>
#include <math.h>

#include "cairn/number_text.h"
#include "cairn/output.h"
#include "cairn/scan_correction.h"
#include "src/host/base/degrees.h"
#include "src/host/base/interruption.h"
#include "src/host/logs/scan_table.h"

/* Digits that read back as the same double, and as the same float. */
#define EXACT_DOUBLE "%.17g"
#define EXACT_FLOAT  "%.9g"

/* Largest difference of a bearing between scans, rad. */
#define BEARING_TOLERANCE 1e-6f

/* Refuses scans whose bearings differ from those of the first one. */
static cairn_status check_bearings(const cairn_carmen_log_scans *scans, const char *path,
                                   cairn_file_error *error)
{
    const cairn_scan_input *first = &scans->record[0].scan;

    for (int32_t i = 1; i < scans->count; i++) {
        const cairn_scan_input *scan = &scans->record[i].scan;

        for (int32_t k = 0; k < scan->count || k < first->count; k++)
            if (k >= scan->count || k >= first->count ||
                fabsf(cairn_scan_correction_bearing(scan, k) -
                      cairn_scan_correction_bearing(first, k)) > BEARING_TOLERANCE)
                return cairn_file_error_set(error, CAIRN_BAD_FORMAT, path, 0,
                                            "scan %" PRId32
                                            " has other bearings than the first one (beam %" PRId32
                                            "), expected the same beams in all scans of a table",
                                            i, k);
    }
    return CAIRN_OK;
}

static void print_scan(cairn_output *output, const cairn_carmen_log_record *record,
                       int32_t has_odometry)
{
    cairn_pose sensor = cairn_pose_compose(record->robot, record->scan.base_sensor);
    char stamp[CAIRN_NUMBER_TEXT_BYTES];

    cairn_output_print(output, "%s", cairn_number_write_stamp(stamp, record->stamp_ns));
    if (has_odometry)
        cairn_output_print(output, "," EXACT_DOUBLE "," EXACT_DOUBLE "," EXACT_DOUBLE,
                           (double)sensor.x, (double)sensor.y, (double)sensor.theta);
    for (int32_t k = 0; k < record->count; k++) {
        float range = record->range[k];

        if (isnan(range))
            cairn_output_print(output, ",nan");
        else if (isinf(range))
            cairn_output_print(output, ",inf");
        else
            cairn_output_print(output, "," EXACT_FLOAT, (double)range);
    }
    cairn_output_print(output, "\n");
}

cairn_status cairn_scan_table_write(const cairn_scan_log *log, const char *path,
                                    cairn_file_error *error)
{
    const cairn_carmen_log_scans *scans = &log->scans;
    const cairn_scan_input *first = &scans->record[0].scan;
    cairn_status status = check_bearings(scans, path, error);
    cairn_output *output;

    if (status == CAIRN_OK)
        status = cairn_output_open(&output, path, error);
    if (status != CAIRN_OK)
        return status;
    cairn_output_print(output, log->has_odometry ? "time,x,y,theta" : "time");
    for (int32_t k = 0; k < first->count; k++)
        cairn_output_print(output, "," EXACT_DOUBLE,
                           (double)cairn_scan_correction_bearing(first, k) *
                               CAIRN_DEGREES_PER_RADIAN);
    cairn_output_print(output, "\n");
    for (int32_t i = 0; i < scans->count; i++) {
        if (cairn_interruption_is_requested()) {
            cairn_output_discard(output);
            return CAIRN_MORE;
        }
        print_scan(output, &scans->record[i], log->has_odometry);
    }
    return cairn_output_commit(output, error);
}
