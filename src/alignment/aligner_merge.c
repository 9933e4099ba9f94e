/* aligner: agglomerative clustering by the most certain hypothesis (aligner_pairs.c).
 *
 * Method: a hypothesis of two scans is one of the relative pose of their clusters.
 * 1. Pick the hypothesis of the greatest rank.
 * 2. Evaluate it again when its clusters have changed.
 * 3. Ambiguity test: subtract the log of the competing hypotheses' odds.
 * 4. Observability test: compare with poses shifted along the least observable direction.
 * 5. If its rank is still the greatest, merge the two clusters; otherwise back to 1. */
#include "src/base/build.h"

#include <string.h>

#include "src/alignment/aligner_work.h"

/* nats: rejected below; by the initial poses alone */
static const cairn_real MIN_NATS = -15, MIN_PRIOR_NATS = -40;
/* nats: lower bound of a shifted pose, which matters only above 0 */
static const cairn_real MIN_SHIFTED_NATS = -10;
/* m */
static const cairn_real SAME_POSE_M = CAIRN_REAL(0.15);
/* cosine of 3 degrees */
static const cairn_real SAME_HEADING_COSINE = CAIRN_REAL(0.9986);
/* m: shift along the least observable direction */
static const cairn_real SHIFT_M = CAIRN_REAL(0.25);
/* nats: competing hypotheses worse by this are ignored */
static const cairn_real COMPETING_MARGIN_NATS = 8;
enum { EVALUATION_ROUNDS = 3, NOT_EVALUATED = -2 };
enum { HYPOTHESES_PER_ITEM = 128, LINKS_PER_ITEM = 64, LINKS_PER_UNIT = 8 };

static int32_t cluster_of(const cairn_aligner *aligner, int32_t scan)
{
    return aligner->scans[scan].cluster;
}

static int is_fresh(const cairn_aligner *aligner, const aligner_hypothesis *hypothesis)
{
    return hypothesis->first_stamp ==
               aligner->clusters[cluster_of(aligner, hypothesis->first)].stamp &&
           hypothesis->second_stamp ==
               aligner->clusters[cluster_of(aligner, hypothesis->second)].stamp;
}

/* Invalidates the best hypothesis of a block. */
static void invalidate_block(cairn_aligner *aligner, const aligner_hypothesis *hypothesis)
{
    aligner->best_of_block[(hypothesis - aligner->hypotheses) / ALIGNER_HYPOTHESIS_BLOCK] =
        NOT_EVALUATED;
}

/* Returns the pose of the first scan's cluster in the frame of the second's. */
static cairn_transform clusters_pose(const cairn_aligner *aligner,
                                     const aligner_hypothesis *hypothesis)
{
    cairn_transform first = cairn_transform_compose(aligner->poses[hypothesis->second],
                                                    cairn_transform_of(hypothesis->second_first));

    return cairn_transform_compose(first,
                                   cairn_transform_inverse(aligner->poses[hypothesis->first]));
}

/* Starts an evaluation; returns 0 and rejects the hypothesis when its prior is below any possible
 * gain. */
static int begin_evaluation(cairn_aligner *aligner, aligner_hypothesis *hypothesis)
{
    int32_t first = cluster_of(aligner, hypothesis->first),
            second = cluster_of(aligner, hypothesis->second);
    cairn_transform pose = clusters_pose(aligner, hypothesis);

    if (cairn_aligner_prior(aligner, first, second, pose) < MIN_PRIOR_NATS) {
        hypothesis->state = ALIGNER_REJECTED;
        invalidate_block(aligner, hypothesis);
        return 0;
    }
    cairn_aligner_begin_evaluation(aligner, first, second, pose,
                                   hypothesis->first_stamp < 0 ? 1 : EVALUATION_ROUNDS,
                                   MIN_PRIOR_NATS);
    return 1;
}

