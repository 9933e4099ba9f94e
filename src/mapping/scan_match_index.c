/* Where the target's points are: a grid of cells, wrapped around, with the points of a cell side by side.
 *
 * Layout: as for counting sort: start[c] is the first point of cell c, points of one row of cells follow each other. A point
 * far away may share a cell with a near one; its distance tells.
 *
 * Limits: with many more points in a cell than an even spacing gives, a search costs as many. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/scan_match_work.h"

/* Side of the grid: about four cells a point. */
static int32_t side_for(int32_t max_points)
{
    int32_t side = 16;

    while (side < 2048 && side * side / 4 < max_points)
        side *= 2;
    return side;
}

size_t cairn_match_index_cells(int32_t max_points)
{
    return (size_t)side_for(max_points) * (size_t)side_for(max_points);
}

void cairn_match_index_reset(match_index *index, int32_t max_points, int32_t count, cairn_real cell)
{
    index->side = side_for(max_points);
    index->count = count;
    index->per_metre = 1 / cell;
    memset(index->start, 0, (cairn_match_index_cells(max_points) + 1) * sizeof *index->start);
}

static int32_t coordinate(const match_index *index, cairn_real x)
{
    return cairn_real_to_int(cairn_floor(x * index->per_metre));
}

static int32_t cell_of(const match_index *index, cairn_vec2 p)
{
    int32_t mask = index->side - 1;

    return (coordinate(index, p.y) & mask) * index->side + (coordinate(index, p.x) & mask);
}

void cairn_match_index_count(match_index *index, cairn_vec2 p)
{
    index->start[cell_of(index, p)]++;
}

/* Counts become the ends of their cells, cell after cell. */
void cairn_match_index_sum(match_index *index, int32_t first, int32_t end)
{
    for (int32_t cell = first > 0 ? first : 1; cell < end; cell++)
        index->start[cell] += index->start[cell - 1];
}

/* Ends become starts as points are placed, the last one first. */
void cairn_match_index_place(match_index *index, cairn_oriented_point p)
{
    index->points[--index->start[cell_of(index, p.position)]] = p;
}

/* Looks at points[first ... end - 1]; returns the cost in parts of a unit. */
static int32_t search(const match_index *index, int32_t first, int32_t end, match_search *asked)
{
    for (int32_t i = first; i < end; i++) {
        const cairn_oriented_point *point = &index->points[i];
        cairn_real d = cairn_vec2_norm_squared(cairn_vec2_sub(point->position, asked->p));

        if (d <= asked->nearest && cairn_vec2_dot(point->direction, asked->direction) >= asked->cosine) {
            asked->nearest = d;
            asked->best = point;
        }
    }
    return end > first ? end - first : 0;
}

const cairn_oriented_point *cairn_match_index_nearest(const match_index *index, match_search *asked, cairn_real gate,
                                                      int32_t *parts)
{
    int32_t mask = index->side - 1, low_x = coordinate(index, asked->p.x - gate);
    int32_t high_x = coordinate(index, asked->p.x + gate), low_y = coordinate(index, asked->p.y - gate);
    int32_t high_y = coordinate(index, asked->p.y + gate);

    asked->nearest = gate * gate;
    asked->best = NULL;
    for (int32_t y = low_y; y <= high_y; y++) {
        int32_t row = (y & mask) * index->side, a = low_x & mask, b = high_x & mask;

        *parts += 4;
        if (a <= b) {
            *parts += search(index, index->start[row + a], index->start[row + b + 1], asked);
        } else {
            *parts += search(index, index->start[row + a], index->start[row + index->side], asked);
            *parts += search(index, index->start[row], index->start[row + b + 1], asked);
        }
    }
    return asked->best;
}

int32_t cairn_match_direction_bin(cairn_real angle)
{
    int32_t bin = cairn_real_to_int(cairn_floor(angle * (MATCH_DIRECTIONS / (2 * CAIRN_PI)))) % MATCH_DIRECTIONS;

    return bin < 0 ? bin + MATCH_DIRECTIONS : bin;
}
