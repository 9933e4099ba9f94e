/* pose_graph: Levenberg-Marquardt iterations with robust weights (iteratively reweighted least
 * squares), chordal initialisation, and a preconditioned conjugate-gradient phase.
 *
 * Method: in the map frame a link has the residual g = (t_j - t_i - R_i t_z, theta_j - theta_i -
 * theta_z) and the information W = R_i Omega R_i^T. Its Jacobian by the second pose is the identity
 * and by the first -A, A = [1 0 -v_y; 0 1 v_x; 0 0 1] with v = t_j - t_i. A link adds W, A^T W A
 * and -A^T W. A fixed pose has the identity for its block and no links.
 * 1. Chordal initialisation, of the same form. Headings: g = r_j - R_z r_i for the unit vectors r,
 *    with the information of the angle alone, which is linear; then the poses with v = R_i t_z of
 *    these headings, linear again.
 * 2. Damped Newton steps: sparse Cholesky, backtracking to a quarter step, then more damping.
 * 3. Near the minimum the factor of earlier poses preconditions conjugate gradients (Fletcher and
 *    Reeves 1964). The blocks of a link hardly change in the frames of its poses, so right-hand
 *    sides and solutions are rotated between the headings of the factor and the current ones. The
 *    curvature along the direction gives the step length. The slope, the decrease that the factor
 *    predicts, ends the iterations.
 * 4. Watchdog: a full step may raise the cost by its second order where weakly determined motions
 *    bend the graph; the next step removes it. The step is judged after that one.
 * 5. Graduated non-convexity: c^2 is multiplied by 2 max(e^T Omega e) / c^2 at first and by 1 / 1.4
 *    from iteration to iteration (Yang, Antonante, Tzoumas and Carlone 2020).
 *
 * Limits: local convergence; the chordal initialisation is least squares and sensitive to outliers;
 * BEST then keeps the given poses.
 * Source: Grisetti et al., A tutorial on graph-based SLAM, 2010; Carlone, Tron, Daniilidis and
 * Dellaert, Initialization techniques for 3D SLAM, 2015; Carlone, Aragues, Castellanos and Bona, A
 * fast and accurate approximation for planar pose graph optimization, 2014; Chamberlain, Powell,
 * Lemarechal and Pedersen, The watchdog technique for forcing convergence, 1982; Agarwal et al.,
 * Robust map optimization using dynamic covariance scaling, 2013. */
#include "src/base/build.h"

#include <string.h>

#include "src/poses/pose_graph_work.h"

enum { UNITS_PER_COST = 4, UNITS_PER_EQUATIONS = 9, UNITS_PER_POSE = 1, POSES_PER_UNIT = 8 };

/* The least eigenvalues of large graphs are 1e-10 of the diagonal; in float that is below
 * rounding. */
static const cairn_real MIN_DAMPING = CAIRN_REAL(1e-12) + CAIRN_REAL_EPSILON;
static const cairn_real MAX_DAMPING = CAIRN_REAL(1e6);
/* factor on the damping after a rejected step */
static const cairn_real DAMPING_INCREASE = 1000;
/* factor on the damping after a step accepted at once */
static const cairn_real DAMPING_DECREASE = CAIRN_REAL(0.01);
/* least fraction of a step in backtracking, before the damping is raised */
static const cairn_real MIN_STEP_FRACTION = CAIRN_REAL(0.25);
/* relative decrease of the cost below which the factor is reused */
static const cairn_real MAX_REUSE_DECREASE = CAIRN_REAL(0.01);
/* greatest ratio of two successive decreases with a reused factor */
static const cairn_real MAX_DECREASE_RATIO = CAIRN_REAL(0.3);
static const cairn_real KERNEL_NARROWING = CAIRN_REAL(1.4);

/* ---- Stages ---- */

