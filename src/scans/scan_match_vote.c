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
    AGREEING_BINS = 3, /* direction bins to both sides that agree */
    MARGIN_CELLS = 5,  /* cells of the grid about its window */
    QUERY_BITS = 8,    /* MAX_QUERY_POINTS fit */
    QUERY_MASK = (1 << QUERY_BITS) - 1,
    NO_QUERY = -1
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

void cairn_scan_match_votes_begin(cairn_scan_match *match)
{
    scan_match_accumulator *v = &match->votes;
    int32_t cells;

    place_grid(match);
    place_headings(match);
    v->rotation = 0;
    v->touched_count = 0;
    cells = v->width * v->height;
    v->max_candidates = cells / 8 + v->rotations;
    v->max_candidates = v->max_candidates < match->params.max_candidates
                            ? v->max_candidates
                            : match->params.max_candidates;
    v->stride =
        (match->query.count + SCAN_MATCH_MAX_QUERY_POINTS - 1) / SCAN_MATCH_MAX_QUERY_POINTS;
    v->count_shift = match->has_window || !match->params.vote_once ? 0 : QUERY_BITS;
    for (int32_t i = 0; i < match->query.count; i += v->stride) {
        cairn_vec2 direction = match->query.points[i].direction;

        match->query_angle[i / v->stride] =
            cairn_scan_match_quantize_angle(cairn_atan2(direction.y, direction.x));
        cairn_scan_match_charge(match, 12);
    }
}

/* Votes of a query point with the target points by_direction[first ... end-1]; `corner` is the
 * grid's corner relative to it. A cell in which the masked bits equal `query_mark` already has its
 * vote. */
static inline void add_votes(cairn_scan_match *match, scan_match_position corner, int32_t first,
                             int32_t end, int32_t mask, int32_t query_mark)
{
    scan_match_accumulator *v = &match->votes;
    const scan_match_position *at = match->by_direction;
    uint16_t *votes = v->cell, *touched = v->touched;
    uint32_t left = (uint32_t)corner.x, low = (uint32_t)corner.y, row = (uint32_t)v->width;
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
    cairn_scan_match_charge(match, 3 + (end - first) * 3 / 2 + hits);
}

static void add_votes_of_point(cairn_scan_match *match, scan_match_position corner, int32_t first,
                               int32_t end)
{
    if (match->votes.count_shift == 0)
        add_votes(match, corner, first, end, 0, NO_QUERY);
    else
        add_votes(match, corner, first, end, QUERY_MASK,
                  match->index_in_phase / match->votes.stride);
}

/* One query point votes with all target points of equal direction that put the query's origin into
 * the grid. */
int32_t cairn_scan_match_vote_item(cairn_scan_match *match)
{
    scan_match_accumulator *v = &match->votes;
    int32_t bin, first, last, from = 0, end = 0;
    scan_match_position corner, opposite;

    if (match->index_in_phase == 0) {
        cairn_pose turn = {0, 0, v->first_angle + (cairn_real)v->rotation * v->angle_step};

        v->rotation_transform = cairn_transform_of(turn);
        v->quantized_heading = cairn_scan_match_quantize_angle(cairn_wrap_angle(turn.theta));
    }
    corner = cairn_scan_match_quantize(
        match,
        cairn_vec2_add(cairn_transform_point(v->rotation_transform,
                                             match->query.points[match->index_in_phase].position),
                       v->origin));
    opposite.x = corner.x + v->width * SCAN_MATCH_CELL_STEPS;
    opposite.y = corner.y + v->height * SCAN_MATCH_CELL_STEPS;
    first = cairn_scan_match_strip(match, corner);
    last = cairn_scan_match_strip(match, opposite);
    bin = cairn_scan_match_angle_bin(
              (uint16_t)(match->query_angle[match->index_in_phase / v->stride] +
                         v->quantized_heading)) +
          SCAN_MATCH_DIRECTION_BINS - AGREEING_BINS;
    for (int32_t k = 0; k <= 2 * AGREEING_BINS; k++, bin++) {
        const int32_t *start =
            &match->direction_start[bin % SCAN_MATCH_DIRECTION_BINS * SCAN_MATCH_STRIPS];

        if (start[first] != end) {
            add_votes_of_point(match, corner, from, end);
            from = start[first];
        }
        end = start[last + 1];
    }
    add_votes_of_point(match, corner, from, end);
    cairn_scan_match_charge(match, 16);
    match->index_in_phase += v->stride;
    return match->index_in_phase >= match->query.count;
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

static int32_t is_peak(cairn_scan_match *match, int32_t column, int32_t row, int32_t own)
{
    const scan_match_accumulator *v = &match->votes;

    for (int32_t dy = -1; dy <= 1; dy++)
        for (int32_t dx = -1; dx <= 1; dx++) {
            int32_t c = column + dx, r = row + dy, other;

            if ((dx == 0 && dy == 0) || c < 0 || r < 0 || c >= v->width || r >= v->height)
                continue;
            other = block_votes(v, c, r);
            cairn_scan_match_charge(match, 9);
            if (other > own || (other == own && (dy < 0 || (dy == 0 && dx < 0))))
                return 0;
        }
    return 1;
}

/* Tests one touched cell for a peak; clears all touched cells at the end. */
int32_t cairn_scan_match_peak_item(cairn_scan_match *match)
{
    scan_match_accumulator *v = &match->votes;
    scan_match_candidate candidate;
    int32_t cell, row, column, own;

    if (match->index_in_phase == v->touched_count) {
        for (int32_t i = 0; i < v->touched_count; i++)
            v->cell[v->touched[i]] = 0;
        cairn_scan_match_charge(match, v->touched_count / 2);
        v->touched_count = 0;
        v->rotation++;
        return 1;
    }
    cell = v->touched[match->index_in_phase++];
    row = cell / v->width;
    column = cell % v->width;
    own = block_votes(v, column, row);
    cairn_scan_match_charge(match, 8);
    candidate.score = (cairn_real)own;
    candidate.order = match->measure.candidates;
    if (match->candidate_count == v->max_candidates &&
        !cairn_scan_match_ranks_before(&candidate, &match->candidates[0]))
        return 0;
    if (!is_peak(match, column, row, own))
        return 0;
    cairn_scan_match_charge(match, 24);
    match->measure.candidates++;
    candidate.pose.x = v->origin.x + v->cell_size * (cairn_real)(column + 1);
    candidate.pose.y = v->origin.y + v->cell_size * (cairn_real)(row + 1);
    candidate.pose.theta =
        cairn_wrap_angle(v->first_angle + (cairn_real)v->rotation * v->angle_step);
    cairn_scan_match_insert_candidate(match, &candidate, v->max_candidates);
    return 0;
}
