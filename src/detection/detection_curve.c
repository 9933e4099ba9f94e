/* Evaluation of detections against ground truth.
 *
 * Method: the protocol of the ETHZ shape classes and of PASCAL VOC 2007: each object is matched
 * once, by the best detection that overlaps it enough; 11-point interpolated average precision.
 *
 * Limits: not stepped: evaluation belongs to no control loop.
 *
 * Source: Everingham et al. 2010 (11 points); Wilson 1927 (intervals). */
#include "src/base/build.h"

#include "cairn/detection_curve.h"
#include "src/detection/detection_sort.h"

static const cairn_real WILSON_Z = CAIRN_REAL(1.96);
/* A recall that is less by rounding alone is reached. */
static const cairn_real RECALL_TOLERANCE = CAIRN_REAL(1e-9) + 8 * CAIRN_REAL_EPSILON;
enum { RECALL_STEPS = 10 };

cairn_real cairn_detection_curve_overlap(const cairn_real a[4], const cairn_real b[4])
{
    cairn_real w = cairn_min(a[2], b[2]) - cairn_max(a[0], b[0]),
               h = cairn_min(a[3], b[3]) - cairn_max(a[1], b[1]);
    cairn_real both = w > 0 && h > 0 ? w * h : 0,
               either = (a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - both;

    return either > 0 ? both / either : 0;
}

int32_t cairn_detection_curve_object(const cairn_real (*objects)[4], const int32_t *taken,
                                     int32_t count, const cairn_real box[4], cairn_real *share)
{
    int32_t best = -1;

    *share = 0;
    for (int32_t i = 0; i < count; i++) {
        cairn_real overlap = cairn_detection_curve_overlap(objects[i], box);

        if (!taken[i] && overlap > *share) {
            *share = overlap;
            best = i;
        }
    }
    return best;
}

static int32_t compare_events(const void *first, const void *second)
{
    const cairn_detection_curve_event *a = first, *b = second;

    if (a->score != b->score)
        return a->score < b->score ? 1 : -1;
    return a->hit - b->hit;
}

static cairn_status check_events(const cairn_detection_curve_event *events, int32_t count,
                                 cairn_fault *fault)
{
    for (int32_t i = 0; i < count; i++) {
        if (!cairn_is_finite(events[i].score))
            return cairn_refuse(fault, i, "a score that is not finite, expected a finite one",
                                CAIRN_NOT_FINITE);
        if (events[i].hit != 0 && events[i].hit != 1)
            return cairn_refuse(fault, i, "a hit other than 0 or 1, expected 0 or 1",
                                CAIRN_BAD_ARGUMENT);
    }
    return CAIRN_OK;
}

cairn_status cairn_detection_curve(cairn_detection_curve_event *events, int32_t count,
                                   int32_t images, int32_t instances,
                                   cairn_detection_curve_point *points, cairn_fault *fault)
{
    cairn_status status;
    int32_t hits = 0;

    if (count < 0 || images < 0 || instances < 0 ||
        (count > 0 && (events == NULL || points == NULL)))
        return cairn_refuse(fault, -1, "a negative number or no array, expected detections",
                            CAIRN_BAD_ARGUMENT);
    status = check_events(events, count, fault);
    if (status != CAIRN_OK)
        return status;
    cairn_detection_sort_all(events, count, sizeof *events, compare_events);
    for (int32_t i = 0; i < count; i++) {
        hits += events[i].hit;
        points[i].score = events[i].score;
        points[i].recall = (cairn_real)hits / (cairn_real)(instances > 0 ? instances : 1);
        points[i].precision = (cairn_real)hits / (cairn_real)(i + 1);
        points[i].false_per_image =
            (cairn_real)(i + 1 - hits) / (cairn_real)(images > 0 ? images : 1);
        points[i].instances = instances;
        points[i].detections = i + 1;
    }
    return CAIRN_OK;
}

cairn_real cairn_detection_curve_rate_at(const cairn_detection_curve_point *points, int32_t count,
                                         cairn_real false_per_image)
{
    cairn_real rate = 0;

    for (int32_t i = 0; i < count && points[i].false_per_image <= false_per_image; i++)
        rate = points[i].recall;
    return rate;
}

cairn_real cairn_detection_curve_precision_at(const cairn_detection_curve_point *points,
                                              int32_t count, cairn_real recall)
{
    cairn_real best = 0;

    for (int32_t i = 0; i < count; i++)
        if (points[i].recall >= recall - RECALL_TOLERANCE)
            best = cairn_max(best, points[i].precision);
    return best;
}

cairn_real cairn_detection_curve_average_precision(const cairn_detection_curve_point *points,
                                                   int32_t count)
{
    cairn_real sum = 0;

    for (int32_t k = 0; k <= RECALL_STEPS; k++)
        sum += cairn_detection_curve_precision_at(points, count,
                                                  (cairn_real)k / (cairn_real)RECALL_STEPS);
    return sum / (RECALL_STEPS + 1);
}

void cairn_detection_curve_interval(cairn_real share, int32_t count, cairn_real *low,
                                    cairn_real *high)
{
    cairn_real n = (cairn_real)(count > 0 ? count : 1), z2 = WILSON_Z * WILSON_Z,
               centre = (share + z2 / (2 * n)) / (1 + z2 / n);
    cairn_real half =
        WILSON_Z / (1 + z2 / n) * cairn_sqrt(share * (1 - share) / n + z2 / (4 * n * n));

    *low = cairn_max(0, centre - half);
    *high = cairn_min(1, centre + half);
}
