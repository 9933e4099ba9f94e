/* The same with the host library: reads a log, whose name is the argument. */
#include <stdio.h>
#include "cairn/scan_log.h"

int main(int argc, char **argv)
{
    cairn_scan_log_params params = cairn_scan_log_default();
    cairn_file_error error;
    cairn_scan_log log;

    if (argc < 2 || cairn_scan_log_load(&log, argv[1], &params, &error) != CAIRN_OK)
        return 1;
    printf("%d scans\n", (int)log.scans.count);
    cairn_scan_log_free(&log);
    return 0;
}
