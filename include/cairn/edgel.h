/* edgel: sub-pixel edge detection. Edge points (edgels) at sub-pixel positions, with edge
 * directions from third-order derivatives.
 *
 * Edges are the maxima of the gradient magnitude of the smoothed image I in the direction of the
 * gradient. There the second directional derivative vanishes, up to a factor F = Ix^2 Ixx + 2 Ix Iy
 * Ixy + Iy^2 Iyy. The edge is the zero-crossing line F = 0. Its normal is the gradient of F, which
 * follows curves that the gradient of I itself blurs (Adluru 2008, section 3.1, reference 244).
 * Image coordinates: x to the right, y down; (0, 0) is the centre of the pixel in the first column
 * and row. */
#ifndef CAIRN_EDGEL_H
#define CAIRN_EDGEL_H

#include "cairn/geometry.h"
#include "cairn/object.h"
#include "cairn/pool.h"
#include "cairn/raster.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Edge point with subpixel position and direction. */
typedef struct cairn_edgel {
    /* px */
    cairn_vec2 position;
    /* unit vector across the edge, towards the brighter side */
    cairn_vec2 normal;
    /* grey levels per px, gradient magnitude of the smoothed image */
    cairn_real gradient_magnitude;
} cairn_edgel;

/* Parameters; defaults in brackets. */
typedef struct cairn_edgel_params {
    /* px, 1 ... CAIRN_RASTER_MAX_SIDE (640 and 480): largest image */
    int32_t max_width, max_height;
    /* 1 ... 2^28 (40,000): capacity for edgels */
    int32_t max_edgels;
    /* px, 0.7 ... 8 (1.5): standard deviation of the Gaussian; more suppresses noise and detail */
    cairn_real sigma;
    /* grey levels per px, > 0 (2): least gradient magnitude of an edge */
    cairn_real min_gradient;
    /* rad, > 0, <= pi/2 (60 degrees): greatest angle between the normal and the gradient of an
     * edge */
    cairn_real max_normal_angle;
} cairn_edgel_params;

/* Detector of edgels, and the edgels of its last image. */
typedef struct cairn_edgel_set cairn_edgel_set;

/* Returns the default parameters. */
cairn_edgel_params cairn_edgel_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_edgel_check(const cairn_edgel_params *params,
                                             cairn_object_fault *fault);

/* Returns the bytes that create() takes from the pool; 0 for params that create() would refuse. */
size_t cairn_edgel_memory(const cairn_edgel_params *params);

/* Creates an edgel set in the pool. CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_edgel_create(cairn_edgel_set **set, cairn_pool *pool,
                                              const cairn_edgel_params *params);

/* Starts on a grey-level image and discards earlier results. The image must stay valid until step()
 * returns CAIRN_OK. Its border pixels are replicated beyond the border. CAIRN_BAD_ARGUMENT: an
 * invalid view. CAIRN_FULL: larger than max_width or max_height. Constant time.
 *
 * grey: grey-level image */
CAIRN_CHECKED cairn_status cairn_edgel_begin(cairn_edgel_set *set, cairn_raster_u8_view grey);

/* Resumes the detection, row by row. CAIRN_MORE: the budget is exhausted. CAIRN_OK: the edgels are
 * complete, or nothing was begun. CAIRN_FULL: more than max_edgels; the detection ends without
 * edgels. Cost: about 3 + 2.2 sigma units per pixel. */
CAIRN_CHECKED cairn_status cairn_edgel_step(cairn_edgel_set *set, cairn_budget *budget);

/* Returns the edgels in order of their rows, about one per pixel along an edge; NULL until step()
 * returns CAIRN_OK; valid until the next begin(). *count, when not NULL, is their number. */
const cairn_edgel *cairn_edgel_list(const cairn_edgel_set *set, int32_t *count);

#ifdef __cplusplus
}
#endif

#endif
