/* Golden scenes of mapping: lines and rectangles, particles, registration, hypotheses, place maps,
 * merged maps. */
#include "src/base/build.h"

#include "cairn/filter_mapper.h"
#include "cairn/hough.h"
#include "cairn/lum.h"
#include "cairn/map_merge.h"
#include "cairn/map_vote.h"
#include "cairn/mapper.h"
#include "cairn/particle_filter.h"
#include "cairn/place_map.h"
#include "cairn/ellipse.h"
#include "cairn/rectangle.h"
#include "cairn/virtual_align.h"
#include "tests/golden.h"

static cairn_budget unbounded(void)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    return budget;
}

/* ---- Lines and rectangles ---- */

enum { ROOMS = 2, WALLS = 4 * ROOMS, WALL_POINTS = 40 };

/* The walls of two adjacent rooms, one slightly rotated, with their free sides inside. */
static cairn_segment wall_of(int32_t i)
{
    static const cairn_vec2 corner[4] = {{0, 0}, {4, 0}, {4, 3}, {0, 3}};
    int32_t which = i / 4;
    cairn_pose room = {5 * (cairn_real)which, 0, CAIRN_REAL(0.1) * (cairn_real)which};
    cairn_transform map_room = cairn_transform_of(room);
    cairn_segment wall = {cairn_transform_point(map_room, corner[i % 4]),
                          cairn_transform_point(map_room, corner[(i + 1) % 4])};

    return wall;
}

static cairn_vec2 along(cairn_segment s, cairn_real share)
{
    return cairn_vec2_add(s.a, cairn_vec2_scale(cairn_vec2_sub(s.b, s.a), share));
}

static uint64_t add_line(uint64_t hash, const cairn_hough_line *line)
{
    hash = add_point(add_point(hash, line->point), line->direction);
    hash = add_real(add_real(add_real(hash, line->low), line->high), line->covered_length);
    return add_real(add_real(hash, line->votes), line->rms);
}

static uint64_t add_rectangle(uint64_t hash, const cairn_rectangle *r)
{
    hash = add_real(add_real(add_pose(hash, r->centre), r->half_length), r->half_width);
    hash = add_real(add_real(hash, r->coverage), r->score);
    return add_bytes(add_bytes(hash, &r->kind, sizeof r->kind), r->side, sizeof r->side);
}

uint64_t golden_lines_and_rectangles(void)
{
    static cairn_oriented_point points[WALLS * WALL_POINTS];
    cairn_hough_params hough_params = cairn_hough_default();
    cairn_rectangle_params rectangle_params = cairn_rectangle_default();
    cairn_random random = cairn_random_seed(11, 1);
    cairn_budget budget = unbounded();
    cairn_segment pieces[2 * WALLS];
    const cairn_rectangle *rectangles;
    const cairn_hough_line *lines;
    cairn_rectangle_set *set;
    cairn_hough *hough;
    cairn_pool pool;
    uint64_t hash = GOLDEN_START;
    int32_t count;

    for (int32_t i = 0; i < WALLS; i++) {
        cairn_segment wall = wall_of(i);
        cairn_vec2 direction = cairn_vec2_unit(cairn_vec2_sub(wall.b, wall.a)),
                   left = cairn_vec2_left_perp(direction);

        /* Two segments of each wall, with a gap. */
        for (int32_t k = 0; k < 2; k++) {
            cairn_real from =
                CAIRN_REAL(0.6) * (cairn_real)k + argument(&random, CAIRN_REAL(0.05), 0);

            pieces[2 * i + k].a = along(wall, from);
            pieces[2 * i + k].b = along(wall, from + CAIRN_REAL(0.35));
        }
        for (int32_t k = 0; k < WALL_POINTS; k++) {
            cairn_vec2 p = along(wall, (cairn_real)k / (WALL_POINTS - 1));

            points[i * WALL_POINTS + k].position =
                cairn_vec2_add(p, cairn_vec2_scale(left, argument(&random, CAIRN_REAL(0.02), 0)));
            points[i * WALL_POINTS + k].direction = direction;
        }
    }
    hough_params.angles = 72;
    hough_params.distances = 128;
    rectangle_params.max_segments = 2 * WALLS;
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        cairn_hough_create(&hough, &pool, &hough_params) != CAIRN_OK ||
        cairn_rectangle_create(&set, &pool, &rectangle_params) != CAIRN_OK ||
        cairn_hough_begin(hough, points, NULL, WALLS * WALL_POINTS) != CAIRN_OK ||
        cairn_hough_step(hough, &budget) != CAIRN_OK ||
        cairn_rectangle_begin(set, pieces, 2 * WALLS) != CAIRN_OK)
        return 0;
    budget = unbounded();
    if (cairn_rectangle_step(set, &budget) != CAIRN_OK)
        return 0;
    lines = cairn_hough_list(hough, &count);
    if (count < WALLS - 2)
        return 0;
    for (int32_t i = 0; i < count; i++)
        hash = add_line(hash, &lines[i]);
    rectangles = cairn_rectangle_list(set, &count);
    if (count < ROOMS)
        return 0;
    for (int32_t i = 0; i < count; i++)
        hash = add_rectangle(hash, &rectangles[i]);
    return hash;
}

