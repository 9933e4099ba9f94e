/* Hypotheses of an object by the parts of its outline (Adluru 2008, chapter 5).
 *
 * Method: the polylines of the edges' chains are matched with the fragments of the model's outline (fragment_match), also with those of its mirror
 * image. Every match votes for a place and a size; its gain is its similarity times the share of the outline that it stands for. Of the
 * votes near each one the best configuration is taken (part_configuration). What of the chains it is made of is laid into the frame of the
 * model and compared with the whole outline by its shape contexts, what no part stands for counted as missing: score = 1 - distance.
 *
 * As written (CAIRN_MODE_AS_WRITTEN): all configurations of the K nearest of all votes whose similarities sum to LEAST_SUM or more; the whole edge
 * fragments of each are compared with the whole outline (object_detect_written.c).
 *
 * Source: Adluru 2008, sections 5.2.2 and 5.3.1; as settled in the heads of the rooms. */
#include "src/core/build.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/fragment_match.h"
#include "cairn/part_configuration.h"
#include "cairn/shape_context.h"
#include "src/host/object_detect_work.h"

/* Points of the outline that are compared, as written of a hypothesis, too; and of all parts of a configuration. */
enum { OUTLINE_POINTS = 64, PART_POINTS = 128 };
/* Two ends of a chain so near, in pixels, are one: the chain is closed. */
#define CLOSED 3
/* px between samples of chains, least. */
#define STEP CAIRN_REAL(1.5)
/* Configurations that are visited near one vote, at most. */
enum { NODES_MOST = 100000 };

/* As written: the threshold of summed similarities (section 5.3.1 names none): a fragment alone is enough when half of it is matched; matches of any
 * similarity vote. */
#define LEAST_SUM      CAIRN_REAL(0.5)
#define ANY_SIMILARITY CAIRN_REAL(1e-3)

/* ---- Chains ---- */

static cairn_vec2 middle_of(cairn_vec2 a, cairn_vec2 b)
{
    return cairn_vec2_scale(cairn_vec2_add(a, b), CAIRN_REAL(0.5));
}

/* The polyline through the segments `from` ... `to` - 1 of a chain, which follow each other. */
static void add_chain(detect_chains *c, const cairn_contour_tokens *t, int32_t from, int32_t to, cairn_vec2 *points)
{
    cairn_curve *curve = &c->curves[t->chain[from]];
    cairn_vec2 first = t->lines[from].a, last = t->lines[to - 1].b;
    int32_t count = 0;

    points[count++] = first;
    for (int32_t i = from + 1; i < to; i++)
        points[count++] = middle_of(t->lines[i - 1].b, t->lines[i].a);
    if (to - from >= 3 && cairn_vec2_norm(cairn_vec2_sub(first, last)) <= CLOSED) {
        points[0] = middle_of(first, last);
        curve->closed = 1;
    } else {
        points[count++] = last;
    }
    curve->points = points;
    curve->count = count;
    c->longest = cairn_max(c->longest, cairn_curve_length(curve));
}

int cairn_detect_chains_make(detect_chains *c, const cairn_contour_tokens *tokens)
{
    cairn_vec2 *points;

    c->count = tokens->chains;
    c->longest = 0;
    c->curves = calloc((size_t)tokens->chains + 1, sizeof *c->curves);
    c->points = malloc(2 * ((size_t)tokens->count + 1) * sizeof *c->points);
    if (c->curves == NULL || c->points == NULL)
        return 0;
    points = c->points;
    for (int32_t from = 0, to; from < tokens->count; from = to) {
        for (to = from + 1; to < tokens->count && tokens->chain[to] == tokens->chain[from];)
            to++;
        add_chain(c, tokens, from, to, points);
        points += to - from + 1;
    }
    return 1;
}

void cairn_detect_chains_free(detect_chains *c)
{
    free(c->curves);
    free(c->points);
    memset(c, 0, sizeof *c);
}

/* ---- The search ---- */

typedef struct searcher {
    const cairn_detect_field *field;
    const cairn_shape_model *model;
    detect_hypotheses *made;
    int32_t mirrored;
    cairn_part_model parts; /* of the model as it is, or mirrored */
    cairn_oriented_point *samples;
    cairn_part_vote *votes;
    cairn_vec2 outline[OUTLINE_POINTS];
    int32_t outline_count;
    cairn_part_builder *builder;
    cairn_fragment_matcher *matcher;
    cairn_part_configurator *configurator;
    cairn_shape_context *context;
    detect_chain_sets sets; /* as written: what was compared */
} searcher;

