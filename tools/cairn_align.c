/* cairn align: all scans of a log at once, by force field simulation. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/force_field.h"
#include "cairn/output.h"
#include "tools/cairn_map_output.h"
#include "tools/cairn_player.h"
#include "tools/cairn_tool.h"

#define PROGRAM "cairn align"

/* The most points, and segments, of a field. */
#define FIELD_POINTS_MOST (1 << 24)

typedef struct settings {
    const char *log, *folder, *method, *pool, *report;
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
        OPTION_TEXT("--report", &s->report, "FILE", PLAYER_HELP),
        OPTION_TEXT("--pool", &s->pool, "BYTES", "memory of the alignment (just what it needs)"),
        OPTION_FLAG("--quiet", &s->quiet, "no progress, no summary"),
    };
    const option_set set = {
        PROGRAM, "LOG -o DIR [options]",
        "Aligns all scans of a CARMEN log (plain or gzipped) at once. Their order does not matter; the\n"
        "poses in the log are the start.",
        table, sizeof table / sizeof *table};
    option_result result = tool_read_options(&set, argc, argv, &s->log, &s->folder);

    if (result != OPTIONS_READ)
        return result;
    if (strcmp(s->method, "gradient") != 0) {
        (void)options_refuse(PROGRAM, "unknown method '%s', expected gradient", s->method);
        return OPTIONS_BAD;
    }
    return OPTIONS_READ;
}

/* Fits one scan. */
static cairn_status fit(cairn_scan *scan, const cairn_scan_input *input, cairn_scan_view *view, cairn_fault *fault)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_status status = cairn_scan_begin(scan, input, fault);

    while (status == CAIRN_OK && (status = cairn_scan_step(scan, &budget)) == CAIRN_MORE) {
        budget.left = CAIRN_UNBOUNDED;
        status = CAIRN_OK;
    }
    *view = cairn_scan_read(scan);
    return status;
}

/* A first pass over all scans: what they show, and how much room that takes. */
static int survey(const settings *s, const cairn_carmen_scans *log, cairn_scan *scan, map_scan *scans,
                  cairn_force_field_params *field)
{
    tool_progress progress = tool_progress_begin("lines", log->count, s->quiet);
    int64_t segments = 0, points = 0;

    for (int32_t i = 0; i < log->count; i++) {
        const cairn_carmen_record *record = &log->record[i];
        cairn_fault fault = {-1, NULL};
        cairn_scan_view view;
        cairn_status status = fit(scan, &record->scan, &view, &fault);

        if (status == CAIRN_OK && !map_scan_keep(&scans[i], &view))
            status = CAIRN_NO_MEMORY;
        if (status != CAIRN_OK) {
            tool_progress_end(&progress);
            return tool_report_scan(s->log, record->line, status, &fault);
        }
        segments += view.segment_count;
        points += view.point_count;
        scans[i].line = record->line;
        scans[i].stamp_ns = record->stamp_ns;
        scans[i].before = record->robot;
        scans[i].verdict = view.point_count > 0 ? "aligned" : "blind";
        scans[i].doubtful = view.point_count == 0;
        tool_progress_at(&progress, i);
    }
    tool_progress_end(&progress);
    if (points == 0)
        return options_refuse(PROGRAM, "%s: no scan shows a wall, expected at least one", s->log);
    if (points > FIELD_POINTS_MOST || segments > FIELD_POINTS_MOST)
        return options_refuse(PROGRAM, "%s: the scans have %" PRId64 " points, expected at most %d: widen --spacing",
                              s->log, points, FIELD_POINTS_MOST);
    field->max_scans = log->count;
    field->max_segments = (int32_t)segments;
    field->max_points = (int32_t)points;
    field->max_corners = field->max_segments;
    return TOOL_OK;
}

