/* force_kernel: the attraction between two oriented points of different scans, and its potential.
 *
 * For points at distance r, with u the unit vector from p1 to p2 and c = |cos| of the angle between
 * their directions:
 *
 *     force on p1     m1 m2 c exp(-r^2 / (2 sigma^2)) / (sigma sqrt(2 pi)) u        (Adluru 2008,
 *     eqs. 7.1 and 7.2) potential      -1/2 m1 m2 c erfc(r / (sigma sqrt(2)))
 *     (eqs. 7.4 and 7.5, one pair)
 *
 * The force is minus the gradient of the potential. Eq. 7.5 sums over ordered pairs with the
 * factor 1/2 of eq. 7.4 (the integral there is -1/2 erfc): the -1/4 of each of the two orders
 * make the -1/2 here, so that P(g) is the sum of the potentials of all pairs, each counted once,
 * and the force on a scan is minus the gradient of P(g). */
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
cairn_vec2 cairn_force_kernel_pair(cairn_oriented_point p1, cairn_oriented_point p2, cairn_real m1,
                                   cairn_real m2, cairn_real sigma, cairn_real *potential);

/* Tables and constants for many pairs; open because it is part of other objects, not to be
 * changed by hand. */
typedef struct cairn_force_kernel {
    cairn_real coarse[20];    /* exp(-i) */
    cairn_real fine[64];      /* exp(-i / 64) */
    cairn_real erfc[69][4];   /* with x = i / 16, e = exp(-x^2): erfc(x), e, 2 x e, (2 x^2 - 1) e */
    cairn_real scale;         /* 1 / (2 sigma^2) */
    cairn_real root_scale;    /* 1 / (sigma sqrt(2)) */
    cairn_real norm;          /* 1 / (sigma sqrt(2 pi)) */
    cairn_real limit_squared; /* (reach sigma)^2 */
    cairn_real least_length;  /* of a spring, sigma / 8 */
} cairn_force_kernel;

/* Fills the tables. */
void cairn_force_kernel_init(cairn_force_kernel *kernel);

/* Sets sigma (m, > 0) and the distance in sigma (> 0, at most CAIRN_FORCE_KERNEL_REACH) beyond
 * which pairs do not count. */
void cairn_force_kernel_set(cairn_force_kernel *kernel, cairn_real sigma, cairn_real reach);

/* So many points at a time. */
enum { CAIRN_FORCE_STRIP = 16 };

/* A few points in the map side by side; the arrays are the caller's. */
typedef struct cairn_force_strip {
    const cairn_vec2 *position; /* [count] */
    const cairn_real *mass;     /* [count] */
    int32_t count;              /* 0 ... CAIRN_FORCE_STRIP */
    cairn_box zone;             /* outside of it no point of any strip is within reach */
} cairn_force_strip;

/* The pairs taken as springs of rest length 0 that pull as the force does, sum over pairs of
 * masses m1 m2. For a pair: k = exp(-r^2 / (2 sigma^2)) / max(r, sigma / 8) its stiffness, d
 * from the point of the first strip to that of the second, c the middle of the two from the
 * sum's centre. A spring is no stiffer than at sigma / 8: nearer points are the same place. */
typedef struct cairn_force_springs {
    cairn_real stiffness;                       /* k */
    cairn_vec2 middle;                          /* k c */
    cairn_real middle_xx, middle_xy, middle_yy; /* k c c^T */
    cairn_vec2 pull;                            /* k d */
    cairn_real middle_pull_xx, middle_pull_xy;  /* k c.x d */
    cairn_real middle_pull_yx, middle_pull_yy;  /* k c.y d */
} cairn_force_springs;

/* What points feel from those of other scans, as if all directions were parallel and without the
 * factor `norm`; the others feel the opposite. */
typedef struct cairn_force_sum {
    cairn_vec2 force;
    /* about `centre`; for both, as a pair pulls along the line through its points */
    cairn_real torque;
    /* without the factor -1/2 */
    cairn_real potential;
    /* given */
    cairn_vec2 centre;
    /* within reach */
    int64_t pairs;
    /* given; NULL: not wanted */
    cairn_force_springs *springs;
} cairn_force_sum;

/* What a point feels from several others, for mass 1 of it; the last six fields only when
 * springs are wanted. */
typedef struct cairn_force_pull {
    cairn_real x, y, potential;
    cairn_real stiffness, spring_x, spring_y;   /* k, k d */
    cairn_real spring_xx, spring_xy, spring_yy; /* k d d^T */
} cairn_force_pull;

/* How far a sum has come; all 0 before the first call. When all is done it serves again with row
 * 0. */
typedef struct cairn_force_cursor {
    int32_t row, next;     /* point of the first strip; of the second */
    int32_t is_begun;      /* the row has been */
    int32_t paid;          /* units towards its begin */
    cairn_force_pull pull; /* of the row so far */
} cairn_force_cursor;

/* Adds to *sum what the points of strip a from the cursor on feel from strip b; potentials only
 * when with_potential, springs only when there is room for them. Relative error of a force 3e-13
 * (float: 3e-6), of a potential 1e-13 (3e-7) of its value at distance 0. Returns CAIRN_OK when
 * all rows are done, CAIRN_MORE when the budget is used up. Costs a unit for each row, one more
 * for eight points of the second strip unless the row is outside of its zone, and one for each
 * pair within reach; the sums do not depend on how the budget is split. */
CAIRN_CHECKED cairn_status cairn_force_kernel_strips(
    const cairn_force_kernel *kernel, const cairn_force_strip *a, const cairn_force_strip *b,
    cairn_force_cursor *cursor, int32_t with_potential, cairn_force_sum *sum, cairn_budget *budget);

#ifdef __cplusplus
}
#endif

#endif
