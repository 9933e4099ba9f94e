/* Occupancy grid by the beam-penetration model.
 *
 * Method.
 *
 * 1. A beam is clipped to the grid (Liang and Barsky 1984).
 * 2. Its cells are traversed (Amanatides and Woo 1987) in cell units; positions on a beam are
 *    shares of its length. The exit of a cell is computed from that cell's border alone, not from a
 *    running sum. The number of steps in x and y is fixed in advance by the last cell, so the
 *    traversal ends there whatever the rounding.
 * 3. Each chord is added to its cell's length, and the hit to the last cell.
 *
 * Layout: cells row by row from the lower left, 8 bytes each. Lengths are float in both builds:
 * relative error about 6e-8 times the square root of the beams.
 *
 * Limits: hits saturate at INT32_MAX; lengths stop growing when a cell holds 1.6e7 times its
 * chord. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/occupancy_grid.h"
#include "src/base/object.h"
#include "src/base/step.h"

enum { CELLS_PER_UNIT = 2, CLEARED_PER_UNIT = 64 };

struct cairn_occupancy_grid {
    cairn_occupancy_grid_cell_state *cells; /* [height][width] */
    cairn_occupancy_grid_params params;
    cairn_real inverse_resolution;
    int32_t count;   /* number of cells */
    int32_t cleared; /* cells cleared so far; == count: nothing to clear */
    /* The scan in progress. */
    const cairn_scan_beam *beams; /* [beams_left] */
    int32_t beams_left;
    cairn_transform map_scan;
    cairn_occupancy_grid_ray walk; /* of the first of them */
    int32_t resume, units_charged;
};

#define INTEGER(field, is, from, to) CAIRN_INTEGER(cairn_occupancy_grid_params, field, is, from, to)
#define COORDINATE(field, is)                                                                      \
    CAIRN_NUMBER(cairn_occupancy_grid_params, field, is, -CAIRN_REAL_MAX, CAIRN_REAL_MAX)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(width, 400, 1, CAIRN_RASTER_MAX_SIDE),
    INTEGER(height, 400, 1, CAIRN_RASTER_MAX_SIDE),
    /* Of a finite reciprocal. */
    CAIRN_NUMBER_ABOVE(cairn_occupancy_grid_params, resolution, CAIRN_REAL(0.05),
                       1 / CAIRN_REAL_MAX, CAIRN_REAL_MAX),
    COORDINATE(origin.x, -10),
    COORDINATE(origin.y, -10),
};
extern const cairn_parameters cairn_occupancy_grid_parameters;
const cairn_parameters cairn_occupancy_grid_parameters =
    CAIRN_PARAMETERS("occupancy_grid", cairn_occupancy_grid_params, rows);

cairn_occupancy_grid_params cairn_occupancy_grid_default(void)
{
    cairn_occupancy_grid_params params;

    cairn_parameters_preset(&cairn_occupancy_grid_parameters, &params);
    return params;
}

cairn_status cairn_occupancy_grid_check(const cairn_occupancy_grid_params *params,
                                        cairn_object_fault *fault)
{
    cairn_status status = cairn_parameters_check(&cairn_occupancy_grid_parameters, params, fault);

    if (status == CAIRN_OK)
        status = cairn_parameters_require(
            cairn_is_finite(params->origin.x + (cairn_real)params->width * params->resolution) &&
                cairn_is_finite(params->origin.y + (cairn_real)params->height * params->resolution),
            "occupancy_grid", "origin: the upper right corner of the grid is finite", fault);
    return status;
}

/* The object and its cells; NULL from a counting pool. */
static cairn_occupancy_grid *build(cairn_pool *pool, const cairn_occupancy_grid_params *params)
{
    size_t cells = (size_t)params->width * (size_t)params->height;
    cairn_occupancy_grid *grid = cairn_object_take(pool, sizeof *grid);

    CAIRN_TAKE(grid, pool, cells, cells);
    if (grid != NULL) {
        grid->params = *params;
        grid->inverse_resolution = 1 / params->resolution;
        grid->count = grid->cleared = params->width * params->height;
        memset(grid->cells, 0, cells * sizeof *grid->cells);
    }
    return grid;
}

CAIRN_OBJECT(occupancy_grid, occupancy_grid, build);

cairn_occupancy_grid_params cairn_occupancy_grid_read(const cairn_occupancy_grid *grid)
{
    return grid->params;
}

/* ---- Ray traversal ---- */

/* Returns a point in cell units from the lower left corner. */
static cairn_vec2 in_cells(const cairn_occupancy_grid *grid, cairn_vec2 p)
{
    return cairn_vec2_scale(cairn_vec2_sub(p, grid->params.origin), grid->inverse_resolution);
}

