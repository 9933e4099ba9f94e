/* Golden scenes of scans of a room. */
#include "src/base/build.h"

#include "cairn/aligner.h"
#include "cairn/force_field.h"
#include "cairn/icp.h"
#include "cairn/lum.h"
#include "cairn/map_quality.h"
#include "cairn/occupancy_grid.h"
#include "cairn/scan_map.h"
#include "cairn/scan_redundancy.h"
#include "cairn/angle_step.h"
#include "cairn/scanner_check.h"
#include "cairn/scan_match.h"
#include "tests/golden.h"

_Alignas(CAIRN_ALIGN) unsigned char golden_memory[GOLDEN_MEMORY];

/* Distance along a direction to the walls of a 6 x 4 m room, or to the box of 1 x 1.2 m at (3.5,
 * 0). */
static cairn_real room_range(cairn_real x, cairn_real y, cairn_real c, cairn_real s)
{
    static const cairn_segment wall[] = {
        {{0, 0}, {6, 0}},
        {{6, 0}, {6, 4}},
        {{6, 4}, {0, 4}},
        {{0, 4}, {0, 0}},
        {{CAIRN_REAL(3.5), 0}, {CAIRN_REAL(3.5), CAIRN_REAL(1.2)}},
        {{CAIRN_REAL(3.5), CAIRN_REAL(1.2)}, {CAIRN_REAL(4.5), CAIRN_REAL(1.2)}},
        {{CAIRN_REAL(4.5), CAIRN_REAL(1.2)}, {CAIRN_REAL(4.5), 0}},
    };
    cairn_segment beam;
    cairn_real nearest = 100;

    beam.a.x = x;
    beam.a.y = y;
    beam.b.x = x + 20 * c;
    beam.b.y = y + 20 * s;
    for (size_t i = 0; i < sizeof wall / sizeof *wall; i++) {
        cairn_vec2 hit;

        if (cairn_segments_intersect(beam, wall[i]) &&
            cairn_line_intersection(beam, wall[i], &hit)) {
            cairn_real range = cairn_sqrt((hit.x - x) * (hit.x - x) + (hit.y - y) * (hit.y - y));

            nearest = cairn_min(nearest, range);
        }
    }
    return nearest;
}

void golden_make_sweep(golden_sweep *out, cairn_random *random, cairn_pose pose)
{
    memset(&out->input, 0, sizeof out->input);
    for (int i = 0; i < GOLDEN_BEAMS; i++) {
        cairn_real s, c, range;

        cairn_sincos(pose.theta + (cairn_real)(i - 90) * CAIRN_REAL(0.03125), &s, &c);
        range = room_range(pose.x, pose.y, c, s) +
                cairn_random_uniform(random, -CAIRN_REAL(0.01), CAIRN_REAL(0.01));
        out->range[i] = i % 50 == 49 ? 0 : (float)range;
    }
    out->input.range = out->range;
    out->input.count = GOLDEN_BEAMS;
    out->input.angle_min = -90 * 0.03125f;
    out->input.angle_step = 0.03125f;
    out->input.range_max = 8;
    out->input.range_sigma = 0.01f;
    out->input.motion.theta = CAIRN_REAL(0.002);
}

int golden_fit_sweep(cairn_scan *scan, const golden_sweep *s)
{
    cairn_status status = cairn_scan_begin(scan, &s->input, NULL);

    while (status == CAIRN_OK) {
        cairn_budget budget = {777};

        status = cairn_scan_step(scan, &budget);
        if (status == CAIRN_OK)
            return 1;
        status = status == CAIRN_MORE ? CAIRN_OK : status;
    }
    return 0;
}

cairn_scan *golden_new_scan(cairn_pool *pool)
{
    cairn_scan_params params = cairn_scan_default();
    cairn_scan *scan = NULL;

    params.max_beams = GOLDEN_BEAMS;
    params.max_segments = 64;
    params.max_points = 256;
    return cairn_scan_create(&scan, pool, &params) == CAIRN_OK ? scan : NULL;
}

