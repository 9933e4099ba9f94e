/* The cover of scans by each other.
 *
 * Method: the points of all scans are put into a hash grid in the map; then each looks for points
 * of other scans around it. Scans are counted once however many near points they have: `seen` holds
 * for each scan the last point that it covered.
 *
 * Layout: points in the order of the segments of the set, with the number of their segment beside
 * the grid.
 *
 * Limits: points stand for what they show, whether or not the scan that also shows it lies
 * right. */
#include "src/core/build.h"

#include <string.h>

#include "cairn/scan_cover.h"

enum { MAX_SCANS = 1 << 20, MAX_POINTS = 1 << 24, TILE = 16, REMOVED = 2 };

static const cairn_real FARTHEST = CAIRN_REAL(1e6);

enum { IDLE, UNGRID, PLACE, COUNT };

struct cairn_scan_cover {
    cairn_scan_cover_params params;
    cairn_real least_cosine;
    cairn_point_grid *grid;
    int32_t *segment;           /* [max_points] */
    cairn_transform *transform; /* [max_scans] */
    cairn_real *loss;           /* [max_scans]; -1: not in use */
    int32_t *seen;              /* [max_scans]: the last point that a point of the scan covers */
    const cairn_scan_set *set;
    int32_t scans; /* slots at the last begin() */
    int32_t phase, debt;
    int32_t at, point; /* PLACE: segment, and point of it; COUNT: point */
};

cairn_scan_cover_params cairn_scan_cover_default(void)
{
    cairn_scan_cover_params params = {64, 8192, CAIRN_REAL(0.15), CAIRN_PI / 6};
    return params;
}

static int params_are_good(const cairn_scan_cover_params *p)
{
    return p != NULL && p->max_scans >= 1 && p->max_scans <= MAX_SCANS && p->max_points >= 1 &&
           p->max_points <= MAX_POINTS && p->radius > 0 && p->radius <= FARTHEST &&
           p->direction_gate > 0 && p->direction_gate <= CAIRN_PI;
}

static cairn_point_grid_params grid_params(const cairn_scan_cover_params *params)
{
    cairn_point_grid_params grid = {params->max_points, 2 * params->radius};
    return grid;
}

/* Sets the pointers of *c, which is then to be copied to the piece that is returned. */
static cairn_scan_cover *carve(cairn_scan_cover *c, cairn_pool *pool,
                               const cairn_scan_cover_params *params)
{
    size_t scans = (size_t)params->max_scans, points = (size_t)params->max_points;
    cairn_scan_cover *made = cairn_pool_take_one(pool, sizeof *made);

    c->segment = cairn_pool_take(pool, points, sizeof *c->segment);
    c->transform = cairn_pool_take(pool, scans, sizeof *c->transform);
    c->loss = cairn_pool_take(pool, scans, sizeof *c->loss);
    c->seen = cairn_pool_take(pool, scans, sizeof *c->seen);
    return made;
}

size_t cairn_scan_cover_memory(const cairn_scan_cover_params *params)
{
    cairn_point_grid_params grid;
    cairn_scan_cover layout;
    cairn_pool counting;

    if (!params_are_good(params))
        return 0;
    grid = grid_params(params);
    cairn_pool_init_counting(&counting);
    (void)carve(&layout, &counting, params);
    cairn_pool_count(&counting, cairn_point_grid_memory(&grid));
    return cairn_pool_counted(&counting);
}