/* ---- Ellipses ---- */

enum { ROUND = 2, ROUND_POINTS = 60 };

static uint64_t add_ellipse(uint64_t hash, const cairn_ellipse *e)
{
    hash = add_real(add_real(add_pose(hash, e->centre), e->half_length), e->half_width);
    hash = add_real(add_real(add_real(add_real(hash, e->coverage), e->score), e->votes), e->rms);
    return add_bytes(hash, &e->kind, sizeof e->kind);
}

/* An oval room and a column in it, three quarters of each. */
uint64_t golden_ellipses(void)
{
    static const cairn_ellipse truth[ROUND] = {
        {{1, 2, CAIRN_REAL(0.4)}, CAIRN_REAL(2.6), 2, 0, 0, 0, 0, CAIRN_ELLIPSE_ROOM},
        {{2, CAIRN_REAL(1.5), 0},
         CAIRN_REAL(0.5),
         CAIRN_REAL(0.5),
         0,
         0,
         0,
         0,
         CAIRN_ELLIPSE_COLUMN}};
    static cairn_oriented_point points[ROUND * ROUND_POINTS];
    cairn_ellipse_params params = cairn_ellipse_default();
    cairn_random random = cairn_random_seed(15, 1);
    cairn_budget budget = unbounded();
    const cairn_ellipse *ellipses;
    cairn_ellipse_set *set;
    cairn_pool pool;
    uint64_t hash = GOLDEN_START;
    int32_t count;

    for (int32_t i = 0; i < ROUND * ROUND_POINTS; i++) {
        points[i] =
            cairn_ellipse_point(&truth[i / ROUND_POINTS],
                                CAIRN_REAL(4.7) * (cairn_real)(i % ROUND_POINTS) / ROUND_POINTS);
        points[i].position.x += argument(&random, CAIRN_REAL(0.02), 0);
    }
    params.cells = 48;
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        cairn_ellipse_create(&set, &pool, &params) != CAIRN_OK ||
        cairn_ellipse_begin(set, points, NULL, ROUND * ROUND_POINTS) != CAIRN_OK ||
        cairn_ellipse_step(set, &budget) != CAIRN_OK)
        return 0;
    ellipses = cairn_ellipse_list(set, &count);
    if (count < ROUND)
        return 0;
    for (int32_t i = 0; i < count; i++)
        hash = add_ellipse(hash, &ellipses[i]);
    return hash;
}

/* ---- Particles ---- */

