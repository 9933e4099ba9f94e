/* carmen_log: reader of laser scans and odometry from CARMEN logs, plain or gzipped.
 *
 * Format. One message a line, numbers in the "C" locale. These messages are read:
 *
 *   FLASER n r1 .. rn  laser_x laser_y laser_theta  robot_x robot_y robot_theta
 *       stamp host logger_stamp
 *   ROBOTLASER1 laser_type start_angle field_of_view angular_resolution maximum_range
 *       accuracy remission_mode  n r1 .. rn  m remission1 .. remissionm
 *       laser_x laser_y laser_theta  robot_x robot_y robot_theta
 *       laser_tv laser_rv forward_safety_dist side_safety_dist turn_axis
 *       stamp host logger_stamp
 *   ODOM x y theta tv rv accel  stamp host logger_stamp
 *   PARAM name value ...
 *   # comment
 *
 * Other messages are counted and ignored. Ranges are in m, angles in rad, stamps in s. Records keep
 * the order of the lines; stamps need not be monotonic. A log with both kinds of scans yields both.
 *
 * Bearings. A FLASER message has no bearings. Its first beam points to -90 degrees. The angular
 * step is 180/n degrees when n is even (180: 1 degree, 360: half a degree, the last beam one step
 * short of +90) and 180/(n - 1) when n is odd (181 and 361 end at +90 degrees). A single beam
 * points ahead. A ROBOTLASER1 message has its first angle and its step; a step of 0 is computed
 * from the field of view.
 *
 * No return. A range at or above the scanner's maximum range means no return and is read as
 * +infinity. The maximum range is
 *   1. params.range_max, when it is set;
 *   2. for a ROBOTLASER1 its maximum_range, when that is above 0;
 *   3. the PARAM robot_frontlaser_max or robot_front_laser_max, when the log is consistent with it:
 *      of the ranges at or above that value 9 in 10 lie within 0.2 m of each other, or there are
 *      none (some logs set it to a planning distance far below the scanner's range);
 *   4. the mode of the range histogram: the window of 0.2 m above 40 m with the most ranges, when
 *      it has 10 or more, 9 in 10 of all above it, and more than the 2 m below it. The maximum
 *      range is the lower end of the window in steps of 1 cm (the scanners of these logs report 50,
 *      51.1 or 81.8 to 81.9 m);
 *   5. 80 m.
 *
 * A range that is NaN, 0 or negative is passed through unchanged and means an invalid reading.
 * -infinity becomes NaN.
 *
 * Mounting. A log has the pose of the laser and the pose of the robot. When their relative pose is
 * the same for all scans, to 0.01 m and 0.01 rad, the mean is the sensor's mounting (base_sensor,
 * an extrinsic calibration). Otherwise, as in some corrected logs where the laser's pose is the
 * corrected one, or when the sensor is farther away than CAIRN_SCAN_EXTENT, the sensor is at the
 * robot's origin and fixed_mounting is 0.
 *
 * Faults. A malformed line is reported with its number, counted and skipped, and so is the end of a
 * truncated file. So are implausible lines: a maximum_range above CAIRN_SCAN_EXTENT (a PARAM of the
 * limit is then ignored), a pose, bearing or motion beyond 1e9. Only a file without any scan is an
 * error. */
#ifndef CAIRN_CARMEN_LOG_H
#define CAIRN_CARMEN_LOG_H

#include "cairn/file_error.h"
#include "cairn/scan.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The maximum number of ranges, and of remissions, of one scan. */
#define CAIRN_CARMEN_LOG_MAX_BEAMS 100000

/* The maximum number of scans that are loaded at once: seven hours at 40 scans/s. */
#define CAIRN_CARMEN_LOG_MAX_SCANS 1048576

/* Parameters of the reader. */
typedef struct cairn_carmen_log_params {
    /* m, 0 ... CAIRN_SCAN_EXTENT (0): ranges at or above it are no returns; 0: estimated by rules 2
     * to 5 */
    double range_max;
    /* m, 0 ... CAIRN_SCAN_EXTENT (0.01): standard deviation of the ranges, copied into the scans */
    double range_sigma;
    /* any (NULL): called once for each fault, in the order of the lines, by cairn_carmen_log_open()
     * or cairn_carmen_log_load(). NULL: faults are only counted. */
    void (*on_fault)(void *context, const cairn_file_error *fault);
    /* any (NULL): passed to on_fault */
    void *context;
} cairn_carmen_log_params;

/* Returns the default parameters. */
cairn_carmen_log_params cairn_carmen_log_default(void);

