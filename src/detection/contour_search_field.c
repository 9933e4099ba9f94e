/* Oriented distance field: edge proximity per direction and position around an object.
 *
 * Method:
 * 1. A window around the object has cells that are a share of its size, so that all objects cost
 *    the same.
 * 2. Every segment is rasterized in the direction bins near its own, at a cost by angle and
 *    strength rank.
 * 3. Minimum costs are propagated a few sigmas along rows, then along columns (separable distance
 *    transform).
 * 4. Costs become edge proximities, exp(-cost); those of the last costs are kept, since few differ.
 *    The background likelihood of a direction is their mean over the window. */
#include "src/base/build.h"

#include <string.h>

#include "src/base/step.h"
#include "src/detection/contour_search_fit.h"

/* Cells per object size. */
enum { CELLS_PER_SIZE = 128 };
/* Standard deviation of the position, cells. */
static const cairn_real SIGMA_CELLS = 2;
/* Propagation radius of a cost, cells. */
enum { SPREAD_CELLS = 5 };

enum {
    FIELD_SIDE = CONTOUR_SEARCH_FIELD_SIDE,
    DIRECTION_BINS = CONTOUR_SEARCH_FIELD_BINS,
    PLANE_CELLS = FIELD_SIDE * FIELD_SIDE,
    FIELD_CELLS = DIRECTION_BINS * PLANE_CELLS
};

/* Units of a direction that is cleared or copied, and of a row that is transformed or averaged. */
enum {
    UNITS_PER_CLEAR = 900,
    UNITS_PER_COPY = 400,
    UNITS_PER_TRANSFORM = 60,
    UNITS_PER_MEAN = 130
};
/* Steps along a segment that are rasterized in a unit. */
enum { CELLS_PER_UNIT = 12 };

/* An edge proximity, kept for the cells of equal cost: a direction has few different costs. */
typedef struct kept_proximity {
    cairn_real cost, proximity;
} kept_proximity;
/* Number of proximities kept: of cost of each hash value the last one. */
enum { HASH_BITS = 9, KEPT_COUNT = 1 << HASH_BITS };

/* Initializes the costs of one direction to out of reach. */
static void clear_costs(cairn_real *cost)
{
    for (int32_t i = 0; i < FIELD_SIDE * FIELD_SIDE; i++)
        cost[i] = CONTOUR_SEARCH_FIELD_MAX_COST;
}

static int is_outside(const contour_search_field *field, cairn_segment line)
{
    cairn_real side = FIELD_SIDE * field->cell_size;

    return cairn_max(line.a.x, line.b.x) < field->corner.x ||
           cairn_min(line.a.x, line.b.x) > field->corner.x + side ||
           cairn_max(line.a.y, line.b.y) < field->corner.y ||
           cairn_min(line.a.y, line.b.y) > field->corner.y + side;
}

/* Starts on a segment: its direction, its cost by strength rank, and the steps along it. */
static void begin_segment(contour_search_field *field, cairn_segment line)
{
    contour_search_segment *segment = &field->segment;
    cairn_real length = cairn_segment_length(line),
               strength = field->tokens->strength_rank[segment->index];

    segment->angle = cairn_atan2(line.b.y - line.a.y, line.b.x - line.a.x);
    segment->strength_cost = -cairn_log(cairn_max(CONTOUR_SEARCH_MIN_STRENGTH_RATIO, 2 * strength));
    segment->steps = 1 + cairn_real_to_int(2 * length / field->cell_size);
}

/* Difference of the segment's direction from the middle of the direction bin, sigmas. */
static cairn_real deviation_of(const contour_search_field *field)
{
    return cairn_contour_search_field_deviation(field->segment.angle, field->bin) /
           CONTOUR_SEARCH_ANGLE_SIGMA;
}

/* Rasterizes the segment into the cells of the direction bin, CELLS_PER_UNIT steps from field->row
 * on. */