/* A random walk in the plane; the distance to a beacon is measured. */
typedef struct walk {
    cairn_random random;
    cairn_real seen; /* m */
} walk;

static const cairn_vec2 BEACON = {3, 1};

static cairn_status propose(void *context, cairn_particle_filter *filter, int32_t index,
                            cairn_budget *budget)
{
    walk *w = context;
    cairn_vec2 at = *(const cairn_vec2 *)cairn_particle_filter_particle(filter, index).state;
    cairn_status status = CAIRN_OK;

    (void)budget;
    for (int32_t i = 0; i < 4 && status == CAIRN_OK; i++) {
        cairn_real x = cairn_random_normal(&w->random), y = cairn_random_normal(&w->random);
        cairn_vec2 to = {at.x + CAIRN_REAL(0.3) + x / 10, at.y + y / 10};

        status = cairn_particle_filter_offer(filter, &to, -(x * x + y * y) / 2);
    }
    return status;
}

static cairn_status likelihood(void *context, const cairn_particle_filter *filter, int32_t index,
                               const void *state, cairn_real *log_likelihood, cairn_budget *budget)
{
    const walk *w = context;
    cairn_real error =
        (cairn_vec2_norm(cairn_vec2_sub(*(const cairn_vec2 *)state, BEACON)) - w->seen) * 20;

    (void)filter;
    (void)index;
    (void)budget;
    *log_likelihood = -error * error / 2;
    return CAIRN_OK;
}

uint64_t golden_particles(void)
{
    cairn_particle_filter_params params = cairn_particle_filter_default();
    walk w = {cairn_random_seed(12, 1), 0};
    cairn_particle_filter_model model = {&w, propose, likelihood, NULL, NULL};
    cairn_particle_filter *filter;
    cairn_vec2 truth = {0, 0};
    cairn_pool pool;
    uint64_t hash = GOLDEN_START;

    params.state_bytes = sizeof truth;
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        cairn_particle_filter_create(&filter, &pool, &params, &model) != CAIRN_OK ||
        cairn_particle_filter_clear(filter, 3) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < params.particles; i++) {
        cairn_vec2 start = {0, argument(&w.random, CAIRN_REAL(0.2), 0)};

        if (cairn_particle_filter_start(filter, &start, 0) != CAIRN_OK)
            return 0;
    }
    for (int32_t step = 0; step < 15; step++) {
        cairn_budget budget = unbounded();
        cairn_particle_filter_trace trace;

        truth.x += CAIRN_REAL(0.3);
        w.seen =
            cairn_vec2_norm(cairn_vec2_sub(truth, BEACON)) + cairn_random_normal(&w.random) / 20;
        if (cairn_particle_filter_begin(filter) != CAIRN_OK ||
            cairn_particle_filter_step(filter, &budget) != CAIRN_OK)
            return 0;
        trace = cairn_particle_filter_read(filter);
        hash = add_real(add_real(hash, trace.n_eff), trace.log_evidence);
        hash = add_bytes(hash, &trace.particles, sizeof trace.particles);
    }
    for (int32_t i = 0; i < cairn_particle_filter_count(filter); i++) {
        cairn_particle p = cairn_particle_filter_particle(filter, i);

        hash = add_point(add_real(hash, p.log_weight), *(const cairn_vec2 *)p.state);
    }
    return hash;
}

/* ---- Sweeps of the room ---- */

/* The next sweep of the room, fitted; 0 when that fails. */
static int take_scan(cairn_scan *scan, cairn_random *random, int32_t i, cairn_scan_view *view)
{
    static golden_sweep s;

    golden_make_sweep(&s, random, golden_view_pose(i));
    if (!golden_fit_sweep(scan, &s))
        return 0;
    *view = cairn_scan_read(scan);
    return 1;
}

/* All sweeps by lum in at most 4 iterations, from initial poses whose errors are increased by `far`
 * m and rad; 0 when it fails. */
