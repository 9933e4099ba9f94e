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

/* Units of a link whose normal equations are formed, of a link whose cost is evaluated, of a pose,
 * and of a pass over poses or links beside its items; poses or blocks that are copied or cleared in
 * a unit. */
enum {
    UNITS_PER_EQUATIONS = 9,
    UNITS_PER_COST = 4,
    UNITS_PER_POSE = 1,
    UNITS_PER_PASS = 1,
    POSES_PER_UNIT = 8
};

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

/* ---- Passes over poses or links ---- */

/* Operation on a pose or a link. */
typedef void (*pose_graph_operation)(cairn_pose_graph *graph, int32_t index);

/* Does an operation of `units` on each of `count` poses or links. */
static int for_each(cairn_pose_graph *graph, cairn_budget *budget, int32_t count, int32_t units,
                    pose_graph_operation operation)
{
    CAIRN_STEP_BEGIN(graph->pass_resume);
    CAIRN_STEP_CHARGE(graph, pass_resume, budget, UNITS_PER_PASS);
    for (graph->index = 0; graph->index < count; graph->index++) {
        CAIRN_STEP_CHARGE(graph, pass_resume, budget, units);
        operation(graph, graph->index);
    }
    CAIRN_STEP_END(graph->pass_resume);
}

static int for_each_pose(cairn_pose_graph *graph, cairn_budget *budget,
                         pose_graph_operation operation)
{
    return for_each(graph, budget, graph->state.poses, UNITS_PER_POSE, operation);
}

static int for_each_link(cairn_pose_graph *graph, cairn_budget *budget, int32_t units,
                         pose_graph_operation operation)
{
    return for_each(graph, budget, graph->state.links, units, operation);
}

/* ---- The linear system ---- */

/* Sets the linear problem; only Newton steps reuse a factor. */
static void set_mode(cairn_pose_graph *graph, pose_graph_mode mode)
{
    graph->system.mode = mode;
    if (mode != POSE_GRAPH_NEWTON)
        graph->newton.reuse_factor = graph->newton.is_watchdog_step = 0;
}

/* Starts the sums over the links. */
static void clear_sums(pose_graph_sums *sums)
{
    sums->chi2 = sums->cost = sums->max_chi2 = 0;
}

/* Units of clear_equations(). */
static int32_t clearing_units(const cairn_pose_graph *graph)
{
    return 1 + (graph->state.poses + graph->state.fill) / POSES_PER_UNIT;
}

/* Sets the equations, and the sums over the links, to 0. */
static void clear_equations(cairn_pose_graph *graph)
{
    size_t poses = (size_t)graph->state.poses;

    cairn_must_be_ok(graph->solver.clear(graph->solver.context));
    memset(graph->system.right, 0, poses * sizeof *graph->system.right);
    memset(graph->system.diagonal, 0, poses * sizeof *graph->system.diagonal);
    clear_sums(&graph->sums);
    graph->system.is_singular = 0;
    graph->system.singular_pose = -1;
}

/* Adds the diagonal block of a pose. */
static void assemble_pose(cairn_pose_graph *graph, int32_t pose)
{
    cairn_sym3 block = graph->system.diagonal[pose];

    if (cairn_pose_graph_is_fixed(graph, pose)) {
        block.xx = block.yy = block.zz = 1;
    } else if (graph->system.mode == POSE_GRAPH_NEWTON) {
        block.xx += graph->newton.damping * block.xx;
        block.yy += graph->newton.damping * block.yy;
        block.zz += graph->newton.damping * block.zz;
    } else if (graph->system.mode == POSE_GRAPH_HEADINGS) {
        block.zz = 1;
    }
    graph->system.heading[pose] = cairn_pose_graph_linearization_poses(graph)[pose].theta;
    if (graph->solver.add_pose_block(graph->solver.context, pose, block) != CAIRN_OK)
        graph->system.is_singular = 1;
}

