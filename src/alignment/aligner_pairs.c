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

enum { TRIAL_ROUNDS = 4, MAX_PAIRED_NEIGHBOURS = 12, UNITS_PER_TRIAL = 4 };

/* A trial near another one replaces it, if better. At capacity it replaces the worst one, if better
 * or if that is in the last place. A list of the best trials alone, ranked, aligns no more scans
 * (docs/lab/align.md). */
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

/* Returns 1 when two segments of the current pair are long enough and the heading they imply is
 * within the prior. */
static int may_align(const cairn_aligner *aligner)
{
    const aligner_segment *k = &aligner->segments[aligner->cursor.item],
                          *l = &aligner->segments[aligner->cursor.inner];
    cairn_real cosine = cairn_vec2_dot(k->direction, l->direction),
               sine = cairn_vec2_cross(k->direction, l->direction);

    return k->length >= MIN_LENGTH_M && l->length >= MIN_LENGTH_M &&
           cosine * aligner->pairs.expected.cosine + sine * aligner->pairs.expected.sine >=
               aligner->pairs.least_cosine;
}

/* Starts a pair; returns 0 without segments to align. */
static int begin_pair(cairn_aligner *aligner)
{
    int32_t second =
        cairn_aligner_neighbour(aligner, aligner->cursor.scan, aligner->cursor.neighbour);
    const aligner_scan *a = &aligner->scans[aligner->cursor.scan], *b = &aligner->scans[second];

    aligner->pairs.second = second;
    aligner->pairs.trial_count = 0;
    aligner->pairs.least_cosine =
        cairn_cos(cairn_min(CAIRN_REAL(1.6) * aligner->params.max_initial_angle_error, CAIRN_PI));
    aligner->pairs.expected = cairn_transform_of(cairn_pose_between(b->initial, a->initial));
    return second < aligner->cursor.scan &&
           (aligner->cursor.neighbour < MAX_PAIRED_NEIGHBOURS ||
            cairn_aligner_has_neighbour(aligner, second, aligner->cursor.scan,
                                        MAX_PAIRED_NEIGHBOURS)) &&
           a->end_segment > a->first_segment && b->end_segment > b->first_segment;
}

/* Starts the count of the points of both scans at the pose of the current trial. */
static void begin_count(cairn_aligner *aligner, cairn_real gate)
{
    aligner_pair_search *pairs = &aligner->pairs;

    memset(&pairs->count, 0, sizeof pairs->count);
    cairn_aligner_begin_count(aligner, &aligner->walk, aligner->cursor.scan, pairs->second,
                              pairs->pose, gate, &pairs->count);
}

/* Aligns an end of the current segments, and starts the count of the points of the first scan;
 * returns 0 when the pose is too far from the expected one. */
static int begin_end(cairn_aligner *aligner)
{
    aligner_pair_search *pairs = &aligner->pairs;
    const aligner_segment *k = &aligner->segments[aligner->cursor.item],
                          *l = &aligner->segments[aligner->cursor.inner];
    cairn_transform expected = pairs->expected;
    cairn_vec2 from =
        cairn_vec2_add(k->a, cairn_vec2_scale(k->direction, pairs->end ? k->length : 0));
    cairn_vec2 to =
        cairn_vec2_add(l->a, cairn_vec2_scale(l->direction, pairs->end ? l->length : 0));
    cairn_real far = CAIRN_REAL(1.6) * aligner->params.max_initial_error +
                     aligner->params.max_initial_angle_error *
                         cairn_sqrt(expected.x * expected.x + expected.y * expected.y);

    pairs->pose = cairn_transform_mapping(cairn_vec2_dot(k->direction, l->direction),
                                          cairn_vec2_cross(k->direction, l->direction), from, to);
    if (!cairn_aligner_is_near(pairs->pose, expected, far, -2))
        return 0;
    begin_count(aligner, TRIAL_GATE_M);
    aligner->walk.least = MIN_HALF_NATS;
    return 1;
}

/* Continues with the points of the second scan; returns 0 when those of the first are against the
 * pose. */
static int begin_second_half(cairn_aligner *aligner)
{
    if (!(cairn_aligner_log_likelihood_ratio(aligner, aligner->pairs.count) > MIN_HALF_NATS))
        return 0;
    cairn_aligner_turn_walk(aligner, &aligner->walk);
    aligner->walk.least = MIN_TRIAL_NATS;
    return 1;
}

static void end_end(cairn_aligner *aligner)
{
    cairn_real score = cairn_aligner_log_likelihood_ratio(aligner, aligner->pairs.count);

    if (score > MIN_TRIAL_NATS)
        insert_trial(aligner, aligner->pairs.pose, score);
}

/* Step: adds the points of a scan. */
static int walk_points(cairn_aligner *aligner, cairn_budget *budget)
{
    return cairn_aligner_walk_points(aligner, &aligner->walk, budget);
}

/* Step: tries both ends of the current segments. */
static int try_segments(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_pair_search *pairs = &aligner->pairs;

    CAIRN_STEP_BEGIN(aligner->resume.part);
    for (pairs->end = 0; pairs->end < 2; pairs->end++) {
        ALIGNER_CHARGE(part, 1);
        if (!begin_end(aligner))
            continue;
        CAIRN_STEP_RUN(aligner, resume.part, budget, walk_points);
        if (begin_second_half(aligner))
            CAIRN_STEP_RUN(aligner, resume.part, budget, walk_points);
        end_end(aligner);
    }
    CAIRN_STEP_END(aligner->resume.part);
}

static aligner_hypothesis *current_trial(cairn_aligner *aligner)
{
    return &aligner->pairs.trial[aligner->pairs.trial_at];
}

