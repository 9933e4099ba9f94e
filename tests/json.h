/* JSON that is well formed. */
#ifndef CAIRN_TESTS_JSON_H
#define CAIRN_TESTS_JSON_H

#include <string.h>

#include "cairn/json_text.h"
#include "tests/test.h"

static inline void assert_json(const char *text)
{
    cairn_json json = cairn_json_begin("json", text, strlen(text));
    cairn_json_token token;
    cairn_file_error error;

    do
        assert_int_equal(cairn_json_next(&json, &token, &error), CAIRN_OK);
    while (token.kind != CAIRN_JSON_END);
}

#endif