static void rasterize_steps(contour_search_field *field, cairn_segment line)
{
    cairn_real *cost = &field->value[field->bin * PLANE_CELLS], deviation = deviation_of(field),
               line_cost = field->segment.strength_cost + deviation * deviation / 2;

    for (int32_t k = field->row; k < field->row + CELLS_PER_UNIT && k <= field->segment.steps;
         k++) {
        cairn_real share = (cairn_real)k / (cairn_real)field->segment.steps;
        cairn_vec2 p = cairn_vec2_interpolate(line.a, line.b, share);
        int32_t x = cairn_real_to_int(cairn_floor((p.x - field->corner.x) / field->cell_size)),
                y = cairn_real_to_int(cairn_floor((p.y - field->corner.y) / field->cell_size));

        if (x >= 0 && y >= 0 && x < FIELD_SIDE && y < FIELD_SIDE)
            cost[y * FIELD_SIDE + x] = cairn_min(cost[y * FIELD_SIDE + x], line_cost);
    }
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

/* Hash of a cost's bits (multiplicative, Knuth 1973), 0 ... KEPT_COUNT - 1. */
static uint32_t hash_of(cairn_real cost)
{
    uint32_t words[sizeof cost / sizeof(uint32_t)] = {0}, hash = 0;

    memcpy(words, &cost, sizeof cost);
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        hash = (hash ^ words[i]) * UINT32_C(2654435769);
    return hash >> (32 - HASH_BITS);
}

/* Empties the kept proximities; no cost is infinite. */
static void forget_proximities(kept_proximity *kept)
{
    for (int32_t i = 0; i < KEPT_COUNT; i++)
        kept[i].cost = (cairn_real)INFINITY;
}

/* Converts a row of costs to edge proximities, and adds them to a sum. */
static cairn_real convert_row(cairn_real sum, cairn_real *row, kept_proximity *kept)
{
    for (int32_t i = 0; i < FIELD_SIDE; i++) {
        cairn_real clipped = cairn_min(row[i], CONTOUR_SEARCH_FIELD_MAX_COST);
        kept_proximity *k = &kept[hash_of(clipped)];

        if (k->cost != clipped) {
            k->cost = clipped;
            k->proximity = cairn_exp(-clipped);
        }
        row[i] = k->proximity;
        sum += k->proximity;
    }
    return sum;
}

void cairn_contour_search_field_take(contour_search_field *field, cairn_pool *pool)
{
    CAIRN_TAKE(field, pool, value, FIELD_CELLS);
    CAIRN_TAKE(field, pool, is_llr, FIELD_CELLS / 32);
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
    memset(field->is_llr, 0, FIELD_CELLS / 32 * sizeof *field->is_llr);
    field->resume = field->segment_resume = field->units_charged = 0;
}

/* A row of the direction. */
static cairn_real *row_of(contour_search_field *field)
{
    return &field->value[field->bin * PLANE_CELLS + field->row * FIELD_SIDE];
}

/* Rasterizes the segment in the direction bins near its own. */
static int rasterize_segment(contour_search_field *field, cairn_budget *budget)
{
    cairn_segment line = field->tokens->lines[field->segment.index];

    CAIRN_STEP_BEGIN(field->segment_resume);
    begin_segment(field, line);
    for (field->bin = 0; field->bin < DIRECTION_BINS; field->bin++) {
        if (cairn_abs(deviation_of(field)) > CONTOUR_SEARCH_MAX_ANGLE_SIGMAS)
            continue;
        for (field->row = 0; field->row <= field->segment.steps; field->row += CELLS_PER_UNIT) {
            CAIRN_STEP_CHARGE_UNIT(field, segment_resume, budget);
            rasterize_steps(field, line);
        }
    }
    CAIRN_STEP_END(field->segment_resume);
}

/* See Method in the head of this file. */
int cairn_contour_search_field_step(contour_search_field *field, cairn_budget *budget)
{
    /* Free after the transform of a direction. */
    kept_proximity *kept = (void *)field->plane;

    CAIRN_STEP_BEGIN(field->resume);
    for (field->bin = 0; field->bin < DIRECTION_BINS; field->bin++) {
        CAIRN_STEP_CHARGE(field, resume, budget, UNITS_PER_CLEAR);
        clear_costs(&field->value[field->bin * PLANE_CELLS]);
    }
    for (field->segment.index = 0; field->segment.index < field->tokens->count;
         field->segment.index++) {
        if (is_outside(field, field->tokens->lines[field->segment.index]))
            CAIRN_STEP_CHARGE_UNIT(field, resume, budget);
        else
            CAIRN_STEP_RUN(field, resume, budget, rasterize_segment);
    }
    for (field->bin = 0; field->bin < DIRECTION_BINS; field->bin++) {
        field->has_edge = 0;
        for (field->row = 0; field->row < FIELD_SIDE; field->row++) {
            CAIRN_STEP_CHARGE(field, resume, budget, UNITS_PER_TRANSFORM);
            field->has_edge |= transform_row(row_of(field));
        }
        if (field->has_edge) {
            CAIRN_STEP_CHARGE(field, resume, budget, UNITS_PER_COPY);
            copy_plane(&field->value[field->bin * PLANE_CELLS], field->plane);
        }
        for (field->row = 0; field->has_edge && field->row < FIELD_SIDE; field->row++) {
            CAIRN_STEP_CHARGE(field, resume, budget, UNITS_PER_TRANSFORM);
            distance_transform_1d(
                row_of(field), &field->plane[(SPREAD_CELLS + field->row) * FIELD_SIDE], FIELD_SIDE);
        }
        field->sum = 0;
        forget_proximities(kept);
        for (field->row = 0; field->row < FIELD_SIDE; field->row++) {
            CAIRN_STEP_CHARGE(field, resume, budget, UNITS_PER_MEAN);
            field->sum = convert_row(field->sum, row_of(field), kept);
        }
        field->background[field->bin] =
            cairn_max(CONTOUR_SEARCH_MIN_BACKGROUND, field->sum / PLANE_CELLS);
    }
    CAIRN_STEP_END(field->resume);
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