cairn_pose golden_view_pose(int32_t i)
{
    cairn_pose pose = {1 + (cairn_real)i * CAIRN_REAL(0.5), CAIRN_REAL(2.5),
                       (cairn_real)i * CAIRN_REAL(0.4)};

    return pose;
}

cairn_pose golden_thought_pose(cairn_random *random, int32_t i)
{
    cairn_pose pose = golden_view_pose(i);

    pose.x += cairn_random_uniform(random, -CAIRN_REAL(0.1), CAIRN_REAL(0.1));
    pose.y += cairn_random_uniform(random, -CAIRN_REAL(0.1), CAIRN_REAL(0.1));
    pose.theta += cairn_random_uniform(random, -CAIRN_REAL(0.05), CAIRN_REAL(0.05));
    return pose;
}

/* Six scans of the corner of a room, some walls longer than others, aligned by 20 iterations;
 * past: share of the walls beyond the corner. */
static uint64_t align_corners(cairn_force_field_params params, cairn_real past)
{
    enum { SCANS = 6, WALLS = 2, POINTS = 12 };
    static _Alignas(CAIRN_ALIGN) unsigned char
        memory[CAIRN_FORCE_FIELD_BYTES(SCANS, SCANS * WALLS * POINTS, SCANS * WALLS, 128)];
    static const int32_t first_point[WALLS + 1] = {0, POINTS, WALLS * POINTS};
    cairn_random random = cairn_random_seed(5, 1);
    cairn_force_field_state state;
    cairn_force_field *field;
    cairn_pool pool;
    uint64_t hash = GOLDEN_START;

    params.max_scans = SCANS;
    params.max_segments = SCANS * WALLS;
    params.max_points = SCANS * WALLS * POINTS;
    params.max_corners = 128;
    params.max_steps = 20;
    if (cairn_pool_init(&pool, memory, sizeof memory) != CAIRN_OK ||
        cairn_force_field_create(&field, &pool, &params) != CAIRN_OK)
        return 0;
    for (int i = 0; i < SCANS; i++) {
        cairn_oriented_point points[WALLS * POINTS];
        cairn_segment walls[WALLS];
        cairn_scan_view view = {0};
        cairn_real size = 1 + argument(&random, CAIRN_REAL(0.3), 0);
        cairn_pose pose = {argument(&random, CAIRN_REAL(0.1), 0), 0, 0};

        pose.y = argument(&random, CAIRN_REAL(0.1), 0);
        pose.theta = argument(&random, CAIRN_REAL(0.1), 0);
        for (int k = 0; k < WALLS * POINTS; k++) {
            cairn_real place = size * (cairn_real)(k % POINTS) / (POINTS - 1);
            cairn_oriented_point upward = {{0, place - size}, {0, 1}},
                                 leftward = {{-place, 0}, {-1, 0}};

            upward.position.y += past * size;
            leftward.position.x += past * size;
            points[k] = k < POINTS ? upward : leftward;
        }
        for (int k = 0; k < WALLS; k++) {
            walls[k].a = points[k * POINTS].position;
            walls[k].b = points[(k + 1) * POINTS - 1].position;
        }
        view.segments = walls;
        view.first_point = first_point;
        view.points = points;
        view.segment_count = WALLS;
        view.point_count = WALLS * POINTS;
        view.sensor.x = view.sensor.y = -1;
        if (cairn_force_field_add_scan(field, &view, NULL, pose, NULL) != CAIRN_OK)
            return 0;
    }
    do {
        cairn_budget budget = {1000};

        if (cairn_force_field_step(field, &budget) < 0)
            return 0;
        state = cairn_force_field_read(field);
    } while (state.verdict == CAIRN_FORCE_FIELD_RUNNING);
    for (int i = 0; i < SCANS; i++)
        hash = add_pose(hash, cairn_force_field_pose(field, i));
    return add_real(hash, state.potential);
}

uint64_t golden_force_field(void)
{
    return align_corners(cairn_force_field_default(), 0);
}

/* X crossings. */
uint64_t golden_force_field_as_written(void)
{
    return align_corners(cairn_force_field_as_written(), CAIRN_REAL(0.375));
}

