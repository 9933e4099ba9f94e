/* The JSON reader: every kind of token, strings and their escapes, every refusal with its line,
 * texts truncated anywhere. */
#include "tests/test.h"

#include <locale.h>

#include "cairn/json_text.h"

/* Writes the tokens of a text as "{ name: 1 }"-like words, or the error's text; returns the last
 * status. */
static cairn_status read_all(const char *text, size_t length, char *out, size_t size)
{
    static const char *const words[] = {
        "end", "{", "}", "[", "]", "n:", "s:", "d:", "true", "false", "null"};
    cairn_json json = cairn_json_begin("f", text, length);
    cairn_file_error error;
    cairn_json_token token;
    size_t used = 0;

    out[0] = '\0';
    for (;;) {
        cairn_status status = cairn_json_next(&json, &token, &error);
        char buffer[64] = "";

        if (status != CAIRN_OK) {
            /* The same again, and an empty token. */
            assert_int_equal(token.kind, 0);
            assert_true(token.text == NULL && token.length == 0);
            assert_status(cairn_json_next(&json, &token, NULL), status);
            assert_int_equal(error.status, status);
            (void)snprintf(out + used, size - used, "%s%s", used > 0 ? " " : "", error.text);
            return status;
        }
        assert_true(json.at <= json.end);
        if (token.kind == CAIRN_JSON_NUMBER)
            (void)snprintf(buffer, sizeof buffer, "%.9g", token.number);
        else if (token.kind == CAIRN_JSON_NAME || token.kind == CAIRN_JSON_STRING)
            (void)cairn_json_copy(&token, buffer, sizeof buffer);
        used += (size_t)snprintf(out + used, size - used, "%s%s%s", used > 0 ? " " : "",
                                 words[token.kind], buffer);
        assert_true(used < size);
        if (token.kind == CAIRN_JSON_END)
            return CAIRN_OK;
    }
}

static void assert_reads(const char *text, const char *tokens)
{
    char out[1024];

    (void)read_all(text, strlen(text), out, sizeof out);
    assert_string_equal(out, tokens);
}

static void test_tokens(void **state)
{
    (void)state;
    assert_reads("", "end");
    assert_reads(" \t\r\n ", "end");
    assert_reads("{}", "{ } end");
    assert_reads("[]", "[ ] end");
    assert_reads("[[],{}]", "[ [ ] { } ] end");
    assert_reads("{\"a\":1,\"b\":[true,false,null],\"c\":{\"d\":\"e\"}}",
                 "{ n:a d:1 n:b [ true false null ] n:c { n:d s:e } } end");
    assert_reads(" { \"a\" : 1 , \"b\"\n:\t[ ] } ", "{ n:a d:1 n:b [ ] } end");
    assert_reads("{} {}\n[1]2 \"x\"", "{ } { } [ d:1 ] d:2 s:x end");
    assert_reads("0", "d:0 end");
    assert_reads("true", "true end");
    assert_reads("false", "false end");
    assert_reads("null", "null end");
    assert_reads("[-0,-1.5,12.25e1,3E-2,4e+1,0.5]",
                 "[ d:-0 d:-1.5 d:122.5 d:0.03 d:40 d:0.5 ] end");
}

static void test_lines(void **state)
{
    const char *text = "{\n\"a\"\n:\n1,\n\n\"b\":2}\n";
    static const int64_t lines[] = {1, 2, 4, 6, 6, 6, 7};
    cairn_json json = cairn_json_begin("f", text, strlen(text));
    cairn_json_token token;

    (void)state;
    for (int i = 0; i < 7; i++) {
        assert_ok(cairn_json_next(&json, &token, NULL));
        assert_int_equal(token.line, lines[i]);
    }
    assert_int_equal(token.kind, CAIRN_JSON_END);
    assert_ok(cairn_json_next(&json, &token, NULL));
    assert_int_equal(token.kind, CAIRN_JSON_END);
}

