/* Scan map: beams as they enter the grid, the two passes compared with a reference implementation,
 * what ends at walls, budgets, refusals. */
#include "tests/test.h"

#include <math.h>

#include "cairn/scan_map.h"

enum { SCANS = 3, BEAMS = 120, WIDTH = 70, HEIGHT = 50, CELLS = WIDTH * HEIGHT };

/* m: a room, 6 m by 4 m, with a wall across it at x = 3; the scanner is left of that. */
#define ROOM_WIDTH  6
#define ROOM_HEIGHT 4
#define WALL_X      3

static const cairn_occupancy_grid_params LAYOUT = {.width = WIDTH,
                                                   .height = HEIGHT,
                                                   .resolution = CAIRN_REAL(0.1),
                                                   .origin = {CAIRN_REAL(-0.5), CAIRN_REAL(-0.5)}};

/* Scans of the room; every seventh beam is lost, and passes the wall. */
typedef struct room {
    cairn_scan_map_scan scans[SCANS];
    float ends[SCANS][2 * BEAMS];
    uint8_t hits[SCANS][BEAMS];
} room;

/* Distance of the room's left half from a point in a direction, m. */
static double range_of(double x, double y, double angle)
{
    double c = cos(angle), s = sin(angle);
    double in_x = c > 0 ? (WALL_X - x) / c : c < 0 ? -x / c : HUGE_VAL;
    double in_y = s > 0 ? (ROOM_HEIGHT - y) / s : s < 0 ? -y / s : HUGE_VAL;

    return fmin(in_x, in_y);
}

static void simulate_room(room *r)
{
    static const cairn_pose poses[SCANS] = {
        {1, 1, CAIRN_REAL(0.25)}, {CAIRN_REAL(1.5), 2, -1}, {2, 3, CAIRN_REAL(0.5)}};

    for (int32_t s = 0; s < SCANS; s++) {
        r->scans[s] = (cairn_scan_map_scan){.map_scan = poses[s],
                                            .sensor = {CAIRN_REAL(0.125), 0},
                                            .ends = r->ends[s],
                                            .hits = r->hits[s],
                                            .beam_count = BEAMS};
        for (int32_t i = 0; i < BEAMS; i++) {
            double theta = (double)poses[s].theta, bearing = 2 * 3.14159265358979323846 * i / BEAMS;
            double x = (double)poses[s].x + 0.125 * cos(theta),
                   y = (double)poses[s].y + 0.125 * sin(theta);
            double range = i % 7 == 0 ? 4.5 : range_of(x, y, bearing + theta);

            r->ends[s][2 * i] = (float)(0.125 + range * cos(bearing));
            r->ends[s][2 * i + 1] = (float)(range * sin(bearing));
            r->hits[s][i] = i % 7 != 0;
        }
    }
}

/* A room, a grid, and a map maker with the capacity of the grid. */
typedef struct fixture {
    room room;
    cairn_scan_map_params params;
    cairn_pool pool;
    cairn_occupancy_grid *grid;
    cairn_scan_map *map;
} fixture;

static void open_fixture(fixture *f, int32_t stop_at_walls)
{
    simulate_room(&f->room);
    f->params = cairn_scan_map_default();
    f->params.max_cells = CELLS;
    f->params.stop_at_walls = stop_at_walls;
    f->pool = test_pool(cairn_occupancy_grid_memory(&LAYOUT) + cairn_scan_map_memory(&f->params));
    assert_ok(cairn_occupancy_grid_create(&f->grid, &f->pool, &LAYOUT));
    assert_ok(cairn_scan_map_create(&f->map, &f->pool, &f->params));
}

static cairn_status begin(void *context)
{
    fixture *f = context;

    return cairn_scan_map_begin(f->map, f->grid, f->room.scans, SCANS, NULL);
}

static cairn_status step(void *context, cairn_budget *budget)
{
    return cairn_scan_map_step(((fixture *)context)->map, budget);
}

static uint64_t grid_hash(void *context)
{
    uint64_t hash = TEST_HASH_START;

    for (int32_t i = 0; i < CELLS; i++) {
        cairn_occupancy_grid_cell_state cell =
            cairn_occupancy_grid_cell(((fixture *)context)->grid, i % WIDTH, i / WIDTH);

        hash = test_hash(hash, &cell, sizeof cell);
    }
    return hash;
}

