/* Vectors, poses, segments, boxes and polygons: algebraic identities, comparison with reference
 * implementations, degenerate input. */
#include "tests/test.h"

#include <math.h>

static const double TOLERANCE = NUMBER(1e-12, 1e-5);

static cairn_vec2 vec(double x, double y)
{
    cairn_vec2 v = {(cairn_real)x, (cairn_real)y};
    return v;
}

static cairn_segment segment(double ax, double ay, double bx, double by)
{
    cairn_segment s = {vec(ax, ay), vec(bx, by)};
    return s;
}

static cairn_vec2 random_vec(cairn_random *random, cairn_real size)
{
    cairn_real x = cairn_random_uniform(random, -size, size);
    cairn_real y = cairn_random_uniform(random, -size, size);
    cairn_vec2 v = {x, y};

    return v;
}

static cairn_pose random_pose(cairn_random *random)
{
    cairn_vec2 p = random_vec(random, 10);
    cairn_pose pose = {p.x, p.y, cairn_random_uniform(random, -CAIRN_PI, CAIRN_PI)};

    return pose;
}

static void assert_vec(cairn_vec2 actual, double x, double y, double tolerance)
{
    assert_near(actual.x, x, tolerance);
    assert_near(actual.y, y, tolerance);
}

static void assert_pose(cairn_pose actual, cairn_pose expected, double tolerance)
{
    assert_near(actual.x, expected.x, tolerance);
    assert_near(actual.y, expected.y, tolerance);
    assert_near(cairn_wrap_angle(actual.theta - expected.theta), 0, tolerance);
    assert_true(actual.theta > -CAIRN_PI && actual.theta <= CAIRN_PI);
}

static void vectors(void **state)
{
    cairn_vec2 a = vec(3, -4), b = vec(2, 5);

    (void)state;
    assert_vec(cairn_vec2_add(a, b), 5, 1, 0);
    assert_vec(cairn_vec2_sub(a, b), 1, -9, 0);
    assert_vec(cairn_vec2_scale(a, -2), -6, 8, 0);
    assert_near(cairn_vec2_dot(a, b), -14, 0);
    assert_near(cairn_vec2_cross(a, b), 23, 0);
    assert_true(cairn_vec2_cross(vec(1, 0), vec(0, 1)) > 0);
    assert_vec(cairn_vec2_left_perp(a), 4, 3, 0);
    assert_vec(cairn_vec2_left_perp(vec(1, 0)), 0, 1, 0);
    assert_near(cairn_vec2_norm_squared(a), 25, 0);
    assert_near(cairn_vec2_norm(a), 5, 0);
    assert_vec(cairn_vec2_unit(a), 0.6, -0.8, TOLERANCE);
    assert_vec(cairn_vec2_unit(vec(0, 0)), 0, 0, 0);
    assert_vec(cairn_vec2_unit(vec(0, 1e-3)), 0, 1, TOLERANCE);
}

static void transforms(void **state)
{
    cairn_pose pose = {1, 2, CAIRN_PI / 2};
    cairn_transform t = cairn_transform_of(pose);

    (void)state;
    assert_near(t.cosine, 0, TOLERANCE);
    assert_near(t.sine, 1, 0);
    assert_vec(cairn_transform_point(t, vec(3, 4)), 1 - 4, 2 + 3, TOLERANCE);
    assert_vec(cairn_transform_direction(t, vec(3, 4)), -4, 3, TOLERANCE);
    assert_vec(cairn_pose_point(pose, vec(3, 4)), -3, 5, TOLERANCE);
    t = cairn_transform_mapping(CAIRN_REAL(0.6), CAIRN_REAL(0.8), vec(5, 10), vec(-2, 7));
    assert_vec(cairn_transform_point(t, vec(5, 10)), -2, 7, TOLERANCE);
    assert_vec(cairn_transform_point(t, vec(10, 10)), -2 + 3, 7 + 4, TOLERANCE);
    pose.theta = CAIRN_PI / 6;
    assert_vec(cairn_pose_point(pose, vec(2, 0)), 1 + sqrt(3), 2 + 1, TOLERANCE);
    assert_vec(cairn_transform_direction(cairn_transform_of(pose), vec(0, 2)), -1, sqrt(3),
               TOLERANCE);
}

static void angles_and_shares_of_the_way(void **state)
{
    cairn_vec2 a = {3, 4}, b = {-8, 6}, zero = {0, 0};

    (void)state;
    for (int i = -8; i <= 8; i++) {
        double turn = 0.39 * i, c = cos(turn), s = sin(turn);
        cairn_vec2 turned = {(cairn_real)(2 * (3 * c - 4 * s)), (cairn_real)(2 * (3 * s + 4 * c))};

        assert_near(cairn_vec2_angle(a, turned), turn, TOLERANCE);
        assert_near(cairn_vec2_angle(turned, a), -turn, TOLERANCE);
    }
    assert_near(cairn_vec2_angle(a, cairn_vec2_scale(a, -1)), CAIRN_PI, TOLERANCE);
    assert_near(cairn_vec2_angle(a, zero), 0, 0);
    assert_vec(cairn_vec2_interpolate(a, b, 0), 3, 4, 0);
    assert_vec(cairn_vec2_interpolate(a, b, 1), -8, 6, TOLERANCE);
    assert_vec(cairn_vec2_interpolate(a, b, CAIRN_REAL(0.25)), 0.25, 4.5, TOLERANCE);
    assert_vec(cairn_vec2_interpolate(a, b, -1), 14, 2, TOLERANCE);
}

