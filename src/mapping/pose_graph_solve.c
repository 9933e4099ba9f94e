/* Iterations of a pose graph.
 *
 * Method: Levenberg and Marquardt with the kernel's weights (iteratively reweighted). In the map's
 * frame a link has the residual g = (t_j - t_i - R_i t_z, theta_j - theta_i - theta_z) and the
 * information W = R_i Omega R_i^T; its derivative by the second pose is the identity and by the
 * first -A, A = [1 0 -v_y; 0 1 v_x; 0 0 1] with v = t_j - t_i. So a link adds W, A^T W A and -A^T
 * W. A fixed pose has the identity for its block and no links.
 *
 * The chordal start has the same form. Headings: g = r_j - R_z r_i for the unit vectors r, of the
 * information of the angle alone, which is linear; then the poses with v = R_i t_z of the headings
 * that came out, linear again.
 *
 * Near the minimum the factor of earlier poses preconditions conjugate gradients (Fletcher and
 * Reeves 1964): what a link asks for hardly changes in the frames of its poses, so right sides and
 * solutions are turned between the headings of then and of now. How far to go tells the curvature
 * along the step, and when to end the slope, which is the decrease that the factor promises. A full
 * step across which weak motions bend the graph may make the cost higher by their second order,
 * which the next such step takes away: it is judged after that one.
 *
 * Graduated: c^2 is multiplied by 2 max(e^T Omega e) / c^2 at first and by 1 / 1.4 from iteration
 * to iteration (Yang, Antonante, Tzoumas and Carlone 2020).
 *
 * Limits: local; the chordal start is least squares and suffers from outliers, BEST then stays with
 * the given one.
 *
 * Source: Grisetti et al., A tutorial on graph-based SLAM, 2010; Carlone, Tron, Daniilidis and
 * Dellaert, Initialization techniques for 3D SLAM, 2015; Carlone, Aragues, Castellanos and Bona,
 * A fast and accurate approximation for planar pose graph optimization, 2014; Chamberlain,
 * Powell, Lemarechal and Pedersen, The watchdog technique for forcing convergence, 1982; Agarwal
 * et al., Robust map optimization using dynamic covariance scaling, 2013. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/pose_graph_work.h"

enum { UNITS_LINK = 4, UNITS_EQUATIONS = 9, UNITS_POSE = 1, POSES_A_UNIT = 8 };

/* The weakest motions of large graphs have 1e-10 of the diagonal; in float that is below
 * rounding. */
static const cairn_real LEAST_DAMPING = CAIRN_REAL(1e-12) + CAIRN_REAL_EPSILON;
static const cairn_real MOST_DAMPING = CAIRN_REAL(1e6);
/* of the damping after a refused step */
static const cairn_real RAISING = 1000;
/* ... after a step that was taken at once */
static const cairn_real EASING = CAIRN_REAL(0.01);
/* of a step, in parts of the whole, before it is damped */
static const cairn_real SHORTEST = CAIRN_REAL(0.25);
/* change of the cost after which the factor serves again */
static const cairn_real SMALL_STEP = CAIRN_REAL(0.01);
/* ... of such a step, by that of the step before */
static const cairn_real SLOWING = CAIRN_REAL(0.3);
static const cairn_real NARROWING = CAIRN_REAL(1.4);

/* ---- Stages ---- */

void cairn_pose_graph_enter(cairn_pose_graph *g, int32_t mode, int32_t stage)
{
    g->mode = mode;
    g->stage = stage;
    g->at = 0;
    if (mode != POSE_GRAPH_NEWTON)
        g->reuse = g->ahead = 0;
    if (stage == POSE_GRAPH_CLEAR || stage == POSE_GRAPH_COST || stage == POSE_GRAPH_REPORT)
        g->chi2 = g->cost = g->largest = 0;
}

static void end(cairn_pose_graph *g, cairn_status outcome)
{
    g->stage = POSE_GRAPH_IDLE;
    g->outcome = outcome;
}

static void finish(cairn_pose_graph *g, cairn_pose_graph_verdict verdict)
{
    g->state.verdict = verdict;
    cairn_pose_graph_enter(g, POSE_GRAPH_NEWTON, POSE_GRAPH_REPORT);
}

