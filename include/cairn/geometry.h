/* geometry: vectors, poses and rigid transforms in SE(2), twists, similarity transforms, oriented
 * points, segments, boxes and polygons in the plane.
 *
 * Units are metres and radians; angles are counter-clockwise. A pose that maps frame b into frame a
 * is called a_b: map_scan maps points of the scan into the map. Small values are passed by
 * value. */
#ifndef CAIRN_GEOMETRY_H
#define CAIRN_GEOMETRY_H

#include "cairn/real.h"
#include "cairn/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Limit of coordinates, in m or px, of weights and of other magnitudes, unless a module says
 * otherwise: no sum of squares overflows in float. */
#define CAIRN_MAX_MAGNITUDE CAIRN_REAL(1e6)

/* Vector or point in the plane, usually in m. */
typedef struct cairn_vec2 {
    /* coordinates */
    cairn_real x, y;
} cairn_vec2;

/* Pose in SE(2): position (x, y) in m and heading theta in rad. All functions that return a pose
 * wrap theta to (-pi, pi], unless their comment says otherwise. */
typedef struct cairn_pose {
    /* position in m and heading in rad */
    cairn_real x, y, theta;
} cairn_pose;

/* Rigid transform: translation (x, y) in m, and cosine and sine of the rotation, computed once for
 * mapping many points. */
typedef struct cairn_transform {
    /* translation in m, cosine and sine of the rotation */
    cairn_real x, y, cosine, sine;
} cairn_transform;

/* Similarity transform: p is mapped to (a p.x - b p.y, b p.x + a p.y) + shift. */
typedef struct cairn_similarity {
    /* scale times the cosine and times the sine of the rotation */
    cairn_real a, b;
    /* translation */
    cairn_vec2 shift;
} cairn_similarity;

/* Line segment from a to b, in m. */
typedef struct cairn_segment {
    /* start and end, m */
    cairn_vec2 a, b;
} cairn_segment;

/* Axis-aligned bounding box, borders included, in m. Empty when min > max in x or in y. */
typedef struct cairn_box {
    /* least and greatest corner, m */
    cairn_vec2 min, max;
} cairn_box;

/* Point of a curve with the tangent of the curve. */
typedef struct cairn_oriented_point {
    /* m */
    cairn_vec2 position;
    /* Unit tangent. On scans the tangent runs counter-clockwise as seen from the sensor, so free
     * space is on its left. */
    cairn_vec2 direction;
} cairn_oriented_point;

/* ---- Vectors ---- */

/* a + b. */
static inline cairn_vec2 cairn_vec2_add(cairn_vec2 a, cairn_vec2 b)
{
    cairn_vec2 sum = {a.x + b.x, a.y + b.y};
    return sum;
}

/* a - b. */
static inline cairn_vec2 cairn_vec2_sub(cairn_vec2 a, cairn_vec2 b)
{
    cairn_vec2 difference = {a.x - b.x, a.y - b.y};
    return difference;
}

/* s a.
 *
 * a: vector
 * s: factor */
static inline cairn_vec2 cairn_vec2_scale(cairn_vec2 a, cairn_real s)
{
    cairn_vec2 scaled = {a.x * s, a.y * s};
    return scaled;
}

/* Dot product.
 *
 * a, b: the vectors */
inline cairn_real cairn_vec2_dot(cairn_vec2 a, cairn_vec2 b)
{
    return a.x * b.x + a.y * b.y;
}

/* Cross product (its z component): positive when b is to the left of a. */
inline cairn_real cairn_vec2_cross(cairn_vec2 a, cairn_vec2 b)
{
    return a.x * b.y - a.y * b.x;
}

/* Left perpendicular vector: a rotated by +90 degrees. */
static inline cairn_vec2 cairn_vec2_left_perp(cairn_vec2 a)
{
    cairn_vec2 left = {-a.y, a.x};
    return left;
}

/* Squared Euclidean norm.
 *
 * a: vector */
static inline cairn_real cairn_vec2_norm_squared(cairn_vec2 a)
{
    return a.x * a.x + a.y * a.y;
}

/* Euclidean norm.
 *
 * a: vector */
static inline cairn_real cairn_vec2_norm(cairn_vec2 a)
{
    return cairn_sqrt(a.x * a.x + a.y * a.y);
}

