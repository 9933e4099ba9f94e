/* arena: simulated arenas and what a range scanner sees in them.
 *
 * An arena is a Box2D world seen from above: walls 0.1 m thick, furniture, and rubble that was
 * scattered and settled, so that it lies at all angles. A survey sends a robot through an arena and
 * takes scans, with the truth of every beam. Both are functions of their options alone: the same
 * options give the same bytes, in the double and in the float build. Random numbers come from
 * streams of their own for the world, the places, the drive and every scan, so that more noise or
 * more movers change neither the arena nor the places.
 *
 * Numbers are double in both builds. Metres, radians, counter-clockwise. The arena's centre is
 * the origin of the world frame. An arena does not change once it is there: threads may share
 * it. */
#ifndef CAIRN_SIM_ARENA_H
#define CAIRN_SIM_ARENA_H

#include <stddef.h>
#include <stdint.h>

#include "cairn/scan.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sim_point {
    double x, y;
} sim_point;

typedef struct sim_pose {
    double x, y, theta;
} sim_pose;

/* Scenes. Each has a default size, a smallest size and a default number of places. */
typedef int32_t sim_scene;
enum {
    /* rooms, collapsed walls, boxes and heaps of rubble */
    SIM_RESCUE = 0,
    /* corridors 1.25 m apart with a few loops */
    SIM_MAZE = 1,
    /* four rectangular rooms on a hallway (Adluru 2008, chapter 8; 400 units of 0.03 m) */
    SIM_ROOMS = 2,
    /* furnished rooms on both sides of a hall */
    SIM_APARTMENT = 3,
    /* a loop of corridors with furnished rooms inside and outside of it */
    SIM_OFFICE = 4,
    /* one straight corridor: the position along it is not observable */
    SIM_CORRIDOR = 5,
    /* two identical rooms on one corridor */
    SIM_TWINS = 6,
    /* corridors that are their own mirror image */
    SIM_MIRROR = 7,
    /* no straight wall: a ring, arcs, pillars and round rubble */
    SIM_ROUND = 8,
    SIM_SCENES = 9
};

const char *sim_scene_name(sim_scene scene);  /* "rescue" ...; NULL for a number that is no scene */
const char *sim_scene_about(sim_scene scene); /* one line of plain text */
sim_scene sim_scene_find(const char *name);   /* -1 when there is none of that name */
void sim_scene_size(sim_scene scene, double *width, double *height); /* default size */
int32_t sim_scene_places(sim_scene scene);                           /* default number of places */

typedef struct sim_arena_options {
    uint64_t seed;
    sim_scene scene;
    double width, height; /* m; 0: the scene's own. At most 60, at least what the scene needs */
    double turn;          /* rad, the scene's x axis in the world; NaN: at random */
    double rubble;        /* amount of loose bodies in 0 ... 3; 1 is the scene's own */
} sim_arena_options;

/* rescue, seed 1, at its own size, turned at random. */
sim_arena_options sim_arena_default(void);

typedef int32_t sim_kind;
enum {
    SIM_WALL = 0,
    SIM_FURNITURE = 1, /* stands: tables, beds, door leaves, pillars */
    SIM_BOX = 2,       /* was loose: boxes of 0.3 to 0.8 m */
    SIM_RUBBLE = 3     /* was loose: bricks, wall pieces, stones */
};

/* A convex body. Its edges are edges[first_edge] ... edges[first_edge + edge_count - 1]. */
typedef struct sim_body {
    sim_kind kind;
    int32_t first_edge, edge_count;
    sim_point centre;
    double angle;
    double radius; /* of a disc (which has one edge); 0: a polygon */
} sim_body;

/* A flat side of a body, free side on the left of a -> b. Or a whole disc: radius > 0, a = b =
 * its centre, normal 0. */
