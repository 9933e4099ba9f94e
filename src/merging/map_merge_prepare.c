/* Preparation of a map: distance maps to walls and to free space, surface points with normals,
 * lines and corners.
 *
 * Method.
 *
 * 1. Distance maps to occupied and to free cells are computed and packed.
 * 2. The surface consists of occupied cells next to free ones, sampled evenly. A normal is the
 *    minor axis of the occupied cells around, on their free side.
 * 3. Lines grow from cell to neighbouring cell of the same normal (region growing), so the two
 *    faces of a thin wall stay separate. They are refitted while growing.
 * 4. Corners are intersections of lines (module corner).
 * 5. Points and free cells are shuffled so that every prefix is an evenly spread sample. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/line.h"
#include "src/merging/map_merge_work.h"

/* cells: half sides of the windows for normals and for the neighbours of a line's cell; minimum
 * points of a line */
enum { NORMAL_WINDOW = 3, LINE_WINDOW = 2, MIN_LINE_POINTS = 5 };

/* Per unit: cells that are packed or sampled, points that are fitted, corners that are copied, items
 * that are shuffled. */
enum { CELLS_PER_UNIT = 16, FITTED_PER_UNIT = 4, CORNERS_PER_UNIT = 8, SHUFFLED_PER_UNIT = 8 };
/* Units of a normal, and of the neighbours of a point on a line. */
enum { UNITS_PER_NORMAL = 4, UNITS_PER_LINE_POINT = 2 };

/* minimum cosine between normals of a line */
#define LINE_MIN_COSINE CAIRN_REAL(0.92)
/* minimum ratio of the difference to the sum of the principal spreads of cells along a line */
#define MIN_ELONGATION CAIRN_REAL(0.5)
/* cells: maximum distance of a line's points from its first one, and their root mean square
 * residual */
#define LINE_WIDTH_CELLS CAIRN_REAL(2.6)
#define LINE_RMS_CELLS   CAIRN_REAL(0.9)
/* cells from a point to its free-space sample */
#define FRONT_CELLS CAIRN_REAL(3.0)
/* cells: points farther off a line are not fitted */
#define TRIM_CELLS CAIRN_REAL(0.8)
/* m: the weight of a longer straight wall grows only by the root of its length */
#define SATURATED_WALL_M CAIRN_REAL(0.7)
/* m: minimum length of a line that forms corners */
#define MIN_LINE_M CAIRN_REAL(0.20)

static map_merge_map *current(cairn_map_merge *merge)
{
    return &merge->maps[merge->prepared.map];
}

static int32_t width_of(const map_merge_map *map)
{
    return map->input.cells.width;
}

static int32_t height_of(const map_merge_map *map)
{
    return map->input.cells.height;
}

static int32_t cells_of(const map_merge_map *map)
{
    return width_of(map) * height_of(map);
}

/* ---- Distances ---- */

static void begin_distance(cairn_map_merge *merge, const map_merge_map *map, uint8_t match)
{
    const cairn_distance_map_input input = {
        .pixels = map->input.cells,
        .distances = {merge->prepared.scratch, width_of(map), height_of(map), width_of(map)},
        .mask = 0xFF,
        .match = match,
        .metric = CAIRN_DISTANCE_MAP_L1,
    };

    cairn_must_be_ok(cairn_distance_map_begin(merge->prepared.distances, &input));
}

static uint16_t class_of(uint8_t value)
{
    return value == CAIRN_OCCUPANCY_GRID_OCCUPIED ? MAP_MERGE_OCCUPIED
           : value == CAIRN_OCCUPANCY_GRID_FREE   ? MAP_MERGE_FREE
                                                  : MAP_MERGE_UNKNOWN;
}

/* Returns the distance of a cell, as it is packed. */
static uint16_t distance_of(const cairn_map_merge *merge, int32_t cell)
{
    int32_t d = merge->prepared.scratch[cell];

    return (uint16_t)(d < MAP_MERGE_MAX_DISTANCE ? d : MAP_MERGE_MAX_DISTANCE);
}

