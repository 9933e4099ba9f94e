/* Corners of segments: by hand, and compared with all pairs; suppression, budgets, refusals. */
#include "tests/test.h"

#include <math.h>

#include "cairn/corner.h"

enum { ITEM_COUNT = 120, ALL_PAIRS = ITEM_COUNT * (ITEM_COUNT - 1) / 2 };

static cairn_segment segment(double ax, double ay, double bx, double by)
{
    cairn_segment s = {{(cairn_real)ax, (cairn_real)ay}, {(cairn_real)bx, (cairn_real)by}};
    return s;
}

static cairn_segment reversed(cairn_segment s)
{
    cairn_segment r = {s.b, s.a};
    return r;
}

/* A set of its own pool. */
struct fixture {
    cairn_pool pool;
    cairn_corner_set *set;
};

static struct fixture set_with(cairn_corner_params params)
{
    struct fixture f;

    f.pool = test_pool(cairn_corner_memory(&params));
    assert_ok(cairn_corner_create(&f.set, &f.pool, &params));
    return f;
}

static struct fixture small_set(void)
{
    return set_with(cairn_corner_default());
}

static const cairn_corner *search(cairn_corner_set *set, const cairn_segment *segments,
                                  int32_t count, int32_t *found)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(cairn_corner_begin(set, segments, count));
    assert_ok(cairn_corner_step(set, &budget));
    return cairn_corner_list(set, found);
}

static int32_t count_of(cairn_corner_set *set, cairn_segment s, cairn_segment t)
{
    cairn_segment both[2] = {s, t};
    int32_t found;

    (void)search(set, both, 2, &found);
    return found;
}

/* ---- Reference implementation: all pairs, angles by libm ---- */

static double distance(cairn_vec2 a, cairn_vec2 b)
{
    return hypot((double)a.x - (double)b.x, (double)a.y - (double)b.y);
}

static int slow_corner(const cairn_corner_params *p, const cairn_segment *segments, int32_t i,
                       int32_t j, cairn_corner *c)
{
    const cairn_segment *s[2] = {&segments[i], &segments[j]};
    double direction[2], length[2];
    int forward[2], k;
    double dx1 = (double)s[0]->b.x - (double)s[0]->a.x, dy1 = (double)s[0]->b.y - (double)s[0]->a.y;
    double dx2 = (double)s[1]->b.x - (double)s[1]->a.x, dy2 = (double)s[1]->b.y - (double)s[1]->a.y;
    double det = dx1 * dy2 - dy1 * dx2, t, opening;
    cairn_vec2 x;

    if (det == 0)
        return 0;
    t = (((double)s[1]->a.x - (double)s[0]->a.x) * dy2 -
         ((double)s[1]->a.y - (double)s[0]->a.y) * dx2) /
        det;
    x.x = (cairn_real)((double)s[0]->a.x + t * dx1);
    x.y = (cairn_real)((double)s[0]->a.y + t * dy1);
    for (k = 0; k < 2; k++) {
        double to_a = distance(x, s[k]->a), to_b = distance(x, s[k]->b);
        double dx = (double)s[k]->b.x - (double)s[k]->a.x,
               dy = (double)s[k]->b.y - (double)s[k]->a.y;

        double on =
            (((double)x.x - (double)s[k]->a.x) * dx + ((double)x.y - (double)s[k]->a.y) * dy) /
            (dx * dx + dy * dy);

        forward[k] = to_a <= to_b;
        if (fmin(to_a, to_b) > (double)p->end_distance && !(p->crossings && on >= 0 && on <= 1))
            return 0;
        length[k] = fmax(to_a, to_b);
        direction[k] = forward[k] ? atan2(dy, dx) : atan2(-dy, -dx);
    }
    opening = remainder(direction[1] - direction[0], 2 * 3.14159265358979323846);
    k = opening < 0; /* leg[0] is that of s[k] */
    if (fabs(opening) < (double)p->min_opening || fabs(opening) > (double)p->max_opening)
        return 0;
    c->position = x;
    c->opening = (cairn_real)fabs(opening);
    c->leg[0].x = (cairn_real)cos(direction[k]);
    c->leg[0].y = (cairn_real)sin(direction[k]);
    c->leg[1].x = (cairn_real)cos(direction[1 - k]);
    c->leg[1].y = (cairn_real)sin(direction[1 - k]);
    c->segment[0] = k ? j : i;
    c->segment[1] = k ? i : j;
    c->strength = (cairn_real)fmin(length[0], length[1]);
    /* Free on the left of a -> b: leg[0] forward has it towards leg[1], leg[1] backward towards
     * leg[0]. */
    c->kind = CAIRN_CORNER_MIXED;
    if (forward[k] && !forward[1 - k])
        c->kind = CAIRN_CORNER_CONCAVE;
    if (!forward[k] && forward[1 - k])
        c->kind = CAIRN_CORNER_CONVEX;
    return 1;
}

