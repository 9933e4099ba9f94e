/* Lu and Milios against a plain twin with all pairs of points and a dense solution; rooms that come back; pieces, refusals,
 * budgets. */
#include "tests/test.h"

#include <math.h>

#include "cairn/lum.h"

enum { SCANS = 4, MOST = 400, ROWS = 3 * SCANS };

/* An L-shaped room, counter-clockwise, so that the inside is on the left. */
static const cairn_vec2 ROOM[] = {{-3, -2}, {4, -2}, {4, 1}, {1, 1}, {1, 4}, {-3, 4}};

struct scan {
    cairn_oriented_point at[MOST];
    int32_t count;
    cairn_pose truth, start;
};

static struct scan scans[SCANS];

/* Walls of the room from one scan's pose; each scan has its points at other places along them. */
static void make_scans(double metres, double radians)
{
    cairn_random random = cairn_random_seed(1, 0);

    for (int32_t i = 0; i < SCANS; i++) {
        struct scan *s = &scans[i];
        cairn_transform inverse;

        s->count = 0;
        s->truth.x = (cairn_real)i / 4;
        s->truth.y = (cairn_real)(i % 2) / 2;
        s->truth.theta = CAIRN_REAL(0.7) * (cairn_real)i;
        inverse = cairn_transform_of(cairn_pose_inverse(s->truth));
        for (int32_t w = 0; w < 6; w++) {
            cairn_vec2 a = ROOM[w], along = cairn_vec2_sub(ROOM[(w + 1) % 6], a), unit = cairn_vec2_unit(along);

            for (cairn_real t = CAIRN_REAL(0.02) * (cairn_real)(i + 1); t < cairn_vec2_norm(along);
                 t += CAIRN_REAL(0.1)) {
                cairn_vec2 p = cairn_vec2_add(a, cairn_vec2_scale(unit, t));

                assert_true(s->count < MOST);
                s->at[s->count].position = cairn_transform_point(inverse, p);
                s->at[s->count++].direction = cairn_transform_direction(inverse, unit);
            }
        }
        s->start = s->truth;
        if (i > 0) {
            s->start.x += (cairn_real)metres * cairn_random_uniform(&random, -1, 1);
            s->start.y += (cairn_real)metres * cairn_random_uniform(&random, -1, 1);
            s->start.theta += (cairn_real)radians * cairn_random_uniform(&random, -1, 1);
        }
    }
}

static cairn_lum_params small_params(void)
{
    cairn_lum_params params = cairn_lum_default();

    params.max_scans = SCANS;
    params.max_points = SCANS * MOST;
    params.max_links = params.max_fill = SCANS * (SCANS - 1) / 2;
    return params;
}

static cairn_lum *new_lum(cairn_pool *pool, const cairn_lum_params *params)
{
    cairn_lum *lum;

    *pool = test_pool(cairn_lum_memory(params));
    assert_ok(cairn_lum_create(&lum, pool, params));
    return lum;
}

static void add_all(cairn_lum *lum)
{
    for (int32_t i = 0; i < SCANS; i++)
        assert_ok(cairn_lum_add_scan(lum, scans[i].at, scans[i].count, scans[i].start, NULL));
}

static cairn_status run(cairn_lum *lum, int32_t units)
{
    for (;;) {
        cairn_budget budget = {units};
        cairn_status status = cairn_lum_step(lum, &budget);

        assert_true(budget.left >= 0);
        if (status != CAIRN_MORE)
            return status;
        assert_int_equal(budget.left, 0);
    }
}

/* ---- The twin: one iteration ---- */

static void transform_point(cairn_pose pose, cairn_vec2 p, double q[2])
{
    double c = cos((double)pose.theta), s = sin((double)pose.theta);

    q[0] = (double)pose.x + c * (double)p.x - s * (double)p.y;
    q[1] = (double)pose.y + s * (double)p.x + c * (double)p.y;
}

