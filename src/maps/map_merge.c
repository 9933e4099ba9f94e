/* Map merging: parameters, memory, inputs and the main loop.
 *
 * Method.
 *
 * 1. Maps are prepared one by one (map_merge_prepare.c).
 * 2. Competing registrations (modes) of all pairs are found (map_merge_pairs.c).
 * 3. A particle filter places the maps (map_merge_filter.c).
 * 4. The result is refined jointly and verified (map_merge_check.c).
 *
 * Layout: a packed cell of two bytes per cell of all maps; points, free cells, corners, lines and
 * curve points of each map; a list of modes per pair; the filter; a hash table of pair scores.
 *
 * Limits: a pair needs some metres of common wall that is not one straight line. Maps have one
 * scale. Walls distorted by more than a few cells between the maps do not agree.
 *
 * Source: Adluru 2008, chapter 9. */
#include "src/base/build.h"

#include <string.h>

#include "src/maps/map_merge_work.h"

enum { MAX_CELLS = 1 << 28, MIN_POINTS = 64, MAX_POINTS = 1 << 16 };

/* Cells: distance at which the weight of an agreement is a half during the search. */
#define SOFT_DISTANCE_CELLS CAIRN_REAL(2.0)

cairn_map_merge_params cairn_map_merge_default(void)
{
    cairn_map_merge_params params = {
        .max_maps = 16,
        .max_cells = 16 * 400 * 400,
        .max_map_cells = 400 * 400,
        .max_points = 4096,
        .max_segments = 256,
        .max_corners = 48,
        .max_modes = 6,
        .particles = 100,
        .perception = CAIRN_MAP_MERGE_LIKELIHOOD_RATIO,
        .correlation_length = 10,
        .min_score = 6,
        .min_margin = 3,
        .seed = 1,
    };
    return params;
}

cairn_map_merge_params cairn_map_merge_as_written(void)
{
    cairn_map_merge_params params = cairn_map_merge_default();

    params.mode = CAIRN_MODE_AS_WRITTEN;
    params.perception = CAIRN_MAP_MERGE_IMAGES;
    params.particles = 50;
    params.max_modes = 12;
    return params;
}

static int is_count(int32_t n, int32_t least, int32_t most)
{
    return n >= least && n <= most;
}

static int params_are_valid(const cairn_map_merge_params *params)
{
    return params != NULL && is_count(params->max_maps, 1, MAP_MERGE_MAX_MAPS) &&
           is_count(params->max_cells, 1, MAX_CELLS) &&
           is_count(params->max_map_cells, 1, params->max_cells) &&
           is_count(params->max_points, MIN_POINTS, MAX_POINTS) &&
           is_count(params->max_segments, 1, 4096) && is_count(params->max_corners, 1, 1024) &&
           is_count(params->max_modes, 1, 32) && is_count(params->particles, 1, 4096) &&
           is_count(params->mode, CAIRN_MODE_DEFAULT, CAIRN_MODE_AS_WRITTEN) &&
           (params->mode == CAIRN_MODE_DEFAULT || params->perception == CAIRN_MAP_MERGE_IMAGES) &&
           params->perception >= CAIRN_MAP_MERGE_LIKELIHOOD_RATIO &&
           params->perception <= CAIRN_MAP_MERGE_IMAGES && params->correlation_length > 0 &&
           cairn_is_finite(params->correlation_length) && params->min_score > 0 &&
           cairn_is_finite(params->min_score) && params->min_margin >= 0 &&
           cairn_is_finite(params->min_margin);
}

static cairn_corner_params corner_params(const cairn_map_merge_params *params)
{
    cairn_corner_params c = cairn_corner_default();

    c.max_segments = params->max_segments;
    c.max_corners = params->max_corners;
    c.min_opening = 50 * (CAIRN_PI / 180);
    c.max_opening = 130 * (CAIRN_PI / 180);
    c.end_distance = CAIRN_REAL(0.5);
    return c;
}

