/* Occupancy grid: beams compared with clipping by every cell, probabilities by hand, budgets,
 * degenerate beams. */
#include "tests/test.h"

#include <math.h>

#include "cairn/occupancy_grid.h"

enum { WIDTH = 13, HEIGHT = 9 };

static const cairn_occupancy_grid_params SMALL = {.width = WIDTH,
                                                  .height = HEIGHT,
                                                  .resolution = CAIRN_REAL(0.25),
                                                  .origin = {-1, CAIRN_REAL(0.5)}};

static cairn_occupancy_grid *make_grid(cairn_pool *pool, cairn_occupancy_grid_params params)
{
    cairn_occupancy_grid *grid;

    *pool = test_pool(cairn_occupancy_grid_memory(&params));
    assert_ok(cairn_occupancy_grid_create(&grid, pool, &params));
    return grid;
}

/* The interval of a -> b between low and high along one axis. */
static int slow_clip(double a, double b, double low, double high, double *start, double *end)
{
    double t0, t1;

    if (a == b)
        return a >= low && a < high;
    t0 = (low - a) / (b - a);
    t1 = (high - a) / (b - a);
    *start = fmax(*start, fmin(t0, t1));
    *end = fmin(*end, fmax(t0, t1));
    return *start < *end;
}

/* Length of the beam in one box, by clipping. */
static double slow_chord(cairn_vec2 from, cairn_vec2 to, double x, double y, double width,
                         double height)
{
    double start = 0, end = 1;

    if (!slow_clip((double)from.x, (double)to.x, x, x + width, &start, &end) ||
        !slow_clip((double)from.y, (double)to.y, y, y + height, &start, &end))
        return 0;
    return (end - start) * hypot((double)(to.x - from.x), (double)(to.y - from.y));
}

/* Beam by beam: chords of a walk compared with clipping by each cell, their sum compared with
 * clipping by the whole grid. Cells follow each other without a gap, and a `generic` beam enters
 * none by a corner alone. Then the contents of the cells after add_beam. */
static void check_beam(cairn_occupancy_grid *grid, cairn_vec2 from, cairn_vec2 to, int generic)
{
    cairn_occupancy_grid_params params = cairn_occupancy_grid_read(grid);
    double res = (double)params.resolution, left = (double)params.origin.x,
           bottom = (double)params.origin.y;
    double tolerance = NUMBER(1e-12, 2e-5), sum = 0, whole;
    double walked[HEIGHT][WIDTH] = {{0}};
    cairn_occupancy_grid_ray walk;
    cairn_occupancy_grid_chord chord;
    int32_t last_x = -1, last_y = -1, cells = 0, end_x, end_y;
    int32_t inside = cairn_occupancy_grid_locate(grid, to, &end_x, &end_y);
    cairn_status status = cairn_occupancy_grid_walk(grid, from, to, &walk);
    cairn_budget budget = {1000};

    whole = slow_chord(from, to, left, bottom, res * params.width, res * params.height);
    assert_true(status == CAIRN_OK || (status == CAIRN_EMPTY && whole < tolerance && !inside));
    if (status == CAIRN_OK) {
        assert_int_equal(walk.ends_inside, inside);
        while (!walk.done) {
            assert_int_equal(cairn_occupancy_grid_ray_next(&walk, &chord), 1);
            assert_in_range(chord.x, 0, WIDTH - 1);
            assert_in_range(chord.y, 0, HEIGHT - 1);
            assert_true(generic ? chord.length > 0 : chord.length >= 0);
            assert_true(cells == 0 || abs(chord.x - last_x) + abs(chord.y - last_y) == 1);
            last_x = chord.x;
            last_y = chord.y;
            cells++;
            walked[chord.y][chord.x] += (double)chord.length;
            sum += (double)chord.length;
        }
        assert_true(!inside || (last_x == end_x && last_y == end_y));
        assert_int_equal(walk.done, 1);
        assert_int_equal(cairn_occupancy_grid_ray_next(&walk, &chord), 0);
        assert_true(cells <= WIDTH + HEIGHT - 1);
    }
    assert_near(sum, whole, tolerance);

    for (int32_t hit = 0; hit < 2; hit++) {
        cairn_occupancy_grid_clear(grid);
        assert_ok(cairn_occupancy_grid_step(grid, &budget));
        assert_ok(cairn_occupancy_grid_add_beam(grid, from, to, hit * 5));
        for (int32_t y = 0; y < HEIGHT; y++)
            for (int32_t x = 0; x < WIDTH; x++) {
                cairn_occupancy_grid_cell_state cell = cairn_occupancy_grid_cell(grid, x, y);

                assert_near(walked[y][x],
                            slow_chord(from, to, left + res * x, bottom + res * y, res, res),
                            tolerance);
                assert_near(cell.length, walked[y][x], 1e-6);
                assert_int_equal(cell.hits, hit && inside && x == end_x && y == end_y);
            }
    }
}

