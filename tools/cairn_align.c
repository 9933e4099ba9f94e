/* cairn align: global alignment of all scans of a log (batch scan alignment). */
#include "tools/cairn_align.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/lum.h"
#include "cairn/output.h"
#include "cairn/output_set.h"
#include "cairn/virtual_align.h"

/* Default bound of the error of the poses in the log, m and degrees. */
static const double SPREAD_M = 0.6, SPREAD_DEG = 35;

/* Table of methods. Lu and Milios pairs single points of scans: evenly spaced points lock into a
 * false optimum at half their spacing, so the spacing is smaller. */
static const struct align_method {
    const char *name;
    int (*run)(align_job *job);
    double spacing; /* m, of the points */
} methods[] = {{"default", align_by_default, 0.1},
               {"gradient", align_by_field, 0.1},
               {"lum", align_by_lum, 0.03}};

static const struct align_method *method_of(const align_settings *s)
{
    for (size_t k = 0; k < sizeof methods / sizeof *methods; k++)
        if (strcmp(s->method, methods[k].name) == 0)
            return &methods[k];
    return NULL;
}

enum { MAX_OPTIONS = 32 };

/* A rule of incompatible options, with the reason. */
typedef struct align_rule {
    int32_t is_broken; /* 1: the incompatible option is given */
    const char *option, *with, *why;
} align_rule;

/* Returns 1 when an option of the table is given. */
static int32_t is_given(const option *table, size_t count, const char *name)
{
    for (size_t i = 0; i < count; i++)
        if (strcmp(table[i].name, name) == 0)
            return *table[i].given;
    return 0;
}

/* Returns 1 when the settings are compatible, else 0 after a line on standard error. Sets derived
 * values. */
static int check_settings(align_settings *s, const option *table, size_t count)
{
    int32_t is_lum, is_gradient;

    if (s->method == NULL)
        s->method = s->as_written && (!s->no_poses || s->online) ? "gradient" : methods[0].name;
    if (method_of(s) == NULL) {
        (void)options_refuse(ALIGN_PROGRAM,
                             "unknown method '%s', expected default, gradient or lum", s->method);
        return 0;
    }
    is_lum = strcmp(s->method, "lum") == 0;
    is_gradient = strcmp(s->method, "gradient") == 0;
    s->as_written |= s->by_hypotheses && is_gradient;
    s->chain = s->no_poses && s->as_written && is_gradient;
    const align_rule rules[] = {
        {s->no_poses && !s->chain, "--method", "--no-poses",
         "matching whole places is a method of its own (as written, gradient may follow)"},
        {s->no_poses, "--spread", "--no-poses", "there are no initial poses"},
        {s->no_poses, "--virtual", "--no-poses", "hypotheses need initial poses of the scans"},
        {s->no_poses && !s->chain, "--online", "--no-poses",
         "gradient descent needs initial poses of the scans"},
        {s->no_poses && !s->chain, "--steps", "--no-poses", "the method does not iterate"},
        {s->no_poses && !s->chain, "--report", "--no-poses",
         "the method has no iterations to play"},
        {!s->no_poses, "--headings", "the poses of the log",
         "the number of scans of a place is needed only with --no-poses"},
        {s->as_written && !s->no_poses && !is_lum && !is_gradient, "--as-written",
         "--method default", "the thesis has gradient and lum"},
        {s->as_written, "--spread", "--as-written",
         "the thesis's methods have no prior on the pose error"},
        {s->as_written && is_lum, "--spacing", "--as-written",
         "method lum pairs the scans' own points"},
        {s->as_written && s->no_poses && !s->chain, "--spacing", "--as-written",
         "it uses the raw readings as points"},
        {!(s->no_poses && s->as_written), "--pictures", "a map other than --no-poses --as-written",
         "they show the stages of that method"},
        {s->chain, "--pictures", "gradient", "they show places matched by shape alone"},
        {is_lum, "--virtual", "--method lum", "hypotheses go with default or gradient"},
        {!is_gradient, "--online", "a method other than gradient",
         "scan after scan is a mode of gradient"},
        {s->online, "--virtual", "--online", "hypotheses are made of all scans"},
        {s->online, "--report", "--online", "the player needs all scans at the start"},
    };
    for (size_t i = 0; i < sizeof rules / sizeof *rules; i++)
        if (rules[i].is_broken && is_given(table, count, rules[i].option)) {
            (void)options_refuse(ALIGN_PROGRAM, "%s with %s: %s; expected one of the two",
                                 rules[i].option, rules[i].with, rules[i].why);
            return 0;
        }
    if (s->as_written && !is_given(table, count, "--steps"))
        s->steps = is_lum             ? cairn_lum_as_written().max_iterations
                   : s->by_hypotheses ? cairn_virtual_align_as_written().field.max_steps
                                      : s->steps;
    if (isnan(s->spacing))
        s->spacing = method_of(s)->spacing;
    return 1;
}

