/* Rectangles from segments, compared with all quadruples; exactly known scenes, capacities,
 * refusals. */
#include "tests/test.h"

#include <math.h>

#include "cairn/rectangle.h"

#define PI     3.14159265358979323846
#define DEGREE (PI / 180)

enum { ITEM_COUNT = 200, MAX_COUNT = 256 };

struct fixture {
    cairn_pool pool;
    cairn_rectangle_set *set;
};

static struct fixture set_with(cairn_rectangle_params params)
{
    struct fixture f;

    f.pool = test_pool(cairn_rectangle_memory(&params));
    assert_ok(cairn_rectangle_create(&f.set, &f.pool, &params));
    return f;
}

struct scene {
    cairn_segment segments[ITEM_COUNT];
    int32_t count;
};

/* In a frame at (x, y), rotated by `turn`. */
struct frame {
    double x, y, turn;
};

static cairn_vec2 placed(struct frame f, double x, double y)
{
    cairn_vec2 p = {(cairn_real)(f.x + x * cos(f.turn) - y * sin(f.turn)),
                    (cairn_real)(f.y + x * sin(f.turn) + y * cos(f.turn))};

    return p;
}

static void add(struct scene *s, struct frame f, double ax, double ay, double bx, double by)
{
    s->segments[s->count].a = placed(f, ax, ay);
    s->segments[s->count++].b = placed(f, bx, by);
}

/* The four walls of a room from (0, 0) to (w, h), counter-clockwise with the free side inside,
 * between two shares of each. */
static void add_room(struct scene *s, struct frame f, double w, double h, double from, double to)
{
    add(s, f, from * w, 0, to * w, 0);
    add(s, f, w, from * h, w, to * h);
    add(s, f, w - from * w, h, w - to * w, h);
    add(s, f, 0, h - from * h, 0, h - to * h);
}

static void turn_about(struct scene *s)
{
    for (int32_t i = 0; i < s->count; i++) {
        cairn_vec2 a = s->segments[i].a;

        s->segments[i].a = s->segments[i].b;
        s->segments[i].b = a;
    }
}

static const cairn_rectangle *search(cairn_rectangle_set *set, const struct scene *s,
                                     int32_t *found)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(cairn_rectangle_begin(set, s->segments, s->count));
    assert_ok(cairn_rectangle_step(set, &budget));
    return cairn_rectangle_list(set, found);
}

/* ---- Exactly known results ---- */

static void rooms_and_boxes(void **state)
{
    struct fixture f = set_with(cairn_rectangle_default());

    (void)state;
    for (int32_t degrees = -180; degrees < 180; degrees += 15) {
        struct frame at = {3, -2, degrees * DEGREE + 0.01};
        struct scene s = {.count = 0};
        const cairn_rectangle *r;
        double theta = at.turn - floor(at.turn / (PI / 2)) * PI / 2;
        int32_t found, across = (int32_t)floor(at.turn / (PI / 2)) & 1;
        cairn_vec2 centre = placed(at, 2, 1.5), corners[4];

        add_room(&s, at, 4, 3, 0, 1);
        for (int32_t box = 0; box < 2; box++) {
            r = search(f.set, &s, &found);
            assert_int_equal(found, 1);
            assert_int_equal(cairn_rectangle_dropped(f.set), 0);
            assert_int_equal(r->kind, box ? CAIRN_RECTANGLE_BOX : CAIRN_RECTANGLE_ROOM);
            assert_near(r->centre.x, centre.x, 1e-5);
            assert_near(r->centre.y, centre.y, 1e-5);
            assert_near(r->centre.theta, theta, 1e-5);
            assert_near(r->half_length, across ? 1.5 : 2, 1e-5);
            assert_near(r->half_width, across ? 2 : 1.5, 1e-5);
            assert_near(r->coverage, 1, 0);
            assert_near(r->score, 1, 1e-5);
            cairn_rectangle_corners(r, corners);
            for (int32_t i = 0; i < 4; i++) {
                double u = (double)(corners[i].x - r->centre.x) * cos(theta) +
                           (double)(corners[i].y - r->centre.y) * sin(theta);
                double v = (double)(corners[i].y - r->centre.y) * cos(theta) -
                           (double)(corners[i].x - r->centre.x) * sin(theta);

                assert_near(u, (i == 1 || i == 2 ? 1 : -1) * (double)r->half_length, 1e-5);
                assert_near(v, (i >= 2 ? 1 : -1) * (double)r->half_width, 1e-5);
            }
            turn_about(&s);
        }
    }
    test_pool_free(&f.pool);
}

