/* One iteration of force field simulation.
 *
 * Method (Adluru 2008, algorithm 1), one phase after the other, each in bounded steps:
 *
 * 1. COMPARE: finds the scans that have moved since the last iteration.
 * 2. PLACE: transforms their segments and points into the map; bounding boxes of the points of each
 *    segment.
 * 3. CORNERS: corner detection over all segments. UNGRID, GRID: the corners into a hash grid.
 * 4. MASSES: points near a corner are in a region of interest.
 * 5. PAIRS: forces between the points of near segments (force_field_pairs.c).
 * 6. SOLVE: in mode SPRINGS, motions to the equilibrium (force_field_springs.c).
 * 7. MOVE: moves each scan from rest (eqs. 7.6 to 7.9; force_field_move.c).
 * 8. Commit: swaps buffers, cooling (section 7.3.2), verdict.
 *
 * Without regions of interest CORNERS to MASSES are left out.
 *
 * The forces of a scan are cached while its neighbours rest. Neighbours are the scans with segments
 * in near boxes. MARK_OLD traverses the previous boxes, MARK_NEW the current ones; every scan near
 * one that has moved is dirty. Only dirty scans are recomputed. When sigma has changed, as during
 * cooling, all are.
 *
 * Source: Adluru 2008, chapter 7. */
#include "src/base/build.h"

#include <string.h>

#include "src/fields/force_field_iteration.h"

enum { POINTS_PER_GROUP = 8, ITEMS_PER_GROUP = 4 };

/* relative growth of boxes beyond exact arithmetic */
#define BOX_GROWTH_FACTOR CAIRN_REAL(1.001)

int32_t cairn_force_field_iteration_is_between(const cairn_force_field *field)
{
    return field->phase == FORCE_FIELD_AT_COMMIT || field->phase == FORCE_FIELD_PACK;
}

int32_t cairn_force_field_iteration_has(const cairn_force_field *field, int32_t scan)
{
    const struct cairn_force_field_body *body = &field->bodies[scan];

    return field->set->scans[scan].in_use && field->commits >= body->active_from &&
           !(body->is_leaving && field->commits >= body->active_until);
}

int32_t cairn_force_field_iteration_is_fixed(const cairn_force_field *field, int32_t scan)
{
    const struct cairn_force_field_body *body = &field->bodies[scan];

    return field->clock >= body->fixed_from ? body->fixed_after : body->fixed_before;
}

void cairn_force_field_iteration_take_in(cairn_force_field *field)
{
    field->slots = field->set->scan_count;
    field->segment_count = field->set->segment_count;
    field->revision++;
}

void cairn_force_field_iteration_start_cooling(cairn_force_field *field)
{
    field->restart = 0;
    field->sigma = field->params.sigma_start;
    field->sigma_scale = 1;
    field->dt = field->params.dt_start;
    field->state.start_iterations = 0;
    field->state.verdict = CAIRN_FORCE_FIELD_RUNNING;
}

void cairn_force_field_iteration_begin(cairn_force_field *field)
{
    const cairn_force_field_params *p = &field->params;

    field->clock++;
    field->segment_count = field->set->segment_count;
    if (field->extra_pending) {
        field->extra_front = 1 - field->extra_front;
        field->extra_pending = 0;
        field->placed_sigma = 0;
    }
    field->recomputes_all =
        field->sigma != field->placed_sigma || cairn_force_field_has_springs(field);
    field->placed_sigma = field->sigma;
    if (field->recomputes_all)
        field->free_box = cairn_box_empty();
    /* The threshold is slightly lower, so that rounding does not decide at equality. */
    field->rotates_about_sensor =
        cairn_force_field_has_springs(field) ||
        field->sigma < p->sensor_below * p->sigma_start * CAIRN_REAL(0.9999);
    field->margin = p->reach * field->sigma / 2 * BOX_GROWTH_FACTOR;
    cairn_force_kernel_set(&field->kernel, field->sigma, p->reach);
    field->scan = 0;
    field->moved_count = field->still_count = 0;
    field->units_charged = 0;
    field->phase = FORCE_FIELD_COMPARE;
}

/* ---- Phases; each returns CAIRN_OK when it is done ---- */

static void must_be_ok(cairn_status status)
{
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
}

static int is_same_pose(cairn_pose a, cairn_pose b)
{
    return a.x == b.x && a.y == b.y && a.theta == b.theta;
}