/* All cells of a grid. */
static uint64_t add_cells(uint64_t hash, const cairn_occupancy_grid *grid)
{
    cairn_occupancy_grid_params params = cairn_occupancy_grid_read(grid);

    for (int32_t y = 0; y < params.height; y++)
        for (int32_t x = 0; x < params.width; x++) {
            cairn_occupancy_grid_cell_state cell = cairn_occupancy_grid_cell(grid, x, y);

            hash = add_bytes(hash, &cell, sizeof cell);
        }
    return hash;
}

uint64_t golden_scans_and_grid(void)
{
    cairn_occupancy_grid_params params = cairn_occupancy_grid_default();
    cairn_random random = cairn_random_seed(6, 1);
    cairn_occupancy_grid *grid;
    cairn_scan *scan;
    cairn_pool pool;
    uint64_t hash = GOLDEN_START;

    params.width = params.height = 64;
    params.resolution = CAIRN_REAL(0.125);
    params.origin.x = params.origin.y = -1;
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        (scan = golden_new_scan(&pool)) == NULL ||
        cairn_occupancy_grid_create(&grid, &pool, &params) != CAIRN_OK)
        return 0;
    for (int i = 0; i < 4; i++) {
        static golden_sweep s;
        cairn_pose pose = {1 + (cairn_real)i / 2, 2, (cairn_real)i};
        cairn_scan_view view;
        cairn_status status;

        golden_make_sweep(&s, &random, pose);
        if (!golden_fit_sweep(scan, &s))
            return 0;
        view = cairn_scan_read(scan);
        for (int32_t k = 0; k < view.point_count; k++)
            hash = add_point(add_point(hash, view.points[k].position), view.points[k].direction);
        status = cairn_occupancy_grid_begin_scan(grid, view.beams, view.beam_count, pose, NULL);
        while (status == CAIRN_OK || status == CAIRN_MORE) {
            cairn_budget budget = {100};

            status = cairn_occupancy_grid_step(grid, &budget);
            if (status == CAIRN_OK)
                break;
        }
        if (status != CAIRN_OK)
            return 0;
    }
    return add_cells(hash, grid);
}

/* Sweeps at their poses, of which every fifth beam is lost and passes the walls. */
uint64_t golden_scans_mapped(void)
{
    enum { SCANS = 3 };
    cairn_occupancy_grid_params layout = cairn_occupancy_grid_default();
    cairn_scan_map_params params = cairn_scan_map_default();
    cairn_random random = cairn_random_seed(22, 1);
    cairn_budget budget = {INT32_MAX};
    cairn_scan_map_scan scans[SCANS];
    static float ends[SCANS][2 * GOLDEN_BEAMS];
    static uint8_t hits[SCANS][GOLDEN_BEAMS];
    cairn_occupancy_grid *grid;
    cairn_scan_map *map;
    cairn_pool pool;

    layout.width = layout.height = 64;
    layout.resolution = CAIRN_REAL(0.125);
    layout.origin.x = layout.origin.y = -1;
    params.max_cells = 64 * 64;
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        cairn_occupancy_grid_create(&grid, &pool, &layout) != CAIRN_OK ||
        cairn_scan_map_create(&map, &pool, &params) != CAIRN_OK)
        return 0;
    for (int32_t s = 0; s < SCANS; s++) {
        cairn_pose pose = {1 + (cairn_real)s / 2, 2, (cairn_real)s};
        golden_sweep sweep;

        golden_make_sweep(&sweep, &random, pose);
        for (int32_t i = 0; i < GOLDEN_BEAMS; i++) {
            cairn_real sine, cosine, range = i % 5 == 0 ? 4 : (cairn_real)sweep.range[i];

            cairn_sincos((cairn_real)(sweep.input.angle_min + (float)i * sweep.input.angle_step),
                         &sine, &cosine);
            ends[s][2 * i] = (float)(range * cosine);
            ends[s][2 * i + 1] = (float)(range * sine);
            hits[s][i] = i % 5 != 0;
        }
        scans[s] = (cairn_scan_map_scan){
            .map_scan = pose, .ends = ends[s], .hits = hits[s], .beam_count = GOLDEN_BEAMS};
    }
    if (cairn_scan_map_begin(map, grid, scans, SCANS, NULL) != CAIRN_OK ||
        cairn_scan_map_step(map, &budget) != CAIRN_OK)
        return 0;
    return add_cells(GOLDEN_START, grid);
}

