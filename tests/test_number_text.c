/* Numbers from and to text compared with strtod, and under a locale with a decimal comma. */
#include "tests/files.h"

#include <locale.h>
#include <math.h>

#include "cairn/number_text.h"

static int32_t read_text(const char *text, double *value)
{
    return cairn_number_read(text, strlen(text), value);
}

static void test_reads_plain_numbers(void **state)
{
    static const char *const text[] = {"0",
                                       "-0",
                                       "1",
                                       "+1",
                                       "81.83",
                                       "-.5",
                                       "5.",
                                       "1e3",
                                       "1E-3",
                                       "1.5e+2",
                                       "0.000",
                                       "123456789012345678",
                                       "9007199254740993",
                                       "1e22",
                                       "1e23",
                                       "1e-22",
                                       "1e-23",
                                       "2.2250738585072014e-308",
                                       "4.9e-324",
                                       "1e-400",
                                       "0e99999999999",
                                       "1.7976931348623157e308",
                                       "0.1000000000000000055511151231257827021181583404541015625",
                                       "100000000000000000000000000",
                                       "976052857.337530",
                                       "00000000000000000000000000001.5",
                                       "9999999999999999999999",
                                       "0.00000000000000000000000012345678901234567890123",
                                       "9007199254740992"};
    double value;

    (void)state;
    for (size_t i = 0; i < sizeof text / sizeof *text; i++) {
        double expected = strtod(text[i], NULL);

        value = 77;
        assert_int_equal(read_text(text[i], &value), 1);
        if (memcmp(&value, &expected, sizeof value) != 0)
            fail_msg("%s was read as %.17g", text[i], value);
    }
}

static void test_reads_words(void **state)
{
    double value;

    (void)state;
    assert_int_equal(read_text("nan", &value), 1);
    assert_true(isnan(value));
    value = 0;
    assert_int_equal(read_text("-NaN", &value), 1);
    assert_true(isnan(value));
    assert_int_equal(read_text("inf", &value), 1);
    assert_true(isinf(value) && value > 0);
    assert_int_equal(read_text("-Infinity", &value), 1);
    assert_true(isinf(value) && value < 0);
    assert_int_equal(read_text("+INF", &value), 1);
    assert_true(isinf(value) && value > 0);
}

static void test_refuses_what_is_no_number(void **state)
{
    static const char *const text[] = {"",     "+",       "-",     ".",      "-.",      "e5",
                                       "1e",   "1e+",     "1e-",   "1ex",    "1x",      "1,5",
                                       "0x10", "1 ",      " 1",    "--1",    "1.2.3",   "nano",
                                       "in",   "infinit", "1e309", "-1e999", "+nan(1)", "1e5e5"};
    char digits[CAIRN_NUMBER_MAX_LENGTH + 2];
    double value = 7;

    (void)state;
    for (size_t i = 0; i < sizeof text / sizeof *text; i++)
        if (read_text(text[i], &value) != 0 || value < 7 || value > 7)
            fail_msg("\"%s\" was read", text[i]);
    memset(digits, '1', sizeof digits);
    digits[1] = '.';
    assert_int_equal(cairn_number_read(digits, CAIRN_NUMBER_MAX_LENGTH + 1, &value), 0);
    assert_int_equal(cairn_number_read(digits, CAIRN_NUMBER_MAX_LENGTH, &value), 1);
    assert_near(value, 1.1111111111111112, 0);
}

/* Random decimals of every length and exponent read as strtod reads them. */
static void test_reads_as_strtod_does(void **state)
{
    cairn_random random;
    char text[64];

    (void)state;
    random = cairn_random_seed(5, 1);
    for (int k = 0; k < 20000; k++) {
        int digits = (int)(cairn_random_bits(&random) % 24) + 1, length = 0,
            point = (int)(cairn_random_bits(&random) % 24);
        double value, expected;

        for (int i = 0; i < digits; i++) {
            if (i == point)
                text[length++] = '.';
            text[length++] = (char)('0' + cairn_random_bits(&random) % 10);
        }
        text[length] = 0;
        if (cairn_random_bits(&random) % 2 == 0)
            (void)snprintf(text + length, 16, "e%d", (int)(cairn_random_bits(&random) % 80) - 40);
        expected = strtod(text, NULL);
        assert_int_equal(read_text(text, &value), 1);
        if (memcmp(&value, &expected, sizeof value) != 0)
            fail_msg("%s was read as %.17g, strtod says %.17g", text, value, expected);
    }
}

static void test_integers(void **state)
{
    static const struct {
        const char *text;
        int32_t ok;
        int64_t value;
    } sample[] = {{"0", 1, 0},
                  {"+12", 1, 12},
                  {"-12", 1, -12},
                  {"9223372036854775807", 1, INT64_MAX},
                  {"-9223372036854775808", 1, INT64_MIN},
                  {"9223372036854775808", 0, 0},
                  {"-9223372036854775809", 0, 0},
                  {"99999999999999999999", 0, 0},
                  {"", 0, 0},
                  {"-", 0, 0},
                  {"1.0", 0, 0},
                  {"1e3", 0, 0},
                  {"x", 0, 0}};

    (void)state;
    for (size_t i = 0; i < sizeof sample / sizeof *sample; i++) {
        int64_t value = 5;

        assert_int_equal(cairn_number_read_integer(sample[i].text, strlen(sample[i].text), &value),
                         sample[i].ok);
        assert_true(value == (sample[i].ok ? sample[i].value : 5));
    }
}

