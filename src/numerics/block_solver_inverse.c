/* Selected inverse: the blocks of H^-1 within the pattern of the factor.
 *
 * Method: with H = L D L^T the inverse Z satisfies Z L = L^-T D^-1. Its part on and below the
 * diagonal needs only blocks of Z within the pattern of L (Takahashi, Fagan and Chen 1973). From
 * the last column to the first, with sums over the rows k of column j:
 *
 *     Z_ij = - sum Z_ik L_kj
 *     Z_jj = D_j^-1 - sum L_kj^T Z_kj
 *
 * Column j of Z overwrites column j of the factor, which no earlier column needs.
 *
 * Layout: `sums` holds the sums of column j, one block per row.
 *
 * Source: Takahashi, Fagan and Chen, Formation of a sparse bus impedance matrix, 1973; Erisman and
 * Tinney, On computing certain elements of the inverse of a sparse matrix, 1975. */
#include "src/base/build.h"

#include <string.h>

#include "src/numerics/block_solver_work.h"

/* Reuses arrays of the ordering: `mark` holds the position of a row in `sums`, and `head` the
 * column for which that position is valid. */
void cairn_block_solver_inverse_begin(cairn_block_solver *solver)
{
    for (int32_t j = 0; j < solver->result.poses; j++)
        solver->ordering.head[j] = -1;
}

/* a += b c. */
static void add_product(cairn_real a[9], const cairn_real b[9], const cairn_real c[9])
{
    for (int r = 0; r < 9; r += 3)
        for (int k = 0; k < 3; k++)
            a[r + k] += b[r] * c[k] + b[r + 1] * c[3 + k] + b[r + 2] * c[6 + k];
}

/* a += b^T c. */
static void add_transposed_product(cairn_real a[9], const cairn_real b[9], const cairn_real c[9])
{
    for (int r = 0; r < 3; r++)
        for (int k = 0; k < 3; k++)
            a[3 * r + k] += b[r] * c[k] + b[3 + r] * c[3 + k] + b[6 + r] * c[6 + k];
}

/* Starts the current column: L replaces L D, and the sums are cleared. */
static void begin_column(cairn_block_solver *solver)
{
    int32_t j = solver->current, count = solver->column[j + 1] - solver->column[j];
    cairn_real d[9];

    cairn_sym3_to_full(solver->diagonal[j], d);
    memset(solver->sums, 0, (size_t)count * sizeof *solver->sums);
    for (int32_t t = 0; t < count; t++) {
        cairn_real *block = solver->blocks[solver->column[j] + t], l[9] = {0};
        int32_t row = solver->rows[solver->column[j] + t];

        add_product(l, block, d);
        memcpy(block, l, sizeof l);
        solver->ordering.mark[row] = t;
        solver->ordering.head[row] = j;
    }
}

/* Ends the current column: the sums become its blocks of the inverse. 0 when the inverse of its
 * pose is not finite. */
static int end_column(cairn_block_solver *solver)
{
    int32_t j = solver->current, count = solver->column[j + 1] - solver->column[j];
    cairn_sym3 *d = &solver->diagonal[j];
    cairn_real z[9];

    cairn_sym3_to_full(*d, z);
    for (int32_t t = 0; t < count; t++) {
        cairn_real *block = solver->blocks[solver->column[j] + t];

        add_transposed_product(z, block, solver->sums[t]);
        for (int k = 0; k < 9; k++)
            block[k] = -solver->sums[t][k];
    }
    d->xx = z[0];
    d->yy = z[4];
    d->zz = z[8];
    d->xy = (z[1] + z[3]) / 2;
    d->xz = (z[2] + z[6]) / 2;
    d->yz = (z[5] + z[7]) / 2;
    if (d->xx <= CAIRN_REAL_MAX && d->yy <= CAIRN_REAL_MAX && d->zz <= CAIRN_REAL_MAX)
        return 1;
    solver->result.failed_pose = solver->order[j];
    return 0;
}

/* Column k of Z that is multiplied by the block L_kj of the current column j. */
static int32_t source_column(const cairn_block_solver *solver)
{
    return solver->rows[solver->source];
}

/* Number of blocks of column k of Z that are multiplied next. */
static int32_t next_blocks(const cairn_block_solver *solver)
{
    int32_t left = solver->column[source_column(solver) + 1] - solver->block;

    return left < BLOCK_SOLVER_PRODUCTS_PER_CALL ? left : BLOCK_SOLVER_PRODUCTS_PER_CALL;
}

/* Multiplies the next blocks of column k of Z, its diagonal block as the one before the first, by
 * the block L_kj of the current column j. */
static void multiply(cairn_block_solver *solver)
{
    int32_t j = solver->current, k = source_column(solver),
            end = solver->block + next_blocks(solver), own = solver->source - solver->column[j];
    const cairn_real *l = solver->blocks[solver->source];

    if (solver->block < solver->column[k]) {
        cairn_real z[9];

        cairn_sym3_to_full(solver->diagonal[k], z);
        add_product(solver->sums[own], z, l);
        solver->block++;
    }
    for (; solver->block < end; solver->block++) {
        int32_t row = solver->rows[solver->block], t = solver->ordering.mark[row];

        if (solver->ordering.head[row] != j)
            continue;
        add_product(solver->sums[t], solver->blocks[solver->block], l);
        add_transposed_product(solver->sums[own], solver->blocks[solver->block],
                               solver->blocks[solver->column[j] + t]);
    }
}

/* Work units of the start or the end of the current column. */
static int32_t column_units(const cairn_block_solver *solver)
{
    return 1 + solver->column[solver->current + 1] - solver->column[solver->current];
}

int cairn_block_solver_inverse(cairn_block_solver *solver, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(solver->resume);
    for (solver->current = solver->result.poses - 1; solver->current >= 0; solver->current--) {
        CAIRN_STEP_CHARGE(solver, resume, budget, column_units(solver));
        begin_column(solver);
        for (solver->source = solver->column[solver->current];
             solver->source < solver->column[solver->current + 1]; solver->source++) {
            solver->block = solver->column[source_column(solver)] - 1;
            while (next_blocks(solver) > 0) {
                CAIRN_STEP_CHARGE(solver, resume, budget, 2 * next_blocks(solver));
                multiply(solver);
            }
        }
        CAIRN_STEP_CHARGE(solver, resume, budget, column_units(solver));
        if (!end_column(solver))
            break;
    }
    block_solver_end(
        solver, solver->current < 0 ? CAIRN_BLOCK_SOLVER_INVERTED : CAIRN_BLOCK_SOLVER_NOT_POSITIVE,
        CAIRN_OK);
    CAIRN_STEP_END(solver->resume);
}
