/* Key scans on their way into the local map and into the force field. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/mapper_keys.h"

/* ---- The local map ---- */

static void take_local(cairn_mapper *mapper, int32_t key, cairn_real distance)
{
    int32_t at = mapper->local_count;

    if (at == mapper->params.local_keys) {
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
    mapper->local[at] = key;
    mapper->local_distance[at] = distance;
}

void cairn_mapper_begin_local(cairn_mapper *mapper)
{
    mapper->local_count = 0;
    mapper->cursor = 0;
}

/* The last key scans count as at distance -1. */
int32_t cairn_mapper_select_local(cairn_mapper *mapper)
{
    int32_t key = mapper->keys->scan_count - 1 - mapper->cursor;
    cairn_real x = mapper->key_pose[key].x - mapper->predicted.x;
    cairn_real y = mapper->key_pose[key].y - mapper->predicted.y;
    cairn_real distance = cairn_sqrt(x * x + y * y);

    if (mapper->cursor < mapper->params.local_recent)
        take_local(mapper, key, -1);
    else if (distance <= mapper->params.local_radius)
        take_local(mapper, key, distance);
    mapper->cursor++;
    return mapper->cursor == mapper->keys->scan_count;
}

int32_t cairn_mapper_needs_local(const cairn_mapper *mapper)
{
    cairn_real x = mapper->predicted.x - mapper->target_pose.x, y = mapper->predicted.y - mapper->target_pose.y;

    return mapper->target_stale || x * x + y * y > mapper->params.key_distance * mapper->params.key_distance;
}

/* A key scan as it was when it came, but without its beams; valid until the next call. */
static cairn_scan_view key_view(cairn_mapper *mapper, int32_t key)
{
    const cairn_scan_set_scan *scan = &mapper->keys->scans[key];
    cairn_scan_view view;
    int32_t count = 0;

    memset(&view, 0, sizeof view);
    for (int32_t s = scan->first_segment; s < scan->end_segment; s++) {
        const cairn_scan_set_segment *segment = &mapper->keys->segments[s];

        mapper->segments[s - scan->first_segment] = segment->segment;
        mapper->first_point[s - scan->first_segment] = count;
        for (int32_t p = segment->first_point; p < segment->end_point; p++) {
            mapper->oriented[count].position = mapper->keys->points[p];
            mapper->oriented[count].direction = segment->direction;
            count++;
        }
    }
    view.segment_count = scan->end_segment - scan->first_segment;
    view.point_count = count;
    mapper->first_point[view.segment_count] = count;
    view.segments = mapper->segments;
    view.first_point = mapper->first_point;
    view.points = mapper->oriented;
    view.sensor = scan->sensor;
    return view;
}

cairn_status cairn_mapper_add_local(cairn_mapper *mapper, cairn_budget *budget)
{
    int32_t key = mapper->local[mapper->cursor];
    cairn_scan_view view = key_view(mapper, key);

    mapper->cursor++;
    budget->left -= 1 + view.point_count / 2;
    return cairn_icp_add_target(mapper->icp, view.points, view.point_count, mapper->key_pose[key], NULL);
}

/* ---- The force field over the last key scans ---- */

int32_t cairn_mapper_window_count(const cairn_mapper *mapper)
{
    int32_t keys = mapper->keys->scan_count;

    return keys < mapper->params.window ? keys : mapper->params.window;
}

cairn_status cairn_mapper_add_window(cairn_mapper *mapper, cairn_budget *budget)
{
    int32_t count = cairn_mapper_window_count(mapper);
    int32_t key = mapper->keys->scan_count - count + mapper->cursor;
    cairn_scan_view view = key_view(mapper, key);
    cairn_status status = cairn_force_field_add_scan(mapper->field, &view, NULL, mapper->key_pose[key], NULL);

    /* The first one always stays: something must hold the window in its place. */
    if (status == CAIRN_OK && (mapper->cursor == 0 || mapper->cursor < count - mapper->params.window_free))
        status = cairn_force_field_fix(mapper->field, mapper->cursor, 1);
    budget->left -= 2 + view.point_count / 2;
    mapper->cursor++;
    return status;
}

void cairn_mapper_read_window(cairn_mapper *mapper)
{
    int32_t count = cairn_mapper_window_count(mapper), first = mapper->keys->scan_count - count;

    for (int32_t i = 0; i < count; i++)
        mapper->key_pose[first + i] = cairn_force_field_pose(mapper->field, i);
    mapper->result.map_scan = mapper->key_pose[mapper->keys->scan_count - 1];
    mapper->state.potential = cairn_force_field_potential(mapper->field);
}
