/* assertion: the answer of a program to a failed assertion of the library. */
#ifndef CAIRN_HOST_ASSERTION_H
#define CAIRN_HOST_ASSERTION_H

void cairn_assertion_failed(const char *condition, const char *file, int line);

#endif
