/* Shape contexts (log-polar histograms) and their chi-squared matching.
 *
 * Method:
 * 1. Ring radii are in geometric progression from inner_radius to outer_radius, in units of the
 *    mean distance of two points. For a part the mean distance of the whole shape is used, since a
 *    part's own does not determine the whole's size.
 * 2. The first ring extends to the point itself; points beyond the last ring are not counted.
 *    Histograms are normalized. Sectors begin at the x axis.
 * 3. Costs: half the chi-squared distance of two histograms.
 * 4. WHOLE: minimum-cost assignment and nearest neighbours in both directions. PART: nearest
 *    neighbours of the first shape.
 *
 * Memory layout: points and histograms of both shapes, the cost matrix, the assignment.
 *
 * Limits: not invariant to rotation; rounding may move points on a sector bound to the adjacent
 * bin.
 *
 * Source: Belongie, Malik and Puzicha 2002; the asymmetric form: this project's, for Adluru
 * 2008, section 5.3.1. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/assignment.h"
#include "cairn/shape_context.h"
#include "src/base/object.h"
#include "src/base/step.h"

enum {
    MAX_POINTS = 1024,
    RING_COUNT = CAIRN_SHAPE_CONTEXT_RINGS,
    SECTOR_COUNT = CAIRN_SHAPE_CONTEXT_SECTORS
};
enum { BIN_COUNT = CAIRN_SHAPE_CONTEXT_BINS };
/* Work of a row: distances, costs, column minima. */
enum { DISTANCES_PER_UNIT = 6, UNITS_PER_COST = 3, MINIMA_PER_UNIT = 16 };

#define MAX_COORDINATE CAIRN_REAL(1e9)

struct cairn_shape_context {
    cairn_shape_context_params params;
    cairn_shape_context_kind kind;
    cairn_vec2 *points[2];  /* [max_points] */
    cairn_real *context[2]; /* [max_points * BIN_COUNT] */
    cairn_real *cost;       /* [count[0] * count[1]] */
    int32_t *match;         /* [max_points] */
    cairn_assignment *assignment;
    int32_t count[2];
    cairn_real missing_share;
    union {
        /* Until the histograms: mean distance of two points, in the units of the input; at first
         * their sums. */
        cairn_real mean_distance[2];
        /* From the costs on: distances of the shapes; at first their sums. */
        struct {
            cairn_real distance, symmetric_distance;
        };
    };
    /* CAIRN_MORE: in work; CAIRN_OK: the result is complete; else there is none. */
    cairn_status status;
    /* Current shape and its current point, a row of the costs or, for the nearest, a column. */
    int32_t shape, row;
    /* Resume point; work units charged for the next operation so far. */
    int32_t resume, units_charged;
};

#define INTEGER(field, ...)  CAIRN_INTEGER(cairn_shape_context_params, field, __VA_ARGS__)
#define NUMBER(field, ...)   CAIRN_NUMBER(cairn_shape_context_params, field, __VA_ARGS__)
#define POSITIVE(field, ...) CAIRN_NUMBER_ABOVE(cairn_shape_context_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_points, 128, 2, MAX_POINTS),
    POSITIVE(inner_radius, CAIRN_REAL(0.125), 0, MAX_COORDINATE),
    POSITIVE(outer_radius, 2, 0, MAX_COORDINATE),
    NUMBER(missing_cost, 1, 0, MAX_COORDINATE),
};
extern const cairn_parameters cairn_shape_context_parameters;
const cairn_parameters cairn_shape_context_parameters =
    CAIRN_PARAMETERS("shape_context", cairn_shape_context_params, rows);

cairn_shape_context_params cairn_shape_context_default(void)
{
    cairn_shape_context_params params;

    cairn_parameters_preset(&cairn_shape_context_parameters, &params);
    return params;
}

cairn_status cairn_shape_context_check(const cairn_shape_context_params *params,
                                       cairn_object_fault *fault)
{
    cairn_status status = cairn_parameters_check(&cairn_shape_context_parameters, params, fault);

    if (status == CAIRN_OK)
        status =
            cairn_parameters_require(params->outer_radius > params->inner_radius, "shape_context",
                                     "outer_radius: above inner_radius", fault);
    return status;
}

static cairn_assignment_params assignment_params(const cairn_shape_context_params *p)
{
    cairn_assignment_params params = {
        .max_rows = p->max_points,
        .max_columns = p->max_points,
    };

    return params;
}

