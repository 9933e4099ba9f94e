/* geometry: vectors, poses in SE(2), segments, boxes and polygons in the plane.
 *
 * Metres and radians, counter-clockwise. A pose that maps b into a is called a_b (map_scan maps
 * scan points into the map). Small values are passed by value. */
#ifndef CAIRN_GEOMETRY_H
#define CAIRN_GEOMETRY_H

#include "cairn/real.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_vec2 {
    cairn_real x, y;
} cairn_vec2;

/* Position and heading. theta is wrapped to (-pi, pi] by all functions that return a pose. */
typedef struct cairn_pose {
    cairn_real x, y, theta;
} cairn_pose;

/* A pose with its sine and cosine at hand, for mapping many points. */
typedef struct cairn_transform {
    cairn_real x, y, cosine, sine;
} cairn_transform;

typedef struct cairn_segment {
    cairn_vec2 a, b;
} cairn_segment;

/* Axis-aligned, closed. Empty when min > max. */
typedef struct cairn_box {
    cairn_vec2 min, max;
} cairn_box;

/* A point of a curve with the unit direction of the curve there. On scans the direction runs
 * counter-clockwise as the sensor sees it, so that the free side is on the left. */
typedef struct cairn_oriented_point {
    cairn_vec2 position;
    cairn_vec2 direction;
} cairn_oriented_point;

static inline cairn_vec2 cairn_vec2_add(cairn_vec2 a, cairn_vec2 b)
{
    cairn_vec2 sum = {a.x + b.x, a.y + b.y};
    return sum;
}

static inline cairn_vec2 cairn_vec2_sub(cairn_vec2 a, cairn_vec2 b)
{
    cairn_vec2 difference = {a.x - b.x, a.y - b.y};
    return difference;
}

static inline cairn_vec2 cairn_vec2_scale(cairn_vec2 a, cairn_real s)
{
    cairn_vec2 scaled = {a.x * s, a.y * s};
    return scaled;
}

static inline cairn_real cairn_vec2_dot(cairn_vec2 a, cairn_vec2 b)
{
    return a.x * b.x + a.y * b.y;
}

/* z component of the cross product: positive when b is to the left of a. */
static inline cairn_real cairn_vec2_cross(cairn_vec2 a, cairn_vec2 b)
{
    return a.x * b.y - a.y * b.x;
}

/* a turned by +90 degrees. */
static inline cairn_vec2 cairn_vec2_left(cairn_vec2 a)
{
    cairn_vec2 left = {-a.y, a.x};
    return left;
}

static inline cairn_real cairn_vec2_norm_squared(cairn_vec2 a)
{
    return a.x * a.x + a.y * a.y;
}

static inline cairn_real cairn_vec2_norm(cairn_vec2 a)
{
    return cairn_sqrt(a.x * a.x + a.y * a.y);
}

/* a scaled to length 1; a zero vector stays zero. */
cairn_vec2 cairn_vec2_unit(cairn_vec2 a);

static inline cairn_transform cairn_transform_of(cairn_pose pose)
{
    cairn_transform t = {pose.x, pose.y, 1, 0};

    cairn_sincos(pose.theta, &t.sine, &t.cosine);
    return t;
}

/* Maps a point: rotates, then shifts. */
static inline cairn_vec2 cairn_transform_point(cairn_transform t, cairn_vec2 p)
{
    cairn_vec2 mapped = {t.cosine * p.x - t.sine * p.y + t.x, t.sine * p.x + t.cosine * p.y + t.y};
    return mapped;
}

/* Maps a direction: rotates only. */
static inline cairn_vec2 cairn_transform_direction(cairn_transform t, cairn_vec2 d)
{
    cairn_vec2 mapped = {t.cosine * d.x - t.sine * d.y, t.sine * d.x + t.cosine * d.y};
    return mapped;
}

static inline cairn_pose cairn_pose_identity(void)
{
    cairn_pose identity = {0, 0, 0};
    return identity;
}

/* a_c from a_b and b_c. */
cairn_pose cairn_pose_compose(cairn_pose a_b, cairn_pose b_c);

/* b_a from a_b. */
cairn_pose cairn_pose_inverse(cairn_pose a_b);

/* b_c from a_b and a_c: the pose c as seen from b. */
cairn_pose cairn_pose_between(cairn_pose a_b, cairn_pose a_c);

cairn_vec2 cairn_pose_point(cairn_pose a_b, cairn_vec2 b_point);

/* 1 when x, y and theta are finite. */
int32_t cairn_pose_is_finite(cairn_pose pose);

/* A motion of constant twist: (velocity, turn) is the logarithm of the pose in SE(2) to which it
 * leads. */
typedef struct cairn_twist {
    cairn_vec2 velocity; /* m, over the whole motion, in the moving frame */
    cairn_real turn;     /* rad, in [-pi, pi) */
} cairn_twist;

/* The twist that leads to a pose, by half a turn at most. */
cairn_twist cairn_twist_of(cairn_pose motion);

/* Where it has led at a fraction of the motion: exp(fraction * twist). A fraction above 1 goes
 * on. */
cairn_pose cairn_twist_at(cairn_twist twist, cairn_real fraction);

/* The motion that brings `from` onto `to` and turns by the angle of (dot, cross). With the
 * centroids of pairs of points, and the sums of the dot and cross products of their offsets from
 * these, the motion of least squares of the pairs, in closed form. */
cairn_pose cairn_pose_about(cairn_vec2 from, cairn_vec2 to, cairn_real dot, cairn_real cross);

/* The motion of least squares that brings from[i] onto to[i] for all i below count with use[i]
 * (NULL: all); a heading counts as a point `ahead` m ahead of the pose's origin, > 0. Identity
 * when there is none. Cost: linear. */
cairn_pose cairn_pose_fit(const cairn_pose *from, const cairn_pose *to, const int32_t *use,
                          int32_t count, cairn_real ahead);

cairn_real cairn_segment_length(cairn_segment segment);

/* The point of the segment nearest to p. *parameter, when not NULL, is its place from a (0) to b
 * (1). A segment without length is its point a. */
cairn_vec2 cairn_segment_nearest(cairn_segment segment, cairn_vec2 p, cairn_real *parameter);

/* Distance from p to the segment, in m. */
cairn_real cairn_segment_distance(cairn_segment segment, cairn_vec2 p);

/* 1 and *point set when the lines through two segments meet; 0 when they are parallel (their
 * sine is below 1e-6) or one of them has no length. */
int32_t cairn_line_intersection(cairn_segment first, cairn_segment second, cairn_vec2 *point);

/* 1 when the closed segments share a point. */
int32_t cairn_segments_cross(cairn_segment first, cairn_segment second);

cairn_box cairn_box_empty(void);
cairn_box cairn_box_extend(cairn_box box, cairn_vec2 p);
cairn_box cairn_box_grow(cairn_box box, cairn_real by);
int32_t cairn_box_overlap(cairn_box a, cairn_box b);

/* Signed area, positive when the vertices run counter-clockwise. vertices: [count]. */
cairn_real cairn_polygon_area(const cairn_vec2 *vertices, int32_t count);

/* 1 when p is inside by the even-odd rule. Points on the border are inside or outside, but in
 * exactly one of two polygons that share that border. vertices: [count]. */
int32_t cairn_polygon_contains(const cairn_vec2 *vertices, int32_t count, cairn_vec2 p);

#ifdef __cplusplus
}
#endif

#endif
