/* Object hypotheses by parts of the outline (Adluru 2008, chapter 5).
 *
 * Method:
 * 1. The polylines of the edge chains are matched to the fragments of the model's outline, and of
 *    its mirror image (fragment_match).
 * 2. Every match votes for a position and a size. Its weight is its similarity times its share of
 *    the outline's length.
 * 3. The best configuration of the votes near each one is a hypothesis (part_configuration).
 * 4. The matched pieces of its chains are transformed to the model's frame and compared with the
 *    whole outline by shape contexts. Outline without a part counts as missing: score = 1 -
 *    distance.
 *
 * As written (CAIRN_MODE_AS_WRITTEN): all configurations of the K nearest of all votes whose
 * similarities sum to MIN_SIMILARITY_SUM or more; the whole edge fragments of each are compared
 * with the whole outline (object_detect_written.c).
 *
 * Source: Adluru 2008, sections 5.2.2 and 5.3.1; choices as stated in the headers of the
 * modules. */
#include "src/base/build.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/fragment_match.h"
#include "cairn/part_configuration.h"
#include "cairn/shape_context.h"
#include "src/host/detection/object_detect_work.h"

/* Points of the outline, and as written of a hypothesis, for the comparison; points of all parts of
 * a configuration. */
enum { OUTLINE_POINTS = 64, PART_POINTS = 128 };
/* A chain whose ends are within this distance is closed, px. */
#define MAX_CLOSING_GAP_PX 3
/* Least spacing of samples of chains, px. */
#define MIN_SAMPLE_STEP_PX CAIRN_REAL(1.5)
/* Limit of search-tree nodes per vote. */
enum { MAX_NODES = 100000 };

/* As written: the threshold of summed similarities (section 5.3.1 gives none): one fragment
 * suffices when half of it is matched. Matches of any similarity vote. */
#define MIN_SIMILARITY_SUM     CAIRN_REAL(0.5)
#define MIN_WRITTEN_SIMILARITY CAIRN_REAL(1e-3)

/* ---- Chains ---- */

static cairn_vec2 middle_of(cairn_vec2 a, cairn_vec2 b)
{
    return cairn_vec2_scale(cairn_vec2_add(a, b), CAIRN_REAL(0.5));
}

/* Creates the polyline through the consecutive segments `from` ... `to` - 1 of a chain. */
static void add_chain(object_detect_chains *chains, const cairn_contour_search_tokens *tokens,
                      int32_t from, int32_t to, cairn_vec2 *points)
{
    cairn_curve *curve = &chains->curves[tokens->chain[from]];
    cairn_vec2 first = tokens->lines[from].a, last = tokens->lines[to - 1].b;
    int32_t count = 0;

    points[count++] = first;
    for (int32_t i = from + 1; i < to; i++)
        points[count++] = middle_of(tokens->lines[i - 1].b, tokens->lines[i].a);
    if (to - from >= 3 && cairn_vec2_norm(cairn_vec2_sub(first, last)) <= MAX_CLOSING_GAP_PX) {
        points[0] = middle_of(first, last);
        curve->closed = 1;
    } else {
        points[count++] = last;
    }
    curve->points = points;
    curve->count = count;
    chains->max_length = cairn_max(chains->max_length, cairn_curve_length(curve));
}

int cairn_object_detect_chains_make(object_detect_chains *chains,
                                    const cairn_contour_search_tokens *tokens)
{
    cairn_vec2 *points;

    chains->count = tokens->chain_count;
    chains->max_length = 0;
    chains->curves = calloc((size_t)tokens->chain_count + 1, sizeof *chains->curves);
    chains->points = malloc(2 * ((size_t)tokens->count + 1) * sizeof *chains->points);
    if (chains->curves == NULL || chains->points == NULL)
        return 0;
    points = chains->points;
    for (int32_t from = 0, to; from < tokens->count; from = to) {
        for (to = from + 1; to < tokens->count && tokens->chain[to] == tokens->chain[from];)
            to++;
        add_chain(chains, tokens, from, to, points);
        points += to - from + 1;
    }
    return 1;
}

