/* aligner: joint translations of groups of scans along the directions of the walls.
 *
 * Method: parts of a building that share no wall across a direction may lie off along it, where
 * little but free-space violations shows it. A group that is moved alone loses the neighbours that
 * ought to move with it; so the group is found as a minimum cut.
 * 1. The main direction of all segments, and the one across it.
 * 2. For each shift along a direction: which scans move by it? A pair of scans of which one moves
 *    gains the difference of its log-likelihood ratios; a scan that moves gains that of the prior of
 *    its initial pose. The best set is a minimum cut (min_cut.h); a pair whose gains one way exceed
 *    its losses the other way keeps the greater gain alone, so that the problem is one.
 * 3. Pairs with evidence against them are evaluated at once. The others are taken to lose their
 *    points on surfaces across the direction, and evaluated when a cut passes through them; then
 *    the cut is found again, until all its pairs are evaluated.
 * 4. The set moves when its gain exceeds a threshold, then the next shift is tried.
 * The joint solution that follows keeps what it does not observe near these poses.
 * Limits: with more pairs of scans than the memory of the hypotheses holds, nothing is moved.
 * Source: moves by minimum cuts after Boykov, Veksler and Zabih 2001; the truncation of terms that
 * are not submodular after Rother et al. 2005. */
#include "src/base/build.h"

#include <string.h>

#include "src/alignment/aligner_work.h"

/* m: gate of the points on the same surface, narrower than that of a merge: a wider one rewards
 * shifts of its own width */
static const cairn_real SHIFT_GATE_M = CAIRN_REAL(0.04);
/* m: step between shifts */
static const cairn_real SHIFT_STEP_M = CAIRN_REAL(0.05);
/* nats: least evidence against a pair that is evaluated at once */
static const cairn_real MIN_VIOLATION_NATS = CAIRN_REAL(0.9);
/* nats: least gain of a move */
static const cairn_real MIN_GAIN_NATS = 5;
/* nats: evidence against a pair counts up to this */
static const cairn_real MOST_NATS = CAIRN_REAL(1e6);

/* Shifts of one direction: steps to both sides, the shorter ones first. */
enum { SHIFTS = 6 };
/* Passes over the shifts of a direction, the next only after a move; cuts of one shift. */
enum { MAX_ROUNDS = 2, MAX_CUTS = 4 };
/* Segments, scans and pairs of which a few fields are read or set. */
enum { SEGMENTS_PER_UNIT = 8, SCANS_PER_UNIT = 8, PAIRS_PER_UNIT = 8 };

/* ---- Directions ---- */

/* Halves the angle of a unit vector. */
static cairn_vec2 half_angle(cairn_vec2 v)
{
    cairn_vec2 half = {cairn_sqrt(cairn_max(1 + v.x, 0) / 2),
                       cairn_sqrt(cairn_max(1 - v.x, 0) / 2)};

    if (v.y < 0)
        half.y = -half.y;
    return half;
}

static cairn_vec2 squared(cairn_vec2 v)
{
    cairn_vec2 square = {v.x * v.x - v.y * v.y, 2 * v.x * v.y};

    return square;
}

/* Returns the main direction of the segments modulo a right angle: the mean of their fourth powers
 * as complex numbers. */
static cairn_vec2 main_direction(const cairn_aligner *aligner)
{
    cairn_vec2 sum = {0, 0}, x_axis = {1, 0};

    for (int32_t k = 0; k < aligner->segment_count; k++) {
        const aligner_segment *s = &aligner->segments[k];
        cairn_vec2 way;

        if (s->is_short || aligner->scans[s->scan].cluster != aligner->move.home)
            continue;
        way = squared(squared(cairn_transform_direction(aligner->poses[s->scan], s->direction)));
        sum = cairn_vec2_add(sum, cairn_vec2_scale(way, s->length));
    }
    if (!(cairn_vec2_norm_squared(sum) > 0))
        return x_axis;
    return half_angle(half_angle(cairn_vec2_unit(sum)));
}

static cairn_vec2 direction_of(const aligner_shift *shift)
{
    return shift->direction == 0 ? shift->axis : cairn_vec2_left_perp(shift->axis);
}

/* ---- Pairs ---- */

