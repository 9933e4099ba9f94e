/* Internals of the module block_solver, shared by its files: block_solver.c (structure, values,
 * steps), block_solver_order.c (fill-reducing ordering), block_solver_pattern.c (symbolic
 * factorization), block_solver_factor.c (numeric LDL^T factorization, solutions),
 * block_solver_inverse.c (selected inverse), block_solver_charge.c (work units). */
#ifndef CAIRN_NUMERICS_BLOCK_SOLVER_WORK_H
#define CAIRN_NUMERICS_BLOCK_SOLVER_WORK_H

#include "cairn/block_solver.h"
#include "src/base/object.h"
#include "src/base/step.h"

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
/* Block products of an operation, but for the last row of a panel update that it begins: one row has
 * at most WIDTH PANEL. */
enum { BLOCK_SOLVER_PRODUCTS_PER_CALL = 16 };

/* Stage that step() works on. */
typedef int32_t block_solver_stage;
enum {
    /* No stage runs. */
    BLOCK_SOLVER_IDLE,
    /* Symbolic factorization; its rest, when extend() has added memory for the factor. */
    BLOCK_SOLVER_ANALYZE,
    BLOCK_SOLVER_FILL,
    BLOCK_SOLVER_FACTOR,
    BLOCK_SOLVER_SOLVE,
    BLOCK_SOLVER_INVERT
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
    /* Pivot; positions in a list that are read and written. */
    int32_t pivot, cursor, write;
    /* Variables of one hash: the one that is compared with all after it, and the one before the next
     * of these. */
    int32_t compared, before;
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
    /* Number of source columns that are subtracted together, block products of one of their rows,
     * and rows of an operation. */
    int32_t width, products, rows;
    /* Number of target columns. */
    int32_t target_count;
    /* Target columns. */
    int32_t target[BLOCK_SOLVER_PANEL];
    /* Position of the source columns' block in the first target's row, counted from their end; the
     * blocks of the other targets follow. */
    int32_t blocks_to_end;
    /* Diagonal of H before the elimination: the scale of the pivots. */
    cairn_real scale[BLOCK_SOLVER_PANEL][3];
    /* [BLOCK_SOLVER_PANEL_REALS] Factors of the update, see block_solver_factor.c. */
    cairn_real *factor;
};

struct cairn_block_solver {
    /* Resume points of the stage and of a part of it. */
    uint16_t resume, part_resume;
    /* Units charged for the operation that waits. */
    int32_t units_charged;
    /* Current row, link or column of the stage. */
    int32_t current;
    /* Source column: the first one that is subtracted, or the block that is multiplied. */
    int32_t source;
    /* Next block of the source columns; in the factorization counted from their end. */
    int32_t block;

    /* 1: the structure takes no more links. */
    uint8_t is_closed;
    /* 1: all values are 0. */
    uint8_t is_zero;
    /* 1: x holds a solution. */
    uint8_t solved;
    block_solver_stage stage;
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

    cairn_block_solver_result result;
    /* State of the ordering. The other stages reuse its arrays for other purposes, as their
     * comments say. */
    struct block_solver_order ordering;
    /* Panel of the factorization. */
    struct block_solver_panel panel;
    cairn_block_solver_params params;
};

/* Charges an operation that visits list entries; 1 when it may be done, 0 when the budget is used
 * up. */
int cairn_block_solver_charge(cairn_block_solver *solver, cairn_budget *budget, int32_t entries);

/* Place of return: the step continues when the operation that follows, which visits list entries, is
 * charged. */
#define BLOCK_SOLVER_CHARGE_LIST(solver, resume, budget, entries)                                  \
    CAIRN_STEP_UNTIL((solver)->resume, cairn_block_solver_charge(solver, budget, entries))

/* Ends the stage that runs. */
static inline void block_solver_end(cairn_block_solver *solver, cairn_block_solver_state state,
                                    cairn_status outcome)
{
    solver->result.state = state;
    solver->outcome = outcome;
}

/* ---- Stages and their parts: each is a step that returns 1 when done, 0 when the budget is used
 * up ---- */

/* Prepares the ordering. */
void cairn_block_solver_order_begin(cairn_block_solver *solver);

/* Order of elimination: a part of the symbolic factorization. */
int cairn_block_solver_order(cairn_block_solver *solver, cairn_budget *budget);

/* Symbolic factorization. */
int cairn_block_solver_analysis(cairn_block_solver *solver, cairn_budget *budget);

/* Index of the block of a row and a column, row > column; -1: outside the pattern. Logarithmic. */
int32_t cairn_block_solver_find_block(const cairn_block_solver *solver, int32_t row,
                                      int32_t column);

/* Sets all values to 0. */
void cairn_block_solver_clear_values(cairn_block_solver *solver);

/* Prepares the numeric factorization. */
void cairn_block_solver_factor_begin(cairn_block_solver *solver);

/* Numeric factorization. */
int cairn_block_solver_factorize(cairn_block_solver *solver, cairn_budget *budget);

/* Forward and backward substitution. */
int cairn_block_solver_substitute(cairn_block_solver *solver, cairn_budget *budget);

/* Prepares the selected inverse. */
void cairn_block_solver_inverse_begin(cairn_block_solver *solver);

/* Selected inverse. */
int cairn_block_solver_inverse(cairn_block_solver *solver, cairn_budget *budget);

#endif