static int by_strength(const void *a, const void *b)
{
    const cairn_corner *p = a, *q = b;

    return p->strength > q->strength ? -1 : p->strength < q->strength;
}

static int32_t slow_search(const cairn_corner_params *p, const cairn_segment *segments,
                           int32_t count, cairn_corner *corners)
{
    int32_t found = 0, kept = 0;

    for (int32_t i = 0; i < count; i++)
        for (int32_t j = i + 1; j < count; j++)
            found += slow_corner(p, segments, i, j, &corners[found]);
    qsort(corners, (size_t)found, sizeof *corners, by_strength);
    if (p->merge_radius == 0)
        return found;
    for (int32_t i = 0; i < found; i++) {
        int same = 0;

        for (int32_t j = 0; j < kept; j++) {
            double a = (double)(corners[i].leg[0].x * corners[j].leg[0].x +
                                corners[i].leg[0].y * corners[j].leg[0].y);
            double b = (double)(corners[i].leg[1].x * corners[j].leg[1].x +
                                corners[i].leg[1].y * corners[j].leg[1].y);

            same |= corners[i].kind == corners[j].kind &&
                    distance(corners[i].position, corners[j].position) < (double)p->merge_radius &&
                    acos(fmin(a, 1)) <= (double)p->merge_angle &&
                    acos(fmin(b, 1)) <= (double)p->merge_angle;
        }
        if (!same)
            corners[kept++] = corners[i];
    }
    return kept;
}

/* About as many corners as segments, in all orientations, on a floor of 4 by 4 m. */
static void scatter(cairn_segment *segments, int32_t count, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 0);

    for (int32_t i = 0; i < count; i++) {
        cairn_real x = cairn_random_uniform(&random, -2, 2);
        cairn_real y = cairn_random_uniform(&random, -2, 2);
        cairn_real turn = (cairn_real)cairn_random_below(&random, 4) * CAIRN_PI / 2 +
                          CAIRN_REAL(0.1) * cairn_random_normal(&random);
        cairn_real length = cairn_random_uniform(&random, CAIRN_REAL(0.2), CAIRN_REAL(1.5));

        segments[i].a.x = x;
        segments[i].a.y = y;
        segments[i].b.x = x + length * cairn_cos(turn);
        segments[i].b.y = y + length * cairn_sin(turn);
    }
}

static void assert_same_corner(const cairn_corner *a, const cairn_corner *b, double tolerance)
{
    assert_int_equal(a->segment[0], b->segment[0]);
    assert_int_equal(a->segment[1], b->segment[1]);
    assert_int_equal(a->kind, b->kind);
    assert_near(a->position.x, b->position.x, tolerance);
    assert_near(a->position.y, b->position.y, tolerance);
    assert_near(a->opening, b->opening, tolerance);
    assert_near(a->strength, b->strength, tolerance);
    for (int k = 0; k < 2; k++) {
        assert_near(a->leg[k].x, b->leg[k].x, tolerance);
        assert_near(a->leg[k].y, b->leg[k].y, tolerance);
    }
}

