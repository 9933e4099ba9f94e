/* Solving graphs from files: least squares, and the links that it cannot explain found by a robust
 * kernel.
 *
 * Source: the test of the whole graph is that of chi2 with its degrees of freedom; the kernel is
 * that of Geman and McClure, which from the poses of the file lets links that disagree with
 * their neighbourhood go. */
#include "src/core/build.h"

#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#include "cairn/pose_graph_file.h"
#include "cairn/sparse_solver.h"

/* In standard deviations of chi2: so far beyond its mean it is not by chance. */
static const double SURPRISE = 6;

struct solving {
    const cairn_pose_graph_file *file;
    cairn_pose_graph_solution *out;
    cairn_pose_graph *graph;
    cairn_sparse_solver *sparse;
    void *memory, *fill_memory;
};

/* Much memory begins where a large page does and is asked for in such pages: of 100,000 poses a
 * tenth of the time went into pages that were touched for the first time, 4 KiB each. To be
 * freed. */
static void *take_memory(size_t bytes)
{
#ifdef MADV_HUGEPAGE
    const size_t page = (size_t)1 << 21;

    if (bytes >= 2 * page && bytes <= SIZE_MAX - page) {
        size_t whole = (bytes + page - 1) / page * page;
        void *memory = aligned_alloc(page, whole);

        if (memory != NULL)
            (void)madvise(memory, whole, MADV_HUGEPAGE); /* small ones do as well */
        return memory;
    }
#endif
    return malloc(bytes);
}

static cairn_status new_pool(cairn_pool *pool, void **memory, size_t bytes)
{
    *memory = take_memory(bytes + CAIRN_ALIGN);
    return *memory == NULL ? CAIRN_NO_MEMORY : cairn_pool_init(pool, *memory, bytes + CAIRN_ALIGN);
}

static cairn_status make_graph(struct solving *s)
{
    cairn_pose_graph_params params = cairn_pose_graph_default();
    cairn_pose_solver face, *own = NULL;
    cairn_status status;
    cairn_pool pool;

    params.max_poses = s->file->vertex_count;
    params.max_links = s->file->edge_count;
    params.max_fill = 0; /* see extend() */
    if (s->out->solver == CAIRN_POSE_GRAPH_SPARSE) {
        status = cairn_sparse_solver_open(&s->sparse);
        if (status != CAIRN_OK)
            return status;
        face = cairn_sparse_solver_face(s->sparse);
        own = &face;
    }
    s->out->pool_bytes = cairn_pose_graph_memory(&params, own);
    if (s->out->pool_bytes == 0)
        return CAIRN_NO_MEMORY;
    status = new_pool(&pool, &s->memory, s->out->pool_bytes);
    if (status == CAIRN_OK)
        status = cairn_pose_graph_create(&s->graph, &pool, &params, own);
    return status;
}

static cairn_status fill_graph(struct solving *s)
{
    cairn_status status = CAIRN_OK;

    for (int32_t v = 0; v < s->file->vertex_count && status == CAIRN_OK; v++) {
        status = cairn_pose_graph_add_pose(s->graph, s->file->vertex[v].pose);
        if (status == CAIRN_OK)
            status = cairn_pose_graph_fix(s->graph, v, s->file->vertex[v].fixed);
    }
    for (int32_t e = 0; e < s->file->edge_count && status == CAIRN_OK; e++) {
        const cairn_pose_graph_edge *edge = &s->file->edge[e];

        status = cairn_pose_graph_add_link(s->graph, edge->first, edge->second, edge->first_second,
                                           edge->information);
    }
    return status;
}

/* Takes room for the factor, now that it is known how many blocks it has. */
static cairn_status extend(struct solving *s)
{
    int32_t fill = cairn_pose_graph_read(s->graph).fill;
    size_t bytes = cairn_block_solver_extend_memory(fill);
    cairn_status status;
    cairn_pool pool;

    if (bytes == 0)
        return CAIRN_NO_MEMORY;
    status = new_pool(&pool, &s->fill_memory, bytes);
    s->out->pool_bytes += bytes;
    return status == CAIRN_OK ? cairn_pose_graph_extend(s->graph, &pool, fill) : status;
}

