/* number_text: conversion of numbers from and to text, independent of the locale.
 *
 * Reading is correctly rounded: the result is the double nearest to the decimal. Writing gives the
 * shortest of 15 to 17 digits (float build: 6 to 9) that reads back as the same cairn_real (round
 * trip). Time stamps are decimal seconds in text and int64 nanoseconds in memory. They never pass
 * through a floating-point number. */
#ifndef CAIRN_NUMBER_TEXT_H
#define CAIRN_NUMBER_TEXT_H

#include <stddef.h>
#include <stdint.h>

#include "cairn/real.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Bytes for any number or stamp that this module writes, with the terminating 0. */
#define CAIRN_NUMBER_TEXT_BYTES 32

/* The maximum length of a decimal number, in bytes. A longer token is not a number. */
#define CAIRN_NUMBER_MAX_LENGTH 1024

/* Parses all of text[0 .. length) as one decimal number: [+-]digits[.digits][e[+-]digits], or nan,
 * inf, infinity in any case and with a sign. Returns 1 and sets *value. Returns 0 and leaves *value
 * untouched for any other text and for a magnitude above DBL_MAX.
 *
 * text: [length] characters
 * value: set when 1 is returned */
int32_t cairn_number_read(const char *text, size_t length, double *value);

/* The same for an integer in the range of int64_t, without point and exponent.
 *
 * text, length: the characters
 * value: set when 1 is returned */
int32_t cairn_number_read_integer(const char *text, size_t length, int64_t *value);

/* Parses all of text[0 .. length) as a finite decimal number of seconds. Returns 1 and sets
 * *nanoseconds, rounded half away from zero, from the first 19 digits. Returns 0 for other text and
 * on overflow.
 *
 * text: [length] characters
 * nanoseconds: set when 1 is returned */
int32_t cairn_number_read_stamp(const char *text, size_t length, int64_t *nanoseconds);

/* Writes the value, 0-terminated, and returns text. Values that are not finite: nan, inf, -inf. */
char *cairn_number_write(char text[CAIRN_NUMBER_TEXT_BYTES], cairn_real value);

/* Writes a stamp in seconds with zero to nine decimals, as many as necessary, and returns text.
 *
 * text: written, 0-terminated
 * nanoseconds: stamp, ns */
char *cairn_number_write_stamp(char text[CAIRN_NUMBER_TEXT_BYTES], int64_t nanoseconds);

#ifdef __cplusplus
}
#endif

#endif
