/* A streaming JSON tokenizer.
 *
 * Method
 * 1. A finite state machine: the state determines the permitted next tokens.
 * 2. A stack of one bit for each depth marks whether the open container is an object or an array.
 *    There is no recursion and no allocation.
 * 3. Strings are validated when they are tokenized, so decoding their escapes cannot fail. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/json_text.h"
#include "cairn/number_text.h"
#include "src/host/base/utf8.h"

/* States of the grammar: the tokens that may come next. */
enum {
    STATE_VALUE,          /* a value must follow */
    STATE_VALUE_OR_CLOSE, /* an array has just opened */
    STATE_NAME,           /* after a comma in an object */
    STATE_NAME_OR_CLOSE,  /* an object has just opened */
    STATE_COLON,          /* after a name */
    STATE_COMMA_OR_CLOSE  /* a value has just ended */
};

cairn_json cairn_json_begin(const char *path, const char *text, size_t length)
{
    cairn_json json;

    memset(&json, 0, sizeof json);
    json.path = path;
    json.at = text;
    json.end = text + length;
    json.line = 1;
    json.state = STATE_VALUE;
    return json;
}

/* ---- errors ---- */

/* Reports a syntax error: the byte found and the token that was expected. The state is not
 * advanced, so later calls find the same error again. */
static cairn_status syntax_error(const cairn_json *json, cairn_file_error *error,
                                 const char *expected)
{
    const char *within = json->depth == 0                         ? ""
                         : json->objects >> (json->depth - 1) & 1 ? " within an object"
                                                                  : " within an array";

    if (json->at == json->end)
        return cairn_file_error_set(error, CAIRN_TRUNCATED, json->path, json->line,
                                    "the text ends%s, expected %s", within, expected);
    if (*json->at > ' ' && *json->at <= '~')
        return cairn_file_error_set(error, CAIRN_BAD_FORMAT, json->path, json->line,
                                    "'%c'%s, expected %s", *json->at, within, expected);
    return cairn_file_error_set(error, CAIRN_BAD_FORMAT, json->path, json->line,
                                "byte 0x%02x%s, expected %s", (unsigned)(unsigned char)*json->at,
                                within, expected);
}

/* ---- lexical ---- */

static void skip_space(cairn_json *json)
{
    for (; json->at < json->end; json->at++) {
        if (*json->at == '\n')
            json->line++;
        else if (*json->at != ' ' && *json->at != '\t' && *json->at != '\r')
            return;
    }
}

static int hex_digit(char c)
{
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
}

/* Returns the value of four hexadecimal digits at p; -1 when there are not four. */
static int32_t hex_code(const char *p, const char *end)
{
    int32_t code = 0;
    int i;

    for (i = 0; i < 4; i++) {
        if (end - p <= i || hex_digit(p[i]) < 0)
            return -1;
        code = code << 4 | hex_digit(p[i]);
    }
    return code;
}

static int is_high_surrogate(int32_t code)
{
    return code >= 0xD800 && code <= 0xDBFF;
}

static int is_low_surrogate(int32_t code)
{
    return code >= 0xDC00 && code <= 0xDFFF;
}

/* Validates an escape sequence and advances behind it. `at` is its backslash. */
static cairn_status skip_escape(cairn_json *json, cairn_file_error *error)
{
    static const char letters[] = {'"', '\\', '/', 'b', 'f', 'n', 'r', 't', 'u'};
    int32_t code;

    json->at++;
    if (json->at == json->end || memchr(letters, *json->at, sizeof letters) == NULL)
        return syntax_error(json, error, "one of \" \\ / b f n r t u after a backslash");
    if (*json->at++ != 'u')
        return CAIRN_OK;
    code = hex_code(json->at, json->end);
    if (code < 0)
        return syntax_error(json, error, "four hexadecimal digits after \\u");
    json->at += 4;
    if (is_high_surrogate(code) &&
        (json->end - json->at < 2 || json->at[0] != '\\' || json->at[1] != 'u' ||
         !is_low_surrogate(hex_code(json->at + 2, json->end))))
        return syntax_error(json, error, "the second half of a surrogate pair");
    if (is_low_surrogate(code))
        return syntax_error(json, error, "no second half of a surrogate pair without the first");
    json->at += is_high_surrogate(code) ? 6 : 0;
    return CAIRN_OK;
}

