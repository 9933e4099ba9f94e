/* The phases of an alignment with hypotheses, and which follows which (virtual_align.c). */
#include "src/core/build.h"

#include "cairn/small_matrix.h"
#include "src/mapping/virtual_align_work.h"

/* Scans in the aligner's largest part from which on others are looked for in it. */
enum { LEAST_PART = 3 };

/* m of wall across the main direction: with less, hypotheses cannot hold a scan. */
static const cairn_real LEAST_ACROSS = CAIRN_REAL(0.1);

static int is_as_written(const cairn_virtual_align *align)
{
    return align->params.mode == CAIRN_MODE_AS_WRITTEN;
}

/* ---- The aligner ---- */

/* Whether the aligner has found any two scans that belong together. */
static int has_ground(const cairn_virtual_align *align)
{
    return align->params.align && align->result.aligner.placed >= 2;
}

/* The first alignment: it alone tells how far off the scans came in. */
static cairn_status step_align(cairn_virtual_align *align, cairn_budget *budget)
{
    cairn_status status = cairn_aligner_step(align->aligner, budget);

    if (status == CAIRN_OK)
        align->spread = cairn_min(cairn_aligner_read(align->aligner).spread, CAIRN_REAL(1e6));
    return status;
}

/* Keeps what the aligner has found. */
static cairn_status step_keep(cairn_virtual_align *align, cairn_budget *budget)
{
    for (; align->cursor < align->scan_count; align->cursor++) {
        if (!cairn_budget_pay(budget, &align->paid, 2))
            return CAIRN_MORE;
        align->places[align->cursor].aligned = cairn_aligner_pose_of(align->aligner, align->cursor);
    }
    align->result.aligner = cairn_aligner_read(align->aligner);
    return CAIRN_OK;
}

/* 1 when the aligner has gone on from what it had found, 0 when it has started anew. */
static int goes_on(const cairn_virtual_align *align)
{
    return has_ground(align) && align->result.aligner.largest >= LEAST_PART;
}

/* The motion from the map of the aligner's new result to that of the former one, by the scans
 * that were placed before. */
static cairn_pose former_map(cairn_virtual_align *align)
{
    int32_t count = 0;

    for (int32_t i = 0; i < align->scan_count; i++) {
        const cairn_aligner_pose *old = &align->places[i].aligned;

        if (!old->placed)
            continue;
        align->poses[count] = cairn_aligner_pose_of(align->aligner, i).map_scan;
        align->kept[count++] = old->map_scan;
    }
    return cairn_pose_fit(align->poses, align->kept, NULL, count, 1);
}

