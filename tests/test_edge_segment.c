/* Edge segments of chains: drawings with known segments, random ones compared with a reference
 * implementation; budgets, refusals. */
#include "tests/test.h"

#include <math.h>

#include "cairn/edge_segment.h"

enum { MANY_CHAINS = 40, MANY_PIXELS = 4000, ITEM_COUNT = 4000 };

/* Chains made by hand. */
typedef struct drawing {
    cairn_edge_chain chains[MANY_CHAINS];
    cairn_edge_chain_pixel pixels[MANY_PIXELS];
    int32_t chain_count, pixel_count;
} drawing;

static void start(drawing *d, int closed, double strength)
{
    cairn_edge_chain *chain = &d->chains[d->chain_count++];

    memset(chain, 0, sizeof *chain);
    chain->first = d->pixel_count;
    chain->from = chain->to = closed ? CAIRN_EDGE_CHAIN_CLOSED : CAIRN_EDGE_CHAIN_OPEN;
    chain->strength = (cairn_real)strength;
}

static void dot(drawing *d, int32_t x, int32_t y)
{
    d->pixels[d->pixel_count].x = (int16_t)x;
    d->pixels[d->pixel_count++].y = (int16_t)y;
    d->chains[d->chain_count - 1].count++;
}

/* A straight row of pixels from the last one, or from (ax, ay) in an empty chain. */
static void line_to(drawing *d, int32_t ax, int32_t ay, int32_t bx, int32_t by)
{
    int32_t steps = abs(bx - ax) > abs(by - ay) ? abs(bx - ax) : abs(by - ay);

    for (int32_t k = d->chains[d->chain_count - 1].count > 0; k <= steps; k++)
        dot(d, (int32_t)lrint(ax + (double)(bx - ax) * k / steps),
            (int32_t)lrint(ay + (double)(by - ay) * k / steps));
}

static void add_line(drawing *d, int32_t ax, int32_t ay, int32_t bx, int32_t by)
{
    start(d, 0, 100);
    line_to(d, ax, ay, bx, by);
}

static cairn_edge_chain_result result_of(const drawing *d)
{
    cairn_edge_chain_result r = {0};

    r.chains = d->chains;
    r.pixels = d->pixels;
    r.chain_count = d->chain_count;
    r.pixel_count = d->pixel_count;
    return r;
}

/* Random walks that turn. */
static void scribble(drawing *d, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 3);

    memset(d, 0, sizeof *d);
    for (int32_t i = 0; i < 25; i++) {
        int32_t x = 20 + cairn_random_below(&random, 200),
                y = 20 + cairn_random_below(&random, 150);
        int32_t pieces = 1 + cairn_random_below(&random, 4);

        start(d, 0, 1 + i);
        for (int32_t k = 0; k < pieces; k++) {
            int32_t u = x - 35 + cairn_random_below(&random, 71),
                    v = y - 35 + cairn_random_below(&random, 71);

            if (abs(u - x) + abs(v - y) < 4)
                continue;
            line_to(d, x, y, u, v);
            x = u;
            y = v;
        }
        if (d->chains[d->chain_count - 1].count < 2)
            d->pixel_count -= d->chains[--d->chain_count].count;
    }
}

static cairn_edge_segment_params small_params(void)
{
    cairn_edge_segment_params params = cairn_edge_segment_default();

    params.max_lines = 400;
    params.max_segments = ITEM_COUNT;
    return params;
}

struct fixture {
    cairn_pool pool;
    cairn_edge_segment_set *set;
};

static struct fixture set_with(cairn_edge_segment_params params)
{
    struct fixture f;

    f.pool = test_pool(cairn_edge_segment_memory(&params));
    assert_ok(cairn_edge_segment_create(&f.set, &f.pool, &params));
    return f;
}