void cairn_pose_graph_enter(cairn_pose_graph *graph, pose_graph_mode mode, pose_graph_stage stage)
{
    graph->mode = mode;
    graph->stage = stage;
    graph->index = 0;
    if (mode != POSE_GRAPH_NEWTON)
        graph->reuse_factor = graph->is_watchdog_step = 0;
    if (stage == POSE_GRAPH_CLEAR || stage == POSE_GRAPH_COST || stage == POSE_GRAPH_REPORT)
        graph->chi2 = graph->cost = graph->max_chi2 = 0;
}

static void end(cairn_pose_graph *graph, cairn_status outcome)
{
    graph->stage = POSE_GRAPH_IDLE;
    graph->outcome = outcome;
}

static void finish(cairn_pose_graph *graph, cairn_pose_graph_verdict verdict)
{
    graph->state.verdict = verdict;
    cairn_pose_graph_enter(graph, POSE_GRAPH_NEWTON, POSE_GRAPH_REPORT);
}

static void accept(cairn_pose_graph *graph)
{
    memcpy(graph->poses, graph->trial, (size_t)graph->state.poses * sizeof *graph->poses);
    graph->state.chi2 = graph->chi2;
    graph->state.cost = graph->cost;
}

/* Starts the Newton steps. */
static void begin_newton(cairn_pose_graph *graph)
{
    cairn_real c2 = graph->params.kernel_width * graph->params.kernel_width;

    graph->damping = MIN_DAMPING;
    graph->was_rejected = 0;
    graph->kernel_scale = 1;
    if (graph->params.graduated && graph->params.kernel == CAIRN_POSE_GRAPH_GEMAN_MCCLURE)
        graph->kernel_scale = cairn_max(1, 2 * graph->max_chi2 / c2);
    cairn_pose_graph_enter(graph, POSE_GRAPH_NEWTON, POSE_GRAPH_CLEAR);
}

static int raise_damping(cairn_pose_graph *graph)
{
    graph->was_rejected = 1;
    graph->step_fraction = 1;
    graph->damping *= DAMPING_INCREASE;
    return graph->damping <= MAX_DAMPING;
}

/* After a rejected step the successful damping stays for one more step. */
static void lower_damping(cairn_pose_graph *graph)
{
    if (!graph->was_rejected)
        graph->damping = cairn_max(MIN_DAMPING, DAMPING_DECREASE * graph->damping);
    graph->was_rejected = 0;
}

/* Returns the decrease of the cost that counts as converged. */
static cairn_real convergence_threshold(const cairn_pose_graph *graph)
{
    return graph->params.converged_decrease * (graph->base_cost + (cairn_real)graph->state.links);
}

/* Returns 1 when the factor is reused for the next step, after a decrease of the cost: not where
 * the decrease was small and the factor had predicted more. */
static int may_reuse_factor(const cairn_pose_graph *graph, cairn_real better)
{
    if (graph->kernel_scale > 1 || graph->step_fraction < 1)
        return 0;
    if (!graph->reuse_factor || graph->is_watchdog_step)
        return better <= MAX_REUSE_DECREASE * graph->base_cost;
    return better <= MAX_DECREASE_RATIO * graph->last_decrease &&
           (better > convergence_threshold(graph) || better >= MAX_DECREASE_RATIO * graph->slope);
}

/* Returns 1 when a step to a higher cost is judged after another one with the same factor
 * (watchdog). */
static int may_defer_evaluation(const cairn_pose_graph *graph, cairn_real better)
{
    return !graph->reuse_factor && graph->step_fraction == 1 && graph->kernel_scale <= 1 &&
           -better <= MAX_REUSE_DECREASE * graph->base_cost;
}

/* Starts the next step: at the trial poses, whose right-hand sides exist, with the reused factor;
 * or with a factor of its own. */
static void begin_step(cairn_pose_graph *graph)
{
    if (graph->reuse_factor && !graph->is_watchdog_step)
        graph->base_cost = graph->cost;
    graph->kernel_scale = cairn_max(1, graph->kernel_scale / KERNEL_NARROWING);
    cairn_pose_graph_enter(graph, POSE_GRAPH_NEWTON,
                           graph->reuse_factor ? POSE_GRAPH_ROTATE : POSE_GRAPH_CLEAR);
}

