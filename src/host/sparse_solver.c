/* SuiteSparse behind the interface of pose graphs.
 *
 * Method: the poses are ordered by AMD, three scalars each; H is kept as columns of scalars, both
 * halves, of which LDL reads what is above the diagonal in its order. Links that are repeated share
 * their entries.
 *
 * Source: Davis, Algorithm 849: a concise sparse Cholesky factorization package, 2005; Amestoy,
 * Davis and Duff, Algorithm 837: AMD, 2004. */
#include "src/core/build.h"

#include <dlfcn.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/sparse_solver.h"

/* The functions as their libraries declare them. */
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

enum { NOTHING, ANALYZE, FACTOR, SOLVE, INVERT };

struct link {
    int32_t pose[2];
    /* of the columns of pose[1], that of the rows of pose[0]; and the other way round */
    int32_t block[2];
};

/* One direction of a link: the rows of one pose in the columns of the other. */
struct half {
    int32_t column, row, link, side;
};

struct cairn_sparse_solver {
    struct libraries call;
    cairn_block_solver_result result;
    int32_t part, closed, solved;
    struct link *links;
    int32_t link_capacity;
    int n;             /* scalars */
    int *column, *row; /* H by columns: for each pose the blocks of its neighbours, then its own */
    double *value;
    int *order, *place; /* [n] */
    int *start, *parent, *count, *flag, *pattern;
    int *l_row;
    double *l_value, *d, *y, *x;
    size_t bytes;
    int32_t lacking; /* 1: an array could not be had */
};

/* ---- Libraries ---- */

static void *open_library(const char *const *names)
{
    void *library = NULL;

    for (; *names != NULL && library == NULL; names++)
        library = dlopen(*names, RTLD_NOW | RTLD_LOCAL);
    return library;
}

/* dlsym gives an object pointer, which is a function's here (POSIX). */
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
    made->closed = 1;
    made->result.pose = -1;
    *solver = made;
    return CAIRN_OK;
}

