/* Reads the scans of `cairn match`. */
#include "tools/cairn_match_input.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "cairn/number_text.h"
#include "src/host/base/posix.h"

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

static int refuse_index(const match_input *input, const char *program, int32_t count)
{
    return options_refuse(program,
                          "%s holds %" PRId32 " scans, expected an index from 0 to %" PRId32
                          ", not %" PRId64,
                          input->path, count, count - 1, input->index);
}

int match_input_load(match_input *input, const char *program, const char *word,
                     const tool_log_options *options)
{
    const cairn_carmen_log_scans *scans = &input->log.scans;
    int code;

    memset(input, 0, sizeof *input);
    if (!split(input, word)) {
        (void)options_refuse(program, "no memory");
        return TOOL_FAILED;
    }
    code = tool_load(&input->log, input->path, options);
    if (code != TOOL_OK)
        return code;
    if (input->index >= scans->count)
        return refuse_index(input, program, scans->count);
    input->scan = scans->record[input->index].scan;
    input->line = scans->record[input->index].line;
    return TOOL_OK;
}

void match_input_free(match_input *input)
{
    free(input->path);
    cairn_scan_log_free(&input->log);
}
