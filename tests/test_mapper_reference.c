/* The mapper compared with a reference implementation: the same modules, called one after another,
 * over keyframes sorted as a whole. */
#include "tests/drive.h"

#include <math.h>

enum {
    KEYFRAMES = 200,
    POINTS = 400,
    SEGMENTS = 64,
    STRETCH_SCANS = 200,
    FLOOR_SCANS = 12,
    FLOOR_M = 2
};

typedef struct reference_key {
    cairn_segment segments[SEGMENTS];
    int32_t first_point[SEGMENTS + 1];
    cairn_oriented_point points[POINTS];
    cairn_scan_view view;
    cairn_pose pose;
} reference_key;

typedef struct reference {
    cairn_real odometry_health; /* in odometry */
    cairn_real noise_scale;     /* multiples of its standard deviations */
    cairn_vec2 bias;            /* added to it */
    cairn_vec2 velocity;
    /* Since odometry and poses last agreed: motions of all scans by both, whether all matches were
     * good, and the deviations of the matches in a row that are off. */
    cairn_pose by_odometry[STRETCH_SCANS], by_poses[STRETCH_SCANS];
    cairn_real off[STRETCH_SCANS];
    int32_t stretch_scans, all_good, off_count, still_count;
    cairn_real learnt; /* noise of the odometry, m in 3 m, and the stretches that it is from */
    int32_t learnt_from;
    int32_t rest;        /* scans since the last keyframe */
    int32_t unmatched;   /* scans in a row without a match, with odometry, ... */
    cairn_real lost_way; /* ... and the way by odometry meanwhile, m */
    int32_t weak_scans;  /* scans whose translation was unobservable */
    cairn_mapper_params params;
    cairn_pool pool;
    cairn_scan *scan;
    cairn_icp *icp;
    cairn_force_field *field;
    reference_key *keys;
    cairn_mapper_state state;
    cairn_mapper_result result;
    int32_t key_points;
    int32_t had_odometry;
    cairn_pose odometry, motion; /* of the last scan */
    int32_t map_made;            /* the local map, and where */
    cairn_pose map_at;
} reference;

static reference new_reference(const cairn_mapper_params *params)
{
    cairn_icp_params icp = params->icp;
    cairn_force_field_params field = params->field;
    reference t;

    memset(&t, 0, sizeof t);
    t.params = *params;
    t.odometry_health = t.noise_scale = 1;
    t.all_good = 1;
    t.learnt = CAIRN_REAL(0.1);
    t.keys = calloc(KEYFRAMES, sizeof *t.keys);
    assert_non_null(t.keys);
    icp.max_target = params->max_local_points;
    field.max_scans = params->window;
    field.max_segments = params->window * params->scan.max_segments;
    field.max_points = params->max_local_points;
    t.pool = test_pool(cairn_scan_memory(&params->scan) + cairn_icp_memory(&icp) +
                       cairn_force_field_memory(&field));
    assert_ok(cairn_scan_create(&t.scan, &t.pool, &params->scan));
    assert_ok(cairn_icp_create(&t.icp, &t.pool, &icp));
    if (params->window > 0)
        assert_ok(cairn_force_field_create(&t.field, &t.pool, &field));
    return t;
}

static void free_reference(reference *t)
{
    free(t->keys);
    test_pool_free(&t->pool);
}

/* ---- The local map ---- */

typedef struct place {
    int32_t key;
    cairn_real distance;
} place;

/* By distance, then the younger one. */
static int compare_places(const void *a, const void *b)
{
    const place *p = a, *q = b;

    if (p->distance < q->distance || p->distance > q->distance)
        return p->distance < q->distance ? -1 : 1;
    return q->key - p->key;
}