static void test_params_are_refused(void **state)
{
    cairn_corner_params good = cairn_corner_default(), bad = good;
    cairn_pool pool = test_pool(cairn_corner_memory(&good));
    cairn_object_fault fault;
    cairn_corner_set *set;

    (void)state;
    bad.max_opening = CAIRN_REAL(1.3);
    assert_status(cairn_corner_check(&bad, &fault), CAIRN_BAD_ARGUMENT);
    assert_string_equal(fault.rule, "max_opening: at least min_opening");
    assert_int_equal(cairn_corner_memory(&bad), 0);
    assert_status(cairn_corner_create(&set, &pool, &bad), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_corner_create(NULL, &pool, &good), CAIRN_BAD_ARGUMENT);
    assert_int_equal(pool.used, 0);
    assert_ok(cairn_corner_create(&set, &pool, &good));
    test_pool_free(&pool);
}

static cairn_status create_with(void *params, cairn_pool *pool)
{
    cairn_corner_set *set;

    return cairn_corner_create(&set, pool, params);
}

static void test_limits_of_params(void **state)
{
    cairn_corner_params good = cairn_corner_default(), p;

    (void)state;
#define ACCEPTED(field, value)                                                                     \
    p = good;                                                                                      \
    p.field = value;                                                                               \
    assert_true(cairn_corner_memory(&p) > 0)
    ACCEPTED(max_segments, 1);
    ACCEPTED(max_corners, 1);
    ACCEPTED(max_opening, good.min_opening);
    ACCEPTED(max_opening, CAIRN_REAL(3.14));
    ACCEPTED(merge_radius, 0);
    ACCEPTED(merge_angle, 0);
    ACCEPTED(merge_angle, CAIRN_PI);
#if SIZE_MAX > UINT32_MAX
    ACCEPTED(max_segments, 1 << 28);
    ACCEPTED(max_corners, 1 << 28);
#endif
#undef ACCEPTED
}

static void test_memory_is_exact(void **state)
{
    cairn_corner_params p = cairn_corner_default();
    static const int32_t counts[] = {1, 2, 3, 7, 16, 33, 100, 255, 1000};
    const int n = (int)(sizeof counts / sizeof *counts);

    (void)state;
    p.max_segments = 5;
    p.max_corners = 3;
    test_every_pool_size(create_with, &p, cairn_corner_memory(&p));
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            size_t need, bound = CAIRN_CORNER_BYTES(counts[i], counts[j]);

            p.max_segments = counts[i];
            p.max_corners = counts[j];
            need = cairn_corner_memory(&p);
            assert_true(need <= bound);
            assert_true(bound <= need + 512);
        }
}

/* Corners of rooms, boxes and thin walls, under all exchanges of segments. */
static void test_kind_and_legs(void **state)
{
    struct fixture f = small_set();
    /* Seen from the room the right wall runs up to (2, 1), the upper wall from there to the
     * left. */
    cairn_segment up = segment(2, 0, 2, 1), left = segment(2, 1, 0, 1);

    (void)state;
    for (int turned_up = 0; turned_up < 2; turned_up++)
        for (int turned_left = 0; turned_left < 2; turned_left++)
            for (int exchanged = 0; exchanged < 2; exchanged++) {
                cairn_segment a = turned_up ? reversed(up) : up,
                              b = turned_left ? reversed(left) : left;
                cairn_segment both[2] = {exchanged ? b : a, exchanged ? a : b};
                int32_t found;
                const cairn_corner *c = search(f.set, both, 2, &found);

                assert_int_equal(found, 1);
                assert_near(c->position.x, 2, 1e-6);
                assert_near(c->position.y, 1, 1e-6);
                /* The upper wall leads away to the left; from there it is a quarter turn to the one
                 * that leads down. */
                assert_near(c->leg[0].x, -1, 1e-6);
                assert_near(c->leg[0].y, 0, 1e-6);
                assert_near(c->leg[1].x, 0, 1e-6);
                assert_near(c->leg[1].y, -1, 1e-6);
                assert_int_equal(c->segment[0], exchanged ? 0 : 1);
                assert_int_equal(c->segment[1], exchanged ? 1 : 0);
                assert_near(c->opening, 1.5707963267948966, 1e-6);
                assert_near(c->strength, 1, 1e-6);
                assert_int_equal(c->kind, turned_up != turned_left ? CAIRN_CORNER_MIXED
                                          : turned_up              ? CAIRN_CORNER_CONVEX
                                                                   : CAIRN_CORNER_CONCAVE);
                assert_int_equal(cairn_corner_dropped(f.set), 0);
            }
    test_pool_free(&f.pool);
}

