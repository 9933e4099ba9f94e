/* fragment_match goes on: chains sampled, aligned, pairs fitted. fragment_match.c says how. */
#include "src/core/build.h"

#include <string.h>

#include "src/contour/fragment_match_work.h"

/* Chain samples that are gone through at once; cells and points for a unit. */
enum { BLOCK = 16, CELLS_A_UNIT = 8, PAIRS_A_UNIT = 4, POINTS_A_UNIT = 4 };
/* Samples of a closed chain that have neighbours on both sides. */
enum { LEAST_CLOSED = 3 };

/* ---- Chains ---- */

/* Samples of a chain at the step, and whether they go round. */
static void measure_chain(cairn_fragment_matcher *m)
{
    int32_t steps = cairn_real_to_int(m->length[m->chain] / m->step);

    m->closed =
        m->chains[m->chain].closed && steps >= LEAST_CLOSED && steps >= m->model.samples_each;
    m->samples = m->closed ? steps : steps + 1;
}

/* Between two samples of the chain, px. */
static cairn_real step_of(const cairn_fragment_matcher *m)
{
    return m->length[m->chain] / (cairn_real)(m->closed ? m->samples : m->samples - 1);
}

static int32_t cost_of_sampling(const cairn_fragment_matcher *m)
{
    return m->samples + m->chains[m->chain].count / POINTS_A_UNIT;
}

static void sample_chain(cairn_fragment_matcher *m)
{
    int32_t round_again = m->model.samples_each - 1,
            opened = m->chains[m->chain].closed && !m->closed;
    const cairn_curve *chain = &m->chains[m->chain];
    cairn_curve samples = {m->places, m->samples, m->closed};
    cairn_status status;

    status = cairn_curve_resample(chain, m->places, NULL, opened ? m->samples - 1 : m->samples);
    CAIRN_ASSERT(status == CAIRN_OK);
    if (opened)
        m->places[m->samples - 1] = chain->points[0];
    status = cairn_curve_tangents(&samples, 1, m->direction);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    for (int32_t i = 0; i < m->samples; i++)
        m->chain_code[i] = cairn_fragment_match_code(m->direction[i]);
    m->columns = m->closed ? m->samples + round_again : m->samples;
}

/* ---- Alignments ---- */

/* 1 when a is better than b. */
static int is_better(const kept_match *a, const kept_match *b)
{
    if (a->score != b->score)
        return a->score > b->score;
    if (a->level != b->level)
        return a->level > b->level;
    return a->chain != b->chain ? a->chain < b->chain : a->reversed < b->reversed;
}

/* Takes a match into the order of the fragment's, unless its chain has a better one or there are
 * so many better ones. */
static void keep(cairn_fragment_matcher *m, const kept_match *found)
{
    kept_match *kept = &m->kept[(size_t)m->fragment * (size_t)m->params.matches_each];
    int32_t *count = &m->kept_count[m->fragment], at = 0;

    while (at < *count && kept[at].chain != found->chain)
        at++;
    if (at == *count && *count < m->params.matches_each) {
        (*count)++;
    } else {
        at = at < *count ? at : at - 1;
        if (!is_better(found, &kept[at]))
            return;
    }
    for (; at > 0 && is_better(found, &kept[at - 1]); at--)
        kept[at] = kept[at - 1];
    kept[at] = *found;
}

/* One chain sample against the fragment. */
static void align_column(cairn_fragment_matcher *m, const int16_t *codes, int32_t n)
{
    int32_t code = m->chain_code[m->at < m->samples ? m->at : m->at - m->samples];
    int32_t diagonal = 0, above = 0, best = 0, gap = m->gap, *column = m->column;

    for (int32_t i = 0; i < n; i++) {
        int32_t sum = diagonal + m->gain[(uint32_t)(codes[i] - code) & (FRAGMENT_DIRECTIONS - 1)];

        diagonal = column[i];
        sum = sum > diagonal - gap ? sum : diagonal - gap;
        sum = sum > above - gap ? sum : above - gap;
        above = sum > 0 ? sum : 0;
        column[i] = above;
        best = above > best ? above : best;
    }
    if (best > m->best) {
        m->best = best;
        m->best_at = m->at;
    }
}

/* The scale at which a fragment has the step; 0: it has none. */
static cairn_real scale_of(const cairn_fragment_matcher *m, int32_t fragment)
{
    cairn_real length = m->model.fragments[fragment].length;

    return length > 0 ? m->step * (cairn_real)(m->model.samples_each - 1) / length : 0;
}

/* Within the limits; where these are nearer to each other than two steps, they lie apart as far
 * as these. */
