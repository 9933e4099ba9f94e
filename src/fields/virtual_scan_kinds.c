/* Sampling of hypotheses of each kind as points, and acceptance of lines and ellipses.
 * virtual_scan.c describes the method. */
#include "src/base/build.h"

#include <string.h>

#include "src/fields/virtual_scan_work.h"

/* Points of the map that are tested for a unit. */
enum { POINTS_PER_UNIT = 4 };

/* ---- Outlines ---- */

/* Adds a hypothesis without points; NULL, and counted as dropped, beyond the capacity. */
static cairn_virtual_scan_hypothesis *add_hypothesis(cairn_virtual_scan *virtual_scan,
                                                     cairn_virtual_scan_hypothesis_kind kind,
                                                     cairn_real strength)
{
    cairn_virtual_scan_hypothesis *h = &virtual_scan->work.hypotheses[virtual_scan->work.count];

    if (virtual_scan->work.count == virtual_scan->params.max_hypotheses) {
        virtual_scan->work.dropped++;
        return NULL;
    }
    virtual_scan->work.count++;
    h->kind = kind;
    h->first_point = h->end_point = virtual_scan->work.point_count;
    h->observing_scans = 0;
    h->strength = strength;
    h->weight = virtual_scan->params.weight * strength;
    return h;
}

/* Samples a segment, points `spacing` apart, symmetric about its middle; those beyond the capacity
 * are counted as dropped. */
static void sample_segment(cairn_virtual_scan *virtual_scan,
                           cairn_virtual_scan_hypothesis *hypothesis, cairn_segment s)
{
    cairn_vec2 run = cairn_vec2_sub(s.b, s.a), direction = cairn_vec2_unit(run);
    cairn_real length = cairn_vec2_norm(run),
               steps = cairn_floor(length / virtual_scan->params.spacing);
    cairn_real first = (length - steps * virtual_scan->params.spacing) / 2;
    int32_t count = cairn_real_to_int(cairn_min(steps, CAIRN_REAL(1e9))) + 1;
    int32_t capacity = virtual_scan->params.max_virtual - virtual_scan->work.point_count;

    if (count > capacity) {
        virtual_scan->work.dropped += count - capacity;
        count = capacity;
    }
    for (int32_t i = 0; i < count; i++) {
        cairn_oriented_point *p = &virtual_scan->work.points[virtual_scan->work.point_count];

        p->position = cairn_vec2_add(
            s.a, cairn_vec2_scale(direction, first + (cairn_real)i * virtual_scan->params.spacing));
        p->direction = direction;
        virtual_scan->work.weights[virtual_scan->work.point_count++] = hypothesis->weight;
    }
    hypothesis->end_point = virtual_scan->work.point_count;
}

/* Returns the units of sampling a length in m. */
static int32_t sample_cost(const cairn_virtual_scan *virtual_scan, cairn_real length)
{
    cairn_real points =
        cairn_min(length / virtual_scan->params.spacing,
                  (cairn_real)(virtual_scan->params.max_virtual - virtual_scan->work.point_count));

    return 2 + cairn_real_to_int(points / 4);
}

/* ---- Scans on a line or ellipse ---- */

/* 1 when a point lies on the current line or ellipse. */
typedef int (*is_on)(const cairn_virtual_scan *virtual_scan, const cairn_oriented_point *point);

static void clear_inliers(cairn_virtual_scan *virtual_scan)
{
    memset(virtual_scan->scan_inliers, 0,
           (size_t)virtual_scan->params.max_scans * sizeof *virtual_scan->scan_inliers);
}

/* Adds a few points of the map from `cursor` on to the inliers of their scans. */
static void add_inliers(cairn_virtual_scan *virtual_scan, is_on is_on_it)
{
    int32_t end = virtual_scan->cursor + POINTS_PER_UNIT;

    for (int32_t i = virtual_scan->cursor; i < end && i < virtual_scan->map.point_count; i++)
        virtual_scan->scan_inliers[virtual_scan->point_scan[i]] +=
            is_on_it(virtual_scan, &virtual_scan->points[i]);
}

