/* Models of shapes from outlines.
 *
 * Method: an outline is sampled evenly. Two samples with the disc that touches it at both are a
 * place of the symmetry set. A path through the set goes from pair to pair while one sample moves
 * on and the other back, or one of them stays; it is worth the length of outline that it passes
 * times how symmetric the pairs are, less a toll for every length, so that places without symmetry
 * are passed only where more comes behind them. The most valuable path of all is found by dynamic
 * programming over (place, gap). Stretches that one side passes alone, and what lies beyond the
 * ends of the path, are looked at in the same way, the longest first.
 *
 * Layout: outlines, the square of gains, three rows of values, the square of moves, samples, paths.
 *
 * Limits: outlines of one object do not see each other; a hole is an outline like any other, its
 * inside taken for the object. "Longest" counts the outline passed, not the way of the centre, so
 * that a disc, whose centre stays, has a path, too.
 *
 * Source: Adluru 2008, sections 2.3.2 and 2.5. */
#include "src/core/build.h"

#include <string.h>

#include "cairn/symmetric_point.h"
#include "src/contour/shape_model_work.h"

enum { IDLE, PAIRS, WALK, DONE };
enum { UNITS_A_PATH = 32 };

/* The toll: symmetric points of a quality below it are not worth their length. */
#define TOLL CAIRN_REAL(0.3)
/* Tangents are taken over so many samples to either side. */
enum { REACH = 2 };
/* Of a normal with the chord: nearer to the tip of a path two samples say too little. */
#define MAX_ANGLE (80 * (CAIRN_PI / 180))
/* A sample farther from the one before, of the mean distance, begins another outline. */
#define APART CAIRN_REAL(3.0)

cairn_shape_builder_params cairn_shape_builder_default(void)
{
    cairn_shape_builder_params params = {
        .points = 128,
        .samples = 32,
        .max_paths = CAIRN_SHAPE_PATHS,
        .max_deviation = 20 * (CAIRN_PI / 180),
        .sigma = 10 * (CAIRN_PI / 180),
        .overlap = CAIRN_REAL(0.8),
        .min_share = CAIRN_REAL(0.08),
    };
    return params;
}

static int params_are_valid(const cairn_shape_builder_params *p)
{
    return p != NULL && p->points >= SHAPE_LEAST_POINTS && p->points <= 1024 && p->samples >= 4 &&
           p->samples <= 256 && p->max_paths >= 1 && p->max_paths <= CAIRN_SHAPE_PATHS &&
           p->max_deviation > 0 && p->max_deviation < CAIRN_PI / 2 && p->sigma > 0 &&
           cairn_is_finite(p->sigma) && p->overlap >= 0 && p->overlap <= 1 && p->min_share > 0 &&
           p->min_share <= 1;
}

/* Paths share an outline, and each has its least number. */
int32_t cairn_shape_most_samples(const cairn_shape_builder_params *p)
{
    return p->samples + CAIRN_SHAPE_PATHS * (SHAPE_LEAST_SAMPLES + 1);
}

static int32_t most_points(const cairn_shape_builder_params *p)
{
    return p->points + CAIRN_SHAPE_OUTLINES * (SHAPE_LEAST_POINTS + 1);
}

static cairn_shape_builder *carve(cairn_pool *pool, const cairn_shape_builder_params *p)
{
    size_t side = (size_t)p->points + SHAPE_LEAST_POINTS;
    cairn_shape_builder *b = cairn_pool_take_one(pool, sizeof *b);
    cairn_oriented_point *outline = cairn_pool_take(pool, (size_t)most_points(p), sizeof *outline);
    cairn_real *gain = cairn_pool_take(pool, side * side, sizeof *gain);
    cairn_real *value = cairn_pool_take(pool, 3 * side, sizeof *value);
    uint8_t *move = cairn_pool_take(pool, side * side, sizeof *move);
    shape_pair *way = cairn_pool_take(pool, 2 * side, sizeof *way);
    cairn_shape_sample *samples =
        cairn_pool_take(pool, (size_t)cairn_shape_most_samples(p), sizeof *samples);
    cairn_shape_path *paths = cairn_pool_take(pool, CAIRN_SHAPE_PATHS, sizeof *paths);

    if (b != NULL) {
        memset(b, 0, sizeof *b);
        b->outline = outline;
        b->gain = gain;
        b->value = value;
        b->move = move;
        b->way = way;
        b->samples = samples;
        b->paths = paths;
    }
    return b;
}

