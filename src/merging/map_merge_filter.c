/* Particle filter over the poses of the maps (the virtual robot).
 *
 * Method.
 *
 * 1. A state is the pose of one map in the merged frame.
 * 2. Proposal: a particle proposes the next map, the one whose best mode has the largest
 *    log-likelihood ratio (or the next of a given order). Candidates are its competing modes
 *    relative to the maps placed so far, and deferral until all others had their turn.
 * 3. Likelihood: the log-likelihood ratio against all placed maps, tempered because errors of
 *    neighbouring walls are correlated.
 * 4. Scores of pairs are cached, since most particles agree. */
#include "src/base/build.h"

#include <string.h>

#include "src/merging/map_merge_work.h"

/* nats of log-likelihood ratio per nat of log-likelihood */
#define LIKELIHOOD_TEMPERATURE CAIRN_REAL(4.0)
/* nats: minimum log-likelihood ratio of a candidate; weakly supported maps are cut off in the
 * end */
#define MIN_LOG_RATIO CAIRN_REAL(2.0)
/* maximum steps of a candidate's refinement by lines */
enum { MAX_LINE_STEPS = 4 };
/* filter steps per map: placed or deferred, twice, since its pose may be found once others are
 * placed */
enum { STEPS_PER_MAP = 2 };
enum { COMPARISONS_PER_UNIT = 8 };

cairn_particle_filter_params cairn_map_merge_filter_params(const cairn_map_merge_params *params)
{
    cairn_particle_filter_params f = cairn_particle_filter_default();

    f.particles = f.max_particles = params->particles;
    f.max_followers = MAP_MERGE_MAX_CANDIDATES;
    f.max_candidates = params->particles * MAP_MERGE_MAX_CANDIDATES;
    f.max_blocks = params->particles * (STEPS_PER_MAP * params->max_maps + 2) + 1;
    f.state_bytes = (int32_t)sizeof(map_merge_state);
    f.adaptive_followers = 0;
    return f;
}

/* ---- Proposal ---- */

int cairn_map_merge_collect_neighbours(cairn_map_merge *merge, const void *state)
{
    int ended = 0;

    merge->neighbours.count = 0;
    memset(merge->deferrals, 0, sizeof merge->deferrals);
    for (const map_merge_state *s = state; s != NULL; s = cairn_particle_filter_state_before(s)) {
        if (s->map < 0) {
            ended |= s->map == MAP_MERGE_ENDED;
            if (s->map != MAP_MERGE_ENDED)
                merge->deferrals[MAP_MERGE_DEFERRED - s->map]++;
            continue;
        }
        merge->neighbours.maps[merge->neighbours.count] = s->map;
        merge->neighbours.poses[merge->neighbours.count] = s->reference_map;
        merge->neighbours.count++;
    }
    return ended;
}

/* Returns the next map among those with this number of deferrals: by the order, or the one with the
 * best mode relative to any placed map; -1: none. */
static int32_t next_map(const cairn_map_merge *merge, int32_t deferrals)
{
    cairn_real best = 0;
    int32_t next = -1;

    for (int32_t n = 0; n < merge->map_count && !(merge->has_order && next >= 0); n++) {
        int32_t map = merge->has_order ? merge->order[n] : n;
        int32_t is_due = merge->deferrals[map] == deferrals && !map_merge_is_neighbour(merge, map);

        for (int32_t i = 0; is_due && i < merge->neighbours.count; i++) {
            map_merge_mode mode;

            if (cairn_map_merge_mode_of(merge, merge->neighbours.maps[i], map, 0, &mode) &&
                mode.log_ratio > best) {
                best = mode.log_ratio;
                next = map;
            }
        }
    }
    return next;
}

int32_t cairn_map_merge_places(const cairn_map_merge *merge, int32_t map, map_merge_mode *list,
                               int32_t most)
{
    int32_t count = 0;

    for (int32_t i = 0; i < merge->neighbours.count; i++) {
        map_merge_mode mode;

        for (int32_t k = 0;
             cairn_map_merge_mode_of(merge, merge->neighbours.maps[i], map, k, &mode); k++) {
            mode.first_second = cairn_pose_compose(merge->neighbours.poses[i], mode.first_second);
            cairn_map_merge_insert_mode(list, &count, most, mode, MAP_MERGE_SAME_M,
                                        MAP_MERGE_SAME_RAD);
        }
    }
    if (merge->maps[map].has_guess) {
        map_merge_mode guess = {merge->maps[map].guess, CAIRN_REAL_MAX};

        cairn_map_merge_insert_mode(list, &count, most, guess, CAIRN_REAL(0.05), CAIRN_REAL(0.02));
    }
    return count;
}

