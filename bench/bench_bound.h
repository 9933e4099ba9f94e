/* The Cramer-Rao bound of scan poses: the lower bound of the pose covariance of any unbiased
 * alignment.
 *
 * In simulation the wall that every beam hit is known. With a beam's end point p, its wall's normal
 * n and offset rho, the signed distance is e = n p - rho; a range error of standard deviation sigma
 * moves it by sigma |cos b|, b the angle between beam and normal. Each beam adds J J^T / (sigma cos
 * b)^2 over its pose and its wall. The walls are marginalised, a uniform prior +-a of each initial
 * pose coordinate adds 3 / a^2, the best observed scan is fixed, and the rest inverted. */
#ifndef CAIRN_BENCH_BOUND_H
#define CAIRN_BENCH_BOUND_H

#include "sim/arena.h"

typedef struct bench_bound {
    double covariance[9]; /* of x, y, theta in the world, row-major; 0 for the scan that is fixed */
    int32_t observable;   /* standard deviations below 5 cm (x and y together) and 1 degree */
} bench_bound;

/* Bounds of scans[0 ... count-1]; prior_m and prior_rad: the disturbance of the start. bounds:
 * [count]. Returns the index of the fixed scan, -1 when memory is insufficient. */
int32_t bench_bound_compute(const sim_arena *arena, const sim_scan *scans, int32_t count,
                            double prior_m, double prior_rad, bench_bound *bounds);

#endif
