/* Objects among the edges of a picture.
 *
 * Method: the grouping runs with the model, and with its mirror image when that is asked for; of objects of both that lie on each
 * other the better one stays. An object is completed along its chains of edges (contour_search_complete.c). Each sample of the model's axis then looks among the object's own segments for the one on either
 * side of it, and where there are both the disc is that of their symmetric point. */
#include "src/core/build.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/shape_model_file.h"
#include "cairn/symmetric_point.h"
#include "src/host/contour_search_work.h"

/* Objects whose middles are closer, of their size, are one. */
#define APART 0.3
/* A segment on a side lies at most so far from where the model has it, of the size, and turned by so much. */
#define REACH_SHARE  0.08
#define TURN_COSINE  0.7
#define LEAST_TOKENS 64

/* Steps between looks at the walk. */
enum { LOOK_EVERY = 2000 };

typedef struct searcher {
    cairn_contour_result *result;
    const cairn_contour_tokens *tokens;
    const cairn_contour_search_params *params;
} searcher;

cairn_contour_search_params cairn_contour_search_default(int32_t width, int32_t height)
{
    cairn_real diagonal = (cairn_real)hypot((double)width, (double)height);
    cairn_contour_search_params params = {
        .grouping = cairn_grouping_default(),
        .min_size = cairn_max(24, diagonal / 10),
        .max_size = cairn_max(24, diagonal),
        .min_turn = -15 * (CAIRN_PI / 180),
        .max_turn = 15 * (CAIRN_PI / 180),
        .mirror = 1,
    };
    return params;
}

void cairn_contour_result_free(cairn_contour_result *result)
{
    free(result->objects);
    free(result->segments);
    free(result->discs);
    free(result->trace[0]);
    free(result->trace[1]);
    free(result->modes[0]);
    free(result->modes[1]);
    memset(result, 0, sizeof *result);
}

/* ---- Discs ---- */

cairn_vec2 cairn_contour_turned(const cairn_grouped_object *o, cairn_vec2 m)
{
    cairn_real c = o->size * (cairn_real)cos((double)o->turn), s = o->size * (cairn_real)sin((double)o->turn);
    cairn_vec2 p = {c * m.x - s * m.y, s * m.x + c * m.y};

    return p;
}

cairn_real cairn_contour_distance(cairn_segment line, cairn_vec2 p)
{
    cairn_vec2 along = cairn_vec2_sub(line.b, line.a), to = cairn_vec2_sub(p, line.a);
    cairn_real share = cairn_vec2_dot(along, to) / cairn_max(cairn_vec2_norm_squared(along), CAIRN_REAL(1e-6));

    share = cairn_max(0, cairn_min(share, 1));
    return cairn_vec2_norm(cairn_vec2_sub(to, cairn_vec2_scale(along, share)));
}

/* The object's segment nearest to where a side of the model should be, -1: none is near. */
static int32_t side_of(const searcher *s, const cairn_grouped_object *o, const cairn_oriented_point *side)
{
    cairn_vec2 at = cairn_vec2_add(o->origin, cairn_contour_turned(o, side->position));
    cairn_vec2 wanted = cairn_vec2_unit(cairn_contour_turned(o, side->direction));
    cairn_real nearest = (cairn_real)REACH_SHARE * o->size;
    int32_t found = -1;

    for (int32_t i = 0; i < o->count; i++) {
        int32_t index = s->result->segments[o->first + i];
        cairn_segment line = s->tokens->lines[index];
        cairn_real distance = cairn_contour_distance(line, at);

        if (distance < nearest && cairn_abs(cairn_vec2_dot(cairn_vec2_unit(cairn_vec2_sub(line.b, line.a)), wanted)) >=
                                      (cairn_real)TURN_COSINE) {
            nearest = distance;
            found = index;
        }
    }
    return found;
}

static cairn_contour_disc disc_of(const searcher *s, const cairn_grouped_object *o, const cairn_shape_sample *sample,
                                  int32_t index)
{
    cairn_symmetric_point_params params = cairn_symmetric_point_default();
    cairn_contour_disc disc = {
        cairn_vec2_add(o->origin, cairn_contour_turned(o, sample->centre)), o->size * sample->radius, {-1, -1}, index};
    cairn_symmetric_point sp;

    for (int32_t side = 0; side < 2; side++)
        disc.side[side] = side_of(s, o, &sample->side[side]);
    params.max_radius = 2 * disc.radius;
    params.min_radius = disc.radius / 2;
    if (disc.side[0] >= 0 && disc.side[1] >= 0 && disc.side[0] != disc.side[1] &&
        cairn_symmetric_point_of_segments(&params, s->tokens->lines[disc.side[0]], s->tokens->lines[disc.side[1]],
                                          &sp) &&
        cairn_vec2_norm(cairn_vec2_sub(sp.centre, disc.centre)) <= (cairn_real)REACH_SHARE * o->size) {
        disc.centre = sp.centre;
        disc.radius = sp.radius;
    }
    return disc;
}

/* ---- Objects ---- */

