/* One iteration of force field simulation.
 *
 * Method (Adluru 2008, algorithm 1).
 *
 * 1. Finds the scans that have moved since the last iteration.
 * 2. Places their segments and points in the map; bounding boxes of the points of each segment.
 * 3. Regions of interest, if any: corner detection over all segments; the corners into a hash grid;
 *    points near a corner are in a region.
 * 4. Forces between the points of near segments (force_field_pairs.c).
 * 5. In mode SPRINGS, motions to the equilibrium (force_field_springs.c).
 * 6. Moves each scan from rest (eqs. 7.6 to 7.9; force_field_move.c).
 * 7. Commit: swaps buffers, cooling (section 7.3.2), verdict.
 *
 * The forces of a scan are cached while its neighbours rest. Neighbours are the scans with segments
 * in near boxes. Before scans are placed the previous boxes are swept, then the current ones; every
 * scan near one that has moved is dirty. Only dirty scans are recomputed. When sigma has changed,
 * as during cooling, all are.
 *
 * Source: Adluru 2008, chapter 7. */
#include "src/base/build.h"

#include <string.h>

#include "src/fields/force_field_iteration.h"

enum { POINTS_PER_GROUP = 8, ITEMS_PER_GROUP = 4 };

/* relative growth of boxes beyond exact arithmetic */
#define BOX_GROWTH_FACTOR CAIRN_REAL(1.001)

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

/* External points in use. */
static const struct cairn_force_field_extra *extra_of(const cairn_force_field *field)
{
    return &field->extra[field->extra_front];
}

/* ---- Scans that have moved ---- */

/* Begins an iteration at a commit point. */
static void begin(cairn_force_field *field)
{
    const cairn_force_field_params *p = &field->params;

    field->clock++;
    field->segment_count = field->set->segment_count;
    if (field->extra_pending) {
        field->extra_front = 1 - field->extra_front;
        field->extra_pending = 0;
        field->placed_sigma = 0;
    }
    field->recomputes_all = field->sigma != field->placed_sigma || force_field_has_springs(field);
    field->placed_sigma = field->sigma;
    if (field->recomputes_all)
        field->free_box = cairn_box_empty();
    /* The threshold is slightly lower, so that rounding does not decide at equality. */
    field->rotates_about_sensor =
        force_field_has_springs(field) ||
        field->sigma < p->sensor_below * p->sigma_start * CAIRN_REAL(0.9999);
    field->margin = p->reach * field->sigma / 2 * BOX_GROWTH_FACTOR;
    cairn_force_kernel_set(&field->kernel, field->sigma, p->reach);
    field->moved_count = field->still_count = 0;
    field->units_charged = 0;
}

static int is_same_pose(cairn_pose a, cairn_pose b)
{
    return a.x == b.x && a.y == b.y && a.theta == b.theta;
}

/* Notes whether a scan has moved since the last iteration. */
static void compare_scan(cairn_force_field *field, int32_t scan)
{
    struct cairn_force_field_body *body = &field->bodies[scan];
    uint8_t is_fixed = force_field_is_fixed(field, scan) != 0;

    if (!force_field_has_scan(field, scan))
        return;
    body->moved = field->recomputes_all || body->is_new || is_fixed != body->is_fixed ||
                  !is_same_pose(body->placed, field->placements[field->front][scan].map_scan);
    body->is_fixed = is_fixed;
    body->dirty = body->moved;
    field->moved_count += body->moved;
    field->still_count += !body->moved;
}

static int compare_scans(cairn_force_field *field, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(field->phase_resume);
    for (field->scan = 0; field->scan < field->slots; field->scan++) {
        CAIRN_STEP_CHARGE_EVERY(field, phase_resume, budget, ITEMS_PER_GROUP, field->scan);
        compare_scan(field, field->scan);
    }
    CAIRN_STEP_END(field->phase_resume);
}

/* ---- Placing ---- */

/* Own functions of boxes: calls of those of geometry take 8 % of the instructions of a pair on a
 * Cortex-M7. */
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

/* First point of the current run of external points, and the one behind its last. */
static int32_t run_first(const cairn_force_field *field)
{
    return extra_of(field)->first[field->segment];
}

