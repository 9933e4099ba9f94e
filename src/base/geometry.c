/* Poses, twists, segments, boxes and polygons.
 *
 * Source: Barfoot, State estimation for robotics, 2017 (exponential and logarithm map of SE(2));
 * Horn 1987 and Umeyama 1991 (least-squares alignment). */
#include "src/base/build.h"

#include <stddef.h>

#include "cairn/geometry.h"

extern inline cairn_real cairn_vec2_dot(cairn_vec2 a, cairn_vec2 b);
extern inline cairn_real cairn_vec2_cross(cairn_vec2 a, cairn_vec2 b);
extern inline cairn_real cairn_vec2_angle(cairn_vec2 a, cairn_vec2 b);
extern inline int32_t cairn_vec2_is_finite(cairn_vec2 a);
extern inline int32_t cairn_vec2_is_within(cairn_vec2 a, cairn_real bound);
extern inline cairn_vec2 cairn_transform_point(cairn_transform t, cairn_vec2 p);
extern inline int32_t cairn_segment_is_finite(cairn_segment segment);

cairn_vec2 cairn_vec2_unit(cairn_vec2 a)
{
    cairn_real norm = cairn_vec2_norm(a);

    return norm > 0 ? cairn_vec2_scale(a, 1 / norm) : a;
}

cairn_transform cairn_transform_of(cairn_pose pose)
{
    cairn_transform t = {pose.x, pose.y, 1, 0};

    cairn_sincos(pose.theta, &t.sine, &t.cosine);
    return t;
}

cairn_transform cairn_transform_mapping(cairn_real cosine, cairn_real sine, cairn_vec2 from,
                                        cairn_vec2 to)
{
    cairn_transform t = {to.x - (cosine * from.x - sine * from.y),
                         to.y - (sine * from.x + cosine * from.y), cosine, sine};

    return t;
}

cairn_transform cairn_transform_compose(cairn_transform a_b, cairn_transform b_c)
{
    cairn_transform a_c;

    a_c.cosine = a_b.cosine * b_c.cosine - a_b.sine * b_c.sine;
    a_c.sine = a_b.sine * b_c.cosine + a_b.cosine * b_c.sine;
    a_c.x = a_b.cosine * b_c.x - a_b.sine * b_c.y + a_b.x;
    a_c.y = a_b.sine * b_c.x + a_b.cosine * b_c.y + a_b.y;
    return a_c;
}

cairn_transform cairn_transform_inverse(cairn_transform a_b)
{
    cairn_transform b_a = {-(a_b.cosine * a_b.x + a_b.sine * a_b.y),
                           a_b.sine * a_b.x - a_b.cosine * a_b.y, a_b.cosine, -a_b.sine};

    return b_a;
}

cairn_transform cairn_transform_between(cairn_transform a_b, cairn_transform a_c)
{
    return cairn_transform_compose(cairn_transform_inverse(a_b), a_c);
}

cairn_pose cairn_pose_of(cairn_transform t)
{
    cairn_pose pose = {t.x, t.y, cairn_atan2(t.sine, t.cosine)};

    return pose;
}

cairn_pose cairn_pose_compose(cairn_pose a_b, cairn_pose b_c)
{
    cairn_vec2 b_position = {b_c.x, b_c.y};
    cairn_vec2 position = cairn_transform_point(cairn_transform_of(a_b), b_position);
    cairn_pose a_c = {position.x, position.y, cairn_wrap_angle(a_b.theta + b_c.theta)};

    return a_c;
}

cairn_pose cairn_pose_inverse(cairn_pose a_b)
{
    cairn_transform t = cairn_transform_inverse(cairn_transform_of(a_b));
    cairn_pose b_a = {t.x, t.y, cairn_wrap_angle(-a_b.theta)};

    return b_a;
}