static void make_map(reference *t, cairn_pose at)
{
    place places[KEYFRAMES];
    int32_t span = t->params.local_span, count = 0;
    int32_t oldest = span > 0 && t->state.keyframes > span ? t->state.keyframes - span : 0;

    for (int32_t k = oldest; k < t->state.keyframes; k++) {
        cairn_real x = t->keys[k].pose.x - at.x, y = t->keys[k].pose.y - at.y;
        cairn_real distance = cairn_sqrt(x * x + y * y);

        if (k >= t->state.keyframes - t->params.local_recent)
            distance = -1;
        if (distance > t->params.local_radius)
            continue;
        places[count].key = k;
        places[count++].distance = distance;
    }
    qsort(places, (size_t)count, sizeof *places, compare_places);
    if (count > t->params.local_keyframes)
        count = t->params.local_keyframes;
    cairn_icp_clear_target(t->icp);
    /* A unit for every keyframe examined, for 64 points of capacity and for two of each
     * keyframe. */
    t->state.units += t->state.keyframes - oldest + 1 + t->params.max_local_points / 64;
    for (int32_t i = 0, points = 0; i < count && points <= t->params.max_local_points; i++) {
        const reference_key *k = &t->keys[places[i].key];

        points += k->view.point_count;
        if (points <= t->params.max_local_points)
            assert_ok(
                cairn_icp_add_target(t->icp, k->view.points, k->view.point_count, k->pose, NULL));
        t->state.units += 1 + k->view.point_count;
    }
    t->map_made = 1;
    t->map_at = at;
}

/* ---- Matches ---- */

static cairn_real way_of(cairn_pose motion)
{
    return cairn_sqrt(motion.x * motion.x + motion.y * motion.y);
}

/* The motion prior of a scan, from odometry or from the last motion. */
static cairn_rigid_motion_pose_prior prior_of(const reference *t, cairn_pose last,
                                              cairn_pose motion, int32_t is_odometry)
{
    const cairn_mapper_params *p = &t->params;
    cairn_real way = way_of(motion);
    cairn_rigid_motion_pose_prior prior;

    prior.mean = cairn_pose_compose(last, motion);
    prior.sigma_x = is_odometry
                        ? t->noise_scale * (p->odometry_distance_min + p->odometry_distance * way)
                        : p->motion_distance_min + p->motion_distance * way;
    prior.sigma_y = prior.sigma_x;
    prior.sigma_theta =
        is_odometry ? t->noise_scale * (p->odometry_turn_min +
                                        p->odometry_turn * (cairn_abs(motion.theta) + way / 10))
                    : p->motion_turn_min + p->motion_turn * cairn_abs(motion.theta);
    return prior;
}

static cairn_icp_result match(reference *t, const cairn_rigid_motion_pose_prior *prior)
{
    cairn_scan_view view = cairn_scan_read(t->scan);
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(cairn_icp_begin(t->icp, view.points, view.point_count, prior->mean, prior, NULL));
    assert_ok(cairn_icp_step(t->icp, &budget));
    t->state.units += CAIRN_UNBOUNDED - budget.left;
    return cairn_icp_read(t->icp);
}

/* Odometry that is two standard deviations off loses weight, agreement raises it, by a tenth each.
 * Where the scan observes all of its motion: beyond one standard deviation the noise scale rises
 * for a while, up to four; beyond one and a half a pure translation error becomes the bias. */
static void weigh_odometry(reference *t, const cairn_rigid_motion_pose_prior *prior,
                           const cairn_icp_result *found)
{
    cairn_pose e = cairn_pose_between(prior->mean, found->target_query);
    cairn_real way_off = way_of(e) / prior->sigma_x,
               turn_off = cairn_abs(e.theta) / prior->sigma_theta;
    cairn_real off = t->noise_scale * (way_off > turn_off ? way_off : turn_off),
               faded = t->noise_scale * CAIRN_REAL(0.8);

    if (found->weak_ratio >= CAIRN_REAL(0.05)) {
        t->noise_scale = off > 4 ? 4 : off;
        if (t->noise_scale < faded)
            t->noise_scale = faded;
        if (t->noise_scale < 1)
            t->noise_scale = 1;
        {
            int32_t is_bias = t->noise_scale * way_off > CAIRN_REAL(1.5) &&
                              way_of(e) > CAIRN_REAL(0.1) && cairn_abs(e.theta) < CAIRN_REAL(0.08);

            t->bias.x = is_bias ? e.x : 0;
            t->bias.y = is_bias ? e.y : 0;
        }
    } else {
        t->bias.x *= CAIRN_REAL(0.8);
        t->bias.y *= CAIRN_REAL(0.8);
    }
    t->odometry_health += CAIRN_REAL(0.1) * ((off > 2 ? 0 : 1) - t->odometry_health);
    t->state.odometry_contradicted += off > 2;
}

