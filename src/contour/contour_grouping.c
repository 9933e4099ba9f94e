/* Contour grouping by contour-skeleton duality.
 *
 * Method: segments are cut into tokens. First sight (contour_grouping_sight.c) finds the places
 * where a walk may begin: at any sample of the model, so that an object with both ends hidden can
 * be found, and of any size within the range. The walk (contour_grouping_walk.c) is a particle
 * filter; its particles are hypotheses about one object or several. In the end
 * (contour_grouping_object.c) every particle's model is laid onto its segments, and the best that
 * share no place are the objects.
 *
 * Layout: tokens in cells, the map of first sight, starts, the filter with the last two states of
 * each walk, the segments found.
 *
 * Limits: objects of one image that lie closer than a third of their size to each other are one. A
 * segment that is symmetric with itself is cut into tokens, and so is none that is shorter than a
 * token.
 *
 * Source: Adluru 2008, chapter 2; the similarity in place of the displacement from the start,
 * the search over sizes, and starts within the path are this project's. */
#include "src/core/build.h"

#include <string.h>

#include "src/contour/contour_grouping_written.h"

enum { IDLE, CUT, SORT, LOOK, WEIGH, WALK, COLLECT, FINISH, DONE };
/* And of the mode as written. */
enum { POINTS = CUT, INDEX = SORT, SEED = LOOK, SEARCH = WEIGH, MODES = WALK };
/* Ends of segments that are so near to each other are of one chain, px. */
enum { CHAIN_GAP = 3 };
/* Of a segment, and of all together before they are thinned out. */
enum { MOST_PIECES = 1 << 24 };

