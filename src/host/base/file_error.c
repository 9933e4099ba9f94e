/* Error texts with file and line. strerror_r of POSIX keeps this free of static state. */
#include "src/base/build.h"

#include <errno.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "cairn/file_error.h"
#include "src/host/base/c_locale.h"

/* Bytes of the text reserved for the message behind the path. */
#define MESSAGE_BYTES 512

cairn_status cairn_file_error_set(cairn_file_error *error, cairn_status status, const char *path,
                                  int64_t line, const char *format, ...)
{
    size_t length = strlen(path), path_bytes = CAIRN_FILE_ERROR_BYTES - MESSAGE_BYTES, used;
    const char *ellipsis = "";
    cairn_c_locale scope;
    va_list values;

    if (error == NULL)
        return status;
    error->status = status;
    error->line = line;
    if (length > path_bytes) {
        path += length - path_bytes;
        ellipsis = "...";
    }
    if (line > 0)
        (void)snprintf(error->text, sizeof error->text, "%s%s:%" PRId64 ": ", ellipsis, path, line);
    else
        (void)snprintf(error->text, sizeof error->text, "%s%s: ", ellipsis, path);
    used = strlen(error->text);
    scope = cairn_c_locale_enter();
    va_start(values, format);
    (void)vsnprintf(error->text + used, sizeof error->text - used, format, values);
    va_end(values);
    cairn_c_locale_leave(scope);
    return status;
}

cairn_status cairn_file_error_system(cairn_file_error *error, const char *path, const char *what,
                                     int32_t code)
{
    char text[256];

    if (strerror_r(code, text, sizeof text) != 0)
        (void)snprintf(text, sizeof text, "error %d", (int)code);
    return cairn_file_error_set(error, code == ENOMEM ? CAIRN_NO_MEMORY : CAIRN_IO, path, 0,
                                "cannot %s: %s", what, text);
}
