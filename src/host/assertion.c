/* What a program does when an assertion of the library fails, unless it has its own answer
 * (tests have). Only libraries that are built with CAIRN_ASSERTIONS call it. */
#include "src/core/build.h"

#include <stdio.h>
#include <stdlib.h>

#include "src/host/assertion.h"

void cairn_assertion_failed(const char *condition, const char *file, int line)
{
    fprintf(stderr, "%s:%d: internal error: %s does not hold\n", file, line, condition);
    abort();
}
