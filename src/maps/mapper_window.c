/* Sliding-window refinement: the force field over the last keyframes (Adluru 2008, section 7.3.6,
 * online FFS).
 *
 * Method. A run starts with every new keyframe and takes a share of the units of each scan that
 * follows. Its poses are applied when it has converged, or as far as it came when the next keyframe
 * arrives. Loop closure rests meanwhile, so no graph optimization comes between.
 *
 * Limits: where the points of the window exceed max_local_points, its oldest keyframes are left
 * out. A keyframe beyond the force field's range (1e6 m) cancels the run. */
#include "src/base/build.h"

#include "src/maps/mapper_work.h"

/* Returns the first keyframe of the window: as many of the last keyframes as fit with their
 * points. */
static int32_t window_begin(const cairn_mapper *mapper)
{
    int32_t end = mapper->keyframe_count, first = end - 1,
            points = cairn_mapper_point_count(mapper, first);
    int32_t capacity = cairn_mapper_local_points(&mapper->params, mapper->params.window);

    for (; first > 0 && end - first < mapper->params.window; first--) {
        points += cairn_mapper_point_count(mapper, first - 1);
        if (points > capacity)
            break;
    }
    return first;
}

void cairn_mapper_begin_window(cairn_mapper *mapper)
{
    mapper->window.end = mapper->keyframe_count;
    mapper->window.first = mapper->window.cursor = window_begin(mapper);
    mapper->window.phase = MAPPER_WINDOW_FILL;
    cairn_force_field_clear(mapper->field);
}

/* Adds the keyframe at the cursor. */
static cairn_status fill_item(cairn_mapper *mapper, cairn_budget *budget)
{
    int32_t keyframe = mapper->window.cursor++;
    cairn_scan_view view = cairn_mapper_keyframe_view(mapper, keyframe);
    cairn_status status = cairn_force_field_add_scan(mapper->field, &view, NULL,
                                                     mapper->keyframe_pose[keyframe], NULL);

    /* The first keyframe is always fixed, which removes the gauge freedom of the window. Those with
     * links in the graph are fixed as well. */
    if (status == CAIRN_OK && (keyframe == mapper->window.first ||
                               keyframe < mapper->window.end - mapper->params.window_free ||
                               keyframe < mapper->loop.graph_keyframes))
        status = cairn_force_field_fix(mapper->field, keyframe - mapper->window.first, 1);
    cairn_budget_spend(budget, 2 + view.point_count / 2);
    if (mapper->window.cursor == mapper->window.end)
        mapper->window.phase = MAPPER_WINDOW_RUN;
    if (status == CAIRN_BAD_ARGUMENT) {
        mapper->window.phase = MAPPER_WINDOW_IDLE;
        return CAIRN_OK;
    }
    return status;
}

void cairn_mapper_read_window(cairn_mapper *mapper)
{
    int32_t count = cairn_force_field_pose_count(mapper->field);

    for (int32_t i = 0; i < count; i++)
        mapper->keyframe_pose[mapper->window.first + i] = cairn_force_field_pose(mapper->field, i);
    mapper->state.potential = cairn_force_field_potential(mapper->field);
    mapper->target.is_stale = 1;
}

void cairn_mapper_end_window(cairn_mapper *mapper)
{
    if (mapper->window.phase == MAPPER_WINDOW_RUN) {
        cairn_mapper_read_window(mapper);
        mapper->result.map_scan = cairn_pose_compose(mapper->keyframe_pose[mapper->result.keyframe],
                                                     mapper->result.keyframe_scan);
    }
    mapper->window.phase = MAPPER_WINDOW_IDLE;
}

cairn_status cairn_mapper_window_step(cairn_mapper *mapper, cairn_budget *budget)
{
    cairn_status status = CAIRN_OK;

    while (status == CAIRN_OK && mapper->window.phase == MAPPER_WINDOW_FILL) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        status = fill_item(mapper, budget);
    }
    if (status != CAIRN_OK || mapper->window.phase == MAPPER_WINDOW_IDLE)
        return status;
    status = cairn_force_field_step(mapper->field, budget);
    if (status != CAIRN_OK)
        return status;
    cairn_mapper_end_window(mapper);
    return CAIRN_OK;
}
