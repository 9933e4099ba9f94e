/* curve: polylines as functions of their arc length: length, even samples, tangents.
 *
 * Points are the vertices of an open or a closed polyline; a closed one runs on from the last to
 * the first. Vertices may coincide. Any unit of length. */
#ifndef CAIRN_CURVE_H
#define CAIRN_CURVE_H

#include "cairn/geometry.h"
#include "cairn/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_curve {
    const cairn_vec2 *points; /* [count] */
    int32_t count;            /* >= 1 */
    int32_t closed;           /* 0 or 1 */
} cairn_curve;

/* Its length; the vertices must be finite. Cost: linear. */
cairn_real cairn_curve_length(const cairn_curve *curve);

/* Lays `count` samples at equal distances along the curve: of an open one from its first to its
 * last vertex, of a closed one from its first vertex round, without coming back to it.
 * directions: [count] unit directions of the side that a sample lies on (of the side behind it
 * at a vertex), NULL when not wanted. CAIRN_BAD_ARGUMENT: NULL, counts below 1 (below 2 samples
 * of an open curve), more than 2^24 samples. CAIRN_NOT_FINITE: a vertex, or the length.
 * CAIRN_EMPTY: the curve has no length. Cost: linear in vertices and samples. */
CAIRN_CHECKED cairn_status cairn_curve_resample(const cairn_curve *curve, cairn_vec2 *samples,
                                                cairn_vec2 *directions, int32_t count);

/* Unit tangents at the vertices: the direction from the vertex `reach` before to that `reach`
 * behind, as far as an open curve goes; at a place where these coincide the tangent of the
 * vertex before, (1, 0) at the first. directions: [curve->count]. CAIRN_BAD_ARGUMENT: NULL, or
 * reach outside 1 ... count - 1, of a closed curve (count - 1) / 2. CAIRN_NOT_FINITE: a vertex.
 * Cost: linear. */
CAIRN_CHECKED cairn_status cairn_curve_tangents(const cairn_curve *curve, int32_t reach,
                                                cairn_vec2 *directions);

#ifdef __cplusplus
}
#endif

#endif
