/* Numbers from and to text.
 *
 * Method
 * 1. A decimal of at most 19 digits is an integer m times 10^e.
 * 2. Fast path: if m <= 2^53 and |e| <= 22, both m and 10^|e| are exact doubles, so one
 *    multiplication or division is correctly rounded.
 * 3. All other decimals, which are rare, go to strtod under the "C" locale.
 *
 * Source: Clinger, How to read floating point numbers accurately, PLDI 1990. */
#include "src/base/build.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/number_text.h"
#include "src/host/base/c_locale.h"

/* A parsed decimal: (-1)^negative * mantissa * 10^exponent. truncated: digits other than 0 were
 * dropped behind the mantissa. */
typedef struct decimal {
    uint64_t mantissa;
    int32_t exponent;
    int32_t negative;
    int32_t truncated;
} decimal;

/* Decimal digits that fit into 64 bits. */
#define MANTISSA_DIGITS 19
/* Bound of the written exponent, in decimal digits of magnitude. It is far outside the exponents of
 * any double or stamp, even with a thousand digits. */
#define EXPONENT_BOUND 100000

static const double power_of_ten[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                      1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                      1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};

static int is_digit(char c)
{
    return c >= '0' && c <= '9';
}

static char lower(char c)
{
    return (char)(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
}

static int equals_ignoring_case(const char *text, size_t length, const char *word)
{
    size_t i;

    if (length != strlen(word))
        return 0;
    for (i = 0; i < length; i++)
        if (lower(text[i]) != word[i])
            return 0;
    return 1;
}

/* Appends one digit to the mantissa. Leading zeros do not count as digits. */
static void add_digit(decimal *number, int32_t *digits, char c, int32_t after_point)
{
    if (*digits < MANTISSA_DIGITS) {
        number->mantissa = number->mantissa * 10 + (uint64_t)(c - '0');
        *digits += number->mantissa != 0;
        number->exponent -= after_point;
    } else {
        number->truncated |= c != '0';
        number->exponent += !after_point;
    }
}

/* Parses a decimal with optional fraction and exponent; 1 when the whole text is one. */
static int32_t read_decimal(const char *text, size_t length, decimal *number)
{
    int32_t digits = 0, has_digits = 0, exponent = 0, negative_exponent;
    size_t i = 0;

    memset(number, 0, sizeof *number);
    if (length > CAIRN_NUMBER_MAX_LENGTH)
        return 0;
    if (i < length && (text[i] == '+' || text[i] == '-'))
        number->negative = text[i++] == '-';
    for (; i < length && is_digit(text[i]); i++, has_digits = 1)
        add_digit(number, &digits, text[i], 0);
    if (i < length && text[i] == '.')
        for (i++; i < length && is_digit(text[i]); i++, has_digits = 1)
            add_digit(number, &digits, text[i], 1);
    if (!has_digits)
        return 0;
    if (i < length && lower(text[i]) == 'e') {
        i++;
        negative_exponent = i < length && text[i] == '-';
        if (i < length && (text[i] == '+' || text[i] == '-'))
            i++;
        if (i == length)
            return 0;
        for (; i < length && is_digit(text[i]); i++)
            if (exponent < EXPONENT_BOUND)
                exponent = exponent * 10 + (text[i] - '0');
        number->exponent += negative_exponent ? -exponent : exponent;
    }
    return i == length;
}

/* The slow path: strtod of a text that read_decimal has accepted. */
static int32_t read_by_strtod(const char *text, size_t length, double *value)
{
    char copy[CAIRN_NUMBER_MAX_LENGTH + 1] = "";
    cairn_c_locale scope;
    double read;

    memcpy(copy, text, length);
    scope = cairn_c_locale_enter();
    read = strtod(copy, NULL);
    cairn_c_locale_leave(scope);
    if (fabs(read) > DBL_MAX)
        return 0;
    *value = read;
    return 1;
}

int32_t cairn_number_read(const char *text, size_t length, double *value)
{
    decimal number;
    double read;
    size_t sign;

    if (!read_decimal(text, length, &number)) {
        sign = length > 0 && (text[0] == '+' || text[0] == '-');
        if (equals_ignoring_case(text + sign, length - sign, "nan"))
            *value = (double)NAN;
        else if (equals_ignoring_case(text + sign, length - sign, "inf") ||
                 equals_ignoring_case(text + sign, length - sign, "infinity"))
            *value = text[0] == '-' ? -(double)INFINITY : (double)INFINITY;
        else
            return 0;
        return 1;
    }
    if (number.truncated || number.mantissa > (UINT64_C(1) << 53) || number.exponent < -22 ||
        number.exponent > 22)
        return read_by_strtod(text, length, value);
    read = (double)number.mantissa;
    read = number.exponent < 0 ? read / power_of_ten[-number.exponent]
                               : read * power_of_ten[number.exponent];
    *value = number.negative ? -read : read;
    return 1;
}

int32_t cairn_number_read_integer(const char *text, size_t length, int64_t *value)
{
    uint64_t bound = (uint64_t)INT64_MAX, sum = 0, digit;
    size_t i = 0;
    int32_t negative = 0;

    if (length > 0 && (text[0] == '+' || text[0] == '-')) {
        negative = text[0] == '-';
        bound += (uint64_t)negative;
        i = 1;
    }
    if (i == length)
        return 0;
    for (; i < length; i++) {
        if (!is_digit(text[i]))
            return 0;
        digit = (uint64_t)(text[i] - '0');
        if (sum > (bound - digit) / 10)
            return 0;
        sum = sum * 10 + digit;
    }
    if (negative && sum == bound)
        *value = INT64_MIN;
    else
        *value = negative ? -(int64_t)sum : (int64_t)sum;
    return 1;
}

int32_t cairn_number_read_stamp(const char *text, size_t length, int64_t *nanoseconds)
{
    decimal number;
    uint64_t rest;
    int32_t shift;

    if (!read_decimal(text, length, &number))
        return 0;
    for (shift = number.exponent + 9; shift > 0 && number.mantissa != 0; shift--) {
        if (number.mantissa > (uint64_t)INT64_MAX / 10)
            return 0;
        number.mantissa *= 10;
    }
    /* Only the digit behind the last kept one decides the rounding. The digits behind it cannot
     * turn a 4 into a 5. */
    for (rest = 0; shift < 0 && (number.mantissa | rest) != 0; shift++) {
        rest = number.mantissa % 10;
        number.mantissa /= 10;
    }
    number.mantissa += rest >= 5;
    if (number.mantissa > (uint64_t)INT64_MAX)
        return 0;
    *nanoseconds = number.negative ? -(int64_t)number.mantissa : (int64_t)number.mantissa;
    return 1;
}

char *cairn_number_write(char text[CAIRN_NUMBER_TEXT_BYTES], cairn_real value)
{
    char digits_text[CAIRN_NUMBER_TEXT_BYTES];
    cairn_c_locale scope;
    double parsed;

    if (!cairn_is_finite(value)) {
        (void)snprintf(text, CAIRN_NUMBER_TEXT_BYTES, "%s",
                       value > 0   ? "inf"
                       : value < 0 ? "-inf"
                                   : "nan");
        return text;
    }
    scope = cairn_c_locale_enter();
    /* 17 significant digits (float: 9) identify any number. */
    for (int digits = sizeof value > sizeof(float) ? 15 : 6; digits <= 17; digits++) {
        (void)snprintf(digits_text, sizeof digits_text, "%.*g", digits, (double)value);
        if (cairn_number_read(digits_text, strlen(digits_text), &parsed) &&
            (cairn_real)parsed == value)
            break;
    }
    cairn_c_locale_leave(scope);
    memcpy(text, digits_text, strlen(digits_text) + 1);
    return text;
}

char *cairn_number_write_stamp(char text[CAIRN_NUMBER_TEXT_BYTES], int64_t nanoseconds)
{
    uint64_t size = nanoseconds < 0 ? (uint64_t)0 - (uint64_t)nanoseconds : (uint64_t)nanoseconds;
    size_t length;

    (void)snprintf(text, CAIRN_NUMBER_TEXT_BYTES, "%s%" PRIu64 ".%09" PRIu64,
                   nanoseconds < 0 ? "-" : "", size / 1000000000, size % 1000000000);
    length = strlen(text);
    while (text[length - 1] == '0')
        length--;
    if (text[length - 1] == '.')
        length--;
    text[length] = 0;
    return text;
}
