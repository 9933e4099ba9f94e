/* cairn_align: what `cairn align` hands to its methods, and gets back from them. */
#ifndef CAIRN_TOOLS_CAIRN_ALIGN_H
#define CAIRN_TOOLS_CAIRN_ALIGN_H

#include "cairn/aligner.h"
#include "cairn/force_field.h"
#include "cairn/place_map.h"
#include "tools/cairn_map_output.h"
#include "tools/cairn_player.h"
#include "tools/cairn_tool.h"

#define ALIGN_PROGRAM "cairn align"

/* The most points, and segments, of all scans that an aligner takes. */
#define ALIGN_POINTS_MOST (1 << 24)

typedef struct align_settings {
    const char *log, *folder, *method, *pool, *report;
    int64_t max_scans, steps, seed;
    double resolution, range, range_max, spacing;
    /* m, degrees */
    double spread[2];
    int32_t quiet, by_hypotheses;
    int32_t no_poses;
    /* the method as the thesis prints it; with hypotheses, method gradient is that */
    int32_t as_written;
    /* of gradient */
    int32_t online;
    /* gradient from places matched as written */
    int32_t chain;
    /* figures 6.6 and 6.7 */
    int32_t pictures;
    /* scans of a place; 0: by the poses of the log */
    int64_t headings;
} align_settings;

typedef struct align_job {
    const align_settings *settings;
    const cairn_carmen_scans *log;
    /* before is given; a method sets what comes after, the verdict and what is known of it */
    map_scan *scans;
    cairn_scan_params scan;
    /* of all scans, above 0 */
    int32_t segments, points;
    /* from align_open_player(); NULL: nobody watches */
    cairn_report_player *player;
    /* for the picture: how it was done */
    char subtitle[128];
    /* whole lines: how it went */
    char summary[384];
    /* at most used */
    size_t pool_bytes;
} align_job;

/* Opens the job's player, which holds all scans then, if --report asks for one. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status align_open_player(align_job *job, cairn_report_player_params params,
                                             const char *how);

/* Fits all scans with an object of the job's params and hands them over one by one. TOOL_OK, or
 * another exit code after a line on standard error. */
typedef cairn_status (*align_add)(void *aligner, const cairn_scan_view *view, cairn_pose start,
                                  cairn_fault *fault);
int align_add_scans(align_job *job, cairn_scan *scan, align_add add, void *aligner);

/* A line on standard error about a status; its exit code. */
int align_refuse(const align_job *job, cairn_status status);

/* The aligner's params with room for the job's scans. */
cairn_aligner_params align_params_of(const align_job *job);

/* Sets what the aligner tells of a scan. */
void align_read_pose(align_job *job, int32_t i, const cairn_aligner_pose *pose);

/* The last lines of the summary: how the alignment ended. */
void align_summarize(align_job *job, const cairn_aligner_result *result);

/* The methods, each with a pool of its own. TOOL_OK, or another exit code after a line on
 * standard error. */
int align_by_default(align_job *job);
/* default, and virtual scans for what it leaves */
int align_by_hypotheses(align_job *job);
int align_by_field(align_job *job);
int align_by_lum(align_job *job);
/* without poses: places matched as wholes */
int align_by_places(align_job *job);
/* as written: places matched by shape, then the field from there */
int align_by_chain(align_job *job);

/* ---- Places, for those who add them one by one ---- */

typedef struct align_places align_places;

/* Which scans of a job are of one place. TOOL_OK; or another exit code after a line on standard
 * error, and *places is NULL. */
int align_places_new(const align_job *job, align_places **places);
void align_places_free(align_places *places);

/* Scans of place `place`, 0 ... its count - 1: first ... end - 1. 0: there is no such place. */
int32_t align_places_range(const align_places *places, int32_t place, int32_t *first, int32_t *end);

/* Params of the map of all places, and where scan i lies in its place. */
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

/* ---- The field, for those who start it themselves ---- */

/* Params of the field as written with room for the job's scans. */
cairn_force_field_params align_field_params(const align_job *job);

/* Lets the field run to its end; first_potential: of the poses at the start. */
cairn_status align_field_run(const align_job *job, cairn_force_field *field,
                             cairn_real *first_potential);

/* Takes the poses of the field, and appends to the summary how it went. */
void align_field_read(align_job *job, const cairn_force_field *field, cairn_real first_potential);

/* ---- Figures 6.6 and 6.7, errors.svg and stages.svg in the job's folder, beside the map ---- */

extern const char *const align_picture_names[2];

/* After align_by_places(): maps the places again up to the stages before, and draws. Poses of
 * the log are the actual ones, and no more. TOOL_OK, or another exit code after a line on
 * standard error. */
int align_draw_places(align_job *job);

#endif
