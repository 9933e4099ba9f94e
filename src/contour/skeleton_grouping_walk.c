/* The walk: the filter's callbacks, and the runs from each start to both ends of its axis.
 * A step looks ahead of both ends of the contour, along their tangents, for edgels, or carries a
 * side on where none is seen; of all pairs those remain whose disc lies ahead, whose axis does
 * not come back upon itself and whose radius is near the range. The gain of a side is the
 * logarithm of how many times likelier its edgel is as the contour's next one than as one of
 * those strewn about here: for a chord that turns by b and a normal that turns by t a contour of
 * steady bend has t = 2 b. That of a pair is how much likelier its symmetry and its change of
 * radius are than by chance. Of strewn edgels few are steep: the slope of an edgel is evidence,
 * too. */
#include "src/core/build.h"

#include <string.h>

#include "cairn/symmetric_point.h"
#include "src/contour/skeleton_grouping_work.h"

/* Steps, of the radius and px. */
#define STEP       CAIRN_REAL(0.4)
#define STEP_LEAST CAIRN_REAL(3.0)
/* How far from where it is expected an edgel may lie, of a step. */
#define LOOK CAIRN_REAL(0.8)
/* Edgels that are nearer to each other are one choice, px. */
#define APART CAIRN_REAL(1.8)
/* What the sides' gains count: both say much the same step after step. */
#define SIDES CAIRN_REAL(0.5)
/* Change of the radius along the axis, sigma. */
#define SLOPE CAIRN_REAL(0.18)
/* Losses are no larger than this. */
#define LOSS_MOST       CAIRN_REAL(-4.0)
#define RANGE_LOSS_MOST CAIRN_REAL(-2.0)
/* The inside of a disc, of its radius; how many edgels lie there, of those in the background;
 * what that counts. */
#define CORE    CAIRN_REAL(0.6)
#define EMPTIER CAIRN_REAL(0.3)
#define HOLLOW  CAIRN_REAL(0.4)
/* Likelihoods are this root of the odds, so that several ways live on. */
#define TEMPER    CAIRN_REAL(0.35)
#define TURN_MOST (50 * (CAIRN_PI / 180))
enum { UNITS_A_PROPOSAL = 150, HISTORY_A_UNIT = 8, NEAR_PAST = 3 };

/* What a side may go on with. */
typedef struct choice {
    cairn_vec2 at, inward;
    cairn_real gain;
    cairn_real chord; /* px, from the last touch */
    int32_t edgel, sense;
} choice;

/* Logarithm of a normal density. */
static cairn_real log_normal(cairn_real x, cairn_real sigma)
{
    return -cairn_half_square(x / sigma) - cairn_log(sigma) - CAIRN_REAL(0.9189385332046727);
}

static cairn_real angle_from(cairn_vec2 a, cairn_vec2 b)
{
    return cairn_atan2(cairn_vec2_cross(a, b), cairn_vec2_dot(a, b));
}

static cairn_real step_of(const cairn_skeleton *g, cairn_real radius)
{
    return cairn_min(cairn_max(STEP * radius, STEP_LEAST), g->params.reach);
}

/* Along the contour, ahead. */
static cairn_vec2 ahead_of(const skeleton_state *s, int32_t side)
{
    cairn_vec2 tangent = cairn_vec2_left(s->inward[side]);

    return cairn_vec2_dot(tangent, s->heading) < 0 ? cairn_vec2_scale(tangent, -1) : tangent;
}

/* Where the contour goes on if it is straight. */
static cairn_vec2 wanted_of(const skeleton_state *s, int32_t side, cairn_real step)
{
    return cairn_vec2_add(s->touch[side], cairn_vec2_scale(ahead_of(s, side), step));
}

/* The gain of an edgel as the next one of a side. */
static cairn_real side_gain(const cairn_skeleton *g, const skeleton_state *s, int32_t side,
                            const choice *c, cairn_vec2 ahead, cairn_real log_density)
{
    cairn_vec2 chord = cairn_vec2_sub(c->at, s->touch[side]);
    cairn_real bend = angle_from(ahead, chord), turn = angle_from(s->inward[side], c->inward);
    cairn_real flip = c->sense == s->sense[side] ? 1 - g->params.flip : g->params.flip;

    if (cairn_abs(bend) > TURN_MOST)
        return -CAIRN_REAL_MAX;
    return cairn_log(g->params.detection * 2 * flip * 2 * CAIRN_PI / cairn_max(c->chord, 1)) -
           log_density + log_normal(bend, CAIRN_REAL(0.75) * g->params.duality) +
           log_normal(turn - 2 * bend, CAIRN_REAL(0.5) * g->params.duality) +
           g->params.contrast * g->edgels[c->edgel].contrast;
}

