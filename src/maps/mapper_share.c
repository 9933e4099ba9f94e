/* Units of the work in the background: force field, loop closure, graph and culling take a share of
 * every scan's units, which bounds the cost of a scan.
 *
 * Method. An operation begins while something is left of the scan's share, and is then charged in
 * full, before it is done: the last one may exceed the share, never the budget. A nested object gets
 * what is left of both as a budget of its own, and waits within an operation. So what is done at a
 * scan does not depend on how the budget was split. While a keyframe must be culled, and in
 * settle(), the share has no limit. */
#include "src/base/build.h"

#include "src/maps/mapper_work.h"

void cairn_mapper_begin_shares(cairn_mapper *mapper)
{
    mapper->shares.window = mapper->params.window_units - mapper->current.search_units_used;
    mapper->shares.loop = cairn_mapper_loops_lag(mapper) ? mapper->shares.window
                                                         : mapper->params.loop.units_per_scan -
                                                               mapper->current.search_units_used;
}

/* Returns the units left of the share of the task that is next; the force field goes first. */
static int32_t share_left(const cairn_mapper *mapper)
{
    if (mapper->loop.settling || cairn_mapper_must_cull(mapper))
        return CAIRN_UNBOUNDED;
    return mapper->window.is_active ? mapper->shares.window : mapper->shares.loop;
}

static void take_from_shares(cairn_mapper *mapper, int32_t units)
{
    if (mapper->loop.settling)
        return;
    mapper->shares.window -= units;
    mapper->shares.loop -= units;
}

int cairn_mapper_may_begin(const cairn_mapper *mapper, const cairn_budget *budget)
{
    return budget->left > 0 && share_left(mapper) > 0;
}

int cairn_mapper_charge_next(cairn_mapper *mapper, cairn_budget *budget, int32_t *charged,
                             int32_t units)
{
    if (!cairn_budget_charge(budget, charged, units))
        return 0;
    take_from_shares(mapper, units);
    return 1;
}

int cairn_mapper_charge_first(cairn_mapper *mapper, cairn_budget *budget, int32_t *charged,
                              int32_t units)
{
    return cairn_mapper_may_begin(mapper, budget) &&
           cairn_mapper_charge_next(mapper, budget, charged, units);
}

int cairn_mapper_run_in_share(cairn_mapper *mapper, cairn_budget *budget,
                              int (*step)(cairn_mapper *, cairn_budget *))
{
    int32_t left = share_left(mapper), most = budget->left < left ? budget->left : left;
    cairn_budget share = {most};
    int is_done;

    if (most <= 0)
        return 0;
    is_done = step(mapper, &share);
    cairn_budget_spend(budget, most - share.left);
    take_from_shares(mapper, most - share.left);
    return is_done;
}
