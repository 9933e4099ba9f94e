/* Callbacks of the particle filter in the mode as written.
 *
 * Method:
 * 1. Proposal: a particle looks ahead around the open ends of both sides (2.4.2). Segments with an
 *    end within L of the open one, outside the region that its contour encloses, are paired; one of
 *    the sides may keep its segment. Pairs are rejected when they cross each other or the contour
 *    but the last two segments of their own side, when the step of the skeleton crosses the contour
 *    or the skeleton, or when they have no symmetric point within the model's radii outside that
 *    region. Masses: gaps and loss of symmetry (2.11).
 * 2. Likelihood: displacement and radius (2.12, 2.13), which the proposal does not use, times the
 *    mass, by which followers are drawn, too (contour_grouping.h). The past of a particle is read
 *    from its history.
 *
 * Source: Adluru 2008, sections 2.3 to 2.5. */
#include "src/base/build.h"

#include "src/containers/ranked_list.h"
#include "src/outlines/contour_grouping_written.h"

/* Work units of a proposal and of a step of its history; history steps that one unit covers in the
 * checks of an end in a look-ahead circle, and of a pair. */
enum {
    UNITS_PER_PROPOSAL = 60,
    UNITS_PER_STEP = 12,
    STEPS_PER_END_UNIT = 1,
    STEPS_PER_PAIR_UNIT = 2
};

/* Unit of differences of lengths in the dissimilarity of displacements, share of the size. */
#define LENGTH_UNIT CAIRN_REAL(0.3)

/* ---- The model ---- */

/* Unnormalized Gaussian N(x; 0, sigma), 1 at 0. */
static cairn_real gaussian(cairn_real x, cairn_real sigma)
{
    return cairn_exp(-cairn_half_square(x / sigma));
}

/* Sample k of the longest path, counted from its first or from its last sample. */
static const cairn_shape_model_sample *sample_of(const cairn_shape_model *model,
                                                 int32_t is_reversed, int32_t k)
{
    const cairn_shape_model_path *path = &model->paths[0];

    return &model->samples[path->first + (is_reversed ? path->count - 1 - k : k)];
}

/* D_k of the longest path, counted from its first or from its last sample. */
static cairn_vec2 displacement_of(const cairn_shape_model *model, int32_t is_reversed, int32_t k)
{
    int32_t last = model->paths[0].count - 1;

    if (!is_reversed)
        return cairn_shape_model_displacement(model, 0, k);
    return cairn_vec2_sub(cairn_shape_model_displacement(model, 0, last - k),
                          cairn_shape_model_displacement(model, 0, last));
}

/* Dissimilarity ds of (2.12) of two displacements, in sizes: the angle between them, rad, plus the
 * difference of their lengths in LENGTH_UNIT. */
static cairn_real dissimilarity(cairn_vec2 model, cairn_vec2 displacement)
{
    cairn_real angle = cairn_abs(cairn_vec2_angle(model, displacement));

    return angle + cairn_abs(cairn_vec2_norm(displacement) - cairn_vec2_norm(model)) / LENGTH_UNIT;
}

cairn_real cairn_contour_grouping_written_likelihood(const cairn_contour_grouping *grouping,
                                                     const contour_grouping_written_state *state,
                                                     int32_t *sample)
{
    const struct contour_grouping_written *written = grouping->written;
    const cairn_shape_model *model = grouping->input.model;
    cairn_vec2 displacement =
        cairn_vec2_scale(cairn_vec2_sub(state->centre, state->start), 1 / written->size);
    cairn_real smallest = CAIRN_REAL_MAX, radius_error;
    int32_t is_first = displacement.x == 0 && displacement.y == 0,
            first_sample = is_first || model->paths[0].count == 1 ? 0 : 1;

    /* D_1 = 0 has no direction, so only the first point is compared with it. */
    *sample = first_sample;
    for (int32_t k = first_sample; k < model->paths[0].count; k++) {
        cairn_real d = dissimilarity(displacement_of(model, state->is_reversed, k), displacement);

        if (d < smallest) {
            smallest = d;
            *sample = k;
        }
    }
    if (contour_grouping_written_is(&grouping->params, CAIRN_CONTOUR_GROUPING_WRITTEN_NO_MODEL))
        return 0;
    radius_error =
        (state->radius / written->size - sample_of(model, state->is_reversed, *sample)->radius) /
        written->mean_radius;
    return cairn_log(CAIRN_REAL(0.5) * gaussian(smallest, grouping->params.path_sigma) +
                     CAIRN_REAL(0.5) * gaussian(radius_error, grouping->params.radius_sigma));
}

