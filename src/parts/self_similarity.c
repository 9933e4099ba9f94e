/* Bilateral symmetry detection by self-similarity: interface, descriptors and phases.
 *
 * Method:
 * 1. The outline is sampled evenly. The descriptor of a sample is the cyclic sequence of its inner
 *    distances to all samples, in both orientations. Two samples are similar if the forward
 *    descriptor of one equals the backward descriptor of the other.
 * 2. Dynamic time warping aligns one arc between two cut points, forward, with the other, backward.
 *    The cost is the sum along the warping path; by default it is divided by the path length, so
 *    that long and short arcs compare.
 * 3. Cuts are searched on all levels of the discrete curve evolution, whose vertices are samples.
 * 4. The default mode re-ranks the cuts (self_similarity_rank.c, self_similarity_articulated.c).
 * 5. Non-maximum suppression keeps the local minima (self_similarity_cut.c).
 *
 * Memory layout: samples, the matrix of descriptor distances, two rows of the warping table, cuts,
 * axes. The inner distances and the curve evolution own their memory.
 *
 * Limits: one outline only; disconnected parts of an object are ignored. Holes smaller than the
 * sample spacing, or beyond the capacity, are treated as filled.
 *
 * Source: Adluru 2008, chapter 4 (eq. 4.2 to 4.4); eq. 4.3 is aligned with 4.2: both begin at
 * the point itself. */
#include "src/base/build.h"

#include <string.h>

#include "src/parts/self_similarity_work.h"

enum { MIN_SAMPLES = 16, MAX_SAMPLES = 512, MIN_HOLE_SAMPLES = 4, MIN_VERTICES = 4 };
/* Both ends of an axis, once for each arc. */
enum { FLAT_ENDS = 4 };
/* Distances per work unit; work units per axis. */
enum { DISTANCES_PER_UNIT = 24, UNITS_PER_AXIS = 4 };

#define INTEGER(field, ...)  CAIRN_INTEGER(cairn_self_similarity_params, field, __VA_ARGS__)
#define NUMBER(field, ...)   CAIRN_NUMBER(cairn_self_similarity_params, field, __VA_ARGS__)
#define POSITIVE(field, ...) CAIRN_NUMBER_ABOVE(cairn_self_similarity_params, field, __VA_ARGS__)
/* In use where it is not 0 itself. */
#define INTEGER_OR_0(field, ...)                                                                   \
    CAIRN_INTEGER_IF(cairn_self_similarity_params, field,                                          \
                     CAIRN_WHEN(cairn_self_similarity_params, field), __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(mode, CAIRN_MODE_DEFAULT, CAIRN_MODE_DEFAULT, CAIRN_MODE_AS_WRITTEN),
    INTEGER(outline_samples, 96, MIN_SAMPLES, MAX_SAMPLES),
    INTEGER_OR_0(hole_samples, 48, MIN_HOLE_SAMPLES, MAX_SAMPLES),
    INTEGER(min_vertices, 5, MIN_VERTICES, SELF_SIMILARITY_MAX_VERTICES),
    INTEGER(max_vertices, 20, MIN_VERTICES, SELF_SIMILARITY_MAX_VERTICES),
    NUMBER(tie_ratio, CAIRN_REAL(0.01), 0, CAIRN_REAL_MAX),
    NUMBER(tie_floor, CAIRN_REAL(0.001), 0, CAIRN_REAL_MAX),
    POSITIVE(separation, CAIRN_REAL(0.05), 0, CAIRN_REAL(0.25)),
};
const cairn_parameters cairn_self_similarity_parameters =
    CAIRN_PARAMETERS("self_similarity", cairn_self_similarity_params, rows);

cairn_self_similarity_params cairn_self_similarity_default(void)
{
    cairn_self_similarity_params params;

    cairn_parameters_preset(&cairn_self_similarity_parameters, &params);
    return params;
}

cairn_self_similarity_params cairn_self_similarity_as_written(void)
{
    cairn_self_similarity_params params = cairn_self_similarity_default();

    params.mode = CAIRN_MODE_AS_WRITTEN;
    return params;
}

cairn_status cairn_self_similarity_check(const cairn_self_similarity_params *params,
                                         cairn_object_fault *fault)
{
    cairn_status status = cairn_parameters_check(&cairn_self_similarity_parameters, params, fault);

    if (status == CAIRN_OK)
        status = cairn_parameters_require(params->max_vertices >= params->min_vertices,
                                          "self_similarity", "max_vertices: at least min_vertices",
                                          fault);
    if (status == CAIRN_OK)
        status = cairn_parameters_require(params->max_vertices <= params->outline_samples,
                                          "self_similarity",
                                          "max_vertices: at most outline_samples", fault);
    return status;
}