static void test_strings(void **state)
{
    (void)state;
    assert_reads("\"\"", "s: end");
    assert_reads("\"a b\\\"c\\\\d\\/e\"", "s:a b\"c\\d/e end");
    assert_reads("\"\\b\\f\\n\\r\\t\"", "s:\b\f\n\r\t end");
    assert_reads("\"\\u0041\\u00e9\\u20AC\\ud83d\\uDE00x\"",
                 "s:A\xC3\xA9\xE2\x82\xAC\xF0\x9F\x98\x80x end");
    assert_reads("\"\\u007f\\u0080\\u07ff\\u0800\\uffff\"",
                 "s:\x7F\xC2\x80\xDF\xBF\xE0\xA0\x80\xEF\xBF\xBF end");
    /* The first and the last of each half of a surrogate pair, and their neighbours. */
    assert_reads("\"\\ud800\\udc00\\ud800\\udfff\"", "s:\xF0\x90\x80\x80\xF0\x90\x8F\xBF end");
    assert_reads("\"\\udbff\\udc00\\udbff\\udfff\"", "s:\xF4\x8F\xB0\x80\xF4\x8F\xBF\xBF end");
    assert_reads("\"\\ud7ff\\ue000\"", "s:\xED\x9F\xBF\xEE\x80\x80 end");
    assert_reads("\"\xC3\xA9\xF0\x9F\x98\x80\"", "s:\xC3\xA9\xF0\x9F\x98\x80 end");
    assert_reads("{\"\\u0061\":0}", "{ n:a d:0 } end");
}

/* What a copy retains when the buffer is too small, and equality. */
static void test_copies(void **state)
{
    const char *text = "\"a\\u00e9\xE2\x82\xACz\"";
    static const char *const kept[] = {"",
                                       "",
                                       "a",
                                       "a",
                                       "a\xC3\xA9",
                                       "a\xC3\xA9",
                                       "a\xC3\xA9",
                                       "a\xC3\xA9\xE2\x82\xAC",
                                       "a\xC3\xA9\xE2\x82\xACz"};
    cairn_json json = cairn_json_begin("f", text, strlen(text));
    cairn_json_token token;

    (void)state;
    assert_ok(cairn_json_next(&json, &token, NULL));
    for (size_t size = 1; size < 9; size++) {
        char buffer[10];

        memset(buffer, '#', sizeof buffer);
        assert_int_equal(cairn_json_copy(&token, buffer, size), 7);
        assert_string_equal(buffer, kept[size]);
        assert_int_equal(buffer[size], '#');
    }
    assert_int_equal(cairn_json_is(&token, kept[8]), 1);
    assert_int_equal(cairn_json_is(&token, kept[7]), 0);
    assert_int_equal(cairn_json_is(&token, "a\xC3\xA9\xE2\x82\xACzc"), 0);
    assert_int_equal(cairn_json_is(&token, "z"), 0);
    assert_int_equal(cairn_json_is(&token, ""), 0);
    json = cairn_json_begin("f", "12", 2);
    assert_ok(cairn_json_next(&json, &token, NULL));
    assert_int_equal(cairn_json_is(&token, "12"), 0);
    assert_int_equal(token.length, 2);
}