typedef struct sim_edge {
    sim_point a, b;
    sim_point normal; /* unit, outward */
    double radius;
    int32_t body;
    int32_t curved; /* 1: a disc, or a short side of a curve */
} sim_edge;

typedef struct sim_arena sim_arena;

/* An arena, or NULL and a line in `fault` ("width is 2 m, expected 6 to 60"). fault:
 * [fault_size], may be NULL. */
sim_arena *sim_arena_create(const sim_arena_options *options, char *fault, size_t fault_size);
void sim_arena_free(sim_arena *arena); /* NULL is fine */

/* The options with sizes and turn filled in. */
sim_arena_options sim_arena_options_of(const sim_arena *arena);
const sim_body *sim_arena_bodies(const sim_arena *arena, int32_t *count);
const sim_edge *sim_arena_edges(const sim_arena *arena, int32_t *count);

/* Distance from a point to the nearest body in m; negative inside a body. */
double sim_arena_clearance(const sim_arena *arena, sim_point point);

/* Free space that a robot can reach: 1 when the point lies, within the 0.1 m of a grid cell, in
 * the largest connected part of the arena that keeps 0.3 m from all bodies. */
int32_t sim_arena_reachable(const sim_arena *arena, sim_point point);

/* What a beam hit, other than an edge (>= 0). */
enum {
    SIM_NOTHING = -1, /* no return: range is +inf */
    SIM_FLOOR = -2,   /* a tilted scanner saw the floor, short of any wall */
    SIM_MOVER = -3,   /* someone who walks */
    SIM_DROPPED = -4  /* range is NaN */
};

/* One sweep. Beam i looks along angle_min + i * angle_step in the frame of the sensor. */
typedef struct sim_scan {
    /* [count] m; +inf: no return; NaN: dropped. Returns lie in [range_min, range_max) */
    const float *range;
    /* [count] edge of the arena, or one of SIM_NOTHING ... */
    const int32_t *edge;
    int32_t count;
    /* index of the place and of the heading there; -1 on a drive and at given poses */
    int32_t place, heading;
    /* rad */
    double angle_min, angle_step;
    double range_min, range_max, range_sigma;
    /* 1: part of the sweep saw the floor */
    int32_t tilted;
    /* where the sensor sits on the robot */
    sim_pose base_sensor;
    /* world_base at the first beam */
    sim_pose truth;
    /* the base at the last beam seen from the base at the first, true */
    sim_pose motion;
    /* as truth, but drifting; starts at the truth */
    sim_pose odometry;
    /* as motion, by odometry */
    sim_pose odometry_motion;
    /* m/s and rad/s at the first beam */
    double speed, turn_rate;
    /* first beam */
    int64_t stamp_ns;
} sim_scan;

typedef struct sim_survey_options {
    uint64_t seed;

    /* Where: `places` free positions with `headings` scans each. Or a drive: `drive` scans along
     * a tour of the places. */
    /* 1 ... 1000; 0: the scene's own */
    int32_t places;
    /* per place, evenly around the circle: 1 ... 64 */
    int32_t headings;
    /* m: sensor positions of one place are at most this far apart, 0 ... 1 */
    double jitter_position;
    /* rad: headings are off the even ones by at most half of this, 0 ... 2 pi */
    double jitter_heading;
    /* scans of a drive; 0: scans at places */
    int32_t drive;
    /* m and ... */
    double drive_distance;
    /* ... rad: a drive scans when it has moved or turned by this much */
    double drive_turn;

    /* Scanner. */
    /* 2 ... 100000 */
    int32_t beams;
    /* rad, 0 < fov <= 2 pi; a full circle has its first beam once */
    double fov;
    /* m */
    double range_min, range_max;
    /* m, standard deviation of a range */
    double noise;
    /* share of beams that give nothing, 0 ... 1 */
    double dropout;
    /* share of beams that read short on the floor, in runs, 0 ... 0.3 */
    double tilt;
    /* s from the first to the last beam, 0 ... 2; beam i is cast at its own time */
    double scan_time;
    /* m/s and ... */
    double sweep_speed;
    /* ... rad/s: scans at places move by up to this while they sweep, at most 0.2 m */
    double sweep_turn;
    /* at most 0.15 m from the middle of the robot */
    sim_pose base_sensor;
    /* bodies that walk about, 0 ... 100 */
    int32_t movers;
    /* share of the beams of every scan at a place that end on people who stand about, others at
     * each scan, 0 ... 0.5 */
    double crowd;

    /* Odometry: what wheels report. Random parts are standard deviations that grow with the root
     * of the way. */
    double slip_distance; /* m per root m */
    double slip_turn;     /* rad per root rad */
    double slip_drift;    /* rad of heading per root m */
    double bias_scale;    /* share by which distance and turn are off all the way, uniform +- */
    double bias_drift;    /* rad per m of heading, all the way, uniform +- */

    /* 1: every place has the headings of the first one, as by a compass; 0: each its own */
    int32_t same_headings;
} sim_survey_options;

