/* assignment: the linear assignment problem (optimal bipartite matching of least total cost),
 * exactly and in fixed memory.
 *
 * Pairs the rows and columns of a cost table one to one, as many as the smaller side has, with the
 * least sum of costs. */
#ifndef CAIRN_ASSIGNMENT_H
#define CAIRN_ASSIGNMENT_H

#include "cairn/object.h"
#include "cairn/pool.h"
#include "cairn/real.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Capacities; defaults in brackets. */
typedef struct cairn_assignment_params {
    /* 1 ... 4096 (128 and 128): rows and columns of the table */
    int32_t max_rows, max_columns;
} cairn_assignment_params;

/* Solver of linear assignment problems. */
typedef struct cairn_assignment cairn_assignment;

/* Returns the default parameters. */
cairn_assignment_params cairn_assignment_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_assignment_check(const cairn_assignment_params *params,
                                                  cairn_object_fault *fault);

/* Bytes that create() allocates. 0 for params that create() would refuse. Linear in the sides; the
 * table stays in the caller's memory. */
size_t cairn_assignment_memory(const cairn_assignment_params *params);

/* Creates an object in a pool. CAIRN_BAD_ARGUMENT: NULL, or params out of range. CAIRN_NO_MEMORY:
 * the pool has too few bytes left. A failure changes nothing. */
CAIRN_CHECKED cairn_status cairn_assignment_create(cairn_assignment **assignment, cairn_pool *pool,
                                                   const cairn_assignment_params *params);

/* Starts an assignment. cost[row * columns + column], of either sign, at most 1e9 in magnitude,
 * must stay until step() returns CAIRN_OK. An assignment that runs is discarded.
 * CAIRN_BAD_ARGUMENT: NULL, a side below 1. CAIRN_FULL: more than max_rows or max_columns. Cost:
 * linear in the sides.
 *
 * cost: [rows][columns], row-major */
CAIRN_CHECKED cairn_status cairn_assignment_begin(cairn_assignment *assignment,
                                                  const cairn_real *cost, int32_t rows,
                                                  int32_t columns);

/* Works until the budget is used up. CAIRN_MORE: call again. CAIRN_OK: the pairs are complete, or
 * no assignment was begun. CAIRN_NOT_FINITE: a cost is not finite or beyond 1e9; the assignment is
 * discarded. Cost: at most s (s + 3) / 2 (1 + l / 8) units in all for sides s <= l, usually far
 * less. */
CAIRN_CHECKED cairn_status cairn_assignment_step(cairn_assignment *assignment,
                                                 cairn_budget *budget);

/* Assignment of least total cost. */
typedef struct cairn_assignment_result {
    /* [rows] Column of each row; -1: the row is not paired. Valid until the next begin(). */
    const int32_t *column;
    /* Number of rows, and of pairs. */
    int32_t rows, pairs;
    /* Sum of the costs of the pairs. */
    cairn_real total_cost;
} cairn_assignment_result;

/* The result. All zero until step() returns CAIRN_OK. Ties between assignments are broken the same
 * way in every run. */
cairn_assignment_result cairn_assignment_read(const cairn_assignment *assignment);

#ifdef __cplusplus
}
#endif

#endif