static void test_beams_match_clipping(void **state)
{
    cairn_random random = cairn_random_seed(21, 0);
    cairn_pool pool;
    cairn_occupancy_grid *grid = make_grid(&pool, SMALL);

    (void)state;
    for (int i = 0; i < 1500; i++) {
        cairn_real reach = i % 3 == 0 ? 2 : i % 3 == 1 ? 5 : 40;
        cairn_vec2 from, to;

        from.x = cairn_random_uniform(&random, -reach, reach);
        from.y = cairn_random_uniform(&random, -reach, reach) + 1;
        to.x = cairn_random_uniform(&random, -reach, reach);
        to.y = cairn_random_uniform(&random, -reach, reach) + 1;
        if (reach > 9) {
            from.x /= 20;
            from.y /= 20;
        }
        check_beam(grid, from, to, 1);
    }
    test_pool_free(&pool);
}

/* Ends on borders and corners, beams along borders, without length, and along the axes: steps of
 * half a cell. */
static void test_beams_on_borders(void **state)
{
    cairn_random random = cairn_random_seed(22, 0);
    cairn_pool pool;
    cairn_occupancy_grid *grid = make_grid(&pool, SMALL);

    (void)state;
    for (int i = 0; i < 3000; i++) {
        cairn_vec2 from, to;

        from.x = CAIRN_REAL(-1.5) + CAIRN_REAL(0.125) * (cairn_real)cairn_random_below(&random, 36);
        from.y = CAIRN_REAL(0.125) * (cairn_real)cairn_random_below(&random, 27);
        to.x = CAIRN_REAL(-1.5) + CAIRN_REAL(0.125) * (cairn_real)cairn_random_below(&random, 36);
        to.y = CAIRN_REAL(0.125) * (cairn_real)cairn_random_below(&random, 27);
        if (i % 4 == 1)
            to.x = from.x;
        if (i % 4 == 2)
            to.y = from.y;
        if (i % 40 == 3)
            to = from;
        check_beam(grid, from, to, 0);
    }
    test_pool_free(&pool);
}

