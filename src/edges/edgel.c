/* Sub-pixel edgels by third-order derivatives.
 *
 * Method:
 * 1. The image is convolved with a Gaussian and its first three derivatives along the rows, then
 *    along the columns (separable filters). The products are nine partial derivatives of the
 *    smoothed image.
 * 2. F (the second derivative along the gradient, times the squared gradient magnitude) and its
 *    gradient follow from them.
 * 3. Where F changes sign between two adjacent pixels, the zero crossing and the edgel's attributes
 *    are interpolated linearly. Rather vertical edges are interpolated between pixels of a row, the
 *    others between pixels of a column. An edge is therefore detected once per row or column.
 * 4. At a maximum of the gradient magnitude F decreases in the direction of the gradient. Where it
 *    increases there is a minimum, and no edge.
 *
 * Memory layout: a ring buffer of horizontally smoothed rows, as many as the filter is high; F and
 * its attributes for the current and the previous row; the edgels.
 *
 * Limits: below sigma 0.7 the sampled filters no longer approximate derivatives. Edges closer than
 * two sigma repel each other.
 *
 * Source: Adluru 2008, section 3.1; Tamrakar and Kimia 2007, "No grouping left behind: from edges
 * to curve fragments". */
#include "src/base/build.h"

#include <string.h>

#include "cairn/edgel.h"
#include "src/base/object.h"
#include "src/base/step.h"

enum { MAX_EDGELS = 1 << 28, MAX_REACH = 32, MAX_TAPS = 2 * MAX_REACH + 1 };
/* Orders of derivatives along one axis, 0 ... 3. */
enum { DERIVATIVE_ORDERS = 4 };
/* Multiplications of a filter per work unit, and filters of a pixel along and across the rows. */
enum { TAPS_PER_UNIT = 48, ROW_FILTERS = DERIVATIVE_ORDERS, COLUMN_FILTERS = 9 };

#define REACH_SIGMAS CAIRN_REAL(4.0) /* radius of the filters, in sigmas */

/* Response F of a pixel, its gradient, and the image gradient. */
typedef struct edgel_sample {
    cairn_real response;
    cairn_vec2 response_gradient, gradient;
} edgel_sample;

struct cairn_edgel_set {
    cairn_edgel_params params;
    cairn_raster_u8_view grey;
    cairn_real *smooth;   /* [taps][DERIVATIVE_ORDERS][max_width] ring buffer of smoothed rows */
    edgel_sample *sample; /* [2][max_width] of even and of odd rows */
    cairn_edgel *edgels;  /* [max_edgels] */
    cairn_real filter[DERIVATIVE_ORDERS][MAX_TAPS];
    cairn_real cos_turn;
    int32_t taps; /* of a filter: twice its radius, and 1 */
    int32_t count;
    int32_t next_row; /* next row to smooth */
    int32_t x, y;     /* current pixel */
    /* CAIRN_MORE: in work; CAIRN_OK: the result is complete; else there is none */
    cairn_status status;
    int32_t resume; /* resume point */
    int32_t units_charged;
};

#define INTEGER(field, ...)  CAIRN_INTEGER(cairn_edgel_params, field, __VA_ARGS__)
#define NUMBER(field, ...)   CAIRN_NUMBER(cairn_edgel_params, field, __VA_ARGS__)
#define POSITIVE(field, ...) CAIRN_NUMBER_ABOVE(cairn_edgel_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_width, 640, 1, CAIRN_RASTER_MAX_SIDE),
    INTEGER(max_height, 480, 1, CAIRN_RASTER_MAX_SIDE),
    INTEGER(max_edgels, 40000, 1, MAX_EDGELS),
    NUMBER(sigma, CAIRN_REAL(1.5), CAIRN_REAL(0.7), 8),
    POSITIVE(min_gradient, 2, 0, CAIRN_REAL_MAX),
    POSITIVE(max_normal_angle, 60 * (CAIRN_PI / 180), 0, CAIRN_PI / 2),
};
extern const cairn_parameters cairn_edgel_parameters;
const cairn_parameters cairn_edgel_parameters = CAIRN_PARAMETERS("edgel", cairn_edgel_params, rows);

