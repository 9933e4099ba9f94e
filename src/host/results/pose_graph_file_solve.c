/* Optimization of pose graphs from files: memory and solver for pose_graph_robust. */
#include "src/base/build.h"

#include "cairn/pose_graph_file.h"
#include "cairn/pose_graph_robust.h"
#include "cairn/sparse_solver.h"
#include "src/host/base/interruption.h"
#include "src/host/base/posix.h"

/* State of one optimization. */
struct graph_solver {
    const cairn_pose_graph_file *file;
    cairn_pose_graph_file_solution *solution;
    cairn_pose_graph *graph;
    cairn_pose_graph_robust *robust;
    cairn_sparse_solver *sparse;
    void *memory, *fill_memory, *robust_memory;
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

/* Creates the robust optimizer. */
static cairn_status make_robust(struct graph_solver *solver)
{
    cairn_pose_graph_robust_params params = cairn_pose_graph_robust_default();
    cairn_status status;
    cairn_pool pool;

    params.max_poses = solver->file->vertex_count;
    if (solver->solution->keep_all)
        params.max_deviations = CAIRN_REAL_MAX;
    status = new_pool(&pool, &solver->robust_memory, cairn_pose_graph_robust_memory(&params));
    if (status == CAIRN_OK)
        status = cairn_pose_graph_robust_create(&solver->robust, &pool, &params);
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

/* Runs the optimization to its end. CAIRN_MORE: interrupted. */
static cairn_status optimize(struct graph_solver *solver)
{
    cairn_status status = cairn_pose_graph_robust_begin(solver->robust, solver->graph);
    cairn_budget budget;

    while (status == CAIRN_OK || status == CAIRN_MORE) {
        budget.left = CAIRN_INTERRUPTION_UNITS;
        status = cairn_pose_graph_robust_step(solver->robust, &budget);
        if (status == CAIRN_OK || (status == CAIRN_MORE && cairn_interruption_is_requested()))
            break;
        if (status == CAIRN_FULL && solver->fill_memory == NULL)
            status = extend_factor(solver);
    }
    return status;
}

/* Copies poses, outliers and figures into the solution. */
static void store_solution(struct graph_solver *solver)
{
    cairn_pose_graph_file_solution *solution = solver->solution;
    cairn_pose_graph_robust_result result = cairn_pose_graph_robust_read(solver->robust);

    solution->robust = result.is_robust;
    solution->outliers = result.outliers;
    solution->state = cairn_pose_graph_read(solver->graph);
    solution->chi2_initial = (double)result.chi2_initial;
    for (int32_t v = 0; v < solver->file->vertex_count; v++)
        solution->pose[v] = cairn_pose_graph_pose(solver->graph, v);
    solution->chi2_all = 0;
    for (int32_t e = 0; e < solver->file->edge_count; e++) {
        cairn_pose_graph_link link = cairn_pose_graph_link_of(solver->graph, e);

        solution->outlier[e] = (uint8_t)link.is_excluded;
        solution->chi2_all += (double)link.chi2;
    }
    if (solver->sparse != NULL)
        solution->pool_bytes += cairn_sparse_solver_memory(solver->sparse);
}

/* Creates, fills and optimizes the graph. */
static cairn_status solve(struct graph_solver *solver)
{
    cairn_status status = make_graph(solver);

    if (status == CAIRN_OK)
        status = make_robust(solver);
    if (status == CAIRN_OK)
        status = fill_graph(solver);
    if (status == CAIRN_OK)
        status = optimize(solver);
    if (status == CAIRN_OK)
        store_solution(solver);
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
    free(solver.robust_memory);
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
