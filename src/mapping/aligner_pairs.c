/* Relative poses of pairs of scans, from which clusters of the aligner grow.
 *
 * A hypothesis lays an end of a segment of one scan on the same end of a segment of the other.
 * What a pair of scans says for it is one look-up of all their points; the best few of a pair
 * are refined and kept. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/aligner_work.h"

static const cairn_real TRIAL_GATE = CAIRN_REAL(0.15), COUNT_GATE = CAIRN_REAL(0.07);
/* m, of a segment that gives a direction */
static const cairn_real LEAST_LENGTH = CAIRN_REAL(0.15);
/* nats, ... */
static const cairn_real LEAST_TRIAL = CAIRN_REAL(0.5), LEAST_KEPT = 1;
/* ... by the points of one scan of the two */
static const cairn_real LEAST_HALF = 0;
/* m */
static const cairn_real SAME_PLACE = CAIRN_REAL(0.15);

enum { TRIAL_ROUNDS = 4, CLOSEST = 12 };

static void keep_trial(cairn_aligner *x, cairn_transform pose, cairn_real score)
{
    int32_t worst = 0, i;

    for (i = 0; i < x->trial_count; i++) {
        if (cairn_aligner_near(pose, cairn_transform_of(x->trial[i].second_first), CAIRN_REAL(0.2),
                               CAIRN_REAL(0.9962)))
            break;
        if (x->trial[i].score < x->trial[worst].score)
            worst = i;
    }
    if (i == x->trial_count) {
        if (x->trial_count < ALIGNER_TRIALS)
            x->trial_count++;
        else
            i = worst;
        if (i == worst && i < x->trial_count - 1 && x->trial[i].score >= score)
            return;
        x->trial[i].score = -1;
    }
    if (score > x->trial[i].score) {
        x->trial[i].first = x->i;
        x->trial[i].second = x->second;
        x->trial[i].second_first = cairn_aligner_to_pose(pose);
        x->trial[i].score = score;
    }
}

/* Lays end `end` of segment k on that of l; returns units. */
static int32_t try_end(cairn_aligner *x, const aligner_segment *k, const aligner_segment *l,
                       int32_t end, cairn_transform expected)
{
    cairn_vec2 from = cairn_vec2_add(k->a, cairn_vec2_scale(k->direction, end ? k->length : 0));
    cairn_vec2 to = cairn_vec2_add(l->a, cairn_vec2_scale(l->direction, end ? l->length : 0));
    cairn_transform pose = {0, 0, cairn_vec2_dot(k->direction, l->direction),
                            cairn_vec2_cross(k->direction, l->direction)};
    cairn_real far =
        CAIRN_REAL(1.6) * x->params.spread +
        x->params.spread_angle * cairn_sqrt(expected.x * expected.x + expected.y * expected.y);
    int32_t first = x->i, second = x->second, work;
    aligner_count count = {0, 0, 0};
    cairn_real score;

    pose.x = to.x - (pose.cosine * from.x - pose.sine * from.y);
    pose.y = to.y - (pose.sine * from.x + pose.cosine * from.y);
    if (!cairn_aligner_near(pose, expected, far, -2))
        return 1;
    work = cairn_aligner_count_points(x, first, second, pose, TRIAL_GATE, LEAST_HALF, &count);
    if (cairn_aligner_evidence(x, count) > LEAST_HALF)
        work += cairn_aligner_count_points(x, second, first, cairn_aligner_inverse(pose),
                                           TRIAL_GATE, LEAST_TRIAL, &count);
    score = cairn_aligner_evidence(x, count);
    if (score > LEAST_TRIAL)
        keep_trial(x, pose, score);
    return 1 + work / ALIGNER_POINTS_OF_UNIT;
}

/* The next partner of scan i before it. */
static void next_pair(cairn_aligner *x)
{
    x->j++;
    x->k = 0;
    x->l = 0;
    x->trial_count = 0;
}

/* 1 when two segments of the pair at hand are long enough and the headings that lay one on the
 * other are expected. */
static int may_fit(const cairn_aligner *x, const aligner_segment *k, const aligner_segment *l)
{
    cairn_real cosine = cairn_vec2_dot(k->direction, l->direction),
               sine = cairn_vec2_cross(k->direction, l->direction);

    return k->length >= LEAST_LENGTH && l->length >= LEAST_LENGTH &&
           cosine * x->expected.cosine + sine * x->expected.sine >= x->least_cosine;
}

/* The pair at hand; 0 when there is nothing to lay on each other. */
static int begin_pair(cairn_aligner *x, int32_t second)
{
    const aligner_scan *a = &x->scans[x->i], *b = &x->scans[second];

    x->second = second;
    x->least_cosine = cairn_cos(cairn_min(CAIRN_REAL(1.6) * x->params.spread_angle, CAIRN_PI));
    x->expected = cairn_transform_of(cairn_pose_between(b->initial, a->initial));
    return second < x->i &&
           (x->j < CLOSEST || cairn_aligner_has_partner(x, second, x->i, CLOSEST)) &&
           a->end_segment > a->first_segment && b->end_segment > b->first_segment;
}

