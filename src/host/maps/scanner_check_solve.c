/* Least squares of a few unknowns, with standard deviations by the jackknife.
 *
 * Errors of neighbouring scans are not independent, as they see the same walls. The standard
 * deviation is therefore that of the solutions without each part of the log in turn (delete-a-group
 * jackknife). */
#include "src/base/build.h"

#include <math.h>
#include <string.h>

#include "src/host/maps/scanner_check_work.h"

/* A pivot below this share of the diagonal counts as 0. */
static const double LEAST_PIVOT = 1e-12;

/* Least information of an unknown, so that one without any keeps its prior's value. */
static const double LEAST_INFORMATION = 1e-9;

typedef struct normal_equations {
    double a[SCANNER_CHECK_UNKNOWNS][SCANNER_CHECK_UNKNOWNS], b[SCANNER_CHECK_UNKNOWNS];
} normal_equations;

static void add(normal_equations *sum, const scanner_check_term *term, int32_t unknowns)
{
    for (int i = 0; i < unknowns; i++) {
        for (int k = 0; k < unknowns; k++)
            sum->a[i][k] += term->weight * term->a[i][k];
        sum->b[i] += term->weight * term->b[i];
    }
}

/* Cholesky factorization and substitution. 0: not positive definite. */
static int solve(normal_equations e, int32_t unknowns, double *x)
{
    for (int k = 0; k < unknowns; k++) {
        double diagonal = e.a[k][k];

        for (int i = 0; i < k; i++)
            diagonal -= e.a[k][i] * e.a[k][i];
        if (!(diagonal > LEAST_PIVOT * e.a[k][k]))
            return 0;
        e.a[k][k] = sqrt(diagonal);
        for (int row = k + 1; row < unknowns; row++) {
            for (int i = 0; i < k; i++)
                e.a[row][k] -= e.a[row][i] * e.a[k][i];
            e.a[row][k] /= e.a[k][k];
        }
    }
    for (int k = 0; k < unknowns; k++) {
        x[k] = e.b[k];
        for (int i = 0; i < k; i++)
            x[k] -= e.a[k][i] * x[i];
        x[k] /= e.a[k][k];
    }
    for (int k = unknowns - 1; k >= 0; k--) {
        for (int i = k + 1; i < unknowns; i++)
            x[k] -= e.a[i][k] * x[i];
        x[k] /= e.a[k][k];
    }
    return 1;
}

double cairn_scanner_check_jackknife(const scanner_check_solution *solution,
                                     const double without[SCANNER_CHECK_BLOCKS])
{
    double mean = 0, squares = 0;
    int32_t blocks = 0;

    for (int i = 0; i < SCANNER_CHECK_BLOCKS; i++)
        if (solution->blocks[i]) {
            mean += without[i];
            blocks++;
        }
    mean /= blocks;
    for (int i = 0; i < SCANNER_CHECK_BLOCKS; i++)
        if (solution->blocks[i])
            squares += (without[i] - mean) * (without[i] - mean);
    return sqrt(squares * (blocks - 1) / blocks);
}

int cairn_scanner_check_solve(const scanner_check_term *terms, int32_t count, int32_t unknowns,
                              const double *prior, const double *expected,
                              scanner_check_solution *solution)
{
    normal_equations sum, block[SCANNER_CHECK_BLOCKS], part;
    int32_t blocks = 0;

    memset(solution, 0, sizeof *solution);
    memset(&sum, 0, sizeof sum);
    memset(block, 0, sizeof block);
    for (int i = 0; i < unknowns; i++) {
        double information = fmax(prior[i], LEAST_INFORMATION);

        sum.a[i][i] = information;
        sum.b[i] = information * expected[i];
    }
    for (int32_t i = 0; i < count; i++) {
        add(&sum, &terms[i], unknowns);
        add(&block[terms[i].block], &terms[i], unknowns);
        solution->blocks[terms[i].block] = 1;
    }
    for (int i = 0; i < SCANNER_CHECK_BLOCKS; i++)
        blocks += solution->blocks[i];
    if (blocks < 2 || !solve(sum, unknowns, solution->x))
        return 0;
    for (int i = 0; i < SCANNER_CHECK_BLOCKS; i++) {
        part = sum;
        for (int k = 0; k < unknowns && solution->blocks[i]; k++) {
            for (int m = 0; m < unknowns; m++)
                part.a[k][m] -= block[i].a[k][m];
            part.b[k] -= block[i].b[k];
        }
        if (solution->blocks[i] && !solve(part, unknowns, solution->without[i]))
            return 0;
    }
    for (int k = 0; k < unknowns; k++) {
        double without[SCANNER_CHECK_BLOCKS];

        for (int i = 0; i < SCANNER_CHECK_BLOCKS; i++)
            without[i] = solution->without[i][k];
        solution->sigma[k] = cairn_scanner_check_jackknife(solution, without);
    }
    return 1;
}