int32_t cairn_contour_grouping_written_likelihood_units(const cairn_contour_grouping *grouping)
{
    return 1 + grouping->input.model->paths[0].count;
}

/* ---- History of a particle ---- */

static void add_side(const cairn_contour_grouping *grouping, contour_grouping_written_side *side,
                     int32_t open)
{
    side->vertex[side->vertex_count++] = contour_grouping_written_end(grouping, open ^ 1);
    side->vertex[side->vertex_count++] = contour_grouping_written_end(grouping, open);
}

/* Reads the history up to a state: the states, both sides, and the explored region between them. */
static void read_history(cairn_contour_grouping *grouping,
                         const contour_grouping_written_state *last, int32_t count)
{
    struct contour_grouping_written *written = grouping->written;

    written->history_count = count;
    written->stamp++;
    for (int32_t i = count - 1; i >= 0; i--) {
        written->history[i] = last;
        written->segment_stamp[last->segment[0]] = written->segment_stamp[last->segment[1]] =
            written->stamp;
        last = cairn_particle_filter_state_before(last);
    }
    written->polygon_count = 0;
    for (int32_t s = 0; s < 2; s++) {
        written->side[s].vertex_count = 0;
        for (int32_t i = 0; i < count; i++)
            if (i == 0 || written->history[i]->segment[s] != written->history[i - 1]->segment[s])
                add_side(grouping, &written->side[s], written->history[i]->end[s]);
    }
    for (int32_t i = 0; i < written->side[0].vertex_count; i++)
        written->polygon[written->polygon_count++] = written->side[0].vertex[i];
    for (int32_t i = written->side[1].vertex_count - 1; i >= 0; i--)
        written->polygon[written->polygon_count++] = written->side[1].vertex[i];
}

/* Returns 1 when a line crosses a side of the contour, not counting its last `excluded`
 * vertices. */
static int crosses_side(const contour_grouping_written_side *side, cairn_segment line,
                        int32_t excluded)
{
    for (int32_t i = 0; i + 1 < side->vertex_count - excluded; i++) {
        cairn_segment piece = {side->vertex[i], side->vertex[i + 1]};

        if (cairn_segments_intersect(piece, line))
            return 1;
    }
    return 0;
}

/* ---- Extensions ---- */

/* Returns 1 when a side may be extended by a segment: it lies outside the explored region, and
 * neither it nor the gap crosses the contour. */
static int is_feasible_extension(const cairn_contour_grouping *grouping, int32_t s, int32_t from,
                                 int32_t joined)
{
    const struct contour_grouping_written *written = grouping->written;
    cairn_segment bridge = {contour_grouping_written_end(grouping, from),
                            contour_grouping_written_end(grouping, joined)},
                  line = {bridge.b, contour_grouping_written_end(grouping, joined ^ 1)};
    cairn_vec2 middle = cairn_vec2_scale(cairn_vec2_add(line.a, line.b), CAIRN_REAL(0.5));

    return !cairn_polygon_contains(written->polygon, written->polygon_count, middle) &&
           !crosses_side(&written->side[s], line, 4) &&
           !crosses_side(&written->side[s], bridge, 4) &&
           !crosses_side(&written->side[1 - s], line, 0) &&
           !crosses_side(&written->side[1 - s], bridge, 0);
}

/* Of each segment only the nearer end is kept. */
static int is_of_same_segment(const void *context, const void *entry, const void *other)
{
    const contour_grouping_written_extension *a = entry, *b = other;

    (void)context;
    return a->open_end / 2 == b->open_end / 2;
}

/* Finds the extensions of side s within the look-ahead circle around its open end, the kept segment
 * last: list[CONTOUR_GROUPING_WRITTEN_MAX_EXTENSIONS + 1]. Returns their number. */
static int32_t find_extensions(const cairn_contour_grouping *grouping,
                               const contour_grouping_written_state *previous, int32_t s,
                               contour_grouping_written_extension *list)
{
    const struct contour_grouping_written *written = grouping->written;
    cairn_vec2 open = contour_grouping_written_end(grouping, previous->end[s]);
    cairn_point_grid_cursor search =
        cairn_point_grid_begin(written->ends, open, grouping->input.look_ahead);
    int32_t count = 0;
    ranked_list extensions = {.entries = list,
                              .count = &count,
                              .capacity = CONTOUR_GROUPING_WRITTEN_MAX_EXTENSIONS,
                              .entry_bytes = sizeof *list,
                              .score_at = offsetof(contour_grouping_written_extension, gap),
                              .least_first = 1,
                              .is_near = is_of_same_segment};

    for (int32_t e = cairn_point_grid_next(written->ends, &search); e >= 0;
         e = cairn_point_grid_next(written->ends, &search)) {
        contour_grouping_written_extension x = {
            cairn_vec2_norm(cairn_vec2_sub(contour_grouping_written_end(grouping, e), open)), e ^ 1,
            0};

        if (written->segment_stamp[e / 2] == written->stamp ||
            (count == CONTOUR_GROUPING_WRITTEN_MAX_EXTENSIONS && x.gap >= list[count - 1].gap))
            continue;
        if (is_feasible_extension(grouping, s, previous->end[s], e))
            (void)ranked_list_insert(&extensions, &x);
    }
    list[count].gap = 0;
    list[count].open_end = previous->end[s];
    list[count++].is_kept = 1;
    return count;
}

