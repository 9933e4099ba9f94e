/* Long scenes of maps: the mapper on drives, grids and their quality, merged maps of several
 * robots. */
#include "src/base/build.h"

#include "cairn/map_merge.h"
#include "cairn/map_quality.h"
#include "cairn/mapper.h"
#include "tests/long.h"
#include "tests/long_scenes.h"

/* ---- Drives ---- */

static uint64_t add_mapper_state(uint64_t hash, const cairn_mapper_state *s)
{
    hash = add_int(add_int(add_int(add_int(hash, s->scans), s->predicted), s->odometry_rejected),
                   s->odometry_contradicted);
    hash = add_int(add_int(add_int(add_int(hash, s->searched), s->low_confidence), s->keyframes),
                   s->units);
    hash = add_int(add_int(add_int(add_real(hash, s->potential), s->loops), s->loop_events),
                   s->pending_keyframes);
    return add_int(add_int(hash, s->graph_solutions), s->capacity_exceeded);
}

static uint64_t add_whole_map(uint64_t hash, const cairn_mapper *mapper)
{
    cairn_mapper_state state = cairn_mapper_measure(mapper);
    const cairn_scan_set *keys = cairn_mapper_keyframes(mapper);

    hash = add_mapper_state(hash, &state);
    for (int32_t i = 0; i < state.keyframes; i++)
        hash = add_int(add_pose(hash, cairn_mapper_keyframe_pose(mapper, i)),
                       keys->scans[i].end_point);
    for (int32_t i = 0; i < state.loop_events; i++) {
        cairn_mapper_loop loop = cairn_mapper_loop_at(mapper, i);

        hash = add_int(add_int(add_int(add_pose(hash, loop.first_second), loop.first), loop.second),
                       loop.verdict);
    }
    for (int32_t i = 0; i < cairn_mapper_link_count(mapper); i++) {
        cairn_mapper_link link = cairn_mapper_link_at(mapper, i);

        hash =
            add_int(add_int(add_int(add_pose(hash, link.first_second), link.first), link.is_loop),
                    link.is_outlier);
        hash = add_real(add_real(add_real(hash, link.information.xx), link.information.xy),
                        link.information.xz);
        hash = add_real(add_real(add_real(hash, link.information.yy), link.information.yz),
                        link.information.zz);
    }
    return add_pose(hash, cairn_mapper_map_odom(mapper));
}

typedef struct drive {
    int32_t scans, beams;
    cairn_real every, view, people;
    int32_t boxes;
    int32_t odometry;          /* 0: none, 1: drifts, 2: also jumps now and then */
    int32_t blind_from, blind; /* scans that see nothing */
    int32_t each;              /* units of a step */
} drive;

static uint64_t map_drive(uint64_t seed, const cairn_mapper_params *params, const drive *d)
{
    static long_world world;
    static long_sweep sweep;
    cairn_random random = cairn_random_seed(seed, 23);
    cairn_pose odometry = {0, 0, 0}, before = long_on_the_way(0);
    uint64_t hash = GOLDEN_START;
    cairn_mapper *mapper;
    cairn_pool pool;

    long_build(&world, seed, d->boxes);
    LONG_CREATE(&pool, mapper, &mapper, params);
    for (int32_t i = 0; i < d->scans; i++) {
        cairn_pose pose = long_on_the_way((cairn_real)i * d->every);
        cairn_pose step = cairn_pose_between(before, pose);
        cairn_mapper_result result;

        step = long_disturbed(&random, step, CAIRN_REAL(0.02), CAIRN_REAL(0.01));
        step.theta += CAIRN_REAL(0.005);
        if (d->odometry == 2 && i % 17 == 16)
            step.x += CAIRN_REAL(0.4);
        odometry = cairn_pose_compose(odometry, step);
        before = pose;
        long_take_sweep(&sweep, &world, &random, pose, d->beams, d->view, d->people);
        if (i >= d->blind_from && i < d->blind_from + d->blind)
            sweep.input.range_min = CAIRN_REAL(7.5);
        sweep.input.stamp_ns = (int64_t)i * 100000000;
        assert_taken(
            cairn_mapper_add(mapper, &sweep.input, d->odometry > 0 ? &odometry : NULL, NULL));
        LONG_RUN(hash, cairn_mapper_step, mapper, d->each);
        result = cairn_mapper_read(mapper);
        hash = add_int(add_int(add_int(hash, result.verdict), result.keyframe), result.is_keyframe);
        hash = add_covariance(add_pose(add_pose(hash, result.keyframe_scan), result.map_scan),
                              result.covariance);
        hash = add_real(hash, result.overlap);
    }
    hash = add_whole_map(hash, mapper);
    LONG_RUN(hash, cairn_mapper_settle, mapper, 50000);
    hash = add_whole_map(hash, mapper);
    test_pool_free(&pool);
    return hash;
}