static uint64_t lum_of(cairn_lum_params params, cairn_real far)
{
    cairn_random random = cairn_random_seed(13, 1);
    cairn_budget budget = unbounded();
    cairn_scan_view view;
    cairn_scan *scan;
    cairn_lum *lum;
    cairn_pool pool;
    uint64_t hash = GOLDEN_START;

    params.max_scans = GOLDEN_VIEWS;
    params.max_points = GOLDEN_VIEWS * 256;
    params.max_links = params.max_fill = GOLDEN_VIEWS * GOLDEN_VIEWS;
    params.max_iterations = 4;
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        (scan = golden_new_scan(&pool)) == NULL ||
        cairn_lum_create(&lum, &pool, &params) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < GOLDEN_VIEWS; i++) {
        cairn_pose pose = golden_thought_pose(&random, i);

        pose.x += argument(&random, far, 0);
        pose.theta += argument(&random, far, 0);
        if (!take_scan(scan, &random, i, &view) ||
            cairn_lum_add_scan(lum, view.points, view.point_count, pose, NULL) != CAIRN_OK)
            return 0;
    }
    if (cairn_lum_begin(lum) != CAIRN_OK || cairn_lum_step(lum, &budget) != CAIRN_OK ||
        (params.sequential_registration && cairn_lum_read(lum).registered_scans == 0) ||
        cairn_lum_read(lum).links == 0)
        return 0;
    for (int32_t i = 0; i < GOLDEN_VIEWS; i++)
        hash = add_pose(hash, cairn_lum_pose(lum, i));
    return add_real(hash, cairn_lum_read(lum).chi2);
}

/* With registration, from distant initial poses. */
uint64_t golden_registered(void)
{
    cairn_lum_params params = cairn_lum_default();

    params.sequential_registration = 1;
    return lum_of(params, CAIRN_REAL(0.2));
}

uint64_t golden_lum_as_written(void)
{
    return lum_of(cairn_lum_as_written(), CAIRN_REAL(0.02));
}

static cairn_virtual_scan_params small_hypotheses(cairn_virtual_scan_params params)
{
    params.max_scans = GOLDEN_VIEWS;
    params.max_points = GOLDEN_VIEWS * 256;
    params.max_segments = GOLDEN_VIEWS * 32;
    params.max_hypotheses = 16;
    params.max_virtual = 512;
    params.hough.angles = 72;
    params.hough.distances = 64;
    params.hough.max_lines = 32;
    params.rectangle.max_rectangles = 32;
    params.rectangle.max_pairs = 256;
    params.rectangle.max_sides = 64;
    params.ellipse.cells = 48;
    return params;
}

/* Lines and rectangles of the sweeps at their initial poses. */
uint64_t golden_hypotheses(void)
{
    cairn_scan_set_params set_params = {.max_scans = GOLDEN_VIEWS,
                                        .max_segments = GOLDEN_VIEWS * 32,
                                        .max_points = GOLDEN_VIEWS * 256,
                                        .spacing = 0};
    cairn_virtual_scan_params params = small_hypotheses(cairn_virtual_scan_default());
    cairn_random random = cairn_random_seed(14, 1);
    cairn_pose pose[GOLDEN_VIEWS];
    cairn_budget budget = unbounded();
    const cairn_oriented_point *points;
    const cairn_real *weights;
    cairn_virtual_scan *hypotheses;
    cairn_scan_view view;
    cairn_scan_set *set;
    cairn_scan *scan;
    cairn_pool pool;
    uint64_t hash = GOLDEN_START;
    int32_t count;

    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        (scan = golden_new_scan(&pool)) == NULL ||
        cairn_scan_set_create(&set, &pool, &set_params) != CAIRN_OK ||
        cairn_virtual_scan_create(&hypotheses, &pool, &params) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < GOLDEN_VIEWS; i++) {
        pose[i] = golden_thought_pose(&random, i);
        if (!take_scan(scan, &random, i, &view) ||
            cairn_scan_set_add(set, &view, NULL, NULL) != CAIRN_OK)
            return 0;
    }
    if (cairn_virtual_scan_begin(hypotheses, CAIRN_REAL(0.2)) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < GOLDEN_VIEWS; i++)
        if (cairn_virtual_scan_add_scan(hypotheses, set, i, pose[i]) != CAIRN_OK)
            return 0;
    if (cairn_virtual_scan_step(hypotheses, &budget) != CAIRN_OK)
        return 0;
    points = cairn_virtual_scan_points(hypotheses, &weights, &count);
    if (count == 0)
        return 0;
    for (int32_t i = 0; i < count; i++)
        hash = add_real(add_point(add_point(hash, points[i].position), points[i].direction),
                        weights[i]);
    return hash;
}

