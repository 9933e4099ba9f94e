/* The walk: the filter's callbacks.
 *
 * A particle has a similarity that lays the model onto what it has grouped so far (the sums of the
 * fit are its memory, so that the past need not be read again), and how far the contour lies off
 * the model on either side. Its next step looks for the next sample of the model: tokens near where
 * both touches should be, or none, in all pairs. Masses are those of the gaps and of the symmetry
 * (2.11), likelihoods those of the skeleton's place and of the radius (2.13).
 *
 * From the sample where it began a walk goes on to the end of the path, then back from there to
 * the path's start, then along the other paths, each from where it branches off: after as many
 * steps all particles have seen as much of the model. */
#include "src/core/build.h"

#include "cairn/symmetric_point.h"
#include "src/contour/contour_grouping_work.h"

/* Of the last deviation from the model how much is expected of the next one. */
#define CARRY CAIRN_REAL(0.8)
/* Points that the first similarity is worth in the fit. */
#define HELD 4
/* Loss of likelihood of the pair's discs, (2.13): sigmas in units of the deformation. */
#define PLACE_SIGMA  CAIRN_REAL(1.5)
#define RADIUS_SIGMA CAIRN_REAL(1.5)
/* The weight of a start is the root of this degree of how much likelier it is. */
#define TEMPER 8
enum { UNITS_A_PROPOSAL = 60 };

/* The sample that step `step` of a walk from `start` looks for; -1: the walk is over. */
static int32_t sample_of_step(const cairn_shape_model *m, int32_t start, int32_t step)
{
    int32_t home = 0, first, end;

    while (home < m->path_count - 1 &&
           (start < m->paths[home].first || start >= m->paths[home].first + m->paths[home].count))
        home++;
    first = m->paths[home].first;
    end = first + m->paths[home].count;
    if (start + step < end)
        return start + step;
    if (step < m->paths[home].count)
        return end - 1 - step;
    step -= m->paths[home].count;
    for (int32_t p = 0; p < m->path_count; p++) {
        if (p == home)
            continue;
        if (step < m->paths[p].count)
            return m->paths[p].first + step;
        step -= m->paths[p].count;
    }
    return -1;
}

/* What the state will be when the sides of its sample are these tokens. */
static void take_sides(const cairn_grouping *g, grouping_state *s, const cairn_vec2 at[2])
{
    const cairn_shape_sample *d = &g->input.model->samples[s->sample];
    cairn_oriented_point edgel[2] = {{{0, 0}, {0, 0}}, {{0, 0}, {0, 0}}};
    cairn_symmetric_point sp;

    s->gap = 0;
    for (int32_t side = 0; side < 2; side++) {
        if (s->token[side] < 0)
            continue;
        edgel[side].position = cairn_grouping_touch(g, s->token[side], at[side]);
        edgel[side].direction = g->tokens[s->token[side]].direction;
        /* Along the contour a token lies where it likes; only across it says something. */
        s->off[side] =
            cairn_vec2_sub(edgel[side].position, grouping_place(&s->pose, d->side[side].position));
        s->gap += CAIRN_REAL(0.5) *
                  cairn_abs(cairn_vec2_norm(cairn_vec2_sub(edgel[side].position, s->last[side])) -
                            cairn_vec2_norm(cairn_vec2_sub(at[side], s->last[side])));
        s->last[side] = edgel[side].position;
    }
    s->centre = grouping_place(&s->pose, d->centre);
    s->radius = grouping_size(&s->pose) * d->radius;
    if (s->token[0] >= 0 && s->token[1] >= 0 &&
        cairn_symmetric_point_of(edgel[0], edgel[1], CAIRN_REAL(1.5), &sp)) {
        s->centre = sp.centre;
        s->radius = sp.radius;
        s->deviation = sp.deviation;
    }
}

/* (2.11): the gaps, and what symmetry was lost. */
static cairn_real log_mass(const cairn_grouping *g, const grouping_state *before,
                           const grouping_state *s)
{
    cairn_real loss = cairn_max(s->deviation - before->deviation, 0);
    cairn_real mass = -cairn_half_square(s->gap / g->input.mean_length);

    return g->params.use_skeleton ? mass - cairn_half_square(loss / g->params.symmetry) : mass;
}

