/* Generated shapes with a known axis of symmetry. */
#ifndef CAIRN_BENCH_SHAPES_H
#define CAIRN_BENCH_SHAPES_H

#include "cairn/geometry.h"

enum { BENCH_SHAPE_POINTS = 8192 };

typedef struct bench_shape {
    cairn_vec2 points[BENCH_SHAPE_POINTS]; /* a closed outline in pixels */
    int32_t count;
    double end[2]; /* of the true axis: shares of the outline's length from its first vertex */
} bench_shape;

/* A profile of random widths, narrower at one end, swept along an axis 200 px long that bends by
 * `bend` rad; then sheared along its chord by `skew`; its outline, vertices 4 px apart, has noise
 * of `noise` px across itself; rotated at random. Up to 1.6 times as wide as long. */
void bench_shape_swept(bench_shape *shape, uint64_t seed, double bend, double skew, double noise);

/* A body with a straight axis and two pairs of limbs, each limb rotated at its joint by up to
 * `turn` rad, traced from pixels. The axis is the body's. 0: none in many tries could be traced. */
int bench_shape_articulated(bench_shape *shape, uint64_t seed, double turn);

#endif
