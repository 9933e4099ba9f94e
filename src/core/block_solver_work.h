/* What the parts of block_solver share: block_solver.c (structure, values, steps),
 * block_solver_order.c (ordering), block_solver_pattern.c (pattern of the factor),
 * block_solver_factor.c (LDL^T, solutions), block_solver_inverse.c (selected inverse). */
#ifndef CAIRN_CORE_BLOCK_SOLVER_WORK_H
#define CAIRN_CORE_BLOCK_SOLVER_WORK_H

#include "cairn/block_solver.h"

/* Entries of lists that are walked for one unit. */
enum { BLOCK_SOLVER_ENTRIES = 16 };
/* Columns that are subtracted at a time, and columns from which they are. */
enum {
    BLOCK_SOLVER_WIDTH = 32,
    BLOCK_SOLVER_PANEL = 4,
    BLOCK_SOLVER_FACTOR = 9 * BLOCK_SOLVER_WIDTH * BLOCK_SOLVER_PANEL
};
/* Blocks that are multiplied between two looks at the budget; in the factor less than 2 WIDTH
 * PANEL more. */
enum { BLOCK_SOLVER_CHUNK = 16 };

/* What the next item of work is. */
enum {
    BLOCK_SOLVER_IDLE,
    BLOCK_SOLVER_PIVOT, /* ordering: see block_solver_order.c */
    BLOCK_SOLVER_SCAN,
    BLOCK_SOLVER_UPDATE,
    BLOCK_SOLVER_MERGE,
    BLOCK_SOLVER_FINISH,
    BLOCK_SOLVER_COUNT, /* pattern, a row an item */
    BLOCK_SOLVER_FILL,
    BLOCK_SOLVER_SLOT,   /* ... a link an item */
    BLOCK_SOLVER_COLUMN, /* factor: the next column */
    BLOCK_SOLVER_SUBTRACT,
    BLOCK_SOLVER_FORWARD, /* solve, a column an item */
    BLOCK_SOLVER_BACKWARD,
    BLOCK_SOLVER_SELECT, /* selected inverse: the next column */
    BLOCK_SOLVER_MULTIPLY
};

/* Quotient graph of the ordering: variables (poses not yet eliminated) and elements (cliques of
 * eliminated ones). */
struct cairn_block_order {
    /* [2 max_links + max_poses] lists: of a variable first its elements, then its variables; of
     * an element its variables */
    int32_t *graph;
    /* [max_poses + 1] of the list in graph */
    int32_t *start;
    /* [max_poses] of the list; 0 for nodes that are gone */
    int32_t *length;
    /* [max_poses] how many of the list are elements */
    int32_t *elements;
    /* [max_poses] poses of an element's list, or bound of a variable's neighbours */
    int32_t *degree;
    /* [max_poses] poses of a variable; < 0: in the pivot's list, or eliminated; 0: merged */
    int32_t *size;
    /* [max_poses] 0: element that is gone; else compared with tag */
    int32_t *mark;
    /* [max_poses] next pose of the same variable, -1: last */
    int32_t *member;
    /* [max_poses] last pose of the variable */
    int32_t *tail;
    /* [max_poses] of a variable, what it is taken by; lies in the solver's `column` */
    int32_t *score;
    /* [max_poses] first variable of a score */
    int32_t *head;
    /* [max_poses] variable of the same score, or of the same hash */
    int32_t *next;
    /* [max_poses] variable of the same score, or the hash */
    int32_t *previous;
    /* [max_poses] first variable of a hash */
    int32_t *hashes;
    /* of the used part of graph */
    int32_t end;
    /* largest: poses of an element, so far */
    int32_t tag, largest;
    /* no variable has a lower score */
    int32_t lowest;
    int32_t pivot, cursor, write;
    /* poses not yet eliminated */
    int32_t left;
    /* entries of `order` */
    int32_t filled;
};

/* Consecutive columns of a run that are made together, and what is subtracted from them. */
struct block_solver_panel {
    int32_t first, end;
    int32_t row;        /* of the panel, whose list of runs is to be subtracted */
    int32_t source_end; /* behind the last column of the run that is subtracted */
    int32_t width;      /* columns of it that are subtracted together */
    int32_t targets;    /* columns from which they are */
    int32_t target[BLOCK_SOLVER_PANEL];
    int32_t from_end[BLOCK_SOLVER_PANEL];    /* of the source columns' block in the target's row */
    cairn_real scale[BLOCK_SOLVER_PANEL][3]; /* of the diagonal before elimination */
    cairn_real *factor;                      /* [BLOCK_SOLVER_FACTOR] see block_solver_factor.c */
};

struct cairn_block_solver {
    cairn_block_solver_params params;
    cairn_block_solver_result result;
    int32_t phase;
    int32_t debt;         /* units of items done that are not yet paid for */
    int32_t closed;       /* 1: the structure takes no more links */
    int32_t empty;        /* 1: all values are 0 */
    int32_t solved;       /* 1: x holds a solution */
    int32_t coupled;      /* 1: some pose's third unknown is coupled with another unknown */
    cairn_status outcome; /* for the step that ends the part */

    int32_t *first, *second; /* [max_links] */
    int32_t *slot;           /* [max_links] block of the factor where the link's block goes */
    int32_t *order;          /* [max_poses] pose at a place of the order of elimination */
    int32_t *place;          /* [max_poses] place of a pose; below, all poses are places */

    /* [max_poses + 1] first block of a column */
    int32_t *column;
    /* [max_fill] ascending in each column */
    int32_t *rows;
    /* [max_fill] H, then L D, then H^-1, below the diagonal */
    cairn_real (*blocks)[9];
    /* [max_poses] H, then D^-1, then H^-1 */
    cairn_sym3 *diagonal;
    /* [max_poses] */
    cairn_real (*x)[3];
    /* [max_poses] of the column that is inverted */
    cairn_real (*sums)[9];
    /* its arrays serve the other parts as well, under the names that fit */
    struct cairn_block_order o;

    /* row, link or column of the part that runs */
    int32_t at;
    /* column that is subtracted, the first of several, or multiplied */
    int32_t source;
    /* next block of the source columns: of the factor counted from their end */
    int32_t block;
    /* of the factor */
    struct block_solver_panel p;
};

/* Ordering; the items of the phases PIVOT to FINISH do one item and return its units. */
void cairn_block_order_begin(cairn_block_solver *s);
int32_t cairn_block_order_item(cairn_block_solver *s);

/* Pattern, factor and solution. */
void cairn_block_pattern_begin(cairn_block_solver *s);
/* when there is room for the blocks that were counted */
void cairn_block_pattern_go_on(cairn_block_solver *s);
int32_t cairn_block_pattern_item(cairn_block_solver *s);
int32_t cairn_block_find(const cairn_block_solver *s, int32_t row, int32_t column);
void cairn_block_factor_begin(cairn_block_solver *s);
int32_t cairn_block_factor_item(cairn_block_solver *s);
int32_t cairn_block_solve_item(cairn_block_solver *s);

/* Selected inverse. */
void cairn_block_inverse_begin(cairn_block_solver *s);
int32_t cairn_block_inverse_item(cairn_block_solver *s);

/* Ends the part that runs. */
static inline void cairn_block_solver_end(cairn_block_solver *s, cairn_block_solver_state state,
                                          cairn_status outcome)
{
    s->phase = BLOCK_SOLVER_IDLE;
    s->result.state = state;
    s->outcome = outcome;
}

#endif
