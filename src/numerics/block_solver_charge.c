/* Work units of the block solver: due when an operation is done, charged before the next one. */
#include "src/base/build.h"

#include "src/numerics/block_solver_work.h"

int cairn_block_solver_settle(cairn_block_solver *solver, cairn_budget *budget)
{
    (void)cairn_budget_settle(budget, &solver->units_due);
    return solver->units_due == 0;
}

int cairn_block_solver_is_ready(cairn_block_solver *solver, cairn_budget *budget)
{
    return cairn_block_solver_settle(solver, budget) && budget->left > 0;
}

void cairn_block_solver_charge(cairn_block_solver *solver, int32_t units)
{
    solver->units_due += units;
    solver->result.units += units;
}

void cairn_block_solver_charge_entries(cairn_block_solver *solver, int32_t visited)
{
    cairn_block_solver_charge(solver, 1 + visited / BLOCK_SOLVER_ENTRIES_PER_UNIT);
}
