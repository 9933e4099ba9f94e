/* ICP: iterations compared with a reference implementation, known motions, unobservable
 * directions, covariances, refusals. */
#include "tests/poses.h"

#include <math.h>

#include "cairn/icp.h"
#include "cairn/small_matrix.h"

enum { MAX_POINTS = 2000 };

/* An L-shaped room, counter-clockwise, so that the inside is on the left. */
static const cairn_vec2 L_ROOM[] = {{-3, -2}, {4, -2}, {4, 1}, {1, 1}, {1, 4}, {-3, 4}};

struct points {
    cairn_oriented_point at[MAX_POINTS];
    int32_t count;
};

/* Points every `spacing` along a -> b, from half a spacing on. */
static void add_wall(struct points *points, cairn_vec2 a, cairn_vec2 b, cairn_real spacing)
{
    cairn_vec2 along = cairn_vec2_sub(b, a), unit = cairn_vec2_unit(along);
    cairn_real length = cairn_vec2_norm(along);

    for (cairn_real s = spacing / 2; s < length; s += spacing) {
        assert_true(points->count < MAX_POINTS);
        points->at[points->count].position = cairn_vec2_add(a, cairn_vec2_scale(unit, s));
        points->at[points->count].direction = unit;
        points->count++;
    }
}

static void add_room(struct points *points, const cairn_vec2 *corners, int32_t count,
                     cairn_real spacing)
{
    for (int32_t i = 0; i < count; i++)
        add_wall(points, corners[i], corners[(i + 1) % count], spacing);
}

static void l_room(struct points *points, cairn_real spacing)
{
    points->count = 0;
    add_room(points, L_ROOM, 6, spacing);
}

/* The points as seen from `pose`, with normal noise across their lines. */
static void seen_from(const struct points *world, cairn_pose pose, cairn_real noise,
                      cairn_random *random, struct points *seen)
{
    cairn_transform inverse = cairn_transform_of(cairn_pose_inverse(pose));

    seen->count = world->count;
    for (int32_t i = 0; i < world->count; i++) {
        cairn_real by = noise > 0 ? noise * cairn_random_normal(random) : 0;
        cairn_vec2 normal = cairn_vec2_left_perp(world->at[i].direction);

        seen->at[i].position = cairn_transform_point(
            inverse, cairn_vec2_add(world->at[i].position, cairn_vec2_scale(normal, by)));
        seen->at[i].direction = cairn_transform_direction(inverse, world->at[i].direction);
    }
}

static cairn_icp *make_icp(cairn_pool *pool, cairn_icp_params params)
{
    cairn_icp *icp;

    *pool = test_pool(cairn_icp_memory(&params));
    assert_ok(cairn_icp_create(&icp, pool, &params));
    return icp;
}

static cairn_icp_result align(cairn_icp *icp, const struct points *query, cairn_pose start,
                              const cairn_rigid_motion_pose_prior *prior)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_icp_result result;

    assert_ok(cairn_icp_begin(icp, query->at, query->count, start, prior, NULL));
    result = cairn_icp_read(icp);
    assert_int_equal(result.verdict, CAIRN_ICP_RUNNING);
    assert_memory_equal(&result.target_query, &start, sizeof start);
    assert_ok(cairn_icp_step(icp, &budget));
    result = cairn_icp_read(icp);
    assert_true(result.verdict != CAIRN_ICP_RUNNING);
    for (int k = 0; k < 9; k++) {
        assert_true(cairn_is_finite(result.covariance[k]));
        assert_near(result.covariance[k], result.covariance[k % 3 * 3 + k / 3],
                    1e-9 + 1e-5 * fabs((double)result.covariance[k]));
    }
    return result;
}

static void add_target(cairn_icp *icp, const struct points *target)
{
    assert_ok(cairn_icp_add_target(icp, target->at, target->count, cairn_pose_identity(), NULL));
}

/* ---- Reference implementation: all pairs, normal equations about the centroid, in double ---- */

struct reference {
    double x, y, theta, gate, sigma, point_sigma;
    double covariance[3][3];
    double mean_distance;
    int32_t pairs;
};

static void reference_prior(const cairn_rigid_motion_pose_prior *prior,
                            const struct reference *reference, double kx, double ky, double m[3][4])
{
    for (int k = 0; prior != NULL && k < 3; k++) {
        double pc = cos((double)prior->mean.theta), ps = sin((double)prior->mean.theta);
        double ax = k == 0 ? pc : k == 1 ? -ps : 0, ay = k == 0 ? ps : k == 1 ? pc : 0;
        double row[3] = {ax, ay, k < 2 ? -ax * kx - ay * ky : 1};
        double e = k < 2 ? ax * (reference->x - (double)prior->mean.x) +
                               ay * (reference->y - (double)prior->mean.y)
                         : reference->theta - (double)prior->mean.theta;
        double w = pow((double)(k == 0   ? prior->sigma_x
                                : k == 1 ? prior->sigma_y
                                         : prior->sigma_theta),
                       -2);

        for (int u = 0; u < 3; u++) {
            for (int v = 0; v < 3; v++)
                m[u][v] += w * row[u] * row[v];
            m[u][3] -= w * row[u] * e;
        }
    }
}

/* Gauss and Jordan for a positive definite matrix with one or more right sides, which become the
 * solutions. */
static void eliminate(double m[3][4], double sides[3][3])
{
    for (int p = 0; p < 3; p++)
        for (int u = 0; u < 3; u++) {
            double f = m[u][p] / m[p][p];

            for (int v = 0; v < 4 && u != p; v++)
                m[u][v] -= f * m[p][v];
            for (int v = 0; v < 3 && u != p; v++)
                sides[u][v] -= f * sides[p][v];
        }
    for (int u = 0; u < 3; u++) {
        m[u][3] /= m[u][u];
        for (int v = 0; v < 3; v++)
            sides[u][v] /= m[u][u];
    }
}

static void reference_iterate(const cairn_icp_params *params, const struct points *target,
                              const struct points *query,
                              const cairn_rigid_motion_pose_prior *prior,
                              struct reference *reference)
{
    double a[3][4] = {{0}}, lines[3][3] = {{0}}, weights = 0, squares = 0, psi = 0, slopes = 0,
           points = 0, far = 0;
    double cx = 0, cy = 0, c = cos(reference->theta), s = sin(reference->theta), distance = 0,
           variance, scale;
    double kx, ky, information[3][4] = {{0}}, g[3][3], n, sigma = reference->sigma,
                   point_sigma = reference->point_sigma;
    int to_line = params->mode == CAIRN_ICP_POINT_TO_LINE;

