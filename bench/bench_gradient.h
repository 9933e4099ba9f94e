/* Force field simulation as in the thesis, on simulated scans. */
#ifndef CAIRN_BENCH_GRADIENT_H
#define CAIRN_BENCH_GRADIENT_H

#include "bench/bench_chain.h"

/* At most `iterations`, or as many after each scan with online: then the scans are added one by
 * one, and all scans added so far are aligned before the next one (section 7.3.6). run->rising:
 * number of iterations that increased P(g), both at the iteration's sigma and without regions of
 * interest; 0 with online. chain: with online, the scans are added place by place at the poses
 * matched by it; NULL: one by one, at their start. poses: the start, then the result. 0 on failure,
 * with a line on standard error. */
int bench_run_gradient(const sim_scan *scans, int32_t count, int32_t iterations, int32_t online,
                       bench_chain *chain, bench_pose *poses, bench_run *run);

#endif
