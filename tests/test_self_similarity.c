/* Axes of symmetry: generated shapes with known axes, the thesis's search compared with a
 * reference implementation, refusals. */
#include "tests/test.h"

#include <math.h>

#include "cairn/curve_evolution.h"
#include "cairn/inner_distance.h"
#include "cairn/self_similarity.h"

enum { MAX_COUNT = 400 };

#define PI 3.14159265358979324

static cairn_vec2 at(double x, double y)
{
    cairn_vec2 v = {(cairn_real)x, (cairn_real)y};

    return v;
}

static cairn_curve closed(const cairn_vec2 *points, int32_t count)
{
    cairn_curve c = {points, count, 1};

    return c;
}

typedef struct fixture {
    cairn_pool pool;
    cairn_self_similarity *similarity;
} fixture;

static fixture new_fixture(const cairn_self_similarity_params *params)
{
    fixture l;

    l.pool = test_pool(cairn_self_similarity_memory(params));
    assert_ok(cairn_self_similarity_create(&l.similarity, &l.pool, params));
    return l;
}

static fixture of_mode(int32_t mode)
{
    cairn_self_similarity_params params = cairn_self_similarity_default();

    params.mode = mode;
    return new_fixture(&params);
}

static cairn_self_similarity_result find_axes(fixture *l, const cairn_curve *outlines,
                                              int32_t count)
{
    cairn_budget budget = {INT32_MAX};

    assert_ok(cairn_self_similarity_begin(l->similarity, outlines, count));
    assert_ok(cairn_self_similarity_step(l->similarity, &budget));
    return cairn_self_similarity_read(l->similarity);
}

/* The farther of two ends from their expected places, in either order, as shares of the outline. */
static double ends_off(const cairn_self_similarity_axis *axis, double first, double second)
{
    double off[2];

    for (int flip = 0; flip < 2; flip++) {
        double a = fabs((double)axis->position[flip] - first),
               b = fabs((double)axis->position[1 - flip] - second);

        off[flip] = fmax(fmin(a, 1 - a), fmin(b, 1 - b));
    }
    return fmin(off[0], off[1]);
}

/* ---- Shapes ---- */

/* A pear of 100 along its axis, from the first vertex to the middle one: bent by `bend`, then
 * sheared. *half: the share of the outline from the first to the middle vertex. */
static cairn_curve pear(cairn_vec2 *p, int32_t count, double wide, double bend, double skew,
                        double *half)
{
    double length[2] = {0, 0};

    for (int32_t i = 0; i < count; i++) {
        double t = 0.5 - 0.5 * cos(2 * PI * i / count), turned = bend * t, radius = 100 / bend;
        double width = wide * sin(PI * sqrt(t)) * (i < count / 2 ? 1 : -1), x = 100 * t, y = width;

        if (bend != 0) {
            x = (radius - width) * sin(turned);
            y = radius - (radius - width) * cos(turned);
        }
        p[i] = at(50 + x + skew * y, 20 + y);
    }
    for (int32_t i = 0; i < count; i++)
        length[i >= count / 2] +=
            hypot((double)(p[i].x - p[(i + 1) % count].x), (double)(p[i].y - p[(i + 1) % count].y));
    *half = length[0] / (length[0] + length[1]);
    return closed(p, count);
}

static cairn_curve regular(cairn_vec2 *p, int32_t count, double turn)
{
    for (int32_t i = 0; i < count; i++)
        p[i] = at(300 + 50 * cos(turn + 2 * PI * i / count),
                  200 + 50 * sin(turn + 2 * PI * i / count));
    return closed(p, count);
}

/* ---- Reference implementation: the thesis's search ---- */

typedef struct slow {
    double unlike[96][96];
    cairn_curve_evolution_result levels;
    double best, end[2];
    int32_t vertices;
} slow;

/* The sum of the best path from corner to corner. */
static double slow_warp(const slow *s, const int32_t *a, int32_t na, const int32_t *b, int32_t nb)
{
    static double sum[32][32];

    for (int32_t i = 0; i < na; i++)
        for (int32_t k = 0; k < nb; k++) {
            static const int8_t move[3][2] = {{1, 1}, {1, 0}, {0, 1}};
            double least = i + k == 0 ? 0 : 1e9;

            for (int m = 0; m < 3 && i + k > 0; m++) {
                int32_t u = i - move[m][0], v = k - move[m][1];

                if (u >= 0 && v >= 0 && sum[u][v] < least)
                    least = sum[u][v];
            }
            sum[i][k] = least + s->unlike[a[i]][b[k]];
        }
    return sum[na - 1][nb - 1];
}

