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

enum { SMOOTHED_PER_UNIT = 4 };

/* Smooths the outline for the re-ranking. */
static void smooth_samples(cairn_self_similarity *similarity)
{
    int32_t n = similarity->params.outline_samples;

    for (int32_t i = 0; i < n; i++) {
        cairn_vec2 before = similarity->samples[i > 0 ? i - 1 : n - 1],
                   after = similarity->samples[i + 1 < n ? i + 1 : 0];
        cairn_vec2 beside = cairn_vec2_scale(cairn_vec2_add(before, after), CAIRN_REAL(0.25));

        similarity->smoothed[i] =
            cairn_vec2_add(beside, cairn_vec2_scale(similarity->samples[i], CAIRN_REAL(0.5)));
    }
}

/* Cost in units of the pair of samples i and k: two evaluations when it is a cut. */
static int32_t pair_cost(const cairn_self_similarity *similarity)
{
    if (!cairn_self_similarity_is_valid_cut(similarity, similarity->first_sample,
                                            similarity->second_sample))
        return 1;
    return 4 + 2 * cairn_self_similarity_evaluate_cost(similarity, SELF_SIMILARITY_SCAN_STRIDE);
}

/* Evaluates the cut at samples i and k with a straight axis and a bent one; the better one becomes
 * a candidate. */
static void try_pair(cairn_self_similarity *similarity)
{
    self_similarity_trial *straight = &similarity->trial[0], *bent = &similarity->trial[1];

    if (!cairn_self_similarity_is_valid_cut(similarity, similarity->first_sample,
                                            similarity->second_sample))
        return;
    straight->cut = bent->cut =
        cairn_self_similarity_cut_at(similarity->first_sample, similarity->second_sample);
    cairn_self_similarity_estimate(similarity, &bent->cut);
    cairn_self_similarity_evaluate(similarity, straight, SELF_SIMILARITY_SCAN_STRIDE);
    cairn_self_similarity_evaluate(similarity, bent, SELF_SIMILARITY_SCAN_STRIDE);
    cairn_self_similarity_insert(similarity, &similarity->candidates,
                                 bent->cut.cost < straight->cut.cost ? &bent->cut : &straight->cut);
}

/* Inserts the fitted cut into the ranked list. */
static void insert_fitted(cairn_self_similarity *similarity)
{
    self_similarity_cut *fitted = &similarity->trial[similarity->current_trial].cut;

    cairn_self_similarity_set_arcs(similarity, fitted);
    cairn_self_similarity_insert(similarity, &similarity->list, fitted);
}

/* Degree of articulation, 0 ... 1, by the least mirror residual. */
static cairn_real articulation_of(const self_similarity_list *list)
{
    cairn_real excess = list->count > 0 ? list->cuts[0].mirror_residual - RIGID_RESIDUAL : 0;

    return cairn_max(0, cairn_min(1, excess / (ARTICULATED_RESIDUAL - RIGID_RESIDUAL)));
}

int cairn_self_similarity_rank(cairn_self_similarity *similarity, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(similarity->phase_resume);
    CAIRN_STEP_CHARGE(similarity, phase_resume, budget,
                      1 + similarity->params.outline_samples / SMOOTHED_PER_UNIT);
    smooth_samples(similarity);
    similarity->max_distance = cairn_inner_distance_read(similarity->inner).max_distance;
    similarity->robust = 0;
    similarity->candidates.count = 0;
    for (similarity->first_sample = 0;
         similarity->first_sample < similarity->params.outline_samples;
         similarity->first_sample += SELF_SIMILARITY_SCAN_STRIDE)
        for (similarity->second_sample = 0; similarity->second_sample < similarity->first_sample;
             similarity->second_sample += SELF_SIMILARITY_SCAN_STRIDE) {
            CAIRN_STEP_CHARGE(similarity, phase_resume, budget, pair_cost(similarity));
            try_pair(similarity);
        }
    cairn_self_similarity_append_candidates(similarity, MAX_SCANNED_CUTS, &similarity->list,
                                            MAX_EVOLUTION_CUTS);
    similarity->list.count = 0;
    similarity->current_trial = 0;
    for (similarity->candidate = 0; similarity->candidate < similarity->candidates.count;
         similarity->candidate++) {
        similarity->trial[similarity->current_trial].cut =
            similarity->candidates.cuts[similarity->candidate];
        CAIRN_STEP_RUN(similarity, phase_resume, budget, cairn_self_similarity_fit);
        insert_fitted(similarity);
    }
    similarity->articulation = articulation_of(&similarity->list);
    CAIRN_STEP_END(similarity->phase_resume);
}
