/* What the POSIX interface lacks on Windows, and what both systems do differently. */
#include "src/base/build.h"

#include "src/host/base/posix.h"

#ifndef _WIN32

#include <sys/file.h>

void cairn_on_end_signals(void (*handler)(int number))
{
    static const int numbers[] = {SIGINT, SIGTERM, SIGHUP};
    struct sigaction action, before;

    memset(&action, 0, sizeof action);
    action.sa_handler = handler;
    action.sa_flags = (int)SA_RESETHAND;
    (void)sigemptyset(&action.sa_mask);
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        if (sigaction(numbers[i], NULL, &before) == 0 && before.sa_handler == SIG_DFL)
            (void)sigaction(numbers[i], &action, NULL);
}

int cairn_on_interrupt(void (*handler)(int number))
{
    struct sigaction action;

    memset(&action, 0, sizeof action);
    action.sa_handler = handler;
    action.sa_flags = SA_RESTART | (int)SA_RESETHAND;
    (void)sigemptyset(&action.sa_mask);
    return sigaction(SIGINT, &action, NULL) == 0;
}

int cairn_folder_lock(const char *path, int waits)
{
    int folder = open(path, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC), code;

    if (folder == -1 || flock(folder, waits ? LOCK_EX : LOCK_EX | LOCK_NB) == 0 || waits)
        return folder;
    code = errno;
    (void)close(folder);
    errno = code;
    return -1;
}

int cairn_folder_sync(int lock)
{
    return fsync(lock);
}

int cairn_text_stream_open(cairn_text_stream *text)
{
    text->text = NULL;
    text->count = 0;
    text->stream = open_memstream(&text->text, &text->count);
    return text->stream != NULL;
}

char *cairn_text_stream_close(cairn_text_stream *text)
{
    int failed = ferror(text->stream);

    if (fclose(text->stream) == 0 && !failed)
        return text->text;
    free(text->text);
    return NULL;
}

void cairn_program_path(char *path, size_t size)
{
    ssize_t length = readlink("/proc/self/exe", path, size - 1);

    path[length > 0 ? length : 0] = '\0';
}

#else

#include <io.h>
#include <process.h>
#include <signal.h>
#include <windows.h>

/* Without conversion of line ends, as elsewhere. Runs before main(). */
__attribute__((constructor)) static void set_binary(void)
{
    _fmode = _O_BINARY;
    (void)_setmode(STDIN_FILENO, _O_BINARY);
    (void)_setmode(STDOUT_FILENO, _O_BINARY);
    (void)_setmode(STDERR_FILENO, _O_BINARY);
}

/* Sets errno from the last error of the system and returns -1; 0 when `done`. */
static int result_of(BOOL done)
{
    if (done)
        return 0;
    switch (GetLastError()) {
    case ERROR_FILE_NOT_FOUND:
    case ERROR_PATH_NOT_FOUND:
        errno = ENOENT;
        break;
    case ERROR_ACCESS_DENIED:
    case ERROR_SHARING_VIOLATION:
        errno = EACCES;
        break;
    case ERROR_ALREADY_EXISTS:
    case ERROR_FILE_EXISTS:
        errno = EEXIST;
        break;
    case ERROR_DISK_FULL:
        errno = ENOSPC;
        break;
    default:
        errno = EIO;
    }
    return -1;
}

int cairn_on_interrupt(void (*handler)(int number))
{
    return signal(SIGINT, handler) != SIG_ERR;
}

ssize_t pread(int file, void *bytes, size_t count, int64_t offset)
{
    if (_lseeki64(file, offset, SEEK_SET) < 0)
        return -1;
    return read(file, bytes, (unsigned)(count < INT32_MAX ? count : INT32_MAX));
}

void cairn_on_end_signals(void (*handler)(int number))
{
    (void)handler;
}

int cairn_folder_lock(const char *path, int waits)
{
    (void)path;
    if (waits)
        return open("NUL", O_RDONLY | O_CLOEXEC);
    errno = ENOSYS;
    return -1;
}

int cairn_folder_sync(int lock)
{
    (void)lock;
    return 0;
}

int cairn_windows_mkdir(const char *path)
{
    return strlen(path) == 2 && path[1] == ':' ? 0 : _mkdir(path);
}

int cairn_windows_execvp(const char *path, char *const *argv)
{
    intptr_t code = _spawnvp(_P_WAIT, path, (const char *const *)argv);

    if (code >= 0)
        exit((int)code);
    return -1;
}

int cairn_windows_rename(const char *from, const char *to)
{
    return result_of(MoveFileExA(from, to, MOVEFILE_REPLACE_EXISTING));
}

int link(const char *from, const char *to)
{
    return result_of(CreateHardLinkA(to, from, NULL));
}

char *strndup(const char *text, size_t max_length)
{
    size_t length = strnlen(text, max_length);
    char *copy = malloc(length + 1);

    if (copy != NULL) {
        memcpy(copy, text, length);
        copy[length] = '\0';
    }
    return copy;
}

void *aligned_alloc(size_t alignment, size_t bytes)
{
    return alignment <= 16 ? malloc(bytes) : NULL;
}

void *dlopen(const char *path, int flags)
{
    (void)flags;
    return LoadLibraryA(path);
}

void *dlsym(void *library, const char *name)
{
    FARPROC found = GetProcAddress(library, name);
    void *address;

    memcpy(&address, &found, sizeof address);
    return address;
}

int cairn_text_stream_open(cairn_text_stream *text)
{
    text->stream = tmpfile();
    return text->stream != NULL;
}

char *cairn_text_stream_close(cairn_text_stream *text)
{
    long count = ftell(text->stream);
    int failed = ferror(text->stream) || count < 0;
    char *read = failed ? NULL : malloc((size_t)count + 1);

    if (read != NULL) {
        rewind(text->stream);
        read[fread(read, 1, (size_t)count, text->stream)] = '\0';
    }
    (void)fclose(text->stream);
    return read;
}

void cairn_program_path(char *path, size_t size)
{
    DWORD length = GetModuleFileNameA(NULL, path, (DWORD)size - 1);

    path[length] = '\0';
    for (; *path != '\0'; path++)
        if (*path == '\\')
            *path = '/';
}

#endif
