/* Which poses go on, which are the same, and what to make of them.
 *
 * Evidence is a logistic regression of "right" against "places that share nothing": simulated
 * half and full circles and real logs of half circles, 0.10 m spacing. A chance likeness
 * explains fewer points, runs into free space, and has rivals that are nearly as good. */
#include "src/core/build.h"

#include "src/mapping/scan_match_work.h"

/* Poses nearer than this are one. */
static const cairn_real SAME_DISTANCE = 2; /* spacings */
static const cairn_real SAME_ANGLE = CAIRN_REAL(0.06);
/* Peaks of headings so near to each other are one. */
static const cairn_real BESIDE_DISTANCE = CAIRN_REAL(1.5); /* spacings */
static const cairn_real BESIDE_STEPS = CAIRN_REAL(1.5);
/* ... and farther than this they are rivals. */
static const cairn_real RIVAL_DISTANCE = 4; /* spacings */
static const cairn_real RIVAL_ANGLE = CAIRN_REAL(0.15);
/* Log odds, see the head of this file. */
static const cairn_real BIAS = CAIRN_REAL(-4.2), BY_FIT = 3, BY_CONTRADICTION = -16,
                        BY_TARGET_CONTRADICTION = -17;
static const cairn_real BY_POINTS = CAIRN_REAL(2.9), BY_RIVAL = -5;
static const cairn_real LEAST_EVIDENCE = CAIRN_REAL(0.5);
/* score of a second one that makes a match ambiguous */
static const cairn_real ALIKE = CAIRN_REAL(0.9);

int32_t cairn_match_before(const match_candidate *a, const match_candidate *b)
{
    return a->score > b->score || (!(b->score > a->score) && a->order < b->order);
}

/* Lets the candidate at the root of heap[0 ... count-1], with the worst on top, sink to its
 * place. */
static void sink(match_candidate *heap, int32_t count, int32_t root)
{
    match_candidate moving = heap[root];

    for (;;) {
        int32_t child = 2 * root + 1;

        if (child >= count)
            break;
        if (child + 1 < count && cairn_match_before(&heap[child], &heap[child + 1]))
            child++;
        if (!cairn_match_before(&moving, &heap[child]))
            break;
        heap[root] = heap[child];
        root = child;
    }
    heap[root] = moving;
}

void cairn_match_keep(cairn_scan_match *x, const match_candidate *candidate, int32_t most)
{
    match_candidate *heap = x->candidates;

    if (x->candidate_count == most) {
        heap[0] = *candidate;
        sink(heap, most, 0);
        return;
    }
    {
        int32_t at = x->candidate_count++;

        for (; at > 0 && cairn_match_before(&heap[(at - 1) / 2], candidate); at = (at - 1) / 2)
            heap[at] = heap[(at - 1) / 2];
        heap[at] = *candidate;
    }
}

void cairn_match_sort(cairn_scan_match *x)
{
    for (int32_t count = x->candidate_count - 1; count > 0; count--) {
        match_candidate worst = x->candidates[0];

        x->candidates[0] = x->candidates[count];
        x->candidates[count] = worst;
        sink(x->candidates, count, 0);
    }
}

static int is_near(const cairn_scan_match *x, cairn_pose a, cairn_pose b, cairn_real spacings,
                   cairn_real angle)
{
    cairn_real reach = spacings * x->params.spacing;
    cairn_vec2 pa, pb;

    if (!(cairn_abs(cairn_wrap_angle(a.theta - b.theta)) < angle))
        return 0;
    pa = cairn_pose_point(a, x->centroid);
    pb = cairn_pose_point(b, x->centroid);
    return cairn_vec2_norm_squared(cairn_vec2_sub(pa, pb)) < reach * reach;
}

/* The next candidate becomes a hypothesis, but for one whose peak is a better one's at the same
 * or a neighbouring heading; 1 when all have. */
int32_t cairn_match_choose(cairn_scan_match *x)
{
    cairn_real angle = BESIDE_STEPS * x->votes.angle_step;
    int32_t beside = 0;

    if (x->at == x->candidate_count)
        return 1;
    for (int32_t k = 0; k < x->hypothesis_count && !beside; k++)
        beside = is_near(x, x->hypotheses[k].target_query, x->candidates[x->at].pose,
                         BESIDE_DISTANCE, angle);
    cairn_match_charge(x, 8 + 3 * x->hypothesis_count);
    if (!beside)
        x->hypotheses[x->hypothesis_count++].target_query = x->candidates[x->at].pose;
    x->at++;
    return 0;
}

