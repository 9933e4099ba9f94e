/* The step of the particle filter, phase by phase (see particle_filter.c for the method).
 *
 * Limits: the result does not depend on the budgets, because random numbers are drawn in the order
 * of the phases. After an error all followers are released and the population stays as it was. */
#include "src/base/build.h"

#include "src/numerics/particle_filter_work.h"

/* ---- Sums of masses ---- */

/* Number of candidates of the current particle. */
static int32_t candidate_count(const cairn_particle_filter *filter)
{
    return filter->first_candidate[filter->index + 1] - filter->first_candidate[filter->index];
}

/* Starts a sum of masses, of which `max_log` is the logarithm of the largest. */
static void begin_sum(particle_filter_masses *masses, cairn_real max_log)
{
    masses->max_log = max_log;
    masses->sum = 0;
    masses->entropy = 0;
}

/* Adds the exponential of a logarithm, relative to the largest one (log-sum-exp), to the sum and to
 * the entropy. */
static void add_mass(particle_filter_masses *masses, int32_t k, cairn_real log_mass)
{
    cairn_real below = log_mass - masses->max_log;

    masses->mass[k] = log_mass > PARTICLE_FILTER_IMPOSSIBLE ? cairn_exp(below) : 0;
    masses->sum += masses->mass[k];
    masses->entropy -= masses->mass[k] > 0 ? masses->mass[k] * below : 0;
}

/* Ends a sum of masses: its logarithm. */
static void end_sum(particle_filter_masses *masses)
{
    masses->log_sum = masses->max_log + cairn_log(masses->sum);
}

/* Number of modes: exp(H) of the summed masses, rounded up, with the entropy H = log total - sum m
 * log m / total. 1e-3 is subtracted, so two equal masses are two modes in spite of rounding. */
static int32_t mode_count(const particle_filter_masses *masses)
{
    cairn_real h = masses->entropy / masses->sum + cairn_log(masses->sum);

    return cairn_real_to_int(cairn_ceil(cairn_exp(h) - CAIRN_REAL(1e-3)));
}

/* Sets the number of followers of the current particle. */
static void choose_follower_count(particle_filter_following *follow,
                                  const cairn_particle_filter_params *params,
                                  const particle_filter_masses *masses)
{
    follow->follower_count = params->max_followers;
    if (params->adaptive_followers) {
        int32_t modes = mode_count(masses);

        if (modes < params->max_followers)
            follow->follower_count = modes;
    }
    follow->is_drawn = follow->possible_count > follow->follower_count;
}

/* ---- Residual sampling ---- */

/* Sets the whole copies of an item, and replaces its mass by the running sum of the residuals. */
static void set_whole_copies(particle_filter_drawing *drawing, particle_filter_masses *masses,
                             int32_t item, int32_t draw_count)
{
    cairn_real expected = masses->mass[item] / masses->sum * (cairn_real)draw_count,
               whole = cairn_floor(expected);

    drawing->copies[item] = cairn_real_to_int(whole);
    drawing->draws_left -= drawing->copies[item];
    if (expected > whole)
        drawing->last_residual = item;
    drawing->residual_sum += expected - whole;
    masses->mass[item] = drawing->residual_sum;
}

/* Draws an item by its residual, by binary search in the running sums. */
static void draw_residual(particle_filter_drawing *drawing, const cairn_real *running_sum,
                          cairn_random *random)
{
    cairn_real u = cairn_random_unit(random) * drawing->residual_sum;
    int32_t low = 0, high = drawing->last_residual;

    while (low < high) {
        int32_t middle = low + (high - low) / 2;

        if (running_sum[middle] > u)
            high = middle;
        else
            low = middle + 1;
    }
    drawing->copies[low]++;
}

/* Draws `draw_count` copies of `count` items in proportion to their masses, which are
 * overwritten. */
