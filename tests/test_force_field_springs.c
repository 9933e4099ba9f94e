/* Force field, mode springs: one iteration compared with a dense system, cooling, bounds,
 * degenerate input. */
#include "tests/field_scene.h"

#include "cairn/icp.h"

/* ---- Reference implementation: one dense system of all motions, all pairs, in double ---- */

enum { UNKNOWNS = 3 * SCENE, RUN = 3 };

/* Three external points of one direction. */
static const double outside[RUN][2] = {{0.5, 1.62}, {0.7, 1.61}, {0.9, 1.63}};

struct slow_point {
    double x, y, along_x, along_y;
    int scan; /* -1: from outside */
};

struct slow_system {
    struct slow_point points[1024];
    int count;
    double matrix[UNKNOWNS][UNKNOWNS], right[UNKNOWNS], motion[UNKNOWNS];
};

static void slow_points(struct slow_system *s, const struct scan *scans, const cairn_pose *poses,
                        int run)
{
    s->count = 0;
    for (int i = 0; i < SCENE; i++) {
        double c = cos((double)poses[i].theta), n = sin((double)poses[i].theta);

        for (int t = 0; t < scans[i].view.segment_count; t++)
            for (int k = scans[i].first_point[t]; k < scans[i].first_point[t + 1]; k++) {
                double x = (double)scans[i].points[k].position.x,
                       y = (double)scans[i].points[k].position.y;
                /* that of the first point */
                cairn_vec2 d = scans[i].points[scans[i].first_point[t]].direction;
                struct slow_point p = {
                    (double)poses[i].x + c * x - n * y, (double)poses[i].y + n * x + c * y,
                    c * (double)d.x - n * (double)d.y, n * (double)d.x + c * (double)d.y, i};

                s->points[s->count++] = p;
            }
    }
    for (int i = 0; i < run; i++) {
        struct slow_point p = {outside[i][0], outside[i][1], -1, 0, -1};

        s->points[s->count++] = p;
    }
}

/* Moves the midpoint of a pair by a motion of the scan about its centre: two rows of three. */
static void slow_lever(double lever[2][3], double x, double y, cairn_vec2 centre)
{
    lever[0][0] = lever[1][1] = 1;
    lever[0][1] = lever[1][0] = 0;
    lever[0][2] = -(y - (double)centre.y);
    lever[1][2] = x - (double)centre.x;
}

/* A spring of point p towards q, shaped by the direction of `along`. */
static void slow_spring(struct slow_system *s, const cairn_force_field_params *params,
                        const cairn_vec2 *centres, const struct slow_point *p,
                        const struct slow_point *q, const struct slow_point *along,
                        double stiffness)
{
    double normal[2] = {-along->along_y, along->along_x}, d[2] = {q->x - p->x, q->y - p->y};
    const struct slow_point *ends[2] = {p, q};
    double lever[2][2][3];

    for (int e = 0; e < 2; e++)
        if (ends[e]->scan >= 0)
            slow_lever(lever[e], (p->x + q->x) / 2, (p->y + q->y) / 2, centres[ends[e]->scan]);
    for (int r = 0; r < 2; r++)
        for (int c = 0; c < 2; c++) {
            double slide = (double)params->tangential_stiffness;
            double shape = stiffness * ((r == c ? slide : 0) + (1 - slide) * normal[r] * normal[c]);

            for (int e = 0; e < 2; e++)
                for (int i = 0; ends[e]->scan >= 0 && i < 3; i++) {
                    int row = 3 * ends[e]->scan + i;

                    s->right[row] += (e == 0 ? 1 : -1) * lever[e][r][i] * shape * d[c];
                    for (int f = 0; f < 2; f++)
                        for (int j = 0; ends[f]->scan >= 0 && j < 3; j++)
                            s->matrix[row][3 * ends[f]->scan + j] +=
                                (e == f ? 1 : -1) * lever[e][r][i] * shape * lever[f][c][j];
                }
        }
}

