/* Runs the built programs: output, errors, exit code. */
#ifndef CAIRN_TESTS_PROGRAMS_H
#define CAIRN_TESTS_PROGRAMS_H

#include <sys/wait.h>

#include "tests/files.h"

/* The folder of cairn and cairn-arena. */
static char programs_folder[512];

/* CAIRN_PROGRAMS when it is set, else the folder above that of the test. */
static inline void programs_find(int argc, char **argv)
{
    const char *given = getenv("CAIRN_PROGRAMS"), *slash = argc > 0 ? strrchr(argv[0], '/') : NULL;

    if (given != NULL)
        (void)snprintf(programs_folder, sizeof programs_folder, "%s", given);
    else
        (void)snprintf(programs_folder, sizeof programs_folder, "%.*s/..",
                       slash != NULL ? (int)(slash - argv[0]) : 1, slash != NULL ? argv[0] : ".");
}

typedef struct outcome {
    int code;
    char out[8192];
    char err[8192];
} outcome;

static inline void programs_read(const char *name, char *text, size_t size)
{
    char *bytes = files_read(files_path(name), NULL);

    assert_non_null(bytes);
    (void)snprintf(text, size, "%s", bytes);
    free(bytes);
}

/* Runs "<before> <folder>/<command> >output"; `command` begins with the program's name. Standard
 * output goes to `output`, or into the outcome when that is NULL. */
static inline outcome programs_run_shell(const char *before, const char *command,
                                         const char *output)
{
    char line[4096 + 1200];
    outcome o = {0, "", ""};
    int status;

    (void)remove(files_path("out"));
    (void)snprintf(line, sizeof line, "%s '%s'/%s >'%s' 2>'%s' </dev/null", before, programs_folder,
                   command, output != NULL ? output : files_path("out"), files_path("err"));
    status = system(line);
    assert_true(WIFEXITED(status));
    o.code = WEXITSTATUS(status);
    programs_read("err", o.err, sizeof o.err);
    if (output == NULL)
        programs_read("out", o.out, sizeof o.out);
    return o;
}

/* The command as with printf; @ is the folder of the test's files. */
static inline outcome programs_run(const char *format, ...)
{
    char text[2048], command[4096];
    va_list arguments;
    size_t used = 0;

    va_start(arguments, format);
    (void)vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    for (const char *c = text; *c != '\0' && used + sizeof files_folder < sizeof command; c++)
        used +=
            (size_t)(*c == '@' ? snprintf(command + used, sizeof command - used, "%s", files_folder)
                               : snprintf(command + used, sizeof command - used, "%c", *c));
    return programs_run_shell("", command, NULL);
}

static inline void assert_done(outcome o)
{
    if (o.code != 0)
        fail_msg("exit code %d: %s", o.code, o.err);
}

static inline void assert_done_silently(outcome o)
{
    assert_done(o);
    assert_string_equal(o.err, "");
}

/* Exit code 2 and one line on standard error, which holds `piece`; nothing on standard output. */
static inline void assert_refused(outcome o, const char *piece)
{
    if (o.code != 2 || strstr(o.err, piece) == NULL ||
        strchr(o.err, '\n') != o.err + strlen(o.err) - 1)
        fail_msg("exit code %d, \"%s\", where 2 and one line with \"%s\" was expected", o.code,
                 o.err, piece);
    assert_string_equal(o.out, "");
}

#endif
