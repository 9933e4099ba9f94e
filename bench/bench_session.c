/* Starts a program by fork() and exec() between two pipes. */
#include "bench/bench_session.h"

#include <stdio.h>
#include <unistd.h>

/* What the new process does. */
static void run(const int to[2], const int from[2], char *const *arguments, const char *errors)
{
    (void)dup2(to[0], STDIN_FILENO);
    (void)dup2(from[1], STDOUT_FILENO);
    (void)close(to[0]);
    (void)close(to[1]);
    (void)close(from[0]);
    (void)close(from[1]);
    if (errors == NULL || freopen(errors, "w", stderr) != NULL)
        (void)execv(arguments[0], arguments);
    _exit(127);
}

int bench_session_start(bench_session *session, char *const *arguments, const char *errors)
{
    int to[2], from[2];

    if (pipe(to) != 0)
        return 0;
    if (pipe(from) != 0) {
        (void)close(to[0]);
        (void)close(to[1]);
        return 0;
    }
    (void)fflush(NULL);
    session->program = fork();
    if (session->program == 0)
        run(to, from, arguments, errors);
    (void)close(to[0]);
    (void)close(from[1]);
    session->in = to[1];
    session->out = from[0];
    return session->program > 0;
}