static cairn_edge_segment_result search(cairn_edge_segment_set *set, const drawing *d)
{
    cairn_edge_chain_result chains = result_of(d);
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(cairn_edge_segment_begin(set, &chains));
    assert_ok(cairn_edge_segment_step(set, &budget));
    return cairn_edge_segment_read(set);
}

/* ---- Reference implementation, in double ---- */

typedef struct slow_line {
    double a[2], b[2];
    int32_t chain, low, high, first, last;
} slow_line;

static slow_line slow_lines[ITEM_COUNT];
static int32_t slow_line_count;

static const cairn_edge_chain_pixel *pixel_at(const drawing *d, int32_t chain, int32_t k)
{
    return &d->pixels[d->chains[chain].first + k % d->chains[chain].count];
}

static double to_chord(const drawing *d, int32_t chain, int32_t low, int32_t high, int32_t k)
{
    const cairn_edge_chain_pixel *a = pixel_at(d, chain, low), *b = pixel_at(d, chain, high),
                                 *p = pixel_at(d, chain, k);
    double dx = b->x - a->x, dy = b->y - a->y, squared = dx * dx + dy * dy, t = 0;

    if (squared > 0)
        t = fmin(fmax(((p->x - a->x) * dx + (p->y - a->y) * dy) / squared, 0), 1);
    return hypot(a->x + t * dx - p->x, a->y + t * dy - p->y);
}

static void slow_regression(const drawing *d, slow_line *line)
{
    const cairn_edge_chain_pixel *p = pixel_at(d, line->chain, line->low),
                                 *q = pixel_at(d, line->chain, line->high);
    int32_t n = line->high - line->low + 1;
    double x = 0, y = 0, xx = 0, xy = 0, yy = 0, angle, s, t;

    for (int32_t k = line->low; k <= line->high; k++) {
        x += (double)pixel_at(d, line->chain, k)->x / n;
        y += (double)pixel_at(d, line->chain, k)->y / n;
    }
    for (int32_t k = line->low; k <= line->high; k++) {
        double u = pixel_at(d, line->chain, k)->x - x, v = pixel_at(d, line->chain, k)->y - y;

        xx += u * u;
        xy += u * v;
        yy += v * v;
    }
    angle = atan2(2 * xy, xx - yy) / 2;
    s = (p->x - x) * cos(angle) + (p->y - y) * sin(angle);
    t = (q->x - x) * cos(angle) + (q->y - y) * sin(angle);
    line->a[0] = x + s * cos(angle);
    line->a[1] = y + s * sin(angle);
    line->b[0] = x + t * cos(angle);
    line->b[1] = y + t * sin(angle);
}

static void slow_split(const drawing *d, double tolerance, int32_t chain, int32_t low, int32_t high)
{
    int32_t farthest = low;
    double most = 0;

    for (int32_t k = low + 1; k < high; k++)
        if (to_chord(d, chain, low, high, k) > most) {
            most = to_chord(d, chain, low, high, k);
            farthest = k;
        }
    if (most > tolerance || (high == d->chains[chain].count && low == 0)) {
        slow_split(d, tolerance, chain, low, farthest);
        slow_split(d, tolerance, chain, farthest, high);
    } else {
        slow_line *line = &slow_lines[slow_line_count++];

        line->chain = chain;
        line->low = low;
        line->high = high;
        slow_regression(d, line);
    }
}

static double length_of(const slow_line *line)
{
    return hypot(line->b[0] - line->a[0], line->b[1] - line->a[1]);
}

static double slow_look_ahead(void)
{
    double mean = 0, variance = 0;

    for (int32_t i = 0; i < slow_line_count; i++)
        mean += length_of(&slow_lines[i]) / slow_line_count;
    for (int32_t i = 0; i < slow_line_count; i++)
        variance += pow(length_of(&slow_lines[i]) - mean, 2) / slow_line_count;
    return fmax(5, mean + 0.5 * sqrt(variance));
}

typedef struct slow_segment {
    double a[2], b[2];
    int32_t chain, first, last;
} slow_segment;

