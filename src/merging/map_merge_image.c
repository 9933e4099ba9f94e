/* Image similarity Psi and gamma as written (9.5, 9.6), and the image of the merged maps.
 *
 * Method.
 *
 * 1. For each known cell of an image the Manhattan distances to the nearest occupied and to the
 *    nearest free cell of the other image are looked up in its distance maps. A cell outside is as
 *    far as its nearest cell inside, plus that cell's distance.
 * 2. The kernel of the distance to the same class is added to Psi, that to the other class to d.
 *    All cells count; those beyond the kernel's reach are skipped, since they add nothing.
 * 3. The merged image has the cells of the reference. Each map is sampled at the centre of every
 *    cell and has one vote.
 *
 * Source: Adluru 2008, section 9.4. */
#include "src/base/build.h"

#include <string.h>

#include "src/merging/map_merge_work.h"

/* cells: parameters of the kernel, and the distance from which on it is 0 */
#define KERNEL_MU          CAIRN_REAL(0.0)
#define KERNEL_SIGMA_CELLS CAIRN_REAL(0.5)
enum { KERNEL_REACH_CELLS = 5, CELLS_PER_UNIT = 4 };

/* cells: rows of less slope are treated as level and not clipped */
#define LEVEL_SLOPE_CELLS CAIRN_REAL(1e-6)
/* cells: margin at an image's edge where rounding may put a cell outside */
#define EDGE_CELLS CAIRN_REAL(0.05)

/* minimum of d, which keeps its logarithm finite */
#define MIN_DISAGREEMENT CAIRN_REAL(1e-6)

void cairn_map_merge_set_kernel(cairn_real *kernel)
{
    for (int32_t d = 0; d <= MAP_MERGE_MAX_DISTANCE; d++) {
        cairn_real x = (cairn_real)d;

        kernel[d] =
            d < KERNEL_REACH_CELLS
                ? cairn_exp(x * (2 * KERNEL_MU - x) / (2 * KERNEL_SIGMA_CELLS * KERNEL_SIGMA_CELLS))
                : 0;
    }
}

/* ---- Bounding boxes ---- */

cairn_box cairn_map_merge_box_of(const map_merge_map *map, cairn_pose pose)
{
    cairn_transform t = cairn_transform_of(pose);
    cairn_box box = cairn_box_empty();
    cairn_real width = (cairn_real)map->input.cells.width * map->input.resolution;
    cairn_real height = (cairn_real)map->input.cells.height * map->input.resolution;

    for (int32_t k = 0; k < 4; k++) {
        cairn_vec2 p = map->corner;

        p.x += k % 2 == 1 ? width : 0;
        p.y += k / 2 == 1 ? height : 0;
        box = cairn_box_extend(box, cairn_transform_point(t, p));
    }
    return box;
}

cairn_box cairn_map_merge_join(cairn_box a, cairn_box b)
{
    return cairn_box_extend(cairn_box_extend(a, b.min), b.max);
}

/* Returns the cell that contains a coordinate, clamped to -limit ... limit. */
static inline int32_t cell_index(cairn_real at, int32_t limit)
{
    cairn_real most = (cairn_real)limit, within = at < most ? at > -most ? at : -most : most;
    int32_t whole = cairn_real_to_int(within);

    return whole - ((cairn_real)whole > within);
}

/* ---- Comparison of two images ---- */

/* Sets the columns and rows of image k that lie near the other image's box. */
static void set_window(map_merge_images *images, int32_t k, cairn_pose own_other)
{
    const map_merge_map *own = images->map[k], *other = images->map[1 - k];
    cairn_box box = cairn_map_merge_box_of(other, own_other);
    cairn_real margin = KERNEL_REACH_CELLS * other->input.resolution,
               scale = 1 / own->input.resolution;
    int32_t width = own->input.cells.width, height = own->input.cells.height;

    images->begin[k][0] = cell_index((box.min.x - margin - own->corner.x) * scale, width);
    images->end[k][0] = cell_index((box.max.x + margin - own->corner.x) * scale, width) + 1;
    images->begin[k][1] = cell_index((box.min.y - margin - own->corner.y) * scale, height);
    images->end[k][1] = cell_index((box.max.y + margin - own->corner.y) * scale, height) + 1;
    for (int32_t i = 0; i < 2; i++) {
        int32_t side = i == 0 ? width : height;

        images->begin[k][i] = images->begin[k][i] > 0 ? images->begin[k][i] : 0;
        images->end[k][i] = images->end[k][i] < side ? images->end[k][i] : side;
    }
}