cairn_edgel_params cairn_edgel_default(void)
{
    cairn_edgel_params params;

    cairn_parameters_preset(&cairn_edgel_parameters, &params);
    return params;
}

cairn_status cairn_edgel_check(const cairn_edgel_params *params, cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_edgel_parameters, params, fault);
}

/* ---- Filters ---- */

/* Radius of the filters, px. */
static int32_t radius_of(const cairn_edgel_set *set)
{
    return set->taps / 2;
}

/* Moment of a filter: sum of its weights times the position to a power. */
static cairn_real moment(const cairn_edgel_set *set, int32_t order, int32_t power)
{
    cairn_real sum = 0;

    for (int32_t i = 0; i < set->taps; i++) {
        cairn_real weight = set->filter[order][i];

        for (int32_t k = 0; k < power; k++)
            weight *= (cairn_real)(i - radius_of(set));
        sum += weight;
    }
    return sum;
}

/* filter[order] += factor * filter[other]. */
static void add_filter(cairn_edgel_set *set, int32_t order, cairn_real factor, int32_t other)
{
    for (int32_t i = 0; i < set->taps; i++)
        set->filter[order][i] += factor * set->filter[other][i];
}

/* Computes the sampled, truncated Gaussian and its derivatives, corrected to be exact for
 * polynomials of third degree: the derivative of x^order is order!, and that of lower powers is
 * 0. */
static void make_filters(cairn_edgel_set *set)
{
    static const cairn_real factorial[DERIVATIVE_ORDERS] = {1, 1, 2, 6};
    cairn_real s2 = set->params.sigma * set->params.sigma;

    for (int32_t i = 0; i < set->taps; i++) {
        cairn_real x = (cairn_real)(i - radius_of(set)), g = cairn_exp(-x * x / (2 * s2));

        set->filter[0][i] = g;
        set->filter[1][i] = x * g;
        set->filter[2][i] = (x * x - s2) * g;
        set->filter[3][i] = x * (x * x - 3 * s2) * g;
    }
    for (int32_t order = 0; order < DERIVATIVE_ORDERS; order++) {
        if (order >= 2)
            add_filter(set, order,
                       -moment(set, order, order - 2) / moment(set, order - 2, order - 2),
                       order - 2);
        add_filter(set, order, factorial[order] / moment(set, order, order) - 1, order);
    }
}

/* ---- The object ---- */

