/* Straight segments of edge chains: polyline approximation, cuts and virtual segments.
 *
 * Method:
 * 1. Polylines (Ramer-Douglas-Peucker): a chain is split at the pixel farthest from the chord until
 *    no pixel is farther than the tolerance, with a stack of pending right ends.
 * 2. Line fitting: orthogonal regression (total least squares) of a piece's pixels. Its ends are
 *    the projections of the first and the last pixel.
 * 3. Indexing: all ends are inserted into a hash grid.
 * 4. Cuts: each line is processed in windows of 64 px. Nearby ends set the bits of the pixels that
 *    they project to. The bits become cuts from one end to the other, unless a piece would be too
 *    short.
 * 5. Virtual segments: added where the lines of two nearby ends intersect near both.
 *
 * Memory layout: lines, segments, the stack, the grid over the ends (2 i and 2 i + 1 belong to line
 * i).
 *
 * Limits: cuts are at whole pixels from the start of their line.
 *
 * Source: Adluru 2008, section 2; polylines: Ramer 1972. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/edge_segment.h"

enum {
    MAX_LINES = 1 << 26,
    MAX_SEGMENTS = 1 << 28,
    PIXELS_PER_UNIT = 4,
    CELLS_PER_UNIT = 4,
    WINDOW_PX = 64
};

/* Side of a grid cell; least look-ahead and mean length, px. */
#define GRID_CELL_PX  CAIRN_REAL(16.0)
#define MIN_LENGTH_PX CAIRN_REAL(5.0)

typedef int32_t edge_segment_phase;
enum { PHASE_IDLE, PHASE_SPLIT, PHASE_FIT, PHASE_INDEX, PHASE_CUT, PHASE_JOIN, PHASE_DONE };

/* A polyline segment: the piece of a chain from position `low` to position `high`, counted from the
 * chain's first pixel. In a closed chain `high` may be the number of pixels, which is the first
 * pixel again. */
typedef struct edge_line {
    cairn_segment line;
    int32_t chain, low, high;
    int32_t first, last; /* range of its segments */
} edge_line;

/* Moments of pixel coordinates relative to the first pixel, exact in integers. */
typedef struct moments {
    int64_t x, y, xx, xy, yy;
} moments;

struct cairn_edge_segment_set {
    cairn_edge_segment_params params;
    cairn_real cos_turn;
    /* [max_lines] */
    edge_line *lines;
    /* [max_segments] */
    cairn_edge_segment *segments;
    /* [max_lines] stack of pending right ends */
    int32_t *pending;
    cairn_point_grid *grid;
    cairn_edge_chain_result chains;
    int32_t line_count, segment_count, virtual_count;
    /* px, px^2: sums over lengths of lines, then sum over lengths of segments */
    cairn_real length_sum, squared_length_sum;
    cairn_real look_ahead, mean_length;
    edge_segment_phase phase;
    /* PHASE_SPLIT: chain index */
    int32_t chain;
    /* PHASE_SPLIT: positions in the chain */
    int32_t low, high, position, farthest;
    int32_t pending_count;
    /* px^2, PHASE_SPLIT: squared distance of the farthest pixel */
    cairn_real distance_squared;
    /* PHASE_FIT */
    moments sums;
    /* PHASE_FIT, PHASE_INDEX, PHASE_CUT: line; PHASE_JOIN: end */
    int32_t cursor;
    /* PHASE_FIT: the line at the cursor is begun; PHASE_INDEX: the grid is empty */
    int32_t is_started;
    /* px, PHASE_CUT: start of the window from the start of the line */
    int32_t window;
    /* PHASE_CUT: bit k: a cut at window + k */
    uint64_t cuts;
    /* px, PHASE_CUT: position of the last cut */
    cairn_real last_cut;
    /* PHASE_CUT: 1 while ends are searched, 2 while cuts are made; PHASE_JOIN: 1 */
    int32_t search_state;
    cairn_point_grid_cursor search;
    int32_t units_charged;
};

cairn_edge_segment_params cairn_edge_segment_default(void)
{
    cairn_edge_segment_params params = {
        .max_lines = 10000,
        .max_segments = 40000,
        .tolerance = CAIRN_REAL(1.5),
        .min_piece = 4,
        .look_ahead = 0,
        .junction_distance = 6,
        .min_junction_angle = 20 * (CAIRN_PI / 180),
    };
    return params;
}

