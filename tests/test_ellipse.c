/* Ellipses among oriented points, compared with a reference implementation. */
#include "tests/test.h"

#include <math.h>

#include "cairn/ellipse.h"
#include "cairn/random.h"
#include "src/shapes/ellipse_work.h"

#define PI     3.14159265358979323846
#define DEGREE (PI / 180)

enum { ITEM_COUNT = 1200, MAX_COUNT = 64, RADII = 64 };

struct fixture {
    cairn_pool pool;
    cairn_ellipse_set *set;
};

static struct fixture set_with(cairn_ellipse_params params)
{
    struct fixture f;

    f.pool = test_pool(cairn_ellipse_memory(&params));
    assert_ok(cairn_ellipse_create(&f.set, &f.pool, &params));
    return f;
}

/* Points of a scene, in the order of their creation. */
struct cloud {
    cairn_oriented_point points[ITEM_COUNT];
    cairn_real weights[ITEM_COUNT];
    int32_t count;
};

static void add_scene_point(struct cloud *c, double x, double y, double dx, double dy)
{
    cairn_oriented_point *p = &c->points[c->count];

    p->position.x = (cairn_real)x;
    p->position.y = (cairn_real)y;
    p->direction.x = (cairn_real)dx;
    p->direction.y = (cairn_real)dy;
    c->weights[c->count++] = 1;
}

static void add_wall(struct cloud *c, double x, double y, double angle, int32_t count)
{
    for (int32_t i = 0; i < count; i++)
        add_scene_point(c, x + 0.1 * i * cos(angle), y + 0.1 * i * sin(angle), cos(angle),
                        sin(angle));
}

/* `count` points from one angle of the ellipse to another, excluding the last. */
static void add_arc(struct cloud *c, const cairn_ellipse *e, double from, double to, int32_t count)
{
    double cosine = cos((double)e->centre.theta), sine = sin((double)e->centre.theta);

    for (int32_t i = 0; i < count; i++) {
        double angle = from + (to - from) * i / count;
        double u = (double)e->half_length * cos(angle), v = (double)e->half_width * sin(angle);
        double du = -(double)e->half_length * sin(angle), dv = (double)e->half_width * cos(angle),
               n = hypot(du, dv);

        if (e->kind == CAIRN_ELLIPSE_COLUMN)
            n = -n;
        add_scene_point(c, (double)e->centre.x + cosine * u - sine * v,
                        (double)e->centre.y + sine * u + cosine * v, (cosine * du - sine * dv) / n,
                        (sine * du + cosine * dv) / n);
    }
}

static cairn_ellipse ellipse(double x, double y, double theta, double a, double b,
                             cairn_ellipse_kind kind)
{
    cairn_ellipse e;

    memset(&e, 0, sizeof e);
    e.centre.x = (cairn_real)x;
    e.centre.y = (cairn_real)y;
    e.centre.theta = (cairn_real)theta;
    e.half_length = (cairn_real)a;
    e.half_width = (cairn_real)b;
    e.kind = kind;
    return e;
}

static const cairn_ellipse *search(cairn_ellipse_set *set, const struct cloud *c, int32_t *found)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(cairn_ellipse_begin(set, c->points, c->weights, c->count));
    assert_ok(cairn_ellipse_step(set, &budget));
    return cairn_ellipse_list(set, found);
}

/* ---- Reference implementation: cells one by one, conics by elimination, in double ---- */

struct slow {
    const cairn_ellipse_params *p;
    const struct cloud *c;
    double cell, corner_x, corner_y;
    int32_t squares;
    double *raw, *votes;
    cairn_ellipse found[MAX_COUNT];
    int32_t count;
};

static void slow_begin(struct slow *s)
{
    double low_x = 1e9, low_y = 1e9, high_x = -1e9, high_y = -1e9;

    for (int32_t i = 0; i < s->c->count; i++) {
        low_x = fmin(low_x, (double)s->c->points[i].position.x);
        low_y = fmin(low_y, (double)s->c->points[i].position.y);
        high_x = fmax(high_x, (double)s->c->points[i].position.x);
        high_y = fmax(high_y, (double)s->c->points[i].position.y);
    }
    s->cell =
        fmax((double)s->p->cell_size, fmax(high_x - low_x, high_y - low_y) / (s->p->cells - 3));
    s->corner_x = (low_x + high_x) / 2 - s->cell * (s->p->cells - 1) / 2;
    s->corner_y = (low_y + high_y) / 2 - s->cell * (s->p->cells - 1) / 2;
    s->squares = s->p->oriented ? 2 : 1;
}

static void slow_vote(struct slow *s)
{
    int32_t cells = s->p->cells, all = s->squares * cells * cells;
    double least = (double)s->p->min_radius, most = (double)s->p->max_radius;

    s->raw = calloc((size_t)all, sizeof *s->raw);
    s->votes = calloc((size_t)all, sizeof *s->votes);
    assert_true(s->raw != NULL && s->votes != NULL);
    for (int32_t i = 0; i < s->c->count; i++)
        for (int side = 0; side < 2; side++) {
            const cairn_oriented_point *p = &s->c->points[i];
            double n = hypot((double)p->direction.x, (double)p->direction.y) * (side ? -1 : 1);

            for (int32_t k = 0; k <= (int32_t)((most - least) / s->cell) && n != 0; k++) {
                double r = least + k * s->cell;
                int32_t x = (int32_t)floor(
                    ((double)p->position.x - r * (double)p->direction.y / n - s->corner_x) /
                        s->cell +
                    0.5);
                int32_t y = (int32_t)floor(
                    ((double)p->position.y + r * (double)p->direction.x / n - s->corner_y) /
                        s->cell +
                    0.5);

                if (x >= 0 && y >= 0 && x < cells && y < cells)
                    s->raw[((s->squares - 1) * side * cells + y) * cells + x] +=
                        (double)s->c->weights[i];
            }
        }
    for (int32_t i = 0; i < all; i++)
        for (int v = -1; v <= 1; v++)
            for (int u = -1; u <= 1; u++) {
                int32_t x = i % cells + u, y = i / cells % cells + v;

                if (x >= 0 && y >= 0 && x < cells && y < cells)
                    s->votes[i] += (2 - abs(u)) * (2 - abs(v)) * s->raw[i + v * cells + u];
            }
}