/* Starts the count of a pair, of which one scan is moved: ends[side], or none at side -1. */
static void begin_count(cairn_aligner *aligner, int side)
{
    aligner_shift *shift = &aligner->shift;
    const min_cut_edge *edge = &aligner->shift_edges[shift->pair];
    cairn_transform pose[2] = {aligner->poses[edge->ends[0]], aligner->poses[edge->ends[1]]};

    if (side >= 0) {
        cairn_vec2 way = direction_of(shift);

        pose[side].x += shift->metres * way.x;
        pose[side].y += shift->metres * way.y;
    }
    memset(&shift->count, 0, sizeof shift->count);
    cairn_aligner_begin_count(aligner, &aligner->walk, edge->ends[0], edge->ends[1],
                              cairn_transform_between(pose[1], pose[0]), SHIFT_GATE_M,
                              &shift->count);
    cairn_aligner_split_count(&aligner->walk,
                              cairn_transform_inverse_direction(pose[1], shift->axis));
}

/* Returns the log-likelihood ratio of a count; finite for any penalty. */
static cairn_real ratio_of(const cairn_aligner *aligner, aligner_count count)
{
    return cairn_max(cairn_aligner_log_likelihood_ratio(aligner, count), -MOST_NATS);
}

/* Keeps the count of a pair at the current poses. */
static void keep_base(cairn_aligner *aligner)
{
    aligner_shift_pair *pair = &aligner->shift_pairs[aligner->shift.pair];
    aligner_count count = aligner->shift.count, across = {.same_surface = count.across};

    pair->base = ratio_of(aligner, count);
    pair->across[0] = ratio_of(aligner, across);
    across.same_surface = count.same_surface - count.across;
    pair->across[1] = ratio_of(aligner, across);
    count.same_surface = 0;
    pair->has_violation = cairn_aligner_log_likelihood_ratio(aligner, count) < -MIN_VIOLATION_NATS;
}

/* Adds the pair of the current scan and its current neighbour, each pair once; returns 0 when they
 * cannot overlap. */
static int add_pair(cairn_aligner *aligner)
{
    aligner_shift *shift = &aligner->shift;
    int32_t i = aligner->cursor.scan,
            j = cairn_aligner_neighbour(aligner, i, aligner->cursor.neighbour);

    if (j > i || aligner->scans[i].cluster != aligner->move.home ||
        aligner->scans[j].cluster != aligner->move.home ||
        !cairn_aligner_may_overlap(aligner, i, j, aligner->poses[i], aligner->poses[j]))
        return 0;
    shift->is_full = shift->is_full || shift->pair_count == shift->max_pairs;
    if (shift->is_full)
        return 0;
    shift->pair = shift->pair_count++;
    min_cut_link(&shift->cut, shift->pair, i, j);
    begin_count(aligner, -1);
    return 1;
}

static void begin_shifts(cairn_aligner *aligner)
{
    cairn_transform map_gauge =
        cairn_transform_inverse(cairn_aligner_gauge(aligner, aligner->move.home));
    aligner_shift *shift = &aligner->shift;

    shift->pair_count = shift->is_full = 0;
    shift->axis = main_direction(aligner);
    min_cut_clear(&shift->cut, aligner->shift_nodes, aligner->shift_edges, aligner->scan_count);
    for (int32_t i = 0; i < aligner->scan_count; i++) {
        cairn_transform expected =
            cairn_transform_compose(map_gauge, cairn_transform_of(aligner->scans[i].initial));

        aligner->scans[i].initial_offset.x = expected.x - aligner->poses[i].x;
        aligner->scans[i].initial_offset.y = expected.y - aligner->poses[i].y;
    }
}

/* ---- One shift ---- */

static void begin_shift(cairn_aligner *aligner)
{
    aligner_shift *shift = &aligner->shift;
    int32_t steps = shift->index / 2 + 1;

    shift->metres = SHIFT_STEP_M * (cairn_real)steps;
    if (shift->index % 2 == 0)
        shift->metres = -shift->metres;
    shift->is_move = 0;
    for (int32_t k = 0; k < shift->pair_count; k++) {
        aligner_shift_pair *pair = &aligner->shift_pairs[k];

        pair->gain[0] = pair->gain[1] = -pair->across[shift->direction];
        pair->is_known[0] = pair->is_known[1] = 0;
    }
}