static cairn_inner_distance_params inner_params(const cairn_self_similarity_params *params)
{
    cairn_inner_distance_params inner = {
        .max_points = params->outline_samples + params->hole_samples,
        .fill_holes = params->hole_samples == 0,
    };

    return inner;
}

static cairn_curve_evolution_params evolution_params(const cairn_self_similarity_params *params)
{
    cairn_curve_evolution_params evolution = cairn_curve_evolution_default();

    evolution.max_points = params->outline_samples;
    evolution.mode = params->mode;
    return evolution;
}

/* The object, its arrays and nested objects; NULL from a counting pool. */
static cairn_self_similarity *build(cairn_pool *pool, const cairn_self_similarity_params *params)
{
    size_t n = (size_t)params->outline_samples, holes = (size_t)params->hole_samples;
    cairn_inner_distance_params inner = inner_params(params);
    cairn_curve_evolution_params evolution = evolution_params(params);
    cairn_self_similarity *similarity = cairn_object_take(pool, sizeof *similarity);

    CAIRN_TAKE(similarity, pool, samples, n + holes);
    CAIRN_TAKE(similarity, pool, next_samples, n + holes);
    CAIRN_TAKE(similarity, pool, smoothed, n);
    CAIRN_TAKE(similarity, pool, axis_holes, holes);
    CAIRN_TAKE(similarity, pool, perturbed, 3 * (n + FLAT_ENDS));
    CAIRN_TAKE(similarity, pool, descriptor_distance, n * n);
    CAIRN_TAKE(similarity, pool, dtw_sum, 2 * n);
    CAIRN_TAKE(similarity, pool, residual, (1 + SELF_SIMILARITY_VARIABLES) * n);
    CAIRN_TAKE(similarity, pool, dtw_length, 2 * n);
    CAIRN_TAKE(similarity, pool, dtw_samples, n);
    CAIRN_TAKE(similarity, pool, trial[0].nearest_segment, 2 * n);
    CAIRN_TAKE_OBJECT(similarity, pool, inner, inner_distance, &inner);
    CAIRN_TAKE_OBJECT(similarity, pool, evolution, curve_evolution, &evolution);
    if (similarity != NULL) {
        similarity->params = *params;
        similarity->trial[0].buffer = similarity->perturbed + (n + FLAT_ENDS);
        similarity->trial[1].buffer = similarity->trial[0].buffer + (n + FLAT_ENDS);
        similarity->trial[1].nearest_segment = similarity->trial[0].nearest_segment + n;
    }
    return similarity;
}

CAIRN_OBJECT(self_similarity, self_similarity, build);

/* ---- Outlines ---- */

/* Validates the outlines. */
static cairn_status check_outlines(const cairn_curve *outlines, int32_t count)
{
    for (int32_t i = 0; i < count; i++) {
        const cairn_curve *c = &outlines[i];
        cairn_real length;

        if (c->points == NULL || c->count < 3 || !c->closed)
            return CAIRN_BAD_ARGUMENT;
        for (int32_t k = 0; k < c->count; k++)
            if (!cairn_vec2_is_finite(c->points[k]))
                return CAIRN_NOT_FINITE;
        length = cairn_curve_length(c);
        if (!cairn_is_finite(length * length))
            return CAIRN_NOT_FINITE;
    }
    return CAIRN_OK;
}

/* Samples the holes as densely as the outline, or as the capacity allows; holes without area are
 * skipped. Returns the number of sampled outlines. */
static int32_t sample_holes(cairn_self_similarity *similarity, const cairn_curve *outlines,
                            int32_t count, cairn_curve *sampled)
{
    int32_t n = similarity->params.outline_samples, most = similarity->params.hole_samples,
            taken = 1;
    cairn_real spacing = cairn_curve_length(&outlines[0]) / (cairn_real)n, all = 0, spare_samples,
               density;
    cairn_vec2 *to = similarity->next_samples + n;

    count = count - 1 > most / MIN_HOLE_SAMPLES ? 1 + most / MIN_HOLE_SAMPLES : count;
    for (int32_t i = 1; i < count; i++)
        all += cairn_curve_length(&outlines[i]);
    spare_samples = (cairn_real)(most - (count - 1) * MIN_HOLE_SAMPLES);
    density = all > spare_samples * spacing ? spare_samples / all : 1 / spacing;
    for (int32_t i = 1; i < count; i++) {
        int32_t points = MIN_HOLE_SAMPLES +
                         cairn_real_to_int(cairn_floor(density * cairn_curve_length(&outlines[i])));
        cairn_curve hole = {to, points, 1};

        if (cairn_curve_resample(&outlines[i], to, NULL, points) == CAIRN_OK &&
            cairn_abs(cairn_polygon_area(to, points)) > 0) {
            sampled[taken++] = hole;
            to += points;
        }
    }
    return taken;
}