/* Number of scans with enough wall. */
static int32_t scans_with_walls(const cairn_virtual_scan *virtual_scan)
{
    int32_t count = 0;

    for (int32_t i = 0; i < virtual_scan->params.max_scans; i++)
        count += virtual_scan->scan_inliers[i] > 0 &&
                 (cairn_real)virtual_scan->scan_inliers[i] * virtual_scan->params.hough.spacing >=
                     virtual_scan->params.min_wall_length;
    return count;
}

/* Counts the scans with walls on the current line or ellipse. */
static int count_scans(cairn_virtual_scan *virtual_scan, is_on is_on_it, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(virtual_scan->count_resume);
    CAIRN_STEP_CHARGE(virtual_scan, count_resume, budget, 1 + virtual_scan->params.max_scans / 64);
    clear_inliers(virtual_scan);
    for (virtual_scan->cursor = 0; virtual_scan->cursor < virtual_scan->map.point_count;
         virtual_scan->cursor += POINTS_PER_UNIT) {
        CAIRN_STEP_CHARGE(virtual_scan, count_resume, budget, 1);
        add_inliers(virtual_scan, is_on_it);
    }
    CAIRN_STEP_CHARGE(virtual_scan, count_resume, budget, 1 + virtual_scan->params.max_scans / 32);
    virtual_scan->scan_count = scans_with_walls(virtual_scan);
    CAIRN_STEP_END(virtual_scan->count_resume);
}

/* ---- Lines ---- */

static int is_as_written(const cairn_virtual_scan *virtual_scan)
{
    return virtual_scan->params.mode == CAIRN_MODE_AS_WRITTEN;
}

static int32_t line_count(const cairn_virtual_scan *virtual_scan)
{
    int32_t count;

    (void)cairn_hough_list(virtual_scan->hough, &count);
    return count;
}

/* The current line. */
static const cairn_hough_line *line_of(const cairn_virtual_scan *virtual_scan)
{
    int32_t count;

    return &cairn_hough_list(virtual_scan->hough, &count)[virtual_scan->item];
}

/* 1 when a point lies on the current line. */
static int is_on_line(const cairn_virtual_scan *virtual_scan, const cairn_oriented_point *point)
{
    const cairn_hough_line *line = line_of(virtual_scan);
    cairn_vec2 from = cairn_vec2_sub(point->position, line->point);
    cairn_real along = cairn_vec2_dot(line->direction, point->direction);

    if (!virtual_scan->params.hough.oriented)
        along = cairn_abs(along);
    return cairn_abs(cairn_vec2_cross(line->direction, from)) <= virtual_scan->support &&
           along > 0 &&
           cairn_abs(cairn_vec2_cross(line->direction, point->direction)) <=
               virtual_scan->sine_angle;
}

/* Strength of the current line. As written: its inliers divided by those of the first line, which
 * has the most; else the covered share. */
static cairn_real strength_of(const cairn_virtual_scan *virtual_scan)
{
    const cairn_hough_line *line = line_of(virtual_scan);

    return is_as_written(virtual_scan) ? line->votes / line[-virtual_scan->item].votes
                                       : line->covered_length / (line->high - line->low);
}

/* Samples the current line. */
static void sample_line(cairn_virtual_scan *virtual_scan)
{
    cairn_virtual_scan_hypothesis *h =
        add_hypothesis(virtual_scan, CAIRN_VIRTUAL_SCAN_LINE, strength_of(virtual_scan));

    if (h == NULL)
        return;
    h->observing_scans = virtual_scan->scan_count;
    sample_segment(virtual_scan, h, cairn_hough_segment(line_of(virtual_scan)));
}

int cairn_virtual_scan_sample_lines(cairn_virtual_scan *virtual_scan, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(virtual_scan->phase_resume);
    virtual_scan->scan_count = 0;
    for (virtual_scan->item = 0; virtual_scan->item < line_count(virtual_scan);
         virtual_scan->item++) {
        if (!is_as_written(virtual_scan)) {
            CAIRN_STEP_UNTIL(virtual_scan->phase_resume,
                             count_scans(virtual_scan, is_on_line, budget));
            if (virtual_scan->scan_count < virtual_scan->params.min_scans)
                continue;
        }
        CAIRN_STEP_CHARGE(
            virtual_scan, phase_resume, budget,
            sample_cost(virtual_scan, line_of(virtual_scan)->high - line_of(virtual_scan)->low));
        sample_line(virtual_scan);
    }
    CAIRN_STEP_END(virtual_scan->phase_resume);
}

