/* Centre points of all pairs of edgels, as Adluru 2008 has them (section 3.3, fig. 3.2).
 *
 * Method: the normals of both edgels meet the bisector of their chord in a place each; the CP
 * lies in the middle of the two, the radius is its distance to both edgels. Pairs whose radius
 * lies in the range and whose disc is about tangential are CPs, all of them: when there are more
 * than max_centres, every other one is dropped and from then on one in twice as many is kept. */
#include "src/core/build.h"

#include "src/contour/skeleton_grouping_written.h"

/* Normals that are farther from the chord than this (cosine: 75 degrees) have no projection onto
 * its bisector. */
#define LEAST_COSINE CAIRN_REAL(0.26)
/* Pairs of edgels that are looked at, and CPs that are moved, in one unit. */
enum { PAIRS_A_UNIT = 2, MOVED_A_UNIT = 16 };

written_rule cairn_skeleton_written_rule(const cairn_skeleton *g, cairn_real margin)
{
    written_rule rule;

    rule.low = cairn_max(g->low - margin, 1);
    rule.high = g->high + margin;
    rule.deviation = g->params.symmetry;
    rule.twice_cosine = cairn_cos(cairn_min(2 * g->params.symmetry, CAIRN_PI));
    return rule;
}

/* How far along the bisector, from the chord's middle, a normal meets it, of the chord's length.
 * 0: too far. */
static int projection_of(cairn_vec2 normal, cairn_vec2 along, cairn_real *share)
{
    cairn_real facing = cairn_vec2_dot(normal, along);

    if (cairn_abs(facing) < LEAST_COSINE)
        return 0;
    *share = CAIRN_REAL(0.5) * cairn_vec2_cross(along, normal) / facing;
    return 1;
}

/* The normal turned towards the centre, and how far it deviates from the way there. 0: by more
 * than the rule allows of any. */
static int deviation_of(const written_rule *rule, cairn_vec2 normal, cairn_vec2 way,
                        cairn_real radius, cairn_vec2 *inward, cairn_real *deviation)
{
    cairn_real along = cairn_vec2_dot(normal, way);

    *inward = along < 0 ? cairn_vec2_scale(normal, -1) : normal;
    if (cairn_abs(along) < rule->twice_cosine * radius)
        return 0;
    *deviation = cairn_atan2(cairn_abs(cairn_vec2_cross(normal, way)), cairn_abs(along));
    return 1;
}

int cairn_skeleton_written_pair(const cairn_skeleton *g, const written_rule *rule, int32_t first,
                                int32_t second, written_pair *pair)
{
    const skeleton_edgel *a = &g->edgels[first], *b = &g->edgels[second];
    cairn_vec2 chord = cairn_vec2_sub(b->at, a->at), along, middle;
    cairn_real squared = cairn_vec2_norm_squared(chord), length, share[2], up;

    if (squared == 0 || squared > 4 * rule->high * rule->high)
        return 0;
    length = cairn_sqrt(squared);
    along = cairn_vec2_scale(chord, 1 / length);
    if (!projection_of(a->normal, along, &share[0]) ||
        !projection_of(b->normal, cairn_vec2_scale(along, -1), &share[1]))
        return 0;
    /* Seen from the second edgel the bisector runs the other way. */
    up = length * CAIRN_REAL(0.5) * (share[0] - share[1]);
    pair->radius = cairn_sqrt(CAIRN_REAL(0.25) * squared + up * up);
    if (pair->radius < rule->low || pair->radius > rule->high)
        return 0;
    middle = cairn_vec2_scale(cairn_vec2_add(a->at, b->at), CAIRN_REAL(0.5));
    pair->centre = cairn_vec2_add(middle, cairn_vec2_scale(cairn_vec2_left(along), up));
    if (!deviation_of(rule, a->normal, cairn_vec2_sub(pair->centre, a->at), pair->radius,
                      &pair->inward[0], &pair->deviation[0]) ||
        !deviation_of(rule, b->normal, cairn_vec2_sub(pair->centre, b->at), pair->radius,
                      &pair->inward[1], &pair->deviation[1]))
        return 0;
    pair->touch[0] = a->at;
    pair->touch[1] = b->at;
    pair->edgel[0] = first;
    pair->edgel[1] = second;
    pair->crossed = 0;
    return pair->deviation[0] + pair->deviation[1] <= 2 * rule->deviation;
}

