/* Sparse Cholesky solver: SuiteSparse behind the solver interface of pose graphs.
 *
 * Method
 * 1. AMD computes a fill-reducing ordering of the poses, three scalars each.
 * 2. The information matrix H of the normal equations is stored by compressed columns of scalars,
 *    both triangles. Repeated links share their entries.
 * 3. LDL factorizes H = L D L^T in that order, reading the upper triangle.
 * 4. A solution is forward substitution, division by D and back substitution. A covariance block is
 *    three columns of the inverse of H.
 *
 * Source: Davis, Algorithm 849: a concise sparse Cholesky factorization package, 2005; Amestoy,
 * Davis and Duff, Algorithm 837: AMD, 2004. */
#include "src/base/build.h"

#include "cairn/sparse_solver.h"
#include "src/host/base/posix.h"

/* Functions of the libraries, as declared there. */
struct libraries {
    int (*amd_order)(int n, const int *ap, const int *ai, int *p, double *control, double *info);
    void (*ldl_symbolic)(int n, int *ap, int *ai, int *lp, int *parent, int *lnz, int *flag, int *p,
                         int *pinv);
    int (*ldl_numeric)(int n, int *ap, int *ai, double *ax, int *lp, int *parent, int *lnz, int *li,
                       double *lx, double *d, double *y, int *pattern, int *flag, int *p,
                       int *pinv);
    void (*ldl_lsolve)(int n, double *x, int *lp, int *li, double *lx);
    void (*ldl_dsolve)(int n, double *x, double *d);
    void (*ldl_ltsolve)(int n, double *x, int *lp, int *li, double *lx);
};

/* The phase that the next step runs. */
typedef int32_t sparse_solver_phase;
enum { PHASE_NONE, PHASE_ANALYZE, PHASE_FACTOR, PHASE_SOLVE, PHASE_INVERT };

struct link {
    int32_t pose[2];
    /* [0]: index of the block of pose[0]'s rows in the columns of pose[1]; [1]: the transpose */
    int32_t block[2];
};

/* One off-diagonal block of a link: the rows of one pose in the columns of the other. side: 0 or
 * 1, index in link.block. */
struct half {
    int32_t column, row, link, side;
};

struct cairn_sparse_solver {
    struct libraries call;
    cairn_block_solver_result result;
    /* pending phase */
    sparse_solver_phase phase;
    /* 1: no more links can be added; 1: x holds a solution */
    int32_t structure_closed, solved;
    struct link *links;
    int32_t link_capacity;
    int unknowns; /* 3 a pose */
    /* H by compressed columns: for each pose the blocks of its neighbours, then its own */
    int *column, *row;
    double *value;
    /* [unknowns] permutation and its inverse */
    int *order, *inverse_order;
    /* L by compressed columns: column starts, elimination tree, entries of each column; then
     * workspace */
    int *l_start, *parent, *l_count, *flag, *pattern;
    int *l_row;
    /* entries of L, diagonal of D, workspace, right side and solution in elimination order */
    double *l_value, *d, *y, *x;
    size_t bytes;          /* of the arrays */
    int32_t out_of_memory; /* 1: an allocation has failed */
};

/* ---- Libraries ---- */

static void *open_library(const char *const *names)
{
    void *library = NULL;

    for (; *names != NULL && library == NULL; names++)
        library = dlopen(*names, RTLD_NOW | RTLD_LOCAL);
    return library;
}

/* dlsym returns an object pointer. POSIX guarantees that it holds a function pointer. */
static int find_function(void *library, const char *name, void *function)
{
    void *found = library != NULL ? dlsym(library, name) : NULL;

    memcpy(function, &found, sizeof found);
    return found != NULL;
}

static int find_libraries(struct libraries *call)
{
    static const char *const amd_names[] = {"libamd.so.3", "libamd.so.2", "libamd.so", NULL};
    static const char *const ldl_names[] = {"libldl.so.3", "libldl.so.2", "libldl.so", NULL};
    void *amd = open_library(amd_names), *ldl = open_library(ldl_names);

    return find_function(amd, "amd_order", &call->amd_order) &&
           find_function(ldl, "ldl_symbolic", &call->ldl_symbolic) &&
           find_function(ldl, "ldl_numeric", &call->ldl_numeric) &&
           find_function(ldl, "ldl_lsolve", &call->ldl_lsolve) &&
           find_function(ldl, "ldl_dsolve", &call->ldl_dsolve) &&
           find_function(ldl, "ldl_ltsolve", &call->ldl_ltsolve);
}

