/* Loop-closure detection and verification.
 *
 * Method. For each keyframe, once the force field no longer moves it:
 *
 * 1. Accumulated drift: the path variance to every other keyframe is the least sum over all paths
 *    in the pose graph (Dijkstra 1959); "the path" below is the one of least variance. A link adds
 *    its position covariance, and its heading variance times the squared lever arm, the distance
 *    from the query keyframe, across that arm. Covariances are kept as variance and anisotropy, which
 *    turns by the doubled angle: var x + var y, and (var x - var y, 2 cov xy).
 * 2. Candidates: older keyframes whose scan centroids lie within candidate_radius plus the search
 *    radius, the one of least cost of each group of successive ones. The search radius is three
 *    standard deviations of the path, at most search_radius. Weakly constrained keyframes
 *    (mapper_constraint.c) are penalized: a match against them has little information on the
 *    rest of the map.
 * 3. Registration: scan_match against the union of the keyframes around the candidate, in the
 *    window given by 1.
 * 4. Verification: a match below the minimum log odds, an ambiguous one, or one with free-space
 *    violations is rejected. In a small window the match is accepted at once. In a wide window its
 *    log odds must also outweigh half the squared Mahalanobis distance from the prior of the path
 *    (perceptual aliasing; the place may be new). It then waits until several closures are mutually
 *    consistent and outnumber the inconsistent ones, as in Olson (2009): false closures are rarely
 *    mutually consistent. Along a weakly observable direction a closure keeps the position of the
 *    path where the path knows it better.
 *
 * Limits: accumulated drift of more than loop.search_radius in x or y is not closed.
 *
 * Source: E. Olson, Recognizing places using spectrally clustered local matches, RAS 57, 2009. */
#include "src/base/build.h"

#include <string.h>

#include "src/base/step.h"
#include "src/containers/heap.h"
#include "src/containers/ranked_list.h"
#include "src/maps/mapper_work.h"

enum {
    KEYFRAMES_PER_UNIT = 16,
    ADD_UNITS = 4,                            /* a keyframe in the graph */
    VERIFY_UNITS = 8 + 4 * MAPPER_MAX_PENDING /* a match beside the pending closures */
};

/* m: keyframes of a larger position standard deviation are left out of the target map */
static const cairn_real MAX_TARGET_SIGMA_M = CAIRN_REAL(0.2);
/* m of extra cost of a candidate per m of position standard deviation */
static const cairn_real SIGMA_PENALTY = 5;
/* weight of the distance of the poses in the cost of a candidate; that of the centroids has 1 */
static const cairn_real POSE_DISTANCE_WEIGHT = CAIRN_REAL(0.5);
/* m^2: variance without a path */
static const cairn_real NO_PATH_VARIANCE = CAIRN_REAL(1e6);
/* share of the variance: most anisotropy of the path in the prior of a closure; the standard deviation
 * across is then a quarter of that along */
static const cairn_real MAX_ANISOTROPY = CAIRN_REAL(0.88);
/* standard deviations of the path that the search window covers */
static const cairn_real WINDOW_SIGMAS = 3;
/* m and rad: added to the half sizes of the search window, which stays within search_radius */
static const cairn_real WINDOW_MARGIN_M = CAIRN_REAL(0.2);
static const cairn_real WINDOW_MARGIN_RAD = CAIRN_REAL(0.1);
/* Ambiguity ratio: a match whose second hypothesis has more than this share of the best score is
 * ambiguous. */
static const cairn_real AMBIGUITY_RATIO = CAIRN_REAL(0.9);
/* Consistency of two closures: maximum residual of the cycle through both, m and rad: errors of the
 * two matches, ... */
static const cairn_real CYCLE_TOLERANCE_M = CAIRN_REAL(0.15);
static const cairn_real CYCLE_TOLERANCE_RAD = CAIRN_REAL(0.05);
/* ... plus drift per keyframe of the two paths between them. */
static const cairn_real CYCLE_DRIFT_M = CAIRN_REAL(0.01);
static const cairn_real CYCLE_DRIFT_RAD = CAIRN_REAL(0.003);

