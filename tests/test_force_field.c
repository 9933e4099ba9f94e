/* Force field simulation as in chapter 7: forces and potential compared with all pairs, budgets,
 * endless operation, external points. */
#include "tests/field_scene.h"

/* ---- Reference implementation in double: every point with every other ---- */

enum { SLOW_POINTS = 1024, SLOW_SEGMENTS = 64, SLOW_CORNERS = SLOW_SEGMENTS * SLOW_SEGMENTS };

struct slow_field {
    const cairn_force_field_params *params;
    const struct scan *scans;
    int count;
    double pose[16][3];
    int fixed[16];
    /* After an iteration. */
    double force[16][2], torque[16], centre[16][2], relocation[16];
    double point_force[SLOW_POINTS][2], mass[SLOW_POINTS];
    double potential, mean_relocation;
    /* The gain of P(g) when scan i is rotated with all |cos| constant is the torque; this is the
     * rest, about any centre. */
    double direction_torque[16];
    long pairs;
    int segment_pairs;
    int corners;
};

static void slow_map(const double p[3], double x, double y, double *map_x, double *map_y)
{
    *map_x = p[0] + cos(p[2]) * x - sin(p[2]) * y;
    *map_y = p[1] + sin(p[2]) * x + cos(p[2]) * y;
}

struct slow_line {
    double ax, ay, bx, by;
};

/* From a segment. */
static double slow_distance(struct slow_line s, double x, double y)
{
    double dx = s.bx - s.ax, dy = s.by - s.ay;
    double along = fmin(fmax(((x - s.ax) * dx + (y - s.ay) * dy) / (dx * dx + dy * dy), 0), 1);

    return hypot(x - s.ax - along * dx, y - s.ay - along * dy);
}

static int slow_corner(const cairn_force_field_params *p, struct slow_line s, struct slow_line t,
                       double *x, double *y)
{
    double dx1 = s.bx - s.ax, dy1 = s.by - s.ay, dx2 = t.bx - t.ax, dy2 = t.by - t.ay;
    double det = dx1 * dy2 - dy1 * dx2, along;
    double angle = fabs(atan2(det, dx1 * dx2 + dy1 * dy2)), limit = (double)p->corner_distance;

    if (angle < (double)p->corner_min_opening || angle > (double)p->corner_max_opening)
        return 0;
    along = ((t.ax - s.ax) * dy2 - (t.ay - s.ay) * dx2) / det;
    *x = s.ax + along * dx1;
    *y = s.ay + along * dy1;
    if (p->roi == CAIRN_FORCE_FIELD_ROI_CROSSINGS)
        return slow_distance(s, *x, *y) <= limit && slow_distance(t, *x, *y) <= limit;
    return fmin(hypot(*x - s.ax, *y - s.ay), hypot(*x - s.bx, *y - s.by)) <= limit &&
           fmin(hypot(*x - t.ax, *y - t.ay), hypot(*x - t.bx, *y - t.by)) <= limit;
}

/* All but the motion. */
static void slow_forces(struct slow_field *f, double sigma, int by_sensor)
{
    static double x[SLOW_POINTS], y[SLOW_POINTS], angle[SLOW_POINTS];
    static double corner_x[SLOW_CORNERS], corner_y[SLOW_CORNERS];
    static int owner[SLOW_POINTS];
    /* boxes: a is the lower left, b the upper right */
    struct slow_line lines[SLOW_SEGMENTS], boxes[SLOW_SEGMENTS];
    int line_owner[SLOW_SEGMENTS];
    int points = 0, segments = 0;
    const double pi = 3.14159265358979323846, reach = (double)f->params->reach * sigma;

    for (int i = 0; i < f->count; i++) {
        const cairn_scan_view *v = &f->scans[i].view;
        double sx = 0, sy = 0;

        for (int k = 0; k < v->segment_count; k++) {
            cairn_segment s = v->segments[k];

            slow_map(f->pose[i], (double)s.a.x, (double)s.a.y, &lines[segments].ax,
                     &lines[segments].ay);
            slow_map(f->pose[i], (double)s.b.x, (double)s.b.y, &lines[segments].bx,
                     &lines[segments].by);
            line_owner[segments] = i;
            boxes[segments].ax = fmin(lines[segments].ax, lines[segments].bx);
            boxes[segments].ay = fmin(lines[segments].ay, lines[segments].by);
            boxes[segments].bx = fmax(lines[segments].ax, lines[segments].bx);
            boxes[segments].by = fmax(lines[segments].ay, lines[segments].by);
            for (int j = v->first_point[k]; j < v->first_point[k + 1]; j++) {
                double px, py;

                slow_map(f->pose[i], (double)v->points[j].position.x,
                         (double)v->points[j].position.y, &px, &py);
                boxes[segments].ax = fmin(boxes[segments].ax, px);
                boxes[segments].ay = fmin(boxes[segments].ay, py);
                boxes[segments].bx = fmax(boxes[segments].bx, px);
                boxes[segments].by = fmax(boxes[segments].by, py);
            }
            segments++;
        }
        for (int k = 0; k < v->point_count; k++) {
            cairn_oriented_point q = v->points[k];

            slow_map(f->pose[i], (double)q.position.x, (double)q.position.y, &x[points],
                     &y[points]);
            angle[points] = f->pose[i][2] + atan2((double)q.direction.y, (double)q.direction.x);
            owner[points] = i;
            f->mass[points] = 1;
            f->point_force[points][0] = f->point_force[points][1] = 0;
            sx += x[points];
            sy += y[points];
            points++;
        }
        f->centre[i][0] = sx / v->point_count;
        f->centre[i][1] = sy / v->point_count;
        if (by_sensor)
            slow_map(f->pose[i], (double)v->sensor.x, (double)v->sensor.y, &f->centre[i][0],
                     &f->centre[i][1]);
        f->force[i][0] = f->force[i][1] = f->torque[i] = f->direction_torque[i] = 0;
    }
    f->segment_pairs = 0;
    for (int i = 0; i < segments; i++)
        for (int j = i + 1; j < segments; j++)
            f->segment_pairs +=
                line_owner[i] != line_owner[j] &&
                !(f->fixed[line_owner[i]] && f->fixed[line_owner[j]]) &&
                boxes[i].ax <= boxes[j].bx + reach && boxes[j].ax <= boxes[i].bx + reach &&
                boxes[i].ay <= boxes[j].by + reach && boxes[j].ay <= boxes[i].by + reach;
    f->corners = 0;
    for (int i = 0; f->params->roi && i < segments; i++)
        for (int j = i + 1; j < segments; j++)
            f->corners += slow_corner(f->params, lines[i], lines[j], &corner_x[f->corners],
                                      &corner_y[f->corners]);
    for (int i = 0; i < points; i++)
        for (int k = 0; k < f->corners; k++)
            if (hypot(x[i] - corner_x[k], y[i] - corner_y[k]) <= (double)f->params->roi_radius)
                f->mass[i] = (double)f->params->roi_mass;

    f->potential = 0;
    f->pairs = 0;
    for (int i = 0; i < points; i++)
        for (int j = 0; j < points; j++) {
            double r = hypot(x[j] - x[i], y[j] - y[i]), m = f->mass[i] * f->mass[j],
                   c = cos(angle[i] - angle[j]);
            double v = m * fabs(c) * exp(-r * r / (2 * sigma * sigma)) / (sigma * sqrt(2 * pi));
            int a = owner[i];

            if (a == owner[j] || r > reach || (f->fixed[a] && f->fixed[owner[j]]))
                continue;
            f->pairs++;
            f->potential -= 0.25 * m * fabs(c) * erfc(r / (sigma * sqrt(2)));
            f->direction_torque[a] -=
                0.5 * m * (c > 0 ? 1 : -1) * sin(angle[i] - angle[j]) * erfc(r / (sigma * sqrt(2)));
            if (r < 1e-9)
                continue;
            f->point_force[i][0] += v * (x[j] - x[i]) / r;
            f->point_force[i][1] += v * (y[j] - y[i]) / r;
        }
    f->pairs /= 2;
    for (int i = 0; i < points; i++) {
        int a = owner[i];
        double fx = f->point_force[i][0], fy = f->point_force[i][1];

        f->force[a][0] += fx;
        f->force[a][1] += fy;
        f->torque[a] += (x[i] - f->centre[a][0]) * fy - (y[i] - f->centre[a][1]) * fx;
    }
}

static void slow_iterate(struct slow_field *f, double sigma, double dt, int by_sensor)
{
    int moving = 0;

    slow_forces(f, sigma, by_sensor);
    f->mean_relocation = 0;
    for (int i = 0; i < f->count; i++) {
        const cairn_scan_view *v = &f->scans[i].view;
        double inertia = 0, turn, sx, sy, ox, oy, c, s;

        f->relocation[i] = 0;
        if (f->fixed[i])
            continue;
        for (int k = 0; k < v->point_count; k++) {
            double x, y;

            slow_map(f->pose[i], (double)v->points[k].position.x, (double)v->points[k].position.y,
                     &x, &y);
            inertia += pow(x - f->centre[i][0], 2) + pow(y - f->centre[i][1], 2);
        }
        sx = 0.5 * dt * dt * f->force[i][0] / v->point_count;
        sy = 0.5 * dt * dt * f->force[i][1] / v->point_count;
        turn = 0.5 * dt * dt * f->torque[i] / inertia;
        c = cos(turn);
        s = sin(turn);
        ox = f->pose[i][0] - f->centre[i][0];
        oy = f->pose[i][1] - f->centre[i][1];
        f->pose[i][0] = f->centre[i][0] + c * ox - s * oy + sx;
        f->pose[i][1] = f->centre[i][1] + s * ox + c * oy + sy;
        f->pose[i][2] += turn;
        f->relocation[i] = sqrt(sx * sx + sy * sy + turn * turn * inertia / v->point_count);
        f->mean_relocation += f->relocation[i];
        moving++;
    }
    f->mean_relocation /= moving;
}

static void slow_start(struct slow_field *f, const cairn_force_field_params *params,
                       const struct scan *scans, const cairn_pose *poses, int count)
{
    memset(f, 0, sizeof *f);
    f->params = params;
    f->scans = scans;
    f->count = count;
    for (int i = 0; i < count; i++) {
        f->pose[i][0] = (double)poses[i].x;
        f->pose[i][1] = (double)poses[i].y;
        f->pose[i][2] = (double)poses[i].theta;
    }
}

/* ---- Tests ---- */

/* The params must be refused by a rule. */
static void assert_refused(const cairn_force_field_params *params, const char *rule)
{
    cairn_object_fault fault = {.module = NULL};

    assert_status(cairn_force_field_check(params, &fault), CAIRN_BAD_ARGUMENT);
    assert_string_equal(fault.module, "force_field");
    assert_string_equal(fault.rule, rule);
    assert_int_equal(cairn_force_field_memory(params), 0);
}