/* Rotates the scans of two points so that their lines become parallel. */
static void slow_twist(struct slow_system *s, const cairn_force_field_params *params,
                       const struct slow_point *p, const struct slow_point *q, double r)
{
    double sigma = (double)params->sigma_start, norm = sigma * sqrt(2 * 3.14159265358979323846);
    double angle = atan2(p->along_x * q->along_y - p->along_y * q->along_x,
                         p->along_x * q->along_x + p->along_y * q->along_y);
    double strength = (double)params->alignment_torque / 2 * erfc(r / (sigma * sqrt(2))) * norm *
                      pow(cos(angle), 3);
    int ends[2] = {3 * p->scan + 2, 3 * q->scan + 2};

    for (int e = 0; e < 2; e++)
        if (ends[e] >= 0) {
            s->right[ends[e]] += (e == 0 ? 1 : -1) * strength * sin(angle);
            s->matrix[ends[e]][ends[e]] += strength * cos(angle);
            if (ends[1 - e] >= 0)
                s->matrix[ends[e]][ends[1 - e]] -= strength * cos(angle);
        }
}

static void slow_solve(struct slow_system *s, const int *is_fixed)
{
    for (int i = 0; i < UNKNOWNS; i++)
        if (is_fixed[i / 3]) {
            for (int j = 0; j < UNKNOWNS; j++)
                s->matrix[i][j] = s->matrix[j][i] = 0;
            s->matrix[i][i] = 1;
            s->right[i] = 0;
        }
    for (int i = 0; i < UNKNOWNS; i++)
        for (int r = i + 1; r < UNKNOWNS; r++) {
            double factor = s->matrix[r][i] / s->matrix[i][i];

            for (int c = i; c < UNKNOWNS; c++)
                s->matrix[r][c] -= factor * s->matrix[i][c];
            s->right[r] -= factor * s->right[i];
        }
    for (int i = UNKNOWNS; i-- > 0;) {
        double sum = s->right[i];

        for (int c = i + 1; c < UNKNOWNS; c++)
            sum -= s->matrix[i][c] * s->motion[c];
        s->motion[i] = sum / s->matrix[i][i];
    }
}

static void slow_motions(struct slow_system *s, const cairn_force_field_params *params,
                         const struct scan *scans, const cairn_vec2 *centres, const int *is_fixed)
{
    double sigma = (double)params->sigma_start, grip = 0;
    int is_sided = sigma <= (double)params->oriented_below;

    memset(s->matrix, 0, sizeof s->matrix);
    memset(s->right, 0, sizeof s->right);
    for (int i = 0; i < s->count; i++)
        for (int j = i + 1; j < s->count; j++) {
            const struct slow_point *p = &s->points[i], *q = &s->points[j];
            double r = hypot(q->x - p->x, q->y - p->y),
                   stiffness = exp(-r * r / (2 * sigma * sigma)) / fmax(r, sigma / 8);
            double cosine = p->along_x * q->along_x + p->along_y * q->along_y;

            if (p->scan == q->scan || r > (double)params->reach * sigma)
                continue;
            stiffness *= is_sided ? fmax(cosine, 0) : fabs(cosine);
            slow_spring(s, params, centres, p, q, p, stiffness);
            slow_spring(s, params, centres, p, q, q, stiffness);
            if (!is_sided || cosine > 0)
                slow_twist(s, params, p, q, r);
        }
    if (params->damping_sigma > 0)
        grip = pow(sigma / (double)params->damping_sigma, 3);
    for (int i = 0; i < SCENE; i++) {
        double shift = s->matrix[3 * i][3 * i] + s->matrix[3 * i + 1][3 * i + 1], spread = 0;

        for (int k = 0; k < scans[i].view.point_count; k++)
            spread +=
                pow((double)scans[i].points[k].position.x - (double)scans[i].view.sensor.x, 2) +
                pow((double)scans[i].points[k].position.y - (double)scans[i].view.sensor.y, 2);
        s->matrix[3 * i][3 * i] += (0.001 + grip) * shift;
        s->matrix[3 * i + 1][3 * i + 1] += (0.001 + grip) * shift;
        s->matrix[3 * i + 2][3 * i + 2] += 0.001 * shift * spread / scans[i].view.point_count;
    }
    slow_solve(s, is_fixed);
}

