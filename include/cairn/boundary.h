/* boundary: contours between the regions of an image, in colour or grey, ranked by how much parts
 * the two sides.
 *
 * On photographs a step of grey levels says little: textures are full of them. Here an edge is
 * where the *distribution* of colours about a pixel changes: of each of the three channels L, a, b
 * the mean within a window, at three scales, and the histogram within it, at two. The change of a
 * histogram h over a small way is its Fisher information 4 sum (d sqrt h)^2, the chi-squared
 * difference of the two halves of a window in the limit (Martin, Fowlkes and Malik 2004 compare the
 * halves); all changes add up in one tensor, whose larger root is the square of the pixel's
 * strength. Regions are the basins of the strengths. To the strength of a border adds what the cuts
 * that part the whole image best have there (the first eigenvectors of a graph of the regions).
 * Then the two neighbours with the weakest common border are joined until all is one (Arbelaez,
 * Maire, Fowlkes and Malik 2011, the ultrametric contour map), in five ways, and once more by the
 * mean of their levels: the level at which the two sides of a contour become one is what the
 * grouping of the whole image says of it. Contours run along the corners of pixels, from junction
 * to junction, and are ranked by that and by their own mean strength; those above any level have no
 * loose ends within the image.
 *
 *     begin(image) -> step(budget) until CAIRN_OK -> read() */
#ifndef CAIRN_BOUNDARY_H
#define CAIRN_BOUNDARY_H

#include "cairn/pool.h"
#include "cairn/raster.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_boundary_params {
    /* pixels, 1 ... 8192 (640 and 480) */
    int32_t max_width, max_height;
    /* 1 ... 2^22: basins beyond so many, the shallowest last, join their neighbours (8192) */
    int32_t max_regions;
    /* of contours that are reported, 1 ... 2^28; 2 pixels + 3 max_regions suffice (262,144) */
    int32_t max_points;
    /* pixels, 1 ... 32: half the widths of the windows of histograms, each passed over thrice (2
     * and 5); those of means are the fine one, the one between both and both together */
    int32_t fine, coarse;
    /* >= 0: weight of the change of histograms, that of means by 10 units of L, a, b being 1 (8) */
    cairn_real distribution;
    /* >= 0: what the cuts of the whole image add to borders, of the mean of their strengths
     * (0.3) */
    cairn_real global;
    /* 0 ... 1: a border's strength times the smaller side's share of the image to the powers 0
     * to 2 times this (0.1) */
    cairn_real small;
    /* 0 ... 1: power of how far the colours of both sides are apart, where that counts (0.15) */
    cairn_real contrast;
    /* >= 0: of a contour that is reported (0) */
    cairn_real min_strength;
} cairn_boundary_params;

/* Between the pixels (x - 1, y - 1) and (x, y): at (x - 1/2, y - 1/2) in image coordinates. */
typedef struct cairn_boundary_corner {
    int16_t x, y;
} cairn_boundary_corner;

typedef struct cairn_boundary_contour {
    /* corners[first ... first + count - 1], each a pixel's side from the one before */
    int32_t first, count;
    /* 1: from the last corner on to the first; 0: ends at junctions or at the image's border */
    int32_t closed;
    /* at which its two sides become one region, >= 0 */
    cairn_real level;
    /* of the strengths of its pixels, >= 0 */
    cairn_real mean;
    /* level sqrt(mean), what contours are ranked by */
    cairn_real strength;
} cairn_boundary_contour;

/* An image: rows of 8-bit samples, sRGB. Must stay until step() returns CAIRN_OK. */
typedef struct cairn_boundary_image {
    const uint8_t *samples; /* of pixel (x, y) the first is samples[y * stride + x * channels] */
    int32_t width, height;
    int32_t channels; /* 1: grey; 3: blue, green, red; 4: and one that is passed over */
    ptrdiff_t stride; /* samples, at least width * channels when there is more than one row */
} cairn_boundary_image;

typedef struct cairn_boundary cairn_boundary;

/* The values in brackets above. Weights were chosen among few, on photographs with outlines by
 * people; docs/accuracy.md says how. */
cairn_boundary_params cairn_boundary_default(void);

/* 0 for params that create() would refuse. */
size_t cairn_boundary_memory(const cairn_boundary_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_boundary_create(cairn_boundary **boundary, cairn_pool *pool,
                                                 const cairn_boundary_params *params);

/* Starts on an image; what was found before is gone. CAIRN_BAD_ARGUMENT: no samples, no such
 * channels or stride. CAIRN_FULL: larger than max_width or max_height. Time linear in
 * max_regions. */
CAIRN_CHECKED cairn_status cairn_boundary_begin(cairn_boundary *boundary,
                                                const cairn_boundary_image *image);

/* Goes on. CAIRN_MORE: the budget is used up. CAIRN_OK: the contours stand, or nothing was
 * begun. CAIRN_FULL: more than max_points; given up, and there are none. In all about 180 units
 * a pixel in colour, 120 in grey. */
CAIRN_CHECKED cairn_status cairn_boundary_step(cairn_boundary *boundary, cairn_budget *budget);

/* Empty until step() returns CAIRN_OK; valid until the next begin(). The strongest contour comes
 * first. An image of one colour is one region and has no contours. */
typedef struct cairn_boundary_result {
    /* [contour_count] */
    const cairn_boundary_contour *contours;
    /* [corner_count] */
    const cairn_boundary_corner *corners;
    int32_t contour_count, corner_count;
    /* before any are joined */
    int32_t region_count;
    /* of pixels; about 1 between colours 10 units of L, a, b apart, 4 at the clearest edges */
    cairn_raster_real_view strengths;
} cairn_boundary_result;

cairn_boundary_result cairn_boundary_read(const cairn_boundary *boundary);

#ifdef __cplusplus
}
#endif

#endif
