/* The function that ends long calls. */
#include "src/base/build.h"

#include <stddef.h>

#include "src/host/base/interruption.h"

/* Of the whole process, as the handlers of signals are. */
static cairn_interruption_question interruption_question;

void cairn_interruption_set(cairn_interruption_question question)
{
    interruption_question = question;
}

int cairn_interruption_is_asked(void)
{
    return interruption_question != NULL && interruption_question();
}