/* The object, its arrays and the assignment; NULL from a counting pool. */
static cairn_shape_context *build(cairn_pool *pool, const cairn_shape_context_params *params)
{
    size_t n = (size_t)params->max_points;
    cairn_assignment_params assignment = assignment_params(params);
    cairn_shape_context *shape_context = cairn_object_take(pool, sizeof *shape_context);

    CAIRN_TAKE(shape_context, pool, points[0], 2 * n);
    CAIRN_TAKE(shape_context, pool, context[0], 2 * n * BIN_COUNT);
    CAIRN_TAKE(shape_context, pool, cost, n * n);
    CAIRN_TAKE(shape_context, pool, match, n);
    CAIRN_TAKE_OBJECT(shape_context, pool, assignment, assignment, &assignment);
    if (shape_context != NULL) {
        shape_context->params = *params;
        shape_context->status = CAIRN_EMPTY;
        shape_context->points[1] = shape_context->points[0] + n;
        shape_context->context[1] = shape_context->context[0] + n * BIN_COUNT;
    }
    return shape_context;
}

CAIRN_OBJECT(shape_context, shape_context, build);

static int are_usable(const cairn_vec2 *points, int32_t count)
{
    for (int32_t i = 0; i < count; i++)
        if (!cairn_vec2_is_within(points[i], MAX_COORDINATE))
            return 0;
    return 1;
}

cairn_status cairn_shape_context_begin(cairn_shape_context *shape_context,
                                       const cairn_shape_context_input *input)
{
    if (shape_context == NULL || input == NULL || input->first == NULL || input->second == NULL ||
        input->first_count < 2 || input->second_count < 2 ||
        !(input->missing_share >= 0 && input->missing_share <= 1) ||
        input->kind < CAIRN_SHAPE_CONTEXT_WHOLE || input->kind > CAIRN_SHAPE_CONTEXT_PART)
        return CAIRN_BAD_ARGUMENT;
    if (input->first_count > shape_context->params.max_points ||
        input->second_count > shape_context->params.max_points)
        return CAIRN_FULL;
    if (!are_usable(input->first, input->first_count) ||
        !are_usable(input->second, input->second_count))
        return CAIRN_NOT_FINITE;
    memcpy(shape_context->points[0], input->first,
           (size_t)input->first_count * sizeof *input->first);
    memcpy(shape_context->points[1], input->second,
           (size_t)input->second_count * sizeof *input->second);
    shape_context->count[0] = input->first_count;
    shape_context->count[1] = input->second_count;
    shape_context->kind = input->kind;
    shape_context->missing_share = input->missing_share;
    shape_context->mean_distance[0] = shape_context->mean_distance[1] = 0;
    shape_context->resume = shape_context->units_charged = 0;
    shape_context->status = CAIRN_MORE;
    return CAIRN_OK;
}

/* Sums the distances from a point to all later points. */
static void sum_distances(cairn_shape_context *shape_context)
{
    const cairn_vec2 *p = shape_context->points[shape_context->shape];

    for (int32_t k = shape_context->row + 1; k < shape_context->count[shape_context->shape]; k++)
        shape_context->mean_distance[shape_context->shape] +=
            cairn_vec2_norm(cairn_vec2_sub(p[k], p[shape_context->row]));
}

/* Divides the sums by their counts. All points of a shape coincide: CAIRN_EMPTY. */
static void set_mean_distances(cairn_shape_context *shape_context)
{
    for (int32_t k = 0; k < 2; k++)
        shape_context->mean_distance[k] /=
            (cairn_real)shape_context->count[k] * (cairn_real)(shape_context->count[k] - 1) / 2;
    if (shape_context->kind == CAIRN_SHAPE_CONTEXT_PART)
        shape_context->mean_distance[0] = shape_context->mean_distance[1];
    if (!(shape_context->mean_distance[0] > 0) || !(shape_context->mean_distance[1] > 0))
        shape_context->status = CAIRN_EMPTY;
}

/* Returns the histogram bin of a displacement; -1: beyond the last ring. */
static int32_t bin_of(const cairn_shape_context *shape_context, cairn_vec2 d, cairn_real mean)
{
    cairn_real distance = cairn_vec2_norm(d) / mean, angle = cairn_atan2(d.y, d.x);
    cairn_real step = cairn_sqrt(cairn_sqrt(shape_context->params.outer_radius /
                                            shape_context->params.inner_radius)),
               bound = shape_context->params.inner_radius;
    int32_t ring = 0, sector = cairn_real_to_int((angle < 0 ? angle + 2 * CAIRN_PI : angle) *
                                                 (SECTOR_COUNT / (2 * CAIRN_PI)));

    while (ring < RING_COUNT && distance >= bound) {
        ring++;
        bound *= step;
    }
    return ring < RING_COUNT
               ? ring * SECTOR_COUNT + (sector < SECTOR_COUNT ? sector : SECTOR_COUNT - 1)
               : -1;
}

