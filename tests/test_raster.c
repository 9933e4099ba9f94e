/* Distance maps compared with a reference implementation; views, budgets. */
#include "tests/test.h"

#include "cairn/raster.h"

enum { SIDE = 40, MAX_CELLS = 64 * 64 };

static cairn_distance_map *make_map(cairn_pool *pool, int32_t max_width)
{
    cairn_distance_map_params params = {.max_width = max_width};
    cairn_distance_map *map;

    *pool = test_pool(cairn_distance_map_memory(&params));
    assert_ok(cairn_distance_map_create(&map, pool, &params));
    return map;
}

static int32_t slow_distance(const cairn_distance_map_input *input, int32_t x, int32_t y)
{
    int32_t best = CAIRN_DISTANCE_MAP_FAR;

    for (int32_t v = 0; v < input->pixels.height; v++)
        for (int32_t u = 0; u < input->pixels.width; u++) {
            int32_t dx = abs(x - u), dy = abs(y - v);
            int32_t d = input->metric == CAIRN_DISTANCE_MAP_L1 ? dx + dy : dx * dx + dy * dy;

            if ((input->pixels.data[v * input->pixels.stride + u] & input->mask) == input->match &&
                d < best)
                best = d;
        }
    return best;
}

/* Runs a map with budgets of `budget` units; returns the units spent. */
static int64_t run_map(cairn_distance_map *map, const cairn_distance_map_input *input,
                       int32_t budget)
{
    cairn_budget left;
    cairn_status status;
    int64_t spent = 0;

    assert_ok(cairn_distance_map_begin(map, input));
    do {
        left.left = budget;
        status = cairn_distance_map_step(map, &left);
        assert_true(left.left >= 0);
        assert_true(status == CAIRN_OK || (status == CAIRN_MORE && left.left == 0));
        spent += budget - left.left;
    } while (status == CAIRN_MORE);
    left.left = 0;
    assert_ok(cairn_distance_map_step(map, &left));
    return spent;
}

/* Both metrics, several budgets, flipped and padded views, compared with the reference
 * implementation. */
static void check_raster(cairn_distance_map *map, const uint8_t *pixels, int32_t width,
                         int32_t height, uint8_t mask, uint8_t match)
{
    static const int32_t budgets[] = {CAIRN_UNBOUNDED, 1, 7, 1000};
    static int32_t distances[MAX_CELLS];
    cairn_distance_map_input input;
    ptrdiff_t in_stride = width + 3, out_stride = width + 1;
    static uint8_t padded[MAX_CELLS];

    input.mask = mask;
    input.match = match;
    for (int32_t metric = CAIRN_DISTANCE_MAP_L1; metric <= CAIRN_DISTANCE_MAP_L2_SQUARED; metric++)
        for (int k = 0; k < 4; k++) {
            int flipped = k % 2;
            int64_t spent;

            memset(padded, match, sizeof padded);
            for (int32_t i = 0; i < MAX_CELLS; i++)
                distances[i] = -7;
            input.metric = metric;
            input.pixels.width = input.distances.width = width;
            input.pixels.height = input.distances.height = height;
            input.pixels.data = flipped ? padded + (height - 1) * in_stride : padded;
            input.pixels.stride = flipped ? -in_stride : in_stride;
            for (int32_t y = 0; y < height; y++)
                memcpy(padded + (flipped ? height - 1 - y : y) * in_stride, pixels + y * width,
                       (size_t)width);
            input.distances.data = distances + (flipped ? 0 : (height - 1) * out_stride);
            input.distances.stride = flipped ? out_stride : -out_stride;
            spent = run_map(map, &input, budgets[k]);
            /* Down, up from the second row, right and left: six pixels a unit. */
            if (metric == CAIRN_DISTANCE_MAP_L1)
                assert_int_equal(spent, ((4 * height - 1) * width + 5) / 6);
            else
                assert_true(spent * 6 >= 3 * width * height && spent * 6 <= 5 * width * height + 6);
            for (int32_t y = 0; y < height; y++) {
                const int32_t *row = input.distances.data + y * input.distances.stride;

                for (int32_t x = 0; x < width; x++)
                    assert_int_equal(row[x], slow_distance(&input, x, y));
                assert_int_equal(distances[y * out_stride + width], -7);
            }
        }
}

static void test_distance_matches_brute_force(void **state)
{
    static const int32_t sizes[][2] = {{1, 1}, {2, 1},   {1, 2},   {1, 37}, {37, 1},
                                       {2, 2}, {13, 29}, {40, 17}, {40, 40}};
    cairn_random random = cairn_random_seed(5, 0);
    uint8_t pixels[SIDE * SIDE];
    cairn_pool pool;
    cairn_distance_map *map = make_map(&pool, SIDE);

    (void)state;
    for (size_t s = 0; s < sizeof sizes / sizeof sizes[0]; s++)
        for (int32_t rarity = 1; rarity <= 4096; rarity *= 8) {
            int32_t width = sizes[s][0], height = sizes[s][1];

            for (int32_t i = 0; i < width * height; i++)
                pixels[i] = cairn_random_below(&random, rarity) == 0
                                ? 205
                                : (uint8_t)cairn_random_below(&random, 205);
            check_raster(map, pixels, width, height, 0xFF, 205);
        }
    test_pool_free(&pool);
}

