/* block_solver: sparse linear systems of pose graphs in fixed memory: fill-reducing ordering,
 * sparse LDL^T (Cholesky) factorization, solution, and marginal covariances.
 *
 * Solves the normal equations H x = b of a pose graph. H is symmetric, with a 3 x 3 block per pose
 * on the diagonal and a 3 x 3 block per link (edge) between two poses beside the diagonal. The
 * stages, in the order of the calls; each of the stages with a step is a sequence of bounded steps:
 *
 *   begin(), add_link() ...              structure: which poses are linked
 *   analyze(), step()                    symbolic factorization: the order of elimination, and the
 *                                        number of blocks of the factor
 *   clear(), add_pose_block(),           values of H, again for every new system of the same
 *   add_link_block() ...                 structure
 *   factor(), step()                     numeric factorization H = L D L^T, or the first pose at
 *                                        which H is not positive definite
 *   solve(), step(), solution()          solution of H x = b, for any number of right-hand sides
 *   invert(), step(), covariance()       selected inverse: the blocks of H^-1 of poses and links
 *
 * Only one stage runs at a time: while step() has work left, all calls that start another stage or
 * change values return CAIRN_BAD_ARGUMENT, except begin(). */
#ifndef CAIRN_BLOCK_SOLVER_H
#define CAIRN_BLOCK_SOLVER_H

#include "cairn/object.h"
#include "cairn/pool.h"
#include "cairn/small_matrix.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Sparse LDL^T solver. */
typedef struct cairn_block_solver cairn_block_solver;

/* Capacities; defaults in brackets. */
typedef struct cairn_block_solver_params {
    /* 1 ... 2^22 (1000): poses */
    int32_t max_poses;
    /* 0 ... 2^24 (3000): links, repeated ones included */
    int32_t max_links;
    /* 0 ... 2^26 (12000): blocks of the factor below the diagonal (fill-in included). The memory
     * grows by 9 cairn_real and an int32_t per block. Pose graphs of robots that drive through
     * corridors need 2 to 6 blocks per link. */
    int32_t max_fill;
} cairn_block_solver_params;

/* Returns the default parameters. */
cairn_block_solver_params cairn_block_solver_default(void);

/* State of a solver, after the last stage that ended. */
typedef int32_t cairn_block_solver_state;
enum {
    /* No structure, or a structure that is not analyzed yet. */
    CAIRN_BLOCK_SOLVER_NEW = 0,
    /* The structure is analyzed: values may be added. */
    CAIRN_BLOCK_SOLVER_ANALYZED = 1,
    /* The factor is complete: solve() and invert() may be called. */
    CAIRN_BLOCK_SOLVER_FACTORED = 2,
    /* H is not positive definite to rounding, see `failed_pose`; clear() starts a new system. */
    CAIRN_BLOCK_SOLVER_NOT_POSITIVE = 3,
    /* The selected inverse is complete: covariance() may be called. The factor is overwritten;
     * clear() starts a new system. */
    CAIRN_BLOCK_SOLVER_INVERTED = 4
};

/* State and statistics of a solver. */
typedef struct cairn_block_solver_result {
    /* State after the last stage that ended. */
    cairn_block_solver_state state;
    /* 1 while step() has work left. */
    int32_t running;
    /* Number of poses, and of links added. */
    int32_t poses, links;
    /* Blocks of the factor below the diagonal, also when more than max_fill. INT32_MAX: this many
     * or more. */
    int32_t fill;
    /* State NOT_POSITIVE: the pose at which the factorization or the inversion stopped. H does not
     * determine this pose given the poses eliminated later (an unobservable part of the graph).
     * Else -1. */
    int32_t failed_pose;
    /* Work units charged by step() so far. */
    int64_t units;
} cairn_block_solver_result;

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_block_solver_check(const cairn_block_solver_params *params,
                                                    cairn_object_fault *fault);

/* Bytes that create() allocates. 0 for params that create() would refuse. */
size_t cairn_block_solver_memory(const cairn_block_solver_params *params);

/* Creates an object in a pool. CAIRN_BAD_ARGUMENT: NULL, or params out of range. CAIRN_NO_MEMORY:
 * the pool has too few bytes left. A failure changes nothing. */
CAIRN_CHECKED cairn_status cairn_block_solver_create(cairn_block_solver **solver, cairn_pool *pool,
                                                     const cairn_block_solver_params *params);

/* Begins a new structure of poses 0 ... poses-1. Discards the last structure and a stage that
 * runs. CAIRN_BAD_ARGUMENT: NULL, poses < 1. CAIRN_FULL: poses > max_poses. Constant time. */
CAIRN_CHECKED cairn_status cairn_block_solver_begin(cairn_block_solver *solver, int32_t poses);

/* Links two different poses. Links are numbered from 0 in the order in which they are added.
 * Repeated links of a pair share one block. CAIRN_BAD_ARGUMENT: no such pose, first == second, or
 * the structure is already analyzed. CAIRN_FULL: max_links. Constant time.
 *
 * first, second: indices of the poses, from 0 */
CAIRN_CHECKED cairn_status cairn_block_solver_add_link(cairn_block_solver *solver, int32_t first,
                                                       int32_t second);

/* Starts the symbolic factorization: the fill-reducing ordering and the pattern of the factor. All
 * values are 0 afterwards. The last step returns CAIRN_FULL when the factor would have more than
 * max_fill blocks, with their number in `fill`: the structure stays, and only extend() and begin()
 * are accepted. CAIRN_BAD_ARGUMENT: no structure, or already analyzed. Cost: for planar graphs
 * about proportional to `fill` (measured, docs/lab/graphs.md). */
