/* The virtual robot: a particle filter over where maps lie, and the check of what it found.
 *
 * A state says where one map was put. A particle proposes the next map, the one whose best place has most evidence (or that
 * which the order names), at each of its rival places beside the maps placed so far, or that no more maps are put; evidence
 * against all placed maps is the likelihood, tempered because neighbouring walls are not independent. What one pair of maps
 * says about a place is remembered, since particles mostly agree.
 *
 * The best particle is then refined, map by map beside its neighbours, and its maps are accepted one by one. What hangs on too little evidence is cut off, a map that has a rival place or could
 * slide is refused. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/map_merge_work.h"

/* Nats of evidence for one of log likelihood. */
#define TEMPER CAIRN_REAL(4.0)
/* Nats that a place must have to be tried at all: what hangs on little is cut off in the end. */
#define LEAST CAIRN_REAL(2.0)
/* Nats that a place has by chance, as the best of many. */
#define CHANCE CAIRN_REAL(5.0)
/* Nobody has counted rarer faults. */
#define LEAST_WRONG CAIRN_REAL(1e-4)
/* Nats by which an e-fold less is to be expected of chance. */
#define SPREAD CAIRN_REAL(1.5)
/* Rounds of a candidate's refinement by lines. */
enum { LINE_ROUNDS = 4 };
/* Rounds in which every map is refined. */
enum { REFINE_ROUNDS = 24, SHIFTS = 8 };

enum { CHECK_REFINE, CHECK_LINKS, CHECK_CUTS, CHECK_JUDGE, CHECK_DONE };
/* m: a map slides that has most of its evidence so far away. */
#define SHIFT    CAIRN_REAL(0.30)
#define SLIDES   CAIRN_REAL(0.7)
#define SAME_M   CAIRN_REAL(0.30)
#define SAME_RAD CAIRN_REAL(0.10)

cairn_particle_filter_params cairn_merge_filter_params(const cairn_map_merge_params *p)
{
    cairn_particle_filter_params f = cairn_particle_filter_default();

    f.particles = f.max_particles = p->particles;
    f.max_followers = MERGE_FOLLOWERS;
    f.max_candidates = p->particles * MERGE_FOLLOWERS;
    f.max_blocks = p->particles * (p->max_maps + 2) + 1;
    f.state_bytes = (int32_t)sizeof(merge_state);
    f.by_entropy = 0;
    return f;
}

/* ---- Proposal ---- */

/* The maps that a particle has placed become near[]. 1 when it has come to its end. */
static int gather(cairn_map_merge *m, const void *state)
{
    int ended = 0;

    m->near_count = 0;
    for (const merge_state *s = state; s != NULL; s = cairn_particle_state_before(s)) {
        if (s->map < 0) {
            ended = 1;
            continue;
        }
        m->near[m->near_count] = s->map;
        m->near_pose[m->near_count] = s->reference_map;
        m->near_count++;
    }
    return ended;
}

static int is_near(const cairn_map_merge *m, int32_t map)
{
    for (int32_t i = 0; i < m->near_count; i++)
        if (m->near[i] == map)
            return 1;
    return 0;
}

/* Mode `index` of map b beside map a, seen from a; 0 when there are no more. */
static int mode_of(const cairn_map_merge *m, int32_t a, int32_t b, int32_t index, merge_mode *mode)
{
    int32_t pair = a < b ? merge_pair(a, b) : merge_pair(b, a);

    if (index >= m->mode_count[pair])
        return 0;
    *mode = m->modes[(size_t)pair * (size_t)m->params.max_modes + (size_t)index];
    if (a > b)
        mode->first_second = cairn_pose_inverse(mode->first_second);
    return 1;
}

/* The map that comes next: by the order, or the one whose best mode beside any placed map is best. -1: none. */
static int32_t next_map(const cairn_map_merge *m)
{
    cairn_real best = 0;
    int32_t next = -1;

    for (int32_t n = 0; n < m->map_count && !(m->has_order && next >= 0); n++) {
        int32_t map = m->has_order ? m->order[n] : n;

        for (int32_t i = 0; i < m->near_count && !is_near(m, map); i++) {
            merge_mode mode;

            if (mode_of(m, m->near[i], map, 0, &mode) && mode.evidence > best) {
                best = mode.evidence;
                next = map;
            }
        }
    }
    return next;
}