cairn_status cairn_self_similarity_begin(cairn_self_similarity *similarity,
                                         const cairn_curve *outlines, int32_t count)
{
    cairn_curve sampled[CAIRN_SELF_SIMILARITY_MAX_OUTLINES];
    cairn_vec2 *to_swap;
    int32_t holes = 1;
    cairn_status status;

    if (similarity == NULL || outlines == NULL || count < 1)
        return CAIRN_BAD_ARGUMENT;
    if (count > CAIRN_SELF_SIMILARITY_MAX_OUTLINES)
        return CAIRN_FULL;
    status = check_outlines(outlines, count);
    if (status != CAIRN_OK)
        return status;
    sampled[0].points = similarity->next_samples;
    sampled[0].count = similarity->params.outline_samples;
    sampled[0].closed = 1;
    status = cairn_curve_resample(&outlines[0], similarity->next_samples, NULL,
                                  similarity->params.outline_samples);
    if (status == CAIRN_OK)
        holes = sample_holes(similarity, outlines, count, sampled);
    if (status == CAIRN_OK)
        status = cairn_inner_distance_begin(similarity->inner, sampled, holes);
    if (status == CAIRN_OK)
        status = cairn_curve_evolution_begin(similarity->evolution, similarity->next_samples,
                                             similarity->params.outline_samples);
    if (status != CAIRN_OK)
        return status;
    to_swap = similarity->samples;
    similarity->samples = similarity->next_samples;
    similarity->next_samples = to_swap;
    similarity->hole_total = holes - 1;
    for (int32_t i = 0; i < similarity->hole_total; i++)
        similarity->hole_count[i] = sampled[i + 1].count;
    similarity->axis_count = similarity->tie_count = 0;
    similarity->comparison_count = 0;
    similarity->resume = similarity->phase_resume = similarity->fit_resume = 0;
    similarity->units_charged = 0;
    similarity->is_pending = 1;
    similarity->is_complete = 0;
    return CAIRN_OK;
}

/* ---- Descriptor distances ---- */

/* Eq. 4.4: root mean square difference of two descriptors, relative to the greatest distance. */
static cairn_real descriptor_difference(const cairn_self_similarity *similarity, int32_t i,
                                        int32_t k)
{
    cairn_inner_distance_result inner = cairn_inner_distance_read(similarity->inner);
    const cairn_real *ahead = inner.distance + (size_t)i * (size_t)inner.stride,
                     *behind = inner.distance + (size_t)k * (size_t)inner.stride;
    int32_t n = inner.count, to = i, back = k;
    cairn_real dtw_sum = 0;

    for (int32_t m = 0; m < n; m++) {
        cairn_real d = ahead[to] - behind[back];

        dtw_sum += d * d;
        to = to + 1 < n ? to + 1 : 0;
        back = back > 0 ? back - 1 : n - 1;
    }
    return cairn_sqrt(dtw_sum / (cairn_real)n) / inner.max_distance;
}

/* Fills the symmetric matrix of descriptor distances. */
static int compare_samples(cairn_self_similarity *similarity, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(similarity->phase_resume);
    for (similarity->first_sample = 0;
         similarity->first_sample < similarity->params.outline_samples; similarity->first_sample++)
        for (similarity->second_sample = 0; similarity->second_sample <= similarity->first_sample;
             similarity->second_sample++) {
            CAIRN_STEP_CHARGE(similarity, phase_resume, budget,
                              1 + similarity->params.outline_samples / DISTANCES_PER_UNIT);
            self_similarity_set_distance(similarity, similarity->first_sample,
                                         similarity->second_sample,
                                         descriptor_difference(similarity, similarity->first_sample,
                                                               similarity->second_sample));
        }
    CAIRN_STEP_END(similarity->phase_resume);
}

/* ---- Result ---- */

