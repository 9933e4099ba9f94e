/* A step of the particle filter, from the proposals to the population that comes of it. */
#include "src/core/build.h"

#include "src/core/particle_filter_work.h"

/* ---- Residual sampling ---- */

static void begin_draw(cairn_particle_filter *f, int32_t count, int32_t wanted, cairn_real total)
{
    filter_sampler s = {.total = total, .count = count, .wanted = wanted, .left = wanted};

    f->sample = s;
}

/* mass[] becomes the running sum of what is left over of each, by which the rest is drawn. */
static int step_draw(cairn_particle_filter *f, cairn_real *mass, int32_t *copies,
                     cairn_budget *budget)
{
    filter_sampler *s = &f->sample;

    for (; s->cursor < s->count; s->cursor++) {
        cairn_real expected = mass[s->cursor] / s->total * (cairn_real)s->wanted,
                   whole = cairn_floor(expected);

        if (!cairn_budget_pay(budget, &f->paid, 1))
            return 0;
        copies[s->cursor] = cairn_real_to_int(whole);
        s->left -= copies[s->cursor];
        if (expected > whole)
            s->last = s->cursor;
        s->rest += expected - whole;
        mass[s->cursor] = s->rest;
    }
    for (; s->left > 0; s->left--) {
        int32_t low = 0, high = s->last;
        cairn_real u;

        if (!cairn_budget_pay(budget, &f->paid, 1))
            return 0;
        u = cairn_random_unit(&f->random) * s->rest;
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

/* ---- The phases: each returns CAIRN_OK when it is done ---- */

/* Pays for a call of the model once, however often it has to be called again. */
static int enter(cairn_particle_filter *f, cairn_budget *budget)
{
    if (!f->entered && !cairn_budget_pay(budget, &f->paid, 1))
        return 0;
    f->entered = 1;
    return 1;
}

static cairn_status step_propose(cairn_particle_filter *f, cairn_budget *budget)
{
    while (f->index < f->now.count) {
        cairn_status status;

        if (!enter(f, budget))
            return CAIRN_MORE;
        f->proposing = 1;
        status = f->model.propose(f->model.context, f, f->index, budget);
        f->proposing = 0;
        if (status != CAIRN_OK)
            return status;
        f->entered = 0;
        f->first[++f->index] = f->trace.candidates;
    }
    f->index = 0;
    return CAIRN_OK;
}

static void begin_sum(cairn_particle_filter *f, filter_phase phase)
{
    f->cursor = 0;
    f->top = FILTER_IMPOSSIBLE;
    f->total = 0;
    f->entropy = 0;
    f->phase = phase;
}

static int32_t group_size(const cairn_particle_filter *f)
{
    return f->first[f->index + 1] - f->first[f->index];
}

/* The largest of the logarithms was found beforehand: exponentials of their differences are
 * added up. */
static void add_mass(cairn_particle_filter *f, int32_t k, cairn_real log_mass)
{
    cairn_real below = log_mass - f->top;

    f->mass[k] = log_mass > FILTER_IMPOSSIBLE ? cairn_exp(below) : 0;
    f->total += f->mass[k];
    f->entropy -= f->mass[k] > 0 ? f->mass[k] * below : 0;
}

/* exp(H) of the masses added up, rounded up: H = log total - sum m log m / total. A hair less,
 * so that two equal masses are two modes in spite of rounding. */
static int32_t modes_of(const cairn_particle_filter *f)
{
    cairn_real h = f->entropy / f->total + cairn_log(f->total);

    return cairn_real_to_int(cairn_ceil(cairn_exp(h) - CAIRN_REAL(1e-3)));
}

static void decide_followers(cairn_particle_filter *f)
{
    int32_t most = f->params.max_followers;

    f->wanted = most;
    if (f->params.by_entropy) {
        int32_t modes = modes_of(f);

        f->wanted = modes < most ? modes : most;
    }
    f->drawn = f->alive > f->wanted;
}

/* Passes over the group: the largest prior mass, their sum, their logarithms normalised. Three
 * visits of a candidate. */
static cairn_status step_priors(cairn_particle_filter *f, cairn_budget *budget)
{
    filter_candidate *c = f->candidates + f->first[f->index];
    int32_t n = group_size(f);

    for (; f->cursor < 3 * n; f->cursor++) {
        int32_t k = f->cursor % n;

        if (!cairn_budget_pay(budget, &f->paid, 1))
            return CAIRN_MORE;
        if (f->cursor < n)
            f->top = cairn_max(f->top, c[k].log_prior);
        else if (f->cursor < 2 * n)
            add_mass(f, k, c[k].log_prior);
        else if (c[k].log_prior > FILTER_IMPOSSIBLE)
            c[k].log_prior -= f->top + cairn_log(f->total);
        f->alive += f->cursor >= 2 * n && c[k].log_prior > FILTER_IMPOSSIBLE;
    }
    return CAIRN_OK;
}

static int is_drawn_by_prior(const cairn_particle_filter *f)
{
    return f->params.proposal == CAIRN_PROPOSAL_PRIOR && f->drawn;
}

static cairn_status step_weigh(cairn_particle_filter *f, cairn_budget *budget)
{
    int32_t n = group_size(f);

    for (; f->cursor < n; f->cursor++) {
        int32_t at = f->first[f->index] + f->cursor;
        filter_candidate *c = &f->candidates[at];
        cairn_status status;

        if (c->log_prior <= FILTER_IMPOSSIBLE ||
            (is_drawn_by_prior(f) && f->copies[f->cursor] == 0)) {
            c->log_likelihood = FILTER_IMPOSSIBLE;
            continue;
        }
        if (!enter(f, budget))
            return CAIRN_MORE;
        status =
            f->model.likelihood(f->model.context, f, f->index, f->states + (size_t)at * f->stride,
                                &c->log_likelihood, budget);
        if (status != CAIRN_OK)
            return status;
        f->entered = 0;
        if (!(c->log_likelihood <= CAIRN_REAL_MAX))
            return CAIRN_NOT_FINITE;
    }
    return CAIRN_OK;
}

static cairn_real log_mass_of(const filter_candidate *c)
{
    return c->log_likelihood > FILTER_IMPOSSIBLE && c->log_prior > FILTER_IMPOSSIBLE
               ? c->log_prior + c->log_likelihood
               : FILTER_IMPOSSIBLE;
}

/* As step_priors(), of prior mass times likelihood; `alive` counts those that are possible. */
static cairn_status step_masses(cairn_particle_filter *f, cairn_budget *budget)
{
    const filter_candidate *c = f->candidates + f->first[f->index];
    int32_t n = group_size(f);

    for (; f->cursor < 2 * n; f->cursor++) {
        int32_t k = f->cursor % n;

        if (!cairn_budget_pay(budget, &f->paid, 1))
            return CAIRN_MORE;
        if (f->cursor < n) {
            f->top = cairn_max(f->top, log_mass_of(&c[k]));
        } else {
            add_mass(f, k, log_mass_of(&c[k]));
            f->alive += log_mass_of(&c[k]) > FILTER_IMPOSSIBLE;
        }
    }
    return CAIRN_OK;
}

static cairn_real log_ratio(int32_t part, int32_t whole)
{
    return cairn_log((cairn_real)part / (cairn_real)whole);
}

static cairn_status step_follow(cairn_particle_filter *f, cairn_budget *budget)
{
    filter_particle parent = f->now.list[f->index];
    int32_t n = group_size(f), cost = 1 + f->params.state_bytes / FILTER_BYTES_PER_UNIT;

    for (; f->cursor < n; f->cursor++) {
        int32_t at = f->first[f->index] + f->cursor;
        const filter_candidate *c = &f->candidates[at];
        filter_particle follower = parent;
        cairn_status status;

        if (log_mass_of(c) <= FILTER_IMPOSSIBLE || (f->drawn && f->copies[f->cursor] == 0))
            continue;
        if (!cairn_budget_pay(budget, &f->paid, cost))
            return CAIRN_MORE;
        if (!f->drawn)
            follower.log_weight += c->log_prior + c->log_likelihood;
        else if (f->params.proposal == CAIRN_PROPOSAL_PRIOR)
            follower.log_weight += log_ratio(f->copies[f->cursor], f->wanted) + c->log_likelihood;
        else
            follower.log_weight += log_ratio(f->copies[f->cursor], f->wanted) + f->group;
        follower.log_likelihood += c->log_likelihood;
        f->heaviest = cairn_max(f->heaviest, follower.log_weight);
        f->alive++;
        status =
            cairn_particle_follow(f, follower, parent.leaf, f->states + (size_t)at * f->stride);
        if (status != CAIRN_OK)
            return status;
    }
    return CAIRN_OK;
}

/* What follows each phase of a group, from its priors to its followers. */
static void go_on_with_group(cairn_particle_filter *f)
{
    int32_t n = group_size(f);
    int by_prior = f->params.proposal == CAIRN_PROPOSAL_PRIOR;

    switch (f->phase) {
    case FILTER_PRIORS:
        f->drawn = 0;
        if (by_prior && f->alive > 0)
            decide_followers(f);
        begin_draw(f, n, f->wanted, f->total);
        f->phase = is_drawn_by_prior(f) ? FILTER_DRAW : FILTER_WEIGH;
        break;
    case FILTER_WEIGH:
        f->alive = 0;
        begin_sum(f, by_prior ? FILTER_FOLLOW : FILTER_MASSES);
        break;
    case FILTER_MASSES:
        if (f->alive > 0) {
            decide_followers(f);
            f->group = f->top + cairn_log(f->total);
        } else {
            f->drawn = 0;
        }
        begin_draw(f, n, f->wanted, f->total);
        f->phase = f->drawn ? FILTER_DRAW : FILTER_FOLLOW;
        f->alive = 0;
        break;
    case FILTER_DRAW:
        f->phase = by_prior ? FILTER_WEIGH : FILTER_FOLLOW;
        break;
    default:
        f->phase = FILTER_NEXT;
        break;
    }
    f->cursor = 0;
}

/* The particle whose group has ended may be lost; on to the next one. */
static void end_group(cairn_particle_filter *f)
{
    if (f->alive == 0) {
        f->trace.lost++;
        if (f->model.lost != NULL)
            f->model.lost(f->model.context, f, f->index);
    }
    f->index++;
}

/* The next group, or what comes after the last one. */
static void begin_group(cairn_particle_filter *f)
{
    if (f->index < f->now.count) {
        f->alive = 0;
        begin_sum(f, FILTER_PRIORS);
    } else if (f->next.count > 0) {
        begin_sum(f, FILTER_SUM);
        f->top = f->heaviest;
    } else {
        f->trace.extinct = 1;
        f->trace.particles = f->now.count;
        f->trace.best = f->done.best;
        f->trace.n_eff = f->done.n_eff;
        f->done = f->trace;
        f->phase = FILTER_RELEASE;
    }
}

static cairn_status step_sum(cairn_particle_filter *f, cairn_budget *budget)
{
    for (; f->cursor < f->next.count; f->cursor++) {
        if (!cairn_budget_pay(budget, &f->paid, 1))
            return CAIRN_MORE;
        add_mass(f, f->cursor, f->next.list[f->cursor].log_weight);
    }
    f->cursor = 0;
    f->squares = 0;
    return CAIRN_OK;
}

static cairn_status step_normalise(cairn_particle_filter *f, cairn_budget *budget)
{
    cairn_real shift = f->top + cairn_log(f->total);
    filter_particle *p = f->next.list;

    for (; f->cursor < f->next.count; f->cursor++) {
        cairn_real weight = f->mass[f->cursor] / f->total;

        if (!cairn_budget_pay(budget, &f->paid, 1))
            return CAIRN_MORE;
        p[f->cursor].log_weight -= shift;
        f->squares += weight * weight;
        if (cairn_particle_is_lighter(&p[f->trace.best], &p[f->cursor]))
            f->trace.best = f->cursor;
    }
    f->heaviest_at = f->trace.best;
    f->trace.n_eff = 1 / f->squares;
    f->trace.log_evidence += shift;
    f->cursor = 0;
    f->trace.resampled =
        f->trace.n_eff < f->params.resample_below * (cairn_real)f->params.particles;
    return CAIRN_OK;
}

/* The copies drawn become a population of equal weights. */
static cairn_status step_copy(cairn_particle_filter *f, cairn_budget *budget)
{
    cairn_real log_weight = -cairn_log((cairn_real)f->params.particles);

    while (f->cursor < f->next.count) {
        filter_particle p = f->next.list[f->cursor];

        if (f->copies[f->cursor] == 0) {
            f->cursor++;
            continue;
        }
        if (!cairn_budget_pay(budget, &f->paid, 1))
            return CAIRN_MORE;
        if (f->cursor == f->heaviest_at)
            f->trace.best = f->spare.count;
        f->copies[f->cursor]--;
        p.log_weight = log_weight;
        p.leaf->references++;
        f->spare.list[f->spare.count++] = p;
    }
    return CAIRN_OK;
}

static void swap_populations(filter_population *a, filter_population *b)
{
    filter_population c = *a;

    *a = *b;
    *b = c;
}

/* What was resampled, or the followers themselves, is from now on what readers see. */
static void commit(cairn_particle_filter *f)
{
    cairn_block_pool_usage usage = cairn_block_pool_read(f->blocks);

    swap_populations(&f->now, f->trace.resampled ? &f->spare : &f->next);
    f->trace.resamplings += f->trace.resampled;
    f->trace.particles = f->now.count;
    f->trace.blocks_peak = usage.peak;
    f->done = f->trace;
}

/* Gives back what the population does not share with those that are no more. */
static cairn_status step_release(cairn_particle_filter *f, cairn_budget *budget)
{
    filter_population *p = &f->next;

    for (;;) {
        if (f->falling == NULL && p->count == 0)
            p = &f->spare;
        if (f->falling == NULL && p->count == 0)
            break;
        if (!cairn_budget_pay(budget, &f->paid, 1))
            return CAIRN_MORE;
        if (f->falling == NULL)
            f->falling = p->list[--p->count].leaf;
        f->falling = cairn_particle_node_drop(f, f->falling);
    }
    f->done.blocks = cairn_block_pool_read(f->blocks).used;
    return CAIRN_OK;
}

static cairn_status step_phase(cairn_particle_filter *f, cairn_budget *budget)
{
    switch (f->phase) {
    case FILTER_PROPOSE:
        return step_propose(f, budget);
    case FILTER_PRIORS:
        return step_priors(f, budget);
    case FILTER_WEIGH:
        return step_weigh(f, budget);
    case FILTER_MASSES:
        return step_masses(f, budget);
    case FILTER_DRAW:
    case FILTER_RESAMPLE:
        return step_draw(f, f->mass, f->copies, budget) ? CAIRN_OK : CAIRN_MORE;
    case FILTER_FOLLOW:
        return step_follow(f, budget);
    case FILTER_NEXT:
        end_group(f);
        return CAIRN_OK;
    case FILTER_SUM:
        return step_sum(f, budget);
    case FILTER_NORMALISE:
        return step_normalise(f, budget);
    case FILTER_COPY:
        return step_copy(f, budget);
    default:
        return step_release(f, budget);
    }
}

static void go_on(cairn_particle_filter *f)
{
    switch (f->phase) {
    case FILTER_PROPOSE:
    case FILTER_NEXT:
        begin_group(f);
        break;
    case FILTER_SUM:
        f->phase = FILTER_NORMALISE;
        break;
    case FILTER_NORMALISE:
        begin_draw(f, f->next.count, f->params.particles, f->total);
        f->phase = FILTER_RESAMPLE;
        if (!f->trace.resampled) {
            commit(f);
            f->phase = FILTER_RELEASE;
        }
        break;
    case FILTER_RESAMPLE:
        f->cursor = 0;
        f->phase = FILTER_COPY;
        break;
    case FILTER_COPY:
        commit(f);
        f->phase = FILTER_RELEASE;
        break;
    case FILTER_RELEASE:
        f->phase = FILTER_IDLE;
        break;
    default:
        go_on_with_group(f);
        break;
    }
}

cairn_status cairn_particle_filter_step(cairn_particle_filter *filter, cairn_budget *budget)
{
    if (filter == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (filter->phase != FILTER_IDLE) {
        cairn_status status = step_phase(filter, budget);

        if (status == CAIRN_MORE)
            return status;
        if (status == CAIRN_OK) {
            go_on(filter);
        } else {
            filter->outcome = status;
            filter->paid = 0;
            filter->entered = 0;
            filter->phase = FILTER_RELEASE;
        }
    }
    return filter->outcome;
}
