/* Linear assignment by shortest augmenting paths (the Hungarian method in the form of Jonker and
 * Volgenant).
 *
 * Method:
 * 1. The rows of the smaller side are added one after another.
 * 2. From the added row the shortest path to an unpaired column is grown by Dijkstra's algorithm
 *    over the reduced costs (costs minus duals), which are never negative. Of columns at equal
 *    distance the first one is reached first.
 * 3. All pairs along the path are exchanged, and the duals of the rows and columns reached are
 *    updated, so the reduced costs stay nonnegative.
 *
 * Layout: duals, pairs in both directions, and for the current path the distance and the
 * predecessor of each column. A table with more rows than columns is read transposed: `short` and
 * `long` are its sides.
 *
 * Limits: rounding can make one of two nearly equal assignments the cheaper one.
 *
 * Source: Jonker and Volgenant 1987 (the augmentation, without the reductions before it, which need
 * square tables); for rectangular tables Crouse 2016. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/assignment.h"
#include "src/base/object.h"
#include "src/base/step.h"

/* Largest number of rows and columns, and columns visited per work unit. */
enum { MAX_SIDE = 4096, COLUMNS_PER_UNIT = 8 };

/* Largest absolute cost. */
static const cairn_real MAX_COST = CAIRN_REAL(1e9);

struct cairn_assignment {
    cairn_assignment_params params;
    /* [short], [long] Dual variables of both sides. */
    cairn_real *short_dual, *long_dual;
    /* [long] Length of the shortest path to each column. */
    cairn_real *distance;
    /* [long] Row before each column on its shortest path. */
    int32_t *predecessor;
    /* [short] Column of each row, -1: unpaired. */
    int32_t *long_of_short;
    /* [long] Row of each column, -1: unpaired. */
    int32_t *short_of_long;
    /* [long] 1: the shortest path to the column is final. */
    uint8_t *reached;
    /* [rows] Result: column of each row. */
    int32_t *column;
    /* [rows * columns] Cost table of the caller. */
    const cairn_real *cost;
    int32_t rows, columns, short_count, long_count;
    /* Row that is added; last row of the current path, -1: its last column is unpaired. */
    int32_t added_row, path_end;
    /* Column that was reached last. */
    int32_t last_column;
    /* Length of the path to that column. */
    cairn_real path_length;
    /* Sum of the costs of the pairs. */
    cairn_real total_cost;
    /* CAIRN_EMPTY: no table; CAIRN_MORE: work is left; CAIRN_OK: the result is complete;
     * CAIRN_NOT_FINITE: the table was refused. */
    cairn_status status;
    /* Resume point of the step. */
    int32_t resume;
    /* Work units charged for the next operation so far. */
    int32_t units_charged;
};

#define INTEGER(field, ...) CAIRN_INTEGER(cairn_assignment_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter parameter_rows[] = {
    INTEGER(max_rows, 128, 1, MAX_SIDE),
    INTEGER(max_columns, 128, 1, MAX_SIDE),
};
extern const cairn_parameters cairn_assignment_parameters;
const cairn_parameters cairn_assignment_parameters =
    CAIRN_PARAMETERS("assignment", cairn_assignment_params, parameter_rows);

cairn_assignment_params cairn_assignment_default(void)
{
    cairn_assignment_params params;

    cairn_parameters_preset(&cairn_assignment_parameters, &params);
    return params;
}

cairn_status cairn_assignment_check(const cairn_assignment_params *params,
                                    cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_assignment_parameters, params, fault);
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_assignment *build(cairn_pool *pool, const cairn_assignment_params *params)
{
    size_t rows = (size_t)params->max_rows, columns = (size_t)params->max_columns;
    size_t short_side = rows < columns ? rows : columns,
           long_side = rows < columns ? columns : rows;
    cairn_assignment *assignment = cairn_object_take(pool, sizeof *assignment);

    CAIRN_TAKE(assignment, pool, short_dual, short_side);
    CAIRN_TAKE(assignment, pool, long_dual, long_side);
    CAIRN_TAKE(assignment, pool, distance, long_side);
    CAIRN_TAKE(assignment, pool, predecessor, long_side);
    CAIRN_TAKE(assignment, pool, long_of_short, short_side);
    CAIRN_TAKE(assignment, pool, short_of_long, long_side);
    CAIRN_TAKE(assignment, pool, column, rows);
    CAIRN_TAKE(assignment, pool, reached, long_side);
    if (assignment != NULL) {
        assignment->params = *params;
        assignment->status = CAIRN_EMPTY;
    }
    return assignment;
}

CAIRN_OBJECT(assignment, assignment, build);

cairn_status cairn_assignment_begin(cairn_assignment *assignment, const cairn_real *cost,
                                    int32_t rows, int32_t columns)
{
    if (assignment == NULL || cost == NULL || rows < 1 || columns < 1)
        return CAIRN_BAD_ARGUMENT;
    if (rows > assignment->params.max_rows || columns > assignment->params.max_columns)
        return CAIRN_FULL;
    assignment->cost = cost;
    assignment->rows = rows;
    assignment->columns = columns;
    assignment->short_count = rows < columns ? rows : columns;
    assignment->long_count = rows < columns ? columns : rows;
    for (int32_t i = 0; i < assignment->short_count; i++) {
        assignment->short_dual[i] = 0;
        assignment->long_of_short[i] = -1;
    }
    for (int32_t j = 0; j < assignment->long_count; j++) {
        assignment->long_dual[j] = 0;
        assignment->short_of_long[j] = -1;
    }
    assignment->resume = assignment->units_charged = 0;
    assignment->status = CAIRN_MORE;
    return CAIRN_OK;
}