static void keep_gain(cairn_aligner *aligner, int32_t side)
{
    aligner_shift_pair *pair = &aligner->shift_pairs[aligner->shift.pair];

    pair->gain[side] = ratio_of(aligner, aligner->shift.count) - pair->base;
    pair->is_known[side] = 1;
}

/* Returns the gain of a scan's prior when it moves, nats. */
static cairn_real prior_gain(const cairn_aligner *aligner, int32_t i)
{
    const aligner_shift *shift = &aligner->shift;
    cairn_real off = cairn_vec2_dot(aligner->scans[i].initial_offset, direction_of(shift));

    return shift->metres * (off - shift->metres / 2) / (aligner->sigma * aligner->sigma);
}

/* Sets the capacities of an edge, and adds those of its nodes. */
static void set_capacities(cairn_aligner *aligner, int32_t k)
{
    min_cut_edge *edge = &aligner->shift_edges[k];
    const cairn_real *gain = aligner->shift_pairs[k].gain;
    int better = gain[1] > gain[0];
    cairn_real most = gain[better], other = cairn_min(gain[!better], -most);

    if (most <= 0) {
        edge->capacity[0] = -gain[0];
        edge->capacity[1] = -gain[1];
        return;
    }
    aligner->shift_nodes[edge->ends[better]].capacity += most;
    aligner->shift_nodes[edge->ends[!better]].capacity -= most;
    edge->capacity[better] = 0;
    edge->capacity[!better] = -most - other;
}

/* Sets all capacities; returns 0 when no set of scans can gain enough. */
static int set_all_capacities(cairn_aligner *aligner)
{
    cairn_real sum = 0;

    for (int32_t i = 0; i < aligner->scan_count; i++)
        aligner->shift_nodes[i].capacity =
            aligner->scans[i].cluster == aligner->move.home ? prior_gain(aligner, i) : 0;
    for (int32_t k = 0; k < aligner->shift.pair_count; k++)
        set_capacities(aligner, k);
    for (int32_t i = 0; i < aligner->scan_count; i++)
        sum += cairn_max(aligner->shift_nodes[i].capacity, 0);
    return sum >= MIN_GAIN_NATS;
}

/* Returns the end of a pair that moves alone, -1: both or none. */
static int32_t moving_end(const cairn_aligner *aligner, int32_t k)
{
    const uint16_t *ends = aligner->shift_edges[k].ends;
    int first = min_cut_is_with_source(&aligner->shift.cut, ends[0]);

    if (first == min_cut_is_with_source(&aligner->shift.cut, ends[1]))
        return -1;
    return !first;
}

/* Returns 1 when the set of the cut gains enough. */
static int is_gain(const cairn_aligner *aligner)
{
    cairn_real gain = 0;

    for (int32_t i = 0; i < aligner->scan_count; i++)
        if (min_cut_is_with_source(&aligner->shift.cut, i))
            gain += prior_gain(aligner, i);
    for (int32_t k = 0; k < aligner->shift.pair_count; k++)
        if (moving_end(aligner, k) >= 0)
            gain += aligner->shift_pairs[k].gain[moving_end(aligner, k)];
    return gain >= MIN_GAIN_NATS;
}

/* Step: runs the minimum cut that has begun. */
static int run_cut(cairn_aligner *aligner, cairn_budget *budget)
{
    return min_cut_step(&aligner->shift.cut, budget, &aligner->units_charged);
}

/* Starts the count of the current pair when the cut passes through it, and it is not evaluated. */
static int begin_cut_pair(cairn_aligner *aligner)
{
    aligner_shift *shift = &aligner->shift;

    shift->side = moving_end(aligner, shift->pair);
    if (shift->side < 0 || aligner->shift_pairs[shift->pair].is_known[shift->side])
        return 0;
    shift->unknown++;
    begin_count(aligner, shift->side);
    return 1;
}

static int walk_pair(cairn_aligner *aligner, cairn_budget *budget)
{
    return cairn_aligner_walk_pair(aligner, &aligner->walk, budget);
}