/* Computes the shape context of a point. */
static void histogram_row(cairn_shape_context *shape_context)
{
    cairn_real *context =
                   &shape_context
                        ->context[shape_context->shape][(size_t)shape_context->row * BIN_COUNT],
               counted = 0;
    const cairn_vec2 *p = shape_context->points[shape_context->shape];

    for (int32_t k = 0; k < BIN_COUNT; k++)
        context[k] = 0;
    for (int32_t k = 0; k < shape_context->count[shape_context->shape]; k++) {
        int32_t bin = k != shape_context->row
                          ? bin_of(shape_context, cairn_vec2_sub(p[k], p[shape_context->row]),
                                   shape_context->mean_distance[shape_context->shape])
                          : -1;

        if (bin >= 0) {
            context[bin] += 1;
            counted += 1;
        }
    }
    for (int32_t k = 0; k < BIN_COUNT && counted > 0; k++)
        context[k] /= counted;
}

/* Returns half the chi-squared distance of two histograms, 0 ... 1. */
static cairn_real chi_squared_cost(const cairn_real *a, const cairn_real *b)
{
    cairn_real sum = 0;

    for (int32_t k = 0; k < BIN_COUNT; k++)
        if (a[k] + b[k] > 0)
            sum += (a[k] - b[k]) * (a[k] - b[k]) / (a[k] + b[k]);
    return sum / 2;
}

/* The non-empty bins of a histogram. */
typedef struct sparse_histogram {
    int32_t bin[BIN_COUNT], count;
    cairn_real value[BIN_COUNT];
} sparse_histogram;

static sparse_histogram sparse_histogram_of(const cairn_real *context)
{
    sparse_histogram sparse = {.count = 0};

    for (int32_t k = 0; k < BIN_COUNT; k++)
        if (context[k] > 0) {
            sparse.bin[sparse.count] = k;
            sparse.value[sparse.count++] = context[k];
        }
    return sparse;
}

/* Equals chi_squared_cost() up to rounding: (a - b)^2 / (a + b) = a + b - 4 a b / (a + b), and
 * non-empty histograms sum to 1, so that only bins common to both contribute. */
static cairn_real sparse_chi_squared_cost(const sparse_histogram *a, const cairn_real *b)
{
    cairn_real both = 0;

    for (int32_t k = 0; k < a->count; k++) {
        cairn_real other = b[a->bin[k]];

        if (other > 0)
            both += a->value[k] * other / (a->value[k] + other);
    }
    if (!(both > 0))
        return ((cairn_real)(a->count > 0) + (cairn_real)(sparse_histogram_of(b).count > 0)) / 2;
    return cairn_max(0, 1 - 2 * both);
}

/* Computes the costs of a point of the first shape; the cheapest is its match. */
static void cost_row(cairn_shape_context *shape_context)
{
    cairn_real *cost =
        &shape_context->cost[(size_t)shape_context->row * (size_t)shape_context->count[1]];
    const cairn_real *own = &shape_context->context[0][(size_t)shape_context->row * BIN_COUNT];
    sparse_histogram sparse = sparse_histogram_of(own);
    int32_t least = 0;

    for (int32_t k = 0; k < shape_context->count[1]; k++) {
        const cairn_real *other = &shape_context->context[1][(size_t)k * BIN_COUNT];

        cost[k] = shape_context->kind == CAIRN_SHAPE_CONTEXT_PART
                      ? chi_squared_cost(own, other)
                      : sparse_chi_squared_cost(&sparse, other);
        if (cost[k] < cost[least])
            least = k;
    }
    shape_context->match[shape_context->row] = least;
    shape_context->distance += cost[least];
}

/* PART: the distance from the nearest neighbours of the first shape. */
static void finish_part(cairn_shape_context *shape_context)
{
    shape_context->distance = shape_context->distance / (cairn_real)shape_context->count[0] +
                              shape_context->params.missing_cost * shape_context->missing_share;
}

/* WHOLE: adds the least cost of a point of the second shape (a column minimum). */
static void find_nearest(cairn_shape_context *shape_context)
{
    cairn_real least = shape_context->cost[shape_context->row];

    for (int32_t i = 1; i < shape_context->count[0]; i++)
        least = cairn_min(least, shape_context->cost[(size_t)i * (size_t)shape_context->count[1] +
                                                     (size_t)shape_context->row]);
    shape_context->symmetric_distance += least / (cairn_real)shape_context->count[1];
}

