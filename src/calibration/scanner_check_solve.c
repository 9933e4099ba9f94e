/* Least squares of a few unknowns, with standard deviations by the jackknife.
 *
 * Errors of neighbouring scans are not independent, as they see the same walls. The standard
 * deviation is therefore that of the solutions without each part of the drive in turn
 * (delete-a-group jackknife). */
#include "src/base/build.h"

#include <string.h>

#include "cairn/small_matrix.h"
#include "src/calibration/scanner_check_work.h"

/* A pivot below this share of the diagonal counts as 0: some thousand times the rounding in double,
 * some ten times in float. */
#ifdef CAIRN_FLOAT
static const cairn_real LEAST_PIVOT = CAIRN_REAL(2e-6);
#else
static const cairn_real LEAST_PIVOT = CAIRN_REAL(1e-12);
#endif

/* Least information of an unknown, so that one without any keeps its prior's value. */
static const cairn_real LEAST_INFORMATION = CAIRN_REAL(1e-9);

static int32_t elements_of(int32_t unknowns)
{
    return cairn_sym_element(unknowns, 0);
}

void cairn_scanner_check_clear(scanner_check_sums *sums, int32_t unknowns, const cairn_real *prior,
                               const cairn_real *expected)
{
    memset(sums, 0, sizeof *sums);
    sums->unknowns = unknowns;
    for (int32_t i = 0; i < unknowns; i++) {
        cairn_real information = cairn_max(prior[i], LEAST_INFORMATION);

        sums->all.a[cairn_sym_element(i, i)] = information;
        sums->all.b[i] = information * expected[i];
    }
}

static void add(scanner_check_equations *sum, int32_t unknowns, cairn_real weight,
                const cairn_real *a, const cairn_real *b)
{
    for (int32_t i = 0; i < elements_of(unknowns); i++)
        sum->a[i] += weight * a[i];
    for (int32_t i = 0; i < unknowns; i++)
        sum->b[i] += weight * b[i];
}

void cairn_scanner_check_add(scanner_check_sums *sums, int32_t block, cairn_real weight,
                             const cairn_real *a, const cairn_real *b)
{
    add(&sums->all, sums->unknowns, weight, a, b);
    add(&sums->block[block], sums->unknowns, weight, a, b);
    sums->uses[block] = 1;
}

/* 0: not positive definite. */
static int solve(scanner_check_equations e, int32_t unknowns, cairn_real *x)
{
    memcpy(x, e.b, (size_t)unknowns * sizeof *x);
    return cairn_sym_solve(e.a, unknowns, LEAST_PIVOT, x);
}

static int32_t count_blocks(const scanner_check_sums *sums)
{
    int32_t blocks = 0;

    for (int32_t i = 0; i < SCANNER_CHECK_BLOCKS; i++)
        blocks += sums->uses[i];
    return blocks;
}

cairn_real cairn_scanner_check_jackknife(const scanner_check_sums *sums,
                                         const cairn_real without[SCANNER_CHECK_BLOCKS])
{
    cairn_real blocks = (cairn_real)count_blocks(sums), mean = 0, squares = 0;

    for (int32_t i = 0; i < SCANNER_CHECK_BLOCKS; i++)
        if (sums->uses[i])
            mean += without[i];
    mean /= blocks;
    for (int32_t i = 0; i < SCANNER_CHECK_BLOCKS; i++)
        if (sums->uses[i])
            squares += (without[i] - mean) * (without[i] - mean);
    return cairn_sqrt(squares * (blocks - 1) / blocks);
}

/* Solves the sums without a block. 0: singular. */
static int solve_without(const scanner_check_sums *sums, int32_t block, cairn_real *x)
{
    scanner_check_equations part = sums->all;

    for (int32_t i = 0; i < elements_of(sums->unknowns); i++)
        part.a[i] -= sums->block[block].a[i];
    for (int32_t i = 0; i < sums->unknowns; i++)
        part.b[i] -= sums->block[block].b[i];
    return solve(part, sums->unknowns, x);
}

int cairn_scanner_check_solve(const scanner_check_sums *sums, scanner_check_solution *solution)
{
    memset(solution, 0, sizeof *solution);
    if (count_blocks(sums) < 2 || !solve(sums->all, sums->unknowns, solution->x))
        return 0;
    for (int32_t i = 0; i < SCANNER_CHECK_BLOCKS; i++)
        if (sums->uses[i] && !solve_without(sums, i, solution->without[i]))
            return 0;
    for (int32_t k = 0; k < sums->unknowns; k++) {
        cairn_real without[SCANNER_CHECK_BLOCKS];

        for (int32_t i = 0; i < SCANNER_CHECK_BLOCKS; i++)
            without[i] = solution->without[i][k];
        solution->sigma[k] = cairn_scanner_check_jackknife(sums, without);
    }
    return 1;
}
