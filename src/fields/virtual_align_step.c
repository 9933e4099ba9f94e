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
    return align->params.use_aligner && align->result.aligner.anchored >= 2;
}

/* Keeps the status of a nested step; 1 when that has ended. */
static int has_ended(cairn_virtual_align *align, cairn_status status)
{
    align->status = status;
    return status == CAIRN_OK;
}

/* Runs the aligner. */
static int run_aligner(cairn_virtual_align *align, cairn_budget *budget)
{
    return has_ended(align, cairn_aligner_step(align->aligner, budget));
}

/* Stores the aligner's result. */
static int store(cairn_virtual_align *align, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(align->phase_resume);
    for (align->cursor = 0; align->cursor < align->scan_count; align->cursor++) {
        CAIRN_STEP_CHARGE(align, phase_resume, budget, 2);
        align->places[align->cursor].aligned = cairn_aligner_pose_of(align->aligner, align->cursor);
    }
    align->result.aligner = cairn_aligner_read(align->aligner);
    align->is_stored = 1;
    CAIRN_STEP_END(align->phase_resume);
}

/* Returns 1 when the aligner has resumed from its former result, 0 when it has started anew. */
static int has_resumed(const cairn_virtual_align *align)
{
    return has_matches(align) && align->result.aligner.largest_size >= MIN_COMPONENT_SCANS;
}

/* Returns the motion from the map of the aligner's new result to the former one, by the scans that
 * were anchored before. */
static cairn_pose motion_to_former_map(cairn_virtual_align *align)
{
    int32_t count = 0;

    for (int32_t i = 0; i < align->scan_count; i++) {
        const cairn_aligner_pose *old = &align->places[i].aligned;

        if (!old->anchored)
            continue;
        align->poses[count] = cairn_aligner_pose_of(align->aligner, i).map_scan;
        align->stored_poses[count++] = old->map_scan;
    }
    return cairn_pose_fit(align->poses, align->stored_poses, NULL, count, 1);
}

/* Adds a scan to the result; one that was anchored before keeps its pose, and is known as well as
 * now. */
static void add_anchored(cairn_virtual_align *align, int32_t scan, cairn_pose former)
{
    cairn_aligner_pose found = cairn_aligner_pose_of(align->aligner, scan),
                       *kept = &align->places[scan].aligned;

    if (kept->anchored && !found.anchored)
        return;
    found.map_scan = kept->anchored ? kept->map_scan : cairn_pose_compose(former, found.map_scan);
    *kept = found;
}

/* Adds the newly anchored scans; those anchored before keep their poses. */
static void add_all_anchored(cairn_virtual_align *align)
{
    cairn_pose former = motion_to_former_map(align);

    for (int32_t i = 0; i < align->scan_count; i++)
        add_anchored(align, i, former);
    align->result.aligner = cairn_aligner_read(align->aligner);
}

/* 1 when the aligner has anchored more scans than in the former result. */
static int is_better(const cairn_virtual_align *align)
{
    return cairn_aligner_read(align->aligner).anchored > align->result.aligner.anchored;
}