/* Rival places of a map beside all that are placed, the best ones. */
static int32_t places_of(const cairn_map_merge *m, int32_t map, merge_mode *list, int32_t most)
{
    int32_t count = 0;

    for (int32_t i = 0; i < m->near_count; i++) {
        merge_mode mode;

        for (int32_t k = 0; mode_of(m, m->near[i], map, k, &mode); k++) {
            mode.first_second = cairn_pose_compose(m->near_pose[i], mode.first_second);
            cairn_merge_keep(list, &count, most, mode, SAME_M, SAME_RAD);
        }
    }
    if (m->maps[map].has_guess) {
        merge_mode guess = {m->maps[map].guess, CAIRN_REAL_MAX};

        cairn_merge_keep(list, &count, most, guess, CAIRN_REAL(0.05), CAIRN_REAL(0.02));
    }
    return count;
}

static void list_candidates(cairn_map_merge *m, merge_offer *offer)
{
    merge_mode places[MERGE_FOLLOWERS - 1];
    int32_t map = next_map(m), count = map < 0 ? 0 : places_of(m, map, places, MERGE_FOLLOWERS - 1);
    const merge_state none = {-1, -1, {0, 0, 0}, LEAST, 0, 0};

    for (int32_t i = 0; i < count; i++) {
        merge_state *s = &offer->list[i];

        *s = none;
        s->map = map;
        s->reference_map = places[i].first_second;
    }
    offer->list[count] = none;
    offer->count = count + 1;
}

static void count_images(cairn_map_merge *m, const merge_state *s)
{
    m->offer.psi_sum += s->psi;
    m->offer.gamma_sum += s->gamma;
    m->offer.gamma_least = m->offer.offered == 0 ? s->gamma : cairn_min(m->offer.gamma_least, s->gamma);
    m->offer.offered++;
}

/* Psi and gamma beside the neighbour that shares most with the map. */
static void see_images(cairn_map_merge *m, merge_state *s)
{
    cairn_real most = -1;

    s->psi = s->gamma = 0;
    for (int32_t i = 0; i < m->near_count && s->map >= 0; i++) {
        cairn_merge_score score;

        cairn_merge_score_at(m, m->near[i], s->map, cairn_pose_between(m->near_pose[i], s->reference_map), &score);
        if (score.overlap > most) {
            most = score.overlap;
            s->psi = score.psi;
            s->gamma = score.gamma;
        }
    }
}

/* 1 when two particles have put the same maps at the same places. */
static int is_same_history(const merge_state *a, const merge_state *b)
{
    while (a != NULL && b != NULL && a != b) {
        if (a->map != b->map || memcmp(&a->reference_map, &b->reference_map, sizeof a->reference_map) != 0)
            return 0;
        a = cairn_particle_state_before(a);
        b = cairn_particle_state_before(b);
    }
    return a == b;
}

/* The offer for a particle like this one, or an empty one in place of the oldest. */
static merge_offer *offer_for(cairn_map_merge *m, const merge_state *state)
{
    merge_offer *fresh;

    for (int32_t i = 0; i < MERGE_OFFERS; i++)
        if (m->offer.made[i].state != NULL && is_same_history(m->offer.made[i].state, state))
            return &m->offer.made[i];
    fresh = &m->offer.made[m->offer.count++ % MERGE_OFFERS];
    fresh->state = state;
    fresh->count = 0;
    return fresh;
}

static void begin_offer(cairn_map_merge *m, const merge_state *state)
{
    m->offer.now = offer_for(m, state);
    m->offer.at = 0;
    m->offer.stage = 1;
    if (m->offer.now->count > 0) {
        m->offer.at = m->offer.now->count;
    } else if (gather(m, state)) {
        m->offer.now->list[0] = *state;
        m->offer.now->count = 1;
    } else {
        list_candidates(m, m->offer.now);
    }
}

