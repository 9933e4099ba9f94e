/* cairn align --no-poses --as-written with gradient: global matching of places by shape, refined by
 * force field simulation.
 *
 * Method: 1. Place matching by shape finds the poses of the places (Adluru 2008, chapter 6 and
 * section 7.3.7). 2. The force field simulation of chapter 7 moves all scans: after all places, or
 * with --online after every place (7.3.6). */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "tools/cairn_align.h"

/* The map of places and the field, in one pool. */
typedef struct chain {
    align_job *job;
    align_places *places;
    cairn_scan *scan;
    cairn_place_map *map;
    cairn_force_field *field;
    cairn_real first_potential;
    int32_t place, at; /* the current place, and the next scan to be added */
} chain;

static cairn_status add_to_map(void *to, const cairn_scan_view *view, cairn_pose start,
                               cairn_fault *fault)
{
    chain *chain_job = to;

    (void)start;
    return cairn_place_map_add_scan(chain_job->map, chain_job->place, view,
                                    align_places_scan(chain_job->places, chain_job->at++), fault);
}

/* Adds a scan to the field at the pose that shape matching has found. */
static cairn_status add_to_field(void *to, const cairn_scan_view *view, cairn_pose start,
                                 cairn_fault *fault)
{
    chain *chain_job = to;
    cairn_pose pose = cairn_place_map_scan_pose(chain_job->map, chain_job->at);

    (void)start;
    chain_job->job->scans[chain_job->at++].before = pose;
    return cairn_force_field_add_scan(chain_job->field, view, NULL, pose, fault);
}

/* Runs the field on all scans added so far and copies the poses to the place map. */
static cairn_status run_field(chain *chain_job, int32_t scans)
{
    cairn_status status;

    cairn_force_field_restart(chain_job->field);
    status = align_field_run(chain_job->job, chain_job->field, &chain_job->first_potential);
    for (int32_t i = 0; i < scans && status >= 0; i++)
        status = cairn_place_map_move_scan(chain_job->map, i,
                                           cairn_force_field_pose(chain_job->field, i));
    return status < 0 ? status : CAIRN_OK;
}

/* Adds one place: matches it with the previous places at their current poses, then runs the
 * field. */
static int add_place(chain *chain_job, int32_t first, int32_t end)
{
    cairn_status status;
    int code;

    chain_job->at = first;
    code = align_add_range(chain_job->job, chain_job->scan, first, end, add_to_map, chain_job);
    if (code != TOOL_OK)
        return code;
    status = cairn_place_map_extend(chain_job->map);
    if (status == CAIRN_OK)
        status = align_places_run(chain_job->map);
    chain_job->at = first;
    if (status == CAIRN_OK)
        code =
            align_add_range(chain_job->job, chain_job->scan, first, end, add_to_field, chain_job);
    if (status == CAIRN_OK && code == TOOL_OK)
        status = run_field(chain_job, end);
    return status < 0 ? align_refuse(chain_job->job, status) : code;
}

static int add_places(chain *chain_job)
{
    align_job *job = chain_job->job;
    tool_progress progress = tool_progress_begin("align", job->log->count, job->settings->quiet);
    cairn_place_map_result result;
    int32_t first, end;
    int code = TOOL_OK;

    for (; code == TOOL_OK && align_places_range(chain_job->places, chain_job->place, &first, &end);
         chain_job->place++) {
        code = add_place(chain_job, first, end);
        tool_progress_at(&progress, end);
    }
    tool_progress_end(&progress);
    if (code != TOOL_OK)
        return code;
    result = cairn_place_map_read(chain_job->map);
    snprintf(job->summary, sizeof job->summary,
             "places     %" PRId32 ", %" PRId32 " of them matched by shape\n", result.places,
             result.placed);
    cairn_json_write_integer(&job->json.writer, "places", result.places);
    cairn_json_write_integer(&job->json.writer, "placed", result.placed);
    align_field_read(job, chain_job->field, chain_job->first_potential);
    return code;
}

static int run_online(align_job *job)
{
    chain chain_job = {.job = job};
    cairn_force_field_params field = align_field_params(job);
    cairn_place_map_params map;
    cairn_status status;
    cairn_pool pool;
    int code = align_places_new(job, &chain_job.places);

    if (code != TOOL_OK)
        return code;
    map = align_places_params(job, chain_job.places);
    code =
        align_places_open(job, chain_job.places, &map,
                          cairn_scan_memory(&job->scan) + cairn_force_field_memory(&field), &pool);
    if (code == TOOL_OK) {
        status = cairn_scan_create(&chain_job.scan, &pool, &job->scan);
        if (status == CAIRN_OK)
            status = cairn_place_map_create(&chain_job.map, &pool, &map);
        if (status == CAIRN_OK)
            status = cairn_force_field_create(&chain_job.field, &pool, &field);
        code = status == CAIRN_OK ? add_places(&chain_job) : align_refuse(job, status);
        job->pool_bytes = pool.peak;
        tool_pool_close(&pool);
    }
    align_places_free(chain_job.places);
    return code;
}

int align_by_chain(align_job *job)
{
    int code;

    if (job->settings->online)
        return run_online(job);
    code = align_by_places(job);
    if (code != TOOL_OK)
        return code;
    for (int32_t i = 0; i < job->log->count; i++)
        job->scans[i].before = job->scans[i].after;
    return align_by_field(job);
}
