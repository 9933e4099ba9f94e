/* Callbacks of the particle filter in the default mode.
 *
 * State: a similarity transform that fits the model to the points matched so far, and the offset of
 * the contour from the model on either side. The sums of the fit summarize the trajectory, so that
 * the history need not be read.
 *
 * Method:
 * 1. Proposal: for the next model sample, all pairs of tokens near both predicted contact points,
 *    each side possibly unmatched. Proposal weights by the loss of symmetry and by how far the
 *    advance along the contour differs from the model's spacing (after 2.11, whose g is the gap
 *    itself).
 * 2. Likelihood: position of the skeleton point and radius (2.13), and the fit of both sides.
 * 3. Update: the new points are added to the fit.
 *
 * A trajectory starts at its hypothesis' sample and runs to the end of the path, then back from
 * there to the path's start, then along the other paths, each from its branch point. After equally
 * many steps all particles have covered equally much of the model. */
#include "src/base/build.h"

#include "cairn/symmetric_point.h"
#include "src/outlines/contour_grouping_work.h"

/* Decay of the predicted offset from the model per step. */
#define OFFSET_DECAY CAIRN_REAL(0.8)
/* Weight of the initial pose in the fit, points. */
#define PRIOR_WEIGHT 4
/* Standard deviations of the disc's position and radius in (2.13), in units of the
 * deformation's. */
#define POSITION_SIGMA CAIRN_REAL(1.5)
#define RADIUS_SIGMA   CAIRN_REAL(1.5)
/* Tempering of initial weights: the log-likelihood ratio is divided by this temperature. */
#define START_TEMPERATURE 8
/* PARTICLES_PER_UNIT: particles whose histories are released, or whose likelihoods are compared. */
enum { UNITS_PER_PROPOSAL = 60, UNITS_PER_START = 2, PARTICLES_PER_UNIT = 8 };

/* Model sample of step `step` of a trajectory from `start`; -1: past the end. */
static int32_t sample_of_step(const cairn_shape_model *model, int32_t start, int32_t step)
{
    int32_t path = 0, first, end;

    while (path < model->path_count - 1 &&
           (start < model->paths[path].first ||
            start >= model->paths[path].first + model->paths[path].count))
        path++;
    first = model->paths[path].first;
    end = first + model->paths[path].count;
    if (start + step < end)
        return start + step;
    if (step < model->paths[path].count)
        return end - 1 - step;
    step -= model->paths[path].count;
    for (int32_t other = 0; other < model->path_count; other++) {
        if (other == path)
            continue;
        if (step < model->paths[other].count)
            return model->paths[other].first + step;
        step -= model->paths[other].count;
    }
    return -1;
}

/* Updates a state for the tokens matched to the sides of its sample. */
static void match_sides(const cairn_contour_grouping *grouping, contour_grouping_state *state,
                        const cairn_vec2 predicted[2])
{
    const cairn_shape_model_sample *model_sample = &grouping->input.model->samples[state->sample];
    cairn_oriented_point edgel[2] = {{{0, 0}, {0, 0}}, {{0, 0}, {0, 0}}};
    cairn_symmetric_point sp;

    state->gap = 0;
    for (int32_t side = 0; side < 2; side++) {
        if (state->token[side] < 0)
            continue;
        edgel[side].position =
            cairn_contour_grouping_nearest_point(grouping, state->token[side], predicted[side]);
        edgel[side].direction = grouping->tokens[state->token[side]].direction;
        /* The position of a token along the contour carries no information; only its offset across
         * does. */
        state->offset[side] = cairn_vec2_sub(
            edgel[side].position,
            cairn_similarity_point(state->pose, model_sample->contact[side].position));
        state->gap +=
            CAIRN_REAL(0.5) *
            cairn_abs(
                cairn_vec2_norm(cairn_vec2_sub(edgel[side].position, state->last_point[side])) -
                cairn_vec2_norm(cairn_vec2_sub(predicted[side], state->last_point[side])));
        state->last_point[side] = edgel[side].position;
    }
    state->centre = cairn_similarity_point(state->pose, model_sample->centre);
    state->radius = cairn_similarity_scale(state->pose) * model_sample->radius;
    if (state->token[0] >= 0 && state->token[1] >= 0 &&
        cairn_symmetric_point_of(edgel[0], edgel[1], CAIRN_REAL(1.5), &sp)) {
        state->centre = sp.centre;
        state->radius = sp.radius;
        state->deviation = sp.deviation;
    }
}

