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

#include "src/base/step.h"
#include "src/detection/object_detect_object.h"

/* A chain whose ends are within this distance is closed, px. */
enum { MAX_CLOSING_GAP_PX = 3 };
/* Least spacing of samples of chains, px. */
static const cairn_real MIN_SAMPLE_STEP_PX = CAIRN_REAL(1.5);
/* Limit of search-tree nodes per vote. */
enum { MAX_NODES = 100000 };

/* As written: the threshold of summed similarities (section 5.3.1 gives none): one fragment
 * suffices when half of it is matched. Matches of any similarity vote. */
static const cairn_real MIN_SIMILARITY_SUM = CAIRN_REAL(0.5),
                        MIN_WRITTEN_SIMILARITY = CAIRN_REAL(1e-3);

/* Samples mirrored, votes cast in a unit; units of a hypothesis. */
enum { SAMPLES_PER_UNIT = 8, UNITS_PER_VOTE = 4, UNITS_PER_HYPOTHESIS = 200 };

/* ---- Chains ---- */

static cairn_vec2 middle_of(cairn_vec2 a, cairn_vec2 b)
{
    return cairn_vec2_scale(cairn_vec2_add(a, b), CAIRN_REAL(0.5));
}

void cairn_object_detect_add_chain(object_detect_chains *chains,
                                   const cairn_contour_search_tokens *tokens, int32_t from,
                                   int32_t to, cairn_vec2 *points)
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
}

/* ---- Memory ---- */

static cairn_part_bundle_params bundle_params(const cairn_object_detect_params *params)
{
    cairn_part_bundle_params bundle = cairn_part_bundle_default();

    bundle.max_points = params->max_outline;
    return bundle;
}

static cairn_fragment_match_params match_params(const cairn_object_detect_params *params)
{
    cairn_fragment_match_params match = cairn_fragment_match_default();

    match.max_chains = params->max_chains;
    match.min_step = MIN_SAMPLE_STEP_PX;
    match.max_samples = 8 + cairn_real_to_int(params->max_chain_length / MIN_SAMPLE_STEP_PX);
    match.matches_per_fragment = params->matches;
    match.min_scale = params->min_size;
    match.max_scale = params->max_size;
    if (cairn_object_detect_is_as_written(params))
        match.min_similarity = MIN_WRITTEN_SIMILARITY;
    return match;
}

static cairn_part_configuration_params
configuration_params(const cairn_object_detect_params *params)
{
    cairn_part_configuration_params configuration = cairn_part_configuration_default();

    if (cairn_object_detect_is_as_written(params)) {
        configuration = cairn_part_configuration_as_written();
        configuration.max_votes = CAIRN_PART_MAX_FRAGMENTS * params->matches;
        configuration.nearest = params->nearest;
        configuration.max_found = OBJECT_DETECT_MAX_WRITTEN_HYPOTHESES;
        configuration.min_sum = MIN_SIMILARITY_SUM;
        return configuration;
    }
    configuration.max_votes = CAIRN_PART_MAX_FRAGMENTS * params->matches;
    configuration.nearest = params->nearest;
    configuration.search = params->modes_only ? CAIRN_PART_SEARCH_MODES : CAIRN_PART_SEARCH_NEAREST;
    configuration.max_nodes = MAX_NODES;
    configuration.max_found = OBJECT_DETECT_MAX_HYPOTHESES / 2;
    return configuration;
}

static cairn_shape_context_params context_params(void)
{
    cairn_shape_context_params context = cairn_shape_context_default();

    context.max_points = OBJECT_DETECT_PART_POINTS;
    return context;
}

/* Greatest number of hypotheses, as written of the model alone. */
static size_t capacity_of(const cairn_object_detect_params *params)
{
    return cairn_object_detect_is_as_written(params) ? OBJECT_DETECT_MAX_WRITTEN_HYPOTHESES
                                                     : OBJECT_DETECT_MAX_HYPOTHESES;
}

/* Slots of the hash table of sets: a power of two, twice the configurations or more. */
static size_t slots_of(size_t sets)
{
    size_t slots = 2;

    while (slots < 2 * sets)
        slots *= 2;
    return slots;
}

