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

/* Work units of the search for the block of a link. */
enum { UNITS_PER_SLOT = 2 };

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

/* First pass over a row: extends the elimination tree and counts blocks. Returns the entries
 * visited. */
static int32_t count_row(struct block_solver_order *ordering, int32_t row)
{
    int32_t visited = 1;

    ordering->previous[row] = -1;
    ordering->mark[row] = row;
    for (int32_t k = ordering->start[row]; k < ordering->start[row + 1]; k++, visited++)
        for (int32_t column = ordering->graph[k]; ordering->mark[column] != row;
             column = ordering->previous[column], visited++) {
            if (ordering->previous[column] == -1)
                ordering->previous[column] = row;
            ordering->mark[column] = row;
            ordering->length[column]++;
        }
    return visited;
}

/* Second pass over a row: writes the row number into its columns. Returns the entries visited. */
static int32_t fill_row(cairn_block_solver *solver, int32_t row)
{
    struct block_solver_order *ordering = &solver->ordering;
    int32_t visited = 1;

    ordering->mark[row] = row;
    for (int32_t k = ordering->start[row]; k < ordering->start[row + 1]; k++, visited++)
        for (int32_t column = ordering->graph[k]; ordering->mark[column] != row;
             column = ordering->previous[column], visited++) {
            ordering->mark[column] = row;
            solver->rows[solver->column[column] + ordering->length[column]++] = row;
        }
    return visited;
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

/* Numbers the columns: the fill, the postorder, and the start of each column from the counts. Does
 * only the first when the fill is more than max_fill. Returns the entries visited. */
static int32_t number_columns(cairn_block_solver *solver)
{
    struct block_solver_order *ordering = &solver->ordering;
    int32_t n = solver->result.poses;
    int64_t fill = 0;

    for (int32_t column = 0; column < n; column++)
        fill += ordering->length[column];
    solver->result.fill = fill < INT32_MAX ? (int32_t)fill : INT32_MAX;
    if (fill > solver->params.max_fill)
        return n;
    postorder(solver);
    list_rows(solver);
    solver->column[0] = 0;
    for (int32_t column = 0; column < n; column++) {
        solver->column[column + 1] = solver->column[column] + ordering->length[column];
        ordering->length[column] = 0;
        ordering->mark[column] = -1;
    }
    return 8 * n + solver->result.links;
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

/* Reuses arrays of the ordering: `previous` holds the parents in the elimination tree, `length` the
 * number of blocks of a column, and `mark` the last row that visited a column. */
int cairn_block_solver_count_rows(cairn_block_solver *solver, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(solver->part_resume);
    list_rows(solver);
    memset(solver->ordering.length, 0,
           (size_t)solver->result.poses * sizeof *solver->ordering.length);
    for (solver->current = 0; solver->current < solver->result.poses; solver->current++) {
        CAIRN_STEP_UNTIL(solver->part_resume, cairn_block_solver_is_ready(solver, budget));
        cairn_block_solver_charge_entries(solver, count_row(&solver->ordering, solver->current));
    }
    CAIRN_STEP_END(solver->part_resume);
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

int cairn_block_solver_fill_columns(cairn_block_solver *solver, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(solver->part_resume);
    CAIRN_STEP_UNTIL(solver->part_resume, cairn_block_solver_is_ready(solver, budget));
    cairn_block_solver_charge_entries(solver, number_columns(solver));
    if (solver->result.fill > solver->params.max_fill) {
        block_solver_end(solver, CAIRN_BLOCK_SOLVER_NEW, CAIRN_FULL);
    } else {
        for (solver->current = 0; solver->current < solver->result.poses; solver->current++) {
            CAIRN_STEP_UNTIL(solver->part_resume, cairn_block_solver_is_ready(solver, budget));
            cairn_block_solver_charge_entries(solver, fill_row(solver, solver->current));
        }
        cairn_block_solver_charge(solver, UNITS_PER_SLOT);
        for (solver->current = 0; solver->current < solver->result.links; solver->current++) {
            CAIRN_STEP_UNTIL(solver->part_resume, cairn_block_solver_is_ready(solver, budget));
            find_slot(solver, solver->current);
            cairn_block_solver_charge(solver, UNITS_PER_SLOT);
        }
        CAIRN_STEP_UNTIL(solver->part_resume, cairn_block_solver_is_ready(solver, budget));
        cairn_block_solver_clear_values(solver);
        cairn_block_solver_charge(solver,
                                  UNITS_PER_SLOT + (solver->result.poses + solver->result.fill) /
                                                       BLOCK_SOLVER_ENTRIES_PER_UNIT);
        block_solver_end(solver, CAIRN_BLOCK_SOLVER_ANALYZED, CAIRN_OK);
    }
    CAIRN_STEP_END(solver->part_resume);
}
