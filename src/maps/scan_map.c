/* Occupancy grid of scans at known poses.
 *
 * Method.
 *
 * 1. The beams of all scans are added to the grid, and pass everything. What stays occupied is a
 *    wall: it was hit more often than passed.
 * 2. Walls are marked in a mask, with a margin: the beams that hit a wall are spread, and leave
 *    gaps.
 * 3. The grid is cleared, and the beams are added again. One without return is sampled along its
 *    length, and ends before the first wall. A scanner that stands beside a wall looks away from
 *    it: walls count from the first cell that is none.
 *
 * Limits: a wall that is passed more often than hit is none. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/scan_map.h"
#include "src/base/object.h"
#include "src/base/step.h"

/* Largest grid; most samples of a beam. */
enum { MAX_CELLS = 1 << 30, MAX_SAMPLES = 1 << 30 };

/* Cells beside a wall that count as wall. */
enum { WALL_MARGIN_CELLS = 1 };

/* Points of a beam at which it is tested whether a wall is there. */
enum { SAMPLES_PER_CELL = 4 };

enum { CELLS_PER_UNIT = 2, SAMPLES_PER_UNIT = 4, CLEARED_WORDS_PER_UNIT = 128 };

/* m: the ends of beams are corrected for the motion during the scan, their common start is not. */
static const cairn_real FREE_TOLERANCE_M = CAIRN_REAL(0.1);

enum { WORD_BITS = 32 };

struct cairn_scan_map {
    cairn_scan_map_params params;
    uint32_t *walls; /* mask of walls: a bit for each cell, row by row */
    /* The map in progress. */
    cairn_occupancy_grid *grid;
    cairn_occupancy_grid_params layout; /* of the grid */
    const cairn_scan_map_scan *scans;   /* [count] */
    int32_t count;
    int32_t is_running; /* 1: step() has work left */
    int32_t has_walls;  /* 1: the mask is complete */
    int32_t cell;       /* of the search for walls; word while the mask is cleared */
    int32_t scan, beam;
    cairn_transform map_scan; /* of the scan */
    cairn_scan_beam current;  /* the beam, in the map */
    cairn_status status;      /* of the beam */
    int32_t samples;          /* of the beam; 0: it passes walls */
    int32_t sample;           /* number of samples tested so far */
    cairn_vec2 last;          /* sample before the next; finally the end of the beam */
    int32_t has_left;         /* 1: a sample was beside all walls */
    uint16_t resume, phase_resume, beam_resume;
};

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    CAIRN_INTEGER_IF(cairn_scan_map_params, max_cells,
                     CAIRN_WHEN(cairn_scan_map_params, stop_at_walls), 160000, 1, MAX_CELLS),
    CAIRN_INTEGER(cairn_scan_map_params, stop_at_walls, 1, 0, 1),
    CAIRN_NUMBER_ABOVE(cairn_scan_map_params, max_range, 30, 0, CAIRN_REAL_MAX),
    CAIRN_NUMBER(cairn_scan_map_params, max_free_range, 5, 0, CAIRN_REAL_MAX),
};
extern const cairn_parameters cairn_scan_map_parameters;
const cairn_parameters cairn_scan_map_parameters =
    CAIRN_PARAMETERS("scan_map", cairn_scan_map_params, rows);

cairn_scan_map_params cairn_scan_map_default(void)
{
    cairn_scan_map_params params;

    cairn_parameters_preset(&cairn_scan_map_parameters, &params);
    return params;
}

cairn_status cairn_scan_map_check(const cairn_scan_map_params *params, cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_scan_map_parameters, params, fault);
}

/* Words of the mask of a grid. */
static int32_t words_of(int32_t cells)
{
    return (cells + WORD_BITS - 1) / WORD_BITS;
}

/* The object and its mask; NULL from a counting pool. */
static cairn_scan_map *build(cairn_pool *pool, const cairn_scan_map_params *params)
{
    cairn_scan_map *map = cairn_object_take(pool, sizeof *map);

    CAIRN_TAKE(map, pool, walls, params->stop_at_walls ? words_of(params->max_cells) : 0);
    if (map != NULL)
        map->params = *params;
    return map;
}

CAIRN_OBJECT(scan_map, scan_map, build);

/* ---- Beams ---- */

int32_t cairn_scan_map_beam(const cairn_scan_map_params *params, const cairn_scan_map_scan *scan,
                            int32_t i, cairn_transform map_scan, cairn_vec2 *from, cairn_vec2 *to,
                            int32_t *hit)
{
    cairn_vec2 end = {(cairn_real)scan->ends[2 * i], (cairn_real)scan->ends[2 * i + 1]};
    cairn_vec2 along = cairn_vec2_sub(end, scan->sensor);
    cairn_real length = cairn_vec2_norm(along);

    *hit = scan->hits[i];
    if (!*hit && length > params->max_free_range + FREE_TOLERANCE_M)
        return 0;
    if (length > params->max_range) {
        end = cairn_vec2_add(scan->sensor, cairn_vec2_scale(along, params->max_range / length));
        *hit = 0;
    }
    *from = cairn_transform_point(map_scan, scan->sensor);
    *to = cairn_transform_point(map_scan, end);
    return length > 0;
}

