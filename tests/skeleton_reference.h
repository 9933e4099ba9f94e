/* Shared by the tests of skeleton_grouping as written: scenes, invariants of every result, and the
 * reference implementation of centre points, weights and culling. */
#ifndef CAIRN_TESTS_SKELETON_REFERENCE_H
#define CAIRN_TESTS_SKELETON_REFERENCE_H

#include "tests/skeleton_scene.h"

#define REFERENCE                                                                                  \
    0.5 /* a step of maximum value less this, in logarithms, leaves a part's likelihood */

/* Edgels a pixel apart, slightly displaced and rotated, so that no two weights are equal. */
static inline void add_line(double ax, double ay, double bx, double by, cairn_random *random)
{
    double length = hypot(bx - ax, by - ay), ux = (bx - ax) / length, uy = (by - ay) / length;

    for (double t = 0.5; t < length; t += 1) {
        double off = (double)cairn_random_uniform(random, CAIRN_REAL(-0.2), CAIRN_REAL(0.2));
        double turn = (double)cairn_random_uniform(random, CAIRN_REAL(-0.05), CAIRN_REAL(0.05));

        add(ax + t * ux - off * uy, ay + t * uy + off * ux, -uy * cos(turn) - ux * sin(turn),
            ux * cos(turn) - uy * sin(turn));
    }
}

static inline void add_bar(double ax, double ay, double bx, double by, double r, uint64_t seed)
{
    double length = hypot(bx - ax, by - ay), ux = (bx - ax) / length, uy = (by - ay) / length;
    cairn_random random = cairn_random_seed(seed, 5);

    add_line(ax + uy * r, ay - ux * r, bx + uy * r, by - ux * r, &random);
    add_line(bx - uy * r, by + ux * r, ax - uy * r, ay + ux * r, &random);
}

static inline cairn_skeleton_grouping_params small_params(void)
{
    cairn_skeleton_grouping_params params = cairn_skeleton_grouping_as_written();

    params.max_width = WIDTH;
    params.max_height = HEIGHT;
    params.max_edgels = MAX_COUNT;
    params.max_lines = 64;
    params.max_parts = 64;
    params.max_points = 8000;
    params.max_steps = 60;
    params.particle_count = 12;
    params.min_log_odds = 3;
    return params;
}

/* ---- The reference implementation, in double ---- */

typedef struct reference_pose {
    double cx, cy, r;
    double x[2], y[2], nx[2], ny[2], deviation[2]; /* normals that point to the centre */
} reference_pose;

static inline double angle_between(double ax, double ay, double bx, double by)
{
    return atan2(ax * by - ay * bx, ax * bx + ay * by);
}

/* The CP of two edgels; 0: none. Points on each normal at equal distances from both edgels, and
 * their midpoint. */
static inline int reference_of(int32_t first, int32_t second, double low, double high, double most,
                               reference_pose *t)
{
    const cairn_edgel *e[2] = {&edgels[first], &edgels[second]};
    double dx = (double)(e[1]->position.x - e[0]->position.x),
           dy = (double)(e[1]->position.y - e[0]->position.y);
    double squared = dx * dx + dy * dy;

    if (!(squared > 0))
        return 0;
    t->cx = t->cy = 0;
    for (int32_t k = 0; k < 2; k++) {
        double nx = (double)e[k]->normal.x, ny = (double)e[k]->normal.y, facing = nx * dx + ny * dy;

        if (fabs(facing) < 0.26 * sqrt(squared))
            return 0;
        t->x[k] = (double)e[k]->position.x;
        t->y[k] = (double)e[k]->position.y;
        t->cx += (t->x[k] + (k ? -1 : 1) * nx * squared / (2 * facing)) / 2;
        t->cy += (t->y[k] + (k ? -1 : 1) * ny * squared / (2 * facing)) / 2;
    }
    t->r = hypot(t->cx - t->x[0], t->cy - t->y[0]);
    if (t->r < low || t->r > high)
        return 0;
    for (int32_t k = 0; k < 2; k++) {
        double wx = t->cx - t->x[k], wy = t->cy - t->y[k];
        double nx = (double)e[k]->normal.x, ny = (double)e[k]->normal.y,
               sign = nx * wx + ny * wy < 0 ? -1 : 1;

        t->nx[k] = sign * nx;
        t->ny[k] = sign * ny;
        t->deviation[k] = fabs(angle_between(t->nx[k], t->ny[k], wx, wy));
    }
    return (t->deviation[0] + t->deviation[1]) / 2 <= most;
}

