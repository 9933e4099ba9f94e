/* Joint refinement and verification of the particle filter's result.
 *
 * Method.
 *
 * 1. The maps of the best particle are refined by lines, in turn, each against all others.
 * 2. The log-likelihood ratios between every two of them form a weighted graph. While its minimum
 *    cut (Stoer and Wagner 1997) has less than min_score, the side without the reference is cut
 *    off.
 * 3. A map with a competing pose of nearly equal support, or with an unobservable translation along
 *    its walls, is rejected, and the others are verified again.
 * 4. Maps that are distorted move to the mean of all their walls (map_merge_average.c). */
#include "src/base/build.h"

#include <string.h>

#include "src/merging/map_merge_work.h"

/* Odds that a pose is wrong: exp(ERROR_LOG_ODDS) times the ERROR_EXPONENT-th power of the ratio of
 * competing support to support, CHANCE_NATS added to both. The ratio, not the difference, since the
 * samples of a wall are correlated. Fitted by bench/merge --fit. */
#define CHANCE_NATS    CAIRN_REAL(3.0)
#define ERROR_EXPONENT CAIRN_REAL(4.6)
#define ERROR_LOG_ODDS CAIRN_REAL(1.15)
/* minimum error probability reported: rarer errors have not been measured */
#define MIN_ERROR_PROBABILITY CAIRN_REAL(1e-3)
/* m: a translation that keeps most of the log-likelihood ratio over this distance is
 * unobservable */
#define SHIFT_M           CAIRN_REAL(0.30)
#define MAX_SHIFTED_SHARE CAIRN_REAL(0.7)

/* rounds of joint refinement; directions of the shift test */
enum { REFINE_ROUNDS = 24, SHIFT_DIRECTIONS = 8 };
/* values of a minimum cut, and states of particles that are summed, per unit */
enum { CUT_VALUES_PER_UNIT = 8, STATES_PER_UNIT = 16 };

/* Returns the state of the particle with the largest total log-likelihood ratio. */
static const void *best_of(const cairn_map_merge *merge)
{
    const void *best = NULL;
    cairn_real most = 0;

    for (int32_t i = 0; i < cairn_particle_filter_count(merge->filter); i++) {
        const void *state = cairn_particle_filter_particle(merge->filter, i).state;
        cairn_real sum = 0;

        for (const map_merge_state *s = state; s != NULL; s = cairn_particle_filter_state_before(s))
            sum += s->log_ratio;
        if (best == NULL || sum > most) {
            best = state;
            most = sum;
        }
    }
    return best;
}

/* Sets the neighbours in order of merging, but the reference first, whose frame is theirs now; the
 * reference alone when it has not been merged. */
static void begin_at_reference(cairn_map_merge *merge)
{
    cairn_pose reference = cairn_pose_identity();
    int32_t at = -1, count = 1;

    for (int32_t i = 0; i < merge->neighbours.count; i++)
        if (merge->neighbours.maps[i] == merge->reference)
            at = i;
    if (at >= 0)
        reference = merge->neighbours.poses[at];
    merge->check.list[0] = merge->reference;
    merge->check.pose[merge->reference] = cairn_pose_identity();
    for (int32_t i = merge->neighbours.count - 1; i >= 0 && at >= 0; i--)
        if (i != at) {
            merge->check.list[count++] = merge->neighbours.maps[i];
            merge->check.pose[merge->neighbours.maps[i]] =
                cairn_pose_between(reference, merge->neighbours.poses[i]);
        }
    merge->check.count = count;
}

static void begin_check(cairn_map_merge *merge)
{
    (void)cairn_map_merge_collect_neighbours(merge, best_of(merge));
    memset(&merge->check, 0, sizeof merge->check);
    memset(merge->placed, 0, sizeof merge->placed);
    for (int32_t i = 0; i < merge->map_count; i++) {
        cairn_map_merge_placed *p = &merge->placed[i];

        p->verdict = merge->maps[i].point_count == 0 || merge->maps[i].free_count == 0
                         ? CAIRN_MAP_MERGE_EMPTY
                         : CAIRN_MAP_MERGE_NO_OVERLAP;
        p->corners = merge->maps[i].corner_count;
        p->error_probability = 1;
        p->rank = -1;
    }
    begin_at_reference(merge);
    for (int32_t i = 0; i < merge->check.count; i++) {
        int32_t map = merge->check.list[i];

        merge->check.start[map] = merge->check.pose[map];
        merge->check.accepted[map] = 1;
        merge->placed[map].verdict = CAIRN_MAP_MERGE_PLACED;
        merge->placed[map].rank = i;
    }
    merge->placed[merge->reference].error_probability = 0;
}