/* Fits the scans again and adds them to the field. */
static int add_scans(const settings *s, const cairn_carmen_scans *log, cairn_scan *scan, cairn_force_field *field,
                     const map_scan *scans)
{
    cairn_status status;

    for (int32_t i = 0; i < log->count; i++) {
        const cairn_carmen_record *record = &log->record[i];
        cairn_fault fault = {-1, NULL};
        cairn_scan_view view;

        status = fit(scan, &record->scan, &view, &fault);
        if (status == CAIRN_OK)
            status = cairn_force_field_add_scan(field, &view, NULL, scans[i].before, &fault);
        if (status != CAIRN_OK)
            return tool_report_scan(s->log, record->line, status, &fault);
    }
    return TOOL_OK;
}

/* Lets the field run; the record, when not NULL, sees every iteration. */
static cairn_status iterate(const settings *s, cairn_force_field *field, player_field *record,
                            cairn_real *first_potential)
{
    tool_progress progress = tool_progress_begin("align", s->steps, s->quiet);
    cairn_force_field_state state;
    cairn_status status;

    do {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        if (record != NULL)
            player_field_before(record);
        status = cairn_force_field_iterate(field, &budget);
        state = cairn_force_field_read(field);
        if (status >= 0 && record != NULL)
            status = player_field_after(record);
        if (state.iterations == 1)
            *first_potential = state.potential;
        tool_progress_at(&progress, state.iterations);
    } while (status >= 0 && state.verdict == CAIRN_FORCE_FIELD_RUNNING);
    tool_progress_end(&progress);
    return status >= 0 && record != NULL ? player_field_end(record) : status;
}

static int align(const settings *s, const cairn_carmen_scans *log, cairn_scan *scan, cairn_force_field *field,
                 map_scan *scans, cairn_report_player *player, cairn_real *first_potential)
{
    player_field record;
    cairn_status status;
    int code = add_scans(s, log, scan, field, scans);

    if (code != TOOL_OK)
        return code;
    if (player != NULL) {
        status = player_field_begin(&record, player, field);
        for (int32_t i = 0; i < log->count && status == CAIRN_OK; i++)
            status = player_add_scan(player, &scans[i], i);
        if (status == CAIRN_OK)
            status = iterate(s, field, &record, first_potential);
        player_field_free(&record);
    } else {
        status = iterate(s, field, NULL, first_potential);
    }
    if (status < 0) {
        (void)options_refuse(PROGRAM, "%s: %s", s->log, cairn_status_text(status));
        return tool_exit_code(status);
    }
    for (int32_t i = 0; i < log->count; i++)
        scans[i].after = cairn_force_field_pose(field, i);
    return TOOL_OK;
}

/* The player for --report; NULL without it. */
static cairn_status open_player(const settings *s, const cairn_carmen_scans *log, const cairn_force_field_params *field,
                                cairn_report_player **player)
{
    cairn_report_player_params params = player_field_params(field);
    char title[256], subtitle[256];

    *player = NULL;
    if (s->report == NULL)
        return CAIRN_OK;
    snprintf(title, sizeof title, "%s, aligned", cairn_path_name(s->log));
    snprintf(subtitle, sizeof subtitle, "%" PRId32 " scans, force field simulation", log->count);
    params.title = title;
    params.subtitle = subtitle;
    return cairn_report_player_open(player, &params);
}

static int write_all(const settings *s, const cairn_carmen_scans *log, map_scan *scans,
                     const cairn_force_field_state *state, cairn_report_player *player)
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
    output.player = player;
    output.report = s->report;
    if (map_output_write(&output, s->folder, &error) != CAIRN_OK)
        return tool_report(&error);
    return TOOL_OK;
}

