/* Keyframe storage: local map selection, visibility profiles, input of force field and search.
 * mapper.c describes the method. */
#include "src/base/build.h"

#include <string.h>

#include "src/maps/mapper_work.h"

/* ---- The local map ---- */

static void take_local(cairn_mapper *mapper, int32_t keyframe, cairn_real distance)
{
    int32_t at = mapper->local_count;

    if (at == mapper->params.local_keyframes) {
        if (!(distance < mapper->local_distance[at - 1]))
            return;
        at--;
    } else {
        mapper->local_count++;
    }
    for (; at > 0 && distance < mapper->local_distance[at - 1]; at--) {
        mapper->local[at] = mapper->local[at - 1];
        mapper->local_distance[at] = mapper->local_distance[at - 1];
    }
    mapper->local[at] = keyframe;
    mapper->local_distance[at] = distance;
}

void cairn_mapper_begin_local(cairn_mapper *mapper)
{
    mapper->local_count = 0;
    mapper->cursor = 0;
}

/* Returns 1 when a keyframe is older than local_span and left out of the local map. */
static int32_t is_old(const cairn_mapper *mapper, int32_t keyframe)
{
    return mapper->params.local_span > 0 &&
           keyframe < mapper->keyframe_count - mapper->params.local_span;
}

/* The most recent keyframes get distance -1, which sorts them first. */
int32_t cairn_mapper_select_local(cairn_mapper *mapper)
{
    int32_t keyframe = mapper->keyframe_count - 1 - mapper->cursor;
    cairn_real x = mapper->keyframe_pose[keyframe].x - mapper->predicted.x;
    cairn_real y = mapper->keyframe_pose[keyframe].y - mapper->predicted.y;
    cairn_real distance = cairn_sqrt(x * x + y * y);

    if (mapper->cursor < mapper->params.local_recent)
        take_local(mapper, keyframe, -1);
    else if (distance <= mapper->params.local_radius)
        take_local(mapper, keyframe, distance);
    mapper->cursor++;
    return mapper->cursor == mapper->keyframe_count ||
           is_old(mapper, mapper->keyframe_count - 1 - mapper->cursor);
}

int32_t cairn_mapper_needs_local(const cairn_mapper *mapper)
{
    cairn_real x = mapper->predicted.x - mapper->target_pose.x,
               y = mapper->predicted.y - mapper->target_pose.y;

    return mapper->target_stale ||
           x * x + y * y > mapper->params.keyframe_distance * mapper->params.keyframe_distance;
}

cairn_scan_view cairn_mapper_keyframe_view(cairn_mapper *mapper, int32_t keyframe)
{
    const cairn_scan_set_scan *scan = cairn_mapper_keyframe_record(mapper, keyframe);
    cairn_scan_view view;

    memset(&view, 0, sizeof view);
    view.segment_count = scan->end_segment - scan->first_segment;
    view.point_count = cairn_mapper_keyframe_points(mapper, keyframe, mapper->points);
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

cairn_status cairn_mapper_add_local(cairn_mapper *mapper, cairn_budget *budget)
{
    int32_t keyframe = mapper->local[mapper->cursor];
    cairn_scan_view view = cairn_mapper_keyframe_view(mapper, keyframe);

    cairn_status status = cairn_icp_add_target(mapper->icp, view.points, view.point_count,
                                               mapper->keyframe_pose[keyframe], NULL);

    mapper->cursor++;
    budget->left -= 1 + view.point_count;
    if (status != CAIRN_FULL)
        return status;
    mapper->cursor = mapper->local_count; /* full; the nearest keyframes are in */
    return CAIRN_OK;
}

/* ---- Keyframes as input of a match ---- */

int32_t cairn_mapper_keyframe_points(const cairn_mapper *mapper, int32_t keyframe,
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

/* Sectors are even in the pseudo angle y / (|x| + |y|), which is monotonic in the angle and needs
 * no arc tangent. */
int32_t cairn_mapper_bearing_of(cairn_vec2 d)
{
    cairn_real sum = cairn_abs(d.x) + cairn_abs(d.y), turn; /* 0 ... 4, one unit per quadrant */

    if (!(sum > 0))
        return 0;
    turn = d.x >= 0 ? (d.y >= 0 ? d.y / sum : 4 + d.y / sum) : 2 - d.y / sum;
    return cairn_real_to_int(turn / 4 * MAPPER_BEARINGS) & (MAPPER_BEARINGS - 1);
}

cairn_vec2 cairn_mapper_bearing_direction(int32_t bearing)
{
    cairn_real turn = 4 * ((cairn_real)bearing + CAIRN_REAL(0.5)) / MAPPER_BEARINGS,
               within = turn - cairn_floor(turn);
    cairn_vec2 d = {1 - within, within};
    int32_t quarter = cairn_real_to_int(turn);

    for (; quarter > 0; quarter--)
        d = cairn_vec2_left_perp(d);
    return cairn_vec2_unit(d);
}

void cairn_mapper_store_visibility(cairn_mapper *mapper, int32_t keyframe,
                                   const cairn_scan_view *view)
{
    uint16_t *profile = &mapper->visibility[(size_t)mapper->slot[keyframe] * MAPPER_BEARINGS];

    memset(profile, 0, MAPPER_BEARINGS * sizeof *profile);
    for (int32_t i = 0; i < view->beam_count; i++) {
        cairn_vec2 d = cairn_vec2_sub(view->beams[i].to, view->sensor);
        int32_t bearing = cairn_mapper_bearing_of(d), range;

        if (view->beams[i].kind == CAIRN_SCAN_BEAM_UNKNOWN)
            continue;
        range = cairn_real_to_int(cairn_min(100 * cairn_vec2_norm(d), UINT16_MAX));
        if (range > 0 && (profile[bearing] == 0 || range < profile[bearing]))
            profile[bearing] = (uint16_t)range;
    }
}

int32_t cairn_mapper_visibility_beams(const cairn_mapper *mapper, int32_t keyframe,
                                      cairn_scan_beam *beams)
{
    const uint16_t *profile = &mapper->visibility[(size_t)mapper->slot[keyframe] * MAPPER_BEARINGS];
    cairn_vec2 sensor = cairn_mapper_keyframe_record(mapper, keyframe)->sensor;
    int32_t count = 0;

    for (int32_t i = 0; i < MAPPER_BEARINGS; i++) {
        if (profile[i] == 0)
            continue;
        beams[count].from = sensor;
        beams[count].to = cairn_vec2_add(sensor, cairn_vec2_scale(cairn_mapper_bearing_direction(i),
                                                                  (cairn_real)profile[i] / 100));
        beams[count].kind = CAIRN_SCAN_BEAM_HIT;
        count++;
    }
    return count;
}

cairn_scan_match_part cairn_mapper_keyframe_part(const cairn_mapper *mapper, int32_t keyframe,
                                                 cairn_oriented_point *points,
                                                 cairn_scan_beam *beams)
{
    cairn_scan_match_part part;

    memset(&part, 0, sizeof part);
    part.points = points;
    part.count = cairn_mapper_keyframe_points(mapper, keyframe, points);
    part.beams = beams;
    part.beam_count = cairn_mapper_visibility_beams(mapper, keyframe, beams);
    return part;
}
