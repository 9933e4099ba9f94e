/* Where could the query's origin be? Every pair of a query point and a target point of like
 * direction votes.
 *
 * The correlation of two sparse sets of oriented points, for all positions at once: for each
 * heading of the window, a query point turned by it and a target point whose direction agrees name
 * the position that would bring them together. The votes of a cell are the correlation there,
 * summed over the pairs that exist instead of over all cells of the plane, and nothing is pruned.
 * Peaks (local maxima of two by two cells) compete over all headings for a fixed number of places.
 *
 * A wall that many parts of the target saw has as many points at each of its places. In a search of
 * everything a query point therefore votes for a cell once (params.once): its vote says that it is
 * explained there. Else the poses where the target was seen most often would take all places, and
 * of two equal rooms the one seen less would not be looked at.
 *
 * Layout: of a cell the votes, or votes << 8 | number of the query point that voted last. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/scan_match_work.h"

enum {
    DIRECTION_REACH = 3, /* bins to both sides that agree */
    MARGIN_CELLS = 5,    /* of the grid about its window */
    VOTER_BITS = 8,      /* MATCH_VOTERS fit */
    VOTER_MASK = (1 << VOTER_BITS) - 1,
    NOBODY = -1
};

static const cairn_real LEAST_STEP = CAIRN_REAL(0.04), MOST_STEP = CAIRN_REAL(0.088);

int32_t cairn_scan_match_cells(cairn_real distance, cairn_real spacing)
{
    int32_t side = MATCH_SIDE_MOST;

    if (!(distance >= 0) || !(spacing > 0))
        return MATCH_CELLS_LEAST;
    if (distance < MATCH_SIDE_MOST * spacing)
        side = cairn_real_to_int(2 * distance / (MATCH_CELL * spacing)) + MARGIN_CELLS + 1;
    return side < MATCH_SIDE_MOST ? side * side : MATCH_CELLS_MOST;
}

/* The translations of the window: about the start, or all that can bring the query to the
 * target. */
static void place_grid(cairn_scan_match *x)
{
    match_votes *v = &x->votes;
    int32_t side = cairn_real_to_int(cairn_sqrt((cairn_real)x->params.max_cells));
    cairn_real most = (cairn_real)side * MATCH_CELL * x->params.spacing;
    cairn_vec2 low, high;

    if (!x->has_window) {
        cairn_real reach = x->query_reach, n = (cairn_real)x->target_count;
        cairn_vec2 centre = {x->target_sum.x / n, x->target_sum.y / n};

        low.x = cairn_max(x->target_low.x - reach, centre.x - most / 2);
        low.y = cairn_max(x->target_low.y - reach, centre.y - most / 2);
        high.x = cairn_min(x->target_high.x + reach, centre.x + most / 2);
        high.y = cairn_min(x->target_high.y + reach, centre.y + most / 2);
    } else {
        cairn_real half = cairn_min(x->window.distance, most / 2);

        low.x = x->start.x - half;
        low.y = x->start.y - half;
        high.x = x->start.x + half;
        high.y = x->start.y + half;
    }
    v->side = MATCH_CELL * x->params.spacing;
    v->origin.x = low.x - 2 * v->side;
    v->origin.y = low.y - 2 * v->side;
    v->width = cairn_real_to_int((high.x - low.x) / v->side) + MARGIN_CELLS;
    v->height = cairn_real_to_int((high.y - low.y) / v->side) + MARGIN_CELLS;
    v->width = v->width < side ? v->width : side;
    v->height = v->height < side ? v->height : side;
}

static void place_headings(cairn_scan_match *x)
{
    match_votes *v = &x->votes;
    cairn_real step = cairn_min(cairn_max(2 * v->side / x->radius, LEAST_STEP), MOST_STEP);
    cairn_real half = !x->has_window ? CAIRN_PI : cairn_min(x->window.angle, CAIRN_PI);

    if (half >= CAIRN_PI) {
        v->rotations = cairn_real_to_int(cairn_ceil(2 * CAIRN_PI / step));
        v->angle_step = 2 * CAIRN_PI / (cairn_real)v->rotations;
        v->first_angle = 0;
    } else {
        v->rotations = 2 * cairn_real_to_int(cairn_ceil(half / step)) + 1;
        v->angle_step = v->rotations > 1 ? 2 * half / (cairn_real)(v->rotations - 1) : 0;
        v->first_angle = x->start.theta - half;
    }
}

void cairn_match_votes_begin(cairn_scan_match *x)
{
    match_votes *v = &x->votes;
    int32_t cells;

    place_grid(x);
    place_headings(x);
    v->rotation = 0;
    v->touched_count = 0;
    cells = v->width * v->height;
    v->most = cells / 8 + v->rotations;
    v->most = v->most < x->params.max_candidates ? v->most : x->params.max_candidates;
    v->stride = (x->query.count + MATCH_VOTERS - 1) / MATCH_VOTERS;
    v->shift = x->has_window || !x->params.once ? 0 : VOTER_BITS;
    for (int32_t i = 0; i < x->query.count; i += v->stride) {
        cairn_vec2 direction = x->query.points[i].direction;

        x->query_turn[i / v->stride] = cairn_match_turn(cairn_atan2(direction.y, direction.x));
        cairn_match_charge(x, 12);
    }
}

/* Votes of a query point, of which the grid's corner is at `corner`, with the target points
 * by_direction[first ... end-1]; where the bits of the mask name the voter, it has voted. */
