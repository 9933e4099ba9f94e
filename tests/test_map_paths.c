/* End-to-end tests on simulated arenas: a drive through mapper and occupancy grid. */
#include "tests/test.h"

#include <math.h>

#include "cairn/mapper.h"
#include "cairn/occupancy_grid.h"
#include "sim/arena.h"

static cairn_pose pose_of(sim_pose p)
{
    cairn_pose pose = {(cairn_real)p.x, (cairn_real)p.y, (cairn_real)p.theta};

    return pose;
}

/* ---- Mapper: a drive becomes a grid ---- */

enum { DRIVE = 150, BEAMS = 241, SAMPLES = 2048 };

static const double resolution = 0.05, sample_length = 0.025;

typedef struct drive {
    sim_arena *arena;
    sim_survey *survey;
    const sim_scan *scans;
    const sim_edge *edges;
    int32_t edge_count;
    uint8_t *seen; /* [edge_count][SAMPLES] wall samples hit by a beam */
    double side;   /* m, of the grid about the origin */
    int32_t cells; /* along a side */
} drive;

/* Marks the wall sample that a beam hit. */
static void mark(drive *d, int32_t edge, double x, double y)
{
    const sim_edge *e = &d->edges[edge];
    double dx = e->b.x - e->a.x, dy = e->b.y - e->a.y, length = hypot(dx, dy);
    double along = length > 0 ? ((x - e->a.x) * dx + (y - e->a.y) * dy) / length : -1;

    if (!(e->radius > 0) && along >= 0 && along < length && along < SAMPLES * sample_length)
        d->seen[edge * SAMPLES + (int32_t)(along / sample_length)] = 1;
}

static void mark_all(drive *d)
{
    for (int32_t i = 0; i < DRIVE; i++) {
        const sim_scan *s = &d->scans[i];

        for (int32_t k = 0; k < s->count; k++) {
            /* With or without turns on the spot, a beam ends within its own wall sample to far less
             * than a cell. */
            double share = (double)k / (s->count - 1), range = (double)s->range[k];
            double theta = s->truth.theta + share * s->motion.theta, c = cos(s->truth.theta),
                   si = sin(s->truth.theta);
            double x = s->truth.x + share * (c * s->motion.x - si * s->motion.y);
            double y = s->truth.y + share * (si * s->motion.x + c * s->motion.y);
            double angle = theta + s->base_sensor.theta + s->angle_min + k * s->angle_step;

            x += cos(theta) * s->base_sensor.x - sin(theta) * s->base_sensor.y;
            y += sin(theta) * s->base_sensor.x + cos(theta) * s->base_sensor.y;
            if (s->edge[k] >= 0)
                mark(d, s->edge[k], x + range * cos(angle), y + range * sin(angle));
        }
    }
}

static void begin_drive(drive *d, sim_scene scene, uint64_t seed)
{
    sim_arena_options arena_options = sim_arena_default();
    sim_survey_options options = sim_survey_default();
    int32_t count;

    arena_options.scene = scene;
    arena_options.seed = seed;
    d->arena = sim_arena_create(&arena_options, NULL, 0);
    assert_non_null(d->arena);
    arena_options = sim_arena_options_of(d->arena);
    d->cells = (int32_t)(1.4 * hypot(arena_options.width, arena_options.height) / resolution);
    d->side = d->cells * resolution;
    options.seed = seed;
    options.drive = DRIVE;
    options.drive_distance = 0.25;
    options.drive_turn = 0.3;
    options.beams = BEAMS;
    options.fov = 4.1887902047863905;
    options.scan_time = 0.1;
    d->survey = sim_survey_create(d->arena, &options, NULL, 0);
    assert_non_null(d->survey);
    d->scans = sim_survey_scans(d->survey, &count);
    assert_int_equal(count, DRIVE);
    d->edges = sim_arena_edges(d->arena, &d->edge_count);
    d->seen = calloc((size_t)d->edge_count * SAMPLES, 1);
    assert_non_null(d->seen);
    mark_all(d);
}