static void test_limits_of_the_opening(void **state)
{
    struct fixture f = small_set();
    static const struct {
        double degrees;
        int found;
    } cases[] = {{79.9, 0}, {80.1, 1}, {90, 1},    {99.9, 1}, {100.1, 0},
                 {0, 0},    {180, 0},  {-79.9, 0}, {-80.1, 1}};

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        double a = cases[i].degrees * 3.14159265358979323846 / 180;

        assert_int_equal(count_of(f.set, segment(0, 0, 1, 0), segment(0, 0, cos(a), sin(a))),
                         cases[i].found);
        assert_int_equal(count_of(f.set, segment(0, 0, 1, 0), segment(cos(a), sin(a), 0, 0)),
                         cases[i].found);
    }
    test_pool_free(&f.pool);

    /* The opening is the angle between the legs, not the smaller angle of the lines. */
    {
        cairn_corner_params p = cairn_corner_default();

        p.min_opening = CAIRN_REAL(0.5);
        p.max_opening = CAIRN_REAL(1.0);
        f = set_with(p);
        assert_int_equal(count_of(f.set, segment(0, 0, 1, 0), segment(0, 0, cos(0.8), sin(0.8))),
                         1);
        assert_int_equal(count_of(f.set, segment(0, 0, 1, 0), segment(0, 0, -cos(0.8), sin(0.8))),
                         0);
        test_pool_free(&f.pool);
    }
}

static void test_limits_of_the_distance(void **state)
{
    struct fixture f = small_set();
    cairn_segment s = segment(0, 0, 1, 0);

    (void)state;
    /* Short of the corner, on one side and on the other. */
    assert_int_equal(count_of(f.set, s, segment(1.299, 0, 1.299, 2)), 1);
    assert_int_equal(count_of(f.set, s, segment(1.301, 0, 1.301, 2)), 0);
    assert_int_equal(count_of(f.set, s, segment(0, 0.299, 0, 2)), 1);
    assert_int_equal(count_of(f.set, s, segment(0, 0.301, 0, 2)), 0);
    assert_int_equal(count_of(f.set, segment(0, 0.301, 0, 2), s), 0);
    /* Beyond it: the other wall meets this one inside. */
    assert_int_equal(count_of(f.set, s, segment(0.299, 0, 0.299, 2)), 1);
    assert_int_equal(count_of(f.set, s, segment(0.5, 0, 0.5, 2)), 0);
    assert_int_equal(count_of(f.set, s, segment(0.701, 0, 0.701, 2)), 1);
    /* Crossing walls. */
    assert_int_equal(count_of(f.set, s, segment(0.2, -0.2, 0.2, 2)), 1);
    assert_int_equal(count_of(f.set, s, segment(0.2, -0.4, 0.2, 2)), 0);
    /* Of zero length, and with equal lines. */
    assert_int_equal(count_of(f.set, s, segment(0, 0, 0, 0)), 0);
    assert_int_equal(count_of(f.set, s, s), 0);
    test_pool_free(&f.pool);
}

static void test_strength_is_the_nearer_far_end(void **state)
{
    struct fixture f = small_set();
    cairn_segment both[2] = {segment(0.1, 0, 3, 0), segment(0, 2, 0, -0.2)};
    int32_t found;
    const cairn_corner *c = search(f.set, both, 2, &found);

    (void)state;
    assert_int_equal(found, 1);
    assert_near(c->strength, 2, 1e-6);
    both[0].b.x = CAIRN_REAL(1.5);
    c = search(f.set, both, 2, &found);
    assert_near(c->strength, 1.5, 1e-6);
    test_pool_free(&f.pool);
}

