/* Particle filter along an axis: proposal, likelihood, and the trajectories from each seed to both
 * ends of its axis.
 *
 * Method:
 * 1. Proposal: edgels are searched ahead of both contour ends, along their tangents; a side without
 *    an edgel is extrapolated. All pairs of both sides are formed.
 * 2. Pairs are kept whose disc lies ahead, whose axis does not self-intersect and whose radius is
 *    near the range.
 * 3. Gain of a side: log-likelihood ratio of the edgel as the next contour point against uniform
 *    background clutter. For a chord that turns by b and a normal that turns by t, a contour of
 *    constant curvature has t = 2 b. A steep slope is evidence as well, since clutter edgels are
 *    rarely steep.
 * 4. Gain of a pair: log-likelihood ratio of its symmetry and its change of radius against
 *    background clutter. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/symmetric_point.h"
#include "src/containers/ranked_list.h"
#include "src/outlines/skeleton_grouping_work.h"

/* Step length, in radii, and its lower bound. */
#define STEP_RADII  CAIRN_REAL(0.4)
#define MIN_STEP_PX CAIRN_REAL(3.0)
/* Search radius about the predicted contact point, in steps. */
#define SEARCH_RADIUS_STEPS CAIRN_REAL(0.8)
/* Non-maximum-suppression radius of the choices of a side. */
#define NMS_RADIUS_PX CAIRN_REAL(1.8)
/* Weight of the sides' gains, since consecutive steps are correlated. */
#define SIDE_GAIN_WEIGHT CAIRN_REAL(0.5)
/* Standard deviation of the change of radius per axis length. */
#define RADIUS_SLOPE_SIGMA CAIRN_REAL(0.18)
/* Lower bounds of a gain, nats. */
#define MIN_GAIN       CAIRN_REAL(-4.0)
#define MIN_RANGE_GAIN CAIRN_REAL(-2.0)
/* Interior prior: radius of the interior in disc radii, ratio of its edgel density to the
 * background clutter density, and weight. */
#define INTERIOR_RADIUS        CAIRN_REAL(0.6)
#define INTERIOR_DENSITY_RATIO CAIRN_REAL(0.3)
#define INTERIOR_WEIGHT        CAIRN_REAL(0.4)
/* Exponent of the odds in the particle weights (tempering), so that several hypotheses survive. */
#define LIKELIHOOD_EXPONENT CAIRN_REAL(0.35)
#define MAX_TURN_RAD        (50 * (CAIRN_PI / 180))
/* Work units of a proposal; states of its trajectory that are compared with it, states or discs that
 * are copied, and discs that are compared with a seed, per work unit; latest states that an axis may
 * meet. */
enum {
    UNITS_PER_PROPOSAL = 150,
    STATES_PER_UNIT = 8,
    COPIES_PER_UNIT = 2,
    DISCS_PER_UNIT = 16,
    RECENT_STATES = 3
};

/* A candidate contact point of a side. */
typedef struct choice {
    cairn_vec2 position, inward;
    cairn_real gain;
    /* Distance to the last contact point, px. */
    cairn_real chord;
    int32_t edgel, polarity;
} choice;

/* Returns the logarithm of a normal density. */
static cairn_real log_normal(cairn_real x, cairn_real sigma)
{
    return -cairn_half_square(x / sigma) - cairn_log(sigma) - CAIRN_REAL(0.9189385332046727);
}

/* Returns the step length, px. */
static cairn_real step_of(const cairn_skeleton_grouping *skeleton, cairn_real radius)
{
    return cairn_min(cairn_max(STEP_RADII * radius, MIN_STEP_PX), skeleton->params.step_sigma);
}

/* Returns the contour's forward tangent. */
static cairn_vec2 tangent_of(const skeleton_grouping_state *state, int32_t side)
{
    cairn_vec2 tangent = cairn_vec2_left_perp(state->inward[side]);

    return cairn_vec2_dot(tangent, state->heading) < 0 ? cairn_vec2_scale(tangent, -1) : tangent;
}

/* Returns the predicted contact point on a straight contour. */
static cairn_vec2 predicted_contact(const skeleton_grouping_state *state, int32_t side,
                                    cairn_real step)
{
    return cairn_vec2_add(state->contact[side], cairn_vec2_scale(tangent_of(state, side), step));
}

