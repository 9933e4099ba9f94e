/* bench_skeleton: accuracy of the axes and contours of skeleton_grouping on a generated scene
 * (bench_scene, bench_sweep). */
#ifndef CAIRN_BENCH_SKELETON_H
#define CAIRN_BENCH_SKELETON_H

#include "bench/bench_sweep.h"
#include "cairn/skeleton_grouping.h"

enum { SKELETON_PLACES = 20000 };

/* A place of an axis or contour, and the radius of its disc, px. */
typedef struct skeleton_place {
    double x, y, r;
} skeleton_place;

typedef struct skeleton_places {
    skeleton_place at[SKELETON_PLACES];
    int32_t count;
} skeleton_places;

skeleton_place skeleton_place_of(const cairn_skeleton_grouping_point *q);

/* Adds places a pixel apart from a to b; those beyond SKELETON_PLACES are left out. */
void skeleton_add_way(skeleton_places *p, skeleton_place a, skeleton_place b);

/* The true axes of a scene's object; the axes of the likeliest detected object, or (all: 1) of all
 * of them, with ends extended to their junctions. */
void skeleton_add_truth(skeleton_places *p, const scene *s, const sweep_shape *shape);
void skeleton_add_found(skeleton_places *p, const cairn_skeleton_grouping_result *r, int all);

/* F measure of the places within 1 % of the scene's diagonal of the others. */
double skeleton_axis_f(const skeleton_places *found, const skeleton_places *truth);

/* Median relative error of the radius, where the axis is right; NaN: nowhere. */
double skeleton_radius_error(const skeleton_places *found, const skeleton_places *truth);

/* Intersection over union of the union of discs with the object. */
double skeleton_discs_iou(const skeleton_places *found, const scene *s);

/* F measure of the contours of the likeliest object, or (all: 1) of all, at 3 px. */
double skeleton_boundary_f(const cairn_skeleton_grouping_result *r, const scene *s, int all);

#endif
