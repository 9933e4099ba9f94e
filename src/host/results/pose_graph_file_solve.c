/* Optimization of pose graphs from files, with outlier rejection.
 *
 * Source: chi-squared test of the weighted residuals; Geman and McClure, Statistical methods for
 * tomographic image reconstruction, 1987 (the robust kernel). */
#include "src/base/build.h"

#include "cairn/pose_graph_file.h"
#include "cairn/sparse_solver.h"
#include "src/host/base/interruption.h"
#include "src/host/base/posix.h"

/* Threshold of the chi-squared test, in standard deviations above the mean. */
static const double CHI2_MAX_DEVIATIONS = 6;

/* State of one optimization. */
struct graph_solver {
    const cairn_pose_graph_file *file;
    cairn_pose_graph_file_solution *solution;
    cairn_pose_graph *graph;
    cairn_sparse_solver *sparse;
    void *memory, *fill_memory;
};

/* Allocates memory, large blocks as transparent huge pages: for 100,000 poses a tenth of the time
 * was first-touch page faults of 4 KiB pages. To be freed by free(). */
static void *allocate_memory(size_t bytes)
{
#ifdef MADV_HUGEPAGE
    const size_t page = (size_t)1 << 21;

    if (bytes >= 2 * page && bytes <= SIZE_MAX - page) {
        size_t whole = (bytes + page - 1) / page * page;
        void *memory = aligned_alloc(page, whole);

        if (memory != NULL)
            (void)madvise(memory, whole, MADV_HUGEPAGE); /* a failure leaves small pages */
        return memory;
    }
#endif
    return malloc(bytes);
}

static cairn_status new_pool(cairn_pool *pool, void **memory, size_t bytes)
{
    *memory = allocate_memory(bytes + CAIRN_ALIGN);
    return *memory == NULL ? CAIRN_NO_MEMORY : cairn_pool_init(pool, *memory, bytes + CAIRN_ALIGN);
}

/* Creates the pose graph and its solver. */
static cairn_status make_graph(struct graph_solver *solver)
{
    cairn_pose_graph_params params = cairn_pose_graph_default();
    cairn_pose_graph_solver interface, *external = NULL;
    cairn_status status;
    cairn_pool pool;

    params.max_poses = solver->file->vertex_count;
    params.max_links = solver->file->edge_count;
    params.max_fill = 0; /* the factor's memory is added by extend_factor() */
    if (solver->solution->solver == CAIRN_POSE_GRAPH_FILE_SPARSE) {
        status = cairn_sparse_solver_open(&solver->sparse);
        if (status != CAIRN_OK)
            return status;
        interface = cairn_sparse_solver_interface(solver->sparse);
        external = &interface;
    }
    solver->solution->pool_bytes = cairn_pose_graph_memory(&params, external);
    if (solver->solution->pool_bytes == 0)
        return CAIRN_NO_MEMORY;
    status = new_pool(&pool, &solver->memory, solver->solution->pool_bytes);
    if (status == CAIRN_OK)
        status = cairn_pose_graph_create(&solver->graph, &pool, &params, external);
    return status;
}

/* Adds all vertices and edges to the pose graph. */
static cairn_status fill_graph(struct graph_solver *solver)
{
    cairn_status status = CAIRN_OK;

    for (int32_t v = 0; v < solver->file->vertex_count && status == CAIRN_OK; v++) {
        status = cairn_pose_graph_add_pose(solver->graph, solver->file->vertex[v].pose);
        if (status == CAIRN_OK)
            status = cairn_pose_graph_fix(solver->graph, v, solver->file->vertex[v].fixed);
    }
    for (int32_t e = 0; e < solver->file->edge_count && status == CAIRN_OK; e++) {
        const cairn_pose_graph_file_edge *edge = &solver->file->edge[e];

        status = cairn_pose_graph_add_link(solver->graph, edge->first, edge->second,
                                           edge->first_second, edge->information);
    }
    return status;
}

/* Allocates memory for the factor after the symbolic analysis has counted its blocks. */
static cairn_status extend_factor(struct graph_solver *solver)
{
    int32_t fill = cairn_pose_graph_read(solver->graph).fill;
    size_t bytes = cairn_block_solver_extend_memory(fill);
    cairn_status status;
    cairn_pool pool;

    if (bytes == 0)
        return CAIRN_NO_MEMORY;
    status = new_pool(&pool, &solver->fill_memory, bytes);
    solver->solution->pool_bytes += bytes;
    return status == CAIRN_OK ? cairn_pose_graph_extend(solver->graph, &pool, fill) : status;
}

/* Runs one optimization to its end. */
static cairn_status solve_once(struct graph_solver *solver, cairn_pose_graph_kernel kernel)
{
    cairn_budget budget;
    cairn_status status =
        cairn_pose_graph_set_kernel(solver->graph, kernel, cairn_pose_graph_default().kernel_width);

    if (status == CAIRN_OK)
        status = cairn_pose_graph_solve(solver->graph);
    while (status == CAIRN_OK || status == CAIRN_MORE) {
        budget.left = CAIRN_INTERRUPTION_UNITS;
        status = cairn_pose_graph_step(solver->graph, &budget);
        if (status == CAIRN_OK || (status == CAIRN_MORE && cairn_interruption_is_requested()))
            break;
        if (status == CAIRN_FULL && solver->fill_memory == NULL)
            status = extend_factor(solver);
    }
    solver->solution->state = cairn_pose_graph_read(solver->graph);
    return status;
}