/* Returns the gain of an edgel as the next contact point of a side, nats. */
static cairn_real side_gain(const cairn_skeleton_grouping *skeleton,
                            const skeleton_grouping_state *state, int32_t side, const choice *c,
                            cairn_vec2 ahead, cairn_real log_density)
{
    cairn_vec2 chord = cairn_vec2_sub(c->position, state->contact[side]);
    cairn_real bend = cairn_vec2_angle(ahead, chord),
               turn = cairn_vec2_angle(state->inward[side], c->inward);
    cairn_real flip = c->polarity == state->polarity[side]
                          ? 1 - skeleton->params.polarity_flip_probability
                          : skeleton->params.polarity_flip_probability;

    if (cairn_abs(bend) > MAX_TURN_RAD)
        return -CAIRN_REAL_MAX;
    return cairn_log(skeleton->params.detection_probability * 2 * flip * 2 * CAIRN_PI /
                     cairn_max(c->chord, 1)) -
           log_density + log_normal(bend, CAIRN_REAL(0.75) * skeleton->params.duality_sigma) +
           log_normal(turn - 2 * bend, CAIRN_REAL(0.5) * skeleton->params.duality_sigma) +
           skeleton->params.contrast_weight * skeleton->edgels[c->edgel].log_slope_ratio;
}

static int is_near(const void *context, const void *entry, const void *other)
{
    const choice *a = entry, *b = other;

    (void)context;
    return cairn_vec2_norm_squared(cairn_vec2_sub(b->position, a->position)) <
           NMS_RADIUS_PX * NMS_RADIUS_PX;
}

/* Lists the candidate edgels of a side and the choice without an edgel; returns their number. */
static int32_t choices_of(const cairn_skeleton_grouping *skeleton,
                          const skeleton_grouping_state *state, int32_t side, cairn_real step,
                          choice *list)
{
    cairn_vec2 ahead = tangent_of(state, side), predicted = predicted_contact(state, side, step);
    cairn_real search_radius = SEARCH_RADIUS_STEPS * step,
               log_density = cairn_log(cairn_skeleton_grouping_density(skeleton, predicted));
    cell_range cells = cairn_skeleton_grouping_cells_near(skeleton, predicted, search_radius);
    int32_t count = 0;
    choice none = {predicted,
                   state->inward[side],
                   cairn_log(1 - skeleton->params.detection_probability),
                   step,
                   -1,
                   state->polarity[side]};
    ranked_list choices = {.entries = list,
                           .count = &count,
                           .capacity = SKELETON_GROUPING_MAX_CHOICES,
                           .entry_bytes = sizeof *list,
                           .score_at = offsetof(choice, gain),
                           .is_near = is_near,
                           .replaces_one = 1};

    for (int32_t y = cells.y0; y <= cells.y1; y++) {
        int32_t from, end;

        skeleton_grouping_cells_of_row(skeleton, cells, y, &from, &end);
        for (int32_t i = from; i < end; i++) {
            const skeleton_grouping_edgel *e = &skeleton->edgels[i];
            choice c = {.position = e->position,
                        .inward = e->normal,
                        .edgel = i,
                        .polarity = SKELETON_GROUPING_BRIGHTER};

            if (cairn_vec2_norm_squared(cairn_vec2_sub(e->position, predicted)) >
                search_radius * search_radius)
                continue;
            if (cairn_vec2_dot(e->normal, state->inward[side]) < 0) {
                c.inward = cairn_vec2_scale(e->normal, -1);
                c.polarity = SKELETON_GROUPING_DARKER;
            }
            c.chord = cairn_vec2_norm(cairn_vec2_sub(e->position, state->contact[side]));
            c.gain = side_gain(skeleton, state, side, &c, ahead, log_density);
            if (c.gain > none.gain)
                (void)ranked_list_insert(&choices, &c);
        }
    }
    list[count++] = none;
    return count;
}

/* Returns the log odds of a radius given the range, nats. */
static cairn_real range_gain(const cairn_skeleton_grouping *skeleton, cairn_real radius)
{
    cairn_real off = cairn_max(
        cairn_max(skeleton->input.min_radius - radius, radius - skeleton->input.max_radius), 0);

    return cairn_max(-cairn_half_square(off / (skeleton->params.radius_sigma * radius)),
                     MIN_RANGE_GAIN);
}