/* The side of each number is where the header says. */
static void sides_are_reported(void **state)
{
    struct fixture f = set_with(cairn_rectangle_default());
    struct frame at = {0, 0, 0.3};
    struct scene s = {.count = 0};
    const cairn_rectangle *r;
    int32_t found;

    (void)state;
    add_room(&s, at, 5, 3, 0, 1);
    /* Sides are numbered by length: upper, lower, left, right. */
    s.segments[0].b = placed(at, 4.9, 0);
    s.segments[1].b = placed(at, 5, 2.8);
    s.segments[3].b = placed(at, 0, 0.1);
    r = search(f.set, &s, &found);
    assert_int_equal(found, 1);
    assert_int_equal(r->side[0], 1);
    assert_int_equal(r->side[1], 0);
    assert_int_equal(r->side[2], 2);
    assert_int_equal(r->side[3], 3);
    assert_near(r->coverage, (5 + 4.9 + 2.8 + 2.9) / 16, 0.02);
    test_pool_free(&f.pool);
}

/* Sides as several segments, each from another scan and slightly displaced. */
static void segments_are_merged(void **state)
{
    struct fixture f = set_with(cairn_rectangle_default());
    struct frame at = {1, 1, 0.2};
    struct scene s = {.count = 0};
    const cairn_rectangle *r;
    int32_t found;

    (void)state;
    add(&s, at, 0, 0.02, 1, 0.02);
    add(&s, at, 0.5, -0.02, 2.5, -0.01);
    add(&s, at, 3, 0.01, 4, 0.02);
    add(&s, at, 4, 0, 4, 3);
    add(&s, at, 4, 3, 2, 3);
    add(&s, at, 0.01, 3, 0.02, 1.4);
    add(&s, at, -0.02, 1.4, 0, 0);
    r = search(f.set, &s, &found);
    assert_int_equal(found, 1);
    assert_near(r->coverage, (3.5 + 3 + 2 + 3) / 14, 0.02);
    assert_near(r->half_length, 2, 0.02);
    assert_near(r->half_width, 1.5, 0.02);
    assert_true(r->score > CAIRN_REAL(0.7) && r->score <= r->coverage);
    test_pool_free(&f.pool);
}

/* The position of a side is the mean of its segments, weighted by length. */
static void sides_are_weighed(void **state)
{
    struct fixture f = set_with(cairn_rectangle_default());
    struct frame at = {0, 0, 0.6};
    struct scene s = {.count = 0};
    const cairn_rectangle *r;
    int32_t found;

    (void)state;
    add_room(&s, at, 4, 3, 0, 1);
    s.count--;
    add(&s, at, 0, 2.5, 0, 0.5);
    add(&s, at, 0.06, 2, 0.06, 1);
    add(&s, at, 0.06, 2, 0.06, 1);
    add(&s, at, -0.06, 1.75, -0.06, 1.25);
    r = search(f.set, &s, &found);
    assert_int_equal(found, 1);
    assert_near(2 * r->half_length, 4 - (0.06 + 0.06 - 0.03) / 4.5, NUMBER(1e-9, 1e-5));
    assert_near(2 * r->half_width, 3, NUMBER(1e-9, 1e-5));
    test_pool_free(&f.pool);
}

/* Walls of both kinds in one room, which directions would separate. */
static void directions_count_or_do_not(void **state)
{
    cairn_rectangle_params p = cairn_rectangle_default();
    struct fixture oriented = set_with(p), lines;
    struct frame at = {0, 0, 1};
    struct scene s = {.count = 0};
    const cairn_rectangle *r;
    cairn_vec2 a;
    int32_t found;

    (void)state;
    p.oriented = 0;
    lines = set_with(p);
    add_room(&s, at, 4, 3, 0, 1);
    a = s.segments[1].a;
    s.segments[1].a = s.segments[1].b;
    s.segments[1].b = a;
    (void)search(oriented.set, &s, &found);
    assert_int_equal(found, 0);
    r = search(lines.set, &s, &found);
    assert_int_equal(found, 1);
    assert_int_equal(r->kind, CAIRN_RECTANGLE_ANY);
    assert_near(r->score, 1, 1e-5);
    /* A segment against the direction of its side joins it only there. */
    s.segments[1].b = s.segments[1].a;
    s.segments[1].a = a;
    s.segments[2].b = placed(at, 2, 3);
    add(&s, at, 0, 3, 2, 3);
    r = search(lines.set, &s, &found);
    assert_near(r->coverage, 1, 0);
    r = search(oriented.set, &s, &found);
    assert_int_equal(found, 1);
    assert_near(r->coverage, 12. / 14, 0.01);
    test_pool_free(&oriented.pool);
    test_pool_free(&lines.pool);
}

