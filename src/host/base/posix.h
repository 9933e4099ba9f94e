/* posix: the POSIX functions that files, folders and plug-ins need, on POSIX systems and on
 * Windows. Internal to the host library and the tools.
 *
 * Elsewhere than on Windows this header includes those of the system. On Windows it adds what the
 * C library there (mingw-w64) lacks, or does otherwise.
 *
 * Limits on Windows: paths are in the system's code page, with "/" between their names; all files
 * and standard streams are binary; the locale of a thread stays as it is ("C" unless the program
 * changes it); fork() always fails with ENOSYS; signals are not blocked. */
#ifndef CAIRN_HOST_POSIX_H
#define CAIRN_HOST_POSIX_H

#include <errno.h>
#include <fcntl.h>
#include <locale.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <unistd.h>

#ifndef _WIN32
#include <dlfcn.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/wait.h>

#define NULL_DEVICE "/dev/null"
#else
#include <direct.h>

#define O_NONBLOCK 0
#define O_CLOEXEC  _O_NOINHERIT
#undef X_OK
#define X_OK 0
#define setenv(name, value, overwrite)                                                             \
    ((overwrite) || getenv(name) == NULL ? _putenv_s(name, value) : 0)
#define NULL_DEVICE          "NUL"
#define RTLD_NOW             0
#define RTLD_LOCAL           0
#define LC_ALL_MASK          0
#define WIFEXITED(code)      (code)
#define WEXITSTATUS(code)    (code)
#define _SC_NPROCESSORS_ONLN 0

#define mkdir(path, mode)             cairn_windows_mkdir(path)
#define lstat(path, about)            stat(path, about)
#define fsync(file)                   _commit(file)
#define realpath(path, resolved)      ((void)(resolved), strdup(path))
#define chown(path, user, group)      ((void)(path), (void)(user), (void)(group), 0)
#define sigfillset(set)               (*(set) = 0)
#define sigprocmask(how, set, before) ((void)(how), (void)(set), (void)(before), 0)
#define SIG_BLOCK                     0
#define SIG_SETMASK                   0
#define rename(from, to)              cairn_windows_rename(from, to)
#define newlocale(mask, name, base)   ((void)(base), (locale_t)0)
#define uselocale(locale)             (locale)
#define freelocale(locale)            ((void)(locale))
#define fork()                        (errno = ENOSYS, (pid_t)-1)
#define waitpid(process, code, flags) ((void)(process), (void)(code), -1)
#define execvp(path, argv)            cairn_windows_execvp(path, argv)
#define strerror_r(code, text, size)  strerror_s(text, size, code)
/* One job at a time, for there is no fork(). */
#define sysconf(name)                 1L

typedef int locale_t, sigset_t;

/* As on POSIX systems. aligned_alloc(): alignments up to that of malloc() (16) only. */
char *strndup(const char *text, size_t max_length);
void *aligned_alloc(size_t alignment, size_t bytes);
int link(const char *from, const char *to);
void *dlopen(const char *path, int flags);
void *dlsym(void *library, const char *name);
/* Moves the position of the file, unlike that of POSIX systems. */
ssize_t pread(int file, void *bytes, size_t count, int64_t offset);

/* mkdir(); a drive ("C:") exists and can be made "again". */
int cairn_windows_mkdir(const char *path);

/* execvp(): the new program runs to its end, whose exit code becomes this one's. */
int cairn_windows_execvp(const char *path, char *const *argv);

/* rename() that replaces a file, as POSIX has it. */
int cairn_windows_rename(const char *from, const char *to);

#endif

/* Calls the handler on SIGINT, SIGTERM and SIGHUP, once each, where the program has left them as
 * they are. On Windows it has no effect. */
void cairn_on_end_signals(void (*handler)(int number));

/* Calls the handler on the first SIGINT, without interrupting a read; the next one ends the
 * program. 0: refused by the system. */
int cairn_on_interrupt(void (*handler)(int number));

/* Opens a folder and locks it. waits 0: fails when another process holds the lock. Returns the
 * descriptor, whose closing releases the lock, or -1 and errno. Folders cannot be locked on
 * Windows: there it succeeds when it may wait, and fails otherwise. */
int cairn_folder_lock(const char *path, int waits);

/* Writes the entries of a locked folder to the disk; 0, or -1 and errno. */
int cairn_folder_sync(int lock);

/* A stream whose bytes become a text on the heap. */
typedef struct cairn_text_stream {
    FILE *stream;
    char *text;
    size_t count;
} cairn_text_stream;

/* Opens the stream; 0 when there is no memory (on Windows: no temporary file). */
int cairn_text_stream_open(cairn_text_stream *text);

/* Closes the stream and returns its text, to be freed by free(); NULL when a write failed. */
char *cairn_text_stream_close(cairn_text_stream *text);

/* Writes the path of the running program's executable, cut to `size` - 1 bytes; "" when the system
 * does not provide it. */
void cairn_program_path(char *path, size_t size);

#endif
