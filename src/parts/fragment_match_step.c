/* Step of module fragment_match: chain sampling, alignment, traceback, fit. See Method in
 * fragment_match.c. */
#include "src/base/build.h"

#include <string.h>

#include "src/containers/ranked_list.h"
#include "src/parts/fragment_match_work.h"

/* Chain samples per operation; cells, pairs and chain points per work unit. */
enum { COLUMNS_PER_BLOCK = 16, CELLS_PER_UNIT = 8, PAIRS_PER_UNIT = 4, POINTS_PER_UNIT = 4 };
/* Least number of samples of a closed chain. */
enum { MIN_CLOSED_SAMPLES = 3 };

/* ---- Chains ---- */

/* Sets the number of samples of a chain at the current step, 0 when it has no length, and whether
 * it is closed. */
static void measure_chain(cairn_fragment_matcher *matcher)
{
    int32_t steps = cairn_real_to_int(matcher->length[matcher->chain] / matcher->step);

    matcher->sample_count = 0;
    if (!(matcher->length[matcher->chain] > 0))
        return;
    matcher->closed = matcher->chains[matcher->chain].closed && steps >= MIN_CLOSED_SAMPLES &&
                      steps >= matcher->model.samples_each;
    matcher->sample_count = matcher->closed ? steps : steps + 1;
}

/* Returns the distance of consecutive chain samples, px. */
static cairn_real sample_distance(const cairn_fragment_matcher *matcher)
{
    return matcher->length[matcher->chain] /
           (cairn_real)(matcher->closed ? matcher->sample_count : matcher->sample_count - 1);
}

/* 1 when a chain has samples enough for the least similarity. */
static int is_long(const cairn_fragment_matcher *matcher)
{
    return matcher->sample_count >= matcher->min_samples;
}

/* Cost in units of measuring and sampling a chain. */
static int32_t sampling_cost(const cairn_fragment_matcher *matcher)
{
    return 1 + matcher->sample_count + matcher->chains[matcher->chain].count / POINTS_PER_UNIT;
}

/* Samples a chain at the current step and computes its direction codes. */
static void sample_chain(cairn_fragment_matcher *matcher)
{
    int32_t wrapped = matcher->model.samples_each - 1,
            opened = matcher->chains[matcher->chain].closed && !matcher->closed;
    const cairn_curve *chain = &matcher->chains[matcher->chain];
    cairn_curve samples = {matcher->positions, matcher->sample_count, matcher->closed};

    cairn_must_be_ok(
        cairn_curve_resample(chain, matcher->positions, NULL,
                             opened ? matcher->sample_count - 1 : matcher->sample_count));
    if (opened)
        matcher->positions[matcher->sample_count - 1] = chain->points[0];
    cairn_must_be_ok(cairn_curve_tangents(&samples, 1, matcher->direction));
    for (int32_t i = 0; i < matcher->sample_count; i++)
        matcher->chain_code[i] = cairn_fragment_match_quantize(matcher->direction[i]);
    matcher->column_count =
        matcher->closed ? matcher->sample_count + wrapped : matcher->sample_count;
}

/* ---- Alignments ---- */

static int is_better(const void *context, const void *entry, const void *other)
{
    const fragment_match_alignment_end *a = entry, *b = other;

    (void)context;
    if (a->score != b->score)
        return a->score > b->score;
    if (a->level != b->level)
        return a->level > b->level;
    return a->chain != b->chain ? a->chain < b->chain : a->reversed < b->reversed;
}

static int is_on_same_chain(const void *context, const void *entry, const void *other)
{
    const fragment_match_alignment_end *a = entry, *b = other;

    (void)context;
    return a->chain == b->chain;
}

/* Inserts an alignment end into the fragment's sorted list, unless a better one is on the same
 * chain or the list is full of better ones. */
static void insert_end(cairn_fragment_matcher *matcher, const fragment_match_alignment_end *found)
{
    int32_t most = matcher->params.matches_per_fragment;
    ranked_list ends = {.entries = &matcher->ends[(size_t)matcher->fragment * (size_t)most],
                        .count = &matcher->end_count[matcher->fragment],
                        .capacity = most,
                        .entry_bytes = sizeof *found,
                        .ranks_before = is_better,
                        .is_near = is_on_same_chain};

    (void)ranked_list_insert(&ends, found);
}

