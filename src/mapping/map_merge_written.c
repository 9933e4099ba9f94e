/* The particle filter of map merging as written.
 *
 * A state says where one map was put. A particle proposes every registration of every map not
 * merged yet (or of that which the order names) with a map that it has merged; the prior mass of
 * a place is the sum of Gaussians about all registrations of its map; its likelihood is Psi~
 * gamma~ against the image of all maps merged. The best particle in the end is the result.
 * Source: Adluru 2008, sections 9.2 and 9.3. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/map_merge_work.h"

/* m and rad: how wide the Gaussian about a registration is. */
#define PLACE_SIGMA CAIRN_REAL(0.20)
#define TURN_SIGMA  CAIRN_REAL(0.05)

/* Candidates of all particles at most, as many as the filter takes. */
enum { CANDIDATES_MOST = 1 << 20 };

/* Of a particle: maps merged times maps left, and a list of registrations for each such pair. */
static int32_t places_of(const cairn_map_merge_params *p)
{
    int32_t pairs = p->max_maps * p->max_maps / 4;
    int32_t places = (pairs > 0 ? pairs : 1) * p->max_modes;
    int32_t most = CANDIDATES_MOST / (MERGE_GROWTH * p->particles);

    places = places < MERGE_PLACES_MOST ? places : MERGE_PLACES_MOST;
    return places < most ? places : most;
}

cairn_particle_filter_params cairn_merge_written_params(const cairn_map_merge_params *p)
{
    cairn_particle_filter_params f = cairn_particle_filter_default();

    f.particles = p->particles;
    f.max_particles = MERGE_GROWTH * p->particles;
    f.max_followers = MERGE_FOLLOWERS;
    f.max_candidates = f.max_particles * places_of(p);
    f.max_blocks = f.max_particles * (p->max_maps + 1) + 1;
    f.state_bytes = (int32_t)sizeof(merge_state);
    return f;
}

/* ---- Proposal ---- */

static int is_near(const cairn_map_merge *m, int32_t map)
{
    for (int32_t i = 0; i < m->near_count; i++)
        if (m->near[i] == map)
            return 1;
    return 0;
}

static int32_t registrations_of(const cairn_map_merge *m, int32_t a, int32_t b)
{
    return m->mode_count[a < b ? merge_pair(a, b) : merge_pair(b, a)];
}

/* Registration `index` of map b with map a, as a place of b seen from a. */
static cairn_pose registration_at(const cairn_map_merge *m, int32_t a, int32_t b, int32_t index)
{
    size_t pair = (size_t)(a < b ? merge_pair(a, b) : merge_pair(b, a));
    cairn_pose pose = m->modes[pair * (size_t)m->params.max_modes + (size_t)index].first_second;

    return a < b ? pose : cairn_pose_inverse(pose);
}

/* 1 when a map has a registration with one of near[]. */
static int is_within_reach(const cairn_map_merge *m, int32_t map)
{
    for (int32_t i = 0; i < m->near_count; i++)
        if (registrations_of(m, m->near[i], map) > 0)
            return 1;
    return 0;
}

/* With a known order the first map of it that can be registered; -1 without an order, or when
 * there is none. */
static int32_t next_in_order(const cairn_map_merge *m)
{
    for (int32_t n = 0; n < m->map_count && m->has_order; n++)
        if (!is_near(m, m->order[n]) && is_within_reach(m, m->order[n]))
            return m->order[n];
    return -1;
}

/* Places of `map` by the registrations of that index, as far as there is room. */
static void list_places(cairn_map_merge *m, merge_places *places, int32_t map, int32_t index)
{
    merge_written *w = m->written;

    for (int32_t i = 0; i < m->near_count && places->count < places_of(&m->params); i++) {
        merge_state *s = &w->list[w->listed];

        if (index >= registrations_of(m, m->near[i], map))
            continue;
        memset(s, 0, sizeof *s);
        s->map = map;
        s->beside = m->near[i];
        s->reference_map =
            cairn_pose_compose(m->near_pose[i], registration_at(m, m->near[i], map, index));
        if (!cairn_merge_has_room(
                m, cairn_merge_join(w->box, cairn_merge_box_of(&m->maps[map], s->reference_map))))
            continue;
        w->listed++;
        places->count++;
    }
}