static void free_arrays(cairn_sparse_solver *s)
{
    void *const arrays[] = {s->column, s->row,     s->value, s->order, s->place,
                            s->start,  s->parent,  s->count, s->flag,  s->pattern,
                            s->l_row,  s->l_value, s->d,     s->y,     s->x};

    for (size_t k = 0; k < sizeof arrays / sizeof *arrays; k++)
        free(arrays[k]);
    s->column = s->row = s->order = s->place = s->start = s->parent = s->count = s->flag =
        s->pattern = s->l_row = NULL;
    s->value = s->l_value = s->d = s->y = s->x = NULL;
    s->bytes = 0;
    s->lacking = 0;
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

/* One entry more than asked for: that behind the last. */
static void *new_array(cairn_sparse_solver *s, size_t count, size_t size)
{
    void *array = calloc(count + 1, size);

    s->bytes += (count + 1) * size;
    if (array == NULL)
        s->lacking = 1;
    return array;
}

/* ---- Structure ---- */

static int is_in(const cairn_sparse_solver *s, cairn_block_solver_state state)
{
    return s->part == NOTHING && s->result.state == state;
}

static int has_pose(const cairn_sparse_solver *s, int32_t pose)
{
    return pose >= 0 && pose < s->result.poses;
}

static cairn_status sparse_begin(void *context, int32_t poses)
{
    cairn_sparse_solver *s = context;

    if (poses < 1 || poses > INT32_MAX / 16)
        return CAIRN_BAD_ARGUMENT;
    free_arrays(s);
    memset(&s->result, 0, sizeof s->result);
    s->result.poses = poses;
    s->result.pose = -1;
    s->n = 3 * poses;
    s->part = NOTHING;
    s->closed = s->solved = 0;
    return CAIRN_OK;
}

static cairn_status sparse_add_link(void *context, int32_t first, int32_t second)
{
    cairn_sparse_solver *s = context;

    if (s->closed || !has_pose(s, first) || !has_pose(s, second) || first == second)
        return CAIRN_BAD_ARGUMENT;
    if (s->result.links == s->link_capacity) {
        int32_t more = s->link_capacity == 0 ? 1024 : 2 * s->link_capacity;
        struct link *grown = realloc(s->links, (size_t)more * sizeof *grown);

        if (grown == NULL)
            return CAIRN_NO_MEMORY;
        s->links = grown;
        s->link_capacity = more;
    }
    s->links[s->result.links].pose[0] = first;
    s->links[s->result.links++].pose[1] = second;
    return CAIRN_OK;
}

static cairn_status sparse_analyze(void *context)
{
    cairn_sparse_solver *s = context;

    if (s->closed)
        return CAIRN_BAD_ARGUMENT;
    s->closed = 1;
    s->part = ANALYZE;
    return CAIRN_OK;
}

static int compare_halves(const void *a, const void *b)
{
    const struct half *x = a, *y = b;

    if (x->column != y->column)
        return x->column - y->column;
    if (x->row != y->row)
        return x->row - y->row;
    return x->link - y->link;
}

static struct half *sorted_halves(const cairn_sparse_solver *s)
{
    struct half *half = calloc(2 * (size_t)s->result.links + 1, sizeof *half);

    for (int32_t k = 0; k < 2 * s->result.links && half != NULL; k++) {
        const struct link *link = &s->links[k / 2];

        half[k].side = k % 2;
        half[k].link = k / 2;
        half[k].column = link->pose[1 - k % 2];
        half[k].row = link->pose[k % 2];
    }
    if (half != NULL)
        qsort(half, 2 * (size_t)s->result.links, sizeof *half, compare_halves);
    return half;
}

/* The three columns of each pose. `half` keeps one of each block. Returns the blocks beside the
 * diagonal. */
static int32_t fill_columns(cairn_sparse_solver *s, struct half *half)
{
    int32_t entry = 0, kept = 0, next = 0;

    for (int32_t j = 0; j < s->result.poses; j++) {
        int32_t begin = kept;

        for (; next < 2 * s->result.links && half[next].column == j; next++) {
            if (kept == begin || half[kept - 1].row != half[next].row)
                half[kept++] = half[next];
            s->links[half[next].link].block[half[next].side] = kept - 1 - begin;
        }
        for (int32_t c = 0; c < 3; c++) {
            s->column[3 * j + c] = entry;
            for (int32_t k = 3 * begin; k < 3 * kept; k++)
                s->row[entry++] = 3 * half[k / 3].row + k % 3;
            for (int32_t r = 0; r < 3; r++)
                s->row[entry++] = 3 * j + r;
        }
    }
    s->column[s->n] = entry;
    return kept;
}

/* Orders the poses, so that the scalars of one stay together. */
static cairn_status order_poses(cairn_sparse_solver *s, const struct half *half, int32_t blocks)
{
    int poses = s->result.poses, *start = calloc((size_t)poses + 1, sizeof *start);
    int *list = calloc((size_t)blocks + 1, sizeof *list), *p = calloc((size_t)poses, sizeof *p);
    cairn_status status = CAIRN_NO_MEMORY;

    if (start != NULL && list != NULL && p != NULL) {
        for (int32_t k = 0; k < blocks; k++) {
            start[half[k].column + 1]++;
            list[k] = half[k].row;
        }
        for (int j = 0; j < poses; j++)
            start[j + 1] += start[j];
        status =
            s->call.amd_order(poses, start, list, p, NULL, NULL) >= 0 ? CAIRN_OK : CAIRN_NO_MEMORY;
        for (int k = 0; k < 3 * poses && status == CAIRN_OK; k++)
            s->order[k] = 3 * p[k / 3] + k % 3;
    }
    free(start);
    free(list);
    free(p);
    return status;
}

static cairn_status allocate(cairn_sparse_solver *s)
{
    size_t n = (size_t)s->n, entries = 18 * (size_t)s->result.links + 3 * n;

    s->column = new_array(s, n, sizeof(int));
    s->row = new_array(s, entries, sizeof(int));
    s->value = new_array(s, entries, sizeof(double));
    s->order = new_array(s, n, sizeof(int));
    s->place = new_array(s, n, sizeof(int));
    s->start = new_array(s, n, sizeof(int));
    s->parent = new_array(s, n, sizeof(int));
    s->count = new_array(s, n, sizeof(int));
    s->flag = new_array(s, n, sizeof(int));
    s->pattern = new_array(s, n, sizeof(int));
    s->d = new_array(s, n, sizeof(double));
    s->y = new_array(s, n, sizeof(double));
    s->x = new_array(s, n, sizeof(double));
    return s->lacking ? CAIRN_NO_MEMORY : CAIRN_OK;
}

static cairn_status analyze(cairn_sparse_solver *s)
{
    struct half *half = sorted_halves(s);
    cairn_status status = half != NULL ? allocate(s) : CAIRN_NO_MEMORY;

    if (status == CAIRN_OK)
        status = order_poses(s, half, fill_columns(s, half));
    free(half);
    if (status != CAIRN_OK)
        return status;
    s->call.ldl_symbolic(s->n, s->column, s->row, s->start, s->parent, s->count, s->flag, s->order,
                         s->place);
    s->l_row = new_array(s, (size_t)s->start[s->n], sizeof(int));
    s->l_value = new_array(s, (size_t)s->start[s->n], sizeof(double));
    /* three scalars of each pose lie below its own diagonal */
    s->result.fill = (s->start[s->n] - s->n) / 9;
    return s->lacking ? CAIRN_NO_MEMORY : CAIRN_OK;
}

/* ---- Values ---- */

static cairn_status sparse_clear(void *context)
{
    cairn_sparse_solver *s = context;

    if (s->part != NOTHING || s->result.state == CAIRN_BLOCK_SOLVER_NEW)
        return CAIRN_BAD_ARGUMENT;
    memset(s->value, 0, (size_t)s->column[s->n] * sizeof *s->value);
    s->solved = 0;
    s->result.pose = -1;
    s->result.state = CAIRN_BLOCK_SOLVER_ANALYZED;
    return CAIRN_OK;
}

static cairn_status sparse_add_pose_block(void *context, int32_t pose, cairn_sym3 block)
{
    const cairn_real full[9] = {block.xx, block.xy, block.xz, block.xy, block.yy,
                                block.yz, block.xz, block.yz, block.zz};
    cairn_sparse_solver *s = context;

    if (!is_in(s, CAIRN_BLOCK_SOLVER_ANALYZED) || !has_pose(s, pose))
        return CAIRN_BAD_ARGUMENT;
    for (int k = 0; k < 9; k++)
        if (!cairn_is_finite(full[k]))
            return CAIRN_NOT_FINITE;
    for (int k = 0; k < 9; k++)
        s->value[s->column[3 * pose + k / 3 + 1] - 3 + k % 3] += (double)full[k];
    return CAIRN_OK;
}

static cairn_status sparse_add_link_block(void *context, int32_t link, const cairn_real block[9])
{
    cairn_sparse_solver *s = context;
    const struct link *l;

    if (!is_in(s, CAIRN_BLOCK_SOLVER_ANALYZED) || link < 0 || link >= s->result.links)
        return CAIRN_BAD_ARGUMENT;
    for (int k = 0; k < 9; k++)
        if (!cairn_is_finite(block[k]))
            return CAIRN_NOT_FINITE;
    l = &s->links[link];
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            s->value[s->column[3 * l->pose[1] + c] + 3 * l->block[0] + r] +=
                (double)block[3 * r + c];
            s->value[s->column[3 * l->pose[0] + r] + 3 * l->block[1] + c] +=
                (double)block[3 * r + c];
        }
    return CAIRN_OK;
}

