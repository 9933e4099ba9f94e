/* Particle filter along an axis, the thesis's "virtual robot" (Adluru 2008, sections 3.4 and 3.5):
 * proposal, weights, and the trajectories from each line.
 *
 * Method, for each line in each direction:
 * 1. The first particles are the mirror-symmetric CPs of the line (N at most, evenly subsampled).
 * 2. Proposal: both ends of a particle's contour are extended by C sigma along the edgel's
 *    orientation. Edgels within C sigma of the extended ends and outside the contour so far are
 *    paired, all with all. Culled are pairs without a CP, with a radius more than
 *    RADIUS_MARGIN_SIGMAS R sigma outside the range, and with a contour or axis that crosses the
 *    trajectory so far. All others are followers, equally likely.
 * 3. Weights: (3.7) to (3.9). The N heaviest followers survive with their weights; resampling when
 *    N_eff < N / 2.
 * 4. The filter ends when no particle has a follower, after max_steps, or when (3.7) of the
 *    heaviest particle, relative to its maximum, is below Delta_p. Its trajectory is the part.
 *
 * Limits: circles of more than SKELETON_GROUPING_WRITTEN_MAX_EDGELS edgels and particles with more
 * than SKELETON_GROUPING_WRITTEN_MAX_FOLLOWERS followers are subsampled evenly. */
#include "src/base/build.h"

#include <string.h>

#include "src/outlines/skeleton_grouping_written.h"

/* Greatest distance of a radius to the range, in R sigma. */
#define RADIUS_MARGIN_SIGMAS CAIRN_REAL(3.0)
/* Logarithm of the step likelihood, relative to its maximum, that leaves the likelihood of a
 * part unchanged. */
#define LOG_LIKELIHOOD_OFFSET CAIRN_REAL(-0.5)
/* Work units of a particle and of a pair of edgels; edgels compared with a contour segment, and
 * pairs, per work unit; work units of a follower. */
enum {
    UNITS_PER_PARTICLE = 8,
    UNITS_PER_PAIR = 2,
    EDGELS_PER_UNIT = 8,
    FOLLOWERS_PER_UNIT = 16,
    UNITS_PER_FOLLOWER = 8,
    /* CPs compared with a line, and states copied to a trajectory, per work unit. */
    CENTRES_PER_UNIT = 4,
    COPIES_PER_UNIT = 2
};

/* ---- Weights ---- */

/* Returns the logarithm of a zero-mean Gaussian relative to its maximum. */
static cairn_real log_gaussian(cairn_real x, cairn_real sigma)
{
    return CAIRN_REAL(-0.5) * (x / sigma) * (x / sigma);
}

/* Returns the logarithm of H or T of (3.8) relative to its maximum: turn of the contour against
 * turn of the vector to the centre, loss of symmetry, and distance between consecutive edgels. */
static cairn_real log_side(const cairn_skeleton_grouping *skeleton,
                           const skeleton_grouping_written_pair *before,
                           const skeleton_grouping_written_pair *now, int32_t side)
{
    cairn_real contour = cairn_vec2_angle(before->inward[side], now->inward[side]);
    cairn_real radial = cairn_vec2_angle(cairn_vec2_sub(before->centre, before->contact[side]),
                                         cairn_vec2_sub(now->centre, now->contact[side]));
    cairn_real h = cairn_abs(cairn_wrap_angle(contour - radial)) +
                   cairn_max(now->deviation[side] - before->deviation[side], 0);
    cairn_real gap = cairn_vec2_norm(cairn_vec2_sub(now->contact[side], before->contact[side]));

    return log_gaussian(h, skeleton->params.duality_sigma) +
           log_gaussian(gap, skeleton->params.step_sigma);
}

/* Returns the logarithm of (3.7) relative to its maximum. */
static cairn_real log_step(const cairn_skeleton_grouping *skeleton,
                           const skeleton_grouping_written_pair *before,
                           const skeleton_grouping_written_pair *now)
{
    cairn_real h = log_side(skeleton, before, now, 0), t = log_side(skeleton, before, now, 1),
               most = cairn_max(h, t);
    cairn_real off = cairn_max(cairn_max(skeleton->input.min_radius - now->radius,
                                         now->radius - skeleton->input.max_radius),
                               0);

    return most + cairn_log(CAIRN_REAL(0.5) * (cairn_exp(h - most) + cairn_exp(t - most))) +
           log_gaussian(off, skeleton->params.radius_sigma);
}

