/* bench_bsds: precision and recall of boundary pixels against human boundaries (BSDS). */
#ifndef CAIRN_BENCH_BSDS_H
#define CAIRN_BENCH_BSDS_H

#include "cairn/boundary.h"
#include "cairn/file_error.h"
#include "cairn/skeleton_grouping.h"
#include "cairn/vision.h"

typedef struct bsds_image {
    cairn_vision_image colour;      /* 3 channels, or 1 */
    cairn_vision_image grey, truth; /* truth: above 0 at human-annotated boundary pixels */
    uint8_t *near;                  /* [height * width] 1: within reach of the truth */
    double reach;                   /* px, 0.75 % of the diagonal */
} bsds_image;

/* NAME.jpg and NAME_gtK.png of a folder. 0: a fault has been printed. */
int bsds_read(bsds_image *image, const char *folder, const char *name);
void bsds_free(bsds_image *image);

/* Precision and recall of a set of pixels. */
typedef struct bsds_point {
    double precision, recall;
} bsds_point;

bsds_point bsds_score(const bsds_image *image, const uint8_t *pixels);

/* The pixels along the contours of the likeliest parts, as many as it takes for a recall of
 * `least`, or all. */
bsds_point bsds_grouped(const bsds_image *image, const cairn_skeleton_grouping_result *r,
                        double least, uint8_t *pixels);

/* The pixels along the strongest contours between regions, as many as it takes for a recall of
 * `least`, or all. */
bsds_point bsds_contours(const bsds_image *image, const cairn_boundary_result *r, double least,
                         uint8_t *pixels);

/* Canny's best precision at a recall, over sigma 0.7 ... 4 and thresholds; 0: none reaches it. */
double bsds_canny(const bsds_image *image, double recall);

#endif
