/* Map merging: parameters, memory, inputs and the step of all.
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

#include "src/merging/map_merge_work.h"

enum { MAX_CELLS = 1 << 28, MIN_POINTS = 64, MAX_POINTS = 1 << 16 };

/* Cells: distance at which the weight of an agreement is a half during the search. */
#define SOFT_DISTANCE_CELLS CAIRN_REAL(2.0)

#define INTEGER(field, is, from, to) CAIRN_INTEGER(cairn_map_merge_params, field, is, from, to)

#define POSITIVE(field, is) CAIRN_NUMBER_ABOVE(cairn_map_merge_params, field, is, 0, CAIRN_REAL_MAX)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_maps, 16, 1, MAP_MERGE_MAX_MAPS),
    INTEGER(max_cells, 16 * 400 * 400, 1, MAX_CELLS),
    INTEGER(max_map_cells, 400 * 400, 1, MAX_CELLS),
    INTEGER(max_points, 4096, MIN_POINTS, MAX_POINTS),
    INTEGER(max_segments, 256, 1, 4096),
    INTEGER(max_corners, 48, 1, 1024),
    INTEGER(max_modes, 6, 1, 32),
    INTEGER(particles, 100, 1, 4096),
    INTEGER(perception, CAIRN_MAP_MERGE_LIKELIHOOD_RATIO, CAIRN_MAP_MERGE_LIKELIHOOD_RATIO,
            CAIRN_MAP_MERGE_IMAGES),
    INTEGER(mode, CAIRN_MODE_DEFAULT, CAIRN_MODE_DEFAULT, CAIRN_MODE_AS_WRITTEN),
    POSITIVE(correlation_length, 10),
    POSITIVE(min_score, 6),
    CAIRN_NUMBER(cairn_map_merge_params, min_margin, 3, 0, CAIRN_REAL_MAX),
};
const cairn_parameters cairn_map_merge_parameters =
    CAIRN_PARAMETERS("map_merge", cairn_map_merge_params, rows);

