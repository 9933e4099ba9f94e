/* Libraries that are loaded when they are first needed. */
#include "src/core/build.h"

#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "src/host/shim.h"

enum { PATH_BYTES = 4096 };

static const void *table_at(const char *path, const char *function, int32_t version)
{
    const void *(*table)(void);
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL), *found;
    int32_t own;

    if (library == NULL)
        return NULL;
    /* dlsym gives an object pointer, which is a function's here (POSIX). */
    found = dlsym(library, function);
    if (found == NULL)
        return NULL;
    memcpy(&table, &found, sizeof table);
    memcpy(&own, table(), sizeof own);
    return own == version ? table() : NULL;
}

/* The folder of the program that runs; "" when the system does not tell. */
static void find_program(char folder[PATH_BYTES])
{
    ssize_t length = readlink("/proc/self/exe", folder, PATH_BYTES - 1);
    char *slash;

    folder[length > 0 ? length : 0] = '\0';
    slash = strrchr(folder, '/');
    folder[slash != NULL ? slash - folder : 0] = '\0';
}

/* dlopen counts how often a library was asked for, and loads it once. */
const void *cairn_shim_find(const char *library, const char *variable, const char *function,
                            int32_t version)
{
    static const char *const places[] = {"", "/..", "/../lib"};
    const char *given = getenv(variable);
    const void *table = NULL;
    char folder[PATH_BYTES], path[PATH_BYTES + 64];

    if (given != NULL)
        return table_at(given, function, version);
    find_program(folder);
    for (size_t i = 0; i < sizeof places / sizeof *places && table == NULL && *folder != '\0';
         i++) {
        (void)snprintf(path, sizeof path, "%s%s/%s", folder, places[i], library);
        table = table_at(path, function, version);
    }
    return table != NULL ? table : table_at(library, function, version);
}
