/* Particle filter of map merging as written.
 *
 * Method.
 *
 * 1. A state is the pose of one map in the merged frame.
 * 2. Proposal: a particle proposes every registration of every unmerged map (or of the next one of
 *    a given order) with a merged map.
 * 3. The prior mass of a pose is the sum of Gaussians about all registrations of its map.
 * 4. Its likelihood is Psi~ gamma~ against the image of all merged maps. The best particle in the
 *    end is the result.
 *
 * Source: Adluru 2008, sections 9.2 and 9.3. */
#include "src/base/build.h"

#include <string.h>

#include "src/merging/map_merge_work.h"

/* m and rad: standard deviation of the Gaussian about a registration */
#define PRIOR_SIGMA_M   CAIRN_REAL(0.20)
#define PRIOR_SIGMA_RAD CAIRN_REAL(0.05)

/* maximum candidates of all particles, the filter's limit */
enum { MAX_CANDIDATES = 1 << 20 };

/* candidates that are offered per unit */
enum { OFFERS_PER_UNIT = 4 };

/* Returns the number of candidates of a particle: merged maps times remaining maps, times the
 * registrations of a pair. */
static int32_t places_of(const cairn_map_merge_params *params)
{
    int32_t pairs = params->max_maps * params->max_maps / 4;
    int32_t places = (pairs > 0 ? pairs : 1) * params->max_modes;
    int32_t most = MAX_CANDIDATES / (MAP_MERGE_GROWTH * params->particles);

    places = places < MAP_MERGE_MAX_PLACES ? places : MAP_MERGE_MAX_PLACES;
    return places < most ? places : most;
}

cairn_particle_filter_params cairn_map_merge_written_params(const cairn_map_merge_params *params)
{
    cairn_particle_filter_params f = cairn_particle_filter_default();

    f.particles = params->particles;
    f.max_particles = MAP_MERGE_GROWTH * params->particles;
    f.max_followers = MAP_MERGE_MAX_CANDIDATES;
    f.max_candidates = f.max_particles * places_of(params);
    f.max_blocks = f.max_particles * (params->max_maps + 1) + 1;
    f.state_bytes = (int32_t)sizeof(map_merge_state);
    return f;
}

/* ---- Proposal ---- */

static int32_t registrations_of(const cairn_map_merge *merge, int32_t a, int32_t b)
{
    return merge->pairs.mode_count[cairn_map_merge_pair(a, b)];
}

/* Returns 1 when a map has a registration with a neighbour. */
static int is_within_reach(const cairn_map_merge *merge, int32_t map)
{
    for (int32_t i = 0; i < merge->neighbours.count; i++)
        if (registrations_of(merge, merge->neighbours.maps[i], map) > 0)
            return 1;
    return 0;
}

/* Returns the first map of the given order that can be registered; -1 without an order, or none. */
static int32_t next_in_order(const cairn_map_merge *merge)
{
    for (int32_t n = 0; n < merge->map_count && merge->has_order; n++)
        if (!map_merge_is_neighbour(merge, merge->order[n]) &&
            is_within_reach(merge, merge->order[n]))
            return merge->order[n];
    return -1;
}

/* Adds the candidates of `map` by the registrations of that index; those beyond the capacity are
 * counted. */
static void list_places(cairn_map_merge *merge, map_merge_places *places, int32_t map,
                        int32_t index)
{
    map_merge_written *w = merge->written;
    int32_t capacity = places_of(&merge->params);

    for (int32_t i = 0; i < merge->neighbours.count; i++) {
        map_merge_state *s = &w->candidates[w->candidate_count];
        map_merge_mode registration;

        if (!cairn_map_merge_mode_of(merge, merge->neighbours.maps[i], map, index, &registration))
            continue;
        if (places->count >= capacity) {
            w->dropped_count++;
            continue;
        }
        memset(s, 0, sizeof *s);
        s->map = map;
        s->source_map = merge->neighbours.maps[i];
        s->reference_map =
            cairn_pose_compose(merge->neighbours.poses[i], registration.first_second);
        if (!cairn_map_merge_has_capacity(
                merge, cairn_map_merge_join(
                           w->box, cairn_map_merge_box_of(&merge->maps[map], s->reference_map))))
            continue;
        w->candidate_count++;
        places->count++;
    }
}

/* Adds the most similar corners of all pairs first, so the least similar ones exceed the
 * capacity. */