/* Known cells, by hand: a beam along a row of cells and one across a corner. */
static void test_known_beams(void **state)
{
    cairn_occupancy_grid_params params = {
        .width = 4, .height = 3, .resolution = 1, .origin = {0, 0}};
    cairn_vec2 from = {CAIRN_REAL(0.5), CAIRN_REAL(1.5)}, to = {CAIRN_REAL(2.25), CAIRN_REAL(1.5)};
    cairn_vec2 corner = {0, 0}, far = {2, 2};
    cairn_pool pool;
    cairn_occupancy_grid *grid = make_grid(&pool, params);

    (void)state;
    assert_ok(cairn_occupancy_grid_add_beam(grid, from, to, 1));
    assert_near(cairn_occupancy_grid_cell(grid, 0, 1).length, 0.5, 0);
    assert_near(cairn_occupancy_grid_cell(grid, 1, 1).length, 1, 1e-6);
    assert_near(cairn_occupancy_grid_cell(grid, 2, 1).length, 0.25, 1e-6);
    assert_near(cairn_occupancy_grid_cell(grid, 3, 1).length, 0, 0);
    assert_int_equal(cairn_occupancy_grid_cell(grid, 2, 1).hits, 1);
    assert_int_equal(cairn_occupancy_grid_cell(grid, 1, 1).hits, 0);
    assert_near(cairn_occupancy_grid_cell(grid, 4, 0).length, 0, 0);
    assert_near(cairn_occupancy_grid_cell(grid, -4, 2).length, 0, 0);
    assert_near(cairn_occupancy_grid_probability(grid, 2, 1), 1 - exp(-4), 1e-6);
    assert_near(cairn_occupancy_grid_probability(grid, 1, 1), 0, 0);
    assert_near(cairn_occupancy_grid_probability(grid, 3, 1), -1, 0);
    assert_ok(cairn_occupancy_grid_add_beam(grid, from, to, 0));
    assert_near(cairn_occupancy_grid_probability(grid, 2, 1), 1 - exp(-2), 1e-6);
    /* Cells are closed below and to the left: the corner belongs to cell (2, 2). */
    assert_ok(cairn_occupancy_grid_add_beam(grid, corner, far, 1));
    assert_int_equal(cairn_occupancy_grid_cell(grid, 2, 2).hits, 1);
    assert_near(cairn_occupancy_grid_cell(grid, 0, 0).length, sqrt(2), 1e-6);
    assert_near(cairn_occupancy_grid_cell(grid, 1, 1).length, 2 + sqrt(2), 1e-6);
    /* A hit of zero length: every beam that enters stops. */
    assert_ok(cairn_occupancy_grid_add_beam(grid, corner, corner, 1));
    assert_int_equal(cairn_occupancy_grid_cell(grid, 0, 0).hits, 1);
    from.x = to.x = CAIRN_REAL(3.5);
    from.y = to.y = CAIRN_REAL(2.5);
    assert_ok(cairn_occupancy_grid_add_beam(grid, from, to, 1));
    assert_near(cairn_occupancy_grid_probability(grid, 3, 2), 1, 0);
    test_pool_free(&pool);
}

/* Bound of the length: a beam many times as long as the grid, and coordinates that are NaN or
 * overflow. */
static void test_beams_far_and_not_finite(void **state)
{
    const cairn_real bad[] = {(cairn_real)NAN, (cairn_real)INFINITY, -(cairn_real)INFINITY,
                              CAIRN_REAL_MAX};
    cairn_vec2 good = {0, 1}, far = {NUMBER(1e9, 1e3f), 1}, other_far = {-NUMBER(1e9, 1e3f), 1};
    cairn_pool pool;
    cairn_occupancy_grid *grid = make_grid(&pool, SMALL);
    cairn_occupancy_grid_ray walk;

    (void)state;
    for (int k = 0; k < 4; k++)
        for (int place = 0; place < 4; place++) {
            cairn_vec2 from = good, to = good;

            *(place == 0 ? &from.x : place == 1 ? &from.y : place == 2 ? &to.x : &to.y) = bad[k];
            assert_status(cairn_occupancy_grid_add_beam(grid, from, to, 1), CAIRN_NOT_FINITE);
            assert_status(cairn_occupancy_grid_walk(grid, from, to, &walk), CAIRN_NOT_FINITE);
        }
    /* The length is 0, but the cells overflow. */
    for (int k = 0; k < 2; k++) {
        cairn_vec2 p = good;

        *(k ? &p.y : &p.x) = CAIRN_REAL_MAX / 2;
        assert_status(cairn_occupancy_grid_add_beam(grid, p, p, 1), CAIRN_NOT_FINITE);
    }
    for (int32_t i = 0; i < WIDTH * HEIGHT; i++)
        assert_near(cairn_occupancy_grid_probability(grid, i % WIDTH, i / WIDTH), -1, 0);
    assert_ok(cairn_occupancy_grid_add_beam(grid, far, other_far, 1));
    for (int32_t x = 0; x < WIDTH; x++) {
        assert_near(cairn_occupancy_grid_cell(grid, x, 2).length, 0.25, NUMBER(1e-6, 5e-4));
        assert_int_equal(cairn_occupancy_grid_cell(grid, x, 2).hits, 0);
    }
    assert_ok(cairn_occupancy_grid_add_beam(grid, far, far, 1));
    assert_status(cairn_occupancy_grid_walk(grid, far, far, &walk), CAIRN_EMPTY);
    test_pool_free(&pool);
}

