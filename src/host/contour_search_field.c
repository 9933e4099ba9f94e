/* How near an edge of each direction is, everywhere about an object.
 *
 * Method: a window about the object in cells that are a share of its size, so that all objects
 * cost the same. Every segment enters the directions near its own at a cost of the turn and of
 * its strength; least costs spread over a few sigmas in rows, then in columns, as in a distance
 * transform. What a direction's edges come to by chance is the mean over the window. */
#include "src/core/build.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/contour_search_fit.h"

/* Cells of an object's size. */
#define CELLS 128
/* Sigmas: of the place, in cells, and of the direction, rad. */
#define SIGMA 2.0
#define TURN  0.35
/* Beyond so many sigmas of the direction a segment is no edge of it. */
#define TURN_MOST 2.2
/* Cells that a cost spreads. */
enum { SPREAD = 5 };
/* An edge stronger than a share s of all is 2 s times as likely on an object as elsewhere, but
 * never less than this. */
#define WEAKEST 0.2
/* Of the window's cells: so many are near an edge at least. */
#define LEAST_CHANCE 0.02

enum { SIDE = CONTOUR_FIELD_SIDE, BINS = CONTOUR_FIELD_BINS };

/* The costs of one direction, all out of reach. */
static void clear(cairn_real *cost)
{
    for (int32_t i = 0; i < SIDE * SIDE; i++)
        cost[i] = CONTOUR_FIELD_MOST;
}

/* Marks a line in the cells of one direction. */
static void mark(contour_field *f, cairn_segment line, cairn_real *cost, cairn_real worth)
{
    cairn_real length = cairn_segment_length(line);
    int32_t steps = 1 + (int32_t)(2 * length / f->cell);

    for (int32_t k = 0; k <= steps; k++) {
        cairn_vec2 p = cairn_vec2_add(line.a, cairn_vec2_scale(cairn_vec2_sub(line.b, line.a),
                                                               (cairn_real)k / (cairn_real)steps));
        int32_t x = (int32_t)floor((double)((p.x - f->corner.x) / f->cell)),
                y = (int32_t)floor((double)((p.y - f->corner.y) / f->cell));

        if (x >= 0 && y >= 0 && x < SIDE && y < SIDE)
            cost[y * SIDE + x] = cairn_min(cost[y * SIDE + x], worth);
    }
}

static int is_outside(const contour_field *f, cairn_segment line)
{
    cairn_real side = SIDE * f->cell;

    return cairn_max(line.a.x, line.b.x) < f->corner.x ||
           cairn_min(line.a.x, line.b.x) > f->corner.x + side ||
           cairn_max(line.a.y, line.b.y) < f->corner.y ||
           cairn_min(line.a.y, line.b.y) > f->corner.y + side;
}

/* Enters a segment into all directions near its own. */
static void enter(contour_field *f, cairn_segment line, cairn_real strength)
{
    double angle = atan2((double)(line.b.y - line.a.y), (double)(line.b.x - line.a.x));
    double strong = -log(fmax(WEAKEST, 2 * (double)strength));

    for (int32_t bin = 0; bin < BINS; bin++) {
        double turn =
            remainder(angle - ((double)bin + 0.5) * ((double)CAIRN_PI / BINS), (double)CAIRN_PI) /
            TURN;

        if (fabs(turn) <= TURN_MOST)
            mark(f, line, &f->cost[(size_t)bin * SIDE * SIDE],
                 (cairn_real)(strong + turn * turn / 2));
    }
}

/* Costs of SIDE cells of a line: the least of what there was up to SPREAD steps to either side. */
static void spread_line(cairn_real *cost, const cairn_real *was, int32_t step)
{
    memcpy(cost, was, SIDE * sizeof *cost);
    for (int32_t k = 1; k <= SPREAD; k++) {
        const cairn_real *low = was - k * step, *high = was + k * step;
        cairn_real far = (cairn_real)(k * k) / (cairn_real)(2 * SIGMA * SIGMA);

        for (int32_t i = 0; i < SIDE; i++)
            cost[i] = cairn_min(cost[i], cairn_min(low[i], high[i]) + far);
    }
}