/* Log mass of the proposal (2.11): gaps, and loss of symmetry. */
static cairn_real log_mass(const cairn_contour_grouping *grouping,
                           const contour_grouping_state *previous,
                           const contour_grouping_state *state)
{
    cairn_real loss = cairn_max(state->deviation - previous->deviation, 0);
    cairn_real mass = -cairn_half_square(state->gap / grouping->input.mean_length);

    return mass - cairn_half_square(loss / grouping->params.symmetry_sigma);
}

/* Proposal: offers all pairs of token matches of the next sample as candidate states. */
static cairn_status propose(void *context, cairn_particle_filter *filter, int32_t index,
                            cairn_budget *budget)
{
    cairn_contour_grouping *grouping = context;
    const contour_grouping_state *previous = cairn_particle_filter_particle(filter, index).state;
    int32_t token[2][CONTOUR_GROUPING_MAX_SIDE_TOKENS + 1], count[2];
    cairn_real cost[2][CONTOUR_GROUPING_MAX_SIDE_TOKENS + 1];
    contour_grouping_state s = *previous;
    const cairn_shape_model_sample *model_sample;
    cairn_vec2 predicted[2];

    if (!cairn_budget_charge(budget, &grouping->callback_units_charged, UNITS_PER_PROPOSAL))
        return CAIRN_MORE;
    s.sample = sample_of_step(grouping->input.model, s.start, grouping->found.step_count + 1);
    model_sample = &grouping->input.model->samples[s.sample];
    for (int32_t side = 0; side < 2; side++) {
        s.offset[side] = cairn_vec2_scale(previous->offset[side], OFFSET_DECAY);
        predicted[side] = cairn_vec2_add(
            cairn_similarity_point(s.pose, model_sample->contact[side].position), s.offset[side]);
        count[side] = cairn_contour_grouping_match_tokens(
            grouping, predicted[side],
            cairn_similarity_vector(s.pose, model_sample->contact[side].direction),
            grouping->params.deform_sigma * cairn_similarity_scale(s.pose),
            CONTOUR_GROUPING_MAX_SIDE_TOKENS, token[side], cost[side]);
        token[side][count[side]] = -1;
    }
    for (int32_t i = 0; i <= count[0]; i++)
        for (int32_t j = 0; j <= count[1]; j++) {
            contour_grouping_state next = s;
            cairn_status status;

            next.token[0] = token[0][i];
            next.token[1] = token[1][j];
            if (next.token[0] >= 0 && next.token[0] == next.token[1])
                continue;
            match_sides(grouping, &next, predicted);
            status =
                cairn_particle_filter_offer(filter, &next, log_mass(grouping, previous, &next));
            if (status != CAIRN_OK && status != CAIRN_FULL)
                return status;
        }
    return CAIRN_OK;
}

/* Cost of a matched side: half the squared offset across the model and sine of the angle, in
 * sigmas. */
static cairn_real side_cost(const cairn_contour_grouping *grouping,
                            const contour_grouping_state *state, int32_t side)
{
    cairn_vec2 direction = cairn_similarity_vector(
        state->pose, grouping->input.model->samples[state->sample].contact[side].direction);
    cairn_real size = cairn_similarity_scale(state->pose),
               sigma = grouping->params.deform_sigma * size;
    cairn_real across = cairn_vec2_cross(direction, state->offset[side]) / (size * sigma);
    cairn_real sine = cairn_vec2_cross(direction, grouping->tokens[state->token[side]].direction) /
                      (size * grouping->params.turn_sigma);

    return cairn_half_square(across * CAIRN_REAL(0.5)) + cairn_half_square(sine);
}