/* The chi-squared test: returns 1 when chi2 is plausible for its degrees of freedom. A chi2
 * variable has mean f and variance 2 f. */
static int passes_chi2_test(const struct graph_solver *solver)
{
    double freedom = 3 * ((double)solver->file->edge_count - (double)solver->file->vertex_count);

    freedom = freedom > 1 ? freedom : 1;
    return (double)solver->solution->state.chi2 <=
           freedom + CHI2_MAX_DEVIATIONS * sqrt(2 * freedom);
}

/* Resets the graph to the initial poses. */
static cairn_status reset_poses(struct graph_solver *solver)
{
    cairn_status status = CAIRN_OK;

    for (int32_t v = 0; v < solver->file->vertex_count && status == CAIRN_OK; v++)
        status = cairn_pose_graph_set_pose(solver->graph, v, solver->file->vertex[v].pose);
    return status;
}

/* Rejects the outliers of the robust kernel. */
static cairn_status drop_outliers(struct graph_solver *solver)
{
    cairn_status status = CAIRN_OK;

    for (int32_t e = 0; e < solver->file->edge_count && status == CAIRN_OK; e++) {
        int32_t outlier = cairn_pose_graph_link_of(solver->graph, e).is_outlier;

        solver->solution->outlier[e] = (uint8_t)outlier;
        solver->solution->outliers += outlier;
        status = cairn_pose_graph_exclude_link(solver->graph, e, outlier);
    }
    return status;
}

/* Copies the poses and the chi2 of all edges into the solution. */
static void store_poses(struct graph_solver *solver)
{
    for (int32_t v = 0; v < solver->file->vertex_count; v++)
        solver->solution->pose[v] = cairn_pose_graph_pose(solver->graph, v);
    solver->solution->chi2_all = 0;
    for (int32_t e = 0; e < solver->file->edge_count; e++)
        solver->solution->chi2_all += (double)cairn_pose_graph_link_of(solver->graph, e).chi2;
}

/* Robust estimation, then least squares of the inliers. Rejecting the kernel's outliers keeps the
 * graph connected, because a bridge (an edge that alone joins two components) can always be
 * satisfied. If the graph is split nevertheless, the poses of the robust kernel remain. */
static cairn_status solve_robustly(struct graph_solver *solver)
{
    cairn_status status = reset_poses(solver);

    solver->solution->robust = 1;
    if (status == CAIRN_OK)
        status = solve_once(solver, CAIRN_POSE_GRAPH_GEMAN_MCCLURE);
    if (status == CAIRN_OK)
        status = drop_outliers(solver);
    if (status != CAIRN_OK)
        return status;
    store_poses(solver);
    status = solve_once(solver, CAIRN_POSE_GRAPH_SQUARE);
    if (status == CAIRN_OK && solver->solution->state.verdict != CAIRN_POSE_GRAPH_DISCONNECTED)
        store_poses(solver);
    return status;
}

/* Optimizes the graph; the method is in the header. */
static cairn_status solve(struct graph_solver *solver)
{
    cairn_status status = make_graph(solver);

    if (status == CAIRN_OK)
        status = fill_graph(solver);
    if (status == CAIRN_OK)
        status = solve_once(solver, CAIRN_POSE_GRAPH_SQUARE);
    if (status != CAIRN_OK)
        return status;
    solver->solution->chi2_initial = (double)solver->solution->state.chi2_initial;
    store_poses(solver);
    if (!solver->solution->keep_all && !passes_chi2_test(solver))
        status = solve_robustly(solver);
    if (solver->sparse != NULL)
        solver->solution->pool_bytes += cairn_sparse_solver_memory(solver->sparse);
    return status;
}

cairn_status cairn_pose_graph_file_solve(const cairn_pose_graph_file *file,
                                         cairn_pose_graph_file_solution *solution)
{
    struct graph_solver solver = {.file = file, .solution = solution};
    cairn_pose_graph_file_solution fresh;
    cairn_status status = CAIRN_NO_MEMORY;

    memset(&fresh, 0, sizeof fresh);
    fresh.solver = solution->solver;
    fresh.keep_all = solution->keep_all;
    *solution = fresh;
    solution->pose = malloc((size_t)file->vertex_count * sizeof *solution->pose);
    solution->outlier = calloc((size_t)file->edge_count, 1);
    if (solution->pose != NULL && solution->outlier != NULL)
        status = solve(&solver);
    cairn_sparse_solver_close(solver.sparse);
    free(solver.memory);
    free(solver.fill_memory);
    if (status != CAIRN_OK)
        cairn_pose_graph_file_solution_free(solution);
    return status;
}

void cairn_pose_graph_file_solution_free(cairn_pose_graph_file_solution *solution)
{
    free(solution->pose);
    free(solution->outlier);
    solution->pose = NULL;
    solution->outlier = NULL;
}
