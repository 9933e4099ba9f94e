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
#include "src/base/object.h"
#include "src/base/step.h"

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

/* Splitting of a chain: the chord that is measured, and those after it. */
typedef struct edge_splitting {
    int32_t *pending; /* [max_lines] stack of pending right ends */
    int32_t pending_count;
    int32_t chain;                         /* index of the chain */
    int32_t low, high, position, farthest; /* positions in the chain */
    cairn_real distance_squared;           /* px^2, of the farthest pixel from the chord */
} edge_splitting;

/* Fitting of the lines. */
typedef struct edge_fitting {
    moments sums;     /* of the current line */
    int32_t position; /* in the chain: the next pixel of the line */
    /* px, px^2: sums over the lengths of all lines */
    cairn_real length_sum, squared_length_sum;
} edge_fitting;

/* Cuts of the lines. */
typedef struct edge_cutting {
    int32_t window;        /* px, start of the window from the start of the line */
    uint64_t cuts;         /* bit k: a cut at window + k */
    cairn_real last_cut;   /* px, position on the line */
    cairn_real length_sum; /* px, sum over the lengths of the segments */
} edge_cutting;

struct cairn_edge_segment_set {
    cairn_edge_segment_params params;
    cairn_real cos_turn;

    /* The input, and the state of its extraction: */
    cairn_edge_chain_result chains;
    /* CAIRN_MORE: in work; CAIRN_OK: the result is complete; else there is none */
    cairn_status status;
    /* resume points of the extraction and of a phase */
    int32_t resume, phase_resume;
    int32_t units_charged;
    /* current line; joining: current end */
    int32_t cursor;

    /* What the phases pass on to each other: */
    edge_line *lines; /* [max_lines] */
    cairn_point_grid *grid;
    int32_t line_count;

    /* Each of one phase. The cuts begin when the sums of the fitting have been used; the search
     * among the ends is of the cuts, and of the joins after them: */
    edge_splitting split;
    union {
        edge_fitting fit;
        edge_cutting cut;
    };
    cairn_point_grid_cursor search;

    /* The result: */
    cairn_edge_segment *segments; /* [max_segments] */
    int32_t segment_count, virtual_count;
    cairn_real look_ahead, mean_length; /* px */
};

#define INTEGER(field, ...)  CAIRN_INTEGER(cairn_edge_segment_params, field, __VA_ARGS__)
#define NUMBER(field, ...)   CAIRN_NUMBER(cairn_edge_segment_params, field, __VA_ARGS__)
#define POSITIVE(field, ...) CAIRN_NUMBER_ABOVE(cairn_edge_segment_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_lines, 10000, 1, MAX_LINES),
    INTEGER(max_segments, 40000, 1, MAX_SEGMENTS),
    POSITIVE(tolerance, CAIRN_REAL(1.5), 0, CAIRN_REAL_MAX),
    NUMBER(min_piece, 4, 2, CAIRN_REAL_MAX),
    NUMBER(look_ahead, 0, 0, CAIRN_REAL_MAX),
    NUMBER(junction_distance, 6, 0, CAIRN_REAL_MAX),
    NUMBER(min_junction_angle, 20 * (CAIRN_PI / 180), 0, CAIRN_PI),
};
extern const cairn_parameters cairn_edge_segment_parameters;
const cairn_parameters cairn_edge_segment_parameters =
    CAIRN_PARAMETERS("edge_segment", cairn_edge_segment_params, rows);

cairn_edge_segment_params cairn_edge_segment_default(void)
{
    cairn_edge_segment_params params;

    cairn_parameters_preset(&cairn_edge_segment_parameters, &params);
    return params;
}

cairn_status cairn_edge_segment_check(const cairn_edge_segment_params *params,
                                      cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_edge_segment_parameters, params, fault);
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_edge_segment_set *build(cairn_pool *pool, const cairn_edge_segment_params *params)
{
    cairn_point_grid_params grid = {.max_points = 2 * params->max_lines, .cell_size = GRID_CELL_PX};
    cairn_edge_segment_set *set = cairn_object_take(pool, sizeof *set);

    CAIRN_TAKE(set, pool, lines, params->max_lines);
    CAIRN_TAKE(set, pool, segments, params->max_segments);
    CAIRN_TAKE(set, pool, split.pending, params->max_lines);
    CAIRN_TAKE_OBJECT(set, pool, grid, point_grid, &grid);
    if (set != NULL) {
        set->params = *params;
        set->status = CAIRN_EMPTY;
        set->cos_turn = cairn_cos(params->min_junction_angle);
    }
    return set;
}