/* One candidate: refined beside all maps placed, then scored. */
static int step_candidate(cairn_map_merge *m, merge_state *s, cairn_budget *budget)
{
    if (m->offer.stage == 1) {
        cairn_merge_begin_lines(m, s->map, s->reference_map, s->reference_map, LINE_ROUNDS);
        m->offer.stage = 2;
    }
    if (m->offer.stage == 2) {
        if (!cairn_merge_go_on_lines(m, budget))
            return 0;
        s->reference_map = m->climb.best;
        cairn_merge_begin_total(m, s->map, s->reference_map, m->params.max_points);
        m->offer.stage = 3;
    }
    if (!cairn_merge_go_on_total(m, budget))
        return 0;
    s->evidence = m->total.evidence;
    if (m->params.perception == CAIRN_MERGE_IMAGES)
        see_images(m, s);
    m->offer.stage = 1;
    return 1;
}

static cairn_status propose(void *context, cairn_particle_filter *filter, int32_t index, cairn_budget *budget)
{
    cairn_map_merge *m = context;
    merge_offer *offer;

    if (m->offer.stage == 0) {
        if (!cairn_budget_pay(budget, &m->paid, 1 + m->map_count))
            return CAIRN_MORE;
        begin_offer(m, cairn_particle_filter_particle(filter, index).state);
    }
    offer = m->offer.now;
    for (; m->offer.at < offer->count; m->offer.at++)
        if (offer->list[m->offer.at].map >= 0 && !step_candidate(m, &offer->list[m->offer.at], budget))
            return CAIRN_MORE;
    for (int32_t i = 0; i < offer->count; i++) {
        cairn_status status = cairn_particle_filter_offer(filter, &offer->list[i], 0);

        CAIRN_ASSERT(status == CAIRN_OK);
        (void)status;
        if (offer->list[i].map >= 0)
            count_images(m, &offer->list[i]);
    }
    m->offer.stage = 0;
    return CAIRN_OK;
}

/* Psi~ gamma~ (9.5, 9.6), each normalised over all candidates of the step; a single one has 1. */
static cairn_real log_images(const cairn_map_merge *m, const merge_state *s)
{
    cairn_real gammas = m->offer.gamma_sum - (cairn_real)m->offer.offered * m->offer.gamma_least;
    cairn_real psi = s->psi / m->offer.psi_sum, gamma = (s->gamma - m->offer.gamma_least) / gammas;

    if (m->offer.offered < 2 || !(gammas > 0) || !(m->offer.psi_sum > 0))
        return 0;
    return psi * gamma > 0 ? cairn_log(psi * gamma) : -CAIRN_REAL_MAX;
}

static cairn_status likelihood(void *context, const cairn_particle_filter *filter, int32_t index, const void *state,
                               cairn_real *log_likelihood, cairn_budget *budget)
{
    const cairn_map_merge *m = context;
    const merge_state *s = state;

    (void)filter;
    (void)index;
    (void)budget;
    if (m->params.perception == CAIRN_MERGE_IMAGES && s->map >= 0)
        *log_likelihood = log_images(m, s);
    else if (m->params.perception == CAIRN_MERGE_IMAGES)
        *log_likelihood = -20;
    else
        *log_likelihood = s->evidence / TEMPER;
    return CAIRN_OK;
}

cairn_particle_model cairn_merge_model(cairn_map_merge *m)
{
    cairn_particle_model model = {m, propose, likelihood, NULL, NULL};

    return model;
}

static void begin_filter(cairn_map_merge *m)
{
    const merge_state first = {m->reference, -1, {0, 0, 0}, 0, 0, 0};
    cairn_status status = cairn_particle_filter_clear(m->filter, m->params.seed);

    CAIRN_ASSERT(status == CAIRN_OK);
    status = cairn_particle_filter_start(m->filter, &first, 0);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    m->merged = 0;
    m->phase = MERGE_FILTER;
    m->cursor = 0;
}

