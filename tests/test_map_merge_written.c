/* Map merging as chapter 9 of the thesis has it. */
#include "tests/merging.h"

#include <math.h>

#include "src/merging/map_merge_work.h"

enum { MAPS_MOST = 4, CELLS_MOST = 120 * 80 };

static const double CELL = 0.05;

/* A map cut out of a world of known cells; lower left corner (x, y) of its raster in the world. */
typedef struct cut_map {
    uint8_t cells[CELLS_MOST];
    int32_t width, height;
    double x, y;
} cut_map;

typedef uint8_t (*world_at)(double x, double y);

static void cut_out(cut_map *map, world_at world, double x0, double x1, double y0, double y1)
{
    map->x = x0;
    map->y = y0;
    map->width = (int32_t)lround((x1 - x0) / CELL);
    map->height = (int32_t)lround((y1 - y0) / CELL);
    assert_true(map->width * map->height <= CELLS_MOST);
    for (int32_t i = 0; i < map->width * map->height; i++) {
        int32_t column = i % map->width, row = i / map->width;

        map->cells[i] = world(x0 + (column + 0.5) * CELL, y0 + (row + 0.5) * CELL);
    }
}

static cairn_map_merge_map view_of(const cut_map *map)
{
    cairn_map_merge_map view = {
        {map->cells, map->width, map->height, map->width}, (cairn_real)CELL, {0, 0, 0}};

    return view;
}

static cairn_map_merge_params small_params(void)
{
    cairn_map_merge_params p = cairn_map_merge_as_written();

    p.max_maps = MAPS_MOST;
    p.max_map_cells = CELLS_MOST;
    p.max_cells = MAPS_MOST * CELLS_MOST;
    p.max_points = 1024;
    p.max_segments = 64;
    p.max_corners = 16;
    p.max_modes = 6;
    p.particles = 10;
    return p;
}

static cairn_map_merge *merge_with(cairn_pool *pool, const cairn_map_merge_params *p,
                                   const cut_map *maps, int32_t count, const int32_t *order)
{
    cairn_map_merge *merge;

    *pool = test_pool(cairn_map_merge_memory(p));
    assert_ok(cairn_map_merge_create(&merge, pool, p));
    cairn_map_merge_clear(merge);
    for (int32_t i = 0; i < count; i++) {
        cairn_map_merge_map view = view_of(&maps[i]);

        assert_ok(cairn_map_merge_add(merge, &view, NULL));
    }
    assert_ok(cairn_map_merge_begin(merge, 0, order));
    run(merge, CAIRN_UNBOUNDED);
    return merge;
}

/* ---- Params ---- */

static void params_of_the_mode(void **state)
{
    cairn_map_merge_params p = small_params();
    cairn_map_merge *merge;
    cairn_pool pool = test_pool(cairn_map_merge_memory(&p));
    uint8_t cells[1] = {CAIRN_OCCUPANCY_GRID_FREE};
    cairn_map_merge_map map = {{cells, 1, 1, 1}, 1, {0, 0, 0}};

    (void)state;
    assert_int_equal(cairn_map_merge_as_written().mode, CAIRN_MODE_AS_WRITTEN);
    assert_int_equal(cairn_map_merge_default().mode, CAIRN_MODE_DEFAULT);
    assert_ok(cairn_map_merge_create(&merge, &pool, &p));
    cairn_map_merge_clear(merge);
    assert_ok(cairn_map_merge_add(merge, &map, NULL));
    assert_status(cairn_map_merge_guess(merge, 0, cairn_pose_identity()), CAIRN_UNSUPPORTED);
    p.perception = CAIRN_MAP_MERGE_LIKELIHOOD_RATIO;
    assert_int_equal(cairn_map_merge_memory(&p), 0);
    p = cairn_map_merge_default();
    p.mode = 2;
    assert_int_equal(cairn_map_merge_memory(&p), 0);
    p.mode = -1;
    assert_int_equal(cairn_map_merge_memory(&p), 0);
    test_pool_free(&pool);
}

static void memory_is_exact(void **state)
{
    cairn_map_merge_params p = small_params();

    (void)state;
    p.max_maps = 2;
    p.max_cells = p.max_map_cells = 4;
    p.max_points = 64;
    p.max_segments = p.max_corners = p.max_modes = p.particles = 1;
    test_every_pool_size(create, &p, cairn_map_merge_memory(&p));
}

/* ---- Psi and gamma ---- */