/* Of the first outline, which alone has fragments. */
static cairn_part_bundle_params bundle_params(const searcher *s)
{
    cairn_part_bundle_params params = cairn_part_bundle_default();

    params.max_points = cairn_shape_first_outline(s->model);
    return params;
}

static cairn_fragment_match_params match_params(const searcher *s)
{
    const cairn_detect_field *f = s->field;
    cairn_fragment_match_params params = cairn_fragment_match_default();

    params.max_chains = f->chains.count > 0 ? f->chains.count : 1;
    params.min_step = STEP;
    params.max_samples = 8 + (int32_t)((double)f->chains.longest / (double)STEP);
    params.matches_each = f->params.matches;
    params.min_scale = f->params.min_size;
    params.max_scale = f->params.max_size;
    if (cairn_detect_is_as_written(f))
        params.min_similarity = ANY_SIMILARITY;
    return params;
}

static cairn_part_configuration_params configuration_params(const searcher *s)
{
    const cairn_object_detect_params *p = &s->field->params;
    cairn_part_configuration_params params = cairn_part_configuration_default();

    if (cairn_detect_is_as_written(s->field)) {
        params = cairn_part_configuration_as_written();
        params.max_votes = CAIRN_PART_FRAGMENTS * p->matches;
        params.nearest = p->nearest;
        params.max_found = DETECT_WRITTEN;
        params.min_sum = LEAST_SUM;
        return params;
    }
    params.max_votes = CAIRN_PART_FRAGMENTS * p->matches;
    params.nearest = p->nearest;
    params.seek = p->modes ? CAIRN_PART_SEEK_MODES : CAIRN_PART_SEEK_NEAREST;
    params.max_nodes = NODES_MOST;
    params.max_found = DETECT_HYPOTHESES / 2;
    return params;
}

static cairn_shape_context_params context_params(void)
{
    cairn_shape_context_params params = cairn_shape_context_default();

    params.max_points = PART_POINTS;
    return params;
}

static cairn_status create(searcher *s, cairn_pool *pool, void **memory)
{
    cairn_part_bundle_params bundle = bundle_params(s);
    cairn_fragment_match_params match = match_params(s);
    cairn_part_configuration_params configuration = configuration_params(s);
    cairn_shape_context_params context = context_params();
    size_t bytes = CAIRN_ALIGN + cairn_part_bundle_memory(&bundle) + cairn_fragment_match_memory(&match) +
                   cairn_part_configuration_memory(&configuration) + cairn_shape_context_memory(&context);
    cairn_status status;

    *memory = malloc(bytes);
    s->votes = malloc((size_t)configuration.max_votes * sizeof *s->votes);
    s->samples = malloc((size_t)CAIRN_PART_FRAGMENTS * (size_t)bundle.samples_each * sizeof *s->samples);
    if (cairn_part_bundle_memory(&bundle) == 0)
        return bundle.max_points < 3 ? CAIRN_EMPTY : CAIRN_FULL;
    if (*memory == NULL || s->votes == NULL || s->samples == NULL)
        return CAIRN_NO_MEMORY;
    status = cairn_pool_init(pool, *memory, bytes);
    if (status == CAIRN_OK)
        status = cairn_part_bundle_create(&s->builder, pool, &bundle);
    if (status == CAIRN_OK)
        status = cairn_fragment_match_create(&s->matcher, pool, &match);
    if (status == CAIRN_OK)
        status = cairn_part_configuration_create(&s->configurator, pool, &configuration);
    if (status == CAIRN_OK)
        status = cairn_shape_context_create(&s->context, pool, &context);
    return status;
}

/* The fragments of the model's first outline. */
static cairn_status cut_outline(searcher *s)
{
    int32_t count = cairn_shape_first_outline(s->model);
    cairn_vec2 *points = malloc((size_t)count * sizeof *points);
    cairn_status status = points != NULL ? CAIRN_OK : CAIRN_NO_MEMORY;
    cairn_budget budget;

    for (int32_t i = 0; i < count && points != NULL; i++)
        points[i] = s->model->outline[i].position;
    if (status == CAIRN_OK)
        status = cairn_part_bundle_begin(s->builder, points, count, s->field->params.cuts, s->field->params.cut_count);
    free(points);
    if (status != CAIRN_OK)
        return status;
    do {
        budget.left = CAIRN_UNBOUNDED;
        status = cairn_part_bundle_step(s->builder, &budget);
    } while (status == CAIRN_MORE);
    return status;
}

