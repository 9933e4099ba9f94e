/* Polylines by their arc length.
 *
 * Method: one walk along the sides. A sample's place is its share of the whole length, not the sum
 * of steps, so that the last one of an open curve does not drift off its end.
 *
 * Limits: the length is summed in order; on curves of very many tiny sides samples are even to
 * within its rounding. */
#include "src/core/build.h"

#include "cairn/curve.h"

enum { MAX_SAMPLES = 1 << 24 };

static int32_t side_count(const cairn_curve *curve)
{
    return curve->closed ? curve->count : curve->count - 1;
}

static cairn_segment side_of(const cairn_curve *curve, int32_t i)
{
    cairn_segment side = {curve->points[i], curve->points[i + 1 < curve->count ? i + 1 : 0]};

    return side;
}

static int is_finite(const cairn_curve *curve)
{
    for (int32_t i = 0; i < curve->count; i++)
        if (!cairn_is_finite(curve->points[i].x) || !cairn_is_finite(curve->points[i].y))
            return 0;
    return 1;
}

static int is_good(const cairn_curve *curve)
{
    return curve != NULL && curve->points != NULL && curve->count >= 1;
}

cairn_real cairn_curve_length(const cairn_curve *curve)
{
    cairn_real length = 0;

    for (int32_t i = 0; i < side_count(curve); i++)
        length += cairn_segment_length(side_of(curve, i));
    return length;
}

cairn_status cairn_curve_resample(const cairn_curve *curve, cairn_vec2 *samples,
                                  cairn_vec2 *directions, int32_t count)
{
    cairn_real whole, before = 0, own;
    int32_t side = 0, parts;

    if (!is_good(curve) || samples == NULL || count < (curve->closed ? 1 : 2) ||
        count > MAX_SAMPLES)
        return CAIRN_BAD_ARGUMENT;
    if (!is_finite(curve))
        return CAIRN_NOT_FINITE;
    whole = cairn_curve_length(curve);
    if (!cairn_is_finite(whole))
        return CAIRN_NOT_FINITE;
    if (whole == 0)
        return CAIRN_EMPTY;
    parts = curve->closed ? count : count - 1;
    own = cairn_segment_length(side_of(curve, 0));
    for (int32_t i = 0; i < count; i++) {
        cairn_real place = whole * ((cairn_real)i / (cairn_real)parts);
        cairn_segment s;
        cairn_vec2 along;

        /* Sides without length are passed over, but for those behind the end. */
        while (side + 1 < side_count(curve) && place >= before + own) {
            before += own;
            own = cairn_segment_length(side_of(curve, ++side));
        }
        s = side_of(curve, side);
        along = cairn_vec2_sub(s.b, s.a);
        samples[i] =
            own > 0
                ? cairn_vec2_add(s.a, cairn_vec2_scale(along, cairn_min((place - before) / own, 1)))
                : s.a;
        if (directions != NULL)
            directions[i] = own > 0 || i == 0 ? cairn_vec2_unit(along) : directions[i - 1];
    }
    return CAIRN_OK;
}

/* Vertex i of a closed curve, from -count to 2 count - 1; of an open one that or the end that it
 * lies beyond. */
static cairn_vec2 vertex_at(const cairn_curve *curve, int32_t i)
{
    if (curve->closed)
        return curve->points[i < 0 ? i + curve->count : i >= curve->count ? i - curve->count : i];
    return curve->points[i < 0 ? 0 : i >= curve->count ? curve->count - 1 : i];
}

cairn_status cairn_curve_tangents(const cairn_curve *curve, int32_t reach, cairn_vec2 *directions)
{
    cairn_vec2 last = {1, 0};

    if (!is_good(curve) || directions == NULL || reach < 1 ||
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
