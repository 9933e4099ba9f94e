/* Force field simulation: parameters, inputs, readers. What an iteration does is in force_iteration.c.
 *
 * Layout: the scans as they came in a scan set; beside it arrays of segments and points in the map. Poses and motions are
 * held twice: readers see one, the iteration under way fills the other. Scans that arrive during an iteration lie behind
 * those that it works on.
 *
 * Limits: in float the map should not be larger than about 100 m. The time of an iteration grows with the pairs of points
 * within reach.
 *
 * Source: Adluru 2008, chapter 7. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/force_field_iteration.h"

enum { MAX_CORNERS = 1 << 24 };

/* Parameters and poses beyond this are refused. */
#define MAX_VALUE CAIRN_REAL(1e6)

/* ---- Parameters and memory ---- */

cairn_force_field_params cairn_force_field_default(void)
{
    cairn_force_field_params params = {
        .mode = CAIRN_FORCE_FIELD_GRADIENT,
        .max_scans = 64,
        .max_segments = 1024,
        .max_points = 8192,
        .max_corners = 1024,
        .sigma_start = CAIRN_REAL(0.15),
        .sigma_end = CAIRN_REAL(0.04),
        .sigma_step = CAIRN_REAL(0.0025),
        .dt_start = CAIRN_REAL(0.05),
        .dt_end = CAIRN_REAL(0.01),
        .dt_factor = CAIRN_REAL(0.96),
        .reach = CAIRN_REAL(5.3),
        .sensor_below = CAIRN_REAL(0.5),
        .roi = 1,
        .roi_radius = CAIRN_REAL(0.05),
        .roi_mass = 4,
        .corner_distance = CAIRN_REAL(0.30),
        .corner_min_opening = 80 * (CAIRN_PI / 180),
        .corner_max_opening = 100 * (CAIRN_PI / 180),
        .potential = 1,
        .max_steps = 50,
        .stop_relocation = CAIRN_REAL(0.0001),
    };
    return params;
}

static int is_positive(cairn_real x)
{
    return x > 0 && x <= MAX_VALUE;
}

static int is_not_negative(cairn_real x)
{
    return x >= 0 && x <= MAX_VALUE;
}

static cairn_scan_set_params set_params(const cairn_force_field_params *p)
{
    cairn_scan_set_params params = {p->max_scans, p->max_segments, p->max_points};
    return params;
}

static cairn_corner_params corner_params(const cairn_force_field_params *p)
{
    cairn_corner_params params = {
        p->max_segments, p->max_corners, p->corner_min_opening, p->corner_max_opening, p->corner_distance, 0, 0};
    return params;
}

static cairn_point_grid_params grid_params(const cairn_force_field_params *p)
{
    cairn_point_grid_params params = {p->max_corners, 2 * p->roi_radius};
    return params;
}

static int params_are_valid(const cairn_force_field_params *p)
{
    return p != NULL && p->mode == CAIRN_FORCE_FIELD_GRADIENT && is_positive(p->sigma_start) &&
           is_positive(p->sigma_end) && p->sigma_end <= p->sigma_start && is_not_negative(p->sigma_step) &&
           is_positive(p->dt_start) && is_positive(p->dt_end) && p->dt_end <= p->dt_start &&
           is_not_negative(p->dt_factor) && p->dt_factor <= 1 && p->reach > 0 && p->reach <= CAIRN_FORCE_KERNEL_REACH &&
           is_not_negative(p->sensor_below) &&
           (!p->roi || (p->max_corners <= MAX_CORNERS && is_positive(p->roi_radius) && is_positive(p->roi_mass))) &&
           p->max_steps >= 1 && is_not_negative(p->stop_relocation);
}

/* Objects within the object: counted on a counting pool, created on a real one, which has been asked for room. */
static int only_counted(cairn_pool *pool, size_t need)
{
    if (pool->base != NULL)
        return 0;
    cairn_pool_count(pool, need);
    return 1;
}

static void must_be_ok(cairn_status status)
{
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
}

static cairn_scan_set *carve_set(cairn_pool *pool, const cairn_force_field_params *params)
{
    cairn_scan_set_params p = set_params(params);
    cairn_scan_set *set = NULL;

    if (!only_counted(pool, cairn_scan_set_memory(&p)))
        must_be_ok(cairn_scan_set_create(&set, pool, &p));
    return set;
}

