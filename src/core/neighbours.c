/* Hash grid and sweep-and-prune.
 *
 * Hash grid: the plane is cut into square cells; the points of the cells that share a bucket form a
 * chain (heads, next), the last one inserted first. A query visits the buckets of the cells that
 * its radius touches and judges every candidate by its distance, so that points of other cells in
 * the same bucket do no harm; the walk over all neighbours also compares cells, so that it meets
 * each point once. The nearest point is searched in rings of cells around the query; the box of
 * cells to visit shrinks to the distance found. A query that touches more cells than there are
 * points looks at the points one by one instead, which bounds its cost.
 *
 * Sweep and prune (Cohen, Lin, Manocha and Ponamgi 1995): boxes sorted by the left side, ties by
 * index; each is tested against those after it that start before it ends. The order of the last
 * sweep is sorted again by insertion, linear when the boxes moved little; after many new boxes
 * coarser strides go first (Shell 1959). The sort swaps in place: the order is a permutation at all
 * times, and a sweep may be begun anew in the middle of another.
 *
 * Limits: cell numbers are clamped to +-2^30, so points farther than that many cells share the
 * outermost ones: slower, not wrong. Boxes that are empty or hold a NaN are sorted last and
 * overlap none. */
#include "src/core/build.h"

#include "cairn/neighbours.h"

enum { MAX_COUNT = 1 << 28, MAX_CELL = 1 << 30, NONE = -1 };

static int32_t smaller(int32_t a, int32_t b)
{
    return a < b ? a : b;
}

static int32_t larger(int32_t a, int32_t b)
{
    return a > b ? a : b;
}

/* ---- Hash grid ---- */

struct cairn_point_grid {
    cairn_vec2 *points; /* [capacity] */
    int32_t *next;      /* [capacity], NONE ends a chain */
    int32_t *heads;     /* [mask + 1] */
    cairn_real inverse_cell;
    uint32_t mask;
    int32_t capacity;
    int32_t count;
};

/* Cells, borders included; empty when min > max. */
struct cell_box {
    int32_t min_x, max_x, min_y, max_y;
};

static uint32_t bucket_count(int32_t max_points)
{
    uint32_t buckets = 1;

    while (buckets < (uint32_t)max_points)
        buckets *= 2;
    return buckets;
}

static int point_grid_params_are_good(const cairn_point_grid_params *params)
{
    return params != NULL && params->max_points >= 1 && params->max_points <= MAX_COUNT &&
           params->cell > 0 && params->cell <= CAIRN_REAL_MAX && 1 / params->cell <= CAIRN_REAL_MAX;
}

static cairn_point_grid *carve_point_grid(cairn_pool *pool, const cairn_point_grid_params *params)
{
    cairn_point_grid *grid = cairn_pool_take_one(pool, sizeof *grid);
    cairn_vec2 *points = cairn_pool_take(pool, (size_t)params->max_points, sizeof *points);
    int32_t *next = cairn_pool_take(pool, (size_t)params->max_points, sizeof *next);
    int32_t *heads = cairn_pool_take(pool, bucket_count(params->max_points), sizeof *heads);

    if (grid != NULL) {
        grid->points = points;
        grid->next = next;
        grid->heads = heads;
    }
    return grid;
}