/* One sweep matched with another: by icp from a guess, by scan_match without. */
uint64_t golden_matches(void)
{
    cairn_random random = cairn_random_seed(7, 1);
    cairn_pose first = {2, 2, 0}, second = {CAIRN_REAL(2.3), CAIRN_REAL(1.8), CAIRN_REAL(0.4)},
               guess = {0, 0, 0};
    cairn_scan_match_params match_params = cairn_scan_match_default();
    cairn_icp_params icp_params = cairn_icp_default();
    cairn_scan_match_result found;
    cairn_scan_match_part part;
    cairn_scan_view view[2];
    cairn_icp_result result;
    cairn_scan_match *match;
    cairn_scan *scan[2];
    cairn_budget budget = {INT32_MAX};
    cairn_icp *icp;
    cairn_pool pool;
    uint64_t hash = GOLDEN_START;
    static golden_sweep s;

    icp_params.max_target = 512;
    match_params.max_target = match_params.max_query = 256;
    match_params.max_dense = 256;
    match_params.max_views = 1;
    match_params.max_hypotheses = 4;
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        (scan[0] = golden_new_scan(&pool)) == NULL || (scan[1] = golden_new_scan(&pool)) == NULL ||
        cairn_icp_create(&icp, &pool, &icp_params) != CAIRN_OK ||
        cairn_scan_match_create(&match, &pool, &match_params) != CAIRN_OK)
        return 0;
    for (int i = 0; i < 2; i++) {
        golden_make_sweep(&s, &random, i == 0 ? first : second);
        if (!golden_fit_sweep(scan[i], &s))
            return 0;
        view[i] = cairn_scan_read(scan[i]);
    }
    if (cairn_icp_add_target(icp, view[0].points, view[0].point_count, guess, NULL) != CAIRN_OK)
        return 0;
    guess.x = CAIRN_REAL(0.2);
    guess.theta = CAIRN_REAL(0.3);
    if (cairn_icp_begin(icp, view[1].points, view[1].point_count, guess, NULL, NULL) != CAIRN_OK ||
        cairn_icp_step(icp, &budget) != CAIRN_OK)
        return 0;
    result = cairn_icp_read(icp);
    hash = add_covariance(add_pose(hash, result.target_query), result.covariance);
    part = cairn_scan_match_part_of(&view[0]);
    if (cairn_scan_match_add_target(match, &part, cairn_pose_identity(), NULL) != CAIRN_OK)
        return 0;
    part = cairn_scan_match_part_of(&view[1]);
    budget.left = INT32_MAX;
    if (cairn_scan_match_begin(match, &part, guess, NULL, NULL) != CAIRN_OK ||
        cairn_scan_match_step(match, &budget) != CAIRN_OK)
        return 0;
    found = cairn_scan_match_read(match);
    hash = add_bytes(hash, &found.verdict, sizeof found.verdict);
    for (int32_t i = 0; i < found.count; i++) {
        hash = add_covariance(add_pose(hash, found.hypotheses[i].target_query),
                              found.hypotheses[i].covariance);
        hash = add_real(hash, found.hypotheses[i].score);
    }
    return hash;
}

static uint64_t add_estimate(uint64_t hash, cairn_scanner_check_value estimate)
{
    hash = add_real(add_real(hash, estimate.value), estimate.sigma);
    return add_bytes(hash, &estimate.is_known, sizeof estimate.is_known);
}

