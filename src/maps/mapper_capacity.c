/* Capacity for keyframes: whether one must or may be culled, and which ones.
 *
 * Method. Culling starts when max_keyframes / CULL_START_FRACTION further keyframes would not fit,
 * and stops when max_keyframes / CULL_STOP_FRACTION would (hysteresis). Those that the local map or the force field uses, and
 * those that loop-closure detection has not processed, are not culled. */
#include "src/base/build.h"

#include "src/maps/mapper_work.h"

enum { CULL_START_FRACTION = 32, CULL_STOP_FRACTION = 16 };

/* Returns 1 when there is capacity for the largest scan and for `others` scans of average size. */
static int32_t has_capacity(const cairn_mapper *mapper, int32_t others)
{
    const cairn_mapper_params *p = &mapper->params;
    const cairn_scan_set *set = mapper->keyframes;
    int32_t count = mapper->keyframe_count > 0 ? mapper->keyframe_count : 1;

    return mapper->keyframe_count + others < p->max_keyframes &&
           set->segment_count + (int64_t)others * (set->segment_count / count) <=
               p->max_keyframe_segments - p->scan.max_segments &&
           set->point_count + (int64_t)others * (set->point_count / count) <=
               p->max_keyframe_points - p->scan.max_points;
}

int32_t cairn_mapper_cull_end(const cairn_mapper *mapper)
{
    int32_t end = mapper->keyframe_count - cairn_mapper_protected_count(&mapper->params);
    int32_t of_loops = mapper->loop.graph_keyframes - mapper->params.loop.min_keyframe_gap;

    return end < of_loops ? end : of_loops;
}

int32_t cairn_mapper_must_cull(const cairn_mapper *mapper)
{
    return mapper->params.cull_keyframes && !has_capacity(mapper, 0);
}

int32_t cairn_mapper_may_cull(cairn_mapper *mapper)
{
    mapper_loop *loop = &mapper->loop;
    int32_t parts = loop->culling ? CULL_STOP_FRACTION : CULL_START_FRACTION;

    loop->culling = mapper->params.cull_keyframes &&
                    !has_capacity(mapper, mapper->params.max_keyframes / parts);
    return loop->culling && cairn_mapper_cull_end(mapper) > 1 &&
           mapper->keyframe_count - loop->graph_keyframes <=
               cairn_mapper_protected_count(&mapper->params);
}

int32_t cairn_mapper_loops_lag(const cairn_mapper *mapper)
{
    return mapper->params.cull_keyframes && mapper->keyframe_count - mapper->loop.graph_keyframes >
                                                cairn_mapper_protected_count(&mapper->params) / 2;
}