void cairn_object_detect_chains_free(object_detect_chains *chains)
{
    free(chains->curves);
    free(chains->points);
    memset(chains, 0, sizeof *chains);
}

/* ---- The search ---- */

typedef struct part_searcher {
    const cairn_object_detect_field *field;
    const cairn_shape_model *model;
    object_detect_hypotheses *made;
    int32_t mirrored;
    cairn_part_bundle_model parts; /* of the model or of its mirror image */
    cairn_oriented_point *samples;
    cairn_part_configuration_vote *votes;
    cairn_vec2 outline[OUTLINE_POINTS];
    int32_t outline_count;
    cairn_part_bundle_builder *builder;
    cairn_fragment_matcher *matcher;
    cairn_part_configurator *configurator;
    cairn_shape_context *context;
    object_detect_chain_sets sets; /* as written: sets of chains already compared */
} part_searcher;

/* Only the first outline has fragments. */
static cairn_part_bundle_params bundle_params(const part_searcher *searcher)
{
    cairn_part_bundle_params params = cairn_part_bundle_default();

    params.max_points = cairn_shape_model_first_outline(searcher->model);
    return params;
}

static cairn_fragment_match_params match_params(const part_searcher *searcher)
{
    const cairn_object_detect_field *f = searcher->field;
    cairn_fragment_match_params params = cairn_fragment_match_default();

    params.max_chains = f->chains.count > 0 ? f->chains.count : 1;
    params.min_step = MIN_SAMPLE_STEP_PX;
    params.max_samples = 8 + (int32_t)((double)f->chains.max_length / (double)MIN_SAMPLE_STEP_PX);
    params.matches_per_fragment = f->params.matches;
    params.min_scale = f->params.min_size;
    params.max_scale = f->params.max_size;
    if (cairn_object_detect_is_as_written(f))
        params.min_similarity = MIN_WRITTEN_SIMILARITY;
    return params;
}

static cairn_part_configuration_params configuration_params(const part_searcher *searcher)
{
    const cairn_object_detect_params *detect = &searcher->field->params;
    cairn_part_configuration_params params = cairn_part_configuration_default();

    if (cairn_object_detect_is_as_written(searcher->field)) {
        params = cairn_part_configuration_as_written();
        params.max_votes = CAIRN_PART_MAX_FRAGMENTS * detect->matches;
        params.nearest = detect->nearest;
        params.max_found = OBJECT_DETECT_MAX_WRITTEN_HYPOTHESES;
        params.min_sum = MIN_SIMILARITY_SUM;
        return params;
    }
    params.max_votes = CAIRN_PART_MAX_FRAGMENTS * detect->matches;
    params.nearest = detect->nearest;
    params.search = detect->modes_only ? CAIRN_PART_SEARCH_MODES : CAIRN_PART_SEARCH_NEAREST;
    params.max_nodes = MAX_NODES;
    params.max_found = OBJECT_DETECT_MAX_HYPOTHESES / 2;
    return params;
}

static cairn_shape_context_params context_params(void)
{
    cairn_shape_context_params params = cairn_shape_context_default();

    params.max_points = PART_POINTS;
    return params;
}

static cairn_status create(part_searcher *searcher, cairn_pool *pool, void **memory)
{
    cairn_part_bundle_params bundle = bundle_params(searcher);
    cairn_fragment_match_params match = match_params(searcher);
    cairn_part_configuration_params configuration = configuration_params(searcher);
    cairn_shape_context_params context = context_params();
    size_t bytes =
        CAIRN_ALIGN + cairn_part_bundle_memory(&bundle) + cairn_fragment_match_memory(&match) +
        cairn_part_configuration_memory(&configuration) + cairn_shape_context_memory(&context);
    cairn_status status;

    *memory = malloc(bytes);
    searcher->votes = malloc((size_t)configuration.max_votes * sizeof *searcher->votes);
    searcher->samples = malloc((size_t)CAIRN_PART_MAX_FRAGMENTS * (size_t)bundle.samples_each *
                               sizeof *searcher->samples);
    if (cairn_part_bundle_memory(&bundle) == 0)
        return bundle.max_points < 3 ? CAIRN_EMPTY : CAIRN_FULL;
    if (*memory == NULL || searcher->votes == NULL || searcher->samples == NULL)
        return CAIRN_NO_MEMORY;
    status = cairn_pool_init(pool, *memory, bytes);
    if (status == CAIRN_OK)
        status = cairn_part_bundle_create(&searcher->builder, pool, &bundle);
    if (status == CAIRN_OK)
        status = cairn_fragment_match_create(&searcher->matcher, pool, &match);
    if (status == CAIRN_OK)
        status = cairn_part_configuration_create(&searcher->configurator, pool, &configuration);
    if (status == CAIRN_OK)
        status = cairn_shape_context_create(&searcher->context, pool, &context);
    return status;
}