/* ---- One iteration compared with it ---- */

static cairn_force_field_params springs_params(double sigma, int steps)
{
    cairn_force_field_params params = cairn_force_field_springs((cairn_real)sigma, steps);

    params.max_scans = 16;
    params.max_bonds = 120;
    params.max_segments = 128;
    params.max_points = 1024;
    params.max_extra = RUN;
    params.max_relocation = 100;
    return params;
}

static void add_outside(cairn_force_field *field, int run)
{
    cairn_oriented_point points[RUN];
    cairn_real weights[RUN];

    for (int i = 0; i < run; i++) {
        points[i].position.x = (cairn_real)outside[i][0];
        points[i].position.y = (cairn_real)outside[i][1];
        points[i].direction.x = -1;
        points[i].direction.y = 0;
        weights[i] = 1;
    }
    assert_ok(cairn_force_field_set_extra(field, points, weights, run));
}

static void compare_with_slow(const cairn_force_field_params *params, int fixed, int run)
{
    static struct slow_system slow;
    struct fixture f = field_with(params);
    struct scan scans[SCENE];
    cairn_pose poses[SCENE];
    cairn_vec2 centres[SCENE];
    int is_fixed[SCENE] = {0};
    double part = (double)params->dt_start * (double)params->dt_start / 2, most = 0;

    make_scene(scans, poses);
    for (int i = 0; i < SCENE; i++)
        add(f.field, &scans[i], poses[i]);
    for (int i = 0; i < fixed; i++) {
        assert_ok(cairn_force_field_fix(f.field, 3 * i, 1));
        is_fixed[3 * i] = 1;
    }
    add_outside(f.field, run);
    iterate(f.field);
    slow_points(&slow, scans, poses, run);
    for (int i = 0; i < SCENE; i++)
        centres[i] = cairn_force_field_motion_of(f.field, i).centre;
    slow_motions(&slow, params, scans, centres, is_fixed);
    for (int i = 0; i < 3 * SCENE; i++)
        most = fmax(most, fabs(slow.motion[i]) * part);
    assert_true(most > 0.01);
    for (int i = 0; i < SCENE; i++) {
        cairn_pose p = cairn_force_field_pose(f.field, i);
        cairn_vec2 sensor = cairn_transform_point(cairn_transform_of(p), scans[i].view.sensor);
        cairn_vec2 before =
            cairn_transform_point(cairn_transform_of(poses[i]), scans[i].view.sensor);

        assert_near(centres[i].x, (double)before.x, 1e-6);
        assert_near(sensor.x - before.x, part * slow.motion[3 * i], 2e-3 * most);
        assert_near(sensor.y - before.y, part * slow.motion[3 * i + 1], 2e-3 * most);
        assert_near(p.theta - poses[i].theta, part * slow.motion[3 * i + 2], 2e-3 * most);
        if (is_fixed[i])
            assert_memory_equal(&p, &poses[i], sizeof p);
    }
    test_pool_free(&f.pool);
}

static void test_all_pairs(void **state)
{
    cairn_force_field_params p = springs_params(0.3, 10);

    (void)state;
    compare_with_slow(&p, 1, 0);
    compare_with_slow(&p, 3, RUN);
    compare_with_slow(&p, 0, RUN);
    p.damping_sigma = 0;
    p.tangential_stiffness = CAIRN_REAL(0.4);
    compare_with_slow(&p, 1, RUN);
    p.tangential_stiffness = 1;
    p.dt_start = p.dt_end;
    compare_with_slow(&p, 1, 0);
    p = springs_params(0.15, 10);
    compare_with_slow(&p, 1, RUN);
    p.oriented_below = CAIRN_REAL(0.149);
    compare_with_slow(&p, 1, RUN);
}