static option_result read_settings(align_settings *s, int argc, char **argv)
{
    int32_t given[MAX_OPTIONS] = {0};
    option table[] = {
        OPTION_TEXT("-o", &s->folder, "DIR", "folder for poses.csv, map.pgm, map.yaml and map.svg"),
        OPTION_TEXT("--method", &s->method, "NAME",
                    "default (pairwise registration and pose graph), gradient (force field "
                    "simulation as in the thesis) or lum (Lu and Milios)"),
        OPTION_FLAG("--as-written", &s->as_written,
                    "the method as printed in the thesis, with its constants: chapter 7 (gradient, "
                    "then the "
                    "default), 8 (--virtual), 10 "
                    "(lum), 6 (--no-poses: each place with the three before, headings known to 2 "
                    "degrees; with --method "
                    "gradient or "
                    "--online 7 from there)"),
        OPTION_FLAG("--online", &s->online,
                    "scan after scan, each against all before, --steps iterations each (gradient); "
                    "with --no-poses "
                    "place after place, each matched by shape first"),
        OPTION_PAIR("--spread", s->spread, 0.001, 360, "M,DEG",
                    "bound of the error of the poses in the log, m in x and y, degrees (default)"),
        OPTION_FLAG("--virtual", &s->by_hypotheses,
                    "unplaced scans are registered against hypotheses of lines and rectangles in "
                    "the map (default); with gradient: "
                    "algorithm 2 of the thesis"),
        OPTION_FLAG("--no-poses", &s->no_poses,
                    "no initial poses: whole places are matched pairwise, all with all; poses of "
                    "the log only "
                    "group scans into places, unless --headings is given"),
        OPTION_INTEGER(
            "--headings", &s->headings, 1, 64, "N",
            "N scans per place at evenly spaced headings, 1: each scan is a place; no pose "
            "of the log is read (--no-poses)"),
        OPTION_FLAG("--pictures", &s->pictures,
                    "also draws errors.svg and stages.svg: poses and maps after each stage "
                    "(--no-poses --as-written)"),
        OPTION_INTEGER("--steps", &s->steps, 1, 100000, "N",
                       "maximum number of iterations (gradient, lum); as written 100 with "
                       "--virtual, 500 with lum"),
        OPTION_INTEGER("--max-scans", &s->max_scans, 1, 100000, "N", "maximum number of scans"),
        OPTION_NUMBER("--spacing", &s->spacing, 0.01, 1, "M",
                      "distance of the points along walls, m; 0.03 for lum if not given (0.1)"),
        OPTION_NUMBER("--resolution", &s->resolution, 0.001, 10, "M", "cell size of the map, m"),
        OPTION_NUMBER("--range", &s->range, 0.1, 1000, "M",
                      "maximum range of beams entered into the map, m"),
        OPTION_NUMBER(
            "--clear", &s->clear, 0, 1000, "M",
            "beams without return free cells up to the first wall when the scanner sees no "
            "farther, m"),
        OPTION_NUMBER("--range-max", &s->range_max, 0.1, 1000, "M",
                      "ranges from this value on count as no return, m (from the log)"),
        TOOL_LOG_OPTIONS(&s->scan_topic, &s->odometry_topic, &s->scanner),
        OPTION_INTEGER("--seed", &s->seed, 0, 9e15, "N",
                       "seed of random methods; these are deterministic"),
        OPTION_TEXT("--report", &s->report, "FILE", PLAYER_HELP),
        OPTION_TEXT("--pool", &s->pool, "BYTES",
                    "memory of the alignment (exactly the memory needed)"),
        OPTION_JSON(&s->json),
        OPTION_FLAG("--quiet", &s->quiet, "no progress, no warnings, no summary"),
    };
    const option_set set = {
        ALIGN_PROGRAM, "LOG -o DIR [options]",
        "Aligns all scans of a " TOOL_LOG " at once. Their order "
        "does not matter; the "
        "poses in the log are the initial estimates. With --no-poses they only group the scans "
        "into "
        "places and give their relative poses there (with --headings they are not used).",
        table, sizeof table / sizeof *table};
    option_result result;

    _Static_assert(sizeof table / sizeof *table <= MAX_OPTIONS, "more options than MAX_OPTIONS");
    for (size_t i = 0; i < sizeof table / sizeof *table; i++)
        table[i].given = &given[i];
    result = tool_read_options(&set, argc, argv, &s->log, &s->folder);
    if (result != OPTIONS_READ)
        return result;
    return check_settings(s, table, set.count) ? OPTIONS_READ : OPTIONS_BAD;
}

