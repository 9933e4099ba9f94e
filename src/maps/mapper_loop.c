/* Loop-closure detection and verification.
 *
 * Method. For each keyframe, once the force field no longer moves it:
 *
 * 1. Accumulated drift: the path variance to every other keyframe is the least sum over all paths
 *    in the pose graph (Dijkstra 1959); "the path" below is the one of least variance. A link adds
 *    its position variance, and its heading variance times the squared lever arm, the distance from
 *    the query keyframe.
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
 *    mutually consistent.
 *
 * Limits: accumulated drift of more than loop.search_radius in x or y is not closed.
 *
 * Source: E. Olson, Recognizing places using spectrally clustered local matches, RAS 57, 2009. */
#include "src/base/build.h"

#include <string.h>

#include "src/containers/heap.h"
#include "src/containers/ranked_list.h"
#include "src/maps/mapper_work.h"

enum { KEYFRAMES_PER_UNIT = 16 };

/* m: keyframes of a larger position standard deviation are left out of the target map */
static const cairn_real MAX_TARGET_SIGMA_M = CAIRN_REAL(0.2);
/* m of extra cost of a candidate per m of position standard deviation */
static const cairn_real SIGMA_PENALTY = 5;
/* weight of the distance of the poses in the cost of a candidate; that of the centroids has 1 */
static const cairn_real POSE_DISTANCE_WEIGHT = CAIRN_REAL(0.5);
/* m^2: variance without a path */
static const cairn_real NO_PATH_VARIANCE = CAIRN_REAL(1e6);
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

/* ---- Accumulated drift of the path ---- */

static int has_less_variance(const void *context, int32_t a, int32_t b)
{
    const mapper_loop *loop = context;
    int32_t first = loop->heap[a], second = loop->heap[b];

    return loop->variance[first] < loop->variance[second] ||
           (!(loop->variance[second] < loop->variance[first]) && first < second);
}

/* Stores a keyframe at a heap position. */
static void heap_set(mapper_loop *loop, int32_t at, int32_t keyframe)
{
    loop->heap[at] = keyframe;
    loop->heap_position[keyframe] = at;
}

static void exchange_keyframes(void *context, int32_t a, int32_t b)
{
    mapper_loop *loop = context;
    int32_t moved = loop->heap[a];

    heap_set(loop, a, loop->heap[b]);
    heap_set(loop, b, moved);
}

/* Removes and returns the keyframe of least variance. */
static int32_t take_nearest(mapper_loop *loop)
{
    int32_t first = loop->heap[0];

    heap_pop(loop, loop->heap_count--, has_less_variance, exchange_keyframes);
    loop->heap_position[first] = -2;
    return first;
}

static cairn_real distance_squared(cairn_pose a, cairn_pose b)
{
    return (a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y);
}

/* Relaxes a link of Dijkstra's algorithm; lever_arm2 in m^2. */
static void relax_link(cairn_mapper *mapper, int32_t keyframe, const mapper_link *link,
                       int32_t from)
{
    mapper_loop *loop = &mapper->loop;
    cairn_real lever_arm2 =
        distance_squared(mapper->keyframe_pose[from], mapper->keyframe_pose[loop->query]);
    cairn_real variance =
        loop->variance[from] + link->variance + link->heading_variance * lever_arm2;

    if (loop->heap_position[keyframe] == -2 || !(variance < loop->variance[keyframe]))
        return;
    loop->variance[keyframe] = variance;
    loop->heading_variance[keyframe] = loop->heading_variance[from] + link->heading_variance;
    if (loop->heap_position[keyframe] < 0)
        heap_set(loop, loop->heap_count++, keyframe);
    heap_sift_up(loop, loop->heap_position[keyframe], has_less_variance, exchange_keyframes);
}

static void begin_distances(cairn_mapper *mapper)
{
    mapper_loop *loop = &mapper->loop;

    for (int32_t keyframe = 0; keyframe < loop->graph_keyframes; keyframe++) {
        loop->variance[keyframe] = NO_PATH_VARIANCE;
        loop->heading_variance[keyframe] = CAIRN_PI * CAIRN_PI;
        loop->heap_position[keyframe] = -1;
    }
    loop->variance[loop->query] = loop->heading_variance[loop->query] = 0;
    loop->heap_count = 1;
    heap_set(loop, 0, loop->query);
}

