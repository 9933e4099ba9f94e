/* One line per scene, "name hash": what tools/check-bits.sh compares between compilers and options, and
 * tools/firmware-test.sh between machines. A scene computes with seeded inputs and hashes all bits of its results; a NaN is
 * never hashed. Prints through the board, so that it runs on a bare microcontroller, too. */
#include "src/core/build.h"

#include <string.h>

#include "cairn/aligner.h"
#include "cairn/force_field.h"
#include "cairn/geometry.h"
#include "cairn/icp.h"
#include "cairn/lum.h"
#include "cairn/map_quality.h"
#include "cairn/occupancy_grid.h"
#include "cairn/pool.h"
#include "cairn/pose_consensus.h"
#include "cairn/pose_graph.h"
#include "cairn/random.h"
#include "cairn/scan_cover.h"
#include "cairn/scan_match.h"
#include "cairn/small_matrix.h"
#include "firmware/board.h"

typedef uint64_t (*scene)(void);

/* FNV-1a over the bytes of a value. */
static uint64_t add_bytes(uint64_t hash, const void *data, size_t bytes)
{
    const unsigned char *byte = data;

    for (size_t i = 0; i < bytes; i++)
        hash = (hash ^ byte[i]) * UINT64_C(1099511628211);
    return hash;
}

static uint64_t add_real(uint64_t hash, cairn_real x)
{
    return x == x ? add_bytes(hash, &x, sizeof x) : add_bytes(hash, "nan", 3);
}

static const uint64_t START = UINT64_C(14695981039346656037);

/* 0: uniform within +-size; else a factor 2^-30 ... 2^30 on top. */
static cairn_real argument(cairn_random *random, cairn_real size, int wide)
{
    cairn_real x = cairn_random_uniform(random, -size, size);
    int32_t doublings = wide ? cairn_random_below(random, 61) - 30 : 0;

    for (; doublings > 0; doublings--)
        x *= 2;
    for (; doublings < 0; doublings++)
        x /= 2;
    return x;
}

static uint64_t elementary_functions(void)
{
    cairn_random random = cairn_random_seed(1, 1);
    uint64_t hash = START;

    for (int i = 0; i < 40000; i++) {
        cairn_real a = argument(&random, 100, 0), b = argument(&random, 4, i & 1), sine, cosine;

        cairn_sincos(a, &sine, &cosine);
        hash = add_real(hash, sine);
        hash = add_real(hash, cosine);
        hash = add_real(hash, cairn_sin(b));
        hash = add_real(hash, cairn_cos(b));
        hash = add_real(hash, cairn_atan2(a, b));
        hash = add_real(hash, cairn_exp(a));
        hash = add_real(hash, cairn_exp(b));
        hash = add_real(hash, cairn_log(cairn_abs(b)));
        hash = add_real(hash, cairn_erfc(b));
        hash = add_real(hash, cairn_wrap_angle(a));
        hash = add_real(hash, cairn_sqrt(cairn_abs(a)));
        hash = add_real(hash, (cairn_real)cairn_real_to_int(a));
    }
    return hash;
}

static uint64_t random_numbers(void)
{
    cairn_random random = cairn_random_seed(2, 1);
    uint64_t hash = START;

    for (int i = 0; i < 20000; i++) {
        uint32_t bits = cairn_random_bits(&random);

        hash = add_bytes(hash, &bits, sizeof bits);
        hash = add_real(hash, cairn_random_unit(&random));
        hash = add_real(hash, cairn_random_uniform(&random, -3, 7));
        hash = add_real(hash, cairn_random_normal(&random));
        hash = add_real(hash, (cairn_real)cairn_random_below(&random, 1000));
    }
    return hash;
}

static cairn_vec2 random_point(cairn_random *random)
{
    cairn_real x = argument(random, 10, 0);
    cairn_real y = argument(random, 10, 0);
    cairn_vec2 point = {x, y};

    return point;
}

