/* console: what the loops print, and what their ticks cost.
 *
 * Lines that begin with "measure" are of the machine; all others are the same on every one. */
#ifndef CAIRN_FIRMWARE_CONSOLE_H
#define CAIRN_FIRMWARE_CONSOLE_H

#include <stdint.h>

#include "cairn/status.h"

/* Costs of the ticks of one kind. */
typedef struct console_measure {
    uint32_t ticks, worst; /* instructions */
    uint64_t sum;
    int32_t worst_units; /* of budget */
} console_measure;

/* One more tick, of so many instructions and units. */
void console_count(console_measure *m, uint32_t instructions, int32_t units);

/* Prints a line "what of_what number number ..."; count <= 9. */
void console_numbers(const char *what, const char *of_what, const int32_t *number, int32_t count);

/* Prints a line of ticks, their mean and worst instructions, and most units. */
void console_measured(const char *what, const console_measure *m);

/* Prints a line "hash name hash". */
void console_hash(const char *name, uint32_t hash);

/* Ends the program and says why: there is nobody to hand a status to. */
_Noreturn void console_give_up(const char *what, cairn_status status);

#endif