/* Rules between parameters; tests/test_object.c has the ranges. */
static void test_params_are_refused(void **state)
{
    const cairn_real nan = (cairn_real)NAN;
    cairn_force_field_params good = small_params(), p;
    cairn_pool pool = test_pool(cairn_force_field_memory(&good));
    cairn_force_field *field;

    (void)state;
    p = good;
    p.sigma_end = CAIRN_REAL(0.2);
    assert_refused(&p, "sigma_end: at most sigma_start");
    p = good;
    p.dt_end = CAIRN_REAL(0.06);
    assert_refused(&p, "dt_end: at most dt_start");
    p = good;
    p.corner_min_opening = 2;
    assert_refused(&p, "corner_max_opening: at least corner_min_opening");
    assert_status(cairn_force_field_create(NULL, &pool, &good), CAIRN_BAD_ARGUMENT);
    assert_int_equal(pool.used, 0);

#define ACCEPTED(name, value)                                                                      \
    p = good;                                                                                      \
    p.name = value;                                                                                \
    assert_true(cairn_force_field_memory(&p) > 0)
    ACCEPTED(max_scans, 1);
    ACCEPTED(max_corners, 1);
    ACCEPTED(max_corners, 1 << 24);
    ACCEPTED(sigma_end, good.sigma_start);
    ACCEPTED(sigma_step, 0);
    ACCEPTED(dt_end, good.dt_start);
    ACCEPTED(dt_factor, 0);
    ACCEPTED(dt_factor, 1);
    ACCEPTED(reach, 6);
    ACCEPTED(sensor_below, 0);
    ACCEPTED(roi_mass, CAIRN_REAL(1e6));
    ACCEPTED(max_steps, 1);
    ACCEPTED(stop_relocation, 0);
    ACCEPTED(stop_relocation, CAIRN_REAL(1e6));
#undef ACCEPTED

    /* Without regions of interest their parameters are ignored. */
    p = good;
    p.roi = 0;
    p.max_corners = 0;
    p.roi_mass = p.roi_radius = nan;
    assert_true(cairn_force_field_memory(&p) > 0);
    assert_true(cairn_force_field_memory(&p) < cairn_force_field_memory(&good));
    assert_ok(cairn_force_field_create(&field, &pool, &p));
    test_pool_free(&pool);
}

static void test_the_defaults_are_the_thesis(void **state)
{
    cairn_force_field_params p = cairn_force_field_default();

    (void)state;
    assert_int_equal(p.mode, CAIRN_FORCE_FIELD_GRADIENT);
    assert_near(p.sigma_start, 0.15, 1e-8);
    assert_near(p.sigma_end, 0.04, 1e-8);
    assert_near(p.sigma_step, 0.0025, 1e-8);
    assert_near(p.dt_start, 0.05, 1e-8);
    assert_near(p.dt_end, 0.01, 1e-8);
    assert_near(p.dt_factor, 0.96, 1e-7);
    assert_near(p.roi_radius, 0.05, 1e-8);
    assert_near(p.roi_mass, 4, 0);
    assert_near(p.corner_distance, 0.3, 1e-7);
    assert_near(p.corner_min_opening, 80 * DEGREE, 1e-6);
    assert_near(p.corner_max_opening, 100 * DEGREE, 1e-6);
    assert_int_equal(p.max_steps, 50);
    assert_near(p.sensor_below, 0.5, 0);
    assert_near(p.stop_relocation, 0.0001, 1e-9);
    assert_int_equal(p.roi, 1);
    assert_int_equal(p.potential, 1);
    assert_int_equal(p.max_scans, 64);
    assert_int_equal(p.max_segments, 1024);
    assert_int_equal(p.max_points, 8192);
    assert_int_equal(p.max_corners, 1024);
    assert_near(p.reach, 4, 0);
}

/* As written: the motion of the thesis, and corners wherever two segments cross. */
static void test_as_written_is_the_thesis(void **state)
{
    cairn_force_field_params p = cairn_force_field_as_written(), q = cairn_force_field_default();

    (void)state;
    assert_int_equal(p.mode, CAIRN_MODE_AS_WRITTEN);
    assert_int_equal(p.mode, CAIRN_FORCE_FIELD_GRADIENT);
    assert_int_equal(p.roi, CAIRN_FORCE_FIELD_ROI_CROSSINGS);
    assert_int_equal(q.roi, CAIRN_FORCE_FIELD_ROI_ENDS);
    assert_int_equal(cairn_force_field_memory(&p), cairn_force_field_memory(&q));
    assert_near(p.sigma_start, 0.15, 1e-8);
    assert_near(p.sigma_end, 0.04, 1e-8);
    assert_near(p.dt_start, 0.05, 1e-8);
    assert_near(p.dt_end, 0.01, 1e-8);
    assert_near(p.oriented_below, 0, 0);
    assert_int_equal(p.max_steps, 50);
}

static cairn_status create_with(void *params, cairn_pool *pool)
{
    cairn_force_field *field;

    return cairn_force_field_create(&field, pool, params);
}

/* The macro is a constant expression. */
static _Alignas(CAIRN_ALIGN) unsigned char constant_memory[CAIRN_FORCE_FIELD_BYTES(3, 40, 9, 5)];

static void test_memory_is_exact(void **state)
{
    cairn_force_field_params p = small_params();
    static const int32_t counts[] = {1, 2, 3, 17, 64, 100, 333, 4096};
    const int n = (int)(sizeof counts / sizeof *counts);
    cairn_force_field *field;
    cairn_pool pool;

    (void)state;
    p.max_scans = 3;
    p.max_points = 40;
    p.max_segments = 9;
    p.max_corners = 5;
    test_every_pool_size(create_with, &p, cairn_force_field_memory(&p));
    assert_ok(cairn_pool_init(&pool, constant_memory, sizeof constant_memory));
    assert_ok(cairn_force_field_create(&field, &pool, &p));
    p.roi = 0;
    test_every_pool_size(create_with, &p, cairn_force_field_memory(&p));
    p.roi = 1;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++)
            for (int k = 0; k < n; k++)
                for (int l = 0; l < n; l++) {
                    size_t need,
                        bound = CAIRN_FORCE_FIELD_BYTES(counts[i], counts[j], counts[k], counts[l]);

                    p.max_scans = counts[i];
                    p.max_points = counts[j];
                    p.max_segments = counts[k];
                    p.max_corners = counts[l];
                    need = cairn_force_field_memory(&p);
                    assert_true(need > 0 && need <= bound);
                    assert_true(bound <= need + 2048 + 4 * (size_t)counts[l]);
                }
}

/* One iteration and many compared with all pairs of points. In float the two diverge after some
 * iterations. */
static void compare_with_slow(const cairn_force_field_params *params, int iterations, int fixed)
{
    struct fixture f = field_with(params);
    struct scan scans[SCENE];
    cairn_pose poses[SCENE];
    static struct slow_field slow;
    double sigma = (double)params->sigma_start, dt = (double)params->dt_start;

    make_scene(scans, poses);
    for (int i = 0; i < SCENE; i++)
        add(f.field, &scans[i], poses[i]);
    slow_start(&slow, params, scans, poses, SCENE);
    for (int i = 0; i < fixed; i++) {
        assert_ok(cairn_force_field_fix(f.field, 2 * i, 1));
        slow.fixed[2 * i] = 1;
    }
    for (int k = 0; k < iterations; k++) {
        double tolerance = NUMBER(1e-11, 3e-4) * (k + 1);
        cairn_force_field_state s;

        iterate(f.field);
        slow_iterate(&slow, sigma, dt,
                     sigma <
                         (double)params->sensor_below * (double)params->sigma_start * (1 - 1e-5));
        s = cairn_force_field_read(f.field);
        assert_near(s.sigma, sigma, 1e-6);
        assert_near(s.dt, dt, 1e-6);
        assert_near(s.potential, params->potential ? slow.potential : 0,
                    NUMBER(1e-9, 0.02) * (k + 1));
        assert_true(s.potential == cairn_force_field_potential(f.field));
        assert_near(s.mean_relocation, slow.mean_relocation, tolerance);
        assert_int_equal(s.iterations, k + 1);
        assert_int_equal(s.start_iterations, k + 1);
        assert_int_equal(s.corners_dropped, 0);
        assert_int_equal(s.corners, slow.corners);
#ifndef CAIRN_FLOAT
        assert_int_equal(s.pairs, slow.pairs);
#endif
        /* Boxes are enlarged by a thousandth more than the reach. */
        assert_in_range(s.segment_pairs, slow.segment_pairs, slow.segment_pairs + 1);
        assert_true(slow.segment_pairs > 10);
        for (int i = 0, point = 0; i < SCENE; point += scans[i].view.point_count, i++) {
            cairn_pose p = cairn_force_field_pose(f.field, i);
            cairn_force_field_motion m = cairn_force_field_motion_of(f.field, i);
            double large = NUMBER(1e-8, 0.2) * (k + 1);

            assert_near(p.x, slow.pose[i][0], tolerance);
            assert_near(p.y, slow.pose[i][1], tolerance);
            assert_near(p.theta, slow.pose[i][2], tolerance);
            assert_near(m.centre.x, slow.centre[i][0], tolerance);
            assert_near(m.centre.y, slow.centre[i][1], tolerance);
            assert_near(m.force.x, slow.force[i][0], large);
            assert_near(m.force.y, slow.force[i][1], large);
            assert_near(m.torque, slow.torque[i], large);
            assert_near(m.relocation, slow.relocation[i], tolerance);
            for (int j = 0; j < scans[i].view.point_count; j++) {
                cairn_vec2 force;
                cairn_real mass;

                assert_ok(cairn_force_field_point_force(f.field, i, j, &force, &mass));
                assert_near(mass, slow.mass[point + j], 0);
                assert_near(force.x, slow.point_force[point + j][0], large);
                assert_near(force.y, slow.point_force[point + j][1], large);
            }
        }
        sigma = fmax((double)params->sigma_end,
                     (double)params->sigma_start - (k + 1) * (double)params->sigma_step);
        dt = fmax((double)params->dt_end, dt * (double)params->dt_factor);
    }
    test_pool_free(&f.pool);
}

static void test_all_pairs(void **state)
{
    cairn_force_field_params p = small_params();

    (void)state;
    p.stop_relocation = 0;
    compare_with_slow(&p, NUMBER(12, 2), 0);
    compare_with_slow(&p, 2, 3);
    p.roi = CAIRN_FORCE_FIELD_ROI_CROSSINGS;
    compare_with_slow(&p, NUMBER(12, 2), 0);
    p.roi = 0;
    compare_with_slow(&p, NUMBER(12, 2), 0);
    p.potential = 0;
    p.reach = 4;
    compare_with_slow(&p, 2, 0);
    /* sigma falls to half its start, where the centre is still the centre of mass, and below. */
    p.sigma_start = CAIRN_REAL(0.16);
    p.sigma_step = CAIRN_REAL(0.04);
    compare_with_slow(&p, 4, 0);
    /* Both clamps and the change of the centre within a few iterations. */
    p.sigma_step = CAIRN_REAL(0.03);
    p.sigma_end = CAIRN_REAL(0.05);
    p.dt_factor = CAIRN_REAL(0.7);
    p.dt_end = CAIRN_REAL(0.02);
    compare_with_slow(&p, NUMBER(6, 4), 0);
    p.sensor_below = 0;
    compare_with_slow(&p, NUMBER(6, 4), 1);
}