static void compare_with_slow(cairn_corner_params p, uint64_t seed)
{
    static cairn_corner slow[ALL_PAIRS];
    cairn_segment segments[ITEM_COUNT];
    cairn_corner_params unmerged = p;
    struct fixture f = set_with(p);
    int32_t found, expected, raw, wanted;
    const cairn_corner *fast;

    scatter(segments, ITEM_COUNT, seed);
    fast = search(f.set, segments, ITEM_COUNT, &found);
    unmerged.merge_radius = 0;
    raw = slow_search(&unmerged, segments, ITEM_COUNT, slow);
    expected = slow_search(&p, segments, ITEM_COUNT, slow);
    assert_true(expected > 60);
    wanted = expected < p.max_corners ? expected : p.max_corners;
    assert_int_equal(found, wanted);
    assert_int_equal(cairn_corner_dropped(f.set), raw > p.max_corners ? raw - p.max_corners : 0);
    for (int32_t i = 0; i < found; i++)
        assert_same_corner(&fast[i], &slow[i], NUMBER(1e-11, 2e-4));
    test_pool_free(&f.pool);
}

static void test_all_pairs(void **state)
{
    cairn_corner_params p = cairn_corner_default();

    (void)state;
    p.max_corners = 1000;
    p.merge_radius = 0;
    for (uint64_t seed = 1; seed <= 5; seed++)
        compare_with_slow(p, seed);
    p.merge_radius = CAIRN_REAL(0.3);
    p.merge_angle = CAIRN_REAL(0.2);
    for (uint64_t seed = 1; seed <= 5; seed++)
        compare_with_slow(p, seed);
    p.crossings = 1;
    for (uint64_t seed = 1; seed <= 5; seed++)
        compare_with_slow(p, seed);
}

/* L, T and X, 0.2 m and 0.4 m from touching, with and without crossings. */
static void test_crossings(void **state)
{
    cairn_corner_params p = cairn_corner_default();
    cairn_segment wall = segment(-2, 0, 2, 0), l = segment(2, 0.2, 2, 3),
                  t = segment(0.5, 0.2, 0.5, 3);
    cairn_segment x = segment(0.5, -3, 0.5, 3), far = segment(0.5, 0.4, 0.5, 3),
                  beyond = segment(2.4, -3, 2.4, 3);
    struct fixture without = set_with(p), with;
    const cairn_corner *c;
    cairn_segment both[2] = {wall, x};
    int32_t found;

    (void)state;
    p.crossings = 1;
    with = set_with(p);
    assert_int_equal(count_of(without.set, wall, l), 1);
    assert_int_equal(count_of(without.set, wall, t), 0);
    assert_int_equal(count_of(without.set, wall, x), 0);
    assert_int_equal(count_of(with.set, wall, l), 1);
    assert_int_equal(count_of(with.set, wall, t), 1);
    assert_int_equal(count_of(with.set, t, wall), 1);
    assert_int_equal(count_of(with.set, wall, x), 1);
    assert_int_equal(count_of(with.set, wall, far), 0);
    assert_int_equal(count_of(with.set, wall, beyond), 0);
    /* The legs of a crossing are the longer parts of its segments; the strength is that of the
     * shorter leg. */
    c = search(with.set, both, 2, &found);
    assert_int_equal(found, 1);
    assert_near(c->position.x, 0.5, 1e-6);
    assert_near(c->position.y, 0, 1e-6);
    assert_near(c->strength, 2.5, 1e-6);
    test_pool_free(&with.pool);
    test_pool_free(&without.pool);
}

static void test_the_strongest_stay(void **state)
{
    cairn_corner_params p = cairn_corner_default();

    (void)state;
    p.merge_radius = 0;
    for (p.max_corners = 1; p.max_corners <= 40; p.max_corners += 3)
        compare_with_slow(p, 3);
}