/* ---- Proposal ---- */

/* Returns the centre of the look-ahead circle: the contour of a side, extended by C sigma along
 * the edgel's orientation. */
static cairn_vec2 search_centre(const cairn_skeleton_grouping *skeleton,
                                const skeleton_grouping_written_state *state, int32_t side)
{
    cairn_vec2 tangent = cairn_vec2_left_perp(state->pair.inward[side]);
    cairn_real offset = cairn_vec2_dot(tangent, state->heading) < 0 ? -skeleton->params.step_sigma
                                                                    : skeleton->params.step_sigma;

    return cairn_vec2_add(state->pair.contact[side], cairn_vec2_scale(tangent, offset));
}

/* Returns the number of edgels in a look-ahead circle; stores every stride-th in a list, if
 * given. */
static int32_t scan_circle(const cairn_skeleton_grouping *skeleton, cairn_vec2 middle,
                           int32_t stride, skeleton_grouping_written_candidate *list)
{
    cairn_real reach = skeleton->params.step_sigma;
    cell_range cells = cairn_skeleton_grouping_cells_near(skeleton, middle, reach);
    int32_t count = 0;

    for (int32_t y = cells.y0; y <= cells.y1; y++) {
        int32_t from, end;

        skeleton_grouping_cells_of_row(skeleton, cells, y, &from, &end);
        for (int32_t i = from; i < end; i++) {
            if (cairn_vec2_norm_squared(cairn_vec2_sub(skeleton->edgels[i].position, middle)) >
                reach * reach)
                continue;
            if (list != NULL && count % stride == 0) {
                skeleton_grouping_written_candidate *a = &list[count / stride];

                a->position = skeleton->edgels[i].position;
                a->edgel = i;
                a->is_inside = a->is_culled = 0;
            }
            count++;
        }
    }
    return count;
}

/* Collects the edgels of both look-ahead circles. */
static void collect_candidates(cairn_skeleton_grouping *skeleton,
                               const skeleton_grouping_written_state *state)
{
    skeleton_grouping_written *written = skeleton->written;

    for (int32_t side = 0; side < 2; side++) {
        cairn_vec2 middle = search_centre(skeleton, state, side);
        int32_t all = scan_circle(skeleton, middle, 1, NULL),
                stride = 1 + (all - 1) / SKELETON_GROUPING_WRITTEN_MAX_EDGELS;

        written->candidate_count[side] = all > 0 ? (all + stride - 1) / stride : 0;
        if (all > 0)
            (void)scan_circle(skeleton, middle, stride, written->candidates[side]);
    }
}

/* Returns the cost of both look-ahead circles in units. */
static int32_t search_cost(const cairn_skeleton_grouping *skeleton,
                           const skeleton_grouping_written_state *state)
{
    cairn_real reach = skeleton->params.step_sigma;
    int32_t cost = UNITS_PER_PARTICLE;

    for (int32_t side = 0; side < 2; side++) {
        cairn_vec2 m = search_centre(skeleton, state, side);

        cost += skeleton_grouping_cells_cost(
            skeleton, cairn_skeleton_grouping_cells_near(skeleton, m, reach));
    }
    return cost;
}

/* Returns whether the bounding boxes of two segments overlap. */
static int boxes_overlap(cairn_segment a, cairn_segment b)
{
    return cairn_min(a.a.x, a.b.x) <= cairn_max(b.a.x, b.b.x) &&
           cairn_min(b.a.x, b.b.x) <= cairn_max(a.a.x, a.b.x) &&
           cairn_min(a.a.y, a.b.y) <= cairn_max(b.a.y, b.b.y) &&
           cairn_min(b.a.y, b.b.y) <= cairn_max(a.a.y, a.b.y);
}

static int is_crossed(cairn_segment a, cairn_segment b)
{
    return boxes_overlap(a, b) && cairn_segments_intersect(a, b);
}

/* Point-in-polygon test of the explored region, one polygon segment at a time: toggles each
 * candidate whose ray to the right crosses the segment. */
