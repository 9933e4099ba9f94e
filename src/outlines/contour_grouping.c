/* Contour grouping: pose hypotheses from pairs of edge segments, matching of the model's outline by
 * dynamic programming, and a particle filter between them, whose weights hardly matter
 * (docs/lab/group.md). As written: the filter alone (contour_grouping_written.c).
 *
 * Method:
 * 1. Segments are cut into tokens, which are sorted into a grid (contour_grouping_token.c).
 * 2. Hypothesis generation (contour_grouping_hypothesis.c): pairs of tokens that match the two
 *    sides of any model sample give poses of any size within the range. An object with both ends
 *    occluded can be found.
 * 3. The hypotheses are refined against the outline (contour_grouping_object.c).
 * 4. A particle filter (contour_grouping_filter.c) starts from them. Its particles track one object
 *    or several.
 * 5. The final pose of every particle is refined, and non-maximum suppression gives the objects
 *    (contour_grouping_object.c).
 *
 * Memory layout: tokens in cells, the edge-orientation map, hypotheses, the filter with the last
 * two states of each trajectory, the segments found.
 *
 * Limits: objects of one image closer to each other than a third of their size are merged. A
 * segment whose own pieces are symmetric is handled as separate tokens; a segment shorter than a
 * token is not cut.
 *
 * Source: Adluru 2008, chapter 2. This project's additions: the similarity transform in place of
 * the displacement from the start, the search over sizes, and starts within the path. */
#include "src/base/build.h"

#include <string.h>

#include "src/outlines/contour_grouping_written.h"

#define INTEGER(field, ...)  CAIRN_INTEGER(cairn_contour_grouping_params, field, __VA_ARGS__)
#define NUMBER(field, ...)   CAIRN_NUMBER(cairn_contour_grouping_params, field, __VA_ARGS__)
#define POSITIVE(field, ...) CAIRN_NUMBER_ABOVE(cairn_contour_grouping_params, field, __VA_ARGS__)

/* Default, lowest and highest value; the mode is the first. */
static const cairn_parameter rows[] = {
    INTEGER(mode, CAIRN_MODE_DEFAULT, CAIRN_MODE_DEFAULT, CAIRN_MODE_AS_WRITTEN),
    INTEGER(max_width, 1024, 1, 8192),
    INTEGER(max_height, 1024, 1, 8192),
    INTEGER(max_tokens, 8192, 1, 1 << 20),
    INTEGER(max_samples, 64, 1, 1024),
    INTEGER(max_outline, 512, 1, 4096),
    INTEGER(particles, 300, 1, 4096),
    INTEGER(max_objects, 8, 1, 64),
    POSITIVE(token_length, 10, 0, CAIRN_REAL_MAX),
    POSITIVE(deform_sigma, CAIRN_REAL(0.025), 0, CAIRN_REAL_MAX),
    POSITIVE(turn_sigma, 15 * (CAIRN_PI / 180), 0, CAIRN_REAL_MAX),
    POSITIVE(symmetry_sigma, 45 * (CAIRN_PI / 180), 0, CAIRN_REAL_MAX),
    POSITIVE(missing_likelihood, CAIRN_REAL(0.3), 0, 1),
    POSITIVE(stop_likelihood, CAIRN_REAL(0.3), 0, 1),
    NUMBER(min_score, CAIRN_REAL(0.2), 0, 1),
    NUMBER(min_evidence, 13, 0, CAIRN_REAL_MAX),
    INTEGER(max_points, 65536, 1, 1 << 22),
    INTEGER(max_steps, 128, 2, 1024),
    POSITIVE(path_sigma, CAIRN_REAL(0.7), 0, CAIRN_REAL_MAX),
    POSITIVE(radius_sigma, CAIRN_REAL(0.2), 0, CAIRN_REAL_MAX),
};
const cairn_parameters cairn_contour_grouping_parameters =
    CAIRN_PARAMETERS("contour_grouping", cairn_contour_grouping_params, rows);

/* The same without the mode, which a variant of it has. */
static const cairn_parameters variant_parameters =
    CAIRN_PARAMETERS_FROM("contour_grouping", cairn_contour_grouping_params, rows, 1);

cairn_contour_grouping_params cairn_contour_grouping_default(void)
{
    cairn_contour_grouping_params params;

    cairn_parameters_preset(&cairn_contour_grouping_parameters, &params);
    params.seed = 1;
    return params;
}

cairn_contour_grouping_params cairn_contour_grouping_as_written(void)
{
    cairn_contour_grouping_params params = cairn_contour_grouping_default();

    params.mode = CAIRN_MODE_AS_WRITTEN;
    params.stop_likelihood = CAIRN_REAL(0.5);
    return params;
}