/* Returns 1 when the skeleton's step to a point crosses the contour or the skeleton. */
static int crosses_history(const cairn_contour_grouping *grouping,
                           const contour_grouping_written_state *previous, cairn_vec2 centre)
{
    const struct contour_grouping_written *written = grouping->written;
    cairn_segment step = {previous->centre, centre};

    if (crosses_side(&written->side[0], step, 0) || crosses_side(&written->side[1], step, 0))
        return 1;
    for (int32_t i = 0; i + 2 < written->history_count; i++) {
        cairn_segment piece = {written->history[i]->centre, written->history[i + 1]->centre};

        if (cairn_segments_intersect(piece, step))
            return 1;
    }
    return 0;
}

/* Returns 1 when the extensions of both sides cross each other. */
static int cross_each_other(const cairn_contour_grouping *grouping,
                            const contour_grouping_written_state *previous,
                            const contour_grouping_written_extension *left,
                            const contour_grouping_written_extension *right)
{
    cairn_segment line[2][2];
    const contour_grouping_written_extension *e[2] = {left, right};

    if (left->is_kept || right->is_kept)
        return 0;
    for (int32_t s = 0; s < 2; s++) {
        line[s][0].a = contour_grouping_written_end(grouping, previous->end[s]);
        line[s][0].b = line[s][1].a = contour_grouping_written_end(grouping, e[s]->open_end ^ 1);
        line[s][1].b = contour_grouping_written_end(grouping, e[s]->open_end);
    }
    for (int32_t i = 0; i < 4; i++)
        if (cairn_segments_intersect(line[0][i / 2], line[1][i % 2]))
            return 1;
    return 0;
}

/* Log mass of the proposal (2.11). A step that extends only one side counts as no further step: its
 * mass is multiplied by stop_likelihood. */
static cairn_real log_mass(const cairn_contour_grouping *grouping,
                           const contour_grouping_written_state *previous,
                           const contour_grouping_written_state *s,
                           const contour_grouping_written_extension *left,
                           const contour_grouping_written_extension *right)
{
    cairn_real loss = cairn_max(s->deviation - previous->deviation, 0);
    cairn_real gap = CAIRN_REAL(0.5) * (left->gap + right->gap);
    cairn_real mass = -cairn_half_square(gap / grouping->input.mean_length);

    if (left->is_kept || right->is_kept)
        mass += grouping->written->log_stop;

    return mass - cairn_half_square(loss / grouping->params.symmetry_sigma);
}

/* Offers the pair of two extensions as a candidate state, unless it is rejected. */
static cairn_status offer(cairn_contour_grouping *grouping, cairn_particle_filter *filter,
                          const contour_grouping_written_state *previous,
                          const contour_grouping_written_extension *left,
                          const contour_grouping_written_extension *right)
{
    const cairn_symmetric_point *point =
        cairn_contour_grouping_written_point(grouping, left->open_end / 2, right->open_end / 2);
    contour_grouping_written_state next = *previous;
    cairn_status status;

    if (point == NULL ||
        cairn_polygon_contains(grouping->written->polygon, grouping->written->polygon_count,
                               point->centre) ||
        crosses_history(grouping, previous, point->centre) ||
        cross_each_other(grouping, previous, left, right))
        return CAIRN_OK;
    next.centre = point->centre;
    next.radius = point->radius;
    next.deviation = point->deviation;
    next.end[0] = left->open_end;
    next.end[1] = right->open_end;
    next.segment[0] = left->open_end / 2;
    next.segment[1] = right->open_end / 2;
    next.log_mass = log_mass(grouping, previous, &next, left, right);
    status = cairn_particle_filter_offer(filter, &next, next.log_mass);
    if (status != CAIRN_FULL)
        return status;
    grouping->written->dropped_candidates++;
    return CAIRN_OK;
}

