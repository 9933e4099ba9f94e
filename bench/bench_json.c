#include "bench/bench_json.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "src/host/base/json_writer.h"

/* Significant digits of a figure. */
enum { DIGITS = 6 };

/* The line that is open. */
static cairn_json_writer line;

void bench_json_begin(const char *bench)
{
    line = cairn_json_write_begin(stdout);
    line.digits = DIGITS;
    bench_json_text("bench", bench);
}

void bench_json_text(const char *key, const char *value)
{
    cairn_json_write_text(&line, key, value);
}

void bench_json_integer(const char *key, int64_t value)
{
    cairn_json_write_integer(&line, key, value);
}

void bench_json_number(const char *key, double value)
{
    cairn_json_write_number(&line, key, value);
}

void bench_json_true(const char *key)
{
    cairn_json_write_boolean(&line, key, 1);
}

void bench_json_end(void)
{
    cairn_json_write_end(&line);
    (void)fflush(stdout);
}

static double seconds_of(clockid_t clock)
{
    struct timespec now;

    clock_gettime(clock, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

double bench_seconds(void)
{
    return seconds_of(CLOCK_MONOTONIC);
}

double bench_cpu_seconds(void)
{
    return seconds_of(CLOCK_PROCESS_CPUTIME_ID);
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

void bench_sort(double *values, size_t count)
{
    qsort(values, count, sizeof *values, compare);
}

double bench_median(double *values, size_t count)
{
    if (count == 0)
        return (double)NAN;
    bench_sort(values, count);
    return count % 2 ? values[count / 2] : (values[count / 2 - 1] + values[count / 2]) / 2;
}
