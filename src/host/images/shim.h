/* shim: loader of the optional plug-in libraries that wrap OpenCV (lazy loading by dlopen).
 * Internal to the host library.
 *
 * A plug-in exports one function, which returns its function table. The table begins with its
 * version (int32_t). */
#ifndef CAIRN_HOST_SHIM_H
#define CAIRN_HOST_SHIM_H

#include <stdint.h>

/* Returns the function table of a plug-in, or NULL when it is missing or has another version.
 *
 * Search order: the path in the environment variable `variable`, if set, and no other; the
 * program's folder; lib/ beside that folder; the system's library path, with the program's
 * rpath. */
const void *cairn_shim_find(const char *library, const char *variable, const char *function,
                            int32_t version);

#endif