/* Returns the maximum number of cells of the merged map, as written. */
static int32_t merged_cells(const cairn_map_merge_params *params)
{
    return params->max_cells < MAX_CELLS / MAP_MERGE_MAX_MERGED_CELLS
               ? MAP_MERGE_MAX_MERGED_CELLS * params->max_cells
               : MAX_CELLS;
}

/* Returns the maximum number of cells of an image that distances are computed for. */
static int32_t image_cells(const cairn_map_merge_params *params)
{
    return map_merge_is_written(params) ? merged_cells(params) : params->max_map_cells;
}

/* Returns the distance map's params: a side of at most that of a raster, or all cells in one
 * row. */
static cairn_distance_map_params distance_params(const cairn_map_merge_params *params)
{
    cairn_distance_map_params d = {
        .max_width = image_cells(params) < CAIRN_RASTER_MAX_SIDE ? image_cells(params)
                                                                 : CAIRN_RASTER_MAX_SIDE,
    };

    return d;
}

static cairn_particle_filter_params filter_params(const cairn_map_merge_params *params)
{
    return map_merge_is_written(params) ? cairn_map_merge_written_params(params)
                                        : cairn_map_merge_filter_params(params);
}

static size_t pairs_of(const cairn_map_merge_params *params)
{
    size_t n = (size_t)params->max_maps;

    return n * (n - 1) / 2 + 1;
}

/* Creates the objects inside; NULL from a counting pool. */
static void take_objects(cairn_map_merge *merge, cairn_pool *pool,
                         const cairn_map_merge_params *params)
{
    cairn_corner_params corners = corner_params(params);
    cairn_distance_map_params distances = distance_params(params);
    cairn_particle_filter_params filter = filter_params(params);
    cairn_particle_filter_model model;
    cairn_status status;

    if (merge == NULL) {
        cairn_pool_count(pool, cairn_corner_memory(&corners));
        cairn_pool_count(pool, cairn_distance_map_memory(&distances));
        cairn_pool_count(pool, cairn_particle_filter_memory(&filter));
        return;
    }
    model = map_merge_is_written(params) ? cairn_map_merge_written_model(merge)
                                         : cairn_map_merge_model(merge);
    status = cairn_corner_create(&merge->corners, pool, &corners);
    CAIRN_ASSERT(status == CAIRN_OK);
    status = cairn_distance_map_create(&merge->distances, pool, &distances);
    CAIRN_ASSERT(status == CAIRN_OK);
    status = cairn_particle_filter_create(&merge->filter, pool, &filter, &model);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
}

/* Takes the memory of the mode as written. */
static map_merge_written *take_written(cairn_pool *pool, const cairn_map_merge_params *params)
{
    cairn_particle_filter_params filter = cairn_map_merge_written_params(params);
    size_t cells = (size_t)merged_cells(params), listed = (size_t)filter.max_candidates;
    map_merge_written *w = cairn_pool_take_one(pool, sizeof *w);
    uint16_t *grid = cairn_pool_take(pool, cells, sizeof *grid);
    uint8_t *classes = cairn_pool_take(pool, cells, 1);
    map_merge_state *list = cairn_pool_take(pool, listed, sizeof *list);
    map_merge_places *places = cairn_pool_take(pool, (size_t)filter.max_particles, sizeof *places);

    if (w != NULL) {
        memset(w, 0, sizeof *w);
        w->merged.grid = grid;
        w->cells = classes;
        w->max_cells = merged_cells(params);
        w->candidates = list;
        w->max_candidates = filter.max_candidates;
        w->places = places;
        cairn_map_merge_set_kernel(w->kernel);
    }
    return w;
}