static void take_arrays(object_detect_part_search *search, cairn_pool *pool,
                        const cairn_object_detect_params *params)
{
    int is_written = cairn_object_detect_is_as_written(params);
    size_t capacity = capacity_of(params), sets = is_written ? capacity : 0,
           slots = is_written ? slots_of(sets) : 0,
           votes = (size_t)CAIRN_PART_MAX_FRAGMENTS * (size_t)params->matches,
           samples = (size_t)cairn_part_bundle_default().samples_each;

    CAIRN_TAKE(search, pool, list, capacity);
    CAIRN_TAKE(search, pool, parts,
               capacity * (is_written ? CAIRN_PART_MAX_BUNDLES : OBJECT_DETECT_MAX_PARTS));
    CAIRN_TAKE(search, pool, first_outline, params->max_outline);
    CAIRN_TAKE(search, pool, samples, CAIRN_PART_MAX_FRAGMENTS * samples);
    CAIRN_TAKE(search, pool, votes, votes);
    CAIRN_TAKE(search, pool, match_of, votes);
    CAIRN_TAKE(search, pool, sets.chains, sets + 1);
    CAIRN_TAKE(search, pool, sets.slots, slots);
    if (search != NULL)
        search->sets.mask = (uint32_t)slots - 1;
}

void cairn_object_detect_parts_take(object_detect_part_search *search, cairn_pool *pool,
                                    const cairn_object_detect_params *params)
{
    cairn_part_bundle_params bundle = bundle_params(params);
    cairn_fragment_match_params match = match_params(params);
    cairn_part_configuration_params configuration = configuration_params(params);
    cairn_shape_context_params context = context_params();

    take_arrays(search, pool, params);
    CAIRN_TAKE_OBJECT(search, pool, builder, part_bundle, &bundle);
    CAIRN_TAKE_OBJECT(search, pool, matcher, fragment_match, &match);
    CAIRN_TAKE_OBJECT(search, pool, configurator, part_configuration, &configuration);
    CAIRN_TAKE_OBJECT(search, pool, context, shape_context, &context);
}

/* ---- Model, matches and votes ---- */

cairn_status cairn_object_detect_parts_begin(cairn_object_detector *detector)
{
    object_detect_part_search *search = &detector->parts;
    int32_t count = cairn_shape_model_first_outline(detector->model);

    search->count = search->part_count = search->bundles = 0;
    search->resume = search->compare_resume = search->units_charged = 0;
    if (count < 3)
        return CAIRN_EMPTY;
    for (int32_t i = 0; i < count; i++)
        search->first_outline[i] = detector->model->outline[i].position;
    return cairn_part_bundle_begin(search->builder, search->first_outline, count,
                                   detector->params.cuts, detector->params.cut_count);
}

static cairn_vec2 mirror(cairn_vec2 v)
{
    cairn_vec2 mirrored = {-v.x, v.y};

    return mirrored;
}

/* Sets the parts and the even points of all outlines, of the mirror image in its turn. */
static void set_model(cairn_object_detector *detector)
{
    object_detect_part_search *search = &detector->parts;
    int32_t outline_count = detector->model->outline_count, mirrored = search->mirrored;

    search->model = cairn_part_bundle_read(search->builder);
    search->bundles = search->model.bundle_count;
    search->outline_count =
        outline_count < OBJECT_DETECT_OUTLINE_POINTS ? outline_count : OBJECT_DETECT_OUTLINE_POINTS;
    for (int32_t i = 0; i < search->outline_count; i++) {
        cairn_vec2 p =
            detector->model->outline[(int64_t)i * outline_count / search->outline_count].position;

        search->outline[i] = mirrored ? mirror(p) : p;
    }
    if (!mirrored)
        return;
    for (int32_t i = 0; i < search->model.fragment_count * search->model.samples_each; i++) {
        search->samples[i].position = mirror(search->model.samples[i].position);
        search->samples[i].direction = mirror(search->model.samples[i].direction);
    }
    search->model.samples = search->samples;
    search->model.centroid = mirror(search->model.centroid);
}