cairn_status cairn_contour_grouping_check(const cairn_contour_grouping_params *params,
                                          cairn_object_fault *fault)
{
    return cairn_parameters_check(params != NULL && contour_grouping_is_variant(params->mode)
                                      ? &variant_parameters
                                      : &cairn_contour_grouping_parameters,
                                  params, fault);
}

static cairn_particle_filter_params filter_params(const cairn_contour_grouping_params *params)
{
    cairn_particle_filter_params settings = cairn_particle_filter_default();

    settings.particles = settings.max_particles = params->particles;
    settings.max_followers = CONTOUR_GROUPING_MAX_FOLLOWERS;
    settings.max_candidates = params->particles * CONTOUR_GROUPING_MAX_CANDIDATES;
    /* The sums of the state summarize the trajectory. */
    settings.max_history = 1;
    settings.max_blocks = 3 * params->particles;
    settings.state_bytes = (int32_t)sizeof(contour_grouping_state);
    return settings;
}

/* The arrays of the default mode. */
static void take_default(cairn_contour_grouping *grouping, cairn_pool *pool,
                         const cairn_contour_grouping_params *params)
{
    cell_grid grid = cell_grid_of(params->max_width, params->max_height,
                                  CONTOUR_GROUPING_TOKEN_CELL_PX),
              edge_grid = cell_grid_of(params->max_width, params->max_height,
                                       CONTOUR_GROUPING_EDGE_CELL_PX);
    size_t outline = (size_t)params->max_outline, objects = (size_t)params->max_objects;
    cairn_particle_filter_params filter = filter_params(params);
    cairn_particle_filter_model model = cairn_contour_grouping_filter_model(grouping);

    CAIRN_TAKE(grouping, pool, tokens, params->max_tokens);
    CAIRN_TAKE(grouping, pool, sorted_tokens, params->max_tokens);
    CAIRN_TAKE(grouping, pool, cell_start, cell_grid_count(&grid) + 1);
    CAIRN_TAKE(grouping, pool, edge_map, cell_grid_count(&edge_grid));
    CAIRN_TAKE(grouping, pool, hypotheses, params->particles);
    CAIRN_TAKE(grouping, pool, trace, params->max_samples);
    CAIRN_TAKE(grouping, pool, segments, objects * outline);
    CAIRN_TAKE(grouping, pool, objects, objects);
    CAIRN_TAKE(grouping, pool, along, objects * outline);
    CAIRN_TAKE(grouping, pool, outline.match, outline);
    CAIRN_TAKE(grouping, pool, outline.cost, outline);
    CAIRN_TAKE(grouping, pool, outline.shift, outline);
    CAIRN_TAKE(grouping, pool, outline.next_shift, outline);
    CAIRN_TAKE(grouping, pool, outline.match_distance, outline);
    CAIRN_TAKE(grouping, pool, outline.curvature, outline);
    CAIRN_TAKE(grouping, pool, outline.nodes, outline * CONTOUR_GROUPING_MAX_NODES);
    CAIRN_TAKE_BY(grouping, cairn_particle_filter_create(CAIRN_FIELD(grouping, filter), pool,
                                                         &filter, &model));
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_contour_grouping *build(cairn_pool *pool, const cairn_contour_grouping_params *params)
{
    cairn_contour_grouping *grouping = cairn_object_take(pool, sizeof *grouping);

    if (params->mode < CAIRN_MODE_AS_WRITTEN)
        take_default(grouping, pool, params);
    else
        cairn_contour_grouping_take_written(grouping, pool, params);
    if (grouping != NULL)
        grouping->params = *params;
    return grouping;
}

CAIRN_OBJECT(contour_grouping, contour_grouping, build);

static cairn_status check_input(const cairn_contour_grouping *grouping,
                                const cairn_contour_grouping_input *input)
{
    if (input->count < 0 || (input->segments == NULL && input->count > 0) || input->width < 1 ||
        input->height < 1 || cairn_shape_model_check(input->model, NULL) != CAIRN_OK)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_is_finite(input->max_size) || !cairn_is_finite(input->mean_length) ||
        !cairn_is_finite(input->min_turn) || !cairn_is_finite(input->max_turn))
        return CAIRN_NOT_FINITE;
    if (!(input->min_size > 0) || !(input->max_size >= input->min_size) ||
        !(input->mean_length > 0) || !(input->min_turn >= -CAIRN_PI) ||
        !(input->max_turn <= CAIRN_PI) || !(input->max_turn >= input->min_turn))
        return CAIRN_BAD_ARGUMENT;
    if (input->width > grouping->params.max_width || input->height > grouping->params.max_height ||
        input->model->sample_count > grouping->params.max_samples ||
        input->model->outline_count > grouping->params.max_outline)
        return CAIRN_FULL;
    return grouping->written != NULL ? cairn_contour_grouping_written_check(grouping, input)
                                     : CAIRN_OK;
}