/* Equal strengths: a grid of equal crosses, ordered by the indices of their segments. */
static void test_ties_by_index(void **state)
{
    enum { N = 12 };
    cairn_segment segments[2 * N];
    cairn_corner_params p = cairn_corner_default();
    int32_t found;

    (void)state;
    p.merge_radius = 0;
    for (int32_t i = 0; i < N; i++) {
        segments[i] = segment(4 * i, 0, 4 * i + 1, 0);
        segments[2 * N - 1 - i] = segment(4 * i, 0, 4 * i, 1);
    }
    for (p.max_corners = 1; p.max_corners <= N; p.max_corners++) {
        struct fixture f = set_with(p);
        const cairn_corner *c = search(f.set, segments, 2 * N, &found);

        assert_int_equal(found, p.max_corners);
        for (int32_t i = 0; i < found; i++) {
            assert_int_equal(c[i].segment[0], i);
            assert_int_equal(c[i].segment[1], 2 * N - 1 - i);
        }
        test_pool_free(&f.pool);
    }
    /* One segment in several corners: the higher index decides. */
    {
        cairn_segment fan[4] = {segment(0, 0, 1, 0), segment(0, 1, 0, 0), segment(0, 0, 0, 1),
                                segment(0, -1, 0, 0)};
        struct fixture f = small_set();
        const cairn_corner *c = search(f.set, fan, 4, &found);

        assert_int_equal(found, 3);
        for (int32_t i = 0; i < 3; i++)
            assert_int_equal(c[i].segment[0] + c[i].segment[1], i + 1);
        test_pool_free(&f.pool);
    }
}

static void test_merging(void **state)
{
    struct fixture f = small_set();
    /* A corner, seen again slightly displaced and shorter. */
    cairn_segment s[4] = {segment(0, 0, 2, 0), segment(0, 2, 0, 0), segment(0.05, 0.05, 1, 0.05),
                          segment(0.05, 1, 0.05, 0.05)};
    int32_t found;
    const cairn_corner *c = search(f.set, s, 4, &found);

    (void)state;
    assert_int_equal(found, 1);
    assert_near(c->strength, 2, 1e-6);
    /* From the other side it is another kind and stays. */
    s[2] = reversed(s[2]);
    s[3] = reversed(s[3]);
    c = search(f.set, s, 4, &found);
    assert_int_equal(found, 3); /* and those of one segment of each, which are merged */
    assert_int_equal(c[0].kind, CAIRN_CORNER_CONCAVE);
    assert_int_equal(c[1].kind, CAIRN_CORNER_MIXED);
    assert_int_equal(c[2].kind, CAIRN_CORNER_CONVEX);
    /* Too far off. */
    s[2] = segment(0.09, 0.09, 1, 0.09);
    s[3] = segment(0.09, 1, 0.09, 0.09);
    (void)search(f.set, s, 4, &found);
    assert_int_equal(found, 2);
    test_pool_free(&f.pool);
}