static void list_candidates(cairn_map_merge *merge, map_merge_proposal *offer)
{
    map_merge_mode places[MAP_MERGE_MAX_CANDIDATES - 1];
    map_merge_state none = {
        .map = MAP_MERGE_ENDED,
        .source_map = -1,
        .reference_map = {0, 0, 0},
        .log_ratio = MIN_LOG_RATIO,
        .psi = 0,
        .gamma = 0,
    };
    int32_t map = next_map(merge, 0), count;

    if (map < 0)
        map = next_map(merge, 1);
    if (map >= 0)
        none.map = MAP_MERGE_DEFERRED - map;
    count = map < 0 ? 0 : cairn_map_merge_places(merge, map, places, MAP_MERGE_MAX_CANDIDATES - 1);

    for (int32_t i = 0; i < count; i++) {
        map_merge_state *s = &offer->candidates[i];

        *s = none;
        s->map = map;
        s->reference_map = places[i].first_second;
    }
    offer->candidates[count] = none;
    offer->count = count + 1;
}

static void add_image_scores(cairn_map_merge *merge, const map_merge_state *state)
{
    merge->proposals.psi_sum += state->psi;
    merge->proposals.gamma_sum += state->gamma;
    merge->proposals.gamma_min = merge->proposals.emitted == 0
                                     ? state->gamma
                                     : cairn_min(merge->proposals.gamma_min, state->gamma);
    merge->proposals.emitted++;
}

static int is_same_pose(cairn_pose a, cairn_pose b)
{
    return a.x == b.x && a.y == b.y && a.theta == b.theta;
}

int cairn_map_merge_is_same_history(const map_merge_state *a, const map_merge_state *b)
{
    while (a != NULL && b != NULL && a != b) {
        if (a->map != b->map || !is_same_pose(a->reference_map, b->reference_map))
            return 0;
        a = cairn_particle_filter_state_before(a);
        b = cairn_particle_filter_state_before(b);
    }
    return a == b;
}

/* Returns the cached proposal of an equal particle, or an empty one in place of the oldest. */
static map_merge_proposal *proposal_for(cairn_map_merge *merge, const map_merge_state *state)
{
    map_merge_proposal *fresh;

    for (int32_t i = 0; i < MAP_MERGE_CACHED_PROPOSALS; i++)
        if (merge->proposals.cached[i].state != NULL &&
            cairn_map_merge_is_same_history(merge->proposals.cached[i].state, state))
            return &merge->proposals.cached[i];
    fresh = &merge->proposals.cached[merge->proposals.count++ % MAP_MERGE_CACHED_PROPOSALS];
    fresh->state = state;
    fresh->count = 0;
    return fresh;
}

/* Lists the candidates of a particle; returns 0 when those of an equal one are known, with their
 * scores. */
static int begin_proposal(cairn_map_merge *merge, const map_merge_state *state)
{
    map_merge_proposal *offer = proposal_for(merge, state);

    merge->proposals.current = offer;
    if (offer->count > 0)
        return 0;
    if (cairn_map_merge_collect_neighbours(merge, state)) {
        offer->candidates[0] = *state;
        offer->count = 1;
    } else {
        list_candidates(merge, offer);
    }
    return 1;
}

static map_merge_state *current_candidate(cairn_map_merge *merge)
{
    return &merge->proposals.current->candidates[merge->proposals.candidate];
}

/* Computes Psi and gamma of the current candidate relative to the current neighbour, and keeps them
 * when its overlap is the largest so far. */
