/* sparse_solver: SuiteSparse's AMD and LDL as a solver of pose graphs.
 *
 * The libraries are looked for when the first solver is made; without them cairn works with
 * block_solver, which gives the same results to rounding and tells marginals faster. For large
 * graphs on a desktop: memory comes from the heap and grows as needed. A part (ordering, factor,
 * solution) is done in one step whatever its budget. */
#ifndef CAIRN_SPARSE_SOLVER_H
#define CAIRN_SPARSE_SOLVER_H

#include "cairn/pose_graph.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_sparse_solver cairn_sparse_solver;

/* CAIRN_UNSUPPORTED: AMD or LDL is not installed (tools/deps.sh solver). CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_sparse_solver_open(cairn_sparse_solver **solver);

/* The interface for cairn_pose_graph_create; valid until _close. Calls are as block_solver's;
 * CAIRN_NO_MEMORY may come from add_link and from a step. A covariance costs three solutions,
 * and any two poses have one. */
cairn_pose_solver cairn_sparse_solver_face(cairn_sparse_solver *solver);

/* Bytes that are held. */
size_t cairn_sparse_solver_memory(const cairn_sparse_solver *solver);

/* NULL is allowed. */
void cairn_sparse_solver_close(cairn_sparse_solver *solver);

#ifdef __cplusplus
}
#endif

#endif
