/* scan_match: the charge of every operation. scan_match.c describes the method. */
#include "src/base/build.h"

#include "src/scans/scan_match_work.h"

extern inline int cairn_scan_match_charge(cairn_scan_match *match, cairn_budget *budget,
                                          int32_t parts);

/* Units are charged in multiples of it, since a charge of each operation would be measurable. */
enum { UNITS_PER_CHARGE = 8 };

int cairn_scan_match_charge_more(cairn_scan_match *match, cairn_budget *budget, int32_t parts)
{
    const int32_t block = UNITS_PER_CHARGE * SCAN_MATCH_PARTS_PER_UNIT;
    int32_t blocks = (parts - match->parts_ahead + block - 1) / block;

    if (parts / SCAN_MATCH_PARTS_PER_UNIT > match->measure.worst_step)
        match->measure.worst_step = parts / SCAN_MATCH_PARTS_PER_UNIT;
    if (!cairn_budget_charge(budget, &match->units_charged, UNITS_PER_CHARGE * blocks))
        return 0;
    match->parts_ahead += block * blocks;
    return 1;
}