static void fill_at_random(cut_map *map, uint64_t seed, int32_t width, int32_t height)
{
    cairn_random random = cairn_random_seed(seed, 1);

    map->width = width;
    map->height = height;
    for (int32_t i = 0; i < width * height; i++) {
        double u = (double)cairn_random_unit(&random);

        map->cells[i] = u < 0.15  ? CAIRN_OCCUPANCY_GRID_OCCUPIED
                        : u < 0.6 ? CAIRN_OCCUPANCY_GRID_FREE
                                  : CAIRN_OCCUPANCY_GRID_UNKNOWN;
    }
}

/* s(from, to, c1, c2) as printed, by all pairs of cells; mu = 0, sigma = 0.5. */
static double slow_s(const cut_map *from, const cut_map *to, cairn_pose to_from, uint8_t c1,
                     uint8_t c2)
{
    double sum = 0, c = cos((double)to_from.theta), s = sin((double)to_from.theta);
    int32_t count = 0;

    for (int32_t i = 0; i < from->width * from->height; i++) {
        int32_t column = i % from->width, row = i / from->width;
        double x = (column + 0.5) * CELL, y = (row + 0.5) * CELL;
        double u = (c * x - s * y + (double)to_from.x) / CELL,
               v = (s * x + c * y + (double)to_from.y) / CELL;
        double least = 1e9;

        if (from->cells[i] != c1)
            continue;
        count++;
        for (int32_t k = 0; k < to->width * to->height; k++)
            if (to->cells[k] == c2) {
                int32_t there = k % to->width, up = k / to->width;

                least = fmin(least, fabs(floor(u) - there) + fabs(floor(v) - up));
            }
        sum += exp(-least * least / (2 * 0.25));
    }
    return count > 0 ? sum / count : 0;
}

static void images_equal_the_reference(void **state)
{
    static const uint8_t class[2] = {CAIRN_OCCUPANCY_GRID_OCCUPIED, CAIRN_OCCUPANCY_GRID_FREE};
    static cut_map maps[2];
    cairn_map_merge_params p = small_params();
    cairn_random random = cairn_random_seed(3, 4);
    cairn_map_merge *merge;
    cairn_pool pool;

    (void)state;
    fill_at_random(&maps[0], 1, 14, 23);
    fill_at_random(&maps[1], 2, 19, 11);
    merge = merge_with(&pool, &p, maps, 2, NULL);
    for (int32_t n = 0; n < 60; n++) {
        cairn_pose a_b = {cairn_random_uniform(&random, -CAIRN_REAL(0.8), CAIRN_REAL(0.8)),
                          cairn_random_uniform(&random, -CAIRN_REAL(0.8), CAIRN_REAL(1.2)),
                          n % 6 == 0 ? 0 : cairn_random_uniform(&random, -3, 3)};
        cairn_pose b_a = cairn_pose_inverse(a_b);
        cairn_map_merge_pair_score score;
        double psi = 0, d = 0;

        for (int k = 0; k < 2; k++) {
            psi += slow_s(&maps[0], &maps[1], b_a, class[k], class[k]);
            psi += slow_s(&maps[1], &maps[0], a_b, class[k], class[k]);
            d += slow_s(&maps[0], &maps[1], b_a, class[k], class[1 - k]);
            d += slow_s(&maps[1], &maps[0], a_b, class[k], class[1 - k]);
        }
        assert_ok(cairn_map_merge_score(merge, 0, 1, a_b, &score));
        assert_near(score.psi, psi, NUMBER(1e-9, 0.05));
        assert_near(score.disagreement, d, NUMBER(1e-9, 0.05));
        d = fmax((double)score.disagreement, 1e-6);
        assert_near(score.gamma, -log(d) - d, NUMBER(1e-12, 1e-4));
    }
    {
        cairn_pose far = {CAIRN_REAL(1e30), 0, 1};
        cairn_map_merge_pair_score score;

        assert_ok(cairn_map_merge_score(merge, 0, 1, far, &score));
        assert_near(score.psi, 0, 0);
    }
    test_pool_free(&pool);
}

/* ---- Registration ---- */

static double squared_distances(const cairn_vec2 *to, const cairn_vec2 *from, cairn_pose pose)
{
    double sum = 0;

    for (int32_t i = 0; i < MAP_MERGE_CORRESPONDENCES; i++)
        sum +=
            (double)cairn_vec2_norm_squared(cairn_vec2_sub(to[i], cairn_pose_point(pose, from[i])));
    return sum;
}

/* No motion of a fine grid about it, and none of a coarse grid over all, has a smaller sum of
 * squares. */