static int slow_is_peak(const struct slow *s, int32_t at)
{
    int32_t cells = s->p->cells, reach = (int32_t)ceil((double)s->p->separation / s->cell - 1e-6);

    if (s->votes[at] < (double)s->p->min_votes)
        return 0;
    for (int32_t i = 0; i < s->squares * cells * cells; i++)
        if (i / (cells * cells) == at / (cells * cells) && abs(i % cells - at % cells) <= reach &&
            abs(i / cells - at / cells) <= reach &&
            (s->votes[i] > s->votes[at] || (s->votes[i] == s->votes[at] && i < at)))
            return 0;
    return 1;
}

/* Radial offset and outward normal of a point, to first order. */
static double slow_offset(const cairn_ellipse *e, double x, double y, double normal[2])
{
    double c = cos((double)e->centre.theta), s = sin((double)e->centre.theta);
    double dx = x - (double)e->centre.x, dy = y - (double)e->centre.y;
    double u = (c * dx + s * dy) / (double)e->half_length,
           v = (c * dy - s * dx) / (double)e->half_width;
    double r = hypot(u, v), gu = u / r / (double)e->half_length, gv = v / r / (double)e->half_width,
           g = hypot(gu, gv);

    normal[0] = (c * gu - s * gv) / g;
    normal[1] = (s * gu + c * gv) / g;
    return (r - 1) / g;
}

static int slow_belongs(const cairn_ellipse *e, const cairn_oriented_point *p, double reach,
                        double tolerance)
{
    double n[2], off = slow_offset(e, (double)p->position.x, (double)p->position.y, n);
    double turn = remainder(
        atan2((double)p->direction.y, (double)p->direction.x) - atan2(n[0], -n[1]), 2 * PI);

    if (e->kind == CAIRN_ELLIPSE_COLUMN)
        turn = remainder(turn + PI, 2 * PI);
    if (e->kind == CAIRN_ELLIPSE_ANY)
        turn = remainder(turn, PI);
    return fabs(off) <= reach && fabs(turn) <= tolerance;
}

/* Gauss with pivots; the unknowns in m[.][5]. */
static void eliminate(double m[5][6])
{
    for (int i = 0; i < 5; i++) {
        int best = i;

        for (int k = i; k < 5; k++)
            best = fabs(m[k][i]) > fabs(m[best][i]) ? k : best;
        for (int j = 0; j < 6; j++) {
            double swap = m[i][j];

            m[i][j] = m[best][j];
            m[best][j] = swap;
        }
        for (int k = 0; k < 5; k++)
            for (int j = 5; k != i && j >= i; j--)
                m[k][j] -= m[k][i] / m[i][i] * m[i][j];
    }
    for (int i = 0; i < 5; i++)
        m[i][5] /= m[i][i];
}

static void slow_row(double m[5][6], const double row[5], double value, double weight)
{
    for (int i = 0; i < 5; i++) {
        for (int k = 0; k < 5; k++)
            m[i][k] += weight * row[i] * row[k];
        m[i][5] += weight * row[i] * value;
    }
}

/* The conic through the points within reach; 0 when there is no ellipse within the params. */
static int slow_fit(const struct slow *s, cairn_ellipse *e, double reach, double tolerance)
{
    static const double round[5] = {1, 0, -1, 0, 0}, straight[5] = {0, 1, 0, 0, 0};
    double m[5][6] = {{0}}, weight = 0, scale = (double)(e->half_length + e->half_width) / 2;
    double a, b, c, det, x, y, level, mean, apart, angle;

    for (int32_t i = 0; i < s->c->count; i++) {
        const cairn_oriented_point *p = &s->c->points[i];
        double w = (double)s->c->weights[i],
               n = hypot((double)p->direction.x, (double)p->direction.y);
        double dx = (double)p->direction.x / n, dy = (double)p->direction.y / n;
        double u = (double)(p->position.x - e->centre.x) / scale,
               v = (double)(p->position.y - e->centre.y) / scale;
        const double place[5] = {u * u, u * v, v * v, u, v};
        const double across[5] = {2 * u * dx, u * dy + v * dx, 2 * v * dy, dx, dy};

        if (!slow_belongs(e, p, reach, tolerance))
            continue;
        slow_row(m, place, 1, w);
        slow_row(m, across, 0, 0.1 * w);
        weight += w;
    }
    if (weight < (double)s->p->min_votes)
        return 0;
    slow_row(m, round, 0, 1e-3 * weight);
    slow_row(m, straight, 0, 1e-3 * weight);
    eliminate(m);
    a = m[0][5], b = m[1][5], c = m[2][5];
    det = 4 * a * c - b * b;
    if (!(det > 0) || !(a > 0))
        return 0;
    x = (b * m[4][5] - 2 * c * m[3][5]) / det;
    y = (b * m[3][5] - 2 * a * m[4][5]) / det;
    level = 1 + a * x * x + b * x * y + c * y * y;
    mean = (a + c) / 2;
    apart = hypot((a - c) / 2, b / 2);
    angle = atan2(b, a - c) / 2 + PI / 2; /* of the longer axis */
    e->centre.x += (cairn_real)(scale * x);
    e->centre.y += (cairn_real)(scale * y);
    e->centre.theta = (cairn_real)fmod(angle + PI, PI);
    e->half_length = (cairn_real)(scale * sqrt(level / (mean - apart)));
    e->half_width = (cairn_real)(scale * sqrt(level / (mean + apart)));
    return e->half_width >= s->p->min_radius && e->half_length <= s->p->max_radius &&
           e->half_length <= s->p->max_axis_ratio * e->half_width;
}