static void toggle_inside(skeleton_grouping_written *written, cairn_vec2 a, cairn_vec2 b)
{
    for (int32_t side = 0; side < 2; side++)
        for (int32_t i = 0; i < written->candidate_count[side]; i++) {
            skeleton_grouping_written_candidate *e = &written->candidates[side][i];

            if ((a.y > e->position.y) != (b.y > e->position.y) &&
                (e->position.x - a.x) * (b.y - a.y) * (b.y > a.y ? 1 : -1) <
                    (b.x - a.x) * (e->position.y - a.y) * (b.y > a.y ? 1 : -1))
                e->is_inside = !e->is_inside;
        }
}

/* Culls edgels that are already on the contour. */
static void cull_own(skeleton_grouping_written *written, const int32_t edgel[2])
{
    for (int32_t side = 0; side < 2; side++)
        for (int32_t i = 0; i < written->candidate_count[side]; i++)
            if (written->candidates[side][i].edgel == edgel[0] ||
                written->candidates[side][i].edgel == edgel[1])
                written->candidates[side][i].is_culled = 1;
}

/* Culls edgels whose connection to the last contact point crosses a contour segment; the segment
 * that ends at the start of the connection is exempt. */
static void cull_crossing(skeleton_grouping_written *written,
                          const skeleton_grouping_written_pair *last, cairn_segment segment,
                          int32_t ends_at)
{
    for (int32_t side = 0; side < 2; side++)
        for (int32_t i = 0; i < written->candidate_count[side] && side != ends_at; i++) {
            cairn_segment connection = {last->contact[side], written->candidates[side][i].position};

            if (is_crossed(connection, segment))
                written->candidates[side][i].is_culled = 1;
        }
}

/* Culls candidates inside the explored region, and those whose contour would self-intersect. */
static void cull_candidates(skeleton_grouping_written *written,
                            const skeleton_grouping_written_state *last)
{
    const skeleton_grouping_written_state *s = last, *before;

    toggle_inside(written, last->pair.contact[0], last->pair.contact[1]);
    for (; s != NULL; s = before) {
        before = cairn_particle_filter_state_before(s);
        cull_own(written, s->pair.edgel);
        for (int32_t side = 0; side < 2 && before != NULL; side++) {
            cairn_segment segment = {before->pair.contact[side], s->pair.contact[side]};

            toggle_inside(written, segment.a, segment.b);
            cull_crossing(written, &last->pair, segment, s == last ? side : -1);
        }
        if (before == NULL)
            toggle_inside(written, s->pair.contact[0], s->pair.contact[1]);
    }
    for (int32_t side = 0; side < 2; side++)
        for (int32_t i = 0; i < written->candidate_count[side]; i++)
            written->candidates[side][i].is_culled |= written->candidates[side][i].is_inside;
}

/* Returns the sum of the four vectors from the previous to the new edgels (fig. 3.5a). */
static cairn_vec2 heading_of(const skeleton_grouping_written_pair *before,
                             const skeleton_grouping_written_pair *now)
{
    return cairn_vec2_scale(cairn_vec2_sub(cairn_vec2_add(now->contact[0], now->contact[1]),
                                           cairn_vec2_add(before->contact[0], before->contact[1])),
                            2);
}

/* Exchanges both sides of a pair. */
static void swap_sides(skeleton_grouping_written_pair *pair)
{
    skeleton_grouping_written_pair old = *pair;

    for (int32_t side = 0; side < 2; side++) {
        pair->contact[side] = old.contact[1 - side];
        pair->inward[side] = old.inward[1 - side];
        pair->deviation[side] = old.deviation[1 - side];
        pair->edgel[side] = old.edgel[1 - side];
    }
}

/* Orders the sides of a pair as in the previous one, by their orientation about the heading;
 * returns 0 if there is no heading. */
static int correspond(const skeleton_grouping_written_pair *before,
                      skeleton_grouping_written_pair *now)
{
    cairn_vec2 heading = heading_of(before, now);

    if (cairn_vec2_norm_squared(heading) == 0)
        return 0;
    if ((cairn_vec2_cross(heading, cairn_vec2_sub(before->contact[0], before->contact[1])) > 0) !=
        (cairn_vec2_cross(heading, cairn_vec2_sub(now->contact[0], now->contact[1])) > 0))
        swap_sides(now);
    return 1;
}

/* Returns whether the two new contour segments cross. */
static int is_twisted(const skeleton_grouping_written_pair *before,
                      const skeleton_grouping_written_pair *now)
{
    cairn_segment left = {before->contact[0], now->contact[0]},
                  right = {before->contact[1], now->contact[1]};

    return is_crossed(left, right);
}