static cairn_mapper_params small_mapper(int32_t keys)
{
    cairn_mapper_params params = cairn_mapper_default_for(keys, LONG_BEAMS);

    params.max_local_points = 1500;
    params.loop.min_keyframe_gap = 12;
    return params;
}

/* One lap and a bit, with loop closures. */
uint64_t long_drive(void)
{
    cairn_mapper_params params = small_mapper(80);
    drive d = {110, 181, CAIRN_REAL(0.3), CAIRN_REAL(3.14), 0, 14, 1, 0, 0, 20000};

    return map_drive(31, &params, &d);
}

/* Without odometry, past people, in small steps. */
uint64_t long_drive_blindly(void)
{
    cairn_mapper_params params = small_mapper(80);
    drive d = {90, 121, CAIRN_REAL(0.18), CAIRN_REAL(4.2), CAIRN_REAL(0.2), 14, 0, 50, 2, 3000};

    params.window = 5;
    params.window_free = 2;
    params.window_units = 5000;
    params.local_keyframes = 6;
    params.local_recent = 2;
    params.local_span = 0;
    params.local_radius = 3;
    params.search_units = 30000;
    return map_drive(32, &params, &d);
}

/* With unreliable odometry, little memory and a small budget for loop closures. */
uint64_t long_drive_astray(void)
{
    cairn_mapper_params params = small_mapper(90);
    drive d = {100, 101, CAIRN_REAL(0.35), CAIRN_REAL(2.4), CAIRN_REAL(0.05), 14, 2, 40, 3, 100000};

    params.max_local_points = 600;
    params.keyframe_distance = CAIRN_REAL(0.6);
    params.window = 0;
    params.loop.units_per_scan = 2500;
    params.loop.target_keyframes = 4;
    params.loop.min_consistent = 1;
    params.loop.max_loops = 20;
    params.loop.candidate_radius = 2;
    params.loop.search_radius = 2;
    params.loop.min_log_odds = 1;
    params.loop.max_chi2 = 12;
    return map_drive(33, &params, &d);
}

/* Through bare rooms that look alike, two laps, with loop closures that must agree. */
uint64_t long_drive_among_twins(void)
{
    cairn_mapper_params params = small_mapper(120);
    drive d = {130, 121, CAIRN_REAL(0.35), 2, 0, 0, 1, 0, 0, 50000};
    uint64_t hash;

    params.loop.min_consistent = 2;
    params.loop.search_radius = 5;
    params.loop.local_search_radius = CAIRN_REAL(0.2);
    params.loop.max_free_space_violation = CAIRN_REAL(0.2);
    params.loop.units_per_scan = 20000;
    params.search = 0;
    hash = map_drive(37, &params, &d);
    d.boxes = 2;
    d.people = CAIRN_REAL(0.1);
    d.view = CAIRN_REAL(3.5);
    params.loop.min_consistent = 4;
    params.loop.sigma = CAIRN_REAL(0.03);
    params.loop.sigma_theta = CAIRN_REAL(0.02);
    return add_int(hash, (int64_t)(map_drive(38, &params, &d) >> 1));
}

/* ---- Grids ---- */

enum { SIDE = 128 };

/* The flat from a few places, in a grid that covers a part of it. */
static cairn_occupancy_grid *draw_flat(cairn_pool *pool, uint64_t seed, uint64_t *hash)
{
    cairn_occupancy_grid_params params = cairn_occupancy_grid_default();
    cairn_random random = cairn_random_seed(seed, 24);
    static long_world world;
    static long_sweep sweep;
    cairn_occupancy_grid *grid;
    cairn_pool scan_pool;
    cairn_scan *scan = long_new_scan(&scan_pool);

    params.width = SIDE;
    params.height = 100;
    params.resolution = CAIRN_REAL(0.08);
    params.origin.x = CAIRN_REAL(0.5);
    params.origin.y = CAIRN_REAL(-0.25);
    LONG_CREATE(pool, occupancy_grid, &grid, &params);
    long_build(&world, seed, 14);
    for (int32_t i = 0; i < 14; i++) {
        cairn_pose pose =
            i < 10 ? long_on_the_way((cairn_real)i * 2) : long_somewhere(&world, &random);
        cairn_scan_view view;

        long_take_sweep(&sweep, &world, &random, pose, 241, CAIRN_REAL(6.2), CAIRN_REAL(0.1));
        sweep.input.range_max = 4;
        view = long_fit(scan, &sweep);
        assert_ok(cairn_occupancy_grid_begin_scan(grid, view.beams, view.beam_count, pose, NULL));
        LONG_RUN(*hash, cairn_occupancy_grid_step, grid, 500);
    }
    test_pool_free(&scan_pool);
    return grid;
}

