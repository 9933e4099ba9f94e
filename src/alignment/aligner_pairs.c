/* aligner: pairwise registration, hypotheses of relative poses.
 *
 * Method:
 * 1. An end of a segment of one scan is aligned with the same end of a segment of the other.
 * 2. Score: one lookup of all their points, with early rejection; non-maximum suppression.
 * 3. The best few poses of a pair are refined by Gauss-Newton and stored. */
#include "src/base/build.h"

#include <string.h>

#include "src/alignment/aligner_work.h"

static const cairn_real TRIAL_GATE_M = CAIRN_REAL(0.15), COUNT_GATE_M = CAIRN_REAL(0.07);
/* m: least length of a segment with a direction */
static const cairn_real MIN_LENGTH_M = CAIRN_REAL(0.15);
/* nats: least score of a trial, and of a stored hypothesis */
static const cairn_real MIN_TRIAL_NATS = CAIRN_REAL(0.5), MIN_STORED_NATS = 1;
/* nats: least score by the points of one of the two scans */
static const cairn_real MIN_HALF_NATS = 0;
/* m: non-maximum-suppression radius */
static const cairn_real NMS_RADIUS_M = CAIRN_REAL(0.15);

enum { TRIAL_ROUNDS = 4, MAX_PAIRED_NEIGHBOURS = 12 };

static void insert_trial(cairn_aligner *aligner, cairn_transform pose, cairn_real score)
{
    int32_t worst = 0, i;

    for (i = 0; i < aligner->pairs.trial_count; i++) {
        if (cairn_aligner_is_near(pose, cairn_transform_of(aligner->pairs.trial[i].second_first),
                                  CAIRN_REAL(0.2), CAIRN_REAL(0.9962)))
            break;
        if (aligner->pairs.trial[i].score < aligner->pairs.trial[worst].score)
            worst = i;
    }
    if (i == aligner->pairs.trial_count) {
        if (aligner->pairs.trial_count < ALIGNER_MAX_TRIALS)
            aligner->pairs.trial_count++;
        else
            i = worst;
        if (i == worst && i < aligner->pairs.trial_count - 1 &&
            aligner->pairs.trial[i].score >= score)
            return;
        aligner->pairs.trial[i].score = -1;
    }
    if (score > aligner->pairs.trial[i].score) {
        aligner->pairs.trial[i].first = aligner->cursor.scan;
        aligner->pairs.trial[i].second = aligner->pairs.second;
        aligner->pairs.trial[i].second_first = cairn_pose_of(pose);
        aligner->pairs.trial[i].score = score;
    }
}

/* Aligns end `end` of segment k with that of l; returns units. */
static int32_t try_end(cairn_aligner *aligner, const aligner_segment *k, const aligner_segment *l,
                       int32_t end, cairn_transform expected)
{
    cairn_vec2 from = cairn_vec2_add(k->a, cairn_vec2_scale(k->direction, end ? k->length : 0));
    cairn_vec2 to = cairn_vec2_add(l->a, cairn_vec2_scale(l->direction, end ? l->length : 0));
    cairn_transform pose =
        cairn_transform_mapping(cairn_vec2_dot(k->direction, l->direction),
                                cairn_vec2_cross(k->direction, l->direction), from, to);
    cairn_real far = CAIRN_REAL(1.6) * aligner->params.max_initial_error +
                     aligner->params.max_initial_angle_error *
                         cairn_sqrt(expected.x * expected.x + expected.y * expected.y);
    int32_t first = aligner->cursor.scan, second = aligner->pairs.second, work;
    aligner_count count = {0, 0, 0};
    cairn_real score;

    if (!cairn_aligner_is_near(pose, expected, far, -2))
        return 1;
    work = cairn_aligner_count_points(aligner, first, second, pose, TRIAL_GATE_M, MIN_HALF_NATS,
                                      &count);
    if (cairn_aligner_log_likelihood_ratio(aligner, count) > MIN_HALF_NATS)
        work += cairn_aligner_count_points(aligner, second, first, cairn_transform_inverse(pose),
                                           TRIAL_GATE_M, MIN_TRIAL_NATS, &count);
    score = cairn_aligner_log_likelihood_ratio(aligner, count);
    if (score > MIN_TRIAL_NATS)
        insert_trial(aligner, pose, score);
    return 1 + work / ALIGNER_POINTS_PER_UNIT;
}