static void registration_is_the_best_motion(void **state)
{
    cairn_random random = cairn_random_seed(5, 6);

    (void)state;
    for (int32_t n = 0; n < 8; n++) {
        cairn_vec2 to[MAP_MERGE_CORRESPONDENCES], from[MAP_MERGE_CORRESPONDENCES],
            middle[2] = {{0, 0}, {0, 0}};
        cairn_pose pose;
        double least, best = 1e9;

        for (int32_t i = 0; i < MAP_MERGE_CORRESPONDENCES; i++) {
            to[i].x = cairn_random_uniform(&random, -2, 2);
            to[i].y = cairn_random_uniform(&random, -2, 2);
            from[i].x = cairn_random_uniform(&random, -2, 2);
            from[i].y = cairn_random_uniform(&random, -2, 2);
            middle[0] = cairn_vec2_add(middle[0], cairn_vec2_scale(to[i], CAIRN_REAL(1.0) / 3));
            middle[1] = cairn_vec2_add(middle[1], cairn_vec2_scale(from[i], CAIRN_REAL(1.0) / 3));
        }
        pose = cairn_map_merge_motion_of(to, from);
        least = squared_distances(to, from, pose);
        for (int32_t k = 0; k < 3600; k++)
            for (int32_t step = 0; step < 9; step++) {
                cairn_pose tried = {0, 0, (cairn_real)(k * 3.14159265358979 / 1800)};
                cairn_vec2 moved = cairn_pose_point(tried, middle[1]);
                int32_t right = step % 3 - 1, up = step / 3 - 1;
                double sum;

                tried.x = middle[0].x - moved.x + CAIRN_REAL(0.01) * (cairn_real)right;
                tried.y = middle[0].y - moved.y + CAIRN_REAL(0.01) * (cairn_real)up;
                sum = squared_distances(to, from, tried);
                best = sum < best ? sum : best;
            }
        assert_true(least <= best + NUMBER(1e-12, 1e-4));
        assert_true(least >= best - 1e-3); /* the grid comes as near */
    }
}

/* ---- Worlds ---- */

static int is_within(double x, double y, double x0, double x1, double y0, double y1)
{
    return x > x0 && x < x1 && y > y0 && y < y1;
}

/* A corridor, 2.6 m wide, that is symmetric under half a turn about its middle up to 2 m from
 * there: beyond there is rock on the left and another room on the right. */
static uint8_t symmetric_corridor(double x, double y)
{
    if (is_within(x, y, 0.8, 1.5, 0.2, 0.7) || is_within(-x, -y, 0.8, 1.5, 0.2, 0.7))
        return CAIRN_OCCUPANCY_GRID_OCCUPIED;
    if (x < -2)
        return fabs(y) < 1.6 ? CAIRN_OCCUPANCY_GRID_OCCUPIED : CAIRN_OCCUPANCY_GRID_UNKNOWN;
    return fabs(y) < 1.3   ? CAIRN_OCCUPANCY_GRID_FREE
           : fabs(y) < 1.4 ? CAIRN_OCCUPANCY_GRID_OCCUPIED
                           : CAIRN_OCCUPANCY_GRID_UNKNOWN;
}

static void cut_corridor(cut_map *maps)
{
    cut_out(&maps[0], symmetric_corridor, -4, 0.5, -1.6, 1.6);
    cut_out(&maps[1], symmetric_corridor, -1.8, 1.8, -1.6, 1.6);
    cut_out(&maps[2], symmetric_corridor, 0, 4, -1.6, 1.6);
}

/* The pose of map b seen from map a, as they were cut out. */
static cairn_pose truth_of(const cut_map *a, const cut_map *b)
{
    cairn_pose pose = {(cairn_real)(b->x - a->x), (cairn_real)(b->y - a->y), 0};

    return pose;
}

static void assert_pose(cairn_pose p, cairn_pose q, double metres)
{
    assert_near(p.x, q.x, metres);
    assert_near(p.y, q.y, metres);
    assert_near(remainder((double)(p.theta - q.theta), 2 * 3.14159265358979), 0, metres);
}