/* Accepts or rejects a tried step. Its cost is cost, that of the linearization point base_cost,
 * both with the same kernel. A step with a reused factor does not show convergence; its slope does,
 * see end_slope(). */
static void evaluate_step(cairn_pose_graph *graph)
{
    cairn_real better = graph->base_cost - graph->cost;
    int at_rest = !graph->reuse_factor && cairn_abs(better) <= convergence_threshold(graph) &&
                  graph->kernel_scale <= 1,
        damped = graph->damping > MIN_DAMPING;
    int shorter = 0;

    graph->state.iterations++;
    if (better >= 0) {
        accept(graph);
        if (!graph->reuse_factor)
            lower_damping(graph);
        if (!graph->reuse_factor || graph->is_watchdog_step)
            graph->last_slope = 0;
        /* a damped step hides the distance to the minimum */
        graph->reuse_factor = !damped && may_reuse_factor(graph, better);
        graph->is_watchdog_step = 0;
        graph->last_decrease = better;
        graph->step_fraction = 1;
    } else if (may_defer_evaluation(graph, better)) {
        graph->reuse_factor = graph->is_watchdog_step = 1;
        graph->last_slope = 0;
    } else if (graph->is_watchdog_step) {
        graph->reuse_factor = graph->is_watchdog_step = 0;
        at_rest = !raise_damping(graph);
    } else if (graph->reuse_factor) {
        graph->reuse_factor = 0;
    } else if (graph->step_fraction > MIN_STEP_FRACTION) {
        graph->step_fraction /= 2;
        shorter = 1;
    } else if (!raise_damping(graph)) {
        at_rest = 1;
    }
    if (at_rest) {
        finish(graph, CAIRN_POSE_GRAPH_CONVERGED);
    } else if (graph->state.iterations >= graph->params.max_iterations) {
        finish(graph, CAIRN_POSE_GRAPH_OUT_OF_ITERATIONS);
    } else if (shorter) {
        cairn_pose_graph_enter(graph, POSE_GRAPH_NEWTON, POSE_GRAPH_MOVE);
    } else {
        begin_step(graph);
    }
}

static void end_cost(cairn_pose_graph *graph)
{
    int finite = cairn_is_finite(graph->cost) && cairn_is_finite(graph->chi2);

    if (graph->mode == POSE_GRAPH_INITIAL_COST) {
        if (!finite) {
            end(graph, CAIRN_NOT_FINITE);
            return;
        }
        accept(graph);
        graph->state.chi2_initial = graph->chi2;
        graph->state.cost_initial = graph->cost;
        if (graph->params.start == CAIRN_POSE_GRAPH_GIVEN)
            begin_newton(graph);
        else
            cairn_pose_graph_enter(graph, POSE_GRAPH_HEADINGS, POSE_GRAPH_CLEAR);
    } else if (graph->mode == POSE_GRAPH_JOINT) {
        if (finite &&
            (graph->params.start == CAIRN_POSE_GRAPH_CHORDAL || graph->cost < graph->state.cost)) {
            accept(graph);
            graph->state.chordal = 1;
        }
        begin_newton(graph);
    } else {
        if (!finite)
            graph->cost = CAIRN_REAL_MAX;
        evaluate_step(graph);
    }
}

/* Handles a factor that does not exist or solves nothing: `pose` is undetermined. */
static void not_positive(cairn_pose_graph *graph, int32_t pose)
{
    graph->reuse_factor = graph->is_watchdog_step = 0;
    if (graph->mode == POSE_GRAPH_COVARIANCE) {
        graph->state.pose = pose;
        graph->state.verdict = CAIRN_POSE_GRAPH_SINGULAR;
        graph->is_solution = 0;
        end(graph, CAIRN_OK);
    } else if (graph->mode != POSE_GRAPH_NEWTON) {
        begin_newton(graph);
    } else if (++graph->state.iterations >= graph->params.max_iterations || !raise_damping(graph)) {
        graph->state.pose = pose;
        finish(graph, CAIRN_POSE_GRAPH_SINGULAR);
    } else {
        cairn_pose_graph_enter(graph, POSE_GRAPH_NEWTON, POSE_GRAPH_CLEAR);
    }
}