cairn_pose cairn_pose_between(cairn_pose a_b, cairn_pose a_c)
{
    cairn_vec2 offset = {a_c.x - a_b.x, a_c.y - a_b.y},
               position = cairn_transform_inverse_direction(cairn_transform_of(a_b), offset);
    cairn_pose b_c = {position.x, position.y, cairn_wrap_angle(a_c.theta - a_b.theta)};

    return b_c;
}

cairn_vec2 cairn_pose_point(cairn_pose a_b, cairn_vec2 b_point)
{
    return cairn_transform_point(cairn_transform_of(a_b), b_point);
}

int32_t cairn_pose_is_finite(cairn_pose pose)
{
    return cairn_is_finite(pose.x) && cairn_is_finite(pose.y) && cairn_is_finite(pose.theta);
}

cairn_status cairn_pose_check(cairn_pose pose, cairn_real limit, cairn_fault *fault)
{
    if (!cairn_pose_is_finite(pose))
        return cairn_refuse(fault, -1, "the pose is not finite", CAIRN_NOT_FINITE);
    if (!cairn_pose_is_within(pose, limit))
        return cairn_refuse(fault, -1,
                            limit == CAIRN_MAX_MAGNITUDE ? "the pose is farther than 1e6 m"
                                                         : "the pose is too far away",
                            CAIRN_BAD_ARGUMENT);
    return CAIRN_OK;
}

cairn_similarity cairn_similarity_of(cairn_vec2 shift, cairn_real scale, cairn_real rotation)
{
    cairn_similarity s = {.shift = shift};

    cairn_sincos(rotation, &s.b, &s.a);
    s.a *= scale;
    s.b *= scale;
    return s;
}

cairn_similarity cairn_similarity_from_moments(cairn_vec2 from, cairn_vec2 to, cairn_real spread,
                                               cairn_real dot, cairn_real cross)
{
    cairn_similarity s = {.a = dot / spread, .b = cross / spread};

    s.shift = cairn_vec2_sub(to, cairn_similarity_vector(s, from));
    return s;
}

cairn_status cairn_oriented_points_check(const cairn_oriented_point *points, int32_t count,
                                         cairn_real limit, cairn_fault *fault)
{
    for (int32_t i = 0; i < count; i++) {
        cairn_real norm = cairn_vec2_norm_squared(points[i].direction);

        if (!cairn_vec2_is_finite(points[i].position) || !cairn_vec2_is_finite(points[i].direction))
            return cairn_refuse(fault, i, "a point is not finite", CAIRN_NOT_FINITE);
        if (!cairn_vec2_is_within(points[i].position, limit))
            return cairn_refuse(fault, i,
                                limit == CAIRN_MAX_MAGNITUDE ? "a point is farther than 1e6 m"
                                                             : "a point is too far away",
                                CAIRN_BAD_ARGUMENT);
        if (!(norm > CAIRN_REAL(0.98) && norm < CAIRN_REAL(1.02)))
            return cairn_refuse(fault, i, "a direction is not of length 1", CAIRN_BAD_ARGUMENT);
    }
    return CAIRN_OK;
}

cairn_status cairn_weighted_point_check(const cairn_oriented_point *point, cairn_real weight)
{
    if (!cairn_vec2_is_finite(point->position) || !cairn_vec2_is_finite(point->direction) ||
        !cairn_is_finite(weight))
        return CAIRN_NOT_FINITE;
    if (!cairn_vec2_is_within(point->position, CAIRN_MAX_MAGNITUDE) || weight < 0 ||
        weight > CAIRN_MAX_MAGNITUDE)
        return CAIRN_BAD_ARGUMENT;
    return CAIRN_OK;
}

/* Sets *mean to the centroid of the poses in use, in m. Returns their number. */
static int32_t mean_position(const cairn_pose *poses, const int32_t *use, int32_t count,
                             cairn_vec2 *mean)
{
    int32_t used = 0;

    mean->x = mean->y = 0;
    for (int32_t i = 0; i < count; i++)
        if (use == NULL || use[i]) {
            used++;
            mean->x += (poses[i].x - mean->x) / (cairn_real)used;
            mean->y += (poses[i].y - mean->y) / (cairn_real)used;
        }
    return used;
}