static cairn_status step_pack(cairn_force_field *field, cairn_budget *budget)
{
    while (field->last_leaving >= 0) {
        struct cairn_force_field_body *body = &field->bodies[field->last_leaving];
        const cairn_scan_set_scan *scan = &field->set->scans[field->last_leaving];

        if (!cairn_budget_charge(budget, &field->units_charged,
                                 1 + (scan->end_segment - scan->first_segment) / 16))
            return CAIRN_MORE;
        must_be_ok(cairn_scan_set_remove(field->set, field->last_leaving));
        field->last_leaving = body->next_leaving;
    }
    return cairn_scan_set_pack(field->set, budget);
}

static cairn_status step_compare(cairn_force_field *field, cairn_budget *budget)
{
    while (field->scan < field->slots) {
        if (!cairn_budget_charge(budget, &field->units_charged, 1))
            return CAIRN_MORE;
        for (int32_t i = 0; i < ITEMS_PER_GROUP && field->scan < field->slots; i++, field->scan++) {
            struct cairn_force_field_body *body = &field->bodies[field->scan];
            uint8_t is_fixed = cairn_force_field_iteration_is_fixed(field, field->scan) != 0;

            if (!cairn_force_field_iteration_has(field, field->scan))
                continue;
            body->moved =
                field->recomputes_all || body->is_new || is_fixed != body->is_fixed ||
                !is_same_pose(body->placed, field->placements[field->front][field->scan].map_scan);
            body->is_fixed = is_fixed;
            body->dirty = body->moved;
            field->moved_count += body->moved;
            field->still_count += !body->moved;
        }
    }
    field->is_partly_still = field->moved_count > 0 && field->still_count > 0;
    field->scan = 0;
    return CAIRN_OK;
}

static void extend(cairn_box *box, cairn_vec2 p)
{
    box->min.x = cairn_min(box->min.x, p.x);
    box->min.y = cairn_min(box->min.y, p.y);
    box->max.x = cairn_max(box->max.x, p.x);
    box->max.y = cairn_max(box->max.y, p.y);
}

static void grow(cairn_box *box, cairn_real by)
{
    box->min.x -= by;
    box->min.y -= by;
    box->max.x += by;
    box->max.y += by;
}

/* Finishes the box of the current segment when all its points are in it. */
static void end_box(cairn_force_field *field)
{
    cairn_box *box = &field->boxes[field->extra[field->extra_front].runs + field->segment];

    grow(box, field->margin);
    if (!field->bodies[field->set->segments[field->segment].scan].is_fixed) {
        extend(&field->free_box, box->min);
        extend(&field->free_box, box->max);
    }
}

/* Transforms a segment without its points. */
static void place_segment(cairn_force_field *field)
{
    const cairn_scan_set_segment *from = &field->set->segments[field->segment];
    cairn_transform transform = field->bodies[from->scan].transform;
    cairn_vec2 a = cairn_transform_point(transform, from->segment.a);
    cairn_vec2 b = cairn_transform_point(transform, from->segment.b);
    cairn_box box = {a, a};

    extend(&box, b);
    field->segments[field->segment].a = a;
    field->segments[field->segment].b = b;
    field->directions[field->segment] = cairn_transform_direction(transform, from->direction);
    field->boxes[field->extra[field->extra_front].runs + field->segment] = box;
}

/* Transforms the next points of the current segment. */
static void place_points(cairn_force_field *field)
{
    const cairn_scan_set_segment *from = &field->set->segments[field->segment];
    cairn_transform transform = field->bodies[from->scan].transform;
    cairn_box *box = &field->boxes[field->extra[field->extra_front].runs + field->segment];
    cairn_vec2 points[CAIRN_FORCE_STRIP_POINTS];
    int32_t left = from->end_point - from->first_point - field->point;
    int32_t count = left < CAIRN_FORCE_STRIP_POINTS ? left : CAIRN_FORCE_STRIP_POINTS;

    cairn_scan_set_read(field->set, field->segment, field->point, count, points);
    for (int32_t i = 0; i < count; i++) {
        cairn_vec2 p = cairn_transform_point(transform, points[i]);

        extend(box, p);
        if (field->position != NULL)
            field->position[from->first_point + field->point + i] = p;
    }
    field->point += count;
    if (field->point == from->end_point - from->first_point)
        end_box(field);
}

