/* Re-ranking of cuts by mirror residual.
 *
 * Method:
 * 1. All pairs of every second sample are cuts. Each is evaluated with a straight axis and with the
 *    estimated bend and skew.
 * 2. The best of these cuts, and the best of the search on evolution levels, are fitted
 *    (self_similarity_fit.c).
 * 3. The least mirror residual gives the degree of articulation. Above 0 the cuts are re-ranked
 *    for articulated shapes (self_similarity_articulated.c). */
#include "src/base/build.h"

#include "src/parts/self_similarity_work.h"

/* Greatest numbers of fitted cuts: of the scan, and of the search on evolution levels. */
enum { MAX_SCANNED_CUTS = 16, MAX_EVOLUTION_CUTS = 12 };
/* Mirror residuals at which the degree of articulation is 0 and 1. */
#define RIGID_RESIDUAL       CAIRN_REAL(0.012)
#define ARTICULATED_RESIDUAL CAIRN_REAL(0.022)
/* Least length of an arc: the outline's samples divided by this. */
enum { MIN_ARC_DIVISOR = 8 };

void cairn_self_similarity_scan_begin(cairn_self_similarity *similarity)
{
    int32_t n = similarity->params.outline_samples;

    for (int32_t i = 0; i < n; i++) {
        cairn_vec2 before = similarity->samples[i > 0 ? i - 1 : n - 1],
                   after = similarity->samples[i + 1 < n ? i + 1 : 0];
        cairn_vec2 beside = cairn_vec2_scale(cairn_vec2_add(before, after), CAIRN_REAL(0.25));

        similarity->smoothed[i] =
            cairn_vec2_add(beside, cairn_vec2_scale(similarity->samples[i], CAIRN_REAL(0.5)));
    }
    similarity->max_distance = cairn_inner_distance_read(similarity->inner).max_distance;
    similarity->candidates.count = 0;
    similarity->articulation = 0;
    similarity->robust = 0;
    similarity->cursor = similarity->inner_cursor = 0;
}

int cairn_self_similarity_is_valid_cut(const cairn_self_similarity *similarity, int32_t i,
                                       int32_t k)
{
    int32_t n = similarity->params.outline_samples, least = n / MIN_ARC_DIVISOR;

    return i - k >= least && i - k <= n - least;
}

self_similarity_cut cairn_self_similarity_cut_at(int32_t i, int32_t k)
{
    self_similarity_cut cut = {.position = {(cairn_real)k, (cairn_real)i}};

    return cut;
}

/* ---- Scan of all pairs ---- */

cairn_status cairn_self_similarity_scan_step(cairn_self_similarity *similarity,
                                             cairn_budget *budget)
{
    int32_t units =
        4 + 2 * cairn_self_similarity_evaluate_cost(similarity, SELF_SIMILARITY_SCAN_STRIDE);

    for (; similarity->cursor < similarity->params.outline_samples;
         similarity->cursor += SELF_SIMILARITY_SCAN_STRIDE, similarity->inner_cursor = 0)
        for (; similarity->inner_cursor < similarity->cursor;
             similarity->inner_cursor += SELF_SIMILARITY_SCAN_STRIDE) {
            self_similarity_trial *straight = &similarity->trial[0], *bent = &similarity->trial[1];

            if (!cairn_budget_charge(budget, &similarity->units_charged,
                                     cairn_self_similarity_is_valid_cut(
                                         similarity, similarity->cursor, similarity->inner_cursor)
                                         ? units
                                         : 1))
                return CAIRN_MORE;
            if (!cairn_self_similarity_is_valid_cut(similarity, similarity->cursor,
                                                    similarity->inner_cursor))
                continue;
            straight->cut = bent->cut =
                cairn_self_similarity_cut_at(similarity->cursor, similarity->inner_cursor);
            cairn_self_similarity_estimate(similarity, &bent->cut);
            cairn_self_similarity_evaluate(similarity, straight, SELF_SIMILARITY_SCAN_STRIDE);
            cairn_self_similarity_evaluate(similarity, bent, SELF_SIMILARITY_SCAN_STRIDE);
            cairn_self_similarity_insert(similarity, &similarity->candidates,
                                         bent->cut.cost < straight->cut.cost ? &bent->cut
                                                                             : &straight->cut);
        }
    return CAIRN_OK;
}

/* ---- Fits ---- */

void cairn_self_similarity_append_candidates(cairn_self_similarity *similarity, int32_t kept,
                                             const self_similarity_list *list, int32_t most)
{
    similarity->candidates.count =
        similarity->candidates.count < kept ? similarity->candidates.count : kept;
    for (int32_t i = 0; i < list->count && i < most; i++)
        similarity->candidates.cuts[similarity->candidates.count++] = list->cuts[i];
}

void cairn_self_similarity_fits_begin(cairn_self_similarity *similarity)
{
    cairn_self_similarity_append_candidates(similarity, MAX_SCANNED_CUTS, &similarity->list,
                                            MAX_EVOLUTION_CUTS);
    similarity->list.count = 0;
    similarity->current_trial = 0;
    similarity->cursor = 0;
    similarity->inner_cursor = 0;
}

/* Fits the current candidate. */
static cairn_status fit_next(cairn_self_similarity *similarity, cairn_budget *budget)
{
    cairn_status status;

    if (similarity->inner_cursor == 0) {
        cairn_self_similarity_fit_begin(similarity,
                                        &similarity->candidates.cuts[similarity->cursor]);
        similarity->inner_cursor = 1;
    }
    status = cairn_self_similarity_fit_step(similarity, budget);
    if (status == CAIRN_OK)
        similarity->inner_cursor = 0;
    return status;
}

void cairn_self_similarity_set_arcs(const cairn_self_similarity *similarity,
                                    self_similarity_cut *cut)
{
    for (int32_t arc = 0; arc < 2; arc++) {
        cut->from[arc] = cut->position[arc];
        cut->to[arc] = cut->position[1 - arc];
        cut->to[arc] +=
            cut->to[arc] < cut->from[arc] ? (cairn_real)similarity->params.outline_samples : 0;
    }
    cut->vertices = cut->division = 0;
}

cairn_status cairn_self_similarity_fits_step(cairn_self_similarity *similarity,
                                             cairn_budget *budget)
{
    for (; similarity->cursor < similarity->candidates.count; similarity->cursor++) {
        self_similarity_cut *fitted;

        if (fit_next(similarity, budget) != CAIRN_OK)
            return CAIRN_MORE;
        fitted = &similarity->trial[similarity->current_trial].cut;
        cairn_self_similarity_set_arcs(similarity, fitted);
        cairn_self_similarity_insert(similarity, &similarity->list, fitted);
    }
    if (similarity->list.count > 0)
        similarity->articulation = (similarity->list.cuts[0].mirror_residual - RIGID_RESIDUAL) /
                                   (ARTICULATED_RESIDUAL - RIGID_RESIDUAL);
    similarity->articulation = cairn_max(0, cairn_min(1, similarity->articulation));
    return CAIRN_OK;
}