/* Summary of a whole log. */
typedef struct cairn_carmen_log_summary {
    /* lines of the file */
    int64_t lines;
    /* well-formed FLASER and ROBOTLASER1 lines */
    int64_t scans;
    /* well-formed ODOM lines */
    int64_t odometry;
    /* messages of other kinds, PARAM included, without comments and blank lines */
    int64_t ignored;
    /* malformed lines and truncated ends */
    int64_t faults;
    /* sum over all scans */
    int64_t beams;
    /* fewest and most beams of one scan */
    int32_t min_beams;
    /* most beams of a scan */
    int32_t max_beams;
    /* stamps of the first and the last scan, ns */
    int64_t first_ns, last_ns;
    /* earliest and latest stamp of all scans, ns */
    int64_t earliest_ns, latest_ns;
    /* scans with a stamp earlier than the scan before */
    int64_t backward_stamps;
    /* m, path length over the robot's odometry poses at the scans */
    double odometry_length;
    /* rad, sum of the absolute rotations between them */
    double odometry_turn;
    /* m, maximum range of scans without one of their own */
    double range_max;
    /* 1: the sensor's mounting is base_sensor in all scans */
    int32_t fixed_mounting;
    /* the sensor's pose in the robot frame */
    cairn_pose base_sensor;
    /* m, x and y: all poses are taken from here; 0 unless the first pose is farther than 1e5 m */
    double origin[2];
} cairn_carmen_log_summary;

/* The kind of a record. */
typedef int32_t cairn_carmen_log_kind;
enum {
    CAIRN_CARMEN_LOG_SCAN = 0,    /* FLASER, ROBOTLASER1 */
    CAIRN_CARMEN_LOG_ODOMETRY = 1 /* ODOM */
};

/* A scan or an odometry message. */
typedef struct cairn_carmen_log_record {
    /* kind of the message */
    cairn_carmen_log_kind kind;
    /* number of ranges; 0 for odometry */
    int32_t count;
    /* number of the line, from 1 */
    int64_t line;
    /* time, ns */
    int64_t stamp_ns;
    /* the robot's odometry pose */
    cairn_pose robot;
    /* the sensor's pose as logged; the robot's pose for odometry */
    cairn_pose laser;
    /* [count] m; +inf: no return; NaN, <= 0: invalid reading */
    const float *range;
    /* the record as input of a scan: ranges, bearings, maximum range, mounting, stamp. Empty for
     * odometry */
    cairn_scan_input scan;
} cairn_carmen_log_record;

/* An open log. */
typedef struct cairn_carmen_log cairn_carmen_log;

/* Opens a log and reads it once, for its summary and its faults. CAIRN_EMPTY: no scan;
 * CAIRN_BAD_ARGUMENT: a range_max that is negative or above CAIRN_SCAN_EXTENT, a range_sigma that
 * is negative or not finite; CAIRN_IO, CAIRN_UNSUPPORTED (not a regular file), CAIRN_NO_MEMORY.
 * Memory: the longest line. params NULL: the defaults.
 *
 * path: file, plain or gzipped */
CAIRN_CHECKED cairn_status cairn_carmen_log_open(cairn_carmen_log **log, const char *path,
                                                 const cairn_carmen_log_params *params,
                                                 cairn_file_error *error);

/* Returns the summary of the log. */
cairn_carmen_log_summary cairn_carmen_log_info(const cairn_carmen_log *log);

/* Reads the next scan or odometry message. The record's arrays are valid until the next call.
 * CAIRN_EMPTY: the end of the log; CAIRN_IO, CAIRN_NO_MEMORY.
 *
 * record: set to the message */
CAIRN_CHECKED cairn_status cairn_carmen_log_next(cairn_carmen_log *log,
                                                 cairn_carmen_log_record *record,
                                                 cairn_file_error *error);

/* Rewinds to the first record. CAIRN_IO. */
CAIRN_CHECKED cairn_status cairn_carmen_log_rewind(cairn_carmen_log *log, cairn_file_error *error);

/* Closes the log and frees its memory. NULL is allowed. */
void cairn_carmen_log_close(cairn_carmen_log *log);

/* All scans of a log. */
typedef struct cairn_carmen_log_scans {
    cairn_carmen_log_record *record; /* [count] */
    /* number of scans */
    int32_t count;
    float *range; /* storage of the records' ranges */
    /* summary of the log */
    cairn_carmen_log_summary info;
} cairn_carmen_log_scans;

/* Reads all scans of a log. Statuses of cairn_carmen_log_open() and cairn_carmen_log_next(); on
 * failure there is nothing to free. CAIRN_FULL: more than INT32_MAX scans.
 *
 * scans: set to the scans and the summary
 * path: file, plain or gzipped */
CAIRN_CHECKED cairn_status cairn_carmen_log_load(cairn_carmen_log_scans *scans, const char *path,
                                                 const cairn_carmen_log_params *params,
                                                 cairn_file_error *error);

/* Frees the arrays.
 *
 * scans: scans that were loaded */
void cairn_carmen_log_scans_free(cairn_carmen_log_scans *scans);

#ifdef __cplusplus
}
#endif

#endif
