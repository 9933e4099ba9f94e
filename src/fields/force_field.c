/* Force field simulation: memory, inputs and readers. Parameters are in force_field_params.c; an
 * iteration is in force_field_iteration.c, force_field_pairs.c, force_field_springs.c and
 * force_field_move.c.
 *
 * Layout: the scans are in a scan set. Arrays of segments and, unless generated on demand, points
 * hold them in the map. Poses and motions are double-buffered: readers see one buffer, the current
 * iteration fills the other. Scans added during an iteration lie behind those in use. Removed ones
 * are compacted between iterations. External points are double-buffered as well.
 *
 * Limits: in float the map should not be larger than about 100 m. The time of an iteration grows
 * with the pairs of points within reach. The force on a single point is not stored:
 * cairn_force_field_point_force computes it again.
 *
 * Source: Adluru 2008, chapter 7. */
#include "src/base/build.h"

#include <string.h>

#include "src/fields/force_field_iteration.h"

/* ---- Memory ---- */

static int is_not_negative(cairn_real x)
{
    return x >= 0 && x <= CAIRN_MAX_MAGNITUDE;
}

static cairn_scan_set_params set_params(const cairn_force_field_params *p)
{
    cairn_scan_set_params params = {
        .max_scans = p->max_scans,
        .max_segments = p->max_segments,
        .max_points = p->max_points,
        .spacing = p->spacing,
    };
    return params;
}

static cairn_corner_params corner_params(const cairn_force_field_params *p)
{
    cairn_corner_params params = {.max_segments = p->max_segments,
                                  .max_corners = p->max_corners,
                                  .min_opening = p->corner_min_opening,
                                  .max_opening = p->corner_max_opening,
                                  .end_distance = p->corner_distance,
                                  .crossings = p->roi == CAIRN_FORCE_FIELD_ROI_CROSSINGS};
    return params;
}

static cairn_point_grid_params grid_params(const cairn_force_field_params *p)
{
    cairn_point_grid_params params = {
        .max_points = p->max_corners,
        .cell_size = 2 * p->roi_radius,
    };
    return params;
}

/* The arrays of the external points. */
static void take_extra(struct cairn_force_field_extra *extra, cairn_pool *pool, size_t count)
{
    if (count == 0)
        return;
    CAIRN_TAKE(extra, pool, position, count);
    CAIRN_TAKE(extra, pool, weight, count);
    CAIRN_TAKE(extra, pool, direction, count);
    CAIRN_TAKE(extra, pool, first, count + 1);
}

/* The arrays of positions and masses of the points, or of the bits of those in a region. */
static void take_points(cairn_force_field *field, cairn_pool *pool,
                        const cairn_force_field_params *params)
{
    size_t points = (size_t)params->max_points;

    if (!(params->spacing > 0)) {
        CAIRN_TAKE(field, pool, position, points);
        if (params->roi)
            CAIRN_TAKE(field, pool, mass, points);
    } else if (params->roi) {
        CAIRN_TAKE(field, pool, in_region, points / 32 + 1);
    }
}

/* The nested objects. */
static void take_objects(cairn_force_field *field, cairn_pool *pool,
                         const cairn_force_field_params *params)
{
    cairn_scan_set_params set = set_params(params);
    cairn_box_sweep_params sweep = {.max_boxes = params->max_extra + params->max_segments};
    cairn_corner_params corners = corner_params(params);
    cairn_point_grid_params grid = grid_params(params);

    CAIRN_TAKE_OBJECT(field, pool, set, scan_set, &set);
    CAIRN_TAKE_OBJECT(field, pool, sweep, box_sweep, &sweep);
    if (params->roi) {
        CAIRN_TAKE_OBJECT(field, pool, corners, corner, &corners);
        CAIRN_TAKE_OBJECT(field, pool, grid, point_grid, &grid);
    }
}