static void list_candidates(cairn_map_merge *merge, map_merge_places *places)
{
    int32_t next = next_in_order(merge);

    places->first = merge->written->candidate_count;
    places->count = 0;
    for (int32_t index = 0; index < merge->params.max_modes; index++)
        for (int32_t map = 0; map < merge->map_count; map++)
            if (!map_merge_is_neighbour(merge, map) && (next < 0 || map == next))
                list_places(merge, places, map, index);
}

/* Returns the log of the sum of Gaussians about all registrations of a candidate's map. */
static cairn_real log_prior(const cairn_map_merge *merge, const map_merge_places *places,
                            const map_merge_state *state)
{
    const map_merge_state *list = merge->written->candidates + places->first;
    cairn_real sum = 0;

    for (int32_t i = 0; i < places->count; i++) {
        cairn_real x = (list[i].reference_map.x - state->reference_map.x) / PRIOR_SIGMA_M;
        cairn_real y = (list[i].reference_map.y - state->reference_map.y) / PRIOR_SIGMA_M;
        cairn_real turn =
            cairn_wrap_angle(list[i].reference_map.theta - state->reference_map.theta) /
            PRIOR_SIGMA_RAD;
        cairn_real squared = x * x + y * y + turn * turn;

        if (list[i].map == state->map && squared < 50)
            sum += cairn_exp(-squared / 2);
    }
    return cairn_log(sum);
}

/* Shares the candidates of an earlier particle of the same history; returns 0 when there is
 * none. */
static int find_places(cairn_map_merge *merge, int32_t index, const map_merge_state *state)
{
    map_merge_places *places = merge->written->places;

    places[index].state = state;
    places[index].first = places[index].count = 0;
    for (int32_t i = 0; i < index; i++)
        if (cairn_map_merge_is_same_history(places[i].state, state)) {
            places[index].first = places[i].first;
            places[index].count = places[i].count;
            return 1;
        }
    return 0;
}

/* Computes the prior mass of the current candidate, and begins to compare its image with that of the
 * merged maps. */
static void begin_candidate(cairn_map_merge *merge, const map_merge_places *places)
{
    map_merge_written *w = merge->written;
    map_merge_state *s = &w->candidates[places->first + w->candidate];

    s->log_ratio = log_prior(merge, places, s);
    cairn_map_merge_begin_images(&w->images, &w->merged, &merge->maps[s->map], s->reference_map);
}

/* Sets Psi and gamma of the current candidate. */
static void end_candidate(map_merge_written *written, const map_merge_places *places)
{
    map_merge_state *s = &written->candidates[places->first + written->candidate];
    cairn_map_merge_pair_score score;

    cairn_map_merge_end_images(&written->images, &score);
    s->psi = score.psi;
    s->gamma = score.gamma;
}

/* Step: computes prior mass, Psi and gamma of every candidate. */
static int score_places(cairn_map_merge *merge, const map_merge_places *places,
                        cairn_budget *budget)
{
    map_merge_written *w = merge->written;

    CAIRN_STEP_BEGIN(merge->resume.part);
    for (w->candidate = 0; w->candidate < places->count; w->candidate++) {
        CAIRN_STEP_CHARGE(merge, resume.part, budget, 2 + places->count);
        begin_candidate(merge, places);
        CAIRN_STEP_UNTIL(merge->resume.part,
                         cairn_map_merge_step_images(&w->images, w->kernel, budget));
        end_candidate(w, places);
    }
    CAIRN_STEP_END(merge->resume.part);
}

/* Accumulates Psi and gamma. gamma is relative to the first candidate's: the sum of equal ones is
 * then 0 despite rounding. */
static void add_image_scores(map_merge_written *written, const map_merge_state *state)
{
    if (written->emitted == 0) {
        written->gamma_first = state->gamma;
        written->psi_sum = written->gamma_sum = written->gamma_min = 0;
    }
    written->psi_sum += state->psi;
    written->gamma_sum += state->gamma - written->gamma_first;
    written->gamma_min = cairn_min(written->gamma_min, state->gamma - written->gamma_first);
    written->emitted++;
}

/* Returns log(Psi~ gamma~), each normalized over the candidates of all particles; 0 where a sum is
 * 0. */
static cairn_real log_images(const map_merge_written *written, const map_merge_state *state)
{
    cairn_real gammas = written->gamma_sum - (cairn_real)written->emitted * written->gamma_min;
    cairn_real psi = written->psi_sum > 0 ? state->psi / written->psi_sum : 1;
    cairn_real gamma =
        gammas > 0 ? (state->gamma - written->gamma_first - written->gamma_min) / gammas : 1;

    if (written->emitted < 2)
        return 0;
    return psi * gamma > 0 ? cairn_log(psi * gamma) : -CAIRN_REAL_MAX;
}