uint64_t long_grid(void)
{
    static uint8_t cells[SIDE * 100];
    cairn_raster_u8 picture = {cells, SIDE, 100, SIDE};
    cairn_map_quality_relation_sums sums = {0, 0, 0, 0, 0};
    cairn_random random = cairn_random_seed(34, 25);
    cairn_map_quality_relation_errors errors;
    cairn_map_quality_pose_errors pose_errors;
    cairn_pose estimate[50], truth[50];
    cairn_map_quality_entropy entropy;
    uint64_t hash = GOLDEN_START;
    cairn_pool pool;
    cairn_occupancy_grid *grid = draw_flat(&pool, 34, &hash);

    for (int32_t y = 0; y < 100; y++)
        for (int32_t x = 0; x < SIDE; x++) {
            cairn_occupancy_grid_cell_state cell = cairn_occupancy_grid_cell(grid, x, y);

            hash = add_real(add_real(add_int(hash, cell.hits), (cairn_real)cell.length),
                            cairn_occupancy_grid_probability(grid, x, y));
        }
    assert_ok(
        cairn_occupancy_grid_classify(grid, cairn_occupancy_grid_thresholds_default(), 0, picture));
    hash = add_bytes(hash, cells, sizeof cells);
    memset(&entropy, 0, sizeof entropy);
    assert_ok(cairn_map_quality_entropy_add(grid, 0, 30, &entropy));
    assert_ok(cairn_map_quality_entropy_add(grid, 30, 70, &entropy));
    hash = add_int(
        add_vector(add_real(hash, entropy.total), entropy.quadrant, CAIRN_MAP_QUALITY_QUADRANTS),
        entropy.cells);
    for (int32_t i = 0; i < 300; i++) {
        cairn_vec2 from = long_point(&random, 6, 5), to;
        cairn_occupancy_grid_ray walk;
        cairn_occupancy_grid_chord chord;
        cairn_real likelihood;
        int32_t x, y;

        from.x += 6;
        from.y += 4;
        to.x = i % 7 == 0 ? from.x : 6 + argument(&random, 8, 0);
        to.y = i % 11 == 0 ? from.y : 4 + argument(&random, 8, 0);
        if (cairn_occupancy_grid_locate(grid, to, &x, &y))
            hash = add_int(add_int(hash, x), y);
        assert_ok(cairn_map_quality_beam_likelihood(grid, from, to, i % 3 > 0, CAIRN_REAL(0.05),
                                                    &likelihood));
        hash = add_real(hash, likelihood);
        if (cairn_occupancy_grid_walk(grid, from, to, &walk) == CAIRN_EMPTY)
            continue;
        while (cairn_occupancy_grid_ray_next(&walk, &chord))
            hash = add_real(add_int(add_int(hash, chord.x), chord.y), chord.length);
    }
    for (int32_t i = 0; i < 50; i++) {
        cairn_pose nowhere = {0, 0, 0};

        truth[i] = long_disturbed(&random, nowhere, 5, 3);
        estimate[i] = long_disturbed(&random, truth[i], CAIRN_REAL(0.3), CAIRN_REAL(0.3));
        if (i > 0)
            assert_ok(cairn_map_quality_relation_add(
                &sums, cairn_pose_between(truth[i - 1], truth[i]), estimate[i - 1], estimate[i]));
    }
    assert_ok(cairn_map_quality_pose_errors_of(estimate, truth, 50, &pose_errors));
    errors = cairn_map_quality_relation_errors_of(&sums);
    hash = add_real(add_real(add_real(hash, pose_errors.x), pose_errors.y), pose_errors.theta);
    hash = add_real(add_real(add_real(hash, errors.distance_mean), errors.distance_sd),
                    errors.distance_squared);
    hash = add_real(add_real(add_real(hash, errors.angle_mean), errors.angle_sd),
                    errors.angle_squared);
    test_pool_free(&pool);
    return hash;
}

/* ---- Merged maps ---- */

enum { MAPS = 4, PART = 80 };

/* Part `index` of the drawn flat, some rotated by a quarter or half turn, in cells of its own
 * frame. */
static void cut_part(const uint8_t *flat, int32_t index, uint8_t *part)
{
    static const int32_t left[MAPS] = {0, 30, 48, 20}, low[MAPS] = {5, 0, 20, 18};

    for (int32_t y = 0; y < PART; y++)
        for (int32_t x = 0; x < PART; x++) {
            int32_t u = index == 1 ? y : index == 2 ? PART - 1 - x : x;
            int32_t v = index == 1 ? PART - 1 - x : index == 2 ? PART - 1 - y : y;

            part[y * PART + x] = flat[(low[index] + v) * SIDE + left[index] + u];
        }
}

