/* scan_match: Hough voting for the position of the query's origin. Every pair of a query point and
 * a target point of equal direction votes.
 *
 * Method: correlation of two sparse sets of oriented points, for all positions at once.
 * 1. For each heading of the window, a rotated query point and a target point of agreeing direction
 *    determine the position that makes them coincide. The votes of a cell are the correlation
 *    there, summed over the existing pairs instead of over all cells of the plane; nothing is
 *    pruned.
 * 2. Peaks (local maxima over two by two cells) of all headings compete for max_candidates places.
 * 3. A wall that many target parts show has as many points at each position. In a global search a
 *    query point therefore votes for a cell once (params.vote_once): its vote counts inliers.
 *    Otherwise the poses at often seen surfaces would take all places, and of two equal rooms the
 *    less often seen one would not be tried.
 *
 * Layout: a cell holds the votes, or votes << 8 | number of the query point that voted last. */
#include "src/base/build.h"

#include <string.h>

#include "src/scans/scan_match_work.h"

enum {
    MARGIN_CELLS = 5, /* cells of the grid about its window */
    QUERY_BITS = 8,   /* MAX_QUERY_POINTS fit */
    QUERY_MASK = (1 << QUERY_BITS) - 1,
    NO_QUERY = -1,
    /* costs in parts of a unit: the direction of a query point, its rotation, a range of target
     * positions, two of these, and one on the grid, ... */
    PARTS_PER_DIRECTION = 12,
    PARTS_PER_ROTATION = 16,
    PARTS_PER_RANGE = 3,
    PARTS_PER_TWO_PAIRS = 3,
    PARTS_PER_HIT = 1,
    /* ... a cell that is compared with the worst candidate, its neighbour, its candidate, ... */
    PARTS_PER_CELL = 8,
    PARTS_PER_NEIGHBOUR = 9,
    PARTS_PER_CANDIDATE = 24,
    PARTS_PER_PEAK_TEST = PARTS_PER_CELL + 8 * PARTS_PER_NEIGHBOUR + PARTS_PER_CANDIDATE,
    /* ... cells that are cleared, and a candidate that is sorted */
    CELLS_CLEARED_PER_PART = 2,
    PARTS_PER_SORTED = 8
};

static const cairn_real MIN_HEADING_STEP_RAD = CAIRN_REAL(0.04),
                        MAX_HEADING_STEP_RAD = CAIRN_REAL(0.088);

int32_t cairn_scan_match_cells(cairn_real distance, cairn_real spacing)
{
    int32_t side = SCAN_MATCH_MAX_SIDE;

    if (!(distance >= 0) || !(spacing > 0))
        return SCAN_MATCH_MIN_CELLS;
    if (distance < SCAN_MATCH_MAX_SIDE * spacing)
        side = cairn_real_to_int(2 * distance / (SCAN_MATCH_CELL_SPACINGS * spacing)) +
               MARGIN_CELLS + 1;
    return side < SCAN_MATCH_MAX_SIDE ? side * side : SCAN_MATCH_MAX_CELLS;
}

/* Sets the grid of positions: about the start, or all positions at which query and target touch. */
static void place_grid(cairn_scan_match *match)
{
    scan_match_accumulator *v = &match->votes;
    int32_t side = cairn_real_to_int(cairn_sqrt((cairn_real)match->params.max_cells));
    cairn_real most = (cairn_real)side * SCAN_MATCH_CELL_SPACINGS * match->params.spacing;
    cairn_vec2 low, high;

    if (!match->has_window) {
        cairn_real reach = match->query_extent, n = (cairn_real)match->target_count;
        cairn_vec2 centre = {match->target_sum.x / n, match->target_sum.y / n};

        low.x = cairn_max(match->target_low.x - reach, centre.x - most / 2);
        low.y = cairn_max(match->target_low.y - reach, centre.y - most / 2);
        high.x = cairn_min(match->target_high.x + reach, centre.x + most / 2);
        high.y = cairn_min(match->target_high.y + reach, centre.y + most / 2);
    } else {
        cairn_real half = cairn_min(match->window.distance, most / 2);

        low.x = match->start.x - half;
        low.y = match->start.y - half;
        high.x = match->start.x + half;
        high.y = match->start.y + half;
    }
    v->cell_size = SCAN_MATCH_CELL_SPACINGS * match->params.spacing;
    v->origin.x = low.x - 2 * v->cell_size;
    v->origin.y = low.y - 2 * v->cell_size;
    v->width = cairn_real_to_int((high.x - low.x) / v->cell_size) + MARGIN_CELLS;
    v->height = cairn_real_to_int((high.y - low.y) / v->cell_size) + MARGIN_CELLS;
    v->width = v->width < side ? v->width : side;
    v->height = v->height < side ? v->height : side;
}

