/* Majority vote of placed maps.
 *
 * Method: cell by cell; the centre of the cell is transformed into the cells of each map, whose
 * class there is its vote.
 *
 * Limits: a map is not interpolated; where its cells are larger, one votes for several. */
#include "src/base/build.h"

#include "cairn/map_vote.h"
#include "src/base/object.h"
#include "src/base/step.h"

enum { MAX_MAPS = 4096 };

/* A map that votes. */
typedef struct voting_map {
    cairn_raster_u8_view cells;
    cairn_real resolution;
    cairn_transform cells_reference;
} voting_map;

struct cairn_map_vote {
    voting_map *maps; /* [max_maps] */
    int32_t count;
    cairn_vec2 origin; /* of the grid */
    cairn_real resolution;
    cairn_raster_u8 out;
    int32_t is_running; /* 1: step() has work left */
    int32_t x, y, units_charged;
    uint16_t resume;
    cairn_map_vote_params params;
};

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    CAIRN_INTEGER(cairn_map_vote_params, max_maps, 16, 1, MAX_MAPS),
};
extern const cairn_parameters cairn_map_vote_parameters;
const cairn_parameters cairn_map_vote_parameters =
    CAIRN_PARAMETERS("map_vote", cairn_map_vote_params, rows);

cairn_map_vote_params cairn_map_vote_default(void)
{
    cairn_map_vote_params params;

    cairn_parameters_preset(&cairn_map_vote_parameters, &params);
    return params;
}

cairn_status cairn_map_vote_check(const cairn_map_vote_params *params, cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_map_vote_parameters, params, fault);
}

/* The object and its maps; NULL from a counting pool. */
static cairn_map_vote *build(cairn_pool *pool, const cairn_map_vote_params *params)
{
    cairn_map_vote *vote = cairn_object_take(pool, sizeof *vote);

    CAIRN_TAKE(vote, pool, maps, params->max_maps);
    if (vote != NULL)
        vote->params = *params;
    return vote;
}

CAIRN_OBJECT(map_vote, map_vote, build);

/* Returns the pose of a map's cells in the frame of the reference. */
static cairn_pose reference_cells(const cairn_map_merge_map *map,
                                  const cairn_map_merge_placed *placed)
{
    return cairn_pose_compose(placed->reference_map, map->origin);
}

cairn_box cairn_map_vote_bounds(const cairn_map_merge_map *maps,
                                const cairn_map_merge_placed *placed, int32_t count)
{
    cairn_box box = cairn_box_empty();

    for (int32_t i = 0; i < count; i++) {
        const cairn_map_merge_map *map = &maps[i];
        cairn_vec2 far = {(cairn_real)map->cells.width * map->resolution,
                          (cairn_real)map->cells.height * map->resolution};

        for (int corner = 0; corner < 4 && placed[i].verdict == CAIRN_MAP_MERGE_PLACED; corner++) {
            cairn_vec2 p = {corner % 2 ? far.x : 0, corner / 2 ? far.y : 0};

            box = cairn_box_extend(box, cairn_pose_point(reference_cells(map, &placed[i]), p));
        }
    }
    return box;
}

/* Returns the class of a map's cell at a point in the frame of the reference. */
static uint8_t cell_at(const voting_map *map, cairn_vec2 p)
{
    cairn_vec2 q = cairn_transform_point(map->cells_reference, p);
    cairn_real x = cairn_floor(q.x / map->resolution), y = cairn_floor(q.y / map->resolution);

    if (!(x >= 0 && y >= 0 && x < (cairn_real)map->cells.width &&
          y < (cairn_real)map->cells.height))
        return CAIRN_OCCUPANCY_GRID_UNKNOWN;
    return map->cells.data[cairn_real_to_int(y) * map->cells.stride + cairn_real_to_int(x)];
}