static cairn_status propose(void *context, cairn_particle_filter *filter, int32_t index,
                            cairn_budget *budget)
{
    cairn_grouping *g = context;
    const grouping_state *before = cairn_particle_filter_particle(filter, index).state;
    int32_t token[2][GROUPING_CHOICE + 1], count[2];
    cairn_real cost[2][GROUPING_CHOICE + 1];
    grouping_state s = *before;
    const cairn_shape_sample *d;
    cairn_vec2 at[2];

    if (!cairn_budget_pay(budget, &g->stage, UNITS_A_PROPOSAL))
        return CAIRN_MORE;
    s.sample = sample_of_step(g->input.model, s.start, g->steps + 1);
    d = &g->input.model->samples[s.sample];
    for (int32_t side = 0; side < 2; side++) {
        s.off[side] = cairn_vec2_scale(before->off[side], CARRY);
        at[side] = cairn_vec2_add(grouping_place(&s.pose, d->side[side].position), s.off[side]);
        count[side] = cairn_grouping_near(
            g, at[side], grouping_direction(&s.pose, d->side[side].direction),
            g->params.deform * grouping_size(&s.pose), GROUPING_CHOICE, token[side], cost[side]);
        token[side][count[side]] = -1;
    }
    for (int32_t i = 0; i <= count[0]; i++)
        for (int32_t j = 0; j <= count[1]; j++) {
            grouping_state next = s;
            cairn_status status;

            next.token[0] = token[0][i];
            next.token[1] = token[1][j];
            if (next.token[0] >= 0 && next.token[0] == next.token[1])
                continue;
            take_sides(g, &next, at);
            status = cairn_particle_filter_offer(filter, &next, log_mass(g, before, &next));
            if (status != CAIRN_OK && status != CAIRN_FULL)
                return status;
        }
    return CAIRN_OK;
}

/* Half the squares of what a side lies off the model, across it, and of its turn. */
static cairn_real side_cost(const cairn_grouping *g, const grouping_state *s, int32_t side)
{
    cairn_vec2 wanted =
        grouping_direction(&s->pose, g->input.model->samples[s->sample].side[side].direction);
    cairn_real size = grouping_size(&s->pose), sigma = g->params.deform * size;
    cairn_real across = cairn_vec2_cross(wanted, s->off[side]) / (size * sigma);
    cairn_real sine =
        cairn_vec2_cross(wanted, g->tokens[s->token[side]].direction) / (size * g->params.turn);

    return cairn_half_square(across * CAIRN_REAL(0.5)) + cairn_half_square(sine);
}

/* (2.13) where both sides are seen, with the directions of the sides; a side that is not seen
 * has a price of its own. */
static cairn_status likelihood(void *context, const cairn_particle_filter *filter, int32_t index,
                               const void *state, cairn_real *log_likelihood, cairn_budget *budget)
{
    cairn_grouping *g = context;
    const grouping_state *s = state;
    const cairn_shape_sample *d = &g->input.model->samples[s->sample];
    cairn_real missing = g->missing, sigma = g->params.deform * grouping_size(&s->pose), place,
               radius;

    (void)filter;
    (void)index;
    (void)budget;
    *log_likelihood = 0;
    for (int32_t side = 0; side < 2; side++)
        *log_likelihood +=
            CAIRN_REAL(0.5) *
            (s->token[side] < 0 ? missing : cairn_max(-side_cost(g, s, side), missing));
    if (!g->params.use_model) {
        *log_likelihood =
            CAIRN_REAL(0.5) * missing * (cairn_real)((s->token[0] < 0) + (s->token[1] < 0));
        return CAIRN_OK;
    }
    if (s->token[0] < 0 || s->token[1] < 0)
        return CAIRN_OK;
    place = cairn_vec2_norm(cairn_vec2_sub(s->centre, grouping_place(&s->pose, d->centre))) /
            (PLACE_SIGMA * 2 * sigma);
    radius = (s->radius - d->radius * grouping_size(&s->pose)) / (RADIUS_SIGMA * sigma);
    *log_likelihood += cairn_max(cairn_log(CAIRN_REAL(0.5) * cairn_exp(-cairn_half_square(place)) +
                                           CAIRN_REAL(0.5) * cairn_exp(-cairn_half_square(radius))),
                                 missing);
    return CAIRN_OK;
}