static void make_map(fixture *f)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(begin(f));
    assert_ok(step(f, &budget));
}

/* Probability of the cell at a point, -1: unobserved. */
static double probability_at(const fixture *f, double x, double y)
{
    cairn_vec2 p = {(cairn_real)x, (cairn_real)y};
    int32_t column, row;

    assert_true(cairn_occupancy_grid_locate(f->grid, p, &column, &row));
    return (double)cairn_occupancy_grid_probability(f->grid, column, row);
}

/* ---- The reference implementation: one beam after the other, a byte for each cell ---- */

static int is_near_wall(const cairn_occupancy_grid *grid, int32_t x, int32_t y)
{
    for (int32_t v = y - 1; v <= y + 1; v++)
        for (int32_t u = x - 1; u <= x + 1; u++)
            if (cairn_occupancy_grid_probability(grid, u, v) >= CAIRN_REAL(0.25))
                return 1;
    return 0;
}

static cairn_vec2 slow_end(const cairn_occupancy_grid *grid, const uint8_t *walls, cairn_vec2 from,
                           cairn_vec2 to)
{
    int32_t count =
        (int32_t)(cairn_vec2_norm(cairn_vec2_sub(to, from)) / LAYOUT.resolution * 4) + 1;
    cairn_vec2 end = from;
    int left = 0;

    for (int32_t k = 1; k <= count; k++) {
        cairn_vec2 p = cairn_vec2_interpolate(from, to, (cairn_real)k / (cairn_real)count);
        int32_t x, y;

        if (cairn_occupancy_grid_locate(grid, p, &x, &y)) {
            if (walls[y * WIDTH + x] && left)
                return end;
            left = left || !walls[y * WIDTH + x];
        }
        end = p;
    }
    return to;
}

static void slow_pass(fixture *f, const uint8_t *walls)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    cairn_occupancy_grid_clear(f->grid);
    assert_ok(cairn_occupancy_grid_step(f->grid, &budget));
    for (int32_t s = 0; s < SCANS; s++)
        for (int32_t i = 0; i < BEAMS; i++) {
            cairn_transform map_scan = cairn_transform_of(f->room.scans[s].map_scan);
            cairn_vec2 from, to;
            int32_t hit;

            if (!cairn_scan_map_beam(&f->params, &f->room.scans[s], i, map_scan, &from, &to, &hit))
                continue;
            if (walls != NULL && !f->room.hits[s][i])
                to = slow_end(f->grid, walls, from, to);
            assert_ok(cairn_occupancy_grid_add_beam(f->grid, from, to, hit));
        }
}

static void both_passes_match_the_reference_implementation(void **state)
{
    static fixture f;
    static uint8_t walls[CELLS];
    uint64_t passed, stopped;

    (void)state;
    open_fixture(&f, 1);
    make_map(&f);
    stopped = grid_hash(&f);
    slow_pass(&f, NULL);
    passed = grid_hash(&f);
    for (int32_t i = 0; i < CELLS; i++)
        walls[i] = (uint8_t)is_near_wall(f.grid, i % WIDTH, i / WIDTH);
    slow_pass(&f, walls);
    assert_true(grid_hash(&f) == stopped);
    assert_true(passed != stopped);
    test_pool_free(&f.pool);

    open_fixture(&f, 0);
    make_map(&f);
    assert_true(grid_hash(&f) == passed);
    test_pool_free(&f.pool);
}

static void lost_beams_free_nothing_behind_a_wall(void **state)
{
    static fixture f;
    int32_t behind[2] = {0, 0};

    (void)state;
    for (int32_t stop = 0; stop < 2; stop++) {
        open_fixture(&f, stop);
        make_map(&f);
        assert_true(probability_at(&f, WALL_X + 0.05, 1.05) > 0.25);
        assert_near(probability_at(&f, 1.55, 1.55), 0, 0);
        for (double y = 0.25; y < ROOM_HEIGHT; y += 0.1)
            behind[stop] += probability_at(&f, WALL_X + 0.45, y) >= 0;
        test_pool_free(&f.pool);
    }
    assert_true(behind[0] > 3);
    assert_int_equal(behind[1], 0);
}

