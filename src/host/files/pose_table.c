/* Trajectories as CSV. One table of column names serves writing and reading. */
#include "src/base/build.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/number_text.h"
#include "cairn/output.h"
#include "cairn/pose_table.h"
#include "src/host/logs/carmen_log_reader.h"

enum {
    COLUMN_INDEX,
    COLUMN_LINE,
    COLUMN_TIME,
    COLUMN_X,
    COLUMN_Y,
    COLUMN_THETA,
    COLUMN_FIRST_COVARIANCE
};
/* MAX_COLUMNS: columns of a table that is read, unknown ones included. */
enum {
    COLUMN_SUPPORT = 12,
    COLUMN_VERDICT = 13,
    COLUMN_MAP_SIGMA = 14,
    COLUMN_COUNT = 15,
    MAX_COLUMNS = 64,
    COVARIANCE_COUNT = 6
};

static const char *const column_name[COLUMN_COUNT] = {
    "index",     "line",   "time",       "x",          "y",       "theta",   "var_x",    "var_y",
    "var_theta", "cov_xy", "cov_xtheta", "cov_ytheta", "support", "verdict", "map_sigma"};

/* Covariance element of each covariance column, and its symmetric counterpart. */
static const int covariance_element[COVARIANCE_COUNT] = {0, 4, 8, 1, 2, 5};
static const int covariance_mirror[COVARIANCE_COUNT] = {0, 4, 8, 3, 6, 7};

cairn_pose_table_row cairn_pose_table_row_of(int64_t index, cairn_pose pose)
{
    cairn_pose_table_row row;
    int i;

    memset(&row, 0, sizeof row);
    row.index = index;
    row.stamp_ns = CAIRN_POSE_TABLE_NO_STAMP;
    row.pose = pose;
    row.support = row.map_sigma = (cairn_real)NAN;
    for (i = 0; i < 9; i++)
        row.covariance[i] = (cairn_real)NAN;
    return row;
}

static int is_infinite(cairn_real value)
{
    return cairn_abs(value) > CAIRN_REAL_MAX;
}

/* Validates a row before it is written. */
static cairn_status check_row(const char *path, const cairn_pose_table_row *row, int64_t number,
                              cairn_file_error *error)
{
    int infinite = is_infinite(row->support) || is_infinite(row->map_sigma), i;
    const char *c;

    for (i = 0; i < COVARIANCE_COUNT; i++)
        infinite |= is_infinite(row->covariance[covariance_element[i]]);
    if (infinite || !cairn_pose_is_finite(row->pose))
        return cairn_file_error_set(error, CAIRN_NOT_FINITE, path, number,
                                    "a row with a number that is not finite, expected finite ones");
    if (memchr(row->verdict, 0, sizeof row->verdict) == NULL)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, number,
                                    "a verdict without an end");
    for (c = row->verdict; *c != 0; c++)
        if (*c == ',' || *c == '"' || (unsigned char)*c < ' ')
            return cairn_file_error_set(
                error, CAIRN_BAD_ARGUMENT, path, number,
                "a verdict with a comma, quote or control character, expected a word");
    return CAIRN_OK;
}

/* Prints a number; NaN becomes an empty field. */
static void print_optional(cairn_output *output, cairn_real value)
{
    char text[CAIRN_NUMBER_TEXT_BYTES];

    cairn_output_print(output, ",%s",
                       cairn_is_finite(value) ? cairn_number_write(text, value) : "");
}

static void print_row(cairn_output *output, const cairn_pose_table_row *row)
{
    char text[CAIRN_NUMBER_TEXT_BYTES];
    int i;

    cairn_output_print(output, "%lld,", (long long)row->index);
    if (row->line > 0)
        cairn_output_print(output, "%lld", (long long)row->line);
    cairn_output_print(output, ",%s",
                       row->stamp_ns != CAIRN_POSE_TABLE_NO_STAMP
                           ? cairn_number_write_stamp(text, row->stamp_ns)
                           : "");
    print_optional(output, row->pose.x);
    print_optional(output, row->pose.y);
    print_optional(output, row->pose.theta);
    for (i = 0; i < COVARIANCE_COUNT; i++)
        print_optional(output, row->covariance[covariance_element[i]]);
    print_optional(output, row->support);
    cairn_output_print(output, ",%s", row->verdict);
    print_optional(output, row->map_sigma);
    cairn_output_print(output, "\n");
}

cairn_status cairn_pose_table_write(const char *path, const cairn_pose_table_row *row,
                                    int32_t count, cairn_file_error *error)
{
    cairn_output *output;
    cairn_status status;
    int32_t i;

    for (i = 0; i < count; i++) {
        status = check_row(path, &row[i], i + 1, error);
        if (status != CAIRN_OK)
            return status;
    }
    status = cairn_output_open(&output, path, error);
    if (status != CAIRN_OK)
        return status;
    for (i = 0; i < COLUMN_COUNT; i++)
        cairn_output_print(output, "%s%s", i > 0 ? "," : "", column_name[i]);
    cairn_output_print(output, "\n");
    for (i = 0; i < count; i++)
        print_row(output, &row[i]);
    return cairn_output_commit(output, error);
}