/* Returns the end of the cells of a unit. */
static int32_t end_of_unit(const cairn_map_merge *merge, const map_merge_map *map)
{
    int32_t end = merge->prepared.cell + CELLS_PER_UNIT;

    return end < cells_of(map) ? end : cells_of(map);
}

/* Packs the next cells' distances to occupied ones and their classes. */
static void pack_classes(cairn_map_merge *merge, map_merge_map *map)
{
    int32_t end = end_of_unit(merge, map);

    for (int32_t at = merge->prepared.cell; at < end; at++) {
        int32_t x = at % width_of(map), y = at / width_of(map);
        uint16_t class = class_of(map->input.cells.data[y * map->input.cells.stride + x]);

        map->grid[at] = (uint16_t)(distance_of(merge, at) | class << 14);
        map->occupied_count += class == MAP_MERGE_OCCUPIED;
        map->free_count += class == MAP_MERGE_FREE;
    }
}

/* Packs the next cells' distances to free ones. */
static void pack_free_distances(cairn_map_merge *merge, map_merge_map *map)
{
    int32_t end = end_of_unit(merge, map);

    for (int32_t at = merge->prepared.cell; at < end; at++)
        map->grid[at] = (uint16_t)(map->grid[at] | distance_of(merge, at) << 7);
}

int cairn_map_merge_pack(cairn_map_merge *merge, map_merge_map *map, cairn_budget *budget)
{
    map_merge_preparation *prepared = &merge->prepared;

    CAIRN_STEP_BEGIN(merge->resume.pack);
    map->occupied_count = map->free_count = 0;
    begin_distance(merge, map, CAIRN_OCCUPANCY_GRID_OCCUPIED);
    CAIRN_STEP_UNTIL(merge->resume.pack,
                     cairn_distance_map_step(prepared->distances, budget) == CAIRN_OK);
    for (prepared->cell = 0; prepared->cell < cells_of(map); prepared->cell += CELLS_PER_UNIT) {
        CAIRN_STEP_CHARGE_UNIT(merge, resume.pack, budget);
        pack_classes(merge, map);
    }
    begin_distance(merge, map, CAIRN_OCCUPANCY_GRID_FREE);
    CAIRN_STEP_UNTIL(merge->resume.pack,
                     cairn_distance_map_step(prepared->distances, budget) == CAIRN_OK);
    for (prepared->cell = 0; prepared->cell < cells_of(map); prepared->cell += CELLS_PER_UNIT) {
        CAIRN_STEP_CHARGE_UNIT(merge, resume.pack, budget);
        pack_free_distances(merge, map);
    }
    CAIRN_STEP_END(merge->resume.pack);
}

/* ---- Surface ---- */

/* Returns the class of a cell; MAP_MERGE_UNKNOWN outside. */
static int32_t class_at(const map_merge_map *map, int32_t x, int32_t y)
{
    if (x < 0 || y < 0 || x >= width_of(map) || y >= height_of(map))
        return MAP_MERGE_UNKNOWN;
    return map_merge_class(map->grid[y * width_of(map) + x]);
}

static int is_surface(uint16_t cell)
{
    return map_merge_class(cell) == MAP_MERGE_OCCUPIED && map_merge_to_free(cell) == 1;
}

static cairn_vec2 centre_of_cell(const map_merge_map *map, int32_t cell)
{
    int32_t column = cell % width_of(map), row = cell / width_of(map);
    cairn_real x = (cairn_real)column + CAIRN_REAL(0.5), y = (cairn_real)row + CAIRN_REAL(0.5);
    cairn_vec2 p = {map->corner.x + x * map->input.resolution,
                    map->corner.y + y * map->input.resolution};

    return p;
}

/* Returns 1 for `most` of `count` items, evenly spread, when there are more. */
static int is_chosen(int32_t index, int32_t count, int32_t most)
{
    return count <= most || count <= 0 ||
           (int64_t)(index + 1) * most / count > (int64_t)index * most / count;
}

static void begin_surface(cairn_map_merge *merge)
{
    map_merge_map *map = current(merge);

    merge->prepared.surface = merge->prepared.seen_surface = merge->prepared.seen_free = 0;
    map->point_count = map->free_cell_count = 0;
}

