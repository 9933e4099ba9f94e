/* A map made ready: distances to walls and to free space, points of its surface with normals, lines
 * and corners.
 *
 * The surface is made of occupied cells beside free ones. A normal stands across the occupied
 * cells around, on their free side; lines grow from cell to neighbouring cell of the same
 * normal, so that the two faces of a thin wall stay two, and again beside their fit; corners are
 * those of the room `corner`. */
#include "src/core/build.h"

#include <string.h>

#include "cairn/line.h"
#include "src/mapping/map_merge_work.h"

/* Half sides in cells of the windows for normals and for the neighbours of a line's cell. */
enum { NORMAL_WINDOW = 3, LINE_WINDOW = 2, LINE_POINTS = 5 };

/* Cosine of the angle by which normals of a line differ at most. */
#define LINE_COSINE CAIRN_REAL(0.92)
/* Occupied cells lie along a line when their spreads differ by such a share of their sum. */
#define LONG CAIRN_REAL(0.5)
/* Cells: a line's points lie at most so far beside its first one, and off it in the mean square. */
#define LINE_WIDTH CAIRN_REAL(2.6)
#define LINE_RMS   CAIRN_REAL(0.9)
/* Cells from a point to its front. */
#define FRONT CAIRN_REAL(3.0)
/* Cells: points farther off a line are not fitted. */
#define TRIM CAIRN_REAL(0.8)
/* m: a longer straight wall counts only by the root of its length. */
#define WALL CAIRN_REAL(0.7)
/* m: shorter lines make no corner. */
#define LINE_LENGTH CAIRN_REAL(0.20)

static merge_map *current(cairn_map_merge *m)
{
    return &m->maps[m->map];
}

static int32_t width_of(const merge_map *map)
{
    return map->input.cells.width;
}

static int32_t height_of(const merge_map *map)
{
    return map->input.cells.height;
}

static cairn_status begin_distance(cairn_map_merge *m, const merge_map *map, uint8_t match)
{
    cairn_distance_map_input input;

    input.pixels = map->input.cells;
    input.distances.data = m->scratch;
    input.distances.width = width_of(map);
    input.distances.height = height_of(map);
    input.distances.stride = width_of(map);
    input.mask = 0xFF;
    input.match = match;
    input.metric = CAIRN_DISTANCE_L1;
    return cairn_distance_map_begin(m->distances, &input);
}

cairn_status cairn_merge_measure(cairn_map_merge *m, const merge_map *map, uint8_t match,
                                 int32_t *cursor, cairn_budget *budget)
{
    if (*cursor == 0) {
        cairn_status status = begin_distance(m, map, match);

        CAIRN_ASSERT(status == CAIRN_OK);
        (void)status;
        *cursor = 1;
    }
    return cairn_distance_map_step(m->distances, budget);
}

static uint16_t class_of(uint8_t value)
{
    return value == CAIRN_CELL_OCCUPIED ? MERGE_OCCUPIED
           : value == CAIRN_CELL_FREE   ? MERGE_FREE
                                        : MERGE_UNKNOWN;
}

cairn_status cairn_merge_pack(cairn_map_merge *m, merge_map *map, int32_t shift, int32_t *cursor,
                              cairn_budget *budget)
{
    int32_t count = width_of(map) * height_of(map);

    for (; *cursor < count; ++*cursor) {
        int32_t at = *cursor, d = m->scratch[at];
        uint16_t packed = (uint16_t)(d < MERGE_FAR ? d : MERGE_FAR);

        if (at % 16 == 0 && !cairn_budget_pay(budget, &m->paid, 1))
            return CAIRN_MORE;
        if (shift == 0) {
            int32_t x = at % width_of(map), y = at / width_of(map);
            uint16_t class = class_of(map->input.cells.data[y * map->input.cells.stride + x]);

            map->grid[at] = (uint16_t)(packed | class << 14);
            map->occupied += class == MERGE_OCCUPIED;
            map->free += class == MERGE_FREE;
        } else {
            map->grid[at] = (uint16_t)(map->grid[at] | packed << shift);
        }
    }
    return CAIRN_OK;
}

/* MERGE_UNKNOWN outside. */
static int32_t class_at(const merge_map *map, int32_t x, int32_t y)
{
    if (x < 0 || y < 0 || x >= width_of(map) || y >= height_of(map))
        return MERGE_UNKNOWN;
    return merge_class(map->grid[y * width_of(map) + x]);
}

static int is_surface(uint16_t cell)
{
    return merge_class(cell) == MERGE_OCCUPIED && merge_to_free(cell) == 1;
}