static void transforms_are_poses(void **state)
{
    cairn_random random = cairn_random_seed(5, 1);

    (void)state;
    for (int i = 0; i < 100; i++) {
        cairn_pose a_b = random_pose(&random), b_c = random_pose(&random);
        cairn_transform t = cairn_transform_of(a_b), u = cairn_transform_of(b_c);
        cairn_vec2 d = {b_c.x, b_c.y};

        assert_pose(cairn_pose_of(t), a_b, 10 * TOLERANCE);
        assert_pose(cairn_pose_of(cairn_transform_compose(t, u)), cairn_pose_compose(a_b, b_c),
                    10 * TOLERANCE);
        assert_pose(cairn_pose_of(cairn_transform_inverse(t)), cairn_pose_inverse(a_b),
                    10 * TOLERANCE);
        assert_pose(cairn_pose_of(cairn_transform_between(t, cairn_transform_compose(t, u))), b_c,
                    10 * TOLERANCE);
        d = cairn_transform_inverse_direction(t, cairn_transform_direction(t, d));
        assert_vec(d, (double)b_c.x, (double)b_c.y, 10 * TOLERANCE);
    }
}

static void poses_are_a_group(void **state)
{
    cairn_random random = cairn_random_seed(1, 0);
    cairn_pose identity = cairn_pose_identity();

    (void)state;
    assert_true(identity.x == 0 && identity.y == 0 && identity.theta == 0);
    for (int i = 0; i < 2000; i++) {
        cairn_pose a_b = random_pose(&random), b_c = random_pose(&random),
                   c_d = random_pose(&random);
        cairn_pose a_c = cairn_pose_compose(a_b, b_c);
        cairn_vec2 c_point = random_vec(&random, 10);
        cairn_vec2 by_steps = cairn_pose_point(a_b, cairn_pose_point(b_c, c_point));

        assert_vec(cairn_pose_point(a_c, c_point), (double)by_steps.x, (double)by_steps.y,
                   10 * TOLERANCE);
        assert_pose(cairn_pose_compose(a_c, c_d),
                    cairn_pose_compose(a_b, cairn_pose_compose(b_c, c_d)), 10 * TOLERANCE);
        assert_pose(cairn_pose_compose(a_b, cairn_pose_inverse(a_b)), identity, 10 * TOLERANCE);
        assert_pose(cairn_pose_compose(cairn_pose_inverse(a_b), a_b), identity, 10 * TOLERANCE);
        assert_pose(cairn_pose_between(a_b, a_c), b_c, 10 * TOLERANCE);
        assert_pose(cairn_pose_compose(a_b, identity), a_b, 0);
        assert_pose(cairn_pose_between(identity, a_b), a_b, 0);
    }
}

static void pose_by_hand(void **state)
{
    cairn_pose a_b = {1, 2, CAIRN_PI / 2}, b_c = {3, 4, CAIRN_PI * 3 / 4};
    cairn_pose composed = {-3, 5, -CAIRN_PI * 3 / 4}, inverse = {-2, 1, -CAIRN_PI / 2};
    cairn_pose half_turn = {0, 0, CAIRN_PI};

    (void)state;
    assert_pose(cairn_pose_compose(a_b, b_c), composed, TOLERANCE);
    assert_pose(cairn_pose_inverse(a_b), inverse, TOLERANCE);
    assert_pose(cairn_pose_between(a_b, composed), b_c, TOLERANCE);
    assert_true(cairn_pose_inverse(half_turn).theta == CAIRN_PI);
}

static void finite_poses(void **state)
{
    const cairn_real bad[] = {(cairn_real)NAN, (cairn_real)INFINITY, -(cairn_real)INFINITY};
    cairn_pose good = {1, -2, 3};

    (void)state;
    assert_int_equal(cairn_pose_is_finite(good), 1);
    for (int i = 0; i < 3; i++) {
        cairn_pose pose = good;

        pose.x = bad[i];
        assert_int_equal(cairn_pose_is_finite(pose), 0);
        pose = good;
        pose.y = bad[i];
        assert_int_equal(cairn_pose_is_finite(pose), 0);
        pose = good;
        pose.theta = bad[i];
        assert_int_equal(cairn_pose_is_finite(pose), 0);
    }
}

