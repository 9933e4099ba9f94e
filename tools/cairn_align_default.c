/* cairn align --method default: pairwise registration, outlier rejection, joint optimization of
 * poses and walls. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "cairn/aligner.h"
#include "src/host/base/degrees.h"
#include "tools/cairn_align.h"

static cairn_status add_to_aligner(void *aligner, const cairn_scan_view *view, cairn_pose start,
                                   cairn_fault *fault)
{
    return cairn_aligner_add_scan(aligner, view, start, fault);
}

static cairn_status run(align_job *job, cairn_aligner *aligner)
{
    player_aligner record;
    cairn_status status = cairn_aligner_begin(aligner);

    memset(&record, 0, sizeof record);
    if (status == CAIRN_OK && job->player != NULL)
        status = player_aligner_begin(&record, job->player, aligner);
    while (status == CAIRN_OK && cairn_aligner_running(aligner)) {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        while ((status = cairn_aligner_iterate(aligner, &budget)) == CAIRN_MORE)
            budget.left = CAIRN_UNBOUNDED;
        if (status == CAIRN_OK && job->player != NULL)
            status = player_aligner_commit(&record);
    }
    player_aligner_free(&record);
    return status;
}

static const char *verdict_of(const align_job *job, int32_t i, const cairn_aligner_pose *pose)
{
    return job->scans[i].point_count == 0 ? "blind"
           : pose->placed                 ? "placed"
           : pose->component > 0          ? "apart"
                                          : "uncertain";
}

static const char *verdict_text(cairn_aligner_verdict verdict)
{
    return verdict == CAIRN_ALIGNER_CONVERGED           ? "converged"
           : verdict == CAIRN_ALIGNER_OUT_OF_ITERATIONS ? "out of steps"
           : verdict == CAIRN_ALIGNER_FILL_EXCEEDED     ? "joint optimization skipped"
                                                        : "split";
}

void align_read_pose(align_job *job, int32_t i, const cairn_aligner_pose *pose)
{
    map_scan *scan = &job->scans[i];

    scan->after = pose->map_scan;
    memcpy(scan->covariance, pose->covariance, sizeof scan->covariance);
    scan->support = pose->support;
    scan->low_confidence = !pose->placed;
    scan->verdict = verdict_of(job, i, pose);
}

void align_summarize(align_job *job, const cairn_aligner_result *result)
{
    cairn_json_writer *json = &job->json.writer;
    size_t used = strlen(job->summary);

    snprintf(job->summary + used, sizeof job->summary - used,
             "parts      %" PRId32 " (%s), the largest of %" PRId32 " scans, of which %" PRId32
             " are placed\n"
             "spread     %.3g m and %.3g degrees of the poses in the log (standard deviation)\n",
             result->components, verdict_text(result->verdict), result->largest_size,
             result->placed, (double)result->initial_sigma,
             (double)result->initial_sigma_theta * CAIRN_DEGREES_PER_RADIAN);
    cairn_json_write_integer(json, "components", result->components);
    cairn_json_write_text(json, "verdict", verdict_text(result->verdict));
    cairn_json_write_integer(json, "largest", result->largest_size);
    cairn_json_write_integer(json, "placed", result->placed);
    cairn_json_write_number(json, "spread_m", (double)result->initial_sigma);
    cairn_json_write_number(json, "spread_deg",
                            (double)result->initial_sigma_theta * CAIRN_DEGREES_PER_RADIAN);
}

static void read_result(align_job *job, const cairn_aligner *aligner)
{
    cairn_aligner_result result = cairn_aligner_read(aligner);

    for (int32_t i = 0; i < job->log->count; i++) {
        cairn_aligner_pose pose = cairn_aligner_pose_of(aligner, i);

        align_read_pose(job, i, &pose);
    }
    snprintf(job->subtitle, sizeof job->subtitle, "%" PRId32 " placed", result.placed);
    align_summarize(job, &result);
}

cairn_capacity_scans align_scans_of(const align_job *job)
{
    return (cairn_capacity_scans){job->log->count, job->log->info.max_beams, job->points,
                                  job->segments};
}

cairn_aligner_params align_params_of(const align_job *job)
{
    cairn_capacity_scans scans = align_scans_of(job);

    return cairn_capacity_aligner(&scans, job->settings->spread[0],
                                  job->settings->spread[1] / CAIRN_DEGREES_PER_RADIAN);
}

int align_by_default(align_job *job)
{
    cairn_aligner_params params = align_params_of(job);
    cairn_aligner *aligner = NULL;
    cairn_scan *scan = NULL;
    cairn_status status;
    cairn_pool pool;
    int code = tool_pool_open(&pool, ALIGN_PROGRAM, job->settings->pool,
                              cairn_aligner_memory(&params) + cairn_scan_memory(&job->scan));
    if (code != TOOL_OK)
        return code;
    status = cairn_scan_create(&scan, &pool, &job->scan);
    if (status == CAIRN_OK)
        status = cairn_aligner_create(&aligner, &pool, &params);
    if (status == CAIRN_OK)
        status = align_open_player(job, player_aligner_params(), "parts that agree grow together");
    if (status == CAIRN_OK)
        code = align_add_scans(job, scan, add_to_aligner, aligner);
    if (status == CAIRN_OK && code == TOOL_OK)
        status = run(job, aligner);
    if (status < 0)
        code = align_refuse(job, status);
    else if (code == TOOL_OK)
        read_result(job, aligner);
    job->pool_bytes = pool.peak;
    tool_pool_close(&pool);
    return code;
}