static inline void turn_round(reference_pose *t)
{
    reference_pose old = *t;

    for (int32_t k = 0; k < 2; k++) {
        t->x[k] = old.x[1 - k];
        t->y[k] = old.y[1 - k];
        t->nx[k] = old.nx[1 - k];
        t->ny[k] = old.ny[1 - k];
        t->deviation[k] = old.deviation[1 - k];
    }
}

/* Logarithm of (3.7) to (3.9), each Gaussian relative to its maximum, with the corrected sign of
 * the loss of symmetry. */
static inline double reference_weight(const reference_pose *a, const reference_pose *b,
                                      const cairn_skeleton_grouping_params *p, double least,
                                      double most)
{
    double sum = 0, off = fmax(0, fmax(least - b->r, b->r - most)),
           range = off / (double)p->radius_sigma;

    for (int32_t k = 0; k < 2; k++) {
        double contour = angle_between(a->nx[k], a->ny[k], b->nx[k], b->ny[k]);
        double way =
            angle_between(a->cx - a->x[k], a->cy - a->y[k], b->cx - b->x[k], b->cy - b->y[k]);
        double turned =
            fabs(remainder(contour - way, 2 * PI)) + fmax(b->deviation[k] - a->deviation[k], 0);
        double gap = hypot(b->x[k] - a->x[k], b->y[k] - a->y[k]) / (double)p->step_sigma,
               h = turned / (double)p->duality_sigma;

        sum += exp(-h * h / 2) * exp(-gap * gap / 2) / 2;
    }
    return log(sum) - range * range / 2;
}

/* 1: the closed segments a b and c d have a common point. */
static inline int segments_meet(const double a[2], const double b[2], const double c[2],
                                const double d[2])
{
    double o1 = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    double o2 = (b[0] - a[0]) * (d[1] - a[1]) - (b[1] - a[1]) * (d[0] - a[0]);
    double o3 = (d[0] - c[0]) * (a[1] - c[1]) - (d[1] - c[1]) * (a[0] - c[0]);
    double o4 = (d[0] - c[0]) * (b[1] - c[1]) - (d[1] - c[1]) * (b[0] - c[0]);

    return (o1 > 0) != (o2 > 0) && (o3 > 0) != (o4 > 0);
}

static inline int sides_meet(const reference_pose *walk, int32_t i, int32_t side,
                             const double from[2], const double to[2])
{
    double a[2] = {walk[i].x[side], walk[i].y[side]},
           b[2] = {walk[i + 1].x[side], walk[i + 1].y[side]};

    return segments_meet(a, b, from, to);
}

/* 1: within the polygon of both contours of a walk of `count` poses, by its winding number. */
static inline int is_explored(const reference_pose *walk, int32_t count, double x, double y)
{
    double turned = 0;

    for (int32_t i = 0; i < 2 * count; i++) {
        int32_t j = (i + 1) % (2 * count);
        const reference_pose *s = &walk[i < count ? i : 2 * count - 1 - i],
                             *t = &walk[j < count ? j : 2 * count - 1 - j];

        turned += angle_between(s->x[i >= count] - x, s->y[i >= count] - y, t->x[j >= count] - x,
                                t->y[j >= count] - y);
    }
    return fabs(turned) > PI;
}