/* Log odds that an accepted closure is wrong, fitted by bench/scenes --fit (docs/lab/logs.md): at 0,
 * for each unit of the evidence (of the logarithm of the path's standard deviation), and the bounds
 * of what they are fitted on. */
static const cairn_real ERROR_LOG_ODDS = CAIRN_REAL(-4.031), ERROR_OF_SIGMA = CAIRN_REAL(0.625),
                        ERROR_OF_DISTANCE = CAIRN_REAL(0.172), ERROR_OF_COMPETING = CAIRN_REAL(1.5),
                        ERROR_OF_VIOLATION = CAIRN_REAL(23.86);
static const cairn_real LEAST_SIGMA_M = CAIRN_REAL(0.01), MOST_SIGMA_M = 2, MOST_DISTANCE_NATS = 12;
static const cairn_real LEAST_ERROR_PROBABILITY = CAIRN_REAL(0.001);

/* ---- Accumulated drift of the path ---- */

static int has_less_variance(const void *context, int32_t a, int32_t b)
{
    const mapper_return_search *returns = context;
    int32_t first = returns->heap[a], second = returns->heap[b];

    return returns->variance[first] < returns->variance[second] ||
           (!(returns->variance[second] < returns->variance[first]) && first < second);
}

/* Stores a keyframe at a heap position. */
static void heap_set(mapper_return_search *returns, int32_t at, int32_t keyframe)
{
    returns->heap[at] = keyframe;
    returns->heap_position[keyframe] = at;
}

static void exchange_keyframes(void *context, int32_t a, int32_t b)
{
    mapper_return_search *returns = context;
    int32_t moved = returns->heap[a];

    heap_set(returns, a, returns->heap[b]);
    heap_set(returns, b, moved);
}

/* Removes and returns the keyframe of least variance. */
static int32_t take_nearest(mapper_return_search *returns)
{
    int32_t first = returns->heap[0];

    heap_pop(returns, returns->heap_count--, has_less_variance, exchange_keyframes);
    returns->heap_position[first] = -2;
    return first;
}

/* Returns the squared distance of two keyframes, m^2. */
static cairn_real distance_squared(const cairn_mapper *mapper, int32_t first, int32_t second)
{
    cairn_pose a = mapper->keyframe_pose[first], b = mapper->keyframe_pose[second];

    return (a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y);
}

static void begin_distances(cairn_mapper *mapper)
{
    mapper_return_search *returns = &mapper->loop.returns;
    cairn_vec2 isotropic = {0, 0};

    for (int32_t keyframe = 0; keyframe < mapper->loop.graph_keyframes; keyframe++) {
        returns->variance[keyframe] = NO_PATH_VARIANCE;
        returns->anisotropy[keyframe] = isotropic;
        returns->heading_variance[keyframe] = CAIRN_PI * CAIRN_PI;
        returns->heap_position[keyframe] = -1;
    }
    returns->variance[returns->query] = returns->heading_variance[returns->query] = 0;
    returns->heap_count = 1;
    heap_set(returns, 0, returns->query);
}

/* Returns a vector at the doubled angle, of the squared length. */
static cairn_vec2 doubled_angle(cairn_vec2 a)
{
    cairn_vec2 doubled = {a.x * a.x - a.y * a.y, 2 * a.x * a.y};

    return doubled;
}

/* Returns the anisotropy of the path with one more link. A heading error displaces the query across
 * the lever arm. */
static cairn_vec2 anisotropy_after(const cairn_mapper *mapper, const mapper_link *link,
                                   int32_t from)
{
    const mapper_return_search *returns = &mapper->loop.returns;
    cairn_pose at = mapper->keyframe_pose[from], query = mapper->keyframe_pose[returns->query];
    cairn_pose doubled_turn = {0, 0, 2 * mapper->keyframe_pose[link->second].theta};
    cairn_vec2 lever_arm = {query.x - at.x, query.y - at.y};
    cairn_vec2 of_link =
                   cairn_transform_direction(cairn_transform_of(doubled_turn), link->anisotropy),
               of_heading = cairn_vec2_scale(doubled_angle(lever_arm), -link->heading_variance);

    return cairn_vec2_add(returns->anisotropy[from], cairn_vec2_add(of_link, of_heading));
}

