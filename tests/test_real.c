/* The elementary functions compared with libm in long double, over dense seeded arguments: the
 * table of real.h is measured here. Golden hashes hold the bits. */
#include "tests/test.h"

#include <float.h>
#include <math.h>

#define MANTISSA         NUMBER(DBL_MANT_DIG, FLT_MANT_DIG)
#define MIN_EXPONENT     NUMBER(DBL_MIN_EXP, FLT_MIN_EXP)
#define SMALLEST         NUMBER(DBL_MIN, (cairn_real)FLT_MIN)
#define NEXT(x, towards) NUMBER(nextafter(x, towards), nextafterf(x, (float)(towards)))
/* Where long double is no wider than double, the figure includes libm's own error. */
#define REFERENCE_ERROR (LDBL_MANT_DIG > MANTISSA ? 0.0 : 1.0)

enum { ARGUMENTS = 200000 };

static const cairn_real INFINITE = (cairn_real)INFINITY;
static const cairn_real NOT_A_NUMBER = (cairn_real)NAN;

/* Distance of the spacing of reals at x, subnormal ones included. */
static long double ulp_at(long double x)
{
    int exponent;

    (void)frexpl(x, &exponent);
    return ldexpl(1, (exponent > MIN_EXPONENT ? exponent : MIN_EXPONENT) - MANTISSA);
}

static double error_ulp(cairn_real actual, long double exact)
{
    if (isinf(actual) && fabsl(exact) >= (long double)CAIRN_REAL_MAX)
        return (double)((fabsl(exact) - (long double)CAIRN_REAL_MAX) > 0 ? 0 : 1);
    return (double)(fabsl((long double)actual - exact) / ulp_at(exact));
}

typedef struct worst {
    const char *name;
    double error, at;
} worst;

static void record(worst *w, double error, cairn_real at)
{
    if (!(error <= w->error)) {
        w->error = error;
        w->at = (double)at;
    }
}

static void assert_worst(const worst *w, double bound)
{
    print_message("%-8s worst %.3f ulp at %.17g (bound %.0f)\n", w->name, w->error, w->at, bound);
    if (!(w->error <= bound + REFERENCE_ERROR))
        fail_msg("%s is off by %.3f ulp at %.17g, documented are %.0f", w->name, w->error, w->at,
                 bound);
    /* A sweep without any error has compared nothing. */
    assert_true(w->error > 0.4);
}

/* Of random sign, uniform in the exponent between 2^low and 2^high. */
static cairn_real log_uniform(cairn_random *random, cairn_real low, cairn_real high)
{
    cairn_real mantissa = cairn_random_uniform(random, 1, 2);
    cairn_real exponent = cairn_floor(cairn_random_uniform(random, low, high));
    cairn_real sign = cairn_random_below(random, 2) ? 1 : -1;

    return (cairn_real)ldexp((double)(sign * mantissa), (int)exponent);
}

static void sine_and_cosine(void **state)
{
    cairn_random random = cairn_random_seed(1, 1);
    const cairn_real limit = NUMBER(1e5, 1e3f);
    worst sine = {"sin", 0, 0}, cosine = {"cos", 0, 0};

    (void)state;
    for (int i = 0; i < 4 * ARGUMENTS; i++) {
        cairn_real x = 0, s, c;

        switch (i % 4) {
        case 0:
            x = cairn_random_uniform(&random, -CAIRN_PI, CAIRN_PI);
            break;
        case 1:
            x = cairn_random_uniform(&random, -limit, limit);
            break;
        case 2:
            x = log_uniform(&random, NUMBER(-300, -120), 3);
            break;
        default: /* beside the multiples of pi/2, where cancellation is worst */
            x = cairn_rint(cairn_random_uniform(&random, -limit, limit) / (CAIRN_PI / 2)) *
                (CAIRN_PI / 2);
            if (cairn_random_below(&random, 2))
                x = NEXT(x, 0);
        }
        cairn_sincos(x, &s, &c);
        assert_true(s == cairn_sin(x) && c == cairn_cos(x));
        record(&sine, error_ulp(s, sinl((long double)x)), x);
        record(&cosine, error_ulp(c, cosl((long double)x)), x);
    }
    assert_worst(&sine, NUMBER(3, 2));
    assert_worst(&cosine, NUMBER(3, 2));
}

