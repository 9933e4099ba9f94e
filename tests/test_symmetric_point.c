/* Symmetric points: by hand, and compared with all pairs of samples; capacities, refusals. */
#include "tests/test.h"

#include <math.h>

#include "cairn/symmetric_point.h"

#define PI     3.14159265358979323846
#define DEGREE (PI / 180)

enum { ITEM_COUNT = 150, ALL_PAIRS = ITEM_COUNT * (ITEM_COUNT - 1) / 2 };

static cairn_oriented_point edgel(double x, double y, double angle)
{
    cairn_oriented_point p = {{(cairn_real)x, (cairn_real)y},
                              {(cairn_real)cos(angle), (cairn_real)sin(angle)}};

    return p;
}

static cairn_segment segment(double ax, double ay, double bx, double by)
{
    cairn_segment s = {{(cairn_real)ax, (cairn_real)ay}, {(cairn_real)bx, (cairn_real)by}};

    return s;
}

static int32_t point_of(cairn_oriented_point p, cairn_oriented_point q,
                        cairn_symmetric_point *point)
{
    memset(point, 0, sizeof *point);
    return cairn_symmetric_point_of(p, q, (cairn_real)(60 * DEGREE), point);
}

/* ---- Two edgels ---- */

/* Tangents of a circle, in any order and sense, give its centre and radius. */
static void of_a_circle_it_is_the_centre(void **state)
{
    cairn_random random = cairn_random_seed(1, 0);

    (void)state;
    for (int32_t i = 0; i < 500; i++) {
        double x = (double)cairn_random_uniform(&random, -50, 50),
               y = (double)cairn_random_uniform(&random, -50, 50);
        double r = (double)cairn_random_uniform(&random, 2, 40),
               at = (double)cairn_random_uniform(&random, -3, 3);
        double apart = (double)cairn_random_uniform(&random, (cairn_real)1.1, (cairn_real)PI);
        double tangent = at + PI / 2 + (i % 2 ? PI : 0),
               other = at + apart + PI / 2 + (i % 4 < 2 ? PI : 0);
        cairn_oriented_point p = edgel(x + r * cos(at), y + r * sin(at), tangent);
        cairn_oriented_point q = edgel(x + r * cos(at + apart), y + r * sin(at + apart), other);
        cairn_symmetric_point sp;

        assert_int_equal(i % 3 == 0 ? point_of(q, p, &sp) : point_of(p, q, &sp), 1);
        assert_near(sp.centre.x, x, NUMBER(1e-9, 1e-3));
        assert_near(sp.centre.y, y, NUMBER(1e-9, 1e-3));
        assert_near(sp.radius, r, NUMBER(1e-9, 1e-3));
        assert_near(sp.deviation, 0, NUMBER(1e-12, 1e-5));
        assert_memory_equal(&sp.contact[i % 3 == 0], &p.position, sizeof p.position);
        assert_memory_equal(&sp.contact[i % 3 != 0], &q.position, sizeof q.position);
        assert_int_equal(sp.first, 0);
        assert_int_equal(sp.second, 1);
    }
}

/* As printed: both normals meet the bisector, at c/2 tan a and c/2 tan b. The centre lies between
 * them, the normals deviate equally from the direction to it, and the mean of the printed
 * deviations is the same. */
static void it_lies_between_the_normals(void **state)
{
    cairn_random random = cairn_random_seed(2, 0);

    (void)state;
    for (int32_t i = 0; i < 500; i++) {
        double a = (double)cairn_random_uniform(&random, -1, 1),
               b = (double)cairn_random_uniform(&random, -1, 1), c = 10;
        double low = c / 2 * fmin(tan(a), tan(b)), high = c / 2 * fmax(tan(a), tan(b)), phi;
        cairn_symmetric_point sp;

        /* The normals are (cos a, sin a) and (-cos b, sin b), the edgels are perpendicular to
         * them. */
        assert_int_equal(point_of(edgel(0, 0, a + PI / 2), edgel(c, 0, -b + PI / 2), &sp), 1);
        assert_near(sp.centre.x, c / 2, NUMBER(1e-12, 1e-5));
        assert_true((double)sp.centre.y >= low - NUMBER(1e-12, 1e-5) &&
                    (double)sp.centre.y <= high + NUMBER(1e-12, 1e-5));
        assert_near(sp.radius, hypot(c / 2, (double)sp.centre.y), NUMBER(1e-12, 1e-5));
        phi = atan2((double)sp.centre.y, c / 2);
        assert_near(fabs(phi - a), fabs(phi - b), NUMBER(1e-12, 1e-5));
        assert_near(sp.deviation, fabs(a - b) / 2, NUMBER(1e-12, 1e-5));
        assert_near((fabs(phi - a) + fabs(phi - b)) / 2, sp.deviation, NUMBER(1e-12, 1e-5));
    }
}

