/* Hash grid of points and sweep over boxes, compared with linear searches; work, budgets,
 * memory. */
#include "tests/test.h"

#include "cairn/neighbours.h"

/* ---- Hash grid beside a linear search ---- */

enum { POINTS = 400 };

static cairn_point_grid *make_grid(cairn_pool *pool, int32_t max_points, cairn_real cell)
{
    cairn_point_grid_params params = {.max_points = max_points, .cell_size = cell};
    cairn_point_grid *grid;

    *pool = test_pool(cairn_point_grid_memory(&params));
    assert_ok(cairn_point_grid_create(&grid, pool, &params));
    return grid;
}

static cairn_real distance_squared(cairn_vec2 a, cairn_vec2 b)
{
    return cairn_vec2_norm_squared(cairn_vec2_sub(a, b));
}

static int32_t slow_nearest(const cairn_vec2 *points, int32_t count, cairn_vec2 p,
                            cairn_real radius)
{
    int32_t best = -1;

    for (int32_t i = 0; i < count; i++)
        if (distance_squared(points[i], p) <= radius * radius &&
            (best < 0 || distance_squared(points[i], p) < distance_squared(points[best], p)))
            best = i;
    return best;
}

/* Of points with directions east, north, west and south in turn, the nearest one facing north or
 * east. */
static void check_facing(const cairn_point_grid *grid, const cairn_vec2 *points, int32_t count,
                         cairn_vec2 p, cairn_real radius)
{
    static const cairn_vec2 compass[] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
    cairn_vec2 directions[POINTS];
    cairn_point_grid_facing facing = {
        directions, {CAIRN_REAL(0.6), CAIRN_REAL(0.8)}, CAIRN_REAL(0.6)};
    int32_t best = -1, looked_at = -1;

    for (int32_t i = 0; i < count; i++) {
        directions[i] = compass[i % 4];
        if (i % 4 < 2 && distance_squared(points[i], p) <= radius * radius &&
            (best < 0 || distance_squared(points[i], p) < distance_squared(points[best], p)))
            best = i;
    }
    assert_int_equal(cairn_point_grid_nearest_facing(grid, p, radius, &facing, &looked_at), best);
    assert_true(looked_at >= (best >= 0) && looked_at <= 3 * count + 2);
}

/* The cursor visits every point within the radius once, and no other. */
static void check_cursor(const cairn_point_grid *grid, const cairn_vec2 *points, int32_t count,
                         cairn_vec2 p, cairn_real radius)
{
    cairn_point_grid_cursor cursor = cairn_point_grid_begin(grid, p, radius);
    int32_t seen[POINTS] = {0}, i;

    while ((i = cairn_point_grid_next(grid, &cursor)) >= 0) {
        assert_true(i < count);
        seen[i]++;
    }
    assert_int_equal(cairn_point_grid_next(grid, &cursor), -1);
    for (i = 0; i < count; i++)
        assert_int_equal(seen[i], distance_squared(points[i], p) <= radius * radius);
}

static void check_query(const cairn_point_grid *grid, const cairn_vec2 *points, int32_t count,
                        cairn_vec2 p, cairn_real radius)
{
    cairn_real squared = -1;
    int32_t expected = slow_nearest(points, count, p, radius);

    assert_int_equal(cairn_point_grid_nearest(grid, p, radius, &squared), expected);
    assert_int_equal(cairn_point_grid_nearest(grid, p, radius, NULL), expected);
    assert_true(squared == (expected < 0 ? -1 : distance_squared(points[expected], p)));
    assert_int_equal(cairn_point_grid_has_near(grid, p, radius), expected >= 0);
    check_facing(grid, points, count, p, radius);
    check_cursor(grid, points, count, p, radius);
}

/* Points at `scale` m around the origin, in steps of `step` cells, so that there are ties and
 * points on borders. */