/* Adds one in `stride` pairs; a full list is halved. */
static void add_pair(skeleton_grouping_written *written, const skeleton_grouping_written_pair *pair)
{
    int64_t number = written->pairs_seen++;

    if (number % written->stride != 0)
        return;
    if (written->pair_count == SKELETON_GROUPING_WRITTEN_MAX_FOLLOWERS) {
        written->pair_count /= 2;
        for (int32_t i = 1; i < written->pair_count; i++)
            written->pairs[i] = written->pairs[2 * i];
        written->stride *= 2;
    }
    written->pairs[written->pair_count++] = *pair;
}

/* Pairs each candidate of one end with each of the other. */
static void make_pairs(cairn_skeleton_grouping *skeleton,
                       const skeleton_grouping_written_state *last)
{
    skeleton_grouping_written *written = skeleton->written;
    skeleton_grouping_written_limits rule = cairn_skeleton_grouping_written_limits_of(
        skeleton, RADIUS_MARGIN_SIGMAS * skeleton->params.radius_sigma);

    written->pair_count = 0;
    written->pairs_seen = 0;
    written->stride = 1;
    for (int32_t i = 0; i < written->candidate_count[0]; i++)
        for (int32_t j = 0; j < written->candidate_count[1] && !written->candidates[0][i].is_culled;
             j++) {
            skeleton_grouping_written_pair pair;

            if (!written->candidates[1][j].is_culled &&
                cairn_skeleton_grouping_written_pair(skeleton, &rule,
                                                     written->candidates[0][i].edgel,
                                                     written->candidates[1][j].edgel, &pair) &&
                correspond(&last->pair, &pair) && !is_twisted(&last->pair, &pair))
                add_pair(written, &pair);
        }
}

/* Culls pairs whose axis crosses the axis so far. */
static void cull_axes(skeleton_grouping_written *written,
                      const skeleton_grouping_written_state *last)
{
    const skeleton_grouping_written_state *s = last,
                                          *before = cairn_particle_filter_state_before(last);

    for (; before != NULL; s = before, before = cairn_particle_filter_state_before(before)) {
        cairn_segment segment = {before->pair.centre, s->pair.centre};

        for (int32_t i = 0; i < written->pair_count && s != last; i++) {
            cairn_segment connection = {last->pair.centre, written->pairs[i].centre};

            written->pairs[i].is_crossing |= is_crossed(connection, segment);
        }
    }
}

/* Offers the remaining pairs to the filter as followers. */
static cairn_status offer_pairs(const cairn_skeleton_grouping *skeleton,
                                cairn_particle_filter *filter,
                                const skeleton_grouping_written_state *last)
{
    int32_t followers = 0;

    for (int32_t i = 0; i < skeleton->written->pair_count; i++)
        followers += !skeleton->written->pairs[i].is_crossing;
    for (int32_t i = 0; i < skeleton->written->pair_count; i++) {
        skeleton_grouping_written_state next;
        cairn_status status;

        if (skeleton->written->pairs[i].is_crossing)
            continue;
        memset(&next, 0, sizeof next);
        next.pair = skeleton->written->pairs[i];
        next.heading = cairn_vec2_unit(heading_of(&last->pair, &next.pair));
        next.log_step = log_step(skeleton, &last->pair, &next.pair);
        next.log_followers = cairn_log((cairn_real)followers);
        status = cairn_particle_filter_offer(filter, &next, 0);
        if (status != CAIRN_OK)
            return status;
    }
    return CAIRN_OK;
}

/* Cost in units of the pairs and followers of a particle after a number of steps. */
static int32_t pairs_cost(const skeleton_grouping_written *written, int32_t steps)
{
    return (steps + 1) *
               (1 + (written->candidate_count[0] + written->candidate_count[1]) / EDGELS_PER_UNIT +
                SKELETON_GROUPING_WRITTEN_MAX_FOLLOWERS / FOLLOWERS_PER_UNIT) +
           UNITS_PER_PAIR * written->candidate_count[0] * written->candidate_count[1] +
           UNITS_PER_FOLLOWER * SKELETON_GROUPING_WRITTEN_MAX_FOLLOWERS;
}

/* Searches the edgels ahead of a particle, and makes pairs of those that do not cross its
 * trajectory. */