cairn_grouping_params cairn_grouping_default(void)
{
    cairn_grouping_params params = {
        .max_width = 1024,
        .max_height = 1024,
        .max_tokens = 8192,
        .max_samples = 64,
        .max_outline = 512,
        .particles = 300,
        .max_objects = 8,
        .use_model = 1,
        .use_skeleton = 1,
        .token = 10,
        .deform = CAIRN_REAL(0.025),
        .turn = 15 * (CAIRN_PI / 180),
        .symmetry = 45 * (CAIRN_PI / 180),
        .missing = CAIRN_REAL(0.3),
        .stop = CAIRN_REAL(0.3),
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

static int is_share(cairn_real x)
{
    return x > 0 && x <= 1;
}

static int params_are_valid(const cairn_grouping_params *p)
{
    return p != NULL && p->max_width >= 1 && p->max_width <= 8192 && p->max_height >= 1 &&
           p->max_height <= 8192 && p->max_tokens >= 1 && p->max_tokens <= 1 << 20 &&
           p->max_samples >= 1 && p->max_samples <= 1024 && p->max_outline >= 1 &&
           p->max_outline <= 4096 && p->particles >= 1 && p->particles <= 4096 &&
           p->max_objects >= 1 && p->max_objects <= 64 && p->token > 0 &&
           cairn_is_finite(p->token) && p->deform > 0 && cairn_is_finite(p->deform) &&
           p->turn > 0 && cairn_is_finite(p->turn) && p->symmetry > 0 &&
           cairn_is_finite(p->symmetry) && is_share(p->missing) && is_share(p->stop) &&
           p->min_score >= 0 && p->min_score <= 1 && p->min_evidence >= 0 &&
           cairn_is_finite(p->min_evidence) &&
           (p->mode == CAIRN_MODE_DEFAULT || p->mode == CAIRN_MODE_AS_WRITTEN) &&
           p->max_points >= 1 && p->max_points <= 1 << 22 && p->max_steps >= 2 &&
           p->max_steps <= 1024 && p->path_sigma > 0 && cairn_is_finite(p->path_sigma) &&
           p->radius_sigma > 0 && cairn_is_finite(p->radius_sigma);
}

static cairn_particle_filter_params filter_params(const cairn_grouping_params *p)
{
    cairn_particle_filter_params f = cairn_particle_filter_default();

    f.particles = f.max_particles = p->particles;
    f.max_followers = GROUPING_FOLLOWERS;
    f.max_candidates = p->particles * GROUPING_CANDIDATES;
    /* Where a walk has been is in the sums of its state. */
    f.past = 1;
    f.max_blocks = 3 * p->particles;
    f.state_bytes = (int32_t)sizeof(grouping_state);
    return f;
}

static int32_t cells(int32_t side, int32_t cell)
{
    return (side + cell - 1) / cell;
}

static cairn_particle_filter *carve_filter(cairn_pool *pool, const cairn_grouping_params *p,
                                           cairn_grouping *g)
{
    cairn_particle_filter_params f = filter_params(p);
    cairn_particle_model model = cairn_grouping_model(g);
    cairn_particle_filter *filter = NULL;
    cairn_status status;

    if (pool->base == NULL) {
        cairn_pool_count(pool, cairn_particle_filter_memory(&f));
        return NULL;
    }
    status = cairn_particle_filter_create(&filter, pool, &f, &model);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    return filter;
}

static cairn_grouping *carve_default(cairn_pool *pool, const cairn_grouping_params *p)
{
    size_t lists =
        (size_t)cells(p->max_width, GROUPING_CELL) * (size_t)cells(p->max_height, GROUPING_CELL);
    size_t sights =
        (size_t)cells(p->max_width, GROUPING_SIGHT) * (size_t)cells(p->max_height, GROUPING_SIGHT);
    cairn_grouping *g = cairn_pool_take_one(pool, sizeof *g);
    grouping_token *tokens = cairn_pool_take(pool, (size_t)p->max_tokens, sizeof *tokens);
    grouping_near *near = cairn_pool_take(pool, (size_t)p->max_tokens, sizeof *near);
    int32_t *head = cairn_pool_take(pool, lists + 1, sizeof *head);
    uint8_t *sight = cairn_pool_take(pool, sights, 1);
    grouping_start *starts = cairn_pool_take(pool, (size_t)p->particles, sizeof *starts);
    cairn_grouping_trace *trace = cairn_pool_take(pool, (size_t)p->max_samples, sizeof *trace);
    int32_t *segments =
        cairn_pool_take(pool, (size_t)p->max_objects * (size_t)p->max_outline, sizeof *segments);
    cairn_grouped_object *objects = cairn_pool_take(pool, (size_t)p->max_objects, sizeof *objects);
    int32_t *along =
        cairn_pool_take(pool, (size_t)p->max_objects * (size_t)p->max_outline, sizeof *along);
    int32_t *match = cairn_pool_take(pool, (size_t)p->max_outline, sizeof *match);
    cairn_real *cost = cairn_pool_take(pool, (size_t)p->max_outline, sizeof *cost);
    cairn_vec2 *shift = cairn_pool_take(pool, (size_t)p->max_outline, sizeof *shift);
    cairn_vec2 *bent = cairn_pool_take(pool, (size_t)p->max_outline, sizeof *bent);
    int32_t *apart = cairn_pool_take(pool, (size_t)p->max_outline, sizeof *apart);
    cairn_real *bend = cairn_pool_take(pool, (size_t)p->max_outline, sizeof *bend);
    grouping_cell *way =
        cairn_pool_take(pool, (size_t)p->max_outline * GROUPING_CELLS, sizeof *way);
    cairn_particle_filter *filter = carve_filter(pool, p, g);

    if (g != NULL) {
        memset(g, 0, sizeof *g);
        g->tokens = tokens;
        g->near = near;
        g->head = head;
        g->sight = sight;
        g->starts = starts;
        g->trace = trace;
        g->segments = segments;
        g->objects = objects;
        g->along = along;
        g->match = match;
        g->cost = cost;
        g->shift = shift;
        g->bent = bent;
        g->apart = apart;
        g->bend = bend;
        g->cells = way;
        g->filter = filter;
    }
    return g;
}

static cairn_grouping *carve(cairn_pool *pool, const cairn_grouping_params *p)
{
    cairn_grouping *g;
    struct grouping_written *written;

    if (p->mode == CAIRN_MODE_DEFAULT)
        return carve_default(pool, p);
    g = cairn_pool_take_one(pool, sizeof *g);
    if (g != NULL)
        memset(g, 0, sizeof *g);
    written = cairn_grouping_written_carve(pool, p, g);
    if (g != NULL)
        g->written = written;
    return g;
}

size_t cairn_grouping_memory(const cairn_grouping_params *params)
{
    cairn_pool counting;

    if (!params_are_valid(params))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_grouping_create(cairn_grouping **grouping, cairn_pool *pool,
                                   const cairn_grouping_params *params)
{
    size_t need = cairn_grouping_memory(params);
    cairn_grouping *made;

    if (grouping == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    made = carve(pool, params);
    made->params = *params;
    *grouping = made;
    return CAIRN_OK;
}

static cairn_status check_input(const cairn_grouping *g, const cairn_grouping_input *in)
{
    if (in->count < 0 || (in->segments == NULL && in->count > 0) || in->width < 1 ||
        in->height < 1 || cairn_shape_model_check(in->model, NULL) != CAIRN_OK)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_is_finite(in->max_size) || !cairn_is_finite(in->mean_length) ||
        !cairn_is_finite(in->min_turn) || !cairn_is_finite(in->max_turn))
        return CAIRN_NOT_FINITE;
    if (!(in->min_size > 0) || !(in->max_size >= in->min_size) || !(in->mean_length > 0) ||
        !(in->min_turn >= -CAIRN_PI) || !(in->max_turn <= CAIRN_PI) ||
        !(in->max_turn >= in->min_turn))
        return CAIRN_BAD_ARGUMENT;
    if (in->width > g->params.max_width || in->height > g->params.max_height ||
        in->model->sample_count > g->params.max_samples ||
        in->model->outline_count > g->params.max_outline)
        return CAIRN_FULL;
    return g->written != NULL ? cairn_grouping_written_check(g, in) : CAIRN_OK;
}

cairn_status cairn_grouping_begin(cairn_grouping *g, const cairn_grouping_input *input)
{
    cairn_status status;
    cairn_real widest = 0, half, middle;

    if (g == NULL || input == NULL)
        return CAIRN_BAD_ARGUMENT;
    status = check_input(g, input);
    if (status != CAIRN_OK)
        return status;
    g->input = *input;
    g->columns = cells(input->width, GROUPING_CELL);
    g->rows = cells(input->height, GROUPING_CELL);
    g->sight_columns = cells(input->width, GROUPING_SIGHT);
    g->sight_rows = cells(input->height, GROUPING_SIGHT);
    middle = CAIRN_REAL(0.5) * (input->min_turn + input->max_turn);
    half = CAIRN_REAL(0.5) * (input->max_turn - input->min_turn);
    cairn_sincos(middle, &g->turn_axis.y, &g->turn_axis.x);
    g->turn_cosine = cairn_cos(half);
    for (int32_t i = 0; i < input->model->sample_count; i++) {
        const cairn_shape_sample *s = &input->model->samples[i];

        widest = cairn_max(
            widest, cairn_vec2_norm(cairn_vec2_sub(s->side[1].position, s->side[0].position)));
    }
    g->reach = widest * input->max_size + 1;
    g->piece_count = g->pieces_cut = g->token_count = g->start_count = g->object_count =
        g->segment_count = g->steps = g->looked = 0;
    g->best = g->best_evidence = 0;
    g->cursor = g->other = g->paid = g->stage = g->has_walked = 0;
    g->link = -1;
    g->phase = CUT;
    if (g->written != NULL) {
        cairn_grouping_written_begin(g);
        return CAIRN_OK;
    }
    cairn_grouping_look_begin(g);
    cairn_grouping_outline_begin(g);
    return CAIRN_OK;
}

/* ---- Tokens ---- */

static int32_t cell_of(const cairn_grouping *g, cairn_vec2 p)
{
    int32_t x = cairn_real_to_int(p.x / GROUPING_CELL), y = cairn_real_to_int(p.y / GROUPING_CELL);

    x = x < 0 ? 0 : x >= g->columns ? g->columns - 1 : x;
    y = y < 0 ? 0 : y >= g->rows ? g->rows - 1 : y;
    return y * g->columns + x;
}

/* The chain of a segment's tokens: that of the token before where the one ends and the other
 * begins. */
static int32_t chain_of(const cairn_grouping *g, int32_t segment)
{
    const grouping_token *before = &g->tokens[g->token_count - 1];
    cairn_vec2 gap;

    if (g->token_count == 0 || before->segment == segment)
        return g->token_count == 0 ? 0 : before->chain;
    gap = cairn_vec2_sub(g->input.segments[segment].a, g->input.segments[before->segment].b);
    return before->chain + (cairn_vec2_norm_squared(gap) > CHAIN_GAP * CHAIN_GAP);
}

/* Pieces of a segment. */
static int32_t pieces_of(const cairn_grouping *g, int32_t segment)
{
    cairn_real length = cairn_segment_length(g->input.segments[segment]);

    return cairn_real_to_int(cairn_min(cairn_ceil(length / g->params.token), MOST_PIECES));
}

/* 1 when piece number `piece` of all becomes a token: all of them, or as many as there is room
 * for, evenly. */
static int is_kept(const cairn_grouping *g, int32_t piece)
{
    int64_t most = g->params.max_tokens, all = g->piece_count;

    return all <= most || (piece + 1) * most / all > piece * most / all;
}

/* Cuts one segment into pieces; `piece` is the number of the first. */
static void cut(cairn_grouping *g, int32_t index, int32_t piece)
{
    cairn_segment s = g->input.segments[index];
    cairn_real length = cairn_segment_length(s);
    cairn_vec2 along = cairn_vec2_sub(s.b, s.a);
    int32_t parts = pieces_of(g, index);

    for (int32_t i = 0; i < parts; i++) {
        grouping_token *t = &g->tokens[g->token_count];
        int32_t cell;

        if (!is_kept(g, piece + i))
            continue;
        t->at = cairn_vec2_add(
            s.a, cairn_vec2_scale(along, ((cairn_real)i + CAIRN_REAL(0.5)) / (cairn_real)parts));
        t->direction = cairn_vec2_scale(along, 1 / length);
        t->half = length / (2 * (cairn_real)parts);
        t->segment = index;
        t->chain = chain_of(g, index);
        t->taken = 0;
        cell = cell_of(g, t->at);
        t->next = g->head[cell];
        g->head[cell] = g->token_count++;
    }
}

static int is_finite_segment(const cairn_segment *s)
{
    return cairn_is_finite(s->a.x) && cairn_is_finite(s->a.y) && cairn_is_finite(s->b.x) &&
           cairn_is_finite(s->b.y);
}

/* Empties the lists, counts the pieces, makes them. */
static cairn_status step_cut(cairn_grouping *g, cairn_budget *budget)
{
    int32_t lists = g->columns * g->rows;

    for (; g->cursor < lists; g->cursor++) {
        if (!cairn_budget_pay(budget, &g->paid, 1))
            return CAIRN_MORE;
        g->head[g->cursor] = -1;
    }
    for (; g->cursor - lists < g->input.count; g->cursor++) {
        if (!cairn_budget_pay(budget, &g->paid, 1))
            return CAIRN_MORE;
        if (!is_finite_segment(&g->input.segments[g->cursor - lists]))
            return CAIRN_NOT_FINITE;
        g->piece_count += pieces_of(g, g->cursor - lists);
        if (g->piece_count > MOST_PIECES)
            return CAIRN_FULL;
    }
    for (; g->other < g->input.count; g->other++) {
        int32_t pieces = pieces_of(g, g->other);

        if (!cairn_budget_pay(budget, &g->paid, 1 + pieces))
            return CAIRN_MORE;
        cut(g, g->other, g->pieces_cut);
        g->pieces_cut += pieces;
    }
    cairn_grouping_outline_chance(g);
    return CAIRN_OK;
}

/* Lays the tokens side by side, cell by cell: `cursor` cells have been begun, `other` tokens lie
 * there, `link` is next. */
static cairn_status step_sort(cairn_grouping *g, cairn_budget *budget)
{
    int32_t lists = g->columns * g->rows;

    while (g->link >= 0 || g->cursor < lists) {
        if (!cairn_budget_pay(budget, &g->paid, 1))
            return CAIRN_MORE;
        if (g->link >= 0) {
            const grouping_token *t = &g->tokens[g->link];
            grouping_near near = {t->at, t->direction, t->half, g->link};

            g->near[g->other++] = near;
            g->link = t->next;
        } else {
            g->link = g->head[g->cursor];
            g->head[g->cursor++] = g->other;
        }
    }
    g->head[lists] = g->other;
    return CAIRN_OK;
}

cairn_vec2 cairn_grouping_touch(const cairn_grouping *g, int32_t token, cairn_vec2 p)
{
    const grouping_token *t = &g->tokens[token];
    cairn_real along = cairn_vec2_dot(t->direction, cairn_vec2_sub(p, t->at));

    return cairn_vec2_add(
        t->at, cairn_vec2_scale(t->direction, cairn_max(-t->half, cairn_min(along, t->half))));
}

/* A place of the contour, and by how much a token may lie off it: 1 / sigma^2 across it and of
 * the sine of the turn; sigmas of the gap along it are twice as wide. */
typedef struct near_place {
    cairn_vec2 at, along;
    cairn_real across, turn;
} near_place;

/* Half the squares of sigmas that a token lies off a place; more than limit as soon as its turn
 * alone or the least that it may lie across come to that, which few products tell of most
 * tokens. */
static cairn_real cost_of(const near_place *p, const grouping_near *t, cairn_real limit)
{
    cairn_real sine = cairn_vec2_cross(p->along, t->direction), turned = sine * sine * p->turn,
               across, middle, gap;
    cairn_vec2 off = cairn_vec2_sub(t->at, p->at);

    if (turned > 2 * limit)
        return turned;
    middle = cairn_vec2_cross(p->along, off);
    across = cairn_max(cairn_abs(middle) - t->half * cairn_abs(sine), 0);
    if (across * across * p->across > 2 * limit)
        return CAIRN_REAL_MAX;
    gap = cairn_max(-t->half, cairn_min(-cairn_vec2_dot(t->direction, off), t->half));
    across = middle + sine * gap;
    gap = CAIRN_REAL(0.5) *
          (cairn_vec2_dot(p->along, off) + cairn_vec2_dot(p->along, t->direction) * gap);
    return CAIRN_REAL(0.5) * ((across * across + gap * gap) * p->across + turned);
}

int32_t cairn_grouping_near(const cairn_grouping *g, cairn_vec2 at, cairn_vec2 direction,
                            cairn_real sigma, int32_t most, int32_t *token, cairn_real *cost)
{
    cairn_real reach = cairn_min(cairn_max(3 * sigma, 4) + g->params.token / 2, 64),
               limit = CAIRN_REAL(4.5);
    cairn_vec2 low = {at.x - reach, at.y - reach}, high = {at.x + reach, at.y + reach};
    near_place place = {at, cairn_vec2_unit(direction), 0, 1 / (g->params.turn * g->params.turn)};
    int32_t from = cell_of(g, low), to = cell_of(g, high), columns = g->columns, count = 0;
    int32_t left = from % columns, right = to % columns, bottom = to / columns;

    sigma = cairn_max(sigma, CAIRN_REAL(1.5));
    place.across = 1 / (sigma * sigma);
    for (int32_t y = from / columns; y <= bottom; y++) {
        const grouping_near *n = &g->near[g->head[y * columns + left]],
                            *end = &g->near[g->head[y * columns + right + 1]];

        for (; n < end; n++) {
            cairn_real c = cost_of(&place, n, limit);
            int32_t i;

            if (c > limit || (count == most && c >= cost[count - 1]) || g->tokens[n->token].taken)
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

void cairn_grouping_sum(grouping_sums *s, cairn_vec2 m, cairn_vec2 p, cairn_real weight)
{
    s->n += weight;
    s->mm += weight * cairn_vec2_norm_squared(m);
    s->dot += weight * cairn_vec2_dot(m, p);
    s->cross += weight * cairn_vec2_cross(m, p);
    s->m = cairn_vec2_add(s->m, cairn_vec2_scale(m, weight));
    s->p = cairn_vec2_add(s->p, cairn_vec2_scale(p, weight));
}

grouping_pose cairn_grouping_fit(const grouping_sums *s, const grouping_pose *otherwise)
{
    cairn_real spread = s->mm - cairn_vec2_norm_squared(s->m) / cairn_max(s->n, CAIRN_REAL_MIN);
    grouping_pose pose = *otherwise;

    if (!(spread > CAIRN_REAL(1e-6)))
        return pose;
    pose.a = (s->dot - cairn_vec2_dot(s->m, s->p) / s->n) / spread;
    pose.b = (s->cross - cairn_vec2_cross(s->m, s->p) / s->n) / spread;
    if (!(pose.a * pose.a + pose.b * pose.b > 0))
        return *otherwise;
    pose.t = cairn_vec2_scale(cairn_vec2_sub(s->p, grouping_direction(&pose, s->m)), 1 / s->n);
    return pose;
}

grouping_sums cairn_grouping_hold(const grouping_pose *pose, cairn_real weight)
{
    static const cairn_real corner = CAIRN_REAL(0.35);
    grouping_sums sums = {0, 0, 0, 0, {0, 0}, {0, 0}};

    for (int32_t i = 0; i < 4; i++) {
        cairn_vec2 m = {i % 2 ? corner : -corner, i / 2 ? corner : -corner};

        cairn_grouping_sum(&sums, m, grouping_place(pose, m), weight / 4);
    }
    return sums;
}

/* ---- Phases ---- */

static cairn_status step_phase(cairn_grouping *g, cairn_budget *budget)
{
    cairn_status status;

    switch (g->phase) {
    case CUT:
        return step_cut(g, budget);
    case SORT:
        return step_sort(g, budget);
    case LOOK:
        return cairn_grouping_look(g, budget);
    case WEIGH:
        status = cairn_grouping_weigh(g, budget);
        return status == CAIRN_OK ? cairn_grouping_walk_begin(g) : status;
    case WALK:
        return cairn_grouping_walk(g, budget);
    case COLLECT:
        return cairn_grouping_collect(g, budget);
    default:
        return cairn_grouping_finish(g, budget);
    }
}

static cairn_status step_written(cairn_grouping *g, cairn_budget *budget)
{
    switch (g->phase) {
    case POINTS:
        return cairn_grouping_written_points(g, budget);
    case INDEX:
        return cairn_grouping_written_index(g, budget);
    case SEED:
        return cairn_grouping_written_seed(g, budget);
    case SEARCH:
        return cairn_grouping_written_walk(g, budget);
    default:
        return cairn_grouping_written_finish(g, budget);
    }
}

cairn_status cairn_grouping_step(cairn_grouping *g, cairn_budget *budget)
{
    if (g == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (g->phase != IDLE && g->phase != DONE) {
        cairn_status status = g->written != NULL ? step_written(g, budget) : step_phase(g, budget);

        if (status < 0)
            g->phase = IDLE;
        if (status != CAIRN_OK)
            return status;
        g->phase = g->written != NULL && g->phase == MODES ? DONE : g->phase + 1;
        g->cursor = g->other = 0;
    }
    return CAIRN_OK;
}

cairn_grouping_result cairn_grouping_read(const cairn_grouping *g)
{
    cairn_grouping_result r;

    memset(&r, 0, sizeof r);
    if (g == NULL || g->phase != DONE)
        return r;
    r.objects = g->objects;
    r.segments = g->segments;
    r.along = g->along;
    r.trace = g->trace;
    r.object_count = g->object_count;
    r.segment_count = g->segment_count;
    r.steps = g->steps;
    r.starts = g->looked;
    r.token_count = g->token_count;
    r.best = g->best;
    r.best_evidence = g->best_evidence;
    if (g->written != NULL)
        cairn_grouping_written_read(g, &r);
    return r;
}