/* The set-up of the scanner of a drive, whose odometry is the truth. */
uint64_t golden_scanner_checked(void)
{
    enum { SCANS = 14 };
    cairn_scanner_check_params params = cairn_scanner_check_default();
    cairn_random random = cairn_random_seed(21, 1);
    cairn_budget budget = {INT32_MAX};
    cairn_scanner_check_scan *scans;
    cairn_scanner_check_result found;
    cairn_scanner_check *check;
    golden_sweep *sweeps;
    cairn_pool pool;
    uint64_t hash = GOLDEN_START;

    params.max_beams = GOLDEN_BEAMS;
    params.max_points = 256;
    params.max_segments = 64;
    params.max_pairs = SCANS;
    params.max_walls = 8;
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        (sweeps = cairn_pool_take(&pool, SCANS, sizeof *sweeps)) == NULL ||
        (scans = cairn_pool_take(&pool, SCANS, sizeof *scans)) == NULL ||
        cairn_scanner_check_create(&check, &pool, &params) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < SCANS; i++) {
        const cairn_pose pose = {1 + CAIRN_REAL(0.1) * (cairn_real)i, CAIRN_REAL(2.5),
                                 CAIRN_REAL(0.25) * (cairn_real)i};

        golden_make_sweep(&sweeps[i], &random, pose);
        scans[i].input = sweeps[i].input;
        scans[i].input.stamp_ns = i * INT64_C(500000000);
        scans[i].robot = pose;
    }
    if (cairn_scanner_check_begin(check, scans, SCANS, 1, NULL) != CAIRN_OK ||
        cairn_scanner_check_step(check, &budget) != CAIRN_OK)
        return 0;
    found = cairn_scanner_check_read(check);
    if (found.pairs == 0 || found.walls == 0)
        return 0;
    hash = add_bytes(hash, &found.pairs, sizeof found.pairs);
    hash = add_bytes(hash, &found.walls, sizeof found.walls);
    hash = add_real(add_real(hash, found.median_range), found.range_scale);
    hash = add_estimate(add_estimate(hash, found.turn), found.step);
    hash = add_estimate(add_estimate(hash, found.sweep_found), found.distance);
    hash = add_estimate(add_estimate(hash, found.turn_scale), found.theta);
    return add_estimate(add_estimate(hash, found.x), found.y);
}

/* The angle step of a scanner whose bearings are stretched, from true poses. */
uint64_t golden_angle_step_estimated(void)
{
    enum { SCANS = 40 };
    cairn_angle_step_params params = cairn_angle_step_default();
    cairn_random random = cairn_random_seed(23, 1);
    cairn_budget budget = {INT32_MAX};
    cairn_scanner_check_scan *scans;
    cairn_angle_step_result found;
    cairn_angle_step *angle_step;
    golden_sweep *sweeps;
    cairn_pool pool;

    params.max_beams = GOLDEN_BEAMS;
    params.max_pairs = 2 * SCANS;
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        (sweeps = cairn_pool_take(&pool, SCANS, sizeof *sweeps)) == NULL ||
        (scans = cairn_pool_take(&pool, SCANS, sizeof *scans)) == NULL ||
        cairn_angle_step_create(&angle_step, &pool, &params) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < SCANS; i++) {
        const cairn_pose pose = {1 + CAIRN_REAL(0.04) * (cairn_real)i,
                                 CAIRN_REAL(2.2) + CAIRN_REAL(0.1) * (cairn_real)(i % 8),
                                 CAIRN_REAL(0.7) * (cairn_real)i};

        golden_make_sweep(&sweeps[i], &random, pose);
        scans[i].input = sweeps[i].input;
        scans[i].input.angle_step *= 1.004f;
        scans[i].robot = pose;
    }
    if (cairn_angle_step_begin(angle_step, scans, SCANS, NULL) != CAIRN_OK ||
        cairn_angle_step_step(angle_step, &budget) != CAIRN_OK)
        return 0;
    found = cairn_angle_step_read(angle_step);
    if (!found.ratio.is_known)
        return 0;
    return add_estimate(add_bytes(GOLDEN_START, &found.pairs, sizeof found.pairs), found.ratio);
}

