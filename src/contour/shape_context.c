/* Shape contexts.
 *
 * Method: rings are bounded by radii in geometric steps from `inner` to `outer`, in units of the
 * mean distance of two points: of each shape's own, and for a part of the whole's, because a part's
 * mean says nothing of the whole's size. The first ring reaches to the point itself, what lies
 * beyond the last one is not counted. Contexts are shares of the points counted. Sectors begin at
 * the x axis.
 *
 * Layout: points and contexts of both shapes, the table of costs, the assignment.
 *
 * Limits: not invariant to rotation; points at the bound of two sectors change their bin by
 * rounding.
 *
 * Source: Belongie, Malik & Puzicha 2002; the asymmetric form: this project's, for Adluru 2008,
 * section 5.3.1. */
#include "src/core/build.h"

#include <string.h>

#include "cairn/assignment.h"
#include "cairn/shape_context.h"

enum {
    POINTS_MOST = 1024,
    RINGS = CAIRN_SHAPE_CONTEXT_RINGS,
    SECTORS = CAIRN_SHAPE_CONTEXT_SECTORS
};
enum { BINS = CAIRN_SHAPE_CONTEXT_BINS };
/* Units of a row: distances, contexts and costs. */
enum { DISTANCES_A_UNIT = 6, UNITS_A_COST = 3, NEAREST_A_UNIT = 16 };
enum { IDLE, MEASURE, COUNT, COMPARE, NEAREST, ASSIGN, DONE };

static const cairn_real FAR = CAIRN_REAL(1e9);

struct cairn_shape_context {
    cairn_shape_context_params params;
    cairn_shape_context_kind kind;
    cairn_vec2 *points[2];  /* [max_points] */
    cairn_real *context[2]; /* [max_points * BINS] */
    cairn_real *cost;       /* [count[0] * count[1]] */
    int32_t *match;         /* [max_points] */
    cairn_assignment *assignment;
    int32_t count[2];
    cairn_real mean[2]; /* distance of two points: sums while they are measured */
    cairn_real missing_share, distance, symmetric;
    int32_t phase, shape, row, paid;
};

cairn_shape_context_params cairn_shape_context_default(void)
{
    cairn_shape_context_params params = {128, CAIRN_REAL(0.125), 2, 1};

    return params;
}

static int params_are_good(const cairn_shape_context_params *p)
{
    return p != NULL && p->max_points >= 2 && p->max_points <= POINTS_MOST && p->inner > 0 &&
           p->outer > p->inner && p->outer <= FAR && p->missing >= 0 && p->missing <= FAR;
}

static cairn_assignment_params assignment_params(const cairn_shape_context_params *p)
{
    cairn_assignment_params params = {p->max_points, p->max_points};

    return params;
}

/* All but the assignment. */
static cairn_shape_context *carve(cairn_pool *pool, const cairn_shape_context_params *p)
{
    size_t n = (size_t)p->max_points;
    cairn_shape_context *c = cairn_pool_take_one(pool, sizeof *c);
    cairn_vec2 *points = cairn_pool_take(pool, 2 * n, sizeof *points);
    cairn_real *context = cairn_pool_take(pool, 2 * n * BINS, sizeof *context);
    cairn_real *cost = cairn_pool_take(pool, n * n, sizeof *cost);
    int32_t *match = cairn_pool_take(pool, n, sizeof *match);

    if (c != NULL) {
        memset(c, 0, sizeof *c);
        c->points[0] = points;
        c->points[1] = points + n;
        c->context[0] = context;
        c->context[1] = context + n * BINS;
        c->cost = cost;
        c->match = match;
    }
    return c;
}

size_t cairn_shape_context_memory(const cairn_shape_context_params *params)
{
    cairn_assignment_params assignment;
    cairn_pool counting;

    if (!params_are_good(params))
        return 0;
    assignment = assignment_params(params);
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    cairn_pool_count(&counting, cairn_assignment_memory(&assignment));
    return cairn_pool_counted(&counting);
}

