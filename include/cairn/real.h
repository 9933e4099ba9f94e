/* real: the floating-point type, and elementary functions that give the same bits everywhere.
 *
 * cairn_real is double, or float when CAIRN_FLOAT is defined (for the library and for every file
 * that includes its headers; the pkg-config file of libcairn-float defines CAIRN_FLOAT).
 *
 * sin, cos, atan2, exp, log and erfc are computed by cairn itself in both builds, because math
 * libraries differ in these functions. Any conforming compiler gives the same bits. All other
 * functions are the correctly rounded ones of libc math.
 *
 * Largest errors in units in the last place (ulp), measured by tests/test_real.c against libc
 * math:
 *
 *              double   float   range
 *   sin, cos     3        2     |x| <= 1e5 (double), 1e3 (float); larger arguments are first
 *                               reduced by 2 pi
 *   atan2        2        2     all
 *   exp          2        2     all
 *   log          2        2     all positive
 *   erfc         5        5     all
 *
 * Limits: results below the least normal number are 0 (exp below -708.39 and -87.33, erfc above
 * 26.54 and 9.19), because software arithmetic and math libraries differ there. A NaN gives a
 * NaN; sin and cos of an infinity are NaN. */
#ifndef CAIRN_REAL_H
#define CAIRN_REAL_H

#include <float.h>
#include <math.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The floating-point type of all lengths, angles and weights: double, or float with CAIRN_FLOAT. */
#ifdef CAIRN_FLOAT
typedef float cairn_real;
#define CAIRN_REAL(x)      x##f
#define CAIRN_REAL_EPSILON FLT_EPSILON
#define CAIRN_REAL_MAX     FLT_MAX
#define CAIRN_REAL_MIN     FLT_MIN
#else
typedef double cairn_real;
/* The literal x as a cairn_real. */
#define CAIRN_REAL(x)      x
/* Relative rounding: the distance from 1 to the next number. */
#define CAIRN_REAL_EPSILON DBL_EPSILON
/* The greatest finite number. */
#define CAIRN_REAL_MAX     DBL_MAX
/* The least normal number. */
#define CAIRN_REAL_MIN     DBL_MIN
#endif

/* The number pi. */
#define CAIRN_PI CAIRN_REAL(3.14159265358979323846)

/* Sine of x, in rad. */
cairn_real cairn_sin(cairn_real x);

/* Cosine of x, in rad. */
cairn_real cairn_cos(cairn_real x);

/* Sine and cosine of x, in rad, for the cost of one of them.
 *
 * x: angle, rad
 * sine: set to sin x
 * cosine: set to cos x */
void cairn_sincos(cairn_real x, cairn_real *sine, cairn_real *cosine);

/* Angle of the vector (x, y) in [-pi, pi] rad, signed zeros as in C; 0 or pi for a zero vector.
 *
 * y, x: components of the vector */
cairn_real cairn_atan2(cairn_real y, cairn_real x);

/* Exponential function; infinity on overflow.
 *
 * x: any number */
cairn_real cairn_exp(cairn_real x);

/* Natural logarithm; -infinity for 0, NaN for x < 0.
 *
 * x: number >= 0 */
cairn_real cairn_log(cairn_real x);

/* Complementary error function 1 - erf(x). */
cairn_real cairn_erfc(cairn_real x);

/* x wrapped to (-pi, pi] rad: the angle that differs from x by whole turns.
 *
 * x: any angle, rad */
cairn_real cairn_wrap_angle(cairn_real x);

/* Square root, correctly rounded.
 *
 * x: number >= 0; NaN for x < 0 */
static inline cairn_real cairn_sqrt(cairn_real x)
{
#ifdef CAIRN_FLOAT
    return sqrtf(x);
#else
    return sqrt(x);
#endif
}

/* Absolute value.
 *
 * x: any number */
inline cairn_real cairn_abs(cairn_real x)
{
#ifdef CAIRN_FLOAT
    return fabsf(x);
#else
    return fabs(x);
#endif
}

/* The same as cairn_real_to_int(), which calls it for what exceeds the range of int32_t.
 *
 * x: any number, also NaN */
int32_t cairn_real_clamp_to_int(cairn_real x);

/* x truncated toward zero and clamped to the range of int32_t; NaN gives 0. Every conversion from
 * cairn_real to an integer in cairn uses this function, but for those of the innermost loops whose
 * argument is in range by construction.
 *
 * x: any number, also NaN */
inline int32_t cairn_real_to_int(cairn_real x)
{
    return cairn_abs(x) < CAIRN_REAL(2147483648.0) ? (int32_t)x : cairn_real_clamp_to_int(x);
}

/* Largest integer <= x. */
static inline cairn_real cairn_floor(cairn_real x)
{
#ifdef CAIRN_FLOAT
    return floorf(x);
#else
    return floor(x);
#endif
}

/* Smallest integer >= x. */
static inline cairn_real cairn_ceil(cairn_real x)
{
#ifdef CAIRN_FLOAT
    return ceilf(x);
#else
    return ceil(x);
#endif
}

/* Nearest integer, halves to even.
 *
 * x: any number */
static inline cairn_real cairn_rint(cairn_real x)
{
#ifdef CAIRN_FLOAT
    return rintf(x);
#else
    return rint(x);
#endif
}

/* x^2 / 2: the negative log-likelihood of a standard normal residual x, up to a constant.
 *
 * x: residual in standard deviations */
static inline cairn_real cairn_half_square(cairn_real x)
{
    return CAIRN_REAL(0.5) * x * x;
}

/* The smaller one of two numbers; b when one of them is NaN.
 *
 * a, b: the numbers */
static inline cairn_real cairn_min(cairn_real a, cairn_real b)
{
    return a < b ? a : b;
}

/* The larger one of two numbers; b when one of them is NaN.
 *
 * a, b: the numbers */
static inline cairn_real cairn_max(cairn_real a, cairn_real b)
{
    return a > b ? a : b;
}

/* 1 when x is neither NaN nor infinite. */
inline int cairn_is_finite(cairn_real x)
{
    return cairn_abs(x) <= CAIRN_REAL_MAX;
}

#ifdef __cplusplus
}
#endif

#endif