/* One in `stride` of those seen. */
static void keep(cairn_skeleton *g, const written_pair *pair)
{
    skeleton_written *w = g->written;
    int64_t number = w->seen++;
    skeleton_centre *c;

    if (number % w->stride != 0)
        return;
    if (g->centre_count == g->params.max_centres) {
        g->paid -= g->centre_count / MOVED_A_UNIT;
        g->centre_count = (g->centre_count + 1) / 2;
        for (int32_t i = 1; i < g->centre_count; i++)
            g->centres[i] = g->centres[2 * i];
        w->stride *= 2;
        if (number % w->stride != 0 || g->centre_count == g->params.max_centres)
            return;
    }
    c = &g->centres[g->centre_count++];
    c->at = pair->centre;
    c->radius = pair->radius;
    c->deviation = CAIRN_REAL(0.5) * (pair->deviation[0] + pair->deviation[1]);
    for (int32_t side = 0; side < 2; side++) {
        c->edgel[side] = pair->edgel[side];
        c->sense[side] = SKELETON_DARKER;
    }
}

/* Pairs of one edgel with those behind it in the list, as far as discs of the largest radius
 * reach. */
static int pairs_of(cairn_skeleton *g, int32_t edgel, cairn_budget *budget)
{
    cairn_vec2 at = g->edgels[edgel].at;
    cairn_real reach = 2 * g->high;
    int32_t x0 = cairn_skeleton_column(g, at.x - reach),
            x1 = cairn_skeleton_column(g, at.x + reach);
    int32_t y0 = cairn_skeleton_line(g, at.y), y1 = cairn_skeleton_line(g, at.y + reach);
    int32_t cost = 2 + SKELETON_EDGELS_A_UNIT / PAIRS_A_UNIT * skeleton_cost(g, x0, x1, y0, y1);
    written_rule rule;

    if (!cairn_budget_pay(budget, &g->paid, cost))
        return 0;
    rule = cairn_skeleton_written_rule(g, 0);
    for (int32_t y = y0; y <= y1; y++) {
        int32_t from, end;

        skeleton_row(g, y, x0, x1, &from, &end);
        for (int32_t i = from > edgel + 1 ? from : edgel + 1; i < end; i++) {
            written_pair pair;

            if (cairn_skeleton_written_pair(g, &rule, edgel, i, &pair))
                keep(g, &pair);
        }
    }
    return 1;
}

/* One pass over all edgels. centres_seen: those that are kept. */
static cairn_status step_pairs(cairn_skeleton *g, cairn_budget *budget)
{
    if (g->cursor == 0) {
        g->centre_count = 0;
        g->written->seen = 0;
        g->written->stride = 1;
    }
    for (; g->cursor < g->edgel_count; g->cursor++)
        if (!pairs_of(g, g->cursor, budget))
            return CAIRN_MORE;
    g->centres_seen = g->centre_count;
    return CAIRN_OK;
}

cairn_status cairn_skeleton_written_centres(cairn_skeleton *g, cairn_budget *budget)
{
    if (g->cursor == 0)
        cairn_skeleton_set_limits(g);
    return step_pairs(g, budget);
}

/* Where no range is given it is proposed from those CPs, and the CPs are looked for anew within
 * it. */
cairn_status cairn_skeleton_written_range(cairn_skeleton *g, cairn_budget *budget)
{
    cairn_status status = CAIRN_OK;

    if (g->item == 0 && g->input.max_radius == 0) {
        status = cairn_skeleton_propose_range(g, budget);
        if (status != CAIRN_OK)
            return status;
        g->low = g->input.min_radius;
        g->high = g->input.max_radius;
        g->cursor = 0;
        g->item = 1;
    }
    if (g->item == 1)
        status = step_pairs(g, budget);
    if (status == CAIRN_OK)
        g->centres_seen = g->written->seen < INT32_MAX ? (int32_t)g->written->seen : INT32_MAX;
    return status;
}