/* A field of a line, without surrounding blanks. */
typedef struct csv_field {
    const char *text;
    size_t length;
} csv_field;

/* Splits a line at its commas, trims blanks, and returns the number of fields, at most MAX_COLUMNS
 * + 1. */
static int32_t split(const char *line, size_t length, csv_field fields[MAX_COLUMNS + 1])
{
    const char *end = line + length, *comma, *last;
    int32_t count = 0;

    for (;;) {
        comma = memchr(line, ',', (size_t)(end - line));
        last = comma != NULL ? comma : end;
        while (line < last && (*line == ' ' || *line == '\t'))
            line++;
        fields[count].text = line;
        fields[count].length = (size_t)(last - line);
        while (fields[count].length > 0 &&
               (line[fields[count].length - 1] == ' ' || line[fields[count].length - 1] == '\t'))
            fields[count].length--;
        count++;
        if (comma == NULL || count > MAX_COLUMNS)
            return count;
        line = comma + 1;
    }
}

/* State of the reader. */
typedef struct table_reader {
    cairn_line_reader *lines;
    const char *path;
    int32_t column[MAX_COLUMNS]; /* column of each field; -1: unknown */
    int32_t columns;             /* fields of the header */
    cairn_file_error *error;
} table_reader;

/* Maps the fields of the header line to columns. */
static cairn_status read_header(table_reader *reader, const char *line, size_t length)
{
    int64_t number = cairn_line_reader_number(reader->lines);
    int32_t seen[COLUMN_COUNT] = {0}, i, k;
    char shown[CAIRN_TOKEN_TEXT_BYTES];
    csv_field fields[MAX_COLUMNS + 1];

    reader->columns = split(line, length, fields);
    if (reader->columns > MAX_COLUMNS)
        return cairn_file_error_set(reader->error, CAIRN_BAD_FORMAT, reader->path, number,
                                    "more than %d columns, expected the header of a table of poses",
                                    MAX_COLUMNS);
    for (i = 0; i < reader->columns; i++) {
        reader->column[i] = -1;
        for (k = 0; k < COLUMN_COUNT; k++)
            if (fields[i].length == strlen(column_name[k]) &&
                memcmp(fields[i].text, column_name[k], fields[i].length) == 0)
                reader->column[i] = k;
        if (reader->column[i] >= 0 && seen[reader->column[i]]++)
            return cairn_file_error_set(reader->error, CAIRN_BAD_FORMAT, reader->path, number,
                                        "column %s is there twice, expected it once",
                                        cairn_token_text(shown, fields[i].text, fields[i].length));
    }
    for (k = 0; k < COLUMN_COUNT; k++)
        if (!seen[k] && (k == COLUMN_INDEX || k == COLUMN_X || k == COLUMN_Y || k == COLUMN_THETA))
            return cairn_file_error_set(
                reader->error, CAIRN_BAD_FORMAT, reader->path, number,
                "no column \"%s\", expected a header with index, x, y and theta", column_name[k]);
    return CAIRN_OK;
}

static cairn_status bad_field(const table_reader *reader, int32_t column, csv_field field,
                              const char *expected)
{
    char shown[CAIRN_TOKEN_TEXT_BYTES];

    return cairn_file_error_set(reader->error, CAIRN_BAD_FORMAT, reader->path,
                                cairn_line_reader_number(reader->lines), "%s is %s, expected %s",
                                column_name[column],
                                cairn_token_text(shown, field.text, field.length), expected);
}

static cairn_status read_real(const table_reader *reader, int32_t column, csv_field field,
                              cairn_real *value)
{
    double number;

    if (!cairn_number_read(field.text, field.length, &number))
        return bad_field(reader, column, field, "a number");
    if (!cairn_is_finite((cairn_real)number))
        return cairn_file_error_set(
            reader->error, CAIRN_NOT_FINITE, reader->path, cairn_line_reader_number(reader->lines),
            "%s is %g, expected a finite number", column_name[column], number);
    *value = (cairn_real)number;
    return CAIRN_OK;
}

