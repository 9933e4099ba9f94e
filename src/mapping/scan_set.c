/* Scans for an aligner. All of a scan is checked before any of it is copied. */
#include "src/core/build.h"

#include <string.h>

#include "cairn/scan_set.h"

enum { MAX_SCANS = 1 << 20, MAX_ITEMS = 1 << 24 };

static int is_count(int32_t count, int32_t limit)
{
    return count >= 1 && count <= limit;
}

static cairn_scan_set *carve(cairn_pool *pool, const cairn_scan_set_params *params)
{
    cairn_scan_set *set = cairn_pool_take_one(pool, sizeof *set);
    cairn_scan_set_scan *scans = cairn_pool_take(pool, (size_t)params->max_scans, sizeof *scans);
    cairn_scan_set_segment *segments = cairn_pool_take(pool, (size_t)params->max_segments, sizeof *segments);
    cairn_vec2 *points = cairn_pool_take(pool, (size_t)params->max_points, sizeof *points);
    cairn_real *mass = cairn_pool_take(pool, (size_t)params->max_points, sizeof *mass);

    if (set != NULL) {
        set->scans = scans;
        set->segments = segments;
        set->points = points;
        set->mass = mass;
    }
    return set;
}

size_t cairn_scan_set_memory(const cairn_scan_set_params *params)
{
    cairn_pool counting;

    if (params == NULL || !is_count(params->max_scans, MAX_SCANS) || !is_count(params->max_segments, MAX_ITEMS) ||
        !is_count(params->max_points, MAX_ITEMS))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_scan_set_create(cairn_scan_set **set, cairn_pool *pool, const cairn_scan_set_params *params)
{
    size_t need = cairn_scan_set_memory(params);
    cairn_scan_set *made;

    if (set == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    made = carve(pool, params);
    made->params = *params;
    cairn_scan_set_clear(made);
    *set = made;
    return CAIRN_OK;
}

static int is_finite(cairn_vec2 v)
{
    return cairn_is_finite(v.x) && cairn_is_finite(v.y);
}

static int is_near(cairn_vec2 v)
{
    return cairn_abs(v.x) <= CAIRN_SCAN_SET_LIMIT && cairn_abs(v.y) <= CAIRN_SCAN_SET_LIMIT;
}

static cairn_status check_view(const cairn_scan_view *view, cairn_fault *fault)
{
    if (view->segment_count < 0 || view->point_count < 0)
        return cairn_refuse(fault, -1, "a count is below 0", CAIRN_BAD_ARGUMENT);
    if (view->segment_count > 0 && (view->segments == NULL || view->first_point == NULL))
        return cairn_refuse(fault, -1, "segments without an array", CAIRN_BAD_ARGUMENT);
    if (view->point_count > 0 && view->points == NULL)
        return cairn_refuse(fault, -1, "points without an array", CAIRN_BAD_ARGUMENT);
    if (view->point_count > 0 && view->segment_count == 0)
        return cairn_refuse(fault, 0, "a point without a segment", CAIRN_BAD_ARGUMENT);
    if (!is_finite(view->sensor))
        return cairn_refuse(fault, -1, "the sensor's position is not finite", CAIRN_NOT_FINITE);
    if (!is_near(view->sensor))
        return cairn_refuse(fault, -1, "the sensor is farther than 1e6 m", CAIRN_BAD_ARGUMENT);
    return CAIRN_OK;
}

static cairn_status check_segments(const cairn_scan_view *view, cairn_fault *fault)
{
    for (int32_t i = 0; i < view->segment_count; i++) {
        cairn_segment s = view->segments[i];

        if (view->first_point[i] > view->first_point[i + 1] || (i == 0 && view->first_point[0] != 0))
            return cairn_refuse(fault, i, "first_point does not rise from 0", CAIRN_BAD_ARGUMENT);
        if (!is_finite(s.a) || !is_finite(s.b))
            return cairn_refuse(fault, i, "a segment is not finite", CAIRN_NOT_FINITE);
        if (!is_near(s.a) || !is_near(s.b))
            return cairn_refuse(fault, i, "a segment ends farther than 1e6 m", CAIRN_BAD_ARGUMENT);
    }
    if (view->segment_count > 0 && view->first_point[view->segment_count] != view->point_count)
        return cairn_refuse(fault, view->segment_count, "first_point does not end at point_count", CAIRN_BAD_ARGUMENT);
    return CAIRN_OK;
}

static cairn_status check_points(const cairn_scan_view *view, const cairn_real *mass, cairn_fault *fault)
{
    for (int32_t i = 0; i < view->point_count; i++) {
        cairn_oriented_point point = view->points[i];

        if (!is_finite(point.position) || !is_finite(point.direction))
            return cairn_refuse(fault, i, "a point is not finite", CAIRN_NOT_FINITE);
        if (!is_near(point.position) || !is_near(point.direction))
            return cairn_refuse(fault, i, "a point is farther than 1e6 m", CAIRN_BAD_ARGUMENT);
        if (mass != NULL && !cairn_is_finite(mass[i]))
            return cairn_refuse(fault, i, "a mass is not finite", CAIRN_NOT_FINITE);
        if (mass != NULL && !(mass[i] > 0 && mass[i] <= CAIRN_SCAN_SET_LIMIT))
            return cairn_refuse(fault, i, "a mass is not above 0, at most 1e6", CAIRN_BAD_ARGUMENT);
    }
    return CAIRN_OK;
}

static cairn_status check_room(const cairn_scan_set *set, const cairn_scan_view *view, cairn_fault *fault)
{
    if (set->scan_count == set->params.max_scans)
        return cairn_refuse(fault, -1, "more than max_scans scans", CAIRN_FULL);
    if (view->segment_count > set->params.max_segments - set->segment_count)
        return cairn_refuse(fault, -1, "more than max_segments segments", CAIRN_FULL);
    if (view->point_count > set->params.max_points - set->point_count)
        return cairn_refuse(fault, -1, "more than max_points points", CAIRN_FULL);
    return CAIRN_OK;
}

/* The distance between points that lie evenly along the direction, 0 when they do not. */
static cairn_real spacing_of(const cairn_oriented_point *points, int32_t count, cairn_vec2 direction)
{
    cairn_real spacing;

    if (count < 2)
        return 0;
    spacing = cairn_vec2_norm(cairn_vec2_sub(points[count - 1].position, points[0].position)) / (cairn_real)(count - 1);
    for (int32_t i = 1; i < count; i++) {
        cairn_vec2 even = cairn_vec2_add(points[0].position, cairn_vec2_scale(direction, (cairn_real)i * spacing));

        if (!(cairn_vec2_norm(cairn_vec2_sub(points[i].position, even)) < spacing / 1000))
            return 0;
    }
    return spacing;
}

static void copy_segments(cairn_scan_set *set, const cairn_scan_view *view)
{
    for (int32_t i = 0; i < view->segment_count; i++) {
        cairn_scan_set_segment *to = &set->segments[set->segment_count + i];
        int32_t first = view->first_point[i], end = view->first_point[i + 1];
        cairn_vec2 none = {0, 0};

        to->segment = view->segments[i];
        to->direction = first < end ? cairn_vec2_unit(view->points[first].direction) : none;
        to->spacing = spacing_of(view->points + first, end - first, to->direction);
        to->first_point = set->point_count + first;
        to->end_point = set->point_count + end;
        to->scan = set->scan_count;
    }
}

static cairn_vec2 centroid_of(const cairn_vec2 *points, int32_t count)
{
    cairn_vec2 sum = {0, 0};

    for (int32_t i = 0; i < count; i++)
        sum = cairn_vec2_add(sum, points[i]);
    return count > 0 ? cairn_vec2_scale(sum, 1 / (cairn_real)count) : sum;
}

static cairn_real spread_about(cairn_vec2 centre, const cairn_vec2 *points, int32_t count)
{
    cairn_real sum = 0;

    for (int32_t i = 0; i < count; i++)
        sum += cairn_vec2_norm_squared(cairn_vec2_sub(points[i], centre));
    return count > 0 ? sum / (cairn_real)count : 0;
}

cairn_status cairn_scan_set_add(cairn_scan_set *set, const cairn_scan_view *view, const cairn_real *mass,
                                cairn_fault *fault)
{
    cairn_scan_set_scan *scan;
    cairn_vec2 *points;
    cairn_status status;

    if (set == NULL || view == NULL)
        return cairn_refuse(fault, -1, "no set or no scan", CAIRN_BAD_ARGUMENT);
    status = check_view(view, fault);
    if (status == CAIRN_OK)
        status = check_segments(view, fault);
    if (status == CAIRN_OK)
        status = check_points(view, mass, fault);
    if (status == CAIRN_OK)
        status = check_room(set, view, fault);
    if (status != CAIRN_OK)
        return status;

    copy_segments(set, view);
    points = set->points + set->point_count;
    for (int32_t i = 0; i < view->point_count; i++) {
        points[i] = view->points[i].position;
        set->mass[set->point_count + i] = mass != NULL ? mass[i] : 1;
    }
    scan = &set->scans[set->scan_count];
    scan->first_segment = set->segment_count;
    scan->end_segment = set->segment_count + view->segment_count;
    scan->first_point = set->point_count;
    scan->end_point = set->point_count + view->point_count;
    scan->centroid = centroid_of(points, view->point_count);
    scan->sensor = view->sensor;
    scan->centroid_spread = spread_about(scan->centroid, points, view->point_count);
    scan->sensor_spread = spread_about(scan->sensor, points, view->point_count);
    set->scan_count++;
    set->segment_count += view->segment_count;
    set->point_count += view->point_count;
    return cairn_refuse(fault, -1, NULL, CAIRN_OK);
}

void cairn_scan_set_clear(cairn_scan_set *set)
{
    set->scan_count = set->segment_count = set->point_count = 0;
}