/* ---- Cooling, bounds, inputs ---- */

static void test_presets(void **state)
{
    cairn_force_field_params p = cairn_force_field_springs(CAIRN_REAL(0.6), 5);

    (void)state;
    assert_int_equal(p.mode, CAIRN_FORCE_FIELD_SPRINGS);
    assert_int_equal(p.max_bonds, 64 * 63 / 2);
    assert_int_equal(p.max_steps, 5);
    assert_int_equal(p.roi, 0);
    assert_near(p.sigma_end, 0.03, 1e-7);
    assert_near(pow((double)p.sigma_factor, 4) * 0.6, 0.03, 1e-6);
    assert_near(p.dt_start * p.dt_start / 2, 5, 1e-5);
    assert_near(p.dt_end * p.dt_end / 2, 1, 1e-5);
    assert_near(p.dt_factor * p.dt_factor, 0.7, 1e-6);
    assert_near(p.oriented_below, 0.15, 1e-7);
    assert_near(p.reach, 2.5, 0);
    assert_near(p.alignment_torque, 40, 0);
    p = cairn_force_field_springs(CAIRN_REAL(0.02), 1);
    assert_near(p.sigma_end, 0.02, 1e-7);
    assert_near(p.sigma_factor, 1, 0);
    assert_true(cairn_force_field_memory(&p) > 0);
}

/* tests/test_object.c has the ranges. */
static void test_parameters_of_springs_are_ignored_in_the_other_mode(void **state)
{
    static const size_t fields[] = {offsetof(cairn_force_field_params, tangential_stiffness),
                                    offsetof(cairn_force_field_params, damping_sigma),
                                    offsetof(cairn_force_field_params, alignment_torque),
                                    offsetof(cairn_force_field_params, max_relocation)};
    cairn_force_field_params p;

    (void)state;
    for (size_t i = 0; i < sizeof fields / sizeof *fields; i++) {
        cairn_real value = (cairn_real)NAN;

        p = springs_params(0.3, 10);
        memcpy((char *)&p + fields[i], &value, sizeof value);
        assert_int_equal(cairn_force_field_memory(&p), 0);
        p.mode = CAIRN_FORCE_FIELD_GRADIENT;
        assert_true(cairn_force_field_memory(&p) > 0);
    }
    p = springs_params(0.3, 10);
    p.max_bonds = -1;
    assert_int_equal(cairn_force_field_memory(&p), 0);
    p.mode = CAIRN_FORCE_FIELD_GRADIENT;
    assert_true(cairn_force_field_memory(&p) > 0);
}

static void test_bounds_of_the_parameters_are_taken(void **state)
{
    cairn_force_field_params p = springs_params(0.3, 10);

    (void)state;
    p.sigma_factor = p.oriented_below = p.tangential_stiffness = 0;
    p.damping_sigma = p.alignment_torque = 0;
    assert_true(cairn_force_field_memory(&p) > 0);
    p.tangential_stiffness = 1;
    p.max_bonds = 1 << 24;
    assert_true(cairn_force_field_memory(&p) > 0);
}

static cairn_status create_with(void *params, cairn_pool *pool)
{
    cairn_force_field *field;

    return cairn_force_field_create(&field, pool, params);
}

static void test_memory(void **state)
{
    cairn_force_field_params p = springs_params(0.3, 10), without;
    static const int32_t counts[] = {1, 2, 7, 100};

    (void)state;
    p.max_scans = 3;
    p.max_bonds = 3;
    p.max_points = 40;
    p.max_segments = 9;
    test_every_pool_size(create_with, &p, cairn_force_field_memory(&p));
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) {
            size_t more, bound = CAIRN_FORCE_FIELD_BOND_BYTES(counts[i], counts[j]);

            p.max_scans = counts[i];
            p.max_bonds = counts[j];
            without = p;
            without.mode = CAIRN_FORCE_FIELD_GRADIENT;
            more = cairn_force_field_memory(&p) - cairn_force_field_memory(&without);
            assert_true(more <= bound && bound <= more + 64 + 16 * (size_t)(counts[i] + counts[j]));
        }
}