/* Three sweeps by the aligner with thresholds so high that hypotheses must help, or as written. */
static uint64_t virtual_aligned_of(cairn_virtual_align_params params,
                                   cairn_virtual_scan_params hypotheses)
{
    cairn_random random = cairn_random_seed(15, 1);
    cairn_budget budget = unbounded();
    cairn_virtual_align_result result;
    cairn_virtual_align *align;
    cairn_scan_view view;
    cairn_scan *scan;
    cairn_pool pool;
    uint64_t hash = GOLDEN_START;

    params.aligner.max_scans = 3;
    params.aligner.max_segments = 3 * 32;
    params.aligner.max_points = 3 * 200;
    params.aligner.max_hypotheses = 64;
    params.aligner.max_fill = 64;
    params.aligner.min_log_likelihood_ratio = 1000;
    params.aligner.max_relocalizations = 0;
    params.hypotheses = small_hypotheses(hypotheses);
    params.field.max_steps = 6;
    params.max_rounds = 1;
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        (scan = golden_new_scan(&pool)) == NULL ||
        cairn_virtual_align_create(&align, &pool, &params) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < 3; i++)
        if (!take_scan(scan, &random, i, &view) ||
            cairn_virtual_align_add_scan(align, &view, golden_thought_pose(&random, i), NULL) !=
                CAIRN_OK)
            return 0;
    if (cairn_virtual_align_begin(align) != CAIRN_OK ||
        cairn_virtual_align_step(align, &budget) != CAIRN_OK)
        return 0;
    result = cairn_virtual_align_read(align);
    if (result.moved_scans == 0 || result.active_iterations == 0)
        return 0;
    for (int32_t i = 0; i < 3; i++) {
        cairn_aligner_pose pose = cairn_virtual_align_pose_of(align, i).aligned;

        hash = add_covariance(add_pose(hash, pose.map_scan), pose.covariance);
    }
    return hash;
}

uint64_t golden_virtual_aligned(void)
{
    return virtual_aligned_of(cairn_virtual_align_default(), cairn_virtual_scan_default());
}

uint64_t golden_virtual_as_written(void)
{
    return virtual_aligned_of(cairn_virtual_align_as_written(), cairn_virtual_scan_as_written());
}

/* The mapper on a drive through the room, without odometry. */
uint64_t golden_mapped(void)
{
    cairn_mapper_params params = cairn_mapper_default_for(4, GOLDEN_BEAMS);
    cairn_random random = cairn_random_seed(18, 1);
    cairn_mapper *mapper;
    cairn_pool pool;
    uint64_t hash = GOLDEN_START;

    params.local_keyframes = params.window = 4;
    params.local_recent = 2;
    params.window_free = 2;
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        cairn_mapper_create(&mapper, &pool, &params) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < 5; i++) {
        static golden_sweep s;
        cairn_pose pose = {1 + (cairn_real)i * CAIRN_REAL(0.25), CAIRN_REAL(2.5),
                           (cairn_real)i * CAIRN_REAL(0.2)};
        cairn_mapper_result result;

        golden_make_sweep(&s, &random, pose);
        if (cairn_mapper_map(mapper, &s.input, NULL, NULL) != CAIRN_OK)
            return 0;
        result = cairn_mapper_read(mapper);
        hash = add_covariance(add_pose(hash, result.map_scan), result.covariance);
    }
    for (int32_t i = 0; i < cairn_mapper_measure(mapper).keyframes; i++)
        hash = add_pose(hash, cairn_mapper_keyframe_pose(mapper, i));
    return cairn_mapper_measure(mapper).keyframes > 1 ? hash : 0;
}