cairn_status cairn_scan_cover_create(cairn_scan_cover **cover, cairn_pool *pool,
                                     const cairn_scan_cover_params *params)
{
    size_t need = cairn_scan_cover_memory(params);
    cairn_point_grid_params grid;
    cairn_scan_cover layout, *made;
    cairn_status status;

    if (cover == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
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

cairn_status cairn_scan_cover_begin(cairn_scan_cover *cover, const cairn_scan_set *set,
                                    const cairn_pose *map_scan)
{
    if (cover == NULL || set == NULL || map_scan == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (set->scan_count > cover->params.max_scans || set->point_count > cover->params.max_points)
        return CAIRN_FULL;
    for (int32_t i = 0; i < set->scan_count; i++) {
        if (set->scans[i].in_use && !cairn_pose_is_finite(map_scan[i]))
            return CAIRN_NOT_FINITE;
        if (set->scans[i].in_use &&
            !(cairn_abs(map_scan[i].x) <= FARTHEST && cairn_abs(map_scan[i].y) <= FARTHEST))
            return CAIRN_BAD_ARGUMENT;
    }
    for (int32_t i = 0; i < set->scan_count; i++) {
        cover->loss[i] = set->scans[i].in_use ? 0 : -1;
        cover->seen[i] = -1;
        if (set->scans[i].in_use)
            cover->transform[i] = cairn_transform_of(map_scan[i]);
    }
    cover->set = set;
    cover->scans = set->scan_count;
    cover->phase = UNGRID;
    cover->debt = cover->at = cover->point = 0;
    return CAIRN_OK;
}

/* ---- Items; each returns its units ---- */

static int32_t remove_some(cairn_scan_cover *c)
{
    for (int32_t i = 0; i < REMOVED; i++)
        cairn_point_grid_remove_last(c->grid);
    if (cairn_point_grid_count(c->grid) == 0)
        c->phase = PLACE;
    return 1;
}

/* The next points of a segment. */
static int32_t place(cairn_scan_cover *c)
{
    const cairn_scan_set_segment *segment;
    cairn_vec2 points[TILE];
    int32_t left, count;

    if (c->at == c->set->segment_count) {
        c->phase = COUNT;
        c->at = 0;
        return 1;
    }
    segment = &c->set->segments[c->at];
    left = segment->scan >= 0 ? segment->end_point - segment->first_point - c->point : 0;
    if (left == 0) {
        c->at++;
        c->point = 0;
        return 1;
    }
    count = left < TILE ? left : TILE;
    cairn_scan_set_read(c->set, c->at, c->point, count, points);
    for (int32_t i = 0; i < count; i++) {
        cairn_vec2 p = cairn_transform_point(c->transform[segment->scan], points[i]);
        cairn_status status;

        c->segment[cairn_point_grid_count(c->grid)] = c->at;
        status = cairn_point_grid_insert(c->grid, p);
        CAIRN_ASSERT(status == CAIRN_OK);
        (void)status;
    }
    c->point += count;
    return 1 + 3 * count / 2;
}

static cairn_vec2 direction_at(const cairn_scan_cover *c, int32_t point, int32_t *scan)
{
    const cairn_scan_set_segment *segment = &c->set->segments[c->segment[point]];

    *scan = segment->scan;
    return cairn_transform_direction(c->transform[segment->scan], segment->direction);
}

/* What of the loss one point is. */
static int32_t count_scans(cairn_scan_cover *c)
{
    int32_t own, other, near = 0, scans = 0, found;
    cairn_point_grid_cursor cursor;
    cairn_vec2 direction;

    if (c->at == cairn_point_grid_count(c->grid)) {
        c->phase = IDLE;
        return 1;
    }
    direction = direction_at(c, c->at, &own);
    cursor =
        cairn_point_grid_begin(c->grid, cairn_point_grid_point(c->grid, c->at), c->params.radius);
    while ((found = cairn_point_grid_next(c->grid, &cursor)) >= 0) {
        cairn_vec2 its = direction_at(c, found, &other);

        near++;
        if (other != own && c->seen[other] != c->at &&
            cairn_vec2_dot(direction, its) >= c->least_cosine) {
            c->seen[other] = c->at;
            scans++;
        }
    }
    c->loss[own] += 1 / (cairn_real)(1 + scans);
    c->at++;
    return 2 + near;
}

cairn_status cairn_scan_cover_step(cairn_scan_cover *cover, cairn_budget *budget)
{
    if (cover == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (cover->debt > 0 || cover->phase != IDLE) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        if (cover->debt > 0) {
            int32_t paid = cover->debt < budget->left ? cover->debt : budget->left;

            cover->debt -= paid;
            budget->left -= paid;
        } else if (cover->phase == UNGRID) {
            cover->debt = remove_some(cover);
        } else {
            cover->debt = cover->phase == PLACE ? place(cover) : count_scans(cover);
        }
    }
    return CAIRN_OK;
}

/* ---- Readers ---- */

static int is_done(const cairn_scan_cover *cover)
{
    return cover != NULL && cover->phase == IDLE && cover->debt == 0;
}

cairn_real cairn_scan_cover_loss(const cairn_scan_cover *cover, int32_t scan)
{
    return is_done(cover) && scan >= 0 && scan < cover->scans ? cover->loss[scan] : -1;
}

int32_t cairn_scan_cover_least(const cairn_scan_cover *cover, int32_t spared)
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