/* Computes the fragments of the model's first outline. */
static cairn_status cut_outline(part_searcher *searcher)
{
    int32_t count = cairn_shape_model_first_outline(searcher->model);
    cairn_vec2 *points = malloc((size_t)count * sizeof *points);
    cairn_status status = points != NULL ? CAIRN_OK : CAIRN_NO_MEMORY;
    cairn_budget budget;

    for (int32_t i = 0; i < count && points != NULL; i++)
        points[i] = searcher->model->outline[i].position;
    if (status == CAIRN_OK)
        status =
            cairn_part_bundle_begin(searcher->builder, points, count, searcher->field->params.cuts,
                                    searcher->field->params.cut_count);
    free(points);
    if (status != CAIRN_OK)
        return status;
    do {
        budget.left = CAIRN_UNBOUNDED;
        status = cairn_part_bundle_step(searcher->builder, &budget);
    } while (status == CAIRN_MORE);
    return status;
}

static cairn_vec2 mirror(cairn_vec2 v)
{
    cairn_vec2 mirrored = {-v.x, v.y};

    return mirrored;
}

/* Sets the parts and the even points of all outlines, mirrored on request. */
static void set_model(part_searcher *searcher, int32_t mirrored)
{
    int32_t outline_count = searcher->model->outline_count;

    searcher->mirrored = mirrored;
    searcher->parts = cairn_part_bundle_read(searcher->builder);
    searcher->outline_count = outline_count < OUTLINE_POINTS ? outline_count : OUTLINE_POINTS;
    for (int32_t i = 0; i < searcher->outline_count; i++) {
        cairn_vec2 p =
            searcher->model->outline[(int64_t)i * outline_count / searcher->outline_count].position;

        searcher->outline[i] = mirrored ? mirror(p) : p;
    }
    if (!mirrored)
        return;
    for (int32_t i = 0; i < searcher->parts.fragment_count * searcher->parts.samples_each; i++) {
        searcher->samples[i].position = mirror(searcher->parts.samples[i].position);
        searcher->samples[i].direction = mirror(searcher->parts.samples[i].direction);
    }
    searcher->parts.samples = searcher->samples;
    searcher->parts.centroid = mirror(searcher->parts.centroid);
}

static cairn_status match_fragments(part_searcher *searcher, cairn_fragment_match_result *found)
{
    const object_detect_chains *chains = &searcher->field->chains;
    cairn_budget budget;
    cairn_status status = cairn_fragment_match_begin(searcher->matcher, &searcher->parts,
                                                     chains->curves, chains->count);

    if (status != CAIRN_OK)
        return status;
    do {
        budget.left = CAIRN_UNBOUNDED;
        status = cairn_fragment_match_step(searcher->matcher, &budget);
    } while (status == CAIRN_MORE);
    *found = cairn_fragment_match_read(searcher->matcher);
    return status;
}

/* Returns 1 for the longest fragment of its bundle; ties go to the first. */
static int is_longest(const part_searcher *searcher, int32_t fragment)
{
    const cairn_part_bundle_fragment *own = &searcher->parts.fragments[fragment];

    for (int32_t i = 0; i < searcher->parts.fragment_count; i++) {
        const cairn_part_bundle_fragment *f = &searcher->parts.fragments[i];

        if (f->bundle == own->bundle &&
            (i < fragment ? f->length >= own->length : f->length > own->length))
            return 0;
    }
    return 1;
}

