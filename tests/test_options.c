#include "tests/test.h"

#include <math.h>
#include <unistd.h>

/* The parser belongs to the tools, not to a library. */
#include "tools/options.c"

typedef struct values {
    int32_t flag, count, free_count;
    uint64_t seed;
    double number, free_number, pair[2], size[2];
    const char *text;
} values;

enum { OPTIONS = 9 };

static values parsed;
static char said[500];
static const char *words[2];

static const option table[OPTIONS] = {
    {"flag", 'f', OPTION_FLAG, "", "a flag", &parsed.flag, 0, 0},
    {"count", 'c', OPTION_INTEGER, "N", "a count", &parsed.count, 1, 64},
    {"free-count", 0, OPTION_INTEGER, "N", "any count", &parsed.free_count, 1, 0},
    {"seed", 0, OPTION_SEED, "N", "a seed", &parsed.seed, 0, 0},
    {"number", 'n', OPTION_NUMBER, "M", "a number", &parsed.number, -1, 2.5},
    {"free-number", 0, OPTION_NUMBER, "M", "any number", &parsed.free_number, 1, 0},
    {"pair", 0, OPTION_PAIR, "M,DEG", "a pair", parsed.pair, 0, 360},
    {"size", 0, OPTION_SIZE, "WxH", "a size", parsed.size, 1, 60},
    {"text", 'o', OPTION_TEXT, "DIR", "a text", &parsed.text, 0, 0},
};

/* Parses words parted by blanks; keeps what is said on standard error. */
static int32_t parse(const char *line)
{
    static char buffer[300];
    char *argv[40] = {(char *)"tool"};
    int argc = 1, saved, result;
    FILE *file = tmpfile();
    size_t length;

    parsed = (values){0, 7, 0, 1, 0.5, 0, {1, 2}, {3, 4}, NULL};
    words[0] = words[1] = NULL;
    snprintf(buffer, sizeof buffer, "%s", line);
    for (char *word = strtok(buffer, " "); word != NULL; word = strtok(NULL, " "))
        argv[argc++] = word;
    assert_non_null(file);
    fflush(stderr);
    saved = dup(2);
    dup2(fileno(file), 2);
    result = options_parse("tool", table, OPTIONS, argc, argv, words, 2, "a scene and a folder");
    fflush(stderr);
    dup2(saved, 2);
    close(saved);
    rewind(file);
    length = fread(said, 1, sizeof said - 1, file);
    said[length] = '\0';
    fclose(file);
    return result;
}

static void test_values(void **state)
{
    (void)state;
    assert_int_equal(parse(""), 0);
    assert_int_equal(parsed.count, 7);
    assert_int_equal(parse("one -f --count 64 --seed 18446744073709551615 -n -1 --pair 0.30,20 --size=12x10 two"), 2);
    assert_string_equal(said, "");
    assert_string_equal(words[0], "one");
    assert_string_equal(words[1], "two");
    assert_int_equal(parsed.flag, 1);
    assert_int_equal(parsed.count, 64);
    assert_true(parsed.seed == UINT64_MAX);
    assert_near(parsed.number, -1, 0);
    assert_near(parsed.pair[0], 0.3, 0);
    assert_near(parsed.pair[1], 20, 0);
    assert_near(parsed.size[0], 12, 0);
    assert_near(parsed.size[1], 10, 0);
    assert_int_equal(parse("--number=2.5 -o a=b --free-count -2147483648 --free-number -1e300 --count 1"), 0);
    assert_near(parsed.number, 2.5, 0);
    assert_string_equal(parsed.text, "a=b");
    assert_int_equal(parsed.free_count, INT32_MIN);
    assert_near(parsed.free_number, -1e300, 0);
    assert_int_equal(parse("--count 2 --count 3 -- -f --pair"), 2);
    assert_int_equal(parsed.count, 3);
    assert_string_equal(words[0], "-f");
    assert_int_equal(parsed.flag, 0);
    assert_int_equal(parse("- --text=x"), 1);
    assert_string_equal(words[0], "-");
    assert_string_equal(parsed.text, "x");
}

static void refused(const char *line, const char *what)
{
    assert_int_equal(parse(line), -1);
    assert_string_equal(said, what);
}