/* Adds the diagonal block of a pose. */
static void assemble_pose(cairn_pose_graph *graph, int32_t pose)
{
    cairn_sym3 block = graph->diagonal[pose];

    if (cairn_pose_graph_is_fixed(graph, pose)) {
        block.xx = block.yy = block.zz = 1;
    } else if (graph->mode == POSE_GRAPH_NEWTON) {
        block.xx += graph->damping * block.xx;
        block.yy += graph->damping * block.yy;
        block.zz += graph->damping * block.zz;
    } else if (graph->mode == POSE_GRAPH_HEADINGS) {
        block.zz = 1;
    }
    graph->heading[pose] = cairn_pose_graph_linearization_poses(graph)[pose].theta;
    if (graph->solver.add_pose_block(graph->solver.context, pose, block) != CAIRN_OK)
        graph->outcome = CAIRN_NOT_FINITE;
}

static void solution_of(const cairn_pose_graph *graph, int32_t index, cairn_real x[3])
{
    cairn_status status = graph->solver.solution(graph->solver.context, index, x);

    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
}

/* Rotates a displacement of a pose from its current heading to that of the factorization, or
 * back. */
static void rotate_displacement(const cairn_pose_graph *graph, int32_t index, int back,
                                cairn_real x[3])
{
    cairn_real angle =
                   graph->heading[index] - cairn_pose_graph_linearization_poses(graph)[index].theta,
               s, c, first = x[0];

    cairn_sincos(back ? -angle : angle, &s, &c);
    x[0] = c * first - s * x[1];
    x[1] = s * first + c * x[1];
}

/* Adds a pose's part of the slope; the solution replaces the right-hand side. */
static void add_slope(cairn_pose_graph *graph, int32_t index)
{
    cairn_real *right = graph->right[index], x[3];

    solution_of(graph, index, x);
    graph->slope += x[0] * right[0] + x[1] * right[1] + x[2] * right[2];
    rotate_displacement(graph, index, 1, x);
    memcpy(right, x, sizeof x);
}

static void set_direction(cairn_pose_graph *graph, int32_t index)
{
    for (int k = 0; k < 3; k++)
        graph->direction[index][k] =
            graph->right[index][k] +
            (graph->last_slope > 0 ? graph->slope / graph->last_slope * graph->direction[index][k]
                                   : 0);
}

static void move_pose(cairn_pose_graph *graph, int32_t index)
{
    cairn_pose pose = cairn_pose_graph_linearization_poses(graph)[index];
    cairn_real x[3], length = graph->step_fraction;

    graph->trial[index] = pose;
    memset(graph->right[index], 0, sizeof graph->right[index]);
    if (cairn_pose_graph_is_fixed(graph, index))
        return;
    if (graph->reuse_factor) {
        memcpy(x, graph->direction[index], sizeof x);
        length = graph->slope / graph->curvature;
    } else {
        solution_of(graph, index, x);
    }
    if (graph->mode == POSE_GRAPH_HEADINGS) {
        cairn_transform t = cairn_transform_of(pose);

        pose.theta = cairn_atan2(t.sine + x[1], t.cosine + x[0]);
    } else {
        pose.x += length * x[0];
        pose.y += length * x[1];
        pose.theta = cairn_wrap_angle(pose.theta + length * x[2]);
    }
    graph->trial[index] = pose;
}

/* Sets the equations to 0; returns the number of blocks and right-hand sides. */
static int32_t clear_equations(cairn_pose_graph *graph)
{
    cairn_status status;

    memset(graph->right, 0, (size_t)graph->state.poses * sizeof *graph->right);
    status = graph->solver.clear(graph->solver.context);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    memset(graph->diagonal, 0, (size_t)graph->state.poses * sizeof *graph->diagonal);
    return graph->state.poses + graph->state.fill;
}

