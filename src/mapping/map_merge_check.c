/* The check of what the particle filter found.
 *
 * The maps of the best particle are refined by lines, in turn, beside all others. Evidence
 * between every two of them makes a graph; while a cut through it has less than the least score,
 * the side without the reference is cut off. A map that has a rival place with nearly as much
 * support, or could slide along its walls, is refused, and the rest is looked at again. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/map_merge_work.h"

/* Nats that a place has by chance, as the best of many, and by which an e-fold less is to be
 * expected. */
#define CHANCE CAIRN_REAL(5.0)
#define SPREAD CAIRN_REAL(1.5)
/* Nobody has counted rarer faults. */
#define LEAST_WRONG CAIRN_REAL(1e-4)
/* m: a map slides that has most of its evidence so far away. */
#define SHIFT  CAIRN_REAL(0.30)
#define SLIDES CAIRN_REAL(0.7)

/* Rounds in which every map is refined; directions in which it is shifted. */
enum { REFINE_ROUNDS = 24, SHIFTS = 8 };

enum { CHECK_REFINE, CHECK_LINKS, CHECK_CUTS, CHECK_JUDGE, CHECK_DONE };

/* The particle whose maps have most evidence in all. */
static const void *best_of(const cairn_map_merge *m)
{
    const void *best = NULL;
    cairn_real most = 0;

    for (int32_t i = 0; i < cairn_particle_filter_count(m->filter); i++) {
        const void *state = cairn_particle_filter_particle(m->filter, i).state;
        cairn_real sum = 0;

        for (const merge_state *s = state; s != NULL; s = cairn_particle_state_before(s))
            sum += s->evidence;
        if (best == NULL || sum > most) {
            best = state;
            most = sum;
        }
    }
    return best;
}

/* near[] in the order of merging, but the reference first, in whose frame they are now; alone
 * when it has not been merged. */
static void begin_at_reference(cairn_map_merge *m)
{
    cairn_pose reference = cairn_pose_identity();
    int32_t at = -1, count = 1;

    for (int32_t i = 0; i < m->near_count; i++)
        if (m->near[i] == m->reference)
            at = i;
    if (at >= 0)
        reference = m->near_pose[at];
    m->check.list[0] = m->reference;
    m->check.pose[m->reference] = cairn_pose_identity();
    for (int32_t i = m->near_count - 1; i >= 0 && at >= 0; i--)
        if (i != at) {
            m->check.list[count++] = m->near[i];
            m->check.pose[m->near[i]] = cairn_pose_between(reference, m->near_pose[i]);
        }
    m->check.count = count;
}

static void begin_check(cairn_map_merge *m)
{
    (void)cairn_merge_gather(m, best_of(m));
    memset(&m->check, 0, sizeof m->check);
    memset(m->placed, 0, sizeof m->placed);
    for (int32_t i = 0; i < m->map_count; i++) {
        cairn_merge_placed *p = &m->placed[i];

        p->verdict = m->maps[i].point_count == 0 || m->maps[i].free == 0 ? CAIRN_MERGE_EMPTY
                                                                         : CAIRN_MERGE_NO_OVERLAP;
        p->corners = m->maps[i].corner_count;
        p->wrong = 1;
        p->rank = -1;
    }
    begin_at_reference(m);
    for (int32_t i = 0; i < m->check.count; i++) {
        int32_t map = m->check.list[i];

        m->check.start[map] = m->check.pose[map];
        m->check.accepted[map] = 1;
        m->placed[map].verdict = CAIRN_MERGE_PLACED;
        m->placed[map].rank = i;
    }
    m->placed[m->reference].wrong = 0;
    m->check.stage = CHECK_REFINE;
    m->phase = MERGE_CHECK;
    m->cursor = 1;
    m->inner = 0;
}

/* near[]: the accepted maps but `map`. */
static void surround(cairn_map_merge *m, int32_t map)
{
    m->near_count = 0;
    for (int32_t i = 0; i < m->check.count; i++) {
        int32_t other = m->check.list[i];

        if (other == map || !m->check.accepted[other])
            continue;
        m->near[m->near_count] = other;
        m->near_pose[m->near_count++] = m->check.pose[other];
    }
}

/* Every map in turn beside all others. */
static cairn_status step_joint(cairn_map_merge *m, cairn_budget *budget)
{
    for (; m->check.round < REFINE_ROUNDS; m->check.round++, m->cursor = 1)
        for (; m->cursor < m->check.count; m->cursor++, m->inner = 0) {
            int32_t map = m->check.list[m->cursor];

            if (m->inner == 0) {
                surround(m, map);
                cairn_merge_begin_lines(m, map, m->check.start[map], m->check.pose[map], 1);
                m->inner = 1;
            }
            if (!cairn_merge_go_on_lines(m, budget))
                return CAIRN_MORE;
            m->check.pose[map] = m->climb.best;
        }
    return CAIRN_OK;
}

