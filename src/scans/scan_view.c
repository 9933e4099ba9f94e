/* scan: whether a view is one that the modules which take it can use. */
#include "src/base/build.h"

#include "src/scans/scan_work.h"

static cairn_status check_arrays(const cairn_scan_view *view, cairn_fault *fault)
{
    if (view->beam_count < 0 || view->segment_count < 0 || view->point_count < 0)
        return cairn_refuse(fault, -1, "a count is below 0", CAIRN_BAD_ARGUMENT);
    if ((view->beam_count > 0 && view->beams == NULL) ||
        (view->point_count > 0 && view->points == NULL) ||
        (view->segment_count > 0 && (view->segments == NULL || view->first_point == NULL)))
        return cairn_refuse(fault, -1, "a count without its array", CAIRN_BAD_ARGUMENT);
    if (view->point_count > 0 && view->segment_count == 0)
        return cairn_refuse(fault, 0, "a point without a segment", CAIRN_BAD_ARGUMENT);
    for (int32_t i = 0; i < view->segment_count; i++)
        if (view->first_point[i] > view->first_point[i + 1] ||
            (i == 0 && view->first_point[0] != 0))
            return cairn_refuse(fault, i, "first_point does not rise from 0", CAIRN_BAD_ARGUMENT);
    if (view->segment_count > 0 && view->first_point[view->segment_count] != view->point_count)
        return cairn_refuse(fault, view->segment_count, "first_point does not end at point_count",
                            CAIRN_BAD_ARGUMENT);
    return CAIRN_OK;
}

/* Checks two vectors of an item, which may be the same. */
static cairn_status check_vectors(cairn_vec2 a, cairn_vec2 b, cairn_real limit, int32_t item,
                                  const char *not_finite, const char *too_far, cairn_fault *fault)
{
    if (!cairn_vec2_is_finite(a) || !cairn_vec2_is_finite(b))
        return cairn_refuse(fault, item, not_finite, CAIRN_NOT_FINITE);
    if (!cairn_vec2_is_within(a, limit) || !cairn_vec2_is_within(b, limit))
        return cairn_refuse(fault, item, too_far, CAIRN_BAD_ARGUMENT);
    return CAIRN_OK;
}

cairn_status cairn_scan_beams_check(const cairn_scan_beam *beams, int32_t count, cairn_real limit,
                                    cairn_fault *fault)
{
    const char *too_far =
        limit == CAIRN_MAX_MAGNITUDE ? "a beam ends farther than 1e6 m" : "a beam is too far away";
    cairn_status status = CAIRN_OK;

    for (int32_t i = 0; i < count && status == CAIRN_OK; i++)
        status = check_vectors(beams[i].from, beams[i].to, limit, i, "a beam is not finite",
                               too_far, fault);
    return status;
}

cairn_status cairn_scan_view_check(const cairn_scan_view *view, cairn_fault *fault)
{
    const cairn_real limit = CAIRN_MAX_MAGNITUDE;
    cairn_status status = check_arrays(view, fault);

    if (status == CAIRN_OK)
        status = check_vectors(view->sensor, view->sensor, limit, -1,
                               "the sensor's position is not finite",
                               "the sensor is farther than 1e6 m", fault);
    for (int32_t i = 0; i < view->segment_count && status == CAIRN_OK; i++)
        status =
            check_vectors(view->segments[i].a, view->segments[i].b, limit, i,
                          "a segment is not finite", "a segment ends farther than 1e6 m", fault);
    for (int32_t i = 0; i < view->point_count && status == CAIRN_OK; i++)
        status = check_vectors(view->points[i].position, view->points[i].direction, limit, i,
                               "a point is not finite", "a point is farther than 1e6 m", fault);
    return status == CAIRN_OK ? cairn_scan_beams_check(view->beams, view->beam_count, limit, fault)
                              : status;
}