/* Params one by one: just within, just beyond. */
static void limits(void **state)
{
    static const struct {
        const char *what;
        double value[2];
        int32_t found[2];
    } cases[] = {
        {"cover", {0.51, 0.49}, {1, 0}},    /* of each side */
        {"one side", {0.16, 0.13}, {1, 0}}, /* the others whole */
        {"short", {0.31, 0.29}, {1, 0}},    /* m */
        {"skew", {7.5, 8.5}, {1, 0}},       /* degrees, of one side */
    };

    (void)state;
    for (int32_t k = 0; k < 8; k++) {
        struct fixture f = set_with(cairn_rectangle_default());
        struct frame at = {5, 5, 0.7};
        struct scene s = {.count = 0};
        double value = cases[k / 2].value[k % 2];
        int32_t found;

        if (k / 2 == 0) {
            add_room(&s, at, 4, 3, 0, value);
        } else if (k / 2 == 1) {
            add_room(&s, at, 4, 3, 0, 1);
            s.segments[1].b = placed(at, 4, 3 * value);
        } else if (k / 2 == 2) {
            add_room(&s, at, 1, value, 0, 1);
        } else {
            add_room(&s, at, 4, 3, 0, 1);
            s.segments[1].a = placed(at, 4 - 0.5 * tan(value * DEGREE), 1);
            s.segments[1].b = placed(at, 4 + 0.5 * tan(value * DEGREE), 2);
        }
        (void)search(f.set, &s, &found);
        if (found != cases[k / 2].found[k % 2])
            fail_msg("%s %g: found %d", cases[k / 2].what, value, (int)found);
        test_pool_free(&f.pool);
    }
}

/* Less strength for skew: sides off by half of the angle lose an eighth. */
static void skew_costs_strength(void **state)
{
    struct fixture f = set_with(cairn_rectangle_default());
    struct frame at = {0, 0, 0.2};
    struct scene s = {.count = 0};
    double off = tan(4 * DEGREE);
    const cairn_rectangle *r;
    int32_t found;

    (void)state;
    /* A rhomb, whose angles are off by 8 degrees. */
    add(&s, at, 0, 0, 3, 3 * off);
    add(&s, at, 3, 3 * off, 3 + 3 * off, 3 + 3 * off);
    add(&s, at, 3 + 3 * off, 3 + 3 * off, 3 * off, 3);
    add(&s, at, 3 * off, 3, 0, 0);
    r = search(f.set, &s, &found);
    assert_int_equal(found, 1);
    assert_near(r->score / r->coverage, 1 - 0.5 * 0.25, 0.01);
    test_pool_free(&f.pool);
}

static void near_ones_are_one(void **state)
{
    cairn_rectangle_params p = cairn_rectangle_default();
    struct frame at = {0, 0, 0.4};

    (void)state;
    for (int32_t apart = 15; apart <= 45; apart += 10) {
        struct fixture f = set_with(p);
        struct scene s = {.count = 0};
        struct frame beside = {apart * 0.01 * cos(0.4 + 1.1), apart * 0.01 * sin(0.4 + 1.1), 0.4};
        const cairn_rectangle *r;
        int32_t found, exact = 0;

        add_room(&s, at, 4, 3, 0, 1);
        add_room(&s, beside, 4, 3, 0, 0.9);
        r = search(f.set, &s, &found);
        for (int32_t i = 0; i < found; i++)
            exact += r[i].coverage > CAIRN_REAL(0.99);
        assert_true(exact >= 1);
        assert_near(r[0].coverage, 1, 0.01);
        if (apart <= 25)
            assert_int_equal(found, 1);
        else
            assert_true(found > 1);
        for (int32_t i = 1; i < found; i++)
            assert_true(r[i].score <= r[i - 1].score);
        test_pool_free(&f.pool);
    }
}

/* ---- Reference implementation: all quadruples of segments ---- */

struct slow {
    double x, y, theta, length, width, covered, strength;
    int32_t kind;
};

struct slow_side {
    double mx, my, dx, dy, length;
};

static struct slow_side slow_side_of(cairn_segment s)
{
    double dx = (double)s.b.x - (double)s.a.x, dy = (double)s.b.y - (double)s.a.y,
           length = hypot(dx, dy);
    struct slow_side side = {((double)s.a.x + (double)s.b.x) / 2,
                             ((double)s.a.y + (double)s.b.y) / 2, dx / length, dy / length, length};

    return side;
}

/* Intersection of two lines. */
static void meet(const struct slow_side *s, const struct slow_side *t, double *x, double *y)
{
    double det = s->dx * t->dy - s->dy * t->dx;
    double along = ((t->mx - s->mx) * t->dy - (t->my - s->my) * t->dx) / det;

    *x = s->mx + along * s->dx;
    *y = s->my + along * s->dy;
}

/* Length of a side from p to q that a segment covers. */
static double share_of(const struct slow_side *s, double px, double py, double qx, double qy)
{
    double length = hypot(qx - px, qy - py), ux = (qx - px) / length, uy = (qy - py) / length;
    double middle = (s->mx - px) * ux + (s->my - py) * uy,
           half = s->length / 2 * fabs(s->dx * ux + s->dy * uy);

    return fmax(fmin(middle + half, length) - fmax(middle - half, 0), 0) / length;
}

