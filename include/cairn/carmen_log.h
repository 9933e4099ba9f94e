/* carmen_log: laser scans and odometry from CARMEN logs, plain or gzipped.
 *
 * Read are, one message a line, numbers without the locale:
 *
 *   FLASER n r1 .. rn  laser_x laser_y laser_theta  robot_x robot_y robot_theta  stamp host
 *   logger_stamp ROBOTLASER1 laser_type start_angle field_of_view angular_resolution maximum_range
 *   accuracy remission_mode
 *       n r1 .. rn  m remission1 .. remissionm  laser_x laser_y laser_theta  robot_x robot_y
 *       robot_theta laser_tv laser_rv forward_safety_dist side_safety_dist turn_axis  stamp host
 *       logger_stamp ODOM x y theta tv rv accel  stamp host logger_stamp PARAM name value ... #
 *       comment
 *
 * Other messages are counted and left out. Ranges are in m, angles in rad, stamps in s. The order
 * is that of the lines; stamps need not grow. A log that holds both kinds of scans gives both.
 *
 * Bearings. A FLASER does not say them. The first beam points to -90 degrees; the step is 180/n
 * degrees when n is even (180: 1 degree, 360: half a degree, the last beam one step short of +90)
 * and 180/(n - 1) when n is odd (181 and 361 end at +90 degrees). A single range points ahead. A
 * ROBOTLASER1 says its first angle and its step; a step of 0 is made from the field of view.
 *
 * No return. A range at or above the scanner's limit says that nothing came back and is read as
 * +infinity. The limit is
 *   1. params.range_max, when it is given;
 *   2. for a ROBOTLASER1 its maximum_range, when that is above 0;
 *   3. the PARAM robot_frontlaser_max or robot_front_laser_max, when the log agrees with it: of its
 *      ranges at or above that value 9 in 10 lie within 0.2 m of each other, or there are none
 *      (some logs set it to a planning distance far below what the scanner sees);
 *   4. where the ranges pile up: the window of 0.2 m above 40 m that holds the most ranges, when it
 *      holds 10 or more, 9 in 10 of all above it, and more than the 2 m below it; the limit is its
 *      lowest range in steps of 1 cm (the scanners of these logs report 50, 51.1 or 81.8 to 81.9
 *      m);
 *   5. 80 m.
 * A range that is NaN, 0 or negative is passed on as it is: nothing is known. -infinity becomes
 * NaN.
 *
 * Mounting. A log gives the pose of the laser and that of the robot. When the one as seen from the
 * other is the same for all scans, to 0.01 m and 0.01 rad, that is where the sensor sits
 * (base_sensor, the mean). When not (in some corrected logs the laser's pose is the corrected one),
 * or farther away than CAIRN_SCAN_EXTENT, the sensor is taken to sit at the robot's origin, and
 * `fixed_mounting` is 0.
 *
 * Damage. A line that breaks its format is reported with its number, counted and left out, and
 * so is the end of a file that was cut. So are lines that no scanner writes: a maximum_range
 * above CAIRN_SCAN_EXTENT (a PARAM of the limit then is not read), a pose, bearing or motion
 * beyond 1e9. Only a file without any scan is an error. */
#ifndef CAIRN_CARMEN_LOG_H
#define CAIRN_CARMEN_LOG_H

#include "cairn/file_error.h"
#include "cairn/scan.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The most ranges (and remissions) of one scan. */
#define CAIRN_CARMEN_BEAMS_MOST 100000

typedef struct cairn_carmen_params {
    double range_max;   /* m; ranges from here on are no return. 0: found as said above */
    double range_sigma; /* m; standard deviation handed on to the scans. Default 0.01 */
    /* Called once for every fault, in order of lines, by _open (or _load); NULL: faults are only
     * counted. */
    void (*on_fault)(void *context, const cairn_file_error *fault);
    void *context;
} cairn_carmen_params;

cairn_carmen_params cairn_carmen_default(void);