static int draw(cairn_particle_filter *filter, int32_t count, int32_t draw_count,
                cairn_budget *budget)
{
    particle_filter_drawing *drawing = &filter->drawing;

    CAIRN_STEP_BEGIN(filter->phase_resume);
    drawing->residual_sum = 0;
    drawing->draws_left = draw_count;
    drawing->last_residual = 0;
    for (filter->cursor = 0; filter->cursor < count; filter->cursor++) {
        CAIRN_STEP_CHARGE(filter, phase_resume, budget, 1);
        set_whole_copies(drawing, &filter->masses, filter->cursor, draw_count);
    }
    for (; drawing->draws_left > 0; drawing->draws_left--) {
        CAIRN_STEP_CHARGE(filter, phase_resume, budget, 1);
        draw_residual(drawing, filter->masses.mass, &filter->random);
    }
    CAIRN_STEP_END(filter->phase_resume);
}

/* ---- Candidates ---- */

/* Calls the motion model, which offers candidates of the current particle. 0 when the budget is
 * used up. */
static int call_propose(cairn_particle_filter *filter, cairn_budget *budget)
{
    cairn_status status;

    filter->is_proposing = 1;
    status = filter->model.propose(filter->model.context, filter, filter->index, budget);
    filter->is_proposing = 0;
    if (status == CAIRN_MORE)
        return 0;
    filter->outcome = status;
    return 1;
}

/* Candidates of all particles. */
static int propose(cairn_particle_filter *filter, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(filter->phase_resume);
    for (filter->index = 0; filter->index < filter->current.count && filter->outcome == CAIRN_OK;
         filter->index++) {
        CAIRN_STEP_CHARGE(filter, phase_resume, budget, 1);
        CAIRN_STEP_RUN(filter, phase_resume, budget, call_propose);
        filter->first_candidate[filter->index + 1] = filter->step_trace.candidates;
    }
    CAIRN_STEP_END(filter->phase_resume);
}

/* Candidates of the current particle. */
static particle_filter_candidate *candidates_of(const cairn_particle_filter *filter)
{
    return filter->candidates + filter->first_candidate[filter->index];
}

/* State of candidate k of the current particle. */
static const void *state_of(const cairn_particle_filter *filter, int32_t k)
{
    return filter->states +
           (size_t)(filter->first_candidate[filter->index] + k) * filter->state_stride;
}

/* Normalizes the prior mass of a candidate, and counts those that are possible. */
static void normalise_prior(particle_filter_following *follow, cairn_real log_sum,
                            particle_filter_candidate *candidate)
{
    if (candidate->log_prior <= PARTICLE_FILTER_IMPOSSIBLE)
        return;
    candidate->log_prior -= log_sum;
    follow->possible_count += candidate->log_prior > PARTICLE_FILTER_IMPOSSIBLE;
}

/* Prior masses of the candidates of the current particle, normalized. */
static int normalise_priors(cairn_particle_filter *filter, cairn_budget *budget)
{
    particle_filter_candidate *candidates = candidates_of(filter);
    particle_filter_masses *masses = &filter->masses;
    int32_t count = candidate_count(filter);

    CAIRN_STEP_BEGIN(filter->phase_resume);
    filter->follow.possible_count = 0;
    begin_sum(masses, PARTICLE_FILTER_IMPOSSIBLE);
    for (filter->cursor = 0; filter->cursor < count; filter->cursor++) {
        CAIRN_STEP_CHARGE(filter, phase_resume, budget, 1);
        masses->max_log = cairn_max(masses->max_log, candidates[filter->cursor].log_prior);
    }
    for (filter->cursor = 0; filter->cursor < count; filter->cursor++) {
        CAIRN_STEP_CHARGE(filter, phase_resume, budget, 1);
        add_mass(masses, filter->cursor, candidates[filter->cursor].log_prior);
    }
    end_sum(masses);
    for (filter->cursor = 0; filter->cursor < count; filter->cursor++) {
        CAIRN_STEP_CHARGE(filter, phase_resume, budget, 1);
        normalise_prior(&filter->follow, masses->log_sum, &candidates[filter->cursor]);
    }
    CAIRN_STEP_END(filter->phase_resume);
}

