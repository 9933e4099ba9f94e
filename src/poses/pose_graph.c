/* pose_graph: the graph object, its changes and its results. The iterations are in
 * pose_graph_solve.c.
 *
 * Layout: links keep their information matrix rotated into the frame of their first pose, where the
 * residual is R_i^T (t_j - t_i) - t_z. */
#include "src/base/build.h"

#include <string.h>

#include "src/poses/pose_graph_work.h"

enum { MAX_POSES = 1 << 22, MAX_LINKS = 1 << 24, MAX_FILL = 1 << 26 };

/* Default of converged_decrease: above the rounding of the costs. */
#define CONVERGED_DECREASE                                                                         \
    (CAIRN_REAL_EPSILON < CAIRN_REAL(1e-10) ? CAIRN_REAL(1e-9) : CAIRN_REAL(1e-5))

#define INTEGER(field, ...)  CAIRN_INTEGER(cairn_pose_graph_params, field, __VA_ARGS__)
#define POSITIVE(field, ...) CAIRN_NUMBER_ABOVE(cairn_pose_graph_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_poses, 1000, 1, MAX_POSES),
    INTEGER(max_links, 3000, 1, MAX_LINKS),
    INTEGER(max_fill, 12000, 0, MAX_FILL),
    INTEGER(start, CAIRN_POSE_GRAPH_BEST, CAIRN_POSE_GRAPH_GIVEN, CAIRN_POSE_GRAPH_BEST),
    INTEGER(kernel, CAIRN_POSE_GRAPH_SQUARE, CAIRN_POSE_GRAPH_SQUARE, CAIRN_POSE_GRAPH_DCS),
    POSITIVE(kernel_width, 3, 0, CAIRN_REAL(1e6)),
    INTEGER(graduated, 0, 0, 1),
    INTEGER(max_iterations, 100, 1, INT32_MAX),
    CAIRN_NUMBER_BETWEEN(cairn_pose_graph_params, converged_decrease, CONVERGED_DECREASE, 0, 1),
    POSITIVE(max_chi2, CAIRN_REAL(16.27), 0, CAIRN_REAL_MAX),
};
const cairn_parameters cairn_pose_graph_parameters =
    CAIRN_PARAMETERS("pose_graph", cairn_pose_graph_params, rows);

cairn_pose_graph_params cairn_pose_graph_default(void)
{
    cairn_pose_graph_params params;

    cairn_parameters_preset(&cairn_pose_graph_parameters, &params);
    return params;
}

cairn_status cairn_pose_graph_check(const cairn_pose_graph_params *params,
                                    cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_pose_graph_parameters, params, fault);
}

/* ---- The built-in solver ---- */

static cairn_status builtin_begin(void *context, int32_t poses)
{
    return cairn_block_solver_begin(context, poses);
}

static cairn_status builtin_add_link(void *context, int32_t first, int32_t second)
{
    return cairn_block_solver_add_link(context, first, second);
}

static cairn_status builtin_analyze(void *context)
{
    return cairn_block_solver_analyze(context);
}

static cairn_status builtin_clear(void *context)
{
    return cairn_block_solver_clear(context);
}

static cairn_status builtin_add_pose_block(void *context, int32_t pose, cairn_sym3 block)
{
    return cairn_block_solver_add_pose_block(context, pose, block);
}

static cairn_status builtin_add_link_block(void *context, int32_t link, const cairn_real block[9])
{
    return cairn_block_solver_add_link_block(context, link, block);
}

static cairn_status builtin_factor(void *context)
{
    return cairn_block_solver_factor(context);
}

static cairn_status builtin_solve(void *context, const cairn_real *b)
{
    return cairn_block_solver_solve(context, b);
}

static cairn_status builtin_solution(const void *context, int32_t pose, cairn_real x[3])
{
    return cairn_block_solver_solution(context, pose, x);
}

static cairn_status builtin_invert(void *context)
{
    return cairn_block_solver_invert(context);
}

static cairn_status builtin_covariance(const void *context, int32_t first, int32_t second,
                                       cairn_real block[9])
{
    return cairn_block_solver_covariance(context, first, second, block);
}

