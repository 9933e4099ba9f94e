/* Sampling of hypotheses of each kind as points, and acceptance of lines and ellipses.
 * virtual_scan.c describes the method. */
#include "src/base/build.h"

#include <string.h>

#include "src/fields/virtual_scan_work.h"

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

/* ---- Lines ---- */

static int is_on(const cairn_virtual_scan *virtual_scan, const cairn_hough_line *line,
                 const cairn_oriented_point *point)
{
    cairn_vec2 from = cairn_vec2_sub(point->position, line->point);
    cairn_real along = cairn_vec2_dot(line->direction, point->direction);

    if (!virtual_scan->params.hough.oriented)
        along = cairn_abs(along);
    return cairn_abs(cairn_vec2_cross(line->direction, from)) <= virtual_scan->support &&
           along > 0 &&
           cairn_abs(cairn_vec2_cross(line->direction, point->direction)) <=
               virtual_scan->sine_angle;
}

static int is_on_line(const cairn_virtual_scan *virtual_scan, const cairn_oriented_point *point)
{
    int32_t count;

    return is_on(virtual_scan, &cairn_hough_list(virtual_scan->hough, &count)[virtual_scan->item],
                 point);
}

static int is_on_ellipse(const cairn_virtual_scan *virtual_scan, const cairn_oriented_point *point)
{
    int32_t count;

    return cairn_ellipse_is_inlier(
        &cairn_ellipse_list(virtual_scan->ellipses, &count)[virtual_scan->item], point,
        virtual_scan->ellipse_support, virtual_scan->sine_tangent);
}

/* Counts the scans with walls on the current line or ellipse. */
static cairn_status count_scans(cairn_virtual_scan *virtual_scan,
                                int (*is_on_it)(const cairn_virtual_scan *,
                                                const cairn_oriented_point *),
                                cairn_budget *budget)
{
    int32_t used = virtual_scan->params.max_scans;

    if (!virtual_scan->inliers_cleared) {
        if (!cairn_budget_charge(budget, &virtual_scan->units_charged, 1 + used / 64))
            return CAIRN_MORE;
        memset(virtual_scan->scan_inliers, 0, (size_t)used * sizeof *virtual_scan->scan_inliers);
        virtual_scan->inliers_cleared = 1;
    }
    while (virtual_scan->cursor < virtual_scan->map.point_count) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        for (int32_t i = 0; i < 4 && virtual_scan->cursor < virtual_scan->map.point_count;
             i++, virtual_scan->cursor++)
            virtual_scan->scan_inliers[virtual_scan->point_scan[virtual_scan->cursor]] +=
                is_on_it(virtual_scan, &virtual_scan->points[virtual_scan->cursor]);
    }
    if (!cairn_budget_charge(budget, &virtual_scan->units_charged, 1 + used / 32))
        return CAIRN_MORE;
    virtual_scan->scan_count = 0;
    for (int32_t i = 0; i < used; i++)
        virtual_scan->scan_count +=
            virtual_scan->scan_inliers[i] > 0 &&
            (cairn_real)virtual_scan->scan_inliers[i] * virtual_scan->params.hough.spacing >=
                virtual_scan->params.min_wall_length;
    virtual_scan->scans_counted = 1;
    return CAIRN_OK;
}

static void next_item(cairn_virtual_scan *virtual_scan)
{
    virtual_scan->cursor = 0;
    virtual_scan->inliers_cleared = virtual_scan->scans_counted = 0;
    virtual_scan->item++;
}

/* Returns the strength. As written: inliers of the line divided by those of the first, which has
 * the most; else the covered share. */
static cairn_real strength_of(const cairn_virtual_scan *virtual_scan, const cairn_hough_line *lines,
                              const cairn_hough_line *line)
{
    return virtual_scan->params.mode == CAIRN_MODE_AS_WRITTEN
               ? line->votes / lines->votes
               : line->covered_length / (line->high - line->low);
}

cairn_status cairn_virtual_scan_sample_lines(cairn_virtual_scan *virtual_scan, cairn_budget *budget)
{
    int32_t count, is_as_written = virtual_scan->params.mode == CAIRN_MODE_AS_WRITTEN;
    const cairn_hough_line *lines = cairn_hough_list(virtual_scan->hough, &count);

    for (; virtual_scan->item < count; next_item(virtual_scan)) {
        const cairn_hough_line *l = &lines[virtual_scan->item];
        cairn_virtual_scan_hypothesis *h;

        if (!is_as_written && !virtual_scan->scans_counted &&
            count_scans(virtual_scan, is_on_line, budget) != CAIRN_OK)
            return CAIRN_MORE;
        if (!is_as_written && virtual_scan->scan_count < virtual_scan->params.min_scans)
            continue;
        if (!cairn_budget_charge(budget, &virtual_scan->units_charged,
                                 sample_cost(virtual_scan, l->high - l->low)))
            return CAIRN_MORE;
        h = add_hypothesis(virtual_scan, CAIRN_VIRTUAL_SCAN_LINE,
                           strength_of(virtual_scan, lines, l));
        if (h != NULL) {
            h->observing_scans = is_as_written ? 0 : virtual_scan->scan_count;
            sample_segment(virtual_scan, h, cairn_hough_segment(l));
        }
    }
    return CAIRN_OK;
}

/* ---- Ellipses ---- */

