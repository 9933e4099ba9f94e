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

#define INTEGER(field, is, from, to) CAIRN_INTEGER(cairn_virtual_scan_params, field, is, from, to)

#define NUMBER(field, is) CAIRN_NUMBER(cairn_virtual_scan_params, field, is, 0, CAIRN_MAX_MAGNITUDE)

#define POSITIVE(field, is, to) CAIRN_NUMBER_ABOVE(cairn_virtual_scan_params, field, is, 0, to)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_scans, 64, 1, 1 << 20),
    INTEGER(max_points, 4096, 1, 1 << 24),
    INTEGER(max_segments, 1024, 1, 1 << 20),
    INTEGER(max_hypotheses, 64, 1, 1024),
    INTEGER(max_virtual, 4096, 1, 1 << 24),
    INTEGER(max_detectors, 2, 0, 16),
    INTEGER(lines, 1, 0, 1),
    INTEGER(rectangles, 1, 0, 1),
    INTEGER(ellipses, 1, 0, 1),
    INTEGER(stride, 2, 1, INT32_MAX),
    POSITIVE(spacing, CAIRN_REAL(0.10), CAIRN_MAX_MAGNITUDE),
    NUMBER(weight, 1),
    POSITIVE(distance_per_sigma, CAIRN_REAL(0.3), 1),
    POSITIVE(angle_per_sigma, CAIRN_REAL(0.2), CAIRN_MAX_MAGNITUDE),
    INTEGER(min_scans, 2, 1, INT32_MAX),
    INTEGER(mode, CAIRN_MODE_DEFAULT, CAIRN_MODE_DEFAULT, CAIRN_MODE_AS_WRITTEN),
    NUMBER(min_wall_length, CAIRN_REAL(0.5)),
};
const cairn_parameters cairn_virtual_scan_parameters =
    CAIRN_PARAMETERS("virtual_scan", cairn_virtual_scan_params, rows);

cairn_virtual_scan_params cairn_virtual_scan_default(void)
{
    cairn_virtual_scan_params params;

    cairn_parameters_preset(&cairn_virtual_scan_parameters, &params);
    params.hough = cairn_hough_default();
    params.hough.angles = 72;
    params.hough.distances = 128;
    params.hough.distance_step = CAIRN_REAL(0.10);
    params.hough.angle_tolerance = 4 * (CAIRN_PI / 180);
    params.hough.separation_angle = 6 * (CAIRN_PI / 180);
    params.hough.spacing = CAIRN_REAL(0.20);
    params.hough.min_votes = 10;
    params.rectangle = cairn_rectangle_default();
    params.rectangle.merge_distance = CAIRN_REAL(0.15);
    params.rectangle.merge_gap = 3;
    params.rectangle.max_angle_error = 10 * (CAIRN_PI / 180);
    params.rectangle.min_side = 1;
    params.rectangle.min_side_coverage = CAIRN_REAL(0.3);
    params.rectangle.min_coverage = CAIRN_REAL(0.55);
    params.ellipse = cairn_ellipse_default();
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
    /* Memory for whatever passes the thresholds, but for max_virtual, which the caller sets. */
    params.hough.max_lines = 256;
    params.max_hypotheses = 1024;
    params.rectangle.max_sides = 4096;
    params.rectangle.max_pairs = 1 << 18;
    params.rectangle.max_rectangles = 256;
    return in_mode(&params);
}

static cairn_rectangle_params rectangles_of(const cairn_virtual_scan_params *params)
{
    cairn_rectangle_params rectangle = params->rectangle;

    rectangle.max_segments = params->max_segments;
    return rectangle;
}

cairn_status cairn_virtual_scan_check(const cairn_virtual_scan_params *params,
                                      cairn_object_fault *fault)
{
    cairn_virtual_scan_params used;
    cairn_rectangle_params rectangle;
    cairn_status status;

    if (params == NULL)
        return cairn_parameters_check(&cairn_virtual_scan_parameters, NULL, fault);
    used = in_mode(params);
    rectangle = rectangles_of(&used);
    status = cairn_parameters_check(&cairn_virtual_scan_parameters, &used, fault);
    if (status == CAIRN_OK)
        status = cairn_hough_check(&used.hough, fault);
    if (status == CAIRN_OK)
        status = cairn_rectangle_check(&rectangle, fault);
    if (status == CAIRN_OK)
        status = cairn_ellipse_check(&used.ellipse, fault);
    return status;
}