/* All sweeps at once by lum, their redundancy, and the errors of the poses. */
uint64_t golden_links_and_cover(void)
{
    cairn_scan_set_params set_params = {.max_scans = GOLDEN_VIEWS,
                                        .max_segments = GOLDEN_VIEWS * 64,
                                        .max_points = GOLDEN_VIEWS * 256,
                                        .spacing = 0};
    cairn_scan_redundancy_params cover_params = cairn_scan_redundancy_default();
    cairn_lum_params lum_params = cairn_lum_default();
    cairn_random random = cairn_random_seed(10, 1);
    cairn_budget budget = {INT32_MAX};
    cairn_pose pose[GOLDEN_VIEWS], truth[GOLDEN_VIEWS];
    cairn_scan_redundancy *cover;
    cairn_map_quality_pose_errors errors;
    cairn_scan_set *set;
    cairn_scan *scan;
    cairn_lum *lum;
    cairn_pool pool;
    uint64_t hash = GOLDEN_START;

    lum_params.max_scans = cover_params.max_scans = GOLDEN_VIEWS;
    lum_params.max_points = cover_params.max_points = GOLDEN_VIEWS * 256;
    lum_params.max_links = lum_params.max_fill = GOLDEN_VIEWS * GOLDEN_VIEWS;
    lum_params.max_iterations = 8;
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        (scan = golden_new_scan(&pool)) == NULL ||
        cairn_scan_set_create(&set, &pool, &set_params) != CAIRN_OK ||
        cairn_scan_redundancy_create(&cover, &pool, &cover_params) != CAIRN_OK ||
        cairn_lum_create(&lum, &pool, &lum_params) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < GOLDEN_VIEWS; i++) {
        static golden_sweep s;
        cairn_scan_view view;

        truth[i] = golden_view_pose(i);
        pose[i] = golden_thought_pose(&random, i);
        golden_make_sweep(&s, &random, truth[i]);
        if (!golden_fit_sweep(scan, &s))
            return 0;
        view = cairn_scan_read(scan);
        if (cairn_scan_set_add(set, &view, NULL, NULL) != CAIRN_OK ||
            cairn_lum_add_scan(lum, view.points, view.point_count, pose[i], NULL) != CAIRN_OK)
            return 0;
    }
    if (cairn_lum_begin(lum) != CAIRN_OK || cairn_lum_step(lum, &budget) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < GOLDEN_VIEWS; i++)
        hash = add_pose(hash, pose[i] = cairn_lum_pose(lum, i));
    budget.left = INT32_MAX;
    if (cairn_scan_redundancy_begin(cover, set, pose) != CAIRN_OK ||
        cairn_scan_redundancy_step(cover, &budget) != CAIRN_OK ||
        cairn_map_quality_pose_errors_of(pose, truth, GOLDEN_VIEWS, &errors) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < GOLDEN_VIEWS; i++)
        hash = add_real(hash, cairn_scan_redundancy_loss(cover, i));
    hash = add_real(add_real(add_real(hash, errors.x), errors.y), errors.theta);
    return add_real(hash, cairn_lum_read(lum).chi2);
}

/* The same sweeps by the aligner, with its covariances. */
uint64_t golden_aligned(void)
{
    cairn_aligner_params params = cairn_aligner_default();
    cairn_random random = cairn_random_seed(10, 1);
    cairn_budget budget = {INT32_MAX};
    cairn_aligner *aligner;
    cairn_scan *scan;
    cairn_pool pool;
    uint64_t hash = GOLDEN_START;

    params.max_scans = GOLDEN_VIEWS;
    params.max_points = GOLDEN_VIEWS * 256;
    params.max_segments = GOLDEN_VIEWS * 64;
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        (scan = golden_new_scan(&pool)) == NULL ||
        cairn_aligner_create(&aligner, &pool, &params) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < GOLDEN_VIEWS; i++) {
        static golden_sweep s;
        cairn_pose pose = golden_thought_pose(&random, i);
        cairn_scan_view view;

        golden_make_sweep(&s, &random, golden_view_pose(i));
        if (!golden_fit_sweep(scan, &s))
            return 0;
        view = cairn_scan_read(scan);
        if (cairn_aligner_add_scan(aligner, &view, pose, NULL) != CAIRN_OK)
            return 0;
    }
    if (cairn_aligner_begin(aligner) != CAIRN_OK ||
        cairn_aligner_step(aligner, &budget) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < GOLDEN_VIEWS; i++) {
        cairn_aligner_pose pose = cairn_aligner_pose_of(aligner, i);

        hash = add_covariance(add_pose(hash, pose.map_scan), pose.covariance);
    }
    return hash;
}