/* Tests convergence by the slope: the decrease of the cost that the factor predicts. */
static void end_slope(cairn_pose_graph *graph)
{
    if (!graph->is_watchdog_step && cairn_abs(graph->slope) <= convergence_threshold(graph))
        finish(graph, CAIRN_POSE_GRAPH_CONVERGED);
    else
        cairn_pose_graph_enter(graph, graph->mode, POSE_GRAPH_DIRECTION);
}

/* Without a descent direction the factor is not reused. */
static void end_curvature(cairn_pose_graph *graph)
{
    if (graph->slope > 0 && graph->curvature > 0) {
        graph->last_slope = graph->slope;
        cairn_pose_graph_enter(graph, graph->mode, POSE_GRAPH_MOVE);
    } else {
        graph->reuse_factor = graph->is_watchdog_step = 0;
        cairn_pose_graph_enter(graph, graph->mode, POSE_GRAPH_CLEAR);
    }
}

static void end_report(cairn_pose_graph *graph)
{
    graph->is_solution = graph->state.verdict != CAIRN_POSE_GRAPH_SINGULAR;
    graph->state.chi2 = graph->chi2;
    graph->state.cost = graph->cost;
    end(graph, CAIRN_OK);
}

static void begin_solve(cairn_pose_graph *graph)
{
    graph->stage = POSE_GRAPH_SOLVE;
    if (graph->solver.solve(graph->solver.context, graph->right[0]) != CAIRN_OK)
        not_positive(graph, -1);
}

/* The solver has ended a phase. */
static void end_solver_phase(cairn_pose_graph *graph, cairn_status status)
{
    cairn_block_solver_result result = graph->solver.read(graph->solver.context);

    if (graph->stage == POSE_GRAPH_ANALYZE) {
        graph->state.fill = result.fill;
        graph->analyzed = status == CAIRN_OK;
        graph->fill_exceeded = status == CAIRN_FULL;
        if (status == CAIRN_OK)
            cairn_pose_graph_enter(graph, graph->mode,
                                   graph->mode == POSE_GRAPH_INITIAL_COST ? POSE_GRAPH_COST
                                                                          : POSE_GRAPH_CLEAR);
        else
            end(graph, status);
    } else if (result.state == CAIRN_BLOCK_SOLVER_NOT_POSITIVE || status != CAIRN_OK) {
        not_positive(graph, result.failed_pose);
    } else if (graph->stage == POSE_GRAPH_FACTOR && graph->mode == POSE_GRAPH_COVARIANCE) {
        status = graph->solver.invert(graph->solver.context);
        CAIRN_ASSERT(status == CAIRN_OK);
        graph->stage = POSE_GRAPH_INVERT;
    } else if (graph->stage == POSE_GRAPH_FACTOR) {
        begin_solve(graph);
    } else if (graph->stage == POSE_GRAPH_SOLVE) {
        graph->slope = graph->curvature = 0;
        cairn_pose_graph_enter(graph, graph->mode,
                               graph->reuse_factor ? POSE_GRAPH_SLOPE : POSE_GRAPH_MOVE);
    } else {
        graph->has_marginals = 1;
        end(graph, CAIRN_OK);
    }
}

/* All equations are assembled: starts the factorization. */
static void begin_factor(cairn_pose_graph *graph)
{
    if (graph->outcome != CAIRN_OK) {
        graph->outcome = CAIRN_OK;
        not_positive(graph, -1);
        return;
    }
    graph->stage = POSE_GRAPH_FACTOR;
    if (graph->solver.factor(graph->solver.context) != CAIRN_OK)
        not_positive(graph, -1);
}