static void test_faults(void **state)
{
    (void)state;
    refused("--castle", "tool: there is no option '--castle', expected one of those that --help lists\n");
    refused("-x", "tool: there is no option '-x', expected one of those that --help lists\n");
    refused("-ff", "tool: there is no option '-ff', expected one of those that --help lists\n");
    refused("--coun 3", "tool: there is no option '--coun', expected one of those that --help lists\n");
    refused("--counts 3", "tool: there is no option '--counts', expected one of those that --help lists\n");
    refused("a b c", "tool: 'c' is one argument too many, expected a scene and a folder\n");
    refused("--count", "tool: --count has no value, expected N\n");
    refused("--flag=1", "tool: --flag=1: it takes no value, expected --flag\n");
    refused("--text=", "tool: --text is empty, expected DIR\n");
    refused("--count 0", "tool: --count is '0', expected a whole number in 1 to 64\n");
    refused("--count 65", "tool: --count is '65', expected a whole number in 1 to 64\n");
    refused("--count 3.5", "tool: --count is '3.5', expected a whole number in 1 to 64\n");
    refused("--count 3x", "tool: --count is '3x', expected a whole number in 1 to 64\n");
    refused("--free-count 2147483648", "tool: --free-count is '2147483648', expected a whole number\n");
    refused("--free-count -2147483649", "tool: --free-count is '-2147483649', expected a whole number\n");
    refused("--seed -1", "tool: --seed is '-1', expected a whole number in 0 to 18446744073709551615\n");
    refused("--seed=", "tool: --seed is '', expected a whole number in 0 to 18446744073709551615\n");
    refused("--seed 18446744073709551616",
            "tool: --seed is '18446744073709551616', expected a whole number in 0 to 18446744073709551615\n");
    refused("--number 2.51", "tool: --number is '2.51', expected a number in -1 to 2.5 (M)\n");
    refused("--number -1.01", "tool: --number is '-1.01', expected a number in -1 to 2.5 (M)\n");
    refused("--number nan", "tool: --number is 'nan', expected a number in -1 to 2.5 (M)\n");
    refused("--number -nan", "tool: --number is '-nan', expected a number in -1 to 2.5 (M)\n");
    refused("--number=", "tool: --number is '', expected a number in -1 to 2.5 (M)\n");
    refused("--number 1,5", "tool: --number is '1,5', expected a number in -1 to 2.5 (M)\n");
    refused("--free-number 1e999", "tool: --free-number is '1e999', expected a number (M)\n");
    refused("--free-number -inf", "tool: --free-number is '-inf', expected a number (M)\n");
    refused("--pair 1", "tool: --pair is '1', expected two numbers in 0 to 360 as M,DEG\n");
    refused("--pair 1,", "tool: --pair is '1,', expected two numbers in 0 to 360 as M,DEG\n");
    refused("--pair 1,2,3", "tool: --pair is '1,2,3', expected two numbers in 0 to 360 as M,DEG\n");
    refused("--pair 1,361", "tool: --pair is '1,361', expected two numbers in 0 to 360 as M,DEG\n");
    assert_near(parsed.pair[0], 1, 0); /* as it was */
    refused("--size 12,10", "tool: --size is '12,10', expected two numbers in 1 to 60 as WxH\n");
    refused("--size 0x10", "tool: --size is '0x10', expected two numbers in 1 to 60 as WxH\n");
}

static void test_help(void **state)
{
    FILE *file = tmpfile();
    char text[2000];
    size_t length;

    (void)state;
    assert_non_null(file);
    (void)parse("");
    parsed.text = "here";
    parsed.free_number = NAN;
    options_help(file, table, OPTIONS);
    rewind(file);
    length = fread(text, 1, sizeof text - 1, file);
    text[length] = '\0';
    fclose(file);
    assert_string_equal(text, "  -f, --flag               a flag\n"
                              "  -c, --count N            a count [7]\n"
                              "  --free-count N           any count [0]\n"
                              "  --seed N                 a seed [1]\n"
                              "  -n, --number M           a number [0.5]\n"
                              "  --free-number M          any number\n"
                              "  --pair M,DEG             a pair [1,2]\n"
                              "  --size WxH               a size\n"
                              "  -o, --text DIR           a text [here]\n");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_values),
        cmocka_unit_test(test_faults),
        cmocka_unit_test(test_help),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