CAIRN_CHECKED cairn_status cairn_block_solver_analyze(cairn_block_solver *solver);

/* Resumes an analysis that returned CAIRN_FULL, with memory for max_fill blocks from a pool that
 * must outlive the solver; the ordering is kept. The memory for the former max_fill stays
 * allocated. So the memory can be fitted to the graph: create with max_fill of 0, analyze, read
 * `fill`, extend. CAIRN_BAD_ARGUMENT: the last step did not return CAIRN_FULL, max_fill is less
 * than `fill` or above 2^26. CAIRN_NO_MEMORY: the pool has less than extend_memory() bytes left;
 * nothing has changed.
 *
 * max_fill: new capacity for blocks of the factor */
CAIRN_CHECKED cairn_status cairn_block_solver_extend(cairn_block_solver *solver, cairn_pool *pool,
                                                     int32_t max_fill);

/* Bytes that extend() allocates. 0 for a max_fill that extend() would always refuse. */
size_t cairn_block_solver_extend_memory(int32_t max_fill);

/* Sets all values of H to 0. CAIRN_BAD_ARGUMENT: not analyzed, or a stage runs. Cost: linear in
 * poses and fill. */
CAIRN_CHECKED cairn_status cairn_block_solver_clear(cairn_block_solver *solver);

/* Adds a block to the diagonal block of a pose. CAIRN_BAD_ARGUMENT: no such pose, or state is not
 * ANALYZED. CAIRN_NOT_FINITE. Constant time.
 *
 * pose: index of the pose
 * block: symmetric 3 x 3 block to add */
CAIRN_CHECKED cairn_status cairn_block_solver_add_pose_block(cairn_block_solver *solver,
                                                             int32_t pose, cairn_sym3 block);

/* Adds a block to the off-diagonal block of a link. block[3 * r + c]: entry of row r of the first
 * pose and column c of the second pose. CAIRN_BAD_ARGUMENT: no such link, or state is not
 * ANALYZED. CAIRN_NOT_FINITE. Constant time.
 *
 * link: index of the link
 * block: [3][3] block to add */
CAIRN_CHECKED cairn_status cairn_block_solver_add_link_block(cairn_block_solver *solver,
                                                             int32_t link,
                                                             const cairn_real block[9]);

/* Starts the numeric factorization H = L D L^T. Ends in state FACTORED, or in NOT_POSITIVE when a
 * pivot is at most 64 rounding errors of its diagonal entry of H. CAIRN_BAD_ARGUMENT: state is not
 * ANALYZED. */
CAIRN_CHECKED cairn_status cairn_block_solver_factor(cairn_block_solver *solver);

/* Starts the forward and backward substitution for H x = b. b: [3 * poses], three entries per pose,
 * copied. The last step returns CAIRN_NOT_FINITE when x overflows. CAIRN_BAD_ARGUMENT: state is not
 * FACTORED. CAIRN_NOT_FINITE: an entry of b. Cost of the call: linear in poses. */
CAIRN_CHECKED cairn_status cairn_block_solver_solve(cairn_block_solver *solver,
                                                    const cairn_real *b);

/* The three entries of the solution x of a pose. CAIRN_BAD_ARGUMENT: no such pose. CAIRN_EMPTY: no
 * solution since the last factor().
 *
 * pose: index of the pose
 * x: [3] set to the entries */
CAIRN_CHECKED cairn_status cairn_block_solver_solution(const cairn_block_solver *solver,
                                                       int32_t pose, cairn_real x[3]);

/* Starts the selected inverse: the blocks of H^-1 within the pattern of the factor, in place of the
 * factor (Takahashi, Fagan and Chen 1973; Erisman and Tinney 1975). These blocks are the marginal
 * covariances when H is an information matrix. Ends in state INVERTED, or in NOT_POSITIVE when a
 * variance overflows. CAIRN_BAD_ARGUMENT: state is not FACTORED. */
CAIRN_CHECKED cairn_status cairn_block_solver_invert(cairn_block_solver *solver);

/* The 3 x 3 block of H^-1 with the rows of `first` and the columns of `second`, row-major: a
 * marginal (cross-)covariance. Available for a pose with itself and for linked poses; to make
 * another pair available, link the pair without adding a block. CAIRN_EMPTY: state is not INVERTED.
 * CAIRN_UNSUPPORTED: the block is outside the pattern. CAIRN_BAD_ARGUMENT: no such pose. Cost:
 * logarithmic.
 *
 * first, second: indices of the poses
 * block: [3][3] set to the block */
CAIRN_CHECKED cairn_status cairn_block_solver_covariance(const cairn_block_solver *solver,
                                                         int32_t first, int32_t second,
                                                         cairn_real block[9]);

/* Works on the stage that runs until the budget is used up. CAIRN_OK: no work is left. CAIRN_MORE:
 * call again. CAIRN_FULL, CAIRN_NOT_FINITE: see analyze() and solve(). Cost: one unit per
 * block product and per 16 list entries visited, charged before an operation is done. An operation
 * is at most 128 products, the blocks of one column or the lists of two poses, but for passes over
 * the whole graph: in an analysis two of all poses and links, one of all blocks, and one whenever
 * the memory of the lists is compacted. */
CAIRN_CHECKED cairn_status cairn_block_solver_step(cairn_block_solver *solver,
                                                   cairn_budget *budget);

/* State and statistics. */
cairn_block_solver_result cairn_block_solver_read(const cairn_block_solver *solver);

#ifdef __cplusplus
}
#endif

#endif