/* Tokenizes a string. `at` is its opening quote. */
static cairn_status read_string(cairn_json *json, cairn_json_token *token, cairn_file_error *error)
{
    json->at++;
    token->text = json->at;
    while (json->at < json->end && *json->at != '"') {
        cairn_status status;

        if ((unsigned char)*json->at < ' ')
            return syntax_error(
                json, error, "no control character in a string: an escape, or the closing quote");
        if (*json->at != '\\') {
            json->at++;
            continue;
        }
        status = skip_escape(json, error);
        if (status != CAIRN_OK)
            return status;
    }
    if (json->at == json->end)
        return syntax_error(json, error, "the closing quote of a string");
    token->length = (size_t)(json->at - token->text);
    json->at++;
    return CAIRN_OK;
}

/* Advances over decimal digits; 0 when there are none. */
static int skip_digits(cairn_json *json)
{
    const char *first = json->at;

    while (json->at < json->end && *json->at >= '0' && *json->at <= '9')
        json->at++;
    return json->at > first;
}

/* Advances over one character of `set`; 0 when the next character is another one. */
static int accept_one_of(cairn_json *json, const char *set)
{
    if (json->at == json->end || *json->at == 0 || strchr(set, *json->at) == NULL)
        return 0;
    json->at++;
    return 1;
}

static cairn_status read_number(cairn_json *json, cairn_json_token *token, cairn_file_error *error)
{
    token->text = json->at;
    (void)accept_one_of(json, "-");
    if (!accept_one_of(json, "0") && !skip_digits(json))
        return syntax_error(json, error, "a digit");
    if (accept_one_of(json, ".") && !skip_digits(json))
        return syntax_error(json, error, "a digit after the point");
    if (accept_one_of(json, "eE")) {
        (void)accept_one_of(json, "+-");
        if (!skip_digits(json))
            return syntax_error(json, error, "a digit of the exponent");
    }
    token->length = (size_t)(json->at - token->text);
    if (!cairn_number_read(token->text, token->length, &token->number))
        return cairn_file_error_set(
            error, CAIRN_BAD_FORMAT, json->path, json->line,
            "a number that is too large or too long, expected one that a double can hold");
    return CAIRN_OK;
}

/* Tokenizes true, false or null. */
static cairn_status read_literal(cairn_json *json, cairn_json_token *token, cairn_file_error *error)
{
    static const struct {
        const char *word;
        cairn_json_kind kind;
    } words[] = {{"true", CAIRN_JSON_TRUE}, {"false", CAIRN_JSON_FALSE}, {"null", CAIRN_JSON_NULL}};
    size_t i;

    for (i = 0; i < sizeof words / sizeof *words; i++) {
        size_t length = strlen(words[i].word);

        if ((size_t)(json->end - json->at) >= length &&
            memcmp(json->at, words[i].word, length) == 0) {
            token->kind = words[i].kind;
            json->at += length;
            return CAIRN_OK;
        }
    }
    return syntax_error(json, error, "a value: { [ \" a number, true, false or null");
}

/* ---- syntax ---- */

static int in_object(const cairn_json *json)
{
    return json->depth > 0 && (json->objects >> (json->depth - 1) & 1) != 0;
}

static void end_value(cairn_json *json)
{
    json->state = json->depth > 0 ? STATE_COMMA_OR_CLOSE : STATE_VALUE;
}

/* Pushes an object or array on the stack. */
static cairn_status open_level(cairn_json *json, cairn_json_token *token, int object,
                               cairn_file_error *error)
{
    uint64_t bit;

    if (json->depth == CAIRN_JSON_MAX_DEPTH)
        return cairn_file_error_set(error, CAIRN_FULL, json->path, json->line,
                                    "nested too deep, expected at most %d", CAIRN_JSON_MAX_DEPTH);
    json->at++;
    bit = UINT64_C(1) << json->depth++;
    json->objects = object ? json->objects | bit : json->objects & ~bit;
    json->state = object ? STATE_NAME_OR_CLOSE : STATE_VALUE_OR_CLOSE;
    token->kind = object ? CAIRN_JSON_OBJECT : CAIRN_JSON_ARRAY;
    return CAIRN_OK;
}

