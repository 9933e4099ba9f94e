/* A sweep becomes beams in one frame, segments with the free side on the left, and points every `spacing` along them.
 *
 * Method: the base moves on an arc of constant twist: with (v, w) the logarithm of the motion in SE(2), it is at exp(f (v, w))
 * at the fraction f of the sweep. The hits go through the line fit of the polyline room. A segment is turned so that the
 * sensors that saw its hits are, on balance, on its left. Support of the places along all segments is counted in one array
 * of differences: +1 where a hit's support begins, -1 behind where it ends.
 *
 * Layout: one pool piece per array, the polyline object behind them.
 * Limits: the motion turns by at most half a turn. Source: Adluru 2008, sections 6.2 and 7.3 (pre-processing). */
#include "src/core/build.h"

#include <string.h>

#include "cairn/scan.h"

typedef enum phase { BEAMS, FIT, ATTRIBUTE, TURN, CHOOSE, MARK, EMIT, DONE } phase;

/* What becomes of a segment of the fit. */
typedef struct wall {
    cairn_segment segment;
    cairn_real length;
    cairn_real side;        /* > 0: the sensors are on the left */
    cairn_real first_angle; /* smallest of its hits */
    int32_t first_place;    /* its first one in `support` */
    int32_t places;         /* 0: left out */
} wall;

struct cairn_scan {
    cairn_scan_params params;
    cairn_polyline *polyline;
    float *range, *angle;
    cairn_beam *beams;
    int32_t *hit; /* [max_beams] beam of each hit */
    wall *walls;
    int32_t *order;   /* [max_segments] walls in the order of the view */
    int32_t *support; /* [max_points + 1] differences of the number of hits that support a place */
    cairn_segment *segments;
    int32_t *first_point;
    cairn_oriented_point *points;

    cairn_scan_input input; /* without its arrays */
    cairn_vec2 velocity;    /* linear part of the twist of the motion */
    cairn_real turn;        /* angular part */
    int32_t hit_count, wall_count, place_count, segment_count, point_count;
    int64_t total; /* of places */
    cairn_scan_view view;
    cairn_scan_measure measure;

    phase phase;
    int32_t at, other, stage, running;
    int32_t part; /* sixteenths of a unit that are used but not yet charged */
};

cairn_scan_params cairn_scan_default(void)
{
    cairn_scan_params params;

    memset(&params, 0, sizeof params);
    params.max_beams = 1024;
    params.max_segments = 128;
    params.max_points = 2048;
    params.spacing = CAIRN_REAL(0.10);
    params.support = CAIRN_REAL(0.20);
    params.fit = cairn_polyline_default();
    return params;
}

static int positive(cairn_real value)
{
    return value > 0 && cairn_is_finite(value);
}

static cairn_polyline_params fit_params(const cairn_scan_params *p)
{
    cairn_polyline_params fit = p->fit;

    fit.dim = 2;
    fit.max_points = p->max_beams;
    fit.max_segments = p->max_segments;
    return fit;
}

static int acceptable(const cairn_scan_params *p)
{
    cairn_polyline_params fit;

    if (p == NULL || p->max_beams < 1 || p->max_beams > 100000 || p->max_points < 1 || p->max_points >= INT32_MAX ||
        !positive(p->spacing) || !positive(p->support))
        return 0;
    fit = fit_params(p);
    return cairn_polyline_memory(&fit) > 0;
}

static cairn_scan *carve(cairn_pool *pool, const cairn_scan_params *p)
{
    size_t n = (size_t)p->max_beams, m = (size_t)p->max_segments, k = (size_t)p->max_points;
    cairn_scan *x = cairn_pool_take(pool, 1, sizeof *x);
    float *range = cairn_pool_take(pool, n, sizeof *range);
    float *angle = cairn_pool_take(pool, n, sizeof *angle);
    cairn_beam *beams = cairn_pool_take(pool, n, sizeof *beams);
    int32_t *hit = cairn_pool_take(pool, n, sizeof *hit);
    wall *walls = cairn_pool_take(pool, m, sizeof *walls);
    int32_t *order = cairn_pool_take(pool, m, sizeof *order);
    int32_t *support = cairn_pool_take(pool, k + 1, sizeof *support);
    cairn_segment *segments = cairn_pool_take(pool, m, sizeof *segments);
    int32_t *first_point = cairn_pool_take(pool, m + 1, sizeof *first_point);
    cairn_oriented_point *points = cairn_pool_take(pool, k, sizeof *points);

    if (x != NULL) {
        memset(x, 0, sizeof *x);
        x->params = *p;
        x->range = range;
        x->angle = angle;
        x->beams = beams;
        x->hit = hit;
        x->walls = walls;
        x->order = order;
        x->support = support;
        x->segments = segments;
        x->first_point = first_point;
        x->points = points;
        x->first_point[0] = 0;
        x->view.beams = beams;
        x->view.segments = segments;
        x->view.first_point = first_point;
        x->view.points = points;
        x->phase = DONE;
    }
    return x;
}