static void finite_points_and_segments(void **state)
{
    const cairn_real bad[] = {(cairn_real)NAN, (cairn_real)INFINITY, -(cairn_real)INFINITY};

    (void)state;
    assert_int_equal(cairn_vec2_is_finite(vec(1, -2)), 1);
    assert_int_equal(cairn_segment_is_finite(segment(1, -2, 3, 4)), 1);
    for (int i = 0; i < 3; i++) {
        cairn_vec2 points[2] = {{bad[i], 1}, {1, bad[i]}};

        for (int k = 0; k < 2; k++) {
            cairn_segment from = {points[k], {1, 2}}, to = {{1, 2}, points[k]};

            assert_int_equal(cairn_vec2_is_finite(points[k]), 0);
            assert_int_equal(cairn_segment_is_finite(from), 0);
            assert_int_equal(cairn_segment_is_finite(to), 0);
        }
    }
}

static void similarity_transforms(void **state)
{
    cairn_random random = cairn_random_seed(6, 1);
    cairn_similarity s = cairn_similarity_of(vec(5, -1), 2, CAIRN_PI / 2);

    (void)state;
    assert_vec(cairn_similarity_point(s, vec(3, 4)), 5 - 8, -1 + 6, 10 * TOLERANCE);
    assert_vec(cairn_similarity_vector(s, vec(3, 4)), -8, 6, 10 * TOLERANCE);
    assert_near(cairn_similarity_scale(s), 2, TOLERANCE);
    assert_near(cairn_similarity_rotation(s), CAIRN_PI / 2, TOLERANCE);
    for (int trial = 0; trial < 100; trial++) {
        cairn_pose pose = random_pose(&random), to = random_pose(&random);
        cairn_similarity map =
            cairn_similarity_of(vec((double)pose.x, (double)pose.y),
                                cairn_random_uniform(&random, CAIRN_REAL(0.3), 3), pose.theta);
        cairn_vec2 p = {to.x, to.y}, step = {cairn_cos(to.theta), cairn_sin(to.theta)},
                   q = cairn_vec2_add(p, step), moved = cairn_similarity_vector(map, step);
        cairn_similarity fit = cairn_similarity_from_moments(
            p, cairn_similarity_point(map, p), cairn_vec2_norm_squared(step),
            cairn_vec2_dot(step, moved), cairn_vec2_cross(step, moved));
        cairn_vec2 there = cairn_similarity_point(map, q);

        assert_vec(cairn_similarity_point(fit, q), (double)there.x, (double)there.y,
                   100 * TOLERANCE);
        assert_near(cairn_similarity_scale(fit), (double)cairn_similarity_scale(map),
                    10 * TOLERANCE);
        assert_near(cairn_wrap_angle(cairn_similarity_rotation(fit) - pose.theta), 0,
                    10 * TOLERANCE);
    }
}

