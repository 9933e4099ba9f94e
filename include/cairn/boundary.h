/* boundary: contour detection by region segmentation (ultrametric contour map) of a colour or grey
 * image.
 *
 * Method:
 * 1. Local cues. For each channel L, a, b: window means at three scales and window histograms at
 *    two. An edge is a change of the colour distribution, since textures have many grey-level
 *    steps.
 * 2. Gradient. The change of a histogram h is its Fisher information 4 sum (d sqrt h)^2, the limit
 *    of the chi-squared difference of two half-windows (Martin, Fowlkes and Malik 2004). All
 *    changes add up in one structure tensor. The edge strength of a pixel is the square root of its
 *    larger eigenvalue.
 * 3. Oversegmentation by the watershed transform: regions are the catchment basins of the
 *    strengths.
 * 4. Global cue. The first eigenvectors of a region graph (normalized cuts) add to the strength of
 *    each region border.
 * 5. Hierarchical region merging. The two neighbours with the weakest common border merge until one
 *    region remains, with five merge criteria, and once more by the geometric mean of their levels.
 *    The level at which the two sides of a contour merge is its ultrametric level.
 * 6. Contours are traced along pixel corners from junction to junction. They are ranked by level
 *    and mean strength. Contours above any level are closed or end at the image's border.
 *
 * Source: Arbelaez, Maire, Fowlkes and Malik 2011 (gPb-owt-ucm).
 *
 *     begin(image) -> step(budget) until CAIRN_OK -> read() */
#ifndef CAIRN_BOUNDARY_H
#define CAIRN_BOUNDARY_H

#include "cairn/object.h"
#include "cairn/pool.h"
#include "cairn/raster.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Parameters; defaults in brackets. */
typedef struct cairn_boundary_params {
    /* px, 1 ... 8192 (640 and 480): largest image */
    int32_t max_width, max_height;
    /* 1 ... 2^22 (8192): capacity of regions. Further basins, the shallowest last, merge with their
     * neighbours. */
    int32_t max_regions;
    /* 1 ... 2^28 (262,144): capacity of corners of all reported contours. 2 pixels + 3 max_regions
     * suffice. */
    int32_t max_corners;
    /* px, 1 ... 32 (2 and 5): half-widths of the histogram windows. Each window is a box filter
     * applied three times. The half-widths of the mean windows are the fine one, the average of
     * both, and their sum. */
    int32_t fine_half_width, coarse_half_width;
    /* >= 0 (8): weight of histogram changes. A change of a mean by 10 units of L, a, b has weight
     * 1. */
    cairn_real histogram_weight;
    /* >= 0 (0.3): weight of the spectral cue, relative to the mean border strength */
    cairn_real spectral_weight;
    /* 0 ... 1 (0.1): exponent of the smaller region's share of the image in the merge cost; the
     * merge criteria use it times 0 to 2 */
    cairn_real size_exponent;
    /* 0 ... 1 (0.15): exponent of the colour distance of both regions in the merge cost; used by
     * two of the five criteria */
    cairn_real contrast_exponent;
    /* >= 0 (0): least strength of a reported contour */
    cairn_real min_strength;
} cairn_boundary_params;

/* A pixel corner. Corner (x, y) lies between pixels (x - 1, y - 1) and (x, y), at (x - 1/2, y -
 * 1/2) in image coordinates, px. */
typedef struct cairn_boundary_corner {
    /* column and row of the corner */
    int16_t x, y;
} cairn_boundary_corner;

/* A contour between two regions, from junction to junction. */
typedef struct cairn_boundary_contour {
    /* corners[first ... first + count - 1]; consecutive corners are one pixel side apart. */
    int32_t first, count;
    /* 1: the last corner connects to the first; 0: both ends are junctions or on the image's
     * border. */
    int32_t closed;
    /* Ultrametric level: merge cost at which the two sides of the contour become one region, >=
     * 0. */
    cairn_real level;
    /* Mean edge strength of the pixels along the contour, >= 0. */
    cairn_real mean_strength;
    /* level sqrt(mean_strength), the key by which contours are ranked. */
    cairn_real strength;
} cairn_boundary_contour;

/* An image: rows of 8-bit sRGB samples. The samples must stay valid until step() returns
 * CAIRN_OK. */
typedef struct cairn_boundary_image {
    /* The first sample of pixel (x, y) is samples[y * stride + x * channels]. */
    const uint8_t *samples;
    /* Size, px. */
    int32_t width, height;
    int32_t channels; /* 1: grey; 3: blue, green, red; 4: blue, green, red and an ignored sample. */
    /* Samples from one row to the next, at least width * channels if there is more than one row. */
    ptrdiff_t stride;
} cairn_boundary_image;

/* Detector of region contours. */
typedef struct cairn_boundary cairn_boundary;

/* Returns the default parameters. The weights were chosen from a few candidates on photographs with
 * human-drawn outlines (docs/lab/skeleton.md). */
cairn_boundary_params cairn_boundary_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_boundary_check(const cairn_boundary_params *params,
                                                cairn_object_fault *fault);

/* Returns the memory of a detector in bytes; 0 for params that create() rejects. */
size_t cairn_boundary_memory(const cairn_boundary_params *params);

/* Creates a detector. CAIRN_BAD_ARGUMENT: invalid params. CAIRN_NO_MEMORY: the pool is too
 * small. */
CAIRN_CHECKED cairn_status cairn_boundary_create(cairn_boundary **boundary, cairn_pool *pool,
                                                 const cairn_boundary_params *params);

/* Starts on an image and discards the previous result. CAIRN_BAD_ARGUMENT: no samples,
 * unsupported channels or stride. CAIRN_FULL: larger than max_width or max_height. Cost: linear
 * in max_regions.
 *
 * image: grey or colour image */
CAIRN_CHECKED cairn_status cairn_boundary_begin(cairn_boundary *boundary,
                                                const cairn_boundary_image *image);

/* Resumes the computation. CAIRN_MORE: the budget is used up. CAIRN_OK: the contours are
 * complete, or nothing was begun. CAIRN_FULL: more than max_corners; aborted without a result.
 * Cost: about 180 units a pixel in colour, 120 in grey. */
CAIRN_CHECKED cairn_status cairn_boundary_step(cairn_boundary *boundary, cairn_budget *budget);

/* The contours, sorted by decreasing strength. Empty until step() returns CAIRN_OK; valid until
 * the next begin(). An image of one colour is one region and has no contours. */
typedef struct cairn_boundary_result {
    /* [contour_count] */
    const cairn_boundary_contour *contours;
    /* [corner_count] */
    const cairn_boundary_corner *corners;
    /* Numbers of contours and of corners. */
    int32_t contour_count, corner_count;
    /* Number of regions of the oversegmentation, before merging. */
    int32_t region_count;
    /* Edge strength of each pixel; about 1 between colours 10 units of L, a, b apart, 4 at the
     * clearest edges. */
    cairn_raster_real_view strengths;
} cairn_boundary_result;

/* Returns the contours; all zero until step() returns CAIRN_OK. */
cairn_boundary_result cairn_boundary_read(const cairn_boundary *boundary);

#ifdef __cplusplus
}
#endif

#endif