static cairn_vec2 centre_of_cell(const merge_map *map, int32_t cell)
{
    int32_t column = cell % width_of(map), row = cell / width_of(map);
    cairn_real x = (cairn_real)column + CAIRN_REAL(0.5), y = (cairn_real)row + CAIRN_REAL(0.5);
    cairn_vec2 p = {map->corner.x + x * map->input.resolution,
                    map->corner.y + y * map->input.resolution};

    return p;
}

/* 1 for `most` of `count` things, evenly, when there are more. */
static int is_chosen(int32_t index, int32_t count, int32_t most)
{
    return count <= most || count <= 0 ||
           (int64_t)(index + 1) * most / count > (int64_t)index * most / count;
}

/* Two passes over the cells: counted, then chosen. Free cells are chosen on the way. */
static cairn_status step_surface(cairn_map_merge *m, cairn_budget *budget)
{
    merge_map *map = current(m);
    int32_t count = width_of(map) * height_of(map);

    for (; m->cursor < 2 * count; m->cursor++) {
        int32_t cell = m->cursor < count ? m->cursor : m->cursor - count;

        if (m->cursor % 16 == 0 && !cairn_budget_pay(budget, &m->paid, 1))
            return CAIRN_MORE;
        if (m->cursor < count) {
            m->scratch[cell] = 0;
            m->surface += is_surface(map->grid[cell]);
        } else if (is_surface(map->grid[cell])) {
            if (is_chosen(m->seen_surface++, m->surface, m->params.max_points)) {
                merge_point p = {centre_of_cell(map, cell), {0, 0}, {0, 0}, 1, cell, 1};

                map->points[map->point_count++] = p;
                m->scratch[cell] = map->point_count;
            }
        } else if (merge_class(map->grid[cell]) == MERGE_FREE) {
            if (is_chosen(m->seen_free++, map->free, m->params.max_points / 2))
                map->open[map->open_count++] = centre_of_cell(map, cell);
        }
    }
    if (map->point_count > 0)
        map->spacing =
            map->input.resolution * (cairn_real)m->surface / (cairn_real)map->point_count;
    return CAIRN_OK;
}

/* Mean direction to the free cells around, near ones first. */
static cairn_vec2 free_side(const merge_map *map, int32_t x0, int32_t y0)
{
    cairn_vec2 sum = {0, 0};

    for (int32_t dy = -NORMAL_WINDOW; dy <= NORMAL_WINDOW; dy++)
        for (int32_t dx = -NORMAL_WINDOW; dx <= NORMAL_WINDOW; dx++) {
            cairn_real squared = (cairn_real)(dx * dx + dy * dy);

            if (class_at(map, x0 + dx, y0 + dy) != MERGE_FREE)
                continue;
            sum.x += (cairn_real)dx / (squared * squared);
            sum.y += (cairn_real)dy / (squared * squared);
        }
    return cairn_vec2_unit(sum);
}

