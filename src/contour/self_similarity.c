/* Axes of self-similarity.
 *
 * Method: the outline is sampled evenly. Every sample is described by its inner distances to all
 * samples, in both senses of rotation; two samples are alike when what one sees ahead the other
 * sees behind. Arcs between two cuts are compared by warping the one, walked forward, onto the
 * other, walked backward; as written by the sum along the warp, by default divided by its length,
 * so that long and short arcs compare. Cuts are sought on all levels of the discrete curve
 * evolution, whose vertices are samples.
 *
 * Layout: samples, the square of differences, two rows of a warp, cuts, axes; the inner distances
 * and the evolution own theirs.
 *
 * Limits: one outline: other parts of an object are not looked at. Holes that are small against the
 * spacing of samples, and more of them than fit, are taken for filled.
 *
 * Source: Adluru 2008, chapter 4 (eq. 4.2 to 4.4); eq. 4.3 is read as aligned with 4.2: both
 * begin at the point itself. */
#include "src/core/build.h"

#include <string.h>

#include "src/contour/self_similarity_work.h"

enum { LEAST_POINTS = 16, MOST_POINTS = 512, LEAST_HOLE = 4, LEAST_VERTICES = 4 };
/* Both ends of an axis, in both arcs. */
enum { FLAT_ENDS = 4 };
/* Units: distances compared. */
enum { DISTANCES_A_UNIT = 24, UNITS_AN_AXIS = 4 };

cairn_self_similarity_params cairn_self_similarity_default(void)
{
    cairn_self_similarity_params params = {
        .mode = CAIRN_MODE_DEFAULT,
        .points = 96,
        .hole_points = 48,
        .least_vertices = 5,
        .most_vertices = 20,
        .tie = CAIRN_REAL(0.01),
        .tie_floor = CAIRN_REAL(0.001),
        .separation = CAIRN_REAL(0.05),
    };
    return params;
}

cairn_self_similarity_params cairn_self_similarity_as_written(void)
{
    cairn_self_similarity_params params = cairn_self_similarity_default();

    params.mode = CAIRN_MODE_AS_WRITTEN;
    return params;
}

static int params_are_valid(const cairn_self_similarity_params *p)
{
    return p != NULL && (p->mode == CAIRN_MODE_DEFAULT || p->mode == CAIRN_MODE_AS_WRITTEN) &&
           p->points >= LEAST_POINTS && p->points <= MOST_POINTS &&
           (p->hole_points == 0 ||
            (p->hole_points >= LEAST_HOLE && p->hole_points <= MOST_POINTS)) &&
           p->least_vertices >= LEAST_VERTICES && p->most_vertices >= p->least_vertices &&
           p->most_vertices <= SIMILARITY_VERTICES && p->most_vertices <= p->points &&
           p->tie >= 0 && cairn_is_finite(p->tie) && p->tie_floor >= 0 &&
           cairn_is_finite(p->tie_floor) && p->separation > 0 && p->separation <= CAIRN_REAL(0.25);
}

static cairn_inner_distance_params inner_params(const cairn_self_similarity_params *p)
{
    cairn_inner_distance_params inner = {p->points + p->hole_points, p->hole_points == 0};

    return inner;
}