static int is_allowed(const cairn_fragment_matcher *m, cairn_real scale)
{
    return scale * m->slack >= m->params.min_scale && scale <= m->params.max_scale * m->slack;
}

/* ---- Going on ---- */

static void start_alignment(cairn_fragment_matcher *m)
{
    memset(m->column, 0, sizeof m->column);
    m->at = m->best = 0;
    m->best_at = -1;
}

/* To the next chain, or the first at the next step. */
static void next_chain(cairn_fragment_matcher *m)
{
    m->phase = FRAGMENT_SAMPLE;
    if (++m->chain < m->chain_count)
        return;
    m->chain = 0;
    m->step *= m->params.step_ratio;
    m->level++;
    if (m->step <= m->last)
        return;
    m->fragment = m->next = 0;
    m->phase = FRAGMENT_TRACE;
}

/* To the next sense, fragment, chain. */
static void next_alignment(cairn_fragment_matcher *m)
{
    start_alignment(m);
    if (m->reversed++ == 0)
        return;
    m->reversed = 0;
    if (++m->fragment == m->model.fragment_count)
        next_chain(m);
}

/* 0: the budget is used up. */
static int do_sample(cairn_fragment_matcher *m, cairn_budget *budget)
{
    int is_long;

    m->samples = 0;
    if (m->length[m->chain] > 0)
        measure_chain(m);
    is_long = m->samples >= m->need;
    if (!cairn_budget_pay(budget, &m->paid, 1 + (is_long ? cost_of_sampling(m) : 0)))
        return 0;
    if (!is_long) {
        next_chain(m);
        return 1;
    }
    sample_chain(m);
    m->fragment = m->reversed = 0;
    start_alignment(m);
    m->phase = FRAGMENT_ALIGN;
    return 1;
}

static int do_align(cairn_fragment_matcher *m, cairn_budget *budget)
{
    int32_t n = m->model.samples_each, left = m->columns - m->at,
            block = left < BLOCK ? left : BLOCK;
    const int16_t *codes = cairn_fragment_match_codes(m, m->fragment, m->reversed);

    if (!is_allowed(m, scale_of(m, m->fragment))) {
        if (!cairn_budget_pay(budget, &m->paid, 1))
            return 0;
        next_alignment(m);
        return 1;
    }
    if (!cairn_budget_pay(budget, &m->paid, 1 + block * n / CELLS_A_UNIT))
        return 0;
    for (int32_t k = 0; k < block; k++, m->at++)
        align_column(m, codes, n);
    m->cells += (int64_t)block * n;
    if (m->at == m->columns) {
        kept_match found = {m->best, m->level, m->chain, m->reversed, m->best_at};

        if (m->best >= m->least)
            keep(m, &found);
        next_alignment(m);
    }
    return 1;
}

/* ---- Pairs ---- */

/* First sample of the window that ends at a kept match. */
static int32_t window_start(const cairn_fragment_matcher *m, const kept_match *k)
{
    int32_t from = k->column + 1 - FRAGMENT_WINDOW * m->model.samples_each;

    return from > 0 ? from : 0;
}

static const kept_match *kept_next(const cairn_fragment_matcher *m)
{
    return &m->kept[(size_t)m->fragment * (size_t)m->params.matches_each + (size_t)m->next];
}

static cairn_real compare(const void *context, int32_t i, int32_t j)
{
    const cairn_fragment_matcher *m = context;
    const kept_match *k = kept_next(m);
    int32_t at = window_start(m, k) + j,
            code = m->chain_code[at < m->samples ? at : at - m->samples];

    return (cairn_real)
        m->gain[(uint32_t)(cairn_fragment_match_codes(m, m->fragment, k->reversed)[i] - code) &
                (FRAGMENT_DIRECTIONS - 1)];
}

/* Samples the chain of the next kept match again, at its step. */
static int do_trace(cairn_fragment_matcher *m, cairn_budget *budget)
{
    const kept_match *k;
    cairn_status status;
    cairn_real step = m->params.min_step;

    if (m->next == m->kept_count[m->fragment]) {
        if (!cairn_budget_pay(budget, &m->paid, 1))
            return 0;
        m->next = 0;
        if (++m->fragment == m->model.fragment_count)
            m->phase = FRAGMENT_DONE;
        return 1;
    }
    k = kept_next(m);
    for (int32_t i = 0; i < k->level; i++)
        step *= m->params.step_ratio;
    m->step = step;
    m->chain = k->chain;
    measure_chain(m);
    if (!cairn_budget_pay(budget, &m->paid, 1 + cost_of_sampling(m)))
        return 0;
    sample_chain(m);
    status = cairn_sequence_begin(m->pairing, m->model.samples_each,
                                  k->column + 1 - window_start(m, k), compare, m);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    m->phase = FRAGMENT_PAIR;
    return 1;
}

