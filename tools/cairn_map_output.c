/* Writes maps and poses to files. */
#include "tools/cairn_map_output.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/map_file.h"
#include "cairn/number_text.h"
#include "cairn/output.h"
#include "cairn/output_set.h"
#include "cairn/pose_table.h"
#include "tools/cairn_player.h"
#include "tools/cairn_tool.h"

/* Kinds of beams; a mask. */
enum { RETURNED = 1, NO_RETURN = 2 };
/* Points of a beam at which it is looked whether a wall is there. */
#define STEPS_PER_CELL 4
/* Maximum number of cells of a map: 512 MB of grid. */
#define MAX_CELLS (1 << 26)
/* m: the ends of beams are corrected for the motion during the scan, their common start is not. */
#define CLEAR_TOLERANCE_M CAIRN_REAL(0.1)

map_scan *map_scans_new(int32_t count)
{
    map_scan *scan = calloc((size_t)count, sizeof *scan);

    for (int32_t i = 0; i < count && scan != NULL; i++) {
        for (int k = 0; k < 9; k++)
            scan[i].covariance[k] = (cairn_real)NAN;
        scan[i].support = (cairn_real)NAN;
        scan[i].verdict = "";
    }
    return scan;
}

static void free_scan_data(map_scan *scan)
{
    free(scan->beam);
    free(scan->hit);
    free(scan->point);
    free(scan->segment);
    scan->beam_count = 0;
}

void map_scans_free(map_scan *scan, int32_t count)
{
    for (int32_t i = 0; i < count && scan != NULL; i++)
        free_scan_data(&scan[i]);
    free(scan);
}

int32_t map_scan_copy(map_scan *scan, const cairn_scan_view *view)
{
    free_scan_data(scan);
    /* One element more than needed, as malloc(0) may return NULL. */
    scan->beam = malloc((2 * (size_t)view->beam_count + 1) * sizeof *scan->beam);
    scan->hit = malloc((size_t)view->beam_count + 1);
    scan->point = malloc(((size_t)view->point_count + 1) * sizeof *scan->point);
    scan->segment = malloc(((size_t)view->segment_count + 1) * sizeof *scan->segment);
    if (scan->beam == NULL || scan->hit == NULL || scan->point == NULL || scan->segment == NULL)
        return 0;
    scan->sensor = view->sensor;
    for (int32_t i = 0; i < view->beam_count; i++) {
        const cairn_scan_beam *beam = &view->beams[i];

        if (beam->kind == CAIRN_SCAN_BEAM_UNKNOWN)
            continue;
        scan->beam[2 * scan->beam_count] = (float)beam->to.x;
        scan->beam[2 * scan->beam_count + 1] = (float)beam->to.y;
        scan->hit[scan->beam_count++] = beam->kind == CAIRN_SCAN_BEAM_HIT;
    }
    for (int32_t i = 0; i < view->point_count; i++)
        scan->point[i] = view->points[i].position;
    scan->point_count = view->point_count;
    if (view->segment_count > 0)
        memcpy(scan->segment, view->segments, (size_t)view->segment_count * sizeof *scan->segment);
    scan->segment_count = view->segment_count;
    return 1;
}

/* ---- The grid ---- */

int32_t map_beam(const map_output *output, const map_scan *scan, int32_t i, cairn_transform map_s,
                 cairn_vec2 *from, cairn_vec2 *to, int32_t *hit)
{
    cairn_vec2 end = {(cairn_real)scan->beam[2 * i], (cairn_real)scan->beam[2 * i + 1]};
    cairn_vec2 along = cairn_vec2_sub(end, scan->sensor);
    cairn_real length = cairn_vec2_norm(along), limit = (cairn_real)output->range;

    *hit = scan->hit[i];
    if (!*hit && length > (cairn_real)output->clear + CLEAR_TOLERANCE_M)
        return 0;
    if (length > limit) {
        end = cairn_vec2_add(scan->sensor, cairn_vec2_scale(along, limit / length));
        *hit = 0;
    }
    *from = cairn_transform_point(map_s, scan->sensor);
    *to = cairn_transform_point(map_s, end);
    return length > 0;
}

/* Computes the bounding box of all that was seen: poses and beams as they enter the grid. */
static cairn_box map_box(const map_output *output)
{
    cairn_box box = cairn_box_empty();

    for (int32_t s = 0; s < output->count; s++) {
        const map_scan *scan = &output->scan[s];
        cairn_transform t = cairn_transform_of(scan->after);
        cairn_vec2 from, to;
        int32_t hit;

        box = cairn_box_extend(box, cairn_transform_point(t, scan->sensor));
        for (int32_t i = 0; i < scan->beam_count; i++)
            if (map_beam(output, scan, i, t, &from, &to, &hit))
                box = cairn_box_extend(box, to);
    }
    return cairn_box_grow(box, 1);
}

/* Returns the end of a beam before the first occupied cell on it. */
static cairn_vec2 stop_at_wall(const cairn_occupancy_grid *grid, cairn_vec2 from, cairn_vec2 to)
{
    cairn_occupancy_grid_params params = cairn_occupancy_grid_read(grid);
    cairn_real occupied = cairn_occupancy_grid_thresholds_default().occupied;
    cairn_vec2 end = from;
    int32_t steps =
        (int32_t)(cairn_vec2_norm(cairn_vec2_sub(to, from)) / params.resolution * STEPS_PER_CELL) +
        1;

    for (int32_t k = 1; k <= steps; k++) {
        cairn_vec2 p = cairn_vec2_interpolate(from, to, (cairn_real)k / (cairn_real)steps);
        int32_t x, y;

        if (cairn_occupancy_grid_locate(grid, p, &x, &y) &&
            cairn_occupancy_grid_probability(grid, x, y) >= occupied)
            return end;
        end = p;
    }
    return to;
}

