/* scan: deskewed beams and a line fit of one laser scan; the object of the module.
 *
 * Method:
 * 1. Deskewing: the base moves on an arc of constant twist. With (v, w) the logarithm of the motion
 *    in SE(2), the base is at exp(f (v, w)) at the fraction f of the scan.
 * 2. The line fit of the polyline module segments the hits.
 * 3. scan_points.c orients and resamples the segments.
 *
 * Layout: one pool piece per array, the polyline object behind them. Limits: the motion turns by at
 * most half a turn. Source: Adluru 2008, sections 6.2 and 7.3 (pre-processing). */
#include "src/base/build.h"

#include <string.h>

#include "src/scans/scan_work.h"

int64_t cairn_time_difference(int64_t a, int64_t b)
{
    if (b < 0 && a > INT64_MAX + b)
        return INT64_MAX;
    if (b > 0 && a < INT64_MIN + b)
        return INT64_MIN;
    return a - b;
}

#define MAX_BEAMS    100000
#define MAX_SEGMENTS (INT32_C(1) << 20)

#define INTEGER(field, ...)  CAIRN_INTEGER(cairn_scan_params, field, __VA_ARGS__)
#define POSITIVE(field, ...) CAIRN_NUMBER_ABOVE(cairn_scan_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_beams, 1024, 1, MAX_BEAMS),
    INTEGER(max_segments, 128, 1, MAX_SEGMENTS),
    INTEGER(max_points, 2048, 1, INT32_MAX - 1),
    POSITIVE(spacing, CAIRN_REAL(0.10), 0, CAIRN_REAL_MAX),
    POSITIVE(support_distance, CAIRN_REAL(0.20), 0, CAIRN_REAL_MAX),
};
const cairn_parameters cairn_scan_parameters = CAIRN_PARAMETERS("scan", cairn_scan_params, rows);

cairn_scan_params cairn_scan_default(void)
{
    cairn_scan_params params;

    cairn_parameters_preset(&cairn_scan_parameters, &params);
    params.fit = cairn_polyline_default();
    return params;
}

/* Params of the line fit: those of the caller, with the capacities of the scan. */
static cairn_polyline_params fit_params(const cairn_scan_params *params)
{
    cairn_polyline_params fit = params->fit;

    fit.dim = 2;
    fit.max_points = params->max_beams;
    fit.max_segments = params->max_segments;
    return fit;
}

cairn_status cairn_scan_check(const cairn_scan_params *params, cairn_object_fault *fault)
{
    cairn_status status = cairn_parameters_check(&cairn_scan_parameters, params, fault);

    if (status == CAIRN_OK) {
        cairn_polyline_params fit = fit_params(params);

        status = cairn_polyline_check(&fit, fault);
    }
    return status;
}

/* The object, its arrays and its line fit; NULL from a counting pool. */
static cairn_scan *build(cairn_pool *pool, const cairn_scan_params *params)
{
    size_t n = (size_t)params->max_beams, m = (size_t)params->max_segments,
           k = (size_t)params->max_points;
    cairn_polyline_params fit = fit_params(params);
    cairn_scan *scan = cairn_object_take(pool, sizeof *scan);

    CAIRN_TAKE(scan, pool, range, n);
    CAIRN_TAKE(scan, pool, angle, n);
    CAIRN_TAKE(scan, pool, beams, n);
    CAIRN_TAKE(scan, pool, hit, n);
    CAIRN_TAKE(scan, pool, fitted, m);
    CAIRN_TAKE(scan, pool, order, m);
    CAIRN_TAKE(scan, pool, support, k + 1);
    CAIRN_TAKE(scan, pool, segments, m);
    CAIRN_TAKE(scan, pool, first_point, m + 1);
    CAIRN_TAKE(scan, pool, points, k);
    CAIRN_TAKE_OBJECT(scan, pool, polyline, polyline, &fit);
    if (scan != NULL) {
        scan->params = *params;
        scan->first_point[0] = 0;
        scan->view.beams = scan->beams;
        scan->view.segments = scan->segments;
        scan->view.first_point = scan->first_point;
        scan->view.points = scan->points;
        scan->is_complete = 1;
    }
    return scan;
}

CAIRN_OBJECT(scan, scan, build);

