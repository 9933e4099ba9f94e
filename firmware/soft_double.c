/* Addition and subtraction of doubles for Cortex-M without a double FPU, correctly rounded.
 *
 * The functions of libgcc 12 misround some differences whose exponents lie 32 or more apart (1 -
 * 0x1.a1eb82fb9e934p-33 comes out one unit low), so that programs in double would differ from other
 * machines in their bits. The linker replaces them by these (--wrap). Programs in float do not need
 * them.
 *
 * Method: both numbers as integers with 3 more bits below, the last of which is sticky; the sum is
 * normalised and rounded half to even. */
#include <stdint.h>
#include <string.h>

/* The helpers of the compiler take their arguments in core registers whatever the program's
 * convention is. */
#define HELPER __attribute__((pcs("aapcs")))

HELPER double __wrap___aeabi_dadd(double a, double b);
HELPER double __wrap___aeabi_dsub(double a, double b);
HELPER double __wrap___aeabi_drsub(double a, double b);

#define SIGN       UINT64_C(0x8000000000000000)
#define INFINITE   UINT64_C(0x7FF0000000000000)
#define HIDDEN_BIT UINT64_C(0x0010000000000000)
#define QUIET      UINT64_C(0x0008000000000000)

static uint64_t bits_of(double x)
{
    uint64_t bits;

    memcpy(&bits, &x, sizeof bits);
    return bits;
}

static double number(uint64_t bits)
{
    double x;

    memcpy(&x, &bits, sizeof x);
    return x;
}

/* Splits the magnitude of a double into mantissa * 2^(exponent - 1075); subnormal numbers have the
 * least exponent, 1. */
static uint64_t mantissa_of(uint64_t magnitude, int32_t *exponent)
{
    *exponent = (int32_t)(magnitude >> 52);
    if (*exponent > 0)
        return (magnitude & (HIDDEN_BIT - 1)) | HIDDEN_BIT;
    *exponent = 1;
    return magnitude;
}

/* mantissa * 2^(exponent - 1078), rounded; the lowest bit of the mantissa is sticky. */
static uint64_t round_to_even(uint64_t mantissa, int32_t exponent)
{
    uint64_t low;

    if (mantissa == 0)
        return 0;
    if (mantissa >= HIDDEN_BIT << 4) {
        mantissa = (mantissa >> 1) | (mantissa & 1);
        exponent++;
    }
    while (mantissa < HIDDEN_BIT << 3 && exponent > 1) {
        mantissa <<= 1;
        exponent--;
    }
    low = mantissa & 7;
    mantissa >>= 3;
    if (low > 4 || (low == 4 && (mantissa & 1)))
        mantissa++;
    /* A carry out of the mantissa, also of a subnormal one, increments the exponent. */
    mantissa += mantissa >= HIDDEN_BIT ? (uint64_t)(exponent - 1) << 52 : 0;
    return mantissa >= INFINITE ? INFINITE : mantissa;
}

static double sum(uint64_t a, uint64_t b)
{
    uint64_t large = a & ~SIGN, small = b & ~SIGN, sign = a & SIGN, x, y, result;
    int32_t large_exponent, small_exponent, shift;

    if (large < small) {
        uint64_t swap = large;

        large = small;
        small = swap;
        sign = b & SIGN;
    }
    if (large > INFINITE)
        return number(large | QUIET);
    if (large == INFINITE)
        return number(small == INFINITE && ((a ^ b) & SIGN) ? INFINITE | QUIET : sign | INFINITE);
    x = mantissa_of(large, &large_exponent) << 3;
    y = mantissa_of(small, &small_exponent) << 3;
    shift = large_exponent - small_exponent;
    if (shift > 57)
        y = y != 0;
    else if (shift > 0)
        y = (y >> shift) | ((y & ((UINT64_C(1) << shift) - 1)) != 0);
    result = round_to_even((a ^ b) & SIGN ? x - y : x + y, large_exponent);
    if (result == 0)
        sign = a & b & SIGN; /* -0 only as the sum of two */
    return number(sign | result);
}

HELPER double __wrap___aeabi_dadd(double a, double b)
{
    return sum(bits_of(a), bits_of(b));
}

HELPER double __wrap___aeabi_dsub(double a, double b)
{
    return sum(bits_of(a), bits_of(b) ^ SIGN);
}

HELPER double __wrap___aeabi_drsub(double a, double b)
{
    return sum(bits_of(b), bits_of(a) ^ SIGN);
}
