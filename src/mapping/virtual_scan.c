/* Hypotheses from the whole map, laid out as one more scan.
 *
 * Method: the map is copied as the scans lie, thinned. Lines come from the vote of the points, with tolerances that follow the
 * uncertainty of the poses, and count when walls of several scans lie on them; rectangles come from the segments. Then the
 * caller's detectors are asked in turn. Outlines are laid out into the list in work, which readers see when all is done.
 *
 * Layout: points and segments of the map with their scans; wall points that each scan has on the line at hand; two lists of
 * hypotheses, points and weights; hough and rectangle.
 *
 * Limits: a rectangle that one scan sees whole weighs as much as one that many piece together.
 *
 * Source: Adluru 2008, chapter 8. */
#include "src/core/build.h"

#include <string.h>

#include "cairn/virtual_scan.h"

#define LIMIT CAIRN_REAL(1e6)

typedef int32_t detection_phase;
enum { IDLE, GATHER, LINES, SCANS, OUTLINES, RECTANGLES, SIDES, CALLERS };

/* What readers see. */
typedef struct result {
    cairn_hypothesis *hypotheses; /* [max_hypotheses] */
    cairn_oriented_point *points; /* [max_virtual] */
    cairn_real *weights;          /* [max_virtual] */
    int32_t count, point_count, dropped;
} result;

struct cairn_virtual_scan {
    cairn_virtual_scan_params params;
    cairn_hough *hough;
    cairn_rectangle_set *rectangles;
    cairn_oriented_point *points; /* [max_points] of the map */
    int32_t *point_scan;
    cairn_segment *segments; /* [max_segments] */
    int32_t *segment_scan;
    int32_t *on_line;                     /* [max_scans] points on the line at hand */
    cairn_hypothesis_detector *detectors; /* [max_detectors] */
    int32_t detector_count;
    cairn_virtual_map map;
    result work, done;
    detection_phase phase;
    int32_t cursor;     /* point of the map, or of an outline */
    int32_t item;       /* line, rectangle or detector at hand */
    int32_t is_clear;   /* SCANS: `on_line` */
    int32_t line_scans; /* SCANS, OUTLINES: that the line at hand brings together */
    int32_t asked;      /* CALLERS: the detector at hand has begun */
    int32_t paid;
    cairn_real support, sine_angle; /* of lines, at this sigma */
};

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
        .stride = 2,
        .spacing = CAIRN_REAL(0.10),
        .weight = 1,
        .line_support = CAIRN_REAL(0.3),
        .line_angle = CAIRN_REAL(0.2),
        .least_scans = 2,
        .least_length = CAIRN_REAL(0.5),
        .hough = cairn_hough_default(),
        .rectangle = cairn_rectangle_default(),
    };

    params.hough.angles = 72;
    params.hough.distances = 128;
    params.hough.distance_step = CAIRN_REAL(0.10);
    params.hough.angle_tolerance = 4 * (CAIRN_PI / 180);
    params.hough.separation_angle = 6 * (CAIRN_PI / 180);
    params.hough.spacing = CAIRN_REAL(0.20);
    params.hough.least_votes = 10;
    params.rectangle.merge_distance = CAIRN_REAL(0.15);
    params.rectangle.merge_gap = 3;
    params.rectangle.angle = 10 * (CAIRN_PI / 180);
    params.rectangle.min_side = 1;
    return params;
}

static int is_count(int32_t count, int32_t least, int32_t most)
{
    return count >= least && count <= most;
}

static int params_are_valid(const cairn_virtual_scan_params *p)
{
    return p != NULL && is_count(p->max_scans, 1, 1 << 20) && is_count(p->max_points, 1, 1 << 24) &&
           is_count(p->max_segments, 1, 1 << 20) && is_count(p->max_hypotheses, 1, 1024) &&
           is_count(p->max_virtual, 1, 1 << 24) && is_count(p->max_detectors, 0, 16) && p->stride >= 1 &&
           p->spacing > 0 && p->spacing <= LIMIT && p->weight >= 0 && p->weight <= LIMIT && p->line_support > 0 &&
           p->line_support <= 1 && p->line_angle > 0 && p->line_angle <= LIMIT && p->least_scans >= 1 &&
           p->least_length >= 0 && p->least_length <= LIMIT && cairn_hough_memory(&p->hough) > 0;
}