/* Into the list, the best first; of two at about the same place only the better. */
static void offer_choice(choice *list, int32_t *count, const choice *c)
{
    int32_t i;

    for (i = 0; i < *count; i++)
        if (cairn_vec2_norm_squared(cairn_vec2_sub(list[i].at, c->at)) < APART * APART) {
            if (list[i].gain >= c->gain)
                return;
            memmove(&list[i], &list[i + 1], (size_t)(*count - i - 1) * sizeof *list);
            --*count;
            break;
        }
    if (*count == SKELETON_CHOICE) {
        if (list[*count - 1].gain >= c->gain)
            return;
        --*count;
    }
    for (i = (*count)++; i > 0 && list[i - 1].gain < c->gain; i--)
        list[i] = list[i - 1];
    list[i] = *c;
}

/* The edgels that a side may go on with, and none. */
static int32_t choices_of(const cairn_skeleton *g, const skeleton_state *s, int32_t side,
                          cairn_real step, choice *list)
{
    cairn_vec2 ahead = ahead_of(s, side), wanted = wanted_of(s, side, step);
    cairn_real look = LOOK * step, log_density = cairn_log(cairn_skeleton_density(g, wanted));
    int32_t x0 = cairn_skeleton_column(g, wanted.x - look),
            x1 = cairn_skeleton_column(g, wanted.x + look);
    int32_t y1 = cairn_skeleton_line(g, wanted.y + look), count = 0;
    choice none = {wanted, s->inward[side], cairn_log(1 - g->params.detection), step,
                   -1,     s->sense[side]};

    for (int32_t y = cairn_skeleton_line(g, wanted.y - look); y <= y1; y++) {
        int32_t from, end;

        skeleton_row(g, y, x0, x1, &from, &end);
        for (int32_t i = from; i < end; i++) {
            const skeleton_edgel *e = &g->edgels[i];
            choice c = {e->at, e->normal, 0, 0, i, SKELETON_BRIGHTER};

            if (cairn_vec2_norm_squared(cairn_vec2_sub(e->at, wanted)) > look * look)
                continue;
            if (cairn_vec2_dot(e->normal, s->inward[side]) < 0) {
                c.inward = cairn_vec2_scale(e->normal, -1);
                c.sense = SKELETON_DARKER;
            }
            c.chord = cairn_vec2_norm(cairn_vec2_sub(e->at, s->touch[side]));
            c.gain = side_gain(g, s, side, &c, ahead, log_density);
            if (c.gain > none.gain)
                offer_choice(list, &count, &c);
        }
    }
    list[count++] = none;
    return count;
}

/* The log odds of a radius against the range. */
static cairn_real range_gain(const cairn_skeleton *g, cairn_real radius)
{
    cairn_real off =
        cairn_max(cairn_max(g->input.min_radius - radius, radius - g->input.max_radius), 0);

    return cairn_max(-cairn_half_square(off / (g->params.radius * radius)), RANGE_LOSS_MOST);
}

static cairn_real pair_gain(const cairn_skeleton *g, const skeleton_state *before,
                            const skeleton_state *s)
{
    cairn_real along = cairn_max(cairn_vec2_norm(cairn_vec2_sub(s->centre, before->centre)), 1);
    cairn_real symmetry =
        log_normal(s->deviation, g->params.symmetry) + cairn_log(2 * CAIRN_PI / 3);
    cairn_real slope = log_normal((s->radius - before->radius) / along, SLOPE) + cairn_log(2);

    return cairn_max(symmetry, LOSS_MOST) + cairn_max(slope, LOSS_MOST);
}

static cairn_real gain_of(const cairn_skeleton *g, const skeleton_state *before,
                          const skeleton_state *s, const choice *left, const choice *right)
{
    cairn_real range = range_gain(g, s->radius);

    /* A contour on one side alone says nothing of an axis. */
    if (left->edgel < 0 || right->edgel < 0)
        return SIDES * ((left->edgel < 0 ? left->gain : 0) + (right->edgel < 0 ? right->gain : 0)) +
               range;
    return SIDES * (left->gain + right->gain) + pair_gain(g, before, s) + range;
}

