/* Matches of the pairs of scans. */
#include "src/base/build.h"

#include "src/base/step.h"
#include "src/calibration/scanner_check_work.h"

enum { BEAMS_PER_UNIT = 4, POINTS_PER_UNIT = 4, UNITS_PER_SCAN = 8, UNITS_PER_RESULT = 2 };

/* A second hypothesis with more than this share of the first one's score makes it ambiguous. */
static const cairn_real COMPETING_SCORE = CAIRN_REAL(0.9);
/* s: velocities are those between scans that are not farther apart. */
static const cairn_real LONGEST_STEP_S = 1;

/* ---- Velocities ---- */

/* Returns the motion of the sensor that a motion of the robot is. */
static cairn_pose sensor_motion(cairn_pose base_sensor, cairn_pose robot)
{
    return cairn_pose_compose(cairn_pose_inverse(base_sensor),
                              cairn_pose_compose(robot, base_sensor));
}

static cairn_twist velocity_of(cairn_pose motion, cairn_real seconds)
{
    cairn_twist still = {{0, 0}, 0}, twist;

    if (!(seconds > 0 && seconds <= LONGEST_STEP_S))
        return still;
    twist = cairn_twist_log(motion);
    twist.linear = cairn_vec2_scale(twist.linear, 1 / seconds);
    twist.angular /= seconds;
    return twist;
}

/* Returns the velocity of the sensor at a scan of the pair in work: by the odometry to the next
 * scan, without odometry by the last match of the pair. 0: not known. */
static cairn_twist velocity_at(const cairn_scanner_check *check, int32_t scan)
{
    const scanner_check_pair *pair = &check->pairs[check->matching.pair];
    int32_t from = scan + 1 < check->drive.count ? scan : scan - 1;

    if (!check->drive.has_odometry)
        return velocity_of(pair->is_matched ? cairn_pose_inverse(pair->match)
                                            : cairn_pose_identity(),
                           pair->seconds);
    return velocity_of(sensor_motion(check->drive.scans[from].input.base_sensor,
                                     cairn_scanner_check_motion(check, from, from + 1)),
                       cairn_scanner_check_seconds(check, from, from + 1));
}

/* ---- Scans ---- */

/* Corrects a scan, in the sensor's frame at the first beam, and begins to fit its lines. */
static cairn_status begin_scan(cairn_scanner_check *check, int32_t index)
{
    cairn_scan_input input = check->drive.scans[index].input;

    check->matching.velocity = velocity_at(check, index);
    cairn_scan_correction_apply(&check->correction, &input, check->range, check->angle);
    input.base_sensor = cairn_pose_identity();
    input.motion = cairn_twist_exp(check->matching.velocity, cairn_abs(check->correction.sweep));
    return cairn_scan_begin(check->scan, &input, NULL);
}

/* Prepares a scan of the pair in work. matching.is_prepared 0: it cannot be used. */
static int prepare(cairn_scanner_check *check, int32_t index, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(check->at.scan);
    CAIRN_STEP_CHARGE(check, at.scan, budget,
                      UNITS_PER_SCAN + check->drive.scans[index].input.count / BEAMS_PER_UNIT);
    check->matching.is_prepared = 0;
    if (begin_scan(check, index) == CAIRN_OK) {
        CAIRN_STEP_UNTIL(check->at.scan, (check->matching.status =
                                              cairn_scan_step(check->scan, budget)) != CAIRN_MORE);
        check->matching.view = cairn_scan_read(check->scan);
        check->matching.is_prepared =
            check->matching.status == CAIRN_OK && check->matching.view.point_count > 0;
    }
    CAIRN_STEP_END(check->at.scan);
}

/* Units of the conversion of the scan in work into a part, and of its copy. */
static int32_t part_units(const cairn_scanner_check *check)
{
    return check->matching.view.beam_count / BEAMS_PER_UNIT +
           check->matching.view.point_count / POINTS_PER_UNIT;
}

static void make_part(cairn_scanner_check *check)
{
    check->matching.part = cairn_scan_match_part_of(&check->matching.view);
    check->matching.part.dense = check->dense;
    check->matching.part.dense_count = cairn_scan_match_dense(&check->matching.view, check->dense);
}

/* ---- Matches ---- */

static cairn_status begin_match(cairn_scanner_check *check)
{
    const cairn_scan_match_window window = {SCANNER_CHECK_WINDOW_M, SCANNER_CHECK_WINDOW_RAD};

    return cairn_scan_match_begin(check->match, &check->matching.part, cairn_pose_identity(),
                                  &window, NULL);
}

/* Takes the result when it is not ambiguous. A match along a bare corridor is taken: its covariance
 * says what it does not determine. */
static void take_result(scanner_check_pair *pair, cairn_scan_match_result result)
{
    const cairn_scan_match_hypothesis *best = result.hypotheses;

    if (result.verdict != CAIRN_SCAN_MATCH_FOUND &&
        (result.verdict != CAIRN_SCAN_MATCH_AMBIGUOUS || best->observable_dof == 3 ||
         (result.count > 1 && best[1].score > COMPETING_SCORE * best->score)))
        return;
    pair->match = best->target_query;
    for (int i = 0; i < 9; i++)
        pair->covariance[i] = best->covariance[i];
    pair->is_matched = 1;
}

/* Matches the first scan of the pair in work against the second one; measures the walls of both. */
static int match_pair(cairn_scanner_check *check, cairn_budget *budget)
{
    scanner_check_pair *pair = &check->pairs[check->matching.pair];

    CAIRN_STEP_BEGIN(check->at.pair);
    cairn_scan_match_clear_target(check->match);
    CAIRN_STEP_UNTIL(check->at.pair, prepare(check, pair->second, budget));
    check->matching.has_target = check->matching.is_prepared;
    if (check->matching.has_target) {
        CAIRN_STEP_RUN(check, at.pair, budget, cairn_scanner_check_add_walls);
        CAIRN_STEP_CHARGE(check, at.pair, budget, part_units(check));
        make_part(check);
        check->matching.has_target =
            cairn_scan_match_add_target(check->match, &check->matching.part, cairn_pose_identity(),
                                        NULL) == CAIRN_OK;
    }
    CAIRN_STEP_UNTIL(check->at.pair, prepare(check, pair->first, budget));
    if (check->matching.is_prepared) {
        CAIRN_STEP_CHARGE(check, at.pair, budget, part_units(check));
        make_part(check);
        pair->is_matched = 0;
        if (check->matching.has_target && begin_match(check) == CAIRN_OK) {
            CAIRN_STEP_UNTIL(check->at.pair, (check->matching.status = cairn_scan_match_step(
                                                  check->match, budget)) != CAIRN_MORE);
            CAIRN_STEP_CHARGE(check, at.pair, budget, UNITS_PER_RESULT);
            if (check->matching.status == CAIRN_OK)
                take_result(pair, cairn_scan_match_read(check->match));
        }
        check->matching.velocity = velocity_at(check, pair->first);
        CAIRN_STEP_RUN(check, at.pair, budget, cairn_scanner_check_add_walls);
    }
    CAIRN_STEP_END(check->at.pair);
}

int cairn_scanner_check_match(cairn_scanner_check *check, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(check->at.match);
    check->wall_count = 0;
    check->wall_hits = 0;
    check->measure.rounds++;
    for (check->matching.pair = 0; check->matching.pair < check->pair_count; check->matching.pair++)
        CAIRN_STEP_RUN(check, at.match, budget, match_pair);
    CAIRN_STEP_END(check->at.match);
}
