/* Boxes about objects in images. */
#include "src/core/build.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/box_table.h"
#include "cairn/number_text.h"
#include "src/host/carmen_log_reader.h"

enum { IMAGE, LEFT, TOP, RIGHT, BOTTOM, COLUMNS };

#define FARTHEST 1e6

typedef struct box_reader {
    cairn_line_reader *lines;
    const char *path;
    cairn_file_error *error;
    /* of the line, without quotes */
    char field[CAIRN_BOX_TABLE_FIELDS_MOST][CAIRN_BOX_TABLE_NAME_BYTES];
    int32_t fields, place[COLUMNS];
} box_reader;

static int64_t line_of(const box_reader *r)
{
    return cairn_line_reader_number(r->lines);
}

static cairn_status bad(const box_reader *r, const char *what)
{
    return cairn_file_error_set(r->error, CAIRN_BAD_FORMAT, r->path, line_of(r), "%s", what);
}

/* A field from *at, which moves behind it and its comma; *last: it ends the line. */
static cairn_status read_field(box_reader *r, const char **at, const char *end, int *last)
{
    char *to = r->field[r->fields];
    int is_quoted = *at < end && **at == '"';
    size_t length = 0;

    *at += is_quoted;
    for (;; (*at)++) {
        if (*at == end && is_quoted)
            return bad(r, "a quote without an end, expected one before the line ends");
        if (is_quoted && **at == '"') {
            (*at)++;
            if (*at == end || **at != '"')
                is_quoted = 0;
        }
        if (!is_quoted && (*at == end || **at == ','))
            break;
        if (length + 1 == CAIRN_BOX_TABLE_NAME_BYTES)
            return bad(r, "a field of more than 255 bytes, expected a name or a number");
        to[length++] = **at;
    }
    to[length] = '\0';
    *last = *at == end;
    *at += *at < end;
    return CAIRN_OK;
}

static cairn_status read_fields(box_reader *r, const char *line, size_t length)
{
    const char *at = line, *end = line + length;
    cairn_status status = CAIRN_OK;
    int last = 0;

    for (r->fields = 0; status == CAIRN_OK && !last; r->fields++) {
        if (r->fields == CAIRN_BOX_TABLE_FIELDS_MOST)
            return bad(r, "more than 64 fields, expected image,left,top,right,bottom");
        status = read_field(r, &at, end, &last);
    }
    return status;
}

static cairn_status read_head(box_reader *r)
{
    static const char *const names[COLUMNS] = {"image", "left", "top", "right", "bottom"};

    for (int32_t k = 0; k < COLUMNS; k++) {
        r->place[k] = -1;
        for (int32_t i = 0; i < r->fields && r->place[k] < 0; i++)
            if (strcmp(r->field[i], names[k]) == 0)
                r->place[k] = i;
        if (r->place[k] < 0)
            return cairn_file_error_set(r->error, CAIRN_BAD_FORMAT, r->path, line_of(r),
                                        "no column '%s', expected image,left,top,right,bottom",
                                        names[k]);
    }
    return CAIRN_OK;
}

static cairn_status take_row(const box_reader *r, cairn_box_row *row)
{
    for (int32_t k = 0; k < COLUMNS; k++)
        if (r->place[k] >= r->fields)
            return bad(r, "fewer fields than in the first line, expected as many");
    memcpy(row->image, r->field[r->place[IMAGE]], sizeof row->image);
    row->line = line_of(r);
    if (row->image[0] == '\0')
        return bad(r, "no image, expected its name");
    for (int32_t k = 0; k < 4; k++) {
        const char *text = r->field[r->place[LEFT + k]];

        if (!cairn_number_read(text, strlen(text), &row->box[k]) ||
            !(fabs(row->box[k]) <= FARTHEST))
            return bad(r, "a side of a box is not a number of pixels, expected one within 1e6");
    }
    if (!(row->box[0] < row->box[2] && row->box[1] < row->box[3]))
        return bad(r, "a box without area, expected left < right and top < bottom");
    return CAIRN_OK;
}

static cairn_status read_rows(box_reader *r, cairn_box_row **row, int32_t *count)
{
    int32_t room = 0, has_head = 0;
    const char *line;
    size_t length;
    cairn_status status;

    while ((status = cairn_line_reader_next(r->lines, &line, &length, r->error)) == CAIRN_OK) {
        if (length == 0)
            continue;
        status = read_fields(r, line, length);
        if (status == CAIRN_OK && !has_head)
            status = read_head(r);
        if (status != CAIRN_OK)
            return status;
        if (!has_head) {
            has_head = 1;
            continue;
        }
        if (*count == CAIRN_BOX_TABLE_ROWS_MOST)
            return cairn_file_error_set(r->error, CAIRN_FULL, r->path, line_of(r),
                                        "one row more, expected at most %d",
                                        CAIRN_BOX_TABLE_ROWS_MOST);
        if (*count == room) {
            cairn_box_row *grown = realloc(*row, (size_t)(2 * room + 16) * sizeof *grown);

            if (grown == NULL)
                return cairn_file_error_system(r->error, r->path, "read", ENOMEM);
            *row = grown;
            room = 2 * room + 16;
        }
        status = take_row(r, &(*row)[*count]);
        if (status != CAIRN_OK)
            return status;
        (*count)++;
    }
    if (status == CAIRN_FULL)
        return bad(r, "a giant line, expected image,left,top,right,bottom");
    if (status != CAIRN_EMPTY)
        return status;
    return has_head ? CAIRN_OK
                    : cairn_file_error_set(r->error, CAIRN_EMPTY, r->path, 0,
                                           "nothing in it, expected image,left,top,right,bottom");
}

static int compare_rows(const void *a, const void *b)
{
    const cairn_box_row *x = a, *y = b;
    int order = strcmp(x->image, y->image);

    return order != 0 ? order : (x->line > y->line) - (x->line < y->line);
}

void cairn_box_table_sort(cairn_box_row *row, int32_t count)
{
    if (count > 1)
        qsort(row, (size_t)count, sizeof *row, compare_rows);
}

/* The first row whose name is not before this one, or, `behind`, is behind it. */
static int32_t bound_of(const cairn_box_row *row, int32_t count, const char *image, int behind)
{
    int32_t low = 0, high = count;

    while (low < high) {
        int32_t middle = low + (high - low) / 2;
        int order = strcmp(row[middle].image, image);

        if (order < 0 || (behind && order == 0))
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

int32_t cairn_box_table_find(const cairn_box_row *row, int32_t count, const char *image,
                             int32_t *own)
{
    int32_t first = bound_of(row, count, image, 0);

    *own = bound_of(row, count, image, 1) - first;
    return first;
}

cairn_status cairn_box_table_read(const char *path, cairn_box_row **row, int32_t *count,
                                  cairn_file_error *error)
{
    box_reader *r = malloc(sizeof *r);
    cairn_status status;

    *row = NULL;
    *count = 0;
    if (r == NULL)
        return cairn_file_error_system(error, path, "read", ENOMEM);
    r->path = path;
    r->error = error;
    status = cairn_line_reader_open(&r->lines, path, error);
    if (status == CAIRN_OK) {
        status = read_rows(r, row, count);
        cairn_line_reader_close(r->lines);
    }
    free(r);
    if (status != CAIRN_OK) {
        free(*row);
        *row = NULL;
        *count = 0;
    }
    return status;
}