/* By particles, there and back, so that the first scans have become an old map at the end. */
uint64_t golden_filtered(void)
{
    cairn_filter_mapper_params params = cairn_filter_mapper_default_for(6, GOLDEN_BEAMS, 3);
    cairn_random random = cairn_random_seed(19, 1);
    cairn_filter_mapper *mapper;
    cairn_pose path[6];
    cairn_pool pool;
    uint64_t hash = GOLDEN_START;

    params.front.search = 0;
    params.max_local_points = 512;
    params.recent_keyframes = 2;
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        cairn_filter_mapper_create(&mapper, &pool, &params) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < 6; i++) {
        static golden_sweep s;
        cairn_real along = CAIRN_REAL(0.6) * (cairn_real)(i < 3 ? i : 5 - i);
        cairn_pose pose = {1 + along, CAIRN_REAL(2.5), along / 3};

        golden_make_sweep(&s, &random, pose);
        if (cairn_filter_mapper_map(mapper, &s.input, &pose, NULL) != CAIRN_OK)
            return 0;
    }
    for (int32_t i = 0; i < cairn_filter_mapper_count(mapper); i++)
        for (int32_t k = cairn_filter_mapper_path(mapper, i, path, 6) - 1; k >= 0; k--)
            hash = add_pose(hash, path[k]);
    return cairn_filter_mapper_measure(mapper).revisit_matches > 0
               ? add_real(hash, cairn_filter_mapper_measure(mapper).n_eff)
               : 0;
}

/* ---- Places and maps, without a guess ---- */

uint64_t golden_places(void)
{
    enum { PLACES = 3 };
    cairn_place_map_params params = cairn_place_map_default();
    cairn_random random = cairn_random_seed(16, 1);
    cairn_budget budget = unbounded();
    cairn_place_map *map;
    cairn_scan_view view;
    cairn_scan *scan;
    cairn_pool pool;
    uint64_t hash = GOLDEN_START;

    params.max_places = params.max_scans = PLACES;
    params.max_place_points = params.max_place_beams = 256;
    params.rematch_rounds = params.refinement_sweeps = 1;
    params.visibility_reach = 6;
    params.visibility_cell = CAIRN_REAL(0.1);
    params.match.max_hypotheses = 2;
    params.match.max_dense = 256;
    params.match.max_candidates = 64;
    params.consensus.max_hypotheses = 32;
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        (scan = golden_new_scan(&pool)) == NULL ||
        cairn_place_map_create(&map, &pool, &params) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < PLACES; i++)
        if (!take_scan(scan, &random, i, &view) ||
            cairn_place_map_add_scan(map, i, &view, cairn_pose_identity(), NULL) != CAIRN_OK)
            return 0;
    if (cairn_place_map_begin(map) != CAIRN_OK || cairn_place_map_step(map, &budget) != CAIRN_OK ||
        cairn_place_map_read(map).placed < 2)
        return 0;
    for (int32_t i = 0; i < PLACES; i++) {
        cairn_place_map_place place = cairn_place_map_place_of(map, i);

        hash = add_real(add_pose(hash, place.map_place), place.support);
    }
    return add_real(hash, cairn_place_map_read(map).total);
}

