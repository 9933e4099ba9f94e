/* Keyframe storage: local map selection, visibility profiles, input of force field and search.
 * mapper.c describes the method. */
#include "src/base/build.h"

#include <string.h>

#include "src/base/step.h"
#include "src/containers/ranked_list.h"
#include "src/maps/mapper_work.h"

/* m: resolution of the ranges of a visibility profile */
static const cairn_real VISIBILITY_STEP_M = CAIRN_REAL(0.01);

/* ---- Keyframes ---- */

cairn_pose cairn_mapper_relative_pose(const cairn_mapper *mapper, int32_t first, int32_t second)
{
    return cairn_pose_between(mapper->keyframe_pose[first], mapper->keyframe_pose[second]);
}

int32_t cairn_mapper_point_count(const cairn_mapper *mapper, int32_t keyframe)
{
    const cairn_scan_set_scan *scan = cairn_mapper_keyframe_record(mapper, keyframe);

    return scan->end_point - scan->first_point;
}

/* ---- The local map ---- */

void cairn_mapper_add_neighbour(mapper_neighbour *list, int32_t *count, int32_t capacity,
                                mapper_neighbour neighbour)
{
    const ranked_list nearest = {.entries = list,
                                 .count = count,
                                 .capacity = capacity,
                                 .entry_bytes = sizeof *list,
                                 .score_at = offsetof(mapper_neighbour, distance),
                                 .least_first = 1};

    (void)ranked_list_add(&nearest, &neighbour);
}

/* Returns the oldest keyframe that the local map may use. */
static int32_t oldest_local(const cairn_mapper *mapper)
{
    int32_t oldest = mapper->keyframe_count - mapper->params.local_span;

    return mapper->params.local_span > 0 && oldest > 0 ? oldest : 0;
}

/* Lists a keyframe if it is near the predicted pose. The most recent keyframes get distance -1,
 * which sorts them first. */
static void select_local(cairn_mapper *mapper, int32_t keyframe)
{
    cairn_real x = mapper->keyframe_pose[keyframe].x - mapper->current.predicted.x;
    cairn_real y = mapper->keyframe_pose[keyframe].y - mapper->current.predicted.y;
    cairn_real distance = cairn_sqrt(x * x + y * y);

    if (keyframe >= mapper->keyframe_count - mapper->params.local_recent)
        distance = -1;
    if (distance <= mapper->params.local_radius)
        cairn_mapper_add_neighbour(mapper->target.keyframes, &mapper->target.count,
                                   mapper->params.local_keyframes,
                                   (mapper_neighbour){distance, keyframe});
}

int32_t cairn_mapper_needs_local(const cairn_mapper *mapper)
{
    cairn_real x = mapper->current.predicted.x - mapper->target.pose.x,
               y = mapper->current.predicted.y - mapper->target.pose.y;

    return mapper->target.is_stale ||
           x * x + y * y > mapper->params.keyframe_distance * mapper->params.keyframe_distance;
}

/* ---- Keyframes as input of a match ---- */

/* Copies the points of a keyframe, in its own frame; returns their number. */
static int32_t keyframe_points(const cairn_mapper *mapper, int32_t keyframe,
                               cairn_oriented_point *points)
{
    const cairn_scan_set_scan *scan = cairn_mapper_keyframe_record(mapper, keyframe);
    int32_t count = 0;

    for (int32_t s = scan->first_segment; s < scan->end_segment; s++) {
        const cairn_scan_set_segment *segment = &mapper->keyframes->segments[s];

        for (int32_t p = segment->first_point; p < segment->end_point; p++) {
            points[count].position = mapper->keyframes->points[p];
            points[count].direction = segment->direction;
            count++;
        }
    }
    return count;
}

