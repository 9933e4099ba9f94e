/* What happens to a scan: prediction, lines, match, result, work in the background.
 *
 * Method.
 *
 * 1. The scan is predicted (mapper_front.c) and matched (mapper_match.c). Its points are evenly
 *    spaced along the surfaces. One point per beam would let near walls dominate the normal
 *    equations, and their small systematic errors would rotate the map.
 * 2. The local map consists of the most recent keyframes and of the nearest ones among the last
 *    local_span. Older keyframes are joined by loop closures (mapper_loop.c, mapper_graph.c), which
 *    distribute the error over the path. A match against them would put all of it into one link.
 * 3. A keyframe is stored with its visibility profile and its sequential constraints.
 * 4. Force field, loop closure and graph optimization then work in the background, each within its
 *    share of units.
 *
 * Layout: keyframes in a scan_set with a pose each. The local map is in the icp object. It is
 * rebuilt when a keyframe was added or moved, or the robot has left the place for which it was
 * built.
 *
 * Limits: keyframes are removed only by culling (mapper_culling.c). */
#include "src/base/build.h"

#include <string.h>

#include "src/base/step.h"
#include "src/maps/mapper_work.h"

enum {
    USUAL_SPAN_SCANS = 10, /* time constant of the smoothed interval between scans */
    MAX_INTERVALS = 4,     /* without scans, whose units a search takes */
    BEAMS_KEPT_PER_UNIT = 16,
    MIN_SCANS_BETWEEN_KEYFRAMES = 2, /* before a keyframe for low overlap */
    CONSTRAINT_UNITS = 8             /* per keyframe of the local map */
};

/* m: maximum distance of odometry from its origin. */
static const cairn_real MAX_ODOMETRY_M = CAIRN_REAL(1e9);

/* ---- Input ---- */

/* Sets the interval since the previous scan, and the number of usual intervals in it. They are
 * compared in units of 2^16 ns, which 32 bits hold for a day. */
static void set_span(cairn_mapper *mapper, int64_t stamp_ns)
{
    mapper_previous *previous = &mapper->previous;
    int64_t units;
    int32_t span;

    previous->span = cairn_time_difference(stamp_ns, previous->stamp);
    previous->intervals = 1;
    units = previous->span / 65536;
    if (mapper->state.scans == 0 || units <= 0)
        return;
    span = units < INT32_MAX ? (int32_t)units : INT32_MAX;
    if (previous->usual_span == 0)
        previous->usual_span = span;
    if (span > previous->usual_span)
        previous->intervals = span / previous->usual_span;
    if (previous->intervals > MAX_INTERVALS)
        previous->intervals = MAX_INTERVALS;
    if (span / MAX_INTERVALS > previous->usual_span)
        span = MAX_INTERVALS * previous->usual_span; /* a pause says little of the usual interval */
    previous->usual_span += (span - previous->usual_span) / USUAL_SPAN_SCANS;
}

/* Returns the current pose of the previous scan. */
static cairn_pose last_pose(const cairn_mapper *mapper)
{
    if (mapper->state.scans == 0)
        return cairn_pose_identity();
    return cairn_pose_compose(mapper->keyframe_pose[mapper->result.keyframe],
                              mapper->result.keyframe_scan);
}

