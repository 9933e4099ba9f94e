/* Centre points: each edgel is paired with the edgel that faces it best, on either side; radius
 * range from the histogram of CP radii.
 *
 * Method:
 * 1. Candidate partners lie in a wedge about the edgel's normal; only grid cells that overlap the
 *    wedge are searched.
 * 2. The cost of a pair is its asymmetry, plus a penalty for opposite contrast polarity and for a
 *    large radius. The disc between two edges should be empty, and an object is mostly darker or
 *    brighter than its surroundings.
 * 3. The range of radii is proposed from the mode of the radius histogram. */
#include "src/base/build.h"

#include "cairn/symmetric_point.h"
#include "src/outlines/skeleton_grouping_work.h"

/* Least cosine of the angle between a normal and the chord: 35 degrees. */
#define MIN_FACING_COSINE CAIRN_REAL(0.82)
/* Costs of opposite polarity, of the largest radius against the least, and the greatest cost of
 * a pair, in half squared standard deviations of the asymmetry. */
#define POLARITY_CHANGE_COST CAIRN_REAL(1.5)
#define MAX_RADIUS_COST      CAIRN_REAL(1.0)
#define MAX_PAIR_COST        CAIRN_REAL(4.0)
/* Factors by which the searched radii extend below and above the range. Large discs often lie
 * between objects. */
#define RANGE_MARGIN_BELOW CAIRN_REAL(1.6)
#define RANGE_MARGIN_ABOVE CAIRN_REAL(1.25)
/* Search limits of radii without a given range: px, and share of the image's shorter side. */
#define MIN_RADIUS_PX    CAIRN_REAL(3.0)
#define MAX_RADIUS_SHARE CAIRN_REAL(0.15)
enum { BINS_PER_OCTAVE = 8, UNITS_PER_EDGEL = 4 };

/* The search region of partners. */
typedef struct search_wedge {
    cell_range cells;
    cairn_vec2 position, inward;
    int32_t polarity;
} search_wedge;

void cairn_skeleton_grouping_set_limits(cairn_skeleton_grouping *skeleton)
{
    int written = skeleton->params.mode == CAIRN_MODE_AS_WRITTEN;
    cairn_real side =
        (cairn_real)(skeleton->input.width < skeleton->input.height ? skeleton->input.width
                                                                    : skeleton->input.height);
    /* Number of edgels that fit, at two CPs each. */
    int32_t capacity = skeleton->params.max_centres > 1 ? skeleton->params.max_centres / 2 : 1;

    skeleton->stride = (int32_t)(((int64_t)skeleton->edgel_count + capacity - 1) / capacity);
    skeleton->stride = skeleton->stride > 0 ? skeleton->stride : 1;
    skeleton->min_search_radius =
        written ? skeleton->input.min_radius : skeleton->input.min_radius / RANGE_MARGIN_BELOW;
    skeleton->max_search_radius =
        written ? skeleton->input.max_radius : skeleton->input.max_radius * RANGE_MARGIN_ABOVE;
    if (skeleton->input.max_radius == 0) {
        skeleton->min_search_radius = MIN_RADIUS_PX;
        skeleton->max_search_radius = cairn_max(MAX_RADIUS_SHARE * side, MIN_RADIUS_PX);
    }
}

/* Returns the search region of an edgel on one side. */
static search_wedge search_wedge_of(const cairn_skeleton_grouping *skeleton,
                                    const skeleton_grouping_edgel *edgel, int32_t polarity)
{
    cairn_vec2 inward = skeleton_grouping_inward(edgel, polarity);
    cairn_vec2 tip =
        cairn_vec2_add(edgel->position, cairn_vec2_scale(inward, 2 * skeleton->max_search_radius));
    cairn_vec2 aside = cairn_vec2_scale(cairn_vec2_left_perp(inward),
                                        CAIRN_REAL(0.6) * 2 * skeleton->max_search_radius);
    cairn_box box = {edgel->position, edgel->position};
    search_wedge w;

    box = cairn_box_extend(cairn_box_extend(cairn_box_extend(box, tip), cairn_vec2_add(tip, aside)),
                           cairn_vec2_sub(tip, aside));
    w.cells = cairn_skeleton_grouping_cells(skeleton, box);
    w.position = edgel->position;
    w.inward = inward;
    w.polarity = polarity;
    return w;
}

