/* The walk of the virtual robot as Adluru 2008 has it (sections 3.4 and 3.5): proposal, weights,
 * and the runs from each line.
 *
 * Method, for each line and each way along it:
 * 1. The first particles are the CPs about the line that are mirror images (N at most, evenly).
 * 2. Proposal: from each of the two ends of a particle's contour the contour goes on C sigma along
 *    the edgel's orientation; edgels within C sigma of there that are not enclosed by the contour
 *    so far are paired, each with each. Pairs without a CP, with a radius more than MARGIN R sigma
 *    off the range, and those whose contours or axis cross the walk so far are culled. All others
 *    are followers, equally likely.
 * 3. Weights: (3.7) to (3.9); of all followers N go on, the heaviest, with their weights; resampled
 *    when N_eff < N / 2.
 * 4. The run ends when no particle has a follower, after max_steps, or when (3.7) of the heaviest
 *    particle, of its greatest value, is below Delta_p. Its walk is the part.
 *
 * Limits: circles of more than WRITTEN_EDGELS edgels and particles with more than
 * WRITTEN_FOLLOWERS followers are thinned evenly. */
#include "src/core/build.h"

#include <string.h>

#include "src/contour/skeleton_grouping_written.h"

/* R sigma that a radius may lie off the range. */
#define MARGIN CAIRN_REAL(3.0)
/* Logarithm of the share of its greatest value at which a step makes a part neither likelier nor
 * less likely. */
#define LOG_REFERENCE CAIRN_REAL(-0.5)
/* Units: of a particle; of a pair of edgels; edgels that a piece of the walk is compared with,
 * and pairs, in one unit. */
enum {
    UNITS_A_PARTICLE = 8,
    UNITS_A_PAIR = 2,
    EDGELS_A_UNIT = 8,
    FOLLOWERS_A_UNIT = 16,
    UNITS_A_FOLLOWER = 8
};

static cairn_real angle_from(cairn_vec2 a, cairn_vec2 b)
{
    return cairn_atan2(cairn_vec2_cross(a, b), cairn_vec2_dot(a, b));
}

/* ---- Weights ---- */

/* Logarithm of a Gaussian of mean 0, of its greatest value. */
static cairn_real log_gaussian(cairn_real x, cairn_real sigma)
{
    return CAIRN_REAL(-0.5) * (x / sigma) * (x / sigma);
}

/* Logarithm of H or T of (3.8), of its greatest value: how the contour turned against how the
 * way to the centre turned, what symmetry was lost, and how far the edgel lies from the last
 * one. */
static cairn_real log_side(const cairn_skeleton *g, const written_pair *before,
                           const written_pair *now, int32_t side)
{
    cairn_real contour = angle_from(before->inward[side], now->inward[side]);
    cairn_real way = angle_from(cairn_vec2_sub(before->centre, before->touch[side]),
                                cairn_vec2_sub(now->centre, now->touch[side]));
    cairn_real h = cairn_abs(cairn_wrap_angle(contour - way)) +
                   cairn_max(now->deviation[side] - before->deviation[side], 0);
    cairn_real gap = cairn_vec2_norm(cairn_vec2_sub(now->touch[side], before->touch[side]));

    return log_gaussian(h, g->params.duality) + log_gaussian(gap, g->params.reach);
}

/* Logarithm of (3.7), of its greatest value. */
static cairn_real log_step(const cairn_skeleton *g, const written_pair *before,
                           const written_pair *now)
{
    cairn_real h = log_side(g, before, now, 0), t = log_side(g, before, now, 1),
               most = cairn_max(h, t);
    cairn_real off = cairn_max(
        cairn_max(g->input.min_radius - now->radius, now->radius - g->input.max_radius), 0);

    return most + cairn_log(CAIRN_REAL(0.5) * (cairn_exp(h - most) + cairn_exp(t - most))) +
           log_gaussian(off, g->params.radius);
}

/* ---- Proposal ---- */

/* Where the contour of a side goes on, C sigma along the edgel's orientation. */
static cairn_vec2 ahead_of(const cairn_skeleton *g, const skeleton_written_state *s, int32_t side)
{
    cairn_vec2 tangent = cairn_vec2_left(s->pair.inward[side]);
    cairn_real way = cairn_vec2_dot(tangent, s->heading) < 0 ? -g->params.reach : g->params.reach;

    return cairn_vec2_add(s->pair.touch[side], cairn_vec2_scale(tangent, way));
}