/* As written, of two segments of one sample each: the centre is the midpoint of the normals'
 * intersections with the bisector. */
static void as_written_it_is_the_middle(void **state)
{
    cairn_symmetric_point_params params = cairn_symmetric_point_as_written();
    cairn_random random = cairn_random_seed(3, 0);

    (void)state;
    params.samples = 1;
    params.max_deviation = (cairn_real)PI;
    params.min_radius = 0;
    for (int32_t i = 0; i < 500; i++) {
        double a = (double)cairn_random_uniform(&random, -1, 1),
               b = (double)cairn_random_uniform(&random, -1, 1), c = 10;
        double expected = c / 4 * (tan(a) + tan(b));
        cairn_segment first = segment(-sin(a), cos(a), sin(a), -cos(a));
        cairn_segment second = segment(c - sin(b), -cos(b), c + sin(b), cos(b));
        cairn_symmetric_point sp;

        assert_int_equal(cairn_symmetric_point_of_segments(&params, first, second, &sp), 1);
        assert_near(sp.centre.x, c / 2, NUMBER(1e-12, 1e-5));
        assert_near(sp.centre.y, expected, NUMBER(1e-12, 2e-5));
        assert_near(sp.radius, hypot(c / 2, expected), NUMBER(1e-12, 2e-5));
        assert_near(sp.deviation, fabs(a - b) / 2, NUMBER(1e-12, 1e-5));
    }
}

static void facing_edgels_meet_in_the_middle(void **state)
{
    cairn_symmetric_point sp;

    (void)state;
    assert_int_equal(point_of(edgel(0, 0, 0), edgel(0, 8, PI), &sp), 1);
    assert_near(sp.centre.x, 0, NUMBER(1e-12, 1e-5));
    assert_near(sp.centre.y, 4, NUMBER(1e-12, 1e-5));
    assert_near(sp.deviation, 0, NUMBER(1e-12, 1e-6));
    /* Parallel but shifted along: still the midpoint, and the deviation is that of the shift. */
    assert_int_equal(point_of(edgel(0, 0, 0), edgel(6, 8, 0), &sp), 1);
    assert_near(sp.centre.x, 3, NUMBER(1e-12, 1e-5));
    assert_near(sp.centre.y, 4, NUMBER(1e-12, 1e-5));
    assert_near(sp.deviation, atan2(6, 8), NUMBER(1e-12, 1e-5));
    assert_near(sp.radius, 5, NUMBER(1e-12, 1e-5));
}

static void some_pairs_have_none(void **state)
{
    cairn_symmetric_point sp;

    (void)state;
    assert_int_equal(point_of(edgel(3, 3, 0), edgel(3, 3, 1), &sp), 0);
    assert_int_equal(point_of(edgel(0, 0, 0), edgel(5, 0, 0), &sp), 0);
    /* 60 degrees, on either edgel and to either side. */
    for (int k = 0; k < 4; k++) {
        double sign = k % 2 ? 1 : -1, inside = sign * 59.9 * DEGREE, outside = sign * 60.1 * DEGREE;
        cairn_oriented_point straight = edgel(0, 0, PI / 2);

        straight.position.x = k < 2 ? 10 : 0;
        assert_int_equal(point_of(edgel(k < 2 ? 0 : 10, 0, PI / 2 + inside), straight, &sp), 1);
        assert_int_equal(point_of(edgel(k < 2 ? 0 : 10, 0, PI / 2 + outside), straight, &sp), 0);
    }
}

static void quality_falls_with_the_deviation(void **state)
{
    cairn_symmetric_point sp;

    (void)state;
    assert_int_equal(point_of(edgel(0, 0, 0), edgel(6, 8, 0), &sp), 1);
    assert_near(cairn_symmetric_point_quality(&sp, (cairn_real)(45 * DEGREE)),
                exp(-pow(atan2(6, 8) / (45 * DEGREE), 2) / 2), NUMBER(1e-12, 1e-5));
    sp.deviation = 0;
    assert_near(cairn_symmetric_point_quality(&sp, 1), 1, 0);
}

