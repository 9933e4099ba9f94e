/* Values that change only on purpose: a file holds a line "name
 * value" for each, a test program has a test for each line, and the same program with --renew
 * writes the file. `make golden` does so for all. */
#ifndef CAIRN_TESTS_KEPT_H
#define CAIRN_TESTS_KEPT_H

#include "tests/test.h"

enum { KEPT_TEXT = 64 };

typedef struct kept_value {
    const char *name; /* of the test; letters, digits and _ */
    const void *item; /* passed to format() */
} kept_value;

typedef void (*kept_format)(const void *item, char text[KEPT_TEXT]);

/* tests/<name>-double.txt, or -float.txt. */
#define KEPT_FILE(name) NUMBER("tests/" name "-double.txt", "tests/" name "-float.txt")

/* For main(). */
int kept_main(int argc, char **argv, const char *file, const kept_value *values, int32_t count,
              kept_format format);

#endif
