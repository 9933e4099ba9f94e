/* Symmetric points (SP) of edgels and of segments.
 *
 * Method:
 * 1. SP of two edgels: let u be the direction of the chord from the first to the second, v the left
 *    normal of u, c the chord's length. The normals, oriented towards each other, form the angles a
 *    and b with the chord, measured towards v. The centre lies on the bisector at c/2 tan((a + b) /
 *    2) from the chord's midpoint. There both normals deviate equally, by |a - b| / 2. The thesis
 *    prints the mean of both tangents, which deviates as much on average but unevenly, and has
 *    poles.
 * 2. SP of two segments: the most symmetric one over all pairs of sampled edgels.
 * 3. Candidate pairs (sweep and prune): the bounding boxes of the segments, grown by the largest
 *    radius, overlap wherever one disc can touch both.
 * 4. The best points are selected by a bounded heap with the least symmetric at its root, and
 *    heap-sorted.
 *
 * Memory layout: the boxes of the segments, the heap, the sweep.
 *
 * Limits: one SP per pair of segments; a long pair that is symmetric at two places must be cut
 * first.
 *
 * Source: Adluru 2008, section 2.4.1, equation 2.10. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/symmetric_point.h"
#include "src/base/object.h"
#include "src/base/step.h"
#include "src/containers/heap.h"

enum {
    MAX_SEGMENTS = 1 << 26,
    MAX_POINTS = 1 << 28,
    MAX_SAMPLES = 16,
    UNITS_PER_SAMPLE_PAIR = 3,
    UNITS_PER_HEAP_OPERATION = 4
};

/* Factor on the growth of boxes, for rounding errors. */
#define BOX_GROWTH CAIRN_REAL(1.001)

struct cairn_symmetric_point_set {
    cairn_symmetric_point_params params;
    cairn_box_sweep *sweep;
    cairn_box *boxes;            /* [max_segments] */
    cairn_symmetric_point *heap; /* [max_points] */
    const cairn_segment *segments;
    int32_t segment_count, count, dropped;
    int32_t cursor;        /* current segment; sorting: points in order */
    int32_t first, second; /* current pair; first -1: none is left */
    /* CAIRN_MORE: in work; CAIRN_OK: the result is complete; else there is none */
    cairn_status status;
    int32_t resume; /* resume point */
    int32_t units_charged;
};

#define INTEGER(field, ...)  CAIRN_INTEGER(cairn_symmetric_point_params, field, __VA_ARGS__)
#define NUMBER(field, ...)   CAIRN_NUMBER(cairn_symmetric_point_params, field, __VA_ARGS__)
#define POSITIVE(field, ...) CAIRN_NUMBER_ABOVE(cairn_symmetric_point_params, field, __VA_ARGS__)
#define BETWEEN(field, ...)  CAIRN_NUMBER_BETWEEN(cairn_symmetric_point_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_segments, 4096, 1, MAX_SEGMENTS),
    INTEGER(max_points, 8192, 1, MAX_POINTS),
    INTEGER(samples, 5, 1, MAX_SAMPLES),
    INTEGER(mode, CAIRN_MODE_DEFAULT, CAIRN_MODE_DEFAULT, CAIRN_MODE_AS_WRITTEN),
    POSITIVE(sample_step, 4, 0, CAIRN_REAL_MAX),
    NUMBER(min_radius, 2, 0, CAIRN_REAL_MAX),
    NUMBER(max_radius, 100, 0, CAIRN_REAL_MAX),
    BETWEEN(max_angle, 60 * (CAIRN_PI / 180), 0, CAIRN_PI / 2),
    NUMBER(max_deviation, 45 * (CAIRN_PI / 180), 0, CAIRN_REAL_MAX),
};
extern const cairn_parameters cairn_symmetric_point_parameters;
const cairn_parameters cairn_symmetric_point_parameters =
    CAIRN_PARAMETERS("symmetric_point", cairn_symmetric_point_params, rows);

cairn_symmetric_point_params cairn_symmetric_point_default(void)
{
    cairn_symmetric_point_params params;

    cairn_parameters_preset(&cairn_symmetric_point_parameters, &params);
    return params;
}

