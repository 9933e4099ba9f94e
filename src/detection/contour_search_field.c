/* Oriented distance field: edge proximity per direction and position around an object.
 *
 * Method:
 * 1. A window around the object has cells that are a share of its size, so that all objects cost
 *    the same.
 * 2. Every segment is rasterized in the direction bins near its own, at a cost by angle and
 *    strength rank.
 * 3. Minimum costs are propagated a few sigmas along rows, then along columns (separable distance
 *    transform).
 * 4. Costs become edge proximities, exp(-cost). The background likelihood of a direction is their
 *    mean over the window. */
#include "src/base/build.h"

#include <string.h>

#include "src/detection/contour_search_fit.h"

/* Cells per object size. */
enum { CELLS_PER_SIZE = 128 };
/* Standard deviations: position, in cells, and direction, rad. */
static const cairn_real SIGMA_CELLS = 2, ANGLE_SIGMA = CAIRN_REAL(0.35);
/* A segment contributes to directions within this many sigmas. */
static const cairn_real MAX_ANGLE_SIGMAS = CAIRN_REAL(2.2);
/* Propagation radius of a cost, cells. */
enum { SPREAD_CELLS = 5 };
/* Lower bound of the likelihood ratio 2 s of an edge of strength rank s in [0, 1], object against
 * background. */
static const cairn_real MIN_STRENGTH_RATIO = CAIRN_REAL(0.2);
/* Least background likelihood. */
static const cairn_real MIN_BACKGROUND = CAIRN_REAL(0.02);

enum {
    FIELD_SIDE = CONTOUR_SEARCH_FIELD_SIDE,
    DIRECTION_BINS = CONTOUR_SEARCH_FIELD_BINS,
    PLANE_CELLS = FIELD_SIDE * FIELD_SIDE,
    CELLS = DIRECTION_BINS * PLANE_CELLS
};

/* Phases; those from ROWS to MEAN are run for each direction. */
enum {
    PHASE_CLEAR,
    PHASE_RASTERIZE,
    PHASE_ROWS,
    PHASE_COPY,
    PHASE_COLUMNS,
    PHASE_MEAN,
    PHASE_DONE
};
/* Units of a direction that is cleared or copied, and of a row that is transformed or averaged. */
enum {
    UNITS_PER_CLEAR = 900,
    UNITS_PER_COPY = 400,
    UNITS_PER_TRANSFORM = 60,
    UNITS_PER_MEAN = 130
};
enum { CELLS_PER_UNIT = 12 };

/* Initializes the costs of one direction to out of reach. */
static void clear_costs(cairn_real *cost)
{
    for (int32_t i = 0; i < FIELD_SIDE * FIELD_SIDE; i++)
        cost[i] = CONTOUR_SEARCH_FIELD_MAX_COST;
}

/* Rasterizes a line into the cells of one direction, from step field->row on; 0: the budget is used
 * up. */
static int rasterize_line(contour_search_field *field, cairn_segment line, cairn_real *cost,
                          cairn_real line_cost, cairn_budget *budget)
{
    cairn_real length = cairn_segment_length(line);
    int32_t steps = 1 + cairn_real_to_int(2 * length / field->cell_size);

    while (field->row <= steps) {
        if (budget->left <= 0)
            return 0;
        budget->left--;
        for (int32_t i = 0; i < CELLS_PER_UNIT && field->row <= steps; i++, field->row++) {
            cairn_real share = (cairn_real)field->row / (cairn_real)steps;
            cairn_vec2 p =
                cairn_vec2_add(line.a, cairn_vec2_scale(cairn_vec2_sub(line.b, line.a), share));
            int32_t x = cairn_real_to_int(cairn_floor((p.x - field->corner.x) / field->cell_size)),
                    y = cairn_real_to_int(cairn_floor((p.y - field->corner.y) / field->cell_size));

            if (x >= 0 && y >= 0 && x < FIELD_SIDE && y < FIELD_SIDE)
                cost[y * FIELD_SIDE + x] = cairn_min(cost[y * FIELD_SIDE + x], line_cost);
        }
    }
    field->row = 0;
    return 1;
}

static int is_outside(const contour_search_field *field, cairn_segment line)
{
    cairn_real side = FIELD_SIDE * field->cell_size;

    return cairn_max(line.a.x, line.b.x) < field->corner.x ||
           cairn_min(line.a.x, line.b.x) > field->corner.x + side ||
           cairn_max(line.a.y, line.b.y) < field->corner.y ||
           cairn_min(line.a.y, line.b.y) > field->corner.y + side;
}

/* Rasterizes a segment in the direction bins near its own, from field->bin on; 0: the budget is used
 * up. */