static void solution_of(const cairn_pose_graph *graph, int32_t index, cairn_real x[3])
{
    cairn_must_be_ok(graph->solver.solution(graph->solver.context, index, x));
}

/* Rotates a displacement of a pose from its current heading to that of the factorization, or
 * back. */
static void rotate_displacement(const cairn_pose_graph *graph, int32_t index, int back,
                                cairn_real x[3])
{
    cairn_real angle = graph->system.heading[index] -
                       cairn_pose_graph_linearization_poses(graph)[index].theta,
               s, c, first = x[0];

    cairn_sincos(back ? -angle : angle, &s, &c);
    x[0] = c * first - s * x[1];
    x[1] = s * first + c * x[1];
}

/* Rotates the right-hand side of a pose into the heading of the factor. */
static void rotate_right_side(cairn_pose_graph *graph, int32_t index)
{
    rotate_displacement(graph, index, 0, graph->system.right[index]);
}

/* Runs the current phase of the solver to its end. */
static int run_solver(cairn_pose_graph *graph, cairn_budget *budget)
{
    cairn_block_solver_result result;

    if (budget->left <= 0)
        return 0;
    graph->system.solver_status = graph->solver.step(graph->solver.context, budget);
    if (graph->system.solver_status == CAIRN_MORE)
        return 0;
    result = graph->solver.read(graph->solver.context);
    if (result.state == CAIRN_BLOCK_SOLVER_NOT_POSITIVE ||
        graph->system.solver_status != CAIRN_OK) {
        graph->system.is_singular = 1;
        graph->system.singular_pose = result.failed_pose;
    }
    return 1;
}

/* Starts to factor the assembled matrix. */
static void begin_factor(cairn_pose_graph *graph)
{
    if (!graph->system.is_singular && graph->solver.factor(graph->solver.context) != CAIRN_OK)
        graph->system.is_singular = 1;
}

/* Starts to solve the system with the factor, or to invert the matrix. */
static void begin_solution(cairn_pose_graph *graph)
{
    cairn_status status;

    if (graph->system.is_singular)
        return;
    status = graph->system.mode == POSE_GRAPH_COVARIANCE
                 ? graph->solver.invert(graph->solver.context)
                 : graph->solver.solve(graph->solver.context, graph->system.right[0]);
    graph->system.is_singular = status != CAIRN_OK;
}

/* Solves the linear system: with the reused factor, or with the factor of its own matrix. */
static int solve_system(cairn_pose_graph *graph, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(graph->system.resume);
    if (graph->newton.reuse_factor) {
        CAIRN_STEP_UNTIL(graph->system.resume, for_each_pose(graph, budget, rotate_right_side));
    } else {
        CAIRN_STEP_CHARGE(graph, system.resume, budget, clearing_units(graph));
        clear_equations(graph);
        CAIRN_STEP_UNTIL(graph->system.resume, for_each_link(graph, budget, UNITS_PER_EQUATIONS,
                                                             cairn_pose_graph_assemble_link));
        graph->newton.base_cost = graph->sums.cost;
        CAIRN_STEP_UNTIL(graph->system.resume, for_each_pose(graph, budget, assemble_pose));
        begin_factor(graph);
        if (!graph->system.is_singular)
            CAIRN_STEP_UNTIL(graph->system.resume, run_solver(graph, budget));
    }
    begin_solution(graph);
    if (!graph->system.is_singular)
        CAIRN_STEP_UNTIL(graph->system.resume, run_solver(graph, budget));
    CAIRN_STEP_END(graph->system.resume);
}

/* Cost of the trial poses. What follows may accept these, which copies them. */
static int find_cost(cairn_pose_graph *graph, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(graph->system.resume);
    clear_sums(&graph->sums);
    CAIRN_STEP_UNTIL(graph->system.resume,
                     for_each_link(graph, budget, UNITS_PER_COST, cairn_pose_graph_try_link));
    CAIRN_STEP_CHARGE(graph, system.resume, budget, graph->state.poses / POSES_PER_UNIT);
    CAIRN_STEP_END(graph->system.resume);
}