static void test_sigma_falls_by_the_factor(void **state)
{
    cairn_force_field_params p = springs_params(0.4, 5);
    struct fixture f;

    (void)state;
    p.sigma_step = CAIRN_REAL(0.01);
    p.stop_relocation = 0;
    f = field_with(&p);
    add_scene(f.field);
    for (int k = 0; k < 5; k++) {
        cairn_force_field_state s;

        iterate(f.field);
        s = cairn_force_field_read(f.field);
        assert_near(s.sigma, fmax(0.03, 0.4 * pow((double)p.sigma_factor, k) - 0.01 * k), 1e-6);
    }
    assert_int_equal(cairn_force_field_read(f.field).verdict, CAIRN_FORCE_FIELD_OUT_OF_STEPS);
    cairn_force_field_restart(f.field);
    iterate(f.field);
    assert_near(cairn_force_field_read(f.field).sigma, 0.4, 1e-6);
    test_pool_free(&f.pool);
}

/* The root mean square displacement of the points of a scan, from its poses. */
static double way(const struct scan *scan, cairn_pose before, cairn_pose after)
{
    double sum = 0;

    for (int k = 0; k < scan->view.point_count; k++) {
        cairn_vec2 p = cairn_transform_point(cairn_transform_of(before), scan->points[k].position);
        cairn_vec2 q = cairn_transform_point(cairn_transform_of(after), scan->points[k].position);

        sum += (double)cairn_vec2_norm_squared(cairn_vec2_sub(q, p));
    }
    return sqrt(sum / scan->view.point_count);
}

static void test_no_scan_moves_farther_than_allowed(void **state)
{
    static const double bounds[] = {0.02, 100};
    int at_the_bound = 0, below = 0;

    (void)state;
    for (int b = 0; b < 2; b++) {
        cairn_force_field_params p = springs_params(0.15, 10);
        struct scan scans[SCENE];
        cairn_pose poses[SCENE];
        struct fixture f;
        double mean = 0;

        p.max_relocation = (cairn_real)bounds[b];
        p.dt_start = p.dt_end;
        f = field_with(&p);
        make_scene(scans, poses);
        for (int i = 0; i < SCENE; i++)
            add(f.field, &scans[i], poses[i]);
        iterate(f.field);
        for (int i = 0; i < SCENE; i++) {
            double reported = (double)cairn_force_field_motion_of(f.field, i).relocation;

            assert_near(way(&scans[i], poses[i], cairn_force_field_pose(f.field, i)), reported,
                        0.01 * reported + 1e-6);
            assert_true(reported <= bounds[b] * (1 + 1e-6));
            at_the_bound += b == 0 && reported > bounds[b] * (1 - 1e-6);
            below += b == 0 && reported < bounds[b] * 0.99;
            mean += reported / SCENE;
        }
        assert_near(cairn_force_field_read(f.field).mean_relocation, mean, 1e-6);
        test_pool_free(&f.pool);
    }
    assert_true(at_the_bound > 0 && below > 0);
}

static void test_too_few_bonds(void **state)
{
    cairn_force_field_params p = springs_params(0.3, 10);
    cairn_force_field_state all, few;
    struct fixture f = field_with(&p);

    (void)state;
    add_scene(f.field);
    iterate(f.field);
    all = cairn_force_field_read(f.field);
    test_pool_free(&f.pool);
    assert_in_range(all.bonds, SCENE, SCENE * (SCENE - 1) / 2);
    assert_int_equal(all.bonds_dropped, 0);
    p.max_bonds = all.bonds;
    f = field_with(&p);
    add_scene(f.field);
    iterate(f.field);
    assert_int_equal(cairn_force_field_read(f.field).bonds_dropped, 0);
    test_pool_free(&f.pool);
    p.max_bonds = 4;
    f = field_with(&p);
    add_scene(f.field);
    iterate(f.field);
    few = cairn_force_field_read(f.field);
    assert_int_equal(few.bonds, 4);
    assert_in_range(few.bonds_dropped, all.bonds - 4, all.segment_pairs);
    test_pool_free(&f.pool);
    /* Without capacity for any nothing moves. */
    p.max_bonds = 0;
    f = field_with(&p);
    add_scene(f.field);
    iterate(f.field);
    assert_int_equal(cairn_force_field_read(f.field).bonds, 0);
    assert_true(cairn_force_field_read(f.field).mean_relocation == 0);
    test_pool_free(&f.pool);
}