void cairn_map_merge_begin_images(map_merge_images *images, const map_merge_map *a,
                                  const map_merge_map *b, cairn_pose a_b)
{
    cairn_pose b_a = cairn_pose_inverse(a_b);

    memset(images, 0, sizeof *images);
    images->map[0] = a;
    images->map[1] = b;
    images->to_other[0] = cairn_transform_of(b_a);
    images->to_other[1] = cairn_transform_of(a_b);
    set_window(images, 0, a_b);
    set_window(images, 1, b_a);
}

/* Returns the cell of an image nearest to one that may lie outside; adds their distance to
 * *outside_distance. */
static int32_t clamp_cell(int32_t at, int32_t side, int32_t *outside_distance)
{
    int32_t within = at < 0 ? 0 : at < side ? at : side - 1;

    *outside_distance += at < within ? within - at : at - within;
    return within;
}

/* Clips columns *begin ... *end - 1 to those where start + column * step lies in low ... high,
 * widened by `spare` columns on either side (narrowed when negative). */
static void clip(cairn_real start, cairn_real step, cairn_real low, cairn_real high, int32_t spare,
                 int32_t *begin, int32_t *end)
{
    cairn_real a = (low - start) / step, b = (high - start) / step;
    int32_t first = cell_index(cairn_min(a, b), *end) + 1 - spare,
            last = cell_index(cairn_max(a, b), *end) + spare;

    *begin = *begin > first ? *begin : first;
    *end = *end < last + 1 ? *end : last + 1;
}

/* A row of an image mapped into the other one: cell (first + column * step) in cells. */
typedef struct image_row {
    const map_merge_map *other;
    const uint16_t *cells;
    cairn_vec2 first, step;
    cairn_real same[2], other_class[2];
    int32_t known;
} image_row;

static void add_cell(image_row *row, uint16_t own, uint16_t cell, int32_t outside_distance,
                     const cairn_real *kernel)
{
    int32_t to_occupied = outside_distance + map_merge_to_occupied(cell),
            to_free = outside_distance + map_merge_to_free(cell);

    to_occupied = to_occupied < MAP_MERGE_MAX_DISTANCE ? to_occupied : MAP_MERGE_MAX_DISTANCE;
    to_free = to_free < MAP_MERGE_MAX_DISTANCE ? to_free : MAP_MERGE_MAX_DISTANCE;
    if (map_merge_class(own) == MAP_MERGE_OCCUPIED) {
        row->same[1] += kernel[to_occupied];
        row->other_class[1] += kernel[to_free];
    } else {
        row->same[0] += kernel[to_free];
        row->other_class[0] += kernel[to_occupied];
        row->known += outside_distance == 0 && map_merge_class(cell) != MAP_MERGE_UNKNOWN;
    }
}

/* Adds columns that may lie outside the other image. */
static void add_outside(image_row *row, int32_t begin, int32_t end, const cairn_real *kernel)
{
    int32_t width = row->other->input.cells.width, height = row->other->input.cells.height;

    for (int32_t column = begin; column < end; column++) {
        int32_t u, v, outside_distance = 0;

        if (map_merge_class(row->cells[column]) == MAP_MERGE_UNKNOWN)
            continue;
        u = clamp_cell(
            cell_index(row->first.x + (cairn_real)column * row->step.x, width + KERNEL_REACH_CELLS),
            width, &outside_distance);
        v = clamp_cell(cell_index(row->first.y + (cairn_real)column * row->step.y,
                                  height + KERNEL_REACH_CELLS),
                       height, &outside_distance);
        add_cell(row, row->cells[column], row->other->grid[(size_t)v * (size_t)width + (size_t)u],
                 outside_distance, kernel);
    }
}

/* Adds columns that lie inside it. */
static void add_inside(image_row *row, int32_t begin, int32_t end, const cairn_real *kernel)
{
    size_t width = (size_t)row->other->input.cells.width;

    for (int32_t column = begin; column < end; column++) {
        size_t u = (size_t)(row->first.x + (cairn_real)column * row->step.x);
        size_t v = (size_t)(row->first.y + (cairn_real)column * row->step.y);

        if (map_merge_class(row->cells[column]) != MAP_MERGE_UNKNOWN)
            add_cell(row, row->cells[column], row->other->grid[v * width + u], 0, kernel);
    }
}