static cairn_vec2 trial_centre(const cairn_aligner *aligner)
{
    return cairn_transform_point(aligner->pairs.pose, aligner->scans[aligner->cursor.scan].middle);
}

/* Starts a round of the refinement of the current trial. */
static void begin_round(cairn_aligner *aligner)
{
    static const cairn_transform same = {0, 0, 1, 0};
    aligner_pair_search *pairs = &aligner->pairs;

    memset(&pairs->sums, 0, sizeof pairs->sums);
    cairn_aligner_begin_equations(aligner, &aligner->walk, aligner->cursor.scan, pairs->second,
                                  pairs->pose, same,
                                  TRIAL_GATE_M - CAIRN_REAL(0.03) * (cairn_real)pairs->end,
                                  trial_centre(aligner), &pairs->sums);
}

/* Moves the trial; returns 0 without a solution. */
static int move_trial(cairn_aligner *aligner)
{
    cairn_real motion[3];

    if (!cairn_aligner_solve(&aligner->pairs.sums, motion))
        return 0;
    aligner->pairs.pose = cairn_aligner_moved(aligner->pairs.pose, trial_centre(aligner), motion);
    return 1;
}

static void end_trial(cairn_aligner *aligner)
{
    aligner_hypothesis *trial = current_trial(aligner);

    trial->second_first = cairn_pose_of(aligner->pairs.pose);
    trial->score = cairn_aligner_log_likelihood_ratio(aligner, aligner->pairs.count);
}

/* Step: refines the current trial. */
static int refine_trial(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_pair_search *pairs = &aligner->pairs;

    CAIRN_STEP_BEGIN(aligner->resume.part);
    ALIGNER_CHARGE(part, UNITS_PER_TRIAL);
    pairs->pose = cairn_transform_of(current_trial(aligner)->second_first);
    for (pairs->end = 0; pairs->end < TRIAL_ROUNDS; pairs->end++) {
        begin_round(aligner);
        CAIRN_STEP_RUN(aligner, resume.part, budget, walk_points);
        if (!move_trial(aligner))
            break;
    }
    begin_count(aligner, COUNT_GATE_M);
    CAIRN_STEP_UNTIL(aligner->resume.part,
                     cairn_aligner_walk_pair(aligner, &aligner->walk, budget));
    end_trial(aligner);
    CAIRN_STEP_END(aligner->resume.part);
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
        if (h->score >= trial->score)
            return;
    }
    *h = *trial;
    h->rank = h->score;
    h->first_stamp = h->second_stamp = -1;
}

/* Returns the units of a stored hypothesis. */
static int32_t storing_units(const cairn_aligner *aligner)
{
    return UNITS_PER_TRIAL + (aligner->hypothesis_count < aligner->params.max_hypotheses
                                  ? 0
                                  : aligner->hypothesis_count / 32);
}

/* Stores the best trial, and rejects those near it; returns 0 when there is none. */
static int store_best(cairn_aligner *aligner)
{
    aligner_hypothesis *best = NULL;
    cairn_transform pose;

    for (int32_t i = 0; i < aligner->pairs.trial_count; i++)
        if (aligner->pairs.trial[i].score > MIN_STORED_NATS &&
            (best == NULL || aligner->pairs.trial[i].score > best->score))
            best = &aligner->pairs.trial[i];
    if (best == NULL)
        return 0;
    store_hypothesis(aligner, best);
    pose = cairn_transform_of(best->second_first);
    for (int32_t i = 0; i < aligner->pairs.trial_count; i++)
        if (cairn_aligner_is_near(pose, cairn_transform_of(aligner->pairs.trial[i].second_first),
                                  NMS_RADIUS_M, CAIRN_REAL(0.9976)))
            aligner->pairs.trial[i].score = -1;
    return 1;
}

int cairn_aligner_register_pairs(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_cursor *cursor = &aligner->cursor;
    aligner_pair_search *pairs = &aligner->pairs;
    const aligner_scan *scans = aligner->scans;

    CAIRN_STEP_BEGIN(aligner->resume.phase);
    for (cursor->scan = 0; cursor->scan < aligner->scan_count; cursor->scan++)
        for (cursor->neighbour = 0; cursor->neighbour < scans[cursor->scan].neighbour_count;
             cursor->neighbour++) {
            ALIGNER_CHARGE(phase, 1);
            if (!begin_pair(aligner))
                continue;
            for (cursor->item = scans[cursor->scan].first_segment;
                 cursor->item < scans[cursor->scan].end_segment; cursor->item++) {
                ALIGNER_CHARGE(phase, 1 + (scans[pairs->second].end_segment -
                                           scans[pairs->second].first_segment) /
                                              ALIGNER_FAR_PAIRS_PER_UNIT);
                for (cursor->inner = scans[pairs->second].first_segment;
                     cursor->inner < scans[pairs->second].end_segment; cursor->inner++)
                    if (may_align(aligner))
                        CAIRN_STEP_RUN(aligner, resume.phase, budget, try_segments);
            }
            for (pairs->trial_at = 0; pairs->trial_at < pairs->trial_count; pairs->trial_at++)
                CAIRN_STEP_RUN(aligner, resume.phase, budget, refine_trial);
            for (cursor->item = 0; cursor->item < ALIGNER_MAX_KEPT_PER_PAIR; cursor->item++) {
                ALIGNER_CHARGE(phase, storing_units(aligner));
                if (!store_best(aligner))
                    break;
            }
        }
    aligner->result.hypotheses = aligner->hypothesis_count;
    CAIRN_STEP_END(aligner->resume.phase);
}