/* Edgels in a look-ahead circle: their number; with a list, every `stride`-th of them is put
 * into it. */
static int32_t scan_circle(const cairn_skeleton *g, cairn_vec2 middle, int32_t stride,
                           written_ahead *list)
{
    cairn_real reach = g->params.reach;
    int32_t x0 = cairn_skeleton_column(g, middle.x - reach),
            x1 = cairn_skeleton_column(g, middle.x + reach);
    int32_t y1 = cairn_skeleton_line(g, middle.y + reach), count = 0;

    for (int32_t y = cairn_skeleton_line(g, middle.y - reach); y <= y1; y++) {
        int32_t from, end;

        skeleton_row(g, y, x0, x1, &from, &end);
        for (int32_t i = from; i < end; i++) {
            if (cairn_vec2_norm_squared(cairn_vec2_sub(g->edgels[i].at, middle)) > reach * reach)
                continue;
            if (list != NULL && count % stride == 0) {
                written_ahead *a = &list[count / stride];

                a->at = g->edgels[i].at;
                a->edgel = i;
                a->inside = a->culled = 0;
            }
            count++;
        }
    }
    return count;
}

static void collect_ahead(cairn_skeleton *g, const skeleton_written_state *s)
{
    skeleton_written *w = g->written;

    for (int32_t side = 0; side < 2; side++) {
        cairn_vec2 middle = ahead_of(g, s, side);
        int32_t all = scan_circle(g, middle, 1, NULL), stride = 1 + (all - 1) / WRITTEN_EDGELS;

        w->ahead_count[side] = all > 0 ? (all + stride - 1) / stride : 0;
        if (all > 0)
            (void)scan_circle(g, middle, stride, w->ahead[side]);
    }
}

static int32_t cost_of_look(const cairn_skeleton *g, const skeleton_written_state *s)
{
    cairn_real reach = g->params.reach;
    int32_t cost = UNITS_A_PARTICLE;

    for (int32_t side = 0; side < 2; side++) {
        cairn_vec2 m = ahead_of(g, s, side);

        cost += skeleton_cost(
            g, cairn_skeleton_column(g, m.x - reach), cairn_skeleton_column(g, m.x + reach),
            cairn_skeleton_line(g, m.y - reach), cairn_skeleton_line(g, m.y + reach));
    }
    return cost;
}

/* The boxes of two pieces share a place. */
static int are_near(cairn_segment a, cairn_segment b)
{
    return cairn_min(a.a.x, a.b.x) <= cairn_max(b.a.x, b.b.x) &&
           cairn_min(b.a.x, b.b.x) <= cairn_max(a.a.x, a.b.x) &&
           cairn_min(a.a.y, a.b.y) <= cairn_max(b.a.y, b.b.y) &&
           cairn_min(b.a.y, b.b.y) <= cairn_max(a.a.y, a.b.y);
}

static int is_crossed(cairn_segment a, cairn_segment b)
{
    return are_near(a, b) && cairn_segments_cross(a, b);
}

/* Of a piece of the polygon about what is explored: a ray to the right from each edgel ahead
 * crosses it or does not. */
static void turn_inside(skeleton_written *w, cairn_vec2 a, cairn_vec2 b)
{
    for (int32_t side = 0; side < 2; side++)
        for (int32_t i = 0; i < w->ahead_count[side]; i++) {
            written_ahead *e = &w->ahead[side][i];

            if ((a.y > e->at.y) != (b.y > e->at.y) &&
                (e->at.x - a.x) * (b.y - a.y) * (b.y > a.y ? 1 : -1) <
                    (b.x - a.x) * (e->at.y - a.y) * (b.y > a.y ? 1 : -1))
                e->inside = !e->inside;
        }
}

/* Edgels that the contour has already. */
static void cull_own(skeleton_written *w, const int32_t edgel[2])
{
    for (int32_t side = 0; side < 2; side++)
        for (int32_t i = 0; i < w->ahead_count[side]; i++)
            if (w->ahead[side][i].edgel == edgel[0] || w->ahead[side][i].edgel == edgel[1])
                w->ahead[side][i].culled = 1;
}

/* Edgels to which the contour of `last` would cross this piece of it; the piece of a side that
 * ends where the way begins does not count. */
