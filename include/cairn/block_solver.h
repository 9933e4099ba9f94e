/* block_solver: sparse symmetric systems of poses in fixed memory: ordering, LDL^T, solutions and
 * covariances.
 *
 * H x = b with one 3 x 3 block per pose on the diagonal and one per link between two poses beside
 * it, as normal equations of pose graphs have. In this order, each part a sequence of bounded
 * steps:
 *
 *   begin, add_link ...                  which poses are linked
 *   analyze, step                        finds an order of elimination, and how many blocks the
 *   factor will have clear, add_pose_block, add_link_block ...   values; again for every new system
 *   of the same structure factor, step                         H = L D L^T, or the first pose that
 *   makes H not positive definite solve, step, solution                as often as wanted invert,
 *   step, covariance             blocks of H^-1: those of the poses and those of the links
 *
 * Only one part runs at a time: while step() has work left, all others but read() return
 * CAIRN_BAD_ARGUMENT. */
#ifndef CAIRN_BLOCK_SOLVER_H
#define CAIRN_BLOCK_SOLVER_H

#include "cairn/pool.h"
#include "cairn/small_matrix.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_block_solver cairn_block_solver;

typedef struct cairn_block_solver_params {
    /* 1 ... 2^22 */
    int32_t max_poses;
    /* 0 ... 2^24, repeated ones counted */
    int32_t max_links;
    /* 0 ... 2^26 blocks of the factor beside the diagonal; memory grows by 9 cairn_real and an
     * int32_t for each. Graphs of robots that drive through corridors take 2 to 6 for each link. */
    int32_t max_fill;
} cairn_block_solver_params;

/* 1000 poses, 3000 links, 12000 blocks. */
cairn_block_solver_params cairn_block_solver_default(void);

typedef int32_t cairn_block_solver_state;
enum {
    /* no structure yet, or one that is being given */
    CAIRN_BLOCK_SOLVER_NEW = 0,
    /* values may be added */
    CAIRN_BLOCK_SOLVER_ANALYZED = 1,
    /* solve() and invert() may be called */
    CAIRN_BLOCK_SOLVER_FACTORED = 2,
    /* H is not positive definite to rounding, see `pose`; clear() goes on */
    CAIRN_BLOCK_SOLVER_NOT_POSITIVE = 3,
    /* covariance() may be called; the factor is gone, clear() goes on */
    CAIRN_BLOCK_SOLVER_INVERTED = 4
};

typedef struct cairn_block_solver_result {
    /* after the last part that ended */
    cairn_block_solver_state state;
    /* 1 while step() has work left */
    int32_t running;
    int32_t poses, links;
    /* blocks of the factor beside the diagonal, also when they do not fit; INT32_MAX: or more */
    int32_t fill;
    /* NOT_POSITIVE: where elimination stopped, a pose whose part is not fixed by those before;
     * else -1 */
    int32_t pose;
    /* spent by step() in all */
    int64_t units;
} cairn_block_solver_result;