/* Log-likelihood: (2.13) where both sides are matched, and the fit of each side; an unmatched side
 * has a constant cost. */
static cairn_status likelihood(void *context, const cairn_particle_filter *filter, int32_t index,
                               const void *state, cairn_real *log_likelihood, cairn_budget *budget)
{
    cairn_contour_grouping *grouping = context;
    const contour_grouping_state *s = state;
    const cairn_shape_model_sample *model_sample = &grouping->input.model->samples[s->sample];
    cairn_real log_missing = grouping->limits.log_missing,
               sigma = grouping->params.deform_sigma * cairn_similarity_scale(s->pose),
               position_error, radius_error;

    (void)filter;
    (void)index;
    (void)budget;
    *log_likelihood = 0;
    for (int32_t side = 0; side < 2; side++)
        *log_likelihood +=
            CAIRN_REAL(0.5) * (s->token[side] < 0
                                   ? log_missing
                                   : cairn_max(-side_cost(grouping, s, side), log_missing));
    if (grouping->params.mode == CAIRN_CONTOUR_GROUPING_NO_MODEL) {
        *log_likelihood =
            CAIRN_REAL(0.5) * log_missing * (cairn_real)((s->token[0] < 0) + (s->token[1] < 0));
        return CAIRN_OK;
    }
    if (s->token[0] < 0 || s->token[1] < 0)
        return CAIRN_OK;
    position_error = cairn_vec2_norm(cairn_vec2_sub(
                         s->centre, cairn_similarity_point(s->pose, model_sample->centre))) /
                     (POSITION_SIGMA * 2 * sigma);
    radius_error = (s->radius - model_sample->radius * cairn_similarity_scale(s->pose)) /
                   (RADIUS_SIGMA * sigma);
    *log_likelihood +=
        cairn_max(cairn_log(CAIRN_REAL(0.5) * cairn_exp(-cairn_half_square(position_error)) +
                            CAIRN_REAL(0.5) * cairn_exp(-cairn_half_square(radius_error))),
                  log_missing);
    return CAIRN_OK;
}

/* Refits the pose with the new points. */
static void append(void *context, const cairn_particle_filter *filter, int32_t index, void *state)
{
    cairn_contour_grouping *grouping = context;
    contour_grouping_state *s = state;
    const cairn_shape_model_sample *model_sample = &grouping->input.model->samples[s->sample];
    cairn_similarity previous = s->pose;

    (void)filter;
    (void)index;
    for (int32_t side = 0; side < 2; side++)
        if (s->token[side] >= 0)
            cairn_contour_grouping_add_point(&s->sums, model_sample->contact[side].position,
                                             s->last_point[side], 1);
    s->pose = cairn_contour_grouping_fit_pose(&s->sums, &previous);
    /* Offsets are measured from the refitted pose. */
    for (int32_t side = 0; side < 2; side++)
        if (s->token[side] >= 0)
            s->offset[side] = cairn_vec2_sub(
                s->last_point[side],
                cairn_similarity_point(s->pose, model_sample->contact[side].position));
}

cairn_particle_filter_model cairn_contour_grouping_filter_model(cairn_contour_grouping *grouping)
{
    cairn_particle_filter_model model = {
        .context = grouping, .propose = propose, .likelihood = likelihood, .append = append};

    return model;
}

/* Empties the filter. */
static cairn_status begin_filter(cairn_contour_grouping *grouping)
{
    grouping->found.step_count = grouping->callback_units_charged = 0;
    grouping->limits.log_missing = cairn_log(grouping->params.missing_likelihood);
    grouping->has_particles = grouping->found.hypothesis_count > 0;
    return cairn_particle_filter_clear(grouping->filter, grouping->params.seed);
}

