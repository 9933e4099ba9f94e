/* detection_curve: what detections in many images are worth against the truth: precision over
 * recall, detection rate over false positives.
 *
 * Of each image the detections take their objects, the best first; of all images they make the
 * curves. */
#ifndef CAIRN_DETECTION_CURVE_H
#define CAIRN_DETECTION_CURVE_H

#include "cairn/file_error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A detection of any image: hit: 1: its box is that of an object that no better one has taken. */
typedef struct cairn_detection_event {
    double score;
    int32_t hit;
} cairn_detection_event;

/* All detections down to one. */
typedef struct cairn_detection_point {
    double score;                  /* of the last one */
    double recall, precision;      /* shares of the objects and of the detections */
    double false_per_image;        /* detections that are none, for each image */
    int32_t instances, detections; /* that recall and precision are shares of */
} cairn_detection_point;

/* What two boxes (left, top, right, bottom) share, over their union: 0 ... 1. */
double cairn_detection_overlap(const double a[4], const double b[4]);

/* The object, of those with taken[i] 0, that a box shares most with, over their union; *share:
 * how much; -1: none. */
int32_t cairn_detection_object(const double (*objects)[4], const int32_t *taken, int32_t count,
                               const double box[4], double *share);

/* The curve, from the best score down: points[count]; events are sorted, false ones before true
 * ones of the same score: nothing is won by ties. Cost: n log n. */
void cairn_detection_curve(cairn_detection_event *events, int32_t count, int32_t images,
                           int32_t instances, cairn_detection_point *points);

/* Recall at so many false positives per image; the mean of the best precision at recalls of 0,
 * 0.1 ... 1; the best precision at a recall or above, 0 where it is not reached. */
double cairn_detection_rate_at(const cairn_detection_point *points, int32_t count,
                               double false_per_image);
double cairn_detection_average_precision(const cairn_detection_point *points, int32_t count);
double cairn_detection_precision_at(const cairn_detection_point *points, int32_t count,
                                    double recall);

/* The interval of 95 % of a share of `count` (Wilson 1927). */
void cairn_detection_interval(double share, int32_t count, double *low, double *high);

/* Writes STEM.csv, a line for each point with the intervals, and STEM.svg, both curves with
 * theirs. CAIRN_IO, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_detection_curve_write(const char *stem, const char *title,
                                                       const cairn_detection_point *points,
                                                       int32_t count, cairn_file_error *error);

#ifdef __cplusplus
}
#endif

#endif