/* All results that could depend on the budget. */
struct outcome {
    cairn_pose poses[SCENE];
    int64_t units;
    cairn_force_field_state state;
};

static struct outcome run_in_steps_of(int32_t left)
{
    cairn_force_field_params p = springs_params(0.3, 6);
    struct fixture f = field_with(&p);
    struct outcome out;
    cairn_status status;

    add_scene(f.field);
    add_outside(f.field, RUN);
    assert_ok(cairn_force_field_fix(f.field, 4, 1));
    do {
        cairn_budget budget = {left};

        status = cairn_force_field_step(f.field, &budget);
        assert_true(budget.left >= 0);
    } while (status == CAIRN_MORE);
    assert_ok(status);
    memset(&out, 0, sizeof out);
    for (int i = 0; i < SCENE; i++)
        out.poses[i] = cairn_force_field_pose(f.field, i);
    out.state = cairn_force_field_read(f.field);
    out.units = out.state.units;
    test_pool_free(&f.pool);
    return out;
}

static void test_any_budget_gives_the_same(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    struct outcome all = run_in_steps_of(CAIRN_UNBOUNDED);

    (void)state;
    assert_int_equal(all.state.iterations, 6);
#ifndef CAIRN_FLOAT
    /* The units charged, including the rounds of the solver. */
    assert_int_equal(all.units, 88075);
#endif
    for (int i = 0; i < 3; i++) {
        struct outcome out = run_in_steps_of(budgets[i]);

        assert_memory_equal(out.poses, all.poses, sizeof all.poses);
        assert_int_equal(out.units, all.units);
        assert_int_equal(out.state.bonds, all.state.bonds);
        assert_in_range(out.state.max_step_units, 1, budgets[i]);
    }
}

/* Error of the relative pose of b seen from a, which is zero in truth. */
static void apart(cairn_pose a, cairn_pose b, double *metres, double *degrees)
{
    cairn_pose p = cairn_pose_between(a, b);

    *metres = fmax(*metres, hypot((double)p.x, (double)p.y));
    *degrees = fmax(*degrees, fabs((double)p.theta) / DEGREE);
}

/* Removed scans leave no springs behind. */
static void test_release(void **state)
{
    cairn_force_field_params p = springs_params(0.3, 10);
    struct scan scans[SCENE];
    cairn_pose poses[SCENE], moved[2][3];

    (void)state;
    make_scene(scans, poses);
    for (int late = 0; late < 2; late++) {
        struct fixture f = field_with(&p);

        if (late) {
            cairn_budget budget = {CAIRN_UNBOUNDED};

            for (int i = 0; i < 4; i++)
                add(f.field, &scans[i + 3], poses[i + 3]);
            iterate(f.field);
            for (int i = 3; i >= 0; i--)
                assert_ok(cairn_force_field_remove(f.field, i));
            assert_int_equal(cairn_force_field_step(f.field, &budget), CAIRN_EMPTY);
            cairn_force_field_restart(f.field);
        }
        for (int i = 0; i < 3; i++) {
            int32_t index = cairn_force_field_next(f.field);

            assert_in_range(index, 0, 3);
            add(f.field, &scans[i], poses[i]);
        }
        iterate(f.field);
        assert_int_equal(cairn_force_field_read(f.field).bonds, 3);
        for (int32_t i = 0, k = 0; i < 4; i++)
            if (i < cairn_force_field_pose_count(f.field) && cairn_force_field_has(f.field, i))
                moved[late][k++] = cairn_force_field_pose(f.field, i);
        test_pool_free(&f.pool);
    }
    /* The order of the scans, and with it that of the sums, is changed. */
    for (int i = 0, found = 0; i < 3; i++, found = 0) {
        for (int k = 0; k < 3; k++) {
            double metres = 0, degrees = 0;

            apart(moved[0][i], moved[1][k], &metres, &degrees);
            found += metres < 1e-3 && degrees < 0.1;
        }
        assert_int_equal(found, 1);
    }
}