static double slow_radius(const struct slow *s, const cairn_ellipse *e)
{
    double bins[RADII + 1] = {0}, most = (double)s->p->max_radius, best = -1, radius = 0;

    for (int32_t i = 0; i < s->c->count; i++) {
        const cairn_oriented_point *p = &s->c->points[i];
        double n = hypot((double)p->direction.x, (double)p->direction.y);
        double dx = (double)p->direction.x / n, dy = (double)p->direction.y / n;
        double x = (double)(e->centre.x - p->position.x), y = (double)(e->centre.y - p->position.y);
        double r = dx * y - dy * x, off = fabs(dx * x + dy * y), at;

        r = e->kind == CAIRN_ELLIPSE_COLUMN ? -r : e->kind == CAIRN_ELLIPSE_ANY ? fabs(r) : r;
        if (r <= 0 || r > most || off > sin((double)s->p->angle_tolerance) * r + 2 * s->cell)
            continue;
        at = r / most * (RADII - 1);
        bins[(int)at] += (double)s->c->weights[i] * (1 - (at - floor(at)));
        bins[(int)at + 1] += (double)s->c->weights[i] * (at - floor(at));
    }
    bins[RADII] = 0;
    for (int i = 1; i < RADII; i++)
        if (bins[i - 1] + 2 * bins[i] + bins[i + 1] > best) {
            best = bins[i - 1] + 2 * bins[i] + bins[i + 1];
            radius = most / (RADII - 1) * i;
        }
    return fmax(radius, (double)s->p->min_radius);
}

static void slow_measure(const struct slow *s, cairn_ellipse *e)
{
    double a = (double)e->half_length, b = (double)e->half_width, w = 0, off = 0,
           reach = (double)s->p->support_distance;
    double length = PI * (3 * (a + b) - sqrt((3 * a + b) * (a + 3 * b)));
    int arcs = (int)fmax(8, fmin(64, length / (2 * (double)s->p->spacing))), marked = 0;
    int covered[64] = {0};

    for (int32_t i = 0; i < s->c->count; i++) {
        const cairn_oriented_point *p = &s->c->points[i];
        double c = cos((double)e->centre.theta), d = sin((double)e->centre.theta), n[2], o;
        double x = (double)(p->position.x - e->centre.x), y = (double)(p->position.y - e->centre.y);

        if (!slow_belongs(e, p, reach, (double)s->p->angle_tolerance))
            continue;
        o = slow_offset(e, (double)p->position.x, (double)p->position.y, n);
        w += (double)s->c->weights[i];
        off += (double)s->c->weights[i] * o * o;
        covered[(int)fmin(
            arcs - 1, (atan2((c * y - d * x) / b, (c * x + d * y) / a) / (2 * PI) + 0.5) * arcs)] =
            1;
    }
    for (int i = 0; i < arcs; i++)
        marked += covered[i];
    e->coverage = (cairn_real)marked / (cairn_real)arcs;
    e->votes = (cairn_real)w;
    e->rms = (cairn_real)sqrt(off / w);
    e->score = (cairn_real)((double)e->coverage * fmax(0, 1 - off / w / (reach * reach)));
}

static void slow_refine(struct slow *s, int32_t at)
{
    static const double shares[3] = {0.5, 0.25, 0.1};
    int32_t cells = s->p->cells;
    double tolerance = (double)s->p->angle_tolerance, wide = asin(fmin(1, 2 * sin(tolerance)));
    cairn_ellipse e =
        ellipse(s->corner_x + at % cells * s->cell, s->corner_y + at / cells % cells * s->cell, 0,
                0, 0, s->p->oriented ? at / (cells * cells) : CAIRN_ELLIPSE_ANY);

    e.half_length = e.half_width = (cairn_real)slow_radius(s, &e);
    for (int pass = 0; pass < 3; pass++)
        if (!slow_fit(s, &e,
                      fmax((double)s->p->support_distance, shares[pass] * (double)e.half_width),
                      pass == 0 ? wide : tolerance))
            return;
    slow_measure(s, &e);
    if (e.votes >= s->p->min_votes && e.coverage >= s->p->min_coverage)
        s->found[s->count++] = e;
}

/* All ellipses of a scene, before those on a stronger one are removed. */
static struct slow slow_search(const cairn_ellipse_params *p, const struct cloud *c)
{
    struct slow s;

    memset(&s, 0, sizeof s);
    s.p = p;
    s.c = c;
    slow_begin(&s);
    slow_vote(&s);
    for (int32_t i = 0; i < s.squares * p->cells * p->cells && s.count < MAX_COUNT; i++)
        if (slow_is_peak(&s, i))
            slow_refine(&s, i);
    free(s.raw);
    free(s.votes);
    return s;
}

