/* Memory of the detector.
 *
 * Memory layout: the detector; its detections, their segments and outlines; variants of the model;
 * peaks and a score map, or the search by parts; the grouping; field, deformation,
 * collection of segments and shape quality around a candidate. */
#include "src/base/build.h"

#include "src/detection/object_detect_object.h"

/* Greatest number of candidates that are refined: with `occluded` grouped objects, too. */
static size_t refined_count(const cairn_object_detect_params *params)
{
    return (size_t)params->candidates * (params->occluded ? 2 : 1);
}

/* The arrays of the detections; as written all hypotheses are detections at first. */
static void take_result(cairn_object_detector *detector, cairn_pool *pool,
                        const cairn_object_detect_params *params)
{
    int is_written = cairn_object_detect_is_as_written(params);
    size_t reported = is_written ? (size_t)params->max_detections : refined_count(params),
           made = is_written ? OBJECT_DETECT_MAX_WRITTEN_HYPOTHESES : reported;

    CAIRN_TAKE(detector, pool, result.found, made + 1);
    CAIRN_TAKE(detector, pool, result.segments, reported * (size_t)params->max_segments);
    CAIRN_TAKE(detector, pool, result.outline, reported * (size_t)params->max_outline);
}

/* The arrays of the refinement. */
static void take_refinement(cairn_object_detector *detector, cairn_pool *pool,
                            const cairn_object_detect_params *params)
{
    CAIRN_TAKE(detector, pool, outlines, 2 * OBJECT_DETECT_ASPECTS * params->max_outline);
    cairn_contour_search_refinement_take(detector != NULL ? &detector->refinement : NULL, pool,
                                         params->max_segments, params->max_outline);
    CAIRN_TAKE(detector, pool, agreement.weight, params->max_outline);
}

/* The peaks and a score map, and the grouping. */
static void take_candidates(cairn_object_detector *detector, cairn_pool *pool,
                            const cairn_object_detect_params *params)
{
    object_detect_level level[OBJECT_DETECT_MAX_LEVELS];
    size_t peaks = (size_t)params->max_peaks + (size_t)params->candidates, cells = 0;

    if (cairn_object_detect_set_levels(level, params, params->max_width, params->max_height) > 0)
        cells = (size_t)level[0].width * (size_t)level[0].height;
    else
        peaks = OBJECT_DETECT_MAX_HYPOTHESES;
    CAIRN_TAKE(detector, pool, peaks, peaks);
    CAIRN_TAKE(detector, pool, sum, cells);
    if (cairn_object_detect_needs_grouping(params))
        cairn_object_detect_group_take(detector != NULL ? &detector->group : NULL, pool, params);
}

/* The object, its arrays and nested objects; NULL from a counting pool. */
static cairn_object_detector *build(cairn_pool *pool, const cairn_object_detect_params *params)
{
    cairn_object_detector *detector = cairn_object_take(pool, sizeof *detector);

    take_result(detector, pool, params);
    if (params->method == CAIRN_OBJECT_DETECT_PARTS)
        cairn_object_detect_parts_take(detector != NULL ? &detector->parts : NULL, pool, params);
    if (!cairn_object_detect_is_as_written(params)) {
        take_refinement(detector, pool, params);
        take_candidates(detector, pool, params);
    }
    if (detector != NULL)
        detector->params = *params;
    return detector;
}

CAIRN_OBJECT(object_detect, object_detector, build);
