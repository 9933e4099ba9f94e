#include "tools/scan_log.h"

#include <inttypes.h>
#include <stdio.h>

#include "tools/console.h"

enum { TOLD_MOST = 20 };

static void tell(void *context, const cairn_file_error *fault)
{
    int32_t *told = context;

    if ((*told)++ < TOLD_MOST)
        fprintf(stderr, "%s\n", fault->text);
}

int scan_log_load(cairn_carmen_scans *scans, const char *path, double range_max)
{
    cairn_carmen_params params = cairn_carmen_default();
    cairn_file_error error;
    int32_t told = 0;

    params.range_max = range_max;
    params.on_fault = tell;
    params.context = &told;
    if (cairn_carmen_load(scans, path, &params, &error) != CAIRN_OK)
        return console_fail(&error);
    if (told > TOLD_MOST)
        fprintf(stderr, "%s: %d more damaged lines\n", path, told - TOLD_MOST);
    return EXIT_DONE;
}