static void print_summary(const cairn_carmen_scans *log, const cairn_force_field_state *state, size_t pool_bytes,
                          double seconds, cairn_real first_potential, cairn_real first_sigma)
{
    printf("scans      %" PRId32 " (%" PRId64 " damaged lines left out)\n"
           "seconds    %.3f\n"
           "pool       %zu bytes at most\n"
           "steps      %" PRId32 " (%s)\n"
           "potential  %.6g at sigma %.3g m -> %.6g at sigma %.3g m\n",
           log->count, log->info.faults, seconds, pool_bytes, state->iterations,
           state->verdict == CAIRN_FORCE_FIELD_CONVERGED ? "converged" : "out of steps", (double)first_potential,
           (double)first_sigma, (double)state->potential, (double)state->sigma);
}

/* The scan alone, in a pool of its own, to learn how large the field must be. */
static int measure(const settings *s, const cairn_carmen_scans *log, const cairn_scan_params *params, map_scan *scans,
                   cairn_force_field_params *field)
{
    cairn_scan *scan = NULL;
    cairn_pool pool;
    cairn_status status;
    int code = tool_pool_open(&pool, PROGRAM, NULL, cairn_scan_memory(params));

    if (code != TOOL_OK)
        return code;
    status = cairn_scan_create(&scan, &pool, params);
    if (status == CAIRN_OK) {
        code = survey(s, log, scan, scans, field);
    } else {
        (void)options_refuse(PROGRAM, "%s: %s", s->log, cairn_status_text(status));
        code = tool_exit_code(status);
    }
    tool_pool_close(&pool);
    return code;
}

static int run(const settings *s, const cairn_carmen_scans *log, map_scan *scans)
{
    cairn_scan_params scan_params = cairn_scan_default();
    cairn_force_field_params field_params = cairn_force_field_default();
    cairn_force_field *field = NULL;
    cairn_scan *scan = NULL;
    cairn_report_player *player = NULL;
    cairn_force_field_state state;
    cairn_real first_potential = 0;
    cairn_status status;
    cairn_pool pool;
    double start = tool_seconds();
    int code;

    scan_params.max_beams = log->info.beams_most;
    scan_params.spacing = (cairn_real)s->spacing;
    code = measure(s, log, &scan_params, scans, &field_params);
    if (code != TOOL_OK)
        return code;
    field_params.max_steps = (int32_t)s->steps;
    code = tool_pool_open(&pool, PROGRAM, s->pool,
                          cairn_force_field_memory(&field_params) + cairn_scan_memory(&scan_params));
    if (code != TOOL_OK)
        return code;
    status = cairn_scan_create(&scan, &pool, &scan_params);
    if (status == CAIRN_OK)
        status = cairn_force_field_create(&field, &pool, &field_params);
    if (status == CAIRN_OK)
        status = open_player(s, log, &field_params, &player);
    if (status == CAIRN_OK) {
        code = align(s, log, scan, field, scans, player, &first_potential);
    } else {
        (void)options_refuse(PROGRAM, "%s: %s", s->log, cairn_status_text(status));
        code = tool_exit_code(status);
    }
    if (code == TOOL_OK) {
        state = cairn_force_field_read(field);
        code = write_all(s, log, scans, &state, player);
        if (code == TOOL_OK && !s->quiet)
            print_summary(log, &state, pool.peak, tool_seconds() - start, first_potential, field_params.sigma_start);
    }
    cairn_report_player_free(player);
    tool_pool_close(&pool);
    return code;
}

int tool_align(int argc, char **argv)
{
    settings s = {NULL, NULL, "gradient", NULL, NULL, 500, 50, 1, 0.05, 30, 0, 0.1, 0};
    cairn_file_error error;
    option_result result;
    cairn_carmen_scans log;
    map_scan *scans;
    int code;

    result = read_settings(&s, argc, argv);
    if (result != OPTIONS_READ)
        return result;
    if (map_output_check(s.folder, s.report, &error) != CAIRN_OK)
        return tool_report(&error);
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
            (void)options_refuse(PROGRAM, "no memory for %" PRId32 " scans", log.count);
            code = TOOL_FAILED;
        } else {
            code = run(&s, &log, scans);
        }
        map_scans_free(scans, log.count);
    }
    cairn_carmen_scans_free(&log);
    return code;
}
