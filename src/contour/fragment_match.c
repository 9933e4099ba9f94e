/* Fragments of an outline against chains of edges.
 *
 * Method: chains are sampled evenly at steps in a geometric series. At each step a fragment of `n`
 * samples stands for its length at one scale, so that both have as many samples for a length.
 * Directions are those from the sample before to the sample behind, in 1024 parts of a turn; a pair
 * gains 1 - |turn| / params.turn, in whole parts, so that sums are exact. The table of the
 * alignment is gone through chain sample by chain sample with one column kept; only the best end of
 * each chain is noted. A chain that has fewer samples than the least similarity needs is left out:
 * each sample gains 1 at most. Of the matches that are kept the alignment itself is found again
 * (sequence), in the 3 n samples before its end: n pairs gain n at most, and 2 n gaps, of 0.5 at
 * least, cost as much.
 *
 * A closed chain with at least n samples goes on for n - 1 more behind its first point; an
 * alignment that is longer than one round is dropped. A shorter one is open there.
 *
 * Layout: directions of the fragments both ways, of one chain; a column; the matches of each
 * fragment in order; the aligner.
 *
 * Limits: one alignment for each fragment, chain, sense and step; one match for each fragment and
 * chain. No rotation.
 *
 * Source: Adluru 2008, section 5.2.2; steps, ties and closed chains: this project's. */
#include "src/core/build.h"

#include <string.h>

#include "src/contour/fragment_match_work.h"

enum { FRAGMENTS_MOST = 1 << 16, CHAINS_MOST = 1 << 24, SAMPLES_MOST = 1 << 20, MATCHES_MOST = 64 };

static const cairn_real FAR = CAIRN_REAL(1e6);

cairn_fragment_match_params cairn_fragment_match_default(void)
{
    cairn_fragment_match_params params = {CAIRN_PART_FRAGMENTS,
                                          20,
                                          10000,
                                          4096,
                                          2,
                                          24,
                                          800,
                                          CAIRN_REAL(1.5),
                                          CAIRN_REAL(1.19),
                                          CAIRN_PI / 8,
                                          CAIRN_REAL(0.5),
                                          CAIRN_REAL(0.5)};

    return params;
}

static int capacities_are_good(const cairn_fragment_match_params *p)
{
    return p->max_fragments >= 1 && p->max_fragments <= FRAGMENTS_MOST && p->samples_each >= 2 &&
           p->samples_each <= FRAGMENT_SAMPLES_EACH_MOST && p->max_chains >= 1 &&
           p->max_chains <= CHAINS_MOST && p->max_samples >= 4 && p->max_samples <= SAMPLES_MOST &&
           p->matches_each >= 1 && p->matches_each <= MATCHES_MOST;
}

static int params_are_good(const cairn_fragment_match_params *p)
{
    return p != NULL && capacities_are_good(p) && p->min_scale > 0 &&
           p->max_scale >= p->min_scale && p->max_scale <= FAR && p->min_step >= CAIRN_REAL(0.5) &&
           p->min_step <= FAR && p->step_ratio >= CAIRN_REAL(1.05) && p->step_ratio <= 2 &&
           p->turn >= CAIRN_REAL(0.02) && p->turn <= CAIRN_PI && p->gap >= CAIRN_REAL(0.5) &&
           p->gap <= 4 && p->min_similarity > 0 && p->min_similarity <= 1;
}

static cairn_sequence_params pairing_params(const cairn_fragment_match_params *p)
{
    cairn_sequence_params params = {CAIRN_SEQUENCE_LOCAL, p->samples_each,
                                    FRAGMENT_WINDOW * p->samples_each,
                                    (cairn_real)cairn_real_to_int(p->gap * FRAGMENT_UNIT)};

    return params;
}

