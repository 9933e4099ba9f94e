/* version: version of the library, at compile time and at run time. */
#ifndef CAIRN_VERSION_H
#define CAIRN_VERSION_H

#include <stdint.h>

/* Version of the headers. */
#define CAIRN_VERSION_MAJOR  0
#define CAIRN_VERSION_MINOR  3
#define CAIRN_VERSION_PATCH  0
#define CAIRN_VERSION_STRING "0.3.0"

#ifdef __cplusplus
extern "C" {
#endif

/* Version of the linked library, as 10000 * major + 100 * minor + patch. */
int32_t cairn_version(void);

/* Version of the linked library as text: "major.minor.patch", followed by " float" in the float
 * build. Constant storage. */
const char *cairn_version_text(void);

#ifdef __cplusplus
}
#endif

#endif