static cairn_status builtin_step(void *context, cairn_budget *budget)
{
    return cairn_block_solver_step(context, budget);
}

static cairn_block_solver_result builtin_read(const void *context)
{
    return cairn_block_solver_read(context);
}

cairn_pose_graph_solver cairn_pose_graph_solver_of(cairn_block_solver *solver)
{
    cairn_pose_graph_solver face = {solver,
                                    builtin_begin,
                                    builtin_add_link,
                                    builtin_analyze,
                                    builtin_clear,
                                    builtin_add_pose_block,
                                    builtin_add_link_block,
                                    builtin_factor,
                                    builtin_solve,
                                    builtin_solution,
                                    builtin_invert,
                                    builtin_covariance,
                                    builtin_step,
                                    builtin_read};
    return face;
}

/* ---- Creation ---- */

/* The object, its arrays, and the built-in solver unless the caller has one; NULL from a counting
 * pool. */
static cairn_pose_graph *build(cairn_pool *pool, const cairn_pose_graph_params *params,
                               const cairn_pose_graph_solver *solver)
{
    size_t poses = (size_t)params->max_poses;
    cairn_block_solver_params builtin = {
        .max_poses = params->max_poses,
        .max_links = params->max_links,
        .max_fill = params->max_fill,
    };
    cairn_pose_graph *graph = cairn_object_take(pool, sizeof *graph);

    CAIRN_TAKE(graph, pool, poses, poses);
    CAIRN_TAKE(graph, pool, trial, poses);
    CAIRN_TAKE(graph, pool, fixed, poses);
    CAIRN_TAKE(graph, pool, root, poses);
    CAIRN_TAKE(graph, pool, system.diagonal, poses);
    CAIRN_TAKE(graph, pool, system.right, poses);
    CAIRN_TAKE(graph, pool, newton.direction, poses);
    CAIRN_TAKE(graph, pool, system.heading, poses);
    CAIRN_TAKE(graph, pool, links, params->max_links);
    if (solver == NULL)
        CAIRN_TAKE_OBJECT(graph, pool, builtin_solver, block_solver, &builtin);
    if (graph != NULL) {
        graph->params = *params;
        graph->state.pose = -1;
        graph->solver =
            solver != NULL ? *solver : cairn_pose_graph_solver_of(graph->builtin_solver);
    }
    return graph;
}

size_t cairn_pose_graph_memory(const cairn_pose_graph_params *params,
                               const cairn_pose_graph_solver *solver)
{
    cairn_pool counting;

    if (cairn_pose_graph_check(params, NULL) != CAIRN_OK)
        return 0;
    cairn_pool_init_counting(&counting);
    (void)build(&counting, params, solver);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_pose_graph_create(cairn_pose_graph **graph, cairn_pool *pool,
                                     const cairn_pose_graph_params *params,
                                     const cairn_pose_graph_solver *solver)
{
    cairn_status status = cairn_object_admit(graph, pool, cairn_pose_graph_memory(params, solver));

    if (status == CAIRN_OK)
        *graph = build(pool, params, solver);
    return status;
}

cairn_status cairn_pose_graph_extend(cairn_pose_graph *graph, cairn_pool *pool, int32_t max_fill)
{
    cairn_status status;

    if (graph == NULL || !cairn_pose_graph_is_idle(graph) || !graph->fill_exceeded)
        return CAIRN_BAD_ARGUMENT;
    status = cairn_block_solver_extend(graph->builtin_solver, pool, max_fill);
    if (status != CAIRN_OK)
        return status;
    graph->fill_exceeded = 0;
    graph->is_solving = 1;
    return CAIRN_OK;
}

/* ---- The graph ---- */

static int may_change(const cairn_pose_graph *graph)
{
    return graph != NULL && cairn_pose_graph_is_idle(graph);
}

static void invalidate_solution(cairn_pose_graph *graph)
{
    graph->fill_exceeded = 0;
    graph->is_solution = 0;
    graph->has_marginals = 0;
}

void cairn_pose_graph_clear(cairn_pose_graph *graph)
{
    memset(&graph->state, 0, sizeof graph->state);
    graph->state.pose = -1;
    graph->is_solving = graph->is_inverting = 0;
    graph->resume = graph->part_resume = graph->system.resume = graph->pass_resume = 0;
    graph->units_charged = 0;
    graph->fixed_count = 0;
    graph->analyzed = 0;
    invalidate_solution(graph);
}

cairn_status cairn_pose_graph_add_pose(cairn_pose_graph *graph, cairn_pose map_pose)
{
    int32_t index;

    if (!may_change(graph))
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pose_is_finite(map_pose))
        return CAIRN_NOT_FINITE;
    index = graph->state.poses;
    if (index == graph->params.max_poses)
        return CAIRN_FULL;
    map_pose.theta = cairn_wrap_angle(map_pose.theta);
    graph->poses[index] = map_pose;
    graph->fixed[index] = 0;
    graph->state.poses++;
    graph->analyzed = 0;
    invalidate_solution(graph);
    return CAIRN_OK;
}