static int32_t run_end(const cairn_force_field *field)
{
    return extra_of(field)->first[field->segment + 1];
}

/* Boxes of the runs of external points. */
static int place_extra(cairn_force_field *field, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(field->phase_resume);
    for (field->segment = 0; field->segment < extra_of(field)->runs; field->segment++) {
        field->boxes[field->segment] = cairn_box_empty();
        for (field->point = run_first(field); field->point < run_end(field); field->point++) {
            CAIRN_STEP_CHARGE_EVERY(field, phase_resume, budget, POINTS_PER_GROUP,
                                    field->point - run_first(field));
            extend(&field->boxes[field->segment], extra_of(field)->position[field->point]);
        }
        grow(&field->boxes[field->segment], field->margin);
    }
    CAIRN_STEP_END(field->phase_resume);
}

/* The current segment, in the frame of its scan. */
static const cairn_scan_set_segment *segment_of(const cairn_force_field *field)
{
    return &field->set->segments[field->segment];
}

/* Number of points of the current segment. */
static int32_t point_count(const cairn_force_field *field)
{
    return segment_of(field)->end_point - segment_of(field)->first_point;
}

/* 1 when the current segment is the first of its scan. */
static int is_first_segment(const cairn_force_field *field)
{
    return field->set->scans[segment_of(field)->scan].first_segment == field->segment;
}

/* Box of the current segment. */
static cairn_box *box_of(cairn_force_field *field)
{
    return &field->boxes[extra_of(field)->runs + field->segment];
}

/* Transforms the current segment without its points, the first of a scan with the scan. */
static void place_segment(cairn_force_field *field)
{
    const cairn_scan_set_segment *from = segment_of(field);
    cairn_transform transform;
    cairn_box *box = box_of(field);
    cairn_vec2 a, b;

    if (is_first_segment(field))
        cairn_force_field_place_scan(field, from->scan);
    transform = field->bodies[from->scan].transform;
    a = cairn_transform_point(transform, from->segment.a);
    b = cairn_transform_point(transform, from->segment.b);
    field->segments[field->segment].a = a;
    field->segments[field->segment].b = b;
    field->directions[field->segment] = cairn_transform_direction(transform, from->direction);
    box->min = box->max = a;
    extend(box, b);
}

/* Number of points of the current segment that are transformed together from `point` on. */
static int32_t strip_count(const cairn_force_field *field)
{
    int32_t left = point_count(field) - field->point;

    return left < CAIRN_FORCE_STRIP_POINTS ? left : CAIRN_FORCE_STRIP_POINTS;
}

/* Transforms points of the current segment from `point` on. */
static void place_points(cairn_force_field *field)
{
    const cairn_scan_set_segment *from = segment_of(field);
    cairn_transform transform = field->bodies[from->scan].transform;
    cairn_box *box = box_of(field);
    cairn_vec2 points[CAIRN_FORCE_STRIP_POINTS];
    int32_t count = strip_count(field);

    cairn_scan_set_read(field->set, field->segment, field->point, count, points);
    for (int32_t i = 0; i < count; i++) {
        cairn_vec2 p = cairn_transform_point(transform, points[i]);

        extend(box, p);
        if (field->position != NULL)
            field->position[from->first_point + field->point + i] = p;
    }
}

/* Finishes the box of the current segment, with all its points. */
static void end_box(cairn_force_field *field)
{
    cairn_box *box = box_of(field);

    grow(box, field->margin);
    if (!field->bodies[segment_of(field)->scan].is_fixed) {
        extend(&field->free_box, box->min);
        extend(&field->free_box, box->max);
    }
}

/* Segments, points and boxes of the scans that have moved, in storage order. */
static int place(cairn_force_field *field, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(field->phase_resume);
    for (field->segment = 0; field->segment < field->segment_count; field->segment++) {
        CAIRN_STEP_CHARGE(field, phase_resume, budget, is_first_segment(field) ? 4 : 2);
        if (!field->bodies[segment_of(field)->scan].moved)
            continue;
        place_segment(field);
        for (field->point = 0; field->point < point_count(field);
             field->point += CAIRN_FORCE_STRIP_POINTS) {
            CAIRN_STEP_CHARGE(field, phase_resume, budget, 1 + strip_count(field) / 2);
            place_points(field);
        }
        end_box(field);
    }
    field->placed_segments = field->segment_count;
    CAIRN_STEP_END(field->phase_resume);
}