static void store_evaluation(cairn_aligner *aligner, aligner_hypothesis *hypothesis)
{
    cairn_transform first =
        cairn_transform_compose(aligner->evaluation.pose, aligner->poses[hypothesis->first]);

    hypothesis->second_first =
        cairn_pose_of(cairn_transform_between(aligner->poses[hypothesis->second], first));
    hypothesis->score = hypothesis->rank =
        aligner->evaluation.log_likelihood_ratio + aligner->evaluation.log_prior;
    hypothesis->first_stamp = aligner->clusters[cluster_of(aligner, hypothesis->first)].stamp;
    hypothesis->second_stamp = aligner->clusters[cluster_of(aligner, hypothesis->second)].stamp;
    hypothesis->state = hypothesis->score < MIN_NATS ? ALIGNER_REJECTED : ALIGNER_EVALUATED;
    invalidate_block(aligner, hypothesis);
}

static void find_best_of_block(cairn_aligner *aligner, int32_t block)
{
    int32_t first = block * ALIGNER_HYPOTHESIS_BLOCK, end = first + ALIGNER_HYPOTHESIS_BLOCK,
            best = -1;

    for (int32_t i = first; i < end && i < aligner->hypothesis_count; i++) {
        const aligner_hypothesis *h = &aligner->hypotheses[i];

        if (h->state != ALIGNER_REJECTED && h->rank > aligner->params.min_log_likelihood_ratio &&
            (best < 0 || h->rank > aligner->hypotheses[best].rank))
            best = i;
    }
    aligner->best_of_block[block] = best;
}

static int32_t blocks_of(const cairn_aligner *aligner)
{
    return (aligner->hypothesis_count + ALIGNER_HYPOTHESIS_BLOCK - 1) / ALIGNER_HYPOTHESIS_BLOCK;
}

/* Finds the best hypotheses of some blocks; 0: all are known. */
static int find_some_best(cairn_aligner *aligner)
{
    enum { OF_ITEM = 16 };
    int32_t found = 0;

    for (int32_t block = 0; block < blocks_of(aligner) && found < OF_ITEM; block++)
        if (aligner->best_of_block[block] == NOT_EVALUATED) {
            find_best_of_block(aligner, block);
            found++;
        }
    aligner->units_due += blocks_of(aligner) / 32 + found * (ALIGNER_HYPOTHESIS_BLOCK / 16);
    return found == OF_ITEM;
}

/* Returns the hypothesis of the greatest rank; -1: none is above the threshold. */
static int32_t best_hypothesis(cairn_aligner *aligner)
{
    int32_t best = -1;

    for (int32_t block = 0; block < blocks_of(aligner); block++) {
        int32_t own;

        if (aligner->best_of_block[block] == NOT_EVALUATED) {
            find_best_of_block(aligner, block);
            aligner->units_due += ALIGNER_HYPOTHESIS_BLOCK / 16;
        }
        own = aligner->best_of_block[block];
        if (own >= 0 &&
            (best < 0 || aligner->hypotheses[own].rank > aligner->hypotheses[best].rank))
            best = own;
    }
    aligner->units_due += blocks_of(aligner) / 16;
    return best;
}

/* Returns 1 when two hypotheses relate the same clusters. */
static int is_competing(const cairn_aligner *aligner, const aligner_hypothesis *h,
                        const aligner_hypothesis *g)
{
    int32_t a = cluster_of(aligner, h->first), b = cluster_of(aligner, h->second);
    int32_t c = cluster_of(aligner, g->first), d = cluster_of(aligner, g->second);

    return h != g && g->state != ALIGNER_REJECTED && ((a == c && b == d) || (a == d && b == c));
}

/* Returns the pose of h's clusters by hypothesis g. */
static cairn_transform competing_pose(const cairn_aligner *aligner, const aligner_hypothesis *h,
                                      const aligner_hypothesis *g)
{
    cairn_transform pose = clusters_pose(aligner, g);

    return cluster_of(aligner, g->first) == cluster_of(aligner, h->first)
               ? pose
               : cairn_transform_inverse(pose);
}

