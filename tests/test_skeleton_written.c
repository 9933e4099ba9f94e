/* Skeletons as Adluru 2008, chapter 3, has them: every centre point, the weights, what is culled, and whole walks against a slow twin. */
#include "tests/test.h"

#include <math.h>

#include "cairn/skeleton_grouping.h"

#define PI        3.14159265358979323846
#define REFERENCE 0.5 /* less this, in logarithms, a step of the greatest value leaves a part's likelihood */

enum { MOST = 3000, WIDTH = 200, HEIGHT = 160 };
/* What the fit of lines may use beyond the budget, and what moving CPs costs. */
enum { OVERDRAWN = 12 + 64 / 8 };

static cairn_edgel edgels[MOST];
static int32_t edgel_count;

static void add(double x, double y, double nx, double ny)
{
    cairn_edgel e = {{(cairn_real)x, (cairn_real)y}, {(cairn_real)nx, (cairn_real)ny}, 10};

    assert_true(edgel_count < MOST);
    edgels[edgel_count++] = e;
}

/* Edgels a pixel apart, shifted and turned a little each, so that no two weights are the same. */
static void add_line(double ax, double ay, double bx, double by, cairn_random *random)
{
    double length = hypot(bx - ax, by - ay), ux = (bx - ax) / length, uy = (by - ay) / length;

    for (double t = 0.5; t < length; t += 1) {
        double off = (double)cairn_random_uniform(random, CAIRN_REAL(-0.2), CAIRN_REAL(0.2));
        double turn = (double)cairn_random_uniform(random, CAIRN_REAL(-0.05), CAIRN_REAL(0.05));

        add(ax + t * ux - off * uy, ay + t * uy + off * ux, -uy * cos(turn) - ux * sin(turn),
            ux * cos(turn) - uy * sin(turn));
    }
}

static void add_bar(double ax, double ay, double bx, double by, double r, uint64_t seed)
{
    double length = hypot(bx - ax, by - ay), ux = (bx - ax) / length, uy = (by - ay) / length;
    cairn_random random = cairn_random_seed(seed, 5);

    add_line(ax + uy * r, ay - ux * r, bx + uy * r, by - ux * r, &random);
    add_line(bx - uy * r, by + ux * r, ax - uy * r, ay + ux * r, &random);
}

static void add_noise(int32_t count, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 0);

    for (int32_t i = 0; i < count; i++) {
        double x = (double)cairn_random_uniform(&random, 0, WIDTH),
               y = (double)cairn_random_uniform(&random, 0, HEIGHT);
        double turn = (double)cairn_random_uniform(&random, (cairn_real)-PI, (cairn_real)PI);

        add(x, y, cos(turn), sin(turn));
    }
}

static cairn_skeleton_params small_params(void)
{
    cairn_skeleton_params params = cairn_skeleton_as_written();

    params.max_width = WIDTH;
    params.max_height = HEIGHT;
    params.max_edgels = MOST;
    params.max_lines = 64;
    params.max_parts = 64;
    params.max_points = 8000;
    params.max_steps = 60;
    params.particles = 12;
    params.min_log_odds = 3;
    return params;
}

struct fixture {
    cairn_pool pool;
    cairn_skeleton *skeleton;
};

static struct fixture with(cairn_skeleton_params params)
{
    struct fixture f;

    f.pool = test_pool(cairn_skeleton_memory(&params));
    assert_ok(cairn_skeleton_create(&f.skeleton, &f.pool, &params));
    edgel_count = 0;
    return f;
}

static cairn_skeleton_input input_of(double least, double most)
{
    cairn_skeleton_input in = {edgels, edgel_count, WIDTH, HEIGHT, (cairn_real)least, (cairn_real)most};

    return in;
}

static cairn_skeleton_result run(cairn_skeleton *skeleton, double least, double most)
{
    cairn_skeleton_input in = input_of(least, most);
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(cairn_skeleton_begin(skeleton, &in));
    assert_ok(cairn_skeleton_step(skeleton, &budget));
    return cairn_skeleton_read(skeleton);
}

