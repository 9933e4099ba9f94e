/* merged_map: the map file of placed maps, by a majority vote of their cells. */
#include "src/host/maps/merged_map.h"

#include <math.h>
#include <stdlib.h>

#include "cairn/occupancy_grid.h"
#include "src/host/base/interruption.h"

/* ---- Classes of cells ---- */

static uint8_t class_of(const cairn_map_file *file, int8_t value)
{
    double p = (double)value / 100;

    if (value < 0)
        return CAIRN_OCCUPANCY_GRID_UNKNOWN;
    if (file->mode == CAIRN_MAP_FILE_RAW)
        return p >= (double)file->occupied_threshold ? CAIRN_OCCUPANCY_GRID_OCCUPIED
               : p <= (double)file->free_threshold   ? CAIRN_OCCUPANCY_GRID_FREE
                                                     : CAIRN_OCCUPANCY_GRID_UNKNOWN;
    return value == 100 ? CAIRN_OCCUPANCY_GRID_OCCUPIED
           : value == 0 ? CAIRN_OCCUPANCY_GRID_FREE
                        : CAIRN_OCCUPANCY_GRID_UNKNOWN;
}

void cairn_merged_map_classify(const cairn_map_file *file, uint8_t *cells)
{
    size_t count = (size_t)file->width * (size_t)file->height;

    for (size_t i = 0; i < count; i++)
        cells[i] = class_of(file, file->occupancy[i]);
}

/* ---- The merged map ---- */

/* Returns the pose of a map's cells in the frame of the reference. */
static cairn_pose reference_cells(const cairn_map_merge_map *map,
                                  const cairn_map_merge_placed *placed)
{
    return cairn_pose_compose(placed->reference_map, map->origin);
}

static cairn_box extent_of(const cairn_map_merge_map *maps, const cairn_map_merge_placed *placed,
                           int32_t count)
{
    cairn_box box = cairn_box_empty();

    for (int32_t i = 0; i < count; i++) {
        const cairn_map_merge_map *map = &maps[i];
        double width = map->cells.width * (double)map->resolution,
               height = map->cells.height * (double)map->resolution;

        for (int corner = 0; corner < 4 && placed[i].verdict == CAIRN_MAP_MERGE_PLACED; corner++) {
            cairn_vec2 p = {(cairn_real)(corner % 2 ? width : 0),
                            (cairn_real)(corner / 2 ? height : 0)};

            box = cairn_box_extend(box, cairn_pose_point(reference_cells(map, &placed[i]), p));
        }
    }
    return box;
}

/* Returns the class of a map's cell at a point in the frame of the reference. */
static uint8_t cell_at(const cairn_map_merge_map *map, cairn_transform cells_reference,
                       cairn_vec2 p)
{
    cairn_vec2 q = cairn_transform_point(cells_reference, p);
    double x = floor((double)q.x / (double)map->resolution),
           y = floor((double)q.y / (double)map->resolution);

    if (!(x >= 0 && y >= 0 && x < map->cells.width && y < map->cells.height))
        return CAIRN_OCCUPANCY_GRID_UNKNOWN;
    return map->cells.data[(size_t)y * (size_t)map->cells.stride + (size_t)x];
}

/* Adds the map's vote to every cell: +1 occupied, -1 free; `known` counts the votes. */
static cairn_status vote(const cairn_map_merge_map *map, const cairn_map_merge_placed *placed,
                         const cairn_map_file *merged, int8_t *sum, uint8_t *known)
{
    cairn_transform t = cairn_transform_of(cairn_pose_inverse(reference_cells(map, placed)));

    for (int32_t y = 0; y < merged->height; y++) {
        if (cairn_interruption_is_requested())
            return CAIRN_MORE;
        for (int32_t x = 0; x < merged->width; x++) {
            size_t at = (size_t)y * (size_t)merged->width + (size_t)x;
            cairn_vec2 p = {
                merged->origin.x + ((cairn_real)x + CAIRN_REAL(0.5)) * merged->resolution,
                merged->origin.y + ((cairn_real)y + CAIRN_REAL(0.5)) * merged->resolution};
            uint8_t cell = cell_at(map, t, p);

            sum[at] = (int8_t)(sum[at] + (cell == CAIRN_OCCUPANCY_GRID_OCCUPIED) -
                               (cell == CAIRN_OCCUPANCY_GRID_FREE));
            known[at] = (uint8_t)(known[at] | (cell != CAIRN_OCCUPANCY_GRID_UNKNOWN));
        }
    }
    return CAIRN_OK;
}

static cairn_status no_memory(cairn_file_error *error)
{
    return cairn_file_error_set(error, CAIRN_NO_MEMORY, "map", 0, "no memory for the merged map");
}

/* Allocates the merged map over an extent. */
static cairn_status allocate_over(cairn_map_file *merged, cairn_box box, cairn_real resolution,
                                  cairn_file_error *error)
{
    double width = ceil((double)((box.max.x - box.min.x) / resolution)),
           height = ceil((double)((box.max.y - box.min.y) / resolution));

    *merged = cairn_map_file_default();
    merged->resolution = resolution;
    merged->origin.x = box.min.x;
    merged->origin.y = box.min.y;
    if (!(width >= 1 && height >= 1 && width * height <= CAIRN_MAP_FILE_MAX_CELLS))
        return cairn_file_error_set(
            error, CAIRN_FULL, "map", 0,
            "the merged map has %g by %g cells, expected at least one and up to %d in all", width,
            height, (int)CAIRN_MAP_FILE_MAX_CELLS);
    return cairn_map_file_allocate(merged, (int32_t)width, (int32_t)height) == CAIRN_OK
               ? CAIRN_OK
               : no_memory(error);
}

cairn_status cairn_merged_map_make(const cairn_map_merge_map *maps,
                                   const cairn_map_merge_placed *placed, int32_t count,
                                   cairn_real resolution, cairn_map_file *merged,
                                   cairn_file_error *error)
{
    cairn_status status = allocate_over(merged, extent_of(maps, placed, count), resolution, error);
    size_t cells = (size_t)merged->width * (size_t)merged->height;
    int8_t *sum;
    uint8_t *known;

    if (status != CAIRN_OK)
        return status;
    sum = calloc(cells, 1);
    known = calloc(cells, 1);
    if (sum == NULL || known == NULL) {
        status = no_memory(error);
    } else {
        for (int32_t i = 0; i < count && status == CAIRN_OK; i++)
            if (placed[i].verdict == CAIRN_MAP_MERGE_PLACED)
                status = vote(&maps[i], &placed[i], merged, sum, known);
        for (size_t i = 0; i < cells; i++)
            merged->occupancy[i] = (int8_t)(!known[i] ? -1 : sum[i] >= 0 ? 100 : 0);
        if (status == CAIRN_OK)
            status = cairn_map_file_draw(merged);
    }
    free(sum);
    free(known);
    if (status != CAIRN_OK)
        cairn_map_file_free(merged);
    return status;
}