static cairn_pose random_pose(cairn_random *random)
{
    cairn_vec2 p = random_point(random);
    cairn_pose pose = {p.x, p.y, argument(random, CAIRN_PI, 0)};

    return pose;
}

static uint64_t add_pose(uint64_t hash, cairn_pose pose)
{
    return add_real(add_real(add_real(hash, pose.x), pose.y), pose.theta);
}

static uint64_t add_point(uint64_t hash, cairn_vec2 point)
{
    return add_real(add_real(hash, point.x), point.y);
}

static uint64_t poses_and_segments(void)
{
    cairn_random random = cairn_random_seed(3, 1);
    uint64_t hash = START;
    cairn_pose walk = cairn_pose_identity();

    for (int i = 0; i < 5000; i++) {
        cairn_pose a = random_pose(&random), b = random_pose(&random);
        cairn_segment s, t;
        cairn_vec2 corners[4], point;
        cairn_real parameter;

        walk = cairn_pose_compose(walk, a);
        hash = add_pose(hash, walk);
        hash = add_pose(hash, cairn_pose_inverse(a));
        hash = add_pose(hash, cairn_pose_between(a, b));
        for (int k = 0; k < 4; k++)
            corners[k] = random_point(&random);
        s.a = corners[0], s.b = corners[1], t.a = corners[2], t.b = corners[3];
        hash = add_point(hash, cairn_segment_nearest(s, corners[2], &parameter));
        hash = add_real(hash, parameter);
        hash = add_real(hash, cairn_segment_distance(t, corners[0]));
        if (cairn_line_intersection(s, t, &point))
            hash = add_point(hash, point);
        hash = add_real(hash, (cairn_real)cairn_segments_cross(s, t));
        hash = add_real(hash, cairn_polygon_area(corners, 4));
        hash = add_point(hash, cairn_vec2_unit(corners[3]));
    }
    return hash;
}

static uint64_t small_matrices(void)
{
    cairn_random random = cairn_random_seed(4, 1);
    uint64_t hash = START;

    for (int i = 0; i < 5000; i++) {
        cairn_sym3 m = cairn_sym3_zero(), inverse;
        cairn_sym2 small;
        cairn_real values[3], vectors[3][3], v[3], x[3];
        cairn_vec2 minor, major;

        for (int k = 0; k < 4; k++) {
            for (int c = 0; c < 3; c++)
                v[c] = argument(&random, 3, 0);
            cairn_sym3_add_outer(&m, v, 1);
        }
        small.xx = m.xx, small.xy = m.xy, small.yy = m.yy;
        cairn_sym2_eigen(small, values, &minor, &major);
        hash = add_point(add_point(hash, minor), major);
        hash = add_real(add_real(hash, values[0]), values[1]);
        if (cairn_sym3_solve(m, v, x))
            for (int k = 0; k < 3; k++)
                hash = add_real(hash, x[k]);
        if (cairn_sym3_inverse(m, &inverse))
            hash = add_real(add_real(hash, inverse.xy), inverse.zz);
        cairn_sym3_eigen(m, values, vectors);
        for (int k = 0; k < 9; k++)
            hash = add_real(hash, vectors[k / 3][k % 3]);
        for (int k = 0; k < 3; k++)
            hash = add_real(hash, values[k]);
    }
    return hash;
}

/* Six scans of the corner of a room, some walls longer than others, aligned by 20 iterations. */
static uint64_t force_field(void)
{
    enum { SCANS = 6, WALLS = 2, POINTS = 12 };
    static _Alignas(
        CAIRN_ALIGN) unsigned char memory[CAIRN_FORCE_FIELD_BYTES(SCANS, SCANS * WALLS * POINTS, SCANS * WALLS, 128)];
    static const int32_t first_point[WALLS + 1] = {0, POINTS, WALLS * POINTS};
    cairn_force_field_params params = cairn_force_field_default();
    cairn_random random = cairn_random_seed(5, 1);
    cairn_force_field_state state;
    cairn_force_field *field;
    cairn_pool pool;
    uint64_t hash = START;

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
            cairn_oriented_point upward = {{0, place - size}, {0, 1}}, leftward = {{-place, 0}, {-1, 0}};

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

/* ---- Sweeps of a room with a niche, seen by a scanner that turns while it sweeps ---- */

enum { BEAMS = 181 };

/* Distance along a direction to the walls of a room of 6 x 4 m, or of the box at (3.5, 0) of 1 x 1.2 m that stands in it. */
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

        if (cairn_segments_cross(beam, wall[i]) && cairn_line_intersection(beam, wall[i], &hit)) {
            cairn_real range = cairn_sqrt((hit.x - x) * (hit.x - x) + (hit.y - y) * (hit.y - y));

            nearest = cairn_min(nearest, range);
        }
    }
    return nearest;
}

