/* Relations from text. Times are kept as whole nanoseconds; scans are found among the sorted
 * stamps. */
#include "src/core/build.h"

#include <errno.h>
#include <stdlib.h>

#include "cairn/number_text.h"
#include "cairn/relation_table.h"
#include "src/host/carmen_log_reader.h"

enum { WORDS_TIMED = 8, WORDS_INDEXED = 5, MICROSECOND = 1000 };

typedef struct word {
    const char *text;
    size_t length;
} word;

/* Where a relation is being read. */
typedef struct place {
    const char *path;
    int64_t line;
    cairn_file_error *error;
} place;

static cairn_status bad_word(const place *p, word w, const char *wanted)
{
    char shown[CAIRN_TOKEN_TEXT_BYTES];

    return cairn_file_error_set(p->error, CAIRN_BAD_FORMAT, p->path, p->line, "%s, expected %s",
                                cairn_token_text(shown, w.text, w.length), wanted);
}

static cairn_status read_real(const place *p, word w, cairn_real *value)
{
    char shown[CAIRN_TOKEN_TEXT_BYTES];
    double number;

    if (!cairn_number_read(w.text, w.length, &number))
        return bad_word(p, w, "a number");
    *value = (cairn_real)number;
    if (!cairn_is_finite(*value))
        return cairn_file_error_set(p->error, CAIRN_NOT_FINITE, p->path, p->line,
                                    "%s, expected a finite number",
                                    cairn_token_text(shown, w.text, w.length));
    return CAIRN_OK;
}

static cairn_status read_end(const place *p, word w, int32_t timed, int64_t *end)
{
    if (timed)
        return cairn_number_read_stamp(w.text, w.length, end) ? CAIRN_OK
                                                              : bad_word(p, w, "a time in seconds");
    return cairn_number_read_integer(w.text, w.length, end) && *end >= 0
               ? CAIRN_OK
               : bad_word(p, w, "the index of a scan");
}

static cairn_status read_row(const place *p, const char *line, size_t length,
                             cairn_relation_row *row)
{
    const char *end = line + length;
    word words[WORDS_TIMED + 1];
    cairn_real unused;
    int32_t count = 0;
    cairn_status status;

    while (count <= WORDS_TIMED &&
           (words[count].length = cairn_token_next(&line, end, &words[count].text)) > 0)
        count++;
    if (count != WORDS_TIMED && count != WORDS_INDEXED)
        return cairn_file_error_set(
            p->error, CAIRN_BAD_FORMAT, p->path, p->line,
            "%d words, expected t1 t2 x y z roll pitch yaw, or a b x y theta", (int)count);
    row->line = p->line;
    row->timed = count == WORDS_TIMED;
    status = read_end(p, words[0], row->timed, &row->first);
    if (status == CAIRN_OK)
        status = read_end(p, words[1], row->timed, &row->second);
    if (status == CAIRN_OK)
        status = read_real(p, words[2], &row->reference.x);
    if (status == CAIRN_OK)
        status = read_real(p, words[3], &row->reference.y);
    for (int32_t k = 4; k < count && status == CAIRN_OK; k++)
        status = read_real(p, words[k], k == count - 1 ? &row->reference.theta : &unused);
    return status;
}

/* Appends to an array that doubles. */
static cairn_status append(const place *p, cairn_relation_row **rows, int32_t *count,
                           int32_t *capacity, const cairn_relation_row *row)
{
    if (*count == *capacity) {
        int32_t more = *capacity == 0 ? 256 : *capacity < INT32_MAX / 2 ? 2 * *capacity : INT32_MAX;
        cairn_relation_row *grown =
            *count < INT32_MAX ? realloc(*rows, (size_t)more * sizeof *grown) : NULL;

        if (grown == NULL)
            return cairn_file_error_system(p->error, p->path, "read", ENOMEM);
        *rows = grown;
        *capacity = more;
    }
    (*rows)[(*count)++] = *row;
    return CAIRN_OK;
}

cairn_status cairn_relation_table_read(cairn_relation_row **row, int32_t *count, const char *path,
                                       cairn_file_error *error)
{
    place p = {.path = path, .error = error};
    cairn_line_reader *lines;
    cairn_relation_row one;
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
        p.line = cairn_line_reader_number(lines);
        status = read_row(&p, line, length, &one);
        if (status == CAIRN_OK)
            status = append(&p, row, count, &capacity, &one);
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

void cairn_relation_table_free(cairn_relation_row *row)
{
    free(row);
}

/* ---- Scans by their time ---- */

typedef struct stamped {
    int64_t stamp_ns;
    int32_t scan;
} stamped;

static int compare_stamped(const void *a, const void *b)
{
    const stamped *x = a, *y = b;

    if (x->stamp_ns != y->stamp_ns)
        return x->stamp_ns < y->stamp_ns ? -1 : 1;
    return (x->scan > y->scan) - (x->scan < y->scan);
}

/* How far apart two stamps are, in ns; no difference overflows. */
static uint64_t gap(int64_t a, int64_t b)
{
    return a > b ? (uint64_t)a - (uint64_t)b : (uint64_t)b - (uint64_t)a;
}

static int64_t find(const stamped *table, int32_t count, int64_t stamp_ns)
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
    if (low > 0 && (low == count ||
                    gap(table[low - 1].stamp_ns, stamp_ns) <= gap(table[low].stamp_ns, stamp_ns)))
        best = low - 1;
    while (best > 0 && table[best - 1].stamp_ns == table[best].stamp_ns)
        best--;
    return count > 0 && gap(table[best].stamp_ns, stamp_ns) <= MICROSECOND ? table[best].scan : -1;
}

int32_t cairn_relation_table_find(cairn_relation_row *row, int32_t count, const int64_t *stamp_ns,
                                  int32_t scans)
{
    stamped *table = malloc(((size_t)scans + 1) * sizeof *table);
    int32_t found = 0;

    if (table == NULL)
        return -1;
    for (int32_t i = 0; i < scans; i++) {
        table[i].stamp_ns = stamp_ns[i];
        table[i].scan = i;
    }
    qsort(table, (size_t)scans, sizeof *table, compare_stamped);
    for (int32_t k = 0; k < count; k++) {
        cairn_relation_row *r = &row[k];

        r->first = r->timed ? find(table, scans, r->first) : r->first < scans ? r->first : -1;
        r->second = r->timed ? find(table, scans, r->second) : r->second < scans ? r->second : -1;
        if (r->first < 0 || r->second < 0)
            r->first = r->second = -1;
        found += r->first >= 0;
        r->timed = 0;
    }
    free(table);
    return found;
}