/* Returns 1 and the length of the beam; 0 when the traversal would not be finite. */
static int can_walk(const cairn_occupancy_grid *grid, cairn_vec2 from, cairn_vec2 to,
                    cairn_real *length)
{
    cairn_vec2 a = in_cells(grid, from), b = in_cells(grid, to);
    cairn_real norm = cairn_vec2_norm(cairn_vec2_sub(to, from));

    /* A difference of two infinities is a NaN, so the sum shows whether all are finite. */
    if (!cairn_is_finite(norm) || !cairn_is_finite(b.x - a.x) || !cairn_is_finite(b.y - a.y))
        return 0;
    *length = norm;
    return 1;
}

/* Liang-Barsky clipping along one axis: narrows the shares to 0 <= from + share * delta <= size;
 * returns 0 when nothing is left. */
static int clip(cairn_real from, cairn_real delta, int32_t size, cairn_real *start, cairn_real *end)
{
    cairn_real enter, leave;

    if (delta == 0)
        return from >= 0 && from < (cairn_real)size;
    enter = -from / delta;
    leave = ((cairn_real)size - from) / delta;
    if (delta < 0) {
        cairn_real other = enter;

        enter = leave;
        leave = other;
    }
    *start = cairn_max(*start, enter);
    *end = cairn_min(*end, leave);
    return *start <= *end;
}

static int32_t cell_of(cairn_real coordinate, int32_t size)
{
    return cairn_real_to_int(cairn_min(cairn_max(coordinate, 0), (cairn_real)(size - 1)));
}

cairn_status cairn_occupancy_grid_walk(const cairn_occupancy_grid *grid, cairn_vec2 from,
                                       cairn_vec2 to, cairn_occupancy_grid_ray *walk)
{
    int32_t width = grid->params.width, height = grid->params.height;
    cairn_real start = 0, end = 1, length;
    cairn_vec2 a, b, delta;

    if (!can_walk(grid, from, to, &length))
        return CAIRN_NOT_FINITE;
    a = in_cells(grid, from);
    b = in_cells(grid, to);
    delta = cairn_vec2_sub(b, a);
    if (!clip(a.x, delta.x, width, &start, &end) || !clip(a.y, delta.y, height, &start, &end))
        return CAIRN_EMPTY;
    walk->from_x = a.x;
    walk->from_y = a.y;
    walk->inverse_x = delta.x != 0 ? 1 / delta.x : 0;
    walk->inverse_y = delta.y != 0 ? 1 / delta.y : 0;
    walk->share = start;
    walk->share_end = end;
    walk->length = length;
    walk->x = cell_of(a.x + start * delta.x, width);
    walk->y = cell_of(a.y + start * delta.y, height);
    walk->ends_inside = b.x >= 0 && b.x < (cairn_real)width && b.y >= 0 && b.y < (cairn_real)height;
    walk->end_x = cell_of(walk->ends_inside ? b.x : a.x + end * delta.x, width);
    walk->end_y = cell_of(walk->ends_inside ? b.y : a.y + end * delta.y, height);
    walk->step_x = walk->end_x < walk->x ? -1 : 1;
    walk->step_y = walk->end_y < walk->y ? -1 : 1;
    walk->done = 0;
    return CAIRN_OK;
}

int32_t cairn_occupancy_grid_ray_next(cairn_occupancy_grid_ray *walk,
                                      cairn_occupancy_grid_chord *chord)
{
    cairn_real leave = walk->share_end;
    int32_t in_x = 0;

    if (walk->done)
        return 0;
    chord->x = walk->x;
    chord->y = walk->y;
    if (walk->x == walk->end_x && walk->y == walk->end_y) {
        walk->done = 1;
    } else {
        /* Shares at which the beam crosses the next border in x and in y. */
        cairn_real next_x =
            ((cairn_real)(walk->x + (walk->step_x > 0)) - walk->from_x) * walk->inverse_x;
        cairn_real next_y =
            ((cairn_real)(walk->y + (walk->step_y > 0)) - walk->from_y) * walk->inverse_y;

        in_x = walk->y == walk->end_y || (walk->x != walk->end_x && next_x <= next_y);
        leave = cairn_min(in_x ? next_x : next_y, walk->share_end);
        if (in_x)
            walk->x += walk->step_x;
        else
            walk->y += walk->step_y;
    }
    /* Rounding must not reverse the beam. */
    leave = cairn_max(leave, walk->share);
    chord->length = (leave - walk->share) * walk->length;
    walk->share = leave;
    return 1;
}