/* Returns the class that the maps give the current cell. */
static uint8_t class_of_cell(const cairn_map_vote *vote)
{
    cairn_vec2 p = {vote->origin.x + ((cairn_real)vote->x + CAIRN_REAL(0.5)) * vote->resolution,
                    vote->origin.y + ((cairn_real)vote->y + CAIRN_REAL(0.5)) * vote->resolution};
    int32_t occupied = 0, free = 0;

    for (int32_t i = 0; i < vote->count; i++) {
        uint8_t cell = cell_at(&vote->maps[i], p);

        occupied += cell == CAIRN_OCCUPANCY_GRID_OCCUPIED;
        free += cell == CAIRN_OCCUPANCY_GRID_FREE;
    }
    return occupied + free == 0 ? CAIRN_OCCUPANCY_GRID_UNKNOWN
           : occupied >= free   ? CAIRN_OCCUPANCY_GRID_OCCUPIED
                                : CAIRN_OCCUPANCY_GRID_FREE;
}

static int count_votes(cairn_map_vote *vote, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(vote->resume);
    for (vote->y = 0; vote->y < vote->out.height; vote->y++)
        for (vote->x = 0; vote->x < vote->out.width; vote->x++) {
            CAIRN_STEP_CHARGE(vote, resume, budget, vote->count);
            vote->out.data[vote->y * vote->out.stride + vote->x] = class_of_cell(vote);
        }
    CAIRN_STEP_END(vote->resume);
}

/* CAIRN_OK when a map can vote. */
static cairn_status check_map(const cairn_map_merge_map *map, const cairn_map_merge_placed *placed,
                              int32_t i, cairn_fault *fault)
{
    if (cairn_raster_u8_check(map->cells) != CAIRN_OK)
        return cairn_refuse(fault, i, "the cells are no valid raster", CAIRN_BAD_ARGUMENT);
    if (!(map->resolution > 0))
        return cairn_refuse(fault, i, "the resolution is not > 0", CAIRN_BAD_ARGUMENT);
    if (!cairn_is_finite(map->resolution) || !cairn_pose_is_finite(reference_cells(map, placed)))
        return cairn_refuse(fault, i, "resolution or pose are not finite", CAIRN_NOT_FINITE);
    return CAIRN_OK;
}

static voting_map voting_map_of(const cairn_map_merge_map *map,
                                const cairn_map_merge_placed *placed)
{
    cairn_pose cells_reference = cairn_pose_inverse(reference_cells(map, placed));
    voting_map made = {map->cells, map->resolution, cairn_transform_of(cells_reference)};

    return made;
}

cairn_status cairn_map_vote_begin(cairn_map_vote *vote, const cairn_map_merge_map *maps,
                                  const cairn_map_merge_placed *placed, int32_t count,
                                  cairn_vec2 origin, cairn_real resolution, cairn_raster_u8 out,
                                  cairn_fault *fault)
{
    int32_t voting = 0;

    if (vote == NULL || count < 0 || ((maps == NULL || placed == NULL) && count > 0))
        return cairn_refuse(fault, -1, "no vote or no maps", CAIRN_BAD_ARGUMENT);
    if (cairn_raster_u8_check(cairn_raster_u8_as_view(out)) != CAIRN_OK || !(resolution > 0))
        return cairn_refuse(fault, -1, "the grid is no valid raster, or its resolution is not > 0",
                            CAIRN_BAD_ARGUMENT);
    if (!cairn_vec2_is_finite(origin) || !cairn_is_finite(resolution))
        return cairn_refuse(fault, -1, "the place of the grid is not finite", CAIRN_NOT_FINITE);
    for (int32_t i = 0; i < count; i++)
        if (placed[i].verdict == CAIRN_MAP_MERGE_PLACED) {
            cairn_status status = check_map(&maps[i], &placed[i], i, fault);

            if (status != CAIRN_OK)
                return status;
            if (++voting > vote->params.max_maps)
                return cairn_refuse(fault, i, "more than max_maps are placed", CAIRN_FULL);
        }
    voting = 0;
    for (int32_t i = 0; i < count; i++)
        if (placed[i].verdict == CAIRN_MAP_MERGE_PLACED)
            vote->maps[voting++] = voting_map_of(&maps[i], &placed[i]);
    vote->count = voting;
    vote->origin = origin;
    vote->resolution = resolution;
    vote->out = out;
    vote->is_running = 1;
    vote->units_charged = vote->resume = 0;
    return CAIRN_OK;
}

cairn_status cairn_map_vote_step(cairn_map_vote *vote, cairn_budget *budget)
{
    if (vote == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (vote->is_running && !count_votes(vote, budget))
        return CAIRN_MORE;
    vote->is_running = 0;
    return CAIRN_OK;
}
