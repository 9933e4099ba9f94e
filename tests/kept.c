/* Compares values with those of a file, or writes the file (--renew). */
#include "tests/kept.h"

typedef struct kept_test {
    const char *file;
    kept_value value;
    kept_format format;
    int renews;
    char now[KEPT_TEXT];
} kept_test;

/* The value of a name in the file; NULL when it has no such line. */
static const char *find(const char *file, const char *name, char text[KEPT_TEXT])
{
    FILE *lines = fopen(file, "r");
    char word[KEPT_TEXT], line[2 * KEPT_TEXT];
    const char *found = NULL;

    while (lines != NULL && found == NULL && fgets(line, sizeof line, lines) != NULL)
        if (sscanf(line, "%63s %63s", word, text) == 2 && strcmp(word, name) == 0)
            found = text;
    if (lines != NULL)
        (void)fclose(lines);
    return found;
}

static void check(void **state)
{
    kept_test *test = *state;
    char kept[KEPT_TEXT];
    const char *text = find(test->file, test->value.name, kept);

    test->format(test->value.item, test->now);
    if (test->renews)
        return;
    if (text == NULL)
        fail_msg("%s has no line for %s (make golden writes it)", test->file, test->value.name);
    if (strcmp(text, test->now) != 0)
        fail_msg("%s is %s, and %s has %s. If what it computes, or its cost, was meant to change: "
                 "make golden, and commit "
                 "the files; else something has changed it.",
                 test->value.name, test->now, test->file, text);
}

static int write_all(const char *file, const kept_test *kept, int32_t count)
{
    FILE *lines = fopen(file, "w");

    for (int32_t i = 0; i < count && lines != NULL; i++)
        (void)fprintf(lines, "%s %s\n", kept[i].value.name, kept[i].now);
    if (lines != NULL && fclose(lines) == 0)
        return 0;
    perror(file);
    return 2;
}

int kept_main(int argc, char **argv, const char *file, const kept_value *values, int32_t count,
              kept_format format)
{
    kept_test *kept = calloc((size_t)count, sizeof *kept);
    struct CMUnitTest *tests = calloc((size_t)count, sizeof *tests);
    int renews = argc > 1 && strcmp(argv[1], "--renew") == 0;
    int failed;

    if (kept == NULL || tests == NULL)
        abort();
    for (int32_t i = 0; i < count; i++) {
        kept[i].file = file;
        kept[i].value = values[i];
        kept[i].format = format;
        kept[i].renews = renews;
        tests[i].name = values[i].name;
        tests[i].test_func = check;
        tests[i].initial_state = &kept[i];
    }
    failed = _cmocka_run_group_tests(file, tests, (size_t)count, NULL, NULL);
    if (renews && failed == 0)
        failed = write_all(file, kept, count);
    free(tests);
    free(kept);
    return failed;
}
