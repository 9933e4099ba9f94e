/* The mapper in the main loop of a robot. */
#include "src/base/build.h"

#include <string.h>

#include "firmware/surveyor.h"

cairn_status surveyor_create(surveyor *s, void *memory, size_t bytes, const surveyor_params *params)
{
    cairn_status status;

    memset(s, 0, sizeof *s);
    s->params = *params;
    status = cairn_pool_init(&s->pool, memory, bytes);
    return status == CAIRN_OK ? cairn_mapper_create(&s->mapper, &s->pool, &params->mapper) : status;
}

cairn_status surveyor_offer(surveyor *s, const robot_sweep *sweep)
{
    if (s->queued)
        return CAIRN_MORE;
    s->sweep = *sweep;
    s->queued = 1;
    return CAIRN_OK;
}

void surveyor_finish(surveyor *s)
{
    s->finished = 1;
}

static cairn_status take_in(surveyor *s)
{
    cairn_scan_input input = {
        .range = s->sweep.range,
        .count = s->sweep.count,
        .angle_min = s->sweep.angle_min,
        .angle_step = s->sweep.angle_step,
        .range_max = s->params.range_max,
        .range_sigma = s->params.range_sigma,
    };
    cairn_status status = cairn_mapper_add(s->mapper, &input, &s->sweep.pose, NULL);

    if (status == CAIRN_BUSY) {
        /* The previous sweep is not complete: its mapping continues, this sweep stays queued. */
        s->mapping = 1;
        return CAIRN_MORE;
    }
    s->queued = 0;
    if (status != CAIRN_MORE)
        return status;
    s->mapping = 1;
    s->taken++;
    return CAIRN_OK;
}

static surveyor_work next_work(const surveyor *s)
{
    if (s->mapping)
        return SURVEYOR_MAP;
    if (s->queued)
        return SURVEYOR_ADD;
    return s->finished && !s->done ? SURVEYOR_SETTLE : SURVEYOR_IDLE;
}

cairn_status surveyor_tick(surveyor *s, cairn_budget *budget, surveyor_work *work)
{
    cairn_status status = CAIRN_OK;

    *work = next_work(s);
    if (*work == SURVEYOR_MAP) {
        status = cairn_mapper_step(s->mapper, budget);
        s->mapping = status == CAIRN_MORE;
    } else if (*work == SURVEYOR_ADD) {
        status = take_in(s);
    } else if (*work == SURVEYOR_SETTLE) {
        status = cairn_mapper_settle(s->mapper, budget);
        s->done = status == CAIRN_OK;
    }
    s->ticks++;
    if (status < 0)
        return status;
    return s->done ? CAIRN_OK : CAIRN_MORE;
}

uint32_t surveyor_hash(const surveyor *s, uint32_t hash)
{
    cairn_mapper_result result = cairn_mapper_read(s->mapper);

    hash = hash_words(hash, &result.map_scan, sizeof result.map_scan);
    hash = hash_words(hash, result.covariance, sizeof result.covariance);
    for (int32_t key = 0; key < cairn_mapper_measure(s->mapper).keyframes; key++) {
        cairn_pose pose = cairn_mapper_keyframe_pose(s->mapper, key);

        hash = hash_words(hash, &pose, sizeof pose);
    }
    return hash;
}