/* ---- Matches that contradict the odometry ---- */

/* All motions, one after another. */
static cairn_pose end_of(const cairn_pose *motions, int32_t count)
{
    cairn_pose end = cairn_pose_identity();

    for (int32_t i = 0; i < count; i++)
        end = cairn_pose_compose(end, motions[i]);
    return end;
}

/* Translation, and what the heading makes over 3 m. */
static cairn_real length_of(cairn_pose motion)
{
    return way_of(motion) + 3 * cairn_abs(motion.theta);
}

static void agree(reference *t)
{
    t->stretch_scans = t->off_count = 0;
    t->all_good = 1;
}

/* A step towards the noise whose median the deviation is: a half, two fifths, ... and at least a
 * twentieth; never below 2 cm. */
static void learn(reference *t, cairn_real deviation)
{
    cairn_real step = 2 / (cairn_real)(4 + t->learnt_from++);

    if (step < CAIRN_REAL(0.05))
        step = CAIRN_REAL(0.05);
    t->learnt += (deviation > CAIRN_REAL(1.18) * t->learnt ? step : -step) * t->learnt;
    if (t->learnt < CAIRN_REAL(0.02))
        t->learnt = CAIRN_REAL(0.02);
}

/* Returns 1 when the last three matches that are off, the current one included, move as the
 * odometry does: their deviation changes by less than 2 cm and 0.6 of its motion. */
static int stays(reference *t, cairn_real deviation)
{
    cairn_real motion = length_of(t->by_odometry[t->stretch_scans - 1]);

    t->off[t->off_count] = deviation;
    if (t->off_count == 0 || cairn_abs(deviation - t->off[t->off_count - 1]) >
                                 CAIRN_REAL(0.02) + CAIRN_REAL(0.6) * motion)
        t->still_count = 0;
    return ++t->still_count == 3;
}

/* Whether the match is rejected: the third in a row of those that are off by more than six times
 * the noise and uncertain while the odometry moves, and agree with it on the heading within 0.3 rad;
 * not before the noise is learnt from three stretches. *motion: then by the odometry since both
 * agreed. */
static int is_rejected(reference *t, cairn_pose by_odometry, cairn_pose by_pose, int matched,
                       const cairn_icp_result *best, cairn_pose *motion)
{
    cairn_pose odometry_end, off;
    cairn_real distance = 0, deviation, scale;
    int32_t n = t->stretch_scans++;

    assert_true(n < STRETCH_SCANS);
    t->by_odometry[n] = by_odometry;
    t->by_poses[n] = by_pose;
    if (!matched) {
        t->all_good = 0;
        return 0;
    }
    for (int32_t i = 0; i <= n; i++)
        distance += way_of(t->by_odometry[i]);
    odometry_end = end_of(t->by_odometry, n + 1);
    off = cairn_pose_between(odometry_end, end_of(t->by_poses, n + 1));
    deviation = length_of(off);
    scale = distance > 3 ? distance / 3 : 1;
    if (!(deviation > 6 * t->learnt * scale)) {
        t->off_count = 0;
        if (best->weak_ratio < CAIRN_REAL(0.05)) {
            t->all_good = 0;
        } else if (!t->all_good) {
            agree(t);
        } else if (distance >= 3) {
            learn(t, deviation);
            agree(t);
        }
        return 0;
    }
    if (t->learnt_from < 3 || best->weak_ratio >= CAIRN_REAL(0.15) ||
        cairn_abs(off.theta) >= CAIRN_REAL(0.3) || length_of(by_odometry) <= CAIRN_REAL(0.05) ||
        stays(t, deviation)) {
        agree(t);
        return 0;
    }
    t->all_good = 0;
    if (++t->off_count < 3)
        return 0;
    *motion = cairn_pose_between(end_of(t->by_poses, n), odometry_end);
    memcpy(t->by_poses, t->by_odometry, sizeof t->by_poses);
    t->state.stretches_rejected += t->off_count == 3;
    t->state.matches_rejected++;
    return 1;
}

