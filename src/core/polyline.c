/* Extended EM line fitting: the object, and the order of its phases.
 *
 * Method: points are sorted by Morton code (polyline_order.c), so that nothing after that depends
 * on their order and neighbours in memory are neighbours in space. Cells of the quadtree that the
 * code spells give the first pieces (polyline_initial.c). Then, until nothing changes: E-step,
 * M-step (polyline_em.c), cuts at gaps and bends (polyline_support.c), merging (polyline_merge.c);
 * s shrinks meanwhile.
 *
 * Layout: one pool piece per array; a point is three reals also in the plane, z = 0 there.
 * Limits: coordinates up to CAIRN_POLYLINE_EXTENT; points nearer than 2^-20 of the whole extent
 * are still told apart. Source: Adluru 2008, section 2 and refs 168, 170 (Lakaemper and Latecki,
 * extended EM); the quadtree start is ours. */
#include "src/core/build.h"

#include <string.h>

#include "src/core/polyline_work.h"

cairn_polyline_params cairn_polyline_default(void)
{
    cairn_polyline_params params;

    memset(&params, 0, sizeof params);
    params.dim = 2;
    params.max_points = 1024;
    params.max_segments = 256;
    params.min_points = 4;
    params.max_iterations = 20;
    params.min_length = CAIRN_REAL(0.08);
    params.sigma = CAIRN_REAL(0.01);
    params.s_first = CAIRN_REAL(0.04);
    params.s_last = CAIRN_REAL(0.02);
    params.shrink = CAIRN_REAL(0.5);
    params.gap = CAIRN_REAL(0.25);
    params.gap_factor = 3;
    params.gap_max = CAIRN_REAL(1.5);
    params.merge_angle = CAIRN_REAL(0.26);
    params.merge_distance = CAIRN_REAL(0.10);
    params.bend = 20;
    params.tolerance = CAIRN_REAL(0.001);
    return params;
}

static int positive(cairn_real value)
{
    return value > 0 && cairn_is_finite(value);
}

static int acceptable(const cairn_polyline_params *p)
{
    return p != NULL && (p->dim == 2 || p->dim == 3) && p->max_points >= 1 &&
           p->max_points <= INT32_C(1) << 26 && p->max_segments >= 1 &&
           p->max_segments <= INT32_C(1) << 20 && p->min_points >= 3 && p->max_iterations >= 1 &&
           p->min_length >= 0 && cairn_is_finite(p->min_length) && positive(p->sigma) &&
           positive(p->s_last) && p->s_first >= p->s_last && cairn_is_finite(p->s_first) &&
           p->shrink > 0 && p->shrink <= 1 && positive(p->gap) && p->gap_factor >= 1 &&
           cairn_is_finite(p->gap_factor) && p->gap_max >= p->gap && cairn_is_finite(p->gap_max) &&
           p->merge_angle >= 0 && p->merge_angle <= CAIRN_PI / 2 && positive(p->merge_distance) &&
           positive(p->bend) && positive(p->tolerance);
}