static void place_headings(cairn_scan_match *match)
{
    scan_match_accumulator *v = &match->votes;
    cairn_real step = cairn_min(cairn_max(2 * v->cell_size / match->radius, MIN_HEADING_STEP_RAD),
                                MAX_HEADING_STEP_RAD);
    cairn_real half = !match->has_window ? CAIRN_PI : cairn_min(match->window.angle, CAIRN_PI);

    if (half >= CAIRN_PI) {
        v->rotations = cairn_real_to_int(cairn_ceil(2 * CAIRN_PI / step));
        v->angle_step = 2 * CAIRN_PI / (cairn_real)v->rotations;
        v->first_angle = 0;
    } else {
        v->rotations = 2 * cairn_real_to_int(cairn_ceil(half / step)) + 1;
        v->angle_step = v->rotations > 1 ? 2 * half / (cairn_real)(v->rotations - 1) : 0;
        v->first_angle = match->start.theta - half;
    }
}

void cairn_scan_match_clear_votes(cairn_scan_match *match)
{
    for (int32_t i = 0; i < match->votes.touched_count; i++)
        match->votes.cell[match->votes.touched[i]] = 0;
    match->votes.touched_count = 0;
}

void cairn_scan_match_votes_begin(cairn_scan_match *match)
{
    scan_match_accumulator *v = &match->votes;
    int32_t cells;

    place_grid(match);
    place_headings(match);
    v->rotation = v->point = v->touched_count = 0;
    cells = v->width * v->height;
    v->max_candidates = cells / 8 + v->rotations;
    v->max_candidates = v->max_candidates < match->params.max_candidates
                            ? v->max_candidates
                            : match->params.max_candidates;
    v->stride =
        (match->query.count + SCAN_MATCH_MAX_QUERY_POINTS - 1) / SCAN_MATCH_MAX_QUERY_POINTS;
    v->count_shift = match->has_window || !match->params.vote_once ? 0 : QUERY_BITS;
}

static void quantize_direction(cairn_scan_match *match, int32_t point)
{
    cairn_vec2 direction = match->query.points[point].direction;

    match->query_angle[point / match->votes.stride] =
        cairn_scan_match_quantize_angle(cairn_atan2(direction.y, direction.x));
}

/* Votes of a query point with the target points by_direction[first ... end-1]; returns the number
 * of those on the grid. A cell in which the masked bits equal `query_mark` already has its vote. */
static inline int32_t add_votes(cairn_scan_match *match, int32_t first, int32_t end, int32_t mask,
                                int32_t query_mark)
{
    scan_match_accumulator *v = &match->votes;
    const scan_match_position *at = match->by_direction;
    uint16_t *votes = v->cell, *touched = v->touched;
    uint32_t left = (uint32_t)v->corner.x, low = (uint32_t)v->corner.y, row = (uint32_t)v->width;
    uint32_t width = row * SCAN_MATCH_CELL_STEPS,
             height = (uint32_t)v->height * SCAN_MATCH_CELL_STEPS;
    int32_t count = v->touched_count, hits = 0;

    for (int32_t i = first; i < end; i++) {
        uint32_t dx = (uint32_t)at[i].x - left, dy = (uint32_t)at[i].y - low, cell;
        int32_t before;

        if (dx >= width || dy >= height)
            continue;
        cell = dy / SCAN_MATCH_CELL_STEPS * row + dx / SCAN_MATCH_CELL_STEPS;
        before = votes[cell];
        hits++;
        if (before == 0)
            touched[count++] = (uint16_t)cell;
        else if ((before & mask) == query_mark)
            continue;
        if ((before | mask) < UINT16_MAX)
            votes[cell] = (uint16_t)(((before | mask) + 1) | (query_mark & mask));
    }
    v->touched_count = count;
    return hits;
}

