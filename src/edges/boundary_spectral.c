/* Spectral cue of a border: eigenvectors of the normalized Laplacian of the region graph
 * (normalized cuts).
 *
 * Method:
 * 1. The affinity of two neighbouring regions is exp(-strength / scale) for each side of their
 *    border.
 * 2. The eigenvectors of least positive eigenvalue are nearly constant within a group of regions
 *    and change across weak links (Shi and Malik 2000). They come from subspace iteration:
 *    Chebyshev polynomial filter, Gram-Schmidt orthonormalization, Rayleigh-Ritz projection with
 *    Jacobi's eigenvalue method.
 * 3. The change of each eigenvector across a border, divided by the square root of its eigenvalue,
 *    adds to the border's strength. The strength increases along closed outlines and not at a
 *    strong edge that ends within a region.
 *
 * Source: Arbelaez, Maire, Fowlkes and Malik 2011, section 3.2, there with pixels instead of
 * regions. */
#include "src/base/build.h"

#include "cairn/random.h"
#include "src/edges/boundary_work.h"

enum {
    SUBSPACE_ITERATIONS = 24,
    CHEBYSHEV_DEGREE = 10,
    JACOBI_SWEEPS = 10,
    EIGENVECTORS_USED = 8,
    BLOCK_SIZE = BOUNDARY_BLOCK_SIZE
};
/* Scale of the affinity, relative to the mean border strength. */
#define AFFINITY_SCALE CAIRN_REAL(0.5)
/* Lower bound of an eigenvalue. */
#define MIN_EIGENVALUE CAIRN_REAL(1e-6)
/* Regions and borders per work unit. */
enum { ITEMS_PER_UNIT = 8 };
/* Passes over the borders in add_spectral_strength(), beside one for each eigenvector. */
enum { STRENGTH_PASSES = 3 };

/* Returns vector i of the subspace iteration. */
static cairn_real *vector_at(const cairn_boundary *boundary, int32_t i)
{
    return boundary->spectral.vectors + (ptrdiff_t)i * boundary->region_count;
}

/* Returns the dot product of two vectors. */
static cairn_real dot(const cairn_real *u, const cairn_real *v, int32_t count)
{
    cairn_real sum = 0;

    for (int32_t i = 0; i < count; i++)
        sum += u[i] * v[i];
    return sum;
}

/* Computes to = M from, where M is the symmetrically normalized affinity matrix D^-1/2 W D^-1/2. */
static void apply_affinity(const cairn_boundary *boundary, const cairn_real *from, cairn_real *to)
{
    for (int32_t i = 0; i < boundary->region_count; i++)
        to[i] = 0;
    for (int32_t i = 0; i < boundary->border_count; i++) {
        const boundary_border *e = &boundary->borders[i];

        to[e->initial_region[0]] += e->key * from[e->initial_region[1]];
        to[e->initial_region[1]] += e->key * from[e->initial_region[0]];
    }
}

/* ---- Affinities ---- */

/* Sets the mean strength of each border, and of all borders. */
static void set_mean_strengths(cairn_boundary *boundary)
{
    cairn_real sum = 0;

    for (int32_t i = 0; i < boundary->border_count; i++) {
        boundary->borders[i].strength =
            boundary->borders[i].strength_sum / (cairn_real)boundary->borders[i].initial_length;
        sum += boundary->borders[i].strength;
    }
    boundary->spectral.mean_strength =
        sum / (cairn_real)(boundary->border_count > 0 ? boundary->border_count : 1);
}

/* Returns whether there is a spectral cue. */
static int has_cue(const cairn_boundary *boundary)
{
    return boundary->region_count >= 2 * BLOCK_SIZE && boundary->params.spectral_weight > 0 &&
           boundary->spectral.mean_strength > 0;
}

/* Sets the affinities, the inverse square roots of the degrees, and random initial vectors from
 * a fixed seed. */
