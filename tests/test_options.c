/* The command line parser of the tools: values, refusals, help. */
#include "tests/test.h"

#include <unistd.h>

/* The parser belongs to the tools, not to a library. */
#include "tools/options.c"

typedef struct values {
    int32_t flag, count, given;
    int64_t integer;
    uint64_t seed;
    double number, pair[2];
    const char *text;
} values;

static values parsed;
static char said[4000];
static const char *words[2];
static size_t word_count;

/* Parses words separated by blanks; captures standard output and standard error. */
static option_result parse(const char *line)
{
    option table[] = {
        OPTION_FLAG("--flag", &parsed.flag, "a flag"),
        OPTION_INTEGER("--integer", &parsed.integer, 1, 9e15, "N", "an integer"),
        OPTION_COUNT("-c", &parsed.count, 1, 64, "N", "a count"),
        OPTION_SEED("--seed", &parsed.seed, "a seed"),
        OPTION_NUMBER("--number", &parsed.number, -1, 2.5, "M", "a number"),
        OPTION_PAIR("--pair", parsed.pair, 0, 360, "M,DEG", "a pair"),
        OPTION_TEXT("-o", &parsed.text, "DIR", "a text"),
    };
    const option_set set = {"tool", "SCENE DIR", "What it does.", table,
                            sizeof table / sizeof *table};
    static char buffer[300];
    char *argv[40] = {(char *)"tool"};
    int argc = 1, saved[2];
    option_result result;
    FILE *file = tmpfile();
    size_t length;

    parsed = (values){0, 7, 0, 0, 1, 0.5, {0, 0}, NULL};
    table[4].given = &parsed.given;
    words[0] = words[1] = NULL;
    word_count = 2;
    snprintf(buffer, sizeof buffer, "%s", line);
    for (char *word = strtok(buffer, " "); word != NULL; word = strtok(NULL, " "))
        argv[argc++] = word;
    assert_non_null(file);
    for (int i = 0; i < 2; i++) {
        fflush(i ? stderr : stdout);
        saved[i] = dup(i + 1);
        dup2(fileno(file), i + 1);
    }
    result = options_read(&set, argc, argv, words, &word_count);
    for (int i = 0; i < 2; i++) {
        fflush(i ? stderr : stdout);
        dup2(saved[i], i + 1);
        close(saved[i]);
    }
    rewind(file);
    length = fread(said, 1, sizeof said - 1, file);
    said[length] = '\0';
    fclose(file);
    return result;
}

static void values_are_stored(void **state)
{
    (void)state;
    assert_int_equal(parse(""), OPTIONS_READ);
    assert_int_equal(word_count, 0);
    assert_int_equal(parsed.count, 7);
    assert_int_equal(parsed.given, 0);
    assert_int_equal(
        parse("one --flag -c 64 --seed 18446744073709551615 --number -1 --pair=0.30,20 two -o a=b"),
        OPTIONS_READ);
    assert_string_equal(said, "");
    assert_int_equal(word_count, 2);
    assert_string_equal(words[0], "one");
    assert_string_equal(words[1], "two");
    assert_int_equal(parsed.flag, 1);
    assert_int_equal(parsed.count, 64);
    assert_true(parsed.seed == UINT64_MAX);
    assert_near(parsed.number, -1, 0);
    assert_int_equal(parsed.given, 1);
    assert_near(parsed.pair[0], 0.3, 0);
    assert_near(parsed.pair[1], 20, 0);
    assert_string_equal(parsed.text, "a=b");
    assert_int_equal(parse("--pair 12x10 --integer=9000000000000000 --number=2.5 -c 1 --seed 0"),
                     OPTIONS_READ);
    assert_near(parsed.pair[0], 12, 0);
    assert_near(parsed.pair[1], 10, 0);
    assert_true(parsed.integer == INT64_C(9000000000000000));
    assert_near(parsed.number, 2.5, 0);
    assert_int_equal(parsed.count, 1);
    assert_true(parsed.seed == 0);
}

static void words_behind_two_dashes_are_words(void **state)
{
    (void)state;
    assert_int_equal(parse("-- --flag -o"), OPTIONS_READ);
    assert_int_equal(parsed.flag, 0);
    assert_int_equal(word_count, 2);
    assert_string_equal(words[0], "--flag");
    assert_string_equal(words[1], "-o");
    assert_int_equal(parse("- --flag"), OPTIONS_READ);
    assert_string_equal(words[0], "-");
}