/* Normal equations of one link over (tx, ty, phi) about the origin: h, right side, |Z|^2; returns the pairs. */
static int32_t twin_link(const cairn_lum_params *params, const cairn_pose *poses, int32_t i, int32_t j, double h[3][3],
                         double g[3], double *miss)
{
    int32_t pairs = 0;

    memset(h, 0, 9 * sizeof(double));
    memset(g, 0, 3 * sizeof(double));
    *miss = 0;
    for (int32_t k = 0; k < scans[j].count; k++) {
        double b[2], best = (double)params->distance, a[2], near[2] = {0, 0}, x, y, z[2];
        double cj = cos((double)poses[j].theta), sj = sin((double)poses[j].theta);
        double ci = cos((double)poses[i].theta), si = sin((double)poses[i].theta);
        cairn_vec2 dj = scans[j].at[k].direction;
        int found = 0;

        transform_point(poses[j], scans[j].at[k].position, b);
        for (int32_t m = 0; m < scans[i].count; m++) {
            cairn_vec2 di = scans[i].at[m].direction;
            double dot = (ci * (double)di.x - si * (double)di.y) * (cj * (double)dj.x - sj * (double)dj.y) +
                         (si * (double)di.x + ci * (double)di.y) * (sj * (double)dj.x + cj * (double)dj.y);

            transform_point(poses[i], scans[i].at[m].position, a);
            if (hypot(a[0] - b[0], a[1] - b[1]) <= best && dot >= cos((double)params->direction_gate)) {
                best = hypot(a[0] - b[0], a[1] - b[1]);
                near[0] = a[0];
                near[1] = a[1];
                found = 1;
            }
        }
        if (!found)
            continue;
        pairs++;
        x = (near[0] + b[0]) / 2;
        y = (near[1] + b[1]) / 2;
        z[0] = near[0] - b[0];
        z[1] = near[1] - b[1];
        for (int r = 0; r < 2; r++) {
            const double row[3] = {r == 0, r == 1, r == 0 ? -y : x};

            *miss += z[r] * z[r];
            for (int u = 0; u < 3; u++) {
                g[u] += row[u] * z[r];
                for (int v = 0; v < 3; v++)
                    h[u][v] += row[u] * row[v];
            }
        }
    }
    return pairs;
}

/* Gauss and Jordan; the last column is the solution. */
static void eliminate(double *m, int n)
{
    for (int p = 0; p < n; p++)
        for (int r = 0; r < n; r++) {
            double f = m[r * (n + 1) + p] / m[p * (n + 1) + p];

            for (int c = 0; c <= n && r != p; c++)
                m[r * (n + 1) + c] -= f * m[p * (n + 1) + c];
        }
    for (int r = 0; r < n; r++)
        m[r * (n + 1) + n] /= m[r * (n + 1) + r];
}

/* Moves the poses by one iteration; returns W of the differences before it. */
static double twin_iterate(const cairn_lum_params *params, cairn_pose *poses)
{
    static double m[ROWS][ROWS + 1];
    double error = 0;

    memset(m, 0, sizeof m);
    for (int k = 0; k < 3; k++)
        m[k][k] = 1;
    for (int32_t i = 0; i < SCANS; i++)
        for (int32_t j = i + 1; j < SCANS; j++) {
            double h[3][3], g[3], miss, d[3][4], left, by;
            int32_t pairs = twin_link(params, poses, i, j, h, g, &miss);

            if (pairs <= params->min_pairs)
                continue;
            for (int u = 0; u < 3; u++) {
                for (int v = 0; v < 3; v++)
                    d[u][v] = h[u][v];
                d[u][3] = g[u];
            }
            eliminate(&d[0][0], 3);
            left = miss - d[0][3] * g[0] - d[1][3] * g[1] - d[2][3] * g[2];
            by = 1 / fmax(left / (2.0 * pairs - 3), (double)params->sigma * (double)params->sigma);
            error += by * miss;
            for (int u = 0; u < 3; u++) {
                for (int v = 0; v < 3; v++) {
                    if (i > 0) {
                        m[3 * i + u][3 * i + v] += by * h[u][v];
                        m[3 * i + u][3 * j + v] -= by * h[u][v];
                        m[3 * j + u][3 * i + v] -= by * h[u][v];
                    }
                    m[3 * j + u][3 * j + v] += by * h[u][v];
                }
                if (i > 0)
                    m[3 * i + u][ROWS] -= by * g[u];
                m[3 * j + u][ROWS] += by * g[u];
            }
        }
    eliminate(&m[0][0], ROWS);
    for (int32_t i = 1; i < SCANS; i++) {
        double x = (double)poses[i].x, y = (double)poses[i].y;

        poses[i].x = (cairn_real)(x + m[3 * i][ROWS] - m[3 * i + 2][ROWS] * y);
        poses[i].y = (cairn_real)(y + m[3 * i + 1][ROWS] + m[3 * i + 2][ROWS] * x);
        poses[i].theta += (cairn_real)m[3 * i + 2][ROWS];
    }
    return error;
}

