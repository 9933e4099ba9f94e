/* Oriented distance field: edge proximity per direction and position around an object.
 *
 * Method:
 * 1. A window around the object has cells that are a share of its size, so that all objects cost
 *    the same.
 * 2. Every segment is rasterized in the direction bins near its own, at a cost by angle and
 *    strength rank.
 * 3. Minimum costs are propagated a few sigmas along rows, then along columns (separable distance
 *    transform).
 * 4. The background likelihood of a direction is its mean over the window. */
#include "src/base/build.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/detection/contour_search_fit.h"

/* Cells per object size. */
#define CELLS_PER_SIZE 128
/* Standard deviations: position, in cells, and direction, rad. */
#define SIGMA_CELLS 2.0
#define ANGLE_SIGMA 0.35
/* A segment contributes to directions within this many sigmas. */
#define MAX_ANGLE_SIGMAS 2.2
/* Propagation radius of a cost, cells. */
enum { SPREAD_CELLS = 5 };
/* Lower bound of the likelihood ratio 2 s of an edge of strength rank s in [0, 1], object against
 * background. */
#define MIN_STRENGTH_RATIO 0.2
/* Least background likelihood. */
#define MIN_BACKGROUND 0.02

enum { FIELD_SIDE = CONTOUR_SEARCH_FIELD_SIDE, DIRECTION_BINS = CONTOUR_SEARCH_FIELD_BINS };

/* Initializes the costs of one direction to out of reach. */
static void clear_costs(cairn_real *cost)
{
    for (int32_t i = 0; i < FIELD_SIDE * FIELD_SIDE; i++)
        cost[i] = CONTOUR_SEARCH_FIELD_MAX_COST;
}

/* Rasterizes a line into the cells of one direction. */
static void rasterize_line(contour_search_field *field, cairn_segment line, cairn_real *cost,
                           cairn_real line_cost)
{
    cairn_real length = cairn_segment_length(line);
    int32_t steps = 1 + (int32_t)(2 * length / field->cell_size);

    for (int32_t k = 0; k <= steps; k++) {
        cairn_vec2 p = cairn_vec2_add(line.a, cairn_vec2_scale(cairn_vec2_sub(line.b, line.a),
                                                               (cairn_real)k / (cairn_real)steps));
        int32_t x = (int32_t)floor((double)((p.x - field->corner.x) / field->cell_size)),
                y = (int32_t)floor((double)((p.y - field->corner.y) / field->cell_size));

        if (x >= 0 && y >= 0 && x < FIELD_SIDE && y < FIELD_SIDE)
            cost[y * FIELD_SIDE + x] = cairn_min(cost[y * FIELD_SIDE + x], line_cost);
    }
}

static int is_outside(const contour_search_field *field, cairn_segment line)
{
    cairn_real side = FIELD_SIDE * field->cell_size;

    return cairn_max(line.a.x, line.b.x) < field->corner.x ||
           cairn_min(line.a.x, line.b.x) > field->corner.x + side ||
           cairn_max(line.a.y, line.b.y) < field->corner.y ||
           cairn_min(line.a.y, line.b.y) > field->corner.y + side;
}

/* Rasterizes a segment in all direction bins near its own. */
static void rasterize_segment(contour_search_field *field, cairn_segment line, cairn_real strength)
{
    double angle = atan2((double)(line.b.y - line.a.y), (double)(line.b.x - line.a.x));
    double strength_cost = -log(fmax(MIN_STRENGTH_RATIO, 2 * (double)strength));

    for (int32_t bin = 0; bin < DIRECTION_BINS; bin++) {
        double deviation =
            remainder(angle - ((double)bin + 0.5) * ((double)CAIRN_PI / DIRECTION_BINS),
                      (double)CAIRN_PI) /
            ANGLE_SIGMA;

        if (fabs(deviation) <= MAX_ANGLE_SIGMAS)
            rasterize_line(field, line, &field->cost[(size_t)bin * FIELD_SIDE * FIELD_SIDE],
                           (cairn_real)(strength_cost + deviation * deviation / 2));
    }
}

/* One-dimensional distance transform of FIELD_SIDE cells: minimum over up to SPREAD_CELLS steps to
 * either side. */
