/* Numeric factorization LDL^T by blocks, and solutions.
 *
 * Method:
 * 1. H = L D L^T column by column (left-looking). Columns store C = L D, so no column is scaled:
 *    column k subtracts C_ik D_k^-1 C_jk^T from the block (i, j).
 * 2. Adjacent columns with the same rows below are a run (supernode). A run is subtracted from a
 *    panel of up to four columns of another run at a time. The blocks of the targets in one row
 *    stay in registers while the products of the run's columns are accumulated.
 * 3. The runs that update a panel are in linked lists of its rows, and then move to the list of
 *    their next row (George and Liu 1981; Ng and Peyton 1993).
 * 4. When no third unknown (theta) is coupled, the third rows and columns of all blocks are zero
 *    and are skipped; the remaining parts of all four targets stay in registers.
 * 5. Solutions by forward and backward substitution.
 *
 * Layout: blocks in columns, row-major 3 x 3, rows ascending; D^-1 in `diagonal`. The factors
 * D_k^-1 C_jk^T of a panel: [PANEL / 2] pairs of targets j, [WIDTH] source columns k, [3][6], both
 * targets of a pair side by side; without third unknowns [WIDTH][2][8], all four targets side by
 * side. Entries without a target are zero.
 *
 * Source: George and Liu, Computer Solution of Large Sparse Positive Definite Systems, 1981; Ng and
 * Peyton, Block sparse Cholesky algorithms on advanced uniprocessor computers, 1993. */
#include "src/base/build.h"

#include <string.h>

#include "src/numerics/block_solver_work.h"

/* Scalar columns of a pair of targets and of a planar panel, and the cairn_real of their factors
 * per source column. */
enum {
    PAIR_COLUMNS = 6,
    PAIR_REALS = 3 * PAIR_COLUMNS,
    PANEL_COLUMNS = 8,
    PANEL_REALS = 2 * PANEL_COLUMNS
};

/* ---- Factor ---- */

/* Reuses arrays of the ordering:
 *     size         first column of the run of a column
 *     last_member  last column of the run that starts at a column
 *     head, next   lists of runs by their next row
 *     start        block of that row in the last column of a run
 *     mark         position of a row in the columns of the current run, counted from their end */
void cairn_block_solver_factor_begin(cairn_block_solver *solver)
{
    struct block_solver_order *ordering = &solver->ordering;

    for (int32_t j = 0; j < solver->result.poses; j++) {
        int32_t count = solver->column[j + 1] - solver->column[j];
        int joins = j > 0 && solver->column[j] - solver->column[j - 1] == count + 1 &&
                    solver->rows[solver->column[j - 1]] == j;

        ordering->head[j] = -1;
        ordering->size[j] = joins ? ordering->size[j - 1] : j;
        ordering->last_member[ordering->size[j]] = j;
    }
    solver->panel.row = solver->panel.end = 0;
}

/* Inserts a run into the list of the row of its next block; `block` is that block in its last
 * column. */
static void link_run(cairn_block_solver *solver, int32_t run, int32_t block)
{
    struct block_solver_order *ordering = &solver->ordering;
    int32_t row;

    if (block == solver->column[ordering->last_member[run] + 1])
        return;
    row = solver->rows[block];
    ordering->start[run] = block;
    ordering->next[run] = ordering->head[row];
    ordering->head[row] = run;
}

/* Replaces the pivot block D by D^-1. h: the diagonal of H from which D came. 0 when D is not
 * positive definite to rounding. */
static int invert_pivot(cairn_sym3 *d, const cairn_real h[3])
{
    const cairn_real least = 64 * CAIRN_REAL_EPSILON;
    cairn_sym3 inverse;

    if (!(d->xx > least * h[0] && d->yy > least * h[1] && d->zz > least * h[2]) ||
        !cairn_sym3_inverse(*d, &inverse) ||
        !(inverse.xx <= CAIRN_REAL_MAX && inverse.yy <= CAIRN_REAL_MAX &&
          inverse.zz <= CAIRN_REAL_MAX))
        return 0;
    *d = inverse;
    return 1;
}

/* Starts the subtraction of the next run of the current row's list. Targets are the columns of the
 * panel in whose rows the run has blocks. */
static void begin_run(cairn_block_solver *solver)
{
    struct block_solver_order *ordering = &solver->ordering;
    struct block_solver_panel *panel = &solver->panel;
    int32_t run = ordering->head[panel->row], block = ordering->start[run],
            end = solver->column[ordering->last_member[run] + 1];

    ordering->head[panel->row] = ordering->next[run];
    solver->source = run;
    panel->source_end = ordering->last_member[run] + 1;
    panel->blocks_to_end = end - block;
    for (panel->target_count = 0; block < end && solver->rows[block] < panel->end; block++)
        panel->target[panel->target_count++] = solver->rows[block];
    link_run(solver, run, block);
}