static int is_finite_float(float value)
{
    return cairn_is_finite((cairn_real)value);
}

static cairn_status check_input(const cairn_scan *scan, const cairn_scan_input *in,
                                cairn_fault *fault)
{
    fault->index = -1;
    fault->message = "scan: NULL, expected an object, an input and its ranges";
    if (scan == NULL || in == NULL || in->range == NULL)
        return CAIRN_BAD_ARGUMENT;
    fault->message = "count: expected at least 1";
    if (in->count < 1)
        return CAIRN_BAD_ARGUMENT;
    fault->message = "count: more beams than max_beams";
    if (in->count > scan->params.max_beams)
        return CAIRN_FULL;
    fault->message = "range_min, range_max, range_sigma: expected finite numbers";
    if (!is_finite_float(in->range_min) || !is_finite_float(in->range_max) ||
        !is_finite_float(in->range_sigma))
        return CAIRN_NOT_FINITE;
    fault->message =
        "range_min, range_max: expected 0 <= range_min < range_max <= CAIRN_SCAN_EXTENT";
    if (in->range_min < 0 || in->range_max <= in->range_min ||
        (cairn_real)in->range_max > CAIRN_SCAN_EXTENT)
        return CAIRN_BAD_ARGUMENT;
    fault->message = "range_sigma: expected >= 0";
    if (in->range_sigma < 0)
        return CAIRN_BAD_ARGUMENT;
    fault->message = "time_step: expected a finite number";
    if (!is_finite_float(in->time_step))
        return CAIRN_NOT_FINITE;
    fault->message = "time_step: expected >= 0";
    if (in->time_step < 0)
        return CAIRN_BAD_ARGUMENT;
    fault->message = "stamp_ns: beyond CAIRN_SCAN_MAX_STAMP_NS";
    if (in->stamp_ns > CAIRN_SCAN_MAX_STAMP_NS || in->stamp_ns < -CAIRN_SCAN_MAX_STAMP_NS)
        return CAIRN_BAD_ARGUMENT;
    fault->message = "base_sensor, motion: expected finite numbers";
    if (!cairn_pose_is_finite(in->base_sensor) || !cairn_pose_is_finite(in->motion))
        return CAIRN_NOT_FINITE;
    fault->message = "base_sensor, motion: beyond CAIRN_SCAN_EXTENT";
    if (!cairn_pose_is_within(in->base_sensor, CAIRN_SCAN_EXTENT) ||
        !cairn_pose_is_within(in->motion, CAIRN_SCAN_EXTENT))
        return CAIRN_BAD_ARGUMENT;
    fault->message = "angle_min, angle_step: expected finite numbers";
    if (in->angle == NULL && !(is_finite_float(in->angle_min) && is_finite_float(in->angle_step)))
        return CAIRN_NOT_FINITE;
    fault->message = "angle: not a finite number";
    for (int32_t i = 0; in->angle != NULL && i < in->count; i++) {
        fault->index = i;
        if (!is_finite_float(in->angle[i]))
            return CAIRN_NOT_FINITE;
    }
    fault->index = -1;
    fault->message = NULL;
    return CAIRN_OK;
}

cairn_status cairn_scan_begin(cairn_scan *scan, const cairn_scan_input *input, cairn_fault *fault)
{
    cairn_fault unread;
    cairn_status status = check_input(scan, input, fault != NULL ? fault : &unread);

    if (status != CAIRN_OK)
        return status;
    scan->input = *input;
    scan->input.range = scan->input.angle = NULL;
    memcpy(scan->range, input->range, (size_t)input->count * sizeof *scan->range);
    if (input->angle != NULL)
        memcpy(scan->angle, input->angle, (size_t)input->count * sizeof *scan->angle);
    else
        for (int32_t i = 0; i < input->count; i++)
            scan->angle[i] = input->angle_min + (float)i * input->angle_step;
    scan->twist = cairn_twist_log(input->motion);
    scan->hit_count = scan->fitted_count = scan->position_count = scan->segment_count =
        scan->point_count = 0;
    scan->view.beam_count = scan->view.segment_count = scan->view.point_count = 0;
    scan->first_point[0] = 0;
    memset(&scan->measure, 0, sizeof scan->measure);
    scan->eighths_used = 0;
    scan->resume = scan->phase_resume = 0;
    scan->is_complete = 0;
    return cairn_polyline_clear(
        scan->polyline, cairn_max(1, (cairn_real)input->range_sigma / scan->params.fit.sigma));
}