/* ---- Two segments ---- */

/* All pairs of samples by definition. */
static int slow_pair(const cairn_symmetric_point_params *p, cairn_segment s, cairn_segment t,
                     cairn_symmetric_point *best)
{
    const cairn_segment *both[2] = {&s, &t};
    int32_t count[2];
    double off_best = 0;
    int found = 0;

    for (int k = 0; k < 2; k++) {
        double length = hypot((double)both[k]->b.x - (double)both[k]->a.x,
                              (double)both[k]->b.y - (double)both[k]->a.y);

        count[k] =
            length == 0 ? 0 : (int32_t)fmin(ceil(length / (double)p->sample_step), p->samples);
    }
    for (int32_t i = 0; i < count[0]; i++)
        for (int32_t j = 0; j < count[1]; j++) {
            cairn_oriented_point e[2];
            cairn_symmetric_point sp;
            double off;

            for (int k = 0; k < 2; k++) {
                double share = ((k ? j : i) + 0.5) / count[k];
                double dx = (double)both[k]->b.x - (double)both[k]->a.x,
                       dy = (double)both[k]->b.y - (double)both[k]->a.y;

                e[k] = edgel((double)both[k]->a.x + share * dx, (double)both[k]->a.y + share * dy,
                             atan2(dy, dx));
            }
            if (!cairn_symmetric_point_of(e[0], e[1], p->max_angle, &sp) ||
                sp.radius < p->min_radius || sp.radius > p->max_radius ||
                sp.deviation > p->max_deviation)
                continue;
            off = hypot((double)(sp.centre.x - (sp.contact[0].x + sp.contact[1].x) / 2),
                        (double)(sp.centre.y - (sp.contact[0].y + sp.contact[1].y) / 2));
            if (!found || (double)sp.deviation < (double)best->deviation - NUMBER(1e-12, 1e-6) ||
                (fabs((double)(sp.deviation - best->deviation)) <= NUMBER(1e-12, 1e-6) &&
                 off < off_best - NUMBER(1e-9, 1e-4))) {
                *best = sp;
                off_best = off;
            }
            found = 1;
        }
    return found;
}

static cairn_segment random_segment(cairn_random *random)
{
    double x = (double)cairn_random_uniform(random, 0, 200),
           y = (double)cairn_random_uniform(random, 0, 150);
    double length = (double)cairn_random_uniform(random, 1, 40),
           angle = (double)cairn_random_uniform(random, -3, 3);

    return segment(x, y, x + length * cos(angle), y + length * sin(angle));
}

static void of_segments_the_best_pair_of_samples(void **state)
{
    cairn_symmetric_point_params params = cairn_symmetric_point_default();
    cairn_random random = cairn_random_seed(3, 0);
    int32_t found = 0;

    (void)state;
    for (int32_t i = 0; i < 2000; i++) {
        cairn_segment s = random_segment(&random), t = random_segment(&random);
        cairn_symmetric_point fast, slow;
        int32_t has = cairn_symmetric_point_of_segments(&params, s, t, &fast);

        memset(&slow, 0, sizeof slow);
        assert_int_equal(has, slow_pair(&params, s, t, &slow));
        if (!has)
            continue;
        found++;
        assert_near(fast.deviation, slow.deviation, NUMBER(1e-9, 1e-3));
        assert_near(fast.radius, slow.radius, NUMBER(1e-9, 1e-2));
        assert_near(fast.centre.x, slow.centre.x, NUMBER(1e-9, 1e-2));
        assert_near(fast.centre.y, slow.centre.y, NUMBER(1e-9, 1e-2));
    }
    assert_true(found > 300 && found < 1800);
}

/* Of parallel sides that face each other all samples are equally good: the opposite one counts, and
 * of those the first. */