/* Adds the current row: its cells within the kernel's reach of the other image. */
static void add_row(map_merge_images *images, const cairn_real *kernel)
{
    int32_t k = images->turn;
    const map_merge_map *own = images->map[k], *other = images->map[1 - k];
    cairn_real width = (cairn_real)other->input.cells.width,
               height = (cairn_real)other->input.cells.height;
    cairn_real scale = 1 / other->input.resolution, size = own->input.resolution,
               row = (cairn_real)images->row;
    cairn_vec2 first = {own->corner.x + size / 2, own->corner.y + (row + CAIRN_REAL(0.5)) * size},
               along = {size, 0};
    int32_t begin = images->begin[k][0], end = images->end[k][0], from, to;
    image_row r = {other,  own->grid + (size_t)images->row * (size_t)own->input.cells.width,
                   {0, 0}, {0, 0},
                   {0, 0}, {0, 0},
                   0};

    r.first = cairn_vec2_scale(
        cairn_vec2_sub(cairn_transform_point(images->to_other[k], first), other->corner), scale);
    r.step = cairn_vec2_scale(cairn_transform_direction(images->to_other[k], along), scale);
    if (cairn_abs(r.step.x) < LEVEL_SLOPE_CELLS || cairn_abs(r.step.y) < LEVEL_SLOPE_CELLS) {
        add_outside(&r, begin, end, kernel);
    } else {
        clip(r.first.x, r.step.x, -KERNEL_REACH_CELLS, width + KERNEL_REACH_CELLS, 1, &begin, &end);
        clip(r.first.y, r.step.y, -KERNEL_REACH_CELLS, height + KERNEL_REACH_CELLS, 1, &begin,
             &end);
        from = begin;
        to = end;
        clip(r.first.x, r.step.x, EDGE_CELLS, width - EDGE_CELLS, -1, &from, &to);
        clip(r.first.y, r.step.y, EDGE_CELLS, height - EDGE_CELLS, -1, &from, &to);
        if (from < to) {
            add_outside(&r, begin, from, kernel);
            add_inside(&r, from, to, kernel);
            begin = to;
        }
        add_outside(&r, begin, end, kernel);
    }
    for (int32_t i = 0; i < 2; i++) {
        images->same[k][i] += r.same[i];
        images->other[k][i] += r.other_class[i];
    }
    images->known += k == 1 ? r.known : 0;
}

/* Returns the units of a row of the current image. */
static int32_t row_units(const map_merge_images *images)
{
    int32_t cells = images->end[images->turn][0] - images->begin[images->turn][0];

    return 1 + (cells > 0 ? cells : 0) / CELLS_PER_UNIT;
}

int cairn_map_merge_step_images(map_merge_images *images, const cairn_real *kernel,
                                cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(images->resume);
    for (images->turn = 0; images->turn < 2; images->turn++)
        for (images->row = images->begin[images->turn][1];
             images->row < images->end[images->turn][1]; images->row++) {
            CAIRN_STEP_CHARGE(images, resume, budget, row_units(images));
            add_row(images, kernel);
        }
    CAIRN_STEP_END(images->resume);
}

void cairn_map_merge_end_images(const map_merge_images *images, cairn_map_merge_pair_score *score)
{
    score->psi = score->disagreement = 0;
    for (int32_t k = 0; k < 2; k++) {
        cairn_real free = (cairn_real)images->map[k]->free_count,
                   occupied = (cairn_real)images->map[k]->occupied_count;

        score->psi +=
            images->same[k][0] / cairn_max(free, 1) + images->same[k][1] / cairn_max(occupied, 1);
        score->disagreement +=
            images->other[k][0] / cairn_max(free, 1) + images->other[k][1] / cairn_max(occupied, 1);
    }
    {
        int32_t a = images->map[0]->free_count, b = images->map[1]->free_count;
        cairn_real d = cairn_max(score->disagreement, MIN_DISAGREEMENT);

        score->overlap = (cairn_real)images->known / cairn_max((cairn_real)(a < b ? a : b), 1);
        score->gamma = -cairn_log(d) - d;
    }
}

/* ---- The merged image ---- */

/* Computes the first cell and the end of an image of the box along x or y, in cells of the
 * reference, with a margin for rounding. */
static void merged_extent(const cairn_map_merge *merge, cairn_real low, cairn_real high,
                          cairn_real corner, int32_t *first, int32_t *end)
{
    const cairn_real hair = CAIRN_REAL(1e-3);
    cairn_real scale = 1 / merge->maps[merge->reference].input.resolution;

    *first = cell_index((low - corner) * scale + hair, INT32_MAX / 4);
    *end = cell_index((high - corner) * scale - hair, INT32_MAX / 4) + 1;
}

int cairn_map_merge_has_capacity(const cairn_map_merge *merge, cairn_box box)
{
    cairn_vec2 corner = merge->maps[merge->reference].corner;
    int32_t x, y, right, top;

    merged_extent(merge, box.min.x, box.max.x, corner.x, &x, &right);
    merged_extent(merge, box.min.y, box.max.y, corner.y, &y, &top);
    return right - x <= CAIRN_RASTER_MAX_SIDE && top - y <= CAIRN_RASTER_MAX_SIDE &&
           (int64_t)(right - x) * (top - y) <= merge->written->max_cells;
}