static cairn_map_merge *take_memory(cairn_pool *pool, const cairn_map_merge_params *params)
{
    size_t maps = (size_t)params->max_maps, points = (size_t)params->max_points;
    cairn_map_merge *merge = cairn_pool_take_one(pool, sizeof *merge);
    map_merge_map *list = cairn_pool_take(pool, maps, sizeof *list);
    uint16_t *grid = cairn_pool_take(pool, (size_t)params->max_cells, sizeof *grid);
    int32_t *scratch = cairn_pool_take(pool, (size_t)image_cells(params), sizeof *scratch);
    map_merge_point *surface = cairn_pool_take(pool, (maps + 1) * points, sizeof *surface);
    cairn_vec2 *open = cairn_pool_take(pool, maps * (points / 2), sizeof *open);
    cairn_corner *corners =
        cairn_pool_take(pool, maps * (size_t)params->max_corners, sizeof *corners);
    map_merge_direction *ways =
        cairn_pool_take(pool, maps * (size_t)params->max_segments, sizeof *ways);
    int32_t *queue = cairn_pool_take(pool, 2 * points, sizeof *queue);
    cairn_vec2 *line = cairn_pool_take(pool, points, sizeof *line);
    map_merge_curve_point *curve_points =
        cairn_pool_take(pool, maps * MAP_MERGE_MAX_CURVE_POINTS, sizeof *curve_points);
    cairn_segment *lines =
        cairn_pool_take(pool, maps * (size_t)params->max_segments, sizeof *lines);
    map_merge_mode *modes =
        cairn_pool_take(pool, pairs_of(params) * (size_t)params->max_modes, sizeof *modes);
    int32_t *mode_count = cairn_pool_take(pool, pairs_of(params), sizeof *mode_count);
    map_merge_cache_entry *memory =
        map_merge_is_written(params) ? NULL
                                     : cairn_pool_take(pool, MAP_MERGE_CACHE_SLOTS, sizeof *memory);

    if (merge != NULL) {
        memset(merge, 0, sizeof *merge);
        merge->params = *params;
        merge->maps = list;
        merge->grid = grid;
        merge->scratch = scratch;
        merge->shuffled = surface + maps * points;
        merge->queue = queue;
        merge->label = queue + points;
        merge->line = line;
        merge->modes = modes;
        merge->mode_count = mode_count;
        merge->cache = memory;
        for (size_t i = 0; i < maps; i++) {
            memset(&list[i], 0, sizeof list[i]);
            list[i].points = surface + i * points;
            list[i].free_cells = open + i * (points / 2);
            list[i].corners = corners + i * (size_t)params->max_corners;
            list[i].lines = lines + i * (size_t)params->max_segments;
            list[i].curve_points = curve_points + i * MAP_MERGE_MAX_CURVE_POINTS;
            list[i].directions = ways + i * (size_t)params->max_segments;
        }
    }
    take_objects(merge, pool, params);
    if (map_merge_is_written(params)) {
        map_merge_written *written = take_written(pool, params);

        if (merge != NULL)
            merge->written = written;
    }
    return merge;
}

