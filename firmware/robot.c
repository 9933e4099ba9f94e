/* Robot: scheduler of line fitting, alignment, joint optimization and grid mapping in bounded
 * ticks.
 *
 * Limits: the initial poses of the sweeps must lie within the force field's basin of convergence.
 * The grid is redrawn repeatedly; between two complete drawings it is partial. */
#include "src/base/build.h"

#include <string.h>

#include "firmware/robot.h"

/* The grid gets one of every GRID_INTERVAL_TICKS ticks. */
enum { GRID_INTERVAL_TICKS = 8 };

cairn_status robot_create(robot *r, void *memory, size_t bytes, const robot_params *params)
{
    cairn_status status;

    if (params->field.max_scans > ROBOT_SCANS || params->joint.max_scans != params->field.max_scans)
        return CAIRN_BAD_ARGUMENT;
    memset(r, 0, sizeof *r);
    r->params = *params;
    r->aligned = r->solved = 1;
    status = cairn_pool_init(&r->pool, memory, bytes);
    if (status == CAIRN_OK)
        status = cairn_scan_create(&r->scan, &r->pool, &params->scan);
    if (status == CAIRN_OK)
        status = cairn_force_field_create(&r->field, &r->pool, &params->field);
    if (status == CAIRN_OK)
        status = cairn_occupancy_grid_create(&r->grid, &r->pool, &params->grid);
    if (status == CAIRN_OK)
        status = joint_create(&r->joint, &r->pool, &params->joint);
    return status;
}

cairn_status robot_offer(robot *r, const robot_sweep *sweep)
{
    if (r->offered > r->taken || r->fitting)
        return CAIRN_MORE;
    if (r->offered == r->params.field.max_scans)
        return CAIRN_FULL;
    r->sweep[r->offered++] = *sweep;
    return CAIRN_OK;
}

void robot_finish(robot *r)
{
    r->finished = 1;
}

static cairn_status take_in(robot *r)
{
    const robot_sweep *sweep = &r->sweep[r->taken];
    cairn_scan_input input = {
        .range = sweep->range,
        .count = sweep->count,
        .angle_min = sweep->angle_min,
        .angle_step = sweep->angle_step,
        .range_max = r->params.range_max,
        .range_sigma = r->params.range_sigma,
    };
    cairn_status status = cairn_scan_begin(r->scan, &input, NULL);

    if (status == CAIRN_OK) {
        r->taken++;
        r->fitting = 1;
    }
    return status;
}

static cairn_status fit(robot *r, cairn_budget *budget)
{
    cairn_status status = cairn_scan_step(r->scan, budget);
    cairn_scan_view view;

    if (status != CAIRN_OK)
        return status;
    view = cairn_scan_read(r->scan);
    status = cairn_force_field_add_scan(r->field, &view, NULL, r->sweep[r->taken - 1].pose, NULL);
    if (status == CAIRN_OK && r->taken == 1)
        status = cairn_force_field_fix(r->field, 0, 1);
    if (status != CAIRN_OK)
        return status;
    cairn_force_field_restart(r->field);
    r->fitting = r->aligned = r->solving = r->solved = 0;
    return CAIRN_OK;
}

static cairn_status pair(robot *r, cairn_budget *budget)
{
    cairn_status status = cairn_force_field_step(r->field, budget);

    r->aligned = status == CAIRN_OK;
    return status;
}

cairn_pose robot_pose(const robot *r, int32_t scan)
{
    return r->solved ? r->joint.poses[scan] : cairn_force_field_pose(r->field, scan);
}

static cairn_status solve(robot *r, cairn_budget *budget)
{
    cairn_status status = CAIRN_OK;

    if (!r->solving) {
        cairn_pose poses[ROBOT_SCANS];
        int32_t count = cairn_force_field_pose_count(r->field);

        for (int32_t i = 0; i < count; i++)
            poses[i] = cairn_force_field_pose(r->field, i);
        status = joint_begin(&r->joint, cairn_force_field_scans(r->field), poses, NULL, count);
        r->solving = status == CAIRN_OK;
    }
    if (status == CAIRN_OK)
        status = joint_step(&r->joint, budget);
    r->solved = status == CAIRN_OK;
    return status;
}

