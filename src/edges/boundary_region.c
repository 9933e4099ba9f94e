/* Watershed segmentation: regions as catchment basins of the edge strengths, their borders and
 * colour histograms.
 *
 * Method:
 * 1. Pixels are processed in order of strength, quantized to 1/512, with one queue for each level.
 * 2. An unlabelled pixel at the current level starts a new basin.
 * 3. Basins grow over unlabelled neighbours, first in first out (Meyer 1991).
 * 4. A hash table of region pairs collects the borders. */
#include "src/base/build.h"

#include "src/edges/boundary_work.h"

#define LEVELS_PER_UNIT CAIRN_REAL(512.0) /* Quantization levels per unit of strength. */

/* ---- Watershed ---- */

/* Returns the quantized strength of a pixel. */
static int32_t level_of(const cairn_boundary *boundary, int32_t pixel)
{
    return cairn_real_to_int(
        cairn_min(boundary->strength[pixel] * LEVELS_PER_UNIT, BOUNDARY_LEVELS - 1));
}

void cairn_boundary_flood_begin(cairn_boundary *boundary)
{
    for (int32_t i = 0; i < BOUNDARY_LEVELS; i++)
        boundary->flood.queue_head[i] = boundary->flood.queue_tail[i] =
            boundary->flood.level_first[i] = -1;
}

void cairn_boundary_flood_row(cairn_boundary *boundary, int32_t row)
{
    for (int32_t x = 0; x < boundary->image.width; x++) {
        int32_t pixel = row * boundary->image.width + x, level = level_of(boundary, pixel);

        boundary->label[pixel] = boundary->flood.next_of_level[pixel] = -1;
        boundary->traced_sides[pixel] = 0;
        if (boundary->flood.level_first[level] < 0)
            boundary->flood.level_first[level] = pixel;
        else
            boundary->flood.next_of_level[boundary->flood.queue_tail[level]] = pixel;
        boundary->flood.queue_tail[level] = pixel;
    }
}

/* Labels a pixel and appends it to the queue of a level. */
static void label_pixel(cairn_boundary *boundary, int32_t pixel, int32_t region, int32_t level)
{
    boundary->label[pixel] = region;
    boundary->regions[region].initial_size++;
    boundary->flood.next_in_queue[pixel] = -1;
    if (boundary->flood.queue_head[level] < 0)
        boundary->flood.queue_head[level] = pixel;
    else
        boundary->flood.next_in_queue[boundary->flood.queue_tail[level]] = pixel;
    boundary->flood.queue_tail[level] = pixel;
}

/* Labels the unlabelled neighbours of a pixel. */
static void grow_basin(cairn_boundary *boundary, int32_t pixel)
{
    int32_t x = pixel % boundary->image.width, y = pixel / boundary->image.width;
    int32_t neighbour[4] = {x > 0 ? pixel - 1 : -1, x + 1 < boundary->image.width ? pixel + 1 : -1,
                            y > 0 ? pixel - boundary->image.width : -1,
                            y + 1 < boundary->image.height ? pixel + boundary->image.width : -1};

    for (int32_t k = 0; k < 4; k++)
        if (neighbour[k] >= 0 && boundary->label[neighbour[k]] < 0) {
            int32_t level = level_of(boundary, neighbour[k]);

            label_pixel(boundary, neighbour[k], boundary->label[pixel],
                        level > boundary->flood.level ? level : boundary->flood.level);
        }
}

static void clear_histogram(const cairn_boundary *boundary, int32_t region)
{
    for (int32_t k = 0; k < BOUNDARY_BINS; k++)
        boundary->merge.initial_histogram[(ptrdiff_t)region * BOUNDARY_BINS + k] = 0;
}

/* Processes one pixel of the current level; returns 0 when the level has no further one. */
static int flood_pixel(cairn_boundary *boundary)
{
    int32_t pixel = boundary->flood.queue_head[boundary->flood.level];

    if (pixel >= 0) {
        boundary->flood.queue_head[boundary->flood.level] = boundary->flood.next_in_queue[pixel];
        grow_basin(boundary, pixel);
        return 1;
    }
    pixel = boundary->flood.level_first[boundary->flood.level];
    if (pixel < 0)
        return 0;
    boundary->flood.level_first[boundary->flood.level] = boundary->flood.next_of_level[pixel];
    if (boundary->label[pixel] < 0 && boundary->region_count < boundary->params.max_regions) {
        boundary_region none = {.first_half_border = -1, .marked_border = -1};

        boundary->regions[boundary->region_count] = none;
        clear_histogram(boundary, boundary->region_count);
        label_pixel(boundary, pixel, boundary->region_count++, boundary->flood.level);
    }
    return 1;
}

