/* Version of the library. */
#include "src/base/build.h"

#include "cairn/version.h"

int32_t cairn_version(void)
{
    return CAIRN_VERSION_MAJOR * 10000 + CAIRN_VERSION_MINOR * 100 + CAIRN_VERSION_PATCH;
}

const char *cairn_version_text(void)
{
#ifdef CAIRN_FLOAT
    return CAIRN_VERSION_STRING " float";
#else
    return CAIRN_VERSION_STRING;
#endif
}
