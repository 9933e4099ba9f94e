/* Elementary functions that give the same bits everywhere.
 *
 * Method:
 * 1. The argument is reduced to a short interval, with constants split into parts (Cody and Waite
 *    1980).
 * 2. There a polynomial is evaluated by Horner's rule. sin, cos, atan, exp and log use their Taylor
 *    series, truncated below a tenth of an ulp. erf(x) / x on [0, 0.75], and above it (x + 1/2)
 *    exp(x^2) erfc(x) in t = (x - 3) / (x + 3) (after Shepherd and Laframboise 1981), are Chebyshev
 *    fits converted to powers.
 *
 * Only +, -, *, / and correctly rounded or exact functions of libc math are used, so every
 * conforming compiler gives the same bits.
 *
 * Source: Cody and Waite, Software manual for the elementary functions, 1980; Shepherd and
 * Laframboise 1981. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/real.h"

extern inline cairn_real cairn_abs(cairn_real x);
extern inline int cairn_is_finite(cairn_real x);
extern inline int32_t cairn_real_to_int(cairn_real x);

/* Functions of libc math for the type cairn_real. */
#ifdef CAIRN_FLOAT
#define LDEXP    ldexpf
#define FREXP    frexpf
#define COPYSIGN copysignf
typedef uint32_t real_bits;
enum { MANTISSA_BITS = 23, EXPONENT_BIAS = 127 };
#else
#define LDEXP    ldexp
#define FREXP    frexp
#define COPYSIGN copysign
typedef uint64_t real_bits;
enum { MANTISSA_BITS = 52, EXPONENT_BIAS = 1023 };
#endif

/* Coefficients of the polynomials, in ascending order. */
#ifdef CAIRN_FLOAT
static const cairn_real SINE_COEFFICIENTS[] = {-0.166666667f, 0.00833333333f, -0.000198412698f,
                                               2.75573192e-06f};
static const cairn_real COSINE_COEFFICIENTS[] = {0.0416666667f, -0.00138888889f, 2.48015873e-05f,
                                                 -2.75573192e-07f};
static const cairn_real ARCTAN_COEFFICIENTS[] = {-0.333333333f, 0.2f, -0.142857143f, 0.111111111f};
static const cairn_real EXPONENTIAL_COEFFICIENTS[] = {
    0.5f,           0.166666667f,    0.0416666667f,  0.00833333333f,
    0.00138888889f, 0.000198412698f, 2.48015873e-05f};
static const cairn_real LOGARITHM_COEFFICIENTS[] = {0.666666667f, 0.4f, 0.285714286f, 0.222222222f,
                                                    0.181818182f};
static const cairn_real ERF_COEFFICIENTS[] = {1.12837917f,    -0.376126385f,  0.112837787f,
                                              -0.0268647797f, 0.00521681665f, -0.000835735646f,
                                              9.47299835e-05f};
static const cairn_real ERFCX_COEFFICIENTS[] = {0.626504029f,     -0.0678105509f,  -0.0237811558f,
                                                0.0648224475f,    -0.0596365928f,  0.0341562784f,
                                                -0.011887527f,    0.00124862932f,  0.000952881558f,
                                                -0.000338999579f, -6.29051203e-05f};
/* pi/2 and ln 2 in parts. The products of the leading parts with the integers of the reduction are
 * exact. */
static const cairn_real HALF_PI_PARTS[] = {1.5703125f, 0.000483751297f, 7.54953362e-08f,
                                           2.56334415e-12f};
static const cairn_real LN2_PARTS[] = {0.693145752f, 1.42860682e-06f};

/* atan(k / 4), k = 0 ... 4, as a sum of two numbers. */
static const cairn_real ATAN_HIGH[] = {0, 0.244978666f, 0.463647604f, 0.643501103f, 0.785398185f};
static const cairn_real ATAN_LOW[] = {0, -3.17867784e-09f, 5.01215866e-09f, 5.86893746e-09f,
                                      -2.1855695e-08f};
static const cairn_real PI_HIGH = 3.14159274f, PI_LOW = -8.742278e-08f;

/* Largest |x|, in rad, up to which multiples of the parts of pi/2 are exact. */
static const cairn_real REDUCE_LIMIT = 6000;
/* exp overflows above this x. */
static const cairn_real EXP_MAX = 88.7228394f;
/* exp is 0 below this x. */
static const cairn_real EXP_MIN = -88;
/* erfc is 0 above this x. */
static const cairn_real ERFC_MAX = 9.3f;
/* Inverse step of the split of x in erfc: x rounded to 1/16 has an exact square. */
static const cairn_real ERFC_SPLIT = 16;
#else
static const cairn_real SINE_COEFFICIENTS[] = {-0.16666666666666666,    0.0083333333333333332,
                                               -0.00019841269841269841, 2.7557319223985893e-06,
                                               -2.505210838544172e-08,  1.6059043836821613e-10,
                                               -7.6471637318198164e-13, 2.8114572543455206e-15};
