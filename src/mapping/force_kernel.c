/* The pair loop of force field simulation.
 *
 * Method: exp(-s) = exp(-i) exp(-j/64) exp(d) with s = i + j/64 - d, from two tables and a short Taylor series; s is at
 * most reach^2 / 2 = 18, so neither underflow nor scaling can occur. The potential takes erfc(x) = erfc(x0) - 2/sqrt(pi)
 * times the integral of exp(-t^2) from the nearest node x0 of a table to x, by the two-point Hermite rule with two
 * derivatives, whose end values are in the table and at hand: no second exponential.
 *
 * Source: Adluru 2008, section 7.3.1. */
#include "src/core/build.h"

#include "cairn/force_kernel.h"

enum { COARSE = 20, FINE = 64, NODES = 69 };

/* 1 / sqrt(2 pi), 1 / sqrt(2), 1 / sqrt(pi) */
#define INVERSE_SQRT_2PI CAIRN_REAL(0.39894228040143267794)
#define INVERSE_SQRT_2   CAIRN_REAL(0.70710678118654752440)
#define FIFTH            (CAIRN_REAL(1.0) / 5)
#define SIXTH            (CAIRN_REAL(1.0) / 6)
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
    kernel->root_scale = INVERSE_SQRT_2 / sigma;
    kernel->norm = INVERSE_SQRT_2PI / sigma;
    kernel->limit_squared = reach * sigma * (reach * sigma);
}

/* exp(-s), 0 <= s < COARSE - 1. */
static inline cairn_real decay(const cairn_force_kernel *kernel, cairn_real s)
{
    uint32_t k = (uint32_t)cairn_real_to_int(s * FINE + CAIRN_REAL(0.5));
    cairn_real d = (cairn_real)(int32_t)k * (CAIRN_REAL(1.0) / FINE) - s; /* within 1/128 */
    cairn_real series;

    CAIRN_ASSERT(k < COARSE * FINE);
#ifdef CAIRN_FLOAT
    series = 1 + (d + d * d * CAIRN_REAL(0.5));
#else
    series = 1 + (d + d * d * (CAIRN_REAL(1.0) / 2 + d * (CAIRN_REAL(1.0) / 6 + d * (CAIRN_REAL(1.0) / 24))));
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
    cairn_real limit = kernel->limit_squared, scale = kernel->scale;
    cairn_real weight = mass[i] * c, strength = weight * kernel->norm, potential = sum->potential;
    int32_t j = *next, left = budget->left, pairs = 0;

    while (j < end && left > 0) {
        int32_t stop = end - j > 4 ? j + 4 : end, before = pairs;

        for (; j < stop; j++) {
            cairn_real x = position[j].x - p.x, y = position[j].y - p.y, square = x * x + y * y, r, e, v;

            if (square > limit)
                continue;
            pairs++;
            r = cairn_sqrt(square);
            e = decay(kernel, square * scale);
            if (with_potential)
                potential -= weight * mass[j] / 2 * complementary(kernel, r * kernel->root_scale, e);
            if (r < CAIRN_FORCE_KERNEL_NEAR)
                continue;
            v = strength * mass[j] * e / r;
            f.x += v * x;
            f.y += v * y;
            force[j].x -= v * x;
            force[j].y -= v * y;
        }
        left -= 1 + pairs - before;
    }
    force[i] = f;
    sum->potential = potential;
    sum->pairs += pairs;
    budget->left = left;
    *next = j;
    return j < end ? CAIRN_MORE : CAIRN_OK;
}