size_t cairn_point_grid_memory(const cairn_point_grid_params *params)
{
    cairn_pool counting;

    if (!point_grid_params_are_good(params))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve_point_grid(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_point_grid_create(cairn_point_grid **grid, cairn_pool *pool,
                                     const cairn_point_grid_params *params)
{
    size_t need = cairn_point_grid_memory(params);
    cairn_point_grid *made;

    if (grid == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    made = carve_point_grid(pool, params);
    made->inverse_cell = 1 / params->cell;
    made->mask = bucket_count(params->max_points) - 1;
    made->capacity = params->max_points;
    cairn_point_grid_clear(made);
    *grid = made;
    return CAIRN_OK;
}

void cairn_point_grid_clear(cairn_point_grid *grid)
{
    for (uint32_t i = 0; i <= grid->mask; i++)
        grid->heads[i] = NONE;
    grid->count = 0;
}

/* Rounds down. Monotone in the coordinate, which all pruning rests on. */
static int32_t cell_of(const cairn_point_grid *grid, cairn_real coordinate)
{
    cairn_real scaled = coordinate * grid->inverse_cell;
    int32_t cell = larger(-MAX_CELL, smaller(cairn_real_to_int(scaled), MAX_CELL));

    return cell - ((cairn_real)cell > scaled);
}

static uint32_t bucket_of(const cairn_point_grid *grid, int32_t x, int32_t y)
{
    uint32_t hash = (uint32_t)x * UINT32_C(0x9E3779B1) + (uint32_t)y * UINT32_C(0x85EBCA77);

    return (hash ^ hash >> 15) & grid->mask;
}

/* The cells of all points whose computed distance from p is at most `radius`. The radius grows
 * by more than the rounding and the underflow of that distance; rounding the sums is monotone,
 * so no point is lost at a border. */
static struct cell_box cells_within(const cairn_point_grid *grid, cairn_vec2 p, cairn_real radius)
{
    cairn_real reach = radius * (1 + 8 * CAIRN_REAL_EPSILON) + CAIRN_REAL(1e-19);
    struct cell_box box = {cell_of(grid, p.x - reach), cell_of(grid, p.x + reach),
                           cell_of(grid, p.y - reach), cell_of(grid, p.y + reach)};
    return box;
}

/* 1 when looking at every point is cheaper than visiting the cells. */
static int touches_too_many(const cairn_point_grid *grid, struct cell_box box)
{
    int64_t width = (int64_t)box.max_x - box.min_x + 1, height = (int64_t)box.max_y - box.min_y + 1;

    return width * height > grid->count;
}

cairn_status cairn_point_grid_insert(cairn_point_grid *grid, cairn_vec2 point)
{
    uint32_t bucket;

    if (!cairn_is_finite(point.x) || !cairn_is_finite(point.y))
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

/* The best point so far: lowest distance, then lowest index. */
struct nearest {
    cairn_vec2 p;
    cairn_real distance_squared;
    int32_t index;
    const cairn_point_grid_facing *facing; /* of the points that count; NULL: all do */
    int32_t looked_at;
};

static int faces(const cairn_point_grid_facing *facing, int32_t i)
{
    return facing == NULL ||
           cairn_vec2_dot(facing->directions[i], facing->direction) >= facing->least_cosine;
}

static void try_point(const cairn_point_grid *grid, int32_t i, struct nearest *best)
{
    cairn_real d = cairn_vec2_norm_squared(cairn_vec2_sub(grid->points[i], best->p));

    best->looked_at++;
    if ((d < best->distance_squared ||
         (d == best->distance_squared && (best->index == NONE || i < best->index))) &&
        faces(best->facing, i)) {
        best->distance_squared = d;
        best->index = i;
    }
}

static void try_cell(const cairn_point_grid *grid, int32_t x, int32_t y, struct nearest *best)
{
    best->looked_at++;
    for (int32_t i = grid->heads[bucket_of(grid, x, y)]; i != NONE; i = grid->next[i])
        try_point(grid, i, best);
}

/* The cells at Chebyshev distance k from (cx, cy) that lie in the box. */
static void try_ring(const cairn_point_grid *grid, int32_t cx, int32_t cy, int32_t k,
                     struct cell_box box, struct nearest *best)
{
    int32_t low_x = larger(cx - k, box.min_x), high_x = smaller(cx + k, box.max_x);
    int32_t low_y = larger(cy - k, box.min_y), high_y = smaller(cy + k, box.max_y);

    for (int32_t y = low_y; y <= high_y; y++) {
        if (y == cy - k || y == cy + k) {
            for (int32_t x = low_x; x <= high_x; x++)
                try_cell(grid, x, y, best);
            continue;
        }
        if (low_x == cx - k)
            try_cell(grid, low_x, y, best);
        if (high_x == cx + k)
            try_cell(grid, high_x, y, best);
    }
}

/* Rings around (cx, cy) that reach into the box. */
static int32_t rings_within(struct cell_box box, int32_t cx, int32_t cy)
{
    return larger(larger(cx - box.min_x, box.max_x - cx), larger(cy - box.min_y, box.max_y - cy));
}

static void find_nearest(const cairn_point_grid *grid, cairn_real radius, struct nearest *best)
{
    struct cell_box box;
    int32_t cx, cy;

    if (!(radius >= 0) || !cairn_is_finite(best->p.x) || !cairn_is_finite(best->p.y))
        return;
    best->distance_squared = radius * radius;
    box = cells_within(grid, best->p, radius);
    if (touches_too_many(grid, box)) {
        for (int32_t i = 0; i < grid->count; i++)
            try_point(grid, i, best);
        return;
    }
    cx = cell_of(grid, best->p.x);
    cy = cell_of(grid, best->p.y);
    for (int32_t k = 0; k <= rings_within(box, cx, cy); k++) {
        try_ring(grid, cx, cy, k, box, best);
        box = cells_within(grid, best->p, cairn_sqrt(best->distance_squared));
    }
}

int32_t cairn_point_grid_nearest(const cairn_point_grid *grid, cairn_vec2 p, cairn_real radius,
                                 cairn_real *distance_squared)
{
    struct nearest best = {.p = p, .index = NONE};

    find_nearest(grid, radius, &best);
    if (best.index != NONE && distance_squared != NULL)
        *distance_squared = best.distance_squared;
    return best.index;
}

int32_t cairn_point_grid_nearest_facing(const cairn_point_grid *grid, cairn_vec2 p,
                                        cairn_real radius, const cairn_point_grid_facing *facing,
                                        int32_t *looked_at)
{
    struct nearest best = {.p = p, .index = NONE, .facing = facing};

    find_nearest(grid, radius, &best);
    *looked_at = best.looked_at;
    return best.index;
}

int32_t cairn_point_grid_has(const cairn_point_grid *grid, cairn_vec2 p, cairn_real radius)
{
    struct cell_box box;

    if (!(radius >= 0) || !cairn_is_finite(p.x) || !cairn_is_finite(p.y))
        return 0;
    box = cells_within(grid, p, radius);
    if (touches_too_many(grid, box))
        return cairn_point_grid_nearest(grid, p, radius, NULL) != NONE;
    for (int32_t y = box.min_y; y <= box.max_y; y++)
        for (int32_t x = box.min_x; x <= box.max_x; x++)
            for (int32_t i = grid->heads[bucket_of(grid, x, y)]; i != NONE; i = grid->next[i])
                if (cairn_vec2_norm_squared(cairn_vec2_sub(grid->points[i], p)) <= radius * radius)
                    return 1;
    return 0;
}

cairn_point_grid_cursor cairn_point_grid_begin(const cairn_point_grid *grid, cairn_vec2 p,
                                               cairn_real radius)
{
    cairn_point_grid_cursor cursor = {
        .centre = p, .radius_squared = radius * radius, .max_y = -1, .next = NONE};
    struct cell_box box;

    if (grid->count == 0 || !(radius >= 0) || !cairn_is_finite(p.x) || !cairn_is_finite(p.y))
        return cursor;
    box = cells_within(grid, p, radius);
    if (touches_too_many(grid, box)) {
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

static int is_near(const cairn_point_grid *grid, const cairn_point_grid_cursor *cursor, int32_t i)
{
    return cairn_vec2_norm_squared(cairn_vec2_sub(grid->points[i], cursor->centre)) <=
           cursor->radius_squared;
}

int32_t cairn_point_grid_next(const cairn_point_grid *grid, cairn_point_grid_cursor *cursor)
{
    if (cursor->all) {
        while (cursor->next < grid->count) {
            int32_t i = cursor->next++;

            if (is_near(grid, cursor, i))
                return i;
        }
        return NONE;
    }
    while (cursor->y <= cursor->max_y) {
        while (cursor->next != NONE) {
            int32_t i = cursor->next;

            cursor->next = grid->next[i];
            if (is_near(grid, cursor, i) && cell_of(grid, grid->points[i].x) == cursor->x &&
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
    return NONE;
}

/* ---- Sweep and prune ---- */

/* A test of two boxes is an operation, a move of the sort is several. */
enum { OPERATIONS_PER_UNIT = 4, OPERATIONS_OF_MOVE = 3 };

struct cairn_box_sweep {
    int32_t *order;         /* [capacity], a permutation */
    const cairn_box *boxes; /* [count], the caller's */
    cairn_box window;       /* boxes that do not overlap it are passed over, ... */
    int32_t has_window;     /* ... when there is one */
    int32_t capacity;
    int32_t known;         /* order[0 ... known-1] holds 0 ... known-1 */
    int32_t count;         /* <= known; indices from here on count as empty boxes */
    int32_t stride;        /* of the sort; 0: sorted */
    int32_t sorted;        /* next place to insert from */
    int32_t place;         /* where the box being inserted stands */
    int32_t first, second; /* places in order to test next; first == boxes_end: done */
    int32_t boxes_end;     /* places in order from here on hold no box; starts at known */
    int32_t credit;        /* operations paid for */
};

static int box_sweep_params_are_good(const cairn_box_sweep_params *params)
{
    return params != NULL && params->max_boxes >= 1 && params->max_boxes <= MAX_COUNT;
}

static cairn_box_sweep *carve_box_sweep(cairn_pool *pool, const cairn_box_sweep_params *params)
{
    cairn_box_sweep *sweep = cairn_pool_take_one(pool, sizeof *sweep);
    int32_t *order = cairn_pool_take(pool, (size_t)params->max_boxes, sizeof *order);

    if (sweep != NULL)
        sweep->order = order;
    return sweep;
}

size_t cairn_box_sweep_memory(const cairn_box_sweep_params *params)
{
    cairn_pool counting;

    if (!box_sweep_params_are_good(params))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve_box_sweep(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_box_sweep_create(cairn_box_sweep **sweep, cairn_pool *pool,
                                    const cairn_box_sweep_params *params)
{
    size_t need = cairn_box_sweep_memory(params);
    cairn_box_sweep *made;

    if (sweep == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    made = carve_box_sweep(pool, params);
    for (int32_t i = 0; i < params->max_boxes; i++)
        made->order[i] = i;
    made->capacity = params->max_boxes;
    made->known = made->count = made->stride = made->first = made->boxes_end = made->credit = 0;
    *sweep = made;
    return CAIRN_OK;
}

cairn_status cairn_box_sweep_begin(cairn_box_sweep *sweep, const cairn_box *boxes, int32_t count)
{
    int32_t added;

    if (count < 0 || (boxes == NULL && count > 0))
        return CAIRN_BAD_ARGUMENT;
    if (count > sweep->capacity)
        return CAIRN_FULL;
    added = count - sweep->count;
    sweep->known = larger(count, sweep->known);
    sweep->boxes = boxes;
    sweep->has_window = 0;
    sweep->count = count;
    sweep->stride = 1;
    if (added > count / 8)
        while (sweep->stride < count / 9)
            sweep->stride = 3 * sweep->stride + 1;
    sweep->sorted = sweep->place = sweep->stride;
    sweep->first = 0;
    sweep->second = 1;
    sweep->boxes_end = sweep->known;
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

static int is_in_window(const cairn_box_sweep *sweep, const cairn_box *box)
{
    const cairn_box *window = &sweep->window;

    return !sweep->has_window || (box->min.x <= window->max.x && window->min.x <= box->max.x &&
                                  box->min.y <= window->max.y && window->min.y <= box->max.y);
}

/* 1 when the box exists and holds a point; false for a NaN. */
static int is_box(const cairn_box_sweep *sweep, int32_t i)
{
    return i < sweep->count && sweep->boxes[i].min.x <= sweep->boxes[i].max.x &&
           sweep->boxes[i].min.y <= sweep->boxes[i].max.y;
}

/* Total order: boxes by their left side, then what is none; ties by index. */
static int comes_before(const cairn_box_sweep *sweep, int32_t a, int32_t b)
{
    int box_a = is_box(sweep, a), box_b = is_box(sweep, b);

    if (box_a != box_b)
        return box_a;
    if (box_a && sweep->boxes[a].min.x != sweep->boxes[b].min.x)
        return sweep->boxes[a].min.x < sweep->boxes[b].min.x;
    return a < b;
}

/* One comparison of the sort. */
static void sort_once(cairn_box_sweep *sweep)
{
    int32_t *order = sweep->order;
    int32_t ahead = sweep->place - sweep->stride;

    if (sweep->sorted >= sweep->known) {
        sweep->stride /= 3;
        sweep->sorted = sweep->place = sweep->stride;
    } else if (ahead >= 0 && comes_before(sweep, order[sweep->place], order[ahead])) {
        int32_t moved = order[ahead];

        order[ahead] = order[sweep->place];
        order[sweep->place] = moved;
        sweep->place = ahead;
    } else {
        sweep->sorted++;
        sweep->place = sweep->sorted;
    }
}

/* Tests until a pair is found (1), *operations are used up, or all are done. */
static int test_some(cairn_box_sweep *sweep, int64_t *operations, int32_t *first, int32_t *second)
{
    const int32_t *order = sweep->order;
    const cairn_box *boxes = sweep->boxes;
    int32_t end = sweep->boxes_end;
    int64_t left = *operations;

    while (left > 0 && sweep->first < end) {
        int32_t a = order[sweep->first], at = sweep->second;
        int32_t stop = end - at < left ? end : at + (int32_t)left;
        cairn_real right = boxes[a].max.x, low = boxes[a].min.y, high = boxes[a].max.y;

        if (at == sweep->first + 1 && !is_in_window(sweep, &boxes[a]))
            stop = at;

        for (; at < stop; at++) {
            const cairn_box *other = &boxes[order[at]];

            if (other->min.x > right)
                break;
            /* One comparison, as neither half of it can be guessed. */
            if (cairn_max(other->min.y, low) <= cairn_min(other->max.y, high) &&
                is_in_window(sweep, other)) {
                *first = a < order[at] ? a : order[at];
                *second = a < order[at] ? order[at] : a;
                *operations = left - (at + 1 - sweep->second);
                sweep->second = at + 1;
                return 1;
            }
        }
        left -= at - sweep->second;
        sweep->second = at;
        if (left > 0) { /* all that start before box a ends have been tested */
            left--;
            sweep->first++;
            sweep->second = sweep->first + 1;
        }
    }
    *operations = left;
    return 0;
}

/* Charges operations, which are paid for two at a time; what is left of a unit serves the next
 * call. */
static void charge(cairn_box_sweep *sweep, cairn_budget *budget, int64_t operations)
{
    int64_t due = operations - sweep->credit;

    if (due > 0) {
        int32_t units = (int32_t)(((uint64_t)due + OPERATIONS_PER_UNIT - 1) / OPERATIONS_PER_UNIT);

        budget->left -= units;
        due -= (int64_t)units * OPERATIONS_PER_UNIT;
    }
    sweep->credit = (int32_t)-due;
}

cairn_status cairn_box_sweep_next(cairn_box_sweep *sweep, cairn_budget *budget, int32_t *first,
                                  int32_t *second)
{
    int64_t most = sweep->credit +
                   (int64_t)(budget->left > 0 ? budget->left : 0) * OPERATIONS_PER_UNIT,
            left = most;
    int found = 0;

    for (; sweep->stride > 0 && left >= OPERATIONS_OF_MOVE; left -= OPERATIONS_OF_MOVE)
        sort_once(sweep);
    if (sweep->stride == 0) {
        /* Before the first test. */
        for (; sweep->second == 1 && left > 0 && sweep->boxes_end > 0 &&
               !is_box(sweep, sweep->order[sweep->boxes_end - 1]);
             left--)
            sweep->boxes_end--;
        found = test_some(sweep, &left, first, second);
    }
    charge(sweep, budget, most - left);
    if (found)
        return CAIRN_OK;
    return sweep->stride > 0 || sweep->first < sweep->boxes_end ? CAIRN_MORE : CAIRN_EMPTY;
}
