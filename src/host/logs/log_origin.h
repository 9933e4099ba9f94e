/* log_origin: the origin of a log's coordinates. Where its first pose is far from 0, as in
 * coordinates of a national grid, poses are taken from there, in double, so that they keep their
 * digits in float. Internal to the host library. */
#ifndef CAIRN_HOST_LOG_ORIGIN_H
#define CAIRN_HOST_LOG_ORIGIN_H

#include <math.h>
#include <stdint.h>

#include "cairn/geometry.h"

/* m: a first pose beyond this is far. */
#define LOG_ORIGIN_FAR 1e5

/* Sets the origin by the first pose of a log: whole metres. */
static inline void log_origin_set(double origin[2], const double pose[2])
{
    int32_t far = fabs(pose[0]) > LOG_ORIGIN_FAR || fabs(pose[1]) > LOG_ORIGIN_FAR;

    for (int32_t k = 0; k < 2; k++)
        origin[k] = far ? rint(pose[k]) : 0;
}

/* Takes a pose from the origin. */
static inline void log_origin_take(const double origin[2], double pose[2])
{
    for (int32_t k = 0; k < 2; k++)
        pose[k] -= origin[k];
}

/* A pose of a log as the library has poses: its heading is wrapped. */
static inline cairn_pose log_origin_pose(const double pose[3])
{
    cairn_pose wrapped = {(cairn_real)pose[0], (cairn_real)pose[1], (cairn_real)pose[2]};

    wrapped.theta = cairn_wrap_angle(wrapped.theta);
    return wrapped;
}

#endif