/* Returns 1 for the longest fragment of its bundle; ties go to the first. */
static int is_longest(const cairn_object_detector *detector, int32_t fragment)
{
    const object_detect_part_search *search = &detector->parts;
    const cairn_part_bundle_fragment *own = &search->model.fragments[fragment];

    for (int32_t i = 0; i < search->model.fragment_count; i++) {
        const cairn_part_bundle_fragment *f = &search->model.fragments[i];

        if (f->bundle == own->bundle &&
            (i < fragment ? f->length >= own->length : f->length > own->length))
            return 0;
    }
    return 1;
}

/* Casts the votes of the matches; Returns their number. */
static int32_t cast_votes(cairn_object_detector *detector)
{
    object_detect_part_search *search = &detector->parts;
    const cairn_fragment_match_result *found = &search->matches;
    int32_t count = 0;

    for (int32_t i = 0; i < found->count; i++) {
        const cairn_fragment_match *match = &found->matches[i];
        const cairn_curve *chain = &detector->field->chains.curves[match->chain];
        const cairn_part_bundle_fragment *f = &search->model.fragments[match->fragment];
        cairn_part_configuration_vote *v = &search->votes[count];

        if (detector->params.bundles == CAIRN_OBJECT_DETECT_BUNDLES_OF_ONE &&
            !is_longest(detector, match->fragment))
            continue;
        v->bundle = detector->params.bundles == CAIRN_OBJECT_DETECT_NO_BUNDLES ? match->fragment
                                                                               : f->bundle;
        v->chain = match->chain;
        v->centre = match->centroid;
        v->scale = match->scale;
        v->weight = cairn_object_detect_is_as_written(&detector->params)
                        ? match->similarity
                        : match->similarity * f->length / search->model.length;
        v->from = match->from;
        v->to = match->to;
        v->closed_length = chain->closed ? cairn_curve_length(chain) : 0;
        search->match_of[count++] = i;
    }
    return count;
}

/* ---- Hypotheses ---- */

/* Point of a chain at an arc length, which continues round a closed chain. */
static cairn_vec2 point_along(const cairn_curve *chain, cairn_real along)
{
    int32_t sides = cairn_curve_side_count(chain);

    for (int32_t i = 0; i < 2 * sides; i++) {
        cairn_segment side = cairn_curve_side(chain, i % chain->count);
        cairn_real length = cairn_segment_length(side);

        if (along <= length && length > 0)
            return cairn_vec2_interpolate(side.a, side.b, along / length);
        if (!chain->closed && i + 1 == sides)
            break;
        along -= length;
    }
    return chain->points[chain->closed ? 0 : chain->count - 1];
}

/* Samples the matched pieces of a configuration's chains in the model's frame, as densely as the
 * outline, or as the capacity allows. */
static int32_t sample_parts(const cairn_object_detector *detector,
                            const object_detect_hypothesis *hypothesis, cairn_vec2 *points)
{
    const object_detect_part_search *search = &detector->parts;
    cairn_real step = search->model.length * hypothesis->size / (cairn_real)search->outline_count,
               length = 0;
    int32_t count = 0, capacity = OBJECT_DETECT_PART_POINTS -
                                  2 * hypothesis->part_count; /* besides the ends of each */

    for (int32_t i = 0; i < hypothesis->part_count; i++)
        length += search->parts[hypothesis->first_part + i].to -
                  search->parts[hypothesis->first_part + i].from;
    if (capacity > 0)
        step = cairn_max(step, length / (cairn_real)capacity);

    for (int32_t i = 0; i < hypothesis->part_count; i++) {
        const cairn_object_detect_part *part = &search->parts[hypothesis->first_part + i];
        int32_t here = capacity > 0 ? 1 + cairn_real_to_int((part->to - part->from) / step) : 1;

        for (int32_t k = 0; k <= here && count < OBJECT_DETECT_PART_POINTS; k++) {
            cairn_vec2 at = point_along(&detector->field->chains.curves[part->chain],
                                        part->from + (part->to - part->from) *
                                                         ((cairn_real)k / (cairn_real)here));

            points[count++] =
                cairn_vec2_scale(cairn_vec2_sub(at, hypothesis->origin), 1 / hypothesis->size);
        }
    }
    return count;
}

