/* assertion: the default handler for a failed assertion of the library. */
#ifndef CAIRN_HOST_ASSERTION_H
#define CAIRN_HOST_ASSERTION_H

/* Prints the location and the condition to stderr and aborts. Only libraries built with
 * CAIRN_ASSERTIONS call it. */
void cairn_assertion_failed(const char *condition, const char *file, int line);

#endif