static void end_drive(drive *d)
{
    free(d->seen);
    sim_survey_free(d->survey);
    sim_arena_free(d->arena);
}

/* Feeds the drive to a mapper, in portions of `budget`; returns the final poses. */
static void map_drive(const drive *d, int32_t budget_each, cairn_pose *poses)
{
    cairn_mapper_params params = cairn_mapper_default();
    static cairn_pose keyframe_scan[DRIVE];
    static int32_t key[DRIVE];
    cairn_mapper *mapper;
    cairn_pool pool;

    params.scan.max_beams = BEAMS;
    params.max_keyframes = DRIVE;
    params.max_keyframe_points = DRIVE * 300;
    params.max_keyframe_segments = DRIVE * 60;
    pool = test_pool(cairn_mapper_memory(&params));
    assert_ok(cairn_mapper_create(&mapper, &pool, &params));
    for (int32_t i = 0; i < DRIVE; i++) {
        cairn_scan_input input = sim_scan_input(&d->scans[i]);
        cairn_pose odometry = pose_of(d->scans[i].odometry);
        cairn_mapper_result result;
        cairn_status status;

        assert_taken(cairn_mapper_add(mapper, &input, &odometry, NULL));
        do {
            cairn_budget budget = {budget_each};

            status = cairn_mapper_step(mapper, &budget);
        } while (status == CAIRN_MORE);
        assert_ok(status);
        result = cairn_mapper_read(mapper);
        assert_int_equal(result.verdict, i == 0 ? CAIRN_MAPPER_FIRST : CAIRN_MAPPER_MATCHED);
        key[i] = result.keyframe;
        keyframe_scan[i] = result.keyframe_scan;
    }
    for (int32_t i = 0; i < DRIVE; i++)
        poses[i] = cairn_pose_compose(cairn_mapper_keyframe_pose(mapper, key[i]), keyframe_scan[i]);
    test_pool_free(&pool);
}

/* Enters all scans at their poses into a grid; states: [cells][cells]. */
static void make_grid(const drive *d, const cairn_pose *poses, uint8_t *states)
{
    cairn_occupancy_grid_params params = cairn_occupancy_grid_default();
    cairn_scan_params scan_params = cairn_scan_default();
    cairn_raster_u8 view = {states, d->cells, d->cells, d->cells};
    cairn_occupancy_grid *grid;
    cairn_scan *scan;
    cairn_pool pool;

    params.width = d->cells;
    params.height = d->cells;
    params.resolution = (cairn_real)resolution;
    params.origin.x = (cairn_real)(-d->side / 2);
    params.origin.y = (cairn_real)(-d->side / 2);
    pool = test_pool(cairn_scan_memory(&scan_params) + cairn_occupancy_grid_memory(&params));
    assert_ok(cairn_scan_create(&scan, &pool, &scan_params));
    assert_ok(cairn_occupancy_grid_create(&grid, &pool, &params));
    for (int32_t i = 0; i < DRIVE; i++) {
        cairn_scan_input input = sim_scan_input(&d->scans[i]);
        cairn_budget budget = {CAIRN_UNBOUNDED};
        cairn_scan_view seen;

        assert_ok(cairn_scan_begin(scan, &input, NULL));
        assert_ok(cairn_scan_step(scan, &budget));
        seen = cairn_scan_read(scan);
        assert_ok(
            cairn_occupancy_grid_begin_scan(grid, seen.beams, seen.beam_count, poses[i], NULL));
        assert_ok(cairn_occupancy_grid_step(grid, &budget));
    }
    assert_ok(
        cairn_occupancy_grid_classify(grid, cairn_occupancy_grid_thresholds_default(), 0, view));
    test_pool_free(&pool);
}

static int is_occupied(const drive *d, const uint8_t *states, int32_t x, int32_t y)
{
    return states[y * d->cells + x] == CAIRN_OCCUPANCY_GRID_OCCUPIED;
}