/* Expands the keyframe of least variance in the heap; returns 1 when the heap is empty. */
static int32_t expand_keyframe(cairn_mapper *mapper, cairn_budget *budget)
{
    mapper_loop *loop = &mapper->loop;
    int32_t keyframe, link;

    if (loop->heap_count == 0)
        return 1;
    keyframe = take_nearest(loop);
    cairn_budget_spend(budget, 1);
    for (link = loop->first_link[keyframe]; link >= 0;) {
        const mapper_link *l = &loop->links[link];
        int32_t end = l->second == keyframe;

        if (!l->dropped)
            relax_link(mapper, end ? l->first : l->second, l, keyframe);
        cairn_budget_spend(budget, 1);
        link = l->next[end];
    }
    return 0;
}

/* ---- Candidates ---- */

/* Returns the centroid of a keyframe's scan in the map. */
static cairn_vec2 scan_centroid(const cairn_mapper *mapper, int32_t keyframe)
{
    return cairn_pose_point(mapper->keyframe_pose[keyframe],
                            cairn_mapper_keyframe_record(mapper, keyframe)->centroid);
}

/* Inserts the best candidate of the finished group into the sorted candidates. */
static void end_group(mapper_loop *loop)
{
    ranked_list candidates = {.entries = loop->candidates,
                              .count = &loop->candidate_count,
                              .capacity = MAPPER_MAX_CANDIDATES,
                              .entry_bytes = sizeof *loop->candidates,
                              .score_at = offsetof(mapper_candidate, cost),
                              .least_first = 1};

    if (loop->in_group)
        (void)ranked_list_add(&candidates, &loop->best_of_group);
    loop->in_group = 0;
}

/* Returns the search radius of a keyframe, m: three standard deviations, at most search_radius. */
static cairn_real search_reach(const cairn_mapper *mapper, int32_t keyframe)
{
    return cairn_min(WINDOW_SIGMAS * cairn_sqrt(mapper->loop.variance[keyframe]),
                     mapper->params.loop.search_radius);
}

/* Tests one keyframe as a candidate; returns 1 when all have been tested. */
static int32_t select_candidate(cairn_mapper *mapper)
{
    mapper_loop *loop = &mapper->loop;
    int32_t keyframe = loop->cursor++;
    cairn_vec2 difference =
        cairn_vec2_sub(scan_centroid(mapper, keyframe), scan_centroid(mapper, loop->query));
    cairn_real centroid_distance = cairn_vec2_norm(difference);

    if (cairn_mapper_point_count(mapper, keyframe) > 0 &&
        centroid_distance < mapper->params.loop.candidate_radius + search_reach(mapper, keyframe)) {
        cairn_real pose_distance = cairn_sqrt(
            distance_squared(mapper->keyframe_pose[keyframe], mapper->keyframe_pose[loop->query]));
        cairn_real cost =
            centroid_distance + (POSE_DISTANCE_WEIGHT * pose_distance +
                                 SIGMA_PENALTY * loop->constraints[keyframe].position_sigma);

        if (!loop->in_group || cost < loop->best_of_group.cost) {
            loop->best_of_group.keyframe = keyframe;
            loop->best_of_group.cost = cost;
        }
        loop->in_group = 1;
    } else {
        end_group(loop);
    }
    if (loop->cursor < loop->query - mapper->params.loop.min_keyframe_gap)
        return 0;
    end_group(loop);
    return 1;
}

/* ---- The match ---- */

static void begin_candidate(cairn_mapper *mapper)
{
    mapper_loop *loop = &mapper->loop;
    int32_t keyframe = loop->candidates[loop->candidate].keyframe,
            half = mapper->params.loop.target_keyframes / 2;
    int32_t last = loop->query - mapper->params.loop.min_keyframe_gap;

    mapper->target.search_count = 0;
    cairn_scan_match_clear_target(mapper->search);
    loop->target_from = keyframe > half ? keyframe - half : 0;
    loop->target_end = loop->target_from + mapper->params.loop.target_keyframes;
    if (loop->target_end > last)
        loop->target_end = last;
    loop->phase = MAPPER_LOOP_BUILD_TARGET;
}