/* ---- What it is for ---- */

static const double ends[3][2] = {{1.5, 1.2}, {1, 1.4}, {1.3, 0.8}};

static cairn_pose corner_start(int i)
{
    return i == 0 ? pose(0, 0, 0) : i == 1 ? pose(0.15, -0.1, 6) : pose(-0.1, 0.12, -5);
}

/* Figure 7.6: three scans of a corner each come together within twelve iterations, whatever the
 * spacing of their points. */
static void test_three_corners_come_together(void **state)
{
    static const double spacings[] = {0.02, 0.05, 0.10}, sigmas[] = {0.15, 0.4};

    (void)state;
    for (int s = 0; s < 6; s++) {
        cairn_force_field_params p = springs_params(sigmas[s % 2], 12);
        struct fixture f;
        struct scan scan;
        double metres = 0, degrees = 0;

        p.max_relocation = CAIRN_REAL(0.3);
        f = field_with(&p);
        for (int i = 0; i < 3; i++) {
            scan_corner(&scan, ends[i][0], ends[i][1], spacings[s / 2]);
            add(f.field, &scan, corner_start(i));
        }
        run(f.field);
        assert_in_range(cairn_force_field_read(f.field).iterations, 1, 12);
        for (int i = 0; i < 3; i++)
            apart(cairn_force_field_pose(f.field, i), cairn_force_field_pose(f.field, (i + 1) % 3),
                  &metres, &degrees);
        assert_true(metres < 0.001 && degrees < 0.05);
        test_pool_free(&f.pool);
    }
}

/* ... while the nearest neighbours of all points, without a gate, end displaced: the longer walls
 * correspond to the ends of the shorter ones, which pull them along. */
static void test_nearest_neighbours_end_wrong(void **state)
{
    cairn_icp_params p = cairn_icp_default();
    struct scan scans[3];
    cairn_pose poses[3];
    cairn_pool pool;
    cairn_icp *icp;
    double metres = 0, degrees = 0;

    (void)state;
    p.mode = CAIRN_ICP_POINT_TO_POINT;
    p.max_target = 512;
    p.max_iterations = 1;
    p.gate_start = p.gate_end = 5;
    p.cell_size = 1;
    p.direction_gate = CAIRN_PI;
    pool = test_pool(cairn_icp_memory(&p));
    assert_ok(cairn_icp_create(&icp, &pool, &p));
    for (int i = 0; i < 3; i++) {
        scan_corner(&scans[i], ends[i][0], ends[i][1], 0.05);
        poses[i] = corner_start(i);
    }
    for (int step = 0; step < 100; step++) {
        cairn_pose next[3];

        for (int i = 0; i < 3; i++) {
            cairn_budget budget = {CAIRN_UNBOUNDED};

            cairn_icp_clear_target(icp);
            for (int j = 0; j < 3; j++)
                if (j != i)
                    assert_ok(cairn_icp_add_target(icp, scans[j].points, scans[j].view.point_count,
                                                   poses[j], NULL));
            assert_ok(cairn_icp_begin(icp, scans[i].points, scans[i].view.point_count, poses[i],
                                      NULL, NULL));
            assert_ok(cairn_icp_step(icp, &budget));
            next[i] = cairn_icp_read(icp).target_query;
        }
        memcpy(poses, next, sizeof poses);
    }
    for (int i = 0; i < 3; i++)
        apart(poses[i], poses[(i + 1) % 3], &metres, &degrees);
    assert_true(metres > 0.1 && degrees > 5);
    test_pool_free(&pool);
}