/* Casts the votes of the matches; match_of[]: match index of each vote. Returns their number. */
static int32_t cast_votes(part_searcher *searcher, const cairn_fragment_match_result *found,
                          int32_t *match_of)
{
    int32_t count = 0;

    for (int32_t i = 0; i < found->count; i++) {
        const cairn_fragment_match *match = &found->matches[i];
        const cairn_curve *chain = &searcher->field->chains.curves[match->chain];
        const cairn_part_bundle_fragment *f = &searcher->parts.fragments[match->fragment];
        cairn_part_configuration_vote *v = &searcher->votes[count];

        if (searcher->field->params.bundles == CAIRN_OBJECT_DETECT_BUNDLES_OF_ONE &&
            !is_longest(searcher, match->fragment))
            continue;
        v->bundle = searcher->field->params.bundles == CAIRN_OBJECT_DETECT_NO_BUNDLES
                        ? match->fragment
                        : f->bundle;
        v->chain = match->chain;
        v->centre = match->centroid;
        v->scale = match->scale;
        v->weight = cairn_object_detect_is_as_written(searcher->field)
                        ? match->similarity
                        : match->similarity * f->length / searcher->parts.length;
        v->from = match->from;
        v->to = match->to;
        v->closed_length = chain->closed ? cairn_curve_length(chain) : 0;
        match_of[count++] = i;
    }
    return count;
}

static cairn_status find_configurations(part_searcher *searcher, int32_t count,
                                        cairn_part_configuration_result *found)
{
    cairn_budget budget;
    cairn_status status =
        cairn_part_configuration_begin(searcher->configurator, searcher->votes, count, NULL);

    if (status != CAIRN_OK)
        return status;
    do {
        budget.left = CAIRN_UNBOUNDED;
        status = cairn_part_configuration_step(searcher->configurator, &budget);
    } while (status == CAIRN_MORE);
    *found = cairn_part_configuration_read(searcher->configurator);
    return status;
}

/* ---- Hypotheses ---- */

/* Point of a chain at an arc length, which continues round a closed chain. */
static cairn_vec2 point_along(const cairn_curve *chain, cairn_real along)
{
    int32_t sides = chain->closed ? chain->count : chain->count - 1;

    for (int32_t i = 0; i < 2 * sides; i++) {
        cairn_segment side = {chain->points[i % chain->count],
                              chain->points[(i + 1) % chain->count]};
        cairn_real length = cairn_segment_length(side);

        if (along <= length && length > 0)
            return cairn_vec2_add(side.a,
                                  cairn_vec2_scale(cairn_vec2_sub(side.b, side.a), along / length));
        if (!chain->closed && i + 1 == sides)
            break;
        along -= length;
    }
    return chain->points[chain->closed ? 0 : chain->count - 1];
}

/* Samples the matched pieces of a configuration's chains in the model's frame, as densely as the
 * outline, or as the capacity allows. */
static int32_t sample_parts(const part_searcher *searcher,
                            const object_detect_hypothesis *hypothesis, cairn_vec2 *points)
{
    cairn_real step =
                   searcher->parts.length * hypothesis->size / (cairn_real)searcher->outline_count,
               length = 0;
    int32_t count = 0,
            capacity = PART_POINTS - 2 * hypothesis->part_count; /* besides the ends of each */

    for (int32_t i = 0; i < hypothesis->part_count; i++)
        length += searcher->made->parts[hypothesis->first_part + i].to -
                  searcher->made->parts[hypothesis->first_part + i].from;
    if (capacity > 0)
        step = cairn_max(step, length / (cairn_real)capacity);

    for (int32_t i = 0; i < hypothesis->part_count; i++) {
        const cairn_object_detect_part *part = &searcher->made->parts[hypothesis->first_part + i];
        int32_t here =
            capacity > 0 ? 1 + (int32_t)((double)(part->to - part->from) / (double)step) : 1;

        for (int32_t k = 0; k <= here && count < PART_POINTS; k++) {
            cairn_vec2 at = point_along(&searcher->field->chains.curves[part->chain],
                                        part->from + (part->to - part->from) *
                                                         ((cairn_real)k / (cairn_real)here));

            points[count++] =
                cairn_vec2_scale(cairn_vec2_sub(at, hypothesis->origin), 1 / hypothesis->size);
        }
    }
    return count;
}