/* ---- Motion model ---- */

/* The expected next motion: half of the change when the match is a jump; along unobservable
 * directions the decaying velocity estimate. */
static cairn_pose expect(reference *t, cairn_pose motion, cairn_pose measured, cairn_pose predicted,
                         const cairn_icp_result *best)
{
    cairn_pose off = cairn_pose_between(predicted, best->target_query);
    cairn_real s, c, wx, wy, lost;

    if (way_of(off) > CAIRN_REAL(0.1) + CAIRN_REAL(0.2) * way_of(measured) ||
        cairn_abs(off.theta) > CAIRN_REAL(0.08) + CAIRN_REAL(0.2) * cairn_abs(measured.theta)) {
        motion.x = (motion.x + t->motion.x) / 2;
        motion.y = (motion.y + t->motion.y) / 2;
        motion.theta = cairn_wrap_angle(t->motion.theta +
                                        cairn_wrap_angle(motion.theta - t->motion.theta) / 2);
    }
    if (best->weak_ratio >= CAIRN_REAL(0.05)) {
        t->velocity.x += CAIRN_REAL(0.1) * (motion.x - t->velocity.x);
        t->velocity.y += CAIRN_REAL(0.1) * (motion.y - t->velocity.y);
        return motion;
    }
    t->weak_scans++;
    cairn_sincos(cairn_pose_inverse(best->target_query).theta, &s, &c);
    wx = c * best->weak_direction[0] - s * best->weak_direction[1];
    wy = s * best->weak_direction[0] + c * best->weak_direction[1];
    lost = wx * (t->velocity.x - motion.x) + wy * (t->velocity.y - motion.y);
    motion.x += wx * lost;
    motion.y += wy * lost;
    t->velocity.x *= CAIRN_REAL(0.99);
    t->velocity.y *= CAIRN_REAL(0.99);
    return motion;
}

static int counts(const reference *t, const cairn_icp_result *found)
{
    return found->verdict != CAIRN_ICP_TOO_FEW_PAIRS && found->overlap >= t->params.min_overlap &&
           found->sigma < CAIRN_REAL(0.1);
}

static cairn_real quality(const cairn_icp_result *found)
{
    return found->overlap * cairn_exp(-found->sigma / CAIRN_REAL(0.05));
}

/* ---- Keyframes ---- */

/* As stored: without beams, the points of a segment with one direction. */
static void keep_key(reference *t, const cairn_scan_view *view, cairn_pose pose)
{
    reference_key *k = &t->keys[t->state.keyframes++];

    k->view = *view;
    k->view.beams = NULL;
    k->view.beam_count = 0;
    memcpy(k->segments, view->segments, (size_t)view->segment_count * sizeof *k->segments);
    memcpy(k->points, view->points, (size_t)view->point_count * sizeof *k->points);
    if (view->segment_count > 0)
        memcpy(k->first_point, view->first_point,
               (size_t)(view->segment_count + 1) * sizeof *k->first_point);
    for (int32_t p = 0; p < view->point_count; p++)
        k->points[p].direction = cairn_vec2_unit(k->points[p].direction);
    k->view.segments = k->segments;
    k->view.first_point = k->first_point;
    k->view.points = k->points;
    k->pose = pose;
    t->key_points += view->point_count;
    t->map_made = 0;
}

/* The force field over the last keyframes, of which the last `window_free` may move, but never the
 * first. */
