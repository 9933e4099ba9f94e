#include "bench/bench_corners.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"
#include "cairn/force_field.h"
#include "cairn/icp.h"
#include "cairn/report.h"
#include "src/host/base/degrees.h"

enum { CORNERS = 3, FIELD_STEPS = 12, NEAREST_STEPS = 100, MAX_POINTS = 512 };

typedef struct corner {
    cairn_segment segments[2];
    int32_t first_point[CORNERS];
    cairn_oriented_point points[MAX_POINTS];
    cairn_scan_view view;
    cairn_segment pieces[MAX_POINTS]; /* of the walls from point to point, for the picture */
    int32_t piece_count;
} corner;

static cairn_pose pose_of(double x, double y, double degrees)
{
    cairn_pose pose = {(cairn_real)x, (cairn_real)y, (cairn_real)(degrees * CAIRN_DEGREE)};

    return pose;
}

/* ---- The scans ---- */

static void add_wall(corner *c, double ax, double ay, double bx, double by, double spacing)
{
    cairn_segment *segment = &c->segments[c->view.segment_count];
    double length = hypot(bx - ax, by - ay);
    int32_t steps = (int32_t)ceil(length / spacing - 1e-6);

    segment->a.x = (cairn_real)ax;
    segment->a.y = (cairn_real)ay;
    segment->b.x = (cairn_real)bx;
    segment->b.y = (cairn_real)by;
    for (int32_t i = 0; i <= steps; i++) {
        cairn_oriented_point *p = &c->points[c->view.point_count++];

        p->position.x = (cairn_real)(ax + (bx - ax) * i / steps);
        p->position.y = (cairn_real)(ay + (by - ay) * i / steps);
        p->direction.x = (cairn_real)((bx - ax) / length);
        p->direction.y = (cairn_real)((by - ay) / length);
        if (i > 0) {
            cairn_segment *piece = &c->pieces[c->piece_count++];

            piece->a = p[-1].position;
            piece->b = p->position;
        }
    }
    c->first_point[++c->view.segment_count] = c->view.point_count;
}

/* Points of the corner at the origin, observed by a sensor at (-1, -1) up to these lengths of its
 * walls. */
static void make_corner(corner *c, double right, double upper, double spacing)
{
    memset(c, 0, sizeof *c);
    c->view.segments = c->segments;
    c->view.first_point = c->first_point;
    c->view.points = c->points;
    c->view.sensor.x = c->view.sensor.y = -1;
    add_wall(c, 0, -right, 0, 0, spacing);
    add_wall(c, 0, 0, -upper, 0, spacing);
}

static void make_scene(corner corners[CORNERS], cairn_pose start[CORNERS], double spacing)
{
    make_corner(&corners[0], 1.5, 1.2, spacing);
    make_corner(&corners[1], 1, 1.4, spacing);
    make_corner(&corners[2], 1.3, 0.8, spacing);
    start[0] = pose_of(0, 0, 0);
    start[1] = pose_of(0.15, -0.1, 6);
    start[2] = pose_of(-0.1, 0.12, -5);
}

/* ---- The methods ---- */

static cairn_status open_pool(cairn_pool *pool, size_t bytes, void **memory)
{
    *memory = malloc(bytes + CAIRN_ALIGN);
    return *memory == NULL ? CAIRN_NO_MEMORY : cairn_pool_init(pool, *memory, bytes + CAIRN_ALIGN);
}

static cairn_status run_field(const char *preset, double spacing, const corner corners[CORNERS],
                              cairn_pose poses[CORNERS])
{
    cairn_force_field_params params =
        strcmp(preset, "springs") == 0  ? cairn_force_field_springs(CAIRN_REAL(0.4), FIELD_STEPS)
        : strcmp(preset, "spaced") == 0 ? cairn_force_field_spaced((cairn_real)spacing)
                                        : cairn_force_field_as_written();
    cairn_force_field *field = NULL;
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_pool pool;
    void *memory;
    cairn_status status;

    params.max_steps = FIELD_STEPS;
    status = open_pool(&pool, cairn_force_field_memory(&params), &memory);
    if (status == CAIRN_OK)
        status = cairn_force_field_create(&field, &pool, &params);
    for (int i = 0; i < CORNERS && status == CAIRN_OK; i++)
        status = cairn_force_field_add_scan(field, &corners[i].view, NULL, poses[i], NULL);
    if (status == CAIRN_OK)
        status = cairn_force_field_step(field, &budget);
    for (int i = 0; i < CORNERS && status == CAIRN_OK; i++)
        poses[i] = cairn_force_field_pose(field, i);
    free(memory);
    return status;
}

/* One step of all scans at once, each to the nearest points of the others. */
static cairn_status nearest_step(cairn_icp *icp, const corner corners[CORNERS],
                                 cairn_pose poses[CORNERS])
{
    cairn_pose next[CORNERS];
    cairn_status status = CAIRN_OK;

    for (int i = 0; i < CORNERS; i++) {
        const cairn_scan_view *view = &corners[i].view;
        cairn_budget budget = {CAIRN_UNBOUNDED};

        cairn_icp_clear_target(icp);
        for (int j = 0; j < CORNERS && status == CAIRN_OK; j++)
            if (j != i)
                status = cairn_icp_add_target(icp, corners[j].points, corners[j].view.point_count,
                                              poses[j], NULL);
        if (status == CAIRN_OK)
            status = cairn_icp_begin(icp, view->points, view->point_count, poses[i], NULL, NULL);
        if (status == CAIRN_OK)
            status = cairn_icp_step(icp, &budget);
        if (status != CAIRN_OK)
            return status;
        next[i] = cairn_icp_read(icp).target_query;
    }
    memcpy(poses, next, sizeof next);
    return CAIRN_OK;
}