/* Not finite comes first, then a position beyond the limit, then the length of the direction. */
static void checks_of_poses_and_points(void **state)
{
    const cairn_real nan = (cairn_real)NAN, infinity = (cairn_real)INFINITY, limit = 100;
    const struct {
        cairn_oriented_point point;
        cairn_status status, weighted;
    } cases[] = {
        {{{limit, -limit}, {CAIRN_REAL(0.6), CAIRN_REAL(-0.8)}}, CAIRN_OK, CAIRN_OK},
        {{{0, nan}, {2, 0}}, CAIRN_NOT_FINITE, CAIRN_NOT_FINITE},
        {{{-infinity, 0}, {1, 0}}, CAIRN_NOT_FINITE, CAIRN_NOT_FINITE},
        {{{2 * limit, 0}, {1, nan}}, CAIRN_NOT_FINITE, CAIRN_NOT_FINITE},
        {{{0, 0}, {infinity, 0}}, CAIRN_NOT_FINITE, CAIRN_NOT_FINITE},
        {{{CAIRN_REAL(100.1), 0}, {1, 0}}, CAIRN_BAD_ARGUMENT, CAIRN_OK},
        {{{0, CAIRN_REAL(-100.1)}, {1, 0}}, CAIRN_BAD_ARGUMENT, CAIRN_OK},
        {{{0, 0}, {CAIRN_REAL(0.98), 0}}, CAIRN_BAD_ARGUMENT, CAIRN_OK},
        {{{0, 0}, {0, CAIRN_REAL(-1.02)}}, CAIRN_BAD_ARGUMENT, CAIRN_OK},
        {{{0, 2 * CAIRN_MAX_MAGNITUDE}, {1, 0}}, CAIRN_BAD_ARGUMENT, CAIRN_BAD_ARGUMENT},
    };
    const cairn_pose good = {-limit, limit, 9}, nowhere = {0, 0, nan}, far = {0, 2 * limit, 0},
                     both = {2 * limit, infinity, 0};
    cairn_fault fault = {5, NULL};

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        cairn_oriented_point points[2] = {cases[0].point, cases[i].point};

        assert_status(cairn_oriented_points_check(points, 2, limit, NULL), cases[i].status);
        assert_status(cairn_weighted_point_check(&cases[i].point, 1), cases[i].weighted);
        if (i > 0) {
            assert_fault(&fault, cairn_oriented_points_check(points, 2, limit, &fault),
                         cases[i].status, 1);
        }
    }
    assert_status(cairn_weighted_point_check(&cases[0].point, CAIRN_MAX_MAGNITUDE), CAIRN_OK);
    assert_status(cairn_weighted_point_check(&cases[0].point, nan), CAIRN_NOT_FINITE);
    assert_status(cairn_weighted_point_check(&cases[0].point, -1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_weighted_point_check(&cases[0].point, 2 * CAIRN_MAX_MAGNITUDE),
                  CAIRN_BAD_ARGUMENT);
    assert_status(cairn_oriented_points_check(NULL, 0, limit, NULL), CAIRN_OK);
    assert_status(cairn_pose_check(good, limit, NULL), CAIRN_OK);
    assert_fault(&fault, cairn_pose_check(nowhere, limit, &fault), CAIRN_NOT_FINITE, -1);
    assert_fault(&fault, cairn_pose_check(both, limit, &fault), CAIRN_NOT_FINITE, -1);
    assert_fault(&fault, cairn_pose_check(far, limit, &fault), CAIRN_BAD_ARGUMENT, -1);
    assert_string_equal(fault.message, "the pose is too far away");
    /* The message gives the limit when it is that of most modules. */
    for (int k = 1; k <= 2; k++) {
        const cairn_real bound = (cairn_real)k * CAIRN_MAX_MAGNITUDE;
        const cairn_oriented_point point = {{3 * CAIRN_MAX_MAGNITUDE, 0}, {1, 0}};
        const cairn_pose pose = {3 * CAIRN_MAX_MAGNITUDE, 0, 0};

        assert_fault(&fault, cairn_pose_check(pose, bound, &fault), CAIRN_BAD_ARGUMENT, -1);
        assert_string_equal(fault.message,
                            k == 1 ? "the pose is farther than 1e6 m" : "the pose is too far away");
        assert_fault(&fault, cairn_oriented_points_check(&point, 1, bound, &fault),
                     CAIRN_BAD_ARGUMENT, 0);
        assert_string_equal(fault.message,
                            k == 1 ? "a point is farther than 1e6 m" : "a point is too far away");
    }
}

static void positions_within_a_bound(void **state)
{
    const cairn_real nan = (cairn_real)NAN, past = CAIRN_REAL(3.001);

    (void)state;
    for (int k = 0; k < 4; k++) {
        cairn_real sign = k % 2 == 0 ? 1 : -1;
        cairn_vec2 axis = k < 2 ? vec(1, 0) : vec(0, 1), inside = cairn_vec2_scale(axis, 3 * sign);
        cairn_vec2 outside = cairn_vec2_scale(axis, past * sign);
        cairn_vec2 none = {k < 2 ? nan : 0, k < 2 ? 0 : nan};

        assert_int_equal(cairn_vec2_is_within(inside, 3), 1);
        assert_int_equal(cairn_vec2_is_within(outside, 3), 0);
        assert_int_equal(cairn_vec2_is_within(none, 3), 0);
        assert_int_equal(cairn_pose_is_within((cairn_pose){inside.x, inside.y, 9}, 3), 1);
        assert_int_equal(cairn_pose_is_within((cairn_pose){outside.x, outside.y, 0}, 3), 0);
        assert_int_equal(cairn_pose_is_within((cairn_pose){none.x, none.y, 0}, 3), 0);
    }
}

static void nearest_point_of_a_segment(void **state)
{
    cairn_segment s = segment(1, 1, 5, 4);
    cairn_real parameter = -1;

    (void)state;
    assert_near(cairn_segment_length(s), 5, TOLERANCE);
    assert_vec(cairn_segment_nearest(s, vec(1 + 2 - 3, 1 + 1.5 + 4), &parameter), 3, 2.5,
               TOLERANCE);
    assert_near(parameter, 0.5, TOLERANCE);
    assert_near(cairn_segment_distance(s, vec(0, 6.5)), 5, TOLERANCE);
    assert_vec(cairn_segment_nearest(s, vec(-2, -3), &parameter), 1, 1, 0);
    assert_true(parameter == 0);
    assert_near(cairn_segment_distance(s, vec(-2, -3)), 5, TOLERANCE);
    assert_vec(cairn_segment_nearest(s, vec(8, 8), &parameter), 5, 4, TOLERANCE);
    assert_true(parameter == 1);
    assert_near(cairn_segment_distance(s, vec(8, 8)), 5, TOLERANCE);
    assert_vec(cairn_segment_nearest(segment(2, 3, 2, 3), vec(5, 7), &parameter), 2, 3, 0);
    assert_true(parameter == 0);
    assert_near(cairn_segment_distance(segment(2, 3, 2, 3), vec(5, 7)), 5, TOLERANCE);
    assert_vec(cairn_segment_nearest(s, vec(8, 8), NULL), 5, 4, TOLERANCE);
}

