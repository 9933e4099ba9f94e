/* real: the number type and the few elementary functions that cairn computes itself.
 *
 * cairn_real is double, or float when CAIRN_FLOAT is defined (for the library and for all that
 * includes its headers; the pkg-config file of libcairn-float does so). sin, cos, atan2, exp, log
 * and erfc are cairn's own in both builds, because they are the functions in which math libraries
 * differ: built by any conforming compiler they give the same bits. The others are the correctly
 * rounded ones of libc math.
 *
 * Errors, in units in the last place against the exact value, as tests/test_real.c measures them
 * against libc math:
 *
 *              double   float   range
 *   sin, cos     3        2     |x| <= 1e5 (double), 1e3 (float); beyond it the argument is first
 *   reduced by fmod atan2        2        2     all exp          2        2     all log          2
 *   2     all positive erfc         5        5     all
 *
 * Results below the least normal number are 0 (exp below -708.39 and -87.33, erfc above 26.54
 * and 9.19): there arithmetic in software and math libraries differ. A NaN gives a NaN; sin and
 * cos of an infinity are NaN. */
#ifndef CAIRN_REAL_H
#define CAIRN_REAL_H

#include <float.h>
#include <math.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#ifdef CAIRN_FLOAT
typedef float cairn_real;
#define CAIRN_REAL(x)      x##f
#define CAIRN_REAL_EPSILON FLT_EPSILON
#define CAIRN_REAL_MAX     FLT_MAX
#define CAIRN_REAL_MIN     FLT_MIN /* the least normal number */
#else
typedef double cairn_real;
#define CAIRN_REAL(x)      x
#define CAIRN_REAL_EPSILON DBL_EPSILON
#define CAIRN_REAL_MAX     DBL_MAX
#define CAIRN_REAL_MIN     DBL_MIN
#endif

#define CAIRN_PI CAIRN_REAL(3.14159265358979323846)

cairn_real cairn_sin(cairn_real x);
cairn_real cairn_cos(cairn_real x);
void cairn_sincos(cairn_real x, cairn_real *sine, cairn_real *cosine);
cairn_real cairn_atan2(cairn_real y, cairn_real x);
cairn_real cairn_exp(cairn_real x);
cairn_real cairn_log(cairn_real x);
cairn_real cairn_erfc(cairn_real x);

/* Toward zero, clamped to the range of int32_t; NaN gives 0. The only way in cairn from a real
 * to an integer. */
static inline int32_t cairn_real_to_int(cairn_real x)
{
    if (!(x > CAIRN_REAL(-2147483648.0)))
        return x != x ? 0 : INT32_MIN;
    if (x >= CAIRN_REAL(2147483648.0))
        return INT32_MAX;
    return (int32_t)x;
}

/* Angle in (-pi, pi] that differs from x by whole turns. */
cairn_real cairn_wrap_angle(cairn_real x);

static inline cairn_real cairn_sqrt(cairn_real x)
{
#ifdef CAIRN_FLOAT
    return sqrtf(x);
#else
    return sqrt(x);
#endif
}

static inline cairn_real cairn_abs(cairn_real x)
{
#ifdef CAIRN_FLOAT
    return fabsf(x);
#else
    return fabs(x);
#endif
}

static inline cairn_real cairn_floor(cairn_real x)
{
#ifdef CAIRN_FLOAT
    return floorf(x);
#else
    return floor(x);
#endif
}

static inline cairn_real cairn_ceil(cairn_real x)
{
#ifdef CAIRN_FLOAT
    return ceilf(x);
#else
    return ceil(x);
#endif
}

/* To the nearest integer, halves to even. */
static inline cairn_real cairn_rint(cairn_real x)
{
#ifdef CAIRN_FLOAT
    return rintf(x);
#else
    return rint(x);
#endif
}

/* Half the square of x: the exponent of a normal density, without its sign. */
static inline cairn_real cairn_half_square(cairn_real x)
{
    return CAIRN_REAL(0.5) * x * x;
}

static inline cairn_real cairn_min(cairn_real a, cairn_real b)
{
    return a < b ? a : b;
}

static inline cairn_real cairn_max(cairn_real a, cairn_real b)
{
    return a > b ? a : b;
}

/* True for all but NaN and the infinities. */
static inline int cairn_is_finite(cairn_real x)
{
    return cairn_abs(x) <= CAIRN_REAL_MAX;
}

#ifdef __cplusplus
}
#endif

#endif