/* Returns the units for the next points of a segment, of which `left` are left. */
static int32_t place_cost(int32_t left)
{
    return 1 + (left < CAIRN_FORCE_STRIP_POINTS ? left : CAIRN_FORCE_STRIP_POINTS) / 2;
}

static cairn_status step_place_extra(cairn_force_field *field, cairn_budget *budget)
{
    const struct cairn_force_field_extra *extra = &field->extra[field->extra_front];

    for (; field->recomputes_all && field->segment < extra->runs; field->segment++) {
        cairn_box *box = &field->boxes[field->segment];

        if (field->point == extra->first[field->segment])
            *box = cairn_box_empty();
        while (field->point < extra->first[field->segment + 1]) {
            int32_t end = field->point + POINTS_PER_GROUP;

            if (!cairn_budget_charge(budget, &field->units_charged, 1))
                return CAIRN_MORE;
            for (; field->point < end && field->point < extra->first[field->segment + 1];
                 field->point++)
                extend(box, extra->position[field->point]);
        }
        grow(box, field->margin);
    }
    field->segment = 0;
    field->point = -1;
    return CAIRN_OK;
}

/* Processes segments in storage order; `point` is -1 before the segment's ends are transformed. */
static cairn_status step_place(cairn_force_field *field, cairn_budget *budget)
{
    for (; field->segment < field->segment_count; field->segment++, field->point = -1) {
        const cairn_scan_set_segment *from = &field->set->segments[field->segment];
        int32_t count = from->end_point - from->first_point, slot = from->scan;

        if (field->point < 0) {
            int32_t is_first = field->set->scans[slot].first_segment == field->segment;

            if (!cairn_budget_charge(budget, &field->units_charged, is_first ? 4 : 2))
                return CAIRN_MORE;
            if (!field->bodies[slot].moved)
                continue;
            if (is_first)
                cairn_force_field_place_scan(field, slot);
            place_segment(field);
            field->point = 0;
            if (count == 0)
                end_box(field);
        }
        while (field->point < count) {
            if (!cairn_budget_charge(budget, &field->units_charged,
                                     place_cost(count - field->point)))
                return CAIRN_MORE;
            place_points(field);
        }
    }
    field->placed_segments = field->segment_count;
    return CAIRN_OK;
}

static cairn_status step_ungrid(cairn_force_field *field, cairn_budget *budget)
{
    while (cairn_point_grid_count(field->grid) > 0) {
        if (!cairn_budget_charge(budget, &field->units_charged, 2 * ITEMS_PER_GROUP))
            return CAIRN_MORE;
        for (int32_t i = 0; i < ITEMS_PER_GROUP; i++)
            cairn_point_grid_remove_last(field->grid);
    }
    return CAIRN_OK;
}

static cairn_status step_grid(cairn_force_field *field, cairn_budget *budget)
{
    int32_t count;
    const cairn_corner *corners = cairn_corner_list(field->corners, &count);

    while (cairn_point_grid_count(field->grid) < count) {
        if (!cairn_budget_charge(budget, &field->units_charged, 2))
            return CAIRN_MORE;
        /* The capacity is max_corners. */
        must_be_ok(cairn_point_grid_insert(field->grid,
                                           corners[cairn_point_grid_count(field->grid)].position));
    }
    field->segment = field->point = 0;
    return CAIRN_OK;
}

/* Sets the mass of a point; returns 1 when it has changed. */
static int set_mass(cairn_force_field *field, int32_t point, int is_in_region)
{
    uint32_t bit = UINT32_C(1) << point % 32, *word;
    int had;

    if (field->mass != NULL) {
        cairn_real mass = field->set->mass[point] * (is_in_region ? field->params.roi_mass : 1);

        had = field->mass[point] == mass;
        field->mass[point] = mass;
        return !had;
    }
    word = &field->in_region[point / 32];
    had = (*word & bit) != 0;
    *word = is_in_region ? *word | bit : *word & ~bit;
    return had != is_in_region;
}