static cairn_rectangle_params rectangles_of(const cairn_virtual_scan_params *params)
{
    cairn_rectangle_params rectangle = params->rectangle;

    rectangle.max_segments = params->max_segments;
    return rectangle;
}

static cairn_hough *carve_hough(cairn_pool *pool, const cairn_hough_params *params)
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

static cairn_rectangle_set *carve_rectangles(cairn_pool *pool, const cairn_virtual_scan_params *params)
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

static result carve_result(cairn_pool *pool, const cairn_virtual_scan_params *params)
{
    result r = {NULL, NULL, NULL, 0, 0, 0};

    r.hypotheses = cairn_pool_take(pool, (size_t)params->max_hypotheses, sizeof *r.hypotheses);
    r.points = cairn_pool_take(pool, (size_t)params->max_virtual, sizeof *r.points);
    r.weights = cairn_pool_take(pool, (size_t)params->max_virtual, sizeof *r.weights);
    return r;
}

static cairn_virtual_scan *carve(cairn_pool *pool, const cairn_virtual_scan_params *params)
{
    size_t points = (size_t)params->max_points, segments = (size_t)params->max_segments;
    cairn_virtual_scan *v = cairn_pool_take_one(pool, sizeof *v), made;

    memset(&made, 0, sizeof made);
    made.points = cairn_pool_take(pool, points, sizeof *made.points);
    made.point_scan = cairn_pool_take(pool, points, sizeof *made.point_scan);
    made.segments = cairn_pool_take(pool, segments, sizeof *made.segments);
    made.segment_scan = cairn_pool_take(pool, segments, sizeof *made.segment_scan);
    made.on_line = cairn_pool_take(pool, (size_t)params->max_scans, sizeof *made.on_line);
    made.detectors = cairn_pool_take(pool, (size_t)params->max_detectors, sizeof *made.detectors);
    made.work = carve_result(pool, params);
    made.done = carve_result(pool, params);
    made.hough = carve_hough(pool, &params->hough);
    made.rectangles = carve_rectangles(pool, params);
    if (v != NULL)
        *v = made;
    return v;
}

