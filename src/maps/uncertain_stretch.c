/* uncertain_stretch: stretches of a drive whose motion no match determines. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/uncertain_stretch.h"

/* m, rad: greatest standard deviation of a certain match; below those of a match of low confidence */
static const cairn_real MAX_CERTAIN_SIGMA_M = CAIRN_REAL(0.2),
                        MAX_CERTAIN_SIGMA_RAD = CAIRN_REAL(0.1);
/* m, rad: a stretch of less is not reported */
static const cairn_real MIN_LENGTH_M = 1, MIN_TURN_RAD = CAIRN_PI / 6;

/* certain scans within a stretch */
enum { MAX_CERTAIN_SCANS = 2 };

/* Returns 1 when a match determines all of the pose; 0 without a match. */
static int is_certain(const cairn_real covariance[9])
{
    cairn_vec2 half = {(covariance[0] - covariance[4]) / 2, covariance[1]};
    cairn_real greatest = (covariance[0] + covariance[4]) / 2 + cairn_vec2_norm(half);

    return greatest <= MAX_CERTAIN_SIGMA_M * MAX_CERTAIN_SIGMA_M &&
           covariance[8] <= MAX_CERTAIN_SIGMA_RAD * MAX_CERTAIN_SIGMA_RAD;
}

int32_t cairn_uncertain_stretch_end(cairn_uncertain_drive *drive, cairn_uncertain_stretch *ended)
{
    int is_short = drive->current.length < MIN_LENGTH_M && drive->current.turn < MIN_TURN_RAD,
        is_reported = drive->is_uncertain && !is_short;

    if (is_reported)
        *ended = drive->current;
    drive->is_uncertain = 0;
    return is_reported;
}

int32_t cairn_uncertain_stretch_add(cairn_uncertain_drive *drive, const cairn_real covariance[9],
                                    cairn_pose motion, cairn_uncertain_stretch *ended)
{
    cairn_uncertain_stretch *current = &drive->current;
    int32_t scan = drive->scans, is_reported = 0;
    cairn_vec2 way = {motion.x, motion.y};

    drive->scans += scan < INT32_MAX;
    if (scan == 0)
        return 0;
    if (scan - current->last > MAX_CERTAIN_SCANS + 1)
        is_reported = cairn_uncertain_stretch_end(drive, ended);
    if (is_certain(covariance))
        return is_reported;
    if (!drive->is_uncertain) {
        memset(current, 0, sizeof *current);
        current->first = scan;
        drive->is_uncertain = 1;
    }
    current->last = scan;
    current->unmatched += !cairn_is_finite(covariance[0]);
    current->length += cairn_vec2_norm(way);
    current->turn += cairn_abs(motion.theta);
    return is_reported;
}