static void test_stamps(void **state)
{
    static const struct {
        const char *text;
        int32_t ok;
        int64_t value;
    } sample[] = {{"976052857.337530", 1, INT64_C(976052857337530000)},
                  {"1.01893e+09", 1, INT64_C(1018930000000000000)},
                  {"0.244408", 1, 244408000},
                  {"-1.5", 1, -1500000000},
                  {"0.0000000005", 1, 1},
                  {"0.00000000049", 1, 0},
                  {"0.000000001499", 1, 1},
                  {"0.000000001500", 1, 2},
                  {"-0.0000000015", 1, -2},
                  {"1e-30", 1, 0},
                  {"0e500", 1, 0},
                  {"1234567890.123456789123456789", 1, INT64_C(1234567890123456789)},
                  {"9223372036.854775807", 1, INT64_MAX},
                  {"9223372036.85477580", 1, INT64_C(9223372036854775800)},
                  {"9223372036.854775808", 0, 0},
                  {"9223372037", 0, 0},
                  {"1e10", 0, 0},
                  {"1e300", 0, 0},
                  {"nan", 0, 0},
                  {"inf", 0, 0},
                  {"12s", 0, 0},
                  {"", 0, 0}};
    char text[CAIRN_NUMBER_TEXT_BYTES];

    (void)state;
    for (size_t i = 0; i < sizeof sample / sizeof *sample; i++) {
        int64_t value = 5;

        if (cairn_number_read_stamp(sample[i].text, strlen(sample[i].text), &value) !=
                sample[i].ok ||
            value != (sample[i].ok ? sample[i].value : 5))
            fail_msg("\"%s\" was read as %lld", sample[i].text, (long long)value);
    }
    assert_string_equal(cairn_number_write_stamp(text, INT64_C(976052857337530000)),
                        "976052857.33753");
    assert_string_equal(cairn_number_write_stamp(text, -1500000000), "-1.5");
    assert_string_equal(cairn_number_write_stamp(text, 1), "0.000000001");
    assert_string_equal(cairn_number_write_stamp(text, 0), "0");
    assert_string_equal(cairn_number_write_stamp(text, INT64_C(100000000000)), "100");
    assert_string_equal(cairn_number_write_stamp(text, INT64_MIN), "-9223372036.854775808");
}

static void test_writes_the_shortest_that_reads_back(void **state)
{
    char text[CAIRN_NUMBER_TEXT_BYTES];
    cairn_random random;
    double back;

    (void)state;
    assert_string_equal(cairn_number_write(text, CAIRN_REAL(0.1)), "0.1");
    assert_string_equal(cairn_number_write(text, -2), "-2");
    assert_string_equal(cairn_number_write(text, CAIRN_REAL(81.83)), "81.83");
    assert_string_equal(cairn_number_write(text, CAIRN_REAL(1.0) / 3),
                        NUMBER("0.3333333333333333", "0.33333334"));
    assert_string_equal(cairn_number_write(text, (cairn_real)NAN), "nan");
    assert_string_equal(cairn_number_write(text, (cairn_real)INFINITY), "inf");
    assert_string_equal(cairn_number_write(text, -(cairn_real)INFINITY), "-inf");
    random = cairn_random_seed(9, 2);
    for (int i = 0; i < 5000; i++) {
        cairn_real value = cairn_random_uniform(&random, -5000, 5000);

        assert_int_equal(read_text(cairn_number_write(text, value), &back), 1);
        assert_true((cairn_real)back <= value && (cairn_real)back >= value);
    }
    assert_int_equal(read_text(cairn_number_write(text, CAIRN_REAL_MAX), &back), 1);
    assert_true((cairn_real)back >= CAIRN_REAL_MAX);
}

static void test_locale_does_not_matter(void **state)
{
    char text[CAIRN_NUMBER_TEXT_BYTES];
    double value;

    (void)state;
    if (!files_comma_locale())
        skip();
    assert_string_equal(localeconv()->decimal_point, ",");
    assert_int_equal(read_text("1.25e-30", &value), 1);
    assert_near(value, 1.25e-30, 0);
    assert_int_equal(read_text("1,25", &value), 0);
    assert_string_equal(cairn_number_write(text, CAIRN_REAL(2.5)), "2.5");
    /* The caller's locale is unchanged. */
    assert_string_equal(localeconv()->decimal_point, ",");
    assert_non_null(setlocale(LC_ALL, "C"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_reads_plain_numbers),
        cmocka_unit_test(test_reads_words),
        cmocka_unit_test(test_refuses_what_is_no_number),
        cmocka_unit_test(test_reads_as_strtod_does),
        cmocka_unit_test(test_integers),
        cmocka_unit_test(test_stamps),
        cmocka_unit_test(test_writes_the_shortest_that_reads_back),
        cmocka_unit_test(test_locale_does_not_matter),
    };
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