/* Starts the list of competing hypotheses: those of the scans of the smaller cluster. */
static void begin_competing(cairn_aligner *aligner)
{
    const aligner_hypothesis *h = &aligner->hypotheses[aligner->merging.chosen];
    int32_t a = cluster_of(aligner, h->first), b = cluster_of(aligner, h->second);

    aligner->merging.competing_scan =
        aligner->clusters[aligner->clusters[a].size <= aligner->clusters[b].size ? a : b].head;
    aligner->merging.competing_link = aligner->links[aligner->merging.competing_scan];
}

/* Returns the next competing hypothesis, after at most `most` others; NULL: none, and
 * competing_scan < 0 at the end of the list. */
static aligner_hypothesis *next_competing(cairn_aligner *aligner, int32_t *passed, int32_t most)
{
    const aligner_hypothesis *h = &aligner->hypotheses[aligner->merging.chosen];

    while (aligner->merging.competing_scan >= 0 && *passed < most) {
        aligner_hypothesis *g;

        ++*passed;
        if (aligner->merging.competing_link < 0) {
            aligner->merging.competing_scan =
                aligner->scans[aligner->merging.competing_scan].next_in_cluster;
            aligner->merging.competing_link = aligner->merging.competing_scan >= 0
                                                  ? aligner->links[aligner->merging.competing_scan]
                                                  : -1;
            continue;
        }
        g = &aligner->hypotheses[aligner->merging.competing_link / 2];
        aligner->merging.competing_link = g->next[aligner->merging.competing_link & 1];
        if (is_competing(aligner, h, g))
            return g;
    }
    return NULL;
}

/* Returns the pose of the chosen hypothesis' first scan in the other cluster's frame, by hypothesis
 * g. */
static cairn_transform pose_by(const cairn_aligner *aligner, const aligner_hypothesis *hypothesis)
{
    const aligner_hypothesis *h = &aligner->hypotheses[aligner->merging.chosen];

    return cairn_transform_compose(competing_pose(aligner, h, hypothesis),
                                   aligner->poses[h->first]);
}

/* Evaluates competing hypotheses that are outdated; not those with the same pose. */
static int32_t evaluate_competing(cairn_aligner *aligner)
{
    const aligner_hypothesis *h = &aligner->hypotheses[aligner->merging.chosen];
    cairn_transform pose = pose_by(aligner, h);
    aligner_hypothesis *g;
    int32_t passed = 0, compared = 0;

    if (aligner->merging.evaluated_competing >= 0)
        store_evaluation(aligner, &aligner->hypotheses[aligner->merging.evaluated_competing]);
    aligner->merging.evaluated_competing = -1;
    for (; (g = next_competing(aligner, &passed, LINKS_PER_ITEM)) != NULL; compared++)
        if (!is_fresh(aligner, g) && g->score >= h->score - COMPETING_MARGIN_NATS &&
            !cairn_aligner_is_near(pose, pose_by(aligner, g), SAME_POSE_M, SAME_HEADING_COSINE)) {
            aligner->merging.evaluated_competing =
                begin_evaluation(aligner, g) ? (int32_t)(g - aligner->hypotheses) : -1;
            break;
        }
    if (g == NULL && aligner->merging.competing_scan < 0) {
        aligner->phase = best_hypothesis(aligner) == aligner->merging.chosen
                             ? ALIGNER_COMPARE_COMPETING
                             : ALIGNER_PICK;
        aligner->merging.competing_odds = 1;
        begin_competing(aligner);
    }
    return 2 + compared + passed / LINKS_PER_UNIT;
}

/* Adds up the odds of the competing hypotheses; duplicates are rejected. */
static int32_t compare(cairn_aligner *aligner)
{
    aligner_hypothesis *h = &aligner->hypotheses[aligner->merging.chosen], *g;
    cairn_transform pose = pose_by(aligner, h);
    int32_t passed = 0, compared = 0;

    for (; (g = next_competing(aligner, &passed, LINKS_PER_ITEM)) != NULL; compared++) {
        cairn_transform competing = pose_by(aligner, g);

        if (is_fresh(aligner, g) &&
            !cairn_aligner_is_near(pose, competing, SAME_POSE_M, SAME_HEADING_COSINE)) {
            aligner->merging.competing_odds += cairn_exp(cairn_min(g->score, 60));
        } else if (g->score <= h->score &&
                   cairn_aligner_is_near(pose, competing, SAME_POSE_M / 3, CAIRN_REAL(0.9998))) {
            g->state = ALIGNER_REJECTED;
            invalidate_block(aligner, g);
        }
    }
    if (aligner->merging.competing_scan < 0) {
        h->rank = h->score - cairn_log(aligner->merging.competing_odds);
        h->state = ALIGNER_COMPARED;
        invalidate_block(aligner, h);
        aligner->phase = ALIGNER_PICK;
    }
    return 2 + compared + passed / LINKS_PER_UNIT;
}

