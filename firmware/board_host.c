/* The desktop as a board: prints to standard output, discards the recording, measures nothing. */
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

int32_t board_number(int32_t otherwise)
{
    const char *text = getenv("LAPS");
    long number = text != NULL ? strtol(text, NULL, 10) : 0;

    return number >= 1 && number <= 999999 ? (int32_t)number : otherwise;
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
