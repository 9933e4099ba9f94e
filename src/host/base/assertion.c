/* The default assertion handler. A program that defines its own cairn_assertion_failed, as the
 * tests do, replaces it. Only libraries built with CAIRN_ASSERTIONS call it. */
#include "src/base/build.h"

#include <stdio.h>
#include <stdlib.h>

#include "src/host/base/assertion.h"

void cairn_assertion_failed(const char *condition, const char *file, int line)
{
    fprintf(stderr, "%s:%d: internal error: %s does not hold\n", file, line, condition);
    abort();
}