/* Tests the next points of the current segment; returns 1 when a mass has changed. */
static int find_regions(cairn_force_field *field)
{
    const cairn_scan_set_segment *segment = &field->set->segments[field->segment];
    cairn_vec2 points[ITEMS_PER_GROUP];
    int32_t left = segment->end_point - segment->first_point - field->point,
            count = left < ITEMS_PER_GROUP ? left : ITEMS_PER_GROUP;
    int changed = 0;

    cairn_force_field_points(field, field->segment, field->point, count, points);
    for (int32_t i = 0; i < count; i++)
        changed |= set_mass(
            field, segment->first_point + field->point + i,
            cairn_point_grid_has_near(field->grid, points[i], field->params.roi_radius) != 0);
    field->point += count;
    return changed;
}

static cairn_status step_masses(cairn_force_field *field, cairn_budget *budget)
{
    for (; field->segment < field->segment_count; field->segment++, field->point = 0) {
        const cairn_scan_set_segment *segment = &field->set->segments[field->segment];
        int32_t count = segment->end_point - segment->first_point;

        while (field->point < count) {
            if (!cairn_budget_charge(budget, &field->units_charged, 12))
                return CAIRN_MORE;
            if (find_regions(field)) {
                field->bodies[segment->scan].moved = 1;
                field->bodies[segment->scan].dirty = 1;
            }
        }
    }
    return CAIRN_OK;
}

static cairn_status step_reset(cairn_force_field *field, cairn_budget *budget)
{
    const cairn_vec2 none = {0, 0};

    while (field->scan < field->slots) {
        if (!cairn_budget_charge(budget, &field->units_charged,
                                 cairn_force_field_has_springs(field) ? POINTS_PER_GROUP
                                                                      : POINTS_PER_GROUP / 2))
            return CAIRN_MORE;
        for (int32_t i = 0; i < POINTS_PER_GROUP && field->scan < field->slots;
             i++, field->scan++) {
            struct cairn_force_field_body *body = &field->bodies[field->scan];

            if (cairn_force_field_has_springs(field))
                cairn_force_field_remove_springs(field, field->scan);
            if (!body->dirty)
                continue;
            body->force = none;
            body->torque = 0;
            body->potential = 0;
            body->pairs = 0;
            body->segment_pairs = 0;
        }
    }
    return CAIRN_OK;
}

static void commit(cairn_force_field *field)
{
    const cairn_force_field_params *p = &field->params;
    cairn_force_field_state *state = &field->state;

    state->iterations++;
    state->start_iterations++;
    /* Both scans of a pair have counted it. */
    state->pairs = field->pairs / 2;
    state->segment_pairs = (int32_t)(field->segment_pairs / 2);
    state->potential = field->potential / 2;
    if (p->roi) {
        (void)cairn_corner_list(field->corners, &state->corners);
        state->corners_dropped = cairn_corner_dropped(field->corners);
    }
    if (cairn_force_field_has_springs(field)) {
        state->bonds = field->bond_count;
        state->bonds_dropped = field->bonds_dropped;
    }
    state->sigma = field->sigma;
    state->dt = field->dt;
    state->mean_relocation =
        field->free_scans > 0 ? field->relocation / (cairn_real)field->free_scans : 0;
    if (state->mean_relocation < p->stop_relocation)
        state->verdict = CAIRN_FORCE_FIELD_CONVERGED;
    else if (state->start_iterations >= p->max_steps)
        state->verdict = CAIRN_FORCE_FIELD_OUT_OF_STEPS;

    field->sigma_scale *= p->sigma_factor;
    field->sigma = cairn_max(p->sigma_end, p->sigma_start * field->sigma_scale -
                                               (cairn_real)state->start_iterations * p->sigma_step);
    field->dt = cairn_max(p->dt_end, field->dt * p->dt_factor);
    field->front = 1 - field->front;
    field->commits++;
    field->has_forces = 1;
    field->phase = FORCE_FIELD_AT_COMMIT;
    cairn_force_field_iteration_take_in(field);
    if (field->restart)
        cairn_force_field_iteration_start_cooling(field);
}

/* Invalidates cached positions after compaction: order and indices of the segments have changed. */
static void end_pack(cairn_force_field *field)
{
    field->segment_count = field->set->segment_count;
    field->placed_segments = 0;
    field->placed_sigma = 0;
    field->phase = FORCE_FIELD_AT_COMMIT;
    must_be_ok(cairn_box_sweep_begin(field->sweep, NULL, 0));
    if (field->corners != NULL)
        must_be_ok(cairn_corner_begin(field->corners, NULL, 0));
}

