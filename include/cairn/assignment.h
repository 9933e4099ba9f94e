/* assignment: who goes with whom at the least cost in all.
 *
 * Rows and columns of a table of costs are paired one to one, as many as the smaller side has,
 * so that the sum of the costs of the pairs is least (the linear assignment problem), exactly
 * and in fixed memory. */
#ifndef CAIRN_ASSIGNMENT_H
#define CAIRN_ASSIGNMENT_H

#include "cairn/pool.h"
#include "cairn/real.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_assignment_params {
    int32_t max_rows, max_columns; /* 1 ... 4096 (128 and 128) */
} cairn_assignment_params;

typedef struct cairn_assignment cairn_assignment;

/* The values in brackets above. */
cairn_assignment_params cairn_assignment_default(void);

/* 0 for params that create() would refuse. Grows with the sides, not with the table, which is
 * the caller's. */
size_t cairn_assignment_memory(const cairn_assignment_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_assignment_create(cairn_assignment **assignment, cairn_pool *pool,
                                                   const cairn_assignment_params *params);

/* Starts on a table; cost[row * columns + column], of either sign, at most 1e9 in size, must
 * stay until step() returns CAIRN_OK. What ran before is dropped. CAIRN_BAD_ARGUMENT: NULL, a
 * side below 1. CAIRN_FULL: more than the params say. Cost: linear in the sides. */
CAIRN_CHECKED cairn_status cairn_assignment_begin(cairn_assignment *assignment,
                                                  const cairn_real *cost, int32_t rows,
                                                  int32_t columns);

/* Goes on. CAIRN_MORE: the budget is used up. CAIRN_OK: the pairs stand, or nothing was begun.
 * CAIRN_NOT_FINITE: a cost that is not finite or is beyond 1e9; given up. At most s (s + 3) / 2
 * (1 + l / 8) units for sides s <= l, mostly far less. */
CAIRN_CHECKED cairn_status cairn_assignment_step(cairn_assignment *assignment,
                                                 cairn_budget *budget);

typedef struct cairn_assignment_result {
    /* [rows] of each row; -1: none is left for it. Valid until the next begin() */
    const int32_t *column;
    int32_t rows, pairs;
    /* of all pairs */
    cairn_real cost;
} cairn_assignment_result;

/* All zero until step() returns CAIRN_OK. Of equally cheap pairings always the same one is
 * given. */
cairn_assignment_result cairn_assignment_read(const cairn_assignment *assignment);

#ifdef __cplusplus
}
#endif

#endif
