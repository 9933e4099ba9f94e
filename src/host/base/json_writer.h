/* json_writer: writes one JSON object to a stream, numbers without the locale. Internal to the
 * host library and the programs.
 *
 *     cairn_json_writer json = cairn_json_write_begin(stdout);
 *
 *     cairn_json_write_integer(&json, "scans", scans);
 *     cairn_json_write_array(&json, "maps");
 *     cairn_json_write_text(&json, NULL, path);
 *     cairn_json_write_array_end(&json);
 *     cairn_json_write_end(&json);
 *
 * The name of a value is NULL within an array. Errors of the stream are those of its file. */
#ifndef CAIRN_HOST_JSON_WRITER_H
#define CAIRN_HOST_JSON_WRITER_H

#include <stdint.h>
#include <stdio.h>

#include "cairn/real.h"

typedef struct cairn_json_writer {
    FILE *file;
    int32_t digits;   /* significant digits of numbers (9) */
    int32_t compact;  /* 1: no blanks between values (0) */
    int32_t is_first; /* private, 1: the open object or array is empty yet */
} cairn_json_writer;

/* Begins the object. */
cairn_json_writer cairn_json_write_begin(FILE *file);
/* Ends the object and its line. */
void cairn_json_write_end(cairn_json_writer *json);

void cairn_json_write_object(cairn_json_writer *json, const char *name);
void cairn_json_write_object_end(cairn_json_writer *json);
void cairn_json_write_array(cairn_json_writer *json, const char *name);
void cairn_json_write_array_end(cairn_json_writer *json);

/* Comma and name of a value that the caller prints itself. */
void cairn_json_write_name(cairn_json_writer *json, const char *name);

/* Writes a text, escaped by cairn_json_character(); NULL: null. */
void cairn_json_write_text(cairn_json_writer *json, const char *name, const char *text);
void cairn_json_write_integer(cairn_json_writer *json, const char *name, int64_t value);
void cairn_json_write_boolean(cairn_json_writer *json, const char *name, int32_t value);
void cairn_json_write_null(cairn_json_writer *json, const char *name);
/* Writes a number, rounded to the writer's digits; null when it is not finite. */
void cairn_json_write_number(cairn_json_writer *json, const char *name, double value);
/* Writes a number by cairn_number_write(), which reads back as the same bits; null when it is not
 * finite. */
void cairn_json_write_exact(cairn_json_writer *json, const char *name, cairn_real value);
/* An array of numbers, each by cairn_json_write_number(). */
void cairn_json_write_numbers(cairn_json_writer *json, const char *name, const cairn_real *value,
                              int32_t count);

#endif
