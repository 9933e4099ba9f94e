/* interruption: ends a long call of the host library between two of its steps.
 *
 * A program that handles signals itself, such as the interpreter of Python, sets a function that
 * returns whether the call is to end. Then the call frees what it has made and returns CAIRN_MORE,
 * without a result; an error text has no meaning. Without such a function every call runs to its
 * end. Internal to the host library. */
#ifndef CAIRN_HOST_INTERRUPTION_H
#define CAIRN_HOST_INTERRUPTION_H

/* Work units of one step between two queries: some hundredths of a second. */
enum { CAIRN_INTERRUPTION_UNITS = 1000000 };

/* Returns 1 when the call in this thread is to end, and from then on until it has ended. It is
 * called often, up to once a line of a file. */
typedef int (*cairn_interruption_query)(void);

/* Sets the function, for all threads; NULL: none. Before any other call of the library. */
void cairn_interruption_set(cairn_interruption_query query);

/* Returns 1 when the call in this thread is to end. */
int cairn_interruption_is_requested(void);

#endif
