/* small_matrix: symmetric 2 x 2 and 3 x 3 matrices: LDL^T solution, inverse and
 * eigendecomposition. */
#ifndef CAIRN_SMALL_MATRIX_H
#define CAIRN_SMALL_MATRIX_H

#include "cairn/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Symmetric 2 x 2 matrix [xx xy; xy yy]. */
typedef struct cairn_sym2 {
    /* entries of the upper triangle */
    cairn_real xx, xy, yy;
} cairn_sym2;

/* Symmetric 3 x 3 matrix [xx xy xz; xy yy yz; xz yz zz]. For poses z is theta. */
typedef struct cairn_sym3 {
    /* entries of the upper triangle */
    cairn_real xx, xy, xz, yy, yz, zz;
} cairn_sym3;

/* Eigendecomposition of a symmetric 2 x 2 matrix: eigenvalues in ascending order, and the unit
 * eigenvectors *minor of values[0] and *major of values[1]. A multiple of the identity gives the
 * coordinate axes.
 *
 * m: the matrix
 * values: set to the eigenvalues
 * minor, major: set to the unit eigenvectors */
void cairn_sym2_eigen(cairn_sym2 m, cairn_real values[2], cairn_vec2 *minor, cairn_vec2 *major);

/* Solves m x = b by LDL^T. Returns 1, or 0 with x unchanged when m is not positive definite to
 * rounding.
 *
 * m: positive definite matrix
 * b: right-hand side
 * x: set to the solution */
int32_t cairn_sym3_solve(cairn_sym3 m, const cairn_real b[3], cairn_real x[3]);

/* Inverse of a positive definite matrix. Returns 1, or 0 with *inverse unchanged when m is not
 * positive definite to rounding.
 *
 * m: the matrix
 * inverse: set to the inverse */
int32_t cairn_sym3_inverse(cairn_sym3 m, cairn_sym3 *inverse);

/* Eigendecomposition of a symmetric 3 x 3 matrix by Jacobi rotations, at most 12 sweeps:
 * eigenvalues in ascending order, vectors[i] the unit eigenvector of values[i].
 *
 * m: the matrix
 * values: set to the eigenvalues
 * vectors: set to the unit eigenvectors, one a row */
void cairn_sym3_eigen(cairn_sym3 m, cairn_real values[3], cairn_real vectors[3][3]);

/* The zero matrix. */
static inline cairn_sym3 cairn_sym3_zero(void)
{
    cairn_sym3 zero = {0, 0, 0, 0, 0, 0};
    return zero;
}

/* Weighted outer product (rank-one update): m += weight * v v^T.
 *
 * m: sum to which the product is added
 * v: vector
 * weight: factor of the product */
static inline void cairn_sym3_add_outer(cairn_sym3 *m, const cairn_real v[3], cairn_real weight)
{
    m->xx += weight * v[0] * v[0];
    m->xy += weight * v[0] * v[1];
    m->xz += weight * v[0] * v[2];
    m->yy += weight * v[1] * v[1];
    m->yz += weight * v[1] * v[2];
    m->zz += weight * v[2] * v[2];
}

/* Quadratic form v^T m v; with an information matrix the squared Mahalanobis length of v. */
static inline cairn_real cairn_sym3_form(cairn_sym3 m, const cairn_real v[3])
{
    return m.xx * v[0] * v[0] + m.yy * v[1] * v[1] + m.zz * v[2] * v[2] +
           2 * (m.xy * v[0] * v[1] + m.xz * v[0] * v[2] + m.yz * v[1] * v[2]);
}

#ifdef __cplusplus
}
#endif

#endif
