/* Pairs of scans that are matched.
 *
 * Method: the drive is walked over twice: all pairs are counted, then every pair is listed whose
 * share of the total falls to it. */
#include "src/base/build.h"

#include <string.h>

#include "src/base/step.h"
#include "src/calibration/scanner_check_work.h"

enum { UNITS_PER_SCAN = 2, UNITS_PER_PAIR = 2 };

/* m, rad: a pair ends at the first scan after this motion from its first scan. */
static const cairn_real PAIR_DISTANCE_M = CAIRN_REAL(0.35);
static const cairn_real PAIR_TURN_RAD = CAIRN_REAL(0.2);
/* m, rad: pairs of sparse drives are no farther apart, so that they overlap. */
static const cairn_real PAIR_FARTHEST_M = 1;
static const cairn_real PAIR_WIDEST_RAD = CAIRN_REAL(0.7);
/* ns: pairs of one stop, or across a gap, are left out. */
static const int64_t PAIR_LONGEST_NS = INT64_C(10000000000);

cairn_pose cairn_scanner_check_motion(const cairn_scanner_check *check, int32_t from, int32_t to)
{
    return check->drive.has_poses
               ? cairn_pose_between(check->drive.scans[from].robot, check->drive.scans[to].robot)
               : cairn_pose_identity();
}

cairn_real cairn_scanner_check_distance(cairn_pose motion)
{
    return cairn_vec2_norm((cairn_vec2){motion.x, motion.y});
}

cairn_real cairn_scanner_check_seconds(const cairn_scanner_check *check, int32_t from, int32_t to)
{
    return (cairn_real)cairn_time_difference(check->drive.scans[to].input.stamp_ns,
                                             check->drive.scans[from].input.stamp_ns) *
           CAIRN_REAL(1e-9);
}

/* Begins the pair of two scans. */
static scanner_check_pair make_pair(const cairn_scanner_check *check, int32_t first, int32_t second)
{
    scanner_check_pair pair;

    memset(&pair, 0, sizeof pair);
    pair.first = first;
    pair.second = second;
    pair.block = (int32_t)((int64_t)first * SCANNER_CHECK_BLOCKS / check->drive.count);
    pair.odometry = cairn_scanner_check_motion(check, second, first);
    pair.seconds = cairn_scanner_check_seconds(check, first, second);
    return pair;
}

/* 1 when a pair ends at the scan `second`. */
static int is_end(const cairn_scanner_check *check)
{
    cairn_pose motion;

    if (!check->choice.by_odometry)
        return 1;
    motion = cairn_scanner_check_motion(check, check->cursor, check->choice.second);
    return cairn_scanner_check_distance(motion) >= PAIR_DISTANCE_M ||
           cairn_abs(motion.theta) >= PAIR_TURN_RAD;
}

static int is_usable(const cairn_scanner_check *check, const scanner_check_pair *pair)
{
    int64_t ns = cairn_time_difference(check->drive.scans[pair->second].input.stamp_ns,
                                       check->drive.scans[pair->first].input.stamp_ns);

    return !check->choice.by_odometry ||
           (cairn_scanner_check_distance(pair->odometry) <= PAIR_FARTHEST_M &&
            cairn_abs(pair->odometry.theta) <= PAIR_WIDEST_RAD && ns <= PAIR_LONGEST_NS &&
            ns >= -PAIR_LONGEST_NS);
}

/* Counts a pair, and lists it in the second pass when its share falls to it. */
static void take_pair(cairn_scanner_check *check)
{
    scanner_check_pair pair = make_pair(check, check->cursor, check->choice.second);
    int32_t most = check->params.max_pairs;

    if (!is_usable(check, &pair))
        return;
    if (check->choice.pass == 1 && check->pair_count < most &&
        (check->choice.total <= most ||
         (int64_t)check->choice.counted * most / check->choice.total >= check->pair_count))
        check->pairs[check->pair_count++] = pair;
    check->choice.counted++;
}

int cairn_scanner_check_choose(cairn_scanner_check *check, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(check->at.pairs);
    check->pair_count = check->choice.counted = 0;
    for (check->choice.pass = 0; check->choice.pass < 2; check->choice.pass++) {
        check->choice.total = check->choice.counted;
        check->choice.counted = 0;
        for (check->cursor = 0; check->cursor + 1 < check->drive.count;
             check->cursor = check->choice.second) {
            for (check->choice.second = check->cursor + 1;
                 check->choice.second < check->drive.count; check->choice.second++) {
                CAIRN_STEP_CHARGE(check, at.pairs, budget, UNITS_PER_SCAN);
                if (is_end(check))
                    break;
            }
            if (check->choice.second == check->drive.count)
                break;
            CAIRN_STEP_CHARGE(check, at.pairs, budget, UNITS_PER_PAIR);
            take_pair(check);
        }
    }
    CAIRN_STEP_END(check->at.pairs);
}
