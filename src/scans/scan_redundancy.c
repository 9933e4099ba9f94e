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
#include "src/base/step.h"

enum { MAX_SCANS = 1 << 20, MAX_POINTS = 1 << 24 };

/* Points that are inserted at a time, and that are removed in a unit; units of a segment, of a
 * point whose neighbours are searched, and of a pass over segments or points. */
enum {
    POINTS_PER_INSERTION = 16,
    REMOVED_PER_UNIT = 2,
    UNITS_PER_SEGMENT = 1,
    UNITS_PER_SEARCH = 2,
    UNITS_PER_PASS = 1
};

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
    /* 1: step() has work left. */
    uint8_t is_running;
    /* Resume point, and units charged for the operation that waits. */
    uint16_t resume;
    int32_t units_charged;
    /* Point of the current segment, or of the grid. */
    int32_t point;
    /* Segment that is inserted; behind all segments, number of points of the set within the radius
     * of the point that is scored. */
    union {
        int32_t current_segment, near;
    };
};

#define INTEGER(field, ...)  CAIRN_INTEGER(cairn_scan_redundancy_params, field, __VA_ARGS__)
#define POSITIVE(field, ...) CAIRN_NUMBER_ABOVE(cairn_scan_redundancy_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_scans, 64, 1, MAX_SCANS),
    INTEGER(max_points, 8192, 1, MAX_POINTS),
    /* Of a finite reciprocal of its double, the grid's cells. */
    POSITIVE(radius, CAIRN_REAL(0.15), CAIRN_REAL(0.5) / CAIRN_REAL_MAX, CAIRN_MAX_MAGNITUDE),
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
    return cairn_parameters_check(&cairn_scan_redundancy_parameters, params, fault);
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

CAIRN_OBJECT(scan_redundancy, scan_redundancy, build);