size_t cairn_map_merge_memory(const cairn_map_merge_params *params)
{
    cairn_pool counting;

    if (!params_are_valid(params))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)take_memory(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_map_merge_create(cairn_map_merge **merge, cairn_pool *pool,
                                    const cairn_map_merge_params *params)
{
    size_t need = cairn_map_merge_memory(params);
    cairn_map_merge *made;

    if (merge == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_capacity(pool, need))
        return CAIRN_NO_MEMORY;
    made = take_memory(pool, params);
    for (int32_t d = 0; d <= MAP_MERGE_MAX_DISTANCE; d++) {
        cairn_real x = (cairn_real)d / SOFT_DISTANCE_CELLS;

        made->soft_kernel[d] = cairn_exp(-x * x / 2);
    }
    *merge = made;
    return CAIRN_OK;
}

cairn_status cairn_map_merge_coarsen(cairn_raster_u8_view cells, int32_t k, cairn_raster_u8 out)
{
    if (cairn_raster_u8_check(cells) != CAIRN_OK ||
        cairn_raster_u8_check(cairn_raster_u8_as_view(out)) != CAIRN_OK || k < 1 ||
        out.width != (cells.width - 1) / k + 1 || out.height != (cells.height - 1) / k + 1)
        return CAIRN_BAD_ARGUMENT;
    for (int32_t y = 0; y < out.height; y++)
        memset(out.data + y * out.stride, CAIRN_OCCUPANCY_GRID_UNKNOWN, (size_t)out.width);
    for (int32_t y = 0; y < cells.height; y++)
        for (int32_t x = 0; x < cells.width; x++) {
            uint8_t cell = cells.data[y * cells.stride + x],
                    *to = &out.data[y / k * out.stride + x / k];

            if (cell == CAIRN_OCCUPANCY_GRID_OCCUPIED ||
                (cell == CAIRN_OCCUPANCY_GRID_FREE && *to != CAIRN_OCCUPANCY_GRID_OCCUPIED))
                *to = cell;
        }
    return CAIRN_OK;
}

void cairn_map_merge_clear(cairn_map_merge *merge)
{
    merge->map_count = 0;
    merge->cells = 0;
    merge->phase = MAP_MERGE_IDLE;
    merge->done = 0;
}

static cairn_pose scaled(cairn_pose pose, cairn_real by)
{
    pose.x *= by;
    pose.y *= by;
    return pose;
}

cairn_status cairn_map_merge_add(cairn_map_merge *merge, const cairn_map_merge_map *map,
                                 cairn_fault *fault)
{
    map_merge_map *added;
    int64_t cells;

    if (merge == NULL || map == NULL)
        return cairn_refuse(fault, -1, "NULL, expected a map", CAIRN_BAD_ARGUMENT);
    if (merge->phase != MAP_MERGE_IDLE)
        return cairn_refuse(fault, -1, "merging is in progress, expected its end",
                            CAIRN_BAD_ARGUMENT);
    if (cairn_raster_u8_check(map->cells) != CAIRN_OK)
        return cairn_refuse(fault, -1, "not a raster of cells", CAIRN_BAD_ARGUMENT);
    if (!cairn_is_finite(map->resolution) || !cairn_pose_is_finite(map->origin))
        return cairn_refuse(fault, -1, "resolution or origin is not finite", CAIRN_NOT_FINITE);
    if (!(map->resolution > 0))
        return cairn_refuse(fault, -1, "resolution is not above 0", CAIRN_BAD_ARGUMENT);
    cells = (int64_t)map->cells.width * map->cells.height;
    if (merge->map_count == merge->params.max_maps)
        return cairn_refuse(fault, -1, "more maps than max_maps", CAIRN_FULL);
    if (cells > merge->params.max_map_cells)
        return cairn_refuse(fault, -1, "more cells than max_map_cells", CAIRN_FULL);
    if (merge->cells + cells > merge->params.max_cells)
        return cairn_refuse(fault, -1, "more cells in all than max_cells", CAIRN_FULL);
    if (merge->map_count == 0)
        merge->unit = map->resolution / MAP_MERGE_CELL;
    added = &merge->maps[merge->map_count++];
    added->input = *map;
    added->input.resolution = map->resolution / merge->unit;
    added->input.origin = scaled(map->origin, 1 / merge->unit);
    added->grid = merge->grid + merge->cells;
    merge->cells += cells;
    added->corner.x = -added->input.resolution * (cairn_real)map->cells.width / 2;
    added->corner.y = -added->input.resolution * (cairn_real)map->cells.height / 2;
    added->map_centre.x = -added->corner.x;
    added->map_centre.y = -added->corner.y;
    added->map_centre.theta = 0;
    added->map_centre = cairn_pose_compose(added->input.origin, added->map_centre);
    added->has_guess = 0;
    added->point_count = added->free_cell_count = added->corner_count = added->line_count = 0;
    merge->done = 0;
    return CAIRN_OK;
}

cairn_status cairn_map_merge_guess(cairn_map_merge *merge, int32_t map, cairn_pose reference_map)
{
    if (merge == NULL || map < 0 || map >= merge->map_count || merge->phase != MAP_MERGE_IDLE)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pose_is_finite(reference_map))
        return CAIRN_NOT_FINITE;
    if (map_merge_is_written(&merge->params))
        return CAIRN_UNSUPPORTED;
    merge->maps[map].has_guess = 1;
    merge->maps[map].given_guess = reference_map;
    return CAIRN_OK;
}

/* Converts the pose of map b relative to map a from frames to centres, and back. */
static cairn_pose centres_of(const cairn_map_merge *merge, int32_t a, int32_t b, cairn_pose a_b)
{
    return cairn_pose_between(
        merge->maps[a].map_centre,
        cairn_pose_compose(scaled(a_b, 1 / merge->unit), merge->maps[b].map_centre));
}