/* What a whole log holds. */
typedef struct cairn_carmen_info {
    int64_t lines;
    /* FLASER and ROBOTLASER1 lines that are whole */
    int64_t scans;
    /* ODOM lines that are whole */
    int64_t odometry;
    /* messages of other kinds, PARAM included; comments and blank lines are not counted */
    int64_t ignored;
    /* damaged lines and cut ends */
    int64_t faults;
    /* of all scans */
    int64_t beams;
    /* of one scan */
    int32_t beams_least;
    int32_t beams_most;
    /* stamps of the first and the last scan */
    int64_t first_ns, last_ns;
    /* of all scans */
    int64_t least_ns, most_ns;
    /* scans that are stamped earlier than the scan before */
    int64_t stamps_back;
    /* m, along the robot's poses of the scans */
    double odometry_length;
    /* rad, sum of the absolute turns between them */
    double odometry_turn;
    /* m, the limit of scans that do not name their own */
    double range_max;
    /* 1: the sensor sits at base_sensor in all scans */
    int32_t fixed_mounting;
    cairn_pose base_sensor;
} cairn_carmen_info;

typedef int32_t cairn_carmen_kind;
enum {
    CAIRN_CARMEN_SCAN = 0,    /* FLASER, ROBOTLASER1 */
    CAIRN_CARMEN_ODOMETRY = 1 /* ODOM */
};

typedef struct cairn_carmen_record {
    cairn_carmen_kind kind;
    /* ranges; 0 for odometry */
    int32_t count;
    /* from 1 */
    int64_t line;
    int64_t stamp_ns;
    /* where odometry sees the robot */
    cairn_pose robot;
    /* ... and the sensor, as logged; that of the robot for odometry */
    cairn_pose laser;
    /* [count] m; +inf: no return; NaN, <= 0: nothing known */
    const float *range;
    /* the same as a scan: range, bearings, limit, mounting, stamp. Empty for odometry */
    cairn_scan_input scan;
} cairn_carmen_record;

typedef struct cairn_carmen_log cairn_carmen_log;

/* Opens a log and reads it once through, for its info and its faults. CAIRN_EMPTY: no scan in
 * it; CAIRN_BAD_ARGUMENT: a range_max that is negative or above CAIRN_SCAN_EXTENT, a range_sigma
 * that is negative or not finite; CAIRN_IO, CAIRN_UNSUPPORTED (not a regular file),
 * CAIRN_NO_MEMORY. Memory: the longest line. params NULL: the default. */
CAIRN_CHECKED cairn_status cairn_carmen_log_open(cairn_carmen_log **log, const char *path,
                                                 const cairn_carmen_params *params,
                                                 cairn_file_error *error);

cairn_carmen_info cairn_carmen_log_info(const cairn_carmen_log *log);

/* The next scan or odometry line. The record's arrays are valid until the next call.
 * CAIRN_EMPTY: none left; CAIRN_IO, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_carmen_log_next(cairn_carmen_log *log, cairn_carmen_record *record,
                                                 cairn_file_error *error);

/* Back to the first record. CAIRN_IO. */
CAIRN_CHECKED cairn_status cairn_carmen_log_rewind(cairn_carmen_log *log, cairn_file_error *error);

/* NULL is allowed. */
void cairn_carmen_log_close(cairn_carmen_log *log);

/* All scans of a log at once. */
typedef struct cairn_carmen_scans {
    cairn_carmen_record *record; /* [count] */
    int32_t count;
    float *range; /* what the records' ranges point into */
    cairn_carmen_info info;
} cairn_carmen_scans;

/* Statuses of _open and _next; on failure there is nothing to free. CAIRN_FULL: more than
 * INT32_MAX scans. */
CAIRN_CHECKED cairn_status cairn_carmen_load(cairn_carmen_scans *scans, const char *path,
                                             const cairn_carmen_params *params,
                                             cairn_file_error *error);

void cairn_carmen_scans_free(cairn_carmen_scans *scans);

#ifdef __cplusplus
}
#endif

#endif