cairn_status cairn_sparse_solver_open(cairn_sparse_solver **solver)
{
    cairn_sparse_solver *made = calloc(1, sizeof *made);

    *solver = NULL;
    if (made == NULL)
        return CAIRN_NO_MEMORY;
    if (!find_libraries(&made->call)) {
        free(made);
        return CAIRN_UNSUPPORTED;
    }
    made->structure_closed = 1;
    made->result.failed_pose = -1;
    *solver = made;
    return CAIRN_OK;
}

static void free_arrays(cairn_sparse_solver *solver)
{
    void *const arrays[] = {
        solver->column,  solver->row,     solver->value,   solver->order, solver->inverse_order,
        solver->l_start, solver->parent,  solver->l_count, solver->flag,  solver->pattern,
        solver->l_row,   solver->l_value, solver->d,       solver->y,     solver->x};

    for (size_t k = 0; k < sizeof arrays / sizeof *arrays; k++)
        free(arrays[k]);
    solver->column = solver->row = solver->order = solver->inverse_order = solver->l_start =
        solver->parent = solver->l_count = solver->flag = solver->pattern = solver->l_row = NULL;
    solver->value = solver->l_value = solver->d = solver->y = solver->x = NULL;
    solver->bytes = 0;
    solver->out_of_memory = 0;
}

void cairn_sparse_solver_close(cairn_sparse_solver *solver)
{
    if (solver == NULL)
        return;
    free_arrays(solver);
    free(solver->links);
    free(solver);
}

size_t cairn_sparse_solver_memory(const cairn_sparse_solver *solver)
{
    return sizeof *solver + (size_t)solver->link_capacity * sizeof *solver->links + solver->bytes;
}

/* Allocates a zeroed array with one entry more than `count`, for the end of the last column. */
static void *new_array(cairn_sparse_solver *solver, size_t count, size_t size)
{
    void *array = calloc(count + 1, size);

    solver->bytes += (count + 1) * size;
    if (array == NULL)
        solver->out_of_memory = 1;
    return array;
}

/* ---- Structure ---- */

static int is_in(const cairn_sparse_solver *solver, cairn_block_solver_state state)
{
    return solver->phase == PHASE_NONE && solver->result.state == state;
}

static int has_pose(const cairn_sparse_solver *solver, int32_t pose)
{
    return pose >= 0 && pose < solver->result.poses;
}

static cairn_status sparse_begin(void *context, int32_t poses)
{
    cairn_sparse_solver *solver = context;

    if (poses < 1 || poses > INT32_MAX / 16)
        return CAIRN_BAD_ARGUMENT;
    free_arrays(solver);
    memset(&solver->result, 0, sizeof solver->result);
    solver->result.poses = poses;
    solver->result.failed_pose = -1;
    solver->unknowns = 3 * poses;
    solver->phase = PHASE_NONE;
    solver->structure_closed = solver->solved = 0;
    return CAIRN_OK;
}

static cairn_status sparse_add_link(void *context, int32_t first, int32_t second)
{
    cairn_sparse_solver *solver = context;

    if (solver->structure_closed || !has_pose(solver, first) || !has_pose(solver, second) ||
        first == second)
        return CAIRN_BAD_ARGUMENT;
    if (solver->result.links == solver->link_capacity) {
        int32_t new_capacity = solver->link_capacity == 0 ? 1024 : 2 * solver->link_capacity;
        struct link *grown = realloc(solver->links, (size_t)new_capacity * sizeof *grown);

        if (grown == NULL)
            return CAIRN_NO_MEMORY;
        solver->links = grown;
        solver->link_capacity = new_capacity;
    }
    solver->links[solver->result.links].pose[0] = first;
    solver->links[solver->result.links++].pose[1] = second;
    return CAIRN_OK;
}

static cairn_status sparse_analyze(void *context)
{
    cairn_sparse_solver *solver = context;

    if (solver->structure_closed)
        return CAIRN_BAD_ARGUMENT;
    solver->structure_closed = 1;
    solver->phase = PHASE_ANALYZE;
    return CAIRN_OK;
}

static int compare_halves(const void *a, const void *b)
{
    const struct half *first = a, *second = b;

    if (first->column != second->column)
        return first->column - second->column;
    if (first->row != second->row)
        return first->row - second->row;
    return first->link - second->link;
}

/* Returns both blocks of all links, sorted by column, row and link, on the heap. */
static struct half *sorted_halves(const cairn_sparse_solver *solver)
{
    struct half *half = calloc(2 * (size_t)solver->result.links + 1, sizeof *half);