int cairn_boundary_flood(cairn_boundary *boundary, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(boundary->phase_resume);
    for (boundary->flood.level = 0; boundary->flood.level < BOUNDARY_LEVELS;
         boundary->flood.level++)
        do
            CAIRN_STEP_CHARGE(boundary, phase_resume, budget, 1);
        while (flood_pixel(boundary));
    CAIRN_STEP_END(boundary->phase_resume);
}

/* ---- Borders ---- */

/* Returns the hash-table slot of the border of regions p < q, or the free slot for it (linear
 * probing). */
static int32_t table_slot(const cairn_boundary *boundary, int32_t p, int32_t q)
{
    uint32_t mask = (uint32_t)boundary->table_size - 1;
    uint32_t at = ((uint32_t)p * UINT32_C(2654435761) ^ (uint32_t)q * UINT32_C(2246822519)) & mask;

    while (boundary->border_table[at] >= 0 &&
           (boundary->borders[boundary->border_table[at]].initial_region[0] != p ||
            boundary->borders[boundary->border_table[at]].initial_region[1] != q))
        at = (at + 1) & mask;
    return (int32_t)at;
}

/* Adds the side between two adjacent pixels to the border of their regions. */
static void add_side(cairn_boundary *boundary, int32_t pixel, int32_t other)
{
    int32_t p = boundary->label[pixel] < boundary->label[other] ? boundary->label[pixel]
                                                                : boundary->label[other];
    int32_t q = boundary->label[pixel] + boundary->label[other] - p, at;
    boundary_border *border;

    if (p == q)
        return;
    at = table_slot(boundary, p, q);
    if (boundary->border_table[at] < 0) {
        boundary_border none = {.initial_region = {p, q}, .heap_index = -1};

        CAIRN_ASSERT(boundary->border_count <
                     BOUNDARY_BORDERS_PER_REGION * boundary->params.max_regions);
        boundary->border_table[at] = boundary->border_count;
        boundary->borders[boundary->border_count++] = none;
    }
    border = &boundary->borders[boundary->border_table[at]];
    border->strength_sum += cairn_max(boundary->strength[pixel], boundary->strength[other]);
    border->initial_length++;
}

/* Adds a pixel's colour to its region's histogram, with linear interpolation between two bins in
 * each channel. */
static void add_colour(const cairn_boundary *boundary, int32_t pixel)
{
    cairn_real *bins =
        boundary->merge.initial_histogram + (ptrdiff_t)boundary->label[pixel] * BOUNDARY_BINS;

    for (int32_t c = 0; c < boundary->channels; c++) {
        int32_t count = c == 0 ? BOUNDARY_L_BINS : BOUNDARY_AB_BINS, low;
        cairn_real upper = c == 0 ? 100 : BOUNDARY_MAX_AB, lower = c == 0 ? 0 : -BOUNDARY_MAX_AB;
        cairn_real value = cairn_max(
                       lower,
                       cairn_min(
                           upper,
                           boundary->colour[(ptrdiff_t)c * boundary_pixels(boundary) + pixel])),
                   at;

        at = (value - lower) / (upper - lower) * (cairn_real)(count - 1);
        low = cairn_real_to_int(at);
        low = low < count - 1 ? low : count - 2;
        bins[low] += 1 - (at - (cairn_real)low);
        bins[low + 1] += at - (cairn_real)low;
        bins += count;
    }
}

/* Adds the sides and the colours of the pixels of the current row. */
static void add_row(cairn_boundary *boundary)
{
    int32_t at = boundary->flood.row * boundary->image.width;

    for (int32_t x = 0; x < boundary->image.width; x++, at++) {
        add_colour(boundary, at);
        if (x + 1 < boundary->image.width)
            add_side(boundary, at, at + 1);
        if (boundary->flood.row + 1 < boundary->image.height)
            add_side(boundary, at, at + boundary->image.width);
    }
}

int cairn_boundary_collect_borders(cairn_boundary *boundary, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(boundary->phase_resume);
    for (boundary->flood.row = 0; boundary->flood.row < boundary->image.height;
         boundary->flood.row++) {
        CAIRN_STEP_CHARGE(boundary, phase_resume, budget, boundary->image.width);
        add_row(boundary);
    }
    CAIRN_STEP_END(boundary->phase_resume);
}

int32_t cairn_boundary_border_of(const cairn_boundary *boundary, int32_t p, int32_t q)
{
    int32_t last, border;

    /* The table is keyed by the initial regions. The second loop is path compression. */
    last = border = boundary->border_table[table_slot(boundary, p < q ? p : q, p < q ? q : p)];
    while (boundary->borders[border].merged_into != border)
        border = boundary->borders[border].merged_into;
    while (boundary->borders[last].merged_into != border && last != border) {
        int32_t next = boundary->borders[last].merged_into;

        boundary->borders[last].merged_into = border;
        last = next;
    }
    return border;
}
