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
 * 5. Non-maximum suppression keeps the local minima.
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

#include "src/containers/ranked_list.h"
#include "src/parts/self_similarity_work.h"

enum { MIN_SAMPLES = 16, MAX_SAMPLES = 512, MIN_HOLE_SAMPLES = 4, MIN_VERTICES = 4 };
/* Both ends of an axis, once for each arc. */
enum { FLAT_ENDS = 4 };
/* Distances per work unit; work units per axis. */
enum { DISTANCES_PER_UNIT = 24, UNITS_PER_AXIS = 4 };

cairn_self_similarity_params cairn_self_similarity_default(void)
{
    cairn_self_similarity_params params = {
        .mode = CAIRN_MODE_DEFAULT,
        .outline_samples = 96,
        .hole_samples = 48,
        .min_vertices = 5,
        .max_vertices = 20,
        .tie_ratio = CAIRN_REAL(0.01),
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

static int params_are_valid(const cairn_self_similarity_params *params)
{
    return params != NULL &&
           (params->mode == CAIRN_MODE_DEFAULT || params->mode == CAIRN_MODE_AS_WRITTEN) &&
           params->outline_samples >= MIN_SAMPLES && params->outline_samples <= MAX_SAMPLES &&
           (params->hole_samples == 0 ||
            (params->hole_samples >= MIN_HOLE_SAMPLES && params->hole_samples <= MAX_SAMPLES)) &&
           params->min_vertices >= MIN_VERTICES && params->max_vertices >= params->min_vertices &&
           params->max_vertices <= SELF_SIMILARITY_MAX_VERTICES &&
           params->max_vertices <= params->outline_samples && params->tie_ratio >= 0 &&
           cairn_is_finite(params->tie_ratio) && params->tie_floor >= 0 &&
           cairn_is_finite(params->tie_floor) && params->separation > 0 &&
           params->separation <= CAIRN_REAL(0.25);
}

static cairn_inner_distance_params inner_params(const cairn_self_similarity_params *params)
{
    cairn_inner_distance_params inner = {
        .max_points = params->outline_samples + params->hole_samples,
        .fill_holes = params->hole_samples == 0,
    };

    return inner;
}

static cairn_self_similarity *carve(cairn_pool *pool, const cairn_self_similarity_params *params)
{
    size_t n = (size_t)params->outline_samples;
    cairn_self_similarity *similarity = cairn_pool_take_one(pool, sizeof *similarity);
    cairn_vec2 *samples = cairn_pool_take(pool, n + (size_t)params->hole_samples, sizeof *samples);
    cairn_vec2 *next = cairn_pool_take(pool, n + (size_t)params->hole_samples, sizeof *next);
    cairn_vec2 *smooth = cairn_pool_take(pool, n, sizeof *smooth);
    cairn_vec2 *flat_holes =
        cairn_pool_take(pool, (size_t)params->hole_samples, sizeof *flat_holes);
    cairn_vec2 *flat = cairn_pool_take(pool, 3 * (n + FLAT_ENDS), sizeof *flat);
    cairn_real *descriptor_distance = cairn_pool_take(pool, n * n, sizeof *descriptor_distance);
    cairn_real *dtw_sum = cairn_pool_take(pool, 2 * n, sizeof *dtw_sum);
    cairn_real *residual =
        cairn_pool_take(pool, (1 + SELF_SIMILARITY_VARIABLES) * n, sizeof *residual);
    int32_t *dtw_length = cairn_pool_take(pool, 2 * n, sizeof *dtw_length);
    int32_t *dtw_samples = cairn_pool_take(pool, n, sizeof *dtw_samples);
    int32_t *nearby = cairn_pool_take(pool, 2 * n, sizeof *nearby);

    if (similarity != NULL) {
        memset(similarity, 0, sizeof *similarity);
        similarity->samples = samples;
        similarity->next_samples = next;
        similarity->smoothed = smooth;
        similarity->perturbed = flat;
        similarity->axis_holes = flat_holes;
        similarity->trial[0].buffer = flat + (n + FLAT_ENDS);
        similarity->trial[1].buffer = flat + 2 * (n + FLAT_ENDS);
        similarity->trial[0].nearest_segment = nearby;
        similarity->trial[1].nearest_segment = nearby + n;
        similarity->descriptor_distance = descriptor_distance;
        similarity->dtw_sum = dtw_sum;
        similarity->residual = residual;
        similarity->dtw_length = dtw_length;
        similarity->dtw_samples = dtw_samples;
    }
    return similarity;
}

static cairn_curve_evolution_params evolution_params(const cairn_self_similarity_params *params)
{
    cairn_curve_evolution_params evolution = cairn_curve_evolution_default();

    evolution.max_points = params->outline_samples;
    evolution.mode = params->mode;
    return evolution;
}

size_t cairn_self_similarity_memory(const cairn_self_similarity_params *params)
{
    cairn_curve_evolution_params evolution;
    cairn_inner_distance_params inner;
    cairn_pool counting;

    if (!params_are_valid(params))
        return 0;
    inner = inner_params(params);
    evolution = evolution_params(params);
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
    if (!cairn_pool_has_capacity(pool, need))
        return CAIRN_NO_MEMORY;
    inner = inner_params(params);
    evolution = evolution_params(params);
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
    similarity->cursor = similarity->inner_cursor = similarity->units_charged = 0;
    similarity->axis_count = similarity->tie_count = 0;
    similarity->comparison_count = 0;
    similarity->phase = SELF_SIMILARITY_INNER;
    return CAIRN_OK;
}

/* ---- Descriptor distances ---- */

/* Eq. 4.4: root mean square difference of two descriptors, relative to the greatest distance. */
static cairn_real descriptor_difference(const cairn_inner_distance_result *inner, int32_t i,
                                        int32_t k)
{
    const cairn_real *ahead = &inner->distance[i * inner->stride],
                     *behind = &inner->distance[k * inner->stride];
    int32_t n = inner->count, to = i, back = k;
    cairn_real dtw_sum = 0;

    for (int32_t m = 0; m < n; m++) {
        cairn_real d = ahead[to] - behind[back];

        dtw_sum += d * d;
        to = to + 1 < n ? to + 1 : 0;
        back = back > 0 ? back - 1 : n - 1;
    }
    return cairn_sqrt(dtw_sum / (cairn_real)n) / inner->max_distance;
}

/* Fills the symmetric matrix of descriptor distances. */
static cairn_status step_compare(cairn_self_similarity *similarity, cairn_budget *budget)
{
    cairn_inner_distance_result inner = cairn_inner_distance_read(similarity->inner);
    int32_t n = similarity->params.outline_samples;

    for (; similarity->cursor < n; similarity->cursor++, similarity->inner_cursor = 0)
        for (; similarity->inner_cursor <= similarity->cursor; similarity->inner_cursor++) {
            if (!cairn_budget_charge(budget, &similarity->units_charged,
                                     1 + n / DISTANCES_PER_UNIT))
                return CAIRN_MORE;
            similarity->descriptor_distance[similarity->cursor * n + similarity->inner_cursor] =
                similarity->descriptor_distance[similarity->inner_cursor * n + similarity->cursor] =
                    descriptor_difference(&inner, similarity->cursor, similarity->inner_cursor);
        }
    return CAIRN_OK;
}

/* ---- Non-maximum suppression ---- */

/* Returns the distance of two positions along a closed outline. */
static cairn_real cyclic_distance(cairn_real a, cairn_real b, cairn_real round)
{
    cairn_real d = cairn_abs(a - b);

    return cairn_min(d, round - d);
}

/* Returns whether both ends of two cuts are closer than the non-maximum-suppression radius. */
static int are_within_radius(const void *context, const void *entry, const void *other)
{
    const cairn_self_similarity *similarity = context;
    const self_similarity_cut *a = other, *b = entry;
    cairn_real n = (cairn_real)similarity->params.outline_samples,
               nearby = similarity->params.separation * n;

    return (cyclic_distance(a->position[0], b->position[0], n) < nearby &&
            cyclic_distance(a->position[1], b->position[1], n) < nearby) ||
           (cyclic_distance(a->position[0], b->position[1], n) < nearby &&
            cyclic_distance(a->position[1], b->position[0], n) < nearby);
}

void cairn_self_similarity_insert(const cairn_self_similarity *similarity,
                                  self_similarity_list *list, const self_similarity_cut *cut)
{
    ranked_list cuts = {.entries = list->cuts,
                        .count = &list->count,
                        .capacity = SELF_SIMILARITY_MAX_CUTS,
                        .entry_bytes = sizeof *cut,
                        .score_at = offsetof(self_similarity_cut, cost),
                        .least_first = 1,
                        .is_near = are_within_radius,
                        .context = similarity};

    (void)ranked_list_insert(&cuts, cut);
}

/* ---- Result ---- */

cairn_vec2 cairn_self_similarity_point(const cairn_self_similarity *similarity,
                                       const cairn_vec2 *samples, cairn_real position)
{
    int32_t n = similarity->params.outline_samples, i = cairn_real_to_int(cairn_floor(position));
    cairn_vec2 a = samples[i % n], b = samples[(i + 1) % n];

    return cairn_vec2_interpolate(a, b, position - (cairn_real)i);
}

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

/* Fills in one axis per work item, then the verdict. */
static cairn_status step_report(cairn_self_similarity *similarity, cairn_budget *budget)
{
    int32_t fits = similarity->params.mode != CAIRN_MODE_AS_WRITTEN, count = similarity->list.count;
    int32_t units = UNITS_PER_AXIS + (fits ? cairn_self_similarity_mirror_cost(similarity) : 0);
    cairn_real good;

    for (; similarity->cursor < count && similarity->cursor < CAIRN_SELF_SIMILARITY_MAX_AXES;
         similarity->cursor++) {
        if (!cairn_budget_charge(budget, &similarity->units_charged, units))
            return CAIRN_MORE;
        similarity->axes[similarity->cursor] =
            axis_of(similarity, &similarity->list.cuts[similarity->cursor]);
        if (fits)
            cairn_self_similarity_mirror(similarity, &similarity->list.cuts[similarity->cursor],
                                         &similarity->axes[similarity->cursor]);
        good = similarity->axes[0].dissimilarity * (1 + similarity->params.tie_ratio) +
               similarity->params.tie_floor;
        similarity->tie_count += similarity->axes[similarity->cursor].dissimilarity <= good;
        similarity->axis_count = similarity->cursor + 1;
    }
    similarity->verdict = similarity->tie_count < 2         ? CAIRN_SELF_SIMILARITY_SINGLE
                          : similarity->rotation_order == 0 ? CAIRN_SELF_SIMILARITY_CIRCULAR
                                                            : CAIRN_SELF_SIMILARITY_MULTIPLE;
    return CAIRN_OK;
}

/* ---- Phases ---- */

/* Returns the next phase. As written there is no re-ranking. Without articulation the local
 * alignment is skipped. */
static self_similarity_phase phase_after(const cairn_self_similarity *similarity)
{
    if (similarity->phase == SELF_SIMILARITY_SEARCH &&
        similarity->params.mode == CAIRN_MODE_AS_WRITTEN)
        return SELF_SIMILARITY_ROTATION;
    if (similarity->phase == SELF_SIMILARITY_FIT && !(similarity->articulation > 0))
        return SELF_SIMILARITY_ROTATION;
    return similarity->phase + 1;
}

static void begin_phase(cairn_self_similarity *similarity, self_similarity_phase phase)
{
    similarity->phase = phase;
    similarity->cursor = similarity->inner_cursor = 0;
    switch (phase) {
    case SELF_SIMILARITY_SEARCH:
        cairn_self_similarity_search_begin(similarity);
        break;
    case SELF_SIMILARITY_SCAN:
        cairn_self_similarity_scan_begin(similarity);
        break;
    case SELF_SIMILARITY_FIT:
        cairn_self_similarity_fits_begin(similarity);
        break;
    case SELF_SIMILARITY_SCAN_LOCAL:
        cairn_self_similarity_scan_local_begin(similarity);
        break;
    case SELF_SIMILARITY_FINAL_FIT:
        cairn_self_similarity_final_fit_begin(similarity);
        break;
    case SELF_SIMILARITY_ROTATION:
        cairn_self_similarity_rotation_begin(similarity);
        break;
    default:
        break;
    }
}

static cairn_status step_phase(cairn_self_similarity *similarity, cairn_budget *budget)
{
    switch (similarity->phase) {
    case SELF_SIMILARITY_INNER:
        return cairn_inner_distance_step(similarity->inner, budget);
    case SELF_SIMILARITY_EVOLVE:
        return cairn_curve_evolution_step(similarity->evolution, budget);
    case SELF_SIMILARITY_COMPARE:
        return step_compare(similarity, budget);
    case SELF_SIMILARITY_SEARCH:
        return cairn_self_similarity_search_step(similarity, budget);
    case SELF_SIMILARITY_SCAN:
        return cairn_self_similarity_scan_step(similarity, budget);
    case SELF_SIMILARITY_FIT:
        return cairn_self_similarity_fits_step(similarity, budget);
    case SELF_SIMILARITY_COMPARE_LOCAL:
        return cairn_self_similarity_local_step(similarity, budget);
    case SELF_SIMILARITY_LOCAL_OFFSETS:
        return cairn_self_similarity_local_offsets_step(similarity, budget);
    case SELF_SIMILARITY_SCAN_LOCAL:
        return cairn_self_similarity_scan_local_step(similarity, budget);
    case SELF_SIMILARITY_FINAL_FIT:
        return cairn_self_similarity_final_fit_step(similarity, budget);
    case SELF_SIMILARITY_ROTATION:
        return cairn_self_similarity_rotation_step(similarity, budget);
    default:
        return step_report(similarity, budget);
    }
}

cairn_status cairn_self_similarity_step(cairn_self_similarity *similarity, cairn_budget *budget)
{
    if (similarity == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (similarity->phase != SELF_SIMILARITY_IDLE && similarity->phase != SELF_SIMILARITY_DONE) {
        cairn_status status = step_phase(similarity, budget);

        if (status != CAIRN_OK)
            return status;
        begin_phase(similarity, phase_after(similarity));
    }
    return CAIRN_OK;
}

cairn_self_similarity_result cairn_self_similarity_read(const cairn_self_similarity *similarity)
{
    cairn_self_similarity_result result;

    memset(&result, 0, sizeof result);
    if (similarity == NULL || similarity->phase != SELF_SIMILARITY_DONE)
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