static void accept(cairn_pose_graph *g)
{
    memcpy(g->poses, g->trial, (size_t)g->state.poses * sizeof *g->poses);
    g->state.chi2 = g->chi2;
    g->state.cost = g->cost;
}

/* From here on Newton steps. */
static void begin_newton(cairn_pose_graph *g)
{
    cairn_real c2 = g->params.width * g->params.width;

    g->damping = LEAST_DAMPING;
    g->refused = 0;
    g->widening = 1;
    if (g->params.graduated && g->params.kernel == CAIRN_POSE_GRAPH_GEMAN_MCCLURE)
        g->widening = cairn_max(1, 2 * g->largest / c2);
    cairn_pose_graph_enter(g, POSE_GRAPH_NEWTON, POSE_GRAPH_CLEAR);
}

static int raise_damping(cairn_pose_graph *g)
{
    g->refused = 1;
    g->length = 1;
    g->damping *= RAISING;
    return g->damping <= MOST_DAMPING;
}

/* After a refused step the damping that served stays for one more. */
static void lower_damping(cairn_pose_graph *g)
{
    if (!g->refused)
        g->damping = cairn_max(LEAST_DAMPING, EASING * g->damping);
    g->refused = 0;
}

/* A change of the cost that does not count. */
static cairn_real little(const cairn_pose_graph *g)
{
    return g->params.converged * (g->base_cost + (cairn_real)g->state.links);
}

/* Whether the factor serves the next step, too, after one that made the cost less by `better`:
 * not where that was little and the factor had promised more. */
static int serves_again(const cairn_pose_graph *g, cairn_real better)
{
    if (g->widening > 1 || g->length < 1)
        return 0;
    if (!g->reuse || g->ahead)
        return better <= SMALL_STEP * g->base_cost;
    return better <= SLOWING * g->better && (better > little(g) || better >= SLOWING * g->slope);
}

/* Whether a step to a higher cost is judged after another one with its factor. */
static int goes_ahead(const cairn_pose_graph *g, cairn_real better)
{
    return !g->reuse && g->length == 1 && g->widening <= 1 && -better <= SMALL_STEP * g->base_cost;
}

/* The next step begins at the poses that were tried, whose right sides are there, with the
 * factor at hand; or with one of its own. */
static void begin_step(cairn_pose_graph *g)
{
    if (g->reuse && !g->ahead)
        g->base_cost = g->cost;
    g->widening = cairn_max(1, g->widening / NARROWING);
    cairn_pose_graph_enter(g, POSE_GRAPH_NEWTON, g->reuse ? POSE_GRAPH_TURN : POSE_GRAPH_CLEAR);
}

/* A step has been tried: its cost is g->cost, that of the base g->base_cost, both with the same
 * kernel. One with an old factor tells nothing about rest; its slope does, see end_slope(). */
static void judge_step(cairn_pose_graph *g)
{
    cairn_real better = g->base_cost - g->cost;
    int at_rest = !g->reuse && cairn_abs(better) <= little(g) && g->widening <= 1,
        damped = g->damping > LEAST_DAMPING;
    int shorter = 0;

    g->state.iterations++;
    if (better >= 0) {
        accept(g);
        if (!g->reuse)
            lower_damping(g);
        if (!g->reuse || g->ahead)
            g->last_slope = 0;
        /* what is damped hides how far there is to go */
        g->reuse = !damped && serves_again(g, better);
        g->ahead = 0;
        g->better = better;
        g->length = 1;
    } else if (goes_ahead(g, better)) {
        g->reuse = g->ahead = 1;
        g->last_slope = 0;
    } else if (g->ahead) {
        g->reuse = g->ahead = 0;
        at_rest = !raise_damping(g);
    } else if (g->reuse) {
        g->reuse = 0;
    } else if (g->length > SHORTEST) {
        g->length /= 2;
        shorter = 1;
    } else if (!raise_damping(g)) {
        at_rest = 1;
    }
    if (at_rest) {
        finish(g, CAIRN_POSE_GRAPH_CONVERGED);
    } else if (g->state.iterations >= g->params.max_iterations) {
        finish(g, CAIRN_POSE_GRAPH_OUT_OF_ITERATIONS);
    } else if (shorter) {
        cairn_pose_graph_enter(g, POSE_GRAPH_NEWTON, POSE_GRAPH_MOVE);
    } else {
        begin_step(g);
    }
}