static int params_are_valid(const cairn_edge_segment_params *params)
{
    return params != NULL && params->max_lines >= 1 && params->max_lines <= MAX_LINES &&
           params->max_segments >= 1 && params->max_segments <= MAX_SEGMENTS &&
           params->tolerance > 0 && cairn_is_finite(params->tolerance) && params->min_piece >= 2 &&
           cairn_is_finite(params->min_piece) && params->look_ahead >= 0 &&
           cairn_is_finite(params->look_ahead) && params->junction_distance >= 0 &&
           cairn_is_finite(params->junction_distance) && params->min_junction_angle >= 0 &&
           params->min_junction_angle <= CAIRN_PI;
}

static cairn_point_grid *carve_grid(cairn_pool *pool, int32_t max_points)
{
    cairn_point_grid_params params = {.max_points = max_points, .cell_size = GRID_CELL_PX};
    size_t need = cairn_point_grid_memory(&params);
    cairn_point_grid *grid = NULL;
    cairn_status status;

    if (pool->base == NULL) {
        cairn_pool_count(pool, need);
        return NULL;
    }
    status = cairn_point_grid_create(&grid, pool, &params);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    return grid;
}

static cairn_edge_segment_set *carve(cairn_pool *pool, const cairn_edge_segment_params *params)
{
    cairn_edge_segment_set *set = cairn_pool_take_one(pool, sizeof *set);
    edge_line *lines = cairn_pool_take(pool, (size_t)params->max_lines, sizeof *lines);
    cairn_edge_segment *segments =
        cairn_pool_take(pool, (size_t)params->max_segments, sizeof *segments);
    int32_t *pending = cairn_pool_take(pool, (size_t)params->max_lines, sizeof *pending);
    cairn_point_grid *grid = carve_grid(pool, 2 * params->max_lines);

    if (set != NULL) {
        memset(set, 0, sizeof *set);
        set->lines = lines;
        set->segments = segments;
        set->pending = pending;
        set->grid = grid;
    }
    return set;
}

