/* cairn match: scan matching of two scans without a prior; returns ranked relative poses with
 * covariances. */
#include "tools/cairn_match.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/output.h"
#include "cairn/output_set.h"
#include "src/host/base/degrees.h"
#include "tools/cairn_match_picture.h"

#define PROGRAM "cairn match"

enum { JSON, OVERLAY, TANGENTS, HISTOGRAM, PAIRS, FILTERS, FILES };
static const char *const file_names[FILES] = {"match.json",    "match.svg", "tangents.svg",
                                              "histogram.svg", "pairs.svg", "filters.svg"};

typedef struct settings {
    const char *word[2], *folder, *method, *start_text, *pool, *scan_topic, *odometry_topic;
    tool_scanner scanner;
    double window[2]; /* m, degrees */
    double spacing, range_max;
    double start[3]; /* m, m, degrees */
    int32_t window_given, method_given, spacing_given, as_written, pictures, json, quiet;
} settings;

static int is_by_shape(const settings *s)
{
    return s->as_written || strcmp(s->method, "shape") == 0;
}

static int32_t file_count(const settings *s)
{
    return !s->pictures ? JSON + 1 : is_by_shape(s) ? FILES : HISTOGRAM;
}

static option_result check_settings(settings *s, size_t count)
{
    if (count < 2) {
        (void)options_refuse(PROGRAM, "%s, expected A and B",
                             count == 0 ? "no scans" : "only one scan");
        return OPTIONS_BAD;
    }
    if (s->as_written && (s->method_given || s->spacing_given)) {
        (void)options_refuse(
            PROGRAM,
            s->method_given
                ? "--as-written with --method, expected one of them: it is a method"
                : "--as-written with --spacing, expected without: it uses the raw readings");
        return OPTIONS_BAD;
    }
    if (s->as_written)
        s->method = "as_written";
    if (!s->as_written && strcmp(s->method, "default") != 0 && !is_by_shape(s)) {
        (void)options_refuse(PROGRAM, "unknown method '%s', expected default or shape", s->method);
        return OPTIONS_BAD;
    }
    if (s->start_text != NULL && !tool_read_pose(s->start_text, s->start)) {
        (void)options_refuse(PROGRAM, "--start is '%s', expected three numbers X,Y,DEG within 1e5",
                             s->start_text);
        return OPTIONS_BAD;
    }
    if (s->window_given && s->start_text == NULL) {
        (void)options_refuse(PROGRAM, "--window without --start, expected both or none");
        return OPTIONS_BAD;
    }
    if (s->pictures && s->folder == NULL) {
        (void)options_refuse(PROGRAM, "--pictures without a folder to write to, expected -o DIR");
        return OPTIONS_BAD;
    }
    return OPTIONS_READ;
}

static option_result read_settings(settings *s, int argc, char **argv)
{
    option table[] = {
        OPTION_TEXT("-o", &s->folder, "DIR", "folder for match.json and the pictures"),
        OPTION_FLAG("--pictures", &s->pictures,
                    "draws A and B before and after, the tangent directions of B; by shape also "
                    "every stage"),
        OPTION_TEXT(
            "--method", &s->method, "NAME",
            "default (correlative), or shape: sequences of tangent directions, after the thesis"),
        OPTION_FLAG("--as-written", &s->as_written,
                    "the method of the thesis as printed: the heading is that of --start (0) to 2 "
                    "degrees, or by --window"),
        OPTION_TEXT("--start", &s->start_text, "X,Y,DEG",
                    "prior pose of B in the frame of A, m, m, degrees (none: global search)"),
        OPTION_PAIR(
            "--window", s->window, 0, 1000, "M,DEG",
            "search window about --start: maximum difference in x and y, m, and heading, degrees"),
        OPTION_NUMBER("--spacing", &s->spacing, 0.01, 1, "M",
                      "spacing of the points along walls, m"),
        OPTION_NUMBER("--range-max", &s->range_max, 0.1, 1000, "M",
                      "ranges from this value on count as no return, m (from the log; CSM: 80)"),
        TOOL_LOG_OPTIONS(&s->scan_topic, &s->odometry_topic, &s->scanner),
        OPTION_TEXT("--pool", &s->pool, "BYTES", "memory of the match (exactly the memory needed)"),
        OPTION_JSON(&s->json),
        OPTION_FLAG("--quiet", &s->quiet, "prints only errors"),
    };
    const option_set set = {PROGRAM, "A B [options]",
                            "Matches scan B against scan A: hypotheses of the pose of B in the "
                            "frame of A, best first, with standard "
                            "deviations, and a verdict: found, ambiguous (competing hypotheses, or "
                            "an unobservable direction) or none. "
                            "A and B: FILE or FILE:INDEX, a " TOOL_LOG "; INDEX counts "
                            "the scans of the file from 0, which is also the default.",
                            table, sizeof table / sizeof *table};
    size_t count = 2;
    option_result result;

    for (size_t i = 0; i < sizeof table / sizeof *table; i++)
        table[i].given = strcmp(table[i].name, "--window") == 0    ? &s->window_given
                         : strcmp(table[i].name, "--method") == 0  ? &s->method_given
                         : strcmp(table[i].name, "--spacing") == 0 ? &s->spacing_given
                                                                   : NULL;
    result = options_read(&set, argc, argv, s->word, &count);
    return result == OPTIONS_READ ? check_settings(s, count) : result;
}