/* ---- Operations of a step ---- */

/* Adds a pose's part of the slope, which is the decrease of the cost that the factor predicts; the
 * solution replaces the right-hand side. */
static void add_slope(cairn_pose_graph *graph, int32_t index)
{
    cairn_real *right = graph->system.right[index], x[3];

    solution_of(graph, index, x);
    graph->newton.slope += x[0] * right[0] + x[1] * right[1] + x[2] * right[2];
    rotate_displacement(graph, index, 1, x);
    memcpy(right, x, sizeof x);
}

/* Conjugate direction of a pose. */
static void set_direction(cairn_pose_graph *graph, int32_t index)
{
    for (int k = 0; k < 3; k++)
        graph->newton.direction[index][k] =
            graph->system.right[index][k] + (graph->newton.last_slope > 0
                                                 ? graph->newton.slope / graph->newton.last_slope *
                                                       graph->newton.direction[index][k]
                                                 : 0);
}

/* Adds a link's part of the curvature along the direction. */
static void add_curvature(cairn_pose_graph *graph, int32_t index)
{
    graph->newton.curvature += cairn_pose_graph_curvature_of_link(graph, index);
}

/* Moves a trial pose. */
static void move_pose(cairn_pose_graph *graph, int32_t index)
{
    cairn_pose pose = cairn_pose_graph_linearization_poses(graph)[index];
    cairn_real x[3], length = graph->newton.step_fraction;

    graph->trial[index] = pose;
    memset(graph->system.right[index], 0, sizeof graph->system.right[index]);
    if (cairn_pose_graph_is_fixed(graph, index))
        return;
    if (graph->newton.reuse_factor) {
        memcpy(x, graph->newton.direction[index], sizeof x);
        length = graph->newton.slope / graph->newton.curvature;
    } else {
        solution_of(graph, index, x);
    }
    if (graph->system.mode == POSE_GRAPH_HEADINGS) {
        cairn_transform t = cairn_transform_of(pose);

        pose.theta = cairn_atan2(t.sine + x[1], t.cosine + x[0]);
    } else {
        pose.x += length * x[0];
        pose.y += length * x[1];
        pose.theta = cairn_wrap_angle(pose.theta + length * x[2]);
    }
    graph->trial[index] = pose;
}

/* Residual of a link at the accepted poses. */
static void report_link(cairn_pose_graph *graph, int32_t index)
{
    cairn_pose_graph_cost_of_link(graph, index);
    graph->state.outliers += graph->links[index].chi2 > graph->params.max_chi2;
}

/* ---- The optimization ---- */

static void accept(cairn_pose_graph *graph)
{
    memcpy(graph->poses, graph->trial, (size_t)graph->state.poses * sizeof *graph->poses);
    graph->state.chi2 = graph->sums.chi2;
    graph->state.cost = graph->sums.cost;
}

/* Starts the Newton steps. */
static void begin_newton(cairn_pose_graph *graph)
{
    pose_graph_newton *newton = &graph->newton;
    cairn_real c2 = graph->params.kernel_width * graph->params.kernel_width;

    set_mode(graph, POSE_GRAPH_NEWTON);
    newton->damping = MIN_DAMPING;
    newton->was_rejected = 0;
    newton->kernel_scale = 1;
    if (graph->params.graduated && graph->params.kernel == CAIRN_POSE_GRAPH_GEMAN_MCCLURE)
        newton->kernel_scale = cairn_max(1, 2 * graph->sums.max_chi2 / c2);
}

static int raise_damping(pose_graph_newton *newton)
{
    newton->was_rejected = 1;
    newton->step_fraction = 1;
    newton->damping *= DAMPING_INCREASE;
    return newton->damping <= MAX_DAMPING;
}