static cairn_box_sweep *carve_sweep(cairn_pool *pool, const cairn_force_field_params *params)
{
    cairn_box_sweep_params p = {params->max_segments};
    cairn_box_sweep *sweep = NULL;

    if (!only_counted(pool, cairn_box_sweep_memory(&p)))
        must_be_ok(cairn_box_sweep_create(&sweep, pool, &p));
    return sweep;
}

static cairn_corner_set *carve_corners(cairn_pool *pool, const cairn_force_field_params *params)
{
    cairn_corner_params p = corner_params(params);
    cairn_corner_set *corners = NULL;

    if (!only_counted(pool, cairn_corner_memory(&p)))
        must_be_ok(cairn_corner_create(&corners, pool, &p));
    return corners;
}

static cairn_point_grid *carve_grid(cairn_pool *pool, const cairn_force_field_params *params)
{
    cairn_point_grid_params p = grid_params(params);
    cairn_point_grid *grid = NULL;

    if (!only_counted(pool, cairn_point_grid_memory(&p)))
        must_be_ok(cairn_point_grid_create(&grid, pool, &p));
    return grid;
}

static cairn_force_field *carve(cairn_pool *pool, const cairn_force_field_params *params)
{
    size_t scans = (size_t)params->max_scans, segment_count = (size_t)params->max_segments;
    size_t points = (size_t)params->max_points;
    cairn_force_field *field = cairn_pool_take_one(pool, sizeof *field);
    struct cairn_force_placement *front = cairn_pool_take(pool, scans, sizeof *front);
    struct cairn_force_placement *back = cairn_pool_take(pool, scans, sizeof *back);
    struct cairn_force_fixing *fixings = cairn_pool_take(pool, scans, sizeof *fixings);
    cairn_segment *segments = cairn_pool_take(pool, segment_count, sizeof *segments);
    cairn_vec2 *directions = cairn_pool_take(pool, segment_count, sizeof *directions);
    cairn_box *boxes = cairn_pool_take(pool, segment_count, sizeof *boxes);
    cairn_vec2 *position = cairn_pool_take(pool, points, sizeof *position);
    cairn_real *mass = cairn_pool_take(pool, points, sizeof *mass);
    cairn_vec2 *force = cairn_pool_take(pool, points, sizeof *force);
    cairn_scan_set *set = carve_set(pool, params);
    cairn_box_sweep *sweep = carve_sweep(pool, params);
    cairn_corner_set *corners = params->roi ? carve_corners(pool, params) : NULL;
    cairn_point_grid *grid = params->roi ? carve_grid(pool, params) : NULL;

    if (field != NULL) {
        memset(field, 0, sizeof *field);
        field->placements[0] = front;
        field->placements[1] = back;
        field->fixings = fixings;
        field->segments = segments;
        field->directions = directions;
        field->boxes = boxes;
        field->points.position = position;
        field->points.mass = mass;
        field->points.force = force;
        field->set = set;
        field->sweep = sweep;
        field->corners = corners;
        field->grid = grid;
    }
    return field;
}