/* The nearest of many points along the segment. */
static void nearest_against_sampling(void **state)
{
    cairn_random random = cairn_random_seed(2, 0);

    (void)state;
    for (int i = 0; i < 300; i++) {
        cairn_segment s = {random_vec(&random, 5), random_vec(&random, 5)};
        cairn_vec2 p = random_vec(&random, 8);
        double best = 1e9;

        for (int k = 0; k <= 1000; k++) {
            double t = k / 1000.0;
            double x = (double)s.a.x * (1 - t) + (double)s.b.x * t - (double)p.x;
            double y = (double)s.a.y * (1 - t) + (double)s.b.y * t - (double)p.y;

            best = fmin(best, sqrt(x * x + y * y));
        }
        assert_true((double)cairn_segment_distance(s, p) <= best + 1e-5);
        assert_near(cairn_segment_distance(s, p), best, 0.01);
    }
}

static void lines_meet(void **state)
{
    cairn_random random = cairn_random_seed(3, 0);
    cairn_vec2 point = vec(77, 78);

    (void)state;
    assert_int_equal(cairn_line_intersection(segment(0, 0, 1, 1), segment(4, 0, 4, 1), &point), 1);
    assert_vec(point, 4, 4, TOLERANCE);
    for (int i = 0; i < 1000; i++) {
        cairn_segment a = {random_vec(&random, 5), random_vec(&random, 5)};
        cairn_segment b = {random_vec(&random, 5), random_vec(&random, 5)};
        cairn_vec2 u = cairn_vec2_unit(cairn_vec2_sub(a.b, a.a)),
                   v = cairn_vec2_unit(cairn_vec2_sub(b.b, b.a));

        if (cairn_abs(cairn_vec2_cross(u, v)) < NUMBER(0.05, 0.05f))
            continue;
        assert_int_equal(cairn_line_intersection(a, b, &point), 1);
        assert_near(cairn_vec2_cross(u, cairn_vec2_sub(point, a.a)), 0, 200 * TOLERANCE);
        assert_near(cairn_vec2_cross(v, cairn_vec2_sub(point, b.a)), 0, 200 * TOLERANCE);
    }
    /* Parallel, of zero length, and both sides of the limit. */
    point = vec(77, 78);
    assert_int_equal(cairn_line_intersection(segment(0, 0, 2, 1), segment(1, 0, 5, 2), &point), 0);
    assert_int_equal(cairn_line_intersection(segment(0, 0, 0, 0), segment(1, 0, 5, 2), &point), 0);
    assert_int_equal(cairn_line_intersection(segment(0, 0, 2, 1), segment(1, 0, 1, 0), &point), 0);
    assert_int_equal(
        cairn_line_intersection(segment(0, 0, 3, 0), segment(0, 0, 5, 0.9 * 5e-6), &point), 0);
    assert_int_equal(
        cairn_line_intersection(segment(0, 0, 5, -0.9 * 5e-6), segment(0, 0, 3, 0), &point), 0);
    assert_vec(point, 77, 78, 0);
    assert_int_equal(
        cairn_line_intersection(segment(0, 0, 3, 0), segment(0, 0, 5, 1.1 * 5e-6), &point), 1);
    assert_int_equal(
        cairn_line_intersection(segment(0, 0, 3, 0), segment(0, 0, 5, -1.1 * 5e-6), &point), 1);
    assert_vec(point, 0, 0, 0);
}

static void crossing(const int corners[8], int expected)
{
    cairn_segment a = segment(corners[0], corners[1], corners[2], corners[3]);
    cairn_segment b = segment(corners[4], corners[5], corners[6], corners[7]);
    cairn_segment a_back = {a.b, a.a}, b_back = {b.b, b.a};

    assert_int_equal(cairn_segments_intersect(a, b), expected);
    assert_int_equal(cairn_segments_intersect(b, a), expected);
    assert_int_equal(cairn_segments_intersect(a_back, b), expected);
    assert_int_equal(cairn_segments_intersect(b_back, a), expected);
}