static void count_surface(cairn_map_merge *merge, int32_t cell)
{
    merge->prepared.scratch[cell] = 0;
    merge->prepared.surface += is_surface(current(merge)->grid[cell]);
}

/* Samples a cell of the surface, or a free one. */
static void sample_cell(cairn_map_merge *merge, int32_t cell)
{
    map_merge_preparation *prepared = &merge->prepared;
    map_merge_map *map = current(merge);

    if (is_surface(map->grid[cell])) {
        if (is_chosen(prepared->seen_surface++, prepared->surface, merge->params.max_points)) {
            map_merge_point p = {centre_of_cell(map, cell), {0, 0}, {0, 0}, 1, cell, 1};

            map->points[map->point_count++] = p;
            prepared->scratch[cell] = map->point_count;
        }
    } else if (map_merge_class(map->grid[cell]) == MAP_MERGE_FREE) {
        if (is_chosen(prepared->seen_free++, map->free_count, merge->params.max_points / 2))
            map->free_cells[map->free_cell_count++] = centre_of_cell(map, cell);
    }
}

static void end_surface(cairn_map_merge *merge)
{
    map_merge_map *map = current(merge);

    if (map->point_count > 0)
        map->spacing = map->input.resolution * (cairn_real)merge->prepared.surface /
                       (cairn_real)map->point_count;
}

/* Step: counts the cells of the surface, then samples them and the free cells. The units of both
 * passes are counted through. */
static int find_surface(cairn_map_merge *merge, cairn_budget *budget)
{
    map_merge_preparation *prepared = &merge->prepared;
    int32_t count = cells_of(current(merge));

    CAIRN_STEP_BEGIN(merge->resume.phase);
    begin_surface(merge);
    for (prepared->cell = 0; prepared->cell < count; prepared->cell++) {
        CAIRN_STEP_CHARGE_EVERY(merge, resume.phase, budget, CELLS_PER_UNIT, prepared->cell);
        count_surface(merge, prepared->cell);
    }
    for (prepared->cell = 0; prepared->cell < count; prepared->cell++) {
        CAIRN_STEP_CHARGE_EVERY(merge, resume.phase, budget, CELLS_PER_UNIT,
                                count + prepared->cell);
        sample_cell(merge, prepared->cell);
    }
    end_surface(merge);
    CAIRN_STEP_END(merge->resume.phase);
}

/* ---- Normals ---- */

/* Returns the mean direction to the free cells around, weighted by proximity. */
static cairn_vec2 free_side(const map_merge_map *map, int32_t x0, int32_t y0)
{
    cairn_vec2 sum = {0, 0};

    for (int32_t dy = -NORMAL_WINDOW; dy <= NORMAL_WINDOW; dy++)
        for (int32_t dx = -NORMAL_WINDOW; dx <= NORMAL_WINDOW; dx++) {
            cairn_real squared = (cairn_real)(dx * dx + dy * dy);

            if (class_at(map, x0 + dx, y0 + dy) != MAP_MERGE_FREE)
                continue;
            sum.x += (cairn_real)dx / (squared * squared);
            sum.y += (cairn_real)dy / (squared * squared);
        }
    return cairn_vec2_unit(sum);
}

/* Returns the normal: the minor axis of the occupied cells around when they are elongated, on the
 * free side. */