static cairn_self_similarity *carve(cairn_pool *pool, const cairn_self_similarity_params *p)
{
    size_t n = (size_t)p->points;
    cairn_self_similarity *s = cairn_pool_take_one(pool, sizeof *s);
    cairn_vec2 *samples = cairn_pool_take(pool, n + (size_t)p->hole_points, sizeof *samples);
    cairn_vec2 *next = cairn_pool_take(pool, n + (size_t)p->hole_points, sizeof *next);
    cairn_vec2 *smooth = cairn_pool_take(pool, n, sizeof *smooth);
    cairn_vec2 *flat_holes = cairn_pool_take(pool, (size_t)p->hole_points, sizeof *flat_holes);
    cairn_vec2 *flat = cairn_pool_take(pool, 3 * (n + FLAT_ENDS), sizeof *flat);
    cairn_real *unlike = cairn_pool_take(pool, n * n, sizeof *unlike);
    cairn_real *sum = cairn_pool_take(pool, 2 * n, sizeof *sum);
    cairn_real *residual = cairn_pool_take(pool, (1 + SIMILARITY_VARIABLES) * n, sizeof *residual);
    int32_t *steps = cairn_pool_take(pool, 2 * n, sizeof *steps);
    int32_t *walk = cairn_pool_take(pool, n, sizeof *walk);
    int32_t *near = cairn_pool_take(pool, 2 * n, sizeof *near);

    if (s != NULL) {
        memset(s, 0, sizeof *s);
        s->samples = samples;
        s->next = next;
        s->smooth = smooth;
        s->nudged = flat;
        s->flat_holes = flat_holes;
        s->trial[0].room = flat + (n + FLAT_ENDS);
        s->trial[1].room = flat + 2 * (n + FLAT_ENDS);
        s->trial[0].near = near;
        s->trial[1].near = near + n;
        s->unlike = unlike;
        s->sum = sum;
        s->residual = residual;
        s->steps = steps;
        s->walk = walk;
    }
    return s;
}

size_t cairn_self_similarity_memory(const cairn_self_similarity_params *params)
{
    cairn_curve_evolution_params evolution;
    cairn_inner_distance_params inner;
    cairn_pool counting;

    if (!params_are_valid(params))
        return 0;
    inner = inner_params(params);
    evolution.max_points = params->points;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    cairn_pool_count(&counting, cairn_inner_distance_memory(&inner));
    cairn_pool_count(&counting, cairn_curve_evolution_memory(&evolution));
    return cairn_pool_counted(&counting);
}