static void cull_crossing(skeleton_written *w, const written_pair *last, cairn_segment piece,
                          int32_t ends_at)
{
    for (int32_t side = 0; side < 2; side++)
        for (int32_t i = 0; i < w->ahead_count[side] && side != ends_at; i++) {
            cairn_segment way = {last->touch[side], w->ahead[side][i].at};

            if (is_crossed(way, piece))
                w->ahead[side][i].culled = 1;
        }
}

/* Of the edgels ahead those are culled that lie in explored regions, or whose contour would
 * cross itself. */
static void cull_ahead(skeleton_written *w, const skeleton_written_state *last)
{
    const skeleton_written_state *s = last, *before;

    turn_inside(w, last->pair.touch[0], last->pair.touch[1]);
    for (; s != NULL; s = before) {
        before = cairn_particle_state_before(s);
        cull_own(w, s->pair.edgel);
        for (int32_t side = 0; side < 2 && before != NULL; side++) {
            cairn_segment piece = {before->pair.touch[side], s->pair.touch[side]};

            turn_inside(w, piece.a, piece.b);
            cull_crossing(w, &last->pair, piece, s == last ? side : -1);
        }
        if (before == NULL)
            turn_inside(w, s->pair.touch[0], s->pair.touch[1]);
    }
    for (int32_t side = 0; side < 2; side++)
        for (int32_t i = 0; i < w->ahead_count[side]; i++)
            w->ahead[side][i].culled |= w->ahead[side][i].inside;
}

/* The sum of the four vectors from the edgels before to these (fig. 3.5a). */
static cairn_vec2 heading_of(const written_pair *before, const written_pair *now)
{
    return cairn_vec2_scale(cairn_vec2_sub(cairn_vec2_add(now->touch[0], now->touch[1]),
                                           cairn_vec2_add(before->touch[0], before->touch[1])),
                            2);
}

static void exchange(written_pair *pair)
{
    written_pair old = *pair;

    for (int32_t side = 0; side < 2; side++) {
        pair->touch[side] = old.touch[1 - side];
        pair->inward[side] = old.inward[1 - side];
        pair->deviation[side] = old.deviation[1 - side];
        pair->edgel[side] = old.edgel[1 - side];
    }
}

/* Puts the sides of a pair in the order of those before: both by their sweep about the heading.
 * 0: there is no heading. */
static int correspond(const written_pair *before, written_pair *now)
{
    cairn_vec2 heading = heading_of(before, now);

    if (cairn_vec2_norm_squared(heading) == 0)
        return 0;
    if ((cairn_vec2_cross(heading, cairn_vec2_sub(before->touch[0], before->touch[1])) > 0) !=
        (cairn_vec2_cross(heading, cairn_vec2_sub(now->touch[0], now->touch[1])) > 0))
        exchange(now);
    return 1;
}

static int is_twisted(const written_pair *before, const written_pair *now)
{
    cairn_segment left = {before->touch[0], now->touch[0]},
                  right = {before->touch[1], now->touch[1]};

    return is_crossed(left, right);
}

/* One in `stride` of those seen; when the list is full every other one goes. */
static void keep(skeleton_written *w, const written_pair *pair)
{
    int64_t number = w->seen++;

    if (number % w->stride != 0)
        return;
    if (w->pair_count == WRITTEN_FOLLOWERS) {
        w->pair_count /= 2;
        for (int32_t i = 1; i < w->pair_count; i++)
            w->pairs[i] = w->pairs[2 * i];
        w->stride *= 2;
    }
    w->pairs[w->pair_count++] = *pair;
}

/* Each edgel ahead of one end with each ahead of the other. */
static void make_pairs(cairn_skeleton *g, const skeleton_written_state *last)
{
    skeleton_written *w = g->written;
    written_rule rule = cairn_skeleton_written_rule(g, MARGIN * g->params.radius);

    w->pair_count = 0;
    w->seen = 0;
    w->stride = 1;
    for (int32_t i = 0; i < w->ahead_count[0]; i++)
        for (int32_t j = 0; j < w->ahead_count[1] && !w->ahead[0][i].culled; j++) {
            written_pair pair;

            if (!w->ahead[1][j].culled &&
                cairn_skeleton_written_pair(g, &rule, w->ahead[0][i].edgel, w->ahead[1][j].edgel,
                                            &pair) &&
                correspond(&last->pair, &pair) && !is_twisted(&last->pair, &pair))
                keep(w, &pair);
        }
}