/* All but the pairing. */
static cairn_fragment_matcher *carve(cairn_pool *pool, const cairn_fragment_match_params *p)
{
    size_t fragments = (size_t)p->max_fragments, samples = (size_t)p->max_samples,
           matches = fragments * (size_t)p->matches_each;
    cairn_fragment_matcher *m = cairn_pool_take_one(pool, sizeof *m);
    cairn_real *length = cairn_pool_take(pool, (size_t)p->max_chains, sizeof *length);
    int16_t *fragment_code =
        cairn_pool_take(pool, 2 * fragments * (size_t)p->samples_each, sizeof *fragment_code);
    cairn_vec2 *places = cairn_pool_take(pool, 2 * samples, sizeof *places);
    int16_t *chain_code = cairn_pool_take(pool, samples, sizeof *chain_code);
    kept_match *kept = cairn_pool_take(pool, matches, sizeof *kept);
    int32_t *kept_count = cairn_pool_take(pool, fragments, sizeof *kept_count);
    cairn_fragment_match *found = cairn_pool_take(pool, matches, sizeof *found);

    if (m != NULL) {
        memset(m, 0, sizeof *m);
        m->length = length;
        m->fragment_code = fragment_code;
        m->places = places;
        m->direction = places + samples;
        m->chain_code = chain_code;
        m->kept = kept;
        m->kept_count = kept_count;
        m->matches = found;
    }
    return m;
}

size_t cairn_fragment_match_memory(const cairn_fragment_match_params *params)
{
    cairn_sequence_params pairing;
    cairn_pool counting;

    if (!params_are_good(params))
        return 0;
    pairing = pairing_params(params);
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    cairn_pool_count(&counting, cairn_sequence_memory(&pairing));
    return cairn_pool_counted(&counting);
}

/* What a pair gains by the difference of its directions. */
static void fill_gains(cairn_fragment_matcher *m)
{
    for (int32_t k = 0; k < FRAGMENT_DIRECTIONS; k++) {
        int32_t parts = k <= FRAGMENT_DIRECTIONS / 2 ? k : FRAGMENT_DIRECTIONS - k;
        cairn_real turn = (cairn_real)parts * (2 * CAIRN_PI / FRAGMENT_DIRECTIONS);

        m->gain[k] = cairn_real_to_int(cairn_rint(FRAGMENT_UNIT * (1 - turn / m->params.turn)));
    }
    m->gap = cairn_real_to_int(m->params.gap * FRAGMENT_UNIT);
}