    for (int32_t i = 0; i < query->count; i++) {
        cx += (double)query->at[i].position.x / query->count;
        cy += (double)query->at[i].position.y / query->count;
    }
    reference->pairs = 0;
    for (int32_t i = 0; i < query->count; i++) {
        const cairn_oriented_point *q = &query->at[i];
        double qx = (double)q->position.x, qy = (double)q->position.y;
        double px = c * qx - s * qy + reference->x, py = s * qx + c * qy + reference->y;
        double ux = c * (double)q->direction.x - s * (double)q->direction.y;
        double uy = s * (double)q->direction.x + c * (double)q->direction.y;
        double best = reference->gate * reference->gate, ex, ey, e, w, axes[3][2];
        double armx = -s * (qx - cx) - c * (qy - cy), army = c * (qx - cx) - s * (qy - cy);
        int32_t pair = -1;

        for (int32_t k = 0; k < target->count; k++) {
            const cairn_oriented_point *t = &target->at[k];
            double d = pow((double)t->position.x - px, 2) + pow((double)t->position.y - py, 2);

            if (d < best && ux * (double)t->direction.x + uy * (double)t->direction.y >=
                                cos((double)params->direction_gate)) {
                best = d;
                pair = k;
            }
        }
        if (pair < 0)
            continue;
        reference->pairs++;
        distance += sqrt(best);
        ex = px - (double)target->at[pair].position.x;
        ey = py - (double)target->at[pair].position.y;
        axes[0][0] = -(double)target->at[pair].direction.y;
        axes[0][1] = (double)target->at[pair].direction.x;
        axes[1][0] = axes[2][1] = 1;
        axes[1][1] = axes[2][0] = 0;
        e = axes[0][0] * ex + axes[0][1] * ey;
        w = 1 / (1 + e * e / pow(2.385 * sigma, 2));
        weights += w;
        squares += w * e * e;
        psi += w * e * w * e;
        slopes += (1 - e * e / pow(2.385 * sigma, 2)) * w * w;
        for (int k = 0; k < 3; k++) {
            double row[3] = {axes[k][0], axes[k][1], axes[k][0] * armx + axes[k][1] * army};
            double wp = k == 0 ? w : 1 / (1 + best / pow(2.385 * point_sigma, 2));

            for (int u = 0; u < 3; u++)
                for (int v = 0; v < 3; v++) {
                    lines[u][v] += k == 0 ? w * row[u] * row[v] : 0;
                    a[u][v] += (k == 0) == to_line ? wp * row[u] * row[v] : 0;
                }
            for (int u = 0; u < 3; u++)
                a[u][3] -=
                    (k == 0) == to_line ? wp * row[u] * (axes[k][0] * ex + axes[k][1] * ey) : 0;
            if (k == 1) {
                points += wp;
                far += wp * best;
            }
        }
    }
    n = reference->pairs;
    reference->sigma = fmax((double)params->min_sigma, sqrt(1.26 * squares / weights));
    reference->point_sigma = fmax((double)params->min_sigma, sqrt(1.26 * far / points / 2));
    variance = pow(to_line ? reference->sigma : reference->point_sigma, 2);
    kx = -s * cx - c * cy;
    ky = c * cx - s * cy;
    scale =
        fmax(psi / (n - 3) * (weights / n) / pow(slopes / n, 2), pow((double)params->min_sigma, 2));
    for (int u = 0; u < 3; u++)
        for (int v = 0; v < 4; v++) {
            a[u][v] /= variance;
            if (v < 3)
                information[u][v] = lines[u][v] / scale;
        }
    reference_prior(prior, reference, kx, ky, a);
    for (int i = 0; i < 9; i++)
        g[i / 3][i % 3] = i % 4 == 0;
    eliminate(a, g);
    reference->x += a[0][3] + c * cx - s * cy;
    reference->y += a[1][3] + s * cx + c * cy;
    reference->theta += a[2][3];
    c = cos(reference->theta);
    s = sin(reference->theta);
    reference->x -= c * cx - s * cy;
    reference->y -= s * cx + c * cy;
    kx = -s * cx - c * cy;
    ky = c * cx - s * cy;
    reference_prior(prior, reference, kx, ky, information);
    for (int i = 0; i < 9; i++)
        g[i / 3][i % 3] = i % 4 == 0;
    eliminate(information, g);
    for (int u = 0; u < 3; u++)
        for (int v = 0; v < 3; v++) {
            double to[3][3] = {{1, 0, -kx}, {0, 1, -ky}, {0, 0, 1}};

            reference->covariance[u][v] = 0;
            for (int i = 0; i < 9; i++)
                reference->covariance[u][v] += to[u][i / 3] * g[i / 3][i % 3] * to[v][i % 3];
        }
    reference->mean_distance = distance / n;
    reference->gate =
        fmin(reference->gate, fmax((double)params->gate_end,
                                   (double)params->gate_factor * reference->mean_distance));
}

/* Every iteration compared with the reference implementation, in both modes, with and without
 * prior. */
static void test_icp_matches_reference(void **state)
{
    static struct points world, target, query;
    cairn_random random = cairn_random_seed(31, 0);
    double tolerance = NUMBER(1e-9, 2e-4);

    (void)state;
    l_room(&world, CAIRN_REAL(0.13));
    seen_from(&world, cairn_pose_identity(), CAIRN_REAL(0.02), &random, &target);
    l_room(&world, CAIRN_REAL(0.17));
    for (int k = 0; k < 8; k++) {
        cairn_pose truth = random_pose(&random, CAIRN_REAL(0.8), 3),
                   off = random_pose(&random, CAIRN_REAL(0.1), CAIRN_REAL(0.08));
        cairn_pose start = cairn_pose_compose(truth, off);
        cairn_rigid_motion_pose_prior prior = {start, CAIRN_REAL(0.02), CAIRN_REAL(0.05),
                                               CAIRN_REAL(0.01)};
        cairn_icp_params params = cairn_icp_default();
        struct reference reference = {
            (double)start.x, (double)start.y, (double)start.theta, 0.5, 0.5, 0.5, {{0}}, 0, 0};

        seen_from(&world, truth, CAIRN_REAL(0.02), &random, &query);
        for (int32_t i = 0; i < query.count; i++)
            query.at[i].position.x += i % 17 == 0 ? CAIRN_REAL(0.15) : 0;
        params.mode = k % 2 ? CAIRN_ICP_POINT_TO_LINE : CAIRN_ICP_POINT_TO_POINT;
        params.converged_distance = params.converged_angle = CAIRN_REAL(1e-30);
        for (int32_t iterations = 1; iterations <= 6; iterations++) {
            cairn_pool pool;
            cairn_icp *icp;
            cairn_icp_result result;
            cairn_pose pose;

            params.max_iterations = iterations;
            icp = make_icp(&pool, params);
            add_target(icp, &target);
            result = align(icp, &query, start, k < 4 ? NULL : &prior);
            assert_near(result.gate, reference.gate, tolerance);
            reference_iterate(&params, &target, &query, k < 4 ? NULL : &prior, &reference);
            pose.x = (cairn_real)reference.x;
            pose.y = (cairn_real)reference.y;
            pose.theta = (cairn_real)reference.theta;
            assert_int_equal(result.verdict, CAIRN_ICP_OUT_OF_ITERATIONS);
            assert_int_equal(result.iterations, iterations);
            assert_pose_near(result.target_query, pose, tolerance, tolerance);
            assert_true(abs(result.pairs - reference.pairs) <= NUMBER(0, 2));
            assert_near(result.overlap, (double)result.pairs / query.count, 1e-6);
            assert_near(result.mean_distance, reference.mean_distance, tolerance);
            assert_near(result.sigma, reference.sigma, tolerance);
            assert_int_equal(result.observable_dof, 3);
            for (int i = 0; i < 9; i++)
                assert_near(result.covariance[i], reference.covariance[i / 3][i % 3],
                            NUMBER(1e-6, 0.03) * sqrt(reference.covariance[i / 3][i / 3] *
                                                      reference.covariance[i % 3][i % 3]));
            test_pool_free(&pool);
        }
    }
}

