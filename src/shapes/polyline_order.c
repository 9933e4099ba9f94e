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

/* Phase KEYS: Morton codes of the raw points. cursor: point. */
int cairn_polyline_keys(cairn_polyline *polyline, cairn_budget *budget)
{
    for (; polyline->cursor < polyline->point_count; polyline->cursor++) {
        if (!polyline_charge(polyline, budget, 12))
            return 0;
        polyline->morton[polyline->cursor] =
            morton_code(polyline, polyline->raw_points[polyline->cursor]);
        polyline->order[polyline->cursor] = polyline->cursor;
    }
    return 1;
}

/* Phase LIST_OUTLIERS: Morton codes of the listed points in shifted cells. In round 0 these equal
 * the codes by which all points are already sorted. cursor: point. */
int cairn_polyline_list_outliers(cairn_polyline *polyline, cairn_budget *budget)
{
    for (; polyline->list_start + polyline->cursor < polyline->point_count; polyline->cursor++) {
        int32_t i = polyline->order[polyline->list_start + polyline->cursor];

        if (!polyline_charge(polyline, budget, 12))
            return 0;
        polyline->morton[i] = morton_code(polyline, polyline->points[i]);
    }
    return 1;
}

/* Canonical order of raw points. The order of equal points has no effect on the result. */
static int point_before(const cairn_polyline *polyline, int32_t a, int32_t b)
{
    if (polyline->morton[a] != polyline->morton[b])
        return polyline->morton[a] < polyline->morton[b];
    for (int j = 0; j < 3; j++)
        if (polyline->raw_points[a][j] < polyline->raw_points[b][j] ||
            polyline->raw_points[a][j] > polyline->raw_points[b][j])
            return polyline->raw_points[a][j] < polyline->raw_points[b][j];
    return a < b;
}

/* Order of outliers by Morton code. */
static int outlier_before(const cairn_polyline *polyline, int32_t a, int32_t b)
{
    return polyline->morton[a] != polyline->morton[b] ? polyline->morton[a] < polyline->morton[b]
                                                      : a < b;
}

/* Order of points by component (outliers last), then by position. */
static int support_before(const cairn_polyline *polyline, int32_t a, int32_t b)
{
    if (polyline->component_of[a] != polyline->component_of[b])
        return (uint32_t)polyline->component_of[a] < (uint32_t)polyline->component_of[b];
    if (polyline->component_of[a] >= 0 && (polyline->position[a] < polyline->position[b] ||
                                           polyline->position[a] > polyline->position[b]))
        return polyline->position[a] < polyline->position[b];
    return a < b;
}

/* 1 when a comes before b in the order of the current phase. */
static int before(const cairn_polyline *polyline, int32_t a, int32_t b)
{
    if (polyline->phase == POLYLINE_SORT_SUPPORT)
        return support_before(polyline, a, b);
    return polyline->phase == POLYLINE_SORT_POINTS ? point_before(polyline, a, b)
                                                   : outlier_before(polyline, a, b);
}

/* Natural merge sort of order[list_start ... point_count-1]: linear when nearly sorted since the
 * last iteration. Stage 0 finds the end of a run, 1 the end of the next run, 2 merges both into the
 * other buffer, 3 copies the result back. */
int cairn_polyline_sort(cairn_polyline *polyline, cairn_budget *budget)
{
    int32_t n = polyline->point_count - polyline->list_start;

    while (polyline->sort.stage < 3) {
        const int32_t *from =
            (polyline->sort.is_swapped ? polyline->merge_buffer : polyline->order) +
            polyline->list_start;
        int32_t *to = (polyline->sort.is_swapped ? polyline->order : polyline->merge_buffer) +
                      polyline->list_start;

        if (polyline->sort.stage == 0) {
            while (polyline->sort.middle < n && !before(polyline, from[polyline->sort.middle],
                                                        from[polyline->sort.middle - 1])) {
                if (!polyline_charge_four(polyline, budget, polyline->sort.middle, n, 4))
                    return 0;
                polyline->sort.middle++;
            }
            polyline->sort.end = polyline->sort.middle + 1;
            polyline->sort.stage = polyline->sort.start == 0 && polyline->sort.middle >= n ? 3 : 1;
        }
        if (polyline->sort.stage == 1) {
            while (polyline->sort.end < n &&
                   !before(polyline, from[polyline->sort.end], from[polyline->sort.end - 1])) {
                if (!polyline_charge_four(polyline, budget, polyline->sort.end, n, 4))
                    return 0;
                polyline->sort.end++;
            }
            polyline->sort.end = polyline->sort.end < n ? polyline->sort.end : n;
            polyline->sort.left = polyline->sort.out = polyline->sort.start;
            polyline->sort.right = polyline->sort.middle;
            polyline->sort.stage = 2;
        }
        while (polyline->sort.stage == 2 && polyline->sort.out < polyline->sort.end) {
            int32_t left = polyline->sort.left, right = polyline->sort.right;

            if (!polyline_charge_four(polyline, budget, polyline->sort.out, polyline->sort.end, 6))
                return 0;
            if (left < polyline->sort.middle &&
                (right >= polyline->sort.end || !before(polyline, from[right], from[left]))) {
                to[polyline->sort.out++] = from[left];
                polyline->sort.left++;
            } else {
                to[polyline->sort.out++] = from[right];
                polyline->sort.right++;
            }
        }
        if (polyline->sort.stage == 2) {
            polyline->sort.start = polyline->sort.end;
            if (polyline->sort.start >= n) {
                polyline->sort.is_swapped = !polyline->sort.is_swapped;
                polyline->sort.start = 0;
            }
            polyline->sort.middle = polyline->sort.start + 1;
            polyline->sort.stage = 0;
        }
    }
    for (; polyline->sort.is_swapped && polyline->cursor < n; polyline->cursor++) {
        if (!polyline_charge(polyline, budget, 1))
            return 0;
        polyline->order[polyline->list_start + polyline->cursor] =
            polyline->merge_buffer[polyline->list_start + polyline->cursor];
    }
    return 1;
}

/* Phase GATHER: points in canonical order, and the bounding boxes of the blocks. cursor: point. */
int cairn_polyline_gather(cairn_polyline *polyline, cairn_budget *budget)
{
    for (; polyline->cursor < polyline->point_count; polyline->cursor++) {
        int32_t block = polyline->cursor / POLYLINE_BLOCK_POINTS,
                raw = polyline->order[polyline->cursor];

        if (!polyline_charge(polyline, budget, 8))
            return 0;
        polyline->raw_index[polyline->cursor] = raw;
        for (int j = 0; j < 3; j++) {
            cairn_real value = polyline->raw_points[raw][j];
            int first = polyline->cursor % POLYLINE_BLOCK_POINTS == 0;

            polyline->points[polyline->cursor][j] = value;
            polyline->block_min[block][j] =
                first ? value : cairn_min(polyline->block_min[block][j], value);
            polyline->block_max[block][j] =
                first ? value : cairn_max(polyline->block_max[block][j], value);
        }
        polyline->order[polyline->cursor] = polyline->cursor;
    }
    return 1;
}
