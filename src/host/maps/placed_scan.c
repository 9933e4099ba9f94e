/* placed_scan: scans at their poses, and the map file that their beams make. */
#include "src/host/maps/placed_scan.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/base/interruption.h"

/* Maximum number of cells of a map: 512 MB of grid. */
#define MAX_CELLS (1 << 26)

cairn_placed_scan *cairn_placed_scans_new(int32_t count)
{
    cairn_placed_scan *scan = calloc((size_t)count, sizeof *scan);

    for (int32_t i = 0; i < count && scan != NULL; i++) {
        for (int k = 0; k < 9; k++)
            scan[i].covariance[k] = (cairn_real)NAN;
        scan[i].support = scan[i].map_sigma = (cairn_real)NAN;
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

cairn_status cairn_placed_scans_place(cairn_placed_scan *scans, const cairn_scan_place *places,
                                      int32_t count, const cairn_mapper *mapper)
{
    int32_t keyframes = cairn_mapper_measure(mapper).keyframes;
    cairn_mapper_uncertainty *of = malloc(((size_t)keyframes + 1) * sizeof *of);
    cairn_status status =
        of == NULL ? CAIRN_NO_MEMORY : cairn_mapper_find_uncertainty(mapper, of, keyframes);

    for (int32_t i = 0; i < count && status != CAIRN_NO_MEMORY; i++) {
        scans[i].after = cairn_scan_place_pose(mapper, &places[i]);
        scans[i].map_sigma = status == CAIRN_OK
                                 ? cairn_sqrt(of[places[i].keyframe].position_variance)
                                 : (cairn_real)NAN;
    }
    free(of);
    return status == CAIRN_UNSUPPORTED ? CAIRN_OK : status;
}

/* ---- The map ---- */

cairn_scan_map_scan cairn_placed_scan_beams(const cairn_placed_scan *scan)
{
    cairn_scan_map_scan beams = {.map_scan = scan->after,
                                 .sensor = scan->sensor,
                                 .ends = scan->beam,
                                 .hits = scan->hit,
                                 .beam_count = scan->beam_count};

    return beams;
}

/* Computes the bounding box of all that was seen: poses and beams as they enter the grid. */
static cairn_box map_box(const cairn_placed_scan_map *map)
{
    cairn_box box = cairn_box_empty();

    for (int32_t s = 0; s < map->count; s++) {
        cairn_scan_map_scan scan = cairn_placed_scan_beams(&map->scan[s]);

        box = cairn_scan_map_bounds(&map->beams, &scan, box);
    }
    return cairn_box_grow(box, 1);
}

/* Adds all scans to the grid. CAIRN_MORE: interrupted. */
static cairn_status run_map(cairn_scan_map *map, cairn_occupancy_grid *grid,
                            const cairn_scan_map_scan *scans, int32_t count)
{
    cairn_status status = cairn_scan_map_begin(map, grid, scans, count, NULL);
    cairn_budget budget;

    if (status != CAIRN_OK)
        return status;
    do {
        budget.left = CAIRN_INTERRUPTION_UNITS;
        status = cairn_scan_map_step(map, &budget);
    } while (status == CAIRN_MORE && !cairn_interruption_is_requested());
    return status;
}

/* Fills the grid, with the memory of the heap that this needs. */
static cairn_status fill_grid(const cairn_placed_scan_map *map, cairn_occupancy_grid *grid)
{
    cairn_occupancy_grid_params layout = cairn_occupancy_grid_read(grid);
    cairn_scan_map_params params = map->beams;
    cairn_scan_map_scan *scans = malloc(((size_t)map->count + 1) * sizeof *scans);
    cairn_status status = CAIRN_NO_MEMORY;
    cairn_scan_map *maker;
    cairn_pool pool;
    void *memory;
    size_t bytes;

    params.max_cells = layout.width * layout.height;
    bytes = cairn_scan_map_memory(&params) + CAIRN_ALIGN;
    memory = malloc(bytes);
    for (int32_t i = 0; i < map->count && scans != NULL; i++)
        scans[i] = cairn_placed_scan_beams(&map->scan[i]);
    if (scans != NULL && memory != NULL)
        status = cairn_pool_init(&pool, memory, bytes);
    if (status == CAIRN_OK)
        status = cairn_scan_map_create(&maker, &pool, &params);
    if (status == CAIRN_OK)
        status = run_map(maker, grid, scans, map->count);
    free(memory);
    free(scans);
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

cairn_status cairn_placed_scan_map_layout(const cairn_placed_scan_map *map,
                                          cairn_occupancy_grid_params *params,
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

cairn_status cairn_placed_scan_map_grid(const cairn_placed_scan_map *map,
                                        const cairn_occupancy_grid_params *params,
                                        cairn_heap_grid *made, cairn_file_error *error)
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

cairn_status cairn_placed_scan_map_make(const cairn_placed_scan_map *map, cairn_map_file *file,
                                        cairn_file_error *error)
{
    cairn_occupancy_grid_params params = cairn_occupancy_grid_default();
    cairn_heap_grid made = {0};
    cairn_status status;

    *file = cairn_map_file_default();
    status = cairn_placed_scan_map_layout(map, &params, error);
    if (status == CAIRN_OK)
        status = cairn_placed_scan_map_grid(map, &params, &made, error);
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
