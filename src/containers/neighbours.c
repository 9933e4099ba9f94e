/* Hash grid over points, and sweep and prune over boxes.
 *
 * Method of the hash grid:
 * 1. The plane is divided into square cells. The points of all cells with the same hash are in one
 *    bucket, a linked list (heads, next), the point inserted last first.
 * 2. A query visits the buckets of the cells within its radius. It tests every candidate by its
 *    distance, so points of other cells in the same bucket do no harm. The radius search also
 *    compares cells, so each point is reported once.
 * 3. The nearest neighbour is searched in rings of cells around the query. The range of cells
 *    shrinks to the distance found.
 * 4. A query whose radius covers more cells than there are points tests all points instead, which
 *    bounds the cost.
 *
 * Method of sweep and prune (Cohen, Lin, Manocha and Ponamgi 1995):
 * 1. The boxes are sorted by the left side, ties by index. The order of the last sweep is sorted
 *    again by insertion, linear when the boxes moved little; after many new boxes by Shell sort
 *    (Shell 1959). The sort swaps in place: the order is a permutation at all times, and a sweep
 *    may be restarted in the middle of another.
 * 2. Each box is tested against the following boxes whose left side is not beyond its right side.
 *
 * Limits: cell numbers are clamped to +-2^30, so points farther away share the outermost cells:
 * slower, not wrong. Boxes that are empty or contain a NaN are sorted last and overlap no box. */
#include "src/base/build.h"

#include "cairn/neighbours.h"
#include "src/base/object.h"
#include "src/containers/cell_grid.h"

/* Largest number of points or boxes, largest absolute cell number, and the end of a linked list. */
enum { MAX_COUNT = 1 << 28, MAX_CELL = 1 << 30, NO_INDEX = -1 };

/* Smaller one of two integers. */
static int32_t smaller(int32_t a, int32_t b)
{
    return a < b ? a : b;
}

/* Larger one of two integers. */
static int32_t larger(int32_t a, int32_t b)
{
    return a > b ? a : b;
}

/* ---- Hash grid ---- */

struct cairn_point_grid {
    /* [capacity] Points, in m. */
    cairn_vec2 *points;
    /* [capacity] Next point of the same bucket, NO_INDEX: the last. */
    int32_t *next;
    /* [mask + 1] First point of each bucket, NO_INDEX: none. */
    int32_t *heads;
    /* Cells per m. */
    cairn_real inverse_cell_size;
    /* Number of buckets, a power of 2, minus 1. */
    uint32_t mask;
    /* Largest number of points, and their number. */
    int32_t capacity;
    int32_t count;
};

/* Range of cells, borders included; empty when min > max. */
struct cell_box {
    int32_t min_x, max_x, min_y, max_y;
};

/* Number of buckets: the least power of 2 that is not less than max_points. */
static uint32_t bucket_count(int32_t max_points)
{
    uint32_t buckets = 1;

    while (buckets < (uint32_t)max_points)
        buckets *= 2;
    return buckets;
}

/* Without defaults: lowest and highest value. */
static const cairn_parameter grid_rows[] = {
    CAIRN_INTEGER(cairn_point_grid_params, max_points, 0, 1, MAX_COUNT),
    CAIRN_NUMBER_ABOVE(cairn_point_grid_params, cell_size, 0, 0, CAIRN_REAL_MAX),
};
extern const cairn_parameters cairn_point_grid_parameters;
const cairn_parameters cairn_point_grid_parameters =
    CAIRN_PARAMETERS("point_grid", cairn_point_grid_params, grid_rows);