static void iterations_are_those_of_the_twin(void **state)
{
    (void)state;
    for (int32_t rebuild = 0; rebuild < 3; rebuild++) {
        cairn_lum_params params = small_params();
        cairn_pose poses[SCANS];
        cairn_pool pool;
        cairn_lum *lum;

        make_scans(0.05, 0.03);
        params.rebuild = rebuild;
        params.sigma = rebuild == 1 ? CAIRN_REAL(0.001) : params.sigma;
        params.direction_gate = rebuild == 2 ? CAIRN_PI : params.direction_gate;
        lum = new_lum(&pool, &params);
        add_all(lum);
        for (int32_t i = 0; i < SCANS; i++)
            poses[i] = scans[i].start;
        assert_ok(cairn_lum_begin(lum));
        for (int32_t k = 1; k <= 3; k++) {
            cairn_budget budget = {CAIRN_UNBOUNDED};
            double error = twin_iterate(&params, poses);

            assert_ok(cairn_lum_iterate(lum, &budget));
            assert_int_equal(cairn_lum_read(lum).iterations, k);
            assert_near(cairn_lum_read(lum).error, error, NUMBER(1e-9, 0.05) * error);
            for (int32_t i = 0; i < SCANS; i++) {
                cairn_pose pose = cairn_lum_pose(lum, i);

                assert_near(pose.x, poses[i].x, NUMBER(1e-9, 2e-3));
                assert_near(pose.y, poses[i].y, NUMBER(1e-9, 2e-3));
                assert_near(cairn_wrap_angle(pose.theta - poses[i].theta), 0, NUMBER(1e-9, 2e-3));
            }
        }
        test_pool_free(&pool);
    }
}

static void a_room_comes_back(void **state)
{
    cairn_lum_params params = small_params();
    cairn_lum_state end;
    cairn_pool pool;
    cairn_lum *lum = new_lum(&pool, &params);

    (void)state;
    make_scans(0.08, 0.03);
    for (int round = 0; round < 2; round++) {
        add_all(lum);
        assert_ok(cairn_lum_begin(lum));
        assert_status(cairn_lum_begin(lum), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_lum_add_scan(lum, scans[0].at, 1, scans[0].start, NULL), CAIRN_BAD_ARGUMENT);
        assert_ok(run(lum, 1000));
        end = cairn_lum_read(lum);
        assert_int_equal(end.verdict, CAIRN_LUM_CONVERGED);
        assert_int_equal(end.scans, SCANS);
        assert_int_equal(end.links, 6);
        assert_int_equal(end.pieces, 1);
        assert_true(end.pairs > 6 * 200);
        assert_true(end.motion <= params.converged);
        for (int32_t i = 0; i < SCANS; i++) {
            cairn_pose pose = cairn_lum_pose(lum, i);

            assert_int_equal(cairn_lum_is_joined(lum, i), 1);
            assert_near(pose.x, scans[i].truth.x, 0.05);
            assert_near(pose.y, scans[i].truth.y, 0.05);
            assert_near(cairn_wrap_angle(pose.theta - scans[i].truth.theta), 0, 0.02);
        }
        cairn_lum_clear(lum);
        assert_int_equal(cairn_lum_read(lum).scans, 0);
        assert_status(cairn_lum_begin(lum), CAIRN_EMPTY);
    }
    test_pool_free(&pool);
}