/* Starts the subtraction of the columns source ... end - 1 of the current run from its columns
 * first ... last. */
static void begin_current_run(cairn_block_solver *solver, int32_t source, int32_t end,
                              int32_t first, int32_t last)
{
    struct block_solver_panel *panel = &solver->panel;

    solver->source = source;
    panel->source_end = end;
    panel->blocks_to_end = solver->column[first + 1] - solver->column[first] + 1;
    panel->target_count = 0;
    for (int32_t j = first; j <= last; j++)
        panel->target[panel->target_count++] = j;
}

/* Starts the panel at the current column. */
static void begin_panel(cairn_block_solver *solver)
{
    struct block_solver_order *ordering = &solver->ordering;
    struct block_solver_panel *panel = &solver->panel;
    int32_t j = solver->current, run = ordering->size[j];

    panel->first = panel->row = j;
    panel->end = j + BLOCK_SOLVER_PANEL <= ordering->last_member[run]
                     ? j + BLOCK_SOLVER_PANEL
                     : ordering->last_member[run] + 1;
    for (int32_t k = j; k < panel->end; k++) {
        panel->scale[k - j][0] = solver->diagonal[k].xx;
        panel->scale[k - j][1] = solver->diagonal[k].yy;
        panel->scale[k - j][2] = solver->diagonal[k].zz;
    }
    if (run == j)
        for (int32_t b = solver->column[j]; b < solver->column[j + 1]; b++)
            ordering->mark[solver->rows[b]] = solver->column[j + 1] - b;
    begin_current_run(solver, run, j, j, panel->end - 1);
}

/* Starts the current column: a panel, or a further column of one, from which the panel's columns
 * before it are subtracted. */
static void begin_column(cairn_block_solver *solver)
{
    if (solver->current == solver->panel.end)
        begin_panel(solver);
    else
        begin_current_run(solver, solver->panel.first, solver->current, solver->current,
                          solver->current);
}

/* List entries of the start of the current column: the first one of a run is listed. */
static int32_t listed_blocks(const cairn_block_solver *solver)
{
    int32_t j = solver->current;

    return solver->ordering.size[j] == j ? solver->column[j + 1] - solver->column[j] : 0;
}

/* Ends the current column by inverting its pivot. 0 when the pivot is not positive definite. */
static int end_column(cairn_block_solver *solver)
{
    struct block_solver_order *ordering = &solver->ordering;
    int32_t j = solver->current;

    if (!invert_pivot(&solver->diagonal[j], solver->panel.scale[j - solver->panel.first])) {
        solver->result.failed_pose = solver->order[j];
        return 0;
    }
    if (ordering->last_member[ordering->size[j]] == j)
        link_run(solver, ordering->size[j], solver->column[j]);
    return 1;
}

/* ---- Products ---- */

#if defined(__GNUC__) && !defined(__clang__)
/* At -O2 gcc keeps the rows of a sum in memory, in loops, which takes twice the time. With these
 * options gcc unrolls the loops and keeps the rows in vector registers. Only the functions of this
 * section are affected, and no result depends on the options. */
#pragma GCC push_options
#pragma GCC optimize("vect-cost-model=dynamic", "peel-loops")
#endif

/* a += scale * x, for a row of a pair of targets. */
static inline void add_row(cairn_real a[PAIR_COLUMNS], const cairn_real x[PAIR_COLUMNS],
                           cairn_real scale)
{
    for (int k = 0; k < PAIR_COLUMNS; k++)
        a[k] += x[k] * scale;
}

/* Sum over the source columns k of C_ik (D_k^-1 C_jk^T), for two targets j side by side. factors:
 * the D_k^-1 C_jk^T of the pair. */
static void sum_products(const cairn_block_solver *solver, int32_t blocks_to_end,
                         const cairn_real *factors, cairn_real sum[3 * PAIR_COLUMNS])
{
    cairn_real a[PAIR_COLUMNS] = {0}, b[PAIR_COLUMNS] = {0}, c[PAIR_COLUMNS] = {0};

    for (int32_t k = solver->source; k < solver->source + solver->panel.width; k++) {
        const cairn_real *x = solver->blocks[solver->column[k + 1] - blocks_to_end], *end = x + 3;

        for (; x < end; x++, factors += PAIR_COLUMNS) {
            add_row(a, factors, x[0]);
            add_row(b, factors, x[3]);
            add_row(c, factors, x[6]);
        }
    }
    memcpy(sum, a, sizeof a);
    memcpy(sum + PAIR_COLUMNS, b, sizeof b);
    memcpy(sum + 2 * PAIR_COLUMNS, c, sizeof c);
}