/* Signed angle from a to b, in rad, in (-pi, pi]: positive when b is to the left of a.
 *
 * a, b: the vectors */
inline cairn_real cairn_vec2_angle(cairn_vec2 a, cairn_vec2 b)
{
    return cairn_atan2(cairn_vec2_cross(a, b), cairn_vec2_dot(a, b));
}

/* Linear interpolation: the point at a share of the way from a to b.
 *
 * a, b: the points
 * share: 0 at a, 1 at b, any */
static inline cairn_vec2 cairn_vec2_interpolate(cairn_vec2 a, cairn_vec2 b, cairn_real share)
{
    return cairn_vec2_add(a, cairn_vec2_scale(cairn_vec2_sub(b, a), share));
}

/* 1 when x and y are finite.
 *
 * a: vector */
inline int32_t cairn_vec2_is_finite(cairn_vec2 a)
{
    return cairn_is_finite(a.x) && cairn_is_finite(a.y);
}

/* 1 when neither coordinate exceeds a bound; 0 also for NaN.
 *
 * a: vector
 * bound: largest absolute value */
inline int32_t cairn_vec2_is_within(cairn_vec2 a, cairn_real bound)
{
    return cairn_abs(a.x) <= bound && cairn_abs(a.y) <= bound;
}

/* Unit vector: a normalized to length 1. A zero vector stays zero. */
cairn_vec2 cairn_vec2_unit(cairn_vec2 a);

/* ---- Poses and rigid transforms ---- */

/* The rigid transform of a pose. */
cairn_transform cairn_transform_of(cairn_pose pose);

/* Transforms a point: rotation, then translation.
 *
 * t: rigid transform
 * p: point, m */
inline cairn_vec2 cairn_transform_point(cairn_transform t, cairn_vec2 p)
{
    cairn_vec2 mapped = {t.cosine * p.x - t.sine * p.y + t.x, t.sine * p.x + t.cosine * p.y + t.y};
    return mapped;
}

/* Transforms a direction: rotation only.
 *
 * t: rigid transform
 * d: direction, of any length */
static inline cairn_vec2 cairn_transform_direction(cairn_transform t, cairn_vec2 d)
{
    cairn_vec2 mapped = {t.cosine * d.x - t.sine * d.y, t.sine * d.x + t.cosine * d.y};
    return mapped;
}

/* Transforms a direction by the inverse: the rotation back only.
 *
 * t: rigid transform
 * d: direction, of any length */
static inline cairn_vec2 cairn_transform_inverse_direction(cairn_transform t, cairn_vec2 d)
{
    cairn_vec2 mapped = {t.cosine * d.x + t.sine * d.y, t.cosine * d.y - t.sine * d.x};
    return mapped;
}

/* Rigid transform with a given rotation that maps one point to another.
 *
 * cosine, sine: of the rotation
 * from, to: the point and where it is mapped to, m */
cairn_transform cairn_transform_mapping(cairn_real cosine, cairn_real sine, cairn_vec2 from,
                                        cairn_vec2 to);

/* Composition of two rigid transforms: a_c from a_b and b_c. Rounding errors of cosine and sine add
 * up in long products. */
cairn_transform cairn_transform_compose(cairn_transform a_b, cairn_transform b_c);

/* Inverse rigid transform: b_a from a_b. */
cairn_transform cairn_transform_inverse(cairn_transform a_b);

/* Relative rigid transform: b_c from a_b and a_c, the inverse of a_b composed with a_c.
 *
 * a_b: frame b in frame a
 * a_c: frame c in frame a */
cairn_transform cairn_transform_between(cairn_transform a_b, cairn_transform a_c);

/* The pose of a rigid transform.
 *
 * t: rigid transform */
cairn_pose cairn_pose_of(cairn_transform t);

/* The identity: position 0, heading 0. */
static inline cairn_pose cairn_pose_identity(void)
{
    cairn_pose identity = {0, 0, 0};
    return identity;
}

/* Composition of two poses: a_c from a_b and b_c. */
cairn_pose cairn_pose_compose(cairn_pose a_b, cairn_pose b_c);

/* Inverse pose: b_a from a_b. */
cairn_pose cairn_pose_inverse(cairn_pose a_b);

/* Relative pose: b_c from a_b and a_c, the inverse of a_b composed with a_c. */
cairn_pose cairn_pose_between(cairn_pose a_b, cairn_pose a_c);

