/* Votes of placed maps: compared with a reference implementation, ties, bounds, budgets, refusals. */
#include "cairn/map_vote.h"
#include "tests/test.h"

#include <math.h>

enum { O = CAIRN_OCCUPANCY_GRID_OCCUPIED, F = CAIRN_OCCUPANCY_GRID_FREE };
enum { U = CAIRN_OCCUPANCY_GRID_UNKNOWN, MAPS = 5, WIDTH = 14, HEIGHT = 9, SIDE = 40 };

#define RESOLUTION CAIRN_REAL(0.25)

static const cairn_vec2 ORIGIN = {-4, -5};

/* Maps at random poses, one of which is not placed, a grid over them, and a vote. */
typedef struct fixture {
    uint8_t cells[MAPS][WIDTH * HEIGHT];
    cairn_map_merge_map maps[MAPS];
    cairn_map_merge_placed placed[MAPS];
    uint8_t grid[SIDE * SIDE];
    cairn_raster_u8 out;
    cairn_map_vote_params params;
    cairn_pool pool;
    cairn_map_vote *vote;
} fixture;

static void open_fixture(fixture *f)
{
    static const uint8_t classes[] = {O, F, F, U};
    cairn_random random = cairn_random_seed(41, 1);

    memset(f, 0, sizeof *f);
    for (int32_t m = 0; m < MAPS; m++) {
        for (int32_t i = 0; i < WIDTH * HEIGHT; i++)
            f->cells[m][i] = classes[cairn_random_below(&random, 4)];
        f->maps[m].cells = (cairn_raster_u8_view){f->cells[m], WIDTH, HEIGHT, WIDTH};
        f->maps[m].resolution = m % 2 ? CAIRN_REAL(0.5) : CAIRN_REAL(0.25);
        f->maps[m].origin.x = -WIDTH * f->maps[m].resolution / 2;
        f->maps[m].origin.y = -HEIGHT * f->maps[m].resolution / 2;
        f->maps[m].origin.theta = cairn_random_uniform(&random, CAIRN_REAL(-0.5), CAIRN_REAL(0.5));
        f->placed[m].reference_map.y = cairn_random_uniform(&random, -1, 1);
        f->placed[m].reference_map.theta = cairn_random_uniform(&random, -3, 3);
        f->placed[m].verdict = m == 3 ? CAIRN_MAP_MERGE_LOW_SUPPORT : CAIRN_MAP_MERGE_PLACED;
    }
    f->out = (cairn_raster_u8){f->grid, SIDE, SIDE, SIDE};
    f->params = cairn_map_vote_default();
    f->params.max_maps = MAPS - 1;
    f->pool = test_pool(cairn_map_vote_memory(&f->params));
    assert_ok(cairn_map_vote_create(&f->vote, &f->pool, &f->params));
}

static cairn_status begin(fixture *f, cairn_fault *fault)
{
    return cairn_map_vote_begin(f->vote, f->maps, f->placed, MAPS, ORIGIN, RESOLUTION, f->out,
                                fault);
}

static void run(fixture *f)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(begin(f, NULL));
    assert_ok(cairn_map_vote_step(f->vote, &budget));
}

/* The class that a map gives a point, by its pose in the reference. */
static uint8_t slow_class(const cairn_map_merge_map *map, const cairn_map_merge_placed *placed,
                          double x, double y)
{
    cairn_pose pose = cairn_pose_compose(placed->reference_map, map->origin);
    double dx = x - (double)pose.x, dy = y - (double)pose.y, c = cos((double)pose.theta),
           s = sin((double)pose.theta), side = (double)map->resolution;
    int32_t column = (int32_t)floor((c * dx + s * dy) / side),
            row = (int32_t)floor((c * dy - s * dx) / side);

    if (column < 0 || row < 0 || column >= WIDTH || row >= HEIGHT)
        return U;
    return map->cells.data[row * WIDTH + column];
}

static void cells_match_the_reference_implementation(void **state)
{
    static fixture f;
    int32_t differ = 0, known = 0;

    (void)state;
    open_fixture(&f);
    run(&f);
    for (int32_t i = 0; i < SIDE * SIDE; i++) {
        int32_t column = i % SIDE, row = i / SIDE, sum = 0, votes = 0;
        double x = -4 + 0.25 * (column + 0.5), y = -5 + 0.25 * (row + 0.5);

        for (int32_t m = 0; m < MAPS; m++) {
            uint8_t cell = m == 3 ? U : slow_class(&f.maps[m], &f.placed[m], x, y);

            sum += (cell == O) - (cell == F);
            votes += cell != U;
        }
        differ += f.grid[i] != (votes == 0 ? U : sum >= 0 ? O : F);
        known += votes > 1;
    }
    assert_true(known > 100);
    assert_in_range(differ, 0, NUMBER(0, 2)); /* centres on the border of a cell */
    test_pool_free(&f.pool);
}

static void most_votes_decide_and_ties_are_occupied(void **state)
{
    static const uint8_t cells[3][4] = {{O, O, F, U}, {F, O, F, U}, {F, F, U, U}};
    static const uint8_t two[4] = {O, O, F, U}, three[4] = {F, O, F, U};
    static fixture f;
    uint8_t grid[4];

    (void)state;
    open_fixture(&f);
    for (int32_t count = 2; count <= 3; count++) {
        const cairn_map_merge_placed here = {.verdict = CAIRN_MAP_MERGE_PLACED};
        cairn_budget budget = {CAIRN_UNBOUNDED};

        for (int32_t m = 0; m < 3; m++) {
            f.maps[m] = (cairn_map_merge_map){{cells[m], 4, 1, 4}, 1, {0, 0, 0}};
            f.placed[m] = here;
        }
        assert_ok(cairn_map_vote_begin(f.vote, f.maps, f.placed, count, (cairn_vec2){0, 0}, 1,
                                       (cairn_raster_u8){grid, 4, 1, 4}, NULL));
        assert_ok(cairn_map_vote_step(f.vote, &budget));
        assert_memory_equal(grid, count == 2 ? two : three, 4);
    }
    test_pool_free(&f.pool);
}