/* Draws a beam into the grid. A beam without a return is free up to the maximum range. Cost: four
 * units plus one per cell length. */
static cairn_status draw_beam(robot *r, const robot_sweep *sweep, cairn_pose pose, int32_t beam,
                              cairn_budget *budget)
{
    cairn_real range = (cairn_real)sweep->range[beam], most = (cairn_real)r->params.range_max;
    cairn_real angle = pose.theta + (cairn_real)sweep->angle_min +
                       (cairn_real)beam * (cairn_real)sweep->angle_step;
    cairn_real length = cairn_min(range, most), sine, cosine;
    cairn_vec2 from = {pose.x, pose.y}, to;

    budget->left -= 4;
    if (!(range > 0))
        return CAIRN_OK;
    budget->left -= cairn_real_to_int(length / r->params.grid.resolution);
    cairn_sincos(angle, &sine, &cosine);
    to.x = from.x + length * cosine;
    to.y = from.y + length * sine;
    return cairn_occupancy_grid_add_beam(r->grid, from, to, range <= most);
}

static cairn_status draw(robot *r, cairn_budget *budget)
{
    int32_t count = cairn_force_field_pose_count(r->field);
    cairn_status status = cairn_occupancy_grid_step(r->grid, budget);

    while (status == CAIRN_OK && budget->left > 0 && r->drawn < count) {
        const robot_sweep *sweep = &r->sweep[r->drawn];

        status = draw_beam(r, sweep, robot_pose(r, r->drawn), r->beam, budget);
        if (++r->beam == sweep->count) {
            r->beam = 0;
            r->drawn++;
        }
    }
    if (status != CAIRN_OK || r->drawn < count)
        return status < 0 ? status : CAIRN_MORE;
    r->done = r->last;
    if (!r->done) {
        r->last = r->finished && r->solved && r->taken == r->offered && !r->fitting;
        r->drawn = 0;
        cairn_occupancy_grid_clear(r->grid);
    }
    return CAIRN_OK;
}

static robot_work next_work(const robot *r)
{
    int32_t drawable = cairn_force_field_pose_count(r->field) > 0 && !r->done;

    if (!r->fitting && r->taken < r->offered)
        return ROBOT_ADD;
    if (drawable && r->ticks % GRID_INTERVAL_TICKS == GRID_INTERVAL_TICKS - 1)
        return ROBOT_GRID;
    if (r->fitting)
        return ROBOT_FIT;
    if (!r->aligned)
        return ROBOT_PAIR;
    if (!r->solved)
        return ROBOT_SOLVE;
    return drawable ? ROBOT_GRID : ROBOT_IDLE;
}

cairn_status robot_tick(robot *r, cairn_budget *budget, robot_work *work)
{
    cairn_status status = CAIRN_OK;

    *work = next_work(r);
    if (*work == ROBOT_ADD)
        status = take_in(r);
    else if (*work == ROBOT_FIT)
        status = fit(r, budget);
    else if (*work == ROBOT_PAIR)
        status = pair(r, budget);
    else if (*work == ROBOT_SOLVE)
        status = solve(r, budget);
    else if (*work == ROBOT_GRID)
        status = draw(r, budget);
    r->ticks++;
    if (status < 0)
        return status;
    return r->done ? CAIRN_OK : CAIRN_MORE;
}

uint32_t robot_hash(const robot *r, uint32_t hash)
{
    cairn_force_field_state state = cairn_force_field_read(r->field);

    for (int32_t i = 0; i < cairn_force_field_pose_count(r->field); i++) {
        cairn_pose pose = robot_pose(r, i);

        hash = hash_words(hash, &pose, sizeof pose);
        hash = hash_words(hash, r->joint.covariances[i], sizeof r->joint.covariances[i]);
    }
    hash = hash_words(hash, &state.potential, sizeof state.potential);
    for (int32_t y = 0; y < r->params.grid.height; y++)
        for (int32_t x = 0; x < r->params.grid.width; x++) {
            cairn_occupancy_grid_cell_state cell = cairn_occupancy_grid_cell(r->grid, x, y);

            hash = hash_words(hash, &cell, sizeof cell);
        }
    return hash;
}
