/* The partners of the scans: those that each is held against.
 *
 * By the initial poses, two scans are the nearer the more of the points of one the other may
 * show, patch by patch, and the closer what they see lies. Each scan has the nearest as its
 * partners, and with them the scans that it is among the nearest of, as far as there is room; so
 * a scan that few are near to has partners as well, and one among many has not more than it can
 * be compared with. Nothing is ever looked up between scans that are no partners. */
#include "src/core/build.h"

#include "src/mapping/aligner_work.h"

static int may_ever_meet(const cairn_aligner *x, int32_t i, int32_t j)
{
    const aligner_scan *a = &x->scans[i], *b = &x->scans[j];
    cairn_real dx = a->initial.x - b->initial.x, dy = a->initial.y - b->initial.y;
    cairn_real reach = a->extent + b->extent + 2 * x->params.spread;

    return dx * dx + dy * dy <= reach * reach;
}

/* Nearness of two scans by their initial poses; negative: they cannot meet, or it is no more
 * than `least`. */
static cairn_real nearness_of(const cairn_aligner *x, int32_t i, int32_t j, cairn_real least)
{
    cairn_transform map_i = x->poses[i], map_j = x->poses[j];
    cairn_vec2 p, q;
    int32_t shown = 0;

    if (!may_ever_meet(x, i, j))
        return -1;
    if (cairn_aligner_may_meet(x, i, j, map_i, map_j))
        shown = cairn_aligner_shown(x, i, j, cairn_aligner_between(map_i, map_j));
    if ((cairn_real)shown + 1 <= least)
        return -1;
    p = cairn_transform_point(map_i, x->scans[i].middle);
    q = cairn_transform_point(map_j, x->scans[j].middle);
    return (cairn_real)shown + 1 / (1 + cairn_vec2_norm_squared(cairn_vec2_sub(p, q)));
}

/* Keeps the greatest. */
static void keep_nearest(cairn_aligner *x, cairn_real nearness, int32_t scan)
{
    int32_t at = x->nearest_count;

    if (at < ALIGNER_NEAREST)
        x->nearest_count++;
    else if (nearness <= x->nearest[--at].nearness)
        return;
    for (; at > 0 && x->nearest[at - 1].nearness < nearness; at--)
        x->nearest[at] = x->nearest[at - 1];
    x->nearest[at].nearness = nearness;
    x->nearest[at].scan = scan;
}

/* Some scans beside scan i; when these are all, the nearest are its partners. */
static int32_t find_nearest(cairn_aligner *x)
{
    enum { SCANS_OF_ITEM = 8 };
    uint16_t *partners = &x->partners[ALIGNER_PARTNERS * x->i];
    int32_t units = 1;

    for (int32_t k = 0; k < SCANS_OF_ITEM && x->j < x->scan_count; k++, x->j++)
        if (x->j != x->i) {
            cairn_real least =
                x->nearest_count == ALIGNER_NEAREST ? x->nearest[ALIGNER_NEAREST - 1].nearness : -1;
            cairn_real nearness = nearness_of(x, x->i, x->j, least);

            units += nearness < 1 ? 1 : 4;
            if (nearness >= 0)
                keep_nearest(x, nearness, x->j);
        }
    if (x->j < x->scan_count)
        return units;
    for (int32_t k = 0; k < x->nearest_count; k++)
        partners[k] = (uint16_t)x->nearest[k].scan;
    x->scans[x->i].partner_count = x->nearest_count;
    x->nearest_count = x->j = 0;
    if (++x->i == x->scan_count) {
        x->i = 0;
        x->phase = ALIGNER_MUTUAL;
    }
    return units;
}

int cairn_aligner_has_partner(const cairn_aligner *x, int32_t scan, int32_t partner, int32_t most)
{
    for (int32_t k = 0; k < x->scans[scan].partner_count && k < most; k++)
        if (cairn_aligner_partner(x, scan, k) == partner)
            return 1;
    return 0;
}

/* Makes scan i a partner of its partners; it loses those that have no room for it. */
static int32_t make_mutual(cairn_aligner *x)
{
    aligner_scan *scan = &x->scans[x->i];
    uint16_t *partners = &x->partners[ALIGNER_PARTNERS * x->i];
    int32_t kept = 0;

    for (int32_t k = 0; k < scan->partner_count; k++) {
        int32_t j = partners[k];

        if (!cairn_aligner_has_partner(x, j, x->i, ALIGNER_PARTNERS)) {
            if (x->scans[j].partner_count == ALIGNER_PARTNERS)
                continue;
            x->partners[ALIGNER_PARTNERS * j + x->scans[j].partner_count++] = (uint16_t)x->i;
        }
        partners[kept++] = (uint16_t)j;
    }
    scan->partner_count = kept;
    if (++x->i == x->scan_count) {
        x->i = 0;
        x->phase = ALIGNER_PAIRS;
    }
    return ALIGNER_PARTNERS / 4;
}

int32_t cairn_aligner_partner_item(cairn_aligner *x)
{
    return x->phase == ALIGNER_NEAR ? find_nearest(x) : make_mutual(x);
}