/* Relaxes the next link of Dijkstra's algorithm, from the keyframe that was taken out of the
 * heap. */
static void relax_link(cairn_mapper *mapper)
{
    mapper_return_search *returns = &mapper->loop.returns;
    const mapper_link *link = &mapper->loop.links[returns->link];
    int32_t from = returns->keyframe, end = link->second == from,
            to = end ? link->first : link->second;
    cairn_real lever_arm2 = distance_squared(mapper, from, returns->query);
    cairn_real variance =
        returns->variance[from] + link->variance + link->heading_variance * lever_arm2;

    returns->link = link->next[end];
    if (link->dropped || returns->heap_position[to] == -2 || !(variance < returns->variance[to]))
        return;
    returns->variance[to] = variance;
    returns->anisotropy[to] = anisotropy_after(mapper, link, from);
    returns->heading_variance[to] = returns->heading_variance[from] + link->heading_variance;
    if (returns->heap_position[to] < 0)
        heap_set(returns, returns->heap_count++, to);
    heap_sift_up(returns, returns->heap_position[to], has_less_variance, exchange_keyframes);
}

/* ---- Candidates ---- */

/* Returns the centroid of a keyframe's scan in the map. */
static cairn_vec2 scan_centroid(const cairn_mapper *mapper, int32_t keyframe)
{
    return cairn_pose_point(mapper->keyframe_pose[keyframe],
                            cairn_mapper_keyframe_record(mapper, keyframe)->centroid);
}

/* Inserts the best candidate of the finished group into the sorted candidates. */
static void end_group(mapper_return_search *returns)
{
    ranked_list candidates = {.entries = returns->candidates,
                              .count = &returns->candidate_count,
                              .capacity = MAPPER_MAX_CANDIDATES,
                              .entry_bytes = sizeof *returns->candidates,
                              .score_at = offsetof(mapper_candidate, cost),
                              .least_first = 1};

    if (returns->in_group)
        (void)ranked_list_add(&candidates, &returns->best_of_group);
    returns->in_group = 0;
}

/* Returns the search radius of a keyframe, m: three standard deviations, at most search_radius. */
static cairn_real search_reach(const cairn_mapper *mapper, int32_t keyframe)
{
    return cairn_min(WINDOW_SIGMAS * cairn_sqrt(mapper->loop.returns.variance[keyframe]),
                     mapper->params.loop.search_radius);
}

/* Tests the next keyframe as a candidate. */
static void test_candidate(cairn_mapper *mapper)
{
    mapper_return_search *returns = &mapper->loop.returns;
    int32_t keyframe = returns->keyframe;
    cairn_vec2 difference =
        cairn_vec2_sub(scan_centroid(mapper, keyframe), scan_centroid(mapper, returns->query));
    cairn_real centroid_distance = cairn_vec2_norm(difference);

    if (cairn_mapper_point_count(mapper, keyframe) > 0 &&
        centroid_distance < mapper->params.loop.candidate_radius + search_reach(mapper, keyframe)) {
        cairn_real pose_distance = cairn_sqrt(distance_squared(mapper, keyframe, returns->query));
        cairn_real cost =
            centroid_distance + (POSE_DISTANCE_WEIGHT * pose_distance +
                                 SIGMA_PENALTY * mapper->loop.constraints[keyframe].position_sigma);

        if (!returns->in_group || cost < returns->best_of_group.cost) {
            returns->best_of_group.keyframe = keyframe;
            returns->best_of_group.cost = cost;
        }
        returns->in_group = 1;
    } else {
        end_group(returns);
    }
}

/* Returns the end of the keyframes that are old enough for a return. */
static int32_t candidates_end(const cairn_mapper *mapper)
{
    return mapper->loop.returns.query - mapper->params.loop.min_keyframe_gap;
}

/* Returns the candidate that is matched. */
static int32_t candidate_of(const mapper_return_search *returns)
{
    return returns->candidates[returns->candidate].keyframe;
}

/* ---- The match ---- */