size_t cairn_shape_builder_memory(const cairn_shape_builder_params *params)
{
    cairn_pool counting;

    if (!params_are_valid(params))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_shape_builder_create(cairn_shape_builder **builder, cairn_pool *pool,
                                        const cairn_shape_builder_params *params)
{
    size_t need = cairn_shape_builder_memory(params);
    cairn_shape_builder *made;

    if (builder == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    made = carve(pool, params);
    made->params = *params;
    *builder = made;
    return CAIRN_OK;
}

/* ---- The outlines ---- */

static cairn_status check_outlines(const cairn_curve *outlines, int32_t count, cairn_box *box,
                                   cairn_real *whole)
{
    *box = cairn_box_empty();
    *whole = 0;
    for (int32_t i = 0; i < count; i++) {
        const cairn_curve *c = &outlines[i];

        if (c->points == NULL || c->count < 3 || !c->closed)
            return CAIRN_BAD_ARGUMENT;
        for (int32_t k = 0; k < c->count; k++) {
            if (!cairn_is_finite(c->points[k].x) || !cairn_is_finite(c->points[k].y))
                return CAIRN_NOT_FINITE;
            *box = cairn_box_extend(*box, c->points[k]);
        }
        *whole += cairn_curve_length(c);
        if (!cairn_is_finite(cairn_vec2_norm_squared(cairn_vec2_sub(box->max, box->min))) ||
            !cairn_is_finite(*whole))
            return CAIRN_NOT_FINITE;
        if (!(cairn_abs(cairn_polygon_area(c->points, c->count)) > 0))
            return CAIRN_EMPTY;
    }
    return CAIRN_OK;
}

/* Samples one outline into outline[first ...], in units of the size, round so that its inside
 * lies to the left. */
static void sample_outline(cairn_shape_builder *b, const cairn_curve *curve,
                           cairn_oriented_point *to, int32_t count)
{
    int turned = cairn_polygon_area(curve->points, curve->count) < 0;
    cairn_vec2 *even = (cairn_vec2 *)(void *)b->gain, *tangent = even + count;
    cairn_curve sampled = {even, count, 1};
    cairn_status status = cairn_curve_resample(curve, even, NULL, count);

    CAIRN_ASSERT(status == CAIRN_OK);
    for (int32_t i = 0; i < count; i++)
        even[i] = cairn_vec2_scale(cairn_vec2_sub(even[i], b->origin), 1 / b->size);
    status = cairn_curve_tangents(&sampled, REACH, tangent);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    for (int32_t i = 0; i < count; i++) {
        int32_t from = turned ? count - 1 - i : i;

        to[i].position = even[from];
        to[i].direction = cairn_vec2_scale(tangent[from], turned ? -1 : 1);
    }
}

cairn_status cairn_shape_builder_begin(cairn_shape_builder *b, const cairn_curve *outlines,
                                       int32_t count)
{
    cairn_real whole;
    cairn_status status;
    cairn_box box;

    if (b == NULL || outlines == NULL || count < 1 || count > CAIRN_SHAPE_OUTLINES)
        return CAIRN_BAD_ARGUMENT;
    status = check_outlines(outlines, count, &box, &whole);
    if (status != CAIRN_OK)
        return status;
    b->size = cairn_vec2_norm(cairn_vec2_sub(box.max, box.min));
    b->origin = cairn_vec2_scale(cairn_vec2_add(box.min, box.max), CAIRN_REAL(0.5));
    b->whole = whole / b->size;
    b->outline_count = count;
    b->sample_count = b->path_count = b->arc_count = b->at = b->cursor = b->paid = 0;
    b->first[0] = 0;
    for (int32_t i = 0; i < count; i++) {
        cairn_real length = cairn_curve_length(&outlines[i]);
        int32_t points =
            cairn_real_to_int(cairn_rint((cairn_real)b->params.points * (length / whole)));

        points = points < SHAPE_LEAST_POINTS ? SHAPE_LEAST_POINTS : points;
        b->length[i] = length / b->size;
        sample_outline(b, &outlines[i], &b->outline[b->first[i]], points);
        b->first[i + 1] = b->first[i] + points;
    }
    b->phase = PAIRS;
    return CAIRN_OK;
}

/* ---- The symmetry set ---- */

int cairn_shape_disc(const cairn_shape_builder *b, int32_t low, int32_t high,
                     cairn_shape_sample *disc)
{
    cairn_oriented_point p = b->outline[low], q = b->outline[high];
    cairn_symmetric_point sp;

    if (!cairn_symmetric_point_of(p, q, MAX_ANGLE, &sp) || sp.deviation > b->params.max_deviation ||
        cairn_vec2_dot(cairn_vec2_left(p.direction), cairn_vec2_sub(sp.centre, p.position)) <= 0 ||
        cairn_vec2_dot(cairn_vec2_left(q.direction), cairn_vec2_sub(sp.centre, q.position)) <= 0)
        return 0;
    disc->centre = sp.centre;
    disc->radius = sp.radius;
    disc->deviation = sp.deviation;
    disc->side[0] = q;
    disc->side[1].position = p.position;
    disc->side[1].direction = cairn_vec2_scale(p.direction, -1);
    disc->share[0] = disc->share[1] = 0;
    return 1;
}

cairn_real cairn_shape_gain(const cairn_shape_builder *b, int32_t low, int32_t high)
{
    cairn_shape_sample disc;
    cairn_real clear, scaled;

    if (!cairn_shape_disc(b, low, high, &disc))
        return -TOLL;
    clear = b->params.overlap * disc.radius;
    for (int32_t i = b->first[b->at]; i < b->first[b->at + 1]; i++)
        if (cairn_vec2_norm_squared(cairn_vec2_sub(b->outline[i].position, disc.centre)) <
            clear * clear)
            return -TOLL;
    scaled = disc.deviation / b->params.sigma;
    return cairn_exp(CAIRN_REAL(-0.5) * scaled * scaled) - TOLL;
}

static cairn_status step_pairs(cairn_shape_builder *b, cairn_budget *budget)
{
    int32_t n = shape_points(b), first = b->first[b->at];
    shape_arc whole = {0, n, 1, -1, -1};

    for (; b->cursor < n * n; b->cursor++) {
        int32_t low = b->cursor / n, high = b->cursor % n;

        if (!cairn_budget_pay(budget, &b->paid, low == high ? 1 : 4 + n / 16))
            return CAIRN_MORE;
        b->gain[b->cursor] = low == high ? -TOLL : cairn_shape_gain(b, first + low, first + high);
    }
    b->arc_count = 0;
    if (b->at > 0 && b->path_count > 0)
        whole.parent = 0;
    cairn_shape_add_arc(b, whole);
    cairn_shape_walk_begin(b);
    return CAIRN_OK;
}

void cairn_shape_add_arc(cairn_shape_builder *b, shape_arc arc)
{
    int32_t i = b->arc_count;

    if ((cairn_real)arc.count < b->params.min_share * (cairn_real)shape_points(b))
        return;
    if (b->arc_count == CAIRN_SHAPE_PATHS) {
        if (b->arcs[i - 1].count >= arc.count)
            return;
        i--;
    } else {
        b->arc_count++;
    }
    for (; i > 0 && b->arcs[i - 1].count < arc.count; i--)
        b->arcs[i] = b->arcs[i - 1];
    b->arcs[i] = arc;
}

/* The path of the longest arc that waits. */
static cairn_status step_walk(cairn_shape_builder *b, cairn_budget *budget)
{
    while (b->arc_count > 0 && b->path_count < b->params.max_paths) {
        shape_arc arc = b->arcs[0];
        cairn_status status = cairn_shape_walk_step(b, &arc, budget);

        if (status != CAIRN_OK || !cairn_budget_pay(budget, &b->paid, UNITS_A_PATH))
            return CAIRN_MORE;
        memmove(&b->arcs[0], &b->arcs[1], (size_t)(b->arc_count - 1) * sizeof b->arcs[0]);
        b->arc_count--;
        cairn_shape_add_path(b, &arc);
        cairn_shape_walk_begin(b);
    }
    return CAIRN_OK;
}

cairn_status cairn_shape_builder_step(cairn_shape_builder *b, cairn_budget *budget)
{
    if (b == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (b->phase == PAIRS || b->phase == WALK) {
        cairn_status status = b->phase == PAIRS ? step_pairs(b, budget) : step_walk(b, budget);

        if (status != CAIRN_OK)
            return status;
        if (b->phase == WALK)
            b->at++;
        b->phase = b->phase == PAIRS ? WALK : b->at < b->outline_count ? PAIRS : DONE;
        b->cursor = b->phase == PAIRS ? 0 : b->cursor;
    }
    if (b->phase == DONE && b->path_count == 0) {
        b->phase = IDLE;
        return CAIRN_EMPTY;
    }
    return CAIRN_OK;
}

cairn_shape_model cairn_shape_builder_read(const cairn_shape_builder *b)
{
    cairn_shape_model model;

    memset(&model, 0, sizeof model);
    if (b == NULL || b->phase != DONE)
        return model;
    model.samples = b->samples;
    model.paths = b->paths;
    model.outline = b->outline;
    model.sample_count = b->sample_count;
    model.path_count = b->path_count;
    model.outline_count = b->first[b->outline_count];
    model.size = b->size;
    model.origin = b->origin;
    return model;
}

/* ---- Models from elsewhere ---- */

static int is_share(cairn_real x)
{
    return x >= 0 && x <= 1;
}

/* 0 also when it is not finite. */
static int is_oriented(cairn_oriented_point p)
{
    return cairn_is_finite(p.position.x) && cairn_is_finite(p.position.y) &&
           cairn_abs(cairn_vec2_norm(p.direction) - 1) <= CAIRN_REAL(1e-3);
}

static cairn_status check_sample(const cairn_shape_sample *s, int64_t index, cairn_fault *fault)
{
    if (!cairn_is_finite(s->centre.x) || !cairn_is_finite(s->centre.y) ||
        !cairn_is_finite(s->radius) || !cairn_is_finite(s->deviation))
        return cairn_refuse(fault, index, "a sample that is not finite, expected finite ones",
                            CAIRN_NOT_FINITE);
    if (!(s->radius > 0) || s->deviation < 0 || !is_share(s->share[0]) || !is_share(s->share[1]))
        return cairn_refuse(
            fault, index, "a sample out of range, expected a radius above 0 and shares from 0 to 1",
            CAIRN_BAD_ARGUMENT);
    if (!is_oriented(s->side[0]) || !is_oriented(s->side[1]))
        return cairn_refuse(
            fault, index,
            "a side out of range, expected a finite place and a direction of length 1",
            CAIRN_BAD_ARGUMENT);
    return CAIRN_OK;
}

static cairn_status check_path(const cairn_shape_model *m, int32_t index, cairn_fault *fault)
{
    const cairn_shape_path *p = &m->paths[index];

    if (p->first < 0 || p->count < 1 || p->first > m->sample_count ||
        p->count > m->sample_count - p->first)
        return cairn_refuse(fault, index,
                            "a path beyond the samples, expected at least one of them",
                            CAIRN_BAD_ARGUMENT);
    if (p->parent < -1 || p->parent >= index || (p->parent < 0) != (p->branch < 0) ||
        (p->parent >= 0 && p->branch >= m->paths[p->parent].count) || !is_share(p->share))
        return cairn_refuse(
            fault, index, "a path that branches off nowhere, expected a sample of a path before it",
            CAIRN_BAD_ARGUMENT);
    return CAIRN_OK;
}

static int are_gaps(const cairn_shape_model *m)
{
    int32_t good = m->gap_count >= 0 && m->gap_count <= CAIRN_SHAPE_GAPS;

    for (int32_t i = 0; good && i < m->gap_count; i++)
        good = cairn_is_finite(m->gaps[i].x) && cairn_is_finite(m->gaps[i].y);
    return good;
}

cairn_status cairn_shape_model_check(const cairn_shape_model *m, cairn_fault *fault)
{
    cairn_status status = CAIRN_OK;

    if (m == NULL || m->samples == NULL || m->paths == NULL || m->outline == NULL ||
        m->sample_count < 1 || m->path_count < 1 || m->path_count > CAIRN_SHAPE_PATHS ||
        m->outline_count < 1 || !(m->size > 0) || !cairn_is_finite(m->size) ||
        !cairn_is_finite(m->origin.x) || !cairn_is_finite(m->origin.y))
        return cairn_refuse(fault, -1, "no model, expected a size, paths, samples and an outline",
                            CAIRN_BAD_ARGUMENT);
    if (!are_gaps(m))
        return cairn_refuse(fault, -1, "gaps out of range, expected at most 8 finite places",
                            CAIRN_BAD_ARGUMENT);
    for (int32_t i = 0; i < m->sample_count && status == CAIRN_OK; i++)
        status = check_sample(&m->samples[i], i, fault);
    for (int32_t i = 0; i < m->path_count && status == CAIRN_OK; i++)
        status = check_path(m, i, fault);
    for (int32_t i = 0; i < m->outline_count && status == CAIRN_OK; i++)
        if (!is_oriented(m->outline[i]))
            status = cairn_refuse(
                fault, i, "an outline out of range, expected finite places and unit directions",
                CAIRN_BAD_ARGUMENT);
    return status;
}

int32_t cairn_shape_first_outline(const cairn_shape_model *m)
{
    cairn_real mean = 0;
    int32_t count = m->outline_count > 0;

    for (int32_t i = 1; i < m->outline_count; i++)
        mean +=
            cairn_vec2_norm(cairn_vec2_sub(m->outline[i].position, m->outline[i - 1].position)) /
            (cairn_real)m->outline_count;
    while (count < m->outline_count &&
           cairn_vec2_norm(cairn_vec2_sub(m->outline[count].position,
                                          m->outline[count - 1].position)) <= APART * mean)
        count++;
    return count;
}