#ifndef CAIRN_FLOAT
/* P(g) after scan i is moved by (x, y) and rotated by `angle` about (cx, cy). */
static double potential_after(const cairn_force_field_params *params, const struct scan *scans,
                              const cairn_pose *poses, int i, cairn_vec2 centre, double x, double y,
                              double angle)
{
    struct fixture f = field_with(params);
    double potential;

    for (int k = 0; k < SCENE; k++) {
        cairn_pose p = poses[k];

        if (k == i) {
            double ox = p.x - centre.x, oy = p.y - centre.y;

            p.x = centre.x + cos(angle) * ox - sin(angle) * oy + x;
            p.y = centre.y + sin(angle) * ox + cos(angle) * oy + y;
            p.theta += angle;
        }
        add(f.field, &scans[k], p);
    }
    iterate(f.field);
    potential = cairn_force_field_potential(f.field);
    test_pool_free(&f.pool);
    return potential;
}
#endif

/* F = -dP/d(x, y) with all factors of eqs. 7.3 to 7.5. The torque is minus the derivative with
 * respect to a rotation, without the change of |cos|, which the thesis omits. Masses are those of
 * the start: no regions of interest. */
static void test_force_is_minus_the_gradient(void **state)
{
#ifndef CAIRN_FLOAT
    const double h = 2e-6;
    cairn_force_field_params p = small_params();
    struct scan scans[SCENE];
    cairn_pose poses[SCENE];
    static struct slow_field slow;
    struct fixture f;

    p.roi = 0;
    p.reach = 6;
    p.sigma_start = 0.4; /* no pair is beyond the reach, where the potential has a small step */
    f = field_with(&p);
    make_scene(scans, poses);
    slow_start(&slow, &p, scans, poses, SCENE);
    slow_forces(&slow, p.sigma_start, 0);
    for (int i = 0; i < SCENE; i++)
        add(f.field, &scans[i], poses[i]);
    iterate(f.field);
    for (int i = 0; i < SCENE; i++) {
        cairn_force_field_motion m = cairn_force_field_motion_of(f.field, i);
        double x = potential_after(&p, scans, poses, i, m.centre, -h, 0, 0) -
                   potential_after(&p, scans, poses, i, m.centre, h, 0, 0);
        double y = potential_after(&p, scans, poses, i, m.centre, 0, -h, 0) -
                   potential_after(&p, scans, poses, i, m.centre, 0, h, 0);
        double turn = potential_after(&p, scans, poses, i, m.centre, 0, 0, -h) -
                      potential_after(&p, scans, poses, i, m.centre, 0, 0, h);
        double scale = fabs(m.force.x) + fabs(m.force.y) + fabs(m.torque);

        assert_true(scale > 1);
        assert_near(m.force.x, x / (2 * h), 1e-6 * scale);
        assert_near(m.force.y, y / (2 * h), 1e-6 * scale);
        assert_near(m.torque + slow.direction_torque[i], turn / (2 * h),
                    1e-6 * (scale + fabs(slow.direction_torque[i])));
        assert_true(fabs(slow.direction_torque[i]) > 1e-4 * scale);
    }
    test_pool_free(&f.pool);
#endif
    (void)state;
}

/* Error of the relative pose of b seen from a, which is zero in truth: metres and degrees. */
static void assert_together(const cairn_force_field *field, int a, int b, double metres,
                            double degrees)
{
    cairn_pose p =
        cairn_pose_between(cairn_force_field_pose(field, a), cairn_force_field_pose(field, b));

    assert_near((double)p.theta / DEGREE, 0, degrees);
    assert_near(hypot((double)p.x, (double)p.y), 0, metres);
}

static void test_two_corners_come_together(void **state)
{
    cairn_force_field_params p = small_params();
    struct fixture f = field_with(&p);
    struct scan scan;

    (void)state;
    scan_corner(&scan, 1.5, 1.2, 0.05);
    add(f.field, &scan, pose(0, 0, 0));
    add(f.field, &scan, pose(0.1, 0, 5));
    run(f.field);
    assert_int_equal(cairn_force_field_read(f.field).verdict, CAIRN_FORCE_FIELD_OUT_OF_STEPS);
    assert_together(f.field, 0, 1, 0.01, 0.3);
    test_pool_free(&f.pool);
}

/* Three scans of one corner each, as in figure 7.6. The forces on a scan, and with them its
 * steps, are proportional to the density of the points: at 2 cm the twelve steps of the thesis
 * suffice; with fewer points dt must be larger. */
static void three_corners(double spacing, cairn_force_field_params p, int steps, double metres,
                          double degrees)
{
    static const double ends[3][2] = {{1.5, 1.2}, {1, 1.4}, {1.3, 0.8}};
    struct scan scan;
    struct fixture f;

    p.max_scans = 3;
    f = field_with(&p);
    for (int i = 0; i < 3; i++) {
        scan_corner(&scan, ends[i][0], ends[i][1], spacing);
        add(f.field, &scan,
            i == 0   ? pose(0, 0, 0)
            : i == 1 ? pose(0.15, -0.1, 6)
                     : pose(-0.1, 0.12, -5));
    }
    for (int k = 0; k < steps; k++)
        iterate(f.field);
    for (int i = 0; i < 3; i++)
        assert_together(f.field, i, (i + 1) % 3, metres, degrees);
    test_pool_free(&f.pool);
}

static void test_three_corners_come_together(void **state)
{
    (void)state;
    three_corners(0.02, cairn_force_field_default(), 12, 0.02, 0.5);
    three_corners(0.02, cairn_force_field_as_written(), 12, 0.02, 0.5);
    three_corners(0.03, cairn_force_field_spaced(CAIRN_REAL(0.03)), 12, 0.02, 0.6);
    three_corners(0.05, cairn_force_field_spaced(CAIRN_REAL(0.05)), 12, 0.03, 1);
    three_corners(0.10, cairn_force_field_spaced(CAIRN_REAL(0.10)), 50, 0.04, 1);
    assert_near(cairn_force_field_spaced(CAIRN_REAL(0.08)).dt_start, 0.10, 1e-6);
    assert_near(cairn_force_field_spaced(CAIRN_REAL(0.08)).dt_end, 0.02, 1e-6);
}

/* At constant sigma and with short steps the potential falls in every one. The force does not
 * vanish towards distance 0, so in the end scans oscillate about the goal by one step; differently
 * spaced points keep most of them apart until then. */
static void test_the_potential_falls(void **state)
{
    cairn_force_field_params p = small_params();
    struct fixture f;
    struct scan scan;
    double last = 0;

    (void)state;
    p.roi = 0;
    p.sigma_step = 0;
    p.dt_start = p.dt_end = CAIRN_REAL(0.01);
    p.max_steps = 500;
    p.stop_relocation = CAIRN_REAL(1e-4);
    f = field_with(&p);
    scan_corner(&scan, 1.5, 1.2, 0.05);
    add(f.field, &scan, pose(0, 0, 0));
    scan_corner(&scan, 1.5, 1.2, 0.043);
    add(f.field, &scan, pose(0.05, 0.02, 3));
    while (cairn_force_field_read(f.field).verdict == CAIRN_FORCE_FIELD_RUNNING) {
        cairn_force_field_state s;

        iterate(f.field);
        s = cairn_force_field_read(f.field);
        assert_true((double)s.potential < last);
        last = (double)s.potential;
        assert_true((s.mean_relocation < p.stop_relocation) ==
                    (s.verdict == CAIRN_FORCE_FIELD_CONVERGED));
    }
    assert_int_equal(cairn_force_field_read(f.field).verdict, CAIRN_FORCE_FIELD_CONVERGED);
    assert_true(cairn_force_field_read(f.field).iterations > 50);
    assert_together(f.field, 0, 1, 0.02, 0.5);
    test_pool_free(&f.pool);
}

static void assert_same_pose(cairn_pose p, cairn_pose q)
{
    assert_true(p.x == q.x && p.y == q.y && p.theta == q.theta);
}

