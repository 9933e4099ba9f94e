/* The step of the particle filter, phase by phase (see particle_filter.c for the method).
 *
 * Limits: the result does not depend on the budgets, because random numbers are drawn in the order
 * of the phases. After an error all followers are released and the population stays as it was. */
#include "src/base/build.h"

#include "src/numerics/particle_filter_work.h"

/* ---- Residual sampling ---- */

/* Starts residual sampling of `draw_count` items. */
static void begin_sampling(cairn_particle_filter *filter, int32_t count, int32_t draw_count,
                           cairn_real mass_sum)
{
    particle_filter_sampler sampler = {
        .total = mass_sum, .count = count, .draw_count = draw_count, .draws_left = draw_count};

    filter->sampler = sampler;
}

/* Residual sampling: sets the whole copies of each item, then draws the rest by binary search in
 * the running sums of the residuals, which replace mass[]. 1 when done, 0 when the budget is used
 * up. */
static int step_sampling(cairn_particle_filter *filter, cairn_real *mass, int32_t *copies,
                         cairn_budget *budget)
{
    particle_filter_sampler *sampler = &filter->sampler;

    for (; sampler->cursor < sampler->count; sampler->cursor++) {
        cairn_real expected =
                       mass[sampler->cursor] / sampler->total * (cairn_real)sampler->draw_count,
                   whole = cairn_floor(expected);

        if (!cairn_budget_charge(budget, &filter->units_charged, 1))
            return 0;
        copies[sampler->cursor] = cairn_real_to_int(whole);
        sampler->draws_left -= copies[sampler->cursor];
        if (expected > whole)
            sampler->last_residual = sampler->cursor;
        sampler->residual_sum += expected - whole;
        mass[sampler->cursor] = sampler->residual_sum;
    }
    for (; sampler->draws_left > 0; sampler->draws_left--) {
        int32_t low = 0, high = sampler->last_residual;
        cairn_real u;

        if (!cairn_budget_charge(budget, &filter->units_charged, 1))
            return 0;
        u = cairn_random_unit(&filter->random) * sampler->residual_sum;
        while (low < high) {
            int32_t middle = low + (high - low) / 2;

            if (mass[middle] > u)
                high = middle;
            else
                low = middle + 1;
        }
        copies[low]++;
    }
    return 1;
}

/* ---- Phases: each returns CAIRN_OK when done ---- */

/* Charges a call of a callback once, also when the callback is called again after CAIRN_MORE. 0
 * when the budget is used up. */
static int charge_call(cairn_particle_filter *filter, cairn_budget *budget)
{
    if (!filter->is_call_charged && !cairn_budget_charge(budget, &filter->units_charged, 1))
        return 0;
    filter->is_call_charged = 1;
    return 1;
}

/* Phase PROPOSE. */
static cairn_status step_propose(cairn_particle_filter *filter, cairn_budget *budget)
{
    while (filter->index < filter->current.count) {
        cairn_status status;

        if (!charge_call(filter, budget))
            return CAIRN_MORE;
        filter->is_proposing = 1;
        status = filter->model.propose(filter->model.context, filter, filter->index, budget);
        filter->is_proposing = 0;
        if (status != CAIRN_OK)
            return status;
        filter->is_call_charged = 0;
        filter->first_candidate[++filter->index] = filter->step_trace.candidates;
    }
    filter->index = 0;
    return CAIRN_OK;
}

/* Starts a phase that sums masses. */
static void begin_sum(cairn_particle_filter *filter, particle_filter_phase phase)
{
    filter->cursor = 0;
    filter->max_log_mass = PARTICLE_FILTER_IMPOSSIBLE;
    filter->mass_sum = 0;
    filter->entropy = 0;
    filter->phase = phase;
}

/* Number of candidates of the current particle. */
static int32_t candidate_count(const cairn_particle_filter *filter)
{
    return filter->first_candidate[filter->index + 1] - filter->first_candidate[filter->index];
}

/* Adds the exponential of a logarithm, relative to the largest one (log-sum-exp), to the sum and to
 * the entropy. */
static void add_mass(cairn_particle_filter *filter, int32_t k, cairn_real log_mass)
{
    cairn_real below = log_mass - filter->max_log_mass;

    filter->mass[k] = log_mass > PARTICLE_FILTER_IMPOSSIBLE ? cairn_exp(below) : 0;
    filter->mass_sum += filter->mass[k];
    filter->entropy -= filter->mass[k] > 0 ? filter->mass[k] * below : 0;
}