/* The quadrangle of lower, right, upper, left lines, when it is a rectangle by the params. */
static int slow_rectangle(const cairn_rectangle_params *p, const struct slow_side *of[4],
                          struct slow *r)
{
    double x[4], y[4], share[4], worst = 0, length, width, c = 0, s = 0, theta, sum;

    for (int i = 0; i < 4; i++) {
        double angle = atan2(of[i]->dy, of[i]->dx);

        c += of[i]->length * cos(4 * angle);
        s += of[i]->length * sin(4 * angle);
    }
    theta = atan2(s, c) / 4;
    theta += theta < 0 ? PI / 2 : 0;
    for (int i = 0; i < 4; i++)
        worst = fmax(worst, fabs(remainder(atan2(of[i]->dy, of[i]->dx) - theta, PI / 2)));
    if (sin(worst) > sin((double)p->max_angle_error))
        return 0;
    for (int i = 0; i < 4; i++)
        /* lower right, upper right, upper left, lower left */
        meet(of[i], of[(i + 1) % 4], &x[i], &y[i]);
    length = (hypot(x[0] - x[3], y[0] - y[3]) + hypot(x[1] - x[2], y[1] - y[2])) / 2;
    width = (hypot(x[1] - x[0], y[1] - y[0]) + hypot(x[2] - x[3], y[2] - y[3])) / 2;
    if (fmin(length, width) < (double)p->min_side)
        return 0;
    for (int i = 0; i < 4; i++) {
        share[i] = share_of(of[i], x[(i + 3) % 4], y[(i + 3) % 4], x[i], y[i]);
        if (share[i] < (double)p->min_side_coverage)
            return 0;
    }
    sum = (share[0] + share[2]) * length + (share[1] + share[3]) * width;
    r->covered = sum / (2 * (length + width));
    r->strength = r->covered * (1 - pow(sin(worst) / sin((double)p->max_angle_error), 2) / 2);
    r->x = (x[0] + x[1] + x[2] + x[3]) / 4;
    r->y = (y[0] + y[1] + y[2] + y[3]) / 4;
    r->length = length;
    r->width = width;
    r->theta = theta;
    return r->covered >= (double)p->min_coverage;
}

/* 1: the free sides of all four are inside; 2: outside; 0: neither. */
static int inside_or_out(const struct slow_side *of[4])
{
    double x = 0, y = 0;
    int in = 0;

    for (int i = 0; i < 4; i++) {
        double cx, cy;

        meet(of[i], of[(i + 1) % 4], &cx, &cy);
        x += cx / 4;
        y += cy / 4;
    }
    for (int i = 0; i < 4; i++)
        in += of[i]->dx * (y - of[i]->my) - of[i]->dy * (x - of[i]->mx) > 0;
    return in == 4 ? 1 : in == 0 ? 2 : 0;
}

/* Opposite sides have opposite senses when both are free on the same side of the outline. */
static int slow_quadruples(const cairn_rectangle_params *p, const struct scene *scene,
                           struct slow *found)
{
    static struct slow_side side[ITEM_COUNT];
    int32_t n = scene->count, count = 0;

    for (int32_t i = 0; i < n; i++)
        side[i] = slow_side_of(scene->segments[i]);
    for (int32_t i = 0; i < n; i++)
        for (int32_t k = i + 1; k < n; k++) {
            if (fabs(side[i].dx * side[k].dx + side[i].dy * side[k].dy) <
                cos((double)p->max_angle_error))
                continue;
            for (int32_t j = 0; j < n; j++)
                for (int32_t l = j + 1; l < n; l++) {
                    const struct slow_side *of[4] = {&side[i], &side[j], &side[k], &side[l]};
                    int free_side;

                    if (i > j ||
                        fabs(side[j].dx * side[l].dx + side[j].dy * side[l].dy) <
                            cos((double)p->max_angle_error) ||
                        fabs(side[i].dx * side[j].dx + side[i].dy * side[j].dy) > 0.5)
                        continue;
                    free_side = inside_or_out(of);
                    if (free_side == 0 || !slow_rectangle(p, of, &found[count]))
                        continue;
                    found[count].kind = free_side == 1 ? CAIRN_RECTANGLE_ROOM : CAIRN_RECTANGLE_BOX;
                    count++;
                    assert_true(count < MAX_COUNT);
                }
        }
    return count;
}

/* Whether the two are one rectangle: centre, and sides along theta and across it. */
static int is_slow(const cairn_rectangle *r, const struct slow *s)
{
    double size = fmin(
        fabs(2 * (double)r->half_length - s->length) + fabs(2 * (double)r->half_width - s->width),
        fabs(2 * (double)r->half_length - s->width) + fabs(2 * (double)r->half_width - s->length));

    return r->kind == s->kind &&
           hypot((double)r->centre.x - s->x, (double)r->centre.y - s->y) < 0.05 && size < 0.1 &&
           fabs(remainder((double)r->centre.theta - s->theta, PI / 2)) < 1e-3 &&
           fabs((double)r->coverage - s->covered) < 0.04 &&
           fabs((double)r->score - s->strength) < 0.05;
}

