/* edgel: edge points of an image between its pixels, with the direction of the edge from
 * derivatives of third order.
 *
 * Where the slope of the smoothed image I is steepest along itself its second derivative in that
 * direction, up to a factor F = Ix^2 Ixx + 2 Ix Iy Ixy + Iy^2 Iyy, passes through zero; the edge
 * is the line F = 0, and its normal is that of this line, the gradient of F, which follows a
 * bend that the gradient of I itself blurs (Adluru 2008, section 3.1, reference 244). Image
 * coordinates: x to the right, y down, (0, 0) the middle of the pixel in the first column and
 * row. */
#ifndef CAIRN_EDGEL_H
#define CAIRN_EDGEL_H

#include "cairn/geometry.h"
#include "cairn/pool.h"
#include "cairn/raster.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_edgel {
    cairn_vec2 position;
    cairn_vec2 normal; /* of length 1, across the edge, towards the brighter side */
    cairn_real slope;  /* grey levels per pixel, of the smoothed image */
} cairn_edgel;

typedef struct cairn_edgel_params {
    /* pixels, 1 ... CAIRN_RASTER_MAX_SIDE (640 and 480) */
    int32_t max_width, max_height;
    /* 1 ... 2^28 (40,000) */
    int32_t max_edgels;
    /* pixels, 0.7 ... 8: blur; more passes over noise and over detail (1.5) */
    cairn_real sigma;
    /* grey levels per pixel, > 0: where it is less there is no edge (2) */
    cairn_real min_slope;
    /* rad, > 0, <= pi/2: edges whose normal and slope differ by more are left out (60 degrees) */
    cairn_real max_turn;
} cairn_edgel_params;

typedef struct cairn_edgel_set cairn_edgel_set;

/* The values in brackets above. */
cairn_edgel_params cairn_edgel_default(void);

/* 0 for params that create() would refuse. */
size_t cairn_edgel_memory(const cairn_edgel_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_edgel_create(cairn_edgel_set **set, cairn_pool *pool,
                                              const cairn_edgel_params *params);

/* Starts on a picture of grey levels, which must stay until step() returns CAIRN_OK; what was
 * found before is gone. Beyond its border the picture goes on as its outermost pixels.
 * CAIRN_BAD_ARGUMENT: a bad view. CAIRN_FULL: larger than max_width or max_height. Constant
 * time. */
CAIRN_CHECKED cairn_status cairn_edgel_begin(cairn_edgel_set *set, cairn_raster_u8_view grey);

/* Goes on, row by row. CAIRN_MORE: the budget is used up. CAIRN_OK: the edgels stand, or nothing
 * was begun. CAIRN_FULL: more than max_edgels; given up, and there are none. In all about 3 +
 * 2.2 sigma units a pixel. */
CAIRN_CHECKED cairn_status cairn_edgel_step(cairn_edgel_set *set, cairn_budget *budget);

/* The edgels in order of their rows, about one for each pixel along an edge; none until step()
 * returns CAIRN_OK; valid until the next begin(). *count, when not NULL, is their number. */
const cairn_edgel *cairn_edgel_list(const cairn_edgel_set *set, int32_t *count);

#ifdef __cplusplus
}
#endif

#endif