static cairn_status run_phase(cairn_force_field *field, cairn_budget *budget)
{
    switch (field->phase) {
    case FORCE_FIELD_PACK:
        return step_pack(field, budget);
    case FORCE_FIELD_COMPARE:
        return step_compare(field, budget);
    case FORCE_FIELD_PLACE_EXTRA:
        return step_place_extra(field, budget);
    case FORCE_FIELD_PLACE:
        return step_place(field, budget);
    case FORCE_FIELD_CORNERS:
        return cairn_corner_step(field->corners, budget);
    case FORCE_FIELD_UNGRID:
        return step_ungrid(field, budget);
    case FORCE_FIELD_GRID:
        return step_grid(field, budget);
    case FORCE_FIELD_MASSES:
        return step_masses(field, budget);
    case FORCE_FIELD_RESET:
        return step_reset(field, budget);
    case FORCE_FIELD_PAIRS:
        return cairn_force_field_pairs(field, budget);
    case FORCE_FIELD_SOLVE:
        return cairn_force_field_solve_step(field, budget);
    case FORCE_FIELD_MOVE:
        return cairn_force_field_move(field, budget);
    default:
        return cairn_force_field_mark_dirty(field, budget);
    }
}

static force_field_phase phase_after(const cairn_force_field *field)
{
    switch (field->phase) {
    case FORCE_FIELD_PACK:
        return FORCE_FIELD_AT_COMMIT;
    case FORCE_FIELD_COMPARE:
        if (field->moved_count == 0)
            return FORCE_FIELD_MOVE;
        return field->is_partly_still ? FORCE_FIELD_MARK_OLD : FORCE_FIELD_PLACE_EXTRA;
    case FORCE_FIELD_PLACE:
        if (field->params.roi)
            return FORCE_FIELD_CORNERS;
        return field->is_partly_still ? FORCE_FIELD_MARK_NEW : FORCE_FIELD_RESET;
    case FORCE_FIELD_MASSES:
        return field->is_partly_still ? FORCE_FIELD_MARK_NEW : FORCE_FIELD_RESET;
    case FORCE_FIELD_PAIRS:
        return cairn_force_field_has_springs(field) ? FORCE_FIELD_SOLVE : FORCE_FIELD_MOVE;
    default:
        return field->phase + 1;
    }
}

/* Returns the number of boxes of runs and transformed segments. */
static int32_t boxes_of(const cairn_force_field *field)
{
    return field->extra[field->extra_front].runs + field->placed_segments;
}

static cairn_status begin_phase(cairn_force_field *field)
{
    switch (field->phase) {
    case FORCE_FIELD_PLACE_EXTRA:
        field->segment = field->point = 0;
        return CAIRN_OK;
    case FORCE_FIELD_CORNERS:
        return cairn_corner_begin(field->corners, field->segments, field->segment_count);
    case FORCE_FIELD_MARK_OLD:
    case FORCE_FIELD_MARK_NEW:
        field->pair.is_begun = 0;
        return cairn_box_sweep_begin(field->sweep, field->boxes, boxes_of(field));
    case FORCE_FIELD_PAIRS:
        field->pair.is_begun = field->pair.units_due = 0;
        memset(&field->pair.cursor, 0, sizeof field->pair.cursor);
        field->tiles[0].line = field->tiles[1].line = -1;
        field->bond_count = field->bonds_dropped = 0;
        return cairn_box_sweep_begin_in(field->sweep, field->boxes, boxes_of(field),
                                        field->free_box);
    case FORCE_FIELD_SOLVE:
        cairn_force_field_solve_begin(field);
        return CAIRN_OK;
    case FORCE_FIELD_MOVE:
        field->scan = 0;
        field->pairs = 0;
        field->segment_pairs = 0;
        field->potential = 0;
        field->relocation = 0;
        field->free_scans = 0;
        return CAIRN_OK;
    default:
        field->scan = 0;
        return CAIRN_OK;
    }
}

cairn_status cairn_force_field_iteration_step(cairn_force_field *field, cairn_budget *budget)
{
    cairn_status status = run_phase(field, budget);

    if (status != CAIRN_OK)
        return status;
    if (field->phase == FORCE_FIELD_MOVE) {
        commit(field);
        return CAIRN_OK;
    }
    field->phase = phase_after(field);
    if (field->phase == FORCE_FIELD_AT_COMMIT) {
        end_pack(field);
        return CAIRN_OK;
    }
    return begin_phase(field);
}