/* ---- Known motions ---- */

static void test_known_motions_without_noise(void **state)
{
    static struct points world, query;
    cairn_random random = cairn_random_seed(32, 0);
    cairn_pool pool;
    cairn_icp *icp = make_icp(&pool, cairn_icp_default());

    (void)state;
    l_room(&world, CAIRN_REAL(0.1));
    add_target(icp, &world);
    assert_int_equal(cairn_icp_target_count(icp), world.count);
    for (int k = 0; k < 40; k++) {
        cairn_pose truth = random_pose(&random, 1, 3);
        cairn_pose start =
            cairn_pose_compose(truth, random_pose(&random, CAIRN_REAL(0.15), CAIRN_REAL(0.1)));
        cairn_icp_result result;

        seen_from(&world, truth, 0, &random, &query);
        result = align(icp, &query, start, NULL);
        assert_int_equal(result.verdict, CAIRN_ICP_CONVERGED);
        assert_pose_near(result.target_query, truth, NUMBER(1e-6, 5e-5), NUMBER(1e-6, 5e-5));
        assert_true(result.iterations <= 15);
        assert_true(result.overlap > CAIRN_REAL(0.98));
        assert_near(result.sigma, 0.01, 1e-6);
    }
    test_pool_free(&pool);
}

/* The local map is added scan by scan, each from its pose; point to point and point to line
 * agree. */
static void test_known_motions_with_noise(void **state)
{
    static struct points world, query, scan;
    cairn_random random = cairn_random_seed(33, 0);

    (void)state;
    for (int mode = CAIRN_ICP_POINT_TO_POINT; mode <= CAIRN_ICP_POINT_TO_LINE; mode++) {
        cairn_icp_params params = cairn_icp_default();
        cairn_pool pool;
        cairn_icp *icp;
        double worst = 0;

        params.mode = mode;
        icp = make_icp(&pool, params);
        for (int k = 0; k < 3; k++) {
            cairn_pose pose = random_pose(&random, 1, 3);

            l_room(&world, CAIRN_REAL(0.09) + CAIRN_REAL(0.01) * (cairn_real)k);
            seen_from(&world, pose, CAIRN_REAL(0.01), &random, &scan);
            assert_ok(cairn_icp_add_target(icp, scan.at, scan.count, pose, NULL));
        }
        for (int k = 0; k < 20; k++) {
            cairn_pose truth = random_pose(&random, 1, 3);
            cairn_pose start =
                cairn_pose_compose(truth, random_pose(&random, CAIRN_REAL(0.1), CAIRN_REAL(0.1)));
            cairn_icp_result result;

            seen_from(&world, truth, CAIRN_REAL(0.01), &random, &query);
            result = align(icp, &query, start, NULL);
            assert_true(result.verdict == CAIRN_ICP_CONVERGED || mode == CAIRN_ICP_POINT_TO_POINT);
            assert_pose_near(result.target_query, truth, 0.008, 0.004);
            worst = fmax(worst, hypot((double)(result.target_query.x - truth.x),
                                      (double)(result.target_query.y - truth.y)));
            assert_int_equal(result.observable_dof, 3);
        }
        assert_true(worst > 1e-4);
        test_pool_free(&pool);
    }
}

/* A tenth of the query is displaced by up to half a metre: no more error than from noise. */
static void test_outliers(void **state)
{
    static struct points world, query;
    cairn_random random = cairn_random_seed(34, 0);
    cairn_pool pool;
    cairn_icp *icp = make_icp(&pool, cairn_icp_default());

    (void)state;
    l_room(&world, CAIRN_REAL(0.1));
    add_target(icp, &world);
    for (int k = 0; k < 10; k++) {
        cairn_pose truth = random_pose(&random, 1, 3);
        cairn_pose start =
            cairn_pose_compose(truth, random_pose(&random, CAIRN_REAL(0.05), CAIRN_REAL(0.05)));

        seen_from(&world, truth, CAIRN_REAL(0.005), &random, &query);
        for (int32_t i = 0; i < query.count; i += 10) {
            query.at[i].position.x += cairn_random_uniform(&random, 0, CAIRN_REAL(0.5));
            query.at[i].position.y += cairn_random_uniform(&random, 0, CAIRN_REAL(0.5));
        }
        assert_pose_near(align(icp, &query, start, NULL).target_query, truth, 0.006, 0.003);
    }
    test_pool_free(&pool);
}

/* A wall of 0.1 m: the visible face is nearer to points of the other face, which have the opposite
 * direction. */