static double between(double last, double first, double n)
{
    double gap = fmod(first - last + n, n);

    return fmod(last + gap / 2, n) / n;
}

/* All sets S = (i ... j) and T from j or j + 1 to i or i - 1, as in section 4.4. */
static void slow_level(slow *s, int32_t m)
{
    int32_t v[32], n = 0;

    for (int32_t i = 0; i < s->levels.count; i++)
        if (s->levels.rank[i] < m)
            v[n++] = i;
    for (int32_t i = 0; i < n; i++)
        for (int32_t j = 0; j < n; j++) {
            if (i == j || (i + 1) % n == j || (j + 1) % n == i)
                continue;
            for (int share_j = 0; share_j < 2; share_j++)
                for (int share_i = 0; share_i < 2; share_i++) {
                    int32_t a[32], b[32], na = 0, nb = 0, from = share_j ? j : (j + 1) % n,
                                          to = share_i ? i : (i + n - 1) % n;
                    double cost;

                    for (int32_t k = i;; k = (k + 1) % n) {
                        a[na++] = v[k];
                        if (k == j)
                            break;
                    }
                    for (int32_t k = to;; k = (k + n - 1) % n) {
                        b[nb++] = v[k];
                        if (k == from)
                            break;
                    }
                    cost = slow_warp(s, a, na, b, nb);
                    if (cost < s->best - 1e-9) {
                        s->best = cost;
                        s->end[0] = between(v[to], v[i], s->levels.count);
                        s->end[1] = between(v[j], v[from], s->levels.count);
                        s->vertices = n;
                    }
                }
        }
}

static void slow_search(slow *s, const cairn_vec2 *samples, int32_t count)
{
    cairn_inner_distance_params inner_params = {.max_points = 96, .fill_holes = 0};
    cairn_curve_evolution_params evolution_params = {.max_points = 96,
                                                     .mode = CAIRN_MODE_AS_WRITTEN};
    cairn_pool pool = test_pool(cairn_inner_distance_memory(&inner_params) +
                                cairn_curve_evolution_memory(&evolution_params));
    cairn_budget budget = {INT32_MAX};
    cairn_curve outline = closed(samples, count);
    cairn_inner_distance *inner;
    cairn_inner_distance_result d;
    cairn_curve_evolution *evolution;

    assert_ok(cairn_inner_distance_create(&inner, &pool, &inner_params));
    assert_ok(cairn_curve_evolution_create(&evolution, &pool, &evolution_params));
    assert_ok(cairn_inner_distance_begin(inner, &outline, 1));
    assert_ok(cairn_inner_distance_step(inner, &budget));
    assert_ok(cairn_curve_evolution_begin(evolution, samples, count));
    assert_ok(cairn_curve_evolution_step(evolution, &budget));
    d = cairn_inner_distance_read(inner);
    s->levels = cairn_curve_evolution_read(evolution);
    for (int32_t i = 0; i < count; i++)
        for (int32_t k = 0; k < count; k++) {
            double sum = 0;

            for (int32_t m = 0; m < count; m++) {
                double ahead = (double)d.distance[i * d.stride + (i + m) % count];
                double behind = (double)d.distance[k * d.stride + (k - m + count) % count];

                sum += (ahead - behind) * (ahead - behind);
            }
            s->unlike[i][k] = sqrt(sum / count) / (double)d.max_distance;
        }
    s->best = 1e9;
    for (int32_t m = 5; m <= 20; m++)
        slow_level(s, m);
    test_pool_free(&pool);
}