static void check_random_points(uint64_t seed, cairn_real cell, cairn_real scale, cairn_real step)
{
    static const cairn_real radii[] = {0, CAIRN_REAL(0.3), 1, CAIRN_REAL(2.5), 8, 1000};
    cairn_random random = cairn_random_seed(seed, 1);
    cairn_pool pool;
    cairn_point_grid *grid = make_grid(&pool, POINTS, cell);
    cairn_vec2 points[POINTS];

    for (int round = 0; round < 2; round++) {
        for (int32_t i = 0; i < POINTS; i++) {
            points[i].x = cairn_random_uniform(&random, -scale, scale);
            points[i].y = cairn_random_uniform(&random, -scale, scale);
            if (step > 0) {
                points[i].x = cairn_rint(points[i].x / (step * cell)) * (step * cell);
                points[i].y = cairn_rint(points[i].y / (step * cell)) * (step * cell);
            }
            assert_int_equal(cairn_point_grid_count(grid), i);
            assert_ok(cairn_point_grid_insert(grid, points[i]));
            assert_true(cairn_point_grid_point(grid, i).x == points[i].x);
            assert_true(cairn_point_grid_point(grid, i / 2).y == points[i / 2].y);
            if (i % 20 == 0 || i == POINTS - 1) {
                for (int k = 0; k < 6; k++) {
                    cairn_vec2 p = points[cairn_random_below(&random, i + 1)];

                    check_query(grid, points, i + 1, p, radii[k] * cell);
                    p.x = cairn_random_uniform(&random, -scale, scale);
                    check_query(grid, points, i + 1, p, radii[k] * cell);
                    p.y = cairn_random_uniform(&random, -scale, scale);
                    check_query(grid, points, i + 1, p, radii[k] * cell);
                }
            }
        }
        /* Removing points leaves the others unchanged. */
        for (int32_t i = POINTS - 1; round == 0 && i >= 0; i--) {
            cairn_point_grid_remove_last(grid);
            assert_int_equal(cairn_point_grid_count(grid), i);
            if (i % 40 == 3)
                check_query(grid, points, i, points[i + 1], cell);
        }
        cairn_point_grid_remove_last(grid);
        if (round == 1)
            cairn_point_grid_clear(grid);
        assert_int_equal(cairn_point_grid_count(grid), 0);
        check_query(grid, points, 0, points[0], 100 * cell);
    }
    test_pool_free(&pool);
}

static void test_grid_matches_linear_search(void **state)
{
    (void)state;
    check_random_points(1, CAIRN_REAL(0.5), 5, 0);
    check_random_points(2, CAIRN_REAL(0.25), 3, CAIRN_REAL(0.5));
    check_random_points(3, CAIRN_REAL(0.1), 1, 1);
    check_random_points(4, 1, 1000000, 0);
    check_random_points(5, CAIRN_REAL(0.125), 1, CAIRN_REAL(0.25));
}

/* Work of a search: a cell and its points, then rings of cells until the next ring is farther than
 * the best point. */
static void test_grid_counts_evaluations(void **state)
{
    static const cairn_vec2 points[] = {
        {CAIRN_REAL(0.5), CAIRN_REAL(0.5)}, {CAIRN_REAL(0.6), CAIRN_REAL(0.5)},
        {CAIRN_REAL(1.5), CAIRN_REAL(0.5)}, {CAIRN_REAL(9.5), CAIRN_REAL(9.5)},
        {CAIRN_REAL(9.5), CAIRN_REAL(8.5)}, {CAIRN_REAL(8.5), CAIRN_REAL(8.5)}};
    static const cairn_vec2 directions[] = {{0, 1}, {0, 1}, {1, 0}, {1, 0}, {1, 0}, {1, 0}};
    cairn_point_grid_facing facing = {directions, {0, 1}, CAIRN_REAL(0.5)};
    cairn_pool pool;
    cairn_point_grid *grid = make_grid(&pool, 6, 1);
    int32_t looked_at = 0;

    (void)state;
    for (int32_t i = 0; i < 6; i++)
        assert_ok(cairn_point_grid_insert(grid, points[i]));
    assert_int_equal(
        cairn_point_grid_nearest_facing(grid, points[0], CAIRN_REAL(0.4), &facing, &looked_at), 0);
    assert_int_equal(looked_at, 3);
    facing.direction.x = 1;
    facing.direction.y = 0;
    assert_int_equal(
        cairn_point_grid_nearest_facing(grid, points[0], CAIRN_REAL(0.4), &facing, &looked_at), -1);
    assert_int_equal(looked_at, 3);
    /* More cells than points: all points in turn. */
    assert_int_equal(cairn_point_grid_nearest_facing(grid, points[0], 6, &facing, &looked_at), 2);
    assert_int_equal(looked_at, 6);
    assert_int_equal(
        cairn_point_grid_nearest_facing(grid, points[0], (cairn_real)NAN, &facing, &looked_at), -1);
    assert_int_equal(looked_at, 0);
    test_pool_free(&pool);
}

/* Far beyond the range of cell numbers all points share the outermost cells and are still
 * distinguished. */