size_t cairn_scan_memory(const cairn_scan_params *params)
{
    cairn_polyline_params fit;
    cairn_pool counting;
    size_t behind;

    if (!acceptable(params))
        return 0;
    fit = fit_params(params);
    behind = cairn_polyline_memory(&fit);
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return counting.used < SIZE_MAX - behind ? counting.used + behind : 0;
}

cairn_status cairn_scan_create(cairn_scan **scan, cairn_pool *pool, const cairn_scan_params *params)
{
    size_t need = cairn_scan_memory(params);
    cairn_polyline_params fit;

    if (scan == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    fit = fit_params(params);
    *scan = carve(pool, params);
    return cairn_polyline_create(&(*scan)->polyline, pool, &fit);
}

static int within_extent(cairn_pose pose)
{
    return cairn_abs(pose.x) <= CAIRN_SCAN_EXTENT && cairn_abs(pose.y) <= CAIRN_SCAN_EXTENT;
}

static int finite_float(float value)
{
    return cairn_is_finite((cairn_real)value);
}

static cairn_status check_input(const cairn_scan *x, const cairn_scan_input *in, cairn_fault *fault)
{
    fault->index = -1;
    fault->what = "scan: NULL, expected an object, an input and its ranges";
    if (x == NULL || in == NULL || in->range == NULL)
        return CAIRN_BAD_ARGUMENT;
    fault->what = "count: expected at least 1";
    if (in->count < 1)
        return CAIRN_BAD_ARGUMENT;
    fault->what = "count: more beams than max_beams";
    if (in->count > x->params.max_beams)
        return CAIRN_FULL;
    fault->what = "range_min, range_max, range_sigma: expected finite numbers";
    if (!finite_float(in->range_min) || !finite_float(in->range_max) || !finite_float(in->range_sigma))
        return CAIRN_NOT_FINITE;
    fault->what = "range_min, range_max: expected 0 <= range_min < range_max <= CAIRN_SCAN_EXTENT";
    if (in->range_min < 0 || in->range_max <= in->range_min || (cairn_real)in->range_max > CAIRN_SCAN_EXTENT)
        return CAIRN_BAD_ARGUMENT;
    fault->what = "range_sigma: expected >= 0";
    if (in->range_sigma < 0)
        return CAIRN_BAD_ARGUMENT;
    fault->what = "base_sensor, motion: expected finite numbers";
    if (!cairn_pose_is_finite(in->base_sensor) || !cairn_pose_is_finite(in->motion))
        return CAIRN_NOT_FINITE;
    fault->what = "base_sensor, motion: beyond CAIRN_SCAN_EXTENT";
    if (!within_extent(in->base_sensor) || !within_extent(in->motion))
        return CAIRN_BAD_ARGUMENT;
    fault->what = "angle_min, angle_step: expected finite numbers";
    if (in->angle == NULL && !(finite_float(in->angle_min) && finite_float(in->angle_step)))
        return CAIRN_NOT_FINITE;
    fault->what = "angle: not a finite number";
    for (int32_t i = 0; in->angle != NULL && i < in->count; i++) {
        fault->index = i;
        if (!finite_float(in->angle[i]))
            return CAIRN_NOT_FINITE;
    }
    fault->index = -1;
    fault->what = NULL;
    return CAIRN_OK;
}

/* x cot x */
static cairn_real x_cot_x(cairn_real x)
{
    cairn_real sine, cosine;

    if (cairn_abs(x) < CAIRN_REAL(1e-3))
        return 1 - x * x / 3;
    cairn_sincos(x, &sine, &cosine);
    return x * cosine / sine;
}

cairn_status cairn_scan_begin(cairn_scan *x, const cairn_scan_input *input, cairn_fault *fault)
{
    cairn_fault found;
    cairn_status status = check_input(x, input, &found);
    cairn_real diagonal, half;

    if (fault != NULL)
        *fault = found;
    if (status != CAIRN_OK)
        return status;
    x->input = *input;
    x->input.range = x->input.angle = NULL;
    memcpy(x->range, input->range, (size_t)input->count * sizeof *x->range);
    if (input->angle != NULL)
        memcpy(x->angle, input->angle, (size_t)input->count * sizeof *x->angle);
    else
        for (int32_t i = 0; i < input->count; i++)
            x->angle[i] = input->angle_min + (float)i * input->angle_step;
    x->turn = cairn_wrap_angle(input->motion.theta);
    half = x->turn / 2;
    diagonal = x_cot_x(half);
    x->velocity.x = diagonal * input->motion.x + half * input->motion.y;
    x->velocity.y = diagonal * input->motion.y - half * input->motion.x;
    x->hit_count = x->wall_count = x->place_count = x->segment_count = x->point_count = 0;
    x->view.beam_count = x->view.segment_count = x->view.point_count = 0;
    x->first_point[0] = 0;
    memset(&x->measure, 0, sizeof x->measure);
    x->part = 0;
    x->phase = BEAMS;
    x->at = x->other = x->stage = x->running = 0;
    return cairn_polyline_clear(x->polyline, cairn_max(1, (cairn_real)input->range_sigma / x->params.fit.sigma));
}

static int pay(cairn_scan *x, cairn_budget *budget, int32_t sixteenths)
{
    if (budget->left <= 0)
        return 0;
    x->part += sixteenths;
    budget->left -= x->part / 16;
    x->measure.units += x->part / 16;
    x->part %= 16;
    return 1;
}

/* Where the base is at the fraction f of the sweep: exp(f (velocity, turn)). */
static cairn_pose base_at(const cairn_scan *x, cairn_real f)
{
    cairn_real a = f * x->turn, along = 1 - a * a / 6, aside = a / 2;
    cairn_pose base;

    if (cairn_abs(a) > CAIRN_REAL(1e-3)) {
        cairn_real sine, cosine;

        cairn_sincos(a / 2, &sine, &cosine);
        along = 2 * sine * cosine / a;
        aside = 2 * sine * sine / a;
    }
    base.x = f * (along * x->velocity.x - aside * x->velocity.y);
    base.y = f * (aside * x->velocity.x + along * x->velocity.y);
    base.theta = a;
    return base;
}

static int32_t *kind_count(cairn_scan *x, cairn_beam_kind kind)
{
    if (kind == CAIRN_BEAM_HIT)
        return &x->measure.hits;
    return kind == CAIRN_BEAM_FREE ? &x->measure.free : &x->measure.unknown;
}

static cairn_beam beam_of(const cairn_scan *x, int32_t i)
{
    float range = x->range[i], length = range;
    cairn_real f = x->input.count > 1 ? (cairn_real)i / (cairn_real)(x->input.count - 1) : 0;
    cairn_pose sensor = cairn_pose_compose(base_at(x, f), x->input.base_sensor);
    cairn_beam beam = {{sensor.x, sensor.y}, {sensor.x, sensor.y}, CAIRN_BEAM_HIT};
    cairn_vec2 direction;

    if (!(range > 0) || range < x->input.range_min) {
        beam.kind = CAIRN_BEAM_UNKNOWN;
        return beam;
    }
    if (range > x->input.range_max) {
        beam.kind = CAIRN_BEAM_FREE;
        length = x->input.range_max;
    }
    cairn_sincos(sensor.theta + (cairn_real)x->angle[i], &direction.y, &direction.x);
    beam.to = cairn_vec2_add(beam.from, cairn_vec2_scale(direction, (cairn_real)length));
    return beam;
}

static cairn_status make_beams(cairn_scan *x, cairn_budget *budget)
{
    for (; x->at < x->input.count; x->at++) {
        cairn_beam *beam = &x->beams[x->at];
        cairn_real point[2];
        cairn_status status;

        if (!pay(x, budget, 64))
            return CAIRN_MORE;
        *beam = beam_of(x, x->at);
        (*kind_count(x, beam->kind))++;
        if (beam->kind != CAIRN_BEAM_HIT)
            continue;
        x->hit[x->hit_count++] = x->at;
        point[0] = beam->to.x;
        point[1] = beam->to.y;
        status = cairn_polyline_add(x->polyline, point);
        if (status != CAIRN_OK)
            return status;
    }
    return CAIRN_OK;
}

static cairn_status fit(cairn_scan *x, cairn_budget *budget)
{
    cairn_status status = cairn_polyline_step(x->polyline, budget);

    if (status == CAIRN_OK) {
        cairn_polyline_measure cost = cairn_polyline_measured(x->polyline);

        x->measure.units += cost.units;
        x->measure.iterations = cost.iterations;
    }
    return status;
}

/* Stage 0 takes the segments over; stage 1 asks each hit for its side and angle. */
static cairn_status attribute(cairn_scan *x, cairn_budget *budget)
{
    cairn_polyline_view view = cairn_polyline_read(x->polyline);

    for (; x->stage == 0 && x->at < view.segment_count; x->at++) {
        const cairn_polyline_segment *from = &view.segments[x->at];
        wall *w = &x->walls[x->at];

        if (!pay(x, budget, 8))
            return CAIRN_MORE;
        memset(w, 0, sizeof *w);
        w->segment.a.x = from->a[0];
        w->segment.a.y = from->a[1];
        w->segment.b.x = from->b[0];
        w->segment.b.y = from->b[1];
        w->length = cairn_segment_length(w->segment);
        w->first_angle = CAIRN_REAL_MAX;
    }
    if (x->stage == 0) {
        x->wall_count = view.segment_count;
        x->measure.left_out = view.left_out;
        x->measure.converged = view.converged;
        x->stage = 1;
        x->at = 0;
    }
    for (; x->at < x->hit_count; x->at++) {
        int32_t label = view.label[x->at];
        const cairn_beam *beam = &x->beams[x->hit[x->at]];
        wall *w;

        if (!pay(x, budget, 6))
            return CAIRN_MORE;
        if (label < 0) {
            x->measure.uncertain++;
            continue;
        }
        w = &x->walls[label];
        w->side += cairn_vec2_cross(cairn_vec2_sub(w->segment.b, w->segment.a), cairn_vec2_sub(beam->from, beam->to));
        w->first_angle = cairn_min(w->first_angle, (cairn_real)x->angle[x->hit[x->at]]);
    }
    return CAIRN_OK;
}

static int wall_before(const cairn_scan *x, int32_t a, int32_t b)
{
    cairn_real first = x->walls[a].first_angle, second = x->walls[b].first_angle;

    return first < second || (!(second < first) && a < b);
}

/* Turns the walls, counts their places, and sorts them by insertion. */
static cairn_status turn(cairn_scan *x, cairn_budget *budget)
{
    for (; x->at < x->wall_count; x->at++) {
        wall *w = &x->walls[x->at];

        if (x->stage == 0) {
            cairn_real places = cairn_floor(w->length / x->params.spacing) + 1;

            if (!pay(x, budget, 8))
                return CAIRN_MORE;
            if (w->side < 0) {
                cairn_vec2 swap = w->segment.a;

                w->segment.a = w->segment.b;
                w->segment.b = swap;
            }
            w->places = cairn_real_to_int(places);
            x->other = x->at;
            x->stage = 1;
        }
        for (; x->other > 0 && wall_before(x, x->at, x->order[x->other - 1]); x->other--) {
            if (!pay(x, budget, 2))
                return CAIRN_MORE;
            x->order[x->other] = x->order[x->other - 1];
        }
        x->order[x->other] = x->at;
        x->stage = 0;
    }
    return CAIRN_OK;
}

/* Adds the places up and finds the shortest wall, the last among equals; it is left out and the sum made anew as long as
 * there are more than max_points. Stage 1 numbers the places in the order of the view. */
static cairn_status choose(cairn_scan *x, cairn_budget *budget)
{
    while (x->stage == 0) {
        if (x->at == 0) {
            x->total = 0;
            x->other = -1;
        }
        for (; x->at < x->wall_count; x->at++) {
            const wall *w = &x->walls[x->at];

            if (!pay(x, budget, 2))
                return CAIRN_MORE;
            x->total += w->places;
            if (w->places > 0 && (x->other < 0 || w->length <= x->walls[x->other].length))
                x->other = x->at;
        }
        x->at = 0;
        if (x->total <= x->params.max_points) {
            x->stage = 1;
            x->place_count = 0;
        } else {
            x->walls[x->other].places = 0;
            x->measure.left_out++;
        }
    }
    for (; x->at < x->wall_count; x->at++) {
        wall *w = &x->walls[x->order[x->at]];

        if (!pay(x, budget, 2))
            return CAIRN_MORE;
        w->first_place = x->place_count;
        x->place_count += w->places;
    }
    return CAIRN_OK;
}

/* Where the first place of a wall is along it. */
static cairn_real margin(const cairn_scan *x, const wall *w)
{
    return (w->length - (cairn_real)(w->places - 1) * x->params.spacing) / 2;
}

/* Stage 0 clears the differences, stage 1 enters what each hit supports. */
static cairn_status mark(cairn_scan *x, cairn_budget *budget)
{
    cairn_polyline_view view = cairn_polyline_read(x->polyline);

    for (; x->stage == 0 && x->at <= x->place_count; x->at++) {
        if (!pay(x, budget, 1))
            return CAIRN_MORE;
        x->support[x->at] = 0;
    }
    if (x->stage == 0) {
        x->stage = 1;
        x->at = 0;
    }
    for (; x->at < x->hit_count; x->at++) {
        int32_t label = view.label[x->at], first, last;
        const wall *w = &x->walls[label < 0 ? 0 : label];
        cairn_real along;

        if (!pay(x, budget, 8))
            return CAIRN_MORE;
        if (label < 0 || w->places == 0)
            continue;
        (void)cairn_segment_nearest(w->segment, x->beams[x->hit[x->at]].to, &along);
        along = along * w->length - margin(x, w);
        first = cairn_real_to_int(cairn_ceil((along - x->params.support) / x->params.spacing));
        last = cairn_real_to_int(cairn_floor((along + x->params.support) / x->params.spacing));
        first = first > 0 ? first : 0;
        last = last < w->places - 1 ? last : w->places - 1;
        if (first > last)
            continue;
        x->support[w->first_place + first]++;
        x->support[w->first_place + last + 1]--;
    }
    return CAIRN_OK;
}

/* `at` is the segment of the view, `other` the place on it, `running` the hits that support that place. */
static cairn_status emit(cairn_scan *x, cairn_budget *budget)
{
    for (; x->at < x->wall_count; x->at++, x->other = 0) {
        const wall *w = &x->walls[x->order[x->at]];
        cairn_vec2 direction;

        if (x->stage == 0 && !pay(x, budget, 8))
            return CAIRN_MORE;
        x->stage = 1;
        direction = cairn_vec2_unit(cairn_vec2_sub(w->segment.b, w->segment.a));
        for (; x->other < w->places; x->other++) {
            cairn_oriented_point *point = &x->points[x->point_count];
            cairn_real along = margin(x, w) + (cairn_real)x->other * x->params.spacing;

            if (!pay(x, budget, 4))
                return CAIRN_MORE;
            x->running += x->support[w->first_place + x->other];
            if (x->running <= 0)
                continue;
            point->position = cairn_vec2_add(w->segment.a, cairn_vec2_scale(direction, along));
            point->direction = direction;
            x->point_count++;
        }
        x->stage = 0;
        if (w->places == 0)
            continue;
        x->segments[x->segment_count++] = w->segment;
        x->first_point[x->segment_count] = x->point_count;
    }
    x->view.beam_count = x->input.count;
    x->view.segment_count = x->segment_count;
    x->view.point_count = x->point_count;
    x->view.sensor = x->beams[0].from;
    x->view.stamp_ns = x->input.stamp_ns;
    return CAIRN_OK;
}

static cairn_status run_phase(cairn_scan *x, cairn_budget *budget)
{
    switch (x->phase) {
    case BEAMS:
        return make_beams(x, budget);
    case FIT:
        return fit(x, budget);
    case ATTRIBUTE:
        return attribute(x, budget);
    case TURN:
        return turn(x, budget);
    case CHOOSE:
        return choose(x, budget);
    case MARK:
        return mark(x, budget);
    default:
        return emit(x, budget);
    }
}

cairn_status cairn_scan_step(cairn_scan *x, cairn_budget *budget)
{
    if (x == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (x->phase != DONE) {
        cairn_status status = run_phase(x, budget);

        if (status != CAIRN_OK)
            return status;
        x->phase++;
        x->at = x->other = x->stage = x->running = 0;
    }
    return CAIRN_OK;
}

cairn_scan_view cairn_scan_read(const cairn_scan *x)
{
    return x->view;
}

cairn_scan_measure cairn_scan_measured(const cairn_scan *x)
{
    return x->measure;
}