static void end_cost(cairn_pose_graph *g)
{
    int finite = cairn_is_finite(g->cost) && cairn_is_finite(g->chi2);

    if (g->mode == POSE_GRAPH_AS_GIVEN) {
        if (!finite) {
            end(g, CAIRN_NOT_FINITE);
            return;
        }
        accept(g);
        g->state.chi2_initial = g->chi2;
        g->state.cost_initial = g->cost;
        if (g->params.start == CAIRN_POSE_GRAPH_GIVEN)
            begin_newton(g);
        else
            cairn_pose_graph_enter(g, POSE_GRAPH_HEADINGS, POSE_GRAPH_CLEAR);
    } else if (g->mode == POSE_GRAPH_JOINT) {
        if (finite && (g->params.start == CAIRN_POSE_GRAPH_CHORDAL || g->cost < g->state.cost)) {
            accept(g);
            g->state.chordal = 1;
        }
        begin_newton(g);
    } else {
        if (!finite)
            g->cost = CAIRN_REAL_MAX;
        judge_step(g);
    }
}

/* The factor does not exist, or solves nothing: `pose` is free to move. */
static void not_positive(cairn_pose_graph *g, int32_t pose)
{
    g->reuse = g->ahead = 0;
    if (g->mode == POSE_GRAPH_COVARIANCE) {
        g->state.pose = pose;
        g->state.verdict = CAIRN_POSE_GRAPH_SINGULAR;
        g->settled = 0;
        end(g, CAIRN_OK);
    } else if (g->mode != POSE_GRAPH_NEWTON) {
        begin_newton(g);
    } else if (++g->state.iterations >= g->params.max_iterations || !raise_damping(g)) {
        g->state.pose = pose;
        finish(g, CAIRN_POSE_GRAPH_SINGULAR);
    } else {
        cairn_pose_graph_enter(g, POSE_GRAPH_NEWTON, POSE_GRAPH_CLEAR);
    }
}

/* The diagonal block of a pose. */
static void assemble_pose(cairn_pose_graph *g, int32_t pose)
{
    cairn_sym3 block = g->diagonal[pose];

    if (cairn_pose_graph_stays(g, pose)) {
        block.xx = block.yy = block.zz = 1;
    } else if (g->mode == POSE_GRAPH_NEWTON) {
        block.xx += g->damping * block.xx;
        block.yy += g->damping * block.yy;
        block.zz += g->damping * block.zz;
    } else if (g->mode == POSE_GRAPH_HEADINGS) {
        block.zz = 1;
    }
    g->heading[pose] = cairn_pose_graph_base(g)[pose].theta;
    if (g->solver.add_pose_block(g->solver.context, pose, block) != CAIRN_OK)
        g->outcome = CAIRN_NOT_FINITE;
}

static void solution_of(const cairn_pose_graph *g, int32_t index, cairn_real x[3])
{
    cairn_status status = g->solver.solution(g->solver.context, index, x);

    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
}

/* Turns a displacement of a pose from its heading now to that at which the matrix was factored,
 * or back. */
static void turn(const cairn_pose_graph *g, int32_t index, int back, cairn_real x[3])
{
    cairn_real angle = g->heading[index] - cairn_pose_graph_base(g)[index].theta, s, c,
               first = x[0];

    cairn_sincos(back ? -angle : angle, &s, &c);
    x[0] = c * first - s * x[1];
    x[1] = s * first + c * x[1];
}

/* The solution takes the place of the right side. */
static void add_slope(cairn_pose_graph *g, int32_t index)
{
    cairn_real *right = g->right[index], x[3];

    solution_of(g, index, x);
    g->slope += x[0] * right[0] + x[1] * right[1] + x[2] * right[2];
    turn(g, index, 1, x);
    memcpy(right, x, sizeof x);
}

static void set_direction(cairn_pose_graph *g, int32_t index)
{
    for (int k = 0; k < 3; k++)
        g->direction[index][k] =
            g->right[index][k] +
            (g->last_slope > 0 ? g->slope / g->last_slope * g->direction[index][k] : 0);
}

