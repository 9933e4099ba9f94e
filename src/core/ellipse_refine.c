/* From the peaks of the votes to ellipses: a radius, then least squares over conics, then what
 * covers the outline. */
#include "src/core/build.h"

#include <string.h>

#include "src/core/ellipse_work.h"

/* Units of a point that is on the ellipse at hand, beside those of looking at it: owed to the
 * next item. */
enum { INSIDE_COST = 2 };

/* How far off the ellipse at hand a point may be in this pass. */
static cairn_real distance_of_pass(const cairn_ellipse_set *set)
{
    static const cairn_real shares[] = {0, CAIRN_REAL(0.5), CAIRN_REAL(0.25), CAIRN_REAL(0.1), 0};

    return cairn_max(set->params.support_distance, shares[set->pass] * set->fit.half_width);
}

/* How many arcs the outline at hand has. */
static int32_t arcs_of(const cairn_ellipse_set *set)
{
    cairn_real arcs =
        cairn_min(cairn_ellipse_length(&set->fit) / (2 * set->params.spacing), ELLIPSE_ARCS);

    return cairn_real_to_int(cairn_max(arcs, ELLIPSE_LEAST_ARCS));
}

/* ... and how far off its direction. */
static cairn_real sine_of_pass(const cairn_ellipse_set *set)
{
    return set->pass == ELLIPSE_COARSE ? cairn_min(2 * set->sine, 1) : set->sine;
}

static void start_pass(cairn_ellipse_set *set, int32_t pass)
{
    set->pass = pass;
    set->cursor = 0;
    if (pass == ELLIPSE_RADIUS) {
        memset(set->radii, 0, sizeof set->radii);
        return;
    }
    set->gate = cairn_ellipse_gate_of(&set->fit, distance_of_pass(set), sine_of_pass(set));
    if (pass == ELLIPSE_SUPPORT) {
        set->weight = set->squared = 0;
        set->arc_count = arcs_of(set);
        memset(set->arcs, 0, sizeof set->arcs);
    } else {
        set->sums = cairn_conic_begin(&set->fit);
    }
}

void cairn_ellipse_start_peak(cairn_ellipse_set *set)
{
    const ellipse_peak *p = &set->peaks[set->item];

    memset(&set->fit, 0, sizeof set->fit);
    set->fit.kind = set->squares == 1 ? CAIRN_ELLIPSE_ANY : p->square;
    set->fit.centre.x = set->corner.x + (cairn_real)p->column * set->cell;
    set->fit.centre.y = set->corner.y + (cairn_real)p->row * set->cell;
    start_pass(set, ELLIPSE_RADIUS);
}

/* The distance of a point whose normal passes by the peak. */
static void add_radius(cairn_ellipse_set *set, const cairn_oriented_point *p, cairn_real weight)
{
    cairn_vec2 to = {set->fit.centre.x - p->position.x, set->fit.centre.y - p->position.y};
    cairn_real radius = cairn_vec2_cross(p->direction, to),
               off = cairn_abs(cairn_vec2_dot(p->direction, to)), at;
    int32_t bin;

    if (set->fit.kind == CAIRN_ELLIPSE_COLUMN)
        radius = -radius;
    if (set->fit.kind == CAIRN_ELLIPSE_ANY)
        radius = cairn_abs(radius);
    if (!(radius > 0) || radius > set->params.most_radius ||
        off > set->sine * radius + 2 * set->cell)
        return;
    at = radius / set->params.most_radius * (ELLIPSE_RADII - 1);
    bin = (int32_t)at;
    set->radii[bin] += weight * (1 - (at - (cairn_real)bin));
    if (bin + 1 < ELLIPSE_RADII)
        set->radii[bin + 1] += weight * (at - (cairn_real)bin);
}

/* The circle of the radius with the most weight about it. */
static void take_radius(cairn_ellipse_set *set)
{
    int32_t best = 1;
    cairn_real most = -1;

    for (int32_t i = 1; i < ELLIPSE_RADII; i++) {
        cairn_real sum =
            set->radii[i - 1] + 2 * set->radii[i] + (i + 1 < ELLIPSE_RADII ? set->radii[i + 1] : 0);

        if (sum > most) {
            most = sum;
            best = i;
        }
    }
    set->fit.half_length = set->fit.half_width =
        cairn_max((cairn_real)best * (set->params.most_radius / (ELLIPSE_RADII - 1)),
                  set->params.least_radius);
}

