/* E-step and M-step of the line fit.
 *
 * Method:
 * 1. The points are in blocks of neighbours in canonical order. The bounding box of a block is
 *    tested against those of the components; the components that overlap are the candidates of its
 *    points.
 * 2. E-step: the responsibility of a candidate for a point is proportional to exp(-d^2 / 2
 *    width^2), d the distance to the segment; an outlier hypothesis of constant weight takes part.
 *    Each point is also assigned to the closest candidate.
 * 3. A component may grow beyond its ends to points within its reach, in the first half of the
 *    iterations.
 * 4. M-step: the principal axis of the points, weighted by responsibility.
 *
 * Source: Dempster, Laird and Rubin 1977; Adluru 2008, refs 168, 170. */
#include "src/base/build.h"

#include <string.h>

#include "src/shapes/polyline_work.h"

/* Half width of the band beyond an end in which a component may grow, in widths of the Gaussian.
 * Less than POLYLINE_GATE, so a point that was added by growth stays within the gate. */
#define GROWTH_GATE 2

/* 1 when the bounding box of a block is within the gate of a component. */
static int block_overlaps(const cairn_polyline *polyline, int32_t block,
                          const polyline_component *component)
{
    cairn_real margin = POLYLINE_GATE * polyline->width;

    for (int j = 0; j < 3; j++)
        if (polyline->block_min[block][j] > component->box_max[j] + margin ||
            polyline->block_max[block][j] < component->box_min[j] - margin)
            return 0;
    return 1;
}

/* exp(-z) for 0 <= z <= 4.5, at most 4 % too small: (1 - z / 256)^256. Accurate enough for weights,
 * in a quarter of the time. */
static cairn_real approximate_exp(cairn_real z)
{
    cairn_real power = 1 - z / 256;

    for (int i = 0; i < 8; i++)
        power *= power;
    return power;
}

/* What the width of the Gaussian gives, the same for all points. */
typedef struct weighing {
    cairn_real half_inverse_variance, squared_gate, squared_growth;
} weighing;

static weighing weighing_of(const cairn_polyline *polyline)
{
    cairn_real width = polyline->width, gate = POLYLINE_GATE * width;
    weighing w = {1 / (2 * width * width), gate * gate, GROWTH_GATE * GROWTH_GATE * width * width};

    return w;
}

/* Weighs a candidate for a point p: weight exp(-d^2 / 2 width^2), d the distance to the segment,
 * within the gate. Outside the gate the component may grow to the point, when the point lies in the
 * band beyond an end, within its reach. */
static void weigh_candidate(cairn_polyline *polyline, const weighing *by, int32_t candidate,
                            const cairn_real p[3])
{
    const polyline_component *component =
        &polyline->components[polyline->candidate_list[candidate]];
    cairn_real *local = polyline->candidate_local[candidate], across, beyond, squared;

    cairn_polyline_to_local(component, polyline->params.dim, p, local);
    across = local[1] * local[1] + local[2] * local[2];
    beyond = cairn_max(cairn_max(component->low - local[0], local[0] - component->high), 0);
    squared = across + beyond * beyond;
    polyline->candidate_weight[candidate] = 0;
    if (squared <= by->squared_gate) {
        polyline->candidate_weight[candidate] =
            approximate_exp(squared * by->half_inverse_variance);
        polyline->weight_sum += polyline->candidate_weight[candidate];
        if (polyline->best < 0 || squared < polyline->best_squared) {
            polyline->best = candidate;
            polyline->best_squared = squared;
        }
    } else if (polyline->is_growing && across <= by->squared_growth &&
               beyond <=
                   (local[0] < component->low ? component->reach_low : component->reach_high) &&
               (polyline->growing < 0 || squared < polyline->growing_squared)) {
        polyline->growing = candidate;
        polyline->growing_squared = squared;
    }
}

/* Adds the current point to a candidate, weighted by the responsibility: the weight over the sum of
 * all, the outlier hypothesis included. Responsibilities up to 1/256 are ignored. */
static void share_point(cairn_polyline *polyline, int32_t candidate)
{
    cairn_real responsibility =
        polyline->candidate_weight[candidate] / (polyline->weight_sum + POLYLINE_OUTLIER_WEIGHT);

    if (responsibility > CAIRN_REAL(0.00390625))
        cairn_polyline_add_point(
            &polyline->components[polyline->candidate_list[candidate]].soft_sums,
            polyline->candidate_local[candidate], responsibility);
}