/* 1 when the proposal does not use the likelihoods. */
static int is_prior_proposal(const cairn_particle_filter *filter)
{
    return filter->params.proposal != CAIRN_PARTICLE_FILTER_PROPOSAL_OPTIMAL;
}

/* 1 when candidate k of the current particle can become a follower, as far as it is known before
 * its likelihood: it is possible, and drawn if it had to be. */
static int is_eligible(const cairn_particle_filter *filter, int32_t k)
{
    return candidates_of(filter)[k].log_prior > PARTICLE_FILTER_IMPOSSIBLE &&
           !(is_prior_proposal(filter) && filter->follow.is_drawn &&
             filter->drawing.copies[k] == 0);
}

/* Calls the observation model for candidate k of the current particle. 0 when the budget is used
 * up. */
static int call_likelihood(cairn_particle_filter *filter, int32_t k, cairn_budget *budget)
{
    cairn_real *log_likelihood = &candidates_of(filter)[k].log_likelihood;
    cairn_status status = filter->model.likelihood(filter->model.context, filter, filter->index,
                                                   state_of(filter, k), log_likelihood, budget);

    if (status == CAIRN_MORE)
        return 0;
    if (status == CAIRN_OK && !(*log_likelihood <= CAIRN_REAL_MAX))
        status = CAIRN_NOT_FINITE;
    filter->outcome = status;
    return 1;
}

/* Likelihoods of the candidates of the current particle. */
static int find_likelihoods(cairn_particle_filter *filter, cairn_budget *budget)
{
    int32_t count = candidate_count(filter);

    CAIRN_STEP_BEGIN(filter->phase_resume);
    for (filter->cursor = 0; filter->cursor < count && filter->outcome == CAIRN_OK;
         filter->cursor++) {
        if (!is_eligible(filter, filter->cursor)) {
            candidates_of(filter)[filter->cursor].log_likelihood = PARTICLE_FILTER_IMPOSSIBLE;
            continue;
        }
        CAIRN_STEP_CHARGE(filter, phase_resume, budget, 1);
        CAIRN_STEP_UNTIL(filter->phase_resume, call_likelihood(filter, filter->cursor, budget));
    }
    CAIRN_STEP_END(filter->phase_resume);
}

/* Logarithm of prior mass times likelihood. */
static cairn_real log_mass_of(const particle_filter_candidate *candidate)
{
    return candidate->log_likelihood > PARTICLE_FILTER_IMPOSSIBLE &&
                   candidate->log_prior > PARTICLE_FILTER_IMPOSSIBLE
               ? candidate->log_prior + candidate->log_likelihood
               : PARTICLE_FILTER_IMPOSSIBLE;
}

/* Sum of prior mass times likelihood over the candidates of the current particle. */
static int sum_masses(cairn_particle_filter *filter, cairn_budget *budget)
{
    const particle_filter_candidate *candidates = candidates_of(filter);
    particle_filter_masses *masses = &filter->masses;
    int32_t count = candidate_count(filter);

    CAIRN_STEP_BEGIN(filter->phase_resume);
    filter->follow.possible_count = 0;
    begin_sum(masses, PARTICLE_FILTER_IMPOSSIBLE);
    for (filter->cursor = 0; filter->cursor < count; filter->cursor++) {
        CAIRN_STEP_CHARGE(filter, phase_resume, budget, 1);
        masses->max_log = cairn_max(masses->max_log, log_mass_of(&candidates[filter->cursor]));
    }
    for (filter->cursor = 0; filter->cursor < count; filter->cursor++) {
        CAIRN_STEP_CHARGE(filter, phase_resume, budget, 1);
        add_mass(masses, filter->cursor, log_mass_of(&candidates[filter->cursor]));
        filter->follow.possible_count +=
            log_mass_of(&candidates[filter->cursor]) > PARTICLE_FILTER_IMPOSSIBLE;
    }
    end_sum(masses);
    CAIRN_STEP_END(filter->phase_resume);
}