static void large_angles_stay_on_the_circle(void **state)
{
    cairn_random random = cairn_random_seed(2, 1);

    (void)state;
    for (int i = 0; i < 20000; i++) {
        cairn_real x = log_uniform(&random, 8, NUMBER(1000, 120)), s, c;

        cairn_sincos(x, &s, &c);
        assert_near(s * s + c * c, 1, 4 * CAIRN_REAL_EPSILON);
    }
    /* Beyond the reduction limit the period is the rounded 2 pi: whole turns of it have no
     * effect. */
    {
        cairn_real turn = 2 * CAIRN_PI * NUMBER(1048576, 1024), s, c;

        cairn_sincos(turn, &s, &c);
        assert_true(s == 0 && c == 1);
        cairn_sincos(-turn, &s, &c);
        assert_true(s == 0 && c == 1);
    }
    {
        /* On both sides of the limit both reductions agree up to the rounding of 2 pi after these
         * turns. */
        cairn_real limit = NUMBER(1000000, 6000), s, c;

        for (int i = -5; i <= 5; i++) {
            cairn_real x = limit + (cairn_real)i * NUMBER(0.125, 0.125f);

            cairn_sincos(x, &s, &c);
            assert_near(s, sinl((long double)x), NUMBER(5e-11, 2e-4));
            assert_near(c, cosl((long double)x), NUMBER(5e-11, 2e-4));
        }
        cairn_sincos(limit, &s, &c);
        assert_near(s, sinl((long double)limit), NUMBER(2e-16, 2e-7));
        assert_near(c, cosl((long double)limit), NUMBER(2e-16, 2e-7));
    }
}

static void sine_special(void **state)
{
    static const struct {
        cairn_real x;
        double sine, cosine;
    } quarters[] = {{0, 0, 1},
                    {CAIRN_PI / 6, 0.5, 0.86602540378443865},
                    {CAIRN_PI / 2, 1, 0},
                    {2 * CAIRN_PI / 3, 0.86602540378443865, -0.5},
                    {CAIRN_PI, 0, -1},
                    {-CAIRN_PI / 2, -1, 0},
                    {3 * CAIRN_PI / 2, -1, 0},
                    {-CAIRN_PI / 6, -0.5, 0.86602540378443865}};
    cairn_real s = 0, c = 0;

    (void)state;
    for (size_t i = 0; i < sizeof quarters / sizeof *quarters; i++) {
        cairn_sincos(quarters[i].x, &s, &c);
        assert_near(s, quarters[i].sine, 2 * CAIRN_REAL_EPSILON);
        assert_near(c, quarters[i].cosine, 2 * CAIRN_REAL_EPSILON);
    }
    cairn_sincos(NUMBER(-0.0, -0.0f), &s, &c);
    assert_true(s == 0 && c == 1);
    cairn_sincos(INFINITE, &s, &c);
    assert_true(isnan(s) && isnan(c));
    cairn_sincos(-INFINITE, &s, &c);
    assert_true(isnan(s) && isnan(c));
    assert_true(isnan(cairn_sin(NOT_A_NUMBER)) && isnan(cairn_cos(NOT_A_NUMBER)));
    assert_true(cairn_sin(SMALLEST) == SMALLEST);
    for (int i = -2000; i < 2000; i++) {
        cairn_real x = (cairn_real)i / 100;

        assert_true(cairn_sin(-x) == -cairn_sin(x));
        assert_true(cairn_cos(-x) == cairn_cos(x));
    }
}