/* ---- Parts ---- */

static cairn_status begin_part(cairn_sparse_solver *s, cairn_block_solver_state state, int32_t part)
{
    if (!is_in(s, state))
        return CAIRN_BAD_ARGUMENT;
    s->part = part;
    return CAIRN_OK;
}

static cairn_status sparse_factor(void *context)
{
    return begin_part(context, CAIRN_BLOCK_SOLVER_ANALYZED, FACTOR);
}

static cairn_status sparse_invert(void *context)
{
    return begin_part(context, CAIRN_BLOCK_SOLVER_FACTORED, INVERT);
}

static cairn_status sparse_solve(void *context, const cairn_real *b)
{
    cairn_sparse_solver *s = context;
    cairn_status status = begin_part(s, CAIRN_BLOCK_SOLVER_FACTORED, SOLVE);

    for (int k = 0; k < s->n && status == CAIRN_OK; k++) {
        if (!cairn_is_finite(b[k])) {
            s->part = NOTHING;
            return CAIRN_NOT_FINITE;
        }
        s->x[s->place[k]] = (double)b[k];
    }
    return status;
}

/* The pivot must be above 64 rounding errors of the diagonal that it came from, as in
 * block_solver. */
static void factor(cairn_sparse_solver *s)
{
    int done = s->call.ldl_numeric(s->n, s->column, s->row, s->value, s->start, s->parent, s->count,
                                   s->l_row, s->l_value, s->d, s->y, s->pattern, s->flag, s->order,
                                   s->place);
    int bad = done < s->n ? done : -1;

    for (int k = 0; k < done && bad < 0; k++)
        if (!(s->d[k] >
              64 * DBL_EPSILON * s->value[s->column[s->order[k] + 1] - 3 + s->order[k] % 3]))
            bad = k;
    s->result.pose = bad >= 0 ? s->order[bad] / 3 : -1;
    s->result.state = bad >= 0 ? CAIRN_BLOCK_SOLVER_NOT_POSITIVE : CAIRN_BLOCK_SOLVER_FACTORED;
}

