/* aligner: queries about a completed alignment: shared walls, candidate pairs, free-space
 * violations. */
#include "src/base/build.h"

#include "src/alignment/aligner_work.h"

/* m */
static const cairn_real MAX_WALL_DISTANCE_M = CAIRN_REAL(0.03), COUNT_GATE_M = CAIRN_REAL(0.07);
/* sine of 30 degrees */
static const cairn_real MIN_CROSS_SINE = CAIRN_REAL(0.5);

enum { TESTS_PER_UNIT = 16 }; /* tests of two segments per unit */

static int has_scan(const cairn_aligner *aligner, int32_t scan)
{
    return aligner != NULL && scan >= 0 && scan < aligner->scan_count;
}

/* Returns 1 when two segments of one wall also lie on one line; the first scan's pose in the
 * second's frame is second_first. */
static int is_same_wall(const aligner_segment *a, const aligner_segment *b,
                        cairn_transform second_first)
{
    cairn_vec2 direction, way;

    if (a->wall < 0 || a->wall != b->wall)
        return 0;
    direction = cairn_transform_direction(second_first, a->direction);
    way = cairn_vec2_sub(b->mean, cairn_transform_point(second_first, a->mean));
    return cairn_abs(cairn_vec2_cross(direction, way)) <= MAX_WALL_DISTANCE_M;
}

int32_t cairn_aligner_share_wall(const cairn_aligner *aligner, int32_t first, int32_t second,
                                 cairn_pose second_first, cairn_vec2 along, int32_t *units)
{
    int32_t tests = 0, found = 0,
            end = has_scan(aligner, first) && aligner->has_ended ? aligner->scans[first].end_segment
                                                                 : 0;
    cairn_transform pose = cairn_transform_of(second_first);

    if (!has_scan(aligner, second))
        end = 0;
    for (int32_t i = end > 0 ? aligner->scans[first].first_segment : 0; i < end && !found;
         i++, tests++) {
        if (cairn_abs(cairn_vec2_cross(aligner->segments[i].direction, along)) < MIN_CROSS_SINE)
            continue;
        for (int32_t j = aligner->scans[second].first_segment;
             j < aligner->scans[second].end_segment && !found; j++, tests++)
            found = is_same_wall(&aligner->segments[i], &aligner->segments[j], pose);
    }
    if (units != NULL)
        *units = 1 + tests / TESTS_PER_UNIT;
    return found;
}

int32_t cairn_aligner_is_candidate_pair(const cairn_aligner *aligner, int32_t first, int32_t second)
{
    return has_scan(aligner, first) && has_scan(aligner, second) &&
           cairn_aligner_has_neighbour(aligner, first, second, ALIGNER_MAX_NEIGHBOURS);
}

cairn_real cairn_aligner_free_space_violation(const cairn_aligner *aligner, int32_t first,
                                              int32_t second, cairn_pose second_first,
                                              int32_t *units)
{
    static const cairn_transform same = {0, 0, 1, 0};
    cairn_transform pose = cairn_transform_of(second_first);
    aligner_count count = {.free_space = 0};
    cairn_budget all = {CAIRN_UNBOUNDED};
    aligner_walk walk;

    if (units != NULL)
        *units = 1;
    if (!has_scan(aligner, first) || !has_scan(aligner, second) ||
        !cairn_aligner_may_overlap(aligner, first, second, pose, same))
        return 0;
    cairn_aligner_begin_count(aligner, &walk, first, second, pose, COUNT_GATE_M, &count);
    (void)cairn_aligner_walk_pair(aligner, &walk, &all);
    if (units != NULL)
        *units += walk.lookups;
    count.same_surface = 0;
    return cairn_aligner_log_likelihood_ratio(aligner, count);
}
