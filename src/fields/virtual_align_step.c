/* Phases of an alignment with virtual scans and their order (Method in virtual_align.c). */
#include "src/base/build.h"

#include "cairn/small_matrix.h"
#include "src/fields/virtual_align_work.h"

/* minimum scans of the aligner's largest component for a search of others in it */
enum { MIN_COMPONENT_SCANS = 3 };

/* m of wall transverse to the main direction: with less, hypotheses cannot constrain a scan */
static const cairn_real MIN_TRANSVERSE_WALL_M = CAIRN_REAL(0.1);

static int is_as_written(const cairn_virtual_align *align)
{
    return align->params.mode == CAIRN_MODE_AS_WRITTEN;
}

/* ---- The aligner ---- */

/* Returns 1 when the aligner has matched at least two scans. */
static int has_matches(const cairn_virtual_align *align)
{
    return align->params.use_aligner && align->result.aligner.placed >= 2;
}

/* Runs the first alignment. It alone gets the initial error of the poses. */
static cairn_status step_align(cairn_virtual_align *align, cairn_budget *budget)
{
    cairn_status status = cairn_aligner_step(align->aligner, budget);

    if (status == CAIRN_OK)
        align->initial_spread =
            cairn_min(cairn_aligner_read(align->aligner).initial_sigma, CAIRN_REAL(1e6));
    return status;
}

/* Stores the aligner's result. */
static cairn_status step_store(cairn_virtual_align *align, cairn_budget *budget)
{
    for (; align->cursor < align->scan_count; align->cursor++) {
        if (!cairn_budget_charge(budget, &align->units_charged, 2))
            return CAIRN_MORE;
        align->places[align->cursor].aligned = cairn_aligner_pose_of(align->aligner, align->cursor);
    }
    align->result.aligner = cairn_aligner_read(align->aligner);
    return CAIRN_OK;
}

/* Returns 1 when the aligner has resumed from its former result, 0 when it has started anew. */
static int has_resumed(const cairn_virtual_align *align)
{
    return has_matches(align) && align->result.aligner.largest_size >= MIN_COMPONENT_SCANS;
}

/* Returns the motion from the map of the aligner's new result to the former one, by the scans that
 * were placed before. */
static cairn_pose motion_to_former_map(cairn_virtual_align *align)
{
    int32_t count = 0;

    for (int32_t i = 0; i < align->scan_count; i++) {
        const cairn_aligner_pose *old = &align->places[i].aligned;

        if (!old->placed)
            continue;
        align->poses[count] = cairn_aligner_pose_of(align->aligner, i).map_scan;
        align->stored_poses[count++] = old->map_scan;
    }
    return cairn_pose_fit(align->poses, align->stored_poses, NULL, count, 1);
}

/* Adds the newly placed scans; those placed before keep their poses. */
static cairn_status step_apply(cairn_virtual_align *align, cairn_budget *budget)
{
    cairn_pose former;

    if (!cairn_budget_charge(budget, &align->units_charged, 1 + align->scan_count))
        return CAIRN_MORE;
    former = motion_to_former_map(align);
    for (int32_t i = 0; i < align->scan_count; i++) {
        cairn_aligner_pose found = cairn_aligner_pose_of(align->aligner, i);

        if (align->places[i].aligned.placed)
            continue;
        found.map_scan = cairn_pose_compose(former, found.map_scan);
        align->places[i].aligned = found;
    }
    align->result.aligner = cairn_aligner_read(align->aligner);
    return CAIRN_OK;
}

/* Compares the result of the realignment with the former one and keeps the better. */
static cairn_status step_compare(cairn_virtual_align *align, cairn_budget *budget)
{
    if (cairn_aligner_read(align->aligner).placed > align->result.aligner.placed)
        return has_resumed(align) ? step_apply(align, budget) : step_store(align, budget);
    if (!cairn_budget_charge(budget, &align->units_charged, 1 + align->scan_count / 2))
        return CAIRN_MORE;
    align->is_done = 1;
    for (int32_t i = 0; i < align->scan_count; i++) {
        struct virtual_align_place *place = &align->places[i];

        place->moves = place->moves && (!has_matches(align) || place->aligned.component != 0);
        if (place->moves)
            place->aligned.map_scan = cairn_force_field_pose(align->field, i);
    }
    return CAIRN_OK;
}

