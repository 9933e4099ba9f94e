/* Shared by the tests of force fields: scans made by hand, a field with its own pool, and a small
 * scene. */
#ifndef CAIRN_TESTS_FIELD_SCENE_H
#define CAIRN_TESTS_FIELD_SCENE_H

#include "tests/test.h"

#include <math.h>

#include "cairn/force_field.h"

#define DEGREE (3.14159265358979323846 / 180)

enum { MAX_SCAN_SEGMENTS = 16, MAX_SCAN_POINTS = 256 };

/* A scan as a caller stores it. */
struct scan {
    cairn_segment segments[MAX_SCAN_SEGMENTS];
    int32_t first_point[MAX_SCAN_SEGMENTS + 1];
    cairn_oriented_point points[MAX_SCAN_POINTS];
    cairn_scan_view view;
};

static inline void scan_begin(struct scan *scan)
{
    memset(scan, 0, sizeof *scan);
    scan->view.segments = scan->segments;
    scan->view.first_point = scan->first_point;
    scan->view.points = scan->points;
}

/* A wall from a to b with points at most `spacing` apart. */
static inline void scan_wall(struct scan *scan, double ax, double ay, double bx, double by,
                             double spacing)
{
    cairn_scan_view *view = &scan->view;
    /* rounded alike by every libm */
    double length = sqrt((bx - ax) * (bx - ax) + (by - ay) * (by - ay));
    int steps = (int)ceil(length / spacing - 1e-6);

    scan->segments[view->segment_count].a.x = (cairn_real)ax;
    scan->segments[view->segment_count].a.y = (cairn_real)ay;
    scan->segments[view->segment_count].b.x = (cairn_real)bx;
    scan->segments[view->segment_count].b.y = (cairn_real)by;
    for (int i = 0; i <= steps; i++) {
        cairn_oriented_point *p = &scan->points[view->point_count++];

        p->position.x = (cairn_real)(ax + (bx - ax) * i / steps);
        p->position.y = (cairn_real)(ay + (by - ay) * i / steps);
        p->direction.x = (cairn_real)((bx - ax) / length);
        p->direction.y = (cairn_real)((by - ay) / length);
    }
    scan->first_point[++view->segment_count] = view->point_count;
}

/* The corner of a room as a sensor at (-1, -1) sees it: the wall on the right, then the upper
 * one. */
static inline void scan_corner(struct scan *scan, double right, double upper, double spacing)
{
    scan_begin(scan);
    scan_wall(scan, 0, -right, 0, 0, spacing);
    scan_wall(scan, 0, 0, -upper, 0, spacing);
    scan->view.sensor.x = -1;
    scan->view.sensor.y = -1;
}

static inline cairn_pose pose(double x, double y, double degrees)
{
    cairn_pose p = {(cairn_real)x, (cairn_real)y, (cairn_real)(degrees * DEGREE)};
    return p;
}

/* A field of its own pool. */
struct fixture {
    cairn_pool pool;
    cairn_force_field *field;
};

static inline struct fixture field_with(const cairn_force_field_params *params)
{
    struct fixture f;

    f.pool = test_pool(cairn_force_field_memory(params));
    assert_ok(cairn_force_field_create(&f.field, &f.pool, params));
    return f;
}

static inline void add(cairn_force_field *field, const struct scan *scan, cairn_pose map_scan)
{
    assert_ok(cairn_force_field_add_scan(field, &scan->view, NULL, map_scan, NULL));
}

static inline void iterate(cairn_force_field *field)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(cairn_force_field_iterate(field, &budget));
}

static inline void run(cairn_force_field *field)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(cairn_force_field_step(field, &budget));
}

static inline cairn_force_field_params small_params(void)
{
    cairn_force_field_params params = cairn_force_field_default();

    params.max_scans = 16;
    params.max_segments = 128;
    params.max_points = 1024;
    params.max_corners = 256;
    return params;
}

/* Walls of rooms as several sensors see them, some walls in more than one scan; seven scans. */
enum { SCENE = 7 };

static inline void make_scene(struct scan scans[SCENE], cairn_pose poses[SCENE])
{
    static const double shift[SCENE][3] = {{0, 0, 0},       {0.06, -0.03, 2},  {-0.05, 0.04, -3},
                                           {0.02, 0.07, 4}, {-0.04, -0.05, 1}, {0.08, 0.01, -2},
                                           {0.03, -0.02, 3}};

    for (int i = 0; i < SCENE; i++) {
        double far = 1 + 0.13 * i;

        scan_begin(&scans[i]);
        scan_wall(&scans[i], 2, -far, 2, 1.5, 0.1 + 0.004 * i);
        scan_wall(&scans[i], 2, 1.5, 0.5 - far / 2, 1.5, 0.11);
        if (i % 2)
            scan_wall(&scans[i], 0.6, 1.0, 0.6, 0.55 + 0.02 * i, 0.07);
        if (i % 3 == 0)
            scan_wall(&scans[i], 0.3, -1.2, 1.4, -1.1 - 0.02 * i, 0.1);
        scans[i].view.sensor.x = (cairn_real)(0.1 * i);
        scans[i].view.sensor.y = (cairn_real)(-0.2 + 0.05 * i);
        poses[i] = pose(shift[i][0], shift[i][1], shift[i][2]);
    }
    /* Unevenly spaced points, some with a direction against their order. */
    for (int k = 0; k < scans[2].view.point_count; k++)
        scans[2].points[k].position.x += (cairn_real)(0.012 * (k % 3));
    for (int k = 0; k < scans[5].first_point[1]; k++)
        scans[5].points[k].direction.y = -scans[5].points[k].direction.y;
}

static inline void add_scene(cairn_force_field *field)
{
    struct scan scans[SCENE];
    cairn_pose poses[SCENE];

    make_scene(scans, poses);
    for (int i = 0; i < SCENE; i++)
        add(field, &scans[i], poses[i]);
}

#endif
