/* options: a command line by table: what there is, its unit, its range, where it goes; and the help text from it.
 *
 *     int32_t beams = 401;
 *     double noise = 0.01;
 *     const option table[] = {
 *         {"beams", 0, OPTION_INTEGER, "N", "beams of a scan", &beams, 2, 100000},
 *         {"noise", 0, OPTION_NUMBER, "M", "standard deviation of a range", &noise, 0, 1},
 *     };
 *
 * --beams 181, --beams=181; after -- all is positional. Every fault is one line on standard error: the program's name, what
 * is wrong, what was expected. */
#ifndef CAIRN_TOOLS_CAIRN_ARENA_OPTIONS_H
#define CAIRN_TOOLS_CAIRN_ARENA_OPTIONS_H

#include <stdint.h>
#include <stdio.h>

typedef enum option_kind {
    OPTION_FLAG,    /* int32_t: becomes 1; takes no value */
    OPTION_INTEGER, /* int32_t */
    OPTION_SEED,    /* uint64_t, any */
    OPTION_NUMBER,  /* double */
    OPTION_PAIR,    /* double[2], "0.30,20"; the range holds for both */
    OPTION_SIZE,    /* double[2], "12x10" */
    OPTION_TEXT     /* const char * */
} option_kind;

typedef struct option {
    const char *name; /* without the dashes */
    char letter;      /* short form, 0: none */
    option_kind kind;
    const char *unit; /* what the help shows for the value: "M", "DEG", "WxH" */
    const char *help; /* one line; the unit in words where the letters do not say it */
    void *target;     /* holds the default until the option is given */
    double low, high; /* of numbers; low > high: any finite number */
} option;

/* Reads argv[1] ... and sets targets. positional: [most]; returns how many there were, or -1 after the line on standard
 * error. Targets may then be set in part. `wanted` says in that line what positionals mean ("a scene"). */
int32_t options_parse(const char *program, const option *table, int32_t count, int argc, char **argv,
                      const char **positional, int32_t most, const char *wanted);

/* One line per option with its unit, text and default. Call it before options_parse changes the targets. */
void options_help(FILE *file, const option *table, int32_t count);

/* "program: format...\n" on standard error; returns 2, the exit status of a refused command line. */
#if defined(__GNUC__)
__attribute__((format(printf, 2, 3)))
#endif
int
options_fault(const char *program, const char *format, ...);

#endif