static void searches_as_the_reference(void **state)
{
    fixture l = of_mode(CAIRN_MODE_AS_WRITTEN);

    (void)state;
    for (uint64_t seed = 0; seed < 6; seed++) {
        cairn_random random = cairn_random_seed(seed, 3);
        cairn_self_similarity_result r;
        cairn_vec2 p[30];
        cairn_curve c = closed(p, 30);
        static slow s;

        for (int32_t i = 0; i < 30; i++) {
            double radius = 30 + (double)cairn_random_uniform(&random, -15, 15),
                   turn = 2 * PI * i / 30;

            p[i] = at(1.5 * radius * cos(turn), radius * sin(turn));
        }
        r = find_axes(&l, &c, 1);
        slow_search(&s, r.samples, r.sample_count);
        assert_near(r.axes[0].dissimilarity, s.best, NUMBER(1e-9, 1e-5));
#ifndef CAIRN_FLOAT
        assert_int_equal(r.axes[0].vertices, s.vertices);
        assert_near(ends_off(&r.axes[0], s.end[0], s.end[1]), 0, 1e-9);
#endif
        assert_in_range(r.axes[0].division, 1, 4);
        for (int32_t i = 1; i < r.count; i++)
            assert_true(r.axes[i - 1].dissimilarity <= r.axes[i].dissimilarity);
    }
    test_pool_free(&l.pool);
}

/* Invariants of every result. */
static void assert_sound(const cairn_self_similarity_result *r, int32_t mode)
{
    assert_true(r->count >= 1 && r->count <= CAIRN_SELF_SIMILARITY_MAX_AXES && r->tie_count >= 1 &&
                r->tie_count <= r->count);
    assert_int_equal(r->verdict, r->tie_count == 1        ? CAIRN_SELF_SIMILARITY_SINGLE
                                 : r->rotation_order == 0 ? CAIRN_SELF_SIMILARITY_CIRCULAR
                                                          : CAIRN_SELF_SIMILARITY_MULTIPLE);
    for (int32_t i = 0; i < r->count; i++) {
        const cairn_self_similarity_axis *a = &r->axes[i];

        assert_true(a->dissimilarity >= 0 && cairn_is_finite(a->dissimilarity));
        for (int32_t k = 0; k < 2; k++) {
            double place = (double)a->position[k] * r->sample_count;
            int32_t low = (int32_t)place;
            cairn_vec2 from = r->samples[low % r->sample_count],
                       to = r->samples[(low + 1) % r->sample_count];

            assert_true(a->position[k] >= 0 && a->position[k] < 1);
            assert_near(a->end[k].x, from.x + (to.x - from.x) * (cairn_real)(place - low),
                        NUMBER(1e-9, 1e-2));
            assert_near(a->end[k].y, from.y + (to.y - from.y) * (cairn_real)(place - low),
                        NUMBER(1e-9, 1e-2));
            assert_true(a->arc[k].from >= 0 && a->arc[k].from < 1 &&
                        (a->arc[k].to > a->arc[k].from || mode == CAIRN_MODE_AS_WRITTEN) &&
                        a->arc[k].to >= a->arc[k].from && a->arc[k].to <= a->arc[k].from + 1);
        }
        for (int32_t k = 0; k < i; k++)
            assert_true(ends_off(a, (double)r->axes[k].position[0],
                                 (double)r->axes[k].position[1]) > 0.0499);
    }
}

static void finds_a_plain_axis(void **state)
{
    (void)state;
    for (int32_t mode = 0; mode < 2; mode++)
        for (int wide = 0; wide < 3; wide++) {
            fixture l = of_mode(mode);
            cairn_vec2 p[MAX_COUNT];
            cairn_self_similarity_result r;
            cairn_curve c;
            double half;

            c = pear(p, 200, 15 + 20 * wide, 0, 0, &half);
            r = find_axes(&l, &c, 1);
            assert_sound(&r, mode);
            assert_true(ends_off(&r.axes[0], 0, half) <
                        (mode == CAIRN_MODE_DEFAULT ? 0.006 : 0.05));
            assert_int_equal(r.verdict, CAIRN_SELF_SIMILARITY_SINGLE);
            assert_int_equal(r.rotation_order, 1);
            if (mode == CAIRN_MODE_DEFAULT) {
                assert_near(r.axes[0].bend, 0, 0.03);
                assert_near(r.axes[0].skew, 0, 0.03);
                assert_int_equal(r.axes[0].division, 0);
                assert_near(r.axes[0].arc[0].to - r.axes[0].arc[0].from + r.axes[0].arc[1].to -
                                r.axes[0].arc[1].from,
                            1, 1e-5);
            }
            test_pool_free(&l.pool);
        }
}