static void segments_cross(void **state)
{
    static const struct {
        int corners[8], expected;
    } cases[] = {
        /* an X */
        {{0, 0, 4, 4, 0, 4, 4, 0}, 1},
        /* a T: an end on the other */
        {{0, 0, 4, 0, 2, 0, 2, 3}, 1},
        /* above it */
        {{0, 0, 4, 0, 2, 1, 2, 3}, 0},
        /* a common end */
        {{0, 0, 4, 0, 4, 0, 6, 3}, 1},
        /* on one line, apart */
        {{0, 0, 4, 0, 5, 0, 7, 0}, 0},
        /* on one line, overlapping */
        {{0, 0, 4, 0, 3, 0, 7, 0}, 1},
        /* one within the other */
        {{0, 0, 4, 0, 1, 0, 2, 0}, 1},
        /* the same upright */
        {{0, 0, 0, 4, 0, 5, 0, 7}, 0},
        /* parallel */
        {{0, 0, 0, 4, 0, 3, 0, 7}, 1},
        {{0, 0, 4, 4, 1, 0, 5, 4}, 0},
        /* the line is met beyond the end */
        {{0, 0, 4, 4, 5, 5, 5, 0}, 0},
        /* a point on a segment */
        {{0, 0, 4, 0, 5, -1, 5, 1}, 0},
        {{2, 2, 2, 2, 0, 0, 4, 4}, 1},
        {{2, 3, 2, 3, 0, 0, 4, 4}, 0},
        {{2, 2, 2, 2, 2, 2, 2, 2}, 1},
        {{2, 2, 2, 2, 3, 2, 3, 2}, 0},
    };

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        crossing(cases[i].corners, cases[i].expected);
}

/* On a small grid of integers compared with the definition: some of the exactly computed parameters
 * lie in [0, 1]. */
static void segments_cross_exactly(void **state)
{
    cairn_random random = cairn_random_seed(4, 0);
    int meeting = 0;

    (void)state;
    for (int i = 0; i < 20000; i++) {
        int c[8], expected;
        int32_t ux, uy, vx, vy, wx, wy, cross;

        for (int k = 0; k < 8; k++)
            c[k] = cairn_random_below(&random, 6);
        ux = c[2] - c[0], uy = c[3] - c[1], vx = c[6] - c[4], vy = c[7] - c[5], wx = c[4] - c[0],
        wy = c[5] - c[1];
        cross = ux * vy - uy * vx;
        if (cross == 0)
            continue; /* listed above */
        if (cross > 0)
            expected = wx * vy - wy * vx >= 0 && wx * vy - wy * vx <= cross &&
                       wx * uy - wy * ux >= 0 && wx * uy - wy * ux <= cross;
        else
            expected = wx * vy - wy * vx <= 0 && wx * vy - wy * vx >= cross &&
                       wx * uy - wy * ux <= 0 && wx * uy - wy * ux >= cross;
        crossing(c, expected);
        meeting += expected;
    }
    assert_true(meeting > 3000);
}

static void boxes(void **state)
{
    cairn_box box = cairn_box_empty(), other;

    (void)state;
    assert_true(box.min.x > box.max.x && box.min.y > box.max.y);
    box = cairn_box_extend(box, vec(1, 5));
    assert_vec(box.min, 1, 5, 0);
    assert_vec(box.max, 1, 5, 0);
    box = cairn_box_extend(box, vec(3, 2));
    box = cairn_box_extend(box, vec(2, 3));
    assert_vec(box.min, 1, 2, 0);
    assert_vec(box.max, 3, 5, 0);
    other = cairn_box_grow(box, 2);
    assert_vec(other.min, -1, 0, 0);
    assert_vec(other.max, 5, 7, 0);

    for (int side = 0; side < 4; side++) {
        double dx = side == 0 ? 2 : side == 1 ? -2 : 0, dy = side == 2 ? 3 : side == 3 ? -3 : 0;

        other = box;
        other.min = cairn_vec2_add(other.min, vec(dx, dy)); /* they touch: closed boxes overlap */
        other.max = cairn_vec2_add(other.max, vec(dx, dy));
        assert_int_equal(cairn_box_overlap(box, other), 1);
        assert_int_equal(cairn_box_overlap(other, box), 1);
        other.min = cairn_vec2_add(other.min, vec(dx / 100, dy / 100));
        other.max = cairn_vec2_add(other.max, vec(dx / 100, dy / 100));
        assert_int_equal(cairn_box_overlap(box, other), 0);
        assert_int_equal(cairn_box_overlap(other, box), 0);
    }
    assert_int_equal(cairn_box_overlap(box, cairn_box_empty()), 0);
    assert_int_equal(cairn_box_overlap(box, cairn_box_grow(box, -NUMBER(0.5, 0.5f))), 1);
}

static void polygon_areas(void **state)
{
    cairn_vec2 l[] = {vec(1, 1), vec(4, 1), vec(4, 2), vec(2, 2), vec(2, 5), vec(1, 5)}, back[6];
    cairn_vec2 far_off[6];

    (void)state;
    assert_near(cairn_polygon_area(l, 6), 6, TOLERANCE);
    for (int i = 0; i < 6; i++) {
        back[i] = l[5 - i];
        far_off[i] = cairn_vec2_add(l[i], vec(4096, -8192));
    }
    assert_near(cairn_polygon_area(back, 6), -6, TOLERANCE);
    assert_near(cairn_polygon_area(far_off, 6), 6, 0);
    assert_near(cairn_polygon_area(l, 3), 1.5, TOLERANCE);
    assert_near(cairn_polygon_area(l, 2), 0, 0);
    assert_near(cairn_polygon_area(l, 1), 0, 0);
    assert_near(cairn_polygon_area(l, 0), 0, 0);
}