enum { BEAMS = 60 };

static void random_scan(cairn_random *random, cairn_scan_beam *beams)
{
    for (int32_t i = 0; i < BEAMS; i++) {
        cairn_real angle = cairn_random_uniform(random, -CAIRN_PI, CAIRN_PI);
        cairn_real range = cairn_random_uniform(random, 0, 4);

        beams[i].from.x = CAIRN_REAL(0.1);
        beams[i].from.y = CAIRN_REAL(0.2);
        beams[i].to.x = range * cairn_cos(angle);
        beams[i].to.y = range * cairn_sin(angle);
        beams[i].kind = i % 4 == 0   ? CAIRN_SCAN_BEAM_UNKNOWN
                        : i % 4 == 1 ? CAIRN_SCAN_BEAM_FREE
                                     : CAIRN_SCAN_BEAM_HIT;
        if (i % 8 == 0)
            beams[i].to.x = (cairn_real)NAN;
    }
    beams[0] = beams[1];
}

/* A unit for the start of a beam, one for two of its cells. */
static int32_t units_of(const cairn_occupancy_grid *grid, const cairn_scan_beam *beam,
                        cairn_transform transform)
{
    cairn_occupancy_grid_ray walk;
    cairn_occupancy_grid_chord chord;
    int32_t cells = 0;

    if (beam->kind != CAIRN_SCAN_BEAM_UNKNOWN &&
        cairn_occupancy_grid_walk(grid, cairn_transform_point(transform, beam->from),
                                  cairn_transform_point(transform, beam->to), &walk) == CAIRN_OK)
        while (cairn_occupancy_grid_ray_next(&walk, &chord))
            cells++;
    return 1 + (cells + 1) / 2;
}

/* A scan equals its beams one by one, whatever the budgets; a clearing comes before it. */
static void test_scan_matches_beams(void **state)
{
    static const int32_t budgets[] = {CAIRN_UNBOUNDED, 1, 7, 1000};
    cairn_random random = cairn_random_seed(23, 0);
    cairn_pose map_scan = {CAIRN_REAL(0.4), CAIRN_REAL(1.3), CAIRN_REAL(0.7)};
    cairn_transform transform = cairn_transform_of(map_scan);
    cairn_scan_beam beams[BEAMS];
    cairn_pool pool, other;
    cairn_occupancy_grid *grid = make_grid(&pool, SMALL), *one_by_one = make_grid(&other, SMALL);
    int32_t units[4], expected = (WIDTH * HEIGHT + 63) / 64;

    (void)state;
    random_scan(&random, beams);
    for (int32_t i = 0; i < BEAMS; i++)
        expected += units_of(one_by_one, &beams[i], transform);
    for (int32_t i = 0; i < BEAMS; i++)
        if (beams[i].kind != CAIRN_SCAN_BEAM_UNKNOWN)
            assert_ok(cairn_occupancy_grid_add_beam(one_by_one,
                                                    cairn_transform_point(transform, beams[i].from),
                                                    cairn_transform_point(transform, beams[i].to),
                                                    beams[i].kind == CAIRN_SCAN_BEAM_HIT));
    for (int k = 0; k < 4; k++) {
        cairn_budget budget = {3};
        cairn_fault fault = {7, NULL};
        cairn_status status;

        /* A scan added in part is dropped by clear(). */
        assert_ok(cairn_occupancy_grid_begin_scan(grid, beams, BEAMS, cairn_pose_identity(), NULL));
        assert_status(cairn_occupancy_grid_step(grid, &budget), CAIRN_MORE);
        assert_int_equal(budget.left, 0);
        assert_status(cairn_occupancy_grid_step(grid, &budget), CAIRN_MORE);
        assert_fault(&fault, cairn_occupancy_grid_begin_scan(grid, beams, BEAMS, map_scan, &fault),
                     CAIRN_BAD_ARGUMENT, -1);
        assert_status(cairn_occupancy_grid_add_beam(grid, beams[1].from, beams[1].to, 1),
                      CAIRN_BAD_ARGUMENT);
        cairn_occupancy_grid_clear(grid);
        assert_status(cairn_occupancy_grid_add_beam(grid, beams[1].from, beams[1].to, 1),
                      CAIRN_BAD_ARGUMENT);
        assert_ok(cairn_occupancy_grid_begin_scan(grid, beams, BEAMS, map_scan, NULL));
        units[k] = 0;
        do {
            budget.left = budgets[k];
            status = cairn_occupancy_grid_step(grid, &budget);
            assert_true(budget.left >= 0 &&
                        (status == CAIRN_OK || (status == CAIRN_MORE && budget.left == 0)));
            units[k] += budgets[k] - budget.left;
        } while (status == CAIRN_MORE);
        for (int32_t y = 0; y < HEIGHT; y++)
            for (int32_t x = 0; x < WIDTH; x++) {
                cairn_occupancy_grid_cell_state a = cairn_occupancy_grid_cell(grid, x, y);
                cairn_occupancy_grid_cell_state b = cairn_occupancy_grid_cell(one_by_one, x, y);

                assert_int_equal(a.hits, b.hits);
                assert_true(a.length == b.length);
            }
        assert_int_equal(units[k], expected);
    }
    test_pool_free(&pool);
    test_pool_free(&other);
}