static void test_grid_far_points(void **state)
{
    static const cairn_vec2 points[] = {{CAIRN_REAL(1e30), 0},  {CAIRN_REAL(1.1e30), 0},
                                        {-CAIRN_REAL(1e30), 1}, {0, CAIRN_REAL(1e30)},
                                        {0, -CAIRN_REAL(1e30)}, {0, 0}};
    cairn_pool pool;
    cairn_point_grid *grid = make_grid(&pool, 6, CAIRN_REAL(0.001));
    cairn_vec2 p = {CAIRN_REAL(1.09e30), 0};

    (void)state;
    for (int32_t i = 0; i < 6; i++)
        assert_ok(cairn_point_grid_insert(grid, points[i]));
    assert_int_equal(cairn_point_grid_nearest(grid, p, CAIRN_REAL(1e29), NULL), NUMBER(1, 0));
#ifndef CAIRN_FLOAT
    for (int32_t i = 0; i < 6; i++)
        for (int k = 0; k < 4; k++)
            check_query(grid, points, 6, points[i],
                        k == 0   ? 0
                        : k == 1 ? 1
                        : k == 2 ? 1.5e29
                                 : 3e30);
#endif
    test_pool_free(&pool);
}

/* A query visits points of the cell to the left and below even when the distance underflows to
 * 0. */
static void test_grid_underflow(void **state)
{
    static const cairn_vec2 points[] = {{-CAIRN_REAL(1e-30), -CAIRN_REAL(1e-30)},
                                        {CAIRN_REAL(1e-30), 0},
                                        {5, 5},
                                        {6, 6},
                                        {7, 7},
                                        {8, 8},
                                        {9, 9},
                                        {10, 10},
                                        {11, 11}};
    cairn_pool pool;
    cairn_point_grid *grid = make_grid(&pool, 9, 1);
    cairn_vec2 p = {CAIRN_REAL(1e-30), 0};

    (void)state;
    for (int32_t i = 0; i < 9; i++)
        assert_ok(cairn_point_grid_insert(grid, points[i]));
    check_query(grid, points, 9, p, 0);
    check_query(grid, points, 9, p, 1);
    check_query(grid, points, 9, points[0], 1);
    test_pool_free(&pool);
}

/* The work is bounded by the points, not by the area: a huge radius over tiny cells returns at
 * once. */
static void test_grid_huge_radius(void **state)
{
    cairn_pool pool;
    cairn_point_grid *grid = make_grid(&pool, 3, CAIRN_REAL(1e-6));
    cairn_vec2 points[3] = {{1, 1}, {-2, 3}, {1, 1}}, p = {0, 0};

    (void)state;
    for (int32_t i = 0; i < 3; i++)
        assert_ok(cairn_point_grid_insert(grid, points[i]));
    check_query(grid, points, 3, p, CAIRN_REAL(1e15));
    check_query(grid, points, 3, p, (cairn_real)INFINITY);
    check_query(grid, points, 3, points[1], (cairn_real)INFINITY);
    test_pool_free(&pool);
}

/* Same points, same order of insertion: same order of visits. */
static void test_grid_order_is_reproducible(void **state)
{
    uint64_t hashes[2];

    (void)state;
    for (int run = 0; run < 2; run++) {
        cairn_random random = cairn_random_seed(9, 0);
        cairn_pool pool;
        cairn_point_grid *grid = make_grid(&pool, 300, CAIRN_REAL(0.5));
        cairn_vec2 p = {0, 0};
        cairn_point_grid_cursor cursor;
        int32_t i;

        for (i = 0; i < 300; i++) {
            cairn_vec2 point;

            point.x = cairn_random_uniform(&random, -2, 2);
            point.y = cairn_random_uniform(&random, -2, 2);
            assert_ok(cairn_point_grid_insert(grid, point));
        }
        cursor = cairn_point_grid_begin(grid, p, CAIRN_REAL(1.2));
        hashes[run] = TEST_HASH_START;
        while ((i = cairn_point_grid_next(grid, &cursor)) >= 0)
            hashes[run] = test_hash(hashes[run], &i, sizeof i);
        test_pool_free(&pool);
    }
    assert_true(hashes[0] == hashes[1]);
}

/* The cells that a query visits, side by side with its radius, each border on its own side; fewer
 * cells than points, or all points instead. */