static void takes_bends_and_skews_back(void **state)
{
    fixture l = of_mode(CAIRN_MODE_DEFAULT);

    (void)state;
    for (int sign = -1; sign <= 1; sign += 2)
        for (int i = 0; i < 4; i++) {
            double bend = sign * 0.5 * i, skew = i == 0 ? sign * 0.35 : 0, half;
            cairn_vec2 p[MAX_COUNT];
            cairn_self_similarity_result r;
            cairn_curve c = pear(p, 300, 22, bend, skew, &half);

            r = find_axes(&l, &c, 1);
            assert_sound(&r, CAIRN_MODE_DEFAULT);
            assert_true(ends_off(&r.axes[0], 0, half) < 0.01);
            /* The axis may be found from either end. */
            assert_near(fabs((double)r.axes[0].bend), fabs(bend), 0.06);
            assert_near(fabs((double)r.axes[0].skew), fabs(skew), 0.04);
            if ((double)r.axes[0].position[0] < 0.1 || (double)r.axes[0].position[0] > 0.9)
                assert_true(i == 0 || (double)r.axes[0].bend * bend > 0);
            assert_true(i != 0 || (double)r.axes[0].skew * skew > 0);
        }
    test_pool_free(&l.pool);
}

/* A body with two pairs of limbs, the front ones of length `fore`, each rotated at its joint. */
static int32_t beast(cairn_vec2 *p, double fore, double hind, const double turn[4], double *half)
{
    const double joint[4] = {20, 75, 75, 20}, long_ones[4] = {fore, hind, hind, fore};
    double length[2] = {0, 0};
    int32_t n = 0, middle;

    p[n++] = at(0, 0);
    p[n++] = at(3, -10);
    for (int i = 0; i < 2; i++) {
        double c = cos(turn[i]), s = sin(turn[i]);

        p[n++] = at(joint[i] - 4, -12);
        p[n++] = at(joint[i] - 4 * c + long_ones[i] * s, -12 - 4 * s - long_ones[i] * c);
        p[n++] = at(joint[i] + 4 * c + long_ones[i] * s, -12 + 4 * s - long_ones[i] * c);
        p[n++] = at(joint[i] + 4, -12);
    }
    p[n++] = at(95, -6);
    middle = n;
    p[n++] = at(105, 0);
    p[n++] = at(95, 6);
    for (int i = 2; i < 4; i++) {
        double c = cos(turn[i]), s = sin(turn[i]);

        p[n++] = at(joint[i] + 4, 12);
        p[n++] = at(joint[i] + 4 * c + long_ones[i] * s, 12 - 4 * s + long_ones[i] * c);
        p[n++] = at(joint[i] - 4 * c + long_ones[i] * s, 12 + 4 * s + long_ones[i] * c);
        p[n++] = at(joint[i] - 4, 12);
    }
    p[n++] = at(3, 10);
    for (int32_t i = 0; i < n; i++)
        length[i >= middle] +=
            hypot((double)(p[i].x - p[(i + 1) % n].x), (double)(p[i].y - p[(i + 1) % n].y));
    *half = length[0] / (length[0] + length[1]);
    return n;
}

static void joints_do_not_matter(void **state)
{
    static const double turns[][4] = {
        {0, 0, 0, 0}, {0.6, -0.4, 0.7, -0.5}, {-0.7, 0.3, -0.6, 0.8}, {0.9, 0.9, 0.1, -0.7}};
    fixture l = of_mode(CAIRN_MODE_DEFAULT);

    (void)state;
    for (int i = 0; i < 4; i++) {
        cairn_self_similarity_result r;
        cairn_vec2 p[40];
        double half;
        int32_t n = beast(p, 50, 30, turns[i], &half);
        cairn_curve c = closed(p, n);

        r = find_axes(&l, &c, 1);
        assert_sound(&r, CAIRN_MODE_DEFAULT);
        assert_true(ends_off(&r.axes[0], 0, half) < 0.05);
    }
    test_pool_free(&l.pool);
}

/* Front limbs nearly as long as the hind ones: the body could be divided between them. */
static void like_limbs_in_front_and_behind_do_not_matter(void **state)
{
    static const double turns[][4] = {{0.7, -0.2, -0.1, -0.4}, {-0.8, 0.1, -0.4, 0.0},
                                      {-0.4, -0.1, 0.5, -0.7}, {0.2, 0.9, -0.7, 0.7},
                                      {0.3, -0.5, 0.8, 0.7},   {-0.7, -0.5, -0.7, 0.7}};
    fixture l = of_mode(CAIRN_MODE_DEFAULT);

    (void)state;
    for (int i = 0; i < 6; i++) {
        cairn_self_similarity_result r;
        cairn_vec2 p[40];
        double half;
        int32_t n = beast(p, 50, 44, turns[i], &half);
        cairn_curve c = closed(p, n);

        r = find_axes(&l, &c, 1);
        assert_sound(&r, CAIRN_MODE_DEFAULT);
        assert_true(ends_off(&r.axes[0], 0, half) < 0.05);
    }
    test_pool_free(&l.pool);
}