static int32_t *kind_count(cairn_scan *scan, cairn_scan_beam_kind kind)
{
    if (kind == CAIRN_SCAN_BEAM_HIT)
        return &scan->measure.hits;
    return kind == CAIRN_SCAN_BEAM_FREE ? &scan->measure.free : &scan->measure.unknown;
}

static cairn_scan_beam beam_of(const cairn_scan *scan, int32_t i)
{
    float range = scan->range[i], length = range;
    cairn_real f = scan->input.count > 1 ? (cairn_real)i / (cairn_real)(scan->input.count - 1) : 0;
    cairn_pose sensor =
        cairn_pose_compose(cairn_twist_exp(scan->twist, f), scan->input.base_sensor);
    cairn_scan_beam beam = {{sensor.x, sensor.y}, {sensor.x, sensor.y}, CAIRN_SCAN_BEAM_HIT};
    cairn_vec2 direction;

    if (!(range > 0) || range < scan->input.range_min) {
        beam.kind = CAIRN_SCAN_BEAM_UNKNOWN;
        return beam;
    }
    if (range > scan->input.range_max) {
        beam.kind = CAIRN_SCAN_BEAM_FREE;
        length = scan->input.range_max;
    }
    cairn_sincos(sensor.theta + (cairn_real)scan->angle[i], &direction.y, &direction.x);
    beam.to = cairn_vec2_add(beam.from, cairn_vec2_scale(direction, (cairn_real)length));
    return beam;
}

/* Adds a beam, and its hit to the points of the line fit. */
static void add_beam(cairn_scan *scan, int32_t i)
{
    cairn_scan_beam beam = beam_of(scan, i);
    cairn_real point[2] = {beam.to.x, beam.to.y};

    scan->beams[i] = beam;
    (*kind_count(scan, beam.kind))++;
    if (beam.kind != CAIRN_SCAN_BEAM_HIT)
        return;
    scan->hit[scan->hit_count++] = i;
    cairn_must_be_ok(cairn_polyline_add(scan->polyline, point));
}

/* Deskewed beams. */
static int make_beams(cairn_scan *scan, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(scan->phase_resume);
    for (scan->cursor = 0; scan->cursor < scan->input.count; scan->cursor++) {
        CAIRN_STEP_CHARGE_EIGHTHS(scan, phase_resume, budget, 42);
        add_beam(scan, scan->cursor);
    }
    CAIRN_STEP_END(scan->phase_resume);
}

/* The line fit has ended: adds its cost. */
static void end_fit(cairn_scan *scan)
{
    cairn_polyline_measure cost = cairn_polyline_measured(scan->polyline);

    scan->measure.units += cost.units;
    scan->measure.fit_iterations = cost.iterations;
}

/* The scan: see Method in the head of this file and of scan_points.c. */
static int process(cairn_scan *scan, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(scan->resume);
    CAIRN_STEP_RUN(scan, resume, budget, make_beams);
    CAIRN_STEP_UNTIL(scan->resume, cairn_polyline_step(scan->polyline, budget) != CAIRN_MORE);
    end_fit(scan);
    CAIRN_STEP_RUN(scan, resume, budget, cairn_scan_attribute);
    CAIRN_STEP_RUN(scan, resume, budget, cairn_scan_turn);
    CAIRN_STEP_RUN(scan, resume, budget, cairn_scan_choose);
    CAIRN_STEP_RUN(scan, resume, budget, cairn_scan_mark);
    CAIRN_STEP_RUN(scan, resume, budget, cairn_scan_emit);
    CAIRN_STEP_END(scan->resume);
}

cairn_status cairn_scan_step(cairn_scan *scan, cairn_budget *budget)
{
    if (scan == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!scan->is_complete)
        scan->is_complete = process(scan, budget);
    return scan->is_complete ? CAIRN_OK : CAIRN_MORE;
}

cairn_scan_view cairn_scan_read(const cairn_scan *scan)
{
    return scan->view;
}

cairn_scan_measure cairn_scan_measured(const cairn_scan *scan)
{
    return scan->measure;
}