/* Appends count items to an array; 0: there is no memory. */
static int append(void **array, int32_t *length, const void *items, int32_t count, size_t size)
{
    char *grown = realloc(*array, ((size_t)*length + (size_t)count + 1) * size);

    if (grown == NULL)
        return 0;
    *array = grown;
    if (items != NULL)
        memcpy(grown + (size_t)*length * size, items, (size_t)count * size);
    *length += count;
    return 1;
}

static int add_object(searcher *s, const cairn_grouping_result *found, int32_t index, const cairn_shape_model *model,
                      int32_t mirrored)
{
    cairn_contour_result *r = s->result;
    cairn_contour_object o = {found->objects[index], mirrored, r->disc_count};
    void *segments = r->segments, *discs = r->discs, *objects = r->objects;
    int32_t first = r->segment_count;

    /* Room for all there are: it may grow. */
    if (!append(&segments, &r->segment_count, NULL, s->tokens->count, sizeof *r->segments))
        return 0;
    r->segments = segments;
    if (o.found.count > 0)
        memcpy(&r->segments[first], &found->segments[o.found.first], (size_t)o.found.count * sizeof *r->segments);
    o.found.first = first;
    if (!cairn_contour_complete(s->tokens, model, &o.found, &r->segments[first], &o.found.count))
        return 0;
    r->segment_count = first + o.found.count;
    if (!append(&discs, &r->disc_count, NULL, model->sample_count, sizeof *r->discs))
        return 0;
    r->discs = discs;
    for (int32_t k = 0; k < model->sample_count; k++)
        r->discs[o.first_disc + k] = disc_of(s, &o.found, &model->samples[k], k);
    if (!append(&objects, &r->object_count, &o, 1, sizeof *r->objects))
        return 0;
    r->objects = objects;
    return 1;
}

static int compare_objects(const void *a, const void *b)
{
    const cairn_contour_object *x = a, *y = b;

    if (x->found.evidence != y->found.evidence)
        return x->found.evidence < y->found.evidence ? 1 : -1;
    return x->mirrored != y->mirrored ? x->mirrored - y->mirrored : x->first_disc - y->first_disc;
}

/* The best first; those that lie on better ones go. */
static void keep_best(cairn_contour_result *r)
{
    int32_t kept = 0;

    if (r->object_count > 1)
        qsort(r->objects, (size_t)r->object_count, sizeof *r->objects, compare_objects);
    for (int32_t i = 0; i < r->object_count; i++) {
        const cairn_grouped_object *o = &r->objects[i].found;
        int32_t apart = 1;

        for (int32_t k = 0; k < kept && apart; k++) {
            const cairn_grouped_object *better = &r->objects[k].found;
            cairn_real least = (cairn_real)APART * cairn_max(o->size, better->size);

            apart = cairn_vec2_norm(cairn_vec2_sub(o->origin, better->origin)) > least;
        }
        if (apart)
            r->objects[kept++] = r->objects[i];
    }
    r->object_count = kept;
}

/* ---- The search ---- */

/* Groups of particles whose models lie apart. */
static int32_t count_modes(const cairn_grouping_particle *particles, int32_t count, int32_t *mode)
{
    int32_t modes = 0;

    for (int32_t i = 0; i < count; i++) {
        const cairn_grouping_particle *p = &particles[i];
        int32_t k = 0;

        while (k < modes) {
            const cairn_grouping_particle *q = &particles[mode[k]];

            if (cairn_vec2_norm(cairn_vec2_sub(p->origin, q->origin)) <=
                (cairn_real)APART * cairn_max(p->size, q->size))
                break;
            k++;
        }
        if (k == modes)
            mode[modes++] = i;
    }
    return modes;
}

/* What a look at the walk needs. */
typedef struct watcher {
    cairn_grouping_particle *particles; /* [most] */
    int32_t *mode;                      /* [most] */
    int32_t most, seen;                 /* particles, steps */
} watcher;

static void look(const searcher *s, const cairn_grouping *grouping, int32_t mirrored, int32_t most_steps, watcher *w)
{
    int32_t steps, count = cairn_grouping_particles(grouping, w->particles, w->most, &steps);

    if (steps == w->seen || steps > most_steps)
        return;
    w->seen = steps;
    count = count < w->most ? count : w->most;
    s->result->modes[mirrored][steps - 1] = count_modes(w->particles, count, w->mode);
    if (s->params->on_step != NULL)
        s->params->on_step(s->params->context, w->particles, count, mirrored);
}

static cairn_status walk(const searcher *s, cairn_grouping *grouping, int32_t mirrored, int32_t samples,
                         int32_t particles)
{
    watcher w = {malloc((size_t)particles * sizeof *w.particles), malloc((size_t)particles * sizeof *w.mode), particles,
                 0};
    cairn_status status = CAIRN_MORE;

    s->result->modes[mirrored] = calloc((size_t)samples, sizeof *s->result->modes[mirrored]);
    if (w.particles == NULL || w.mode == NULL || s->result->modes[mirrored] == NULL)
        status = CAIRN_NO_MEMORY;
    while (status == CAIRN_MORE) {
        cairn_budget budget = {LOOK_EVERY};

        status = cairn_grouping_step(grouping, &budget);
        if (status >= 0)
            look(s, grouping, mirrored, samples, &w);
    }
    free(w.particles);
    free(w.mode);
    return status;
}

