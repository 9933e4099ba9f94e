/* Functions that all subcommands of cairn share: exit codes, errors, progress bar, memory pool.
 *
 * A subcommand is one file tools/cairn_<name>.c with one function, named in the table of cairn.c.
 * It prints its result on standard output, as text or as one JSON object (--json,
 * docs/schemas/<name>.json), and all other text on standard error, and returns one of the exit codes
 * below. Output files are written through cairn/output.h, whole or not at all. */
#ifndef CAIRN_TOOLS_CAIRN_TOOL_H
#define CAIRN_TOOLS_CAIRN_TOOL_H

#include <stdio.h>

#include "cairn/file_error.h"
#include "cairn/output.h"
#include "cairn/output_set.h"
#include "cairn/pool.h"
#include "cairn/scan_log.h"
#include "src/host/base/json_writer.h"
#include "src/host/base/posix.h"
#include "src/host/logs/scan_log_correction.h"
#include "tools/options.h"

/* What help texts call a log and an image. */
#define TOOL_LOG    "log (CARMEN, URG, CSM, table of ranges, bag of ROS)"
#define TOOL_IMAGES "TIFF, PNG, JPEG, PNM"

enum {
    TOOL_OK = 0,
    /* out of memory, or standard output could not be written */
    TOOL_FAILED = 1,
    /* invalid input, output folder or command line */
    TOOL_BAD = 2
};

/* A subcommand of cairn, or of one of its subcommands. argv[0] is its name. */
typedef struct tool_command {
    const char *name;
    const char *summary;
    int (*run)(int argc, char **argv);
} tool_command;

/* The command of that name, or NULL. */
const tool_command *tool_command_find(const tool_command *commands, size_t count, const char *name);

/* Prints the commands, a line each. */
void tool_commands_print(const tool_command *commands, size_t count, FILE *stream);

/* Prints the table (OPTIONS_TABLE) of a program of commands: the rows of options_table() and
 *
 * command NAME SUMMARY (each) */
void tool_commands_table(const char *program, const char *about, const tool_command *commands,
                         size_t count);

int tool_align(int argc, char **argv);
int tool_detect(int argc, char **argv);
int tool_eval(int argc, char **argv);
int tool_graph(int argc, char **argv);
int tool_group(int argc, char **argv);
int tool_info(int argc, char **argv);
int tool_map(int argc, char **argv);
int tool_match(int argc, char **argv);
int tool_merge(int argc, char **argv);
int tool_model(int argc, char **argv);
int tool_replay(int argc, char **argv);
int tool_skeleton(int argc, char **argv);
int tool_symmetry(int argc, char **argv);
int tool_train(int argc, char **argv);

/* Reads the command line "LOG -o DIR [options]"; `folder` is the variable that the table's -o sets.
 * OPTIONS_READ: both were given. */
option_result tool_read_options(const option_set *set, int argc, char **argv, const char **log,
                                const char *const *folder);

/* Prints the error's text on standard error and returns its exit code. */
int tool_report(const cairn_file_error *error);

/* Prints "path:line: reason" for a scan that the library rejected. The reason is the fault's text,
 * or the status's text when fault is NULL or has none. Returns the status's exit code. */
int tool_report_scan(const char *path, int64_t line, cairn_status status, const cairn_fault *fault);

/* The exit code of a status: TOOL_FAILED for CAIRN_NO_MEMORY and CAIRN_BAD_BUILD, TOOL_BAD for
 * other errors. */
int tool_exit_code(cairn_status status);

/* Opens an output file; its folder is made when it is missing, as that of -o. Statuses of
 * cairn_output_open(). */
CAIRN_CHECKED cairn_status tool_output_open(cairn_output **output, const char *path,
                                            cairn_file_error *error);

/* Names in the set the files of cairn map, align and merge that are not in it, so that none of an
 * earlier run stays beside those of this one. names: [count] files of the set. Statuses of
 * cairn_output_set_remove(). */
CAIRN_CHECKED cairn_status tool_remove_other_maps(cairn_output_set *set, const char *const *names,
                                                  int32_t count, cairn_file_error *error);

/* Counts the faults of a log and prints the first ten as warnings on standard error, then the
 * number of further ones. */
typedef struct tool_faults {
    int64_t count;
    int32_t quiet; /* 1: no fault is printed */
} tool_faults;

/* For cairn_scan_log_params.on_fault; the context is a tool_faults. */
void tool_on_fault(void *context, const cairn_file_error *fault);
void tool_faults_end(const tool_faults *faults);

/* What the command line corrects of the scanner. */
typedef struct tool_scanner {
    double range_scale, angle_step, sweep; /* factor, degrees, s; 0: as logged */
    const char *sensor;                    /* "X,Y,DEG"; NULL: as logged */
    int32_t flip;
} tool_scanner;

/* How a log is read. */
typedef struct tool_log_options {
    double range_max; /* m, ranges from this value on count as no return; 0: the limit of the log */
    const char *scan_topic, *odometry_topic; /* of a bag; NULL: the only one */
    tool_scanner scanner;
    int32_t quiet;        /* 1: neither faults nor what was taken are printed */
    int32_t prints_taken; /* 1: the command prints what was taken itself */
} tool_log_options;