cairn_box cairn_scan_map_bounds(const cairn_scan_map_params *params,
                                const cairn_scan_map_scan *scan, cairn_box box)
{
    cairn_transform map_scan = cairn_transform_of(scan->map_scan);
    cairn_vec2 from, to;
    int32_t hit;

    box = cairn_box_extend(box, cairn_transform_point(map_scan, scan->sensor));
    for (int32_t i = 0; i < scan->beam_count; i++)
        if (cairn_scan_map_beam(params, scan, i, map_scan, &from, &to, &hit))
            box = cairn_box_extend(box, to);
    return box;
}

/* ---- Walls ---- */

static int has_wall(const cairn_scan_map *map, int32_t cell)
{
    return (int)(map->walls[cell / WORD_BITS] >> (cell % WORD_BITS) & 1U);
}

/* Marks an occupied cell and those beside it. */
static void mark_wall(cairn_scan_map *map, int32_t x, int32_t y)
{
    const int32_t width = map->layout.width, height = map->layout.height;

    for (int32_t v = y - WALL_MARGIN_CELLS; v <= y + WALL_MARGIN_CELLS; v++)
        for (int32_t u = x - WALL_MARGIN_CELLS; u <= x + WALL_MARGIN_CELLS; u++)
            if (u >= 0 && u < width && v >= 0 && v < height) {
                int32_t cell = v * width + u;

                map->walls[cell / WORD_BITS] |= 1U << (cell % WORD_BITS);
            }
}

/* Clears some words of the mask, from the current one on. */
static void clear_words(cairn_scan_map *map, int32_t words)
{
    int32_t left = words - map->cell;

    memset(map->walls + map->cell, 0,
           (size_t)(left < CLEARED_WORDS_PER_UNIT ? left : CLEARED_WORDS_PER_UNIT) *
               sizeof *map->walls);
}

/* Marks the walls of some cells of the grid, from the current one on. */
static void mark_walls(cairn_scan_map *map, int32_t cells)
{
    const cairn_real occupied = cairn_occupancy_grid_thresholds_default().occupied;

    for (int32_t i = map->cell; i < map->cell + CELLS_PER_UNIT && i < cells; i++) {
        int32_t x = i % map->layout.width, y = i / map->layout.width;

        if (cairn_occupancy_grid_probability(map->grid, x, y) >= occupied)
            mark_wall(map, x, y);
    }
}

/* Marks the walls of the grid. */
static int find_walls(cairn_scan_map *map, cairn_budget *budget)
{
    const int32_t cells = map->layout.width * map->layout.height, words = words_of(cells);

    CAIRN_STEP_BEGIN(map->phase_resume);
    for (map->cell = 0; map->cell < words; map->cell += CLEARED_WORDS_PER_UNIT) {
        CAIRN_STEP_CHARGE_UNIT(map, phase_resume, budget);
        clear_words(map, words);
    }
    for (map->cell = 0; map->cell < cells; map->cell += CELLS_PER_UNIT) {
        CAIRN_STEP_CHARGE_UNIT(map, phase_resume, budget);
        mark_walls(map, cells);
    }
    map->has_walls = 1;
    CAIRN_STEP_END(map->phase_resume);
}

/* ---- Making the map ---- */

/* Prepares the current beam; 0 when it says nothing. */
static int begin_beam(cairn_scan_map *map)
{
    const cairn_scan_map_scan *scan = &map->scans[map->scan];
    cairn_scan_beam *beam = &map->current;
    cairn_real cells;
    int32_t hit;

    if (!cairn_scan_map_beam(&map->params, scan, map->beam, map->map_scan, &beam->from, &beam->to,
                             &hit))
        return 0;
    beam->kind = hit ? CAIRN_SCAN_BEAM_HIT : CAIRN_SCAN_BEAM_FREE;
    map->sample = map->samples = map->has_left = 0;
    if (map->has_walls && !scan->hits[map->beam]) {
        cells = cairn_vec2_norm(cairn_vec2_sub(beam->to, beam->from)) / map->layout.resolution;
        map->samples = cairn_real_to_int(cairn_min(cells * SAMPLES_PER_CELL, MAX_SAMPLES)) + 1;
        map->last = beam->from;
    }
    return 1;
}

/* Tests the next samples of the beam; 1 when map->last is its end: it meets a wall, or has no
 * further sample. */