static slow_segment slow_segments[ITEM_COUNT];
static int32_t slow_count;

static int by_value(const void *a, const void *b)
{
    double p = *(const double *)a, q = *(const double *)b;

    return (p > q) - (p < q);
}

/* Whole pixels of the projections of all ends within 2 L, in order, as long as segments stay long
 * enough. */
static void slow_cut(const drawing *d, slow_line *line, double look_ahead, double least)
{
    static double cuts[2 * ITEM_COUNT];
    double length = length_of(line), ux = (line->b[0] - line->a[0]) / length,
           uy = (line->b[1] - line->a[1]) / length, from = 0;
    int32_t count = 0;

    for (int32_t i = 0; i < 2 * slow_line_count; i++) {
        const double *end = i % 2 ? slow_lines[i / 2].b : slow_lines[i / 2].a;
        double x = end[0] - line->a[0], y = end[1] - line->a[1], along = x * ux + y * uy;

        if (along >= 0 && fabs(ux * y - uy * x) <= 2 * look_ahead)
            cuts[count++] = floor(along);
    }
    qsort(cuts, (size_t)count, sizeof *cuts, by_value);
    cuts[count++] = length;
    line->first = slow_count;
    for (int32_t i = 0; i < count; i++) {
        slow_segment *s = &slow_segments[slow_count];
        double pixels = (line->high - line->low) / length;

        if (cuts[i] > length ||
            (i < count - 1 && (cuts[i] - from < least || length - cuts[i] < least)))
            continue;
        s->a[0] = line->a[0] + from * ux;
        s->a[1] = line->a[1] + from * uy;
        s->b[0] = line->a[0] + cuts[i] * ux;
        s->b[1] = line->a[1] + cuts[i] * uy;
        s->chain = line->chain;
        s->first = d->chains[line->chain].first +
                   (line->low + (int32_t)rint(from * pixels)) % d->chains[line->chain].count;
        s->last = d->chains[line->chain].first +
                  (line->low + (int32_t)rint(cuts[i] * pixels)) % d->chains[line->chain].count;
        slow_count++;
        from = cuts[i];
    }
    line->last = slow_count - 1;
}

static void slow_join(int32_t i, int32_t j, double reach, double turn, double piece)
{
    const slow_line *s = &slow_lines[i / 2], *t = &slow_lines[j / 2];
    const double *p = i % 2 ? s->b : s->a, *q = j % 2 ? t->b : t->a, *far_p = i % 2 ? s->a : s->b,
                 *far_q = j % 2 ? t->a : t->b;
    double ux = far_p[0] - p[0], uy = far_p[1] - p[1], vx = far_q[0] - q[0], vy = far_q[1] - q[1];
    double between = remainder(atan2(vy, vx) - atan2(-uy, -ux), 2 * 3.14159265358979323846), k, x,
           y, angle;
    slow_segment *made = &slow_segments[slow_count];

    k = ((q[0] - p[0]) * vy - (q[1] - p[1]) * vx) / (ux * vy - uy * vx);
    x = p[0] + k * ux;
    y = p[1] + k * uy;
    if (fabs(between) < turn ||
        !(hypot(x - p[0], y - p[1]) <= reach && hypot(x - q[0], y - q[1]) <= reach))
        return;
    angle = atan2(-uy, -ux) + between / 2;
    made->a[0] = x - 0.5 * piece * cos(angle);
    made->a[1] = y - 0.5 * piece * sin(angle);
    made->b[0] = x + 0.5 * piece * cos(angle);
    made->b[1] = y + 0.5 * piece * sin(angle);
    made->chain = -1;
    made->first = i % 2 ? s->last : s->first;
    made->last = j % 2 ? t->last : t->first;
    slow_count++;
}

