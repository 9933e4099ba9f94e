/* Charges of operations that cost less than a unit.
 *
 * Method: whole units are taken from the budget before the operation is done. What is taken while
 * the operation waits lowers the eighths used, below 0 if need be, so that no other state is kept. */
#include "src/base/build.h"

#include "src/base/step.h"

int cairn_step_charge_eighths(cairn_budget *budget, int32_t *used, int64_t *units, int32_t eighths)
{
    uint32_t due = (uint32_t)(*used + eighths);
    int32_t wanted = (int32_t)(due / 8), left = budget->left;

    if (left <= 0)
        return 0;
    if (wanted > left) {
        budget->left = 0;
        *units += left;
        *used -= 8 * left;
        return 0;
    }
    budget->left = left - wanted;
    *units += wanted;
    *used = (int32_t)(due % 8);
    return 1;
}
