/* Pose graph optimization with rejection of outlier links; the method is in the header.
 *
 * Rejecting the outliers of the kernel keeps the graph connected, because a bridge (a link that
 * alone joins two components) can always be satisfied. If the graph is split nevertheless, the
 * poses of the robust kernel remain.
 *
 * Limits: few links beyond those of a tree leave few degrees of freedom, with which the test is
 * lenient.
 *
 * Source: chi-squared test of the weighted residuals; Geman and McClure, Statistical methods for
 * tomographic image reconstruction, 1987 (the robust kernel). */
#include "src/base/build.h"

#include <string.h>

#include "cairn/pose_graph_robust.h"
#include "src/base/object.h"
#include "src/base/step.h"

enum { MAX_POSES = 1 << 22 };

/* Poses or links of a pass. */
enum { ITEMS_PER_UNIT = 8 };

#define MAX_KERNEL_WIDTH CAIRN_REAL(1e6)

struct cairn_pose_graph_robust {
    cairn_pose *initial; /* [max_poses] poses of the graph at begin() */
    cairn_pose_graph *graph;
    int32_t poses, links;
    cairn_pose_graph_robust_result result;   /* of the optimization in progress */
    cairn_pose_graph_robust_result finished; /* of the last one that has ended */
    int32_t is_running;                      /* 1: step() has work left */
    cairn_status status; /* of step() while it waits: CAIRN_MORE, or what the graph has returned */
    int32_t cursor, units_charged;
    uint16_t resume, solution_resume, pass_resume;
    cairn_pose_graph_robust_params params;
};

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    CAIRN_INTEGER(cairn_pose_graph_robust_params, max_poses, 1000, 1, MAX_POSES),
    CAIRN_NUMBER_ABOVE(cairn_pose_graph_robust_params, max_deviations, 6, 0, CAIRN_REAL_MAX),
    CAIRN_NUMBER_ABOVE(cairn_pose_graph_robust_params, kernel_width, 3, 0, MAX_KERNEL_WIDTH),
};
extern const cairn_parameters cairn_pose_graph_robust_parameters;
const cairn_parameters cairn_pose_graph_robust_parameters =
    CAIRN_PARAMETERS("pose_graph_robust", cairn_pose_graph_robust_params, rows);

cairn_pose_graph_robust_params cairn_pose_graph_robust_default(void)
{
    cairn_pose_graph_robust_params params;

    cairn_parameters_preset(&cairn_pose_graph_robust_parameters, &params);
    return params;
}

cairn_status cairn_pose_graph_robust_check(const cairn_pose_graph_robust_params *params,
                                           cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_pose_graph_robust_parameters, params, fault);
}

/* The object and its poses; NULL from a counting pool. */
static cairn_pose_graph_robust *build(cairn_pool *pool,
                                      const cairn_pose_graph_robust_params *params)
{
    cairn_pose_graph_robust *robust = cairn_object_take(pool, sizeof *robust);

    CAIRN_TAKE(robust, pool, initial, params->max_poses);
    if (robust != NULL)
        robust->params = *params;
    return robust;
}

CAIRN_OBJECT(pose_graph_robust, pose_graph_robust, build);

/* ---- Passes over poses and links ---- */

static void keep_pose(cairn_pose_graph_robust *robust, int32_t pose)
{
    robust->initial[pose] = cairn_pose_graph_pose(robust->graph, pose);
}

static void reset_pose(cairn_pose_graph_robust *robust, int32_t pose)
{
    cairn_must_be_ok(cairn_pose_graph_set_pose(robust->graph, pose, robust->initial[pose]));
}

static void include_link(cairn_pose_graph_robust *robust, int32_t link)
{
    cairn_must_be_ok(cairn_pose_graph_exclude_link(robust->graph, link, 0));
}

static void reject_outlier(cairn_pose_graph_robust *robust, int32_t link)
{
    int32_t is_outlier = cairn_pose_graph_link_of(robust->graph, link).is_outlier;

    robust->result.outliers += is_outlier;
    cairn_must_be_ok(cairn_pose_graph_exclude_link(robust->graph, link, is_outlier));
}

typedef void (*visitor)(cairn_pose_graph_robust *robust, int32_t item);

/* Visits some items from the current one on. */
static void visit_some(cairn_pose_graph_robust *robust, int32_t count, visitor visit)
{
    for (int32_t i = robust->cursor; i < robust->cursor + ITEMS_PER_UNIT && i < count; i++)
        visit(robust, i);
}

/* Visits all poses or links. */
static int pass(cairn_pose_graph_robust *robust, int32_t count, visitor visit, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(robust->pass_resume);
    for (robust->cursor = 0; robust->cursor < count; robust->cursor += ITEMS_PER_UNIT) {
        CAIRN_STEP_CHARGE_UNIT(robust, pass_resume, budget);
        visit_some(robust, count, visit);
    }
    CAIRN_STEP_END(robust->pass_resume);
}

/* ---- Solutions ---- */