/* Step: finds the set that gains most by the current shift; is_move: it gains enough. */
static int find_set(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_shift *shift = &aligner->shift;

    CAIRN_STEP_BEGIN(aligner->resume.item);
    ALIGNER_CHARGE(item, 1 + shift->pair_count / PAIRS_PER_UNIT);
    begin_shift(aligner);
    for (shift->pair = 0; shift->pair < shift->pair_count; shift->pair++)
        for (shift->side = 0; shift->side < 2 && aligner->shift_pairs[shift->pair].has_violation;
             shift->side++) {
            begin_count(aligner, shift->side);
            CAIRN_STEP_RUN(aligner, resume.item, budget, walk_pair);
            keep_gain(aligner, shift->side);
        }
    for (shift->cuts = 0; shift->cuts < MAX_CUTS && !shift->is_move; shift->cuts++) {
        ALIGNER_CHARGE(item, 1 + (shift->pair_count + aligner->scan_count) / PAIRS_PER_UNIT);
        if (!set_all_capacities(aligner))
            break;
        CAIRN_STEP_RUN(aligner, resume.item, budget, run_cut);
        ALIGNER_CHARGE(item, 1 + (shift->pair_count + aligner->scan_count) / PAIRS_PER_UNIT);
        if (!is_gain(aligner))
            break;
        shift->unknown = 0;
        for (shift->pair = 0; shift->pair < shift->pair_count; shift->pair++) {
            if (!begin_cut_pair(aligner))
                continue;
            CAIRN_STEP_RUN(aligner, resume.item, budget, walk_pair);
            keep_gain(aligner, shift->side);
        }
        shift->is_move = shift->unknown == 0;
    }
    CAIRN_STEP_END(aligner->resume.item);
}

/* Moves the set. */
static void move_set(cairn_aligner *aligner)
{
    aligner_shift *shift = &aligner->shift;
    cairn_vec2 motion = cairn_vec2_scale(direction_of(shift), shift->metres);

    for (int32_t i = 0; i < aligner->scan_count; i++) {
        aligner_scan *scan = &aligner->scans[i];

        if (!min_cut_is_with_source(&shift->cut, i))
            continue;
        aligner->poses[i].x += motion.x;
        aligner->poses[i].y += motion.y;
        scan->initial_offset = cairn_vec2_sub(scan->initial_offset, motion);
        aligner->changed_scans++;
    }
    aligner->clusters[aligner->move.home].stamp = ++aligner->change_count;
    shift->has_gained = 1;
}

/* Step: moves the set that was found, and counts its pairs with the others anew. */
static int move(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_shift *shift = &aligner->shift;

    CAIRN_STEP_BEGIN(aligner->resume.item);
    ALIGNER_CHARGE(item,
                   1 + aligner->scan_count / SCANS_PER_UNIT + shift->pair_count / PAIRS_PER_UNIT);
    move_set(aligner);
    for (shift->pair = 0; shift->pair < shift->pair_count; shift->pair++) {
        if (moving_end(aligner, shift->pair) < 0)
            continue;
        begin_count(aligner, -1);
        CAIRN_STEP_RUN(aligner, resume.item, budget, walk_pair);
        keep_base(aligner);
    }
    CAIRN_STEP_END(aligner->resume.item);
}

int cairn_aligner_shift(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_shift *shift = &aligner->shift;
    aligner_cursor *cursor = &aligner->cursor;

    CAIRN_STEP_BEGIN(aligner->resume.part);
    ALIGNER_CHARGE(part, 1 + aligner->segment_count / SEGMENTS_PER_UNIT + aligner->scan_count);
    begin_shifts(aligner);
    for (cursor->scan = 0; cursor->scan < aligner->scan_count; cursor->scan++) {
        ALIGNER_CHARGE(part, cairn_aligner_passing_units(aligner, cursor->scan));
        for (cursor->neighbour = 0;
             cursor->neighbour < aligner->scans[cursor->scan].neighbour_count;
             cursor->neighbour++) {
            if (!add_pair(aligner))
                continue;
            CAIRN_STEP_RUN(aligner, resume.part, budget, walk_pair);
            keep_base(aligner);
        }
    }
    for (shift->direction = 0; shift->direction < 2 && !shift->is_full; shift->direction++) {
        shift->has_gained = 1;
        for (shift->round = 0; shift->round < MAX_ROUNDS && shift->has_gained; shift->round++) {
            shift->has_gained = 0;
            for (shift->index = 0; shift->index < SHIFTS; shift->index++) {
                CAIRN_STEP_RUN(aligner, resume.part, budget, find_set);
                if (shift->is_move)
                    CAIRN_STEP_RUN(aligner, resume.part, budget, move);
            }
        }
    }
    CAIRN_STEP_END(aligner->resume.part);
}