/* Fills one column of the Smith-Waterman table: one chain sample against the fragment. */
static void align_column(cairn_fragment_matcher *matcher, const int16_t *codes, int32_t n)
{
    int32_t code = matcher->chain_code[matcher->current_column < matcher->sample_count
                                           ? matcher->current_column
                                           : matcher->current_column - matcher->sample_count];
    int32_t diagonal = 0, above = 0, best = 0, gap = matcher->gap_score,
            *column = matcher->dp_column;

    for (int32_t i = 0; i < n; i++) {
        int32_t sum =
            diagonal + matcher->gain[(uint32_t)(codes[i] - code) & (FRAGMENT_MATCH_DIRECTIONS - 1)];

        diagonal = column[i];
        sum = sum > diagonal - gap ? sum : diagonal - gap;
        sum = sum > above - gap ? sum : above - gap;
        above = sum > 0 ? sum : 0;
        column[i] = above;
        best = above > best ? above : best;
    }
    if (best > matcher->best_score) {
        matcher->best_score = best;
        matcher->best_column = matcher->current_column;
    }
}

/* Returns the scale at which a fragment has the current step, px per unit of the model; 0: none. */
static cairn_real scale_of(const cairn_fragment_matcher *matcher, int32_t fragment)
{
    cairn_real length = matcher->model.fragments[fragment].length;

    return length > 0 ? matcher->step * (cairn_real)(matcher->model.samples_each - 1) / length : 0;
}

/* Returns whether a scale lies in the range; a range narrower than step_ratio is widened to it. */
static int is_scale_allowed(const cairn_fragment_matcher *matcher, cairn_real scale)
{
    return scale * matcher->scale_slack >= matcher->params.min_scale &&
           scale <= matcher->params.max_scale * matcher->scale_slack;
}

/* Clears the column of the alignment table. */
static void start_alignment(cairn_fragment_matcher *matcher)
{
    memset(matcher->dp_column, 0, sizeof matcher->dp_column);
    matcher->current_column = matcher->best_score = 0;
    matcher->best_column = -1;
}

/* Number of chain samples that are aligned next. */
static int32_t block_size(const cairn_fragment_matcher *matcher)
{
    int32_t left = matcher->column_count - matcher->current_column;

    return left < COLUMNS_PER_BLOCK ? left : COLUMNS_PER_BLOCK;
}

/* Cost of a block in units. */
static int32_t block_cost(const cairn_fragment_matcher *matcher)
{
    return 1 + block_size(matcher) * matcher->model.samples_each / CELLS_PER_UNIT;
}

/* Aligns a block of chain samples. */
static void align_block(cairn_fragment_matcher *matcher)
{
    int32_t n = matcher->model.samples_each, block = block_size(matcher);
    const int16_t *codes =
        cairn_fragment_match_codes(matcher, matcher->fragment, matcher->reversed);

    for (int32_t k = 0; k < block; k++, matcher->current_column++)
        align_column(matcher, codes, n);
    matcher->cell_count += (int64_t)block * n;
}

/* Records the best end of an alignment. */
static void record_end(cairn_fragment_matcher *matcher)
{
    fragment_match_alignment_end found = {matcher->best_score, matcher->level, matcher->chain,
                                          matcher->reversed, matcher->best_column};

    if (matcher->best_score >= matcher->min_score)
        insert_end(matcher, &found);
}

/* Advances to the next sampling step. */
static void next_step(cairn_fragment_matcher *matcher)
{
    matcher->step *= matcher->params.step_ratio;
    matcher->level++;
}

/* ---- Traceback and fit ---- */

/* Returns the first sample of the traceback window of an alignment end. */
static int32_t window_start(const cairn_fragment_matcher *matcher,
                            const fragment_match_alignment_end *end)
{
    int32_t from = end->column + 1 - FRAGMENT_MATCH_WINDOW_RATIO * matcher->model.samples_each;

    return from > 0 ? from : 0;
}