static void test_distance_of_few_pixels(void **state)
{
    uint8_t pixels[SIDE * SIDE];
    cairn_pool pool;
    cairn_distance_map *map = make_map(&pool, SIDE);

    (void)state;
    memset(pixels, 0, sizeof pixels);
    check_raster(map, pixels, SIDE, 20, 0xFF, 1);
    check_raster(map, pixels, 5, SIDE, 0xFF, 0);
    for (int32_t i = 0; i < SIDE * 9; i += 53) {
        pixels[i] = 0x30;
        check_raster(map, pixels, SIDE, 9, 0x10, 0x10);
        check_raster(map, pixels, 9, SIDE, 0xF0, 0x30);
        check_raster(map, pixels, 9, SIDE, 0x10, 0x20);
        pixels[i] = 0;
    }
    test_pool_free(&pool);
}

/* One match in the corner of the longest row and column: the largest possible numbers. */
static void test_distance_of_longest_sides(void **state)
{
    enum { LONG = CAIRN_RASTER_MAX_SIDE };
    static uint8_t pixels[LONG];
    static int32_t distances[LONG];
    cairn_pool pool;
    cairn_distance_map *map = make_map(&pool, LONG);
    cairn_distance_map_input input = {{pixels, LONG, 1, LONG},
                                      {distances, LONG, 1, LONG},
                                      0xFF,
                                      1,
                                      CAIRN_DISTANCE_MAP_L2_SQUARED};

    (void)state;
    for (int turn = 0; turn < 4; turn++) {
        memset(pixels, 0, sizeof pixels);
        pixels[0] = pixels[turn < 2 ? 0 : LONG - 1] = 1;
        input.pixels.width = input.distances.width = turn % 2 ? 1 : LONG;
        input.pixels.height = input.distances.height = turn % 2 ? LONG : 1;
        input.pixels.stride = input.distances.stride = turn % 2 ? 1 : 0;
        (void)run_map(map, &input, CAIRN_UNBOUNDED);
        for (int32_t i = 0; i < LONG; i++) {
            int32_t d = turn >= 2 && LONG - 1 - i < i ? LONG - 1 - i : i;

            assert_int_equal(distances[i], d * d);
        }
    }
    test_pool_free(&pool);
}

/* A map begun anew drops the one before at any stage. */
static void test_distance_begins_anew(void **state)
{
    uint8_t pixels[SIDE * SIDE];
    cairn_random random = cairn_random_seed(8, 0);
    int32_t distances[SIDE * SIDE], expected[SIDE * SIDE];
    cairn_pool pool;
    cairn_distance_map *map = make_map(&pool, SIDE);

    (void)state;
    for (int32_t i = 0; i < SIDE * SIDE; i++)
        pixels[i] = (uint8_t)cairn_random_below(&random, 30);
    for (int32_t units = 0; units < 1300; units += 37) {
        cairn_distance_map_input input = {{pixels, SIDE, SIDE, SIDE},
                                          {distances, SIDE, SIDE, SIDE},
                                          0xFF,
                                          3,
                                          CAIRN_DISTANCE_MAP_L2_SQUARED};
        cairn_budget budget = {units};

        for (int32_t i = 0; i < SIDE * SIDE; i++)
            expected[i] = slow_distance(&input, i % SIDE, i / SIDE);
        input.match = 1;
        input.metric = units % 2 ? CAIRN_DISTANCE_MAP_L1 : CAIRN_DISTANCE_MAP_L2_SQUARED;
        assert_ok(cairn_distance_map_begin(map, &input));
        (void)!cairn_distance_map_step(map, &budget);
        input.match = 3;
        input.metric = CAIRN_DISTANCE_MAP_L2_SQUARED;
        (void)run_map(map, &input, 100);
        assert_memory_equal(distances, expected, sizeof expected);
    }
    test_pool_free(&pool);
}

static cairn_status create_map(void *context, cairn_pool *pool)
{
    cairn_distance_map *map = NULL;
    cairn_status status = cairn_distance_map_create(&map, pool, context);

    assert_true((status == CAIRN_OK) == (map != NULL));
    return status;
}