static void test_grid_cells(void **state)
{
    enum { FAR = 1 << 30 };
    static const struct {
        cairn_real x, y, radius;
        int32_t min_x, max_x, min_y, max_y;
    } sample[] = {{CAIRN_REAL(0.25), CAIRN_REAL(1.25), 0, 0, 0, 2, 2},
                  {CAIRN_REAL(0.25), CAIRN_REAL(1.25), CAIRN_REAL(0.25), -1, 1, 1, 3},
                  {CAIRN_REAL(0.25), CAIRN_REAL(1.25), CAIRN_REAL(0.125), 0, 0, 2, 2},
                  {CAIRN_REAL(-0.75), CAIRN_REAL(2.25), CAIRN_REAL(0.5), -3, -1, 3, 5},
                  {CAIRN_REAL(0.375), CAIRN_REAL(-0.125), CAIRN_REAL(0.25), 0, 1, -1, 0},
                  {CAIRN_REAL(1e30), CAIRN_REAL(-1e30), 0, FAR, FAR, -FAR - 1, -FAR - 1}};
    cairn_vec2 origin = {0, 0}, p = {CAIRN_REAL(0.25), CAIRN_REAL(0.25)};
    cairn_pool pool;
    cairn_point_grid *grid = make_grid(&pool, 300, CAIRN_REAL(0.5));
    cairn_point_grid_cursor cursor;

    (void)state;
    for (int32_t i = 0; i < 9; i++)
        assert_ok(cairn_point_grid_insert(grid, origin));
    for (size_t i = 0; i < sizeof sample / sizeof *sample; i++) {
        p.x = sample[i].x;
        p.y = sample[i].y;
        cursor = cairn_point_grid_begin(grid, p, sample[i].radius);
        assert_int_equal(cursor.all, 0);
        assert_int_equal(cursor.min_x, sample[i].min_x);
        assert_int_equal(cursor.x, sample[i].min_x);
        assert_int_equal(cursor.max_x, sample[i].max_x);
        assert_int_equal(cursor.y, sample[i].min_y);
        assert_int_equal(cursor.max_y, sample[i].max_y);
    }
    /* Nine cells and eight points; six cells, one side, and five points. */
    for (int32_t points = 5; points <= 9; points++) {
        cairn_point_grid_clear(grid);
        for (int32_t i = 0; i < points; i++)
            assert_ok(cairn_point_grid_insert(grid, origin));
        p.x = p.y = CAIRN_REAL(0.25);
        cursor = cairn_point_grid_begin(grid, p, CAIRN_REAL(0.5));
        assert_int_equal(cursor.all, points < 9);
        p.y = CAIRN_REAL(0.375);
        cursor = cairn_point_grid_begin(grid, p, CAIRN_REAL(0.25));
        assert_int_equal(cursor.all, points < 6);
    }
    test_pool_free(&pool);
}

/* 256 points in as many cells around the origin. The head of the chain that a query starts with
 * identifies the bucket: the test measures how well the hash spreads them. */
static void test_grid_buckets(void **state)
{
    cairn_pool pool;
    cairn_point_grid *grid = make_grid(&pool, 256, CAIRN_REAL(0.5));
    uint64_t hash = TEST_HASH_START;
    int32_t alone = 0;

    (void)state;
    for (int32_t i = 0; i < 256; i++) {
        int32_t row = i / 16, column = i - 16 * row;
        cairn_vec2 p = {(cairn_real)(column - 8) / 2, (cairn_real)(row - 4) / 2};

        assert_ok(cairn_point_grid_insert(grid, p));
    }
    for (int32_t i = 0; i < 256; i++) {
        int32_t row = i / 16, column = i - 16 * row;
        cairn_vec2 p = {(cairn_real)column / 2 - CAIRN_REAL(3.75),
                        (cairn_real)row / 2 - CAIRN_REAL(1.75)};
        cairn_point_grid_cursor cursor = cairn_point_grid_begin(grid, p, 0);

        hash = test_hash(hash, &cursor.next, sizeof cursor.next);
        alone += cursor.next == i;
    }
    assert_int_equal(alone, 129);
    assert_true(hash == UINT64_C(0xec075bdae624d09d));
    test_pool_free(&pool);
}

/* As many buckets as points, rounded up to a power of two. */
static void test_grid_memory(void **state)
{
    static const struct {
        int32_t points;
        size_t buckets;
    } sample[] = {{1, 1},   {2, 2},   {3, 4},    {4, 4},
                  {63, 64}, {64, 64}, {65, 128}, {1 << 20, 1 << 20}};
    cairn_point_grid_params params = {.max_points = 1, .cell_size = 1};
    /* without a point, a link and a bucket, 16 bytes each */
    size_t base = cairn_point_grid_memory(&params) - 48;

    (void)state;
    for (size_t i = 0; i < sizeof sample / sizeof *sample; i++) {
        size_t points = (size_t)sample[i].points;

        params.max_points = sample[i].points;
        assert_int_equal(cairn_point_grid_memory(&params),
                         base + (points * sizeof(cairn_vec2) + 15) / 16 * 16 +
                             (points * 4 + 15) / 16 * 16 + (sample[i].buckets * 4 + 15) / 16 * 16);
    }
}

