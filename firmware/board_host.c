/* The desktop as a board: what the loop prints goes to standard output, the recording nowhere, and nothing is measured. */
#include <stdio.h>
#include <stdlib.h>

#include "firmware/board.h"

void board_print(const char *text)
{
    fputs(text, stdout);
}

void board_record(const void *data, uint32_t bytes)
{
    (void)data;
    (void)bytes;
}

_Noreturn void board_exit(int status)
{
    exit(status);
}

uint32_t board_clock(void)
{
    return 0;
}

uint32_t board_stack_peak(void)
{
    return 0;
}

uint32_t board_data_bytes(void)
{
    return 0;
}