/* Pops the open container if its closing bracket comes next; 0 otherwise. */
static int accept_close(cairn_json *json, cairn_json_token *token)
{
    int object = in_object(json);

    if (!accept_one_of(json, object ? "}" : "]"))
        return 0;
    token->kind = object ? CAIRN_JSON_OBJECT_END : CAIRN_JSON_ARRAY_END;
    json->depth--;
    end_value(json);
    return 1;
}

static cairn_status read_name(cairn_json *json, cairn_json_token *token, cairn_file_error *error)
{
    cairn_status status;

    if (json->at == json->end || *json->at != '"')
        return syntax_error(
            json, error, json->state == STATE_NAME ? "a name in quotes" : "a name in quotes or }");
    status = read_string(json, token, error);
    token->kind = CAIRN_JSON_NAME;
    json->state = STATE_COLON;
    return status;
}

static cairn_status read_value(cairn_json *json, cairn_json_token *token, cairn_file_error *error)
{
    int first = json->at < json->end ? *json->at : '\0';
    cairn_status status;

    if (first == '{' || first == '[')
        return open_level(json, token, first == '{', error);
    if (first == '"') {
        status = read_string(json, token, error);
        token->kind = CAIRN_JSON_STRING;
    } else if (first == '-' || (first >= '0' && first <= '9')) {
        status = read_number(json, token, error);
        token->kind = CAIRN_JSON_NUMBER;
    } else {
        status = read_literal(json, token, error);
    }
    end_value(json);
    return status;
}

/* Advances over the comma or colon that the state requires. The state then is the one of the token
 * that must follow. */
static cairn_status skip_separator(cairn_json *json, cairn_file_error *error)
{
    if (json->state == STATE_COLON) {
        if (!accept_one_of(json, ":"))
            return syntax_error(json, error, "a colon after the name");
        json->state = STATE_VALUE;
    } else if (json->state == STATE_COMMA_OR_CLOSE) {
        if (!accept_one_of(json, ","))
            return syntax_error(json, error, in_object(json) ? "a comma or }" : "a comma or ]");
        json->state = in_object(json) ? STATE_NAME : STATE_VALUE;
    }
    skip_space(json);
    return CAIRN_OK;
}

static cairn_status read_token(cairn_json *json, cairn_json_token *token, cairn_file_error *error)
{
    cairn_status status;

    skip_space(json);
    token->line = json->line;
    if (json->depth == 0 && json->at == json->end)
        return CAIRN_OK;
    if ((json->state == STATE_COMMA_OR_CLOSE || json->state == STATE_VALUE_OR_CLOSE ||
         json->state == STATE_NAME_OR_CLOSE) &&
        accept_close(json, token))
        return CAIRN_OK;
    status = skip_separator(json, error);
    token->line = json->line;
    if (status != CAIRN_OK)
        return status;
    return json->state == STATE_NAME || json->state == STATE_NAME_OR_CLOSE
               ? read_name(json, token, error)
               : read_value(json, token, error);
}

cairn_status cairn_json_next(cairn_json *json, cairn_json_token *token, cairn_file_error *error)
{
    cairn_json before = *json;
    cairn_status status;

    memset(token, 0, sizeof *token);
    status = read_token(json, token, error);
    if (status != CAIRN_OK) {
        memset(token, 0, sizeof *token);
        *json = before;
    }
    return status;
}

cairn_status cairn_json_skip(cairn_json *json, cairn_file_error *error)
{
    cairn_json before = *json;
    cairn_json_token token;
    cairn_status status = cairn_json_next(json, &token, error);

    if (status == CAIRN_OK && (token.kind == CAIRN_JSON_END || token.kind == CAIRN_JSON_NAME ||
                               json->depth < before.depth))
        status = cairn_file_error_set(error, CAIRN_BAD_FORMAT, json->path, token.line,
                                      "no value here, expected one");
    while (status == CAIRN_OK && json->depth > before.depth)
        status = cairn_json_next(json, &token, error);
    if (status != CAIRN_OK)
        *json = before;
    return status;
}