/* Starts a particle at a hypothesis, weighted by its tempered evidence. */
static cairn_status start_particle(cairn_contour_grouping *grouping,
                                   const contour_grouping_hypothesis *hypothesis)
{
    const cairn_shape_model_sample *model_sample =
        &grouping->input.model->samples[hypothesis->sample];
    contour_grouping_state s = {
        .pose = hypothesis->pose, .sample = hypothesis->sample, .start = hypothesis->sample};

    s.sums = cairn_contour_grouping_pose_prior(&s.pose, PRIOR_WEIGHT);
    s.centre = cairn_similarity_point(s.pose, model_sample->centre);
    s.radius = model_sample->radius * cairn_similarity_scale(s.pose);
    s.deviation = model_sample->deviation;
    s.token[0] = s.token[1] = -1;
    for (int32_t side = 0; side < 2; side++)
        s.last_point[side] = cairn_similarity_point(s.pose, model_sample->contact[side].position);
    return cairn_particle_filter_start(grouping->filter, &s,
                                       (hypothesis->score - grouping->outline.max_evidence) /
                                           START_TEMPERATURE);
}

/* Best mean log-likelihood per step over all particles. */
static cairn_real best_mean_log_likelihood(const cairn_contour_grouping *grouping)
{
    cairn_real best = -CAIRN_REAL_MAX;

    for (int32_t i = 0; i < cairn_particle_filter_count(grouping->filter); i++)
        best = cairn_max(best, cairn_particle_filter_particle(grouping->filter, i).log_likelihood);
    return best / (cairn_real)(grouping->found.step_count > 0 ? grouping->found.step_count : 1);
}

/* Records the diagnostics of a filter step; returns 1 when another one follows. */
static int record_step(cairn_contour_grouping *grouping)
{
    cairn_particle_filter_trace t = cairn_particle_filter_read(grouping->filter);
    cairn_contour_grouping_trace *trace = &grouping->trace[grouping->found.step_count++];

    trace->n_eff = t.n_eff;
    trace->followers = t.followers;
    trace->resampled = t.resampled;
    trace->particles = t.particles;
    trace->log_likelihood = best_mean_log_likelihood(grouping);
    return grouping->found.step_count + 1 < grouping->input.model->sample_count &&
           !(trace->log_likelihood < cairn_log(grouping->params.stop_likelihood));
}

/* Units of all particles. */
static int32_t particle_units(const cairn_contour_grouping *grouping)
{
    return 1 + grouping->params.particles / PARTICLES_PER_UNIT;
}

int cairn_contour_grouping_run_filter(cairn_contour_grouping *grouping, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(grouping->phase_resume);
    CAIRN_STEP_CHARGE(grouping, phase_resume, budget, particle_units(grouping));
    grouping->status = begin_filter(grouping);
    CAIRN_STEP_UNTIL(grouping->phase_resume, grouping->status == CAIRN_OK);
    for (grouping->started = 0; grouping->started < grouping->found.hypothesis_count;
         grouping->started++) {
        CAIRN_STEP_CHARGE(grouping, phase_resume, budget, UNITS_PER_START);
        grouping->status = start_particle(grouping, &grouping->hypotheses[grouping->started]);
        CAIRN_STEP_UNTIL(grouping->phase_resume, grouping->status == CAIRN_OK);
    }
    grouping->is_filtering = grouping->has_particles;
    while (grouping->is_filtering) {
        grouping->status = cairn_particle_filter_begin(grouping->filter);
        CAIRN_STEP_UNTIL(grouping->phase_resume, grouping->status == CAIRN_OK);
        CAIRN_STEP_UNTIL(grouping->phase_resume, (grouping->status = cairn_particle_filter_step(
                                                      grouping->filter, budget)) == CAIRN_OK);
        CAIRN_STEP_CHARGE(grouping, phase_resume, budget, particle_units(grouping));
        grouping->is_filtering = record_step(grouping);
    }
    CAIRN_STEP_END(grouping->phase_resume);
}
