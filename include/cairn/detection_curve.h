/* detection_curve: evaluation of detections against ground truth: precision-recall curve, and
 * detection rate over false positives per image.
 *
 * In each image the detections are matched to ground-truth objects in descending order of score.
 * The detections of all images are pooled into one curve. */
#ifndef CAIRN_DETECTION_CURVE_H
#define CAIRN_DETECTION_CURVE_H

#include "cairn/real.h"
#include "cairn/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A scored detection. hit 1: true positive, its box matches an object that no better detection has
 * claimed; 0: false positive. */
typedef struct cairn_detection_curve_event {
    /* score of the detection, finite */
    cairn_real score;
    /* 1: true positive; 0: false positive */
    int32_t hit;
} cairn_detection_curve_event;

/* A point of the curve: all detections down to one score. */
typedef struct cairn_detection_curve_point {
    cairn_real score; /* score threshold, of the last detection */
    /* 0 ... 1: true positives over all objects, and over all detections */
    cairn_real recall, precision;
    cairn_real false_per_image;    /* false positives per image */
    int32_t instances, detections; /* denominators of recall and precision */
} cairn_detection_curve_point;

/* Returns the intersection over union (IoU) of two boxes (left, top, right, bottom): 0 ... 1; 0 of
 * boxes without area.
 *
 * a, b: left, top, right, bottom */
cairn_real cairn_detection_curve_overlap(const cairn_real a[4], const cairn_real b[4]);

/* Returns the index of the object with taken[i] 0 whose intersection over union with a box is
 * greatest; -1: none. *share: that overlap.
 *
 * objects: [count] boxes: left, top, right, bottom
 * taken: [count] not 0: the object is not considered
 * box: left, top, right, bottom */
int32_t cairn_detection_curve_object(const cairn_real (*objects)[4], const int32_t *taken,
                                     int32_t count, const cairn_real box[4], cairn_real *share);

/* Computes the curve in descending order of score: points[count]. events are sorted in place; false
 * positives precede true positives of the same score, so that ties give no advantage.
 * CAIRN_BAD_ARGUMENT: a negative number, a hit other than 0 or 1. CAIRN_NOT_FINITE: a score. *fault:
 * index of the event. A refused call changes nothing. Cost: n log n, at once.
 *
 * events: [count] detections
 * images: number of images
 * instances: number of objects in all images
 * points: [count] set to the curve */
CAIRN_CHECKED cairn_status cairn_detection_curve(cairn_detection_curve_event *events, int32_t count,
                                                 int32_t images, int32_t instances,
                                                 cairn_detection_curve_point *points,
                                                 cairn_fault *fault);

/* Returns the recall at a number of false positives per image.
 *
 * points: [count] curve
 * false_per_image: false positives per image */
cairn_real cairn_detection_curve_rate_at(const cairn_detection_curve_point *points, int32_t count,
                                         cairn_real false_per_image);

/* Returns the 11-point interpolated average precision: the mean of the greatest precision at
 * recalls of 0, 0.1 ... 1.
 *
 * points: [count] curve */
cairn_real cairn_detection_curve_average_precision(const cairn_detection_curve_point *points,
                                                   int32_t count);

/* Returns the greatest precision at a recall or above; 0 where the recall is not reached.
 *
 * points: [count] curve
 * recall: 0 ... 1 */
cairn_real cairn_detection_curve_precision_at(const cairn_detection_curve_point *points,
                                              int32_t count, cairn_real recall);

/* Computes the 95 % Wilson score interval of a proportion `share` of `count` trials (Wilson
 * 1927).
 *
 * low, high: set to the bounds, 0 ... 1
 * share: 0 ... 1
 * count: number of trials */
void cairn_detection_curve_interval(cairn_real share, int32_t count, cairn_real *low,
                                    cairn_real *high);

#ifdef __cplusplus
}
#endif

#endif