/* An ellipse beside another: the axes of a circle may have any direction. */
static int is_near(const cairn_ellipse *a, const cairn_ellipse *b, double tolerance)
{
    double turn = remainder((double)(a->centre.theta - b->centre.theta), PI);

    if ((double)(b->half_length - b->half_width) < 0.05)
        turn = 0;
    return a->kind == b->kind && fabs((double)(a->centre.x - b->centre.x)) <= tolerance &&
           fabs((double)(a->centre.y - b->centre.y)) <= tolerance &&
           fabs((double)(a->half_length - b->half_length)) <= tolerance &&
           fabs((double)(a->half_width - b->half_width)) <= tolerance &&
           fabs(turn) <= 20 * tolerance;
}

static double uniform(cairn_random *random, double low, double high)
{
    return (double)cairn_random_uniform(random, (cairn_real)low, (cairn_real)high);
}

/* Partial ellipses, two or three; walls; and clutter. */
static struct cloud scene(uint64_t seed, double noise, cairn_ellipse truth[3], int *ellipses)
{
    cairn_random random = cairn_random_seed(seed, 5);
    struct cloud c;

    c.count = 0;
    *ellipses = 2 + (int)(seed % 2);
    for (int i = 0; i < *ellipses; i++) {
        double b = i == 1 ? uniform(&random, 0.3, 0.6) : uniform(&random, 1, 2.5),
               from = uniform(&random, 0, 6);

        truth[i] = ellipse(6 * i + uniform(&random, -1, 1), uniform(&random, -2, 2),
                           uniform(&random, 0, PI), b * uniform(&random, 1, 1.5), b, i == 1);
        add_arc(&c, &truth[i], from, from + uniform(&random, 4.4, 2 * PI), (int32_t)(b * 50));
    }
    add_wall(&c, -4, 5, 0.1, 80);
    add_wall(&c, 15, -5, 2, 60);
    for (int i = 0; i < 60; i++) {
        double angle = uniform(&random, 0, 2 * PI);

        add_scene_point(&c, uniform(&random, -4, 16), uniform(&random, -5, 6), cos(angle),
                        sin(angle));
    }
    for (int32_t i = 0; i < c.count; i++) {
        cairn_oriented_point *p = &c.points[i];
        double angle = atan2((double)p->direction.y, (double)p->direction.x) +
                       5 * noise * (double)cairn_random_normal(&random);

        p->position.x += (cairn_real)(noise * (double)cairn_random_normal(&random));
        p->position.y += (cairn_real)(noise * (double)cairn_random_normal(&random));
        p->direction.x = (cairn_real)cos(angle);
        p->direction.y = (cairn_real)sin(angle);
        c.weights[i] = (cairn_real)uniform(&random, 0.5, 1.5);
    }
    return c;
}

static void finds_what_the_reference_finds(void **state)
{
    cairn_ellipse_params params = cairn_ellipse_default();
    int32_t all = 0;

    (void)state;
    params.max_ellipses = MAX_COUNT;
    params.min_votes = 20;
    for (uint64_t seed = 1; seed <= 12; seed++) {
        cairn_ellipse truth[3];
        int ellipses;
        struct cloud c = scene(seed, 0.01, truth, &ellipses);
        struct fixture f;
        struct slow s;
        int32_t found;
        const cairn_ellipse *list;

        params.oriented = seed % 3 > 0;
        params.cells = seed % 2 ? 96 : 70; /* wider than params.cell */
        f = set_with(params);
        s = slow_search(&params, &c);
        list = search(f.set, &c, &found);
        all += found;
        for (int32_t i = 0; i < found; i++) {
            int32_t k = 0;

            while (k < s.count && !is_near(&list[i], &s.found[k], NUMBER(1e-7, 2e-2)))
                k++;
            assert_true(k < s.count);
            assert_near(list[i].votes, s.found[k].votes, NUMBER(1e-9, 3));
            assert_near(list[i].rms, s.found[k].rms, NUMBER(1e-8, 1e-2));
            assert_near(list[i].coverage, s.found[k].coverage, NUMBER(1e-9, 0.05));
            assert_near(list[i].score, s.found[k].score, NUMBER(1e-6, 0.1));
            if (i > 0)
                assert_true(list[i].votes <= list[i - 1].votes);
        }
        for (int32_t k = 0; k < s.count; k++) { /* the omitted ones lie on a stronger one */
            int32_t i = 0;

            while (i < found &&
                   !(list[i].kind == s.found[k].kind &&
                     fabs((double)(list[i].centre.x - s.found[k].centre.x)) < 0.3 &&
                     fabs((double)(list[i].half_length - s.found[k].half_length)) < 0.3))
                i++;
            assert_true(i < found);
        }
        test_pool_free(&f.pool);
    }
    assert_in_range(all, 20, 40);
}

/* Of 60 ellipses all but a few are found at the right place, and hardly any false one. */
static void finds_the_truth(void **state)
{
    cairn_ellipse_params params = cairn_ellipse_default();
    struct fixture f = set_with(params);
    int found_all = 0, there = 0, wrong = 0;

    (void)state;
    for (uint64_t seed = 101; seed <= 124; seed++) {
        cairn_ellipse truth[3];
        int ellipses;
        struct cloud c = scene(seed, 0.01, truth, &ellipses);
        int32_t found;
        const cairn_ellipse *list = search(f.set, &c, &found);

        there += ellipses;
        wrong += found;
        for (int i = 0; i < ellipses; i++)
            for (int32_t k = 0; k < found; k++)
                if (is_near(&list[k], &truth[i], 0.05)) {
                    found_all++;
                    wrong--;
                    break;
                }
    }
    assert_int_equal(there, 60);
    assert_true(found_all >= 56);
    assert_true(wrong <= 3);
    test_pool_free(&f.pool);
}

/* Without noise the conic is the ellipse itself; the small weight of the circle hardly changes
 * it. */