    for (int32_t k = 0; k < 2 * solver->result.links && half != NULL; k++) {
        const struct link *link = &solver->links[k / 2];

        half[k].side = k % 2;
        half[k].link = k / 2;
        half[k].column = link->pose[1 - k % 2];
        half[k].row = link->pose[k % 2];
    }
    if (half != NULL)
        qsort(half, 2 * (size_t)solver->result.links, sizeof *half, compare_halves);
    return half;
}

/* Fills the column structure of H, three columns for each pose, and keeps one half for each
 * distinct block. Returns the number of off-diagonal blocks. */
static int32_t fill_columns(cairn_sparse_solver *solver, struct half *half)
{
    int32_t entry = 0, kept = 0, next = 0;

    for (int32_t j = 0; j < solver->result.poses; j++) {
        int32_t begin = kept;

        for (; next < 2 * solver->result.links && half[next].column == j; next++) {
            if (kept == begin || half[kept - 1].row != half[next].row)
                half[kept++] = half[next];
            solver->links[half[next].link].block[half[next].side] = kept - 1 - begin;
        }
        for (int32_t c = 0; c < 3; c++) {
            solver->column[3 * j + c] = entry;
            for (int32_t k = 3 * begin; k < 3 * kept; k++)
                solver->row[entry++] = 3 * half[k / 3].row + k % 3;
            for (int32_t r = 0; r < 3; r++)
                solver->row[entry++] = 3 * j + r;
        }
    }
    solver->column[solver->unknowns] = entry;
    return kept;
}

/* Computes the fill-reducing ordering by poses, so that the three scalars of a pose stay
 * together. */
static cairn_status order_poses(cairn_sparse_solver *solver, const struct half *half,
                                int32_t blocks)
{
    int poses = solver->result.poses, *start = calloc((size_t)poses + 1, sizeof *start);
    int *list = calloc((size_t)blocks + 1, sizeof *list),
        *permutation = calloc((size_t)poses, sizeof *permutation);
    cairn_status status = CAIRN_NO_MEMORY;

    if (start != NULL && list != NULL && permutation != NULL) {
        for (int32_t k = 0; k < blocks; k++) {
            start[half[k].column + 1]++;
            list[k] = half[k].row;
        }
        for (int j = 0; j < poses; j++)
            start[j + 1] += start[j];
        status = solver->call.amd_order(poses, start, list, permutation, NULL, NULL) >= 0
                     ? CAIRN_OK
                     : CAIRN_NO_MEMORY;
        for (int k = 0; k < 3 * poses && status == CAIRN_OK; k++)
            solver->order[k] = 3 * permutation[k / 3] + k % 3;
    }
    free(start);
    free(list);
    free(permutation);
    return status;
}

/* Allocates the arrays of H and of the symbolic analysis. */
static cairn_status allocate(cairn_sparse_solver *solver)
{
    size_t n = (size_t)solver->unknowns, entries = 18 * (size_t)solver->result.links + 3 * n;

    solver->column = new_array(solver, n, sizeof(int));
    solver->row = new_array(solver, entries, sizeof(int));
    solver->value = new_array(solver, entries, sizeof(double));
    solver->order = new_array(solver, n, sizeof(int));
    solver->inverse_order = new_array(solver, n, sizeof(int));
    solver->l_start = new_array(solver, n, sizeof(int));
    solver->parent = new_array(solver, n, sizeof(int));
    solver->l_count = new_array(solver, n, sizeof(int));
    solver->flag = new_array(solver, n, sizeof(int));
    solver->pattern = new_array(solver, n, sizeof(int));
    solver->d = new_array(solver, n, sizeof(double));
    solver->y = new_array(solver, n, sizeof(double));
    solver->x = new_array(solver, n, sizeof(double));
    return solver->out_of_memory ? CAIRN_NO_MEMORY : CAIRN_OK;
}

/* Symbolic analysis: structure of H, ordering, structure of L. */
static cairn_status analyze(cairn_sparse_solver *solver)
{
    struct half *half = sorted_halves(solver);
    cairn_status status = half != NULL ? allocate(solver) : CAIRN_NO_MEMORY;

    if (status == CAIRN_OK)
        status = order_poses(solver, half, fill_columns(solver, half));
    free(half);
    if (status != CAIRN_OK)
        return status;
    solver->call.ldl_symbolic(solver->unknowns, solver->column, solver->row, solver->l_start,
                              solver->parent, solver->l_count, solver->flag, solver->order,
                              solver->inverse_order);
    solver->l_row = new_array(solver, (size_t)solver->l_start[solver->unknowns], sizeof(int));
    solver->l_value = new_array(solver, (size_t)solver->l_start[solver->unknowns], sizeof(double));
    /* of each pose, three scalars lie below the diagonal of its own block */
    solver->result.fill = (solver->l_start[solver->unknowns] - solver->unknowns) / 9;
    return solver->out_of_memory ? CAIRN_NO_MEMORY : CAIRN_OK;
}