static double slow_search(const drawing *d, const cairn_edge_segment_params *p)
{
    double look_ahead;

    slow_line_count = slow_count = 0;
    for (int32_t c = 0; c < d->chain_count; c++)
        slow_split(d, (double)p->tolerance, c, 0,
                   d->chains[c].count - (d->chains[c].from != CAIRN_EDGE_CHAIN_CLOSED));
    look_ahead = slow_look_ahead();
    for (int32_t i = 0; i < slow_line_count; i++)
        slow_cut(d, &slow_lines[i], look_ahead, (double)p->min_piece);
    for (int32_t i = 0; i < 2 * slow_line_count; i++)
        for (int32_t j = i + 1; j < 2 * slow_line_count; j++)
            if (i / 2 != j / 2 && p->junction_distance > 0)
                slow_join(i, j, (double)p->junction_distance, (double)p->min_junction_angle,
                          (double)p->min_piece);
    return look_ahead;
}

static int by_parts(int32_t first, int32_t second, int32_t last, int32_t other_last, double x,
                    double other_x)
{
    if (first != second)
        return first > second ? 1 : -1;
    if (last != other_last)
        return last > other_last ? 1 : -1;
    return (x > other_x) - (x < other_x);
}

static int by_segments(const void *a, const void *b)
{
    const cairn_edge_segment *p = a, *q = b;

    return by_parts(p->first, q->first, p->last, q->last, (double)p->line.a.x, (double)q->line.a.x);
}

static int by_slow_segments(const void *a, const void *b)
{
    const slow_segment *p = a, *q = b;

    return by_parts(p->first, q->first, p->last, q->last, p->a[0], q->a[0]);
}

/* Virtual ones are compared in the order of the segments they join, and by their starts where two
 * join the same. */
static void expect_the_obvious_way(const cairn_edge_segment_result *r, const drawing *d,
                                   const cairn_edge_segment_params *p)
{
    static cairn_edge_segment found[ITEM_COUNT];
    double look_ahead = slow_search(d, p), tolerance = NUMBER(1e-9, 2e-3);
    int32_t real = r->count - r->virtual_count;

    assert_int_equal(r->line_count, slow_line_count);
    assert_near(r->look_ahead, look_ahead, tolerance);
    assert_int_equal(r->count, slow_count);
    memcpy(found, r->segments, (size_t)r->count * sizeof *found);
    qsort(found + real, (size_t)r->virtual_count, sizeof *found, by_segments);
    qsort(slow_segments + real, (size_t)(slow_count - real), sizeof *slow_segments,
          by_slow_segments);
    for (int32_t i = 0; i < r->count; i++) {
        const slow_segment *s = &slow_segments[i];

        assert_int_equal(found[i].chain, s->chain);
        assert_int_equal(found[i].first, s->first);
        assert_int_equal(found[i].last, s->last);
        assert_near(found[i].line.a.x, s->a[0], tolerance);
        assert_near(found[i].line.a.y, s->a[1], tolerance);
        assert_near(found[i].line.b.x, s->b[0], tolerance);
        assert_near(found[i].line.b.y, s->b[1], tolerance);
        if (s->chain >= 0)
            assert_near(found[i].strength, d->chains[s->chain].strength, 0);
        else
            assert_near(found[i].strength,
                        fmin((double)found[s->first].strength, (double)found[s->last].strength), 0);
    }
}

static void agrees_with_the_reference(void **state)
{
    cairn_edge_segment_params params = small_params();
    struct fixture f = set_with(params);
    int32_t joined = 0, lines = 0, segments = 0;
    static drawing d;

    (void)state;
    /* In float, ends on the border of a range may fall on either side of it. */
    for (uint64_t seed = 0; seed < NUMBER(30, 3); seed++) {
        cairn_edge_segment_result r;

        scribble(&d, seed);
        r = search(f.set, &d);
        expect_the_obvious_way(&r, &d, &params);
        joined += r.virtual_count;
        lines += r.line_count;
        segments += r.count - r.virtual_count;
    }
    assert_true(joined > 50 * lines / 100);
    assert_true(segments > 2 * lines);
    test_pool_free(&f.pool);
}

