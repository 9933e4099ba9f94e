/* object_detect_work: what the parts of object_detect share. Internal to the host library. */
#ifndef CAIRN_HOST_OBJECT_DETECT_WORK_H
#define CAIRN_HOST_OBJECT_DETECT_WORK_H

#include "cairn/object_detect.h"
#include "src/host/contour_search_fit.h"

/* Directions over half a turn; cells along an object's size, and round the picture, where no edge is known; sizes from the least to the
 * largest that there may be; cells along a picture's side at most. */
enum {
    DETECT_BINS = CONTOUR_FIELD_BINS,
    DETECT_CELLS = 40,
    DETECT_MARGIN = 28,
    DETECT_PLANES = 42,
    DETECT_SIDE_MOST = 2000
};

/* What edges are worth for objects of one size. */
typedef struct detect_plane {
    cairn_real size, cell; /* px */
    int32_t width, height; /* cells of the picture; rows have margins on both sides */
    float *worth;          /* [BINS][height + 2 MARGIN][width + 2 MARGIN] */
} detect_plane;

struct cairn_detect_field {
    const cairn_contour_tokens *tokens;
    cairn_object_detect_params params;
    detect_plane plane[DETECT_PLANES];
    int32_t planes;
};

static inline size_t cairn_detect_row(const detect_plane *p)
{
    return (size_t)p->width + 2 * DETECT_MARGIN;
}

static inline size_t cairn_detect_layer(const detect_plane *p)
{
    return cairn_detect_row(p) * ((size_t)p->height + 2 * DETECT_MARGIN);
}

#endif