static void test_faces_of_a_thin_wall(void **state)
{
    static const cairn_vec2 ends[] = {{-2, 0}, {2, 0}, {2, CAIRN_REAL(0.1)}, {-2, CAIRN_REAL(0.1)}};
    static struct points world, face, query;
    cairn_icp_params params = cairn_icp_default();
    cairn_pose start = {0, CAIRN_REAL(-0.08), 0}, truth = {0, 0, 0};
    cairn_icp_result result;
    cairn_pool pool;
    cairn_icp *icp;

    (void)state;
    world.count = face.count = 0;
    add_wall(&world, ends[1], ends[0], CAIRN_REAL(0.1));
    add_wall(&world, ends[3], ends[2], CAIRN_REAL(0.1));
    add_wall(&world, ends[1], L_ROOM[1], CAIRN_REAL(0.1));
    add_wall(&face, ends[3], ends[2], CAIRN_REAL(0.1));
    add_wall(&face, ends[1], L_ROOM[1], CAIRN_REAL(0.1));
    seen_from(&face, truth, 0, NULL, &query);
    params.gate_start = CAIRN_REAL(0.3);
    icp = make_icp(&pool, params);
    add_target(icp, &world);
    result = align(icp, &query, start, NULL);
    assert_int_equal(result.verdict, CAIRN_ICP_CONVERGED);
    assert_pose_near(result.target_query, truth, NUMBER(1e-6, 1e-4), NUMBER(1e-6, 1e-4));
    test_pool_free(&pool);

    params.direction_gate = CAIRN_PI;
    icp = make_icp(&pool, params);
    add_target(icp, &world);
    result = align(icp, &query, start, NULL);
    assert_true(result.target_query.y < CAIRN_REAL(-0.04));
    test_pool_free(&pool);
}

/* Query points half way between two target points, with nearer points of opposite direction: the
 * lower index is taken, so that all move by half a spacing in the same direction. */
static void test_ties(void **state)
{
    static struct points target, query;
    cairn_icp_params params = cairn_icp_default();
    cairn_icp_result result;
    cairn_pool pool;
    cairn_icp *icp;

    (void)state;
    params.mode = CAIRN_ICP_POINT_TO_POINT;
    params.max_iterations = 1;
    params.weak_ratio = 0;
    for (int reverse = 0; reverse < 2; reverse++) {
        target.count = 42;
        query.count = 20;
        for (int32_t i = 0; i < 21; i++) {
            cairn_oriented_point *with = &target.at[reverse ? 20 - i : i],
                                 *against = &target.at[21 + i];

            with->position.x = CAIRN_REAL(0.125) * (cairn_real)i;
            against->position.x = with->position.x + CAIRN_REAL(0.0625);
            with->position.y = 0;
            against->position.y = CAIRN_REAL(-0.03125);
            with->direction.x = 1;
            against->direction.x = -1;
            with->direction.y = against->direction.y = 0;
        }
        for (int32_t i = 0; i < 20; i++) {
            query.at[i].position.x = CAIRN_REAL(0.125) * (cairn_real)i + CAIRN_REAL(0.0625);
            query.at[i].position.y = 0;
            query.at[i].direction.x = 1;
            query.at[i].direction.y = 0;
        }
        icp = make_icp(&pool, params);
        add_target(icp, &target);
        result = align(icp, &query, cairn_pose_identity(), NULL);
        assert_int_equal(result.pairs, 20);
        assert_near(result.target_query.x, reverse ? 0.0625 : -0.0625, 1e-6);
        assert_near(result.target_query.y, 0, 1e-6);
        test_pool_free(&pool);
    }
}

/* ---- Observability ---- */

/* Two long walls, rotated by 0.5 rad: the corridor's direction is reported, the pose does not move
 * along it and is right across it; a prior decides along it. */
static void test_corridor(void **state)
{
    static const cairn_vec2 ends[] = {{-10, -1}, {10, -1}, {10, 1}, {-10, 1}};
    static struct points target, seen, query;
    cairn_random random = cairn_random_seed(35, 0);
    cairn_pose corridor = {CAIRN_REAL(0.3), CAIRN_REAL(0.2), CAIRN_REAL(0.5)}, start, along_across;
    cairn_vec2 axis = {cairn_cos(corridor.theta), cairn_sin(corridor.theta)}, short_ends[4];

    (void)state;
    target.count = seen.count = 0;
    for (int k = 0; k < 4; k++)
        short_ends[k].x = ends[k].x * CAIRN_REAL(0.4), short_ends[k].y = ends[k].y;
    add_wall(&target, ends[0], ends[1], CAIRN_REAL(0.1));
    add_wall(&target, ends[2], ends[3], CAIRN_REAL(0.1));
    add_wall(&seen, short_ends[0], short_ends[1], CAIRN_REAL(0.11));
    add_wall(&seen, short_ends[2], short_ends[3], CAIRN_REAL(0.11));
    seen_from(&seen, cairn_pose_identity(), CAIRN_REAL(0.005), &random, &query);
    for (int mode = CAIRN_ICP_POINT_TO_POINT; mode <= CAIRN_ICP_POINT_TO_LINE; mode++) {
        cairn_icp_params params = cairn_icp_default();
        cairn_pose off = {CAIRN_REAL(0.2), CAIRN_REAL(0.1), CAIRN_REAL(0.05)};
        cairn_rigid_motion_pose_prior prior;
        cairn_icp_result result;
        cairn_pool pool;
        cairn_icp *icp;

        params.mode = mode;
        icp = make_icp(&pool, params);
        assert_ok(cairn_icp_add_target(icp, target.at, target.count, corridor, NULL));
        start = cairn_pose_compose(corridor, off);
        result = align(icp, &query, start, NULL);
        assert_int_equal(result.verdict, CAIRN_ICP_UNOBSERVABLE);
        assert_int_equal(result.observable_dof, 2);
        assert_near(
            cairn_abs(result.weak_direction[0] * axis.x + result.weak_direction[1] * axis.y), 1,
            1e-3);
        assert_near(result.weak_direction[2], 0, 0.03);
        assert_true(result.weak_ratio < CAIRN_REAL(1e-3));
        along_across = cairn_pose_between(corridor, result.target_query);
        assert_near(along_across.x, 0.2, 0.01);
        assert_near(along_across.y, 0, 0.005);
        assert_near(along_across.theta, 0, 0.002);
        {
            cairn_sym2 xy = {result.covariance[0], result.covariance[1], result.covariance[4]};
            cairn_real values[2];
            cairn_vec2 minor, major;

            cairn_sym2_eigen(xy, values, &minor, &major);
            assert_near(values[1], 1e4, NUMBER(1, 3e3));
            assert_near(values[0], 1e-4 / query.count, NUMBER(2e-7, 0.1));
            assert_near(cairn_abs(cairn_vec2_dot(major, axis)), 1, 1e-4);
        }
        /* The prior's mean is 0.05 m along the corridor and 0.03 m across it. */
        off.x = CAIRN_REAL(0.05);
        off.y = CAIRN_REAL(0.03);
        off.theta = 0;
        prior.mean = cairn_pose_compose(corridor, off);
        prior.sigma_x = CAIRN_REAL(0.2);
        prior.sigma_y = CAIRN_REAL(0.1);
        prior.sigma_theta = CAIRN_REAL(0.05);
        result = align(icp, &query, start, &prior);
        assert_int_equal(result.verdict, CAIRN_ICP_CONVERGED);
        assert_int_equal(result.observable_dof, 2);
        along_across = cairn_pose_between(corridor, result.target_query);
        assert_near(along_across.x, 0.05, 0.001);
        assert_near(along_across.y, 0, 0.005);
        {
            cairn_real across[2] = {-axis.y, axis.x};
            double along_variance = (double)(axis.x * axis.x * result.covariance[0] +
                                             2 * axis.x * axis.y * result.covariance[1] +
                                             axis.y * axis.y * result.covariance[4]);
            double across_variance = (double)(across[0] * across[0] * result.covariance[0] +
                                              2 * across[0] * across[1] * result.covariance[1] +
                                              across[1] * across[1] * result.covariance[4]);

            assert_near(along_variance, 0.04, 0.001);
            assert_true(across_variance < 4e-6);
        }
        test_pool_free(&pool);
    }
}