/* WHOLE: computes the distance from the optimal assignment. */
static void finish_assignment(cairn_shape_context *shape_context)
{
    cairn_assignment_result pairs = cairn_assignment_read(shape_context->assignment);
    int32_t more = shape_context->count[0] > shape_context->count[1] ? shape_context->count[0]
                                                                     : shape_context->count[1];

    memcpy(shape_context->match, pairs.column,
           (size_t)shape_context->count[0] * sizeof *shape_context->match);
    shape_context->distance =
        (pairs.total_cost + shape_context->params.missing_cost * (cairn_real)(more - pairs.pairs)) /
        (cairn_real)more;
}

/* WHOLE: begins the assignment of the points. */
static void begin_assignment(cairn_shape_context *shape_context)
{
    shape_context->status =
        cairn_assignment_begin(shape_context->assignment, shape_context->cost,
                               shape_context->count[0], shape_context->count[1]);
    if (shape_context->status == CAIRN_OK)
        shape_context->status = CAIRN_MORE;
}

/* WHOLE: runs the assignment to its end. */
static int assign(cairn_shape_context *shape_context, cairn_budget *budget)
{
    shape_context->status = cairn_assignment_step(shape_context->assignment, budget);
    return shape_context->status != CAIRN_MORE;
}

/* The comparison: see Method in the head of this file. */
static int compare(cairn_shape_context *shape_context, cairn_budget *budget)
{
    const int32_t *count = shape_context->count;

    CAIRN_STEP_BEGIN(shape_context->resume);
    for (shape_context->shape = 0; shape_context->shape < 2; shape_context->shape++)
        for (shape_context->row = 0; shape_context->row < count[shape_context->shape];
             shape_context->row++) {
            CAIRN_STEP_CHARGE(shape_context, resume, budget,
                              1 + count[shape_context->shape] / DISTANCES_PER_UNIT);
            sum_distances(shape_context);
        }
    set_mean_distances(shape_context);
    if (shape_context->status == CAIRN_MORE) {
        for (shape_context->shape = 0; shape_context->shape < 2; shape_context->shape++)
            for (shape_context->row = 0; shape_context->row < count[shape_context->shape];
                 shape_context->row++) {
                CAIRN_STEP_CHARGE(shape_context, resume, budget, count[shape_context->shape]);
                histogram_row(shape_context);
            }
        shape_context->distance = shape_context->symmetric_distance = 0;
        for (shape_context->row = 0; shape_context->row < count[0]; shape_context->row++) {
            CAIRN_STEP_CHARGE(shape_context, resume, budget, UNITS_PER_COST * count[1]);
            cost_row(shape_context);
        }
        if (shape_context->kind == CAIRN_SHAPE_CONTEXT_PART) {
            finish_part(shape_context);
        } else {
            shape_context->symmetric_distance = shape_context->distance / (cairn_real)count[0];
            for (shape_context->row = 0; shape_context->row < count[1]; shape_context->row++) {
                CAIRN_STEP_CHARGE(shape_context, resume, budget, 1 + count[0] / MINIMA_PER_UNIT);
                find_nearest(shape_context);
            }
            begin_assignment(shape_context);
            if (shape_context->status == CAIRN_MORE)
                CAIRN_STEP_RUN(shape_context, resume, budget, assign);
            if (shape_context->status == CAIRN_OK)
                finish_assignment(shape_context);
        }
    }
    CAIRN_STEP_END(shape_context->resume);
}

cairn_status cairn_shape_context_step(cairn_shape_context *shape_context, cairn_budget *budget)
{
    if (shape_context == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (shape_context->status != CAIRN_MORE)
        return CAIRN_OK;
    if (!compare(shape_context, budget))
        return CAIRN_MORE;
    if (shape_context->status == CAIRN_MORE)
        shape_context->status = CAIRN_OK;
    return shape_context->status;
}

cairn_shape_context_result cairn_shape_context_read(const cairn_shape_context *shape_context)
{
    cairn_shape_context_result result = {0};

    if (shape_context != NULL && shape_context->status == CAIRN_OK) {
        result.match = shape_context->match;
        result.count = shape_context->count[0];
        result.distance = shape_context->distance;
        result.symmetric_distance = shape_context->symmetric_distance;
    }
    return result;
}