/* Sets a new field, whose arrays are allocated. */
static void initialize(cairn_force_field *field, const cairn_force_field_params *params)
{
    size_t points = (size_t)params->max_points;

    field->params = *params;
    if (field->unknowns != NULL && params->alignment_torque > 0)
        field->params.potential = 1;
    if (field->mass != NULL)
        memset(field->mass, 0, points * sizeof *field->mass);
    else
        field->mass = field->set->mass;
    if (field->in_region != NULL)
        memset(field->in_region, 0, (points / 32 + 1) * sizeof *field->in_region);
    cairn_force_kernel_init(&field->kernel);
    cairn_force_field_clear(field);
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_force_field *build(cairn_pool *pool, const cairn_force_field_params *params)
{
    size_t scans = (size_t)params->max_scans, segments = (size_t)params->max_segments,
           extra = (size_t)params->max_extra;
    cairn_force_field *field = cairn_object_take(pool, sizeof *field);

    CAIRN_TAKE(field, pool, placements[0], scans);
    CAIRN_TAKE(field, pool, placements[1], scans);
    CAIRN_TAKE(field, pool, bodies, scans);
    CAIRN_TAKE(field, pool, segments, segments);
    CAIRN_TAKE(field, pool, directions, segments);
    CAIRN_TAKE(field, pool, boxes, extra + segments);
    take_points(field, pool, params);
    for (int i = 0; i < 2; i++)
        take_extra(field != NULL ? &field->extra[i] : NULL, pool, extra);
    take_objects(field, pool, params);
    if (params->mode == CAIRN_FORCE_FIELD_SPRINGS) {
        CAIRN_TAKE(field, pool, unknowns, scans);
        CAIRN_TAKE(field, pool, bonds, params->max_bonds);
    }
    if (field != NULL)
        initialize(field, params);
    return field;
}

CAIRN_OBJECT(force_field, force_field, build);

/* ---- Inputs ---- */

/* Returns the commit point at which an input takes effect. */
static uint32_t next_commit(const cairn_force_field *field)
{
    return force_field_is_between(field) ? field->commits : field->commits + 1;
}

cairn_status cairn_force_field_add_scan(cairn_force_field *field, const cairn_scan_view *view,
                                        const cairn_real *mass, cairn_pose map_scan,
                                        cairn_fault *fault)
{
    cairn_status status;
    struct cairn_force_field_body *body;
    int32_t slot;

    if (field == NULL)
        return cairn_refuse(fault, -1, "no field", CAIRN_BAD_ARGUMENT);
    status = cairn_pose_check(map_scan, CAIRN_MAX_MAGNITUDE, fault);
    if (status != CAIRN_OK)
        return status;
    slot = cairn_scan_set_next(field->set);
    status = cairn_scan_set_add(field->set, view, mass, fault);
    if (status != CAIRN_OK)
        return status;

    map_scan.theta = cairn_wrap_angle(map_scan.theta);
    for (int i = 0; i < 2; i++) {
        struct cairn_force_field_placement *placement = &field->placements[i][slot];

        memset(placement, 0, sizeof *placement);
        placement->map_scan = map_scan;
    }
    body = &field->bodies[slot];
    memset(body, 0, sizeof *body);
    body->is_new = 1;
    body->active_from = next_commit(field);
    field->scan_count++;
    if (force_field_is_between(field))
        cairn_force_field_iteration_take_in(field);
    return CAIRN_OK;
}

int32_t cairn_force_field_next(const cairn_force_field *field)
{
    return cairn_scan_set_next(field->set);
}

static int is_there(const cairn_force_field *field, int32_t scan)
{
    return field != NULL && scan >= 0 && scan < field->set->scan_count &&
           field->set->scans[scan].in_use && !field->bodies[scan].is_leaving;
}

cairn_status cairn_force_field_fix(cairn_force_field *field, int32_t scan, int32_t yes)
{
    struct cairn_force_field_body *body;

    if (!is_there(field, scan))
        return CAIRN_BAD_ARGUMENT;
    body = &field->bodies[scan];
    body->fixed_before = force_field_is_fixed(field, scan) != 0;
    body->fixed_after = yes != 0;
    body->fixed_from = field->clock + 1;
    return CAIRN_OK;
}

cairn_status cairn_force_field_place(cairn_force_field *field, int32_t scan, cairn_pose map_scan)
{
    cairn_status status;

    if (!is_there(field, scan) || !force_field_is_between(field))
        return CAIRN_BAD_ARGUMENT;
    status = cairn_pose_check(map_scan, CAIRN_MAX_MAGNITUDE, NULL);
    if (status != CAIRN_OK)
        return status;
    map_scan.theta = cairn_wrap_angle(map_scan.theta);
    for (int i = 0; i < 2; i++)
        field->placements[i][scan].map_scan = map_scan;
    field->revision++;
    return CAIRN_OK;
}

cairn_status cairn_force_field_remove(cairn_force_field *field, int32_t scan)
{
    struct cairn_force_field_body *body;

    if (!is_there(field, scan))
        return CAIRN_BAD_ARGUMENT;
    body = &field->bodies[scan];
    body->is_leaving = 1;
    body->active_until = next_commit(field);
    body->next_leaving = field->last_leaving;
    field->last_leaving = scan;
    field->scan_count--;
    if (force_field_is_between(field))
        field->revision++;
    return CAIRN_OK;
}

static cairn_status check_extra(const cairn_force_field *field, const cairn_oriented_point *points,
                                const cairn_real *weights, int32_t count)
{
    if (field == NULL || count < 0 || (count > 0 && (points == NULL || weights == NULL)))
        return CAIRN_BAD_ARGUMENT;
    if (count > field->params.max_extra)
        return CAIRN_FULL;
    for (int32_t i = 0; i < count; i++) {
        cairn_vec2 p = points[i].position, d = points[i].direction;

        if (!cairn_vec2_is_finite(p) || !cairn_vec2_is_finite(d) || !cairn_is_finite(weights[i]))
            return CAIRN_NOT_FINITE;
        if (!cairn_vec2_is_within(p, CAIRN_MAX_MAGNITUDE) ||
            !cairn_vec2_is_within(d, CAIRN_MAX_MAGNITUDE) || !is_not_negative(weights[i]))
            return CAIRN_BAD_ARGUMENT;
    }
    return CAIRN_OK;
}

/* Copies the points, cut into runs of one direction, which are processed like the points of a
 * segment. */
static void copy_extra(struct cairn_force_field_extra *extra, const cairn_oriented_point *points,
                       const cairn_real *weights, int32_t count)
{
    extra->runs = 0;
    extra->count = count;
    for (int32_t i = 0; i < count; i++) {
        cairn_vec2 d = points[i].direction;

        extra->position[i] = points[i].position;
        extra->weight[i] = weights[i];
        if (i > 0 && d.x == points[i - 1].direction.x && d.y == points[i - 1].direction.y)
            continue;
        extra->direction[extra->runs] = cairn_vec2_unit(d);
        extra->first[extra->runs++] = i;
    }
    if (count > 0)
        extra->first[extra->runs] = count;
}

cairn_status cairn_force_field_set_extra(cairn_force_field *field,
                                         const cairn_oriented_point *points,
                                         const cairn_real *weights, int32_t count)
{
    cairn_status status = check_extra(field, points, weights, count);

    if (status != CAIRN_OK)
        return status;
    copy_extra(&field->extra[1 - field->extra_front], points, weights, count);
    field->extra_pending = 1;
    return CAIRN_OK;
}

void cairn_force_field_restart(cairn_force_field *field)
{
    if (force_field_is_between(field))
        cairn_force_field_iteration_start_cooling(field);
    else
        field->restart = 1;
}

void cairn_force_field_clear(cairn_force_field *field)
{
    cairn_scan_set_clear(field->set);
    for (int i = 0; i < 2; i++)
        field->extra[i].count = field->extra[i].runs = 0;
    field->extra_pending = 0;
    field->last_leaving = -1;
    field->scan_count = 0;
    field->has_forces = 0;
    field->resume = field->phase_resume = field->pair_resume = 0;
    field->units_charged = 0;
    field->clock = field->commits = 0;
    field->placed_sigma = 0;
    field->placed_segments = 0;
    memset(&field->state, 0, sizeof field->state);
    cairn_force_field_iteration_take_in(field);
    cairn_force_field_iteration_start_cooling(field);
}

/* ---- Steps ---- */

/* 1 when scans were removed, or their removal is under way. */
static int is_untidy(const cairn_force_field *field)
{
    return field->last_leaving >= 0 || field->set->needs_packing || field->phase_resume != 0;
}

/* Runs iterations until the simulation has stopped; one: only the next. */
static cairn_status run(cairn_force_field *field, cairn_budget *budget, int one)
{
    do {
        if (force_field_is_between(field)) {
            if (is_untidy(field) && !cairn_force_field_pack(field, budget))
                return CAIRN_MORE;
            if (field->scan_count == 0)
                return CAIRN_EMPTY;
            if (field->state.verdict != CAIRN_FORCE_FIELD_RUNNING)
                return CAIRN_OK;
            if (budget->left <= 0)
                return CAIRN_MORE;
        }
        if (!cairn_force_field_iteration(field, budget))
            return CAIRN_MORE;
    } while (!one);
    return CAIRN_OK;
}

static cairn_status run_counted(cairn_force_field *field, cairn_budget *budget, int one)
{
    cairn_status status;
    int32_t before, used;

    if (field == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    before = budget->left;
    status = run(field, budget, one);
    used = before - budget->left;
    field->state.units += used;
    if (used > field->state.max_step_units)
        field->state.max_step_units = used;
    return status;
}

cairn_status cairn_force_field_step(cairn_force_field *field, cairn_budget *budget)
{
    return run_counted(field, budget, 0);
}

cairn_status cairn_force_field_iterate(cairn_force_field *field, cairn_budget *budget)
{
    return run_counted(field, budget, 1);
}

/* ---- Readers ---- */

uint32_t cairn_force_field_revision(const cairn_force_field *field)
{
    return field->revision;
}

int32_t cairn_force_field_pose_count(const cairn_force_field *field)
{
    return field->slots;
}

cairn_pose cairn_force_field_pose(const cairn_force_field *field, int32_t scan)
{
    CAIRN_ASSERT(scan >= 0 && scan < field->slots);
    return field->placements[field->front][scan].map_scan;
}

cairn_force_field_motion cairn_force_field_motion_of(const cairn_force_field *field, int32_t scan)
{
    CAIRN_ASSERT(scan >= 0 && scan < field->slots);
    return field->placements[field->front][scan].motion;
}

cairn_force_field_state cairn_force_field_read(const cairn_force_field *field)
{
    return field->state;
}

cairn_real cairn_force_field_potential(const cairn_force_field *field)
{
    return field->state.potential;
}

const cairn_scan_set *cairn_force_field_scans(const cairn_force_field *field)
{
    return field->set;
}

int32_t cairn_force_field_has(const cairn_force_field *field, int32_t scan)
{
    return scan >= 0 && scan < field->slots && force_field_has_scan(field, scan);
}

/* Returns the segment of a scan that contains a point; segments are sorted by their points. */
static int32_t segment_of(const cairn_scan_set *set, const cairn_scan_set_scan *scan, int32_t point)
{
    int32_t low = scan->first_segment, high = scan->end_segment;

    while (high - low > 1) {
        int32_t middle = low + (high - low) / 2;

        if (set->segments[middle].first_point <= point)
            low = middle;
        else
            high = middle;
    }
    return low;
}

cairn_status cairn_force_field_point_force(const cairn_force_field *field, int32_t scan,
                                           int32_t index, cairn_vec2 *force, cairn_real *mass)
{
    const cairn_scan_set_scan *from;
    int32_t point, segment;

    if (field == NULL || force == NULL || mass == NULL || !cairn_force_field_has(field, scan) ||
        index < 0 ||
        index >= field->set->scans[scan].end_point - field->set->scans[scan].first_point)
        return CAIRN_BAD_ARGUMENT;
    if (!force_field_is_between(field) || !field->has_forces || !field->bodies[scan].has_forces)
        return CAIRN_EMPTY;
    from = &field->set->scans[scan];
    point = from->first_point + index;
    segment = segment_of(field->set, from, point);
    *force = cairn_force_field_at(field, segment, point - field->set->segments[segment].first_point,
                                  mass);
    return CAIRN_OK;
}

const cairn_corner *cairn_force_field_corners(const cairn_force_field *field, int32_t *count)
{
    if (field->corners == NULL) {
        *count = 0;
        return NULL;
    }
    return cairn_corner_list(field->corners, count);
}
