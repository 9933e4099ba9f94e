/* aligner: the charge of every operation, and commit points. aligner.c describes the method. */
#include "src/base/build.h"

#include "src/alignment/aligner_work.h"

enum { SCANS_PER_UNIT = 16 }; /* scans of which one field is read or set */

/* Returns 1 when iterate() returns: the poses have changed, and are consistent, as no evaluation or
 * relaxation is running and no scan is being relocalized. */
static int is_at_commit(const cairn_aligner *aligner)
{
    return aligner->stops_at_commits && aligner_commits(aligner) != aligner->reported_commit &&
           !aligner->evaluation.is_active && !aligner->relax.is_active &&
           aligner->clusters[aligner->scan_count].size == 0;
}

int cairn_aligner_charge(cairn_aligner *aligner, cairn_budget *budget, int32_t units)
{
    if (budget->left <= 0 || is_at_commit(aligner))
        return 0;
    if (units > aligner->result.worst_step)
        aligner->result.worst_step = units;
    return cairn_budget_charge(budget, &aligner->units_charged, units);
}

int cairn_aligner_charge_scans(cairn_aligner *aligner, cairn_budget *budget)
{
    return cairn_aligner_charge(aligner, budget, 1 + aligner->scan_count / SCANS_PER_UNIT);
}