/* Clears the target map, and chooses the keyframes around the candidate for it. */
static void begin_target(cairn_mapper *mapper)
{
    mapper_return_search *returns = &mapper->loop.returns;
    int32_t keyframe = candidate_of(returns), half = mapper->params.loop.target_keyframes / 2;
    int32_t first = keyframe > half ? keyframe - half : 0,
            end = first + mapper->params.loop.target_keyframes;

    mapper->target.search_count = 0;
    cairn_scan_match_clear_target(mapper->search);
    returns->match.keyframe = first;
    returns->match.end = end < candidates_end(mapper) ? end : candidates_end(mapper);
}

/* Returns 1 when a keyframe is farther from the candidate than target_keyframes steps between
 * keyframes: keyframes between the two were culled, or the trajectory is broken there. */
static int32_t is_off_path(const cairn_mapper *mapper, int32_t keyframe, int32_t candidate)
{
    cairn_real most =
        (cairn_real)mapper->params.loop.target_keyframes * mapper->params.keyframe_distance;

    return distance_squared(mapper, keyframe, candidate) > most * most;
}

/* Returns 1 when the next keyframe around the candidate belongs to the target map. */
static int32_t is_in_target(const cairn_mapper *mapper)
{
    const mapper_return_search *returns = &mapper->loop.returns;
    int32_t keyframe = returns->match.keyframe, candidate = candidate_of(returns);

    return keyframe == candidate ||
           !(mapper->loop.constraints[keyframe].position_sigma > MAX_TARGET_SIGMA_M ||
             is_off_path(mapper, keyframe, candidate));
}

static int32_t target_units(const cairn_mapper *mapper)
{
    return is_in_target(mapper)
               ? cairn_mapper_search_target_units(mapper, mapper->loop.returns.match.keyframe)
               : 1;
}

static int32_t query_units(const cairn_mapper *mapper)
{
    return 2 + cairn_mapper_point_count(mapper, mapper->loop.returns.query) / 4;
}

/* Starts the match. When scan_match refuses the query, the match ends without hypotheses. */
static void begin_match(cairn_mapper *mapper)
{
    mapper_return_search *returns = &mapper->loop.returns;
    int32_t keyframe = candidate_of(returns);
    cairn_visibility visibility = cairn_mapper_visibility(mapper, returns->query);
    cairn_scan_match_window window;
    cairn_status status;

    window.distance = cairn_min(search_reach(mapper, keyframe) + WINDOW_MARGIN_M,
                                mapper->params.loop.search_radius);
    window.angle =
        WINDOW_SIGMAS * cairn_sqrt(returns->heading_variance[keyframe]) + WINDOW_MARGIN_RAD;
    status = cairn_scan_match_begin(mapper->search, &returns->query_part,
                                    mapper->keyframe_pose[returns->query], &window, NULL);
    if (status == CAIRN_OK)
        status = cairn_scan_match_set_query_view(mapper->search, &visibility, NULL);
    if (status != CAIRN_OK)
        cairn_scan_match_clear_target(mapper->search);
}

static int search_window(cairn_mapper *mapper, cairn_budget *budget)
{
    return cairn_scan_match_step(mapper->search, budget) != CAIRN_MORE;
}

void cairn_mapper_preempt_loop_match(cairn_mapper *mapper)
{
    mapper_candidate_match *match = &mapper->loop.returns.match;

    if (match->resume == 0)
        return;
    match->resume = 0;
    mapper->loop.units_charged = 0;
}

/* ---- Verification ---- */

/* Returns 1 when two closures are consistent: the cycle through both and the two paths between them
 * has a small residual, given the drift allowed per keyframe. */
static int32_t is_consistent(const cairn_mapper *mapper, const cairn_mapper_loop *a,
                             const cairn_mapper_loop *b)
{
    cairn_pose second = cairn_mapper_relative_pose(mapper, a->second, b->second),
               first = cairn_mapper_relative_pose(mapper, a->first, b->first);
    cairn_pose composed_a = cairn_pose_compose(a->first_second, second),
               composed_b = cairn_pose_compose(first, b->first_second);
    cairn_pose difference = cairn_pose_between(composed_a, composed_b);
    int32_t path =
        b->second - a->second + (b->first > a->first ? b->first - a->first : a->first - b->first);
    cairn_real distance = CYCLE_TOLERANCE_M + CYCLE_DRIFT_M * (cairn_real)path;
    cairn_real angle = CYCLE_TOLERANCE_RAD + CYCLE_DRIFT_RAD * (cairn_real)path;

    return difference.x * difference.x + difference.y * difference.y < distance * distance &&
           cairn_abs(difference.theta) < angle;
}

