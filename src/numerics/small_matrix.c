/* Closed-form eigendecomposition of 2 x 2 matrices, LDL^T and Jacobi rotations of 3 x 3 matrices,
 * LDL^T of packed lower triangles.
 *
 * Source: Golub and Van Loan, Matrix computations (LDL^T, cyclic Jacobi). */
#include "src/base/build.h"

#include "cairn/small_matrix.h"

extern inline void cairn_sym3_times(cairn_sym3 m, const cairn_real v[3], cairn_real product[3]);
extern inline cairn_sym3 cairn_sym3_rotate(cairn_sym3 m, cairn_real sine, cairn_real cosine);
extern inline void cairn_sym3_add_outer(cairn_sym3 *m, const cairn_real v[3], cairn_real weight);
extern inline cairn_real cairn_sym3_form(cairn_sym3 m, const cairn_real v[3]);

void cairn_sym2_eigen(cairn_sym2 m, cairn_real values[2], cairn_vec2 *minor, cairn_vec2 *major)
{
    cairn_real mean = (m.xx + m.yy) / 2, half = (m.xx - m.yy) / 2;
    cairn_real radius = cairn_sqrt(half * half + m.xy * m.xy);
    cairn_vec2 axis = {1, 0};

    /* Major axis by the larger of two equivalent expressions, which avoids cancellation. */
    if (radius > 0) {
        if (half >= 0) {
            axis.x = radius + half;
            axis.y = m.xy;
        } else {
            axis.x = m.xy;
            axis.y = radius - half;
        }
        axis = cairn_vec2_unit(axis);
    }
    values[0] = mean - radius;
    values[1] = mean + radius;
    *major = axis;
    *minor = cairn_vec2_left_perp(axis);
}

/* Factorization m = L D L^T with unit lower triangular L. 0 when a pivot is not positive to
 * rounding. */
static int factor_ldlt(cairn_sym3 m, cairn_real l[3], cairn_real d[3])
{
    cairn_real scale = cairn_max(m.xx, cairn_max(m.yy, m.zz));
    cairn_real least_pivot = scale * (8 * CAIRN_REAL_EPSILON) * CAIRN_REAL_EPSILON;

    d[0] = m.xx;
    if (!(d[0] > least_pivot))
        return 0;
    l[0] = m.xy / d[0];
    l[1] = m.xz / d[0];
    d[1] = m.yy - l[0] * m.xy;
    if (!(d[1] > least_pivot) || !(d[1] > 4 * CAIRN_REAL_EPSILON * m.yy))
        return 0;
    l[2] = (m.yz - l[1] * m.xy) / d[1];
    d[2] = m.zz - l[1] * m.xz - l[2] * (m.yz - l[1] * m.xy);
    return d[2] > least_pivot && d[2] > 4 * CAIRN_REAL_EPSILON * m.zz && d[2] <= CAIRN_REAL_MAX;
}

/* Solution of L D L^T x = b by forward and backward substitution. */
static void substitute(const cairn_real l[3], const cairn_real d[3], const cairn_real b[3],
                       cairn_real x[3])
{
    cairn_real y0 = b[0];
    cairn_real y1 = b[1] - l[0] * y0;
    cairn_real y2 = b[2] - l[1] * y0 - l[2] * y1;

    x[2] = y2 / d[2];
    x[1] = y1 / d[1] - l[2] * x[2];
    x[0] = y0 / d[0] - l[0] * x[1] - l[1] * x[2];
}

int32_t cairn_sym3_solve(cairn_sym3 m, const cairn_real b[3], cairn_real x[3])
{
    cairn_real l[3], d[3];

    if (!factor_ldlt(m, l, d))
        return 0;
    substitute(l, d, b, x);
    return 1;
}