/* Units for the edgels within a distance of a place. */
static int32_t cost_about(const cairn_skeleton *g, cairn_vec2 place, cairn_real reach)
{
    return skeleton_cost(
        g, cairn_skeleton_column(g, place.x - reach), cairn_skeleton_column(g, place.x + reach),
        cairn_skeleton_line(g, place.y - reach), cairn_skeleton_line(g, place.y + reach));
}

/* What the inside of the next disc says: it is emptier than the background, where it is an
 * object's. */
static cairn_real hollow_gain(const cairn_skeleton *g, cairn_vec2 centre, cairn_real radius)
{
    cairn_real core = CORE * radius,
               expected = cairn_skeleton_density(g, centre) * CAIRN_PI * core * core;
    int32_t x0 = cairn_skeleton_column(g, centre.x - core),
            x1 = cairn_skeleton_column(g, centre.x + core);
    int32_t y1 = cairn_skeleton_line(g, centre.y + core), count = 0;

    for (int32_t y = cairn_skeleton_line(g, centre.y - core); y <= y1; y++) {
        int32_t from, end;

        skeleton_row(g, y, x0, x1, &from, &end);
        for (int32_t i = from; i < end; i++)
            count += cairn_vec2_norm_squared(cairn_vec2_sub(g->edgels[i].at, centre)) < core * core;
    }
    return HOLLOW * ((1 - EMPTIER) * expected + (cairn_real)count * cairn_log(EMPTIER)) *
           STEP_LEAST / (2 * core);
}

/* The state that two choices make; 0: there is none. */
static int make_state(const cairn_skeleton *g, const skeleton_state *before, const choice *left,
                      const choice *right, cairn_real step, cairn_real hollow, skeleton_state *s)
{
    cairn_oriented_point first = {left->at, cairn_vec2_left(left->inward)};
    cairn_oriented_point second = {right->at, cairn_vec2_left(right->inward)};
    cairn_symmetric_point sp;
    cairn_vec2 moved;
    cairn_real along;

    if ((left->edgel >= 0 && left->edgel == right->edgel) ||
        !cairn_symmetric_point_of(first, second, 1, &sp) || sp.radius < g->low ||
        sp.radius > g->high)
        return 0;
    moved = cairn_vec2_sub(sp.centre, before->centre);
    along = cairn_vec2_dot(moved, before->heading);
    if (along < CAIRN_REAL(0.2) * step || along > 3 * step ||
        cairn_vec2_dot(left->inward, cairn_vec2_sub(sp.centre, left->at)) <
            CAIRN_REAL(0.5) * sp.radius ||
        cairn_vec2_dot(right->inward, cairn_vec2_sub(sp.centre, right->at)) <
            CAIRN_REAL(0.5) * sp.radius)
        return 0;
    *s = *before;
    s->touch[0] = left->at;
    s->touch[1] = right->at;
    s->inward[0] = left->inward;
    s->inward[1] = right->inward;
    s->edgel[0] = left->edgel;
    s->edgel[1] = right->edgel;
    s->sense[0] = left->sense;
    s->sense[1] = right->sense;
    s->centre = sp.centre;
    s->radius = sp.radius;
    s->deviation = sp.deviation;
    /* Steps are short and their directions rough: the heading follows them slowly. */
    s->heading = cairn_vec2_unit(
        cairn_vec2_add(before->heading, cairn_vec2_scale(cairn_vec2_unit(moved), CAIRN_REAL(0.7))));
    if (cairn_vec2_cross(s->heading, cairn_vec2_sub(left->at, sp.centre)) <= 0 ||
        cairn_vec2_cross(s->heading, cairn_vec2_sub(right->at, sp.centre)) >= 0)
        return 0;
    s->length++;
    /* Edgels lie a pixel apart: a longer step says more. */
    s->gain = (gain_of(g, before, s, left, right) + hollow) * step / STEP_LEAST;
    s->total += s->gain;
    s->best = cairn_max(s->best, s->total);
    return 1;
}