/* The map of chapter 6 as written: a robot of constant heading. */
uint64_t golden_places_as_written(void)
{
    enum { PLACES = 3 };
    static golden_sweep sweep;
    cairn_place_map_params params = cairn_place_map_as_written();
    cairn_random random = cairn_random_seed(19, 1);
    cairn_budget budget = unbounded();
    cairn_place_map *map;
    cairn_scan_view view;
    cairn_scan *scan;
    cairn_pool pool;
    uint64_t hash = GOLDEN_START;

    params.max_places = params.max_scans = PLACES;
    params.max_place_points = GOLDEN_BEAMS;
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        (scan = golden_new_scan(&pool)) == NULL ||
        cairn_place_map_create(&map, &pool, &params) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < PLACES; i++) {
        cairn_pose pose = {2 + CAIRN_REAL(0.2) * (cairn_real)i, 2,
                           CAIRN_REAL(0.01) * (cairn_real)i};

        golden_make_sweep(&sweep, &random, pose);
        if (!golden_fit_sweep(scan, &sweep))
            return 0;
        view = cairn_scan_read(scan);
        if (cairn_place_map_add_scan(map, i, &view, cairn_pose_identity(), NULL) != CAIRN_OK)
            return 0;
    }
    if (cairn_place_map_begin(map) != CAIRN_OK || cairn_place_map_step(map, &budget) != CAIRN_OK ||
        cairn_place_map_read(map).decoupled < 1)
        return 0;
    for (int32_t i = 0; i < PLACES; i++)
        hash = add_pose(add_pose(hash, cairn_place_map_place_of(map, i).map_place),
                        cairn_place_map_scan_pose(map, i));
    return hash;
}

enum { MAP_SIDE = 40 };

/* A map of a part of a hall with `boxes` boxes at all angles, `size` times 0.6 by 0.3 m, in cells
 * of 0.1 m, in its own frame. */
static void draw_map(cairn_pose hall_map, uint8_t *cells, int32_t boxes, cairn_real size)
{
    cairn_random random = cairn_random_seed(17, 1);
    cairn_transform hall = cairn_transform_of(hall_map);
    cairn_pose box[12];

    for (int32_t k = 0; k < 12; k++) {
        box[k].x = argument(&random, 3, 0);
        box[k].y = argument(&random, CAIRN_REAL(1.5), 0);
        box[k].theta = argument(&random, 1, 0);
    }
    for (int32_t i = 0; i < MAP_SIDE * MAP_SIDE; i++) {
        int32_t row = i / MAP_SIDE, column = i % MAP_SIDE;
        cairn_vec2 cell = {(cairn_real)column / 10 - 2, (cairn_real)row / 10 - 2};
        cairn_vec2 p = cairn_transform_point(hall, cell);

        cells[i] = cairn_abs(p.y) > CAIRN_REAL(1.9)   ? CAIRN_OCCUPANCY_GRID_UNKNOWN
                   : cairn_abs(p.y) > CAIRN_REAL(1.8) ? CAIRN_OCCUPANCY_GRID_OCCUPIED
                                                      : CAIRN_OCCUPANCY_GRID_FREE;
        for (int32_t k = 0; k < boxes; k++) {
            cairn_vec2 q = cairn_transform_point(cairn_transform_of(cairn_pose_inverse(box[k])), p);

            if (cairn_abs(q.x) < CAIRN_REAL(0.3) * size && cairn_abs(q.y) < CAIRN_REAL(0.15) * size)
                cells[i] = CAIRN_OCCUPANCY_GRID_OCCUPIED;
        }
    }
}

