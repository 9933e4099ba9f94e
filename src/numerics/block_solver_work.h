/* Internals of the module block_solver, shared by its files: block_solver.c (structure, values,
 * steps), block_solver_order.c (fill-reducing ordering), block_solver_pattern.c (symbolic
 * factorization), block_solver_factor.c (numeric LDL^T factorization, solutions),
 * block_solver_inverse.c (selected inverse). */
#ifndef CAIRN_CORE_BLOCK_SOLVER_WORK_H
#define CAIRN_CORE_BLOCK_SOLVER_WORK_H

#include "cairn/block_solver.h"
#include "src/base/object.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_block_solver_parameters;

/* List entries that are visited for one work unit. */
enum { BLOCK_SOLVER_ENTRIES_PER_UNIT = 16 };
/* Sizes of a panel update: source columns of a run at a time, target columns of a panel, and the
 * cairn_real of the factors of both. */
enum {
    BLOCK_SOLVER_WIDTH = 32,
    BLOCK_SOLVER_PANEL = 4,
    BLOCK_SOLVER_PANEL_REALS = 9 * BLOCK_SOLVER_WIDTH * BLOCK_SOLVER_PANEL
};
/* Block products between two checks of the budget; in the factorization less than 2 WIDTH PANEL
 * more. */
enum { BLOCK_SOLVER_PRODUCTS_PER_CALL = 16 };

/* Phase: the kind of the next operation. The order of the phases is used by comparisons. */
typedef int32_t block_solver_phase;
enum {
    /* No stage runs. */
    BLOCK_SOLVER_IDLE,
    /* Ordering, see block_solver_order.c. */
    BLOCK_SOLVER_PIVOT,
    BLOCK_SOLVER_SCAN,
    BLOCK_SOLVER_UPDATE,
    BLOCK_SOLVER_MERGE,
    BLOCK_SOLVER_FINISH,
    /* Pattern of the factor: a row per operation, counted and then filled in. */
    BLOCK_SOLVER_COUNT_ROWS,
    BLOCK_SOLVER_FILL_ROWS,
    /* Block of each link: a link per operation. */
    BLOCK_SOLVER_FIND_SLOTS,
    /* Numeric factorization: the next column or run, and a panel update. */
    BLOCK_SOLVER_COLUMN,
    BLOCK_SOLVER_SUBTRACT,
    /* Forward and backward substitution: a column per operation. */
    BLOCK_SOLVER_FORWARD,
    BLOCK_SOLVER_BACKWARD,
    /* Selected inverse: the next column, and block products. */
    BLOCK_SOLVER_SELECT,
    BLOCK_SOLVER_MULTIPLY
};

/* Quotient graph of the ordering. Nodes are variables (supervariables: poses that are not
 * eliminated yet, indistinguishable ones merged) and elements (cliques left by eliminated
 * variables). */
struct block_solver_order {
    /* [2 max_links + max_poses] Adjacency lists: of a variable first its elements, then its
     * variables; of an element its variables. */
    int32_t *graph;
    /* [max_poses + 1] Start of a node's list in graph. */
    int32_t *start;
    /* [max_poses] Length of a node's list; 0 for absorbed or merged nodes. */
    int32_t *length;
    /* [max_poses] Number of elements at the front of a variable's list. */
    int32_t *elements;
    /* [max_poses] Number of poses in an element's list, or upper bound of a variable's degree
     * (neighbouring poses). */
    int32_t *degree;
    /* [max_poses] Number of poses of a variable; negative: in the pivot's list, or eliminated; 0:
     * merged into another variable. */
    int32_t *size;
    /* [max_poses] 0: absorbed element; else compared with tag. */
    int32_t *mark;
    /* [max_poses] Next pose of the same variable, -1: the last. */
    int32_t *next_member;
    /* [max_poses] Last pose of the variable. */
    int32_t *last_member;
    /* [max_poses] Score of a variable, by which pivots are selected; shares memory with `column` of
     * the solver. */
    int32_t *score;
    /* [max_poses] First variable of a score, -1: none. */
    int32_t *head;
    /* [max_poses] Next variable of the same score, or of the same hash. */
    int32_t *next;
    /* [max_poses] Previous variable of the same score, or the hash of the variable's list. */
    int32_t *previous;
    /* [max_poses] First variable of a hash, -1: none. */
    int32_t *hash_head;
    /* Used entries of graph. */
    int32_t graph_end;
    /* Current value of marks, and largest degree of an element so far. */
    int32_t tag, largest_degree;
    /* Lower bound of the scores of all variables. */
    int32_t lowest_score;
    /* Pivot, and positions in its list at which the phase reads and writes. */
    int32_t pivot, cursor, write;
    /* Number of poses that are not eliminated yet. */
    int32_t poses_left;
    /* Number of poses placed in the order of elimination. */
    int32_t poses_ordered;
};

/* Panel: consecutive columns of a run (supernode) that are computed together, and the update that
 * is subtracted from them. */
