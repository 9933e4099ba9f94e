/* bench_sweep: generated shapes swept by discs along curves, with known axes and radii. */
#ifndef CAIRN_BENCH_SWEEP_H
#define CAIRN_BENCH_SWEEP_H

#include "bench/bench_scene.h"

enum { SWEEP_FAMILIES = 5, SWEEP_LIMBS = 6, SWEEP_NODES = 40 };

typedef struct sweep_node {
    double x, y, r;
} sweep_node;

/* In a square from -0.5 to 0.5. */
typedef struct sweep_shape {
    sweep_node nodes[SWEEP_LIMBS][SWEEP_NODES];
    int32_t limbs;
    int32_t ends; /* of its axis */
} sweep_shape;

const char *sweep_family_name(int32_t family);

/* A random member of a family: bent rods, waves, clubs, forks, figures with four limbs. */
sweep_shape sweep_draw(int32_t family, cairn_random *random);

/* 1: a place is within; `shape` is a sweep_shape. */
int sweep_contains(const void *shape, double x, double y);

#endif