static void ellipses_without_noise(void **state)
{
    static const double ratios[] = {1, 1.2, 1.5};

    (void)state;
    for (int k = 0; k < 9; k++) {
        cairn_ellipse_params params = cairn_ellipse_default();
        struct fixture f;
        struct cloud c = {.count = 0};
        cairn_ellipse truth = ellipse(3, -2, 0.7, 1.5 * ratios[k % 3], 1.5, k / 3);
        int32_t found;
        const cairn_ellipse *list;

        params.oriented = truth.kind != CAIRN_ELLIPSE_ANY;
        f = set_with(params);
        add_arc(&c, &truth, 0, 2 * PI, 120);
        list = search(f.set, &c, &found);
        assert_int_equal(found, 1);
        assert_true(is_near(&list[0], &truth, 0.004));
        assert_near(list[0].coverage, 1, 0);
        assert_near(list[0].votes, 120, 1e-6);
        assert_true(list[0].score > (cairn_real)0.97 && list[0].rms < (cairn_real)0.005);
        assert_true(list[0].centre.theta >= 0 && list[0].centre.theta < CAIRN_PI);
        test_pool_free(&f.pool);
    }
}

/* Half a circle is found; a straight room has none; the params' limits hold. */
static void what_is_an_ellipse(void **state)
{
    cairn_ellipse_params params = cairn_ellipse_default();
    cairn_ellipse round = ellipse(0, 0, 0, 2, 2, CAIRN_ELLIPSE_ROOM);
    struct fixture f = set_with(params);
    struct cloud c = {.count = 0};
    int32_t found;
    const cairn_ellipse *list;

    (void)state;
    add_arc(&c, &round, 0, PI * 1.1, 60);
    list = search(f.set, &c, &found);
    assert_int_equal(found, 1);
    assert_true(is_near(&list[0], &round, 0.02));
    assert_near(list[0].coverage, 0.55, 0.03);
    c.count = 0;
    add_arc(&c, &round, 0, PI * 0.8, 60);
    (void)search(f.set, &c, &found);
    assert_int_equal(found, 0); /* too little of it */
    params.min_coverage = (cairn_real)0.35;
    assert_ok(cairn_ellipse_adjust(f.set, &params));
    (void)search(f.set, &c, &found);
    assert_int_equal(found, 1);
    params.min_votes = 61;
    assert_ok(cairn_ellipse_adjust(f.set, &params));
    (void)search(f.set, &c, &found);
    assert_int_equal(found, 0);
    params = cairn_ellipse_default();
    assert_ok(cairn_ellipse_adjust(f.set, &params));
    c.count = 0;
    add_wall(&c, -2, -2, 0, 40);
    add_wall(&c, 2, -2, PI / 2, 40);
    add_wall(&c, 2, 2, PI, 40);
    add_wall(&c, -2, 2, -PI / 2, 40);
    (void)search(f.set, &c, &found);
    assert_int_equal(found, 0); /* a square room */
    for (int k = 0; k < 4; k++) {
        cairn_ellipse e = ellipse(0, 0, 0.3, 1.8, 1.2, CAIRN_ELLIPSE_ROOM);

        c.count = 0;
        add_arc(&c, &e, 0, 2 * PI, 100);
        params = cairn_ellipse_default();
        if (k == 1)
            params.max_axis_ratio = (cairn_real)1.45;
        if (k == 2)
            params.max_radius = (cairn_real)1.75;
        if (k == 3)
            params.min_radius = (cairn_real)1.25;
        assert_ok(cairn_ellipse_adjust(f.set, &params));
        (void)search(f.set, &c, &found);
        assert_int_equal(found, k == 0);
    }
    test_pool_free(&f.pool);
}

/* The free side distinguishes rooms from columns; without it both are found. */
static void which_side_is_free(void **state)
{
    (void)state;
    for (int k = 0; k < 4; k++) {
        cairn_ellipse_params params = cairn_ellipse_default();
        cairn_ellipse e = ellipse(1, 1, 0, 1.2, 1.2, k % 2);
        struct fixture f;
        struct cloud c = {.count = 0};
        int32_t found;
        const cairn_ellipse *list;

        params.oriented = k < 2;
        f = set_with(params);
        add_arc(&c, &e, 0, 2 * PI, 80);
        list = search(f.set, &c, &found);
        assert_int_equal(found, 1);
        assert_int_equal(list[0].kind, k < 2 ? k : CAIRN_ELLIPSE_ANY);
        test_pool_free(&f.pool);
    }
}

/* When there are more centres than the capacity the highest are kept; those on a stronger one are
 * removed. */
static void the_strongest_are_kept(void **state)
{
    cairn_ellipse_params params = cairn_ellipse_default();
    struct fixture f;
    struct cloud c = {.count = 0};
    int32_t found;
    const cairn_ellipse *list;

    (void)state;
    params.max_ellipses = 2;
    params.min_votes = 30;
    f = set_with(params);
    for (int i = 0; i < 4; i++) {
        cairn_ellipse e = ellipse(3 * i, 0, 0, 0.8, 0.8, CAIRN_ELLIPSE_COLUMN);

        add_arc(&c, &e, 0, 2 * PI, 60 + 20 * ((i + 1) % 3));
    }
    list = search(f.set, &c, &found);
    assert_int_equal(found, 2);
    assert_near(list[0].centre.x, 3, 0.01);
    assert_near(list[0].votes, 100, 1e-6);
    assert_near(list[1].votes, 80, 1e-6);
    assert_true(cairn_ellipse_dropped(f.set) >= 2);
    c.count = 0;
    (void)search(f.set, &c, &found);
    assert_int_equal(found, 0);
    assert_int_equal(cairn_ellipse_dropped(f.set), 0);
    test_pool_free(&f.pool);
}