static const cairn_real COSINE_COEFFICIENTS[] = {
    0.041666666666666664, -0.0013888888888888889,  2.4801587301587302e-05, -2.7557319223985888e-07,
    2.08767569878681e-09, -1.1470745597729725e-11, 4.7794773323873853e-14, -1.5619206968586225e-16};
static const cairn_real ARCTAN_COEFFICIENTS[] = {
    -0.33333333333333331,  0.20000000000000001,  -0.14285714285714285,  0.1111111111111111,
    -0.090909090909090912, 0.076923076923076927, -0.066666666666666666, 0.058823529411764705};
static const cairn_real EXPONENTIAL_COEFFICIENTS[] = {0.5,
                                                      0.16666666666666666,
                                                      0.041666666666666664,
                                                      0.0083333333333333332,
                                                      0.0013888888888888889,
                                                      0.00019841269841269841,
                                                      2.4801587301587302e-05,
                                                      2.7557319223985893e-06,
                                                      2.7557319223985888e-07,
                                                      2.505210838544172e-08,
                                                      2.08767569878681e-09,
                                                      1.6059043836821613e-10,
                                                      1.1470745597729725e-11};
static const cairn_real LOGARITHM_COEFFICIENTS[] = {
    0.66666666666666663, 0.40000000000000002,  0.2857142857142857,  0.22222222222222221,
    0.18181818181818182, 0.15384615384615385,  0.13333333333333333, 0.11764705882352941,
    0.10526315789473684, 0.095238095238095233, 0.086956521739130432};
static const cairn_real ERF_COEFFICIENTS[] = {
    1.1283791670955126,      -0.37612638903183754,    0.11283791670955087,
    -0.026866170645118519,   0.0052239776252232459,   -0.00085483270012233438,
    0.00012055331549810692,  -1.4925589533723744e-05, 1.6460386405915453e-06,
    -1.6333271656928769e-07, 1.4414195873086809e-08,  -9.5038637623419788e-10};
static const cairn_real ERFCX_COEFFICIENTS[] = {
    0.6265040291348648,      -0.067810553062290599,   -0.023781147176725637,
    0.064822579351382234,    -0.059636831707633467,   0.034154013671911343,
    -0.011885257459941461,   0.0012646959096351397,   0.00094434518844367004,
    -0.00038991615594676334, -5.2579969090225262e-05, 6.2549835623330202e-05,
    2.4750502969607526e-06,  -1.0051122145125327e-05, -3.6647310390519061e-07,
    1.7390573337373671e-06,  1.7878649509004555e-07,  -3.1430784971086472e-07,
    -6.8515470850581181e-08, 5.7855843985001325e-08,  1.5399693569999794e-08,
    -9.7448846727672375e-09};
/* pi/2 and ln 2 in parts. The products of the leading parts with the integers of the reduction are
 * exact. */
static const cairn_real HALF_PI_PARTS[] = {1.5707963267341256, 6.077100506303966e-11,
                                           2.0222662487959506e-21, 0};
static const cairn_real LN2_PARTS[] = {0.69314718055829871, 1.6465949582897082e-12};

/* atan(k / 4), k = 0 ... 4, as a sum of two numbers. */
static const cairn_real ATAN_HIGH[] = {0, 0.24497866312686414, 0.46364760900080609,
                                       0.64350110879328437, 0.78539816339744828};
static const cairn_real ATAN_LOW[] = {0, 1.0698755618734451e-17, 2.2698777452961687e-17,
                                      1.5834785051444286e-17, 3.061616997868383e-17};
static const cairn_real PI_HIGH = 3.1415926535897931, PI_LOW = 1.2246467991473532e-16;

/* Largest |x|, in rad, up to which multiples of the parts of pi/2 are exact. */
static const cairn_real REDUCE_LIMIT = 1000000;
/* exp overflows above this x. */
static const cairn_real EXP_MAX = 709.78271289338397;
/* exp is 0 below this x. */
static const cairn_real EXP_MIN = -709;
/* erfc is 0 above this x. */
static const cairn_real ERFC_MAX = 26.6;
/* Inverse step of the split of x in erfc: x rounded to 2^-20 has an exact square. */
static const cairn_real ERFC_SPLIT = 1048576;
#endif

#define HORNER_SCHEME(coefficients, x)                                                             \
    horner(coefficients, (int)(sizeof(coefficients) / sizeof *(coefficients)), x)