static void set_affinities(cairn_boundary *boundary)
{
    cairn_random random = cairn_random_seed(1, 1);

    for (int32_t i = 0; i < boundary->region_count; i++)
        boundary->spectral.inverse_sqrt_degree[i] = 0;
    for (int32_t i = 0; i < boundary->border_count; i++) {
        boundary_border *e = &boundary->borders[i];

        e->key = cairn_exp(-e->strength / (AFFINITY_SCALE * boundary->spectral.mean_strength)) *
                 (cairn_real)e->initial_length;
        boundary->spectral.inverse_sqrt_degree[e->initial_region[0]] += e->key;
        boundary->spectral.inverse_sqrt_degree[e->initial_region[1]] += e->key;
    }
    for (int32_t i = 0; i < boundary->region_count; i++)
        boundary->spectral.inverse_sqrt_degree[i] =
            1 / cairn_sqrt(cairn_max(boundary->spectral.inverse_sqrt_degree[i], CAIRN_REAL_MIN));
    for (int32_t i = 0; i < boundary->border_count; i++)
        boundary->borders[i].key *=
            boundary->spectral.inverse_sqrt_degree[boundary->borders[i].initial_region[0]] *
            boundary->spectral.inverse_sqrt_degree[boundary->borders[i].initial_region[1]];
    for (int32_t k = 0; k < BLOCK_SIZE; k++)
        for (int32_t i = 0; i < boundary->region_count; i++)
            vector_at(boundary, k)[i] = cairn_random_uniform(&random, -1, 1);
}

/* ---- Subspace iteration ---- */

/* Applies one term of the Chebyshev recurrence to the current vector: T(k + 1) = 2 x T(k) - T(k
 * - 1), where x maps -1 ... damping_bound to -1 ... 1. */
static void chebyshev_step(cairn_boundary *boundary)
{
    cairn_real *now = vector_at(boundary, boundary->spectral.vector_index),
               *before = vector_at(boundary, BLOCK_SIZE),
               *next = vector_at(boundary, BLOCK_SIZE + 1);
    cairn_real half = (boundary->spectral.damping_bound + 1) / 2,
               middle = (boundary->spectral.damping_bound - 1) / 2,
               twice = boundary->spectral.chebyshev_term == 0 ? 1 : 2;

    apply_affinity(boundary, now, next);
    for (int32_t i = 0; i < boundary->region_count; i++) {
        cairn_real value = twice * (next[i] - middle * now[i]) / half -
                           (boundary->spectral.chebyshev_term == 0 ? 0 : before[i]);

        before[i] = now[i];
        now[i] = value;
    }
}

/* Orthonormalizes the current vector against the previous ones (Gram-Schmidt, twice for
 * accuracy). */
static void orthonormalize(const cairn_boundary *boundary)
{
    cairn_real *v = vector_at(boundary, boundary->spectral.vector_index), length;

    for (int32_t pass = 0; pass < 2; pass++) {
        for (int32_t k = 0; k < boundary->spectral.vector_index; k++) {
            const cairn_real *u = vector_at(boundary, k);
            cairn_real share = dot(u, v, boundary->region_count);

            for (int32_t i = 0; i < boundary->region_count; i++)
                v[i] -= share * u[i];
        }
        length = cairn_sqrt(dot(v, v, boundary->region_count));
        for (int32_t i = 0; i < boundary->region_count && length > 0; i++)
            v[i] /= length;
    }
}

/* Computes the current row of the projected matrix V' M V. */
static void project_vector(cairn_boundary *boundary)
{
    cairn_real *image = vector_at(boundary, BLOCK_SIZE);

    apply_affinity(boundary, vector_at(boundary, boundary->spectral.vector_index), image);
    for (int32_t k = 0; k < BLOCK_SIZE; k++)
        boundary->spectral.projected_matrix[boundary->spectral.vector_index][k] =
            dot(vector_at(boundary, k), image, boundary->region_count);
}

/* Applies one Jacobi rotation that annihilates element (p, q) of the projected matrix;
 * accumulates it in the eigenbasis. */