static int has_pose(const cairn_pose_graph *graph, int32_t pose)
{
    return pose >= 0 && pose < graph->state.poses;
}

static int has_link(const cairn_pose_graph *graph, int32_t link)
{
    return link >= 0 && link < graph->state.links;
}

cairn_status cairn_pose_graph_set_pose(cairn_pose_graph *graph, int32_t pose, cairn_pose map_pose)
{
    if (!may_change(graph) || !has_pose(graph, pose))
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pose_is_finite(map_pose))
        return CAIRN_NOT_FINITE;
    map_pose.theta = cairn_wrap_angle(map_pose.theta);
    graph->poses[pose] = map_pose;
    invalidate_solution(graph);
    return CAIRN_OK;
}

cairn_status cairn_pose_graph_fix(cairn_pose_graph *graph, int32_t pose, int32_t fixed)
{
    if (!may_change(graph) || !has_pose(graph, pose))
        return CAIRN_BAD_ARGUMENT;
    graph->fixed_count += (fixed != 0) - graph->fixed[pose];
    graph->fixed[pose] = fixed != 0;
    invalidate_solution(graph);
    return CAIRN_OK;
}

/* Validates a link's poses and measurement. */
static cairn_status check_link(const cairn_pose_graph *graph, int32_t first, int32_t second,
                               cairn_pose first_second, cairn_sym3 information)
{
    cairn_sym3 inverse;

    if (!may_change(graph) || !has_pose(graph, first) || !has_pose(graph, second) ||
        first == second)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pose_is_finite(first_second) || !cairn_is_finite(information.xx) ||
        !cairn_is_finite(information.xy) || !cairn_is_finite(information.xz) ||
        !cairn_is_finite(information.yy) || !cairn_is_finite(information.yz) ||
        !cairn_is_finite(information.zz))
        return CAIRN_NOT_FINITE;
    return cairn_sym3_inverse(information, &inverse) ? CAIRN_OK : CAIRN_BAD_ARGUMENT;
}

/* Writes a link; its poses may have changed, so that the solver's structure is invalid. */
static void write_link(cairn_pose_graph *graph, int32_t index, int32_t first, int32_t second,
                       cairn_pose first_second, cairn_sym3 information)
{
    struct pose_graph_link *link = &graph->links[index];

    link->first = first;
    link->second = second;
    link->measured = first_second;
    link->information = cairn_sym3_rotate_by(information, first_second.theta);
    link->chi2 = 0;
    link->weight = 1;
    link->is_excluded = 0;
    graph->analyzed = 0;
    invalidate_solution(graph);
}

cairn_status cairn_pose_graph_add_link(cairn_pose_graph *graph, int32_t first, int32_t second,
                                       cairn_pose first_second, cairn_sym3 information)
{
    cairn_status status = check_link(graph, first, second, first_second, information);

    if (status != CAIRN_OK)
        return status;
    if (graph->state.links == graph->params.max_links)
        return CAIRN_FULL;
    write_link(graph, graph->state.links++, first, second, first_second, information);
    return CAIRN_OK;
}

cairn_status cairn_pose_graph_set_link(cairn_pose_graph *graph, int32_t link, int32_t first,
                                       int32_t second, cairn_pose first_second,
                                       cairn_sym3 information)
{
    cairn_status status = check_link(graph, first, second, first_second, information);

    if (status != CAIRN_OK)
        return status;
    if (!has_link(graph, link))
        return CAIRN_BAD_ARGUMENT;
    write_link(graph, link, first, second, first_second, information);
    return CAIRN_OK;
}