/* Keeps the poses of the field where the former result has none. */
static void keep_former_poses(cairn_virtual_align *align)
{
    align->is_field_ahead = 0;
    for (int32_t i = 0; i < align->scan_count; i++) {
        struct virtual_align_place *place = &align->places[i];

        place->moves = place->moves && (!has_matches(align) || place->aligned.component != 0);
        if (place->moves)
            place->aligned.map_scan = cairn_force_field_pose(align->field, i);
    }
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

/* Finishes an iteration left by an earlier alignment. */
static int finish_iteration(cairn_virtual_align *align, cairn_budget *budget)
{
    align->is_iterating = cairn_force_field_iterate(align->field, budget) == CAIRN_MORE;
    return !align->is_iterating;
}

/* Places a scan in the field at the aligner's pose. */
static void place_scan(cairn_virtual_align *align, int32_t scan)
{
    struct virtual_align_place *place = &align->places[scan];

    place->moves = !has_matches(align) ||
                   (!place->aligned.anchored &&
                    !cairn_weak_direction_is_weak(align->weak_direction, &place->aligned) &&
                    transverse_wall(align, scan) >= MIN_TRANSVERSE_WALL_M);
    align->result.moved_scans += place->moves;
    cairn_virtual_align_must(cairn_force_field_place(align->field, scan, place->aligned.map_scan));
    cairn_virtual_align_must(cairn_force_field_fix(align->field, scan, !place->moves));
}

/* Begins a run of the field. As written the first virtual scan is empty. */
static void begin_field(cairn_virtual_align *align)
{
    cairn_force_field_restart(align->field);
    if (is_as_written(align))
        cairn_virtual_align_must(cairn_force_field_set_extra(align->field, NULL, NULL, 0));
    align->iterations_since_scan = 0;
    align->result.rounds += align->result.moved_scans > 0;
}

/* Places all scans in the field. */
static int place(cairn_virtual_align *align, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(align->phase_resume);
    if (align->is_iterating)
        CAIRN_STEP_RUN(align, phase_resume, budget, finish_iteration);
    align->result.moved_scans = 0;
    for (align->cursor = 0; align->cursor < align->scan_count; align->cursor++) {
        CAIRN_STEP_CHARGE(align, phase_resume, budget, 2 + segments_of(align, align->cursor) / 4);
        place_scan(align, align->cursor);
    }
    begin_field(align);
    CAIRN_STEP_END(align->phase_resume);
}

/* 1 when hypotheses are due before the next iteration: at first, and every few iterations while
 * all scans move. */
static int needs_hypotheses(const cairn_virtual_align *align)
{
    if (align->iterations_since_scan == 0)
        return !is_as_written(align);
    return !has_matches(align) &&
           align->iterations_since_scan % align->params.rebuild_interval == 0;
}

/* Begins the map that the hypotheses are derived from. */
static void begin_map(cairn_virtual_align *align)
{
    cairn_real sigma = align->iterations_since_scan > 0 ? cairn_force_field_read(align->field).sigma
                                                        : align->params.field.sigma_start;

    cairn_virtual_align_must(cairn_virtual_scan_begin(align->hypotheses, sigma));
}

/* Number of points of a scan. */
static int32_t points_of(const cairn_virtual_align *align, int32_t scan)
{
    const cairn_scan_set_scan *of = &cairn_force_field_scans(align->field)->scans[scan];

    return of->end_point - of->first_point;
}

/* Adds a scan to the map when hypotheses are derived from it. */
static void add_to_map(cairn_virtual_align *align, int32_t scan)
{
    if (!has_matches(align) || !align->places[scan].moves)
        cairn_virtual_align_must(
            cairn_virtual_scan_add_scan(align->hypotheses, cairn_force_field_scans(align->field),
                                        scan, cairn_force_field_pose(align->field, scan)));
}

/* The map that the hypotheses are derived from. */
static int gather(cairn_virtual_align *align, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(align->phase_resume);
    begin_map(align);
    for (align->cursor = 0; align->cursor < align->scan_count; align->cursor++) {
        CAIRN_STEP_CHARGE(align, phase_resume, budget, 1 + points_of(align, align->cursor) / 4);
        add_to_map(align, align->cursor);
    }
    CAIRN_STEP_END(align->phase_resume);
}

/* Number of points of the virtual scan. */
static int32_t virtual_points(const cairn_virtual_align *align)
{
    const cairn_real *weights;
    int32_t count;

    (void)cairn_virtual_scan_points(align->hypotheses, &weights, &count);
    return count;
}

/* The virtual scan as external points of the field. */
static void enter_virtual_scan(cairn_virtual_align *align)
{
    const cairn_real *weights;
    int32_t count;
    const cairn_oriented_point *points =
        cairn_virtual_scan_points(align->hypotheses, &weights, &count);

    cairn_virtual_align_must(cairn_force_field_set_extra(align->field, points, weights, count));
    (void)cairn_virtual_scan_hypotheses(align->hypotheses, &align->result.hypotheses);
}

/* The hypotheses; without new ones after an error of a detector. */
static int detect(cairn_virtual_align *align, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(align->phase_resume);
    CAIRN_STEP_UNTIL(align->phase_resume,
                     cairn_virtual_scan_step(align->hypotheses, budget) != CAIRN_MORE);
    CAIRN_STEP_CHARGE(align, phase_resume, budget, 1 + virtual_points(align) / 8);
    enter_virtual_scan(align);
    CAIRN_STEP_END(align->phase_resume);
}

/* An iteration of the field. */
static int iterate(cairn_virtual_align *align, cairn_budget *budget)
{
    int is_done = has_ended(align, cairn_force_field_iterate(align->field, budget));

    align->is_iterating = align->status == CAIRN_MORE;
    if (is_done) {
        align->iterations_since_scan++;
        align->result.iterations++;
        align->result.active_iterations +=
            align->result.hypotheses > 0 && align->params.hypotheses.weight > 0;
    }
    return is_done;
}

/* Begins the next run of the aligner, from the poses of the field. */
static void begin_realign(cairn_virtual_align *align)
{
    for (int32_t i = 0; i < align->scan_count; i++)
        align->poses[i] = cairn_force_field_pose(align->field, i);
    if (has_resumed(align)) {
        cairn_virtual_align_must(cairn_aligner_begin_warm(align->aligner, align->poses));
        return;
    }
    for (int32_t i = 0; i < align->scan_count; i++)
        cairn_virtual_align_must(
            cairn_aligner_set_initial_pose(align->aligner, i, align->poses[i]));
    cairn_virtual_align_must(cairn_aligner_begin(align->aligner));
}

/* ---- Translation along walls ---- */

/* Adds a scan to the search along weak directions. */
static void add_to_translation(cairn_virtual_align *align, int32_t scan)
{
    const struct virtual_align_place *of = &align->places[scan];

    cairn_virtual_align_must(
        cairn_weak_direction_add(align->weak_direction, of->start, &of->aligned));
}

static int begin_translation(cairn_virtual_align *align, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(align->phase_resume);
    cairn_virtual_align_must(cairn_weak_direction_begin(align->weak_direction, align->aligner,
                                                        cairn_force_field_scans(align->field),
                                                        align->initial_spread));
    for (align->cursor = 0; align->cursor < align->scan_count; align->cursor++) {
        CAIRN_STEP_CHARGE(align, phase_resume, budget, 2);
        add_to_translation(align, align->cursor);
    }
    CAIRN_STEP_END(align->phase_resume);
}

/* Searches along weak directions. */
static int translate(cairn_virtual_align *align, cairn_budget *budget)
{
    return has_ended(align, cairn_weak_direction_step(align->weak_direction, budget));
}

/* Translates the scans by what was found. */
static void translate_scans(cairn_virtual_align *align)
{
    align->result.weak_direction = cairn_weak_direction_read(align->weak_direction);
    for (int32_t i = 0; i < align->scan_count; i++) {
        struct virtual_align_place *of = &align->places[i];
        cairn_vec2 shift = cairn_weak_direction_translation(align->weak_direction, i);

        if (shift.x == 0 && shift.y == 0)
            continue;
        of->aligned.map_scan.x += shift.x;
        of->aligned.map_scan.y += shift.y;
        of->moves = 1;
    }
}

/* ---- The alignment ---- */

/* Continues a phase, and adds its units to *units. */
static int run(cairn_virtual_align *align, cairn_budget *budget,
               int (*phase)(cairn_virtual_align *align, cairn_budget *budget), int64_t *units)
{
    int32_t left = budget->left;
    int is_done = phase(align, budget);

    *units += left - budget->left;
    return is_done;
}

/* Charges an operation, and adds its units to *units. */
static int charge(cairn_virtual_align *align, cairn_budget *budget, int32_t cost, int64_t *units)
{
    int32_t left = budget->left;
    int is_done = cairn_budget_charge(budget, &align->units_charged, cost);

    *units += left - budget->left;
    return is_done;
}

/* Places of return: a phase or a charge, whose units are counted for the aligner, the field or the
 * hypotheses. */
#define PHASE(counted, phase)                                                                      \
    CAIRN_STEP_UNTIL(align->resume, run(align, budget, phase, &align->result.counted##_units))
#define CHARGE(counted, cost)                                                                      \
    CAIRN_STEP_UNTIL(align->resume, charge(align, budget, cost, &align->result.counted##_units))

/* 1 while the field has not stopped. */
static int field_runs(const cairn_virtual_align *align)
{
    return cairn_force_field_read(align->field).verdict == CAIRN_FORCE_FIELD_RUNNING;
}

/* 1 after the last iteration of all, without an aligner. */
static int is_last(const cairn_virtual_align *align)
{
    return !align->params.use_aligner && !field_runs(align);
}

/* 1 when scans move in the field. */
static int has_field(const cairn_virtual_align *align)
{
    return align->result.moved_scans > 0 || is_as_written(align);
}

/* Error of the initial poses; the first alignment alone gets them. */
static cairn_real spread_of(const cairn_virtual_align *align)
{
    return cairn_min(cairn_aligner_read(align->aligner).initial_sigma, CAIRN_REAL(1e6));
}

int cairn_virtual_align_run(cairn_virtual_align *align, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(align->resume);
    if (align->params.use_aligner) {
        PHASE(align, run_aligner);
        align->initial_spread = spread_of(align);
    }
    PHASE(field, store);
    if (align->params.use_aligner)
        align->has_stopped = align->stops_at_result;
    CAIRN_STEP_UNTIL(align->resume, !align->has_stopped);
    do {
        PHASE(field, place);
        if (!has_field(align))
            break;
        align->is_field_ahead = 1;
        do {
            if (needs_hypotheses(align)) {
                PHASE(hypothesis, gather);
                PHASE(hypothesis, detect);
            }
            PHASE(field, iterate);
            align->has_stopped = align->stops_at_result && !is_last(align);
            CAIRN_STEP_UNTIL(align->resume, !align->has_stopped);
        } while (field_runs(align));
        if (!align->params.use_aligner)
            break;
        CHARGE(field, 1 + align->scan_count);
        begin_realign(align);
        PHASE(align, run_aligner);
        if (!is_better(align)) {
            CHARGE(field, 1 + align->scan_count / 2);
            keep_former_poses(align);
            break;
        }
        if (has_resumed(align)) {
            CHARGE(field, 1 + align->scan_count);
            add_all_anchored(align);
        } else {
            PHASE(field, store);
        }
        align->is_field_ahead = 0;
    } while (align->result.rounds < align->params.max_rounds);
    /* Scans that the field could not place may still be translated along walls. */
    if (has_matches(align)) {
        PHASE(hypothesis, begin_translation);
        PHASE(hypothesis, translate);
        CHARGE(hypothesis, 1 + align->scan_count / 8);
        translate_scans(align);
    }
    CAIRN_STEP_END(align->resume);
}