/* ---- The twin: in double, by the book ---- */

typedef struct twin {
    double cx, cy, r;
    double x[2], y[2], nx[2], ny[2], deviation[2]; /* normals turned to the centre */
} twin;

static double angle_between(double ax, double ay, double bx, double by)
{
    return atan2(ax * by - ay * bx, ax * bx + ay * by);
}

/* The CP of two edgels; 0: there is none. Places on a normal at equal distances from both edgels, and the middle of the two. */
static int twin_of(int32_t first, int32_t second, double low, double high, double most, twin *t)
{
    const cairn_edgel *e[2] = {&edgels[first], &edgels[second]};
    double dx = (double)(e[1]->position.x - e[0]->position.x), dy = (double)(e[1]->position.y - e[0]->position.y);
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
        double nx = (double)e[k]->normal.x, ny = (double)e[k]->normal.y, sign = nx * wx + ny * wy < 0 ? -1 : 1;

        t->nx[k] = sign * nx;
        t->ny[k] = sign * ny;
        t->deviation[k] = fabs(angle_between(t->nx[k], t->ny[k], wx, wy));
    }
    return (t->deviation[0] + t->deviation[1]) / 2 <= most;
}

static void turn_round(twin *t)
{
    twin old = *t;

    for (int32_t k = 0; k < 2; k++) {
        t->x[k] = old.x[1 - k];
        t->y[k] = old.y[1 - k];
        t->nx[k] = old.nx[1 - k];
        t->ny[k] = old.ny[1 - k];
        t->deviation[k] = old.deviation[1 - k];
    }
}

/* Logarithm of (3.7) to (3.9), each Gaussian of its greatest value, the sign of the loss of symmetry mended. */
static double twin_weight(const twin *a, const twin *b, const cairn_skeleton_params *p, double least, double most)
{
    double sum = 0, off = fmax(0, fmax(least - b->r, b->r - most)), range = off / (double)p->radius;

    for (int32_t k = 0; k < 2; k++) {
        double contour = angle_between(a->nx[k], a->ny[k], b->nx[k], b->ny[k]);
        double way = angle_between(a->cx - a->x[k], a->cy - a->y[k], b->cx - b->x[k], b->cy - b->y[k]);
        double turned = fabs(remainder(contour - way, 2 * PI)) + fmax(b->deviation[k] - a->deviation[k], 0);
        double gap = hypot(b->x[k] - a->x[k], b->y[k] - a->y[k]) / (double)p->reach, h = turned / (double)p->duality;

        sum += exp(-h * h / 2) * exp(-gap * gap / 2) / 2;
    }
    return log(sum) - range * range / 2;
}

/* 1: the closed segments a b and c d have a common point. */
static int segments_meet(const double a[2], const double b[2], const double c[2], const double d[2])
{
    double o1 = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    double o2 = (b[0] - a[0]) * (d[1] - a[1]) - (b[1] - a[1]) * (d[0] - a[0]);
    double o3 = (d[0] - c[0]) * (a[1] - c[1]) - (d[1] - c[1]) * (a[0] - c[0]);
    double o4 = (d[0] - c[0]) * (b[1] - c[1]) - (d[1] - c[1]) * (b[0] - c[0]);

    return (o1 > 0) != (o2 > 0) && (o3 > 0) != (o4 > 0);
}

static int sides_meet(const twin *walk, int32_t i, int32_t side, const double from[2], const double to[2])
{
    double a[2] = {walk[i].x[side], walk[i].y[side]}, b[2] = {walk[i + 1].x[side], walk[i + 1].y[side]};

    return segments_meet(a, b, from, to);
}