/* Every byte, and characters at the edges of UTF-8, written and read back. */
static void test_written_characters(void **state)
{
    static const struct {
        const char *text, *json;
    } cases[] = {{"a\"\\<>&/'", "a\\u0022\\u005c\\u003c\\u003e\\u0026/'"},
                 {"\x01\x1f \x7f", "\\u0001\\u001f \\u007f"},
                 {"\xC2\x80\xC2\x9F\xC2\xA0\xDF\xBF", "\\u0080\\u009f\xC2\xA0\xDF\xBF"},
                 {"\xE2\x80\xA7\xE2\x80\xA8\xE2\x80\xA9", "\xE2\x80\xA7\\u2028\\u2029"},
                 {"\xEF\xBF\xBC\xEF\xBF\xBE\xEF\xBF\xBF", "\xEF\xBF\xBC\\ufffe\\uffff"},
                 {"\xE0\xA0\x80\xED\x9F\xBF\xEE\x80\x80", "\xE0\xA0\x80\xED\x9F\xBF\xEE\x80\x80"},
                 {"\xF0\x90\x80\x80\xF4\x8F\xBF\xBF", "\xF0\x90\x80\x80\xF4\x8F\xBF\xBF"},
                 {"\xC1\xBF", "\xEF\xBF\xBD\xEF\xBF\xBD"},
                 {"\xE0\x9F\xBF", "\xEF\xBF\xBD\xEF\xBF\xBD\xEF\xBF\xBD"},
                 {"\xED\xA0\x80", "\xEF\xBF\xBD\xEF\xBF\xBD\xEF\xBF\xBD"},
                 {"\xF4\x90\x80\x80", "\xEF\xBF\xBD\xEF\xBF\xBD\xEF\xBF\xBD\xEF\xBF\xBD"},
                 {"\xE2\x82|", "\xEF\xBF\xBD\xEF\xBF\xBD|"},
                 {"\xF0\x9F\x98", "\xEF\xBF\xBD\xEF\xBF\xBD\xEF\xBF\xBD"}};

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const char *at = cases[i].text;
        char out[64];
        size_t used = 0;

        while (*at != '\0') {
            size_t count = cairn_json_character(&at, out + used);

            assert_in_range(count, 1, CAIRN_JSON_CHARACTER_BYTES);
            used += count;
        }
        out[used] = '\0';
        assert_string_equal(out, cases[i].json);
    }
    for (int byte = 1; byte < 128; byte++) {
        char text[2] = {(char)byte, '\0'}, out[16] = "\"";
        const char *at = text;
        size_t count = cairn_json_character(&at, out + 1);
        cairn_json json;
        cairn_json_token token;

        assert_true(at == text + 1);
        out[1 + count] = '"';
        json = cairn_json_begin("f", out, count + 2);
        assert_ok(cairn_json_next(&json, &token, NULL));
        assert_int_equal(cairn_json_is(&token, text), 1);
    }
}

