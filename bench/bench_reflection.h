/* The best mirror axes of a silhouette by exhaustive search. */
#ifndef CAIRN_BENCH_REFLECTION_H
#define CAIRN_BENCH_REFLECTION_H

#include "cairn/curve.h"

enum { BENCH_REFLECTIONS = 8 };
/* Axes whose overlap is less than the best one's by up to this are equally good. */
#define BENCH_AS_GOOD 0.02

/* Points p with cos(angle) y - sin(angle) x = offset, in pixels of the outlines. */
typedef struct bench_reflection {
    double angle, offset; /* rad, 0 ... pi */
    double overlap;       /* of the shape and its mirror image: intersection over union */
} bench_reflection;

typedef struct bench_reflections {
    /* [count] best first, those equal to the best, 10 degrees apart */
    bench_reflection axes[BENCH_REFLECTIONS];
    int32_t count;
    /* of the shape's box */
    double diagonal;
} bench_reflections;

/* outlines: the shape's, then those of its holes. 0: memory is insufficient. */
int bench_reflections_find(bench_reflections *found, const cairn_curve *outlines, int32_t count);

/* 1 when the line through two points is within 5 degrees of one of the axes found and, at the
 * shape's middle, within 3 % of the diagonal. */
int bench_reflections_hit(const bench_reflections *found, cairn_vec2 from, cairn_vec2 to,
                          cairn_vec2 middle);

/* Intersection over union of the shape and its mirror image in the line through two points. 0 also
 * when memory is insufficient. */
double bench_reflections_overlap(const cairn_curve *outlines, int32_t count, cairn_vec2 from,
                                 cairn_vec2 to);

#endif