/* Returns the reported axis of a cut. */
static cairn_self_similarity_axis axis_of(const cairn_self_similarity *similarity,
                                          const self_similarity_cut *cut)
{
    cairn_real n = (cairn_real)similarity->params.outline_samples;
    cairn_self_similarity_axis axis;

    for (int32_t i = 0; i < 2; i++) {
        axis.end[i] =
            cairn_self_similarity_point(similarity, similarity->samples, cut->position[i]);
        axis.position[i] = cut->position[i] / n;
        axis.arc[i].from = cut->from[i] / n;
        axis.arc[i].to = cut->to[i] / n;
    }
    axis.dissimilarity = cut->cost;
    axis.mirror_residual = cut->mirror_residual;
    axis.dtw_cost = cut->dtw_cost;
    axis.bend = cut->bend;
    axis.skew = cut->skew;
    axis.mirror_point = cairn_vec2_scale(cairn_vec2_add(axis.end[0], axis.end[1]), CAIRN_REAL(0.5));
    axis.mirror_direction = cairn_vec2_unit(cairn_vec2_sub(axis.end[1], axis.end[0]));
    axis.vertices = cut->vertices;
    axis.division = cut->division;
    return axis;
}

/* Cost of an axis of the report in units. */
static int32_t axis_cost(const cairn_self_similarity *similarity)
{
    return UNITS_PER_AXIS + (self_similarity_is_as_written(similarity)
                                 ? 0
                                 : cairn_self_similarity_mirror_cost(similarity));
}

/* Fills in the axis of the i-th cut. */
static void report_axis(cairn_self_similarity *similarity, int32_t i)
{
    const self_similarity_cut *cut = &similarity->list.cuts[i];
    cairn_real good;

    similarity->axes[i] = axis_of(similarity, cut);
    if (!self_similarity_is_as_written(similarity))
        cairn_self_similarity_mirror(similarity, cut, &similarity->axes[i]);
    good = similarity->axes[0].dissimilarity * (1 + similarity->params.tie_ratio) +
           similarity->params.tie_floor;
    similarity->tie_count += similarity->axes[i].dissimilarity <= good;
    similarity->axis_count = i + 1;
}

/* Fills in the axes, then the verdict. */
static int report(cairn_self_similarity *similarity, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(similarity->phase_resume);
    for (similarity->axis = 0; similarity->axis < similarity->list.count &&
                               similarity->axis < CAIRN_SELF_SIMILARITY_MAX_AXES;
         similarity->axis++) {
        CAIRN_STEP_CHARGE(similarity, phase_resume, budget, axis_cost(similarity));
        report_axis(similarity, similarity->axis);
    }
    similarity->verdict = similarity->tie_count < 2         ? CAIRN_SELF_SIMILARITY_SINGLE
                          : similarity->rotation_order == 0 ? CAIRN_SELF_SIMILARITY_CIRCULAR
                                                            : CAIRN_SELF_SIMILARITY_MULTIPLE;
    CAIRN_STEP_END(similarity->phase_resume);
}

/* The detection: see Method in the head of this file. As written there is no re-ranking. */
static int detect(cairn_self_similarity *similarity, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(similarity->resume);
    CAIRN_STEP_UNTIL(similarity->resume,
                     cairn_inner_distance_step(similarity->inner, budget) == CAIRN_OK);
    CAIRN_STEP_UNTIL(similarity->resume,
                     cairn_curve_evolution_step(similarity->evolution, budget) == CAIRN_OK);
    CAIRN_STEP_RUN(similarity, resume, budget, compare_samples);
    CAIRN_STEP_RUN(similarity, resume, budget, cairn_self_similarity_search);
    if (!self_similarity_is_as_written(similarity)) {
        CAIRN_STEP_RUN(similarity, resume, budget, cairn_self_similarity_rank);
        if (similarity->articulation > 0)
            CAIRN_STEP_RUN(similarity, resume, budget, cairn_self_similarity_rank_articulated);
    }
    CAIRN_STEP_RUN(similarity, resume, budget, cairn_self_similarity_rotation);
    CAIRN_STEP_RUN(similarity, resume, budget, report);
    CAIRN_STEP_END(similarity->resume);
}

cairn_status cairn_self_similarity_step(cairn_self_similarity *similarity, cairn_budget *budget)
{
    if (similarity == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (similarity->is_pending && detect(similarity, budget)) {
        similarity->is_pending = 0;
        similarity->is_complete = 1;
    }
    return similarity->is_pending ? CAIRN_MORE : CAIRN_OK;
}

cairn_self_similarity_result cairn_self_similarity_read(const cairn_self_similarity *similarity)
{
    cairn_self_similarity_result result;

    memset(&result, 0, sizeof result);
    if (similarity == NULL || !similarity->is_complete)
        return result;
    result.axes = similarity->axes;
    result.count = similarity->axis_count;
    result.tie_count = similarity->tie_count;
    result.verdict = similarity->verdict;
    result.rotation_order = similarity->rotation_order;
    result.samples = similarity->samples;
    result.sample_count = similarity->params.outline_samples;
    result.comparison_count = similarity->comparison_count;
    return result;
}
