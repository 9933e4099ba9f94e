/* scan_redundancy: redundancy scores of scans, for keyframe culling.
 *
 * Method:
 * 1. The points of all scans are put into a hash grid in the map.
 * 2. A radius search around each point counts the other scans with a matching point. A scan counts
 *    once however many near points it has: last_point holds for each scan the last point that it
 *    covered.
 * 3. The loss of a scan is the sum of 1 / (1 + n) over its points.
 *
 * Layout: points in the order of the segments of the set, with the number of their segment beside
 * the grid.
 * Limits: points count wherever the given poses put them, whether or not these are correct. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/scan_redundancy.h"
#include "src/base/object.h"

enum { MAX_SCANS = 1 << 20, MAX_POINTS = 1 << 24, POINTS_PER_ITEM = 16, REMOVED_PER_ITEM = 2 };

#define MAX_COORDINATE_M CAIRN_REAL(1e6)

typedef int32_t scan_redundancy_phase;
enum { PHASE_IDLE, PHASE_CLEAR_GRID, PHASE_INSERT_POINTS, PHASE_COUNT_SCANS };

struct cairn_scan_redundancy {
    cairn_scan_redundancy_params params;
    cairn_real least_cosine;
    cairn_point_grid *grid;
    int32_t *segment;           /* [max_points] segment of each point */
    cairn_transform *transform; /* [max_scans] map_scan */
    cairn_real *loss;           /* [max_scans] loss, in points; -1: free slot */
    int32_t *last_point;        /* [max_scans] last point that a point of the scan covered */
    const cairn_scan_set *set;
    int32_t scans; /* slots at the last begin() */
    scan_redundancy_phase phase;
    /* units of finished items, not yet charged */
    int32_t units_due;
    int32_t at, point; /* PHASE_INSERT_POINTS: segment and point of it; PHASE_COUNT_SCANS: point */
};

#define INTEGER(field, ...)  CAIRN_INTEGER(cairn_scan_redundancy_params, field, __VA_ARGS__)
#define POSITIVE(field, ...) CAIRN_NUMBER_ABOVE(cairn_scan_redundancy_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_scans, 64, 1, MAX_SCANS),
    INTEGER(max_points, 8192, 1, MAX_POINTS),
    POSITIVE(radius, CAIRN_REAL(0.15), 0, MAX_COORDINATE_M),
    POSITIVE(direction_gate, CAIRN_PI / 6, 0, CAIRN_PI),
};
extern const cairn_parameters cairn_scan_redundancy_parameters;
const cairn_parameters cairn_scan_redundancy_parameters =
    CAIRN_PARAMETERS("scan_redundancy", cairn_scan_redundancy_params, rows);

cairn_scan_redundancy_params cairn_scan_redundancy_default(void)
{
    cairn_scan_redundancy_params params;

    cairn_parameters_preset(&cairn_scan_redundancy_parameters, &params);
    return params;
}

/* Params of the grid: cells of twice the radius. */
static cairn_point_grid_params grid_params(const cairn_scan_redundancy_params *params)
{
    cairn_point_grid_params grid = {
        .max_points = params->max_points,
        .cell_size = 2 * params->radius,
    };
    return grid;
}

cairn_status cairn_scan_redundancy_check(const cairn_scan_redundancy_params *params,
                                         cairn_object_fault *fault)
{
    cairn_status status = cairn_parameters_check(&cairn_scan_redundancy_parameters, params, fault);

    if (status == CAIRN_OK)
        status =
            cairn_parameters_require(1 / (2 * params->radius) <= CAIRN_REAL_MAX, "scan_redundancy",
                                     "radius: of a finite reciprocal", fault);
    return status;
}

