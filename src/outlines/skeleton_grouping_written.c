/* Centre points of all pairs of edgels (Adluru 2008, section 3.3, fig. 3.2).
 *
 * Method:
 * 1. The normals of both edgels intersect the bisector of their chord; the CP is the midpoint of
 *    both intersections, the radius its distance to either edgel.
 * 2. All pairs with a radius in the range and an approximately tangential disc are CPs.
 * 3. Beyond max_centres every other CP is dropped and the subsampling stride doubles. */
#include "src/base/build.h"

#include "src/outlines/skeleton_grouping_written.h"

/* Least cosine of the angle between a normal and the chord (75 degrees); beyond it the normal
 * has no projection onto the bisector. */
#define MIN_COSINE CAIRN_REAL(0.26)
/* Edgel pairs, and moved CPs, per work unit. */
enum { PAIRS_PER_UNIT = 2, MOVES_PER_UNIT = 16 };

skeleton_grouping_written_limits
cairn_skeleton_grouping_written_limits_of(const cairn_skeleton_grouping *skeleton,
                                          cairn_real margin)
{
    skeleton_grouping_written_limits rule;

    rule.min_radius = cairn_max(skeleton->min_search_radius - margin, 1);
    rule.max_radius = skeleton->max_search_radius + margin;
    rule.max_deviation = skeleton->params.symmetry_sigma;
    rule.min_cosine = cairn_cos(cairn_min(2 * skeleton->params.symmetry_sigma, CAIRN_PI));
    return rule;
}

/* Computes where a normal intersects the bisector, relative to the chord's length from its
 * middle; returns 0 if it is too far. */
static int projection_of(cairn_vec2 normal, cairn_vec2 along, cairn_real *share)
{
    cairn_real facing = cairn_vec2_dot(normal, along);

    if (cairn_abs(facing) < MIN_COSINE)
        return 0;
    *share = CAIRN_REAL(0.5) * cairn_vec2_cross(along, normal) / facing;
    return 1;
}

/* Orients the normal towards the centre and computes its deviation from the vector to the
 * centre; returns 0 if it is beyond the limit of a single deviation. */
static int deviation_of(const skeleton_grouping_written_limits *rule, cairn_vec2 normal,
                        cairn_vec2 radial, cairn_real radius, cairn_vec2 *inward,
                        cairn_real *deviation)
{
    cairn_real along = cairn_vec2_dot(normal, radial);

    *inward = along < 0 ? cairn_vec2_scale(normal, -1) : normal;
    if (cairn_abs(along) < rule->min_cosine * radius)
        return 0;
    *deviation = cairn_atan2(cairn_abs(cairn_vec2_cross(normal, radial)), cairn_abs(along));
    return 1;
}

int cairn_skeleton_grouping_written_pair(const cairn_skeleton_grouping *skeleton,
                                         const skeleton_grouping_written_limits *rule,
                                         int32_t first, int32_t second,
                                         skeleton_grouping_written_pair *pair)
{
    const skeleton_grouping_edgel *a = &skeleton->edgels[first], *b = &skeleton->edgels[second];
    cairn_vec2 chord = cairn_vec2_sub(b->position, a->position), along, middle;
    cairn_real squared = cairn_vec2_norm_squared(chord), length, share[2], up;

    if (squared == 0 || squared > 4 * rule->max_radius * rule->max_radius)
        return 0;
    length = cairn_sqrt(squared);
    along = cairn_vec2_scale(chord, 1 / length);
    if (!projection_of(a->normal, along, &share[0]) ||
        !projection_of(b->normal, cairn_vec2_scale(along, -1), &share[1]))
        return 0;
    /* Seen from the second edgel the bisector has the opposite direction. */
    up = length * CAIRN_REAL(0.5) * (share[0] - share[1]);
    pair->radius = cairn_sqrt(CAIRN_REAL(0.25) * squared + up * up);
    if (pair->radius < rule->min_radius || pair->radius > rule->max_radius)
        return 0;
    middle = cairn_vec2_scale(cairn_vec2_add(a->position, b->position), CAIRN_REAL(0.5));
    pair->centre = cairn_vec2_add(middle, cairn_vec2_scale(cairn_vec2_left_perp(along), up));
    if (!deviation_of(rule, a->normal, cairn_vec2_sub(pair->centre, a->position), pair->radius,
                      &pair->inward[0], &pair->deviation[0]) ||
        !deviation_of(rule, b->normal, cairn_vec2_sub(pair->centre, b->position), pair->radius,
                      &pair->inward[1], &pair->deviation[1]))
        return 0;
    pair->contact[0] = a->position;
    pair->contact[1] = b->position;
    pair->edgel[0] = first;
    pair->edgel[1] = second;
    pair->is_crossing = 0;
    return pair->deviation[0] + pair->deviation[1] <= 2 * rule->max_deviation;
}

