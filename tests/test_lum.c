/* Lu and Milios compared with a reference implementation of all pairs of points and a dense
 * solution; revisited rooms; components, refusals, budgets. */
#include "tests/test.h"

#include <math.h>

#include "cairn/icp.h"
#include "cairn/lum.h"

enum { SCANS = 4, MAX_COUNT = 400, ROWS = 3 * SCANS };

/* An L-shaped room, counter-clockwise, so that the inside is on the left. */
static const cairn_vec2 ROOM[] = {{-3, -2}, {4, -2}, {4, 1}, {1, 1}, {1, 4}, {-3, 4}};

struct scan {
    cairn_oriented_point at[MAX_COUNT];
    int32_t count;
    cairn_pose truth, start;
};

static struct scan scans[SCANS];

/* Walls of the room from one scan's pose; each scan has its points at other positions along
 * them. */
static void make_scans(double metres, double radians)
{
    cairn_random random = cairn_random_seed(1, 0);

    for (int32_t i = 0; i < SCANS; i++) {
        struct scan *s = &scans[i];
        cairn_transform inverse;

        s->count = 0;
        s->truth.x = (cairn_real)i / 4 + CAIRN_REAL(0.5);
        s->truth.y = (cairn_real)(i % 2) / 2 - CAIRN_REAL(0.25);
        s->truth.theta = CAIRN_REAL(0.7) * (cairn_real)i;
        inverse = cairn_transform_of(cairn_pose_inverse(s->truth));
        for (int32_t w = 0; w < 6; w++) {
            cairn_vec2 a = ROOM[w], along = cairn_vec2_sub(ROOM[(w + 1) % 6], a),
                       unit = cairn_vec2_unit(along);

            for (cairn_real t = CAIRN_REAL(0.02) * (cairn_real)(i + 1); t < cairn_vec2_norm(along);
                 t += CAIRN_REAL(0.1)) {
                cairn_vec2 p = cairn_vec2_add(a, cairn_vec2_scale(unit, t));

                assert_true(s->count < MAX_COUNT);
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
    params.max_points = SCANS * MAX_COUNT;
    params.max_links = params.max_fill = SCANS * (SCANS - 1) / 2;
    return params;
}

static cairn_lum_params as_written_params(void)
{
    cairn_lum_params params = small_params(), written = cairn_lum_as_written();

    written.max_scans = params.max_scans;
    written.max_points = params.max_points;
    written.max_links = params.max_links;
    written.max_fill = params.max_fill;
    return written;
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

/* ---- Reference implementation: one iteration ---- */

static void transform_point(cairn_pose pose, cairn_vec2 p, double q[2])
{
    double c = cos((double)pose.theta), s = sin((double)pose.theta);

    q[0] = (double)pose.x + c * (double)p.x - s * (double)p.y;
    q[1] = (double)pose.y + s * (double)p.x + c * (double)p.y;
}

/* Normal equations of one link over (tx, ty, phi) about the origin: h, right side, |Z|^2;
 * returns the pairs. */
static int32_t reference_link(const cairn_lum_params *params, const cairn_pose *poses, int32_t i,
                              int32_t j, double h[3][3], double g[3], double *miss)
{
    int32_t pairs = 0;

    memset(h, 0, 9 * sizeof(double));
    memset(g, 0, 3 * sizeof(double));
    *miss = 0;
    for (int32_t k = 0; k < scans[j].count; k++) {
        double b[2], best = (double)params->max_pair_distance, a[2], near[2] = {0, 0}, x, y, z[2];
        double cj = cos((double)poses[j].theta), sj = sin((double)poses[j].theta);
        double ci = cos((double)poses[i].theta), si = sin((double)poses[i].theta);
        cairn_vec2 dj = scans[j].at[k].direction;
        int found = 0;

        transform_point(poses[j], scans[j].at[k].position, b);
        for (int32_t m = 0; m < scans[i].count; m++) {
            cairn_vec2 di = scans[i].at[m].direction;
            double dot =
                (ci * (double)di.x - si * (double)di.y) * (cj * (double)dj.x - sj * (double)dj.y) +
                (si * (double)di.x + ci * (double)di.y) * (sj * (double)dj.x + cj * (double)dj.y);

            transform_point(poses[i], scans[i].at[m].position, a);
            if (hypot(a[0] - b[0], a[1] - b[1]) <= best &&
                dot >= cos((double)params->direction_gate)) {
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

/* D^T C^-1 D as in eq. 10.2: D the measured difference, C = s^2 (M^T M)^-1 computed and inverted
 * again. */
static double reference_w(double h[3][3], const double d[3], double variance)
{
    double c[3][6], w = 0;

    for (int u = 0; u < 3; u++)
        for (int v = 0; v < 6; v++)
            c[u][v] = v < 3 ? h[u][v] : v - 3 == u;
    for (int again = 0; again < 2; again++) {
        for (int p = 0; p < 3; p++) {
            double by = c[p][p];

            for (int v = 0; v < 6; v++)
                c[p][v] /= by;
            for (int r = 0; r < 3; r++) {
                double f = c[r][p];

                for (int v = 0; v < 6 && r != p; v++)
                    c[r][v] -= f * c[p][v];
            }
        }
        for (int u = 0; u < 3; u++)
            for (int v = 0; v < 3; v++) {
                c[u][v] = c[u][v + 3] * (again ? 1 : variance);
                c[u][v + 3] = u == v;
            }
    }
    for (int u = 0; u < 3; u++)
        for (int v = 0; v < 3; v++)
            w += d[u] * c[u][v] * d[v];
    return w;
}

/* Moves the poses by one iteration; returns W of the differences before it. */
static double reference_iterate(const cairn_lum_params *params, cairn_pose *poses)
{
    static double m[ROWS][ROWS + 1];
    double error = 0;

    memset(m, 0, sizeof m);
    for (int k = 0; k < 3; k++)
        m[k][k] = 1;
    for (int32_t i = 0; i < SCANS; i++)
        for (int32_t j = i + 1; j < SCANS; j++) {
            double h[3][3], g[3], miss, d[3][4], left, by;
            int32_t pairs = reference_link(params, poses, i, j, h, g, &miss);

            if (pairs <= params->min_pairs)
                continue;
            for (int u = 0; u < 3; u++) {
                for (int v = 0; v < 3; v++)
                    d[u][v] = h[u][v];
                d[u][3] = g[u];
            }
            eliminate(&d[0][0], 3);
            left = miss - d[0][3] * g[0] - d[1][3] * g[1] - d[2][3] * g[2];
            by = 1 / fmax(left / (2.0 * pairs - 3),
                          (double)params->min_sigma * (double)params->min_sigma);
            error += reference_w(h, (const double[]){d[0][3], d[1][3], d[2][3]}, 1 / by);
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

static void iterations_are_those_of_the_reference(void **state)
{
    (void)state;
    for (int32_t rebuild = 0; rebuild < 4; rebuild++) {
        cairn_lum_params params = small_params(), given;
        cairn_pose poses[SCANS];
        cairn_pool pool;
        cairn_lum *lum;

        make_scans(0.05, 0.03);
        params.rebuild_interval = rebuild;
        params.min_sigma = rebuild == 1 ? CAIRN_REAL(0.001) : params.min_sigma;
        params.direction_gate = rebuild == 2 ? CAIRN_PI : params.direction_gate;
        given = params;
        if (rebuild == 3) { /* as written: params that the mode does not read have bad values */
            given = params = as_written_params();
            given.rebuild_interval = 1;
            given.direction_gate = CAIRN_REAL(0.1);
            given.min_sigma = 1;
            given.sequential_registration = 1;
            assert_int_equal(cairn_lum_memory(&given), cairn_lum_memory(&params));
        }
        lum = new_lum(&pool, &given);
        add_all(lum);
        for (int32_t i = 0; i < SCANS; i++)
            poses[i] = scans[i].start;
        assert_ok(cairn_lum_begin(lum));
        for (int32_t k = 1; k <= 3; k++) {
            cairn_budget budget = {CAIRN_UNBOUNDED};
            double error = reference_iterate(&params, poses);

            assert_ok(cairn_lum_iterate(lum, &budget));
            assert_int_equal(cairn_lum_read(lum).iterations, k);
            assert_near(cairn_lum_read(lum).chi2, error, NUMBER(1e-9, 0.05) * error);
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

/* With memory for the points of these scans alone, twice. */
static void a_room_comes_back(void **state)
{
    cairn_lum_params params = small_params();
    cairn_lum_state end;
    cairn_pool pool;
    cairn_lum *lum;

    (void)state;
    make_scans(0.08, 0.03);
    params.max_points = 0;
    for (int32_t i = 0; i < SCANS; i++)
        params.max_points += scans[i].count;
    lum = new_lum(&pool, &params);
    for (int round = 0; round < 2; round++) {
        add_all(lum);
        assert_ok(cairn_lum_begin(lum));
        assert_status(cairn_lum_begin(lum), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_lum_add_scan(lum, scans[0].at, 1, scans[0].start, NULL),
                      CAIRN_BAD_ARGUMENT);
        assert_ok(run(lum, 1000));
        end = cairn_lum_read(lum);
        assert_int_equal(end.verdict, CAIRN_LUM_CONVERGED);
        assert_int_equal(end.scans, SCANS);
        assert_int_equal(end.links, 6);
        assert_int_equal(end.components, 1);
        assert_true(end.pairs > 6 * 200);
        assert_true(end.max_motion <= params.converged_distance);
        for (int32_t i = 0; i < SCANS; i++) {
            cairn_pose pose = cairn_lum_pose(lum, i);

            assert_int_equal(cairn_lum_is_connected(lum, i), 1);
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

/* ---- Registration ---- */

/* The pose that brings a[i] nearest to b[i] for those used, headings as points 1 m ahead: by
 * repeated normal equations of small turns. */
static cairn_pose reference_motion(const cairn_pose *a, const cairn_pose *b, const int *used)
{
    double theta = 0, tx = 0, ty = 0;

    for (int round = 0; round < 60; round++) {
        double m[3][4] = {{0}};

        for (int32_t i = 0; i < SCANS; i++)
            for (int ahead = 0; ahead < 2 && used[i]; ahead++) {
                /* The heading alone, as the direction of a point 1 m ahead of the origin. */
                double px = ahead ? cos((double)a[i].theta) : (double)a[i].x;
                double py = ahead ? sin((double)a[i].theta) : (double)a[i].y;
                double qx = ahead ? cos((double)b[i].theta) : (double)b[i].x;
                double qy = ahead ? sin((double)b[i].theta) : (double)b[i].y;
                double x = cos(theta) * px - sin(theta) * py, y = sin(theta) * px + cos(theta) * py;
                double rows[2][4] = {{!ahead, 0, -y, qx - x - (ahead ? 0 : tx)},
                                     {0, !ahead, x, qy - y - (ahead ? 0 : ty)}};

                for (int r = 0; r < 2; r++)
                    for (int u = 0; u < 3; u++)
                        for (int v = 0; v < 4; v++)
                            m[u][v] += rows[r][u] * rows[r][v];
            }
        eliminate(&m[0][0], 3);
        tx += m[0][3];
        ty += m[1][3];
        theta += m[2][3];
    }
    return (cairn_pose){(cairn_real)tx, (cairn_real)ty, (cairn_real)theta};
}

/* The best score of the matches of a scan with those placed; its pose. */
static double reference_match(const cairn_lum_params *params, const cairn_pose *placed,
                              const int *used, int32_t scan, cairn_pose start, cairn_pose *pose)
{
    cairn_icp_params icp_params = cairn_icp_default();
    double best = 0;
    int32_t others = 0;

    for (int32_t j = 0; j < SCANS; j++)
        others += used[j];
    if (others == 0)
        return 0;
    icp_params.max_target = SCANS * MAX_COUNT;
    icp_params.max_iterations = 60;
    icp_params.gate_start = params->registration_gate;
    icp_params.gate_end = params->max_pair_distance / 2;
    icp_params.gate_factor = CAIRN_REAL(1.5);
    icp_params.direction_gate = params->direction_gate;
    for (int k = 0; k < 3; k++) {
        cairn_pool pool = test_pool(cairn_icp_memory(&icp_params));
        cairn_budget budget = {CAIRN_UNBOUNDED};
        cairn_pose turned = start;
        cairn_icp_result result;
        cairn_icp *icp;
        double score;

        assert_ok(cairn_icp_create(&icp, &pool, &icp_params));
        for (int32_t j = 0; j < SCANS; j++)
            if (used[j])
                assert_ok(cairn_icp_add_target(icp, scans[j].at, scans[j].count, placed[j], NULL));
        turned.theta += (cairn_real)(k == 2 ? -1 : k) * params->registration_angle;
        assert_ok(cairn_icp_begin(icp, scans[scan].at, scans[scan].count, turned, NULL, NULL));
        assert_ok(cairn_icp_step(icp, &budget));
        result = cairn_icp_read(icp);
        score = (double)result.overlap * sqrt((double)scans[scan].count) /
                ((double)result.mean_distance + (double)params->min_sigma);
        if (result.verdict != CAIRN_ICP_TOO_FEW_PAIRS && score > best) {
            best = score;
            *pose = result.target_query;
        }
        test_pool_free(&pool);
    }
    return best;
}

/* All scans in sequence; returns how many were matched. */
static int32_t reference_register(const cairn_lum_params *params, cairn_pose *placed)
{
    int used[SCANS] = {0};
    cairn_pose starts[SCANS], motion = {0, 0, 0}, back;
    int32_t matched = 0, next;

    for (int32_t i = 0; i < SCANS; i++)
        starts[i] = scans[i].start;
    do {
        double best = 0;
        int32_t most = 0;

        next = -1;
        for (int32_t i = 0; i < SCANS; i++) {
            cairn_pose pose = {0, 0, 0};
            double score = 0;

            if (used[i] || scans[i].count == 0)
                continue;
            score = reference_match(params, placed, used, i, cairn_pose_compose(motion, starts[i]),
                                    &pose);
            if (score > best) {
                best = score;
                next = i;
                placed[i] = pose;
            }
        }
        matched += next >= 0;
        for (int32_t i = 0; i < SCANS && best <= 0; i++)
            if (!used[i] && scans[i].count > most) {
                most = scans[i].count;
                next = i;
                placed[i] = cairn_pose_compose(motion, starts[i]);
            }
        if (next >= 0) {
            used[next] = 1;
            motion = reference_motion(starts, placed, used);
        }
    } while (next >= 0);
    for (int32_t i = 0; i < SCANS; i++)
        if (!used[i])
            placed[i] = cairn_pose_compose(motion, starts[i]);
    back = cairn_pose_compose(starts[0], cairn_pose_inverse(placed[0]));
    for (int32_t i = 0; i < SCANS; i++)
        placed[i] = cairn_pose_compose(back, placed[i]);
    return matched;
}

/* Points of 0.1 m without those nearer to the one before than `register_spacing` of the tests. */
static void double_points(void)
{
    for (int32_t i = 0; i < SCANS; i++)
        for (int32_t k = 0; k < scans[i].count; k += 7) {
            memmove(&scans[i].at[k + 1], &scans[i].at[k],
                    (size_t)(scans[i].count++ - k) * sizeof scans[i].at[0]);
            scans[i].at[k + 1].position.x += CAIRN_REAL(0.01);
        }
}

/* Scans of different shapes, so that a match shows its target. */
static void roughen(void)
{
    cairn_random random = cairn_random_seed(2, 0);

    for (int32_t i = 0; i < SCANS; i++)
        for (int32_t k = 0; k < scans[i].count; k++) {
            scans[i].at[k].position.x += CAIRN_REAL(0.01) * cairn_random_normal(&random);
            scans[i].at[k].position.y += CAIRN_REAL(0.01) * cairn_random_normal(&random);
        }
}

static void check_registration(const cairn_lum_params *params, const cairn_pose *placed,
                               int32_t registered)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_pose pose;
    cairn_pool pool;
    cairn_lum *lum = new_lum(&pool, params);

    for (int round = 0; round < 2; round++) {
        add_all(lum);
        assert_ok(cairn_lum_begin(lum));
        assert_ok(cairn_lum_iterate(lum, &budget));
        assert_int_equal(cairn_lum_read(lum).iterations, 0);
        assert_int_equal(cairn_lum_read(lum).registered_scans, registered);
        for (int32_t i = 0; i < SCANS; i++) {
            pose = cairn_lum_pose(lum, i);
            assert_near(pose.x, placed[i].x, NUMBER(1e-9, 2e-3));
            assert_near(pose.y, placed[i].y, NUMBER(1e-9, 2e-3));
            assert_near(cairn_wrap_angle(pose.theta - placed[i].theta), 0, NUMBER(1e-9, 2e-3));
        }
        pose = cairn_lum_pose(lum, 0);
        assert_memory_equal(&pose, &scans[0].start, sizeof pose);
        budget.left = CAIRN_UNBOUNDED;
        assert_ok(cairn_lum_step(lum, &budget));
        cairn_lum_clear(lum);
    }
    test_pool_free(&pool);
}

static void registration_is_that_of_the_reference(void **state)
{
    cairn_lum_params params = small_params();
    cairn_pose placed[SCANS];

    (void)state;
    params.sequential_registration = 1;
    params.registration_spacing = CAIRN_REAL(0.02);
    make_scans(0.4, 0.35);
    roughen();
    scans[0].count -= 12; /* the first scan is not the first that is placed */
    scans[3].count -= 9;
    check_registration(&params, placed, reference_register(&params, placed));
    assert_int_equal(reference_register(&params, placed), SCANS - 1);
    double_points(); /* which are left out again */
    check_registration(&params, placed, SCANS - 1);
    make_scans(0.4, 0.35);
    roughen();
    scans[1].count = 0;
    scans[2].start.x += 25;
    params.registration_angle = CAIRN_REAL(0.4);
    params.registration_gate = CAIRN_REAL(0.5);
    params.direction_gate = CAIRN_REAL(0.7);
    params.max_pair_distance = CAIRN_REAL(0.3);
    params.min_sigma = CAIRN_REAL(0.05);
    assert_int_equal(reference_register(&params, placed), 1);
    check_registration(&params, placed, 1);
    for (int32_t i = 0; i < SCANS; i++) {
        scans[i].count = 0;
        placed[i] = scans[i].start;
    }
    check_registration(&params, placed, 0);
    make_scans(0.4, 0.35); /* two pieces */
    roughen();
    scans[2].start.x += 25;
    scans[3].start.x += 25;
    params = small_params();
    params.sequential_registration = 1;
    params.registration_spacing = CAIRN_REAL(0.02);
    assert_int_equal(reference_register(&params, placed), 2);
    check_registration(&params, placed, 2);
    make_scans(0.4, 0.35);
    roughen();
    params.registration_angle = 0;
    check_registration(&params, placed, reference_register(&params, placed));
}

/* From poses that the links alone do not correct. */
static void registration_corrects_distant_starts(void **state)
{
    cairn_lum_params params = small_params();
    double farthest[2];

    (void)state;
    make_scans(0.4, 0.35);
    params.rebuild_interval = 5;
    for (int32_t registers = 0; registers < 2; registers++) {
        cairn_pool pool;
        cairn_lum *lum;

        params.sequential_registration = registers;
        lum = new_lum(&pool, &params);
        add_all(lum);
        assert_ok(cairn_lum_begin(lum));
        assert_ok(run(lum, 1000));
        farthest[registers] = 0;
        for (int32_t i = 0; i < SCANS; i++)
            farthest[registers] = fmax(
                farthest[registers], hypot((double)(cairn_lum_pose(lum, i).x - scans[i].truth.x),
                                           (double)(cairn_lum_pose(lum, i).y - scans[i].truth.y)));
        test_pool_free(&pool);
    }
    assert_true(farthest[1] < 0.05);
    assert_true(farthest[0] > 0.2);
}

static void disconnected_parts_stay_and_are_reported(void **state)
{
    cairn_lum_params params = small_params();
    cairn_pool pool;
    cairn_lum *lum = new_lum(&pool, &params);
    cairn_pose pose;

    (void)state;
    make_scans(0.02, 0.01);
    scans[2].start.x += 100; /* without common surfaces, with the next one beside it */
    scans[3].start.x += 100;
    scans[1].count = 0;
    add_all(lum);
    assert_ok(cairn_lum_begin(lum));
    assert_ok(run(lum, CAIRN_UNBOUNDED));
    assert_int_equal(cairn_lum_read(lum).verdict, CAIRN_LUM_CONVERGED);
    assert_int_equal(cairn_lum_read(lum).components, 3);
    assert_int_equal(cairn_lum_read(lum).links, 1);
    for (int32_t i = 0; i < SCANS; i++)
        assert_int_equal(cairn_lum_is_connected(lum, i), i == 0);
    for (int32_t i = 0; i < 3; i++) {
        pose = cairn_lum_pose(lum, i);
        assert_memory_equal(&pose, &scans[i].start, sizeof pose);
    }
    pose = cairn_pose_between(cairn_lum_pose(lum, 2), cairn_lum_pose(lum, 3));
    assert_near(pose.y, cairn_pose_between(scans[2].truth, scans[3].truth).y, 0.05);
    test_pool_free(&pool);
}

static void capacities_are_reported(void **state)
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
        assert_fault(&fault, cairn_lum_add_scan(lum, scans[0].at, 1, scans[0].start, &fault),
                     CAIRN_FULL, -1);
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
    assert_fault(&fault, cairn_lum_add_scan(lum, scans[0].at, 1, scans[0].start, &fault),
                 CAIRN_FULL, -1);
    assert_ok(cairn_lum_begin(lum));
    assert_ok(run(lum, 1));
    assert_int_equal(cairn_lum_read(lum).verdict, CAIRN_LUM_CONVERGED); /* alone */
    test_pool_free(&pool);
    params = small_params();
    params.max_iterations = 1;
    params.sequential_registration = 1;
    lum = new_lum(&pool, &params);
    add_all(lum);
    assert_ok(cairn_lum_begin(lum));
    assert_ok(run(lum, CAIRN_UNBOUNDED));
    for (int again = 0; again < 2; again++) {
        assert_int_equal(cairn_lum_read(lum).verdict, CAIRN_LUM_OUT_OF_ITERATIONS);
        assert_int_equal(cairn_lum_read(lum).iterations, 1);
        assert_int_equal(cairn_lum_read(lum).registered_scans, SCANS - 1);
        assert_ok(cairn_lum_begin(lum)); /* from where it has ended */
        assert_int_equal(cairn_lum_read(lum).verdict, CAIRN_LUM_RUNNING);
        assert_int_equal(cairn_lum_read(lum).iterations, 0);
        assert_ok(run(lum, CAIRN_UNBOUNDED));
    }
    test_pool_free(&pool);
}

/* Two scans whose points meet end to end, `gap` apart: linked when that is at most the distance of
 * pairs. */
static void scans_that_just_meet(void **state)
{
    enum { COUNT = 11 };
    static const struct {
        cairn_real gap;
        int32_t links;
    } known[] = {
        {0, 1}, {CAIRN_REAL(0.15), 1}, {CAIRN_REAL(0.19), 1}, {CAIRN_REAL(0.21), 0}, {1, 0}};

    (void)state;
    for (size_t k = 0; k < sizeof known / sizeof *known; k++)
        for (int turn = 0; turn < 4; turn++) {
            const cairn_real x[4] = {1, 0, -1, 0};
            cairn_oriented_point end[2][COUNT];
            cairn_lum_params params = small_params();
            cairn_pose pose = {0, 0, 0};
            cairn_pool pool;
            cairn_lum *lum = new_lum(&pool, &params);

            for (int side = 0; side < 2; side++)
                for (int i = 0; i < COUNT; i++) {
                    cairn_real along = side == 0 ? 1 : -1,
                               across = CAIRN_REAL(0.01) * (cairn_real)i;

                    end[side][i].direction.x = x[turn];
                    end[side][i].direction.y = x[(turn + 3) % 4];
                    end[side][i].position.x = along * x[turn] - across * x[(turn + 3) % 4];
                    end[side][i].position.y = along * x[(turn + 3) % 4] + across * x[turn];
                }
            assert_ok(cairn_lum_add_scan(lum, end[0], COUNT, pose, NULL));
            pose.x = (2 + known[k].gap) * x[turn];
            pose.y = (2 + known[k].gap) * x[(turn + 3) % 4];
            assert_ok(cairn_lum_add_scan(lum, end[1], COUNT, pose, NULL));
            assert_ok(cairn_lum_begin(lum));
            assert_ok(run(lum, CAIRN_UNBOUNDED));
            assert_int_equal(cairn_lum_read(lum).links, known[k].links);
            assert_int_equal(cairn_lum_read(lum).components, 2 - known[k].links);
            test_pool_free(&pool);
        }
}

/* Every point has its nearest one in the next cell of the grid, on all sides and across corners. */
static void pairs_across_cells_are_found(void **state)
{
    enum { COUNT = 12, SIDES = 9 };

    (void)state;
    for (int32_t side = 0; side < SIDES; side++) {
        const int32_t column = side % 3, row = side / 3;
        const cairn_vec2 toward = {(cairn_real)(column - 1), (cairn_real)(row - 1)};
        cairn_oriented_point target[COUNT], query[COUNT];
        cairn_lum_params params = small_params();
        cairn_pool pool;
        cairn_lum *lum;

        params.max_pair_distance = CAIRN_REAL(0.25);
        params.min_pairs = COUNT - 1;
        lum = new_lum(&pool, &params);
        for (int32_t k = 0; k < COUNT; k++) {
            cairn_vec2 middle = {(cairn_real)k + CAIRN_REAL(0.125),
                                 (cairn_real)(k * k % 5) + CAIRN_REAL(0.125)};

            query[k].direction.x = 1;
            query[k].direction.y = 0;
            query[k].position = cairn_vec2_add(middle, cairn_vec2_scale(toward, CAIRN_REAL(0.12)));
            target[k] = query[k];
            target[k].position =
                cairn_vec2_add(query[k].position, cairn_vec2_scale(toward, CAIRN_REAL(0.02)));
        }
        assert_ok(cairn_lum_add_scan(lum, target, COUNT, cairn_pose_identity(), NULL));
        assert_ok(cairn_lum_add_scan(lum, query, COUNT, cairn_pose_identity(), NULL));
        assert_ok(cairn_lum_begin(lum));
        assert_ok(run(lum, CAIRN_UNBOUNDED));
        assert_int_equal(cairn_lum_read(lum).links, 1);
        test_pool_free(&pool);
    }
}

/* Of points at equal distance the one with the lowest index corresponds, whichever its bucket. */
static void of_equal_distances_the_lowest_index(void **state)
{
    (void)state;
    for (int32_t order = 0; order < 2; order++) {
        cairn_lum_params params = small_params();
        cairn_oriented_point target[24], query[12];
        cairn_budget budget = {CAIRN_UNBOUNDED};
        cairn_pool pool;
        cairn_lum *lum = new_lum(&pool, &params);

        for (int32_t k = 0; k < 12; k++) {
            query[k].position.x = (cairn_real)(k < 6 ? k - 3 : 2);
            query[k].position.y = (cairn_real)(k < 6 ? 0 : k - 7);
            query[k].direction.x = 1;
            query[k].direction.y = 0;
            for (int32_t i = 0; i < 2; i++) {
                target[2 * k + i] = query[k];
                target[2 * k + i].position.x +=
                    CAIRN_REAL(0.125) * (cairn_real)(i == order ? -1 : 1);
            }
        }
        assert_ok(cairn_lum_add_scan(lum, target, 24, cairn_pose_identity(), NULL));
        assert_ok(cairn_lum_add_scan(lum, query, 12, cairn_pose_identity(), NULL));
        assert_ok(cairn_lum_begin(lum));
        assert_ok(cairn_lum_iterate(lum, &budget));
        assert_near(cairn_lum_pose(lum, 1).x, order == 0 ? -0.125 : 0.125, NUMBER(1e-9, 1e-5));
        assert_near(cairn_lum_pose(lum, 1).theta, 0, NUMBER(1e-9, 1e-5));
        test_pool_free(&pool);
    }
}

/* Only what the thesis has; pairs that fit exactly cause no division by 0. */
static void as_written(void **state)
{
    cairn_lum_params p = as_written_params(), other = p;
    cairn_pool pool;
    cairn_lum *lum;

    (void)state;
    assert_int_equal(p.mode, CAIRN_MODE_AS_WRITTEN);
    assert_int_equal(p.rebuild_interval, 0);
    assert_int_equal(p.min_pairs, 5);
    assert_int_equal(p.max_iterations, 500);
    assert_int_equal(p.sequential_registration, 0);
    assert_near(p.max_pair_distance, 0.2, 1e-7);
    assert_near(p.direction_gate, acos(-1), 1e-6);
    other.sequential_registration = 1;
    other.registration_gate = 2;
    assert_int_equal(cairn_lum_memory(&other), cairn_lum_memory(&p));
    other.mode = 2;
    assert_int_equal(cairn_lum_memory(&other), 0);
    make_scans(0, 0);
    lum = new_lum(&pool, &p);
    /* all equal, with opposite directions in every other one */
    for (int32_t i = 0; i < SCANS; i++) {
        for (int32_t k = 0; k < scans[0].count && i % 2 != 0; k++)
            scans[0].at[k].direction = cairn_vec2_scale(scans[0].at[k].direction, -1);
        assert_ok(cairn_lum_add_scan(lum, scans[0].at, scans[0].count, scans[0].truth, NULL));
    }
    assert_ok(cairn_lum_begin(lum));
    assert_ok(run(lum, CAIRN_UNBOUNDED));
    assert_int_equal(cairn_lum_read(lum).verdict, CAIRN_LUM_CONVERGED);
    assert_int_equal(cairn_lum_read(lum).iterations, 1);
    assert_int_equal(cairn_lum_read(lum).links, SCANS * (SCANS - 1) / 2);
    assert_int_equal(cairn_lum_read(lum).pairs, SCANS * (SCANS - 1) / 2 * scans[0].count);
    assert_near(cairn_lum_read(lum).chi2, 0, NUMBER(1e-9, 1e-3));
    for (int32_t i = 0; i < SCANS; i++)
        assert_near(cairn_lum_pose(lum, i).x, scans[0].truth.x, 1e-5);
    test_pool_free(&pool);
}

/* The units charged for an alignment of three scans, one of them empty. */
static void units_are_as_reported(void **state)
{
    static const int32_t units[3] = {12686, NUMBER(64864, 69359),
                                     /* without and with registration; without turns */
                                     NUMBER(27228, 27459)};

    (void)state;
    for (int32_t way = 0; way < 3; way++) {
        cairn_lum_params params = small_params();
        cairn_budget budget = {CAIRN_UNBOUNDED};
        cairn_pool pool;
        cairn_lum *lum;

        make_scans(0.05, 0.03);
        scans[2].count = 0;
        params.sequential_registration = way > 0;
        params.registration_angle = way == 2 ? 0 : params.registration_angle;
        params.max_iterations = 2;
        params.rebuild_interval = 1;
        lum = new_lum(&pool, &params);
        add_all(lum);
        assert_ok(cairn_lum_begin(lum));
        assert_ok(cairn_lum_step(lum, &budget));
        assert_int_equal(CAIRN_UNBOUNDED - budget.left, units[way]);
        test_pool_free(&pool);
    }
}

/* Scans too far apart for links are compared all the same, and that is charged. */
static void a_search_without_links_is_charged(void **state)
{
    enum { FAR = 64 };
    const cairn_oriented_point point = {{1, 0}, {0, 1}};
    cairn_lum_params params = cairn_lum_default();
    int32_t units = 0;
    cairn_status status;
    cairn_pool pool;
    cairn_lum *lum;

    (void)state;
    params.max_scans = params.max_points = FAR;
    params.max_iterations = 1;
    lum = new_lum(&pool, &params);
    for (int32_t i = 0; i < FAR; i++)
        assert_ok(
            cairn_lum_add_scan(lum, &point, 1, (cairn_pose){(cairn_real)(100 * i), 0, 0}, NULL));
    assert_ok(cairn_lum_begin(lum));
    do {
        cairn_budget budget = {1};

        status = cairn_lum_step(lum, &budget);
        units += 1 - budget.left;
    } while (status == CAIRN_MORE);
    assert_ok(status);
    assert_int_equal(cairn_lum_read(lum).links, 0);
    /* scan i is compared with 63 - i others, eight a unit: 280 units in all; 735 for the rest */
    assert_int_equal(units, 280 + 735);
    test_pool_free(&pool);
}

static uint64_t hash_with(int32_t units, int32_t registers)
{
    cairn_lum_params params = small_params();
    uint64_t hash = TEST_HASH_START;
    cairn_pool pool;
    cairn_lum *lum;
    cairn_lum_state end;

    params.sequential_registration = registers;
    lum = new_lum(&pool, &params);
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
    hash = test_hash(hash, &end.links, sizeof end.links);
    hash = test_hash(hash, &end.iterations, sizeof end.iterations);
    test_pool_free(&pool);
    return hash;
}

static void budgets_do_not_matter(void **state)
{
    (void)state;
    for (int32_t registers = 0; registers < 2; registers++) {
        static const uint64_t known[2][2] = {
            {UINT64_C(0xb93b06110ef1e8a0), UINT64_C(0x921677807c401ecf)},
            {UINT64_C(0xb4e402c0d32be38b), UINT64_C(0x9ca876222610623d)}};
        uint64_t hash = hash_with(CAIRN_UNBOUNDED, registers);

        assert_golden(hash, known[registers][0], known[registers][1]);
        assert_true(hash_with(1, registers) == hash);
        assert_true(hash_with(7, registers) == hash);
        assert_true(hash_with(1000, registers) == hash);
    }
}

/* Returns of iterate() at the ends of the registration and of the iterations; each shows links. */
static int32_t commits_with(int32_t units)
{
    cairn_lum_params params = small_params();
    int32_t commits = 0;
    cairn_status status;
    cairn_pool pool;
    cairn_lum *lum;

    params.sequential_registration = 1;
    params.rebuild_interval = 2;
    params.max_iterations = 5;
    lum = new_lum(&pool, &params);
    make_scans(0.05, 0.03);
    add_all(lum);
    assert_ok(cairn_lum_begin(lum));
    while (cairn_lum_read(lum).verdict == CAIRN_LUM_RUNNING) {
        do {
            cairn_budget budget = {units};

            status = cairn_lum_iterate(lum, &budget);
        } while (status == CAIRN_MORE);
        assert_ok(status);
        assert_int_equal(cairn_lum_read(lum).iterations, commits);
        assert_int_equal(cairn_lum_read(lum).links > 0, commits > 0);
        commits++;
    }
    test_pool_free(&pool);
    return commits;
}

static void iterate_returns_at_every_commit_whatever_the_budgets(void **state)
{
    int32_t commits = commits_with(CAIRN_UNBOUNDED);

    (void)state;
    assert_true(commits > 3);
    assert_int_equal(commits_with(1), commits);
    assert_int_equal(commits_with(7), commits);
}

static cairn_status create_one(void *context, cairn_pool *pool)
{
    cairn_lum *lum;

    return cairn_lum_create(&lum, pool, context);
}

static void refusals(void **state)
{
    const cairn_real nan = (cairn_real)NAN;
    cairn_lum_params good = small_params(), bad = good;
    cairn_oriented_point point = {{0, 0}, {1, 0}};
    cairn_pose pose = cairn_pose_identity();
    cairn_object_fault refused;
    cairn_lum *lum = NULL;
    cairn_fault fault;
    cairn_pool pool;

    (void)state;
    bad.registration_gate = CAIRN_REAL(0.19);
    assert_status(cairn_lum_check(&bad, &refused), CAIRN_BAD_ARGUMENT);
    assert_string_equal(refused.rule, "registration_gate: at least max_pair_distance");
    assert_int_equal(cairn_lum_memory(&bad), 0);
    bad.registration_gate = bad.max_pair_distance;
    assert_ok(cairn_lum_check(&bad, &refused));
    pool = test_pool(1 << 16);
    assert_status(cairn_lum_create(NULL, &pool, &good), CAIRN_BAD_ARGUMENT);
    test_pool_free(&pool);
    good.max_points = 5;
    test_every_pool_size(create_one, &good, cairn_lum_memory(&good));
    good.sequential_registration = 1;
    test_every_pool_size(create_one, &good, cairn_lum_memory(&good));
    lum = new_lum(&pool, &good);
    assert_status(cairn_lum_begin(NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_lum_begin(lum), CAIRN_EMPTY);
    assert_status(cairn_lum_add_scan(NULL, &point, 1, pose, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_lum_add_scan(lum, NULL, 1, pose, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_lum_add_scan(lum, &point, -1, pose, NULL), CAIRN_BAD_ARGUMENT);
    pose.y = nan;
    assert_fault(&fault, cairn_lum_add_scan(lum, &point, 1, pose, &fault), CAIRN_NOT_FINITE, -1);
    pose.y = CAIRN_REAL(2e6);
    assert_fault(&fault, cairn_lum_add_scan(lum, &point, 1, pose, &fault), CAIRN_BAD_ARGUMENT, -1);
    pose.y = 0;
    point.position.y = nan;
    assert_fault(&fault, cairn_lum_add_scan(lum, &point, 1, pose, &fault), CAIRN_NOT_FINITE, 0);
    point.position.y = CAIRN_REAL(2e6);
    assert_fault(&fault, cairn_lum_add_scan(lum, &point, 1, pose, &fault), CAIRN_BAD_ARGUMENT, 0);
    point.position.y = 0;
    point.position.x = nan;
    assert_fault(&fault, cairn_lum_add_scan(lum, &point, 1, pose, &fault), CAIRN_NOT_FINITE, 0);
    point.position.x = CAIRN_REAL(-2e6);
    assert_fault(&fault, cairn_lum_add_scan(lum, &point, 1, pose, &fault), CAIRN_BAD_ARGUMENT, 0);
    point.position.x = 0;
    point.direction.x = nan;
    assert_fault(&fault, cairn_lum_add_scan(lum, &point, 1, pose, &fault), CAIRN_NOT_FINITE, 0);
    point.direction.x = CAIRN_REAL(0.98);
    assert_fault(&fault, cairn_lum_add_scan(lum, &point, 1, pose, &fault), CAIRN_BAD_ARGUMENT, 0);
    point.direction.x = CAIRN_REAL(1.02);
    assert_fault(&fault, cairn_lum_add_scan(lum, &point, 1, pose, &fault), CAIRN_BAD_ARGUMENT, 0);
    assert_int_equal(cairn_lum_read(lum).scans, 0);
    point.direction.x = CAIRN_REAL(0.992);
    assert_ok(cairn_lum_add_scan(lum, &point, 1, pose, NULL));
    point.direction.x = CAIRN_REAL(1.008);
    assert_ok(cairn_lum_add_scan(lum, &point, 1, pose, NULL));
    /* Indices outside read no array. */
    for (int k = 0; k < 4; k++) {
        const int32_t outside[] = {-1, 2, INT32_MIN, INT32_MAX};

        assert_near(cairn_lum_pose(lum, outside[k]).x, 0, 0);
        assert_int_equal(cairn_lum_is_connected(lum, outside[k]), 0);
    }
    test_pool_free(&pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(iterations_are_those_of_the_reference),
        cmocka_unit_test(a_room_comes_back),
        cmocka_unit_test(registration_is_that_of_the_reference),
        cmocka_unit_test(registration_corrects_distant_starts),
        cmocka_unit_test(disconnected_parts_stay_and_are_reported),
        cmocka_unit_test(capacities_are_reported),
        cmocka_unit_test(scans_that_just_meet),
        cmocka_unit_test(pairs_across_cells_are_found),
        cmocka_unit_test(of_equal_distances_the_lowest_index),
        cmocka_unit_test(as_written),
        cmocka_unit_test(units_are_as_reported),
        cmocka_unit_test(a_search_without_links_is_charged),
        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(iterate_returns_at_every_commit_whatever_the_budgets),
        cmocka_unit_test(refusals),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