/* ---- Drawings with a known answer ---- */

static void a_straight_line_is_one_segment(void **state)
{
    struct fixture f = set_with(small_params());
    static drawing d;
    cairn_edge_segment_result r;

    (void)state;
    memset(&d, 0, sizeof d);
    add_line(&d, 10, 20, 40, 20);
    r = search(f.set, &d);
    assert_int_equal(r.count, 1);
    assert_int_equal(r.virtual_count, 0);
    assert_near(r.segments[0].line.a.x, 10, NUMBER(1e-12, 1e-5));
    assert_near(r.segments[0].line.b.x, 40, NUMBER(1e-12, 1e-5));
    assert_near(r.segments[0].line.b.y, 20, NUMBER(1e-12, 1e-5));
    assert_int_equal(r.segments[0].first, 0);
    assert_int_equal(r.segments[0].last, 30);
    assert_near(r.segments[0].strength, 100, 0);
    assert_near(r.look_ahead, 30, NUMBER(1e-9, 1e-4));
    assert_near(r.mean_length, 30, NUMBER(1e-9, 1e-4));
    test_pool_free(&f.pool);
}

/* The lines of a corner end 1 px before it: they meet within 1 px of both ends, not within 0.5 px. */
static void a_junction_is_as_near_as_its_distance(void **state)
{
    (void)state;
    for (int is_near = 0; is_near < 2; is_near++) {
        cairn_edge_segment_params params = small_params();
        cairn_edge_segment_result r;
        struct fixture f;
        static drawing d;

        params.junction_distance = is_near ? 1 : CAIRN_REAL(0.5);
        f = set_with(params);
        memset(&d, 0, sizeof d);
        add_line(&d, 10, 20, 39, 20);
        add_line(&d, 40, 21, 40, 50);
        r = search(f.set, &d);
        assert_int_equal(r.virtual_count, is_near);
        assert_int_equal(r.count, 2 + is_near);
        test_pool_free(&f.pool);
    }
}

/* A wall of 30 px is cut at the end of the short line beside it, within the look-ahead distance; 2
 * * 5 px here. */
static void ends_nearby_cut(void **state)
{
    static const int32_t beside[] = {10, 11, -10, -11};
    static const int32_t expected[] = {3, 1, 3, 1};
    cairn_edge_segment_params params = small_params();
    struct fixture f;

    (void)state;
    params.look_ahead = 5;
    params.junction_distance = 0;
    f = set_with(params);
    for (int k = 0; k < 4; k++) {
        static drawing d;
        cairn_edge_segment_result r;

        memset(&d, 0, sizeof d);
        add_line(&d, 0, 0, 30, 0);
        add_line(&d, 8, beside[k], 19, beside[k]);
        r = search(f.set, &d);
        assert_int_equal(r.count, expected[k] + 1);
        if (expected[k] == 1)
            continue;
        for (int j = 0; j < 3; j++) {
            static const int32_t cut[] = {0, 8, 19, 30};

            assert_near(r.segments[j].line.a.x, cut[j], NUMBER(1e-9, 1e-4));
            assert_near(r.segments[j].line.b.x, cut[j + 1], NUMBER(1e-9, 1e-4));
            assert_int_equal(r.segments[j].first, cut[j]);
            assert_int_equal(r.segments[j].last, cut[j + 1]);
        }
        assert_near(r.mean_length, (30 + 11) / 4.0, NUMBER(1e-9, 1e-4));
    }
    test_pool_free(&f.pool);
}

/* A cut leaves at least four pixels on both sides; of two that are too near each other the first
 * wins. */