static void pieces_stay_and_are_told(void **state)
{
    cairn_lum_params params = small_params();
    cairn_pool pool;
    cairn_lum *lum = new_lum(&pool, &params);
    cairn_pose pose;

    (void)state;
    make_scans(0.02, 0.01);
    scans[2].start.x += 100; /* out of sight, with the next one beside it */
    scans[3].start.x += 100;
    scans[1].count = 0;
    add_all(lum);
    assert_ok(cairn_lum_begin(lum));
    assert_ok(run(lum, CAIRN_UNBOUNDED));
    assert_int_equal(cairn_lum_read(lum).verdict, CAIRN_LUM_CONVERGED);
    assert_int_equal(cairn_lum_read(lum).pieces, 3);
    assert_int_equal(cairn_lum_read(lum).links, 1);
    for (int32_t i = 0; i < SCANS; i++)
        assert_int_equal(cairn_lum_is_joined(lum, i), i == 0);
    for (int32_t i = 0; i < 3; i++) {
        pose = cairn_lum_pose(lum, i);
        assert_memory_equal(&pose, &scans[i].start, sizeof pose);
    }
    pose = cairn_pose_between(cairn_lum_pose(lum, 2), cairn_lum_pose(lum, 3));
    assert_near(pose.y, cairn_pose_between(scans[2].truth, scans[3].truth).y, 0.05);
    test_pool_free(&pool);
}

static void capacities_are_told(void **state)
{
    cairn_lum_params params = small_params();
    cairn_fault fault;
    cairn_pool pool;
    cairn_lum *lum;

    (void)state;
    make_scans(0.02, 0.01);
    for (int k = 0; k < 2; k++) {
        params = small_params();
        if (k == 0)
            params.max_links = 5;
        else
            params.max_fill = 5;
        lum = new_lum(&pool, &params);
        add_all(lum);
        assert_status(cairn_lum_add_scan(lum, scans[0].at, 1, scans[0].start, &fault), CAIRN_FULL);
        assert_int_equal(fault.index, -1);
        assert_ok(cairn_lum_begin(lum));
        assert_status(run(lum, 50), CAIRN_FULL);
        assert_int_equal(cairn_lum_read(lum).iterations, 0);
        assert_ok(cairn_lum_begin(lum)); /* may be tried again */
        test_pool_free(&pool);
    }
    params = small_params();
    params.max_points = 10;
    params.max_iterations = 1;
    lum = new_lum(&pool, &params);
    assert_ok(cairn_lum_add_scan(lum, scans[0].at, 10, scans[0].start, NULL));
    assert_status(cairn_lum_add_scan(lum, scans[0].at, 1, scans[0].start, NULL), CAIRN_FULL);
    assert_ok(cairn_lum_begin(lum));
    assert_ok(run(lum, 1));
    assert_int_equal(cairn_lum_read(lum).verdict, CAIRN_LUM_CONVERGED); /* alone */
    test_pool_free(&pool);
    params = small_params();
    params.max_iterations = 2;
    lum = new_lum(&pool, &params);
    add_all(lum);
    assert_ok(cairn_lum_begin(lum));
    assert_ok(run(lum, CAIRN_UNBOUNDED));
    assert_int_equal(cairn_lum_read(lum).verdict, CAIRN_LUM_OUT_OF_ITERATIONS);
    assert_int_equal(cairn_lum_read(lum).iterations, 2);
    test_pool_free(&pool);
}

static uint64_t hash_with(int32_t units)
{
    cairn_lum_params params = small_params();
    uint64_t hash = TEST_HASH_START;
    cairn_pool pool;
    cairn_lum *lum = new_lum(&pool, &params);
    cairn_lum_state end;

    make_scans(0.05, 0.03);
    add_all(lum);
    assert_ok(cairn_lum_begin(lum));
    assert_ok(run(lum, units));
    for (int32_t i = 0; i < SCANS; i++) {
        cairn_pose pose = cairn_lum_pose(lum, i);

        hash = test_hash(hash, &pose, sizeof pose);
    }
    end = cairn_lum_read(lum);
    hash = test_hash(hash, &end.pairs, sizeof end.pairs);
    test_pool_free(&pool);
    return hash;
}

