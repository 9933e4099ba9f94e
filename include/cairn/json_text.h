/* json_text: a streaming JSON tokenizer (RFC 8259, pull parser) without allocation, and escaping of
 * strings for writing.
 *
 *     cairn_json json = cairn_json_begin(path, text, length);
 *
 *     while ((status = cairn_json_next(&json, &token, &error)) == CAIRN_OK &&
 *            token.kind != CAIRN_JSON_END)
 *         ...
 *
 * The tokenizer is strict: no comments, no trailing commas, no bare words, no control characters in
 * strings. A text may hold any number of values one after another.
 *
 * Limits: bytes above 127 are passed through without validation. Duplicate names in an object are
 * not detected. */
#ifndef CAIRN_JSON_TEXT_H
#define CAIRN_JSON_TEXT_H

#include <stddef.h>

#include "cairn/file_error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The maximum nesting depth of objects and arrays. */
#define CAIRN_JSON_MAX_DEPTH 64

/* The kind of a token. */
typedef int32_t cairn_json_kind;
enum {
    CAIRN_JSON_END = 0, /* end of the text, between two values */
    /* begin of an object */
    CAIRN_JSON_OBJECT = 1,
    /* end of an object */
    CAIRN_JSON_OBJECT_END = 2,
    /* begin of an array */
    CAIRN_JSON_ARRAY = 3,
    /* end of an array */
    CAIRN_JSON_ARRAY_END = 4,
    CAIRN_JSON_NAME = 5, /* name of the value that follows, within an object */
    /* a string */
    CAIRN_JSON_STRING = 6,
    /* a number */
    CAIRN_JSON_NUMBER = 7,
    /* true */
    CAIRN_JSON_TRUE = 8,
    /* false */
    CAIRN_JSON_FALSE = 9,
    /* null */
    CAIRN_JSON_NULL = 10
};

/* One token. */
typedef struct cairn_json_token {
    /* kind of the token */
    cairn_json_kind kind;
    /* from 1 */
    int64_t line;
    /* Points into the parsed text, not 0-terminated. Of a name or string: the bytes between its
     * quotes, escapes included; of a number: its characters. */
    const char *text;
    /* bytes */
    size_t length;
    /* the value of a number; 0 otherwise */
    double number;
} cairn_json_token;

/* The tokenizer's state. The struct is public only so that it can live on the stack. */
typedef struct cairn_json {
    const char *path; /* for error texts */
    /* the unread text */
    const char *at, *end;
    /* current line, from 1 */
    int64_t line;
    /* bit d: 1: the container open at depth d is an object, 0: an array */
    uint64_t objects;
    /* open containers */
    int32_t depth;
    /* state of the grammar, private */
    int32_t state;
} cairn_json;

/* Returns a tokenizer at the start of text[0 .. length). The text is not copied and must outlive
 * the tokenizer and its tokens.
 *
 * path: name of the file, for error texts
 * text: [length] characters of the text */
cairn_json cairn_json_begin(const char *path, const char *text, size_t length);

/* Reads the next token. CAIRN_BAD_FORMAT, CAIRN_TRUNCATED (the text ends within a value),
 * CAIRN_FULL (nested deeper than CAIRN_JSON_MAX_DEPTH): the error has file and line, and every
 * later call returns the same status.
 *
 * json: the tokenizer
 * token: set to the token */
CAIRN_CHECKED cairn_status cairn_json_next(cairn_json *json, cairn_json_token *token,
                                           cairn_file_error *error);

/* Skips the value that follows, with its nested values. Statuses of cairn_json_next();
 * CAIRN_BAD_FORMAT also when no value follows.
 *
 * json: the tokenizer */
CAIRN_CHECKED cairn_status cairn_json_skip(cairn_json *json, cairn_file_error *error);

/* Returns 1 when a name or string equals `text` after its escapes are decoded.
 *
 * token: a name or string
 * text: 0-terminated */
int32_t cairn_json_is(const cairn_json_token *token, const char *text);

/* Copies a name or string as 0-terminated UTF-8 with its escapes decoded, truncated between
 * characters if the buffer is too small. Returns the bytes of the whole text without the 0. size:
 * bytes of the buffer, above 0.
 *
 * token: a name or string
 * buffer: [size] receives the text */
size_t cairn_json_copy(const cairn_json_token *token, char *buffer, size_t size);

/* Maximum bytes of one escaped character. */
#define CAIRN_JSON_CHARACTER_BYTES 8

/* Escapes the next character of a 0-terminated text that is not empty for the inside of a JSON
 * string, and returns the bytes written to `form`. *at advances behind the character. Control
 * characters, U+2028, U+2029, U+FFFE, U+FFFF and " \ < > & become \u escapes, so that the string is
 * safe within HTML and is valid in YAML. Bytes that are not UTF-8 become U+FFFD.
 *
 * form: set to the escaped character, not 0-terminated */
size_t cairn_json_character(const char **at, char form[CAIRN_JSON_CHARACTER_BYTES]);

#ifdef __cplusplus
}
#endif

#endif
