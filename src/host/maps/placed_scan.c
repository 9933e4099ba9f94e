/* placed_scan: scans at their poses, and the map file that their beams make. */
#include "src/host/maps/placed_scan.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/base/interruption.h"

/* Points of a beam at which it is looked whether a wall is there. */
#define STEPS_PER_CELL 4
/* Maximum number of cells of a map: 512 MB of grid. */
#define MAX_CELLS (1 << 26)
/* m: the ends of beams are corrected for the motion during the scan, their common start is not. */
#define CLEAR_TOLERANCE_M CAIRN_REAL(0.1)

cairn_placed_scan *cairn_placed_scans_new(int32_t count)
{
    cairn_placed_scan *scan = calloc((size_t)count, sizeof *scan);

    for (int32_t i = 0; i < count && scan != NULL; i++) {
        for (int k = 0; k < 9; k++)
            scan[i].covariance[k] = (cairn_real)NAN;
        scan[i].support = (cairn_real)NAN;
        scan[i].verdict = "";
    }
    return scan;
}

static void free_scan_data(cairn_placed_scan *scan)
{
    free(scan->beam);
    free(scan->hit);
    free(scan->point);
    free(scan->segment);
    scan->beam_count = 0;
}

void cairn_placed_scans_free(cairn_placed_scan *scan, int32_t count)
{
    for (int32_t i = 0; i < count && scan != NULL; i++)
        free_scan_data(&scan[i]);
    free(scan);
}

int32_t cairn_placed_scan_copy(cairn_placed_scan *scan, const cairn_scan_view *view)
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

/* ---- The mapper's scans ---- */

const char *cairn_placed_scan_verdict(cairn_mapper_verdict verdict)
{
    static const char *const texts[] = {"first", "matched", "predicted", "blind"};

    return texts[verdict];
}

int32_t cairn_placed_scan_take(cairn_placed_scan *scan, cairn_scan_place *place,
                               const cairn_mapper *mapper)
{
    cairn_mapper_result result = cairn_mapper_read(mapper);
    cairn_scan_view view = cairn_mapper_view(mapper);

    if (!cairn_placed_scan_copy(scan, &view))
        return 0;
    place->keyframe = result.keyframe;
    place->keyframe_scan = result.keyframe_scan;
    scan->support = result.overlap;
    if (result.verdict == CAIRN_MAPPER_MATCHED)
        memcpy(scan->covariance, result.covariance, sizeof scan->covariance);
    scan->verdict = cairn_placed_scan_verdict(result.verdict);
    scan->low_confidence = result.verdict == CAIRN_MAPPER_PREDICTED;
    return 1;
}

void cairn_scan_places_reattach(cairn_scan_place *places, int32_t count,
                                cairn_mapper_culling culling)
{
    for (int32_t i = 0; i < count; i++)
        cairn_mapper_reattach(culling, &places[i].keyframe, &places[i].keyframe_scan);
}

cairn_pose cairn_scan_place_pose(const cairn_mapper *mapper, const cairn_scan_place *place)
{
    return cairn_pose_compose(cairn_mapper_keyframe_pose(mapper, place->keyframe),
                              place->keyframe_scan);
}

/* ---- The map ---- */