cairn_scan_view cairn_mapper_keyframe_view(cairn_mapper *mapper, int32_t keyframe)
{
    const cairn_scan_set_scan *scan = cairn_mapper_keyframe_record(mapper, keyframe);
    cairn_scan_view view;

    memset(&view, 0, sizeof view);
    view.segment_count = scan->end_segment - scan->first_segment;
    view.point_count = keyframe_points(mapper, keyframe, mapper->points);
    for (int32_t s = 0; s < view.segment_count; s++) {
        const cairn_scan_set_segment *segment =
            &mapper->keyframes->segments[scan->first_segment + s];

        mapper->segments[s] = segment->segment;
        mapper->first_point[s] = segment->first_point - scan->first_point;
    }
    mapper->first_point[view.segment_count] = view.point_count;
    view.segments = mapper->segments;
    view.first_point = mapper->first_point;
    view.points = mapper->points;
    view.sensor = scan->sensor;
    return view;
}

/* Returns the next keyframe of the local map to add. */
static int32_t next_local(const cairn_mapper *mapper)
{
    return mapper->target.keyframes[mapper->target.entry].keyframe;
}

/* Adds the next keyframe to the local map; returns 0 when it is full. */
static int add_local(cairn_mapper *mapper)
{
    int32_t keyframe = next_local(mapper);
    cairn_scan_view view = cairn_mapper_keyframe_view(mapper, keyframe);

    return cairn_icp_add_target(mapper->icp, view.points, view.point_count,
                                mapper->keyframe_pose[keyframe], NULL) == CAIRN_OK;
}

/* Returns the cost of clearing the local map, a multiple of its capacity. */
static int32_t clear_units(const cairn_mapper *mapper)
{
    return 1 + cairn_mapper_local_points(&mapper->params, mapper->params.local_keyframes) / 64;
}

int cairn_mapper_build_local(cairn_mapper *mapper, cairn_budget *budget)
{
    mapper_target *target = &mapper->target;

    CAIRN_STEP_BEGIN(target->resume);
    target->count = 0;
    for (target->keyframe = mapper->keyframe_count - 1; target->keyframe >= oldest_local(mapper);
         target->keyframe--) {
        CAIRN_STEP_CHARGE_UNIT(target, resume, budget);
        select_local(mapper, target->keyframe);
    }
    CAIRN_STEP_CHARGE(target, resume, budget, clear_units(mapper));
    cairn_icp_clear_target(mapper->icp);
    for (target->entry = 0; target->entry < target->count; target->entry++) {
        CAIRN_STEP_CHARGE(target, resume, budget,
                          1 + cairn_mapper_point_count(mapper, next_local(mapper)));
        if (!add_local(mapper))
            break; /* full; the nearest keyframes are in */
    }
    target->is_stale = 0;
    target->pose = mapper->current.predicted;
    target->search_count = 0;
    CAIRN_STEP_END(target->resume);
}

cairn_visibility cairn_mapper_visibility(const cairn_mapper *mapper, int32_t keyframe)
{
    cairn_visibility visibility = {
        .sensor = cairn_mapper_keyframe_record(mapper, keyframe)->sensor,
        .step = VISIBILITY_STEP_M,
        .range = &mapper->visibility[(size_t)mapper->slot[keyframe] * CAIRN_VISIBILITY_BINS],
        .surface = NULL,
        .bins = CAIRN_VISIBILITY_BINS,
        .max_gap = 0,
        .last = -1,
    };

    return visibility;
}

cairn_scan_match_part cairn_mapper_keyframe_part(const cairn_mapper *mapper, int32_t keyframe,
                                                 cairn_oriented_point *points)
{
    cairn_scan_match_part part = {
        .points = points,
        .count = keyframe_points(mapper, keyframe, points),
    };

    return part;
}

int cairn_mapper_add_search_target(cairn_mapper *mapper, int32_t keyframe)
{
    cairn_scan_match_part part = cairn_mapper_keyframe_part(mapper, keyframe, mapper->points);
    cairn_visibility visibility = cairn_mapper_visibility(mapper, keyframe);
    cairn_pose pose = mapper->keyframe_pose[keyframe];

    return cairn_scan_match_add_target(mapper->search, &part, pose, NULL) == CAIRN_OK &&
           cairn_scan_match_add_view(mapper->search, &visibility, pose, NULL) == CAIRN_OK;
}