/* The most similar corners of all pairs first, then the next ones, so that what has no room is
 * least similar. */
static void list_candidates(cairn_map_merge *m, merge_places *places)
{
    int32_t next = next_in_order(m);

    places->first = m->written->listed;
    places->count = 0;
    for (int32_t index = 0; index < m->params.max_modes; index++)
        for (int32_t map = 0; map < m->map_count; map++)
            if (!is_near(m, map) && (next < 0 || map == next))
                list_places(m, places, map, index);
}

/* The sum of the Gaussians about all registrations of a candidate's map. */
static cairn_real log_prior(const cairn_map_merge *m, const merge_places *places,
                            const merge_state *s)
{
    const merge_state *list = m->written->list + places->first;
    cairn_real sum = 0;

    for (int32_t i = 0; i < places->count; i++) {
        cairn_real x = (list[i].reference_map.x - s->reference_map.x) / PLACE_SIGMA;
        cairn_real y = (list[i].reference_map.y - s->reference_map.y) / PLACE_SIGMA;
        cairn_real turn =
            cairn_wrap_angle(list[i].reference_map.theta - s->reference_map.theta) / TURN_SIGMA;
        cairn_real squared = x * x + y * y + turn * turn;

        if (list[i].map == s->map && squared < 50)
            sum += cairn_exp(-squared / 2);
    }
    return cairn_log(sum);
}

enum { OFFER_FIND, OFFER_DRAW, OFFER_LIST, OFFER_WEIGH, OFFER_OUT };

/* The candidates of an earlier particle with the same history, or none yet. */
static int find_places(cairn_map_merge *m, int32_t index, const merge_state *state)
{
    merge_places *places = m->written->places;

    places[index].state = state;
    places[index].first = places[index].count = 0;
    for (int32_t i = 0; i < index; i++)
        if (cairn_merge_is_same_history(places[i].state, state)) {
            places[index].first = places[i].first;
            places[index].count = places[i].count;
            return 1;
        }
    return 0;
}

/* Prior mass, Psi and gamma of every candidate. */
static int weigh_places(cairn_map_merge *m, const merge_places *places, cairn_budget *budget)
{
    merge_written *w = m->written;

    for (; w->at < places->count; w->at++, w->stage = 0) {
        merge_state *s = &w->list[places->first + w->at];
        cairn_merge_score score;

        if (w->stage == 0) {
            if (!cairn_budget_pay(budget, &m->paid, 2 + places->count))
                return 0;
            s->evidence = log_prior(m, places, s);
            cairn_merge_begin_images(&w->images, &w->merged, &m->maps[s->map], s->reference_map);
            w->stage = 1;
        }
        if (!cairn_merge_go_on_images(&w->images, w->kernel, &m->paid, budget))
            return 0;
        cairn_merge_end_images(&w->images, &score);
        s->psi = score.psi;
        s->gamma = score.gamma;
    }
    return 1;
}

/* Gamma is counted from that of the first candidate on: the sum of equal ones is 0 in spite of
 * rounding. */
static void count_images(merge_written *w, const merge_state *s)
{
    if (w->offered == 0) {
        w->gamma_first = s->gamma;
        w->psi_sum = w->gamma_sum = w->gamma_least = 0;
    }
    w->psi_sum += s->psi;
    w->gamma_sum += s->gamma - w->gamma_first;
    w->gamma_least = cairn_min(w->gamma_least, s->gamma - w->gamma_first);
    w->offered++;
}

/* The logarithm of Psi~ gamma~, each normalised over the candidates of all particles; where a
 * sum is 0 all have 1. */
