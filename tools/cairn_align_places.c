/* cairn align --no-poses: global matching of whole places, without odometry; with --as-written as
 * in Adluru 2008, chapter 6. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/output_set.h"
#include "tools/cairn_align.h"
#include "tools/cairn_places_picture.h"

struct align_places {
    int32_t *place;         /* [scans] */
    cairn_pose *place_scan; /* [scans] */
    cairn_place_map_grouping group;
    cairn_capacity_places sizes;
};

/* Groups consecutive scans into places and computes their poses relative to the place. */
static void group_scans(const align_job *job, align_places *grouping)
{
    grouping->group.headings = (int32_t)job->settings->headings;
    grouping->group.keep_heading = grouping->sizes.as_written = job->settings->as_written;
    for (int32_t i = 0; i < job->log->count; i++) {
        const cairn_carmen_log_record *record = &job->log->record[i];

        grouping->place[i] =
            cairn_place_map_group(&grouping->group, record->robot, &grouping->place_scan[i]);
        cairn_capacity_add_scan(&grouping->sizes, grouping->place[i], job->scans[i].point_count,
                                record->scan.count);
    }
}

static int check_grouping(const align_job *job, const align_places *grouping)
{
    const align_settings *s = job->settings;

    if (s->headings > 0 && job->log->count % s->headings != 0)
        return options_refuse(
            ALIGN_PROGRAM, "%s holds %" PRId32 " scans, expected a multiple of --headings %" PRId64,
            s->log, job->log->count, s->headings);
    if (grouping->group.places < 2)
        return options_refuse(
            ALIGN_PROGRAM, "%s holds one place, expected two or more%s", s->log,
            s->headings > 0
                ? ""
                : ": scans within 0.5 m by the log are one place, or give --headings N");
    if (grouping->group.places > CAIRN_CAPACITY_MAX_PLACES)
        return options_refuse(ALIGN_PROGRAM, "%s holds %" PRId32 " places, expected at most %d",
                              s->log, grouping->group.places, CAIRN_CAPACITY_MAX_PLACES);
    return TOOL_OK;
}

cairn_place_map_params align_places_params(const align_job *job, const align_places *grouping)
{
    cairn_capacity_scans scans = align_scans_of(job);

    return cairn_capacity_place_map(&grouping->sizes, &scans, job->settings->spacing);
}

/* ---- The map ---- */

typedef struct adding {
    cairn_place_map *map;
    const align_places *grouping;
    int32_t at;
} adding;

static cairn_status add_to_map(void *context, const cairn_scan_view *view, cairn_pose start,
                               cairn_fault *fault)
{
    adding *to = context;
    int32_t i = to->at++;

    (void)start;
    return cairn_place_map_add_scan(to->map, to->grouping->place[i], view,
                                    to->grouping->place_scan[i], fault);
}

cairn_status align_places_run(cairn_place_map *map)
{
    cairn_status status;

    do {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        status = cairn_place_map_step(map, &budget);
    } while (status == CAIRN_MORE);
    return status;
}

static cairn_status run(const align_job *job, cairn_place_map *map)
{
    tool_progress progress = tool_progress_begin("map", 1, job->settings->quiet);
    cairn_status status = cairn_place_map_begin(map);

    if (status == CAIRN_OK)
        status = align_places_run(map);
    tool_progress_end(&progress);
    return status;
}

/* has_own_pose: the pose of the scan itself is known, not only that of its place. */
static const char *verdict_of(const map_scan *scan, const cairn_place_map_place *place,
                              int32_t has_own_pose)
{
    return scan->point_count == 0              ? "blind"
           : place->component > 0              ? "apart"
           : place->ambiguous || !has_own_pose ? "uncertain"
                                               : "placed";
}

/* Stores the poses of all scans. Scans of other connected components have frames of their own and
 * are not drawn. */
static void read_result(align_job *job, const align_places *grouping, const cairn_place_map *map,
                        void *unused)
{
    cairn_place_map_result result = cairn_place_map_read(map);
    cairn_json_writer *json = &job->json.writer;

    (void)unused;
    for (int32_t i = 0; i < job->log->count; i++) {
        cairn_place_map_place place = cairn_place_map_place_of(map, grouping->place[i]);
        int32_t has_own_pose = job->settings->as_written || cairn_place_map_scan_is_aligned(map, i);
        map_scan *scan = &job->scans[i];

        scan->after = cairn_place_map_scan_pose(map, i);
        scan->verdict = verdict_of(scan, &place, has_own_pose);
        scan->low_confidence = place.component > 0 || place.ambiguous || !has_own_pose;
        if (!job->settings->as_written)
            scan->support = place.support;
        if (place.component > 0 && !job->settings->chain)
            scan->beam_count = scan->point_count = scan->segment_count = 0;
    }
    snprintf(job->subtitle, sizeof job->subtitle, "%" PRId32 " places without odometry%s",
             result.places, job->settings->as_written ? ", as written" : "");
    snprintf(job->summary, sizeof job->summary,
             "places     %" PRId32 ", %" PRId32 " in the largest of %" PRId32
             " components, %" PRId32 " ambiguous; %" PRId32 " scans aligned by themselves\n%s",
             result.places, result.placed, result.components, result.ambiguous, result.decoupled,
             job->settings->as_written ? "           as written: wrong places are not detected\n"
                                       : "");
    cairn_json_write_integer(json, "places", result.places);
    cairn_json_write_integer(json, "placed", result.placed);
    cairn_json_write_integer(json, "components", result.components);
    cairn_json_write_integer(json, "ambiguous", result.ambiguous);
    cairn_json_write_integer(json, "aligned_alone", result.decoupled);
}