/* ---- Force field and hypotheses ---- */

static int32_t segments_of(const cairn_virtual_align *align, int32_t scan)
{
    const cairn_scan_set_scan *of = &cairn_force_field_scans(align->field)->scans[scan];

    return of->end_segment - of->first_segment;
}

/* Returns the m of wall of a scan transverse to its main wall direction. */
static cairn_real transverse_wall(const cairn_virtual_align *align, int32_t scan)
{
    const cairn_scan_set *set = cairn_force_field_scans(align->field);
    cairn_sym2 walls = {0, 0, 0};
    cairn_real values[2];
    cairn_vec2 minor, major;

    for (int32_t i = set->scans[scan].first_segment; i < set->scans[scan].end_segment; i++) {
        cairn_segment s = set->segments[i].segment;
        cairn_vec2 d = set->segments[i].direction;
        cairn_real length = cairn_vec2_norm(cairn_vec2_sub(s.b, s.a));

        walls.xx += length * d.x * d.x;
        walls.xy += length * d.x * d.y;
        walls.yy += length * d.y * d.y;
    }
    cairn_sym2_eigen(walls, values, &minor, &major);
    return values[0];
}

/* Places all scans in the field at the aligner's poses. An iteration left by an earlier alignment
 * is finished first. */
static cairn_status step_place(cairn_virtual_align *align, cairn_budget *budget)
{
    struct virtual_align_place *place;

    if (align->is_iterating) {
        if (cairn_force_field_iterate(align->field, budget) == CAIRN_MORE)
            return CAIRN_MORE;
        align->is_iterating = 0;
    }
    if (align->cursor == 0)
        align->result.moved_scans = 0;
    for (; align->cursor < align->scan_count; align->cursor++) {
        if (!cairn_budget_charge(budget, &align->units_charged,
                                 2 + segments_of(align, align->cursor) / 4))
            return CAIRN_MORE;
        place = &align->places[align->cursor];
        place->moves = !has_matches(align) ||
                       (!place->aligned.placed &&
                        !cairn_weak_direction_is_weak(align->weak_direction, &place->aligned) &&
                        transverse_wall(align, align->cursor) >= MIN_TRANSVERSE_WALL_M);
        align->result.moved_scans += place->moves;
        cairn_virtual_align_must(
            cairn_force_field_place(align->field, align->cursor, place->aligned.map_scan));
        cairn_virtual_align_must(cairn_force_field_fix(align->field, align->cursor, !place->moves));
    }
    cairn_force_field_restart(align->field);
    if (is_as_written(align)) /* The first virtual scan is empty. */
        cairn_virtual_align_must(cairn_force_field_set_extra(align->field, NULL, NULL, 0));
    align->iterations_since_scan = 0;
    align->result.rounds += align->result.moved_scans > 0;
    return CAIRN_OK;
}

static cairn_status step_gather(cairn_virtual_align *align, cairn_budget *budget)
{
    const cairn_scan_set *set = cairn_force_field_scans(align->field);
    cairn_real sigma = cairn_force_field_read(align->field).sigma;

    if (align->cursor == 0)
        cairn_virtual_align_must(cairn_virtual_scan_begin(
            align->hypotheses,
            align->iterations_since_scan > 0 ? sigma : align->params.field.sigma_start));
    for (; align->cursor < align->scan_count; align->cursor++) {
        const cairn_scan_set_scan *scan = &set->scans[align->cursor];

        if (!cairn_budget_charge(budget, &align->units_charged,
                                 1 + (scan->end_point - scan->first_point) / 4))
            return CAIRN_MORE;
        if (!has_matches(align) || !align->places[align->cursor].moves)
            cairn_virtual_align_must(
                cairn_virtual_scan_add_scan(align->hypotheses, set, align->cursor,
                                            cairn_force_field_pose(align->field, align->cursor)));
    }
    return CAIRN_OK;
}

