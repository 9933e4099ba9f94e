/* bench_detect: evaluation of detections over many images against ground truth. */
#ifndef CAIRN_BENCH_DETECT_H
#define CAIRN_BENCH_DETECT_H

#include "bench/bench_group.h"
#include "cairn/detection_curve.h"
#include "cairn/object_detect.h"

enum { DETECT_HALF = 0, DETECT_FIFTH = 1, DETECT_CRITERIA = 2 };

/* One detection of a class: its score, and whether its box is that of an object: IoU >= 0.5, and
 * > 0.2. */
typedef struct detect_event {
    double score;
    int32_t hit[DETECT_CRITERIA];
} detect_event;

typedef struct detect_tally {
    detect_event *events; /* [count] */
    int32_t count, capacity;
    int32_t images, instances;
} detect_tally;

/* Counts the detections of an image; truth: NULL where the class is absent. The best detection
 * takes its object first; each object is taken once. 0: memory is insufficient. */
int detect_tally_add(detect_tally *tally, const cairn_object_detection *found, int32_t count,
                     const group_image *truth);
/* The object of greatest intersection over union with a detection's box; -1: none. */
int32_t detect_object(const group_image *truth, const cairn_object_detection *detection,
                      double *share);
void detect_tally_free(detect_tally *tally);

/* The curve by one of the criteria, from the best score down: points[tally->count]. 0: memory is
 * insufficient, or a score is not finite. */
int detect_curve(const detect_tally *tally, int32_t criterion, cairn_detection_curve_point *points);

/* Plain oriented chamfer matching, the baseline: eight directions, distances clipped at a share of
 * the size, nine sizes, three proportions, the mirror image, NMS at 0.2. Detections from the heap.
 * -1: memory is insufficient. */
int32_t detect_chamfer(const group_image *image, const cairn_shape_model *model,
                       cairn_object_detection **found);

#endif
