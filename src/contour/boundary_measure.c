/* How much an image changes at each pixel.
 *
 * Method: samples become L, a, b (D65). Of each channel come maps, its values and the bins of its
 * histogram, to which a value belongs in part when it lies between two; a map is averaged by a
 * window passed over it thrice (nearly a Gaussian of the deviation half the width + 1/2), the root
 * is taken of a histogram's bin, and its slope, times that deviation, adds to the tensor of the
 * pixel.
 *
 * Source: Martin, Fowlkes and Malik 2004, section 3; the tensor: Di Zenzo 1986. */
#include "src/core/build.h"

#include "src/contour/boundary_work.h"

enum { L_BINS = 16, AB_BINS = 13, PASSES = 3, SCALES = 2, MEAN_SCALES = 3 };

#define MEAN_UNIT CAIRN_REAL(10.0) /* units of L, a, b that weigh 1 */
#define EMPTY     CAIRN_REAL(1e-3) /* a share of a window that says nothing yet */

/* A map: -1: the channel's values, otherwise a bin of its histogram. */
typedef struct map_name {
    int32_t channel, bin, half;
} map_name;

static int32_t bins_each(const cairn_boundary *b)
{
    return L_BINS + (b->channels > 1 ? 2 * AB_BINS : 0);
}

static int32_t maps_of(const cairn_boundary *b)
{
    return SCALES * bins_each(b) + MEAN_SCALES * b->channels;
}

/* Bins of both scales, then means of three: the fine one, between both, and of both together. */
static map_name name_of(const cairn_boundary *b)
{
    const int32_t halves[MEAN_SCALES] = {b->params.fine, (b->params.fine + b->params.coarse) / 2,
                                         b->params.fine + b->params.coarse};
    int32_t each = bins_each(b), map = b->map % each, mean = b->map - SCALES * each;
    map_name name;

    if (mean >= 0) {
        name.half = halves[mean / b->channels];
        name.channel = mean % b->channels;
        name.bin = -1;
        return name;
    }
    name.half = b->map < each ? b->params.fine : b->params.coarse;
    name.channel = map < L_BINS ? 0 : 1 + (map - L_BINS) / AB_BINS;
    name.bin = map < L_BINS ? map : (map - L_BINS) % AB_BINS;
    return name;
}

/* ---- Colour ---- */

/* The cube root, and below it the line that touches it. */
static cairn_real lightness(cairn_real t)
{
    return t > CAIRN_REAL(216.0) / 24389 ? cairn_exp(cairn_log(t) / 3)
                                         : (CAIRN_REAL(24389.0) / 27 * t + 16) / 116;
}

static void colour_row(const cairn_boundary *b)
{
    const uint8_t *sample = b->image.samples + b->image.stride * b->row;
    ptrdiff_t at = (ptrdiff_t)b->row * b->image.width;

    for (int32_t x = 0; x < b->image.width; x++, at++, sample += b->image.channels) {
        cairn_real blue = b->linear[sample[0]], green, red, fx, fy, fz;

        if (b->channels == 1) {
            b->colour[at] = 116 * lightness(blue) - 16;
            continue;
        }
        green = b->linear[sample[1]];
        red = b->linear[sample[2]];
        fx = lightness((CAIRN_REAL(0.412453) * red + CAIRN_REAL(0.357580) * green +
                        CAIRN_REAL(0.180423) * blue) /
                       CAIRN_REAL(0.950456));
        fy = lightness(CAIRN_REAL(0.212671) * red + CAIRN_REAL(0.715160) * green +
                       CAIRN_REAL(0.072169) * blue);
        fz = lightness((CAIRN_REAL(0.019334) * red + CAIRN_REAL(0.119193) * green +
                        CAIRN_REAL(0.950227) * blue) /
                       CAIRN_REAL(1.088754));
        b->colour[at] = 116 * fy - 16;
        b->colour[b->pixels + at] = 500 * (fx - fy);
        b->colour[2 * (ptrdiff_t)b->pixels + at] = 200 * (fy - fz);
    }
}