/* End of the points of the current block. */
static int32_t block_end(const cairn_polyline *polyline)
{
    int32_t left = polyline->point_count - polyline->first;

    return polyline->first + (left < POLYLINE_BLOCK_POINTS ? left : POLYLINE_BLOCK_POINTS);
}

/* Assigns the current point to the closest component, or to one that grows to it. */
static void assign_point(cairn_polyline *polyline)
{
    if (polyline->best < 0 && polyline->growing >= 0) {
        polyline->best = polyline->growing;
        polyline->candidate_weight[polyline->best] = polyline->weight_sum = 1;
    }
    polyline->component_of[polyline->cursor] =
        polyline->best < 0 ? -1 : polyline->candidate_list[polyline->best];
}

/* The points, block by block: assigned to the closest component, and, unless is_assignment, added
 * to all candidates. */
static int weigh_points(cairn_polyline *polyline, cairn_budget *budget, int is_assignment)
{
    const weighing by = weighing_of(polyline);

    CAIRN_STEP_BEGIN(polyline->phase_resume);
    polyline->is_growing =
        !is_assignment && polyline->measure.iterations < polyline->params.max_iterations / 2;
    for (polyline->first = 0; polyline->first < polyline->point_count;
         polyline->first += POLYLINE_BLOCK_POINTS) {
        polyline->candidate_count = 0;
        for (polyline->other = 0; polyline->other < polyline->component_count; polyline->other++) {
            CAIRN_STEP_CHARGE_EIGHTHS_EVERY(polyline, phase_resume, budget, POLYLINE_GROUP,
                                            polyline->other, polyline->component_count, 5);
            if (block_overlaps(polyline, polyline->first / POLYLINE_BLOCK_POINTS,
                               &polyline->components[polyline->other]))
                polyline->candidate_list[polyline->candidate_count++] = polyline->other;
        }
        polyline->last = block_end(polyline);
        for (polyline->cursor = polyline->first; polyline->cursor < polyline->last;
             polyline->cursor++) {
            polyline->best = polyline->growing = -1;
            polyline->weight_sum = 0;
            for (polyline->other = 0; polyline->other < polyline->candidate_count;
                 polyline->other++) {
                CAIRN_STEP_CHARGE_EIGHTHS_EVERY(polyline, phase_resume, budget, POLYLINE_GROUP,
                                                polyline->other, polyline->candidate_count, 10);
                weigh_candidate(polyline, &by, polyline->other, polyline->points[polyline->cursor]);
            }
            assign_point(polyline);
            if (is_assignment)
                continue;
            for (polyline->other = 0; polyline->other < polyline->candidate_count;
                 polyline->other++) {
                CAIRN_STEP_CHARGE_EIGHTHS_EVERY(polyline, phase_resume, budget, POLYLINE_GROUP,
                                                polyline->other, polyline->candidate_count, 4);
                share_point(polyline, polyline->other);
            }
        }
    }
    CAIRN_STEP_END(polyline->phase_resume);
}

int cairn_polyline_expect(cairn_polyline *polyline, cairn_budget *budget)
{
    return weigh_points(polyline, budget, 0);
}

int cairn_polyline_assign(cairn_polyline *polyline, cairn_budget *budget)
{
    return weigh_points(polyline, budget, 1);
}

/* M-step of a component: its new frame, and the motion of its ends. */
static void maximize_component(cairn_polyline *polyline, polyline_component *component)
{
    cairn_real end[2][3], local[3];

    if (component->soft_sums.weight < 2) /* dropped for lack of support */
        return;
    cairn_polyline_point_at(component, component->low, end[0]);
    cairn_polyline_point_at(component, component->high, end[1]);
    cairn_polyline_fit(component, &component->soft_sums, polyline->params.dim);
    for (int which = 0; which < 2; which++) {
        cairn_polyline_to_local(component, polyline->params.dim, end[which], local);
        polyline->max_end_motion = cairn_max(polyline->max_end_motion,
                                             cairn_sqrt(local[1] * local[1] + local[2] * local[2]));
    }
}

int cairn_polyline_maximize(cairn_polyline *polyline, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(polyline->phase_resume);
    for (polyline->cursor = 0; polyline->cursor < polyline->component_count; polyline->cursor++) {
        CAIRN_STEP_CHARGE_EIGHTHS(polyline, phase_resume, budget,
                                  polyline->params.dim == 2 ? 56 : 96);
        maximize_component(polyline, &polyline->components[polyline->cursor]);
    }
    CAIRN_STEP_END(polyline->phase_resume);
}