static void score_neighbour(cairn_map_merge *merge)
{
    map_merge_proposals *proposals = &merge->proposals;
    map_merge_state *state = current_candidate(merge);
    cairn_map_merge_pair_score score;

    cairn_map_merge_score_at(
        merge, merge->neighbours.maps[proposals->neighbour], state->map,
        cairn_pose_between(merge->neighbours.poses[proposals->neighbour], state->reference_map),
        &score);
    if (score.overlap > proposals->overlap) {
        proposals->overlap = score.overlap;
        state->psi = score.psi;
        state->gamma = score.gamma;
    }
}

/* Step: computes Psi and gamma of the current candidate relative to the neighbour of largest
 * overlap. */
static int score_images(cairn_map_merge *merge, cairn_budget *budget)
{
    map_merge_proposals *proposals = &merge->proposals;

    CAIRN_STEP_BEGIN(merge->resume.images);
    proposals->overlap = -1;
    for (proposals->neighbour = 0; proposals->neighbour < merge->neighbours.count;
         proposals->neighbour++) {
        CAIRN_STEP_CHARGE(merge, resume.images, budget,
                          cairn_map_merge_score_units(merge,
                                                      merge->neighbours.maps[proposals->neighbour],
                                                      current_candidate(merge)->map));
        score_neighbour(merge);
    }
    CAIRN_STEP_END(merge->resume.images);
}

static void begin_candidate(cairn_map_merge *merge)
{
    const map_merge_state *state = current_candidate(merge);

    cairn_map_merge_begin_fit(merge, state->map, state->reference_map, state->reference_map,
                              MAX_LINE_STEPS);
}

/* Moves the current candidate to its refined pose. */
static void move_candidate(cairn_map_merge *merge)
{
    map_merge_state *state = current_candidate(merge);

    state->reference_map = merge->fit.pose;
    cairn_map_merge_begin_total(merge, state->map, state->reference_map, merge->params.max_points);
}

/* Step: refines the current candidate against all placed maps, then scores it. */
static int score_candidate(cairn_map_merge *merge, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(merge->resume.part);
    begin_candidate(merge);
    CAIRN_STEP_RUN(merge, resume.part, budget, cairn_map_merge_step_lines);
    move_candidate(merge);
    CAIRN_STEP_RUN(merge, resume.part, budget, cairn_map_merge_step_total);
    current_candidate(merge)->log_ratio = merge->total.log_ratio;
    if (merge->params.perception == CAIRN_MAP_MERGE_IMAGES)
        CAIRN_STEP_RUN(merge, resume.part, budget, score_images);
    CAIRN_STEP_END(merge->resume.part);
}

/* Cost in units of listing candidates: each map is compared with all placed ones, twice. */
static int32_t listing_units(const cairn_map_merge *merge)
{
    return 1 + merge->map_count + merge->map_count * merge->map_count / COMPARISONS_PER_UNIT;
}

static void offer_candidates(cairn_map_merge *merge, cairn_particle_filter *filter)
{
    const map_merge_proposal *offer = merge->proposals.current;

    for (int32_t i = 0; i < offer->count; i++) {
        cairn_must_be_ok(cairn_particle_filter_offer(filter, &offer->candidates[i], 0));
        if (offer->candidates[i].map >= 0)
            add_image_scores(merge, &offer->candidates[i]);
    }
}

/* Step: proposes the candidates of particle `index`. */
static int propose_next(cairn_map_merge *merge, cairn_particle_filter *filter, int32_t index,
                        cairn_budget *budget)
{
    map_merge_proposals *proposals = &merge->proposals;

    CAIRN_STEP_BEGIN(merge->resume.phase);
    CAIRN_STEP_CHARGE(merge, resume.phase, budget, listing_units(merge));
    if (begin_proposal(merge, cairn_particle_filter_particle(filter, index).state))
        for (proposals->candidate = 0; proposals->candidate < proposals->current->count;
             proposals->candidate++)
            if (current_candidate(merge)->map >= 0)
                CAIRN_STEP_RUN(merge, resume.phase, budget, score_candidate);
    offer_candidates(merge, filter);
    CAIRN_STEP_END(merge->resume.phase);
}

static cairn_status propose(void *context, cairn_particle_filter *filter, int32_t index,
                            cairn_budget *budget)
{
    return propose_next(context, filter, index, budget) ? CAIRN_OK : CAIRN_MORE;
}

/* Returns log(Psi~ gamma~) (9.5, 9.6), each normalized over all candidates of the step; a single
 * one has 0. */
