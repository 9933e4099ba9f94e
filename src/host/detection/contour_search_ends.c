/* Adjacency of segments: a hash-free grid over their ends, with cells as wide as the greatest
 * distance, or wider when that would give many more cells than ends. */
#include "src/base/build.h"

#include <stdlib.h>

#include "src/host/detection/contour_search_ends.h"

enum { CELLS_PER_END = 4 };

int cairn_contour_search_meet(cairn_segment a, cairn_segment b, cairn_real max_distance)
{
    const cairn_real max_squared = max_distance * max_distance;

    return cairn_vec2_norm_squared(cairn_vec2_sub(a.a, b.a)) <= max_squared ||
           cairn_vec2_norm_squared(cairn_vec2_sub(a.a, b.b)) <= max_squared ||
           cairn_vec2_norm_squared(cairn_vec2_sub(a.b, b.a)) <= max_squared ||
           cairn_vec2_norm_squared(cairn_vec2_sub(a.b, b.b)) <= max_squared;
}

static cairn_vec2 end_position(const contour_search_ends *ends, int32_t end)
{
    const cairn_segment *line = &ends->lines[ends->listed[end / 2]];

    return end % 2 == 0 ? line->a : line->b;
}

static int32_t cell_of(cairn_real offset, cairn_real cell)
{
    return cairn_real_to_int(offset / cell);
}

int cairn_contour_search_ends_make(contour_search_ends *ends, const cairn_segment *lines,
                                   const int32_t *listed, int32_t count, cairn_real max_distance)
{
    cairn_box box = cairn_box_empty();
    contour_search_ends made = {
        .lines = lines, .listed = listed, .count = count, .max_distance = max_distance};
    size_t cells;

    for (int32_t i = 0; i < 2 * count; i++)
        box = cairn_box_extend(box, end_position(&made, i));
    made.origin = count > 0 ? box.min : (cairn_vec2){0, 0};
    made.cell = max_distance * CAIRN_REAL(1.001);
    do {
        made.columns = count > 0 ? 1 + cell_of(box.max.x - box.min.x, made.cell) : 1;
        made.rows = count > 0 ? 1 + cell_of(box.max.y - box.min.y, made.cell) : 1;
        cells = (size_t)made.columns * (size_t)made.rows;
        made.cell *= 2;
    } while (cells > 1024 + (size_t)CELLS_PER_END * (size_t)count);
    made.cell /= 2;
    made.cell_heads = calloc(cells + 1, sizeof *made.cell_heads);
    made.next = malloc((2 * (size_t)count + 1) * sizeof *made.next);
    made.last_query = calloc((size_t)count + 1, sizeof *made.last_query);
    made.neighbours = malloc(((size_t)count + 1) * sizeof *made.neighbours);
    if (made.cell_heads == NULL || made.next == NULL || made.last_query == NULL ||
        made.neighbours == NULL) {
        cairn_contour_search_ends_free(&made);
        return 0;
    }
    for (int32_t i = 0; i < 2 * count; i++) {
        cairn_vec2 offset = cairn_vec2_sub(end_position(&made, i), made.origin);
        int32_t *head =
            &made.cell_heads[(size_t)cell_of(offset.y, made.cell) * (size_t)made.columns +
                             (size_t)cell_of(offset.x, made.cell)];

        made.next[i] = *head;
        *head = i + 1;
    }
    *ends = made;
    return 1;
}

static int ascending(const void *a, const void *b)
{
    const int32_t *x = a, *y = b;

    return (*x > *y) - (*x < *y);
}

int32_t cairn_contour_search_ends_near(contour_search_ends *ends, int32_t index)
{
    int32_t count = 0;

    ends->query_count++;
    for (int32_t end = 2 * index; end < 2 * index + 2; end++) {
        cairn_vec2 offset = cairn_vec2_sub(end_position(ends, end), ends->origin);
        int32_t x = cell_of(offset.x, ends->cell), y = cell_of(offset.y, ends->cell);

        for (int32_t row = y > 0 ? y - 1 : 0; row <= y + 1 && row < ends->rows; row++)
            for (int32_t column = x > 0 ? x - 1 : 0; column <= x + 1 && column < ends->columns;
                 column++)
                for (int32_t i = ends->cell_heads[row * ends->columns + column]; i > 0;
                     i = ends->next[i - 1]) {
                    int32_t other = (i - 1) / 2;

                    if (other == index || ends->last_query[other] == ends->query_count ||
                        !cairn_contour_search_meet(ends->lines[ends->listed[index]],
                                                   ends->lines[ends->listed[other]],
                                                   ends->max_distance))
                        continue;
                    ends->last_query[other] = ends->query_count;
                    ends->neighbours[count++] = other;
                }
    }
    qsort(ends->neighbours, (size_t)count, sizeof *ends->neighbours, ascending);
    return count;
}

void cairn_contour_search_ends_free(contour_search_ends *ends)
{
    free(ends->cell_heads);
    free(ends->next);
    free(ends->last_query);
    free(ends->neighbours);
}
