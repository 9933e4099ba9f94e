/* The desktop as a board: what the loop prints goes to standard output, and nothing is measured. */
#include <stdio.h>
#include <stdlib.h>

#include "firmware/board.h"

void board_print(const char *text)
{
    fputs(text, stdout);
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
