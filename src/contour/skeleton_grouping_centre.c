/* Centre points: each edgel and the one that faces it best, on either side; and the range of radii
 * that they propose.
 *
 * An edgel's partner lies in a wedge about its normal; only the cells that the wedge touches are
 * looked at. Of those in it the one wins that is most symmetric, near ones before far ones and
 * such with the object on the same side of their contrast before others: a disc that touches two
 * edges is to be empty, and an object mostly is darker than all about it, or brighter. */
#include "src/core/build.h"

#include "cairn/symmetric_point.h"
#include "src/contour/skeleton_grouping_work.h"

/* Of a normal with the chord, cosine: 35 degrees. */
#define FACING CAIRN_REAL(0.82)
/* What an other sense costs, and the largest radius against the least, in half squares of sigmas
 * of the deviation. */
#define OTHER_SENSE CAIRN_REAL(1.5)
#define LARGE       CAIRN_REAL(1.0)
#define COST_MOST   CAIRN_REAL(4.0)
/* Radii that are looked for below and above the range: large discs are the ones that lie between
 * objects. */
#define MARGIN_BELOW CAIRN_REAL(1.6)
#define MARGIN_ABOVE CAIRN_REAL(1.25)
/* Radii where none are given, px and share of the image's shorter side. */
#define LEAST_RADIUS CAIRN_REAL(3.0)
#define MOST_RADIUS  CAIRN_REAL(0.15)
enum { BINS_AN_OCTAVE = 8, UNITS_AN_EDGEL = 4 };

/* Where the search for partners ends. */
typedef struct wedge {
    int32_t x0, x1, y0, y1; /* cells */
    cairn_vec2 at, inward;
    int32_t sense;
} wedge;

void cairn_skeleton_set_limits(cairn_skeleton *g)
{
    int written = g->params.mode == CAIRN_MODE_AS_WRITTEN;
    cairn_real side =
        (cairn_real)(g->input.width < g->input.height ? g->input.width : g->input.height);
    /* of edgels, with two CPs each */
    int32_t room = g->params.max_centres > 1 ? g->params.max_centres / 2 : 1;

    g->stride = (int32_t)(((int64_t)g->edgel_count + room - 1) / room);
    g->stride = g->stride > 0 ? g->stride : 1;
    g->low = written ? g->input.min_radius : g->input.min_radius / MARGIN_BELOW;
    g->high = written ? g->input.max_radius : g->input.max_radius * MARGIN_ABOVE;
    if (g->input.max_radius == 0) {
        g->low = LEAST_RADIUS;
        g->high = cairn_max(MOST_RADIUS * side, LEAST_RADIUS);
    }
}

static wedge wedge_of(const cairn_skeleton *g, const skeleton_edgel *e, int32_t sense)
{
    cairn_vec2 inward = skeleton_inward(e, sense);
    cairn_vec2 tip = cairn_vec2_add(e->at, cairn_vec2_scale(inward, 2 * g->high));
    cairn_vec2 aside = cairn_vec2_scale(cairn_vec2_left(inward), CAIRN_REAL(0.6) * 2 * g->high);
    cairn_box box = {e->at, e->at};
    wedge w;

    box = cairn_box_extend(cairn_box_extend(cairn_box_extend(box, tip), cairn_vec2_add(tip, aside)),
                           cairn_vec2_sub(tip, aside));
    w.x0 = cairn_skeleton_column(g, box.min.x);
    w.x1 = cairn_skeleton_column(g, box.max.x);
    w.y0 = cairn_skeleton_line(g, box.min.y);
    w.y1 = cairn_skeleton_line(g, box.max.y);
    w.at = e->at;
    w.inward = inward;
    w.sense = sense;
    return w;
}

static int32_t cost_of_wedge(const cairn_skeleton *g, const wedge *w)
{
    return UNITS_AN_EDGEL + skeleton_cost(g, w->x0, w->x1, w->y0, w->y1);
}

/* How ill a pair fits, in half squares of sigmas; COST_MOST: not at all. */
static cairn_real cost_of_pair(const cairn_skeleton *g, const wedge *w, const skeleton_edgel *other,
                               int32_t *sense)
{
    cairn_vec2 chord = cairn_vec2_sub(other->at, w->at), mirrored;
    cairn_real along = cairn_vec2_dot(w->inward, chord), squared = cairn_vec2_norm_squared(chord),
               facing, radius, cosine;

    if (along <= 0 || along * along < FACING * FACING * squared || squared > 4 * g->high * g->high)
        return COST_MOST;
    facing = -cairn_vec2_dot(other->normal, chord);
    if (facing * facing < FACING * FACING * squared)
        return COST_MOST;
    *sense = facing > 0 ? SKELETON_BRIGHTER : SKELETON_DARKER;
    /* Half the chord over the mean cosine of both normals with it. */
    radius = squared / (along + cairn_abs(facing));
    if (radius < g->low || radius > g->high)
        return COST_MOST;
    /* The normal in the mirror between the two; from it to the other's is twice the deviation. */
    mirrored = cairn_vec2_sub(w->inward, cairn_vec2_scale(chord, 2 * along / squared));
    cosine = cairn_vec2_dot(mirrored, skeleton_inward(other, *sense));
    return (1 - cosine) / (4 * g->params.symmetry * g->params.symmetry) +
           (*sense != w->sense ? OTHER_SENSE : 0) +
           LARGE * (radius - g->low) / (g->high - g->low + 1);
}