cairn_status cairn_contour_grouping_begin(cairn_contour_grouping *grouping,
                                          const cairn_contour_grouping_input *input)
{
    cairn_status status;
    cairn_real widest = 0, half, middle;

    if (grouping == NULL || input == NULL)
        return CAIRN_BAD_ARGUMENT;
    status = check_input(grouping, input);
    if (status != CAIRN_OK)
        return status;
    grouping->input = *input;
    grouping->grid = cell_grid_of(input->width, input->height, CONTOUR_GROUPING_TOKEN_CELL_PX);
    grouping->edge_grid = cell_grid_of(input->width, input->height, CONTOUR_GROUPING_EDGE_CELL_PX);
    middle = CAIRN_REAL(0.5) * (input->min_turn + input->max_turn);
    half = CAIRN_REAL(0.5) * (input->max_turn - input->min_turn);
    cairn_sincos(middle, &grouping->limits.middle_rotation.y, &grouping->limits.middle_rotation.x);
    grouping->limits.min_rotation_cosine = cairn_cos(half);
    for (int32_t i = 0; i < input->model->sample_count; i++) {
        const cairn_shape_model_sample *s = &input->model->samples[i];

        widest = cairn_max(widest, cairn_vec2_norm(cairn_vec2_sub(s->contact[1].position,
                                                                  s->contact[0].position)));
    }
    grouping->limits.max_chord = widest * input->max_size + 1;
    grouping->pieces.count = grouping->pieces.cut = grouping->token_count =
        grouping->found.hypothesis_count = grouping->found.object_count =
            grouping->found.segment_count = grouping->found.step_count =
                grouping->found.generated_count = 0;
    grouping->found.best_score = grouping->found.best_evidence = 0;
    grouping->pieces.length = 0;
    grouping->has_particles = 0;
    grouping->status = CAIRN_OK;
    grouping->resume = grouping->phase_resume = grouping->refine_resume = grouping->match_resume =
        0;
    grouping->units_charged = grouping->callback_units_charged = 0;
    grouping->is_pending = 1;
    grouping->is_complete = 0;
    if (grouping->written != NULL) {
        cairn_contour_grouping_written_begin(grouping);
        return CAIRN_OK;
    }
    cairn_contour_grouping_begin_hypotheses(grouping);
    cairn_contour_grouping_begin_outline(grouping);
    return CAIRN_OK;
}

/* The search in the default mode: see Method in the head of this file. */
static int search(cairn_contour_grouping *grouping, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(grouping->resume);
    CAIRN_STEP_RUN(grouping, resume, budget, cairn_contour_grouping_make_tokens);
    cairn_contour_grouping_set_clutter_cost(grouping);
    CAIRN_STEP_RUN(grouping, resume, budget, cairn_contour_grouping_generate_hypotheses);
    CAIRN_STEP_RUN(grouping, resume, budget, cairn_contour_grouping_refine_hypotheses);
    CAIRN_STEP_RUN(grouping, resume, budget, cairn_contour_grouping_run_filter);
    CAIRN_STEP_RUN(grouping, resume, budget, cairn_contour_grouping_refine_particles);
    CAIRN_STEP_RUN(grouping, resume, budget, cairn_contour_grouping_select_objects);
    CAIRN_STEP_END(grouping->resume);
}

cairn_status cairn_contour_grouping_step(cairn_contour_grouping *grouping, cairn_budget *budget)
{
    int is_done;

    if (grouping == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!grouping->is_pending)
        return CAIRN_OK;
    is_done = grouping->written != NULL ? cairn_contour_grouping_search_written(grouping, budget)
                                        : search(grouping, budget);
    if (!is_done && grouping->status >= CAIRN_OK)
        return CAIRN_MORE;
    grouping->is_pending = 0;
    grouping->is_complete = is_done;
    return is_done ? CAIRN_OK : grouping->status;
}

cairn_contour_grouping_result cairn_contour_grouping_read(const cairn_contour_grouping *grouping)
{
    cairn_contour_grouping_result result;

    memset(&result, 0, sizeof result);
    if (grouping == NULL || !grouping->is_complete)
        return result;
    result.objects = grouping->objects;
    result.segments = grouping->segments;
    result.outline_segments = grouping->along;
    result.trace = grouping->trace;
    result.object_count = grouping->found.object_count;
    result.segment_count = grouping->found.segment_count;
    result.steps = grouping->found.step_count;
    result.hypothesis_count = grouping->found.generated_count;
    result.token_count = grouping->token_count;
    result.best_score = grouping->found.best_score;
    result.best_evidence = grouping->found.best_evidence;
    if (grouping->written != NULL)
        cairn_contour_grouping_written_read(grouping, &result);
    return result;
}
