/* json_text: JSON (RFC 8259) read piece by piece, without memory of its own; strings for writing.
 *
 *     cairn_json json = cairn_json_begin(path, text, length);
 *     while ((status = cairn_json_next(&json, &token, &error)) == CAIRN_OK && token.kind !=
 *     CAIRN_JSON_END)
 *         ...
 *
 * Strict: no comments, no trailing commas, no bare words, no control characters in strings. A
 * text may hold any number of values one after another. Bytes above 127 are passed on as they
 * are; that names of an object differ is not checked. */
#ifndef CAIRN_JSON_TEXT_H
#define CAIRN_JSON_TEXT_H

#include <stddef.h>

#include "cairn/file_error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Objects and arrays may be nested so deep. */
#define CAIRN_JSON_DEPTH_MOST 64

typedef int32_t cairn_json_kind;
enum {
    CAIRN_JSON_END = 0, /* of the text, between two values */
    CAIRN_JSON_OBJECT = 1,
    CAIRN_JSON_OBJECT_END = 2,
    CAIRN_JSON_ARRAY = 3,
    CAIRN_JSON_ARRAY_END = 4,
    CAIRN_JSON_NAME = 5, /* of the value that follows, within an object */
    CAIRN_JSON_STRING = 6,
    CAIRN_JSON_NUMBER = 7,
    CAIRN_JSON_TRUE = 8,
    CAIRN_JSON_FALSE = 9,
    CAIRN_JSON_NULL = 10
};

typedef struct cairn_json_token {
    cairn_json_kind kind;
    /* from 1 */
    int64_t line;
    /* of a name or string: between its quotes, as written; of a number: its digits. Within the
     * text read */
    const char *text;
    size_t length;
    /* of a number; 0 otherwise */
    double number;
} cairn_json_token;

/* A reader; open only so that it can stand on the stack. */
typedef struct cairn_json {
    const char *path; /* for errors */
    const char *at, *end;
    int64_t line;
    uint64_t objects; /* bit d: what is open at depth d is an object */
    int32_t depth;
    int32_t state;
} cairn_json;

/* The text is only read and must stay. */
cairn_json cairn_json_begin(const char *path, const char *text, size_t length);

/* The next token. CAIRN_BAD_FORMAT, CAIRN_TRUNCATED (the text ends within a value), CAIRN_FULL
 * (nested too deep): the error names file and line; every later call returns the same again. */
CAIRN_CHECKED cairn_status cairn_json_next(cairn_json *json, cairn_json_token *token,
                                           cairn_file_error *error);

/* Passes over the value that follows, whole. Statuses of _next; CAIRN_BAD_FORMAT: none follows. */
CAIRN_CHECKED cairn_status cairn_json_skip(cairn_json *json, cairn_file_error *error);

/* 1 when a name or string says `text`, its escapes undone. */
int32_t cairn_json_is(const cairn_json_token *token, const char *text);

/* Copies a name or string, its escapes undone, as UTF-8 with a closing 0; what has no room is
 * left out, never half a character. Returns the bytes that the whole would need without the 0.
 * size: above 0. */
size_t cairn_json_copy(const cairn_json_token *token, char *buffer, size_t size);

#define CAIRN_JSON_CHARACTER_BYTES 8

/* The next character of a text that is not empty, as it stands between the quotes of a string;
 * its bytes. *at moves on. Control characters and " \ < > & become escapes, so that the string
 * may stand in HTML; bytes that are not UTF-8 become U+FFFD. */
size_t cairn_json_character(const char **at, char form[CAIRN_JSON_CHARACTER_BYTES]);

#ifdef __cplusplus
}
#endif

#endif
