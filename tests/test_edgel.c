/* Sub-pixel edgels: accuracy on discs and steps, comparison with a reference implementation,
 * images of any layout, refusals. */
#include "tests/test.h"

#include <math.h>

#include "cairn/edgel.h"

#define PI     3.14159265358979323846
#define DEGREE (PI / 180)

enum { SIDE = 96, SMALL = 40, REACH_MOST = 40 };

static uint8_t picture[SIDE * SIDE];

static cairn_raster_u8_view view_of(int32_t width, int32_t height)
{
    cairn_raster_u8_view view = {picture, width, height, width};

    return view;
}

static cairn_edgel_params small_params(void)
{
    cairn_edgel_params params = cairn_edgel_default();

    params.max_width = params.max_height = SIDE;
    params.max_edgels = 4000;
    return params;
}

struct fixture {
    cairn_pool pool;
    cairn_edgel_set *set;
};

static struct fixture set_with(cairn_edgel_params params)
{
    struct fixture f;

    f.pool = test_pool(cairn_edgel_memory(&params));
    assert_ok(cairn_edgel_create(&f.set, &f.pool, &params));
    return f;
}

static const cairn_edgel *find(cairn_edgel_set *set, cairn_raster_u8_view view, int32_t *count)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(cairn_edgel_begin(set, view));
    assert_ok(cairn_edgel_step(set, &budget));
    return cairn_edgel_list(set, count);
}

/* ---- Pictures ---- */

/* The share of a pixel within a disc, by 64 samples. */
static double share_inside(double x, double y, double r)
{
    int32_t inside = 0;

    for (int32_t i = 0; i < 64; i++) {
        int32_t row = i / 8;

        inside += hypot(x + (i % 8 + 0.5) / 8 - 0.5, y + (row + 0.5) / 8 - 0.5) <= r;
    }
    return inside / 64.0;
}

/* A disc 100 grey levels above its background. */
static void draw_disc(int32_t side, double cx, double cy, double r, double noise,
                      cairn_random *random)
{
    for (int32_t i = 0; i < side * side; i++) {
        int32_t y = i / side;
        double grey = 80 + 100 * share_inside(i % side - cx, y - cy, r);

        grey += noise > 0 ? noise * (double)cairn_random_normal(random) : 0;
        picture[i] = (uint8_t)fmax(0, fmin(255, rint(grey)));
    }
}

/* Grey levels `low` left of x = at and `high` right of it; the pixel between as it is covered. */
static void draw_step(double at, double low, double high)
{
    for (int32_t i = 0; i < SMALL * SMALL; i++) {
        double right = fmax(0, fmin(1, i % SMALL + 0.5 - at));

        picture[i] = (uint8_t)rint(low + (high - low) * right);
    }
}

static void draw_noise(int32_t pixels, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 0);

    for (int32_t i = 0; i < pixels; i++)
        picture[i] = (uint8_t)cairn_random_below(&random, 256);
}

/* ---- What is found ---- */

static void a_straight_edge_lies_where_it_is(void **state)
{
    struct fixture f = set_with(small_params());

    (void)state;
    for (int32_t k = 0; k <= 10; k++) {
        double at = 19.5 + k / 10.0;
        const cairn_edgel *e;
        int32_t count;

        draw_step(at, k % 2 ? 40 : 220, k % 2 ? 220 : 40);
        e = find(f.set, view_of(SMALL, SMALL), &count);
        assert_int_equal(count, SMALL);
        for (int32_t i = 0; i < count; i++) {
            assert_near(e[i].position.x, at, 0.06);
            assert_near(e[i].position.y, i, 0);
            assert_near(e[i].normal.x, k % 2 ? 1 : -1, NUMBER(1e-9, 1e-4));
            assert_near(e[i].normal.y, 0, NUMBER(1e-9, 1e-3));
            /* The height of the step times the Gaussian's peak, reduced slightly by the pixel's own
             * width. */
            assert_near(e[i].gradient_magnitude, 180 / (1.5 * sqrt(2 * PI)), 3);
        }
    }
    test_pool_free(&f.pool);
}

static double angle_between(double ax, double ay, double bx, double by)
{
    return asin(fmin(1, fabs(ax * by - ay * bx) / (hypot(ax, ay) * hypot(bx, by))));
}

