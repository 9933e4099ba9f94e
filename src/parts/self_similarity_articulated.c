/* Re-ranking of cuts for articulated shapes, whose limbs rotated at joints.
 *
 * Method:
 * 1. Local descriptor: the stretch of the outline about a sample. Two samples are compared by the
 *    residual of a rigid alignment (Procrustes) of one stretch and the reflected other, so that a
 *    rotated limb matches its counterpart.
 * 2. A stretch may lie to either side of its sample: the minimum over equal offsets is taken, so
 *    that a sample beside a joint is described by its own limb.
 * 3. All pairs of every second sample are cuts; they are scored by dynamic time warping of their
 *    arcs and by the robust mirror residual.
 * 4. The best cuts, and the best of the earlier ranking, are fitted again from a straight axis.
 *    Only inliers count, so that the body between the limbs determines the axis.
 * 5. The final cost is the weighted geometric mean of warping cost and inlier residual, blended
 *    with the first ranking by the degree of articulation.
 *
 * Limits: if front and hind limbs are as similar as left and right ones, the body alone
 * determines the axis. */
#include "src/base/build.h"

#include "src/parts/self_similarity_work.h"

/* Greatest number of scanned cuts that are fitted. */
enum { MAX_ARTICULATED_CUTS = 12 };
/* Half-length and greatest offset of a stretch: the outline's samples divided by this. */
enum { STRETCH_DIVISOR = 32 };
/* Normalizing length of a stretch residual, relative to the greatest inner distance. */
#define STRETCH_LENGTH CAIRN_REAL(0.25)
/* Weights of the warping cost in the geometric mean, in the scan and in the final cost. */
#define SCAN_DTW_WEIGHT  CAIRN_REAL(0.5)
#define FINAL_DTW_WEIGHT CAIRN_REAL(0.5)
/* Degree of articulation from which the refitted axes replace those of the first ranking. */
#define MIN_ARTICULATION CAIRN_REAL(0.5)

/* Returns the half-length of a stretch in samples. */
static int32_t half_stretch(const cairn_self_similarity *similarity)
{
    return (similarity->params.outline_samples + STRETCH_DIVISOR / 2) / STRETCH_DIVISOR;
}

/* ---- Local descriptor distances ---- */

/* Sums over point pairs for the rigid alignment. */
typedef struct motion_sums {
    cairn_vec2 first, second;
    cairn_real squares, dot, cross;
    int32_t count;
} motion_sums;

/* Adds a point pair to the sums of the rigid alignment. */
static void add_pair(motion_sums *sums, cairn_vec2 p, cairn_vec2 q)
{
    sums->first = cairn_vec2_add(sums->first, p);
    sums->second = cairn_vec2_add(sums->second, q);
    sums->squares += cairn_vec2_norm_squared(p) + cairn_vec2_norm_squared(q);
    sums->dot += cairn_vec2_dot(p, q);
    sums->cross += cairn_vec2_cross(p, q);
    sums->count++;
}

/* Returns the mean squared residual of the optimal rigid alignment. */
static cairn_real procrustes_residual(const motion_sums *sums)
{
    cairn_real n = (cairn_real)sums->count, dot, cross, squares;

    squares = sums->squares -
              (cairn_vec2_norm_squared(sums->first) + cairn_vec2_norm_squared(sums->second)) / n;
    dot = sums->dot - cairn_vec2_dot(sums->first, sums->second) / n;
    cross = sums->cross - cairn_vec2_cross(sums->first, sums->second) / n;
    return cairn_max(0, squares - 2 * cairn_sqrt(dot * dot + cross * cross)) / n;
}

/* Returns the residual of the stretch about sample i and the reflected stretch about sample k,
 * shifted halfway to the neighbour in direction `step`. */
static cairn_real stretch_residual(const cairn_self_similarity *similarity, int32_t i, int32_t k,
                                   int32_t step)
{
    int32_t n = similarity->params.outline_samples, reach = half_stretch(similarity);
    motion_sums sums = {{0, 0}, {0, 0}, 0, 0, 0, 0};

    for (int32_t m = -reach; m <= reach; m++) {
        int32_t back = (k - m + n) % n;
        cairn_vec2 p = cairn_vec2_sub(similarity->samples[(i + m + n) % n], similarity->samples[i]);
        cairn_vec2 q = cairn_vec2_sub(similarity->samples[back], similarity->samples[k]);
        cairn_vec2 next =
            cairn_vec2_sub(similarity->samples[(back + step + n) % n], similarity->samples[k]);

        q = cairn_vec2_scale(cairn_vec2_add(q, next), CAIRN_REAL(0.5));
        q.y = -q.y;
        add_pair(&sums, p, q);
    }
    return procrustes_residual(&sums);
}