/* Advances to the next neighbour of the current scan. */
static void next_pair(cairn_aligner *aligner)
{
    aligner->cursor.neighbour++;
    aligner->cursor.item = 0;
    aligner->cursor.inner = 0;
    aligner->pairs.trial_count = 0;
}

/* Returns 1 when two segments of the current pair are long enough and the heading they imply is
 * within the prior. */
static int may_align(const cairn_aligner *aligner, const aligner_segment *k,
                     const aligner_segment *l)
{
    cairn_real cosine = cairn_vec2_dot(k->direction, l->direction),
               sine = cairn_vec2_cross(k->direction, l->direction);

    return k->length >= MIN_LENGTH_M && l->length >= MIN_LENGTH_M &&
           cosine * aligner->pairs.expected.cosine + sine * aligner->pairs.expected.sine >=
               aligner->pairs.least_cosine;
}

/* Starts a pair; returns 0 without segments to align. */
static int begin_pair(cairn_aligner *aligner, int32_t second)
{
    const aligner_scan *a = &aligner->scans[aligner->cursor.scan], *b = &aligner->scans[second];

    aligner->pairs.second = second;
    aligner->pairs.least_cosine =
        cairn_cos(cairn_min(CAIRN_REAL(1.6) * aligner->params.max_initial_angle_error, CAIRN_PI));
    aligner->pairs.expected = cairn_transform_of(cairn_pose_between(b->initial, a->initial));
    return second < aligner->cursor.scan &&
           (aligner->cursor.neighbour < MAX_PAIRED_NEIGHBOURS ||
            cairn_aligner_has_neighbour(aligner, second, aligner->cursor.scan,
                                        MAX_PAIRED_NEIGHBOURS)) &&
           a->end_segment > a->first_segment && b->end_segment > b->first_segment;
}

/* One pair of segments of a pair of scans. */
static int32_t try_segments(cairn_aligner *aligner)
{
    const aligner_scan *first = &aligner->scans[aligner->cursor.scan], *second;
    const aligner_segment *k, *l;
    int32_t passed = 0, units = 1;

    if (aligner->cursor.neighbour == first->neighbour_count) {
        aligner->cursor.scan++;
        aligner->cursor.neighbour = 0;
        return 1;
    }
    if (aligner->cursor.item == 0 && aligner->cursor.inner == 0 &&
        !begin_pair(aligner, cairn_aligner_neighbour(aligner, aligner->cursor.scan,
                                                     aligner->cursor.neighbour))) {
        next_pair(aligner);
        return 1;
    }
    if (first->first_segment + aligner->cursor.item == first->end_segment) {
        aligner->phase = ALIGNER_REFINE_TRIALS;
        aligner->pairs.trial_at = 0;
        return 1;
    }
    second = &aligner->scans[aligner->pairs.second];
    k = &aligner->segments[first->first_segment + aligner->cursor.item];
    for (;;) {
        l = &aligner->segments[second->first_segment + aligner->cursor.inner++];
        if (may_align(aligner, k, l))
            break;
        passed++;
        if (second->first_segment + aligner->cursor.inner == second->end_segment)
            break;
    }
    if (may_align(aligner, k, l))
        for (int32_t end = 0; end < 2; end++)
            units += try_end(aligner, k, l, end, aligner->pairs.expected);
    if (second->first_segment + aligner->cursor.inner == second->end_segment) {
        aligner->cursor.inner = 0;
        aligner->cursor.item++;
    }
    return units + passed / ALIGNER_FAR_PAIRS_PER_UNIT;
}

