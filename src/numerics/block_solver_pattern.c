/* Symbolic factorization: the pattern of the factor.
 *
 * Method:
 * 1. Row r of the factor has a block in every column on the paths of the elimination tree from the
 *    columns of H in row r up to r (Liu 1990). A first pass over the rows builds the tree and
 *    counts the blocks of each column.
 * 2. The columns are renumbered by a postorder of the tree.
 * 3. A second pass writes the row numbers into the columns, in ascending order.
 * 4. Every link looks up its block.
 *
 * Source: Liu, The role of elimination trees in sparse factorization, 1990; Davis, Algorithm 849: a
 * concise sparse Cholesky factorization package, 2005. */
#include "src/base/build.h"

#include <string.h>

#include "src/containers/counting_sort.h"
#include "src/numerics/block_solver_work.h"

/* Work units of the search for the block of a link; passes over the poses that number the
 * columns. */
enum { UNITS_PER_SLOT = 2, NUMBER_PASSES = 8 };

/* Lists the columns of H left of the diagonal by rows: those of row r are graph[start[r]] ...
 * graph[start[r + 1] - 1]. */
static void list_rows(cairn_block_solver *solver)
{
    struct block_solver_order *ordering = &solver->ordering;
    int32_t n = solver->result.poses;

    counting_sort_reset(ordering->start, 0, n + 1);
    for (int32_t link = 0; link < solver->result.links; link++) {
        int32_t a = solver->position[solver->first[link]],
                b = solver->position[solver->second[link]];

        counting_sort_count(ordering->start, a > b ? a : b);
    }
    counting_sort_sum(ordering->start, 0, n + 1);
    for (int32_t link = solver->result.links - 1; link >= 0; link--) {
        int32_t a = solver->position[solver->first[link]],
                b = solver->position[solver->second[link]];

        ordering->graph[counting_sort_place(ordering->start, a > b ? a : b)] = a > b ? b : a;
    }
}

/* Visits the next entries of a row, as many as a work unit has. 1 when the row is done: all of its
 * columns count it, and are on the path of the elimination tree to it, which the first pass extends;
 * the second pass, where the columns have blocks, writes the row into them. */
static int visit_row(cairn_block_solver *solver, int32_t row, int is_filling)
{
    struct block_solver_order *ordering = &solver->ordering;
    int32_t left = BLOCK_SOLVER_ENTRIES_PER_UNIT;

    for (; ordering->cursor < ordering->start[row + 1]; ordering->cursor++) {
        int32_t column = ordering->graph[ordering->cursor];

        for (; left > 0 && ordering->mark[column] != row;
             column = ordering->previous[column], left--) {
            if (ordering->previous[column] == -1)
                ordering->previous[column] = row;
            ordering->mark[column] = row;
            if (is_filling)
                solver->rows[solver->column[column] + ordering->length[column]] = row;
            ordering->length[column]++;
        }
        if (left-- == 0) {
            /* The path continues here. */
            ordering->graph[ordering->cursor] = column;
            return 0;
        }
    }
    return 1;
}

/* Starts a row. */
static void begin_row(struct block_solver_order *ordering, int32_t row)
{
    ordering->mark[row] = row;
    ordering->cursor = ordering->start[row];
}

/* A pass over all rows. */
static int visit_rows(cairn_block_solver *solver, cairn_budget *budget, int is_filling)
{
    CAIRN_STEP_BEGIN(solver->part_resume);
    for (solver->current = 0; solver->current < solver->result.poses; solver->current++) {
        begin_row(&solver->ordering, solver->current);
        do
            CAIRN_STEP_CHARGE_UNIT(solver, part_resume, budget);
        while (!visit_row(solver, solver->current, is_filling));
    }
    CAIRN_STEP_END(solver->part_resume);
}

/* Lists the children of every column in the elimination tree, the child with the most blocks last:
 * `head` holds the first child, `next` the siblings. */
static void list_children(struct block_solver_order *ordering, int32_t n)
{
    /* [parent] Child with the most blocks. */
    int32_t *last = ordering->last_member;

    for (int32_t column = 0; column < n; column++)
        ordering->head[column] = last[column] = -1;
    for (int32_t column = 0; column < n; column++) {
        int32_t parent = ordering->previous[column];

        if (parent >= 0 &&
            (last[parent] == -1 || ordering->length[column] >= ordering->length[last[parent]]))
            last[parent] = column;
    }
    for (int32_t column = n - 1; column >= 0; column--)
        if (ordering->previous[column] >= 0 && last[ordering->previous[column]] == column) {
            ordering->next[column] = -1;
            ordering->head[ordering->previous[column]] = column;
        }
    for (int32_t column = n - 1; column >= 0; column--)
        if (ordering->previous[column] >= 0 && last[ordering->previous[column]] != column) {
            ordering->next[column] = ordering->head[ordering->previous[column]];
            ordering->head[ordering->previous[column]] = column;
        }
}

/* Renumbers the columns by a postorder of the elimination tree: every column follows its children,
 * and subtrees are contiguous. The fill stays the same; accesses become local, and supernodes
 * (adjacent columns of the same rows) longer. */