/* ---- Verdicts ---- */

/* An egg, 100 high, slit from above along its axis down to 12 above the lower end; rotated by
 * `turn`. */
static cairn_curve slit_egg(cairn_vec2 *p, double turn)
{
    const double half_slit = 2, slit_end = 12;
    int32_t side = 60, count = 0;

    /* from the slit's left lip down and up to its right one */
    for (int32_t i = 0; i <= 2 * side; i++) {
        double share = -1 + (double)i / side, angle = PI * share, x = sin(angle), y = -cos(angle);
        double wide = 38 - 8 * y;

        if (fabs(wide * x) < half_slit && y > 0)
            continue;
        p[count++] = at(wide * x, 50 + 50 * y);
    }
    p[count++] = at(half_slit, 99);
    p[count++] = at(half_slit, slit_end);
    p[count++] = at(-half_slit, slit_end);
    p[count++] = at(-half_slit, 99);
    for (int32_t i = 0; i < count; i++)
        p[i] = at(cos(turn) * (double)p[i].x - sin(turn) * (double)p[i].y,
                  sin(turn) * (double)p[i].x + cos(turn) * (double)p[i].y);
    return closed(p, count);
}

/* The axis is short, so that one sample at its end would turn it by degrees; the line is fitted to
 * all samples. */
static void the_mirror_line_is_fitted_to_all_samples(void **state)
{
    static cairn_vec2 p[MAX_COUNT];
    fixture by_ends = of_mode(CAIRN_MODE_AS_WRITTEN), l = of_mode(CAIRN_MODE_DEFAULT);
    double worst_chord = 0;

    (void)state;
    for (int k = 0; k < 8; k++) {
        double turn = 0.1 + 0.37 * k;
        cairn_curve egg = slit_egg(p, turn);
        cairn_self_similarity_result r = find_axes(&l, &egg, 1), written;
        cairn_vec2 along = at(-sin(turn), cos(turn)),
                   chord = cairn_vec2_sub(r.axes[0].end[1], r.axes[0].end[0]);

        assert_true(r.count > 0);
        assert_near(cairn_vec2_norm(r.axes[0].mirror_direction), 1, 1e-5);
        assert_near(cairn_vec2_cross(r.axes[0].mirror_direction, along), 0, 0.004);
        assert_near(cairn_vec2_cross(r.axes[0].mirror_point, along), 0, 0.5);
        worst_chord =
            fmax(worst_chord, fabs((double)cairn_vec2_cross(cairn_vec2_unit(chord), along)));
        written = find_axes(&by_ends, &egg, 1);
        for (int32_t i = 0; i < written.count; i++) {
            chord = cairn_vec2_sub(written.axes[i].end[1], written.axes[i].end[0]);
            assert_near(cairn_vec2_cross(written.axes[i].mirror_direction, cairn_vec2_unit(chord)),
                        0, 1e-5);
        }
    }
    assert_true(worst_chord > 0.01);
    test_pool_free(&by_ends.pool);
    test_pool_free(&l.pool);
}

static void many_axes_are_said_so(void **state)
{
    static const int corners[] = {3, 4, 5, 6};
    fixture l = of_mode(CAIRN_MODE_DEFAULT);
    cairn_vec2 p[MAX_COUNT];
    cairn_self_similarity_result r;
    cairn_curve c;

    (void)state;
    for (int i = 0; i < 4; i++) {
        c = regular(p, corners[i], 0.3);
        r = find_axes(&l, &c, 1);
        assert_sound(&r, CAIRN_MODE_DEFAULT);
        assert_int_equal(r.rotation_order, corners[i]);
        assert_int_equal(r.tie_count, corners[i]);
        assert_int_equal(r.verdict, CAIRN_SELF_SIMILARITY_MULTIPLE);
        for (int32_t k = 0; k < r.tie_count; k++) {
            double best = 1;

            /* Axes of a regular polygon: through opposite multiples of half a side. */
            for (int32_t corner = 0; corner < corners[i]; corner++)
                best = fmin(best, ends_off(&r.axes[k], 0.5 * corner / corners[i],
                                           0.5 * corner / corners[i] + 0.5));
            assert_true(best < 0.01);
        }
    }
    test_pool_free(&l.pool);
}

