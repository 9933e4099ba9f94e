/* Poses as CSV. One table of columns serves writing, the header line and reading. */
#include "src/core/build.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/number_text.h"
#include "cairn/output.h"
#include "cairn/pose_table.h"
#include "src/host/carmen_log_reader.h"

enum {
    COLUMN_INDEX,
    COLUMN_LINE,
    COLUMN_TIME,
    COLUMN_X,
    COLUMN_Y,
    COLUMN_THETA,
    COLUMN_FIRST_COVARIANCE
};
enum { COLUMN_SUPPORT = 12, COLUMN_VERDICT = 13, COLUMNS = 14, COLUMNS_READ = 64, COVARIANCES = 6 };

static const char *const column_name[COLUMNS] = {
    "index", "line",      "time",   "x",          "y",          "theta",   "var_x",
    "var_y", "var_theta", "cov_xy", "cov_xtheta", "cov_ytheta", "support", "verdict"};

/* Element of the covariance behind each of its columns, and the one mirrored to it. */
static const int covariance_element[COVARIANCES] = {0, 4, 8, 1, 2, 5};
static const int covariance_mirror[COVARIANCES] = {0, 4, 8, 3, 6, 7};

cairn_pose_row cairn_pose_row_of(int64_t index, cairn_pose pose)
{
    cairn_pose_row row;
    int i;

    memset(&row, 0, sizeof row);
    row.index = index;
    row.stamp_ns = CAIRN_POSE_NO_STAMP;
    row.pose = pose;
    row.support = (cairn_real)NAN;
    for (i = 0; i < 9; i++)
        row.covariance[i] = (cairn_real)NAN;
    return row;
}

static int is_infinite(cairn_real x)
{
    return cairn_abs(x) > CAIRN_REAL_MAX;
}

static cairn_status check_row(const char *path, const cairn_pose_row *row, int64_t number,
                              cairn_file_error *error)
{
    int infinite = is_infinite(row->support), i;
    const char *c;

    for (i = 0; i < COVARIANCES; i++)
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

/* A number, or nothing for NaN. */
static void print_known(cairn_output *output, cairn_real value)
{
    char text[CAIRN_NUMBER_TEXT_BYTES];

    cairn_output_print(output, ",%s",
                       cairn_is_finite(value) ? cairn_number_write(text, value) : "");
}

static void print_row(cairn_output *output, const cairn_pose_row *row)
{
    char text[CAIRN_NUMBER_TEXT_BYTES];
    int i;

    cairn_output_print(output, "%lld,", (long long)row->index);
    if (row->line > 0)
        cairn_output_print(output, "%lld", (long long)row->line);
    cairn_output_print(
        output, ",%s",
        row->stamp_ns != CAIRN_POSE_NO_STAMP ? cairn_number_write_stamp(text, row->stamp_ns) : "");
    print_known(output, row->pose.x);
    print_known(output, row->pose.y);
    print_known(output, row->pose.theta);
    for (i = 0; i < COVARIANCES; i++)
        print_known(output, row->covariance[covariance_element[i]]);
    print_known(output, row->support);
    cairn_output_print(output, ",%s\n", row->verdict);
}

cairn_status cairn_pose_table_write(const char *path, const cairn_pose_row *row, int32_t count,
                                    cairn_file_error *error)
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
    for (i = 0; i < COLUMNS; i++)
        cairn_output_print(output, "%s%s", i > 0 ? "," : "", column_name[i]);
    cairn_output_print(output, "\n");
    for (i = 0; i < count; i++)
        print_row(output, &row[i]);
    return cairn_output_commit(output, error);
}

typedef struct field {
    const char *text;
    size_t length;
} field;

/* Cuts a line at its commas, blanks around the fields off. The number of fields, at most
 * COLUMNS_READ + 1. */
static int32_t split(const char *line, size_t length, field fields[COLUMNS_READ + 1])
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
        if (comma == NULL || count > COLUMNS_READ)
            return count;
        line = comma + 1;
    }
}

