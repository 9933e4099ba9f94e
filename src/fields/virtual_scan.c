/* Virtual scan: detection of hypotheses in the whole map.
 *
 * Method.
 *
 * 1. The map is copied at the current poses of the scans, thinned.
 * 2. Lines and ellipses are found by voting, with tolerances that follow the uncertainty of the
 *    poses. Both count when walls of several scans lie on them.
 * 3. Rectangles are assembled from the segments.
 * 4. The caller's detectors run in turn.
 * 5. Outlines are sampled into the list in work, which readers see when the detection has ended.
 *
 * Layout: points and segments of the map with their scans; number of wall points of each scan on
 * the current line or ellipse; two lists of hypotheses, points and weights (double-buffered);
 * hough, rectangle and ellipse.
 *
 * Limits: a rectangle that one scan observes whole weighs as much as one assembled from many.
 *
 * Source: Adluru 2008, chapter 8. */
#include "src/base/build.h"

#include <string.h>

#include "src/fields/virtual_scan_work.h"

#define MAX_VALUE CAIRN_REAL(1e6)

cairn_virtual_scan_params cairn_virtual_scan_default(void)
{
    cairn_virtual_scan_params params = {
        .max_scans = 64,
        .max_points = 4096,
        .max_segments = 1024,
        .max_hypotheses = 64,
        .max_virtual = 4096,
        .max_detectors = 2,
        .lines = 1,
        .rectangles = 1,
        .ellipses = 1,
        .stride = 2,
        .spacing = CAIRN_REAL(0.10),
        .weight = 1,
        .distance_per_sigma = CAIRN_REAL(0.3),
        .angle_per_sigma = CAIRN_REAL(0.2),
        .min_scans = 2,
        .mode = CAIRN_MODE_DEFAULT,
        .min_wall_length = CAIRN_REAL(0.5),
        .hough = cairn_hough_default(),
        .rectangle = cairn_rectangle_default(),
        .ellipse = cairn_ellipse_default(),
    };

    params.hough.angles = 72;
    params.hough.distances = 128;
    params.hough.distance_step = CAIRN_REAL(0.10);
    params.hough.angle_tolerance = 4 * (CAIRN_PI / 180);
    params.hough.separation_angle = 6 * (CAIRN_PI / 180);
    params.hough.spacing = CAIRN_REAL(0.20);
    params.hough.min_votes = 10;
    params.rectangle.merge_distance = CAIRN_REAL(0.15);
    params.rectangle.merge_gap = 3;
    params.rectangle.max_angle_error = 10 * (CAIRN_PI / 180);
    params.rectangle.min_side = 1;
    params.rectangle.min_side_coverage = CAIRN_REAL(0.3);
    params.rectangle.min_coverage = CAIRN_REAL(0.55);
    return params;
}

/* minimum inliers of a line as written */
static const cairn_real MIN_VOTES = 40;

/* Returns the params with the values that the mode prescribes. */
static cairn_virtual_scan_params in_mode(const cairn_virtual_scan_params *params)
{
    cairn_virtual_scan_params p = *params, fixed = cairn_virtual_scan_default();

    if (p.mode == CAIRN_MODE_AS_WRITTEN) {
        p.ellipses = 0;
        p.stride = 1;
        p.distance_per_sigma = fixed.distance_per_sigma;
        p.angle_per_sigma = fixed.angle_per_sigma;
        p.min_scans = 1;
        p.min_wall_length = 0;
        p.hough.mode = CAIRN_MODE_AS_WRITTEN;
        p.rectangle.oriented = 0;
    }
    return p;
}

cairn_virtual_scan_params cairn_virtual_scan_as_written(void)
{
    cairn_virtual_scan_params params = cairn_virtual_scan_default();

    params.mode = CAIRN_MODE_AS_WRITTEN;
    params.hough = cairn_hough_as_written();
    params.hough.min_votes = MIN_VOTES;
    /* Memory for whatever passes the thresholds: no capacity decides. */
    params.hough.max_lines = 256;
    params.max_hypotheses = 1024;
    params.rectangle.max_sides = 4096;
    params.rectangle.max_pairs = 1 << 18;
    params.rectangle.max_rectangles = 256;
    return in_mode(&params);
}