/* Parses one field into the row. */
static cairn_status read_field(const table_reader *reader, int32_t column, csv_field field,
                               cairn_pose_table_row *row)
{
    cairn_real *target;

    if (field.length == 0) {
        if (column == COLUMN_INDEX || column == COLUMN_X || column == COLUMN_Y ||
            column == COLUMN_THETA)
            return bad_field(reader, column, field, "a number");
        return CAIRN_OK;
    }
    switch (column) {
    case COLUMN_INDEX:
        return cairn_number_read_integer(field.text, field.length, &row->index)
                   ? CAIRN_OK
                   : bad_field(reader, column, field, "a whole number");
    case COLUMN_LINE:
        return cairn_number_read_integer(field.text, field.length, &row->line) && row->line >= 0
                   ? CAIRN_OK
                   : bad_field(reader, column, field, "a whole number from 0");
    case COLUMN_TIME:
        return cairn_number_read_stamp(field.text, field.length, &row->stamp_ns)
                   ? CAIRN_OK
                   : bad_field(reader, column, field, "seconds");
    case COLUMN_VERDICT:
        if (field.length >= sizeof row->verdict)
            return bad_field(reader, column, field, "at most 31 bytes");
        memcpy(row->verdict, field.text, field.length);
        return CAIRN_OK;
    case COLUMN_X:
        target = &row->pose.x;
        break;
    case COLUMN_Y:
        target = &row->pose.y;
        break;
    case COLUMN_THETA:
        target = &row->pose.theta;
        break;
    case COLUMN_SUPPORT:
        target = &row->support;
        break;
    case COLUMN_MAP_SIGMA:
        target = &row->map_sigma;
        break;
    default:
        target = &row->covariance[covariance_element[column - COLUMN_FIRST_COVARIANCE]];
        break;
    }
    return read_real(reader, column, field, target);
}

/* Parses one line into a row; unknown fields keep their defaults. */
static cairn_status read_row(const table_reader *reader, const char *line, size_t length,
                             cairn_pose_table_row *row)
{
    csv_field fields[MAX_COLUMNS + 1];
    int32_t count = split(line, length, fields), i;
    cairn_status status;

    if (count != reader->columns)
        return cairn_file_error_set(
            reader->error, count < reader->columns ? CAIRN_TRUNCATED : CAIRN_BAD_FORMAT,
            reader->path, cairn_line_reader_number(reader->lines),
            "%s%d fields, expected %d as in the header", count > MAX_COLUMNS ? "more than " : "",
            (int)(count > MAX_COLUMNS ? MAX_COLUMNS : count), (int)reader->columns);
    *row = cairn_pose_table_row_of(0, cairn_pose_identity());
    for (i = 0; i < count; i++) {
        if (reader->column[i] < 0)
            continue;
        status = read_field(reader, reader->column[i], fields[i], row);
        if (status != CAIRN_OK)
            return status;
    }
    for (i = 0; i < COVARIANCE_COUNT; i++)
        row->covariance[covariance_mirror[i]] = row->covariance[covariance_element[i]];
    return CAIRN_OK;
}

/* Appends to a dynamic array, whose capacity doubles. */
static cairn_status append(table_reader *reader, cairn_pose_table_row **rows, int32_t *count,
                           int32_t *capacity, const cairn_pose_table_row *row)
{
    int32_t new_capacity = *capacity == 0              ? 256
                           : *capacity < INT32_MAX / 2 ? 2 * *capacity
                                                       : INT32_MAX;
    cairn_pose_table_row *grown;

    if (*count == *capacity) {
        grown = *count < INT32_MAX ? realloc(*rows, (size_t)new_capacity * sizeof *grown) : NULL;
        if (grown == NULL)
            return cairn_file_error_system(reader->error, reader->path, "read", ENOMEM);
        *rows = grown;
        *capacity = new_capacity;
    }
    (*rows)[(*count)++] = *row;
    return CAIRN_OK;
}

cairn_status cairn_pose_table_read(cairn_pose_table_row **row, int32_t *count, const char *path,
                                   cairn_file_error *error)
{
    table_reader reader = {.path = path, .error = error};
    int32_t capacity = 0;
    cairn_pose_table_row parsed;
    cairn_status status;
    const char *line;
    size_t length;

    *row = NULL;
    *count = 0;
    status = cairn_line_reader_open(&reader.lines, path, error);
    if (status != CAIRN_OK)
        return status;
    while ((status = cairn_line_reader_next(reader.lines, &line, &length, error)) == CAIRN_OK) {
        if (length == 0 || line[0] == '#')
            continue;
        if (reader.columns == 0) {
            status = read_header(&reader, line, length);
        } else {
            status = read_row(&reader, line, length, &parsed);
            if (status == CAIRN_OK)
                status = append(&reader, row, count, &capacity, &parsed);
        }
        if (status != CAIRN_OK)
            break;
    }
    if (status == CAIRN_FULL)
        status = cairn_file_error_set(error, CAIRN_BAD_FORMAT, path,
                                      cairn_line_reader_number(reader.lines),
                                      "a line of %zu bytes, expected a table of poses", length);
    if (status == CAIRN_EMPTY && *count > 0)
        status = CAIRN_OK;
    else if (status == CAIRN_EMPTY)
        status = cairn_file_error_set(error, status, path, 0,
                                      "no row, expected a header and rows of poses");
    cairn_line_reader_close(reader.lines);
    if (status != CAIRN_OK) {
        free(*row);
        *row = NULL;
        *count = 0;
    }
    return status;
}

void cairn_pose_table_free(cairn_pose_table_row *row)
{
    free(row);
}
