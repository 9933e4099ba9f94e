/* merged_map: the map file of placed maps, by a majority vote of their cells. */
#include "src/host/maps/merged_map.h"

#include <math.h>
#include <stdlib.h>

#include "cairn/map_vote.h"
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
    if (!(width >= 1 && height >= 1 && width * height <= CAIRN_MAP_FILE_MAX_CELLS &&
          width <= CAIRN_RASTER_MAX_SIDE && height <= CAIRN_RASTER_MAX_SIDE))
        return cairn_file_error_set(error, CAIRN_FULL, "map", 0,
                                    "the merged map has %g by %g cells, expected at least one, up "
                                    "to %d in all and up to %d a "
                                    "side",
                                    width, height, (int)CAIRN_MAP_FILE_MAX_CELLS,
                                    (int)CAIRN_RASTER_MAX_SIDE);
    return cairn_map_file_allocate(merged, (int32_t)width, (int32_t)height) == CAIRN_OK
               ? CAIRN_OK
               : no_memory(error);
}

/* Runs the vote to its end. CAIRN_MORE: interrupted. */
static cairn_status run_vote(cairn_map_vote *vote)
{
    cairn_budget budget;
    cairn_status status;

    do {
        budget.left = CAIRN_INTERRUPTION_UNITS;
        status = cairn_map_vote_step(vote, &budget);
    } while (status == CAIRN_MORE && !cairn_interruption_is_requested());
    return status;
}

/* Sets the pixels of the merged map to the classes of its cells, with memory of the heap. */
static cairn_status vote(const cairn_map_merge_map *maps, const cairn_map_merge_placed *placed,
                         int32_t count, cairn_map_file *merged)
{
    cairn_raster_u8 out = {merged->pixel, merged->width, merged->height, merged->width};
    cairn_vec2 origin = {merged->origin.x, merged->origin.y};
    cairn_map_vote_params params = {.max_maps = count};
    size_t bytes = cairn_map_vote_memory(&params) + CAIRN_ALIGN;
    void *memory = malloc(bytes);
    cairn_status status = memory == NULL ? CAIRN_NO_MEMORY : CAIRN_OK;
    cairn_map_vote *made;
    cairn_pool pool;

    if (status == CAIRN_OK)
        status = cairn_pool_init(&pool, memory, bytes);
    if (status == CAIRN_OK)
        status = cairn_map_vote_create(&made, &pool, &params);
    if (status == CAIRN_OK)
        status =
            cairn_map_vote_begin(made, maps, placed, count, origin, merged->resolution, out, NULL);
    if (status == CAIRN_OK)
        status = run_vote(made);
    free(memory);
    return status;
}

cairn_status cairn_merged_map_make(const cairn_map_merge_map *maps,
                                   const cairn_map_merge_placed *placed, int32_t count,
                                   cairn_real resolution, cairn_map_file *merged,
                                   cairn_file_error *error)
{
    cairn_status status =
        allocate_over(merged, cairn_map_vote_bounds(maps, placed, count), resolution, error);

    if (status != CAIRN_OK)
        return status;
    status = vote(maps, placed, count, merged);
    if (status == CAIRN_NO_MEMORY)
        status = no_memory(error);
    for (size_t i = 0; i < (size_t)merged->width * (size_t)merged->height && status == CAIRN_OK;
         i++)
        merged->occupancy[i] = (int8_t)(merged->pixel[i] == CAIRN_OCCUPANCY_GRID_OCCUPIED ? 100
                                        : merged->pixel[i] == CAIRN_OCCUPANCY_GRID_FREE   ? 0
                                                                                          : -1);
    if (status == CAIRN_OK)
        status = cairn_map_file_draw(merged);
    if (status != CAIRN_OK)
        cairn_map_file_free(merged);
    return status;
}
