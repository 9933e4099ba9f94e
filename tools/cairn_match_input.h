/* Input of `cairn match`: one scan of a file. */
#ifndef CAIRN_TOOLS_CAIRN_MATCH_INPUT_H
#define CAIRN_TOOLS_CAIRN_MATCH_INPUT_H

#include "tools/cairn_tool.h"

typedef struct match_input {
    char *path;    /* without the index */
    int64_t index; /* among the scans of the file, from 0 */
    int64_t line;
    cairn_scan_input scan; /* its arrays belong to the log */
    cairn_scan_log log;
} match_input;

/* Reads FILE or FILE:INDEX, a log of any format. TOOL_OK, or another exit code after a line on
 * standard error; to be freed in any case. */
int match_input_load(match_input *input, const char *program, const char *word,
                     const tool_log_options *options);
void match_input_free(match_input *input);

#endif
