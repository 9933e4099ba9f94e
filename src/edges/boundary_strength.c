/* Edge strength of each pixel: local colour gradients from window means and histograms.
 *
 * Method:
 * 1. Samples are converted to CIE L, a, b (D65).
 * 2. Each channel has feature maps: its values, and the bins of its histogram with linear
 *    interpolation between two bins.
 * 3. A box filter applied three times approximates a Gaussian of standard deviation half-width +
 *    1/2.
 * 4. The square root is taken of a histogram bin.
 * 5. The gradient of a map, times the standard deviation, adds to the structure tensor of the
 *    pixel.
 * 6. The edge strength is the square root of the tensor's larger eigenvalue.
 *
 * Source: Martin, Fowlkes and Malik 2004, section 3; the tensor: Di Zenzo 1986. */
#include "src/base/build.h"

#include "src/edges/boundary_work.h"

enum { L_BINS = 16, AB_BINS = 13, PASS_COUNT = 3, SCALE_COUNT = 2, MEAN_SCALES = 3 };

#define COLOUR_UNIT CAIRN_REAL(10.0) /* Units of L, a, b that have weight 1. */
/* Regularizer added to a bin's share of the window before the square root. */
#define HISTOGRAM_REGULARIZER CAIRN_REAL(1e-3)

/* A feature map: bin -1 is the channel's values, otherwise a histogram bin; half is the
 * half-width, px. */
typedef struct feature_map {
    int32_t channel, bin, half;
} feature_map;

/* Returns the number of histogram bins of all channels. */
static int32_t bins_per_scale(const cairn_boundary *boundary)
{
    return L_BINS + (boundary->channels > 1 ? 2 * AB_BINS : 0);
}

/* Returns the number of feature maps. */
static int32_t map_count(const cairn_boundary *boundary)
{
    return SCALE_COUNT * bins_per_scale(boundary) + MEAN_SCALES * boundary->channels;
}

/* Returns the current feature map. Order: histogram bins at both scales, then means at three
 * scales (fine, average of both, sum of both). */
static feature_map feature_map_of(const cairn_boundary *boundary)
{
    const int32_t halves[MEAN_SCALES] = {
        boundary->params.fine_half_width,
        (boundary->params.fine_half_width + boundary->params.coarse_half_width) / 2,
        boundary->params.fine_half_width + boundary->params.coarse_half_width};
    int32_t each = bins_per_scale(boundary), index = boundary->filter.map_index % each,
            mean = boundary->filter.map_index - SCALE_COUNT * each;
    feature_map map;

    if (mean >= 0) {
        map.half = halves[mean / boundary->channels];
        map.channel = mean % boundary->channels;
        map.bin = -1;
        return map;
    }
    map.half = boundary->filter.map_index < each ? boundary->params.fine_half_width
                                                 : boundary->params.coarse_half_width;
    map.channel = index < L_BINS ? 0 : 1 + (index - L_BINS) / AB_BINS;
    map.bin = index < L_BINS ? index : (index - L_BINS) % AB_BINS;
    return map;
}

/* ---- Colour ---- */

/* The CIE L, a, b transfer function: the cube root, with its tangent near 0. */
static cairn_real lab_curve(cairn_real t)
{
    return t > CAIRN_REAL(216.0) / 24389 ? cairn_exp(cairn_log(t) / 3)
                                         : (CAIRN_REAL(24389.0) / 27 * t + 16) / 116;
}

/* Converts a row of samples to CIE L, a, b. */
static void colour_row(const cairn_boundary *boundary)
{
    const uint8_t *sample = boundary->image.samples + boundary->image.stride * boundary->filter.row;
    ptrdiff_t at = (ptrdiff_t)boundary->filter.row * boundary->image.width;

    for (int32_t x = 0; x < boundary->image.width; x++, at++, sample += boundary->image.channels) {
        cairn_real blue = boundary->linear[sample[0]], green, red, fx, fy, fz;

        if (boundary->channels == 1) {
            boundary->colour[at] = 116 * lab_curve(blue) - 16;
            continue;
        }
        green = boundary->linear[sample[1]];
        red = boundary->linear[sample[2]];
        fx = lab_curve((CAIRN_REAL(0.412453) * red + CAIRN_REAL(0.357580) * green +
                        CAIRN_REAL(0.180423) * blue) /
                       CAIRN_REAL(0.950456));
        fy = lab_curve(CAIRN_REAL(0.212671) * red + CAIRN_REAL(0.715160) * green +
                       CAIRN_REAL(0.072169) * blue);
        fz = lab_curve((CAIRN_REAL(0.019334) * red + CAIRN_REAL(0.119193) * green +
                        CAIRN_REAL(0.950227) * blue) /
                       CAIRN_REAL(1.088754));
        boundary->colour[at] = 116 * fy - 16;
        boundary->colour[boundary_pixels(boundary) + at] = 500 * (fx - fy);
        boundary->colour[2 * (ptrdiff_t)boundary_pixels(boundary) + at] = 200 * (fy - fz);
    }
}