static int take_result(searcher *s, const cairn_grouping *grouping, const cairn_shape_model *model, int32_t mirrored)
{
    cairn_grouping_result found = cairn_grouping_read(grouping);
    cairn_contour_result *r = s->result;

    r->trace[mirrored] = malloc(((size_t)found.steps + 1) * sizeof *r->trace[mirrored]);
    if (r->trace[mirrored] == NULL)
        return 0;
    if (found.steps > 0)
        memcpy(r->trace[mirrored], found.trace, (size_t)found.steps * sizeof *found.trace);
    r->steps[mirrored] = found.steps;
    r->starts[mirrored] = found.starts;
    r->best = cairn_max(r->best, found.best);
    for (int32_t i = 0; i < found.object_count; i++)
        if (!add_object(s, &found, i, model, mirrored))
            return 0;
    return 1;
}

static cairn_status search(searcher *s, const cairn_shape_model *model, int32_t mirrored, cairn_pool *pool,
                           const cairn_grouping_params *params)
{
    const cairn_contour_search_params *p = s->params;
    cairn_grouping_input input = {s->tokens->lines,
                                  s->tokens->count,
                                  s->tokens->width,
                                  s->tokens->height,
                                  model,
                                  p->min_size,
                                  p->max_size,
                                  p->min_turn,
                                  p->max_turn,
                                  s->tokens->mean_length > 0 ? s->tokens->mean_length : 5};
    cairn_grouping *grouping;
    cairn_status status = cairn_grouping_create(&grouping, pool, params);

    if (status == CAIRN_OK)
        status = cairn_grouping_begin(grouping, &input);
    if (status == CAIRN_OK)
        status = walk(s, grouping, mirrored, model->sample_count, params->particles);
    if (status == CAIRN_OK && !take_result(s, grouping, model, mirrored))
        status = CAIRN_NO_MEMORY;
    return status;
}

/* What the pieces of all segments come to. */
static int32_t count_tokens(const cairn_contour_tokens *tokens, cairn_real token)
{
    double count = 0;

    for (int32_t i = 0; i < tokens->count; i++)
        count += ceil((double)cairn_segment_length(tokens->lines[i]) / (double)token);
    return count < LEAST_TOKENS                ? LEAST_TOKENS
           : count > CAIRN_CONTOUR_TOKENS_MOST ? CAIRN_CONTOUR_TOKENS_MOST
                                               : (int32_t)count;
}

static cairn_status search_both(searcher *s, const cairn_shape_model *model, cairn_pool *pool,
                                const cairn_grouping_params *params)
{
    cairn_shape_model_file mirrored;
    cairn_mark mark;
    cairn_status status = cairn_pool_mark(pool, &mark);

    if (status == CAIRN_OK)
        status = search(s, model, 0, pool, params);
    if (status != CAIRN_OK || !s->params->mirror)
        return status;
    status = cairn_pool_release(pool, mark);
    if (status == CAIRN_OK)
        status = cairn_shape_model_file_copy(&mirrored, model);
    if (status != CAIRN_OK)
        return status;
    cairn_shape_model_file_mirror(&mirrored);
    status = search(s, &mirrored.model, 1, pool, params);
    cairn_shape_model_file_free(&mirrored);
    return status;
}

cairn_status cairn_contour_search_run(cairn_contour_result *result, const cairn_contour_tokens *tokens,
                                      const cairn_shape_model *model, const cairn_contour_search_params *params,
                                      const char *path, cairn_file_error *error)
{
    searcher s = {result, tokens, params};
    cairn_grouping_params grouping = params->grouping;
    cairn_status status;
    cairn_pool pool;
    void *memory;

    memset(result, 0, sizeof *result);
    grouping.max_width = tokens->width;
    grouping.max_height = tokens->height;
    grouping.max_tokens = grouping.token > 0 ? count_tokens(tokens, grouping.token) : 1;
    grouping.max_samples = model->sample_count;
    grouping.max_outline = model->outline_count;
    result->pool_bytes = cairn_grouping_memory(&grouping) + CAIRN_ALIGN;
    memory = malloc(result->pool_bytes);
    if (memory == NULL)
        return cairn_file_error_system(error, path, "search", ENOMEM);
    status = cairn_pool_init(&pool, memory, result->pool_bytes);
    if (status == CAIRN_OK)
        status = search_both(&s, model, &pool, &grouping);
    free(memory);
    if (status != CAIRN_OK) {
        cairn_contour_result_free(result);
        return cairn_file_error_set(error, status, path, 0, "%s, expected a model, sizes above 0 and turns in range",
                                    cairn_status_text(status));
    }
    keep_best(result);
    return CAIRN_OK;
}
