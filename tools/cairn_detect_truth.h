/* cairn_detect_truth: detections against the boxes of the objects that there are, for the curves of cairn detect. */
#ifndef CAIRN_TOOLS_CAIRN_DETECT_TRUTH_H
#define CAIRN_TOOLS_CAIRN_DETECT_TRUTH_H

#include <stdio.h>

#include "cairn/box_table.h"
#include "cairn/detection_curve.h"
#include "cairn/detection_file.h"

typedef struct detect_truth {
    cairn_box_row *rows; /* [count] sorted */
    int32_t count;
    cairn_detection_event *events; /* [event_count] of all images */
    int32_t event_count, event_room;
    int32_t as_written; /* 1: more than a fifth of the union with an object is a hit, as in the thesis; 0: half */
} detect_truth;

/* Statuses of cairn_box_table_read; then there is nothing to free. */
CAIRN_CHECKED cairn_status detect_truth_read(detect_truth *truth, const char *path, cairn_file_error *error);

/* Writes a line for each detection of an image: its score, and 1 where it is the best for an object that it hits.
 * CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status detect_truth_print(const detect_truth *truth, const char *path,
                                              const cairn_detection_picture *picture, FILE *record,
                                              cairn_file_error *error);
/* Takes such a line. 0: there is no memory. */
int detect_truth_take(detect_truth *truth, const char *line);
/* Writes STEM.csv and STEM.svg over these images; objects of others do not count. */
CAIRN_CHECKED cairn_status detect_truth_write(detect_truth *truth, const char *const *images, size_t count,
                                              const char *stem, const char *title, cairn_file_error *error);
void detect_truth_free(detect_truth *truth);

#endif