static cairn_real log_images(const cairn_map_merge *merge, const map_merge_state *state)
{
    cairn_real gammas = merge->proposals.gamma_sum -
                        (cairn_real)merge->proposals.emitted * merge->proposals.gamma_min;
    cairn_real psi = state->psi / merge->proposals.psi_sum,
               gamma = (state->gamma - merge->proposals.gamma_min) / gammas;

    if (merge->proposals.emitted < 2 || !(gammas > 0) || !(merge->proposals.psi_sum > 0))
        return 0;
    return psi * gamma > 0 ? cairn_log(psi * gamma) : -CAIRN_REAL_MAX;
}

static cairn_status likelihood(void *context, const cairn_particle_filter *filter, int32_t index,
                               const void *state, cairn_real *log_likelihood, cairn_budget *budget)
{
    const cairn_map_merge *merge = context;
    const map_merge_state *s = state;

    (void)filter;
    (void)index;
    (void)budget;
    if (merge->params.perception == CAIRN_MAP_MERGE_IMAGES && s->map >= 0)
        *log_likelihood = log_images(merge, s);
    else if (merge->params.perception == CAIRN_MAP_MERGE_IMAGES)
        *log_likelihood = -20;
    else
        *log_likelihood = s->log_ratio / LIKELIHOOD_TEMPERATURE;
    return CAIRN_OK;
}

cairn_particle_filter_model cairn_map_merge_model(cairn_map_merge *merge)
{
    cairn_particle_filter_model model = {merge, propose, likelihood, NULL, NULL};

    return model;
}

/* Returns the first map: the reference when an order or an initial pose is given, otherwise one of
 * the pair with the largest log-likelihood ratio. Weak maps are then compared with many maps at
 * once. */
static int32_t first_map(const cairn_map_merge *merge)
{
    int32_t first = merge->reference;
    cairn_real best = 0;

    for (int32_t map = 0; map < merge->map_count; map++)
        if (merge->has_order || merge->maps[map].has_guess)
            return merge->reference;
    for (int32_t b = 1; b < merge->map_count; b++)
        for (int32_t a = 0; a < b; a++) {
            map_merge_mode mode;

            if (cairn_map_merge_mode_of(merge, a, b, 0, &mode) && mode.log_ratio > best) {
                best = mode.log_ratio;
                first = b == merge->reference ? b : a;
            }
        }
    return first;
}

static void begin_filter(cairn_map_merge *merge)
{
    const map_merge_state first = {
        .map = first_map(merge),
        .source_map = -1,
        .reference_map = {0, 0, 0},
        .log_ratio = 0,
        .psi = 0,
        .gamma = 0,
    };

    cairn_must_be_ok(cairn_particle_filter_clear(merge->filter, merge->params.seed));
    cairn_must_be_ok(cairn_particle_filter_start(merge->filter, &first, 0));
}

static void begin_filter_step(cairn_map_merge *merge)
{
    cairn_must_be_ok(cairn_particle_filter_begin(merge->filter));
    for (int32_t i = 0; i < MAP_MERGE_CACHED_PROPOSALS; i++)
        merge->proposals.cached[i].state = NULL;
    merge->proposals.count = 0;
    merge->proposals.psi_sum = merge->proposals.gamma_sum = 0;
    merge->proposals.emitted = 0;
}

/* Returns the units of choosing the first map, and of releasing the states of an earlier merging. */
static int32_t begin_units(const cairn_map_merge *merge)
{
    return listing_units(merge) +
           cairn_map_merge_filter_params(&merge->params).max_blocks / MAP_MERGE_BLOCKS_PER_UNIT;
}

int cairn_map_merge_run_filter(cairn_map_merge *merge, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(merge->resume.stage);
    CAIRN_STEP_CHARGE(merge, resume.stage, budget, begin_units(merge));
    begin_filter(merge);
    for (merge->filter_step = 0; merge->filter_step < STEPS_PER_MAP * (merge->map_count - 1);
         merge->filter_step++) {
        begin_filter_step(merge);
        CAIRN_STEP_UNTIL(merge->resume.stage,
                         cairn_particle_filter_step(merge->filter, budget) != CAIRN_MORE);
    }
    CAIRN_STEP_END(merge->resume.stage);
}
