/* map_vote: the grid that placed maps make together, by majority vote.
 *
 * A cell has the class that most of the maps that know it give it; ties are occupied. A map votes
 * by its cell at the centre of the cell.
 *
 *     begin(maps, placed, out) -> step(budget) until CAIRN_OK
 *
 * Memory: a pose for each map. Maps and grid are the caller's. */
#ifndef CAIRN_MAP_VOTE_H
#define CAIRN_MAP_VOTE_H

#include "cairn/map_merge.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Vote of maps. */
typedef struct cairn_map_vote cairn_map_vote;

/* Parameters; defaults in brackets. */
typedef struct cairn_map_vote_params {
    /* 1 ... 4096 (16): maps */
    int32_t max_maps;
} cairn_map_vote_params;

/* Returns the default parameters. */
cairn_map_vote_params cairn_map_vote_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_map_vote_check(const cairn_map_vote_params *params,
                                                cairn_object_fault *fault);

/* Returns the bytes that create() takes from the pool; 0 for invalid params. */
size_t cairn_map_vote_memory(const cairn_map_vote_params *params);

/* Creates a vote in the pool. CAIRN_BAD_ARGUMENT: NULL or invalid params. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_map_vote_create(cairn_map_vote **vote, cairn_pool *pool,
                                                 const cairn_map_vote_params *params);

/* Returns the box of all maps that are placed, in the frame of the reference, m; an empty one when
 * there is none. Cost: linear in the maps.
 *
 * maps: [count] maps
 * placed: [count] their places */
cairn_box cairn_map_vote_bounds(const cairn_map_merge_map *maps,
                                const cairn_map_merge_placed *placed, int32_t count);

/* Starts a vote and drops one in progress. The cells of the maps and the grid must stay valid until
 * step() returns CAIRN_OK. CAIRN_BAD_ARGUMENT: NULL, count < 0, a bad raster, or a resolution that
 * is not > 0. CAIRN_NOT_FINITE: origin, resolution, or a pose. CAIRN_FULL: more than max_maps are
 * placed. *fault, when not NULL, names the map. Cost: linear in the maps.
 *
 * maps: [count] maps
 * placed: [count] their places; those that are not CAIRN_MAP_MERGE_PLACED do not vote
 * origin: m, in the frame of the reference: lower left corner of cell (0, 0) of the grid
 * resolution: m, > 0: side of a cell of the grid
 * out: the grid, set to CAIRN_OCCUPANCY_GRID_..., row 0 lowest */
CAIRN_CHECKED cairn_status cairn_map_vote_begin(cairn_map_vote *vote,
                                                const cairn_map_merge_map *maps,
                                                const cairn_map_merge_placed *placed, int32_t count,
                                                cairn_vec2 origin, cairn_real resolution,
                                                cairn_raster_u8 out, cairn_fault *fault);

/* Continues the vote. CAIRN_OK: nothing left to do. CAIRN_MORE: the budget is used up.
 * CAIRN_BAD_ARGUMENT: NULL. Costs a unit for each cell and placed map. */
CAIRN_CHECKED cairn_status cairn_map_vote_step(cairn_map_vote *vote, cairn_budget *budget);

#ifdef __cplusplus
}
#endif

#endif