static void budgets_do_not_matter(void **state)
{
    uint64_t hash = hash_with(CAIRN_UNBOUNDED);

    (void)state;
    assert_true(hash_with(1) == hash);
    assert_true(hash_with(7) == hash);
    assert_true(hash_with(1000) == hash);
}

static cairn_status create_one(void *context, cairn_pool *pool)
{
    cairn_lum *lum;

    return cairn_lum_create(&lum, pool, context);
}

static void refusals(void **state)
{
    const cairn_real nan = (cairn_real)NAN;
    cairn_lum_params good = small_params(), bad[24];
    cairn_oriented_point point = {{0, 0}, {1, 0}};
    cairn_pose pose = cairn_pose_identity();
    cairn_lum *lum = NULL;
    cairn_fault fault;
    cairn_pool pool;
    int count = 0;

    (void)state;
    for (int k = 0; k < 24; k++)
        bad[k] = good;
    bad[count++].max_scans = 0;
    bad[count++].max_scans = (1 << 16) + 1;
    bad[count++].max_points = 0;
    bad[count++].max_points = (1 << 24) + 1;
    bad[count++].max_links = 0;
    bad[count++].max_links = (1 << 24) + 1;
    bad[count++].max_fill = -1;
    bad[count++].min_pairs = 1;
    bad[count++].max_iterations = 0;
    bad[count++].rebuild = -1;
    bad[count++].distance = 0;
    bad[count++].distance = nan;
    bad[count++].direction_gate = 0;
    bad[count++].direction_gate = 4;
    bad[count++].direction_gate = nan;
    bad[count++].sigma = 0;
    bad[count++].sigma = nan;
    bad[count++].converged = 0;
    bad[count++].converged = nan;
    pool = test_pool(1 << 16);
    for (int k = 0; k < count; k++) {
        assert_int_equal(cairn_lum_memory(&bad[k]), 0);
        assert_status(cairn_lum_create(&lum, &pool, &bad[k]), CAIRN_BAD_ARGUMENT);
    }
    assert_int_equal(cairn_lum_memory(NULL), 0);
    assert_status(cairn_lum_create(NULL, &pool, &good), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_lum_create(&lum, NULL, &good), CAIRN_BAD_ARGUMENT);
    test_pool_free(&pool);
    good.max_points = 5;
    test_every_pool_size(create_one, &good, cairn_lum_memory(&good));
    lum = new_lum(&pool, &good);
    assert_status(cairn_lum_begin(NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_lum_begin(lum), CAIRN_EMPTY);
    assert_status(cairn_lum_add_scan(NULL, &point, 1, pose, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_lum_add_scan(lum, NULL, 1, pose, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_lum_add_scan(lum, &point, -1, pose, NULL), CAIRN_BAD_ARGUMENT);
    pose.y = nan;
    assert_status(cairn_lum_add_scan(lum, &point, 1, pose, &fault), CAIRN_NOT_FINITE);
    pose.y = CAIRN_REAL(2e6);
    assert_status(cairn_lum_add_scan(lum, &point, 1, pose, &fault), CAIRN_BAD_ARGUMENT);
    pose.y = 0;
    point.position.x = nan;
    assert_status(cairn_lum_add_scan(lum, &point, 1, pose, &fault), CAIRN_NOT_FINITE);
    assert_int_equal(fault.index, 0);
    point.position.x = CAIRN_REAL(-2e6);
    assert_status(cairn_lum_add_scan(lum, &point, 1, pose, &fault), CAIRN_BAD_ARGUMENT);
    assert_int_equal(cairn_lum_read(lum).scans, 0);
    test_pool_free(&pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(iterations_are_those_of_the_twin),
        cmocka_unit_test(a_room_comes_back),
        cmocka_unit_test(pieces_stay_and_are_told),
        cmocka_unit_test(capacities_are_told),
        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(refusals),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
