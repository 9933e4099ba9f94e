/* Rigid motion of the scans of a force field.
 *
 * Method: from rest through the time dt with constant acceleration, all points of mass 1 (Adluru
 * 2008, eqs. 7.6 to 7.9); in mode SPRINGS by 1/2 dt^2 times the solution of the springs' linear
 * system. */
#include "src/base/build.h"

#include <string.h>

#include "src/fields/force_field_iteration.h"

/* m^2: a scan with a smaller mean squared distance from the centre does not rotate */
#define MIN_SPREAD_M2 CAIRN_REAL(1e-6)

/* Translation of the centre of a scan and rotation about it. */
struct motion {
    cairn_vec2 shift;
    cairn_real turn, relocation;
};

void cairn_force_field_place_scan(cairn_force_field *field, int32_t index)
{
    const cairn_scan_set_scan *scan = &field->set->scans[index];
    struct cairn_force_field_body *body = &field->bodies[index];

    body->placed = field->placements[field->front][index].map_scan;
    body->is_new = 0;
    body->transform = cairn_transform_of(body->placed);
    body->centre = cairn_transform_point(
        body->transform, field->rotates_about_sensor ? scan->sensor : scan->centroid);
}

static struct motion thesis_motion(const cairn_force_field *field, int32_t index)
{
    const cairn_scan_set_scan *scan = &field->set->scans[index];
    const struct cairn_force_field_body *body = &field->bodies[index];
    cairn_real mass = (cairn_real)(scan->end_point - scan->first_point);
    cairn_real spread = field->rotates_about_sensor ? scan->sensor_spread : scan->centroid_spread;
    cairn_real half_square = field->dt * field->dt / 2;
    struct motion motion;

    motion.shift = cairn_vec2_scale(body->force, half_square / mass);
    motion.turn = spread > MIN_SPREAD_M2 ? body->torque / (mass * spread) * half_square : 0;
    motion.relocation =
        cairn_sqrt(cairn_vec2_norm_squared(motion.shift) + motion.turn * motion.turn * spread);
    return motion;
}

static struct motion springs_motion(const cairn_force_field *field, int32_t index)
{
    const cairn_scan_set_scan *scan = &field->set->scans[index];
    const struct cairn_force_field_body *body = &field->bodies[index];
    const struct cairn_force_field_unknown *unknown = &field->unknowns[index];
    cairn_real half_square = field->dt * field->dt / 2, share = half_square;
    cairn_vec2 arm = cairn_vec2_sub(cairn_transform_point(body->transform, scan->centroid),
                                    body->centre),
               mean;
    struct motion motion;

    motion.turn = unknown->motion[2];
    mean.x = unknown->motion[0] - motion.turn * arm.y;
    mean.y = unknown->motion[1] + motion.turn * arm.x;
    motion.relocation = cairn_sqrt(cairn_vec2_norm_squared(mean) +
                                   motion.turn * motion.turn * scan->centroid_spread);
    if (motion.relocation * share > field->params.max_relocation)
        share = field->params.max_relocation / motion.relocation;
    motion.shift.x = share * unknown->motion[0];
    motion.shift.y = share * unknown->motion[1];
    motion.turn *= share;
    motion.relocation *= share;
    return motion;
}

static void move_scan(cairn_force_field *field, int32_t index)
{
    const cairn_scan_set_scan *scan = &field->set->scans[index];
    const struct cairn_force_field_body *body = &field->bodies[index];
    struct cairn_force_field_placement *placement = &field->placements[1 - field->front][index];
    cairn_force_field_motion *report = &placement->motion;
    struct motion motion;
    cairn_vec2 centre, arm;

    placement->map_scan = body->placed;
    report->centre = body->centre;
    report->force = body->force;
    report->torque = body->torque;
    report->relocation = 0;
    if (body->is_fixed || scan->end_point == scan->first_point)
        return;
    motion =
        force_field_has_springs(field) ? springs_motion(field, index) : thesis_motion(field, index);

    /* A scan without force keeps its pose exactly. */
    if (motion.shift.x != 0 || motion.shift.y != 0 || motion.turn != 0) {
        centre = cairn_vec2_add(body->centre, motion.shift);
        placement->map_scan.theta = cairn_wrap_angle(placement->map_scan.theta + motion.turn);
        arm =
            cairn_transform_direction(cairn_transform_of(placement->map_scan),
                                      field->rotates_about_sensor ? scan->sensor : scan->centroid);
        placement->map_scan.x = centre.x - arm.x;
        placement->map_scan.y = centre.y - arm.y;
    }
    report->relocation = motion.relocation;
    field->totals.relocation += motion.relocation;
    field->totals.free_scans++;
}

/* Moves a scan that is present, and adds its statistics. */
static void move_present(cairn_force_field *field, int32_t index)
{
    const cairn_scan_set_scan *scan = &field->set->scans[index];
    struct cairn_force_field_body *body = &field->bodies[index];

    body->has_forces = force_field_has_scan(field, index) != 0;
    if (!body->has_forces)
        return;
    /* A scan without segments was not transformed. */
    if (body->moved && scan->first_segment == scan->end_segment)
        cairn_force_field_place_scan(field, index);
    move_scan(field, index);
    field->totals.pairs += body->pairs;
    field->totals.segment_pairs += body->segment_pairs;
    field->totals.potential += body->potential;
}

int cairn_force_field_move(cairn_force_field *field, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(field->phase_resume);
    memset(&field->totals, 0, sizeof field->totals);
    for (field->scan = 0; field->scan < field->slots; field->scan++) {
        CAIRN_STEP_CHARGE(field, phase_resume, budget, 4);
        move_present(field, field->scan);
    }
    CAIRN_STEP_END(field->phase_resume);
}