/* Share of the outline's length without a matched part. */
static cairn_real missing_share(const cairn_object_detector *detector,
                                const object_detect_hypothesis *hypothesis)
{
    const object_detect_part_search *search = &detector->parts;
    cairn_real matched = 0;
    uint32_t pieces = 0;

    for (int32_t i = 0; i < hypothesis->part_count; i++)
        pieces |=
            search->model.fragments[search->parts[hypothesis->first_part + i].fragment].pieces;
    for (int32_t i = 0; i < search->model.vertex_count; i++)
        matched += pieces >> i & 1 ? search->model.piece_length[i] : 0;
    return cairn_max(0, cairn_min(1, 1 - matched / search->model.length));
}

/* As written: compares the whole fragments with the whole outline. CAIRN_EMPTY: zero length. */
static cairn_status begin_whole(cairn_object_detector *detector,
                                object_detect_hypothesis *hypothesis)
{
    object_detect_part_search *search = &detector->parts;
    cairn_shape_context_input input = {.kind = CAIRN_SHAPE_CONTEXT_WHOLE,
                                       .first = search->points,
                                       .second = search->outline,
                                       .first_count = OBJECT_DETECT_OUTLINE_POINTS,
                                       .second_count = search->outline_count};

    if (!cairn_object_detect_written_sample(detector->field, hypothesis,
                                            &search->parts[hypothesis->first_part], search->points,
                                            OBJECT_DETECT_OUTLINE_POINTS))
        return CAIRN_EMPTY;
    return cairn_shape_context_begin(search->context, &input);
}

static cairn_status begin_pieces(cairn_object_detector *detector,
                                 const object_detect_hypothesis *hypothesis)
{
    object_detect_part_search *search = &detector->parts;
    cairn_shape_context_input input = {.kind = CAIRN_SHAPE_CONTEXT_PART,
                                       .first = search->points,
                                       .second = search->outline,
                                       .second_count = search->outline_count,
                                       .missing_share = missing_share(detector, hypothesis)};

    input.first_count = sample_parts(detector, hypothesis, search->points);
    return cairn_shape_context_begin(search->context, &input);
}

/* Makes the hypothesis of a configuration behind those that were kept. */
static void make_hypothesis(object_detect_part_search *search,
                            const cairn_part_configuration *configuration)
{
    object_detect_hypothesis *hypothesis = &search->list[search->count];

    hypothesis->mirrored = search->mirrored;
    hypothesis->size = configuration->scale;
    hypothesis->origin = cairn_vec2_sub(
        configuration->centre, cairn_vec2_scale(search->model.centroid, configuration->scale));
    hypothesis->agreement = configuration->score;
    hypothesis->first_part = search->part_count;
    hypothesis->part_count = configuration->count;
    for (int32_t i = 0; i < configuration->count; i++) {
        int32_t vote = search->configurations.votes[configuration->first + i];
        const cairn_fragment_match *match = &search->matches.matches[search->match_of[vote]];
        cairn_object_detect_part *part = &search->parts[search->part_count + i];

        part->bundle = search->model.fragments[match->fragment].bundle;
        part->fragment = match->fragment;
        part->chain = match->chain;
        part->reversed = match->reversed;
        part->similarity = match->similarity;
        part->from = match->from;
        part->to = match->to;
    }
}

/* Starts to compare the shape of the next hypothesis. CAIRN_EMPTY: it is left out, as written. */
static cairn_status begin_comparison(cairn_object_detector *detector)
{
    object_detect_part_search *search = &detector->parts;
    object_detect_hypothesis *hypothesis = &search->list[search->count];

    make_hypothesis(search, &search->configurations.found[search->cursor]);
    if (!cairn_object_detect_is_as_written(&detector->params))
        return begin_pieces(detector, hypothesis);
    if (!cairn_object_detect_chain_sets_add(&search->sets, &search->parts[hypothesis->first_part],
                                            hypothesis->part_count))
        return CAIRN_EMPTY;
    return begin_whole(detector, hypothesis);
}

