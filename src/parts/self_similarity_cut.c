/* Cuts of the outline: lists with non-maximum suppression, points and arcs of a cut, and the dynamic
 * time warping by which two arcs are compared. */
#include "src/base/build.h"

#include "src/containers/ranked_list.h"
#include "src/parts/self_similarity_work.h"

/* Least length of an arc: the outline's samples divided by this. */
enum { MIN_ARC_DIVISOR = 8 };

/* ---- Points and arcs ---- */

int32_t cairn_self_similarity_hole_samples(const cairn_self_similarity *similarity)
{
    int32_t sum = 0;

    for (int32_t h = 0; h < similarity->hole_total; h++)
        sum += similarity->hole_count[h];
    return sum;
}

cairn_vec2 cairn_self_similarity_point(const cairn_self_similarity *similarity,
                                       const cairn_vec2 *samples, cairn_real position)
{
    int32_t n = similarity->params.outline_samples, i = cairn_real_to_int(cairn_floor(position));
    cairn_vec2 a = samples[i % n], b = samples[(i + 1) % n];

    return cairn_vec2_interpolate(a, b, position - (cairn_real)i);
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

/* ---- Lists ---- */

/* Returns the distance of two positions along a closed outline. */
static cairn_real cyclic_distance(cairn_real a, cairn_real b, cairn_real round)
{
    cairn_real d = cairn_abs(a - b);

    return cairn_min(d, round - d);
}

/* Returns whether both ends of two cuts are closer than the non-maximum-suppression radius. */
static int are_within_radius(const void *context, const void *entry, const void *other)
{
    const cairn_self_similarity *similarity = context;
    const self_similarity_cut *a = other, *b = entry;
    cairn_real n = (cairn_real)similarity->params.outline_samples,
               nearby = similarity->params.separation * n;

    return (cyclic_distance(a->position[0], b->position[0], n) < nearby &&
            cyclic_distance(a->position[1], b->position[1], n) < nearby) ||
           (cyclic_distance(a->position[0], b->position[1], n) < nearby &&
            cyclic_distance(a->position[1], b->position[0], n) < nearby);
}

void cairn_self_similarity_insert(const cairn_self_similarity *similarity,
                                  self_similarity_list *list, const self_similarity_cut *cut)
{
    ranked_list cuts = {.entries = list->cuts,
                        .count = &list->count,
                        .capacity = SELF_SIMILARITY_MAX_CUTS,
                        .entry_bytes = sizeof *cut,
                        .score_at = offsetof(self_similarity_cut, cost),
                        .least_first = 1,
                        .is_near = are_within_radius,
                        .context = similarity};

    (void)ranked_list_insert(&cuts, cut);
}

void cairn_self_similarity_append_candidates(cairn_self_similarity *similarity, int32_t kept,
                                             const self_similarity_list *list, int32_t most)
{
    similarity->candidates.count =
        similarity->candidates.count < kept ? similarity->candidates.count : kept;
    for (int32_t i = 0; i < list->count && i < most; i++)
        similarity->candidates.cuts[similarity->candidates.count++] = list->cuts[i];
}

/* ---- Dynamic time warping ---- */

self_similarity_alignment cairn_self_similarity_align(cairn_self_similarity *similarity,
                                                      const int32_t *first, int32_t first_count,
                                                      const int32_t *second, int32_t second_count)
{
    self_similarity_alignment alignment;
    cairn_real *above = similarity->dtw_sum,
               *sum = similarity->dtw_sum + similarity->params.outline_samples;
    int32_t *steps_above = similarity->dtw_length,
            *steps = similarity->dtw_length + similarity->params.outline_samples;

    for (int32_t i = 0; i < first_count; i++) {
        const cairn_real *distances =
            &similarity->descriptor_distance[first[i] * similarity->params.outline_samples];
        cairn_real *sum_kept = above;
        int32_t *steps_kept = steps_above;

        for (int32_t k = 0; k < second_count; k++) {
            cairn_real best = 0;
            int32_t length = 0;

            /* Among equal sums the diagonal step wins. */
            if (i > 0 && k > 0) {
                best = above[k - 1];
                length = steps_above[k - 1];
            }
            if (i > 0 && (k == 0 || above[k] < best)) {
                best = above[k];
                length = steps_above[k];
            }
            if (k > 0 && (i == 0 || sum[k - 1] < best)) {
                best = sum[k - 1];
                length = steps[k - 1];
            }
            sum[k] = best + distances[second[k]];
            steps[k] = length + 1;
        }
        above = sum;
        steps_above = steps;
        sum = sum_kept;
        steps = steps_kept;
    }
    alignment.sum = above[second_count - 1];
    alignment.length = steps_above[second_count - 1];
    return alignment;
}