static cairn_status solve_once(struct solving *s, cairn_pose_graph_kernel kernel)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_status status =
        cairn_pose_graph_set_kernel(s->graph, kernel, cairn_pose_graph_default().width);

    if (status == CAIRN_OK)
        status = cairn_pose_graph_solve(s->graph);
    while (status == CAIRN_OK || status == CAIRN_MORE) {
        status = cairn_pose_graph_step(s->graph, &budget);
        if (status == CAIRN_OK)
            break;
        if (status == CAIRN_FULL && s->fill_memory == NULL)
            status = extend(s);
        budget.left = CAIRN_UNBOUNDED;
    }
    s->out->state = cairn_pose_graph_read(s->graph);
    return status;
}

static int is_explained(const struct solving *s)
{
    double freedom = 3 * ((double)s->file->edge_count - (double)s->file->vertex_count);

    freedom = freedom > 1 ? freedom : 1;
    return (double)s->out->state.chi2 <= freedom + SURPRISE * sqrt(2 * freedom);
}

static cairn_status from_the_files_poses(struct solving *s)
{
    cairn_status status = CAIRN_OK;

    for (int32_t v = 0; v < s->file->vertex_count && status == CAIRN_OK; v++)
        status = cairn_pose_graph_set_pose(s->graph, v, s->file->vertex[v].pose);
    return status;
}

static cairn_status drop_outliers(struct solving *s)
{
    cairn_status status = CAIRN_OK;

    for (int32_t e = 0; e < s->file->edge_count && status == CAIRN_OK; e++) {
        int32_t outlier = cairn_pose_graph_link_of(s->graph, e).outlier;

        s->out->outlier[e] = (uint8_t)outlier;
        s->out->outliers += outlier;
        status = cairn_pose_graph_drop_link(s->graph, e, outlier);
    }
    return status;
}

static void keep_poses(struct solving *s)
{
    for (int32_t v = 0; v < s->file->vertex_count; v++)
        s->out->pose[v] = cairn_pose_graph_pose(s->graph, v);
    s->out->chi2_all = 0;
    for (int32_t e = 0; e < s->file->edge_count; e++)
        s->out->chi2_all += (double)cairn_pose_graph_link_of(s->graph, e).chi2;
}

/* The links that the kernel drops leave a graph in one piece, because a link that joins two
 * pieces alone can always be met; should they not, the poses of the kernel stand. */
static cairn_status solve_robustly(struct solving *s)
{
    cairn_status status = from_the_files_poses(s);

    s->out->robust = 1;
    if (status == CAIRN_OK)
        status = solve_once(s, CAIRN_POSE_GRAPH_GEMAN_MCCLURE);
    if (status == CAIRN_OK)
        status = drop_outliers(s);
    if (status != CAIRN_OK)
        return status;
    keep_poses(s);
    status = solve_once(s, CAIRN_POSE_GRAPH_SQUARE);
    if (status == CAIRN_OK && s->out->state.verdict != CAIRN_POSE_GRAPH_SPLIT)
        keep_poses(s);
    return status;
}

static cairn_status solve(struct solving *s)
{
    cairn_status status = make_graph(s);

    if (status == CAIRN_OK)
        status = fill_graph(s);
    if (status == CAIRN_OK)
        status = solve_once(s, CAIRN_POSE_GRAPH_SQUARE);
    if (status != CAIRN_OK)
        return status;
    s->out->chi2_initial = (double)s->out->state.chi2_initial;
    keep_poses(s);
    if (!s->out->keep_all && !is_explained(s))
        status = solve_robustly(s);
    if (s->sparse != NULL)
        s->out->pool_bytes += cairn_sparse_solver_memory(s->sparse);
    return status;
}

cairn_status cairn_pose_graph_file_solve(const cairn_pose_graph_file *file,
                                         cairn_pose_graph_solution *solution)
{
    struct solving s = {file, solution, NULL, NULL, NULL, NULL};
    cairn_pose_graph_solution fresh;
    cairn_status status = CAIRN_NO_MEMORY;

    memset(&fresh, 0, sizeof fresh);
    fresh.solver = solution->solver;
    fresh.keep_all = solution->keep_all;
    *solution = fresh;
    solution->pose = malloc((size_t)file->vertex_count * sizeof *solution->pose);
    solution->outlier = calloc((size_t)file->edge_count, 1);
    if (solution->pose != NULL && solution->outlier != NULL)
        status = solve(&s);
    cairn_sparse_solver_close(s.sparse);
    free(s.memory);
    free(s.fill_memory);
    if (status != CAIRN_OK)
        cairn_pose_graph_solution_free(solution);
    return status;
}

void cairn_pose_graph_solution_free(cairn_pose_graph_solution *solution)
{
    free(solution->pose);
    free(solution->outlier);
    solution->pose = NULL;
    solution->outlier = NULL;
}
