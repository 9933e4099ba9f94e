/* Checks of raster views, and distance transforms.
 *
 * Method (Meijster, Roerdink and Hesselink 2000), all in integers:
 * 1. A pass down and a pass up leave in each pixel the distance g to the nearest match in its
 *    column.
 * 2. For each row and L1, a pass to the right and one to the left: d = min(d, d' + 1).
 * 3. For each row and L2, the lower envelope of the parabolas (x - i)^2 + g(i)^2 is built from the
 *    left, on a stack of columns i with the first x at which each is the lowest. The distances are
 *    read off from the right.
 *
 * The passes run along rows, in memory order, and can stop after any pixel.
 *
 * Limits: sides of at most 32768 keep (x - i)^2 + g^2 below 2^31. Columns without a match are not
 * part of the envelope, so CAIRN_DISTANCE_MAP_FAR is never added to.
 *
 * Source: Meijster, Roerdink and Hesselink, A general algorithm for computing distance transforms
 * in linear time, 2000; L1: Rosenfeld and Pfaltz 1966. */
#include "src/base/build.h"

#include "cairn/raster.h"
#include "src/base/object.h"
#include "src/base/step.h"

/* ---- Views ---- */

/* Checks a view of elements of `element` bytes. */
static cairn_status check_view(const void *data, int32_t width, int32_t height, ptrdiff_t stride,
                               size_t element)
{
    ptrdiff_t limit = PTRDIFF_MAX / (ptrdiff_t)element;
    ptrdiff_t step;

    if (data == NULL || width < 1 || width > CAIRN_RASTER_MAX_SIDE || height < 1 ||
        height > CAIRN_RASTER_MAX_SIDE)
        return CAIRN_BAD_ARGUMENT;
    if (height == 1)
        return CAIRN_OK;
    if (stride == PTRDIFF_MIN)
        return CAIRN_BAD_ARGUMENT;
    step = stride < 0 ? -stride : stride;
    return step >= width && step <= (limit - width) / (height - 1) ? CAIRN_OK : CAIRN_BAD_ARGUMENT;
}

cairn_status cairn_raster_u8_check(cairn_raster_u8_view view)
{
    return check_view(view.data, view.width, view.height, view.stride, sizeof *view.data);
}

cairn_status cairn_raster_i32_check(cairn_raster_i32_view view)
{
    return check_view(view.data, view.width, view.height, view.stride, sizeof *view.data);
}

cairn_status cairn_raster_real_check(cairn_raster_real_view view)
{
    return check_view(view.data, view.width, view.height, view.stride, sizeof *view.data);
}

/* ---- Distance maps ---- */

/* Distance without a match, and operations per work unit. */
enum { DISTANCE_FAR = CAIRN_DISTANCE_MAP_FAR, OPERATIONS_PER_UNIT = 6 };

struct cairn_distance_map {
    /* [max_width] Distances g in the columns of the current row, in pixels. */
    int32_t *column;
    /* [max_width] Columns of the lower envelope, a stack. */
    int32_t *stack;
    /* [max_width] First x at which each of them is the lowest. */
    int32_t *start;
    cairn_distance_map_input input;
    int32_t max_width;
    /* 1: a transform was begun and is not complete; its resume point. */
    int32_t is_pending, resume;
    /* Row of the current pass, and the next pixel of it in the direction of the pass. */
    int32_t y, x;
    /* Columns on the stack. */
    int32_t stack_count;
    /* Operations that are charged to the budget but not done yet. */
    int32_t credit;
};

/* A pass along the current row, from map->x on, by at most `operations` operations, one a pixel
 * where it states nothing else. Returns the operations left. */
typedef int32_t distance_map_pass(cairn_distance_map *map, int32_t operations);

/* Without a default: lowest and highest value. */
static const cairn_parameter rows[] = {
    CAIRN_INTEGER(cairn_distance_map_params, max_width, 0, 1, CAIRN_RASTER_MAX_SIDE),
};
extern const cairn_parameters cairn_distance_map_parameters;
const cairn_parameters cairn_distance_map_parameters =
    CAIRN_PARAMETERS("distance_map", cairn_distance_map_params, rows);

