/* Pair forces, potential and springs compared with libm; sums over many pairs. */
#include "tests/test.h"

#include <math.h>

#include "cairn/force_kernel.h"

#define PI 3.14159265358979323846

static cairn_oriented_point oriented(double x, double y, double angle)
{
    cairn_oriented_point p = {{(cairn_real)x, (cairn_real)y},
                              {(cairn_real)cos(angle), (cairn_real)sin(angle)}};
    return p;
}

/* Eqs. 7.1 and 7.2 by libm; returns the strength. */
static double strength(double r, double c, double m1, double m2, double sigma)
{
    return m1 * m2 * fabs(c) * exp(-r * r / (2 * sigma * sigma)) / (sigma * sqrt(2 * PI));
}

static void test_the_formulas(void **state)
{
    static const double distances[] = {0.001, 0.05, 0.1, 0.3, 0.6},
                        angles[] = {0, 0.4, 1.2, 2, 3.1};

    (void)state;
    for (int i = 0; i < 5; i++)
        for (int j = 0; j < 5; j++) {
            double bearing = 0.7 + i - j, r = distances[i];
            cairn_oriented_point p1 = oriented(1, 2, 0.5);
            cairn_oriented_point p2 =
                oriented(1 + r * cos(bearing), 2 + r * sin(bearing), 0.5 + angles[j]);
            double c = cos(angles[j]), f = strength(r, c, 2, 3, 0.15);
            cairn_real potential;
            cairn_vec2 force = cairn_force_kernel_pair(p1, p2, 2, 3, CAIRN_REAL(0.15), &potential),
                       back;

            assert_near(force.x, f * cos(bearing), NUMBER(1e-11, 1e-2 * f + 1e-5));
            assert_near(force.y, f * sin(bearing), NUMBER(1e-11, 1e-2 * f + 1e-5));
            assert_near(potential, -0.5 * 2 * 3 * fabs(c) * erfc(r / (0.15 * sqrt(2))),
                        NUMBER(1e-13, 1e-5));
            back = cairn_force_kernel_pair(p2, p1, 3, 2, CAIRN_REAL(0.15), NULL);
            assert_near(back.x, -force.x, NUMBER(1e-13, 1e-6));
            assert_near(back.y, -force.y, NUMBER(1e-13, 1e-6));
        }
    /* Attraction: p2 to the right pulls to the right. 1 / (0.15 sqrt(2 pi)) = 2.6596... at
     * distance 0. */
    assert_near(cairn_force_kernel_pair(oriented(0, 0, 0), oriented(1e-6, 0, 0), 1, 1,
                                        CAIRN_REAL(0.15), NULL)
                    .x,
                2.6596152026762, 1e-5);
}

static void test_force_is_minus_the_gradient(void **state)
{
#ifndef CAIRN_FLOAT
    const double h = 1e-5;
    cairn_oriented_point p2 = oriented(0.2, -0.1, 0.3);

    (void)state;
    for (int i = 0; i < 40; i++) {
        double x = 0.5 * sin(3.0 * i), y = 0.5 * cos(5.0 * i), plus, minus, force_x, force_y;
        cairn_vec2 force = cairn_force_kernel_pair(oriented(x, y, 1), p2, 4, 1, 0.1, NULL);

        (void)cairn_force_kernel_pair(oriented(x + h, y, 1), p2, 4, 1, 0.1, &plus);
        (void)cairn_force_kernel_pair(oriented(x - h, y, 1), p2, 4, 1, 0.1, &minus);
        force_x = -(plus - minus) / (2 * h);
        (void)cairn_force_kernel_pair(oriented(x, y + h, 1), p2, 4, 1, 0.1, &plus);
        (void)cairn_force_kernel_pair(oriented(x, y - h, 1), p2, 4, 1, 0.1, &minus);
        force_y = -(plus - minus) / (2 * h);
        assert_near(force.x, force_x, 1e-6);
        assert_near(force.y, force_y, 1e-6);
    }
#else
    (void)state;
#endif
}

