/* Texts of statuses, the return of a fault, and the charge of a budget. */
#include "src/base/build.h"

#include "cairn/status.h"

extern inline int32_t cairn_budget_take(cairn_budget *budget, int32_t wanted);

const char *cairn_status_text(cairn_status status)
{
    switch (status) {
    case CAIRN_OK:
        return "done";
    case CAIRN_MORE:
        return "work is left: step";
    case CAIRN_BAD_ARGUMENT:
        return "argument out of range";
    case CAIRN_NOT_FINITE:
        return "not a finite number";
    case CAIRN_NO_MEMORY:
        return "out of pool memory";
    case CAIRN_FULL:
        return "capacity used up";
    case CAIRN_EMPTY:
        return "nothing to work on";
    case CAIRN_BAD_FORMAT:
        return "bad format";
    case CAIRN_TRUNCATED:
        return "input ends too early";
    case CAIRN_UNSUPPORTED:
        return "not supported by this build";
    case CAIRN_IO:
        return "input or output failed";
    case CAIRN_BAD_BUILD:
        return "built with options that change results";
    case CAIRN_BUSY:
        return "the last input is still being worked on";
    default:
        return "unknown status";
    }
}

cairn_status cairn_refuse(cairn_fault *fault, int64_t index, const char *what, cairn_status status)
{
    if (fault != NULL) {
        fault->index = index;
        fault->message = what;
    }
    return status;
}

int cairn_budget_charge(cairn_budget *budget, int32_t *charged, int32_t cost)
{
    *charged += cairn_budget_take(budget, cost - *charged);
    if (*charged < cost)
        return 0;
    *charged = 0;
    return 1;
}