/* The fragment's sample and the place on the chain of a pair. */
static void places_of(const cairn_fragment_matcher *m, const kept_match *k,
                      cairn_sequence_pair pair, cairn_vec2 places[2])
{
    int32_t n = m->model.samples_each, own = k->reversed ? n - 1 - pair.first : pair.first;
    int32_t at = window_start(m, k) + pair.second;

    places[0] = m->model.samples[m->model.fragments[m->fragment].first + own].position;
    places[1] = m->places[at < m->samples ? at : at - m->samples];
}

/* Scale and centre of least squares (Adluru 2008, section 5.2.2, without rotation): s = sum (f -
 * mean)(e - mean) / sum (f - mean)^2. */
static void fit(const cairn_fragment_matcher *m, const kept_match *k,
                const cairn_sequence_result *r, cairn_fragment_match *match)
{
    cairn_vec2 place[2], mean[2] = {{0, 0}, {0, 0}};
    cairn_real both = 0, own = 0, off = 0;

    for (int32_t i = 0; i < r->count; i++) {
        places_of(m, k, r->pairs[i], place);
        mean[0] = cairn_vec2_add(mean[0], place[0]);
        mean[1] = cairn_vec2_add(mean[1], place[1]);
    }
    mean[0] = cairn_vec2_scale(mean[0], 1 / (cairn_real)r->count);
    mean[1] = cairn_vec2_scale(mean[1], 1 / (cairn_real)r->count);
    for (int32_t i = 0; i < r->count; i++) {
        cairn_vec2 f;

        places_of(m, k, r->pairs[i], place);
        f = cairn_vec2_sub(place[0], mean[0]);
        both += cairn_vec2_dot(f, cairn_vec2_sub(place[1], mean[1]));
        own += cairn_vec2_norm_squared(f);
    }
    match->scale = own > 0 ? both / own : 0;
    match->centre = cairn_vec2_add(
        mean[1], cairn_vec2_scale(cairn_vec2_sub(m->model.centroid, mean[0]), match->scale));
    for (int32_t i = 0; i < r->count; i++) {
        places_of(m, k, r->pairs[i], place);
        off += cairn_vec2_norm_squared(
            cairn_vec2_sub(cairn_vec2_sub(place[1], mean[1]),
                           cairn_vec2_scale(cairn_vec2_sub(place[0], mean[0]), match->scale)));
    }
    match->off = cairn_sqrt(off / (cairn_real)r->count);
}

static int do_pair(cairn_fragment_matcher *m, cairn_budget *budget)
{
    if (cairn_sequence_step(m->pairing, budget) != CAIRN_OK)
        return 0;
    m->phase = FRAGMENT_FIT;
    return 1;
}

static int do_fit(cairn_fragment_matcher *m, cairn_budget *budget)
{
    cairn_fragment_match *match = &m->matches[m->match_count];
    const kept_match *k = kept_next(m);
    cairn_sequence_result r = cairn_sequence_read(m->pairing);
    int32_t first, last;

    if (!cairn_budget_pay(budget, &m->paid, 1 + r.count / PAIRS_A_UNIT))
        return 0;
    first = window_start(m, k) + r.pairs[0].second;
    last = window_start(m, k) + r.pairs[r.count - 1].second;
    fit(m, k, &r, match);
    if (last - first < m->samples && is_allowed(m, match->scale)) {
        match->fragment = m->fragment;
        match->chain = k->chain;
        match->reversed = k->reversed;
        match->pairs = r.count;
        match->similarity =
            (cairn_real)k->score / (cairn_real)(FRAGMENT_UNIT * m->model.samples_each);
        match->from = (cairn_real)first * step_of(m);
        match->to = (cairn_real)last * step_of(m);
        m->match_count++;
    }
    m->kept_all++;
    m->next++;
    m->phase = FRAGMENT_TRACE;
    return 1;
}

cairn_status cairn_fragment_match_step(cairn_fragment_matcher *m, cairn_budget *budget)
{
    int more = 1;

    if (m == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (more && m->phase != FRAGMENT_IDLE && m->phase != FRAGMENT_DONE)
        more = m->phase == FRAGMENT_SAMPLE  ? do_sample(m, budget)
               : m->phase == FRAGMENT_ALIGN ? do_align(m, budget)
               : m->phase == FRAGMENT_TRACE ? do_trace(m, budget)
               : m->phase == FRAGMENT_PAIR  ? do_pair(m, budget)
                                            : do_fit(m, budget);
    return more ? CAIRN_OK : CAIRN_MORE;
}