/* ---- Shared by the methods ---- */

int align_refuse(const align_job *job, cairn_status status)
{
    (void)options_refuse(ALIGN_PROGRAM, "%s: %s", job->settings->log, cairn_status_text(status));
    return tool_exit_code(status);
}

/* Extracts the segments and points of one scan (line fitting by EM). */
static cairn_status fit(cairn_scan *scan, const cairn_scan_input *input, cairn_scan_view *view,
                        cairn_fault *fault)
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

int align_add_range(align_job *job, cairn_scan *scan, int32_t first, int32_t end, align_add add,
                    void *aligner)
{
    for (int32_t i = first; i < end; i++) {
        const cairn_carmen_log_record *record = &job->log->record[i];
        cairn_fault fault = {-1, NULL};
        cairn_scan_view view;
        cairn_status status = fit(scan, &record->scan, &view, &fault);

        if (status == CAIRN_OK)
            status = add(aligner, &view, job->scans[i].before, &fault);
        if (status != CAIRN_OK)
            return tool_report_scan(job->settings->log, record->line, status, &fault);
    }
    return TOOL_OK;
}

int align_add_scans(align_job *job, cairn_scan *scan, align_add add, void *aligner)
{
    return align_add_range(job, scan, 0, job->log->count, add, aligner);
}

cairn_status align_open_player(align_job *job, cairn_report_player_params params, const char *how)
{
    char title[256], subtitle[256];
    cairn_status status;

    if (job->settings->report == NULL)
        return CAIRN_OK;
    snprintf(title, sizeof title, "%s, aligned", cairn_output_path_name(job->settings->log));
    snprintf(subtitle, sizeof subtitle, "%" PRId32 " scans, %s", job->log->count, how);
    params.title = title;
    params.subtitle = subtitle;
    status = cairn_report_player_open(&job->player, &params);
    for (int32_t i = 0; i < job->log->count && status == CAIRN_OK; i++)
        status = player_add_scan(job->player, &job->scans[i], i);
    return status;
}

/* ---- the job ---- */

/* First pass over all scans: keeps their segments, points and beams, and counts the capacities. */
static int survey(align_job *job, cairn_scan *scan)
{
    const char *log = job->settings->log;
    tool_progress progress = tool_progress_begin("lines", job->log->count, job->settings->quiet);
    int64_t segments = 0, points = 0;

    for (int32_t i = 0; i < job->log->count; i++) {
        const cairn_carmen_log_record *record = &job->log->record[i];
        map_scan *kept = &job->scans[i];
        cairn_fault fault = {-1, NULL};
        cairn_scan_view view;
        cairn_status status = fit(scan, &record->scan, &view, &fault);

        if (status == CAIRN_OK && !cairn_placed_scan_copy(kept, &view))
            status = CAIRN_NO_MEMORY;
        if (status != CAIRN_OK) {
            tool_progress_end(&progress);
            return tool_report_scan(log, record->line, status, &fault);
        }
        segments += view.segment_count;
        points += view.point_count;
        kept->line = record->line;
        kept->stamp_ns = record->stamp_ns;
        kept->before = record->robot;
        tool_progress_at(&progress, i);
    }
    tool_progress_end(&progress);
    if (points == 0)
        return options_refuse(ALIGN_PROGRAM, "%s: no scan shows a wall, expected at least one",
                              log);
    if (points > CAIRN_CAPACITY_MAX_POINTS || segments > CAIRN_CAPACITY_MAX_POINTS)
        return options_refuse(ALIGN_PROGRAM,
                              "%s: the scans have %" PRId64
                              " points, expected at most %d: widen --spacing",
                              log, points, CAIRN_CAPACITY_MAX_POINTS);
    job->segments = (int32_t)segments;
    job->points = (int32_t)points;
    return TOOL_OK;
}

/* Runs the first pass with a scan object in a pool of its own, to size the aligner. */
static int measure(align_job *job)
{
    cairn_scan *scan = NULL;
    cairn_pool pool;
    cairn_status status;
    int code = tool_pool_open(&pool, ALIGN_PROGRAM, NULL, cairn_scan_memory(&job->scan));

    if (code != TOOL_OK)
        return code;
    status = cairn_scan_create(&scan, &pool, &job->scan);
    code = status == CAIRN_OK ? survey(job, scan) : align_refuse(job, status);
    tool_pool_close(&pool);
    return code;
}