static void test_distance_refusals(void **state)
{
    cairn_distance_map_params params = {.max_width = 9};
    uint8_t pixels[20] = {0};
    int32_t distances[20];
    cairn_distance_map_input good = {{pixels, 5, 4, 5},
                                     {distances, 5, 4, 5},
                                     0xFF,
                                     0,
                                     CAIRN_DISTANCE_MAP_L1},
                             input;
    cairn_pool pool = test_pool(10000);
    cairn_distance_map *map;
    cairn_budget budget = {5};

    (void)state;
    assert_status(cairn_distance_map_create(&map, NULL, &params), CAIRN_BAD_ARGUMENT);
    test_every_pool_size(create_map, &params, cairn_distance_map_memory(&params));

    params.max_width = 4;
    assert_ok(cairn_distance_map_create(&map, &pool, &params));
    assert_ok(cairn_distance_map_step(map, &budget));
    assert_int_equal(budget.left, 5);
    assert_status(cairn_distance_map_begin(map, &good), CAIRN_FULL);
    params.max_width = 5;
    assert_ok(cairn_distance_map_create(&map, &pool, &params));
    assert_status(cairn_distance_map_begin(NULL, &good), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_distance_map_begin(map, NULL), CAIRN_BAD_ARGUMENT);
    for (int k = 0; k < 6; k++) {
        input = good;
        if (k == 0)
            input.pixels.data = NULL;
        else if (k == 1)
            input.distances.data = NULL;
        else if (k == 2)
            input.distances.width = 4;
        else if (k == 3)
            input.distances.height = 3;
        else
            input.metric = k == 4 ? 2 : -1;
        assert_status(cairn_distance_map_begin(map, &input), CAIRN_BAD_ARGUMENT);
        assert_ok(cairn_distance_map_step(map, &budget));
        assert_int_equal(budget.left, 5);
    }
    assert_ok(cairn_distance_map_begin(map, &good));
    budget.left = 0;
    assert_status(cairn_distance_map_step(map, &budget), CAIRN_MORE);
    assert_int_equal(budget.left, 0);
    test_pool_free(&pool);
}

static void test_view_checks(void **state)
{
    static uint8_t u8[6];
    static int32_t i32[6];
    static cairn_real real[6];
    cairn_raster_u8 a = {u8, 3, 2, 3};
    cairn_raster_i32 b = {i32, 3, 2, 3};
    cairn_raster_real c = {real, 3, 2, 3};
    cairn_raster_u8_view v = cairn_raster_u8_as_view(a);
    cairn_raster_i32_view w = cairn_raster_i32_as_view(b);
    cairn_raster_real_view r = cairn_raster_real_as_view(c);

    (void)state;
    assert_ok(cairn_raster_u8_check(v));
    assert_ok(cairn_raster_i32_check(w));
    assert_ok(cairn_raster_real_check(r));
    assert_true(v.data == u8 && v.width == 3 && v.height == 2 && v.stride == 3);
    assert_true(w.data == i32 && w.width == 3 && w.height == 2 && w.stride == 3);
    assert_true(r.data == real && r.width == 3 && r.height == 2 && r.stride == 3);
    for (int k = 0; k < 10; k++) {
        static const int32_t widths[] = {0, -1, CAIRN_RASTER_MAX_SIDE + 1, 3, 3, 3, 3, 3, 3, 3};
        static const int32_t heights[] = {2, 2, 2, 0, -1, CAIRN_RASTER_MAX_SIDE + 1, 2, 2, 2, 3};
        static const ptrdiff_t strides[] = {
            3, 3, CAIRN_RASTER_MAX_SIDE + 1, 3, 3, 3, 2, -2, PTRDIFF_MIN, PTRDIFF_MAX / 2};

        v.width = w.width = r.width = widths[k];
        v.height = w.height = r.height = heights[k];
        v.stride = w.stride = r.stride = strides[k];
        assert_status(cairn_raster_u8_check(v), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_raster_i32_check(w), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_raster_real_check(r), CAIRN_BAD_ARGUMENT);
    }
    v.height = w.height = r.height = 2;
    v.stride = PTRDIFF_MAX - 3;
    w.stride = PTRDIFF_MAX / 4 - 3;
    r.stride = PTRDIFF_MAX / (ptrdiff_t)sizeof(cairn_real) - 3;
    assert_ok(cairn_raster_u8_check(v));
    assert_ok(cairn_raster_i32_check(w));
    assert_ok(cairn_raster_real_check(r));
    v.stride++;
    w.stride++;
    r.stride++;
    assert_status(cairn_raster_u8_check(v), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_raster_i32_check(w), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_raster_real_check(r), CAIRN_BAD_ARGUMENT);
    v.stride = -3;
    assert_ok(cairn_raster_u8_check(v));
    v.height = 1;
    v.stride = 0;
    assert_ok(cairn_raster_u8_check(v));
    v.width = v.height = CAIRN_RASTER_MAX_SIDE;
    v.stride = CAIRN_RASTER_MAX_SIDE;
    assert_ok(cairn_raster_u8_check(v));
    v.data = NULL;
    assert_status(cairn_raster_u8_check(v), CAIRN_BAD_ARGUMENT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_distance_matches_brute_force),
        cmocka_unit_test(test_distance_of_few_pixels),
        cmocka_unit_test(test_distance_of_longest_sides),
        cmocka_unit_test(test_distance_begins_anew),
        cmocka_unit_test(test_distance_refusals),
        cmocka_unit_test(test_view_checks),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
