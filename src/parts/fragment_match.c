/* Local alignment of outline fragments and edge chains.
 *
 * Method:
 * 1. Chains are sampled evenly at steps in a geometric series. At each step a fragment of n samples
 *    has one scale, at which both have equal sampling distances.
 * 2. Directions are central differences, quantized to 1024 per turn. A pair scores 1 - |turn| /
 *    zero_score_angle in fixed point, so that sums are exact.
 * 3. Smith-Waterman: the table is filled one chain sample after the other with one stored column;
 *    only the best end of each chain is recorded. Chains too short for the least similarity are
 *    skipped, since each sample scores 1 at most.
 * 4. The alignment of each recorded end is traced back (module sequence) in the 3 n samples before
 *    the end: n pairs score n at most, and 2 n gaps of at least 0.5 cost as much.
 * 5. Least-squares scale and centroid.
 *
 * A closed chain of at least n samples is extended by n - 1 samples beyond its first point; an
 * alignment longer than one turn is dropped. A shorter closed chain is treated as open.
 *
 * Memory layout: direction codes of the fragments in both orientations and of one chain; a column;
 * the matches of each fragment in order; the aligner.
 *
 * Limits: one alignment for each fragment, chain, orientation and step; one match for each fragment
 * and chain. No rotation.
 *
 * Source: Adluru 2008, section 5.2.2; steps, ties and closed chains: this project's. */
#include "src/base/build.h"

#include "src/parts/fragment_match_work.h"

enum {
    MAX_FRAGMENTS = 1 << 16,
    MAX_CHAINS = 1 << 24,
    MAX_CHAIN_SAMPLES = 1 << 20,
    MAX_MATCHES = 64
};

#define INTEGER(field, ...)  CAIRN_INTEGER(cairn_fragment_match_params, field, __VA_ARGS__)
#define NUMBER(field, ...)   CAIRN_NUMBER(cairn_fragment_match_params, field, __VA_ARGS__)
#define POSITIVE(field, ...) CAIRN_NUMBER_ABOVE(cairn_fragment_match_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_fragments, CAIRN_PART_MAX_FRAGMENTS, 1, MAX_FRAGMENTS),
    INTEGER(samples_per_fragment, 20, 2, FRAGMENT_MATCH_MAX_SAMPLES),
    INTEGER(max_chains, 10000, 1, MAX_CHAINS),
    INTEGER(max_samples, 4096, 4, MAX_CHAIN_SAMPLES),
    INTEGER(matches_per_fragment, 2, 1, MAX_MATCHES),
    POSITIVE(min_scale, 24, 0, CAIRN_MAX_MAGNITUDE),
    POSITIVE(max_scale, 800, 0, CAIRN_MAX_MAGNITUDE),
    NUMBER(min_step, CAIRN_REAL(1.5), CAIRN_REAL(0.5), CAIRN_MAX_MAGNITUDE),
    NUMBER(step_ratio, CAIRN_REAL(1.19), CAIRN_REAL(1.05), 2),
    NUMBER(zero_score_angle, CAIRN_PI / 8, CAIRN_REAL(0.02), CAIRN_PI),
    NUMBER(gap_cost, CAIRN_REAL(0.5), CAIRN_REAL(0.5), 4),
    POSITIVE(min_similarity, CAIRN_REAL(0.5), 0, 1),
};
const cairn_parameters cairn_fragment_match_parameters =
    CAIRN_PARAMETERS("fragment_match", cairn_fragment_match_params, rows);

cairn_fragment_match_params cairn_fragment_match_default(void)
{
    cairn_fragment_match_params params;

    cairn_parameters_preset(&cairn_fragment_match_parameters, &params);
    return params;
}

cairn_status cairn_fragment_match_check(const cairn_fragment_match_params *params,
                                        cairn_object_fault *fault)
{
    cairn_status status = cairn_parameters_check(&cairn_fragment_match_parameters, params, fault);

    if (status == CAIRN_OK)
        status = cairn_parameters_require(params->max_scale >= params->min_scale, "fragment_match",
                                          "max_scale: at least min_scale", fault);
    return status;
}

static cairn_sequence_params aligner_params(const cairn_fragment_match_params *p)
{
    cairn_sequence_params params = {
        .kind = CAIRN_SEQUENCE_LOCAL,
        .max_first = p->samples_per_fragment,
        .max_second = FRAGMENT_MATCH_WINDOW_RATIO * p->samples_per_fragment,
        .gap_cost = (cairn_real)cairn_real_to_int(p->gap_cost * FRAGMENT_MATCH_SCORE_UNIT),
    };

    return params;
}