/* ---- Ellipses ---- */

static int32_t ellipse_count(const cairn_virtual_scan *virtual_scan)
{
    int32_t count;

    (void)cairn_ellipse_list(virtual_scan->ellipses, &count);
    return count;
}

/* The current ellipse. */
static const cairn_ellipse *ellipse_of(const cairn_virtual_scan *virtual_scan)
{
    int32_t count;

    return &cairn_ellipse_list(virtual_scan->ellipses, &count)[virtual_scan->item];
}

/* 1 when a point lies on the current ellipse. */
static int is_on_ellipse(const cairn_virtual_scan *virtual_scan, const cairn_oriented_point *point)
{
    return cairn_ellipse_is_inlier(ellipse_of(virtual_scan), point, virtual_scan->ellipse_support,
                                   virtual_scan->sine_tangent);
}

/* Samples the outline of the current ellipse, about `spacing` apart, at even angles of its
 * circle. */
static void sample_ellipse(cairn_virtual_scan *virtual_scan)
{
    const cairn_ellipse *ellipse = ellipse_of(virtual_scan);
    cairn_virtual_scan_hypothesis *h =
        add_hypothesis(virtual_scan, CAIRN_VIRTUAL_SCAN_ELLIPSE, ellipse->score);
    cairn_real length = cairn_ellipse_length(ellipse);
    int32_t count =
        cairn_real_to_int(cairn_max(cairn_ceil(length / virtual_scan->params.spacing), 8));
    int32_t capacity = virtual_scan->params.max_virtual - virtual_scan->work.point_count;

    if (h == NULL)
        return;
    h->observing_scans = virtual_scan->scan_count;
    if (count > capacity) {
        virtual_scan->work.dropped += count - capacity;
        count = capacity;
    }
    for (int32_t i = 0; i < count; i++) {
        virtual_scan->work.points[virtual_scan->work.point_count] =
            cairn_ellipse_point(ellipse, 2 * CAIRN_PI * (cairn_real)i / (cairn_real)count);
        virtual_scan->work.weights[virtual_scan->work.point_count++] = h->weight;
    }
    h->end_point = virtual_scan->work.point_count;
}

int cairn_virtual_scan_sample_ellipses(cairn_virtual_scan *virtual_scan, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(virtual_scan->phase_resume);
    for (virtual_scan->item = 0; virtual_scan->item < ellipse_count(virtual_scan);
         virtual_scan->item++) {
        CAIRN_STEP_UNTIL(virtual_scan->phase_resume,
                         count_scans(virtual_scan, is_on_ellipse, budget));
        if (virtual_scan->scan_count < virtual_scan->params.min_scans)
            continue;
        CAIRN_STEP_CHARGE(
            virtual_scan, phase_resume, budget,
            4 * sample_cost(virtual_scan, cairn_ellipse_length(ellipse_of(virtual_scan))));
        sample_ellipse(virtual_scan);
    }
    CAIRN_STEP_END(virtual_scan->phase_resume);
}

/* ---- Rectangles ---- */

/* Returns side i; free inside for rooms and rectangles without orientation, outside for boxes. */
static cairn_segment side_of(const cairn_rectangle *rectangle, int32_t i)
{
    cairn_vec2 corners[4];
    cairn_segment side;

    cairn_rectangle_corners(rectangle, corners);
    side.a = corners[i];
    side.b = corners[(i + 1) % 4];
    if (rectangle->kind == CAIRN_RECTANGLE_BOX) {
        side.a = corners[(i + 1) % 4];
        side.b = corners[i];
    }
    return side;
}

static int32_t rectangle_count(const cairn_virtual_scan *virtual_scan)
{
    int32_t count;

    (void)cairn_rectangle_list(virtual_scan->rectangles, &count);
    return count;
}

/* The current rectangle. */
static const cairn_rectangle *rectangle_of(const cairn_virtual_scan *virtual_scan)
{
    int32_t count;

    return &cairn_rectangle_list(virtual_scan->rectangles, &count)[virtual_scan->item];
}

/* Length of the outline of the current rectangle, in m. */
static cairn_real rectangle_length(const cairn_virtual_scan *virtual_scan)
{
    const cairn_rectangle *rectangle = rectangle_of(virtual_scan);

    return 4 * (rectangle->half_length + rectangle->half_width);
}

