/* Work units of the operations of the block solver on lists. */
#include "src/base/build.h"

#include "src/numerics/block_solver_work.h"

int cairn_block_solver_charge(cairn_block_solver *solver, cairn_budget *budget, int32_t entries)
{
    return cairn_budget_charge(budget, &solver->units_charged,
                               1 + entries / BLOCK_SOLVER_ENTRIES_PER_UNIT);
}