static cairn_status step_detect(cairn_virtual_align *align, cairn_budget *budget)
{
    const cairn_oriented_point *points;
    const cairn_real *weights;
    int32_t count;

    if (cairn_virtual_scan_step(align->hypotheses, budget) == CAIRN_MORE)
        return CAIRN_MORE;
    points = cairn_virtual_scan_points(align->hypotheses, &weights, &count);
    if (!cairn_budget_charge(budget, &align->units_charged, 1 + count / 8))
        return CAIRN_MORE;
    cairn_virtual_align_must(cairn_force_field_set_extra(align->field, points, weights, count));
    (void)cairn_virtual_scan_hypotheses(align->hypotheses, &align->result.hypotheses);
    return CAIRN_OK;
}

static cairn_status step_iteration(cairn_virtual_align *align, cairn_budget *budget)
{
    cairn_status status = cairn_force_field_iterate(align->field, budget);

    align->is_iterating = status == CAIRN_MORE;
    if (status != CAIRN_OK)
        return status;
    align->iterations_since_scan++;
    align->result.iterations++;
    align->result.active_iterations +=
        align->result.hypotheses > 0 && align->params.hypotheses.weight > 0;
    return CAIRN_OK;
}

/* Passes the field's poses to the aligner as initial poses. */
static cairn_status step_return_poses(cairn_virtual_align *align, cairn_budget *budget)
{
    cairn_status status;

    if (!cairn_budget_charge(budget, &align->units_charged, 1 + align->scan_count))
        return CAIRN_MORE;
    for (int32_t i = 0; i < align->scan_count; i++)
        align->poses[i] = cairn_force_field_pose(align->field, i);
    if (has_resumed(align)) {
        status = cairn_aligner_begin_warm(align->aligner, align->poses);
    } else {
        for (int32_t i = 0; i < align->scan_count; i++)
            cairn_virtual_align_must(
                cairn_aligner_set_initial_pose(align->aligner, i, align->poses[i]));
        status = cairn_aligner_begin(align->aligner);
    }
    CAIRN_ASSERT(status == CAIRN_OK);
    return status;
}

/* ---- Translation along walls ---- */

static cairn_status step_begin_translation(cairn_virtual_align *align, cairn_budget *budget)
{
    if (align->cursor == 0)
        cairn_virtual_align_must(cairn_weak_direction_begin(align->weak_direction, align->aligner,
                                                            cairn_force_field_scans(align->field),
                                                            align->initial_spread));
    for (; align->cursor < align->scan_count; align->cursor++) {
        const struct virtual_align_place *place = &align->places[align->cursor];

        if (!cairn_budget_charge(budget, &align->units_charged, 2))
            return CAIRN_MORE;
        cairn_virtual_align_must(
            cairn_weak_direction_add(align->weak_direction, place->start, &place->aligned));
    }
    return CAIRN_OK;
}

static cairn_status step_apply_translation(cairn_virtual_align *align, cairn_budget *budget)
{
    if (!cairn_budget_charge(budget, &align->units_charged, 1 + align->scan_count / 8))
        return CAIRN_MORE;
    align->result.weak_direction = cairn_weak_direction_read(align->weak_direction);
    for (int32_t i = 0; i < align->scan_count; i++) {
        struct virtual_align_place *place = &align->places[i];
        cairn_vec2 shift = cairn_weak_direction_translation(align->weak_direction, i);

        if (shift.x == 0 && shift.y == 0)
            continue;
        place->aligned.map_scan.x += shift.x;
        place->aligned.map_scan.y += shift.y;
        place->moves = 1;
    }
    return CAIRN_OK;
}

static cairn_status step_phase(cairn_virtual_align *align, cairn_budget *budget)
{
    switch (align->phase) {
    case VIRTUAL_ALIGN_RETURN_POSES:
        return step_return_poses(align, budget);
    case VIRTUAL_ALIGN_FIRST:
        return step_align(align, budget);
    case VIRTUAL_ALIGN_REALIGN:
        return cairn_aligner_step(align->aligner, budget);
    case VIRTUAL_ALIGN_STORE:
        return step_store(align, budget);
    case VIRTUAL_ALIGN_COMPARE:
        return step_compare(align, budget);
    case VIRTUAL_ALIGN_PLACE:
        return step_place(align, budget);
    case VIRTUAL_ALIGN_BEGIN_SLIDE:
        return step_begin_translation(align, budget);
    case VIRTUAL_ALIGN_SLIDE:
        return cairn_weak_direction_step(align->weak_direction, budget);
    case VIRTUAL_ALIGN_APPLY_SLIDE:
        return step_apply_translation(align, budget);
    case VIRTUAL_ALIGN_GATHER:
        return step_gather(align, budget);
    case VIRTUAL_ALIGN_DETECT:
        return step_detect(align, budget);
    default:
        return step_iteration(align, budget);
    }
}

