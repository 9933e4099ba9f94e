/* Reader of bounding boxes of objects in images. */
#include "src/base/build.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/box_table.h"
#include "cairn/number_text.h"
#include "src/host/logs/carmen_log_reader.h"

enum { COLUMN_IMAGE, COLUMN_LEFT, COLUMN_TOP, COLUMN_RIGHT, COLUMN_BOTTOM, COLUMN_COUNT };

/* Largest accepted magnitude of a coordinate, in pixels. */
#define MAX_COORDINATE_PIXELS 1e6

/* State of the reader. */
typedef struct box_reader {
    cairn_line_reader *lines;
    const char *path;
    cairn_file_error *error;
    /* fields of the current line, without quotes */
    char field[CAIRN_BOX_TABLE_MAX_FIELDS][CAIRN_BOX_TABLE_NAME_BYTES];
    /* fields of the line; field of each column */
    int32_t fields, column[COLUMN_COUNT];
} box_reader;

static int64_t line_of(const box_reader *reader)
{
    return cairn_line_reader_number(reader->lines);
}

static cairn_status bad_line(const box_reader *reader, const char *what)
{
    return cairn_file_error_set(reader->error, CAIRN_BAD_FORMAT, reader->path, line_of(reader),
                                "%s", what);
}

/* Reads a field at *at, which advances behind the field and its comma. *last: 1 when it ends the
 * line. */
static cairn_status read_field(box_reader *reader, const char **at, const char *end, int *last)
{
    char *to = reader->field[reader->fields];
    int is_quoted = *at < end && **at == '"';
    size_t length = 0;

    *at += is_quoted;
    for (;; (*at)++) {
        if (*at == end && is_quoted)
            return bad_line(reader, "a quote without an end, expected one before the line ends");
        if (is_quoted && **at == '"') {
            (*at)++;
            if (*at == end || **at != '"')
                is_quoted = 0;
        }
        if (!is_quoted && (*at == end || **at == ','))
            break;
        if (length + 1 == CAIRN_BOX_TABLE_NAME_BYTES)
            return bad_line(reader, "a field of more than 255 bytes, expected a name or a number");
        to[length++] = **at;
    }
    to[length] = '\0';
    *last = *at == end;
    *at += *at < end;
    return CAIRN_OK;
}

/* Splits a line into fields, CSV with quotes (RFC 4180). */
static cairn_status read_fields(box_reader *reader, const char *line, size_t length)
{
    const char *at = line, *end = line + length;
    cairn_status status = CAIRN_OK;
    int last = 0;

    for (reader->fields = 0; status == CAIRN_OK && !last; reader->fields++) {
        if (reader->fields == CAIRN_BOX_TABLE_MAX_FIELDS)
            return bad_line(reader, "more than 64 fields, expected image,left,top,right,bottom");
        status = read_field(reader, &at, end, &last);
    }
    return status;
}

/* Finds the columns by name in the header line. */
static cairn_status read_header(box_reader *reader)
{
    static const char *const names[COLUMN_COUNT] = {"image", "left", "top", "right", "bottom"};

    for (int32_t k = 0; k < COLUMN_COUNT; k++) {
        reader->column[k] = -1;
        for (int32_t i = 0; i < reader->fields && reader->column[k] < 0; i++)
            if (strcmp(reader->field[i], names[k]) == 0)
                reader->column[k] = i;
        if (reader->column[k] < 0)
            return cairn_file_error_set(
                reader->error, CAIRN_BAD_FORMAT, reader->path, line_of(reader),
                "no column '%s', expected image,left,top,right,bottom", names[k]);
    }
    return CAIRN_OK;
}

/* Converts the fields of a line to a row. */
static cairn_status parse_row(const box_reader *reader, cairn_box_table_row *row)
{
    for (int32_t k = 0; k < COLUMN_COUNT; k++)
        if (reader->column[k] >= reader->fields)
            return bad_line(reader, "fewer fields than in the first line, expected as many");
    memcpy(row->image, reader->field[reader->column[COLUMN_IMAGE]], sizeof row->image);
    row->line = line_of(reader);
    if (row->image[0] == '\0')
        return bad_line(reader, "no image, expected its name");
    for (int32_t k = 0; k < 4; k++) {
        const char *text = reader->field[reader->column[COLUMN_LEFT + k]];

        if (!cairn_number_read(text, strlen(text), &row->box[k]) ||
            !(fabs(row->box[k]) <= MAX_COORDINATE_PIXELS))
            return bad_line(reader,
                            "a side of a box is not a number of pixels, expected one within 1e6");
    }
    if (!(row->box[0] < row->box[2] && row->box[1] < row->box[3]))
        return bad_line(reader, "a box without area, expected left < right and top < bottom");
    return CAIRN_OK;
}