/* ---- Budgets ---- */

static void the_budget_does_not_matter(void **state)
{
    static const int32_t budgets[] = {CAIRN_UNBOUNDED, 1, 7, 1000};
    struct fixture f = set_with(cairn_ellipse_default());
    cairn_ellipse truth[3], first[32];
    int ellipses;
    struct cloud c = scene(3, 0.01, truth, &ellipses);
    int64_t units[4];
    int32_t count = 0;

    (void)state;
    for (int k = 0; k < 4; k++) {
        cairn_budget budget = {budgets[k]};
        const cairn_ellipse *list;
        int32_t found;

        units[k] = 0;
        assert_ok(cairn_ellipse_begin(f.set, c.points, c.weights, c.count));
        while (cairn_ellipse_step(f.set, &budget) == CAIRN_MORE) {
            assert_true(budget.left >= 0 && budget.left < budgets[k]);
            units[k] += budgets[k] - budget.left;
            budget.left = budgets[k];
        }
        units[k] += budgets[k] - budget.left;
        list = cairn_ellipse_list(f.set, &found);
        if (k == 0) {
            count = found;
            memcpy(first, list, (size_t)found * sizeof *list);
        }
        assert_int_equal(found, count);
        assert_memory_equal(list, first, (size_t)found * sizeof *list);
        assert_int_equal(units[k], units[0]);
    }
    assert_true(count >= 2);
    test_pool_free(&f.pool);
}

struct again {
    cairn_ellipse_set *set;
    const struct cloud *cloud;
};

static cairn_status begin_again(void *context)
{
    struct again *a = context;

    return cairn_ellipse_begin(a->set, a->cloud->points, a->cloud->weights, a->cloud->count);
}

static cairn_status step_again(void *context, cairn_budget *budget)
{
    return cairn_ellipse_step(((struct again *)context)->set, budget);
}

static uint64_t result_hash(void *context)
{
    int32_t count;
    const cairn_ellipse *list = cairn_ellipse_list(((struct again *)context)->set, &count);

    return test_hash(TEST_HASH_START, list, (size_t)count * sizeof *list);
}

static void can_be_begun_anew(void **state)
{
    struct fixture f = set_with(cairn_ellipse_default());
    cairn_ellipse truth[3];
    int ellipses;
    struct cloud c = scene(4, 0.01, truth, &ellipses);
    struct again again = {f.set, &c};
    test_stepped object = {begin_again, step_again, result_hash, &again};

    (void)state;
    test_begins_anew(&object, 12);
    test_pool_free(&f.pool);
}

/* ---- Shapes ---- */

static void shapes(void **state)
{
    (void)state;
    for (int k = 0; k < 6; k++) {
        cairn_ellipse e = ellipse(2, -1, 0.5 * k, 1.5, k < 3 ? 0.9 : 1.5, k % 3);
        double length = 0;
        cairn_oriented_point before = cairn_ellipse_point(&e, 0);

        for (int i = 1; i <= 720; i++) {
            cairn_oriented_point p = cairn_ellipse_point(&e, (cairn_real)(i * DEGREE / 2));
            cairn_vec2 run = cairn_vec2_sub(p.position, before.position), normal, off = p.position;
            double way = (double)cairn_vec2_norm(run);

            length += way;
            assert_near(cairn_vec2_dot(run, p.direction),
                        k % 3 == CAIRN_ELLIPSE_COLUMN ? -way : way, 1e-4);
            assert_near(cairn_ellipse_distance(&e, p.position, &normal), 0, NUMBER(1e-12, 2e-6));
            assert_near(cairn_vec2_dot(normal, p.direction), 0, NUMBER(1e-9, 1e-5));
            assert_true(cairn_ellipse_is_inlier(&e, &p, (cairn_real)0.01, (cairn_real)0.01));
            off = cairn_vec2_add(off, cairn_vec2_scale(normal, (cairn_real)0.02));
            assert_near(cairn_ellipse_distance(&e, off, &normal), 0.02, 2e-4);
            p.position = off;
            assert_true(cairn_ellipse_is_inlier(&e, &p, (cairn_real)0.021, (cairn_real)0.02));
            assert_false(cairn_ellipse_is_inlier(&e, &p, (cairn_real)0.019, (cairn_real)0.02));
            before.position = cairn_ellipse_point(&e, (cairn_real)(i * DEGREE / 2)).position;
            p.position = before.position;
            p.direction = cairn_vec2_scale(p.direction, -1);
            assert_int_equal(cairn_ellipse_is_inlier(&e, &p, (cairn_real)0.01, (cairn_real)0.01),
                             e.kind == CAIRN_ELLIPSE_ANY);
            p.direction = cairn_vec2_left_perp(p.direction);
            assert_false(cairn_ellipse_is_inlier(&e, &p, (cairn_real)0.01, (cairn_real)0.99));
        }
        assert_near(cairn_ellipse_length(&e), length, 2e-3);
    }
    {
        cairn_ellipse e = ellipse(2, -1, PI / 2, 1.5, 0.9, 0);
        cairn_vec2 centre = {2, -1}, normal;

        assert_near(cairn_ellipse_distance(&e, centre, &normal), -0.9, 1e-6);
        assert_near(normal.x, -1, 1e-6);
    }
}

/* A point rejected by its distance from the centre alone does not belong, however flat the ellipse
 * and wide the gate. */