/* Radius of the filters, px. */
static int32_t reach_of(const cairn_edgel_params *params)
{
    return cairn_real_to_int(cairn_ceil(REACH_SIGMAS * params->sigma));
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_edgel_set *build(cairn_pool *pool, const cairn_edgel_params *params)
{
    size_t width = (size_t)params->max_width, taps = 2 * (size_t)reach_of(params) + 1;
    cairn_edgel_set *set = cairn_object_take(pool, sizeof *set);

    CAIRN_TAKE(set, pool, smooth, taps * DERIVATIVE_ORDERS * width);
    CAIRN_TAKE(set, pool, sample, 2 * width);
    CAIRN_TAKE(set, pool, edgels, params->max_edgels);
    if (set != NULL) {
        set->params = *params;
        set->status = CAIRN_EMPTY;
        set->taps = (int32_t)taps;
        set->cos_turn = cairn_cos(params->max_normal_angle);
        make_filters(set);
    }
    return set;
}

CAIRN_OBJECT(edgel, edgel_set, build);

cairn_status cairn_edgel_begin(cairn_edgel_set *set, cairn_raster_u8_view grey)
{
    cairn_status status = set != NULL ? cairn_raster_u8_check(grey) : CAIRN_BAD_ARGUMENT;

    if (status != CAIRN_OK)
        return status;
    if (grey.width > set->params.max_width || grey.height > set->params.max_height)
        return CAIRN_FULL;
    set->grey = grey;
    set->count = 0;
    set->units_charged = 0;
    set->resume = 0;
    set->status = CAIRN_MORE;
    return CAIRN_OK;
}

/* ---- Derivatives ---- */

static int32_t clamp(int32_t i, int32_t count)
{
    return i < 0 ? 0 : i >= count ? count - 1 : i;
}

static cairn_real *smooth_row(const cairn_edgel_set *set, int32_t y, int32_t order)
{
    return &set->smooth[((ptrdiff_t)(y % set->taps) * DERIVATIVE_ORDERS + order) *
                        set->params.max_width];
}

static edgel_sample *sample_row(const cairn_edgel_set *set, int32_t y)
{
    return &set->sample[(ptrdiff_t)(y % 2) * set->params.max_width];
}

/* Convolves row `next_row` at pixel x with all horizontal filters. */
static void smooth_pixel(const cairn_edgel_set *set)
{
    const uint8_t *row = set->grey.data + set->grey.stride * set->next_row;
    cairn_real sum[DERIVATIVE_ORDERS] = {0, 0, 0, 0};

    for (int32_t i = 0; i < set->taps; i++) {
        cairn_real grey = (cairn_real)row[clamp(set->x + i - radius_of(set), set->grey.width)];

        for (int32_t order = 0; order < DERIVATIVE_ORDERS; order++)
            sum[order] += set->filter[order][i] * grey;
    }
    for (int32_t order = 0; order < DERIVATIVE_ORDERS; order++)
        smooth_row(set, set->next_row, order)[set->x] = sum[order];
}

/* Partial derivatives at the current pixel: d[i][j], i times along x and j times along y, i + j <=
 * 3. */
static void derive(const cairn_edgel_set *set, cairn_real d[DERIVATIVE_ORDERS][DERIVATIVE_ORDERS])
{
    memset(d, 0, sizeof(cairn_real[DERIVATIVE_ORDERS][DERIVATIVE_ORDERS]));
    for (int32_t k = 0; k < set->taps; k++) {
        int32_t row = clamp(set->y + k - radius_of(set), set->grey.height);

        for (int32_t i = 0; i < DERIVATIVE_ORDERS; i++) {
            cairn_real along = smooth_row(set, row, i)[set->x];

            for (int32_t j = i == 0; i + j < DERIVATIVE_ORDERS; j++)
                d[i][j] += set->filter[j][k] * along;
        }
    }
}

static edgel_sample sample_of(cairn_real d[DERIVATIVE_ORDERS][DERIVATIVE_ORDERS])
{
    cairn_real x = d[1][0], y = d[0][1], xx = d[2][0], xy = d[1][1], yy = d[0][2];
    /* Half the gradient of the squared gradient magnitude. */
    cairn_real u = x * xx + y * xy, v = x * xy + y * yy;
    edgel_sample sample;

    sample.response = x * u + y * v;
    sample.response_gradient.x =
        2 * (u * xx + v * xy) + x * x * d[3][0] + 2 * x * y * d[2][1] + y * y * d[1][2];
    sample.response_gradient.y =
        2 * (u * xy + v * yy) + x * x * d[2][1] + 2 * x * y * d[1][2] + y * y * d[0][3];
    sample.gradient.x = x;
    sample.gradient.y = y;
    return sample;
}

/* Sample of the current pixel. */
static void derive_pixel(const cairn_edgel_set *set)
{
    cairn_real d[DERIVATIVE_ORDERS][DERIVATIVE_ORDERS];

    derive(set, d);
    sample_row(set, set->y)[set->x] = sample_of(d);
}

/* ---- Zero crossings ---- */

/* Second derivative along the gradient over the gradient magnitude: linear across a step edge, so
 * that its zero can be interpolated. */
static cairn_real normalized_second_derivative(const edgel_sample *sample)
{
    cairn_real slope = cairn_vec2_norm(sample->gradient);

    return sample->response / cairn_max(slope * slope * slope, CAIRN_REAL_MIN);
}

/* Edgel between a pixel and its neighbour to the right or below. Returns 0 when there is none. */
static int edgel_between(const cairn_edgel_set *set, const edgel_sample *a, const edgel_sample *b,
                         int upright, cairn_edgel *edgel, cairn_real *share)
{
    cairn_real second = normalized_second_derivative(a);
    cairn_vec2 gradient, normal;

    if ((a->response > 0) == (b->response > 0))
        return 0;
    *share = second / (second - normalized_second_derivative(b));
    gradient = cairn_vec2_interpolate(a->gradient, b->gradient, *share);
    normal =
        cairn_vec2_unit(cairn_vec2_interpolate(a->response_gradient, b->response_gradient, *share));
    edgel->normal = cairn_vec2_scale(normal, -1);
    edgel->gradient_magnitude = cairn_vec2_norm(gradient);
    return edgel->gradient_magnitude >= set->params.min_gradient &&
           (cairn_abs(normal.x) >= cairn_abs(normal.y)) == upright &&
           cairn_vec2_dot(edgel->normal, gradient) >= set->cos_turn * edgel->gradient_magnitude;
}

/* More than max_edgels end the detection. */
static void add_edgel(cairn_edgel_set *set, const cairn_edgel *edgel, cairn_real x, cairn_real y)
{
    if (set->count == set->params.max_edgels) {
        set->status = CAIRN_FULL;
        return;
    }
    set->edgels[set->count] = *edgel;
    set->edgels[set->count].position.x = x;
    set->edgels[set->count++].position.y = y;
}

/* Tests the pixel pairs above-current and current-right. */
static void find_at_pixel(cairn_edgel_set *set)
{
    const edgel_sample *here = &sample_row(set, set->y)[set->x];
    cairn_real x = (cairn_real)set->x, y = (cairn_real)set->y, share;
    cairn_edgel edgel;

    if (set->y > 0 &&
        edgel_between(set, &sample_row(set, set->y - 1)[set->x], here, 0, &edgel, &share))
        add_edgel(set, &edgel, x, y - 1 + share);
    if (set->x + 1 < set->grey.width && edgel_between(set, here, here + 1, 1, &edgel, &share))
        add_edgel(set, &edgel, x + share, y);
}

/* ---- Rows ---- */

/* Units of a pixel that `filters` are applied to. */
static int32_t pixel_cost(const cairn_edgel_set *set, int32_t filters)
{
    return 1 + filters * set->taps / TAPS_PER_UNIT;
}

/* The edgels, row by row. Rows are smoothed as soon as the filters across them need them. */
static int detect(cairn_edgel_set *set, cairn_budget *budget)
{
    int32_t width = set->grey.width, height = set->grey.height;

    CAIRN_STEP_BEGIN(set->resume);
    set->next_row = 0;
    for (set->y = 0; set->y < height && set->status == CAIRN_MORE; set->y++) {
        for (; set->next_row < height && set->next_row <= set->y + radius_of(set); set->next_row++)
            for (set->x = 0; set->x < width; set->x++) {
                CAIRN_STEP_CHARGE(set, resume, budget, pixel_cost(set, ROW_FILTERS));
                smooth_pixel(set);
            }
        for (set->x = 0; set->x < width; set->x++) {
            CAIRN_STEP_CHARGE(set, resume, budget, pixel_cost(set, COLUMN_FILTERS));
            derive_pixel(set);
        }
        for (set->x = 0; set->x < width && set->status == CAIRN_MORE; set->x++) {
            CAIRN_STEP_CHARGE(set, resume, budget, pixel_cost(set, 0));
            find_at_pixel(set);
        }
    }
    CAIRN_STEP_END(set->resume);
}

cairn_status cairn_edgel_step(cairn_edgel_set *set, cairn_budget *budget)
{
    if (set == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (set->status != CAIRN_MORE)
        return CAIRN_OK;
    if (!detect(set, budget))
        return CAIRN_MORE;
    if (set->status == CAIRN_MORE)
        set->status = CAIRN_OK;
    return set->status;
}

const cairn_edgel *cairn_edgel_list(const cairn_edgel_set *set, int32_t *count)
{
    int has = set != NULL && set->status == CAIRN_OK;

    if (count != NULL)
        *count = has ? set->count : 0;
    return has ? set->edgels : NULL;
}