static void test_refusals(void **state)
{
    static const struct {
        const char *text, *tokens;
    } cases[] = {
        {"[1,]",
         "[ d:1 f:1: ']' within an array, expected a value: { [ \" a number, true, false or null"},
        {"[,1]",
         "[ f:1: ',' within an array, expected a value: { [ \" a number, true, false or null"},
        {"[1 2]", "[ d:1 f:1: '2' within an array, expected a comma or ]"},
        {"[1}", "[ d:1 f:1: '}' within an array, expected a comma or ]"},
        {"{1:2}", "{ f:1: '1' within an object, expected a name in quotes or }"},
        {"{\"a\":1,}", "{ n:a d:1 f:1: '}' within an object, expected a name in quotes"},
        {"{\"a\" 1}", "{ n:a f:1: '1' within an object, expected a colon after the name"},
        {"{\"a\":}",
         "{ n:a f:1: '}' within an object, expected a value: { [ \" a number, true, false or null"},
        {"{\"a\":1 \"b\":2}", "{ n:a d:1 f:1: '\"' within an object, expected a comma or }"},
        {"{\"a\":1]", "{ n:a d:1 f:1: ']' within an object, expected a comma or }"},
        {"]", "f:1: ']', expected a value: { [ \" a number, true, false or null"},
        {"{} }", "{ } f:1: '}', expected a value: { [ \" a number, true, false or null"},
        {"\n\nnul", "f:3: 'n', expected a value: { [ \" a number, true, false or null"},
        {"[nan]",
         "[ f:1: 'n' within an array, expected a value: { [ \" a number, true, false or null"},
        {"\x01", "f:1: byte 0x01, expected a value: { [ \" a number, true, false or null"},
        {"\xEF\xBB\xBF{}",
         "f:1: byte 0xef, expected a value: { [ \" a number, true, false or null"},
        {"+1", "f:1: '+', expected a value: { [ \" a number, true, false or null"},
        {".5", "f:1: '.', expected a value: { [ \" a number, true, false or null"},
        {"[-]", "[ f:1: ']' within an array, expected a digit"},
        {"[1.]", "[ f:1: ']' within an array, expected a digit after the point"},
        {"[1e]", "[ f:1: ']' within an array, expected a digit of the exponent"},
        {"[1e+]", "[ f:1: ']' within an array, expected a digit of the exponent"},
        {"[01]", "[ d:0 f:1: '1' within an array, expected a comma or ]"},
        {"[1e999]",
         "[ f:1: a number that is too large or too long, expected one that a double can hold"},
        {"\"a\nb\"", "f:1: byte 0x0a, expected no control character in a string: an escape, or the "
                     "closing quote"},
        {"\"\\x\"", "f:1: 'x', expected one of \" \\ / b f n r t u after a backslash"},
        {"\"\\u12g4\"", "f:1: '1', expected four hexadecimal digits after \\u"},
        {"\"\\ud83d\"", "f:1: '\"', expected the second half of a surrogate pair"},
        {"\"\\ud83dxx\"", "f:1: 'x', expected the second half of a surrogate pair"},
        {"\"\\ud83d\\n\"", "f:1: '\\', expected the second half of a surrogate pair"},
        {"\"\\ud83d\\ud83d\"", "f:1: '\\', expected the second half of a surrogate pair"},
        {"\"\\ude00\"", "f:1: '\"', expected no second half of a surrogate pair without the first"},
        {"[", "[ f:1: the text ends within an array, expected a value: { [ \" a number, true, "
              "false or null"},
        {"{\n", "{ f:2: the text ends within an object, expected a name in quotes or }"},
        {"\"a", "f:1: the text ends, expected the closing quote of a string"},
        {"\"a\\", "f:1: the text ends, expected one of \" \\ / b f n r t u after a backslash"},
        {"\"\\ud83d", "f:1: the text ends, expected the second half of a surrogate pair"},
        {"-", "f:1: the text ends, expected a digit"},
    };

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        assert_reads(cases[i].text, cases[i].tokens);
}

/* Every text truncated within a value is CAIRN_TRUNCATED, or CAIRN_BAD_FORMAT within a word or an
 * escape. */
static void test_cut_anywhere(void **state)
{
    const char *text =
        "{\"a\":[1,-2.5e+3,\"x\\u00e9\\ud83d\\ude00\\n\"],\"b\":{\"c\":true,\"d\":[null,false]}}";
    char out[1024];

    (void)state;
    assert_ok(read_all(text, strlen(text), out, sizeof out));
    for (size_t length = 1; length < strlen(text); length++) {
        char *cut = malloc(length); /* in a block of its own, so that an overrun shows */
        cairn_status status;

        assert_non_null(cut);
        memcpy(cut, text, length);
        status = read_all(cut, length, out, sizeof out);
        assert_true(status == CAIRN_TRUNCATED || status == CAIRN_BAD_FORMAT);
        free(cut);
    }
}

/* Random bytes: a status, and no byte read beyond the end. */
static void test_any_bytes(void **state)
{
    static const char alphabet[] = "{}[]:,\"\\u0123456789abcdefntrl.eE+- \n";
    cairn_random random = cairn_random_seed(7, 0);
    char out[4096];

    (void)state;
    for (int run = 0; run < 20000; run++) {
        size_t length = (size_t)cairn_random_below(&random, 25);
        char *text = malloc(length + 1);

        assert_non_null(text);
        for (size_t i = 0; i < length; i++)
            text[i] =
                (char)(run % 4 == 0
                           ? cairn_random_below(&random, 256)
                           : alphabet[cairn_random_below(&random, (int32_t)sizeof alphabet - 1)]);
        text = realloc(text, length > 0 ? length : 1);
        assert_non_null(text);
        (void)read_all(text, length, out, sizeof out);
        free(text);
    }
}

