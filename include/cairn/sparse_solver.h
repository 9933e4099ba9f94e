/* sparse_solver: sparse Cholesky (LDL^T) solver of pose graphs by SuiteSparse's AMD and LDL.
 *
 * The libraries are loaded when the first solver is opened. Without them cairn uses block_solver,
 * which gives the same results up to rounding and computes marginal covariances faster. This solver
 * is for large graphs on a desktop: memory comes from the heap and grows as needed. Each phase
 * (ordering, factorization, solution) takes one step, whatever its budget. */
#ifndef CAIRN_SPARSE_SOLVER_H
#define CAIRN_SPARSE_SOLVER_H

#include "cairn/pose_graph.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A solver with its system of normal equations. */
typedef struct cairn_sparse_solver cairn_sparse_solver;

/* Creates a solver. CAIRN_UNSUPPORTED: AMD or LDL is not installed (tools/deps.sh solver);
 * CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_sparse_solver_open(cairn_sparse_solver **solver);

/* Returns the solver's interface for cairn_pose_graph_create(), valid until the solver is closed.
 * Functions and statuses are those of block_solver; add_link and step may also return
 * CAIRN_NO_MEMORY. A covariance block costs three solutions and is available for any two poses. */
cairn_pose_graph_solver cairn_sparse_solver_interface(cairn_sparse_solver *solver);

/* Returns the bytes of memory in use. */
size_t cairn_sparse_solver_memory(const cairn_sparse_solver *solver);

/* Frees the solver. NULL is allowed. */
void cairn_sparse_solver_close(cairn_sparse_solver *solver);

#ifdef __cplusplus
}
#endif

#endif
