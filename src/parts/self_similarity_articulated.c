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

/* Fills the matrix of local descriptor distances. Sampling phase: the second stretch is tried at
 * its samples and halfway to both neighbours. */
cairn_status cairn_self_similarity_local_step(cairn_self_similarity *similarity,
                                              cairn_budget *budget)
{
    int32_t n = similarity->params.outline_samples;

    for (; similarity->cursor < n; similarity->cursor++, similarity->inner_cursor = 0)
        for (; similarity->inner_cursor <= similarity->cursor; similarity->inner_cursor++) {
            cairn_real least;

            if (!cairn_budget_charge(budget, &similarity->units_charged,
                                     3 * stretch_cost(similarity)))
                return CAIRN_MORE;
            least = cairn_min(
                stretch_residual(similarity, similarity->cursor, similarity->inner_cursor, 0),
                cairn_min(
                    stretch_residual(similarity, similarity->cursor, similarity->inner_cursor, -1),
                    stretch_residual(similarity, similarity->cursor, similarity->inner_cursor, 1)));
            similarity->descriptor_distance[similarity->cursor * n + similarity->inner_cursor] =
                similarity->descriptor_distance[similarity->inner_cursor * n + similarity->cursor] =
                    cairn_sqrt(least) / (STRETCH_LENGTH * similarity->max_distance);
        }
    return CAIRN_OK;
}

/* Takes the minimum over equal offsets of both stretches, one anti-diagonal per work item. The
 * cursor is the sum of both sample indices. */
cairn_status cairn_self_similarity_local_offsets_step(cairn_self_similarity *similarity,
                                                      cairn_budget *budget)
{
    int32_t n = similarity->params.outline_samples, reach = half_stretch(similarity);

    for (; similarity->cursor < n; similarity->cursor++) {
        if (!cairn_budget_charge(budget, &similarity->units_charged,
                                 1 + n * stretch_cost(similarity) / SELF_SIMILARITY_CELLS_PER_UNIT))
            return CAIRN_MORE;
        for (int32_t k = 0; k < n; k++)
            similarity->dtw_sum[k] =
                similarity->descriptor_distance[k * n + (similarity->cursor - k + n) % n];
        for (int32_t k = 0; k < n; k++) {
            cairn_real least = similarity->dtw_sum[k];

            for (int32_t off = -reach; off <= reach; off++)
                least = cairn_min(least, similarity->dtw_sum[(k + off + n) % n]);
            similarity->descriptor_distance[k * n + (similarity->cursor - k + n) % n] = least;
        }
    }
    return CAIRN_OK;
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

void cairn_self_similarity_scan_local_begin(cairn_self_similarity *similarity)
{
    similarity->candidates.count = 0;
    similarity->robust = 1;
}

cairn_status cairn_self_similarity_scan_local_step(cairn_self_similarity *similarity,
                                                   cairn_budget *budget)
{
    int32_t units = dtw_units(similarity, SELF_SIMILARITY_SCAN_STRIDE) +
                    cairn_self_similarity_evaluate_cost(similarity, SELF_SIMILARITY_SCAN_STRIDE);

    for (; similarity->cursor < similarity->params.outline_samples;
         similarity->cursor += SELF_SIMILARITY_SCAN_STRIDE, similarity->inner_cursor = 0)
        for (; similarity->inner_cursor < similarity->cursor;
             similarity->inner_cursor += SELF_SIMILARITY_SCAN_STRIDE) {
            self_similarity_trial *straight = &similarity->trial[0];
            int makes_cut = cairn_self_similarity_is_valid_cut(similarity, similarity->cursor,
                                                               similarity->inner_cursor);

            if (!cairn_budget_charge(budget, &similarity->units_charged, makes_cut ? units : 1))
                return CAIRN_MORE;
            if (!makes_cut)
                continue;
            straight->cut =
                cairn_self_similarity_cut_at(similarity->cursor, similarity->inner_cursor);
            cairn_self_similarity_evaluate(similarity, straight, SELF_SIMILARITY_SCAN_STRIDE);
            straight->cut.cost =
                geometric_mean(straight->cut.cost,
                               dtw_cost_of(similarity, &straight->cut, SELF_SIMILARITY_SCAN_STRIDE),
                               SCAN_DTW_WEIGHT);
            cairn_self_similarity_insert(similarity, &similarity->candidates, &straight->cut);
        }
    return CAIRN_OK;
}

/* ---- Final fits ---- */

/* Prepares the final fits; all start from a straight axis. */
void cairn_self_similarity_final_fit_begin(cairn_self_similarity *similarity)
{
    int32_t from_scan = similarity->candidates.count < MAX_ARTICULATED_CUTS
                            ? similarity->candidates.count
                            : MAX_ARTICULATED_CUTS;

    cairn_self_similarity_append_candidates(similarity, from_scan, &similarity->list,
                                            SELF_SIMILARITY_MAX_CUTS - MAX_ARTICULATED_CUTS);
    similarity->dtw_candidates = from_scan;
    similarity->list.count = 0;
    similarity->cursor = 0;
    similarity->inner_cursor = 0;
}

cairn_status cairn_self_similarity_final_fit_step(cairn_self_similarity *similarity,
                                                  cairn_budget *budget)
{
    int32_t units = dtw_units(similarity, 1);

    for (; similarity->cursor < similarity->candidates.count; similarity->cursor++) {
        self_similarity_cut *before = &similarity->candidates.cuts[similarity->cursor],
                            straight = *before, cut;

        straight.bend = straight.skew = 0;
        if (similarity->inner_cursor == 0)
            cairn_self_similarity_fit_begin(similarity, &straight);
        similarity->inner_cursor = 1;
        if (cairn_self_similarity_fit_step(similarity, budget) != CAIRN_OK ||
            !cairn_budget_charge(budget, &similarity->units_charged, units))
            return CAIRN_MORE;
        similarity->inner_cursor = 0;
        cut = similarity->trial[similarity->current_trial].cut;
        cut.dtw_cost = dtw_cost_of(similarity, &cut, 1);
        cut.cost = geometric_mean(
            similarity->cursor < similarity->dtw_candidates ? cut.mirror_cost : before->mirror_cost,
            geometric_mean(cut.truncated_residual, cut.dtw_cost, FINAL_DTW_WEIGHT),
            similarity->articulation);
        if (similarity->cursor >= similarity->dtw_candidates &&
            similarity->articulation < MIN_ARTICULATION) {
            before->cost = cut.cost;
            before->dtw_cost = cut.dtw_cost;
            cut = *before;
        }
        cairn_self_similarity_set_arcs(similarity, &cut);
        cairn_self_similarity_insert(similarity, &similarity->list, &cut);
    }
    return CAIRN_OK;
}
