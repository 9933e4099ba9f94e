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

#include "src/base/step.h"
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
    mapper_window *window = &mapper->window;

    window->resume = 0;
    window->units_charged = 0;
    window->is_active = 1;
    window->end = mapper->keyframe_count;
    window->first = window->keyframe = window_begin(mapper);
    cairn_force_field_clear(mapper->field);
}

static int32_t add_units(const cairn_mapper *mapper)
{
    return 2 + cairn_mapper_point_count(mapper, mapper->window.keyframe) / 2;
}

/* Adds the next keyframe to the force field; a keyframe that is refused cancels the run. */
static void add_keyframe(cairn_mapper *mapper)
{
    mapper_window *window = &mapper->window;
    int32_t keyframe = window->keyframe;
    cairn_scan_view view = cairn_mapper_keyframe_view(mapper, keyframe);
    cairn_status status = cairn_force_field_add_scan(mapper->field, &view, NULL,
                                                     mapper->keyframe_pose[keyframe], NULL);

    /* The first keyframe is always fixed, which removes the gauge freedom of the window. Those with
     * links in the graph are fixed as well. */
    if (status == CAIRN_OK &&
        (keyframe == window->first || keyframe < window->end - mapper->params.window_free ||
         keyframe < mapper->loop.graph_keyframes))
        status = cairn_force_field_fix(mapper->field, keyframe - window->first, 1);
    window->is_active = status == CAIRN_OK;
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
    if (cairn_mapper_window_runs(mapper)) {
        cairn_mapper_read_window(mapper);
        mapper->result.map_scan = cairn_pose_compose(mapper->keyframe_pose[mapper->result.keyframe],
                                                     mapper->result.keyframe_scan);
    }
    mapper->window.is_active = 0;
}

static int run_field(cairn_mapper *mapper, cairn_budget *budget)
{
    return cairn_force_field_step(mapper->field, budget) != CAIRN_MORE;
}

int cairn_mapper_window_step(cairn_mapper *mapper, cairn_budget *budget)
{
    mapper_window *window = &mapper->window;

    CAIRN_STEP_BEGIN(window->resume);
    for (; window->is_active && window->keyframe < window->end; window->keyframe++) {
        CAIRN_STEP_UNTIL(
            window->resume,
            cairn_mapper_charge_first(mapper, budget, &window->units_charged, add_units(mapper)));
        add_keyframe(mapper);
    }
    if (window->is_active)
        CAIRN_STEP_UNTIL(window->resume, cairn_mapper_run_in_share(mapper, budget, run_field));
    cairn_mapper_end_window(mapper);
    CAIRN_STEP_END(window->resume);
}
