/* force_kernel: the attraction between two oriented points of different scans, and its potential.
 *
 * For points at distance r, with u the unit vector from p1 to p2 and c = |cos| of the angle between their directions:
 *
 *     force on p1     m1 m2 c exp(-r^2 / (2 sigma^2)) / (sigma sqrt(2 pi)) u        (Adluru 2008, eqs. 7.1 and 7.2)
 *     potential      -1/2 m1 m2 c erfc(r / (sigma sqrt(2)))                         (eqs. 7.4 and 7.5, one pair)
 *
 * The force is minus the gradient of the potential. Eq. 7.5 sums over ordered pairs with the factor 1/2 of eq. 7.4 (the
 * integral there is -1/2 erfc): the -1/4 of each of the two orders make the -1/2 here, so that P(g) is the sum of the
 * potentials of all pairs, each counted once, and the force on a scan is minus the gradient of P(g). */
#ifndef CAIRN_FORCE_KERNEL_H
#define CAIRN_FORCE_KERNEL_H

#include "cairn/geometry.h"
#include "cairn/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Nearer points than this, in m, exert no force: the direction between them means nothing. */
#define CAIRN_FORCE_KERNEL_NEAR CAIRN_REAL(1e-9)

/* Greatest reach in multiples of sigma. */
#define CAIRN_FORCE_KERNEL_REACH 6

/* The two formulas as they stand, without cut-off. *potential may be NULL. sigma in m, > 0. */
cairn_vec2 cairn_force_kernel_pair(cairn_oriented_point p1, cairn_oriented_point p2, cairn_real m1, cairn_real m2,
                                   cairn_real sigma, cairn_real *potential);

/* Tables and constants for many pairs; open because it is part of other objects, not to be changed by hand. */
typedef struct cairn_force_kernel {
    cairn_real coarse[20];    /* exp(-i) */
    cairn_real fine[64];      /* exp(-i / 64) */
    cairn_real erfc[69][4];   /* with x = i / 16, e = exp(-x^2): erfc(x), e, 2 x e, (2 x^2 - 1) e */
    cairn_real scale;         /* 1 / (2 sigma^2) */
    cairn_real root_scale;    /* 1 / (sigma sqrt(2)) */
    cairn_real norm;          /* 1 / (sigma sqrt(2 pi)) */
    cairn_real limit_squared; /* (reach sigma)^2 */
} cairn_force_kernel;

/* Fills the tables. */
void cairn_force_kernel_init(cairn_force_kernel *kernel);

/* Sets sigma (m, > 0) and the distance in sigma (> 0, at most CAIRN_FORCE_KERNEL_REACH) beyond which pairs do not count. */
void cairn_force_kernel_set(cairn_force_kernel *kernel, cairn_real sigma, cairn_real reach);

/* A few points side by side. */
enum { CAIRN_FORCE_STRIP = 16 };

typedef struct cairn_force_strip {
    cairn_real x[CAIRN_FORCE_STRIP], y[CAIRN_FORCE_STRIP], mass[CAIRN_FORCE_STRIP];
    int32_t count;
} cairn_force_strip;

/* How strips of points pull at one point of mass 1 and parallel direction; both without the factors that all pairs of a
 * point share: the force is norm * (x, y), the potential -1/2 potential. */
typedef struct cairn_force_pull {
    cairn_real x, y;
    cairn_real potential;
    int64_t pairs; /* within reach */
} cairn_force_pull;

/* Adds to *pull what points *next ... count-1 of a strip do to p; potentials only when with_potential. *next is -1 before
 * the first call for a strip and moves on. Relative error of a force 3e-13 (float: 3e-6), of a potential 1e-13 (3e-7) of
 * its value at distance 0. Returns CAIRN_OK when the strip is done, CAIRN_MORE when the budget is used up. Costs a unit,
 * and one for each point within reach; the sums do not depend on how the budget is split. */
CAIRN_CHECKED cairn_status cairn_force_kernel_pull(const cairn_force_kernel *kernel, cairn_vec2 p,
                                                   const cairn_force_strip *strip, int32_t *next,
                                                   int32_t with_potential, cairn_force_pull *pull,
                                                   cairn_budget *budget);

#ifdef __cplusplus
}
#endif

#endif