/* 1: the axis comes back upon itself. */
static int has_been(const skeleton_state *last, cairn_vec2 next)
{
    const skeleton_state *s = last;

    for (int32_t i = 0; s != NULL; i++, s = cairn_particle_state_before(s))
        if (i > NEAR_PAST &&
            cairn_vec2_norm_squared(cairn_vec2_sub(s->centre, next)) < cairn_half_square(s->radius))
            return 1;
    return 0;
}

/* Of the steps from a state. */
static int32_t cost_of(const cairn_skeleton *g, const skeleton_state *s, cairn_real step)
{
    cairn_vec2 next = cairn_vec2_add(s->centre, cairn_vec2_scale(s->heading, step));
    int32_t cost =
        UNITS_A_PROPOSAL + s->length / HISTORY_A_UNIT + cost_about(g, next, CORE * s->radius);

    for (int32_t side = 0; side < 2; side++)
        cost += cost_about(g, wanted_of(s, side, step), LOOK * step);
    return cost;
}

static cairn_status propose(void *context, cairn_particle_filter *filter, int32_t index,
                            cairn_budget *budget)
{
    cairn_skeleton *g = context;
    const skeleton_state *before = cairn_particle_filter_particle(filter, index).state;
    choice list[2][SKELETON_CHOICE + 1];
    int32_t count[2];
    cairn_real step = step_of(g, before->radius), hollow;

    if (!cairn_budget_pay(budget, &g->stage, cost_of(g, before, step)))
        return CAIRN_MORE;
    if (before->best - before->total > g->params.stop ||
        has_been(before, cairn_vec2_add(before->centre, cairn_vec2_scale(before->heading, step))))
        return CAIRN_OK;
    hollow = hollow_gain(g, cairn_vec2_add(before->centre, cairn_vec2_scale(before->heading, step)),
                         before->radius);
    for (int32_t side = 0; side < 2; side++)
        count[side] = choices_of(g, before, side, step, list[side]);
    for (int32_t i = 0; i < count[0]; i++)
        for (int32_t j = 0; j < count[1]; j++) {
            skeleton_state next;
            cairn_status status;

            if (!make_state(g, before, &list[0][i], &list[1][j], step, hollow, &next))
                continue;
            status = cairn_particle_filter_offer(filter, &next, 0);
            if (status != CAIRN_OK && status != CAIRN_FULL)
                return status;
        }
    return CAIRN_OK;
}

static cairn_status likelihood(void *context, const cairn_particle_filter *filter, int32_t index,
                               const void *state, cairn_real *log_likelihood, cairn_budget *budget)
{
    const skeleton_state *s = state;

    (void)context;
    (void)filter;
    (void)index;
    (void)budget;
    *log_likelihood = TEMPER * s->gain;
    return CAIRN_OK;
}

/* Keeps the walk to a state's best when it is the best so far. */
static void consider(cairn_skeleton *g, const skeleton_state *last)
{
    const skeleton_state *s = last;

    if (!(last->best > g->path_best))
        return;
    g->path_best = last->best;
    while (s->total < last->best && s->length > 0)
        s = cairn_particle_state_before(s);
    g->path_count = s->length;
    for (; s != NULL && s->length > 0; s = cairn_particle_state_before(s))
        g->path[s->length - 1] = *s;
}

static void lost(void *context, const cairn_particle_filter *filter, int32_t index)
{
    consider(context, cairn_particle_filter_particle(filter, index).state);
}

cairn_particle_model cairn_skeleton_model(cairn_skeleton *g)
{
    cairn_particle_model model = {g, propose, likelihood, NULL, lost};

    return model;
}

/* ---- Runs ---- */

/* The first state: the start's CP, seen along one direction of its axis. */
static skeleton_state first_state(const cairn_skeleton *g)
{
    const skeleton_centre *c = &g->centres[g->starts[g->start].centre];
    cairn_vec2 chord = cairn_vec2_sub(g->edgels[c->edgel[1]].at, g->edgels[c->edgel[0]].at);
    skeleton_state s;

    memset(&s, 0, sizeof s);
    s.heading = cairn_vec2_unit(cairn_vec2_left(chord));
    if (g->direction == 0)
        s.heading = cairn_vec2_scale(s.heading, -1);
    for (int32_t side = 0; side < 2; side++) {
        int32_t from = side ^ (g->direction == 0), edgel = c->edgel[from];

        s.touch[side] = g->edgels[edgel].at;
        s.inward[side] = skeleton_inward(&g->edgels[edgel], c->sense[from]);
        s.edgel[side] = edgel;
        s.sense[side] = c->sense[from];
    }
    s.centre = c->at;
    s.radius = c->radius;
    s.deviation = c->deviation;
    return s;
}