static void move_pose(cairn_pose_graph *g, int32_t index)
{
    cairn_pose pose = cairn_pose_graph_base(g)[index];
    cairn_real x[3], length = g->length;

    g->trial[index] = pose;
    memset(g->right[index], 0, sizeof g->right[index]);
    if (cairn_pose_graph_stays(g, index))
        return;
    if (g->reuse) {
        memcpy(x, g->direction[index], sizeof x);
        length = g->slope / g->curvature;
    } else {
        solution_of(g, index, x);
    }
    if (g->mode == POSE_GRAPH_HEADINGS) {
        cairn_transform t = cairn_transform_of(pose);

        pose.theta = cairn_atan2(t.sine + x[1], t.cosine + x[0]);
    } else {
        pose.x += length * x[0];
        pose.y += length * x[1];
        pose.theta = cairn_wrap_angle(pose.theta + length * x[2]);
    }
    g->trial[index] = pose;
}

/* Returns how many blocks and right sides were set to 0. */
static int32_t clear_equations(cairn_pose_graph *g)
{
    cairn_status status;

    memset(g->right, 0, (size_t)g->state.poses * sizeof *g->right);
    status = g->solver.clear(g->solver.context);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    memset(g->diagonal, 0, (size_t)g->state.poses * sizeof *g->diagonal);
    return g->state.poses + g->state.fill;
}

/* The slope is by how much the cost would become less if the factor were that of the matrix
 * here. */
static void end_slope(cairn_pose_graph *g)
{
    if (!g->ahead && cairn_abs(g->slope) <= little(g))
        finish(g, CAIRN_POSE_GRAPH_CONVERGED);
    else
        cairn_pose_graph_enter(g, g->mode, POSE_GRAPH_DIRECTION);
}

/* Where there is no way down the factor serves no longer. */
static void end_curvature(cairn_pose_graph *g)
{
    if (g->slope > 0 && g->curvature > 0) {
        g->last_slope = g->slope;
        cairn_pose_graph_enter(g, g->mode, POSE_GRAPH_MOVE);
    } else {
        g->reuse = g->ahead = 0;
        cairn_pose_graph_enter(g, g->mode, POSE_GRAPH_CLEAR);
    }
}

static void end_report(cairn_pose_graph *g)
{
    g->settled = g->state.verdict != CAIRN_POSE_GRAPH_SINGULAR;
    g->state.chi2 = g->chi2;
    g->state.cost = g->cost;
    end(g, CAIRN_OK);
}

static void begin_solve(cairn_pose_graph *g)
{
    g->stage = POSE_GRAPH_SOLVE;
    if (g->solver.solve(g->solver.context, g->right[0]) != CAIRN_OK)
        not_positive(g, -1);
}

/* The solver has ended a part. */
static void end_part(cairn_pose_graph *g, cairn_status status)
{
    cairn_block_solver_result result = g->solver.read(g->solver.context);

    if (g->stage == POSE_GRAPH_ANALYZE) {
        g->state.fill = result.fill;
        g->analyzed = status == CAIRN_OK;
        g->full = status == CAIRN_FULL;
        if (status == CAIRN_OK)
            cairn_pose_graph_enter(
                g, g->mode, g->mode == POSE_GRAPH_AS_GIVEN ? POSE_GRAPH_COST : POSE_GRAPH_CLEAR);
        else
            end(g, status);
    } else if (result.state == CAIRN_BLOCK_SOLVER_NOT_POSITIVE || status != CAIRN_OK) {
        not_positive(g, result.pose);
    } else if (g->stage == POSE_GRAPH_FACTOR && g->mode == POSE_GRAPH_COVARIANCE) {
        status = g->solver.invert(g->solver.context);
        CAIRN_ASSERT(status == CAIRN_OK);
        g->stage = POSE_GRAPH_INVERT;
    } else if (g->stage == POSE_GRAPH_FACTOR) {
        begin_solve(g);
    } else if (g->stage == POSE_GRAPH_SOLVE) {
        g->slope = g->curvature = 0;
        cairn_pose_graph_enter(g, g->mode, g->reuse ? POSE_GRAPH_SLOPE : POSE_GRAPH_MOVE);
    } else {
        g->has_marginals = 1;
        end(g, CAIRN_OK);
    }
}