static int rasterize_segment(contour_search_field *field, cairn_segment line, cairn_real strength,
                             cairn_budget *budget)
{
    cairn_real angle = cairn_atan2(line.b.y - line.a.y, line.b.x - line.a.x);
    cairn_real strength_cost = -cairn_log(cairn_max(MIN_STRENGTH_RATIO, 2 * strength));

    for (; field->bin < DIRECTION_BINS; field->bin++) {
        cairn_real deviation =
            cairn_contour_search_field_deviation(angle, field->bin) / ANGLE_SIGMA;

        if (cairn_abs(deviation) <= MAX_ANGLE_SIGMAS &&
            !rasterize_line(field, line, &field->value[field->bin * PLANE_CELLS],
                            strength_cost + deviation * deviation / 2, budget))
            return 0;
    }
    field->bin = 0;
    return 1;
}

/* One-dimensional distance transform of FIELD_SIDE cells: minimum over up to SPREAD_CELLS steps to
 * either side. */
static void distance_transform_1d(cairn_real *cost, const cairn_real *previous, int32_t step)
{
    memcpy(cost, previous, FIELD_SIDE * sizeof *cost);
    for (int32_t k = 1; k <= SPREAD_CELLS; k++) {
        const cairn_real *low = previous - k * step, *high = previous + k * step;
        cairn_real distance_cost = (cairn_real)(k * k) / (2 * SIGMA_CELLS * SIGMA_CELLS);

        for (int32_t i = 0; i < FIELD_SIDE; i++)
            cost[i] = cairn_min(cost[i], cairn_min(low[i], high[i]) + distance_cost);
    }
}

/* Returns 1 when any of `count` cells has an edge. */
static int has_edge(const cairn_real *cost, int32_t count)
{
    int32_t i = 0;

    while (i < count && !(cost[i] < CONTOUR_SEARCH_FIELD_MAX_COST))
        i++;
    return i < count;
}

/* Distance transform along a row of cells. Returns 0 for one without edges. */
static int transform_row(cairn_real *row)
{
    cairn_real line[FIELD_SIDE + 2 * SPREAD_CELLS];

    if (!has_edge(row, FIELD_SIDE))
        return 0;
    for (int32_t i = 0; i < SPREAD_CELLS; i++)
        line[i] = line[FIELD_SIDE + SPREAD_CELLS + i] = CONTOUR_SEARCH_FIELD_MAX_COST;
    memcpy(&line[SPREAD_CELLS], row, FIELD_SIDE * sizeof *line);
    distance_transform_1d(row, &line[SPREAD_CELLS], 1);
    return 1;
}

/* Copies the costs of a direction, with borders above and below. */
static void copy_plane(const cairn_real *cost, cairn_real *plane)
{
    for (int32_t i = 0; i < SPREAD_CELLS * FIELD_SIDE; i++)
        plane[i] = plane[(FIELD_SIDE + SPREAD_CELLS) * FIELD_SIDE + i] =
            CONTOUR_SEARCH_FIELD_MAX_COST;
    memcpy(&plane[SPREAD_CELLS * FIELD_SIDE], cost, sizeof *plane * PLANE_CELLS);
}

/* Converts a row of costs to edge proximities, and adds them to a sum. Neighbours of equal cost share
 * the exponential. */
static cairn_real convert_row(cairn_real sum, cairn_real *row)
{
    cairn_real last_cost = CONTOUR_SEARCH_FIELD_MAX_COST, last = cairn_exp(-last_cost);

    for (int32_t i = 0; i < FIELD_SIDE; i++) {
        cairn_real clipped = cairn_min(row[i], CONTOUR_SEARCH_FIELD_MAX_COST);

        if (clipped != last_cost) {
            last_cost = clipped;
            last = cairn_exp(-clipped);
        }
        row[i] = last;
        sum += last;
    }
    return sum;
}

void cairn_contour_search_field_take(contour_search_field *field, cairn_pool *pool)
{
    CAIRN_TAKE(field, pool, value, CELLS);
    CAIRN_TAKE(field, pool, is_llr, CELLS / 32);
    CAIRN_TAKE(field, pool, plane, (FIELD_SIDE + 2 * SPREAD_CELLS) * FIELD_SIDE);
}

void cairn_contour_search_field_begin(contour_search_field *field,
                                      const cairn_contour_search_tokens *tokens, cairn_vec2 origin,
                                      cairn_real size)
{
    cairn_real half;

    field->tokens = tokens;
    field->cell_size = size / CELLS_PER_SIZE;
    half = FIELD_SIDE * field->cell_size / 2;
    field->corner.x = origin.x - half;
    field->corner.y = origin.y - half;
    memset(field->is_llr, 0, CELLS / 32 * sizeof *field->is_llr);
    field->phase = PHASE_CLEAR;
    field->cursor = field->bin = field->row = field->units_charged = 0;
}

