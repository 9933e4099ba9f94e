/* Reader of manual fragments of an outline. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/number_text.h"
#include "cairn/part_cut_file.h"
#include "src/host/logs/carmen_log_reader.h"

#define EXPECTED_LINE "expected two samples of the outline, from 0, and a bundle of 0 to 7"

enum { LINE_NUMBERS = 3, MAX_SAMPLE = 4095 };

/* Parses the integers of a line. *count: how many; -1: malformed. */
static void read_numbers(const char *line, size_t length, int64_t number[LINE_NUMBERS],
                         int32_t *count)
{
    const char *comment = memchr(line, '#', length), *at = line, *token;
    const char *end = comment != NULL ? comment : line + length;
    size_t size;

    for (*count = 0; (size = cairn_token_next(&at, end, &token)) > 0; (*count)++)
        if (*count == LINE_NUMBERS || !cairn_number_read_integer(token, size, &number[*count])) {
            *count = -1;
            return;
        }
}

static cairn_status read_lines(cairn_line_reader *lines, cairn_part_bundle_cut *cuts,
                               int32_t *count, const char *path, cairn_file_error *error)
{
    const char *line;
    size_t length;
    cairn_status status;

    while ((status = cairn_line_reader_next(lines, &line, &length, error)) == CAIRN_OK ||
           status == CAIRN_FULL) {
        int64_t number[LINE_NUMBERS] = {0}, at = cairn_line_reader_number(lines);
        int32_t numbers = -1;

        if (status == CAIRN_OK)
            read_numbers(line, length, number, &numbers);
        if (numbers == 0)
            continue;
        if (numbers != LINE_NUMBERS || number[0] < 0 || number[0] > MAX_SAMPLE || number[1] < 0 ||
            number[1] > MAX_SAMPLE || number[0] == number[1] || number[2] < 0 ||
            number[2] >= CAIRN_PART_MAX_BUNDLES)
            return cairn_file_error_set(error, CAIRN_BAD_FORMAT, path, at,
                                        "not a fragment, " EXPECTED_LINE);
        if (*count == CAIRN_PART_MAX_FRAGMENTS)
            return cairn_file_error_set(error, CAIRN_FULL, path, at,
                                        "too many fragments, expected at most %d",
                                        CAIRN_PART_MAX_FRAGMENTS);
        cuts[*count].from = (int32_t)number[0];
        cuts[*count].to = (int32_t)number[1];
        cuts[(*count)++].bundle = (int32_t)number[2];
    }
    if (status != CAIRN_EMPTY)
        return status;
    return *count > 0
               ? CAIRN_OK
               : cairn_file_error_set(error, CAIRN_EMPTY, path, 0, "no fragment, " EXPECTED_LINE);
}

cairn_status cairn_part_cut_file_read(cairn_part_bundle_cut cuts[CAIRN_PART_MAX_FRAGMENTS],
                                      int32_t *count, const char *path, cairn_file_error *error)
{
    cairn_line_reader *lines;
    cairn_status status = cairn_line_reader_open(&lines, path, error);

    *count = 0;
    if (status != CAIRN_OK)
        return status;
    status = read_lines(lines, cuts, count, path, error);
    cairn_line_reader_close(lines);
    if (status != CAIRN_OK)
        *count = 0;
    return status;
}
