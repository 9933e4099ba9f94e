/* The virtual robot: a particle filter over where maps lie.
 *
 * A state says where one map was put. A particle proposes the next map, the one whose best place
 * has most evidence (or that which the order names), at each of its rival places beside the maps
 * placed so far, or that it is put aside until all others had their turn; evidence against all
 * placed maps is the likelihood, tempered because neighbouring walls are not independent. What
 * one pair of maps says about a place is remembered, since particles mostly agree. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/map_merge_work.h"

/* Nats of evidence for one of log likelihood. */
#define TEMPER CAIRN_REAL(4.0)
/* Nats that a place must have to be tried at all: what hangs on little is cut off in the end. */
#define LEAST CAIRN_REAL(2.0)
/* Rounds of a candidate's refinement by lines. */
enum { LINE_ROUNDS = 4 };
/* A map is put or put aside, and that twice: its place may be seen when others have theirs. */
enum { STEPS_OF_A_MAP = 2 };

cairn_particle_filter_params cairn_merge_filter_params(const cairn_map_merge_params *p)
{
    cairn_particle_filter_params f = cairn_particle_filter_default();

    f.particles = f.max_particles = p->particles;
    f.max_followers = MERGE_FOLLOWERS;
    f.max_candidates = p->particles * MERGE_FOLLOWERS;
    f.max_blocks = p->particles * (STEPS_OF_A_MAP * p->max_maps + 2) + 1;
    f.state_bytes = (int32_t)sizeof(merge_state);
    f.by_entropy = 0;
    return f;
}

/* ---- Proposal ---- */

int cairn_merge_gather(cairn_map_merge *m, const void *state)
{
    int ended = 0;

    m->near_count = 0;
    memset(m->aside, 0, sizeof m->aside);
    for (const merge_state *s = state; s != NULL; s = cairn_particle_state_before(s)) {
        if (s->map < 0) {
            ended |= s->map == MERGE_ENDED;
            if (s->map != MERGE_ENDED)
                m->aside[MERGE_ASIDE - s->map]++;
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

/* The map that comes next, of those that were put aside so often: by the order, or the one whose
 * best mode beside any placed map is best. -1: none. */
static int32_t next_map(const cairn_map_merge *m, int32_t aside)
{
    cairn_real best = 0;
    int32_t next = -1;

    for (int32_t n = 0; n < m->map_count && !(m->has_order && next >= 0); n++) {
        int32_t map = m->has_order ? m->order[n] : n;

        for (int32_t i = 0; i < m->near_count && m->aside[map] == aside && !is_near(m, map); i++) {
            merge_mode mode;

            if (mode_of(m, m->near[i], map, 0, &mode) && mode.evidence > best) {
                best = mode.evidence;
                next = map;
            }
        }
    }
    return next;
}

int32_t cairn_merge_places(const cairn_map_merge *m, int32_t map, merge_mode *list, int32_t most)
{
    int32_t count = 0;

    for (int32_t i = 0; i < m->near_count; i++) {
        merge_mode mode;

        for (int32_t k = 0; mode_of(m, m->near[i], map, k, &mode); k++) {
            mode.first_second = cairn_pose_compose(m->near_pose[i], mode.first_second);
            cairn_merge_keep(list, &count, most, mode, MERGE_SAME_M, MERGE_SAME_RAD);
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
    merge_state none = {MERGE_ENDED, -1, {0, 0, 0}, LEAST, 0, 0};
    int32_t map = next_map(m, 0), count;

    if (map < 0)
        map = next_map(m, 1);
    if (map >= 0)
        none.map = MERGE_ASIDE - map;
    count = map < 0 ? 0 : cairn_merge_places(m, map, places, MERGE_FOLLOWERS - 1);

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
    m->offer.gamma_least =
        m->offer.offered == 0 ? s->gamma : cairn_min(m->offer.gamma_least, s->gamma);
    m->offer.offered++;
}

/* Psi and gamma beside the neighbour that shares most with the map. */
static void see_images(cairn_map_merge *m, merge_state *s)
{
    cairn_real most = -1;

    s->psi = s->gamma = 0;
    for (int32_t i = 0; i < m->near_count && s->map >= 0; i++) {
        cairn_merge_score score;

        cairn_merge_score_at(m, m->near[i], s->map,
                             cairn_pose_between(m->near_pose[i], s->reference_map), &score);
        if (score.overlap > most) {
            most = score.overlap;
            s->psi = score.psi;
            s->gamma = score.gamma;
        }
    }
}

static int is_same_pose(cairn_pose a, cairn_pose b)
{
    return a.x == b.x && a.y == b.y && a.theta == b.theta;
}

int cairn_merge_is_same_history(const merge_state *a, const merge_state *b)
{
    while (a != NULL && b != NULL && a != b) {
        if (a->map != b->map || !is_same_pose(a->reference_map, b->reference_map))
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
        if (m->offer.made[i].state != NULL &&
            cairn_merge_is_same_history(m->offer.made[i].state, state))
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
    } else if (cairn_merge_gather(m, state)) {
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

static cairn_status propose(void *context, cairn_particle_filter *filter, int32_t index,
                            cairn_budget *budget)
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
        if (offer->list[m->offer.at].map >= 0 &&
            !step_candidate(m, &offer->list[m->offer.at], budget))
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

static cairn_status likelihood(void *context, const cairn_particle_filter *filter, int32_t index,
                               const void *state, cairn_real *log_likelihood, cairn_budget *budget)
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

/* Where the merging starts: at a map of the pair that has most evidence, so that what is weak
 * meets many maps at once; at the reference when an order or an earlier merging is given. */
static int32_t first_map(const cairn_map_merge *m)
{
    int32_t first = m->reference;
    cairn_real best = 0;

    for (int32_t map = 0; map < m->map_count; map++)
        if (m->has_order || m->maps[map].has_guess)
            return m->reference;
    for (int32_t b = 1; b < m->map_count; b++)
        for (int32_t a = 0; a < b; a++) {
            merge_mode mode;

            if (mode_of(m, a, b, 0, &mode) && mode.evidence > best) {
                best = mode.evidence;
                first = b == m->reference ? b : a;
            }
        }
    return first;
}

static void begin_filter(cairn_map_merge *m)
{
    const merge_state first = {first_map(m), -1, {0, 0, 0}, 0, 0, 0};
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
    for (; m->merged < STEPS_OF_A_MAP * (m->map_count - 1); m->merged++, m->cursor = 0) {
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
