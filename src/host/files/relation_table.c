/* Reader of reference relations. Times are integers in nanoseconds. Scans are found by binary
 * search in the sorted stamps. */
#include "src/base/build.h"

#include <errno.h>
#include <stdlib.h>

#include "cairn/number_text.h"
#include "cairn/pose_table.h"
#include "cairn/relation_table.h"
#include "cairn/scan.h"
#include "src/host/logs/carmen_log_reader.h"

/* Words of the two kinds of lines; least tolerance of a time in ns. */
enum { TIMED_WORDS = 8, INDEXED_WORDS = 5, MIN_TOLERANCE_NS = 1000 };

typedef struct word {
    const char *text;
    size_t length;
} word;

/* Location of the line being read, for errors. */
typedef struct location {
    const char *path;
    int64_t line;
    cairn_file_error *error;
} location;

static cairn_status bad_word(const location *where, word token, const char *expected)
{
    char shown[CAIRN_TOKEN_TEXT_BYTES];

    return cairn_file_error_set(where->error, CAIRN_BAD_FORMAT, where->path, where->line,
                                "%s, expected %s",
                                cairn_token_text(shown, token.text, token.length), expected);
}

static cairn_status read_real(const location *where, word token, cairn_real *value)
{
    char shown[CAIRN_TOKEN_TEXT_BYTES];
    double number;

    if (!cairn_number_read(token.text, token.length, &number))
        return bad_word(where, token, "a number");
    *value = (cairn_real)number;
    if (!cairn_is_finite(*value))
        return cairn_file_error_set(where->error, CAIRN_NOT_FINITE, where->path, where->line,
                                    "%s, expected a finite number",
                                    cairn_token_text(shown, token.text, token.length));
    return CAIRN_OK;
}

/* Parses a time or a scan's index. */
static cairn_status read_endpoint(const location *where, word token, int32_t timed, int64_t *end)
{
    if (timed)
        return cairn_number_read_stamp(token.text, token.length, end)
                   ? CAIRN_OK
                   : bad_word(where, token, "a time in seconds");
    return cairn_number_read_integer(token.text, token.length, end) && *end >= 0
               ? CAIRN_OK
               : bad_word(where, token, "the index of a scan");
}

/* Parses one line. */
static cairn_status read_row(const location *where, const char *line, size_t length,
                             cairn_relation_table_row *row)
{
    const char *end = line + length;
    word words[TIMED_WORDS + 1];
    cairn_real unused;
    int32_t count = 0;
    cairn_status status;

    while (count <= TIMED_WORDS &&
           (words[count].length = cairn_token_next(&line, end, &words[count].text)) > 0)
        count++;
    if (count != TIMED_WORDS && count != INDEXED_WORDS)
        return cairn_file_error_set(
            where->error, CAIRN_BAD_FORMAT, where->path, where->line,
            "%d words, expected t1 t2 x y z roll pitch yaw, or a b x y theta", (int)count);
    row->line = where->line;
    row->timed = count == TIMED_WORDS;
    status = read_endpoint(where, words[0], row->timed, &row->first);
    if (status == CAIRN_OK)
        status = read_endpoint(where, words[1], row->timed, &row->second);
    if (status == CAIRN_OK)
        status = read_real(where, words[2], &row->reference.x);
    if (status == CAIRN_OK)
        status = read_real(where, words[3], &row->reference.y);
    for (int32_t k = 4; k < count && status == CAIRN_OK; k++)
        status = read_real(where, words[k], k == count - 1 ? &row->reference.theta : &unused);
    return status;
}

/* Appends to a dynamic array, whose capacity doubles. */
static cairn_status append(const location *where, cairn_relation_table_row **rows, int32_t *count,
                           int32_t *capacity, const cairn_relation_table_row *row)
{
    if (*count == *capacity) {
        int32_t new_capacity = *capacity == 0              ? 256
                               : *capacity < INT32_MAX / 2 ? 2 * *capacity
                                                           : INT32_MAX;
        cairn_relation_table_row *grown =
            *count < INT32_MAX ? realloc(*rows, (size_t)new_capacity * sizeof *grown) : NULL;

        if (grown == NULL)
            return cairn_file_error_system(where->error, where->path, "read", ENOMEM);
        *rows = grown;
        *capacity = new_capacity;
    }
    (*rows)[(*count)++] = *row;
    return CAIRN_OK;
}