/* Returns the current alignment end. */
static const fragment_match_alignment_end *current_end(const cairn_fragment_matcher *matcher)
{
    return &matcher->ends[(size_t)matcher->fragment * (size_t)matcher->params.matches_per_fragment +
                          (size_t)matcher->next_end];
}

/* The score of a pair for the traceback. */
static cairn_real pair_score(const void *context, int32_t i, int32_t j)
{
    const cairn_fragment_matcher *matcher = context;
    const fragment_match_alignment_end *end = current_end(matcher);
    int32_t at = window_start(matcher, end) + j,
            code =
                matcher->chain_code[at < matcher->sample_count ? at : at - matcher->sample_count];

    return (cairn_real)matcher
        ->gain[(uint32_t)(cairn_fragment_match_codes(matcher, matcher->fragment, end->reversed)[i] -
                          code) &
               (FRAGMENT_MATCH_DIRECTIONS - 1)];
}

/* Makes the chain of the current alignment end the current one, at its step. */
static void select_chain(cairn_fragment_matcher *matcher)
{
    const fragment_match_alignment_end *end = current_end(matcher);

    matcher->step = matcher->params.min_step;
    for (int32_t i = 0; i < end->level; i++)
        matcher->step *= matcher->params.step_ratio;
    matcher->chain = end->chain;
    measure_chain(matcher);
}

/* Samples the chain again, and begins the traceback. */
static void begin_trace(cairn_fragment_matcher *matcher)
{
    const fragment_match_alignment_end *end = current_end(matcher);

    sample_chain(matcher);
    cairn_must_be_ok(cairn_sequence_begin(matcher->aligner, matcher->model.samples_each,
                                          end->column + 1 - window_start(matcher, end), pair_score,
                                          matcher));
}

/* Sets the fragment's sample and the chain position of a pair. */
static void positions_of(const cairn_fragment_matcher *matcher,
                         const fragment_match_alignment_end *end, cairn_sequence_pair pair,
                         cairn_vec2 positions[2])
{
    int32_t n = matcher->model.samples_each, own = end->reversed ? n - 1 - pair.first : pair.first;
    int32_t at = window_start(matcher, end) + pair.second;

    positions[0] =
        matcher->model.samples[matcher->model.fragments[matcher->fragment].first + own].position;
    positions[1] = matcher->positions[at < matcher->sample_count ? at : at - matcher->sample_count];
}

/* Least-squares scale and centroid (Adluru 2008, section 5.2.2, without rotation): s = sum (f -
 * mean)(e - mean) / sum (f - mean)^2. */
static void fit(const cairn_fragment_matcher *matcher, const fragment_match_alignment_end *end,
                const cairn_sequence_result *result, cairn_fragment_match *match)
{
    cairn_vec2 position[2], mean[2] = {{0, 0}, {0, 0}};
    cairn_real both = 0, own = 0, squared_sum = 0;

    for (int32_t i = 0; i < result->count; i++) {
        positions_of(matcher, end, result->pairs[i], position);
        mean[0] = cairn_vec2_add(mean[0], position[0]);
        mean[1] = cairn_vec2_add(mean[1], position[1]);
    }
    mean[0] = cairn_vec2_scale(mean[0], 1 / (cairn_real)result->count);
    mean[1] = cairn_vec2_scale(mean[1], 1 / (cairn_real)result->count);
    for (int32_t i = 0; i < result->count; i++) {
        cairn_vec2 f;

        positions_of(matcher, end, result->pairs[i], position);
        f = cairn_vec2_sub(position[0], mean[0]);
        both += cairn_vec2_dot(f, cairn_vec2_sub(position[1], mean[1]));
        own += cairn_vec2_norm_squared(f);
    }
    match->scale = own > 0 ? both / own : 0;
    match->centroid = cairn_vec2_add(
        mean[1], cairn_vec2_scale(cairn_vec2_sub(matcher->model.centroid, mean[0]), match->scale));
    for (int32_t i = 0; i < result->count; i++) {
        positions_of(matcher, end, result->pairs[i], position);
        squared_sum += cairn_vec2_norm_squared(
            cairn_vec2_sub(cairn_vec2_sub(position[1], mean[1]),
                           cairn_vec2_scale(cairn_vec2_sub(position[0], mean[0]), match->scale)));
    }
    match->rms_residual = cairn_sqrt(squared_sum / (cairn_real)result->count);
}

