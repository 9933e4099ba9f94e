/* The shape of an ellipse, and the conic of least squares through oriented points.
 *
 * Method: algebraic least squares in a frame in which the ellipse is about the unit circle, where
 * the algebraic error is twice the distance; that the gradient is across the direction of a point
 * gives a second equation of it, which is what tells the shape of a short arc. A little weight is
 * on the circle, for arcs that tell no axes.
 *
 * Source: Bookstein 1979 for the algebraic fit. */
#include "src/core/build.h"

#include <string.h>

#include "cairn/small_matrix.h"
#include "src/core/ellipse_work.h"

/* of a direction's equation beside that of the place */
static const cairn_real DIRECTION_WEIGHT = CAIRN_REAL(0.1);
/* more than what rounding makes of a distance, over it */
static const cairn_real ROUNDED = CAIRN_REAL(1e-3);
/* of the circle beside a point */
static const cairn_real CIRCLE_WEIGHT = CAIRN_REAL(1e-3);

/* ---- The shape ---- */

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

static cairn_real distance_in(const cairn_ellipse *ellipse, cairn_transform map_ellipse,
                              cairn_vec2 point, cairn_vec2 *normal)
{
    cairn_real a = ellipse->half_length, b = ellipse->half_width, radius, length;
    cairn_vec2 from = {point.x - map_ellipse.x, point.y - map_ellipse.y}, q, gradient = {0, 1};

    q.x = (map_ellipse.cosine * from.x + map_ellipse.sine * from.y) / a;
    q.y = (map_ellipse.cosine * from.y - map_ellipse.sine * from.x) / b;
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
    return distance_in(ellipse, cairn_transform_of(ellipse->centre), point, normal);
}

/* With r from the centre, r / a <= radius <= r / b, and the gradient is 1 / b at most: outside a
 * point is off by b (r / a - 1) at least, inside by b - r. */
cairn_ellipse_gate cairn_ellipse_gate_of(const cairn_ellipse *ellipse, cairn_real distance,
                                         cairn_real sine)
{
    cairn_real a = ellipse->half_length, b = ellipse->half_width;
    cairn_ellipse_gate gate = {*ellipse, cairn_transform_of(ellipse->centre), distance, sine, 0, 0};

    gate.inner = cairn_max(b - distance, 0) * (1 - ROUNDED);
    gate.inner *= gate.inner;
    gate.outer = a * (1 + distance / b) * (1 + ROUNDED);
    gate.outer *= gate.outer;
    return gate;
}

int32_t cairn_ellipse_lets_in(const cairn_ellipse_gate *gate, const cairn_oriented_point *point,
                              cairn_real *off)
{
    cairn_vec2 normal, along;
    cairn_real same;

    *off = distance_in(&gate->ellipse, gate->map_ellipse, point->position, &normal);
    along = cairn_vec2_left(normal);
    same = cairn_vec2_dot(along, point->direction);
    if (gate->ellipse.kind == CAIRN_ELLIPSE_COLUMN)
        same = -same;
    if (gate->ellipse.kind == CAIRN_ELLIPSE_ANY)
        same = cairn_abs(same);
    return cairn_abs(*off) <= gate->distance && same > 0 &&
           cairn_abs(cairn_vec2_cross(along, point->direction)) <= gate->sine;
}

int32_t cairn_ellipse_has(const cairn_ellipse *ellipse, const cairn_oriented_point *point,
                          cairn_real distance, cairn_real sine)
{
    cairn_ellipse_gate gate = cairn_ellipse_gate_of(ellipse, distance, sine);
    cairn_real off;

    return cairn_ellipse_lets_in(&gate, point, &off);
}

/* ---- The conic ---- */

cairn_conic_sums cairn_conic_begin(const cairn_ellipse *about)
{
    cairn_conic_sums sums;

    memset(&sums, 0, sizeof sums);
    sums.origin.x = about->centre.x;
    sums.origin.y = about->centre.y;
    sums.scale = (about->half_length + about->half_width) / 2;
    return sums;
}