/* 1 when the pose lies in the window, up to what the search blurs; matching by shape has no
 * window of positions. */
static int is_inside(const cairn_scan_match *x, cairn_pose pose)
{
    cairn_real reach = x->window.distance + x->params.spacing;

    return !x->has_window || x->shape != NULL ||
           (cairn_abs(pose.x - x->start.x) <= reach && cairn_abs(pose.y - x->start.y) <= reach &&
            cairn_abs(cairn_wrap_angle(pose.theta - x->start.theta)) <=
                x->window.angle + SAME_ANGLE);
}

/* Hypotheses by score, the first of those that are the same, `keep` at most; selection by
 * insertion. */
void cairn_match_thin(cairn_scan_match *x, int32_t keep)
{
    int32_t kept = 0;

    for (int32_t i = 1; i < x->hypothesis_count; i++) {
        cairn_scan_match_hypothesis moving = x->hypotheses[i];
        int32_t at = i;

        for (; at > 0 && x->hypotheses[at - 1].score < moving.score; at--)
            x->hypotheses[at] = x->hypotheses[at - 1];
        x->hypotheses[at] = moving;
    }
    for (int32_t i = 0; i < x->hypothesis_count && kept < keep; i++) {
        int32_t twin = !is_inside(x, x->hypotheses[i].target_query);

        for (int32_t k = 0; k < kept && !twin; k++)
            twin = is_near(x, x->hypotheses[k].target_query, x->hypotheses[i].target_query,
                           SAME_DISTANCE, SAME_ANGLE);
        if (!twin)
            x->hypotheses[kept++] = x->hypotheses[i];
    }
    x->hypothesis_count = kept;
}

/* Score of the best rival of hypothesis i. */
static cairn_real rival_of(const cairn_scan_match *x, int32_t i)
{
    for (int32_t k = 0; k < x->hypothesis_count; k++)
        if (k != i && !is_near(x, x->hypotheses[k].target_query, x->hypotheses[i].target_query,
                               RIVAL_DISTANCE, RIVAL_ANGLE))
            return x->hypotheses[k].score;
    return 0;
}

static cairn_real evidence_of(const cairn_scan_match *x, int32_t i)
{
    const cairn_scan_match_hypothesis *h = &x->hypotheses[i];
    cairn_real least = CAIRN_REAL(0.01), points = h->fit * (cairn_real)x->query.count;

    return BIAS + BY_FIT * cairn_log(h->fit + least) + BY_CONTRADICTION * h->contradiction +
           BY_TARGET_CONTRADICTION * h->target_contradiction + BY_POINTS * cairn_log(points + 1) +
           BY_RIVAL * cairn_min(rival_of(x, i) / (h->score + least), 1);
}

/* 1 when the second is nearly as good, or good enough by itself: the target may have seen less
 * of where it is than of its double, and fewer points explained are no points contradicted. */
static int is_as_good(const cairn_scan_match_hypothesis *second,
                      const cairn_scan_match_hypothesis *best)
{
    return second->score > ALIKE * best->score || second->evidence >= LEAST_EVIDENCE;
}

void cairn_match_judge(cairn_scan_match *x)
{
    cairn_scan_match_hypothesis *h = x->hypotheses;

    for (int32_t i = 0; i < x->hypothesis_count; i++)
        h[i].evidence = evidence_of(x, i);
    cairn_match_charge(x, x->hypothesis_count * (40 + 4 * x->hypothesis_count));
    x->result.hypotheses = h;
    x->result.count = x->hypothesis_count;
    if (x->hypothesis_count == 0 || h[0].evidence < LEAST_EVIDENCE)
        x->result.verdict = CAIRN_SCAN_MATCH_NONE;
    else if (h[0].observable < 3 || (x->hypothesis_count > 1 && is_as_good(&h[1], &h[0])))
        x->result.verdict = CAIRN_SCAN_MATCH_AMBIGUOUS;
    else
        x->result.verdict = CAIRN_SCAN_MATCH_FOUND;
}