/* The arc, counted from the longer axis, in which a point lies. */
static void mark_arc(cairn_ellipse_set *set, cairn_vec2 p)
{
    cairn_transform t = set->gate.map_ellipse;
    cairn_vec2 from = {p.x - t.x, p.y - t.y};
    cairn_real along = (t.cosine * from.x + t.sine * from.y) / set->fit.half_length;
    cairn_real across = (t.cosine * from.y - t.sine * from.x) / set->fit.half_width;
    int32_t arcs = set->arc_count;
    cairn_real place =
        (cairn_atan2(across, along) / (2 * CAIRN_PI) + CAIRN_REAL(0.5)) * (cairn_real)arcs;
    int32_t arc = cairn_real_to_int(cairn_min(cairn_floor(place), (cairn_real)(arcs - 1)));

    set->arcs[arc / 32] |= (uint32_t)1 << (arc % 32);
}

/* A point as far as it belongs to the ellipse at hand. */
static void add_point(cairn_ellipse_set *set, const cairn_oriented_point *point, cairn_real weight)
{
    cairn_oriented_point p;
    cairn_real off;

    if (!(weight > 0) ||
        (set->pass != ELLIPSE_RADIUS && cairn_ellipse_is_far(&set->gate, point->position)))
        return;
    p.position = point->position;
    p.direction = cairn_vec2_unit(point->direction);
    if (set->pass == ELLIPSE_RADIUS) {
        add_radius(set, &p, weight);
    } else if (cairn_ellipse_lets_in(&set->gate, &p, &off)) {
        set->paid -= INSIDE_COST;
        if (set->pass != ELLIPSE_SUPPORT) {
            cairn_conic_add(&set->sums, &p, weight);
            return;
        }
        set->weight += weight;
        set->squared += weight * off * off;
        mark_arc(set, p.position);
    }
}

static int is_in_bounds(const cairn_ellipse_set *set)
{
    const cairn_ellipse *e = &set->fit;

    return e->half_width >= set->params.least_radius && e->half_length <= set->params.most_radius &&
           e->half_length <= set->params.most_ratio * e->half_width;
}

/* The ellipse as it is reported. */
static void measure(cairn_ellipse_set *set)
{
    cairn_ellipse *e = &set->fit;
    int32_t arcs = set->arc_count, marked = 0;
    cairn_real off = set->squared / set->weight;

    for (int32_t i = 0; i < arcs; i++)
        marked += ((set->arcs[i / 32] >> (i % 32)) & 1) != 0;
    e->covered = (cairn_real)marked / (cairn_real)arcs;
    e->votes = set->weight;
    e->rms = cairn_sqrt(off);
    e->strength =
        e->covered * (1 - off / (set->params.support_distance * set->params.support_distance));
    e->strength = cairn_max(e->strength, 0);
}

/* Among the ellipses that were found before, behind those with as many votes. */
static void insert(cairn_ellipse_set *set)
{
    int32_t at = set->work_count++;

    for (; at > 0 && set->work[at - 1].votes < set->fit.votes; at--)
        set->work[at] = set->work[at - 1];
    set->work[at] = set->fit;
}

/* Ends a pass over the points: on to the next, or to the next peak. */
static void end_pass(cairn_ellipse_set *set)
{
    if (set->pass == ELLIPSE_RADIUS) {
        take_radius(set);
        start_pass(set, ELLIPSE_COARSE);
        return;
    }
    if (set->pass != ELLIPSE_SUPPORT && set->sums.weight >= set->params.least_votes &&
        cairn_conic_solve(&set->sums, &set->fit) && is_in_bounds(set)) {
        start_pass(set, set->pass + 1);
        return;
    }
    if (set->pass == ELLIPSE_SUPPORT && set->weight >= set->params.least_votes) {
        measure(set);
        if (set->fit.covered >= set->params.least_covered)
            insert(set);
    }
    set->item++;
    if (set->item < set->peak_count)
        cairn_ellipse_start_peak(set);
}

cairn_status cairn_ellipse_refine(cairn_ellipse_set *set, cairn_budget *budget)
{
    while (set->item < set->peak_count) {
        while (set->cursor < set->count) {
            if (!cairn_budget_pay(budget, &set->paid, 1))
                return CAIRN_MORE;
            for (int32_t i = 0; i < 2 && set->cursor < set->count; i++, set->cursor++)
                add_point(set, &set->points[set->cursor], cairn_ellipse_weight(set, set->cursor));
        }
        if (!cairn_budget_pay(budget, &set->paid, 16 + set->work_count / 2))
            return CAIRN_MORE;
        end_pass(set);
    }
    return CAIRN_OK;
}
