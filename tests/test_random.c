/* PCG32 compared with its published output; ranges, moments and uniformity of derived numbers. */
#include "tests/test.h"

#include <math.h>

static void reference_output(void **state)
{
    /* pcg32-demo of the reference implementation: seed 42, stream 54. */
    static const uint32_t expected[] = {0xa15c02b7, 0x7b47f409, 0xba1d3330,
                                        0x83d2f293, 0xbfa4784b, 0xcbed606e};
    cairn_random random = cairn_random_seed(42, 54);

    (void)state;
    for (size_t i = 0; i < sizeof expected / sizeof *expected; i++)
        assert_int_equal(cairn_random_bits(&random), expected[i]);
}

static void seeds_and_streams_differ(void **state)
{
    cairn_random a = cairn_random_seed(1, 1), b = cairn_random_seed(1, 2),
                 c = cairn_random_seed(2, 1), a_again;
    int equal_stream = 0, equal_seed = 0;

    (void)state;
    a_again = cairn_random_seed(1, 1);
    assert_true(a.increment % 2 == 1 && b.increment % 2 == 1);
    for (int i = 0; i < 1000; i++) {
        uint32_t bits = cairn_random_bits(&a);

        equal_stream += bits == cairn_random_bits(&b);
        equal_seed += bits == cairn_random_bits(&c);
        assert_int_equal(bits, cairn_random_bits(&a_again));
    }
    assert_true(equal_stream <= 1 && equal_seed <= 1);
}

static void unit_is_made_of_the_high_bits(void **state)
{
    cairn_random random = cairn_random_seed(3, 3), replica = random;

    (void)state;
    for (int i = 0; i < 1000; i++) {
        cairn_real x = cairn_random_unit(&random);
#ifdef CAIRN_FLOAT
        assert_true(x == (cairn_real)(cairn_random_bits(&replica) / 256) / 16777216);
#else
        double high = floor(cairn_random_bits(&replica) / 32.0);
        double low = floor(cairn_random_bits(&replica) / 64.0);

        assert_true(x == (high * 67108864 + low) / 9007199254740992.0);
#endif
        assert_true(x >= 0 && x < 1);
    }
    assert_true(random.state == replica.state);
}

static void unit_is_uniform(void **state)
{
    enum { BINS = 64, DRAWS = 64000 };
    cairn_random random = cairn_random_seed(4, 0);
    int bins[BINS] = {0};
    const double expected = (double)DRAWS / BINS;
    double chi_square = 0, sum = 0, product = 0, last = 0;

    (void)state;
    for (int i = 0; i < DRAWS; i++) {
        double x = (double)cairn_random_unit(&random);

        bins[(int)(x * BINS)]++;
        sum += x;
        product += (x - 0.5) * (last - 0.5);
        last = x;
    }
    for (int i = 0; i < BINS; i++)
        chi_square += (bins[i] - expected) * (bins[i] - expected) / expected;
    /* 63 degrees of freedom: mean 63, standard deviation 11.2. */
    assert_true(chi_square > 63 - 35 && chi_square < 63 + 45);
    assert_near(sum / DRAWS, 0.5, 4 * 0.2887 / sqrt(DRAWS));
    assert_near(product / DRAWS, 0, 4.0 / 12 / sqrt(DRAWS));
}

static void uniform_keeps_its_bounds(void **state)
{
    cairn_random random = cairn_random_seed(5, 0);
    cairn_real least = 10, most = -10;

    (void)state;
    for (int i = 0; i < 20000; i++) {
        cairn_real x = cairn_random_uniform(&random, -3, 5);

        assert_true(x >= -3 && x < 5);
        least = cairn_min(least, x);
        most = cairn_max(most, x);
    }
    assert_near(least, -3, 0.01);
    assert_near(most, 5, 0.01);
    /* Two neighbouring numbers: half of the draws round to the upper one, which is not in the
     * interval. */
    for (int i = 0; i < 100; i++)
        assert_true(cairn_random_uniform(&random, 1, 1 + CAIRN_REAL_EPSILON) == 1);
    assert_true(cairn_random_uniform(&random, 7, 7) == 7);
    {
        /* reversed bounds still enclose it */
        cairn_real x = cairn_random_uniform(&random, 2, -2);

        assert_true(x <= 2 && x >= -2);
    }
}