/* What every two maps placed say about each other. */
static cairn_status step_links(cairn_map_merge *m, cairn_budget *budget)
{
    for (; m->cursor < m->check.count; m->cursor++, m->inner = 0)
        while (m->inner < 2 * m->cursor) {
            int32_t map = m->check.list[m->cursor], other = m->check.list[m->inner / 2];

            if (m->inner % 2 == 0) {
                m->near[0] = other;
                m->near_pose[0] = m->check.pose[other];
                m->near_count = 1;
                cairn_merge_begin_total(m, map, m->check.pose[map], m->params.max_points);
                m->inner++;
            }
            if (!cairn_merge_go_on_total(m, budget))
                return CAIRN_MORE;
            m->check.link[merge_pair(other < map ? other : map, other < map ? map : other)] =
                m->total.evidence;
            m->inner++;
        }
    return CAIRN_OK;
}

static cairn_real link_of(const cairn_map_merge *m, int32_t a, int32_t b)
{
    return m->check.link[a < b ? merge_pair(a, b) : merge_pair(b, a)];
}

/* Of what is accepted the part without the reference that has least evidence in common with the
 * rest (Stoer and Wagner 1997): side[] of those maps is 1. Evidence against is none. Returns
 * that evidence, or a huge number for a single map. */
static cairn_real least_cut(const cairn_map_merge *m, int32_t *side)
{
    int32_t group[MERGE_MAPS_MOST], added[MERGE_MAPS_MOST], best_group[MERGE_MAPS_MOST] = {0};
    cairn_real weight[MERGE_MAPS_MOST], least = CAIRN_REAL_MAX;
    int32_t left = 0;

    /* group[i]: the map that map i has been united with. */
    for (int32_t i = 0; i < m->map_count; i++) {
        group[i] = m->check.accepted[i] ? i : -1;
        left += m->check.accepted[i];
    }
    for (; left > 1; left--) {
        int32_t last = 0, before = 0;

        for (int32_t i = 0; i < m->map_count; i++) {
            added[i] = group[i] != i;
            weight[i] = 0;
        }
        for (int32_t n = 0; n < left; n++) {
            int32_t next = 0;

            for (int32_t i = 0; i < m->map_count; i++)
                if (!added[i] && (added[next] || weight[i] > weight[next]))
                    next = i;
            added[next] = 1;
            before = last;
            last = next;
            for (int32_t i = 0; i < m->map_count; i++)
                for (int32_t k = 0; k < m->map_count && group[i] == next; k++)
                    if (group[k] >= 0 && group[k] != next && !added[group[k]])
                        weight[group[k]] += cairn_max(link_of(m, i, k), 0);
        }
        if (weight[last] < least) {
            least = weight[last];
            for (int32_t i = 0; i < m->map_count; i++)
                best_group[i] = group[i] == last;
        }
        for (int32_t i = 0; i < m->map_count; i++)
            group[i] = group[i] == last ? before : group[i];
    }
    for (int32_t i = 0; i < m->map_count; i++)
        side[i] = m->check.accepted[i] && best_group[i] != best_group[m->reference];
    return least;
}

static void refuse_map(cairn_map_merge *m, int32_t map, cairn_merge_verdict verdict)
{
    m->check.accepted[map] = 0;
    m->placed[map].verdict = verdict;
}

/* Cuts off what hangs on too little until nothing does. */
static cairn_status step_cuts(cairn_map_merge *m, cairn_budget *budget)
{
    for (;;) {
        int32_t side[MERGE_MAPS_MOST];
        int32_t cost = 1 + m->map_count * m->map_count / 8 * m->map_count;

        if (!cairn_budget_pay(budget, &m->paid, cost))
            return CAIRN_MORE;
        if (least_cut(m, side) >= m->params.min_score)
            return CAIRN_OK;
        for (int32_t i = 0; i < m->map_count; i++)
            if (side[i])
                refuse_map(m, i, CAIRN_MERGE_WEAK);
    }
}

static cairn_pose shifted(cairn_pose pose, int32_t direction)
{
    cairn_real angle = (cairn_real)direction * (2 * CAIRN_PI / SHIFTS);

    pose.x += SHIFT * cairn_cos(angle);
    pose.y += SHIFT * cairn_sin(angle);
    return pose;
}

