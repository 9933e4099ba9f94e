/* cairn align --as-written, --method gradient: force field simulation (gradient descent on the
 * potential of Adluru 2008, chapter 7), of all scans at once or, with --online, of all previous
 * scans after every new scan. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "tools/cairn_align.h"

static cairn_status add_to_field(void *field, const cairn_scan_view *view, cairn_pose start,
                                 cairn_fault *fault)
{
    return cairn_force_field_add_scan(field, view, NULL, start, fault);
}

/* Iterates the field to its end; the record, when not NULL, stores every iteration.
 * first_potential: the potential at the last start. */
static cairn_status iterate(const align_job *job, cairn_force_field *field, player_field *record,
                            cairn_real *first_potential)
{
    int32_t quiet = job->settings->quiet || job->settings->online;
    tool_progress progress = tool_progress_begin("align", job->settings->steps, quiet);
    cairn_force_field_state state;
    cairn_status status;

    do {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        if (record != NULL)
            player_field_before(record);
        status = cairn_force_field_iterate(field, &budget);
        state = cairn_force_field_read(field);
        if (status >= 0 && record != NULL)
            status = player_field_after(record);
        if (state.start_iterations == 1)
            *first_potential = state.potential;
        tool_progress_at(&progress, state.start_iterations);
    } while (status >= 0 && state.verdict == CAIRN_FORCE_FIELD_RUNNING);
    tool_progress_end(&progress);
    return status >= 0 && record != NULL ? player_field_end(record) : status;
}

cairn_status align_field_run(const align_job *job, cairn_force_field *field,
                             cairn_real *first_potential)
{
    return iterate(job, field, NULL, first_potential);
}

static cairn_status iterate_and_record(align_job *job, cairn_force_field *field,
                                       cairn_real *first_potential)
{
    player_field record;
    cairn_status status;

    if (job->player == NULL)
        return align_field_run(job, field, first_potential);
    status = player_field_begin(&record, job->player, field);
    if (status == CAIRN_OK)
        status = iterate(job, field, &record, first_potential);
    player_field_free(&record);
    return status;
}

typedef struct online {
    const align_job *job;
    cairn_force_field *field;
    tool_progress progress;
    int32_t scans;
    cairn_real first_potential;
} online;

/* Adds a scan at its pose in the log and aligns all scans added so far (Adluru 2008, section
 * 7.3.6). */
static cairn_status add_online(void *to, const cairn_scan_view *view, cairn_pose start,
                               cairn_fault *fault)
{
    online *o = to;
    cairn_status status = cairn_force_field_add_scan(o->field, view, NULL, start, fault);

    if (status != CAIRN_OK)
        return status;
    cairn_force_field_restart(o->field);
    status = align_field_run(o->job, o->field, &o->first_potential);
    tool_progress_at(&o->progress, ++o->scans);
    return status < 0 ? status : CAIRN_OK;
}

static int align_online(align_job *job, cairn_scan *scan, cairn_force_field *field,
                        cairn_real *first_potential)
{
    online o = {.job = job, .field = field};
    int code;

    o.progress = tool_progress_begin("align", job->log->count, job->settings->quiet);
    code = align_add_scans(job, scan, add_online, &o);
    tool_progress_end(&o.progress);
    *first_potential = o.first_potential;
    return code;
}

cairn_force_field_params align_field_params(const align_job *job)
{
    cairn_capacity_scans scans = align_scans_of(job);

    return cairn_capacity_force_field(&scans, (int32_t)job->settings->steps);
}

void align_field_read(align_job *job, const cairn_force_field *field, cairn_real first_potential)
{
    cairn_force_field_state state = cairn_force_field_read(field);
    const char *verdict =
        state.verdict == CAIRN_FORCE_FIELD_CONVERGED ? "converged" : "out of steps";
    double sigma_start = (double)cairn_force_field_as_written().sigma_start;
    cairn_json_writer *json = &job->json.writer;
    size_t used = strlen(job->summary);

    for (int32_t i = 0; i < job->log->count; i++) {
        job->scans[i].after = cairn_force_field_pose(field, i);
        job->scans[i].low_confidence = job->scans[i].point_count == 0;
        job->scans[i].verdict = job->scans[i].low_confidence ? "blind" : "aligned";
    }
    snprintf(job->subtitle, sizeof job->subtitle,
             "%" PRId32 " iterations of force field simulation%s%s", state.iterations,
             job->settings->chain ? " from places matched by shape" : "",
             job->settings->online ? ", online" : "");
    snprintf(job->summary + used, sizeof job->summary - used,
             "steps      %" PRId32 " (%s)\n"
             "potential  %.6g at sigma %.3g m -> %.6g at sigma %.3g m\n",
             state.iterations, verdict, (double)first_potential, sigma_start,
             (double)state.potential, (double)state.sigma);
    cairn_json_write_integer(json, "iterations", state.iterations);
    cairn_json_write_text(json, "verdict", verdict);
    cairn_json_write_number(json, "first_potential", (double)first_potential);
    cairn_json_write_number(json, "first_sigma_m", sigma_start);
    cairn_json_write_number(json, "potential", (double)state.potential);
    cairn_json_write_number(json, "sigma_m", (double)state.sigma);
    cairn_json_write_integer(json, "corners_dropped", state.corners_dropped);
    used = strlen(job->summary);
    if (state.corners_dropped > 0)
        snprintf(job->summary + used, sizeof job->summary - used,
                 "corners    %" PRId32 " beyond the memory for them have no region of interest\n",
                 state.corners_dropped);
}

int align_by_field(align_job *job)
{
    cairn_force_field_params params = align_field_params(job);
    cairn_force_field *field = NULL;
    cairn_scan *scan = NULL;
    cairn_real first_potential = 0;
    cairn_status status;
    cairn_pool pool;
    int code = tool_pool_open(&pool, ALIGN_PROGRAM, job->settings->pool,
                              cairn_force_field_memory(&params) + cairn_scan_memory(&job->scan));

    if (code != TOOL_OK)
        return code;
    status = cairn_scan_create(&scan, &pool, &job->scan);
    if (status == CAIRN_OK)
        status = cairn_force_field_create(&field, &pool, &params);
    if (status == CAIRN_OK)
        status = align_open_player(job, player_field_params(&params), "force field simulation");
    if (status == CAIRN_OK && job->settings->online)
        code = align_online(job, scan, field, &first_potential);
    else if (status == CAIRN_OK)
        code = align_add_scans(job, scan, add_to_field, field);
    if (status == CAIRN_OK && code == TOOL_OK && !job->settings->online)
        status = iterate_and_record(job, field, &first_potential);
    if (status < 0)
        code = align_refuse(job, status);
    else if (code == TOOL_OK)
        align_field_read(job, field, first_potential);
    job->pool_bytes = pool.peak > job->pool_bytes ? pool.peak : job->pool_bytes;
    tool_pool_close(&pool);
    return code;
}
