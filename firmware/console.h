/* console: output of the loops and cost statistics of their ticks.
 *
 * Lines that begin with "measure" depend on the machine; all others are equal on all machines. */
#ifndef CAIRN_FIRMWARE_CONSOLE_H
#define CAIRN_FIRMWARE_CONSOLE_H

#include <stdint.h>

#include "cairn/status.h"

/* Costs of the ticks of one kind. */
typedef struct console_measure {
    uint32_t ticks, worst; /* instructions */
    uint64_t sum;
    int32_t worst_units; /* maximum work units of a tick */
} console_measure;

/* Counts a tick with its instructions and work units. */
void console_count(console_measure *m, uint32_t instructions, int32_t units);

/* Prints a line "what of_what number number ..."; count <= 9. */
void console_numbers(const char *what, const char *of_what, const int32_t *number, int32_t count);

/* Prints a line with the number of ticks, their mean and maximum instructions, and maximum
 * units. */
void console_measured(const char *what, const console_measure *m);

/* Prints a line "hash name hash". */
void console_hash(const char *name, uint32_t hash);

/* Prints the reason and ends the program. */
_Noreturn void console_give_up(const char *what, cairn_status status);

#endif