/* 0 for params that create() would refuse. */
size_t cairn_block_solver_memory(const cairn_block_solver_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_block_solver_create(cairn_block_solver **solver, cairn_pool *pool,
                                                     const cairn_block_solver_params *params);

/* Forgets everything, also a part that runs, and begins a structure of poses 0 ... poses-1.
 * CAIRN_BAD_ARGUMENT: poses < 1. CAIRN_FULL: poses > max_poses. */
CAIRN_CHECKED cairn_status cairn_block_solver_begin(cairn_block_solver *solver, int32_t poses);

/* Links two different poses. Links are numbered in the order in which they are added; a pair
 * that is linked again shares its block. CAIRN_BAD_ARGUMENT: no such pose, first == second, or
 * the structure has been analyzed. CAIRN_FULL. */
CAIRN_CHECKED cairn_status cairn_block_solver_add_link(cairn_block_solver *solver, int32_t first,
                                                       int32_t second);

/* Starts to order and count; all values are 0 afterwards. The step that ends it returns
 * CAIRN_FULL when the factor would have more than max_fill blocks, `fill` tells how many: the
 * structure stays, and only extend() and begin() go on. CAIRN_BAD_ARGUMENT: no structure, or it
 * has been analyzed. Cost: on graphs in the plane about as `fill` (measured, docs/accuracy.md). */
CAIRN_CHECKED cairn_status cairn_block_solver_analyze(cairn_block_solver *solver);

/* Takes room for max_fill blocks in place of that which was too small, which stays taken, from a
 * pool whose memory must stay, and goes on: what analyze() has found is kept. So the memory can
 * be what the graph needs: begin with max_fill of 0, and read `fill`. CAIRN_BAD_ARGUMENT: no
 * step has just returned CAIRN_FULL, max_fill is less than `fill` or above 2^26.
 * CAIRN_NO_MEMORY: the pool has less than extend_memory() bytes; nothing has changed. */
CAIRN_CHECKED cairn_status cairn_block_solver_extend(cairn_block_solver *solver, cairn_pool *pool,
                                                     int32_t max_fill);

/* 0 for a max_fill that extend() would refuse in any case. */
size_t cairn_block_solver_extend_memory(int32_t max_fill);

/* Sets all values to 0. CAIRN_BAD_ARGUMENT: not analyzed. Cost: a linear pass over poses and
 * fill. */
CAIRN_CHECKED cairn_status cairn_block_solver_clear(cairn_block_solver *solver);

/* Adds to the diagonal block of a pose. CAIRN_BAD_ARGUMENT: no such pose, or state is not
 * ANALYZED. CAIRN_NOT_FINITE. */
CAIRN_CHECKED cairn_status cairn_block_solver_add_pose_block(cairn_block_solver *solver,
                                                             int32_t pose, cairn_sym3 block);

/* Adds to the block of a link: block[3 * r + c] is the entry of row r of the first pose and
 * column c of the second. CAIRN_BAD_ARGUMENT: no such link, or state is not ANALYZED.
 * CAIRN_NOT_FINITE. */
CAIRN_CHECKED cairn_status cairn_block_solver_add_link_block(cairn_block_solver *solver,
                                                             int32_t link,
                                                             const cairn_real block[9]);

/* Starts to factor. It ends in state FACTORED or NOT_POSITIVE: a pivot is not above 64 rounding
 * errors of the diagonal that it came from. CAIRN_BAD_ARGUMENT: state is not ANALYZED. */
CAIRN_CHECKED cairn_status cairn_block_solver_factor(cairn_block_solver *solver);

/* Starts to solve H x = b, b: [3 * poses], three a pose, copied. The step that ends it returns
 * CAIRN_NOT_FINITE when x overflows. CAIRN_BAD_ARGUMENT: state is not FACTORED.
 * CAIRN_NOT_FINITE. Cost of the call: a linear pass. */
CAIRN_CHECKED cairn_status cairn_block_solver_solve(cairn_block_solver *solver,
                                                    const cairn_real *b);

/* The solution at one pose. CAIRN_BAD_ARGUMENT: no such pose. CAIRN_EMPTY: nothing was solved
 * since the last factor(). */
CAIRN_CHECKED cairn_status cairn_block_solver_solution(const cairn_block_solver *solver,
                                                       int32_t pose, cairn_real x[3]);

/* Starts to compute H^-1 within the pattern of the factor, in its place (Takahashi, Fagan and
 * Chen 1973; Erisman and Tinney 1975). It ends in state INVERTED, or the step that ends it
 * returns CAIRN_NOT_FINITE. CAIRN_BAD_ARGUMENT: state is not FACTORED. */
CAIRN_CHECKED cairn_status cairn_block_solver_invert(cairn_block_solver *solver);

/* The 3 x 3 block of H^-1 of rows of `first` and columns of `second`, row-major. Always there
 * for a pose with itself and for linked poses; a pair that is wanted beside these is linked
 * without adding a block. CAIRN_EMPTY: state is not INVERTED. CAIRN_UNSUPPORTED: outside the
 * pattern. CAIRN_BAD_ARGUMENT: no such pose. Cost: logarithmic. */
CAIRN_CHECKED cairn_status cairn_block_solver_covariance(const cairn_block_solver *solver,
                                                         int32_t first, int32_t second,
                                                         cairn_real block[9]);

/* CAIRN_OK: nothing left to do. CAIRN_MORE: go on. CAIRN_FULL, CAIRN_NOT_FINITE: see analyze(),
 * solve() and invert(). Costs a unit for each block that is multiplied and for about 16 entries
 * of lists that are walked; what is dearer (a pose with many links) is charged. */
CAIRN_CHECKED cairn_status cairn_block_solver_step(cairn_block_solver *solver,
                                                   cairn_budget *budget);

cairn_block_solver_result cairn_block_solver_read(const cairn_block_solver *solver);

#ifdef __cplusplus
}
#endif

#endif