static cairn_status create_grid(void *context, cairn_pool *pool)
{
    cairn_point_grid *grid = NULL;
    cairn_status status = cairn_point_grid_create(&grid, pool, context);

    assert_true((status == CAIRN_OK) == (grid != NULL));
    return status;
}

static void test_grid_refusals(void **state)
{
    const cairn_point_grid_params tiny = {1, CAIRN_REAL_EPSILON * NUMBER(1e-300, 1e-36f)};
    cairn_point_grid_params params = {.max_points = 33, .cell_size = 1},
                            most = {.max_points = 1 << 28, .cell_size = 1};
    cairn_pool pool = test_pool(100000);
    cairn_point_grid *grid;
    cairn_vec2 p = {1, 2}, nan_x = {(cairn_real)NAN, 0}, nan_y = {0, (cairn_real)NAN};
    cairn_vec2 infinite = {0, (cairn_real)INFINITY};
    cairn_point_grid_cursor cursor;
    cairn_object_fault fault;

    (void)state;
    assert_status(cairn_point_grid_check(&tiny, &fault), CAIRN_BAD_ARGUMENT);
    assert_string_equal(fault.field, "cell_size");
    assert_int_equal(cairn_point_grid_memory(&tiny), 0);
    assert_true(cairn_point_grid_memory(&most) > ((size_t)1 << 28) * (sizeof(cairn_vec2) + 8));
    assert_status(cairn_point_grid_create(&grid, NULL, &params), CAIRN_BAD_ARGUMENT);
    assert_int_equal(pool.used, 0);
    test_every_pool_size(create_grid, &params, cairn_point_grid_memory(&params));

    params.max_points = 1;
    assert_ok(cairn_point_grid_create(&grid, &pool, &params));
    assert_status(cairn_point_grid_insert(grid, nan_x), CAIRN_NOT_FINITE);
    assert_status(cairn_point_grid_insert(grid, nan_y), CAIRN_NOT_FINITE);
    assert_status(cairn_point_grid_insert(grid, infinite), CAIRN_NOT_FINITE);
    assert_int_equal(cairn_point_grid_count(grid), 0);
    assert_ok(cairn_point_grid_insert(grid, p));
    assert_status(cairn_point_grid_insert(grid, p), CAIRN_FULL);
    assert_int_equal(cairn_point_grid_count(grid), 1);

    assert_int_equal(cairn_point_grid_nearest(grid, p, -1, NULL), -1);
    assert_int_equal(cairn_point_grid_nearest(grid, p, (cairn_real)NAN, NULL), -1);
    assert_int_equal(cairn_point_grid_nearest(grid, nan_x, 9, NULL), -1);
    assert_int_equal(cairn_point_grid_has_near(grid, nan_x, 9), 0);
    assert_int_equal(cairn_point_grid_nearest(grid, nan_y, 9, NULL), -1);
    cursor = cairn_point_grid_begin(grid, p, -1);
    assert_int_equal(cairn_point_grid_next(grid, &cursor), -1);
    cursor = cairn_point_grid_begin(grid, nan_x, 9);
    assert_int_equal(cairn_point_grid_next(grid, &cursor), -1);
    for (int k = 0; k < 4; k++) {
        cairn_vec2 q = p;

        *(k % 2 ? &q.y : &q.x) = k < 2 ? (cairn_real)INFINITY : (cairn_real)NAN;
        assert_int_equal(cairn_point_grid_nearest(grid, q, (cairn_real)INFINITY, NULL), -1);
        cursor = cairn_point_grid_begin(grid, q, (cairn_real)INFINITY);
        assert_int_equal(cairn_point_grid_next(grid, &cursor), -1);
    }
    test_pool_free(&pool);
}

/* ---- Sweep and prune beside all pairs ---- */

enum { BOXES = 120 };

static cairn_box_sweep *make_sweep(cairn_pool *pool, int32_t max_boxes)
{
    cairn_box_sweep_params params = {.max_boxes = max_boxes};
    cairn_box_sweep *sweep;

    *pool = test_pool(cairn_box_sweep_memory(&params));
    assert_ok(cairn_box_sweep_create(&sweep, pool, &params));
    return sweep;
}

static int holds_a_point(cairn_box box)
{
    return box.min.x <= box.max.x && box.min.y <= box.max.y;
}