/* Of one wall the translation along it is unobservable; of a round room the rotation about its
 * centre. */
static void test_wall_and_round_room(void **state)
{
    static struct points target;
    cairn_pose start = {CAIRN_REAL(0.04), CAIRN_REAL(0.05), CAIRN_REAL(0.02)};
    cairn_vec2 a = {-2, 1}, b = {3, 1};
    cairn_pool pool;
    cairn_icp *icp = make_icp(&pool, cairn_icp_default());
    cairn_icp_result result;

    (void)state;
    target.count = 0;
    add_wall(&target, a, b, CAIRN_REAL(0.1));
    add_target(icp, &target);
    result = align(icp, &target, start, NULL);
    assert_int_equal(result.verdict, CAIRN_ICP_UNOBSERVABLE);
    assert_int_equal(result.observable_dof, 2);
    assert_near(cairn_abs(result.weak_direction[0]), 1, 1e-3);
    assert_near(result.target_query.y, 0, 1e-3);
    assert_near(result.target_query.theta, 0, 1e-3);

    cairn_icp_clear_target(icp);
    assert_int_equal(cairn_icp_target_count(icp), 0);
    target.count = 0;
    for (int32_t i = 0; i < 200; i++) {
        cairn_real sine, cosine;

        cairn_sincos(CAIRN_PI * (cairn_real)i / 100, &sine, &cosine);
        target.at[i].position.x = 1 + 2 * cosine;
        target.at[i].position.y = 2 + 2 * sine;
        target.at[i].direction.x = -sine;
        target.at[i].direction.y = cosine;
        target.count++;
    }
    add_target(icp, &target);
    result = align(icp, &target, start, NULL);
    assert_int_equal(result.verdict, CAIRN_ICP_UNOBSERVABLE);
    assert_int_equal(result.observable_dof, 2);
    assert_near(cairn_abs(result.weak_direction[2]), 1, 1e-3);
    assert_near(result.radius, 2, 1e-4);
    assert_near(result.target_query.theta, 0.02, 2e-3);
    {
        cairn_vec2 centre = {1, 2}, mapped = cairn_pose_point(result.target_query, centre);

        assert_near(mapped.x, 1, 1e-3);
        assert_near(mapped.y, 2, 1e-3);
    }
    /* All points in one place with one direction observe one quantity: the distance across. */
    cairn_icp_clear_target(icp);
    for (int32_t i = 0; i < 20; i++) {
        target.at[i].position = a;
        target.at[i].direction.x = 0;
        target.at[i].direction.y = 1;
    }
    target.count = 20;
    add_target(icp, &target);
    result = align(icp, &target, start, NULL);
    assert_int_equal(result.verdict, CAIRN_ICP_UNOBSERVABLE);
    assert_int_equal(result.observable_dof, 1);
    test_pool_free(&pool);
}

/* ---- Covariance ---- */

/* Mean of the normalised squared pose error: 3 when the covariance is right. */
static void test_covariance_fits_the_errors(void **state)
{
    static struct points world, target, query;
    cairn_random random = cairn_random_seed(36, 0);
    cairn_icp_params params = cairn_icp_default();
    double nees = 0;
    int runs = 300;
    cairn_pool pool;
    cairn_icp *icp;

    (void)state;
    params.min_sigma = CAIRN_REAL(0.001);
    params.gate_end = CAIRN_REAL(0.2);
    icp = make_icp(&pool, params);
    for (int k = 0; k < runs; k++) {
        cairn_pose truth = random_pose(&random, 1, 3);
        cairn_pose start =
            cairn_pose_compose(truth, random_pose(&random, CAIRN_REAL(0.02), CAIRN_REAL(0.02)));
        cairn_icp_result result;
        cairn_sym3 covariance, information;
        cairn_real error[3];

        l_room(&world, CAIRN_REAL(0.1));
        seen_from(&world, cairn_pose_identity(), CAIRN_REAL(0.01), &random, &target);
        seen_from(&world, truth, CAIRN_REAL(0.01), &random, &query);
        cairn_icp_clear_target(icp);
        add_target(icp, &target);
        result = align(icp, &query, start, NULL);
        error[0] = result.target_query.x - truth.x;
        error[1] = result.target_query.y - truth.y;
        error[2] = cairn_wrap_angle(result.target_query.theta - truth.theta);
        covariance.xx = result.covariance[0];
        covariance.xy = result.covariance[1];
        covariance.xz = result.covariance[2];
        covariance.yy = result.covariance[4];
        covariance.yz = result.covariance[5];
        covariance.zz = result.covariance[8];
        assert_true(cairn_sym3_inverse(covariance, &information));
        nees += (double)cairn_sym3_form(information, error) / runs;
        assert_near(result.sigma, 0.0141, 0.004);
    }
    print_message("mean NEES %.3f\n", nees);
    assert_near(nees, 3, 0.6);
    test_pool_free(&pool);
}

/* ---- Steps, edge cases, refusals ---- */

