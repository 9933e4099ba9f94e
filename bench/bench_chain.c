#include "bench/bench_chain.h"

#include <stdio.h>
#include <stdlib.h>

#include "bench/bench_match.h"
#include "bench/bench_score.h"
#include "cairn/place_map.h"
#include "cairn/random.h"
#include "src/host/base/degrees.h"

/* Reader and mapper in one pool, and the order in which the scans are given: place by place. */
struct bench_chain {
    void *memory;
    cairn_scan *scan;
    cairn_place_map *map;
    const sim_scan *scans;
    int32_t *order; /* [count] */
    int32_t count, places, given, as_written;
    const double *error;
    double heading; /* of the frame of the current place, as written */
    cairn_random random;
};

static void sort_by_place(bench_chain *c)
{
    int32_t taken = 0;

    for (c->places = 0; taken < c->count; c->places++)
        for (int32_t i = 0; i < c->count; i++)
            if (c->scans[i].place == c->places)
                c->order[taken++] = i;
}

static cairn_status open_chain(bench_chain *c)
{
    cairn_place_map_params params =
        c->as_written ? cairn_place_map_as_written() : cairn_place_map_default();
    cairn_scan_params scan = cairn_scan_default();
    cairn_status status;
    cairn_pool pool;
    size_t bytes;

    sort_by_place(c);
    scan.max_beams = c->scans[0].count;
    params.max_places = c->places;
    params.max_scans = c->count;
    params.max_place_beams = (c->count / c->places + 1) * c->scans[0].count;
    if (c->as_written)
        params.max_place_points = params.max_place_beams;
    bytes = cairn_scan_memory(&scan) + cairn_place_map_memory(&params) + CAIRN_ALIGN;
    c->memory = malloc(bytes);
    status = c->memory == NULL ? CAIRN_NO_MEMORY : cairn_pool_init(&pool, c->memory, bytes);
    if (status == CAIRN_OK)
        status = cairn_scan_create(&c->scan, &pool, &scan);
    return status == CAIRN_OK ? cairn_place_map_create(&c->map, &pool, &params) : status;
}

static void report(cairn_status status)
{
    fprintf(stderr, "bench/align: places: %s\n", cairn_status_text(status));
}

void bench_chain_close(bench_chain *c)
{
    if (c == NULL)
        return;
    free(c->memory);
    free(c->order);
    free(c);
}

bench_chain *bench_chain_open(const sim_scan *scans, int32_t count, int32_t as_written,
                              const double error[2], uint64_t seed)
{
    bench_chain *c = calloc(1, sizeof *c);
    cairn_status status = CAIRN_NO_MEMORY;

    if (c != NULL) {
        c->scans = scans;
        c->count = count;
        c->as_written = as_written;
        c->error = error;
        c->random = cairn_random_seed(seed, 80);
        c->order = malloc((size_t)count * sizeof *c->order);
        if (c->order != NULL)
            status = open_chain(c);
    }
    if (status == CAIRN_OK)
        return c;
    report(status);
    bench_chain_close(c);
    return NULL;
}

/* The known pose of a scan in its place: relative to the first one, or as written in the common
 * heading of all frames. */
static cairn_pose within_place(bench_chain *c, const sim_scan *first, const sim_scan *scan)
{
    sim_pose frame = first->truth, seen;
    cairn_pose pose;

    if (c->as_written)
        frame.theta = c->heading;
    seen = bench_pose_between(frame, scan->truth);
    if (scan != first) {
        seen.x += (double)cairn_random_uniform(&c->random, -1, 1) * c->error[0];
        seen.y += (double)cairn_random_uniform(&c->random, -1, 1) * c->error[0];
        seen.theta += (double)cairn_random_uniform(&c->random, -1, 1) * c->error[1] * CAIRN_DEGREE;
    }
    pose.x = (cairn_real)seen.x;
    pose.y = (cairn_real)seen.y;
    pose.theta = (cairn_real)seen.theta;
    return pose;
}

/* Gives the mapper the next place. The heading of its frame is that of the first scan of all,
 * +-2 degrees. */
static cairn_status give_place(bench_chain *c)
{
    const sim_scan *first = &c->scans[c->order[c->given]];
    cairn_status status = CAIRN_OK;

    c->heading = c->scans[c->order[0]].truth.theta;
    if (c->given > 0 && c->as_written)
        c->heading += (double)cairn_random_uniform(&c->random, -1, 1) *
                      (double)CAIRN_SCAN_MATCH_WRITTEN_HEADING;
    while (status == CAIRN_OK && c->given < c->count &&
           c->scans[c->order[c->given]].place == first->place) {
        const sim_scan *scan = &c->scans[c->order[c->given]];
        cairn_scan_view view;

        status = bench_fit_scan(c->scan, scan, &view);
        if (status == CAIRN_OK)
            status = cairn_place_map_add_scan(c->map, scan->place, &view,
                                              within_place(c, first, scan), NULL);
        c->given++;
    }
    return status;
}

static cairn_status step(bench_chain *c)
{
    cairn_status status;

    do {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        status = cairn_place_map_step(c->map, &budget);
    } while (status == CAIRN_MORE);
    return status;
}

static void read_poses(const bench_chain *c, int32_t first, bench_pose *poses)
{
    for (int32_t k = first; k < c->given; k++)
        poses[c->order[k]].pose = bench_sim_pose(cairn_place_map_scan_pose(c->map, k));
}

int32_t bench_chain_next(bench_chain *c, bench_pose *poses, const int32_t **order)
{
    int32_t first = c->given;
    cairn_status status;

    *order = c->order;
    if (c->given == c->count)
        return 0;
    status = give_place(c);
    if (status == CAIRN_OK)
        status = cairn_place_map_extend(c->map);
    if (status == CAIRN_OK)
        status = step(c);
    if (status != CAIRN_OK) {
        report(status);
        return -1;
    }
    read_poses(c, first, poses);
    return c->given;
}

cairn_status bench_chain_move(bench_chain *c, int32_t k, cairn_pose pose)
{
    return cairn_place_map_move_scan(c->map, k, pose);
}

int bench_chain_start(const sim_scan *scans, int32_t count, int32_t as_written,
                      const double error[2], uint64_t seed, bench_pose *poses)
{
    bench_chain *c = bench_chain_open(scans, count, as_written, error, seed);
    cairn_status status = CAIRN_OK;

    if (c == NULL)
        return 0;
    while (status == CAIRN_OK && c->given < count)
        status = give_place(c);
    if (status == CAIRN_OK)
        status = cairn_place_map_begin(c->map);
    if (status == CAIRN_OK)
        status = step(c);
    if (status == CAIRN_OK)
        read_poses(c, 0, poses);
    else
        report(status);
    bench_chain_close(c);
    return status == CAIRN_OK;
}
