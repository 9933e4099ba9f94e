/* scan_match: spatial hash grid of the target's points, wrapped around.
 *
 * Layout: start[c] is the first point of cell c; points of one row of cells are contiguous. Distant
 * points may share a cell with near ones; their distance excludes them.
 * Limits: with many more points in a cell than an even spacing gives, a query visits them all. */
#include "src/base/build.h"

#include "src/containers/counting_sort.h"
#include "src/scans/scan_match_work.h"

/* parts of a unit */
enum { PARTS_PER_ROW = 6, PARTS_PER_POINT = 3 };

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

void cairn_scan_match_index_open(scan_match_index *index, int32_t max_points, int32_t count,
                                 cairn_real cell)
{
    index->side = side_for(max_points);
    index->count = count;
    index->cell = cell;
    index->per_metre = 1 / cell;
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

/* Places a point; ends become starts as points are placed, the last one first. */
void cairn_scan_match_index_place(scan_match_index *index, cairn_oriented_point p)
{
    index->points[counting_sort_place(index->start, cell_of(index, p.position))] = p;
}

void cairn_scan_match_search_begin(scan_match_search *search, const scan_match_index *index,
                                   const cairn_transform *target_query,
                                   const cairn_oriented_point *point, cairn_real cosine,
                                   cairn_real gate)
{
    search->index = index;
    search->p = cairn_transform_point(*target_query, point->position);
    search->direction = cairn_transform_direction(*target_query, point->direction);
    search->cosine = cosine;
    search->gate = gate;
    search->up = coordinate(index, search->p.y);
    search->down = search->up - 1;
    search->above = 0;
    search->below = search->p.y - (cairn_real)search->up * index->cell;
    search->nearest = gate * gate;
    search->best = NULL;
}

/* Visits points[first ... end - 1]; a nearer one narrows the gate. */
static void visit_points(scan_match_search *search, int32_t first, int32_t end)
{
    const scan_match_index *index = search->index;
    const cairn_oriented_point *before = search->best;

    for (int32_t i = first; i < end; i++) {
        const cairn_oriented_point *point = &index->points[i];
        cairn_real d = cairn_vec2_norm_squared(cairn_vec2_sub(point->position, search->p));

        if (d <= search->nearest &&
            cairn_vec2_dot(point->direction, search->direction) >= search->cosine) {
            search->nearest = d;
            search->best = point;
        }
    }
    if (search->best != before)
        search->gate = cairn_sqrt(search->nearest);
}

/* Moves on from the row that was visited. */
static void take_next_row(scan_match_search *search, int is_above)
{
    cairn_real cell = search->index->cell;

    if (is_above)
        search->above = (cairn_real)++search->up * cell - search->p.y;
    else
        search->below = search->p.y - (cairn_real)search->down-- * cell;
}

/* Visits rows from the point's own outwards, until the next one is farther than the best; of a row
 * the cells within the gate: one range of points, or two where the grid is wrapped around. */
int cairn_scan_match_search_nearest(cairn_scan_match *match, cairn_budget *budget)
{
    scan_match_search *search = &match->search;
    const scan_match_index *index = search->index;
    int32_t mask = index->side - 1;

    while (cairn_min(search->above, search->below) <= search->gate) {
        int is_above = search->above <= search->below;
        const int32_t *row =
            &index->start[((is_above ? search->up : search->down) & mask) * index->side];
        int32_t low = coordinate(index, search->p.x - search->gate) & mask,
                high = coordinate(index, search->p.x + search->gate) & mask;
        int32_t first = row[low], end = row[high + 1], row_first = row[0],
                row_end = row[index->side];
        int is_wrapped = low > high;
        int32_t count = end - first + (is_wrapped ? row_end - row_first : 0);

        if (!cairn_scan_match_charge(match, budget, PARTS_PER_ROW + PARTS_PER_POINT * count))
            return 0;
        visit_points(search, first, is_wrapped ? row_end : end);
        if (is_wrapped)
            visit_points(search, row_first, end);
        take_next_row(search, is_above);
    }
    return 1;
}