static void jacobi_rotate(cairn_boundary *boundary, int32_t p, int32_t q)
{
    cairn_real(*m)[BLOCK_SIZE] = boundary->spectral.projected_matrix,
    half_difference = (m[q][q] - m[p][p]) / 2, off = m[p][q], t, c, s;

    t = off /
        (cairn_abs(half_difference) + cairn_sqrt(half_difference * half_difference + off * off));
    t = half_difference < 0 ? -t : t;
    c = 1 / cairn_sqrt(1 + t * t);
    s = t * c;
    for (int32_t k = 0; k < BLOCK_SIZE; k++) {
        cairn_real x = m[k][p], y = m[k][q];

        m[k][p] = c * x - s * y;
        m[k][q] = s * x + c * y;
    }
    for (int32_t k = 0; k < BLOCK_SIZE; k++) {
        cairn_real x = m[p][k], y = m[q][k];

        m[p][k] = c * x - s * y;
        m[q][k] = s * x + c * y;
    }
    for (int32_t k = 0; k < BLOCK_SIZE; k++) {
        cairn_real x = boundary->spectral.eigenbasis[k][p], y = boundary->spectral.eigenbasis[k][q];

        boundary->spectral.eigenbasis[k][p] = c * x - s * y;
        boundary->spectral.eigenbasis[k][q] = s * x + c * y;
    }
}

/* Computes the eigenvectors of the projected matrix; order[] sorts them by decreasing
 * eigenvalue. */
static void solve_projected(cairn_boundary *boundary, int32_t order[BLOCK_SIZE])
{
    for (int32_t p = 0; p < BLOCK_SIZE; p++)
        for (int32_t q = 0; q < BLOCK_SIZE; q++) {
            boundary->spectral.eigenbasis[p][q] = p == q;
            boundary->spectral.projected_matrix[p][q] =
                p < q ? (boundary->spectral.projected_matrix[p][q] +
                         boundary->spectral.projected_matrix[q][p]) /
                            2
                      : boundary->spectral.projected_matrix[p][q];
            boundary->spectral.projected_matrix[p][q] =
                p > q ? boundary->spectral.projected_matrix[q][p]
                      : boundary->spectral.projected_matrix[p][q];
        }
    for (int32_t sweep = 0; sweep < JACOBI_SWEEPS; sweep++)
        for (int32_t p = 0; p < BLOCK_SIZE; p++)
            for (int32_t q = p + 1; q < BLOCK_SIZE; q++)
                if (boundary->spectral.projected_matrix[p][q] != 0)
                    jacobi_rotate(boundary, p, q);
    for (int32_t p = 0; p < BLOCK_SIZE; p++) {
        int32_t at = p;

        for (; at > 0 && boundary->spectral.projected_matrix[order[at - 1]][order[at - 1]] <
                             boundary->spectral.projected_matrix[p][p];
             at--)
            order[at] = order[at - 1];
        order[at] = p;
    }
}

/* Rotates the vectors to the Ritz vectors of their span and sets the eigenvalues. */
static void rotate_to_eigenvectors(cairn_boundary *boundary)
{
    int32_t order[BLOCK_SIZE] = {0};

    solve_projected(boundary, order);
    for (int32_t i = 0; i < boundary->region_count; i++) {
        cairn_real was[BLOCK_SIZE];

        for (int32_t k = 0; k < BLOCK_SIZE; k++)
            was[k] = vector_at(boundary, k)[i];
        for (int32_t k = 0; k < BLOCK_SIZE; k++) {
            cairn_real sum = 0;

            for (int32_t j = 0; j < BLOCK_SIZE; j++)
                sum += was[j] * boundary->spectral.eigenbasis[j][order[k]];
            vector_at(boundary, k)[i] = sum;
        }
    }
    for (int32_t k = 0; k < BLOCK_SIZE; k++)
        boundary->spectral.eigenvalue[k] = boundary->spectral.projected_matrix[order[k]][order[k]];
    boundary->spectral.damping_bound =
        cairn_max(0, cairn_min(boundary->spectral.eigenvalue[BLOCK_SIZE - 1], 1 - MIN_EIGENVALUE));
}

/* ---- Border strengths ---- */

/* Returns the weight of eigenvector k: 1 / sqrt(mean square over the image's pixels times its
 * Laplacian eigenvalue). */
static cairn_real eigenvector_weight(const cairn_boundary *boundary, int32_t k)
{
    cairn_real sum = 0, value = cairn_max(1 - boundary->spectral.eigenvalue[k], MIN_EIGENVALUE);

    for (int32_t i = 0; i < boundary->region_count; i++) {
        cairn_real at = boundary->spectral.inverse_sqrt_degree[i] * vector_at(boundary, k)[i];

        sum += at * at * (cairn_real)boundary->regions[i].initial_size;
    }
    return 1 / cairn_sqrt(cairn_max(sum / (cairn_real)boundary_pixels(boundary), CAIRN_REAL_MIN) *
                          value);
}