/* Returns the cost of a pair in half squared standard deviations; MAX_PAIR_COST: rejected. */
static cairn_real pair_cost(const cairn_skeleton_grouping *skeleton, const search_wedge *wedge,
                            const skeleton_grouping_edgel *other, int32_t *polarity)
{
    cairn_vec2 chord = cairn_vec2_sub(other->position, wedge->position), mirrored;
    cairn_real along = cairn_vec2_dot(wedge->inward, chord),
               squared = cairn_vec2_norm_squared(chord), facing, radius, cosine;

    if (along <= 0 || along * along < MIN_FACING_COSINE * MIN_FACING_COSINE * squared ||
        squared > 4 * skeleton->max_search_radius * skeleton->max_search_radius)
        return MAX_PAIR_COST;
    facing = -cairn_vec2_dot(other->normal, chord);
    if (facing * facing < MIN_FACING_COSINE * MIN_FACING_COSINE * squared)
        return MAX_PAIR_COST;
    *polarity = facing > 0 ? SKELETON_GROUPING_BRIGHTER : SKELETON_GROUPING_DARKER;
    /* Half of the chord, divided by the mean cosine between both normals and the chord. */
    radius = squared / (along + cairn_abs(facing));
    if (radius < skeleton->min_search_radius || radius > skeleton->max_search_radius)
        return MAX_PAIR_COST;
    /* The normal reflected at the bisector; its angle to the other normal is twice the
     * deviation. */
    mirrored = cairn_vec2_sub(wedge->inward, cairn_vec2_scale(chord, 2 * along / squared));
    cosine = cairn_vec2_dot(mirrored, skeleton_grouping_inward(other, *polarity));
    return (1 - cosine) / (4 * skeleton->params.symmetry_sigma * skeleton->params.symmetry_sigma) +
           (*polarity != wedge->polarity ? POLARITY_CHANGE_COST : 0) +
           MAX_RADIUS_COST * (radius - skeleton->min_search_radius) /
               (skeleton->max_search_radius - skeleton->min_search_radius + 1);
}

/* Returns the best partner of an edgel; -1: none. */
static int32_t partner_of(const cairn_skeleton_grouping *skeleton, const search_wedge *wedge,
                          int32_t *polarity)
{
    cairn_real best = MAX_PAIR_COST;
    int32_t partner = -1;

    for (int32_t y = wedge->cells.y0; y <= wedge->cells.y1; y++) {
        int32_t from, end;

        skeleton_grouping_cells_of_row(skeleton, wedge->cells, y, &from, &end);
        for (int32_t i = from; i < end; i++) {
            int32_t s = 0;
            cairn_real cost = pair_cost(skeleton, wedge, &skeleton->edgels[i], &s);

            if (cost < best) {
                best = cost;
                partner = i;
                *polarity = s;
            }
        }
    }
    return partner;
}

static cairn_oriented_point oriented(const skeleton_grouping_edgel *edgel)
{
    cairn_oriented_point p = {edgel->position, cairn_vec2_left_perp(edgel->normal)};

    return p;
}

/* Stores the CP of two edgels. */
static void add_centre(cairn_skeleton_grouping *skeleton, int32_t first, int32_t polarity,
                       int32_t second, int32_t other_sense)
{
    skeleton_grouping_centre *c = &skeleton->centres[skeleton->centre_count];
    cairn_symmetric_point sp;

    if (skeleton->centre_count == skeleton->params.max_centres ||
        !cairn_symmetric_point_of(oriented(&skeleton->edgels[first]),
                                  oriented(&skeleton->edgels[second]), 1, &sp))
        return;
    c->position = sp.centre;
    c->radius = sp.radius;
    c->deviation = sp.deviation;
    c->edgel[0] = first;
    c->edgel[1] = second;
    c->polarity[0] = polarity;
    c->polarity[1] = other_sense;
    skeleton->centre_count++;
}

/* Cost in units of pairing an edgel on one side. */
static int32_t pairing_cost(const cairn_skeleton_grouping *skeleton, int32_t edgel,
                            int32_t polarity)
{
    search_wedge w = search_wedge_of(skeleton, &skeleton->edgels[edgel], polarity);

    return UNITS_PER_EDGEL + skeleton_grouping_cells_cost(skeleton, w.cells);
}

/* Pairs an edgel on one side with its best partner, if it has one. */
static void pair_edgel(cairn_skeleton_grouping *skeleton, int32_t edgel, int32_t polarity)
{
    search_wedge w = search_wedge_of(skeleton, &skeleton->edgels[edgel], polarity);
    int32_t other_polarity = 0, partner = partner_of(skeleton, &w, &other_polarity);

    if (partner >= 0)
        add_centre(skeleton, edgel, polarity, partner, other_polarity);
}

