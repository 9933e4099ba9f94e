/* board: all that the loop wants of the machine it runs on. One file per machine says how:
 * board_cortex_m.c (bare metal, semihosting), board_host.c (a desktop). */
#ifndef CAIRN_FIRMWARE_BOARD_H
#define CAIRN_FIRMWARE_BOARD_H

#include <stdint.h>

/* Prints a text. */
void board_print(const char *text);

/* Appends to the flight recording; nothing when there is nowhere to. A failure ends the program. */
void board_record(const void *data, uint32_t bytes);

/* The number that the program was started with, or `otherwise`: the last word of the command
 * line that semihosting gives, on a desktop LAPS of the environment. Not a number from 1 to
 * 999999: `otherwise`. */
int32_t board_number(int32_t otherwise);

/* Ends the program; status 0: all well. */
_Noreturn void board_exit(int status);

/* A clock that counts up and wraps; differences of two readings are its use. Cortex-M under an
 * emulator that takes 1 ns for an instruction: instructions, to BOARD_CLOCK_STEP; a desktop: 0. */
#define BOARD_CLOCK_STEP 40
uint32_t board_clock(void);

/* Bytes of stack that were in use at most since the start, by what is left of the paint; a
 * desktop: 0. */
uint32_t board_stack_peak(void);

/* Bytes of static data without the stack; a desktop: 0. */
uint32_t board_data_bytes(void);

#endif