cairn_status cairn_merge_run_filter(cairn_map_merge *m, cairn_budget *budget)
{
    if (m->phase != MERGE_FILTER)
        begin_filter(m);
    for (; m->merged < m->map_count - 1; m->merged++, m->cursor = 0) {
        cairn_status status;

        if (m->cursor == 0) {
            status = cairn_particle_filter_begin(m->filter);
            CAIRN_ASSERT(status == CAIRN_OK);
            memset(m->offer.made, 0, sizeof m->offer.made);
            m->offer.count = 0;
            m->offer.stage = 0;
            m->offer.psi_sum = m->offer.gamma_sum = 0;
            m->offer.offered = 0;
            m->cursor = 1;
        }
        status = cairn_particle_filter_step(m->filter, budget);
        if (status == CAIRN_MORE)
            return status;
        CAIRN_ASSERT(status == CAIRN_OK);
    }
    return CAIRN_OK;
}

/* ---- The check ---- */

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

static void begin_check(cairn_map_merge *m)
{
    (void)gather(m, best_of(m));
    memset(&m->check, 0, sizeof m->check);
    memset(m->placed, 0, sizeof m->placed);
    for (int32_t i = 0; i < m->map_count; i++) {
        cairn_merge_placed *p = &m->placed[i];

        p->verdict = m->maps[i].point_count == 0 || m->maps[i].free == 0 ? CAIRN_MERGE_EMPTY : CAIRN_MERGE_NO_OVERLAP;
        p->corners = m->maps[i].corner_count;
        p->wrong = 1;
        p->rank = -1;
    }
    for (int32_t i = 0; i < m->near_count; i++) {
        int32_t map = m->near[m->near_count - 1 - i];

        m->check.list[i] = map;
        m->check.pose[map] = m->near_pose[m->near_count - 1 - i];
        m->check.start[map] = m->check.pose[map];
        m->check.accepted[map] = 1;
        m->placed[map].verdict = CAIRN_MERGE_PLACED;
        m->placed[map].rank = i;
    }
    m->check.count = m->near_count;
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
            m->check.link[merge_pair(other < map ? other : map, other < map ? map : other)] = m->total.evidence;
            m->inner++;
        }
    return CAIRN_OK;
}

static cairn_real link_of(const cairn_map_merge *m, int32_t a, int32_t b)
{
    return m->check.link[a < b ? merge_pair(a, b) : merge_pair(b, a)];
}

/* Of what is accepted the part without the reference that has least evidence in common with the rest (Stoer and Wagner 1997):
 * side[] of those maps is 1. Evidence against is none. Returns that evidence, or a huge number for a single map. */
static cairn_real least_cut(const cairn_map_merge *m, int32_t *side)
{
    int32_t group[MERGE_MAPS_MOST], added[MERGE_MAPS_MOST], best_group[MERGE_MAPS_MOST];
    cairn_real weight[MERGE_MAPS_MOST], least = CAIRN_REAL_MAX;
    int32_t left = 0;

    /* group[i]: the map that map i has been united with. */
    for (int32_t i = 0; i < m->map_count; i++) {
        group[i] = m->check.accepted[i] ? i : -1;
        best_group[i] = 0;
        left += m->check.accepted[i];
    }
    for (; left > 1; left--) {
        int32_t last = -1, before = -1;

        for (int32_t i = 0; i < m->map_count; i++) {
            added[i] = group[i] != i;
            weight[i] = 0;
        }
        for (int32_t n = 0; n < left; n++) {
            int32_t next = -1;

            for (int32_t i = 0; i < m->map_count; i++)
                if (!added[i] && (next < 0 || weight[i] > weight[next]))
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

/* Place `index` of a map to be looked at beside all others: its own, then rivals, then shifted ones. */
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
        m->check.rivals = places_of(m, map, m->check.rival_list, MERGE_REFINED);
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
            cairn_merge_is_same(pose, m->check.pose[map], SAME_M, SAME_RAD))
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
