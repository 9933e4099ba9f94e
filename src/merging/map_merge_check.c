/* Joint refinement and verification of the particle filter's result.
 *
 * Method.
 *
 * 1. The maps of the best particle are refined by lines, in turn, each against all others.
 * 2. The log-likelihood ratios between every two of them form a weighted graph. While its minimum
 *    cut (Stoer and Wagner 1997) has less than min_score, the side without the reference is cut
 *    off.
 * 3. A map with a competing pose of nearly equal support, or with an unobservable translation along
 *    its walls, is rejected, and the others are verified again. */
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

enum { CHECK_REFINE, CHECK_LINKS, CHECK_CUTS, CHECK_VERDICTS, CHECK_DONE };

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
    merge->check.stage = CHECK_REFINE;
    merge->phase = MAP_MERGE_CHECK;
    merge->cursor = 1;
    merge->inner = 0;
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

/* Refines every map in turn against all others. */
static cairn_status step_joint(cairn_map_merge *merge, cairn_budget *budget)
{
    for (; merge->check.round < REFINE_ROUNDS; merge->check.round++, merge->cursor = 1)
        for (; merge->cursor < merge->check.count; merge->cursor++, merge->inner = 0) {
            int32_t map = merge->check.list[merge->cursor];

            if (merge->inner == 0) {
                collect_others(merge, map);
                cairn_map_merge_begin_lines(merge, map, merge->check.start[map],
                                            merge->check.pose[map], 1);
                merge->inner = 1;
            }
            if (!cairn_map_merge_step_lines(merge, budget))
                return CAIRN_MORE;
            merge->check.pose[map] = merge->climb.best;
        }
    return CAIRN_OK;
}

/* Scores every pair of placed maps. */
static cairn_status step_links(cairn_map_merge *merge, cairn_budget *budget)
{
    for (; merge->cursor < merge->check.count; merge->cursor++, merge->inner = 0)
        while (merge->inner < 2 * merge->cursor) {
            int32_t map = merge->check.list[merge->cursor],
                    other = merge->check.list[merge->inner / 2];

            if (merge->inner % 2 == 0) {
                merge->neighbours.maps[0] = other;
                merge->neighbours.poses[0] = merge->check.pose[other];
                merge->neighbours.count = 1;
                cairn_map_merge_begin_total(merge, map, merge->check.pose[map],
                                            merge->params.max_points);
                merge->inner++;
            }
            if (!cairn_map_merge_step_total(merge, budget))
                return CAIRN_MORE;
            merge->check
                .pair_score[map_merge_pair(other < map ? other : map, other < map ? map : other)] =
                merge->total.log_ratio;
            merge->inner++;
        }
    return CAIRN_OK;
}