static void a_scanner_beside_a_wall_looks_away_from_it(void **state)
{
    /* Eight beams hit the wall around the scanner; one without return leaves it. */
    static const float ends[] = {0.05f, 0, 0, 0.05f, -0.05f, 0, 0, -0.05f, 2, 0};
    static const uint8_t hits[] = {1, 1, 1, 1, 0};
    static const cairn_scan_map_scan beside = {
        .map_scan = {1, 1, 0}, .ends = ends, .hits = hits, .beam_count = 5};
    static fixture f;
    cairn_budget budget = {CAIRN_UNBOUNDED};

    (void)state;
    open_fixture(&f, 1);
    assert_ok(cairn_scan_map_begin(f.map, f.grid, &beside, 1, NULL));
    assert_ok(cairn_scan_map_step(f.map, &budget));
    assert_true(probability_at(&f, 1.05, 1.05) > 0.25);
    assert_near(probability_at(&f, 2.55, 1.05), 0, 0);
    test_pool_free(&f.pool);
}

/* Beams without a return beyond the range of these, and of no length, say nothing. */
static void beams_that_say_nothing_are_left_out(void **state)
{
    static const float ends[] = {0.55f, 0, 30, 0, 0, 0};
    static const uint8_t hits[] = {1, 0, 1};
    cairn_scan_map_scan scans[2] = {
        {.map_scan = {1, 1, 0}, .ends = ends, .hits = hits, .beam_count = 1},
        {.map_scan = {1, 1, 0}, .beam_count = 0}};
    static fixture f;
    cairn_budget budget = {CAIRN_UNBOUNDED};
    uint64_t one;

    (void)state;
    open_fixture(&f, 0);
    assert_ok(cairn_scan_map_begin(f.map, f.grid, scans, 2, NULL));
    assert_ok(cairn_scan_map_step(f.map, &budget));
    assert_true(probability_at(&f, 1.55, 1.05) > 0.25);
    one = grid_hash(&f);
    scans[0].beam_count = 3;
    assert_ok(cairn_scan_map_begin(f.map, f.grid, scans, 2, NULL));
    assert_ok(cairn_scan_map_step(f.map, &budget));
    assert_true(grid_hash(&f) == one);
    test_pool_free(&f.pool);
}

/* ---- Beams ---- */

/* Returns the code of a beam along y of a scan at 90 degrees: -1 none, 0 free, 1 hit; and its end
 * in the map. */
static int32_t beam_of(float length, uint8_t hits, double range, double free_range, cairn_vec2 *to)
{
    float ends[2] = {1 + length, 0};
    cairn_scan_map_scan scan = {
        .map_scan = {5, 0, CAIRN_PI / 2}, .sensor = {1, 0}, .ends = ends, .hits = &hits};
    cairn_scan_map_params params = cairn_scan_map_default();
    cairn_vec2 from;
    int32_t hit;

    scan.beam_count = 1;
    params.max_range = (cairn_real)range;
    params.max_free_range = (cairn_real)free_range;
    if (!cairn_scan_map_beam(&params, &scan, 0, cairn_transform_of(scan.map_scan), &from, to, &hit))
        return -1;
    assert_near(from.x, 5, NUMBER(1e-12, 1e-5));
    assert_near(from.y, 1, NUMBER(1e-12, 1e-5));
    assert_near(to->x, 5, NUMBER(1e-12, 1e-5));
    return hit;
}

static void beams_are_cut_and_long_ones_without_return_left_out(void **state)
{
    cairn_vec2 to;

    (void)state;
    assert_int_equal(beam_of(2, 1, 30, 5, &to), 1);
    assert_near(to.y, 3, NUMBER(1e-12, 1e-5));
    assert_int_equal(beam_of(4, 0, 30, 5, &to), 0);
    assert_near(to.y, 5, NUMBER(1e-12, 1e-5));
    assert_int_equal(beam_of(4, 0, 30, 3.8, &to), -1);
    assert_int_equal(beam_of(4, 0, 30, 3.95, &to), 0);
    assert_int_equal(beam_of(4, 0, 30, 3.9, &to), 0); /* of just 0.1 m more */
    assert_int_equal(beam_of(6, 1, 6, 5, &to), 1);
    assert_int_equal(beam_of(9, 1, 6, 5, &to), 0);
    assert_near(to.y, 7, NUMBER(1e-12, 1e-5));
    assert_int_equal(beam_of(0, 1, 30, 5, &to), -1);
}