static cairn_pose frames_of(const cairn_map_merge *merge, int32_t a, int32_t b, cairn_pose centres)
{
    cairn_pose a_b = cairn_pose_compose(cairn_pose_compose(merge->maps[a].map_centre, centres),
                                        cairn_pose_inverse(merge->maps[b].map_centre));

    return scaled(a_b, merge->unit);
}

static int is_order(const cairn_map_merge *merge, int32_t reference, const int32_t *order)
{
    int32_t seen[MAP_MERGE_MAX_MAPS] = {0};

    if (order[0] != reference)
        return 0;
    for (int32_t i = 0; i < merge->map_count; i++)
        if (order[i] < 0 || order[i] >= merge->map_count || seen[order[i]]++)
            return 0;
    return 1;
}

cairn_status cairn_map_merge_begin(cairn_map_merge *merge, int32_t reference, const int32_t *order)
{
    if (merge == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (merge->map_count == 0)
        return CAIRN_EMPTY;
    if (reference < 0 || reference >= merge->map_count ||
        (order != NULL && !is_order(merge, reference, order)))
        return CAIRN_BAD_ARGUMENT;
    merge->reference = reference;
    merge->has_order = order != NULL;
    if (order != NULL)
        memcpy(merge->order, order, (size_t)merge->map_count * sizeof *order);
    for (int32_t i = 0; i < merge->map_count; i++)
        if (merge->maps[i].has_guess)
            merge->maps[i].guess = centres_of(merge, reference, i, merge->maps[i].given_guess);
    merge->map = 0;
    merge->cursor = 0;
    merge->units_charged = 0;
    merge->is_comparing = 0;
    merge->tried_count = 0;
    merge->units = 0;
    merge->done = 0;
    merge->stage = MAP_MERGE_PREPARING;
    merge->phase = MAP_MERGE_OCCUPIED_DISTANCE;
    return CAIRN_OK;
}

static void finish(cairn_map_merge *merge)
{
    cairn_map_merge_result *r = &merge->result;
    int32_t rank = 0;

    memset(r, 0, sizeof *r);
    r->maps = merge->map_count;
    r->reference = merge->reference;
    r->hypotheses = merge->tried_count;
    r->resamplings = cairn_particle_filter_read(merge->filter).resamplings;
    r->n_eff = cairn_particle_filter_read(merge->filter).n_eff;
    r->peak_particles = map_merge_is_written(&merge->params) ? merge->written->peak_particles
                                                             : merge->params.particles;
    r->candidates_dropped =
        map_merge_is_written(&merge->params) ? merge->written->dropped_count : 0;
    for (int32_t i = 0; i < merge->map_count; i++) {
        cairn_map_merge_placed *p = &merge->placed[i];

        p->reference_map = frames_of(merge, merge->reference, i, merge->check.pose[i]);
        r->placed += p->verdict == CAIRN_MAP_MERGE_PLACED;
        r->log_likelihood_ratio += p->verdict == CAIRN_MAP_MERGE_PLACED ? p->support : 0;
    }
    for (int32_t k = 0; k < merge->check.count; k++)
        if (merge->check.accepted[merge->check.list[k]])
            merge->placed[merge->check.list[k]].rank = rank++;
    for (int32_t i = 0; i < merge->map_count; i++)
        if (!merge->check.accepted[i])
            merge->placed[i].rank = rank++;
    merge->phase = MAP_MERGE_IDLE;
    merge->done = 1;
}

static cairn_status step_default(cairn_map_merge *merge, cairn_budget *budget)
{
    return merge->stage == MAP_MERGE_PREPARING  ? cairn_map_merge_prepare(merge, budget)
           : merge->stage == MAP_MERGE_PAIRING  ? cairn_map_merge_find_modes(merge, budget)
           : merge->stage == MAP_MERGE_VISITING ? cairn_map_merge_run_filter(merge, budget)
                                                : cairn_map_merge_check(merge, budget);
}

static cairn_status step_written(cairn_map_merge *merge, cairn_budget *budget)
{
    return merge->stage == MAP_MERGE_PREPARING  ? cairn_map_merge_prepare(merge, budget)
           : merge->stage == MAP_MERGE_PAIRING  ? cairn_map_merge_register_corners(merge, budget)
           : merge->stage == MAP_MERGE_VISITING ? cairn_map_merge_run_written(merge, budget)
                                                : cairn_map_merge_end_written(merge, budget);
}

cairn_status cairn_map_merge_step(cairn_map_merge *merge, cairn_budget *budget)
{
    int32_t before;

    if (merge == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (merge->phase == MAP_MERGE_IDLE)
        return CAIRN_OK;
    before = budget->left;
    while (merge->stage < MAP_MERGE_FINISHED) {
        cairn_status status = map_merge_is_written(&merge->params) ? step_written(merge, budget)
                                                                   : step_default(merge, budget);

        if (status != CAIRN_OK) {
            merge->units += before - budget->left;
            return status;
        }
        merge->stage++;
    }
    merge->units += before - budget->left;
    finish(merge);
    merge->result.units = merge->units;
    return CAIRN_OK;
}

/* ---- Reading ---- */

cairn_status cairn_map_merge_score(const cairn_map_merge *merge, int32_t a, int32_t b,
                                   cairn_pose a_b, cairn_map_merge_pair_score *score)
{
    if (merge == NULL || score == NULL || !merge->done || a < 0 || b < 0 || a >= merge->map_count ||
        b >= merge->map_count)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pose_is_finite(a_b))
        return CAIRN_NOT_FINITE;
    cairn_map_merge_score_at(merge, a, b, centres_of(merge, a, b, a_b), score);
    score->agreeing_wall *= merge->unit;
    score->free_space_violation *= merge->unit;
    return CAIRN_OK;
}

const char *cairn_map_merge_verdict_text(cairn_map_merge_verdict verdict)
{
    switch (verdict) {
    case CAIRN_MAP_MERGE_PLACED:
        return "placed";
    case CAIRN_MAP_MERGE_EMPTY:
        return "no wall or no free space in it";
    case CAIRN_MAP_MERGE_NO_OVERLAP:
        return "no pose agrees with any other map";
    case CAIRN_MAP_MERGE_LOW_SUPPORT:
        return "too little support for its best pose";
    case CAIRN_MAP_MERGE_AMBIGUOUS:
        return "a competing pose has nearly as much support";
    case CAIRN_MAP_MERGE_UNOBSERVABLE:
        return "translation along its walls is unobservable";
    case CAIRN_MAP_MERGE_NO_CORNER:
        return "no corner is similar to one of the merged maps";
    default:
        return "unknown verdict";
    }
}

cairn_map_merge_result cairn_map_merge_read(const cairn_map_merge *merge)
{
    const cairn_map_merge_result none = {0};

    return merge->done ? merge->result : none;
}

cairn_map_merge_placed cairn_map_merge_of(const cairn_map_merge *merge, int32_t map)
{
    const cairn_map_merge_placed none = {0, {0, 0, 0}, 0, 0, 0, 0, 0, 0, 0};

    return merge->done && map >= 0 && map < merge->map_count ? merge->placed[map] : none;
}

int32_t cairn_map_merge_mode(const cairn_map_merge *merge, int32_t a, int32_t b, int32_t index,
                             cairn_pose *a_b, cairn_real *log_ratio)
{
    const map_merge_mode *mode;
    int32_t pair;

    if (!merge->done || a < 0 || b < 0 || a == b || a >= merge->map_count ||
        b >= merge->map_count || index < 0)
        return 0;
    pair = a < b ? map_merge_pair(a, b) : map_merge_pair(b, a);
    if (index >= merge->mode_count[pair])
        return 0;
    mode = &merge->modes[(size_t)pair * (size_t)merge->params.max_modes + (size_t)index];
    *log_ratio = mode->log_ratio;
    *a_b =
        frames_of(merge, a, b, a < b ? mode->first_second : cairn_pose_inverse(mode->first_second));
    return 1;
}
