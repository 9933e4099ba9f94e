/* Parameters of the contour search, the bands of sizes that follow from them, and the object's
 * memory.
 *
 * Memory layout: the search; its result; buffers of the filter's observation; the mirrored model; the
 * field, the deformation, the collection of segments and the shape quality; the grouping. */
#include "src/base/build.h"

#include "src/detection/contour_search_object.h"

/* Greatest ratio of sizes within one band, because a search keeps only the best size at one
 * position. */
static const cairn_real BAND_FACTOR = CAIRN_REAL(2.2);
/* Least evidence and greatest number of candidates. */
static const cairn_real MIN_CANDIDATE_EVIDENCE = 2;
enum { MAX_CANDIDATES = 12 };

#define INTEGER(field, ...)  CAIRN_INTEGER(cairn_contour_search_params, field, __VA_ARGS__)
#define NUMBER(field, ...)   CAIRN_NUMBER(cairn_contour_search_params, field, __VA_ARGS__)
#define POSITIVE(field, ...) CAIRN_NUMBER_ABOVE(cairn_contour_search_params, field, __VA_ARGS__)

/* Default, lowest and highest value; default sizes: of the smallest images. */
static const cairn_parameter rows[] = {
    INTEGER(max_segments, 8192, 1, CAIRN_CONTOUR_SEARCH_MAX_SEGMENTS),
    NUMBER(min_evidence, 34, -CAIRN_REAL_MAX, CAIRN_REAL_MAX),
    NUMBER(min_score, CAIRN_REAL(0.3), -CAIRN_REAL_MAX, CAIRN_REAL_MAX),
    POSITIVE(min_size, 24, 0, CAIRN_REAL_MAX),
    POSITIVE(max_size, 24, 0, CAIRN_REAL_MAX),
    NUMBER(min_turn, -15 * (CAIRN_PI / 180), -CAIRN_REAL_MAX, CAIRN_REAL_MAX),
    NUMBER(max_turn, 15 * (CAIRN_PI / 180), -CAIRN_REAL_MAX, CAIRN_REAL_MAX),
    INTEGER(mirror, 1, 0, 1),
};
extern const cairn_parameters cairn_contour_search_parameters;
const cairn_parameters cairn_contour_search_parameters =
    CAIRN_PARAMETERS("contour_search", cairn_contour_search_params, rows);

cairn_contour_search_params cairn_contour_search_default(int32_t width, int32_t height)
{
    const cairn_vec2 sides = {(cairn_real)width, (cairn_real)height};
    cairn_real diagonal = cairn_vec2_norm(sides);
    cairn_contour_search_params params;

    cairn_parameters_preset(&cairn_contour_search_parameters, &params);
    params.min_size = cairn_max(params.min_size, diagonal / 10);
    params.max_size = cairn_max(params.max_size, diagonal);
    params.grouping = cairn_contour_grouping_default();
    /* A low threshold for the rigid outline: deformation may raise the evidence. */
    params.grouping.min_evidence = MIN_CANDIDATE_EVIDENCE;
    params.grouping.min_score = 0;
    params.grouping.max_objects = MAX_CANDIDATES;
    return params;
}

cairn_status cairn_contour_search_check(const cairn_contour_search_params *params,
                                        cairn_object_fault *fault)
{
    cairn_status status = cairn_parameters_check(&cairn_contour_search_parameters, params, fault);

    if (status == CAIRN_OK)
        status = cairn_parameters_require(params->max_size >= params->min_size, "contour_search",
                                          "max_size: at least min_size", fault);
    if (status == CAIRN_OK)
        status =
            cairn_parameters_require(cairn_is_finite(params->max_size / params->min_size),
                                     "contour_search", "max_size: over min_size finite", fault);
    if (status == CAIRN_OK)
        status = cairn_contour_grouping_check(&params->grouping, fault);
    return status;
}

int32_t cairn_contour_search_band_count(cairn_real min_size, cairn_real max_size)
{
    return 1 + cairn_real_to_int(cairn_log(max_size / min_size) / cairn_log(BAND_FACTOR));
}