/* The similarity with the new points. */
static void append(void *context, const cairn_particle_filter *filter, int32_t index, void *state)
{
    cairn_grouping *g = context;
    grouping_state *s = state;
    const cairn_shape_sample *d = &g->input.model->samples[s->sample];
    grouping_pose was = s->pose;

    (void)filter;
    (void)index;
    for (int32_t side = 0; side < 2; side++)
        if (s->token[side] >= 0)
            cairn_grouping_sum(&s->sums, d->side[side].position, s->last[side], 1);
    s->pose = cairn_grouping_fit(&s->sums, &was);
    /* What the new similarity explains is no deviation. */
    for (int32_t side = 0; side < 2; side++)
        if (s->token[side] >= 0)
            s->off[side] =
                cairn_vec2_sub(s->last[side], grouping_place(&s->pose, d->side[side].position));
}

cairn_particle_model cairn_grouping_model(cairn_grouping *g)
{
    cairn_particle_model model = {g, propose, likelihood, append, NULL};

    return model;
}

/* The first particles: the starts, weighed by their evidence. */
cairn_status cairn_grouping_walk_begin(cairn_grouping *g)
{
    cairn_status status = cairn_particle_filter_clear(g->filter, g->params.seed);

    g->steps = g->stage = 0;
    g->missing = cairn_log(g->params.missing);
    g->has_walked = g->start_count > 0;
    for (int32_t i = 0; i < g->start_count && status == CAIRN_OK; i++) {
        const cairn_shape_sample *d = &g->input.model->samples[g->starts[i].sample];
        grouping_state s = {
            .pose = g->starts[i].pose, .sample = g->starts[i].sample, .start = g->starts[i].sample};

        s.sums = cairn_grouping_hold(&s.pose, HELD);
        s.centre = grouping_place(&s.pose, d->centre);
        s.radius = d->radius * grouping_size(&s.pose);
        s.deviation = d->deviation;
        s.token[0] = s.token[1] = -1;
        for (int32_t side = 0; side < 2; side++)
            s.last[side] = grouping_place(&s.pose, d->side[side].position);
        status =
            cairn_particle_filter_start(g->filter, &s, (g->starts[i].score - g->most) / TEMPER);
    }
    if (status == CAIRN_OK && g->start_count > 0)
        status = cairn_particle_filter_begin(g->filter);
    return status;
}

static cairn_real best_mean(const cairn_grouping *g)
{
    cairn_real best = -CAIRN_REAL_MAX;

    for (int32_t i = 0; i < cairn_particle_filter_count(g->filter); i++)
        best = cairn_max(best, cairn_particle_filter_particle(g->filter, i).log_likelihood);
    return best / (cairn_real)(g->steps > 0 ? g->steps : 1);
}

cairn_status cairn_grouping_walk(cairn_grouping *g, cairn_budget *budget)
{
    while (g->start_count > 0) {
        cairn_status status = cairn_particle_filter_step(g->filter, budget);
        cairn_particle_trace t;

        if (status != CAIRN_OK)
            return status;
        t = cairn_particle_filter_read(g->filter);
        g->trace[g->steps].n_eff = t.n_eff;
        g->trace[g->steps].followers = t.followers;
        g->trace[g->steps].resampled = t.resampled;
        g->trace[g->steps].particles = t.particles;
        g->steps++;
        g->trace[g->steps - 1].log_likelihood = best_mean(g);
        if (g->steps + 1 >= g->input.model->sample_count ||
            g->trace[g->steps - 1].log_likelihood < cairn_log(g->params.stop))
            break;
        status = cairn_particle_filter_begin(g->filter);
        if (status != CAIRN_OK)
            return status;
    }
    return CAIRN_OK;
}
