/* One iteration of force field simulation.
 *
 * Method (Adluru 2008, algorithm 1), one phase after the other, each in bounded steps:
 *   PLACE    segments and points into the map, boxes around the points of each segment, forces 0
 *   CORNERS  search for corners over all segments; GRID: the corners into a hash grid
 *   MASSES   points near a corner get the mass of a region of interest
 *   PAIRS    sweep over the boxes, grown by half the reach each; rows of point pairs of colliding segments of different
 *            scans, each pair once, its force applied with both signs
 *   MOVE     forces and torques summed over each scan (eqs. 7.6, 7.7), the scan moved from rest (eqs. 7.8, 7.9)
 *   commit   buffers swapped, cooling (section 7.3.2), verdict
 * Without regions of interest CORNERS, GRID and MASSES are left out.
 *
 * Source: Adluru 2008, chapter 7. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/force_field_iteration.h"

enum { GROUP = 4 };

/* A scan whose mean squared distance from the centre is less, in m^2, does not turn. */
#define MIN_SPREAD CAIRN_REAL(1e-6)

/* Relative growth of boxes beyond what exact arithmetic needs. */
#define SLACK CAIRN_REAL(1.001)

void cairn_force_iteration_take_in(cairn_force_field *field)
{
    field->committed = field->set->scan_count;
    field->segment_count = field->set->segment_count;
    field->point_count = field->set->point_count;
    field->revision++;
}

void cairn_force_iteration_start_cooling(cairn_force_field *field)
{
    field->restart = 0;
    field->sigma = field->params.sigma_start;
    field->dt = field->params.dt_start;
    field->state.start_iterations = 0;
    field->state.verdict = CAIRN_FORCE_FIELD_RUNNING;
}

int32_t cairn_force_iteration_is_fixed(const cairn_force_field *field, int32_t scan)
{
    const struct cairn_force_fixing *fixing = &field->fixings[scan];

    return field->clock >= fixing->from ? fixing->after : fixing->before;
}

void cairn_force_iteration_begin(cairn_force_field *field)
{
    const cairn_force_field_params *p = &field->params;

    field->clock++;
    /* A little below, so that rounding does not decide where the two meet. */
    field->by_sensor = field->sigma < p->sensor_below * p->sigma_start * CAIRN_REAL(0.9999);
    field->margin = p->reach * field->sigma / 2 * SLACK;
    cairn_force_kernel_set(&field->kernel, field->sigma, p->reach);
    field->scan = field->segment = field->point = 0;
    field->stage = STAGE_SCAN;
    field->other = -1;
    field->pairs = 0;
    field->segment_pairs = 0;
    field->potential = 0;
    field->relocation = 0;
    field->free_scans = 0;
    field->phase = PHASE_PLACE;
}

/* ---- The phases; each returns CAIRN_OK when it is done ---- */

static void place_scan(cairn_force_field *field)
{
    const cairn_scan_set_scan *scan = &field->set->scans[field->scan];
    struct cairn_force_placement *placement = &field->placements[1 - field->front][field->scan];

    memset(placement, 0, sizeof *placement);
    placement->map_scan = field->placements[field->front][field->scan].map_scan;
    field->transform = cairn_transform_of(placement->map_scan);
    placement->motion.centre =
        cairn_transform_point(field->transform, field->by_sensor ? scan->sensor : scan->centroid);
}

static void place_segment(cairn_force_field *field)
{
    const cairn_scan_set_segment *from = &field->set->segments[field->segment];
    cairn_vec2 a = cairn_transform_point(field->transform, from->segment.a);
    cairn_vec2 b = cairn_transform_point(field->transform, from->segment.b);
    cairn_box box = {a, a};

    field->segments[field->segment].a = a;
    field->segments[field->segment].b = b;
    field->directions[field->segment] = cairn_transform_direction(field->transform, from->direction);
    field->boxes[field->segment] = cairn_box_grow(cairn_box_extend(box, b), field->margin);
}

/* The next few points of the segment at hand. */
static void place_points(cairn_force_field *field, int32_t end)
{
    cairn_box box = field->boxes[field->segment];

    for (; field->point < end; field->point++) {
        cairn_vec2 p = cairn_transform_point(field->transform, field->set->points[field->point]);
        cairn_vec2 none = {0, 0};
        cairn_box around = {p, p};

        around = cairn_box_grow(around, field->margin);
        box = cairn_box_extend(cairn_box_extend(box, around.min), around.max);
        field->points.position[field->point] = p;
        field->points.mass[field->point] = field->set->mass[field->point];
        field->points.force[field->point] = none;
    }
    field->boxes[field->segment] = box;
}

static int32_t group_end(int32_t first, int32_t end)
{
    return end - first > GROUP ? first + GROUP : end;
}