/* Adds a closure to the graph and records the event; without capacity state.capacity_exceeded is
 * set instead. */
static void accept(cairn_mapper *mapper, mapper_pending *closure)
{
    cairn_status status = cairn_mapper_add_closure(mapper, &closure->event, closure->covariance);

    closure->accepted = 1;
    closure->event.verdict = CAIRN_MAPPER_LOOP_ACCEPTED;
    if (status == CAIRN_FULL)
        mapper->state.capacity_exceeded =
            mapper->state.capacity_exceeded > 1 ? mapper->state.capacity_exceeded : 1;
    if (status == CAIRN_OK)
        cairn_mapper_record_loop(mapper, &closure->event);
}

/* Verifies a closure of a wide search: it is accepted with the consistent pending closures when
 * they outnumber the inconsistent ones, otherwise it becomes pending. */
static void check_consistency(cairn_mapper *mapper, const mapper_pending *closure)
{
    mapper_loop *loop = &mapper->loop;
    int32_t count =
        loop->pending_count < MAPPER_MAX_PENDING ? loop->pending_count : MAPPER_MAX_PENDING;
    int32_t consistent_count = 1, inconsistent_count = 0, last = -1;
    mapper_pending *kept = &loop->pending[loop->pending_count % MAPPER_MAX_PENDING];
    int32_t consistent[MAPPER_MAX_PENDING], stored_count = 0;

    for (int32_t i = 0; i < count; i++) {
        const cairn_mapper_loop *earlier = &loop->pending[i].event;

        if (closure->event.second - earlier->second > mapper->params.loop.min_keyframe_gap)
            continue;
        if (is_consistent(mapper, earlier, &closure->event)) {
            consistent_count += earlier->second != closure->event.second && earlier->second != last;
            last = earlier->second;
            consistent[stored_count++] = i;
        } else {
            inconsistent_count++;
        }
    }
    if (consistent_count >= mapper->params.loop.min_consistent &&
        consistent_count > inconsistent_count) {
        for (int32_t i = 0; i < stored_count; i++)
            if (!loop->pending[consistent[i]].accepted)
                accept(mapper, &loop->pending[consistent[i]]);
        *kept = *closure;
        accept(mapper, kept);
    } else {
        *kept = *closure;
        cairn_mapper_record_loop(mapper, &closure->event);
    }
    loop->pending_count++;
}

int32_t cairn_mapper_is_ambiguous(const cairn_scan_match_result *result)
{
    return result->count > 1 &&
           result->hypotheses[1].score > AMBIGUITY_RATIO * result->hypotheses[0].score;
}

/* Returns the negative log prior of a closure, nats: half its squared Mahalanobis distance from the
 * prior of the path. */
static cairn_real negative_log_prior(const cairn_mapper *mapper, const cairn_mapper_loop *closure)
{
    const mapper_return_search *returns = &mapper->loop.returns;
    cairn_pose now = mapper->keyframe_pose[closure->second],
               closed =
                   cairn_pose_compose(mapper->keyframe_pose[closure->first], closure->first_second);
    cairn_vec2 off = {closed.x - now.x, closed.y - now.y};
    cairn_real turn = cairn_wrap_angle(closed.theta - now.theta);
    cairn_real variance = returns->variance[closure->first];
    cairn_vec2 anisotropy = returns->anisotropy[closure->first];
    cairn_real size = cairn_vec2_norm(anisotropy), most = MAX_ANISOTROPY * variance;

    if (size > most)
        anisotropy = cairn_vec2_scale(anisotropy, most / size);
    return (variance * cairn_vec2_norm_squared(off) -
            cairn_vec2_dot(anisotropy, doubled_angle(off))) /
               (variance * variance - cairn_vec2_norm_squared(anisotropy)) +
           turn * turn / (2 * returns->heading_variance[closure->first]);
}