/* Random walls in two directions, some off by a few degrees, none near enough to another to be
 * merged. */
static void scatter(struct scene *s, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 0);
    struct frame at = {2, 1, 0};
    double most = seed % 2 != 0 ? 2 * DEGREE : 0.5 * DEGREE;

    at.turn = (double)cairn_random_uniform(&random, 0, (cairn_real)PI);
    s->count = 0;
    for (int32_t i = 0; i < 24; i++) {
        struct frame wall = at;
        int32_t row = i / 2;
        double from = (double)cairn_random_uniform(&random, -4, 2), offset = -4 + 0.7 * row;
        double length = (double)cairn_random_uniform(&random, 1, 5);
        double off = (double)cairn_random_uniform(&random, (cairn_real)-most, (cairn_real)most);
        double dx = length * cos(off), dy = length * sin(off);

        wall.turn += i % 2 * PI / 2;
        if (cairn_random_below(&random, 2) != 0)
            add(s, wall, from, offset, from + dx, offset + dy);
        else
            add(s, wall, from + dx, offset + dy, from, offset);
    }
}

static void finds_what_all_quadruples_give(void **state)
{
    static struct slow slow[MAX_COUNT];
    int32_t seen = 0;

    (void)state;
    for (uint64_t seed = 1; seed <= 8; seed++) {
        cairn_rectangle_params p = cairn_rectangle_default(), more;
        struct scene s;
        struct fixture f;
        const cairn_rectangle *fast;
        int32_t found, count;

        p.separation = CAIRN_REAL(1e-6);
        p.max_rectangles = MAX_COUNT;
        more = p;
        more.min_coverage = p.min_coverage - CAIRN_REAL(0.04);
        more.min_side_coverage = p.min_side_coverage - CAIRN_REAL(0.04);
        f = set_with(p);
        scatter(&s, seed);
        fast = search(f.set, &s, &found);
        assert_int_equal(cairn_rectangle_dropped(f.set), 0);
        seen += found;
        count = slow_quadruples(&more, &s, slow);
        for (int32_t i = 0; i < found; i++) {
            int32_t same = 0;

            for (int32_t j = 0; j < count; j++)
                same += is_slow(&fast[i], &slow[j]);
            assert_int_equal(same, 1);
        }
        more.min_coverage = p.min_coverage + CAIRN_REAL(0.04);
        more.min_side_coverage = p.min_side_coverage + CAIRN_REAL(0.04);
        count = slow_quadruples(&more, &s, slow);
        for (int32_t j = 0; j < count; j++) {
            int32_t same = 0;

            for (int32_t i = 0; i < found; i++)
                same += is_slow(&fast[i], &slow[j]);
            assert_int_equal(same, 1);
        }
        test_pool_free(&f.pool);
    }
    assert_true(seen > 40);
}

/* ---- The bits ---- */

/* Quarters of metres, so that lengths, gaps and distances tie and equal the params' limits. */
static double quarter(cairn_random *random, int32_t below)
{
    return 0.25 * cairn_random_below(random, below);
}

/* Rooms and boxes as several segments, isolated walls and doubled ones, along the axes or all
 * slightly rotated. */
static void draw_quarters(struct scene *s, cairn_random *random)
{
    struct frame at = {0, 0, 0};
    int32_t pieces = 12 + cairn_random_below(random, 20);
    cairn_pose pose = {
        0, 0, cairn_random_below(random, 3) == 0 ? cairn_random_uniform(random, -4, 4) : 0};

    s->count = 0;
    for (int32_t i = 0; i < 3; i++) {
        double w = 0.5 + quarter(random, 12);
        double h = 0.5 + quarter(random, 12);
        double to = 0.25 + quarter(random, 4);
        struct frame room = at;

        room.x = quarter(random, 17);
        room.y = quarter(random, 17);
        add_room(s, room, w, h, 0, to);
        if (cairn_random_below(random, 2) == 0)
            turn_about(s);
    }
    for (int32_t i = 0; i < pieces; i++) {
        double x = quarter(random, 20);
        double y = quarter(random, 20);
        double length = quarter(random, 14) - 1.5;
        double askew =
            cairn_random_below(random, 3) == 0 ? 0.25 * (cairn_random_below(random, 3) - 1) : 0;

        if (cairn_random_below(random, 2) == 0)
            add(s, at, x, y, x + length, y + askew);
        else
            add(s, at, x, y, x + askew, y + length);
    }
    for (int32_t i = 0; i < 4; i++, s->count++)
        s->segments[s->count] = s->segments[cairn_random_below(random, s->count)];
    for (int32_t i = 0; i < s->count; i++) {
        s->segments[i].a = cairn_transform_point(cairn_transform_of(pose), s->segments[i].a);
        s->segments[i].b = cairn_transform_point(cairn_transform_of(pose), s->segments[i].b);
    }
}