struct block_solver_panel {
    /* Columns first ... end - 1. */
    int32_t first, end;
    /* Row of the panel whose list of runs is subtracted. */
    int32_t row;
    /* End of the source columns of the run that is subtracted. */
    int32_t source_end;
    /* Number of source columns that are subtracted together. */
    int32_t width;
    /* Number of target columns. */
    int32_t target_count;
    /* Target columns. */
    int32_t target[BLOCK_SOLVER_PANEL];
    /* Position of the source columns' block in the target's row, counted from their end. */
    int32_t blocks_to_end[BLOCK_SOLVER_PANEL];
    /* Diagonal of H before the elimination: the scale of the pivots. */
    cairn_real scale[BLOCK_SOLVER_PANEL][3];
    /* [BLOCK_SOLVER_PANEL_REALS] Factors of the update, see block_solver_factor.c. */
    cairn_real *factor;
};

struct cairn_block_solver {
    cairn_block_solver_params params;
    cairn_block_solver_result result;
    /* Kind of the next operation. */
    block_solver_phase phase;
    /* Work units of finished operations that are not yet charged to a budget. */
    int32_t units_due;
    /* 1: the structure takes no more links. */
    int32_t is_closed;
    /* 1: all values are 0. */
    int32_t is_zero;
    /* 1: x holds a solution. */
    int32_t solved;
    /* 1: the third unknown (theta) of some pose is coupled with another unknown. */
    int32_t is_coupled;
    /* Status returned by the last step of the stage. */
    cairn_status outcome;

    /* [max_links] Poses of a link. */
    int32_t *first, *second;
    /* [max_links] Block of the factor that holds the link's block. */
    int32_t *slot;
    /* [max_poses] Permutation: pose at a position of the order of elimination. */
    int32_t *order;
    /* [max_poses] Inverse permutation: position of a pose. Rows and columns below are positions. */
    int32_t *position;

    /* [max_poses + 1] First block of a column. */
    int32_t *column;
    /* [max_fill] Row of a block, ascending in each column. */
    int32_t *rows;
    /* [max_fill] Blocks below the diagonal, row-major: of H, then of L D, then of H^-1. */
    cairn_real (*blocks)[9];
    /* [max_poses] Diagonal blocks: of H, then D^-1, then of H^-1. */
    cairn_sym3 *diagonal;
    /* [max_poses] Right-hand side, then solution. */
    cairn_real (*x)[3];
    /* [max_poses] Selected inverse: sums of the current column. */
    cairn_real (*sums)[9];
    /* State of the ordering. The other stages reuse its arrays for other purposes, as their
     * comments say. */
    struct block_solver_order ordering;

    /* Current row, link or column of the stage. */
    int32_t current;
    /* Source column: the first one that is subtracted, or the block that is multiplied. */
    int32_t source;
    /* Next block of the source columns; in the factorization counted from their end. */
    int32_t block;
    /* Panel of the factorization. */
    struct block_solver_panel panel;
};

/* ---- Ordering ---- */

/* Starts the ordering. */
void cairn_block_solver_order_begin(cairn_block_solver *solver);

/* One operation of the phases PIVOT to FINISH. Returns its work units. */
int32_t cairn_block_solver_order_advance(cairn_block_solver *solver);

/* ---- Pattern, factor and solution ---- */

/* Starts the symbolic factorization, after the ordering. */
void cairn_block_solver_pattern_begin(cairn_block_solver *solver);

/* Resumes the symbolic factorization when there is memory for the blocks that were counted. */
void cairn_block_solver_pattern_resume(cairn_block_solver *solver);

/* One operation of the symbolic factorization. Returns its work units. */
int32_t cairn_block_solver_pattern_advance(cairn_block_solver *solver);

/* Index of the block of a row and a column, row > column; -1: outside the pattern. Logarithmic. */
int32_t cairn_block_solver_find_block(const cairn_block_solver *solver, int32_t row,
                                      int32_t column);

/* Starts the numeric factorization. */
void cairn_block_solver_factor_begin(cairn_block_solver *solver);

/* One operation of the numeric factorization. Returns its work units. */
int32_t cairn_block_solver_factor_advance(cairn_block_solver *solver);

/* One column of the forward or backward substitution. Returns its work units. */
int32_t cairn_block_solver_solve_advance(cairn_block_solver *solver);

/* ---- Selected inverse ---- */

/* Starts the selected inverse. */
void cairn_block_solver_inverse_begin(cairn_block_solver *solver);

/* One operation of the selected inverse. Returns its work units. */
int32_t cairn_block_solver_inverse_advance(cairn_block_solver *solver);

/* Ends the stage that runs. */
static inline void cairn_block_solver_end(cairn_block_solver *solver,
                                          cairn_block_solver_state state, cairn_status outcome)
{
    solver->phase = BLOCK_SOLVER_IDLE;
    solver->result.state = state;
    solver->outcome = outcome;
}

#endif