static void a_circle_has_no_single_axis(void **state)
{
    (void)state;
    for (int32_t mode = 0; mode < 2; mode++) {
        fixture l = of_mode(mode);
        cairn_vec2 p[MAX_COUNT];
        cairn_curve c = regular(p, 200, 0);
        cairn_self_similarity_result r = find_axes(&l, &c, 1);

        assert_sound(&r, mode);
        assert_int_equal(r.rotation_order, 0);
        assert_int_equal(r.verdict, CAIRN_SELF_SIMILARITY_CIRCULAR);
        assert_true(r.tie_count > 4);
        test_pool_free(&l.pool);
    }
}

static void a_bar_has_two(void **state)
{
    fixture l = of_mode(CAIRN_MODE_DEFAULT);
    cairn_vec2 p[4] = {at(0, 0), at(200, 0), at(200, 6), at(0, 6)};
    cairn_curve c = closed(p, 4);
    cairn_self_similarity_result r = find_axes(&l, &c, 1);
    double along = 0, across = 0;

    (void)state;
    assert_sound(&r, CAIRN_MODE_DEFAULT);
    assert_int_equal(r.verdict, CAIRN_SELF_SIMILARITY_MULTIPLE);
    assert_int_equal(r.rotation_order, 2);
    for (int32_t i = 0; i < r.tie_count; i++) {
        across += ends_off(&r.axes[i], 100.0 / 412, 306.0 / 412) < 0.02;
        along += ends_off(&r.axes[i], 203.0 / 412, 409.0 / 412) < 0.02;
    }
    assert_true(along == 1 && across == 1);
    test_pool_free(&l.pool);
}

/* Holes change the distances: without them a square has four axes; with an off-centre hole one. */
static void holes_count_unless_filled(void **state)
{
    cairn_self_similarity_params params = cairn_self_similarity_default();
    cairn_vec2 box[4] = {at(0, 0), at(100, 0), at(100, 100), at(0, 100)};
    cairn_vec2 hole[4] = {at(20, 35), at(20, 65), at(60, 65), at(60, 35)}, none[4];
    cairn_curve shape[3] = {closed(box, 4), closed(hole, 4), closed(none, 4)};
    cairn_self_similarity_result r;
    fixture l;

    (void)state;
    for (int i = 0; i < 4; i++)
        none[i] = at(80, 80);
    l = new_fixture(&params);
    r = find_axes(&l, shape, 3);
    assert_sound(&r, CAIRN_MODE_DEFAULT);
    assert_true(ends_off(&r.axes[0], 0.375, 0.875) < 0.03);
    assert_int_equal(r.verdict, CAIRN_SELF_SIMILARITY_SINGLE);
    test_pool_free(&l.pool);
    params.hole_samples = 0;
    l = new_fixture(&params);
    r = find_axes(&l, shape, 3);
    assert_sound(&r, CAIRN_MODE_DEFAULT);
    assert_int_equal(r.tie_count, 4);
    test_pool_free(&l.pool);
}

/* Two holes that are mirror images of each other leave one axis of the square's four. */
static void every_hole_counts(void **state)
{
    cairn_self_similarity_params params = cairn_self_similarity_default();
    cairn_vec2 box[4] = {at(0, 0), at(100, 0), at(100, 100), at(0, 100)};
    cairn_vec2 above[4] = {at(20, 15), at(20, 35), at(60, 35), at(60, 15)},
               below[4] = {at(20, 65), at(20, 85), at(60, 85), at(60, 65)};
    cairn_curve shape[3] = {closed(box, 4), closed(above, 4), closed(below, 4)};
    fixture l = new_fixture(&params);
    cairn_self_similarity_result r = find_axes(&l, shape, 3);

    (void)state;
    assert_sound(&r, CAIRN_MODE_DEFAULT);
    assert_true(ends_off(&r.axes[0], 0.375, 0.875) < 0.03);
    assert_int_equal(r.verdict, CAIRN_SELF_SIMILARITY_SINGLE);
    test_pool_free(&l.pool);
}