static int starts_before(const cairn_box *boxes, int32_t a, int32_t b)
{
    return boxes[a].min.x < boxes[b].min.x || (boxes[a].min.x == boxes[b].min.x && a < b);
}

/* Runs the sweep with budgets of `budget` units, compares with all pairs, and returns the units
 * spent; *hash is that of the pairs in order, which is the order of the left sides. */
static int32_t check_sweep(cairn_box_sweep *sweep, const cairn_box *boxes, int32_t count,
                           int32_t budget, uint64_t *hash)
{
    static unsigned char seen[BOXES][BOXES];
    int32_t spent = 0, pair[2], last = -1, left_box;
    cairn_budget left;
    cairn_status status;

    memset(seen, 0, sizeof seen);
    *hash = TEST_HASH_START;
    assert_ok(cairn_box_sweep_begin(sweep, boxes, count));
    do {
        left.left = budget;
        while ((status = cairn_box_sweep_next(sweep, &left, &pair[0], &pair[1])) == CAIRN_OK) {
            assert_true(pair[0] >= 0 && pair[0] < pair[1] && pair[1] < count);
            seen[pair[0]][pair[1]]++;
            left_box = starts_before(boxes, pair[0], pair[1]) ? pair[0] : pair[1];
            assert_true(last < 0 || last == left_box || starts_before(boxes, last, left_box));
            last = left_box;
            *hash = test_hash(*hash, pair, sizeof pair);
        }
        assert_true(left.left >= 0);
        assert_true(status == CAIRN_EMPTY || (status == CAIRN_MORE && left.left == 0));
        spent += budget - left.left;
    } while (status != CAIRN_EMPTY);
    left.left = 0;
    assert_status(cairn_box_sweep_next(sweep, &left, &pair[0], &pair[1]), CAIRN_EMPTY);
    for (int32_t i = 0; i < count; i++)
        for (int32_t j = i + 1; j < count; j++)
            assert_int_equal(seen[i][j], holds_a_point(boxes[i]) && holds_a_point(boxes[j]) &&
                                             cairn_box_overlap(boxes[i], boxes[j]));
    return spent;
}

static void random_boxes(cairn_random *random, cairn_box *boxes, int32_t count, cairn_real size)
{
    for (int32_t i = 0; i < count; i++) {
        boxes[i].min.x = cairn_rint(cairn_random_uniform(random, 0, 40)) / 4;
        boxes[i].min.y = cairn_random_uniform(random, 0, 10);
        boxes[i].max.x = boxes[i].min.x + cairn_rint(cairn_random_uniform(random, 0, 4 * size)) / 4;
        boxes[i].max.y = boxes[i].min.y + cairn_random_uniform(random, 0, size);
    }
}

static void test_sweep_matches_all_pairs(void **state)
{
    static const int32_t counts[] = {0, 1, 2, 3, 10, 30, 31, 90, 120, 50, 7, 0, 119, 120};
    static const int32_t budgets[] = {CAIRN_UNBOUNDED, 1, 7, 1000};
    uint64_t hashes[4];

    (void)state;
    for (int k = 0; k < 4; k++) {
        cairn_random random = cairn_random_seed(11, 2);
        cairn_pool pool;
        cairn_box_sweep *sweep = make_sweep(&pool, BOXES);
        cairn_box boxes[BOXES];

        hashes[k] = TEST_HASH_START;
        random_boxes(&random, boxes, BOXES, 2);
        for (size_t round = 0; round < sizeof counts / sizeof counts[0]; round++) {
            uint64_t hash;

            (void)check_sweep(sweep, boxes, counts[round], budgets[k], &hash);
            hashes[k] = test_hash(hashes[k], &hash, sizeof hash);
            for (int32_t i = 0; i < BOXES; i++) {
                cairn_real by = cairn_random_uniform(&random, CAIRN_REAL(-0.5), CAIRN_REAL(0.5));

                boxes[i].min.x += by;
                boxes[i].max.x += by;
            }
            if (round == 9)
                random_boxes(&random, boxes, BOXES, 5);
        }
        test_pool_free(&pool);
    }
    assert_true(hashes[0] == hashes[1] && hashes[0] == hashes[2] && hashes[0] == hashes[3]);
}

/* Boxes that touch share a point; points and lines are boxes; empty boxes and NaN overlap
 * nothing. */
