/* Scans at their poses: their copies, the map file, culled keyframes. */
#include "src/host/maps/placed_scan.h"
#include "tests/test.h"

enum { BEAMS = 4 };

static const cairn_scan_beam beams[BEAMS] = {
    {{0, 0}, {2, 0}, CAIRN_SCAN_BEAM_HIT},
    {{0, 0}, {0, 4}, CAIRN_SCAN_BEAM_FREE},
    {{0, 0}, {0, 0}, CAIRN_SCAN_BEAM_UNKNOWN},
    {{0, 0}, {-9, 0}, CAIRN_SCAN_BEAM_HIT},
};

static cairn_placed_scan *scans;

static int set_up(void **state)
{
    cairn_scan_view view = {0};

    (void)state;
    view.beams = beams;
    view.beam_count = BEAMS;
    scans = cairn_placed_scans_new(1);
    return scans == NULL || !cairn_placed_scan_copy(scans, &view);
}

static int tear_down(void **state)
{
    (void)state;
    cairn_placed_scans_free(scans, 1);
    return 0;
}

static cairn_placed_scan_map map_of(double range, double clear)
{
    cairn_placed_scan_map map = {
        .scan = scans, .count = 1, .resolution = 0.5, .beams = cairn_scan_map_default()};

    map.beams.max_range = (cairn_real)range;
    map.beams.max_free_range = (cairn_real)clear;
    return map;
}

static void unknown_beams_are_not_copied(void **state)
{
    (void)state;
    assert_int_equal(scans->beam_count, BEAMS - 1);
    assert_true(scans->hit[0]);
    assert_false(scans->hit[1]);
    assert_true(scans->support != scans->support);
}

static void the_map_contains_all_beams(void **state)
{
    cairn_placed_scan_map map = map_of(30, 5);
    cairn_file_error error;
    cairn_map_file file;
    int32_t occupied = 0, freed = 0;

    (void)state;
    assert_ok(cairn_placed_scan_map_make(&map, &file, &error));
    /* x from -9 to 2, y from 0 to 4, and a margin of 1 m. */
    assert_int_equal(file.width, 26);
    assert_int_equal(file.height, 12);
    assert_near(file.origin.x, -10, 0);
    assert_near(file.origin.y, -1, 0);
    for (int32_t i = 0; i < file.width * file.height; i++) {
        occupied += file.occupancy[i] == 100;
        freed += file.occupancy[i] == 0;
    }
    assert_int_equal(occupied, 2);
    assert_true(freed > 20);
    cairn_map_file_free(&file);
}

static void too_many_cells_are_refused(void **state)
{
    cairn_placed_scan_map map = map_of(30, 5);
    cairn_file_error error;
    cairn_map_file file;

    (void)state;
    map.resolution = 1e-5;
    assert_status(cairn_placed_scan_map_make(&map, &file, &error), CAIRN_FULL);
    assert_non_null(strstr(error.text, "coarser resolution"));
}

static void scans_of_a_culled_keyframe_move_to_its_neighbour(void **state)
{
    cairn_mapper_culling culling = {1, 0, {1, 0, 0}};
    cairn_scan_place places[3] = {{{0, 0, 0}, 0}, {{CAIRN_REAL(0.5), 0, 0}, 1}, {{2, 0, 0}, 2}};

    (void)state;
    cairn_scan_places_reattach(places, 3, culling);
    assert_int_equal(places[0].keyframe, 0);
    assert_int_equal(places[1].keyframe, 0);
    assert_near(places[1].keyframe_scan.x, 1.5, 0);
    assert_int_equal(places[2].keyframe, 1);
    assert_near(places[2].keyframe_scan.x, 2, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(unknown_beams_are_not_copied, set_up, tear_down),
        cmocka_unit_test_setup_teardown(the_map_contains_all_beams, set_up, tear_down),
        cmocka_unit_test_setup_teardown(too_many_cells_are_refused, set_up, tear_down),
        cmocka_unit_test(scans_of_a_culled_keyframe_move_to_its_neighbour),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