/* 1: the next pose of a walk passes the culling of the text and continues on its own contour. */
static inline int may_follow(const reference_pose *walk, int32_t count, const reference_pose *next)
{
    const reference_pose *last = &walk[count - 1];
    double centre[2] = {last->cx, last->cy}, to[2] = {next->cx, next->cy}, ends[2][2][2];

    for (int32_t k = 0; k < 2; k++) {
        ends[k][0][0] = last->x[k];
        ends[k][0][1] = last->y[k];
        ends[k][1][0] = next->x[k];
        ends[k][1][1] = next->y[k];
        if (is_explored(walk, count, next->x[k], next->y[k]))
            return 0;
        for (int32_t i = 0; i < count; i++)
            for (int32_t side = 0; side < 2; side++) {
                if (hypot(walk[i].x[side] - next->x[k], walk[i].y[side] - next->y[k]) < 1e-9)
                    return 0;
                if (i + 1 < count && !(side == k && i + 2 == count) &&
                    sides_meet(walk, i, side, ends[k][0], ends[k][1]))
                    return 0;
            }
    }
    for (int32_t i = 0; i + 2 < count; i++) {
        double a[2] = {walk[i].cx, walk[i].cy}, b[2] = {walk[i + 1].cx, walk[i + 1].cy};

        if (segments_meet(a, b, centre, to))
            return 0;
    }
    return !segments_meet(ends[0][0], ends[0][1], ends[1][0], ends[1][1]);
}

/* Both poses ordered by their sweep about the vector between the midpoints of their chords. */
static inline int put_in_order(const reference_pose *last, reference_pose *next, double heading[2])
{
    double was, is;

    heading[0] = next->x[0] + next->x[1] - last->x[0] - last->x[1];
    heading[1] = next->y[0] + next->y[1] - last->y[0] - last->y[1];
    was = heading[0] * (last->y[0] - last->y[1]) - heading[1] * (last->x[0] - last->x[1]);
    is = heading[0] * (next->y[0] - next->y[1]) - heading[1] * (next->x[0] - next->x[1]);
    if ((was > 0) != (is > 0))
        turn_round(next);
    return heading[0] != 0 || heading[1] != 0;
}

/* Invariants of every result: the weights of all parts, culling, one object for each part. */
static inline void check(const cairn_skeleton_grouping_result *r,
                         const cairn_skeleton_grouping_params *p)
{
    static reference_pose walk[300];
    int32_t points = 0;

    assert_int_equal(r->object_count, r->part_count);
    for (int32_t i = 0; i < r->part_count; i++) {
        const cairn_skeleton_grouping_part *part = &r->parts[i];
        double sum = 0, heading[2];

        assert_int_equal(part->first, points);
        assert_true(part->log_odds >= p->min_log_odds &&
                    (i == 0 || part->log_odds <= r->parts[i - 1].log_odds));
        assert_true(part->joint[0] == -1 && part->joint[1] == -1 && part->object == i);
        assert_int_equal(r->objects[i].free_end_count, 2);
        assert_true(part->count <= p->max_steps + 1);
        points += part->count;
        for (int32_t k = 0; k < part->count; k++) {
            const cairn_skeleton_grouping_point *q = &r->points[part->first + k];

            for (int32_t side = 0; side < 2; side++) {
                assert_in_range(q->edgel[side], 0, edgel_count - 1);
                assert_memory_equal(&q->contact[side], &edgels[q->edgel[side]].position,
                                    sizeof q->contact[side]);
            }
            assert_true(reference_of(q->edgel[0], q->edgel[1], 1, 1000,
                                     (double)p->symmetry_sigma + 1e-3, &walk[k]));
            assert_near(q->centre.x, walk[k].cx, NUMBER(1e-8, 2e-3));
            assert_near(q->centre.y, walk[k].cy, NUMBER(1e-8, 2e-3));
            assert_near(q->radius, walk[k].r, NUMBER(1e-8, 2e-3));
            if (k == 0)
                continue;
            assert_true(put_in_order(&walk[k - 1], &walk[k], heading));
            assert_near(walk[k].x[0], q->contact[0].x, 1e-3);
            assert_true(may_follow(walk, k, &walk[k]));
            sum += reference_weight(&walk[k - 1], &walk[k], p, (double)r->min_radius,
                                    (double)r->max_radius) +
                   REFERENCE;
        }
        assert_near(part->log_odds, sum, NUMBER(1e-6, 0.02));
    }
    assert_int_equal(points, r->point_count);
}

#endif