static void test_zero_distance(void **state)
{
    cairn_oriented_point p = oriented(3, 4, 1), near = p;
    cairn_real potential;
    cairn_vec2 force = cairn_force_kernel_pair(p, p, 1, 1, 1, &potential);

    (void)state;
    assert_near(force.x, 0, 0);
    assert_near(force.y, 0, 0);
    assert_near(potential, -0.5, 1e-6);
    p.position.x = near.position.x = 0;
    near.position.x = CAIRN_REAL(0.9e-9);
    assert_near(cairn_force_kernel_pair(p, near, 1, 1, 1, NULL).x, 0, 0);
    near.position.x = CAIRN_REAL(1.1e-9);
    assert_near(cairn_force_kernel_pair(p, near, 1, 1, 1, NULL).x, 0.3989422804014327, 1e-6);
}

/* ---- Strips ---- */

struct points {
    cairn_vec2 position[2][CAIRN_FORCE_STRIP_POINTS];
    cairn_real mass[2][CAIRN_FORCE_STRIP_POINTS];
    cairn_force_kernel_strip strip[2];
};

static const cairn_box everywhere = {{-9, -9}, {9, 9}};

static void make_points(struct points *p, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 0);

    for (int k = 0; k < 2; k++) {
        for (int i = 0; i < CAIRN_FORCE_STRIP_POINTS; i++) {
            p->position[k][i].x = cairn_random_uniform(&random, 0, 1);
            p->position[k][i].y = cairn_random_uniform(&random, 0, 1);
            p->mass[k][i] = cairn_random_uniform(&random, CAIRN_REAL(0.5), 4);
        }
        p->strip[k].position = p->position[k];
        p->strip[k].mass = p->mass[k];
        p->strip[k].count = CAIRN_FORCE_STRIP_POINTS - 5 * k;
        p->strip[k].reach_box = everywhere;
    }
}

/* The sums of all pairs one by one; those of a count from row `first` on. */
static void test_strips_against_the_formulas(void **state)
{
    const double sigma = 0.12, reach = 4.5;
    cairn_oriented_point a = oriented(0, 0, 0), b = oriented(0, 0, 0);
    cairn_force_kernel kernel;

    (void)state;
    cairn_force_kernel_init(&kernel);
    cairn_force_kernel_set(&kernel, (cairn_real)sigma, (cairn_real)reach);
    for (uint64_t seed = 0; seed < 40; seed++) {
        int32_t with = (int32_t)(seed % 2), first = (int32_t)(seed % 3), pairs = 0, cost = 0;
        double potential = 0.25, force_x = 3, force_y = 2, torque = 1, levers = 0;
        struct points p;
        cairn_force_kernel_sum sum = {
            {3, 2}, 1, CAIRN_REAL(0.25), {CAIRN_REAL(0.3), CAIRN_REAL(-0.2)}, 5, NULL};
        cairn_force_kernel_cursor cursor;
        cairn_budget budget = {CAIRN_UNBOUNDED};

        make_points(&p, seed);
        /* One point lies on the border of the zone. */
        if (seed % 5 == 1)
            p.strip[1].reach_box.max.x = p.position[0][4].x;
        if (seed % 5 == 2)
            p.strip[1].reach_box.min.y = p.position[0][5].y;
        if (seed % 5 == 3)
            p.strip[1].reach_box.min.x = p.position[0][6].x;
        if (seed % 5 == 4)
            p.strip[1].reach_box.max.y = p.position[0][7].y;
        memset(&cursor, 0, sizeof cursor);
        cursor.row = first;
        assert_ok(cairn_force_kernel_strips(&kernel, &p.strip[0], &p.strip[1], &cursor, with, &sum,
                                            &budget));
        assert_int_equal(cursor.row, CAIRN_FORCE_STRIP_POINTS);
        for (int i = first; i < p.strip[0].count; i++) {
            a.position = p.position[0][i];
            cost++;
            if (a.position.x > p.strip[1].reach_box.max.x ||
                a.position.y < p.strip[1].reach_box.min.y ||
                a.position.x < p.strip[1].reach_box.min.x ||
                a.position.y > p.strip[1].reach_box.max.y)
                continue;
            cost += (p.strip[1].count + 7) / 8;
            for (int j = 0; j < p.strip[1].count; j++) {
                cairn_vec2 f;
                cairn_real u;

                b.position = p.position[1][j];
                if ((double)cairn_vec2_norm(cairn_vec2_sub(b.position, a.position)) > reach * sigma)
                    continue;
                f = cairn_force_kernel_pair(a, b, p.mass[0][i], p.mass[1][j], (cairn_real)sigma,
                                            &u);
                pairs++;
                potential -= with ? 2 * (double)u : 0;
                force_x += (double)f.x / (double)kernel.norm;
                force_y += (double)f.y / (double)kernel.norm;
                torque += (double)((a.position.x - sum.centre.x) * f.y -
                                   (a.position.y - sum.centre.y) * f.x) /
                          (double)kernel.norm;
                levers += fabs((double)f.x) + fabs((double)f.y);
            }
        }
        assert_true(pairs > 0 && pairs < cost * p.strip[1].count);
        assert_int_equal(sum.pairs, 5 + pairs);
        assert_near(sum.force.x, force_x, NUMBER(1e-12, 1e-5) * levers);
        assert_near(sum.force.y, force_y, NUMBER(1e-12, 1e-5) * levers);
        assert_near(sum.torque, torque, NUMBER(1e-12, 1e-5) * levers);
        assert_near(sum.potential, potential, NUMBER(1e-10, 1e-3));
        assert_int_equal(CAIRN_UNBOUNDED - budget.left, cost + pairs);
    }
}