/* Clearing takes exactly a unit for 64 cells and leaves nothing. */
static void test_clear(void **state)
{
    cairn_occupancy_grid_params params = {
        .width = 43, .height = 3, .resolution = 1, .origin = {0, 0}};
    cairn_vec2 from = {0, 0}, to = {CAIRN_REAL(42.9), CAIRN_REAL(2.9)};
    cairn_pool pool;
    cairn_occupancy_grid *grid = make_grid(&pool, params);
    cairn_budget budget = {1};

    (void)state;
    assert_ok(cairn_occupancy_grid_add_beam(grid, from, to, 1));
    cairn_occupancy_grid_clear(grid);
    assert_status(cairn_occupancy_grid_step(grid, &budget), CAIRN_MORE);
    assert_near(cairn_occupancy_grid_probability(grid, 0, 0), -1, 0);
    assert_true(cairn_occupancy_grid_cell(grid, 20, 1).length == 0);
    assert_true(cairn_occupancy_grid_cell(grid, 21, 1).length > 0);
    assert_true(cairn_occupancy_grid_cell(grid, 42, 2).hits == 1);
    budget.left = 100;
    assert_ok(cairn_occupancy_grid_step(grid, &budget));
    assert_int_equal(budget.left, 98);
    for (int32_t i = 0; i < 129; i++) {
        assert_int_equal(cairn_occupancy_grid_cell(grid, i % 43, i / 43).hits, 0);
        assert_true(cairn_occupancy_grid_cell(grid, i % 43, i / 43).length == 0);
    }
    test_pool_free(&pool);
}