/* The object, its arrays and its grid; NULL from a counting pool. */
static cairn_scan_redundancy *build(cairn_pool *pool, const cairn_scan_redundancy_params *params)
{
    cairn_point_grid_params grid = grid_params(params);
    cairn_scan_redundancy *redundancy = cairn_object_take(pool, sizeof *redundancy);

    CAIRN_TAKE(redundancy, pool, segment, params->max_points);
    CAIRN_TAKE(redundancy, pool, transform, params->max_scans);
    CAIRN_TAKE(redundancy, pool, loss, params->max_scans);
    CAIRN_TAKE(redundancy, pool, last_point, params->max_scans);
    CAIRN_TAKE_OBJECT(redundancy, pool, grid, point_grid, &grid);
    if (redundancy != NULL) {
        redundancy->params = *params;
        redundancy->least_cosine = cairn_cos(params->direction_gate);
    }
    return redundancy;
}

size_t cairn_scan_redundancy_memory(const cairn_scan_redundancy_params *params)
{
    cairn_pool counting;

    if (cairn_scan_redundancy_check(params, NULL) != CAIRN_OK)
        return 0;
    cairn_pool_init_counting(&counting);
    (void)build(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_scan_redundancy_create(cairn_scan_redundancy **redundancy, cairn_pool *pool,
                                          const cairn_scan_redundancy_params *params)
{
    cairn_status status =
        cairn_object_admit(redundancy, pool, cairn_scan_redundancy_memory(params));

    if (status == CAIRN_OK)
        *redundancy = build(pool, params);
    return status;
}

cairn_status cairn_scan_redundancy_begin(cairn_scan_redundancy *redundancy,
                                         const cairn_scan_set *set, const cairn_pose *map_scan)
{
    if (redundancy == NULL || set == NULL || map_scan == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (set->scan_count > redundancy->params.max_scans ||
        set->point_count > redundancy->params.max_points)
        return CAIRN_FULL;
    for (int32_t i = 0; i < set->scan_count; i++) {
        if (set->scans[i].in_use && !cairn_pose_is_finite(map_scan[i]))
            return CAIRN_NOT_FINITE;
        if (set->scans[i].in_use && !(cairn_abs(map_scan[i].x) <= MAX_COORDINATE_M &&
                                      cairn_abs(map_scan[i].y) <= MAX_COORDINATE_M))
            return CAIRN_BAD_ARGUMENT;
    }
    for (int32_t i = 0; i < set->scan_count; i++) {
        redundancy->loss[i] = set->scans[i].in_use ? 0 : -1;
        redundancy->last_point[i] = -1;
        if (set->scans[i].in_use)
            redundancy->transform[i] = cairn_transform_of(map_scan[i]);
    }
    redundancy->set = set;
    redundancy->scans = set->scan_count;
    redundancy->phase = PHASE_CLEAR_GRID;
    redundancy->units_due = redundancy->at = redundancy->point = 0;
    return CAIRN_OK;
}

/* ---- Items; each returns its units ---- */

static int32_t clear_item(cairn_scan_redundancy *redundancy)
{
    for (int32_t i = 0; i < REMOVED_PER_ITEM; i++)
        cairn_point_grid_remove_last(redundancy->grid);
    if (cairn_point_grid_count(redundancy->grid) == 0)
        redundancy->phase = PHASE_INSERT_POINTS;
    return 1;
}

/* Inserts the next points of a segment into the grid. */
static int32_t insert_item(cairn_scan_redundancy *redundancy)
{
    const cairn_scan_set_segment *segment;
    cairn_vec2 points[POINTS_PER_ITEM];
    int32_t left, count;

    if (redundancy->at == redundancy->set->segment_count) {
        redundancy->phase = PHASE_COUNT_SCANS;
        redundancy->at = 0;
        return 1;
    }
    segment = &redundancy->set->segments[redundancy->at];
    left = segment->scan >= 0 ? segment->end_point - segment->first_point - redundancy->point : 0;
    if (left == 0) {
        redundancy->at++;
        redundancy->point = 0;
        return 1;
    }
    count = left < POINTS_PER_ITEM ? left : POINTS_PER_ITEM;
    cairn_scan_set_read(redundancy->set, redundancy->at, redundancy->point, count, points);
    for (int32_t i = 0; i < count; i++) {
        cairn_vec2 p = cairn_transform_point(redundancy->transform[segment->scan], points[i]);
        cairn_status status;

        redundancy->segment[cairn_point_grid_count(redundancy->grid)] = redundancy->at;
        status = cairn_point_grid_insert(redundancy->grid, p);
        CAIRN_ASSERT(status == CAIRN_OK);
        (void)status;
    }
    redundancy->point += count;
    return 1 + 3 * count / 2;
}

static cairn_vec2 direction_at(const cairn_scan_redundancy *redundancy, int32_t point,
                               int32_t *scan)
{
    const cairn_scan_set_segment *segment = &redundancy->set->segments[redundancy->segment[point]];

    *scan = segment->scan;
    return cairn_transform_direction(redundancy->transform[segment->scan], segment->direction);
}

/* Adds the loss of one point to its scan. */
static int32_t count_item(cairn_scan_redundancy *redundancy)
{
    int32_t own, other, near = 0, scans = 0, found;
    cairn_point_grid_cursor cursor;
    cairn_vec2 direction;

    if (redundancy->at == cairn_point_grid_count(redundancy->grid)) {
        redundancy->phase = PHASE_IDLE;
        return 1;
    }
    direction = direction_at(redundancy, redundancy->at, &own);
    cursor = cairn_point_grid_begin(redundancy->grid,
                                    cairn_point_grid_point(redundancy->grid, redundancy->at),
                                    redundancy->params.radius);
    while ((found = cairn_point_grid_next(redundancy->grid, &cursor)) >= 0) {
        cairn_vec2 its = direction_at(redundancy, found, &other);

        near++;
        if (other != own && redundancy->last_point[other] != redundancy->at &&
            cairn_vec2_dot(direction, its) >= redundancy->least_cosine) {
            redundancy->last_point[other] = redundancy->at;
            scans++;
        }
    }
    redundancy->loss[own] += 1 / (cairn_real)(1 + scans);
    redundancy->at++;
    return 2 + near;
}

cairn_status cairn_scan_redundancy_step(cairn_scan_redundancy *redundancy, cairn_budget *budget)
{
    if (redundancy == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (redundancy->units_due > 0 || redundancy->phase != PHASE_IDLE) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        if (redundancy->units_due > 0) {
            int32_t charged =
                redundancy->units_due < budget->left ? redundancy->units_due : budget->left;

            redundancy->units_due -= charged;
            budget->left -= charged;
        } else if (redundancy->phase == PHASE_CLEAR_GRID) {
            redundancy->units_due = clear_item(redundancy);
        } else {
            redundancy->units_due = redundancy->phase == PHASE_INSERT_POINTS
                                        ? insert_item(redundancy)
                                        : count_item(redundancy);
        }
    }
    return CAIRN_OK;
}

/* ---- Results ---- */

static int is_done(const cairn_scan_redundancy *redundancy)
{
    return redundancy != NULL && redundancy->phase == PHASE_IDLE && redundancy->units_due == 0;
}

cairn_real cairn_scan_redundancy_loss(const cairn_scan_redundancy *redundancy, int32_t scan)
{
    return is_done(redundancy) && scan >= 0 && scan < redundancy->scans ? redundancy->loss[scan]
                                                                        : -1;
}

int32_t cairn_scan_redundancy_most_redundant(const cairn_scan_redundancy *redundancy,
                                             int32_t spared)
{
    int32_t least = -1;

    if (!is_done(redundancy))
        return -1;
    for (int32_t i = 0; i < redundancy->scans; i++)
        if (i != spared && redundancy->loss[i] >= 0 &&
            (least < 0 || redundancy->loss[i] < redundancy->loss[least]))
            least = i;
    return least;
}
