/* Contour grouping: pose hypotheses from pairs of edge segments, matching of the model's outline by
 * dynamic programming, and a particle filter between them, whose weights hardly matter
 * (docs/lab/group.md). As written: the filter alone (contour_grouping_written.c).
 *
 * Method:
 * 1. Segments are cut into tokens, which are sorted into a grid.
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

enum {
    PHASE_IDLE,
    PHASE_CUT,
    PHASE_SORT,
    PHASE_GENERATE,
    PHASE_REFINE,
    PHASE_FILTER,
    PHASE_REFINE_PARTICLES,
    PHASE_SELECT,
    PHASE_DONE
};
/* Phases of the mode as written. */
enum {
    PHASE_WRITTEN_POINTS = PHASE_CUT,
    PHASE_WRITTEN_INDEX = PHASE_SORT,
    PHASE_WRITTEN_START = PHASE_GENERATE,
    PHASE_WRITTEN_FILTER = PHASE_REFINE,
    PHASE_WRITTEN_MODES = PHASE_FILTER
};
/* Consecutive segments with a smaller gap between their ends belong to one chain, px. */
enum { MAX_CHAIN_GAP_PX = 3 };
/* Limit of pieces per segment, and of all segments together before subsampling. */
enum { MAX_PIECES = 1 << 24 };

cairn_contour_grouping_params cairn_contour_grouping_default(void)
{
    cairn_contour_grouping_params params = {
        .max_width = 1024,
        .max_height = 1024,
        .max_tokens = 8192,
        .max_samples = 64,
        .max_outline = 512,
        .particles = 300,
        .max_objects = 8,
        .use_model = 1,
        .use_skeleton = 1,
        .token_length = 10,
        .deform_sigma = CAIRN_REAL(0.025),
        .turn_sigma = 15 * (CAIRN_PI / 180),
        .symmetry_sigma = 45 * (CAIRN_PI / 180),
        .missing_likelihood = CAIRN_REAL(0.3),
        .stop_likelihood = CAIRN_REAL(0.3),
        .min_score = CAIRN_REAL(0.2),
        .min_evidence = 13,
        .seed = 1,
        .max_points = 65536,
        .max_steps = 128,
        .path_sigma = CAIRN_REAL(0.7),
        .radius_sigma = CAIRN_REAL(0.2),
    };
    return params;
}

static int is_probability(cairn_real x)
{
    return x > 0 && x <= 1;
}

