/* silhouette: contours of an object from a picture of it, a silhouette or a line drawing of its
 * outline.
 *
 * The picture is binarized (foreground: ink). The background is the class of most pixels of the
 * picture's border. Ink that is nowhere thick is a drawing: gaps between open line ends are
 * bridged, and the largest face enclosed by its lines is the object. Thick ink is the object
 * itself. The object may have several connected components, and holes, which have outlines of their
 * own. A photograph is refused.
 *
 *     begin(picture) -> step(budget) until CAIRN_OK -> read()
 *                                    refused        -> measured()
 *
 * Image coordinates: x to the right, y down; (0, 0) is the centre of the pixel in the first column
 * and row. */
#ifndef CAIRN_SILHOUETTE_H
#define CAIRN_SILHOUETTE_H

#include "cairn/curve.h"
#include "cairn/object.h"
#include "cairn/pool.h"
#include "cairn/raster.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Greatest side of a picture in pixels: with a border of one pixel it is a raster. */
#define CAIRN_SILHOUETTE_MAX_SIDE (CAIRN_RASTER_MAX_SIDE - 2)

/* Smallest object, in pixels along the diagonal of its bounding box. */
#define CAIRN_SILHOUETTE_MIN_DIAGONAL 16

/* Greatest number of open line ends of a drawing, and of gaps between them. */
#define CAIRN_SILHOUETTE_MAX_OPEN_ENDS 254
#define CAIRN_SILHOUETTE_MAX_GAPS      (CAIRN_SILHOUETTE_MAX_OPEN_ENDS / 2)

/* How holes are treated. */
typedef int32_t cairn_silhouette_holes;
enum {
    /* traced as outlines */
    CAIRN_SILHOUETTE_HOLES_KEEP = 0,
    /* ignored */
    CAIRN_SILHOUETTE_HOLES_FILL = 1,
    /* the picture is refused */
    CAIRN_SILHOUETTE_HOLES_REFUSE = 2
};

/* Parameters; defaults in brackets. */
typedef struct cairn_silhouette_params {
    /* px, 1 ... CAIRN_SILHOUETTE_MAX_SIDE (640 and 480): largest picture. Each of its pixels takes
     * 14 bytes. */
    int32_t max_width, max_height;
    /* 1 ... 2^27 (32,768): capacity for the ink of a drawing, pixels; up to 76 bytes each */
    int32_t max_ink;
    /* 1 ... 2^28 (65,536): capacity for the points of all outlines; they take memory only beyond
     * 4 bytes for each pixel of the largest picture */
    int32_t max_points;
    /* 1 ... 64 (8): capacity for outlines */
    int32_t max_outlines;
    /* any (CAIRN_SILHOUETTE_HOLES_KEEP): treatment of holes */
    cairn_silhouette_holes holes;
    /* share of the ink's diagonal, 0 ... 1 (0.1): largest gap between open line ends that is
     * bridged */
    cairn_real max_gap;
    /* share of the largest component's area, 0 ... 1 (0.01): smallest component or hole that is
     * kept */
    cairn_real min_part;
} cairn_silhouette_params;

/* Extractor of the contours of an object, and those of its last picture. */
typedef struct cairn_silhouette cairn_silhouette;

/* Returns the default parameters. */
cairn_silhouette_params cairn_silhouette_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_silhouette_check(const cairn_silhouette_params *params,
                                                  cairn_object_fault *fault);

/* Returns the bytes that create() takes from the pool; 0 for params that create() would refuse. */
size_t cairn_silhouette_memory(const cairn_silhouette_params *params);

/* Creates the object in memory of the pool. CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_silhouette_create(cairn_silhouette **silhouette, cairn_pool *pool,
                                                   const cairn_silhouette_params *params);

/* Starts on a grey picture, and discards earlier results. The picture must stay valid until step()
 * no longer returns CAIRN_MORE. CAIRN_BAD_ARGUMENT: NULL, an invalid view. CAIRN_FULL: larger than
 * max_width or max_height. Constant time.
 *
 * grey: picture of the object */
CAIRN_CHECKED cairn_status cairn_silhouette_begin(cairn_silhouette *silhouette,
                                                  cairn_raster_u8_view grey);