/* Returns the units of listing candidates. */
static int32_t listing_units(const cairn_map_merge *merge)
{
    return 1 + merge->neighbours.count * merge->map_count + 2 * places_of(&merge->params);
}

static void offer_candidates(cairn_map_merge *merge, cairn_particle_filter *filter,
                             const map_merge_places *places)
{
    for (int32_t i = 0; i < places->count; i++) {
        const map_merge_state *s = &merge->written->candidates[places->first + i];

        cairn_must_be_ok(cairn_particle_filter_offer(filter, s, s->log_ratio));
        add_image_scores(merge->written, s);
    }
}

/* Step: proposes the candidates of particle `index`. */
static int propose_next(cairn_map_merge *merge, cairn_particle_filter *filter, int32_t index,
                        cairn_budget *budget)
{
    map_merge_places *places = &merge->written->places[index];
    const map_merge_state *state = cairn_particle_filter_particle(filter, index).state;

    CAIRN_STEP_BEGIN(merge->resume.phase);
    CAIRN_STEP_CHARGE(merge, resume.phase, budget, 1 + index + merge->map_count);
    if (!find_places(merge, index, state)) {
        (void)cairn_map_merge_collect_neighbours(merge, state);
        CAIRN_STEP_RUN(merge, resume.phase, budget, cairn_map_merge_draw_merged);
        CAIRN_STEP_CHARGE(merge, resume.phase, budget, listing_units(merge));
        list_candidates(merge, places);
        CAIRN_STEP_UNTIL(merge->resume.phase, score_places(merge, places, budget));
    }
    CAIRN_STEP_CHARGE(merge, resume.phase, budget, 1 + places->count / OFFERS_PER_UNIT);
    offer_candidates(merge, filter, places);
    CAIRN_STEP_END(merge->resume.phase);
}

static cairn_status propose(void *context, cairn_particle_filter *filter, int32_t index,
                            cairn_budget *budget)
{
    return propose_next(context, filter, index, budget) ? CAIRN_OK : CAIRN_MORE;
}

static cairn_status likelihood(void *context, const cairn_particle_filter *filter, int32_t index,
                               const void *state, cairn_real *log_likelihood, cairn_budget *budget)
{
    const cairn_map_merge *merge = context;

    (void)filter;
    (void)index;
    (void)budget;
    *log_likelihood = log_images(merge->written, state);
    return CAIRN_OK;
}

cairn_particle_filter_model cairn_map_merge_written_model(cairn_map_merge *merge)
{
    cairn_particle_filter_model model = {merge, propose, likelihood, NULL, NULL};

    return model;
}

/* ---- The filter ---- */

/* Sets the neighbours to the maps that registrations connect with the reference. */
static void gather_connected(cairn_map_merge *merge)
{
    merge->neighbours.maps[0] = merge->reference;
    merge->neighbours.count = 1;
    for (int32_t map = 0; map < merge->map_count;) {
        if (!map_merge_is_neighbour(merge, map) && is_within_reach(merge, map)) {
            merge->neighbours.maps[merge->neighbours.count++] = map;
            map = 0;
        } else {
            map++;
        }
    }
}

static void begin_filter(cairn_map_merge *merge)
{
    const map_merge_state first = {
        .map = merge->reference,
        .source_map = -1,
        .reference_map = {0, 0, 0},
        .log_ratio = 0,
        .psi = 0,
        .gamma = 0,
    };

    cairn_must_be_ok(cairn_particle_filter_clear(merge->filter, merge->params.seed));
    cairn_must_be_ok(cairn_particle_filter_start(merge->filter, &first, 0));
    gather_connected(merge);
    merge->written->steps = merge->neighbours.count - 1;
    merge->written->peak_particles = 1;
    merge->written->dropped_count = 0;
}

static void begin_filter_step(cairn_map_merge *merge)
{
    cairn_must_be_ok(cairn_particle_filter_begin(merge->filter));
    merge->written->emitted = 0;
    merge->written->candidate_count = 0;
}

/* Returns 0 when no particle has a follower, and the filter ends. */
static int end_filter_step(cairn_map_merge *merge)
{
    map_merge_written *w = merge->written;
    int32_t count = cairn_particle_filter_count(merge->filter);

    w->peak_particles = count > w->peak_particles ? count : w->peak_particles;
    return !cairn_particle_filter_read(merge->filter).depleted;
}