/* ---- the match ---- */

/* Fits the lines of one scan and computes its dense points; as written the raw readings are its
 * points. */
static int prepare(match_side *side, cairn_scan *scan, int32_t as_written)
{
    cairn_fault fault = {-1, NULL};
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_status status = cairn_scan_begin(scan, &side->input.scan, &fault);

    while (status == CAIRN_OK && (status = cairn_scan_step(scan, &budget)) == CAIRN_MORE) {
        budget.left = CAIRN_UNBOUNDED;
        status = CAIRN_OK;
    }
    if (status != CAIRN_OK)
        return tool_report_scan(side->input.path, side->input.line, status, &fault);
    side->view = cairn_scan_read(scan);
    side->dense = malloc(((size_t)side->view.beam_count + 1) * sizeof *side->dense);
    if (side->dense == NULL)
        return tool_report_scan(side->input.path, side->input.line, CAIRN_NO_MEMORY, NULL);
    side->dense_count = cairn_scan_match_dense(&side->view, side->dense);
    if (!as_written)
        return TOOL_OK;
    side->readings = malloc(((size_t)side->view.beam_count + 1) * sizeof *side->readings);
    if (side->readings == NULL)
        return tool_report_scan(side->input.path, side->input.line, CAIRN_NO_MEMORY, NULL);
    side->view.point_count = cairn_scan_match_readings(&side->view, side->readings);
    side->view.points = side->readings;
    return TOOL_OK;
}

static cairn_scan_match_part part_of(const match_side *side)
{
    cairn_scan_match_part part = cairn_scan_match_part_of(&side->view);

    if (side->readings != NULL) {
        part.beams = NULL;
        part.beam_count = 0;
        return part;
    }
    part.dense = side->dense;
    part.dense_count = side->dense_count;
    return part;
}

static cairn_scan_match_params params_of(const settings *s, const match_record *record)
{
    cairn_scan_match_params params =
        cairn_capacity_scan_match(record->target.view.point_count, record->target.dense_count,
                                  record->query.view.point_count, s->as_written);

    if (s->as_written)
        return params;
    params.mode = is_by_shape(s) ? CAIRN_SCAN_MATCH_SHAPE : CAIRN_SCAN_MATCH_CORRELATIVE;
    params.spacing = (cairn_real)s->spacing;
    return params;
}

static cairn_status match_query(const match_record *record, cairn_scan_match *match,
                                cairn_pose start, const cairn_scan_match_window *window)
{
    cairn_scan_match_part query = part_of(&record->query);
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_status status = cairn_scan_match_begin(match, &query, start, window, NULL);

    while (status == CAIRN_OK && (status = cairn_scan_match_step(match, &budget)) == CAIRN_MORE) {
        budget.left = CAIRN_UNBOUNDED;
        status = CAIRN_OK;
    }
    return status;
}

static cairn_status run_match(const settings *s, match_record *record, cairn_scan_match *match)
{
    cairn_scan_match_part target = part_of(&record->target);
    cairn_scan_match_window window = {(cairn_real)s->window[0],
                                      (cairn_real)(s->window[1] * CAIRN_DEGREE)};
    cairn_status status = cairn_scan_match_add_target(match, &target, cairn_pose_identity(), NULL);

    if (s->as_written && !s->window_given)
        window.angle = CAIRN_SCAN_MATCH_WRITTEN_HEADING;
    if (status == CAIRN_OK)
        status = match_query(record, match, record->start, record->has_start ? &window : NULL);
    record->result = cairn_scan_match_read(match);
    record->measure = cairn_scan_match_measured(match);
    for (int32_t i = 0; i < record->result.count; i++)
        record->hypotheses[i] = record->result.hypotheses[i];
    record->result.hypotheses = record->hypotheses;
    record->match = match;
    return status;
}

/* ---- output ---- */

static cairn_status write_json(const char *path, const char *json, cairn_file_error *error)
{
    cairn_output *output;
    cairn_status status = cairn_output_open(&output, path, error);

    if (status != CAIRN_OK)
        return status;
    cairn_output_bytes(output, json, strlen(json));
    return cairn_output_commit(output, error);
}