static double sobel_error(double x, double y, double cx, double cy)
{
    int32_t at = (int32_t)rint(y) * SIDE + (int32_t)rint(x);
    const uint8_t *p = &picture[at];
    double gx = p[1 - SIDE] + 2.0 * p[1] + p[1 + SIDE] - p[-1 - SIDE] - 2.0 * p[-1] - p[SIDE - 1];
    double gy =
        p[SIDE - 1] + 2.0 * p[SIDE] + p[SIDE + 1] - p[-SIDE - 1] - 2.0 * p[-SIDE] - p[1 - SIDE];

    return angle_between(gx, gy, rint(x) - cx, rint(y) - cy);
}

/* Near noisy circles: errors of the angle, and Sobel's at the same pixels. Every direction of the
 * circle occurs. */
static void normals_of_circles_beat_sobel(void **state)
{
    struct fixture f = set_with(small_params());
    cairn_random random = cairn_random_seed(3, 0);

    (void)state;
    for (int32_t level = 0; level < 4; level++) {
        double error = 0, sobel = 0, off = 0;
        int32_t total = 0;

        for (int32_t k = 0; k < 6; k++) {
            double cx = 47.3 + 0.13 * k, cy = 48.2 - 0.17 * k, r = 10 + 5 * k;
            uint8_t met[20] = {0};
            const cairn_edgel *e;
            int32_t count, near = 0;

            draw_disc(SIDE, cx, cy, r, 5 * level, &random);
            e = find(f.set, view_of(SIDE, SIDE), &count);
            for (int32_t i = 0; i < count; i++) {
                double x = (double)e[i].position.x - cx, y = (double)e[i].position.y - cy,
                       d = hypot(x, y);

                if (fabs(d - r) > 1.5)
                    continue;
                near++;
                /* The disc is the brighter side. */
                assert_true(x * (double)e[i].normal.x + y * (double)e[i].normal.y < 0);
                assert_near(hypot((double)e[i].normal.x, (double)e[i].normal.y), 1,
                            NUMBER(1e-12, 1e-5));
                error += angle_between(x, y, (double)e[i].normal.x, (double)e[i].normal.y);
                sobel += sobel_error((double)e[i].position.x, (double)e[i].position.y, cx, cy);
                off += fabs(d - r);
                met[(int32_t)((atan2(y, x) / PI + 1) * 9.999)] = 1;
            }
            for (int32_t i = 0; i < 20; i++)
                assert_int_equal(met[i], 1);
            /* About one for each row or column that the edge crosses. */
            assert_true(near > 5 * r && near < 6.5 * r);
            assert_true(level > 0 || count == near);
            total += near;
        }
        assert_true(error <= 0.5 * sobel);
        assert_true(off / total < 0.07 + 0.03 * level);
        assert_true(error / total < (1 + 0.6 * level) * DEGREE);
    }
    test_pool_free(&f.pool);
}

/* ---- Reference implementation: derivatives over the plane, zero crossings one by one ---- */

struct reference {
    double f[SMALL * SMALL], fx[SMALL * SMALL], fy[SMALL * SMALL], x[SMALL * SMALL],
        y[SMALL * SMALL];
};

/* Weights of a derivative of this order that are exact for x^order and lower powers, by
 * definition. */
static void reference_weights(double sigma, int order, double w[2 * REACH_MOST + 1])
{
    int reach = (int)ceil(4 * sigma);
    double m[4] = {0, 0, 0, 0}, first = 0, second = 0;

    for (int i = -reach; i <= reach; i++) {
        double g = exp(-i * i / (2 * sigma * sigma));

        m[0] += g;
        first += i * i * g;
        second += pow(i, 4) * g;
    }
    for (int i = -reach; i <= reach; i++) {
        double g = exp(-i * i / (2 * sigma * sigma)), raw;

        /* Hermite polynomials whose lower moments vanish in the sampled sums. */
        if (order < 2)
            raw = pow(i, order) * g;
        else if (order == 2)
            raw = (i * i - first / m[0]) * g;
        else
            raw = i * (i * i - second / first) * g;
        w[i + reach] = raw;
        m[3] += raw * pow(i, order);
    }
    for (int i = 0; i <= 2 * reach; i++)
        w[i] *= (order == 3 ? 6 : order == 2 ? 2 : 1) / m[3];
}

