/* Lazy loading of plug-in libraries by dlopen. */
#include "src/base/build.h"

#include "src/host/base/posix.h"
#include "src/host/images/shim.h"

enum { PATH_BYTES = 4096 };

/* Loads the library at `path` and returns its table; NULL when the library, the function or the
 * version does not match. */
static const void *load_table(const char *path, const char *function, int32_t version)
{
    const void *(*table)(void);
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL), *found;
    int32_t found_version;

    if (library == NULL)
        return NULL;
    /* dlsym returns an object pointer. POSIX guarantees that it holds a function pointer. */
    found = dlsym(library, function);
    if (found == NULL)
        return NULL;
    memcpy(&table, &found, sizeof table);
    memcpy(&found_version, table(), sizeof found_version);
    return found_version == version ? table() : NULL;
}

/* Writes the folder of the running program's executable; "" when the system does not provide it. */
static void find_program_folder(char folder[PATH_BYTES])
{
    char *slash;

    cairn_program_path(folder, PATH_BYTES);
    slash = strrchr(folder, '/');
    folder[slash != NULL ? slash - folder : 0] = '\0';
}

/* A library is loaded once: dlopen counts its references. */
const void *cairn_shim_find(const char *library, const char *variable, const char *function,
                            int32_t version)
{
    static const char *const folders[] = {"", "/../lib"};
    const char *override = getenv(variable);
    const void *table = NULL;
    char folder[PATH_BYTES], path[PATH_BYTES + 64];

    if (override != NULL)
        return load_table(override, function, version);
    find_program_folder(folder);
    for (size_t i = 0; i < sizeof folders / sizeof *folders && table == NULL && *folder != '\0';
         i++) {
        (void)snprintf(path, sizeof path, "%s%s/%s", folder, folders[i], library);
        table = load_table(path, function, version);
    }
    return table != NULL ? table : load_table(library, function, version);
}
