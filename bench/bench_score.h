/* Errors of estimated poses against ground truth after the best rigid alignment (least squares). */
#ifndef CAIRN_BENCH_SCORE_H
#define CAIRN_BENCH_SCORE_H

#include "sim/arena.h"

/* A pose of the simulation as the library has it, and the other way round. */
static inline cairn_pose bench_cairn_pose(sim_pose pose)
{
    return (cairn_pose){(cairn_real)pose.x, (cairn_real)pose.y, (cairn_real)pose.theta};
}

static inline sim_pose bench_sim_pose(cairn_pose pose)
{
    return (sim_pose){(double)pose.x, (double)pose.y, (double)pose.theta};
}

sim_pose bench_pose_compose(sim_pose a_b, sim_pose b_c);
sim_pose bench_pose_between(sim_pose a_b, sim_pose a_c);

/* Moves estimates[0 ... count-1] by the rigid motion that brings the most of those with use[i]
 * within `metres` and `radians` of the truth, fitted by least squares to these; returns their
 * number. moved: [count], may be estimates. */
int32_t bench_fit_common(const sim_pose *truth, const sim_pose *estimates, const int32_t *use,
                         int32_t count, double metres, double radians, sim_pose *moved);

/* 1 when b is within metres and radians of a. */
int32_t bench_pose_near(sim_pose a, sim_pose b, double metres, double radians);

#endif