int align_places_open(const align_job *job, const align_places *grouping,
                      const cairn_place_map_params *params, size_t more, cairn_pool *pool)
{
    size_t need = cairn_place_map_memory(params);

    if (need == 0)
        return options_refuse(ALIGN_PROGRAM,
                              "%s: %" PRId32 " places of up to %" PRId32 " points and %" PRId32
                              " beams are too many, expected at most %d of each in all",
                              job->settings->log, grouping->group.places, params->max_place_points,
                              grouping->sizes.beams, 1 << 20);
    return tool_pool_open(pool, ALIGN_PROGRAM, job->settings->pool, need + more);
}

/* Maps the places with these params and calls `read` with the map before the pool is closed. */
static int map_places(align_job *job, const align_places *grouping,
                      const cairn_place_map_params *params,
                      void (*read)(align_job *job, const align_places *grouping,
                                   const cairn_place_map *map, void *to),
                      void *to_read)
{
    adding to = {NULL, grouping, 0};
    cairn_scan *scan = NULL;
    cairn_status status;
    cairn_pool pool;
    int code = align_places_open(job, grouping, params, cairn_scan_memory(&job->scan), &pool);

    if (code != TOOL_OK)
        return code;
    status = cairn_scan_create(&scan, &pool, &job->scan);
    if (status == CAIRN_OK)
        status = cairn_place_map_create(&to.map, &pool, params);
    if (status == CAIRN_OK)
        code = align_add_scans(job, scan, add_to_map, &to);
    if (status == CAIRN_OK && code == TOOL_OK)
        status = run(job, to.map);
    if (status < 0)
        code = align_refuse(job, status);
    else if (code == TOOL_OK)
        read(job, grouping, to.map, to_read);
    job->pool_bytes = pool.peak > job->pool_bytes ? pool.peak : job->pool_bytes;
    tool_pool_close(&pool);
    return code;
}

int align_by_places(align_job *job)
{
    align_places *grouping;
    int code = align_places_new(job, &grouping);

    if (code == TOOL_OK) {
        cairn_place_map_params params = align_places_params(job, grouping);

        code = map_places(job, grouping, &params, read_result, NULL);
    }
    align_places_free(grouping);
    return code;
}

/* ---- Grouping of scans into places ---- */

void align_places_free(align_places *grouping)
{
    if (grouping == NULL)
        return;
    free(grouping->place);
    free(grouping->place_scan);
    free(grouping);
}

int align_places_new(const align_job *job, align_places **places)
{
    size_t n = (size_t)job->log->count;
    align_places *grouping = calloc(1, sizeof *grouping);
    int code;

    *places = NULL;
    if (grouping != NULL) {
        grouping->place = calloc(n, sizeof *grouping->place);
        grouping->place_scan = calloc(n, sizeof *grouping->place_scan);
    }
    if (grouping == NULL || grouping->place == NULL || grouping->place_scan == NULL) {
        align_places_free(grouping);
        (void)options_refuse(ALIGN_PROGRAM, "no memory for %" PRId32 " scans", job->log->count);
        return TOOL_FAILED;
    }
    group_scans(job, grouping);
    code = check_grouping(job, grouping);
    if (code == TOOL_OK)
        *places = grouping;
    else
        align_places_free(grouping);
    return code;
}

int32_t align_places_range(const align_places *grouping, int32_t place, int32_t *first,
                           int32_t *end)
{
    for (*first = 0; *first < grouping->group.scans && grouping->place[*first] < place; ++*first)
        ;
    for (*end = *first; *end < grouping->group.scans && grouping->place[*end] == place; ++*end)
        ;
    return *end > *first;
}

cairn_pose align_places_scan(const align_places *grouping, int32_t i)
{
    return grouping->place_scan[i];
}

/* ---- Figures 6.6 and 6.7 ---- */

const char *const align_picture_names[2] = {"errors.svg", "stages.svg"};