static uint64_t add_merged(uint64_t hash, const cairn_map_merge *merge)
{
    cairn_map_merge_result result = cairn_map_merge_read(merge);

    hash = add_int(add_int(add_int(add_int(hash, result.maps), result.placed), result.reference),
                   result.hypotheses);
    hash = add_real(add_real(add_int(hash, result.resamplings), result.n_eff),
                    result.log_likelihood_ratio);
    hash = add_int(hash, result.units);
    for (int32_t i = 0; i < result.maps; i++) {
        cairn_map_merge_placed p = cairn_map_merge_of(merge, i);

        hash = add_real(
            add_real(add_real(add_pose(hash, p.reference_map), p.support), p.competing_support),
            p.error_probability);
        hash = add_int(add_int(add_int(add_int(hash, p.verdict), p.neighbours), p.rank), p.modes);
        hash = add_int(hash, p.corners);
    }
    for (int32_t a = 0; a < result.maps; a++)
        for (int32_t b = 0; b < result.maps; b++)
            for (int32_t k = 0; k < 3 && a != b; k++) {
                cairn_map_merge_pair_score score;
                cairn_real evidence;
                cairn_pose a_b;

                if (!cairn_map_merge_mode(merge, a, b, k, &a_b, &evidence))
                    continue;
                hash = add_real(add_pose(hash, a_b), evidence);
                assert_ok(cairn_map_merge_score(merge, a, b, a_b, &score));
                hash = add_real(
                    add_real(add_real(hash, score.log_likelihood_ratio), score.agreeing_wall),
                    score.free_space_violation);
                hash = add_real(add_real(add_real(hash, score.overlap), score.psi),
                                score.disagreement);
                hash = add_real(hash, score.gamma);
            }
    return hash;
}

static uint64_t merge_maps(uint64_t seed, cairn_map_merge_params *params, int32_t with_guess)
{
    static uint8_t flat[SIDE * 100], parts[MAPS][PART * PART];
    static const int32_t order[MAPS] = {2, 0, 3, 1};
    cairn_raster_u8 picture = {flat, SIDE, 100, SIDE};
    uint64_t hash = GOLDEN_START;
    cairn_map_merge *merge;
    cairn_pool pool;
    cairn_occupancy_grid *grid = draw_flat(&pool, seed, &hash);

    assert_ok(
        cairn_occupancy_grid_classify(grid, cairn_occupancy_grid_thresholds_default(), 0, picture));
    test_pool_free(&pool);
    params->max_maps = MAPS;
    params->max_map_cells = PART * PART;
    params->max_cells = MAPS * PART * PART;
    LONG_CREATE(&pool, map_merge, &merge, params);
    for (int32_t i = 0; i < MAPS; i++) {
        cairn_map_merge_map map = {{parts[i], PART, PART, PART},
                                   CAIRN_REAL(0.08),
                                   {1, -2, CAIRN_REAL(0.3) * (cairn_real)i}};

        cut_part(flat, i, parts[i]);
        if (i == 3 && params->max_corners < 15) /* one that shows nothing */
            memset(parts[i], CAIRN_OCCUPANCY_GRID_UNKNOWN, sizeof parts[i]);
        assert_ok(cairn_map_merge_add(merge, &map, NULL));
    }
    if (with_guess) {
        cairn_pose guess = {CAIRN_REAL(0.5), 1, CAIRN_REAL(0.2)};

        assert_ok(cairn_map_merge_guess(merge, 1, guess));
    }
    assert_ok(cairn_map_merge_begin(merge, with_guess ? 2 : 0, with_guess ? order : NULL));
    LONG_RUN(hash, cairn_map_merge_step, merge, 50000);
    hash = add_merged(hash, merge);
    test_pool_free(&pool);
    return hash;
}

uint64_t long_merged(void)
{
    cairn_map_merge_params params = cairn_map_merge_default();

    params.particles = 20;
    params.max_points = 700;
    return merge_maps(35, &params, 0);
}

/* With few corners, so that walls must decide, and an empty map. */
uint64_t long_merged_by_walls(void)
{
    cairn_map_merge_params params = cairn_map_merge_default();
    uint64_t hash;

    params.particles = 5;
    params.max_points = 400;
    params.max_corners = 3;
    params.max_segments = 30;
    params.seed = 7;
    hash = merge_maps(39, &params, 0);
    params.max_corners = 12;
    params.max_modes = 2;
    params.min_margin = 40;
    return add_int(hash, (int64_t)(merge_maps(35, &params, 1) >> 1));
}

uint64_t long_merged_by_images(void)
{
    cairn_map_merge_params params = cairn_map_merge_default();

    params.perception = CAIRN_MAP_MERGE_IMAGES;
    params.particles = 8;
    params.max_points = 300;
    params.max_segments = 40;
    params.max_corners = 20;
    params.max_modes = 3;
    params.correlation_length = 6;
    params.min_score = 2;
    params.min_margin = 1;
    return merge_maps(36, &params, 1);
}