static cairn_vec2 mirror(cairn_vec2 v)
{
    cairn_vec2 mirrored = {-v.x, v.y};

    return mirrored;
}

/* The parts and even points of all outlines, as they are or mirrored. */
static void turn_model(searcher *s, int32_t mirrored)
{
    int32_t all = s->model->outline_count;

    s->mirrored = mirrored;
    s->parts = cairn_part_bundle_read(s->builder);
    s->outline_count = all < OUTLINE_POINTS ? all : OUTLINE_POINTS;
    for (int32_t i = 0; i < s->outline_count; i++) {
        cairn_vec2 p = s->model->outline[(int64_t)i * all / s->outline_count].position;

        s->outline[i] = mirrored ? mirror(p) : p;
    }
    if (!mirrored)
        return;
    for (int32_t i = 0; i < s->parts.fragment_count * s->parts.samples_each; i++) {
        s->samples[i].position = mirror(s->parts.samples[i].position);
        s->samples[i].direction = mirror(s->parts.samples[i].direction);
    }
    s->parts.samples = s->samples;
    s->parts.centroid = mirror(s->parts.centroid);
}

static cairn_status match(searcher *s, cairn_fragment_match_result *found)
{
    const detect_chains *chains = &s->field->chains;
    cairn_budget budget;
    cairn_status status = cairn_fragment_match_begin(s->matcher, &s->parts, chains->curves, chains->count);

    if (status != CAIRN_OK)
        return status;
    do {
        budget.left = CAIRN_UNBOUNDED;
        status = cairn_fragment_match_step(s->matcher, &budget);
    } while (status == CAIRN_MORE);
    *found = cairn_fragment_match_read(s->matcher);
    return status;
}

/* The longest fragment of its bundle, of equal ones the first. */
static int is_longest(const searcher *s, int32_t fragment)
{
    const cairn_part_fragment *own = &s->parts.fragments[fragment];

    for (int32_t i = 0; i < s->parts.fragment_count; i++) {
        const cairn_part_fragment *f = &s->parts.fragments[i];

        if (f->bundle == own->bundle && (i < fragment ? f->length >= own->length : f->length > own->length))
            return 0;
    }
    return 1;
}

/* Votes of the matches, match_of[] of which each. */
static int32_t vote(searcher *s, const cairn_fragment_match_result *found, int32_t *match_of)
{
    int32_t count = 0;

    for (int32_t i = 0; i < found->count; i++) {
        const cairn_fragment_match *m = &found->matches[i];
        const cairn_curve *chain = &s->field->chains.curves[m->chain];
        const cairn_part_fragment *f = &s->parts.fragments[m->fragment];
        cairn_part_vote *v = &s->votes[count];

        if (s->field->params.bundles == CAIRN_DETECT_BUNDLES_OF_ONE && !is_longest(s, m->fragment))
            continue;
        v->bundle = s->field->params.bundles == CAIRN_DETECT_NO_BUNDLES ? m->fragment : f->bundle;
        v->chain = m->chain;
        v->centre = m->centre;
        v->scale = m->scale;
        v->gain = cairn_detect_is_as_written(s->field) ? m->similarity : m->similarity * f->length / s->parts.length;
        v->from = m->from;
        v->to = m->to;
        v->round = chain->closed ? cairn_curve_length(chain) : 0;
        match_of[count++] = i;
    }
    return count;
}

static cairn_status configure(searcher *s, int32_t count, cairn_part_configuration_result *found)
{
    cairn_budget budget;
    cairn_status status = cairn_part_configuration_begin(s->configurator, s->votes, count, NULL);

    if (status != CAIRN_OK)
        return status;
    do {
        budget.left = CAIRN_UNBOUNDED;
        status = cairn_part_configuration_step(s->configurator, &budget);
    } while (status == CAIRN_MORE);
    *found = cairn_part_configuration_read(s->configurator);
    return status;
}

/* ---- Hypotheses ---- */