/* Returns the units of finding the best particle, and of the maps. */
static int32_t begin_units(const cairn_map_merge *merge)
{
    int32_t states = cairn_particle_filter_count(merge->filter) * (merge->filter_step + 1);

    return 1 + merge->map_count + states / STATES_PER_UNIT;
}

/* Sets the neighbours to the accepted maps except `map`. */
static void collect_others(cairn_map_merge *merge, int32_t map)
{
    merge->neighbours.count = 0;
    for (int32_t i = 0; i < merge->check.count; i++) {
        int32_t other = merge->check.list[i];

        if (other == map || !merge->check.accepted[other])
            continue;
        merge->neighbours.maps[merge->neighbours.count] = other;
        merge->neighbours.poses[merge->neighbours.count++] = merge->check.pose[other];
    }
}

/* ---- Joint refinement ---- */

static int32_t map_at(const cairn_map_merge *merge, int32_t index)
{
    return merge->check.list[index];
}

/* Begins to refine the current map against all others. */
static void begin_move(cairn_map_merge *merge)
{
    int32_t map = map_at(merge, merge->check.current);

    collect_others(merge, map);
    cairn_map_merge_begin_fit(merge, map, merge->check.start[map], merge->check.pose[map], 1);
}

/* Step: refines every map in turn against all others. */
static int refine_jointly(cairn_map_merge *merge, cairn_budget *budget)
{
    map_merge_verification *check = &merge->check;

    CAIRN_STEP_BEGIN(merge->resume.phase);
    for (check->round = 0; check->round < REFINE_ROUNDS; check->round++)
        for (check->current = 1; check->current < check->count; check->current++) {
            begin_move(merge);
            CAIRN_STEP_RUN(merge, resume.phase, budget, cairn_map_merge_step_lines);
            check->pose[map_at(merge, check->current)] = merge->fit.pose;
        }
    CAIRN_STEP_END(merge->resume.phase);
}

/* ---- Scores of pairs ---- */

/* Begins to score the current pair. */
static void begin_pair(cairn_map_merge *merge)
{
    int32_t first = map_at(merge, merge->check.pair.first),
            second = map_at(merge, merge->check.pair.second);

    merge->neighbours.maps[0] = first;
    merge->neighbours.poses[0] = merge->check.pose[first];
    merge->neighbours.count = 1;
    cairn_map_merge_begin_total(merge, second, merge->check.pose[second], merge->params.max_points);
}

static void end_pair(cairn_map_merge *merge)
{
    int32_t first = map_at(merge, merge->check.pair.first),
            second = map_at(merge, merge->check.pair.second);

    merge->check.pair_score[cairn_map_merge_pair(first, second)] = merge->total.log_ratio;
}

/* Step: scores every pair of placed maps. */
static int score_pairs(cairn_map_merge *merge, cairn_budget *budget)
{
    map_merge_item_pair *pair = &merge->check.pair;

    CAIRN_STEP_BEGIN(merge->resume.phase);
    for (pair->second = 1; pair->second < merge->check.count; pair->second++)
        for (pair->first = 0; pair->first < pair->second; pair->first++) {
            begin_pair(merge);
            CAIRN_STEP_RUN(merge, resume.phase, budget, cairn_map_merge_step_total);
            end_pair(merge);
        }
    CAIRN_STEP_END(merge->resume.phase);
}

/* ---- Cuts ---- */

static cairn_real pair_score_of(const cairn_map_merge *merge, int32_t a, int32_t b)
{
    return merge->check.pair_score[cairn_map_merge_pair(a, b)];
}

/* Returns the weight of the minimum cut of the accepted maps (Stoer and Wagner 1997), and its side
 * without the reference: side[] of those maps is 1. Negative weights count as 0. Returns a huge
 * number for a single map. */
static cairn_real minimum_cut(const cairn_map_merge *merge, int32_t *side)
{
    int32_t group[MAP_MERGE_MAX_MAPS], added[MAP_MERGE_MAX_MAPS],
        best_group[MAP_MERGE_MAX_MAPS] = {0};
    cairn_real weight[MAP_MERGE_MAX_MAPS], least = CAIRN_REAL_MAX;
    int32_t left = 0;

    /* group[i]: the map that map i has been contracted into. */
    for (int32_t i = 0; i < merge->map_count; i++) {
        group[i] = merge->check.accepted[i] ? i : -1;
        left += merge->check.accepted[i];
    }
    for (; left > 1; left--) {
        int32_t last = 0, before = 0;

        for (int32_t i = 0; i < merge->map_count; i++) {
            added[i] = group[i] != i;
            weight[i] = 0;
        }
        for (int32_t n = 0; n < left; n++) {
            int32_t next = 0;

            for (int32_t i = 0; i < merge->map_count; i++)
                if (!added[i] && (added[next] || weight[i] > weight[next]))
                    next = i;
            added[next] = 1;
            before = last;
            last = next;
            for (int32_t i = 0; i < merge->map_count; i++)
                for (int32_t k = 0; k < merge->map_count && group[i] == next; k++)
                    if (group[k] >= 0 && group[k] != next && !added[group[k]])
                        weight[group[k]] += cairn_max(pair_score_of(merge, i, k), 0);
        }
        if (weight[last] < least) {
            least = weight[last];
            for (int32_t i = 0; i < merge->map_count; i++)
                best_group[i] = group[i] == last;
        }
        for (int32_t i = 0; i < merge->map_count; i++)
            group[i] = group[i] == last ? before : group[i];
    }
    for (int32_t i = 0; i < merge->map_count; i++)
        side[i] = merge->check.accepted[i] && best_group[i] != best_group[merge->reference];
    return least;
}

