/* The JSON writer: every kind of value, names and texts that need escapes, nesting, numbers under
 * another locale. */
#include "tests/test.h"

#include <locale.h>
#include <math.h>

#include "cairn/json_text.h"
#include "src/host/base/json_writer.h"
#include "src/host/base/posix.h"

static cairn_text_stream written;

static cairn_json_writer begin(void)
{
    assert_true(cairn_text_stream_open(&written));
    return cairn_json_write_begin(written.stream);
}

/* Ends the object, which must be `expected`, and JSON as the reader reads it. */
static void assert_written(cairn_json_writer *json, const char *expected)
{
    cairn_json_token token = {0};
    cairn_json reader;
    char *text;

    cairn_json_write_end(json);
    text = cairn_text_stream_close(&written);
    assert_non_null(text);
    assert_string_equal(text, expected);
    reader = cairn_json_begin("text", text, strlen(text));
    do
        assert_ok(cairn_json_next(&reader, &token, NULL));
    while (token.kind != CAIRN_JSON_END);
    free(text);
}

static void every_kind_of_value(void **state)
{
    static const cairn_real three[] = {1, CAIRN_REAL(-0.5), (cairn_real)NAN};
    cairn_json_writer json = begin();

    (void)state;
    cairn_json_write_text(&json, "text", "a");
    cairn_json_write_text(&json, "no text", NULL);
    cairn_json_write_integer(&json, "least", INT64_MIN);
    cairn_json_write_integer(&json, "most", INT64_MAX);
    cairn_json_write_boolean(&json, "yes", 2);
    cairn_json_write_boolean(&json, "no", 0);
    cairn_json_write_null(&json, "nothing");
    cairn_json_write_number(&json, "number", 1.0 / 3);
    cairn_json_write_exact(&json, "exact", CAIRN_REAL(0.1));
    cairn_json_write_numbers(&json, "numbers", three, 3);
    cairn_json_write_numbers(&json, "none", three, 0);
    assert_written(
        &json, "{\"text\": \"a\", \"no text\": null, \"least\": -9223372036854775808, \"most\": "
               "9223372036854775807, \"yes\": true, \"no\": false, \"nothing\": null, \"number\": "
               "0.333333333, \"exact\": 0.1, \"numbers\": [1, -0.5, null], \"none\": []}\n");
}

static void an_empty_object(void **state)
{
    cairn_json_writer json = begin();

    (void)state;
    assert_written(&json, "{}\n");
}

static void objects_and_arrays_nest(void **state)
{
    cairn_json_writer json = begin();

    (void)state;
    cairn_json_write_array(&json, "maps");
    for (int32_t i = 0; i < 2; i++) {
        cairn_json_write_object(&json, NULL);
        cairn_json_write_integer(&json, "map", i);
        cairn_json_write_array(&json, "none");
        cairn_json_write_array_end(&json);
        cairn_json_write_object_end(&json);
    }
    cairn_json_write_array_end(&json);
    cairn_json_write_object(&json, "empty");
    cairn_json_write_object_end(&json);
    cairn_json_write_name(&json, "own");
    (void)fputs("7", json.file);
    assert_written(&json, "{\"maps\": [{\"map\": 0, \"none\": []}, {\"map\": 1, \"none\": []}], "
                          "\"empty\": {}, \"own\": 7}\n");
}

static void a_compact_object_has_no_blanks(void **state)
{
    cairn_json_writer json = begin();

    (void)state;
    json.compact = 1;
    cairn_json_write_integer(&json, "a", 1);
    cairn_json_write_array(&json, "b");
    cairn_json_write_integer(&json, NULL, 2);
    cairn_json_write_integer(&json, NULL, 3);
    cairn_json_write_array_end(&json);
    assert_written(&json, "{\"a\":1,\"b\":[2,3]}\n");
}

static void names_and_texts_are_escaped(void **state)
{
    cairn_json_writer json = begin();

    (void)state;
    cairn_json_write_text(&json, "a\"b", "c\\d\n\f\v\xff");
    assert_written(&json, "{\"a\\u0022b\": \"c\\u005cd\\u000a\\u000c\\u000b\xef\xbf\xbd\"}\n");
}

static void numbers_have_the_digits_of_the_writer(void **state)
{
    cairn_json_writer json = begin();

    (void)state;
    json.digits = 3;
    cairn_json_write_number(&json, "a", 12345);
    cairn_json_write_number(&json, "b", -1e-300);
    cairn_json_write_number(&json, "c", HUGE_VAL);
    cairn_json_write_number(&json, "d", (double)NAN);
    cairn_json_write_exact(&json, "e", -(cairn_real)HUGE_VAL);
    assert_written(&json, "{\"a\": 1.23e+04, \"b\": -1e-300, \"c\": null, \"d\": null, \"e\": "
                          "null}\n");
}

/* With the point of a locale that has a comma, where one is installed. */
static void numbers_do_not_depend_on_the_locale(void **state)
{
    cairn_json_writer json;

    (void)state;
    if (setlocale(LC_NUMERIC, "de_DE.UTF-8") == NULL && setlocale(LC_NUMERIC, "de_DE.utf8") == NULL)
        (void)printf("no locale with a comma, tried in that of C\n");
    json = begin();
    cairn_json_write_number(&json, "a", 0.5);
    cairn_json_write_exact(&json, "b", CAIRN_REAL(0.25));
    assert_written(&json, "{\"a\": 0.5, \"b\": 0.25}\n");
    (void)setlocale(LC_NUMERIC, "C");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_kind_of_value),
        cmocka_unit_test(an_empty_object),
        cmocka_unit_test(objects_and_arrays_nest),
        cmocka_unit_test(a_compact_object_has_no_blanks),
        cmocka_unit_test(names_and_texts_are_escaped),
        cmocka_unit_test(numbers_have_the_digits_of_the_writer),
        cmocka_unit_test(numbers_do_not_depend_on_the_locale),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