static double reference_derivative(double sigma, int32_t px, int32_t py, int along_x, int along_y)
{
    double wx[2 * REACH_MOST + 1], wy[2 * REACH_MOST + 1], sum = 0;
    int reach = (int)ceil(4 * sigma);

    reference_weights(sigma, along_x, wx);
    reference_weights(sigma, along_y, wy);
    for (int v = -reach; v <= reach; v++)
        for (int u = -reach; u <= reach; u++) {
            int32_t x = px + u < 0 ? 0 : px + u >= SMALL ? SMALL - 1 : px + u;
            int32_t y = py + v < 0 ? 0 : py + v >= SMALL ? SMALL - 1 : py + v;

            sum += wx[u + reach] * wy[v + reach] * picture[y * SMALL + x];
        }
    return sum;
}

static void reference_sample(struct reference *t, double sigma, int32_t px, int32_t py)
{
    int32_t at = py * SMALL + px;
    double x = reference_derivative(sigma, px, py, 1, 0),
           y = reference_derivative(sigma, px, py, 0, 1);
    double xx = reference_derivative(sigma, px, py, 2, 0),
           xy = reference_derivative(sigma, px, py, 1, 1);
    double yy = reference_derivative(sigma, px, py, 0, 2),
           xxx = reference_derivative(sigma, px, py, 3, 0);
    double xxy = reference_derivative(sigma, px, py, 2, 1),
           xyy = reference_derivative(sigma, px, py, 1, 2);
    double yyy = reference_derivative(sigma, px, py, 0, 3);

    t->x[at] = x;
    t->y[at] = y;
    t->f[at] = x * x * xx + 2 * x * y * xy + y * y * yy;
    /* By the product rule, term by term. */
    t->fx[at] = 2 * x * xx * xx + x * x * xxx + 2 * (xx * y * xy + x * xy * xy + x * y * xxy) +
                2 * y * xy * yy + y * y * xyy;
    t->fy[at] = 2 * x * xy * xx + x * x * xxy + 2 * (xy * y * xy + x * yy * xy + x * y * xyy) +
                2 * y * yy * yy + y * y * yyy;
}

/* 1 when there is an edgel between two pixels; *undecided: 1 when rounding may decide. */
static int reference_between(const struct reference *t, int32_t a, int32_t b,
                             const cairn_edgel_params *p, cairn_edgel *e, int *undecided)
{
    int32_t row = a / SMALL;
    double from, share, fx, fy, x, y, f, slope, turn;

    *undecided = 0;
    if ((t->f[a] > 0) == (t->f[b] > 0))
        return 0;
    from = t->f[a] / pow(hypot(t->x[a], t->y[a]), 3);
    share = from / (from - t->f[b] / pow(hypot(t->x[b], t->y[b]), 3));
    fx = t->fx[a] + share * (t->fx[b] - t->fx[a]);
    fy = t->fy[a] + share * (t->fy[b] - t->fy[a]);
    x = t->x[a] + share * (t->x[b] - t->x[a]);
    y = t->y[a] + share * (t->y[b] - t->y[a]);
    f = hypot(fx, fy);
    slope = hypot(x, y);
    turn = -(fx * x + fy * y) / (f * slope);
    *undecided = fabs(slope - (double)p->min_gradient) < 1e-3 ||
                 fabs(turn - cos((double)p->max_normal_angle)) < 1e-3 ||
                 fabs(fabs(fx) - fabs(fy)) < 1e-3 * f;
    e->position.x = (cairn_real)(a % SMALL + (b == a + 1 ? share : 0));
    e->position.y = (cairn_real)(row + (b == a + 1 ? 0 : share));
    e->normal.x = (cairn_real)(-fx / f);
    e->normal.y = (cairn_real)(-fy / f);
    e->gradient_magnitude = (cairn_real)slope;
    return slope >= (double)p->min_gradient && turn >= cos((double)p->max_normal_angle) &&
           (fabs(fx) >= fabs(fy)) == (b == a + 1);
}

