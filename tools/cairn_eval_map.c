/* cairn eval map: entropy and beam likelihood of the occupancy grid of a log at given poses. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "cairn/map_file.h"
#include "cairn/map_quality.h"
#include "tools/cairn_eval.h"
#include "tools/cairn_map_output.h"

#define PROGRAM "cairn eval map"

typedef struct settings {
    const char *log, *poses, *map;
    double resolution, range, range_max, least;
    int32_t json, quiet;
    const char *scan_topic, *odometry_topic;
    tool_scanner scanner;
} settings;

typedef struct figures {
    cairn_map_quality_entropy entropy;
    double likelihood,
        /* log-likelihood, by the quadrant in which a beam ends */
        quadrant[CAIRN_MAP_QUALITY_QUADRANTS];
    int64_t beams, hits;
    cairn_occupancy_grid_params grid;
} figures;

static const char *const quadrant_name[CAIRN_MAP_QUALITY_QUADRANTS] = {"nw", "ne", "se", "sw"};

static option_result read_settings(settings *s, int argc, char **argv)
{
    const option table[] = {
        OPTION_TEXT("--map", &s->map, "FILE.yaml",
                    "a map that gives cell size and extent of the grid (from the beams)"),
        OPTION_NUMBER("--resolution", &s->resolution, 0.001, 10, "M",
                      "cell size, m, without --map"),
        OPTION_NUMBER("--range", &s->range, 0.1, 1000, "M",
                      "maximum range of beams entered into the grid, m"),
        OPTION_NUMBER("--range-max", &s->range_max, 0.1, 1000, "M",
                      "ranges from this value on count as no return, m (from the log)"),
        TOOL_LOG_OPTIONS(&s->scan_topic, &s->odometry_topic, &s->scanner),
        OPTION_NUMBER("--least", &s->least, 1e-9, 0.5, "P", "probability of an outlier beam"),
        OPTION_JSON(&s->json),
        OPTION_FLAG("--quiet", &s->quiet, "no progress, no warnings"),
    };
    const option_set set = {
        PROGRAM, "LOG [POSES.csv] [options]",
        "Enters all beams of a log at the poses of a table, or at those of the log, into "
        "an "
        "occupancy grid with beam penetration. Prints its entropy (lower is better; compare maps "
        "of "
        "one "
        "resolution only) and the log-likelihood of the beams (higher is better), of the whole map "
        "and of "
        "its quadrants; a beam belongs to the quadrant in which it ends.",
        table, sizeof table / sizeof *table};
    const char *arguments[2] = {NULL, NULL};
    size_t count = 2;
    option_result result = options_read(&set, argc, argv, arguments, &count);

    if (result != OPTIONS_READ)
        return result;
    if (count < 1)
        return (option_result)options_refuse(PROGRAM, "no log, expected %s", set.synopsis);
    s->log = arguments[0];
    s->poses = arguments[1];
    return OPTIONS_READ;
}

/* Sets the poses of the scans from the table, or from the log without a table. */
static int set_poses(const settings *s, const cairn_carmen_log_scans *log, map_scan *scan)
{
    cairn_pose_table_row *row;
    int32_t count, k = 0;
    int code;

    for (int32_t i = 0; i < log->count; i++)
        scan[i].after = log->record[i].robot;
    if (s->poses == NULL)
        return TOOL_OK;
    code = eval_read_poses(PROGRAM, s->poses, &row, &count);
    if (code != TOOL_OK)
        return code;
    while (k < count && row[k].index < 0)
        k++;
    for (int32_t i = 0; i < log->count && code == TOOL_OK; i++, k++) {
        if (k == count || row[k].index != i)
            code = options_refuse(PROGRAM,
                                  "%s has no pose of scan %" PRId32 " (%s:%" PRId64
                                  "), expected one of each",
                                  s->poses, i, s->log, log->record[i].line);
        else
            scan[i].after = row[k].pose;
    }
    if (code == TOOL_OK && k < count)
        code = options_refuse(PROGRAM,
                              "%s has a pose of scan %" PRId64 ", but %s holds %" PRId32 " scans",
                              s->poses, row[k].index, s->log, log->count);
    cairn_pose_table_free(row);
    return code;
}