/* a += scale * x, for a row of four planar targets. */
static inline void add_panel_row(cairn_real a[PANEL_COLUMNS], const cairn_real x[PANEL_COLUMNS],
                                 cairn_real scale)
{
    for (int k = 0; k < PANEL_COLUMNS; k++)
        a[k] += x[k] * scale;
}

/* As sum_products(), for four targets, of blocks whose third rows and columns are zero. */
static void sum_planar_products(const cairn_block_solver *solver, int32_t blocks_to_end,
                                cairn_real sum[2 * PANEL_COLUMNS])
{
    cairn_real a[PANEL_COLUMNS] = {0}, b[PANEL_COLUMNS] = {0};
    const cairn_real *factors = solver->panel.factor;

    for (int32_t k = solver->source; k < solver->source + solver->panel.width;
         k++, factors += PANEL_REALS) {
        const cairn_real *x = solver->blocks[solver->column[k + 1] - blocks_to_end];

        add_panel_row(a, factors, x[0]);
        add_panel_row(b, factors, x[3]);
        add_panel_row(a, factors + PANEL_COLUMNS, x[1]);
        add_panel_row(b, factors + PANEL_COLUMNS, x[4]);
    }
    memcpy(sum, a, sizeof a);
    memcpy(sum + PANEL_COLUMNS, b, sizeof b);
}

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC pop_options
#endif

/* block -= sum, of one target of a pair. */
static void subtract_block(cairn_real to[9], const cairn_real *sum)
{
    for (int r = 0; r < 3; r++, to += 3, sum += PAIR_COLUMNS) {
        to[0] -= sum[0];
        to[1] -= sum[1];
        to[2] -= sum[2];
    }
}

/* Subtracts the upper triangle of a sum from a diagonal block. */
static void subtract_diagonal(cairn_sym3 *d, const cairn_real *sum)
{
    d->xx -= sum[0];
    d->xy -= sum[1];
    d->xz -= sum[2];
    d->yy -= sum[PAIR_COLUMNS + 1];
    d->yz -= sum[PAIR_COLUMNS + 2];
    d->zz -= sum[2 * PAIR_COLUMNS + 2];
}

/* Subtracts the products of the source columns' blocks in a row from the blocks of the targets in
 * the row. Where the row is a target itself, subtracts them from its diagonal block.
 * row_blocks_to_end: position of the row in the target columns, counted from their end. */
static void subtract_pairs(cairn_block_solver *solver, int32_t blocks_to_end, int32_t row,
                           int32_t row_blocks_to_end)
{
    const struct block_solver_panel *panel = &solver->panel;

    for (int32_t t = 0; t < panel->target_count && panel->target[t] <= row; t += 2) {
        cairn_real sum[3 * PAIR_COLUMNS];

        sum_products(solver, blocks_to_end,
                     panel->factor + t / 2 * (BLOCK_SOLVER_WIDTH * PAIR_REALS), sum);
        for (int32_t u = t; u < t + 2 && u < panel->target_count; u++) {
            if (panel->target[u] < row)
                subtract_block(
                    solver->blocks[solver->column[panel->target[u] + 1] - row_blocks_to_end],
                    &sum[3 * (u - t)]);
            else if (panel->target[u] == row)
                subtract_diagonal(&solver->diagonal[row], &sum[3 * (u - t)]);
        }
    }
}

/* As subtract_pairs(), without third unknowns. */
static void subtract_planar(cairn_block_solver *solver, int32_t blocks_to_end, int32_t row,
                            int32_t row_blocks_to_end)
{
    const struct block_solver_panel *panel = &solver->panel;
    cairn_real sum[2 * PANEL_COLUMNS];

    sum_planar_products(solver, blocks_to_end, sum);
    for (int32_t t = 0; t < panel->target_count && panel->target[t] <= row; t++) {
        const cairn_real *a = &sum[2 * t], *b = &sum[PANEL_COLUMNS + 2 * t];

        if (panel->target[t] < row) {
            cairn_real *block =
                solver->blocks[solver->column[panel->target[t] + 1] - row_blocks_to_end];

            block[0] -= a[0];
            block[1] -= a[1];
            block[3] -= b[0];
            block[4] -= b[1];
        } else {
            solver->diagonal[row].xx -= a[0];
            solver->diagonal[row].xy -= a[1];
            solver->diagonal[row].yy -= b[1];
        }
    }
}