/* Adds the eigenvector changes across borders to their strengths, normalized to the mean border
 * strength. */
static void add_spectral_strength(const cairn_boundary *boundary)
{
    cairn_real sum = 0, unit;

    for (int32_t i = 0; i < boundary->border_count; i++)
        boundary->borders[i].key = 0;
    for (int32_t k = 1; k <= EIGENVECTORS_USED; k++) {
        const cairn_real *v = vector_at(boundary, k);
        cairn_real scale = eigenvector_weight(boundary, k);

        for (int32_t i = 0; i < boundary->border_count; i++) {
            boundary_border *e = &boundary->borders[i];

            e->key +=
                scale * cairn_abs(boundary->spectral.inverse_sqrt_degree[e->initial_region[0]] *
                                      v[e->initial_region[0]] -
                                  boundary->spectral.inverse_sqrt_degree[e->initial_region[1]] *
                                      v[e->initial_region[1]]);
        }
    }
    for (int32_t i = 0; i < boundary->border_count; i++)
        sum += boundary->borders[i].key;
    if (!(sum > 0))
        return;
    unit = boundary->params.spectral_weight * boundary->spectral.mean_strength *
           (cairn_real)boundary->border_count / sum;
    for (int32_t i = 0; i < boundary->border_count; i++)
        boundary->borders[i].strength += unit * boundary->borders[i].key;
}

/* ---- The phase ---- */

int cairn_boundary_add_spectral(cairn_boundary *boundary, cairn_budget *budget)
{
    int32_t region_units = boundary_ceil_divide(boundary->region_count, ITEMS_PER_UNIT),
            pass_units =
                region_units + boundary_ceil_divide(boundary->border_count, ITEMS_PER_UNIT);

    CAIRN_STEP_BEGIN(boundary->phase_resume);
    CAIRN_STEP_CHARGE(boundary, phase_resume, budget, pass_units + BLOCK_SIZE * region_units);
    set_mean_strengths(boundary);
    if (has_cue(boundary)) {
        set_affinities(boundary);
        boundary->spectral.damping_bound = 0;
        for (boundary->spectral.iteration = 0; boundary->spectral.iteration < SUBSPACE_ITERATIONS;
             boundary->spectral.iteration++) {
            for (boundary->spectral.vector_index = 0; boundary->spectral.vector_index < BLOCK_SIZE;
                 boundary->spectral.vector_index++)
                for (boundary->spectral.chebyshev_term = 0;
                     boundary->spectral.chebyshev_term < CHEBYSHEV_DEGREE;
                     boundary->spectral.chebyshev_term++) {
                    CAIRN_STEP_CHARGE(boundary, phase_resume, budget, pass_units);
                    chebyshev_step(boundary);
                }
            for (boundary->spectral.vector_index = 0; boundary->spectral.vector_index < BLOCK_SIZE;
                 boundary->spectral.vector_index++) {
                CAIRN_STEP_CHARGE(boundary, phase_resume, budget, 2 * BLOCK_SIZE * region_units);
                orthonormalize(boundary);
            }
            for (boundary->spectral.vector_index = 0; boundary->spectral.vector_index < BLOCK_SIZE;
                 boundary->spectral.vector_index++) {
                CAIRN_STEP_CHARGE(boundary, phase_resume, budget,
                                  pass_units + BLOCK_SIZE * region_units);
                project_vector(boundary);
            }
            CAIRN_STEP_CHARGE(boundary, phase_resume, budget,
                              BLOCK_SIZE * BLOCK_SIZE * region_units);
            rotate_to_eigenvectors(boundary);
        }
        CAIRN_STEP_CHARGE(boundary, phase_resume, budget,
                          (EIGENVECTORS_USED + STRENGTH_PASSES) *
                              boundary_ceil_divide(boundary->border_count, ITEMS_PER_UNIT));
        add_spectral_strength(boundary);
    }
    CAIRN_STEP_END(boundary->phase_resume);
}
