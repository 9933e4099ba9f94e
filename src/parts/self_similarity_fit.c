/* Nonlinear least-squares fit of an axis.
 *
 * Method:
 * 1. Variables: the positions of both ends, bend and skew.
 * 2. Residuals: signed distances of all samples of one arc to the line of the nearest segment of
 *    the mirrored other arc.
 * 3. Levenberg-Marquardt with a numerical Jacobian and robust weights (Geman-McClure), so that an
 *    articulated limb does not rotate the axis.
 * 4. Nearest segments are searched again for each trial; a trial that does not decrease the cost
 *    is rejected. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/small_matrix.h"
#include "src/parts/self_similarity_work.h"

enum {
    VARIABLE_COUNT = SELF_SIMILARITY_VARIABLES,
    /* elements of a lower triangle */
    ELEMENT_COUNT = VARIABLE_COUNT * (VARIABLE_COUNT + 1) / 2,
    MAX_ITERATIONS = 10
};

/* Damping factor of the first iteration. */
#define FIRST_DAMPING CAIRN_REAL(0.01)
/* Scale of the Geman-McClure weight, relative to the greatest inner distance. */
#define GEMAN_MCCLURE_SCALE CAIRN_REAL(0.02)
/* Weight of a zero prior on bend and skew, against drift along unobservable directions. */
#define BEND_SKEW_PRIOR CAIRN_REAL(1e-6)
/* Relative decrease of the cost below which the fit stops. */
#define MIN_IMPROVEMENT CAIRN_REAL(1e-3)

/* Unit of each variable (end positions in samples, bend in rad, skew) and the finite-difference
 * step, in that unit. */
static const cairn_real unit[VARIABLE_COUNT] = {2, 2, CAIRN_REAL(0.3), CAIRN_REAL(0.2)};
#define DIFFERENCE_STEP CAIRN_REAL(0.1)
/* Greatest step of a variable in an iteration, in its unit. */
#define MAX_STEP 2

/* Returns a variable of the fit: end positions, bend, skew. */
static cairn_real *variable(self_similarity_cut *cut, int32_t i)
{
    return i < 2 ? &cut->position[i] : i == 2 ? &cut->bend : &cut->skew;
}

/* Computes the signed distances of all samples to the lines of their nearest segments, relative
 * to the greatest inner distance. */
static void compute_residuals(const cairn_self_similarity *similarity,
                              const self_similarity_axis_arcs *flat, const int32_t *nearest_segment,
                              cairn_real *to)
{
    for (int32_t arc = 0; arc < 2; arc++)
        for (int32_t i = 1; i + 1 < flat->count[arc]; i++, nearest_segment++, to++) {
            cairn_vec2 a = flat->points[1 - arc][*nearest_segment],
                       b = flat->points[1 - arc][*nearest_segment + 1];
            cairn_vec2 normal = cairn_vec2_left_perp(cairn_vec2_unit(cairn_vec2_sub(b, a)));

            *to = cairn_vec2_dot(normal, cairn_vec2_sub(flat->points[arc][i], a)) /
                  similarity->max_distance;
        }
}

/* Returns the residuals (row 0) or a column of the Jacobian (row 1 + v). */
static cairn_real *row_of(const cairn_self_similarity *similarity, int32_t row)
{
    return &similarity->residual[row * similarity->params.outline_samples];
}

/* Computes the residuals (row 0) and the Jacobian (row 1 + v: derivative with respect to
 * variable v) by forward differences; returns the number of residuals. */
static int32_t compute_jacobian(cairn_self_similarity *similarity,
                                const self_similarity_trial *trial)
{
    int32_t count = trial->sides.count[0] + trial->sides.count[1];
    const cairn_real *here = row_of(similarity, 0);

    compute_residuals(similarity, &trial->axis_arcs, trial->nearest_segment, row_of(similarity, 0));
    for (int32_t v = 0; v < VARIABLE_COUNT; v++) {
        cairn_real *change = row_of(similarity, 1 + v);
        self_similarity_cut moved = trial->cut;
        self_similarity_axis_arcs perturbed;

        *variable(&moved, v) += DIFFERENCE_STEP * unit[v];
        for (int32_t i = 0; i < 2; i++)
            moved.position[i] -= moved.position[i] >= (cairn_real)similarity->params.outline_samples
                                     ? (cairn_real)similarity->params.outline_samples
                                     : 0;
        perturbed =
            cairn_self_similarity_unbend(similarity, &moved, &trial->sides, similarity->perturbed);
        compute_residuals(similarity, &perturbed, trial->nearest_segment, change);
        for (int32_t i = 0; i < count; i++)
            change[i] = (change[i] - here[i]) / DIFFERENCE_STEP;
    }
    return count;
}

