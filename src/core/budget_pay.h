/* budget_pay: how an item that costs several units is paid without a step exceeding its budget. */
#ifndef CAIRN_CORE_BUDGET_PAY_H
#define CAIRN_CORE_BUDGET_PAY_H

#include "cairn/status.h"

/* Pays for an item of `cost` units, over several calls if need be; *paid holds what was paid so far, 0 before the first.
 * 1 when the item is paid and may be done, 0 when the budget is used up before. */
static inline int cairn_budget_pay(cairn_budget *budget, int32_t *paid, int32_t cost)
{
    int32_t due = cost - *paid, now = due < budget->left ? due : budget->left;

    if (now > 0) {
        *paid += now;
        budget->left -= now;
    }
    if (*paid < cost)
        return 0;
    *paid = 0;
    return 1;
}

#endif
