/* Segments that meet: ends in the cells of a grid as wide as the farthest that they may lie
 * apart, or wider where that were many more cells than ends. */
#include "src/core/build.h"

#include <stdlib.h>

#include "src/host/contour_search_ends.h"

enum { CELLS_OF_END = 4 };

int cairn_contour_meet(cairn_segment a, cairn_segment b, cairn_real apart)
{
    const cairn_real most = apart * apart;

    return cairn_vec2_norm_squared(cairn_vec2_sub(a.a, b.a)) <= most ||
           cairn_vec2_norm_squared(cairn_vec2_sub(a.a, b.b)) <= most ||
           cairn_vec2_norm_squared(cairn_vec2_sub(a.b, b.a)) <= most ||
           cairn_vec2_norm_squared(cairn_vec2_sub(a.b, b.b)) <= most;
}

static cairn_vec2 place_of(const contour_ends *e, int32_t end)
{
    const cairn_segment *line = &e->lines[e->listed[end / 2]];

    return end % 2 == 0 ? line->a : line->b;
}

static int32_t cell_of(cairn_real offset, cairn_real cell)
{
    return cairn_real_to_int(offset / cell);
}

int cairn_contour_ends_make(contour_ends *ends, const cairn_segment *lines, const int32_t *listed,
                            int32_t count, cairn_real apart)
{
    cairn_box box = cairn_box_empty();
    contour_ends e = {.lines = lines, .listed = listed, .count = count, .apart = apart};
    size_t cells;

    for (int32_t i = 0; i < 2 * count; i++)
        box = cairn_box_extend(box, place_of(&e, i));
    e.origin = count > 0 ? box.min : (cairn_vec2){0, 0};
    e.cell = apart * CAIRN_REAL(1.001);
    do {
        e.columns = count > 0 ? 1 + cell_of(box.max.x - box.min.x, e.cell) : 1;
        e.rows = count > 0 ? 1 + cell_of(box.max.y - box.min.y, e.cell) : 1;
        cells = (size_t)e.columns * (size_t)e.rows;
        e.cell *= 2;
    } while (cells > 1024 + (size_t)CELLS_OF_END * (size_t)count);
    e.cell /= 2;
    e.heads = calloc(cells + 1, sizeof *e.heads);
    e.next = malloc((2 * (size_t)count + 1) * sizeof *e.next);
    e.seen = calloc((size_t)count + 1, sizeof *e.seen);
    e.near = malloc(((size_t)count + 1) * sizeof *e.near);
    if (e.heads == NULL || e.next == NULL || e.seen == NULL || e.near == NULL) {
        cairn_contour_ends_free(&e);
        return 0;
    }
    for (int32_t i = 0; i < 2 * count; i++) {
        cairn_vec2 at = cairn_vec2_sub(place_of(&e, i), e.origin);
        int32_t *head = &e.heads[(size_t)cell_of(at.y, e.cell) * (size_t)e.columns +
                                 (size_t)cell_of(at.x, e.cell)];

        e.next[i] = *head;
        *head = i + 1;
    }
    *ends = e;
    return 1;
}

static int ascending(const void *a, const void *b)
{
    const int32_t *x = a, *y = b;

    return (*x > *y) - (*x < *y);
}

int32_t cairn_contour_ends_near(contour_ends *e, int32_t place)
{
    int32_t count = 0;

    e->queries++;
    for (int32_t end = 2 * place; end < 2 * place + 2; end++) {
        cairn_vec2 at = cairn_vec2_sub(place_of(e, end), e->origin);
        int32_t x = cell_of(at.x, e->cell), y = cell_of(at.y, e->cell);

        for (int32_t row = y > 0 ? y - 1 : 0; row <= y + 1 && row < e->rows; row++)
            for (int32_t column = x > 0 ? x - 1 : 0; column <= x + 1 && column < e->columns;
                 column++)
                for (int32_t i = e->heads[row * e->columns + column]; i > 0; i = e->next[i - 1]) {
                    int32_t other = (i - 1) / 2;

                    if (other == place || e->seen[other] == e->queries ||
                        !cairn_contour_meet(e->lines[e->listed[place]], e->lines[e->listed[other]],
                                            e->apart))
                        continue;
                    e->seen[other] = e->queries;
                    e->near[count++] = other;
                }
    }
    qsort(e->near, (size_t)count, sizeof *e->near, ascending);
    return count;
}

void cairn_contour_ends_free(contour_ends *ends)
{
    free(ends->heads);
    free(ends->next);
    free(ends->seen);
    free(ends->near);
}