/* ---- Followers ---- */

/* ln(part / whole). */
static cairn_real log_ratio(int32_t part, int32_t whole)
{
    return cairn_log((cairn_real)part / (cairn_real)whole);
}

/* 1 when candidate k of the current particle becomes a follower. */
static int has_follower(const cairn_particle_filter *filter, int32_t k)
{
    return log_mass_of(&candidates_of(filter)[k]) > PARTICLE_FILTER_IMPOSSIBLE &&
           (!filter->follow.is_drawn || filter->drawing.copies[k] > 0);
}

/* Logarithm of the factor of the weight of a follower, which candidate k becomes. */
static cairn_real log_factor_of(const cairn_particle_filter *filter, int32_t k)
{
    const particle_filter_candidate *candidate = &candidates_of(filter)[k];

    if (filter->params.proposal == CAIRN_PARTICLE_FILTER_PROPOSAL_BOOSTED)
        return candidate->log_likelihood;
    if (!filter->follow.is_drawn)
        return candidate->log_prior + candidate->log_likelihood;
    return log_ratio(filter->drawing.copies[k], filter->follow.follower_count) +
           (filter->params.proposal == CAIRN_PARTICLE_FILTER_PROPOSAL_PRIOR
                ? candidate->log_likelihood
                : filter->masses.log_sum);
}

/* Makes candidate k of the current particle a follower with its weight. */
static void create_follower(cairn_particle_filter *filter, int32_t k)
{
    particle_filter_particle parent = filter->current.list[filter->index], follower = parent;

    follower.log_weight += log_factor_of(filter, k);
    follower.log_likelihood += candidates_of(filter)[k].log_likelihood;
    filter->max_log_weight = cairn_max(filter->max_log_weight, follower.log_weight);
    filter->follow.created_count++;
    filter->outcome =
        cairn_particle_filter_add_follower(filter, follower, parent.leaf, state_of(filter, k));
}

/* Followers of the current particle. */
static int create_followers(cairn_particle_filter *filter, cairn_budget *budget)
{
    int32_t count = candidate_count(filter),
            units = 1 + filter->params.state_bytes / PARTICLE_FILTER_BYTES_PER_UNIT;

    CAIRN_STEP_BEGIN(filter->phase_resume);
    filter->follow.created_count = 0;
    for (filter->cursor = 0; filter->cursor < count && filter->outcome == CAIRN_OK;
         filter->cursor++) {
        if (!has_follower(filter, filter->cursor))
            continue;
        CAIRN_STEP_CHARGE(filter, phase_resume, budget, units);
        create_follower(filter, filter->cursor);
    }
    CAIRN_STEP_END(filter->phase_resume);
}

/* Reports the current particle, which has no follower. 0 when the budget is used up. */
static int call_discard(cairn_particle_filter *filter, cairn_budget *budget)
{
    cairn_status status = CAIRN_OK;

    if (filter->model.discard != NULL)
        status = filter->model.discard(filter->model.context, filter, filter->index, budget);
    if (status == CAIRN_MORE)
        return 0;
    filter->outcome = status;
    return 1;
}

/* From the candidates of the current particle to its followers: drawn by their prior masses before
 * their likelihoods are known, or by prior mass times likelihood (optimal proposal). */