static void distant_points_do_not_belong(void **state)
{
    cairn_random random = cairn_random_seed(31, 0);
    int32_t far = 0, belong = 0, outside = 0;

    (void)state;
    for (int32_t i = 0; i < 20000; i++) {
        cairn_real a = cairn_random_uniform(&random, CAIRN_REAL(0.5), 4);
        cairn_real b = a * cairn_random_uniform(&random, CAIRN_REAL(0.1), 1);
        cairn_ellipse e = {.half_length = a, .half_width = b, .kind = CAIRN_ELLIPSE_ANY};
        cairn_real distance =
            cairn_random_uniform(&random, 0, 1) * cairn_random_uniform(&random, 0, 30);
        cairn_ellipse_gate gate = cairn_ellipse_gate_of(&e, distance, 1);
        cairn_oriented_point p;
        cairn_vec2 normal;

        p.position.x = cairn_random_uniform(&random, -30, 30);
        p.position.y = cairn_random_uniform(&random, -30, 30);
        (void)cairn_ellipse_distance(&e, p.position, &normal);
        p.direction = cairn_vec2_left_perp(normal);
        if (cairn_ellipse_is_outside_gate(&gate, p.position)) {
            assert_false(cairn_ellipse_is_inlier(&e, &p, distance, 1));
            far++;
        } else {
            belong += cairn_ellipse_is_inlier(&e, &p, distance, 1);
            outside += !cairn_ellipse_is_inlier(&e, &p, distance, 1);
        }
    }
    assert_true(far > 5000 && belong > 1000 && outside > 100);
}

/* ---- Degenerate input and refusals ---- */

/* At the largest allowed distance and direction it still belongs. */
static void limits_belong_to_it(void **state)
{
    const cairn_ellipse e = {.half_length = 2, .half_width = 2, .kind = CAIRN_ELLIPSE_ANY};
    const cairn_oriented_point on = {{2, 0}, {0, 1}},
                               off = {{4, 0}, {CAIRN_REAL(0.6), CAIRN_REAL(0.8)}};

    (void)state;
    assert_true(cairn_ellipse_is_inlier(&e, &on, 0, 0));
    assert_true(cairn_ellipse_is_inlier(&e, &off, 2, CAIRN_REAL(0.6)));
    assert_false(cairn_ellipse_is_inlier(&e, &off, 2, CAIRN_REAL(0.59)));
    assert_false(cairn_ellipse_is_inlier(&e, &off, CAIRN_REAL(1.99), CAIRN_REAL(0.6)));
}

static void little_to_search(void **state)
{
    struct fixture f = set_with(cairn_ellipse_default());
    struct cloud c = {.count = 0};
    cairn_budget budget = {CAIRN_UNBOUNDED};
    int32_t found;

    (void)state;
    (void)search(f.set, &c, &found);
    assert_int_equal(found, 0);
    for (int i = 0; i < 50; i++)
        add_scene_point(&c, 1, 1, i % 2, 0); /* at one place, every other without a direction */
    (void)search(f.set, &c, &found);
    assert_int_equal(found, 0);
    c.count = 0;
    add_wall(&c, -1e6, 0, 0, 20);
    add_wall(&c, 999990, 999990, 1, 20); /* cells of 20 km */
    (void)search(f.set, &c, &found);
    assert_int_equal(found, 0);
    assert_ok(cairn_ellipse_begin(f.set, NULL, NULL, 0));
    assert_ok(cairn_ellipse_step(f.set, &budget));
    assert_ok(cairn_ellipse_step(f.set, &budget)); /* none was begun */
    test_pool_free(&f.pool);
}

/* Weights: one for each point; none; NULL. */
static void weights_count(void **state)
{
    struct fixture f = set_with(cairn_ellipse_default());
    cairn_ellipse e = ellipse(0, 0, 0, 1, 1, CAIRN_ELLIPSE_ROOM);
    struct cloud c = {.count = 0};
    cairn_budget budget = {CAIRN_UNBOUNDED};
    int32_t found;
    const cairn_ellipse *list;

    (void)state;
    add_arc(&c, &e, 0, 2 * PI, 70);
    for (int32_t i = 0; i < 70; i++)
        c.weights[i] = 3;
    list = search(f.set, &c, &found);
    assert_int_equal(found, 1);
    assert_near(list[0].votes, 210, 1e-3);
    assert_ok(cairn_ellipse_begin(f.set, c.points, NULL, c.count));
    assert_ok(cairn_ellipse_step(f.set, &budget));
    list = cairn_ellipse_list(f.set, &found);
    assert_int_equal(found, 1);
    assert_near(list[0].votes, 70, 1e-3);
    memset(c.weights, 0, sizeof c.weights);
    (void)search(f.set, &c, &found);
    assert_int_equal(found, 0);
    test_pool_free(&f.pool);
}

static void bad_points_are_refused(void **state)
{
    static const struct {
        double x, y, dx, dy, weight;
        cairn_status status;
    } bad[] = {
        {(double)NAN, 0, 1, 0, 1, CAIRN_NOT_FINITE},
        {0, (double)INFINITY, 1, 0, 1, CAIRN_NOT_FINITE},
        {0, 0, (double)NAN, 0, 1, CAIRN_NOT_FINITE},
        {0, 0, 0, (double)NAN, 1, CAIRN_NOT_FINITE},
        {0, 0, 1, 0, (double)NAN, CAIRN_NOT_FINITE},
        {1.1e6, 0, 1, 0, 1, CAIRN_BAD_ARGUMENT},
        {0, -1.1e6, 1, 0, 1, CAIRN_BAD_ARGUMENT},
        {0, 0, 1, 0, -1, CAIRN_BAD_ARGUMENT},
        {0, 0, 1, 0, 1.1e6, CAIRN_BAD_ARGUMENT},
    };
    struct fixture f = set_with(cairn_ellipse_default());
    cairn_ellipse e = ellipse(0, 0, 0, 1, 1, CAIRN_ELLIPSE_ROOM);
    struct cloud c = {.count = 0};
    int32_t found;

    (void)state;
    add_arc(&c, &e, 0, 2 * PI, 70);
    (void)search(f.set, &c, &found);
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        struct cloud worse = c;
        cairn_budget budget = {CAIRN_UNBOUNDED};

        add_scene_point(&worse, bad[k].x, bad[k].y, bad[k].dx, bad[k].dy);
        worse.weights[worse.count - 1] = (cairn_real)bad[k].weight;
        assert_ok(cairn_ellipse_begin(f.set, worse.points, worse.weights, worse.count));
        assert_status(cairn_ellipse_step(f.set, &budget), bad[k].status);
        assert_ok(cairn_ellipse_step(f.set, &budget)); /* given up */
        (void)cairn_ellipse_list(f.set, &found);
        assert_int_equal(found, 1);
    }
    test_pool_free(&f.pool);
}

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_ellipse_set *set;

    return cairn_ellipse_create(&set, pool, context);
}