/* The point of a chain so far along it; of a closed one on into the next round. */
static cairn_vec2 point_along(const cairn_curve *chain, cairn_real along)
{
    int32_t sides = chain->closed ? chain->count : chain->count - 1;

    for (int32_t i = 0; i < 2 * sides; i++) {
        cairn_segment side = {chain->points[i % chain->count], chain->points[(i + 1) % chain->count]};
        cairn_real length = cairn_segment_length(side);

        if (along <= length && length > 0)
            return cairn_vec2_add(side.a, cairn_vec2_scale(cairn_vec2_sub(side.b, side.a), along / length));
        if (!chain->closed && i + 1 == sides)
            break;
        along -= length;
    }
    return chain->points[chain->closed ? 0 : chain->count - 1];
}

/* What of the chains a configuration is made of, as points in the frame of the model, as close as those of its outline, or as room
 * allows for all of them. */
static int32_t lay_parts(const searcher *s, const detect_hypothesis *h, cairn_vec2 *points)
{
    cairn_real step = s->parts.length * h->size / (cairn_real)s->outline_count, all = 0;
    int32_t count = 0, room = PART_POINTS - 2 * h->part_count; /* besides the ends of each */

    for (int32_t i = 0; i < h->part_count; i++)
        all += s->made->parts[h->first_part + i].to - s->made->parts[h->first_part + i].from;
    if (room > 0)
        step = cairn_max(step, all / (cairn_real)room);

    for (int32_t i = 0; i < h->part_count; i++) {
        const cairn_detected_part *p = &s->made->parts[h->first_part + i];
        int32_t here = room > 0 ? 1 + (int32_t)((double)(p->to - p->from) / (double)step) : 1;

        for (int32_t k = 0; k <= here && count < PART_POINTS; k++) {
            cairn_vec2 at = point_along(&s->field->chains.curves[p->chain],
                                        p->from + (p->to - p->from) * ((cairn_real)k / (cairn_real)here));

            points[count++] = cairn_vec2_scale(cairn_vec2_sub(at, h->origin), 1 / h->size);
        }
    }
    return count;
}

/* The share of the outline for which no part stands. */
static cairn_real missing_share(const searcher *s, const detect_hypothesis *h)
{
    cairn_real seen = 0;
    uint32_t pieces = 0;

    for (int32_t i = 0; i < h->part_count; i++)
        pieces |= s->parts.fragments[s->made->parts[h->first_part + i].fragment].pieces;
    for (int32_t i = 0; i < s->parts.vertex_count; i++)
        seen += pieces >> i & 1 ? s->parts.piece_length[i] : 0;
    return cairn_max(0, cairn_min(1, 1 - seen / s->parts.length));
}

static cairn_status run_context(searcher *s, const cairn_shape_context_input *input)
{
    cairn_status status = cairn_shape_context_begin(s->context, input);
    cairn_budget budget;

    if (status != CAIRN_OK)
        return status;
    do {
        budget.left = CAIRN_UNBOUNDED;
        status = cairn_shape_context_step(s->context, &budget);
    } while (status == CAIRN_MORE);
    return status;
}

/* As written: whole against whole. CAIRN_EMPTY: there is no shape. */
static cairn_status compare_whole(searcher *s, detect_hypothesis *h)
{
    cairn_vec2 points[OUTLINE_POINTS];
    cairn_shape_context_input input = {.kind = CAIRN_SHAPE_CONTEXT_WHOLE,
                                       .first = points,
                                       .second = s->outline,
                                       .first_count = OUTLINE_POINTS,
                                       .second_count = s->outline_count};
    cairn_status status;

    if (!cairn_detect_written_lay(s->field, h, &s->made->parts[h->first_part], points, OUTLINE_POINTS))
        return CAIRN_EMPTY;
    status = run_context(s, &input);
    h->distance = cairn_shape_context_read(s->context).symmetric;
    return status;
}

static cairn_status compare_shapes(searcher *s, detect_hypothesis *h)
{
    cairn_vec2 points[PART_POINTS];
    cairn_shape_context_input input = {.kind = CAIRN_SHAPE_CONTEXT_PART,
                                       .first = points,
                                       .second = s->outline,
                                       .second_count = s->outline_count,
                                       .missing_share = missing_share(s, h)};
    cairn_status status;

    input.first_count = lay_parts(s, h, points);
    status = run_context(s, &input);
    h->distance = cairn_shape_context_read(s->context).distance;
    return status;
}