static void segments_do_not_become_too_short(void **state)
{
    cairn_edge_segment_params params = small_params();
    struct fixture f;
    static drawing d;
    cairn_edge_segment_result r;

    (void)state;
    params.look_ahead = 5;
    params.junction_distance = 0;
    f = set_with(params);
    memset(&d, 0, sizeof d);
    add_line(&d, 0, 0, 100, 0);
    add_line(&d, 3, 5, 3, 9);
    add_line(&d, 4, 5, 4, 9);
    add_line(&d, 7, 5, 7, 9);
    add_line(&d, 8, 5, 8, 9);
    add_line(&d, 63, 5, 63, 9);
    add_line(&d, 70, 5, 70, 9);
    add_line(&d, 97, 5, 97, 9);
    r = search(f.set, &d);
    assert_int_equal(r.count, 5 + 7);
    assert_near(r.segments[0].line.b.x, 4, NUMBER(1e-9, 1e-4));
    assert_near(r.segments[1].line.b.x, 8, NUMBER(1e-9, 1e-4));
    assert_near(r.segments[2].line.b.x, 63, NUMBER(1e-9, 1e-4));
    assert_near(r.segments[3].line.b.x, 70, NUMBER(1e-9, 1e-4));
    assert_near(r.segments[4].line.b.x, 100, NUMBER(1e-9, 1e-4));
    test_pool_free(&f.pool);
}

static void a_corner_gets_its_mean_direction(void **state)
{
    struct fixture f = set_with(small_params());
    static drawing d;
    cairn_edge_segment_result r;
    const cairn_edge_segment *v;

    (void)state;
    memset(&d, 0, sizeof d);
    start(&d, 0, 50);
    line_to(&d, 0, 0, 20, 0);
    line_to(&d, 20, 0, 20, 20);
    r = search(f.set, &d);
    assert_int_equal(r.line_count, 2);
    assert_int_equal(r.virtual_count, 1);
    v = &r.segments[r.count - 1];
    assert_int_equal(v->chain, -1);
    assert_near(v->strength, 50, 0);
    assert_int_equal(v->first, 0);
    assert_int_equal(v->last, r.count - 2);
    assert_near((v->line.a.x + v->line.b.x) / 2, 20, NUMBER(1e-9, 1e-4));
    assert_near((v->line.a.y + v->line.b.y) / 2, 0, NUMBER(1e-9, 1e-4));
    assert_near(v->line.b.x - v->line.a.x, 4 * sqrt(0.5), NUMBER(1e-9, 1e-4));
    assert_near(v->line.b.y - v->line.a.y, 4 * sqrt(0.5), NUMBER(1e-9, 1e-4));
    test_pool_free(&f.pool);
}

static void closed_chains_go_all_the_way_round(void **state)
{
    struct fixture f = set_with(small_params());
    static drawing d;
    cairn_edge_segment_params params = small_params();
    cairn_edge_segment_result r;
    int32_t covered = 0;

    (void)state;
    memset(&d, 0, sizeof d);
    start(&d, 1, 70);
    line_to(&d, 30, 10, 50, 10);
    line_to(&d, 50, 10, 50, 40);
    line_to(&d, 50, 40, 10, 40);
    line_to(&d, 10, 40, 10, 10);
    line_to(&d, 10, 10, 29, 10);
    r = search(f.set, &d);
    expect_the_obvious_way(&r, &d, &params);
    assert_int_equal(r.virtual_count, 4);
    for (int32_t i = 0; i < r.count - r.virtual_count; i++) {
        const cairn_edge_segment *s = &r.segments[i];

        covered += s->last > s->first ? s->last - s->first : s->last + d.pixel_count - s->first;
        assert_int_equal(s->last, r.segments[(i + 1) % (r.count - r.virtual_count)].first);
    }
    assert_int_equal(covered, d.pixel_count);
    test_pool_free(&f.pool);
}

/* A hook whose pixels spread across its chord, a chain that returns to its start, one that stays
 * there. */