cairn_status cairn_distance_map_check(const cairn_distance_map_params *params,
                                      cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_distance_map_parameters, params, fault);
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_distance_map *build(cairn_pool *pool, const cairn_distance_map_params *params)
{
    cairn_distance_map *map = cairn_object_take(pool, sizeof *map);

    CAIRN_TAKE(map, pool, column, params->max_width);
    CAIRN_TAKE(map, pool, stack, params->max_width);
    CAIRN_TAKE(map, pool, start, params->max_width);
    if (map != NULL)
        map->max_width = params->max_width;
    return map;
}

CAIRN_OBJECT(distance_map, distance_map, build);

cairn_status cairn_distance_map_begin(cairn_distance_map *map,
                                      const cairn_distance_map_input *input)
{
    if (map == NULL || input == NULL || cairn_raster_u8_check(input->pixels) != CAIRN_OK ||
        cairn_raster_i32_check(cairn_raster_i32_as_view(input->distances)) != CAIRN_OK ||
        input->pixels.width != input->distances.width ||
        input->pixels.height != input->distances.height ||
        (input->metric != CAIRN_DISTANCE_MAP_L1 && input->metric != CAIRN_DISTANCE_MAP_L2_SQUARED))
        return CAIRN_BAD_ARGUMENT;
    if (input->pixels.width > map->max_width)
        return CAIRN_FULL;
    map->input = *input;
    map->is_pending = 1;
    map->resume = 0;
    map->x = 0;
    map->stack_count = 0;
    map->credit = 0;
    return CAIRN_OK;
}

/* Row y of the distances. */
static int32_t *distance_row(const cairn_distance_map *map, int32_t y)
{
    return map->input.distances.data + y * map->input.distances.stride;
}

/* distance + 1; DISTANCE_FAR stays. */
static int32_t plus_one(int32_t distance)
{
    return distance == DISTANCE_FAR ? DISTANCE_FAR : distance + 1;
}

/* Takes one operation from *operations for each of the pixels from map->x on that they suffice for,
 * and sets map->x to the end of these pixels. Returns the first of them. */
static int32_t take_pixels(cairn_distance_map *map, int32_t *operations)
{
    int32_t first = map->x, left = map->input.pixels.width - first,
            count = *operations < left ? *operations : left;

    map->x += count;
    *operations -= count;
    return first;
}

/* Pass down: distance to the nearest match above in the column. */
static int32_t run_down(cairn_distance_map *map, int32_t operations)
{
    const uint8_t *pixel = map->input.pixels.data + map->y * map->input.pixels.stride;
    int32_t is_first = map->y == 0, *d = distance_row(map, map->y);
    const int32_t *above = distance_row(map, is_first ? 0 : map->y - 1);
    int32_t first = take_pixels(map, &operations), end = map->x;

    for (int32_t x = first; x < end; x++) {
        if ((pixel[x] & map->input.mask) == map->input.match)
            d[x] = 0;
        else
            d[x] = is_first ? DISTANCE_FAR : plus_one(above[x]);
    }
    return operations;
}

/* Pass up: distance to the nearest match in the column. */
static int32_t run_up(cairn_distance_map *map, int32_t operations)
{
    int32_t *d = distance_row(map, map->y);
    const int32_t *below = distance_row(map, map->y + 1);
    int32_t first = take_pixels(map, &operations), end = map->x;

    for (int32_t x = first; x < end; x++)
        if (plus_one(below[x]) < d[x])
            d[x] = below[x] + 1;
    return operations;
}

/* L1 pass to the right. */
static int32_t run_right(cairn_distance_map *map, int32_t operations)
{
    int32_t *d = distance_row(map, map->y);
    int32_t first = take_pixels(map, &operations), end = map->x;

    for (int32_t x = first > 0 ? first : 1; x < end; x++)
        if (plus_one(d[x - 1]) < d[x])
            d[x] = d[x - 1] + 1;
    return operations;
}

/* L1 pass to the left; x counts columns from the right. */
static int32_t run_left(cairn_distance_map *map, int32_t operations)
{
    int32_t last = map->input.pixels.width - 1;
    int32_t *d = distance_row(map, map->y);
    int32_t first = take_pixels(map, &operations), end = map->x;

    for (int32_t x = first > 0 ? first : 1; x < end; x++)
        if (plus_one(d[last - x + 1]) < d[last - x])
            d[last - x] = d[last - x + 1] + 1;
    return operations;
}