/* Returns the gain of the symmetry and of the change of radius, nats. */
static cairn_real pair_gain(const cairn_skeleton_grouping *skeleton,
                            const skeleton_grouping_state *before,
                            const skeleton_grouping_state *state)
{
    cairn_real along = cairn_max(cairn_vec2_norm(cairn_vec2_sub(state->centre, before->centre)), 1);
    cairn_real symmetry =
        log_normal(state->deviation, skeleton->params.symmetry_sigma) + cairn_log(2 * CAIRN_PI / 3);
    cairn_real slope =
        log_normal((state->radius - before->radius) / along, RADIUS_SLOPE_SIGMA) + cairn_log(2);

    return cairn_max(symmetry, MIN_GAIN) + cairn_max(slope, MIN_GAIN);
}

/* Returns the gain of a state, nats. */
static cairn_real gain_of(const cairn_skeleton_grouping *skeleton,
                          const skeleton_grouping_state *before,
                          const skeleton_grouping_state *state, const choice *left,
                          const choice *right)
{
    cairn_real range = range_gain(skeleton, state->radius);

    /* A contour on one side alone is no evidence of an axis. */
    if (left->edgel < 0 || right->edgel < 0)
        return SIDE_GAIN_WEIGHT *
                   ((left->edgel < 0 ? left->gain : 0) + (right->edgel < 0 ? right->gain : 0)) +
               range;
    return SIDE_GAIN_WEIGHT * (left->gain + right->gain) + pair_gain(skeleton, before, state) +
           range;
}

/* Returns the cost of the edgels near a point in units. */
static int32_t cells_cost_near(const cairn_skeleton_grouping *skeleton, cairn_vec2 place,
                               cairn_real reach)
{
    return skeleton_grouping_cells_cost(skeleton,
                                        cairn_skeleton_grouping_cells_near(skeleton, place, reach));
}

/* Returns the gain of the next disc's interior: an object's interior has fewer edgels than the
 * background clutter. */
static cairn_real interior_gain(const cairn_skeleton_grouping *skeleton, cairn_vec2 centre,
                                cairn_real radius)
{
    cairn_real core = INTERIOR_RADIUS * radius,
               expected =
                   cairn_skeleton_grouping_density(skeleton, centre) * CAIRN_PI * core * core;
    cell_range cells = cairn_skeleton_grouping_cells_near(skeleton, centre, core);
    int32_t count = 0;

    for (int32_t y = cells.y0; y <= cells.y1; y++) {
        int32_t from, end;

        skeleton_grouping_cells_of_row(skeleton, cells, y, &from, &end);
        for (int32_t i = from; i < end; i++)
            count += cairn_vec2_norm_squared(cairn_vec2_sub(skeleton->edgels[i].position, centre)) <
                     core * core;
    }
    return INTERIOR_WEIGHT *
           ((1 - INTERIOR_DENSITY_RATIO) * expected +
            (cairn_real)count * cairn_log(INTERIOR_DENSITY_RATIO)) *
           MIN_STEP_PX / (2 * core);
}

/* Builds the successor state of two choices; returns 0 if it is invalid. */
static int make_state(const cairn_skeleton_grouping *skeleton,
                      const skeleton_grouping_state *before, const choice *left,
                      const choice *right, cairn_real step, cairn_real interior,
                      skeleton_grouping_state *state)
{
    cairn_oriented_point first = {left->position, cairn_vec2_left_perp(left->inward)};
    cairn_oriented_point second = {right->position, cairn_vec2_left_perp(right->inward)};
    cairn_symmetric_point sp;
    cairn_vec2 moved;
    cairn_real along;

    if ((left->edgel >= 0 && left->edgel == right->edgel) ||
        !cairn_symmetric_point_of(first, second, 1, &sp) ||
        sp.radius < skeleton->min_search_radius || sp.radius > skeleton->max_search_radius)
        return 0;
    moved = cairn_vec2_sub(sp.centre, before->centre);
    along = cairn_vec2_dot(moved, before->heading);
    if (along < CAIRN_REAL(0.2) * step || along > 3 * step ||
        cairn_vec2_dot(left->inward, cairn_vec2_sub(sp.centre, left->position)) <
            CAIRN_REAL(0.5) * sp.radius ||
        cairn_vec2_dot(right->inward, cairn_vec2_sub(sp.centre, right->position)) <
            CAIRN_REAL(0.5) * sp.radius)
        return 0;
    *state = *before;
    state->contact[0] = left->position;
    state->contact[1] = right->position;
    state->inward[0] = left->inward;
    state->inward[1] = right->inward;
    state->edgel[0] = left->edgel;
    state->edgel[1] = right->edgel;
    state->polarity[0] = left->polarity;
    state->polarity[1] = right->polarity;
    state->centre = sp.centre;
    state->radius = sp.radius;
    state->deviation = sp.deviation;
    /* Steps are short and their directions noisy: the heading is low-pass filtered. */
    state->heading = cairn_vec2_unit(
        cairn_vec2_add(before->heading, cairn_vec2_scale(cairn_vec2_unit(moved), CAIRN_REAL(0.7))));
    if (cairn_vec2_cross(state->heading, cairn_vec2_sub(left->position, sp.centre)) <= 0 ||
        cairn_vec2_cross(state->heading, cairn_vec2_sub(right->position, sp.centre)) >= 0)
        return 0;
    state->length++;
    /* Edgels are one pixel apart: the gain is proportional to the step length. */
    state->gain = (gain_of(skeleton, before, state, left, right) + interior) * step / MIN_STEP_PX;
    state->log_odds += state->gain;
    state->best_log_odds = cairn_max(state->best_log_odds, state->log_odds);
    return 1;
}