static int follow_particle(cairn_particle_filter *filter, cairn_budget *budget)
{
    particle_filter_following *follow = &filter->follow;
    int32_t count = candidate_count(filter);

    CAIRN_STEP_BEGIN(follow->resume);
    CAIRN_STEP_UNTIL(follow->resume, normalise_priors(filter, budget));
    follow->is_drawn = 0;
    if (is_prior_proposal(filter)) {
        if (follow->possible_count > 0)
            choose_follower_count(follow, &filter->params, &filter->masses);
        if (follow->is_drawn)
            CAIRN_STEP_UNTIL(follow->resume, draw(filter, count, follow->follower_count, budget));
        CAIRN_STEP_UNTIL(follow->resume, find_likelihoods(filter, budget));
    } else {
        CAIRN_STEP_UNTIL(follow->resume, find_likelihoods(filter, budget));
        if (filter->outcome == CAIRN_OK)
            CAIRN_STEP_UNTIL(follow->resume, sum_masses(filter, budget));
        if (filter->outcome == CAIRN_OK && follow->possible_count > 0)
            choose_follower_count(follow, &filter->params, &filter->masses);
        if (follow->is_drawn)
            CAIRN_STEP_UNTIL(follow->resume, draw(filter, count, follow->follower_count, budget));
    }
    if (filter->outcome == CAIRN_OK) {
        CAIRN_STEP_UNTIL(follow->resume, create_followers(filter, budget));
        if (filter->outcome == CAIRN_OK && follow->created_count == 0) {
            filter->step_trace.particles_without_follower++;
            CAIRN_STEP_UNTIL(follow->resume, call_discard(filter, budget));
        }
    }
    CAIRN_STEP_END(follow->resume);
}

/* Ends a step without followers: the population stays. */
static void end_depleted(cairn_particle_filter *filter)
{
    filter->step_trace.depleted = 1;
    filter->step_trace.particles = filter->current.count;
    filter->step_trace.best = filter->last_trace.best;
    filter->step_trace.n_eff = filter->last_trace.n_eff;
    filter->last_trace = filter->step_trace;
}

/* ---- Weights and resampling ---- */

/* Normalizes the weight of a follower. */
static void normalise_weight(cairn_particle_filter *filter, int32_t i)
{
    cairn_real weight = filter->masses.mass[i] / filter->masses.sum;
    particle_filter_particle *particles = filter->next.list;

    particles[i].log_weight -= filter->masses.log_sum;
    filter->squared_weights += weight * weight;
    if (cairn_particle_filter_is_lighter(&particles[filter->step_trace.best], &particles[i]))
        filter->step_trace.best = i;
}

/* Normalized weights of the followers, N_eff and evidence. */
static int normalise_weights(cairn_particle_filter *filter, cairn_budget *budget)
{
    particle_filter_masses *masses = &filter->masses;

    CAIRN_STEP_BEGIN(filter->phase_resume);
    begin_sum(masses, filter->max_log_weight);
    for (filter->cursor = 0; filter->cursor < filter->next.count; filter->cursor++) {
        CAIRN_STEP_CHARGE(filter, phase_resume, budget, 1);
        add_mass(masses, filter->cursor, filter->next.list[filter->cursor].log_weight);
    }
    end_sum(masses);
    filter->squared_weights = 0;
    for (filter->cursor = 0; filter->cursor < filter->next.count; filter->cursor++) {
        CAIRN_STEP_CHARGE(filter, phase_resume, budget, 1);
        normalise_weight(filter, filter->cursor);
    }
    filter->max_weight_index = filter->step_trace.best;
    filter->step_trace.n_eff = 1 / filter->squared_weights;
    filter->step_trace.log_evidence += filter->masses.log_sum;
    filter->step_trace.resampled =
        filter->step_trace.n_eff <
        filter->params.resample_ratio * (cairn_real)filter->params.particles;
    CAIRN_STEP_END(filter->phase_resume);
}

/* Copies a follower into the resampled population; when boosted, one particle has the weight of all
 * its copies. */