/* Returns the cost of a stretch in units. */
static int32_t stretch_cost(const cairn_self_similarity *similarity)
{
    return 1 + half_stretch(similarity);
}

/* Distance of the local descriptors of two samples. Sampling phase: the second stretch is tried at
 * its samples and halfway to both neighbours. */
static cairn_real local_distance(const cairn_self_similarity *similarity, int32_t i, int32_t k)
{
    cairn_real least = cairn_min(
        stretch_residual(similarity, i, k, 0),
        cairn_min(stretch_residual(similarity, i, k, -1), stretch_residual(similarity, i, k, 1)));

    return cairn_sqrt(least) / (STRETCH_LENGTH * similarity->max_distance);
}

/* Cost of an anti-diagonal in units. */
static int32_t diagonal_cost(const cairn_self_similarity *similarity)
{
    return 1 + similarity->params.outline_samples * stretch_cost(similarity) /
                   SELF_SIMILARITY_CELLS_PER_UNIT;
}

/* Takes the minimum over equal offsets of both stretches on an anti-diagonal of the matrix, where
 * both sample indices have the sum `diagonal`. */
static void minimize_diagonal(cairn_self_similarity *similarity, int32_t diagonal)
{
    int32_t n = similarity->params.outline_samples, reach = half_stretch(similarity);

    for (int32_t k = 0; k < n; k++)
        similarity->dtw_sum[k] = similarity->descriptor_distance[k * n + (diagonal - k + n) % n];
    for (int32_t k = 0; k < n; k++) {
        cairn_real least = similarity->dtw_sum[k];

        for (int32_t off = -reach; off <= reach; off++)
            least = cairn_min(least, similarity->dtw_sum[(k + off + n) % n]);
        similarity->descriptor_distance[k * n + (diagonal - k + n) % n] = least;
    }
}

/* ---- Dynamic time warping ---- */

/* Returns the mean dynamic-time-warping cost of the two arcs of a cut. */
static cairn_real dtw_cost_of(cairn_self_similarity *similarity, const self_similarity_cut *cut,
                              int32_t stride)
{
    self_similarity_sides sides = cairn_self_similarity_sides(similarity, cut, stride);
    int32_t *forward = similarity->dtw_samples, *back = forward + sides.count[0],
            n = similarity->params.outline_samples;
    self_similarity_alignment alignment;

    for (int32_t i = 0; i < sides.count[0]; i++)
        forward[i] = (sides.first[0] + i * stride) % n;
    for (int32_t i = 0; i < sides.count[1]; i++)
        back[i] = (sides.first[1] + (sides.count[1] - 1 - i) * stride) % n;
    similarity->comparison_count++;
    alignment =
        cairn_self_similarity_align(similarity, forward, sides.count[0], back, sides.count[1]);
    return alignment.sum / (cairn_real)alignment.length;
}

/* Returns the cost of a dynamic time warping in units. */
static int32_t dtw_units(const cairn_self_similarity *similarity, int32_t stride)
{
    int32_t side = similarity->params.outline_samples / stride;

    return 4 + side * side / 4 / SELF_SIMILARITY_CELLS_PER_UNIT;
}

/* Returns the weighted geometric mean. */
static cairn_real geometric_mean(cairn_real first, cairn_real second, cairn_real share)
{
    const cairn_real least = CAIRN_REAL(1e-6);

    return cairn_exp((1 - share) * cairn_log(cairn_max(least, first)) +
                     share * cairn_log(cairn_max(least, second)));
}

/* ---- Scan and final fits ---- */

/* Cost in units of the pair of samples i and k: an evaluation and a warping when it is a cut. */
static int32_t pair_cost(const cairn_self_similarity *similarity)
{
    if (!cairn_self_similarity_is_valid_cut(similarity, similarity->first_sample,
                                            similarity->second_sample))
        return 1;
    return dtw_units(similarity, SELF_SIMILARITY_SCAN_STRIDE) +
           cairn_self_similarity_evaluate_cost(similarity, SELF_SIMILARITY_SCAN_STRIDE);
}