static void distance_transform_1d(cairn_real *cost, const cairn_real *previous, int32_t step)
{
    memcpy(cost, previous, FIELD_SIDE * sizeof *cost);
    for (int32_t k = 1; k <= SPREAD_CELLS; k++) {
        const cairn_real *low = previous - k * step, *high = previous + k * step;
        cairn_real distance_cost =
            (cairn_real)(k * k) / (cairn_real)(2 * SIGMA_CELLS * SIGMA_CELLS);

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

/* Distance transform along every row of cells, then along all columns; plane: [(FIELD_SIDE + 2 *
 * SPREAD_CELLS) * FIELD_SIDE] scratch. */
static void spread_both(cairn_real *cost, cairn_real *plane)
{
    cairn_real line[FIELD_SIDE + 2 * SPREAD_CELLS];

    if (!has_edge(cost, FIELD_SIDE * FIELD_SIDE))
        return;
    for (int32_t i = 0; i < SPREAD_CELLS; i++)
        line[i] = line[FIELD_SIDE + SPREAD_CELLS + i] = CONTOUR_SEARCH_FIELD_MAX_COST;
    for (int32_t i = 0; i < FIELD_SIDE; i++) {
        memcpy(&line[SPREAD_CELLS], &cost[i * FIELD_SIDE], FIELD_SIDE * sizeof *line);
        if (has_edge(&line[SPREAD_CELLS], FIELD_SIDE))
            distance_transform_1d(&cost[i * FIELD_SIDE], &line[SPREAD_CELLS], 1);
    }
    for (int32_t i = 0; i < SPREAD_CELLS * FIELD_SIDE; i++)
        plane[i] = plane[(FIELD_SIDE + SPREAD_CELLS) * FIELD_SIDE + i] =
            CONTOUR_SEARCH_FIELD_MAX_COST;
    memcpy(&plane[SPREAD_CELLS * FIELD_SIDE], cost, sizeof *plane * FIELD_SIDE * FIELD_SIDE);
    for (int32_t i = 0; i < FIELD_SIDE; i++)
        distance_transform_1d(&cost[i * FIELD_SIDE], &plane[(SPREAD_CELLS + i) * FIELD_SIDE],
                              FIELD_SIDE);
}

/* Transforms one direction's costs, and returns the mean likelihood. */
static cairn_real spread(cairn_real *cost, cairn_real *plane)
{
    const double none = exp(-(double)CONTOUR_SEARCH_FIELD_MAX_COST);
    double sum = 0;

    spread_both(cost, plane);
    for (int32_t i = 0; i < FIELD_SIDE * FIELD_SIDE; i++)
        sum += cost[i] < CONTOUR_SEARCH_FIELD_MAX_COST ? exp(-(double)cost[i]) : none;
    return (cairn_real)fmax(MIN_BACKGROUND, sum / (FIELD_SIDE * FIELD_SIDE));
}

contour_search_field *cairn_contour_search_field_new(void)
{
    contour_search_field *field = calloc(1, sizeof *field);

    if (field == NULL)
        return NULL;
    field->cost = malloc((size_t)DIRECTION_BINS * FIELD_SIDE * FIELD_SIDE * sizeof *field->cost);
    field->llr = malloc((size_t)DIRECTION_BINS * FIELD_SIDE * FIELD_SIDE * sizeof *field->llr);
    field->plane =
        malloc((size_t)(FIELD_SIDE + 2 * SPREAD_CELLS) * FIELD_SIDE * sizeof *field->plane);
    if (field->cost != NULL && field->llr != NULL && field->plane != NULL)
        return field;
    cairn_contour_search_field_free(field);
    return NULL;
}

void cairn_contour_search_field_free(contour_search_field *field)
{
    if (field != NULL) {
        free(field->cost);
        free(field->llr);
        free(field->plane);
    }
    free(field);
}

void cairn_contour_search_field_fill(contour_search_field *field,
                                     const cairn_contour_search_tokens *tokens,
                                     const cairn_contour_grouping_object *object)
{
    cairn_real half;

    field->cell_size = object->size / CELLS_PER_SIZE;
    half = FIELD_SIDE * field->cell_size / 2;
    field->corner.x = object->origin.x - half;
    field->corner.y = object->origin.y - half;
    for (int32_t i = 0; i < DIRECTION_BINS * FIELD_SIDE * FIELD_SIDE; i++)
        field->llr[i] = CAIRN_REAL_MAX;
    for (int32_t bin = 0; bin < DIRECTION_BINS; bin++)
        clear_costs(&field->cost[(size_t)bin * FIELD_SIDE * FIELD_SIDE]);
    for (int32_t i = 0; i < tokens->count; i++)
        if (!is_outside(field, tokens->lines[i]))
            rasterize_segment(field, tokens->lines[i], tokens->strength_rank[i]);
    for (int32_t bin = 0; bin < DIRECTION_BINS; bin++)
        field->background[bin] =
            spread(&field->cost[(size_t)bin * FIELD_SIDE * FIELD_SIDE], field->plane);
}

int32_t cairn_contour_search_field_bin(cairn_vec2 direction)
{
    double angle = atan2((double)direction.y, (double)direction.x);
    int32_t bin = (int32_t)floor(angle / ((double)CAIRN_PI / DIRECTION_BINS));

    return ((bin % DIRECTION_BINS) + DIRECTION_BINS) % DIRECTION_BINS;
}
