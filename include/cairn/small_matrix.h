/* small_matrix: 2 x 2 and 3 x 3 symmetric matrices: solves, inverses, eigenvectors. */
#ifndef CAIRN_SMALL_MATRIX_H
#define CAIRN_SMALL_MATRIX_H

#include "cairn/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* [xx xy; xy yy] */
typedef struct cairn_sym2 {
    cairn_real xx, xy, yy;
} cairn_sym2;

/* [xx xy xz; xy yy yz; xz yz zz]; for poses z is theta. */
typedef struct cairn_sym3 {
    cairn_real xx, xy, xz, yy, yz, zz;
} cairn_sym3;

/* Eigenvalues in ascending order with unit eigenvectors: *minor belongs to values[0], *major to
 * values[1]. Every symmetric matrix has them; of a multiple of the identity the axes are
 * returned. */
void cairn_sym2_eigen(cairn_sym2 m, cairn_real values[2], cairn_vec2 *minor, cairn_vec2 *major);

/* Solves m x = b by LDL^T. 0 and *x unchanged when m is not positive definite to rounding. */
int32_t cairn_sym3_solve(cairn_sym3 m, const cairn_real b[3], cairn_real x[3]);

/* Inverse of a positive definite m; 0 and *inverse unchanged when it is not. */
int32_t cairn_sym3_inverse(cairn_sym3 m, cairn_sym3 *inverse);

/* Eigenvalues in ascending order, vectors[i] the unit eigenvector of values[i]; Jacobi
 * rotations, at most 12 sweeps. */
void cairn_sym3_eigen(cairn_sym3 m, cairn_real values[3], cairn_real vectors[3][3]);

static inline cairn_sym3 cairn_sym3_zero(void)
{
    cairn_sym3 zero = {0, 0, 0, 0, 0, 0};
    return zero;
}

/* m += weight * v v^T */
static inline void cairn_sym3_add_outer(cairn_sym3 *m, const cairn_real v[3], cairn_real weight)
{
    m->xx += weight * v[0] * v[0];
    m->xy += weight * v[0] * v[1];
    m->xz += weight * v[0] * v[2];
    m->yy += weight * v[1] * v[1];
    m->yz += weight * v[1] * v[2];
    m->zz += weight * v[2] * v[2];
}

/* v^T m v */
static inline cairn_real cairn_sym3_form(cairn_sym3 m, const cairn_real v[3])
{
    return m.xx * v[0] * v[0] + m.yy * v[1] * v[1] + m.zz * v[2] * v[2] +
           2 * (m.xy * v[0] * v[1] + m.xz * v[0] * v[2] + m.yz * v[1] * v[2]);
}

#ifdef __cplusplus
}
#endif

#endif