/* A point of frame b in frame a.
 *
 * b_point: point in frame b, m */
cairn_vec2 cairn_pose_point(cairn_pose a_b, cairn_vec2 b_point);

/* 1 when x, y and theta are finite.
 *
 * pose: any pose */
int32_t cairn_pose_is_finite(cairn_pose pose);

/* 1 when neither coordinate of the position exceeds a bound; 0 also for NaN.
 *
 * pose: any pose
 * bound: largest absolute value, m */
static inline int32_t cairn_pose_is_within(cairn_pose pose, cairn_real bound)
{
    return cairn_abs(pose.x) <= bound && cairn_abs(pose.y) <= bound;
}

/* Checks a pose. CAIRN_NOT_FINITE; CAIRN_BAD_ARGUMENT: beyond the limit.
 *
 * pose: any pose
 * limit: largest absolute coordinate, m */
cairn_status cairn_pose_check(cairn_pose pose, cairn_real limit, cairn_fault *fault);

/* Twist: an element of the Lie algebra se(2), the motion of constant linear and angular velocity
 * over unit time. */
typedef struct cairn_twist {
    /* Linear velocity times time, in m, in the moving frame. */
    cairn_vec2 linear;
    /* Angular velocity times time, in rad. In [-pi, pi) for a logarithm. */
    cairn_real angular;
} cairn_twist;

/* Logarithm map of SE(2): the twist of the shortest motion of constant twist from the identity to a
 * pose.
 *
 * motion: pose that the motion ends at */
cairn_twist cairn_twist_log(cairn_pose motion);

/* Exponential map of SE(2): exp(fraction * twist), the pose after a fraction of the motion.
 * Fractions outside 0 ... 1 extrapolate. theta is not wrapped.
 *
 * twist: motion over unit time
 * fraction: share of the motion */
cairn_pose cairn_twist_exp(cairn_twist twist, cairn_real fraction);

/* Least-squares rigid motion of paired points in closed form, from the moments of the pairs (Horn
 * 1987; Umeyama 1991, without scale). from, to: centroids of the points and of their partners, in
 * m. dot, cross: sums of the dot and of the cross products of the offsets from the centroids. The
 * motion maps `from` onto `to` and rotates by atan2(cross, dot). */
cairn_pose cairn_pose_from_moments(cairn_vec2 from, cairn_vec2 to, cairn_real dot,
                                   cairn_real cross);

/* Least-squares rigid motion that aligns from[i] with to[i], the alignment of two trajectories:
 * for all i < count with use[i] != 0 (use NULL: all). lever_arm, in m, > 0, weighs headings against
 * positions: a heading counts as a point that far ahead of the pose's origin. Identity when no pose
 * is in use. Cost: linear.
 *
 * from, to: [count] poses of the two trajectories
 * use: [count] 0: the pair is left out; NULL: all are used
 * lever_arm: m, > 0 */
cairn_pose cairn_pose_fit(const cairn_pose *from, const cairn_pose *to, const int32_t *use,
                          int32_t count, cairn_real lever_arm);

/* ---- Similarity transforms ---- */

/* The similarity transform of a translation, a scale and a rotation.
 *
 * shift: translation
 * scale: factor, > 0
 * rotation: rad */
cairn_similarity cairn_similarity_of(cairn_vec2 shift, cairn_real scale, cairn_real rotation);

/* Least-squares similarity transform of paired points in closed form, from the moments of the pairs
 * (Umeyama 1991): it maps `from` onto `to`. Of two pairs it maps both points.
 *
 * from, to: centroids of the points and of their partners; or both times one factor, and so is the
 *     shift: of sums of coordinates it is the number of pairs times that of the centroids
 * spread: sum of the squared offsets of the points from their centroid, > 0
 * dot, cross: sums of the dot and of the cross products of the offsets from the centroids */
cairn_similarity cairn_similarity_from_moments(cairn_vec2 from, cairn_vec2 to, cairn_real spread,
                                               cairn_real dot, cairn_real cross);

/* Transforms a vector: rotation and scale only.
 *
 * s: similarity transform
 * v: vector */
static inline cairn_vec2 cairn_similarity_vector(cairn_similarity s, cairn_vec2 v)
{
    cairn_vec2 mapped = {s.a * v.x - s.b * v.y, s.b * v.x + s.a * v.y};
    return mapped;
}