/* Returns 1 when a keyframe is farther from the candidate than target_keyframes steps between
 * keyframes: keyframes between the two were culled, or the trajectory is broken there. */
static int32_t is_off_path(const cairn_mapper *mapper, int32_t keyframe, int32_t candidate)
{
    cairn_real most =
        (cairn_real)mapper->params.loop.target_keyframes * mapper->params.keyframe_distance;

    return distance_squared(mapper->keyframe_pose[keyframe], mapper->keyframe_pose[candidate]) >
           most * most;
}

/* Adds a keyframe to the target map around the candidate; the map is complete when scan_match is
 * full. */
static void add_target_keyframe(cairn_mapper *mapper, cairn_budget *budget)
{
    mapper_loop *loop = &mapper->loop;
    int32_t keyframe = loop->target_from++, candidate = loop->candidates[loop->candidate].keyframe;

    cairn_budget_spend(budget, 1);
    if (keyframe != candidate && (loop->constraints[keyframe].position_sigma > MAX_TARGET_SIGMA_M ||
                                  is_off_path(mapper, keyframe, candidate)))
        return;
    if (cairn_mapper_add_search_target(mapper, keyframe, budget) != CAIRN_OK)
        loop->target_from = loop->target_end;
}

/* Starts the match. When scan_match refuses the query, the match ends without hypotheses. */
static void begin_match(cairn_mapper *mapper, cairn_budget *budget)
{
    mapper_loop *loop = &mapper->loop;
    int32_t keyframe = loop->candidates[loop->candidate].keyframe;
    cairn_visibility visibility = cairn_mapper_visibility(mapper, loop->query);
    cairn_scan_match_window window;
    cairn_status status;

    window.distance = cairn_min(search_reach(mapper, keyframe) + WINDOW_MARGIN_M,
                                mapper->params.loop.search_radius);
    window.angle = WINDOW_SIGMAS * cairn_sqrt(loop->heading_variance[keyframe]) + WINDOW_MARGIN_RAD;
    loop->phase = MAPPER_LOOP_MATCH;
    cairn_budget_spend(budget, 2 + loop->query_part.count / 4);
    status = cairn_scan_match_begin(mapper->search, &loop->query_part,
                                    mapper->keyframe_pose[loop->query], &window, NULL);
    if (status == CAIRN_OK)
        status = cairn_scan_match_set_query_view(mapper->search, &visibility, NULL);
    if (status != CAIRN_OK)
        cairn_scan_match_clear_target(mapper->search);
}

void cairn_mapper_preempt_loop_match(cairn_mapper *mapper)
{
    if (mapper->loop.phase == MAPPER_LOOP_BUILD_TARGET || mapper->loop.phase == MAPPER_LOOP_MATCH)
        mapper->loop.phase = MAPPER_LOOP_BEGIN_CANDIDATE;
}

/* ---- Verification ---- */

/* Returns 1 when two closures are consistent: the cycle through both and the two paths between them
 * has a small residual, given the drift allowed per keyframe. */
static int32_t is_consistent(const cairn_mapper *mapper, const mapper_pending *a,
                             const mapper_pending *b)
{
    cairn_pose second =
        cairn_pose_between(mapper->keyframe_pose[a->second], mapper->keyframe_pose[b->second]);
    cairn_pose first =
        cairn_pose_between(mapper->keyframe_pose[a->first], mapper->keyframe_pose[b->first]);
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
    cairn_status status = cairn_mapper_add_closure(mapper, closure->first, closure->second,
                                                   closure->first_second, closure->covariance);

    closure->accepted = 1;
    if (status == CAIRN_FULL)
        mapper->state.capacity_exceeded =
            mapper->state.capacity_exceeded > 1 ? mapper->state.capacity_exceeded : 1;
    if (status == CAIRN_OK)
        cairn_mapper_record_loop(mapper, closure->first, closure->second, closure->first_second,
                                 CAIRN_MAPPER_LOOP_ACCEPTED);
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
        mapper_pending *earlier = &loop->pending[i];

        if (closure->second - earlier->second > mapper->params.loop.min_keyframe_gap)
            continue;
        if (is_consistent(mapper, earlier, closure)) {
            consistent_count += earlier->second != closure->second && earlier->second != last;
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
        cairn_mapper_record_loop(mapper, closure->first, closure->second, closure->first_second,
                                 CAIRN_MAPPER_LOOP_PENDING);
    }
    loop->pending_count++;
}