static void polygons_contain(void **state)
{
    cairn_vec2 l[] = {vec(1, 1), vec(4, 1), vec(4, 2), vec(2, 2), vec(2, 5), vec(1, 5)}, back[6];
    cairn_vec2 diamond[] = {vec(0, -2), vec(3, 0), vec(0, 2), vec(-3, 0)};

    (void)state;
    for (int i = 0; i < 6; i++)
        back[i] = l[5 - i];
    for (int ix = 0; ix < 50; ix++)
        for (int iy = 0; iy < 60; iy++) {
            double x = 0.05 + ix * 0.1, y = 0.05 + iy * 0.1;
            int expected = (x > 1 && x < 4 && y > 1 && y < 2) || (x > 1 && x < 2 && y > 1 && y < 5);

            assert_int_equal(cairn_polygon_contains(l, 6, vec(x, y)), expected);
            assert_int_equal(cairn_polygon_contains(back, 6, vec(x, y)), expected);
            x -= 2.52;
            y -= 3;
            expected = fabs(x) / 3 + fabs(y) / 2 < 1;
            assert_int_equal(cairn_polygon_contains(diamond, 4, vec(x, y)), expected);
        }
    assert_int_equal(cairn_polygon_contains(l, 0, vec(1, 1)), 0);
    assert_int_equal(cairn_polygon_contains(l, 1, vec(1, 1)), 0);
    assert_int_equal(cairn_polygon_contains(l, 2, vec(2, 1)), 0);
}

/* Four quadrants share their borders: each point is in exactly one of them. */
static void shared_borders(void **state)
{
    cairn_vec2 q[4][4] = {{vec(0, 0), vec(2, 0), vec(2, 2), vec(0, 2)},
                          {vec(-2, 0), vec(0, 0), vec(0, 2), vec(-2, 2)},
                          {vec(-2, -2), vec(0, -2), vec(0, 0), vec(-2, 0)},
                          {vec(0, -2), vec(2, -2), vec(2, 0), vec(0, 0)}};

    (void)state;
    for (int x = -3; x <= 3; x++)
        for (int y = -3; y <= 3; y++) {
            int inside = 0;

            for (int i = 0; i < 4; i++)
                inside += cairn_polygon_contains(q[i], 4, vec(x / 2.0, y / 2.0));
            assert_int_equal(inside, 1);
        }
}

static void a_motion_about_a_point(void **state)
{
    cairn_vec2 from = {1, 0}, to = {-2, 5};
    cairn_pose motion = cairn_pose_from_moments(from, to, 0, 3),
               straight = cairn_pose_from_moments(from, to, 2, 0);
    cairn_pose by_hand = {-2, 4, CAIRN_PI / 2}, shift = {-3, 5, 0};

    (void)state;
    assert_pose(motion, by_hand, TOLERANCE);
    assert_pose(straight, shift, TOLERANCE);
}

/* Sum of squares that cairn_pose_fit minimizes. */
static double misfit(const cairn_pose *from, const cairn_pose *to, const int32_t *use, int count,
                     double ahead, const double motion[3])
{
    double sum = 0, c = cos(motion[2]), s = sin(motion[2]);

    for (int i = 0; i < count; i++) {
        double x = (double)from[i].x, y = (double)from[i].y, a = (double)from[i].theta + motion[2],
               b = (double)to[i].theta;

        if (use != NULL && !use[i])
            continue;
        sum += pow(c * x - s * y + motion[0] - (double)to[i].x, 2) +
               pow(s * x + c * y + motion[1] - (double)to[i].y, 2);
        sum += ahead * ahead * (pow(cos(a) - cos(b), 2) + pow(sin(a) - sin(b), 2));
    }
    return sum;
}