/* ---- Degenerate input ---- */

static void assert_poses_are_finite(const cairn_force_field *field)
{
    for (int32_t i = 0; i < cairn_force_field_pose_count(field); i++)
        assert_true(cairn_pose_is_finite(cairn_force_field_pose(field, i)));
}

static void scan_circle(struct scan *scan, double radius)
{
    enum { SIDES = 15 };

    scan_begin(scan);
    for (int i = 0; i < SIDES; i++)
        scan_wall(scan, radius * cos(i * 24 * DEGREE), radius * sin(i * 24 * DEGREE),
                  radius * cos((i + 1) * 24 * DEGREE), radius * sin((i + 1) * 24 * DEGREE), 0.1);
}

/* A verdict and finite poses, for both modes. */
static void test_degenerate_input(void **state)
{
    static const char *const names[] = {"equal",   "one",     "nothing shared",
                                        "a point", "circles", "empty"};
    struct scan corner, point, circle, empty, far;

    (void)state;
    scan_corner(&corner, 1, 1, 0.1);
    scan_begin(&point);
    point.first_point[1] = 1;
    point.points[0].direction.x = 1;
    point.view.segment_count = point.view.point_count = 1;
    scan_circle(&circle, 1);
    scan_begin(&empty);
    scan_begin(&far);
    scan_wall(&far, 100, 0, 100, 2, 0.1);
    for (int mode = 0; mode < 2; mode++)
        for (int c = 0; c < 6; c++) {
            cairn_force_field_params p = mode ? springs_params(0.3, 10) : small_params();
            struct fixture f = field_with(&p);
            cairn_force_field_state s;

            add(f.field,
                c == 3   ? &point
                : c == 4 ? &circle
                : c == 5 ? &empty
                         : &corner,
                pose(0.1, 0.2, 10));
            if (c == 0) {
                add(f.field, &corner, pose(0.1, 0.2, 10));
                add(f.field, &corner, pose(0.1, 0.2, 10));
            } else if (c == 2) {
                add(f.field, &far, pose(0, 0, 0));
            } else if (c == 3) {
                add(f.field, &corner, pose(0, 0.1, 0));
                add(f.field, &point, pose(0.1, 0.2, 10));
            } else if (c == 4) {
                add(f.field, &circle, pose(0.15, 0.2, 25));
            }
            run(f.field);
            s = cairn_force_field_read(f.field);
            if (s.verdict == CAIRN_FORCE_FIELD_RUNNING)
                fail_msg("%s: no verdict", names[c]);
            assert_poses_are_finite(f.field);
            if (c == 1 || c == 2 || c == 5) {
                assert_int_equal(s.verdict, CAIRN_FORCE_FIELD_CONVERGED);
                assert_true(s.mean_relocation == 0);
            }
            /* Circles are aligned; their rotation stays undetermined. */
            if (c == 4) {
                cairn_pose a = cairn_force_field_pose(f.field, 0),
                           b = cairn_force_field_pose(f.field, 1);

                assert_near(hypot((double)(a.x - b.x), (double)(a.y - b.y)), 0, 0.02);
            }
            test_pool_free(&f.pool);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_all_pairs),
        cmocka_unit_test(test_presets),
        cmocka_unit_test(test_parameters_of_springs_are_ignored_in_the_other_mode),
        cmocka_unit_test(test_bounds_of_the_parameters_are_taken),
        cmocka_unit_test(test_memory),
        cmocka_unit_test(test_sigma_falls_by_the_factor),
        cmocka_unit_test(test_no_scan_moves_farther_than_allowed),
        cmocka_unit_test(test_too_few_bonds),
        cmocka_unit_test(test_any_budget_gives_the_same),
        cmocka_unit_test(test_release),
        cmocka_unit_test(test_three_corners_come_together),
        cmocka_unit_test(test_nearest_neighbours_end_wrong),
        cmocka_unit_test(test_degenerate_input),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