/* Cost of the fit to the traced pairs in units. */
static int32_t fit_cost(const cairn_fragment_matcher *matcher)
{
    return 1 + cairn_sequence_read(matcher->aligner).count / PAIRS_PER_UNIT;
}

/* Appends the match of the current alignment end, unless it is longer than one turn of a closed
 * chain or its scale is out of range. */
static void add_match(cairn_fragment_matcher *matcher)
{
    cairn_fragment_match *match = &matcher->matches[matcher->match_count];
    const fragment_match_alignment_end *end = current_end(matcher);
    cairn_sequence_result r = cairn_sequence_read(matcher->aligner);
    int32_t first = window_start(matcher, end) + r.pairs[0].second,
            last = window_start(matcher, end) + r.pairs[r.count - 1].second;

    fit(matcher, end, &r, match);
    matcher->candidate_count++;
    if (last - first >= matcher->sample_count || !is_scale_allowed(matcher, match->scale))
        return;
    match->fragment = matcher->fragment;
    match->chain = end->chain;
    match->reversed = end->reversed;
    match->pair_count = r.count;
    match->similarity = (cairn_real)end->score /
                        (cairn_real)(FRAGMENT_MATCH_SCORE_UNIT * matcher->model.samples_each);
    match->from = (cairn_real)first * sample_distance(matcher);
    match->to = (cairn_real)last * sample_distance(matcher);
    matcher->match_count++;
}

/* ---- Step ---- */

/* The matches: the best alignment ends of each fragment, and their traces. */
static int find_matches(cairn_fragment_matcher *matcher, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(matcher->resume);
    for (; matcher->step <= matcher->last_step; next_step(matcher))
        for (matcher->chain = 0; matcher->chain < matcher->chain_count; matcher->chain++) {
            measure_chain(matcher);
            CAIRN_STEP_CHARGE(matcher, resume, budget,
                              is_long(matcher) ? sampling_cost(matcher) : 1);
            if (!is_long(matcher))
                continue;
            sample_chain(matcher);
            for (matcher->fragment = 0; matcher->fragment < matcher->model.fragment_count;
                 matcher->fragment++)
                for (matcher->reversed = 0; matcher->reversed < 2; matcher->reversed++) {
                    if (!is_scale_allowed(matcher, scale_of(matcher, matcher->fragment))) {
                        CAIRN_STEP_CHARGE(matcher, resume, budget, 1);
                        continue;
                    }
                    start_alignment(matcher);
                    while (matcher->current_column < matcher->column_count) {
                        CAIRN_STEP_CHARGE(matcher, resume, budget, block_cost(matcher));
                        align_block(matcher);
                    }
                    record_end(matcher);
                }
        }
    for (matcher->fragment = 0; matcher->fragment < matcher->model.fragment_count;
         matcher->fragment++) {
        for (matcher->next_end = 0; matcher->next_end < matcher->end_count[matcher->fragment];
             matcher->next_end++) {
            select_chain(matcher);
            CAIRN_STEP_CHARGE(matcher, resume, budget, sampling_cost(matcher));
            begin_trace(matcher);
            CAIRN_STEP_UNTIL(matcher->resume,
                             cairn_sequence_step(matcher->aligner, budget) == CAIRN_OK);
            CAIRN_STEP_CHARGE(matcher, resume, budget, fit_cost(matcher));
            add_match(matcher);
        }
        CAIRN_STEP_CHARGE(matcher, resume, budget, 1);
    }
    CAIRN_STEP_END(matcher->resume);
}

cairn_status cairn_fragment_match_step(cairn_fragment_matcher *matcher, cairn_budget *budget)
{
    if (matcher == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (matcher->is_pending && find_matches(matcher, budget)) {
        matcher->is_pending = 0;
        matcher->is_complete = 1;
    }
    return matcher->is_pending ? CAIRN_MORE : CAIRN_OK;
}