static void odd_chains_are_finite(void **state)
{
    cairn_edge_segment_params params = small_params();
    struct fixture f;
    static drawing d;
    cairn_edge_segment_result r;

    (void)state;
    params.tolerance = 3;
    f = set_with(params);
    memset(&d, 0, sizeof d);
    start(&d, 0, 1);
    dot(&d, 0, 0);
    dot(&d, 0, 1);
    dot(&d, 0, 2);
    dot(&d, 1, 2);
    dot(&d, 1, 1);
    dot(&d, 1, 0);
    start(&d, 0, 1);
    dot(&d, 50, 50);
    dot(&d, 51, 51);
    dot(&d, 52, 50);
    dot(&d, 51, 49);
    dot(&d, 50, 50);
    start(&d, 0, 1);
    dot(&d, 70, 70);
    dot(&d, 70, 70);
    r = search(f.set, &d);
    assert_int_equal(r.line_count, 3);
    assert_near(r.segments[0].line.a.x, 0, 0);
    assert_near(r.segments[0].line.b.x, 1, NUMBER(1e-12, 1e-5));
    for (int32_t i = 0; i < r.count; i++)
        assert_true(cairn_segment_length(r.segments[i].line) > 0);
    test_pool_free(&f.pool);
}

static void nothing_gives_nothing(void **state)
{
    struct fixture f = set_with(small_params());
    static drawing d;
    cairn_edge_segment_result r;

    (void)state;
    memset(&d, 0, sizeof d);
    r = search(f.set, &d);
    assert_int_equal(r.count, 0);
    assert_near(r.look_ahead, 5, 0);
    assert_near(r.mean_length, 5, 0);
    test_pool_free(&f.pool);
}

/* ---- Budgets and refusals ---- */

static void budgets_do_not_matter(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    struct fixture f = set_with(small_params()), other = set_with(small_params());
    static drawing d;
    cairn_edge_chain_result chains;
    cairn_edge_segment_result r;

    (void)state;
    scribble(&d, 4);
    chains = result_of(&d);
    r = search(f.set, &d);
    for (size_t k = 0; k < sizeof budgets / sizeof *budgets; k++) {
        cairn_edge_segment_result again;
        cairn_status status = CAIRN_MORE;

        assert_ok(cairn_edge_segment_begin(other.set, &chains));
        while (status == CAIRN_MORE) {
            cairn_budget budget = {budgets[k]};

            assert_int_equal(cairn_edge_segment_read(other.set).count, 0);
            assert_null(cairn_edge_segment_read(other.set).segments);
            status = cairn_edge_segment_step(other.set, &budget);
            assert_true(budget.left >= 0 && (status != CAIRN_MORE || budget.left == 0));
        }
        assert_ok(status);
        again = cairn_edge_segment_read(other.set);
        assert_int_equal(again.count, r.count);
        assert_memory_equal(again.segments, r.segments, (size_t)r.count * sizeof *r.segments);
        assert_true(again.look_ahead == r.look_ahead && again.mean_length == r.mean_length);
    }
    test_pool_free(&f.pool);
    test_pool_free(&other.pool);
}

/* Every capacity that is one too small is refused with a message, and the set can be used again. */
static void capacities_are_kept(void **state)
{
    static drawing d, one;
    struct fixture f = set_with(small_params());
    cairn_edge_segment_result r;

    (void)state;
    scribble(&d, 9);
    memset(&one, 0, sizeof one);
    add_line(&one, 0, 0, 9, 0);
    r = search(f.set, &d);
    assert_true(r.virtual_count > 0);
    for (int k = 0; k < 5; k++) {
        cairn_edge_segment_params params = small_params();
        cairn_edge_chain_result chains = result_of(&d);
        cairn_budget budget = {CAIRN_UNBOUNDED};
        struct fixture tight;

        params.max_lines = k == 1 ? r.line_count - 1 : k == 2 ? 1 : r.line_count;
        params.max_segments = k == 3   ? r.count - 1
                              : k == 4 ? r.count - r.virtual_count - 1
                                       : r.count;
        tight = set_with(params);
        assert_ok(cairn_edge_segment_begin(tight.set, &chains));
        assert_status(cairn_edge_segment_step(tight.set, &budget), k == 0 ? CAIRN_OK : CAIRN_FULL);
        assert_int_equal(cairn_edge_segment_read(tight.set).count, k == 0 ? r.count : 0);
        assert_int_equal(search(tight.set, &one).count, 1);
        test_pool_free(&tight.pool);
    }
    test_pool_free(&f.pool);
}

