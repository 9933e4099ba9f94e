/* Linear assignment by shortest augmenting paths.
 *
 * Method: rows of the smaller side are added one after another. From the new row the shortest path
 * to a free column is grown as Dijkstra grows it, over costs reduced by the duals, which are never
 * negative; along it all pairs are exchanged, and the duals of what was reached are moved so that
 * they stay so. Of columns equally near the first one is reached first.
 *
 * Layout: duals, pairs both ways, and of the path under way each column's distance and the row
 * before it. A table with more rows than columns is read crosswise: `short` and `long` are its
 * sides.
 *
 * Limits: rounding can make one of two nearly equal pairings the cheaper one.
 *
 * Source: Jonker & Volgenant 1987, their augmentation, without the reductions before it, which
 * need square tables; for rectangular ones Crouse 2016. */
#include "src/core/build.h"

#include <string.h>

#include "cairn/assignment.h"

enum { SIDE_MOST = 4096, COLUMNS_A_UNIT = 8 };
enum { IDLE, GROW, AUGMENT, DONE };

static const cairn_real COST_MOST = CAIRN_REAL(1e9);

struct cairn_assignment {
    cairn_assignment_params params;
    cairn_real *short_dual, *long_dual;
    cairn_real *distance;   /* [long] of the path under way */
    int32_t *before;        /* [long] the row before each column on it */
    int32_t *long_of_short; /* pairs */
    int32_t *short_of_long;
    uint8_t *reached; /* [long] */
    int32_t *column;  /* [rows] the result */
    const cairn_real *cost;
    int32_t rows, columns, short_count, long_count;
    int32_t row, at;   /* that is added; the end of the path */
    int32_t last;      /* the column that was reached last */
    cairn_real length; /* of the path */
    cairn_real sum;
    int32_t phase, paid;
};

cairn_assignment_params cairn_assignment_default(void)
{
    cairn_assignment_params params = {128, 128};

    return params;
}

static int params_are_good(const cairn_assignment_params *p)
{
    return p != NULL && p->max_rows >= 1 && p->max_rows <= SIDE_MOST && p->max_columns >= 1 &&
           p->max_columns <= SIDE_MOST;
}

static cairn_assignment *carve(cairn_pool *pool, const cairn_assignment_params *p)
{
    size_t rows = (size_t)p->max_rows, columns = (size_t)p->max_columns;
    size_t less = rows < columns ? rows : columns, more = rows < columns ? columns : rows;
    cairn_assignment *a = cairn_pool_take_one(pool, sizeof *a);
    cairn_real *short_dual = cairn_pool_take(pool, less, sizeof *short_dual);
    cairn_real *long_dual = cairn_pool_take(pool, more, sizeof *long_dual);
    cairn_real *distance = cairn_pool_take(pool, more, sizeof *distance);
    int32_t *before = cairn_pool_take(pool, more, sizeof *before);
    int32_t *long_of_short = cairn_pool_take(pool, less, sizeof *long_of_short);
    int32_t *short_of_long = cairn_pool_take(pool, more, sizeof *short_of_long);
    int32_t *column = cairn_pool_take(pool, rows, sizeof *column);
    uint8_t *reached = cairn_pool_take(pool, more, sizeof *reached);

    if (a != NULL) {
        memset(a, 0, sizeof *a);
        a->short_dual = short_dual;
        a->long_dual = long_dual;
        a->distance = distance;
        a->before = before;
        a->long_of_short = long_of_short;
        a->short_of_long = short_of_long;
        a->column = column;
        a->reached = reached;
    }
    return a;
}