static void uniform_is_a_scaled_unit(void **state)
{
    cairn_random random = cairn_random_seed(6, 0), replica = random;

    (void)state;
    for (int i = 0; i < 100; i++) {
        cairn_real unit = cairn_random_unit(&replica);

        assert_near(cairn_random_uniform(&random, 2, 10), 2 + 8 * unit, 20 * CAIRN_REAL_EPSILON);
    }
}

static void normal_has_the_moments(void **state)
{
    enum { DRAWS = 100000 };
    cairn_random random = cairn_random_seed(7, 0);
    double m1 = 0, m2 = 0, m3 = 0, m4 = 0, largest = 0;
    int beyond = 0;

    (void)state;
    for (int i = 0; i < DRAWS; i++) {
        double x = (double)cairn_random_normal(&random);

        assert_true(isfinite(x));
        m1 += x;
        m2 += x * x;
        m3 += x * x * x;
        m4 += x * x * x * x;
        largest = fmax(largest, fabs(x));
        beyond += fabs(x) > 1.959964;
    }
    /* Four standard errors each. */
    assert_near(m1 / DRAWS, 0, 4 / sqrt(DRAWS));
    assert_near(m2 / DRAWS, 1, 4 * sqrt(2.0 / DRAWS));
    assert_near(m3 / DRAWS, 0, 4 * sqrt(15.0 / DRAWS));
    assert_near(m4 / DRAWS, 3, 4 * sqrt(96.0 / DRAWS));
    assert_near((double)beyond / DRAWS, 0.05, 4 * sqrt(0.05 * 0.95 / DRAWS));
    assert_true(largest > 3.5 && largest < 6);
}

static void normal_is_box_and_muller(void **state)
{
    cairn_random random = cairn_random_seed(8, 0), replica = random;

    (void)state;
    for (int i = 0; i < 1000; i++) {
        double u = (double)cairn_random_unit(&replica), v = (double)cairn_random_unit(&replica);

        assert_near(cairn_random_normal(&random),
                    sqrt(-2 * log(1 - u)) * cos(6.283185307179586 * v), NUMBER(1e-14, 3e-6));
    }
}

static void below_is_unbiased(void **state)
{
    cairn_random random = cairn_random_seed(9, 0), before;
    int count[7] = {0};
    int low = 0;

    (void)state;
    for (int i = 0; i < 70000; i++) {
        int32_t k = cairn_random_below(&random, 7);

        assert_true(k >= 0 && k < 7);
        count[k]++;
    }
    for (int k = 0; k < 7; k++)
        assert_near(count[k], 10000, 4 * sqrt(10000));
    /* With 3 * 2^30 plain remainders would give the lowest third of the results half of all
     * draws. */
    for (int i = 0; i < 10000; i++) {
        int32_t k = cairn_random_below(&random, 0x60000000);

        assert_true(k >= 0 && k < 0x60000000);
        low += k < 0x20000000;
    }
    assert_near(low / 10000.0, 1 / 3.0, 0.02);

    before = random;
    assert_int_equal(cairn_random_below(&random, 0), 0);
    assert_int_equal(cairn_random_below(&random, -5), 0);
    assert_true(random.state == before.state);
    assert_int_equal(cairn_random_below(&random, 1), 0);
}

/* Rejection: bits below 2^32 mod count are drawn again, others taken modulo count. */
static void below_rejects_exactly(void **state)
{
    cairn_random random = cairn_random_seed(10, 0), replica = random;
    static const int32_t counts[] = {1,          2,          3,          10,       1000,
                                     0x40000000, 0x55555556, 0x60000000, INT32_MAX};
    int rejected = 0;

    (void)state;
    for (int i = 0; i < 9000; i++) {
        int32_t count = counts[i % 9];
        uint64_t drop = (UINT64_C(1) << 32) % (uint64_t)count;
        uint32_t bits = cairn_random_bits(&replica);

        while (bits < drop) {
            bits = cairn_random_bits(&replica);
            rejected++;
        }
        assert_int_equal(cairn_random_below(&random, count), bits % (uint32_t)count);
    }
    assert_true(rejected > 500);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(reference_output),
        cmocka_unit_test(seeds_and_streams_differ),
        cmocka_unit_test(unit_is_made_of_the_high_bits),
        cmocka_unit_test(unit_is_uniform),
        cmocka_unit_test(uniform_keeps_its_bounds),
        cmocka_unit_test(uniform_is_a_scaled_unit),
        cmocka_unit_test(normal_has_the_moments),
        cmocka_unit_test(normal_is_box_and_muller),
        cmocka_unit_test(below_is_unbiased),
        cmocka_unit_test(below_rejects_exactly),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