/* In the order of the rows: at each pixel the link from above first, then the link to the right. */
static void it_agrees_with_the_definition(void **state)
{
    static const double sigmas[] = {0.7, 1.5, 2.3};
    static struct reference t;
    int32_t compared = 0;

    (void)state;
    draw_noise(SMALL * SMALL, 11);
    for (size_t k = 0; k < sizeof sigmas / sizeof *sigmas; k++) {
        cairn_edgel_params params = small_params();
        const cairn_edgel *found;
        struct fixture f;
        int32_t count, next = 0;

        params.sigma = (cairn_real)sigmas[k];
        params.min_gradient = 5;
        f = set_with(params);
        found = find(f.set, view_of(SMALL, SMALL), &count);
        for (int32_t i = 0; i < SMALL * SMALL; i++)
            reference_sample(&t, (double)params.sigma, i % SMALL, i / SMALL);
        for (int32_t i = 0; i < 2 * SMALL * SMALL; i++) {
            int32_t at = i / 2, from = i % 2 ? at : at - SMALL, to = i % 2 ? at + 1 : at;
            cairn_edgel e = {{0, 0}, {0, 0}, 0};
            int undecided, has, met;

            if (from < 0 || (i % 2 && at % SMALL == SMALL - 1))
                continue;
            has = reference_between(&t, from, to, &params, &e, &undecided);
            met = next < count &&
                  hypot((double)(found[next].position.x - e.position.x),
                        (double)(found[next].position.y - e.position.y)) < NUMBER(1e-6, 1e-2);
            if (undecided) {
                next += has && met;
                continue;
            }
            if (!has)
                continue;
            assert_true(met);
            assert_near(found[next].normal.x, e.normal.x, NUMBER(1e-6, 1e-2));
            assert_near(found[next].normal.y, e.normal.y, NUMBER(1e-6, 1e-2));
            assert_near(found[next].gradient_magnitude, e.gradient_magnitude,
                        NUMBER(1e-8, 1e-3) * (1 + (double)e.gradient_magnitude));
            next++;
            compared++;
        }
        assert_int_equal(next, count);
        test_pool_free(&f.pool);
    }
    assert_true(compared > 500);
}

static void limits_leave_edgels_out(void **state)
{
    cairn_edgel_params params = small_params();
    const cairn_edgel *e;
    struct fixture f;
    int32_t all, count;

    (void)state;
    draw_noise(SMALL * SMALL, 12);
    params.max_normal_angle = (cairn_real)(PI / 2);
    f = set_with(params);
    e = find(f.set, view_of(SMALL, SMALL), &all);
    test_pool_free(&f.pool);
    params.max_normal_angle = (cairn_real)(20 * DEGREE);
    params.min_gradient = 20;
    f = set_with(params);
    e = find(f.set, view_of(SMALL, SMALL), &count);
    assert_true(count > 10 && count < all - 100);
    for (int32_t i = 0; i < count; i++)
        assert_true(e[i].gradient_magnitude >= 20);
    test_pool_free(&f.pool);
    /* A step of 60 levels has a slope of 15 to 16 at sigma 1.5. */
    params.min_gradient = 17;
    f = set_with(params);
    draw_step(20, 100, 160);
    (void)find(f.set, view_of(SMALL, SMALL), &count);
    assert_int_equal(count, 0);
    test_pool_free(&f.pool);
    params.min_gradient = 14;
    f = set_with(params);
    (void)find(f.set, view_of(SMALL, SMALL), &count);
    assert_int_equal(count, SMALL);
    test_pool_free(&f.pool);
}

/* ---- Images of any size and layout ---- */

static void pictures_without_edges(void **state)
{
    struct fixture f = set_with(small_params());
    int32_t count;

    (void)state;
    memset(picture, 77, sizeof picture);
    assert_non_null(find(f.set, view_of(SIDE, SIDE), &count));
    assert_int_equal(count, 0);
    picture[0] = 200;
    (void)find(f.set, view_of(1, 1), &count);
    assert_int_equal(count, 0);
    for (int32_t i = 0; i < SIDE; i++)
        picture[i] = i < SIDE / 2 ? 20 : 200;
    (void)find(f.set, view_of(SIDE, 1), &count);
    assert_int_equal(count, 1);
    (void)find(f.set, view_of(1, SIDE), &count);
    assert_int_equal(count, 1);
    test_pool_free(&f.pool);
}

