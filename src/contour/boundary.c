/* Boundaries of regions: the room itself.
 *
 * Phases: colours; for each map and scale its windows and its change (boundary_measure.c);
 * strengths; basins and their borders (boundary_region.c); cuts (boundary_spectral.c); joints, each
 * way anew (boundary_joint.c); contours and their ranks (boundary_contour.c).
 *
 * Layout: pictures of reals for the colours, a map and its average, and the tensors; labels and
 * queues; borders and regions; vectors.
 *
 * Limits: strengths above 8 are told apart no more when basins are made. Contours run along
 * pixels' sides, not between them: the place of an edge is known to half a pixel at best, of a
 * soft one to about the half width of the windows; edgel is exact there. */
#include "src/core/build.h"

#include <string.h>

#include "src/contour/boundary_work.h"

enum { MAX_SIDE = 8192, MAX_REGIONS = 1 << 22, MAX_POINTS = 1 << 28, MAX_HALF = 32 };
/* Regions of a plane have at most so many borders, and as many stretches of these from junction
 * to junction: with the image's border every junction has three, so of V junctions, E stretches
 * and C pieces 3 V <= 2 E, and Euler's V - E + regions = C leaves E <= 3 regions. */
enum { BORDERS_EACH = 3 };

cairn_boundary_params cairn_boundary_default(void)
{
    cairn_boundary_params params = {
        .max_width = 640,
        .max_height = 480,
        .max_regions = 8192,
        .max_points = 262144,
        .fine = 2,
        .coarse = 5,
        .distribution = 8,
        .global = CAIRN_REAL(0.3),
        .small = CAIRN_REAL(0.1),
        .contrast = CAIRN_REAL(0.15),
        .min_strength = 0,
    };
    return params;
}

static int within(int32_t value, int32_t most)
{
    return value >= 1 && value <= most;
}

static int params_are_valid(const cairn_boundary_params *p)
{
    return p != NULL && within(p->max_width, MAX_SIDE) && within(p->max_height, MAX_SIDE) &&
           within(p->max_regions, MAX_REGIONS) && within(p->max_points, MAX_POINTS) &&
           within(p->fine, MAX_HALF) && within(p->coarse, MAX_HALF) && p->distribution >= 0 &&
           cairn_is_finite(p->distribution) && p->global >= 0 && cairn_is_finite(p->global) &&
           p->small >= 0 && p->small <= 1 && p->contrast >= 0 && p->contrast <= 1 &&
           p->min_strength >= 0 && cairn_is_finite(p->min_strength);
}

/* A power of two, so that the table is at most half full. */
static int32_t table_size_of(const cairn_boundary_params *params)
{
    int32_t size = 1;

    while (size < 2 * BORDERS_EACH * params->max_regions)
        size *= 2;
    return size;
}