static void test_budgets(void **state)
{
    static const int32_t budgets[] = {CAIRN_UNBOUNDED, 1, 7, 1000};
    static struct points world, target, query;
    cairn_random random = cairn_random_seed(37, 0);
    cairn_pose truth = {CAIRN_REAL(0.5), 0, 1},
               start = {CAIRN_REAL(0.55), CAIRN_REAL(0.07), CAIRN_REAL(1.06)};
    cairn_icp_result results[4];
    cairn_pool pool;
    cairn_icp *icp = make_icp(&pool, cairn_icp_default());
    int32_t units[4] = {0};

    (void)state;
    l_room(&world, CAIRN_REAL(0.1));
    seen_from(&world, cairn_pose_identity(), CAIRN_REAL(0.01), &random, &target);
    seen_from(&world, truth, CAIRN_REAL(0.01), &random, &query);
    add_target(icp, &target);
    for (int k = 0; k < 4; k++) {
        cairn_budget budget = {100};
        cairn_status status;
        int32_t iterations = 0;

        /* An unfinished alignment is dropped. */
        assert_ok(cairn_icp_begin(icp, query.at, query.count, truth, NULL, NULL));
        assert_status(cairn_icp_step(icp, &budget), CAIRN_MORE);
        assert_int_equal(budget.left, 0);
        assert_status(cairn_icp_step(icp, &budget), CAIRN_MORE);
        assert_ok(cairn_icp_begin(icp, query.at, query.count, start, NULL, NULL));
        do {
            cairn_icp_result before = cairn_icp_read(icp), after;

            budget.left = budgets[k];
            status = cairn_icp_step(icp, &budget);
            assert_true(budget.left >= 0 &&
                        (status == CAIRN_OK || (status == CAIRN_MORE && budget.left == 0)));
            units[k] += budgets[k] - budget.left;
            after = cairn_icp_read(icp);
            assert_true(after.iterations >= iterations);
            if (after.iterations == iterations)
                assert_memory_equal(&before.target_query, &after.target_query,
                                    sizeof before.target_query);
            iterations = after.iterations;
        } while (status == CAIRN_MORE);
        results[k] = cairn_icp_read(icp);
        assert_memory_equal(&results[k], &results[0], sizeof results[0]);
        assert_int_equal(units[k], units[0]);
        assert_int_equal(results[k].verdict, CAIRN_ICP_CONVERGED);
    }
    /* Fixed values: they change when the charges or the amount of work change. */
    assert_int_equal(units[0], NUMBER(7506, 7561));
    assert_in_range(units[0], results[0].iterations * (5 * query.count + 12),
                    results[0].iterations * (8 * query.count + 12));
    test_pool_free(&pool);
}

/* A corridor's two walls and the wall at its end are parts: each observes the direction across it,
 * all together what the whole target observes. */
static void parts_observe_the_direction_across_them(void **state)
{
    static const cairn_vec2 ends[3][2] = {
        {{-4, -1}, {4, -1}}, {{4, -1}, {4, 1}}, {{4, 1}, {-4, 1}}};
    static struct points walls[3], all;
    cairn_pool pool, other_pool;
    cairn_icp *icp = make_icp(&pool, cairn_icp_default()),
              *whole = make_icp(&other_pool, cairn_icp_default());
    cairn_pose start = {CAIRN_REAL(0.05), CAIRN_REAL(-0.03), CAIRN_REAL(0.02)};
    static cairn_icp_parts parts, one;
    cairn_sym3 sum = cairn_sym3_zero();

    (void)state;
    all.count = 0;
    for (int k = 0; k < 3; k++) {
        walls[k].count = 0;
        add_wall(&walls[k], ends[k][0], ends[k][1], CAIRN_REAL(0.1));
        add_wall(&all, ends[k][0], ends[k][1], CAIRN_REAL(0.1));
        add_target(icp, &walls[k]);
    }
    add_target(whole, &all);
    cairn_icp_read_parts(icp, &parts);
    assert_int_equal(parts.count, 3);
    assert_near(parts.information[0].yy, 0, 0);
    (void)align(icp, &all, start, NULL);
    (void)align(whole, &all, start, NULL);
    cairn_icp_read_parts(icp, &parts);
    cairn_icp_read_parts(whole, &one);
    assert_int_equal(parts.count, 3);
    assert_int_equal(one.count, 1);
    for (int k = 0; k < 3; k++) {
        sum.xx += parts.information[k].xx;
        sum.yy += parts.information[k].yy;
        sum.zz += parts.information[k].zz;
    }
    assert_near(sum.xx / one.information[0].xx, 1, 1e-4);
    assert_near(sum.yy / one.information[0].yy, 1, 1e-4);
    assert_near(sum.zz / one.information[0].zz, 1, 1e-4);
    for (int k = 0; k < 3; k += 2)
        assert_true(1000 * parts.information[k].xx < one.information[0].xx);
    assert_true(1000 * parts.information[1].yy < one.information[0].yy);
    assert_near(parts.information[1].xx / one.information[0].xx, 1, 1e-3);
    cairn_icp_clear_target(icp);
    for (int k = 0; k < CAIRN_ICP_MAX_PARTS + 3; k++)
        assert_ok(cairn_icp_add_target(icp, &all.at[k], 1, cairn_pose_identity(), NULL));
    cairn_icp_read_parts(icp, &parts);
    assert_int_equal(parts.count, CAIRN_ICP_MAX_PARTS);
    test_pool_free(&pool);
    test_pool_free(&other_pool);
}

/* With a greater ratio the end of the corridor is too little to observe the translation along it,
 * and the prior decides. */
