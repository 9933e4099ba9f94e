/* bench_detect: detections over many images, counted against the truth. */
#ifndef CAIRN_BENCH_DETECT_H
#define CAIRN_BENCH_DETECT_H

#include "bench/bench_group.h"
#include "cairn/object_detect.h"

enum { DETECT_HALF = 0, DETECT_FIFTH = 1, DETECT_CRITERIA = 2 };

/* One detection of a class: its score, and whether its box is that of an object: IoU >= 0.5, and > 0.2. */
typedef struct detect_event {
    double score;
    int32_t hit[DETECT_CRITERIA];
} detect_event;

typedef struct detect_tally {
    detect_event *events; /* [count] */
    int32_t count, room;
    int32_t images, instances;
} detect_tally;

/* Counts the detections of an image; truth: NULL where the class is not in it. The best detection takes its object first, each is taken
 * once. 0: there is no memory. */
int detect_tally_add(detect_tally *tally, const cairn_detection *found, int32_t count, const group_image *truth);
/* The object that a detection's box shares most with, over their union; -1: none. */
int32_t detect_object(const group_image *truth, const cairn_detection *detection, double *share);
void detect_tally_free(detect_tally *tally);

typedef struct detect_point {
    double recall, precision, false_per_image;
    int32_t instances, detections; /* that recall and precision are shares of */
} detect_point;

/* The interval of 95 % of a share of `count` (Wilson 1927). */
void detect_interval(double share, int32_t count, double *low, double *high);

/* The curve, from the best score down: points[tally->count]. */
void detect_curve(detect_tally *tally, int32_t criterion, detect_point *points);

/* Recall at so many false positives per image; the mean of the best precision at recalls of 0, 0.1 ... 1; the best precision at a recall or
 * above, 0 where it is not reached. */
double detect_rate_at(const detect_point *points, int32_t count, double false_per_image);
double detect_average_precision(const detect_point *points, int32_t count);
double detect_precision_at(const detect_point *points, int32_t count, double recall);

/* Plain oriented chamfer matching, the twin that all else is measured by: eight directions, distances cut at a share of the size, nine
 * sizes, three proportions, the mirror image, NMS at 0.2. Detections from the heap. -1: there is no memory. */
int32_t detect_chamfer(const group_image *image, const cairn_shape_model *model, cairn_detection **found);

#endif