cairn_status cairn_scan_redundancy_begin(cairn_scan_redundancy *redundancy,
                                         const cairn_scan_set *set, const cairn_pose *map_scan)
{
    cairn_status status = CAIRN_OK;

    if (redundancy == NULL || set == NULL || map_scan == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (set->scan_count > redundancy->params.max_scans ||
        set->point_count > redundancy->params.max_points)
        return CAIRN_FULL;
    for (int32_t i = 0; i < set->scan_count && status == CAIRN_OK; i++)
        if (set->scans[i].in_use)
            status = cairn_pose_check(map_scan[i], CAIRN_MAX_MAGNITUDE, NULL);
    if (status != CAIRN_OK)
        return status;
    for (int32_t i = 0; i < set->scan_count; i++) {
        redundancy->loss[i] = set->scans[i].in_use ? 0 : -1;
        redundancy->last_point[i] = -1;
        if (set->scans[i].in_use)
            redundancy->transform[i] = cairn_transform_of(map_scan[i]);
    }
    redundancy->set = set;
    redundancy->scans = set->scan_count;
    redundancy->is_running = 1;
    redundancy->resume = 0;
    redundancy->units_charged = 0;
    return CAIRN_OK;
}

/* ---- Scores ---- */

/* Removes points of the last set from the grid. */
static void remove_points(cairn_scan_redundancy *redundancy)
{
    for (int32_t i = 0; i < REMOVED_PER_UNIT; i++)
        cairn_point_grid_remove_last(redundancy->grid);
}

/* Number of points that are inserted next: those of the current segment that are left, at most
 * POINTS_PER_INSERTION; 0 in a removed segment. */
static int32_t insertion_count(const cairn_scan_redundancy *redundancy)
{
    const cairn_scan_set_segment *segment = &redundancy->set->segments[redundancy->current_segment];
    int32_t left =
        segment->scan >= 0 ? segment->end_point - segment->first_point - redundancy->point : 0;

    return left < POINTS_PER_INSERTION ? left : POINTS_PER_INSERTION;
}

/* Inserts the next points of the current segment into the grid. */
static void insert_points(cairn_scan_redundancy *redundancy)
{
    int32_t current = redundancy->current_segment, count = insertion_count(redundancy);
    const cairn_scan_set_segment *segment = &redundancy->set->segments[current];
    cairn_vec2 points[POINTS_PER_INSERTION];

    cairn_scan_set_read(redundancy->set, current, redundancy->point, count, points);
    for (int32_t i = 0; i < count; i++) {
        cairn_vec2 p = cairn_transform_point(redundancy->transform[segment->scan], points[i]);

        redundancy->segment[cairn_point_grid_count(redundancy->grid)] = current;
        cairn_must_be_ok(cairn_point_grid_insert(redundancy->grid, p));
    }
    redundancy->point += count;
}

static cairn_vec2 direction_at(const cairn_scan_redundancy *redundancy, int32_t point,
                               int32_t *scan)
{
    const cairn_scan_set_segment *segment = &redundancy->set->segments[redundancy->segment[point]];

    *scan = segment->scan;
    return cairn_transform_direction(redundancy->transform[segment->scan], segment->direction);
}

/* Adds the loss of a point to its scan, and counts the points of the set within the radius. */
static void score_point(cairn_scan_redundancy *redundancy, int32_t point)
{
    int32_t own, other, scans = 0, found;
    cairn_vec2 direction = direction_at(redundancy, point, &own);
    cairn_point_grid_cursor cursor =
        cairn_point_grid_begin(redundancy->grid, cairn_point_grid_point(redundancy->grid, point),
                               redundancy->params.radius);

    redundancy->near = 0;
    while ((found = cairn_point_grid_next(redundancy->grid, &cursor)) >= 0) {
        cairn_vec2 its = direction_at(redundancy, found, &other);

        redundancy->near++;
        if (other != own && redundancy->last_point[other] != point &&
            cairn_vec2_dot(direction, its) >= redundancy->least_cosine) {
            redundancy->last_point[other] = point;
            scans++;
        }
    }
    redundancy->loss[own] += 1 / (cairn_real)(1 + scans);
}

/* The scores: see Method in the head of this file. */
static int score(cairn_scan_redundancy *redundancy, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(redundancy->resume);
    do {
        CAIRN_STEP_CHARGE(redundancy, resume, budget, 1);
        remove_points(redundancy);
    } while (cairn_point_grid_count(redundancy->grid) > 0);
    CAIRN_STEP_CHARGE(redundancy, resume, budget, UNITS_PER_PASS);
    for (redundancy->current_segment = 0;
         redundancy->current_segment < redundancy->set->segment_count;
         redundancy->current_segment++) {
        CAIRN_STEP_CHARGE(redundancy, resume, budget, UNITS_PER_SEGMENT);
        redundancy->point = 0;
        while (insertion_count(redundancy) > 0) {
            CAIRN_STEP_CHARGE(redundancy, resume, budget, 1 + 3 * insertion_count(redundancy) / 2);
            insert_points(redundancy);
        }
    }
    CAIRN_STEP_CHARGE(redundancy, resume, budget, UNITS_PER_PASS);
    for (redundancy->point = 0; redundancy->point < cairn_point_grid_count(redundancy->grid);
         redundancy->point++) {
        CAIRN_STEP_CHARGE(redundancy, resume, budget, UNITS_PER_SEARCH);
        score_point(redundancy, redundancy->point);
        /* What the search has visited is known only behind it. */
        CAIRN_STEP_CHARGE(redundancy, resume, budget, redundancy->near);
    }
    CAIRN_STEP_END(redundancy->resume);
}

cairn_status cairn_scan_redundancy_step(cairn_scan_redundancy *redundancy, cairn_budget *budget)
{
    if (redundancy == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (redundancy->is_running && !score(redundancy, budget))
        return CAIRN_MORE;
    redundancy->is_running = 0;
    return CAIRN_OK;
}

/* ---- Results ---- */

static int is_done(const cairn_scan_redundancy *redundancy)
{
    return redundancy != NULL && !redundancy->is_running;
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