/* 1: a walk from another start has been here. */
static int is_known(const cairn_skeleton *g, const skeleton_centre *c)
{
    for (int32_t i = 0; i < g->disc_count; i++) {
        const skeleton_disc *d = &g->discs[i];

        if (cairn_vec2_norm_squared(cairn_vec2_sub(d->centre, c->at)) <
                CAIRN_REAL(0.25) * c->radius * c->radius &&
            cairn_abs(d->radius - c->radius) < CAIRN_REAL(0.3) * c->radius)
            return 1;
    }
    return 0;
}

/* Discs of the walk to one end: those of the first run turn round, and lie in front of the
 * start. */
static void take_discs(cairn_skeleton *g)
{
    int32_t reversed = g->direction == 0;

    for (int32_t i = 0; i < g->path_count; i++) {
        const skeleton_state *s = &g->path[reversed ? g->path_count - 1 - i : i];
        skeleton_disc *d = &g->discs[g->disc_count++];

        d->centre = s->centre;
        d->radius = s->radius;
        d->gain = s->gain;
        for (int32_t side = 0; side < 2; side++) {
            d->touch[side] = s->touch[side ^ reversed];
            d->edgel[side] = s->edgel[side ^ reversed];
            d->sense[side] = s->sense[side ^ reversed];
        }
    }
}

static cairn_status begin_run(cairn_skeleton *g)
{
    skeleton_state s = first_state(g);
    cairn_status status =
        cairn_particle_filter_clear(g->filter, g->params.seed + (uint64_t)g->start);

    g->path_best = 0;
    g->path_count = 0;
    g->stage = 0;
    if (status == CAIRN_OK)
        status = cairn_particle_filter_start(g->filter, &s, 0);
    if (status == CAIRN_OK)
        status = cairn_particle_filter_begin(g->filter);
    return status;
}

static cairn_status run(cairn_skeleton *g, cairn_budget *budget)
{
    for (;;) {
        cairn_status status = cairn_particle_filter_step(g->filter, budget);
        cairn_particle_trace t;

        if (status != CAIRN_OK)
            return status;
        t = cairn_particle_filter_read(g->filter);
        if (t.extinct || t.steps >= g->params.max_steps)
            break;
        status = cairn_particle_filter_begin(g->filter);
        if (status != CAIRN_OK)
            return status;
    }
    for (int32_t i = 0; i < cairn_particle_filter_count(g->filter); i++)
        consider(g, cairn_particle_filter_particle(g->filter, i).state);
    return CAIRN_OK;
}

/* What the first run leaves, the start, and what the second one does: one candidate. */
static void end_run(cairn_skeleton *g)
{
    skeleton_part *p = &g->candidates[g->candidate_count];

    if (g->direction == 0) {
        p->first = g->disc_count;
        take_discs(g);
        g->direction = 1;
        g->path[0] = first_state(g);
        g->path_count = 1;
        take_discs(g);
        return;
    }
    take_discs(g);
    p->count = g->disc_count - p->first;
    p->state = 0;
    g->candidate_count++;
    g->direction = 0;
    g->start++;
}

/* From start to start, as long as there is room. */
cairn_status cairn_skeleton_walks(cairn_skeleton *g, cairn_budget *budget)
{
    while (g->start < g->start_count) {
        cairn_status status;

        if (!g->is_walking) {
            if (g->direction == 0) {
                if (g->candidate_count == g->params.max_parts ||
                    g->disc_count + 2 * g->params.max_steps + 1 > g->params.max_points)
                    break;
                if (!cairn_budget_pay(budget, &g->paid, 1 + g->disc_count / 16))
                    return CAIRN_MORE;
                if (is_known(g, &g->centres[g->starts[g->start].centre])) {
                    g->start++;
                    continue;
                }
                g->walked++;
            }
            status = begin_run(g);
            if (status != CAIRN_OK)
                return status;
            g->is_walking = 1;
        }
        status = run(g, budget);
        if (status != CAIRN_OK)
            return status;
        g->is_walking = 0;
        end_run(g);
    }
    return CAIRN_OK;
}