static void arc_tangent(void **state)
{
    cairn_random random = cairn_random_seed(3, 1);
    worst w = {"atan2", 0, 0};

    (void)state;
    for (int i = 0; i < 3 * ARGUMENTS; i++) {
        cairn_real x = 0, y = 0;

        switch (i % 3) {
        case 0:
            x = cairn_random_uniform(&random, -1, 1);
            y = cairn_random_uniform(&random, -1, 1);
            break;
        case 1:
            x = log_uniform(&random, NUMBER(-1070, -145), NUMBER(1023, 127));
            y = log_uniform(&random, NUMBER(-1070, -145), NUMBER(1023, 127));
            break;
        default: /* about the limits (2 k + 1) / 8 between the table's entries */
            x = log_uniform(&random, -3, 3);
            y = x * (cairn_real)(2 * cairn_random_below(&random, 8) + 1) / 8;
            y += y * cairn_random_uniform(&random, -16, 16) * CAIRN_REAL_EPSILON;
        }
        if (fabsl(atan2l((long double)y, (long double)x)) < (long double)SMALLEST)
            assert_true(cairn_atan2(y, x) == 0);
        else
            record(&w, error_ulp(cairn_atan2(y, x), atan2l((long double)y, (long double)x)), y / x);
    }
    assert_worst(&w, 2);
}

static void arc_tangent_special(void **state)
{
    const cairn_real zero = 0, minus_zero = NUMBER(-0.0, -0.0f), inf = INFINITE,
                     huge = CAIRN_REAL_MAX;
    const struct {
        cairn_real y, x;
        double angle;
    } cases[] = {
        {zero, 1, 0},
        {minus_zero, 1, -0.0},
        {zero, zero, 0},
        {minus_zero, zero, -0.0},
        {zero, minus_zero, 3.14159265358979323846},
        {minus_zero, minus_zero, -3.14159265358979323846},
        {zero, -1, 3.14159265358979323846},
        {minus_zero, -1, -3.14159265358979323846},
        {1, zero, 1.57079632679489661923},
        {-1, minus_zero, -1.57079632679489661923},
        {1, 1, 0.78539816339744830962},
        {1, -1, 2.35619449019234492885},
        {-1, -1, -2.35619449019234492885},
        {-1, 1, -0.78539816339744830962},
        {inf, inf, 0.78539816339744830962},
        {inf, -inf, 2.35619449019234492885},
        {-inf, -inf, -2.35619449019234492885},
        {-inf, inf, -0.78539816339744830962},
        {inf, 3, 1.57079632679489661923},
        {-inf, -3, -1.57079632679489661923},
        {3, inf, 0},
        {-3, inf, -0.0},
        {3, -inf, 3.14159265358979323846},
        {-3, -inf, -3.14159265358979323846},
        {huge, huge, 0.78539816339744830962},
        {SMALLEST, SMALLEST, 0.78539816339744830962},
        {SMALLEST / 4, SMALLEST / 4, 0.78539816339744830962},
        {huge, SMALLEST, 1.57079632679489661923},
    };

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        cairn_real angle = cairn_atan2(cases[i].y, cases[i].x);

        assert_near(angle, cases[i].angle, (double)CAIRN_REAL_EPSILON * fabs(cases[i].angle));
        assert_int_equal(signbit(angle) != 0, signbit(cases[i].angle) != 0);
    }
    assert_true(isnan(cairn_atan2(NOT_A_NUMBER, 1)));
    assert_true(isnan(cairn_atan2(1, NOT_A_NUMBER)));
    assert_true(isnan(cairn_atan2(NOT_A_NUMBER, inf)));
}