/* Number of modes: exp(H) of the summed masses, rounded up, with the entropy H = log total - sum m
 * log m / total. 1e-3 is subtracted, so two equal masses are two modes in spite of rounding. */
static int32_t mode_count(const cairn_particle_filter *filter)
{
    cairn_real h = filter->entropy / filter->mass_sum + cairn_log(filter->mass_sum);

    return cairn_real_to_int(cairn_ceil(cairn_exp(h) - CAIRN_REAL(1e-3)));
}

/* Sets the number of followers of the current particle. */
static void choose_follower_count(cairn_particle_filter *filter)
{
    int32_t max_followers = filter->params.max_followers;

    filter->follower_count = max_followers;
    if (filter->params.adaptive_followers) {
        int32_t modes = mode_count(filter);

        filter->follower_count = modes < max_followers ? modes : max_followers;
    }
    filter->is_drawn = filter->possible_count > filter->follower_count;
}

/* Phase PRIORS: three passes over the candidates: largest prior mass, sum, normalization. */
static cairn_status step_priors(cairn_particle_filter *filter, cairn_budget *budget)
{
    particle_filter_candidate *candidates =
        filter->candidates + filter->first_candidate[filter->index];
    int32_t count = candidate_count(filter);

    for (; filter->cursor < 3 * count; filter->cursor++) {
        int32_t k = filter->cursor % count;

        if (!cairn_budget_charge(budget, &filter->units_charged, 1))
            return CAIRN_MORE;
        if (filter->cursor < count)
            filter->max_log_mass = cairn_max(filter->max_log_mass, candidates[k].log_prior);
        else if (filter->cursor < 2 * count)
            add_mass(filter, k, candidates[k].log_prior);
        else if (candidates[k].log_prior > PARTICLE_FILTER_IMPOSSIBLE)
            candidates[k].log_prior -= filter->max_log_mass + cairn_log(filter->mass_sum);
        filter->possible_count +=
            filter->cursor >= 2 * count && candidates[k].log_prior > PARTICLE_FILTER_IMPOSSIBLE;
    }
    return CAIRN_OK;
}

/* 1 when the proposal does not use the likelihoods. */
static int is_prior_proposal(const cairn_particle_filter *filter)
{
    return filter->params.proposal != CAIRN_PARTICLE_FILTER_PROPOSAL_OPTIMAL;
}

/* 1 when followers are drawn before their likelihoods are known. */
static int is_drawn_by_prior(const cairn_particle_filter *filter)
{
    return is_prior_proposal(filter) && filter->is_drawn;
}

/* Phase LIKELIHOODS. */
static cairn_status step_likelihoods(cairn_particle_filter *filter, cairn_budget *budget)
{
    int32_t count = candidate_count(filter);

    for (; filter->cursor < count; filter->cursor++) {
        int32_t at = filter->first_candidate[filter->index] + filter->cursor;
        particle_filter_candidate *candidate = &filter->candidates[at];
        cairn_status status;

        if (candidate->log_prior <= PARTICLE_FILTER_IMPOSSIBLE ||
            (is_drawn_by_prior(filter) && filter->copies[filter->cursor] == 0)) {
            candidate->log_likelihood = PARTICLE_FILTER_IMPOSSIBLE;
            continue;
        }
        if (!charge_call(filter, budget))
            return CAIRN_MORE;
        status = filter->model.likelihood(filter->model.context, filter, filter->index,
                                          filter->states + (size_t)at * filter->state_stride,
                                          &candidate->log_likelihood, budget);
        if (status != CAIRN_OK)
            return status;
        filter->is_call_charged = 0;
        if (!(candidate->log_likelihood <= CAIRN_REAL_MAX))
            return CAIRN_NOT_FINITE;
    }
    return CAIRN_OK;
}

/* Logarithm of prior mass times likelihood. */
static cairn_real log_mass_of(const particle_filter_candidate *candidate)
{
    return candidate->log_likelihood > PARTICLE_FILTER_IMPOSSIBLE &&
                   candidate->log_prior > PARTICLE_FILTER_IMPOSSIBLE
               ? candidate->log_prior + candidate->log_likelihood
               : PARTICLE_FILTER_IMPOSSIBLE;
}

