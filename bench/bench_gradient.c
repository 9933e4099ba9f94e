#include "bench/bench_gradient.h"

#include <stdio.h>
#include <stdlib.h>

#include "bench/bench_json.h"
#include "bench/bench_score.h"
#include "cairn/force_field.h"
#include "src/host/maps/capacity.h"

/* The field, and two for P(g) of given poses, before and after an iteration. */
enum { FIELD, BEFORE, AFTER, FIELDS };

typedef struct simulation {
    const sim_scan *scans;
    int32_t count, online;
    bench_chain *chain; /* NULL: the scans are added one by one */
    cairn_scan_params scan_params;
    cairn_force_field_params params, probe_params;
    cairn_scan *scan;
    cairn_force_field *field[FIELDS];
    void *memory;
    double stepped;                    /* s, in iterations */
    double point_pairs, segment_pairs; /* sums over the iterations */
    int32_t steps, rising, corners_dropped;
} simulation;

/* Force field simulation as in the thesis with the capacities for the scans. */
static cairn_status set_params(simulation *s, int32_t iterations)
{
    cairn_capacity_scans sizes = {s->count, s->scan_params.max_beams, 1, 1};
    size_t bytes = cairn_scan_memory(&s->scan_params) + CAIRN_ALIGN;
    void *memory = malloc(bytes);
    cairn_scan *scan = NULL;
    cairn_pool pool;
    cairn_status status = memory == NULL ? CAIRN_NO_MEMORY : cairn_pool_init(&pool, memory, bytes);

    if (status == CAIRN_OK)
        status = cairn_scan_create(&scan, &pool, &s->scan_params);
    for (int32_t i = 0; i < s->count && status == CAIRN_OK; i++) {
        cairn_scan_view view;

        status = bench_fit_scan(scan, &s->scans[i], &view);
        sizes.segments += view.segment_count;
        sizes.points += view.point_count;
    }
    s->params = cairn_capacity_force_field(&sizes, iterations);
    free(memory);
    return status;
}

/* The pool holds the scan and the field, then, without online, the two fields for P(g). *bytes: of
 * the first two. */
static cairn_status open_fields(simulation *s, size_t *bytes)
{
    int32_t fields = s->online ? BEFORE : FIELDS;
    cairn_pool pool;
    cairn_status status;
    size_t all;

    s->probe_params = s->params;
    s->probe_params.roi = CAIRN_FORCE_FIELD_ROI_NONE;
    s->probe_params.stop_relocation = 0;
    *bytes = cairn_force_field_memory(&s->params) + cairn_scan_memory(&s->scan_params);
    all = *bytes + 2 * cairn_force_field_memory(&s->probe_params) + CAIRN_ALIGN;
    s->memory = malloc(all);
    status = s->memory == NULL ? CAIRN_NO_MEMORY : cairn_pool_init(&pool, s->memory, all);
    if (status == CAIRN_OK)
        status = cairn_scan_create(&s->scan, &pool, &s->scan_params);
    for (int32_t k = 0; k < fields && status == CAIRN_OK; k++)
        status = cairn_force_field_create(&s->field[k], &pool,
                                          k == FIELD ? &s->params : &s->probe_params);
    return status;
}

/* P of the field's poses at the sigma of the iteration that the probe has not yet done. */
static cairn_status look(const simulation *s, cairn_force_field *probe, cairn_real *potential)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_status status = CAIRN_OK;

    for (int32_t i = 0; i < s->count && status == CAIRN_OK; i++)
        status = cairn_force_field_place(probe, i, cairn_force_field_pose(s->field[FIELD], i));
    if (status == CAIRN_OK)
        status = cairn_force_field_iterate(probe, &budget);
    *potential = cairn_force_field_read(probe).potential;
    return status;
}

