/* Cells of a grid beside a search through all cells. */
#include "tests/test.h"

#include "src/containers/cell_grid.h"

enum { ROUNDS = 2000, SIDE = 7, WIDTH = 60, HEIGHT = 41 };

static void a_grid_covers_its_image_with_no_cell_too_many(void **state)
{
    (void)state;
    for (int32_t width = 1; width < 30; width++) {
        cell_grid grid = cell_grid_of(width, 2 * width, SIDE);

        assert_in_range(grid.columns * SIDE, width, width + SIDE - 1);
        assert_in_range(grid.rows * SIDE, 2 * width, 2 * width + SIDE - 1);
        assert_int_equal(cell_grid_count(&grid), grid.columns * grid.rows);
    }
}

/* The nearest cell to a point, by all cells. */
static int32_t nearest_cell(const cell_grid *grid, cairn_vec2 p)
{
    int32_t best = -1;
    cairn_real least = CAIRN_REAL_MAX;

    for (int32_t cell = 0; cell < cell_grid_count(grid); cell++) {
        int32_t column = cell % grid->columns, row = cell / grid->columns;
        cairn_vec2 corner = {(cairn_real)column * SIDE, (cairn_real)row * SIDE};
        cairn_vec2 away = {
            cairn_max(cairn_max(corner.x - p.x, p.x - corner.x - (cairn_real)SIDE), 0),
            cairn_max(cairn_max(corner.y - p.y, p.y - corner.y - (cairn_real)SIDE), 0)};

        /* On a common border the later cell. */
        if (cairn_vec2_norm_squared(away) <= least) {
            least = cairn_vec2_norm_squared(away);
            best = cell;
        }
    }
    return best;
}

static void a_point_beyond_the_grid_belongs_to_the_nearest_cell(void **state)
{
    cairn_random random = cairn_random_seed(1, 1);
    cell_grid grid = cell_grid_of(WIDTH, HEIGHT, SIDE);

    (void)state;
    for (int32_t round = 0; round < ROUNDS; round++) {
        /* Half a pixel away from the borders of cells. */
        cairn_vec2 p = {
            (cairn_real)cairn_random_below(&random, 3 * WIDTH) - WIDTH + CAIRN_REAL(0.5),
            (cairn_real)cairn_random_below(&random, 3 * HEIGHT) - HEIGHT + CAIRN_REAL(0.5)};

        assert_int_equal(cell_grid_cell(&grid, SIDE, p), nearest_cell(&grid, p));
    }
}

static void the_range_of_a_box_holds_the_cells_of_its_points_alone(void **state)
{
    cairn_random random = cairn_random_seed(2, 1);
    cell_grid grid = cell_grid_of(WIDTH, HEIGHT, SIDE);

    (void)state;
    for (int32_t round = 0; round < ROUNDS; round++) {
        cairn_vec2 at = {(cairn_real)cairn_random_below(&random, WIDTH),
                         (cairn_real)cairn_random_below(&random, HEIGHT)};
        cairn_box box =
            cairn_box_grow((cairn_box){at, at}, (cairn_real)cairn_random_below(&random, 2 * SIDE));
        cell_range range = cell_grid_range(&grid, SIDE, box);

        assert_int_equal(range.y0 * grid.columns + range.x0, cell_grid_cell(&grid, SIDE, box.min));
        assert_int_equal(range.y1 * grid.columns + range.x1, cell_grid_cell(&grid, SIDE, box.max));
        assert_true(range.x0 <= range.x1 && range.y0 <= range.y1);
    }
}

static void distant_coordinates_do_not_overflow(void **state)
{
    const cell_grid grid = {3, 5};

    (void)state;
    assert_int_equal(
        cell_grid_cell(&grid, CAIRN_REAL(1e-6), (cairn_vec2){CAIRN_REAL_MAX, CAIRN_REAL_MAX}), 14);
    assert_int_equal(
        cell_grid_cell(&grid, CAIRN_REAL(1e-6), (cairn_vec2){-CAIRN_REAL_MAX, -CAIRN_REAL_MAX}), 0);
}

/* An index spreads its entries over the buckets: none has more than three times its share. */
static void cells_of_a_plane_and_of_layers_spread_over_the_buckets(void **state)
{
    enum { ACROSS = 64, LAYERS = 4, BUCKETS = 256, SHARE = ACROSS * ACROSS * LAYERS / BUCKETS };
    int32_t filled[BUCKETS] = {0};

    (void)state;
    for (int32_t x = -ACROSS / 2; x < ACROSS / 2; x++)
        for (int32_t y = -ACROSS / 2; y < ACROSS / 2; y++)
            for (int32_t layer = 0; layer < LAYERS; layer++)
                filled[cell_hash(x, y, layer) % BUCKETS]++;
    for (int32_t bucket = 0; bucket < BUCKETS; bucket++)
        assert_in_range(filled[bucket], SHARE / 3, 3 * SHARE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_grid_covers_its_image_with_no_cell_too_many),
        cmocka_unit_test(a_point_beyond_the_grid_belongs_to_the_nearest_cell),
        cmocka_unit_test(the_range_of_a_box_holds_the_cells_of_its_points_alone),
        cmocka_unit_test(distant_coordinates_do_not_overflow),
        cmocka_unit_test(cells_of_a_plane_and_of_layers_spread_over_the_buckets),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