/* Returns the covariance of a closure, inflated along a weakly observable direction: the few points
 * there may be on a dynamic object. */
static cairn_sym3 closure_covariance(const cairn_mapper *mapper,
                                     const cairn_scan_match_hypothesis *hypothesis)
{
    cairn_real covariance[9], x = MAPPER_LOW_CONFIDENCE_M * hypothesis->weak_direction[0],
                              y = MAPPER_LOW_CONFIDENCE_M * hypothesis->weak_direction[1];

    memcpy(covariance, hypothesis->covariance, sizeof covariance);
    if (hypothesis->weak_ratio < MAPPER_MIN_INFORMATION_RATIO) {
        covariance[0] += x * x;
        covariance[1] += x * y;
        covariance[3] += x * y;
        covariance[4] += y * y;
    }
    return cairn_mapper_own_covariance(mapper, covariance, hypothesis->target_query.theta);
}

/* Returns the pose of the query by a match, without its shift along a weakly observable direction
 * where the path knows the position along it better. */
static cairn_pose pose_by_match(const cairn_mapper *mapper,
                                const cairn_scan_match_hypothesis *hypothesis)
{
    const mapper_return_search *returns = &mapper->loop.returns;
    int32_t candidate = candidate_of(returns);
    cairn_pose now = mapper->keyframe_pose[returns->query], pose = hypothesis->target_query;
    cairn_vec2 weak = {hypothesis->weak_direction[0], hypothesis->weak_direction[1]};
    cairn_real variance_along =
        (returns->variance[candidate] +
         cairn_vec2_dot(returns->anisotropy[candidate], doubled_angle(weak))) /
        2;
    cairn_real shift = weak.x * (pose.x - now.x) + weak.y * (pose.y - now.y);

    if (hypothesis->weak_ratio < MAPPER_MIN_INFORMATION_RATIO &&
        cairn_vec2_norm_squared(weak) > MAPPER_MIN_TRANSLATION * MAPPER_MIN_TRANSLATION &&
        variance_along < MAPPER_LOW_CONFIDENCE_M * MAPPER_LOW_CONFIDENCE_M) {
        pose.x -= shift * weak.x;
        pose.y -= shift * weak.y;
    }
    return pose;
}

cairn_real cairn_mapper_loop_error_probability(const cairn_mapper_loop_evidence *evidence)
{
    cairn_real sigma = cairn_min(cairn_max(evidence->path_sigma, LEAST_SIGMA_M), MOST_SIGMA_M);
    cairn_real log_odds =
        ERROR_LOG_ODDS + ERROR_OF_SIGMA * cairn_log(sigma) +
        ERROR_OF_DISTANCE * cairn_min(evidence->prior_distance, MOST_DISTANCE_NATS) +
        ERROR_OF_COMPETING * evidence->competing_score +
        ERROR_OF_VIOLATION * evidence->free_space_violation;

    return cairn_max(1 / (1 + cairn_exp(-log_odds)), LEAST_ERROR_PROBABILITY);
}

/* Fills in a closure from the best hypothesis of the match. */
static void measure_closure(const cairn_mapper *mapper, const cairn_scan_match_result *result,
                            mapper_pending *closure)
{
    const cairn_scan_match_hypothesis *h = result->hypotheses;
    cairn_mapper_loop *event = &closure->event;
    cairn_pose first = mapper->keyframe_pose[event->first];

    event->first_second = cairn_pose_between(first, h->target_query);
    event->evidence.path_sigma = cairn_sqrt(mapper->loop.returns.variance[event->first]);
    event->evidence.prior_distance = negative_log_prior(mapper, event);
    event->evidence.competing_score =
        result->count > 1 ? result->hypotheses[1].score / h->score : 0;
    event->evidence.free_space_violation =
        cairn_max(h->free_space_violation, h->target_free_space_violation);
    event->error_probability = cairn_mapper_loop_error_probability(&event->evidence);
    event->first_second = cairn_pose_between(first, pose_by_match(mapper, h));
    closure->covariance = closure_covariance(mapper, h);
}