/* Poses of the places and scans after each stage, and those of the log, in the frame of the first
 * place. Poses of places after the last stage are not stored. */
typedef struct stage_poses {
    cairn_pose *place, *scan; /* [PLACES_PANELS][places], [PLACES_PANELS][scans] */
    places_stage stage;
} stage_poses;

static void read_stage(align_job *job, const align_places *grouping, const cairn_place_map *map,
                       void *to)
{
    stage_poses *poses = to;

    for (int32_t i = 0; i < grouping->group.places; i++)
        poses->place[poses->stage * grouping->group.places + i] =
            cairn_place_map_place_of(map, i).map_place;
    for (int32_t k = 0; k < job->log->count; k++)
        poses->scan[poses->stage * job->log->count + k] = cairn_place_map_scan_pose(map, k);
}

/* Reads the poses of the last stage from the job, and those of the log. */
static void read_last_stage(const align_job *job, const align_places *grouping, stage_poses *poses)
{
    int32_t n = job->log->count;
    cairn_pose log_map = cairn_pose_compose(job->log->record[0].robot,
                                            cairn_pose_inverse(align_places_scan(grouping, 0)));

    for (int32_t k = n - 1; k >= 0; k--) {
        cairn_pose scan = cairn_pose_between(log_map, job->log->record[k].robot);

        poses->scan[PLACES_DECOUPLED * n + k] = job->scans[k].after;
        poses->scan[PLACES_STAGES * n + k] = scan;
        poses->place[PLACES_STAGES * grouping->group.places + grouping->place[k]] =
            cairn_pose_compose(scan, cairn_pose_inverse(grouping->place_scan[k]));
    }
}

static cairn_status draw(const align_job *job, const align_places *grouping,
                         const stage_poses *poses, cairn_file_error *error)
{
    size_t n = (size_t)job->log->count, places = (size_t)grouping->group.places;
    places_errors errors = {"pose in the log", poses->place + PLACES_STAGES * places,
                            poses->place + PLACES_BY_SHAPE * places,
                            poses->place + PLACES_WITH_ICP * places, grouping->group.places};
    places_maps maps = {.title = "Fig. 6.7: maps without odometry", .count = job->log->count};
    cairn_report_scan *seen = calloc(n, sizeof *seen);
    cairn_output_set *files = NULL;
    cairn_status status = CAIRN_NO_MEMORY;

    for (int k = 0; k < PLACES_PANELS; k++) {
        maps.panel_title[k] = k < PLACES_STAGES ? places_stage_titles[k] : "(d) poses of the log";
        maps.pose[k] = poses->scan + (size_t)k * n;
    }
    for (size_t i = 0; i < n && seen != NULL; i++) {
        seen[i].point = job->scans[i].point;
        seen[i].point_count = job->scans[i].point_count;
    }
    maps.scan = seen;
    if (seen != NULL)
        status =
            cairn_output_set_open(&files, job->settings->folder, align_picture_names, 2, error);
    else
        (void)cairn_file_error_set(error, status, "stages.svg", 0, "no memory for the picture");
    if (status == CAIRN_OK)
        status = places_draw_errors(cairn_output_set_path(files, 0), &errors, error);
    if (status == CAIRN_OK)
        status = places_draw_maps(cairn_output_set_path(files, 1), &maps, error);
    if (status == CAIRN_OK)
        status = cairn_output_set_commit(files, error);
    else
        cairn_output_set_discard(files);
    free(seen);
    return status;
}

int align_draw_places(align_job *job)
{
    align_places *grouping;
    stage_poses poses = {NULL, NULL, PLACES_BY_SHAPE};
    cairn_file_error error;
    int code = align_places_new(job, &grouping);

    if (code != TOOL_OK)
        return code;
    poses.place =
        malloc(PLACES_PANELS * ((size_t)grouping->group.places + 1) * sizeof *poses.place);
    poses.scan = malloc(PLACES_PANELS * ((size_t)grouping->group.scans + 1) * sizeof *poses.scan);
    if (poses.place == NULL || poses.scan == NULL) {
        (void)options_refuse(ALIGN_PROGRAM, "no memory for the pictures");
        code = TOOL_FAILED;
    }
    for (; poses.stage < PLACES_DECOUPLED && code == TOOL_OK; poses.stage++) {
        cairn_place_map_params params = align_places_params(job, grouping),
                               stage = places_stage_params(poses.stage);

        params.decoupled = stage.decoupled;
        params.match.mode = stage.match.mode;
        code = map_places(job, grouping, &params, read_stage, &poses);
    }
    if (code == TOOL_OK) {
        read_last_stage(job, grouping, &poses);
        code = draw(job, grouping, &poses, &error) == CAIRN_OK ? TOOL_OK : tool_report(&error);
    }
    free(poses.place);
    free(poses.scan);
    align_places_free(grouping);
    return code;
}