int32_t cairn_scan_map_beam(const cairn_scan_map *map, const cairn_placed_scan *scan, int32_t i,
                            cairn_transform map_s, cairn_vec2 *from, cairn_vec2 *to, int32_t *hit)
{
    cairn_vec2 end = {(cairn_real)scan->beam[2 * i], (cairn_real)scan->beam[2 * i + 1]};
    cairn_vec2 along = cairn_vec2_sub(end, scan->sensor);
    cairn_real length = cairn_vec2_norm(along), limit = (cairn_real)map->range;

    *hit = scan->hit[i];
    if (!*hit && length > (cairn_real)map->clear + CLEAR_TOLERANCE_M)
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
static cairn_box map_box(const cairn_scan_map *map)
{
    cairn_box box = cairn_box_empty();

    for (int32_t s = 0; s < map->count; s++) {
        const cairn_placed_scan *scan = &map->scan[s];
        cairn_transform t = cairn_transform_of(scan->after);
        cairn_vec2 from, to;
        int32_t hit;

        box = cairn_box_extend(box, cairn_transform_point(t, scan->sensor));
        for (int32_t i = 0; i < scan->beam_count; i++)
            if (cairn_scan_map_beam(map, scan, i, t, &from, &to, &hit))
                box = cairn_box_extend(box, to);
    }
    return cairn_box_grow(box, 1);
}

/* Cells beside a wall count as wall: the beams that hit it are spread, and leave gaps. */
enum { WALL_MARGIN_CELLS = 1 };

/* Cells of a grid: 1 where a wall is. */
typedef struct wall_mask {
    uint8_t *cell;
    int32_t width, height;
} wall_mask;

/* Marks the cells beside an occupied one. */
static void mark_wall(wall_mask *walls, int32_t x, int32_t y)
{
    for (int32_t v = y - WALL_MARGIN_CELLS; v <= y + WALL_MARGIN_CELLS; v++)
        for (int32_t u = x - WALL_MARGIN_CELLS; u <= x + WALL_MARGIN_CELLS; u++)
            if (u >= 0 && u < walls->width && v >= 0 && v < walls->height)
                walls->cell[(size_t)v * (size_t)walls->width + (size_t)u] = 1;
}

/* The walls of a grid, on the heap. 0: no memory. */
static int find_walls(const cairn_occupancy_grid *grid, wall_mask *walls)
{
    cairn_occupancy_grid_params params = cairn_occupancy_grid_read(grid);
    cairn_real occupied = cairn_occupancy_grid_thresholds_default().occupied;

    walls->width = params.width;
    walls->height = params.height;
    walls->cell = calloc((size_t)params.width * (size_t)params.height, 1);
    for (int32_t y = 0; y < params.height && walls->cell != NULL; y++)
        for (int32_t x = 0; x < params.width; x++)
            if (cairn_occupancy_grid_probability(grid, x, y) >= occupied)
                mark_wall(walls, x, y);
    return walls->cell != NULL;
}

/* Returns the end of a beam before the first wall on it. A scanner that stands beside a wall looks
 * away from it: walls count from the first cell that is none. */
static cairn_vec2 stop_at_wall(const cairn_occupancy_grid *grid, const wall_mask *walls,
                               cairn_vec2 from, cairn_vec2 to)
{
    cairn_real resolution = cairn_occupancy_grid_read(grid).resolution;
    cairn_vec2 end = from;
    int32_t steps =
        (int32_t)(cairn_vec2_norm(cairn_vec2_sub(to, from)) / resolution * STEPS_PER_CELL) + 1;
    int32_t has_left = 0;

    for (int32_t k = 1; k <= steps; k++) {
        cairn_vec2 p = cairn_vec2_interpolate(from, to, (cairn_real)k / (cairn_real)steps);
        int32_t x, y;

        if (cairn_occupancy_grid_locate(grid, p, &x, &y)) {
            int32_t is_wall = walls->cell[(size_t)y * (size_t)walls->width + (size_t)x];

            if (is_wall && has_left)
                return end;
            has_left = has_left || !is_wall;
        }
        end = p;
    }
    return to;
}

/* Adds the beams of all scans. walls: where beams without return end; NULL: nowhere. */
static cairn_status add_beams(const cairn_scan_map *map, const wall_mask *walls,
                              cairn_occupancy_grid *grid)
{
    for (int32_t s = 0; s < map->count; s++) {
        const cairn_placed_scan *scan = &map->scan[s];
        cairn_transform t = cairn_transform_of(scan->after);

        if (cairn_interruption_is_requested())
            return CAIRN_MORE;
        for (int32_t i = 0; i < scan->beam_count; i++) {
            cairn_vec2 from, to;
            int32_t hit;
            cairn_status status;

            if (!cairn_scan_map_beam(map, scan, i, t, &from, &to, &hit))
                continue;
            if (walls != NULL && !scan->hit[i])
                to = stop_at_wall(grid, walls, from, to);
            status = cairn_occupancy_grid_add_beam(grid, from, to, hit);
            if (status != CAIRN_OK)
                return status;
        }
    }
    return CAIRN_OK;
}

/* Fills the grid. Walls are the cells that stay occupied when all beams pass everything: what was
 * hit more often than passed. Then the beams are added again, and end there. */
static cairn_status fill_grid(const cairn_scan_map *map, cairn_occupancy_grid *grid)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_status status = add_beams(map, NULL, grid);
    wall_mask walls;

    if (status != CAIRN_OK || map->through_walls)
        return status;
    if (!find_walls(grid, &walls))
        return CAIRN_NO_MEMORY;
    cairn_occupancy_grid_clear(grid);
    status = cairn_occupancy_grid_step(grid, &budget);
    if (status == CAIRN_OK)
        status = add_beams(map, &walls, grid);
    free(walls.cell);
    return status;
}