/* Two maps merged; 0 when the second one is not placed. */
static uint64_t merge_two(cairn_map_merge_params params, int32_t boxes, cairn_real size)
{
    static uint8_t cells[2][MAP_SIDE * MAP_SIDE];
    static const cairn_pose hall_map[2] = {{-1, 0, 0},
                                           {CAIRN_REAL(0.2), CAIRN_REAL(0.1), CAIRN_REAL(0.3)}};
    cairn_budget budget = unbounded();
    cairn_map_merge_placed placed;
    cairn_map_merge *merge;
    cairn_pool pool;
    uint64_t hash = GOLDEN_START;

    params.max_maps = 2;
    params.max_map_cells = MAP_SIDE * MAP_SIDE;
    params.max_cells = 2 * MAP_SIDE * MAP_SIDE;
    params.max_points = 256;
    params.max_segments = 64;
    params.max_corners = 16;
    params.max_modes = 2;
    params.particles = 10;
    params.min_score = 1;
    params.min_margin = 0;
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        cairn_map_merge_create(&merge, &pool, &params) != CAIRN_OK)
        return 0;
    for (int32_t i = 0; i < 2; i++) {
        cairn_map_merge_map map = {
            {cells[i], MAP_SIDE, MAP_SIDE, MAP_SIDE}, CAIRN_REAL(0.1), {-2, -2, 0}};

        draw_map(hall_map[i], cells[i], boxes, size);
        if (cairn_map_merge_add(merge, &map, NULL) != CAIRN_OK)
            return 0;
    }
    if (cairn_map_merge_begin(merge, 0, NULL) != CAIRN_OK ||
        cairn_map_merge_step(merge, &budget) != CAIRN_OK)
        return 0;
    placed = cairn_map_merge_of(merge, 1);
    if (placed.verdict != CAIRN_MAP_MERGE_PLACED)
        return 0;
    hash = add_real(add_real(add_pose(hash, placed.reference_map), placed.support),
                    placed.error_probability);
    return add_real(hash, cairn_map_merge_read(merge).log_likelihood_ratio);
}

uint64_t golden_merged(void)
{
    return merge_two(cairn_map_merge_default(), 12, 1);
}

uint64_t golden_merged_as_written(void)
{
    return merge_two(cairn_map_merge_as_written(), 5, 3);
}

/* The grid of both maps of a hall at the poses at which they were drawn. */
uint64_t golden_voted(void)
{
    enum { GRID_SIDE = 64 };
    static const cairn_vec2 origin = {-3, -3};
    static uint8_t cells[2][MAP_SIDE * MAP_SIDE], grid[GRID_SIDE * GRID_SIDE];
    static const cairn_pose hall_map[2] = {{-1, 0, 0},
                                           {CAIRN_REAL(0.2), CAIRN_REAL(0.1), CAIRN_REAL(0.3)}};
    const cairn_raster_u8 out = {grid, GRID_SIDE, GRID_SIDE, GRID_SIDE};
    cairn_map_vote_params params = cairn_map_vote_default();
    cairn_map_merge_placed placed[2] = {{.verdict = CAIRN_MAP_MERGE_PLACED},
                                        {.verdict = CAIRN_MAP_MERGE_PLACED}};
    cairn_budget budget = unbounded();
    cairn_map_merge_map maps[2];
    cairn_map_vote *vote;
    cairn_pool pool;

    for (int32_t i = 0; i < 2; i++) {
        draw_map(hall_map[i], cells[i], 12, 1);
        maps[i] = (cairn_map_merge_map){
            {cells[i], MAP_SIDE, MAP_SIDE, MAP_SIDE}, CAIRN_REAL(0.1), {-2, -2, 0}};
        placed[i].reference_map = hall_map[i];
    }
    if (cairn_pool_init(&pool, golden_memory, GOLDEN_MEMORY) != CAIRN_OK ||
        cairn_map_vote_create(&vote, &pool, &params) != CAIRN_OK ||
        cairn_map_vote_begin(vote, maps, placed, 2, origin, CAIRN_REAL(0.1), out, NULL) !=
            CAIRN_OK ||
        cairn_map_vote_step(vote, &budget) != CAIRN_OK)
        return 0;
    return add_bytes(GOLDEN_START, grid, sizeof grid);
}