/* After a rejected step the successful damping stays for one more step. */
static void lower_damping(pose_graph_newton *newton)
{
    if (!newton->was_rejected)
        newton->damping = cairn_max(MIN_DAMPING, DAMPING_DECREASE * newton->damping);
    newton->was_rejected = 0;
}

/* Returns the decrease of the cost that counts as converged. */
static cairn_real convergence_threshold(const cairn_pose_graph *graph)
{
    return graph->params.converged_decrease *
           (graph->newton.base_cost + (cairn_real)graph->state.links);
}

/* Returns 1 when the factor is reused for the next step, after a decrease of the cost: not where
 * the decrease was small and the factor had predicted more.
 *
 * threshold: decrease that counts as converged */
static int may_reuse_factor(const pose_graph_newton *newton, cairn_real better,
                            cairn_real threshold)
{
    if (newton->kernel_scale > 1 || newton->step_fraction < 1)
        return 0;
    if (!newton->reuse_factor || newton->is_watchdog_step)
        return better <= MAX_REUSE_DECREASE * newton->base_cost;
    return better <= MAX_DECREASE_RATIO * newton->last_decrease &&
           (better > threshold || better >= MAX_DECREASE_RATIO * newton->slope);
}

/* Returns 1 when a step to a higher cost is judged after another one with the same factor
 * (watchdog). */
static int may_defer_evaluation(const pose_graph_newton *newton, cairn_real better)
{
    return !newton->reuse_factor && newton->step_fraction == 1 && newton->kernel_scale <= 1 &&
           -better <= MAX_REUSE_DECREASE * newton->base_cost;
}

/* Prepares the next step: at the trial poses, of the given cost, whose right-hand sides exist, with
 * the reused factor; or with a factor of its own. */
static void begin_step(pose_graph_newton *newton, cairn_real cost)
{
    if (newton->reuse_factor && !newton->is_watchdog_step)
        newton->base_cost = cost;
    newton->kernel_scale = cairn_max(1, newton->kernel_scale / KERNEL_NARROWING);
}

/* 1 when the sums over the links did not overflow. */
static int is_finite_cost(const pose_graph_sums *sums)
{
    return cairn_is_finite(sums->cost) && cairn_is_finite(sums->chi2);
}

/* Accepts or rejects a tried step. Its cost is cost, that of the linearization point base_cost,
 * both with the same kernel. A step with a reused factor does not show convergence; its slope does,
 * see iterate(). Returns 1 when a shorter step is to be tried in the same direction. */
static int evaluate_step(cairn_pose_graph *graph)
{
    pose_graph_newton *newton = &graph->newton;
    cairn_real better;
    int at_rest, damped = newton->damping > MIN_DAMPING, shorter = 0;

    if (!is_finite_cost(&graph->sums))
        graph->sums.cost = CAIRN_REAL_MAX;
    better = newton->base_cost - graph->sums.cost;
    at_rest = !newton->reuse_factor && cairn_abs(better) <= convergence_threshold(graph) &&
              newton->kernel_scale <= 1;
    graph->state.iterations++;
    if (better >= 0) {
        accept(graph);
        if (!newton->reuse_factor)
            lower_damping(newton);
        if (!newton->reuse_factor || newton->is_watchdog_step)
            newton->last_slope = 0;
        /* a damped step hides the distance to the minimum */
        newton->reuse_factor =
            !damped && may_reuse_factor(newton, better, convergence_threshold(graph));
        newton->is_watchdog_step = 0;
        newton->last_decrease = better;
        newton->step_fraction = 1;
    } else if (may_defer_evaluation(newton, better)) {
        newton->reuse_factor = newton->is_watchdog_step = 1;
        newton->last_slope = 0;
    } else if (newton->is_watchdog_step) {
        newton->reuse_factor = newton->is_watchdog_step = 0;
        at_rest = !raise_damping(newton);
    } else if (newton->reuse_factor) {
        newton->reuse_factor = 0;
    } else if (newton->step_fraction > MIN_STEP_FRACTION) {
        newton->step_fraction /= 2;
        shorter = 1;
    } else if (!raise_damping(newton)) {
        at_rest = 1;
    }
    if (at_rest)
        graph->state.verdict = CAIRN_POSE_GRAPH_CONVERGED;
    else if (graph->state.iterations >= graph->params.max_iterations)
        graph->state.verdict = CAIRN_POSE_GRAPH_OUT_OF_ITERATIONS;
    else if (!shorter)
        begin_step(newton, graph->sums.cost);
    return shorter && graph->state.verdict == CAIRN_POSE_GRAPH_RUNNING;
}

