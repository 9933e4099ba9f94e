/* Charges of operations that cost less than a unit.
 *
 * Method: whole units are taken from the budget before the operation is done. What is taken while
 * the operation waits lowers the eighths used, below 0 if need be, so that no other state is kept. */
#include "src/base/build.h"

#include "src/base/step.h"

extern inline int cairn_step_charge_eighths(cairn_budget *budget, int32_t *used, int64_t *units,
                                            int32_t eighths);