/* Sets up an empty image of the bounding box of all neighbours. */
static void begin_merged(cairn_map_merge *merge)
{
    const map_merge_map *reference = &merge->maps[merge->reference];
    map_merge_written *w = merge->written;
    map_merge_map *map = &w->merged;
    int32_t x, y, right, top;

    w->box = cairn_box_empty();
    for (int32_t i = 0; i < merge->neighbours.count; i++)
        w->box = cairn_map_merge_join(
            w->box, cairn_map_merge_box_of(&merge->maps[merge->neighbours.maps[i]],
                                           merge->neighbours.poses[i]));
    merged_extent(merge, w->box.min.x, w->box.max.x, reference->corner.x, &x, &right);
    merged_extent(merge, w->box.min.y, w->box.max.y, reference->corner.y, &y, &top);
    map->input.resolution = reference->input.resolution;
    map->input.cells.data = w->cells;
    map->input.cells.width = right - x;
    map->input.cells.stride = right - x;
    map->input.cells.height = top - y;
    map->corner.x = reference->corner.x + (cairn_real)x * map->input.resolution;
    map->corner.y = reference->corner.y + (cairn_real)y * map->input.resolution;
}

/* Clears the votes of the current row. */
static void clear_row(map_merge_written *written)
{
    size_t width = (size_t)written->merged.input.cells.width;

    memset(written->merged.grid + (size_t)written->row * width, 0, width * sizeof(uint16_t));
}

/* Adds the votes of the current neighbour to the current row: low byte occupied, high byte free. */
static void vote_row(cairn_map_merge *merge)
{
    int32_t near = merge->written->neighbour, row = merge->written->row;
    const map_merge_map *from = &merge->maps[merge->neighbours.maps[near]];
    map_merge_map *to = &merge->written->merged;
    cairn_transform t = cairn_transform_of(cairn_pose_inverse(merge->neighbours.poses[near]));
    cairn_real scale = 1 / from->input.resolution;
    uint16_t *votes = to->grid + (size_t)row * (size_t)to->input.cells.width;

    for (int32_t column = 0; column < to->input.cells.width; column++) {
        cairn_real x = (cairn_real)column + CAIRN_REAL(0.5), y = (cairn_real)row + CAIRN_REAL(0.5);
        cairn_vec2 p = {to->corner.x + x * to->input.resolution,
                        to->corner.y + y * to->input.resolution};
        int32_t class;

        p = cairn_transform_point(t, p);
        class = map_merge_class(map_merge_cell_at(from, (p.x - from->corner.x) * scale,
                                                  (p.y - from->corner.y) * scale));
        votes[column] = (uint16_t)(votes[column] + (class == MAP_MERGE_OCCUPIED ? 1
                                                    : class == MAP_MERGE_FREE   ? 1 << 8
                                                                                : 0));
    }
}

/* Sets the cells of the current row to the majority of the votes. */
static void count_row(map_merge_written *written)
{
    size_t width = (size_t)written->merged.input.cells.width, end;

    end = (size_t)(written->row + 1) * width;
    for (size_t at = (size_t)written->row * width; at < end; at++) {
        int32_t walls = written->merged.grid[at] & 255, open = written->merged.grid[at] >> 8;

        written->cells[at] = (uint8_t)(walls + open == 0 ? CAIRN_OCCUPANCY_GRID_UNKNOWN
                                       : walls >= open   ? CAIRN_OCCUPANCY_GRID_OCCUPIED
                                                         : CAIRN_OCCUPANCY_GRID_FREE);
    }
}

int cairn_map_merge_draw_merged(cairn_map_merge *merge, cairn_budget *budget)
{
    map_merge_written *w = merge->written;
    const cairn_raster_u8_view *cells = &w->merged.input.cells;

    CAIRN_STEP_BEGIN(merge->resume.part);
    begin_merged(merge);
    for (w->row = 0; w->row < cells->height; w->row++) {
        CAIRN_STEP_CHARGE(merge, resume.part, budget, 1 + cells->width / CELLS_PER_UNIT);
        clear_row(w);
    }
    for (w->neighbour = 0; w->neighbour < merge->neighbours.count; w->neighbour++)
        for (w->row = 0; w->row < cells->height; w->row++) {
            CAIRN_STEP_CHARGE(merge, resume.part, budget, 1 + cells->width / CELLS_PER_UNIT);
            vote_row(merge);
        }
    for (w->row = 0; w->row < cells->height; w->row++) {
        CAIRN_STEP_CHARGE(merge, resume.part, budget, 1 + cells->width / CELLS_PER_UNIT);
        count_row(w);
    }
    CAIRN_STEP_UNTIL(merge->resume.part, cairn_map_merge_pack(merge, &w->merged, budget));
    CAIRN_STEP_END(merge->resume.part);
}