cairn_status cairn_fragment_match_create(cairn_fragment_matcher **matcher, cairn_pool *pool,
                                         const cairn_fragment_match_params *params)
{
    size_t need = cairn_fragment_match_memory(params);
    cairn_sequence_params pairing;

    if (matcher == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    *matcher = carve(pool, params);
    (*matcher)->params = *params;
    (*matcher)->slack =
        cairn_sqrt(cairn_max(1, params->step_ratio * params->min_scale / params->max_scale));
    fill_gains(*matcher);
    pairing = pairing_params(params);
    return cairn_sequence_create(&(*matcher)->pairing, pool, &pairing);
}

/* ---- What is compared ---- */

static void code_fragment(cairn_fragment_matcher *m, int32_t fragment)
{
    int32_t n = m->model.samples_each;
    const cairn_oriented_point *samples = &m->model.samples[m->model.fragments[fragment].first];
    int16_t *ahead = cairn_fragment_match_codes(m, fragment, 0),
            *back = cairn_fragment_match_codes(m, fragment, 1);
    cairn_vec2 places[FRAGMENT_SAMPLES_EACH_MOST], directions[FRAGMENT_SAMPLES_EACH_MOST];
    cairn_curve curve = {places, n, 0};
    cairn_status status;

    for (int32_t i = 0; i < n; i++)
        places[i] = samples[i].position;
    status = cairn_curve_tangents(&curve, 1, directions);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    for (int32_t i = 0; i < n; i++)
        ahead[i] = cairn_fragment_match_code(directions[i]);
    for (int32_t i = 0; i < n; i++)
        back[i] =
            (int16_t)((ahead[n - 1 - i] + FRAGMENT_DIRECTIONS / 2) & (FRAGMENT_DIRECTIONS - 1));
}

/* ---- Calls ---- */

static int are_finite(const cairn_vec2 *points, int32_t count)
{
    for (int32_t i = 0; i < count; i++)
        if (!(cairn_abs(points[i].x) <= FAR) || !(cairn_abs(points[i].y) <= FAR))
            return 0;
    return 1;
}

static cairn_status check_model(const cairn_fragment_matcher *m, const cairn_part_model *model)
{
    if (model->fragment_count < 0 || model->samples_each < 2 ||
        (model->fragment_count > 0 && (model->fragments == NULL || model->samples == NULL)))
        return CAIRN_BAD_ARGUMENT;
    if (model->fragment_count > m->params.max_fragments ||
        model->samples_each > m->params.samples_each)
        return CAIRN_FULL;
    if (!are_finite(&model->centroid, 1))
        return CAIRN_NOT_FINITE;
    for (int32_t i = 0; i < model->fragment_count; i++) {
        if (model->fragments[i].first < 0)
            return CAIRN_BAD_ARGUMENT;
        if (!(model->fragments[i].length >= 0 && model->fragments[i].length <= FAR))
            return CAIRN_NOT_FINITE;
        for (int32_t k = 0; k < model->samples_each; k++)
            if (!are_finite(&model->samples[model->fragments[i].first + k].position, 1))
                return CAIRN_NOT_FINITE;
    }
    return CAIRN_OK;
}

/* And the chains' lengths. */
static cairn_status check_chains(const cairn_fragment_matcher *m, const cairn_curve *chains,
                                 int32_t count)
{
    cairn_real most = (cairn_real)(m->params.max_samples - 1) * m->params.min_step;

    if (count < 0 || (count > 0 && chains == NULL))
        return CAIRN_BAD_ARGUMENT;
    if (count > m->params.max_chains)
        return CAIRN_FULL;
    for (int32_t i = 0; i < count; i++)
        if (chains[i].count < 0 || (chains[i].count > 0 && chains[i].points == NULL))
            return CAIRN_BAD_ARGUMENT;
    for (int32_t i = 0; i < count; i++)
        if (!are_finite(chains[i].points, chains[i].count))
            return CAIRN_NOT_FINITE;
    for (int32_t i = 0; i < count; i++)
        if (chains[i].count > 1 && cairn_curve_length(&chains[i]) >= most)
            return CAIRN_FULL;
    return CAIRN_OK;
}

/* The steps at which fragments are looked for: from the first that one of them needs to the
 * last. */
static void begin_steps(cairn_fragment_matcher *m)
{
    cairn_real last = 0, first = m->params.max_scale * FAR;

    for (int32_t i = 0; i < m->model.fragment_count; i++)
        if (m->model.fragments[i].length > 0) {
            first = cairn_min(first, m->model.fragments[i].length * m->params.min_scale);
            last = cairn_max(last, m->model.fragments[i].length * m->params.max_scale);
        }
    first /= (cairn_real)(m->model.samples_each - 1) * m->slack;
    m->last = last / (cairn_real)(m->model.samples_each - 1) * m->slack;
    m->level = 0;
    m->step = m->params.min_step;
    while (m->step * m->params.step_ratio < first && m->step <= m->last) {
        m->step *= m->params.step_ratio;
        m->level++;
    }
}

cairn_status cairn_fragment_match_begin(cairn_fragment_matcher *m, const cairn_part_model *model,
                                        const cairn_curve *chains, int32_t chain_count)
{
    cairn_status status;

    if (m == NULL || model == NULL)
        return CAIRN_BAD_ARGUMENT;
    status = check_model(m, model);
    if (status == CAIRN_OK)
        status = check_chains(m, chains, chain_count);
    if (status != CAIRN_OK)
        return status;
    m->model = *model;
    m->chains = chains;
    m->chain_count = chain_count;
    for (int32_t i = 0; i < chain_count; i++)
        m->length[i] = chains[i].count > 1 ? cairn_curve_length(&chains[i]) : 0;
    for (int32_t i = 0; i < model->fragment_count; i++) {
        code_fragment(m, i);
        m->kept_count[i] = 0;
    }
    m->least = cairn_real_to_int(
        cairn_ceil(m->params.min_similarity * (cairn_real)(FRAGMENT_UNIT * model->samples_each)));
    m->need = (m->least + FRAGMENT_UNIT - 1) / FRAGMENT_UNIT;
    m->need = m->need > 2 ? m->need : 2;
    begin_steps(m);
    m->chain = m->fragment = m->next = m->match_count = m->kept_all = m->paid = 0;
    m->cells = 0;
    m->phase = chain_count > 0 && m->step <= m->last ? FRAGMENT_SAMPLE : FRAGMENT_DONE;
    return CAIRN_OK;
}

cairn_fragment_match_result cairn_fragment_match_read(const cairn_fragment_matcher *m)
{
    cairn_fragment_match_result result = {NULL, 0, 0, 0};

    if (m != NULL && m->phase == FRAGMENT_DONE) {
        result.matches = m->matches;
        result.count = m->match_count;
        result.kept = m->kept_all;
        result.cells = m->cells;
    }
    return result;
}