static void postorder(cairn_block_solver *solver)
{
    struct block_solver_order *ordering = &solver->ordering;
    int32_t n = solver->result.poses, *post = ordering->size, *parent = ordering->degree,
            *count = ordering->elements, *order = ordering->next_member, next = 0;

    list_children(ordering, n);
    for (int32_t root = 0; root < n; root++)
        for (int32_t column = ordering->previous[root] == -1 ? root : -1; column != -1;) {
            int32_t child = ordering->head[column];

            if (child != -1) {
                ordering->head[column] = ordering->next[child];
                column = child;
            } else {
                post[column] = next++;
                column = ordering->previous[column];
            }
        }
    for (int32_t column = 0; column < n; column++) {
        parent[post[column]] =
            ordering->previous[column] >= 0 ? post[ordering->previous[column]] : -1;
        count[post[column]] = ordering->length[column];
        order[post[column]] = solver->order[column];
    }
    memcpy(ordering->previous, parent, (size_t)n * sizeof *parent);
    memcpy(ordering->length, count, (size_t)n * sizeof *count);
    memcpy(solver->order, order, (size_t)n * sizeof *order);
    for (int32_t column = 0; column < n; column++)
        solver->position[order[column]] = column;
}

/* Numbers the columns: the fill, the postorder, and the start of each column from the counts. 0 when
 * the fill is more than max_fill; then only the first is done. */
static int number_columns(cairn_block_solver *solver)
{
    struct block_solver_order *ordering = &solver->ordering;
    int32_t n = solver->result.poses;
    int64_t fill = 0;

    for (int32_t column = 0; column < n; column++)
        fill += ordering->length[column];
    solver->result.fill = fill < INT32_MAX ? (int32_t)fill : INT32_MAX;
    if (fill > solver->params.max_fill)
        return 0;
    postorder(solver);
    list_rows(solver);
    solver->column[0] = 0;
    for (int32_t column = 0; column < n; column++) {
        solver->column[column + 1] = solver->column[column] + ordering->length[column];
        ordering->length[column] = 0;
        ordering->mark[column] = -1;
    }
    return 1;
}

int32_t cairn_block_solver_find_block(const cairn_block_solver *solver, int32_t row, int32_t column)
{
    int32_t low = solver->column[column], high = solver->column[column + 1];

    while (low < high) {
        int32_t middle = low + (high - low) / 2;

        if (solver->rows[middle] < row)
            low = middle + 1;
        else
            high = middle;
    }
    return low < solver->column[column + 1] && solver->rows[low] == row ? low : -1;
}

/* Finds the block of a link. */
static void find_slot(cairn_block_solver *solver, int32_t link)
{
    int32_t a = solver->position[solver->first[link]], b = solver->position[solver->second[link]];

    solver->slot[link] = cairn_block_solver_find_block(solver, a > b ? a : b, a > b ? b : a);
    CAIRN_ASSERT(solver->slot[link] >= 0);
}

void cairn_block_solver_clear_values(cairn_block_solver *solver)
{
    memset(solver->diagonal, 0, (size_t)solver->result.poses * sizeof *solver->diagonal);
    memset(solver->blocks, 0, (size_t)solver->result.fill * sizeof *solver->blocks);
    solver->is_zero = 1;
    solver->solved = 0;
    solver->is_coupled = 0;
    solver->result.failed_pose = -1;
    solver->result.state = CAIRN_BLOCK_SOLVER_ANALYZED;
}

/* Lists the rows of H; no column has a parent or a block. Reuses arrays of the ordering: `previous`
 * holds the parents in the elimination tree, `length` the number of blocks of a column, and `mark`
 * the last row that visited a column. */
static void begin_counts(cairn_block_solver *solver)
{
    struct block_solver_order *ordering = &solver->ordering;

    list_rows(solver);
    memset(ordering->previous, -1, (size_t)solver->result.poses * sizeof *ordering->previous);
    memset(ordering->length, 0, (size_t)solver->result.poses * sizeof *ordering->length);
}

int cairn_block_solver_analysis(cairn_block_solver *solver, cairn_budget *budget)
{
    int32_t poses = solver->result.poses, links = solver->result.links;

    CAIRN_STEP_BEGIN(solver->resume);
    if (solver->stage == BLOCK_SOLVER_ANALYZE) {
        CAIRN_STEP_RUN(solver, resume, budget, cairn_block_solver_order);
        BLOCK_SOLVER_CHARGE_LIST(solver, resume, budget, poses + links);
        begin_counts(solver);
        CAIRN_STEP_UNTIL(solver->resume, visit_rows(solver, budget, 0));
    }
    BLOCK_SOLVER_CHARGE_LIST(solver, resume, budget, NUMBER_PASSES * poses + links);
    if (!number_columns(solver)) {
        block_solver_end(solver, CAIRN_BLOCK_SOLVER_NEW, CAIRN_FULL);
    } else {
        CAIRN_STEP_UNTIL(solver->resume, visit_rows(solver, budget, 1));
        for (solver->current = 0; solver->current < links; solver->current++) {
            CAIRN_STEP_CHARGE(solver, resume, budget, UNITS_PER_SLOT);
            find_slot(solver, solver->current);
        }
        BLOCK_SOLVER_CHARGE_LIST(solver, resume, budget, poses + solver->result.fill);
        cairn_block_solver_clear_values(solver);
        block_solver_end(solver, CAIRN_BLOCK_SOLVER_ANALYZED, CAIRN_OK);
    }
    CAIRN_STEP_END(solver->resume);
}