int32_t cairn_mapper_is_ambiguous(const cairn_scan_match_result *result)
{
    return result->count > 1 &&
           result->hypotheses[1].score > AMBIGUITY_RATIO * result->hypotheses[0].score;
}

/* Returns the negative log prior of a closure, nats: half its squared Mahalanobis distance from the
 * prior of the path, whose position variance (var x + var y) is taken as isotropic. */
static cairn_real negative_log_prior(const cairn_mapper *mapper, const mapper_pending *closure)
{
    const mapper_loop *loop = &mapper->loop;
    cairn_pose now = cairn_pose_between(mapper->keyframe_pose[closure->first],
                                        mapper->keyframe_pose[closure->second]);
    cairn_pose off = cairn_pose_between(closure->first_second, now);

    return (off.x * off.x + off.y * off.y) / loop->variance[closure->first] +
           off.theta * off.theta / (2 * loop->heading_variance[closure->first]);
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

/* Verifies the match of the current candidate: accepts, defers or rejects the closure. */
static void verify(cairn_mapper *mapper)
{
    mapper_loop *loop = &mapper->loop;
    const cairn_mapper_loop_params *p = &mapper->params.loop;
    cairn_scan_match_result result = cairn_scan_match_read(mapper->search);
    const cairn_scan_match_hypothesis *h = result.hypotheses;
    int32_t keyframe = loop->candidates[loop->candidate].keyframe;
    mapper_pending closure;

    memset(&closure, 0, sizeof closure);
    closure.first = keyframe;
    closure.second = loop->query;
    if (result.count > 0) {
        closure.first_second = cairn_pose_between(mapper->keyframe_pose[keyframe], h->target_query);
        closure.covariance = closure_covariance(mapper, h);
    }
    if (result.count == 0 || result.verdict == CAIRN_SCAN_MATCH_NONE ||
        h->log_odds < p->min_log_odds)
        cairn_mapper_record_loop(mapper, keyframe, loop->query, closure.first_second,
                                 CAIRN_MAPPER_LOOP_NO_MATCH);
    else if (cairn_mapper_is_ambiguous(&result))
        cairn_mapper_record_loop(mapper, keyframe, loop->query, closure.first_second,
                                 CAIRN_MAPPER_LOOP_AMBIGUOUS);
    else if (h->free_space_violation > p->max_free_space_violation ||
             h->target_free_space_violation > p->max_free_space_violation)
        cairn_mapper_record_loop(mapper, keyframe, loop->query, closure.first_second,
                                 CAIRN_MAPPER_LOOP_FREE_SPACE_VIOLATION);
    else if (search_reach(mapper, keyframe) < p->local_search_radius)
        accept(mapper, &closure);
    else if (h->log_odds - negative_log_prior(mapper, &closure) < p->min_log_odds)
        cairn_mapper_record_loop(mapper, keyframe, loop->query, closure.first_second,
                                 CAIRN_MAPPER_LOOP_UNLIKELY);
    else
        check_consistency(mapper, &closure);
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

/* Chooses the next task; CAIRN_OK with phase MAPPER_LOOP_IDLE: none. */
static cairn_status begin_next(cairn_mapper *mapper, cairn_budget *budget)
{
    mapper_loop *loop = &mapper->loop;
    int32_t has_next = loop->graph_keyframes < keyframes_outside_window(mapper);
    int32_t may_cull = cairn_mapper_may_cull(mapper);
    cairn_status status = CAIRN_OK;

    loop->cursor = 0;
    if (may_cull && (loop->unsolved_closures == 0 || loop->factor_full)) {
        cairn_mapper_begin_redundancy(mapper);
        cairn_budget_spend(budget, 1);
        loop->phase = MAPPER_LOOP_REDUNDANCY;
    } else if (may_cull || cairn_mapper_needs_optimization(mapper) ||
               (!has_next && loop->settling && loop->unsolved_closures > 0 && !loop->factor_full)) {
        loop->phase = MAPPER_LOOP_OPTIMIZE;
    } else if (has_next) {
        loop->query = loop->graph_keyframes;
        status = cairn_mapper_add_to_graph(mapper);
        cairn_budget_spend(budget, 4);
        loop->keyframes_since_solve++;
        if (loop->query > mapper->params.loop.min_keyframe_gap &&
            cairn_mapper_point_count(mapper, loop->query) > 0)
            loop->phase = MAPPER_LOOP_RESET_PATHS;
    }
    return status;
}

/* Processes one unit of work of the current phase. */
static cairn_status advance_loop(cairn_mapper *mapper, cairn_budget *budget)
{
    mapper_loop *loop = &mapper->loop;
    cairn_status status = CAIRN_OK;

    switch (loop->phase) {
    case MAPPER_LOOP_RESET_PATHS:
        begin_distances(mapper);
        cairn_budget_spend(budget, 1 + loop->graph_keyframes / KEYFRAMES_PER_UNIT);
        loop->phase = MAPPER_LOOP_PATH_VARIANCE;
        break;
    case MAPPER_LOOP_PATH_VARIANCE:
        if (expand_keyframe(mapper, budget)) {
            loop->candidate_count = loop->in_group = loop->cursor = 0;
            loop->phase = MAPPER_LOOP_SELECT_CANDIDATES;
        }
        break;
    case MAPPER_LOOP_SELECT_CANDIDATES:
        cairn_budget_spend(budget, 1);
        if (!select_candidate(mapper))
            break;
        loop->candidate = 0;
        loop->phase = MAPPER_LOOP_IDLE;
        if (loop->candidate_count > 0) {
            loop->query_part = cairn_mapper_keyframe_part(mapper, loop->query, loop->query_points);
            cairn_budget_spend(budget, 2 + loop->query_part.count / 4);
            loop->phase = MAPPER_LOOP_BEGIN_CANDIDATE;
        }
        break;
    case MAPPER_LOOP_BEGIN_CANDIDATE:
        cairn_budget_spend(budget, 1);
        begin_candidate(mapper);
        break;
    case MAPPER_LOOP_BUILD_TARGET:
        if (loop->target_from < loop->target_end)
            add_target_keyframe(mapper, budget);
        else
            begin_match(mapper, budget);
        break;
    case MAPPER_LOOP_MATCH:
        status = cairn_scan_match_step(mapper->search, budget);
        if (status != CAIRN_OK)
            break;
        verify(mapper);
        cairn_budget_spend(budget, 8 + 4 * MAPPER_MAX_PENDING);
        loop->phase = MAPPER_LOOP_IDLE;
        if (++loop->candidate < loop->candidate_count)
            loop->phase = MAPPER_LOOP_BEGIN_CANDIDATE;
        break;
    case MAPPER_LOOP_REDUNDANCY:
        if (!cairn_mapper_score_redundancy(mapper, cairn_mapper_cull_end(mapper), budget))
            break;
        status = cairn_mapper_cull_keyframe(
            mapper, cairn_mapper_most_redundant(mapper, cairn_mapper_cull_end(mapper)), budget);
        loop->phase = MAPPER_LOOP_COMPACT;
        break;
    case MAPPER_LOOP_COMPACT:
        status = cairn_scan_set_pack(mapper->keyframes, budget);
        if (status == CAIRN_OK)
            loop->phase = MAPPER_LOOP_IDLE;
        break;
    default:
        status = cairn_mapper_optimize_step(mapper, budget);
        break;
    }
    return status;
}

cairn_status cairn_mapper_loop_step(cairn_mapper *mapper, cairn_budget *budget,
                                    int32_t until_capacity)
{
    mapper_loop *loop = &mapper->loop;
    cairn_status status = CAIRN_OK;

    while (status == CAIRN_OK) {
        if (budget->left <= 0 || (until_capacity && !cairn_mapper_must_cull(mapper)))
            return CAIRN_MORE;
        if (loop->phase == MAPPER_LOOP_IDLE) {
            status = begin_next(mapper, budget);
            if (loop->phase == MAPPER_LOOP_IDLE &&
                loop->graph_keyframes >= keyframes_outside_window(mapper))
                break;
        } else {
            status = advance_loop(mapper, budget);
        }
    }
    mapper->state.pending_keyframes = keyframes_outside_window(mapper) - loop->graph_keyframes;
    return status;
}