static cairn_boundary *carve(cairn_pool *pool, const cairn_boundary_params *p)
{
    size_t pixels = (size_t)p->max_width * (size_t)p->max_height, regions = (size_t)p->max_regions;
    size_t borders = BORDERS_EACH * regions;
    cairn_boundary *made = cairn_pool_take_one(pool, sizeof *made), taken;

    memset(&taken, 0, sizeof taken);
    taken.params = *p;
    taken.max_borders = (int32_t)borders;
    taken.table_size = table_size_of(p);
    taken.colour = cairn_pool_take(pool, BOUNDARY_CHANNELS * pixels, sizeof *taken.colour);
    taken.one = cairn_pool_take(pool, pixels, sizeof *taken.one);
    taken.other = cairn_pool_take(pool, pixels, sizeof *taken.other);
    taken.change = cairn_pool_take(pool, pixels, sizeof *taken.change);
    taken.line = cairn_pool_take(pool, 2 * (size_t)p->max_width, sizeof *taken.line);
    taken.label = cairn_pool_take(pool, pixels, sizeof *taken.label);
    taken.queue = cairn_pool_take(pool, pixels, sizeof *taken.queue);
    taken.same = cairn_pool_take(pool, pixels, sizeof *taken.same);
    taken.walked = cairn_pool_take(pool, pixels, sizeof *taken.walked);
    taken.head = cairn_pool_take(pool, BOUNDARY_LEVELS, sizeof *taken.head);
    taken.tail = cairn_pool_take(pool, BOUNDARY_LEVELS, sizeof *taken.tail);
    taken.first = cairn_pool_take(pool, BOUNDARY_LEVELS, sizeof *taken.first);
    taken.regions = cairn_pool_take(pool, regions, sizeof *taken.regions);
    taken.first_bins = cairn_pool_take(pool, BOUNDARY_BINS * regions, sizeof *taken.first_bins);
    taken.bins = cairn_pool_take(pool, BOUNDARY_BINS * regions, sizeof *taken.bins);
    taken.root = cairn_pool_take(pool, regions, sizeof *taken.root);
    taken.vectors = cairn_pool_take(pool, (BOUNDARY_BLOCK + 2) * regions, sizeof *taken.vectors);
    taken.borders = cairn_pool_take(pool, borders, sizeof *taken.borders);
    taken.table = cairn_pool_take(pool, (size_t)taken.table_size, sizeof *taken.table);
    taken.heap = cairn_pool_take(pool, borders, sizeof *taken.heap);
    taken.found = cairn_pool_take(pool, borders, sizeof *taken.found);
    taken.ranked = cairn_pool_take(pool, borders, sizeof *taken.ranked);
    taken.corners = cairn_pool_take(pool, (size_t)p->max_points, sizeof *taken.corners);
    if (made != NULL)
        *made = taken;
    return made;
}

size_t cairn_boundary_memory(const cairn_boundary_params *params)
{
    cairn_pool counting;

    if (!params_are_valid(params))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return cairn_pool_counted(&counting);
}

/* The light of an sRGB sample. */
static cairn_real light_of(int32_t sample)
{
    cairn_real s = (cairn_real)sample / 255;

    return s <= CAIRN_REAL(0.04045)
               ? s / CAIRN_REAL(12.92)
               : cairn_exp(CAIRN_REAL(2.4) *
                           cairn_log((s + CAIRN_REAL(0.055)) / CAIRN_REAL(1.055)));
}