static cairn_status step_place(cairn_force_field *field, cairn_budget *budget)
{
    while (field->scan < field->committed) {
        int32_t end = field->set->scans[field->scan].end_segment;

        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        if (field->stage == STAGE_SCAN) {
            budget->left--;
            place_scan(field);
            field->stage = STAGE_SEGMENT;
        } else if (field->stage == STAGE_POINTS) {
            int32_t end_point = field->set->segments[field->segment].end_point;

            place_points(field, group_end(field->point, end_point));
            if (field->point == end_point) {
                field->segment++;
                field->stage = STAGE_SEGMENT;
            }
        } else if (field->segment < end) {
            place_segment(field);
            field->stage = STAGE_POINTS;
        } else {
            field->scan++;
            field->stage = STAGE_SCAN;
        }
    }
    field->segment = field->point = 0;
    if (field->params.roi)
        return cairn_corner_begin(field->corners, field->segments, field->segment_count);
    return CAIRN_OK;
}

static cairn_status step_corners(cairn_force_field *field, cairn_budget *budget)
{
    cairn_status status = cairn_corner_step(field->corners, budget);

    if (status != CAIRN_OK)
        return status;
    if (budget->left <= 0)
        return CAIRN_MORE;
    cairn_point_grid_clear(field->grid);
    budget->left -= 1 + field->params.max_corners / 64;
    field->next = 0;
    return CAIRN_OK;
}

static cairn_status step_grid(cairn_force_field *field, cairn_budget *budget)
{
    int32_t count;
    const cairn_corner *corners = cairn_corner_list(field->corners, &count);
    cairn_status status;

    for (; field->next < count; field->next++) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        status = cairn_point_grid_insert(field->grid, corners[field->next].position);
        CAIRN_ASSERT(status == CAIRN_OK); /* as many places as corners */
        (void)status;
    }
    return CAIRN_OK;
}

static cairn_status step_masses(cairn_force_field *field, cairn_budget *budget)
{
    for (; cairn_point_grid_count(field->grid) > 0 && field->point < field->point_count; field->point++) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        if (cairn_point_grid_nearest(field->grid, field->points.position[field->point], field->params.roi_radius,
                                     NULL) >= 0)
            field->points.mass[field->point] *= field->params.roi_mass;
    }
    return CAIRN_OK;
}

/* 1 when the two segments attract each other; sets the cursor to their first row. */
static int begin_pair(cairn_force_field *field, int32_t first, int32_t second)
{
    const cairn_scan_set_segment *a = &field->set->segments[first], *b = &field->set->segments[second];

    if (a->scan == b->scan || b->first_point == b->end_point ||
        (cairn_force_iteration_is_fixed(field, a->scan) && cairn_force_iteration_is_fixed(field, b->scan)))
        return 0;
    field->segment_pairs++;
    field->segment = first;
    field->other = second;
    field->point = a->first_point;
    field->row = -1;
    field->cosine = cairn_abs(cairn_vec2_dot(field->directions[first], field->directions[second]));
    field->sum.pairs = 0;
    field->sum.potential = 0;
    return 1;
}

/* Points of b that can be within reach of the point of the row: all, or of evenly spaced ones those about the foot of the
 * perpendicular. More than needed by rounding and by what `spacing` leaves open. */
static void begin_row(cairn_force_field *field, const cairn_scan_set_segment *b)
{
    cairn_vec2 direction = field->directions[field->other], to;
    cairn_real radius, along, across, half;
    int32_t first, last;

    field->row = field->point;
    field->next = b->first_point;
    field->row_end = b->end_point;
    if (!(b->spacing > 0))
        return;
    radius = 2 * field->margin + b->spacing / 100;
    to = cairn_vec2_sub(field->points.position[field->point], field->points.position[b->first_point]);
    along = cairn_vec2_dot(to, direction);
    across = cairn_vec2_cross(to, direction);
    if (across * across > radius * radius) {
        field->next = field->row_end;
        return;
    }
    half = cairn_sqrt(radius * radius - across * across);
    first = cairn_real_to_int((along - half) / b->spacing);
    last = cairn_real_to_int((along + half) / b->spacing + 1);
    if (first > 0)
        field->next = first < b->end_point - b->first_point ? b->first_point + first : b->end_point;
    if (last < b->end_point - b->first_point)
        field->row_end = last > 0 ? b->first_point + last : b->first_point;
}

static cairn_status step_rows(cairn_force_field *field, cairn_budget *budget)
{
    const cairn_scan_set_segment *a = &field->set->segments[field->segment], *b = &field->set->segments[field->other];

    for (; field->point < a->end_point; field->point++) {
        cairn_status status;

        if (field->row != field->point) {
            if (budget->left <= 0)
                return CAIRN_MORE;
            budget->left--;
            begin_row(field, b);
        }
        status = cairn_force_kernel_row(&field->kernel, &field->points, field->point, &field->next, field->row_end,
                                        field->cosine, field->params.potential, &field->sum, budget);
        if (status != CAIRN_OK)
            return status;
    }
    field->pairs += field->sum.pairs;
    field->potential += field->sum.potential;
    field->other = -1;
    return CAIRN_OK;
}

