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
#include "src/core/build.h"

#include <string.h>

#include "cairn/scan_redundancy.h"

enum { MAX_SCANS = 1 << 20, MAX_POINTS = 1 << 24, POINTS_PER_ITEM = 16, REMOVED_PER_ITEM = 2 };

static const cairn_real MAX_COORDINATE_M = CAIRN_REAL(1e6);

enum { IDLE, CLEAR_GRID, INSERT_POINTS, COUNT_SCANS };

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
    int32_t phase, units_owed;
    int32_t at, point; /* INSERT_POINTS: segment and point of it; COUNT_SCANS: point */
};

cairn_scan_redundancy_params cairn_scan_redundancy_default(void)
{
    cairn_scan_redundancy_params params = {
        .max_scans = 64,
        .max_points = 8192,
        .radius = CAIRN_REAL(0.15),
        .direction_gate = CAIRN_PI / 6,
    };
    return params;
}

static int params_are_valid(const cairn_scan_redundancy_params *p)
{
    return p != NULL && p->max_scans >= 1 && p->max_scans <= MAX_SCANS && p->max_points >= 1 &&
           p->max_points <= MAX_POINTS && p->radius > 0 && p->radius <= MAX_COORDINATE_M &&
           p->direction_gate > 0 && p->direction_gate <= CAIRN_PI;
}

static cairn_point_grid_params grid_params(const cairn_scan_redundancy_params *params)
{
    cairn_point_grid_params grid = {params->max_points, 2 * params->radius};
    return grid;
}

/* Sets the pointers of *layout, which is then copied to the returned piece. */
static cairn_scan_redundancy *carve(cairn_scan_redundancy *cover, cairn_pool *pool,
                                    const cairn_scan_redundancy_params *params)
{
    size_t scans = (size_t)params->max_scans, points = (size_t)params->max_points;
    cairn_scan_redundancy *made = cairn_pool_take_one(pool, sizeof *made);

    cover->segment = cairn_pool_take(pool, points, sizeof *cover->segment);
    cover->transform = cairn_pool_take(pool, scans, sizeof *cover->transform);
    cover->loss = cairn_pool_take(pool, scans, sizeof *cover->loss);
    cover->last_point = cairn_pool_take(pool, scans, sizeof *cover->last_point);
    return made;
}

size_t cairn_scan_redundancy_memory(const cairn_scan_redundancy_params *params)
{
    cairn_point_grid_params grid;
    cairn_scan_redundancy layout;
    cairn_pool counting;

    if (!params_are_valid(params))
        return 0;
    grid = grid_params(params);
    cairn_pool_init_counting(&counting);
    (void)carve(&layout, &counting, params);
    cairn_pool_count(&counting, cairn_point_grid_memory(&grid));
    return cairn_pool_counted(&counting);
}

cairn_status cairn_scan_redundancy_create(cairn_scan_redundancy **cover, cairn_pool *pool,
                                          const cairn_scan_redundancy_params *params)
{
    size_t need = cairn_scan_redundancy_memory(params);
    cairn_point_grid_params grid;
    cairn_scan_redundancy layout, *made;
    cairn_status status;

    if (cover == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_capacity(pool, need))
        return CAIRN_NO_MEMORY;
    memset(&layout, 0, sizeof layout);
    made = carve(&layout, pool, params);
    grid = grid_params(params);
    status = cairn_point_grid_create(&layout.grid, pool, &grid);
    CAIRN_ASSERT(status == CAIRN_OK);
    layout.params = *params;
    layout.least_cosine = cairn_cos(params->direction_gate);
    *made = layout;
    *cover = made;
    return status;
}