/* The springs of all pairs one by one, whatever the budget; the other sums are not affected by
 * them. */
static void test_springs_against_the_formulas(void **state)
{
    const double sigma = 0.12, reach = 4.5;
    cairn_force_kernel kernel;

    (void)state;
    cairn_force_kernel_init(&kernel);
    cairn_force_kernel_set(&kernel, (cairn_real)sigma, (cairn_real)reach);
    for (uint64_t seed = 0; seed < 20; seed++) {
        struct points p;
        double slow[11] = {0};
        cairn_force_kernel_springs springs, s;
        cairn_force_kernel_sum sum, plain;
        cairn_force_kernel_cursor cursor;
        cairn_budget budget = {CAIRN_UNBOUNDED};

        make_points(&p, seed);
        /* Nearer than the minimum length of a spring. */
        p.position[1][0].x = p.position[0][0].x + CAIRN_REAL(0.005);
        p.position[1][0].y = p.position[0][0].y;
        memset(&springs, 0, sizeof springs);
        memset(&sum, 0, sizeof sum);
        sum.centre.x = CAIRN_REAL(0.3);
        sum.centre.y = CAIRN_REAL(-0.2);
        plain = sum;
        sum.springs = &springs;
        memset(&cursor, 0, sizeof cursor);
        assert_ok(cairn_force_kernel_strips(&kernel, &p.strip[0], &p.strip[1], &cursor, 1, &sum,
                                            &budget));
        memset(&cursor, 0, sizeof cursor);
        budget.left = CAIRN_UNBOUNDED;
        assert_ok(cairn_force_kernel_strips(&kernel, &p.strip[0], &p.strip[1], &cursor, 1, &plain,
                                            &budget));
        assert_true(sum.force.x == plain.force.x && sum.force.y == plain.force.y &&
                    sum.torque == plain.torque && sum.potential == plain.potential &&
                    sum.pairs == plain.pairs);
        for (int i = 0; i < p.strip[0].count; i++)
            for (int j = 0; j < p.strip[1].count; j++) {
                double ax = (double)p.position[0][i].x, ay = (double)p.position[0][i].y;
                double dx = (double)p.position[1][j].x - ax, dy = (double)p.position[1][j].y - ay,
                       r = hypot(dx, dy);
                double x = ax + dx / 2 - 0.3, y = ay + dy / 2 + 0.2;
                double k = (double)p.mass[0][i] * (double)p.mass[1][j] *
                           exp(-r * r / (2 * sigma * sigma)) / fmax(r, sigma / 8);
                double terms[11] = {k,      k * x,  k * y,      k * x * x,  k * x * y, k * y * y,
                                    k * dx, k * dy, k * x * dx, k * x * dy, k * y * dx};

                if (r > reach * sigma)
                    continue;
                for (int t = 0; t < 11; t++)
                    slow[t] += terms[t];
            }
        s = springs;
        {
            cairn_real fast[11] = {s.stiffness,      s.middle.x,       s.middle.y,      s.middle_xx,
                                   s.middle_xy,      s.middle_yy,      s.pull.x,        s.pull.y,
                                   s.middle_pull_xx, s.middle_pull_xy, s.middle_pull_yx};

            for (int t = 0; t < 11; t++)
                assert_near(fast[t], slow[t], NUMBER(1e-11, 1e-4) * slow[0]);
        }
        for (int32_t left = 1; left < 20; left += 6) {
            cairn_force_kernel_springs parts;
            cairn_status status;

            memset(&parts, 0, sizeof parts);
            sum = plain;
            sum.springs = &parts;
            memset(&cursor, 0, sizeof cursor);
            do {
                budget.left = left;
                status = cairn_force_kernel_strips(&kernel, &p.strip[0], &p.strip[1], &cursor, 1,
                                                   &sum, &budget);
            } while (status == CAIRN_MORE);
            assert_ok(status);
            assert_memory_equal(&parts, &springs, sizeof parts);
        }
    }
}