/* Fills the table of pair scores by quantized direction difference. */
static void fill_gains(cairn_fragment_matcher *matcher)
{
    for (int32_t k = 0; k < FRAGMENT_MATCH_DIRECTIONS; k++) {
        int32_t parts = k <= FRAGMENT_MATCH_DIRECTIONS / 2 ? k : FRAGMENT_MATCH_DIRECTIONS - k;
        cairn_real turn = (cairn_real)parts * (2 * CAIRN_PI / FRAGMENT_MATCH_DIRECTIONS);

        matcher->gain[k] = cairn_real_to_int(
            cairn_rint(FRAGMENT_MATCH_SCORE_UNIT * (1 - turn / matcher->params.zero_score_angle)));
    }
    matcher->gap_score = cairn_real_to_int(matcher->params.gap_cost * FRAGMENT_MATCH_SCORE_UNIT);
}

/* The object, its arrays and the aligner; NULL from a counting pool. */
static cairn_fragment_matcher *build(cairn_pool *pool, const cairn_fragment_match_params *params)
{
    size_t fragments = (size_t)params->max_fragments, samples = (size_t)params->max_samples,
           matches = fragments * (size_t)params->matches_per_fragment;
    cairn_sequence_params aligner = aligner_params(params);
    cairn_fragment_matcher *matcher = cairn_object_take(pool, sizeof *matcher);

    CAIRN_TAKE(matcher, pool, length, params->max_chains);
    CAIRN_TAKE(matcher, pool, fragment_code, 2 * fragments * (size_t)params->samples_per_fragment);
    CAIRN_TAKE(matcher, pool, positions, 2 * samples);
    CAIRN_TAKE(matcher, pool, chain_code, samples);
    CAIRN_TAKE(matcher, pool, ends, matches);
    CAIRN_TAKE(matcher, pool, end_count, fragments);
    CAIRN_TAKE(matcher, pool, matches, matches);
    CAIRN_TAKE_OBJECT(matcher, pool, aligner, sequence, &aligner);
    if (matcher != NULL) {
        matcher->params = *params;
        matcher->direction = matcher->positions + samples;
        matcher->scale_slack =
            cairn_sqrt(cairn_max(1, params->step_ratio * params->min_scale / params->max_scale));
        fill_gains(matcher);
    }
    return matcher;
}

CAIRN_OBJECT(fragment_match, fragment_matcher, build);

/* ---- Direction codes ---- */

/* Computes the direction codes of a fragment in both orientations. */
static void code_fragment(cairn_fragment_matcher *matcher, int32_t fragment)
{
    int32_t n = matcher->model.samples_each;
    const cairn_oriented_point *samples =
        &matcher->model.samples[matcher->model.fragments[fragment].first];
    int16_t *ahead = cairn_fragment_match_codes(matcher, fragment, 0),
            *back = cairn_fragment_match_codes(matcher, fragment, 1);
    cairn_vec2 positions[FRAGMENT_MATCH_MAX_SAMPLES], directions[FRAGMENT_MATCH_MAX_SAMPLES];
    cairn_curve curve = {positions, n, 0};

    for (int32_t i = 0; i < n; i++)
        positions[i] = samples[i].position;
    cairn_must_be_ok(cairn_curve_tangents(&curve, 1, directions));
    for (int32_t i = 0; i < n; i++)
        ahead[i] = cairn_fragment_match_quantize(directions[i]);
    for (int32_t i = 0; i < n; i++)
        back[i] = (int16_t)((ahead[n - 1 - i] + FRAGMENT_MATCH_DIRECTIONS / 2) &
                            (FRAGMENT_MATCH_DIRECTIONS - 1));
}

/* ---- Interface ---- */

static cairn_status check_position(cairn_vec2 position)
{
    if (!cairn_vec2_is_finite(position))
        return CAIRN_NOT_FINITE;
    return cairn_vec2_is_within(position, CAIRN_MAX_MAGNITUDE) ? CAIRN_OK : CAIRN_BAD_ARGUMENT;
}

static cairn_status check_fragment(const cairn_part_bundle_model *model,
                                   const cairn_part_bundle_fragment *fragment)
{
    cairn_status status = CAIRN_OK;

    if (!cairn_is_finite(fragment->length))
        return CAIRN_NOT_FINITE;
    if (fragment->first < 0 || fragment->length < 0 || fragment->length > CAIRN_MAX_MAGNITUDE)
        return CAIRN_BAD_ARGUMENT;
    for (int32_t k = 0; k < model->samples_each && status == CAIRN_OK; k++)
        status = check_position(model->samples[fragment->first + k].position);
    return status;
}