/* Returns 1 if the axis self-intersects. */
static int self_intersects(const skeleton_grouping_state *last, cairn_vec2 next)
{
    const skeleton_grouping_state *s = last;

    for (int32_t i = 0; s != NULL; i++, s = cairn_particle_filter_state_before(s))
        if (i > RECENT_STATES &&
            cairn_vec2_norm_squared(cairn_vec2_sub(s->centre, next)) < cairn_half_square(s->radius))
            return 1;
    return 0;
}

/* Returns the cost of a proposal in units. */
static int32_t proposal_cost(const cairn_skeleton_grouping *skeleton,
                             const skeleton_grouping_state *state, cairn_real step)
{
    cairn_vec2 next = cairn_vec2_add(state->centre, cairn_vec2_scale(state->heading, step));
    int32_t cost = UNITS_PER_PROPOSAL + state->length / STATES_PER_UNIT +
                   cells_cost_near(skeleton, next, INTERIOR_RADIUS * state->radius);

    for (int32_t side = 0; side < 2; side++)
        cost += cells_cost_near(skeleton, predicted_contact(state, side, step),
                                SEARCH_RADIUS_STEPS * step);
    return cost;
}

/* The proposal: offers all successor states of a particle. */
static cairn_status propose(void *context, cairn_particle_filter *filter, int32_t index,
                            cairn_budget *budget)
{
    cairn_skeleton_grouping *skeleton = context;
    const skeleton_grouping_state *before = cairn_particle_filter_particle(filter, index).state;
    choice list[2][SKELETON_GROUPING_MAX_CHOICES + 1];
    int32_t count[2];
    cairn_real step = step_of(skeleton, before->radius), interior;

    if (!cairn_budget_charge(budget, &skeleton->step_units_charged,
                             proposal_cost(skeleton, before, step)))
        return CAIRN_MORE;
    if (before->best_log_odds - before->log_odds > skeleton->params.stop_log_odds ||
        self_intersects(before,
                        cairn_vec2_add(before->centre, cairn_vec2_scale(before->heading, step))))
        return CAIRN_OK;
    interior = interior_gain(
        skeleton, cairn_vec2_add(before->centre, cairn_vec2_scale(before->heading, step)),
        before->radius);
    for (int32_t side = 0; side < 2; side++)
        count[side] = choices_of(skeleton, before, side, step, list[side]);
    for (int32_t i = 0; i < count[0]; i++)
        for (int32_t j = 0; j < count[1]; j++) {
            skeleton_grouping_state next;
            cairn_status status;

            if (!make_state(skeleton, before, &list[0][i], &list[1][j], step, interior, &next))
                continue;
            status = cairn_particle_filter_offer(filter, &next, 0);
            if (status != CAIRN_OK && status != CAIRN_FULL)
                return status;
        }
    return CAIRN_OK;
}

/* The tempered log-likelihood of a state. */
static cairn_status likelihood(void *context, const cairn_particle_filter *filter, int32_t index,
                               const void *state, cairn_real *log_likelihood, cairn_budget *budget)
{
    const skeleton_grouping_state *s = state;

    (void)context;
    (void)filter;
    (void)index;
    (void)budget;
    *log_likelihood = LIKELIHOOD_EXPONENT * s->gain;
    return CAIRN_OK;
}