/* Returns the units of what each pair of maps costs once. */
static int32_t pair_units(const cairn_map_merge *merge)
{
    return 1 + merge->map_count * merge->map_count;
}

/* Returns the units of the maps in reach, and of releasing the states of an earlier merging. */
static int32_t begin_units(const cairn_map_merge *merge)
{
    return pair_units(merge) +
           cairn_map_merge_written_params(&merge->params).max_blocks / MAP_MERGE_BLOCKS_PER_UNIT;
}

int cairn_map_merge_run_written(cairn_map_merge *merge, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(merge->resume.stage);
    CAIRN_STEP_CHARGE(merge, resume.stage, budget, begin_units(merge));
    begin_filter(merge);
    for (merge->filter_step = 0; merge->filter_step < merge->written->steps; merge->filter_step++) {
        begin_filter_step(merge);
        CAIRN_STEP_UNTIL(merge->resume.stage,
                         cairn_particle_filter_step(merge->filter, budget) != CAIRN_MORE);
        if (!end_filter_step(merge))
            break;
    }
    CAIRN_STEP_END(merge->resume.stage);
}

/* ---- The result ---- */

/* Returns the weight of the particles that have a map at the best particle's pose. */
static cairn_real weight_of(const cairn_map_merge *merge, int32_t map)
{
    cairn_real sum = 0;

    for (int32_t i = 0; i < cairn_particle_filter_count(merge->filter); i++) {
        cairn_particle p = cairn_particle_filter_particle(merge->filter, i);

        for (const map_merge_state *s = p.state; s != NULL;
             s = cairn_particle_filter_state_before(s))
            if (s->map == map && cairn_map_merge_is_same(s->reference_map, merge->check.pose[map],
                                                         MAP_MERGE_SAME_M, MAP_MERGE_SAME_RAD))
                sum += cairn_exp(p.log_weight);
    }
    return sum;
}

/* Copies the maps of the best particle, in the order of merging. */
static void take_best(cairn_map_merge *merge)
{
    const map_merge_state *best = cairn_particle_filter_particle(
                                      merge->filter, cairn_particle_filter_read(merge->filter).best)
                                      .state;

    (void)cairn_map_merge_collect_neighbours(merge, best);
    memset(&merge->check, 0, sizeof merge->check);
    memset(merge->placed, 0, sizeof merge->placed);
    for (int32_t i = 0; i < merge->map_count; i++) {
        merge->placed[i].verdict = merge->maps[i].point_count == 0 || merge->maps[i].free_count == 0
                                       ? CAIRN_MAP_MERGE_EMPTY
                                   : map_merge_is_neighbour(merge, i) || is_within_reach(merge, i)
                                       ? CAIRN_MAP_MERGE_NO_OVERLAP
                                       : CAIRN_MAP_MERGE_NO_CORNER;
        merge->placed[i].corners = merge->maps[i].corner_count;
        merge->placed[i].error_probability = 1;
    }
    merge->check.count = merge->neighbours.count;
    for (const map_merge_state *s = best; s != NULL; s = cairn_particle_filter_state_before(s)) {
        cairn_map_merge_placed *p = &merge->placed[s->map];

        merge->check.list[--merge->neighbours.count] = s->map;
        merge->check.pose[s->map] = s->reference_map;
        merge->check.accepted[s->map] = 1;
        p->verdict = CAIRN_MAP_MERGE_PLACED;
        p->support = s->psi;
        p->neighbours = s->source_map >= 0;
        p->modes = s->source_map >= 0 ? registrations_of(merge, s->source_map, s->map) : 0;
    }
}

/* Returns the units of the weight of a map's pose. */
static int32_t weight_units(const cairn_map_merge *merge)
{
    return 1 + cairn_particle_filter_count(merge->filter) * merge->check.count;
}

int cairn_map_merge_end_written(cairn_map_merge *merge, cairn_budget *budget)
{
    map_merge_verification *check = &merge->check;

    CAIRN_STEP_BEGIN(merge->resume.stage);
    CAIRN_STEP_CHARGE(merge, resume.stage, budget, pair_units(merge));
    take_best(merge);
    for (check->current = 1; check->current < check->count; check->current++) {
        CAIRN_STEP_CHARGE(merge, resume.stage, budget, weight_units(merge));
        merge->placed[check->list[check->current]].error_probability =
            cairn_max(0, cairn_min(1, 1 - weight_of(merge, check->list[check->current])));
    }
    merge->placed[merge->reference].error_probability = 0;
    CAIRN_STEP_END(merge->resume.stage);
}