static void begin_shifted(cairn_aligner *aligner)
{
    const aligner_hypothesis *h = &aligner->hypotheses[aligner->merging.chosen];
    cairn_real motion[3];

    for (int k = 0; k < 3; k++)
        motion[k] = (aligner->merging.side == 1 ? SHIFT_M : -SHIFT_M) * aligner->merging.shift[k];
    cairn_aligner_begin_evaluation(
        aligner, cluster_of(aligner, h->first), cluster_of(aligner, h->second),
        cairn_aligner_moved(clusters_pose(aligner, h), aligner->merging.shift_centre, motion), 0,
        MIN_SHIFTED_NATS);
}

/* Evaluates the least observable direction, then both shifted poses. */
static void test_shifted(cairn_aligner *aligner)
{
    aligner_hypothesis *h = &aligner->hypotheses[aligner->merging.chosen];

    if (aligner->merging.side == 0) {
        memcpy(aligner->merging.shift, aligner->evaluation.weak_direction,
               sizeof aligner->merging.shift);
        aligner->merging.shift_centre = aligner->evaluation.centre;
        aligner->move.second_best_score = 0;
    } else {
        aligner->move.second_best_score =
            cairn_max(aligner->move.second_best_score,
                      aligner->evaluation.log_likelihood_ratio + aligner->evaluation.log_prior);
    }
    if (++aligner->merging.side <= 2) {
        begin_shifted(aligner);
        return;
    }
    h->rank = cairn_min(h->rank, h->score - aligner->move.second_best_score);
    h->state = ALIGNER_VERIFIED;
    invalidate_block(aligner, h);
    aligner->phase = ALIGNER_PICK;
}

void cairn_aligner_begin_merging(cairn_aligner *aligner, int32_t again)
{
    aligner->phase = ALIGNER_LINK_HYPOTHESES;
    aligner->cursor.stage = again;
    aligner->cursor.item = 0;
}

static void link_to(cairn_aligner *aligner, int32_t hypothesis, int32_t side, int32_t scan)
{
    aligner->hypotheses[hypothesis].next[side] = aligner->links[scan];
    aligner->links[scan] = 2 * hypothesis + side;
}

/* Links some hypotheses; those within one cluster are rejected. */
static int32_t link_some(cairn_aligner *aligner)
{
    int32_t end = aligner->cursor.item + HYPOTHESES_PER_ITEM < aligner->hypothesis_count
                      ? aligner->cursor.item + HYPOTHESES_PER_ITEM
                      : aligner->hypothesis_count,
            units = 1;

    if (aligner->cursor.item == 0) {
        for (int32_t i = 0; i < aligner->scan_count; i++)
            aligner->links[i] = -1;
        units += aligner->scan_count / 64;
    }
    for (; aligner->cursor.item < end;
         aligner->cursor.item++, units += aligner->cursor.item % LINKS_PER_UNIT == 0) {
        aligner_hypothesis *h = &aligner->hypotheses[aligner->cursor.item];

        if (aligner->cursor.stage) {
            h->rank = cairn_max(h->score, aligner->params.min_log_likelihood_ratio * 2);
            h->first_stamp = -1;
        }
        h->state = cluster_of(aligner, h->first) != cluster_of(aligner, h->second)
                       ? ALIGNER_EVALUATED
                       : ALIGNER_REJECTED;
        link_to(aligner, aligner->cursor.item, 0, h->first);
        link_to(aligner, aligner->cursor.item, 1, h->second);
        invalidate_block(aligner, h);
    }
    if (end == aligner->hypothesis_count)
        aligner->phase = ALIGNER_PICK;
    return units;
}