static void the_bounds_contain_sensors_and_beams(void **state)
{
    static room r;
    cairn_scan_map_params params = cairn_scan_map_default();
    cairn_box box = cairn_box_empty();

    (void)state;
    simulate_room(&r);
    params.max_free_range = 1; /* no lost beam */
    for (int32_t s = 0; s < SCANS; s++)
        box = cairn_scan_map_bounds(&params, &r.scans[s], box);
    assert_near(box.min.x, 0, 1e-5);
    assert_near(box.min.y, 0, 1e-5);
    assert_near(box.max.x, WALL_X, 1e-5);
    assert_near(box.max.y, ROOM_HEIGHT, 1e-5);
    r.scans[0].beam_count = 0;
    box = cairn_scan_map_bounds(&params, &r.scans[0], cairn_box_empty());
    assert_near(box.min.x, 1 + 0.125 * cos(0.25), NUMBER(1e-12, 1e-5));
    assert_near(box.max.x, (double)box.min.x, 0);
}

/* ---- The object ---- */

static void budgets_of_1_7_1000_and_all_give_the_same_bits(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    static fixture f;
    cairn_budget budget = {0};
    uint64_t whole;
    int64_t units;

    (void)state;
    open_fixture(&f, 1);
    assert_ok(cairn_scan_map_step(f.map, &budget)); /* nothing was begun */
    assert_ok(begin(&f));
    assert_status(step(&f, &budget), CAIRN_MORE);
    budget.left = CAIRN_UNBOUNDED;
    assert_ok(step(&f, &budget));
    units = CAIRN_UNBOUNDED - budget.left;
    whole = grid_hash(&f);
    for (size_t i = 0; i < sizeof budgets / sizeof *budgets; i++) {
        int64_t used = 0;
        cairn_status status;

        assert_ok(begin(&f));
        do {
            budget.left = budgets[i];
            status = step(&f, &budget);
            assert_in_range(budget.left, 0, budgets[i]);
            used += budgets[i] - budget.left;
        } while (status == CAIRN_MORE);
        assert_ok(status);
        assert_true(grid_hash(&f) == whole);
        assert_true(used == units);
    }
    test_pool_free(&f.pool);
}

static void begun_anew_after_any_step_it_gives_the_same_map(void **state)
{
    static fixture f;
    test_stepped object = {.begin = begin, .step = step, .result_hash = grid_hash, .context = &f};

    (void)state;
    open_fixture(&f, 1);
    test_begins_anew(&object, 40);
    test_pool_free(&f.pool);
}

static void no_scans_clear_the_grid(void **state)
{
    static fixture f;
    cairn_budget budget = {CAIRN_UNBOUNDED};

    (void)state;
    open_fixture(&f, 1);
    make_map(&f);
    assert_true(probability_at(&f, 1.55, 1.55) >= 0);
    assert_ok(cairn_scan_map_begin(f.map, f.grid, NULL, 0, NULL));
    assert_ok(cairn_scan_map_step(f.map, &budget));
    assert_near(probability_at(&f, 1.55, 1.55), -1, 0);
    test_pool_free(&f.pool);
}

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_scan_map *map;

    return cairn_scan_map_create(&map, pool, context);
}

static void every_smaller_pool_is_refused(void **state)
{
    cairn_scan_map_params params = cairn_scan_map_default();

    (void)state;
    params.max_cells = 1000;
    test_every_pool_size(create, &params, cairn_scan_map_memory(&params));
    params.stop_at_walls = 0;
    params.max_cells = 0; /* not in use */
    test_every_pool_size(create, &params, cairn_scan_map_memory(&params));
}