static inline void vote_unless(cairn_scan_match *x, match_spot corner, int32_t first, int32_t end,
                               int32_t mask, int32_t voter)
{
    match_votes *v = &x->votes;
    const match_spot *at = x->by_direction;
    uint16_t *votes = v->cell, *touched = v->touched;
    uint32_t left = (uint32_t)corner.x, low = (uint32_t)corner.y, row = (uint32_t)v->width;
    uint32_t width = row * MATCH_SPOTS, height = (uint32_t)v->height * MATCH_SPOTS;
    int32_t count = v->touched_count, hits = 0;

    for (int32_t i = first; i < end; i++) {
        uint32_t dx = (uint32_t)at[i].x - left, dy = (uint32_t)at[i].y - low, cell;
        int32_t before;

        if (dx >= width || dy >= height)
            continue;
        cell = dy / MATCH_SPOTS * row + dx / MATCH_SPOTS;
        before = votes[cell];
        hits++;
        if (before == 0)
            touched[count++] = (uint16_t)cell;
        else if ((before & mask) == voter)
            continue;
        if ((before | mask) < UINT16_MAX)
            votes[cell] = (uint16_t)(((before | mask) + 1) | (voter & mask));
    }
    v->touched_count = count;
    cairn_match_charge(x, 3 + (end - first) * 3 / 2 + hits);
}

static void vote(cairn_scan_match *x, match_spot corner, int32_t first, int32_t end)
{
    if (x->votes.shift == 0)
        vote_unless(x, corner, first, end, 0, NOBODY);
    else
        vote_unless(x, corner, first, end, VOTER_MASK, x->at / x->votes.stride);
}

/* One query point votes with all target points of like direction that bring the query's origin
 * into the grid. */
int32_t cairn_match_vote(cairn_scan_match *x)
{
    match_votes *v = &x->votes;
    int32_t bin, first, last, from = 0, end = 0;
    match_spot corner, opposite;

    if (x->at == 0) {
        cairn_pose turn = {0, 0, v->first_angle + (cairn_real)v->rotation * v->angle_step};

        v->turn = cairn_transform_of(turn);
        v->heading = cairn_match_turn(cairn_wrap_angle(turn.theta));
    }
    corner = cairn_match_spot(
        x,
        cairn_vec2_add(cairn_transform_point(v->turn, x->query.points[x->at].position), v->origin));
    opposite.x = corner.x + v->width * MATCH_SPOTS;
    opposite.y = corner.y + v->height * MATCH_SPOTS;
    first = cairn_match_column(x, corner);
    last = cairn_match_column(x, opposite);
    bin = cairn_match_turn_bin((uint16_t)(x->query_turn[x->at / v->stride] + v->heading)) +
          MATCH_DIRECTIONS - DIRECTION_REACH;
    for (int32_t k = 0; k <= 2 * DIRECTION_REACH; k++, bin++) {
        const int32_t *start = &x->direction_start[bin % MATCH_DIRECTIONS * MATCH_COLUMNS];

        if (start[first] != end) {
            vote(x, corner, from, end);
            from = start[first];
        }
        end = start[last + 1];
    }
    vote(x, corner, from, end);
    cairn_match_charge(x, 16);
    x->at += v->stride;
    return x->at >= x->query.count;
}

static int32_t votes_at(const match_votes *v, int32_t column, int32_t row)
{
    return column < v->width && row < v->height ? v->cell[row * v->width + column] >> v->shift : 0;
}

/* Votes of two by two cells, of which (column, row) is the lower left one. */
static int32_t votes_of_four(const match_votes *v, int32_t column, int32_t row)
{
    return votes_at(v, column, row) + votes_at(v, column + 1, row) + votes_at(v, column, row + 1) +
           votes_at(v, column + 1, row + 1);
}

static int32_t is_peak(cairn_scan_match *x, int32_t column, int32_t row, int32_t own)
{
    const match_votes *v = &x->votes;

    for (int32_t dy = -1; dy <= 1; dy++)
        for (int32_t dx = -1; dx <= 1; dx++) {
            int32_t c = column + dx, r = row + dy, other;

            if ((dx == 0 && dy == 0) || c < 0 || r < 0 || c >= v->width || r >= v->height)
                continue;
            other = votes_of_four(v, c, r);
            cairn_match_charge(x, 9);
            if (other > own || (other == own && (dy < 0 || (dy == 0 && dx < 0))))
                return 0;
        }
    return 1;
}

/* One touched cell; when all are through, they are cleared. */
int32_t cairn_match_peaks(cairn_scan_match *x)
{
    match_votes *v = &x->votes;
    match_candidate candidate;
    int32_t cell, row, column, own;

    if (x->at == v->touched_count) {
        for (int32_t i = 0; i < v->touched_count; i++)
            v->cell[v->touched[i]] = 0;
        cairn_match_charge(x, v->touched_count / 2);
        v->touched_count = 0;
        v->rotation++;
        return 1;
    }
    cell = v->touched[x->at++];
    row = cell / v->width;
    column = cell % v->width;
    own = votes_of_four(v, column, row);
    cairn_match_charge(x, 8);
    candidate.score = (cairn_real)own;
    candidate.order = x->measure.candidates;
    if (x->candidate_count == v->most && !cairn_match_before(&candidate, &x->candidates[0]))
        return 0;
    if (!is_peak(x, column, row, own))
        return 0;
    cairn_match_charge(x, 24);
    x->measure.candidates++;
    candidate.pose.x = v->origin.x + v->side * (cairn_real)(column + 1);
    candidate.pose.y = v->origin.y + v->side * (cairn_real)(row + 1);
    candidate.pose.theta =
        cairn_wrap_angle(v->first_angle + (cairn_real)v->rotation * v->angle_step);
    cairn_match_keep(x, &candidate, v->most);
    return 0;
}