static uint64_t add_real(uint64_t hash, cairn_real x)
{
    assert_true(x == x);
    return test_hash(hash, &x, sizeof x);
}

static uint64_t add_found(const cairn_rectangle_set *set, uint64_t hash)
{
    int32_t found, dropped;
    const cairn_rectangle *r;

    r = cairn_rectangle_list(set, &found);
    dropped = cairn_rectangle_dropped(set);
    hash = test_hash(hash, &found, sizeof found);
    hash = test_hash(hash, &dropped, sizeof dropped);
    for (int32_t i = 0; i < found; i++) {
        cairn_vec2 corners[4];

        cairn_rectangle_corners(&r[i], corners);
        for (int32_t k = 0; k < 4; k++)
            hash = add_real(add_real(hash, corners[k].x), corners[k].y);
        hash = add_real(add_real(hash, r[i].centre.theta), r[i].coverage);
        hash = add_real(hash, r[i].score);
        hash = test_hash(hash, r[i].side, sizeof r[i].side);
        hash = test_hash(hash, &r[i].kind, sizeof r[i].kind);
    }
    return hash;
}

static uint64_t hash_of_search(cairn_rectangle_set *set, const struct scene *s, uint64_t hash)
{
    cairn_budget budget = {1 << 28};

    assert_ok(cairn_rectangle_begin(set, s->segments, s->count));
    assert_ok(cairn_rectangle_step(set, &budget));
    return add_found(set, test_hash(hash, &budget.left, sizeof budget.left));
}

/* Params whose limits are the scenes' quarters, and capacities too small for some. */
static cairn_rectangle_params draw_params(cairn_random *random)
{
    cairn_rectangle_params p = cairn_rectangle_default();

    p.merge_distance = CAIRN_REAL(0.125) * (cairn_real)(1 + cairn_random_below(random, 2));
    p.merge_gap = CAIRN_REAL(0.25) * (cairn_real)cairn_random_below(random, 5);
    p.min_side = CAIRN_REAL(0.5);
    p.min_side_coverage = CAIRN_REAL(0.125) * (cairn_real)cairn_random_below(random, 3);
    p.min_coverage = CAIRN_REAL(0.125) * (cairn_real)(2 + cairn_random_below(random, 3));
    p.separation = CAIRN_REAL(0.25) * (cairn_real)(1 + cairn_random_below(random, 3));
    p.max_rectangles = 2 + cairn_random_below(random, 30);
    p.max_sides = 24 + cairn_random_below(random, 16);
    p.max_pairs = 60 + cairn_random_below(random, 200);
    return p;
}

static uint64_t hash_of_scenes(int32_t oriented)
{
    uint64_t hash = TEST_HASH_START;
    cairn_random random = cairn_random_seed(5, 0);

    for (int32_t i = 0; i < 150; i++) {
        cairn_rectangle_params p = draw_params(&random);
        struct fixture f;

        p.oriented = oriented;
        f = set_with(p);
        for (int32_t k = 0; k < 2; k++) { /* the second must not see the first */
            struct scene s;

            draw_quarters(&s, &random);
            hash = hash_of_search(f.set, &s, hash);
        }
        test_pool_free(&f.pool);
    }
    return hash;
}

static void all_bits_are_kept(void **state)
{
    (void)state;
    assert_golden(hash_of_scenes(0), UINT64_C(0xdcf6ed3321ce8bc3), UINT64_C(0x0aae2396c984f286));
    assert_golden(hash_of_scenes(1), UINT64_C(0xd9a1795573756b90), UINT64_C(0x7655974030bb6995));
}

/* ---- Steps, statuses, memory ---- */

static void the_budget_does_not_matter(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    static cairn_rectangle whole[MAX_COUNT];
    struct fixture f = set_with(cairn_rectangle_default());
    const cairn_rectangle *list;
    struct scene s;
    int32_t found, count;

    (void)state;
    scatter(&s, 2);
    list = search(f.set, &s, &count);
    assert_true(count > 4);
    memcpy(whole, list, (size_t)count * sizeof *whole);
    for (int i = 0; i < 3; i++) {
        cairn_budget budget = {0};
        cairn_status status;
        int64_t units = 0;

        assert_ok(cairn_rectangle_begin(f.set, s.segments, s.count));
        assert_status(cairn_rectangle_step(f.set, &budget), CAIRN_MORE);
        do {
            budget.left = budgets[i];
            status = cairn_rectangle_step(f.set, &budget);
            assert_true(budget.left >= 0);
            units += budgets[i] - budget.left;
        } while (status == CAIRN_MORE);
        assert_ok(status);
        list = cairn_rectangle_list(f.set, &found);
        assert_int_equal(found, count);
        for (int32_t k = 0; k < count; k++) {
            assert_near(list[k].centre.x, whole[k].centre.x, 0);
            assert_near(list[k].score, whole[k].score, 0);
            assert_memory_equal(list[k].side, whole[k].side, sizeof whole[k].side);
        }
        assert_int_equal(units, NUMBER(0x10af, 0x11bc));
        assert_ok(cairn_rectangle_step(f.set, &budget)); /* nothing left to do */
    }
    test_pool_free(&f.pool);
}

