/* Shared by tests: random poses, and poses compared. */
#ifndef CAIRN_TESTS_POSES_H
#define CAIRN_TESTS_POSES_H

#include "tests/test.h"

#include "cairn/geometry.h"
#include "cairn/random.h"

/* distance: greatest coordinate, m; angle: greatest heading, rad */
static inline cairn_pose random_pose(cairn_random *random, cairn_real distance, cairn_real angle)
{
    cairn_pose pose;

    pose.x = cairn_random_uniform(random, -distance, distance);
    pose.y = cairn_random_uniform(random, -distance, distance);
    pose.theta = cairn_random_uniform(random, -angle, angle);
    return pose;
}

static inline void assert_pose_near(cairn_pose pose, cairn_pose expected, double distance,
                                    double angle)
{
    assert_near(pose.x, expected.x, distance);
    assert_near(pose.y, expected.y, distance);
    assert_near(cairn_wrap_angle(pose.theta - expected.theta), 0, angle);
}

#endif