cairn_status cairn_pose_graph_remove_pose(cairn_pose_graph *graph, int32_t pose)
{
    int32_t kept = 0;

    if (!may_change(graph) || !has_pose(graph, pose))
        return CAIRN_BAD_ARGUMENT;
    graph->fixed_count -= graph->fixed[pose];
    graph->state.poses--;
    for (int32_t i = pose; i < graph->state.poses; i++) {
        graph->poses[i] = graph->poses[i + 1];
        graph->fixed[i] = graph->fixed[i + 1];
    }
    for (int32_t i = 0; i < graph->state.links; i++) {
        struct pose_graph_link link = graph->links[i];

        if (link.first == pose || link.second == pose)
            continue;
        link.first -= link.first > pose;
        link.second -= link.second > pose;
        graph->links[kept++] = link;
    }
    graph->state.links = kept;
    graph->analyzed = 0;
    invalidate_solution(graph);
    return CAIRN_OK;
}

cairn_status cairn_pose_graph_exclude_link(cairn_pose_graph *graph, int32_t link, int32_t excluded)
{
    if (!may_change(graph) || !has_link(graph, link))
        return CAIRN_BAD_ARGUMENT;
    graph->links[link].is_excluded = excluded != 0;
    invalidate_solution(graph);
    return CAIRN_OK;
}

cairn_status cairn_pose_graph_set_kernel(cairn_pose_graph *graph, cairn_pose_graph_kernel kernel,
                                         cairn_real width)
{
    cairn_pose_graph_params params;

    if (!may_change(graph))
        return CAIRN_BAD_ARGUMENT;
    params = graph->params;
    params.kernel = kernel;
    params.kernel_width = width;
    if (cairn_pose_graph_check(&params, NULL) != CAIRN_OK)
        return CAIRN_BAD_ARGUMENT;
    graph->params = params;
    invalidate_solution(graph);
    return CAIRN_OK;
}

/* ---- Results ---- */

cairn_pose_graph_state cairn_pose_graph_read(const cairn_pose_graph *graph)
{
    return graph->state;
}

cairn_pose cairn_pose_graph_pose(const cairn_pose_graph *graph, int32_t pose)
{
    return has_pose(graph, pose) ? graph->poses[pose] : cairn_pose_identity();
}

cairn_pose_graph_link cairn_pose_graph_link_of(const cairn_pose_graph *graph, int32_t link)
{
    cairn_pose_graph_link out = {.first = -1, .second = -1};
    const struct pose_graph_link *l;

    if (!has_link(graph, link))
        return out;
    l = &graph->links[link];
    out.first = l->first;
    out.second = l->second;
    out.chi2 = l->chi2;
    out.weight = l->weight;
    out.is_outlier = l->chi2 > graph->params.max_chi2;
    out.is_excluded = l->is_excluded;
    return out;
}

cairn_pose cairn_pose_graph_measurement(const cairn_pose_graph *graph, int32_t link,
                                        cairn_sym3 *information)
{
    const cairn_sym3 none = {0, 0, 0, 0, 0, 0};
    const struct pose_graph_link *l;

    *information = none;
    if (!has_link(graph, link))
        return cairn_pose_identity();
    l = &graph->links[link];
    *information = cairn_sym3_rotate_by(l->information, -l->measured.theta);
    return l->measured;
}

cairn_status cairn_pose_graph_covariance(const cairn_pose_graph *graph, int32_t first,
                                         int32_t second, cairn_real block[9])
{
    if (graph == NULL || block == NULL || !has_pose(graph, first) || !has_pose(graph, second))
        return CAIRN_BAD_ARGUMENT;
    if (!graph->has_marginals)
        return CAIRN_EMPTY;
    if (cairn_pose_graph_is_fixed(graph, first) || cairn_pose_graph_is_fixed(graph, second)) {
        memset(block, 0, 9 * sizeof *block);
        return CAIRN_OK;
    }
    return graph->solver.covariance(graph->solver.context, first, second, block);
}