cairn_map_merge_params cairn_map_merge_default(void)
{
    cairn_map_merge_params params;

    cairn_parameters_preset(&cairn_map_merge_parameters, &params);
    params.seed = 1;
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

cairn_status cairn_map_merge_check(const cairn_map_merge_params *params, cairn_object_fault *fault)
{
    cairn_status status = cairn_parameters_check(&cairn_map_merge_parameters, params, fault);
    cairn_particle_filter_params filter;

    if (status == CAIRN_OK)
        status = cairn_parameters_require(params->max_map_cells <= params->max_cells, "map_merge",
                                          "max_map_cells: at most max_cells", fault);
    if (status == CAIRN_OK)
        status = cairn_parameters_require(
            !map_merge_is_written(params) || params->perception == CAIRN_MAP_MERGE_IMAGES,
            "map_merge", "perception: as written CAIRN_MAP_MERGE_IMAGES", fault);
    if (status != CAIRN_OK)
        return status;
    filter = filter_params(params);
    return cairn_particle_filter_check(&filter, fault);
}

/* The nested objects. */
static void take_objects(cairn_map_merge *merge, cairn_pool *pool,
                         const cairn_map_merge_params *params)
{
    cairn_corner_params corners = corner_params(params);
    cairn_distance_map_params distances = distance_params(params);
    cairn_particle_filter_params filter = filter_params(params);
    cairn_particle_filter_model model = map_merge_is_written(params)
                                            ? cairn_map_merge_written_model(merge)
                                            : cairn_map_merge_model(merge);

    CAIRN_TAKE_OBJECT(merge, pool, prepared.corners, corner, &corners);
    CAIRN_TAKE_OBJECT(merge, pool, prepared.distances, distance_map, &distances);
    CAIRN_TAKE_BY(merge,
                  cairn_particle_filter_create(CAIRN_FIELD(merge, filter), pool, &filter, &model));
}

/* The memory of the mode as written. */
static void take_written(cairn_map_merge *merge, cairn_pool *pool,
                         const cairn_map_merge_params *params)
{
    cairn_particle_filter_params filter = cairn_map_merge_written_params(params);
    map_merge_written *written = cairn_object_take(pool, sizeof *written);
    map_merge_map *merged = written != NULL ? &written->merged : NULL;

    CAIRN_TAKE(merged, pool, grid, merged_cells(params));
    CAIRN_TAKE(written, pool, cells, merged_cells(params));
    CAIRN_TAKE(written, pool, candidates, filter.max_candidates);
    CAIRN_TAKE(written, pool, places, filter.max_particles);
    if (written != NULL) {
        written->max_cells = merged_cells(params);
        written->max_candidates = filter.max_candidates;
        cairn_map_merge_set_kernel(written->kernel);
        merge->written = written;
    }
}

/* Sets a new object, whose arrays are allocated; all: the arrays of all maps. */
static void initialize(cairn_map_merge *merge, const cairn_map_merge_params *params,
                       const map_merge_map *all)
{
    size_t maps = (size_t)params->max_maps, points = (size_t)params->max_points,
           lines = (size_t)params->max_segments;

    merge->params = *params;
    merge->prepared.shuffled = all->points + maps * points;
    merge->prepared.label = merge->prepared.queue + points;
    memset(merge->maps, 0, maps * sizeof *merge->maps);
    for (size_t i = 0; i < maps; i++) {
        map_merge_map *map = &merge->maps[i];

        map->points = all->points + i * points;
        map->free_cells = all->free_cells + i * (points / 2);
        map->corners = all->corners + i * (size_t)params->max_corners;
        map->lines = all->lines + i * lines;
        map->curve_points = all->curve_points + i * MAP_MERGE_MAX_CURVE_POINTS;
        map->directions = all->directions + i * lines;
    }
    for (int32_t d = 0; d <= MAP_MERGE_MAX_DISTANCE; d++) {
        cairn_real x = (cairn_real)d / SOFT_DISTANCE_CELLS;

        merge->soft_kernel[d] = cairn_exp(-x * x / 2);
    }
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_map_merge *build(cairn_pool *pool, const cairn_map_merge_params *params)
{
    size_t maps = (size_t)params->max_maps, points = (size_t)params->max_points,
           lines = (size_t)params->max_segments;
    cairn_map_merge *merge = cairn_object_take(pool, sizeof *merge);
    map_merge_map shared = {.points = NULL}, *all = &shared;

    CAIRN_TAKE(merge, pool, maps, maps);
    CAIRN_TAKE(merge, pool, grid, params->max_cells);
    CAIRN_TAKE(merge, pool, prepared.scratch, image_cells(params));
    CAIRN_TAKE(all, pool, points, (maps + 1) * points);
    CAIRN_TAKE(all, pool, free_cells, maps * (points / 2));
    CAIRN_TAKE(all, pool, corners, maps * (size_t)params->max_corners);
    CAIRN_TAKE(all, pool, directions, maps * lines);
    CAIRN_TAKE(merge, pool, prepared.queue, 2 * points);
    CAIRN_TAKE(merge, pool, prepared.line, points);
    CAIRN_TAKE(all, pool, curve_points, maps * MAP_MERGE_MAX_CURVE_POINTS);
    CAIRN_TAKE(all, pool, lines, maps * lines);
    CAIRN_TAKE(merge, pool, pairs.modes, pairs_of(params) * (size_t)params->max_modes);
    CAIRN_TAKE(merge, pool, pairs.mode_count, pairs_of(params));
    if (!map_merge_is_written(params))
        CAIRN_TAKE(merge, pool, cache, MAP_MERGE_CACHE_SLOTS);
    if (merge != NULL)
        initialize(merge, params, all);
    take_objects(merge, pool, params);
    if (map_merge_is_written(params))
        take_written(merge, pool, params);
    return merge;
}

CAIRN_OBJECT(map_merge, map_merge, build);

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
    merge->is_running = merge->done = 0;
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
    if (merge->is_running)
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
    if (merge == NULL || map < 0 || map >= merge->map_count || merge->is_running)
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
    memset(&merge->resume, 0, sizeof merge->resume);
    merge->units_charged = 0;
    merge->tried_count = 0;
    merge->units = 0;
    merge->done = 0;
    merge->is_running = 1;
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
}

/* Step: all of the merging. */
static int merge_all(cairn_map_merge *merge, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(merge->resume.run);
    CAIRN_STEP_RUN(merge, resume.run, budget, cairn_map_merge_prepare);
    if (map_merge_is_written(&merge->params)) {
        CAIRN_STEP_RUN(merge, resume.run, budget, cairn_map_merge_register_corners);
        CAIRN_STEP_RUN(merge, resume.run, budget, cairn_map_merge_run_written);
        CAIRN_STEP_RUN(merge, resume.run, budget, cairn_map_merge_end_written);
    } else {
        CAIRN_STEP_RUN(merge, resume.run, budget, cairn_map_merge_find_modes);
        CAIRN_STEP_RUN(merge, resume.run, budget, cairn_map_merge_run_filter);
        CAIRN_STEP_RUN(merge, resume.run, budget, cairn_map_merge_verify);
    }
    CAIRN_STEP_CHARGE(merge, resume.run, budget, 1 + merge->map_count);
    finish(merge);
    CAIRN_STEP_END(merge->resume.run);
}

cairn_status cairn_map_merge_step(cairn_map_merge *merge, cairn_budget *budget)
{
    int32_t before;
    int is_done;

    if (merge == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!merge->is_running)
        return CAIRN_OK;
    before = budget->left;
    is_done = merge_all(merge, budget);
    merge->units += before - budget->left;
    if (!is_done)
        return CAIRN_MORE;
    merge->result.units = merge->units;
    merge->is_running = 0;
    merge->done = 1;
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
    map_merge_mode mode;

    if (!merge->done || a < 0 || b < 0 || a == b || a >= merge->map_count ||
        b >= merge->map_count || index < 0 || !cairn_map_merge_mode_of(merge, a, b, index, &mode))
        return 0;
    *log_ratio = mode.log_ratio;
    *a_b = frames_of(merge, a, b, mode.first_second);
    return 1;
}