/* ---- Values ---- */

static cairn_status sparse_clear(void *context)
{
    cairn_sparse_solver *solver = context;

    if (solver->phase != PHASE_NONE || solver->result.state == CAIRN_BLOCK_SOLVER_NEW)
        return CAIRN_BAD_ARGUMENT;
    memset(solver->value, 0, (size_t)solver->column[solver->unknowns] * sizeof *solver->value);
    solver->solved = 0;
    solver->result.failed_pose = -1;
    solver->result.state = CAIRN_BLOCK_SOLVER_ANALYZED;
    return CAIRN_OK;
}

/* Adds a diagonal block to H. */
static cairn_status sparse_add_pose_block(void *context, int32_t pose, cairn_sym3 block)
{
    const cairn_real full[9] = {block.xx, block.xy, block.xz, block.xy, block.yy,
                                block.yz, block.xz, block.yz, block.zz};
    cairn_sparse_solver *solver = context;

    if (!is_in(solver, CAIRN_BLOCK_SOLVER_ANALYZED) || !has_pose(solver, pose))
        return CAIRN_BAD_ARGUMENT;
    for (int k = 0; k < 9; k++)
        if (!cairn_is_finite(full[k]))
            return CAIRN_NOT_FINITE;
    for (int k = 0; k < 9; k++)
        solver->value[solver->column[3 * pose + k / 3 + 1] - 3 + k % 3] += (double)full[k];
    return CAIRN_OK;
}

/* Adds the off-diagonal block of a link and its transpose to H. */
static cairn_status sparse_add_link_block(void *context, int32_t link, const cairn_real block[9])
{
    cairn_sparse_solver *solver = context;
    const struct link *added;

    if (!is_in(solver, CAIRN_BLOCK_SOLVER_ANALYZED) || link < 0 || link >= solver->result.links)
        return CAIRN_BAD_ARGUMENT;
    for (int k = 0; k < 9; k++)
        if (!cairn_is_finite(block[k]))
            return CAIRN_NOT_FINITE;
    added = &solver->links[link];
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            solver->value[solver->column[3 * added->pose[1] + c] + 3 * added->block[0] + r] +=
                (double)block[3 * r + c];
            solver->value[solver->column[3 * added->pose[0] + r] + 3 * added->block[1] + c] +=
                (double)block[3 * r + c];
        }
    return CAIRN_OK;
}

/* ---- Phases ---- */

static cairn_status begin_phase(cairn_sparse_solver *solver, cairn_block_solver_state state,
                                sparse_solver_phase phase)
{
    if (!is_in(solver, state))
        return CAIRN_BAD_ARGUMENT;
    solver->phase = phase;
    return CAIRN_OK;
}

static cairn_status sparse_factor(void *context)
{
    return begin_phase(context, CAIRN_BLOCK_SOLVER_ANALYZED, PHASE_FACTOR);
}

static cairn_status sparse_invert(void *context)
{
    return begin_phase(context, CAIRN_BLOCK_SOLVER_FACTORED, PHASE_INVERT);
}

static cairn_status sparse_solve(void *context, const cairn_real *b)
{
    cairn_sparse_solver *solver = context;
    cairn_status status = begin_phase(solver, CAIRN_BLOCK_SOLVER_FACTORED, PHASE_SOLVE);

    for (int k = 0; k < solver->unknowns && status == CAIRN_OK; k++) {
        if (!cairn_is_finite(b[k])) {
            solver->phase = PHASE_NONE;
            return CAIRN_NOT_FINITE;
        }
        solver->x[solver->inverse_order[k]] = (double)b[k];
    }
    return status;
}

/* Factorizes H. A pivot must exceed 64 rounding errors of the diagonal element that it came from,
 * as in block_solver; otherwise H is not positive definite. */
static void factor(cairn_sparse_solver *solver)
{
    int factored = solver->call.ldl_numeric(
        solver->unknowns, solver->column, solver->row, solver->value, solver->l_start,
        solver->parent, solver->l_count, solver->l_row, solver->l_value, solver->d, solver->y,
        solver->pattern, solver->flag, solver->order, solver->inverse_order);
    int failed = factored < solver->unknowns ? factored : -1;

    for (int k = 0; k < factored && failed < 0; k++)
        if (!(solver->d[k] >
              64 * DBL_EPSILON *
                  solver->value[solver->column[solver->order[k] + 1] - 3 + solver->order[k] % 3]))
            failed = k;
    solver->result.failed_pose = failed >= 0 ? solver->order[failed] / 3 : -1;
    solver->result.state =
        failed >= 0 ? CAIRN_BLOCK_SOLVER_NOT_POSITIVE : CAIRN_BLOCK_SOLVER_FACTORED;
}