cairn_real cairn_contour_search_band_bound(cairn_real min_size, cairn_real max_size, int32_t bands,
                                           int32_t index)
{
    return min_size *
           cairn_exp(cairn_log(max_size / min_size) * (cairn_real)index / (cairn_real)bands);
}

/* ---- Memory ---- */

/* Capacities that follow from the params. */
typedef struct search_capacity {
    size_t objects, segments, discs, outline, steps, particles, walk;
} search_capacity;

static search_capacity capacity_of(const cairn_contour_search_params *params)
{
    const cairn_contour_grouping_params *grouping = &params->grouping;
    size_t objects = (size_t)grouping->max_objects, steps = (size_t)grouping->max_steps,
           bands = (size_t)cairn_contour_search_band_count(params->min_size, params->max_size),
           all = objects * bands * (params->mirror ? 2 : 1);

    if (grouping->mode >= CAIRN_MODE_AS_WRITTEN) {
        search_capacity written = {
            objects, 2 * objects * steps, objects * steps, 0, steps, (size_t)grouping->particles,
            steps};

        return written;
    }
    /* The current candidate is behind all that were kept. */
    return (search_capacity){all,
                             all * (size_t)params->max_segments,
                             all * (size_t)grouping->max_samples,
                             all * (size_t)grouping->max_outline,
                             bands * (size_t)grouping->max_samples,
                             (size_t)grouping->particles,
                             0};
}

size_t cairn_contour_search_step_capacity(const cairn_contour_search_params *params)
{
    return capacity_of(params).steps;
}

/* The result's arrays; trace and mode_counts of the mirror image only with it. */
static void take_result(cairn_contour_search *search, cairn_pool *pool,
                        const search_capacity *capacity, int32_t mirror)
{
    CAIRN_TAKE(search, pool, result.objects, capacity->objects);
    CAIRN_TAKE(search, pool, result.segments, capacity->segments);
    CAIRN_TAKE(search, pool, result.discs, capacity->discs);
    CAIRN_TAKE(search, pool, result.outline, capacity->outline);
    for (int32_t k = 0; k < 1 + mirror; k++) {
        CAIRN_TAKE(search, pool, result.trace[k], capacity->steps);
        CAIRN_TAKE(search, pool, result.mode_counts[k], capacity->steps);
    }
}

/* The object, its arrays and the grouping; NULL from a counting pool. */
static cairn_contour_search *build(cairn_pool *pool, const cairn_contour_search_params *params)
{
    const cairn_contour_grouping_params *grouping = &params->grouping;
    search_capacity capacity = capacity_of(params);
    int32_t is_written = grouping->mode >= CAIRN_MODE_AS_WRITTEN,
            mirror = params->mirror && !is_written;
    size_t remaining = cairn_pool_remaining(pool);
    cairn_contour_search *search = cairn_object_take(pool, sizeof *search);

    take_result(search, pool, &capacity, mirror);
    CAIRN_TAKE(search, pool, particles, capacity.particles);
    CAIRN_TAKE(search, pool, mode, capacity.particles);
    CAIRN_TAKE(search, pool, walk, capacity.walk);
    CAIRN_TAKE(search, pool, starts, is_written ? capacity.particles : 0);
    CAIRN_TAKE(search, pool, mirrored_samples, mirror ? grouping->max_samples : 0);
    CAIRN_TAKE(search, pool, mirrored_outline, mirror ? grouping->max_outline : 0);
    if (!is_written)
        cairn_contour_search_refinement_take(search != NULL ? &search->refinement : NULL, pool,
                                             params->max_segments, grouping->max_outline);
    CAIRN_TAKE_OBJECT(search, pool, grouping, contour_grouping, grouping);
    if (search != NULL) {
        search->params = *params;
        search->params.mirror = mirror;
        search->result.pool_bytes = remaining - cairn_pool_remaining(pool);
    }
    return search;
}

CAIRN_OBJECT(contour_search, contour_search, build);
