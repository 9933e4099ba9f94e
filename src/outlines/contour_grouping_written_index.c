/* Tables of the mode as written: the symmetric points by pairs of segments, and the grids of segment
 * ends. */
#include "src/base/build.h"

#include "src/outlines/contour_grouping_written.h"

/* Work units of a symmetric point that is entered. */
enum { UNITS_PER_POINT = 2 };

/* First slot of a pair of segments. */
static int32_t pair_slot(const struct contour_grouping_written *written, int32_t first,
                         int32_t second)
{
    uint32_t h =
        ((uint32_t)first * UINT32_C(2654435761)) ^ ((uint32_t)second * UINT32_C(2246822519));

    return (int32_t)((h ^ (h >> 15)) & (uint32_t)(written->slot_count - 1));
}

const cairn_symmetric_point *
cairn_contour_grouping_written_point(const cairn_contour_grouping *grouping, int32_t first,
                                     int32_t second)
{
    const struct contour_grouping_written *written = grouping->written;
    const cairn_symmetric_point *points = cairn_symmetric_point_list(written->set, NULL);
    int32_t low = first < second ? first : second, high = first < second ? second : first,
            at = pair_slot(written, low, high);

    for (; written->pair_slots[at] >= 0; at = (at + 1) & (written->slot_count - 1)) {
        const cairn_symmetric_point *point = &points[written->pair_slots[at]];

        if (point->first == low && point->second == high)
            return point;
    }
    return NULL;
}

/* Enters a symmetric point into the hash table. */
static void enter_point(struct contour_grouping_written *written, int32_t index)
{
    const cairn_symmetric_point *point = &cairn_symmetric_point_list(written->set, NULL)[index];
    int32_t at = pair_slot(written, point->first, point->second);

    while (written->pair_slots[at] >= 0)
        at = (at + 1) & (written->slot_count - 1);
    written->pair_slots[at] = index;
}

/* Number of symmetric points. */
static int32_t point_count(const struct contour_grouping_written *written)
{
    int32_t count;

    (void)cairn_symmetric_point_list(written->set, &count);
    return count;
}

int cairn_contour_grouping_written_index(cairn_contour_grouping *grouping, cairn_budget *budget)
{
    struct contour_grouping_written *written = grouping->written;

    CAIRN_STEP_BEGIN(grouping->phase_resume);
    for (written->cursor = 0; written->cursor < written->slot_count; written->cursor++) {
        CAIRN_STEP_CHARGE(grouping, phase_resume, budget, 1);
        written->pair_slots[written->cursor] = -1;
    }
    for (written->cursor = 0; written->cursor < point_count(written); written->cursor++) {
        CAIRN_STEP_CHARGE(grouping, phase_resume, budget, UNITS_PER_POINT);
        enter_point(written, written->cursor);
    }
    while (cairn_point_grid_count(written->ends) > 0) {
        CAIRN_STEP_CHARGE(grouping, phase_resume, budget, 1);
        cairn_point_grid_remove_last(written->ends);
    }
    while (cairn_point_grid_count(written->chain_ends) > 0) {
        CAIRN_STEP_CHARGE(grouping, phase_resume, budget, 1);
        cairn_point_grid_remove_last(written->chain_ends);
    }
    for (written->cursor = 0; written->cursor < 2 * grouping->input.count; written->cursor++) {
        CAIRN_STEP_CHARGE(grouping, phase_resume, budget, 1);
        written->segment_stamp[written->cursor / 2] = 0;
        grouping->status = cairn_point_grid_insert(
            written->ends, contour_grouping_written_end(grouping, written->cursor));
        CAIRN_STEP_UNTIL(grouping->phase_resume, grouping->status == CAIRN_OK);
    }
    for (written->cursor = 0; written->cursor < grouping->input.end_count; written->cursor++) {
        CAIRN_STEP_CHARGE(grouping, phase_resume, budget, 1);
        grouping->status =
            cairn_point_grid_insert(written->chain_ends, grouping->input.ends[written->cursor]);
        CAIRN_STEP_UNTIL(grouping->phase_resume, grouping->status == CAIRN_OK);
    }
    CAIRN_STEP_END(grouping->phase_resume);
}