static void equally_good_pairs(void **state)
{
    cairn_symmetric_point_params params = cairn_symmetric_point_default();
    cairn_symmetric_point sp;

    (void)state;
    assert_int_equal(cairn_symmetric_point_of_segments(&params, segment(0, 0, 20, 0),
                                                       segment(0, 10, 20, 10), &sp),
                     1);
    assert_near(sp.centre.x, 2, NUMBER(1e-12, 1e-5));
    assert_near(sp.centre.y, 5, NUMBER(1e-12, 1e-5));
    assert_near(sp.deviation, 0, 0);
    /* A wedge: all pairs at equal heights are perfect; the innermost has its centre nearest to its
     * chord. */
    assert_int_equal(cairn_symmetric_point_of_segments(&params, segment(2, 2, 22, 12),
                                                       segment(2, -2, 22, -12), &sp),
                     1);
    assert_near(sp.contact[0].x, 4, NUMBER(1e-12, 1e-5));
    assert_near(sp.contact[1].x, 4, NUMBER(1e-12, 1e-5));
}

static void samples_follow_the_length(void **state)
{
    static const struct {
        double length, at;
    } cases[] = {{1, 0.5}, {4, 2}, {4.1, 1.025}, {12, 2}, {100, 10}};
    cairn_symmetric_point_params params = cairn_symmetric_point_default();

    (void)state;
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        cairn_symmetric_point sp;

        assert_int_equal(
            cairn_symmetric_point_of_segments(&params, segment(0, 0, cases[k].length, 0),
                                              segment(0, 30, cases[k].length, 30), &sp),
            1);
        assert_near(sp.contact[0].x, cases[k].at, NUMBER(1e-12, 1e-5));
    }
}

static void limits_hold(void **state)
{
    cairn_segment s = segment(0, 0, 4, 0);
    cairn_symmetric_point_params params = cairn_symmetric_point_default();
    cairn_symmetric_point sp;

    (void)state;
    params.min_radius = 5;
    params.max_radius = 6;
    params.max_deviation = (cairn_real)(10 * DEGREE);
    assert_int_equal(cairn_symmetric_point_of_segments(&params, s, segment(0, 9.99, 4, 9.99), &sp),
                     0);
    assert_int_equal(
        cairn_symmetric_point_of_segments(&params, s, segment(0, 10.01, 4, 10.01), &sp), 1);
    assert_int_equal(
        cairn_symmetric_point_of_segments(&params, s, segment(0, 11.99, 4, 11.99), &sp), 1);
    assert_int_equal(
        cairn_symmetric_point_of_segments(&params, s, segment(0, 12.01, 4, 12.01), &sp), 0);
    assert_int_equal(cairn_symmetric_point_of_segments(&params, s, segment(1.9, 11, 5.9, 11), &sp),
                     1);
    assert_near(sp.deviation, atan2(1.9, 11), NUMBER(1e-12, 1e-5));
    assert_int_equal(cairn_symmetric_point_of_segments(&params, s, segment(2, 11, 6, 11), &sp), 0);
    assert_int_equal(cairn_symmetric_point_of_segments(&params, s, segment(0, 11, 0, 11), &sp), 0);
    assert_int_equal(
        cairn_symmetric_point_of_segments(&params, segment(2, 0, 2, 0), segment(0, 11, 4, 11), &sp),
        0);
}

/* ---- All pairs ---- */

static cairn_symmetric_point_params small_params(void)
{
    cairn_symmetric_point_params params = cairn_symmetric_point_default();

    params.max_segments = ITEM_COUNT;
    params.max_points = ALL_PAIRS;
    params.max_radius = 30;
    return params;
}

struct fixture {
    cairn_pool pool;
    cairn_symmetric_point_set *set;
};

static struct fixture set_with(cairn_symmetric_point_params params)
{
    struct fixture f;

    f.pool = test_pool(cairn_symmetric_point_memory(&params));
    assert_ok(cairn_symmetric_point_create(&f.set, &f.pool, &params));
    return f;
}

static const cairn_symmetric_point *
search(cairn_symmetric_point_set *set, const cairn_segment *segments, int32_t count, int32_t *found)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(cairn_symmetric_point_begin(set, segments, count));
    assert_ok(cairn_symmetric_point_step(set, &budget));
    return cairn_symmetric_point_list(set, found);
}

static int by_quality(const void *a, const void *b)
{
    const cairn_symmetric_point *p = a, *q = b;

    if (p->deviation != q->deviation)
        return p->deviation > q->deviation ? 1 : -1;
    return p->first != q->first ? p->first - q->first : p->second - q->second;
}