static int write_all(const align_job *job)
{
    const align_settings *s = job->settings;
    cairn_file_error error;
    map_output output;
    char title[256], subtitle[256];

    snprintf(title, sizeof title, "%s, aligned", cairn_output_path_name(s->log));
    snprintf(subtitle, sizeof subtitle, "%" PRId32 " scans, %s", job->log->count, job->subtitle);
    memset(&output, 0, sizeof output);
    output.title = title;
    output.subtitle = subtitle;
    output.scan = job->scans;
    output.count = job->log->count;
    output.resolution = s->resolution;
    output.range = s->range;
    output.clear = s->clear;
    output.player = job->player;
    output.report = s->report;
    output.before = s->chain ? "places matched by shape" : NULL;
    return map_output_write(&output, s->folder, &error) == CAIRN_OK ? TOOL_OK : tool_report(&error);
}

static void write_json(align_job *job, double seconds)
{
    cairn_json_writer *json = &job->json.writer;

    cairn_json_write_integer(json, "scans", job->log->count);
    cairn_json_write_integer(json, "damaged", job->log->info.faults);
    cairn_json_write_number(json, "seconds", seconds);
    cairn_json_write_integer(json, "pool_bytes", (int64_t)job->pool_bytes);
    cairn_json_write_text(json, "folder", job->settings->folder);
    map_write_poses(json, job->scans, job->log->count);
}

static int run(align_job *job)
{
    const align_settings *s = job->settings;
    double start = tool_seconds();
    int code = tool_json_open(&job->json, ALIGN_PROGRAM);

    if (code != TOOL_OK)
        return code;
    cairn_json_write_text(&job->json.writer, "log", s->log);
    cairn_json_write_text(&job->json.writer, "method", s->no_poses ? "places" : s->method);
    cairn_json_write_boolean(&job->json.writer, "as_written", s->as_written);
    job->scan = cairn_scan_default();
    job->scan.max_beams = job->log->info.max_beams;
    job->scan.spacing = (cairn_real)s->spacing;
    code = measure(job);
    if (code == TOOL_OK && s->no_poses)
        code = s->chain ? align_by_chain(job) : align_by_places(job);
    else if (code == TOOL_OK)
        code = s->by_hypotheses ? align_by_hypotheses(job) : method_of(job->settings)->run(job);
    if (code == TOOL_OK)
        code = write_all(job);
    if (code == TOOL_OK && s->pictures)
        code = align_draw_places(job);
    if (code == TOOL_OK && !s->quiet && !s->json)
        printf("scans      %" PRId32 " (%" PRId64 " damaged lines left out)\n"
               "seconds    %.3f\n"
               "pool       %zu bytes at most\n"
               "%s",
               job->log->count, job->log->info.faults, tool_seconds() - start, job->pool_bytes,
               job->summary);
    if (code == TOOL_OK)
        write_json(job, tool_seconds() - start);
    cairn_report_player_free(job->player);
    return tool_json_close(&job->json, ALIGN_PROGRAM, s->json, code);
}

int tool_align(int argc, char **argv)
{
    align_settings s = {.max_scans = 500,
                        .steps = 50,
                        .seed = 1,
                        .resolution = 0.05,
                        .range = 30,
                        .clear = 5,
                        .spacing = (double)NAN,
                        .spread = {SPREAD_M, SPREAD_DEG}};
    cairn_file_error error;
    option_result result;
    tool_log_options log_options;
    cairn_scan_log log;
    align_job job;
    int code;

    result = read_settings(&s, argc, argv);
    if (result != OPTIONS_READ)
        return result;
    if (map_output_check(s.folder, 0, s.report, &error) != CAIRN_OK ||
        (s.pictures &&
         cairn_output_set_check(s.folder, align_picture_names, 2, &error) != CAIRN_OK))
        return tool_report(&error);
    log_options = (tool_log_options){.range_max = s.range_max,
                                     .scan_topic = s.scan_topic,
                                     .odometry_topic = s.odometry_topic,
                                     .scanner = s.scanner,
                                     .quiet = s.quiet};
    code = s.headings > 0 ? tool_load(&log, s.log, &log_options)
                          : tool_load_with_poses(&log, ALIGN_PROGRAM, s.log, &log_options);
    if (code != TOOL_OK)
        return code;
    memset(&job, 0, sizeof job);
    job.settings = &s;
    job.log = &log.scans;
    if (log.scans.count > s.max_scans) {
        code = options_refuse(ALIGN_PROGRAM,
                              "%s holds %" PRId32 " scans, expected at most %" PRId64
                              ": raise --max-scans, or use cairn map, which goes scan by scan",
                              s.log, log.scans.count, s.max_scans);
    } else {
        job.scans = cairn_placed_scans_new(log.scans.count);
        if (job.scans == NULL) {
            (void)options_refuse(ALIGN_PROGRAM, "no memory for %" PRId32 " scans", log.scans.count);
            code = TOOL_FAILED;
        } else {
            code = run(&job);
        }
        cairn_placed_scans_free(job.scans, log.scans.count);
    }
    cairn_scan_log_free(&log);
    return code;
}