static cairn_vec2 normal_at(const map_merge_map *map, int32_t cell)
{
    int32_t x0 = cell % width_of(map), y0 = cell / width_of(map), n = 0, x = 0, y = 0, xx = 0,
            xy = 0, yy = 0;
    cairn_vec2 side = free_side(map, x0, y0), normal;
    cairn_real a, b, c, spread;

    for (int32_t dy = -NORMAL_WINDOW; dy <= NORMAL_WINDOW; dy++)
        for (int32_t dx = -NORMAL_WINDOW; dx <= NORMAL_WINDOW; dx++) {
            if (class_at(map, x0 + dx, y0 + dy) != MAP_MERGE_OCCUPIED)
                continue;
            n++;
            x += dx;
            y += dy;
            xx += dx * dx;
            xy += dx * dy;
            yy += dy * dy;
        }
    a = (cairn_real)(n * xx - x * x);
    b = (cairn_real)(n * xy - x * y);
    c = (cairn_real)(n * yy - y * y);
    spread = cairn_sqrt((a - c) * (a - c) + 4 * b * b);
    if (!(spread > MIN_ELONGATION * (a + c)))
        return side;
    /* The major axis, rotated by a right angle; of its two forms the one without cancellation. */
    if (a >= c) {
        normal.x = -2 * b;
        normal.y = a - c + spread;
    } else {
        normal.x = -(c - a + spread);
        normal.y = 2 * b;
    }
    normal = cairn_vec2_unit(normal);
    return cairn_vec2_dot(normal, side) < 0 ? cairn_vec2_scale(normal, -1) : normal;
}

static void set_normal(const map_merge_map *map, map_merge_point *p)
{
    p->normal = normal_at(map, p->cell);
    p->free_side = cairn_vec2_add(p->position,
                                  cairn_vec2_scale(p->normal, FRONT_CELLS * map->input.resolution));
}

/* Step: computes the normals of all points. */
static int find_normals(cairn_map_merge *merge, cairn_budget *budget)
{
    map_merge_preparation *prepared = &merge->prepared;

    CAIRN_STEP_BEGIN(merge->resume.phase);
    for (prepared->point = 0; prepared->point < current(merge)->point_count; prepared->point++) {
        CAIRN_STEP_CHARGE(merge, resume.phase, budget, UNITS_PER_NORMAL);
        set_normal(current(merge), &current(merge)->points[prepared->point]);
        prepared->label[prepared->point] = 0;
    }
    CAIRN_STEP_END(merge->resume.phase);
}

/* ---- Lines ---- */

/* Adds the matching neighbours of the queue's next point to the line. */
static void grow_line(cairn_map_merge *merge)
{
    map_merge_map *map = current(merge);
    const map_merge_point *p = &map->points[merge->prepared.queue[merge->prepared.grown++]];
    int32_t x0 = p->cell % width_of(map), y0 = p->cell / width_of(map);

    for (int32_t y = y0 - LINE_WINDOW; y <= y0 + LINE_WINDOW; y++)
        for (int32_t x = x0 - LINE_WINDOW; x <= x0 + LINE_WINDOW; x++) {
            const map_merge_point *q;
            int32_t index;

            if (x < 0 || y < 0 || x >= width_of(map) || y >= height_of(map))
                continue;
            index = merge->prepared.scratch[y * width_of(map) + x] - 1;
            if (index < 0 || merge->prepared.label[index] != 0)
                continue;
            q = &map->points[index];
            if (cairn_vec2_dot(q->normal, merge->prepared.line_normal) < LINE_MIN_COSINE ||
                cairn_abs(cairn_vec2_dot(cairn_vec2_sub(q->position, merge->prepared.line_at),
                                         merge->prepared.line_normal)) >
                    LINE_WIDTH_CELLS * map->input.resolution)
                continue;
            merge->prepared.label[index] = 1;
            merge->prepared.queue[merge->prepared.queued++] = index;
        }
}

/* Fits a line to the points in the queue, then again to the inliers: ends of walls have normals of
 * both sides. */
static int fit_line(cairn_map_merge *merge, cairn_line *line)
{
    const map_merge_map *map = current(merge);
    int32_t kept = 0;

    for (int32_t i = 0; i < merge->prepared.queued; i++)
        merge->prepared.line[i] = map->points[merge->prepared.queue[i]].position;
    if (cairn_line_fit(merge->prepared.line, NULL, merge->prepared.queued, line) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < merge->prepared.queued; i++)
        if (cairn_abs(cairn_vec2_cross(line->direction,
                                       cairn_vec2_sub(merge->prepared.line[i], line->mean))) <=
            TRIM_CELLS * map->input.resolution)
            merge->prepared.line[kept++] = merge->prepared.line[i];
    return kept >= MIN_LINE_POINTS &&
           cairn_line_fit(merge->prepared.line, NULL, kept, line) == CAIRN_OK;
}