static cairn_real log_images(const merge_written *w, const merge_state *s)
{
    cairn_real gammas = w->gamma_sum - (cairn_real)w->offered * w->gamma_least;
    cairn_real psi = w->psi_sum > 0 ? s->psi / w->psi_sum : 1;
    cairn_real gamma = gammas > 0 ? (s->gamma - w->gamma_first - w->gamma_least) / gammas : 1;

    if (w->offered < 2)
        return 0;
    return psi * gamma > 0 ? cairn_log(psi * gamma) : -CAIRN_REAL_MAX;
}

static cairn_status propose(void *context, cairn_particle_filter *filter, int32_t index,
                            cairn_budget *budget)
{
    cairn_map_merge *m = context;
    merge_written *w = m->written;
    merge_places *places = &w->places[index];

    if (m->offer.stage == OFFER_FIND) {
        const merge_state *state = cairn_particle_filter_particle(filter, index).state;

        if (!cairn_budget_pay(budget, &m->paid, 1 + index + m->map_count))
            return CAIRN_MORE;
        m->offer.stage = find_places(m, index, state) ? OFFER_OUT : OFFER_DRAW;
        if (m->offer.stage == OFFER_DRAW)
            (void)cairn_merge_gather(m, state);
        w->stage = 0;
    }
    if (m->offer.stage == OFFER_DRAW) {
        if (!cairn_merge_draw_merged(m, budget))
            return CAIRN_MORE;
        m->offer.stage = OFFER_LIST;
    }
    if (m->offer.stage == OFFER_LIST) {
        if (!cairn_budget_pay(budget, &m->paid,
                              1 + m->near_count * m->map_count + 2 * places_of(&m->params)))
            return CAIRN_MORE;
        list_candidates(m, places);
        m->offer.stage = OFFER_WEIGH;
        w->stage = 0;
        w->at = 0;
    }
    if (m->offer.stage == OFFER_WEIGH && !weigh_places(m, places, budget))
        return CAIRN_MORE;
    m->offer.stage = OFFER_OUT;
    if (!cairn_budget_pay(budget, &m->paid, 1 + places->count / 4))
        return CAIRN_MORE;
    for (int32_t i = 0; i < places->count; i++) {
        const merge_state *s = &w->list[places->first + i];
        cairn_status status = cairn_particle_filter_offer(filter, s, s->evidence);

        CAIRN_ASSERT(status == CAIRN_OK);
        (void)status;
        count_images(w, s);
    }
    m->offer.stage = OFFER_FIND;
    return CAIRN_OK;
}

static cairn_status likelihood(void *context, const cairn_particle_filter *filter, int32_t index,
                               const void *state, cairn_real *log_likelihood, cairn_budget *budget)
{
    const cairn_map_merge *m = context;

    (void)filter;
    (void)index;
    (void)budget;
    *log_likelihood = log_images(m->written, state);
    return CAIRN_OK;
}

cairn_particle_model cairn_merge_written_model(cairn_map_merge *m)
{
    cairn_particle_model model = {m, propose, likelihood, NULL, NULL};

    return model;
}

/* ---- The filter ---- */

/* Maps that registrations connect with the reference, in near[]. */
static void gather_connected(cairn_map_merge *m)
{
    m->near[0] = m->reference;
    m->near_count = 1;
    for (int32_t map = 0; map < m->map_count;) {
        if (!is_near(m, map) && is_within_reach(m, map)) {
            m->near[m->near_count++] = map;
            map = 0;
        } else {
            map++;
        }
    }
}

static void begin_filter(cairn_map_merge *m)
{
    const merge_state first = {m->reference, -1, {0, 0, 0}, 0, 0, 0};
    cairn_status status = cairn_particle_filter_clear(m->filter, m->params.seed);

    CAIRN_ASSERT(status == CAIRN_OK);
    status = cairn_particle_filter_start(m->filter, &first, 0);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    gather_connected(m);
    m->written->steps = m->near_count - 1;
    m->written->most_particles = 1;
    m->merged = 0;
    m->phase = MERGE_FILTER;
    m->cursor = 0;
}