/* 1 when the maximum of a trajectory is above that of the best one so far. */
static int is_best_path(const cairn_skeleton_grouping *skeleton,
                        const skeleton_grouping_state *last)
{
    return last->best_log_odds > skeleton->best_path_log_odds;
}

/* Stores the trajectory up to a state's maximum as the best one so far. */
static void store_best_path(cairn_skeleton_grouping *skeleton, const skeleton_grouping_state *last)
{
    const skeleton_grouping_state *s = last;

    skeleton->best_path_log_odds = last->best_log_odds;
    while (s->log_odds < last->best_log_odds && s->length > 0)
        s = cairn_particle_filter_state_before(s);
    skeleton->best_path_length = s->length;
    for (; s != NULL && s->length > 0; s = cairn_particle_filter_state_before(s))
        skeleton->best_path[s->length - 1] = *s;
}

/* Compares a particle's trajectory with the best one so far, and stores it when it is better. 0
 * when the budget is used up. */
static int compare_path(cairn_skeleton_grouping *skeleton, int32_t particle, cairn_budget *budget)
{
    const skeleton_grouping_state *last =
        cairn_particle_filter_particle(skeleton->filter, particle).state;
    int32_t copies = is_best_path(skeleton, last) ? last->length : 0;

    if (!cairn_budget_charge(budget, &skeleton->step_units_charged, 1 + copies / COPIES_PER_UNIT))
        return 0;
    if (is_best_path(skeleton, last))
        store_best_path(skeleton, last);
    return 1;
}

/* Compares the trajectory of a particle that is discarded. */
static cairn_status discard(void *context, const cairn_particle_filter *filter, int32_t index,
                            cairn_budget *budget)
{
    (void)filter;
    return compare_path(context, index, budget) ? CAIRN_OK : CAIRN_MORE;
}

cairn_particle_filter_model cairn_skeleton_grouping_model(cairn_skeleton_grouping *skeleton)
{
    cairn_particle_filter_model model = {
        .context = skeleton, .propose = propose, .likelihood = likelihood, .discard = discard};

    return model;
}

/* ---- Runs ---- */

/* Returns the initial state: the seed's CP in a direction of its axis. */
static skeleton_grouping_state first_state(const cairn_skeleton_grouping *skeleton,
                                           int32_t direction)
{
    const skeleton_grouping_centre *c =
        &skeleton->centres[skeleton->seeds[skeleton->seed_index].centre];
    cairn_vec2 chord = cairn_vec2_sub(skeleton->edgels[c->edgel[1]].position,
                                      skeleton->edgels[c->edgel[0]].position);
    skeleton_grouping_state s;

    memset(&s, 0, sizeof s);
    s.heading = cairn_vec2_unit(cairn_vec2_left_perp(chord));
    if (direction == 0)
        s.heading = cairn_vec2_scale(s.heading, -1);
    for (int32_t side = 0; side < 2; side++) {
        int32_t from = side ^ (direction == 0), edgel = c->edgel[from];

        s.contact[side] = skeleton->edgels[edgel].position;
        s.inward[side] = skeleton_grouping_inward(&skeleton->edgels[edgel], c->polarity[from]);
        s.edgel[side] = edgel;
        s.polarity[side] = c->polarity[from];
    }
    s.centre = c->position;
    s.radius = c->radius;
    s.deviation = c->deviation;
    return s;
}

/* Returns 1 if a trajectory from another seed covers the seed's CP. */
static int is_covered(const cairn_skeleton_grouping *skeleton)
{
    const skeleton_grouping_centre *centre =
        &skeleton->centres[skeleton->seeds[skeleton->seed_index].centre];

    for (int32_t i = 0; i < skeleton->disc_count; i++) {
        const skeleton_grouping_disc *d = &skeleton->discs[i];

        if (cairn_vec2_norm_squared(cairn_vec2_sub(d->centre, centre->position)) <
                CAIRN_REAL(0.25) * centre->radius * centre->radius &&
            cairn_abs(d->radius - centre->radius) < CAIRN_REAL(0.3) * centre->radius)
            return 1;
    }
    return 0;
}

/* Appends the disc of a state; reversed: of a walk in the other direction. */
static void append_disc(cairn_skeleton_grouping *skeleton, const skeleton_grouping_state *s,
                        int32_t reversed)
{
    skeleton_grouping_disc *d = &skeleton->discs[skeleton->disc_count++];

    d->centre = s->centre;
    d->radius = s->radius;
    d->gain = s->gain;
    for (int32_t side = 0; side < 2; side++) {
        d->contact[side] = s->contact[side ^ reversed];
        d->edgel[side] = s->edgel[side ^ reversed];
        d->polarity[side] = s->polarity[side ^ reversed];
    }
}

