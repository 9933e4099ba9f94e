/* arena: simulated arenas and scans of a simulated range scanner, with ground truth.
 *
 * An arena is a Box2D world seen from above: walls 0.1 m thick, furniture, and rubble settled by
 * simulation at arbitrary angles. A survey drives a robot through an arena and takes scans, with
 * the ground truth of every beam. Both are functions of their options alone: the same options give
 * the same bytes, in the double and in the float build. Separate random streams exist for the
 * world, the places, the drive and every scan, so that a change of noise or movers changes neither
 * the arena nor the places.
 *
 * Numbers are double in both builds. Metres, radians, counter-clockwise. The arena's centre is the
 * origin of the world frame. An arena is immutable after its creation: threads may share it. */
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
    /* wings with wards on long corridors between a hall and a glazed corridor; doors alike */
    SIM_HOSPITAL = 9,
    /* two furnished rooms joined by one door */
    SIM_JOINED = 10,
    SIM_SCENES = 11
};

const char *sim_scene_name(sim_scene scene);  /* "rescue" ...; NULL for an invalid scene */
const char *sim_scene_about(sim_scene scene); /* one line of plain text */
sim_scene sim_scene_find(const char *name);   /* -1 for an unknown name */
void sim_scene_size(sim_scene scene, double *width, double *height); /* default size */
int32_t sim_scene_places(sim_scene scene);                           /* default number of places */

typedef struct sim_arena_options {
    uint64_t seed;
    sim_scene scene;
    double width, height; /* m; 0: default of the scene. At most 60, at least the scene's minimum */
    double turn;          /* rad, direction of the scene's x axis in the world; NaN: random */
    double rubble;        /* density of loose bodies, 0 ... 3; 1: default of the scene */
} sim_arena_options;

/* Returns the default options: rescue, seed 1, default size, random rotation. */
sim_arena_options sim_arena_default(void);

typedef int32_t sim_kind;
enum {
    SIM_WALL = 0,
    SIM_FURNITURE = 1, /* static: tables, beds, door leaves, pillars */
    SIM_BOX = 2,       /* settled: boxes of 0.3 to 0.8 m */
    SIM_RUBBLE = 3,    /* settled: bricks, wall pieces, stones */
    SIM_GLASS = 4      /* static: a pane, which a beam passes at oblique incidence */
};