/* Converts the points in the queue into a segment with the free side on its left, when they lie on
 * a line of sufficient length. */
static void end_line(cairn_map_merge *merge)
{
    map_merge_map *map = current(merge);
    cairn_vec2 normal = map->points[merge->prepared.point].normal;
    cairn_segment segment;
    cairn_line line;

    if (merge->prepared.queued < MIN_LINE_POINTS || map->line_count == merge->params.max_segments)
        return;
    if (!fit_line(merge, &line) || line.high - line.low < MIN_LINE_M ||
        line.rms > LINE_RMS_CELLS * map->input.resolution)
        return;
    segment = cairn_line_segment(&line);
    for (int32_t i = 0; i < merge->prepared.queued; i++) {
        map_merge_point *p = &map->points[merge->prepared.queue[i]];

        p->weight = 1 / cairn_sqrt(cairn_max(1, (line.high - line.low) / SATURATED_WALL_M));
        p->is_curved &= line.high - line.low < MAP_MERGE_MIN_LINE_M;
    }
    if (cairn_vec2_dot(cairn_vec2_left_perp(line.direction), normal) < 0) {
        cairn_vec2 a = segment.a;

        segment.a = segment.b;
        segment.b = a;
    }
    map->lines[map->line_count] = segment;
    {
        cairn_vec2 along = cairn_vec2_sub(segment.b, segment.a);
        map_merge_direction way = {cairn_atan2(along.y, along.x), cairn_vec2_norm(along)};

        map->directions[map->line_count++] = way;
    }
}

/* Returns 1 when a line can grow from the current point: it is on none, and has a normal. */
static int is_seed(const cairn_map_merge *merge)
{
    const map_merge_preparation *prepared = &merge->prepared;
    const map_merge_point *p = &merge->maps[prepared->map].points[prepared->point];

    return prepared->label[prepared->point] == 0 &&
           cairn_vec2_norm_squared(p->normal) >= CAIRN_REAL(0.5);
}

static void begin_line(cairn_map_merge *merge)
{
    map_merge_preparation *prepared = &merge->prepared;
    const map_merge_point *first = &current(merge)->points[prepared->point];

    prepared->label[prepared->point] = 1;
    prepared->queue[0] = prepared->point;
    prepared->queued = 1;
    prepared->grown = 0;
    prepared->fitted = MIN_LINE_POINTS;
    prepared->line_at = first->position;
    prepared->line_normal = first->normal;
}

/* Refits a line that has grown by half since its last fit and resumes growing: the normal of the
 * first point alone is too inaccurate after a metre. Returns 1 when it grows on. */
static int refit_line(cairn_map_merge *merge)
{
    cairn_line line;
    cairn_vec2 normal;

    if (merge->prepared.queued < merge->prepared.fitted + merge->prepared.fitted / 2 ||
        !fit_line(merge, &line))
        return 0;
    normal = cairn_vec2_left_perp(line.direction);
    merge->prepared.fitted = merge->prepared.queued;
    merge->prepared.grown = 0;
    merge->prepared.line_at = line.mean;
    merge->prepared.line_normal = cairn_vec2_dot(normal, merge->prepared.line_normal) < 0
                                      ? cairn_vec2_scale(normal, -1)
                                      : normal;
    return 1;
}

/* Step: grows lines from all points that are on none. */
static int find_lines(cairn_map_merge *merge, cairn_budget *budget)
{
    map_merge_preparation *prepared = &merge->prepared;

    CAIRN_STEP_BEGIN(merge->resume.phase);
    current(merge)->line_count = 0;
    for (prepared->point = 0; prepared->point < current(merge)->point_count; prepared->point++) {
        if (!is_seed(merge)) {
            CAIRN_STEP_CHARGE_UNIT(merge, resume.phase, budget);
            continue;
        }
        begin_line(merge);
        do {
            while (prepared->grown < prepared->queued) {
                CAIRN_STEP_CHARGE(merge, resume.phase, budget, UNITS_PER_LINE_POINT);
                grow_line(merge);
            }
            CAIRN_STEP_CHARGE(merge, resume.phase, budget, 1 + prepared->queued / FITTED_PER_UNIT);
        } while (refit_line(merge));
        end_line(merge);
    }
    CAIRN_STEP_END(merge->resume.phase);
}