/* Polynomial by Horner's rule, coefficients in ascending order. */
static inline cairn_real horner(const cairn_real *coefficients, int count, cairn_real x)
{
    cairn_real sum = coefficients[count - 1];

    for (int i = count - 2; i >= 0; i--)
        sum = sum * x + coefficients[i];
    return sum;
}

/* x, or 0 when |x| is below the least normal number, where math libraries and software arithmetic
 * differ. */
static cairn_real normal_or_zero(cairn_real x)
{
    return cairn_abs(x) < CAIRN_REAL_MIN ? 0 : x;
}

/* Returns x modulo 2 pi, with the sign of x; NaN for what is not finite. Exact: numbers within a factor
 * of 2 have an exact difference. */
static cairn_real reduce_turns(cairn_real x)
{
    cairn_real rest = cairn_abs(x), turns = 2 * PI_HIGH;

    if (!cairn_is_finite(x))
        return x - x;
    while (turns <= rest / 2)
        turns *= 2;
    while (turns >= 2 * PI_HIGH) {
        if (rest >= turns)
            rest -= turns;
        turns /= 2;
    }
    return COPYSIGN(rest, x);
}

/* Argument reduction of sin and cos: x = r + quarter * pi/2 with |r| <= pi/4 (slightly more by
 * rounding). Returns quarter modulo 4. */
static int32_t reduce_quarter(cairn_real x, cairn_real *r)
{
    cairn_real k;

    if (cairn_abs(x) > REDUCE_LIMIT)
        x = reduce_turns(x);
    k = cairn_rint(x * (2 / PI_HIGH));
    *r = (((x - k * HALF_PI_PARTS[0]) - k * HALF_PI_PARTS[1]) - k * HALF_PI_PARTS[2]) -
         k * HALF_PI_PARTS[3];
    return cairn_real_to_int(k) & 3;
}

void cairn_sincos(cairn_real x, cairn_real *sine, cairn_real *cosine)
{
    cairn_real r, z, s, c;
    int32_t quarter;

    if (!cairn_is_finite(x)) {
        *sine = *cosine = x - x;
        return;
    }
    quarter = reduce_quarter(x, &r);
    z = r * r;
    s = r + r * (z * HORNER_SCHEME(SINE_COEFFICIENTS, z));
    c = 1 - (z / 2 - z * z * HORNER_SCHEME(COSINE_COEFFICIENTS, z));
    *sine = quarter & 1 ? c : s;
    *cosine = quarter & 1 ? s : c;
    if (quarter & 2)
        *sine = -*sine;
    if (quarter == 1 || quarter == 2)
        *cosine = -*cosine;
}

cairn_real cairn_sin(cairn_real x)
{
    cairn_real s, c;

    cairn_sincos(x, &s, &c);
    return s;
}

cairn_real cairn_cos(cairn_real x)
{
    cairn_real s, c;

    cairn_sincos(x, &s, &c);
    return c;
}

/* atan(y / x) in the first octant, 0 <= y <= x, x > 0, as atan(k / 4) + atan((y - x k / 4) / (x + y
 * k / 4)). */
static cairn_real atan_octant(cairn_real y, cairn_real x)
{
    int32_t k = cairn_real_to_int(cairn_rint(4 * (y / x)));
    cairn_real c = (cairn_real)k / 4;
    cairn_real q = k == 0 ? y / x : (y - x * c) / (x + y * c);
    cairn_real z = q * q;

    CAIRN_ASSERT(k >= 0 && k <= 4);
    return ATAN_HIGH[k] + (q + (ATAN_LOW[k] + q * (z * HORNER_SCHEME(ARCTAN_COEFFICIENTS, z))));
}

/* x * 2^exponent, rounded as ldexp() rounds, without the call where the power of two is normal. */
static cairn_real scale(cairn_real x, int32_t exponent)
{
    cairn_real power;
    real_bits bits;

    if (exponent <= -EXPONENT_BIAS || exponent > EXPONENT_BIAS)
        return LDEXP(x, exponent);
    bits = (real_bits)(exponent + EXPONENT_BIAS) << MANTISSA_BITS;
    memcpy(&power, &bits, sizeof power);
    return x * power;
}

/* Mantissa, 0.5 ... 1, and exponent of a finite number > 0, as frexp(), without the call where the
 * number is normal. */
static cairn_real split(cairn_real x, int32_t *exponent)
{
    const real_bits one = 1, mantissa = (one << MANTISSA_BITS) - 1;
    union {
        cairn_real number;
        real_bits bits;
    } parts;
    int whole;

    if (x < CAIRN_REAL_MIN) {
        x = FREXP(x, &whole);
        *exponent = whole;
        return x;
    }
    parts.number = x;
    *exponent = (int32_t)(parts.bits >> MANTISSA_BITS) - (EXPONENT_BIAS - 1);
    parts.bits = (parts.bits & mantissa) | (real_bits)(EXPONENT_BIAS - 1) << MANTISSA_BITS;
    return parts.number;
}