/* x cot x, by its series near 0. */
static cairn_real x_cot_x(cairn_real x)
{
    cairn_real sine, cosine;

    if (cairn_abs(x) < CAIRN_REAL(1e-3))
        return 1 - x * x / 3;
    cairn_sincos(x, &sine, &cosine);
    return x * cosine / sine;
}

cairn_twist cairn_twist_log(cairn_pose motion)
{
    cairn_twist twist;
    cairn_real half, diagonal;

    twist.angular = cairn_wrap_angle(motion.theta);
    half = twist.angular / 2;
    diagonal = x_cot_x(half);
    twist.linear.x = diagonal * motion.x + half * motion.y;
    twist.linear.y = diagonal * motion.y - half * motion.x;
    return twist;
}

cairn_pose cairn_twist_exp(cairn_twist twist, cairn_real fraction)
{
    cairn_real angle = fraction * twist.angular, along = 1 - angle * angle / 6, across = angle / 2;
    cairn_pose pose;

    if (cairn_abs(angle) > CAIRN_REAL(1e-3)) {
        cairn_real sine, cosine;

        cairn_sincos(angle / 2, &sine, &cosine);
        along = 2 * sine * cosine / angle;
        across = 2 * sine * sine / angle;
    }
    pose.x = fraction * (along * twist.linear.x - across * twist.linear.y);
    pose.y = fraction * (across * twist.linear.x + along * twist.linear.y);
    pose.theta = angle;
    return pose;
}

cairn_pose cairn_pose_from_moments(cairn_vec2 from, cairn_vec2 to, cairn_real dot, cairn_real cross)
{
    cairn_pose motion = {0, 0, cairn_atan2(cross, dot)};
    cairn_vec2 rotated = cairn_pose_point(motion, from);

    motion.x = to.x - rotated.x;
    motion.y = to.y - rotated.y;
    return motion;
}

cairn_pose cairn_pose_fit(const cairn_pose *from, const cairn_pose *to, const int32_t *use,
                          int32_t count, cairn_real lever_arm)
{
    cairn_real sine = 0, cosine = 0;
    cairn_vec2 a, b;

    if (mean_position(from, use, count, &a) == 0)
        return cairn_pose_identity();
    (void)mean_position(to, use, count, &b);
    for (int32_t i = 0; i < count; i++)
        if (use == NULL || use[i]) {
            cairn_vec2 p = {from[i].x - a.x, from[i].y - a.y}, q = {to[i].x - b.x, to[i].y - b.y};
            cairn_real rotation = to[i].theta - from[i].theta;

            sine += cairn_vec2_cross(p, q) + lever_arm * lever_arm * cairn_sin(rotation);
            cosine += cairn_vec2_dot(p, q) + lever_arm * lever_arm * cairn_cos(rotation);
        }
    return cairn_pose_from_moments(a, b, cosine, sine);
}

cairn_real cairn_segment_length(cairn_segment segment)
{
    return cairn_vec2_norm(cairn_vec2_sub(segment.b, segment.a));
}

cairn_vec2 cairn_segment_nearest(cairn_segment segment, cairn_vec2 p, cairn_real *parameter)
{
    cairn_vec2 along = cairn_vec2_sub(segment.b, segment.a);
    cairn_real square = cairn_vec2_norm_squared(along);
    cairn_real t = square > 0 ? cairn_vec2_dot(cairn_vec2_sub(p, segment.a), along) / square : 0;

    t = cairn_min(cairn_max(t, 0), 1);
    if (parameter)
        *parameter = t;
    return cairn_vec2_add(segment.a, cairn_vec2_scale(along, t));
}

cairn_real cairn_segment_distance(cairn_segment segment, cairn_vec2 p)
{
    return cairn_vec2_norm(cairn_vec2_sub(p, cairn_segment_nearest(segment, p, NULL)));
}