/* Rotates the query: the next heading. */
static void turn_query(cairn_scan_match *match)
{
    scan_match_accumulator *v = &match->votes;
    cairn_pose turn = {0, 0, v->first_angle + (cairn_real)v->rotation * v->angle_step};

    v->rotation_transform = cairn_transform_of(turn);
    v->quantized_heading = cairn_scan_match_quantize_angle(cairn_wrap_angle(turn.theta));
}

/* Finds the target points of the direction of a query point that put the query's origin into the
 * grid: ranges of by_direction, those of neighbouring directions joined. */
static void find_ranges(cairn_scan_match *match)
{
    scan_match_accumulator *v = &match->votes;
    int32_t bin, first, last;
    scan_match_position opposite;

    v->corner = cairn_scan_match_quantize(
        match, cairn_vec2_add(cairn_transform_point(v->rotation_transform,
                                                    match->query.points[v->point].position),
                              v->origin));
    opposite.x = v->corner.x + v->width * SCAN_MATCH_CELL_STEPS;
    opposite.y = v->corner.y + v->height * SCAN_MATCH_CELL_STEPS;
    first = cairn_scan_match_strip(match, v->corner);
    last = cairn_scan_match_strip(match, opposite);
    bin = cairn_scan_match_angle_bin(
              (uint16_t)(match->query_angle[v->point / v->stride] + v->quantized_heading)) +
          SCAN_MATCH_DIRECTION_BINS - SCAN_MATCH_AGREEING_BINS / 2;
    v->range_count = v->pair_count = 0;
    for (int32_t k = 0; k < SCAN_MATCH_AGREEING_BINS; k++, bin++) {
        const int32_t *start =
            &match->direction_start[bin % SCAN_MATCH_DIRECTION_BINS * SCAN_MATCH_STRIPS];
        int32_t end = start[last + 1];

        if (v->range_count == 0 || start[first] != v->ranges[v->range_count - 1].end)
            v->ranges[v->range_count++].first = start[first];
        v->ranges[v->range_count - 1].end = end;
        v->pair_count += end - start[first];
    }
}

/* Parts of a unit that the votes of a query point cost, when all of them are on the grid. */
static int32_t vote_parts(const scan_match_accumulator *v)
{
    return PARTS_PER_RANGE * v->range_count + PARTS_PER_TWO_PAIRS * v->pair_count / 2 +
           PARTS_PER_HIT * v->pair_count;
}

/* The query point votes with all target points of its ranges. */
static CAIRN_STEP_NOT_INLINED void add_votes_of_point(cairn_scan_match *match)
{
    scan_match_accumulator *v = &match->votes;
    int32_t hits = 0;

    for (int32_t k = 0; k < v->range_count; k++)
        hits += v->count_shift == 0
                    ? add_votes(match, v->ranges[k].first, v->ranges[k].end, 0, NO_QUERY)
                    : add_votes(match, v->ranges[k].first, v->ranges[k].end, QUERY_MASK,
                                v->point / v->stride);
    match->parts_ahead += PARTS_PER_HIT * (v->pair_count - hits);
}

static int32_t votes_at(const scan_match_accumulator *accumulator, int32_t column, int32_t row)
{
    return column < accumulator->width && row < accumulator->height
               ? accumulator->cell[row * accumulator->width + column] >> accumulator->count_shift
               : 0;
}

