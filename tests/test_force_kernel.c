#include "tests/test.h"

#include <math.h>

#include "cairn/force_kernel.h"

#define PI 3.14159265358979323846

enum { MANY = 60 };

static cairn_oriented_point oriented(double x, double y, double angle)
{
    cairn_oriented_point p = {{(cairn_real)x, (cairn_real)y}, {(cairn_real)cos(angle), (cairn_real)sin(angle)}};
    return p;
}

/* Eqs. 7.1 and 7.2 by libc math; returns the strength. */
static double strength(double r, double c, double m1, double m2, double sigma)
{
    return m1 * m2 * fabs(c) * exp(-r * r / (2 * sigma * sigma)) / (sigma * sqrt(2 * PI));
}

static void test_the_formulas(void **state)
{
    static const double distances[] = {0.001, 0.05, 0.1, 0.3, 0.6}, angles[] = {0, 0.4, 1.2, 2, 3.1};

    (void)state;
    for (int i = 0; i < 5; i++)
        for (int j = 0; j < 5; j++) {
            double bearing = 0.7 + i - j, r = distances[i];
            cairn_oriented_point p1 = oriented(1, 2, 0.5);
            cairn_oriented_point p2 = oriented(1 + r * cos(bearing), 2 + r * sin(bearing), 0.5 + angles[j]);
            double c = cos(angles[j]), f = strength(r, c, 2, 3, 0.15);
            cairn_real potential;
            cairn_vec2 force = cairn_force_kernel_pair(p1, p2, 2, 3, CAIRN_REAL(0.15), &potential), back;

            assert_near(force.x, f * cos(bearing), NUMBER(1e-11, 1e-2 * f + 1e-5));
            assert_near(force.y, f * sin(bearing), NUMBER(1e-11, 1e-2 * f + 1e-5));
            assert_near(potential, -0.5 * 2 * 3 * fabs(c) * erfc(r / (0.15 * sqrt(2))), NUMBER(1e-13, 1e-5));
            back = cairn_force_kernel_pair(p2, p1, 3, 2, CAIRN_REAL(0.15), NULL);
            assert_near(back.x, -force.x, NUMBER(1e-13, 1e-6));
            assert_near(back.y, -force.y, NUMBER(1e-13, 1e-6));
        }
    /* Attraction: p2 to the right pulls to the right. 1 / (0.15 sqrt(2 pi)) = 2.6596... at distance 0. */
    assert_near(cairn_force_kernel_pair(oriented(0, 0, 0), oriented(1e-6, 0, 0), 1, 1, CAIRN_REAL(0.15), NULL).x,
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

/* ---- Rows ---- */

struct points {
    cairn_vec2 position[MANY], force[MANY];
    cairn_real mass[MANY];
    cairn_force_points view;
};

static void make_points(struct points *p, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 0);

    for (int i = 0; i < MANY; i++) {
        p->position[i].x = cairn_random_uniform(&random, 0, 1);
        p->position[i].y = cairn_random_uniform(&random, 0, 1);
        p->mass[i] = cairn_random_uniform(&random, CAIRN_REAL(0.5), 4);
        p->force[i].x = cairn_random_uniform(&random, -1, 1);
        p->force[i].y = cairn_random_uniform(&random, -1, 1);
    }
    p->view.position = p->position;
    p->view.mass = p->mass;
    p->view.force = p->force;
}

static void test_row_against_the_formulas(void **state)
{
    const double sigma = 0.12, reach = 4.5;
    cairn_oriented_point a = oriented(0, 0, 0), b = oriented(0, 0, 1);
    cairn_real c = cairn_abs(cairn_vec2_dot(a.direction, b.direction));
    cairn_force_kernel kernel;

    (void)state;
    cairn_force_kernel_init(&kernel);
    cairn_force_kernel_set(&kernel, (cairn_real)sigma, (cairn_real)reach);
    for (uint64_t seed = 0; seed < 20; seed++)
        for (int with = 0; with < 2; with++) {
            struct points p, before;
            cairn_force_sum sum = {5, CAIRN_REAL(0.25)};
            cairn_budget budget = {CAIRN_UNBOUNDED};
            double potential = 0.25, force_x, force_y;
            int32_t next = 11, pairs = 0;

            make_points(&p, seed);
            before = p;
            force_x = (double)p.force[3].x;
            force_y = (double)p.force[3].y;
            assert_ok(cairn_force_kernel_row(&kernel, &p.view, 3, &next, 50, c, with, &sum, &budget));
            assert_int_equal(next, 50);
            for (int j = 0; j < MANY; j++) {
                cairn_vec2 f = {0, 0};
                cairn_real u;

                a.position = before.position[3];
                b.position = before.position[j];
                if (j >= 11 && j < 50 &&
                    (double)cairn_vec2_norm(cairn_vec2_sub(b.position, a.position)) <= reach * sigma) {
                    f = cairn_force_kernel_pair(a, b, before.mass[3], before.mass[j], (cairn_real)sigma, &u);
                    potential += with ? (double)u : 0;
                    pairs++;
                }
                force_x += (double)f.x;
                force_y += (double)f.y;
                if (j != 3) {
                    assert_near(p.force[j].x, before.force[j].x - f.x, NUMBER(2e-11, 1e-4));
                    assert_near(p.force[j].y, before.force[j].y - f.y, NUMBER(2e-11, 1e-4));
                }
            }
            assert_true(pairs > 5 && pairs < 39);
            assert_int_equal(sum.pairs, 5 + pairs);
            assert_near(p.force[3].x, force_x, NUMBER(1e-10, 1e-3));
            assert_near(p.force[3].y, force_y, NUMBER(1e-10, 1e-3));
            assert_near(sum.potential, potential, NUMBER(1e-10, 1e-4));
            assert_int_equal(CAIRN_UNBOUNDED - budget.left, 10 + pairs);
        }
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
        cairn_vec2 position[2] = {{0, 0}, {(cairn_real)x, 0}}, f[2] = {{0, 0}, {0, 0}};
        cairn_real mass[2] = {1, 2};
        cairn_force_points points = {position, mass, f};
        cairn_force_sum sum = {0, 0};
        cairn_budget budget = {CAIRN_UNBOUNDED};
        int32_t next = 1;

        assert_ok(cairn_force_kernel_row(&kernel, &points, 0, &next, 2, CAIRN_REAL(0.5), 1, &sum, &budget));
        x = (double)position[1].x;
        if (i > 60000) {
            assert_int_equal(sum.pairs, 0);
            assert_near(f[0].x, 0, 0);
            continue;
        }
        if (i < 60000)
            assert_int_equal(sum.pairs, 1);
        if (sum.pairs == 0)
            continue;
        force = strength(x, 0.5, 1, 2, 1);
        potential = -0.5 * erfc(x / sqrt(2));
        assert_near(f[0].y, 0, 0);
        assert_near(f[1].x, -f[0].x, 0);
        worst_force = fmax(worst_force, fabs((double)f[0].x - force) / force);
        worst_potential = fmax(worst_potential, fabs((double)sum.potential - potential));
    }
    /* In float exp(-18) is off by 18 times the rounding of its argument. */
    assert_near(worst_force, 0, NUMBER(3e-13, 3e-6));
    assert_near(worst_potential, 0, NUMBER(5e-14, 3e-7));
}