/* The scene's places x 4 headings of 100 degrees, 401 beams, 1 cm noise, 8 m, positions of a
 * place 0.15 m apart. */
sim_survey_options sim_survey_default(void);

typedef struct sim_survey sim_survey;

/* Scans of an arena, or NULL and a line in `fault`. The arena must outlive the survey. */
sim_survey *sim_survey_create(const sim_arena *arena, const sim_survey_options *options,
                              char *fault, size_t fault_size);

/* Scans from given poses of the base (poses: [count]), each moving at the same speed and turn
 * rate while it sweeps; `places`, `headings`, `drive` and the jitter do not count. No pose may
 * have its sensor inside a body. */
sim_survey *sim_survey_at(const sim_arena *arena, const sim_survey_options *options,
                          const sim_pose *poses, int32_t count, double speed, double turn_rate,
                          char *fault, size_t fault_size);
void sim_survey_free(sim_survey *survey); /* NULL is fine */

sim_survey_options sim_survey_options_of(const sim_survey *survey);
const sim_arena *sim_survey_arena(const sim_survey *survey);
const sim_scan *sim_survey_scans(const sim_survey *survey, int32_t *count);
/* in the order of the tour */
const sim_point *sim_survey_places(const sim_survey *survey, int32_t *count);
/* the robot's way, true */
const sim_pose *sim_survey_path(const sim_survey *survey, int32_t *count);
/* times the driving robot ran into something */
int32_t sim_survey_bumps(const sim_survey *survey);

/* poses[i] = truth of scan i, disturbed uniformly by +-metres in x and y and +-radians. poses:
 * [scans]. */
void sim_survey_disturb(const sim_survey *survey, uint64_t seed, double metres, double radians,
                        sim_pose *poses);

/* A scan for the library. The arrays stay the survey's. */
static inline cairn_scan_input sim_scan_input(const sim_scan *scan)
{
    cairn_scan_input input;

    input.range = scan->range;
    input.angle = NULL;
    input.count = scan->count;
    input.angle_min = (float)scan->angle_min;
    input.angle_step = (float)scan->angle_step;
    input.range_min = (float)scan->range_min;
    input.range_max = (float)scan->range_max;
    input.range_sigma = (float)scan->range_sigma;
    input.time_step = 0; /* the motion is known */
    input.stamp_ns = scan->stamp_ns;
    input.base_sensor.x = (cairn_real)scan->base_sensor.x;
    input.base_sensor.y = (cairn_real)scan->base_sensor.y;
    input.base_sensor.theta = (cairn_real)scan->base_sensor.theta;
    input.motion.x = (cairn_real)scan->motion.x;
    input.motion.y = (cairn_real)scan->motion.y;
    input.motion.theta = (cairn_real)scan->motion.theta;
    return input;
}

#ifdef __cplusplus
}
#endif

#endif
