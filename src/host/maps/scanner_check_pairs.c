/* Pairs of scans that are matched. */
#include "src/base/build.h"

#include <math.h>
#include <string.h>

#include "src/host/maps/scanner_check_work.h"

/* m, rad: a pair ends at the first scan after this motion from its first scan. */
static const double PAIR_DISTANCE_M = 0.35;
static const double PAIR_TURN_RAD = 0.2;
/* m, rad: pairs of sparse logs are no farther apart, so that they overlap. */
static const double PAIR_FARTHEST_M = 1.0;
static const double PAIR_WIDEST_RAD = 0.7;
/* ns: pairs of one stop, or across a gap, are left out. */
static const int64_t PAIR_LONGEST_NS = INT64_C(10000000000);

/* Begins the pair of two scans. */
static scanner_check_pair make_pair(const cairn_scan_log *log, int32_t first, int32_t second)
{
    const cairn_carmen_log_record *record = log->scans.record;
    scanner_check_pair pair;

    memset(&pair, 0, sizeof pair);
    pair.first = first;
    pair.second = second;
    pair.block = (int32_t)((int64_t)first * SCANNER_CHECK_BLOCKS / log->scans.count);
    pair.odometry = cairn_pose_between(record[second].robot, record[first].robot);
    pair.seconds =
        (double)cairn_time_difference(record[second].stamp_ns, record[first].stamp_ns) * 1e-9;
    return pair;
}

/* Finds the end of a pair that begins with a scan. Returns 0 at the end of the log. */
static int32_t find_second(const cairn_scan_log *log, int32_t by_odometry, int32_t first)
{
    const cairn_carmen_log_record *record = log->scans.record;
    int32_t second = first + 1;

    for (; by_odometry && second < log->scans.count; second++) {
        cairn_pose motion = cairn_pose_between(record[first].robot, record[second].robot);

        if (hypot((double)motion.x, (double)motion.y) >= PAIR_DISTANCE_M ||
            fabs((double)motion.theta) >= PAIR_TURN_RAD)
            break;
    }
    return second < log->scans.count ? second : 0;
}

static int is_usable(const scanner_check_pair *pair, int32_t by_odometry)
{
    int64_t ns = (int64_t)(fabs(pair->seconds) * 1e9);

    return !by_odometry ||
           (hypot((double)pair->odometry.x, (double)pair->odometry.y) <= PAIR_FARTHEST_M &&
            fabs((double)pair->odometry.theta) <= PAIR_WIDEST_RAD && ns <= PAIR_LONGEST_NS);
}

/* Walks over all pairs; writes every pair whose share of the total falls to it. pair NULL: only
 * counts. */
static int32_t walk(const cairn_scan_log *log, int32_t by_odometry, int32_t total,
                    scanner_check_pair *pair)
{
    int32_t count = 0, written = 0;

    for (int32_t first = 0, second; first + 1 < log->scans.count; first = second) {
        scanner_check_pair candidate;

        second = find_second(log, by_odometry, first);
        if (second == 0)
            break;
        candidate = make_pair(log, first, second);
        if (!is_usable(&candidate, by_odometry))
            continue;
        if (pair != NULL &&
            (total <= CAIRN_SCANNER_CHECK_PAIRS ||
             (int64_t)count * CAIRN_SCANNER_CHECK_PAIRS / total >= written) &&
            written < CAIRN_SCANNER_CHECK_PAIRS)
            pair[written++] = candidate;
        count++;
    }
    return pair != NULL ? written : count;
}

int32_t cairn_scanner_check_choose(const cairn_scan_log *log, int32_t by_odometry,
                                   scanner_check_pair pair[CAIRN_SCANNER_CHECK_PAIRS])
{
    int32_t total = walk(log, by_odometry, 0, NULL);

    return walk(log, by_odometry, total, pair);
}
