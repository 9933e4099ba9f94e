#include "bench/bench_chain.h"

#include <stdio.h>
#include <stdlib.h>

#include "bench/bench_score.h"
#include "cairn/place_map.h"
#include "cairn/random.h"

#define DEGREE 0.017453292519943295

/* Reader and mapper in one pool, and the order in which the scans are given: place by place. */
typedef struct chain {
    void *memory;
    cairn_scan *scan;
    cairn_place_map *map;
    int32_t *order; /* [count] */
    int32_t places;
} chain;

static void sort_by_place(const sim_scan *scans, int32_t count, chain *c)
{
    int32_t taken = 0;

    for (c->places = 0; taken < count; c->places++)
        for (int32_t i = 0; i < count; i++)
            if (scans[i].place == c->places)
                c->order[taken++] = i;
}

static cairn_status open_chain(const sim_scan *scans, int32_t count, chain *c)
{
    cairn_place_map_params params = cairn_place_map_default();
    cairn_scan_params scan = cairn_scan_default();
    cairn_status status;
    cairn_pool pool;
    size_t bytes;

    c->order = malloc((size_t)count * sizeof *c->order);
    if (c->order == NULL)
        return CAIRN_NO_MEMORY;
    sort_by_place(scans, count, c);
    scan.max_beams = scans[0].count;
    params.max_places = c->places;
    params.max_scans = count;
    params.max_place_beams = (count / c->places + 1) * scans[0].count;
    bytes = cairn_scan_memory(&scan) + cairn_place_map_memory(&params) + CAIRN_ALIGN;
    c->memory = malloc(bytes);
    status = c->memory == NULL ? CAIRN_NO_MEMORY : cairn_pool_init(&pool, c->memory, bytes);
    if (status == CAIRN_OK)
        status = cairn_scan_create(&c->scan, &pool, &scan);
    return status == CAIRN_OK ? cairn_place_map_create(&c->map, &pool, &params) : status;
}

/* Where a scan lies to the first one of its place, as far as is known. */
static cairn_pose within_place(const sim_scan *first, const sim_scan *scan, const double error[2], cairn_random *random)
{
    sim_pose seen = bench_pose_between(first->truth, scan->truth);
    cairn_pose pose;

    if (scan != first) {
        seen.x += (double)cairn_random_uniform(random, -1, 1) * error[0];
        seen.y += (double)cairn_random_uniform(random, -1, 1) * error[0];
        seen.theta += (double)cairn_random_uniform(random, -1, 1) * error[1] * DEGREE;
    }
    pose.x = (cairn_real)seen.x;
    pose.y = (cairn_real)seen.y;
    pose.theta = (cairn_real)seen.theta;
    return pose;
}

static cairn_status map_places(const sim_scan *scans, int32_t count, const double error[2], uint64_t seed, chain *c)
{
    const sim_scan *first = NULL;
    cairn_status status = CAIRN_OK;
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_random random = cairn_random_seed(seed, 80);

    for (int32_t k = 0; k < count && status == CAIRN_OK; k++) {
        const sim_scan *scan = &scans[c->order[k]];
        cairn_scan_view view;

        if (first == NULL || first->place != scan->place)
            first = scan;
        status = bench_fit_scan(c->scan, scan, &view);
        if (status == CAIRN_OK)
            status =
                cairn_place_map_add_scan(c->map, scan->place, &view, within_place(first, scan, error, &random), NULL);
    }
    if (status == CAIRN_OK)
        status = cairn_place_map_begin(c->map);
    while (status == CAIRN_OK && (status = cairn_place_map_step(c->map, &budget)) == CAIRN_MORE) {
        budget.left = CAIRN_UNBOUNDED;
        status = CAIRN_OK;
    }
    return status;
}

int bench_chain_start(const sim_scan *scans, int32_t count, const double error[2], uint64_t seed, bench_pose *poses)
{
    chain c = {NULL, NULL, NULL, NULL, 0};
    cairn_status status = open_chain(scans, count, &c);

    if (status == CAIRN_OK)
        status = map_places(scans, count, error, seed, &c);
    for (int32_t k = 0; k < count && status == CAIRN_OK; k++) {
        cairn_pose pose = cairn_place_map_scan_pose(c.map, k);
        sim_pose *to = &poses[c.order[k]].pose;

        to->x = (double)pose.x;
        to->y = (double)pose.y;
        to->theta = (double)pose.theta;
    }
    if (status != CAIRN_OK)
        fprintf(stderr, "bench/align: places: %s\n", cairn_status_text(status));
    free(c.memory);
    free(c.order);
    return status == CAIRN_OK;
}