size_t cairn_edge_segment_memory(const cairn_edge_segment_params *params)
{
    cairn_pool counting;

    if (!params_are_valid(params))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_edge_segment_create(cairn_edge_segment_set **set, cairn_pool *pool,
                                       const cairn_edge_segment_params *params)
{
    size_t need = cairn_edge_segment_memory(params);
    cairn_edge_segment_set *made;

    if (set == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_capacity(pool, need))
        return CAIRN_NO_MEMORY;
    made = carve(pool, params);
    made->params = *params;
    made->cos_turn = cairn_cos(params->min_junction_angle);
    *set = made;
    return CAIRN_OK;
}

cairn_status cairn_edge_segment_begin(cairn_edge_segment_set *set,
                                      const cairn_edge_chain_result *chains)
{
    if (set == NULL || chains == NULL || chains->chain_count < 0 || chains->pixel_count < 0 ||
        (chains->chain_count > 0 && (chains->chains == NULL || chains->pixels == NULL)))
        return CAIRN_BAD_ARGUMENT;
    set->chains = *chains;
    set->line_count = set->segment_count = set->virtual_count = 0;
    set->length_sum = set->squared_length_sum = 0;
    set->chain = 0;
    set->low = set->high = set->position = 0;
    set->pending_count = 0;
    memset(&set->sums, 0, sizeof set->sums);
    set->cursor = 0;
    set->is_started = 0;
    set->window = 0;
    set->last_cut = 0;
    set->search_state = 0;
    set->units_charged = 0;
    set->phase = PHASE_SPLIT;
    return CAIRN_OK;
}

/* ---- Chains to lines ---- */

static int is_closed(const cairn_edge_chain *chain)
{
    return chain->from == CAIRN_EDGE_CHAIN_CLOSED;
}

/* Index in pixels[] of a position in a chain. */
static int32_t index_of(const cairn_edge_chain *chain, int32_t position)
{
    return chain->first + (position < chain->count ? position : position - chain->count);
}

static cairn_vec2 point_of(const cairn_edge_segment_set *set, int32_t chain, int32_t position)
{
    cairn_edge_chain_pixel pixel =
        set->chains.pixels[index_of(&set->chains.chains[chain], position)];
    cairn_vec2 point = {pixel.x, pixel.y};

    return point;
}

static int chain_is_good(const cairn_edge_segment_set *set, const cairn_edge_chain *chain)
{
    return chain->count >= 2 && chain->first >= 0 &&
           chain->first <= set->chains.pixel_count - chain->count;
}

/* Starts measuring the positions between low and high against a new chord. */
static void start_chord(cairn_edge_segment_set *set, int32_t low, int32_t high)
{
    set->low = low;
    set->high = high;
    set->position = low + 1;
    set->farthest = low;
    set->distance_squared = 0;
}

static void measure(cairn_edge_segment_set *set)
{
    cairn_segment chord = {point_of(set, set->chain, set->low),
                           point_of(set, set->chain, set->high)};

    for (int32_t k = 0; k < PIXELS_PER_UNIT && set->position < set->high; k++, set->position++) {
        cairn_vec2 p = point_of(set, set->chain, set->position);
        cairn_real squared =
            cairn_vec2_norm_squared(cairn_vec2_sub(p, cairn_segment_nearest(chord, p, NULL)));

        if (squared > set->distance_squared) {
            set->distance_squared = squared;
            set->farthest = set->position;
        }
    }
}

static void add_line(cairn_edge_segment_set *set)
{
    edge_line *line = &set->lines[set->line_count++];

    line->chain = set->chain;
    line->low = set->low;
    line->high = set->high;
}

/* All pixels of the chord are measured: splits it, or stores it as a line and continues with the
 * pending end. A chord of zero length is split while any pixel lies off it. */
static cairn_status end_chord(cairn_edge_segment_set *set)
{
    int32_t first = index_of(&set->chains.chains[set->chain], set->low);
    int32_t last = index_of(&set->chains.chains[set->chain], set->high);
    int is_point = set->chains.pixels[first].x == set->chains.pixels[last].x &&
                   set->chains.pixels[first].y == set->chains.pixels[last].y;

    if (set->distance_squared > (is_point ? 0 : set->params.tolerance * set->params.tolerance)) {
        if (set->line_count + set->pending_count + 1 >= set->params.max_lines)
            return CAIRN_FULL;
        set->pending[set->pending_count++] = set->high;
        start_chord(set, set->low, set->farthest);
        return CAIRN_OK;
    }
    if (!is_point) {
        if (set->line_count == set->params.max_lines)
            return CAIRN_FULL;
        add_line(set);
    }
    if (set->pending_count > 0) {
        start_chord(set, set->high, set->pending[--set->pending_count]);
    } else {
        set->chain++;
        set->high = 0;
    }
    return CAIRN_OK;
}

static cairn_status step_split(cairn_edge_segment_set *set, cairn_budget *budget)
{
    while (set->chain < set->chains.chain_count) {
        const cairn_edge_chain *chain = &set->chains.chains[set->chain];
        cairn_status status;

        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        if (set->high == 0) {
            if (!chain_is_good(set, chain))
                return CAIRN_BAD_ARGUMENT;
            start_chord(set, 0, is_closed(chain) ? chain->count : chain->count - 1);
        }
        measure(set);
        status = set->position < set->high ? CAIRN_OK : end_chord(set);
        if (status != CAIRN_OK)
            return status;
    }
    return CAIRN_OK;
}

/* Orthogonal regression of n pixels, clipped at the projections of the first and the last; their
 * chord when the projections nearly coincide, as on a hook. */
static cairn_segment regression(const moments *sums, int32_t n, cairn_vec2 first, cairn_vec2 last)
{
    cairn_real count = (cairn_real)n, x = (cairn_real)sums->x / count,
               y = (cairn_real)sums->y / count;
    cairn_real xx = (cairn_real)sums->xx / count - x * x, yy = (cairn_real)sums->yy / count - y * y;
    cairn_real xy = (cairn_real)sums->xy / count - x * y;
    cairn_vec2 mean = {first.x + x, first.y + y}, direction;
    cairn_segment line, chord = {first, last};

    cairn_sincos(cairn_atan2(2 * xy, xx - yy) / 2, &direction.y, &direction.x);
    line.a = cairn_vec2_add(
        mean, cairn_vec2_scale(direction, cairn_vec2_dot(cairn_vec2_sub(first, mean), direction)));
    line.b = cairn_vec2_add(
        mean, cairn_vec2_scale(direction, cairn_vec2_dot(cairn_vec2_sub(last, mean), direction)));
    return 2 * cairn_segment_length(line) < cairn_segment_length(chord) ? chord : line;
}

static void add_pixels(cairn_edge_segment_set *set, const edge_line *line)
{
    cairn_vec2 first = point_of(set, line->chain, line->low);

    for (int32_t k = 0; k < PIXELS_PER_UNIT && set->position <= line->high; k++, set->position++) {
        cairn_vec2 p = cairn_vec2_sub(point_of(set, line->chain, set->position), first);
        int64_t x = (int64_t)p.x, y = (int64_t)p.y;

        set->sums.x += x;
        set->sums.y += y;
        set->sums.xx += x * x;
        set->sums.xy += x * y;
        set->sums.yy += y * y;
    }
}

static cairn_status step_fit(cairn_edge_segment_set *set, cairn_budget *budget)
{
    while (set->cursor < set->line_count) {
        edge_line *line = &set->lines[set->cursor];
        cairn_real length;

        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        if (!set->is_started) {
            memset(&set->sums, 0, sizeof set->sums);
            set->position = line->low;
            set->is_started = 1;
        }
        add_pixels(set, line);
        if (set->position <= line->high)
            continue;
        line->line = regression(&set->sums, line->high - line->low + 1,
                                point_of(set, line->chain, line->low),
                                point_of(set, line->chain, line->high));
        length = cairn_segment_length(line->line);
        set->length_sum += length;
        set->squared_length_sum += length * length;
        set->is_started = 0;
        set->cursor++;
    }
    return CAIRN_OK;
}

/* ---- Cuts ---- */

static cairn_real look_ahead(const cairn_edge_segment_set *set)
{
    cairn_real count = (cairn_real)set->line_count, mean, variance;

    if (set->params.look_ahead > 0 || set->line_count == 0)
        return cairn_max(set->params.look_ahead, MIN_LENGTH_PX);
    mean = set->length_sum / count;
    variance = cairn_max(set->squared_length_sum / count - mean * mean, 0);
    return cairn_max(mean + CAIRN_REAL(0.5) * cairn_sqrt(variance), MIN_LENGTH_PX);
}

/* Clears the grid and inserts all ends. */
static cairn_status step_index(cairn_edge_segment_set *set, cairn_budget *budget)
{
    if (!set->is_started) {
        while (cairn_point_grid_count(set->grid) > 0) {
            if (budget->left <= 0)
                return CAIRN_MORE;
            budget->left--;
            cairn_point_grid_remove_last(set->grid);
        }
        set->is_started = 1;
    }
    for (; set->cursor < set->line_count; set->cursor++) {
        cairn_segment line = set->lines[set->cursor].line;
        cairn_status status;

        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        status = cairn_point_grid_insert(set->grid, line.a);
        if (status == CAIRN_OK)
            status = cairn_point_grid_insert(set->grid, line.b);
        CAIRN_ASSERT(status == CAIRN_OK);
        (void)status;
    }
    set->look_ahead = look_ahead(set);
    set->length_sum = 0;
    return CAIRN_OK;
}

/* Work units of a search among the ends: one per CELLS_PER_UNIT cells that the radius touches, or
 * ends, if those are fewer. */
static int32_t search_cost(const cairn_edge_segment_set *set, cairn_real radius)
{
    cairn_real side = 2 * radius / GRID_CELL_PX + 2;
    cairn_real cells = cairn_min(side * side, (cairn_real)cairn_point_grid_count(set->grid));

    return 1 + cairn_real_to_int(cells / CELLS_PER_UNIT);
}

/* Starts a search for ends near a window of the current line. Returns 0 when the budget is
 * exhausted. */
static int start_search(cairn_edge_segment_set *set, cairn_vec2 centre, cairn_real radius,
                        cairn_budget *budget)
{
    if (!cairn_budget_charge(budget, &set->units_charged, search_cost(set, radius)))
        return 0;
    set->search = cairn_point_grid_begin(set->grid, centre, radius);
    set->search_state = 1;
    return 1;
}

/* Sets the bit of the pixel that an end projects to, when the end is near the current window. */
static void mark_cut(cairn_edge_segment_set *set, cairn_segment line, cairn_real length,
                     cairn_vec2 end)
{
    cairn_vec2 direction = cairn_vec2_scale(cairn_vec2_sub(line.b, line.a), 1 / length),
               from = cairn_vec2_sub(end, line.a);
    cairn_real position = cairn_vec2_dot(from, direction) - (cairn_real)set->window;

    if (position >= 0 && position < WINDOW_PX &&
        cairn_abs(cairn_vec2_cross(direction, from)) <= 2 * set->look_ahead)
        set->cuts |= (uint64_t)1 << cairn_real_to_int(position);
}

/* Adds the segment of a line from `from` to `to`, px from its start. */
static cairn_status add_segment(cairn_edge_segment_set *set, const edge_line *line,
                                cairn_real length, cairn_real from, cairn_real to)
{
    const cairn_edge_chain *chain = &set->chains.chains[line->chain];
    cairn_real pixels = (cairn_real)(line->high - line->low) / length;
    cairn_edge_segment *segment;

    if (set->segment_count == set->params.max_segments)
        return CAIRN_FULL;
    segment = &set->segments[set->segment_count++];
    segment->line.a = cairn_vec2_interpolate(line->line.a, line->line.b, from / length);
    segment->line.b = cairn_vec2_interpolate(line->line.a, line->line.b, to / length);
    segment->chain = line->chain;
    segment->first = index_of(chain, line->low + cairn_real_to_int(cairn_rint(from * pixels)));
    segment->last = index_of(chain, line->low + cairn_real_to_int(cairn_rint(to * pixels)));
    segment->strength = chain->strength;
    set->length_sum += to - from;
    return CAIRN_OK;
}

/* Makes the next cut of the window, one unit. */
static cairn_status take_cut(cairn_edge_segment_set *set, const edge_line *line, cairn_real length)
{
    int32_t bit = 0;
    cairn_real cut;
    cairn_status status = CAIRN_OK;

    while (!(set->cuts >> bit & 1))
        bit++;
    set->cuts &= set->cuts - 1;
    cut = (cairn_real)(set->window + bit);
    if (cut - set->last_cut >= set->params.min_piece && length - cut >= set->params.min_piece) {
        status = add_segment(set, line, length, set->last_cut, cut);
        set->last_cut = cut;
    }
    return status;
}

/* Ends the current line: the remainder is the last piece. */
static cairn_status end_line(cairn_edge_segment_set *set, edge_line *line, cairn_real length)
{
    cairn_status status = add_segment(set, line, length, set->last_cut, length);

    line->last = set->segment_count - 1;
    set->last_cut = 0;
    set->window = 0;
    set->cursor++;
    return status;
}

/* One step of work on the current line. */
static cairn_status cut_line(cairn_edge_segment_set *set, edge_line *line, cairn_budget *budget)
{
    cairn_real length = cairn_segment_length(line->line), reach = 2 * set->look_ahead;

    if (set->search_state == 0) {
        cairn_real middle = (cairn_real)set->window + CAIRN_REAL(0.5) * WINDOW_PX;
        cairn_real radius = cairn_sqrt(reach * reach + CAIRN_REAL(0.25) * WINDOW_PX * WINDOW_PX);

        if (set->window == 0)
            line->first = set->segment_count;
        set->cuts = 0;
        return start_search(set,
                            cairn_vec2_interpolate(line->line.a, line->line.b, middle / length),
                            radius, budget)
                   ? CAIRN_OK
                   : CAIRN_MORE;
    }
    if (budget->left <= 0)
        return CAIRN_MORE;
    budget->left--;
    if (set->search_state == 1) {
        int32_t end = cairn_point_grid_next(set->grid, &set->search);

        if (end < 0)
            set->search_state = 2;
        else
            mark_cut(set, line->line, length, cairn_point_grid_point(set->grid, end));
        return CAIRN_OK;
    }
    if (set->cuts != 0)
        return take_cut(set, line, length);
    set->search_state = 0;
    set->window += WINDOW_PX;
    return (cairn_real)set->window < length ? CAIRN_OK : end_line(set, line, length);
}

static cairn_status step_cut(cairn_edge_segment_set *set, cairn_budget *budget)
{
    while (set->cursor < set->line_count) {
        cairn_status status = cut_line(set, &set->lines[set->cursor], budget);

        if (status != CAIRN_OK)
            return status;
    }
    set->mean_length =
        set->segment_count > 0
            ? cairn_max(set->length_sum / (cairn_real)set->segment_count, MIN_LENGTH_PX)
            : MIN_LENGTH_PX;
    return CAIRN_OK;
}

/* ---- Virtual segments ---- */

/* Unit vector from an end of a line to its other end. */
static cairn_vec2 inwards(const cairn_edge_segment_set *set, int32_t end)
{
    cairn_segment line = set->lines[end / 2].line;

    return cairn_vec2_unit(end % 2 == 0 ? cairn_vec2_sub(line.b, line.a)
                                        : cairn_vec2_sub(line.a, line.b));
}

static int is_near(const cairn_edge_segment_set *set, int32_t end, cairn_vec2 point)
{
    return cairn_vec2_norm(cairn_vec2_sub(cairn_point_grid_point(set->grid, end), point)) <=
           set->params.junction_distance;
}

static int32_t segment_at(const cairn_edge_segment_set *set, int32_t end)
{
    return end % 2 == 0 ? set->lines[end / 2].first : set->lines[end / 2].last;
}

/* Adds a virtual segment where the lines of two ends intersect. */
static cairn_status join(cairn_edge_segment_set *set, int32_t end, int32_t other)
{
    cairn_vec2 u = inwards(set, end), v = inwards(set, other), crossing, half;
    cairn_edge_segment *segment;

    if (-cairn_vec2_dot(u, v) > set->cos_turn ||
        !cairn_line_intersection(set->lines[end / 2].line, set->lines[other / 2].line, &crossing) ||
        !is_near(set, end, crossing) || !is_near(set, other, crossing))
        return CAIRN_OK;
    if (set->segment_count == set->params.max_segments)
        return CAIRN_FULL;
    half = cairn_vec2_scale(cairn_vec2_unit(cairn_vec2_sub(v, u)),
                            CAIRN_REAL(0.5) * set->params.min_piece);
    segment = &set->segments[set->segment_count++];
    segment->line.a = cairn_vec2_sub(crossing, half);
    segment->line.b = cairn_vec2_add(crossing, half);
    segment->chain = -1;
    segment->first = segment_at(set, end);
    segment->last = segment_at(set, other);
    segment->strength =
        cairn_min(set->segments[segment->first].strength, set->segments[segment->last].strength);
    set->virtual_count++;
    return CAIRN_OK;
}

static cairn_status step_join(cairn_edge_segment_set *set, cairn_budget *budget)
{
    while (set->params.junction_distance > 0 && set->cursor < 2 * set->line_count) {
        int32_t other;
        cairn_status status = CAIRN_OK;

        if (set->search_state == 0 &&
            !start_search(set, cairn_point_grid_point(set->grid, set->cursor),
                          2 * set->params.junction_distance, budget))
            return CAIRN_MORE;
        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        other = cairn_point_grid_next(set->grid, &set->search);
        if (other < 0) {
            set->search_state = 0;
            set->cursor++;
        } else if (other / 2 > set->cursor / 2) {
            status = join(set, set->cursor, other);
        }
        if (status != CAIRN_OK)
            return status;
    }
    return CAIRN_OK;
}

static cairn_status step_phase(cairn_edge_segment_set *set, cairn_budget *budget)
{
    switch (set->phase) {
    case PHASE_SPLIT:
        return step_split(set, budget);
    case PHASE_FIT:
        return step_fit(set, budget);
    case PHASE_INDEX:
        return step_index(set, budget);
    case PHASE_CUT:
        return step_cut(set, budget);
    default:
        return step_join(set, budget);
    }
}

cairn_status cairn_edge_segment_step(cairn_edge_segment_set *set, cairn_budget *budget)
{
    if (set == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (set->phase != PHASE_IDLE && set->phase != PHASE_DONE) {
        cairn_status status = step_phase(set, budget);

        if (status < 0)
            set->phase = PHASE_IDLE;
        if (status != CAIRN_OK)
            return status;
        set->phase++;
        set->cursor = 0;
        set->is_started = 0;
        set->search_state = 0;
    }
    return CAIRN_OK;
}

cairn_edge_segment_result cairn_edge_segment_read(const cairn_edge_segment_set *set)
{
    cairn_edge_segment_result result = {0};

    if (set == NULL || set->phase != PHASE_DONE)
        return result;
    result.segments = set->segments;
    result.count = set->segment_count;
    result.virtual_count = set->virtual_count;
    result.line_count = set->line_count;
    result.look_ahead = set->look_ahead;
    result.mean_length = set->mean_length;
    return result;
}