/* Executes one item of a stage other than the solver's; returns its units. */
static int32_t do_item(cairn_pose_graph *graph)
{
    int32_t poses = graph->state.poses, links = graph->state.links;

    switch (graph->stage) {
    case POSE_GRAPH_CLEAR:
        poses = clear_equations(graph);
        cairn_pose_graph_enter(graph, graph->mode, POSE_GRAPH_LINKS);
        return 1 + poses / POSES_PER_UNIT;
    case POSE_GRAPH_LINKS:
        if (graph->index < links) {
            cairn_pose_graph_assemble_link(graph, graph->index++);
            return UNITS_PER_EQUATIONS;
        }
        graph->base_cost = graph->cost;
        cairn_pose_graph_enter(graph, graph->mode, POSE_GRAPH_POSES);
        return UNITS_PER_POSE;
    case POSE_GRAPH_POSES:
        if (graph->index < poses)
            assemble_pose(graph, graph->index++);
        else
            begin_factor(graph);
        return UNITS_PER_POSE;
    case POSE_GRAPH_ROTATE:
        if (graph->index < poses) {
            rotate_displacement(graph, graph->index, 0, graph->right[graph->index]);
            graph->index++;
        } else {
            begin_solve(graph);
        }
        return UNITS_PER_POSE;
    case POSE_GRAPH_SLOPE:
        if (graph->index < poses)
            add_slope(graph, graph->index++);
        else
            end_slope(graph);
        return UNITS_PER_POSE;
    case POSE_GRAPH_DIRECTION:
        if (graph->index < poses)
            set_direction(graph, graph->index++);
        else
            cairn_pose_graph_enter(graph, graph->mode, POSE_GRAPH_CURVATURE);
        return UNITS_PER_POSE;
    case POSE_GRAPH_CURVATURE:
        if (graph->index < links) {
            graph->curvature += cairn_pose_graph_curvature_of_link(graph, graph->index++);
            return UNITS_PER_COST;
        }
        end_curvature(graph);
        return UNITS_PER_POSE;
    case POSE_GRAPH_MOVE:
        if (graph->index < poses)
            move_pose(graph, graph->index++);
        else if (graph->mode == POSE_GRAPH_HEADINGS)
            cairn_pose_graph_enter(graph, POSE_GRAPH_JOINT, POSE_GRAPH_CLEAR);
        else
            cairn_pose_graph_enter(graph, graph->mode, POSE_GRAPH_COST);
        return UNITS_PER_POSE;
    case POSE_GRAPH_COST:
        if (graph->index < links) {
            cairn_pose_graph_try_link(graph, graph->index++);
            return UNITS_PER_COST;
        }
        end_cost(graph);
        return 1 + poses / POSES_PER_UNIT;
    default:
        if (graph->index < links) {
            cairn_pose_graph_cost_of_link(graph, graph->index);
            graph->state.outliers += graph->links[graph->index++].chi2 > graph->params.max_chi2;
            return UNITS_PER_COST;
        }
        end_report(graph);
        return UNITS_PER_POSE;
    }
}

static int is_solver_stage(int32_t stage)
{
    return stage == POSE_GRAPH_ANALYZE || stage == POSE_GRAPH_FACTOR || stage == POSE_GRAPH_SOLVE ||
           stage == POSE_GRAPH_INVERT;
}

cairn_status cairn_pose_graph_step(cairn_pose_graph *graph, cairn_budget *budget)
{
    cairn_status outcome;

    while (graph->stage != POSE_GRAPH_IDLE || graph->units_due > 0) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        if (graph->units_due > 0) {
            int32_t charged = graph->units_due < budget->left ? graph->units_due : budget->left;

            graph->units_due -= charged;
            budget->left -= charged;
        } else if (is_solver_stage(graph->stage)) {
            cairn_status status = graph->solver.step(graph->solver.context, budget);

            if (status == CAIRN_MORE)
                return CAIRN_MORE;
            end_solver_phase(graph, status);
        } else {
            graph->units_due = do_item(graph);
        }
    }
    outcome = graph->outcome;
    graph->outcome = CAIRN_OK;
    return outcome;
}
