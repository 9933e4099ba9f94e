/* shape_image_work: data shared by the source files of shape_image. Internal to the host
 * library. */
#ifndef CAIRN_HOST_SHAPE_IMAGE_WORK_H
#define CAIRN_HOST_SHAPE_IMAGE_WORK_H

#include "cairn/shape_image.h"

/* A binarized picture with a border of one pixel of background. */
typedef struct shape_picture {
    int32_t width, height; /* pixels, with the border */
    uint8_t *ink;          /* [height * width] 1: ink (foreground) */
    /* [height * width] label of the background's connected component: 0: outside, -1: ink */
    int32_t *face;
    /* [height * width] label of the component of ink and enclosed faces; 0: outside */
    int32_t *part;
    int32_t *stack; /* [height * width] of the flood fill */
    const char *path;
    cairn_file_error *error;
} shape_picture;

/* Bridges gaps between open line ends at most `reach` pixels apart, the closest pair first. Sets
 * image->joined and image->gaps. */
CAIRN_CHECKED cairn_status cairn_shape_image_join(shape_picture *picture, double reach,
                                                  cairn_shape_image *image);

/* Traces the outline of the region with one label (crack following) from its first pixel in row
 * order: midpoints of the pixel edges, smoothed. corners: 1: 8-connectivity, 0: 4-connectivity.
 * points: NULL: counts only. Returns the number of points. */
int32_t cairn_shape_image_outline(const shape_picture *picture, const int32_t *labels,
                                  int32_t label, int32_t corners, int32_t first,
                                  cairn_vec2 *points);

#endif
