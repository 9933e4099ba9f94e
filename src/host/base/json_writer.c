/* Writer of JSON objects. */
#include "src/base/build.h"

#include <inttypes.h>
#include <math.h>

#include "cairn/json_text.h"
#include "cairn/number_text.h"
#include "src/host/base/c_locale.h"
#include "src/host/base/json_writer.h"

static void print_text(FILE *file, const char *text)
{
    char form[CAIRN_JSON_CHARACTER_BYTES];

    (void)fputc('"', file);
    while (*text != '\0') {
        size_t count = cairn_json_character(&text, form);

        (void)fwrite(form, 1, count, file);
    }
    (void)fputc('"', file);
}

void cairn_json_write_name(cairn_json_writer *json, const char *name)
{
    if (!json->is_first)
        (void)fputs(json->compact ? "," : ", ", json->file);
    json->is_first = 0;
    if (name == NULL)
        return;
    print_text(json->file, name);
    (void)fputs(json->compact ? ":" : ": ", json->file);
}

static void open_container(cairn_json_writer *json, char bracket)
{
    (void)fputc(bracket, json->file);
    json->is_first = 1;
}

static void close_container(cairn_json_writer *json, char bracket)
{
    (void)fputc(bracket, json->file);
    json->is_first = 0;
}

cairn_json_writer cairn_json_write_begin(FILE *file)
{
    cairn_json_writer json = {file, 9, 0, 1};

    open_container(&json, '{');
    return json;
}

void cairn_json_write_end(cairn_json_writer *json)
{
    close_container(json, '}');
    (void)fputc('\n', json->file);
}

void cairn_json_write_object(cairn_json_writer *json, const char *name)
{
    cairn_json_write_name(json, name);
    open_container(json, '{');
}

void cairn_json_write_object_end(cairn_json_writer *json)
{
    close_container(json, '}');
}

void cairn_json_write_array(cairn_json_writer *json, const char *name)
{
    cairn_json_write_name(json, name);
    open_container(json, '[');
}

void cairn_json_write_array_end(cairn_json_writer *json)
{
    close_container(json, ']');
}

void cairn_json_write_text(cairn_json_writer *json, const char *name, const char *text)
{
    if (text == NULL) {
        cairn_json_write_null(json, name);
        return;
    }
    cairn_json_write_name(json, name);
    print_text(json->file, text);
}

void cairn_json_write_integer(cairn_json_writer *json, const char *name, int64_t value)
{
    cairn_json_write_name(json, name);
    (void)fprintf(json->file, "%" PRId64, value);
}

void cairn_json_write_boolean(cairn_json_writer *json, const char *name, int32_t value)
{
    cairn_json_write_name(json, name);
    (void)fputs(value ? "true" : "false", json->file);
}

void cairn_json_write_null(cairn_json_writer *json, const char *name)
{
    cairn_json_write_name(json, name);
    (void)fputs("null", json->file);
}

void cairn_json_write_number(cairn_json_writer *json, const char *name, double value)
{
    cairn_c_locale locale;

    if (!isfinite(value)) {
        cairn_json_write_null(json, name);
        return;
    }
    cairn_json_write_name(json, name);
    locale = cairn_c_locale_enter();
    (void)fprintf(json->file, "%.*g", (int)json->digits, value);
    cairn_c_locale_leave(locale);
}

void cairn_json_write_exact(cairn_json_writer *json, const char *name, cairn_real value)
{
    char text[CAIRN_NUMBER_TEXT_BYTES];

    if (!(cairn_abs(value) <= CAIRN_REAL_MAX)) {
        cairn_json_write_null(json, name);
        return;
    }
    cairn_json_write_name(json, name);
    (void)fputs(cairn_number_write(text, value), json->file);
}

void cairn_json_write_numbers(cairn_json_writer *json, const char *name, const cairn_real *value,
                              int32_t count)
{
    cairn_json_write_array(json, name);
    for (int32_t i = 0; i < count; i++)
        cairn_json_write_number(json, NULL, (double)value[i]);
    cairn_json_write_array_end(json);
}
