/* Regions: basins of the strengths, their borders and colours.
 *
 * Method: pixels are taken in the order of their strengths, in steps of 1/512; one that no basin
 * has reached is the bottom of a new one, and basins grow over what borders on them, first come
 * first served (Meyer 1991). A table of pairs of regions finds borders. */
#include "src/core/build.h"

#include "src/contour/boundary_work.h"

#define STEPS CAIRN_REAL(512.0) /* of levels to a unit of strength */

/* ---- Flooding ---- */

static int32_t level_of(const cairn_boundary *b, int32_t pixel)
{
    return cairn_real_to_int(cairn_min(b->one[pixel] * STEPS, BOUNDARY_LEVELS - 1));
}

void cairn_boundary_flood_begin(cairn_boundary *b)
{
    for (int32_t i = 0; i < BOUNDARY_LEVELS; i++)
        b->head[i] = b->tail[i] = b->first[i] = -1;
    b->level = 0;
}

void cairn_boundary_flood_row(cairn_boundary *b, int32_t row)
{
    for (int32_t x = 0; x < b->image.width; x++) {
        int32_t pixel = row * b->image.width + x, level = level_of(b, pixel);

        b->label[pixel] = b->same[pixel] = -1;
        b->walked[pixel] = 0;
        if (b->first[level] < 0)
            b->first[level] = pixel;
        else
            b->same[b->tail[level]] = pixel;
        b->tail[level] = pixel;
    }
}

static void take(cairn_boundary *b, int32_t pixel, int32_t region, int32_t level)
{
    b->label[pixel] = region;
    b->regions[region].pixels++;
    b->queue[pixel] = -1;
    if (b->head[level] < 0)
        b->head[level] = pixel;
    else
        b->queue[b->tail[level]] = pixel;
    b->tail[level] = pixel;
}

static void spread(cairn_boundary *b, int32_t pixel)
{
    int32_t x = pixel % b->image.width, y = pixel / b->image.width;
    int32_t near[4] = {x > 0 ? pixel - 1 : -1, x + 1 < b->image.width ? pixel + 1 : -1,
                       y > 0 ? pixel - b->image.width : -1,
                       y + 1 < b->image.height ? pixel + b->image.width : -1};

    for (int32_t k = 0; k < 4; k++)
        if (near[k] >= 0 && b->label[near[k]] < 0) {
            int32_t level = level_of(b, near[k]);

            take(b, near[k], b->label[pixel], level > b->level ? level : b->level);
        }
}

static void clear_bins(const cairn_boundary *b, int32_t region)
{
    for (int32_t k = 0; k < BOUNDARY_BINS; k++)
        b->first_bins[(ptrdiff_t)region * BOUNDARY_BINS + k] = 0;
}

int cairn_boundary_flood_pixel(cairn_boundary *b)
{
    int32_t pixel = b->head[b->level];

    if (pixel >= 0) {
        b->head[b->level] = b->queue[pixel];
        spread(b, pixel);
        return 1;
    }
    pixel = b->first[b->level];
    if (pixel < 0)
        return ++b->level < BOUNDARY_LEVELS;
    b->first[b->level] = b->same[pixel];
    if (b->label[pixel] < 0 && b->region_count < b->params.max_regions) {
        boundary_region none = {-1, 0, 0, 0, -1, 0};

        b->regions[b->region_count] = none;
        clear_bins(b, b->region_count);
        take(b, pixel, b->region_count++, b->level);
    }
    return 1;
}

/* ---- Borders ---- */

/* Where the table holds the border of p < q, or would. */
static int32_t place_of(const cairn_boundary *b, int32_t p, int32_t q)
{
    uint32_t mask = (uint32_t)b->table_size - 1;
    uint32_t at = ((uint32_t)p * UINT32_C(2654435761) ^ (uint32_t)q * UINT32_C(2246822519)) & mask;

    while (b->table[at] >= 0 &&
           (b->borders[b->table[at]].first[0] != p || b->borders[b->table[at]].first[1] != q))
        at = (at + 1) & mask;
    return (int32_t)at;
}

/* A pixel and the next one to the right or below: their regions touch. */
static void add_side(cairn_boundary *b, int32_t pixel, int32_t other)
{
    int32_t p = b->label[pixel] < b->label[other] ? b->label[pixel] : b->label[other];
    int32_t q = b->label[pixel] + b->label[other] - p, at;
    boundary_border *border;

    if (p == q)
        return;
    at = place_of(b, p, q);
    if (b->table[at] < 0) {
        boundary_border none = {.first = {p, q}, .at = -1};

        CAIRN_ASSERT(b->border_count < b->max_borders);
        b->table[at] = b->border_count;
        b->borders[b->border_count++] = none;
    }
    border = &b->borders[b->table[at]];
    border->sum += cairn_max(b->one[pixel], b->one[other]);
    border->sides++;
}

/* A pixel's colour becomes its region's: of each channel it is shared by the two bins that it
 * lies between. */
static void add_colour(const cairn_boundary *b, int32_t pixel)
{
    cairn_real *bins = b->first_bins + (ptrdiff_t)b->label[pixel] * BOUNDARY_BINS;

    for (int32_t c = 0; c < b->channels; c++) {
        int32_t count = c == 0 ? BOUNDARY_L_BINS : BOUNDARY_AB_BINS, low;
        cairn_real most = c == 0 ? 100 : BOUNDARY_AB_MOST, least = c == 0 ? 0 : -BOUNDARY_AB_MOST;
        cairn_real value = cairn_max(least,
                                     cairn_min(most, b->colour[(ptrdiff_t)c * b->pixels + pixel])),
                   at;

        at = (value - least) / (most - least) * (cairn_real)(count - 1);
        low = cairn_real_to_int(at);
        low = low < count - 1 ? low : count - 2;
        bins[low] += 1 - (at - (cairn_real)low);
        bins[low + 1] += at - (cairn_real)low;
        bins += count;
    }
}

void cairn_boundary_border_row(cairn_boundary *b)
{
    int32_t at = b->row * b->image.width;

    for (int32_t x = 0; x < b->image.width; x++, at++) {
        add_colour(b, at);
        if (x + 1 < b->image.width)
            add_side(b, at, at + 1);
        if (b->row + 1 < b->image.height)
            add_side(b, at, at + b->image.width);
    }
    b->row++;
}

int32_t cairn_boundary_border_of(const cairn_boundary *b, int32_t p, int32_t q)
{
    int32_t last, border;

    /* The table knows borders by the regions that they had. */
    last = border = b->table[place_of(b, p < q ? p : q, p < q ? q : p)];
    while (b->borders[border].into != border)
        border = b->borders[border].into;
    while (b->borders[last].into != border && last != border) {
        int32_t next = b->borders[last].into;

        b->borders[last].into = border;
        last = next;
    }
    return border;
}
