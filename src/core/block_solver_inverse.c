/* Selected inverse.
 *
 * Method: with H = L D L^T the inverse Z obeys Z L = L^-T D^-1, of which the part on and below the
 * diagonal needs only entries of Z within the pattern of L (Takahashi, Fagan and Chen 1973). From
 * the last column to the first,
 *
 *     Z_ij = - sum over rows k of column j of Z_ik L_kj,    Z_jj = D_j^-1 - sum over k of L_kj^T
 *     Z_kj
 *
 * and column j of Z takes the place of column j of the factor, which no earlier column needs.
 *
 * Layout: `sums` holds the sums of column j, one block for each of its rows.
 *
 * Source: Takahashi, Fagan and Chen, Formation of a sparse bus impedance matrix, 1973; Erisman
 * and Tinney, On computing certain elements of the inverse of a sparse matrix, 1975. */
#include "src/core/build.h"

#include <string.h>

#include "src/core/block_solver_work.h"

/* Of the ordering's arrays this uses `mark` as the place of a row in `sums` and `head` as the
 * column it is valid for. */
void cairn_block_inverse_begin(cairn_block_solver *s)
{
    for (int32_t j = 0; j < s->result.poses; j++)
        s->o.head[j] = -1;
    s->at = s->result.poses;
    s->source = 0;
    s->phase = BLOCK_SOLVER_SELECT;
}

/* a += b c */
static void add_product(cairn_real a[9], const cairn_real b[9], const cairn_real c[9])
{
    for (int r = 0; r < 9; r += 3)
        for (int k = 0; k < 3; k++)
            a[r + k] += b[r] * c[k] + b[r + 1] * c[3 + k] + b[r + 2] * c[6 + k];
}

/* a += b^T c */
static void add_transposed_product(cairn_real a[9], const cairn_real b[9], const cairn_real c[9])
{
    for (int r = 0; r < 3; r++)
        for (int k = 0; k < 3; k++)
            a[3 * r + k] += b[r] * c[k] + b[3 + r] * c[3 + k] + b[6 + r] * c[6 + k];
}

static void full(cairn_sym3 m, cairn_real a[9])
{
    a[0] = m.xx;
    a[4] = m.yy;
    a[8] = m.zz;
    a[1] = a[3] = m.xy;
    a[2] = a[6] = m.xz;
    a[5] = a[7] = m.yz;
}

/* The column before the last one: L in place of L D, sums of zero. */
static int32_t begin_column(cairn_block_solver *s)
{
    int32_t j = --s->at, count = s->column[j + 1] - s->column[j];
    cairn_real d[9];

    full(s->diagonal[j], d);
    memset(s->sums, 0, (size_t)count * sizeof *s->sums);
    for (int32_t t = 0; t < count; t++) {
        cairn_real *block = s->blocks[s->column[j] + t], l[9] = {0};
        int32_t row = s->rows[s->column[j] + t];

        add_product(l, block, d);
        memcpy(block, l, sizeof l);
        s->o.mark[row] = t;
        s->o.head[row] = j;
    }
    s->source = s->column[j];
    s->phase = BLOCK_SOLVER_MULTIPLY;
    if (count > 0)
        s->block = s->column[s->rows[s->source]];
    return 1 + count;
}

/* The sums become column j of the inverse. */
static int32_t end_column(cairn_block_solver *s)
{
    int32_t j = s->at, count = s->column[j + 1] - s->column[j];
    cairn_sym3 *d = &s->diagonal[j];
    cairn_real z[9];

    full(*d, z);
    for (int32_t t = 0; t < count; t++) {
        cairn_real *block = s->blocks[s->column[j] + t];

        add_transposed_product(z, block, s->sums[t]);
        for (int k = 0; k < 9; k++)
            block[k] = -s->sums[t][k];
    }
    d->xx = z[0];
    d->yy = z[4];
    d->zz = z[8];
    d->xy = (z[1] + z[3]) / 2;
    d->xz = (z[2] + z[6]) / 2;
    d->yz = (z[5] + z[7]) / 2;
    if (!(d->xx <= CAIRN_REAL_MAX && d->yy <= CAIRN_REAL_MAX && d->zz <= CAIRN_REAL_MAX)) {
        s->result.pose = s->order[j];
        cairn_block_solver_end(s, CAIRN_BLOCK_SOLVER_NOT_POSITIVE, CAIRN_OK);
    } else if (j == 0) {
        cairn_block_solver_end(s, CAIRN_BLOCK_SOLVER_INVERTED, CAIRN_OK);
    } else {
        s->phase = BLOCK_SOLVER_SELECT;
    }
    return 1 + count;
}

/* Some blocks of column k of Z, which the block L_kj of column j multiplies. */
static int32_t multiply(cairn_block_solver *s)
{
    int32_t j = s->at, k, end, count = 0, own;
    const cairn_real *l;

    if (s->source == s->column[j + 1])
        return end_column(s);
    k = s->rows[s->source];
    l = s->blocks[s->source];
    own = s->source - s->column[j];
    end = s->column[k + 1];
    if (s->block == s->column[k]) {
        cairn_real z[9];

        full(s->diagonal[k], z);
        add_product(s->sums[own], z, l);
        count++;
    }
    for (; s->block < end && count < BLOCK_SOLVER_CHUNK; s->block++, count++) {
        int32_t row = s->rows[s->block], t = s->o.mark[row];

        if (s->o.head[row] != j)
            continue;
        add_product(s->sums[t], s->blocks[s->block], l);
        add_transposed_product(s->sums[own], s->blocks[s->block], s->blocks[s->column[j] + t]);
    }
    if (s->block == end) {
        s->source++;
        if (s->source < s->column[j + 1])
            s->block = s->column[s->rows[s->source]];
    }
    return 2 * count;
}

int32_t cairn_block_inverse_item(cairn_block_solver *s)
{
    return s->phase == BLOCK_SOLVER_SELECT ? begin_column(s) : multiply(s);
}