static int is_count(int32_t count, int32_t least, int32_t most)
{
    return count >= least && count <= most;
}

static int params_are_valid(const cairn_virtual_scan_params *params)
{
    return is_count(params->max_scans, 1, 1 << 20) && is_count(params->max_points, 1, 1 << 24) &&
           is_count(params->max_segments, 1, 1 << 20) &&
           is_count(params->max_hypotheses, 1, 1024) && is_count(params->max_virtual, 1, 1 << 24) &&
           is_count(params->max_detectors, 0, 16) && params->stride >= 1 && params->spacing > 0 &&
           params->spacing <= MAX_VALUE && params->weight >= 0 && params->weight <= MAX_VALUE &&
           params->distance_per_sigma > 0 && params->distance_per_sigma <= 1 &&
           params->angle_per_sigma > 0 && params->angle_per_sigma <= MAX_VALUE &&
           params->min_scans >= 1 && params->min_wall_length >= 0 &&
           params->min_wall_length <= MAX_VALUE &&
           (params->mode == CAIRN_MODE_DEFAULT || params->mode == CAIRN_MODE_AS_WRITTEN) &&
           cairn_hough_memory(&params->hough) > 0 && cairn_ellipse_memory(&params->ellipse) > 0;
}

static cairn_rectangle_params rectangles_of(const cairn_virtual_scan_params *params)
{
    cairn_rectangle_params rectangle = params->rectangle;

    rectangle.max_segments = params->max_segments;
    return rectangle;
}

static cairn_hough *take_hough(cairn_pool *pool, const cairn_hough_params *params)
{
    cairn_hough *hough = NULL;
    cairn_status status;

    if (pool->base == NULL) {
        cairn_pool_count(pool, cairn_hough_memory(params));
        return NULL;
    }
    status = cairn_hough_create(&hough, pool, params);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    return hough;
}

static cairn_rectangle_set *take_rectangles(cairn_pool *pool,
                                            const cairn_virtual_scan_params *params)
{
    cairn_rectangle_params rectangle = rectangles_of(params);
    cairn_rectangle_set *set = NULL;
    cairn_status status;

    if (pool->base == NULL) {
        cairn_pool_count(pool, cairn_rectangle_memory(&rectangle));
        return NULL;
    }
    status = cairn_rectangle_create(&set, pool, &rectangle);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    return set;
}

static cairn_ellipse_set *take_ellipses(cairn_pool *pool, const cairn_ellipse_params *params)
{
    cairn_ellipse_set *set = NULL;
    cairn_status status;

    if (pool->base == NULL) {
        cairn_pool_count(pool, cairn_ellipse_memory(params));
        return NULL;
    }
    status = cairn_ellipse_create(&set, pool, params);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    return set;
}

static virtual_scan_result take_result(cairn_pool *pool, const cairn_virtual_scan_params *params)
{
    virtual_scan_result r = {0};

    r.hypotheses = cairn_pool_take(pool, (size_t)params->max_hypotheses, sizeof *r.hypotheses);
    r.points = cairn_pool_take(pool, (size_t)params->max_virtual, sizeof *r.points);
    r.weights = cairn_pool_take(pool, (size_t)params->max_virtual, sizeof *r.weights);
    return r;
}

static cairn_virtual_scan *take_memory(cairn_pool *pool, const cairn_virtual_scan_params *params)
{
    size_t points = (size_t)params->max_points, segments = (size_t)params->max_segments;
    cairn_virtual_scan *virtual_scan = cairn_pool_take_one(pool, sizeof *virtual_scan), made;

    memset(&made, 0, sizeof made);
    made.points = cairn_pool_take(pool, points, sizeof *made.points);
    made.point_scan = cairn_pool_take(pool, points, sizeof *made.point_scan);
    made.segments = cairn_pool_take(pool, segments, sizeof *made.segments);
    made.segment_scan = cairn_pool_take(pool, segments, sizeof *made.segment_scan);
    made.scan_inliers = cairn_pool_take(pool, (size_t)params->max_scans, sizeof *made.scan_inliers);
    made.detectors = cairn_pool_take(pool, (size_t)params->max_detectors, sizeof *made.detectors);
    made.work = take_result(pool, params);
    made.done = take_result(pool, params);
    made.hough = take_hough(pool, &params->hough);
    made.rectangles = take_rectangles(pool, params);
    made.ellipses = take_ellipses(pool, &params->ellipse);
    if (virtual_scan != NULL)
        *virtual_scan = made;
    return virtual_scan;
}