static void finds_all_pairs_in_reach(void **state)
{
    static cairn_segment segments[ITEM_COUNT];
    static cairn_symmetric_point slow[ALL_PAIRS];
    cairn_symmetric_point_params params = small_params();
    struct fixture f = set_with(params), tight;
    cairn_random random = cairn_random_seed(4, 0);
    const cairn_symmetric_point *points;
    int32_t found, expected = 0;

    (void)state;
    for (int32_t i = 0; i < ITEM_COUNT; i++)
        segments[i] = i % 5 == 4 ? segments[i - 1] : random_segment(&random);
    for (int32_t i = 0; i < ITEM_COUNT; i++)
        for (int32_t j = i + 1; j < ITEM_COUNT; j++)
            if (cairn_symmetric_point_of_segments(&params, segments[i], segments[j],
                                                  &slow[expected])) {
                slow[expected].first = i;
                slow[expected++].second = j;
            }
    qsort(slow, (size_t)expected, sizeof *slow, by_quality);
    points = search(f.set, segments, ITEM_COUNT, &found);
    assert_int_equal(found, expected);
    assert_true(found > 500);
    assert_memory_equal(points, slow, (size_t)found * sizeof *points);
    assert_int_equal(cairn_symmetric_point_dropped(f.set), 0);
    test_pool_free(&f.pool);

    /* With a smaller capacity the best stay. */
    params.max_points = 100;
    tight = set_with(params);
    points = search(tight.set, segments, ITEM_COUNT, &found);
    assert_int_equal(found, 100);
    assert_memory_equal(points, slow, 100 * sizeof *points);
    assert_int_equal(cairn_symmetric_point_dropped(tight.set), expected - 100);
    /* Earlier results are cleared. */
    points = search(tight.set, segments, 2, &found);
    assert_true(found <= 1);
    assert_int_equal(cairn_symmetric_point_dropped(tight.set), 0);
    test_pool_free(&tight.pool);
}

static void budgets_do_not_matter(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    static cairn_segment segments[ITEM_COUNT];
    struct fixture f = set_with(small_params()), other = set_with(small_params());
    cairn_random random = cairn_random_seed(5, 0);
    const cairn_symmetric_point *points;
    int32_t found;

    (void)state;
    for (int32_t i = 0; i < ITEM_COUNT; i++)
        segments[i] = random_segment(&random);
    points = search(f.set, segments, ITEM_COUNT, &found);
    for (size_t k = 0; k < sizeof budgets / sizeof *budgets; k++) {
        const cairn_symmetric_point *again;
        cairn_status status = CAIRN_MORE;
        int32_t count;

        assert_ok(cairn_symmetric_point_begin(other.set, segments, ITEM_COUNT));
        while (status == CAIRN_MORE) {
            cairn_budget budget = {budgets[k]};

            assert_null(cairn_symmetric_point_list(other.set, &count));
            assert_int_equal(count, 0);
            status = cairn_symmetric_point_step(other.set, &budget);
            assert_true(budget.left >= 0 && (status != CAIRN_MORE || budget.left == 0));
        }
        assert_ok(status);
        again = cairn_symmetric_point_list(other.set, &count);
        assert_int_equal(count, found);
        assert_memory_equal(again, points, (size_t)found * sizeof *points);
    }
    test_pool_free(&f.pool);
    test_pool_free(&other.pool);
}

static void work_is_charged(void **state)
{
    struct fixture f = set_with(small_params());
    cairn_segment two[2] = {segment(0, 0, 20, 0), segment(0, 10, 8, 10)};
    cairn_budget budget = {1000};

    (void)state;
    assert_ok(cairn_symmetric_point_begin(f.set, two, 2));
    assert_ok(cairn_symmetric_point_step(f.set, &budget));
    /* Two boxes, three units of the sweep, 3 * 5 * 2 + 4 for the pair, 4 for its point. */
    assert_int_equal(1000 - budget.left, 2 + 3 + 34 + 4);
    test_pool_free(&f.pool);
}