static double edge_distance(const sim_edge *e, double x, double y)
{
    double dx = e->b.x - e->a.x, dy = e->b.y - e->a.y, square = dx * dx + dy * dy, t = 0;

    if (e->radius > 0)
        return fabs(hypot(x - e->a.x, y - e->a.y) - e->radius);
    if (square > 0)
        t = fmin(fmax(((x - e->a.x) * dx + (y - e->a.y) * dy) / square, 0), 1);
    return hypot(x - e->a.x - t * dx, y - e->a.y - t * dy);
}

/* Share of the seen wall samples that have an occupied cell within one cell. */
static double walls_found(const drive *d, const uint8_t *states, int32_t *pieces)
{
    int32_t found = 0;

    *pieces = 0;
    for (int32_t e = 0; e < d->edge_count; e++)
        for (int32_t k = 0; k < SAMPLES; k++) {
            const sim_edge *edge = &d->edges[e];
            double t =
                (k + 0.5) * sample_length / hypot(edge->b.x - edge->a.x, edge->b.y - edge->a.y);
            int32_t x, y, hit = 0;

            if (!d->seen[e * SAMPLES + k])
                continue;
            x = (int32_t)((edge->a.x + t * (edge->b.x - edge->a.x) + d->side / 2) / resolution);
            y = (int32_t)((edge->a.y + t * (edge->b.y - edge->a.y) + d->side / 2) / resolution);
            assert_true(x > 0 && y > 0 && x < d->cells - 1 && y < d->cells - 1);
            for (int32_t j = 0; j < 9; j++)
                hit |= is_occupied(d, states, x + j % 3 - 1, y + j / 3 - 1);
            found += hit;
            ++*pieces;
        }
    return (double)found / *pieces;
}

/* Share of the occupied cells whose middle is within 1.5 cells of a wall. */
static double cells_right(const drive *d, const uint8_t *states, int32_t *cells)
{
    int32_t right = 0;

    *cells = 0;
    for (int32_t y = 0; y < d->cells; y++)
        for (int32_t x = 0; x < d->cells; x++) {
            double nearest = 1e9;

            if (!is_occupied(d, states, x, y))
                continue;
            for (int32_t e = 0; e < d->edge_count; e++)
                nearest =
                    fmin(nearest, edge_distance(&d->edges[e], (x + 0.5) * resolution - d->side / 2,
                                                (y + 0.5) * resolution - d->side / 2));
            right += nearest <= 1.5 * resolution;
            ++*cells;
        }
    return (double)right / *cells;
}

/* Share of the free cells inside of a body, at least half a cell deep. */
static double free_in_bodies(const drive *d, const uint8_t *states)
{
    int32_t open = 0, wrong = 0;

    for (int32_t y = 0; y < d->cells; y++)
        for (int32_t x = 0; x < d->cells; x++) {
            sim_point p;

            if (states[y * d->cells + x] != CAIRN_OCCUPANCY_GRID_FREE)
                continue;
            p.x = (x + 0.5) * resolution - d->side / 2;
            p.y = (y + 0.5) * resolution - d->side / 2;
            wrong += sim_arena_clearance(d->arena, p) < -0.5 * resolution;
            open++;
        }
    assert_true(open > 5000);
    return (double)wrong / open;
}

static double mean_distance(const drive *d, const cairn_pose *poses)
{
    double sum = 0;

    for (int32_t i = 0; i < DRIVE; i++)
        sum += hypot((double)poses[i].x - d->scans[i].truth.x,
                     (double)poses[i].y - d->scans[i].truth.y);
    return sum / DRIVE;
}

/* Moves all poses together so that their positions fit the true ones best: the first scan, which
 * defines the frame of the map, may be one at the start of the motion, and rotated. */