/* ---- Windows ---- */

/* Beyond its border an image goes on as its mirror image. */
static int32_t mirror(int32_t i, int32_t count)
{
    while (i < 0 || i >= count)
        i = i < 0 ? -1 - i : 2 * count - 1 - i;
    return i;
}

static void average_row(const cairn_real *from, cairn_real *to, int32_t width, int32_t half)
{
    cairn_real sum = 0, scale = 1 / (cairn_real)(2 * half + 1);

    for (int32_t i = -half; i <= half; i++)
        sum += from[mirror(i, width)];
    to[0] = sum * scale;
    for (int32_t x = 1; x < width; x++) {
        sum += from[mirror(x + half, width)] - from[mirror(x - half - 1, width)];
        to[x] = sum * scale;
    }
}

/* How far a value belongs to a bin. */
static cairn_real belongs(const map_name *name, cairn_real value)
{
    cairn_real most = name->channel == 0 ? 100 : BOUNDARY_AB_MOST,
               least = name->channel == 0 ? 0 : -BOUNDARY_AB_MOST;
    cairn_real last = (cairn_real)((name->channel == 0 ? L_BINS : AB_BINS) - 1);
    cairn_real at = (cairn_max(least, cairn_min(most, value)) - least) / (most - least) * last;

    return cairn_max(0, 1 - cairn_abs(at - (cairn_real)name->bin));
}

/* The map's row, averaged along itself. */
static void fill_row(cairn_boundary *b)
{
    map_name name = name_of(b);
    int32_t width = b->image.width, some = 0;
    cairn_real *line[2] = {b->line, b->line + b->params.max_width};
    cairn_real *to = b->one + (ptrdiff_t)b->row * width;
    const cairn_real *from =
        b->colour + ((ptrdiff_t)name.channel * b->pixels + (ptrdiff_t)b->row * width);

    for (int32_t x = 0; x < width; x++) {
        line[0][x] = name.bin < 0 ? from[x] / MEAN_UNIT : belongs(&name, from[x]);
        some |= line[0][x] != 0;
    }
    b->some |= some;
    if (!some) {
        for (int32_t x = 0; x < width; x++)
            to[x] = 0;
        return;
    }
    average_row(line[0], line[1], width, name.half);
    average_row(line[1], line[0], width, name.half);
    average_row(line[0], to, width, name.half);
}

/* The next row of what is averaged along columns, from one picture to the other. */
static void column_row(const cairn_boundary *b, int32_t half)
{
    int32_t width = b->image.width, height = b->image.height;
    const cairn_real *from = b->pass % 2 == 0 ? b->one : b->other;
    cairn_real *to = (b->pass % 2 == 0 ? b->other : b->one) + (ptrdiff_t)b->row * width;
    cairn_real *sum = b->line, scale = 1 / (cairn_real)(2 * half + 1);

    if (b->row == 0) {
        for (int32_t x = 0; x < width; x++)
            sum[x] = 0;
        for (int32_t i = -half; i <= half; i++)
            for (int32_t x = 0; x < width; x++)
                sum[x] += from[(ptrdiff_t)mirror(i, height) * width + x];
    } else {
        const cairn_real *comes = from + (ptrdiff_t)mirror(b->row + half, height) * width;
        const cairn_real *goes = from + (ptrdiff_t)mirror(b->row - half - 1, height) * width;

        for (int32_t x = 0; x < width; x++)
            sum[x] += comes[x] - goes[x];
    }
    for (int32_t x = 0; x < width; x++)
        to[x] = sum[x] * scale;
}

/* ---- Change ---- */

/* Of a bin its root: averages of what is not negative may fall below 0 by rounding. */
static cairn_real value_of(const map_name *name, cairn_real average)
{
    return name->bin < 0 ? average : cairn_sqrt(cairn_max(0, average) + EMPTY);
}

