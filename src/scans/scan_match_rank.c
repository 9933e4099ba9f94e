/* scan_match: ranking, non-maximum suppression and decision. scan_match.c describes the method.
 *
 * The log odds are a logistic regression of "correct" against "places without overlap": simulated
 * half and full circles and real logs of half circles, 0.10 m spacing. A chance similarity has
 * fewer inliers, more free-space violations, and competing hypotheses of nearly the same score. */
#include "src/base/build.h"

#include "src/containers/heap.h"
#include "src/containers/ranked_list.h"
#include "src/scans/scan_match_work.h"

/* Duplicates: hypotheses within this distance and angle. */
static const cairn_real DUPLICATE_DISTANCE = 2; /* spacings */
static const cairn_real DUPLICATE_ANGLE_RAD = CAIRN_REAL(0.06);
/* Peaks of neighbouring headings within this distance are one. */
static const cairn_real PEAK_DISTANCE = CAIRN_REAL(1.5); /* spacings */
static const cairn_real PEAK_HEADING_STEPS = CAIRN_REAL(1.5);
/* Competing hypotheses: beyond this distance or angle. */
static const cairn_real COMPETING_DISTANCE = 4; /* spacings */
static const cairn_real COMPETING_ANGLE_RAD = CAIRN_REAL(0.15);
/* Coefficients of the log odds, see the head of this file. */
static const cairn_real LOG_ODDS_BIAS = CAIRN_REAL(-4.2), LOG_ODDS_PER_LOG_FIT = 3,
                        LOG_ODDS_PER_VIOLATION = -16, LOG_ODDS_PER_TARGET_VIOLATION = -17;
static const cairn_real LOG_ODDS_PER_LOG_POINTS = CAIRN_REAL(2.9),
                        LOG_ODDS_PER_COMPETING_RATIO = -5;
static const cairn_real MIN_FIT = CAIRN_REAL(0.01);
static const cairn_real MIN_LOG_ODDS = CAIRN_REAL(0.5);
/* ratio of the second score to the best from which a match is ambiguous */
static const cairn_real AMBIGUITY_RATIO = CAIRN_REAL(0.9);
/* A competing hypothesis is possible from these log odds of its own, with free-space violations of
 * at most this. */
static const cairn_real MIN_COMPETING_LOG_ODDS = 4, MAX_COMPETING_VIOLATION = CAIRN_REAL(0.02);

/* parts of a unit: a candidate, and its comparison with a hypothesis */
enum { PARTS_PER_CANDIDATE = 8, PARTS_PER_COMPARISON = 3 };

int32_t cairn_scan_match_ranks_before(const scan_match_candidate *a, const scan_match_candidate *b)
{
    return a->score > b->score || (!(b->score > a->score) && a->order < b->order);
}

/* The worst candidate is on top of the heap. */
static int ranks_after(const void *context, int32_t a, int32_t b)
{
    const scan_match_candidate *candidates = context;

    return cairn_scan_match_ranks_before(&candidates[b], &candidates[a]);
}

static void exchange_candidates(void *context, int32_t a, int32_t b)
{
    scan_match_candidate *candidates = context, moved = candidates[a];

    candidates[a] = candidates[b];
    candidates[b] = moved;
}

void cairn_scan_match_insert_candidate(cairn_scan_match *match,
                                       const scan_match_candidate *candidate, int32_t most)
{
    match->candidates[heap_keep_place(match->candidate_count, most)] = *candidate;
    match->candidate_count = heap_keep(match->candidates, match->candidate_count, most, ranks_after,
                                       exchange_candidates);
}

void cairn_scan_match_sort_candidates(cairn_scan_match *match)
{
    for (int32_t count = match->candidate_count; count > 1; count--)
        heap_pop(match->candidates, count, ranks_after, exchange_candidates);
}

static int is_near(const cairn_scan_match *match, cairn_pose a, cairn_pose b, cairn_real spacings,
                   cairn_real angle)
{
    cairn_real reach = spacings * match->params.spacing;
    cairn_vec2 pa, pb;

    if (!(cairn_abs(cairn_wrap_angle(a.theta - b.theta)) < angle))
        return 0;
    pa = cairn_pose_point(a, match->centroid);
    pb = cairn_pose_point(b, match->centroid);
    return cairn_vec2_norm_squared(cairn_vec2_sub(pa, pb)) < reach * reach;
}

/* A candidate becomes a hypothesis unless a better peak at the same or a neighbouring heading
 * exists. */
static void suppress_or_add(cairn_scan_match *match, const scan_match_candidate *candidate)
{
    cairn_real angle = PEAK_HEADING_STEPS * match->votes.angle_step;

    for (int32_t k = 0; k < match->hypothesis_count; k++)
        if (is_near(match, match->hypotheses[k].target_query, candidate->pose, PEAK_DISTANCE,
                    angle))
            return;
    match->hypotheses[match->hypothesis_count++].target_query = candidate->pose;
}

int cairn_scan_match_suppress(cairn_scan_match *match, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(match->resume.phase);
    for (match->suppressed = 0; match->suppressed < match->candidate_count; match->suppressed++) {
        SCAN_MATCH_CHARGE(phase,
                          PARTS_PER_CANDIDATE + PARTS_PER_COMPARISON * match->hypothesis_count);
        suppress_or_add(match, &match->candidates[match->suppressed]);
    }
    CAIRN_STEP_END(match->resume.phase);
}