/* Height at x of the parabola of column i. */
static int32_t parabola(const cairn_distance_map *map, int32_t x, int32_t i)
{
    return (x - i) * (x - i) + map->column[i] * map->column[i];
}

/* Builds the lower envelope; an operation is a push, a pop or a skip. */
static int32_t build_envelope(cairn_distance_map *map, int32_t operations)
{
    const int32_t *d = distance_row(map, map->y);
    int32_t width = map->input.pixels.width;

    for (; map->x < width && operations > 0; operations--) {
        int32_t x = map->x, top = map->stack_count - 1, i;

        map->column[x] = d[x];
        if (d[x] == DISTANCE_FAR) {
            map->x++;
            continue;
        }
        if (map->stack_count == 0) {
            map->stack[0] = x;
            map->start[0] = 0;
            map->stack_count++;
            map->x++;
            continue;
        }
        i = map->stack[top];
        if (parabola(map, map->start[top], i) > parabola(map, map->start[top], x)) {
            map->stack_count--;
            continue;
        }
        /* The parabola of x is at or above that of i at start[top], so their intersection lies
         * there or to the right, not below 0. */
        i = (x * x - i * i + d[x] * d[x] - map->column[i] * map->column[i]) / (2 * (x - i)) + 1;
        if (i < width) {
            map->stack[map->stack_count] = x;
            map->start[map->stack_count] = i;
            map->stack_count++;
        }
        map->x++;
    }
    return operations;
}

/* Reads the distances off the lower envelope; x counts columns from the right. */
static int32_t read_envelope(cairn_distance_map *map, int32_t operations)
{
    int32_t last = map->input.pixels.width - 1;
    int32_t *d = distance_row(map, map->y);
    int32_t first = take_pixels(map, &operations), end = map->x;

    for (int32_t x = first; x < end; x++) {
        if (map->stack_count == 0) {
            d[last - x] = DISTANCE_FAR;
            continue;
        }
        d[last - x] = parabola(map, last - x, map->stack[map->stack_count - 1]);
        if (last - x == map->start[map->stack_count - 1])
            map->stack_count--;
    }
    return operations;
}

/* Charges operations for the rest of the current row, at least one a pixel, in whole units; what a
 * unit has more is credit for the next ones. 0: the budget is used up. */
static int charge_operations(cairn_distance_map *map, cairn_budget *budget)
{
    int32_t lacking = map->input.pixels.width - map->x - map->credit,
            wanted = (lacking + OPERATIONS_PER_UNIT - 1) / OPERATIONS_PER_UNIT;

    map->credit += OPERATIONS_PER_UNIT * cairn_budget_take(budget, wanted);
    return map->credit > 0;
}

/* Runs a pass along the current row as far as the budget reaches. Returns 1 at its end. */
static int run_pass(cairn_distance_map *map, cairn_budget *budget, distance_map_pass *pass)
{
    while (map->x < map->input.pixels.width) {
        if (!charge_operations(map, budget))
            return 0;
        map->credit = pass(map, map->credit);
    }
    map->x = 0;
    return 1;
}

/* See Method in the head of this file. */
static int transform(cairn_distance_map *map, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(map->resume);
    for (map->y = 0; map->y < map->input.pixels.height; map->y++)
        CAIRN_STEP_UNTIL(map->resume, run_pass(map, budget, run_down));
    for (map->y = map->input.pixels.height - 2; map->y >= 0; map->y--)
        CAIRN_STEP_UNTIL(map->resume, run_pass(map, budget, run_up));
    for (map->y = 0; map->y < map->input.pixels.height; map->y++) {
        if (map->input.metric == CAIRN_DISTANCE_MAP_L1) {
            CAIRN_STEP_UNTIL(map->resume, run_pass(map, budget, run_right));
            CAIRN_STEP_UNTIL(map->resume, run_pass(map, budget, run_left));
        } else {
            CAIRN_STEP_UNTIL(map->resume, run_pass(map, budget, build_envelope));
            CAIRN_STEP_UNTIL(map->resume, run_pass(map, budget, read_envelope));
        }
    }
    CAIRN_STEP_END(map->resume);
}

cairn_status cairn_distance_map_step(cairn_distance_map *map, cairn_budget *budget)
{
    if (map->is_pending && !transform(map, budget))
        return CAIRN_MORE;
    map->is_pending = 0;
    return CAIRN_OK;
}