static cairn_status step_clear(contour_search_field *field, cairn_budget *budget)
{
    for (; field->cursor < DIRECTION_BINS; field->cursor++) {
        if (!cairn_budget_charge(budget, &field->units_charged, UNITS_PER_CLEAR))
            return CAIRN_MORE;
        clear_costs(&field->value[field->cursor * PLANE_CELLS]);
    }
    return CAIRN_OK;
}

static cairn_status step_rasterize(contour_search_field *field, cairn_budget *budget)
{
    const cairn_contour_search_tokens *tokens = field->tokens;

    for (; field->cursor < tokens->count; field->cursor++) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        if (is_outside(field, tokens->lines[field->cursor]))
            budget->left--;
        else if (!rasterize_segment(field, tokens->lines[field->cursor],
                                    tokens->strength_rank[field->cursor], budget))
            return CAIRN_MORE;
    }
    return CAIRN_OK;
}

/* Units of one item of a phase. */
static int32_t units_of(int32_t phase)
{
    return phase == PHASE_COPY   ? UNITS_PER_COPY
           : phase == PHASE_MEAN ? UNITS_PER_MEAN
                                 : UNITS_PER_TRANSFORM;
}

/* One item of a direction: a row, or the copy of its plane. */
static void run_item(contour_search_field *field)
{
    cairn_real *cost = &field->value[field->bin * PLANE_CELLS],
               *row = &cost[field->row * FIELD_SIDE];

    switch (field->phase) {
    case PHASE_ROWS:
        field->has_edge |= transform_row(row);
        break;
    case PHASE_COPY:
        copy_plane(cost, field->plane);
        break;
    case PHASE_COLUMNS:
        distance_transform_1d(row, &field->plane[(SPREAD_CELLS + field->row) * FIELD_SIDE],
                              FIELD_SIDE);
        break;
    default:
        field->sum = convert_row(field->sum, row);
        break;
    }
}

/* Goes to the next phase of a direction, or to the next direction. */
static void end_phase(contour_search_field *field)
{
    field->row = 0;
    if (field->phase == PHASE_ROWS && !field->has_edge)
        field->phase = PHASE_MEAN;
    else if (field->phase < PHASE_MEAN)
        field->phase++;
    else {
        field->background[field->bin] = cairn_max(MIN_BACKGROUND, field->sum / PLANE_CELLS);
        field->bin++;
        field->phase = PHASE_ROWS;
        field->has_edge = 0;
        field->sum = 0;
    }
}

static cairn_status step_directions(contour_search_field *field, cairn_budget *budget)
{
    while (field->bin < DIRECTION_BINS) {
        if (!cairn_budget_charge(budget, &field->units_charged, units_of(field->phase)))
            return CAIRN_MORE;
        run_item(field);
        field->row++;
        if (field->row == FIELD_SIDE || field->phase == PHASE_COPY)
            end_phase(field);
    }
    return CAIRN_OK;
}

cairn_status cairn_contour_search_field_step(contour_search_field *field, cairn_budget *budget)
{
    while (field->phase < PHASE_DONE) {
        cairn_status status = field->phase == PHASE_CLEAR       ? step_clear(field, budget)
                              : field->phase == PHASE_RASTERIZE ? step_rasterize(field, budget)
                                                                : step_directions(field, budget);

        if (status != CAIRN_OK)
            return status;
        field->phase = field->phase == PHASE_CLEAR       ? PHASE_RASTERIZE
                       : field->phase == PHASE_RASTERIZE ? PHASE_ROWS
                                                         : PHASE_DONE;
        field->cursor = 0;
        field->has_edge = 0;
        field->sum = 0;
    }
    return CAIRN_OK;
}

cairn_real cairn_contour_search_field_deviation(cairn_real angle, int32_t bin)
{
    const cairn_real half = CAIRN_PI / 2;
    cairn_real turned = angle - ((cairn_real)bin + CAIRN_REAL(0.5)) * (CAIRN_PI / DIRECTION_BINS);

    /* The angle is within half a turn of 0, so that one half turn or two suffice. */
    while (turned > half)
        turned -= CAIRN_PI;
    while (turned < -half)
        turned += CAIRN_PI;
    return turned;
}

int32_t cairn_contour_search_field_bin(cairn_vec2 direction)
{
    cairn_real angle = cairn_atan2(direction.y, direction.x);
    int32_t bin = cairn_real_to_int(cairn_floor(angle / (CAIRN_PI / DIRECTION_BINS)));

    return ((bin % DIRECTION_BINS) + DIRECTION_BINS) % DIRECTION_BINS;
}
