/* cairn align --no-poses --as-written with gradient: shape finds where the places lie (Adluru
 * 2008, chapter 6 and section 7.3.7), then the force field simulation of chapter 7 moves all
 * scans; all places first, or with --online place after place (7.3.6). */
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
    int32_t place, at; /* the place at work, and its next scan to be added */
} chain;

static cairn_status add_to_map(void *to, const cairn_scan_view *view, cairn_pose start,
                               cairn_fault *fault)
{
    chain *c = to;

    (void)start;
    return cairn_place_map_add_scan(c->map, c->place, view, align_places_scan(c->places, c->at++),
                                    fault);
}

/* Where shape has put the scan. */
static cairn_status add_to_field(void *to, const cairn_scan_view *view, cairn_pose start,
                                 cairn_fault *fault)
{
    chain *c = to;
    cairn_pose pose = cairn_place_map_scan_pose(c->map, c->at);

    (void)start;
    c->job->scans[c->at++].before = pose;
    return cairn_force_field_add_scan(c->field, view, NULL, pose, fault);
}

/* The field runs on all scans that are there, and the map of places has them where it leaves
 * them. */
static cairn_status run_field(chain *c, int32_t scans)
{
    cairn_status status;

    cairn_force_field_restart(c->field);
    status = align_field_run(c->job, c->field, &c->first_potential);
    for (int32_t i = 0; i < scans && status >= 0; i++)
        status = cairn_place_map_move_scan(c->map, i, cairn_force_field_pose(c->field, i));
    return status < 0 ? status : CAIRN_OK;
}

/* One place more: matched with those before it as the field has them, then the field. */
static int add_place(chain *c, int32_t first, int32_t end)
{
    cairn_status status;
    int code;

    c->at = first;
    code = align_add_range(c->job, c->scan, first, end, add_to_map, c);
    if (code != TOOL_OK)
        return code;
    status = cairn_place_map_extend(c->map);
    if (status == CAIRN_OK)
        status = align_places_run(c->map);
    c->at = first;
    if (status == CAIRN_OK)
        code = align_add_range(c->job, c->scan, first, end, add_to_field, c);
    if (status == CAIRN_OK && code == TOOL_OK)
        status = run_field(c, end);
    return status < 0 ? align_refuse(c->job, status) : code;
}

static int add_places(chain *c)
{
    align_job *job = c->job;
    tool_progress progress = tool_progress_begin("align", job->log->count, job->settings->quiet);
    cairn_place_map_result result;
    int32_t first, end;
    int code = TOOL_OK;

    for (; code == TOOL_OK && align_places_range(c->places, c->place, &first, &end); c->place++) {
        code = add_place(c, first, end);
        tool_progress_at(&progress, end);
    }
    tool_progress_end(&progress);
    if (code != TOOL_OK)
        return code;
    result = cairn_place_map_read(c->map);
    snprintf(job->summary, sizeof job->summary,
             "places     %" PRId32 ", %" PRId32 " of them matched by shape\n", result.places,
             result.placed);
    align_field_read(job, c->field, c->first_potential);
    return code;
}

static int run_online(align_job *job)
{
    chain c = {.job = job};
    cairn_force_field_params field = align_field_params(job);
    cairn_place_map_params map;
    cairn_status status;
    cairn_pool pool;
    int code = align_places_new(job, &c.places);

    if (code != TOOL_OK)
        return code;
    map = align_places_params(job, c.places);
    code =
        align_places_open(job, c.places, &map,
                          cairn_scan_memory(&job->scan) + cairn_force_field_memory(&field), &pool);
    if (code == TOOL_OK) {
        status = cairn_scan_create(&c.scan, &pool, &job->scan);
        if (status == CAIRN_OK)
            status = cairn_place_map_create(&c.map, &pool, &map);
        if (status == CAIRN_OK)
            status = cairn_force_field_create(&c.field, &pool, &field);
        code = status == CAIRN_OK ? add_places(&c) : align_refuse(job, status);
        job->pool_bytes = pool.peak;
        tool_pool_close(&pool);
    }
    align_places_free(c.places);
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