static void bad_scans_are_refused(void **state)
{
    static fixture f;
    cairn_fault fault;
    cairn_scan_map_scan kept;

    (void)state;
    open_fixture(&f, 1);
    kept = f.room.scans[1];
    assert_fault(&fault, cairn_scan_map_begin(NULL, f.grid, f.room.scans, SCANS, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    assert_fault(&fault, cairn_scan_map_begin(f.map, NULL, f.room.scans, SCANS, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    assert_fault(&fault, cairn_scan_map_begin(f.map, f.grid, NULL, 1, &fault), CAIRN_BAD_ARGUMENT,
                 -1);
    assert_fault(&fault, cairn_scan_map_begin(f.map, f.grid, f.room.scans, -1, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    f.room.scans[1].beam_count = -1;
    assert_fault(&fault, cairn_scan_map_begin(f.map, f.grid, f.room.scans, SCANS, &fault),
                 CAIRN_BAD_ARGUMENT, 1);
    f.room.scans[1] = kept;
    f.room.scans[1].hits = NULL;
    assert_fault(&fault, cairn_scan_map_begin(f.map, f.grid, f.room.scans, SCANS, &fault),
                 CAIRN_BAD_ARGUMENT, 1);
    f.room.scans[1] = kept;
    f.room.scans[1].ends = NULL;
    assert_fault(&fault, cairn_scan_map_begin(f.map, f.grid, f.room.scans, SCANS, &fault),
                 CAIRN_BAD_ARGUMENT, 1);
    f.room.scans[1] = kept;
    f.room.scans[1].map_scan.theta = (cairn_real)NAN;
    assert_fault(&fault, cairn_scan_map_begin(f.map, f.grid, f.room.scans, SCANS, &fault),
                 CAIRN_NOT_FINITE, 1);
    f.room.scans[1] = kept;
    f.room.scans[1].sensor.y = (cairn_real)INFINITY;
    assert_fault(&fault, cairn_scan_map_begin(f.map, f.grid, f.room.scans, SCANS, &fault),
                 CAIRN_NOT_FINITE, 1);
    test_pool_free(&f.pool);
}

static void a_grid_beyond_the_capacity_is_refused(void **state)
{
    static fixture f;
    cairn_scan_map_params params = cairn_scan_map_default();
    cairn_pool pool;
    cairn_fault fault;
    cairn_scan_map *map;

    (void)state;
    open_fixture(&f, 1);
    params.max_cells = CELLS - 1;
    pool = test_pool(cairn_scan_map_memory(&params));
    assert_ok(cairn_scan_map_create(&map, &pool, &params));
    assert_fault(&fault, cairn_scan_map_begin(map, f.grid, f.room.scans, SCANS, &fault), CAIRN_FULL,
                 -1);
    test_pool_free(&pool);
    test_pool_free(&f.pool);
}

static void a_beam_to_infinity_ends_the_map(void **state)
{
    static fixture f;
    cairn_budget budget = {CAIRN_UNBOUNDED};

    (void)state;
    open_fixture(&f, 1);
    f.room.ends[1][9] = INFINITY;
    f.room.hits[1][4] = 1;
    assert_ok(begin(&f));
    assert_status(step(&f, &budget), CAIRN_NOT_FINITE);
    assert_status(step(&f, &budget), CAIRN_NOT_FINITE);
    f.room.ends[1][9] = 1;
    make_map(&f);
    test_pool_free(&f.pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(both_passes_match_the_reference_implementation),
        cmocka_unit_test(lost_beams_free_nothing_behind_a_wall),
        cmocka_unit_test(a_scanner_beside_a_wall_looks_away_from_it),
        cmocka_unit_test(beams_that_say_nothing_are_left_out),
        cmocka_unit_test(beams_are_cut_and_long_ones_without_return_left_out),
        cmocka_unit_test(the_bounds_contain_sensors_and_beams),
        cmocka_unit_test(budgets_of_1_7_1000_and_all_give_the_same_bits),
        cmocka_unit_test(begun_anew_after_any_step_it_gives_the_same_map),
        cmocka_unit_test(no_scans_clear_the_grid),
        cmocka_unit_test(every_smaller_pool_is_refused),
        cmocka_unit_test(bad_scans_are_refused),
        cmocka_unit_test(a_grid_beyond_the_capacity_is_refused),
        cmocka_unit_test(a_beam_to_infinity_ends_the_map),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
