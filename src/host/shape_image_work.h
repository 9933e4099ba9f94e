/* shape_image_work: what the parts of shape_image share. Internal to the host library. */
#ifndef CAIRN_HOST_SHAPE_IMAGE_WORK_H
#define CAIRN_HOST_SHAPE_IMAGE_WORK_H

#include "cairn/shape_image.h"

/* A picture with a rim of one pixel of background about it. */
typedef struct shape_picture {
    int32_t width, height; /* with the rim */
    uint8_t *ink;          /* [height * width] 1: ink */
    int32_t *face;         /* [height * width] of what is not ink: 0: the outside, 1 ...; -1: ink */
    int32_t *part;         /* [height * width] 1 ...; 0: the outside */
    int32_t *stack;        /* [height * width] */
    const char *path;
    cairn_file_error *error;
} shape_picture;

/* Joins loose ends of lines that are at most `reach` pixels apart, the nearest first. *joined:
 * how many pairs. */
CAIRN_CHECKED cairn_status cairn_shape_image_join(shape_picture *picture, double reach,
                                                  cairn_shape_image *image);

/* The outline of the pixels of one label, from its first pixel in the order of rows: middles of
 * the pixels' sides, smoothed. corners: 1: pixels that meet in a corner are neighbours. points:
 * NULL: counts only. The number of points. */
int32_t cairn_shape_image_outline(const shape_picture *picture, const int32_t *labels,
                                  int32_t label, int32_t corners, int32_t first,
                                  cairn_vec2 *points);

#endif