cairn_status cairn_boundary_create(cairn_boundary **boundary, cairn_pool *pool,
                                   const cairn_boundary_params *params)
{
    size_t need = cairn_boundary_memory(params);

    if (boundary == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    *boundary = carve(pool, params);
    for (int32_t i = 0; i < 256; i++)
        (*boundary)->linear[i] = light_of(i);
    return CAIRN_OK;
}

/* Samples of a row are counted in 64 bits: strides may be anything. */
static int image_is_valid(const cairn_boundary_image *image)
{
    ptrdiff_t stride;

    if (image == NULL || image->samples == NULL || !within(image->width, CAIRN_RASTER_MAX_SIDE) ||
        !within(image->height, CAIRN_RASTER_MAX_SIDE) ||
        (image->channels != 1 && image->channels != 3 && image->channels != 4))
        return 0;
    stride = image->stride;
    return image->height == 1 || (stride >= (ptrdiff_t)image->width * image->channels &&
                                  stride <= PTRDIFF_MAX / image->height);
}

cairn_status cairn_boundary_begin(cairn_boundary *b, const cairn_boundary_image *image)
{
    if (b == NULL || !image_is_valid(image))
        return CAIRN_BAD_ARGUMENT;
    if (image->width > b->params.max_width || image->height > b->params.max_height)
        return CAIRN_FULL;
    b->image = *image;
    b->pixels = image->width * image->height;
    b->channels = image->channels > 1 ? BOUNDARY_CHANNELS : 1;
    b->map = b->row = b->pass = b->some = 0;
    b->region_count = b->border_count = b->heap_count = b->fed = 0;
    b->contour_count = b->corner_count = b->ranked_count = 0;
    b->from_x = b->from_y = b->loops = b->walking = 0;
    b->joined = 0;
    b->way = b->stage = 0;
    b->paid = 0;
    for (int32_t i = 0; i < b->table_size; i++)
        b->table[i] = -1;
    cairn_boundary_flood_begin(b);
    b->phase = BOUNDARY_COLOUR;
    return CAIRN_OK;
}

static int32_t cost_of(const cairn_boundary *b)
{
    int32_t cost;

    if (b->phase < BOUNDARY_FLOOD)
        return cairn_boundary_measure_cost(b);
    if (b->phase == BOUNDARY_BORDER)
        return b->image.width;
    if (b->phase == BOUNDARY_CUT)
        return cairn_boundary_cuts_cost(b);
    if (b->phase != BOUNDARY_JOIN)
        return 1;
    cost = cairn_boundary_join_cost(b);
    return cost > 0 ? cost : 1;
}

static void end_joints(cairn_boundary *b)
{
    b->fed = 0;
    b->phase = cairn_boundary_has_ways(b) ? BOUNDARY_TELL : BOUNDARY_TRACE;
}

/* CAIRN_MORE: there is more. */
static cairn_status do_item(cairn_boundary *b)
{
    cairn_status status;

    if (b->phase < BOUNDARY_FLOOD) {
        cairn_boundary_measure_row(b);
    } else if (b->phase == BOUNDARY_FLOOD) {
        if (!cairn_boundary_flood_pixel(b)) {
            b->row = 0;
            b->phase = BOUNDARY_BORDER;
        }
    } else if (b->phase == BOUNDARY_BORDER) {
        cairn_boundary_border_row(b);
        if (b->row == b->image.height) {
            cairn_boundary_ties_begin(b);
            b->phase = BOUNDARY_CUT;
        }
    } else if (b->phase == BOUNDARY_CUT) {
        if (!cairn_boundary_cuts_next(b))
            b->phase = BOUNDARY_CLEAR;
    } else if (b->phase == BOUNDARY_CLEAR) {
        if (!cairn_boundary_clear_next(b))
            b->phase = BOUNDARY_JOIN;
    } else if (b->phase == BOUNDARY_JOIN) {
        if (cairn_boundary_join_cost(b) > 0)
            cairn_boundary_join_next(b);
        else
            end_joints(b);
    } else if (b->phase == BOUNDARY_TELL) {
        if (!cairn_boundary_tell_next(b))
            b->phase = BOUNDARY_CLEAR;
    } else if (b->phase == BOUNDARY_TRACE) {
        status = cairn_boundary_trace_side(b);
        if (status < CAIRN_OK)
            return status;
        if (status == CAIRN_OK)
            b->phase = BOUNDARY_RANK;
    } else if (!cairn_boundary_rank_next(b)) {
        b->phase = BOUNDARY_DONE;
    }
    return CAIRN_MORE;
}

cairn_status cairn_boundary_step(cairn_boundary *b, cairn_budget *budget)
{
    if (b == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (b->phase != BOUNDARY_IDLE && b->phase != BOUNDARY_DONE) {
        cairn_status status;

        if (!cairn_budget_pay(budget, &b->paid, cost_of(b)))
            return CAIRN_MORE;
        status = do_item(b);
        if (status < CAIRN_OK) {
            b->phase = BOUNDARY_IDLE;
            return status;
        }
    }
    return CAIRN_OK;
}

cairn_boundary_result cairn_boundary_read(const cairn_boundary *b)
{
    cairn_boundary_result r;

    memset(&r, 0, sizeof r);
    if (b == NULL || b->phase != BOUNDARY_DONE)
        return r;
    r.contours = b->ranked;
    r.corners = b->corners;
    r.contour_count = b->ranked_count;
    r.corner_count = b->corner_count;
    r.region_count = b->region_count;
    r.strengths.data = b->one;
    r.strengths.width = b->image.width;
    r.strengths.height = b->image.height;
    r.strengths.stride = b->image.width;
    return r;
}