/* What the aligner has placed beside what it had placed before, which stays where it is. */
static cairn_status step_take_in(cairn_virtual_align *align, cairn_budget *budget)
{
    cairn_pose former;

    if (!cairn_budget_pay(budget, &align->paid, 1 + align->scan_count))
        return CAIRN_MORE;
    former = former_map(align);
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

/* The result of the alignment from where the field has left the scans, if it is better. */
static cairn_status step_judge(cairn_virtual_align *align, cairn_budget *budget)
{
    if (cairn_aligner_read(align->aligner).placed > align->result.aligner.placed)
        return goes_on(align) ? step_take_in(align, budget) : step_keep(align, budget);
    if (!cairn_budget_pay(budget, &align->paid, 1 + align->scan_count / 2))
        return CAIRN_MORE;
    align->is_done = 1;
    for (int32_t i = 0; i < align->scan_count; i++) {
        struct cairn_virtual_place *place = &align->places[i];

        place->moves = place->moves && (!has_ground(align) || place->aligned.part != 0);
        if (place->moves)
            place->aligned.map_scan = cairn_force_field_pose(align->field, i);
    }
    return CAIRN_OK;
}

/* ---- The field and its hypotheses ---- */

static int32_t segments_of(const cairn_virtual_align *align, int32_t scan)
{
    const cairn_scan_set_scan *of = &cairn_force_field_scans(align->field)->scans[scan];

    return of->end_segment - of->first_segment;
}

/* m of wall that a scan shows across the direction of most of what it shows. */
static cairn_real across_of(const cairn_virtual_align *align, int32_t scan)
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

/* All scans to where the aligner has put them. An iteration that an earlier alignment left is
 * ended first. */
static cairn_status step_place(cairn_virtual_align *align, cairn_budget *budget)
{
    struct cairn_virtual_place *place;

    if (align->is_under_way) {
        if (cairn_force_field_iterate(align->field, budget) == CAIRN_MORE)
            return CAIRN_MORE;
        align->is_under_way = 0;
    }
    if (align->cursor == 0)
        align->result.moved = 0;
    for (; align->cursor < align->scan_count; align->cursor++) {
        if (!cairn_budget_pay(budget, &align->paid, 2 + segments_of(align, align->cursor) / 4))
            return CAIRN_MORE;
        place = &align->places[align->cursor];
        place->moves =
            !has_ground(align) ||
            (!place->aligned.placed && !cairn_wall_slide_is_loose(align->slide, &place->aligned) &&
             across_of(align, align->cursor) >= LEAST_ACROSS);
        align->result.moved += place->moves;
        cairn_virtual_align_must(
            cairn_force_field_place(align->field, align->cursor, place->aligned.map_scan));
        cairn_virtual_align_must(cairn_force_field_fix(align->field, align->cursor, !place->moves));
    }
    cairn_force_field_restart(align->field);
    if (is_as_written(align)) /* V[0] is empty. */
        cairn_virtual_align_must(cairn_force_field_set_extra(align->field, NULL, NULL, 0));
    align->since = 0;
    align->result.rounds += align->result.moved > 0;
    return CAIRN_OK;
}

static cairn_status step_gather(cairn_virtual_align *align, cairn_budget *budget)
{
    const cairn_scan_set *set = cairn_force_field_scans(align->field);
    cairn_real sigma = cairn_force_field_read(align->field).sigma;

    if (align->cursor == 0)
        cairn_virtual_align_must(cairn_virtual_scan_begin(
            align->hypotheses, align->since > 0 ? sigma : align->params.field.sigma_start));
    for (; align->cursor < align->scan_count; align->cursor++) {
        const cairn_scan_set_scan *scan = &set->scans[align->cursor];

        if (!cairn_budget_pay(budget, &align->paid, 1 + (scan->end_point - scan->first_point) / 4))
            return CAIRN_MORE;
        if (!has_ground(align) || !align->places[align->cursor].moves)
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
    if (!cairn_budget_pay(budget, &align->paid, 1 + count / 8))
        return CAIRN_MORE;
    cairn_virtual_align_must(cairn_force_field_set_extra(align->field, points, weights, count));
    (void)cairn_virtual_scan_hypotheses(align->hypotheses, &align->result.hypotheses);
    return CAIRN_OK;
}

static cairn_status step_iteration(cairn_virtual_align *align, cairn_budget *budget)
{
    cairn_status status = cairn_force_field_iterate(align->field, budget);

    align->is_under_way = status == CAIRN_MORE;
    if (status != CAIRN_OK)
        return status;
    align->since++;
    align->result.iterations++;
    align->result.active += align->result.hypotheses > 0 && align->params.hypotheses.weight > 0;
    return CAIRN_OK;
}

/* The aligner's initial poses are those that the field has found. */
static cairn_status step_hand_back(cairn_virtual_align *align, cairn_budget *budget)
{
    cairn_status status;

    if (!cairn_budget_pay(budget, &align->paid, 1 + align->scan_count))
        return CAIRN_MORE;
    for (int32_t i = 0; i < align->scan_count; i++)
        align->poses[i] = cairn_force_field_pose(align->field, i);
    if (goes_on(align)) {
        status = cairn_aligner_begin_again(align->aligner, align->poses);
    } else {
        for (int32_t i = 0; i < align->scan_count; i++)
            cairn_virtual_align_must(cairn_aligner_start_at(align->aligner, i, align->poses[i]));
        status = cairn_aligner_begin(align->aligner);
    }
    CAIRN_ASSERT(status == CAIRN_OK);
    return status;
}

/* ---- Parts that slide ---- */

static cairn_status step_begin_slide(cairn_virtual_align *align, cairn_budget *budget)
{
    if (align->cursor == 0)
        cairn_virtual_align_must(cairn_wall_slide_begin(
            align->slide, align->aligner, cairn_force_field_scans(align->field), align->spread));
    for (; align->cursor < align->scan_count; align->cursor++) {
        const struct cairn_virtual_place *place = &align->places[align->cursor];

        if (!cairn_budget_pay(budget, &align->paid, 2))
            return CAIRN_MORE;
        cairn_virtual_align_must(cairn_wall_slide_add(align->slide, place->start, &place->aligned));
    }
    return CAIRN_OK;
}

static cairn_status step_take_slid(cairn_virtual_align *align, cairn_budget *budget)
{
    if (!cairn_budget_pay(budget, &align->paid, 1 + align->scan_count / 8))
        return CAIRN_MORE;
    align->result.slide = cairn_wall_slide_read(align->slide);
    for (int32_t i = 0; i < align->scan_count; i++) {
        struct cairn_virtual_place *place = &align->places[i];
        cairn_vec2 shift = cairn_wall_slide_shift_of(align->slide, i);

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
    case VIRTUAL_ALIGN_HAND_BACK:
        return step_hand_back(align, budget);
    case VIRTUAL_ALIGN_FIRST:
        return step_align(align, budget);
    case VIRTUAL_ALIGN_AGAIN:
        return cairn_aligner_step(align->aligner, budget);
    case VIRTUAL_ALIGN_KEEP:
        return step_keep(align, budget);
    case VIRTUAL_ALIGN_JUDGE:
        return step_judge(align, budget);
    case VIRTUAL_ALIGN_PLACE:
        return step_place(align, budget);
    case VIRTUAL_ALIGN_BEGIN_SLIDE:
        return step_begin_slide(align, budget);
    case VIRTUAL_ALIGN_SLIDE:
        return cairn_wall_slide_step(align->slide, budget);
    case VIRTUAL_ALIGN_TAKE_SLID:
        return step_take_slid(align, budget);
    case VIRTUAL_ALIGN_GATHER:
        return step_gather(align, budget);
    case VIRTUAL_ALIGN_DETECT:
        return step_detect(align, budget);
    default:
        return step_iteration(align, budget);
    }
}

/* What the field could not place, the slide may. */
static virtual_align_phase last_phase(const cairn_virtual_align *align)
{
    return has_ground(align) ? VIRTUAL_ALIGN_BEGIN_SLIDE : VIRTUAL_ALIGN_IDLE;
}

static virtual_align_phase next_phase(const cairn_virtual_align *align)
{
    switch (align->phase) {
    case VIRTUAL_ALIGN_FIRST:
        return VIRTUAL_ALIGN_KEEP;
    case VIRTUAL_ALIGN_KEEP:
        return VIRTUAL_ALIGN_PLACE;
    case VIRTUAL_ALIGN_PLACE:
        if (is_as_written(align))
            return VIRTUAL_ALIGN_ITERATE;
        return align->result.moved > 0 ? VIRTUAL_ALIGN_GATHER : last_phase(align);
    case VIRTUAL_ALIGN_BEGIN_SLIDE:
        return VIRTUAL_ALIGN_SLIDE;
    case VIRTUAL_ALIGN_SLIDE:
        return VIRTUAL_ALIGN_TAKE_SLID;
    case VIRTUAL_ALIGN_TAKE_SLID:
        return VIRTUAL_ALIGN_IDLE;
    case VIRTUAL_ALIGN_GATHER:
        return VIRTUAL_ALIGN_DETECT;
    case VIRTUAL_ALIGN_DETECT:
        return VIRTUAL_ALIGN_ITERATE;
    case VIRTUAL_ALIGN_HAND_BACK:
        return VIRTUAL_ALIGN_AGAIN;
    case VIRTUAL_ALIGN_AGAIN:
        return VIRTUAL_ALIGN_JUDGE;
    case VIRTUAL_ALIGN_JUDGE:
        return !align->is_done && align->result.rounds < align->params.max_rounds
                   ? VIRTUAL_ALIGN_PLACE
                   : last_phase(align);
    default:
        if (cairn_force_field_read(align->field).verdict != CAIRN_FORCE_FIELD_RUNNING)
            return align->params.align ? VIRTUAL_ALIGN_HAND_BACK : VIRTUAL_ALIGN_IDLE;
        return !has_ground(align) && align->since % align->params.every == 0
                   ? VIRTUAL_ALIGN_GATHER
                   : VIRTUAL_ALIGN_ITERATE;
    }
}

static int64_t *units_of(cairn_virtual_align *align)
{
    if (align->phase == VIRTUAL_ALIGN_FIRST || align->phase == VIRTUAL_ALIGN_AGAIN)
        return &align->result.align_units;
    if (align->phase == VIRTUAL_ALIGN_GATHER || align->phase == VIRTUAL_ALIGN_DETECT ||
        align->phase == VIRTUAL_ALIGN_BEGIN_SLIDE || align->phase == VIRTUAL_ALIGN_SLIDE ||
        align->phase == VIRTUAL_ALIGN_TAKE_SLID)
        return &align->result.hypothesis_units;
    return &align->result.field_units;
}

cairn_status cairn_virtual_align_go_on(cairn_virtual_align *align, cairn_budget *budget)
{
    int32_t left = budget->left;
    int64_t *units = units_of(align);
    cairn_status status = step_phase(align, budget);

    *units += left - budget->left;
    if (status != CAIRN_OK)
        return status;
    align->phase = next_phase(align);
    align->cursor = 0;
    align->paid = 0;
    return CAIRN_OK;
}