static void run_field(reference *t)
{
    int32_t count = 0, points = 0;
    reference_key *window = &t->keys[t->state.keyframes];
    cairn_budget budget = {CAIRN_UNBOUNDED};

    while (count < t->params.window && count < t->state.keyframes &&
           points + (window - 1)->view.point_count <= t->params.max_local_points) {
        window--;
        count++;
        points += window->view.point_count;
    }
    cairn_force_field_clear(t->field);
    for (int32_t i = 0; i < count; i++) {
        assert_ok(
            cairn_force_field_add_scan(t->field, &window[i].view, NULL, window[i].pose, NULL));
        if (i == 0 || i < count - t->params.window_free)
            assert_ok(cairn_force_field_fix(t->field, i, 1));
        t->state.units += 2 + window[i].view.point_count / 2;
    }
    assert_ok(cairn_force_field_step(t->field, &budget));
    t->state.units += CAIRN_UNBOUNDED - budget.left;
    for (int32_t i = 0; i < count; i++)
        window[i].pose = cairn_force_field_pose(t->field, i);
    t->result.map_scan = window[count - 1].pose;
    t->state.potential = cairn_force_field_potential(t->field);
}

/* ---- A scan ---- */

/* Scans without a match are no keyframes: at most 8 of them, or 2 when the odometry has moved by more
 * than 2 m. */
static void count_unmatched(reference *t, int32_t is_unmatched, cairn_pose by_odometry)
{
    int32_t is_counted = is_unmatched && t->key_points > 0;

    t->unmatched = is_counted ? t->unmatched + 1 : 0;
    t->lost_way = is_counted ? t->lost_way + cairn_abs(by_odometry.x) : 0;
    if (t->unmatched > 8 || (t->unmatched > 2 && t->lost_way > 2)) {
        t->unmatched = 0;
        t->lost_way = 0;
    }
}