cairn_status cairn_self_similarity_create(cairn_self_similarity **similarity, cairn_pool *pool,
                                          const cairn_self_similarity_params *params)
{
    size_t need = cairn_self_similarity_memory(params);
    cairn_curve_evolution_params evolution;
    cairn_inner_distance_params inner;
    cairn_self_similarity *made;
    cairn_status status;

    if (similarity == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    inner = inner_params(params);
    evolution.max_points = params->points;
    made = carve(pool, params);
    made->params = *params;
    status = cairn_inner_distance_create(&made->inner, pool, &inner);
    CAIRN_ASSERT(status == CAIRN_OK);
    status = cairn_curve_evolution_create(&made->evolution, pool, &evolution);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    *similarity = made;
    return CAIRN_OK;
}

/* ---- The outlines ---- */

static cairn_status check_outlines(const cairn_curve *outlines, int32_t count)
{
    for (int32_t i = 0; i < count; i++) {
        const cairn_curve *c = &outlines[i];
        cairn_real length;

        if (c->points == NULL || c->count < 3 || !c->closed)
            return CAIRN_BAD_ARGUMENT;
        for (int32_t k = 0; k < c->count; k++)
            if (!cairn_is_finite(c->points[k].x) || !cairn_is_finite(c->points[k].y))
                return CAIRN_NOT_FINITE;
        length = cairn_curve_length(c);
        if (!cairn_is_finite(length * length))
            return CAIRN_NOT_FINITE;
    }
    return CAIRN_OK;
}

/* Samples the holes as densely as the outline, or as there is room; those that come out without
 * area are left out. */
static int32_t sample_holes(cairn_self_similarity *s, const cairn_curve *outlines, int32_t count,
                            cairn_curve *sampled)
{
    int32_t n = s->params.points, most = s->params.hole_points, taken = 1;
    cairn_real spacing = cairn_curve_length(&outlines[0]) / (cairn_real)n, all = 0, room, dense;
    cairn_vec2 *to = s->next + n;

    count = count - 1 > most / LEAST_HOLE ? 1 + most / LEAST_HOLE : count;
    for (int32_t i = 1; i < count; i++)
        all += cairn_curve_length(&outlines[i]);
    room = (cairn_real)(most - (count - 1) * LEAST_HOLE);
    dense = all > room * spacing ? room / all : 1 / spacing;
    for (int32_t i = 1; i < count; i++) {
        int32_t points =
            LEAST_HOLE + cairn_real_to_int(cairn_floor(dense * cairn_curve_length(&outlines[i])));
        cairn_curve hole = {to, points, 1};

        if (cairn_curve_resample(&outlines[i], to, NULL, points) == CAIRN_OK &&
            cairn_abs(cairn_polygon_area(to, points)) > 0) {
            sampled[taken++] = hole;
            to += points;
        }
    }
    return taken;
}

cairn_status cairn_self_similarity_begin(cairn_self_similarity *s, const cairn_curve *outlines,
                                         int32_t count)
{
    cairn_curve sampled[CAIRN_SYMMETRY_OUTLINES];
    cairn_vec2 *to_swap;
    int32_t holes = 1;
    cairn_status status;

    if (s == NULL || outlines == NULL || count < 1)
        return CAIRN_BAD_ARGUMENT;
    if (count > CAIRN_SYMMETRY_OUTLINES)
        return CAIRN_FULL;
    status = check_outlines(outlines, count);
    if (status != CAIRN_OK)
        return status;
    sampled[0].points = s->next;
    sampled[0].count = s->params.points;
    sampled[0].closed = 1;
    status = cairn_curve_resample(&outlines[0], s->next, NULL, s->params.points);
    if (status == CAIRN_OK)
        holes = sample_holes(s, outlines, count, sampled);
    if (status == CAIRN_OK)
        status = cairn_inner_distance_begin(s->inner, sampled, holes);
    if (status == CAIRN_OK)
        status = cairn_curve_evolution_begin(s->evolution, s->next, s->params.points);
    if (status != CAIRN_OK)
        return status;
    to_swap = s->samples;
    s->samples = s->next;
    s->next = to_swap;
    s->holes = holes - 1;
    for (int32_t i = 0; i < s->holes; i++)
        s->hole_count[i] = sampled[i + 1].count;
    s->i = s->k = s->paid = 0;
    s->axis_count = s->ties = 0;
    s->comparisons = 0;
    s->phase = SIMILARITY_INNER;
    return CAIRN_OK;
}

/* ---- How unlike samples are ---- */

/* Eq. 4.4, as a root of the mean square in units of the greatest distance. */
static cairn_real compare(const cairn_inner_distance_result *inner, int32_t i, int32_t k)
{
    const cairn_real *ahead = &inner->distance[i * inner->stride],
                     *behind = &inner->distance[k * inner->stride];
    int32_t n = inner->count, to = i, back = k;
    cairn_real sum = 0;

    for (int32_t m = 0; m < n; m++) {
        cairn_real d = ahead[to] - behind[back];

        sum += d * d;
        to = to + 1 < n ? to + 1 : 0;
        back = back > 0 ? back - 1 : n - 1;
    }
    return cairn_sqrt(sum / (cairn_real)n) / inner->greatest;
}

static cairn_status step_compare(cairn_self_similarity *s, cairn_budget *budget)
{
    cairn_inner_distance_result inner = cairn_inner_distance_read(s->inner);
    int32_t n = s->params.points;

    for (; s->i < n; s->i++, s->k = 0)
        for (; s->k <= s->i; s->k++) {
            if (!cairn_budget_pay(budget, &s->paid, 1 + n / DISTANCES_A_UNIT))
                return CAIRN_MORE;
            s->unlike[s->i * n + s->k] = s->unlike[s->k * n + s->i] = compare(&inner, s->i, s->k);
        }
    return CAIRN_OK;
}

/* ---- Cuts that are kept ---- */

static cairn_real apart(cairn_real a, cairn_real b, cairn_real round)
{
    cairn_real d = cairn_abs(a - b);

    return cairn_min(d, round - d);
}

static int are_near(const cairn_self_similarity *s, const similarity_cut *a,
                    const similarity_cut *b)
{
    cairn_real n = (cairn_real)s->params.points, near = s->params.separation * n;

    return (apart(a->place[0], b->place[0], n) < near &&
            apart(a->place[1], b->place[1], n) < near) ||
           (apart(a->place[0], b->place[1], n) < near && apart(a->place[1], b->place[0], n) < near);
}

void cairn_similarity_offer(const cairn_self_similarity *s, similarity_list *list,
                            const similarity_cut *cut)
{
    int32_t kept = 0, at;

    for (int32_t i = 0; i < list->count && list->cuts[i].cost <= cut->cost; i++)
        if (are_near(s, &list->cuts[i], cut))
            return;
    for (int32_t i = 0; i < list->count; i++)
        if (list->cuts[i].cost <= cut->cost || !are_near(s, &list->cuts[i], cut))
            list->cuts[kept++] = list->cuts[i];
    list->count = kept;
    if (kept == SIMILARITY_KEPT) {
        if (list->cuts[kept - 1].cost <= cut->cost)
            return;
        list->count--;
    }
    for (at = list->count; at > 0 && list->cuts[at - 1].cost > cut->cost; at--)
        list->cuts[at] = list->cuts[at - 1];
    list->cuts[at] = *cut;
    list->count++;
}

/* ---- The verdict ---- */

cairn_vec2 cairn_similarity_point(const cairn_self_similarity *s, const cairn_vec2 *samples,
                                  cairn_real place)
{
    int32_t n = s->params.points, i = cairn_real_to_int(cairn_floor(place));
    cairn_vec2 a = samples[i % n], b = samples[(i + 1) % n];

    return cairn_vec2_add(a, cairn_vec2_scale(cairn_vec2_sub(b, a), place - (cairn_real)i));
}

static cairn_symmetry_axis axis_of(const cairn_self_similarity *s, const similarity_cut *cut)
{
    cairn_real n = (cairn_real)s->params.points;
    cairn_symmetry_axis axis;

    for (int32_t i = 0; i < 2; i++) {
        axis.end[i] = cairn_similarity_point(s, s->samples, cut->place[i]);
        axis.place[i] = cut->place[i] / n;
        axis.arc[i].from = cut->from[i] / n;
        axis.arc[i].to = cut->to[i] / n;
    }
    axis.dissimilarity = cut->cost;
    axis.misfit = cut->misfit;
    axis.warp = cut->warp;
    axis.bend = cut->bend;
    axis.skew = cut->skew;
    axis.mirror_point = cairn_vec2_scale(cairn_vec2_add(axis.end[0], axis.end[1]), CAIRN_REAL(0.5));
    axis.mirror_along = cairn_vec2_unit(cairn_vec2_sub(axis.end[1], axis.end[0]));
    axis.vertices = cut->vertices;
    axis.division = cut->division;
    return axis;
}

/* An axis a time, then the verdict. */
static cairn_status step_judge(cairn_self_similarity *s, cairn_budget *budget)
{
    int32_t fits = s->params.mode != CAIRN_MODE_AS_WRITTEN, count = s->list.count;
    int32_t units = UNITS_AN_AXIS + (fits ? cairn_similarity_mirror_units(s) : 0);
    cairn_real good;

    for (; s->i < count && s->i < CAIRN_SYMMETRY_AXES; s->i++) {
        if (!cairn_budget_pay(budget, &s->paid, units))
            return CAIRN_MORE;
        s->axes[s->i] = axis_of(s, &s->list.cuts[s->i]);
        if (fits)
            cairn_similarity_mirror(s, &s->list.cuts[s->i], &s->axes[s->i]);
        good = s->axes[0].dissimilarity * (1 + s->params.tie) + s->params.tie_floor;
        s->ties += s->axes[s->i].dissimilarity <= good;
        s->axis_count = s->i + 1;
    }
    s->verdict = s->ties < 2         ? CAIRN_SYMMETRY_ONE
                 : s->rotations == 0 ? CAIRN_SYMMETRY_ROUND
                                     : CAIRN_SYMMETRY_MANY;
    return CAIRN_OK;
}

/* ---- All of it ---- */

/* What comes behind a phase: as written, nothing of the ranking; where no joints moved, nothing
 * of the nearby warps. */
static similarity_phase phase_after(const cairn_self_similarity *s)
{
    if (s->phase == SIMILARITY_SPLIT && s->params.mode == CAIRN_MODE_AS_WRITTEN)
        return SIMILARITY_TURN;
    if (s->phase == SIMILARITY_FIT && !(s->jointed > 0))
        return SIMILARITY_TURN;
    return s->phase + 1;
}

static void begin_phase(cairn_self_similarity *s, similarity_phase phase)
{
    s->phase = phase;
    s->i = s->k = 0;
    switch (phase) {
    case SIMILARITY_SPLIT:
        cairn_similarity_split_begin(s);
        break;
    case SIMILARITY_SCAN:
        cairn_similarity_scan_begin(s);
        break;
    case SIMILARITY_FIT:
        cairn_similarity_fits_begin(s);
        break;
    case SIMILARITY_SCAN_NEAR:
        cairn_similarity_scan_near_begin(s);
        break;
    case SIMILARITY_BLEND:
        cairn_similarity_blend_begin(s);
        break;
    case SIMILARITY_TURN:
        cairn_similarity_turn_begin(s);
        break;
    default:
        break;
    }
}

static cairn_status step_phase(cairn_self_similarity *s, cairn_budget *budget)
{
    switch (s->phase) {
    case SIMILARITY_INNER:
        return cairn_inner_distance_step(s->inner, budget);
    case SIMILARITY_EVOLVE:
        return cairn_curve_evolution_step(s->evolution, budget);
    case SIMILARITY_COMPARE:
        return step_compare(s, budget);
    case SIMILARITY_SPLIT:
        return cairn_similarity_split_step(s, budget);
    case SIMILARITY_SCAN:
        return cairn_similarity_scan_step(s, budget);
    case SIMILARITY_FIT:
        return cairn_similarity_fits_step(s, budget);
    case SIMILARITY_COMPARE_NEAR:
        return cairn_similarity_near_step(s, budget);
    case SIMILARITY_SLIDE:
        return cairn_similarity_slide_step(s, budget);
    case SIMILARITY_SCAN_NEAR:
        return cairn_similarity_scan_near_step(s, budget);
    case SIMILARITY_BLEND:
        return cairn_similarity_blend_step(s, budget);
    case SIMILARITY_TURN:
        return cairn_similarity_turn_step(s, budget);
    default:
        return step_judge(s, budget);
    }
}

cairn_status cairn_self_similarity_step(cairn_self_similarity *s, cairn_budget *budget)
{
    if (s == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (s->phase != SIMILARITY_IDLE && s->phase != SIMILARITY_DONE) {
        cairn_status status = step_phase(s, budget);

        if (status != CAIRN_OK)
            return status;
        begin_phase(s, phase_after(s));
    }
    return CAIRN_OK;
}

cairn_self_similarity_result cairn_self_similarity_read(const cairn_self_similarity *s)
{
    cairn_self_similarity_result result;

    memset(&result, 0, sizeof result);
    if (s == NULL || s->phase != SIMILARITY_DONE)
        return result;
    result.axes = s->axes;
    result.count = s->axis_count;
    result.ties = s->ties;
    result.verdict = s->verdict;
    result.rotations = s->rotations;
    result.samples = s->samples;
    result.sample_count = s->params.points;
    result.comparisons = s->comparisons;
    return result;
}