/* Rejects the hypotheses within the merged cluster, scan by scan. */
static int32_t reject_some(cairn_aligner *aligner)
{
    int32_t passed = 0, link;

    if (aligner->cursor.inner == 0) {
        aligner->phase = ALIGNER_PICK;
        return 1;
    }
    for (link = aligner->links[aligner->cursor.item]; link >= 0; passed++) {
        aligner_hypothesis *h = &aligner->hypotheses[link / 2];

        link = h->next[link & 1];
        if (h->state != ALIGNER_REJECTED &&
            cluster_of(aligner, h->first) == cluster_of(aligner, h->second)) {
            h->state = ALIGNER_REJECTED;
            invalidate_block(aligner, h);
        }
    }
    aligner->cursor.item = aligner->scans[aligner->cursor.item].next_in_cluster;
    aligner->cursor.inner--;
    return 1 + passed / LINKS_PER_UNIT;
}

/* Merges; the scans of the smaller cluster come first in the list. */
static void merge(cairn_aligner *aligner)
{
    aligner_hypothesis *h = &aligner->hypotheses[aligner->merging.chosen];
    int32_t a = cluster_of(aligner, h->first), b = cluster_of(aligner, h->second), joined;

    aligner->cursor.inner = aligner->clusters[a].size < aligner->clusters[b].size
                                ? aligner->clusters[a].size
                                : aligner->clusters[b].size;
    joined = cairn_aligner_merge_clusters(aligner, a, b, clusters_pose(aligner, h));
    aligner->cursor.item = aligner->clusters[joined].head;
    aligner->phase = ALIGNER_REJECT_MERGED;
    aligner->result.merges++;
    cairn_aligner_begin_relax(aligner, joined, CAIRN_REAL(0.08),
                              aligner->clusters[joined].size < 6 ? 3 : 2, 0);
}

static void pick(cairn_aligner *aligner)
{
    aligner_hypothesis *h;

    if (find_some_best(aligner))
        return;
    aligner->merging.chosen = best_hypothesis(aligner);
    if (aligner->merging.chosen < 0) {
        aligner->phase = ALIGNER_RELOCALIZE;
        aligner->cursor.scan = 0;
        aligner->changed_scans = 0;
        return;
    }
    h = &aligner->hypotheses[aligner->merging.chosen];
    if (!is_fresh(aligner, h)) {
        if (begin_evaluation(aligner, h))
            aligner->phase = ALIGNER_PICK_EVALUATED;
    } else if (h->state == ALIGNER_EVALUATED) {
        aligner->merging.evaluated_competing = -1;
        begin_competing(aligner);
        aligner->phase = ALIGNER_EVALUATE_COMPETING;
    } else if (h->state == ALIGNER_COMPARED) {
        aligner->merging.side = 0;
        cairn_aligner_begin_evaluation(aligner, cluster_of(aligner, h->first),
                                       cluster_of(aligner, h->second), clusters_pose(aligner, h), 1,
                                       CAIRN_REAL_MAX);
        aligner->phase = ALIGNER_TEST_SHIFTED;
    } else {
        merge(aligner);
    }
}

int32_t cairn_aligner_merge_item(cairn_aligner *aligner)
{
    switch (aligner->phase) {
    case ALIGNER_LINK_HYPOTHESES:
        return link_some(aligner);
    case ALIGNER_PICK:
        pick(aligner);
        return 1;
    case ALIGNER_PICK_EVALUATED:
        store_evaluation(aligner, &aligner->hypotheses[aligner->merging.chosen]);
        aligner->phase = ALIGNER_PICK;
        return 2;
    case ALIGNER_EVALUATE_COMPETING:
        return evaluate_competing(aligner);
    case ALIGNER_COMPARE_COMPETING:
        return compare(aligner);
    case ALIGNER_REJECT_MERGED:
        return reject_some(aligner);
    default:
        test_shifted(aligner);
        return 2;
    }
}
