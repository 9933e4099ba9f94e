/* Interface between the command `cairn align` and its alignment methods. */
#ifndef CAIRN_TOOLS_CAIRN_ALIGN_H
#define CAIRN_TOOLS_CAIRN_ALIGN_H

#include "cairn/aligner.h"
#include "cairn/force_field.h"
#include "cairn/place_map.h"
#include "src/host/maps/capacity.h"
#include "tools/cairn_map_output.h"
#include "tools/cairn_player.h"
#include "tools/cairn_tool.h"

#define ALIGN_PROGRAM "cairn align"

typedef struct align_settings {
    const char *log, *folder, *method, *pool, *report;
    int64_t max_scans, steps, seed;
    double resolution, range, clear, range_max, spacing;
    /* m, degrees: bound of the error of the poses in the log */ double spread[2];
    int32_t json, quiet, by_hypotheses;
    int32_t no_poses;
    /* 1: the method as printed in the thesis; implied by method gradient with hypotheses */
    int32_t as_written;
    /* 1: scan by scan, method gradient only */
    int32_t online;
    /* 1: method gradient, started from places matched by shape */
    int32_t chain;
    /* 1: draws figures 6.6 and 6.7 */
    int32_t pictures;
    /* scans per place; 0: grouped by the poses of the log */
    int64_t headings;
    /* of a bag; NULL: the only one */
    const char *scan_topic, *odometry_topic;
} align_settings;

typedef struct align_job {
    const align_settings *settings;
    const cairn_carmen_log_scans *log;
    /* input: before; a method sets after, verdict, covariance and support */
    map_scan *scans;
    cairn_scan_params scan;
    /* sums over all scans, above 0 */
    int32_t segments, points;
    /* from align_open_player(); NULL: no report */
    cairn_report_player *player;
    /* subtitle of the picture: the method */
    char subtitle[128];
    /* summary of the alignment, complete lines; and the same as members of the JSON object */
    char summary[384];
    tool_json json;
    /* bytes, peak use of the pool */
    size_t pool_bytes;
} align_job;

/* Opens the job's player with all scans if --report is given. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status align_open_player(align_job *job, cairn_report_player_params params,
                                             const char *how);

/* Fits all scans with an object of the job's params and passes them to `add` one by one. TOOL_OK,
 * or another exit code after a line on standard error. */
typedef cairn_status (*align_add)(void *aligner, const cairn_scan_view *view, cairn_pose start,
                                  cairn_fault *fault);
int align_add_scans(align_job *job, cairn_scan *scan, align_add add, void *aligner);

/* Prints a status on standard error and returns its exit code. */
int align_refuse(const align_job *job, cairn_status status);

/* Returns the sizes of the job's scans, and the aligner's params with capacities for them. */
cairn_capacity_scans align_scans_of(const align_job *job);
cairn_aligner_params align_params_of(const align_job *job);

/* Stores the aligner's result for scan i in the job. */
void align_read_pose(align_job *job, int32_t i, const cairn_aligner_pose *pose);

/* Appends the verdict of the alignment to the summary and to the JSON object. */
void align_summarize(align_job *job, const cairn_aligner_result *result);

/* The methods, each with a pool of its own. TOOL_OK, or another exit code after a line on
 * standard error. */
int align_by_default(align_job *job);
/* default, then virtual scans for the scans that remain unplaced */
int align_by_hypotheses(align_job *job);
int align_by_field(align_job *job);
int align_by_lum(align_job *job);
/* without poses: global matching of whole places */
int align_by_places(align_job *job);
/* as written: places matched by shape, then the field from there */
int align_by_chain(align_job *job);

/* ---- Places, added one by one ---- */

typedef struct align_places align_places;

/* Groups the scans of a job into places. TOOL_OK; or another exit code after a line on standard
 * error, and *places is NULL. */
int align_places_new(const align_job *job, align_places **places);
void align_places_free(align_places *places);

/* Scans of place `place`, 0 ... its count - 1: first ... end - 1. Returns 0 when there is no such
 * place. */
int32_t align_places_range(const align_places *places, int32_t place, int32_t *first, int32_t *end);

/* Returns the params of the place map, and the pose of scan i relative to its place. */
cairn_place_map_params align_places_params(const align_job *job, const align_places *places);
cairn_pose align_places_scan(const align_places *places, int32_t i);

/* Opens a pool for the map and `more` bytes. TOOL_OK, or another exit code after a line on
 * standard error. */
int align_places_open(const align_job *job, const align_places *places,
                      const cairn_place_map_params *params, size_t more, cairn_pool *pool);

/* Steps a map to its end. */
cairn_status align_places_run(cairn_place_map *map);

/* Scans first ... end - 1 of the job, fitted and handed over; as align_add_scans(). */
int align_add_range(align_job *job, cairn_scan *scan, int32_t first, int32_t end, align_add add,
                    void *aligner);

/* ---- The force field, started by the caller ---- */

/* Returns the params of the force field as written with capacities for the job's scans. */
cairn_force_field_params align_field_params(const align_job *job);

/* Iterates the field until it converges or runs out of steps. first_potential: the potential at the
 * start poses. */
cairn_status align_field_run(const align_job *job, cairn_force_field *field,
                             cairn_real *first_potential);

/* Copies the poses of the field to the job and appends the verdict to the summary and to
 * the JSON object. */
void align_field_read(align_job *job, const cairn_force_field *field, cairn_real first_potential);

/* ---- Figures 6.6 and 6.7, errors.svg and stages.svg in the job's folder, beside the map ---- */

extern const char *const align_picture_names[2];

/* After align_by_places(): maps the places again up to each earlier stage and draws the figures.
 * The poses of the log serve as ground truth. TOOL_OK, or another exit code after a line on
 * standard error. */
int align_draw_places(align_job *job);

#endif