/* ---- Regions of interest ---- */

static int32_t corner_count(const cairn_force_field *field)
{
    int32_t count;

    (void)cairn_corner_list(field->corners, &count);
    return count;
}

/* Inserts a corner into the hash grid, whose capacity is max_corners. */
static void insert_corner(cairn_force_field *field, int32_t corner)
{
    int32_t count;
    const cairn_corner *corners = cairn_corner_list(field->corners, &count);

    cairn_must_be_ok(cairn_point_grid_insert(field->grid, corners[corner].position));
}

/* Removes a few corners from the hash grid. */
static void remove_corners(cairn_force_field *field)
{
    for (int32_t i = 0; i < ITEMS_PER_GROUP; i++)
        cairn_point_grid_remove_last(field->grid);
}

/* The corners into the hash grid, in place of those of the last iteration. */
static int fill_grid(cairn_force_field *field, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(field->phase_resume);
    while (cairn_point_grid_count(field->grid) > 0) {
        CAIRN_STEP_CHARGE(field, phase_resume, budget, 2 * ITEMS_PER_GROUP);
        remove_corners(field);
    }
    while (cairn_point_grid_count(field->grid) < corner_count(field)) {
        CAIRN_STEP_CHARGE(field, phase_resume, budget, 2);
        insert_corner(field, cairn_point_grid_count(field->grid));
    }
    CAIRN_STEP_END(field->phase_resume);
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

/* Masses of a few points of the current segment from `point` on. A scan with a changed mass counts
 * as moved. */
static void set_masses(cairn_force_field *field)
{
    const cairn_scan_set_segment *segment = segment_of(field);
    cairn_vec2 points[ITEMS_PER_GROUP];
    int32_t left = point_count(field) - field->point,
            count = left < ITEMS_PER_GROUP ? left : ITEMS_PER_GROUP;
    int has_changed = 0;

    cairn_force_field_points(field, field->segment, field->point, count, points);
    for (int32_t i = 0; i < count; i++)
        has_changed |= set_mass(
            field, segment->first_point + field->point + i,
            cairn_point_grid_has_near(field->grid, points[i], field->params.roi_radius) != 0);
    if (has_changed)
        field->bodies[segment->scan].moved = field->bodies[segment->scan].dirty = 1;
}

/* The points near a corner. */
static int find_regions(cairn_force_field *field, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(field->phase_resume);
    for (field->segment = 0; field->segment < field->segment_count; field->segment++)
        for (field->point = 0; field->point < point_count(field); field->point += ITEMS_PER_GROUP) {
            CAIRN_STEP_CHARGE(field, phase_resume, budget, 12);
            set_masses(field);
        }
    CAIRN_STEP_END(field->phase_resume);
}

/* ---- Forces ---- */

/* Sets the forces of a scan to 0 when they are recomputed. */
static void reset_scan(cairn_force_field *field, int32_t scan)
{
    const cairn_vec2 none = {0, 0};
    struct cairn_force_field_body *body = &field->bodies[scan];

    if (force_field_has_springs(field))
        cairn_force_field_remove_springs(field, scan);
    if (!body->dirty)
        return;
    body->force = none;
    body->torque = 0;
    body->potential = 0;
    body->pairs = 0;
    body->segment_pairs = 0;
}

static int reset(cairn_force_field *field, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(field->phase_resume);
    for (field->scan = 0; field->scan < field->slots; field->scan++) {
        if (field->scan % POINTS_PER_GROUP == 0)
            CAIRN_STEP_CHARGE(field, phase_resume, budget,
                              force_field_has_springs(field) ? POINTS_PER_GROUP
                                                             : POINTS_PER_GROUP / 2);
        reset_scan(field, field->scan);
    }
    CAIRN_STEP_END(field->phase_resume);
}

/* ---- The iteration ---- */

/* Commit point: the result of the iteration, and the cooling for the next one. */
static void commit(cairn_force_field *field)
{
    const cairn_force_field_params *p = &field->params;
    const struct cairn_force_field_totals *totals = &field->totals;
    cairn_force_field_state *state = &field->state;

    state->iterations++;
    state->start_iterations++;
    /* Both scans of a pair have counted it. */
    state->pairs = totals->pairs / 2;
    state->segment_pairs = (int32_t)(totals->segment_pairs / 2);
    state->potential = totals->potential / 2;
    if (p->roi) {
        (void)cairn_corner_list(field->corners, &state->corners);
        state->corners_dropped = cairn_corner_dropped(field->corners);
    }
    if (force_field_has_springs(field)) {
        state->bonds = field->bond_count;
        state->bonds_dropped = field->bonds_dropped;
    }
    state->sigma = field->sigma;
    state->dt = field->dt;
    state->mean_relocation =
        totals->free_scans > 0 ? totals->relocation / (cairn_real)totals->free_scans : 0;
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
    cairn_force_field_iteration_take_in(field);
    if (field->restart)
        cairn_force_field_iteration_start_cooling(field);
}

/* 1 when the forces of some scans are those of the last iteration. */
static int is_partly_still(const cairn_force_field *field)
{
    return field->moved_count > 0 && field->still_count > 0;
}

int cairn_force_field_iteration(cairn_force_field *field, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(field->resume);
    begin(field);
    CAIRN_STEP_RUN(field, resume, budget, compare_scans);
    if (field->moved_count > 0) {
        if (is_partly_still(field))
            CAIRN_STEP_RUN(field, resume, budget, cairn_force_field_mark_dirty);
        if (field->recomputes_all)
            CAIRN_STEP_RUN(field, resume, budget, place_extra);
        CAIRN_STEP_RUN(field, resume, budget, place);
        if (field->params.roi) {
            cairn_must_be_ok(
                cairn_corner_begin(field->corners, field->segments, field->segment_count));
            CAIRN_STEP_UNTIL(field->resume, cairn_corner_step(field->corners, budget) == CAIRN_OK);
            CAIRN_STEP_RUN(field, resume, budget, fill_grid);
            CAIRN_STEP_RUN(field, resume, budget, find_regions);
        }
        if (is_partly_still(field))
            CAIRN_STEP_RUN(field, resume, budget, cairn_force_field_mark_dirty);
        CAIRN_STEP_RUN(field, resume, budget, reset);
        CAIRN_STEP_RUN(field, resume, budget, cairn_force_field_pairs);
        if (force_field_has_springs(field))
            CAIRN_STEP_RUN(field, resume, budget, cairn_force_field_solve);
    }
    CAIRN_STEP_RUN(field, resume, budget, cairn_force_field_move);
    commit(field);
    CAIRN_STEP_END(field->resume);
}

/* ---- Between iterations ---- */

/* Units of removing the scan that was removed last. */
static int32_t remove_cost(const cairn_force_field *field)
{
    const cairn_scan_set_scan *scan = &field->set->scans[field->last_leaving];

    return 1 + (scan->end_segment - scan->first_segment) / 16;
}

/* Invalidates cached positions after compaction: order and indices of the segments have changed. */
static void end_pack(cairn_force_field *field)
{
    field->segment_count = field->set->segment_count;
    field->placed_segments = 0;
    field->placed_sigma = 0;
    cairn_must_be_ok(cairn_box_sweep_begin(field->sweep, NULL, 0));
    if (field->corners != NULL)
        cairn_must_be_ok(cairn_corner_begin(field->corners, NULL, 0));
}

int cairn_force_field_pack(cairn_force_field *field, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(field->phase_resume);
    field->has_forces = 0;
    while (field->last_leaving >= 0) {
        CAIRN_STEP_CHARGE(field, phase_resume, budget, remove_cost(field));
        cairn_must_be_ok(cairn_scan_set_remove(field->set, field->last_leaving));
        field->last_leaving = field->bodies[field->last_leaving].next_leaving;
    }
    CAIRN_STEP_UNTIL(field->phase_resume, cairn_scan_set_pack(field->set, budget) == CAIRN_OK);
    end_pack(field);
    CAIRN_STEP_END(field->phase_resume);
}