static cairn_status step_pairs(cairn_force_field *field, cairn_budget *budget)
{
    for (;;) {
        int32_t first, second;
        cairn_status status;

        if (field->other >= 0) {
            status = step_rows(field, budget);
            if (status != CAIRN_OK)
                return status;
        }
        if (budget->left <= 0)
            return CAIRN_MORE;
        status = cairn_box_sweep_next(field->sweep, budget, &first, &second);
        if (status == CAIRN_EMPTY)
            break;
        if (status != CAIRN_OK)
            return status;
        if (begin_pair(field, first, second))
            budget->left--;
    }
    field->scan = field->point = 0;
    return CAIRN_OK;
}

/* From rest through the time dt with constant acceleration (eqs. 7.6 to 7.9). All points have mass 1. */
static void move_scan(cairn_force_field *field, struct cairn_force_placement *placement)
{
    const cairn_scan_set_scan *scan = &field->set->scans[field->scan];
    cairn_force_field_motion *motion = &placement->motion;
    cairn_real mass = (cairn_real)(scan->end_point - scan->first_point);
    cairn_real spread = field->by_sensor ? scan->sensor_spread : scan->centroid_spread;
    cairn_real half_square = field->dt * field->dt / 2, turn = 0;
    cairn_vec2 shift, centre, arm;

    if (cairn_force_iteration_is_fixed(field, field->scan) || !(mass > 0))
        return;
    shift = cairn_vec2_scale(motion->force, half_square / mass);
    if (spread > MIN_SPREAD)
        turn = motion->torque / (mass * spread) * half_square;

    centre = cairn_vec2_add(motion->centre, shift);
    placement->map_scan.theta = cairn_wrap_angle(placement->map_scan.theta + turn);
    arm = cairn_transform_direction(cairn_transform_of(placement->map_scan),
                                    field->by_sensor ? scan->sensor : scan->centroid);
    placement->map_scan.x = centre.x - arm.x;
    placement->map_scan.y = centre.y - arm.y;
    motion->relocation = cairn_sqrt(cairn_vec2_norm_squared(shift) + turn * turn * spread);
    field->relocation += motion->relocation;
    field->free_scans++;
}

static cairn_status step_move(cairn_force_field *field, cairn_budget *budget)
{
    while (field->scan < field->committed) {
        struct cairn_force_placement *placement = &field->placements[1 - field->front][field->scan];
        cairn_force_field_motion *motion = &placement->motion;
        int32_t end = group_end(field->point, field->set->scans[field->scan].end_point);

        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        for (; field->point < end; field->point++) {
            cairn_vec2 arm = cairn_vec2_sub(field->points.position[field->point], motion->centre);
            cairn_vec2 force = field->points.force[field->point];

            motion->force = cairn_vec2_add(motion->force, force);
            motion->torque += cairn_vec2_cross(arm, force);
        }
        if (end == field->set->scans[field->scan].end_point) {
            budget->left -= 2;
            move_scan(field, placement);
            field->scan++;
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
    state->pairs = field->pairs;
    state->segment_pairs = field->segment_pairs;
    if (p->roi) {
        (void)cairn_corner_list(field->corners, &state->corners);
        state->corners_dropped = cairn_corner_dropped(field->corners);
    }
    state->sigma = field->sigma;
    state->dt = field->dt;
    state->potential = field->potential;
    state->mean_relocation = field->free_scans > 0 ? field->relocation / (cairn_real)field->free_scans : 0;
    if (state->mean_relocation < p->stop_relocation)
        state->verdict = CAIRN_FORCE_FIELD_CONVERGED;
    else if (state->start_iterations >= p->max_steps)
        state->verdict = CAIRN_FORCE_FIELD_OUT_OF_STEPS;

    field->sigma = cairn_max(p->sigma_end, p->sigma_start - (cairn_real)state->start_iterations * p->sigma_step);
    field->dt = cairn_max(p->dt_end, field->dt * p->dt_factor);
    field->front = 1 - field->front;
    field->reported = field->committed;
    field->phase = PHASE_AT_COMMIT;
    cairn_force_iteration_take_in(field);
    if (field->restart)
        cairn_force_iteration_start_cooling(field);
}

cairn_status cairn_force_iteration_step(cairn_force_field *field, cairn_budget *budget)
{
    cairn_status status;

    switch (field->phase) {
    case PHASE_PLACE:
        status = step_place(field, budget);
        break;
    case PHASE_CORNERS:
        status = step_corners(field, budget);
        break;
    case PHASE_GRID:
        status = step_grid(field, budget);
        break;
    case PHASE_MASSES:
        status = step_masses(field, budget);
        break;
    case PHASE_PAIRS:
        status = step_pairs(field, budget);
        break;
    default:
        status = step_move(field, budget);
        break;
    }
    if (status != CAIRN_OK)
        return status;
    if (field->phase == PHASE_MOVE) {
        commit(field);
        return CAIRN_OK;
    }
    field->phase = field->phase == PHASE_PLACE && !field->params.roi ? PHASE_PAIRS : field->phase + 1;
    if (field->phase == PHASE_PAIRS)
        status = cairn_box_sweep_begin(field->sweep, field->boxes, field->segment_count);
    return status;
}