/* The arrays of a result. */
static void take_result(virtual_scan_result *result, cairn_pool *pool,
                        const cairn_virtual_scan_params *params)
{
    CAIRN_TAKE(result, pool, hypotheses, params->max_hypotheses);
    CAIRN_TAKE(result, pool, points, params->max_virtual);
    CAIRN_TAKE(result, pool, weights, params->max_virtual);
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_virtual_scan *build(cairn_pool *pool, const cairn_virtual_scan_params *params)
{
    cairn_virtual_scan_params used = in_mode(params);
    cairn_rectangle_params rectangle = rectangles_of(&used);
    cairn_virtual_scan *virtual_scan = cairn_object_take(pool, sizeof *virtual_scan);

    CAIRN_TAKE(virtual_scan, pool, points, used.max_points);
    CAIRN_TAKE(virtual_scan, pool, point_scan, used.max_points);
    CAIRN_TAKE(virtual_scan, pool, segments, used.max_segments);
    CAIRN_TAKE(virtual_scan, pool, segment_scan, used.max_segments);
    CAIRN_TAKE(virtual_scan, pool, scan_inliers, used.max_scans);
    CAIRN_TAKE(virtual_scan, pool, detectors, used.max_detectors);
    take_result(virtual_scan != NULL ? &virtual_scan->work : NULL, pool, &used);
    take_result(virtual_scan != NULL ? &virtual_scan->done : NULL, pool, &used);
    CAIRN_TAKE_OBJECT(virtual_scan, pool, hough, hough, &used.hough);
    CAIRN_TAKE_OBJECT(virtual_scan, pool, rectangles, rectangle, &rectangle);
    CAIRN_TAKE_OBJECT(virtual_scan, pool, ellipses, ellipse, &used.ellipse);
    if (virtual_scan != NULL)
        virtual_scan->params = used;
    return virtual_scan;
}

CAIRN_OBJECT(virtual_scan, virtual_scan, build);

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
    cairn_must_be_ok(cairn_hough_adjust(virtual_scan->hough, &hough));
}

/* Sets the tolerances of ellipses for this uncertainty. Round walls determine their tangent less
 * well than straight ones, but beyond a quarter of a right angle four walls would be a circle. */
static void adjust_ellipses(cairn_virtual_scan *virtual_scan, cairn_real sigma)
{
    cairn_ellipse_params ellipse = virtual_scan->params.ellipse;

    ellipse.support_distance =
        cairn_max(ellipse.support_distance, virtual_scan->params.distance_per_sigma * sigma);
    ellipse.angle_tolerance =
        cairn_max(ellipse.angle_tolerance,
                  cairn_min(virtual_scan->params.angle_per_sigma * sigma, CAIRN_PI / 8));
    virtual_scan->ellipse_support = ellipse.support_distance;
    virtual_scan->sine_tangent = cairn_sin(ellipse.angle_tolerance);
    cairn_must_be_ok(cairn_ellipse_adjust(virtual_scan->ellipses, &ellipse));
}

cairn_status cairn_virtual_scan_begin(cairn_virtual_scan *virtual_scan, cairn_real sigma)
{
    if (virtual_scan == NULL || !(sigma >= 0) || sigma > CAIRN_MAX_MAGNITUDE / 2)
        return CAIRN_BAD_ARGUMENT;
    memset(&virtual_scan->map, 0, sizeof virtual_scan->map);
    virtual_scan->map.points = virtual_scan->points;
    virtual_scan->map.point_scan = virtual_scan->point_scan;
    virtual_scan->map.segments = virtual_scan->segments;
    virtual_scan->map.segment_scan = virtual_scan->segment_scan;
    virtual_scan->map.sigma = sigma;
    virtual_scan->work.count = virtual_scan->work.point_count = virtual_scan->work.dropped = 0;
    virtual_scan->status = CAIRN_MORE;
    virtual_scan->resume = virtual_scan->phase_resume = virtual_scan->count_resume = 0;
    virtual_scan->units_charged = 0;
    adjust_lines(virtual_scan, sigma);
    adjust_ellipses(virtual_scan, sigma);
    return CAIRN_OK;
}