static cairn_polyline *carve(cairn_pool *pool, const cairn_polyline_params *p)
{
    size_t n = (size_t)p->max_points, m = (size_t)p->max_segments,
           blocks = (n + POLYLINE_BLOCK - 1) / POLYLINE_BLOCK;
    cairn_polyline *x = cairn_pool_take_one(pool, sizeof *x);
    cairn_real(*raw)[3] = cairn_pool_take(pool, n, sizeof *raw);
    cairn_real(*point)[3] = cairn_pool_take(pool, n, sizeof *point);
    uint64_t *key = cairn_pool_take(pool, n, sizeof *key);
    int32_t *order = cairn_pool_take(pool, n, sizeof *order);
    int32_t *spare = cairn_pool_take(pool, n, sizeof *spare);
    int32_t *source = cairn_pool_take(pool, n, sizeof *source);
    int32_t *owner = cairn_pool_take(pool, n, sizeof *owner);
    int32_t *label = cairn_pool_take(pool, n, sizeof *label);
    cairn_real *along = cairn_pool_take(pool, n, sizeof *along);
    cairn_real(*block_min)[3] = cairn_pool_take(pool, blocks, sizeof *block_min);
    cairn_real(*block_max)[3] = cairn_pool_take(pool, blocks, sizeof *block_max);
    polyline_piece *pieces = cairn_pool_take(pool, m, sizeof *pieces);
    polyline_piece *next = cairn_pool_take(pool, m, sizeof *next);
    int32_t *candidate = cairn_pool_take(pool, m, sizeof *candidate);
    cairn_real *weight = cairn_pool_take(pool, m, sizeof *weight);
    cairn_real(*local)[3] = cairn_pool_take(pool, m, sizeof *local);
    cairn_polyline_segment *segments = cairn_pool_take(pool, m, sizeof *segments);

    if (x != NULL) {
        memset(x, 0, sizeof *x);
        x->params = *p;
        x->merge_cosine = cairn_cos(p->merge_angle);
        x->raw = raw;
        x->point = point;
        x->key = key;
        x->order = order;
        x->spare = spare;
        x->source = source;
        x->owner = owner;
        x->label = label;
        x->along = along;
        x->block_min = block_min;
        x->block_max = block_max;
        x->pieces = pieces;
        x->next = next;
        x->candidate = candidate;
        x->weight = weight;
        x->local = local;
        x->segments = segments;
        x->phase = POLYLINE_DONE;
        x->converged = 1;
    }
    return x;
}