static void test_fixed_scans_stay(void **state)
{
    cairn_force_field_params p = small_params();
    struct fixture f = field_with(&p);
    struct scan scans[SCENE];
    cairn_pose poses[SCENE];

    (void)state;
    make_scene(scans, poses);
    add_scene(f.field);
    assert_ok(cairn_force_field_fix(f.field, 1, 1));
    assert_ok(cairn_force_field_fix(f.field, 4, 7));
    assert_ok(cairn_force_field_fix(f.field, 5, 1));
    assert_ok(cairn_force_field_fix(f.field, 5, 0));
    for (int k = 0; k < 5; k++)
        iterate(f.field);
    for (int i = 0; i < SCENE; i++) {
        cairn_pose q = cairn_force_field_pose(f.field, i);
        cairn_force_field_motion m = cairn_force_field_motion_of(f.field, i);

        assert_true(m.force.x != 0 && m.torque != 0);
        assert_true((q.x == poses[i].x) == (i == 1 || i == 4));
        assert_true((m.relocation == 0) == (i == 1 || i == 4));
    }
    assert_same_pose(cairn_force_field_pose(f.field, 1), poses[1]);

    /* All fixed: nothing moves, no pair is evaluated, and the run ends. */
    for (int i = 0; i < SCENE; i++)
        assert_ok(cairn_force_field_fix(f.field, i, 1));
    poses[0] = cairn_force_field_pose(f.field, 0);
    run(f.field);
    assert_int_equal(cairn_force_field_read(f.field).iterations, 6);
    assert_int_equal(cairn_force_field_read(f.field).verdict, CAIRN_FORCE_FIELD_CONVERGED);
    assert_int_equal(cairn_force_field_read(f.field).pairs, 0);
    assert_int_equal(cairn_force_field_read(f.field).segment_pairs, 0);
    assert_near(cairn_force_field_potential(f.field), 0, 0);
    assert_near(cairn_force_field_read(f.field).mean_relocation, 0, 0);
    assert_same_pose(cairn_force_field_pose(f.field, 0), poses[0]);

    assert_status(cairn_force_field_fix(f.field, -1, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_force_field_fix(f.field, SCENE, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_force_field_fix(NULL, 0, 1), CAIRN_BAD_ARGUMENT);
    test_pool_free(&f.pool);
}

/* A scan placed elsewhere equals one added there at the beginning. */
static void test_placed_scans_are_there(void **state)
{
    cairn_force_field_params p = small_params();
    struct fixture f = field_with(&p), fresh = field_with(&p);
    struct scan scans[SCENE];
    cairn_pose poses[SCENE], there = {CAIRN_REAL(0.3), CAIRN_REAL(-0.2), 7},
                             far = {0, CAIRN_REAL(1.1e6), 0};
    cairn_pose nan = {0, 0, (cairn_real)NAN};
    cairn_budget budget = {3};
    uint32_t revision;

    (void)state;
    make_scene(scans, poses);
    add_scene(fresh.field);
    add_scene(f.field);
    revision = cairn_force_field_revision(f.field);
    assert_ok(cairn_force_field_place(f.field, 2, there));
    assert_int_equal(cairn_force_field_revision(f.field), revision + 1);
    assert_near(cairn_force_field_pose(f.field, 2).theta, 7 - 6.283185307179586,
                NUMBER(1e-12, 1e-6));
    assert_ok(cairn_force_field_place(fresh.field, 2, there));
    for (int k = 0; k < 3; k++)
        iterate(f.field);
    /* Back to the initial poses, after some iterations. */
    for (int i = 0; i < SCENE; i++)
        assert_ok(cairn_force_field_place(f.field, i, i == 2 ? there : poses[i]));
    cairn_force_field_restart(f.field);
    for (int k = 0; k < 4; k++) {
        iterate(f.field);
        iterate(fresh.field);
        for (int i = 0; i < SCENE; i++)
            assert_same_pose(cairn_force_field_pose(f.field, i),
                             cairn_force_field_pose(fresh.field, i));
    }
    assert_status(cairn_force_field_place(NULL, 0, there), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_force_field_place(f.field, -1, there), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_force_field_place(f.field, SCENE, there), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_force_field_place(f.field, 0, far), CAIRN_BAD_ARGUMENT);
    far.x = CAIRN_REAL(-1.1e6);
    far.y = 0;
    assert_status(cairn_force_field_place(f.field, 0, far), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_force_field_place(f.field, 0, nan), CAIRN_NOT_FINITE);
    assert_status(cairn_force_field_iterate(f.field, &budget), CAIRN_MORE);
    assert_status(cairn_force_field_place(f.field, 0, there), CAIRN_BAD_ARGUMENT);
    test_pool_free(&f.pool);
    test_pool_free(&fresh.pool);
}

static uint64_t hash_of(const cairn_force_field *field)
{
    uint64_t hash = TEST_HASH_START;

    for (int32_t i = 0; i < cairn_force_field_pose_count(field); i++) {
        cairn_pose p = cairn_force_field_pose(field, i);

        hash = test_hash(hash, &p, sizeof p);
    }
    return hash;
}

static void test_budgets_are_equal(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000, CAIRN_UNBOUNDED};
    cairn_force_field_params p = small_params();
    uint64_t expected[12];
    cairn_force_field_state last = {0};

    (void)state;
    p.max_steps = 12;
    p.stop_relocation = 0;
    for (int b = 3; b >= 0; b--) {
        struct fixture f = field_with(&p);
        cairn_status status;
        cairn_force_field_state s;
        uint32_t revision;
        int committed = 0;
        int64_t calls = 0;

        add_scene(f.field);
        revision = cairn_force_field_revision(f.field);
        do {
            cairn_budget budget = {0};
            cairn_force_field_state before = cairn_force_field_read(f.field);

            /* Nothing for nothing. */
            assert_status(cairn_force_field_step(f.field, &budget), CAIRN_MORE);
            assert_int_equal(budget.left, 0);
            budget.left = budgets[b];
            status = b == 3 ? cairn_force_field_iterate(f.field, &budget)
                            : cairn_force_field_step(f.field, &budget);
            calls++;
            assert_true(budget.left >= 0);
            s = cairn_force_field_read(f.field);
            assert_int_equal(s.units - before.units, budgets[b] - budget.left);
            assert_true(s.max_step_units >= budgets[b] - budget.left);
            for (; committed < s.iterations; committed++) {
                if (b == 3)
                    expected[committed] = hash_of(f.field);
            }
            if (committed > 0 && s.iterations > before.iterations && b < 2)
                assert_true(hash_of(f.field) == expected[committed - 1]);
            assert_int_equal(cairn_force_field_revision(f.field), revision + (uint32_t)committed);
        } while (s.verdict == CAIRN_FORCE_FIELD_RUNNING);
        assert_ok(status);
        assert_int_equal(committed, 12);
        assert_true(hash_of(f.field) == expected[11]);
        if (b == 3)
            last = s;
        /* Fixed values: they change when the charges or the amount of work change. */
        assert_int_equal(s.units, NUMBER(285239, 285238));
        assert_int_equal(s.units, last.units);
        assert_true(calls >= s.units / budgets[b]);
        assert_int_equal(s.pairs, last.pairs);
        assert_int_equal(s.segment_pairs, last.segment_pairs);
        assert_true(s.potential == last.potential && s.mean_relocation == last.mean_relocation);
        assert_true(b == 3 || s.max_step_units == budgets[b]);
        test_pool_free(&f.pool);
    }
}

/* Steps with `budget` until `iterations` are committed, and then on into the next one. */
static void step_into(cairn_force_field *field, int32_t iterations, int32_t units)
{
    cairn_budget budget = {units};

    while (cairn_force_field_read(field).iterations < iterations)
        iterate(field);
    assert_status(cairn_force_field_step(field, &budget), CAIRN_MORE);
    assert_int_equal(cairn_force_field_read(field).iterations, iterations);
}

/* Adding, fixing and restarting in the middle of an iteration act at its end. */
static void test_inputs_wait_for_the_commit(void **state)
{
    static const int32_t units[] = {1, 40, 90, 130, 200, 300, 500, 900, 1400};
    cairn_force_field_params p = small_params();
    struct scan scans[SCENE];
    cairn_pose poses[SCENE];
    struct fixture at_end = field_with(&p);
    uint64_t expected[3];

    (void)state;
    p.max_steps = 4;
    make_scene(scans, poses);
    for (int i = 0; i < SCENE - 2; i++)
        add(at_end.field, &scans[i], poses[i]);
    iterate(at_end.field);
    iterate(at_end.field);
    add(at_end.field, &scans[SCENE - 2], poses[SCENE - 2]);
    assert_int_equal(cairn_force_field_pose_count(at_end.field), SCENE - 1);
    add(at_end.field, &scans[SCENE - 1], poses[SCENE - 1]);
    assert_ok(cairn_force_field_fix(at_end.field, SCENE - 1, 1));
    assert_ok(cairn_force_field_fix(at_end.field, 0, 1));
    cairn_force_field_restart(at_end.field);
    expected[0] = hash_of(at_end.field);
    iterate(at_end.field);
    expected[1] = hash_of(at_end.field);
    assert_near(cairn_force_field_read(at_end.field).sigma, p.sigma_start, 0);
    assert_near(cairn_force_field_read(at_end.field).dt, p.dt_start, 0);
    assert_int_equal(cairn_force_field_read(at_end.field).start_iterations, 1);
    assert_int_equal(cairn_force_field_read(at_end.field).iterations, 3);
    iterate(at_end.field);
    expected[2] = hash_of(at_end.field);

    for (size_t k = 0; k < sizeof units / sizeof *units; k++) {
        struct fixture f = field_with(&p);
        uint32_t revision;
        cairn_vec2 force;
        cairn_real mass;

        for (int i = 0; i < SCENE - 2; i++)
            add(f.field, &scans[i], poses[i]);
        assert_status(cairn_force_field_point_force(f.field, 0, 0, &force, &mass), CAIRN_EMPTY);
        step_into(f.field, 1, units[k]);
        assert_status(cairn_force_field_point_force(f.field, 0, 0, &force, &mass), CAIRN_EMPTY);
        add(f.field, &scans[SCENE - 2], poses[SCENE - 2]);
        add(f.field, &scans[SCENE - 1], poses[SCENE - 1]);
        assert_ok(cairn_force_field_fix(f.field, SCENE - 1, 1));
        assert_ok(cairn_force_field_fix(f.field, 0, 1));
        cairn_force_field_restart(f.field);
        assert_int_equal(cairn_force_field_pose_count(f.field), SCENE - 2);
        assert_int_equal(cairn_force_field_read(f.field).start_iterations, 1);
        revision = cairn_force_field_revision(f.field);
        iterate(f.field);
        assert_int_equal(cairn_force_field_pose_count(f.field), SCENE);
        assert_int_equal(cairn_force_field_revision(f.field), revision + 1);
        assert_int_equal(cairn_force_field_read(f.field).start_iterations, 0);
        assert_true(hash_of(f.field) == expected[0]);
        assert_same_pose(cairn_force_field_pose(f.field, SCENE - 1), poses[SCENE - 1]);
        assert_ok(cairn_force_field_point_force(f.field, SCENE - 3, 0, &force, &mass));
        assert_status(cairn_force_field_point_force(f.field, SCENE - 2, 0, &force, &mass),
                      CAIRN_EMPTY);
        assert_near(cairn_force_field_motion_of(f.field, SCENE - 1).force.x, 0, 0);
        iterate(f.field);
        assert_true(hash_of(f.field) == expected[1]);
        assert_ok(cairn_force_field_point_force(f.field, SCENE - 1, 0, &force, &mass));
        assert_true(cairn_force_field_motion_of(f.field, SCENE - 1).force.x != 0);
        assert_same_pose(cairn_force_field_pose(f.field, SCENE - 1), poses[SCENE - 1]);
        iterate(f.field);
        assert_true(hash_of(f.field) == expected[2]);
        test_pool_free(&f.pool);
    }
    test_pool_free(&at_end.pool);
}

static void test_stop_and_restart(void **state)
{
    cairn_force_field_params p = small_params();
    struct fixture f;
    struct scan scan;
    cairn_budget none = {0};
    int32_t iterations;
    uint64_t hash;

    (void)state;
    p.max_steps = 3;
    p.stop_relocation = 0;
    f = field_with(&p);
    assert_status(cairn_force_field_step(f.field, &none), CAIRN_EMPTY);
    assert_status(cairn_force_field_iterate(f.field, &none), CAIRN_EMPTY);
    assert_status(cairn_force_field_step(NULL, &none), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_force_field_step(f.field, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_force_field_iterate(NULL, &none), CAIRN_BAD_ARGUMENT);
    add_scene(f.field);
    assert_status(cairn_force_field_step(f.field, &none), CAIRN_MORE);
    run(f.field);
    assert_int_equal(cairn_force_field_read(f.field).iterations, 3);
    assert_int_equal(cairn_force_field_read(f.field).verdict, CAIRN_FORCE_FIELD_OUT_OF_STEPS);
    assert_ok(cairn_force_field_step(f.field, &none));

    /* A new scan alone does not start it. */
    scan_corner(&scan, 1, 1, 0.1);
    add(f.field, &scan, pose(2.1, 1.6, 0));
    hash = hash_of(f.field);
    run(f.field);
    assert_int_equal(cairn_force_field_read(f.field).iterations, 3);
    assert_true(hash_of(f.field) == hash);
    cairn_force_field_restart(f.field);
    assert_int_equal(cairn_force_field_read(f.field).verdict, CAIRN_FORCE_FIELD_RUNNING);
    assert_int_equal(cairn_force_field_read(f.field).start_iterations, 0);
    run(f.field);
    iterations = cairn_force_field_read(f.field).iterations;
    assert_int_equal(iterations, 6);
    assert_true(hash_of(f.field) != hash);
    test_pool_free(&f.pool);
}

static void test_clear(void **state)
{
    cairn_force_field_params p = small_params();
    struct fixture fresh = field_with(&p), f = field_with(&p);
    struct scan scan;
    cairn_vec2 force;
    cairn_real mass;

    (void)state;
    add_scene(fresh.field);
    for (int k = 0; k < 3; k++)
        iterate(fresh.field);
    /* In the middle of an iteration of other work. */
    scan_corner(&scan, 1, 1, 0.1);
    for (int i = 0; i < 9; i++)
        add(f.field, &scan, pose(0.1 * i, 0, i));
    assert_ok(cairn_force_field_fix(f.field, 2, 1));
    step_into(f.field, 2, 700);
    cairn_force_field_restart(f.field);
    cairn_force_field_clear(f.field);
    assert_int_equal(cairn_force_field_pose_count(f.field), 0);
    assert_int_equal(cairn_force_field_read(f.field).iterations, 0);
    assert_int_equal(cairn_force_field_read(f.field).units, 0);
    add_scene(f.field);
    assert_status(cairn_force_field_point_force(f.field, 0, 0, &force, &mass), CAIRN_EMPTY);
    for (int k = 0; k < 3; k++)
        iterate(f.field);
    assert_true(hash_of(f.field) == hash_of(fresh.field));
    assert_int_equal(cairn_force_field_read(f.field).start_iterations, 3);
    test_pool_free(&f.pool);
    test_pool_free(&fresh.pool);
}

static void test_readers(void **state)
{
    cairn_force_field_params p = small_params();
    struct fixture f = field_with(&p);
    const cairn_corner *corners;
    const cairn_scan_set *set = cairn_force_field_scans(f.field);
    cairn_force_field_state s;
    cairn_vec2 force;
    cairn_real mass;
    int32_t count, points;

    (void)state;
    add_scene(f.field);
    assert_int_equal(set->scan_count, SCENE);
    points = set->scans[0].end_point - set->scans[0].first_point;
    iterate(f.field);
    s = cairn_force_field_read(f.field);
    corners = cairn_force_field_corners(f.field, &count);
    assert_int_equal(count, s.corners);
    assert_true(count > 10);
    for (int32_t i = 0; i < count; i++) {
        assert_true(corners[i].segment[0] >= 0 && corners[i].segment[0] < set->segment_count);
        assert_near(corners[i].opening, 90 * DEGREE, 10.001 * DEGREE);
    }
    assert_ok(cairn_force_field_point_force(f.field, 0, points - 1, &force, &mass));
    assert_status(cairn_force_field_point_force(f.field, 0, points, &force, &mass),
                  CAIRN_BAD_ARGUMENT);
    assert_status(cairn_force_field_point_force(f.field, 0, -1, &force, &mass), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_force_field_point_force(f.field, -1, 0, &force, &mass), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_force_field_point_force(f.field, SCENE, 0, &force, &mass),
                  CAIRN_BAD_ARGUMENT);
    assert_status(cairn_force_field_point_force(f.field, 0, 0, NULL, &mass), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_force_field_point_force(f.field, 0, 0, &force, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_force_field_point_force(NULL, 0, 0, &force, &mass), CAIRN_BAD_ARGUMENT);
    test_pool_free(&f.pool);

    /* More corners than the capacity. */
    p.max_corners = 5;
    f = field_with(&p);
    add_scene(f.field);
    iterate(f.field);
    assert_int_equal(cairn_force_field_read(f.field).corners, 5);
    assert_int_equal(cairn_force_field_read(f.field).corners_dropped, s.corners - 5);
    test_pool_free(&f.pool);

    p.roi = 0;
    f = field_with(&p);
    add_scene(f.field);
    iterate(f.field);
    (void)cairn_force_field_corners(f.field, &count);
    assert_int_equal(count, 0);
    assert_int_equal(cairn_force_field_read(f.field).corners, 0);
    test_pool_free(&f.pool);
}

/* Masses of points multiply the force, and the mass of a region the mass. */
static void test_masses(void **state)
{
    cairn_force_field_params p = small_params();
    struct fixture one = field_with(&p), three = field_with(&p);
    struct scan scan;
    cairn_real masses[MAX_SCAN_POINTS];
    cairn_vec2 force_one, force_three;
    cairn_real mass;
    int in_region = 0;

    (void)state;
    scan_corner(&scan, 1, 1, 0.1);
    for (int i = 0; i < MAX_SCAN_POINTS; i++)
        masses[i] = 3;
    for (int i = 0; i < 2; i++) {
        add(one.field, &scan, pose(0.03 * i, 0.02 * i, 2 * i));
        assert_ok(cairn_force_field_add_scan(three.field, &scan.view, masses,
                                             pose(0.03 * i, 0.02 * i, 2 * i), NULL));
    }
    iterate(one.field);
    iterate(three.field);
    for (int32_t i = 0; i < scan.view.point_count; i++) {
        assert_ok(cairn_force_field_point_force(one.field, 0, i, &force_one, &mass));
        assert_true(mass == 1 || mass == 4);
        in_region += mass == 4;
        assert_ok(cairn_force_field_point_force(three.field, 0, i, &force_three, &mass));
        assert_true(mass == 3 || mass == 12);
        assert_near(force_three.x, 9 * force_one.x, NUMBER(1e-10, 1e-3));
        assert_near(force_three.y, 9 * force_one.y, NUMBER(1e-10, 1e-3));
    }
    /* Of each wall the end at the corner, and no other point. */
    assert_int_equal(in_region, 2);
    test_pool_free(&one.pool);
    test_pool_free(&three.pool);
}

static void assert_all_finite(const cairn_force_field *field)
{
    cairn_force_field_state s = cairn_force_field_read(field);

    assert_true(cairn_is_finite(s.potential) && cairn_is_finite(s.mean_relocation));
    for (int32_t i = 0; i < cairn_force_field_pose_count(field); i++) {
        cairn_force_field_motion m = cairn_force_field_motion_of(field, i);

        assert_true(cairn_pose_is_finite(cairn_force_field_pose(field, i)));
        assert_true(cairn_is_finite(m.force.x) && cairn_is_finite(m.force.y) &&
                    cairn_is_finite(m.torque));
        assert_true(cairn_is_finite(m.centre.x) && cairn_is_finite(m.centre.y) &&
                    cairn_is_finite(m.relocation));
    }
}

static void test_degenerate_scans(void **state)
{
    cairn_force_field_params p = small_params();
    struct fixture f = field_with(&p);
    struct scan corner, one, empty, bare, far;

    (void)state;
    scan_corner(&corner, 1, 1, 0.1);
    /* Identical scans: all forces cancel, also between coincident points. */
    add(f.field, &corner, pose(0.3, 0.2, 30));
    add(f.field, &corner, pose(0.3, 0.2, 30));
    run(f.field);
    assert_all_finite(f.field);
    assert_same_pose(cairn_force_field_pose(f.field, 0), cairn_force_field_pose(f.field, 1));
    assert_near(cairn_force_field_pose(f.field, 0).x, 0.3, 1e-6);
    assert_near(cairn_force_field_pose(f.field, 0).theta, 30 * DEGREE, 1e-6);

    /* A single point on a segment moves but does not turn; one whose direction is zero has no
     * force; an empty scan, and one of a segment without points, stay. */
    cairn_force_field_clear(f.field);
    scan_begin(&one);
    one.segments[0].a.x = one.segments[0].b.x = 1;
    one.points[0].position.x = 1;
    one.points[0].direction.y = 1;
    one.first_point[1] = 1;
    one.view.sensor.x = 1;
    one.view.segment_count = one.view.point_count = 1;
    scan_begin(&empty);
    bare = one;
    bare.view.segments = bare.segments;
    bare.view.first_point = bare.first_point;
    bare.view.points = bare.points;
    bare.first_point[1] = 0;
    bare.view.point_count = 0;
    scan_begin(&far);
    scan_wall(&far, 0, -0.5, 0, 0.5, 0.1);
    add(f.field, &corner, pose(0, 0, 0));
    add(f.field, &one, pose(-0.95, -0.52, 0));
    add(f.field, &empty, pose(0.1, 0.1, 10));
    add(f.field, &bare, pose(-0.95, -0.52, 0));
    add(f.field, &far, pose(999999, -999999, 190));
    one.points[0].direction.y = 0;
    add(f.field, &one, pose(-0.95, -0.52, 0));
    assert_near(cairn_force_field_pose(f.field, 4).theta, -170 * DEGREE, 1e-6);
    iterate(f.field);
    assert_all_finite(f.field);
    assert_true(cairn_force_field_motion_of(f.field, 1).force.x < 0);
    assert_true(cairn_force_field_motion_of(f.field, 5).force.x == 0);
    run(f.field);
    assert_all_finite(f.field);
    assert_near(cairn_force_field_pose(f.field, 1).x, -1, 0.02);
    assert_near(cairn_force_field_pose(f.field, 1).theta, 0, 0);
    assert_same_pose(cairn_force_field_pose(f.field, 2), pose(0.1, 0.1, 10));
    assert_same_pose(cairn_force_field_pose(f.field, 3), pose(-0.95, -0.52, 0));
    assert_same_pose(cairn_force_field_pose(f.field, 5), pose(-0.95, -0.52, 0));
    test_pool_free(&f.pool);

    /* A single scan is at its goal; its pose is unchanged up to rounding. */
    f = field_with(&p);
    add(f.field, &corner, pose(1, 2, 3));
    run(f.field);
    assert_int_equal(cairn_force_field_read(f.field).iterations, 1);
    assert_int_equal(cairn_force_field_read(f.field).verdict, CAIRN_FORCE_FIELD_CONVERGED);
    assert_near(cairn_force_field_pose(f.field, 0).x, 1, 1e-6);
    test_pool_free(&f.pool);
}

static void test_bad_scans_are_refused(void **state)
{
    const cairn_real nan = (cairn_real)NAN;
    cairn_force_field_params p = small_params();
    struct fixture f;
    struct scan scan;
    cairn_fault fault;
    cairn_pose bad;
    uint32_t revision;

    (void)state;
    p.max_scans = 2;
    f = field_with(&p);
    scan_corner(&scan, 1, 1, 0.1);
    revision = cairn_force_field_revision(f.field);
#define REFUSED(change, status)                                                                    \
    bad = pose(0, 0, 0);                                                                           \
    change;                                                                                        \
    fault.message = NULL;                                                                          \
    assert_status(cairn_force_field_add_scan(f.field, &scan.view, NULL, bad, &fault), status);     \
    assert_non_null(fault.message);                                                                \
    assert_status(cairn_force_field_add_scan(f.field, &scan.view, NULL, bad, NULL), status)
    REFUSED(bad.x = nan, CAIRN_NOT_FINITE);
    REFUSED(bad.theta = (cairn_real)INFINITY, CAIRN_NOT_FINITE);
    REFUSED(bad.x = CAIRN_REAL(1.1e6), CAIRN_BAD_ARGUMENT);
    REFUSED(bad.y = CAIRN_REAL(-1.1e6), CAIRN_BAD_ARGUMENT);
    assert_int_equal(fault.index, -1);
    REFUSED(scan.points[3].position.y = nan, CAIRN_NOT_FINITE);
    assert_int_equal(fault.index, 3);
    scan_corner(&scan, 1, 1, 0.1);
    assert_fault(&fault, cairn_force_field_add_scan(NULL, &scan.view, NULL, bad, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    assert_fault(&fault, cairn_force_field_add_scan(f.field, NULL, NULL, bad, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    assert_int_equal(cairn_force_field_pose_count(f.field), 0);
    assert_int_equal(cairn_force_field_revision(f.field), revision);
    add(f.field, &scan, pose(0, 0, 0));
    assert_int_equal(cairn_force_field_revision(f.field), revision + 1);
    add(f.field, &scan, pose(0, 0, 0));
    REFUSED((void)0, CAIRN_FULL);
#undef REFUSED
    assert_int_equal(cairn_force_field_pose_count(f.field), 2);
    test_pool_free(&f.pool);
}

/* ---- Points generated on demand ---- */

/* A wall with points at the places of the scan module, some left out. */
static void scan_places(struct scan *scan, double ax, double ay, double bx, double by,
                        double spacing)
{
    cairn_scan_view *view = &scan->view;
    cairn_segment *wall = &scan->segments[view->segment_count];
    cairn_vec2 along, direction;
    cairn_real length, margin;
    int32_t places;

    wall->a.x = (cairn_real)ax;
    wall->a.y = (cairn_real)ay;
    wall->b.x = (cairn_real)bx;
    wall->b.y = (cairn_real)by;
    along = cairn_vec2_sub(wall->b, wall->a);
    direction = cairn_vec2_unit(along);
    length = cairn_vec2_norm(along);
    places = (int32_t)(length / (cairn_real)spacing) + 1;
    margin = (length - (cairn_real)(places - 1) * (cairn_real)spacing) / 2;
    for (int32_t i = 0; i < places; i++)
        if (i % 7 != 4) {
            cairn_oriented_point *p = &scan->points[view->point_count++];
            cairn_real at = margin + (cairn_real)i * (cairn_real)spacing;

            p->position = cairn_vec2_add(wall->a, cairn_vec2_scale(direction, at));
            p->direction = direction;
        }
    scan->first_point[++view->segment_count] = view->point_count;
}

/* Scan i of a room with long walls, of more than a tile each, as a sensor near (0, 0) sees it. */
static void sense_room(struct scan *scan, int i)
{
    double far = 2 + 0.1 * (i % 5);

    scan_begin(scan);
    scan_places(scan, 2, -far, 2, 1.5, 0.05);
    scan_places(scan, 2, 1.5, 0.5 - far / 2, 1.5 + 0.01 * (i % 3), 0.05);
    if (i % 2)
        scan_places(scan, 0.6, 1.0, 0.6, 0.55, 0.05);
    scan->view.sensor.y = CAIRN_REAL(0.1);
}

static cairn_pose room_pose(int i)
{
    return pose(0.05 * sin(3.0 * i), 0.04 * cos(5.0 * i), 3 * sin(7.0 * i));
}

static cairn_force_field_params room_params(void)
{
    cairn_force_field_params params = small_params();

    params.max_points = 2048;
    params.stop_relocation = 0;
    return params;
}

/* All readable state of two fields, to the bit. */
static void assert_same_fields(const cairn_force_field *a, const cairn_force_field *b)
{
    cairn_force_field_state s = cairn_force_field_read(a), t = cairn_force_field_read(b);

    assert_int_equal(cairn_force_field_pose_count(a), cairn_force_field_pose_count(b));
    for (int32_t i = 0; i < cairn_force_field_pose_count(a); i++) {
        cairn_force_field_motion m = cairn_force_field_motion_of(a, i),
                                 n = cairn_force_field_motion_of(b, i);

        assert_same_pose(cairn_force_field_pose(a, i), cairn_force_field_pose(b, i));
        assert_true(m.force.x == n.force.x && m.force.y == n.force.y && m.torque == n.torque);
        assert_true(m.centre.x == n.centre.x && m.centre.y == n.centre.y &&
                    m.relocation == n.relocation);
    }
    assert_true(s.potential == t.potential && s.mean_relocation == t.mean_relocation);
    assert_int_equal(s.pairs, t.pairs);
    assert_int_equal(s.segment_pairs, t.segment_pairs);
    assert_int_equal(s.corners, t.corners);
}

static void test_points_on_the_fly(void **state)
{
    cairn_force_field_params p = room_params();
    static _Alignas(
        CAIRN_ALIGN) unsigned char memory[CAIRN_FORCE_FIELD_PLACES_BYTES(16, 2048, 128, 256)];

    (void)state;
    for (int roi = 0; roi < 2; roi++) {
        struct fixture kept, made;
        struct scan scan;
        cairn_pool pool;
        cairn_force_field *again;

        p.roi = roi;
        p.spacing = 0;
        kept = field_with(&p);
        p.spacing = CAIRN_REAL(0.05);
        made = field_with(&p);
        assert_true(made.pool.used + (roi ? 48 : 40) * sizeof(cairn_real) / 8 * 2048 <
                    kept.pool.used + 2048);
        assert_ok(cairn_pool_init(&pool, memory, sizeof memory));
        assert_ok(cairn_force_field_create(&again, &pool, &p));
        for (int i = 0; i < 7; i++) {
            sense_room(&scan, i);
            add(kept.field, &scan, room_pose(i));
            add(made.field, &scan, room_pose(i));
        }
        assert_ok(cairn_force_field_fix(kept.field, 3, 1));
        assert_ok(cairn_force_field_fix(made.field, 3, 1));
        for (int k = 0; k < 12; k++) {
            iterate(kept.field);
            iterate(made.field);
            assert_same_fields(kept.field, made.field);
        }
        for (int32_t i = 0; i < scan.view.point_count; i++) {
            cairn_vec2 force, other;
            cairn_real mass, other_mass;

            assert_ok(cairn_force_field_point_force(kept.field, 6, i, &force, &mass));
            assert_ok(cairn_force_field_point_force(made.field, 6, i, &other, &other_mass));
            assert_true(force.x == other.x && force.y == other.y && mass == other_mass);
        }
        assert_true(cairn_force_field_read(kept.field).pairs > 10000);
        test_pool_free(&kept.pool);
        test_pool_free(&made.pool);
    }
    p.spacing = -1;
    assert_int_equal(cairn_force_field_memory(&p), 0);
}

/* Tiles of long lines compared with all pairs. */
static void test_long_lines(void **state)
{
    cairn_force_field_params p = room_params();
    struct fixture f = field_with(&p);
    static struct slow_field slow;
    static struct scan scans[5];
    cairn_pose poses[5];
    cairn_vec2 sum = {0, 0};

    (void)state;
    for (int i = 0; i < 5; i++) {
        sense_room(&scans[i], i);
        poses[i] = room_pose(i);
        add(f.field, &scans[i], poses[i]);
    }
    slow_start(&slow, &p, scans, poses, 5);
    iterate(f.field);
    slow_iterate(&slow, (double)p.sigma_start, (double)p.dt_start, 0);
#ifndef CAIRN_FLOAT
    assert_int_equal(cairn_force_field_read(f.field).pairs, slow.pairs);
#endif
    assert_near(cairn_force_field_potential(f.field), slow.potential, NUMBER(1e-8, 0.2));
    for (int i = 0; i < 5; i++) {
        cairn_force_field_motion m = cairn_force_field_motion_of(f.field, i);

        assert_near(m.force.x, slow.force[i][0], NUMBER(1e-8, 0.5));
        assert_near(m.force.y, slow.force[i][1], NUMBER(1e-8, 0.5));
        assert_near(m.torque, slow.torque[i], NUMBER(1e-8, 0.5));
        assert_near(cairn_force_field_pose(f.field, i).theta, slow.pose[i][2], NUMBER(1e-11, 1e-5));
    }
    for (int32_t i = 0; i < scans[4].view.point_count; i++) {
        cairn_vec2 force;
        cairn_real mass;

        assert_ok(cairn_force_field_point_force(f.field, 4, i, &force, &mass));
        sum = cairn_vec2_add(sum, force);
    }
    assert_near(sum.x, slow.force[4][0], NUMBER(1e-8, 0.5));
    assert_near(sum.y, slow.force[4][1], NUMBER(1e-8, 0.5));
    test_pool_free(&f.pool);
}

/* ---- Scans at rest ---- */

/* Scattered scans, some of them neighbours. */
static void make_scattered_scans(cairn_random *random, struct scan *scan, cairn_pose *at)
{
    scan_begin(scan);
    scan_wall(scan, 0, 0, 0.5 + (double)cairn_random_uniform(random, 0, 1), 0, 0.1);
    scan_wall(scan, 0, 0, 0, 0.4, 0.1);
    *at =
        pose((double)cairn_random_uniform(random, 0, 9), (double)cairn_random_uniform(random, 0, 9),
             (double)cairn_random_uniform(random, -10, 10));
}

/* A field that computes only what has changed, compared with one that computes all in every
 * iteration, as a field with external points does. */
static void test_scans_at_rest_are_not_recomputed(void **state)
{
    cairn_force_field_params p = small_params();
    int64_t least = INT64_MAX, most = 0;

    (void)state;
    p.sigma_step = 0;
    p.sigma_start = CAIRN_REAL(0.08);
    p.stop_relocation = 0;
    p.max_steps = 1000;
    for (uint64_t seed = 0; seed < 6; seed++) {
        cairn_random random = cairn_random_seed(seed, 5);
        struct fixture f, all;

        p.roi = seed % 2 == 0;
        f = field_with(&p);
        all = field_with(&p);
        for (int k = 0; k < 60; k++) {
            int64_t units = cairn_force_field_read(f.field).units;

            if (k % 4 == 0 && k < 60) {
                struct scan scan;
                cairn_pose at;

                make_scattered_scans(&random, &scan, &at);
                add(f.field, &scan, at);
                add(all.field, &scan, at);
            }
            if (k % 3 == 1) {
                int32_t scan = cairn_random_below(&random, cairn_force_field_pose_count(f.field));
                int32_t yes = cairn_random_below(&random, 4) > 0;

                assert_ok(cairn_force_field_fix(f.field, scan, yes));
                assert_ok(cairn_force_field_fix(all.field, scan, yes));
            }
            if (k % 17 == 16) {
                cairn_force_field_restart(f.field);
                cairn_force_field_restart(all.field);
            }
            assert_ok(cairn_force_field_set_extra(all.field, NULL, NULL, 0));
            iterate(f.field);
            iterate(all.field);
            assert_same_fields(f.field, all.field);
            units = cairn_force_field_read(f.field).units - units;
            if (k > 40) {
                least = units < least ? units : least;
                most = units > most ? units : most;
            }
        }
        test_pool_free(&f.pool);
        test_pool_free(&all.pool);
    }
    assert_true(2 * least < most);
}

/* Without motion an iteration costs next to nothing. */
static void test_nothing_moves(void **state)
{
    cairn_force_field_params p = small_params();
    struct fixture f;
    cairn_force_field_state first, s;
    int64_t units;

    (void)state;
    p.sigma_step = 0;
    p.stop_relocation = 0;
    f = field_with(&p);
    add_scene(f.field);
    for (int i = 1; i < SCENE; i++)
        assert_ok(cairn_force_field_fix(f.field, i, 1));
    iterate(f.field);
    assert_ok(cairn_force_field_fix(f.field, 0, 1));
    iterate(f.field);
    iterate(f.field);
    first = cairn_force_field_read(f.field);
    iterate(f.field);
    s = cairn_force_field_read(f.field);
    units = s.units - first.units;
    assert_true(units <= 5 * SCENE);
    assert_int_equal(s.corners, first.corners);
    assert_true(s.potential == first.potential);
    test_pool_free(&f.pool);
}

/* Units of an iteration in which two scans at rest, near each other or not, are far from two corners
 * that approach each other. */
static int64_t units_at_rest(double distance)
{
    cairn_force_field_params p = small_params();
    struct fixture f;
    struct scan corner, wall;
    int64_t units;

    p.sigma_step = 0;
    p.stop_relocation = 0;
    f = field_with(&p);
    scan_corner(&corner, 1, 1, 0.1);
    add(f.field, &corner, pose(0, 0, 0));
    add(f.field, &corner, pose(0.05, 0.03, 2));
    /* Points without a direction attract nothing. */
    scan_begin(&wall);
    scan_wall(&wall, -0.5, 0, 0.5, 0, 0.01);
    for (int32_t i = 0; i < wall.view.point_count; i++)
        wall.points[i].direction.x = 0;
    add(f.field, &wall, pose(50, 0, 0));
    add(f.field, &wall, pose(50 + distance, 0, 0));
    iterate(f.field);
    iterate(f.field);
    units = cairn_force_field_read(f.field).units;
    iterate(f.field);
    units = cairn_force_field_read(f.field).units - units;
    test_pool_free(&f.pool);
    return units;
}

/* Corners that are found anew do not wake the scans at rest. */
static void test_regions_do_not_wake_scans_at_rest(void **state)
{
    (void)state;
    /* Their boxes are compared, their points are not: 101^2 pairs. */
    assert_true(units_at_rest(0) <= units_at_rest(50) + 20);
}

/* ---- Scans added and removed ---- */

static void release(cairn_force_field *field, int32_t scan)
{
    assert_ok(cairn_force_field_remove(field, scan));
    assert_status(cairn_force_field_remove(field, scan), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_force_field_fix(field, scan, 1), CAIRN_BAD_ARGUMENT);
}

/* A field of the scans `at` ... at their poses in another one has the same forces and moves them
 * alike. */
static void assert_like_new(const cairn_force_field *field, const cairn_force_field_params *params,
                            const int *made, const int32_t *index, const cairn_pose *before,
                            const int *fixed, int count)
{
    struct fixture f = field_with(params);

    for (int i = 0; i < count; i++) {
        struct scan scan;

        sense_room(&scan, made[i]);
        add(f.field, &scan, before[i]);
        assert_ok(cairn_force_field_fix(f.field, i, fixed[i]));
    }
    iterate(f.field);
    for (int i = 0; i < count; i++) {
        cairn_force_field_motion m = cairn_force_field_motion_of(f.field, i);
        cairn_force_field_motion n = cairn_force_field_motion_of(field, index[i]);

        assert_same_pose(cairn_force_field_pose(f.field, i),
                         cairn_force_field_pose(field, index[i]));
        assert_true(m.force.x == n.force.x && m.force.y == n.force.y && m.torque == n.torque);
    }
    assert_near(cairn_force_field_potential(field), cairn_force_field_potential(f.field),
                NUMBER(1e-11, 1e-4) * fabs((double)cairn_force_field_potential(f.field)));
    assert_int_equal(cairn_force_field_read(f.field).pairs, cairn_force_field_read(field).pairs);
    assert_int_equal(cairn_force_field_read(f.field).corners,
                     cairn_force_field_read(field).corners);
    test_pool_free(&f.pool);
}

/* An endless run in fixed memory: scans are added, become old and fixed, and are removed. */
static void endless(const cairn_force_field_params *params, int scans, int32_t cut)
{
    enum { WINDOW = 5 };
    struct fixture f = field_with(params);
    int made[WINDOW + 1], fixed[WINDOW + 1], count = 0;
    int32_t index[WINDOW + 1];

    for (int i = 0; i < scans; i++) {
        cairn_budget budget = {cut};
        cairn_pose before[WINDOW];
        struct scan scan;

        if (count == WINDOW) {
            int leaves = i % 4 == 3 ? 2 : 0; /* not always the oldest */

            release(f.field, index[leaves]);
            assert_false(cairn_force_field_has(f.field, index[leaves]) && cut == 0);
            /* The memory is free when the steps have reached the next iteration. */
            (void)!cairn_force_field_step(f.field, &budget);
            for (count = WINDOW - 1; leaves < count; leaves++) {
                made[leaves] = made[leaves + 1];
                index[leaves] = index[leaves + 1];
                fixed[leaves] = fixed[leaves + 1];
            }
            iterate(f.field);
        }
        sense_room(&scan, i);
        index[count] = cairn_force_field_next(f.field);
        assert_in_range(index[count], 0, WINDOW);
        made[count] = i;
        fixed[count] = 0;
        add(f.field, &scan, room_pose(i));
        count++;
        if (count > 2 && !fixed[count - 3]) {
            assert_ok(cairn_force_field_fix(f.field, index[count - 3], 1));
            fixed[count - 3] = 1;
        }
        assert_ok(cairn_force_field_fix(f.field, index[0], 1));
        fixed[0] = 1;
        cairn_force_field_restart(f.field);
        if (cut > 0) /* to a commit point */
            iterate(f.field);
        cairn_force_field_restart(f.field);
        for (int k = 0; k < count; k++) {
            assert_true(cairn_force_field_has(f.field, index[k]));
            before[k] = cairn_force_field_pose(f.field, index[k]);
        }
        iterate(f.field);
        if (i % 50 < 7)
            assert_like_new(f.field, params, made, index, before, fixed, count);
    }
    assert_in_range(cairn_force_field_pose_count(f.field), WINDOW, WINDOW + 1);
    test_pool_free(&f.pool);
}

static void test_an_endless_run(void **state)
{
    cairn_force_field_params p = room_params();

    (void)state;
    p.max_scans = 6;
    p.max_segments = 18;
    p.max_points = 6 * MAX_SCAN_POINTS;
    p.max_corners = 64;
    endless(&p, 1000, 0);
    endless(&p, 300, 333);
    p.spacing = CAIRN_REAL(0.05);
    endless(&p, 1000, 0);
    p.roi = 0;
    endless(&p, 2000, 0);
}

static void test_release(void **state)
{
    cairn_force_field_params p = room_params();
    cairn_budget none = {0}, all = {CAIRN_UNBOUNDED};
    struct fixture f;
    struct scan scan;
    cairn_vec2 force;
    cairn_real mass;
    uint32_t revision;

    (void)state;
    p.max_scans = 3;
    p.max_steps = 2;
    f = field_with(&p);
    assert_int_equal(cairn_force_field_next(f.field), 0);
    for (int i = 0; i < 3; i++) {
        sense_room(&scan, i);
        add(f.field, &scan, room_pose(i));
    }
    assert_int_equal(cairn_force_field_next(f.field), -1);
    assert_status(cairn_force_field_remove(f.field, 3), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_force_field_remove(f.field, -1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_force_field_remove(NULL, 0), CAIRN_BAD_ARGUMENT);

    /* In the middle of an iteration: it takes part until its end. */
    step_into(f.field, 0, 300);
    revision = cairn_force_field_revision(f.field);
    release(f.field, 1);
    assert_true(cairn_force_field_has(f.field, 1));
    assert_int_equal(cairn_force_field_revision(f.field), revision);
    iterate(f.field);
    assert_false(cairn_force_field_has(f.field, 1));
    assert_false(cairn_force_field_has(f.field, 3));
    assert_false(cairn_force_field_has(f.field, -1));
    assert_true(cairn_force_field_motion_of(f.field, 1).force.x != 0);
    assert_int_equal(cairn_force_field_pose_count(f.field), 3);
    assert_status(cairn_force_field_point_force(f.field, 1, 0, &force, &mass), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_force_field_point_force(f.field, 0, 0, &force, &mass));
    assert_int_equal(cairn_force_field_next(f.field), -1);
    assert_status(cairn_force_field_step(f.field, &none), CAIRN_MORE);
    assert_status(cairn_force_field_point_force(f.field, 0, 0, &force, &mass), CAIRN_EMPTY);
    assert_ok(cairn_force_field_step(f.field, &all));
    assert_int_equal(cairn_force_field_read(f.field).iterations, 2);
    assert_int_equal(cairn_force_field_next(f.field), 1);

    /* When the field is at rest, steps also reclaim memory. */
    release(f.field, 0);
    assert_int_equal(cairn_force_field_revision(f.field), revision + 3);
    all.left = CAIRN_UNBOUNDED;
    assert_ok(cairn_force_field_step(f.field, &all));
    assert_int_equal(cairn_force_field_read(f.field).iterations, 2);
    assert_int_equal(cairn_force_field_next(f.field), 0);
    assert_int_equal(cairn_force_field_scans(f.field)->segment_count, scan.view.segment_count);

    /* The last one. */
    release(f.field, 2);
    assert_status(cairn_force_field_step(f.field, &all), CAIRN_EMPTY);
    assert_int_equal(cairn_force_field_scans(f.field)->segment_count, 0);
    add(f.field, &scan, room_pose(1));
    assert_true(cairn_force_field_has(f.field, 2));
    cairn_force_field_restart(f.field);
    run(f.field);
    assert_int_equal(cairn_force_field_read(f.field).iterations, 4);
    assert_int_equal(cairn_force_field_read(f.field).segment_pairs, 0);
    test_pool_free(&f.pool);
}

/* ---- External points ---- */

/* They attract like a fixed scan of the same points. */
static void test_extra_points(void **state)
{
    cairn_force_field_params p = room_params();
    struct scan scans[4];
    cairn_oriented_point extra[MAX_SCAN_POINTS];
    cairn_real weights[MAX_SCAN_POINTS];
    struct fixture f, replica;
    int32_t count;
    size_t without;

    (void)state;
    p.roi = 0;
    replica = field_with(&p);
    without = cairn_force_field_memory(&p);
    p.max_extra = MAX_SCAN_POINTS;
    assert_true(cairn_force_field_memory(&p) > without);
    assert_true(cairn_force_field_memory(&p) <=
                without + CAIRN_FORCE_FIELD_EXTRA_BYTES(MAX_SCAN_POINTS));
    f = field_with(&p);
    for (int i = 0; i < 4; i++) {
        sense_room(&scans[i], i);
        if (i < 3)
            add(f.field, &scans[i], room_pose(i));
    }
    count = scans[3].view.point_count;
    for (int32_t i = 0; i < count; i++) {
        weights[i] = CAIRN_REAL(0.5) + (cairn_real)(i % 3);
        extra[i].position = cairn_pose_point(room_pose(3), scans[3].points[i].position);
        extra[i].direction = cairn_transform_direction(cairn_transform_of(room_pose(3)),
                                                       scans[3].points[i].direction);
        extra[i].direction.x *= 2; /* any length */
        extra[i].direction.y *= 2;
    }
    for (int i = 0; i < 4; i++)
        assert_ok(cairn_force_field_add_scan(replica.field, &scans[i].view, i == 3 ? weights : NULL,
                                             room_pose(i), NULL));
    assert_ok(cairn_force_field_fix(replica.field, 3, 1));
    assert_ok(cairn_force_field_set_extra(f.field, extra, weights, count));
    memset(extra, 0, sizeof extra); /* they have been copied */
    for (int k = 0; k < 5; k++) {
        cairn_force_field_state s, t;

        iterate(f.field);
        iterate(replica.field);
        s = cairn_force_field_read(f.field);
        t = cairn_force_field_read(replica.field);
        assert_near(s.potential, t.potential, NUMBER(1e-10, 1e-4) * fabs((double)t.potential));
        if (k == 0) {
            assert_int_equal(s.pairs, t.pairs);
            assert_int_equal(s.segment_pairs, t.segment_pairs);
        }
        for (int i = 0; i < 3; i++) {
            cairn_force_field_motion m = cairn_force_field_motion_of(f.field, i);
            cairn_force_field_motion n = cairn_force_field_motion_of(replica.field, i);
            cairn_vec2 force, other;
            cairn_real mass;

            assert_near(m.force.x, n.force.x, NUMBER(1e-7, 1));
            assert_near(m.force.y, n.force.y, NUMBER(1e-7, 1));
            assert_near(m.torque, n.torque, NUMBER(1e-7, 1));
            assert_ok(cairn_force_field_point_force(f.field, i, 9, &force, &mass));
            assert_ok(cairn_force_field_point_force(replica.field, i, 9, &other, &mass));
            assert_near(force.x, other.x, NUMBER(1e-8, 0.1));
            assert_near(force.y, other.y, NUMBER(1e-8, 0.1));
        }
    }
    /* Replaced in the middle of an iteration: effective from the next one on. */
    {
        cairn_force_field_motion with, without_them;

        step_into(f.field, 5, 500);
        assert_ok(cairn_force_field_set_extra(f.field, NULL, NULL, 0));
        iterate(f.field);
        iterate(replica.field);
        with = cairn_force_field_motion_of(f.field, 0);
        assert_near(with.force.x, cairn_force_field_motion_of(replica.field, 0).force.x,
                    NUMBER(1e-7, 1));
        release(replica.field, 3);
        iterate(f.field);
        iterate(replica.field);
        without_them = cairn_force_field_motion_of(f.field, 0);
        assert_near(without_them.force.x, cairn_force_field_motion_of(replica.field, 0).force.x,
                    NUMBER(1e-7, 1));
        assert_true(fabs((double)(without_them.force.x - with.force.x)) > 0.1);
    }
    test_pool_free(&f.pool);
    test_pool_free(&replica.pool);
}

static void test_extra_refusals(void **state)
{
    const cairn_real nan = (cairn_real)NAN;
    cairn_force_field_params p = small_params();
    cairn_oriented_point point = {{1, 2}, {0, 1}}, bad;
    cairn_real weight = 1, bad_weight;
    struct fixture f;

    (void)state;
    p.max_extra = -1;
    assert_int_equal(cairn_force_field_memory(&p), 0);
    p.max_extra = (1 << 24) + 1;
    assert_int_equal(cairn_force_field_memory(&p), 0);
    p.max_scans = p.max_segments = p.max_points = p.max_corners = 2;
    p.max_extra = 3;
    test_every_pool_size(create_with, &p, cairn_force_field_memory(&p));
    p.max_extra = 1;
    f = field_with(&p);
#define REFUSED(change, status)                                                                    \
    bad = point;                                                                                   \
    bad_weight = weight;                                                                           \
    change;                                                                                        \
    assert_status(cairn_force_field_set_extra(f.field, &bad, &bad_weight, 1), status)
    REFUSED(bad.position.x = nan, CAIRN_NOT_FINITE);
    REFUSED(bad.position.y = (cairn_real)INFINITY, CAIRN_NOT_FINITE);
    REFUSED(bad.direction.x = nan, CAIRN_NOT_FINITE);
    REFUSED(bad.direction.y = nan, CAIRN_NOT_FINITE);
    REFUSED(bad_weight = nan, CAIRN_NOT_FINITE);
    REFUSED(bad_weight = CAIRN_REAL(-0.1), CAIRN_BAD_ARGUMENT);
    REFUSED(bad_weight = CAIRN_REAL(1.1e6), CAIRN_BAD_ARGUMENT);
    REFUSED(bad.position.x = CAIRN_REAL(1.1e6), CAIRN_BAD_ARGUMENT);
    REFUSED(bad.position.y = CAIRN_REAL(-1.1e6), CAIRN_BAD_ARGUMENT);
    REFUSED(bad.direction.x = CAIRN_REAL(1.1e6), CAIRN_BAD_ARGUMENT);
    REFUSED(bad.direction.y = CAIRN_REAL(1.1e6), CAIRN_BAD_ARGUMENT);
    REFUSED((void)0, CAIRN_OK);
#undef REFUSED
    assert_status(cairn_force_field_set_extra(f.field, &point, &weight, 2), CAIRN_FULL);
    assert_status(cairn_force_field_set_extra(f.field, &point, &weight, -1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_force_field_set_extra(f.field, NULL, &weight, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_force_field_set_extra(f.field, &point, NULL, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_force_field_set_extra(NULL, &point, &weight, 1), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_force_field_set_extra(f.field, NULL, NULL, 0));
    test_pool_free(&f.pool);
}

/* Everything at once, with scans removed and external points: the same bits, and no step exceeds
 * its budget. */
static void test_budgets_with_all_inputs(void **state)
{
    static const int32_t budgets[] = {CAIRN_UNBOUNDED, 1, 7, 50, 1000};
    cairn_force_field_params p = room_params();
    uint64_t expected[4] = {0};
    int64_t units = 0;

    (void)state;
    p.max_extra = 4;
    p.max_steps = 3;
    for (int b = 0; b < 5; b++) {
        struct fixture f;

        p.spacing = b % 2 ? CAIRN_REAL(0.05) : 0;
        f = field_with(&p);
        for (int round = 0; round < 4; round++) {
            static const cairn_oriented_point extra[4] = {{{2, 1}, {0, 1}},
                                                          {{2, CAIRN_REAL(1.2)}, {0, 1}},
                                                          {{1, 1}, {1, 1}},
                                                          {{0, CAIRN_REAL(1.4)}, {1, 0}}};
            static const cairn_real weights[4] = {1, 2, 3, 4};
            cairn_status status = CAIRN_MORE;

            for (int i = 0; i < 3; i++) {
                struct scan scan;

                sense_room(&scan, 3 * round + i);
                add(f.field, &scan, room_pose(3 * round + i));
            }
            if (round > 0)
                release(f.field, 2 * round - 1);
            assert_ok(cairn_force_field_set_extra(f.field, extra, weights, round));
            cairn_force_field_restart(f.field);
            while (status == CAIRN_MORE) {
                cairn_budget budget = {budgets[b]};

                status = cairn_force_field_step(f.field, &budget);
                assert_true(budget.left >= 0);
                assert_true(status != CAIRN_MORE || budget.left == 0);
            }
            assert_ok(status);
            if (b == 0)
                expected[round] = hash_of(f.field);
            assert_true(hash_of(f.field) == expected[round]);
        }
        assert_true(b == 0 || cairn_force_field_read(f.field).max_step_units == budgets[b]);
        if (b == 0)
            units = cairn_force_field_read(f.field).units;
        if (!(p.spacing > 0))
            assert_int_equal(cairn_force_field_read(f.field).units, units);
        test_pool_free(&f.pool);
    }
}

/* The bits of the poses after 20 iterations: the same with every compiler and optimization
 * level. */
static void test_golden_poses(void **state)
{
    cairn_force_field_params p = small_params();
    struct fixture f = field_with(&p);
    uint64_t hash;

    (void)state;
    add_scene(f.field);
    for (int k = 0; k < 20; k++)
        iterate(f.field);
    hash = hash_of(f.field);
    if (hash != NUMBER(UINT64_C(0x394269b660d8af9c), UINT64_C(0x4d272e61a58c6d0a)))
        print_error("hash is 0x%016llx\n", (unsigned long long)hash);
    assert_true(hash == NUMBER(UINT64_C(0x394269b660d8af9c), UINT64_C(0x4d272e61a58c6d0a)));
    test_pool_free(&f.pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_params_are_refused),
        cmocka_unit_test(test_the_defaults_are_the_thesis),
        cmocka_unit_test(test_as_written_is_the_thesis),
        cmocka_unit_test(test_memory_is_exact),
        cmocka_unit_test(test_all_pairs),
        cmocka_unit_test(test_force_is_minus_the_gradient),
        cmocka_unit_test(test_two_corners_come_together),
        cmocka_unit_test(test_three_corners_come_together),
        cmocka_unit_test(test_the_potential_falls),
        cmocka_unit_test(test_fixed_scans_stay),
        cmocka_unit_test(test_placed_scans_are_there),
        cmocka_unit_test(test_budgets_are_equal),
        cmocka_unit_test(test_inputs_wait_for_the_commit),
        cmocka_unit_test(test_stop_and_restart),
        cmocka_unit_test(test_clear),
        cmocka_unit_test(test_readers),
        cmocka_unit_test(test_masses),
        cmocka_unit_test(test_degenerate_scans),
        cmocka_unit_test(test_bad_scans_are_refused),
        cmocka_unit_test(test_points_on_the_fly),
        cmocka_unit_test(test_long_lines),
        cmocka_unit_test(test_scans_at_rest_are_not_recomputed),
        cmocka_unit_test(test_nothing_moves),
        cmocka_unit_test(test_regions_do_not_wake_scans_at_rest),
        cmocka_unit_test(test_an_endless_run),
        cmocka_unit_test(test_release),
        cmocka_unit_test(test_extra_points),
        cmocka_unit_test(test_extra_refusals),
        cmocka_unit_test(test_budgets_with_all_inputs),
        cmocka_unit_test(test_golden_poses),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