size_t cairn_assignment_memory(const cairn_assignment_params *params)
{
    cairn_pool counting;

    if (!params_are_good(params))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_assignment_create(cairn_assignment **assignment, cairn_pool *pool,
                                     const cairn_assignment_params *params)
{
    size_t need = cairn_assignment_memory(params);

    if (assignment == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    *assignment = carve(pool, params);
    (*assignment)->params = *params;
    return CAIRN_OK;
}

/* A new path from a row. */
static void start_path(cairn_assignment *a, int32_t row)
{
    a->row = a->at = row;
    a->last = -1;
    a->length = 0;
    for (int32_t j = 0; j < a->long_count; j++)
        a->distance[j] = CAIRN_REAL_MAX;
    memset(a->reached, 0, (size_t)a->long_count);
}

cairn_status cairn_assignment_begin(cairn_assignment *a, const cairn_real *cost, int32_t rows,
                                    int32_t columns)
{
    if (a == NULL || cost == NULL || rows < 1 || columns < 1)
        return CAIRN_BAD_ARGUMENT;
    if (rows > a->params.max_rows || columns > a->params.max_columns)
        return CAIRN_FULL;
    a->cost = cost;
    a->rows = rows;
    a->columns = columns;
    a->short_count = rows < columns ? rows : columns;
    a->long_count = rows < columns ? columns : rows;
    for (int32_t i = 0; i < a->short_count; i++) {
        a->short_dual[i] = 0;
        a->long_of_short[i] = -1;
    }
    for (int32_t j = 0; j < a->long_count; j++) {
        a->long_dual[j] = 0;
        a->short_of_long[j] = -1;
    }
    start_path(a, 0);
    a->paid = 0;
    a->phase = GROW;
    return CAIRN_OK;
}

static cairn_real cost_of(const cairn_assignment *a, int32_t i, int32_t j)
{
    return a->rows <= a->columns ? a->cost[(size_t)i * (size_t)a->columns + (size_t)j]
                                 : a->cost[(size_t)j * (size_t)a->columns + (size_t)i];
}

/* Brings every column's distance up to date with the path's end, and reaches the nearest one. 0:
 * a cost cannot be used. */
static int grow(cairn_assignment *a)
{
    int32_t nearest = -1;

    for (int32_t j = 0; j < a->long_count; j++) {
        cairn_real cost = cost_of(a, a->at, j), distance;

        if (!(cairn_abs(cost) <= COST_MOST))
            return 0;
        if (a->reached[j])
            continue;
        distance = a->length + (cost - a->short_dual[a->at] - a->long_dual[j]);
        if (distance < a->distance[j]) {
            a->distance[j] = distance;
            a->before[j] = a->at;
        }
        if (nearest < 0 || a->distance[j] < a->distance[nearest])
            nearest = j;
    }
    a->length = a->distance[nearest];
    a->reached[nearest] = 1;
    a->last = nearest;
    if (a->short_of_long[nearest] < 0)
        a->phase = AUGMENT;
    else
        a->at = a->short_of_long[nearest];
    return 1;
}

static void move_duals(cairn_assignment *a)
{
    a->short_dual[a->row] += a->length;
    for (int32_t j = 0; j < a->long_count; j++)
        if (a->reached[j]) {
            cairn_real by = a->length - a->distance[j];

            if (a->short_of_long[j] >= 0)
                a->short_dual[a->short_of_long[j]] += by;
            a->long_dual[j] -= by;
        }
}

static void exchange_pairs(cairn_assignment *a)
{
    int32_t j = a->last, i;

    do {
        int32_t next;

        i = a->before[j];
        next = a->long_of_short[i];
        a->long_of_short[i] = j;
        a->short_of_long[j] = i;
        j = next;
    } while (i != a->row);
}

static void finish(cairn_assignment *a)
{
    a->sum = 0;
    for (int32_t i = 0; i < a->rows; i++)
        a->column[i] = a->rows <= a->columns ? a->long_of_short[i] : a->short_of_long[i];
    for (int32_t i = 0; i < a->rows; i++)
        if (a->column[i] >= 0)
            a->sum += a->cost[(size_t)i * (size_t)a->columns + (size_t)a->column[i]];
    a->phase = DONE;
}

cairn_status cairn_assignment_step(cairn_assignment *a, cairn_budget *budget)
{
    if (a == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (a->phase == GROW || a->phase == AUGMENT) {
        if (!cairn_budget_pay(budget, &a->paid, 1 + a->long_count / COLUMNS_A_UNIT))
            return CAIRN_MORE;
        if (a->phase == GROW) {
            if (!grow(a)) {
                a->phase = IDLE;
                return CAIRN_NOT_FINITE;
            }
            continue;
        }
        move_duals(a);
        exchange_pairs(a);
        if (a->row + 1 < a->short_count) {
            start_path(a, a->row + 1);
            a->phase = GROW;
        } else {
            finish(a);
        }
    }
    return CAIRN_OK;
}

cairn_assignment_result cairn_assignment_read(const cairn_assignment *a)
{
    cairn_assignment_result result = {NULL, 0, 0, 0};

    if (a != NULL && a->phase == DONE) {
        result.column = a->column;
        result.rows = a->rows;
        result.pairs = a->short_count;
        result.cost = a->sum;
    }
    return result;
}