static void help_lists_all_with_defaults(void **state)
{
    (void)state;
    assert_int_equal(parse("--help --nonsense"), OPTIONS_HELPED);
    assert_non_null(strstr(said, "usage: tool SCENE DIR\n\nWhat it does.\n"));
    assert_non_null(strstr(said, "  --flag                 a flag\n"));
    assert_non_null(strstr(said, "  --integer N            an integer\n"));
    assert_non_null(strstr(said, "  -c N                   a count [7]\n"));
    assert_non_null(strstr(said, "  --seed N               a seed [1]\n"));
    assert_non_null(strstr(said, "  --number M             a number [0.5]\n"));
    assert_non_null(strstr(said, "  --pair M,DEG           a pair\n"));
    assert_non_null(strstr(said, "  -o DIR                 a text\n"));
    assert_int_equal(parse("--integer 5 --pair 1,2 -h"), OPTIONS_HELPED);
    assert_non_null(strstr(said, "an integer [5]\n"));
    assert_non_null(strstr(said, "a pair [1,2]\n"));
}

static void table_holds_all_fields_of_all_options(void **state)
{
    (void)state;
    assert_int_equal(parse("--option-table"), OPTIONS_HELPED);
    assert_string_equal(said, "program\ttool\n"
                              "synopsis\tSCENE DIR\n"
                              "about\tWhat it does.\n"
                              "option\t--flag\t\t\ta flag\n"
                              "option\t--integer\tN\t\tan integer\n"
                              "option\t-c\tN\t7\ta count\n"
                              "option\t--seed\tN\t1\ta seed\n"
                              "option\t--number\tM\t0.5\ta number\n"
                              "option\t--pair\tM,DEG\t\ta pair\n"
                              "option\t-o\tDIR\t\ta text\n"
                              "option\t--help\t\t\tthis text\n"
                              "option\t--version\t\t\tthe version\n");
}

static void version_says_the_library_s(void **state)
{
    char expected[64];

    (void)state;
    snprintf(expected, sizeof expected, "cairn %s\n", cairn_version_text());
    assert_int_equal(parse("--flag --version --nonsense"), OPTIONS_HELPED);
    assert_string_equal(said, expected);
    assert_int_equal(parse("-- --version"), OPTIONS_READ);
    assert_string_equal(words[0], "--version");
}

static void expect(const char *line, const char *message)
{
    assert_int_equal(parse(line), OPTIONS_BAD);
    assert_string_equal(said, message);
}

static void faults_say_what_was_expected(void **state)
{
    (void)state;
    expect("--nonsense",
           "tool: unknown option '--nonsense', expected one of those that --help lists\n");
    expect("--fla", "tool: unknown option '--fla', expected one of those that --help lists\n");
    expect("--flag=1", "tool: value for '--flag=1', expected none: the option stands alone\n");
    expect("-c 0", "tool: -c is '0', expected a whole number from 1 to 64\n");
    expect("-c 65", "tool: -c is '65', expected a whole number from 1 to 64\n");
    expect("-c 3.5", "tool: -c is '3.5', expected a whole number from 1 to 64\n");
    expect("-c", "tool: nothing after '-c', expected a whole number from 1 to 64\n");
    expect("--integer 0", "tool: --integer is '0', expected a whole number from 1\n");
    expect("--number nan", "tool: --number is 'nan', expected a number from -1 to 2.5\n");
    expect("--number 2.6", "tool: --number is '2.6', expected a number from -1 to 2.5\n");
    expect("--number 1m", "tool: --number is '1m', expected a number from -1 to 2.5\n");
    expect("--pair 1", "tool: --pair is '1', expected two numbers A,B from 0 to 360\n");
    expect("--pair 1,", "tool: --pair is '1,', expected two numbers A,B from 0 to 360\n");
    expect("--pair ,1", "tool: --pair is ',1', expected two numbers A,B from 0 to 360\n");
    expect("--pair 1,361", "tool: --pair is '1,361', expected two numbers A,B from 0 to 360\n");
    expect("--pair 361,1", "tool: --pair is '361,1', expected two numbers A,B from 0 to 360\n");
    expect("--seed 18446744073709551616", "tool: --seed is '18446744073709551616', expected a "
                                          "whole number from 0 to 18446744073709551615\n");
    expect("--seed -1",
           "tool: --seed is '-1', expected a whole number from 0 to 18446744073709551615\n");
    expect("--seed=",
           "tool: --seed is '', expected a whole number from 0 to 18446744073709551615\n");
    expect("-o=", "tool: -o is '', expected a word\n");
    expect("one two three", "tool: one word too many, 'three', expected SCENE DIR\n");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(values_are_stored),
        cmocka_unit_test(words_behind_two_dashes_are_words),
        cmocka_unit_test(help_lists_all_with_defaults),
        cmocka_unit_test(table_holds_all_fields_of_all_options),
        cmocka_unit_test(version_says_the_library_s),
        cmocka_unit_test(faults_say_what_was_expected),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
