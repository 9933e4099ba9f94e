/* Orders of the points of a fit: the canonical order, that of outliers in shifted cells, and that
 * by component and position.
 *
 * Method: all are total orders, made by one resumable natural merge sort. Morton codes (Z-order)
 * interleave the bits of cell numbers. Points of one cell are ordered by their coordinates, so the
 * canonical order does not depend on the order of the input. */
#include "src/base/build.h"

#include "src/shapes/polyline_work.h"

/* Spreads the bits of a number of POLYLINE_MORTON_BITS bits, `dim` positions apart. */
static uint64_t spread_bits(uint64_t number, int32_t dim)
{
    if (dim == 2) {
        number = (number | number << 16) & UINT64_C(0x0000ffff0000ffff);
        number = (number | number << 8) & UINT64_C(0x00ff00ff00ff00ff);
        number = (number | number << 4) & UINT64_C(0x0f0f0f0f0f0f0f0f);
        number = (number | number << 2) & UINT64_C(0x3333333333333333);
        return (number | number << 1) & UINT64_C(0x5555555555555555);
    }
    number = (number | number << 32) & UINT64_C(0x001f00000000ffff);
    number = (number | number << 16) & UINT64_C(0x001f0000ff0000ff);
    number = (number | number << 8) & UINT64_C(0x100f00f00f00f00f);
    number = (number | number << 4) & UINT64_C(0x10c30c30c30c30c3);
    return (number | number << 2) & UINT64_C(0x1249249249249249);
}

/* Morton code of a point; the cells are shifted by initial_round / 3 of the whole extent. */
static uint64_t morton_code(const cairn_polyline *polyline, const cairn_real p[3])
{
    const int32_t third = (INT32_C(1) << (POLYLINE_MORTON_BITS - 1)) / 3;
    cairn_real shift = (cairn_real)polyline->initial_round * (cairn_real)third;
    uint64_t code = 0;

    for (int j = 0; j < polyline->params.dim; j++) {
        uint32_t number = (uint32_t)cairn_real_to_int(
            (p[j] - polyline->box_min[j]) / polyline->cell_size + shift);

        code |= spread_bits(number, polyline->params.dim) << j;
    }
    return code;
}

int cairn_polyline_keys(cairn_polyline *polyline, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(polyline->phase_resume);
    for (polyline->cursor = 0; polyline->cursor < polyline->point_count; polyline->cursor++) {
        CAIRN_STEP_CHARGE_EIGHTHS(polyline, phase_resume, budget, 12);
        polyline->morton[polyline->cursor] =
            morton_code(polyline, polyline->raw_points[polyline->cursor]);
        polyline->order[polyline->cursor] = polyline->cursor;
    }
    CAIRN_STEP_END(polyline->phase_resume);
}

/* Sets the Morton code of a point in canonical order. */
static void recode(cairn_polyline *polyline, int32_t point)
{
    polyline->morton[point] = morton_code(polyline, polyline->points[point]);
}

/* In round 0 the codes are those by which all points are already sorted. */
int cairn_polyline_list_outliers(cairn_polyline *polyline, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(polyline->phase_resume);
    for (polyline->cursor = polyline->list_start; polyline->cursor < polyline->point_count;
         polyline->cursor++) {
        CAIRN_STEP_CHARGE_EIGHTHS(polyline, phase_resume, budget, 12);
        recode(polyline, polyline->order[polyline->cursor]);
    }
    CAIRN_STEP_END(polyline->phase_resume);
}

int cairn_polyline_point_before(const cairn_polyline *polyline, int32_t a, int32_t b)
{
    if (polyline->morton[a] != polyline->morton[b])
        return polyline->morton[a] < polyline->morton[b];
    for (int j = 0; j < 3; j++)
        if (polyline->raw_points[a][j] < polyline->raw_points[b][j] ||
            polyline->raw_points[a][j] > polyline->raw_points[b][j])
            return polyline->raw_points[a][j] < polyline->raw_points[b][j];
    return a < b;
}

int cairn_polyline_outlier_before(const cairn_polyline *polyline, int32_t a, int32_t b)
{
    return polyline->morton[a] != polyline->morton[b] ? polyline->morton[a] < polyline->morton[b]
                                                      : a < b;
}

int cairn_polyline_support_before(const cairn_polyline *polyline, int32_t a, int32_t b)
{
    if (polyline->component_of[a] != polyline->component_of[b])
        return (uint32_t)polyline->component_of[a] < (uint32_t)polyline->component_of[b];
    if (polyline->component_of[a] >= 0 && (polyline->position[a] < polyline->position[b] ||
                                           polyline->position[a] > polyline->position[b]))
        return polyline->position[a] < polyline->position[b];
    return a < b;
}