/* The last sum is that of the others rotated by a quarter turn. */
static void test_springs_turned(void **state)
{
    cairn_force_kernel kernel;
    cairn_force_kernel_springs springs[2];

    (void)state;
    cairn_force_kernel_init(&kernel);
    cairn_force_kernel_set(&kernel, CAIRN_REAL(0.12), 4);
    for (int turn = 0; turn < 2; turn++) {
        struct points p;
        cairn_force_kernel_sum sum;
        cairn_force_kernel_cursor cursor;
        cairn_budget budget = {CAIRN_UNBOUNDED};

        make_points(&p, 3);
        for (int k = 0; k < 2; k++)
            for (int i = 0; i < CAIRN_FORCE_STRIP_POINTS && turn; i++)
                p.position[k][i] = cairn_vec2_left_perp(p.position[k][i]);
        memset(&springs[turn], 0, sizeof springs[turn]);
        memset(&sum, 0, sizeof sum);
        memset(&cursor, 0, sizeof cursor);
        sum.springs = &springs[turn];
        assert_ok(cairn_force_kernel_strips(&kernel, &p.strip[0], &p.strip[1], &cursor, 0, &sum,
                                            &budget));
    }
    assert_near(springs[1].middle_pull_xx, (double)springs[0].middle_pull_yy, NUMBER(1e-12, 1e-4));
    assert_near(springs[1].middle_pull_yy, (double)springs[0].middle_pull_xx, NUMBER(1e-12, 1e-4));
    assert_near(springs[1].middle_xx, (double)springs[0].middle_yy, NUMBER(1e-12, 1e-4));
    assert_near(springs[1].middle_yy, (double)springs[0].middle_xx, NUMBER(1e-12, 1e-4));
    assert_true(fabs((double)springs[0].middle_pull_yy) > 0.01);
}

/* The torque of a pair about any centre is the same for both points, with the opposite sign. */
static void test_strips_act_on_both(void **state)
{
    cairn_force_kernel kernel;
    struct points p;
    cairn_force_kernel_sum there, back;
    cairn_force_kernel_cursor cursor;
    cairn_budget budget = {CAIRN_UNBOUNDED};

    (void)state;
    cairn_force_kernel_init(&kernel);
    make_points(&p, 5);
    memset(&there, 0, sizeof there);
    memset(&cursor, 0, sizeof cursor);
    there.centre.x = CAIRN_REAL(0.7);
    back = there;
    assert_ok(
        cairn_force_kernel_strips(&kernel, &p.strip[0], &p.strip[1], &cursor, 1, &there, &budget));
    memset(&cursor, 0, sizeof cursor);
    assert_ok(
        cairn_force_kernel_strips(&kernel, &p.strip[1], &p.strip[0], &cursor, 1, &back, &budget));
    assert_near(back.force.x, -there.force.x, NUMBER(1e-9, 1e-2));
    assert_near(back.force.y, -there.force.y, NUMBER(1e-9, 1e-2));
    assert_near(back.torque, -there.torque, NUMBER(1e-9, 1e-2));
    assert_near(back.potential, there.potential, NUMBER(1e-9, 1e-2));
    assert_true(fabs((double)there.force.x) > 1 && fabs((double)there.torque) > 1);
}

