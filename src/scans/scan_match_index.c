/* scan_match: spatial hash grid of the target's points, wrapped around.
 *
 * Layout: start[c] is the first point of cell c; points of one row of cells are contiguous. Distant
 * points may share a cell with near ones; their distance excludes them.
 * Limits: with many more points in a cell than an even spacing gives, a query visits them all. */
#include "src/base/build.h"

#include "src/containers/counting_sort.h"
#include "src/scans/scan_match_work.h"

enum { PARTS_PER_ROW = 6 }; /* parts of a unit */

/* Returns the side of the grid, in cells: about four cells per point. */
static int32_t side_for(int32_t max_points)
{
    int32_t side = 16;

    while (side < 2048 && side * side / 4 < max_points)
        side *= 2;
    return side;
}

size_t cairn_scan_match_index_cells(int32_t max_points)
{
    return (size_t)side_for(max_points) * (size_t)side_for(max_points);
}

void cairn_scan_match_index_reset(scan_match_index *index, int32_t max_points, int32_t count,
                                  cairn_real cell)
{
    index->side = side_for(max_points);
    index->count = count;
    index->cell = cell;
    index->per_metre = 1 / cell;
    counting_sort_reset(index->start, 0, (int32_t)cairn_scan_match_index_cells(max_points) + 1);
}

static int32_t coordinate(const scan_match_index *index, cairn_real x)
{
    return cairn_real_to_int(cairn_floor(x * index->per_metre));
}

static int32_t cell_of(const scan_match_index *index, cairn_vec2 p)
{
    int32_t mask = index->side - 1;

    return (coordinate(index, p.y) & mask) * index->side + (coordinate(index, p.x) & mask);
}

void cairn_scan_match_index_count(scan_match_index *index, cairn_vec2 p)
{
    counting_sort_count(index->start, cell_of(index, p));
}

/* Prefix sums: counts become the ends of their cells. */
void cairn_scan_match_index_sum(scan_match_index *index, int32_t first, int32_t end)
{
    counting_sort_sum(index->start, first, end);
}

/* Places a point; ends become starts as points are placed, the last one first. */
void cairn_scan_match_index_place(scan_match_index *index, cairn_oriented_point p)
{
    index->points[counting_sort_place(index->start, cell_of(index, p.position))] = p;
}

/* Visits points[first ... end - 1]; returns the cost in parts of a unit. */
static int32_t visit_points(const scan_match_index *index, int32_t first, int32_t end,
                            scan_match_search *search)
{
    for (int32_t i = first; i < end; i++) {
        const cairn_oriented_point *point = &index->points[i];
        cairn_real d = cairn_vec2_norm_squared(cairn_vec2_sub(point->position, search->p));

        if (d <= search->nearest &&
            cairn_vec2_dot(point->direction, search->direction) >= search->cosine) {
            search->nearest = d;
            search->best = point;
        }
    }
    return end > first ? 3 * (end - first) : 0;
}

/* Visits the cells of a row within `reach` of the query; returns the cost. */
static int32_t visit_row(const scan_match_index *index, int32_t y, cairn_real reach,
                         scan_match_search *search)
{
    int32_t mask = index->side - 1, row = (y & mask) * index->side;
    int32_t low = coordinate(index, search->p.x - reach) & mask,
            high = coordinate(index, search->p.x + reach) & mask;

    if (low <= high)
        return PARTS_PER_ROW +
               visit_points(index, index->start[row + low], index->start[row + high + 1], search);
    return PARTS_PER_ROW +
           visit_points(index, index->start[row + low], index->start[row + index->side], search) +
           visit_points(index, index->start[row], index->start[row + high + 1], search);
}

/* Visits rows from the point's own outwards, until the next one is farther than the best. */
const cairn_oriented_point *cairn_scan_match_index_nearest(const scan_match_index *index,
                                                           scan_match_search *search,
                                                           cairn_real gate, int32_t *parts)
{
    int32_t up = coordinate(index, search->p.y), down = up - 1;
    cairn_real above = 0, below = search->p.y - (cairn_real)up * index->cell;

    search->nearest = gate * gate;
    search->best = NULL;
    while (cairn_min(above, below) <= gate) {
        if (above <= below) {
            *parts += visit_row(index, up++, gate, search);
            above = (cairn_real)up * index->cell - search->p.y;
        } else {
            *parts += visit_row(index, down--, gate, search);
            below = search->p.y - (cairn_real)(down + 1) * index->cell;
        }
        if (search->best != NULL)
            gate = cairn_sqrt(search->nearest);
    }
    return search->best;
}