static void reference_scan(reference *t, const cairn_scan_input *input, const cairn_pose *odometry)
{
    const cairn_mapper_params *p = &t->params;
    cairn_pose last = cairn_pose_identity(), by_odometry = cairn_pose_identity(),
               motion = t->motion;
    cairn_pose alternative = cairn_pose_identity(), away;
    cairn_rigid_motion_pose_prior prior, second;
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_icp_result best, other;
    cairn_scan_view view;
    int32_t is_first = t->state.scans == 0, matched = 0, has_motion, odometry_pose;

    if (!is_first)
        last = cairn_pose_compose(t->keys[t->result.keyframe].pose, t->result.keyframe_scan);
    else if (odometry != NULL)
        last = *odometry;
    has_motion = odometry != NULL && (t->had_odometry || is_first);
    odometry_pose = has_motion && (t->odometry_health > CAIRN_REAL(0.5) || t->off_count >= 3);
    if (has_motion && !is_first)
        by_odometry = cairn_pose_between(t->odometry, *odometry);
    if (odometry_pose) {
        alternative = motion;
        motion = by_odometry;
        motion.x += t->bias.x;
        motion.y += t->bias.y;
    } else if (has_motion) {
        alternative = by_odometry;
    }
    prior = prior_of(t, last, motion, odometry_pose);
    second = prior_of(t, last, alternative, has_motion && !odometry_pose);

    assert_ok(cairn_scan_begin(t->scan, input, NULL));
    assert_ok(cairn_scan_step(t->scan, &budget));
    t->state.units += CAIRN_UNBOUNDED - budget.left;
    view = cairn_scan_read(t->scan);

    memset(&best, 0, sizeof best);
    if (view.point_count > 0 && t->key_points > 0) {
        cairn_real x = prior.mean.x - t->map_at.x, y = prior.mean.y - t->map_at.y;

        if (!t->map_made || x * x + y * y > p->keyframe_distance * p->keyframe_distance)
            make_map(t, prior.mean);
        if (cairn_icp_target_count(t->icp) > 0) {
            best = match(t, &prior);
            matched = counts(t, &best);
            away = cairn_pose_between(motion, alternative);
            /* 5 cm or 0.02 rad apart: the two motions disagree. */
            if (away.x * away.x + away.y * away.y > CAIRN_REAL(0.05) * CAIRN_REAL(0.05) ||
                cairn_abs(away.theta) > CAIRN_REAL(0.02)) {
                other = match(t, &second);
                if (counts(t, &other) &&
                    (!matched || quality(&other) > CAIRN_REAL(1.2) * quality(&best))) {
                    best = other;
                    matched = 1;
                    t->state.odometry_rejected += odometry_pose;
                }
            }
        }
    }
    count_unmatched(t, has_motion && !matched, by_odometry);
    if (!has_motion) {
        agree(t);
    } else if (is_rejected(t, by_odometry,
                           cairn_pose_between(is_first ? prior.mean : last,
                                              matched ? best.target_query : prior.mean),
                           matched, &best, &motion)) {
        matched = 0;
        prior.mean = cairn_pose_compose(last, motion);
    }
    if (!matched)
        t->bias.x = t->bias.y = 0;
    if (matched && !odometry_pose && best.weak_ratio < CAIRN_REAL(0.05)) {
        cairn_real x = CAIRN_REAL(0.3) * best.weak_direction[0],
                   y = CAIRN_REAL(0.3) * best.weak_direction[1];

        best.covariance[0] += x * x;
        best.covariance[1] += x * y;
        best.covariance[3] += x * y;
        best.covariance[4] += y * y;
    }
    if (matched && has_motion) {
        cairn_rigid_motion_pose_prior odometry_prior = prior_of(t, last, by_odometry, 1);

        weigh_odometry(t, &odometry_prior, &best);
    }

    memset(&t->result, 0, sizeof t->result);
    t->result.map_scan = prior.mean;
    if (matched) {
        t->result.verdict = CAIRN_MAPPER_MATCHED;
        t->result.map_scan = best.target_query;
        t->result.overlap = best.overlap;
        memcpy(t->result.covariance, best.covariance, sizeof best.covariance);
    } else if (view.point_count == 0) {
        t->result.verdict = CAIRN_MAPPER_NO_FEATURES;
    } else {
        t->result.verdict = is_first ? CAIRN_MAPPER_FIRST : CAIRN_MAPPER_PREDICTED;
    }
    t->state.predicted += t->result.verdict == CAIRN_MAPPER_NO_FEATURES ||
                          t->result.verdict == CAIRN_MAPPER_PREDICTED;
    t->state.units += 4 + view.point_count / 4 + view.beam_count / 16;
    t->state.scans++;

    away = cairn_pose_between(is_first ? prior.mean : last, t->result.map_scan);
    t->motion = matched ? expect(t, away, motion, prior.mean, &best) : away;
    if (!matched && !odometry_pose)
        t->motion.theta *= CAIRN_REAL(0.5);
    t->had_odometry = odometry != NULL;
    if (odometry != NULL)
        t->odometry = *odometry;
    if (!is_first) {
        away = cairn_pose_between(t->keys[t->state.keyframes - 1].pose, t->result.map_scan);
        t->result.is_keyframe =
            view.point_count > 0 && t->unmatched == 0 &&
            ((t->result.overlap < p->keyframe_min_overlap && t->rest >= 2) ||
             away.x * away.x + away.y * away.y > p->keyframe_distance * p->keyframe_distance ||
             cairn_abs(away.theta) > p->keyframe_angle);
    } else {
        t->result.is_keyframe = 1;
    }
    t->rest = t->result.is_keyframe ? 0 : t->rest + 1;
    if (t->result.is_keyframe)
        keep_key(t, &view, t->result.map_scan);
    t->result.keyframe = t->state.keyframes - 1;
    t->result.keyframe_scan =
        cairn_pose_between(t->keys[t->result.keyframe].pose, t->result.map_scan);
    if (t->result.is_keyframe && p->window > 0 && t->state.keyframes > 1)
        run_field(t);
}

/* ---- The comparison ---- */

#define assert_same(a, b) assert_memory_equal(&(a), &(b), sizeof(a))