struct under_way {
    cairn_rectangle_set *set;
    struct scene scene;
};

static cairn_status begin_scene(void *context)
{
    struct under_way *u = context;

    return cairn_rectangle_begin(u->set, u->scene.segments, u->scene.count);
}

static cairn_status step_scene(void *context, cairn_budget *budget)
{
    return cairn_rectangle_step(((struct under_way *)context)->set, budget);
}

static uint64_t hash_scene(void *context)
{
    return add_found(((struct under_way *)context)->set, TEST_HASH_START);
}

static void begins_anew(void **state)
{
    cairn_rectangle_params p = cairn_rectangle_default();
    struct fixture f;
    struct under_way u;
    test_stepped object = {begin_scene, step_scene, hash_scene, &u};

    (void)state;
    p.max_pairs = 100;
    p.max_sides = 22;
    f = set_with(p);
    u.set = f.set;
    scatter(&u.scene, 2);
    test_begins_anew(&object, 200);
    test_pool_free(&f.pool);
}

static void capacities(void **state)
{
    cairn_rectangle_params p = cairn_rectangle_default();
    struct scene s = {.count = 0};
    struct fixture f;
    const cairn_rectangle *r;
    int32_t found;

    (void)state;
    /* Three rooms, none beside another, the second with the most coverage. */
    for (int32_t i = 0; i < 3; i++) {
        struct frame room = {6.0 * i, 6.0 * i, 0.2};

        add_room(&s, room, 4, 3, 0, i == 0 ? 0.7 : i == 1 ? 1 : 0.8);
    }
    p.merge_gap = 1;
    f = set_with(p);
    r = search(f.set, &s, &found);
    assert_int_equal(found, 3);
    assert_int_equal(cairn_rectangle_dropped(f.set), 0);
    assert_near(r[0].coverage, 1, 0.01);
    assert_near(r[1].coverage, 0.8, 0.01);
    assert_near(r[2].coverage, 0.7, 0.02);
    test_pool_free(&f.pool);
    p.max_rectangles = 1;
    f = set_with(p);
    r = search(f.set, &s, &found);
    assert_int_equal(found, 1);
    assert_int_equal(cairn_rectangle_dropped(f.set), 2);
    assert_near(r[0].coverage, 1, 0.01);
    test_pool_free(&f.pool);
    /* The longest walls become the sides that fit the capacity: of the second room all, of the
     * third the long ones. */
    p.max_rectangles = 3;
    p.max_sides = 7;
    f = set_with(p);
    r = search(f.set, &s, &found);
    assert_int_equal(found, 1);
    assert_int_equal(cairn_rectangle_dropped(f.set), 5);
    assert_near(r[0].coverage, 1, 0.01);
    test_pool_free(&f.pool);
    p.max_sides = 12;
    p.max_pairs = 3;
    f = set_with(p);
    (void)search(f.set, &s, &found);
    assert_true(cairn_rectangle_dropped(f.set) > 0);
    test_pool_free(&f.pool);
    p.max_segments = 11;
    f = set_with(p);
    assert_status(cairn_rectangle_begin(f.set, s.segments, s.count), CAIRN_FULL);
    assert_ok(cairn_rectangle_begin(f.set, s.segments, 11));
    test_pool_free(&f.pool);
}

static void little_or_nothing(void **state)
{
    struct fixture f = set_with(cairn_rectangle_default());
    struct frame at = {0, 0, 0};
    struct scene s = {.count = 0};
    cairn_budget budget = {CAIRN_UNBOUNDED};
    int32_t found;

    (void)state;
    (void)cairn_rectangle_list(f.set, &found);
    assert_int_equal(found, 0);
    assert_ok(cairn_rectangle_step(f.set, &budget));
    assert_ok(cairn_rectangle_begin(f.set, NULL, 0));
    assert_ok(cairn_rectangle_step(f.set, &budget));
    (void)cairn_rectangle_list(f.set, &found);
    assert_int_equal(found, 0);
    /* Points are no sides; parallels alone are no rectangle, many of one slope each count as a pair
     * once. */
    for (int32_t i = 0; i < 5; i++)
        add(&s, at, i, i, i, i);
    for (int32_t i = 0; i < 6; i++)
        add(&s, at, i % 2 * 3, i, 3 - i % 2 * 3, i);
    (void)search(f.set, &s, &found);
    assert_int_equal(found, 0);
    s.count = 0;
    add_room(&s, at, 3, 3, 0, 1);
    add(&s, at, 1, 1, 1, 1);
    (void)search(f.set, &s, &found);
    assert_int_equal(found, 1);
    test_pool_free(&f.pool);
}