static void exponential(void **state)
{
    cairn_random random = cairn_random_seed(4, 1);
    const cairn_real top = NUMBER(709.78271289338397, 88.7228317f),
                     bottom = NUMBER(-708.396, -87.336f);
    worst w = {"exp", 0, 0};

    (void)state;
    for (int i = 0; i < 3 * ARGUMENTS; i++) {
        cairn_real x = 0;

        switch (i % 3) {
        case 0:
            x = cairn_random_uniform(&random, bottom, top);
            break;
        case 1:
            x = cairn_random_uniform(&random, -2, 2);
            break;
        default: /* where the multiple of ln 2 changes */
            x = ((cairn_real)cairn_random_below(&random, 200) - NUMBER(99.5, 99.5f)) *
                NUMBER(0.69314718055994531, 0.693147181f);
            x += x * cairn_random_uniform(&random, -8, 8) * CAIRN_REAL_EPSILON;
        }
        record(&w, error_ulp(cairn_exp(x), expl((long double)x)), x);
    }
    assert_worst(&w, 2);
    assert_true(cairn_exp(0) == 1);
    assert_true(cairn_exp(top) <= CAIRN_REAL_MAX);
    assert_true(cairn_exp(top) > CAIRN_REAL_MAX / 2);
    assert_true(cairn_exp(NEXT(top, INFINITE)) == INFINITE);
    assert_true(cairn_exp(INFINITE) == INFINITE);
    assert_true(cairn_exp(bottom) >= SMALLEST &&
                cairn_exp(bottom) < NUMBER(1.001, 1.001f) * SMALLEST);
    for (cairn_real x = NUMBER(-708.397, -87.337f); x > NUMBER(-746, -104);
         x -= NUMBER(0.125, 0.125f))
        assert_true(cairn_exp(x) == 0);
    assert_true(cairn_exp(NUMBER(-800, -200)) == 0);
    assert_true(cairn_exp(-INFINITE) == 0);
    assert_true(isnan(cairn_exp(NOT_A_NUMBER)));
}

static void logarithm(void **state)
{
    cairn_random random = cairn_random_seed(5, 1);
    worst w = {"log", 0, 0};

    (void)state;
    for (int i = 0; i < 4 * ARGUMENTS; i++) {
        cairn_real x = 0;

        switch (i % 4) {
        case 0:
            x = cairn_abs(log_uniform(&random, NUMBER(-1074, -149), NUMBER(1024, 128)));
            break;
        case 1:
            x = cairn_random_uniform(&random, NUMBER(0.5, 0.5f), 2);
            break;
        case 2: /* about 1, where the result is small */
            x = 1 + log_uniform(&random, NUMBER(-52, -23), -4);
            break;
        default: /* about the square root of 1/2, where the exponent changes */
            x = NUMBER(0.70710678118654752, 0.707106781f) *
                (1 + cairn_random_uniform(&random, -64, 64) * CAIRN_REAL_EPSILON);
            x *= (cairn_real)(1 << cairn_random_below(&random, 4));
        }
        record(&w, error_ulp(cairn_log(x), logl((long double)x)), x);
    }
    assert_worst(&w, 2);
    assert_true(cairn_log(1) == 0);
    assert_true(cairn_log(0) == -INFINITE);
    assert_true(cairn_log(NUMBER(-0.0, -0.0f)) == -INFINITE);
    assert_true(cairn_log(INFINITE) == INFINITE);
    assert_true(isnan(cairn_log(-SMALLEST)));
    assert_true(isnan(cairn_log(-INFINITE)));
    assert_true(isnan(cairn_log(NOT_A_NUMBER)));
    assert_near(cairn_log(CAIRN_REAL_MAX), NUMBER(709.782712893384, 88.7228394f),
                NUMBER(1e-12, 1e-5));
}