/* Iterates until the field converges. */
static cairn_status run_field(simulation *s)
{
    cairn_force_field_state state;
    cairn_status status = CAIRN_OK;

    do {
        cairn_budget budget = {CAIRN_UNBOUNDED};
        cairn_real before = 0, after = 0;
        double start;

        if (!s->online)
            status = look(s, s->field[BEFORE], &before);
        start = bench_cpu_seconds();
        if (status >= 0)
            status = cairn_force_field_iterate(s->field[FIELD], &budget);
        s->stepped += bench_cpu_seconds() - start;
        s->steps++;
        if (status >= 0 && !s->online)
            status = look(s, s->field[AFTER], &after);
        s->rising += after > before;
        state = cairn_force_field_read(s->field[FIELD]);
        s->point_pairs += (double)state.pairs;
        s->segment_pairs += (double)state.segment_pairs;
        if (state.corners_dropped > s->corners_dropped)
            s->corners_dropped = state.corners_dropped;
    } while (status >= 0 && state.verdict == CAIRN_FORCE_FIELD_RUNNING);
    return status < 0 ? status : CAIRN_OK;
}

static cairn_status add_scan(simulation *s, int32_t i, const bench_pose *poses)
{
    cairn_scan_view view;
    cairn_status status = bench_fit_scan(s->scan, &s->scans[i], &view);

    for (int32_t k = 0; k < FIELDS && status == CAIRN_OK; k++)
        if (s->field[k] != NULL)
            status = cairn_force_field_add_scan(s->field[k], &view, NULL,
                                                bench_cairn_pose(poses[i].pose), NULL);
    return status;
}

/* Place after place, each matched by shape with those before it; the poses when the field has
 * converged. */
static cairn_status simulate_chain(simulation *s, bench_pose *poses)
{
    cairn_status status = CAIRN_OK;
    const int32_t *order;
    int32_t before = 0, given;

    while (status == CAIRN_OK && (given = bench_chain_next(s->chain, poses, &order)) > 0) {
        for (; before < given && status == CAIRN_OK; before++)
            status = add_scan(s, order[before], poses);
        cairn_force_field_restart(s->field[FIELD]);
        if (status == CAIRN_OK)
            status = run_field(s);
        for (int32_t k = 0; k < given && status == CAIRN_OK; k++) {
            cairn_pose pose = cairn_force_field_pose(s->field[FIELD], k);

            poses[order[k]].pose = bench_sim_pose(pose);
            status = bench_chain_move(s->chain, k, pose);
        }
    }
    return status == CAIRN_OK && before < s->count ? CAIRN_BAD_ARGUMENT : status;
}

/* Adds all scans and runs the field; the poses when it has converged. */
static cairn_status simulate(simulation *s, bench_pose *poses)
{
    cairn_status status = CAIRN_OK;

    for (int32_t i = 0; i < s->count && status == CAIRN_OK; i++) {
        status = add_scan(s, i, poses);
        if (!s->online || status != CAIRN_OK)
            continue;
        cairn_force_field_restart(s->field[FIELD]);
        status = run_field(s);
    }
    if (status == CAIRN_OK && !s->online)
        status = run_field(s);
    for (int32_t i = 0; i < s->count && status == CAIRN_OK; i++)
        poses[i].pose = bench_sim_pose(cairn_force_field_pose(s->field[FIELD], i));
    return status;
}

int bench_run_gradient(const sim_scan *scans, int32_t count, int32_t iterations, int32_t online,
                       bench_chain *chain, bench_pose *poses, bench_run *run)
{
    simulation s = {.scans = scans, .count = count, .online = online, .chain = chain};
    cairn_status status;
    size_t bytes = 0;

    s.scan_params = cairn_scan_default();
    s.scan_params.max_beams = scans[0].count;
    status = set_params(&s, iterations);
    if (status == CAIRN_OK)
        status = open_fields(&s, &bytes);
    if (status == CAIRN_OK)
        status = chain != NULL ? simulate_chain(&s, poses) : simulate(&s, poses);
    if (status != CAIRN_OK)
        fprintf(stderr, "bench/align: %s\n", cairn_status_text(status));
    run->steps = s.steps;
    run->rising = s.rising;
    run->seconds = s.stepped;
    run->step_ms = 1e3 * s.stepped / (s.steps > 0 ? s.steps : 1);
    run->point_pairs = s.point_pairs / (s.steps > 0 ? s.steps : 1);
    run->segment_pairs = s.segment_pairs / (s.steps > 0 ? s.steps : 1);
    run->corners_dropped = s.corners_dropped;
    run->pool_bytes = bytes;
    free(s.memory);
    return status == CAIRN_OK;
}
