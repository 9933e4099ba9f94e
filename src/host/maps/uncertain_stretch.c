/* uncertain_stretch: stretches of a drive whose motion no match determines. */
#include "src/host/maps/uncertain_stretch.h"

#include <math.h>

#include "src/host/base/degrees.h"

/* m, rad: greatest standard deviation of a certain match; below those of a match of low confidence */
static const double MAX_CERTAIN_SIGMA_M = 0.2, MAX_CERTAIN_SIGMA_RAD = 0.1;
/* m, rad: a stretch of less is not reported */
static const double MIN_LENGTH_M = 1, MIN_TURN_RAD = 30 * CAIRN_DEGREE;

/* certain scans within a stretch */
enum { MAX_CERTAIN_SCANS = 2 };

static int has_match(const cairn_placed_scan *scan)
{
    return !isnan((double)scan->covariance[0]);
}

/* Returns 1 when a match determines all of the pose. */
static int is_certain(const cairn_placed_scan *scan)
{
    double xx = (double)scan->covariance[0], xy = (double)scan->covariance[1],
           yy = (double)scan->covariance[4], heading = (double)scan->covariance[8],
           greatest = (xx + yy) / 2 + hypot((xx - yy) / 2, xy);

    return greatest <= MAX_CERTAIN_SIGMA_M * MAX_CERTAIN_SIGMA_M &&
           heading <= MAX_CERTAIN_SIGMA_RAD * MAX_CERTAIN_SIGMA_RAD;
}

/* Adds an uncertain scan to the stretch. */
static void add_scan(const cairn_placed_scan *scan, int32_t i, cairn_uncertain_stretch *stretch)
{
    cairn_pose motion = cairn_pose_between(scan[i - 1].after, scan[i].after);

    stretch->last = i;
    stretch->unmatched += !has_match(&scan[i]);
    stretch->length += hypot((double)motion.x, (double)motion.y);
    stretch->turn += fabs((double)motion.theta);
}

int32_t cairn_uncertain_stretch_next(const cairn_placed_scan *scan, int32_t count, int32_t *next,
                                     cairn_uncertain_stretch *stretch)
{
    int32_t i = *next > 1 ? *next : 1;

    while (i < count) {
        if (is_certain(&scan[i])) {
            i++;
            continue;
        }
        *stretch = (cairn_uncertain_stretch){.first = i, .last = i};
        for (; i < count && i - stretch->last <= MAX_CERTAIN_SCANS + 1; i++)
            if (!is_certain(&scan[i]))
                add_scan(scan, i, stretch);
        *next = i;
        if (stretch->length >= MIN_LENGTH_M || stretch->turn >= MIN_TURN_RAD)
            return 1;
    }
    return 0;
}