/* Exponential and erfc at all distances up to the greatest reach. */
static void test_tables(void **state)
{
    double worst_force = 0, worst_potential = 0;
    cairn_force_kernel kernel;

    (void)state;
    cairn_force_kernel_init(&kernel);
    cairn_force_kernel_set(&kernel, 1, 6);
    for (int i = 1; i <= 60010; i++) {
        double x = i * 1e-4, force, potential;
        cairn_vec2 position[2] = {{0, 0}, {(cairn_real)x, 0}};
        cairn_real mass[2] = {1, 2};
        cairn_force_kernel_strip a = {position, mass, 1, everywhere},
                                 b = {position + 1, mass + 1, 1, everywhere};
        cairn_force_kernel_cursor cursor;
        cairn_force_kernel_sum sum;
        cairn_budget budget = {CAIRN_UNBOUNDED};

        memset(&sum, 0, sizeof sum);
        memset(&cursor, 0, sizeof cursor);
        assert_ok(cairn_force_kernel_strips(&kernel, &a, &b, &cursor, 1, &sum, &budget));
        x = (double)position[1].x;
        if (i > 60000) {
            assert_int_equal(sum.pairs, 0);
            assert_near(sum.force.x, 0, 0);
            continue;
        }
        if (i < 60000)
            assert_int_equal(sum.pairs, 1);
        if (sum.pairs == 0)
            continue;
        force = 2 * exp(-x * x / 2);
        potential = 2 * erfc(x / sqrt(2));
        assert_near(sum.force.y, 0, 0);
        worst_force = fmax(worst_force, fabs((double)sum.force.x - force) / force);
        worst_potential = fmax(worst_potential, fabs((double)sum.potential - potential) / 2);
    }
    /* In float exp(-18) is off by 18 times the rounding of its argument. */
    assert_near(worst_force, 0, NUMBER(3e-13, 3e-6));
    assert_near(worst_potential, 0, NUMBER(1e-13, 3e-7));
    assert_near(kernel.norm, 1 / sqrt(2 * PI), NUMBER(1e-15, 1e-7));
}

static void test_strips_at_no_distance(void **state)
{
    cairn_vec2 position[4] = {{1, 1}, {1, 1}, {1, 1}, {1, 2}};
    cairn_real mass[4] = {2, 1, 1, 1};
    cairn_force_kernel_strip a = {position, mass, 1, everywhere},
                             b = {position + 1, mass + 1, 3, everywhere};
    cairn_force_kernel kernel;
    cairn_force_kernel_cursor cursor;
    cairn_force_kernel_sum sum;
    cairn_budget budget = {CAIRN_UNBOUNDED};

    (void)state;
    position[2].x += CAIRN_REAL_EPSILON; /* 1e-16 or 1e-7 m: nearer than 1e-9 in double only */
    memset(&sum, 0, sizeof sum);
    memset(&cursor, 0, sizeof cursor);
    cairn_force_kernel_init(&kernel);
    assert_ok(cairn_force_kernel_strips(&kernel, &a, &b, &cursor, 1, &sum, &budget));
    assert_int_equal(sum.pairs, 3);
    /* sigma is 1 after init: erfc(1 / sqrt(2)) = 0.3173..., exp(-1/2) = 0.6065... */
    assert_near(sum.potential, 2 * (2 + 0.31731050786291415), 1e-6);
    assert_near(sum.force.y, 2 * 0.60653065971263342, 1e-6);
    assert_near(sum.force.x, NUMBER(0, 2), 1e-6);
    /* Strips of nothing. */
    a.count = 0;
    cursor.row = 0;
    budget.left = 0;
    assert_ok(cairn_force_kernel_strips(&kernel, &a, &b, &cursor, 1, &sum, &budget));
    assert_int_equal(sum.pairs, 3);
}

/* The sum of two strips in one call. */
static cairn_force_kernel_sum sum_of(const cairn_force_kernel *kernel,
                                     const cairn_force_kernel_strip *a,
                                     const cairn_force_kernel_strip *b)
{
    cairn_force_kernel_cursor cursor;
    cairn_force_kernel_sum sum;
    cairn_budget budget = {CAIRN_UNBOUNDED};

    memset(&sum, 0, sizeof sum);
    memset(&cursor, 0, sizeof cursor);
    assert_ok(cairn_force_kernel_strips(kernel, a, b, &cursor, 1, &sum, &budget));
    return sum;
}