/* Adds the beams of all scans that returned, did not, or both. */
static cairn_status add_beams(const map_output *output, int32_t kinds, cairn_occupancy_grid *grid)
{
    for (int32_t s = 0; s < output->count; s++) {
        const map_scan *scan = &output->scan[s];
        cairn_transform t = cairn_transform_of(scan->after);

        for (int32_t i = 0; i < scan->beam_count; i++) {
            cairn_vec2 from, to;
            int32_t hit;
            cairn_status status;

            if (!(kinds & (scan->hit[i] ? RETURNED : NO_RETURN)) ||
                !map_beam(output, scan, i, t, &from, &to, &hit))
                continue;
            if (kinds == NO_RETURN)
                to = stop_at_wall(grid, from, to);
            status = cairn_occupancy_grid_add_beam(grid, from, to, hit);
            if (status != CAIRN_OK)
                return status;
        }
    }
    return CAIRN_OK;
}

static cairn_status fill_grid(const map_output *output, cairn_occupancy_grid *grid)
{
    cairn_status status;

    if (output->through_walls)
        return add_beams(output, RETURNED | NO_RETURN, grid);
    status = add_beams(output, RETURNED, grid);
    return status == CAIRN_OK ? add_beams(output, NO_RETURN, grid) : status;
}

/* Fills the occupancy and pixels of the map file from the grid. */
static cairn_status read_grid(const cairn_occupancy_grid *grid, cairn_map_file *map)
{
    cairn_raster_u8 view;
    cairn_status status;

    view.data = map->pixel;
    view.width = map->width;
    view.height = map->height;
    view.stride = map->width;
    status =
        cairn_occupancy_grid_classify(grid, cairn_occupancy_grid_thresholds_default(), 0, view);
    for (size_t i = 0; i < (size_t)map->width * (size_t)map->height && status == CAIRN_OK; i++)
        map->occupancy[i] = (int8_t)(map->pixel[i] == CAIRN_OCCUPANCY_GRID_OCCUPIED ? 100
                                     : map->pixel[i] == CAIRN_OCCUPANCY_GRID_FREE   ? 0
                                                                                    : -1);
    return status;
}

cairn_status map_grid_layout(const map_output *output, cairn_occupancy_grid_params *params,
                             cairn_file_error *error)
{
    cairn_box box = map_box(output);
    double width = ceil((double)(box.max.x - box.min.x) / output->resolution),
           height = ceil((double)(box.max.y - box.min.y) / output->resolution);

    if (!(width * height <= MAX_CELLS) || width > CAIRN_RASTER_MAX_SIDE ||
        height > CAIRN_RASTER_MAX_SIDE)
        return cairn_file_error_set(
            error, CAIRN_FULL, "map", 0,
            "%.0f x %.0f cells are too many, expected up to %d: choose a coarser --resolution or a "
            "shorter --range",
            width, height, MAX_CELLS);
    *params = cairn_occupancy_grid_default();
    params->resolution = (cairn_real)output->resolution;
    params->origin = box.min;
    params->width = (int32_t)width;
    params->height = (int32_t)height;
    return CAIRN_OK;
}

cairn_status map_grid_make(const map_output *output, const cairn_occupancy_grid_params *params,
                           map_grid *made, cairn_file_error *error)
{
    size_t bytes = cairn_occupancy_grid_memory(params) + CAIRN_ALIGN;
    cairn_pool pool;
    cairn_status status;

    made->memory = malloc(bytes);
    status = made->memory != NULL ? cairn_pool_init(&pool, made->memory, bytes) : CAIRN_NO_MEMORY;
    if (status == CAIRN_OK)
        status = cairn_occupancy_grid_create(&made->grid, &pool, params);
    if (status == CAIRN_OK)
        status = fill_grid(output, made->grid);
    if (status == CAIRN_OK)
        return status;
    free(made->memory);
    made->memory = NULL;
    return status == CAIRN_NO_MEMORY
               ? cairn_file_error_set(error, status, "map", 0, "no memory for the map")
               : cairn_file_error_set(error, status, "map", 0, "%s", cairn_status_text(status));
}

static cairn_status make_map(const map_output *output, cairn_map_file *map, cairn_file_error *error)
{
    cairn_occupancy_grid_params params = cairn_occupancy_grid_default();
    map_grid made = {0};
    cairn_status status;

    *map = cairn_map_file_default();
    status = map_grid_layout(output, &params, error);
    if (status == CAIRN_OK)
        status = map_grid_make(output, &params, &made, error);
    if (status != CAIRN_OK)
        return status;
    map->resolution = params.resolution;
    map->origin.x = params.origin.x;
    map->origin.y = params.origin.y;
    status = cairn_map_file_allocate(map, params.width, params.height);
    if (status == CAIRN_OK)
        status = read_grid(made.grid, map);
    free(made.memory);
    if (status != CAIRN_OK) {
        cairn_map_file_free(map);
        return cairn_file_error_set(error, status, "map", 0, "%s", cairn_status_text(status));
    }
    return CAIRN_OK;
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
    cairn_status status = make_map(output, &map, error);

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