/* Returns 1 when the pose lies in the window, up to the resolution of the search; the shape modes
 * have no window of positions. */
static int is_inside(const cairn_scan_match *match, cairn_pose pose)
{
    cairn_real reach = match->window.distance + match->params.spacing;

    return !match->has_window || match->shape != NULL ||
           (cairn_abs(pose.x - match->start.x) <= reach &&
            cairn_abs(pose.y - match->start.y) <= reach &&
            cairn_abs(cairn_wrap_angle(pose.theta - match->start.theta)) <=
                match->window.angle + DUPLICATE_ANGLE_RAD);
}

static int is_duplicate(const void *context, const void *entry, const void *other)
{
    const cairn_scan_match_hypothesis *a = other, *b = entry;

    return is_near(context, a->target_query, b->target_query, DUPLICATE_DISTANCE,
                   DUPLICATE_ANGLE_RAD);
}

/* Sorts the hypotheses by score and removes duplicates and those outside the window; keeps at most
 * `keep`. */
void cairn_scan_match_select(cairn_scan_match *match, int32_t keep)
{
    int32_t count = match->hypothesis_count;
    ranked_list hypotheses = {.entries = match->hypotheses,
                              .count = &match->hypothesis_count,
                              .capacity = count,
                              .entry_bytes = sizeof *match->hypotheses,
                              .score_at = offsetof(cairn_scan_match_hypothesis, score),
                              .is_near = is_duplicate,
                              .context = match};

    match->hypothesis_count = 0;
    for (int32_t i = 0; i < count; i++) {
        cairn_scan_match_hypothesis hypothesis = match->hypotheses[i];

        if (is_inside(match, hypothesis.target_query))
            (void)ranked_list_add(&hypotheses, &hypothesis);
    }
    ranked_list_suppress_all(&hypotheses);
    if (match->hypothesis_count > keep)
        match->hypothesis_count = keep;
}

static int competes(const cairn_scan_match *match, int32_t i, int32_t with)
{
    return i != with &&
           !is_near(match, match->hypotheses[i].target_query, match->hypotheses[with].target_query,
                    COMPETING_DISTANCE, COMPETING_ANGLE_RAD);
}

/* Returns the score of the best competing hypothesis of hypothesis i. */
static cairn_real competing_score(const cairn_scan_match *match, int32_t i)
{
    for (int32_t k = 0; k < match->hypothesis_count; k++)
        if (competes(match, k, i))
            return match->hypotheses[k].score;
    return 0;
}

/* Returns the log odds of a hypothesis if there were no others. */
static cairn_real own_log_odds(const cairn_scan_match *match, const cairn_scan_match_hypothesis *h)
{
    cairn_real points = h->fit * (cairn_real)match->query.count;

    return LOG_ODDS_BIAS + LOG_ODDS_PER_LOG_FIT * cairn_log(h->fit + MIN_FIT) +
           LOG_ODDS_PER_VIOLATION * h->free_space_violation +
           LOG_ODDS_PER_TARGET_VIOLATION * h->target_free_space_violation +
           LOG_ODDS_PER_LOG_POINTS * cairn_log(points + 1);
}

static cairn_real log_odds_of(const cairn_scan_match *match, int32_t i)
{
    const cairn_scan_match_hypothesis *h = &match->hypotheses[i];

    return own_log_odds(match, h) +
           LOG_ODDS_PER_COMPETING_RATIO *
               cairn_min(competing_score(match, i) / (h->score + MIN_FIT), 1);
}

/* Returns 1 when the second hypothesis is nearly as good, or acceptable beside the best. */
static int is_as_good(const cairn_scan_match_hypothesis *second,
                      const cairn_scan_match_hypothesis *best)
{
    return second->score > AMBIGUITY_RATIO * best->score || second->log_odds >= MIN_LOG_ODDS;
}

/* Returns 1 when the best competing hypothesis of the first would be likely by itself, and both see
 * free space that it does not violate: the target may show less of the true place than of a similar
 * one, and fewer inliers are not violations. */
static int has_possible_competitor(const cairn_scan_match *match)
{
    const cairn_scan_match_hypothesis *h;
    int32_t k = 1;

    if (match->view_count == 0 || !match->query_has_view)
        return 0;
    while (k < match->hypothesis_count && !competes(match, k, 0))
        k++;
    if (k >= match->hypothesis_count)
        return 0;
    h = &match->hypotheses[k];
    return h->free_space_violation <= MAX_COMPETING_VIOLATION &&
           h->target_free_space_violation <= MAX_COMPETING_VIOLATION &&
           own_log_odds(match, h) >= MIN_COMPETING_LOG_ODDS;
}

void cairn_scan_match_decide(cairn_scan_match *match)
{
    cairn_scan_match_hypothesis *h = match->hypotheses;

    for (int32_t i = 0; i < match->hypothesis_count; i++)
        h[i].log_odds = log_odds_of(match, i);
    match->result.hypotheses = h;
    match->result.count = match->hypothesis_count;
    if (match->hypothesis_count == 0 || h[0].log_odds < MIN_LOG_ODDS)
        match->result.verdict = CAIRN_SCAN_MATCH_NONE;
    else if (h[0].observable_dof < 3 || (match->hypothesis_count > 1 && is_as_good(&h[1], &h[0])) ||
             has_possible_competitor(match))
        match->result.verdict = CAIRN_SCAN_MATCH_AMBIGUOUS;
    else
        match->result.verdict = CAIRN_SCAN_MATCH_FOUND;
}