cairn_status cairn_shape_context_create(cairn_shape_context **context, cairn_pool *pool,
                                        const cairn_shape_context_params *params)
{
    size_t need = cairn_shape_context_memory(params);
    cairn_assignment_params assignment;

    if (context == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    *context = carve(pool, params);
    (*context)->params = *params;
    assignment = assignment_params(params);
    return cairn_assignment_create(&(*context)->assignment, pool, &assignment);
}

static int are_usable(const cairn_vec2 *points, int32_t count)
{
    for (int32_t i = 0; i < count; i++)
        if (!(cairn_abs(points[i].x) <= FAR) || !(cairn_abs(points[i].y) <= FAR))
            return 0;
    return 1;
}

cairn_status cairn_shape_context_begin(cairn_shape_context *c,
                                       const cairn_shape_context_input *input)
{
    if (c == NULL || input == NULL || input->first == NULL || input->second == NULL ||
        input->first_count < 2 || input->second_count < 2 ||
        !(input->missing_share >= 0 && input->missing_share <= 1) ||
        input->kind < CAIRN_SHAPE_CONTEXT_WHOLE || input->kind > CAIRN_SHAPE_CONTEXT_PART)
        return CAIRN_BAD_ARGUMENT;
    if (input->first_count > c->params.max_points || input->second_count > c->params.max_points)
        return CAIRN_FULL;
    if (!are_usable(input->first, input->first_count) ||
        !are_usable(input->second, input->second_count))
        return CAIRN_NOT_FINITE;
    memcpy(c->points[0], input->first, (size_t)input->first_count * sizeof *input->first);
    memcpy(c->points[1], input->second, (size_t)input->second_count * sizeof *input->second);
    c->count[0] = input->first_count;
    c->count[1] = input->second_count;
    c->kind = input->kind;
    c->missing_share = input->missing_share;
    c->mean[0] = c->mean[1] = c->distance = c->symmetric = 0;
    c->shape = c->row = c->paid = 0;
    c->phase = MEASURE;
    return CAIRN_OK;
}

/* Distances of a point to those behind it. */
static void measure_row(cairn_shape_context *c)
{
    const cairn_vec2 *p = c->points[c->shape];

    for (int32_t k = c->row + 1; k < c->count[c->shape]; k++)
        c->mean[c->shape] += cairn_vec2_norm(cairn_vec2_sub(p[k], p[c->row]));
}

/* Sums become means. 0: there is no distance to measure by. */
static int take_means(cairn_shape_context *c)
{
    for (int32_t k = 0; k < 2; k++)
        c->mean[k] /= (cairn_real)c->count[k] * (cairn_real)(c->count[k] - 1) / 2;
    if (c->kind == CAIRN_SHAPE_CONTEXT_PART)
        c->mean[0] = c->mean[1];
    return c->mean[0] > 0 && c->mean[1] > 0;
}

/* -1: beyond the last ring. */
static int32_t bin_of(const cairn_shape_context *c, cairn_vec2 d, cairn_real mean)
{
    cairn_real far = cairn_vec2_norm(d) / mean, angle = cairn_atan2(d.y, d.x);
    cairn_real step = cairn_sqrt(cairn_sqrt(c->params.outer / c->params.inner)),
               bound = c->params.inner;
    int32_t ring = 0, sector = cairn_real_to_int((angle < 0 ? angle + 2 * CAIRN_PI : angle) *
                                                 (SECTORS / (2 * CAIRN_PI)));

    while (ring < RINGS && far >= bound) {
        ring++;
        bound *= step;
    }
    return ring < RINGS ? ring * SECTORS + (sector < SECTORS ? sector : SECTORS - 1) : -1;
}

/* The context of a point. */
static void count_row(cairn_shape_context *c)
{
    cairn_real *context = &c->context[c->shape][(size_t)c->row * BINS], counted = 0;
    const cairn_vec2 *p = c->points[c->shape];

    for (int32_t k = 0; k < BINS; k++)
        context[k] = 0;
    for (int32_t k = 0; k < c->count[c->shape]; k++) {
        int32_t bin =
            k != c->row ? bin_of(c, cairn_vec2_sub(p[k], p[c->row]), c->mean[c->shape]) : -1;

        if (bin >= 0) {
            context[bin] += 1;
            counted += 1;
        }
    }
    for (int32_t k = 0; k < BINS && counted > 0; k++)
        context[k] /= counted;
}

static cairn_real cost_of(const cairn_real *a, const cairn_real *b)
{
    cairn_real sum = 0;

    for (int32_t k = 0; k < BINS; k++)
        if (a[k] + b[k] > 0)
            sum += (a[k] - b[k]) * (a[k] - b[k]) / (a[k] + b[k]);
    return sum / 2;
}

/* A context by its bins that hold something. */
typedef struct few_bins {
    int32_t bin[BINS], count;
    cairn_real share[BINS];
} few_bins;

static few_bins few_of(const cairn_real *context)
{
    few_bins few = {.count = 0};

    for (int32_t k = 0; k < BINS; k++)
        if (context[k] > 0) {
            few.bin[few.count] = k;
            few.share[few.count++] = context[k];
        }
    return few;
}

/* The same as cost_of(), for (a - b)^2 / (a + b) = a + b - 4 a b / (a + b), and shares sum to 1
 * where anything was counted: only bins that hold something of both count. */
static cairn_real cost_of_few(const few_bins *a, const cairn_real *b)
{
    cairn_real both = 0;

    for (int32_t k = 0; k < a->count; k++) {
        cairn_real other = b[a->bin[k]];

        if (other > 0)
            both += a->share[k] * other / (a->share[k] + other);
    }
    if (!(both > 0))
        return ((cairn_real)(a->count > 0) + (cairn_real)(few_of(b).count > 0)) / 2;
    return cairn_max(0, 1 - 2 * both);
}

/* The costs of a point of the first; the cheapest is its match. */
static void compare_row(cairn_shape_context *c)
{
    cairn_real *cost = &c->cost[(size_t)c->row * (size_t)c->count[1]];
    const cairn_real *own = &c->context[0][(size_t)c->row * BINS];
    few_bins few = few_of(own);
    int32_t least = 0;

    for (int32_t k = 0; k < c->count[1]; k++) {
        const cairn_real *other = &c->context[1][(size_t)k * BINS];

        cost[k] =
            c->kind == CAIRN_SHAPE_CONTEXT_PART ? cost_of(own, other) : cost_of_few(&few, other);
        if (cost[k] < cost[least])
            least = k;
    }
    c->match[c->row] = least;
    c->distance += cost[least];
}

/* WHOLE: the least cost of a point of the second, which stands in a column. */
static void find_nearest(cairn_shape_context *c)
{
    cairn_real least = c->cost[c->row];

    for (int32_t i = 1; i < c->count[0]; i++)
        least = cairn_min(least, c->cost[(size_t)i * (size_t)c->count[1] + (size_t)c->row]);
    c->symmetric += least / (cairn_real)c->count[1];
}

static void finish_whole(cairn_shape_context *c)
{
    cairn_assignment_result pairs = cairn_assignment_read(c->assignment);
    int32_t more = c->count[0] > c->count[1] ? c->count[0] : c->count[1];

    memcpy(c->match, pairs.column, (size_t)c->count[0] * sizeof *c->match);
    c->distance =
        (pairs.cost + c->params.missing * (cairn_real)(more - pairs.pairs)) / (cairn_real)more;
    c->phase = DONE;
}

/* Behind the last row of a phase. */
static cairn_status end_rows(cairn_shape_context *c)
{
    c->row = 0;
    if ((c->phase == MEASURE || c->phase == COUNT) && c->shape == 0) {
        c->shape = 1;
        return CAIRN_OK;
    }
    c->shape = 0;
    if (c->phase == MEASURE) {
        c->phase = take_means(c) ? COUNT : IDLE;
        return c->phase == COUNT ? CAIRN_OK : CAIRN_EMPTY;
    }
    if (c->phase == COUNT) {
        c->phase = COMPARE;
        return CAIRN_OK;
    }
    if (c->kind == CAIRN_SHAPE_CONTEXT_PART) {
        c->distance = c->distance / (cairn_real)c->count[0] + c->params.missing * c->missing_share;
        c->phase = DONE;
        return CAIRN_OK;
    }
    if (c->phase == COMPARE) {
        c->symmetric = c->distance / (cairn_real)c->count[0];
        c->phase = NEAREST;
        return CAIRN_OK;
    }
    c->phase = ASSIGN;
    return cairn_assignment_begin(c->assignment, c->cost, c->count[0], c->count[1]);
}

static int32_t units_of_row(const cairn_shape_context *c)
{
    return c->phase == MEASURE   ? 1 + c->count[c->shape] / DISTANCES_A_UNIT
           : c->phase == COUNT   ? c->count[c->shape]
           : c->phase == COMPARE ? UNITS_A_COST * c->count[1]
                                 : 1 + c->count[0] / NEAREST_A_UNIT;
}

static void run_row(cairn_shape_context *c)
{
    if (c->phase == MEASURE)
        measure_row(c);
    else if (c->phase == COUNT)
        count_row(c);
    else if (c->phase == COMPARE)
        compare_row(c);
    else
        find_nearest(c);
}

/* Of the phase: points of the shape that is looked at, of NEAREST those of the second. */
static int32_t rows_of(const cairn_shape_context *c)
{
    return c->count[c->phase == NEAREST ? 1 : c->shape];
}

cairn_status cairn_shape_context_step(cairn_shape_context *c, cairn_budget *budget)
{
    cairn_status status = CAIRN_OK;

    if (c == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (status == CAIRN_OK && c->phase >= MEASURE && c->phase <= NEAREST) {
        if (!cairn_budget_pay(budget, &c->paid, units_of_row(c)))
            return CAIRN_MORE;
        run_row(c);
        if (++c->row == rows_of(c))
            status = end_rows(c);
    }
    if (status == CAIRN_OK && c->phase == ASSIGN) {
        status = cairn_assignment_step(c->assignment, budget);
        if (status == CAIRN_OK)
            finish_whole(c);
    }
    return status;
}

cairn_shape_context_result cairn_shape_context_read(const cairn_shape_context *c)
{
    cairn_shape_context_result result = {NULL, 0, 0, 0};

    if (c != NULL && c->phase == DONE) {
        result.match = c->match;
        result.count = c->count[0];
        result.distance = c->distance;
        result.symmetric = c->symmetric;
    }
    return result;
}