/* After a step whose linear system has no solution: more damping, until that is of no use. */
static void reject_singular_step(cairn_pose_graph *graph)
{
    graph->newton.reuse_factor = graph->newton.is_watchdog_step = 0;
    if (++graph->state.iterations >= graph->params.max_iterations ||
        !raise_damping(&graph->newton)) {
        graph->state.pose = graph->system.singular_pose;
        graph->state.verdict = CAIRN_POSE_GRAPH_SINGULAR;
    }
}

/* Damped Newton steps, and steps along conjugate directions with the factor of an earlier one. */
static int iterate(cairn_pose_graph *graph, cairn_budget *budget)
{
    pose_graph_newton *newton = &graph->newton;

    CAIRN_STEP_BEGIN(graph->part_resume);
    begin_newton(graph);
    while (graph->state.verdict == CAIRN_POSE_GRAPH_RUNNING) {
        CAIRN_STEP_RUN(graph, part_resume, budget, solve_system);
        if (graph->system.is_singular) {
            reject_singular_step(graph);
            continue;
        }
        if (newton->reuse_factor) {
            newton->slope = newton->curvature = 0;
            CAIRN_STEP_UNTIL(graph->part_resume, for_each_pose(graph, budget, add_slope));
            if (!newton->is_watchdog_step &&
                cairn_abs(newton->slope) <= convergence_threshold(graph)) {
                graph->state.verdict = CAIRN_POSE_GRAPH_CONVERGED;
                continue;
            }
            CAIRN_STEP_UNTIL(graph->part_resume, for_each_pose(graph, budget, set_direction));
            CAIRN_STEP_UNTIL(graph->part_resume,
                             for_each_link(graph, budget, UNITS_PER_COST, add_curvature));
            if (!(newton->slope > 0 && newton->curvature > 0)) {
                /* No descent: the next step has a factor of its own. */
                newton->reuse_factor = newton->is_watchdog_step = 0;
                continue;
            }
            newton->last_slope = newton->slope;
        }
        do {
            CAIRN_STEP_UNTIL(graph->part_resume, for_each_pose(graph, budget, move_pose));
            CAIRN_STEP_RUN(graph, part_resume, budget, find_cost);
        } while (evaluate_step(graph));
    }
    CAIRN_STEP_END(graph->part_resume);
}

/* Accepts the poses of the chordal initialisation where they are wanted. */
static void end_chordal(cairn_pose_graph *graph)
{
    if (is_finite_cost(&graph->sums) &&
        (graph->params.start == CAIRN_POSE_GRAPH_CHORDAL || graph->sums.cost < graph->state.cost)) {
        accept(graph);
        graph->state.chordal = 1;
    }
}