size_t cairn_virtual_scan_memory(const cairn_virtual_scan_params *params)
{
    cairn_pool counting;

    if (!params_are_valid(params))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_virtual_scan_create(cairn_virtual_scan **virtual_scan, cairn_pool *pool,
                                       const cairn_virtual_scan_params *params)
{
    size_t need = cairn_virtual_scan_memory(params);
    cairn_virtual_scan *made;

    if (virtual_scan == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    made = carve(pool, params);
    made->params = *params;
    *virtual_scan = made;
    return CAIRN_OK;
}

cairn_status cairn_virtual_scan_add_detector(cairn_virtual_scan *virtual_scan,
                                             const cairn_hypothesis_detector *detector)
{
    if (virtual_scan == NULL || detector == NULL || detector->begin == NULL || detector->step == NULL ||
        detector->count == NULL || detector->outline == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (virtual_scan->detector_count == virtual_scan->params.max_detectors)
        return CAIRN_FULL;
    virtual_scan->detectors[virtual_scan->detector_count++] = *detector;
    return CAIRN_OK;
}

/* ---- The map ---- */

/* Lines' tolerances at this uncertainty. */
static void adjust_lines(cairn_virtual_scan *v, cairn_real sigma)
{
    cairn_hough_params hough = v->params.hough;
    cairn_real angle = cairn_min(cairn_max(v->params.line_angle * sigma, hough.angle_tolerance), CAIRN_PI / 6);
    cairn_status status;

    hough.support_distance = cairn_max(hough.support_distance, v->params.line_support * sigma);
    hough.separation = cairn_max(hough.separation, 2 * v->params.line_support * sigma);
    hough.distance_step = cairn_max(hough.distance_step, hough.support_distance / 2);
    hough.angle_tolerance = cairn_max(hough.angle_tolerance, angle);
    hough.separation_angle = cairn_max(hough.separation_angle, angle);
    v->support = hough.support_distance;
    v->sine_angle = cairn_sin(hough.angle_tolerance);
    status = cairn_hough_adjust(v->hough, &hough);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
}

cairn_status cairn_virtual_scan_begin(cairn_virtual_scan *virtual_scan, cairn_real sigma)
{
    cairn_virtual_scan *v = virtual_scan;

    if (v == NULL || !(sigma >= 0) || sigma > LIMIT / 2)
        return CAIRN_BAD_ARGUMENT;
    memset(&v->map, 0, sizeof v->map);
    v->map.points = v->points;
    v->map.point_scan = v->point_scan;
    v->map.segments = v->segments;
    v->map.segment_scan = v->segment_scan;
    v->map.sigma = sigma;
    v->work.count = v->work.point_count = v->work.dropped = 0;
    v->phase = GATHER;
    adjust_lines(v, sigma);
    return CAIRN_OK;
}

static int has_scan(const cairn_virtual_scan *v, const cairn_scan_set *set, int32_t scan)
{
    return scan >= 0 && scan < set->scan_count && scan < v->params.max_scans && set->scans[scan].in_use;
}

/* How many of a segment's points the map has. */
static int32_t thinned(const cairn_virtual_scan *v, const cairn_scan_set_segment *s)
{
    return (s->end_point - s->first_point + v->params.stride - 1) / v->params.stride;
}

static void add_segment(cairn_virtual_scan *v, const cairn_scan_set *set, int32_t index, cairn_transform map_scan)
{
    const cairn_scan_set_segment *s = &set->segments[index];
    cairn_segment *to = &v->segments[v->map.segment_count];
    cairn_oriented_point *points = &v->points[v->map.point_count];
    int32_t count = thinned(v, s);

    to->a = cairn_transform_point(map_scan, s->segment.a);
    to->b = cairn_transform_point(map_scan, s->segment.b);
    v->segment_scan[v->map.segment_count++] = s->scan;
    for (int32_t i = 0; i < count; i++) {
        cairn_vec2 p;

        cairn_scan_set_read(set, index, i * v->params.stride, 1, &p);
        points[i].position = cairn_transform_point(map_scan, p);
        points[i].direction = cairn_transform_direction(map_scan, s->direction);
        v->point_scan[v->map.point_count++] = s->scan;
    }
}

cairn_status cairn_virtual_scan_add_scan(cairn_virtual_scan *virtual_scan, const cairn_scan_set *set, int32_t scan,
                                         cairn_pose map_scan)
{
    cairn_virtual_scan *v = virtual_scan;
    const cairn_scan_set_scan *of;
    cairn_transform t;
    int32_t points = 0;

    if (v == NULL || set == NULL || v->phase != GATHER || !has_scan(v, set, scan) || !cairn_pose_is_finite(map_scan) ||
        cairn_abs(map_scan.x) > LIMIT / 2 || cairn_abs(map_scan.y) > LIMIT / 2)
        return CAIRN_BAD_ARGUMENT;
    of = &set->scans[scan];
    for (int32_t i = of->first_segment; i < of->end_segment; i++)
        points += thinned(v, &set->segments[i]);
    if (points > v->params.max_points - v->map.point_count ||
        of->end_segment - of->first_segment > v->params.max_segments - v->map.segment_count)
        return CAIRN_FULL;
    t = cairn_transform_of(map_scan);
    for (int32_t i = of->first_segment; i < of->end_segment; i++)
        add_segment(v, set, i, t);
    return CAIRN_OK;
}

/* ---- Outlines ---- */

/* A hypothesis without points yet; NULL and counted as dropped when there is no room. */
static cairn_hypothesis *add_hypothesis(cairn_virtual_scan *v, cairn_hypothesis_kind kind, cairn_real strength)
{
    cairn_hypothesis *h = &v->work.hypotheses[v->work.count];

    if (v->work.count == v->params.max_hypotheses) {
        v->work.dropped++;
        return NULL;
    }
    v->work.count++;
    h->kind = kind;
    h->first_point = h->end_point = v->work.point_count;
    h->scans = 0;
    h->strength = strength;
    h->weight = v->params.weight * strength;
    return h;
}

/* Points on a segment, `spacing` apart about its middle; those without room are counted as dropped. */
static void lay_out(cairn_virtual_scan *v, cairn_hypothesis *h, cairn_segment s)
{
    cairn_vec2 run = cairn_vec2_sub(s.b, s.a), direction = cairn_vec2_unit(run);
    cairn_real length = cairn_vec2_norm(run), steps = cairn_floor(length / v->params.spacing);
    cairn_real first = (length - steps * v->params.spacing) / 2;
    int32_t count = cairn_real_to_int(cairn_min(steps, CAIRN_REAL(1e9))) + 1;
    int32_t room = v->params.max_virtual - v->work.point_count;

    if (count > room) {
        v->work.dropped += count - room;
        count = room;
    }
    for (int32_t i = 0; i < count; i++) {
        cairn_oriented_point *p = &v->work.points[v->work.point_count];

        p->position = cairn_vec2_add(s.a, cairn_vec2_scale(direction, first + (cairn_real)i * v->params.spacing));
        p->direction = direction;
        v->work.weights[v->work.point_count++] = h->weight;
    }
    h->end_point = v->work.point_count;
}

/* Units that laying out a way of so many metres costs. */
static int32_t price(const cairn_virtual_scan *v, cairn_real length)
{
    cairn_real points =
        cairn_min(length / v->params.spacing, (cairn_real)(v->params.max_virtual - v->work.point_count));

    return 2 + cairn_real_to_int(points / 4);
}

/* ---- Lines ---- */

static int is_on(const cairn_virtual_scan *v, const cairn_hough_line *l, const cairn_oriented_point *p)
{
    cairn_vec2 from = cairn_vec2_sub(p->position, l->point);
    cairn_real along = cairn_vec2_dot(l->direction, p->direction);

    if (!v->params.hough.oriented)
        along = cairn_abs(along);
    return cairn_abs(cairn_vec2_cross(l->direction, from)) <= v->support && along > 0 &&
           cairn_abs(cairn_vec2_cross(l->direction, p->direction)) <= v->sine_angle;
}

/* How many scans have walls on the line at hand. */
static cairn_status step_scans(cairn_virtual_scan *v, const cairn_hough_line *l, cairn_budget *budget)
{
    int32_t used = v->params.max_scans;

    if (!v->is_clear) {
        if (!cairn_budget_pay(budget, &v->paid, 1 + used / 64))
            return CAIRN_MORE;
        memset(v->on_line, 0, (size_t)used * sizeof *v->on_line);
        v->is_clear = 1;
    }
    while (v->cursor < v->map.point_count) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        for (int32_t i = 0; i < 4 && v->cursor < v->map.point_count; i++, v->cursor++)
            v->on_line[v->point_scan[v->cursor]] += is_on(v, l, &v->points[v->cursor]);
    }
    if (!cairn_budget_pay(budget, &v->paid, 1 + used / 32))
        return CAIRN_MORE;
    v->line_scans = 0;
    for (int32_t i = 0; i < used; i++)
        v->line_scans +=
            v->on_line[i] > 0 && (cairn_real)v->on_line[i] * v->params.hough.spacing >= v->params.least_length;
    return CAIRN_OK;
}

/* The line at hand, when enough scans have walls on it. */
static cairn_status step_line(cairn_virtual_scan *v, const cairn_hough_line *l, cairn_budget *budget)
{
    cairn_hypothesis *h;

    if (v->line_scans < v->params.least_scans)
        return CAIRN_OK;
    if (!cairn_budget_pay(budget, &v->paid, price(v, l->high - l->low)))
        return CAIRN_MORE;
    h = add_hypothesis(v, CAIRN_HYPOTHESIS_LINE, l->covered / (l->high - l->low));
    if (h != NULL) {
        h->scans = v->line_scans;
        lay_out(v, h, cairn_hough_segment(l));
    }
    return CAIRN_OK;
}

static cairn_status step_lines(cairn_virtual_scan *v, cairn_budget *budget)
{
    int32_t count;
    const cairn_hough_line *lines = cairn_hough_list(v->hough, &count);

    while (v->item < count) {
        if (v->phase == SCANS) {
            if (step_scans(v, &lines[v->item], budget) != CAIRN_OK)
                return CAIRN_MORE;
            v->phase = OUTLINES;
        }
        if (step_line(v, &lines[v->item], budget) != CAIRN_OK)
            return CAIRN_MORE;
        v->phase = SCANS;
        v->cursor = 0;
        v->is_clear = 0;
        v->item++;
    }
    v->phase = OUTLINES;
    return CAIRN_OK;
}

/* ---- Rectangles ---- */

/* Side i; free inside for rooms and those without directions, outside for boxes. */
static cairn_segment side_of(const cairn_rectangle *r, int32_t i)
{
    cairn_vec2 corners[4];
    cairn_segment side;

    cairn_rectangle_corners(r, corners);
    side.a = corners[i];
    side.b = corners[(i + 1) % 4];
    if (r->kind == CAIRN_RECTANGLE_BOX) {
        side.a = corners[(i + 1) % 4];
        side.b = corners[i];
    }
    return side;
}

static cairn_status step_sides(cairn_virtual_scan *v, cairn_budget *budget)
{
    int32_t count;
    const cairn_rectangle *list = cairn_rectangle_list(v->rectangles, &count);

    for (; v->item < count; v->item++) {
        const cairn_rectangle *r = &list[v->item];
        cairn_hypothesis *h;

        if (!cairn_budget_pay(budget, &v->paid, price(v, 4 * (r->half_length + r->half_width))))
            return CAIRN_MORE;
        h = add_hypothesis(v, CAIRN_HYPOTHESIS_RECTANGLE, r->strength);
        for (int32_t i = 0; i < 4 && h != NULL; i++)
            lay_out(v, h, side_of(r, i));
    }
    return CAIRN_OK;
}

/* ---- Kinds of the caller ---- */

static void take_outline(cairn_virtual_scan *v, const cairn_hypothesis_detector *d, int32_t index)
{
    cairn_hypothesis *h = add_hypothesis(v, CAIRN_HYPOTHESIS_CALLER + v->item, 0);
    int32_t room = v->params.max_virtual - v->work.point_count, count;
    cairn_real strength = 0;

    if (h == NULL)
        return;
    count = d->outline(d->state, index, v->params.spacing, &v->work.points[v->work.point_count], room, &strength);
    CAIRN_ASSERT(count >= 0 && count <= room && strength >= 0 && strength <= 1);
    h->strength = strength;
    h->weight = v->params.weight * strength;
    for (int32_t i = 0; i < count; i++)
        v->work.weights[v->work.point_count++] = h->weight;
    h->end_point = v->work.point_count;
}

static cairn_status step_callers(cairn_virtual_scan *v, cairn_budget *budget)
{
    while (v->item < v->detector_count) {
        const cairn_hypothesis_detector *d = &v->detectors[v->item];
        cairn_status status = CAIRN_OK;

        if (!v->asked)
            status = d->begin(d->state, &v->map);
        v->asked = 1;
        if (status == CAIRN_OK)
            status = d->step(d->state, budget);
        if (status != CAIRN_OK)
            return status;
        for (; v->cursor < d->count(d->state); v->cursor++) {
            if (!cairn_budget_pay(budget, &v->paid, price(v, LIMIT)))
                return CAIRN_MORE;
            take_outline(v, d, v->cursor);
        }
        v->item++;
        v->cursor = 0;
        v->asked = 0;
    }
    return CAIRN_OK;
}

/* ---- The detection ---- */

/* The phase after the one at hand, begun. */
static cairn_status go_on(cairn_virtual_scan *v)
{
    static const detection_phase next[] = {IDLE, LINES, SCANS, OUTLINES, RECTANGLES, SIDES, CALLERS, IDLE};

    v->cursor = 0;
    v->is_clear = 0;
    v->item = 0;
    v->asked = 0;
    v->paid = 0;
    v->phase = next[v->phase];
    if (v->phase == LINES)
        return cairn_hough_begin(v->hough, v->points, NULL, v->params.lines ? v->map.point_count : 0);
    if (v->phase == RECTANGLES)
        return cairn_rectangle_begin(v->rectangles, v->segments, v->params.rectangles ? v->map.segment_count : 0);
    if (v->phase == IDLE) {
        result work = v->work;

        v->work = v->done;
        v->done = work;
    }
    return CAIRN_OK;
}

static cairn_status step_phase(cairn_virtual_scan *v, cairn_budget *budget)
{
    switch (v->phase) {
    case LINES:
        return cairn_hough_step(v->hough, budget);
    case SCANS:
    case OUTLINES:
        return step_lines(v, budget);
    case RECTANGLES:
        return cairn_rectangle_step(v->rectangles, budget);
    case SIDES:
        return step_sides(v, budget);
    case CALLERS:
        return step_callers(v, budget);
    default:
        return CAIRN_OK;
    }
}

cairn_status cairn_virtual_scan_step(cairn_virtual_scan *virtual_scan, cairn_budget *budget)
{
    if (virtual_scan == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (virtual_scan->phase != IDLE) {
        cairn_status status = step_phase(virtual_scan, budget);

        if (status == CAIRN_MORE)
            return status;
        if (status == CAIRN_OK)
            status = go_on(virtual_scan);
        if (status < 0) {
            virtual_scan->phase = IDLE;
            return status;
        }
    }
    return CAIRN_OK;
}

const cairn_hypothesis *cairn_virtual_scan_hypotheses(const cairn_virtual_scan *virtual_scan, int32_t *count)
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
