/* place_map: which scans of a log were taken at one place, and their poses there. */
#include "src/base/build.h"

#include "cairn/place_map.h"

/* m: scans within this distance of the first scan of a place belong to the place. */
#define PLACE_RADIUS CAIRN_REAL(0.5)

static int32_t is_same_place(const cairn_place_map_grouping *grouping, cairn_pose pose)
{
    cairn_vec2 moved = {pose.x - grouping->start.x, pose.y - grouping->start.y};

    if (grouping->scans == 0)
        return 0;
    if (grouping->headings > 0)
        return grouping->scans % grouping->headings != 0;
    return cairn_vec2_norm(moved) <= PLACE_RADIUS;
}

static cairn_pose pose_in_place(const cairn_place_map_grouping *grouping, cairn_pose pose)
{
    cairn_pose own = cairn_pose_identity();

    if (grouping->headings > 0) {
        own.theta = cairn_wrap_angle((cairn_real)(grouping->scans - grouping->first) * 2 *
                                     CAIRN_PI / (cairn_real)grouping->headings);
        return own;
    }
    if (grouping->keep_heading)
        own.theta = grouping->start.theta;
    return cairn_pose_compose(own, cairn_pose_between(grouping->start, pose));
}

int32_t cairn_place_map_group(cairn_place_map_grouping *grouping, cairn_pose pose,
                              cairn_pose *place_scan)
{
    if (!is_same_place(grouping, pose)) {
        grouping->places++;
        grouping->first = grouping->scans;
        grouping->start = pose;
    }
    *place_scan = pose_in_place(grouping, pose);
    grouping->scans++;
    return grouping->places - 1;
}
