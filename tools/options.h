/* Command line parser. One table describes the options and generates the help text.
 *
 * static const option table[] = { OPTION_INTEGER("--places", &places, 1, 1000, "N", "scan
 * positions"), OPTION_NUMBER("--range", &range, 0.1, 100, "M", "scanner range in m"),
 * OPTION_TEXT("-o", &folder, "DIR", "folder to write to"), OPTION_FLAG("--quiet", &quiet, "no
 * progress, no summary"), };
 *
 * An option takes its value from the next word or after "=". "--" ends the options. Numbers are
 * read without the locale; a value that is no number or out of range is rejected with a line that
 * names the expected value. */
#ifndef CAIRN_TOOLS_OPTIONS_H
#define CAIRN_TOOLS_OPTIONS_H

#include <stddef.h>
#include <stdint.h>

#include "cairn/file_error.h"

typedef enum option_kind {
    OPTION_IS_FLAG,    /* int32_t: set to 1 */
    OPTION_IS_INTEGER, /* int64_t */
    OPTION_IS_COUNT,   /* int32_t */
    OPTION_IS_SEED,    /* uint64_t, any */
    OPTION_IS_NUMBER,  /* double */
    OPTION_IS_PAIR,    /* double[2], "A,B" or "AxB" */
    OPTION_IS_TEXT     /* const char * */
} option_kind;

typedef struct option {
    const char *name;
    option_kind kind;
    void *value;
    double least, most;      /* range of a number; of both numbers of a pair */
    const char *placeholder; /* in the help: "N", "M,DEG" */
    const char *help;        /* with the unit; a default other than 0 or NaN is added in brackets */
    int32_t *given;          /* set to 1 when the option was given; may be NULL */
} option;

#define OPTION_FLAG(name, value, help)                                                             \
    {                                                                                              \
        name, OPTION_IS_FLAG, value, 0, 0, "", help, NULL                                          \
    }
#define OPTION_INTEGER(name, value, least, most, placeholder, help)                                \
    {                                                                                              \
        name, OPTION_IS_INTEGER, value, least, most, placeholder, help, NULL                       \
    }
#define OPTION_COUNT(name, value, least, most, placeholder, help)                                  \
    {                                                                                              \
        name, OPTION_IS_COUNT, value, least, most, placeholder, help, NULL                         \
    }
#define OPTION_SEED(name, value, help)                                                             \
    {                                                                                              \
        name, OPTION_IS_SEED, value, 0, 0, "N", help, NULL                                         \
    }
#define OPTION_NUMBER(name, value, least, most, placeholder, help)                                 \
    {                                                                                              \
        name, OPTION_IS_NUMBER, value, least, most, placeholder, help, NULL                        \
    }
#define OPTION_PAIR(name, value, least, most, placeholder, help)                                   \
    {                                                                                              \
        name, OPTION_IS_PAIR, value, least, most, placeholder, help, NULL                          \
    }
#define OPTION_TEXT(name, value, placeholder, help)                                                \
    {                                                                                              \
        name, OPTION_IS_TEXT, value, 0, 0, placeholder, help, NULL                                 \
    }

/* The option of all programs that print a result; value: int32_t. */
#define OPTION_JSON(value) OPTION_FLAG("--json", value, "prints the result as one JSON object")

/* Description of a program for its help text and its error messages. */
typedef struct option_set {
    const char *program;  /* "cairn map" */
    const char *synopsis; /* "LOG -o DIR [options]" */
    /* description, several lines; its first words, up to ':' or '.', are the summary of the manual
     * page. A line "  word   text" is an item of a list: a word that the program takes. */
    const char *about;
    const option *table; /* [count] */
    size_t count;
} option_set;

/* Other than OPTIONS_READ: the exit code. */
typedef enum option_result {
    OPTIONS_READ = -1,  /* the caller continues */
    OPTIONS_HELPED = 0, /* what --help or the like prints is on standard output */
    OPTIONS_BAD = 2     /* one line was printed on standard error */
} option_result;

/* Prints the options, a line each, on standard output. */
void options_help(const option_set *set);

/* The option by which every program prints its table, for tools/option-tables.sh. */
#define OPTIONS_TABLE "--option-table"

/* Prints the description of the program on standard output, in rows of fields between tabs:
 *
 * program NAME, synopsis TEXT, about LINE (each line), option NAME PLACEHOLDER DEFAULT HELP (each) */
void options_table(const option_set *set);

/* Prints what --version prints. */
void options_version(void);

/* Flushes standard output. Returns the exit code: 1 in place of 0 when a write failed, such as on a
 * full disk, after a line on standard error. */
int options_end(const char *program, int code);

/* "program: ..." on standard error; returns 2, the exit code of a refused command line. */
int options_refuse(const char *program, const char *format, ...) CAIRN_FILE_ERROR_FORMAT(2, 3);

/* Reads argv[1 ... argc-1]. Words that are no options are collected, in order, in words[0 ...
 * *word_count-1]; *word_count is their capacity before; one more is refused. */
option_result options_read(const option_set *set, int argc, char **argv, const char **words,
                           size_t *word_count);

#endif