/* 1 between begin() and the first step. */
static int is_open(const cairn_virtual_scan *virtual_scan)
{
    return virtual_scan->status == CAIRN_MORE && virtual_scan->resume == 0;
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
    cairn_status status;
    int32_t points = 0;

    if (virtual_scan == NULL || set == NULL || !is_open(virtual_scan) ||
        !has_scan(virtual_scan, set, scan))
        return CAIRN_BAD_ARGUMENT;
    status = cairn_pose_check(map_scan, CAIRN_MAX_MAGNITUDE / 2, NULL);
    if (status != CAIRN_OK)
        return status;
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

/* Lines by their votes. */
static void begin_lines(cairn_virtual_scan *virtual_scan)
{
    cairn_must_be_ok(
        cairn_hough_begin(virtual_scan->hough, virtual_scan->points, NULL,
                          virtual_scan->params.lines ? virtual_scan->map.point_count : 0));
}

/* Rectangles, from the segments. */
static void begin_rectangles(cairn_virtual_scan *virtual_scan)
{
    cairn_must_be_ok(cairn_rectangle_begin(
        virtual_scan->rectangles, virtual_scan->segments,
        virtual_scan->params.rectangles ? virtual_scan->map.segment_count : 0));
}

/* Ellipses by their votes. */
static void begin_ellipses(cairn_virtual_scan *virtual_scan)
{
    cairn_must_be_ok(
        cairn_ellipse_begin(virtual_scan->ellipses, virtual_scan->points, NULL,
                            virtual_scan->params.ellipses ? virtual_scan->map.point_count : 0));
}

/* The commit point: the list in work becomes the one that readers see. */
static void commit(cairn_virtual_scan *virtual_scan)
{
    virtual_scan_result work = virtual_scan->work;

    virtual_scan->work = virtual_scan->done;
    virtual_scan->done = work;
}

/* The detection: see Method in the head of this file. */
static int detect(cairn_virtual_scan *virtual_scan, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(virtual_scan->resume);
    begin_lines(virtual_scan);
    CAIRN_STEP_UNTIL(
        virtual_scan->resume,
        virtual_scan_has_ended(virtual_scan, cairn_hough_step(virtual_scan->hough, budget)));
    CAIRN_STEP_RUN(virtual_scan, resume, budget, cairn_virtual_scan_sample_lines);
    begin_rectangles(virtual_scan);
    CAIRN_STEP_UNTIL(virtual_scan->resume,
                     virtual_scan_has_ended(
                         virtual_scan, cairn_rectangle_step(virtual_scan->rectangles, budget)));
    CAIRN_STEP_RUN(virtual_scan, resume, budget, cairn_virtual_scan_sample_rectangles);
    begin_ellipses(virtual_scan);
    CAIRN_STEP_UNTIL(
        virtual_scan->resume,
        virtual_scan_has_ended(virtual_scan, cairn_ellipse_step(virtual_scan->ellipses, budget)));
    CAIRN_STEP_RUN(virtual_scan, resume, budget, cairn_virtual_scan_sample_ellipses);
    CAIRN_STEP_RUN(virtual_scan, resume, budget, cairn_virtual_scan_run_detectors);
    commit(virtual_scan);
    CAIRN_STEP_END(virtual_scan->resume);
}

cairn_status cairn_virtual_scan_step(cairn_virtual_scan *virtual_scan, cairn_budget *budget)
{
    cairn_status status;

    if (virtual_scan == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (virtual_scan->status == CAIRN_MORE && detect(virtual_scan, budget))
        virtual_scan->status = CAIRN_OK;
    status = virtual_scan->status;
    if (status < 0)
        virtual_scan->status = CAIRN_OK;
    return status;
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