/* ---- Adding beams ---- */

/* Adds up to `cells` cells of the traversal; returns 1 when it is finished. */
static int add_cells(cairn_occupancy_grid *grid, cairn_occupancy_grid_ray *walk, int hit,
                     int32_t cells)
{
    cairn_occupancy_grid_chord chord;

    for (int32_t i = 0; i < cells && cairn_occupancy_grid_ray_next(walk, &chord); i++) {
        cairn_occupancy_grid_cell_state *cell =
            &grid->cells[chord.y * grid->params.width + chord.x];

        cell->length += (float)chord.length;
        if (walk->done && hit && walk->ends_inside && cell->hits < INT32_MAX)
            cell->hits++;
    }
    return walk->done;
}

static int is_busy(const cairn_occupancy_grid *grid)
{
    return grid->cleared < grid->count || grid->beams_left > 0;
}

cairn_status cairn_occupancy_grid_add_beam(cairn_occupancy_grid *grid, cairn_vec2 from,
                                           cairn_vec2 to, int32_t hit)
{
    cairn_occupancy_grid_ray walk;
    cairn_status status;

    if (grid == NULL || is_busy(grid))
        return CAIRN_BAD_ARGUMENT;
    status = cairn_occupancy_grid_walk(grid, from, to, &walk);
    if (status != CAIRN_OK)
        return status == CAIRN_EMPTY ? CAIRN_OK : status;
    (void)add_cells(grid, &walk, hit != 0, INT32_MAX);
    return CAIRN_OK;
}

cairn_status cairn_occupancy_grid_begin_scan(cairn_occupancy_grid *grid,
                                             const cairn_scan_beam *beams, int32_t count,
                                             cairn_pose map_scan, cairn_fault *fault)
{
    cairn_transform transform;
    cairn_real length;
    cairn_status status;

    if (grid == NULL || count < 0 || (beams == NULL && count > 0))
        return cairn_refuse(fault, -1, "no grid or no beams", CAIRN_BAD_ARGUMENT);
    if (grid->beams_left > 0)
        return cairn_refuse(fault, -1, "the previous scan is in progress", CAIRN_BAD_ARGUMENT);
    status = cairn_pose_check(map_scan, CAIRN_REAL_MAX, fault);
    if (status != CAIRN_OK)
        return status;
    transform = cairn_transform_of(map_scan);
    for (int32_t i = 0; i < count; i++) {
        if (beams[i].kind != CAIRN_SCAN_BEAM_HIT && beams[i].kind != CAIRN_SCAN_BEAM_FREE &&
            beams[i].kind != CAIRN_SCAN_BEAM_UNKNOWN)
            return cairn_refuse(fault, i, "unknown kind of beam, expected hit, free or unknown",
                                CAIRN_BAD_ARGUMENT);
        if (beams[i].kind != CAIRN_SCAN_BEAM_UNKNOWN &&
            !can_walk(grid, cairn_transform_point(transform, beams[i].from),
                      cairn_transform_point(transform, beams[i].to), &length))
            return cairn_refuse(fault, i, "a beam end is not finite, expected finite coordinates",
                                CAIRN_NOT_FINITE);
    }
    grid->beams = beams;
    grid->beams_left = count;
    grid->map_scan = transform;
    grid->resume = grid->units_charged = 0;
    return CAIRN_OK;
}

void cairn_occupancy_grid_clear(cairn_occupancy_grid *grid)
{
    grid->cleared = 0;
    grid->beams_left = 0;
    grid->resume = grid->units_charged = 0;
}

/* Clears as many cells as the budget has units for; 1 when all are cleared. */
static int clear_cells(cairn_occupancy_grid *grid, cairn_budget *budget)
{
    int32_t left = grid->count - grid->cleared;
    int32_t wanted = left / CLEARED_PER_UNIT + (left % CLEARED_PER_UNIT > 0),
            units = cairn_budget_take(budget, wanted);

    if (units < wanted)
        left = units * CLEARED_PER_UNIT;
    memset(grid->cells + grid->cleared, 0, (size_t)left * sizeof *grid->cells);
    grid->cleared += left;
    return grid->cleared == grid->count;
}

/* Begins the traversal of the current beam; 0 when it has no cell. */
static int begin_beam(cairn_occupancy_grid *grid)
{
    const cairn_scan_beam *beam = grid->beams;

    return beam->kind != CAIRN_SCAN_BEAM_UNKNOWN &&
           cairn_occupancy_grid_walk(grid, cairn_transform_point(grid->map_scan, beam->from),
                                     cairn_transform_point(grid->map_scan, beam->to),
                                     &grid->walk) == CAIRN_OK;
}