/* The best partner of an edgel; -1: there is none. */
static int32_t partner_of(const cairn_skeleton *g, const wedge *w, int32_t *sense)
{
    cairn_real best = COST_MOST;
    int32_t partner = -1;

    for (int32_t y = w->y0; y <= w->y1; y++) {
        int32_t from, end;

        skeleton_row(g, y, w->x0, w->x1, &from, &end);
        for (int32_t i = from; i < end; i++) {
            int32_t s = 0;
            cairn_real cost = cost_of_pair(g, w, &g->edgels[i], &s);

            if (cost < best) {
                best = cost;
                partner = i;
                *sense = s;
            }
        }
    }
    return partner;
}

static cairn_oriented_point oriented(const skeleton_edgel *e)
{
    cairn_oriented_point p = {e->at, cairn_vec2_left(e->normal)};

    return p;
}

static void keep_centre(cairn_skeleton *g, int32_t first, int32_t sense, int32_t second,
                        int32_t other_sense)
{
    skeleton_centre *c = &g->centres[g->centre_count];
    cairn_symmetric_point sp;

    if (g->centre_count == g->params.max_centres ||
        !cairn_symmetric_point_of(oriented(&g->edgels[first]), oriented(&g->edgels[second]), 1,
                                  &sp))
        return;
    c->at = sp.centre;
    c->radius = sp.radius;
    c->deviation = sp.deviation;
    c->edgel[0] = first;
    c->edgel[1] = second;
    c->sense[0] = sense;
    c->sense[1] = other_sense;
    g->centre_count++;
}

cairn_status cairn_skeleton_centres(cairn_skeleton *g, cairn_budget *budget)
{
    if (g->cursor == 0 && g->sense == 0)
        cairn_skeleton_set_limits(g);
    for (; g->cursor < g->edgel_count; g->cursor += g->stride) {
        for (; g->sense < 2; g->sense++) {
            wedge w = wedge_of(g, &g->edgels[g->cursor], g->sense);
            int32_t partner, sense = 0;

            if (!cairn_budget_pay(budget, &g->paid, cost_of_wedge(g, &w)))
                return CAIRN_MORE;
            partner = partner_of(g, &w, &sense);
            if (partner >= 0)
                keep_centre(g, g->cursor, g->sense, partner, sense);
        }
        g->sense = 0;
    }
    g->centres_seen = g->centre_count;
    return CAIRN_OK;
}

/* ---- The range ---- */

static int32_t bin_of(const cairn_skeleton *g, cairn_real radius)
{
    int32_t bin = cairn_real_to_int(cairn_log(radius / g->low) *
                                    (BINS_AN_OCTAVE / CAIRN_REAL(0.6931471805599453)));

    return bin < 0 ? 0 : bin >= SKELETON_BINS ? SKELETON_BINS - 1 : bin;
}

static cairn_real radius_of(const cairn_skeleton *g, int32_t bin)
{
    return g->low * cairn_exp((cairn_real)bin * (CAIRN_REAL(0.6931471805599453) / BINS_AN_OCTAVE));
}

static cairn_real smoothed(const cairn_skeleton *g, int32_t bin)
{
    return g->histogram[bin] +
           CAIRN_REAL(0.5) * ((bin > 0 ? g->histogram[bin - 1] : 0) +
                              (bin + 1 < SKELETON_BINS ? g->histogram[bin + 1] : 0));
}

/* The octaves about the fullest bin where there are at least a third as many CPs. */
static void take_range(cairn_skeleton *g)
{
    int32_t best = 0, low, high;

    for (int32_t i = 1; i < SKELETON_BINS; i++)
        if (smoothed(g, i) > smoothed(g, best))
            best = i;
    for (low = best; low > 0 && 3 * smoothed(g, low - 1) >= smoothed(g, best);)
        low--;
    for (high = best; high + 1 < SKELETON_BINS && 3 * smoothed(g, high + 1) >= smoothed(g, best);)
        high++;
    g->input.min_radius = radius_of(g, low);
    g->input.max_radius = cairn_min(radius_of(g, high + 1), g->high);
    g->low = cairn_max(g->low, g->input.min_radius / MARGIN_BELOW);
    g->high = cairn_min(g->high, g->input.max_radius * MARGIN_ABOVE);
}

cairn_status cairn_skeleton_propose_range(cairn_skeleton *g, cairn_budget *budget)
{
    if (g->input.max_radius > 0)
        return CAIRN_OK;
    for (; g->cursor < g->centre_count; g->cursor++) {
        if (!cairn_budget_pay(budget, &g->paid, 1))
            return CAIRN_MORE;
        g->histogram[bin_of(g, g->centres[g->cursor].radius)] += 1;
    }
    if (!cairn_budget_pay(budget, &g->paid, SKELETON_BINS / 4 + g->centres_seen / 8))
        return CAIRN_MORE;
    take_range(g);
    g->centre_count = 0;
    for (int32_t i = 0; i < g->centres_seen; i++)
        if (g->centres[i].radius >= g->low && g->centres[i].radius <= g->high)
            g->centres[g->centre_count++] = g->centres[i];
    return CAIRN_OK;
}