/* Returns the verdict on a match: PENDING when consistent closures must decide. */
static cairn_mapper_loop_verdict verdict_of(const cairn_mapper *mapper,
                                            const cairn_scan_match_result *result,
                                            const cairn_mapper_loop *closure)
{
    const cairn_mapper_loop_params *p = &mapper->params.loop;
    const cairn_scan_match_hypothesis *h = result->hypotheses;

    if (result->count == 0 || result->verdict == CAIRN_SCAN_MATCH_NONE ||
        h->log_odds < p->min_log_odds)
        return CAIRN_MAPPER_LOOP_NO_MATCH;
    if (cairn_mapper_is_ambiguous(result))
        return CAIRN_MAPPER_LOOP_AMBIGUOUS;
    if (closure->evidence.free_space_violation > p->max_free_space_violation)
        return CAIRN_MAPPER_LOOP_FREE_SPACE_VIOLATION;
    if (search_reach(mapper, closure->first) < p->local_search_radius)
        return CAIRN_MAPPER_LOOP_ACCEPTED;
    return h->log_odds - closure->evidence.prior_distance < p->min_log_odds
               ? CAIRN_MAPPER_LOOP_UNLIKELY
               : CAIRN_MAPPER_LOOP_PENDING;
}

/* Verifies the match of the current candidate: accepts, defers or rejects the closure. */
static void verify(cairn_mapper *mapper)
{
    const mapper_return_search *returns = &mapper->loop.returns;
    cairn_scan_match_result result = cairn_scan_match_read(mapper->search);
    mapper_pending closure = {.event = {.first = candidate_of(returns),
                                        .second = returns->query,
                                        .error_probability = 1}};

    if (result.count > 0)
        measure_closure(mapper, &result, &closure);
    closure.event.verdict = verdict_of(mapper, &result, &closure.event);
    if (closure.event.verdict == CAIRN_MAPPER_LOOP_ACCEPTED)
        accept(mapper, &closure);
    else if (closure.event.verdict == CAIRN_MAPPER_LOOP_PENDING)
        check_consistency(mapper, &closure);
    else
        cairn_mapper_record_loop(mapper, &closure.event);
}

/* ---- Steps ---- */

/* Returns the number of keyframes that have left the window of the force field: it no longer moves
 * them. */
static int32_t keyframes_outside_window(const cairn_mapper *mapper)
{
    int32_t count = mapper->keyframe_count;

    if (mapper->params.window == 0 || mapper->loop.settling)
        return count;
    return count > mapper->params.window_free ? count - mapper->params.window_free : 0;
}

int32_t cairn_mapper_pending_keyframes(const cairn_mapper *mapper)
{
    int32_t pending = keyframes_outside_window(mapper) - mapper->loop.graph_keyframes;

    return mapper->loop.graph != NULL && pending > 0 ? pending : 0;
}

/* Returns 1 when the graph is optimized before the next keyframe is added. settle() optimizes it at
 * the end as well. */
static int32_t must_optimize(const cairn_mapper *mapper)
{
    const mapper_loop *loop = &mapper->loop;

    return loop->may_cull || cairn_mapper_needs_optimization(mapper) ||
           (loop->settling && loop->graph_keyframes == mapper->keyframe_count &&
            loop->unsolved_closures > 0 && !loop->factor_full);
}

/* Matches the query with one candidate, and verifies the closure. */
static int match_candidate(cairn_mapper *mapper, cairn_budget *budget)
{
    mapper_candidate_match *match = &mapper->loop.returns.match;
    int32_t *charged = &mapper->loop.units_charged;

    CAIRN_STEP_BEGIN(match->resume);
    CAIRN_STEP_UNTIL(match->resume, cairn_mapper_charge_first(mapper, budget, charged, 1));
    begin_target(mapper);
    for (; match->keyframe < match->end; match->keyframe++) {
        CAIRN_STEP_UNTIL(match->resume,
                         cairn_mapper_charge_first(mapper, budget, charged, target_units(mapper)));
        if (is_in_target(mapper) && !cairn_mapper_add_search_target(mapper, match->keyframe))
            break; /* full */
    }
    CAIRN_STEP_UNTIL(match->resume,
                     cairn_mapper_charge_first(mapper, budget, charged, query_units(mapper)));
    begin_match(mapper);
    CAIRN_STEP_UNTIL(match->resume, cairn_mapper_run_in_share(mapper, budget, search_window));
    CAIRN_STEP_UNTIL(match->resume,
                     cairn_mapper_charge_next(mapper, budget, charged, VERIFY_UNITS));
    verify(mapper);
    CAIRN_STEP_END(match->resume);
}