/* A view from below on every second pixel gives the same as an image of those. */
static void strides_do_not_matter(void **state)
{
    static uint8_t copy[SMALL * SMALL], wide[SIDE * SIDE];
    struct fixture f = set_with(small_params()), other = set_with(small_params());
    cairn_raster_u8_view turned = {&wide[(SMALL - 1) * SIDE], SMALL, SMALL, -SIDE},
                         plain = {copy, SMALL, SMALL, SMALL};
    const cairn_edgel *e, *o;
    int32_t count, others;

    (void)state;
    draw_noise(SIDE * SIDE, 13);
    memcpy(wide, picture, sizeof wide);
    for (int32_t i = 0; i < SMALL * SMALL; i++)
        copy[i] = wide[(SMALL - 1 - i / SMALL) * SIDE + i % SMALL];
    e = find(f.set, turned, &count);
    o = find(other.set, plain, &others);
    assert_int_equal(count, others);
    assert_memory_equal(e, o, (size_t)count * sizeof *e);
    test_pool_free(&f.pool);
    test_pool_free(&other.pool);
}

static void budgets_do_not_matter(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    struct fixture f = set_with(small_params()), other = set_with(small_params());
    const cairn_edgel *e;
    int32_t count;

    (void)state;
    draw_noise(SMALL * SMALL, 14);
    e = find(f.set, view_of(SMALL, SMALL), &count);
    for (size_t k = 0; k < sizeof budgets / sizeof *budgets; k++) {
        cairn_status status = CAIRN_MORE;
        const cairn_edgel *again;
        int32_t found;

        assert_ok(cairn_edgel_begin(other.set, view_of(SMALL, SMALL)));
        while (status == CAIRN_MORE) {
            cairn_budget budget = {budgets[k]};

            assert_null(cairn_edgel_list(other.set, &found));
            assert_int_equal(found, 0);
            status = cairn_edgel_step(other.set, &budget);
            assert_true(budget.left >= 0 && (status != CAIRN_MORE || budget.left == 0));
        }
        assert_ok(status);
        again = cairn_edgel_list(other.set, &found);
        assert_int_equal(found, count);
        assert_memory_equal(again, e, (size_t)count * sizeof *e);
    }
    test_pool_free(&f.pool);
    test_pool_free(&other.pool);
}

static cairn_status begin_noise(void *context)
{
    return cairn_edgel_begin(context, view_of(SMALL, SMALL));
}

static cairn_status step_set(void *context, cairn_budget *budget)
{
    return cairn_edgel_step(context, budget);
}

static uint64_t hash_set(void *context)
{
    int32_t count;
    const cairn_edgel *e = cairn_edgel_list(context, &count);

    return test_hash(TEST_HASH_START, e, (size_t)count * sizeof *e);
}

static void it_begins_anew(void **state)
{
    struct fixture f = set_with(small_params());
    test_stepped object = {begin_noise, step_set, hash_set, f.set};

    (void)state;
    draw_noise(SMALL * SMALL, 15);
    test_begins_anew(&object, 6);
    test_pool_free(&f.pool);
}

/* Thirteen taps at sigma 1.5: a pixel costs 1 + 4 * 13 / 48 along its row, 1 + 9 * 13 / 48
 * across, and 1. */
static void work_is_charged(void **state)
{
    struct fixture f = set_with(small_params());
    cairn_budget budget = {10000};

    (void)state;
    assert_ok(cairn_edgel_begin(f.set, view_of(30, 20)));
    assert_ok(cairn_edgel_step(f.set, &budget));
    assert_int_equal(10000 - budget.left, 600 * (2 + 3 + 1));
    assert_ok(cairn_edgel_step(f.set, &budget));
    assert_int_equal(10000 - budget.left, 600 * (2 + 3 + 1));
    test_pool_free(&f.pool);
}

/* ---- Refusals ---- */