/* Sets the damped, weighted normal equations a x = b. */
static void set_normal_equations(const cairn_self_similarity *similarity,
                                 const self_similarity_cut *cut, int32_t count,
                                 cairn_real a[ELEMENT_COUNT], cairn_real b[VARIABLE_COUNT])
{
    const cairn_real *here = row_of(similarity, 0);
    cairn_real prior = BEND_SKEW_PRIOR * (cairn_real)count;

    for (int32_t v = 0; v < VARIABLE_COUNT; v++) {
        b[v] = 0;
        for (int32_t u = 0; u <= v; u++)
            a[cairn_sym_element(v, u)] = 0;
    }
    for (int32_t i = 0; i < count; i++) {
        cairn_real scaled = here[i] / GEMAN_MCCLURE_SCALE, share = 1 / (1 + scaled * scaled),
                   weight = share * share;

        for (int32_t v = 0; v < VARIABLE_COUNT; v++) {
            cairn_real change = weight * row_of(similarity, 1 + v)[i];

            for (int32_t u = 0; u <= v; u++)
                a[cairn_sym_element(v, u)] += change * row_of(similarity, 1 + u)[i];
            b[v] -= change * here[i];
        }
    }
    for (int32_t v = 0; v < VARIABLE_COUNT; v++) {
        cairn_real *diagonal = &a[cairn_sym_element(v, v)];

        *diagonal += similarity->damping * (*diagonal + prior) + prior;
    }
    b[2] -= prior * cut->bend / unit[2];
    b[3] -= prior * cut->skew / unit[3];
}

/* Cost of an iteration in units: an evaluation and the Jacobian. */
static int32_t iteration_cost(const cairn_self_similarity *similarity)
{
    return cairn_self_similarity_evaluate_cost(similarity, 1) +
           VARIABLE_COUNT * similarity->params.outline_samples;
}

/* Runs one Levenberg-Marquardt iteration; returns 0 if it is the last. */
static int iterate(cairn_self_similarity *similarity)
{
    self_similarity_trial *current = &similarity->trial[similarity->current_trial],
                          *next = &similarity->trial[1 - similarity->current_trial];
    cairn_real a[ELEMENT_COUNT], b[VARIABLE_COUNT];

    set_normal_equations(similarity, &current->cut, compute_jacobian(similarity, current), a, b);
    /* Without a solution: a step of 0, which is rejected, and more damping. */
    if (!cairn_sym_solve(a, VARIABLE_COUNT, 0, b))
        memset(b, 0, sizeof b);
    next->cut = current->cut;
    for (int32_t v = 0; v < VARIABLE_COUNT; v++)
        *variable(&next->cut, v) += unit[v] * cairn_max(-MAX_STEP, cairn_min(MAX_STEP, b[v]));
    cairn_self_similarity_clamp(similarity, &next->cut);
    cairn_self_similarity_evaluate(similarity, next, 1);
    if (next->cut.cost < current->cut.cost) {
        int continues = current->cut.cost - next->cut.cost > MIN_IMPROVEMENT * current->cut.cost;

        similarity->current_trial = 1 - similarity->current_trial;
        similarity->damping *= CAIRN_REAL(0.2);
        return continues;
    }
    similarity->damping = cairn_max(10 * similarity->damping, CAIRN_REAL(0.1));
    return 1;
}

int cairn_self_similarity_fit(cairn_self_similarity *similarity, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(similarity->fit_resume);
    CAIRN_STEP_CHARGE(similarity, fit_resume, budget,
                      cairn_self_similarity_evaluate_cost(similarity, 1));
    cairn_self_similarity_evaluate(similarity, &similarity->trial[similarity->current_trial], 1);
    similarity->damping = FIRST_DAMPING;
    for (similarity->iteration = 0; similarity->iteration < MAX_ITERATIONS;
         similarity->iteration++) {
        CAIRN_STEP_CHARGE(similarity, fit_resume, budget, iteration_cost(similarity));
        if (!iterate(similarity))
            break;
    }
    CAIRN_STEP_END(similarity->fit_resume);
}