/* Scores the cut at samples i and k with a straight axis; it becomes a candidate. */
static void try_pair(cairn_self_similarity *similarity)
{
    self_similarity_trial *straight = &similarity->trial[0];

    if (!cairn_self_similarity_is_valid_cut(similarity, similarity->first_sample,
                                            similarity->second_sample))
        return;
    straight->cut =
        cairn_self_similarity_cut_at(similarity->first_sample, similarity->second_sample);
    cairn_self_similarity_evaluate(similarity, straight, SELF_SIMILARITY_SCAN_STRIDE);
    straight->cut.cost = geometric_mean(
        straight->cut.cost, dtw_cost_of(similarity, &straight->cut, SELF_SIMILARITY_SCAN_STRIDE),
        SCAN_DTW_WEIGHT);
    cairn_self_similarity_insert(similarity, &similarity->candidates, &straight->cut);
}

/* The candidates of the final fits: the best of the scan and of the earlier ranking. */
static void choose_candidates(cairn_self_similarity *similarity)
{
    similarity->scanned_count = similarity->candidates.count < MAX_ARTICULATED_CUTS
                                    ? similarity->candidates.count
                                    : MAX_ARTICULATED_CUTS;
    cairn_self_similarity_append_candidates(similarity, similarity->scanned_count,
                                            &similarity->list,
                                            SELF_SIMILARITY_MAX_CUTS - MAX_ARTICULATED_CUTS);
    similarity->list.count = 0;
}

/* The current candidate with a straight axis is the start of its fit. */
static void start_straight(cairn_self_similarity *similarity)
{
    self_similarity_cut *start = &similarity->trial[similarity->current_trial].cut;

    *start = similarity->candidates.cuts[similarity->candidate];
    start->bend = start->skew = 0;
}

/* Inserts the fitted cut into the ranked list; a cut of the earlier ranking keeps its axis when the
 * shape is hardly articulated. */
static void insert_fitted(cairn_self_similarity *similarity)
{
    self_similarity_cut *before = &similarity->candidates.cuts[similarity->candidate],
                        cut = similarity->trial[similarity->current_trial].cut;
    int is_scanned = similarity->candidate < similarity->scanned_count;

    cut.dtw_cost = dtw_cost_of(similarity, &cut, 1);
    cut.cost =
        geometric_mean(is_scanned ? cut.mirror_cost : before->mirror_cost,
                       geometric_mean(cut.truncated_residual, cut.dtw_cost, FINAL_DTW_WEIGHT),
                       similarity->articulation);
    if (!is_scanned && similarity->articulation < MIN_ARTICULATION) {
        before->cost = cut.cost;
        before->dtw_cost = cut.dtw_cost;
        cut = *before;
    }
    cairn_self_similarity_set_arcs(similarity, &cut);
    cairn_self_similarity_insert(similarity, &similarity->list, &cut);
}

int cairn_self_similarity_rank_articulated(cairn_self_similarity *similarity, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(similarity->phase_resume);
    for (similarity->first_sample = 0;
         similarity->first_sample < similarity->params.outline_samples; similarity->first_sample++)
        for (similarity->second_sample = 0; similarity->second_sample <= similarity->first_sample;
             similarity->second_sample++) {
            CAIRN_STEP_CHARGE(similarity, phase_resume, budget, 3 * stretch_cost(similarity));
            self_similarity_set_distance(
                similarity, similarity->first_sample, similarity->second_sample,
                local_distance(similarity, similarity->first_sample, similarity->second_sample));
        }
    for (similarity->diagonal = 0; similarity->diagonal < similarity->params.outline_samples;
         similarity->diagonal++) {
        CAIRN_STEP_CHARGE(similarity, phase_resume, budget, diagonal_cost(similarity));
        minimize_diagonal(similarity, similarity->diagonal);
    }
    similarity->robust = 1;
    similarity->candidates.count = 0;
    for (similarity->first_sample = 0;
         similarity->first_sample < similarity->params.outline_samples;
         similarity->first_sample += SELF_SIMILARITY_SCAN_STRIDE)
        for (similarity->second_sample = 0; similarity->second_sample < similarity->first_sample;
             similarity->second_sample += SELF_SIMILARITY_SCAN_STRIDE) {
            CAIRN_STEP_CHARGE(similarity, phase_resume, budget, pair_cost(similarity));
            try_pair(similarity);
        }
    choose_candidates(similarity);
    for (similarity->candidate = 0; similarity->candidate < similarity->candidates.count;
         similarity->candidate++) {
        start_straight(similarity);
        CAIRN_STEP_RUN(similarity, phase_resume, budget, cairn_self_similarity_fit);
        CAIRN_STEP_CHARGE(similarity, phase_resume, budget, dtw_units(similarity, 1));
        insert_fitted(similarity);
    }
    CAIRN_STEP_END(similarity->phase_resume);
}