cairn_status cairn_scan_redundancy_begin(cairn_scan_redundancy *cover, const cairn_scan_set *set,
                                         const cairn_pose *map_scan)
{
    if (cover == NULL || set == NULL || map_scan == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (set->scan_count > cover->params.max_scans || set->point_count > cover->params.max_points)
        return CAIRN_FULL;
    for (int32_t i = 0; i < set->scan_count; i++) {
        if (set->scans[i].in_use && !cairn_pose_is_finite(map_scan[i]))
            return CAIRN_NOT_FINITE;
        if (set->scans[i].in_use && !(cairn_abs(map_scan[i].x) <= MAX_COORDINATE_M &&
                                      cairn_abs(map_scan[i].y) <= MAX_COORDINATE_M))
            return CAIRN_BAD_ARGUMENT;
    }
    for (int32_t i = 0; i < set->scan_count; i++) {
        cover->loss[i] = set->scans[i].in_use ? 0 : -1;
        cover->last_point[i] = -1;
        if (set->scans[i].in_use)
            cover->transform[i] = cairn_transform_of(map_scan[i]);
    }
    cover->set = set;
    cover->scans = set->scan_count;
    cover->phase = CLEAR_GRID;
    cover->units_owed = cover->at = cover->point = 0;
    return CAIRN_OK;
}

/* ---- Items; each returns its units ---- */

static int32_t clear_item(cairn_scan_redundancy *cover)
{
    for (int32_t i = 0; i < REMOVED_PER_ITEM; i++)
        cairn_point_grid_remove_last(cover->grid);
    if (cairn_point_grid_count(cover->grid) == 0)
        cover->phase = INSERT_POINTS;
    return 1;
}

/* Inserts the next points of a segment into the grid. */
static int32_t insert_item(cairn_scan_redundancy *cover)
{
    const cairn_scan_set_segment *segment;
    cairn_vec2 points[POINTS_PER_ITEM];
    int32_t left, count;

    if (cover->at == cover->set->segment_count) {
        cover->phase = COUNT_SCANS;
        cover->at = 0;
        return 1;
    }
    segment = &cover->set->segments[cover->at];
    left = segment->scan >= 0 ? segment->end_point - segment->first_point - cover->point : 0;
    if (left == 0) {
        cover->at++;
        cover->point = 0;
        return 1;
    }
    count = left < POINTS_PER_ITEM ? left : POINTS_PER_ITEM;
    cairn_scan_set_read(cover->set, cover->at, cover->point, count, points);
    for (int32_t i = 0; i < count; i++) {
        cairn_vec2 p = cairn_transform_point(cover->transform[segment->scan], points[i]);
        cairn_status status;

        cover->segment[cairn_point_grid_count(cover->grid)] = cover->at;
        status = cairn_point_grid_insert(cover->grid, p);
        CAIRN_ASSERT(status == CAIRN_OK);
        (void)status;
    }
    cover->point += count;
    return 1 + 3 * count / 2;
}

static cairn_vec2 direction_at(const cairn_scan_redundancy *cover, int32_t point, int32_t *scan)
{
    const cairn_scan_set_segment *segment = &cover->set->segments[cover->segment[point]];

    *scan = segment->scan;
    return cairn_transform_direction(cover->transform[segment->scan], segment->direction);
}

/* Adds the loss of one point to its scan. */
static int32_t count_item(cairn_scan_redundancy *cover)
{
    int32_t own, other, near = 0, scans = 0, found;
    cairn_point_grid_cursor cursor;
    cairn_vec2 direction;

    if (cover->at == cairn_point_grid_count(cover->grid)) {
        cover->phase = IDLE;
        return 1;
    }
    direction = direction_at(cover, cover->at, &own);
    cursor = cairn_point_grid_begin(cover->grid, cairn_point_grid_point(cover->grid, cover->at),
                                    cover->params.radius);
    while ((found = cairn_point_grid_next(cover->grid, &cursor)) >= 0) {
        cairn_vec2 its = direction_at(cover, found, &other);

        near++;
        if (other != own && cover->last_point[other] != cover->at &&
            cairn_vec2_dot(direction, its) >= cover->least_cosine) {
            cover->last_point[other] = cover->at;
            scans++;
        }
    }
    cover->loss[own] += 1 / (cairn_real)(1 + scans);
    cover->at++;
    return 2 + near;
}

cairn_status cairn_scan_redundancy_step(cairn_scan_redundancy *cover, cairn_budget *budget)
{
    if (cover == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (cover->units_owed > 0 || cover->phase != IDLE) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        if (cover->units_owed > 0) {
            int32_t paid = cover->units_owed < budget->left ? cover->units_owed : budget->left;

            cover->units_owed -= paid;
            budget->left -= paid;
        } else if (cover->phase == CLEAR_GRID) {
            cover->units_owed = clear_item(cover);
        } else {
            cover->units_owed =
                cover->phase == INSERT_POINTS ? insert_item(cover) : count_item(cover);
        }
    }
    return CAIRN_OK;
}

/* ---- Results ---- */

static int is_done(const cairn_scan_redundancy *cover)
{
    return cover != NULL && cover->phase == IDLE && cover->units_owed == 0;
}

cairn_real cairn_scan_redundancy_loss(const cairn_scan_redundancy *cover, int32_t scan)
{
    return is_done(cover) && scan >= 0 && scan < cover->scans ? cover->loss[scan] : -1;
}

int32_t cairn_scan_redundancy_most_redundant(const cairn_scan_redundancy *cover, int32_t spared)
{
    int32_t least = -1;

    if (!is_done(cover))
        return -1;
    for (int32_t i = 0; i < cover->scans; i++)
        if (i != spared && cover->loss[i] >= 0 &&
            (least < 0 || cover->loss[i] < cover->loss[least]))
            least = i;
    return least;
}
