/* Geometry of an ellipse, and least-squares fitting of a conic to oriented points.
 *
 * Method:
 * 1. Algebraic least squares in a frame in which the ellipse is about the unit circle, where the
 *    algebraic error is twice the distance.
 * 2. Every point gives two equations: the conic passes through the point, and its gradient is
 *    perpendicular to the point's direction. The second one determines the shape of short arcs.
 * 3. Two equations of small weight favour a circle (regularization), for arcs that do not determine
 *    the axes.
 *
 * Source: Bookstein 1979 for the algebraic fit. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/small_matrix.h"
#include "src/shapes/ellipse_work.h"

/* Weight of a point's direction equation relative to its position equation. */
static const cairn_real DIRECTION_WEIGHT = CAIRN_REAL(0.1);
/* Relative margin of the gate for rounding, larger than the rounding of a distance. */
static const cairn_real ROUNDING_MARGIN = CAIRN_REAL(1e-3);
/* Weight of the regularization towards a circle, relative to the weight of the points. */
static const cairn_real CIRCLE_WEIGHT = CAIRN_REAL(1e-3);

/* ---- Geometry ---- */

cairn_oriented_point cairn_ellipse_point(const cairn_ellipse *ellipse, cairn_real angle)
{
    cairn_transform map_ellipse = cairn_transform_of(ellipse->centre);
    cairn_oriented_point point;
    cairn_vec2 at, along;
    cairn_real sine, cosine;

    cairn_sincos(angle, &sine, &cosine);
    at.x = ellipse->half_length * cosine;
    at.y = ellipse->half_width * sine;
    along.x = -ellipse->half_length * sine;
    along.y = ellipse->half_width * cosine;
    if (ellipse->kind == CAIRN_ELLIPSE_COLUMN)
        along = cairn_vec2_scale(along, -1);
    point.position = cairn_transform_point(map_ellipse, at);
    point.direction = cairn_vec2_unit(cairn_transform_direction(map_ellipse, along));
    return point;
}

cairn_real cairn_ellipse_length(const cairn_ellipse *ellipse)
{
    cairn_real a = ellipse->half_length, b = ellipse->half_width;

    return CAIRN_PI * (3 * (a + b) - cairn_sqrt((3 * a + b) * (a + 3 * b)));
}

/* Signed first-order (Sampson) distance of a point from the outline, and the unit normal. */
static cairn_real sampson_distance(const cairn_ellipse *ellipse, cairn_transform map_ellipse,
                                   cairn_vec2 point, cairn_vec2 *normal)
{
    cairn_real a = ellipse->half_length, b = ellipse->half_width, radius, length;
    cairn_vec2 from = {point.x - map_ellipse.x, point.y - map_ellipse.y}, q, gradient = {0, 1};

    q = cairn_transform_inverse_direction(map_ellipse, from);
    q.x /= a;
    q.y /= b;
    radius = cairn_vec2_norm(q);
    if (radius > 0) {
        gradient.x = q.x / (a * radius);
        gradient.y = q.y / (b * radius);
    } else {
        gradient.y = 1 / b;
    }
    length = cairn_vec2_norm(gradient);
    *normal = cairn_transform_direction(map_ellipse, cairn_vec2_scale(gradient, 1 / length));
    return (radius - 1) / length;
}

cairn_real cairn_ellipse_distance(const cairn_ellipse *ellipse, cairn_vec2 point,
                                  cairn_vec2 *normal)
{
    return sampson_distance(ellipse, cairn_transform_of(ellipse->centre), point, normal);
}

/* Bounds of the distance r from the centre: r / a <= radius <= r / b, and the gradient is at most 1
 * / b. So the distance from the outline is at least b (r / a - 1) outside, and at least b - r
 * inside. */
cairn_ellipse_gate cairn_ellipse_gate_of(const cairn_ellipse *ellipse, cairn_real max_distance,
                                         cairn_real max_sine)
{
    cairn_real a = ellipse->half_length, b = ellipse->half_width;
    cairn_ellipse_gate gate = {
        *ellipse, cairn_transform_of(ellipse->centre), max_distance, max_sine, 0, 0};

    gate.inner_squared = cairn_max(b - max_distance, 0) * (1 - ROUNDING_MARGIN);
    gate.inner_squared *= gate.inner_squared;
    gate.outer_squared = a * (1 + max_distance / b) * (1 + ROUNDING_MARGIN);
    gate.outer_squared *= gate.outer_squared;
    return gate;
}

int32_t cairn_ellipse_gate_passes(const cairn_ellipse_gate *gate, const cairn_oriented_point *point,
                                  cairn_real *distance)
{
    cairn_vec2 normal, along;
    cairn_real cosine;

    *distance = sampson_distance(&gate->ellipse, gate->map_ellipse, point->position, &normal);
    along = cairn_vec2_left_perp(normal);
    cosine = cairn_vec2_dot(along, point->direction);
    if (gate->ellipse.kind == CAIRN_ELLIPSE_COLUMN)
        cosine = -cosine;
    if (gate->ellipse.kind == CAIRN_ELLIPSE_ANY)
        cosine = cairn_abs(cosine);
    return cairn_abs(*distance) <= gate->max_distance && cosine > 0 &&
           cairn_abs(cairn_vec2_cross(along, point->direction)) <= gate->max_sine;
}

