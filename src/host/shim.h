/* shim: libraries of this project's own that stand before OpenCV, loaded when they are first
 * needed. Internal to the host library.
 *
 * A library has one function, which gives its table; the table begins with its version
 * (int32_t). */
#ifndef CAIRN_HOST_SHIM_H
#define CAIRN_HOST_SHIM_H

#include <stdint.h>

/* The table that `function` of `library` gives, from the path in the environment's `variable`,
 * otherwise from beside the program, the folder above it, lib beside that, and where the system
 * keeps libraries. NULL: it is not there, or of another version. */
const void *cairn_shim_find(const char *library, const char *variable, const char *function,
                            int32_t version);

#endif
