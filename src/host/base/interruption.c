/* The function that ends long calls. */
#include "src/base/build.h"

#include <stddef.h>

#include "src/host/base/interruption.h"

/* Of the whole process, as the handlers of signals are. */
static cairn_interruption_query interruption_query;

void cairn_interruption_set(cairn_interruption_query query)
{
    interruption_query = query;
}

int cairn_interruption_is_requested(void)
{
    return interruption_query != NULL && interruption_query();
}
