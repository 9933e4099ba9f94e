/* Cuts ranked once more.
 *
 * Method: all pairs of every other sample are judged by their misfit, as they are and with the
 * bend and skew that pairs of points between them speak for. The best of these, and the best of
 * the thesis's search, are fitted. Where even the best of all leaves more than a bend and a skew
 * explain, limbs have moved at their joints, and cuts are judged for joints, too
 * (self_similarity_joint.c). */
#include "src/core/build.h"

#include "src/contour/self_similarity_work.h"

/* How many cuts are fitted: of the scan, of the thesis's search. */
enum { SCANNED = 16, WRITTEN = 12 };
/* Misfits between which a shape passes from explained to jointed. */
#define EXPLAINED   CAIRN_REAL(0.012)
#define UNEXPLAINED CAIRN_REAL(0.022)
/* Ends that are nearer than this share of the outline make no cut. */
enum { LEAST_PART = 8 };

void cairn_similarity_scan_begin(cairn_self_similarity *s)
{
    int32_t n = s->params.points;

    for (int32_t i = 0; i < n; i++) {
        cairn_vec2 before = s->samples[i > 0 ? i - 1 : n - 1],
                   after = s->samples[i + 1 < n ? i + 1 : 0];
        cairn_vec2 beside = cairn_vec2_scale(cairn_vec2_add(before, after), CAIRN_REAL(0.25));

        s->smooth[i] = cairn_vec2_add(beside, cairn_vec2_scale(s->samples[i], CAIRN_REAL(0.5)));
    }
    s->span = cairn_inner_distance_read(s->inner).greatest;
    s->scanned.count = 0;
    s->jointed = 0;
    s->robust = 0;
    s->i = s->k = 0;
}

int cairn_similarity_makes_cut(const cairn_self_similarity *s, int32_t i, int32_t k)
{
    int32_t n = s->params.points, least = n / LEAST_PART;

    return i - k >= least && i - k <= n - least;
}

similarity_cut cairn_similarity_cut_at(int32_t i, int32_t k)
{
    similarity_cut cut = {.place = {(cairn_real)k, (cairn_real)i}};

    return cut;
}

/* ---- All pairs by their misfit ---- */

cairn_status cairn_similarity_scan_step(cairn_self_similarity *s, cairn_budget *budget)
{
    int32_t units = 4 + 2 * cairn_similarity_trial_units(s, SIMILARITY_STRIDE);

    for (; s->i < s->params.points; s->i += SIMILARITY_STRIDE, s->k = 0)
        for (; s->k < s->i; s->k += SIMILARITY_STRIDE) {
            similarity_trial *straight = &s->trial[0], *bent = &s->trial[1];

            if (!cairn_budget_pay(budget, &s->paid,
                                  cairn_similarity_makes_cut(s, s->i, s->k) ? units : 1))
                return CAIRN_MORE;
            if (!cairn_similarity_makes_cut(s, s->i, s->k))
                continue;
            straight->cut = bent->cut = cairn_similarity_cut_at(s->i, s->k);
            cairn_similarity_guess(s, &bent->cut);
            cairn_similarity_try(s, straight, SIMILARITY_STRIDE);
            cairn_similarity_try(s, bent, SIMILARITY_STRIDE);
            cairn_similarity_offer(
                s, &s->scanned, bent->cut.cost < straight->cut.cost ? &bent->cut : &straight->cut);
        }
    return CAIRN_OK;
}

/* ---- The best of them fitted ---- */

void cairn_similarity_line_up(cairn_self_similarity *s, int32_t kept, const similarity_list *list,
                              int32_t most)
{
    s->scanned.count = s->scanned.count < kept ? s->scanned.count : kept;
    for (int32_t i = 0; i < list->count && i < most; i++)
        s->scanned.cuts[s->scanned.count++] = list->cuts[i];
}

void cairn_similarity_fits_begin(cairn_self_similarity *s)
{
    cairn_similarity_line_up(s, SCANNED, &s->list, WRITTEN);
    s->list.count = 0;
    s->current = 0;
    s->i = 0;
    s->k = 0;
}

/* Fits the cut that the phase is at. */
static cairn_status fit_next(cairn_self_similarity *s, cairn_budget *budget)
{
    cairn_status status;

    if (s->k == 0) {
        cairn_similarity_fit_begin(s, &s->scanned.cuts[s->i]);
        s->k = 1;
    }
    status = cairn_similarity_fit_step(s, budget);
    if (status == CAIRN_OK)
        s->k = 0;
    return status;
}

void cairn_similarity_set_arcs(const cairn_self_similarity *s, similarity_cut *cut)
{
    for (int32_t arc = 0; arc < 2; arc++) {
        cut->from[arc] = cut->place[arc];
        cut->to[arc] = cut->place[1 - arc];
        cut->to[arc] += cut->to[arc] < cut->from[arc] ? (cairn_real)s->params.points : 0;
    }
    cut->vertices = cut->division = 0;
}

cairn_status cairn_similarity_fits_step(cairn_self_similarity *s, cairn_budget *budget)
{
    for (; s->i < s->scanned.count; s->i++) {
        similarity_cut *fitted;

        if (fit_next(s, budget) != CAIRN_OK)
            return CAIRN_MORE;
        fitted = &s->trial[s->current].cut;
        cairn_similarity_set_arcs(s, fitted);
        cairn_similarity_offer(s, &s->list, fitted);
    }
    if (s->list.count > 0)
        s->jointed = (s->list.cuts[0].misfit - EXPLAINED) / (UNEXPLAINED - EXPLAINED);
    s->jointed = cairn_max(0, cairn_min(1, s->jointed));
    return CAIRN_OK;
}