/* ---- strings ---- */

/* Copies one unescaped UTF-8 character; returns its bytes. */
static size_t plain_character(const char **at, const char *end, char utf8[4])
{
    size_t count = 0;

    do
        utf8[count++] = *(*at)++;
    while (*at < end && count < 4 && (**at & 0xC0) == 0x80);
    return count;
}

/* Encodes a code point as UTF-8; returns its bytes. */
static size_t encode_utf8(uint32_t code, char utf8[4])
{
    static const uint8_t lead[] = {0, 0xC0, 0xE0, 0xF0};
    size_t more = code < 0x80 ? 0 : code < 0x800 ? 1 : code < 0x10000 ? 2 : 3, i;

    utf8[0] = (char)(lead[more] | code >> 6 * more);
    for (i = 1; i <= more; i++)
        utf8[i] = (char)(0x80 | (code >> 6 * (more - i) & 63));
    return more + 1;
}

/* Decodes the next character of a string to UTF-8 and returns its bytes. *at advances behind it. */
static size_t next_character(const char **at, const char *end, char utf8[4])
{
    static const char letters[] = "bfnrt", bytes[] = "\b\f\n\r\t";
    const char *letter;
    uint32_t code;

    if (**at != '\\')
        return plain_character(at, end, utf8);
    letter = strchr(letters, (*at)[1]);
    if ((*at)[1] != 'u') {
        utf8[0] = *(letter != NULL ? &bytes[letter - letters] : &(*at)[1]);
        *at += 2;
        return 1;
    }
    code = (uint32_t)hex_code(*at + 2, end);
    *at += 6;
    if (is_high_surrogate((int32_t)code)) {
        code = 0x10000 + ((code & 0x3FF) << 10) + ((uint32_t)hex_code(*at + 2, end) & 0x3FF);
        *at += 6;
    }
    return encode_utf8(code, utf8);
}

int32_t cairn_json_is(const cairn_json_token *token, const char *text)
{
    const char *at = token->text, *end = at + token->length;
    size_t left = strlen(text);

    if (token->kind != CAIRN_JSON_NAME && token->kind != CAIRN_JSON_STRING)
        return 0;
    while (at < end) {
        char utf8[4];
        size_t count = next_character(&at, end, utf8);

        if (count > left || memcmp(utf8, text, count) != 0)
            return 0;
        text += count;
        left -= count;
    }
    return left == 0;
}

size_t cairn_json_copy(const cairn_json_token *token, char *buffer, size_t size)
{
    const char *at = token->text, *end = at + token->length;
    size_t need = 0, used = 0;

    while (at < end) {
        char utf8[4];
        size_t count = next_character(&at, end, utf8);

        /* After the first character that does not fit, nothing more is copied. */
        if (used == need && need + count < size) {
            memcpy(buffer + used, utf8, count);
            used += count;
        }
        need += count;
    }
    buffer[used] = '\0';
    return need;
}

/* Control characters, line ends of Unicode and what is no character break YAML, in which JSON
 * strings are written too; the others are those of JSON and of HTML about it. */
static int is_escaped(uint32_t code)
{
    return code < ' ' || (code >= 0x7F && code < 0xA0) || code == 0x2028 || code == 0x2029 ||
           code == 0xFFFE || code == 0xFFFF ||
           (code < 0x7F && strchr("\"\\<>&", (char)code) != NULL);
}

size_t cairn_json_character(const char **at, char form[CAIRN_JSON_CHARACTER_BYTES])
{
    static const char digits[] = "0123456789abcdef";
    const char *character = *at;
    size_t length = cairn_utf8_length(*at);
    uint32_t code = cairn_utf8_code_point(*at, length);

    *at += length > 0 ? length : 1;
    if (length > 0 && is_escaped(code)) {
        form[0] = '\\';
        form[1] = 'u';
        for (int32_t i = 0; i < 4; i++)
            form[2 + i] = digits[code >> (12 - 4 * i) & 15];
        return 6;
    }
    if (length == 0) {
        character = CAIRN_UTF8_REPLACEMENT;
        length = strlen(character);
    }
    memcpy(form, character, length);
    return length;
}
