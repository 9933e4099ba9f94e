/* number_text: numbers from and to text, the same under every locale.
 *
 * Reading is exact: the double nearest to the decimal. Writing gives the shortest of 15 to 17
 * digits (float build: 6 to 9) that reads back as the same cairn_real. Stamps are decimal
 * seconds on paper and int64 nanoseconds in memory, and never pass through a floating-point
 * number. */
#ifndef CAIRN_NUMBER_TEXT_H
#define CAIRN_NUMBER_TEXT_H

#include <stddef.h>
#include <stdint.h>

#include "cairn/real.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Room for any number or stamp as this room writes it, with the closing 0. */
#define CAIRN_NUMBER_TEXT_BYTES 32

/* The longest token that is taken for a number. */
#define CAIRN_NUMBER_TEXT_LONGEST 1024

/* 1 and *value when all of text[0 .. length) is one decimal number:
 * [+-]digits[.digits][e[+-]digits], or nan, inf, infinity in any case and with a sign. 0
 * otherwise, and for a number above DBL_MAX: *value is untouched. */
int32_t cairn_number_read(const char *text, size_t length, double *value);

/* The same for a whole number without point and exponent that fits into int64_t. */
int32_t cairn_number_read_integer(const char *text, size_t length, int64_t *value);

/* 1 and *nanoseconds when all of text[0 .. length) is one finite decimal number of seconds that
 * fits; rounded half away from zero to the nanosecond, from at most 19 digits. */
int32_t cairn_number_read_stamp(const char *text, size_t length, int64_t *nanoseconds);

/* Writes the value, 0-terminated, and returns text. Not finite: nan, inf, -inf. */
char *cairn_number_write(char text[CAIRN_NUMBER_TEXT_BYTES], cairn_real value);

/* Writes seconds with as many decimals as they need, none to nine. */
char *cairn_number_write_stamp(char text[CAIRN_NUMBER_TEXT_BYTES], int64_t nanoseconds);

#ifdef __cplusplus
}
#endif

#endif