static void bad_segments_are_refused(void **state)
{
    struct fixture f = set_with(cairn_rectangle_default());
    static const struct {
        int field;
        double value;
        cairn_status status;
    } bad[] = {{0, (double)NAN, CAIRN_NOT_FINITE}, {1, (double)INFINITY, CAIRN_NOT_FINITE},
               {2, (double)NAN, CAIRN_NOT_FINITE}, {3, -(double)INFINITY, CAIRN_NOT_FINITE},
               {0, 1.1e6, CAIRN_BAD_ARGUMENT},     {1, -1.1e6, CAIRN_BAD_ARGUMENT},
               {2, 1.1e6, CAIRN_BAD_ARGUMENT},     {3, -1.1e6, CAIRN_BAD_ARGUMENT}};
    struct frame at = {0, 0, 0.5};
    struct scene s = {.count = 0};
    int32_t found;

    (void)state;
    add_room(&s, at, 3, 2, 0, 1);
    (void)search(f.set, &s, &found);
    assert_int_equal(found, 1);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        struct scene copy = s;
        cairn_budget budget = {CAIRN_UNBOUNDED};
        cairn_real *fields[] = {&copy.segments[2].a.x, &copy.segments[2].a.y, &copy.segments[2].b.x,
                                &copy.segments[2].b.y};

        *fields[bad[i].field] = (cairn_real)bad[i].value;
        assert_ok(cairn_rectangle_begin(f.set, copy.segments, copy.count));
        assert_status(cairn_rectangle_step(f.set, &budget), bad[i].status);
        assert_ok(cairn_rectangle_step(f.set, &budget));
        (void)cairn_rectangle_list(f.set, &found);
        assert_int_equal(found, 1);
    }
    assert_status(cairn_rectangle_begin(NULL, s.segments, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_rectangle_begin(f.set, NULL, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_rectangle_begin(f.set, s.segments, -1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_rectangle_step(f.set, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_rectangle_step(NULL, NULL), CAIRN_BAD_ARGUMENT);
    test_pool_free(&f.pool);
}

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_rectangle_set *set;

    return cairn_rectangle_create(&set, pool, context);
}

static void memory_is_exact(void **state)
{
    cairn_rectangle_params p = cairn_rectangle_default();

    (void)state;
    p.max_segments = 9;
    p.max_sides = 5;
    p.max_pairs = 7;
    p.max_rectangles = 3;
    test_every_pool_size(create, &p, cairn_rectangle_memory(&p));
    for (int32_t n = 1; n <= 256; n = 2 * n + 1) {
        p.max_segments = 5 * n;
        p.max_sides = 2 * n;
        p.max_pairs = 11 * n;
        p.max_rectangles = n;
        assert_true(cairn_rectangle_memory(&p) <= CAIRN_RECTANGLE_BYTES(p.max_segments, p.max_sides,
                                                                        p.max_pairs,
                                                                        p.max_rectangles));
    }
}

static void the_ends_of_the_ranges_are_accepted(void **state)
{
    cairn_rectangle_params p = cairn_rectangle_default();
    cairn_rectangle_set *set = NULL;

    (void)state;
    assert_status(cairn_rectangle_create(&set, NULL, &p), CAIRN_BAD_ARGUMENT);
    p.max_segments = 1 << 20;
    p.max_sides = 1 << 16;
    p.max_pairs = 1 << 20;
    p.max_rectangles = 256;
    p.merge_gap = 0;
    p.max_angle_error = p.merge_angle = CAIRN_REAL(0.78); /* below a quarter of pi */
    p.min_side_coverage = 0;
    p.min_coverage = 1;
    assert_true(cairn_rectangle_memory(&p) > 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rooms_and_boxes),
        cmocka_unit_test(sides_are_reported),
        cmocka_unit_test(segments_are_merged),
        cmocka_unit_test(sides_are_weighed),
        cmocka_unit_test(directions_count_or_do_not),
        cmocka_unit_test(limits),
        cmocka_unit_test(skew_costs_strength),
        cmocka_unit_test(near_ones_are_one),
        cmocka_unit_test(finds_what_all_quadruples_give),
        cmocka_unit_test(all_bits_are_kept),
        cmocka_unit_test(the_budget_does_not_matter),
        cmocka_unit_test(begins_anew),
        cmocka_unit_test(capacities),
        cmocka_unit_test(little_or_nothing),
        cmocka_unit_test(bad_segments_are_refused),
        cmocka_unit_test(memory_is_exact),
        cmocka_unit_test(the_ends_of_the_ranges_are_accepted),
    };

    return cmocka_run_group_tests_name("rectangle", tests, NULL, NULL);
}