/* Rows of the source columns that are subtracted next. */
static int32_t next_rows(const cairn_block_solver *solver)
{
    return solver->block < solver->panel.rows ? solver->block : solver->panel.rows;
}

/* Subtracts the products of the next rows of the source columns. */
static CAIRN_STEP_NOT_INLINED void subtract_rows(cairn_block_solver *solver)
{
    const int32_t *end = solver->rows + solver->column[solver->source + 1];
    int32_t left = solver->block - next_rows(solver);

    for (; solver->block > left; solver->block--) {
        int32_t row = end[-solver->block];

        if (solver->is_coupled)
            subtract_pairs(solver, solver->block, row, solver->ordering.mark[row]);
        else
            subtract_planar(solver, solver->block, row, solver->ordering.mark[row]);
    }
}

/* ---- Factors ---- */

/* product = D C^T, for one target of a pair. */
static void multiply_symmetric(cairn_sym3 d, const cairn_real c[9], cairn_real *product)
{
    for (int k = 0; k < 3; k++, c += 3) {
        product[k] = d.xx * c[0] + d.xy * c[1] + d.xz * c[2];
        product[PAIR_COLUMNS + k] = d.xy * c[0] + d.yy * c[1] + d.yz * c[2];
        product[2 * PAIR_COLUMNS + k] = d.xz * c[0] + d.yz * c[1] + d.zz * c[2];
    }
}

/* product = D C^T without third rows and columns, for one of four targets. */
static void multiply_planar(cairn_sym3 d, const cairn_real c[9], cairn_real *product)
{
    for (int k = 0; k < 2; k++, c += 3) {
        product[k] = d.xx * c[0] + d.xy * c[1];
        product[PANEL_COLUMNS + k] = d.xy * c[0] + d.yy * c[1];
    }
}

/* Computes the factors D_k^-1 C_jk^T of all source columns k for target t, which is column j; C_jk
 * is the block of source column k in row j. */
static void compute_factors(cairn_block_solver *solver, int32_t t)
{
    struct block_solver_panel *panel = &solver->panel;

    for (int32_t k = 0; k < panel->width; k++) {
        const cairn_real *c =
            solver->blocks[solver->column[solver->source + k + 1] - panel->blocks_to_end + t];
        cairn_sym3 d = solver->diagonal[solver->source + k];

        if (solver->is_coupled)
            multiply_symmetric(
                d, c, panel->factor + (t / 2 * BLOCK_SOLVER_WIDTH + k) * PAIR_REALS + t % 2 * 3);
        else
            multiply_planar(d, c, panel->factor + k * PANEL_REALS + t * 2);
    }
}

/* Chooses the next source columns of the run. Returns the block products of one of their rows, as
 * many as the factors. */
static int32_t choose_columns(cairn_block_solver *solver)
{
    struct block_solver_panel *panel = &solver->panel;

    panel->width = panel->source_end - solver->source;
    if (panel->width > BLOCK_SOLVER_WIDTH)
        panel->width = BLOCK_SOLVER_WIDTH;
    panel->products =
        panel->width * (panel->target_count + (solver->is_coupled ? panel->target_count % 2 : 0));
    return panel->products;
}

/* Computes the factors of the source columns, and starts with their first row. */
static void begin_columns(cairn_block_solver *solver)
{
    struct block_solver_panel *panel = &solver->panel;
    cairn_real *last_pair =
        panel->factor + panel->target_count / 2 * (BLOCK_SOLVER_WIDTH * PAIR_REALS);

    if (solver->is_coupled && panel->target_count % 2 == 1)
        memset(last_pair, 0, (size_t)panel->width * PAIR_REALS * sizeof *panel->factor);
    else if (!solver->is_coupled && panel->target_count < BLOCK_SOLVER_PANEL)
        memset(panel->factor, 0, (size_t)panel->width * PANEL_REALS * sizeof *panel->factor);
    for (int32_t t = 0; t < panel->target_count; t++)
        compute_factors(solver, t);
    panel->rows = 1 + (BLOCK_SOLVER_PRODUCTS_PER_CALL - 1) / panel->products;
    solver->block = panel->blocks_to_end;
}