static void the_bounds_contain_the_placed_maps_alone(void **state)
{
    static fixture f;
    cairn_box box;

    (void)state;
    open_fixture(&f);
    box = cairn_map_vote_bounds(f.maps, f.placed, 0);
    assert_true(box.min.x > box.max.x);
    f.maps[0].origin = (cairn_pose){1, 2, 0};
    f.placed[0].reference_map = (cairn_pose){0, 0, CAIRN_PI / 2};
    f.placed[1].verdict = CAIRN_MAP_MERGE_LOW_SUPPORT;
    box = cairn_map_vote_bounds(f.maps, f.placed, 2);
    assert_near(box.min.x, -2 - HEIGHT * 0.25, NUMBER(1e-12, 1e-5));
    assert_near(box.min.y, 1, NUMBER(1e-12, 1e-5));
    assert_near(box.max.x, -2, NUMBER(1e-12, 1e-5));
    assert_near(box.max.y, 1 + WIDTH * 0.25, NUMBER(1e-12, 1e-5));
    test_pool_free(&f.pool);
}

static void budgets_of_1_7_1000_and_all_give_the_same_bits(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    static fixture f;
    static uint8_t whole[SIDE * SIDE];
    cairn_budget budget = {0};

    (void)state;
    open_fixture(&f);
    assert_ok(cairn_map_vote_step(f.vote, &budget)); /* nothing was begun */
    run(&f);
    memcpy(whole, f.grid, sizeof whole);
    for (size_t i = 0; i < sizeof budgets / sizeof *budgets; i++) {
        int64_t used = 0;
        cairn_status status;

        memset(f.grid, 1, sizeof f.grid);
        assert_ok(begin(&f, NULL));
        do {
            budget.left = budgets[i];
            status = cairn_map_vote_step(f.vote, &budget);
            assert_in_range(budget.left, 0, budgets[i]);
            used += budgets[i] - budget.left;
        } while (status == CAIRN_MORE);
        assert_ok(status);
        assert_memory_equal(f.grid, whole, sizeof whole);
        assert_true(used == (int64_t)SIDE * SIDE * (MAPS - 1));
    }
    test_pool_free(&f.pool);
}

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_map_vote *vote;

    return cairn_map_vote_create(&vote, pool, context);
}

static void every_smaller_pool_is_refused(void **state)
{
    cairn_map_vote_params params = cairn_map_vote_default();

    (void)state;
    test_every_pool_size(create, &params, cairn_map_vote_memory(&params));
}

static void bad_maps_and_grids_are_refused(void **state)
{
    static fixture f, kept;
    cairn_fault fault;

    (void)state;
    open_fixture(&f);
    kept = f;
    assert_fault(&fault,
                 cairn_map_vote_begin(NULL, f.maps, f.placed, MAPS, ORIGIN, 1, f.out, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    assert_fault(&fault, cairn_map_vote_begin(f.vote, NULL, f.placed, 1, ORIGIN, 1, f.out, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    assert_fault(&fault, cairn_map_vote_begin(f.vote, f.maps, NULL, 1, ORIGIN, 1, f.out, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    assert_fault(&fault,
                 cairn_map_vote_begin(f.vote, f.maps, f.placed, -1, ORIGIN, 1, f.out, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    assert_fault(&fault,
                 cairn_map_vote_begin(f.vote, f.maps, f.placed, MAPS, ORIGIN, 0, f.out, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    assert_fault(&fault,
                 cairn_map_vote_begin(f.vote, f.maps, f.placed, MAPS, ORIGIN, (cairn_real)INFINITY,
                                      f.out, &fault),
                 CAIRN_NOT_FINITE, -1);
    f.out.data = NULL;
    assert_fault(&fault, begin(&f, &fault), CAIRN_BAD_ARGUMENT, -1);
    f.out = kept.out;
    f.maps[1].cells.width = 0;
    assert_fault(&fault, begin(&f, &fault), CAIRN_BAD_ARGUMENT, 1);
    f.maps[1] = kept.maps[1];
    f.maps[2].resolution = 0;
    assert_fault(&fault, begin(&f, &fault), CAIRN_BAD_ARGUMENT, 2);
    f.maps[2] = kept.maps[2];
    f.placed[4].reference_map.x = (cairn_real)NAN;
    assert_fault(&fault, begin(&f, &fault), CAIRN_NOT_FINITE, 4);
    f.placed[4] = kept.placed[4];
    f.placed[3].verdict = CAIRN_MAP_MERGE_PLACED;
    assert_fault(&fault, begin(&f, &fault), CAIRN_FULL, 4);
    test_pool_free(&f.pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cells_match_the_reference_implementation),
        cmocka_unit_test(most_votes_decide_and_ties_are_occupied),
        cmocka_unit_test(the_bounds_contain_the_placed_maps_alone),
        cmocka_unit_test(budgets_of_1_7_1000_and_all_give_the_same_bits),
        cmocka_unit_test(every_smaller_pool_is_refused),
        cmocka_unit_test(bad_maps_and_grids_are_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