cairn_status cairn_merge_run_written(cairn_map_merge *m, cairn_budget *budget)
{
    merge_written *w = m->written;

    if (m->phase != MERGE_FILTER) {
        if (!cairn_budget_pay(budget, &m->paid, 1 + m->map_count * m->map_count))
            return CAIRN_MORE;
        begin_filter(m);
    }
    for (; m->merged < w->steps; m->merged++, m->cursor = 0) {
        cairn_status status;
        int32_t count;

        if (m->cursor == 0) {
            status = cairn_particle_filter_begin(m->filter);
            CAIRN_ASSERT(status == CAIRN_OK);
            m->offer.stage = OFFER_FIND;
            w->offered = 0;
            w->listed = 0;
            m->cursor = 1;
        }
        status = cairn_particle_filter_step(m->filter, budget);
        if (status == CAIRN_MORE)
            return status;
        CAIRN_ASSERT(status == CAIRN_OK);
        count = cairn_particle_filter_count(m->filter);
        w->most_particles = count > w->most_particles ? count : w->most_particles;
        if (cairn_particle_filter_read(m->filter).extinct)
            w->steps = m->merged;
    }
    return CAIRN_OK;
}

/* ---- The result ---- */

/* The weight of the particles that have a map where the best one has it. */
static cairn_real weight_of(const cairn_map_merge *m, int32_t map)
{
    cairn_real sum = 0;

    for (int32_t i = 0; i < cairn_particle_filter_count(m->filter); i++) {
        cairn_particle p = cairn_particle_filter_particle(m->filter, i);

        for (const merge_state *s = p.state; s != NULL; s = cairn_particle_state_before(s))
            if (s->map == map && cairn_merge_is_same(s->reference_map, m->check.pose[map],
                                                     MERGE_SAME_M, MERGE_SAME_RAD))
                sum += cairn_exp(p.log_weight);
    }
    return sum;
}

/* The maps of the best particle, in the order in which it has merged them. */
static void take_best(cairn_map_merge *m)
{
    const merge_state *best =
        cairn_particle_filter_particle(m->filter, cairn_particle_filter_read(m->filter).best).state;

    (void)cairn_merge_gather(m, best);
    memset(&m->check, 0, sizeof m->check);
    memset(m->placed, 0, sizeof m->placed);
    for (int32_t i = 0; i < m->map_count; i++) {
        m->placed[i].verdict = m->maps[i].point_count == 0 || m->maps[i].free == 0
                                   ? CAIRN_MERGE_EMPTY
                               : is_near(m, i) || is_within_reach(m, i) ? CAIRN_MERGE_NO_OVERLAP
                                                                        : CAIRN_MERGE_NO_CORNER;
        m->placed[i].corners = m->maps[i].corner_count;
        m->placed[i].wrong = 1;
    }
    m->check.count = m->near_count;
    for (const merge_state *s = best; s != NULL; s = cairn_particle_state_before(s)) {
        cairn_merge_placed *p = &m->placed[s->map];

        m->check.list[--m->near_count] = s->map;
        m->check.pose[s->map] = s->reference_map;
        m->check.accepted[s->map] = 1;
        p->verdict = CAIRN_MERGE_PLACED;
        p->support = s->psi;
        p->neighbours = s->beside >= 0;
        p->modes = s->beside >= 0 ? registrations_of(m, s->beside, s->map) : 0;
    }
}

cairn_status cairn_merge_end_written(cairn_map_merge *m, cairn_budget *budget)
{
    if (m->phase != MERGE_CHECK) {
        if (!cairn_budget_pay(budget, &m->paid, 1 + m->map_count * m->map_count))
            return CAIRN_MORE;
        take_best(m);
        m->phase = MERGE_CHECK;
        m->cursor = 1;
    }
    for (; m->cursor < m->check.count; m->cursor++) {
        int32_t map = m->check.list[m->cursor];

        if (!cairn_budget_pay(budget, &m->paid,
                              1 + cairn_particle_filter_count(m->filter) * m->check.count))
            return CAIRN_MORE;
        m->placed[map].wrong = cairn_max(0, cairn_min(1, 1 - weight_of(m, map)));
    }
    m->placed[m->reference].wrong = 0;
    return CAIRN_OK;
}