static void the_ratio_decides_what_is_unobservable(void **state)
{
    static const cairn_vec2 corners[] = {{-4, -1}, {4, -1}, {4, 1}, {-4, 1}};
    static struct points target;
    cairn_pool pool;
    cairn_icp *icp = make_icp(&pool, cairn_icp_default());
    cairn_pose start = {CAIRN_REAL(0.06), 0, 0};
    cairn_rigid_motion_pose_prior prior = {start, CAIRN_REAL(0.1), CAIRN_REAL(0.1),
                                           CAIRN_REAL(0.1)};

    (void)state;
    target.count = 0;
    for (int k = 0; k < 3; k++)
        add_wall(&target, corners[k], corners[k + 1], CAIRN_REAL(0.1));
    add_target(icp, &target);
    assert_near(align(icp, &target, start, &prior).target_query.x, 0, 0.01);
    assert_status(cairn_icp_set_weak_ratio(NULL, 0), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_icp_set_weak_ratio(icp, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_icp_set_weak_ratio(icp, CAIRN_REAL(-0.1)), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_icp_set_weak_ratio(icp, (cairn_real)NAN), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_icp_set_weak_ratio(icp, CAIRN_REAL(0.3)));
    assert_near(align(icp, &target, start, &prior).target_query.x, start.x, 0.001);
    assert_ok(cairn_icp_begin(icp, target.at, target.count, start, &prior, NULL));
    assert_status(cairn_icp_set_weak_ratio(icp, 0), CAIRN_BAD_ARGUMENT);
    test_pool_free(&pool);
}

static void test_few_points(void **state)
{
    static struct points world, query;
    cairn_rigid_motion_pose_prior prior = {
        {CAIRN_REAL(0.1), 0, 0}, CAIRN_REAL(0.1), CAIRN_REAL(0.2), CAIRN_REAL(0.3)};
    cairn_pose start = {CAIRN_REAL(0.01), CAIRN_REAL(0.02), CAIRN_REAL(0.03)}, away = {50, 0, 0};
    cairn_icp_params params = cairn_icp_default();
    cairn_icp_result result;
    cairn_pool pool;
    cairn_icp *icp;

    (void)state;
    l_room(&world, CAIRN_REAL(0.1));
    params.max_target = world.count;
    params.min_pairs = 4;
    icp = make_icp(&pool, params);
    query = world;
    query.count = 1;
    assert_status(cairn_icp_begin(icp, query.at, 1, start, NULL, NULL), CAIRN_EMPTY);
    add_target(icp, &world);
    assert_status(cairn_icp_begin(icp, query.at, 0, start, NULL, NULL), CAIRN_EMPTY);
    assert_status(cairn_icp_begin(icp, NULL, 0, start, NULL, NULL), CAIRN_EMPTY);
    assert_status(cairn_icp_add_target(icp, world.at, 1, start, NULL), CAIRN_FULL);
    for (query.count = 1; query.count < 5; query.count++) {
        result = align(icp, &query, start, NULL);
        assert_int_equal(result.pairs, query.count);
        assert_near(result.overlap, 1, 0);
        if (query.count < 4) {
            assert_int_equal(result.verdict, CAIRN_ICP_TOO_FEW_PAIRS);
            assert_int_equal(result.observable_dof, 0);
            assert_int_equal(result.iterations, 1);
            assert_memory_equal(&result.target_query, &start, sizeof start);
            assert_near(result.covariance[8] * result.radius * result.radius, 1e4, 1);
        } else {
            assert_int_equal(result.verdict, CAIRN_ICP_UNOBSERVABLE);
        }
    }
    /* No correspondences: only the prior is known. */
    result = align(icp, &world, away, &prior);
    assert_int_equal(result.verdict, CAIRN_ICP_TOO_FEW_PAIRS);
    assert_int_equal(result.pairs, 0);
    assert_near(result.covariance[0], 0.01, 1e-5);
    assert_near(result.covariance[4], 0.04, 1e-5);
    assert_near(result.covariance[8], 0.09, 1e-5);
    assert_near(result.covariance[1], 0, 1e-5);
    test_pool_free(&pool);
}

static cairn_status create_icp(void *context, cairn_pool *pool)
{
    cairn_icp *icp = NULL;
    cairn_status status = cairn_icp_create(&icp, pool, context);

    assert_true((status == CAIRN_OK) == (icp != NULL));
    return status;
}

static void assert_rule(const cairn_icp_params *params, const char *rule)
{
    cairn_object_fault fault;

    assert_status(cairn_icp_check(params, &fault), CAIRN_BAD_ARGUMENT);
    assert_null(fault.field);
    assert_string_equal(fault.rule, rule);
    assert_int_equal(cairn_icp_memory(params), 0);
}

static void test_bad_params(void **state)
{
    cairn_icp_params params = cairn_icp_default(), other = params;
    cairn_pool pool = test_pool(1000);
    cairn_object_fault fault;

    (void)state;
    other.gate_end = other.gate_start;
    other.direction_gate = CAIRN_PI;
    other.max_target = other.max_iterations = 1;
    other.min_pairs = 4;
    other.weak_ratio = 0;
    assert_true(cairn_icp_memory(&other) > 0);
    other.max_target = 1 << 24;
    assert_true(cairn_icp_memory(&other) > 0);
    other.gate_end = other.gate_start * 2;
    assert_rule(&other, "gate_end: at most gate_start");
    other = params;
    other.cell_size = CAIRN_REAL_MIN / 1024;
    assert_status(cairn_icp_check(&other, &fault), CAIRN_BAD_ARGUMENT);
    assert_string_equal(fault.field, "cell_size");
    assert_status(cairn_icp_create(NULL, &pool, &params), CAIRN_BAD_ARGUMENT);
    assert_int_equal(pool.used, 0);
    test_pool_free(&pool);
    params.max_target = 21;
    test_every_pool_size(create_icp, &params, cairn_icp_memory(&params));
}

static void test_bad_inputs(void **state)
{
    static const cairn_real bad[] = {(cairn_real)NAN, (cairn_real)INFINITY};
    static struct points world;
    cairn_pose identity = {0, 0, 0};
    cairn_fault fault = {5, NULL};
    cairn_budget budget = {10};
    cairn_pool pool;
    cairn_icp *icp = make_icp(&pool, cairn_icp_default());
    int32_t count;

    (void)state;
    l_room(&world, CAIRN_REAL(0.1));
    add_target(icp, &world);
    count = cairn_icp_target_count(icp);
    assert_ok(cairn_icp_step(icp, &budget));
    assert_int_equal(budget.left, 10);
    assert_int_equal(cairn_icp_read(icp).verdict, CAIRN_ICP_RUNNING);
    for (int k = 0; k < 8; k++) {
        cairn_oriented_point kept = world.at[7];
        cairn_real *value = k % 4 == 0   ? &world.at[7].position.x
                            : k % 4 == 1 ? &world.at[7].position.y
                            : k % 4 == 2 ? &world.at[7].direction.x
                                         : &world.at[7].direction.y;

        *value = bad[k / 4];
        fault.index = -2;
        assert_fault(&fault, cairn_icp_add_target(icp, world.at, 20, identity, &fault),
                     CAIRN_NOT_FINITE, 7);
        assert_fault(&fault, cairn_icp_begin(icp, world.at, world.count, identity, NULL, &fault),
                     CAIRN_NOT_FINITE, 7);
        world.at[7] = kept;
    }
    for (int k = 0; k < 3; k++) {
        cairn_oriented_point kept = world.at[3];

        world.at[3].direction = cairn_vec2_scale(kept.direction, k == 0   ? 0
                                                                 : k == 1 ? CAIRN_REAL(0.9)
                                                                          : CAIRN_REAL(1.1));
        assert_fault(&fault, cairn_icp_add_target(icp, world.at, 20, identity, &fault),
                     CAIRN_BAD_ARGUMENT, 3);
        assert_fault(&fault, cairn_icp_begin(icp, world.at, world.count, identity, NULL, &fault),
                     CAIRN_BAD_ARGUMENT, 3);
        assert_non_null(fault.message);
        world.at[3] = kept;
    }
    for (int k = 0; k < 3; k++) {
        cairn_pose pose = identity;
        cairn_rigid_motion_pose_prior prior = {identity, 1, 1, 1};

        *(k == 0 ? &pose.x : k == 1 ? &pose.y : &pose.theta) = (cairn_real)NAN;
        assert_fault(&fault, cairn_icp_add_target(icp, world.at, 20, pose, &fault),
                     CAIRN_NOT_FINITE, -1);
        assert_fault(&fault, cairn_icp_begin(icp, world.at, 20, pose, NULL, &fault),
                     CAIRN_NOT_FINITE, -1);
        prior.mean = pose;
        assert_fault(&fault, cairn_icp_begin(icp, world.at, 20, identity, &prior, &fault),
                     CAIRN_NOT_FINITE, -1);
        prior.mean = identity;
        *(k == 0 ? &prior.sigma_x : k == 1 ? &prior.sigma_y : &prior.sigma_theta) = 0;
        assert_fault(&fault, cairn_icp_begin(icp, world.at, 20, identity, &prior, &fault),
                     CAIRN_BAD_ARGUMENT, -1);
        assert_status(cairn_icp_begin(icp, world.at, 20, identity, &prior, NULL),
                      CAIRN_BAD_ARGUMENT);
    }
    {
        cairn_pose far = {CAIRN_REAL_MAX, 0, CAIRN_PI / 4};
        cairn_oriented_point kept = world.at[9];

        world.at[9].position.x = CAIRN_REAL_MAX;
        assert_fault(&fault, cairn_icp_add_target(icp, world.at, 20, far, &fault), CAIRN_NOT_FINITE,
                     9);
        world.at[9] = kept;
    }
    assert_fault(&fault, cairn_icp_add_target(NULL, world.at, 20, identity, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    assert_fault(&fault, cairn_icp_add_target(icp, NULL, 1, identity, &fault), CAIRN_BAD_ARGUMENT,
                 -1);
    assert_fault(&fault, cairn_icp_add_target(icp, world.at, -1, identity, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    assert_fault(&fault, cairn_icp_begin(NULL, world.at, 20, identity, NULL, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    assert_fault(&fault, cairn_icp_begin(icp, NULL, 1, identity, NULL, &fault), CAIRN_BAD_ARGUMENT,
                 -1);
    assert_fault(&fault, cairn_icp_begin(icp, world.at, -1, identity, NULL, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    assert_int_equal(cairn_icp_target_count(icp), count);
    assert_ok(cairn_icp_step(icp, &budget));
    assert_int_equal(budget.left, 10);

    assert_ok(cairn_icp_add_target(icp, NULL, 0, identity, NULL));
    assert_ok(cairn_icp_begin(icp, world.at, 20, identity, NULL, NULL));
    assert_fault(&fault, cairn_icp_add_target(icp, world.at, 20, identity, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    cairn_icp_clear_target(icp);
    assert_ok(cairn_icp_step(icp, &budget));
    assert_int_equal(budget.left, 10);
    assert_ok(cairn_icp_add_target(icp, world.at, 20, identity, &fault));
    test_pool_free(&pool);
}

/* The reference implementation runs without roll-back for 1, 2, ... iterations, and finds where
 * pairs become fewer and more distant. */
static void steps_that_increase_the_error_are_rolled_back(void **state)
{
    static struct points target, query;
    cairn_icp_params params = cairn_icp_default();
    cairn_random random = cairn_random_seed(5, 1);
    int32_t rolled_back = 0;

    (void)state;
    params.gate_end = params.gate_start;
    for (int32_t trial = 0; trial < 40; trial++) {
        cairn_icp_result last, expected, found;
        cairn_pose start = random_pose(&random, CAIRN_REAL(0.3), CAIRN_REAL(0.3));
        cairn_pool pool;
        cairn_icp *icp;

        target.count = query.count = 60;
        for (int32_t i = 0; i < 60; i++) {
            cairn_pose p = random_pose(&random, 2, CAIRN_PI), q = random_pose(&random, 2, CAIRN_PI);

            target.at[i].position.x = p.x;
            target.at[i].position.y = p.y;
            cairn_sincos(p.theta, &target.at[i].direction.y, &target.at[i].direction.x);
            query.at[i].position.x = q.x;
            query.at[i].position.y = q.y;
            cairn_sincos(q.theta, &query.at[i].direction.y, &query.at[i].direction.x);
        }
        memset(&last, 0, sizeof last);
        memset(&expected, 0, sizeof expected);
        for (int32_t k = 1; k <= 12 && expected.verdict != CAIRN_ICP_ROLLED_BACK; k++) {
            cairn_pose before = k == 1 ? start : last.target_query;

            params.roll_back = 0;
            params.max_iterations = k;
            icp = make_icp(&pool, params);
            add_target(icp, &target);
            expected = align(icp, &query, start, NULL);
            test_pool_free(&pool);
            if (k > 1 && expected.verdict != CAIRN_ICP_TOO_FEW_PAIRS && expected.iterations == k &&
                expected.pairs < last.pairs && expected.mean_distance > last.mean_distance) {
                expected = last;
                expected.verdict = CAIRN_ICP_ROLLED_BACK;
                expected.iterations = k;
            } else {
                /* the pose of these pairs */
                last = expected;
                last.weak_direction[0] = before.x;
                last.weak_direction[1] = before.y;
                last.weak_direction[2] = before.theta;
            }
        }
        params.roll_back = 1;
        icp = make_icp(&pool, params);
        add_target(icp, &target);
        found = align(icp, &query, start, NULL);
        test_pool_free(&pool);
        assert_int_equal(found.verdict, expected.verdict);
        assert_int_equal(found.iterations, expected.iterations);
        assert_int_equal(found.pairs, expected.pairs);
        assert_near(found.mean_distance, expected.mean_distance, 0);
        assert_near(found.overlap, expected.overlap, 0);
        if (found.verdict == CAIRN_ICP_ROLLED_BACK) {
            rolled_back++;
            assert_near(found.target_query.x, expected.weak_direction[0], 0);
            assert_near(found.target_query.y, expected.weak_direction[1], 0);
            assert_near(found.target_query.theta, expected.weak_direction[2], 0);
        } else {
            assert_near(found.target_query.x, expected.target_query.x, 0);
        }
    }
    assert_true(rolled_back > 3);
    assert_true(rolled_back < 40);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_icp_matches_reference),
        cmocka_unit_test(test_known_motions_without_noise),
        cmocka_unit_test(test_known_motions_with_noise),
        cmocka_unit_test(test_outliers),
        cmocka_unit_test(test_faces_of_a_thin_wall),
        cmocka_unit_test(test_ties),
        cmocka_unit_test(test_corridor),
        cmocka_unit_test(test_wall_and_round_room),
        cmocka_unit_test(test_covariance_fits_the_errors),
        cmocka_unit_test(test_budgets),
        cmocka_unit_test(test_few_points),
        cmocka_unit_test(parts_observe_the_direction_across_them),
        cmocka_unit_test(the_ratio_decides_what_is_unobservable),
        cmocka_unit_test(test_bad_params),
        cmocka_unit_test(test_bad_inputs),
        cmocka_unit_test(steps_that_increase_the_error_are_rolled_back),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
