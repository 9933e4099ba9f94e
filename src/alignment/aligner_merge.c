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
enum { LINKS_PER_UNIT = 8, BLOCKS_PER_UNIT = 16, MERGED_PER_UNIT = 4 };
enum { UNITS_PER_VERIFICATION = 6 };

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

/* Starts the evaluation of a pose of the first scan's cluster in the frame of the second's. */
static void begin_evaluation(cairn_aligner *aligner, const aligner_hypothesis *hypothesis,
                             cairn_transform pose, int32_t rounds, cairn_real min_prior)
{
    cairn_aligner_begin_evaluation(aligner, cluster_of(aligner, hypothesis->first),
                                   cluster_of(aligner, hypothesis->second), pose, rounds,
                                   min_prior);
}

/* Ends the evaluation of a hypothesis whose prior is below any possible gain. */
static void reject(cairn_aligner *aligner, aligner_hypothesis *hypothesis)
{
    aligner->evaluation.is_active = 0;
    hypothesis->state = ALIGNER_REJECTED;
    invalidate_block(aligner, hypothesis);
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

/* Step: evaluates a hypothesis, unless its prior rejects it. */
static int evaluate(cairn_aligner *aligner, cairn_budget *budget, aligner_hypothesis *hypothesis)
{
    CAIRN_STEP_BEGIN(aligner->resume.item);
    ALIGNER_CHARGE(item, 2);
    begin_evaluation(aligner, hypothesis, clusters_pose(aligner, hypothesis),
                     hypothesis->first_stamp < 0 ? 1 : EVALUATION_ROUNDS, MIN_PRIOR_NATS);
    CAIRN_STEP_RUN(aligner, resume.item, budget, cairn_aligner_find_prior);
    if (aligner->evaluation.log_prior < MIN_PRIOR_NATS) {
        reject(aligner, hypothesis);
    } else {
        CAIRN_STEP_RUN(aligner, resume.item, budget, cairn_aligner_evaluate);
        store_evaluation(aligner, hypothesis);
    }
    CAIRN_STEP_END(aligner->resume.item);
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

/* Returns the hypothesis of the greatest rank; -1: none is above the threshold. */
static int32_t best_hypothesis(const cairn_aligner *aligner)
{
    int32_t best = -1;

    for (int32_t block = 0; block < blocks_of(aligner); block++) {
        int32_t own = aligner->best_of_block[block];

        if (own >= 0 &&
            (best < 0 || aligner->hypotheses[own].rank > aligner->hypotheses[best].rank))
            best = own;
    }
    return best;
}

/* Step: finds the hypothesis of the greatest rank. */
static int find_best(cairn_aligner *aligner, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(aligner->resume.item);
    ALIGNER_CHARGE(item, 1 + blocks_of(aligner) / BLOCKS_PER_UNIT);
    for (aligner->merging.passed = 0; aligner->merging.passed < blocks_of(aligner);
         aligner->merging.passed++)
        if (aligner->best_of_block[aligner->merging.passed] == NOT_EVALUATED) {
            ALIGNER_CHARGE(item, ALIGNER_HYPOTHESIS_BLOCK / 16);
            find_best_of_block(aligner, aligner->merging.passed);
        }
    aligner->merging.best = best_hypothesis(aligner);
    CAIRN_STEP_END(aligner->resume.item);
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

static aligner_hypothesis *chosen_hypothesis(const cairn_aligner *aligner)
{
    return &aligner->hypotheses[aligner->merging.chosen];
}

/* Starts the list of competing hypotheses: those of the scans of the smaller cluster. */
static void begin_competing(cairn_aligner *aligner)
{
    const aligner_hypothesis *h = chosen_hypothesis(aligner);
    int32_t a = cluster_of(aligner, h->first), b = cluster_of(aligner, h->second);

    aligner->merging.competing_scan =
        aligner->clusters[aligner->clusters[a].size <= aligner->clusters[b].size ? a : b].head;
    aligner->merging.competing_link = aligner->links[aligner->merging.competing_scan];
    aligner->merging.passed = 0;
}

/* Passes one link of the list: the competing hypothesis there, if any; at the end competing_scan is
 * below 0. */
static void pass_link(cairn_aligner *aligner)
{
    aligner_merging *merging = &aligner->merging;
    int32_t link = merging->competing_link;

    merging->passed++;
    merging->competing = -1;
    if (link < 0) {
        merging->competing_scan = aligner->scans[merging->competing_scan].next_in_cluster;
        if (merging->competing_scan >= 0)
            merging->competing_link = aligner->links[merging->competing_scan];
        return;
    }
    merging->competing_link = aligner->hypotheses[link / 2].next[link & 1];
    if (is_competing(aligner, chosen_hypothesis(aligner), &aligner->hypotheses[link / 2]))
        merging->competing = link / 2;
}

/* Step: the next competing hypothesis, -1: none is left; the comparison with it is charged. */
static int find_competing(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_merging *merging = &aligner->merging;

    CAIRN_STEP_BEGIN(aligner->resume.item);
    for (merging->competing = -1; merging->competing_scan >= 0 && merging->competing < 0;) {
        ALIGNER_CHARGE_EVERY(item, LINKS_PER_UNIT, merging->passed);
        pass_link(aligner);
    }
    ALIGNER_CHARGE(item, merging->competing >= 0);
    CAIRN_STEP_END(aligner->resume.item);
}

/* Returns the pose of the chosen hypothesis' first scan in the other cluster's frame, by hypothesis
 * g. */
static cairn_transform pose_by(const cairn_aligner *aligner, const aligner_hypothesis *hypothesis)
{
    const aligner_hypothesis *h = chosen_hypothesis(aligner);

    return cairn_transform_compose(competing_pose(aligner, h, hypothesis),
                                   aligner->poses[h->first]);
}

/* Returns 1 when the competing hypothesis is outdated, and may matter; not with the same pose. */
static int is_evaluation_due(const cairn_aligner *aligner)
{
    const aligner_hypothesis *h = chosen_hypothesis(aligner),
                             *g = &aligner->hypotheses[aligner->merging.competing];

    return !is_fresh(aligner, g) && g->score >= h->score - COMPETING_MARGIN_NATS &&
           !cairn_aligner_is_near(pose_by(aligner, h), pose_by(aligner, g), SAME_POSE_M,
                                  SAME_HEADING_COSINE);
}

/* Adds the odds of the competing hypothesis; a duplicate is rejected. */
static void compare(cairn_aligner *aligner)
{
    const aligner_hypothesis *h = chosen_hypothesis(aligner);
    aligner_hypothesis *g = &aligner->hypotheses[aligner->merging.competing];
    cairn_transform pose = pose_by(aligner, h), competing = pose_by(aligner, g);

    if (is_fresh(aligner, g) &&
        !cairn_aligner_is_near(pose, competing, SAME_POSE_M, SAME_HEADING_COSINE)) {
        aligner->merging.competing_odds += cairn_exp(cairn_min(g->score, 60));
    } else if (g->score <= h->score &&
               cairn_aligner_is_near(pose, competing, SAME_POSE_M / 3, CAIRN_REAL(0.9998))) {
        g->state = ALIGNER_REJECTED;
        invalidate_block(aligner, g);
    }
}

static void end_comparison(cairn_aligner *aligner)
{
    aligner_hypothesis *h = chosen_hypothesis(aligner);

    h->rank = h->score - cairn_log(aligner->merging.competing_odds);
    h->state = ALIGNER_COMPARED;
    invalidate_block(aligner, h);
}

/* Step: evaluates the competing hypotheses that are outdated; then, when the chosen one is still
 * the best, adds up the odds of all. */
static int compare_competing(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_merging *merging = &aligner->merging;

    CAIRN_STEP_BEGIN(aligner->resume.part);
    ALIGNER_CHARGE(part, 2);
    begin_competing(aligner);
    for (;;) {
        CAIRN_STEP_RUN(aligner, resume.part, budget, find_competing);
        if (merging->competing < 0)
            break;
        if (is_evaluation_due(aligner))
            CAIRN_STEP_UNTIL(aligner->resume.part,
                             evaluate(aligner, budget, &aligner->hypotheses[merging->competing]));
    }
    CAIRN_STEP_RUN(aligner, resume.part, budget, find_best);
    if (merging->best == merging->chosen) {
        ALIGNER_CHARGE(part, 2);
        merging->competing_odds = 1;
        begin_competing(aligner);
        for (;;) {
            CAIRN_STEP_RUN(aligner, resume.part, budget, find_competing);
            if (merging->competing < 0)
                break;
            compare(aligner);
        }
        end_comparison(aligner);
    }
    CAIRN_STEP_END(aligner->resume.part);
}

/* Starts the evaluation of the chosen hypothesis for its least observable direction. */
static void begin_unshifted(cairn_aligner *aligner)
{
    const aligner_hypothesis *h = chosen_hypothesis(aligner);

    begin_evaluation(aligner, h, clusters_pose(aligner, h), 1, CAIRN_REAL_MAX);
}

static void end_unshifted(cairn_aligner *aligner)
{
    memcpy(aligner->merging.shift, aligner->evaluation.weak_direction,
           sizeof aligner->merging.shift);
    aligner->merging.shift_centre = aligner->evaluation.centre;
    aligner->move.second_best_score = 0;
}

static void begin_shifted(cairn_aligner *aligner)
{
    const aligner_hypothesis *h = chosen_hypothesis(aligner);
    cairn_real motion[3];

    for (int k = 0; k < 3; k++)
        motion[k] = (aligner->merging.side == 1 ? SHIFT_M : -SHIFT_M) * aligner->merging.shift[k];
    begin_evaluation(
        aligner, h,
        cairn_aligner_moved(clusters_pose(aligner, h), aligner->merging.shift_centre, motion), 0,
        MIN_SHIFTED_NATS);
}

static void end_shifted(cairn_aligner *aligner)
{
    aligner->move.second_best_score =
        cairn_max(aligner->move.second_best_score,
                  aligner->evaluation.log_likelihood_ratio + aligner->evaluation.log_prior);
}

static void end_verification(cairn_aligner *aligner)
{
    aligner_hypothesis *h = chosen_hypothesis(aligner);

    h->rank = cairn_min(h->rank, h->score - aligner->move.second_best_score);
    h->state = ALIGNER_VERIFIED;
    invalidate_block(aligner, h);
}

/* Step: evaluates the least observable direction, then both shifted poses. */
static int verify(cairn_aligner *aligner, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(aligner->resume.part);
    ALIGNER_CHARGE(part, UNITS_PER_VERIFICATION);
    begin_unshifted(aligner);
    CAIRN_STEP_RUN(aligner, resume.part, budget, cairn_aligner_evaluate);
    end_unshifted(aligner);
    for (aligner->merging.side = 1; aligner->merging.side <= 2; aligner->merging.side++) {
        begin_shifted(aligner);
        CAIRN_STEP_RUN(aligner, resume.part, budget, cairn_aligner_evaluate);
        end_shifted(aligner);
    }
    end_verification(aligner);
    CAIRN_STEP_END(aligner->resume.part);
}

static void link_to(cairn_aligner *aligner, int32_t hypothesis, int32_t side, int32_t scan)
{
    aligner->hypotheses[hypothesis].next[side] = aligner->links[scan];
    aligner->links[scan] = 2 * hypothesis + side;
}

/* Returns 1 when both scans of a hypothesis are in one cluster. */
static int is_within_cluster(const cairn_aligner *aligner, const aligner_hypothesis *hypothesis)
{
    return cluster_of(aligner, hypothesis->first) == cluster_of(aligner, hypothesis->second);
}

/* Links a hypothesis; one within a cluster is rejected. */
static void link_hypothesis(cairn_aligner *aligner, int32_t hypothesis)
{
    aligner_hypothesis *h = &aligner->hypotheses[hypothesis];

    if (aligner->relocalization_rounds > 0) {
        h->rank = cairn_max(h->score, aligner->params.min_log_likelihood_ratio * 2);
        h->first_stamp = -1;
    }
    h->state = is_within_cluster(aligner, h) ? ALIGNER_REJECTED : ALIGNER_EVALUATED;
    link_to(aligner, hypothesis, 0, h->first);
    link_to(aligner, hypothesis, 1, h->second);
    invalidate_block(aligner, h);
}

/* Rejects the hypothesis of a link when it is within a cluster; returns the scan's next link. */
static int32_t reject_within(cairn_aligner *aligner, int32_t link)
{
    aligner_hypothesis *h = &aligner->hypotheses[link / 2];

    if (h->state != ALIGNER_REJECTED && is_within_cluster(aligner, h)) {
        h->state = ALIGNER_REJECTED;
        invalidate_block(aligner, h);
    }
    return h->next[link & 1];
}

/* Returns the scans of the smaller cluster of the chosen hypothesis. */
static int32_t scans_to_merge(const cairn_aligner *aligner)
{
    const aligner_hypothesis *h = chosen_hypothesis(aligner);
    int32_t a = aligner->clusters[cluster_of(aligner, h->first)].size,
            b = aligner->clusters[cluster_of(aligner, h->second)].size;

    return a < b ? a : b;
}

/* Merges; the scans of the smaller cluster come first in the list. */
static void merge_chosen(cairn_aligner *aligner)
{
    const aligner_hypothesis *h = chosen_hypothesis(aligner);
    int32_t a = cluster_of(aligner, h->first), b = cluster_of(aligner, h->second), joined;

    aligner->cursor.inner = scans_to_merge(aligner);
    joined = cairn_aligner_merge_clusters(aligner, a, b, clusters_pose(aligner, h));
    aligner->cursor.scan = aligner->clusters[joined].head;
    aligner->result.merges++;
    cairn_aligner_begin_relax(aligner, joined, CAIRN_REAL(0.08),
                              aligner->clusters[joined].size < 6 ? 3 : 2, 0);
}

/* Step: merges the clusters of the chosen hypothesis, and rejects those within the merged one. */
static int merge_clusters(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_cursor *cursor = &aligner->cursor;

    CAIRN_STEP_BEGIN(aligner->resume.part);
    ALIGNER_CHARGE(part, 1 + scans_to_merge(aligner) / MERGED_PER_UNIT);
    merge_chosen(aligner);
    CAIRN_STEP_RUN(aligner, resume.part, budget, cairn_aligner_relax);
    for (; cursor->inner > 0; cursor->inner--) {
        ALIGNER_CHARGE(part, 1);
        aligner->merging.passed = 0;
        for (cursor->item = aligner->links[cursor->scan]; cursor->item >= 0;) {
            if (++aligner->merging.passed % LINKS_PER_UNIT == 0)
                ALIGNER_CHARGE(part, 1);
            cursor->item = reject_within(aligner, cursor->item);
        }
        cursor->scan = aligner->scans[cursor->scan].next_in_cluster;
    }
    CAIRN_STEP_END(aligner->resume.part);
}

int cairn_aligner_merge(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_merging *merging = &aligner->merging;

    CAIRN_STEP_BEGIN(aligner->resume.phase);
    CAIRN_STEP_RUN(aligner, resume.phase, budget, cairn_aligner_charge_scans);
    for (int32_t i = 0; i < aligner->scan_count; i++)
        aligner->links[i] = -1;
    for (aligner->cursor.item = 0; aligner->cursor.item < aligner->hypothesis_count;
         aligner->cursor.item++) {
        ALIGNER_CHARGE_EVERY(phase, LINKS_PER_UNIT, aligner->cursor.item);
        link_hypothesis(aligner, aligner->cursor.item);
    }
    for (;;) {
        CAIRN_STEP_RUN(aligner, resume.phase, budget, find_best);
        if (merging->best < 0)
            break;
        merging->chosen = merging->best;
        if (!is_fresh(aligner, chosen_hypothesis(aligner)))
            CAIRN_STEP_UNTIL(aligner->resume.phase,
                             evaluate(aligner, budget, chosen_hypothesis(aligner)));
        else if (chosen_hypothesis(aligner)->state == ALIGNER_EVALUATED)
            CAIRN_STEP_RUN(aligner, resume.phase, budget, compare_competing);
        else if (chosen_hypothesis(aligner)->state == ALIGNER_COMPARED)
            CAIRN_STEP_RUN(aligner, resume.phase, budget, verify);
        else
            CAIRN_STEP_RUN(aligner, resume.phase, budget, merge_clusters);
    }
    CAIRN_STEP_END(aligner->resume.phase);
}