/* Starts a solution; 0 when it is refused. */
static int begin_solution(cairn_pose_graph_robust *robust, cairn_pose_graph_kernel kernel)
{
    cairn_status status =
        cairn_pose_graph_set_kernel(robust->graph, kernel, robust->params.kernel_width);

    if (status == CAIRN_OK)
        status = cairn_pose_graph_solve(robust->graph);
    robust->status = status == CAIRN_OK ? CAIRN_MORE : status;
    return status == CAIRN_OK;
}

/* Continues the solution; 1 when it has ended. A graph that has failed has no verdict: until its
 * factor is extended, the failure remains. */
static int continue_solution(cairn_pose_graph_robust *robust, cairn_budget *budget)
{
    cairn_status status = cairn_pose_graph_step(robust->graph, budget);

    if (status == CAIRN_OK &&
        cairn_pose_graph_read(robust->graph).verdict == CAIRN_POSE_GRAPH_RUNNING)
        return 0;
    robust->status = status == CAIRN_OK ? CAIRN_MORE : status;
    return status == CAIRN_OK;
}

/* Runs one optimization to its end. */
static int solve(cairn_pose_graph_robust *robust, cairn_pose_graph_kernel kernel,
                 cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(robust->solution_resume);
    CAIRN_STEP_CHARGE(robust, solution_resume, budget,
                      1 + (robust->poses + robust->links) / ITEMS_PER_UNIT);
    CAIRN_STEP_UNTIL(robust->solution_resume, begin_solution(robust, kernel));
    CAIRN_STEP_RUN(robust, solution_resume, budget, continue_solution);
    CAIRN_STEP_END(robust->solution_resume);
}

/* The chi-squared test: 1 when chi2 is plausible for its degrees of freedom. A chi2 variable has
 * mean f and variance 2 f. */
static int passes_chi2_test(const cairn_pose_graph_robust *robust, cairn_real chi2)
{
    cairn_real freedom = 3 * ((cairn_real)robust->links - (cairn_real)robust->poses);

    freedom = cairn_max(freedom, 1);
    return chi2 <= freedom + robust->params.max_deviations * cairn_sqrt(2 * freedom);
}

/* Tests the first least squares. */
static void test_solution(cairn_pose_graph_robust *robust)
{
    cairn_pose_graph_state state = cairn_pose_graph_read(robust->graph);

    robust->result.chi2_initial = state.chi2_initial;
    robust->result.is_robust = !passes_chi2_test(robust, state.chi2);
}

static int optimize(cairn_pose_graph_robust *robust, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(robust->resume);
    CAIRN_STEP_UNTIL(robust->resume, pass(robust, robust->poses, keep_pose, budget));
    CAIRN_STEP_UNTIL(robust->resume, pass(robust, robust->links, include_link, budget));
    CAIRN_STEP_UNTIL(robust->resume, solve(robust, CAIRN_POSE_GRAPH_SQUARE, budget));
    test_solution(robust);
    if (robust->result.is_robust) {
        CAIRN_STEP_UNTIL(robust->resume, pass(robust, robust->poses, reset_pose, budget));
        CAIRN_STEP_UNTIL(robust->resume, solve(robust, CAIRN_POSE_GRAPH_GEMAN_MCCLURE, budget));
        CAIRN_STEP_UNTIL(robust->resume, pass(robust, robust->links, reject_outlier, budget));
        CAIRN_STEP_UNTIL(robust->resume, solve(robust, CAIRN_POSE_GRAPH_SQUARE, budget));
    }
    robust->finished = robust->result;
    CAIRN_STEP_END(robust->resume);
}

cairn_status cairn_pose_graph_robust_begin(cairn_pose_graph_robust *robust, cairn_pose_graph *graph)
{
    cairn_pose_graph_state state;

    if (robust == NULL || graph == NULL)
        return CAIRN_BAD_ARGUMENT;
    state = cairn_pose_graph_read(graph);
    if (state.poses == 0)
        return CAIRN_EMPTY;
    if (state.poses > robust->params.max_poses)
        return CAIRN_FULL;
    if (cairn_pose_graph_set_kernel(graph, CAIRN_POSE_GRAPH_SQUARE, robust->params.kernel_width) !=
        CAIRN_OK)
        return CAIRN_BAD_ARGUMENT;
    memset(&robust->result, 0, sizeof robust->result);
    robust->status = CAIRN_MORE;
    robust->graph = graph;
    robust->poses = state.poses;
    robust->links = state.links;
    robust->is_running = 1;
    robust->units_charged = 0;
    robust->resume = robust->solution_resume = robust->pass_resume = 0;
    return CAIRN_OK;
}

cairn_status cairn_pose_graph_robust_step(cairn_pose_graph_robust *robust, cairn_budget *budget)
{
    if (robust == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (robust->is_running && !optimize(robust, budget))
        return robust->status;
    robust->is_running = 0;
    return CAIRN_OK;
}

cairn_pose_graph_robust_result cairn_pose_graph_robust_read(const cairn_pose_graph_robust *robust)
{
    return robust->finished;
}
