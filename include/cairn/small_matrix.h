/* small_matrix: symmetric 2 x 2 and 3 x 3 matrices: LDL^T solution, inverse, rotation and
 * eigendecomposition; LDL^T solution of small symmetric systems of any size. */
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

/* Index of an element of a lower triangle that is stored row by row.
 *
 * row, column: column <= row */
static inline int32_t cairn_sym_element(int32_t row, int32_t column)
{
    return row * (row + 1) / 2 + column;
}

/* Solves a x = b by LDL^T for a positive definite matrix of a few rows. Returns 1, or 0 with x of no
 * meaning when a pivot is not above its diagonal entry times least_pivot. Cost: about n^3 / 6
 * multiplications.
 *
 * a: [n (n + 1) / 2] lower triangle, row by row; overwritten by the factors
 * n: number of rows
 * least_pivot: least share of a pivot in its diagonal entry, >= 0
 * x: [n] the right-hand side b, in whose place the solution is written */
int32_t cairn_sym_solve(cairn_real *a, int32_t n, cairn_real least_pivot, cairn_real *x);

/* Rotation R m R^T of a covariance or an information matrix of a pose; z stays.
 *
 * m: the matrix
 * angle: rad */
cairn_sym3 cairn_sym3_rotate_by(cairn_sym3 m, cairn_real angle);

/* Dot product of two vectors of three entries. */
static inline cairn_real cairn_dot3(const cairn_real a[3], const cairn_real b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* The zero matrix. */
static inline cairn_sym3 cairn_sym3_zero(void)
{
    cairn_sym3 zero = {0, 0, 0, 0, 0, 0};
    return zero;
}

/* Upper triangle of a 3 x 3 matrix, which is symmetric.
 *
 * full: entries of the matrix, row by row */
static inline cairn_sym3 cairn_sym3_of_full(const cairn_real full[9])
{
    cairn_sym3 m = {full[0], full[1], full[2], full[4], full[5], full[8]};
    return m;
}

/* Writes all nine entries.
 *
 * m: the matrix
 * full: set to the entries, row by row */
static inline void cairn_sym3_to_full(cairn_sym3 m, cairn_real full[9])
{
    full[0] = m.xx;
    full[1] = full[3] = m.xy;
    full[2] = full[6] = m.xz;
    full[4] = m.yy;
    full[5] = full[7] = m.yz;
    full[8] = m.zz;
}

/* Sum a + b. */
static inline cairn_sym3 cairn_sym3_add(cairn_sym3 a, cairn_sym3 b)
{
    cairn_sym3 sum = {a.xx + b.xx, a.xy + b.xy, a.xz + b.xz, a.yy + b.yy, a.yz + b.yz, a.zz + b.zz};
    return sum;
}

/* Product of m and a factor. */
static inline cairn_sym3 cairn_sym3_scale(cairn_sym3 m, cairn_real factor)
{
    cairn_sym3 product = {m.xx * factor, m.xy * factor, m.xz * factor,
                          m.yy * factor, m.yz * factor, m.zz * factor};
    return product;
}

/* Product m v.
 *
 * m: the matrix
 * v: vector
 * product: set to m v; another array than v */
inline void cairn_sym3_times(cairn_sym3 m, const cairn_real v[3], cairn_real product[3])
{
    product[0] = m.xx * v[0] + m.xy * v[1] + m.xz * v[2];
    product[1] = m.xy * v[0] + m.yy * v[1] + m.yz * v[2];
    product[2] = m.xz * v[0] + m.yz * v[1] + m.zz * v[2];
}

/* Rotation R m R^T of a covariance or an information matrix of a pose; R rotates x and y by an
 * angle, and leaves z.
 *
 * m: the matrix
 * sine, cosine: of the angle */
inline cairn_sym3 cairn_sym3_rotate(cairn_sym3 m, cairn_real sine, cairn_real cosine)
{
    cairn_real s = sine, c = cosine;
    cairn_sym3 rotated;

    rotated.xx = c * c * m.xx - 2 * c * s * m.xy + s * s * m.yy;
    rotated.yy = s * s * m.xx + 2 * c * s * m.xy + c * c * m.yy;
    rotated.xy = c * s * (m.xx - m.yy) + (c * c - s * s) * m.xy;
    rotated.xz = c * m.xz - s * m.yz;
    rotated.yz = s * m.xz + c * m.yz;
    rotated.zz = m.zz;
    return rotated;
}

/* Weighted outer product (rank-one update): m += weight * v v^T.
 *
 * m: sum to which the product is added
 * v: vector
 * weight: factor of the product */
inline void cairn_sym3_add_outer(cairn_sym3 *m, const cairn_real v[3], cairn_real weight)
{
    m->xx += weight * v[0] * v[0];
    m->xy += weight * v[0] * v[1];
    m->xz += weight * v[0] * v[2];
    m->yy += weight * v[1] * v[1];
    m->yz += weight * v[1] * v[2];
    m->zz += weight * v[2] * v[2];
}

/* Quadratic form v^T m v. With an information matrix it is the squared Mahalanobis length of v.
 *
 * m: the matrix
 * v: vector */
inline cairn_real cairn_sym3_form(cairn_sym3 m, const cairn_real v[3])
{
    return m.xx * v[0] * v[0] + m.yy * v[1] * v[1] + m.zz * v[2] * v[2] +
           2 * (m.xy * v[0] * v[1] + m.xz * v[0] * v[2] + m.yz * v[1] * v[2]);
}

#ifdef __cplusplus
}
#endif

#endif
