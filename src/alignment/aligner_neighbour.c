/* aligner: neighbours of the scans: candidate pairs for all comparisons.
 *
 * Method: nearness of two scans by their initial poses: the number of patches of either that may be
 * visible to the other, then the distance of what they see.
 * 1. Each scan's neighbours are the nearest scans.
 * 2. The relation is made symmetric within the capacity, so that isolated scans have neighbours and
 *    scans among many others not more than the limit. */
#include "src/base/build.h"

#include "src/alignment/aligner_work.h"

#include "src/containers/ranked_list.h"

/* points of both scans, in patches of which one unit tests about six */
enum { POINTS_PER_UNIT = 6 * ALIGNER_PATCH_POINTS };

static int may_ever_overlap(const cairn_aligner *aligner, int32_t i, int32_t j)
{
    const aligner_scan *a = &aligner->scans[i], *b = &aligner->scans[j];
    cairn_real dx = a->initial.x - b->initial.x, dy = a->initial.y - b->initial.y;
    cairn_real reach = a->extent + b->extent + 2 * aligner->params.max_initial_error;

    return dx * dx + dy * dy <= reach * reach;
}

/* Returns the nearness of two scans by their initial poses; negative: no overlap, or not above
 * `least`. */
static cairn_real nearness_of(const cairn_aligner *aligner, int32_t i, int32_t j, cairn_real least)
{
    cairn_transform map_i = aligner->poses[i], map_j = aligner->poses[j];
    cairn_vec2 p, q;
    int32_t shown = 0;

    if (cairn_aligner_may_overlap(aligner, i, j, map_i, map_j))
        shown = cairn_aligner_visible_patches(aligner, i, j, cairn_transform_between(map_i, map_j));
    if ((cairn_real)shown + 1 <= least)
        return -1;
    p = cairn_transform_point(map_i, aligner->scans[i].middle);
    q = cairn_transform_point(map_j, aligner->scans[j].middle);
    return (cairn_real)shown + 1 / (1 + cairn_vec2_norm_squared(cairn_vec2_sub(p, q)));
}

static void insert_nearest(cairn_aligner *aligner, cairn_real nearness, int32_t scan)
{
    aligner_neighbour neighbour = {.nearness = nearness, .scan = scan};
    ranked_list nearest = {.entries = aligner->pairs.nearest,
                           .count = &aligner->pairs.nearest_count,
                           .capacity = ALIGNER_NEAREST_SCANS,
                           .entry_bytes = sizeof neighbour,
                           .score_at = offsetof(aligner_neighbour, nearness)};

    (void)ranked_list_add(&nearest, &neighbour);
}

/* Returns the units of the comparison of the current scan with the current other one. */
static int32_t units_of_pair(const cairn_aligner *aligner)
{
    int32_t i = aligner->cursor.scan, j = aligner->cursor.neighbour;

    return cairn_aligner_may_overlap(aligner, i, j, aligner->poses[i], aligner->poses[j])
               ? (cairn_aligner_points_of(aligner, i) + cairn_aligner_points_of(aligner, j)) /
                     POINTS_PER_UNIT
               : 0;
}

/* Compares the current scan with the current other one; stores the nearest. */
static void compare(cairn_aligner *aligner)
{
    cairn_real least = aligner->pairs.nearest_count == ALIGNER_NEAREST_SCANS
                           ? aligner->pairs.nearest[ALIGNER_NEAREST_SCANS - 1].nearness
                           : -1;
    cairn_real nearness =
        nearness_of(aligner, aligner->cursor.scan, aligner->cursor.neighbour, least);

    if (nearness >= 0)
        insert_nearest(aligner, nearness, aligner->cursor.neighbour);
}

/* Stores the neighbours of the current scan. */
static void store_nearest(cairn_aligner *aligner)
{
    uint16_t *neighbours = &aligner->neighbours[ALIGNER_MAX_NEIGHBOURS * aligner->cursor.scan];

    for (int32_t k = 0; k < aligner->pairs.nearest_count; k++)
        neighbours[k] = (uint16_t)aligner->pairs.nearest[k].scan;
    aligner->scans[aligner->cursor.scan].neighbour_count = aligner->pairs.nearest_count;
}

int cairn_aligner_has_neighbour(const cairn_aligner *aligner, int32_t scan, int32_t neighbour,
                                int32_t most)
{
    for (int32_t k = 0; k < aligner->scans[scan].neighbour_count && k < most; k++)
        if (cairn_aligner_neighbour(aligner, scan, k) == neighbour)
            return 1;
    return 0;
}

/* Makes the neighbour relation of the current scan symmetric; it loses neighbours without
 * capacity. */
static void symmetrize(cairn_aligner *aligner)
{
    aligner_scan *scan = &aligner->scans[aligner->cursor.scan];
    uint16_t *neighbours = &aligner->neighbours[ALIGNER_MAX_NEIGHBOURS * aligner->cursor.scan];
    int32_t kept = 0;

    for (int32_t k = 0; k < scan->neighbour_count; k++) {
        int32_t j = neighbours[k];

        if (!cairn_aligner_has_neighbour(aligner, j, aligner->cursor.scan,
                                         ALIGNER_MAX_NEIGHBOURS)) {
            if (aligner->scans[j].neighbour_count == ALIGNER_MAX_NEIGHBOURS)
                continue;
            aligner->neighbours[ALIGNER_MAX_NEIGHBOURS * j + aligner->scans[j].neighbour_count++] =
                (uint16_t)aligner->cursor.scan;
        }
        neighbours[kept++] = (uint16_t)j;
    }
    scan->neighbour_count = kept;
}

int cairn_aligner_find_neighbours(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_cursor *cursor = &aligner->cursor;

    CAIRN_STEP_BEGIN(aligner->resume.phase);
    for (cursor->scan = 0; cursor->scan < aligner->scan_count; cursor->scan++) {
        aligner->pairs.nearest_count = 0;
        for (cursor->neighbour = 0; cursor->neighbour < aligner->scan_count; cursor->neighbour++) {
            ALIGNER_CHARGE(phase, 1);
            if (cursor->neighbour == cursor->scan ||
                !may_ever_overlap(aligner, cursor->scan, cursor->neighbour))
                continue;
            ALIGNER_CHARGE(phase, units_of_pair(aligner));
            compare(aligner);
        }
        store_nearest(aligner);
    }
    for (cursor->scan = 0; cursor->scan < aligner->scan_count; cursor->scan++) {
        ALIGNER_CHARGE(phase, ALIGNER_MAX_NEIGHBOURS / 4);
        symmetrize(aligner);
    }
    CAIRN_STEP_END(aligner->resume.phase);
}