/* Refines a trial of the current pair. */
static int32_t refine_trial(cairn_aligner *aligner, aligner_hypothesis *trial)
{
    cairn_transform pose = cairn_transform_of(trial->second_first), same = {0, 0, 1, 0};
    aligner_count count = {0, 0, 0};
    int32_t work = 0;

    for (int32_t round = 0; round < TRIAL_ROUNDS; round++) {
        cairn_real gate = TRIAL_GATE_M - CAIRN_REAL(0.03) * (cairn_real)round, motion[3];
        cairn_vec2 centre = cairn_transform_point(pose, aligner->scans[trial->first].middle);
        aligner_sums sums;

        memset(&sums, 0, sizeof sums);
        work += cairn_aligner_add_normal_equations(aligner, trial->first, trial->second, pose, same,
                                                   gate, 1, centre, &sums);
        if (!cairn_aligner_solve(&sums, motion))
            break;
        pose = cairn_aligner_moved(pose, centre, motion);
    }
    trial->second_first = cairn_pose_of(pose);
    work +=
        cairn_aligner_count_pair(aligner, trial->first, trial->second, pose, COUNT_GATE_M, &count);
    trial->score = cairn_aligner_log_likelihood_ratio(aligner, count);
    return 4 + work / ALIGNER_POINTS_PER_UNIT;
}

/* Stores a hypothesis; at capacity it replaces the worst one, if better. */
static void store_hypothesis(cairn_aligner *aligner, const aligner_hypothesis *trial)
{
    aligner_hypothesis *h = aligner->hypotheses;

    if (aligner->hypothesis_count < aligner->params.max_hypotheses) {
        h += aligner->hypothesis_count++;
    } else {
        aligner->result.dropped++;
        for (int32_t i = 1; i < aligner->hypothesis_count; i++)
            if (aligner->hypotheses[i].score < h->score)
                h = &aligner->hypotheses[i];
        aligner->units_due += aligner->hypothesis_count / 32;
        if (h->score >= trial->score)
            return;
    }
    *h = *trial;
    h->rank = h->score;
    h->first_stamp = h->second_stamp = -1;
}

static void store_best(cairn_aligner *aligner)
{
    for (int32_t kept = 0; kept < ALIGNER_MAX_KEPT_PER_PAIR; kept++) {
        aligner_hypothesis *best = NULL;
        cairn_transform pose;

        for (int32_t i = 0; i < aligner->pairs.trial_count; i++)
            if (aligner->pairs.trial[i].score > MIN_STORED_NATS &&
                (best == NULL || aligner->pairs.trial[i].score > best->score))
                best = &aligner->pairs.trial[i];
        if (best == NULL)
            return;
        store_hypothesis(aligner, best);
        pose = cairn_transform_of(best->second_first);
        for (int32_t i = 0; i < aligner->pairs.trial_count; i++)
            if (cairn_aligner_is_near(pose,
                                      cairn_transform_of(aligner->pairs.trial[i].second_first),
                                      NMS_RADIUS_M, CAIRN_REAL(0.9976)))
                aligner->pairs.trial[i].score = -1;
    }
}

int32_t cairn_aligner_pairs_item(cairn_aligner *aligner)
{
    if (aligner->phase == ALIGNER_PAIRS) {
        if (aligner->cursor.scan == aligner->scan_count) {
            aligner->result.hypotheses = aligner->hypothesis_count;
            cairn_aligner_begin_merging(aligner, 0);
            return 1;
        }
        return try_segments(aligner);
    }
    if (aligner->pairs.trial_at < aligner->pairs.trial_count)
        return refine_trial(aligner, &aligner->pairs.trial[aligner->pairs.trial_at++]);
    store_best(aligner);
    next_pair(aligner);
    aligner->phase = ALIGNER_PAIRS;
    return ALIGNER_MAX_TRIALS;
}