/* ---- Corners, order of the points ---- */

static void begin_corners(cairn_map_merge *merge)
{
    const map_merge_map *map = current(merge);

    cairn_must_be_ok(cairn_corner_begin(merge->prepared.corners, map->lines, map->line_count));
}

/* Returns the units of copying the corners. */
static int32_t copy_units(const cairn_map_merge *merge)
{
    int32_t count;

    (void)cairn_corner_list(merge->prepared.corners, &count);
    return 1 + count / CORNERS_PER_UNIT;
}

static void copy_corners(cairn_map_merge *merge)
{
    map_merge_map *map = current(merge);
    const cairn_corner *list = cairn_corner_list(merge->prepared.corners, &map->corner_count);

    memcpy(map->corners, list, (size_t)map->corner_count * sizeof *list);
}

/* Returns a step coprime to `count` of about 0.618 count: a golden-ratio sequence that visits all
 * items. */
static int32_t golden_step(int32_t count)
{
    int32_t step = cairn_real_to_int((cairn_real)count * CAIRN_REAL(0.6180339887));

    for (step = step > 0 ? step : 1;; step++) {
        int32_t a = count, b = step;

        while (b != 0) {
            int32_t rest = a % b;

            a = b;
            b = rest;
        }
        if (a == 1)
            return step;
    }
}

/* Shuffles the points and the free cells so that every prefix is an evenly spread sample;
 * merge->prepared.line and merge->prepared.queue are buffers. */
static void shuffle(cairn_map_merge *merge)
{
    map_merge_map *map = current(merge);
    int32_t n = map->point_count, step = golden_step(n > 0 ? n : 1), at = 0;
    map_merge_point *from = merge->prepared.shuffled;

    memcpy(from, map->points, (size_t)n * sizeof *from);
    for (int32_t i = 0; i < n; i++, at = (at + step) % n)
        map->points[i] = from[at];
    n = map->free_cell_count;
    step = golden_step(n > 0 ? n : 1);
    at = 0;
    memcpy(merge->prepared.line, map->free_cells, (size_t)n * sizeof *merge->prepared.line);
    for (int32_t i = 0; i < n; i++, at = (at + step) % n)
        map->free_cells[i] = merge->prepared.line[at];
}

/* Returns the units of shuffling the points and the free cells. */
static int32_t shuffle_units(const map_merge_map *map)
{
    return 1 + (map->point_count + map->free_cell_count) / SHUFFLED_PER_UNIT;
}

int cairn_map_merge_prepare(cairn_map_merge *merge, cairn_budget *budget)
{
    map_merge_preparation *prepared = &merge->prepared;

    CAIRN_STEP_BEGIN(merge->resume.stage);
    for (prepared->map = 0; prepared->map < merge->map_count; prepared->map++) {
        CAIRN_STEP_UNTIL(merge->resume.stage, cairn_map_merge_pack(merge, current(merge), budget));
        CAIRN_STEP_RUN(merge, resume.stage, budget, find_surface);
        CAIRN_STEP_RUN(merge, resume.stage, budget, find_normals);
        CAIRN_STEP_RUN(merge, resume.stage, budget, find_lines);
        begin_corners(merge);
        CAIRN_STEP_UNTIL(merge->resume.stage,
                         cairn_corner_step(prepared->corners, budget) == CAIRN_OK);
        CAIRN_STEP_CHARGE(merge, resume.stage, budget, copy_units(merge));
        copy_corners(merge);
        CAIRN_STEP_CHARGE(merge, resume.stage, budget, shuffle_units(current(merge)));
        shuffle(merge);
        CAIRN_STEP_RUN(merge, resume.stage, budget, cairn_map_merge_select_curve_points);
    }
    CAIRN_STEP_END(merge->resume.stage);
}
