/* Writes maps and poses to files. */
#include "tools/cairn_map_output.h"

#include <stdlib.h>
#include <string.h>

#include "cairn/map_file.h"
#include "cairn/number_text.h"
#include "cairn/output.h"
#include "cairn/output_set.h"
#include "cairn/pose_table.h"
#include "tools/cairn_player.h"
#include "tools/cairn_tool.h"

cairn_placed_scan_map map_of_output(const map_output *output)
{
    cairn_placed_scan_map map = {.scan = output->scan,
                                 .count = output->count,
                                 .resolution = output->resolution,
                                 .beams = cairn_scan_map_default()};

    map.beams.max_range = (cairn_real)output->range;
    map.beams.max_free_range = (cairn_real)output->clear;
    return map;
}

/* ---- Files ---- */

static cairn_status write_poses(const map_output *output, const char *path, cairn_file_error *error)
{
    cairn_pose_table_row *row = malloc((size_t)output->count * sizeof *row);
    cairn_status status;

    if (row == NULL)
        return cairn_file_error_set(error, CAIRN_NO_MEMORY, path, 0, "no memory for %d poses",
                                    output->count);
    for (int32_t i = 0; i < output->count; i++) {
        const map_scan *scan = &output->scan[i];

        row[i] = cairn_pose_table_row_of(i, scan->after);
        row[i].line = scan->line;
        row[i].stamp_ns = scan->stamp_ns;
        memcpy(row[i].covariance, scan->covariance, sizeof row[i].covariance);
        row[i].support = scan->support;
        row[i].map_sigma = scan->map_sigma;
        strncpy(row[i].verdict, scan->verdict, sizeof row[i].verdict - 1);
    }
    status = cairn_pose_table_write(path, row, output->count, error);
    free(row);
    return status;
}

/* Writes one pose per line: time, position and quaternion, in the TUM trajectory format. */
static cairn_status write_tum(const map_output *output, const char *path, cairn_file_error *error)
{
    cairn_output *file;
    cairn_status status = cairn_output_open(&file, path, error);

    if (status != CAIRN_OK)
        return status;
    for (int32_t i = 0; i < output->count; i++) {
        const map_scan *scan = &output->scan[i];
        char time[CAIRN_NUMBER_TEXT_BYTES], x[CAIRN_NUMBER_TEXT_BYTES], y[CAIRN_NUMBER_TEXT_BYTES];
        char z[CAIRN_NUMBER_TEXT_BYTES], w[CAIRN_NUMBER_TEXT_BYTES];
        cairn_real s, c;

        cairn_sincos(scan->after.theta / 2, &s, &c);
        cairn_output_print(
            file, "%s %s %s 0 0 0 %s %s\n", cairn_number_write_stamp(time, scan->stamp_ns),
            cairn_number_write(x, scan->after.x), cairn_number_write(y, scan->after.y),
            cairn_number_write(z, s), cairn_number_write(w, c));
    }
    return cairn_output_commit(file, error);
}

static cairn_report_grid grid_of(const cairn_map_file *map)
{
    cairn_report_grid grid;

    grid.pixel = map->pixel;
    grid.width = map->width;
    grid.height = map->height;
    grid.resolution = map->resolution;
    grid.origin = map->origin;
    return grid;
}

static cairn_status write_picture(const map_output *output, const cairn_map_file *map,
                                  const char *path, cairn_file_error *error)
{
    cairn_report_map picture = cairn_report_map_default();
    cairn_report_panel panel[2];
    cairn_report_grid grid = grid_of(map);
    size_t n = (size_t)output->count;
    cairn_report_scan *scan = calloc(n, sizeof *scan);
    cairn_pose *before = malloc(n * sizeof *before), *after = malloc(n * sizeof *after);
    uint8_t *low_confidence = malloc(n);
    cairn_status status = CAIRN_NO_MEMORY;

    memset(panel, 0, sizeof panel);
    if (scan != NULL && before != NULL && after != NULL && low_confidence != NULL) {
        for (size_t i = 0; i < n; i++) {
            const map_scan *s = &output->scan[i];

            scan[i].point = s->point;
            scan[i].point_count = s->point_count;
            scan[i].segment = s->segment;
            scan[i].segment_count = s->segment_count;
            before[i] = s->before;
            after[i] = s->after;
            low_confidence[i] = s->low_confidence;
        }
        panel[0].title = "before";
        panel[0].note = output->before != NULL ? output->before : "poses of the log";
        panel[0].pose = before;
        panel[1].title = "after";
        panel[1].note = output->grid_panel ? "occupancy grid and path" : "aligned";
        panel[1].pose = after;
        panel[1].low_confidence = low_confidence;
        panel[1].grid = output->grid_panel ? &grid : NULL;
        picture.title = output->title;
        picture.subtitle = output->subtitle;
        picture.panel = panel;
        picture.panel_count = 2;
        picture.scan = scan;
        picture.scan_count = output->count;
        picture.connect = output->in_order;
        picture.colour_scans = !output->grid_panel;
        status = cairn_report_map_write(path, &picture, error);
    } else {
        (void)cairn_file_error_set(error, status, path, 0, "no memory for the picture");
    }
    free(scan);
    free(before);
    free(after);
    free(low_confidence);
    return status;
}

