/* The walk of the mode as written: the filter's callbacks.
 *
 * Method: a particle looks ahead about the open ends of both sides (2.4.2): segments with an end
 * within L of the open one, outside the region that its contour encloses, are paired. Pairs are
 * culled that cross the contour or the skeleton, or have no symmetric point of the model's radii.
 * Masses are those of the gaps and of the loss of symmetry (2.11); likelihoods those of the
 * displacement and of the radius (2.12, 2.13), which no proposal has seen. The past of a particle
 * is read from its history.
 *
 * Source: Adluru 2008, sections 2.3 to 2.5. */
#include "src/core/build.h"

#include "src/contour/contour_grouping_written.h"

/* Units: of a proposal, of a step of its past; steps of the past that an end in a look-ahead
 * circle, and a pair, is checked against in one unit. */
enum { UNITS_A_PROPOSAL = 60, UNITS_A_STEP = 12, STEPS_AN_END = 1, STEPS_A_PAIR = 2 };

/* ---- The model ---- */

/* N(x; 0, sigma), 1 at 0. */
static cairn_real normal(cairn_real x, cairn_real sigma)
{
    return cairn_exp(-cairn_half_square(x / sigma));
}

/* Sample k of the longest path, walked from its first sample or from its last. */
static const cairn_shape_sample *sample_of(const cairn_shape_model *m, int32_t way, int32_t k)
{
    const cairn_shape_path *path = &m->paths[0];

    return &m->samples[path->first + (way ? path->count - 1 - k : k)];
}

/* D_k of the longest path, walked from its first sample or from its last. */
static cairn_vec2 displacement_of(const cairn_shape_model *m, int32_t way, int32_t k)
{
    int32_t last = m->paths[0].count - 1;

    if (!way)
        return cairn_shape_displacement(m, 0, k);
    return cairn_vec2_sub(cairn_shape_displacement(m, 0, last - k),
                          cairn_shape_displacement(m, 0, last));
}

/* ds of (2.12), of two displacements in sizes: the angle between them, rad, and the difference
 * of their lengths in mean radii of the model. Of displacements shorter than a mean radius the
 * angle counts in proportion. */
static cairn_real dissimilarity(const struct grouping_written *w, cairn_vec2 model, cairn_vec2 seen)
{
    cairn_real length = cairn_vec2_norm(seen), expected = cairn_vec2_norm(model);
    cairn_real angle =
        cairn_abs(cairn_atan2(cairn_vec2_cross(model, seen), cairn_vec2_dot(model, seen)));

    return angle * cairn_min(1, cairn_min(length, expected) / w->mean_radius) +
           cairn_abs(length - expected) / w->mean_radius;
}

cairn_real cairn_grouping_written_likelihood(const cairn_grouping *grouping,
                                             const grouping_written_state *s, int32_t *sample)
{
    const struct grouping_written *w = grouping->written;
    const cairn_shape_model *m = grouping->input.model;
    cairn_vec2 seen = cairn_vec2_scale(cairn_vec2_sub(s->centre, s->start), 1 / w->size);
    cairn_real least = CAIRN_REAL_MAX, off;

    *sample = 0;
    for (int32_t k = 0; k < m->paths[0].count; k++) {
        cairn_real d = dissimilarity(w, displacement_of(m, s->way, k), seen);

        if (d < least) {
            least = d;
            *sample = k;
        }
    }
    if (!grouping->params.use_model)
        return 0;
    off = (s->radius / w->size - sample_of(m, s->way, *sample)->radius) / w->mean_radius;
    return cairn_log(CAIRN_REAL(0.5) * normal(least, grouping->params.path_sigma) +
                     CAIRN_REAL(0.5) * normal(off, grouping->params.radius_sigma));
}

int32_t cairn_grouping_written_likelihood_units(const cairn_grouping *grouping)
{
    return 1 + grouping->input.model->paths[0].count;
}

/* ---- The past of a particle ---- */

static void add_side(const cairn_grouping *grouping, written_side *side, int32_t open)
{
    side->vertex[side->count++] = grouping_written_end(grouping, open ^ 1);
    side->vertex[side->count++] = grouping_written_end(grouping, open);
}

/* Reads the history up to a state: the states, both sides, the region between them. */
static void read_past(cairn_grouping *grouping, const grouping_written_state *last, int32_t count)
{
    struct grouping_written *w = grouping->written;

    w->past_count = count;
    w->look++;
    for (int32_t i = count - 1; i >= 0; i--) {
        w->past[i] = last;
        w->stamp[last->segment[0]] = w->stamp[last->segment[1]] = w->look;
        last = cairn_particle_state_before(last);
    }
    w->polygon_count = 0;
    for (int32_t s = 0; s < 2; s++) {
        w->side[s].count = 0;
        for (int32_t i = 0; i < count; i++)
            if (i == 0 || w->past[i]->segment[s] != w->past[i - 1]->segment[s])
                add_side(grouping, &w->side[s], w->past[i]->end[s]);
    }
    for (int32_t i = 0; i < w->side[0].count; i++)
        w->polygon[w->polygon_count++] = w->side[0].vertex[i];
    for (int32_t i = w->side[1].count - 1; i >= 0; i--)
        w->polygon[w->polygon_count++] = w->side[1].vertex[i];
}