/* Nearest points without a distance gate and without directions. */
static cairn_status run_nearest(const corner corners[CORNERS], cairn_pose poses[CORNERS])
{
    cairn_icp_params params = cairn_icp_default();
    cairn_icp *icp = NULL;
    cairn_pool pool;
    void *memory;
    cairn_status status;

    params.mode = CAIRN_ICP_POINT_TO_POINT;
    params.max_target = CORNERS * MAX_POINTS;
    params.max_iterations = 1;
    params.gate_start = params.gate_end = 5;
    params.cell_size = 1;
    params.direction_gate = CAIRN_PI;
    status = open_pool(&pool, cairn_icp_memory(&params), &memory);
    if (status == CAIRN_OK)
        status = cairn_icp_create(&icp, &pool, &params);
    for (int step = 0; step < NEAREST_STEPS && status == CAIRN_OK; step++)
        status = nearest_step(icp, corners, poses);
    free(memory);
    return status;
}

/* ---- Output ---- */

/* Greatest difference between two scans' poses. */
static void differ(const cairn_pose poses[CORNERS], double *metres, double *degrees)
{
    *metres = *degrees = 0;
    for (int i = 0; i < CORNERS; i++) {
        cairn_pose p = cairn_pose_between(poses[i], poses[(i + 1) % CORNERS]);

        *metres = fmax(*metres, hypot((double)p.x, (double)p.y));
        *degrees = fmax(*degrees, fabs((double)p.theta) / CAIRN_DEGREE);
    }
}

/* other: another method's poses, whose differences are printed, too; NULL: none. */
static void print(const char *method, double spacing, int32_t steps,
                  const cairn_pose poses[CORNERS], const cairn_pose *other)
{
    double metres, degrees;

    differ(poses, &metres, &degrees);
    bench_json_begin("field");
    bench_json_text("scene", "corners");
    bench_json_text("preset", method);
    bench_json_number("spacing", spacing);
    bench_json_integer("steps", steps);
    bench_json_number("apart_m", metres);
    bench_json_number("apart_deg", degrees);
    if (other != NULL) {
        differ(other, &metres, &degrees);
        bench_json_number("nearest_m", metres);
        bench_json_number("nearest_deg", degrees);
    }
    bench_json_end();
}

static int draw(const char *svg, const char *preset, const corner corners[CORNERS],
                cairn_pose poses[3][CORNERS])
{
    static const char *const titles[3] = {"Start", "Force field, 12 steps",
                                          "Nearest neighbours, 100 steps"};
    cairn_report_map picture = cairn_report_map_default();
    cairn_report_panel panels[3];
    cairn_report_scan scans[CORNERS];
    cairn_file_error error;
    cairn_status status;
    char path[512];

    memset(panels, 0, sizeof panels);
    memset(scans, 0, sizeof scans);
    for (int k = 0; k < 3; k++) {
        panels[k].title = titles[k];
        panels[k].pose = poses[k];
    }
    for (int i = 0; i < CORNERS; i++) {
        scans[i].segment = corners[i].pieces;
        scans[i].segment_count = corners[i].piece_count;
    }
    picture.title = "Three scans of a corner";
    picture.panel = panels;
    picture.panel_count = 3;
    picture.scan = scans;
    picture.scan_count = CORNERS;
    picture.connect = 0;
    picture.colour_scans = 1;
    (void)snprintf(path, sizeof path, "%s/corners-%s.svg", svg, preset);
    status = cairn_report_map_write(path, &picture, &error);
    if (status != CAIRN_OK)
        fprintf(stderr, "bench/field: %s: %s\n", path, cairn_status_text(status));
    return status == CAIRN_OK;
}

int bench_corners(const char *preset, double spacing, const char *svg)
{
    corner *corners = malloc(CORNERS * sizeof *corners);
    cairn_pose poses[3][CORNERS];
    cairn_status status = corners == NULL ? CAIRN_NO_MEMORY : CAIRN_OK;
    int done;

    if (status == CAIRN_OK) {
        make_scene(corners, poses[0], spacing);
        memcpy(poses[1], poses[0], sizeof poses[0]);
        memcpy(poses[2], poses[0], sizeof poses[0]);
        status = run_field(preset, spacing, corners, poses[1]);
    }
    if (status == CAIRN_OK)
        status = run_nearest(corners, poses[2]);
    if (status != CAIRN_OK)
        fprintf(stderr, "bench/field: corners: %s\n", cairn_status_text(status));
    done = status == CAIRN_OK;
    if (done) {
        print("nearest", spacing, NEAREST_STEPS, poses[2], NULL);
        print(preset, spacing, FIELD_STEPS, poses[1], poses[2]);
        done = svg == NULL || draw(svg, preset, corners, poses);
    }
    free(corners);
    return done;
}