static void refuse_map(cairn_map_merge *merge, int32_t map, cairn_map_merge_verdict verdict)
{
    merge->check.accepted[map] = 0;
    merge->placed[map].verdict = verdict;
}

/* Returns the units of a minimum cut. */
static int32_t cut_units(const cairn_map_merge *merge)
{
    return 1 + merge->map_count * merge->map_count / CUT_VALUES_PER_UNIT * merge->map_count;
}

/* Cuts off the maps beyond the minimum cut; returns 0 when it is not below min_score. */
static int cut_off(cairn_map_merge *merge)
{
    int32_t side[MAP_MERGE_MAX_MAPS];

    if (minimum_cut(merge, side) >= merge->params.min_score)
        return 0;
    for (int32_t i = 0; i < merge->map_count; i++)
        if (side[i])
            refuse_map(merge, i, CAIRN_MAP_MERGE_LOW_SUPPORT);
    return 1;
}

/* Step: cuts off weakly supported maps until no cut is below min_score. */
static int cut(cairn_map_merge *merge, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(merge->resume.phase);
    do {
        CAIRN_STEP_CHARGE(merge, resume.phase, budget, cut_units(merge));
    } while (cut_off(merge));
    CAIRN_STEP_END(merge->resume.phase);
}

/* ---- Verdicts ---- */

static cairn_pose shifted(cairn_pose pose, int32_t direction)
{
    cairn_real angle = (cairn_real)direction * (2 * CAIRN_PI / SHIFT_DIRECTIONS);

    pose.x += SHIFT_M * cairn_cos(angle);
    pose.y += SHIFT_M * cairn_sin(angle);
    return pose;
}

/* Returns test pose `index` of a map: its own, then competing ones, then shifted ones. */
static cairn_pose place_at(const cairn_map_merge *merge, int32_t map, int32_t index)
{
    cairn_pose pose = merge->check.pose[map];

    if (index == 0)
        return pose;
    return index <= merge->check.competing_count
               ? merge->check.competing[index - 1].first_second
               : shifted(pose, index - 1 - merge->check.competing_count);
}

static void insert_place(cairn_map_merge *merge, int32_t map, int32_t index)
{
    cairn_map_merge_placed *p = &merge->placed[map];

    if (index == 0) {
        p->support = merge->total.log_ratio;
        p->neighbours = merge->total.neighbours;
    } else if (index <= merge->check.competing_count) {
        p->competing_support = cairn_max(p->competing_support, merge->total.log_ratio);
    } else {
        merge->check.shifted_score = cairn_max(merge->check.shifted_score, merge->total.log_ratio);
    }
}

/* Lists the poses of the current map that are scored. */
static void list_places(cairn_map_merge *merge)
{
    map_merge_verification *check = &merge->check;
    int32_t map = map_at(merge, check->current);

    collect_others(merge, map);
    check->competing_count =
        cairn_map_merge_places(merge, map, check->competing, MAP_MERGE_MAX_REFINED);
    check->shifted_score = 0;
    merge->placed[map].modes = check->competing_count;
    merge->placed[map].competing_support = 0;
}

/* Returns the units of listing the poses of a map: each mode may be listed. */
static int32_t listing_units(const cairn_map_merge *merge)
{
    return 1 + merge->check.count * merge->params.max_modes;
}

/* Begins to score the current pose; returns 0 for a competing one that is the map's own. */
static int begin_place(cairn_map_merge *merge)
{
    const map_merge_verification *check = &merge->check;
    int32_t map = map_at(merge, check->current);
    cairn_pose pose = place_at(merge, map, check->trial);

    if (check->trial > 0 && check->trial <= check->competing_count &&
        cairn_map_merge_is_same(pose, check->pose[map], MAP_MERGE_SAME_M, MAP_MERGE_SAME_RAD))
        return 0;
    cairn_map_merge_begin_total(merge, map, pose, merge->params.max_points);
    return 1;
}