/* Validates the model. */
static cairn_status check_model(const cairn_fragment_matcher *matcher,
                                const cairn_part_bundle_model *model)
{
    cairn_status status;

    if (model->fragment_count < 0 || model->samples_each < 2 ||
        (model->fragment_count > 0 && (model->fragments == NULL || model->samples == NULL)))
        return CAIRN_BAD_ARGUMENT;
    if (model->fragment_count > matcher->params.max_fragments ||
        model->samples_each > matcher->params.samples_per_fragment)
        return CAIRN_FULL;
    status = check_position(model->centroid);
    for (int32_t i = 0; i < model->fragment_count && status == CAIRN_OK; i++)
        status = check_fragment(model, &model->fragments[i]);
    return status;
}

/* Validates the chains and their lengths. */
static cairn_status check_chains(const cairn_fragment_matcher *matcher, const cairn_curve *chains,
                                 int32_t count)
{
    cairn_real most = (cairn_real)(matcher->params.max_samples - 1) * matcher->params.min_step;
    cairn_status status = CAIRN_OK;

    if (count < 0 || (count > 0 && chains == NULL))
        return CAIRN_BAD_ARGUMENT;
    if (count > matcher->params.max_chains)
        return CAIRN_FULL;
    for (int32_t i = 0; i < count; i++)
        if (chains[i].count < 0 || (chains[i].count > 0 && chains[i].points == NULL))
            return CAIRN_BAD_ARGUMENT;
    for (int32_t i = 0; i < count; i++)
        for (int32_t k = 0; k < chains[i].count && status == CAIRN_OK; k++)
            status = check_position(chains[i].points[k]);
    if (status != CAIRN_OK)
        return status;
    for (int32_t i = 0; i < count; i++)
        if (chains[i].count > 1 && cairn_curve_length(&chains[i]) >= most)
            return CAIRN_FULL;
    return CAIRN_OK;
}

/* Sets the range of sampling steps, from the first to the last that any fragment needs. */
static void begin_steps(cairn_fragment_matcher *matcher)
{
    cairn_real last = 0, first = matcher->params.max_scale * CAIRN_MAX_MAGNITUDE;

    for (int32_t i = 0; i < matcher->model.fragment_count; i++)
        if (matcher->model.fragments[i].length > 0) {
            first =
                cairn_min(first, matcher->model.fragments[i].length * matcher->params.min_scale);
            last = cairn_max(last, matcher->model.fragments[i].length * matcher->params.max_scale);
        }
    first /= (cairn_real)(matcher->model.samples_each - 1) * matcher->scale_slack;
    matcher->last_step =
        last / (cairn_real)(matcher->model.samples_each - 1) * matcher->scale_slack;
    matcher->level = 0;
    matcher->step = matcher->params.min_step;
    while (matcher->step * matcher->params.step_ratio < first &&
           matcher->step <= matcher->last_step) {
        matcher->step *= matcher->params.step_ratio;
        matcher->level++;
    }
}

cairn_status cairn_fragment_match_begin(cairn_fragment_matcher *matcher,
                                        const cairn_part_bundle_model *model,
                                        const cairn_curve *chains, int32_t chain_count)
{
    cairn_status status;

    if (matcher == NULL || model == NULL)
        return CAIRN_BAD_ARGUMENT;
    status = check_model(matcher, model);
    if (status == CAIRN_OK)
        status = check_chains(matcher, chains, chain_count);
    if (status != CAIRN_OK)
        return status;
    matcher->model = *model;
    matcher->chains = chains;
    matcher->chain_count = chain_count;
    for (int32_t i = 0; i < chain_count; i++)
        matcher->length[i] = chains[i].count > 1 ? cairn_curve_length(&chains[i]) : 0;
    for (int32_t i = 0; i < model->fragment_count; i++) {
        code_fragment(matcher, i);
        matcher->end_count[i] = 0;
    }
    matcher->min_score = cairn_real_to_int(
        cairn_ceil(matcher->params.min_similarity *
                   (cairn_real)(FRAGMENT_MATCH_SCORE_UNIT * model->samples_each)));
    matcher->min_samples =
        (matcher->min_score + FRAGMENT_MATCH_SCORE_UNIT - 1) / FRAGMENT_MATCH_SCORE_UNIT;
    matcher->min_samples = matcher->min_samples > 2 ? matcher->min_samples : 2;
    begin_steps(matcher);
    matcher->match_count = matcher->candidate_count = 0;
    matcher->cell_count = 0;
    matcher->resume = matcher->units_charged = 0;
    matcher->is_pending = chain_count > 0 && matcher->step <= matcher->last_step;
    matcher->is_complete = !matcher->is_pending;
    return CAIRN_OK;
}

cairn_fragment_match_result cairn_fragment_match_read(const cairn_fragment_matcher *matcher)
{
    cairn_fragment_match_result result = {0};

    if (matcher != NULL && matcher->is_complete) {
        result.matches = matcher->matches;
        result.count = matcher->match_count;
        result.candidate_count = matcher->candidate_count;
        result.cell_count = matcher->cell_count;
    }
    return result;
}