cairn_status cairn_relation_table_read(cairn_relation_table_row **row, int32_t *count,
                                       const char *path, cairn_file_error *error)
{
    location where = {.path = path, .error = error};
    cairn_line_reader *lines;
    cairn_relation_table_row parsed;
    int32_t capacity = 0;
    cairn_status status;
    const char *line;
    size_t length;

    *row = NULL;
    *count = 0;
    status = cairn_line_reader_open(&lines, path, error);
    if (status != CAIRN_OK)
        return status;
    while ((status = cairn_line_reader_next(lines, &line, &length, error)) == CAIRN_OK) {
        const char *at = line, *token;

        if (cairn_token_next(&at, line + length, &token) == 0 || *token == '#')
            continue;
        where.line = cairn_line_reader_number(lines);
        status = read_row(&where, line, length, &parsed);
        if (status == CAIRN_OK)
            status = append(&where, row, count, &capacity, &parsed);
        if (status != CAIRN_OK)
            break;
    }
    if (status == CAIRN_FULL)
        status =
            cairn_file_error_set(error, CAIRN_BAD_FORMAT, path, cairn_line_reader_number(lines),
                                 "a line of %zu bytes, expected relations", length);
    if (status == CAIRN_EMPTY && *count > 0)
        status = CAIRN_OK;
    else if (status == CAIRN_EMPTY)
        status = cairn_file_error_set(error, status, path, 0,
                                      "no relation, expected lines t1 t2 x y z roll pitch yaw");
    cairn_line_reader_close(lines);
    if (status != CAIRN_OK) {
        free(*row);
        *row = NULL;
        *count = 0;
    }
    return status;
}

void cairn_relation_table_free(cairn_relation_table_row *row)
{
    free(row);
}

/* ---- Scans by time ---- */

typedef struct stamped {
    int64_t stamp_ns;
    int32_t scan;
} stamped;

static int compare_stamped(const void *a, const void *b)
{
    const stamped *first = a, *second = b;

    if (first->stamp_ns != second->stamp_ns)
        return first->stamp_ns < second->stamp_ns ? -1 : 1;
    return (first->scan > second->scan) - (first->scan < second->scan);
}

/* Returns the time between two stamps in ns. */
static int64_t time_between(int64_t a, int64_t b)
{
    return a > b ? cairn_time_difference(a, b) : cairn_time_difference(b, a);
}

static int compare_durations(const void *a, const void *b)
{
    const int64_t *first = a, *second = b;

    return (*first > *second) - (*first < *second);
}

/* Returns half the scan period, the median time from a scan to the next that has another stamp;
 * scans without a stamp between them are counted, too. duration: [scans], overwritten. */
static int64_t tolerance_of(const int64_t *stamp_ns, int32_t scans, int64_t *duration)
{
    int32_t count = 0, last = -1;
    int64_t half;

    for (int32_t i = 0; i < scans; i++) {
        if (stamp_ns[i] == CAIRN_POSE_TABLE_NO_STAMP)
            continue;
        if (last >= 0 && stamp_ns[i] != stamp_ns[last])
            duration[count++] = time_between(stamp_ns[i], stamp_ns[last]) / (i - last);
        last = i;
    }
    if (count == 0)
        return MIN_TOLERANCE_NS;
    qsort(duration, (size_t)count, sizeof *duration, compare_durations);
    half = duration[count / 2] / 2;
    return half > MIN_TOLERANCE_NS ? half : MIN_TOLERANCE_NS;
}

/* Returns the scan with the nearest stamp within the tolerance, the first of equals; -1: none. */
static int64_t find_scan(const stamped *table, int32_t count, int64_t tolerance_ns,
                         int64_t stamp_ns)
{
    int32_t low = 0, high = count, best;

    while (low < high) {
        int32_t middle = low + (high - low) / 2;

        if (table[middle].stamp_ns < stamp_ns)
            low = middle + 1;
        else
            high = middle;
    }
    best = low;
    if (low > 0 && (low == count || time_between(table[low - 1].stamp_ns, stamp_ns) <=
                                        time_between(table[low].stamp_ns, stamp_ns)))
        best = low - 1;
    while (best > 0 && table[best - 1].stamp_ns == table[best].stamp_ns)
        best--;
    return count > 0 && time_between(table[best].stamp_ns, stamp_ns) <= tolerance_ns
               ? table[best].scan
               : -1;
}

int32_t cairn_relation_table_find(cairn_relation_table_row *row, int32_t count,
                                  const int64_t *stamp_ns, int32_t scans)
{
    stamped *table = malloc(((size_t)scans + 1) * sizeof *table);
    int64_t *duration = malloc(((size_t)scans + 1) * sizeof *duration), tolerance_ns;
    int32_t found = 0, stamps = 0;

    if (table == NULL || duration == NULL) {
        free(table);
        free(duration);
        return -1;
    }
    tolerance_ns = tolerance_of(stamp_ns, scans, duration);
    free(duration);
    for (int32_t i = 0; i < scans; i++) {
        table[stamps].stamp_ns = stamp_ns[i];
        table[stamps].scan = i;
        stamps += stamp_ns[i] != CAIRN_POSE_TABLE_NO_STAMP;
    }
    qsort(table, (size_t)stamps, sizeof *table, compare_stamped);
    for (int32_t k = 0; k < count; k++) {
        cairn_relation_table_row *relation = &row[k];

        if (relation->timed) {
            relation->first = find_scan(table, stamps, tolerance_ns, relation->first);
            relation->second = find_scan(table, stamps, tolerance_ns, relation->second);
        }
        if (relation->first >= scans || relation->second >= scans)
            relation->first = -1;
        if (relation->first < 0 || relation->second < 0)
            relation->first = relation->second = -1;
        found += relation->first >= 0;
        relation->timed = 0;
    }
    free(table);
    return found;
}