/* Step: computes support, competing support and shift test of the current map. */
static int score_places(cairn_map_merge *merge, cairn_budget *budget)
{
    map_merge_verification *check = &merge->check;

    CAIRN_STEP_BEGIN(merge->resume.part);
    CAIRN_STEP_CHARGE(merge, resume.part, budget, listing_units(merge));
    list_places(merge);
    for (check->trial = 0; check->trial <= check->competing_count + SHIFT_DIRECTIONS;
         check->trial++) {
        if (!begin_place(merge))
            continue;
        CAIRN_STEP_RUN(merge, resume.part, budget, cairn_map_merge_step_total);
        insert_place(merge, map_at(merge, check->current), check->trial);
    }
    CAIRN_STEP_END(merge->resume.part);
}

cairn_real cairn_map_merge_error_probability(cairn_real support, cairn_real competing_support)
{
    cairn_real ratio =
        (CHANCE_NATS + cairn_max(competing_support, 0)) / (CHANCE_NATS + cairn_max(support, 0));
    cairn_real log_odds = ERROR_LOG_ODDS + ERROR_EXPONENT * cairn_log(ratio);

    return cairn_max(1 / (1 + cairn_exp(-log_odds)), MIN_ERROR_PROBABILITY);
}

/* Returns 1 for a map that is accepted, or that a cut has cut off. */
static int needs_verdict(const cairn_map_merge *merge, int32_t map)
{
    return map != merge->reference && (merge->check.accepted[map] ||
                                       merge->placed[map].verdict == CAIRN_MAP_MERGE_LOW_SUPPORT);
}

static void give_verdict(cairn_map_merge *merge, int32_t map)
{
    cairn_map_merge_placed *p = &merge->placed[map];

    p->error_probability = cairn_map_merge_error_probability(p->support, p->competing_support);
    if (!merge->check.accepted[map])
        return;
    if (p->support < merge->params.min_score)
        /* the cuts ignore negative pair scores */
        refuse_map(merge, map, CAIRN_MAP_MERGE_LOW_SUPPORT);
    else if (p->support - p->competing_support < merge->params.min_margin)
        refuse_map(merge, map, CAIRN_MAP_MERGE_AMBIGUOUS);
    else if (merge->check.shifted_score > MAX_SHIFTED_SHARE * p->support)
        refuse_map(merge, map, CAIRN_MAP_MERGE_UNOBSERVABLE);
    merge->check.refused |= !merge->check.accepted[map];
}

/* Step: verifies every accepted map. */
static int give_verdicts(cairn_map_merge *merge, cairn_budget *budget)
{
    map_merge_verification *check = &merge->check;

    CAIRN_STEP_BEGIN(merge->resume.phase);
    check->refused = 0;
    for (check->current = 0; check->current < check->count; check->current++) {
        if (!needs_verdict(merge, map_at(merge, check->current)))
            continue;
        CAIRN_STEP_RUN(merge, resume.phase, budget, score_places);
        give_verdict(merge, map_at(merge, check->current));
    }
    CAIRN_STEP_END(merge->resume.phase);
}

/* ---- Distorted maps ---- */

/* Begins to move the current map. */
static void begin_average(cairn_map_merge *merge)
{
    int32_t map = map_at(merge, merge->check.current);

    collect_others(merge, map);
    cairn_map_merge_begin_average(merge, map, merge->check.pose[map]);
}

/* Step: moves the accepted maps that are distorted, in turn, each against all others. */
static int average_distorted(cairn_map_merge *merge, cairn_budget *budget)
{
    map_merge_verification *check = &merge->check;

    CAIRN_STEP_BEGIN(merge->resume.phase);
    for (check->current = 1; check->current < check->count; check->current++) {
        if (!check->accepted[map_at(merge, check->current)])
            continue;
        begin_average(merge);
        CAIRN_STEP_RUN(merge, resume.phase, budget, cairn_map_merge_step_average);
        check->pose[map_at(merge, check->current)] = merge->fit.pose;
    }
    CAIRN_STEP_END(merge->resume.phase);
}

/* The maps are verified again after a rejection, which leaves the others less support. */
int cairn_map_merge_verify(cairn_map_merge *merge, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(merge->resume.stage);
    CAIRN_STEP_CHARGE(merge, resume.stage, budget, begin_units(merge));
    begin_check(merge);
    CAIRN_STEP_RUN(merge, resume.stage, budget, refine_jointly);
    CAIRN_STEP_RUN(merge, resume.stage, budget, score_pairs);
    do {
        CAIRN_STEP_RUN(merge, resume.stage, budget, cut);
        CAIRN_STEP_RUN(merge, resume.stage, budget, give_verdicts);
    } while (merge->check.refused);
    CAIRN_STEP_RUN(merge, resume.stage, budget, average_distorted);
    CAIRN_STEP_END(merge->resume.stage);
}