static void bad_segments_are_refused(void **state)
{
    cairn_segment good[3] = {segment(0, 0, 20, 0), segment(0, 10, 8, 10), segment(1, 1, 2, 2)};
    cairn_symmetric_point_params params = small_params();
    cairn_budget budget = {1000};
    struct fixture f;
    int32_t found;

    (void)state;
    params.max_segments = 2;
    f = set_with(params);
    (void)search(f.set, good, 2, &found);
    assert_int_equal(found, 1);
    assert_status(cairn_symmetric_point_begin(NULL, good, 2), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_symmetric_point_begin(f.set, NULL, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_symmetric_point_begin(f.set, good, -1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_symmetric_point_begin(f.set, good, 3), CAIRN_FULL);
    assert_non_null(cairn_symmetric_point_list(f.set, NULL));
    assert_status(cairn_symmetric_point_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_symmetric_point_step(f.set, NULL), CAIRN_BAD_ARGUMENT);
    for (int k = 0; k < 4; k++) {
        cairn_segment bad[2] = {good[0], good[1]};
        cairn_real *field[4] = {&bad[1].a.x, &bad[1].a.y, &bad[1].b.x, &bad[1].b.y};

        *field[k] = (cairn_real)(k % 2 ? NAN : INFINITY);
        assert_ok(cairn_symmetric_point_begin(f.set, bad, 2));
        assert_status(cairn_symmetric_point_step(f.set, &budget), CAIRN_NOT_FINITE);
        assert_null(cairn_symmetric_point_list(f.set, &found));
        assert_int_equal(found, 0);
        assert_ok(cairn_symmetric_point_step(f.set, &budget));
        assert_null(cairn_symmetric_point_list(f.set, &found));
    }
    assert_null(cairn_symmetric_point_list(NULL, &found));
    assert_int_equal(cairn_symmetric_point_dropped(NULL), 0);
    (void)search(f.set, NULL, 0, &found);
    assert_int_equal(found, 0);
    test_pool_free(&f.pool);
}

static void the_radii_must_be_in_order(void **state)
{
    cairn_symmetric_point_params good = small_params(), p = good;
    cairn_symmetric_point_set *set = NULL;
    cairn_object_fault fault;

    (void)state;
    assert_status(cairn_symmetric_point_create(&set, NULL, &good), CAIRN_BAD_ARGUMENT);
    p.max_radius = 1;
    assert_status(cairn_symmetric_point_check(&p, &fault), CAIRN_BAD_ARGUMENT);
    assert_string_equal(fault.rule, "max_radius: at least min_radius");
    assert_int_equal(cairn_symmetric_point_memory(&p), 0);
    p = good;
    p.samples = 16;
    p.min_radius = p.max_radius;
    p.max_deviation = 0;
    assert_int_equal(cairn_symmetric_point_memory(&p), cairn_symmetric_point_memory(&good));
}

static void the_angle_is_below_a_right_one(void **state)
{
    cairn_symmetric_point_params p = small_params();
    cairn_object_fault fault;

    (void)state;
    p.max_angle = CAIRN_PI / 2 - CAIRN_REAL(1e-3);
    assert_ok(cairn_symmetric_point_check(&p, &fault));
    p.max_angle = CAIRN_PI / 2;
    assert_status(cairn_symmetric_point_check(&p, &fault), CAIRN_BAD_ARGUMENT);
    assert_string_equal(fault.field, "max_angle");
}

static cairn_status create_in(void *context, cairn_pool *pool)
{
    cairn_symmetric_point_set *set;

    return cairn_symmetric_point_create(&set, pool, context);
}

static void memory_is_exactly_as_stated(void **state)
{
    cairn_symmetric_point_params params = small_params();

    (void)state;
    params.max_segments = 5;
    params.max_points = 7;
    test_every_pool_size(create_in, &params, cairn_symmetric_point_memory(&params));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(of_a_circle_it_is_the_centre),
        cmocka_unit_test(it_lies_between_the_normals),
        cmocka_unit_test(as_written_it_is_the_middle),
        cmocka_unit_test(facing_edgels_meet_in_the_middle),
        cmocka_unit_test(some_pairs_have_none),
        cmocka_unit_test(quality_falls_with_the_deviation),
        cmocka_unit_test(of_segments_the_best_pair_of_samples),
        cmocka_unit_test(equally_good_pairs),
        cmocka_unit_test(samples_follow_the_length),
        cmocka_unit_test(limits_hold),
        cmocka_unit_test(finds_all_pairs_in_reach),
        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(work_is_charged),
        cmocka_unit_test(bad_segments_are_refused),
        cmocka_unit_test(the_radii_must_be_in_order),
        cmocka_unit_test(the_angle_is_below_a_right_one),
        cmocka_unit_test(memory_is_exactly_as_stated),
    };
    return cmocka_run_group_tests_name("symmetric_point", tests, NULL, NULL);
}
