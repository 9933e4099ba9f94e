/* cairn align --method lum: sequential scan registration, then global optimization by Lu and Milios
 * (1997); as written Lu and Milios alone. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "cairn/lum.h"
#include "tools/cairn_align.h"

static cairn_status add_to_lum(void *lum, const cairn_scan_view *view, cairn_pose start,
                               cairn_fault *fault)
{
    return cairn_lum_add_scan(lum, view->points, view->point_count, start, fault);
}

/* As written: adds the hits of the beams; method lum does not use their directions. */
static cairn_status add_hits(void *lum, const cairn_scan_view *view, cairn_pose start,
                             cairn_fault *fault)
{
    cairn_oriented_point *hit = malloc(((size_t)view->beam_count + 1) * sizeof *hit);
    cairn_status status = CAIRN_NO_MEMORY;
    int32_t count = 0;

    for (int32_t k = 0; k < view->beam_count && hit != NULL; k++) {
        if (view->beams[k].kind != CAIRN_SCAN_BEAM_HIT)
            continue;
        hit[count].position = view->beams[k].to;
        hit[count].direction.x = 1;
        hit[count++].direction.y = 0;
    }
    if (hit != NULL)
        status = cairn_lum_add_scan(lum, hit, count, start, fault);
    free(hit);
    return status;
}

static cairn_report_player_params player_params(void)
{
    static const cairn_report_curve curves[] = {
        {"W", "", "squared differences of the links by their covariances, before the iteration"},
        {"links", "", NULL},
        {"largest motion", "mm", "by the iteration"},
    };
    cairn_report_player_params params = cairn_report_player_default();

    params.curve = curves;
    params.curve_count = sizeof curves / sizeof *curves;
    return params;
}

/* Records the poses after an iteration as a frame of the player. */
static cairn_status record(const align_job *job, const cairn_lum *lum, int64_t step,
                           cairn_pose *pose)
{
    cairn_lum_state state = cairn_lum_read(lum);
    double value[3] = {(double)NAN, (double)NAN, (double)NAN};
    cairn_report_frame frame = {0};
    char label[64];

    for (int32_t i = 0; i < job->log->count; i++)
        pose[i] = cairn_lum_pose(lum, i);
    if (state.iterations > 0) {
        value[0] = (double)state.chi2;
        value[1] = state.links;
        value[2] = 1000 * (double)state.max_motion;
        snprintf(label, sizeof label, "iteration %" PRId32, state.iterations);
    } else {
        snprintf(label, sizeof label,
                 step > 0 ? "%" PRId32 " scans registered one after the other" : "start",
                 state.registered_scans);
    }
    frame.step = step;
    frame.label = label;
    frame.pose = pose;
    frame.pose_count = job->log->count;
    frame.value = value;
    return cairn_report_player_add_frame(job->player, &frame);
}

static cairn_status iterate(const align_job *job, cairn_lum *lum)
{
    tool_progress progress =
        tool_progress_begin("align", job->settings->steps, job->settings->quiet);
    cairn_pose *pose = malloc((size_t)job->log->count * sizeof *pose);
    cairn_status status = pose != NULL ? cairn_lum_begin(lum) : CAIRN_NO_MEMORY;
    int64_t step = 0;

    if (status == CAIRN_OK && job->player != NULL)
        status = record(job, lum, step, pose);
    while (status == CAIRN_OK && cairn_lum_read(lum).verdict == CAIRN_LUM_RUNNING) {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        while ((status = cairn_lum_iterate(lum, &budget)) == CAIRN_MORE)
            budget.left = CAIRN_UNBOUNDED;
        if (status == CAIRN_OK && job->player != NULL)
            status = record(job, lum, ++step, pose);
        tool_progress_at(&progress, cairn_lum_read(lum).iterations);
    }
    tool_progress_end(&progress);
    free(pose);
    return status;
}

static void read_result(align_job *job, const cairn_lum *lum)
{
    cairn_lum_state state = cairn_lum_read(lum);
    const char *verdict = state.verdict == CAIRN_LUM_CONVERGED  ? "converged"
                          : state.verdict == CAIRN_LUM_SINGULAR ? "singular"
                                                                : "out of steps";
    cairn_json_writer *json = &job->json.writer;
    char start[64];

    for (int32_t i = 0; i < job->log->count; i++) {
        map_scan *scan = &job->scans[i];
        int blind = scan->point_count == 0, apart = !blind && !cairn_lum_is_connected(lum, i);

        scan->after = cairn_lum_pose(lum, i);
        scan->low_confidence = (uint8_t)(blind || apart);
        scan->verdict = blind ? "blind" : apart ? "apart" : "aligned";
    }
    snprintf(job->subtitle, sizeof job->subtitle, "%" PRId32 " iterations of Lu and Milios%s",
             state.iterations, job->settings->as_written ? " as written" : "");
    snprintf(start, sizeof start,
             job->settings->as_written ? "start      the poses of the log"
                                       : "registered %" PRId32 " scans, one after the other",
             state.registered_scans);
    snprintf(job->summary, sizeof job->summary,
             "%s\n"
             "links      %" PRId32 ", %" PRId32 " connected components\n"
             "steps      %" PRId32 " (%s)\n",
             start, state.links, state.components, state.iterations, verdict);
    cairn_json_write_integer(json, "registered", state.registered_scans);
    cairn_json_write_integer(json, "links", state.links);
    cairn_json_write_integer(json, "components", state.components);
    cairn_json_write_integer(json, "iterations", state.iterations);
    cairn_json_write_text(json, "verdict", verdict);
}

int align_by_lum(align_job *job)
{
    int32_t as_written = job->settings->as_written;
    cairn_capacity_scans scans = align_scans_of(job);
    cairn_lum_params params = cairn_capacity_lum(&scans, (int32_t)job->settings->steps, as_written);
    cairn_scan *scan = NULL;
    cairn_lum *lum = NULL;
    cairn_status status;
    cairn_pool pool;
    int code;

    code = tool_pool_open(&pool, ALIGN_PROGRAM, job->settings->pool,
                          cairn_lum_memory(&params) + cairn_scan_memory(&job->scan));
    if (code != TOOL_OK)
        return code;
    status = cairn_scan_create(&scan, &pool, &job->scan);
    if (status == CAIRN_OK)
        status = cairn_lum_create(&lum, &pool, &params);
    if (status == CAIRN_OK)
        status = align_open_player(job, player_params(),
                                   as_written ? "Lu and Milios as written" : "Lu and Milios");
    if (status == CAIRN_OK)
        code = align_add_scans(job, scan, as_written ? add_hits : add_to_lum, lum);
    if (status == CAIRN_OK && code == TOOL_OK)
        status = iterate(job, lum);
    if (status < 0)
        code = align_refuse(job, status);
    else if (code == TOOL_OK)
        read_result(job, lum);
    job->pool_bytes = pool.peak;
    tool_pool_close(&pool);
    return code;
}