/* Resumes the extraction. CAIRN_MORE: the budget is used up. CAIRN_OK: the outlines are complete,
 * or nothing was begun. The picture is refused, for the reason that measured() gives, with
 * CAIRN_BAD_FORMAT: a photograph, too many open line ends, or lines that enclose nothing;
 * CAIRN_EMPTY: one colour, or an object smaller than CAIRN_SILHOUETTE_MIN_DIAGONAL;
 * CAIRN_UNSUPPORTED: a hole where holes are refused; CAIRN_FULL: a capacity is used up. The most
 * expensive item is linear in a side of the picture. Cost: about 2 units per pixel; of drawings
 * also those of cairn_edge_chain_step(). The result does not depend on the budgets.
 *
 * Source: boundary tracing along pixel edges: Rosenfeld and Kak 1982. */
CAIRN_CHECKED cairn_status cairn_silhouette_step(cairn_silhouette *silhouette,
                                                 cairn_budget *budget);

/* Contours of an object. */
typedef struct cairn_silhouette_result {
    /* [count] Closed outlines: components by descending area, then holes by descending area. */
    const cairn_curve *outlines;
    /* [gap_count] Centres of the bridged gaps, the narrowest first. */
    const cairn_vec2 *gaps;
    /* outlines; holes among them */
    int32_t count, holes;
    /* number of gaps that were bridged; 0 for a silhouette */
    int32_t gap_count;
    /* 1: a line drawing; 0: a silhouette */
    int32_t is_drawing;
    /* components and holes below min_part, and lines of a drawing that enclose nothing */
    int32_t dropped_regions;
} cairn_silhouette_result;

/* Returns the result; empty until step() returns CAIRN_OK; the pointers are valid until the next
 * begin(). */
cairn_silhouette_result cairn_silhouette_read(const cairn_silhouette *silhouette);

/* Why a picture was refused. */
typedef int32_t cairn_silhouette_refusal;
enum {
    /* It was not refused. */
    CAIRN_SILHOUETTE_ACCEPTED = 0,
    /* CAIRN_BAD_FORMAT: many pixels are neither dark nor bright. */
    CAIRN_SILHOUETTE_PHOTOGRAPH = 1,
    /* CAIRN_BAD_FORMAT: some pixels are neither dark nor bright, and there are many specks
     * (dropped_regions). */
    CAIRN_SILHOUETTE_SPECKS = 2,
    /* CAIRN_EMPTY: one colour. */
    CAIRN_SILHOUETTE_ONE_COLOUR = 3,
    /* CAIRN_EMPTY: the ink is smaller than CAIRN_SILHOUETTE_MIN_DIAGONAL. */
    CAIRN_SILHOUETTE_TOO_SMALL = 4,
    /* CAIRN_BAD_FORMAT: more than CAIRN_SILHOUETTE_MAX_OPEN_ENDS open line ends. */
    CAIRN_SILHOUETTE_OPEN_ENDS = 5,
    /* CAIRN_BAD_FORMAT: lines that enclose nothing. */
    CAIRN_SILHOUETTE_OPEN_LINES = 6,
    /* CAIRN_UNSUPPORTED: a hole where holes are refused. */
    CAIRN_SILHOUETTE_HOLE = 7,
    /* CAIRN_FULL: more outlines than max_outlines. */
    CAIRN_SILHOUETTE_OUTLINES = 8,
    /* CAIRN_FULL: a drawing of more ink than max_ink. */
    CAIRN_SILHOUETTE_INK = 9,
    /* CAIRN_FULL: more points than max_points. */
    CAIRN_SILHOUETTE_POINTS = 10
};

/* What was measured of a picture as far as the extraction went; 0 beyond. */
typedef struct cairn_silhouette_measure {
    /* why the picture was refused */
    cairn_silhouette_refusal refusal;
    /* pixels that are neither dark nor bright */
    int32_t between;
    /* pixels of ink, before gaps are bridged */
    int32_t ink;
    /* px: sides of the bounding box of the ink */
    int32_t ink_width, ink_height;
    /* components and holes that are kept */
    int32_t regions;
    /* components and holes that are dropped */
    int32_t dropped_regions;
    /* hole that was refused: its area in pixels, column and row of its first pixel */
    int32_t hole_area, hole_x, hole_y;
    /* points of all outlines */
    int32_t points;
} cairn_silhouette_measure;

/* Returns what was measured of the last picture. */
cairn_silhouette_measure cairn_silhouette_measured(const cairn_silhouette *silhouette);

#ifdef __cplusplus
}
#endif

#endif