/* What a table is read with. */
typedef struct table_reader {
    cairn_line_reader *lines;
    const char *path;
    int32_t column[COLUMNS_READ]; /* field -> column, -1: none of ours */
    int32_t columns;
    cairn_file_error *error;
} table_reader;

static cairn_status read_header(table_reader *t, const char *line, size_t length)
{
    int64_t number = cairn_line_reader_number(t->lines);
    int32_t seen[COLUMNS] = {0}, i, k;
    char shown[CAIRN_TOKEN_TEXT_BYTES];
    field fields[COLUMNS_READ + 1];

    t->columns = split(line, length, fields);
    if (t->columns > COLUMNS_READ)
        return cairn_file_error_set(t->error, CAIRN_BAD_FORMAT, t->path, number,
                                    "more than %d columns, expected the header of a table of poses",
                                    COLUMNS_READ);
    for (i = 0; i < t->columns; i++) {
        t->column[i] = -1;
        for (k = 0; k < COLUMNS; k++)
            if (fields[i].length == strlen(column_name[k]) &&
                memcmp(fields[i].text, column_name[k], fields[i].length) == 0)
                t->column[i] = k;
        if (t->column[i] >= 0 && seen[t->column[i]]++)
            return cairn_file_error_set(t->error, CAIRN_BAD_FORMAT, t->path, number,
                                        "column %s is there twice, expected it once",
                                        cairn_token_text(shown, fields[i].text, fields[i].length));
    }
    for (k = 0; k < COLUMNS; k++)
        if (!seen[k] && (k == COLUMN_INDEX || k == COLUMN_X || k == COLUMN_Y || k == COLUMN_THETA))
            return cairn_file_error_set(
                t->error, CAIRN_BAD_FORMAT, t->path, number,
                "no column \"%s\", expected a header with index, x, y and theta", column_name[k]);
    return CAIRN_OK;
}

static cairn_status bad_field(const table_reader *t, int32_t column, field f, const char *wanted)
{
    char shown[CAIRN_TOKEN_TEXT_BYTES];

    return cairn_file_error_set(t->error, CAIRN_BAD_FORMAT, t->path,
                                cairn_line_reader_number(t->lines), "%s is %s, expected %s",
                                column_name[column], cairn_token_text(shown, f.text, f.length),
                                wanted);
}

static cairn_status read_real(const table_reader *t, int32_t column, field f, cairn_real *value)
{
    double number;

    if (!cairn_number_read(f.text, f.length, &number))
        return bad_field(t, column, f, "a number");
    if (!cairn_is_finite((cairn_real)number))
        return cairn_file_error_set(
            t->error, CAIRN_NOT_FINITE, t->path, cairn_line_reader_number(t->lines),
            "%s is %g, expected a finite number", column_name[column], number);
    *value = (cairn_real)number;
    return CAIRN_OK;
}

static cairn_status read_field(const table_reader *t, int32_t column, field f, cairn_pose_row *row)
{
    cairn_real *place;

    if (f.length == 0) {
        if (column == COLUMN_INDEX || column == COLUMN_X || column == COLUMN_Y ||
            column == COLUMN_THETA)
            return bad_field(t, column, f, "a number");
        return CAIRN_OK;
    }
    switch (column) {
    case COLUMN_INDEX:
        return cairn_number_read_integer(f.text, f.length, &row->index)
                   ? CAIRN_OK
                   : bad_field(t, column, f, "a whole number");
    case COLUMN_LINE:
        return cairn_number_read_integer(f.text, f.length, &row->line) && row->line >= 0
                   ? CAIRN_OK
                   : bad_field(t, column, f, "a whole number from 0");
    case COLUMN_TIME:
        return cairn_number_read_stamp(f.text, f.length, &row->stamp_ns)
                   ? CAIRN_OK
                   : bad_field(t, column, f, "seconds");
    case COLUMN_VERDICT:
        if (f.length >= sizeof row->verdict)
            return bad_field(t, column, f, "at most 31 bytes");
        memcpy(row->verdict, f.text, f.length);
        return CAIRN_OK;
    case COLUMN_X:
        place = &row->pose.x;
        break;
    case COLUMN_Y:
        place = &row->pose.y;
        break;
    case COLUMN_THETA:
        place = &row->pose.theta;
        break;
    case COLUMN_SUPPORT:
        place = &row->support;
        break;
    default:
        place = &row->covariance[covariance_element[column - COLUMN_FIRST_COVARIANCE]];
        break;
    }
    return read_real(t, column, f, place);
}