/* Samples the sides of the current rectangle. */
static void sample_rectangle(cairn_virtual_scan *virtual_scan)
{
    const cairn_rectangle *rectangle = rectangle_of(virtual_scan);
    cairn_virtual_scan_hypothesis *h =
        add_hypothesis(virtual_scan, CAIRN_VIRTUAL_SCAN_RECTANGLE, rectangle->score);

    for (int32_t i = 0; i < 4 && h != NULL; i++)
        sample_segment(virtual_scan, h, side_of(rectangle, i));
}

int cairn_virtual_scan_sample_rectangles(cairn_virtual_scan *virtual_scan, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(virtual_scan->phase_resume);
    for (virtual_scan->item = 0; virtual_scan->item < rectangle_count(virtual_scan);
         virtual_scan->item++) {
        CAIRN_STEP_CHARGE(virtual_scan, phase_resume, budget,
                          sample_cost(virtual_scan, rectangle_length(virtual_scan)));
        sample_rectangle(virtual_scan);
    }
    CAIRN_STEP_END(virtual_scan->phase_resume);
}

/* ---- The caller's kinds ---- */

/* The current detector. */
static const cairn_virtual_scan_hypothesis_detector *
detector_of(const cairn_virtual_scan *virtual_scan)
{
    return &virtual_scan->detectors[virtual_scan->item];
}

/* Begins the current detector; 0 when that ends the detection. */
static int begin_detector(cairn_virtual_scan *virtual_scan)
{
    cairn_status status =
        detector_of(virtual_scan)->begin(detector_of(virtual_scan)->state, &virtual_scan->map);

    return virtual_scan_has_ended(virtual_scan, status) || status > 0;
}

/* Continues the current detector; 1 when it has ended. */
static int run_detector(cairn_virtual_scan *virtual_scan, cairn_budget *budget)
{
    const cairn_virtual_scan_hypothesis_detector *detector = detector_of(virtual_scan);

    return virtual_scan_has_ended(virtual_scan, detector->step(detector->state, budget));
}

static int32_t outline_count(const cairn_virtual_scan *virtual_scan)
{
    return detector_of(virtual_scan)->count(detector_of(virtual_scan)->state);
}

/* Takes the current outline of the current detector. */
static void take_outline(cairn_virtual_scan *virtual_scan)
{
    const cairn_virtual_scan_hypothesis_detector *detector = detector_of(virtual_scan);
    cairn_virtual_scan_hypothesis *h =
        add_hypothesis(virtual_scan, CAIRN_VIRTUAL_SCAN_CALLER + virtual_scan->item, 0);
    int32_t capacity = virtual_scan->params.max_virtual - virtual_scan->work.point_count, count;
    cairn_real strength = 0;

    if (h == NULL)
        return;
    count = detector->outline(detector->state, virtual_scan->cursor, virtual_scan->params.spacing,
                              &virtual_scan->work.points[virtual_scan->work.point_count], capacity,
                              &strength);
    CAIRN_ASSERT(count >= 0 && count <= capacity && strength >= 0 && strength <= 1);
    h->strength = strength;
    h->weight = virtual_scan->params.weight * strength;
    for (int32_t i = 0; i < count; i++)
        virtual_scan->work.weights[virtual_scan->work.point_count++] = h->weight;
    h->end_point = virtual_scan->work.point_count;
}

int cairn_virtual_scan_run_detectors(cairn_virtual_scan *virtual_scan, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(virtual_scan->phase_resume);
    for (virtual_scan->item = 0; virtual_scan->item < virtual_scan->detector_count;
         virtual_scan->item++) {
        CAIRN_STEP_UNTIL(virtual_scan->phase_resume, begin_detector(virtual_scan));
        CAIRN_STEP_RUN(virtual_scan, phase_resume, budget, run_detector);
        for (virtual_scan->cursor = 0; virtual_scan->cursor < outline_count(virtual_scan);
             virtual_scan->cursor++) {
            CAIRN_STEP_CHARGE(virtual_scan, phase_resume, budget,
                              sample_cost(virtual_scan, CAIRN_REAL(1e6)));
            take_outline(virtual_scan);
        }
    }
    CAIRN_STEP_END(virtual_scan->phase_resume);
}