static cairn_real pair_score_of(const cairn_map_merge *merge, int32_t a, int32_t b)
{
    return merge->check.pair_score[a < b ? map_merge_pair(a, b) : map_merge_pair(b, a)];
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

/* Cuts off weakly supported maps until no cut is below min_score. */
static cairn_status step_cuts(cairn_map_merge *merge, cairn_budget *budget)
{
    for (;;) {
        int32_t side[MAP_MERGE_MAX_MAPS];
        int32_t cost = 1 + merge->map_count * merge->map_count / 8 * merge->map_count;

        if (!cairn_budget_charge(budget, &merge->units_charged, cost))
            return CAIRN_MORE;
        if (minimum_cut(merge, side) >= merge->params.min_score)
            return CAIRN_OK;
        for (int32_t i = 0; i < merge->map_count; i++)
            if (side[i])
                refuse_map(merge, i, CAIRN_MAP_MERGE_LOW_SUPPORT);
    }
}

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

/* Computes support, competing support and shift test of one map. */
static cairn_status step_places(cairn_map_merge *merge, int32_t map, cairn_budget *budget)
{
    if (merge->check.looking == 0) {
        collect_others(merge, map);
        merge->check.competing_count =
            cairn_map_merge_places(merge, map, merge->check.competing, MAP_MERGE_MAX_REFINED);
        merge->check.shifted_score = 0;
        merge->placed[map].modes = merge->check.competing_count;
        merge->placed[map].competing_support = 0;
        merge->check.looking = 1;
        merge->check.at = 0;
        merge->inner = 0;
    }
    for (; merge->check.at <= merge->check.competing_count + SHIFT_DIRECTIONS;
         merge->check.at++, merge->inner = 0) {
        cairn_pose pose = place_at(merge, map, merge->check.at);

        if (merge->check.at > 0 && merge->check.at <= merge->check.competing_count &&
            cairn_map_merge_is_same(pose, merge->check.pose[map], MAP_MERGE_SAME_M,
                                    MAP_MERGE_SAME_RAD))
            continue;
        if (merge->inner == 0) {
            cairn_map_merge_begin_total(merge, map, pose, merge->params.max_points);
            merge->inner = 1;
        }
        if (!cairn_map_merge_step_total(merge, budget))
            return CAIRN_MORE;
        insert_place(merge, map, merge->check.at);
    }
    merge->check.looking = 0;
    return CAIRN_OK;
}

cairn_real cairn_map_merge_error_probability(cairn_real support, cairn_real competing_support)
{
    cairn_real ratio =
        (CHANCE_NATS + cairn_max(competing_support, 0)) / (CHANCE_NATS + cairn_max(support, 0));
    cairn_real log_odds = ERROR_LOG_ODDS + ERROR_EXPONENT * cairn_log(ratio);

    return cairn_max(1 / (1 + cairn_exp(-log_odds)), MIN_ERROR_PROBABILITY);
}

/* Verifies every accepted map, and again after a rejection, which leaves the others less
 * support. */
static cairn_status step_verdicts(cairn_map_merge *merge, cairn_budget *budget)
{
    for (; merge->cursor < merge->check.count; merge->cursor++) {
        int32_t map = merge->check.list[merge->cursor];
        cairn_map_merge_placed *p = &merge->placed[map];

        if (map == merge->reference ||
            (!merge->check.accepted[map] && p->verdict != CAIRN_MAP_MERGE_LOW_SUPPORT))
            continue;
        if (step_places(merge, map, budget) != CAIRN_OK)
            return CAIRN_MORE;
        p->error_probability = cairn_map_merge_error_probability(p->support, p->competing_support);
        if (!merge->check.accepted[map])
            continue;
        if (p->support < merge->params.min_score)
            /* the cuts ignore negative pair scores */
            refuse_map(merge, map, CAIRN_MAP_MERGE_LOW_SUPPORT);
        else if (p->support - p->competing_support < merge->params.min_margin)
            refuse_map(merge, map, CAIRN_MAP_MERGE_AMBIGUOUS);
        else if (merge->check.shifted_score > MAX_SHIFTED_SHARE * p->support)
            refuse_map(merge, map, CAIRN_MAP_MERGE_UNOBSERVABLE);
        merge->check.refused |= !merge->check.accepted[map];
    }
    return CAIRN_OK;
}

cairn_status cairn_map_merge_verify(cairn_map_merge *merge, cairn_budget *budget)
{
    if (merge->phase != MAP_MERGE_CHECK)
        begin_check(merge);
    while (merge->check.stage < CHECK_DONE) {
        cairn_status status = merge->check.stage == CHECK_REFINE  ? step_joint(merge, budget)
                              : merge->check.stage == CHECK_LINKS ? step_links(merge, budget)
                              : merge->check.stage == CHECK_CUTS  ? step_cuts(merge, budget)
                                                                  : step_verdicts(merge, budget);

        if (status != CAIRN_OK)
            return status;
        merge->check.stage++;
        if (merge->check.stage == CHECK_DONE && merge->check.refused)
            merge->check.stage = CHECK_CUTS;
        merge->check.refused = 0;
        merge->cursor = 0;
        merge->inner = 0;
    }
    return CAIRN_OK;
}