static void bad_calls_are_refused(void **state)
{
    cairn_ellipse_params p = cairn_ellipse_default(), bad;
    cairn_pool pool = test_pool(cairn_ellipse_memory(&p));
    cairn_ellipse_set *set = NULL;
    cairn_object_fault fault;
    cairn_oriented_point point = {{0, 0}, {1, 0}};
    cairn_budget budget = {1};

    (void)state;
    assert_status(cairn_ellipse_create(&set, NULL, &p), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_ellipse_create(&set, &pool, &p));
    assert_int_equal(pool.used, cairn_ellipse_memory(&p));
    bad = p;
    bad.max_radius = bad.min_radius;
    assert_status(cairn_ellipse_check(&bad, &fault), CAIRN_BAD_ARGUMENT);
    assert_string_equal(fault.rule, "max_radius: above min_radius");
    assert_int_equal(cairn_ellipse_memory(&bad), 0);
    assert_status(cairn_ellipse_adjust(set, &bad), CAIRN_BAD_ARGUMENT);
    bad = p;
    bad.spacing = 0;
    assert_status(cairn_ellipse_adjust(set, &bad), CAIRN_BAD_ARGUMENT);
    for (int i = 0; i < 3; i++) {
        bad = p;
        bad.max_ellipses += i == 0;
        bad.cells += i == 1;
        bad.oriented = i != 2;
        assert_true(cairn_ellipse_memory(&bad) > 0);
        assert_status(cairn_ellipse_adjust(set, &bad), CAIRN_BAD_ARGUMENT);
    }
    bad = p;
    bad.min_radius = (cairn_real)0.1;
    bad.max_axis_ratio = 1;
    bad.min_coverage = 0;
    assert_ok(cairn_ellipse_adjust(set, &bad));
    bad.min_coverage = 1;
    bad.angle_tolerance = CAIRN_PI / 4;
    bad.max_radius = (cairn_real)1e6;
    assert_ok(cairn_ellipse_adjust(set, &bad));
    assert_status(cairn_ellipse_adjust(NULL, &p), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_ellipse_adjust(set, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_ellipse_begin(NULL, &point, NULL, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_ellipse_begin(set, NULL, NULL, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_ellipse_begin(set, &point, NULL, -1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_ellipse_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_ellipse_step(set, NULL), CAIRN_BAD_ARGUMENT);
    test_pool_free(&pool);
    p.cells = 8;
    p.max_ellipses = 2;
    test_every_pool_size(create, &p, cairn_ellipse_memory(&p));
}

/* A search that is abandoned because tolerances change leaves the last result. */
static void adjusting_gives_up(void **state)
{
    cairn_ellipse_params params = cairn_ellipse_default();
    struct fixture f = set_with(params);
    cairn_ellipse e = ellipse(0, 0, 0, 1, 1, CAIRN_ELLIPSE_ROOM);
    struct cloud c = {.count = 0};
    cairn_budget budget = {50};
    int32_t found;

    (void)state;
    add_arc(&c, &e, 0, 2 * PI, 70);
    (void)search(f.set, &c, &found);
    c.count = 0;
    add_wall(&c, 0, 0, 0, 40);
    assert_ok(cairn_ellipse_begin(f.set, c.points, c.weights, c.count));
    assert_status(cairn_ellipse_step(f.set, &budget), CAIRN_MORE);
    assert_ok(cairn_ellipse_adjust(f.set, &params));
    budget.left = CAIRN_UNBOUNDED;
    assert_ok(cairn_ellipse_step(f.set, &budget));
    assert_int_equal(budget.left, CAIRN_UNBOUNDED);
    (void)cairn_ellipse_list(f.set, &found);
    assert_int_equal(found, 1);
    test_pool_free(&f.pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(finds_what_the_reference_finds),
        cmocka_unit_test(finds_the_truth),
        cmocka_unit_test(ellipses_without_noise),
        cmocka_unit_test(what_is_an_ellipse),
        cmocka_unit_test(which_side_is_free),
        cmocka_unit_test(the_strongest_are_kept),
        cmocka_unit_test(the_budget_does_not_matter),
        cmocka_unit_test(can_be_begun_anew),
        cmocka_unit_test(shapes),
        cmocka_unit_test(distant_points_do_not_belong),
        cmocka_unit_test(limits_belong_to_it),
        cmocka_unit_test(little_to_search),
        cmocka_unit_test(weights_count),
        cmocka_unit_test(bad_points_are_refused),
        cmocka_unit_test(bad_calls_are_refused),
        cmocka_unit_test(adjusting_gives_up),
    };

    return cmocka_run_group_tests_name("ellipse", tests, NULL, NULL);
}