static int test_samples(cairn_scan_map *map)
{
    const cairn_scan_beam *beam = &map->current;

    for (int32_t i = 0; i < SAMPLES_PER_UNIT && map->sample < map->samples; i++) {
        cairn_real share = (cairn_real)++map->sample / (cairn_real)map->samples;
        cairn_vec2 p = cairn_vec2_interpolate(beam->from, beam->to, share);
        int32_t x, y;

        if (cairn_occupancy_grid_locate(map->grid, p, &x, &y)) {
            int is_wall = has_wall(map, y * map->layout.width + x);

            if (is_wall && map->has_left)
                return 1;
            map->has_left |= !is_wall;
        }
        map->last = p;
    }
    if (map->sample < map->samples)
        return 0;
    map->last = beam->to;
    return 1;
}

/* Ends the current beam before the first wall, where it has samples. */
static int stop_beam(cairn_scan_map *map, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(map->beam_resume);
    if (map->samples > 0) {
        do {
            CAIRN_STEP_CHARGE_UNIT(map, beam_resume, budget);
        } while (!test_samples(map));
        map->current.to = map->last;
    }
    CAIRN_STEP_END(map->beam_resume);
}

/* Adds the beams of all scans to the cleared grid. */
static int add_scans(cairn_scan_map *map, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(map->phase_resume);
    cairn_occupancy_grid_clear(map->grid);
    for (map->scan = 0; map->scan < map->count; map->scan++) {
        CAIRN_STEP_CHARGE_UNIT(map, phase_resume, budget);
        map->map_scan = cairn_transform_of(map->scans[map->scan].map_scan);
        for (map->beam = 0; map->beam < map->scans[map->scan].beam_count; map->beam++) {
            CAIRN_STEP_CHARGE_UNIT(map, phase_resume, budget);
            if (!begin_beam(map))
                continue;
            CAIRN_STEP_RUN(map, phase_resume, budget, stop_beam);
            map->status = cairn_occupancy_grid_begin_scan(map->grid, &map->current, 1,
                                                          cairn_pose_identity(), NULL);
            /* A refused beam ends the work here. */
            CAIRN_STEP_UNTIL(map->phase_resume,
                             map->status == CAIRN_OK &&
                                 cairn_occupancy_grid_step(map->grid, budget) == CAIRN_OK);
        }
    }
    CAIRN_STEP_UNTIL(map->phase_resume, cairn_occupancy_grid_step(map->grid, budget) == CAIRN_OK);
    CAIRN_STEP_END(map->phase_resume);
}

static int make_map(cairn_scan_map *map, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(map->resume);
    CAIRN_STEP_RUN(map, resume, budget, add_scans);
    if (map->params.stop_at_walls) {
        CAIRN_STEP_RUN(map, resume, budget, find_walls);
        CAIRN_STEP_RUN(map, resume, budget, add_scans);
    }
    CAIRN_STEP_END(map->resume);
}

cairn_status cairn_scan_map_begin(cairn_scan_map *map, cairn_occupancy_grid *grid,
                                  const cairn_scan_map_scan *scans, int32_t count,
                                  cairn_fault *fault)
{
    cairn_occupancy_grid_params layout;

    if (map == NULL || grid == NULL || count < 0 || (scans == NULL && count > 0))
        return cairn_refuse(fault, -1, "no map, no grid or no scans", CAIRN_BAD_ARGUMENT);
    layout = cairn_occupancy_grid_read(grid);
    if (map->params.stop_at_walls && layout.width * layout.height > map->params.max_cells)
        return cairn_refuse(fault, -1, "the grid has more than max_cells", CAIRN_FULL);
    for (int32_t i = 0; i < count; i++) {
        if (scans[i].beam_count < 0 ||
            (scans[i].beam_count > 0 && (scans[i].ends == NULL || scans[i].hits == NULL)))
            return cairn_refuse(fault, i, "a count below 0, or no beams", CAIRN_BAD_ARGUMENT);
        if (!cairn_pose_is_finite(scans[i].map_scan) || !cairn_vec2_is_finite(scans[i].sensor))
            return cairn_refuse(fault, i, "the pose or the sensor's position is not finite",
                                CAIRN_NOT_FINITE);
    }
    map->grid = grid;
    map->layout = layout;
    map->scans = scans;
    map->count = count;
    map->is_running = 1;
    map->has_walls = 0;
    map->status = CAIRN_OK;
    map->resume = map->phase_resume = map->beam_resume = 0;
    return CAIRN_OK;
}

cairn_status cairn_scan_map_step(cairn_scan_map *map, cairn_budget *budget)
{
    if (map == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (map->is_running && !make_map(map, budget))
        return map->status != CAIRN_OK ? map->status : CAIRN_MORE;
    map->is_running = 0;
    return CAIRN_OK;
}