static void bad_pictures_are_refused(void **state)
{
    cairn_edgel_params params = small_params();
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_raster_u8_view no_data = {NULL, 4, 4, 4};
    struct fixture f;
    int32_t count, all;

    (void)state;
    params.max_width = 50;
    params.max_height = SMALL;
    f = set_with(params);
    draw_noise(SMALL * SMALL, 16);
    (void)find(f.set, view_of(SMALL, SMALL), &all);
    assert_status(cairn_edgel_begin(NULL, view_of(4, 4)), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_edgel_begin(f.set, no_data), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_edgel_begin(f.set, view_of(51, 1)), CAIRN_FULL);
    assert_status(cairn_edgel_begin(f.set, view_of(1, SMALL + 1)), CAIRN_FULL);
    assert_ok(cairn_edgel_step(f.set, &budget));
    assert_non_null(cairn_edgel_list(f.set, &count));
    assert_int_equal(count, all);
    assert_non_null(cairn_edgel_list(f.set, NULL));
    assert_status(cairn_edgel_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_edgel_step(f.set, NULL), CAIRN_BAD_ARGUMENT);
    assert_null(cairn_edgel_list(NULL, &count));
    assert_int_equal(count, 0);
    test_pool_free(&f.pool);
}

static void too_many_edgels(void **state)
{
    cairn_edgel_params params = small_params();
    cairn_budget budget = {CAIRN_UNBOUNDED};
    struct fixture f;
    int32_t count;

    (void)state;
    params.max_edgels = SMALL;
    f = set_with(params);
    draw_step(20, 20, 200);
    (void)find(f.set, view_of(SMALL, SMALL), &count);
    assert_int_equal(count, SMALL);
    test_pool_free(&f.pool);
    params.max_edgels = SMALL - 1;
    f = set_with(params);
    for (int32_t k = 0; k < 2; k++) {
        /* Upright, then lying: both exceed the capacity by one. */
        for (int32_t i = 0; k > 0 && i < SMALL * SMALL; i++)
            picture[i] = i / SMALL < SMALL / 2 ? 20 : 200;
        assert_ok(cairn_edgel_begin(f.set, view_of(SMALL, SMALL)));
        assert_status(cairn_edgel_step(f.set, &budget), CAIRN_FULL);
        assert_null(cairn_edgel_list(f.set, &count));
        assert_int_equal(count, 0);
        assert_ok(cairn_edgel_step(f.set, &budget));
        assert_null(cairn_edgel_list(f.set, NULL));
    }
    test_pool_free(&f.pool);
}

static void the_ends_of_the_ranges_are_accepted(void **state)
{
    cairn_edgel_params good = small_params(), p = good;
    cairn_edgel_set *set = NULL;

    (void)state;
    assert_status(cairn_edgel_create(&set, NULL, &good), CAIRN_BAD_ARGUMENT);
    p.max_normal_angle = CAIRN_PI / 2;
    p.max_height = CAIRN_RASTER_MAX_SIDE;
    assert_int_equal(cairn_edgel_memory(&p), cairn_edgel_memory(&good));
    p.max_width = CAIRN_RASTER_MAX_SIDE;
    p.max_edgels = 1 << 28;
    p.sigma = CAIRN_REAL(0.7);
    assert_true(cairn_edgel_memory(&p) > 0);
    p.sigma = 8;
    assert_true(cairn_edgel_memory(&p) > 0);
}

static cairn_status create_in(void *context, cairn_pool *pool)
{
    cairn_edgel_set *set;

    return cairn_edgel_create(&set, pool, context);
}

static void memory_is_exactly_as_stated(void **state)
{
    cairn_edgel_params params = small_params();

    (void)state;
    params.max_width = 5;
    params.max_edgels = 7;
    test_every_pool_size(create_in, &params, cairn_edgel_memory(&params));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_straight_edge_lies_where_it_is),
        cmocka_unit_test(normals_of_circles_beat_sobel),
        cmocka_unit_test(it_agrees_with_the_definition),
        cmocka_unit_test(limits_leave_edgels_out),
        cmocka_unit_test(pictures_without_edges),
        cmocka_unit_test(strides_do_not_matter),
        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(it_begins_anew),
        cmocka_unit_test(work_is_charged),
        cmocka_unit_test(bad_pictures_are_refused),
        cmocka_unit_test(too_many_edgels),
        cmocka_unit_test(the_ends_of_the_ranges_are_accepted),
        cmocka_unit_test(memory_is_exactly_as_stated),
    };
    return cmocka_run_group_tests_name("edgel", tests, NULL, NULL);
}