static void test_depth(void **state)
{
    char text[CAIRN_JSON_MAX_DEPTH + 2];
    cairn_json json;
    cairn_json_token token;
    cairn_file_error error;

    (void)state;
    memset(text, '[', sizeof text);
    json = cairn_json_begin("f", text, sizeof text);
    for (int i = 0; i < CAIRN_JSON_MAX_DEPTH; i++)
        assert_ok(cairn_json_next(&json, &token, NULL));
    assert_status(cairn_json_next(&json, &token, &error), CAIRN_FULL);
    assert_string_equal(error.text, "f:1: nested too deep, expected at most 64");
    assert_status(cairn_json_next(&json, &token, NULL), CAIRN_FULL);
    /* At this depth it still distinguishes objects from arrays, and closes them. */
    for (int i = 0; i < CAIRN_JSON_MAX_DEPTH / 2; i++) {
        text[i] = '[';
        text[CAIRN_JSON_MAX_DEPTH - 1 - i] = ']';
    }
    text[CAIRN_JSON_MAX_DEPTH / 2 - 1] = '{';
    text[CAIRN_JSON_MAX_DEPTH / 2] = '}';
    json = cairn_json_begin("f", text, CAIRN_JSON_MAX_DEPTH);
    for (int i = 0; i < CAIRN_JSON_MAX_DEPTH; i++)
        assert_ok(cairn_json_next(&json, &token, NULL));
    assert_ok(cairn_json_next(&json, &token, NULL));
    assert_int_equal(token.kind, CAIRN_JSON_END);
}

static void test_skip(void **state)
{
    const char *text = "{\"a\":{\"x\":[1,{}]},\"b\":2,\"c\":[[]]} 7 8";
    cairn_json json = cairn_json_begin("f", text, strlen(text));
    cairn_json_token token;
    cairn_file_error error;

    (void)state;
    assert_ok(cairn_json_next(&json, &token, NULL));
    /* a name follows, nothing is skipped */
    assert_status(cairn_json_skip(&json, &error), CAIRN_BAD_FORMAT);
    assert_string_equal(error.text, "f:1: no value here, expected one");
    for (const char *name = "abc"; *name != '\0'; name++) {
        assert_ok(cairn_json_next(&json, &token, NULL));
        assert_int_equal(token.text[0], *name);
        assert_ok(cairn_json_skip(&json, NULL));
    }
    assert_status(cairn_json_skip(&json, NULL), CAIRN_BAD_FORMAT); /* } */
    assert_ok(cairn_json_next(&json, &token, NULL));
    assert_int_equal(token.kind, CAIRN_JSON_OBJECT_END);
    assert_ok(cairn_json_skip(&json, NULL));
    assert_ok(cairn_json_next(&json, &token, NULL));
    assert_near(token.number, 8, 0);
    assert_status(cairn_json_skip(&json, NULL), CAIRN_BAD_FORMAT); /* the end */
    json = cairn_json_begin("f", "[[1,", 4);
    assert_status(cairn_json_skip(&json, NULL), CAIRN_TRUNCATED);
    assert_ok(cairn_json_next(&json, &token, NULL));
    assert_int_equal(token.kind, CAIRN_JSON_ARRAY);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_tokens),
        cmocka_unit_test(test_lines),
        cmocka_unit_test(test_strings),
        cmocka_unit_test(test_copies),
        cmocka_unit_test(test_written_characters),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_cut_anywhere),
        cmocka_unit_test(test_any_bytes),
        cmocka_unit_test(test_depth),
        cmocka_unit_test(test_skip),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