int32_t cairn_line_intersection(cairn_segment first, cairn_segment second, cairn_vec2 *point)
{
    cairn_vec2 u = cairn_vec2_sub(first.b, first.a);
    cairn_vec2 v = cairn_vec2_sub(second.b, second.a);
    cairn_real cross = cairn_vec2_cross(u, v);
    cairn_real sine_limit = CAIRN_REAL(1e-6) * cairn_vec2_norm(u) * cairn_vec2_norm(v);

    if (!(cairn_abs(cross) > sine_limit))
        return 0;
    *point = cairn_vec2_add(
        first.a,
        cairn_vec2_scale(u, cairn_vec2_cross(cairn_vec2_sub(second.a, first.a), v) / cross));
    return 1;
}

/* Orientation of the triangle a, b, c: 1 counter-clockwise (left turn), -1 clockwise, 0
 * collinear. */
static int orientation(cairn_vec2 a, cairn_vec2 b, cairn_vec2 c)
{
    cairn_real cross = cairn_vec2_cross(cairn_vec2_sub(b, a), cairn_vec2_sub(c, a));

    return (cross > 0) - (cross < 0);
}

/* 1 when p lies in the bounding box of a segment. */
static int within_box(cairn_segment s, cairn_vec2 p)
{
    return p.x >= cairn_min(s.a.x, s.b.x) && p.x <= cairn_max(s.a.x, s.b.x) &&
           p.y >= cairn_min(s.a.y, s.b.y) && p.y <= cairn_max(s.a.y, s.b.y);
}

int32_t cairn_segments_intersect(cairn_segment first, cairn_segment second)
{
    int a = orientation(first.a, first.b, second.a), b = orientation(first.a, first.b, second.b);
    int c = orientation(second.a, second.b, first.a), d = orientation(second.a, second.b, first.b);

    if (a * b < 0 && c * d < 0)
        return 1;
    return (a == 0 && within_box(first, second.a)) || (b == 0 && within_box(first, second.b)) ||
           (c == 0 && within_box(second, first.a)) || (d == 0 && within_box(second, first.b));
}

cairn_box cairn_box_empty(void)
{
    cairn_box box = {{CAIRN_REAL_MAX, CAIRN_REAL_MAX}, {-CAIRN_REAL_MAX, -CAIRN_REAL_MAX}};
    return box;
}

cairn_box cairn_box_extend(cairn_box box, cairn_vec2 p)
{
    box.min.x = cairn_min(box.min.x, p.x);
    box.min.y = cairn_min(box.min.y, p.y);
    box.max.x = cairn_max(box.max.x, p.x);
    box.max.y = cairn_max(box.max.y, p.y);
    return box;
}

cairn_box cairn_box_grow(cairn_box box, cairn_real margin)
{
    box.min.x -= margin;
    box.min.y -= margin;
    box.max.x += margin;
    box.max.y += margin;
    return box;
}

int32_t cairn_box_overlap(cairn_box a, cairn_box b)
{
    return a.min.x <= b.max.x && b.min.x <= a.max.x && a.min.y <= b.max.y && b.min.y <= a.max.y;
}

cairn_real cairn_polygon_area(const cairn_vec2 *vertices, int32_t count)
{
    cairn_real twice = 0;

    for (int32_t i = 2; i < count; i++)
        twice += cairn_vec2_cross(cairn_vec2_sub(vertices[i - 1], vertices[0]),
                                  cairn_vec2_sub(vertices[i], vertices[0]));
    return twice / 2;
}

int32_t cairn_polygon_contains(const cairn_vec2 *vertices, int32_t count, cairn_vec2 p)
{
    int32_t inside = 0;

    for (int32_t i = 0, j = count - 1; i < count; j = i++) {
        cairn_vec2 a = vertices[i], b = vertices[j];

        if ((a.y > p.y) != (b.y > p.y) && p.x < a.x + (b.x - a.x) * (p.y - a.y) / (b.y - a.y))
            inside = !inside;
    }
    return inside;
}