/* Copies the beams of all scans. */
static int keep_beams(const settings *s, const cairn_carmen_log_scans *log, map_scan *kept)
{
    cairn_scan_params params = cairn_scan_default();
    tool_progress progress = tool_progress_begin("scans", log->count, s->quiet);
    cairn_scan *scan = NULL;
    cairn_pool pool;
    cairn_status status;
    int code;

    params.max_beams = log->info.max_beams;
    code = tool_pool_open(&pool, PROGRAM, NULL, cairn_scan_memory(&params));
    if (code != TOOL_OK)
        return code;
    status = cairn_scan_create(&scan, &pool, &params);
    for (int32_t i = 0; i < log->count && status == CAIRN_OK; i++) {
        cairn_budget budget = {CAIRN_UNBOUNDED};
        cairn_fault fault = {-1, NULL};
        cairn_scan_view view;

        status = cairn_scan_begin(scan, &log->record[i].scan, &fault);
        while (status == CAIRN_OK && (status = cairn_scan_step(scan, &budget)) == CAIRN_MORE) {
            budget.left = CAIRN_UNBOUNDED;
            status = CAIRN_OK;
        }
        view = cairn_scan_read(scan);
        if (status == CAIRN_OK && !cairn_placed_scan_copy(&kept[i], &view))
            status = CAIRN_NO_MEMORY;
        if (status != CAIRN_OK)
            code = tool_report_scan(s->log, log->record[i].line, status, &fault);
        tool_progress_at(&progress, i);
    }
    tool_progress_end(&progress);
    tool_pool_close(&pool);
    return code;
}

/* Sets the grid's params from --map, or to the extent of the beams. */
static int set_grid_params(const settings *s, const cairn_placed_scan_map *scans,
                           cairn_occupancy_grid_params *params)
{
    cairn_file_error error;
    cairn_map_file map;

    if (s->map == NULL)
        return cairn_placed_scan_map_layout(scans, params, &error) == CAIRN_OK
                   ? TOOL_OK
                   : tool_report(&error);
    if (cairn_map_file_read(&map, s->map, &error) != CAIRN_OK)
        return tool_report(&error);
    *params = cairn_occupancy_grid_default();
    params->width = map.width;
    params->height = map.height;
    params->resolution = map.resolution;
    params->origin.x = map.origin.x;
    params->origin.y = map.origin.y;
    cairn_map_file_free(&map);
    if (map.origin.theta != 0)
        return options_refuse(
            PROGRAM, "%s: the origin of the map is rotated by %g rad, expected no rotation", s->map,
            (double)map.origin.theta);
    if (cairn_occupancy_grid_memory(params) == 0)
        return options_refuse(PROGRAM,
                              "%s: the map has sides of %" PRId32 " and %" PRId32
                              " cells, expected at most %d",
                              s->map, params->width, params->height, (int)CAIRN_RASTER_MAX_SIDE);
    return TOOL_OK;
}

static int quadrant_of(const cairn_occupancy_grid_params *grid, cairn_vec2 p)
{
    int32_t column = grid->width / 2, row = grid->height / 2;
    int east = p.x >= grid->origin.x + (cairn_real)column * grid->resolution;
    int north = p.y >= grid->origin.y + (cairn_real)row * grid->resolution;

    return north  ? (east ? CAIRN_MAP_QUALITY_QUADRANT_NE : CAIRN_MAP_QUALITY_QUADRANT_NW)
           : east ? CAIRN_MAP_QUALITY_QUADRANT_SE
                  : CAIRN_MAP_QUALITY_QUADRANT_SW;
}

static cairn_status measure(const settings *s, const cairn_placed_scan_map *map,
                            const cairn_occupancy_grid *grid, figures *f)
{
    cairn_status status = cairn_map_quality_entropy_add(grid, 0, f->grid.height, &f->entropy);

    for (int32_t k = 0; k < map->count && status == CAIRN_OK; k++) {
        cairn_scan_map_scan scan = cairn_placed_scan_beams(&map->scan[k]);
        cairn_transform t = cairn_transform_of(scan.map_scan);

        for (int32_t i = 0; i < scan.beam_count && status == CAIRN_OK; i++) {
            cairn_vec2 from, to;
            cairn_real value;
            int32_t hit;

            if (!cairn_scan_map_beam(&map->beams, &scan, i, t, &from, &to, &hit))
                continue;
            status = cairn_map_quality_beam_likelihood(grid, from, to, hit, (cairn_real)s->least,
                                                       &value);
            f->likelihood += (double)value;
            f->quadrant[quadrant_of(&f->grid, to)] += (double)value;
            f->beams++;
            f->hits += hit;
        }
    }
    return status;
}

