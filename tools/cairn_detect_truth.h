/* Comparison of detections with ground-truth bounding boxes, for the precision/recall curves of
 * cairn detect. */
#ifndef CAIRN_TOOLS_CAIRN_DETECT_TRUTH_H
#define CAIRN_TOOLS_CAIRN_DETECT_TRUTH_H

#include <stdio.h>

#include "cairn/box_table.h"
#include "cairn/detection_curve.h"
#include "cairn/detection_file.h"

typedef struct detect_truth {
    /* [count] ground-truth boxes, sorted by image */
    cairn_box_table_row *rows;
    int32_t count;
    /* [event_count] detections of all images */
    cairn_detection_curve_event *events;
    int32_t event_count, event_capacity;
    /* 1: a hit has an intersection over union above 0.2, as in the thesis; 0: of at least 0.5 */
    int32_t as_written;
} detect_truth;

/* Statuses of cairn_box_table_read; then there is nothing to free. */
CAIRN_CHECKED cairn_status detect_truth_read(detect_truth *truth, const char *path,
                                             cairn_file_error *error);

/* Writes a line for each detection of an image: its score, and 1 when it is the best detection of
 * an object that it hits, else 0. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status detect_truth_print(const detect_truth *truth, const char *path,
                                              const cairn_detection_file_picture *picture,
                                              FILE *record, cairn_file_error *error);
/* Parses one line of detect_truth_print() into an event. Returns 0 when there is no memory. */
int detect_truth_parse(detect_truth *truth, const char *line);
/* Writes STEM.csv and STEM.svg over these images; objects of others do not count. */
CAIRN_CHECKED cairn_status detect_truth_write(detect_truth *truth, const char *const *images,
                                              size_t count, const char *stem, const char *title,
                                              cairn_file_error *error);
void detect_truth_free(detect_truth *truth);

#endif