/* Share of the outline's length without a matched part. */
static cairn_real missing_share(const part_searcher *searcher,
                                const object_detect_hypothesis *hypothesis)
{
    cairn_real matched = 0;
    uint32_t pieces = 0;

    for (int32_t i = 0; i < hypothesis->part_count; i++)
        pieces |=
            searcher->parts.fragments[searcher->made->parts[hypothesis->first_part + i].fragment]
                .pieces;
    for (int32_t i = 0; i < searcher->parts.vertex_count; i++)
        matched += pieces >> i & 1 ? searcher->parts.piece_length[i] : 0;
    return cairn_max(0, cairn_min(1, 1 - matched / searcher->parts.length));
}

static cairn_status run_context(part_searcher *searcher, const cairn_shape_context_input *input)
{
    cairn_status status = cairn_shape_context_begin(searcher->context, input);
    cairn_budget budget;

    if (status != CAIRN_OK)
        return status;
    do {
        budget.left = CAIRN_UNBOUNDED;
        status = cairn_shape_context_step(searcher->context, &budget);
    } while (status == CAIRN_MORE);
    return status;
}

/* As written: compares the whole fragments with the whole outline. CAIRN_EMPTY: zero length. */
static cairn_status compare_whole(part_searcher *searcher, object_detect_hypothesis *hypothesis)
{
    cairn_vec2 points[OUTLINE_POINTS];
    cairn_shape_context_input input = {.kind = CAIRN_SHAPE_CONTEXT_WHOLE,
                                       .first = points,
                                       .second = searcher->outline,
                                       .first_count = OUTLINE_POINTS,
                                       .second_count = searcher->outline_count};
    cairn_status status;

    if (!cairn_object_detect_written_sample(searcher->field, hypothesis,
                                            &searcher->made->parts[hypothesis->first_part], points,
                                            OUTLINE_POINTS))
        return CAIRN_EMPTY;
    status = run_context(searcher, &input);
    hypothesis->distance = cairn_shape_context_read(searcher->context).symmetric_distance;
    return status;
}

static cairn_status compare_shapes(part_searcher *searcher, object_detect_hypothesis *hypothesis)
{
    cairn_vec2 points[PART_POINTS];
    cairn_shape_context_input input = {.kind = CAIRN_SHAPE_CONTEXT_PART,
                                       .first = points,
                                       .second = searcher->outline,
                                       .second_count = searcher->outline_count,
                                       .missing_share = missing_share(searcher, hypothesis)};
    cairn_status status;

    input.first_count = sample_parts(searcher, hypothesis, points);
    status = run_context(searcher, &input);
    hypothesis->distance = cairn_shape_context_read(searcher->context).distance;
    return status;
}

static cairn_status add_hypothesis(part_searcher *searcher,
                                   const cairn_part_configuration *configuration,
                                   const int32_t *votes, const cairn_fragment_match *matches,
                                   const int32_t *match_of)
{
    object_detect_hypothesis *hypothesis = &searcher->made->list[searcher->made->count];
    cairn_status status;

    hypothesis->mirrored = searcher->mirrored;
    hypothesis->size = configuration->scale;
    hypothesis->origin = cairn_vec2_sub(
        configuration->centre, cairn_vec2_scale(searcher->parts.centroid, configuration->scale));
    hypothesis->agreement = configuration->score;
    hypothesis->first_part = searcher->made->part_count;
    hypothesis->part_count = configuration->count;
    for (int32_t i = 0; i < configuration->count; i++) {
        const cairn_fragment_match *match = &matches[match_of[votes[configuration->first + i]]];
        cairn_object_detect_part *part = &searcher->made->parts[searcher->made->part_count + i];

        part->bundle = searcher->parts.fragments[match->fragment].bundle;
        part->fragment = match->fragment;
        part->chain = match->chain;
        part->reversed = match->reversed;
        part->similarity = match->similarity;
        part->from = match->from;
        part->to = match->to;
    }
    if (cairn_object_detect_is_as_written(searcher->field) &&
        !cairn_object_detect_chain_sets_add(&searcher->sets,
                                            &searcher->made->parts[hypothesis->first_part],
                                            hypothesis->part_count))
        return CAIRN_OK;
    status = cairn_object_detect_is_as_written(searcher->field)
                 ? compare_whole(searcher, hypothesis)
                 : compare_shapes(searcher, hypothesis);
    if (status == CAIRN_EMPTY && cairn_object_detect_is_as_written(searcher->field))
        return CAIRN_OK;
    if (status != CAIRN_OK)
        return status;
    hypothesis->score = 1 - hypothesis->distance;
    searcher->made->part_count += configuration->count;
    searcher->made->count++;
    return CAIRN_OK;
}

