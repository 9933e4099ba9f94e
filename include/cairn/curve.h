/* curve: polylines parametrized by arc length: length, uniform resampling, tangents.
 *
 * The points are the vertices of an open or a closed polyline. A closed one has a further side from
 * the last vertex to the first. Vertices may coincide. Lengths are in the unit of the points. */
#ifndef CAIRN_CURVE_H
#define CAIRN_CURVE_H

#include "cairn/geometry.h"
#include "cairn/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Polyline. */
typedef struct cairn_curve {
    /* [count] Vertices. */
    const cairn_vec2 *points;
    /* Number of vertices, >= 1. */
    int32_t count;
    /* 1: closed; 0: open. */
    int32_t closed;
} cairn_curve;

/* Number of sides. */
static inline int32_t cairn_curve_side_count(const cairn_curve *curve)
{
    return curve->closed ? curve->count : curve->count - 1;
}

/* Side of a curve, from a vertex to the next one. */
inline cairn_segment cairn_curve_side(const cairn_curve *curve, int32_t vertex)
{
    cairn_segment side;

    side.a = curve->points[vertex];
    side.b = curve->points[vertex + 1 < curve->count ? vertex + 1 : 0];
    return side;
}

/* Arc length of a curve; the vertices must be finite. Cost: linear. */
cairn_real cairn_curve_length(const cairn_curve *curve);

/* Resamples a curve uniformly: `count` samples at equal arc lengths. The samples of an open curve
 * run from the first to the last vertex. Those of a closed curve start at the first vertex, which
 * is not repeated at the end. directions: [count], set to the unit directions of the side of each
 * sample (at a vertex of the following side); may be NULL. CAIRN_BAD_ARGUMENT: NULL, counts below 1
 * (below 2 samples of an open curve), more than 2^24 samples. CAIRN_NOT_FINITE: a vertex, or the
 * length. CAIRN_EMPTY: the length is 0. Cost: linear in vertices and samples.
 *
 * curve: the curve
 * samples: [count] set to the samples */
CAIRN_CHECKED cairn_status cairn_curve_resample(const cairn_curve *curve, cairn_vec2 *samples,
                                                cairn_vec2 *directions, int32_t count);

/* Unit tangents at the vertices, by central differences: the direction from the vertex `reach`
 * vertices before to the vertex `reach` vertices after, clamped to the ends of an open curve. Where
 * both coincide the tangent of the previous vertex is repeated, (1, 0) at the first. directions:
 * [curve->count]. CAIRN_BAD_ARGUMENT: NULL, or reach outside 1 ... count - 1 (closed: (count - 1) /
 * 2). CAIRN_NOT_FINITE: a vertex. Cost: linear.
 *
 * curve: the curve
 * reach: vertices to either side, >= 1 */
CAIRN_CHECKED cairn_status cairn_curve_tangents(const cairn_curve *curve, int32_t reach,
                                                cairn_vec2 *directions);

#ifdef __cplusplus
}
#endif

#endif
