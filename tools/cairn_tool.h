/* cairn_tool: what all subcommands of cairn share: results, errors, progress, the pool.
 *
 * A subcommand is one file tools/cairn_<name>.c with one function, named in the table of
 * cairn.c. It prints its result on standard output and all else on standard error, and returns
 * one of the exit codes below. Output files are written through cairn/output.h, whole or not at
 * all. */
#ifndef CAIRN_TOOLS_CAIRN_TOOL_H
#define CAIRN_TOOLS_CAIRN_TOOL_H

#include "cairn/carmen_log.h"
#include "cairn/file_error.h"
#include "cairn/pool.h"
#include "tools/options.h"

enum {
    TOOL_OK = 0,
    /* the machine refused: no memory, a full disk behind standard output */
    TOOL_FAILED = 1,
    /* the input, the output's place or the command line is not what was expected */
    TOOL_BAD = 2
};

/* argv[0] is the subcommand's name. */
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

/* Reads the command line "LOG -o DIR [options]"; `folder` is where the table's -o goes to.
 * OPTIONS_READ: both were given. */
option_result tool_read_options(const option_set *set, int argc, char **argv, const char **log,
                                const char *const *folder);

/* Prints the error's text on standard error and returns its exit code. */
int tool_report(const cairn_file_error *error);

/* Prints "path:line: what is wrong" about a scan that the library refused: the fault's words, or
 * the status's when it has none or is NULL. Returns the status's exit code. */
int tool_report_scan(const char *path, int64_t line, cairn_status status, const cairn_fault *fault);

/* The exit code of a status: TOOL_FAILED for CAIRN_NO_MEMORY and CAIRN_BAD_BUILD, TOOL_BAD for
 * other errors. */
int tool_exit_code(cairn_status status);

/* Faults of a log as warnings on standard error: the first ten, then how many more there were. */
typedef struct tool_faults {
    int64_t count;
    int32_t quiet; /* 1: none is printed */
} tool_faults;

/* For cairn_carmen_params.on_fault; the context is a tool_faults. */
void tool_on_fault(void *context, const cairn_file_error *fault);
void tool_faults_end(const tool_faults *faults);

/* Loads a log and prints its faults. range_max: ranges from here on, in m, are no return; 0: by
 * the log. TOOL_OK, or another exit code after a line on standard error. */
int tool_load(cairn_carmen_scans *scans, const char *path, double range_max, int32_t quiet);

/* Monotonic time in s. */
double tool_seconds(void);

/* A bar on standard error, when that is a terminal and `quiet` is 0; nothing otherwise. */
typedef struct tool_progress {
    const char *label;
    int64_t total;
    int32_t shown; /* 1: there is a bar to be wiped off */
    int32_t live;
    double drawn; /* s, when it was last */
} tool_progress;

tool_progress tool_progress_begin(const char *label, int64_t total, int32_t quiet);

/* Draws at most ten times a second. */
void tool_progress_at(tool_progress *progress, int64_t done);
void tool_progress_end(tool_progress *progress);

/* A pool from the heap for objects that need `need` bytes: of the size that --pool asks for
 * (bytes, or with K, M, G behind for 1024, 1024^2, 1024^3), or just as large as needed when
 * `asked` is NULL. TOOL_OK, or another exit code after a line on standard error: not a size,
 * less than needed, no memory. */
int tool_pool_open(cairn_pool *pool, const char *program, const char *asked, size_t need);
void tool_pool_close(cairn_pool *pool);

/* A size as --pool takes it. 1 and *bytes, or 0. */
int32_t tool_read_bytes(const char *text, size_t *bytes);

#endif