cairn_status cairn_mapper_add(cairn_mapper *mapper, const cairn_scan_input *input,
                              const cairn_pose *odometry, cairn_fault *fault)
{
    cairn_pose by_odometry = cairn_pose_identity();
    cairn_scan_input sweep;
    int32_t has_odometry;
    cairn_status status;

    if (mapper == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (mapper->is_pending)
        return cairn_refuse(fault, -1, "the previous scan is still being processed: step first",
                            CAIRN_BUSY);
    if (mapper->full)
        return CAIRN_FULL;
    if (odometry != NULL && !cairn_pose_is_finite(*odometry))
        return CAIRN_NOT_FINITE;
    if (odometry != NULL && !cairn_pose_is_within(*odometry, MAX_ODOMETRY_M))
        return CAIRN_BAD_ARGUMENT;
    has_odometry = odometry != NULL && (mapper->previous.has_odometry || mapper->state.scans == 0);
    if (has_odometry && mapper->state.scans > 0)
        by_odometry = cairn_pose_between(mapper->previous.odometry, *odometry);
    if (!(cairn_mapper_translation(by_odometry) <= CAIRN_SCAN_EXTENT)) {
        by_odometry = cairn_pose_identity(); /* a jump of odometry is ignored */
        has_odometry = 0;
    }
    if (input == NULL)
        return cairn_scan_begin(mapper->scan, NULL, fault);
    sweep = *input;
    sweep.motion = cairn_mapper_sweep_motion(mapper, input, has_odometry ? &by_odometry : NULL);
    status = cairn_scan_begin(mapper->scan, &sweep, fault);
    if (status != CAIRN_OK)
        return status;

    mapper->current.has_odometry = has_odometry;
    mapper->current.by_odometry = by_odometry;
    mapper->previous.pose = last_pose(mapper);
    set_span(mapper, input->stamp_ns);
    mapper->previous.stamp = input->stamp_ns;
    if (mapper->state.scans == 0 && odometry != NULL)
        /* The odometry frame defines the map frame. */
        mapper->previous.pose = *odometry;
    mapper->previous.has_odometry = odometry != NULL;
    if (odometry != NULL)
        mapper->previous.odometry = *odometry;
    mapper->loop.settling = 0;
    mapper->status = CAIRN_OK;
    mapper->is_pending = 1;
    return CAIRN_MORE;
}

/* ---- The result ---- */

/* Returns 1 when the scan shows what the local map does not: it has moved, or its overlap is low.
 * Scans without a match are none until the search for the pose is given up: the next one may be
 * found in the map as it is. */
static int is_keyframe(const cairn_mapper *mapper, cairn_pose map_scan)
{
    cairn_pose step;

    if (mapper->keyframe_count == 0)
        return 1;
    if (mapper->unmatched > 0)
        return 0;
    if (mapper->result.overlap < mapper->params.keyframe_min_overlap &&
        mapper->scans_since_keyframe >= MIN_SCANS_BETWEEN_KEYFRAMES)
        return 1;
    step = cairn_pose_between(mapper->keyframe_pose[mapper->keyframe_count - 1], map_scan);
    return step.x * step.x + step.y * step.y >
               mapper->params.keyframe_distance * mapper->params.keyframe_distance ||
           cairn_abs(step.theta) > mapper->params.keyframe_angle;
}

/* Stores the current scan as a keyframe. A force field run in progress ends with the poses reached
 * so far, and the scan moves with its predecessor. */
static cairn_status store_keyframe(cairn_mapper *mapper, const cairn_scan_view *view)
{
    cairn_mapper_result *result = &mapper->result;
    int32_t keyframe = mapper->keyframe_count, slot = cairn_scan_set_next(mapper->keyframes);
    cairn_status status = cairn_scan_set_add(mapper->keyframes, view, NULL, NULL);

    if (status != CAIRN_OK) {
        result->is_keyframe = 0;
        mapper->full = 1;
        return status;
    }
    if (cairn_mapper_window_runs(mapper)) {
        cairn_pose step = cairn_pose_between(mapper->keyframe_pose[keyframe - 1], result->map_scan);

        cairn_mapper_read_window(mapper);
        result->map_scan = cairn_pose_compose(mapper->keyframe_pose[keyframe - 1], step);
    }
    mapper->slot[keyframe] = slot;
    mapper->keyframe_count++;
    mapper->keyframe_pose[keyframe] = result->map_scan;
    mapper->target.is_stale = 1;
    if (mapper->visibility != NULL) {
        cairn_visibility visibility = cairn_mapper_visibility(mapper, keyframe);

        cairn_visibility_fill(&visibility, view->sensor, view->beams, view->beam_count);
    }
    if (mapper->loop.graph != NULL)
        cairn_mapper_constrain_keyframe(mapper, &mapper->loop.constraints[keyframe]);
    if (mapper->params.cull_keyframes)
        mapper->loop.redundancy.score[keyframe] = -1;
    mapper->window.is_active = 0;
    if (mapper->params.window && keyframe > 0 && !cairn_mapper_loops_lag(mapper))
        cairn_mapper_begin_window(mapper);
    return status;
}

/* Returns the cost of the result: covariances of the scan relative to the keyframes of the local
 * map, and the copies of a keyframe and of the beams. */
static int32_t store_units(const cairn_mapper *mapper)
{
    cairn_scan_view view = cairn_scan_read(mapper->scan);
    int32_t units = 4 + view.point_count / 4 + view.beam_count / BEAMS_KEPT_PER_UNIT;

    return mapper->loop.graph != NULL ? units + CONSTRAINT_UNITS * mapper->target.count : units;
}

/* Fills in pose, overlap, covariance and verdict of the result. */
static void store_pose(cairn_mapper *mapper, int32_t is_first, int32_t point_count)
{
    const cairn_icp_result *match = &mapper->current.match;
    cairn_mapper_result *result = &mapper->result;

    if (mapper->current.has_match) {
        result->map_scan = match->target_query;
        result->overlap = match->overlap;
        memcpy(result->covariance, match->covariance, sizeof result->covariance);
        result->verdict = CAIRN_MAPPER_MATCHED;
        return;
    }
    result->map_scan = mapper->current.predicted;
    result->overlap = 0;
    memset(result->covariance, 0, sizeof result->covariance);
    result->verdict = point_count == 0 ? CAIRN_MAPPER_NO_FEATURES
                      : is_first       ? CAIRN_MAPPER_FIRST
                                       : CAIRN_MAPPER_PREDICTED;
    mapper->state.predicted += result->verdict != CAIRN_MAPPER_FIRST;
}

/* Fills in the result and stores the scan if it is a keyframe. CAIRN_FULL: no capacity for it. */
static cairn_status store_result(cairn_mapper *mapper)
{
    cairn_scan_view view = cairn_scan_read(mapper->scan);
    cairn_mapper_result *result = &mapper->result;
    cairn_pose last = last_pose(mapper);
    cairn_status status = CAIRN_OK;
    int32_t first = mapper->keyframe_count == 0;

    if (mapper->state.scans == 0)
        last = mapper->current.predicted;
    if (!mapper->previous.has_odometry && mapper->finished.has_odometry) {
        mapper->finished.map_odom = cairn_mapper_map_odom(mapper);
        mapper->finished.has_odometry = 0;
    }
    cairn_mapper_update_motion_model(mapper);
    store_pose(mapper, first, view.point_count);

    mapper->previous.motion =
        cairn_mapper_next_motion(mapper, cairn_pose_between(last, result->map_scan));
    /* The first scan is a keyframe even without features: other scans need a reference. */
    result->is_keyframe = (first || view.point_count > 0) && is_keyframe(mapper, result->map_scan);
    if (result->is_keyframe)
        status = store_keyframe(mapper, &view);
    result->keyframe =
        result->is_keyframe ? mapper->keyframe_count - 1 : cairn_mapper_choose_reference(mapper);
    result->keyframe_scan =
        cairn_pose_between(mapper->keyframe_pose[result->keyframe], result->map_scan);
    mapper->scans_since_keyframe =
        result->is_keyframe
            ? 0
            : mapper->scans_since_keyframe + (mapper->scans_since_keyframe < INT32_MAX);
    if (mapper->previous.has_odometry) {
        mapper->finished.has_odometry = 1;
        mapper->finished.odometry = mapper->previous.odometry;
    }
    cairn_mapper_keep_ranges(mapper);
    mapper->state.scans++;
    mapper->state.keyframes = mapper->keyframe_count;
    return status;
}

/* ---- Steps ---- */

/* Returns 1 when there is something to match. */
static int can_match(const cairn_mapper *mapper)
{
    return cairn_scan_read(mapper->scan).point_count > 0 && mapper->keyframes->point_count > 0;
}

/* Continues a task of the background. Returns 1 when it is done, or the scan's share is used up; it
 * is then continued at the next scan. */
static int background(cairn_mapper *mapper, cairn_budget *budget,
                      int (*task)(cairn_mapper *, cairn_budget *))
{
    return task(mapper, budget) || budget->left > 0;
}

/* What happens to a scan. Returns 1 when it is processed. */
static int process(cairn_mapper *mapper, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(mapper->resume);
    cairn_mapper_predict(mapper);
    CAIRN_STEP_UNTIL(mapper->resume, cairn_scan_step(mapper->scan, budget) != CAIRN_MORE);
    if (can_match(mapper)) {
        if (cairn_mapper_needs_local(mapper))
            CAIRN_STEP_RUN(mapper, resume, budget, cairn_mapper_build_local);
        if (cairn_icp_target_count(mapper->icp) > 0)
            CAIRN_STEP_RUN(mapper, resume, budget, cairn_mapper_match);
    }

    /* Commit point: the pose; a keyframe, its constraints, the start of the force field. */
    CAIRN_STEP_CHARGE(mapper, resume, budget, store_units(mapper));
    mapper->status = store_result(mapper);
    cairn_mapper_begin_shares(mapper);
    if (cairn_mapper_must_cull(mapper))
        cairn_mapper_end_window(mapper);

    if (mapper->status == CAIRN_OK && mapper->window.is_active)
        CAIRN_STEP_UNTIL(mapper->resume, background(mapper, budget, cairn_mapper_window_step));
    /* Loop closure, graph and culling rest while the force field moves keyframes. */
    if (mapper->status == CAIRN_OK && mapper->loop.graph != NULL && !mapper->window.is_active)
        CAIRN_STEP_UNTIL(mapper->resume, background(mapper, budget, cairn_mapper_loop_step));
    CAIRN_STEP_END(mapper->resume);
}

cairn_status cairn_mapper_step(cairn_mapper *mapper, cairn_budget *budget)
{
    int32_t before;

    if (mapper == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!mapper->is_pending)
        return CAIRN_OK;
    if (budget->left <= 0)
        return CAIRN_MORE;
    before = budget->left;
    mapper->is_pending = !process(mapper, budget);
    mapper->state.units += (int64_t)before - budget->left;
    return mapper->is_pending ? CAIRN_MORE : mapper->status;
}

cairn_status cairn_mapper_map(cairn_mapper *mapper, const cairn_scan_input *input,
                              const cairn_pose *odometry, cairn_fault *fault)
{
    cairn_status status = cairn_mapper_add(mapper, input, odometry, fault);

    while (status == CAIRN_MORE) {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        status = cairn_mapper_step(mapper, &budget);
    }
    return status;
}

cairn_status cairn_mapper_settle(cairn_mapper *mapper, cairn_budget *budget)
{
    cairn_status status;
    int32_t before;

    if (mapper == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    status = cairn_mapper_step(mapper, budget);
    if (status != CAIRN_OK)
        return status;
    before = budget->left;
    mapper->status = CAIRN_OK;
    mapper->loop.settling = 1;
    if ((!mapper->window.is_active || cairn_mapper_window_step(mapper, budget)) &&
        (mapper->loop.graph == NULL || cairn_mapper_loop_step(mapper, budget)))
        mapper->loop.settling = 0;
    mapper->state.units += (int64_t)before - budget->left;
    return mapper->loop.settling ? CAIRN_MORE : mapper->status;
}

/* ---- Readers ---- */

cairn_mapper_result cairn_mapper_read(const cairn_mapper *mapper)
{
    return mapper->result;
}

cairn_scan_view cairn_mapper_view(const cairn_mapper *mapper)
{
    return cairn_scan_read(mapper->scan);
}

static int is_below(int32_t index, int32_t count)
{
    return index >= 0 && index < count;
}

cairn_pose cairn_mapper_keyframe_pose(const cairn_mapper *mapper, int32_t keyframe)
{
    return is_below(keyframe, mapper->keyframe_count) ? mapper->keyframe_pose[keyframe]
                                                      : cairn_pose_identity();
}

const cairn_scan_set *cairn_mapper_keyframes(const cairn_mapper *mapper)
{
    return mapper->keyframes;
}

cairn_pose cairn_mapper_map_odom(const cairn_mapper *mapper)
{
    if (!mapper->finished.has_odometry)
        return mapper->finished.map_odom;
    return cairn_pose_compose(last_pose(mapper), cairn_pose_inverse(mapper->finished.odometry));
}

cairn_mapper_loop cairn_mapper_loop_at(const cairn_mapper *mapper, int32_t index)
{
    const cairn_mapper_loop none = {.first = -1, .second = -1};

    return is_below(index, mapper->state.loop_events)
               ? mapper->loop.events[index % MAPPER_LOOP_EVENTS]
               : none;
}

int32_t cairn_mapper_link_count(const cairn_mapper *mapper)
{
    return mapper->loop.link_count;
}

int32_t cairn_mapper_keyframe_slot(const cairn_mapper *mapper, int32_t keyframe)
{
    return is_below(keyframe, mapper->keyframe_count) ? mapper->slot[keyframe] : -1;
}

cairn_mapper_culling cairn_mapper_culling_at(const cairn_mapper *mapper, int32_t index)
{
    const cairn_mapper_culling none = {.keyframe = -1, .reference = -1};

    return is_below(index, mapper->state.culled_keyframes)
               ? mapper->cullings[index % MAPPER_CULLING_EVENTS]
               : none;
}

cairn_mapper_link cairn_mapper_link_at(const cairn_mapper *mapper, int32_t index)
{
    cairn_mapper_link out = {.first = -1, .second = -1};
    const mapper_link *link;

    if (!is_below(index, mapper->loop.link_count))
        return out;
    link = &mapper->loop.links[index];
    out.first = link->first;
    out.second = link->second;
    out.first_second = cairn_pose_graph_measurement(mapper->loop.graph, index, &out.information);
    out.is_loop = link->is_loop;
    out.is_outlier = link->dropped;
    out.error_probability = link->is_loop ? link->error_probability : 0;
    return out;
}

cairn_mapper_state cairn_mapper_measure(const cairn_mapper *mapper)
{
    cairn_mapper_state state = mapper->state;

    state.pending_keyframes = cairn_mapper_pending_keyframes(mapper);
    return state;
}