/* Reads the header and all rows. */
static cairn_status read_rows(box_reader *reader, cairn_box_table_row **row, int32_t *count)
{
    int32_t capacity = 0, has_header = 0;
    const char *line;
    size_t length;
    cairn_status status;

    while ((status = cairn_line_reader_next(reader->lines, &line, &length, reader->error)) ==
           CAIRN_OK) {
        if (length == 0)
            continue;
        status = read_fields(reader, line, length);
        if (status == CAIRN_OK && !has_header)
            status = read_header(reader);
        if (status != CAIRN_OK)
            return status;
        if (!has_header) {
            has_header = 1;
            continue;
        }
        if (*count == CAIRN_BOX_TABLE_MAX_ROWS)
            return cairn_file_error_set(reader->error, CAIRN_FULL, reader->path, line_of(reader),
                                        "too many rows, expected at most %d",
                                        CAIRN_BOX_TABLE_MAX_ROWS);
        if (*count == capacity) {
            cairn_box_table_row *grown = realloc(*row, (size_t)(2 * capacity + 16) * sizeof *grown);

            if (grown == NULL)
                return cairn_file_error_system(reader->error, reader->path, "read", ENOMEM);
            *row = grown;
            capacity = 2 * capacity + 16;
        }
        status = parse_row(reader, &(*row)[*count]);
        if (status != CAIRN_OK)
            return status;
        (*count)++;
    }
    if (status == CAIRN_FULL)
        return bad_line(reader, "the line is too long, expected image,left,top,right,bottom");
    if (status != CAIRN_EMPTY)
        return status;
    return has_header
               ? CAIRN_OK
               : cairn_file_error_set(reader->error, CAIRN_EMPTY, reader->path, 0,
                                      "the file is empty, expected image,left,top,right,bottom");
}

static int compare_rows(const void *a, const void *b)
{
    const cairn_box_table_row *first = a, *second = b;
    int order = strcmp(first->image, second->image);

    return order != 0 ? order : (first->line > second->line) - (first->line < second->line);
}

void cairn_box_table_sort(cairn_box_table_row *row, int32_t count)
{
    if (count > 1)
        qsort(row, (size_t)count, sizeof *row, compare_rows);
}

/* Returns the first row with a name not below `image` (lower bound) or, with `upper`, above it
 * (upper bound). */
static int32_t find_bound(const cairn_box_table_row *row, int32_t count, const char *image,
                          int upper)
{
    int32_t low = 0, high = count;

    while (low < high) {
        int32_t middle = low + (high - low) / 2;
        int order = strcmp(row[middle].image, image);

        if (order < 0 || (upper && order == 0))
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

int32_t cairn_box_table_find(const cairn_box_table_row *row, int32_t count, const char *image,
                             int32_t *own)
{
    int32_t first = find_bound(row, count, image, 0);

    *own = find_bound(row, count, image, 1) - first;
    return first;
}

cairn_status cairn_box_table_read(const char *path, cairn_box_table_row **row, int32_t *count,
                                  cairn_file_error *error)
{
    box_reader *reader = malloc(sizeof *reader);
    cairn_status status;

    *row = NULL;
    *count = 0;
    if (reader == NULL)
        return cairn_file_error_system(error, path, "read", ENOMEM);
    reader->path = path;
    reader->error = error;
    status = cairn_line_reader_open(&reader->lines, path, error);
    if (status == CAIRN_OK) {
        status = read_rows(reader, row, count);
        cairn_line_reader_close(reader->lines);
    }
    free(reader);
    if (status != CAIRN_OK) {
        free(*row);
        *row = NULL;
        *count = 0;
    }
    return status;
}