typedef struct sweep {
    float range[BEAMS];
    cairn_scan_input input;
} sweep;

static void make_sweep(sweep *out, cairn_random *random, cairn_pose pose)
{
    memset(&out->input, 0, sizeof out->input);
    for (int i = 0; i < BEAMS; i++) {
        cairn_real s, c, range;

        cairn_sincos(pose.theta + (cairn_real)(i - 90) * CAIRN_REAL(0.03125), &s, &c);
        range = room_range(pose.x, pose.y, c, s) + cairn_random_uniform(random, -CAIRN_REAL(0.01), CAIRN_REAL(0.01));
        out->range[i] = i % 50 == 49 ? 0 : (float)range;
    }
    out->input.range = out->range;
    out->input.count = BEAMS;
    out->input.angle_min = -90 * 0.03125f;
    out->input.angle_step = 0.03125f;
    out->input.range_max = 8;
    out->input.range_sigma = 0.01f;
    out->input.motion.theta = CAIRN_REAL(0.002);
}

static _Alignas(CAIRN_ALIGN) unsigned char scene_memory[900 * 1024];

/* A fitted sweep; its view stays until the next one of the same object. */
static int fit_sweep(cairn_scan *scan, const sweep *s)
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

static cairn_scan *new_scan(cairn_pool *pool)
{
    cairn_scan_params params = cairn_scan_default();
    cairn_scan *scan = NULL;

    params.max_beams = BEAMS;
    params.max_segments = 64;
    params.max_points = 256;
    return cairn_scan_create(&scan, pool, &params) == CAIRN_OK ? scan : NULL;
}