/* Writes a figure of a quadrant, such as "entropy_nw". */
static void write_quadrant(cairn_json_writer *json, const char *figure, int quadrant, double value)
{
    char name[32];

    (void)snprintf(name, sizeof name, "%s_%s", figure, quadrant_name[quadrant]);
    cairn_json_write_number(json, name, value);
}

static void print_json(const figures *f, int32_t scans)
{
    cairn_json_writer json = cairn_json_write_begin(stdout);

    cairn_json_write_integer(&json, "scans", scans);
    cairn_json_write_integer(&json, "beams", f->beams);
    cairn_json_write_integer(&json, "hits", f->hits);
    cairn_json_write_integer(&json, "cells", f->entropy.cells);
    cairn_json_write_number(&json, "resolution_m", (double)f->grid.resolution);
    cairn_json_write_number(&json, "entropy", (double)f->entropy.total);
    cairn_json_write_number(&json, "log_likelihood", f->likelihood);
    for (int q = 0; q < CAIRN_MAP_QUALITY_QUADRANTS; q++) {
        write_quadrant(&json, "entropy", q, (double)f->entropy.quadrant[q]);
        write_quadrant(&json, "log_likelihood", q, f->quadrant[q]);
    }
    cairn_json_write_end(&json);
}

static void print_text(const figures *f, int32_t scans)
{
    printf("scans      %" PRId32 "\n"
           "beams      %" PRId64 " (%" PRId64 " hits)\n"
           "cells      %" PRId64 " observed, of %.3g m\n"
           "entropy    %.2f nat (%.5f a cell)\n"
           "likelihood %.1f (%.5f a beam; logarithm)\n",
           scans, f->beams, f->hits, f->entropy.cells, (double)f->grid.resolution,
           (double)f->entropy.total, (double)f->entropy.total / (double)f->entropy.cells,
           f->likelihood, f->likelihood / (double)f->beams);
    for (int q = 0; q < CAIRN_MAP_QUALITY_QUADRANTS; q++)
        printf("%s         entropy %.2f nat, likelihood %.1f\n", quadrant_name[q],
               (double)f->entropy.quadrant[q], f->quadrant[q]);
}

static int evaluate(const settings *s, const cairn_placed_scan_map *map)
{
    cairn_file_error error;
    figures f = {0};
    cairn_heap_grid made;
    int code = set_grid_params(s, map, &f.grid);

    if (code != TOOL_OK)
        return code;
    if (cairn_placed_scan_map_grid(map, &f.grid, &made, &error) != CAIRN_OK)
        return tool_report(&error);
    if (measure(s, map, made.grid, &f) != CAIRN_OK)
        code = options_refuse(PROGRAM, "%s: the beams cannot be traced", s->log);
    else if (f.beams == 0 || f.entropy.cells == 0)
        code =
            options_refuse(PROGRAM, "%s: no beam lies in the map, expected at least one", s->log);
    else if (s->json)
        print_json(&f, map->count);
    else
        print_text(&f, map->count);
    free(made.memory);
    return code;
}

int eval_map(int argc, char **argv)
{
    settings s = {.resolution = 0.05, .range = 30, .least = 1e-3};
    option_result result = read_settings(&s, argc, argv);
    tool_log_options log_options;
    cairn_scan_log log;
    cairn_placed_scan_map map = {0};
    map_scan *scans;
    int code;

    if (result != OPTIONS_READ)
        return (int)result;
    log_options = (tool_log_options){.range_max = s.range_max,
                                     .scan_topic = s.scan_topic,
                                     .odometry_topic = s.odometry_topic,
                                     .scanner = s.scanner,
                                     .quiet = s.quiet};
    code = s.poses != NULL ? tool_load(&log, s.log, &log_options)
                           : tool_load_with_poses(&log, PROGRAM, s.log, &log_options);
    if (code != TOOL_OK)
        return code;
    scans = cairn_placed_scans_new(log.scans.count);
    map.scan = scans;
    map.count = log.scans.count;
    map.resolution = s.resolution;
    map.beams.max_range = (cairn_real)s.range;
    map.beams.max_free_range = CAIRN_REAL_MAX;
    if (scans == NULL) {
        (void)options_refuse(PROGRAM, "no memory for %" PRId32 " scans", log.scans.count);
        code = TOOL_FAILED;
    }
    if (code == TOOL_OK)
        code = set_poses(&s, &log.scans, scans);
    if (code == TOOL_OK)
        code = keep_beams(&s, &log.scans, scans);
    if (code == TOOL_OK)
        code = evaluate(&s, &map);
    cairn_placed_scans_free(scans, map.count);
    cairn_scan_log_free(&log);
    return code;
}