/* The options of all commands that read logs. */
#define TOOL_LOG_SCAN_HELP "bag: topic of the scans (the only one)"
#define TOOL_LOG_ODOM_HELP                                                                         \
    "bag: topic of the odometry; /tf: the transform odom to base (the only one, else /tf)"
#define TOOL_LOG_OPTIONS(scan, odom, scanner)                                                      \
    OPTION_TEXT("--scan", scan, "TOPIC", TOOL_LOG_SCAN_HELP),                                      \
        OPTION_TEXT("--odom", odom, "TOPIC", TOOL_LOG_ODOM_HELP),                                  \
        OPTION_FLAG("--flip", &(scanner)->flip,                                                    \
                    "the scanner is upside down: bearings change their sign"),                     \
        OPTION_NUMBER("--range-scale", &(scanner)->range_scale, 1e-6, 1e6, "FACTOR",               \
                      "factor of all ranges: 0.001 for a log in mm"),                              \
        OPTION_NUMBER("--angle-step", &(scanner)->angle_step, 1e-3, 180, "DEG",                    \
                      "angle between neighbouring beams, degrees; the middle beam keeps its "      \
                      "bearing (from the log)"),                                                   \
        OPTION_TEXT("--sensor", &(scanner)->sensor, "X,Y,DEG",                                     \
                    "pose of the sensor on the robot, m, m, degrees (from the log)")

/* The option of the commands that correct the motion during a scan. */
#define TOOL_SWEEP_OPTION(scanner)                                                                 \
    OPTION_NUMBER("--sweep", &(scanner)->sweep, -2, 2, "S",                                        \
                  "duration of a scan, first to last beam, s, for logs without it; < 0: the last " \
                  "beam is measured first")

/* Greatest absolute value of a coordinate of a pose, m or degrees. */
#define TOOL_POSE_LIMIT 1e5

/* Reads "X,Y,DEG", numbers within TOOL_POSE_LIMIT. Returns 1 and sets pose, m, m, degrees, or
 * returns 0. */
int32_t tool_read_pose(const char *text, double pose[3]);

/* Makes the correction of the options, without the limit of scaled ranges. TOOL_OK; or TOOL_BAD
 * after a line on standard error. */
int tool_correction(const tool_scanner *scanner, cairn_scan_correction *correction);

/* Prints on standard error from where the coordinates of a log are taken that is far from 0. */
void tool_print_origin(const char *path, const double origin[2]);

/* Loads a log of any format and corrects its scanner, prints its faults, of a log far from 0 the
 * origin of its coordinates, and of a bag what was taken. TOOL_OK, or another exit code after a line on standard error; then
 * there is nothing to free. */
int tool_load(cairn_scan_log *log, const char *path, const tool_log_options *options);

/* Loads a log uncorrected, with all ranges as they are: none is a no return. Nothing is printed but
 * errors. As tool_load(). */
int tool_load_raw(cairn_scan_log *log, const char *path, const tool_log_options *options);

/* As tool_load(), and refuses a log without odometry: "program: path has no odometry, expected ...". */
int tool_load_with_poses(cairn_scan_log *log, const char *program, const char *path,
                         const tool_log_options *options);

/* A JSON object that is printed whole, or not at all when the command fails on the way. */
typedef struct tool_json {
    cairn_text_stream text;
    cairn_json_writer writer;
} tool_json;

/* Begins the object. TOOL_OK; or TOOL_FAILED after a line on standard error. */
int tool_json_open(tool_json *json, const char *program);

/* Ends the object and prints it on standard output when it is wanted and `code` is TOOL_OK. Returns
 * the exit code. */
int tool_json_close(tool_json *json, const char *program, int32_t is_wanted, int code);

/* Writes a pose as an object: x and y in m, theta in rad. */
void tool_json_pose(cairn_json_writer *json, const char *name, cairn_pose pose);

/* Monotonic time in s. */
double tool_seconds(void);

/* A progress bar on standard error. Nothing is drawn when quiet is not 0 or standard error is no
 * terminal. */
typedef struct tool_progress {
    const char *label;
    int64_t total;
    int32_t shown; /* 1: a bar is on the screen and must be erased */
    int32_t live;
    double drawn; /* s, time of the last drawing */
} tool_progress;

tool_progress tool_progress_begin(const char *label, int64_t total, int32_t quiet);

/* Draws at most ten times a second. */
void tool_progress_at(tool_progress *progress, int64_t done);
void tool_progress_end(tool_progress *progress);

/* Opens a pool on the heap for objects that need `need` bytes. Its size is the value of --pool
 * (bytes, or with suffix K, M, G for 1024, 1024^2, 1024^3), or `need` when pool_size is NULL.
 * TOOL_OK, or another exit code after a line on standard error: invalid size, size too small, out
 * of memory. */
int tool_pool_open(cairn_pool *pool, const char *program, const char *pool_size, size_t need);
void tool_pool_close(cairn_pool *pool);

/* Parses a size in the format of --pool. Returns 1 and sets *bytes, or returns 0. */
int32_t tool_read_bytes(const char *text, size_t *bytes);

#endif