/* Samples the outline of an ellipse, about `spacing` apart, at even angles of its circle. */
static void sample_ellipse(cairn_virtual_scan *virtual_scan,
                           cairn_virtual_scan_hypothesis *hypothesis, const cairn_ellipse *ellipse)
{
    cairn_real length = cairn_ellipse_length(ellipse);
    int32_t count =
        cairn_real_to_int(cairn_max(cairn_ceil(length / virtual_scan->params.spacing), 8));
    int32_t capacity = virtual_scan->params.max_virtual - virtual_scan->work.point_count;

    if (count > capacity) {
        virtual_scan->work.dropped += count - capacity;
        count = capacity;
    }
    for (int32_t i = 0; i < count; i++) {
        virtual_scan->work.points[virtual_scan->work.point_count] =
            cairn_ellipse_point(ellipse, 2 * CAIRN_PI * (cairn_real)i / (cairn_real)count);
        virtual_scan->work.weights[virtual_scan->work.point_count++] = hypothesis->weight;
    }
    hypothesis->end_point = virtual_scan->work.point_count;
}

cairn_status cairn_virtual_scan_sample_ellipses(cairn_virtual_scan *virtual_scan,
                                                cairn_budget *budget)
{
    int32_t count;
    const cairn_ellipse *ellipses = cairn_ellipse_list(virtual_scan->ellipses, &count);

    for (; virtual_scan->item < count; next_item(virtual_scan)) {
        const cairn_ellipse *e = &ellipses[virtual_scan->item];
        cairn_virtual_scan_hypothesis *h;

        if (!virtual_scan->scans_counted &&
            count_scans(virtual_scan, is_on_ellipse, budget) != CAIRN_OK)
            return CAIRN_MORE;
        if (virtual_scan->scan_count < virtual_scan->params.min_scans)
            continue;
        if (!cairn_budget_charge(budget, &virtual_scan->units_charged,
                                 4 * sample_cost(virtual_scan, cairn_ellipse_length(e))))
            return CAIRN_MORE;
        h = add_hypothesis(virtual_scan, CAIRN_VIRTUAL_SCAN_ELLIPSE, e->score);
        if (h != NULL) {
            h->observing_scans = virtual_scan->scan_count;
            sample_ellipse(virtual_scan, h, e);
        }
    }
    return CAIRN_OK;
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

cairn_status cairn_virtual_scan_sample_rectangles(cairn_virtual_scan *virtual_scan,
                                                  cairn_budget *budget)
{
    int32_t count;
    const cairn_rectangle *list = cairn_rectangle_list(virtual_scan->rectangles, &count);

    for (; virtual_scan->item < count; virtual_scan->item++) {
        const cairn_rectangle *r = &list[virtual_scan->item];
        cairn_virtual_scan_hypothesis *h;

        if (!cairn_budget_charge(budget, &virtual_scan->units_charged,
                                 sample_cost(virtual_scan, 4 * (r->half_length + r->half_width))))
            return CAIRN_MORE;
        h = add_hypothesis(virtual_scan, CAIRN_VIRTUAL_SCAN_RECTANGLE, r->score);
        for (int32_t i = 0; i < 4 && h != NULL; i++)
            sample_segment(virtual_scan, h, side_of(r, i));
    }
    return CAIRN_OK;
}

/* ---- The caller's kinds ---- */

static void take_outline(cairn_virtual_scan *virtual_scan,
                         const cairn_virtual_scan_hypothesis_detector *detector, int32_t index)
{
    cairn_virtual_scan_hypothesis *h =
        add_hypothesis(virtual_scan, CAIRN_VIRTUAL_SCAN_CALLER + virtual_scan->item, 0);
    int32_t capacity = virtual_scan->params.max_virtual - virtual_scan->work.point_count, count;
    cairn_real strength = 0;

    if (h == NULL)
        return;
    count = detector->outline(detector->state, index, virtual_scan->params.spacing,
                              &virtual_scan->work.points[virtual_scan->work.point_count], capacity,
                              &strength);
    CAIRN_ASSERT(count >= 0 && count <= capacity && strength >= 0 && strength <= 1);
    h->strength = strength;
    h->weight = virtual_scan->params.weight * strength;
    for (int32_t i = 0; i < count; i++)
        virtual_scan->work.weights[virtual_scan->work.point_count++] = h->weight;
    h->end_point = virtual_scan->work.point_count;
}

cairn_status cairn_virtual_scan_run_detectors(cairn_virtual_scan *virtual_scan,
                                              cairn_budget *budget)
{
    while (virtual_scan->item < virtual_scan->detector_count) {
        const cairn_virtual_scan_hypothesis_detector *d =
            &virtual_scan->detectors[virtual_scan->item];
        cairn_status status = CAIRN_OK;

        if (!virtual_scan->detector_begun)
            status = d->begin(d->state, &virtual_scan->map);
        virtual_scan->detector_begun = 1;
        if (status == CAIRN_OK)
            status = d->step(d->state, budget);
        if (status != CAIRN_OK)
            return status;
        for (; virtual_scan->cursor < d->count(d->state); virtual_scan->cursor++) {
            if (!cairn_budget_charge(budget, &virtual_scan->units_charged,
                                     sample_cost(virtual_scan, CAIRN_REAL(1e6))))
                return CAIRN_MORE;
            take_outline(virtual_scan, d, virtual_scan->cursor);
        }
        virtual_scan->item++;
        virtual_scan->cursor = 0;
        virtual_scan->detector_begun = 0;
    }
    return CAIRN_OK;
}