/* 1: within the polygon of both contours of a walk of `count` poses, by its winding number. */
static int is_explored(const twin *walk, int32_t count, double x, double y)
{
    double turned = 0;

    for (int32_t i = 0; i < 2 * count; i++) {
        int32_t j = (i + 1) % (2 * count);
        const twin *s = &walk[i < count ? i : 2 * count - 1 - i], *t = &walk[j < count ? j : 2 * count - 1 - j];

        turned += angle_between(s->x[i >= count] - x, s->y[i >= count] - y, t->x[j >= count] - x, t->y[j >= count] - y);
    }
    return fabs(turned) > PI;
}

/* 1: the next pose of a walk is none that the text culls, which is one of a contour of its own that goes on. */
static int may_follow(const twin *walk, int32_t count, const twin *next)
{
    const twin *last = &walk[count - 1];
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

/* 1: an edgel lies in the look-ahead circle of a side. */
static int is_ahead(const twin *last, const double heading[2], int32_t side, const cairn_edgel *e, double reach)
{
    double tx = -last->ny[side], ty = last->nx[side], sign = tx * heading[0] + ty * heading[1] < 0 ? -1 : 1;

    return hypot((double)e->position.x - last->x[side] - sign * reach * tx,
                 (double)e->position.y - last->y[side] - sign * reach * ty) <= reach;
}

/* Both poses ordered by their sweep about the vector from the middle of one chord to that of the other. */
static int put_in_order(const twin *last, twin *next, double heading[2])
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

/* The heaviest of all followers. 0: there is none. */
static int best_follower(const twin *walk, int32_t count, const double heading[2], const cairn_skeleton_params *p,
                         double least, double most, twin *best, double *weight)
{
    const twin *last = &walk[count - 1];
    double margin = 3 * (double)p->radius;
    int32_t followers = 0;

    for (int32_t i = 0; i < edgel_count; i++)
        for (int32_t j = 0; j < edgel_count && is_ahead(last, heading, 0, &edgels[i], (double)p->reach); j++) {
            twin next;
            double way[2], w;

            if (i == j || !is_ahead(last, heading, 1, &edgels[j], (double)p->reach) ||
                !twin_of(i, j, fmax(least - margin, 1), most + margin, (double)p->symmetry, &next) ||
                !put_in_order(last, &next, way) || !may_follow(walk, count, &next))
                continue;
            w = twin_weight(last, &next, p, least, most);
            if (followers++ == 0 || w > *weight) {
                *weight = w;
                *best = next;
            }
        }
    assert_true(followers < 256);
    return followers > 0;
}

/* Poses of the walk of one particle from a pose on; 0: not these. */
static int is_walk_of(const cairn_skeleton_result *r, const cairn_skeleton_part *part, const double way[2],
                      const cairn_skeleton_params *p, double least, double most)
{
    static twin walk[64];
    const cairn_skeleton_point *points = &r->points[part->first];
    double heading[2] = {way[0], way[1]}, sum = 0, weight = 0;
    int32_t count = 1, first = points[0].edgel[0], second = points[0].edgel[1];

    assert_true(twin_of(first, second, 1, 1000, PI, &walk[0]));
    for (; count <= p->max_steps; count++) {
        if (!best_follower(walk, count, heading, p, least, most, &walk[count], &weight) || weight < -(double)p->stop)
            break;
        (void)put_in_order(&walk[count - 1], &walk[count], heading);
        sum += weight + REFERENCE;
    }
    if (count != part->count || fabs(sum - (double)part->log_odds) > 1e-6)
        return 0;
    for (int32_t i = 0; i < count; i++)
        if (fabs((double)points[i].centre.x - walk[i].cx) > 1e-6 ||
            fabs((double)points[i].centre.y - walk[i].cy) > 1e-6 || fabs((double)points[i].radius - walk[i].r) > 1e-6)
            return 0;
    return 1;
}

/* ---- What is found ---- */

/* What holds of any result: the weights of all parts, what is culled, one object for each part. */
static void check(const cairn_skeleton_result *r, const cairn_skeleton_params *p)
{
    static twin walk[300];
    int32_t points = 0;

    assert_int_equal(r->object_count, r->part_count);
    for (int32_t i = 0; i < r->part_count; i++) {
        const cairn_skeleton_part *part = &r->parts[i];
        double sum = 0, heading[2];

        assert_int_equal(part->first, points);
        assert_true(part->log_odds >= p->min_log_odds && (i == 0 || part->log_odds <= r->parts[i - 1].log_odds));
        assert_true(part->joint[0] == -1 && part->joint[1] == -1 && part->object == i);
        assert_int_equal(r->objects[i].free_ends, 2);
        assert_true(part->count <= p->max_steps + 1);
        points += part->count;
        for (int32_t k = 0; k < part->count; k++) {
            const cairn_skeleton_point *q = &r->points[part->first + k];

            for (int32_t side = 0; side < 2; side++) {
                assert_in_range(q->edgel[side], 0, edgel_count - 1);
                assert_memory_equal(&q->touch[side], &edgels[q->edgel[side]].position, sizeof q->touch[side]);
            }
            assert_true(twin_of(q->edgel[0], q->edgel[1], 1, 1000, (double)p->symmetry + 1e-3, &walk[k]));
            assert_near(q->centre.x, walk[k].cx, NUMBER(1e-8, 2e-3));
            assert_near(q->centre.y, walk[k].cy, NUMBER(1e-8, 2e-3));
            assert_near(q->radius, walk[k].r, NUMBER(1e-8, 2e-3));
            if (k == 0)
                continue;
            assert_true(put_in_order(&walk[k - 1], &walk[k], heading));
            assert_near(walk[k].x[0], q->touch[0].x, 1e-3);
            assert_true(may_follow(walk, k, &walk[k]));
            sum += twin_weight(&walk[k - 1], &walk[k], p, (double)r->min_radius, (double)r->max_radius) + REFERENCE;
        }
        assert_near(part->log_odds, sum, NUMBER(1e-6, 0.02));
    }
    assert_int_equal(points, r->point_count);
}

/* At any angle, over most of its length by the two walks of a line together. */
static void a_bar_has_its_axis(void **state)
{
    cairn_skeleton_params params = small_params();
    struct fixture f = with(params);

    (void)state;
    for (int32_t k = 0; k < 4; k++) {
        double turn = 0.7 * k, r = 6 + 1.5 * k, c = cos(turn), s = sin(turn), least = 1e9, most = -1e9;
        cairn_polyline_segment line;
        cairn_skeleton_result found;

        edgel_count = 0;
        add_bar(100 - 45 * c, 80 - 45 * s, 100 + 45 * c, 80 + 45 * s, r, 3 + (uint64_t)k);
        found = run(f.skeleton, 0.8 * r, 1.2 * r);
        check(&found, &params);
        assert_true(found.part_count >= 1 && found.left_out == 0);
        for (int32_t i = 0; i < found.point_count; i++) {
            double x = (double)found.points[i].centre.x - 100, y = (double)found.points[i].centre.y - 80;

            assert_near(c * y - s * x, 0, 1.5);
            assert_near(found.points[i].radius, r, 1.5);
            least = fmin(least, c * x + s * y);
            most = fmax(most, c * x + s * y);
        }
        assert_true(most - least > 55);
        assert_true(cairn_skeleton_mirror_line(f.skeleton, 0, &line));
        assert_near(line.a[2], r, 1);
        assert_near(c * ((double)line.a[1] - 80) - s * ((double)line.a[0] - 100), 0, 1.5);
    }
    test_pool_free(&f.pool);
}

static void clutter_and_bends_are_checked(void **state)
{
    cairn_skeleton_params params = small_params();
    struct fixture f = with(params);
    cairn_skeleton_result found;

    (void)state;
    for (uint64_t seed = 1; seed <= 3; seed++) {
        cairn_random random = cairn_random_seed(seed, 8);

        edgel_count = 0;
        add_bar(30, 40, 130, 60, 7, seed);
        for (double t = 0.2; t < 2.6; t += 0.02) {
            double wobble = (double)cairn_random_uniform(&random, CAIRN_REAL(-0.2), CAIRN_REAL(0.2));

            add(100 + (50 + wobble) * cos(t), 70 + (50 + wobble) * sin(t), cos(t), sin(t));
            add(100 + (64 + wobble) * cos(t), 70 + (64 + wobble) * sin(t), -cos(t), -sin(t));
        }
        add_noise(250, seed);
        found = run(f.skeleton, seed == 3 ? 0 : 5, seed == 3 ? 0 : 9);
        check(&found, &params);
        assert_true(found.part_count >= 2);
    }
    test_pool_free(&f.pool);
}

static void centres_are_those_of_all_pairs(void **state)
{
    cairn_skeleton_params params = small_params();
    struct fixture f = with(params);

    (void)state;
    for (uint64_t seed = 1; seed <= 3; seed++) {
        int32_t expected = 0, listed = 0;
        cairn_vec2 at;
        cairn_real radius;

        edgel_count = 0;
        add_noise(500, 10 + seed);
        for (int32_t i = 0; i < edgel_count; i++)
            for (int32_t j = i + 1; j < edgel_count; j++) {
                twin t;

                expected += twin_of(i, j, 5, 11, (double)params.symmetry, &t);
            }
        assert_true(expected > 50 && expected < params.max_centres);
        assert_near(run(f.skeleton, 5, 11).centres, expected, NUMBER(0, 2));
        while (cairn_skeleton_centre_point(f.skeleton, listed, &at, &radius)) {
            assert_true(radius >= 5 && radius <= 11);
            listed++;
        }
        assert_near(listed, expected, NUMBER(0, 2));
    }
    test_pool_free(&f.pool);
}

/* With one particle the walk is the chain of the heaviest followers. */
static void walks_are_the_twins(void **state)
{
    cairn_skeleton_params params = small_params();
    int32_t walks = 0;

    (void)state;
    if (sizeof(cairn_real) < sizeof(double))
        skip();
    params.particles = 1;
    params.reach = 6;
    params.min_log_odds = 0;
    params.max_steps = 40;
    for (uint64_t seed = 1; seed <= 3; seed++) {
        struct fixture f = with(params);
        cairn_skeleton_result found;

        add_bar(50, 60, 110, 70, 7, seed);
        add_noise(60, seed);
        found = run(f.skeleton, 6, 8);
        check(&found, &params);
        for (int32_t i = 0; i < found.part_count; i++) {
            cairn_polyline_segment line;
            int known = 0;

            for (int32_t k = 0; !known && cairn_skeleton_mirror_line(f.skeleton, k, &line); k++)
                for (int32_t sign = -1; sign <= 1; sign += 2) {
                    double way[2] = {sign * (double)(line.b[0] - line.a[0]), sign * (double)(line.b[1] - line.a[1])};

                    known |= is_walk_of(&found, &found.parts[i], way, &params, 6, 8);
                }
            assert_true(known);
            walks++;
        }
        test_pool_free(&f.pool);
    }
    assert_true(walks >= 4);
}

/* How steep edges are, and which side of them is brighter, says nothing. */
static void contrast_does_not_count(void **state)
{
    cairn_skeleton_params params = small_params();
    struct fixture f = with(params);
    cairn_skeleton_result found;
    cairn_real first;
    int32_t parts;

    (void)state;
    add_bar(40, 60, 150, 80, 8, 2);
    add_noise(100, 3);
    found = run(f.skeleton, 6, 10);
    first = found.parts[0].log_odds;
    parts = found.part_count;
    for (int32_t i = 0; i < edgel_count; i++) {
        edgels[i].slope = (cairn_real)(1 + i % 7 * 5);
        edgels[i].normal = cairn_vec2_scale(edgels[i].normal, i % 3 ? 1 : -1);
    }
    found = run(f.skeleton, 6, 10);
    assert_int_equal(found.part_count, parts);
    assert_near(found.parts[0].log_odds, first, NUMBER(1e-9, 1e-3));
    test_pool_free(&f.pool);
}

/* ---- Bad and little input ---- */

static void little_or_nothing(void **state)
{
    cairn_skeleton_params params = small_params();
    struct fixture f = with(params);
    cairn_skeleton_result found = run(f.skeleton, 5, 10);
    cairn_polyline_segment line;
    cairn_real radius;
    cairn_vec2 at;

    (void)state;
    assert_int_equal(found.part_count, 0);
    assert_int_equal(found.centres, 0);
    assert_false(cairn_skeleton_centre_point(f.skeleton, 0, &at, &radius));
    assert_false(cairn_skeleton_mirror_line(f.skeleton, 0, &line));
    assert_false(cairn_skeleton_mirror_line(f.skeleton, -1, &line));
    assert_false(cairn_skeleton_centre_point(NULL, 0, &at, &radius));
    assert_false(cairn_skeleton_mirror_line(NULL, 0, &line));
    found = run(f.skeleton, 0, 0);
    assert_int_equal(found.part_count, 0);
    for (int32_t i = 0; i < 50; i++)
        add(10, 10, i % 2 ? 1 : -1, 0);
    found = run(f.skeleton, 5, 10);
    assert_int_equal(found.part_count, 0);
    edgel_count = 0;
    for (int32_t i = 0; i < 60; i++) {
        add(-500 + i, -300, 0, 1);
        add(1e6 + i, 1e6, 0, -1);
    }
    found = run(f.skeleton, 5, 10);
    check(&found, &params);
    test_pool_free(&f.pool);
}

/* A line of CPs whose contours end: all particles die at once, and a lone CP is no part. */
static void all_particles_die(void **state)
{
    cairn_skeleton_params params = small_params();
    struct fixture f;
    cairn_skeleton_result found;

    (void)state;
    params.reach = CAIRN_REAL(0.3);
    f = with(params);
    add_bar(40, 60, 150, 80, 8, 2);
    found = run(f.skeleton, 6, 10);
    assert_true(found.centres > 100 && found.starts > 0);
    assert_int_equal(found.part_count, 0);
    test_pool_free(&f.pool);
}

/* Tens of thousands of CPs, evenly thinned, and circles full of edgels: bounded, and what it says is true. */
static void crowds_are_thinned(void **state)
{
    cairn_skeleton_params params = small_params();
    struct fixture f;
    cairn_skeleton_result found;
    int32_t listed = 0;
    cairn_real radius;
    cairn_vec2 at;

    (void)state;
    params.max_centres = 1001;
    params.max_steps = 6;
    params.particles = 4;
    params.reach = 12;
    f = with(params);
    add_noise(2900, 7);
    found = run(f.skeleton, 4, 20);
    check(&found, &params);
    assert_true(found.centres > 10000);
    while (cairn_skeleton_centre_point(f.skeleton, listed, &at, &radius))
        listed++;
    assert_in_range(listed, 1001 / 2, 1001);
    test_pool_free(&f.pool);
}

static void little_room(void **state)
{
    (void)state;
    for (int32_t k = 0; k < 6; k++) {
        cairn_skeleton_params params = small_params();
        int32_t *field[] = {&params.max_lines, &params.max_parts, &params.max_points,
                            &params.max_steps, &params.particles, &params.max_centres};
        cairn_skeleton_result found;
        struct fixture f;

        *field[k] = k == 2 ? 2 * params.max_steps + 2 : k == 5 ? 40 : 1;
        f = with(params);
        add_bar(40, 60, 150, 80, 8, 2);
        add_bar(30, 120, 170, 120, 7, 2);
        found = run(f.skeleton, 6, 10);
        check(&found, &params);
        assert_true(k != 1 || (found.part_count == 0 && found.left_out > 0));
        assert_true(k != 2 || (found.starts == 1 && found.left_out > 0));
        assert_true(k != 0 || found.starts <= 1);
        test_pool_free(&f.pool);
    }
}

/* ---- Budgets ---- */

static uint64_t tell(void *context)
{
    cairn_skeleton_result r = cairn_skeleton_read(context);
    uint64_t hash = test_hash(TEST_HASH_START, &r.part_count, sizeof r.part_count);

    for (int32_t i = 0; i < r.point_count; i++)
        hash = test_hash(hash, &r.points[i], sizeof r.points[i]);
    for (int32_t i = 0; i < r.part_count; i++)
        hash = test_hash(hash, &r.parts[i].log_odds, sizeof r.parts[i].log_odds);
    return test_hash(hash, &r.starts, sizeof r.starts);
}

static void draw_scene(void)
{
    edgel_count = 0;
    add_bar(40, 60, 110, 75, 8, 2);
    add_noise(60, 3);
}

static cairn_status begin_scene(void *context)
{
    cairn_skeleton_input in = input_of(0, 0);

    return cairn_skeleton_begin(context, &in);
}

static cairn_status step_scene(void *context, cairn_budget *budget)
{
    return cairn_skeleton_step(context, budget);
}

static void budgets_do_not_matter(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    cairn_skeleton_params params = small_params();
    struct fixture f;
    uint64_t all;

    (void)state;
    params.particles = 4;
    params.max_steps = 20;
    params.max_centres = 300;
    f = with(params);
    draw_scene();
    (void)run(f.skeleton, 0, 0);
    all = tell(f.skeleton);
    for (size_t k = 0; k < sizeof budgets / sizeof *budgets; k++) {
        cairn_status status = CAIRN_MORE;

        assert_ok(begin_scene(f.skeleton));
        while (status == CAIRN_MORE) {
            cairn_budget budget = {budgets[k]};

            assert_int_equal(cairn_skeleton_read(f.skeleton).part_count, 0);
            status = cairn_skeleton_step(f.skeleton, &budget);
            assert_true(budget.left >= -OVERDRAWN && (status != CAIRN_MORE || budget.left <= 0));
        }
        assert_ok(status);
        assert_true(cairn_skeleton_read(f.skeleton).part_count > 0);
        assert_true(tell(f.skeleton) == all);
    }
    test_pool_free(&f.pool);
}

static void it_begins_anew(void **state)
{
    cairn_skeleton_params params = small_params();
    struct fixture f;
    test_stepped object;

    (void)state;
    params.particles = 4;
    params.max_steps = 20;
    params.max_centres = 300;
    f = with(params);
    object = (test_stepped){begin_scene, step_scene, tell, f.skeleton};
    draw_scene();
    test_begins_anew(&object, 9);
    test_pool_free(&f.pool);
}

static cairn_status create_in(void *context, cairn_pool *pool)
{
    cairn_skeleton *skeleton;

    return cairn_skeleton_create(&skeleton, pool, context);
}

static void memory_is_what_it_says(void **state)
{
    cairn_skeleton_params params = small_params();

    (void)state;
    params.max_width = params.max_height = 20;
    params.max_edgels = params.max_centres = params.max_points = 9;
    params.max_lines = params.max_parts = params.max_steps = params.particles = 1;
    test_every_pool_size(create_in, &params, cairn_skeleton_memory(&params));
    assert_true(cairn_skeleton_memory(&params) > 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_bar_has_its_axis),
        cmocka_unit_test(clutter_and_bends_are_checked),
        cmocka_unit_test(centres_are_those_of_all_pairs),
        cmocka_unit_test(walks_are_the_twins),
        cmocka_unit_test(contrast_does_not_count),
        cmocka_unit_test(little_or_nothing),
        cmocka_unit_test(all_particles_die),
        cmocka_unit_test(crowds_are_thinned),
        cmocka_unit_test(little_room),
        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(it_begins_anew),
        cmocka_unit_test(memory_is_what_it_says),
    };
    return cmocka_run_group_tests_name("skeleton_written", tests, NULL, NULL);
}