static void the_fit_is_the_least(void **state)
{
    enum { COUNT = 9 };
    const cairn_pose exact = {CAIRN_REAL(0.7), CAIRN_REAL(-1.3), CAIRN_REAL(2.9)};
    cairn_random random = cairn_random_seed(3, 0);
    cairn_pose from[COUNT], to[COUNT], fit;
    int32_t use[COUNT] = {1, 0, 1, 1, 1, 0, 1, 1, 1}, none[COUNT] = {0};

    (void)state;
    for (int i = 0; i < COUNT; i++) {
        from[i].x = cairn_random_uniform(&random, 3, 9);
        from[i].y = cairn_random_uniform(&random, -5, -1);
        from[i].theta = cairn_random_uniform(&random, -3, 3);
        to[i] = cairn_pose_compose(exact, from[i]);
    }
    fit = cairn_pose_fit(from, to, NULL, COUNT, 1);
    assert_near(fit.x, exact.x, NUMBER(1e-12, 1e-4));
    assert_near(fit.y, exact.y, NUMBER(1e-12, 1e-4));
    assert_near(fit.theta, exact.theta, NUMBER(1e-12, 1e-5));
    for (int i = 0; i < COUNT; i++) {
        to[i].x += cairn_random_uniform(&random, -1, 1);
        to[i].y += cairn_random_uniform(&random, -1, 1);
        to[i].theta += cairn_random_uniform(&random, -1, 1);
    }
    for (int k = 0; k < 3; k++) {
        const int32_t *used = k == 1 ? use : NULL;
        cairn_real ahead = k == 2 ? 3 : 1;
        double motion[3], least;

        fit = cairn_pose_fit(from, to, used, COUNT, ahead);
        motion[0] = (double)fit.x;
        motion[1] = (double)fit.y;
        motion[2] = (double)fit.theta;
        least = misfit(from, to, used, COUNT, (double)ahead, motion);
        for (int axis = 0; axis < 3; axis++)
            for (int sign = -1; sign <= 1; sign += 2) {
                double other[3] = {motion[0], motion[1], motion[2]};

                other[axis] += sign * NUMBER(1e-5, 3e-3);
                assert_true(misfit(from, to, used, COUNT, (double)ahead, other) > least);
            }
    }
    fit = cairn_pose_fit(from, to, none, COUNT, 1);
    assert_true(fit.x == 0 && fit.y == 0 && fit.theta == 0);
    fit = cairn_pose_fit(from, to, NULL, 1, 1);
    assert_near(fit.theta, cairn_wrap_angle(to[0].theta - from[0].theta), NUMBER(1e-12, 1e-5));
    fit = cairn_pose_compose(fit, from[0]);
    assert_near(fit.x, to[0].x, NUMBER(1e-12, 1e-5));
}

/* By many small steps. */
static cairn_pose rolled(cairn_twist twist, double fraction)
{
    enum { STEPS = 20000 };
    double x = 0, y = 0, theta = 0, step = fraction / STEPS;
    cairn_pose pose;

    for (int i = 0; i < STEPS; i++) {
        double middle = theta + (double)twist.angular * step / 2;

        x += step * ((double)twist.linear.x * cos(middle) - (double)twist.linear.y * sin(middle));
        y += step * ((double)twist.linear.x * sin(middle) + (double)twist.linear.y * cos(middle));
        theta += (double)twist.angular * step;
    }
    pose.x = (cairn_real)x;
    pose.y = (cairn_real)y;
    pose.theta = (cairn_real)theta;
    return pose;
}

static void twists(void **state)
{
    static const double turns[] = {0, 1e-9, -0.0009, 0.0011, 0.3, -1.5, 3.1, -3.1};
    cairn_random random = cairn_random_seed(5, 1);

    (void)state;
    for (int i = 0; i < 8; i++) {
        cairn_pose motion = random_pose(&random), half;
        cairn_twist twist;

        motion.theta = (cairn_real)turns[i];
        twist = cairn_twist_log(motion);
        assert_near(twist.angular, turns[i], 1e-6);
        assert_pose(cairn_twist_exp(twist, 1), motion, NUMBER(1e-9, 1e-4));
        assert_pose(cairn_twist_exp(twist, 0), cairn_pose_identity(), 0);
        half = cairn_twist_exp(twist, CAIRN_REAL(0.5));
        assert_pose(cairn_pose_compose(half, half), motion, NUMBER(1e-9, 1e-4));
        assert_pose(cairn_twist_exp(twist, CAIRN_REAL(0.3)), rolled(twist, 0.3),
                    NUMBER(1e-7, 1e-4));
    }
    assert_near(cairn_twist_log((cairn_pose){1, 0, 2 * CAIRN_PI + CAIRN_REAL(0.5)}).angular, 0.5,
                NUMBER(1e-12, 1e-5));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_motion_about_a_point),
        cmocka_unit_test(the_fit_is_the_least),
        cmocka_unit_test(vectors),
        cmocka_unit_test(transforms),
        cmocka_unit_test(angles_and_shares_of_the_way),
        cmocka_unit_test(transforms_are_poses),
        cmocka_unit_test(poses_are_a_group),
        cmocka_unit_test(pose_by_hand),
        cmocka_unit_test(finite_poses),
        cmocka_unit_test(finite_points_and_segments),
        cmocka_unit_test(twists),
        cmocka_unit_test(positions_within_a_bound),
        cmocka_unit_test(checks_of_poses_and_points),
        cmocka_unit_test(similarity_transforms),
        cmocka_unit_test(nearest_point_of_a_segment),
        cmocka_unit_test(nearest_against_sampling),
        cmocka_unit_test(lines_meet),
        cmocka_unit_test(segments_cross),
        cmocka_unit_test(segments_cross_exactly),
        cmocka_unit_test(boxes),
        cmocka_unit_test(polygon_areas),
        cmocka_unit_test(polygons_contain),
        cmocka_unit_test(shared_borders),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