/* Subtracts the source columns of the run, as many at a time as the panel is wide. */
static int subtract_run(cairn_block_solver *solver, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(solver->part_resume);
    for (; solver->source < solver->panel.source_end; solver->source += solver->panel.width) {
        CAIRN_STEP_CHARGE(solver, part_resume, budget, choose_columns(solver));
        begin_columns(solver);
        while (solver->block > 0) {
            CAIRN_STEP_CHARGE(solver, part_resume, budget,
                              next_rows(solver) * solver->panel.products);
            subtract_rows(solver);
        }
    }
    CAIRN_STEP_END(solver->part_resume);
}

int cairn_block_solver_factorize(cairn_block_solver *solver, cairn_budget *budget)
{
    struct block_solver_panel *panel = &solver->panel;

    CAIRN_STEP_BEGIN(solver->resume);
    for (solver->current = 0; solver->current < solver->result.poses; solver->current++) {
        BLOCK_SOLVER_CHARGE_LIST(solver, resume, budget, listed_blocks(solver));
        begin_column(solver);
        CAIRN_STEP_RUN(solver, resume, budget, subtract_run);
        for (; panel->row < panel->end; panel->row++)
            while (solver->ordering.head[panel->row] != -1) {
                CAIRN_STEP_CHARGE_UNIT(solver, resume, budget);
                begin_run(solver);
                CAIRN_STEP_RUN(solver, resume, budget, subtract_run);
            }
        CAIRN_STEP_CHARGE_UNIT(solver, resume, budget);
        if (!end_column(solver))
            break;
    }
    block_solver_end(solver,
                     solver->current < solver->result.poses ? CAIRN_BLOCK_SOLVER_NOT_POSITIVE
                                                            : CAIRN_BLOCK_SOLVER_FACTORED,
                     CAIRN_OK);
    CAIRN_STEP_END(solver->resume);
}

/* ---- Solution ---- */

/* Forward substitution of column j: z = D_j^-1 x_j, x_i -= C_ij z for the later rows i, x_j = z. */
static void solve_forward(cairn_block_solver *solver, int32_t j)
{
    cairn_real z[3];

    cairn_sym3_times(solver->diagonal[j], solver->x[j], z);
    for (int32_t b = solver->column[j]; b < solver->column[j + 1]; b++) {
        cairn_real *x = solver->x[solver->rows[b]];
        const cairn_real *c = solver->blocks[b];

        for (int k = 0; k < 3; k++)
            x[k] -= c[3 * k] * z[0] + c[3 * k + 1] * z[1] + c[3 * k + 2] * z[2];
    }
    memcpy(solver->x[j], z, sizeof z);
}

/* Backward substitution of column j: x_j -= D_j^-1 sum C_ij^T x_i over the later rows i. 0 when x_j
 * overflows. Columns and rows are both visited in descending order: a factor that is larger than
 * the cache is read twice as fast with monotone addresses. */
static int solve_backward(cairn_block_solver *solver, int32_t j)
{
    cairn_real sum[3] = {0, 0, 0}, z[3];

    for (int32_t b = solver->column[j + 1] - 1; b >= solver->column[j]; b--) {
        const cairn_real *x = solver->x[solver->rows[b]], *c = solver->blocks[b];

        for (int k = 0; k < 3; k++)
            sum[k] += c[k] * x[0] + c[3 + k] * x[1] + c[6 + k] * x[2];
    }
    cairn_sym3_times(solver->diagonal[j], sum, z);
    for (int k = 0; k < 3; k++)
        solver->x[j][k] -= z[k];
    return cairn_is_finite(solver->x[j][0]) && cairn_is_finite(solver->x[j][1]) &&
           cairn_is_finite(solver->x[j][2]);
}

/* Work units of the substitution of the current column. */
static int32_t substitution_units(const cairn_block_solver *solver)
{
    return 1 + (solver->column[solver->current + 1] - solver->column[solver->current]) / 2;
}

int cairn_block_solver_substitute(cairn_block_solver *solver, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(solver->resume);
    for (solver->current = 0; solver->current < solver->result.poses; solver->current++) {
        CAIRN_STEP_CHARGE(solver, resume, budget, substitution_units(solver));
        solve_forward(solver, solver->current);
    }
    for (solver->current = solver->result.poses - 1; solver->current >= 0; solver->current--) {
        CAIRN_STEP_CHARGE(solver, resume, budget, substitution_units(solver));
        if (!solve_backward(solver, solver->current))
            break;
    }
    solver->solved = solver->current < 0;
    block_solver_end(solver, CAIRN_BLOCK_SOLVER_FACTORED,
                     solver->solved ? CAIRN_OK : CAIRN_NOT_FINITE);
    CAIRN_STEP_END(solver->resume);
}