static void compare(const cairn_mapper *mapper, const reference *t)
{
    cairn_mapper_result result = cairn_mapper_read(mapper);
    cairn_mapper_state state = cairn_mapper_measure(mapper);
    const cairn_scan_set *keys = cairn_mapper_keyframes(mapper);

    assert_int_equal(result.verdict, t->result.verdict);
    assert_int_equal(result.keyframe, t->result.keyframe);
    assert_same(result.keyframe_scan, t->result.keyframe_scan);
    assert_same(result.map_scan, t->result.map_scan);
    assert_same(result.covariance, t->result.covariance);
    assert_near(result.overlap, t->result.overlap, 0);
    assert_int_equal(result.is_keyframe, t->result.is_keyframe);
    assert_int_equal(state.scans, t->state.scans);
    assert_int_equal(state.predicted, t->state.predicted);
    assert_int_equal(state.odometry_rejected, t->state.odometry_rejected);
    assert_int_equal(state.odometry_contradicted, t->state.odometry_contradicted);
    assert_int_equal(state.matches_rejected, t->state.matches_rejected);
    assert_int_equal(state.stretches_rejected, t->state.stretches_rejected);
    assert_int_equal(state.searched, 0);
    assert_int_equal(state.low_confidence, 0);
    assert_int_equal(state.keyframes, t->state.keyframes);
    assert_int_equal(state.units, t->state.units);
    assert_near(state.potential, t->state.potential, 0);
    assert_int_equal(keys->scan_count, t->state.keyframes);
    for (int32_t k = 0; k < t->state.keyframes; k++) {
        cairn_pose pose = cairn_mapper_keyframe_pose(mapper, k);

        assert_same(pose, t->keys[k].pose);
    }
}

/* Disturbances of odometry and sensor during a drive, one after another and mixed. */
typedef struct troubles {
    /* random error of every step of odometry, up to these */
    cairn_real step_error, turn_error;
    /* every n-th scan, two in a row, has no odometry; 0: never */
    int32_t lost;
    /* every n-th scan has no return; 0: never */
    int32_t blind;
    /* every n-th scan odometry jumps far away; 0: never */
    int32_t jump;
    /* the first scans: 1 without odometry, 2 without a return */
    int32_t bare_start;
    /* from this scan on, FLOOR_SCANS see the floor ahead and nothing else; 0: never */
    int32_t floor;
} troubles;

/* Ranges of the floor as a tilted scanner of 180 degrees sees it: a line ahead. */
static void see_floor(float range[181])
{
    for (int i = 0; i < 181; i++) {
        double angle = (i - 90) * 3.14159265 / 180;

        range[i] = fabs(angle) < 0.8 ? (float)(FLOOR_M / cos(angle)) : NAN;
    }
}

static void side_by_side(cairn_mapper_params *params, sim_scene scene, uint64_t seed, int32_t scans,
                         double every, const troubles *trouble, cairn_mapper_state *measured)
{
    static float nothing[181], floor_ahead[181];
    drive d = start_drive(scene, seed, scans, 0, every);
    cairn_pose odometry_pose = {3, -2, 1};
    cairn_random random;
    cairn_pool pool;
    cairn_mapper *mapper;
    reference t;

    params->loop.max_loops = 0;
    params->search = 0;
    params->max_local_points = 500;
    params->window_units = CAIRN_UNBOUNDED; /* the force field ends before the next scan */
    mapper = new_mapper(&pool, params);
    t = new_reference(params);

    random = cairn_random_seed(seed, 1);
    for (int i = 0; i < 181; i++)
        nothing[i] = NAN;
    see_floor(floor_ahead);
    for (int32_t i = 0; i < scans; i++) {
        cairn_scan_input input = sim_scan_input(&d.scans[i]);
        cairn_budget budget = {CAIRN_UNBOUNDED};
        int32_t has_odometry = !(trouble->lost > 0 && i % trouble->lost >= trouble->lost - 2);

        if (i > 0) {
            cairn_pose step =
                cairn_pose_between(pose_of(d.scans[i - 1].truth), pose_of(d.scans[i].truth));

            step.x += trouble->step_error * cairn_random_uniform(&random, -1, 1);
            step.y += trouble->step_error * cairn_random_uniform(&random, -1, 1);
            step.theta += trouble->turn_error * cairn_random_uniform(&random, -1, 1);
            if (trouble->jump > 0 && i % trouble->jump == trouble->jump - 1)
                step.x += 25;
            odometry_pose = cairn_pose_compose(odometry_pose, step);
        }
        if ((trouble->blind > 0 && i % trouble->blind == trouble->blind - 1) ||
            (trouble->bare_start == 2 && i < 2))
            input.range = nothing;
        if (trouble->floor > 0 && i >= trouble->floor && i < trouble->floor + FLOOR_SCANS)
            input.range = floor_ahead;
        if (trouble->bare_start == 1 && i < 2)
            has_odometry = 0;
        assert_taken(cairn_mapper_add(mapper, &input, has_odometry ? &odometry_pose : NULL, NULL));
        assert_ok(cairn_mapper_step(mapper, &budget));
        reference_scan(&t, &input, has_odometry ? &odometry_pose : NULL);
        compare(mapper, &t);
    }
    *measured = t.state;
    free_reference(&t);
    test_pool_free(&pool);
    end_drive(&d);
}