/* Drops every other CP. */
static void drop_centres(cairn_skeleton_grouping *skeleton)
{
    skeleton->centre_count = (skeleton->centre_count + 1) / 2;
    for (int32_t i = 1; i < skeleton->centre_count; i++)
        skeleton->centres[i] = skeleton->centres[2 * i];
    skeleton->written->stride *= 2;
}

/* Adds one in `stride` CPs. Returns 0, without the CP, when the capacity is used up. */
static int add_centre(cairn_skeleton_grouping *skeleton, const skeleton_grouping_written_pair *pair)
{
    skeleton_grouping_written *written = skeleton->written;
    int is_kept = written->pairs_seen % written->stride == 0;
    skeleton_grouping_centre *c;

    if (is_kept && skeleton->centre_count == skeleton->params.max_centres)
        return 0;
    written->pairs_seen++;
    if (!is_kept)
        return 1;
    c = &skeleton->centres[skeleton->centre_count++];
    c->position = pair->centre;
    c->radius = pair->radius;
    c->deviation = CAIRN_REAL(0.5) * (pair->deviation[0] + pair->deviation[1]);
    for (int32_t side = 0; side < 2; side++) {
        c->edgel[side] = pair->edgel[side];
        c->polarity[side] = SKELETON_GROUPING_DARKER;
    }
    return 1;
}

/* Grid cells of the later partners of an edgel, within the largest disc's diameter. */
static cell_range partner_cells(const cairn_skeleton_grouping *skeleton, int32_t edgel)
{
    cairn_vec2 at = skeleton->edgels[edgel].position;
    cairn_real reach = 2 * skeleton->max_search_radius;
    cairn_box box = {{at.x - reach, at.y}, {at.x + reach, at.y + reach}};

    return cairn_skeleton_grouping_cells(skeleton, box);
}

/* Cost of pairing an edgel in units. */
static int32_t pairing_cost(const cairn_skeleton_grouping *skeleton, int32_t edgel)
{
    return 2 + SKELETON_GROUPING_EDGELS_PER_UNIT / PAIRS_PER_UNIT *
                   skeleton_grouping_cells_cost(skeleton, partner_cells(skeleton, edgel));
}

/* Starts to pair the edgel with all later edgels of the index. */
static void begin_pairing(cairn_skeleton_grouping *skeleton)
{
    skeleton->partner_row = partner_cells(skeleton, skeleton->paired).y0;
    skeleton->partner = skeleton->paired + 1;
}

/* Pairs the edgel with the later edgels that are left. Returns 0 when the capacity of CPs is used up
 * before. */
static int pair_edgel(cairn_skeleton_grouping *skeleton)
{
    cell_range cells = partner_cells(skeleton, skeleton->paired);
    skeleton_grouping_written_limits rule = cairn_skeleton_grouping_written_limits_of(skeleton, 0);

    for (; skeleton->partner_row <= cells.y1; skeleton->partner_row++) {
        int32_t from, end;

        skeleton_grouping_cells_of_row(skeleton, cells, skeleton->partner_row, &from, &end);
        if (skeleton->partner < from)
            skeleton->partner = from;
        for (; skeleton->partner < end; skeleton->partner++) {
            skeleton_grouping_written_pair pair;

            if (cairn_skeleton_grouping_written_pair(skeleton, &rule, skeleton->paired,
                                                     skeleton->partner, &pair) &&
                !add_centre(skeleton, &pair))
                return 0;
        }
    }
    return 1;
}

int cairn_skeleton_grouping_written_centres(cairn_skeleton_grouping *skeleton, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(skeleton->phase_resume);
    skeleton->centre_count = 0;
    skeleton->written->pairs_seen = 0;
    skeleton->written->stride = 1;
    for (skeleton->paired = 0; skeleton->paired < skeleton->edgel_count; skeleton->paired++) {
        CAIRN_STEP_CHARGE(skeleton, phase_resume, budget, pairing_cost(skeleton, skeleton->paired));
        begin_pairing(skeleton);
        while (!pair_edgel(skeleton)) {
            CAIRN_STEP_CHARGE(skeleton, phase_resume, budget,
                              skeleton->centre_count / MOVES_PER_UNIT);
            drop_centres(skeleton);
        }
    }
    skeleton->centres_found = skeleton->centre_count;
    CAIRN_STEP_END(skeleton->phase_resume);
}