/* ---- Box filters ---- */

/* Reflects an index at the image's border (symmetric padding). */
static int32_t reflect_index(int32_t i, int32_t count)
{
    while (i < 0 || i >= count)
        i = i < 0 ? -1 - i : 2 * count - 1 - i;
    return i;
}

/* Filters a row by a box of half-width `half`, as a running sum. */
static void box_filter_row(const cairn_real *from, cairn_real *to, int32_t width, int32_t half)
{
    cairn_real sum = 0, scale = 1 / (cairn_real)(2 * half + 1);

    for (int32_t i = -half; i <= half; i++)
        sum += from[reflect_index(i, width)];
    to[0] = sum * scale;
    for (int32_t x = 1; x < width; x++) {
        sum += from[reflect_index(x + half, width)] - from[reflect_index(x - half - 1, width)];
        to[x] = sum * scale;
    }
}

/* Returns the membership of a value in a histogram bin (linear interpolation), 0 ... 1. */
static cairn_real bin_membership(const feature_map *map, cairn_real value)
{
    cairn_real upper = map->channel == 0 ? 100 : BOUNDARY_MAX_AB,
               lower = map->channel == 0 ? 0 : -BOUNDARY_MAX_AB;
    cairn_real last = (cairn_real)((map->channel == 0 ? L_BINS : AB_BINS) - 1);
    cairn_real at = (cairn_max(lower, cairn_min(upper, value)) - lower) / (upper - lower) * last;

    return cairn_max(0, 1 - cairn_abs(at - (cairn_real)map->bin));
}

/* Computes a row of the feature map and filters it along the row. */
static void filter_row(cairn_boundary *boundary)
{
    feature_map map = feature_map_of(boundary);
    int32_t width = boundary->image.width, some = 0;
    cairn_real *line[2] = {boundary->filter.row_buffer,
                           boundary->filter.row_buffer + boundary->params.max_width};
    cairn_real *to = boundary->strength + (ptrdiff_t)boundary->filter.row * width;
    const cairn_real *from =
        boundary->colour + ((ptrdiff_t)map.channel * boundary_pixels(boundary) +
                            (ptrdiff_t)boundary->filter.row * width);

    for (int32_t x = 0; x < width; x++) {
        line[0][x] = map.bin < 0 ? from[x] / COLOUR_UNIT : bin_membership(&map, from[x]);
        some |= line[0][x] != 0;
    }
    boundary->filter.is_nonzero |= some;
    if (!some) {
        for (int32_t x = 0; x < width; x++)
            to[x] = 0;
        return;
    }
    box_filter_row(line[0], line[1], width, map.half);
    box_filter_row(line[1], line[0], width, map.half);
    box_filter_row(line[0], to, width, map.half);
}

/* Filters along columns: computes the next row of the target image by running column sums. */
static void filter_column_row(const cairn_boundary *boundary, int32_t half)
{
    int32_t width = boundary->image.width, height = boundary->image.height;
    const cairn_real *from =
        boundary->filter.pass % 2 == 0 ? boundary->strength : boundary->filter.scratch;
    cairn_real *to =
        (boundary->filter.pass % 2 == 0 ? boundary->filter.scratch : boundary->strength) +
        (ptrdiff_t)boundary->filter.row * width;
    cairn_real *sum = boundary->filter.row_buffer, scale = 1 / (cairn_real)(2 * half + 1);

    if (boundary->filter.row == 0) {
        for (int32_t x = 0; x < width; x++)
            sum[x] = 0;
        for (int32_t i = -half; i <= half; i++)
            for (int32_t x = 0; x < width; x++)
                sum[x] += from[(ptrdiff_t)reflect_index(i, height) * width + x];
    } else {
        const cairn_real *entering =
            from + (ptrdiff_t)reflect_index(boundary->filter.row + half, height) * width;
        const cairn_real *leaving =
            from + (ptrdiff_t)reflect_index(boundary->filter.row - half - 1, height) * width;

        for (int32_t x = 0; x < width; x++)
            sum[x] += entering[x] - leaving[x];
    }
    for (int32_t x = 0; x < width; x++)
        to[x] = sum[x] * scale;
}

/* ---- Structure tensor ---- */

/* Returns the feature value: a filtered mean, or the square root of a histogram bin. Rounding
 * may make a filtered bin negative. */
static cairn_real feature_value(const feature_map *map, cairn_real average)
{
    return map->bin < 0 ? average : cairn_sqrt(cairn_max(0, average) + HISTOGRAM_REGULARIZER);
}