int cairn_skeleton_grouping_centres(cairn_skeleton_grouping *skeleton, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(skeleton->phase_resume);
    for (skeleton->edgel = 0; skeleton->edgel < skeleton->edgel_count;
         skeleton->edgel += skeleton->stride)
        for (skeleton->polarity = 0; skeleton->polarity < 2; skeleton->polarity++) {
            CAIRN_STEP_CHARGE(skeleton, phase_resume, budget,
                              pairing_cost(skeleton, skeleton->edgel, skeleton->polarity));
            pair_edgel(skeleton, skeleton->edgel, skeleton->polarity);
        }
    skeleton->centres_found = skeleton->centre_count;
    CAIRN_STEP_END(skeleton->phase_resume);
}

/* ---- Range of radii ---- */

/* Returns the histogram bin of a radius. */
static int32_t bin_of(const cairn_skeleton_grouping *skeleton, cairn_real radius)
{
    int32_t bin = cairn_real_to_int(cairn_log(radius / skeleton->min_search_radius) *
                                    (BINS_PER_OCTAVE / CAIRN_REAL(0.6931471805599453)));

    return bin < 0                                ? 0
           : bin >= SKELETON_GROUPING_RADIUS_BINS ? SKELETON_GROUPING_RADIUS_BINS - 1
                                                  : bin;
}

/* Returns the lower bound of a bin, px. */
static cairn_real radius_of(const cairn_skeleton_grouping *skeleton, int32_t bin)
{
    return skeleton->min_search_radius *
           cairn_exp((cairn_real)bin * (CAIRN_REAL(0.6931471805599453) / BINS_PER_OCTAVE));
}

/* Returns a bin of the smoothed histogram. */
static cairn_real smoothed(const cairn_skeleton_grouping *skeleton, int32_t bin)
{
    return skeleton->histogram[bin] +
           CAIRN_REAL(0.5) *
               ((bin > 0 ? skeleton->histogram[bin - 1] : 0) +
                (bin + 1 < SKELETON_GROUPING_RADIUS_BINS ? skeleton->histogram[bin + 1] : 0));
}

/* Sets the range to the bins about the mode that have at least a third of its count. */
static void set_range(cairn_skeleton_grouping *skeleton)
{
    int32_t best = 0, low, high;

    for (int32_t i = 1; i < SKELETON_GROUPING_RADIUS_BINS; i++)
        if (smoothed(skeleton, i) > smoothed(skeleton, best))
            best = i;
    for (low = best; low > 0 && 3 * smoothed(skeleton, low - 1) >= smoothed(skeleton, best);)
        low--;
    for (high = best; high + 1 < SKELETON_GROUPING_RADIUS_BINS &&
                      3 * smoothed(skeleton, high + 1) >= smoothed(skeleton, best);)
        high++;
    skeleton->input.min_radius = radius_of(skeleton, low);
    skeleton->input.max_radius =
        cairn_min(radius_of(skeleton, high + 1), skeleton->max_search_radius);
    skeleton->min_search_radius =
        cairn_max(skeleton->min_search_radius, skeleton->input.min_radius / RANGE_MARGIN_BELOW);
    skeleton->max_search_radius =
        cairn_min(skeleton->max_search_radius, skeleton->input.max_radius * RANGE_MARGIN_ABOVE);
}

/* Drops the CPs beyond the range. */
static void keep_range(cairn_skeleton_grouping *skeleton)
{
    skeleton->centre_count = 0;
    for (int32_t i = 0; i < skeleton->centres_found; i++)
        if (skeleton->centres[i].radius >= skeleton->min_search_radius &&
            skeleton->centres[i].radius <= skeleton->max_search_radius)
            skeleton->centres[skeleton->centre_count++] = skeleton->centres[i];
}

int cairn_skeleton_grouping_propose_range(cairn_skeleton_grouping *skeleton, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(skeleton->phase_resume);
    for (skeleton->centre = 0; skeleton->centre < skeleton->centre_count; skeleton->centre++) {
        CAIRN_STEP_CHARGE(skeleton, phase_resume, budget, 1);
        skeleton->histogram[bin_of(skeleton, skeleton->centres[skeleton->centre].radius)] += 1;
    }
    CAIRN_STEP_CHARGE(skeleton, phase_resume, budget,
                      SKELETON_GROUPING_RADIUS_BINS / 4 + skeleton->centres_found / 8);
    set_range(skeleton);
    keep_range(skeleton);
    CAIRN_STEP_END(skeleton->phase_resume);
}
