/* One JSON object a line on standard output, numbers without the locale. */
#ifndef CAIRN_BENCH_JSON_H
#define CAIRN_BENCH_JSON_H

#include <stddef.h>
#include <stdint.h>

/* Begins an object whose first key is "bench". */
void bench_json_begin(const char *bench);
void bench_json_text(const char *key, const char *value);
void bench_json_integer(const char *key, int64_t value);
/* A value that is not finite is written as null. */
void bench_json_number(const char *key, double value);
void bench_json_true(const char *key);
void bench_json_end(void);

/* Monotonic clock in s, and the processor time of this program. */
double bench_seconds(void);
double bench_cpu_seconds(void);

/* Sorts values[count] in ascending order. */
void bench_sort(double *values, size_t count);

/* Median of values[count], which are reordered; NaN for none. */
double bench_median(double *values, size_t count);

#endif