/* Returns the votes of two by two cells, (column, row) the lower left one. */
static int32_t block_votes(const scan_match_accumulator *accumulator, int32_t column, int32_t row)
{
    return votes_at(accumulator, column, row) + votes_at(accumulator, column + 1, row) +
           votes_at(accumulator, column, row + 1) + votes_at(accumulator, column + 1, row + 1);
}

/* Returns 1 when a cell has more votes than its neighbours; adds the cost to *parts. */
static int32_t is_peak(const scan_match_accumulator *v, int32_t column, int32_t row, int32_t own,
                       int32_t *parts)
{
    for (int32_t dy = -1; dy <= 1; dy++)
        for (int32_t dx = -1; dx <= 1; dx++) {
            int32_t c = column + dx, r = row + dy, other;

            if ((dx == 0 && dy == 0) || c < 0 || r < 0 || c >= v->width || r >= v->height)
                continue;
            other = block_votes(v, c, r);
            *parts += PARTS_PER_NEIGHBOUR;
            if (other > own || (other == own && (dy < 0 || (dy == 0 && dx < 0))))
                return 0;
        }
    return 1;
}

/* Tests a touched cell for a peak, which becomes a candidate; returns the cost, at most
 * PARTS_PER_PEAK_TEST. */
static CAIRN_STEP_NOT_INLINED int32_t test_cell(cairn_scan_match *match)
{
    scan_match_accumulator *v = &match->votes;
    int32_t cell = v->touched[v->touch], row = cell / v->width, column = cell % v->width,
            own = block_votes(v, column, row), parts = PARTS_PER_CELL;
    scan_match_candidate candidate = {.score = (cairn_real)own, .order = match->measure.candidates};

    if (match->candidate_count == v->max_candidates &&
        !cairn_scan_match_ranks_before(&candidate, &match->candidates[0]))
        return parts;
    if (!is_peak(v, column, row, own, &parts))
        return parts;
    match->measure.candidates++;
    candidate.pose.x = v->origin.x + v->cell_size * (cairn_real)(column + 1);
    candidate.pose.y = v->origin.y + v->cell_size * (cairn_real)(row + 1);
    candidate.pose.theta =
        cairn_wrap_angle(v->first_angle + (cairn_real)v->rotation * v->angle_step);
    cairn_scan_match_insert_candidate(match, &candidate, v->max_candidates);
    return parts + PARTS_PER_CANDIDATE;
}

int cairn_scan_match_vote(cairn_scan_match *match, cairn_budget *budget)
{
    scan_match_accumulator *v = &match->votes;

    CAIRN_STEP_BEGIN(match->resume.phase);
    for (v->point = 0; v->point < match->query.count; v->point += v->stride) {
        SCAN_MATCH_CHARGE(phase, PARTS_PER_DIRECTION);
        quantize_direction(match, v->point);
    }
    for (v->rotation = 0; v->rotation < v->rotations; v->rotation++) {
        turn_query(match);
        for (v->point = 0; v->point < match->query.count; v->point += v->stride) {
            SCAN_MATCH_CHARGE(phase, PARTS_PER_ROTATION);
            find_ranges(match);
            SCAN_MATCH_CHARGE(phase, vote_parts(v));
            add_votes_of_point(match);
        }
        for (v->touch = 0; v->touch < v->touched_count; v->touch++) {
            SCAN_MATCH_CHARGE(phase, PARTS_PER_PEAK_TEST);
            match->parts_ahead += PARTS_PER_PEAK_TEST - test_cell(match);
        }
        SCAN_MATCH_CHARGE(phase, v->touched_count / CELLS_CLEARED_PER_PART);
        cairn_scan_match_clear_votes(match);
    }
    SCAN_MATCH_CHARGE(phase, PARTS_PER_SORTED * match->candidate_count);
    cairn_scan_match_sort_candidates(match);
    CAIRN_STEP_END(match->resume.phase);
}