int32_t cairn_sym3_inverse(cairn_sym3 m, cairn_sym3 *inverse)
{
    static const cairn_real unit[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    cairn_real l[3], d[3], columns[3][3];

    if (!factor_ldlt(m, l, d))
        return 0;
    for (int i = 0; i < 3; i++)
        substitute(l, d, unit[i], columns[i]);
    inverse->xx = columns[0][0];
    inverse->xy = columns[1][0];
    inverse->xz = columns[2][0];
    inverse->yy = columns[1][1];
    inverse->yz = columns[2][1];
    inverse->zz = columns[2][2];
    return 1;
}

int32_t cairn_sym_solve(cairn_real *a, int32_t n, cairn_real least_pivot, cairn_real *x)
{
    /* Rows of L, with D in place of its diagonal of ones, and L y = b. */
    for (int32_t i = 0; i < n; i++) {
        cairn_real *row = &a[cairn_sym_element(i, 0)], diagonal = row[i];

        for (int32_t k = 0; k <= i; k++) {
            for (int32_t j = 0; j < k; j++)
                row[k] -= row[j] * a[cairn_sym_element(k, j)] * a[cairn_sym_element(j, j)];
            if (k < i)
                row[k] /= a[cairn_sym_element(k, k)];
        }
        if (!(row[i] > least_pivot * diagonal))
            return 0;
        for (int32_t k = 0; k < i; k++)
            x[i] -= row[k] * x[k];
    }
    /* L^T x = D^-1 y. */
    for (int32_t i = n - 1; i >= 0; i--) {
        x[i] /= a[cairn_sym_element(i, i)];
        for (int32_t k = i + 1; k < n; k++)
            x[i] -= a[cairn_sym_element(k, i)] * x[k];
    }
    return 1;
}

cairn_sym3 cairn_sym3_rotate_by(cairn_sym3 m, cairn_real angle)
{
    cairn_real sine, cosine;

    cairn_sincos(angle, &sine, &cosine);
    return cairn_sym3_rotate(m, sine, cosine);
}

void cairn_sym3_eigen(cairn_sym3 m, cairn_real values[3], cairn_real vectors[3][3])
{
    cairn_real a[3][3] = {{m.xx, m.xy, m.xz}, {m.xy, m.yy, m.yz}, {m.xz, m.yz, m.zz}};
    /* Product of the rotations: its columns become the eigenvectors. */
    cairn_real v[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    int order[3] = {0, 1, 2};

    for (int sweep = 0; sweep < 12; sweep++) {
        if (a[0][1] == 0 && a[0][2] == 0 && a[1][2] == 0)
            break;
        for (int p = 0; p < 2; p++) {
            for (int q = p + 1; q < 3; q++) {
                cairn_real theta, t, c, s;
                int r = 3 - p - q;

                if (a[p][q] == 0)
                    continue;
                theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
                t = 1 / (cairn_abs(theta) + cairn_sqrt(theta * theta + 1));
                if (theta < 0)
                    t = -t;
                c = 1 / cairn_sqrt(t * t + 1);
                s = t * c;
                a[p][p] -= t * a[p][q];
                a[q][q] += t * a[p][q];
                a[p][q] = a[q][p] = 0;
                {
                    cairn_real rp = a[r][p], rq = a[r][q];

                    a[r][p] = a[p][r] = c * rp - s * rq;
                    a[r][q] = a[q][r] = s * rp + c * rq;
                }
                for (int i = 0; i < 3; i++) {
                    cairn_real ip = v[i][p], iq = v[i][q];

                    v[i][p] = c * ip - s * iq;
                    v[i][q] = s * ip + c * iq;
                }
            }
        }
    }
    /* Insertion sort by eigenvalue. */
    for (int i = 1; i < 3; i++)
        for (int j = i; j > 0 && a[order[j]][order[j]] < a[order[j - 1]][order[j - 1]]; j--) {
            int swap = order[j];

            order[j] = order[j - 1];
            order[j - 1] = swap;
        }
    for (int i = 0; i < 3; i++) {
        values[i] = a[order[i]][order[i]];
        for (int k = 0; k < 3; k++)
            vectors[i][k] = v[k][order[i]];
    }
}