CAIRN_OBJECT(edge_segment, edge_segment_set, build);

cairn_status cairn_edge_segment_begin(cairn_edge_segment_set *set,
                                      const cairn_edge_chain_result *chains)
{
    if (set == NULL || chains == NULL || chains->chain_count < 0 || chains->pixel_count < 0 ||
        (chains->chain_count > 0 && (chains->chains == NULL || chains->pixels == NULL)))
        return CAIRN_BAD_ARGUMENT;
    set->chains = *chains;
    set->line_count = set->segment_count = set->virtual_count = 0;
    set->units_charged = 0;
    set->resume = set->phase_resume = 0;
    set->status = CAIRN_MORE;
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

static cairn_vec2 point_of(const cairn_edge_chain_result *chains, int32_t chain, int32_t position)
{
    cairn_edge_chain_pixel pixel = chains->pixels[index_of(&chains->chains[chain], position)];
    cairn_vec2 point = {pixel.x, pixel.y};

    return point;
}

static int chain_is_good(const cairn_edge_chain_result *chains, const cairn_edge_chain *chain)
{
    return chain->count >= 2 && chain->first >= 0 &&
           chain->first <= chains->pixel_count - chain->count;
}

/* Starts measuring the positions between low and high against a new chord. */
static void start_chord(edge_splitting *split, int32_t low, int32_t high)
{
    split->low = low;
    split->high = high;
    split->position = low + 1;
    split->farthest = low;
    split->distance_squared = 0;
}

/* Measures the next pixels of the chord. */
static void measure(edge_splitting *split, const cairn_edge_chain_result *chains)
{
    cairn_segment chord = {point_of(chains, split->chain, split->low),
                           point_of(chains, split->chain, split->high)};

    for (int32_t k = 0; k < PIXELS_PER_UNIT && split->position < split->high;
         k++, split->position++) {
        cairn_vec2 p = point_of(chains, split->chain, split->position);
        cairn_real squared =
            cairn_vec2_norm_squared(cairn_vec2_sub(p, cairn_segment_nearest(chord, p, NULL)));

        if (squared > split->distance_squared) {
            split->distance_squared = squared;
            split->farthest = split->position;
        }
    }
}

/* Adds the chord to the lines. */
static void add_line(cairn_edge_segment_set *set)
{
    edge_line *line = &set->lines[set->line_count++];

    line->chain = set->split.chain;
    line->low = set->split.low;
    line->high = set->split.high;
}

/* Starts a chain by its longest chord. Fails when the chain is not among the pixels. */
static cairn_status start_chain(edge_splitting *split, const cairn_edge_chain_result *chains)
{
    const cairn_edge_chain *chain = &chains->chains[split->chain];

    if (!chain_is_good(chains, chain))
        return CAIRN_BAD_ARGUMENT;
    split->pending_count = 0;
    start_chord(split, 0, is_closed(chain) ? chain->count : chain->count - 1);
    return CAIRN_MORE;
}

/* All pixels of the chord are measured: splits it, or stores it as a line and continues with the
 * pending end. A chord of zero length is split while any pixel lies off it. Returns 1 when another
 * chord of the chain follows. */
static int end_chord(cairn_edge_segment_set *set)
{
    edge_splitting *split = &set->split;
    const cairn_edge_chain *chain = &set->chains.chains[split->chain];
    const cairn_edge_chain_pixel *first = &set->chains.pixels[index_of(chain, split->low)],
                                 *last = &set->chains.pixels[index_of(chain, split->high)];
    int is_point = first->x == last->x && first->y == last->y;
    int is_split =
        split->distance_squared > (is_point ? 0 : set->params.tolerance * set->params.tolerance);

    if (is_split ? set->line_count + split->pending_count + 1 >= set->params.max_lines
                 : !is_point && set->line_count == set->params.max_lines) {
        set->status = CAIRN_FULL;
        return 0;
    }
    if (is_split) {
        split->pending[split->pending_count++] = split->high;
        start_chord(split, split->low, split->farthest);
        return 1;
    }
    if (!is_point)
        add_line(set);
    if (split->pending_count == 0)
        return 0;
    start_chord(split, split->high, split->pending[--split->pending_count]);
    return 1;
}

/* Polylines of the chains. */
static int split_chains(cairn_edge_segment_set *set, cairn_budget *budget)
{
    edge_splitting *split = &set->split;

    CAIRN_STEP_BEGIN(set->phase_resume);
    for (split->chain = 0; split->chain < set->chains.chain_count; split->chain++) {
        set->status = start_chain(split, &set->chains);
        if (set->status != CAIRN_MORE)
            break;
        do {
            do {
                CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
                measure(split, &set->chains);
            } while (split->position < split->high);
        } while (end_chord(set));
        if (set->status != CAIRN_MORE)
            break;
    }
    CAIRN_STEP_END(set->phase_resume);
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

/* Adds the next pixels of a line. */
static void add_pixels(edge_fitting *fit, const cairn_edge_chain_result *chains,
                       const edge_line *line)
{
    cairn_vec2 first = point_of(chains, line->chain, line->low);

    for (int32_t k = 0; k < PIXELS_PER_UNIT && fit->position <= line->high; k++, fit->position++) {
        cairn_vec2 p = cairn_vec2_sub(point_of(chains, line->chain, fit->position), first);
        int64_t x = cairn_real_to_int(p.x), y = cairn_real_to_int(p.y);

        fit->sums.x += x;
        fit->sums.y += y;
        fit->sums.xx += x * x;
        fit->sums.xy += x * y;
        fit->sums.yy += y * y;
    }
}

/* Fits a line to the pixels that were added. */
static void fit_line(edge_fitting *fit, const cairn_edge_chain_result *chains, edge_line *line)
{
    cairn_real length;

    line->line =
        regression(&fit->sums, line->high - line->low + 1, point_of(chains, line->chain, line->low),
                   point_of(chains, line->chain, line->high));
    length = cairn_segment_length(line->line);
    fit->length_sum += length;
    fit->squared_length_sum += length * length;
}

/* Lines fitted to the polylines. */
static int fit_lines(cairn_edge_segment_set *set, cairn_budget *budget)
{
    edge_fitting *fit = &set->fit;

    CAIRN_STEP_BEGIN(set->phase_resume);
    fit->length_sum = fit->squared_length_sum = 0;
    for (set->cursor = 0; set->cursor < set->line_count; set->cursor++) {
        memset(&fit->sums, 0, sizeof fit->sums);
        fit->position = set->lines[set->cursor].low;
        do {
            CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
            add_pixels(fit, &set->chains, &set->lines[set->cursor]);
        } while (fit->position <= set->lines[set->cursor].high);
        fit_line(fit, &set->chains, &set->lines[set->cursor]);
    }
    CAIRN_STEP_END(set->phase_resume);
}

/* ---- Cuts ---- */

/* Look-ahead, in px, for lines of which the sums over the lengths are known. */
static cairn_real look_ahead_of(const cairn_edge_segment_params *params, const edge_fitting *fit,
                                int32_t line_count)
{
    cairn_real count = (cairn_real)line_count, mean, variance;

    if (params->look_ahead > 0 || line_count == 0)
        return cairn_max(params->look_ahead, MIN_LENGTH_PX);
    mean = fit->length_sum / count;
    variance = cairn_max(fit->squared_length_sum / count - mean * mean, 0);
    return cairn_max(mean + CAIRN_REAL(0.5) * cairn_sqrt(variance), MIN_LENGTH_PX);
}

/* Inserts both ends of a line. */
static void insert_ends(cairn_point_grid *grid, cairn_segment line)
{
    cairn_must_be_ok(cairn_point_grid_insert(grid, line.a));
    cairn_must_be_ok(cairn_point_grid_insert(grid, line.b));
}

/* Grid of all ends. */
static int index_ends(cairn_edge_segment_set *set, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(set->phase_resume);
    while (cairn_point_grid_count(set->grid) > 0) {
        CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
        cairn_point_grid_remove_last(set->grid);
    }
    for (set->cursor = 0; set->cursor < set->line_count; set->cursor++) {
        CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
        insert_ends(set->grid, set->lines[set->cursor].line);
    }
    CAIRN_STEP_END(set->phase_resume);
}

/* Work units of a search among the ends: one per CELLS_PER_UNIT cells that the radius touches, or
 * ends, if those are fewer. */
static int32_t search_cost(const cairn_point_grid *grid, cairn_real radius)
{
    cairn_real side = 2 * radius / GRID_CELL_PX + 2;
    cairn_real cells = cairn_min(side * side, (cairn_real)cairn_point_grid_count(grid));

    return 1 + cairn_real_to_int(cells / CELLS_PER_UNIT);
}

/* Sets the bit of the pixel that an end projects to, when the end is near the current window. */
static void mark_cut(edge_cutting *cut, cairn_real look_ahead, cairn_segment line,
                     cairn_real length, cairn_vec2 end)
{
    cairn_vec2 direction = cairn_vec2_scale(cairn_vec2_sub(line.b, line.a), 1 / length),
               from = cairn_vec2_sub(end, line.a);
    cairn_real position = cairn_vec2_dot(from, direction) - (cairn_real)cut->window;

    if (position >= 0 && position < WINDOW_PX &&
        cairn_abs(cairn_vec2_cross(direction, from)) <= 2 * look_ahead)
        cut->cuts |= (uint64_t)1 << cairn_real_to_int(position);
}

/* Adds the segment of a line from `from` to `to`, px from its start. */
static void add_segment(cairn_edge_segment_set *set, const edge_line *line, cairn_real length,
                        cairn_real from, cairn_real to)
{
    const cairn_edge_chain *chain = &set->chains.chains[line->chain];
    cairn_real pixels = (cairn_real)(line->high - line->low) / length;
    cairn_edge_segment *segment;

    if (set->segment_count == set->params.max_segments) {
        set->status = CAIRN_FULL;
        return;
    }
    segment = &set->segments[set->segment_count++];
    segment->line.a = cairn_vec2_interpolate(line->line.a, line->line.b, from / length);
    segment->line.b = cairn_vec2_interpolate(line->line.a, line->line.b, to / length);
    segment->chain = line->chain;
    segment->first = index_of(chain, line->low + cairn_real_to_int(cairn_rint(from * pixels)));
    segment->last = index_of(chain, line->low + cairn_real_to_int(cairn_rint(to * pixels)));
    segment->strength = chain->strength;
    set->cut.length_sum += to - from;
}

/* Length of the current line. */
static cairn_real current_length(const cairn_edge_segment_set *set)
{
    return cairn_segment_length(set->lines[set->cursor].line);
}

/* Radius about the middle of a window that covers all ends near the window. */
static cairn_real window_radius(cairn_real look_ahead)
{
    cairn_real reach = 2 * look_ahead;

    return cairn_sqrt(reach * reach + CAIRN_REAL(0.25) * WINDOW_PX * WINDOW_PX);
}

/* Starts the search for ends near the window of the current line. */
static void begin_window(cairn_edge_segment_set *set)
{
    cairn_segment line = set->lines[set->cursor].line;
    cairn_real middle = (cairn_real)set->cut.window + CAIRN_REAL(0.5) * WINDOW_PX;

    set->cut.cuts = 0;
    set->search = cairn_point_grid_begin(
        set->grid, cairn_vec2_interpolate(line.a, line.b, middle / current_length(set)),
        window_radius(set->look_ahead));
}

/* Marks the cut of the next end near the window. Returns 0 when there is none left. */
static int mark_next(cairn_edge_segment_set *set)
{
    int32_t end = cairn_point_grid_next(set->grid, &set->search);

    if (end < 0)
        return 0;
    mark_cut(&set->cut, set->look_ahead, set->lines[set->cursor].line, current_length(set),
             cairn_point_grid_point(set->grid, end));
    return 1;
}

/* Makes the next cut of the window. */
static void take_cut(cairn_edge_segment_set *set)
{
    edge_cutting *cut = &set->cut;
    cairn_real length = current_length(set), at;
    int32_t bit = 0;

    while (!(cut->cuts >> bit & 1))
        bit++;
    cut->cuts &= cut->cuts - 1;
    at = (cairn_real)(cut->window + bit);
    if (at - cut->last_cut < set->params.min_piece || length - at < set->params.min_piece)
        return;
    add_segment(set, &set->lines[set->cursor], length, cut->last_cut, at);
    cut->last_cut = at;
}

/* Ends the current line: the remainder is the last piece. */
static void end_line(cairn_edge_segment_set *set)
{
    edge_line *line = &set->lines[set->cursor];
    cairn_real length = current_length(set);

    add_segment(set, line, length, set->cut.last_cut, length);
    line->last = set->segment_count - 1;
}

/* Segments: the lines, cut where ends of other lines are near, window by window. */
static int cut_lines(cairn_edge_segment_set *set, cairn_budget *budget)
{
    edge_cutting *cut = &set->cut;

    CAIRN_STEP_BEGIN(set->phase_resume);
    set->look_ahead = look_ahead_of(&set->params, &set->fit, set->line_count);
    cut->length_sum = 0;
    for (set->cursor = 0; set->cursor < set->line_count && set->status == CAIRN_MORE;
         set->cursor++) {
        set->lines[set->cursor].first = set->segment_count;
        cut->last_cut = 0;
        cut->window = 0;
        do {
            CAIRN_STEP_CHARGE(set, phase_resume, budget,
                              search_cost(set->grid, window_radius(set->look_ahead)));
            begin_window(set);
            do {
                CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
            } while (mark_next(set));
            while (cut->cuts != 0 && set->status == CAIRN_MORE) {
                CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
                take_cut(set);
            }
            CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
            cut->window += WINDOW_PX;
        } while (set->status == CAIRN_MORE && (cairn_real)cut->window < current_length(set));
        if (set->status == CAIRN_MORE)
            end_line(set);
    }
    set->mean_length =
        set->segment_count > 0
            ? cairn_max(cut->length_sum / (cairn_real)set->segment_count, MIN_LENGTH_PX)
            : MIN_LENGTH_PX;
    CAIRN_STEP_END(set->phase_resume);
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
static void join(cairn_edge_segment_set *set, int32_t end, int32_t other)
{
    cairn_vec2 u = inwards(set, end), v = inwards(set, other), crossing, half;
    cairn_edge_segment *segment;

    if (-cairn_vec2_dot(u, v) > set->cos_turn ||
        !cairn_line_intersection(set->lines[end / 2].line, set->lines[other / 2].line, &crossing) ||
        !is_near(set, end, crossing) || !is_near(set, other, crossing))
        return;
    if (set->segment_count == set->params.max_segments) {
        set->status = CAIRN_FULL;
        return;
    }
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
}

/* Joins the current end with the next one near it, of a later line. Returns 0 when there is none
 * left. */
static int join_next(cairn_edge_segment_set *set)
{
    int32_t other = cairn_point_grid_next(set->grid, &set->search);

    if (other >= 0 && other / 2 > set->cursor / 2)
        join(set, set->cursor, other);
    return other >= 0 && set->status == CAIRN_MORE;
}

/* Virtual segments at junctions. */
static int join_lines(cairn_edge_segment_set *set, cairn_budget *budget)
{
    cairn_real radius = 2 * set->params.junction_distance;

    CAIRN_STEP_BEGIN(set->phase_resume);
    for (set->cursor = 0; set->cursor < 2 * set->line_count && set->status == CAIRN_MORE;
         set->cursor++) {
        CAIRN_STEP_CHARGE(set, phase_resume, budget, search_cost(set->grid, radius));
        set->search = cairn_point_grid_begin(
            set->grid, cairn_point_grid_point(set->grid, set->cursor), radius);
        do {
            CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
        } while (join_next(set));
    }
    CAIRN_STEP_END(set->phase_resume);
}

/* The extraction: see Method in the head of this file. */
static int extract(cairn_edge_segment_set *set, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(set->resume);
    CAIRN_STEP_RUN(set, resume, budget, split_chains);
    if (set->status == CAIRN_MORE) {
        CAIRN_STEP_RUN(set, resume, budget, fit_lines);
        CAIRN_STEP_RUN(set, resume, budget, index_ends);
        CAIRN_STEP_RUN(set, resume, budget, cut_lines);
    }
    if (set->status == CAIRN_MORE && set->params.junction_distance > 0)
        CAIRN_STEP_RUN(set, resume, budget, join_lines);
    CAIRN_STEP_END(set->resume);
}

cairn_status cairn_edge_segment_step(cairn_edge_segment_set *set, cairn_budget *budget)
{
    if (set == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (set->status != CAIRN_MORE)
        return CAIRN_OK;
    if (!extract(set, budget))
        return CAIRN_MORE;
    if (set->status == CAIRN_MORE)
        set->status = CAIRN_OK;
    return set->status;
}

cairn_edge_segment_result cairn_edge_segment_read(const cairn_edge_segment_set *set)
{
    cairn_edge_segment_result result = {0};

    if (set == NULL || set->status != CAIRN_OK)
        return result;
    result.segments = set->segments;
    result.count = set->segment_count;
    result.virtual_count = set->virtual_count;
    result.line_count = set->line_count;
    result.look_ahead = set->look_ahead;
    result.mean_length = set->mean_length;
    return result;
}
