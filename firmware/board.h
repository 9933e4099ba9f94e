/* board: hardware abstraction of the loop. One implementation per machine:
 * board_cortex_m.c (bare metal, semihosting), board_host.c (a desktop). */
#ifndef CAIRN_FIRMWARE_BOARD_H
#define CAIRN_FIRMWARE_BOARD_H

#include <stdint.h>

/* Prints a text. */
void board_print(const char *text);

/* Appends to the flight recording; does nothing without a recording. A failure ends the program. */
void board_record(const void *data, uint32_t bytes);

/* Returns the number that the program was started with, from 1 to 999999, or `otherwise`. The
 * number is the last word of the command line that semihosting gives, on a desktop the environment
 * variable LAPS. */
int32_t board_number(int32_t otherwise);

/* Ends the program; status 0: success. */
_Noreturn void board_exit(int status);

/* A wrapping counter; use differences of two readings. Cortex-M under an emulator with 1 ns per
 * instruction: instructions, with resolution BOARD_CLOCK_STEP; a desktop: 0. */
#define BOARD_CLOCK_STEP 40
uint32_t board_clock(void);

/* Returns the peak stack use since the start in bytes, measured by stack painting; a desktop: 0. */
uint32_t board_stack_peak(void);

/* Bytes of static data without the stack; a desktop: 0. */
uint32_t board_data_bytes(void);

#endif