/* Adds the beams of the scan. */
static int add_beams(cairn_occupancy_grid *grid, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(grid->resume);
    for (; grid->beams_left > 0; grid->beams++, grid->beams_left--) {
        CAIRN_STEP_CHARGE(grid, resume, budget, 1);
        if (!begin_beam(grid))
            continue;
        do {
            CAIRN_STEP_CHARGE(grid, resume, budget, 1);
        } while (!add_cells(grid, &grid->walk, grid->beams->kind == CAIRN_SCAN_BEAM_HIT,
                            CELLS_PER_UNIT));
    }
    CAIRN_STEP_END(grid->resume);
}

cairn_status cairn_occupancy_grid_step(cairn_occupancy_grid *grid, cairn_budget *budget)
{
    return clear_cells(grid, budget) && add_beams(grid, budget) ? CAIRN_OK : CAIRN_MORE;
}

/* ---- Reading ---- */

int32_t cairn_occupancy_grid_locate(const cairn_occupancy_grid *grid, cairn_vec2 point, int32_t *x,
                                    int32_t *y)
{
    cairn_vec2 p = in_cells(grid, point);

    if (!(p.x >= 0 && p.x < (cairn_real)grid->params.width && p.y >= 0 &&
          p.y < (cairn_real)grid->params.height))
        return 0;
    *x = cairn_real_to_int(p.x);
    *y = cairn_real_to_int(p.y);
    return 1;
}

cairn_occupancy_grid_cell_state cairn_occupancy_grid_cell(const cairn_occupancy_grid *grid,
                                                          int32_t x, int32_t y)
{
    cairn_occupancy_grid_cell_state none = {0};

    if (x < 0 || x >= grid->params.width || y < 0 || y >= grid->params.height)
        return none;
    return grid->cells[y * grid->params.width + x];
}

static int is_seen(cairn_occupancy_grid_cell_state cell)
{
    return cell.hits > 0 || cell.length > 0;
}

cairn_real cairn_occupancy_grid_probability(const cairn_occupancy_grid *grid, int32_t x, int32_t y)
{
    cairn_occupancy_grid_cell_state cell = cairn_occupancy_grid_cell(grid, x, y);

    if (!is_seen(cell))
        return -1;
    if (!(cell.length > 0))
        return 1;
    return 1 -
           cairn_exp(-grid->params.resolution * (cairn_real)cell.hits / (cairn_real)cell.length);
}

cairn_occupancy_grid_thresholds cairn_occupancy_grid_thresholds_default(void)
{
    cairn_occupancy_grid_thresholds thresholds = {CAIRN_REAL(0.25), CAIRN_REAL(0.1)};
    return thresholds;
}

cairn_status cairn_occupancy_grid_classify(const cairn_occupancy_grid *grid,
                                           cairn_occupancy_grid_thresholds thresholds,
                                           int32_t first_row, cairn_raster_u8 out)
{
    cairn_real occupied, free;

    if (grid == NULL || cairn_raster_u8_check(cairn_raster_u8_as_view(out)) != CAIRN_OK ||
        out.width != grid->params.width || first_row < 0 ||
        first_row > grid->params.height - out.height || !(thresholds.free > 0) ||
        !(thresholds.free <= thresholds.occupied) || !(thresholds.occupied < 1))
        return CAIRN_BAD_ARGUMENT;
    /* p >= t is equivalent to res h >= -log(1 - t) d: two logarithms instead of one exponential per
     * cell. */
    occupied = -cairn_log(1 - thresholds.occupied);
    free = -cairn_log(1 - thresholds.free);
    for (int32_t y = 0; y < out.height; y++) {
        const cairn_occupancy_grid_cell_state *cells =
            grid->cells + (first_row + y) * grid->params.width;
        uint8_t *row = out.data + y * out.stride;

        for (int32_t x = 0; x < out.width; x++) {
            cairn_real stopped = grid->params.resolution * (cairn_real)cells[x].hits;
            cairn_real passed = (cairn_real)cells[x].length;

            row[x] = CAIRN_OCCUPANCY_GRID_UNKNOWN;
            if (is_seen(cells[x]) && stopped >= occupied * passed)
                row[x] = CAIRN_OCCUPANCY_GRID_OCCUPIED;
            else if (is_seen(cells[x]) && stopped <= free * passed)
                row[x] = CAIRN_OCCUPANCY_GRID_FREE;
        }
    }
    return CAIRN_OK;
}