static void change_row(const cairn_boundary *b)
{
    map_name name = name_of(b);
    int32_t width = b->image.width, last = b->image.height - 1;
    const cairn_real *row = b->other + (ptrdiff_t)b->row * width;
    const cairn_real *above = b->row > 0 ? row - width : row,
                     *below = b->row < last ? row + width : row;
    boundary_change *change = b->change + (ptrdiff_t)b->row * width;
    cairn_real deviation = (cairn_real)name.half + CAIRN_REAL(0.5);
    cairn_real weight = (name.bin < 0 ? 1 : b->params.distribution) * deviation * deviation / 4;

    /* The roots of a row are taken once; line 1 is free. */
    for (int32_t x = 0; x < width; x++)
        b->line[x] = value_of(&name, row[x]);
    for (int32_t x = 0; x < width; x++) {
        cairn_real u = b->line[x + 1 < width ? x + 1 : x] - b->line[x > 0 ? x - 1 : x];
        cairn_real v =
            below[x] == above[x] ? 0 : value_of(&name, below[x]) - value_of(&name, above[x]);

        change[x].xx += weight * u * u;
        change[x].xy += weight * u * v;
        change[x].yy += weight * v * v;
    }
}

static void strength_row(const cairn_boundary *b)
{
    for (int32_t x = 0; x < b->image.width; x++) {
        ptrdiff_t at = (ptrdiff_t)b->row * b->image.width + x;
        const boundary_change *c = &b->change[at];
        cairn_real apart = c->xx - c->yy;

        b->one[at] =
            cairn_sqrt((c->xx + c->yy + cairn_sqrt(apart * apart + 4 * c->xy * c->xy)) / 2);
    }
}

/* ---- Rows ---- */

int32_t cairn_boundary_measure_cost(const cairn_boundary *b)
{
    int32_t width = b->image.width;

    switch (b->phase) {
    case BOUNDARY_COLOUR:
        return 5 * width;
    case BOUNDARY_COLUMNS:
        return boundary_share(width * (b->row == 0 ? b->params.fine + b->params.coarse + 2 : 1), 8);
    default:
        return boundary_share(width, 2);
    }
}

static void clear_change(const cairn_boundary *b)
{
    boundary_change none = {0, 0, 0};

    for (int32_t x = 0; x < b->image.width; x++)
        b->change[(ptrdiff_t)b->row * b->image.width + x] = none;
}

static void next_map(cairn_boundary *b)
{
    b->some = 0;
    b->phase = ++b->map < maps_of(b) ? BOUNDARY_FILL : BOUNDARY_STRENGTH;
}

/* A map that is 0 everywhere changes nowhere. */
static void end_rows(cairn_boundary *b)
{
    b->row = 0;
    if (b->phase == BOUNDARY_COLOUR) {
        b->phase = BOUNDARY_FILL;
    } else if (b->phase == BOUNDARY_FILL) {
        b->pass = 0;
        if (b->some)
            b->phase = BOUNDARY_COLUMNS;
        else
            next_map(b);
    } else if (b->phase == BOUNDARY_COLUMNS) {
        if (++b->pass == PASSES)
            b->phase = BOUNDARY_CHANGE;
    } else if (b->phase == BOUNDARY_CHANGE) {
        next_map(b);
    } else {
        b->phase = BOUNDARY_FLOOD;
    }
}

void cairn_boundary_measure_row(cairn_boundary *b)
{
    if (b->phase == BOUNDARY_COLOUR) {
        colour_row(b);
        clear_change(b);
    } else if (b->phase == BOUNDARY_FILL) {
        fill_row(b);
    } else if (b->phase == BOUNDARY_COLUMNS) {
        column_row(b, name_of(b).half);
    } else if (b->phase == BOUNDARY_CHANGE) {
        change_row(b);
    } else {
        strength_row(b);
        cairn_boundary_flood_row(b, b->row);
    }
    if (++b->row == b->image.height)
        end_rows(b);
}