/* A convex body. Its edges are edges[first_edge] ... edges[first_edge + edge_count - 1]. */
typedef struct sim_body {
    sim_kind kind;
    int32_t first_edge, edge_count;
    sim_point centre;
    double angle;
    double radius; /* of a disc (which has one edge); 0: a polygon */
    double glass;  /* rad, of a pane: angle of incidence up to which a beam returns; 0: no pane */
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

/* Creates an arena; returns NULL and a line in `fault` on invalid options ("width is 2 m, expected
 * 6 to 60"). fault: [fault_size], may be NULL. */
sim_arena *sim_arena_create(const sim_arena_options *options, char *fault, size_t fault_size);
void sim_arena_free(sim_arena *arena); /* NULL is fine */

/* Returns the options with actual sizes and rotation. */
sim_arena_options sim_arena_options_of(const sim_arena *arena);
const sim_body *sim_arena_bodies(const sim_arena *arena, int32_t *count);
const sim_edge *sim_arena_edges(const sim_arena *arena, int32_t *count);

/* Returns the distance from a point to the nearest body in m; negative inside a body. */
double sim_arena_clearance(const sim_arena *arena, sim_point point);

/* Returns 1 when a robot can reach the point: it lies, within a grid cell of 0.1 m, in the largest
 * connected component of free space with 0.3 m clearance, in a hospital 0.38 m. */
int32_t sim_arena_reachable(const sim_arena *arena, sim_point point);

/* Results of a beam other than an edge index (>= 0). */
enum {
    SIM_NOTHING = -1, /* no return: range is +inf */
    SIM_FLOOR = -2,   /* hit on the floor, by a tilted scanner */
    SIM_MOVER = -3,   /* hit on a moving body */
    SIM_DROPPED = -4, /* range is NaN */
    SIM_SELF = -5     /* hit on the robot itself or on its trailer */
};

/* One sweep. Beam i looks along angle_min + i * angle_step in the frame of the sensor. */
typedef struct sim_scan {
    /* [count] m; +inf: no return; NaN: dropped. Returns lie in [range_min, range_max) */
    const float *range;
    /* [count] edge of the arena, or one of SIM_NOTHING ... */
    const int32_t *edge;
    int32_t count;
    /* index of the place and of the heading there; -1 on a drive and for given poses */
    int32_t place, heading;
    /* rad */
    double angle_min, angle_step;
    double range_min, range_max, range_sigma;
    /* 1: some beams hit the floor */
    int32_t tilted;
    /* m, distance of the line where the plane of the sweep meets the floor; 0: level. Beam i meets
     * it at ground / cos(angle - ground_bearing) when that cosine is positive */
    double ground;
    /* rad, direction in which the plane descends, in the frame of the sensor */
    double ground_bearing;
    /* pose of the sensor on the robot */
    sim_pose base_sensor;
    /* true pose world_base at the first beam */
    sim_pose truth;
    /* true motion: pose of the base at the last beam relative to the base at the first beam */
    sim_pose motion;
    /* odometry pose at the first beam, with drift; initially equal to truth */
    sim_pose odometry;
    /* motion measured by odometry */
    sim_pose odometry_motion;
    /* m/s and rad/s, velocity at the first beam */
    double speed, turn_rate;
    /* ns, time of the first beam */
    int64_t stamp_ns;
} sim_scan;

typedef struct sim_survey_options {
    uint64_t seed;

    /* Scan poses: `places` free positions with `headings` scans each; or `drive` scans along a tour
     * of the places. */
    /* number of places, 1 ... 1000; 0: default of the scene */
    int32_t places;
    /* scans per place at evenly spaced headings, 1 ... 64 */
    int32_t headings;
    /* m, maximum distance of the sensor positions of one place, 0 ... 1 */
    double jitter_position;
    /* rad, width of the uniform noise of the headings, 0 ... 2 pi */
    double jitter_heading;
    /* scans of a drive; 0: scans at places */
    int32_t drive;
    /* m, a drive scans after this distance */
    double drive_distance;
    /* rad, or after this rotation */
    double drive_turn;

    /* Scanner. */
    /* beams of a scan, 2 ... 100000 */
    int32_t beams;
    /* rad, field of view, 0 < fov <= 2 pi; a full circle does not repeat its first beam */
    double fov;
    /* interlaced scans, 1 ... 64: the first angle of scan i is (i modulo start_angles) /
     * start_angles of a step after that of scan 0 */
    int32_t start_angles;
    /* m */
    double range_min, range_max;
    /* m, standard deviation of a range */
    double noise;
    /* fraction of beams without a reading, 0 ... 1 */
    double dropout;
    /* fraction of beams without return, 0 ... 1, as of black or shining surfaces */
    double lost;
    /* fraction of walls and furniture of glass, 0 ... 1: no beam that ends on them returns */
    double glass;
    /* fraction of beams that hit the floor, in runs, 0 ... 0.3 */
    double tilt;
    /* m, 0 or 1 ... 50: on stretches of 5 to 15 m of the path the scanner is tilted forward and
     * meets the floor at this distance, within about a tenth; 0: always level */
    double ground;
    /* 1: the robot's legs return at 0.3 m in the directions of +-60 degrees; 0: none */
    int32_t legs;
    /* 1: a trailer follows the robot: its body behind, and two poles beside the robot; 0: none */
    int32_t trailer;
    /* s, duration of a scan, 0 ... 2; beam i is cast at its own time */
    double scan_time;
    /* m/s, maximum speed during scans at places */
    double sweep_speed;
    /* rad/s, maximum turn rate during scans at places; the motion is at most 0.2 m */
    double sweep_turn;
    /* pose of the sensor, at most 0.25 m from the centre of the robot; a robot whose sensor is
     * farther than 0.15 m from its centre is larger, so that the sensor stays out of walls */
    sim_pose base_sensor;
    /* moving bodies, 0 ... 100 */
    int32_t movers;
    /* fraction of the beams of every scan at a place that end on people, at new positions for each
     * scan, 0 ... 0.5 */
    double crowd;

    /* Odometry errors of the wheels. Random parts are standard deviations that grow with the square
     * root of the distance. */
    double slip_distance; /* m per root m */
    double slip_turn;     /* rad per root rad */
    double slip_drift;    /* rad of heading per root m */
    double bias_scale;    /* constant relative error of distance and rotation, uniform +- */
    double bias_drift;    /* rad per m, constant heading drift, uniform +- */

    /* 1: all places have the headings of the first one, as with a compass; 0: separate headings */
    int32_t same_headings;

    /* called in each step; when it returns 1, the survey ends without a result. NULL: none */
    int (*is_stopped)(void);
} sim_survey_options;

/* Returns the default options: the scene's places x 4 headings of 100 degrees, 401 beams, 1 cm
 * noise, 8 m, 0.15 m jitter of the positions of a place. */
sim_survey_options sim_survey_default(void);

/* Returns the default options of a scene: those of sim_survey_default(), except for hospital: a
 * drive of 1500 scans, one each 0.2 m, 181 beams of 180 degrees, 80 m, four start angles, a sensor
 * 0.22 m ahead of the centre, 1 % of beams lost, and good wheels. */
sim_survey_options sim_survey_default_for(sim_scene scene);

typedef struct sim_survey sim_survey;

/* Takes the scans of a survey; returns NULL and a line in `fault` on invalid options, and NULL when
 * it is stopped. The arena must outlive the survey. */
sim_survey *sim_survey_create(const sim_arena *arena, const sim_survey_options *options,
                              char *fault, size_t fault_size);

/* Takes scans at given poses of the base (poses: [count]), each with the same speed and turn rate
 * during the scan; `places`, `headings`, `drive` and the jitter are ignored. No pose may have its
 * sensor inside a body. */
sim_survey *sim_survey_at(const sim_arena *arena, const sim_survey_options *options,
                          const sim_pose *poses, int32_t count, double speed, double turn_rate,
                          char *fault, size_t fault_size);
void sim_survey_free(sim_survey *survey); /* NULL is fine */

sim_survey_options sim_survey_options_of(const sim_survey *survey);
const sim_arena *sim_survey_arena(const sim_survey *survey);
const sim_scan *sim_survey_scans(const sim_survey *survey, int32_t *count);
/* in the order of the tour */
const sim_point *sim_survey_places(const sim_survey *survey, int32_t *count);
/* true trajectory of the robot */
const sim_pose *sim_survey_path(const sim_survey *survey, int32_t *count);
/* number of collisions of the driving robot */
int32_t sim_survey_bumps(const sim_survey *survey);

/* Sets poses[i] to the true pose of scan i with uniform noise of +-metres in x and y and +-radians.
 * poses: [scans]. */
void sim_survey_disturb(const sim_survey *survey, uint64_t seed, double metres, double radians,
                        sim_pose *poses);

/* Converts a scan to the library's input. The arrays stay owned by the survey. */
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
