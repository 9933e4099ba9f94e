/* Reads the scans of `cairn match`. */
#include "tools/cairn_match_input.h"

#include <inttypes.h>
#include <zlib.h>

#include "cairn/number_text.h"
#include "src/host/posix.h"

/* Splits FILE:INDEX, unless a file of the complete name exists. Returns 0 when there is no
 * memory. */
static int split(match_input *input, const char *word)
{
    const char *colon = strrchr(word, ':');
    size_t length = strlen(word);

    input->path = malloc(length + 1);
    if (input->path == NULL)
        return 0;
    memcpy(input->path, word, length + 1);
    if (colon != NULL && access(word, F_OK) != 0 && colon[1] >= '0' && colon[1] <= '9' &&
        cairn_number_read_integer(colon + 1, strlen(colon + 1), &input->index))
        input->path[colon - word] = '\0';
    return 1;
}

/* Returns 1 when the first character that is no white space opens a JSON object or array.
 * Unreadable files are reported by the readers. */
static int is_json(const char *path)
{
    gzFile file = gzopen(path, "rb");
    int byte = ' ';

    if (file == NULL)
        return 0;
    while (byte == ' ' || byte == '\n' || byte == '\r' || byte == '\t')
        byte = gzgetc(file);
    (void)gzclose(file);
    return byte == '{' || byte == '[';
}

static int refuse_index(const match_input *input, const char *program, int32_t count)
{
    return options_refuse(program,
                          "%s holds %" PRId32 " scans, expected an index from 0 to %" PRId32
                          ", not %" PRId64,
                          input->path, count, count - 1, input->index);
}

static int load_csm(match_input *input, const char *program, double range_max)
{
    cairn_csm_scan_params params = cairn_csm_scan_default();
    cairn_file_error error;

    if (range_max > 0)
        params.range_max = range_max;
    if (cairn_csm_scan_load(&input->csm, input->path, &params, &error) != CAIRN_OK)
        return tool_report(&error);
    if (input->index >= input->csm.count)
        return refuse_index(input, program, input->csm.count);
    input->scan = input->csm.scan[input->index].scan;
    input->line = input->csm.scan[input->index].line;
    return TOOL_OK;
}

static int load_carmen(match_input *input, const char *program, double range_max, int32_t quiet)
{
    int code = tool_load(&input->carmen, input->path, range_max, quiet);

    if (code != TOOL_OK)
        return code;
    if (input->index >= input->carmen.count)
        return refuse_index(input, program, input->carmen.count);
    input->scan = input->carmen.record[input->index].scan;
    input->line = input->carmen.record[input->index].line;
    return TOOL_OK;
}

int match_input_load(match_input *input, const char *program, const char *word, double range_max,
                     int32_t quiet)
{
    memset(input, 0, sizeof *input);
    if (!split(input, word)) {
        (void)options_refuse(program, "no memory");
        return TOOL_FAILED;
    }
    return is_json(input->path) ? load_csm(input, program, range_max)
                                : load_carmen(input, program, range_max, quiet);
}

void match_input_free(match_input *input)
{
    free(input->path);
    cairn_csm_scan_list_free(&input->csm);
    cairn_carmen_log_scans_free(&input->carmen);
}