/* Solves L D L^T x = x by substitution; 0 when the solution exceeds the range of cairn_real. */
static int substitute(const cairn_sparse_solver *solver, double *x)
{
    solver->call.ldl_lsolve(solver->unknowns, x, solver->l_start, solver->l_row, solver->l_value);
    solver->call.ldl_dsolve(solver->unknowns, x, solver->d);
    solver->call.ldl_ltsolve(solver->unknowns, x, solver->l_start, solver->l_row, solver->l_value);
    for (int k = 0; k < solver->unknowns; k++)
        if (!(fabs(x[k]) <= (double)CAIRN_REAL_MAX))
            return 0;
    return 1;
}

/* Runs the pending phase in one step. */
static cairn_status sparse_step(void *context, cairn_budget *budget)
{
    cairn_sparse_solver *solver = context;
    sparse_solver_phase phase = solver->phase;
    cairn_status status = CAIRN_OK;

    if (phase == PHASE_NONE)
        return CAIRN_OK;
    if (budget->left <= 0)
        return CAIRN_MORE;
    budget->left--;
    solver->phase = PHASE_NONE;
    if (phase == PHASE_ANALYZE) {
        status = analyze(solver);
        if (status == CAIRN_OK)
            solver->result.state = CAIRN_BLOCK_SOLVER_ANALYZED;
    } else if (phase == PHASE_FACTOR) {
        factor(solver);
    } else if (phase == PHASE_SOLVE) {
        solver->solved = substitute(solver, solver->x);
        status = solver->solved ? CAIRN_OK : CAIRN_NOT_FINITE;
    } else {
        solver->result.state = CAIRN_BLOCK_SOLVER_INVERTED;
    }
    return status;
}

static cairn_status sparse_solution(const void *context, int32_t pose, cairn_real x[3])
{
    const cairn_sparse_solver *solver = context;

    if (!has_pose(solver, pose))
        return CAIRN_BAD_ARGUMENT;
    if (!solver->solved)
        return CAIRN_EMPTY;
    for (int k = 0; k < 3; k++)
        x[k] = (cairn_real)solver->x[solver->inverse_order[3 * pose + k]];
    return CAIRN_OK;
}

/* Returns a block of the inverse of H, column by column. */
static cairn_status sparse_covariance(const void *context, int32_t first, int32_t second,
                                      cairn_real block[9])
{
    const cairn_sparse_solver *solver = context;
    double *x;

    if (!has_pose(solver, first) || !has_pose(solver, second))
        return CAIRN_BAD_ARGUMENT;
    if (!is_in(solver, CAIRN_BLOCK_SOLVER_INVERTED))
        return CAIRN_EMPTY;
    x = malloc((size_t)solver->unknowns * sizeof *x);
    if (x == NULL)
        return CAIRN_NO_MEMORY;
    for (int c = 0; c < 3; c++) {
        memset(x, 0, (size_t)solver->unknowns * sizeof *x);
        x[solver->inverse_order[3 * second + c]] = 1;
        if (!substitute(solver, x)) {
            free(x);
            return CAIRN_NOT_FINITE;
        }
        for (int r = 0; r < 3; r++)
            block[3 * r + c] = (cairn_real)x[solver->inverse_order[3 * first + r]];
    }
    free(x);
    return CAIRN_OK;
}

static cairn_block_solver_result sparse_read(const void *context)
{
    const cairn_sparse_solver *solver = context;
    cairn_block_solver_result result = solver->result;

    result.running = solver->phase != PHASE_NONE;
    return result;
}

cairn_pose_graph_solver cairn_sparse_solver_interface(cairn_sparse_solver *solver)
{
    cairn_pose_graph_solver interface = {.context = solver,
                                         .begin = sparse_begin,
                                         .add_link = sparse_add_link,
                                         .analyze = sparse_analyze,
                                         .clear = sparse_clear,
                                         .add_pose_block = sparse_add_pose_block,
                                         .add_link_block = sparse_add_link_block,
                                         .factor = sparse_factor,
                                         .solve = sparse_solve,
                                         .solution = sparse_solution,
                                         .invert = sparse_invert,
                                         .covariance = sparse_covariance,
                                         .step = sparse_step,
                                         .read = sparse_read};
    return interface;
}