cairn_symmetric_point_params cairn_symmetric_point_as_written(void)
{
    cairn_symmetric_point_params params = cairn_symmetric_point_default();

    params.mode = CAIRN_MODE_AS_WRITTEN;
    return params;
}

cairn_status cairn_symmetric_point_check(const cairn_symmetric_point_params *params,
                                         cairn_object_fault *fault)
{
    cairn_status status = cairn_parameters_check(&cairn_symmetric_point_parameters, params, fault);

    if (status == CAIRN_OK)
        status =
            cairn_parameters_require(params->max_radius >= params->min_radius, "symmetric_point",
                                     "max_radius: at least min_radius", fault);
    return status;
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_symmetric_point_set *build(cairn_pool *pool,
                                        const cairn_symmetric_point_params *params)
{
    cairn_box_sweep_params sweep = {.max_boxes = params->max_segments};
    cairn_symmetric_point_set *set = cairn_object_take(pool, sizeof *set);

    CAIRN_TAKE(set, pool, boxes, params->max_segments);
    CAIRN_TAKE(set, pool, heap, params->max_points);
    CAIRN_TAKE_OBJECT(set, pool, sweep, box_sweep, &sweep);
    if (set != NULL) {
        set->params = *params;
        set->status = CAIRN_EMPTY;
    }
    return set;
}

CAIRN_OBJECT(symmetric_point, symmetric_point_set, build);

cairn_status cairn_symmetric_point_set_radii(cairn_symmetric_point_set *set, cairn_real min_radius,
                                             cairn_real max_radius)
{
    cairn_symmetric_point_params params;

    if (set == NULL)
        return CAIRN_BAD_ARGUMENT;
    params = set->params;
    params.min_radius = min_radius;
    params.max_radius = max_radius;
    if (cairn_symmetric_point_check(&params, NULL) != CAIRN_OK)
        return CAIRN_BAD_ARGUMENT;
    set->params = params;
    set->status = CAIRN_EMPTY;
    return CAIRN_OK;
}

cairn_status cairn_symmetric_point_begin(cairn_symmetric_point_set *set,
                                         const cairn_segment *segments, int32_t count)
{
    if (set == NULL || count < 0 || (segments == NULL && count > 0))
        return CAIRN_BAD_ARGUMENT;
    if (count > set->params.max_segments)
        return CAIRN_FULL;
    set->segments = segments;
    set->segment_count = count;
    set->count = set->dropped = 0;
    set->units_charged = 0;
    set->resume = 0;
    set->status = CAIRN_MORE;
    /* The segments are new, so the order of the previous sweep is discarded. */
    cairn_must_be_ok(cairn_box_sweep_begin(set->sweep, NULL, 0));
    return CAIRN_OK;
}

/* ---- One pair ---- */

/* Angle of an edgel's normal with the chord, from u towards v, in (-pi/2, pi/2). Returns 0 beyond
 * max_angle. */
static int angle_with_chord(cairn_vec2 direction, cairn_vec2 u, cairn_real cos_max,
                            cairn_real *angle)
{
    cairn_real across = cairn_vec2_cross(direction, u), parallel = cairn_vec2_dot(direction, u);

    /* Components along u and v of the normal, which is the direction rotated to the left. */
    if (across < 0) {
        across = -across;
        parallel = -parallel;
    }
    if (across < cos_max)
        return 0;
    *angle = cairn_atan2(parallel, across);
    return 1;
}

static cairn_real tangent(cairn_real angle)
{
    cairn_real sine, cosine;

    cairn_sincos(angle, &sine, &cosine);
    return sine / cosine;
}

static int point_of(cairn_oriented_point first, cairn_oriented_point second, cairn_real cos_max,
                    int32_t mode, cairn_symmetric_point *point)
{
    cairn_vec2 chord = cairn_vec2_sub(second.position, first.position), u, bisector;
    cairn_real half = CAIRN_REAL(0.5) * cairn_vec2_norm(chord), a, b, height;

    if (half == 0)
        return 0;
    u = cairn_vec2_scale(chord, CAIRN_REAL(0.5) / half);
    /* The second angle is measured from -u. Reversing its normal turns an angle from u to v into
     * one from v to u. */
    if (!angle_with_chord(first.direction, u, cos_max, &a) ||
        !angle_with_chord(second.direction, u, cos_max, &b))
        return 0;
    if (mode == CAIRN_MODE_AS_WRITTEN) {
        height = CAIRN_REAL(0.5) * half * (tangent(a) - tangent(b));
    } else {
        height = half * tangent(CAIRN_REAL(0.5) * (a - b));
    }
    bisector = cairn_vec2_left_perp(u);
    point->centre = cairn_vec2_add(cairn_vec2_add(first.position, cairn_vec2_scale(u, half)),
                                   cairn_vec2_scale(bisector, height));
    point->radius = cairn_sqrt(half * half + height * height);
    point->deviation = CAIRN_REAL(0.5) * cairn_abs(a + b);
    point->contact[0] = first.position;
    point->contact[1] = second.position;
    point->first = 0;
    point->second = 1;
    return 1;
}

int32_t cairn_symmetric_point_of(cairn_oriented_point first, cairn_oriented_point second,
                                 cairn_real max_angle, cairn_symmetric_point *point)
{
    return point_of(first, second, cairn_cos(max_angle), CAIRN_MODE_DEFAULT, point);
}

/* Number of samples of a segment: one per sample_step, up to `samples`. 0: zero length. */
static int32_t sample_count(const cairn_symmetric_point_params *params, cairn_real length)
{
    int32_t most = params->samples;

    if (!(length > 0))
        return 0;
    if (length > params->sample_step * (cairn_real)most)
        return most;
    return cairn_real_to_int(cairn_max(cairn_ceil(length / params->sample_step), 1));
}

/* Edgel at the midpoint of part i of `count` equal parts of a segment. */
static cairn_oriented_point sample(cairn_segment segment, cairn_real length, int32_t i,
                                   int32_t count)
{
    cairn_vec2 along = cairn_vec2_sub(segment.b, segment.a);
    cairn_real share = ((cairn_real)i + CAIRN_REAL(0.5)) / (cairn_real)count;
    cairn_oriented_point edgel = {cairn_vec2_add(segment.a, cairn_vec2_scale(along, share)),
                                  cairn_vec2_scale(along, 1 / length)};

    return edgel;
}

/* Squared distance of the centre from the midpoint of the chord, px^2. */
static cairn_real squared_chord_offset(const cairn_symmetric_point *point)
{
    cairn_vec2 middle =
        cairn_vec2_scale(cairn_vec2_add(point->contact[0], point->contact[1]), CAIRN_REAL(0.5));

    return cairn_vec2_norm_squared(cairn_vec2_sub(point->centre, middle));
}

int32_t cairn_symmetric_point_of_segments(const cairn_symmetric_point_params *params,
                                          cairn_segment first, cairn_segment second,
                                          cairn_symmetric_point *point)
{
    cairn_real length = cairn_segment_length(first), other_length = cairn_segment_length(second);
    cairn_real cos_max = cairn_cos(params->max_angle);
    int32_t count = sample_count(params, length), other_count = sample_count(params, other_length),
            found = 0;

    for (int32_t i = 0; i < count; i++)
        for (int32_t j = 0; j < other_count; j++) {
            cairn_symmetric_point p;

            if (!point_of(sample(first, length, i, count),
                          sample(second, other_length, j, other_count), cos_max, params->mode,
                          &p) ||
                p.radius < params->min_radius || p.radius > params->max_radius ||
                p.deviation > params->max_deviation)
                continue;
            if (!found || p.deviation < point->deviation ||
                (p.deviation == point->deviation &&
                 squared_chord_offset(&p) < squared_chord_offset(point)))
                *point = p;
            found = 1;
        }
    return found;
}

cairn_real cairn_symmetric_point_quality(const cairn_symmetric_point *point, cairn_real sigma)
{
    cairn_real scaled = point->deviation / sigma;

    return cairn_exp(CAIRN_REAL(-0.5) * scaled * scaled);
}

/* ---- All pairs ---- */

/* Order of the result; total, because every pair of segments has at most one point. */
static int is_better(const cairn_symmetric_point *a, const cairn_symmetric_point *b)
{
    if (a->deviation != b->deviation)
        return a->deviation < b->deviation;
    return a->first != b->first ? a->first < b->first : a->second < b->second;
}

static int is_worse_at(const void *context, int32_t a, int32_t b)
{
    const cairn_symmetric_point *points = context;

    return is_better(&points[b], &points[a]);
}

static void exchange_points(void *context, int32_t a, int32_t b)
{
    cairn_symmetric_point *points = context, moved = points[a];

    points[a] = points[b];
    points[b] = moved;
}

static void insert_point(cairn_symmetric_point_set *set, const cairn_symmetric_point *point)
{
    int is_full = set->count == set->params.max_points;

    set->dropped += is_full;
    if (is_full && !is_better(point, &set->heap[0]))
        return;
    set->heap[heap_keep_place(set->count, set->params.max_points)] = *point;
    set->count =
        heap_keep(set->heap, set->count, set->params.max_points, is_worse_at, exchange_points);
}

/* Sets the box of a segment, enlarged by the greatest radius. */
static void set_box(cairn_symmetric_point_set *set, int32_t i)
{
    cairn_segment s = set->segments[i];
    cairn_box box = {s.a, s.a};

    if (!cairn_segment_is_finite(s))
        set->status = CAIRN_NOT_FINITE;
    set->boxes[i] = cairn_box_grow(cairn_box_extend(box, s.b), set->params.max_radius * BOX_GROWTH);
}

/* Next pair of segments whose boxes overlap; first -1: none is left. 0 when the budget is used
 * up. */
static int next_pair(cairn_symmetric_point_set *set, cairn_budget *budget)
{
    cairn_status status = cairn_box_sweep_next(set->sweep, budget, &set->first, &set->second);

    if (status == CAIRN_EMPTY)
        set->first = -1;
    return status != CAIRN_MORE;
}

static int32_t pair_units(const cairn_symmetric_point_set *set)
{
    return UNITS_PER_HEAP_OPERATION +
           UNITS_PER_SAMPLE_PAIR *
               sample_count(&set->params, cairn_segment_length(set->segments[set->first])) *
               sample_count(&set->params, cairn_segment_length(set->segments[set->second]));
}

/* Keeps the SP of the current pair, if it has one. */
static void test_pair(cairn_symmetric_point_set *set)
{
    cairn_symmetric_point point;

    if (!cairn_symmetric_point_of_segments(&set->params, set->segments[set->first],
                                           set->segments[set->second], &point))
        return;
    point.first = set->first;
    point.second = set->second;
    insert_point(set, &point);
}

/* The detection: see Method in the head of this file. */
static int detect(cairn_symmetric_point_set *set, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(set->resume);
    for (set->cursor = 0; set->cursor < set->segment_count && set->status == CAIRN_MORE;
         set->cursor++) {
        CAIRN_STEP_CHARGE(set, resume, budget, 1);
        set_box(set, set->cursor);
    }
    if (set->status == CAIRN_MORE) {
        cairn_must_be_ok(cairn_box_sweep_begin(set->sweep, set->boxes, set->segment_count));
        for (;;) {
            CAIRN_STEP_RUN(set, resume, budget, next_pair);
            if (set->first < 0)
                break;
            CAIRN_STEP_CHARGE(set, resume, budget, pair_units(set));
            test_pair(set);
        }
        for (set->cursor = 0; set->cursor < set->count; set->cursor++) {
            CAIRN_STEP_CHARGE(set, resume, budget, UNITS_PER_HEAP_OPERATION);
            heap_pop(set->heap, set->count - set->cursor, is_worse_at, exchange_points);
        }
    }
    CAIRN_STEP_END(set->resume);
}

cairn_status cairn_symmetric_point_step(cairn_symmetric_point_set *set, cairn_budget *budget)
{
    if (set == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (set->status != CAIRN_MORE)
        return CAIRN_OK;
    if (!detect(set, budget))
        return CAIRN_MORE;
    if (set->status == CAIRN_MORE)
        set->status = CAIRN_OK;
    return set->status;
}

const cairn_symmetric_point *cairn_symmetric_point_list(const cairn_symmetric_point_set *set,
                                                        int32_t *count)
{
    int has = set != NULL && set->status == CAIRN_OK;

    if (count != NULL)
        *count = has ? set->count : 0;
    return has ? set->heap : NULL;
}

int32_t cairn_symmetric_point_dropped(const cairn_symmetric_point_set *set)
{
    return set != NULL && set->status == CAIRN_OK ? set->dropped : 0;
}
