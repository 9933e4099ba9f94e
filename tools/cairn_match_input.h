/* Input of `cairn match`: one scan of a file. */
#ifndef CAIRN_TOOLS_CAIRN_MATCH_INPUT_H
#define CAIRN_TOOLS_CAIRN_MATCH_INPUT_H

#include "cairn/csm_scan.h"
#include "tools/cairn_tool.h"

typedef struct match_input {
    char *path;    /* without the index */
    int64_t index; /* among the scans of the file, from 0 */
    int64_t line;
    cairn_scan_input scan; /* its arrays belong to carmen or csm */
    cairn_carmen_log_scans carmen;
    cairn_csm_scan_list csm;
} match_input;

/* Reads FILE or FILE:INDEX, a CARMEN log or scans of CSM, distinguished by the first character.
 * range_max: m, ranges from this value on count as no return; 0: the limit of the file. TOOL_OK, or
 * another exit code after a line on standard error; to be freed in any case. */
int match_input_load(match_input *input, const char *program, const char *word, double range_max,
                     int32_t quiet);
void match_input_free(match_input *input);

#endif