/* Searches for returns of the last keyframe in the graph: drift of the path, candidates, a match
 * with each. */
static int find_returns(cairn_mapper *mapper, cairn_budget *budget)
{
    mapper_loop *loop = &mapper->loop;
    mapper_return_search *returns = &loop->returns;
    int32_t *charged = &loop->units_charged;

    CAIRN_STEP_BEGIN(returns->resume);
    CAIRN_STEP_UNTIL(returns->resume,
                     cairn_mapper_charge_first(mapper, budget, charged,
                                               1 + loop->graph_keyframes / KEYFRAMES_PER_UNIT));
    begin_distances(mapper);
    while (returns->heap_count > 0) {
        CAIRN_STEP_UNTIL(returns->resume, cairn_mapper_charge_first(mapper, budget, charged, 1));
        returns->keyframe = take_nearest(returns);
        for (returns->link = loop->first_link[returns->keyframe]; returns->link >= 0;) {
            CAIRN_STEP_UNTIL(returns->resume, cairn_mapper_charge_next(mapper, budget, charged, 1));
            relax_link(mapper);
        }
    }

    returns->candidate_count = returns->in_group = 0;
    for (returns->keyframe = 0; returns->keyframe < candidates_end(mapper); returns->keyframe++) {
        CAIRN_STEP_UNTIL(returns->resume, cairn_mapper_charge_first(mapper, budget, charged, 1));
        test_candidate(mapper);
    }
    end_group(returns);

    if (returns->candidate_count > 0) {
        CAIRN_STEP_UNTIL(returns->resume,
                         cairn_mapper_charge_next(mapper, budget, charged, query_units(mapper)));
        returns->query_part =
            cairn_mapper_keyframe_part(mapper, returns->query, returns->query_points);
    }
    for (returns->candidate = 0; returns->candidate < returns->candidate_count;
         returns->candidate++)
        CAIRN_STEP_UNTIL(returns->resume, match_candidate(mapper, budget));
    CAIRN_STEP_END(returns->resume);
}

/* Culls a keyframe, optimizes the graph, or adds the next keyframe to it and searches for its
 * returns, one after another. */
int cairn_mapper_loop_step(cairn_mapper *mapper, cairn_budget *budget)
{
    mapper_loop *loop = &mapper->loop;

    CAIRN_STEP_BEGIN(loop->resume);
    while (mapper->status == CAIRN_OK) {
        CAIRN_STEP_UNTIL(loop->resume, cairn_mapper_may_begin(mapper, budget));
        loop->may_cull = cairn_mapper_may_cull(mapper);
        if (loop->may_cull && (loop->unsolved_closures == 0 || loop->factor_full)) {
            CAIRN_STEP_UNTIL(loop->resume, cairn_mapper_cull(mapper, budget));
        } else if (must_optimize(mapper)) {
            CAIRN_STEP_UNTIL(loop->resume, cairn_mapper_optimize(mapper, budget));
        } else if (loop->graph_keyframes < keyframes_outside_window(mapper)) {
            CAIRN_STEP_UNTIL(loop->resume, cairn_mapper_charge_next(
                                               mapper, budget, &loop->units_charged, ADD_UNITS));
            loop->returns.query = loop->graph_keyframes;
            mapper->status = cairn_mapper_add_to_graph(mapper);
            loop->keyframes_since_solve++;
            if (candidates_end(mapper) > 0 &&
                cairn_mapper_point_count(mapper, loop->returns.query) > 0)
                CAIRN_STEP_UNTIL(loop->resume, find_returns(mapper, budget));
        } else {
            break;
        }
    }
    CAIRN_STEP_END(loop->resume);
}
