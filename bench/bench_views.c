#include "bench/bench_views.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int bench_views_start(bench_views *views, int32_t capacity, int32_t beams)
{
    cairn_scan_params params = cairn_scan_default();
    cairn_pool pool;
    size_t bytes;

    memset(views, 0, sizeof *views);
    params.max_beams = beams;
    bytes = cairn_scan_memory(&params) + CAIRN_ALIGN;
    views->memory = malloc(bytes);
    views->at = calloc((size_t)capacity, sizeof *views->at);
    views->capacity = capacity;
    if (views->memory != NULL && views->at != NULL &&
        cairn_pool_init(&pool, views->memory, bytes) == CAIRN_OK &&
        cairn_scan_create(&views->scan, &pool, &params) == CAIRN_OK)
        return 1;
    bench_views_free(views);
    return 0;
}

/* A copy of items[count]; NULL only when memory is insufficient. */
static void *copy(const void *items, int32_t count, size_t size)
{
    void *made = malloc((size_t)(count > 0 ? count : 1) * size);

    if (made != NULL && count > 0)
        memcpy(made, items, (size_t)count * size);
    return made;
}

static int keep(bench_views *views, const cairn_scan_view *view, cairn_pose truth, int32_t scan)
{
    bench_view *v = &views->at[views->count];
    cairn_oriented_point *dense =
        malloc((size_t)(view->beam_count > 0 ? view->beam_count : 1) * sizeof *dense);

    v->part.points = copy(view->points, view->point_count, sizeof *view->points);
    v->part.beams = copy(view->beams, view->beam_count, sizeof *view->beams);
    v->segments = copy(view->segments, view->segment_count, sizeof *view->segments);
    v->part.dense = dense;
    views->count++;
    if (v->part.points == NULL || v->part.beams == NULL || v->segments == NULL || dense == NULL)
        return 0;
    v->part.count = view->point_count;
    v->part.beam_count = view->beam_count;
    v->part.dense_count = cairn_scan_match_dense(view, dense);
    v->segment_count = view->segment_count;
    v->truth = truth;
    v->scan = scan;
    return 1;
}

int bench_views_add(bench_views *views, const cairn_scan_input *input, cairn_pose truth,
                    int32_t scan)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_fault fault = {-1, NULL};
    cairn_status status = cairn_scan_begin(views->scan, input, &fault);
    cairn_scan_view view;

    if (status == CAIRN_OK)
        status = cairn_scan_step(views->scan, &budget);
    if (status != CAIRN_OK || views->count == views->capacity) {
        fprintf(stderr, "scan %d: %s\n", (int)scan,
                fault.message != NULL ? fault.message : cairn_status_text(status));
        return 0;
    }
    view = cairn_scan_read(views->scan);
    return keep(views, &view, truth, scan);
}

void bench_views_free(bench_views *views)
{
    for (int32_t i = 0; i < views->count; i++) {
        free((void *)views->at[i].part.points);
        free((void *)views->at[i].part.dense);
        free((void *)views->at[i].part.beams);
        free(views->at[i].segments);
    }
    free(views->at);
    free(views->memory);
    memset(views, 0, sizeof *views);
}

void bench_views_most(const bench_views *views, int32_t *points, int32_t *dense)
{
    *points = *dense = 1;
    for (int32_t i = 0; i < views->count; i++) {
        *points = views->at[i].part.count > *points ? views->at[i].part.count : *points;
        *dense = views->at[i].part.dense_count > *dense ? views->at[i].part.dense_count : *dense;
    }
}
