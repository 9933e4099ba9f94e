/* A program that runs with pipes to its standard input and output. */
#ifndef CAIRN_BENCH_SESSION_H
#define CAIRN_BENCH_SESSION_H

#include <sys/types.h>

typedef struct bench_session {
    pid_t program;
    /* Ends of the pipes: to its standard input, from its standard output. */
    int in, out;
} bench_session;

/* Starts arguments[0], a path, with these arguments, the last one NULL. Its errors go to the file
 * `errors`, or where those of this program go when that is NULL. Returns 0 when the system refuses;
 * a program that cannot be run ends with exit code 127. */
int bench_session_start(bench_session *session, char *const *arguments, const char *errors);

#endif
