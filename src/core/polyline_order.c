/* Orders of the points of a fit: the canonical one, that of unclaimed points in shifted cells, that
 * by piece and place.
 *
 * All are total and come from one merge sort in steps. Morton codes interleave the bits of cell
 * numbers; points in one cell are told apart by their coordinates, so that the canonical order
 * does not depend on that of the input. */
#include "src/core/build.h"

#include "src/core/polyline_work.h"

/* The bits of a number of POLYLINE_LEVELS bits, `dim` apart. */
static uint64_t spread(uint64_t number, int32_t dim)
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

/* Number of a point in Morton order; the cells are shifted by round / 3 of the whole extent. */
static uint64_t morton(const cairn_polyline *x, const cairn_real p[3])
{
    const int32_t third = (INT32_C(1) << (POLYLINE_LEVELS - 1)) / 3;
    cairn_real shift = (cairn_real)x->round * (cairn_real)third;
    uint64_t code = 0;

    for (int j = 0; j < x->params.dim; j++) {
        uint32_t number = (uint32_t)cairn_real_to_int((p[j] - x->low[j]) / x->cell + shift);

        code |= spread(number, x->params.dim) << j;
    }
    return code;
}

int cairn_polyline_keys(cairn_polyline *x, cairn_budget *budget)
{
    for (; x->at < x->count; x->at++) {
        if (!polyline_pay(x, budget, 12))
            return 0;
        x->key[x->at] = morton(x, x->raw[x->at]);
        x->order[x->at] = x->at;
    }
    return 1;
}

/* Keys of the listed points, in cells that are shifted anew; in round 0 they are the codes by
 * which all points are sorted already. */
int cairn_polyline_list(cairn_polyline *x, cairn_budget *budget)
{
    for (; x->base + x->at < x->count; x->at++) {
        int32_t i = x->order[x->base + x->at];

        if (!polyline_pay(x, budget, 12))
            return 0;
        x->key[i] = morton(x, x->point[i]);
    }
    return 1;
}

/* Total order of raw points; equal points are in no order that shows. */
static int point_before(const cairn_polyline *x, int32_t a, int32_t b)
{
    if (x->key[a] != x->key[b])
        return x->key[a] < x->key[b];
    for (int j = 0; j < 3; j++)
        if (x->raw[a][j] < x->raw[b][j] || x->raw[a][j] > x->raw[b][j])
            return x->raw[a][j] < x->raw[b][j];
    return a < b;
}

static int unclaimed_before(const cairn_polyline *x, int32_t a, int32_t b)
{
    return x->key[a] != x->key[b] ? x->key[a] < x->key[b] : a < b;
}

/* Total order of points by piece (none last), then along it. */
static int support_before(const cairn_polyline *x, int32_t a, int32_t b)
{
    if (x->owner[a] != x->owner[b])
        return (uint32_t)x->owner[a] < (uint32_t)x->owner[b];
    if (x->owner[a] >= 0 && (x->along[a] < x->along[b] || x->along[a] > x->along[b]))
        return x->along[a] < x->along[b];
    return a < b;
}

static int before(const cairn_polyline *x, int32_t a, int32_t b)
{
    if (x->phase == POLYLINE_SORT_SUPPORT)
        return support_before(x, a, b);
    return x->phase == POLYLINE_SORT_POINTS ? point_before(x, a, b) : unclaimed_before(x, a, b);
}

/* Natural merge sort of order[base ... count-1]: linear when the order of the last iteration
 * still nearly holds. Stage 0 looks for the end of a run, 1 for that of the next, 2 merges both
 * from one array into the other, 3 copies the end back. */
int cairn_polyline_sort(cairn_polyline *x, cairn_budget *budget)
{
    int32_t n = x->count - x->base;

    while (x->sort.stage < 3) {
        const int32_t *from = (x->sort.swapped ? x->spare : x->order) + x->base;
        int32_t *to = (x->sort.swapped ? x->order : x->spare) + x->base;

        if (x->sort.stage == 0) {
            while (x->sort.middle < n &&
                   !before(x, from[x->sort.middle], from[x->sort.middle - 1])) {
                if (!polyline_pay_four(x, budget, x->sort.middle, n, 4))
                    return 0;
                x->sort.middle++;
            }
            x->sort.end = x->sort.middle + 1;
            x->sort.stage = x->sort.start == 0 && x->sort.middle >= n ? 3 : 1;
        }
        if (x->sort.stage == 1) {
            while (x->sort.end < n && !before(x, from[x->sort.end], from[x->sort.end - 1])) {
                if (!polyline_pay_four(x, budget, x->sort.end, n, 4))
                    return 0;
                x->sort.end++;
            }
            x->sort.end = x->sort.end < n ? x->sort.end : n;
            x->sort.left = x->sort.out = x->sort.start;
            x->sort.right = x->sort.middle;
            x->sort.stage = 2;
        }
        while (x->sort.stage == 2 && x->sort.out < x->sort.end) {
            int32_t left = x->sort.left, right = x->sort.right;

            if (!polyline_pay_four(x, budget, x->sort.out, x->sort.end, 6))
                return 0;
            if (left < x->sort.middle &&
                (right >= x->sort.end || !before(x, from[right], from[left]))) {
                to[x->sort.out++] = from[left];
                x->sort.left++;
            } else {
                to[x->sort.out++] = from[right];
                x->sort.right++;
            }
        }
        if (x->sort.stage == 2) {
            x->sort.start = x->sort.end;
            if (x->sort.start >= n) {
                x->sort.swapped = !x->sort.swapped;
                x->sort.start = 0;
            }
            x->sort.middle = x->sort.start + 1;
            x->sort.stage = 0;
        }
    }
    for (; x->sort.swapped && x->at < n; x->at++) {
        if (!polyline_pay(x, budget, 1))
            return 0;
        x->order[x->base + x->at] = x->spare[x->base + x->at];
    }
    return 1;
}

int cairn_polyline_gather(cairn_polyline *x, cairn_budget *budget)
{
    for (; x->at < x->count; x->at++) {
        int32_t block = x->at / POLYLINE_BLOCK, raw = x->order[x->at];

        if (!polyline_pay(x, budget, 8))
            return 0;
        x->source[x->at] = raw;
        for (int j = 0; j < 3; j++) {
            cairn_real value = x->raw[raw][j];
            int first = x->at % POLYLINE_BLOCK == 0;

            x->point[x->at][j] = value;
            x->block_min[block][j] = first ? value : cairn_min(x->block_min[block][j], value);
            x->block_max[block][j] = first ? value : cairn_max(x->block_max[block][j], value);
        }
        x->order[x->at] = x->at;
    }
    return 1;
}