/* Place `index` of a map to be looked at beside all others: its own, then rivals, then shifted
 * ones. */
static cairn_pose place_at(const cairn_map_merge *m, int32_t map, int32_t index)
{
    cairn_pose pose = m->check.pose[map];

    if (index == 0)
        return pose;
    return index <= m->check.rivals ? m->check.rival_list[index - 1].first_second
                                    : shifted(pose, index - 1 - m->check.rivals);
}

static void note_place(cairn_map_merge *m, int32_t map, int32_t index)
{
    cairn_merge_placed *p = &m->placed[map];

    if (index == 0) {
        p->support = m->total.evidence;
        p->neighbours = m->total.neighbours;
    } else if (index <= m->check.rivals) {
        p->rival = cairn_max(p->rival, m->total.evidence);
    } else {
        m->check.slide = cairn_max(m->check.slide, m->total.evidence);
    }
}

/* Support, rivals and shifts of one map. */
static cairn_status step_places(cairn_map_merge *m, int32_t map, cairn_budget *budget)
{
    if (m->check.looking == 0) {
        surround(m, map);
        m->check.rivals = cairn_merge_places(m, map, m->check.rival_list, MERGE_REFINED);
        m->check.slide = 0;
        m->placed[map].modes = m->check.rivals;
        m->placed[map].rival = 0;
        m->check.looking = 1;
        m->check.at = 0;
        m->inner = 0;
    }
    for (; m->check.at <= m->check.rivals + SHIFTS; m->check.at++, m->inner = 0) {
        cairn_pose pose = place_at(m, map, m->check.at);

        if (m->check.at > 0 && m->check.at <= m->check.rivals &&
            cairn_merge_is_same(pose, m->check.pose[map], MERGE_SAME_M, MERGE_SAME_RAD))
            continue;
        if (m->inner == 0) {
            cairn_merge_begin_total(m, map, pose, m->params.max_points);
            m->inner = 1;
        }
        if (!cairn_merge_go_on_total(m, budget))
            return CAIRN_MORE;
        note_place(m, map, m->check.at);
    }
    m->check.looking = 0;
    return CAIRN_OK;
}

/* By how likely a rival, or mere chance, would have as much. */
static cairn_real probability_of_wrong(const cairn_merge_placed *p)
{
    cairn_real rival = cairn_exp(cairn_min((p->rival - p->support) / SPREAD, 30));
    cairn_real chance = cairn_exp(cairn_min((CHANCE - p->support) / SPREAD, 30));

    return cairn_max((rival + chance) / (1 + rival + chance), LEAST_WRONG);
}

/* Every accepted map, and again when one was refused: fewer maps support the others. */
static cairn_status step_judge(cairn_map_merge *m, cairn_budget *budget)
{
    for (; m->cursor < m->check.count; m->cursor++) {
        int32_t map = m->check.list[m->cursor];
        cairn_merge_placed *p = &m->placed[map];

        if (map == m->reference || (!m->check.accepted[map] && p->verdict != CAIRN_MERGE_WEAK))
            continue;
        if (step_places(m, map, budget) != CAIRN_OK)
            return CAIRN_MORE;
        p->wrong = probability_of_wrong(p);
        if (!m->check.accepted[map])
            continue;
        if (p->support < m->params.min_score)
            refuse_map(m, map, CAIRN_MERGE_WEAK); /* the cuts leave out what speaks against it */
        else if (p->support - p->rival < m->params.min_margin)
            refuse_map(m, map, CAIRN_MERGE_AMBIGUOUS);
        else if (m->check.slide > SLIDES * p->support)
            refuse_map(m, map, CAIRN_MERGE_SLIDES);
        m->check.refused |= !m->check.accepted[map];
    }
    return CAIRN_OK;
}

cairn_status cairn_merge_check(cairn_map_merge *m, cairn_budget *budget)
{
    if (m->phase != MERGE_CHECK)
        begin_check(m);
    while (m->check.stage < CHECK_DONE) {
        cairn_status status = m->check.stage == CHECK_REFINE  ? step_joint(m, budget)
                              : m->check.stage == CHECK_LINKS ? step_links(m, budget)
                              : m->check.stage == CHECK_CUTS  ? step_cuts(m, budget)
                                                              : step_judge(m, budget);

        if (status != CAIRN_OK)
            return status;
        m->check.stage++;
        if (m->check.stage == CHECK_DONE && m->check.refused)
            m->check.stage = CHECK_CUTS;
        m->check.refused = 0;
        m->cursor = 0;
        m->inner = 0;
    }
    return CAIRN_OK;
}
