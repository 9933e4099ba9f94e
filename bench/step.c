/* bench/step: the angle step of a mapped log, from its overlapping scans. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "bench/bench_json.h"
#include "cairn/output.h"
#include "cairn/pose_table.h"
#include "src/host/base/degrees.h"
#include "src/host/logs/scan_log_correction.h"
#include "src/host/maps/scanner_check_run.h"
#include "tools/options.h"

/* The scans of a log with the poses of a table of all of them; NULL after a line. */
static cairn_scanner_check_scan *scans_of(const cairn_scan_log *log, const char *path)
{
    cairn_scanner_check_scan *scans = NULL;
    cairn_pose_table_row *row;
    cairn_file_error error;
    int32_t count;

    if (cairn_pose_table_read(&row, &count, path, &error) != CAIRN_OK) {
        fprintf(stderr, "%s\n", error.text);
        return NULL;
    }
    if (count == log->scans.count)
        scans = malloc((size_t)count * sizeof *scans);
    else
        fprintf(stderr, "%s: %" PRId32 " poses, expected those of %" PRId32 " scans\n", path, count,
                log->scans.count);
    for (int32_t i = 0; scans != NULL && i < count; i++) {
        scans[i].input = log->scans.record[i].scan;
        scans[i].robot = row[i].pose;
    }
    cairn_pose_table_free(row);
    return scans;
}

static void print(const char *log, const cairn_angle_step_result *found, double seconds)
{
    bench_json_begin("step");
    bench_json_text("log", cairn_output_path_name(log));
    bench_json_number("logged_deg", (double)found->logged * CAIRN_DEGREES_PER_RADIAN);
    bench_json_integer("pairs", found->pairs);
    bench_json_integer("known", found->ratio.is_known);
    bench_json_number("ratio", (double)found->ratio.value);
    bench_json_number("sigma", (double)found->ratio.sigma);
    bench_json_number("seconds", seconds);
    bench_json_end();
}

int main(int argc, char **argv)
{
    double angle_step = 0, start;
    const option table[] = {
        OPTION_NUMBER("--angle-step", &angle_step, 1e-3, 180, "DEG",
                      "angle between neighbouring beams (from the log)"),
    };
    const option_set set = {"bench/step", "LOG POSES.csv [options]",
                            "Angle step of a log by overlapping scans at the poses of its map, "
                            "those of cairn map LOG -o DIR.",
                            table, sizeof table / sizeof *table};
    cairn_scan_log_params params = cairn_scan_log_default();
    cairn_scan_correction correction = cairn_scan_correction_none();
    cairn_angle_step_result found;
    cairn_scanner_check_scan *scans;
    const char *word[2];
    cairn_file_error error;
    cairn_scan_log log;
    cairn_status status;
    size_t words = 2;
    option_result result = options_read(&set, argc, argv, word, &words);

    if (result != OPTIONS_READ)
        return result;
    if (words < 2)
        return options_refuse("bench/step", "%zu files, expected LOG POSES.csv", words);
    if (cairn_scan_log_load(&log, word[0], &params, &error) != CAIRN_OK) {
        fprintf(stderr, "%s\n", error.text);
        return 3;
    }
    correction.angle_step = (cairn_real)(angle_step / CAIRN_DEGREES_PER_RADIAN);
    status = cairn_scan_log_correct(&log, &correction);
    scans = status == CAIRN_OK ? scans_of(&log, word[1]) : NULL;
    start = bench_cpu_seconds();
    if (scans != NULL) {
        status = cairn_angle_step_run(&found, scans, log.scans.count, NULL);
        if (status == CAIRN_OK)
            print(word[0], &found, bench_cpu_seconds() - start);
    }
    if (status != CAIRN_OK)
        fprintf(stderr, "%s: %s\n", word[0], cairn_status_text(status));
    free(scans);
    cairn_scan_log_free(&log);
    return scans != NULL && status == CAIRN_OK ? 0 : 3;
}