/* Chordal initialisation; a system without solution ends it. */
static int initialize(cairn_pose_graph *graph, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(graph->part_resume);
    set_mode(graph, POSE_GRAPH_HEADINGS);
    CAIRN_STEP_RUN(graph, part_resume, budget, solve_system);
    if (!graph->system.is_singular) {
        CAIRN_STEP_UNTIL(graph->part_resume, for_each_pose(graph, budget, move_pose));
        set_mode(graph, POSE_GRAPH_JOINT);
        CAIRN_STEP_RUN(graph, part_resume, budget, solve_system);
    }
    if (!graph->system.is_singular) {
        CAIRN_STEP_UNTIL(graph->part_resume, for_each_pose(graph, budget, move_pose));
        CAIRN_STEP_RUN(graph, part_resume, budget, find_cost);
        end_chordal(graph);
    }
    CAIRN_STEP_END(graph->part_resume);
}

/* The solver has analyzed the sparsity structure, or its factor has no capacity for it. */
static void end_analysis(cairn_pose_graph *graph)
{
    graph->state.fill = graph->solver.read(graph->solver.context).fill;
    graph->outcome = graph->system.solver_status;
    graph->analyzed = graph->outcome == CAIRN_OK;
    graph->fill_exceeded = graph->outcome == CAIRN_FULL;
}

/* The cost of the initial poses is known. */
static void end_initial_cost(cairn_pose_graph *graph)
{
    if (!is_finite_cost(&graph->sums)) {
        graph->outcome = CAIRN_NOT_FINITE;
        return;
    }
    accept(graph);
    graph->state.chi2_initial = graph->sums.chi2;
    graph->state.cost_initial = graph->sums.cost;
}

/* The residuals of all links are known. */
static void end_report(cairn_pose_graph *graph)
{
    graph->is_solution = graph->state.verdict != CAIRN_POSE_GRAPH_SINGULAR;
    graph->state.chi2 = graph->sums.chi2;
    graph->state.cost = graph->sums.cost;
}

/* The solution: see Method in the head of this file. */
static int solve(cairn_pose_graph *graph, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(graph->resume);
    graph->outcome = CAIRN_OK;
    set_mode(graph, POSE_GRAPH_INITIAL_COST);
    if (!graph->analyzed) {
        CAIRN_STEP_RUN(graph, resume, budget, run_solver);
        end_analysis(graph);
    }
    if (graph->outcome == CAIRN_OK) {
        CAIRN_STEP_RUN(graph, resume, budget, find_cost);
        end_initial_cost(graph);
    }
    if (graph->outcome == CAIRN_OK) {
        if (graph->params.start != CAIRN_POSE_GRAPH_GIVEN)
            CAIRN_STEP_RUN(graph, resume, budget, initialize);
        CAIRN_STEP_RUN(graph, resume, budget, iterate);
        clear_sums(&graph->sums);
        CAIRN_STEP_UNTIL(graph->resume, for_each_link(graph, budget, UNITS_PER_COST, report_link));
        end_report(graph);
    }
    CAIRN_STEP_END(graph->resume);
}

/* The solver has the inverse, or the links do not determine a pose. */
static void end_inverse(cairn_pose_graph *graph)
{
    graph->has_marginals = !graph->system.is_singular;
    if (!graph->system.is_singular)
        return;
    graph->state.pose = graph->system.singular_pose;
    graph->state.verdict = CAIRN_POSE_GRAPH_SINGULAR;
    graph->is_solution = 0;
}

/* The marginal covariances: the inverse at the accepted poses. */
static int invert(cairn_pose_graph *graph, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(graph->resume);
    graph->outcome = CAIRN_OK;
    set_mode(graph, POSE_GRAPH_COVARIANCE);
    CAIRN_STEP_RUN(graph, resume, budget, solve_system);
    end_inverse(graph);
    CAIRN_STEP_END(graph->resume);
}

cairn_status cairn_pose_graph_step(cairn_pose_graph *graph, cairn_budget *budget)
{
    if ((graph->is_solving && !solve(graph, budget)) ||
        (graph->is_inverting && !invert(graph, budget)))
        return CAIRN_MORE;
    if (cairn_pose_graph_is_idle(graph))
        return CAIRN_OK;
    graph->is_solving = graph->is_inverting = 0;
    return graph->outcome;
}
