/* weak_direction: clustering of the scans with a weakly observable direction into submaps.
 *
 * Method:
 * 1. Connected components: scans with equal direction and deviation that share a wall across the
 *    direction. A scan is tested against those before it that are not yet in its component.
 * 2. Components are numbered in the order of their first scans. Each submap gets the sum of the
 *    offsets of its initial poses, in the frame that fits those of the scans with observable
 *    poses. */
#include "src/base/build.h"

#include "src/fields/weak_direction_work.h"
#include "src/containers/disjoint_sets.h"

/* Tests of two segments for a work unit. */
enum { SEGMENT_TESTS_PER_UNIT = 16 };

/* relative difference of the deviations */
static const cairn_real MAX_SIGMA_DIFFERENCE = CAIRN_REAL(0.03);

/* ---- Clusters ---- */

/* 1 when a scan may be in one submap with another one, and is not yet. */
static int is_candidate(cairn_weak_direction *weak_direction, int32_t scan, int32_t other)
{
    const weak_direction_scan *a = &weak_direction->scans[scan], *b = &weak_direction->scans[other];

    return weak_direction->submap[other] >= 0 &&
           cairn_weak_direction_are_parallel(a->along, b->along) &&
           cairn_abs(a->deviation - b->deviation) <=
               MAX_SIGMA_DIFFERENCE * cairn_max(a->deviation, b->deviation) &&
           disjoint_sets_root(weak_direction->submap, scan) !=
               disjoint_sets_root(weak_direction->submap, other);
}

/* Advances to the next pair of scans that may be in one submap and are not yet, over the pairs of
 * one unit at most. 1: it is found. */
static int find_candidate(cairn_weak_direction *weak_direction)
{
    struct weak_direction_clustering *at = &weak_direction->phase.clustering;

    for (int32_t left = WEAK_DIRECTION_SCANS_PER_UNIT;
         left > 0 && at->scan < weak_direction->scan_count; left--) {
        if (weak_direction->submap[at->scan] < 0 || at->other == at->scan) {
            at->scan++;
            at->other = 0;
        } else if (is_candidate(weak_direction, at->scan, at->other)) {
            return 1;
        } else {
            at->other++;
        }
    }
    return 0;
}

/* Units of the test for a shared wall: each segment of one scan against all of the other. */
static int32_t shared_wall_units(const cairn_weak_direction *weak_direction)
{
    const struct weak_direction_clustering *at = &weak_direction->phase.clustering;
    int64_t segments = cairn_weak_direction_segments_of(weak_direction, at->scan),
            others = cairn_weak_direction_segments_of(weak_direction, at->other);

    return 3 + (int32_t)(segments * (1 + others) / SEGMENT_TESTS_PER_UNIT);
}

/* Unites the clusters of the two scans when they share a wall. */
static void unite_at_shared_wall(cairn_weak_direction *weak_direction, int32_t scan, int32_t other)
{
    const weak_direction_scan *a = &weak_direction->scans[scan], *b = &weak_direction->scans[other];
    cairn_vec2 along =
        cairn_transform_direction(cairn_transform_of(cairn_pose_inverse(a->map_scan)), a->along);

    if (cairn_aligner_share_wall(weak_direction->aligner, scan, other,
                                 cairn_pose_between(b->map_scan, a->map_scan), along, NULL))
        (void)disjoint_sets_unite(weak_direction->submap, scan, other);
}

int cairn_weak_direction_cluster(cairn_weak_direction *weak_direction, cairn_budget *budget)
{
    struct weak_direction_clustering *at = &weak_direction->phase.clustering;

    CAIRN_STEP_BEGIN(weak_direction->phase_resume);
    at->scan = at->other = 0;
    while (at->scan < weak_direction->scan_count) {
        CAIRN_STEP_CHARGE(weak_direction, phase_resume, budget, 1);
        if (!find_candidate(weak_direction))
            continue;
        CAIRN_STEP_CHARGE(weak_direction, phase_resume, budget, shared_wall_units(weak_direction));
        unite_at_shared_wall(weak_direction, at->scan, at->other);
        at->other++;
    }
    CAIRN_STEP_END(weak_direction->phase_resume);
}

/* ---- Submaps ---- */

/* Returns a new submap of a scan; NO_SUBMAP beyond max_submaps: the scan stays. */
static int32_t new_submap(cairn_weak_direction *weak_direction, int32_t scan)
{
    if (weak_direction->submap_count > weak_direction->params.max_submaps) {
        weak_direction->result.dropped++;
        return WEAK_DIRECTION_NO_SUBMAP;
    }
    weak_direction->result.weak_submaps++;
    weak_direction->submaps[weak_direction->submap_count].along = weak_direction->scans[scan].along;
    return weak_direction->submap_count++;
}

/* Returns the number of a scan's submap. The scan above it in the tree of its set is before it, and
 * has its number. */
static int32_t number_of(cairn_weak_direction *weak_direction, int32_t scan)
{
    int32_t above = weak_direction->submap[scan];

    if (above == WEAK_DIRECTION_OBSERVABLE)
        return WEAK_DIRECTION_FIXED_SUBMAP;
    if (above == WEAK_DIRECTION_NO_SUBMAP)
        return WEAK_DIRECTION_NO_SUBMAP;
    return above == scan ? new_submap(weak_direction, scan) : weak_direction->submap[above];
}

/* Adds the offset of the initial pose, too. The scans of the fixed submap are counted. */
void cairn_weak_direction_number_scan(cairn_weak_direction *weak_direction, int32_t scan)
{
    const weak_direction_scan *of = &weak_direction->scans[scan];
    cairn_pose expected = cairn_pose_compose(weak_direction->phase.items.map_initial, of->initial);
    int32_t number = number_of(weak_direction, scan);
    weak_direction_submap *submap;

    weak_direction->submap[scan] = number;
    if (number == WEAK_DIRECTION_NO_SUBMAP)
        return;
    submap = &weak_direction->submaps[number];
    submap->scans += number != WEAK_DIRECTION_FIXED_SUBMAP;
    submap->initial_offset.x += expected.x - of->map_scan.x;
    submap->initial_offset.y += expected.y - of->map_scan.y;
}

void cairn_weak_direction_fit_initial_poses(cairn_weak_direction *weak_direction)
{
    weak_direction->phase.items.map_initial =
        cairn_pose_fit(weak_direction->fixed_initial, weak_direction->fixed_map, NULL,
                       weak_direction->submaps[WEAK_DIRECTION_FIXED_SUBMAP].scans, 1);
}