void map_write_pose(cairn_json_writer *json, int32_t scan, int64_t stamp_ns, cairn_pose pose,
                    const cairn_real *covariance, const char *verdict)
{
    static const int entry[6] = {0, 1, 2, 4, 5, 8};

    cairn_json_write_integer(json, "scan", scan);
    cairn_json_write_integer(json, "stamp_ns", stamp_ns);
    cairn_json_write_exact(json, "x", pose.x);
    cairn_json_write_exact(json, "y", pose.y);
    cairn_json_write_exact(json, "theta", pose.theta);
    cairn_json_write_array(json, "covariance");
    for (int i = 0; i < 6; i++)
        cairn_json_write_exact(json, NULL,
                               covariance != NULL ? covariance[entry[i]] : (cairn_real)NAN);
    cairn_json_write_array_end(json);
    cairn_json_write_text(json, "verdict", verdict);
}

void map_write_poses(cairn_json_writer *json, const map_scan *scan, int32_t count)
{
    cairn_json_write_array(json, "poses");
    for (int32_t i = 0; i < count; i++) {
        cairn_json_write_object(json, NULL);
        map_write_pose(json, i, scan[i].stamp_ns, scan[i].after, scan[i].covariance,
                       scan[i].verdict);
        cairn_json_write_object_end(json);
    }
    cairn_json_write_array_end(json);
}

enum { POSES, IMAGE, YAML, PICTURE, FILES, TUM = FILES, GRAPH, FILES_WITH_GRAPH };
static const char *const file_names[FILES_WITH_GRAPH] = {"poses.csv", "map.pgm",   "map.yaml",
                                                         "map.svg",   "poses.tum", "graph.g2o"};

cairn_status map_output_check(const char *folder, int32_t with_graph, const char *report,
                              cairn_file_error *error)
{
    cairn_status status =
        cairn_output_set_check(folder, file_names, with_graph ? FILES_WITH_GRAPH : FILES, error);

    return status == CAIRN_OK && report != NULL ? player_check(report, error) : status;
}

static cairn_status write_page(const map_output *output, const cairn_map_file *map,
                               cairn_file_error *error)
{
    cairn_report_grid grid = grid_of(map);
    cairn_status status = cairn_report_player_set_grid(output->player, &grid);

    if (status != CAIRN_OK)
        return cairn_file_error_set(error, status, output->report, 0, "no memory for the page");
    return player_write(output->player, output->report, error);
}

cairn_status map_output_write(const map_output *output, const char *folder, cairn_file_error *error)
{
    cairn_output_set *files = NULL;
    cairn_map_file map;
    int32_t count = output->graph != NULL ? FILES_WITH_GRAPH : FILES;
    cairn_placed_scan_map scans = map_of_output(output);
    cairn_status status = cairn_placed_scan_map_make(&scans, &map, error);

    if (status != CAIRN_OK)
        return status;
    status = cairn_output_set_open(&files, folder, file_names, count, error);
    if (status == CAIRN_OK)
        status = tool_remove_other_maps(files, file_names, count, error);
    if (status == CAIRN_OK)
        status = write_poses(output, cairn_output_set_path(files, POSES), error);
    if (status == CAIRN_OK)
        status = cairn_map_file_write(&map, cairn_output_set_path(files, YAML), CAIRN_MAP_FILE_PGM,
                                      error);
    if (status == CAIRN_OK)
        status = write_picture(output, &map, cairn_output_set_path(files, PICTURE), error);
    if (status == CAIRN_OK && output->graph != NULL)
        status = write_tum(output, cairn_output_set_path(files, TUM), error);
    if (status == CAIRN_OK && output->graph != NULL)
        status =
            cairn_pose_graph_file_write(cairn_output_set_path(files, GRAPH), output->graph, error);
    if (status == CAIRN_OK)
        status = cairn_output_set_commit(files, error);
    else
        cairn_output_set_discard(files);
    if (status == CAIRN_OK && output->player != NULL)
        status = write_page(output, &map, error);
    cairn_map_file_free(&map);
    return status;
}