static cairn_status add_hypothesis(searcher *s, const cairn_part_configuration *c, const int32_t *votes,
                                   const cairn_fragment_match *matches, const int32_t *match_of)
{
    detect_hypothesis *h = &s->made->list[s->made->count];
    cairn_status status;

    h->mirrored = s->mirrored;
    h->size = c->scale;
    h->origin = cairn_vec2_sub(c->centre, cairn_vec2_scale(s->parts.centroid, c->scale));
    h->agreement = c->score;
    h->first_part = s->made->part_count;
    h->part_count = c->count;
    for (int32_t i = 0; i < c->count; i++) {
        const cairn_fragment_match *m = &matches[match_of[votes[c->first + i]]];
        cairn_detected_part *p = &s->made->parts[s->made->part_count + i];

        p->bundle = s->parts.fragments[m->fragment].bundle;
        p->fragment = m->fragment;
        p->chain = m->chain;
        p->reversed = m->reversed;
        p->similarity = m->similarity;
        p->from = m->from;
        p->to = m->to;
    }
    if (cairn_detect_is_as_written(s->field) &&
        !cairn_detect_chain_sets_add(&s->sets, &s->made->parts[h->first_part], h->part_count))
        return CAIRN_OK;
    status = cairn_detect_is_as_written(s->field) ? compare_whole(s, h) : compare_shapes(s, h);
    if (status == CAIRN_EMPTY && cairn_detect_is_as_written(s->field))
        return CAIRN_OK;
    if (status != CAIRN_OK)
        return status;
    h->score = 1 - h->distance;
    s->made->part_count += c->count;
    s->made->count++;
    return CAIRN_OK;
}

/* Of the model as it is, or mirrored. */
static cairn_status search(searcher *s, int32_t mirrored, int32_t *match_of)
{
    cairn_part_configuration_result configurations = {.count = 0};
    cairn_fragment_match_result matches = {.count = 0};
    cairn_status status;

    cairn_detect_tell(s->field, CAIRN_DETECT_VOTES);
    turn_model(s, mirrored);
    status = match(s, &matches);
    if (status == CAIRN_OK)
        status = configure(s, vote(s, &matches, match_of), &configurations);
    cairn_detect_tell(s->field, CAIRN_DETECT_SCORES);
    if (status == CAIRN_OK && cairn_detect_is_as_written(s->field) &&
        !cairn_detect_chain_sets_begin(&s->sets, configurations.count))
        status = CAIRN_NO_MEMORY;
    for (int32_t i = 0; status == CAIRN_OK && i < configurations.count; i++)
        status = add_hypothesis(s, &configurations.found[i], configurations.votes, matches.matches, match_of);
    cairn_detect_chain_sets_free(&s->sets);
    return status;
}

cairn_status cairn_detect_parts(detect_hypotheses *made, const cairn_detect_field *field,
                                const cairn_shape_model *model)
{
    searcher s = {.field = field, .model = model, .made = made};
    int written = cairn_detect_is_as_written(field);
    size_t most = written ? 2 * DETECT_WRITTEN : DETECT_HYPOTHESES;
    int32_t *match_of = malloc((size_t)CAIRN_PART_FRAGMENTS * (size_t)field->params.matches * sizeof *match_of);
    cairn_status status = CAIRN_NO_MEMORY;
    void *memory = NULL;
    cairn_pool pool;

    memset(made, 0, sizeof *made);
    made->list = malloc(most * sizeof *made->list);
    made->parts = malloc(most * (written ? CAIRN_PART_BUNDLES : DETECT_PARTS_MOST) * sizeof *made->parts);
    if (made->list != NULL && made->parts != NULL && match_of != NULL)
        status = create(&s, &pool, &memory);
    if (status == CAIRN_OK)
        status = cut_outline(&s);
    for (int32_t mirrored = 0; status == CAIRN_OK && mirrored < (field->params.mirror ? 2 : 1); mirrored++)
        status = search(&s, mirrored, match_of);
    made->bundles = s.parts.bundles;
    free(match_of);
    free(s.votes);
    free(s.samples);
    free(memory);
    if (status != CAIRN_OK)
        cairn_detect_parts_free(made);
    return status;
}

void cairn_detect_parts_free(detect_hypotheses *made)
{
    free(made->list);
    free(made->parts);
    memset(made, 0, sizeof *made);
}