int32_t cairn_ellipse_is_inlier(const cairn_ellipse *ellipse, const cairn_oriented_point *point,
                                cairn_real max_distance, cairn_real max_sine)
{
    cairn_ellipse_gate gate = cairn_ellipse_gate_of(ellipse, max_distance, max_sine);
    cairn_real signed_distance;

    return cairn_ellipse_gate_passes(&gate, point, &signed_distance);
}

/* ---- Conic ---- */

ellipse_conic_equations cairn_ellipse_conic_begin(const cairn_ellipse *about)
{
    ellipse_conic_equations equations;

    memset(&equations, 0, sizeof equations);
    equations.origin.x = about->centre.x;
    equations.origin.y = about->centre.y;
    equations.scale = (about->half_length + about->half_width) / 2;
    return equations;
}

/* Adds the equation row . x = value to the normal equations. */
static void add_row(ellipse_conic_equations *equations, const cairn_real row[ELLIPSE_UNKNOWNS],
                    cairn_real value, cairn_real weight)
{
    for (int i = 0; i < ELLIPSE_UNKNOWNS; i++) {
        for (int k = 0; k <= i; k++)
            equations->matrix[i][k] += weight * row[i] * row[k];
        equations->right[i] += weight * row[i] * value;
    }
}

void cairn_ellipse_conic_add(ellipse_conic_equations *equations, const cairn_oriented_point *point,
                             cairn_real weight)
{
    cairn_vec2 d = point->direction;
    cairn_real u = (point->position.x - equations->origin.x) / equations->scale;
    cairn_real v = (point->position.y - equations->origin.y) / equations->scale;
    const cairn_real position_row[ELLIPSE_UNKNOWNS] = {u * u, u * v, v * v, u, v};
    const cairn_real direction_row[ELLIPSE_UNKNOWNS] = {2 * u * d.x, u * d.y + v * d.x, 2 * v * d.y,
                                                        d.x, d.y};

    add_row(equations, position_row, 1, weight);
    add_row(equations, direction_row, 0, weight * DIRECTION_WEIGHT);
    equations->weight += weight;
}

int32_t cairn_ellipse_conic_solve(const ellipse_conic_equations *equations, cairn_ellipse *ellipse)
{
    static const cairn_real equal_axes[ELLIPSE_UNKNOWNS] = {1, 0, -1, 0, 0},
                            no_skew[ELLIPSE_UNKNOWNS] = {0, 1, 0, 0, 0};
    ellipse_conic_equations regularized = *equations;
    cairn_real matrix[ELLIPSE_UNKNOWNS * (ELLIPSE_UNKNOWNS + 1) / 2], x[ELLIPSE_UNKNOWNS],
        values[2], determinant, level;
    cairn_vec2 minor, major, centre;
    cairn_sym2 shape;

    add_row(&regularized, equal_axes, 0, equations->weight * CIRCLE_WEIGHT);
    add_row(&regularized, no_skew, 0, equations->weight * CIRCLE_WEIGHT);
    for (int32_t i = 0; i < ELLIPSE_UNKNOWNS; i++) {
        x[i] = regularized.right[i];
        for (int32_t k = 0; k <= i; k++)
            matrix[cairn_sym_element(i, k)] = regularized.matrix[i][k];
    }
    if (!cairn_sym_solve(matrix, ELLIPSE_UNKNOWNS, CAIRN_REAL_EPSILON, x))
        return 0;
    shape.xx = x[0];
    shape.xy = x[1] / 2;
    shape.yy = x[2];
    cairn_sym2_eigen(shape, values, &minor, &major);
    determinant = shape.xx * shape.yy - shape.xy * shape.xy;
    if (!(values[0] > 0) || !(determinant > 0))
        return 0;
    centre.x = -(shape.yy * x[3] - shape.xy * x[4]) / (2 * determinant);
    centre.y = -(shape.xx * x[4] - shape.xy * x[3]) / (2 * determinant);
    level = 1 - (x[3] * centre.x + x[4] * centre.y) / 2;
    if (!(level > 0))
        return 0;
    ellipse->half_length = equations->scale * cairn_sqrt(level / values[0]);
    ellipse->half_width = equations->scale * cairn_sqrt(level / values[1]);
    ellipse->centre.x = equations->origin.x + equations->scale * centre.x;
    ellipse->centre.y = equations->origin.y + equations->scale * centre.y;
    ellipse->centre.theta = cairn_atan2(minor.y, minor.x);
    if (ellipse->centre.theta < 0)
        ellipse->centre.theta += CAIRN_PI;
    if (ellipse->centre.theta >= CAIRN_PI)
        ellipse->centre.theta = 0;
    return 1;
}