static cairn_status write_files(const settings *s, const match_record *record, const char *json,
                                cairn_file_error *error)
{
    static cairn_status (*const draw[FILES])(const match_record *record, const char *path,
                                             cairn_file_error *error) = {NULL,
                                                                         match_draw_overlay,
                                                                         match_draw_tangents,
                                                                         match_draw_histogram,
                                                                         match_draw_pairs,
                                                                         match_draw_filters};
    cairn_output_set *files = NULL;
    cairn_status status =
        cairn_output_set_open(&files, s->folder, file_names, file_count(s), error);

    for (int32_t i = file_count(s); i < FILES && status == CAIRN_OK; i++)
        status = cairn_output_set_remove(files, file_names[i], error);
    if (status == CAIRN_OK)
        status = write_json(cairn_output_set_path(files, JSON), json, error);
    for (int32_t i = OVERLAY; i < file_count(s) && status == CAIRN_OK; i++)
        status = draw[i](record, cairn_output_set_path(files, i), error);
    if (status == CAIRN_OK)
        return cairn_output_set_commit(files, error);
    cairn_output_set_discard(files);
    return status;
}

static int write_output(const settings *s, const match_record *record)
{
    char *words = match_text(record), *json = match_json(record);
    cairn_file_error error;
    int code = TOOL_OK;

    if (words == NULL || json == NULL) {
        (void)options_refuse(PROGRAM, "no memory for the result");
        code = TOOL_FAILED;
    } else if (s->folder != NULL && write_files(s, record, json, &error) != CAIRN_OK) {
        code = tool_report(&error);
    } else if (s->json || !s->quiet) {
        fputs(s->json ? json : words, stdout);
    }
    free(words);
    free(json);
    return code;
}

/* Matches both fitted scans in a pool of its own and writes the output. */
static int match_and_write(const settings *s, match_record *record)
{
    cairn_scan_match_params params = params_of(s, record);
    cairn_scan_match *match;
    cairn_pool pool;
    cairn_status status;
    int code = tool_pool_open(&pool, PROGRAM, s->pool, cairn_scan_match_memory(&params));

    if (code != TOOL_OK)
        return code;
    status = cairn_scan_match_create(&match, &pool, &params);
    if (status == CAIRN_OK)
        status = run_match(s, record, match);
    if (status == CAIRN_OK) {
        code = write_output(s, record);
    } else {
        (void)options_refuse(PROGRAM, "%s and %s: %s", s->word[0], s->word[1],
                             cairn_status_text(status));
        code = tool_exit_code(status);
    }
    tool_pool_close(&pool);
    return code;
}

static int run(const settings *s, match_record *record)
{
    cairn_scan_params params[2] = {cairn_scan_default(), cairn_scan_default()};
    match_side *side[2] = {&record->target, &record->query};
    cairn_scan *scan;
    cairn_pool pool;
    size_t need = 0;
    int code;

    for (int i = 0; i < 2; i++) {
        params[i].max_beams = side[i]->input.scan.count > 0 ? side[i]->input.scan.count : 1;
        params[i].spacing = (cairn_real)s->spacing;
        need += cairn_scan_memory(&params[i]);
    }
    code = tool_pool_open(&pool, PROGRAM, NULL, need);
    if (code != TOOL_OK)
        return code;
    for (int i = 0; i < 2 && code == TOOL_OK; i++) {
        cairn_status status = cairn_scan_create(&scan, &pool, &params[i]);

        code = status == CAIRN_OK
                   ? prepare(side[i], scan, s->as_written)
                   : tool_report_scan(side[i]->input.path, side[i]->input.line, status, NULL);
    }
    if (code == TOOL_OK)
        code = match_and_write(s, record);
    tool_pool_close(&pool);
    return code;
}

int tool_match(int argc, char **argv)
{
    settings s = {.method = "default", .window = {1, 30}, .spacing = 0.1};
    match_record record;
    option_result result = read_settings(&s, argc, argv);
    tool_log_options log_options;
    cairn_file_error error;
    int code;

    if (result != OPTIONS_READ)
        return result;
    if (s.folder != NULL &&
        cairn_output_set_check(s.folder, file_names, file_count(&s), &error) != CAIRN_OK)
        return tool_report(&error);
    memset(&record, 0, sizeof record);
    record.method = s.method;
    record.has_start = s.start_text != NULL;
    record.start.x = (cairn_real)s.start[0];
    record.start.y = (cairn_real)s.start[1];
    record.start.theta =
        (cairn_real)remainder(s.start[2] * CAIRN_DEGREE, 2 * 3.14159265358979323846);
    log_options = (tool_log_options){.range_max = s.range_max,
                                     .scan_topic = s.scan_topic,
                                     .odometry_topic = s.odometry_topic,
                                     .scanner = s.scanner,
                                     .quiet = s.quiet};
    code = match_input_load(&record.target.input, PROGRAM, s.word[0], &log_options);
    if (code == TOOL_OK)
        code = match_input_load(&record.query.input, PROGRAM, s.word[1], &log_options);
    if (code == TOOL_OK)
        code = run(&s, &record);
    match_input_free(&record.target.input);
    match_input_free(&record.query.input);
    free(record.target.dense);
    free(record.query.dense);
    free(record.target.readings);
    free(record.query.readings);
    return code;
}