/* Transforms a point.
 *
 * s: similarity transform
 * p: point */
static inline cairn_vec2 cairn_similarity_point(cairn_similarity s, cairn_vec2 p)
{
    cairn_vec2 mapped = {s.shift.x + s.a * p.x - s.b * p.y, s.shift.y + s.b * p.x + s.a * p.y};
    return mapped;
}

/* Scale of a similarity transform.
 *
 * s: similarity transform */
static inline cairn_real cairn_similarity_scale(cairn_similarity s)
{
    return cairn_sqrt(s.a * s.a + s.b * s.b);
}

/* Rotation of a similarity transform, in rad, in (-pi, pi].
 *
 * s: similarity transform */
static inline cairn_real cairn_similarity_rotation(cairn_similarity s)
{
    return cairn_atan2(s.b, s.a);
}

/* ---- Oriented points ---- */

/* Checks points. CAIRN_NOT_FINITE; CAIRN_BAD_ARGUMENT: a position beyond the limit, a direction
 * whose length is not 1 within 1 %. *fault, when not NULL, gives the index of the point. Cost:
 * linear.
 *
 * points: [count]
 * limit: largest absolute coordinate, m */
cairn_status cairn_oriented_points_check(const cairn_oriented_point *points, int32_t count,
                                         cairn_real limit, cairn_fault *fault);

/* Checks a point, whose direction may have any length, and its weight. CAIRN_NOT_FINITE;
 * CAIRN_BAD_ARGUMENT: a coordinate or weight beyond CAIRN_MAX_MAGNITUDE, a weight below 0.
 *
 * point: any point
 * weight: of the point */
cairn_status cairn_weighted_point_check(const cairn_oriented_point *point, cairn_real weight);

/* ---- Segments ---- */

/* 1 when both ends are finite.
 *
 * segment: any segment */
inline int32_t cairn_segment_is_finite(cairn_segment segment)
{
    return cairn_vec2_is_finite(segment.a) && cairn_vec2_is_finite(segment.b);
}

/* Length of a segment, in m. */
cairn_real cairn_segment_length(cairn_segment segment);

/* The point of the segment closest to p. *parameter, when not NULL, is set to its parameter along
 * the segment, from 0 at a to 1 at b. A segment of length 0 is its point a. */
cairn_vec2 cairn_segment_nearest(cairn_segment segment, cairn_vec2 p, cairn_real *parameter);

/* Distance from p to the segment, in m. */
cairn_real cairn_segment_distance(cairn_segment segment, cairn_vec2 p);

/* Intersection of the infinite lines through two segments. 1 and *point set, or 0 when the lines
 * are parallel (the sine of their angle is at most 1e-6) or a segment has length 0.
 *
 * first, second: segments on the lines
 * point: set to the intersection */
int32_t cairn_line_intersection(cairn_segment first, cairn_segment second, cairn_vec2 *point);

/* 1 when two segments intersect, end points included.
 *
 * first, second: the segments */
int32_t cairn_segments_intersect(cairn_segment first, cairn_segment second);

/* ---- Boxes and polygons ---- */

/* The empty box, from which extending starts. */
cairn_box cairn_box_empty(void);

/* The smallest box that contains a box and a point.
 *
 * box: box, may be empty
 * p: point, m */
cairn_box cairn_box_extend(cairn_box box, cairn_vec2 p);

/* A box enlarged by `margin` m on every side. */
cairn_box cairn_box_grow(cairn_box box, cairn_real margin);

/* 1 when two boxes share a point, borders included.
 *
 * a, b: the boxes */
int32_t cairn_box_overlap(cairn_box a, cairn_box b);

/* Signed area of a simple polygon, in m^2: positive when the vertices run counter-clockwise.
 * vertices: [count]. Cost: linear. */
cairn_real cairn_polygon_area(const cairn_vec2 *vertices, int32_t count);

/* Point-in-polygon test by the even-odd rule: 1 when p is inside. A point on the border of two
 * polygons that share that border is inside exactly one of them. vertices: [count]. Cost:
 * linear. */
int32_t cairn_polygon_contains(const cairn_vec2 *vertices, int32_t count, cairn_vec2 p);

#ifdef __cplusplus
}
#endif

#endif