/* Fills the occupancy and pixels of the map file from the grid. */
static cairn_status read_grid(const cairn_occupancy_grid *grid, cairn_map_file *file)
{
    cairn_raster_u8 view;
    cairn_status status;

    view.data = file->pixel;
    view.width = file->width;
    view.height = file->height;
    view.stride = file->width;
    status =
        cairn_occupancy_grid_classify(grid, cairn_occupancy_grid_thresholds_default(), 0, view);
    for (size_t i = 0; i < (size_t)file->width * (size_t)file->height && status == CAIRN_OK; i++)
        file->occupancy[i] = (int8_t)(file->pixel[i] == CAIRN_OCCUPANCY_GRID_OCCUPIED ? 100
                                      : file->pixel[i] == CAIRN_OCCUPANCY_GRID_FREE   ? 0
                                                                                      : -1);
    return status;
}

cairn_status cairn_scan_map_layout(const cairn_scan_map *map, cairn_occupancy_grid_params *params,
                                   cairn_file_error *error)
{
    cairn_box box = map_box(map);
    double width = ceil((double)(box.max.x - box.min.x) / map->resolution),
           height = ceil((double)(box.max.y - box.min.y) / map->resolution);

    if (!(width * height <= MAX_CELLS) || width > CAIRN_RASTER_MAX_SIDE ||
        height > CAIRN_RASTER_MAX_SIDE)
        return cairn_file_error_set(
            error, CAIRN_FULL, "map", 0,
            "%.0f x %.0f cells are too many, expected up to %d: choose a coarser resolution or a "
            "shorter range",
            width, height, MAX_CELLS);
    *params = cairn_occupancy_grid_default();
    params->resolution = (cairn_real)map->resolution;
    params->origin = box.min;
    params->width = (int32_t)width;
    params->height = (int32_t)height;
    return CAIRN_OK;
}

cairn_status cairn_scan_map_grid(const cairn_scan_map *map,
                                 const cairn_occupancy_grid_params *params, cairn_heap_grid *made,
                                 cairn_file_error *error)
{
    size_t bytes = cairn_occupancy_grid_memory(params) + CAIRN_ALIGN;
    cairn_pool pool;
    cairn_status status;

    made->memory = malloc(bytes);
    status = made->memory != NULL ? cairn_pool_init(&pool, made->memory, bytes) : CAIRN_NO_MEMORY;
    if (status == CAIRN_OK)
        status = cairn_occupancy_grid_create(&made->grid, &pool, params);
    if (status == CAIRN_OK)
        status = fill_grid(map, made->grid);
    if (status == CAIRN_OK)
        return status;
    free(made->memory);
    made->memory = NULL;
    return status == CAIRN_NO_MEMORY
               ? cairn_file_error_set(error, status, "map", 0, "no memory for the map")
               : cairn_file_error_set(error, status, "map", 0, "%s", cairn_status_text(status));
}

cairn_status cairn_scan_map_make(const cairn_scan_map *map, cairn_map_file *file,
                                 cairn_file_error *error)
{
    cairn_occupancy_grid_params params = cairn_occupancy_grid_default();
    cairn_heap_grid made = {0};
    cairn_status status;

    *file = cairn_map_file_default();
    status = cairn_scan_map_layout(map, &params, error);
    if (status == CAIRN_OK)
        status = cairn_scan_map_grid(map, &params, &made, error);
    if (status != CAIRN_OK)
        return status;
    file->resolution = params.resolution;
    file->origin.x = params.origin.x;
    file->origin.y = params.origin.y;
    status = cairn_map_file_allocate(file, params.width, params.height);
    if (status == CAIRN_OK)
        status = read_grid(made.grid, file);
    free(made.memory);
    if (status != CAIRN_OK) {
        cairn_map_file_free(file);
        return cairn_file_error_set(error, status, "map", 0, "%s", cairn_status_text(status));
    }
    return CAIRN_OK;
}