static cairn_status begin_run(cairn_skeleton_grouping *skeleton)
{
    skeleton_grouping_state s = first_state(skeleton, skeleton->direction);
    cairn_status status = cairn_particle_filter_clear(
        skeleton->filter, skeleton->params.seed + (uint64_t)skeleton->seed_index);

    skeleton->best_path_log_odds = 0;
    skeleton->best_path_length = 0;
    skeleton->step_units_charged = 0;
    skeleton->is_walking = 1;
    if (status == CAIRN_OK)
        status = cairn_particle_filter_start(skeleton->filter, &s, 0);
    return status;
}

/* 1 when a particle has a successor, and may take another step. */
static int may_walk_on(const cairn_skeleton_grouping *skeleton)
{
    cairn_particle_filter_trace t = cairn_particle_filter_read(skeleton->filter);

    return !t.depleted && t.steps < skeleton->params.max_steps;
}

/* Cost in units of appending the best trajectory to the candidate. */
static int32_t append_cost(const cairn_skeleton_grouping *skeleton)
{
    return 1 + skeleton->best_path_length / COPIES_PER_UNIT;
}

/* Appends the best trajectory of a run to the candidate: the first one reversed, before the seed;
 * the second one behind the seed. */
static void end_run(cairn_skeleton_grouping *skeleton)
{
    skeleton_grouping_part *candidate = &skeleton->candidates[skeleton->candidate_count];

    if (skeleton->direction == 0) {
        skeleton_grouping_state seed = first_state(skeleton, 1);

        candidate->first = skeleton->disc_count;
        for (int32_t i = skeleton->best_path_length - 1; i >= 0; i--)
            append_disc(skeleton, &skeleton->best_path[i], 1);
        append_disc(skeleton, &seed, 0);
    } else {
        for (int32_t i = 0; i < skeleton->best_path_length; i++)
            append_disc(skeleton, &skeleton->best_path[i], 0);
        candidate->count = skeleton->disc_count - candidate->first;
        candidate->state = 0;
        skeleton->candidate_count++;
    }
}

/* 1 when there is capacity for the discs of another candidate. */
static int has_capacity(const cairn_skeleton_grouping *skeleton)
{
    return skeleton->candidate_count < skeleton->params.max_parts &&
           skeleton->disc_count + 2 * skeleton->params.max_steps + 1 <= skeleton->params.max_points;
}

int cairn_skeleton_grouping_walks(cairn_skeleton_grouping *skeleton, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(skeleton->phase_resume);
    for (; skeleton->seed_index < skeleton->seed_count && has_capacity(skeleton);
         skeleton->seed_index++) {
        CAIRN_STEP_CHARGE(skeleton, phase_resume, budget,
                          1 + skeleton->disc_count / DISCS_PER_UNIT);
        if (is_covered(skeleton))
            continue;
        skeleton->walk_count++;
        for (skeleton->direction = 0; skeleton->direction < 2; skeleton->direction++) {
            skeleton->status = begin_run(skeleton);
            CAIRN_STEP_UNTIL(skeleton->phase_resume, skeleton->status == CAIRN_OK);
            while (skeleton->is_walking) {
                skeleton->status = cairn_particle_filter_begin(skeleton->filter);
                CAIRN_STEP_UNTIL(skeleton->phase_resume, skeleton->status == CAIRN_OK);
                CAIRN_STEP_UNTIL(skeleton->phase_resume,
                                 (skeleton->status = cairn_particle_filter_step(
                                      skeleton->filter, budget)) == CAIRN_OK);
                skeleton->is_walking = may_walk_on(skeleton);
            }
            for (skeleton->particle = 0;
                 skeleton->particle < cairn_particle_filter_count(skeleton->filter);
                 skeleton->particle++)
                CAIRN_STEP_UNTIL(skeleton->phase_resume,
                                 compare_path(skeleton, skeleton->particle, budget));
            CAIRN_STEP_CHARGE(skeleton, phase_resume, budget, append_cost(skeleton));
            end_run(skeleton);
        }
    }
    CAIRN_STEP_END(skeleton->phase_resume);
}