/* A point that is not finite, or infinitely far, is beyond every reach. */
static void test_points_that_are_not_finite_exert_no_force(void **state)
{
    cairn_vec2 position[4] = {{1, 1}, {(cairn_real)NAN, 1}, {1, CAIRN_REAL_MAX}, {1, 2}};
    cairn_real mass[4] = {1, 1, 1, 1};
    cairn_force_kernel_strip a = {position, mass, 1, everywhere},
                             b = {position + 1, mass + 1, 3, everywhere};
    cairn_force_kernel kernel;
    cairn_force_kernel_sum sum;

    (void)state;
    cairn_force_kernel_init(&kernel);
    sum = sum_of(&kernel, &a, &b);
    assert_int_equal(sum.pairs, 1);
    assert_near(sum.force.y, 0.60653065971263342, 1e-6);
    assert_near(sum.potential, 0.31731050786291415, 1e-6);
}

/* A sigma whose square, or its inverse, overflows reaches no point, not even one at no distance. */
static void test_extreme_sigmas_reach_nothing(void **state)
{
    const cairn_real sigmas[] = {NUMBER(1e-200, 1e-25F), NUMBER(1e200, 1e25F)};
    cairn_vec2 position[2] = {{1, 1}, {1, 1}};
    cairn_real mass[2] = {1, 1};
    cairn_force_kernel_strip a = {position, mass, 1, everywhere},
                             b = {position + 1, mass + 1, 1, everywhere};
    cairn_force_kernel kernel;

    (void)state;
    cairn_force_kernel_init(&kernel);
    for (int k = 0; k < 2; k++) {
        cairn_force_kernel_sum sum;

        cairn_force_kernel_set(&kernel, sigmas[k], 3);
        sum = sum_of(&kernel, &a, &b);
        assert_int_equal(sum.pairs, 0);
        assert_true(sum.potential == 0);
    }
}

static void test_strips_budgets(void **state)
{
    static const int32_t budgets[] = {1, 2, 7, 1000};
    cairn_force_kernel kernel;
    struct points p;
    cairn_force_kernel_sum whole;
    cairn_force_kernel_cursor cursor;
    cairn_budget unbounded = {CAIRN_UNBOUNDED}, none = {0};

    (void)state;
    cairn_force_kernel_init(&kernel);
    cairn_force_kernel_set(&kernel, CAIRN_REAL(0.1), CAIRN_REAL(5.3));
    make_points(&p, 77);
    memset(&whole, 0, sizeof whole);
    memset(&cursor, 0, sizeof cursor);
    assert_status(
        cairn_force_kernel_strips(&kernel, &p.strip[0], &p.strip[1], &cursor, 1, &whole, &none),
        CAIRN_MORE);
    assert_int_equal(cursor.row, 0);
    assert_ok(cairn_force_kernel_strips(&kernel, &p.strip[0], &p.strip[1], &cursor, 1, &whole,
                                        &unbounded));
    for (int i = 0; i < 4; i++) {
        cairn_status status = CAIRN_MORE;
        cairn_force_kernel_sum sum;
        int32_t used = 0;

        memset(&sum, 0, sizeof sum);
        memset(&cursor, 0, sizeof cursor);
        while (status == CAIRN_MORE) {
            cairn_budget budget = {budgets[i]};

            status = cairn_force_kernel_strips(&kernel, &p.strip[0], &p.strip[1], &cursor, 1, &sum,
                                               &budget);
            assert_true(budget.left >= 0);
            assert_true(status == CAIRN_OK || budget.left == 0);
            used += budgets[i] - budget.left;
        }
        assert_ok(status);
        assert_int_equal(used, CAIRN_UNBOUNDED - unbounded.left);
        assert_true(sum.force.x == whole.force.x && sum.force.y == whole.force.y &&
                    sum.torque == whole.torque);
        assert_true(sum.potential == whole.potential && sum.pairs == whole.pairs);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_formulas),
        cmocka_unit_test(test_force_is_minus_the_gradient),
        cmocka_unit_test(test_zero_distance),
        cmocka_unit_test(test_strips_against_the_formulas),
        cmocka_unit_test(test_springs_against_the_formulas),
        cmocka_unit_test(test_springs_turned),
        cmocka_unit_test(test_strips_act_on_both),
        cmocka_unit_test(test_tables),
        cmocka_unit_test(test_strips_at_no_distance),
        cmocka_unit_test(test_points_that_are_not_finite_exert_no_force),
        cmocka_unit_test(test_extreme_sigmas_reach_nothing),
        cmocka_unit_test(test_strips_budgets),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