size_t cairn_force_field_memory(const cairn_force_field_params *params)
{
    cairn_scan_set_params p;
    cairn_pool counting;

    if (!params_are_valid(params))
        return 0;
    p = set_params(params);
    if (cairn_scan_set_memory(&p) == 0)
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_force_field_create(cairn_force_field **field, cairn_pool *pool,
                                      const cairn_force_field_params *params)
{
    size_t need = cairn_force_field_memory(params);
    cairn_force_field *made;

    if (field == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    made = carve(pool, params);
    made->params = *params;
    cairn_force_kernel_init(&made->kernel);
    cairn_force_field_clear(made);
    *field = made;
    return CAIRN_OK;
}

/* ---- Inputs ---- */

cairn_status cairn_force_field_add_scan(cairn_force_field *field, const cairn_scan_view *view, const cairn_real *mass,
                                        cairn_pose map_scan, cairn_fault *fault)
{
    cairn_fault pose_fault = {-1, NULL};
    cairn_status status = CAIRN_OK;
    int32_t index;

    if (field == NULL) {
        pose_fault.what = "no field";
        status = CAIRN_BAD_ARGUMENT;
    } else if (!cairn_pose_is_finite(map_scan)) {
        pose_fault.what = "the pose is not finite";
        status = CAIRN_NOT_FINITE;
    } else if (!(cairn_abs(map_scan.x) <= MAX_VALUE && cairn_abs(map_scan.y) <= MAX_VALUE)) {
        pose_fault.what = "the pose is farther than 1e6 m";
        status = CAIRN_BAD_ARGUMENT;
    }
    if (status != CAIRN_OK) {
        if (fault != NULL)
            *fault = pose_fault;
        return status;
    }
    index = field->set->scan_count;
    status = cairn_scan_set_add(field->set, view, mass, fault);
    if (status != CAIRN_OK)
        return status;

    map_scan.theta = cairn_wrap_angle(map_scan.theta);
    for (int i = 0; i < 2; i++) {
        struct cairn_force_placement *placement = &field->placements[i][index];

        memset(placement, 0, sizeof *placement);
        placement->map_scan = map_scan;
    }
    memset(&field->fixings[index], 0, sizeof field->fixings[index]);
    if (field->phase == PHASE_AT_COMMIT)
        cairn_force_iteration_take_in(field);
    return CAIRN_OK;
}

cairn_status cairn_force_field_fix(cairn_force_field *field, int32_t scan, int32_t yes)
{
    struct cairn_force_fixing *fixing;

    if (field == NULL || scan < 0 || scan >= field->set->scan_count)
        return CAIRN_BAD_ARGUMENT;
    fixing = &field->fixings[scan];
    fixing->before = cairn_force_iteration_is_fixed(field, scan) != 0;
    fixing->after = yes != 0;
    fixing->from = field->clock + 1;
    return CAIRN_OK;
}

void cairn_force_field_restart(cairn_force_field *field)
{
    if (field->phase == PHASE_AT_COMMIT)
        cairn_force_iteration_start_cooling(field);
    else
        field->restart = 1;
}

void cairn_force_field_clear(cairn_force_field *field)
{
    cairn_scan_set_clear(field->set);
    field->reported = 0;
    field->phase = PHASE_AT_COMMIT;
    field->clock = 0;
    memset(&field->state, 0, sizeof field->state);
    cairn_force_iteration_take_in(field);
    cairn_force_iteration_start_cooling(field);
}

/* ---- Steps ---- */

static cairn_status run(cairn_force_field *field, cairn_budget *budget, int one)
{
    cairn_status status = CAIRN_OK;

    do {
        if (field->phase == PHASE_AT_COMMIT) {
            if (field->state.verdict != CAIRN_FORCE_FIELD_RUNNING)
                return CAIRN_OK;
            if (budget->left <= 0)
                return CAIRN_MORE;
            cairn_force_iteration_begin(field);
        }
        while (field->phase != PHASE_AT_COMMIT) {
            status = cairn_force_iteration_step(field, budget);
            if (status != CAIRN_OK)
                return status;
        }
    } while (!one);
    return CAIRN_OK;
}

static cairn_status run_counted(cairn_force_field *field, cairn_budget *budget, int one)
{
    cairn_status status;
    int32_t before, used;

    if (field == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (field->phase == PHASE_AT_COMMIT && field->committed == 0)
        return CAIRN_EMPTY;
    before = budget->left;
    status = run(field, budget, one);
    CAIRN_ASSERT(status >= 0);
    used = before - budget->left;
    field->state.units += used;
    if (used > field->state.worst_step)
        field->state.worst_step = used;
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
    return field->committed;
}

cairn_pose cairn_force_field_pose(const cairn_force_field *field, int32_t scan)
{
    CAIRN_ASSERT(scan >= 0 && scan < field->committed);
    return field->placements[field->front][scan].map_scan;
}

cairn_force_field_motion cairn_force_field_motion_of(const cairn_force_field *field, int32_t scan)
{
    CAIRN_ASSERT(scan >= 0 && scan < field->committed);
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

cairn_status cairn_force_field_point_force(const cairn_force_field *field, int32_t scan, int32_t index,
                                           cairn_vec2 *force, cairn_real *mass)
{
    int32_t point;

    if (field == NULL || force == NULL || mass == NULL || scan < 0 || scan >= field->committed || index < 0 ||
        index >= field->set->scans[scan].end_point - field->set->scans[scan].first_point)
        return CAIRN_BAD_ARGUMENT;
    if (field->phase != PHASE_AT_COMMIT || scan >= field->reported)
        return CAIRN_EMPTY;
    point = field->set->scans[scan].first_point + index;
    *force = field->points.force[point];
    *mass = field->points.mass[point];
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