static void complementary_error_function(void **state)
{
    cairn_random random = cairn_random_seed(6, 1);
    const cairn_real normal_up_to = NUMBER(26.543, 9.194f), zero_from = NUMBER(26.544, 9.195f);
    worst w = {"erfc", 0, 0};

    (void)state;
    for (int i = 0; i < 4 * ARGUMENTS; i++) {
        cairn_real x = 0;

        switch (i % 4) {
        case 0:
            x = cairn_random_uniform(&random, -6, normal_up_to);
            break;
        case 1:
            x = cairn_random_uniform(&random, -2, 2);
            break;
        case 2:
            x = log_uniform(&random, NUMBER(-300, -100), 1);
            break;
        default: /* where the method changes */
            x = NUMBER(0.75, 0.75f) + cairn_random_uniform(&random, -32, 32) * CAIRN_REAL_EPSILON;
        }
        record(&w, error_ulp(cairn_erfc(x), erfcl((long double)x)), x);
        x = cairn_random_uniform(&random, zero_from, 2 * zero_from);
        assert_true(cairn_erfc(x) == 0);
        assert_true(cairn_erfc(-x) == 2);
    }
    assert_worst(&w, 5);
    assert_true(cairn_erfc(0) == 1);
    assert_true(cairn_erfc(zero_from) == 0);
    assert_true(cairn_erfc(normal_up_to) >= SMALLEST);
    assert_true(cairn_erfc(INFINITE) == 0);
    assert_true(cairn_erfc(-INFINITE) == 2);
    assert_true(isnan(cairn_erfc(NOT_A_NUMBER)));
}

static void to_int_is_clamped(void **state)
{
    (void)state;
    assert_int_equal(cairn_real_to_int(0), 0);
    assert_int_equal(cairn_real_to_int(NUMBER(2.99, 2.99f)), 2);
    assert_int_equal(cairn_real_to_int(NUMBER(-2.99, -2.99f)), -2);
    assert_int_equal(cairn_real_to_int(NUMBER(-0.5, -0.5f)), 0);
    assert_int_equal(cairn_real_to_int(NUMBER(2147483647.0, 2147483520.0f)),
                     NUMBER(2147483647, 2147483520));
    assert_int_equal(cairn_real_to_int(NUMBER(2147483647.9, 2147483648.0f)), INT32_MAX);
    assert_int_equal(cairn_real_to_int(NUMBER(2147483648.0, 2147483648.0f)), INT32_MAX);
    assert_int_equal(cairn_real_to_int(NUMBER(-2147483647.0, -2147483520.0f)),
                     NUMBER(-2147483647, -2147483520));
    assert_int_equal(cairn_real_to_int(NUMBER(-2147483648.0, -2147483648.0f)), INT32_MIN);
    assert_int_equal(cairn_real_to_int(NUMBER(-3e9, -3e9f)), INT32_MIN);
    assert_int_equal(cairn_real_to_int(CAIRN_REAL_MAX), INT32_MAX);
    assert_int_equal(cairn_real_to_int(INFINITE), INT32_MAX);
    assert_int_equal(cairn_real_to_int(-INFINITE), INT32_MIN);
    assert_int_equal(cairn_real_to_int(NOT_A_NUMBER), 0);
}

/* Angles of all magnitudes are reduced exactly, as by fmod of libc math. */
static void reduces_angles_exactly(void **state)
{
    cairn_random random = cairn_random_seed(9, 1);
    const double turn = 2 * (double)CAIRN_PI;

    (void)state;
    for (int i = 0; i < 50; i++) {
        cairn_real x = cairn_random_uniform(&random, -1, 1) * CAIRN_REAL_MAX;
        double rest;

        for (; cairn_abs(x) > 1; x *= cairn_random_unit(&random)) {
            rest = fmod((double)x, turn);
            if (fabs(rest) > (double)CAIRN_PI)
                rest -= copysign(turn, rest);
            assert_true(cairn_wrap_angle(x) == (cairn_real)rest);
        }
    }
}