/* All equations are there. */
static void begin_factor(cairn_pose_graph *g)
{
    if (g->outcome != CAIRN_OK) {
        g->outcome = CAIRN_OK;
        not_positive(g, -1);
        return;
    }
    g->stage = POSE_GRAPH_FACTOR;
    if (g->solver.factor(g->solver.context) != CAIRN_OK)
        not_positive(g, -1);
}

/* One item of the stages that are not the solver's; returns its units. */
static int32_t do_item(cairn_pose_graph *g)
{
    int32_t poses = g->state.poses, links = g->state.links;

    switch (g->stage) {
    case POSE_GRAPH_CLEAR:
        poses = clear_equations(g);
        cairn_pose_graph_enter(g, g->mode, POSE_GRAPH_LINKS);
        return 1 + poses / POSES_A_UNIT;
    case POSE_GRAPH_LINKS:
        if (g->at < links) {
            cairn_pose_graph_assemble_link(g, g->at++);
            return UNITS_EQUATIONS;
        }
        g->base_cost = g->cost;
        cairn_pose_graph_enter(g, g->mode, POSE_GRAPH_POSES);
        return UNITS_POSE;
    case POSE_GRAPH_POSES:
        if (g->at < poses)
            assemble_pose(g, g->at++);
        else
            begin_factor(g);
        return UNITS_POSE;
    case POSE_GRAPH_TURN:
        if (g->at < poses) {
            turn(g, g->at, 0, g->right[g->at]);
            g->at++;
        } else {
            begin_solve(g);
        }
        return UNITS_POSE;
    case POSE_GRAPH_SLOPE:
        if (g->at < poses)
            add_slope(g, g->at++);
        else
            end_slope(g);
        return UNITS_POSE;
    case POSE_GRAPH_DIRECTION:
        if (g->at < poses)
            set_direction(g, g->at++);
        else
            cairn_pose_graph_enter(g, g->mode, POSE_GRAPH_CURVATURE);
        return UNITS_POSE;
    case POSE_GRAPH_CURVATURE:
        if (g->at < links) {
            g->curvature += cairn_pose_graph_curvature_of_link(g, g->at++);
            return UNITS_LINK;
        }
        end_curvature(g);
        return UNITS_POSE;
    case POSE_GRAPH_MOVE:
        if (g->at < poses)
            move_pose(g, g->at++);
        else if (g->mode == POSE_GRAPH_HEADINGS)
            cairn_pose_graph_enter(g, POSE_GRAPH_JOINT, POSE_GRAPH_CLEAR);
        else
            cairn_pose_graph_enter(g, g->mode, POSE_GRAPH_COST);
        return UNITS_POSE;
    case POSE_GRAPH_COST:
        if (g->at < links) {
            cairn_pose_graph_try_link(g, g->at++);
            return UNITS_LINK;
        }
        end_cost(g);
        return 1 + poses / POSES_A_UNIT;
    default:
        if (g->at < links) {
            cairn_pose_graph_cost_of_link(g, g->at);
            g->state.outliers += g->links[g->at++].chi2 > g->params.outlier;
            return UNITS_LINK;
        }
        end_report(g);
        return UNITS_POSE;
    }
}

static int is_solvers(int32_t stage)
{
    return stage == POSE_GRAPH_ANALYZE || stage == POSE_GRAPH_FACTOR || stage == POSE_GRAPH_SOLVE ||
           stage == POSE_GRAPH_INVERT;
}

cairn_status cairn_pose_graph_step(cairn_pose_graph *graph, cairn_budget *budget)
{
    cairn_status outcome;

    while (graph->stage != POSE_GRAPH_IDLE || graph->debt > 0) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        if (graph->debt > 0) {
            int32_t paid = graph->debt < budget->left ? graph->debt : budget->left;

            graph->debt -= paid;
            budget->left -= paid;
        } else if (is_solvers(graph->stage)) {
            cairn_status status = graph->solver.step(graph->solver.context, budget);

            if (status == CAIRN_MORE)
                return CAIRN_MORE;
            end_part(graph, status);
        } else {
            graph->debt = do_item(graph);
        }
    }
    outcome = graph->outcome;
    graph->outcome = CAIRN_OK;
    return outcome;
}