/* Within a window: of all pairs, in their order, those of which both boxes overlap it. */
static void test_sweep_in_a_window(void **state)
{
    static const int32_t budgets[] = {1, 7, CAIRN_UNBOUNDED};
    static const cairn_box windows[] = {
        {{2, 3}, {6, 5}}, {{-1, -1}, {30, 30}}, {{5, 5}, {5, 5}}, {{4, 4}, {3, 3}}};
    cairn_random random = cairn_random_seed(11, 4);
    static cairn_box boxes[60];
    cairn_pool pool;
    cairn_box_sweep *sweep = make_sweep(&pool, 60);

    (void)state;
    for (int round = 0; round < 8; round++) {
        cairn_box window = windows[round % 4];
        int32_t all[60 * 60][2], count = 0, at, pair[2];

        random_boxes(&random, boxes, 60, 2);
        for (int k = 0; k < 4; k++) {
            cairn_budget left = {k == 0 ? CAIRN_UNBOUNDED : budgets[k - 1]};
            cairn_status status;

            at = 0;
            if (k == 0)
                assert_ok(cairn_box_sweep_begin(sweep, boxes, 60));
            else
                assert_ok(cairn_box_sweep_begin_in(sweep, boxes, 60, window));
            while ((status = cairn_box_sweep_next(sweep, &left, &pair[0], &pair[1])) !=
                   CAIRN_EMPTY) {
                if (status == CAIRN_MORE) {
                    left.left = budgets[k - 1];
                } else if (k == 0) {
                    if (cairn_box_overlap(boxes[pair[0]], window) &&
                        cairn_box_overlap(boxes[pair[1]], window))
                        memcpy(all[count++], pair, sizeof pair);
                } else {
                    assert_true(at < count);
                    assert_memory_equal(all[at++], pair, sizeof pair);
                }
            }
            assert_int_equal(at, k == 0 ? 0 : count);
        }
    }
    assert_status(cairn_box_sweep_begin_in(sweep, boxes, -1, windows[0]), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_box_sweep_begin_in(sweep, boxes, 61, windows[0]), CAIRN_FULL);
    test_pool_free(&pool);
}

static void test_sweep_edges(void **state)
{
    cairn_box boxes[] = {{{0, 0}, {1, 1}},
                         {{1, 1}, {2, 2}},
                         {{1, 0}, {1, 3}},
                         {{2, 2}, {2, 2}},
                         {{(cairn_real)NAN, 0}, {9, 9}},
                         {{0, (cairn_real)NAN}, {9, 9}},
                         {{0, 0}, {(cairn_real)NAN, 9}},
                         {{0, 0}, {9, (cairn_real)NAN}},
                         {{3, 0}, {-3, 9}},
                         {{0, 3}, {9, -3}},
                         {{-(cairn_real)INFINITY, -(cairn_real)INFINITY},
                          {(cairn_real)INFINITY, (cairn_real)INFINITY}}};
    cairn_pool pool;
    cairn_box_sweep *sweep = make_sweep(&pool, 20);
    uint64_t hash;

    (void)state;
    for (int32_t count = 0; count <= 11; count++)
        (void)check_sweep(sweep, boxes, count, 3, &hash);
    for (int32_t count = 11; count >= 0; count--)
        (void)check_sweep(sweep, boxes, count, 3, &hash);
    test_pool_free(&pool);
}

/* A sweep begun in the middle of another, at any point of it, gives the same result. */
static void test_sweep_begins_anew(void **state)
{
    cairn_random random = cairn_random_seed(3, 3);
    cairn_box boxes[BOXES];

    (void)state;
    for (int32_t stop = 0; stop < 1500; stop += 13) {
        cairn_pool pool;
        cairn_box_sweep *sweep = make_sweep(&pool, BOXES);
        cairn_budget budget = {stop};
        int32_t first, second;
        uint64_t hash;

        random_boxes(&random, boxes, BOXES, 1);
        assert_ok(cairn_box_sweep_begin(sweep, boxes, BOXES));
        while (cairn_box_sweep_next(sweep, &budget, &first, &second) == CAIRN_OK)
            assert_true(cairn_box_overlap(boxes[first], boxes[second]));
        (void)check_sweep(sweep, boxes, stop % 2 ? BOXES : BOXES / 2, 50, &hash);
        (void)check_sweep(sweep, boxes, BOXES, 50, &hash);
        test_pool_free(&pool);
    }
}

/* Sorted order is kept: the second sweep over unmoved boxes costs a pass, a comparison and a test
 * to the unit; pairs are in the order of the left sides. */