static int params_are_valid(const cairn_contour_grouping_params *params)
{
    return params != NULL && params->max_width >= 1 && params->max_width <= 8192 &&
           params->max_height >= 1 && params->max_height <= 8192 && params->max_tokens >= 1 &&
           params->max_tokens <= 1 << 20 && params->max_samples >= 1 &&
           params->max_samples <= 1024 && params->max_outline >= 1 && params->max_outline <= 4096 &&
           params->particles >= 1 && params->particles <= 4096 && params->max_objects >= 1 &&
           params->max_objects <= 64 && params->token_length > 0 &&
           cairn_is_finite(params->token_length) && params->deform_sigma > 0 &&
           cairn_is_finite(params->deform_sigma) && params->turn_sigma > 0 &&
           cairn_is_finite(params->turn_sigma) && params->symmetry_sigma > 0 &&
           cairn_is_finite(params->symmetry_sigma) && is_probability(params->missing_likelihood) &&
           is_probability(params->stop_likelihood) && params->min_score >= 0 &&
           params->min_score <= 1 && params->min_evidence >= 0 &&
           cairn_is_finite(params->min_evidence) &&
           (params->mode == CAIRN_MODE_DEFAULT || params->mode == CAIRN_MODE_AS_WRITTEN) &&
           params->max_points >= 1 && params->max_points <= 1 << 22 && params->max_steps >= 2 &&
           params->max_steps <= 1024 && params->path_sigma > 0 &&
           cairn_is_finite(params->path_sigma) && params->radius_sigma > 0 &&
           cairn_is_finite(params->radius_sigma);
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

static int32_t cell_count(int32_t side, int32_t cell)
{
    return (side + cell - 1) / cell;
}

static cairn_particle_filter *carve_filter(cairn_pool *pool,
                                           const cairn_contour_grouping_params *params,
                                           cairn_contour_grouping *grouping)
{
    cairn_particle_filter_params settings = filter_params(params);
    cairn_particle_filter_model model = cairn_contour_grouping_filter_model(grouping);
    cairn_particle_filter *filter = NULL;
    cairn_status status;

    if (pool->base == NULL) {
        cairn_pool_count(pool, cairn_particle_filter_memory(&settings));
        return NULL;
    }
    status = cairn_particle_filter_create(&filter, pool, &settings, &model);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    return filter;
}

static cairn_contour_grouping *carve_default(cairn_pool *pool,
                                             const cairn_contour_grouping_params *params)
{
    size_t lists = (size_t)cell_count(params->max_width, CONTOUR_GROUPING_TOKEN_CELL_PX) *
                   (size_t)cell_count(params->max_height, CONTOUR_GROUPING_TOKEN_CELL_PX);
    size_t edge_cell_count = (size_t)cell_count(params->max_width, CONTOUR_GROUPING_EDGE_CELL_PX) *
                             (size_t)cell_count(params->max_height, CONTOUR_GROUPING_EDGE_CELL_PX);
    cairn_contour_grouping *grouping = cairn_pool_take_one(pool, sizeof *grouping);
    contour_grouping_token *tokens =
        cairn_pool_take(pool, (size_t)params->max_tokens, sizeof *tokens);
    contour_grouping_sorted_token *sorted_tokens =
        cairn_pool_take(pool, (size_t)params->max_tokens, sizeof *sorted_tokens);
    int32_t *cell_start = cairn_pool_take(pool, lists + 1, sizeof *cell_start);
    uint8_t *edge_map = cairn_pool_take(pool, edge_cell_count, 1);
    contour_grouping_hypothesis *hypotheses =
        cairn_pool_take(pool, (size_t)params->particles, sizeof *hypotheses);
    cairn_contour_grouping_trace *trace =
        cairn_pool_take(pool, (size_t)params->max_samples, sizeof *trace);
    int32_t *segments = cairn_pool_take(
        pool, (size_t)params->max_objects * (size_t)params->max_outline, sizeof *segments);
    cairn_contour_grouping_object *objects =
        cairn_pool_take(pool, (size_t)params->max_objects, sizeof *objects);
    int32_t *along = cairn_pool_take(
        pool, (size_t)params->max_objects * (size_t)params->max_outline, sizeof *along);
    int32_t *match = cairn_pool_take(pool, (size_t)params->max_outline, sizeof *match);
    cairn_real *cost = cairn_pool_take(pool, (size_t)params->max_outline, sizeof *cost);
    cairn_vec2 *shift = cairn_pool_take(pool, (size_t)params->max_outline, sizeof *shift);
    cairn_vec2 *next_shift = cairn_pool_take(pool, (size_t)params->max_outline, sizeof *next_shift);
    int32_t *match_distance =
        cairn_pool_take(pool, (size_t)params->max_outline, sizeof *match_distance);
    cairn_real *curvature = cairn_pool_take(pool, (size_t)params->max_outline, sizeof *curvature);
    contour_grouping_node *is_reversed = cairn_pool_take(
        pool, (size_t)params->max_outline * CONTOUR_GROUPING_MAX_NODES, sizeof *is_reversed);
    cairn_particle_filter *filter = carve_filter(pool, params, grouping);

    if (grouping != NULL) {
        memset(grouping, 0, sizeof *grouping);
        grouping->tokens = tokens;
        grouping->sorted_tokens = sorted_tokens;
        grouping->cell_start = cell_start;
        grouping->edge_map = edge_map;
        grouping->hypotheses = hypotheses;
        grouping->trace = trace;
        grouping->segments = segments;
        grouping->objects = objects;
        grouping->along = along;
        grouping->match = match;
        grouping->cost = cost;
        grouping->shift = shift;
        grouping->next_shift = next_shift;
        grouping->match_distance = match_distance;
        grouping->curvature = curvature;
        grouping->nodes = is_reversed;
        grouping->filter = filter;
    }
    return grouping;
}

static cairn_contour_grouping *carve(cairn_pool *pool, const cairn_contour_grouping_params *params)
{
    cairn_contour_grouping *grouping;
    struct contour_grouping_written *written;

    if (params->mode == CAIRN_MODE_DEFAULT)
        return carve_default(pool, params);
    grouping = cairn_pool_take_one(pool, sizeof *grouping);
    if (grouping != NULL)
        memset(grouping, 0, sizeof *grouping);
    written = cairn_contour_grouping_written_carve(pool, params, grouping);
    if (grouping != NULL)
        grouping->written = written;
    return grouping;
}

size_t cairn_contour_grouping_memory(const cairn_contour_grouping_params *params)
{
    cairn_pool counting;

    if (!params_are_valid(params))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_contour_grouping_create(cairn_contour_grouping **grouping, cairn_pool *pool,
                                           const cairn_contour_grouping_params *params)
{
    size_t need = cairn_contour_grouping_memory(params);
    cairn_contour_grouping *made;

    if (grouping == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_capacity(pool, need))
        return CAIRN_NO_MEMORY;
    made = carve(pool, params);
    made->params = *params;
    *grouping = made;
    return CAIRN_OK;
}

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
    grouping->columns = cell_count(input->width, CONTOUR_GROUPING_TOKEN_CELL_PX);
    grouping->rows = cell_count(input->height, CONTOUR_GROUPING_TOKEN_CELL_PX);
    grouping->edge_columns = cell_count(input->width, CONTOUR_GROUPING_EDGE_CELL_PX);
    grouping->edge_rows = cell_count(input->height, CONTOUR_GROUPING_EDGE_CELL_PX);
    middle = CAIRN_REAL(0.5) * (input->min_turn + input->max_turn);
    half = CAIRN_REAL(0.5) * (input->max_turn - input->min_turn);
    cairn_sincos(middle, &grouping->middle_rotation.y, &grouping->middle_rotation.x);
    grouping->min_rotation_cosine = cairn_cos(half);
    for (int32_t i = 0; i < input->model->sample_count; i++) {
        const cairn_shape_model_sample *s = &input->model->samples[i];

        widest = cairn_max(widest, cairn_vec2_norm(cairn_vec2_sub(s->contact[1].position,
                                                                  s->contact[0].position)));
    }
    grouping->max_chord = widest * input->max_size + 1;
    grouping->piece_count = grouping->cut_piece_count = grouping->token_count =
        grouping->hypothesis_count = grouping->object_count = grouping->segment_count =
            grouping->step_count = grouping->generated_count = 0;
    grouping->best_score = grouping->best_evidence = 0;
    grouping->cursor = grouping->second_cursor = grouping->units_charged =
        grouping->callback_units_charged = grouping->has_particles = 0;
    grouping->next_token = -1;
    grouping->phase = PHASE_CUT;
    if (grouping->written != NULL) {
        cairn_contour_grouping_written_begin(grouping);
        return CAIRN_OK;
    }
    cairn_contour_grouping_begin_hypotheses(grouping);
    cairn_contour_grouping_begin_outline(grouping);
    return CAIRN_OK;
}

/* ---- Tokens ---- */

/* Index of the cell of a point, clamped to the image. */
static int32_t cell_of(const cairn_contour_grouping *grouping, cairn_vec2 p)
{
    int32_t x = cairn_real_to_int(p.x / CONTOUR_GROUPING_TOKEN_CELL_PX),
            y = cairn_real_to_int(p.y / CONTOUR_GROUPING_TOKEN_CELL_PX);

    x = x < 0 ? 0 : x >= grouping->columns ? grouping->columns - 1 : x;
    y = y < 0 ? 0 : y >= grouping->rows ? grouping->rows - 1 : y;
    return y * grouping->columns + x;
}

/* Chain index of a segment's tokens: that of the previous token when the segments are contiguous,
 * else a new one. */
static int32_t chain_of(const cairn_contour_grouping *grouping, int32_t segment)
{
    const contour_grouping_token *previous = &grouping->tokens[grouping->token_count - 1];
    cairn_vec2 gap;

    if (grouping->token_count == 0 || previous->segment == segment)
        return grouping->token_count == 0 ? 0 : previous->chain;
    gap = cairn_vec2_sub(grouping->input.segments[segment].a,
                         grouping->input.segments[previous->segment].b);
    return previous->chain + (cairn_vec2_norm_squared(gap) > MAX_CHAIN_GAP_PX * MAX_CHAIN_GAP_PX);
}

/* Number of pieces of a segment. */
static int32_t pieces_of(const cairn_contour_grouping *grouping, int32_t segment)
{
    cairn_real length = cairn_segment_length(grouping->input.segments[segment]);

    return cairn_real_to_int(
        cairn_min(cairn_ceil(length / grouping->params.token_length), MAX_PIECES));
}

/* 1 when piece number `piece` of all becomes a token: all of them, or an even subsample of
 * max_tokens. */
static int is_kept(const cairn_contour_grouping *grouping, int32_t piece)
{
    int64_t capacity = grouping->params.max_tokens, all = grouping->piece_count;

    return all <= capacity || (piece + 1) * capacity / all > piece * capacity / all;
}

/* Cuts one segment into tokens; `piece` is the number of the first. */
static void cut(cairn_contour_grouping *grouping, int32_t index, int32_t piece)
{
    cairn_segment s = grouping->input.segments[index];
    cairn_real length = cairn_segment_length(s);
    cairn_vec2 along = cairn_vec2_sub(s.b, s.a);
    int32_t piece_count = pieces_of(grouping, index);

    for (int32_t i = 0; i < piece_count; i++) {
        contour_grouping_token *token = &grouping->tokens[grouping->token_count];
        int32_t cell;

        if (!is_kept(grouping, piece + i))
            continue;
        token->middle =
            cairn_vec2_add(s.a, cairn_vec2_scale(along, ((cairn_real)i + CAIRN_REAL(0.5)) /
                                                            (cairn_real)piece_count));
        token->direction = cairn_vec2_scale(along, 1 / length);
        token->half_length = length / (2 * (cairn_real)piece_count);
        token->segment = index;
        token->chain = chain_of(grouping, index);
        token->is_used = 0;
        cell = cell_of(grouping, token->middle);
        token->next_in_cell = grouping->cell_start[cell];
        grouping->cell_start[cell] = grouping->token_count++;
    }
}

/* Clears the cells, counts the pieces, creates the tokens. */
static cairn_status step_cut(cairn_contour_grouping *grouping, cairn_budget *budget)
{
    int32_t cells = grouping->columns * grouping->rows;

    for (; grouping->cursor < cells; grouping->cursor++) {
        if (!cairn_budget_charge(budget, &grouping->units_charged, 1))
            return CAIRN_MORE;
        grouping->cell_start[grouping->cursor] = -1;
    }
    for (; grouping->cursor - cells < grouping->input.count; grouping->cursor++) {
        if (!cairn_budget_charge(budget, &grouping->units_charged, 1))
            return CAIRN_MORE;
        if (!cairn_segment_is_finite(grouping->input.segments[grouping->cursor - cells]))
            return CAIRN_NOT_FINITE;
        grouping->piece_count += pieces_of(grouping, grouping->cursor - cells);
        if (grouping->piece_count > MAX_PIECES)
            return CAIRN_FULL;
    }
    for (; grouping->second_cursor < grouping->input.count; grouping->second_cursor++) {
        int32_t pieces = pieces_of(grouping, grouping->second_cursor);

        if (!cairn_budget_charge(budget, &grouping->units_charged, 1 + pieces))
            return CAIRN_MORE;
        cut(grouping, grouping->second_cursor, grouping->cut_piece_count);
        grouping->cut_piece_count += pieces;
    }
    cairn_contour_grouping_set_clutter_cost(grouping);
    return CAIRN_OK;
}

/* Sorts the tokens by cell: `cursor` counts cells begun, `second_cursor` tokens written,
 * `next_token` is the next of the current cell. */
static cairn_status step_sort(cairn_contour_grouping *grouping, cairn_budget *budget)
{
    int32_t cells = grouping->columns * grouping->rows;

    while (grouping->next_token >= 0 || grouping->cursor < cells) {
        if (!cairn_budget_charge(budget, &grouping->units_charged, 1))
            return CAIRN_MORE;
        if (grouping->next_token >= 0) {
            const contour_grouping_token *token = &grouping->tokens[grouping->next_token];
            contour_grouping_sorted_token sorted = {token->middle, token->direction,
                                                    token->half_length, grouping->next_token};

            grouping->sorted_tokens[grouping->second_cursor++] = sorted;
            grouping->next_token = token->next_in_cell;
        } else {
            grouping->next_token = grouping->cell_start[grouping->cursor];
            grouping->cell_start[grouping->cursor++] = grouping->second_cursor;
        }
    }
    grouping->cell_start[cells] = grouping->second_cursor;
    return CAIRN_OK;
}

cairn_vec2 cairn_contour_grouping_nearest_point(const cairn_contour_grouping *grouping,
                                                int32_t token, cairn_vec2 p)
{
    const contour_grouping_token *t = &grouping->tokens[token];
    cairn_real along = cairn_vec2_dot(t->direction, cairn_vec2_sub(p, t->middle));

    return cairn_vec2_add(
        t->middle, cairn_vec2_scale(t->direction,
                                    cairn_max(-t->half_length, cairn_min(along, t->half_length))));
}

/* A contour point and its tolerances: 1 / sigma^2 of the distance across the contour and of the
 * sine of the angle. The tolerance of the gap along the contour is twice as wide. */
typedef struct contour_place {
    cairn_vec2 middle, along;
    cairn_real across, turn;
} contour_place;

/* Cost of a token at a contour point: half the squared distance in sigmas. Returns early with a
 * value above `limit` when the angle alone or the lower bound of the distance across exceeds it. */
static cairn_real token_cost(const contour_place *place, const contour_grouping_sorted_token *token,
                             cairn_real limit)
{
    cairn_real sine = cairn_vec2_cross(place->along, token->direction),
               turn_cost = sine * sine * place->turn, across, middle, gap;
    cairn_vec2 offset = cairn_vec2_sub(token->middle, place->middle);

    if (turn_cost > 2 * limit)
        return turn_cost;
    middle = cairn_vec2_cross(place->along, offset);
    across = cairn_max(cairn_abs(middle) - token->half_length * cairn_abs(sine), 0);
    if (across * across * place->across > 2 * limit)
        return CAIRN_REAL_MAX;
    gap = cairn_max(-token->half_length,
                    cairn_min(-cairn_vec2_dot(token->direction, offset), token->half_length));
    across = middle + sine * gap;
    gap = CAIRN_REAL(0.5) * (cairn_vec2_dot(place->along, offset) +
                             cairn_vec2_dot(place->along, token->direction) * gap);
    return CAIRN_REAL(0.5) * ((across * across + gap * gap) * place->across + turn_cost);
}

int32_t cairn_contour_grouping_match_tokens(const cairn_contour_grouping *grouping, cairn_vec2 at,
                                            cairn_vec2 direction, cairn_real sigma, int32_t most,
                                            int32_t *token, cairn_real *cost)
{
    cairn_real reach = cairn_min(cairn_max(3 * sigma, 4) + grouping->params.token_length / 2, 64),
               limit = CAIRN_REAL(4.5);
    cairn_vec2 low = {at.x - reach, at.y - reach}, high = {at.x + reach, at.y + reach};
    contour_place point = {at, cairn_vec2_unit(direction), 0,
                           1 / (grouping->params.turn_sigma * grouping->params.turn_sigma)};
    int32_t from = cell_of(grouping, low), to = cell_of(grouping, high),
            columns = grouping->columns, count = 0;
    int32_t left = from % columns, right = to % columns, bottom = to / columns;

    sigma = cairn_max(sigma, CAIRN_REAL(1.5));
    point.across = 1 / (sigma * sigma);
    for (int32_t y = from / columns; y <= bottom; y++) {
        const contour_grouping_sorted_token
            *n = &grouping->sorted_tokens[grouping->cell_start[y * columns + left]],
            *end = &grouping->sorted_tokens[grouping->cell_start[y * columns + right + 1]];

        for (; n < end; n++) {
            cairn_real c = token_cost(&point, n, limit);
            int32_t i;

            if (c > limit || (count == most && c >= cost[count - 1]) ||
                grouping->tokens[n->token].is_used)
                continue;
            count += count < most;
            for (i = count - 1; i > 0 && cost[i - 1] > c; i--) {
                cost[i] = cost[i - 1];
                token[i] = token[i - 1];
            }
            cost[i] = c;
            token[i] = n->token;
            limit = count == most ? cost[count - 1] : limit;
        }
    }
    return count;
}

/* ---- The fit ---- */

void cairn_contour_grouping_add_point(contour_grouping_fit_sums *sums, cairn_vec2 model_point,
                                      cairn_vec2 image_point, cairn_real weight)
{
    sums->weight += weight;
    sums->model_squared += weight * cairn_vec2_norm_squared(model_point);
    sums->dot += weight * cairn_vec2_dot(model_point, image_point);
    sums->cross += weight * cairn_vec2_cross(model_point, image_point);
    sums->model = cairn_vec2_add(sums->model, cairn_vec2_scale(model_point, weight));
    sums->image = cairn_vec2_add(sums->image, cairn_vec2_scale(image_point, weight));
}

contour_grouping_pose cairn_contour_grouping_fit_pose(const contour_grouping_fit_sums *sums,
                                                      const contour_grouping_pose *otherwise)
{
    cairn_real spread = sums->model_squared - cairn_vec2_norm_squared(sums->model) /
                                                  cairn_max(sums->weight, CAIRN_REAL_MIN);
    contour_grouping_pose pose = *otherwise;

    if (!(spread > CAIRN_REAL(1e-6)))
        return pose;
    pose.a = (sums->dot - cairn_vec2_dot(sums->model, sums->image) / sums->weight) / spread;
    pose.b = (sums->cross - cairn_vec2_cross(sums->model, sums->image) / sums->weight) / spread;
    if (!(pose.a * pose.a + pose.b * pose.b > 0))
        return *otherwise;
    pose.t = cairn_vec2_scale(
        cairn_vec2_sub(sums->image, contour_grouping_transform_vector(&pose, sums->model)),
        1 / sums->weight);
    return pose;
}

contour_grouping_fit_sums cairn_contour_grouping_pose_prior(const contour_grouping_pose *pose,
                                                            cairn_real weight)
{
    static const cairn_real corner = CAIRN_REAL(0.35);
    contour_grouping_fit_sums sums = {.weight = 0};

    for (int32_t i = 0; i < 4; i++) {
        cairn_vec2 model_point = {i % 2 ? corner : -corner, i / 2 ? corner : -corner};

        cairn_contour_grouping_add_point(
            &sums, model_point, contour_grouping_transform_point(pose, model_point), weight / 4);
    }
    return sums;
}

/* ---- Phases ---- */

static cairn_status step_phase(cairn_contour_grouping *grouping, cairn_budget *budget)
{
    cairn_status status;

    switch (grouping->phase) {
    case PHASE_CUT:
        return step_cut(grouping, budget);
    case PHASE_SORT:
        return step_sort(grouping, budget);
    case PHASE_GENERATE:
        return cairn_contour_grouping_generate_hypotheses(grouping, budget);
    case PHASE_REFINE:
        status = cairn_contour_grouping_refine_hypotheses(grouping, budget);
        return status == CAIRN_OK ? cairn_contour_grouping_begin_filter(grouping) : status;
    case PHASE_FILTER:
        return cairn_contour_grouping_run_filter(grouping, budget);
    case PHASE_REFINE_PARTICLES:
        return cairn_contour_grouping_refine_particles(grouping, budget);
    default:
        return cairn_contour_grouping_select_objects(grouping, budget);
    }
}

static cairn_status step_written(cairn_contour_grouping *grouping, cairn_budget *budget)
{
    switch (grouping->phase) {
    case PHASE_WRITTEN_POINTS:
        return cairn_contour_grouping_written_points(grouping, budget);
    case PHASE_WRITTEN_INDEX:
        return cairn_contour_grouping_written_index(grouping, budget);
    case PHASE_WRITTEN_START:
        return cairn_contour_grouping_written_start(grouping, budget);
    case PHASE_WRITTEN_FILTER:
        return cairn_contour_grouping_written_run_filter(grouping, budget);
    default:
        return cairn_contour_grouping_written_finish(grouping, budget);
    }
}

cairn_status cairn_contour_grouping_step(cairn_contour_grouping *grouping, cairn_budget *budget)
{
    if (grouping == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (grouping->phase != PHASE_IDLE && grouping->phase != PHASE_DONE) {
        cairn_status status = grouping->written != NULL ? step_written(grouping, budget)
                                                        : step_phase(grouping, budget);

        if (status < 0)
            grouping->phase = PHASE_IDLE;
        if (status != CAIRN_OK)
            return status;
        grouping->phase = grouping->written != NULL && grouping->phase == PHASE_WRITTEN_MODES
                              ? PHASE_DONE
                              : grouping->phase + 1;
        grouping->cursor = grouping->second_cursor = 0;
    }
    return CAIRN_OK;
}

cairn_contour_grouping_result cairn_contour_grouping_read(const cairn_contour_grouping *grouping)
{
    cairn_contour_grouping_result result;

    memset(&result, 0, sizeof result);
    if (grouping == NULL || grouping->phase != PHASE_DONE)
        return result;
    result.objects = grouping->objects;
    result.segments = grouping->segments;
    result.outline_segments = grouping->along;
    result.trace = grouping->trace;
    result.object_count = grouping->object_count;
    result.segment_count = grouping->segment_count;
    result.steps = grouping->step_count;
    result.hypothesis_count = grouping->generated_count;
    result.token_count = grouping->token_count;
    result.best_score = grouping->best_score;
    result.best_evidence = grouping->best_evidence;
    if (grouping->written != NULL)
        cairn_contour_grouping_written_read(grouping, &result);
    return result;
}
