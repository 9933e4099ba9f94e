/* log_interpolation: poses of odometry between two times. Internal to the host library. */
#ifndef CAIRN_HOST_LOG_INTERPOLATION_H
#define CAIRN_HOST_LOG_INTERPOLATION_H

#include "cairn/geometry.h"
#include "cairn/scan.h"

/* Returns the pose at a time between two poses, of a motion of constant twist. */
static inline cairn_pose log_pose_between(cairn_pose before, int64_t before_ns, cairn_pose after,
                                          int64_t after_ns, int64_t time_ns)
{
    cairn_twist twist = cairn_twist_log(cairn_pose_between(before, after));
    cairn_real fraction = (cairn_real)cairn_time_difference(time_ns, before_ns) /
                          (cairn_real)cairn_time_difference(after_ns, before_ns);

    return cairn_pose_compose(before, cairn_twist_exp(twist, fraction));
}

#endif