/* 1 when a line crosses a side of the contour, whose last `but` vertices do not count. */
static int crosses_side(const written_side *side, cairn_segment line, int32_t but)
{
    for (int32_t i = 0; i + 1 < side->count - but; i++) {
        cairn_segment piece = {side->vertex[i], side->vertex[i + 1]};

        if (cairn_segments_cross(piece, line))
            return 1;
    }
    return 0;
}

/* ---- Extensions ---- */

/* Whether a side may be extended by a segment: it lies outside the explored region, and neither
 * it nor the gap to it crosses the contour. */
static int is_open(const cairn_grouping *grouping, int32_t s, int32_t from, int32_t joined)
{
    const struct grouping_written *w = grouping->written;
    cairn_segment bridge = {grouping_written_end(grouping, from),
                            grouping_written_end(grouping, joined)},
                  line = {bridge.b, grouping_written_end(grouping, joined ^ 1)};
    cairn_vec2 middle = cairn_vec2_scale(cairn_vec2_add(line.a, line.b), CAIRN_REAL(0.5));

    return !cairn_polygon_contains(w->polygon, w->polygon_count, middle) &&
           !crosses_side(&w->side[s], line, 4) && !crosses_side(&w->side[s], bridge, 4) &&
           !crosses_side(&w->side[1 - s], line, 0) && !crosses_side(&w->side[1 - s], bridge, 0);
}

/* Puts an extension into the list, the nearest first; of one segment only that from its nearer
 * end. */
static void insert(written_extension *list, int32_t *count, written_extension e)
{
    int32_t at = 0;

    while (at < *count && list[at].open / 2 != e.open / 2)
        at++;
    if (at < *count && list[at].gap <= e.gap)
        return;
    if (at == *count) {
        if (*count == WRITTEN_CHOICE && list[*count - 1].gap <= e.gap)
            return;
        at = *count < WRITTEN_CHOICE ? (*count)++ : *count - 1;
    }
    for (; at > 0 && list[at - 1].gap > e.gap; at--)
        list[at] = list[at - 1];
    list[at] = e;
}

/* What side s may be extended by, within the circle about its open end: list[WRITTEN_CHOICE];
 * their number. */
static int32_t find_extensions(const cairn_grouping *grouping, const grouping_written_state *before,
                               int32_t s, written_extension *list)
{
    const struct grouping_written *w = grouping->written;
    cairn_vec2 open = grouping_written_end(grouping, before->end[s]);
    cairn_point_grid_cursor near =
        cairn_point_grid_begin(w->ends, open, grouping->input.look_ahead);
    int32_t count = 0;

    for (int32_t e = cairn_point_grid_next(w->ends, &near); e >= 0;
         e = cairn_point_grid_next(w->ends, &near)) {
        written_extension x = {
            cairn_vec2_norm(cairn_vec2_sub(grouping_written_end(grouping, e), open)), e ^ 1};

        if (w->stamp[e / 2] == w->look || (count == WRITTEN_CHOICE && x.gap >= list[count - 1].gap))
            continue;
        if (is_open(grouping, s, before->end[s], e))
            insert(list, &count, x);
    }
    return count;
}

/* Whether the step of the skeleton to a point crosses the contour or the skeleton. */
static int crosses_past(const cairn_grouping *grouping, const grouping_written_state *before,
                        cairn_vec2 centre)
{
    const struct grouping_written *w = grouping->written;
    cairn_segment step = {before->centre, centre};

    if (crosses_side(&w->side[0], step, 0) || crosses_side(&w->side[1], step, 0))
        return 1;
    for (int32_t i = 0; i + 2 < w->past_count; i++) {
        cairn_segment piece = {w->past[i]->centre, w->past[i + 1]->centre};

        if (cairn_segments_cross(piece, step))
            return 1;
    }
    return 0;
}

/* Whether the extensions of both sides cross each other. */
static int cross_each_other(const cairn_grouping *grouping, const grouping_written_state *before,
                            const written_extension *left, const written_extension *right)
{
    cairn_segment line[2][2];
    const written_extension *e[2] = {left, right};

    for (int32_t s = 0; s < 2; s++) {
        line[s][0].a = grouping_written_end(grouping, before->end[s]);
        line[s][0].b = line[s][1].a = grouping_written_end(grouping, e[s]->open ^ 1);
        line[s][1].b = grouping_written_end(grouping, e[s]->open);
    }
    for (int32_t i = 0; i < 4; i++)
        if (cairn_segments_cross(line[0][i / 2], line[1][i % 2]))
            return 1;
    return 0;
}

