/* cairn align: all scans of a log at once, by force field simulation. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/force_field.h"
#include "cairn/output.h"
#include "tools/cairn_map_output.h"
#include "tools/cairn_tool.h"

#define PROGRAM "cairn align"

typedef struct settings {
    const char *log, *folder, *method, *pool;
    int64_t max_scans, steps, seed;
    double resolution, range, range_max, spacing;
    int32_t quiet;
} settings;

static option_result read_settings(settings *s, int argc, char **argv)
{
    const option table[] = {
        OPTION_TEXT("-o", &s->folder, "DIR", "folder for poses.csv, map.pgm, map.yaml and map.svg"),
        OPTION_TEXT("--method", &s->method, "NAME", "gradient: force field simulation as in the thesis (default)"),
        OPTION_INTEGER("--steps", &s->steps, 1, 100000, "N", "iterations at most"),
        OPTION_INTEGER("--max-scans", &s->max_scans, 1, 100000, "N", "scans at most"),
        OPTION_NUMBER("--spacing", &s->spacing, 0.01, 1, "M", "distance of the points along walls, m"),
        OPTION_NUMBER("--resolution", &s->resolution, 0.001, 10, "M", "side of a cell of the map, m"),
        OPTION_NUMBER("--range", &s->range, 0.1, 1000, "M", "beams enter the map up to here, m"),
        OPTION_NUMBER("--range-max", &s->range_max, 0.1, 1000, "M",
                      "ranges from here on are no return, m (by the log)"),
        OPTION_INTEGER("--seed", &s->seed, 0, 9e15, "N", "for methods that draw at random; gradient does not"),
        OPTION_TEXT("--pool", &s->pool, "BYTES", "memory of the alignment (just what it needs)"),
        OPTION_FLAG("--quiet", &s->quiet, "no progress, no summary"),
    };
    const option_set set = {
        PROGRAM, "LOG -o DIR [options]",
        "Aligns all scans of a CARMEN log (plain or gzipped) at once. Their order does not matter; the\n"
        "poses in the log are the start.",
        table, sizeof table / sizeof *table};
    const char *words[1];
    size_t count = 1;
    option_result result = options_read(&set, argc, argv, words, &count);

    if (result != OPTIONS_READ)
        return result;
    s->log = count > 0 ? words[0] : NULL;
    if (s->log == NULL || s->folder == NULL) {
        (void)options_refuse(PROGRAM, "%s, expected LOG -o DIR",
                             s->log == NULL ? "no log" : "no folder to write to (-o)");
        return OPTIONS_BAD;
    }
    if (strcmp(s->method, "gradient") != 0) {
        (void)options_refuse(PROGRAM, "unknown method '%s', expected gradient", s->method);
        return OPTIONS_BAD;
    }
    return OPTIONS_READ;
}

/* Fits one scan. */
static cairn_status fit(cairn_scan *scan, const cairn_scan_input *input, cairn_scan_view *view)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_status status = cairn_scan_begin(scan, input, NULL);

    while (status == CAIRN_OK && (status = cairn_scan_step(scan, &budget)) == CAIRN_MORE) {
        budget.left = CAIRN_UNBOUNDED;
        status = CAIRN_OK;
    }
    *view = cairn_scan_read(scan);
    return status;
}

/* A first pass over all scans: what they show, and how much room that takes. */
static int survey(const settings *s, const cairn_carmen_scans *log, const cairn_scan_params *params, map_scan *scans,
                  cairn_force_field_params *field)
{
    size_t bytes = cairn_scan_memory(params);
    tool_progress progress = tool_progress_begin("lines", log->count, s->quiet);
    cairn_pool pool;
    cairn_scan *scan;
    int code = tool_pool_open(&pool, PROGRAM, NULL, bytes);
    cairn_status status;

    if (code != TOOL_OK)
        return code;
    field->max_scans = log->count;
    field->max_segments = field->max_points = 0;
    status = cairn_scan_create(&scan, &pool, params);
    for (int32_t i = 0; i < log->count && status == CAIRN_OK; i++) {
        cairn_scan_view view;

        status = fit(scan, &log->record[i].scan, &view);
        if (status == CAIRN_OK && !map_scan_keep(&scans[i], &view))
            status = CAIRN_NO_MEMORY;
        field->max_segments += view.segment_count;
        field->max_points += view.point_count;
        scans[i].line = log->record[i].line;
        scans[i].stamp_ns = log->record[i].stamp_ns;
        scans[i].before = log->record[i].robot;
        scans[i].verdict = view.point_count > 0 ? "aligned" : "blind";
        scans[i].doubtful = view.point_count == 0;
        tool_progress_at(&progress, i);
    }
    tool_progress_end(&progress);
    tool_pool_close(&pool);
    if (status != CAIRN_OK)
        return options_refuse(PROGRAM, "%s: %s", s->log, cairn_status_text(status));
    if (field->max_points == 0)
        return options_refuse(PROGRAM, "%s: no scan shows a wall, expected at least one", s->log);
    field->max_corners = field->max_segments;
    return TOOL_OK;
}