static int search_ahead(cairn_skeleton_grouping *skeleton,
                        const skeleton_grouping_written_state *last, int32_t steps,
                        cairn_budget *budget)
{
    skeleton_grouping_written *written = skeleton->written;

    CAIRN_STEP_BEGIN(skeleton->propose_resume);
    CAIRN_STEP_UNTIL(
        skeleton->propose_resume,
        cairn_budget_charge(budget, &skeleton->step_units_charged, search_cost(skeleton, last)));
    collect_candidates(skeleton, last);
    CAIRN_STEP_UNTIL(
        skeleton->propose_resume,
        cairn_budget_charge(budget, &skeleton->step_units_charged, pairs_cost(written, steps)));
    cull_candidates(written, last);
    make_pairs(skeleton, last);
    cull_axes(written, last);
    CAIRN_STEP_END(skeleton->propose_resume);
}

static cairn_status propose(void *context, cairn_particle_filter *filter, int32_t index,
                            cairn_budget *budget)
{
    cairn_skeleton_grouping *skeleton = context;
    cairn_particle p = cairn_particle_filter_particle(filter, index);

    if (!search_ahead(skeleton, p.state, p.steps, budget))
        return CAIRN_MORE;
    return offer_pairs(skeleton, filter, p.state);
}

/* A follower's weight is its particle's weight times (3.7), as in (3.6). The filter's prior
 * mass, 1 / followers, is cancelled. */
static cairn_status likelihood(void *context, const cairn_particle_filter *filter, int32_t index,
                               const void *state, cairn_real *log_likelihood, cairn_budget *budget)
{
    const skeleton_grouping_written_state *s = state;

    (void)context;
    (void)filter;
    (void)index;
    (void)budget;
    *log_likelihood = s->log_step + s->log_followers;
    return CAIRN_OK;
}

cairn_particle_filter_model cairn_skeleton_grouping_written_model(cairn_skeleton_grouping *skeleton)
{
    cairn_particle_filter_model model = {
        .context = skeleton, .propose = propose, .likelihood = likelihood};

    return model;
}

/* ---- Runs ---- */

/* Sets the first pose: a CP in one direction of its line; returns 0 if it is invalid. */
static int first_state(const cairn_skeleton_grouping *skeleton,
                       const skeleton_grouping_centre *centre, cairn_vec2 direction,
                       skeleton_grouping_written_state *state)
{
    skeleton_grouping_written_limits rule = cairn_skeleton_grouping_written_limits_of(
        skeleton, RADIUS_MARGIN_SIGMAS * skeleton->params.radius_sigma);

    memset(state, 0, sizeof *state);
    if (!cairn_skeleton_grouping_written_pair(skeleton, &rule, centre->edgel[0], centre->edgel[1],
                                              &state->pair))
        return 0;
    state->heading = direction;
    if (cairn_vec2_cross(direction,
                         cairn_vec2_sub(state->pair.contact[0], state->pair.contact[1])) < 0)
        swap_sides(&state->pair);
    return 1;
}

/* Starts a run; the mirror-symmetric CPs of the line are the first particles. */
static cairn_status begin_run(cairn_skeleton_grouping *skeleton)
{
    cairn_polyline_view view = cairn_polyline_read(skeleton->polyline);
    const skeleton_grouping_seed *start = &skeleton->seeds[skeleton->seed_index];
    const cairn_polyline_segment *line = &view.segments[start->centre];
    cairn_vec2 a = {line->a[0], line->a[1]}, b = {line->b[0], line->b[1]};
    cairn_vec2 direction =
        cairn_vec2_unit(skeleton->direction ? cairn_vec2_sub(b, a) : cairn_vec2_sub(a, b));
    int32_t stride = (start->support + skeleton->params.particle_count - 1) /
                     skeleton->params.particle_count,
            number = 0;
    cairn_status status = cairn_particle_filter_clear(
        skeleton->filter,
        skeleton->params.seed + 2 * (uint64_t)skeleton->seed_index + (uint64_t)skeleton->direction);

    skeleton->step_units_charged = 0;
    skeleton->propose_resume = 0;
    for (int32_t i = 0; i < skeleton->centre_count && status == CAIRN_OK; i++) {
        skeleton_grouping_written_state s;

        if (view.label[i] != start->centre ||
            !cairn_skeleton_grouping_is_mirrored(skeleton, &skeleton->centres[i], line) ||
            number++ % stride != 0 || !first_state(skeleton, &skeleton->centres[i], direction, &s))
            continue;
        status = cairn_particle_filter_start(skeleton->filter, &s, 0);
    }
    skeleton->is_walking = cairn_particle_filter_count(skeleton->filter) > 0;
    return status;
}