static void align_to_truth(const drive *d, cairn_pose *poses)
{
    double px = 0, py = 0, tx = 0, ty = 0, sine = 0, cosine = 0;
    cairn_pose motion;

    for (int32_t i = 0; i < DRIVE; i++) {
        px += (double)poses[i].x / DRIVE;
        py += (double)poses[i].y / DRIVE;
        tx += d->scans[i].truth.x / DRIVE;
        ty += d->scans[i].truth.y / DRIVE;
    }
    for (int32_t i = 0; i < DRIVE; i++) {
        double ax = (double)poses[i].x - px, ay = (double)poses[i].y - py;
        double bx = d->scans[i].truth.x - tx, by = d->scans[i].truth.y - ty;

        cosine += ax * bx + ay * by;
        sine += ax * by - ay * bx;
    }
    motion.theta = (cairn_real)atan2(sine, cosine);
    motion.x = (cairn_real)(tx - (cos((double)motion.theta) * px - sin((double)motion.theta) * py));
    motion.y = (cairn_real)(ty - (sin((double)motion.theta) * px + cos((double)motion.theta) * py));
    for (int32_t i = 0; i < DRIVE; i++)
        poses[i] = cairn_pose_compose(motion, poses[i]);
}

static void a_drive_becomes_the_arena(void **state)
{
    static const sim_scene scenes[] = {SIM_OFFICE, SIM_APARTMENT, SIM_RESCUE};
    static cairn_pose poses[DRIVE], odometry[DRIVE];

    (void)state;
    for (int k = 0; k < 3; k++) {
        int32_t pieces, cells;
        uint8_t *states;
        double found, right, wrong;
        drive d;

        begin_drive(&d, scenes[k], 1);
        states = malloc((size_t)d.cells * (size_t)d.cells);
        assert_non_null(states);
        map_drive(&d, CAIRN_UNBOUNDED, poses);
        align_to_truth(&d, poses);
        make_grid(&d, poses, states);
        found = walls_found(&d, states, &pieces);
        right = cells_right(&d, states, &cells);
        wrong = free_in_bodies(&d, states);
        assert_true(mean_distance(&d, poses) < 0.03);
        assert_true(pieces > 2000 && cells > 1500);
        assert_true(found > 0.98);
        assert_true(right > 0.99);
        assert_true(wrong < 0.003);

        /* The measure discriminates: by odometry alone walls are doubled and blurred. */
        for (int32_t i = 0; i < DRIVE; i++)
            odometry[i] = pose_of(d.scans[i].odometry);
        align_to_truth(&d, odometry);
        make_grid(&d, odometry, states);
        assert_true(mean_distance(&d, odometry) > 3 * mean_distance(&d, poses));
        assert_true(walls_found(&d, states, &pieces) < found - 0.04);
        assert_true(cells_right(&d, states, &cells) < right - 0.05);
        free(states);
        end_drive(&d);
    }
}

static uint64_t drive_hash(const drive *d, int32_t budget)
{
    static cairn_pose poses[DRIVE];
    uint8_t *states = malloc((size_t)d->cells * (size_t)d->cells);
    uint64_t hash = TEST_HASH_START;

    assert_non_null(states);
    map_drive(d, budget, poses);
    make_grid(d, poses, states);
    hash = test_hash(hash, poses, sizeof poses);
    hash = test_hash(hash, states, (size_t)d->cells * (size_t)d->cells);
    free(states);
    return hash;
}

/* Neither the former contents of the memory, nor the split of the work into steps, nor a second
 * arena changes a bit. */
static void the_same_drive_gives_the_same_bits(void **state)
{
    drive first, second, other;
    uint64_t hash;

    (void)state;
    begin_drive(&first, SIM_RESCUE, 3);
    hash = drive_hash(&first, CAIRN_UNBOUNDED);
    begin_drive(&second, SIM_RESCUE, 3);
    begin_drive(&other, SIM_RESCUE, 4);
    assert_true(drive_hash(&other, CAIRN_UNBOUNDED) != hash);
    assert_true(drive_hash(&second, 997) == hash);
    assert_true(drive_hash(&first, CAIRN_UNBOUNDED) == hash);
    end_drive(&first);
    end_drive(&second);
    end_drive(&other);
}