/* Pairs whose axis crosses the axis so far. */
static void cull_axes(skeleton_written *w, const skeleton_written_state *last)
{
    const skeleton_written_state *s = last, *before = cairn_particle_state_before(last);

    for (; before != NULL; s = before, before = cairn_particle_state_before(before)) {
        cairn_segment piece = {before->pair.centre, s->pair.centre};

        for (int32_t i = 0; i < w->pair_count && s != last; i++) {
            cairn_segment way = {last->pair.centre, w->pairs[i].centre};

            w->pairs[i].crossed |= is_crossed(way, piece);
        }
    }
}

static cairn_status offer_pairs(const cairn_skeleton *g, cairn_particle_filter *filter,
                                const skeleton_written_state *last)
{
    int32_t followers = 0;

    for (int32_t i = 0; i < g->written->pair_count; i++)
        followers += !g->written->pairs[i].crossed;
    for (int32_t i = 0; i < g->written->pair_count; i++) {
        skeleton_written_state next;
        cairn_status status;

        if (g->written->pairs[i].crossed)
            continue;
        memset(&next, 0, sizeof next);
        next.pair = g->written->pairs[i];
        next.heading = cairn_vec2_unit(heading_of(&last->pair, &next.pair));
        next.log_step = log_step(g, &last->pair, &next.pair);
        next.log_followers = cairn_log((cairn_real)followers);
        status = cairn_particle_filter_offer(filter, &next, 0);
        if (status != CAIRN_OK)
            return status;
    }
    return CAIRN_OK;
}

static cairn_status propose(void *context, cairn_particle_filter *filter, int32_t index,
                            cairn_budget *budget)
{
    cairn_skeleton *g = context;
    skeleton_written *w = g->written;
    cairn_particle p = cairn_particle_filter_particle(filter, index);
    const skeleton_written_state *last = p.state;
    int32_t cost;

    if (!w->collected) {
        if (!cairn_budget_pay(budget, &g->stage, cost_of_look(g, last)))
            return CAIRN_MORE;
        collect_ahead(g, last);
        w->collected = 1;
    }
    cost = (p.steps + 1) * (1 + (w->ahead_count[0] + w->ahead_count[1]) / EDGELS_A_UNIT +
                            WRITTEN_FOLLOWERS / FOLLOWERS_A_UNIT) +
           UNITS_A_PAIR * w->ahead_count[0] * w->ahead_count[1] +
           UNITS_A_FOLLOWER * WRITTEN_FOLLOWERS;
    if (!cairn_budget_pay(budget, &g->stage, cost))
        return CAIRN_MORE;
    w->collected = 0;
    cull_ahead(w, last);
    make_pairs(g, last);
    cull_axes(w, last);
    return offer_pairs(g, filter, last);
}

/* Each follower has the weight of its particle times (3.7), as in (3.6): the filter's prior
 * mass, 1 / followers, is taken back. */
static cairn_status likelihood(void *context, const cairn_particle_filter *filter, int32_t index,
                               const void *state, cairn_real *log_likelihood, cairn_budget *budget)
{
    const skeleton_written_state *s = state;

    (void)context;
    (void)filter;
    (void)index;
    (void)budget;
    *log_likelihood = s->log_step + s->log_followers;
    return CAIRN_OK;
}

cairn_particle_model cairn_skeleton_written_model(cairn_skeleton *g)
{
    cairn_particle_model model = {g, propose, likelihood, NULL, NULL};

    return model;
}

/* ---- Runs ---- */

/* The first pose: a CP, seen along one way of its line. 0: it is none. */
static int first_state(const cairn_skeleton *g, const skeleton_centre *c, cairn_vec2 way,
                       skeleton_written_state *s)
{
    written_rule rule = cairn_skeleton_written_rule(g, MARGIN * g->params.radius);

    memset(s, 0, sizeof *s);
    if (!cairn_skeleton_written_pair(g, &rule, c->edgel[0], c->edgel[1], &s->pair))
        return 0;
    s->heading = way;
    if (cairn_vec2_cross(way, cairn_vec2_sub(s->pair.touch[0], s->pair.touch[1])) < 0)
        exchange(&s->pair);
    return 1;
}