static void bad_chains_are_refused(void **state)
{
    struct fixture f = set_with(small_params());
    static drawing d;
    cairn_edge_chain_result good, bad;

    (void)state;
    memset(&d, 0, sizeof d);
    add_line(&d, 0, 0, 9, 0);
    good = result_of(&d);
    assert_int_equal(search(f.set, &d).count, 1);
    assert_status(cairn_edge_segment_begin(NULL, &good), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_edge_segment_begin(f.set, NULL), CAIRN_BAD_ARGUMENT);
    for (int k = 0; k < 4; k++) {
        bad = good;
        if (k == 0)
            bad.chain_count = -1;
        else if (k == 1)
            bad.pixel_count = -1;
        else if (k == 2)
            bad.chains = NULL;
        else
            bad.pixels = NULL;
        assert_status(cairn_edge_segment_begin(f.set, &bad), CAIRN_BAD_ARGUMENT);
    }
    assert_int_equal(cairn_edge_segment_read(f.set).count, 1);
    for (int k = 0; k < 3; k++) {
        cairn_edge_chain chain = d.chains[0];
        cairn_budget budget = {100};

        bad = good;
        bad.chains = &chain;
        chain.count = k == 0 ? 1 : 10;
        chain.first = k == 1 ? -1 : k == 2 ? 1 : 0;
        assert_ok(cairn_edge_segment_begin(f.set, &bad));
        assert_status(cairn_edge_segment_step(f.set, &budget), CAIRN_BAD_ARGUMENT);
        assert_int_equal(cairn_edge_segment_read(f.set).count, 0);
        assert_ok(cairn_edge_segment_step(f.set, &budget));
    }
    {
        cairn_budget budget = {1};

        assert_status(cairn_edge_segment_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_edge_segment_step(f.set, NULL), CAIRN_BAD_ARGUMENT);
    }
    assert_int_equal(cairn_edge_segment_read(NULL).count, 0);
    test_pool_free(&f.pool);
}

static cairn_status create_in(void *context, cairn_pool *pool)
{
    cairn_edge_segment_set *set;

    return cairn_edge_segment_create(&set, pool, context);
}

static void memory_is_exactly_as_stated(void **state)
{
    cairn_edge_segment_params params = small_params();
    cairn_edge_segment_set *set;

    (void)state;
    assert_status(cairn_edge_segment_create(&set, NULL, &params), CAIRN_BAD_ARGUMENT);
    params.max_lines = 5;
    params.max_segments = 9;
    test_every_pool_size(create_in, &params, cairn_edge_segment_memory(&params));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(agrees_with_the_reference),
        cmocka_unit_test(a_straight_line_is_one_segment),
        cmocka_unit_test(a_junction_is_as_near_as_its_distance),
        cmocka_unit_test(ends_nearby_cut),
        cmocka_unit_test(segments_do_not_become_too_short),
        cmocka_unit_test(a_corner_gets_its_mean_direction),
        cmocka_unit_test(closed_chains_go_all_the_way_round),
        cmocka_unit_test(odd_chains_are_finite),
        cmocka_unit_test(nothing_gives_nothing),
        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(capacities_are_kept),
        cmocka_unit_test(bad_chains_are_refused),
        cmocka_unit_test(memory_is_exactly_as_stated),
    };
    return cmocka_run_group_tests_name("edge_segment", tests, NULL, NULL);
}