/* Number of segment ends in the look-ahead circle of a side. */
static int32_t count_ends_ahead(const cairn_contour_grouping *grouping,
                                const contour_grouping_written_state *previous, int32_t s)
{
    cairn_vec2 open = contour_grouping_written_end(grouping, previous->end[s]);
    cairn_point_grid_cursor search =
        cairn_point_grid_begin(grouping->written->ends, open, grouping->input.look_ahead);
    int32_t count = 0;

    while (cairn_point_grid_next(grouping->written->ends, &search) >= 0)
        count++;
    return count;
}

/* Work units of a proposal. */
static int32_t proposal_units(const cairn_contour_grouping *grouping,
                              const contour_grouping_written_state *previous, int32_t steps)
{
    int32_t left = count_ends_ahead(grouping, previous, 0),
            right = count_ends_ahead(grouping, previous, 1);
    int32_t pairs = (1 + (left < CONTOUR_GROUPING_WRITTEN_MAX_EXTENSIONS
                              ? left
                              : CONTOUR_GROUPING_WRITTEN_MAX_EXTENSIONS)) *
                    (1 + (right < CONTOUR_GROUPING_WRITTEN_MAX_EXTENSIONS
                              ? right
                              : CONTOUR_GROUPING_WRITTEN_MAX_EXTENSIONS));
    int64_t units = UNITS_PER_PROPOSAL + UNITS_PER_STEP * steps +
                    pairs * (1 + steps / STEPS_PER_PAIR_UNIT) +
                    ((int64_t)left + right) * (1 + steps / STEPS_PER_END_UNIT);

    return units < INT32_MAX ? (int32_t)units : INT32_MAX;
}

static cairn_status propose(void *context, cairn_particle_filter *filter, int32_t index,
                            cairn_budget *budget)
{
    cairn_contour_grouping *grouping = context;
    cairn_particle particle = cairn_particle_filter_particle(filter, index);
    const contour_grouping_written_state *previous = particle.state;
    contour_grouping_written_extension list[2][CONTOUR_GROUPING_WRITTEN_MAX_EXTENSIONS + 1];
    int32_t count[2];

    if (grouping->callback_units_charged == 0)
        grouping->written->proposal_units = proposal_units(grouping, previous, particle.steps);
    if (!cairn_budget_charge(budget, &grouping->callback_units_charged,
                             grouping->written->proposal_units))
        return CAIRN_MORE;
    read_history(grouping, previous, particle.steps + 1);
    for (int32_t s = 0; s < 2; s++)
        count[s] = find_extensions(grouping, previous, s, list[s]);
    for (int32_t i = 0; i < count[0]; i++)
        for (int32_t j = 0; j < count[1]; j++) {
            cairn_status status = CAIRN_OK;

            if (list[0][i].open_end / 2 != list[1][j].open_end / 2 &&
                !(list[0][i].is_kept && list[1][j].is_kept))
                status = offer(grouping, filter, previous, &list[0][i], &list[1][j]);
            if (status != CAIRN_OK)
                return status;
        }
    return CAIRN_OK;
}

static cairn_status likelihood(void *context, const cairn_particle_filter *filter, int32_t index,
                               const void *state, cairn_real *log_likelihood, cairn_budget *budget)
{
    cairn_contour_grouping *grouping = context;
    const contour_grouping_written_state *s = state;
    int32_t sample;

    (void)filter;
    (void)index;
    /* append() evaluates it once more, hence the factor 2. */
    if (!cairn_budget_charge(budget, &grouping->callback_units_charged,
                             2 * cairn_contour_grouping_written_likelihood_units(grouping)))
        return CAIRN_MORE;
    *log_likelihood = cairn_contour_grouping_written_likelihood(grouping, s, &sample);
    if (!contour_grouping_written_is(&grouping->params, CAIRN_CONTOUR_GROUPING_WRITTEN_LETTER))
        *log_likelihood += s->log_mass;
    return CAIRN_OK;
}

static void append(void *context, const cairn_particle_filter *filter, int32_t index, void *state)
{
    const cairn_contour_grouping *grouping = context;
    contour_grouping_written_state *s = state;

    (void)filter;
    (void)index;
    s->log_posterior += s->log_mass +
                        cairn_contour_grouping_written_likelihood(grouping, s, &s->sample) -
                        grouping->written->log_stop;
}

cairn_particle_filter_model cairn_contour_grouping_written_model(cairn_contour_grouping *grouping)
{
    cairn_particle_filter_model model = {
        .context = grouping, .propose = propose, .likelihood = likelihood, .append = append};

    return model;
}
