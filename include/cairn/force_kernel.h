/* force_kernel: attraction between two oriented points of different scans, and its potential.
 *
 * For points at distance r, with u the unit vector from p1 to p2 and c = |cos| of the angle between
 * their directions:
 *
 *     force on p1   m1 m2 c exp(-r^2 / (2 sigma^2)) / (sigma sqrt(2 pi)) u  (Adluru 2008, 7.1, 7.2)
 *     potential     -1/2 m1 m2 c erfc(r / (sigma sqrt(2)))            (7.4 and 7.5, one pair)
 *
 * The force is minus the gradient of the potential. Eq. 7.5 sums over ordered pairs with the factor
 * 1/2 of eq. 7.4 (the integral there is -1/2 erfc). The -1/4 of each of the two orders give the
 * -1/2 here. So P(g) is the sum of the potentials of all pairs, each counted once, and the force on
 * a scan is minus the gradient of P(g). */
#ifndef CAIRN_FORCE_KERNEL_H
#define CAIRN_FORCE_KERNEL_H

#include "cairn/geometry.h"
#include "cairn/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* m: points closer than this exert no force, since the direction between them is undefined. */
#define CAIRN_FORCE_KERNEL_MIN_DISTANCE_M CAIRN_REAL(1e-9)

/* Maximum cut-off distance in multiples of sigma. */
#define CAIRN_FORCE_KERNEL_MAX_REACH 6

/* Returns the force on p1 by the formulas above, without cut-off; *potential may be NULL. sigma in
 * m, > 0.
 *
 * p1, p2: the points, m
 * m1, m2: their masses
 * sigma: m, > 0
 * potential: set to the potential; NULL: not wanted */
cairn_vec2 cairn_force_kernel_pair(cairn_oriented_point p1, cairn_oriented_point p2, cairn_real m1,
                                   cairn_real m2, cairn_real sigma, cairn_real *potential);

/* Tables and constants for many pairs. Visible because other objects contain it; read-only for
 * callers. */
typedef struct cairn_force_kernel {
    cairn_real exp_integer[20];  /* exp(-i) */
    cairn_real exp_fraction[64]; /* exp(-i / 64) */
    cairn_real erfc[69][4];   /* with x = i / 16, e = exp(-x^2): erfc(x), e, 2 x e, (2 x^2 - 1) e */
    cairn_real scale;         /* 1 / (2 sigma^2) */
    cairn_real root_scale;    /* 1 / (sigma sqrt(2)) */
    cairn_real norm;          /* 1 / (sigma sqrt(2 pi)) */
    cairn_real limit_squared; /* (reach sigma)^2 */
    cairn_real min_spring_length; /* m: minimum spring length, sigma / 8 */
} cairn_force_kernel;

/* Fills in the tables.
 *
 * kernel: tables to be filled in */
void cairn_force_kernel_init(cairn_force_kernel *kernel);

/* Sets sigma (m, > 0) and the cut-off distance in sigma (> 0, at most
 * CAIRN_FORCE_KERNEL_MAX_REACH). Where the square of sigma, or its inverse, overflows nothing is
 * within reach.
 *
 * kernel: initialized tables
 * sigma: m, > 0
 * reach: in sigma, > 0, <= CAIRN_FORCE_KERNEL_MAX_REACH */
void cairn_force_kernel_set(cairn_force_kernel *kernel, cairn_real sigma, cairn_real reach);

/* Size of a strip. */
enum {
    /* maximum number of points */
    CAIRN_FORCE_STRIP_POINTS = 16
};

/* A strip: a few points in the map with similar direction; the arrays are the caller's. */
typedef struct cairn_force_kernel_strip {
    const cairn_vec2 *position; /* [count] */
    const cairn_real *mass;     /* [count] */
    int32_t count;              /* 0 ... CAIRN_FORCE_STRIP_POINTS */
    cairn_box reach_box;        /* no point of any strip is within reach outside of it */
} cairn_force_kernel_strip;

/* Sums over pairs as springs of rest length 0 with the same force, weighted by m1 m2. For a pair: k
 * = exp(-r^2 / (2 sigma^2)) / max(r, sigma / 8) is its stiffness, d the vector from the point of
 * the first strip to that of the second, c their midpoint relative to the sum's centre. The
 * stiffness is bounded at sigma / 8, below which points coincide. */
typedef struct cairn_force_kernel_springs {
    cairn_real stiffness;                       /* k */
    cairn_vec2 middle;                          /* k c */
    cairn_real middle_xx, middle_xy, middle_yy; /* k c c^T */
    cairn_vec2 pull;                            /* k d */
    cairn_real middle_pull_xx, middle_pull_xy;  /* k c.x d */
    cairn_real middle_pull_yx, middle_pull_yy;  /* k c.y d */
} cairn_force_kernel_springs;

/* Sums over pairs for the points of the first strip, as if all directions were parallel and without
 * the factor `norm`; those of the second strip get the opposite. */
typedef struct cairn_force_kernel_sum {
    /* sum of the forces on the first strip */
    cairn_vec2 force;
    /* about `centre`; equal for both strips, since a pair's force acts along the line through its
     * points */
    cairn_real torque;
    /* without the factor -1/2 */
    cairn_real potential;
    /* input */
    cairn_vec2 centre;
    /* pairs within reach */
    int64_t pairs;
    /* input; NULL: not computed */
    cairn_force_kernel_springs *springs;
} cairn_force_kernel_sum;

/* Sums for one point of mass 1 over several others; the last six fields only for springs. */
typedef struct cairn_force_kernel_pull {
    /* sum of the forces in x and y, and of the potentials */
    cairn_real x, y, potential;
    cairn_real stiffness, spring_x, spring_y;   /* k, k d */
    cairn_real spring_xx, spring_xy, spring_yy; /* k d d^T */
} cairn_force_kernel_pull;

/* Progress of a sum; all 0 before the first call. After completion it may be reused with row 0. */
typedef struct cairn_force_kernel_cursor {
    int32_t row, next;            /* point of the first strip, and of the second */
    int32_t is_begun;             /* the row has been begun */
    int32_t units_charged;        /* units charged towards its beginning */
    cairn_force_kernel_pull pull; /* of the row so far */
} cairn_force_kernel_cursor;

/* Adds to *sum the effect of strip b on the points of strip a from the cursor on; potentials only
 * when with_potential, springs only when sum->springs is not NULL. Relative error of a force 3e-13
 * (float: 3e-6), of a potential 1e-13 (3e-7) of its value at distance 0. CAIRN_OK: all rows are
 * done. CAIRN_MORE: the budget is used up. Costs a unit for each row, one more for eight points of
 * the second strip unless the row is outside its reach_box, and one for each pair within reach. The
 * sums do not depend on how the budget is split.
 *
 * kernel: tables, set for sigma
 * a, b: the strips
 * cursor: position in the pairs, advanced
 * with_potential: not 0: potentials are summed
 * sum: sums to which the effect is added */
CAIRN_CHECKED cairn_status cairn_force_kernel_strips(
    const cairn_force_kernel *kernel, const cairn_force_kernel_strip *a,
    const cairn_force_kernel_strip *b, cairn_force_kernel_cursor *cursor, int32_t with_potential,
    cairn_force_kernel_sum *sum, cairn_budget *budget);

#ifdef __cplusplus
}
#endif

#endif