/* Searches the model, or its mirror image. */
static cairn_status search(part_searcher *searcher, int32_t mirrored, int32_t *match_of)
{
    cairn_part_configuration_result configurations = {.count = 0};
    cairn_fragment_match_result matches = {.count = 0};
    cairn_status status;

    cairn_object_detect_report_stage(searcher->field, CAIRN_OBJECT_DETECT_VOTES);
    set_model(searcher, mirrored);
    status = match_fragments(searcher, &matches);
    if (status == CAIRN_OK)
        status = find_configurations(searcher, cast_votes(searcher, &matches, match_of),
                                     &configurations);
    cairn_object_detect_report_stage(searcher->field, CAIRN_OBJECT_DETECT_SCORES);
    if (status == CAIRN_OK && cairn_object_detect_is_as_written(searcher->field) &&
        !cairn_object_detect_chain_sets_begin(&searcher->sets, configurations.count))
        status = CAIRN_NO_MEMORY;
    for (int32_t i = 0; status == CAIRN_OK && i < configurations.count; i++)
        status = add_hypothesis(searcher, &configurations.found[i], configurations.votes,
                                matches.matches, match_of);
    cairn_object_detect_chain_sets_free(&searcher->sets);
    return status;
}

cairn_status cairn_object_detect_parts(object_detect_hypotheses *hypotheses,
                                       const cairn_object_detect_field *field,
                                       const cairn_shape_model *model)
{
    part_searcher searcher = {.field = field, .model = model, .made = hypotheses};
    int written = cairn_object_detect_is_as_written(field);
    size_t capacity =
        written ? 2 * OBJECT_DETECT_MAX_WRITTEN_HYPOTHESES : OBJECT_DETECT_MAX_HYPOTHESES;
    int32_t *match_of =
        malloc((size_t)CAIRN_PART_MAX_FRAGMENTS * (size_t)field->params.matches * sizeof *match_of);
    cairn_status status = CAIRN_NO_MEMORY;
    void *memory = NULL;
    cairn_pool pool;

    memset(hypotheses, 0, sizeof *hypotheses);
    hypotheses->list = malloc(capacity * sizeof *hypotheses->list);
    hypotheses->parts =
        malloc(capacity * (written ? CAIRN_PART_MAX_BUNDLES : OBJECT_DETECT_MAX_PARTS) *
               sizeof *hypotheses->parts);
    if (hypotheses->list != NULL && hypotheses->parts != NULL && match_of != NULL)
        status = create(&searcher, &pool, &memory);
    if (status == CAIRN_OK)
        status = cut_outline(&searcher);
    for (int32_t mirrored = 0; status == CAIRN_OK && mirrored < (field->params.mirror ? 2 : 1);
         mirrored++)
        status = search(&searcher, mirrored, match_of);
    hypotheses->bundles = searcher.parts.bundle_count;
    free(match_of);
    free(searcher.votes);
    free(searcher.samples);
    free(memory);
    if (status != CAIRN_OK)
        cairn_object_detect_parts_free(hypotheses);
    return status;
}

void cairn_object_detect_parts_free(object_detect_hypotheses *hypotheses)
{
    free(hypotheses->list);
    free(hypotheses->parts);
    memset(hypotheses, 0, sizeof *hypotheses);
}