/* Fits the scans again, adds them to the field, lets it run. */
static cairn_status align(const settings *s, const cairn_carmen_scans *log, const cairn_scan_params *params,
                          cairn_scan *scan, cairn_force_field *field, map_scan *scans, cairn_real *first_potential)
{
    tool_progress progress = tool_progress_begin("align", s->steps, s->quiet);
    cairn_status status = CAIRN_OK;
    cairn_force_field_state state;

    (void)params;
    for (int32_t i = 0; i < log->count && status == CAIRN_OK; i++) {
        cairn_scan_view view;

        status = fit(scan, &log->record[i].scan, &view);
        if (status == CAIRN_OK)
            status = cairn_force_field_add_scan(field, &view, NULL, scans[i].before, NULL);
    }
    do {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        if (status == CAIRN_OK)
            status = cairn_force_field_iterate(field, &budget);
        if (status == CAIRN_MORE)
            status = CAIRN_OK;
        state = cairn_force_field_read(field);
        if (state.iterations == 1)
            *first_potential = state.potential;
        tool_progress_at(&progress, state.iterations);
    } while (status == CAIRN_OK && state.verdict == CAIRN_FORCE_FIELD_RUNNING);
    tool_progress_end(&progress);
    for (int32_t i = 0; i < log->count && status == CAIRN_OK; i++)
        scans[i].after = cairn_force_field_pose(field, i);
    return status;
}

static int write_all(const settings *s, const cairn_carmen_scans *log, map_scan *scans,
                     const cairn_force_field_state *state)
{
    cairn_file_error error;
    map_output output;
    char title[256], subtitle[256];

    snprintf(title, sizeof title, "%s, aligned", cairn_path_name(s->log));
    snprintf(subtitle, sizeof subtitle, "%" PRId32 " scans, %" PRId32 " steps of force field simulation", log->count,
             state->iterations);
    memset(&output, 0, sizeof output);
    output.title = title;
    output.subtitle = subtitle;
    output.scan = scans;
    output.count = log->count;
    output.resolution = s->resolution;
    output.range = s->range;
    if (map_output_write(&output, s->folder, &error) != CAIRN_OK)
        return tool_report(&error);
    return TOOL_OK;
}

static int run(const settings *s, const cairn_carmen_scans *log, map_scan *scans)
{
    cairn_scan_params scan_params = cairn_scan_default();
    cairn_force_field_params field_params = cairn_force_field_default();
    cairn_force_field *field = NULL;
    cairn_scan *scan = NULL;
    cairn_force_field_state state;
    cairn_real first_potential = 0;
    cairn_status status;
    cairn_pool pool;
    size_t field_bytes;
    double start = tool_seconds();
    int code;

    scan_params.max_beams = log->info.beams_most;
    scan_params.spacing = (cairn_real)s->spacing;
    code = survey(s, log, &scan_params, scans, &field_params);
    if (code != TOOL_OK)
        return code;
    field_params.max_steps = (int32_t)s->steps;
    field_bytes = cairn_force_field_memory(&field_params);
    code =
        tool_pool_open(&pool, PROGRAM, s->pool, field_bytes == 0 ? 0 : field_bytes + cairn_scan_memory(&scan_params));
    if (code != TOOL_OK)
        return code;
    status = cairn_scan_create(&scan, &pool, &scan_params);
    if (status == CAIRN_OK)
        status = cairn_force_field_create(&field, &pool, &field_params);
    if (status == CAIRN_OK)
        status = align(s, log, &scan_params, scan, field, scans, &first_potential);
    if (status != CAIRN_OK) {
        tool_pool_close(&pool);
        return options_refuse(PROGRAM, "%s: %s", s->log, cairn_status_text(status));
    }
    state = cairn_force_field_read(field);
    code = write_all(s, log, scans, &state);
    if (code == TOOL_OK && !s->quiet)
        printf("scans      %" PRId32 " (%" PRId64 " damaged lines left out)\n"
               "seconds    %.3f\n"
               "pool       %zu bytes at most\n"
               "steps      %" PRId32 " (%s)\n"
               "potential  %.6g at sigma %.3g m -> %.6g at sigma %.3g m\n",
               log->count, log->info.faults, tool_seconds() - start, pool.peak, state.iterations,
               state.verdict == CAIRN_FORCE_FIELD_CONVERGED ? "converged" : "out of steps", (double)first_potential,
               (double)field_params.sigma_start, (double)state.potential, (double)state.sigma);
    tool_pool_close(&pool);
    return code;
}

int tool_align(int argc, char **argv)
{
    settings s = {NULL, NULL, "gradient", NULL, 500, 50, 1, 0.05, 30, 0, 0.1, 0};
    cairn_carmen_scans log;
    map_scan *scans;
    int code;

    switch (read_settings(&s, argc, argv)) {
    case OPTIONS_HELPED:
        return TOOL_OK;
    case OPTIONS_BAD:
        return TOOL_BAD;
    default:
        break;
    }
    code = tool_load(&log, s.log, s.range_max, s.quiet);
    if (code != TOOL_OK)
        return code;
    if (log.count > s.max_scans) {
        code = options_refuse(PROGRAM,
                              "%s holds %" PRId32 " scans, expected at most %" PRId64
                              ": raise --max-scans, or use cairn map, which goes scan by scan",
                              s.log, log.count, s.max_scans);
    } else {
        scans = map_scans_new(log.count);
        if (scans == NULL) {
            fprintf(stderr, "%s: no memory for %" PRId32 " scans\n", PROGRAM, log.count);
            code = TOOL_FAILED;
        } else {
            code = run(&s, &log, scans);
        }
        map_scans_free(scans, log.count);
    }
    cairn_carmen_scans_free(&log);
    return code;
}