/* Phase MASSES: two passes over the candidates: largest prior mass times likelihood, sum and number
 * of possible candidates. */
static cairn_status step_masses(cairn_particle_filter *filter, cairn_budget *budget)
{
    const particle_filter_candidate *candidates =
        filter->candidates + filter->first_candidate[filter->index];
    int32_t count = candidate_count(filter);

    for (; filter->cursor < 2 * count; filter->cursor++) {
        int32_t k = filter->cursor % count;

        if (!cairn_budget_charge(budget, &filter->units_charged, 1))
            return CAIRN_MORE;
        if (filter->cursor < count) {
            filter->max_log_mass = cairn_max(filter->max_log_mass, log_mass_of(&candidates[k]));
        } else {
            add_mass(filter, k, log_mass_of(&candidates[k]));
            filter->possible_count += log_mass_of(&candidates[k]) > PARTICLE_FILTER_IMPOSSIBLE;
        }
    }
    return CAIRN_OK;
}

/* ln(part / whole). */
static cairn_real log_ratio(int32_t part, int32_t whole)
{
    return cairn_log((cairn_real)part / (cairn_real)whole);
}

/* Phase FOLLOW: creates the followers with their weights. */
static cairn_status step_follow(cairn_particle_filter *filter, cairn_budget *budget)
{
    particle_filter_particle parent = filter->current.list[filter->index];
    int32_t count = candidate_count(filter),
            cost = 1 + filter->params.state_bytes / PARTICLE_FILTER_BYTES_PER_UNIT;

    for (; filter->cursor < count; filter->cursor++) {
        int32_t at = filter->first_candidate[filter->index] + filter->cursor;
        const particle_filter_candidate *candidate = &filter->candidates[at];
        particle_filter_particle follower = parent;
        cairn_status status;

        if (log_mass_of(candidate) <= PARTICLE_FILTER_IMPOSSIBLE ||
            (filter->is_drawn && filter->copies[filter->cursor] == 0))
            continue;
        if (!cairn_budget_charge(budget, &filter->units_charged, cost))
            return CAIRN_MORE;
        if (filter->params.proposal == CAIRN_PARTICLE_FILTER_PROPOSAL_BOOSTED)
            follower.log_weight += candidate->log_likelihood;
        else if (!filter->is_drawn)
            follower.log_weight += candidate->log_prior + candidate->log_likelihood;
        else if (filter->params.proposal == CAIRN_PARTICLE_FILTER_PROPOSAL_PRIOR)
            follower.log_weight +=
                log_ratio(filter->copies[filter->cursor], filter->follower_count) +
                candidate->log_likelihood;
        else
            follower.log_weight +=
                log_ratio(filter->copies[filter->cursor], filter->follower_count) +
                filter->group_log_sum;
        follower.log_likelihood += candidate->log_likelihood;
        filter->max_log_weight = cairn_max(filter->max_log_weight, follower.log_weight);
        filter->possible_count++;
        status = cairn_particle_filter_add_follower(
            filter, follower, parent.leaf, filter->states + (size_t)at * filter->state_stride);
        if (status != CAIRN_OK)
            return status;
    }
    return CAIRN_OK;
}

/* Starts the next phase for the current particle, from PRIORS to FOLLOW. */
static void advance_group(cairn_particle_filter *filter)
{
    int32_t count = candidate_count(filter);
    int by_prior = is_prior_proposal(filter);

    switch (filter->phase) {
    case PARTICLE_FILTER_PRIORS:
        filter->is_drawn = 0;
        if (by_prior && filter->possible_count > 0)
            choose_follower_count(filter);
        begin_sampling(filter, count, filter->follower_count, filter->mass_sum);
        filter->phase =
            is_drawn_by_prior(filter) ? PARTICLE_FILTER_DRAW : PARTICLE_FILTER_LIKELIHOODS;
        break;
    case PARTICLE_FILTER_LIKELIHOODS:
        filter->possible_count = 0;
        begin_sum(filter, by_prior ? PARTICLE_FILTER_FOLLOW : PARTICLE_FILTER_MASSES);
        break;
    case PARTICLE_FILTER_MASSES:
        if (filter->possible_count > 0) {
            choose_follower_count(filter);
            filter->group_log_sum = filter->max_log_mass + cairn_log(filter->mass_sum);
        } else {
            filter->is_drawn = 0;
        }
        begin_sampling(filter, count, filter->follower_count, filter->mass_sum);
        filter->phase = filter->is_drawn ? PARTICLE_FILTER_DRAW : PARTICLE_FILTER_FOLLOW;
        filter->possible_count = 0;
        break;
    case PARTICLE_FILTER_DRAW:
        filter->phase = by_prior ? PARTICLE_FILTER_LIKELIHOODS : PARTICLE_FILTER_FOLLOW;
        break;
    default:
        filter->phase = PARTICLE_FILTER_NEXT;
        break;
    }
    filter->cursor = 0;
}