size_t cairn_polyline_memory(const cairn_polyline_params *params)
{
    cairn_pool counting;

    if (!acceptable(params))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_polyline_create(cairn_polyline **polyline, cairn_pool *pool,
                                   const cairn_polyline_params *params)
{
    size_t need = cairn_polyline_memory(params);

    if (polyline == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    *polyline = carve(pool, params);
    return CAIRN_OK;
}

static cairn_status check_point(const cairn_real *point, int32_t dim, const char **what)
{
    for (int32_t j = 0; j < dim; j++) {
        *what = "coordinate: not a finite number";
        if (!cairn_is_finite(point[j]))
            return CAIRN_NOT_FINITE;
        *what = "coordinate: beyond CAIRN_POLYLINE_EXTENT";
        if (cairn_abs(point[j]) > CAIRN_POLYLINE_EXTENT)
            return CAIRN_BAD_ARGUMENT;
    }
    *what = NULL;
    return CAIRN_OK;
}

static cairn_status check_points(const cairn_polyline *x, const cairn_real *points, int32_t count,
                                 cairn_fault *fault)
{
    cairn_status status = CAIRN_OK;

    fault->index = -1;
    fault->what = "points: NULL or a negative count, expected an array";
    if (x == NULL || count < 0 || (points == NULL && count > 0))
        return CAIRN_BAD_ARGUMENT;
    fault->index = x->params.max_points;
    fault->what = "points: more than max_points";
    if (count > x->params.max_points)
        return CAIRN_FULL;
    fault->what = NULL;
    for (int32_t i = 0; i < count && status == CAIRN_OK; i++) {
        fault->index = i;
        status =
            check_point(points + (size_t)i * (size_t)x->params.dim, x->params.dim, &fault->what);
    }
    return status;
}

cairn_status cairn_polyline_clear(cairn_polyline *x, cairn_real scale)
{
    if (x == NULL || !positive(scale))
        return CAIRN_BAD_ARGUMENT;
    x->sigma = scale * x->params.sigma;
    x->s_first = scale * x->params.s_first;
    x->s_last = scale * x->params.s_last;
    x->s = x->s_first;
    x->side = 0;
    x->count = 0;
    x->piece_count = x->next_count = 0;
    x->shown_points = x->shown_segments = 0;
    x->round = 0;
    x->base = 0;
    x->moved = 0;
    x->changed = x->converged = x->left_out = 0;
    memset(&x->measure, 0, sizeof x->measure);
    x->part = 0;
    x->phase = POLYLINE_KEYS;
    x->stage = x->at = 0;
    return CAIRN_OK;
}

static void append(cairn_polyline *x, const cairn_real *point)
{
    for (int j = 0; j < 3; j++) {
        cairn_real value = j < x->params.dim ? point[j] : 0;

        x->raw[x->count][j] = value;
        x->low[j] = x->count == 0 ? value : cairn_min(x->low[j], value);
        x->high[j] = x->count == 0 ? value : cairn_max(x->high[j], value);
        x->side = cairn_max(x->side, x->high[j] - x->low[j]);
    }
    x->cell = cairn_max(x->side, x->sigma) / ((INT32_C(1) << (POLYLINE_LEVELS - 1)) - 1);
    x->count++;
}

cairn_status cairn_polyline_add(cairn_polyline *x, const cairn_real *point)
{
    const char *what;
    cairn_status status;

    if (x == NULL || point == NULL || x->phase != POLYLINE_KEYS || x->at > 0)
        return CAIRN_BAD_ARGUMENT;
    if (x->count == x->params.max_points)
        return CAIRN_FULL;
    status = check_point(point, x->params.dim, &what);
    if (status == CAIRN_OK)
        append(x, point);
    return status;
}

cairn_status cairn_polyline_begin(cairn_polyline *x, const cairn_real *points, int32_t count,
                                  cairn_fault *fault)
{
    cairn_fault found;
    cairn_status status = check_points(x, points, count, &found);

    if (fault != NULL)
        *fault = found;
    if (status != CAIRN_OK)
        return status;
    status = cairn_polyline_clear(x, 1);
    for (int32_t i = 0; i < count; i++)
        append(x, points + (size_t)i * (size_t)x->params.dim);
    return status;
}

/* Places of the points along their pieces. */
static int project(cairn_polyline *x, cairn_budget *budget)
{
    for (; x->at < x->count; x->at++) {
        cairn_real local[3];

        if (!polyline_pay_four(x, budget, x->at, x->count, 6))
            return 0;
        if (x->owner[x->at] < 0)
            continue;
        cairn_polyline_local(&x->pieces[x->owner[x->at]], x->params.dim, x->point[x->at], local);
        x->along[x->at] = local[0];
    }
    x->base = 0;
    return 1;
}

/* Removes the pieces that merging emptied. */
static int compact(cairn_polyline *x, cairn_budget *budget)
{
    for (; x->at < x->next_count; x->at++) {
        if (!polyline_pay(x, budget, 24))
            return 0;
        if (x->next[x->at].count > 0)
            x->next[x->other++] = x->next[x->at];
    }
    x->next_count = x->other;
    return 1;
}

/* Labels in the order of the input, and the segments with what they claim. */
static int write_result(cairn_polyline *x, cairn_budget *budget)
{
    if (x->stage == 0) {
        for (; x->at < x->piece_count; x->at++) {
            cairn_polyline_segment *segment = &x->segments[x->at];

            if (!polyline_pay(x, budget, 12))
                return 0;
            cairn_polyline_place(&x->pieces[x->at], x->pieces[x->at].low, segment->a);
            cairn_polyline_place(&x->pieces[x->at], x->pieces[x->at].high, segment->b);
            segment->count = 0;
            segment->rms = 0;
        }
        x->stage = 1;
        x->at = 0;
    }
    if (x->stage == 1) {
        for (; x->at < x->count; x->at++) {
            int32_t owner = x->owner[x->at];
            cairn_real local[3];

            if (!polyline_pay(x, budget, 8))
                return 0;
            x->label[x->source[x->at]] = owner;
            if (owner < 0)
                continue;
            cairn_polyline_local(&x->pieces[owner], x->params.dim, x->point[x->at], local);
            x->segments[owner].count++;
            x->segments[owner].rms += local[1] * local[1] + local[2] * local[2];
        }
        x->stage = 2;
        x->at = 0;
    }
    for (; x->at < x->piece_count; x->at++) {
        cairn_polyline_segment *segment = &x->segments[x->at];

        if (!polyline_pay(x, budget, 4))
            return 0;
        if (segment->count > 0)
            segment->rms = cairn_sqrt(segment->rms / (cairn_real)segment->count);
    }
    x->shown_segments = x->piece_count;
    x->shown_points = x->count;
    return 1;
}

/* The end of an iteration: what merging left becomes the pieces of the next. Returns the phase
 * to go on with: when s is at its end, points without a piece are twice looked at again, in
 * shifted cells. */
static polyline_phase turn_over(cairn_polyline *x)
{
    polyline_piece *swap = x->pieces;
    int settled;

    x->pieces = x->next;
    x->next = swap;
    x->changed = x->changed || x->piece_count != x->next_count;
    x->piece_count = x->next_count;
    x->next_count = 0;
    x->measure.iterations++;
    settled = !x->changed && x->moved <= x->params.tolerance && x->s <= x->s_last;
    x->moved = 0;
    x->changed = 0;
    if (x->measure.iterations >= x->params.max_iterations)
        return POLYLINE_CLAIM_POINTS;
    if (x->s <= x->s_last && x->round < POLYLINE_ROUNDS - 1) {
        x->round++;
        x->base = x->unclaimed;
        return POLYLINE_LIST;
    }
    if (settled) {
        x->converged = 1;
        return POLYLINE_CLAIM_POINTS;
    }
    x->s = cairn_max(x->s * x->params.shrink, x->s_last);
    return POLYLINE_EXPECT;
}

/* The phase at hand; 1 when it is through. */
static int run_phase(cairn_polyline *x, cairn_budget *budget)
{
    switch (x->phase) {
    case POLYLINE_KEYS:
        return cairn_polyline_keys(x, budget);
    case POLYLINE_SORT_POINTS:
    case POLYLINE_SORT_LIST:
    case POLYLINE_SORT_SUPPORT:
        return cairn_polyline_sort(x, budget);
    case POLYLINE_GATHER:
        return cairn_polyline_gather(x, budget);
    case POLYLINE_LIST:
        return cairn_polyline_list(x, budget);
    case POLYLINE_INITIAL:
        return cairn_polyline_initial(x, budget);
    case POLYLINE_EXPECT:
    case POLYLINE_CLAIM_POINTS:
        return cairn_polyline_expect(x, budget);
    case POLYLINE_MAXIMIZE:
        return cairn_polyline_maximize(x, budget);
    case POLYLINE_PROJECT:
        return project(x, budget);
    case POLYLINE_SUPPORT:
        return cairn_polyline_support(x, budget);
    case POLYLINE_MERGE:
        return cairn_polyline_merge(x, budget);
    case POLYLINE_COMPACT:
        return compact(x, budget);
    default:
        return write_result(x, budget);
    }
}

cairn_status cairn_polyline_step(cairn_polyline *x, cairn_budget *budget)
{
    if (x == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (x->phase != POLYLINE_DONE) {
        if (!run_phase(x, budget))
            return CAIRN_MORE;
        if (x->phase == POLYLINE_COMPACT)
            x->phase = turn_over(x);
        else
            x->phase++;
        x->stage = x->at = x->other = x->inner = 0;
        x->level = 0;
        memset(&x->sort, 0, sizeof x->sort);
        x->sort.middle = 1;
    }
    return CAIRN_OK;
}

cairn_polyline_view cairn_polyline_read(const cairn_polyline *x)
{
    cairn_polyline_view view = {x->segments,     x->label,     x->shown_segments,
                                x->shown_points, x->converged, x->left_out};
    return view;
}

cairn_polyline_measure cairn_polyline_measured(const cairn_polyline *x)
{
    return x->measure;
}
