/* Polylines parametrized by arc length.
 *
 * Method: one pass along the sides. The arc length of a sample is a fraction of the whole length,
 * not a sum of steps, so the last sample of an open curve coincides with its end.
 *
 * Limits: the length is summed in order; on curves of very many tiny sides the spacing of the
 * samples is uniform only up to the rounding of the sum. */
#include "src/base/build.h"

#include "cairn/curve.h"

extern inline cairn_segment cairn_curve_side(const cairn_curve *curve, int32_t vertex);

enum { MAX_SAMPLES = 1 << 24 };

/* 1 when all vertices are finite. */
static int is_finite(const cairn_curve *curve)
{
    for (int32_t i = 0; i < curve->count; i++)
        if (!cairn_vec2_is_finite(curve->points[i]))
            return 0;
    return 1;
}

/* 1 when the curve has at least one vertex. */
static int is_valid(const cairn_curve *curve)
{
    return curve != NULL && curve->points != NULL && curve->count >= 1;
}

cairn_real cairn_curve_length(const cairn_curve *curve)
{
    cairn_real length = 0;

    for (int32_t i = 0; i < cairn_curve_side_count(curve); i++)
        length += cairn_segment_length(cairn_curve_side(curve, i));
    return length;
}

cairn_status cairn_curve_resample(const cairn_curve *curve, cairn_vec2 *samples,
                                  cairn_vec2 *directions, int32_t count)
{
    cairn_real length, arc_before = 0, side_length;
    int32_t side = 0, intervals;

    if (!is_valid(curve) || samples == NULL || count < (curve->closed ? 1 : 2) ||
        count > MAX_SAMPLES)
        return CAIRN_BAD_ARGUMENT;
    if (!is_finite(curve))
        return CAIRN_NOT_FINITE;
    length = cairn_curve_length(curve);
    if (!cairn_is_finite(length))
        return CAIRN_NOT_FINITE;
    if (length == 0)
        return CAIRN_EMPTY;
    intervals = curve->closed ? count : count - 1;
    side_length = cairn_segment_length(cairn_curve_side(curve, 0));
    for (int32_t i = 0; i < count; i++) {
        cairn_real arc = length * ((cairn_real)i / (cairn_real)intervals);
        cairn_segment segment;
        cairn_vec2 along;

        /* Skips sides of length 0, except at the end. */
        while (side + 1 < cairn_curve_side_count(curve) && arc >= arc_before + side_length) {
            arc_before += side_length;
            side_length = cairn_segment_length(cairn_curve_side(curve, ++side));
        }
        segment = cairn_curve_side(curve, side);
        along = cairn_vec2_sub(segment.b, segment.a);
        samples[i] =
            side_length > 0
                ? cairn_vec2_add(
                      segment.a,
                      cairn_vec2_scale(along, cairn_min((arc - arc_before) / side_length, 1)))
                : segment.a;
        if (directions != NULL)
            directions[i] = side_length > 0 || i == 0 ? cairn_vec2_unit(along) : directions[i - 1];
    }
    return CAIRN_OK;
}

/* Vertex i, for i from -count to 2 count - 1: modulo count on a closed curve, clamped to the ends
 * of an open one. */
static cairn_vec2 vertex_at(const cairn_curve *curve, int32_t i)
{
    if (curve->closed)
        return curve->points[i < 0 ? i + curve->count : i >= curve->count ? i - curve->count : i];
    return curve->points[i < 0 ? 0 : i >= curve->count ? curve->count - 1 : i];
}

cairn_status cairn_curve_tangents(const cairn_curve *curve, int32_t reach, cairn_vec2 *directions)
{
    cairn_vec2 last = {1, 0};

    if (!is_valid(curve) || directions == NULL || reach < 1 ||
        reach > (curve->closed ? (curve->count - 1) / 2 : curve->count - 1))
        return CAIRN_BAD_ARGUMENT;
    if (!is_finite(curve))
        return CAIRN_NOT_FINITE;
    for (int32_t i = 0; i < curve->count; i++) {
        cairn_vec2 chord = cairn_vec2_sub(vertex_at(curve, i + reach), vertex_at(curve, i - reach));

        if (chord.x != 0 || chord.y != 0)
            last = cairn_vec2_unit(chord);
        directions[i] = last;
    }
    return CAIRN_OK;
}