static cairn_status read_row(const table_reader *t, const char *line, size_t length,
                             cairn_pose_row *row)
{
    field fields[COLUMNS_READ + 1];
    int32_t count = split(line, length, fields), i;
    cairn_status status;

    if (count != t->columns)
        return cairn_file_error_set(
            t->error, count < t->columns ? CAIRN_TRUNCATED : CAIRN_BAD_FORMAT, t->path,
            cairn_line_reader_number(t->lines), "%s%d fields, expected %d as in the header",
            count > COLUMNS_READ ? "more than " : "",
            (int)(count > COLUMNS_READ ? COLUMNS_READ : count), (int)t->columns);
    *row = cairn_pose_row_of(0, cairn_pose_identity());
    for (i = 0; i < count; i++) {
        if (t->column[i] < 0)
            continue;
        status = read_field(t, t->column[i], fields[i], row);
        if (status != CAIRN_OK)
            return status;
    }
    for (i = 0; i < COVARIANCES; i++)
        row->covariance[covariance_mirror[i]] = row->covariance[covariance_element[i]];
    return CAIRN_OK;
}

/* Appends to an array that doubles. */
static cairn_status append(table_reader *t, cairn_pose_row **rows, int32_t *count,
                           int32_t *capacity, const cairn_pose_row *row)
{
    int32_t more = *capacity == 0 ? 256 : *capacity < INT32_MAX / 2 ? 2 * *capacity : INT32_MAX;
    cairn_pose_row *grown;

    if (*count == *capacity) {
        grown = *count < INT32_MAX ? realloc(*rows, (size_t)more * sizeof *grown) : NULL;
        if (grown == NULL)
            return cairn_file_error_system(t->error, t->path, "read", ENOMEM);
        *rows = grown;
        *capacity = more;
    }
    (*rows)[(*count)++] = *row;
    return CAIRN_OK;
}

cairn_status cairn_pose_table_read(cairn_pose_row **row, int32_t *count, const char *path,
                                   cairn_file_error *error)
{
    table_reader t = {NULL, path, {0}, 0, error};
    int32_t capacity = 0;
    cairn_pose_row one;
    cairn_status status;
    const char *line;
    size_t length;

    *row = NULL;
    *count = 0;
    status = cairn_line_reader_open(&t.lines, path, error);
    if (status != CAIRN_OK)
        return status;
    while ((status = cairn_line_reader_next(t.lines, &line, &length, error)) == CAIRN_OK) {
        if (length == 0 || line[0] == '#')
            continue;
        if (t.columns == 0) {
            status = read_header(&t, line, length);
        } else {
            status = read_row(&t, line, length, &one);
            if (status == CAIRN_OK)
                status = append(&t, row, count, &capacity, &one);
        }
        if (status != CAIRN_OK)
            break;
    }
    if (status == CAIRN_FULL)
        status =
            cairn_file_error_set(error, CAIRN_BAD_FORMAT, path, cairn_line_reader_number(t.lines),
                                 "a line of %zu bytes, expected a table of poses", length);
    if (status == CAIRN_EMPTY && *count > 0)
        status = CAIRN_OK;
    else if (status == CAIRN_EMPTY)
        status = cairn_file_error_set(error, status, path, 0,
                                      "no row, expected a header and rows of poses");
    cairn_line_reader_close(t.lines);
    if (status != CAIRN_OK) {
        free(*row);
        *row = NULL;
        *count = 0;
    }
    return status;
}

void cairn_pose_table_free(cairn_pose_row *row)
{
    free(row);
}