static void test_row_at_no_distance(void **state)
{
    cairn_vec2 position[4] = {{1, 1}, {1, 1}, {1, 1}, {1, 2}}, force[4] = {{0, 0}, {0, 0}, {0, 0}, {0, 0}};
    cairn_real mass[4] = {2, 1, 1, 1};
    cairn_force_points points = {position, mass, force};
    cairn_force_kernel kernel;
    cairn_force_sum sum = {0, 0};
    cairn_budget budget = {CAIRN_UNBOUNDED};
    int32_t next = 1;

    (void)state;
    position[2].x += CAIRN_REAL_EPSILON; /* 1e-16 or 1e-7 m: nearer than 1e-9 in double only */
    cairn_force_kernel_init(&kernel);
    assert_ok(cairn_force_kernel_row(&kernel, &points, 0, &next, 4, 1, 1, &sum, &budget));
    assert_int_equal(sum.pairs, 3);
    /* sigma is 1 after init: erfc(1 / sqrt(2)) = 0.3173..., exp(-1/2) / sqrt(2 pi) = 0.2419... */
    assert_near(sum.potential, -2 - 0.31731050786291415, 1e-6);
    assert_near(force[3].y, -2 * 0.24197072451914337, 1e-6);
    assert_near(force[1].x, 0, 0);
    assert_near(force[1].y, 0, 0);
    assert_near(force[2].x, NUMBER(0, -0.7978845608), 1e-6);
    assert_near(force[0].x, NUMBER(0, 0.7978845608), 1e-6);
}

static void test_row_budgets(void **state)
{
    static const int32_t budgets[] = {1, 2, 7, 1000};
    cairn_force_kernel kernel;
    struct points whole;
    cairn_force_sum whole_sum = {0, 0};
    cairn_budget unbounded = {CAIRN_UNBOUNDED};
    int32_t next = 1;

    (void)state;
    cairn_force_kernel_init(&kernel);
    cairn_force_kernel_set(&kernel, CAIRN_REAL(0.1), CAIRN_REAL(5.3));
    make_points(&whole, 77);
    assert_ok(cairn_force_kernel_row(&kernel, &whole.view, 0, &next, MANY, 1, 1, &whole_sum, &unbounded));
    for (int i = 0; i < 4; i++) {
        struct points p;
        cairn_force_sum sum = {0, 0};
        cairn_status status = CAIRN_MORE;
        int32_t used = 0;

        make_points(&p, 77);
        for (next = 1; status == CAIRN_MORE;) {
            cairn_budget budget = {budgets[i]};

            status = cairn_force_kernel_row(&kernel, &p.view, 0, &next, MANY, 1, 1, &sum, &budget);
            assert_true(budget.left >= -4);
            used += budgets[i] - budget.left;
        }
        assert_ok(status);
        assert_int_equal(used, CAIRN_UNBOUNDED - unbounded.left);
        assert_memory_equal(p.force, whole.force, sizeof p.force);
        assert_true(sum.potential == whole_sum.potential && sum.pairs == whole_sum.pairs);
    }
    unbounded.left = 0;
    next = 1;
    assert_status(cairn_force_kernel_row(&kernel, &whole.view, 0, &next, MANY, 1, 1, &whole_sum, &unbounded),
                  CAIRN_MORE);
    assert_int_equal(next, 1);
    next = MANY;
    assert_ok(cairn_force_kernel_row(&kernel, &whole.view, 0, &next, MANY, 1, 1, &whole_sum, &unbounded));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_formulas),  cmocka_unit_test(test_force_is_minus_the_gradient),
        cmocka_unit_test(test_zero_distance), cmocka_unit_test(test_row_against_the_formulas),
        cmocka_unit_test(test_tables),        cmocka_unit_test(test_row_at_no_distance),
        cmocka_unit_test(test_row_budgets),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