cairn_status cairn_point_grid_check(const cairn_point_grid_params *params,
                                    cairn_object_fault *fault)
{
    cairn_status status = cairn_parameters_check(&cairn_point_grid_parameters, params, fault);

    if (status == CAIRN_OK)
        status = cairn_parameters_require(1 / params->cell_size <= CAIRN_REAL_MAX, "point_grid",
                                          "cell_size: with a finite inverse", fault);
    return status;
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_point_grid *build_point_grid(cairn_pool *pool, const cairn_point_grid_params *params)
{
    cairn_point_grid *grid = cairn_object_take(pool, sizeof *grid);

    CAIRN_TAKE(grid, pool, points, params->max_points);
    CAIRN_TAKE(grid, pool, next, params->max_points);
    CAIRN_TAKE(grid, pool, heads, bucket_count(params->max_points));
    if (grid != NULL) {
        grid->inverse_cell_size = 1 / params->cell_size;
        grid->mask = bucket_count(params->max_points) - 1;
        grid->capacity = params->max_points;
        cairn_point_grid_clear(grid);
    }
    return grid;
}

CAIRN_OBJECT(point_grid, point_grid, build_point_grid);

void cairn_point_grid_clear(cairn_point_grid *grid)
{
    for (uint32_t i = 0; i <= grid->mask; i++)
        grid->heads[i] = NO_INDEX;
    grid->count = 0;
}

/* Cell number of a coordinate, rounded down and clamped. Monotone in the coordinate, which the
 * pruning relies on. */
static int32_t cell_of(const cairn_point_grid *grid, cairn_real coordinate)
{
    cairn_real scaled = coordinate * grid->inverse_cell_size;
    int32_t cell = larger(-MAX_CELL, smaller(cairn_real_to_int(scaled), MAX_CELL));

    return cell - ((cairn_real)cell > scaled);
}

/* Bucket of a cell, by its hash. */
static uint32_t bucket_of(const cairn_point_grid *grid, int32_t x, int32_t y)
{
    return cell_hash(x, y, 0) & grid->mask;
}

/* Range of the cells of all points whose computed distance from p is at most `radius`. The radius
 * is enlarged by more than the rounding and the underflow of that distance. Rounding of the sums is
 * monotone, so no point at a border is missed. */
static struct cell_box cells_within(const cairn_point_grid *grid, cairn_vec2 p, cairn_real radius)
{
    cairn_real safe_radius = radius * (1 + 8 * CAIRN_REAL_EPSILON) + CAIRN_REAL(1e-19);
    struct cell_box box = {cell_of(grid, p.x - safe_radius), cell_of(grid, p.x + safe_radius),
                           cell_of(grid, p.y - safe_radius), cell_of(grid, p.y + safe_radius)};
    return box;
}

/* 1 when testing all points is cheaper than visiting the cells. */
static int covers_too_many_cells(const cairn_point_grid *grid, struct cell_box box)
{
    int64_t width = (int64_t)box.max_x - box.min_x + 1, height = (int64_t)box.max_y - box.min_y + 1;

    return width * height > grid->count;
}

cairn_status cairn_point_grid_insert(cairn_point_grid *grid, cairn_vec2 point)
{
    uint32_t bucket;

    if (!cairn_vec2_is_finite(point))
        return CAIRN_NOT_FINITE;
    if (grid->count == grid->capacity)
        return CAIRN_FULL;
    bucket = bucket_of(grid, cell_of(grid, point.x), cell_of(grid, point.y));
    grid->points[grid->count] = point;
    grid->next[grid->count] = grid->heads[bucket];
    grid->heads[bucket] = grid->count;
    grid->count++;
    return CAIRN_OK;
}

void cairn_point_grid_remove_last(cairn_point_grid *grid)
{
    cairn_vec2 point;

    if (grid->count == 0)
        return;
    grid->count--;
    point = grid->points[grid->count];
    grid->heads[bucket_of(grid, cell_of(grid, point.x), cell_of(grid, point.y))] =
        grid->next[grid->count];
}

int32_t cairn_point_grid_count(const cairn_point_grid *grid)
{
    return grid->count;
}

cairn_vec2 cairn_point_grid_point(const cairn_point_grid *grid, int32_t index)
{
    CAIRN_ASSERT(index >= 0 && index < grid->count);
    return grid->points[index];
}

/* Nearest neighbour so far: least distance, then lowest index. */
struct nearest {
    /* Query point, in m. */
    cairn_vec2 query;
    /* Squared distance of the nearest point, at first the squared radius, in m^2. */
    cairn_real distance_squared;
    /* Index of the nearest point, NO_INDEX: none. */
    int32_t index;
    /* Gate on the directions of points; NULL: none. */
    const cairn_point_grid_facing *facing;
    /* Points and cells visited. */
    int32_t visited;
};

/* 1 when point i passes the gate on directions. */
static int passes_gate(const cairn_point_grid_facing *facing, int32_t i)
{
    return facing == NULL ||
           cairn_vec2_dot(facing->directions[i], facing->direction) >= facing->min_cosine;
}

/* Tests point i. */
static void visit_point(const cairn_point_grid *grid, int32_t i, struct nearest *best)
{
    cairn_real d = cairn_vec2_norm_squared(cairn_vec2_sub(grid->points[i], best->query));

    best->visited++;
    if ((d < best->distance_squared ||
         (d == best->distance_squared && (best->index == NO_INDEX || i < best->index))) &&
        passes_gate(best->facing, i)) {
        best->distance_squared = d;
        best->index = i;
    }
}

/* Tests the points of a bucket. */
static void visit_cell(const cairn_point_grid *grid, int32_t x, int32_t y, struct nearest *best)
{
    best->visited++;
    for (int32_t i = grid->heads[bucket_of(grid, x, y)]; i != NO_INDEX; i = grid->next[i])
        visit_point(grid, i, best);
}

/* Visits the cells at Chebyshev distance `ring` from the centre cell that lie in the box. */
static void visit_ring(const cairn_point_grid *grid, int32_t centre_x, int32_t centre_y,
                       int32_t ring, struct cell_box box, struct nearest *best)
{
    int32_t low_x = larger(centre_x - ring, box.min_x),
            high_x = smaller(centre_x + ring, box.max_x);
    int32_t low_y = larger(centre_y - ring, box.min_y),
            high_y = smaller(centre_y + ring, box.max_y);

    for (int32_t y = low_y; y <= high_y; y++) {
        if (y == centre_y - ring || y == centre_y + ring) {
            for (int32_t x = low_x; x <= high_x; x++)
                visit_cell(grid, x, y, best);
            continue;
        }
        if (low_x == centre_x - ring)
            visit_cell(grid, low_x, y, best);
        if (high_x == centre_x + ring)
            visit_cell(grid, high_x, y, best);
    }
}

/* Number of the last ring around the centre cell that reaches into the box. */
static int32_t rings_within(struct cell_box box, int32_t centre_x, int32_t centre_y)
{
    return larger(larger(centre_x - box.min_x, box.max_x - centre_x),
                  larger(centre_y - box.min_y, box.max_y - centre_y));
}

/* Searches the nearest neighbour of best->query within a radius. */
static void find_nearest(const cairn_point_grid *grid, cairn_real radius, struct nearest *best)
{
    struct cell_box box;
    int32_t centre_x, centre_y;

    if (!(radius >= 0) || !cairn_vec2_is_finite(best->query))
        return;
    best->distance_squared = radius * radius;
    box = cells_within(grid, best->query, radius);
    if (covers_too_many_cells(grid, box)) {
        for (int32_t i = 0; i < grid->count; i++)
            visit_point(grid, i, best);
        return;
    }
    centre_x = cell_of(grid, best->query.x);
    centre_y = cell_of(grid, best->query.y);
    for (int32_t ring = 0; ring <= rings_within(box, centre_x, centre_y); ring++) {
        visit_ring(grid, centre_x, centre_y, ring, box, best);
        box = cells_within(grid, best->query, cairn_sqrt(best->distance_squared));
    }
}

int32_t cairn_point_grid_nearest(const cairn_point_grid *grid, cairn_vec2 p, cairn_real radius,
                                 cairn_real *distance_squared)
{
    struct nearest best = {.query = p, .index = NO_INDEX};

    find_nearest(grid, radius, &best);
    if (best.index != NO_INDEX && distance_squared != NULL)
        *distance_squared = best.distance_squared;
    return best.index;
}

int32_t cairn_point_grid_nearest_facing(const cairn_point_grid *grid, cairn_vec2 p,
                                        cairn_real radius, const cairn_point_grid_facing *facing,
                                        int32_t *visited)
{
    struct nearest best = {.query = p, .index = NO_INDEX, .facing = facing};

    find_nearest(grid, radius, &best);
    *visited = best.visited;
    return best.index;
}

int32_t cairn_point_grid_has_near(const cairn_point_grid *grid, cairn_vec2 p, cairn_real radius)
{
    struct cell_box box;

    if (!(radius >= 0) || !cairn_vec2_is_finite(p))
        return 0;
    box = cells_within(grid, p, radius);
    if (covers_too_many_cells(grid, box))
        return cairn_point_grid_nearest(grid, p, radius, NULL) != NO_INDEX;
    for (int32_t y = box.min_y; y <= box.max_y; y++)
        for (int32_t x = box.min_x; x <= box.max_x; x++)
            for (int32_t i = grid->heads[bucket_of(grid, x, y)]; i != NO_INDEX; i = grid->next[i])
                if (cairn_vec2_norm_squared(cairn_vec2_sub(grid->points[i], p)) <= radius * radius)
                    return 1;
    return 0;
}

cairn_point_grid_cursor cairn_point_grid_begin(const cairn_point_grid *grid, cairn_vec2 p,
                                               cairn_real radius)
{
    cairn_point_grid_cursor cursor = {
        .centre = p, .radius_squared = radius * radius, .max_y = -1, .next = NO_INDEX};
    struct cell_box box;

    if (grid->count == 0 || !(radius >= 0) || !cairn_vec2_is_finite(p))
        return cursor;
    box = cells_within(grid, p, radius);
    if (covers_too_many_cells(grid, box)) {
        cursor.all = 1;
        cursor.next = 0;
        return cursor;
    }
    cursor.min_x = box.min_x;
    cursor.max_x = box.max_x;
    cursor.max_y = box.max_y;
    cursor.x = box.min_x;
    cursor.y = box.min_y;
    cursor.next = grid->heads[bucket_of(grid, cursor.x, cursor.y)];
    return cursor;
}

/* 1 when point i lies within the radius of the search. */
static int is_within_radius(const cairn_point_grid *grid, const cairn_point_grid_cursor *cursor,
                            int32_t i)
{
    return cairn_vec2_norm_squared(cairn_vec2_sub(grid->points[i], cursor->centre)) <=
           cursor->radius_squared;
}

int32_t cairn_point_grid_next(const cairn_point_grid *grid, cairn_point_grid_cursor *cursor)
{
    if (cursor->all) {
        while (cursor->next < grid->count) {
            int32_t i = cursor->next++;

            if (is_within_radius(grid, cursor, i))
                return i;
        }
        return NO_INDEX;
    }
    while (cursor->y <= cursor->max_y) {
        while (cursor->next != NO_INDEX) {
            int32_t i = cursor->next;

            cursor->next = grid->next[i];
            if (is_within_radius(grid, cursor, i) &&
                cell_of(grid, grid->points[i].x) == cursor->x &&
                cell_of(grid, grid->points[i].y) == cursor->y)
                return i;
        }
        if (cursor->x == cursor->max_x) {
            cursor->x = cursor->min_x;
            cursor->y++;
        } else {
            cursor->x++;
        }
        if (cursor->y <= cursor->max_y)
            cursor->next = grid->heads[bucket_of(grid, cursor->x, cursor->y)];
    }
    return NO_INDEX;
}

/* ---- Sweep and prune ---- */

/* Operations per work unit; a test of two boxes is one operation, a move of the sort several. */
enum { OPERATIONS_PER_UNIT = 4, OPERATIONS_PER_MOVE = 3 };

struct cairn_box_sweep {
    /* [capacity] Permutation of the boxes, ascending by left side once sorted. */
    int32_t *order;
    /* [count] Boxes of the caller. */
    const cairn_box *boxes;
    /* With has_window, boxes that do not overlap the window are skipped. */
    cairn_box window;
    int32_t has_window;
    /* Largest number of boxes. */
    int32_t capacity;
    /* order[0 ... ordered_count-1] is a permutation of 0 ... ordered_count-1. */
    int32_t ordered_count;
    /* Number of boxes, <= ordered_count; indices from here on are treated as empty boxes. */
    int32_t count;
    /* Stride of the Shell sort; 0: sorted. */
    int32_t stride;
    /* Sort: next position to insert from, and current position of the inserted box. */
    int32_t insert_next;
    int32_t insert_position;
    /* Positions of the next pair to test; first_position == valid_end: done. */
    int32_t first_position, second_position;
    /* Positions from here on hold empty boxes; starts at ordered_count. */
    int32_t valid_end;
    /* Operations that are charged to the budget but not done yet. */
    int32_t credit;
};

/* Without a default: lowest and highest value. */
static const cairn_parameter sweep_rows[] = {
    CAIRN_INTEGER(cairn_box_sweep_params, max_boxes, 0, 1, MAX_COUNT),
};
extern const cairn_parameters cairn_box_sweep_parameters;
const cairn_parameters cairn_box_sweep_parameters =
    CAIRN_PARAMETERS("box_sweep", cairn_box_sweep_params, sweep_rows);

cairn_status cairn_box_sweep_check(const cairn_box_sweep_params *params, cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_box_sweep_parameters, params, fault);
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_box_sweep *build_box_sweep(cairn_pool *pool, const cairn_box_sweep_params *params)
{
    cairn_box_sweep *sweep = cairn_object_take(pool, sizeof *sweep);

    CAIRN_TAKE(sweep, pool, order, params->max_boxes);
    if (sweep != NULL) {
        sweep->capacity = params->max_boxes;
        for (int32_t i = 0; i < params->max_boxes; i++)
            sweep->order[i] = i;
    }
    return sweep;
}

CAIRN_OBJECT(box_sweep, box_sweep, build_box_sweep);

cairn_status cairn_box_sweep_begin(cairn_box_sweep *sweep, const cairn_box *boxes, int32_t count)
{
    int32_t added;

    if (count < 0 || (boxes == NULL && count > 0))
        return CAIRN_BAD_ARGUMENT;
    if (count > sweep->capacity)
        return CAIRN_FULL;
    added = count - sweep->count;
    sweep->ordered_count = larger(count, sweep->ordered_count);
    sweep->boxes = boxes;
    sweep->has_window = 0;
    sweep->count = count;
    sweep->stride = 1;
    if (added > count / 8)
        while (sweep->stride < count / 9)
            sweep->stride = 3 * sweep->stride + 1;
    sweep->insert_next = sweep->insert_position = sweep->stride;
    sweep->first_position = 0;
    sweep->second_position = 1;
    sweep->valid_end = sweep->ordered_count;
    sweep->credit = 0;
    return CAIRN_OK;
}

cairn_status cairn_box_sweep_begin_in(cairn_box_sweep *sweep, const cairn_box *boxes, int32_t count,
                                      cairn_box window)
{
    cairn_status status = cairn_box_sweep_begin(sweep, boxes, count);

    if (status == CAIRN_OK) {
        sweep->window = window;
        sweep->has_window = 1;
    }
    return status;
}

/* 1 when a box overlaps the window, or there is none. */
static int is_in_window(const cairn_box_sweep *sweep, const cairn_box *box)
{
    const cairn_box *window = &sweep->window;

    return !sweep->has_window || (box->min.x <= window->max.x && window->min.x <= box->max.x &&
                                  box->min.y <= window->max.y && window->min.y <= box->max.y);
}

/* 1 when box i exists and is not empty; 0 for a NaN. */
static int is_valid_box(const cairn_box_sweep *sweep, int32_t i)
{
    return i < sweep->count && sweep->boxes[i].min.x <= sweep->boxes[i].max.x &&
           sweep->boxes[i].min.y <= sweep->boxes[i].max.y;
}

/* Total order: valid boxes by left side, then empty ones; ties by index. */
static int comes_before(const cairn_box_sweep *sweep, int32_t a, int32_t b)
{
    int box_a = is_valid_box(sweep, a), box_b = is_valid_box(sweep, b);

    if (box_a != box_b)
        return box_a;
    if (box_a && sweep->boxes[a].min.x != sweep->boxes[b].min.x)
        return sweep->boxes[a].min.x < sweep->boxes[b].min.x;
    return a < b;
}

/* One comparison of the Shell sort. */
static void sort_step(cairn_box_sweep *sweep)
{
    int32_t *order = sweep->order;
    int32_t ahead = sweep->insert_position - sweep->stride;

    if (sweep->insert_next >= sweep->ordered_count) {
        sweep->stride /= 3;
        sweep->insert_next = sweep->insert_position = sweep->stride;
    } else if (ahead >= 0 && comes_before(sweep, order[sweep->insert_position], order[ahead])) {
        int32_t moved = order[ahead];

        order[ahead] = order[sweep->insert_position];
        order[sweep->insert_position] = moved;
        sweep->insert_position = ahead;
    } else {
        sweep->insert_next++;
        sweep->insert_position = sweep->insert_next;
    }
}

/* Charges operations, at most OPERATIONS_PER_UNIT, in whole units; what a unit has more is credit
 * for the next ones. 0: the budget is used up. */
static int charge_operations(cairn_box_sweep *sweep, cairn_budget *budget, int32_t operations)
{
    if (sweep->credit < operations)
        sweep->credit += OPERATIONS_PER_UNIT * cairn_budget_take(budget, 1);
    if (sweep->credit < operations)
        return 0;
    sweep->credit -= operations;
    return 1;
}

/* Tests pairs until one overlaps (returns 1), the budget is used up, or all pairs are tested. */
static int test_pairs(cairn_box_sweep *sweep, cairn_budget *budget, int32_t *first, int32_t *second)
{
    const int32_t *order = sweep->order;
    const cairn_box *boxes = sweep->boxes;
    int32_t end = sweep->valid_end;

    while (sweep->first_position < end) {
        int32_t a = order[sweep->first_position], at = sweep->second_position;
        cairn_real right = boxes[a].max.x, low = boxes[a].min.y, high = boxes[a].max.y;
        int32_t stop =
            at == sweep->first_position + 1 && !is_in_window(sweep, &boxes[a]) ? at : end;

        for (; at < stop && boxes[order[at]].min.x <= right; at++) {
            const cairn_box *other = &boxes[order[at]];

            if (!charge_operations(sweep, budget, 1)) {
                sweep->second_position = at;
                return 0;
            }
            /* One branch for both sides, because neither is predictable. */
            if (cairn_max(other->min.y, low) <= cairn_min(other->max.y, high) &&
                is_in_window(sweep, other)) {
                *first = a < order[at] ? a : order[at];
                *second = a < order[at] ? order[at] : a;
                sweep->second_position = at + 1;
                return 1;
            }
        }
        sweep->second_position = at;
        /* All boxes that start before box a ends are tested. */
        if (!charge_operations(sweep, budget, 1))
            return 0;
        sweep->first_position++;
        sweep->second_position = sweep->first_position + 1;
    }
    return 0;
}

cairn_status cairn_box_sweep_next(cairn_box_sweep *sweep, cairn_budget *budget, int32_t *first,
                                  int32_t *second)
{
    while (sweep->stride > 0) {
        if (!charge_operations(sweep, budget, OPERATIONS_PER_MOVE))
            return CAIRN_MORE;
        sort_step(sweep);
    }
    /* Before the first test: finds the end of the valid boxes. */
    while (sweep->second_position == 1 && sweep->valid_end > 0 &&
           !is_valid_box(sweep, sweep->order[sweep->valid_end - 1])) {
        if (!charge_operations(sweep, budget, 1))
            return CAIRN_MORE;
        sweep->valid_end--;
    }
    if (test_pairs(sweep, budget, first, second))
        return CAIRN_OK;
    return sweep->first_position < sweep->valid_end ? CAIRN_MORE : CAIRN_EMPTY;
}