static uint64_t scans_and_grid(void)
{
    cairn_occupancy_grid_params params = cairn_occupancy_grid_default();
    cairn_random random = cairn_random_seed(6, 1);
    cairn_occupancy_grid *grid;
    cairn_scan *scan;
    cairn_pool pool;
    uint64_t hash = START;

    params.width = params.height = 64;
    params.resolution = CAIRN_REAL(0.125);
    params.origin.x = params.origin.y = -1;
    if (cairn_pool_init(&pool, scene_memory, sizeof scene_memory) != CAIRN_OK || (scan = new_scan(&pool)) == NULL ||
        cairn_occupancy_grid_create(&grid, &pool, &params) != CAIRN_OK)
        return 0;
    for (int i = 0; i < 4; i++) {
        static sweep s;
        cairn_pose pose = {1 + (cairn_real)i / 2, 2, (cairn_real)i};
        cairn_scan_view view;
        cairn_status status;

        make_sweep(&s, &random, pose);
        if (!fit_sweep(scan, &s))
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
    for (int32_t y = 0; y < params.height; y++)
        for (int32_t x = 0; x < params.width; x++) {
            cairn_occupancy_cell cell = cairn_occupancy_grid_cell(grid, x, y);

            hash = add_bytes(hash, &cell, sizeof cell);
        }
    return hash;
}

static uint64_t add_covariance(uint64_t hash, const cairn_real *covariance)
{
    for (int k = 0; k < 9; k++)
        hash = add_real(hash, covariance[k]);
    return hash;
}

/* One sweep matched against another: with a guess by icp, with none by scan_match. */
static uint64_t matches(void)
{
    cairn_random random = cairn_random_seed(7, 1);
    cairn_pose first = {2, 2, 0}, second = {CAIRN_REAL(2.3), CAIRN_REAL(1.8), CAIRN_REAL(0.4)}, guess = {0, 0, 0};
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
    uint64_t hash = START;
    static sweep s;

    icp_params.max_target = 512;
    match_params.max_target = match_params.max_query = 256;
    match_params.max_dense = 256;
    match_params.max_views = 1;
    match_params.max_hypotheses = 4;
    if (cairn_pool_init(&pool, scene_memory, sizeof scene_memory) != CAIRN_OK || (scan[0] = new_scan(&pool)) == NULL ||
        (scan[1] = new_scan(&pool)) == NULL || cairn_icp_create(&icp, &pool, &icp_params) != CAIRN_OK ||
        cairn_scan_match_create(&match, &pool, &match_params) != CAIRN_OK)
        return 0;
    for (int i = 0; i < 2; i++) {
        make_sweep(&s, &random, i == 0 ? first : second);
        if (!fit_sweep(scan[i], &s))
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
        hash = add_covariance(add_pose(hash, found.hypotheses[i].target_query), found.hypotheses[i].covariance);
        hash = add_real(hash, found.hypotheses[i].score);
    }
    return hash;
}

/* Where sweeps of the room are taken, and where they are thought to be. */
enum { VIEWS = 5 };

static cairn_pose view_pose(int32_t i)
{
    cairn_pose pose = {1 + (cairn_real)i * CAIRN_REAL(0.5), CAIRN_REAL(2.5), (cairn_real)i * CAIRN_REAL(0.4)};

    return pose;
}

static cairn_pose thought_pose(cairn_random *random, int32_t i)
{
    cairn_pose pose = view_pose(i);

    pose.x += cairn_random_uniform(random, -CAIRN_REAL(0.1), CAIRN_REAL(0.1));
    pose.y += cairn_random_uniform(random, -CAIRN_REAL(0.1), CAIRN_REAL(0.1));
    pose.theta += cairn_random_uniform(random, -CAIRN_REAL(0.05), CAIRN_REAL(0.05));
    return pose;
}

/* All sweeps at once by lum, how they cover each other, and how far the poses are off. */
static uint64_t links_and_cover(void)
{
    cairn_scan_set_params set_params = {VIEWS, VIEWS * 64, VIEWS * 256, 0};
    cairn_scan_cover_params cover_params = cairn_scan_cover_default();
    cairn_lum_params lum_params = cairn_lum_default();
    cairn_random random = cairn_random_seed(10, 1);
    cairn_budget budget = {INT32_MAX};
    cairn_pose pose[VIEWS], truth[VIEWS];
    cairn_scan_cover *cover;
    cairn_pose_errors errors;
    cairn_scan_set *set;
    cairn_scan *scan;
    cairn_lum *lum;
    cairn_pool pool;
    uint64_t hash = START;

    lum_params.max_scans = cover_params.max_scans = VIEWS;
    lum_params.max_points = cover_params.max_points = VIEWS * 256;
    lum_params.max_links = lum_params.max_fill = VIEWS * VIEWS;
    lum_params.max_iterations = 8;
    if (cairn_pool_init(&pool, scene_memory, sizeof scene_memory) != CAIRN_OK || (scan = new_scan(&pool)) == NULL ||
        cairn_scan_set_create(&set, &pool, &set_params) != CAIRN_OK ||
        cairn_scan_cover_create(&cover, &pool, &cover_params) != CAIRN_OK ||
        cairn_lum_create(&lum, &pool, &lum_params) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < VIEWS; i++) {
        static sweep s;
        cairn_scan_view view;

        truth[i] = view_pose(i);
        pose[i] = thought_pose(&random, i);
        make_sweep(&s, &random, truth[i]);
        if (!fit_sweep(scan, &s))
            return 0;
        view = cairn_scan_read(scan);
        if (cairn_scan_set_add(set, &view, NULL, NULL) != CAIRN_OK ||
            cairn_lum_add_scan(lum, view.points, view.point_count, pose[i], NULL) != CAIRN_OK)
            return 0;
    }
    if (cairn_lum_begin(lum) != CAIRN_OK || cairn_lum_step(lum, &budget) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < VIEWS; i++)
        hash = add_pose(hash, pose[i] = cairn_lum_pose(lum, i));
    budget.left = INT32_MAX;
    if (cairn_scan_cover_begin(cover, set, pose) != CAIRN_OK || cairn_scan_cover_step(cover, &budget) != CAIRN_OK ||
        cairn_pose_errors_of(pose, truth, VIEWS, &errors) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < VIEWS; i++)
        hash = add_real(hash, cairn_scan_cover_loss(cover, i));
    hash = add_real(add_real(add_real(hash, errors.x), errors.y), errors.theta);
    return add_real(hash, cairn_lum_read(lum).error);
}

/* The same sweeps by the aligner, with its covariances. */
static uint64_t aligned(void)
{
    cairn_aligner_params params = cairn_aligner_default();
    cairn_random random = cairn_random_seed(10, 1);
    cairn_budget budget = {INT32_MAX};
    cairn_aligner *aligner;
    cairn_scan *scan;
    cairn_pool pool;
    uint64_t hash = START;

    params.max_scans = VIEWS;
    params.max_points = VIEWS * 256;
    params.max_segments = VIEWS * 64;
    if (cairn_pool_init(&pool, scene_memory, sizeof scene_memory) != CAIRN_OK || (scan = new_scan(&pool)) == NULL ||
        cairn_aligner_create(&aligner, &pool, &params) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < VIEWS; i++) {
        static sweep s;
        cairn_pose pose = thought_pose(&random, i);
        cairn_scan_view view;

        make_sweep(&s, &random, view_pose(i));
        if (!fit_sweep(scan, &s))
            return 0;
        view = cairn_scan_read(scan);
        if (cairn_aligner_add_scan(aligner, &view, pose, NULL) != CAIRN_OK)
            return 0;
    }
    if (cairn_aligner_begin(aligner) != CAIRN_OK || cairn_aligner_step(aligner, &budget) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < VIEWS; i++) {
        cairn_aligner_pose pose = cairn_aligner_pose_of(aligner, i);

        hash = add_covariance(add_pose(hash, pose.map_scan), pose.covariance);
    }
    return hash;
}

/* A drive round a block, twice, with measurements between neighbours in place, some of them wrong. */
enum { NODES = 24 };

static cairn_pose drive_pose(int32_t i)
{
    cairn_pose pose = cairn_pose_identity(), step = {1, 0, 0};

    for (int32_t k = 0; k < i; k++) {
        step.theta = k % 3 == 2 ? CAIRN_PI / 2 : 0;
        pose = cairn_pose_compose(pose, step);
    }
    return pose;
}

static cairn_pose measured(cairn_random *random, int32_t i, int32_t j)
{
    cairn_pose seen = cairn_pose_between(drive_pose(i), drive_pose(j));

    seen.x += cairn_random_uniform(random, -CAIRN_REAL(0.02), CAIRN_REAL(0.02));
    seen.y += cairn_random_uniform(random, -CAIRN_REAL(0.02), CAIRN_REAL(0.02));
    seen.theta += cairn_random_uniform(random, -CAIRN_REAL(0.01), CAIRN_REAL(0.01));
    return seen;
}

static uint64_t pose_graphs(void)
{
    cairn_pose_graph_params params = cairn_pose_graph_default();
    cairn_random random = cairn_random_seed(8, 1);
    cairn_sym3 information = {2500, 0, 0, 2500, 0, 10000};
    cairn_budget budget = {INT32_MAX};
    cairn_pose_graph *graph;
    cairn_pool pool;
    uint64_t hash = START;

    params.max_poses = NODES;
    params.max_links = 3 * NODES;
    params.max_fill = 12 * NODES;
    params.kernel = CAIRN_POSE_GRAPH_CAUCHY;
    if (cairn_pool_init(&pool, scene_memory, sizeof scene_memory) != CAIRN_OK ||
        cairn_pose_graph_create(&graph, &pool, &params, NULL) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < NODES; i++)
        if (cairn_pose_graph_add_pose(graph, cairn_pose_identity()) != CAIRN_OK)
            return 0;
    for (int32_t i = 0; i < NODES; i++)
        for (int32_t j = i + 1; j < NODES; j++)
            if ((j - i == 1 || j - i == 12) &&
                cairn_pose_graph_add_link(graph, i, j, measured(&random, i, i == 5 && j == 17 ? 9 : j), information) !=
                    CAIRN_OK)
                return 0;
    if (cairn_pose_graph_solve(graph) != CAIRN_OK || cairn_pose_graph_step(graph, &budget) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < NODES; i++)
        hash = add_pose(hash, cairn_pose_graph_pose(graph, i));
    return add_real(hash, cairn_pose_graph_read(graph).chi2);
}

static uint64_t consensus(void)
{
    cairn_pose_consensus_params params = cairn_pose_consensus_default();
    cairn_random random = cairn_random_seed(9, 1);
    cairn_budget budget = {INT32_MAX};
    cairn_pose_consensus *c;
    cairn_pool pool;
    uint64_t hash = START;

    params.max_nodes = NODES;
    params.max_hypotheses = 8 * NODES;
    if (cairn_pool_init(&pool, scene_memory, sizeof scene_memory) != CAIRN_OK ||
        cairn_pose_consensus_create(&c, &pool, &params) != CAIRN_OK || cairn_pose_consensus_clear(c, NODES) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < NODES; i++)
        for (int32_t k = 1; k <= 4; k++) {
            int32_t j = (i + k) % NODES;
            cairn_pose_hypothesis h = {.first = i, .second = j, .score = 5 + (cairn_real)((i * 7 + k) % 5)};

            h.first_second = measured(&random, i, (i + k) % 5 == 0 ? (j + 4) % NODES : j);
            h.covariance[0] = h.covariance[4] = CAIRN_REAL(0.0004);
            h.covariance[8] = CAIRN_REAL(0.0001);
            if (cairn_pose_consensus_add(c, &h, NULL) != CAIRN_OK)
                return 0;
        }
    if (cairn_pose_consensus_begin(c) != CAIRN_OK || cairn_pose_consensus_step(c, &budget) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < NODES; i++) {
        cairn_consensus_node node = cairn_pose_consensus_node(c, i);

        hash = add_real(add_covariance(add_pose(hash, node.map_node), node.covariance), node.support);
    }
    return hash;
}

static const struct {
    const char *name;
    scene run;
} SCENES[] = {
    {"elementary_functions", elementary_functions},
    {"random_numbers", random_numbers},
    {"poses_and_segments", poses_and_segments},
    {"small_matrices", small_matrices},
    {"force_field", force_field},
    {"scans_and_grid", scans_and_grid},
    {"matches", matches},
    {"links_and_cover", links_and_cover},
    {"aligned", aligned},
    {"pose_graphs", pose_graphs},
    {"consensus", consensus},
};

static void print_line(const char *name, uint64_t hash)
{
    char line[64];
    size_t length = strlen(name);

    memcpy(line, name, length);
    line[length++] = ' ';
    for (int shift = 60; shift >= 0; shift -= 4)
        line[length++] = "0123456789abcdef"[hash >> shift & 15];
    line[length++] = '\n';
    line[length] = '\0';
    board_print(line);
}

int main(void)
{
    static _Alignas(CAIRN_ALIGN) unsigned char memory[CAIRN_ALIGN];
    cairn_pool pool;

    if (cairn_pool_init(&pool, memory, sizeof memory) != CAIRN_OK) {
        board_print("this build does not compute faithfully\n");
        return 1;
    }
    for (size_t i = 0; i < sizeof SCENES / sizeof *SCENES; i++)
        print_line(SCENES[i].name, SCENES[i].run());
    return 0;
}
