/* The pair loop of force field simulation.
 *
 * Method: exp(-s) = exp(-i) exp(-j/32) exp(-d) with s = i + j/32 + d, from two tables and a short Taylor series; s is at
 * most reach^2 / 2 = 18, so neither underflow nor scaling can occur. The potential takes erfc(x) = erfc(x0) - 2/sqrt(pi)
 * times the integral of exp(-t^2) from the nearest node x0 of a table to x, by the two-point Hermite rule with two
 * derivatives, whose end values are in the table and at hand: no second exponential.
 *
 * Source: Adluru 2008, section 7.3.1. */
#include "src/core/build.h"

#include "cairn/force_kernel.h"

enum { COARSE = 20, FINE = 32, NODES = 69 };

/* 1 / sqrt(2 pi), 1 / sqrt(2), 1 / sqrt(pi) */
#define INVERSE_SQRT_2PI CAIRN_REAL(0.39894228040143267794)
#define INVERSE_SQRT_2   CAIRN_REAL(0.70710678118654752440)
#define INVERSE_SQRT_PI  CAIRN_REAL(0.56418958354775628695)

cairn_vec2 cairn_force_kernel_pair(cairn_oriented_point p1, cairn_oriented_point p2, cairn_real m1, cairn_real m2,
                                   cairn_real sigma, cairn_real *potential)
{
    cairn_vec2 to = cairn_vec2_sub(p2.position, p1.position), none = {0, 0};
    cairn_real r = cairn_vec2_norm(to);
    cairn_real weight = m1 * m2 * cairn_abs(cairn_vec2_dot(p1.direction, p2.direction));
    cairn_real strength = weight * cairn_exp(-r * r / (2 * sigma * sigma)) * INVERSE_SQRT_2PI / sigma;

    if (potential != NULL)
        *potential = -weight / 2 * cairn_erfc(r * INVERSE_SQRT_2 / sigma);
    return r < CAIRN_FORCE_KERNEL_NEAR ? none : cairn_vec2_scale(to, strength / r);
}

void cairn_force_kernel_init(cairn_force_kernel *kernel)
{
    for (int32_t i = 0; i < COARSE; i++)
        kernel->coarse[i] = cairn_exp(-(cairn_real)i);
    for (int32_t i = 0; i < FINE; i++)
        kernel->fine[i] = cairn_exp(-(cairn_real)i / FINE);
    for (int32_t i = 0; i < NODES; i++) {
        cairn_real x = (cairn_real)i / 16;

        kernel->erfc[i][0] = cairn_erfc(x);
        kernel->erfc[i][1] = cairn_exp(-x * x);
    }
    cairn_force_kernel_set(kernel, 1, CAIRN_FORCE_KERNEL_REACH);
}

void cairn_force_kernel_set(cairn_force_kernel *kernel, cairn_real sigma, cairn_real reach)
{
    kernel->scale = 1 / (2 * sigma * sigma);
    kernel->norm = INVERSE_SQRT_2PI / sigma;
    kernel->limit_squared = reach * sigma * (reach * sigma);
}

/* exp(-s), 0 <= s < COARSE. */
static inline cairn_real decay(const cairn_force_kernel *kernel, cairn_real s)
{
    int32_t k = cairn_real_to_int(s * FINE);
    cairn_real d = s - (cairn_real)k / FINE; /* 0 ... 1/32 */
    cairn_real series;

    CAIRN_ASSERT(k >= 0 && k < COARSE * FINE);
#ifdef CAIRN_FLOAT
    series = 1 - d * (1 - d * (CAIRN_REAL(1.0) / 2 - d * (CAIRN_REAL(1.0) / 6)));
#else
    series =
        1 - d * (1 - d * (CAIRN_REAL(1.0) / 2 -
                          d * (CAIRN_REAL(1.0) / 6 - d * (CAIRN_REAL(1.0) / 24 -
                                                          d * (CAIRN_REAL(1.0) / 120 - d * (CAIRN_REAL(1.0) / 720))))));
#endif
    return kernel->coarse[k / FINE] * (kernel->fine[k % FINE] * series);
}

/* erfc(x), 0 <= x < NODES / 16, with e = exp(-x^2). */
static inline cairn_real complementary(const cairn_force_kernel *kernel, cairn_real x, cairn_real e)
{
    int32_t k = cairn_real_to_int(x * 16 + CAIRN_REAL(0.5));
    cairn_real x0 = (cairn_real)k / 16, d = x - x0, integral;
    const cairn_real *node;

    CAIRN_ASSERT(k >= 0 && k < NODES);
    node = kernel->erfc[k];
    integral = d * ((node[1] + e) +
                    d / 5 * (2 * (x * e - x0 * node[1]) + d / 6 * ((2 * x0 * x0 - 1) * node[1] + (2 * x * x - 1) * e)));
    return node[0] - INVERSE_SQRT_PI * integral;
}

cairn_status cairn_force_kernel_row(const cairn_force_kernel *kernel, const cairn_force_points *points, int32_t i,
                                    int32_t *next, int32_t end, cairn_real c, int32_t with_potential,
                                    cairn_force_sum *sum, cairn_budget *budget)
{
    const cairn_vec2 *restrict position = points->position;
    const cairn_real *restrict mass = points->mass;
    cairn_vec2 *restrict force = points->force;
    cairn_vec2 p = position[i], f = force[i];
    cairn_real weight = mass[i] * c, limit = kernel->limit_squared;
    int32_t j = *next;

    while (j < end && budget->left > 0) {
        int32_t stop = end - j > 4 ? j + 4 : end;

        budget->left--;
        for (; j < stop; j++) {
            cairn_vec2 to = cairn_vec2_sub(position[j], p);
            cairn_real square = cairn_vec2_norm_squared(to), r, e, w;

            if (square > limit)
                continue;
            budget->left--;
            sum->pairs++;
            r = cairn_sqrt(square);
            e = decay(kernel, square * kernel->scale);
            w = weight * mass[j];
            if (with_potential)
                sum->potential -= w / 2 * complementary(kernel, cairn_sqrt(square * kernel->scale), e);
            if (r < CAIRN_FORCE_KERNEL_NEAR)
                continue;
            to = cairn_vec2_scale(to, w * kernel->norm * e / r);
            f = cairn_vec2_add(f, to);
            force[j] = cairn_vec2_sub(force[j], to);
        }
    }
    force[i] = f;
    *next = j;
    return j < end ? CAIRN_MORE : CAIRN_OK;
}