static void copy_follower(cairn_particle_filter *filter, int32_t i)
{
    particle_filter_particle particle = filter->next.list[i];

    if (i == filter->max_weight_index)
        filter->step_trace.best = filter->resampled.count;
    particle.log_weight = -cairn_log((cairn_real)filter->params.particles);
    if (filter->params.proposal == CAIRN_PARTICLE_FILTER_PROPOSAL_BOOSTED) {
        particle.log_weight += cairn_log((cairn_real)filter->drawing.copies[i]);
        filter->drawing.copies[i] = 0;
    } else {
        filter->drawing.copies[i]--;
    }
    particle.leaf->references++;
    filter->resampled.list[filter->resampled.count++] = particle;
}

/* The copies drawn: a population of equal weights; when boosted, one particle for its copies. */
static int copy_followers(cairn_particle_filter *filter, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(filter->phase_resume);
    for (filter->cursor = 0; filter->cursor < filter->next.count; filter->cursor++)
        while (filter->drawing.copies[filter->cursor] > 0) {
            CAIRN_STEP_CHARGE(filter, phase_resume, budget, 1);
            copy_follower(filter, filter->cursor);
        }
    CAIRN_STEP_END(filter->phase_resume);
}

/* Swaps two populations. */
static void swap_populations(particle_filter_population *a, particle_filter_population *b)
{
    particle_filter_population c = *a;

    *a = *b;
    *b = c;
}

/* Commit point: the resampled population, or else the followers, become the current population. */
static void commit(cairn_particle_filter *filter)
{
    cairn_block_pool_usage usage = cairn_block_pool_read(filter->blocks);

    swap_populations(&filter->current,
                     filter->step_trace.resampled ? &filter->resampled : &filter->next);
    filter->step_trace.resamplings += filter->step_trace.resampled;
    filter->step_trace.particles = filter->current.count;
    filter->step_trace.blocks_peak = usage.peak;
    filter->last_trace = filter->step_trace;
}

/* Removes a reference from the node that loses one next, else from the last particle of a population
 * that is not current. */
static void release_node(cairn_particle_filter *filter)
{
    particle_filter_population *population =
        filter->next.count > 0 ? &filter->next : &filter->resampled;

    if (filter->node_to_release == NULL)
        filter->node_to_release = population->list[--population->count].leaf;
    filter->node_to_release = cairn_particle_filter_drop_node(filter, filter->node_to_release);
}

/* Releases the histories of the populations that are not current. */
static int release_histories(cairn_particle_filter *filter, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(filter->phase_resume);
    while (filter->node_to_release != NULL || filter->next.count > 0 ||
           filter->resampled.count > 0) {
        CAIRN_STEP_CHARGE(filter, phase_resume, budget, 1);
        release_node(filter);
    }
    filter->last_trace.blocks = cairn_block_pool_read(filter->blocks).used;
    CAIRN_STEP_END(filter->phase_resume);
}

/* The step. An error of the model, or a full pool of states, is its outcome: nothing is
 * committed. */
static int run(cairn_particle_filter *filter, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(filter->resume);
    CAIRN_STEP_RUN(filter, resume, budget, propose);
    for (filter->index = 0; filter->index < filter->current.count && filter->outcome == CAIRN_OK;
         filter->index++)
        CAIRN_STEP_RUN(filter, resume, budget, follow_particle);
    if (filter->outcome == CAIRN_OK && filter->next.count == 0) {
        end_depleted(filter);
    } else if (filter->outcome == CAIRN_OK) {
        CAIRN_STEP_RUN(filter, resume, budget, normalise_weights);
        if (filter->step_trace.resampled) {
            CAIRN_STEP_UNTIL(filter->resume,
                             draw(filter, filter->next.count, filter->params.particles, budget));
            CAIRN_STEP_RUN(filter, resume, budget, copy_followers);
        }
        commit(filter);
    }
    CAIRN_STEP_RUN(filter, resume, budget, release_histories);
    CAIRN_STEP_END(filter->resume);
}

cairn_status cairn_particle_filter_step(cairn_particle_filter *filter, cairn_budget *budget)
{
    if (filter == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (filter->is_running && !run(filter, budget))
        return CAIRN_MORE;
    filter->is_running = 0;
    return filter->outcome;
}