/* (2.11) */
static cairn_real log_mass(const cairn_grouping *grouping, const grouping_written_state *before,
                           const grouping_written_state *s, cairn_real gap)
{
    cairn_real loss = cairn_max(s->deviation - before->deviation, 0);
    cairn_real mass = -cairn_half_square(gap / grouping->input.mean_length);

    return grouping->params.use_skeleton
               ? mass - cairn_half_square(loss / grouping->params.symmetry)
               : mass;
}

/* Offers the pair of two extensions, unless it is culled. */
static cairn_status offer(cairn_grouping *grouping, cairn_particle_filter *filter,
                          const grouping_written_state *before, const written_extension *left,
                          const written_extension *right)
{
    const cairn_symmetric_point *p =
        cairn_grouping_written_point(grouping, left->open / 2, right->open / 2);
    grouping_written_state next = *before;
    cairn_status status;

    if (p == NULL || crosses_past(grouping, before, p->centre) ||
        cross_each_other(grouping, before, left, right))
        return CAIRN_OK;
    next.centre = p->centre;
    next.radius = p->radius;
    next.deviation = p->deviation;
    next.end[0] = left->open;
    next.end[1] = right->open;
    next.segment[0] = left->open / 2;
    next.segment[1] = right->open / 2;
    status = cairn_particle_filter_offer(
        filter, &next,
        log_mass(grouping, before, &next, CAIRN_REAL(0.5) * (left->gap + right->gap)));
    return status == CAIRN_FULL ? CAIRN_OK : status;
}

/* Ends of segments in the look-ahead circle of a side. */
static int32_t ends_ahead(const cairn_grouping *grouping, const grouping_written_state *before,
                          int32_t s)
{
    cairn_vec2 open = grouping_written_end(grouping, before->end[s]);
    cairn_point_grid_cursor near =
        cairn_point_grid_begin(grouping->written->ends, open, grouping->input.look_ahead);
    int32_t count = 0;

    while (cairn_point_grid_next(grouping->written->ends, &near) >= 0)
        count++;
    return count;
}

/* Units of a proposal. */
static int32_t cost_of_proposal(const cairn_grouping *grouping,
                                const grouping_written_state *before, int32_t steps)
{
    int32_t left = ends_ahead(grouping, before, 0), right = ends_ahead(grouping, before, 1);
    int32_t pairs = (left < WRITTEN_CHOICE ? left : WRITTEN_CHOICE) *
                    (right < WRITTEN_CHOICE ? right : WRITTEN_CHOICE);
    int64_t units = UNITS_A_PROPOSAL + UNITS_A_STEP * steps + pairs * (1 + steps / STEPS_A_PAIR) +
                    ((int64_t)left + right) * (1 + steps / STEPS_AN_END);

    return units < INT32_MAX ? (int32_t)units : INT32_MAX;
}

static cairn_status propose(void *context, cairn_particle_filter *filter, int32_t index,
                            cairn_budget *budget)
{
    cairn_grouping *grouping = context;
    cairn_particle particle = cairn_particle_filter_particle(filter, index);
    const grouping_written_state *before = particle.state;
    written_extension list[2][WRITTEN_CHOICE];
    int32_t count[2];

    if (grouping->charged_callback_units == 0)
        grouping->written->cost = cost_of_proposal(grouping, before, particle.steps);
    if (!cairn_budget_pay(budget, &grouping->charged_callback_units, grouping->written->cost))
        return CAIRN_MORE;
    read_past(grouping, before, particle.steps + 1);
    for (int32_t s = 0; s < 2; s++)
        count[s] = find_extensions(grouping, before, s, list[s]);
    for (int32_t i = 0; i < count[0]; i++)
        for (int32_t j = 0; j < count[1]; j++) {
            cairn_status status = CAIRN_OK;

            if (list[0][i].open / 2 != list[1][j].open / 2)
                status = offer(grouping, filter, before, &list[0][i], &list[1][j]);
            if (status != CAIRN_OK)
                return status;
        }
    return CAIRN_OK;
}

static cairn_status likelihood(void *context, const cairn_particle_filter *filter, int32_t index,
                               const void *state, cairn_real *log_likelihood, cairn_budget *budget)
{
    cairn_grouping *grouping = context;
    int32_t sample;

    (void)filter;
    (void)index;
    /* append() computes it once more. */
    if (!cairn_budget_pay(budget, &grouping->charged_callback_units,
                          2 * cairn_grouping_written_likelihood_units(grouping)))
        return CAIRN_MORE;
    *log_likelihood = cairn_grouping_written_likelihood(grouping, state, &sample);
    return CAIRN_OK;
}

static void append(void *context, const cairn_particle_filter *filter, int32_t index, void *state)
{
    const cairn_grouping *grouping = context;
    grouping_written_state *s = state;

    (void)filter;
    (void)index;
    s->log_posterior +=
        cairn_grouping_written_likelihood(grouping, s, &s->sample) - grouping->written->log_stop;
}

cairn_particle_model cairn_grouping_written_model(cairn_grouping *grouping)
{
    cairn_particle_model model = {grouping, propose, likelihood, append, NULL};

    return model;
}