/* Adds the gradient of the current feature map to the structure tensors of a row. */
static void tensor_row(const cairn_boundary *boundary)
{
    feature_map map = feature_map_of(boundary);
    int32_t width = boundary->image.width, last = boundary->image.height - 1;
    const cairn_real *row = boundary->filter.scratch + (ptrdiff_t)boundary->filter.row * width;
    const cairn_real *above = boundary->filter.row > 0 ? row - width : row,
                     *below = boundary->filter.row < last ? row + width : row;
    boundary_tensor *change = boundary->filter.tensor + (ptrdiff_t)boundary->filter.row * width;
    cairn_real deviation = (cairn_real)map.half + CAIRN_REAL(0.5);
    cairn_real weight =
        (map.bin < 0 ? 1 : boundary->params.histogram_weight) * deviation * deviation / 4;

    /* The roots of a row are computed once into the first row of the row buffer. */
    for (int32_t x = 0; x < width; x++)
        boundary->filter.row_buffer[x] = feature_value(&map, row[x]);
    for (int32_t x = 0; x < width; x++) {
        cairn_real u = boundary->filter.row_buffer[x + 1 < width ? x + 1 : x] -
                       boundary->filter.row_buffer[x > 0 ? x - 1 : x];
        cairn_real v = below[x] == above[x]
                           ? 0
                           : feature_value(&map, below[x]) - feature_value(&map, above[x]);

        change[x].xx += weight * u * u;
        change[x].xy += weight * u * v;
        change[x].yy += weight * v * v;
    }
}

/* Computes the edge strengths of a row from the structure tensors. */
static void strength_row(const cairn_boundary *boundary)
{
    for (int32_t x = 0; x < boundary->image.width; x++) {
        ptrdiff_t at = (ptrdiff_t)boundary->filter.row * boundary->image.width + x;
        const boundary_tensor *c = &boundary->filter.tensor[at];
        cairn_real difference = c->xx - c->yy;

        boundary->strength[at] = cairn_sqrt(
            (c->xx + c->yy + cairn_sqrt(difference * difference + 4 * c->xy * c->xy)) / 2);
    }
}

/* ---- The phase ---- */

/* Returns the work units of a row that is filtered along columns; the first row sums the window. */
static int32_t column_units(const cairn_boundary *boundary)
{
    int32_t rows = boundary->filter.row == 0
                       ? boundary->params.fine_half_width + boundary->params.coarse_half_width + 2
                       : 1;

    return boundary_ceil_divide(boundary->image.width * rows, 8);
}

static void clear_tensor_row(const cairn_boundary *boundary)
{
    boundary_tensor none = {0, 0, 0};

    for (int32_t x = 0; x < boundary->image.width; x++)
        boundary->filter.tensor[(ptrdiff_t)boundary->filter.row * boundary->image.width + x] = none;
}

int cairn_boundary_measure(cairn_boundary *boundary, cairn_budget *budget)
{
    int32_t height = boundary->image.height,
            row_units = boundary_ceil_divide(boundary->image.width, 2);

    CAIRN_STEP_BEGIN(boundary->phase_resume);
    for (boundary->filter.row = 0; boundary->filter.row < height; boundary->filter.row++) {
        CAIRN_STEP_CHARGE(boundary, phase_resume, budget, 5 * boundary->image.width);
        colour_row(boundary);
        clear_tensor_row(boundary);
    }
    for (boundary->filter.map_index = 0; boundary->filter.map_index < map_count(boundary);
         boundary->filter.map_index++) {
        boundary->filter.is_nonzero = 0;
        for (boundary->filter.row = 0; boundary->filter.row < height; boundary->filter.row++) {
            CAIRN_STEP_CHARGE(boundary, phase_resume, budget, row_units);
            filter_row(boundary);
        }
        /* A map that is 0 everywhere has no gradient. */
        if (!boundary->filter.is_nonzero)
            continue;
        for (boundary->filter.pass = 0; boundary->filter.pass < PASS_COUNT; boundary->filter.pass++)
            for (boundary->filter.row = 0; boundary->filter.row < height; boundary->filter.row++) {
                CAIRN_STEP_CHARGE(boundary, phase_resume, budget, column_units(boundary));
                filter_column_row(boundary, feature_map_of(boundary).half);
            }
        for (boundary->filter.row = 0; boundary->filter.row < height; boundary->filter.row++) {
            CAIRN_STEP_CHARGE(boundary, phase_resume, budget, row_units);
            tensor_row(boundary);
        }
    }
    for (boundary->filter.row = 0; boundary->filter.row < height; boundary->filter.row++) {
        CAIRN_STEP_CHARGE(boundary, phase_resume, budget, row_units);
        strength_row(boundary);
        cairn_boundary_flood_row(boundary, boundary->filter.row);
    }
    CAIRN_STEP_END(boundary->phase_resume);
}