static void wrapped_angles(void **state)
{
    cairn_random random = cairn_random_seed(7, 1);

    (void)state;
    assert_true(cairn_wrap_angle(0) == 0);
    assert_true(cairn_wrap_angle(CAIRN_PI) == CAIRN_PI);
    assert_true(cairn_wrap_angle(-CAIRN_PI) == CAIRN_PI);
    assert_near(cairn_abs(cairn_wrap_angle(3 * CAIRN_PI)), CAIRN_PI, 4 * CAIRN_REAL_EPSILON);
    assert_true(cairn_wrap_angle(2 * CAIRN_PI) == 0);
    assert_near(cairn_wrap_angle(4), 4 - 6.283185307179586, 2 * CAIRN_REAL_EPSILON);
    assert_near(cairn_wrap_angle(-4), 6.283185307179586 - 4, 2 * CAIRN_REAL_EPSILON);
    assert_near(cairn_wrap_angle(10), 10 - 2 * 6.283185307179586, 8 * CAIRN_REAL_EPSILON);
    assert_near(cairn_wrap_angle(-10), 2 * 6.283185307179586 - 10, 8 * CAIRN_REAL_EPSILON);
    for (int i = 0; i < 20000; i++) {
        cairn_real x = cairn_random_uniform(&random, -1000, 1000);
        cairn_real wrapped = cairn_wrap_angle(x);
        double turns = (double)(x - wrapped) / (2 * (double)CAIRN_PI);

        assert_true(wrapped > -CAIRN_PI && wrapped <= CAIRN_PI);
        assert_near(turns, rint(turns), NUMBER(1e-12, 1e-4));
        assert_true(cairn_wrap_angle(wrapped) == wrapped);
    }
    assert_true(isnan(cairn_wrap_angle(NOT_A_NUMBER)));
    assert_true(isnan(cairn_wrap_angle(INFINITE)));
}

static void small_functions(void **state)
{
    (void)state;
    assert_true(cairn_sqrt(9) == 3);
    assert_true(cairn_abs(-2) == 2 && cairn_abs(2) == 2);
    assert_true(cairn_floor(NUMBER(-1.5, -1.5f)) == -2);
    assert_true(cairn_ceil(NUMBER(-1.5, -1.5f)) == -1);
    assert_true(cairn_rint(NUMBER(2.5, 2.5f)) == 2 && cairn_rint(NUMBER(3.5, 3.5f)) == 4);
    assert_true(cairn_min(1, 2) == 1 && cairn_min(2, 1) == 1);
    assert_true(cairn_max(1, 2) == 2 && cairn_max(2, 1) == 2);
    assert_true(cairn_is_finite(CAIRN_REAL_MAX) && cairn_is_finite(-CAIRN_REAL_MAX) &&
                cairn_is_finite(0));
    assert_false(cairn_is_finite(INFINITE));
    assert_false(cairn_is_finite(-INFINITE));
    assert_false(cairn_is_finite(NOT_A_NUMBER));
}

/* The bits themselves, equal for every conforming compiler and machine. */
static void golden_bits(void **state)
{
    cairn_random random = cairn_random_seed(42, 7);
    uint64_t hash = TEST_HASH_START;

    (void)state;
    for (int i = 0; i < 20000; i++) {
        cairn_real a = cairn_random_uniform(&random, -30, 30), b = log_uniform(&random, -20, 20),
                   out[8];

        cairn_sincos(a, &out[0], &out[1]);
        cairn_sincos(b, &out[2], &out[3]);
        out[4] = cairn_atan2(a, b);
        out[5] = cairn_exp(a);
        out[6] = cairn_log(cairn_abs(b));
        out[7] = cairn_erfc(a / 4);
        hash = test_hash(hash, out, sizeof out);
    }
    if (hash != NUMBER(UINT64_C(0xc71b2124411a68a0), UINT64_C(0x10def8a7525edce2)))
        fail_msg("the bits hash to 0x%016llx", (unsigned long long)hash);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sine_and_cosine),
        cmocka_unit_test(large_angles_stay_on_the_circle),
        cmocka_unit_test(sine_special),
        cmocka_unit_test(arc_tangent),
        cmocka_unit_test(arc_tangent_special),
        cmocka_unit_test(exponential),
        cmocka_unit_test(logarithm),
        cmocka_unit_test(complementary_error_function),
        cmocka_unit_test(to_int_is_clamped),
        cmocka_unit_test(wrapped_angles),
        cmocka_unit_test(reduces_angles_exactly),
        cmocka_unit_test(small_functions),
        cmocka_unit_test(golden_bits),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