/* Across the occupied cells around, when they lie along a line, on the side that is free. */
static cairn_vec2 normal_at(const merge_map *map, int32_t cell)
{
    int32_t x0 = cell % width_of(map), y0 = cell / width_of(map), n = 0, x = 0, y = 0, xx = 0,
            xy = 0, yy = 0;
    cairn_vec2 side = free_side(map, x0, y0), normal;
    cairn_real a, b, c, spread;

    for (int32_t dy = -NORMAL_WINDOW; dy <= NORMAL_WINDOW; dy++)
        for (int32_t dx = -NORMAL_WINDOW; dx <= NORMAL_WINDOW; dx++) {
            if (class_at(map, x0 + dx, y0 + dy) != MERGE_OCCUPIED)
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
    if (!(spread > LONG * (a + c)))
        return side;
    /* The axis of the greater spread, turned by a right angle; of its two forms the one that
     * does not cancel. */
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

static cairn_status step_normals(cairn_map_merge *m, cairn_budget *budget)
{
    merge_map *map = current(m);

    for (; m->cursor < map->point_count; m->cursor++) {
        merge_point *p = &map->points[m->cursor];

        if (!cairn_budget_pay(budget, &m->paid, 4))
            return CAIRN_MORE;
        p->normal = normal_at(map, p->cell);
        p->front =
            cairn_vec2_add(p->at, cairn_vec2_scale(p->normal, FRONT * map->input.resolution));
        m->label[m->cursor] = 0;
    }
    return CAIRN_OK;
}

/* Takes the neighbours of the queue's next point into the line. */
static void grow_line(cairn_map_merge *m)
{
    merge_map *map = current(m);
    const merge_point *p = &map->points[m->queue[m->inner++]];
    int32_t x0 = p->cell % width_of(map), y0 = p->cell / width_of(map);

    for (int32_t y = y0 - LINE_WINDOW; y <= y0 + LINE_WINDOW; y++)
        for (int32_t x = x0 - LINE_WINDOW; x <= x0 + LINE_WINDOW; x++) {
            const merge_point *q;
            int32_t index;

            if (x < 0 || y < 0 || x >= width_of(map) || y >= height_of(map))
                continue;
            index = m->scratch[y * width_of(map) + x] - 1;
            if (index < 0 || m->label[index] != 0)
                continue;
            q = &map->points[index];
            if (cairn_vec2_dot(q->normal, m->line_normal) < LINE_COSINE ||
                cairn_abs(cairn_vec2_dot(cairn_vec2_sub(q->at, m->line_at), m->line_normal)) >
                    LINE_WIDTH * map->input.resolution)
                continue;
            m->label[index] = 1;
            m->queue[m->queued++] = index;
        }
}

/* The line through the points in the queue, and again through those that lie well on it: ends of
 * walls have normals of both sides. */
static int fit_line(cairn_map_merge *m, cairn_line *line)
{
    const merge_map *map = current(m);
    int32_t kept = 0;

    for (int32_t i = 0; i < m->queued; i++)
        m->line[i] = map->points[m->queue[i]].at;
    if (cairn_line_fit(m->line, NULL, m->queued, line) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < m->queued; i++)
        if (cairn_abs(cairn_vec2_cross(line->direction, cairn_vec2_sub(m->line[i], line->mean))) <=
            TRIM * map->input.resolution)
            m->line[kept++] = m->line[i];
    return kept >= LINE_POINTS && cairn_line_fit(m->line, NULL, kept, line) == CAIRN_OK;
}

/* The points in the queue become a segment with the free side on its left, when they lie on a
 * line that is long enough. */
static void end_line(cairn_map_merge *m, int32_t seed)
{
    merge_map *map = current(m);
    cairn_segment segment;
    cairn_line line;

    if (m->queued < LINE_POINTS || map->line_count == m->params.max_segments)
        return;
    if (!fit_line(m, &line) || line.high - line.low < LINE_LENGTH ||
        line.rms > LINE_RMS * map->input.resolution)
        return;
    segment = cairn_line_segment(&line);
    for (int32_t i = 0; i < m->queued; i++) {
        merge_point *p = &map->points[m->queue[i]];

        p->weight = 1 / cairn_sqrt(cairn_max(1, (line.high - line.low) / WALL));
        p->bent &= line.high - line.low < MERGE_LINE_M;
    }
    if (cairn_vec2_dot(cairn_vec2_left(line.direction), map->points[seed].normal) < 0) {
        cairn_vec2 a = segment.a;

        segment.a = segment.b;
        segment.b = a;
    }
    map->lines[map->line_count] = segment;
    {
        cairn_vec2 along = cairn_vec2_sub(segment.b, segment.a);
        merge_way way = {cairn_atan2(along.y, along.x), cairn_vec2_norm(along)};

        map->ways[map->line_count++] = way;
    }
}

static void begin_line(cairn_map_merge *m, int32_t seed)
{
    const merge_point *first = &current(m)->points[seed];

    m->label[seed] = 1;
    m->queue[0] = seed;
    m->queued = 1;
    m->fitted = LINE_POINTS;
    m->inner = 0;
    m->line_at = first->at;
    m->line_normal = first->normal;
}

/* A line that has grown by half since it was fitted is fitted again and may go on growing beside
 * the fit: the normal of its first point alone leads astray after a metre. 1 when it goes on. */
static int refit_line(cairn_map_merge *m)
{
    cairn_line line;
    cairn_vec2 normal;

    if (m->queued < m->fitted + m->fitted / 2 || !fit_line(m, &line))
        return 0;
    normal = cairn_vec2_left(line.direction);
    m->fitted = m->queued;
    m->inner = 0;
    m->line_at = line.mean;
    m->line_normal =
        cairn_vec2_dot(normal, m->line_normal) < 0 ? cairn_vec2_scale(normal, -1) : normal;
    return 1;
}

static cairn_status step_segments(cairn_map_merge *m, cairn_budget *budget)
{
    merge_map *map = current(m);

    while (m->cursor < map->point_count) {
        if (m->queued == 0) {
            if (m->label[m->cursor] != 0 ||
                cairn_vec2_norm_squared(map->points[m->cursor].normal) < CAIRN_REAL(0.5)) {
                if (!cairn_budget_pay(budget, &m->paid, 1))
                    return CAIRN_MORE;
                m->cursor++;
                continue;
            }
            begin_line(m, m->cursor);
        }
        for (; m->inner < m->queued;) {
            if (!cairn_budget_pay(budget, &m->paid, 2))
                return CAIRN_MORE;
            grow_line(m);
        }
        if (!cairn_budget_pay(budget, &m->paid, 1 + m->queued / 4))
            return CAIRN_MORE;
        if (refit_line(m))
            continue;
        end_line(m, m->cursor);
        m->queued = 0;
        m->cursor++;
    }
    return CAIRN_OK;
}

static cairn_status step_corners(cairn_map_merge *m, cairn_budget *budget)
{
    merge_map *map = current(m);
    cairn_status status;
    const cairn_corner *list;

    if (m->cursor == 0) {
        status = cairn_corner_begin(m->corners, map->lines, map->line_count);
        CAIRN_ASSERT(status == CAIRN_OK);
        m->cursor = 1;
    }
    status = cairn_corner_step(m->corners, budget);
    if (status != CAIRN_OK)
        return status;
    list = cairn_corner_list(m->corners, &map->corner_count);
    memcpy(map->corners, list, (size_t)map->corner_count * sizeof *list);
    return CAIRN_OK;
}

/* A step through `count` things that comes to all of them and is about 0.618 of a round. */
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

/* Puts the points and the free cells into an order any beginning of which is an even choice;
 * m->line and m->queue hold what is moved. */
static void shuffle(cairn_map_merge *m)
{
    merge_map *map = current(m);
    int32_t n = map->point_count, step = golden_step(n > 0 ? n : 1), at = 0;
    merge_point *from = m->shuffled;

    memcpy(from, map->points, (size_t)n * sizeof *from);
    for (int32_t i = 0; i < n; i++, at = (at + step) % n)
        map->points[i] = from[at];
    n = map->open_count;
    step = golden_step(n > 0 ? n : 1);
    at = 0;
    memcpy(m->line, map->open, (size_t)n * sizeof *m->line);
    for (int32_t i = 0; i < n; i++, at = (at + step) % n)
        map->open[i] = m->line[at];
}

static void begin_phase(cairn_map_merge *m, merge_phase phase)
{
    merge_map *map = current(m);

    m->phase = phase;
    m->cursor = 0;
    m->inner = 0;
    if (phase == MERGE_SURFACE) {
        m->surface = m->seen_surface = m->seen_free = 0;
        map->point_count = map->open_count = 0;
    } else if (phase == MERGE_SEGMENTS) {
        map->line_count = 0;
        m->queued = 0;
    } else if (phase == MERGE_BENT) {
        map->bend_count = 0;
        map->bent = 0;
    }
}

static cairn_status step_phase(cairn_map_merge *m, cairn_budget *budget)
{
    switch (m->phase) {
    case MERGE_OCCUPIED_DISTANCE:
        return cairn_merge_measure(m, current(m), CAIRN_CELL_OCCUPIED, &m->cursor, budget);
    case MERGE_OCCUPIED_PACK:
        return cairn_merge_pack(m, current(m), 0, &m->cursor, budget);
    case MERGE_FREE_DISTANCE:
        return cairn_merge_measure(m, current(m), CAIRN_CELL_FREE, &m->cursor, budget);
    case MERGE_FREE_PACK:
        return cairn_merge_pack(m, current(m), 7, &m->cursor, budget);
    case MERGE_SURFACE:
        return step_surface(m, budget);
    case MERGE_NORMALS:
        return step_normals(m, budget);
    case MERGE_SEGMENTS:
        return step_segments(m, budget);
    case MERGE_CORNERS:
        return step_corners(m, budget);
    case MERGE_BENT:
        return cairn_merge_choose_bends(m, current(m), budget);
    default:
        if (!cairn_budget_pay(budget, &m->paid,
                              1 + (current(m)->point_count + current(m)->open_count) / 8))
            return CAIRN_MORE;
        shuffle(m);
        return CAIRN_OK;
    }
}

cairn_status cairn_merge_prepare(cairn_map_merge *m, cairn_budget *budget)
{
    while (m->map < m->map_count) {
        cairn_status status;

        if (m->phase == MERGE_OCCUPIED_DISTANCE && m->cursor == 0)
            current(m)->occupied = current(m)->free = 0;
        status = step_phase(m, budget);
        if (status != CAIRN_OK)
            return status;
        if (m->phase < MERGE_BENT) {
            begin_phase(m, m->phase + 1);
        } else {
            m->map++;
            m->phase = MERGE_OCCUPIED_DISTANCE;
            m->cursor = 0;
        }
    }
    return CAIRN_OK;
}