static void test_sweep_cost(void **state)
{
    cairn_pool pool;
    cairn_box_sweep *sweep = make_sweep(&pool, BOXES);
    cairn_box boxes[BOXES];
    uint64_t hash;
    int32_t cost;

    (void)state;
    for (int32_t i = 0; i < BOXES; i++) {
        boxes[i].min.x = (cairn_real)(BOXES - i) * 2;
        boxes[i].max.x = boxes[i].min.x + 1;
        boxes[i].min.y = 0;
        boxes[i].max.y = 1;
    }
    cost = check_sweep(sweep, boxes, BOXES, 1, &hash);
    assert_int_equal(cost, 771);
    /* One comparison a box to verify the order, one test a box to see that the next starts
     * later. */
    assert_int_equal(check_sweep(sweep, boxes, BOXES, 1, &hash), BOXES);
    boxes[0].min.x = boxes[1].min.x - 1;
    boxes[0].max.x = boxes[1].min.x;
    /* One pair, and one comparison and move more. */
    assert_int_equal(check_sweep(sweep, boxes, BOXES, 1, &hash), (4 * BOXES + 7 + 3) / 4);
    test_pool_free(&pool);
}

static cairn_status create_sweep(void *context, cairn_pool *pool)
{
    cairn_box_sweep *sweep = NULL;
    cairn_status status = cairn_box_sweep_create(&sweep, pool, context);

    assert_true((status == CAIRN_OK) == (sweep != NULL));
    return status;
}

static void test_sweep_refusals(void **state)
{
    cairn_box_sweep_params params = {.max_boxes = 17}, one = {.max_boxes = 1},
                           most = {.max_boxes = 1 << 28};
    cairn_pool pool = test_pool(10000);
    cairn_box_sweep *sweep;
    cairn_box boxes[2] = {{{0, 0}, {1, 1}}, {{0, 0}, {1, 1}}};
    cairn_budget budget = {100};
    int32_t first = 0, second = 0;

    (void)state;
    assert_true(cairn_box_sweep_memory(&one) > 0);
    assert_true(cairn_box_sweep_memory(&most) > (size_t)1 << 30);
    assert_status(cairn_box_sweep_create(&sweep, NULL, &params), CAIRN_BAD_ARGUMENT);
    test_every_pool_size(create_sweep, &params, cairn_box_sweep_memory(&params));

    params.max_boxes = 2;
    assert_ok(cairn_box_sweep_create(&sweep, &pool, &params));
    assert_status(cairn_box_sweep_next(sweep, &budget, &first, &second), CAIRN_EMPTY);
    assert_status(cairn_box_sweep_begin(sweep, boxes, 3), CAIRN_FULL);
    assert_status(cairn_box_sweep_begin(sweep, NULL, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_box_sweep_begin(sweep, boxes, -1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_box_sweep_begin(sweep, boxes, INT32_MIN), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_box_sweep_next(sweep, &budget, &first, &second), CAIRN_EMPTY);
    assert_int_equal(budget.left, 100);
    assert_ok(cairn_box_sweep_begin(sweep, NULL, 0));
    assert_status(cairn_box_sweep_next(sweep, &budget, &first, &second), CAIRN_EMPTY);
    assert_int_equal(budget.left, 99);

    assert_ok(cairn_box_sweep_begin(sweep, boxes, 2));
    budget.left = 0;
    assert_status(cairn_box_sweep_next(sweep, &budget, &first, &second), CAIRN_MORE);
    assert_int_equal(budget.left, 0);
    budget.left = 100;
    assert_ok(cairn_box_sweep_next(sweep, &budget, &first, &second));
    assert_int_equal(first, 0);
    assert_int_equal(second, 1);
    assert_status(cairn_box_sweep_next(sweep, &budget, &first, &second), CAIRN_EMPTY);
    test_pool_free(&pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_grid_matches_linear_search),
        cmocka_unit_test(test_grid_counts_evaluations),
        cmocka_unit_test(test_grid_far_points),
        cmocka_unit_test(test_grid_underflow),
        cmocka_unit_test(test_grid_huge_radius),
        cmocka_unit_test(test_grid_order_is_reproducible),
        cmocka_unit_test(test_grid_cells),
        cmocka_unit_test(test_grid_buckets),
        cmocka_unit_test(test_grid_memory),
        cmocka_unit_test(test_grid_refusals),
        cmocka_unit_test(test_sweep_matches_all_pairs),
        cmocka_unit_test(test_sweep_edges),
        cmocka_unit_test(test_sweep_in_a_window),
        cmocka_unit_test(test_sweep_begins_anew),
        cmocka_unit_test(test_sweep_cost),
        cmocka_unit_test(test_sweep_refusals),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