/* Cost of row i of the short side and column j of the long side. */
static cairn_real cost_of(const cairn_assignment *assignment, int32_t i, int32_t j)
{
    return assignment->rows <= assignment->columns
               ? assignment->cost[(size_t)i * (size_t)assignment->columns + (size_t)j]
               : assignment->cost[(size_t)j * (size_t)assignment->columns + (size_t)i];
}

/* Starts the shortest path from the added row. */
static void start_path(cairn_assignment *assignment)
{
    assignment->path_end = assignment->added_row;
    assignment->last_column = -1;
    assignment->path_length = 0;
    for (int32_t j = 0; j < assignment->long_count; j++)
        assignment->distance[j] = CAIRN_REAL_MAX;
    memset(assignment->reached, 0, (size_t)assignment->long_count);
}

/* One iteration of Dijkstra's algorithm: relaxes the distances of all columns by the last row of
 * the path, and reaches the closest column. 0: a cost is not finite or too large, see `status`. */
static int grow_path(cairn_assignment *assignment)
{
    int32_t nearest = -1;

    for (int32_t j = 0; j < assignment->long_count; j++) {
        cairn_real cost = cost_of(assignment, assignment->path_end, j), distance;

        if (!(cairn_abs(cost) <= MAX_COST)) {
            assignment->status = CAIRN_NOT_FINITE;
            return 0;
        }
        if (assignment->reached[j])
            continue;
        distance = assignment->path_length +
                   (cost - assignment->short_dual[assignment->path_end] - assignment->long_dual[j]);
        if (distance < assignment->distance[j]) {
            assignment->distance[j] = distance;
            assignment->predecessor[j] = assignment->path_end;
        }
        if (nearest < 0 || assignment->distance[j] < assignment->distance[nearest])
            nearest = j;
    }
    assignment->path_length = assignment->distance[nearest];
    assignment->reached[nearest] = 1;
    assignment->last_column = nearest;
    assignment->path_end = assignment->short_of_long[nearest];
    return 1;
}

/* Updates the duals of the rows and columns reached. */
static void update_duals(cairn_assignment *assignment)
{
    assignment->short_dual[assignment->added_row] += assignment->path_length;
    for (int32_t j = 0; j < assignment->long_count; j++)
        if (assignment->reached[j]) {
            cairn_real change = assignment->path_length - assignment->distance[j];

            if (assignment->short_of_long[j] >= 0)
                assignment->short_dual[assignment->short_of_long[j]] += change;
            assignment->long_dual[j] -= change;
        }
}

/* Exchanges the pairs along the path, from its last column to the added row. */
static void augment_pairs(cairn_assignment *assignment)
{
    int32_t j = assignment->last_column, i;

    do {
        int32_t next;

        i = assignment->predecessor[j];
        next = assignment->long_of_short[i];
        assignment->long_of_short[i] = j;
        assignment->short_of_long[j] = i;
        j = next;
    } while (i != assignment->added_row);
}

/* Writes the result. */
static void finish(cairn_assignment *assignment)
{
    assignment->total_cost = 0;
    for (int32_t i = 0; i < assignment->rows; i++)
        assignment->column[i] = assignment->rows <= assignment->columns
                                    ? assignment->long_of_short[i]
                                    : assignment->short_of_long[i];
    for (int32_t i = 0; i < assignment->rows; i++)
        if (assignment->column[i] >= 0)
            assignment->total_cost +=
                assignment
                    ->cost[(size_t)i * (size_t)assignment->columns + (size_t)assignment->column[i]];
    assignment->status = CAIRN_OK;
}

/* Adds row after row: the shortest path from it to an unpaired column, and the exchange of the pairs
 * along the path. */
static int add_rows(cairn_assignment *assignment, cairn_budget *budget)
{
    int32_t units = 1 + assignment->long_count / COLUMNS_PER_UNIT;

    CAIRN_STEP_BEGIN(assignment->resume);
    for (assignment->added_row = 0; assignment->added_row < assignment->short_count;
         assignment->added_row++) {
        CAIRN_STEP_CHARGE(assignment, resume, budget, units);
        start_path(assignment);
        do {
            CAIRN_STEP_CHARGE(assignment, resume, budget, units);
            CAIRN_STEP_UNTIL(assignment->resume, grow_path(assignment));
        } while (assignment->path_end >= 0);
        CAIRN_STEP_CHARGE(assignment, resume, budget, units);
        update_duals(assignment);
        augment_pairs(assignment);
    }
    CAIRN_STEP_CHARGE(assignment, resume, budget, 1 + assignment->rows / COLUMNS_PER_UNIT);
    finish(assignment);
    CAIRN_STEP_END(assignment->resume);
}

cairn_status cairn_assignment_step(cairn_assignment *assignment, cairn_budget *budget)
{
    if (assignment == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (assignment->status != CAIRN_MORE)
        return CAIRN_OK;
    (void)add_rows(assignment, budget);
    return assignment->status;
}

cairn_assignment_result cairn_assignment_read(const cairn_assignment *assignment)
{
    cairn_assignment_result result = {0};

    if (assignment != NULL && assignment->status == CAIRN_OK) {
        result.column = assignment->column;
        result.rows = assignment->rows;
        result.pairs = assignment->short_count;
        result.total_cost = assignment->total_cost;
    }
    return result;
}