/* 1 when there is an edge in so many cells. */
static int is_marked(const cairn_real *cost, int32_t count)
{
    int32_t i = 0;

    while (i < count && !(cost[i] < CONTOUR_FIELD_MOST))
        i++;
    return i < count;
}

/* Along every row of cells, then across all of them; plane: [(SIDE + 2 * SPREAD) * SIDE] is
 * overwritten. */
static void spread_both(cairn_real *cost, cairn_real *plane)
{
    cairn_real line[SIDE + 2 * SPREAD];

    if (!is_marked(cost, SIDE * SIDE))
        return;
    for (int32_t i = 0; i < SPREAD; i++)
        line[i] = line[SIDE + SPREAD + i] = CONTOUR_FIELD_MOST;
    for (int32_t i = 0; i < SIDE; i++) {
        memcpy(&line[SPREAD], &cost[i * SIDE], SIDE * sizeof *line);
        if (is_marked(&line[SPREAD], SIDE))
            spread_line(&cost[i * SIDE], &line[SPREAD], 1);
    }
    for (int32_t i = 0; i < SPREAD * SIDE; i++)
        plane[i] = plane[(SIDE + SPREAD) * SIDE + i] = CONTOUR_FIELD_MOST;
    memcpy(&plane[SPREAD * SIDE], cost, sizeof *plane * SIDE * SIDE);
    for (int32_t i = 0; i < SIDE; i++)
        spread_line(&cost[i * SIDE], &plane[(SPREAD + i) * SIDE], SIDE);
}

/* Spreads one direction's costs, and takes the mean of how likely they are. */
static cairn_real spread(cairn_real *cost, cairn_real *plane)
{
    const double none = exp(-(double)CONTOUR_FIELD_MOST);
    double sum = 0;

    spread_both(cost, plane);
    for (int32_t i = 0; i < SIDE * SIDE; i++)
        sum += cost[i] < CONTOUR_FIELD_MOST ? exp(-(double)cost[i]) : none;
    return (cairn_real)fmax(LEAST_CHANCE, sum / (SIDE * SIDE));
}

contour_field *cairn_contour_field_new(void)
{
    contour_field *f = calloc(1, sizeof *f);

    if (f == NULL)
        return NULL;
    f->cost = malloc((size_t)BINS * SIDE * SIDE * sizeof *f->cost);
    f->worth = malloc((size_t)BINS * SIDE * SIDE * sizeof *f->worth);
    f->plane = malloc((size_t)(SIDE + 2 * SPREAD) * SIDE * sizeof *f->plane);
    if (f->cost != NULL && f->worth != NULL && f->plane != NULL)
        return f;
    cairn_contour_field_free(f);
    return NULL;
}

void cairn_contour_field_free(contour_field *field)
{
    if (field != NULL) {
        free(field->cost);
        free(field->worth);
        free(field->plane);
    }
    free(field);
}

void cairn_contour_field_fill(contour_field *f, const cairn_contour_tokens *tokens,
                              const cairn_grouped_object *o)
{
    cairn_real half;

    f->cell = o->size / CELLS;
    half = SIDE * f->cell / 2;
    f->corner.x = o->origin.x - half;
    f->corner.y = o->origin.y - half;
    for (int32_t i = 0; i < BINS * SIDE * SIDE; i++)
        f->worth[i] = CAIRN_REAL_MAX;
    for (int32_t bin = 0; bin < BINS; bin++)
        clear(&f->cost[(size_t)bin * SIDE * SIDE]);
    for (int32_t i = 0; i < tokens->count; i++)
        if (!is_outside(f, tokens->lines[i]))
            enter(f, tokens->lines[i], tokens->strength[i]);
    for (int32_t bin = 0; bin < BINS; bin++)
        f->chance[bin] = spread(&f->cost[(size_t)bin * SIDE * SIDE], f->plane);
}

int32_t cairn_contour_field_bin(cairn_vec2 direction)
{
    double angle = atan2((double)direction.y, (double)direction.x);
    int32_t bin = (int32_t)floor(angle / ((double)CAIRN_PI / BINS));

    return ((bin % BINS) + BINS) % BINS;
}