static void test_scan_refusals(void **state)
{
    cairn_scan_beam beams[3] = {{{0, 0}, {1, 1}, CAIRN_SCAN_BEAM_HIT},
                                {{0, 0}, {1, 1}, CAIRN_SCAN_BEAM_FREE},
                                {{0, 0}, {1, 1}, 0}};
    cairn_pose identity = {0, 0, 0}, bad = {0, 0, (cairn_real)NAN};
    cairn_fault fault = {7, NULL};
    cairn_budget budget = {10};
    cairn_pool pool;
    cairn_occupancy_grid *grid = make_grid(&pool, SMALL);

    (void)state;
    assert_ok(cairn_occupancy_grid_begin_scan(grid, NULL, 0, identity, &fault));
    assert_true(fault.message == NULL && fault.index == 7);
    assert_ok(cairn_occupancy_grid_step(grid, &budget));
    assert_int_equal(budget.left, 10);
    assert_fault(&fault, cairn_occupancy_grid_begin_scan(NULL, beams, 3, identity, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    assert_true(fault.index == -1 && fault.message != NULL);
    assert_status(cairn_occupancy_grid_begin_scan(grid, NULL, 1, identity, NULL),
                  CAIRN_BAD_ARGUMENT);
    assert_status(cairn_occupancy_grid_begin_scan(grid, beams, -1, identity, NULL),
                  CAIRN_BAD_ARGUMENT);
    assert_fault(&fault, cairn_occupancy_grid_begin_scan(grid, beams, 3, bad, &fault),
                 CAIRN_NOT_FINITE, -1);
    beams[1].kind = 3;
    assert_fault(&fault, cairn_occupancy_grid_begin_scan(grid, beams, 3, identity, &fault),
                 CAIRN_BAD_ARGUMENT, 1);
    beams[1].kind = -1;
    assert_fault(&fault, cairn_occupancy_grid_begin_scan(grid, beams, 3, identity, &fault),
                 CAIRN_BAD_ARGUMENT, 1);
    beams[1].kind = CAIRN_SCAN_BEAM_FREE;
    beams[0].from.y = (cairn_real)NAN;
    assert_fault(&fault, cairn_occupancy_grid_begin_scan(grid, beams, 3, identity, &fault),
                 CAIRN_NOT_FINITE, 0);
    beams[0].kind = CAIRN_SCAN_BEAM_UNKNOWN;
    beams[1].to.x = (cairn_real)INFINITY;
    assert_fault(&fault, cairn_occupancy_grid_begin_scan(grid, beams, 3, identity, &fault),
                 CAIRN_NOT_FINITE, 1);
    assert_ok(cairn_occupancy_grid_step(grid, &budget));
    assert_int_equal(budget.left, 10);
    assert_status(cairn_occupancy_grid_add_beam(NULL, beams[2].from, beams[2].to, 1),
                  CAIRN_BAD_ARGUMENT);
    test_pool_free(&pool);
}

/* Cells with 0 ... 3 hits on a metre of beam each, compared with the probabilities one by one. */
static void test_classify(void **state)
{
    cairn_occupancy_grid_params params = {
        .width = 4, .height = 3, .resolution = CAIRN_REAL(0.5), .origin = {0, 0}};
    cairn_occupancy_grid_thresholds thresholds = cairn_occupancy_grid_thresholds_default();
    uint8_t picture[3][6];
    cairn_raster_u8 out = {picture[2], 4, 3, -6};
    cairn_pool pool;
    cairn_occupancy_grid *grid = make_grid(&pool, params);
    int32_t seen[3] = {0, 0, 0};

    (void)state;
    assert_near(thresholds.occupied, 0.25, 0);
    assert_near(thresholds.free, 0.1, 1e-7);
    for (int32_t y = 0; y < 2; y++)
        for (int32_t x = 0; x < 4; x++) {
            cairn_vec2 from, to;

            from.x = CAIRN_REAL(0.5) * (cairn_real)x;
            from.y = to.y = CAIRN_REAL(0.5) * (cairn_real)y + CAIRN_REAL(0.25);
            to.x = from.x + CAIRN_REAL(0.0625) * (cairn_real)(x + 4);
            for (int32_t i = 0; i < 8; i++)
                assert_ok(cairn_occupancy_grid_add_beam(grid, from, to, i < x + 2 * y));
        }
    memset(picture, 1, sizeof picture);
    assert_ok(cairn_occupancy_grid_classify(grid, thresholds, 0, out));
    for (int32_t y = 0; y < 3; y++)
        for (int32_t x = 0; x < 4; x++) {
            cairn_real p = cairn_occupancy_grid_probability(grid, x, y);
            int expected = p < 0                      ? CAIRN_OCCUPANCY_GRID_UNKNOWN
                           : p >= thresholds.occupied ? CAIRN_OCCUPANCY_GRID_OCCUPIED
                           : p <= thresholds.free     ? CAIRN_OCCUPANCY_GRID_FREE
                                                      : CAIRN_OCCUPANCY_GRID_UNKNOWN;

            assert_int_equal(picture[2 - y][x], expected);
            seen[expected == 0 ? 0 : expected == 205 ? 1 : 2]++;
            assert_true(p < 0 || fabs((double)p - (1 - exp(-1.0 * (x + 2 * y) / (x + 4)))) < 1e-6);
        }
    assert_true(seen[0] > 1 && seen[1] > 4 && seen[2] >= 1);
    assert_int_equal(picture[0][4], 1);

    /* A range of rows: row 1 alone. With equal thresholds no seen cell is unknown. */
    thresholds.occupied = thresholds.free = CAIRN_REAL(0.45);
    out.data = picture[0];
    out.height = 1;
    assert_ok(cairn_occupancy_grid_classify(grid, thresholds, 1, out));
    for (int32_t x = 0; x < 4; x++)
        assert_int_equal(picture[0][x],
                         x < 1 ? CAIRN_OCCUPANCY_GRID_FREE : CAIRN_OCCUPANCY_GRID_OCCUPIED);
    assert_ok(cairn_occupancy_grid_classify(grid, thresholds, 2, out));
    assert_int_equal(picture[0][0], CAIRN_OCCUPANCY_GRID_UNKNOWN);
    assert_status(cairn_occupancy_grid_classify(grid, thresholds, 3, out), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_occupancy_grid_classify(grid, thresholds, -1, out), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_occupancy_grid_classify(NULL, thresholds, 0, out), CAIRN_BAD_ARGUMENT);
    out.width = 3;
    assert_status(cairn_occupancy_grid_classify(grid, thresholds, 0, out), CAIRN_BAD_ARGUMENT);
    out.width = 4;
    out.data = NULL;
    assert_status(cairn_occupancy_grid_classify(grid, thresholds, 0, out), CAIRN_BAD_ARGUMENT);
    out.data = picture[0];
    for (int k = 0; k < 5; k++) {
        static const cairn_real occupied[] = {1, CAIRN_REAL(0.2), (cairn_real)NAN, CAIRN_REAL(0.5),
                                              CAIRN_REAL(0.5)};
        static const cairn_real free_up_to[] = {CAIRN_REAL(0.1), CAIRN_REAL(0.3), CAIRN_REAL(0.1),
                                                0, (cairn_real)NAN};

        thresholds.occupied = occupied[k];
        thresholds.free = free_up_to[k];
        assert_status(cairn_occupancy_grid_classify(grid, thresholds, 0, out), CAIRN_BAD_ARGUMENT);
    }
    test_pool_free(&pool);
}

static void test_locate(void **state)
{
    static const double places[][4] = {{-1, 0.5, 0, 0},
                                       {-0.76, 0.74, 0, 0},
                                       {-0.75, 0.75, 1, 1},
                                       {2.24, 2.74, 12, 8},
                                       {2.25, 1, -1, -1},
                                       {-1.01, 1, -1, -1},
                                       {0, 0.49, -1, -1},
                                       {0, 2.75, -1, -1},
                                       {(double)NAN, 1, -1, -1},
                                       {0, (double)INFINITY, -1, -1},
                                       {-(double)INFINITY, 1, -1, -1},
                                       {0.1, 1.1, 4, 2}};
    cairn_pool pool;
    cairn_occupancy_grid *grid = make_grid(&pool, SMALL);
    cairn_occupancy_grid_params params = cairn_occupancy_grid_read(grid);

    (void)state;
    assert_true(params.width == WIDTH && params.height == HEIGHT && params.origin.x == -1);
    for (size_t i = 0; i < sizeof places / sizeof places[0]; i++) {
        cairn_vec2 p = {(cairn_real)places[i][0], (cairn_real)places[i][1]};
        int32_t x = -1, y = -1;

        assert_int_equal(cairn_occupancy_grid_locate(grid, p, &x, &y), places[i][2] >= 0);
        assert_true(x == (int32_t)places[i][2] && y == (int32_t)places[i][3]);
    }
    assert_near(cairn_occupancy_grid_probability(grid, -1, 0), -1, 0);
    assert_near(cairn_occupancy_grid_probability(grid, WIDTH, 0), -1, 0);
    assert_near(cairn_occupancy_grid_probability(grid, 0, -1), -1, 0);
    assert_near(cairn_occupancy_grid_probability(grid, 0, HEIGHT), -1, 0);
    test_pool_free(&pool);
}

static cairn_status create_grid(void *context, cairn_pool *pool)
{
    cairn_occupancy_grid *grid = NULL;
    cairn_status status = cairn_occupancy_grid_create(&grid, pool, context);

    assert_true((status == CAIRN_OK) == (grid != NULL));
    return status;
}

static void test_grid_refusals(void **state)
{
    cairn_occupancy_grid_params params = cairn_occupancy_grid_default(), bad;
    cairn_pool pool = test_pool(1000);
    cairn_occupancy_grid *grid;

    (void)state;
    assert_true(params.width == 400 && params.height == 400);
    assert_near(params.resolution, 0.05, 1e-8);
    assert_near(params.origin.x + 10, 0, 0);
    assert_near(params.origin.y + 10, 0, 0);
    assert_true(cairn_occupancy_grid_memory(&params) <= CAIRN_OCCUPANCY_GRID_BYTES(400, 400));
    assert_true(cairn_occupancy_grid_memory(&params) > 400 * 400 * 8);
    /* The reciprocal overflows, or just does not. */
    bad = params;
    bad.resolution = CAIRN_REAL(1.5) / CAIRN_REAL_MAX;
    assert_true(cairn_occupancy_grid_memory(&bad) > 0);
    bad.resolution /= 3;
    assert_int_equal(cairn_occupancy_grid_memory(&bad), 0);
    bad = params;
    bad.height = 1;
    bad.resolution = CAIRN_REAL_MAX / 100;
    assert_int_equal(cairn_occupancy_grid_memory(&bad), 0);
    bad.width = 1;
    assert_true(cairn_occupancy_grid_memory(&bad) > 0);
    bad.origin.x = CAIRN_REAL_MAX;
    assert_int_equal(cairn_occupancy_grid_memory(&bad), 0);
    bad.origin.x = 0;
    bad.origin.y = CAIRN_REAL_MAX;
    assert_int_equal(cairn_occupancy_grid_memory(&bad), 0);
    bad.origin.y = 0;
    bad.height = 400;
    assert_int_equal(cairn_occupancy_grid_memory(&bad), 0);
    bad = params;
    bad.width = CAIRN_RASTER_MAX_SIDE;
    bad.height = 1;
    assert_true(cairn_occupancy_grid_memory(&bad) > CAIRN_RASTER_MAX_SIDE * 8);
    bad.width = 1;
    bad.height = CAIRN_RASTER_MAX_SIDE;
    assert_true(cairn_occupancy_grid_memory(&bad) > CAIRN_RASTER_MAX_SIDE * 8);
    assert_int_equal(cairn_occupancy_grid_memory(NULL), 0);
    assert_status(cairn_occupancy_grid_create(&grid, &pool, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_occupancy_grid_create(NULL, &pool, &params), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_occupancy_grid_create(&grid, NULL, &params), CAIRN_BAD_ARGUMENT);
    assert_int_equal(pool.used, 0);
    params.width = 11;
    params.height = 3;
    test_every_pool_size(create_grid, &params, cairn_occupancy_grid_memory(&params));
    test_pool_free(&pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_beams_match_clipping),
        cmocka_unit_test(test_beams_on_borders),
        cmocka_unit_test(test_known_beams),
        cmocka_unit_test(test_beams_far_and_not_finite),
        cmocka_unit_test(test_scan_matches_beams),
        cmocka_unit_test(test_clear),
        cmocka_unit_test(test_scan_refusals),
        cmocka_unit_test(test_classify),
        cmocka_unit_test(test_locate),
        cmocka_unit_test(test_grid_refusals),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