static void add_row(cairn_conic_sums *sums, const cairn_real row[ELLIPSE_UNKNOWNS],
                    cairn_real value, cairn_real weight)
{
    for (int i = 0; i < ELLIPSE_UNKNOWNS; i++) {
        for (int k = 0; k <= i; k++)
            sums->matrix[i][k] += weight * row[i] * row[k];
        sums->right[i] += weight * row[i] * value;
    }
}

void cairn_conic_add(cairn_conic_sums *sums, const cairn_oriented_point *point, cairn_real weight)
{
    cairn_vec2 d = point->direction;
    cairn_real u = (point->position.x - sums->origin.x) / sums->scale;
    cairn_real v = (point->position.y - sums->origin.y) / sums->scale;
    const cairn_real place[ELLIPSE_UNKNOWNS] = {u * u, u * v, v * v, u, v};
    const cairn_real across[ELLIPSE_UNKNOWNS] = {2 * u * d.x, u * d.y + v * d.x, 2 * v * d.y, d.x,
                                                 d.y};

    add_row(sums, place, 1, weight);
    add_row(sums, across, 0, weight * DIRECTION_WEIGHT);
    sums->weight += weight;
}

/* x of matrix x = right by LDL^T; 0 when the matrix is not positive definite. */
static int solve(const cairn_conic_sums *sums, cairn_real x[ELLIPSE_UNKNOWNS])
{
    cairn_real l[ELLIPSE_UNKNOWNS][ELLIPSE_UNKNOWNS] = {{0}}, d[ELLIPSE_UNKNOWNS] = {0};

    for (int i = 0; i < ELLIPSE_UNKNOWNS; i++) {
        for (int k = 0; k <= i; k++) {
            cairn_real sum = sums->matrix[i][k];

            for (int j = 0; j < k; j++)
                sum -= l[i][j] * l[k][j] * d[j];
            if (k < i)
                l[i][k] = sum / d[k];
            else
                d[i] = sum;
        }
        if (!(d[i] > CAIRN_REAL_EPSILON * sums->matrix[i][i]))
            return 0;
        x[i] = sums->right[i];
        for (int k = 0; k < i; k++)
            x[i] -= l[i][k] * x[k];
    }
    for (int i = ELLIPSE_UNKNOWNS - 1; i >= 0; i--) {
        x[i] /= d[i];
        for (int k = i + 1; k < ELLIPSE_UNKNOWNS; k++)
            x[i] -= l[k][i] * x[k];
    }
    return 1;
}

int32_t cairn_conic_solve(const cairn_conic_sums *sums, cairn_ellipse *ellipse)
{
    static const cairn_real round[ELLIPSE_UNKNOWNS] = {1, 0, -1, 0, 0},
                            straight[ELLIPSE_UNKNOWNS] = {0, 1, 0, 0, 0};
    cairn_conic_sums held = *sums;
    cairn_real x[ELLIPSE_UNKNOWNS], values[2], determinant, level;
    cairn_vec2 minor, major, centre;
    cairn_sym2 shape;

    add_row(&held, round, 0, sums->weight * CIRCLE_WEIGHT);
    add_row(&held, straight, 0, sums->weight * CIRCLE_WEIGHT);
    if (!solve(&held, x))
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
    ellipse->half_length = sums->scale * cairn_sqrt(level / values[0]);
    ellipse->half_width = sums->scale * cairn_sqrt(level / values[1]);
    ellipse->centre.x = sums->origin.x + sums->scale * centre.x;
    ellipse->centre.y = sums->origin.y + sums->scale * centre.y;
    ellipse->centre.theta = cairn_atan2(minor.y, minor.x);
    if (ellipse->centre.theta < 0)
        ellipse->centre.theta += CAIRN_PI;
    if (ellipse->centre.theta >= CAIRN_PI)
        ellipse->centre.theta = 0;
    return 1;
}