/* Returns the last phase: scans that the field could not place may still be translated along
 * walls. */
static virtual_align_phase last_phase(const cairn_virtual_align *align)
{
    return has_matches(align) ? VIRTUAL_ALIGN_BEGIN_SLIDE : VIRTUAL_ALIGN_IDLE;
}

static virtual_align_phase next_phase(const cairn_virtual_align *align)
{
    switch (align->phase) {
    case VIRTUAL_ALIGN_FIRST:
        return VIRTUAL_ALIGN_STORE;
    case VIRTUAL_ALIGN_STORE:
        return VIRTUAL_ALIGN_PLACE;
    case VIRTUAL_ALIGN_PLACE:
        if (is_as_written(align))
            return VIRTUAL_ALIGN_ITERATE;
        return align->result.moved_scans > 0 ? VIRTUAL_ALIGN_GATHER : last_phase(align);
    case VIRTUAL_ALIGN_BEGIN_SLIDE:
        return VIRTUAL_ALIGN_SLIDE;
    case VIRTUAL_ALIGN_SLIDE:
        return VIRTUAL_ALIGN_APPLY_SLIDE;
    case VIRTUAL_ALIGN_APPLY_SLIDE:
        return VIRTUAL_ALIGN_IDLE;
    case VIRTUAL_ALIGN_GATHER:
        return VIRTUAL_ALIGN_DETECT;
    case VIRTUAL_ALIGN_DETECT:
        return VIRTUAL_ALIGN_ITERATE;
    case VIRTUAL_ALIGN_RETURN_POSES:
        return VIRTUAL_ALIGN_REALIGN;
    case VIRTUAL_ALIGN_REALIGN:
        return VIRTUAL_ALIGN_COMPARE;
    case VIRTUAL_ALIGN_COMPARE:
        return !align->is_done && align->result.rounds < align->params.max_rounds
                   ? VIRTUAL_ALIGN_PLACE
                   : last_phase(align);
    default:
        if (cairn_force_field_read(align->field).verdict != CAIRN_FORCE_FIELD_RUNNING)
            return align->params.use_aligner ? VIRTUAL_ALIGN_RETURN_POSES : VIRTUAL_ALIGN_IDLE;
        return !has_matches(align) &&
                       align->iterations_since_scan % align->params.rebuild_interval == 0
                   ? VIRTUAL_ALIGN_GATHER
                   : VIRTUAL_ALIGN_ITERATE;
    }
}

static int64_t *units_of(cairn_virtual_align *align)
{
    if (align->phase == VIRTUAL_ALIGN_FIRST || align->phase == VIRTUAL_ALIGN_REALIGN)
        return &align->result.align_units;
    if (align->phase == VIRTUAL_ALIGN_GATHER || align->phase == VIRTUAL_ALIGN_DETECT ||
        align->phase == VIRTUAL_ALIGN_BEGIN_SLIDE || align->phase == VIRTUAL_ALIGN_SLIDE ||
        align->phase == VIRTUAL_ALIGN_APPLY_SLIDE)
        return &align->result.hypothesis_units;
    return &align->result.field_units;
}

cairn_status cairn_virtual_align_run_phase(cairn_virtual_align *align, cairn_budget *budget)
{
    int32_t left = budget->left;
    int64_t *units = units_of(align);
    cairn_status status = step_phase(align, budget);

    *units += left - budget->left;
    if (status != CAIRN_OK)
        return status;
    align->phase = next_phase(align);
    align->cursor = 0;
    align->units_charged = 0;
    return CAIRN_OK;
}