/* 0 when the solution is more than a cairn_real can tell. */
static int substitute(const cairn_sparse_solver *s, double *x)
{
    s->call.ldl_lsolve(s->n, x, s->start, s->l_row, s->l_value);
    s->call.ldl_dsolve(s->n, x, s->d);
    s->call.ldl_ltsolve(s->n, x, s->start, s->l_row, s->l_value);
    for (int k = 0; k < s->n; k++)
        if (!(fabs(x[k]) <= (double)CAIRN_REAL_MAX))
            return 0;
    return 1;
}

static cairn_status sparse_step(void *context, cairn_budget *budget)
{
    cairn_sparse_solver *s = context;
    int32_t part = s->part;
    cairn_status status = CAIRN_OK;

    if (part == NOTHING)
        return CAIRN_OK;
    if (budget->left <= 0)
        return CAIRN_MORE;
    budget->left--;
    s->part = NOTHING;
    if (part == ANALYZE) {
        status = analyze(s);
        if (status == CAIRN_OK)
            s->result.state = CAIRN_BLOCK_SOLVER_ANALYZED;
    } else if (part == FACTOR) {
        factor(s);
    } else if (part == SOLVE) {
        s->solved = substitute(s, s->x);
        status = s->solved ? CAIRN_OK : CAIRN_NOT_FINITE;
    } else {
        s->result.state = CAIRN_BLOCK_SOLVER_INVERTED;
    }
    return status;
}

static cairn_status sparse_solution(const void *context, int32_t pose, cairn_real x[3])
{
    const cairn_sparse_solver *s = context;

    if (!has_pose(s, pose))
        return CAIRN_BAD_ARGUMENT;
    if (!s->solved)
        return CAIRN_EMPTY;
    for (int k = 0; k < 3; k++)
        x[k] = (cairn_real)s->x[s->place[3 * pose + k]];
    return CAIRN_OK;
}

static cairn_status sparse_covariance(const void *context, int32_t first, int32_t second,
                                      cairn_real block[9])
{
    const cairn_sparse_solver *s = context;
    double *x;

    if (!has_pose(s, first) || !has_pose(s, second))
        return CAIRN_BAD_ARGUMENT;
    if (!is_in(s, CAIRN_BLOCK_SOLVER_INVERTED))
        return CAIRN_EMPTY;
    x = malloc((size_t)s->n * sizeof *x);
    if (x == NULL)
        return CAIRN_NO_MEMORY;
    for (int c = 0; c < 3; c++) {
        memset(x, 0, (size_t)s->n * sizeof *x);
        x[s->place[3 * second + c]] = 1;
        if (!substitute(s, x)) {
            free(x);
            return CAIRN_NOT_FINITE;
        }
        for (int r = 0; r < 3; r++)
            block[3 * r + c] = (cairn_real)x[s->place[3 * first + r]];
    }
    free(x);
    return CAIRN_OK;
}

static cairn_block_solver_result sparse_read(const void *context)
{
    const cairn_sparse_solver *s = context;
    cairn_block_solver_result result = s->result;

    result.running = s->part != NOTHING;
    return result;
}

cairn_pose_solver cairn_sparse_solver_face(cairn_sparse_solver *solver)
{
    cairn_pose_solver face = {solver,
                              sparse_begin,
                              sparse_add_link,
                              sparse_analyze,
                              sparse_clear,
                              sparse_add_pose_block,
                              sparse_add_link_block,
                              sparse_factor,
                              sparse_solve,
                              sparse_solution,
                              sparse_invert,
                              sparse_covariance,
                              sparse_step,
                              sparse_read};
    return face;
}