cairn_real cairn_atan2(cairn_real y, cairn_real x)
{
    cairn_real ax = cairn_abs(x), ay = cairn_abs(y), angle;
    int32_t exponent;

    if (x != x || y != y)
        return x + y;
    if (ax > CAIRN_REAL_MAX || ay > CAIRN_REAL_MAX) {
        ax = ax > CAIRN_REAL_MAX ? 1 : 0;
        ay = ay > CAIRN_REAL_MAX ? 1 : 0;
    }
    /* Scaled to about 2^60: no intermediate result overflows, and no significant one is
     * subnormal. */
    (void)split(cairn_max(ax, ay), &exponent);
    ax = normal_or_zero(scale(ax, 60 - exponent));
    ay = normal_or_zero(scale(ay, 60 - exponent));
    if (ax == 0 && ay == 0)
        angle = 0;
    else if (ay <= ax)
        angle = normal_or_zero(atan_octant(ay, ax));
    else
        angle = PI_HIGH / 2 - (atan_octant(ax, ay) - PI_LOW / 2);
    if (x < 0 || (x == 0 && COPYSIGN(1, x) < 0))
        angle = PI_HIGH - (angle - PI_LOW);
    return COPYSIGN(angle, y);
}

cairn_real cairn_exp(cairn_real x)
{
    cairn_real k, r, low, sum;

    if (x != x)
        return x;
    if (x > EXP_MAX)
        return (cairn_real)INFINITY;
    if (x < EXP_MIN)
        return 0;
    k = cairn_rint(x / (LN2_PARTS[0] + LN2_PARTS[1]));
    r = x - k * LN2_PARTS[0];
    low = k * LN2_PARTS[1];
    r -= low;
    sum = 1 + (r + r * r * HORNER_SCHEME(EXPONENTIAL_COEFFICIENTS, r));
    return normal_or_zero(scale(sum, cairn_real_to_int(k)));
}

cairn_real cairn_log(cairn_real x)
{
    cairn_real m, f, z, half_square, k;
    int32_t exponent;

    if (x != x)
        return x;
    if (x < 0)
        return (cairn_real)NAN;
    if (x == 0)
        return -(cairn_real)INFINITY;
    if (x > CAIRN_REAL_MAX)
        return x;
    m = split(x, &exponent);
    if (m < CAIRN_REAL(0.70710678118654752)) {
        m *= 2;
        exponent--;
    }
    /* log m = 2 atanh f = g - g^2/2 + f (g^2/2 + 2 atanh(f)/f - 2) with g = m - 1 exact, so the
     * leading term is not rounded. */
    m -= 1;
    f = m / (2 + m);
    z = f * f;
    half_square = m * m / 2;
    k = (cairn_real)exponent;
    return k * LN2_PARTS[0] +
           (m - (half_square - (f * (half_square + z * HORNER_SCHEME(LOGARITHM_COEFFICIENTS, z)) +
                                k * LN2_PARTS[1])));
}

cairn_real cairn_erfc(cairn_real x)
{
    cairn_real a = cairn_abs(x), tail;

    if (x != x)
        return x;
    if (a < CAIRN_REAL(0.75)) {
        cairn_real z = a * a;

        return 1 - x * HORNER_SCHEME(ERF_COEFFICIENTS, z);
    }
    if (a > ERFC_MAX) {
        tail = 0;
    } else {
        /* exp(-a^2) with the square split into an exact and a small part. */
        cairn_real h = cairn_rint(a * ERFC_SPLIT) / ERFC_SPLIT;
        cairn_real t = (a - 3) / (a + 3);

        tail = cairn_exp(-h * h) * (cairn_exp((h - a) * (h + a)) *
                                    (HORNER_SCHEME(ERFCX_COEFFICIENTS, t) / (a + CAIRN_REAL(0.5))));
        tail = normal_or_zero(tail);
    }
    return x < 0 ? 2 - tail : tail;
}

int32_t cairn_real_clamp_to_int(cairn_real x)
{
    if (x != x)
        return 0;
    if (x >= CAIRN_REAL(2147483648.0))
        return INT32_MAX;
    return x > CAIRN_REAL(-2147483648.0) ? (int32_t)x : INT32_MIN;
}

cairn_real cairn_wrap_angle(cairn_real x)
{
    if (x > -PI_HIGH && x <= PI_HIGH)
        return x;
    x = reduce_turns(x);
    if (x > PI_HIGH)
        x -= 2 * PI_HIGH;
    else if (x <= -PI_HIGH)
        x += 2 * PI_HIGH;
    return x;
}