static uint64_t hash_of(void *context)
{
    cairn_self_similarity_result r = cairn_self_similarity_read(((fixture *)context)->similarity);
    uint64_t hash = test_hash(TEST_HASH_START, &r.tie_count, sizeof r.tie_count);

    for (int32_t i = 0; i < r.count; i++) {
        const cairn_self_similarity_axis *a = &r.axes[i];

        hash = test_hash(hash, a->position, sizeof a->position);
        hash = test_hash(hash, a->end, sizeof a->end);
        hash = test_hash(hash, &a->dissimilarity, sizeof a->dissimilarity);
    }
    return test_hash(hash, r.samples, (size_t)r.sample_count * sizeof *r.samples);
}

static cairn_status begin_beast(void *context)
{
    static const double turns[4] = {0.6, -0.4, 0.7, -0.5};
    cairn_vec2 p[40];
    double half;
    int32_t n = beast(p, 50, 30, turns, &half);
    cairn_curve c = closed(p, n);

    return cairn_self_similarity_begin(((fixture *)context)->similarity, &c, 1);
}

static cairn_status step(void *context, cairn_budget *budget)
{
    return cairn_self_similarity_step(((fixture *)context)->similarity, budget);
}

static void budgets_do_not_matter(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    static const uint64_t known[2][2] = {
        {UINT64_C(0x97d12823ab5bd7c5), UINT64_C(0x10c083b5dbe3f8fb)},
        {UINT64_C(0xb05639d34e9fadff), UINT64_C(0x2d25a4499661239e)}};
    cairn_self_similarity_params params = cairn_self_similarity_default();

    (void)state;
    params.outline_samples = 64;
    params.max_vertices = 12;
    for (int32_t mode = 0; mode < 2; mode++) {
        cairn_budget all = {INT32_MAX}, none = {0};
        uint64_t hash;
        fixture l;
        test_stepped object = {begin_beast, step, hash_of, &l};

        params.mode = mode;
        l = new_fixture(&params);
        assert_ok(begin_beast(&l));
        assert_status(step(&l, &none), CAIRN_MORE);
        assert_null(cairn_self_similarity_read(l.similarity).axes);
        assert_null(cairn_self_similarity_read(l.similarity).samples);
        assert_ok(step(&l, &all));
        hash = hash_of(&l);
        assert_golden(test_hash(hash, &all.left, sizeof all.left), known[mode][0], known[mode][1]);
        for (int i = 0; i < 3; i++) {
            int64_t used = 0;
            cairn_status status;

            assert_ok(begin_beast(&l));
            do {
                cairn_budget budget = {budgets[i]};

                status = step(&l, &budget);
                assert_true(budget.left >= 0);
                used += budgets[i] - budget.left;
            } while (status == CAIRN_MORE);
            assert_ok(status);
            assert_int_equal(used, INT32_MAX - all.left);
            assert_true(hash_of(&l) == hash);
        }
        test_begins_anew(&object, 9);
        test_pool_free(&l.pool);
    }
}

