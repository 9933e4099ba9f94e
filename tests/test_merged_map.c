/* The map file of placed maps: classes of cells, votes, frames of turned maps, refusals. */
#include "src/host/maps/merged_map.h"
#include "cairn/occupancy_grid.h"
#include "tests/test.h"

enum { O = CAIRN_OCCUPANCY_GRID_OCCUPIED, F = CAIRN_OCCUPANCY_GRID_FREE };
enum { U = CAIRN_OCCUPANCY_GRID_UNKNOWN, WIDTH = 4, HEIGHT = 2 };

static const cairn_map_merge_placed here = {.verdict = CAIRN_MAP_MERGE_PLACED};

/* A map of WIDTH by HEIGHT cells of 0.5 m with the corner at (x, y). */
static cairn_map_merge_map map_at(const uint8_t *cells, double x, double y)
{
    cairn_map_merge_map map = {
        {cells, WIDTH, HEIGHT, WIDTH}, CAIRN_REAL(0.5), {(cairn_real)x, (cairn_real)y, 0}};

    return map;
}

static void assert_cells(const cairn_map_file *map, const int8_t *expected)
{
    for (int32_t i = 0; i < map->width * map->height; i++)
        assert_int_equal(map->occupancy[i], expected[i]);
}

static void most_votes_decide_and_ties_are_occupied(void **state)
{
    static const uint8_t cells[3][WIDTH * HEIGHT] = {
        {O, O, F, U, O, F, F, U}, {F, O, F, U, O, O, F, F}, {F, F, F, U, U, U, O, O}};
    static const int8_t expected[] = {0, 100, 0, -1, 100, 100, 0, 100};
    cairn_map_merge_map maps[3];
    cairn_map_merge_placed placed[] = {here, here, here};
    cairn_map_file merged;
    cairn_file_error error;

    (void)state;
    for (int i = 0; i < 3; i++)
        maps[i] = map_at(cells[i], 1, -3);
    assert_ok(cairn_merged_map_make(maps, placed, 3, CAIRN_REAL(0.5), &merged, &error));
    assert_int_equal(merged.width, WIDTH);
    assert_int_equal(merged.height, HEIGHT);
    assert_near(merged.origin.x, 1, 0);
    assert_near(merged.origin.y, -3, 0);
    assert_cells(&merged, expected);
    assert_int_equal(merged.pixel[0], 254);
    cairn_map_file_free(&merged);
}

static void maps_that_are_not_placed_are_left_out(void **state)
{
    static const uint8_t cells[2][WIDTH * HEIGHT] = {{O, F, F, F, F, F, F, F},
                                                     {F, O, O, O, O, O, O, O}};
    static const int8_t expected[] = {100, 0, 0, 0, 0, 0, 0, 0};
    cairn_map_merge_map maps[] = {map_at(cells[0], 0, 0), map_at(cells[1], 9, 9)};
    cairn_map_merge_placed placed[] = {here, here};
    cairn_map_file merged;
    cairn_file_error error;

    (void)state;
    placed[1].verdict = CAIRN_MAP_MERGE_LOW_SUPPORT;
    assert_ok(cairn_merged_map_make(maps, placed, 2, CAIRN_REAL(0.5), &merged, &error));
    assert_int_equal(merged.width, WIDTH);
    assert_cells(&merged, expected);
    cairn_map_file_free(&merged);
}

static void a_turned_map_lies_at_its_pose(void **state)
{
    static const uint8_t cells[WIDTH * HEIGHT] = {O, F, F, U, O, O, F, F};
    static const int8_t expected[HEIGHT * WIDTH] = {100, 100, 100, 0, 0, 0, 0, -1};
    cairn_map_merge_map map = map_at(cells, 0, 0);
    cairn_map_merge_placed placed = here;
    cairn_map_file merged;
    cairn_file_error error;

    (void)state;
    placed.reference_map.x = 5;
    placed.reference_map.theta = CAIRN_PI / 2;
    assert_ok(cairn_merged_map_make(&map, &placed, 1, CAIRN_REAL(0.5), &merged, &error));
    assert_near(merged.origin.x, 4, NUMBER(1e-12, 1e-5));
    assert_in_range(merged.width, HEIGHT, HEIGHT + 1);
    assert_in_range(merged.height, WIDTH, WIDTH + 1);
    for (int32_t y = 0; y < WIDTH; y++)
        for (int32_t x = 0; x < HEIGHT; x++)
            assert_int_equal(merged.occupancy[y * merged.width + x], expected[y * HEIGHT + x]);
    cairn_map_file_free(&merged);
}

static void no_map_and_too_many_cells_are_refused(void **state)
{
    static const uint8_t cells[WIDTH * HEIGHT] = {0};
    cairn_map_merge_map map = map_at(cells, 0, 0);
    cairn_map_merge_placed placed = here;
    cairn_map_file merged;
    cairn_file_error error;

    (void)state;
    assert_int_equal(cairn_merged_map_make(&map, &placed, 1, CAIRN_REAL(1e-6), &merged, &error),
                     CAIRN_FULL);
    assert_non_null(strstr(error.text, "cells"));
    placed.verdict = CAIRN_MAP_MERGE_LOW_SUPPORT;
    assert_int_equal(cairn_merged_map_make(&map, &placed, 1, 1, &merged, &error), CAIRN_FULL);
}

static void cells_are_known_when_fully_occupied_or_free(void **state)
{
    int8_t occupancy[] = {-1, 0, 1, 19, 20, 65, 66, 99, 100};
    static const uint8_t trinary[] = {U, F, U, U, U, U, U, U, O},
                         raw[] = {U, F, F, F, U, O, O, O, O};
    uint8_t cells[sizeof occupancy];
    cairn_map_file file = cairn_map_file_default();

    (void)state;
    file.width = sizeof occupancy;
    file.height = 1;
    file.occupancy = occupancy;
    cairn_merged_map_classify(&file, cells);
    assert_memory_equal(cells, trinary, sizeof cells);
    file.mode = CAIRN_MAP_FILE_RAW;
    file.occupied_threshold = CAIRN_REAL(0.64);
    cairn_merged_map_classify(&file, cells);
    assert_memory_equal(cells, raw, sizeof cells);
    /* The thresholds themselves are occupied and free. */
    {
        int8_t values[] = {24, 25, 26, 74, 75, 76};
        static const uint8_t expected[] = {F, F, U, U, O, O};

        file.width = sizeof values;
        file.occupancy = values;
        file.free_threshold = CAIRN_REAL(0.25);
        file.occupied_threshold = CAIRN_REAL(0.75);
        cairn_merged_map_classify(&file, cells);
        assert_memory_equal(cells, expected, sizeof values);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(most_votes_decide_and_ties_are_occupied),
        cmocka_unit_test(maps_that_are_not_placed_are_left_out),
        cmocka_unit_test(a_turned_map_lies_at_its_pose),
        cmocka_unit_test(no_map_and_too_many_cells_are_refused),
        cmocka_unit_test(cells_are_known_when_fully_occupied_or_free),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
