/* Line fitting by orthogonal regression (total least squares), and merging of segments.
 *
 * Method:
 * 1. Weighted centroid. The sums are taken relative to the first point of weight > 0, so points far
 *    from the origin lose no digits.
 * 2. Scatter matrix about the centroid. Its major eigenvector is the direction, its smaller
 *    eigenvalue the weighted sum of squared distances.
 * 3. Extent of the points along the direction.
 *
 * Limits: the squares of all coordinates and of the sum of the weights must be representable. */
#include "src/base/build.h"

#include <stddef.h>

#include "cairn/line.h"
#include "cairn/small_matrix.h"

/* Weight of point i. */
static cairn_real weight_of(const cairn_real *weights, int32_t i)
{
    return weights != NULL ? weights[i] : 1;
}

/* Scatter matrix m plus the outer product of an offset d of a weight. */
static cairn_sym2 scatter_add(cairn_sym2 m, cairn_vec2 d, cairn_real weight)
{
    m.xx += weight * d.x * d.x;
    m.xy += weight * d.x * d.y;
    m.yy += weight * d.y * d.y;
    return m;
}

/* CAIRN_OK when all points and weights are finite and no weight is negative. */
static cairn_status check_points(const cairn_vec2 *points, const cairn_real *weights, int32_t count)
{
    for (int32_t i = 0; i < count; i++) {
        cairn_real weight = weight_of(weights, i);

        if (!cairn_vec2_is_finite(points[i]) || !cairn_is_finite(weight))
            return CAIRN_NOT_FINITE;
        if (weight < 0)
            return CAIRN_BAD_ARGUMENT;
    }
    return CAIRN_OK;
}

cairn_status cairn_line_fit(const cairn_vec2 *points, const cairn_real *weights, int32_t count,
                            cairn_line *line)
{
    cairn_line fit = {.direction = {1, 0}, .low = CAIRN_REAL_MAX, .high = -CAIRN_REAL_MAX};
    cairn_sym2 scatter = {0, 0, 0};
    cairn_vec2 origin = {0, 0}, sum = {0, 0}, minor;
    cairn_real values[2];
    cairn_status status;

    if (points == NULL || line == NULL || count < 2)
        return CAIRN_BAD_ARGUMENT;
    status = check_points(points, weights, count);
    if (status != CAIRN_OK)
        return status;
    for (int32_t i = 0; i < count; i++) {
        cairn_real weight = weight_of(weights, i);

        if (fit.mass == 0 && weight > 0)
            origin = points[i];
        fit.mass += weight;
        sum = cairn_vec2_add(sum, cairn_vec2_scale(cairn_vec2_sub(points[i], origin), weight));
    }
    if (!(fit.mass > 0))
        return CAIRN_EMPTY;
    fit.mean = cairn_vec2_add(origin, cairn_vec2_scale(sum, 1 / fit.mass));
    for (int32_t i = 0; i < count; i++)
        scatter = scatter_add(scatter, cairn_vec2_sub(points[i], fit.mean), weight_of(weights, i));
    cairn_sym2_eigen(scatter, values, &minor, &fit.direction);
    if (fit.direction.x < 0 || (fit.direction.x == 0 && fit.direction.y < 0))
        fit.direction = cairn_vec2_scale(fit.direction, -1);
    for (int32_t i = 0; i < count; i++) {
        cairn_real along = cairn_vec2_dot(fit.direction, cairn_vec2_sub(points[i], fit.mean));

        if (weight_of(weights, i) > 0) {
            fit.low = cairn_min(fit.low, along);
            fit.high = cairn_max(fit.high, along);
        }
    }
    if (!(fit.high > fit.low))
        return CAIRN_EMPTY;
    fit.rms = cairn_sqrt(cairn_max(values[0], 0) / fit.mass);
    *line = fit;
    return CAIRN_OK;
}

cairn_segment cairn_line_segment(const cairn_line *line)
{
    cairn_segment segment = {
        cairn_vec2_add(line->mean, cairn_vec2_scale(line->direction, line->low)),
        cairn_vec2_add(line->mean, cairn_vec2_scale(line->direction, line->high))};
    return segment;
}

/* Adds the scatter of a mass spread uniformly over a segment, about a point: the scatter about the
 * midpoint, plus that of the midpoint (parallel axis theorem). */
static cairn_sym2 segment_scatter(cairn_sym2 m, cairn_segment s, cairn_real mass, cairn_vec2 about)
{
    cairn_vec2 midpoint = cairn_vec2_scale(cairn_vec2_add(s.a, s.b), CAIRN_REAL(0.5));

    m = scatter_add(m, cairn_vec2_sub(s.b, s.a), mass / 12);
    return scatter_add(m, cairn_vec2_sub(midpoint, about), mass);
}

cairn_status cairn_line_merge(cairn_segment first, cairn_real first_mass, cairn_segment second,
                              cairn_real second_mass, cairn_segment *merged)
{
    cairn_segment heavy = second_mass > first_mass ? second : first;
    cairn_vec2 ends[4], mean, minor, axis;
    cairn_sym2 scatter = {0, 0, 0};
    cairn_real values[2], low = CAIRN_REAL_MAX, high = -CAIRN_REAL_MAX, share;

    if (merged == NULL || !(first_mass > 0) || !(second_mass > 0))
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_segment_is_finite(first) || !cairn_segment_is_finite(second) ||
        !cairn_is_finite(first_mass + second_mass))
        return CAIRN_NOT_FINITE;
    ends[0] = first.a;
    ends[1] = first.b;
    ends[2] = second.a;
    ends[3] = second.b;
    share = second_mass / (first_mass + second_mass) / 2;
    mean = first.a;
    mean = cairn_vec2_add(
        mean, cairn_vec2_scale(cairn_vec2_sub(first.b, first.a), CAIRN_REAL(0.5) - share));
    mean = cairn_vec2_add(mean, cairn_vec2_scale(cairn_vec2_sub(second.a, first.a), share));
    mean = cairn_vec2_add(mean, cairn_vec2_scale(cairn_vec2_sub(second.b, first.a), share));
    scatter = segment_scatter(scatter, first, first_mass, mean);
    scatter = segment_scatter(scatter, second, second_mass, mean);
    cairn_sym2_eigen(scatter, values, &minor, &axis);
    if (cairn_vec2_dot(axis, cairn_vec2_sub(heavy.b, heavy.a)) < 0)
        axis = cairn_vec2_scale(axis, -1);
    for (int i = 0; i < 4; i++) {
        cairn_real along = cairn_vec2_dot(axis, cairn_vec2_sub(ends[i], mean));

        low = cairn_min(low, along);
        high = cairn_max(high, along);
    }
    if (!(high > low))
        return CAIRN_EMPTY;
    merged->a = cairn_vec2_add(mean, cairn_vec2_scale(axis, low));
    merged->b = cairn_vec2_add(mean, cairn_vec2_scale(axis, high));
    return CAIRN_OK;
}