/* 1 when the sorted run ends before the i-th item. */
static int run_ends(const cairn_polyline *polyline, int32_t i, polyline_order before)
{
    return i >= polyline->sort.count ||
           before(polyline, polyline->sort.from[i], polyline->sort.from[i - 1]);
}

/* Moves the smaller one of the first items of both runs to the output. */
static void move_smaller(cairn_polyline *polyline, polyline_order before)
{
    const int32_t *from = polyline->sort.from;
    int32_t left = polyline->sort.left, right = polyline->sort.right;

    if (left < polyline->sort.middle &&
        (right >= polyline->sort.end || !before(polyline, from[right], from[left]))) {
        polyline->sort.to[polyline->sort.out] = from[left];
        polyline->sort.left++;
    } else {
        polyline->sort.to[polyline->sort.out] = from[right];
        polyline->sort.right++;
    }
}

/* Natural merge sort: linear when nearly sorted since the last iteration. */
int cairn_polyline_sort(cairn_polyline *polyline, cairn_budget *budget, polyline_order before)
{
    CAIRN_STEP_BEGIN(polyline->phase_resume);
    polyline->sort.count = polyline->point_count - polyline->list_start;
    polyline->sort.from = polyline->order + polyline->list_start;
    polyline->sort.to = polyline->merge_buffer + polyline->list_start;
    for (polyline->sort.start = 0;;) {
        /* Two runs, ... */
        for (polyline->sort.middle = polyline->sort.start + 1;
             !run_ends(polyline, polyline->sort.middle, before); polyline->sort.middle++)
            CAIRN_STEP_CHARGE_EIGHTHS_EVERY(polyline, phase_resume, budget, POLYLINE_GROUP,
                                            polyline->sort.middle, polyline->sort.count, 4);
        if (polyline->sort.start == 0 && polyline->sort.middle >= polyline->sort.count)
            break;
        for (polyline->sort.end = polyline->sort.middle + 1;
             !run_ends(polyline, polyline->sort.end, before); polyline->sort.end++)
            CAIRN_STEP_CHARGE_EIGHTHS_EVERY(polyline, phase_resume, budget, POLYLINE_GROUP,
                                            polyline->sort.end, polyline->sort.count, 4);
        if (polyline->sort.end > polyline->sort.count)
            polyline->sort.end = polyline->sort.count;
        /* ... are merged into the other buffer. */
        polyline->sort.left = polyline->sort.start;
        polyline->sort.right = polyline->sort.middle;
        for (polyline->sort.out = polyline->sort.start; polyline->sort.out < polyline->sort.end;
             polyline->sort.out++) {
            CAIRN_STEP_CHARGE_EIGHTHS_EVERY(polyline, phase_resume, budget, POLYLINE_GROUP,
                                            polyline->sort.out, polyline->sort.end, 6);
            move_smaller(polyline, before);
        }
        polyline->sort.start = polyline->sort.end;
        if (polyline->sort.start >= polyline->sort.count) {
            int32_t *swap = polyline->sort.from;

            polyline->sort.from = polyline->sort.to;
            polyline->sort.to = swap;
            polyline->sort.start = 0;
        }
    }
    for (polyline->cursor = 0; polyline->sort.from != polyline->order + polyline->list_start &&
                               polyline->cursor < polyline->sort.count;
         polyline->cursor++) {
        CAIRN_STEP_CHARGE_EIGHTHS(polyline, phase_resume, budget, 1);
        polyline->sort.to[polyline->cursor] = polyline->sort.from[polyline->cursor];
    }
    CAIRN_STEP_END(polyline->phase_resume);
}

/* Enters the point at a canonical index: its coordinates, and the bounding box of its block. */
static void gather_point(cairn_polyline *polyline, int32_t i)
{
    int32_t block = i / POLYLINE_BLOCK_POINTS, raw = polyline->order[i];
    int is_first = i % POLYLINE_BLOCK_POINTS == 0;

    polyline->raw_index[i] = raw;
    for (int j = 0; j < 3; j++) {
        cairn_real value = polyline->raw_points[raw][j];

        polyline->points[i][j] = value;
        polyline->block_min[block][j] =
            is_first ? value : cairn_min(polyline->block_min[block][j], value);
        polyline->block_max[block][j] =
            is_first ? value : cairn_max(polyline->block_max[block][j], value);
    }
    polyline->order[i] = i;
}

int cairn_polyline_gather(cairn_polyline *polyline, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(polyline->phase_resume);
    for (polyline->cursor = 0; polyline->cursor < polyline->point_count; polyline->cursor++) {
        CAIRN_STEP_CHARGE_EIGHTHS(polyline, phase_resume, budget, 8);
        gather_point(polyline, polyline->cursor);
    }
    CAIRN_STEP_END(polyline->phase_resume);
}