static void test_budgets_are_equal(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    cairn_segment segments[ITEM_COUNT];
    cairn_corner_params p = cairn_corner_default();
    struct fixture whole;
    int32_t found, count;
    const cairn_corner *expected;

    (void)state;
    p.max_corners = 50;
    scatter(segments, ITEM_COUNT, 9);
    whole = set_with(p);
    expected = search(whole.set, segments, ITEM_COUNT, &found);
    for (int i = 0; i < 3; i++) {
        struct fixture f = set_with(p);
        int32_t steps = 0, units = 0;
        cairn_status status;
        const cairn_corner *c;

        assert_ok(cairn_corner_begin(f.set, segments, ITEM_COUNT));
        do {
            cairn_budget budget = {0};

            /* Nothing for nothing. */
            status = cairn_corner_step(f.set, &budget);
            assert_status(status, CAIRN_MORE);
            assert_int_equal(budget.left, 0);
            budget.left = budgets[i];
            status = cairn_corner_step(f.set, &budget);
            assert_true(budget.left >= -3);
            units += budgets[i] - budget.left;
            (void)cairn_corner_list(f.set, &count);
            assert_int_equal(count, status == CAIRN_OK ? found : 0);
            steps++;
        } while (status == CAIRN_MORE);
        assert_ok(status);
        /* Fixed values: they change when the charges or the amount of work change. */
        assert_int_equal(units, NUMBER(4091, 4308));
        assert_true(steps > (budgets[i] == 1 ? 300 : budgets[i] == 7 ? 100 : 1));
        c = cairn_corner_list(f.set, &count);
        assert_int_equal(count, found);
        assert_int_equal(cairn_corner_dropped(f.set), cairn_corner_dropped(whole.set));
        assert_true(cairn_corner_dropped(f.set) > 0);
        for (int32_t k = 0; k < found; k++)
            assert_same_corner(&c[k], &expected[k], 0);
        test_pool_free(&f.pool);
    }
    test_pool_free(&whole.pool);
}

static void test_statuses(void **state)
{
    struct fixture f = small_set();
    cairn_segment s[3] = {segment(0, 0, 1, 0), segment(0, 1, 0, 0), segment(5, 5, 6, 5)};
    static cairn_segment many[257];
    cairn_budget budget = {100}, none = {0};
    int32_t found;

    (void)state;
    assert_ok(cairn_corner_step(f.set, &none));
    (void)cairn_corner_list(f.set, &found);
    assert_int_equal(found, 0);
    assert_status(cairn_corner_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_corner_step(f.set, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_corner_begin(NULL, s, 3), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_corner_begin(f.set, NULL, 3), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_corner_begin(f.set, s, -1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_corner_begin(f.set, many, 257), CAIRN_FULL);
    (void)search(f.set, s, 3, &found);
    assert_int_equal(found, 1);

    /* Non-finite input ends the search; the last result stays. */
    for (int i = 0; i < 4; i++) {
        cairn_segment bad[3] = {s[0], s[1], s[2]};
        cairn_real *place = i == 0   ? &bad[2].a.x
                            : i == 1 ? &bad[2].a.y
                            : i == 2 ? &bad[1].b.x
                                     : &bad[0].b.y;

        *place = i % 2 ? (cairn_real)NAN : (cairn_real)INFINITY;
        assert_ok(cairn_corner_begin(f.set, bad, 3));
        budget.left = 100;
        assert_status(cairn_corner_step(f.set, &budget), CAIRN_NOT_FINITE);
        (void)cairn_corner_list(f.set, &found);
        assert_int_equal(found, 1);
        assert_ok(cairn_corner_step(f.set, &none));
    }

    /* Zero budget, then a new search during another. */
    assert_ok(cairn_corner_begin(f.set, s, 3));
    assert_status(cairn_corner_step(f.set, &none), CAIRN_MORE);
    budget.left = 4;
    assert_status(cairn_corner_step(f.set, &budget), CAIRN_MORE);
    (void)search(f.set, NULL, 0, &found);
    assert_int_equal(found, 0);
    (void)search(f.set, s, 2, &found);
    assert_int_equal(found, 1);
    test_pool_free(&f.pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_params_are_refused),
        cmocka_unit_test(test_limits_of_params),
        cmocka_unit_test(test_memory_is_exact),
        cmocka_unit_test(test_kind_and_legs),
        cmocka_unit_test(test_limits_of_the_opening),
        cmocka_unit_test(test_limits_of_the_distance),
        cmocka_unit_test(test_strength_is_the_nearer_far_end),
        cmocka_unit_test(test_all_pairs),
        cmocka_unit_test(test_crossings),
        cmocka_unit_test(test_the_strongest_stay),
        cmocka_unit_test(test_ties_by_index),
        cmocka_unit_test(test_merging),
        cmocka_unit_test(test_budgets_are_equal),
        cmocka_unit_test(test_statuses),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