/* ---- Mapper: among people ---- */

enum { LONG_DRIVE = 400 };

/* Mean distance of poses from the truth after the best common motion. */
static double mean_error(const sim_scan *scans, const cairn_pose *poses, int32_t count)
{
    double mx = 0, my = 0, tx = 0, ty = 0, dot = 0, cross = 0, angle, sum = 0;

    for (int32_t i = 0; i < count; i++) {
        mx += (double)poses[i].x / count;
        my += (double)poses[i].y / count;
        tx += scans[i].truth.x / count;
        ty += scans[i].truth.y / count;
    }
    for (int32_t i = 0; i < count; i++) {
        double x = (double)poses[i].x - mx, y = (double)poses[i].y - my;

        dot += x * (scans[i].truth.x - tx) + y * (scans[i].truth.y - ty);
        cross += x * (scans[i].truth.y - ty) - y * (scans[i].truth.x - tx);
    }
    angle = atan2(cross, dot);
    for (int32_t i = 0; i < count; i++) {
        double x = (double)poses[i].x - mx, y = (double)poses[i].y - my;

        sum += hypot(cos(angle) * x - sin(angle) * y - (scans[i].truth.x - tx),
                     sin(angle) * x + cos(angle) * y - (scans[i].truth.y - ty));
    }
    return sum / count;
}

/* Two people walk about, are seen, block the robot and push it, while half of its scans see a bare
 * wall. */
static double error_among_people(sim_scene scene, uint64_t seed)
{
    static cairn_pose poses[LONG_DRIVE];
    static int32_t keys[LONG_DRIVE];
    sim_arena_options arena_options = sim_arena_default();
    sim_survey_options options = sim_survey_default();
    cairn_mapper_params params = cairn_mapper_default_for(LONG_DRIVE, 181);
    cairn_pool pool = test_pool(cairn_mapper_memory(&params));
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_mapper *mapper;
    const sim_scan *scans;
    sim_arena *arena;
    sim_survey *survey;
    int32_t count;
    double error;

    arena_options.scene = scene;
    arena_options.seed = options.seed = seed;
    arena = sim_arena_create(&arena_options, NULL, 0);
    assert_non_null(arena);
    options.drive = LONG_DRIVE;
    options.movers = 2;
    options.beams = 181;
    options.fov = 3.14159265358979323846;
    survey = sim_survey_create(arena, &options, NULL, 0);
    assert_non_null(survey);
    scans = sim_survey_scans(survey, &count);
    assert_ok(cairn_mapper_create(&mapper, &pool, &params));
    for (int32_t i = 0; i < count; i++) {
        cairn_scan_input input = sim_scan_input(&scans[i]);
        cairn_pose odometry = pose_of(scans[i].odometry);

        assert_taken(cairn_mapper_add(mapper, &input, &odometry, NULL));
        assert_ok(cairn_mapper_step(mapper, &budget));
        keys[i] = cairn_mapper_read(mapper).keyframe;
        poses[i] = cairn_mapper_read(mapper).keyframe_scan;
        budget.left = CAIRN_UNBOUNDED;
    }
    assert_ok(cairn_mapper_settle(mapper, &budget));
    for (int32_t i = 0; i < count; i++)
        poses[i] = cairn_pose_compose(cairn_mapper_keyframe_pose(mapper, keys[i]), poses[i]);
    error = mean_error(scans, poses, count);
    test_pool_free(&pool);
    sim_survey_free(survey);
    sim_arena_free(arena);
    return error;
}

static void maps_among_people(void **state)
{
    (void)state;
    assert_true(error_among_people(SIM_APARTMENT, 2) < 0.08);
    assert_true(error_among_people(SIM_APARTMENT, 4) < 0.08);
    assert_true(error_among_people(SIM_OFFICE, 11) < 0.08);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(maps_among_people),
        cmocka_unit_test(a_drive_becomes_the_arena),
        cmocka_unit_test(the_same_drive_gives_the_same_bits),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