/* Keeps the hypothesis that was compared. */
static void end_comparison(cairn_object_detector *detector)
{
    object_detect_part_search *search = &detector->parts;
    object_detect_hypothesis *hypothesis = &search->list[search->count];
    cairn_shape_context_result compared = cairn_shape_context_read(search->context);

    hypothesis->distance = cairn_object_detect_is_as_written(&detector->params)
                               ? compared.symmetric_distance
                               : compared.distance;
    hypothesis->score = 1 - hypothesis->distance;
    search->part_count += hypothesis->part_count;
    search->count++;
}

/* Makes and compares the hypotheses of all configurations. As written some are left out
 * (CAIRN_EMPTY). */
static int compare_all(cairn_object_detector *detector, cairn_budget *budget)
{
    object_detect_part_search *search = &detector->parts;

    CAIRN_STEP_BEGIN(search->compare_resume);
    for (search->cursor = 0; search->cursor < search->configurations.count; search->cursor++) {
        CAIRN_STEP_CHARGE(search, compare_resume, budget, UNITS_PER_HYPOTHESIS);
        detector->status = begin_comparison(detector);
        if (detector->status == CAIRN_OK)
            CAIRN_STEP_UNTIL(search->compare_resume, (detector->status = cairn_shape_context_step(
                                                          search->context, budget)) != CAIRN_MORE);
        if (detector->status == CAIRN_OK)
            end_comparison(detector);
        if (detector->status == CAIRN_EMPTY && cairn_object_detect_is_as_written(&detector->params))
            detector->status = CAIRN_OK;
        CAIRN_STEP_UNTIL(search->compare_resume, detector->status == CAIRN_OK);
    }
    CAIRN_STEP_END(search->compare_resume);
}

/* Units of setting the model. */
static int32_t units_of_model(void)
{
    return 1 +
           CAIRN_PART_MAX_FRAGMENTS * cairn_part_bundle_default().samples_each / SAMPLES_PER_UNIT;
}

/* See Method in the head of this file. */
int cairn_object_detect_parts_step(cairn_object_detector *detector, cairn_budget *budget)
{
    object_detect_part_search *search = &detector->parts;
    const object_detect_chains *chains = &detector->field->chains;

    CAIRN_STEP_BEGIN(search->resume);
    CAIRN_STEP_UNTIL(search->resume, (detector->status = cairn_part_bundle_step(
                                          search->builder, budget)) == CAIRN_OK);
    for (search->mirrored = 0; search->mirrored <= detector->params.mirror; search->mirrored++) {
        CAIRN_STEP_CHARGE(search, resume, budget, units_of_model());
        cairn_object_detect_report_stage(detector, CAIRN_OBJECT_DETECT_VOTES);
        set_model(detector);
        detector->status = cairn_fragment_match_begin(search->matcher, &search->model,
                                                      chains->curves, chains->count);
        CAIRN_STEP_UNTIL(search->resume, detector->status == CAIRN_OK);
        CAIRN_STEP_UNTIL(search->resume, (detector->status = cairn_fragment_match_step(
                                              search->matcher, budget)) == CAIRN_OK);
        search->matches = cairn_fragment_match_read(search->matcher);
        CAIRN_STEP_CHARGE(search, resume, budget, 1 + UNITS_PER_VOTE * search->matches.count);
        detector->status = cairn_part_configuration_begin(search->configurator, search->votes,
                                                          cast_votes(detector), NULL);
        CAIRN_STEP_UNTIL(search->resume, detector->status == CAIRN_OK);
        CAIRN_STEP_UNTIL(search->resume, (detector->status = cairn_part_configuration_step(
                                              search->configurator, budget)) == CAIRN_OK);
        search->configurations = cairn_part_configuration_read(search->configurator);
        cairn_object_detect_report_stage(detector, CAIRN_OBJECT_DETECT_SCORES);
        if (cairn_object_detect_is_as_written(&detector->params))
            cairn_object_detect_chain_sets_clear(&search->sets);
        CAIRN_STEP_UNTIL(search->resume, compare_all(detector, budget));
    }
    CAIRN_STEP_END(search->resume);
}