/* The middle map supports the right end at either of its ends equally; the merged maps decide. */
static void likelihood_is_that_of_the_merged_map(void **state)
{
    static const int32_t order[3] = {0, 1, 2};
    static cut_map maps[3];
    cairn_map_merge_params p = small_params();
    cairn_map_merge *merge;
    cairn_map_merge_pair_score right, wrong;
    cairn_pose at, turned = {CAIRN_REAL(1.8), CAIRN_REAL(3.2), (cairn_real)3.14159265358979};
    cairn_pool pool;

    (void)state;
    cut_corridor(maps);
    merge = merge_with(&pool, &p, maps, 3, order);
    at = truth_of(&maps[1], &maps[2]);
    assert_ok(cairn_map_merge_score(merge, 1, 2, at, &right));
    assert_ok(cairn_map_merge_score(merge, 1, 2, turned, &wrong));
    assert_near(right.psi, wrong.psi, NUMBER(1e-9, 0.05));
    assert_near(right.gamma, wrong.gamma, NUMBER(1e-9, 0.05));
    for (int32_t i = 0; i < 3; i++) {
        assert_int_equal(cairn_map_merge_of(merge, i).verdict, CAIRN_MAP_MERGE_PLACED);
        assert_int_equal(cairn_map_merge_of(merge, i).rank, i);
        assert_pose(cairn_map_merge_of(merge, i).reference_map, truth_of(&maps[0], &maps[i]), 0.05);
    }
    test_pool_free(&pool);
}

/* A square room: each of its corners fits each of another one's. */
static uint8_t square_room(double x, double y)
{
    double most = fmax(fabs(x), fabs(y));

    return most < 1     ? CAIRN_OCCUPANCY_GRID_FREE
           : most < 1.1 ? CAIRN_OCCUPANCY_GRID_OCCUPIED
                        : CAIRN_OCCUPANCY_GRID_UNKNOWN;
}

static void particles_grow_with_the_modes(void **state)
{
    static cut_map maps[3];
    cairn_map_merge_params p = small_params();
    cairn_map_merge_result result;
    cairn_map_merge *merge;
    cairn_pool pool;

    (void)state;
    for (int32_t i = 0; i < 3; i++)
        cut_out(&maps[i], square_room, -1.2 - 0.1 * i, 1.2, -1.2, 1.2);
    p.particles = 4;
    p.max_modes = 16;
    merge = merge_with(&pool, &p, maps, 3, NULL);
    result = cairn_map_merge_read(merge);
    assert_int_equal(result.placed, 3);
    assert_true(result.peak_particles > p.particles && result.peak_particles <= 2 * p.particles);
    assert_true(result.hypotheses >= 3 * 16);
    /* its rotation is not determined */
    assert_true(cairn_map_merge_of(merge, 1).error_probability > CAIRN_REAL(0.3));
    test_pool_free(&pool);
}

/* Of n rooms with 16 registrations of each two, k merged ones have 16 k (n - k) with the others:
 * 1024 of 8 with 8, 1152 of 8 with 9 and of 9 with 8. */
static void registrations_beyond_the_capacity_are_counted(void **state)
{
    static cut_map maps[17];
    cairn_map_merge_params p = small_params();

    (void)state;
    p.max_maps = 17;
    p.max_cells = p.max_maps * CELLS_MOST;
    p.particles = 1;
    p.max_modes = 16;
    for (int32_t i = 0; i < 17; i++)
        cut_out(&maps[i], square_room, -1.2 - 0.01 * i, 1.2, -1.2, 1.2);
    for (int32_t count = 16; count <= 17; count++) {
        cairn_pool pool;
        cairn_map_merge *merge = merge_with(&pool, &p, maps, count, NULL);
        cairn_map_merge_result result = cairn_map_merge_read(merge);

        assert_int_equal(result.placed, count);
        if (count == 16)
            assert_int_equal(result.candidates_dropped, 0);
        else
            assert_true(result.candidates_dropped >= 2 * 128 &&
                        result.candidates_dropped % 128 == 0);
        assert_ok(cairn_map_merge_begin(merge, 0, NULL));
        run(merge, CAIRN_UNBOUNDED);
        assert_int_equal(cairn_map_merge_read(merge).candidates_dropped, result.candidates_dropped);
        test_pool_free(&pool);
    }
}

static void budgets_do_not_matter(void **state)
{
    static const int32_t units[] = {CAIRN_UNBOUNDED, 1, 7, 1000};
    static cut_map maps[3];
    cairn_map_merge_params p = small_params();
    cairn_map_merge *merge;
    cairn_pool pool;
    uint64_t expected;
    int64_t total = 0;

    (void)state;
    cut_corridor(maps);
    p.max_modes = 3;
    p.particles = 4;
    merge = merge_with(&pool, &p, maps, 3, NULL);
    expected = hash_of(merge, 3);
    for (int k = 0; k < 4; k++) {
        assert_ok(cairn_map_merge_begin(merge, 0, NULL));
        run(merge, units[k]);
        assert_true(hash_of(merge, 3) == expected);
        total = k == 0 ? cairn_map_merge_read(merge).units : total;
        assert_int_equal(cairn_map_merge_read(merge).units, total);
    }
    test_pool_free(&pool);
}