static void as_the_reference_on_a_calm_drive(void **state)
{
    static const troubles calm = {CAIRN_REAL(0.02), CAIRN_REAL(0.01), 0, 0, 0, 0, 0};
    cairn_mapper_params params = small_params();
    cairn_mapper_state measured;

    (void)state;
    side_by_side(&params, SIM_APARTMENT, 3, 60, 0.4, &calm, &measured);
    assert_int_equal(measured.predicted, 0);
    assert_true(measured.keyframes > 20);
}

/* Few keyframes for the local map, some of them beyond the radius; short windows, or none. */
static void as_the_reference_with_small_maps(void **state)
{
    static const troubles calm = {CAIRN_REAL(0.05), CAIRN_REAL(0.02), 0, 0, 0, 0, 0};
    cairn_mapper_params params = small_params();
    cairn_mapper_state measured;

    (void)state;
    params.keyframe_distance = CAIRN_REAL(0.3);
    params.keyframe_angle = CAIRN_REAL(0.35);
    params.local_keyframes = 5;
    params.local_recent = 2;
    params.local_span = 12;
    params.local_radius = CAIRN_REAL(0.8);
    params.window = 4;
    params.window_free = 3;
    side_by_side(&params, SIM_APARTMENT, 5, 70, 0.15, &calm, &measured);
    assert_true(measured.keyframes > 20);
    params.window = 0;
    side_by_side(&params, SIM_APARTMENT, 6, 70, 0.15, &calm, &measured);
    assert_true(measured.keyframes > 20);
}

static void as_the_reference_when_odometry_fails(void **state)
{
    static const troubles lost = {CAIRN_REAL(0.08), CAIRN_REAL(0.04), 9, 11, 0, 0, 0},
                          jumps = {CAIRN_REAL(0.3), CAIRN_REAL(0.3), 0, 0, 13, 0, 0};
    static const troubles bare = {CAIRN_REAL(0.1), CAIRN_REAL(0.05), 7, 0, 0, 1, 0},
                          dark = {CAIRN_REAL(0.1), CAIRN_REAL(0.05), 0, 5, 0, 2, 0};
    cairn_mapper_params params = small_params();
    cairn_mapper_state measured;

    (void)state;
    side_by_side(&params, SIM_APARTMENT, 7, 60, 0.2, &lost, &measured);
    assert_true(measured.predicted >= 5);
    side_by_side(&params, SIM_APARTMENT, 18, 60, 0.3, &jumps, &measured);
    assert_true(measured.odometry_rejected > 0);
    assert_true(measured.odometry_contradicted > 10);
    side_by_side(&params, SIM_RESCUE, 9, 40, 0.3, &bare, &measured);
    assert_true(measured.keyframes > 10);
    side_by_side(&params, SIM_RESCUE, 10, 30, 0.3, &dark, &measured);
    assert_true(measured.predicted >= 6);
}

static void as_the_reference_where_the_floor_is_ahead(void **state)
{
    static const troubles tilted = {CAIRN_REAL(0.01), CAIRN_REAL(0.002), 0, 0, 0, 0, 100};
    cairn_mapper_params params = small_params();
    cairn_mapper_state measured;

    (void)state;
    side_by_side(&params, SIM_OFFICE, 1, 125, 0.3, &tilted, &measured);
    assert_true(measured.matches_rejected > 2);
    assert_true(measured.stretches_rejected > 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(as_the_reference_on_a_calm_drive),
        cmocka_unit_test(as_the_reference_with_small_maps),
        cmocka_unit_test(as_the_reference_when_odometry_fails),
        cmocka_unit_test(as_the_reference_where_the_floor_is_ahead),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