/* One pair of segments of a pair of scans. */
static int32_t try_segments(cairn_aligner *x)
{
    const aligner_scan *first = &x->scans[x->i], *second;
    const aligner_segment *k, *l;
    int32_t passed = 0, units = 1;

    if (x->j == first->partner_count) {
        x->i++;
        x->j = 0;
        return 1;
    }
    if (x->k == 0 && x->l == 0 && !begin_pair(x, cairn_aligner_partner(x, x->i, x->j))) {
        next_pair(x);
        return 1;
    }
    if (first->first_segment + x->k == first->end_segment) {
        x->phase = ALIGNER_TRIALS_OF_PAIR;
        x->trial_at = 0;
        return 1;
    }
    second = &x->scans[x->second];
    k = &x->segments[first->first_segment + x->k];
    for (;;) {
        l = &x->segments[second->first_segment + x->l++];
        if (may_fit(x, k, l))
            break;
        passed++;
        if (second->first_segment + x->l == second->end_segment)
            break;
    }
    if (may_fit(x, k, l))
        for (int32_t end = 0; end < 2; end++)
            units += try_end(x, k, l, end, x->expected);
    if (second->first_segment + x->l == second->end_segment) {
        x->l = 0;
        x->k++;
    }
    return units + passed / ALIGNER_FAR_OF_UNIT;
}

/* Refines a trial of the pair at hand. */
static int32_t refine_trial(cairn_aligner *x, aligner_hypothesis *trial)
{
    cairn_transform pose = cairn_transform_of(trial->second_first), same = {0, 0, 1, 0};
    aligner_count count = {0, 0, 0};
    int32_t work = 0;

    for (int32_t round = 0; round < TRIAL_ROUNDS; round++) {
        cairn_real gate = TRIAL_GATE - CAIRN_REAL(0.03) * (cairn_real)round, motion[3];
        cairn_vec2 centre = cairn_transform_point(pose, x->scans[trial->first].middle);
        aligner_sums sums;

        memset(&sums, 0, sizeof sums);
        work +=
            cairn_aligner_pull(x, trial->first, trial->second, pose, same, gate, 1, centre, &sums);
        if (!cairn_aligner_solve(&sums, motion))
            break;
        pose = cairn_aligner_moved(pose, centre, motion);
    }
    trial->second_first = cairn_aligner_to_pose(pose);
    work += cairn_aligner_count_pair(x, trial->first, trial->second, pose, COUNT_GATE, &count);
    trial->score = cairn_aligner_evidence(x, count);
    return 4 + work / ALIGNER_POINTS_OF_UNIT;
}

/* Enters a hypothesis; when there is no room it takes the place of the worst that is worse. */
static void enter(cairn_aligner *x, const aligner_hypothesis *trial)
{
    aligner_hypothesis *h = x->hypotheses;

    if (x->hypothesis_count < x->params.max_hypotheses) {
        h += x->hypothesis_count++;
    } else {
        x->result.dropped++;
        for (int32_t i = 1; i < x->hypothesis_count; i++)
            if (x->hypotheses[i].score < h->score)
                h = &x->hypotheses[i];
        x->debt += x->hypothesis_count / 32;
        if (h->score >= trial->score)
            return;
    }
    *h = *trial;
    h->key = h->score;
    h->first_stamp = h->second_stamp = -1;
}

static void enter_best(cairn_aligner *x)
{
    for (int32_t kept = 0; kept < ALIGNER_KEPT; kept++) {
        aligner_hypothesis *best = NULL;
        cairn_transform pose;

        for (int32_t i = 0; i < x->trial_count; i++)
            if (x->trial[i].score > LEAST_KEPT && (best == NULL || x->trial[i].score > best->score))
                best = &x->trial[i];
        if (best == NULL)
            return;
        enter(x, best);
        pose = cairn_transform_of(best->second_first);
        for (int32_t i = 0; i < x->trial_count; i++)
            if (cairn_aligner_near(pose, cairn_transform_of(x->trial[i].second_first), SAME_PLACE,
                                   CAIRN_REAL(0.9976)))
                x->trial[i].score = -1;
    }
}

int32_t cairn_aligner_pairs_item(cairn_aligner *x)
{
    if (x->phase == ALIGNER_PAIRS) {
        if (x->i == x->scan_count) {
            x->result.hypotheses = x->hypothesis_count;
            cairn_aligner_begin_open(x, 0);
            return 1;
        }
        return try_segments(x);
    }
    if (x->trial_at < x->trial_count)
        return refine_trial(x, &x->trial[x->trial_at++]);
    enter_best(x);
    next_pair(x);
    x->phase = ALIGNER_PAIRS;
    return ALIGNER_TRIALS;
}