/* The CPs about the line that are mirror images are the first particles. */
static cairn_status begin_run(cairn_skeleton *g)
{
    cairn_polyline_view view = cairn_polyline_read(g->polyline);
    const skeleton_start *start = &g->starts[g->start];
    const cairn_polyline_segment *line = &view.segments[start->centre];
    cairn_vec2 a = {line->a[0], line->a[1]}, b = {line->b[0], line->b[1]};
    cairn_vec2 way = cairn_vec2_unit(g->direction ? cairn_vec2_sub(b, a) : cairn_vec2_sub(a, b));
    int32_t stride = (start->support + g->params.particles - 1) / g->params.particles, number = 0;
    cairn_status status = cairn_particle_filter_clear(
        g->filter, g->params.seed + 2 * (uint64_t)g->start + (uint64_t)g->direction);

    g->stage = 0;
    g->written->collected = 0;
    for (int32_t i = 0; i < g->centre_count && status == CAIRN_OK; i++) {
        skeleton_written_state s;

        if (view.label[i] != start->centre ||
            !cairn_skeleton_is_mirrored(g, &g->centres[i], line) || number++ % stride != 0 ||
            !first_state(g, &g->centres[i], way, &s))
            continue;
        status = cairn_particle_filter_start(g->filter, &s, 0);
    }
    return status;
}

static const skeleton_written_state *best_of(const cairn_skeleton *g)
{
    return cairn_particle_filter_particle(g->filter, cairn_particle_filter_read(g->filter).best)
        .state;
}

/* Step by step, until the run ends. */
static cairn_status run(cairn_skeleton *g, cairn_budget *budget)
{
    if (cairn_particle_filter_count(g->filter) == 0)
        return CAIRN_OK;
    for (;;) {
        cairn_particle_trace t;
        cairn_status status;

        if (!g->is_walking) {
            status = cairn_particle_filter_begin(g->filter);
            if (status != CAIRN_OK)
                return status;
            g->is_walking = 1;
        }
        status = cairn_particle_filter_step(g->filter, budget);
        if (status != CAIRN_OK)
            return status;
        g->is_walking = 0;
        t = cairn_particle_filter_read(g->filter);
        if (t.extinct || t.steps >= g->params.max_steps || best_of(g)->log_step < -g->params.stop)
            return CAIRN_OK;
    }
}

/* The walk of the heaviest particle, without the last step if that is what ended it. */
static void end_run(cairn_skeleton *g)
{
    skeleton_part *part = &g->candidates[g->candidate_count];
    const skeleton_written_state *s =
        cairn_particle_filter_count(g->filter) > 0 ? best_of(g) : NULL;
    int32_t count = 0;

    if (s != NULL && s->log_step < -g->params.stop)
        s = cairn_particle_state_before(s);
    for (const skeleton_written_state *at = s; at != NULL; at = cairn_particle_state_before(at))
        count++;
    part->first = g->disc_count;
    part->count = count;
    part->state = count > 0 ? 0 : -1;
    g->disc_count += count;
    for (; s != NULL; s = cairn_particle_state_before(s)) {
        skeleton_disc *d = &g->discs[part->first + --count];

        memset(d, 0, sizeof *d);
        d->centre = s->pair.centre;
        d->radius = s->pair.radius;
        d->gain = s->log_step - LOG_REFERENCE;
        for (int32_t side = 0; side < 2; side++) {
            d->touch[side] = s->pair.touch[side];
            d->edgel[side] = s->pair.edgel[side];
        }
        if (cairn_particle_state_before(s) == NULL)
            d->gain = 0;
    }
    g->candidate_count++;
}

/* From line to line, both ways, until max_parts or max_points is reached. */
cairn_status cairn_skeleton_written_walks(cairn_skeleton *g, cairn_budget *budget)
{
    for (; g->start < g->start_count; g->start++) {
        for (; g->direction < 2; g->direction++) {
            cairn_status status;

            if (g->item == 0) {
                if (g->candidate_count + 2 - g->direction > g->params.max_parts ||
                    g->disc_count + (2 - g->direction) * (g->params.max_steps + 1) >
                        g->params.max_points)
                    return CAIRN_OK;
                if (!cairn_budget_pay(budget, &g->paid, 1 + g->centre_count / 4))
                    return CAIRN_MORE;
                status = begin_run(g);
                if (status != CAIRN_OK)
                    return status;
                g->walked += g->direction == 0;
                g->item = 1;
            }
            status = run(g, budget);
            if (status != CAIRN_OK)
                return status;
            end_run(g);
            g->item = 0;
        }
        g->direction = 0;
    }
    return CAIRN_OK;
}