size_t cairn_virtual_scan_memory(const cairn_virtual_scan_params *params)
{
    cairn_virtual_scan_params used;
    cairn_pool counting;

    if (params == NULL)
        return 0;
    used = in_mode(params);
    if (!params_are_valid(&used))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)take_memory(&counting, &used);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_virtual_scan_create(cairn_virtual_scan **virtual_scan, cairn_pool *pool,
                                       const cairn_virtual_scan_params *params)
{
    size_t need = cairn_virtual_scan_memory(params);
    cairn_virtual_scan_params used;
    cairn_virtual_scan *made;

    if (virtual_scan == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_capacity(pool, need))
        return CAIRN_NO_MEMORY;
    used = in_mode(params);
    made = take_memory(pool, &used);
    made->params = used;
    *virtual_scan = made;
    return CAIRN_OK;
}

cairn_status cairn_virtual_scan_add_detector(cairn_virtual_scan *virtual_scan,
                                             const cairn_virtual_scan_hypothesis_detector *detector)
{
    if (virtual_scan == NULL || detector == NULL || detector->begin == NULL ||
        detector->step == NULL || detector->count == NULL || detector->outline == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (virtual_scan->detector_count == virtual_scan->params.max_detectors)
        return CAIRN_FULL;
    virtual_scan->detectors[virtual_scan->detector_count++] = *detector;
    return CAIRN_OK;
}

/* ---- The map ---- */

/* Sets the tolerances of lines for this uncertainty. */
static void adjust_lines(cairn_virtual_scan *virtual_scan, cairn_real sigma)
{
    cairn_hough_params hough = virtual_scan->params.hough;
    cairn_real angle =
        cairn_min(cairn_max(virtual_scan->params.angle_per_sigma * sigma, hough.angle_tolerance),
                  CAIRN_PI / 6);
    cairn_status status;

    if (virtual_scan->params.mode == CAIRN_MODE_AS_WRITTEN)
        return;
    hough.support_distance =
        cairn_max(hough.support_distance, virtual_scan->params.distance_per_sigma * sigma);
    hough.separation =
        cairn_max(hough.separation, 2 * virtual_scan->params.distance_per_sigma * sigma);
    hough.distance_step = cairn_max(hough.distance_step, hough.support_distance / 2);
    hough.angle_tolerance = cairn_max(hough.angle_tolerance, angle);
    hough.separation_angle = cairn_max(hough.separation_angle, angle);
    virtual_scan->support = hough.support_distance;
    virtual_scan->sine_angle = cairn_sin(hough.angle_tolerance);
    status = cairn_hough_adjust(virtual_scan->hough, &hough);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
}

/* Sets the tolerances of ellipses for this uncertainty. Round walls determine their tangent less
 * well than straight ones, but beyond a quarter of a right angle four walls would be a circle. */
static void adjust_ellipses(cairn_virtual_scan *virtual_scan, cairn_real sigma)
{
    cairn_ellipse_params ellipse = virtual_scan->params.ellipse;
    cairn_status status;

    ellipse.support_distance =
        cairn_max(ellipse.support_distance, virtual_scan->params.distance_per_sigma * sigma);
    ellipse.angle_tolerance =
        cairn_max(ellipse.angle_tolerance,
                  cairn_min(virtual_scan->params.angle_per_sigma * sigma, CAIRN_PI / 8));
    virtual_scan->ellipse_support = ellipse.support_distance;
    virtual_scan->sine_tangent = cairn_sin(ellipse.angle_tolerance);
    status = cairn_ellipse_adjust(virtual_scan->ellipses, &ellipse);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
}

cairn_status cairn_virtual_scan_begin(cairn_virtual_scan *virtual_scan, cairn_real sigma)
{
    if (virtual_scan == NULL || !(sigma >= 0) || sigma > MAX_VALUE / 2)
        return CAIRN_BAD_ARGUMENT;
    memset(&virtual_scan->map, 0, sizeof virtual_scan->map);
    virtual_scan->map.points = virtual_scan->points;
    virtual_scan->map.point_scan = virtual_scan->point_scan;
    virtual_scan->map.segments = virtual_scan->segments;
    virtual_scan->map.segment_scan = virtual_scan->segment_scan;
    virtual_scan->map.sigma = sigma;
    virtual_scan->work.count = virtual_scan->work.point_count = virtual_scan->work.dropped = 0;
    virtual_scan->phase = VIRTUAL_SCAN_GATHER;
    adjust_lines(virtual_scan, sigma);
    adjust_ellipses(virtual_scan, sigma);
    return CAIRN_OK;
}

static int has_scan(const cairn_virtual_scan *virtual_scan, const cairn_scan_set *set, int32_t scan)
{
    return scan >= 0 && scan < set->scan_count && scan < virtual_scan->params.max_scans &&
           set->scans[scan].in_use;
}

/* Returns the number of a segment's points in the thinned map. */
static int32_t thinned_count(const cairn_virtual_scan *virtual_scan,
                             const cairn_scan_set_segment *segment)
{
    return (segment->end_point - segment->first_point + virtual_scan->params.stride - 1) /
           virtual_scan->params.stride;
}

static void add_segment(cairn_virtual_scan *virtual_scan, const cairn_scan_set *set, int32_t index,
                        cairn_transform map_scan)
{
    const cairn_scan_set_segment *s = &set->segments[index];
    cairn_segment *to = &virtual_scan->segments[virtual_scan->map.segment_count];
    cairn_oriented_point *points = &virtual_scan->points[virtual_scan->map.point_count];
    int32_t count = thinned_count(virtual_scan, s);

    to->a = cairn_transform_point(map_scan, s->segment.a);
    to->b = cairn_transform_point(map_scan, s->segment.b);
    virtual_scan->segment_scan[virtual_scan->map.segment_count++] = s->scan;
    for (int32_t i = 0; i < count; i++) {
        cairn_vec2 p;

        cairn_scan_set_read(set, index, i * virtual_scan->params.stride, 1, &p);
        points[i].position = cairn_transform_point(map_scan, p);
        points[i].direction = cairn_transform_direction(map_scan, s->direction);
        virtual_scan->point_scan[virtual_scan->map.point_count++] = s->scan;
    }
}

cairn_status cairn_virtual_scan_add_scan(cairn_virtual_scan *virtual_scan,
                                         const cairn_scan_set *set, int32_t scan,
                                         cairn_pose map_scan)
{
    const cairn_scan_set_scan *of;
    cairn_transform t;
    int32_t points = 0;

    if (virtual_scan == NULL || set == NULL || virtual_scan->phase != VIRTUAL_SCAN_GATHER ||
        !has_scan(virtual_scan, set, scan) || !cairn_pose_is_finite(map_scan) ||
        cairn_abs(map_scan.x) > MAX_VALUE / 2 || cairn_abs(map_scan.y) > MAX_VALUE / 2)
        return CAIRN_BAD_ARGUMENT;
    of = &set->scans[scan];
    for (int32_t i = of->first_segment; i < of->end_segment; i++)
        points += thinned_count(virtual_scan, &set->segments[i]);
    if (points > virtual_scan->params.max_points - virtual_scan->map.point_count ||
        of->end_segment - of->first_segment >
            virtual_scan->params.max_segments - virtual_scan->map.segment_count)
        return CAIRN_FULL;
    t = cairn_transform_of(map_scan);
    for (int32_t i = of->first_segment; i < of->end_segment; i++)
        add_segment(virtual_scan, set, i, t);
    return CAIRN_OK;
}

/* ---- Detection ---- */

/* Begins the phase after the current one. */
static cairn_status begin_next_phase(cairn_virtual_scan *virtual_scan)
{
    virtual_scan->cursor = 0;
    virtual_scan->inliers_cleared = virtual_scan->scans_counted = 0;
    virtual_scan->item = 0;
    virtual_scan->detector_begun = 0;
    virtual_scan->units_charged = 0;
    virtual_scan->phase = virtual_scan->phase == VIRTUAL_SCAN_CALLER_DETECTORS
                              ? VIRTUAL_SCAN_IDLE
                              : virtual_scan->phase + 1;
    if (virtual_scan->phase == VIRTUAL_SCAN_LINES)
        return cairn_hough_begin(virtual_scan->hough, virtual_scan->points, NULL,
                                 virtual_scan->params.lines ? virtual_scan->map.point_count : 0);
    if (virtual_scan->phase == VIRTUAL_SCAN_RECTANGLES)
        return cairn_rectangle_begin(
            virtual_scan->rectangles, virtual_scan->segments,
            virtual_scan->params.rectangles ? virtual_scan->map.segment_count : 0);
    if (virtual_scan->phase == VIRTUAL_SCAN_ELLIPSES)
        return cairn_ellipse_begin(virtual_scan->ellipses, virtual_scan->points, NULL,
                                   virtual_scan->params.ellipses ? virtual_scan->map.point_count
                                                                 : 0);
    if (virtual_scan->phase == VIRTUAL_SCAN_IDLE) {
        virtual_scan_result work = virtual_scan->work;

        virtual_scan->work = virtual_scan->done;
        virtual_scan->done = work;
    }
    return CAIRN_OK;
}

static cairn_status step_phase(cairn_virtual_scan *virtual_scan, cairn_budget *budget)
{
    switch (virtual_scan->phase) {
    case VIRTUAL_SCAN_LINES:
        return cairn_hough_step(virtual_scan->hough, budget);
    case VIRTUAL_SCAN_SAMPLE_LINES:
        return cairn_virtual_scan_sample_lines(virtual_scan, budget);
    case VIRTUAL_SCAN_RECTANGLES:
        return cairn_rectangle_step(virtual_scan->rectangles, budget);
    case VIRTUAL_SCAN_SAMPLE_RECTANGLES:
        return cairn_virtual_scan_sample_rectangles(virtual_scan, budget);
    case VIRTUAL_SCAN_ELLIPSES:
        return cairn_ellipse_step(virtual_scan->ellipses, budget);
    case VIRTUAL_SCAN_SAMPLE_ELLIPSES:
        return cairn_virtual_scan_sample_ellipses(virtual_scan, budget);
    case VIRTUAL_SCAN_CALLER_DETECTORS:
        return cairn_virtual_scan_run_detectors(virtual_scan, budget);
    default:
        return CAIRN_OK;
    }
}

cairn_status cairn_virtual_scan_step(cairn_virtual_scan *virtual_scan, cairn_budget *budget)
{
    if (virtual_scan == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (virtual_scan->phase != VIRTUAL_SCAN_IDLE) {
        cairn_status status = step_phase(virtual_scan, budget);

        if (status == CAIRN_MORE)
            return status;
        if (status == CAIRN_OK)
            status = begin_next_phase(virtual_scan);
        if (status < 0) {
            virtual_scan->phase = VIRTUAL_SCAN_IDLE;
            return status;
        }
    }
    return CAIRN_OK;
}

const cairn_virtual_scan_hypothesis *
cairn_virtual_scan_hypotheses(const cairn_virtual_scan *virtual_scan, int32_t *count)
{
    *count = virtual_scan->done.count;
    return virtual_scan->done.hypotheses;
}

const cairn_oriented_point *cairn_virtual_scan_points(const cairn_virtual_scan *virtual_scan,
                                                      const cairn_real **weights, int32_t *count)
{
    *weights = virtual_scan->done.weights;
    *count = virtual_scan->done.point_count;
    return virtual_scan->done.points;
}

int32_t cairn_virtual_scan_dropped(const cairn_virtual_scan *virtual_scan)
{
    return virtual_scan->done.dropped;
}