/* ---- Nothing to register ---- */

static uint8_t plain_wall(double x, double y)
{
    (void)x;
    return y < 0 ? CAIRN_OCCUPANCY_GRID_OCCUPIED : CAIRN_OCCUPANCY_GRID_FREE;
}

static uint8_t all_unknown(double x, double y)
{
    (void)x;
    (void)y;
    return CAIRN_OCCUPANCY_GRID_UNKNOWN;
}

static void maps_without_corners_are_refused(void **state)
{
    static cut_map maps[4];
    cairn_map_merge_params p = small_params();
    cairn_map_merge *merge;
    cairn_pool pool;

    (void)state;
    cut_out(&maps[0], square_room, -1.2, 1.2, -1.2, 1.2);
    cut_out(&maps[1], plain_wall, -1, 1, -0.5, 0.5);
    cut_out(&maps[2], square_room, -1.2, 1.3, -1.2, 1.2);
    cut_out(&maps[3], all_unknown, -1, 1, -1, 1);
    merge = merge_with(&pool, &p, maps, 4, NULL);
    assert_int_equal(cairn_map_merge_read(merge).placed, 2);
    assert_int_equal(cairn_map_merge_of(merge, 0).verdict, CAIRN_MAP_MERGE_PLACED);
    assert_int_equal(cairn_map_merge_of(merge, 1).verdict, CAIRN_MAP_MERGE_NO_CORNER);
    assert_int_equal(cairn_map_merge_of(merge, 2).verdict, CAIRN_MAP_MERGE_PLACED);
    assert_int_equal(cairn_map_merge_of(merge, 3).verdict, CAIRN_MAP_MERGE_EMPTY);
    test_pool_free(&pool);
    merge = merge_with(&pool, &p, maps + 1, 2, NULL); /* the reference itself has none */
    assert_int_equal(cairn_map_merge_read(merge).placed, 1);
    assert_int_equal(cairn_map_merge_of(merge, 1).verdict, CAIRN_MAP_MERGE_NO_CORNER);
    assert_string_equal(cairn_map_merge_verdict_text(CAIRN_MAP_MERGE_NO_CORNER),
                        "no corner is similar to one of the merged maps");
    test_pool_free(&pool);
    merge = merge_with(&pool, &p, maps, 1, NULL);
    assert_int_equal(cairn_map_merge_read(merge).placed, 1);
    assert_int_equal(cairn_map_merge_read(merge).peak_particles, 1);
    test_pool_free(&pool);
}

/* A merged map without capacity: every candidate of every particle is refused, and the merged map
 * stays. */
static void no_capacity_for_the_merged_map(void **state)
{
    static cut_map maps[2];
    cairn_map_merge_params p = small_params();
    cairn_map_merge *merge;
    cairn_pool pool;

    (void)state;
    cut_out(&maps[0], square_room, -1.2, 1.2, -1.2, 1.2);
    cut_out(&maps[1], square_room, -1.2, 1.2, -1.2, 1.2);
    merge = merge_with(&pool, &p, maps, 2, NULL);
    assert_int_equal(cairn_map_merge_read(merge).placed, 2);
    merge->written->max_cells = 48 * 48; /* just enough */
    assert_ok(cairn_map_merge_begin(merge, 0, NULL));
    run(merge, 100);
    assert_int_equal(cairn_map_merge_read(merge).placed, 2);
    merge->written->max_cells = 48 * 48 - 1;
    assert_ok(cairn_map_merge_begin(merge, 0, NULL));
    run(merge, 100);
    assert_int_equal(cairn_map_merge_read(merge).placed, 1);
    assert_int_equal(cairn_map_merge_of(merge, 1).verdict, CAIRN_MAP_MERGE_NO_OVERLAP);
    test_pool_free(&pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(params_of_the_mode),
        cmocka_unit_test(memory_is_exact),
        cmocka_unit_test(images_equal_the_reference),
        cmocka_unit_test(registration_is_the_best_motion),
        cmocka_unit_test(likelihood_is_that_of_the_merged_map),
        cmocka_unit_test(particles_grow_with_the_modes),
        cmocka_unit_test(registrations_beyond_the_capacity_are_counted),
        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(maps_without_corners_are_refused),
        cmocka_unit_test(no_capacity_for_the_merged_map),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