static void bad_outlines_are_refused(void **state)
{
    fixture l = of_mode(CAIRN_MODE_DEFAULT);
    cairn_vec2 p[MAX_COUNT], hole[4] = {at(60, 15), at(70, 15), at(70, 25), at(60, 25)};
    cairn_curve shape[CAIRN_SELF_SIMILARITY_MAX_OUTLINES + 1], kept[2];
    cairn_budget budget = {1};
    double half;
    uint64_t hash;

    (void)state;
    assert_ok(cairn_self_similarity_step(l.similarity, &budget));
    shape[0] = pear(p, 100, 20, 0, 0, &half);
    for (int i = 1; i <= CAIRN_SELF_SIMILARITY_MAX_OUTLINES; i++)
        shape[i] = closed(hole, 4);
    (void)find_axes(&l, shape, 2);
    hash = hash_of(&l);
    memcpy(kept, shape, sizeof kept);
    assert_status(cairn_self_similarity_begin(NULL, shape, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_self_similarity_begin(l.similarity, NULL, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_self_similarity_begin(l.similarity, shape, 0), CAIRN_BAD_ARGUMENT);
    assert_status(
        cairn_self_similarity_begin(l.similarity, shape, CAIRN_SELF_SIMILARITY_MAX_OUTLINES + 1),
        CAIRN_FULL);
    for (int i = 0; i < 2; i++) {
        shape[i].points = NULL;
        assert_status(cairn_self_similarity_begin(l.similarity, shape, 2), CAIRN_BAD_ARGUMENT);
        memcpy(shape, kept, sizeof kept);
        shape[i].count = 2;
        assert_status(cairn_self_similarity_begin(l.similarity, shape, 2), CAIRN_BAD_ARGUMENT);
        memcpy(shape, kept, sizeof kept);
        shape[i].closed = 0;
        assert_status(cairn_self_similarity_begin(l.similarity, shape, 2), CAIRN_BAD_ARGUMENT);
        memcpy(shape, kept, sizeof kept);
    }
    hole[2].y = (cairn_real)NAN;
    assert_status(cairn_self_similarity_begin(l.similarity, shape, 2), CAIRN_NOT_FINITE);
    hole[2] = at(70, 25);
    p[4].x = NUMBER((cairn_real)1e200, (cairn_real)1e30);
    assert_status(cairn_self_similarity_begin(l.similarity, shape, 2), CAIRN_NOT_FINITE);
    for (int i = 0; i < 100; i++)
        p[i] = at(5, 7);
    assert_status(cairn_self_similarity_begin(l.similarity, shape, 2), CAIRN_EMPTY);
    p[3] = at(50, 7);
    assert_status(cairn_self_similarity_begin(l.similarity, shape, 2), CAIRN_EMPTY);
    assert_true(hash_of(&l) == hash);
    assert_status(cairn_self_similarity_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_self_similarity_step(l.similarity, NULL), CAIRN_BAD_ARGUMENT);
    assert_int_equal(cairn_self_similarity_read(NULL).count, 0);
    /* The largest number of holes, beyond the capacity. */
    shape[0] = pear(p, 100, 20, 0, 0, &half);
    (void)find_axes(&l, shape, CAIRN_SELF_SIMILARITY_MAX_OUTLINES);
    test_pool_free(&l.pool);
}

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_self_similarity *similarity;

    return cairn_self_similarity_create(&similarity, pool, context);
}

/* The params must be refused by a rule between parameters. */
static void assert_refused(const cairn_self_similarity_params *params, const char *rule)
{
    cairn_object_fault fault = {.module = NULL};

    assert_status(cairn_self_similarity_check(params, &fault), CAIRN_BAD_ARGUMENT);
    assert_string_equal(fault.rule, rule);
    assert_int_equal(cairn_self_similarity_memory(params), 0);
}

/* Rules between parameters; tests/test_object.c has the ranges. */
static void bad_params_are_refused(void **state)
{
    const cairn_self_similarity_params good = cairn_self_similarity_default();
    cairn_self_similarity_params bad = good, edge = good;
    cairn_pool pool = test_pool(64);

    (void)state;
    bad.min_vertices = 21;
    assert_refused(&bad, "max_vertices: at least min_vertices");
    bad = good;
    bad.outline_samples = 16;
    bad.max_vertices = 17;
    assert_refused(&bad, "max_vertices: at most outline_samples");
    assert_status(cairn_self_similarity_create(NULL, &pool, &good), CAIRN_BAD_ARGUMENT);
    edge.outline_samples = edge.max_vertices = 16;
    edge.min_vertices = 4;
    edge.hole_samples = 4;
    edge.tie_ratio = edge.tie_floor = 0;
    edge.separation = CAIRN_REAL(0.25);
    test_every_pool_size(create, &edge, cairn_self_similarity_memory(&edge));
    test_pool_free(&pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(searches_as_the_reference),
        cmocka_unit_test(finds_a_plain_axis),
        cmocka_unit_test(takes_bends_and_skews_back),
        cmocka_unit_test(joints_do_not_matter),
        cmocka_unit_test(like_limbs_in_front_and_behind_do_not_matter),
        cmocka_unit_test(the_mirror_line_is_fitted_to_all_samples),
        cmocka_unit_test(many_axes_are_said_so),
        cmocka_unit_test(a_circle_has_no_single_axis),
        cmocka_unit_test(a_bar_has_two),
        cmocka_unit_test(holes_count_unless_filled),
        cmocka_unit_test(every_hole_counts),
        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(bad_outlines_are_refused),
        cmocka_unit_test(bad_params_are_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