/* Ends the current particle, which is discarded when it has no follower. */
static void end_group(cairn_particle_filter *filter)
{
    if (filter->possible_count == 0) {
        filter->step_trace.particles_without_follower++;
        if (filter->model.discard != NULL)
            filter->model.discard(filter->model.context, filter, filter->index);
    }
    filter->index++;
}

/* Starts the candidates of the next particle, or the phase after the last particle. */
static void begin_group(cairn_particle_filter *filter)
{
    if (filter->index < filter->current.count) {
        filter->possible_count = 0;
        begin_sum(filter, PARTICLE_FILTER_PRIORS);
    } else if (filter->next.count > 0) {
        begin_sum(filter, PARTICLE_FILTER_SUM);
        filter->max_log_mass = filter->max_log_weight;
    } else {
        filter->step_trace.depleted = 1;
        filter->step_trace.particles = filter->current.count;
        filter->step_trace.best = filter->last_trace.best;
        filter->step_trace.n_eff = filter->last_trace.n_eff;
        filter->last_trace = filter->step_trace;
        filter->phase = PARTICLE_FILTER_RELEASE;
    }
}

/* Phase SUM: sum of the weights. */
static cairn_status step_sum(cairn_particle_filter *filter, cairn_budget *budget)
{
    for (; filter->cursor < filter->next.count; filter->cursor++) {
        if (!cairn_budget_charge(budget, &filter->units_charged, 1))
            return CAIRN_MORE;
        add_mass(filter, filter->cursor, filter->next.list[filter->cursor].log_weight);
    }
    filter->cursor = 0;
    filter->squared_weights = 0;
    return CAIRN_OK;
}

/* Phase NORMALISE: normalized weights, N_eff and evidence. */
static cairn_status step_normalise(cairn_particle_filter *filter, cairn_budget *budget)
{
    cairn_real shift = filter->max_log_mass + cairn_log(filter->mass_sum);
    particle_filter_particle *particles = filter->next.list;

    for (; filter->cursor < filter->next.count; filter->cursor++) {
        cairn_real weight = filter->mass[filter->cursor] / filter->mass_sum;

        if (!cairn_budget_charge(budget, &filter->units_charged, 1))
            return CAIRN_MORE;
        particles[filter->cursor].log_weight -= shift;
        filter->squared_weights += weight * weight;
        if (cairn_particle_filter_is_lighter(&particles[filter->step_trace.best],
                                             &particles[filter->cursor]))
            filter->step_trace.best = filter->cursor;
    }
    filter->max_weight_index = filter->step_trace.best;
    filter->step_trace.n_eff = 1 / filter->squared_weights;
    filter->step_trace.log_evidence += shift;
    filter->cursor = 0;
    filter->step_trace.resampled =
        filter->step_trace.n_eff <
        filter->params.resample_ratio * (cairn_real)filter->params.particles;
    return CAIRN_OK;
}

/* Phase COPY: the copies drawn become a population of equal weights; when boosted, one particle of
 * their total weight. */