static const skeleton_grouping_written_state *best_of(const cairn_skeleton_grouping *skeleton)
{
    return cairn_particle_filter_particle(skeleton->filter,
                                          cairn_particle_filter_read(skeleton->filter).best)
        .state;
}

/* 1 when the heaviest particle did not lose the axis, and may take another step. */
static int may_walk_on(const cairn_skeleton_grouping *skeleton)
{
    cairn_particle_filter_trace t = cairn_particle_filter_read(skeleton->filter);

    return !t.depleted && t.steps < skeleton->params.max_steps &&
           best_of(skeleton)->log_step >= -skeleton->params.stop_log_odds;
}

/* Stores the trajectory of the heaviest particle, without the last step if that step ended it. */
static void end_run(cairn_skeleton_grouping *skeleton)
{
    skeleton_grouping_part *part = &skeleton->candidates[skeleton->candidate_count];
    const skeleton_grouping_written_state *s =
        cairn_particle_filter_count(skeleton->filter) > 0 ? best_of(skeleton) : NULL;
    int32_t count = 0;

    if (s != NULL && s->log_step < -skeleton->params.stop_log_odds)
        s = cairn_particle_filter_state_before(s);
    for (const skeleton_grouping_written_state *at = s; at != NULL;
         at = cairn_particle_filter_state_before(at))
        count++;
    part->first = skeleton->disc_count;
    part->count = count;
    part->state = count > 0 ? 0 : -1;
    skeleton->disc_count += count;
    for (; s != NULL; s = cairn_particle_filter_state_before(s)) {
        skeleton_grouping_disc *d = &skeleton->discs[part->first + --count];

        memset(d, 0, sizeof *d);
        d->centre = s->pair.centre;
        d->radius = s->pair.radius;
        d->gain = s->log_step - LOG_LIKELIHOOD_OFFSET;
        for (int32_t side = 0; side < 2; side++) {
            d->contact[side] = s->pair.contact[side];
            d->edgel[side] = s->pair.edgel[side];
        }
        if (cairn_particle_filter_state_before(s) == NULL)
            d->gain = 0;
    }
    skeleton->candidate_count++;
}

/* 1 when there is capacity for the candidates of both directions of a line, and their discs. */
static int has_capacity(const cairn_skeleton_grouping *skeleton)
{
    return skeleton->candidate_count + 2 <= skeleton->params.max_parts &&
           skeleton->disc_count + 2 * (skeleton->params.max_steps + 1) <=
               skeleton->params.max_points;
}

int cairn_skeleton_grouping_written_walks(cairn_skeleton_grouping *skeleton, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(skeleton->phase_resume);
    for (; skeleton->seed_index < skeleton->seed_count && has_capacity(skeleton);
         skeleton->seed_index++)
        for (skeleton->direction = 0; skeleton->direction < 2; skeleton->direction++) {
            CAIRN_STEP_CHARGE(skeleton, phase_resume, budget,
                              1 + skeleton->centre_count / CENTRES_PER_UNIT);
            skeleton->status = begin_run(skeleton);
            CAIRN_STEP_UNTIL(skeleton->phase_resume, skeleton->status == CAIRN_OK);
            skeleton->walk_count += skeleton->direction == 0;
            while (skeleton->is_walking) {
                skeleton->status = cairn_particle_filter_begin(skeleton->filter);
                CAIRN_STEP_UNTIL(skeleton->phase_resume, skeleton->status == CAIRN_OK);
                CAIRN_STEP_UNTIL(skeleton->phase_resume,
                                 (skeleton->status = cairn_particle_filter_step(
                                      skeleton->filter, budget)) == CAIRN_OK);
                skeleton->is_walking = may_walk_on(skeleton);
            }
            CAIRN_STEP_CHARGE(skeleton, phase_resume, budget,
                              1 + cairn_particle_filter_read(skeleton->filter).steps /
                                      COPIES_PER_UNIT);
            end_run(skeleton);
        }
    CAIRN_STEP_END(skeleton->phase_resume);
}