static cairn_status step_copies(cairn_particle_filter *filter, cairn_budget *budget)
{
    cairn_real log_weight = -cairn_log((cairn_real)filter->params.particles);

    while (filter->cursor < filter->next.count) {
        particle_filter_particle particle = filter->next.list[filter->cursor];

        if (filter->copies[filter->cursor] == 0) {
            filter->cursor++;
            continue;
        }
        if (!cairn_budget_charge(budget, &filter->units_charged, 1))
            return CAIRN_MORE;
        if (filter->cursor == filter->max_weight_index)
            filter->step_trace.best = filter->resampled.count;
        particle.log_weight = log_weight;
        if (filter->params.proposal == CAIRN_PARTICLE_FILTER_PROPOSAL_BOOSTED) {
            particle.log_weight += cairn_log((cairn_real)filter->copies[filter->cursor]);
            filter->copies[filter->cursor] = 0;
        } else {
            filter->copies[filter->cursor]--;
        }
        particle.leaf->references++;
        filter->resampled.list[filter->resampled.count++] = particle;
    }
    return CAIRN_OK;
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

/* Phase RELEASE: releases the histories of the other populations. */
static cairn_status step_release(cairn_particle_filter *filter, cairn_budget *budget)
{
    particle_filter_population *population = &filter->next;

    for (;;) {
        if (filter->node_to_release == NULL && population->count == 0)
            population = &filter->resampled;
        if (filter->node_to_release == NULL && population->count == 0)
            break;
        if (!cairn_budget_charge(budget, &filter->units_charged, 1))
            return CAIRN_MORE;
        if (filter->node_to_release == NULL)
            filter->node_to_release = population->list[--population->count].leaf;
        filter->node_to_release = cairn_particle_filter_drop_node(filter, filter->node_to_release);
    }
    filter->last_trace.blocks = cairn_block_pool_read(filter->blocks).used;
    return CAIRN_OK;
}

/* Works on the current phase. */
static cairn_status step_phase(cairn_particle_filter *filter, cairn_budget *budget)
{
    switch (filter->phase) {
    case PARTICLE_FILTER_PROPOSE:
        return step_propose(filter, budget);
    case PARTICLE_FILTER_PRIORS:
        return step_priors(filter, budget);
    case PARTICLE_FILTER_LIKELIHOODS:
        return step_likelihoods(filter, budget);
    case PARTICLE_FILTER_MASSES:
        return step_masses(filter, budget);
    case PARTICLE_FILTER_DRAW:
    case PARTICLE_FILTER_RESAMPLE:
        return step_sampling(filter, filter->mass, filter->copies, budget) ? CAIRN_OK : CAIRN_MORE;
    case PARTICLE_FILTER_FOLLOW:
        return step_follow(filter, budget);
    case PARTICLE_FILTER_NEXT:
        end_group(filter);
        return CAIRN_OK;
    case PARTICLE_FILTER_SUM:
        return step_sum(filter, budget);
    case PARTICLE_FILTER_NORMALISE:
        return step_normalise(filter, budget);
    case PARTICLE_FILTER_COPY:
        return step_copies(filter, budget);
    default:
        return step_release(filter, budget);
    }
}

/* Starts the phase after the one that ended. */
static void advance(cairn_particle_filter *filter)
{
    switch (filter->phase) {
    case PARTICLE_FILTER_PROPOSE:
    case PARTICLE_FILTER_NEXT:
        begin_group(filter);
        break;
    case PARTICLE_FILTER_SUM:
        filter->phase = PARTICLE_FILTER_NORMALISE;
        break;
    case PARTICLE_FILTER_NORMALISE:
        begin_sampling(filter, filter->next.count, filter->params.particles, filter->mass_sum);
        filter->phase = PARTICLE_FILTER_RESAMPLE;
        if (!filter->step_trace.resampled) {
            commit(filter);
            filter->phase = PARTICLE_FILTER_RELEASE;
        }
        break;
    case PARTICLE_FILTER_RESAMPLE:
        filter->cursor = 0;
        filter->phase = PARTICLE_FILTER_COPY;
        break;
    case PARTICLE_FILTER_COPY:
        commit(filter);
        filter->phase = PARTICLE_FILTER_RELEASE;
        break;
    case PARTICLE_FILTER_RELEASE:
        filter->phase = PARTICLE_FILTER_IDLE;
        break;
    default:
        advance_group(filter);
        break;
    }
}

cairn_status cairn_particle_filter_step(cairn_particle_filter *filter, cairn_budget *budget)
{
    if (filter == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (filter->phase != PARTICLE_FILTER_IDLE) {
        cairn_status status = step_phase(filter, budget);

        if (status == CAIRN_MORE)
            return status;
        if (status == CAIRN_OK) {
            advance(filter);
        } else {
            filter->outcome = status;
            filter->units_charged = 0;
            filter->is_call_charged = 0;
            filter->phase = PARTICLE_FILTER_RELEASE;
        }
    }
    return filter->outcome;
}
