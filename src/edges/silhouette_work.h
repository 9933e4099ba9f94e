/* Internals of the module silhouette, shared by its source files. silhouette.c describes the
 * method. */
#ifndef CAIRN_EDGES_SILHOUETTE_WORK_H
#define CAIRN_EDGES_SILHOUETTE_WORK_H

#include "cairn/edge_chain.h"
#include "cairn/silhouette.h"
#include "src/base/object.h"
#include "src/base/step.h"

/* Pixels of a pass over a row, and regions of a pass over all of them, for one work unit. */
enum { SILHOUETTE_PIXELS_PER_UNIT = 16, SILHOUETTE_REGIONS_PER_UNIT = 8 };

/* Open ends of a drawing, with those of the chain by which it has too many. */
enum { SILHOUETTE_END_CAPACITY = CAIRN_SILHOUETTE_MAX_OPEN_ENDS + 2 };

/* A connected component of ink and enclosed faces. */
typedef struct silhouette_component {
    /* first pixel in row order; pixels in all; pixels of ink */
    int32_t first, area, ink;
    /* label of its largest face, 0: none */
    int32_t largest_face;
} silhouette_component;

/* A connected component of the background that is enclosed by ink. */
typedef struct silhouette_face {
    /* first pixel in row order; pixels */
    int32_t first, area;
} silhouette_face;

/* A region that gets an outline. */
typedef struct silhouette_region {
    int32_t label, first; /* first: index of its first pixel in row order */
    int32_t area;         /* pixels */
    int32_t is_hole;
} silhouette_region;

/* A pixel corner and the direction of the next crack: 0 east, 1 south, 2 west, 3 north. The region
 * is on the right. */
typedef struct silhouette_crack {
    int32_t x, y, heading;
} silhouette_crack;

struct cairn_silhouette {
    cairn_silhouette_params params;
    cairn_raster_u8_view grey;
    /* Columns and rows of the picture with a border of one pixel of background, which is of the
     * outside. */
    int32_t width, height;
    /* [(max_height + 2) * (max_width + 2)] each, rows of `width` pixels. 1: ink. */
    uint8_t *ink;
    /* Label of the component of the background: 0: outside, -1: ink, else from 1 in the order of
     * their first pixels. */
    int32_t *face;
    /* Label of the component of ink and enclosed faces; 0: outside. Distances before. */
    int32_t *component;
    /* Of one phase after the other: pixels that wait for the flood fill; components, then faces;
     * points of the outlines. */
    void *scratch;
    cairn_distance_map *distances;
    cairn_edge_chain_set *lines;
    /* [max_outlines] */
    silhouette_region *regions;
    cairn_curve *outlines;
    cairn_vec2 gaps[CAIRN_SILHOUETTE_MAX_GAPS];
    cairn_edge_chain_pixel ends[SILHOUETTE_END_CAPACITY];
    int32_t end_count, gap_count;
    /* regions that are kept; holes among them */
    int32_t region_count, hole_count;
    /* row of a pass, column in it; region, chain or end */
    int32_t y, x, cursor;
    union {
        /* ink */
        struct {
            int32_t darkest, brightest;
            /* pixels of the picture's border, bright ones among them */
            int32_t border, bright_border;
            /* bounding box of the ink */
            int32_t left, right, top, bottom;
        };
        /* pixels: greatest L1 distance of ink to the background */
        int32_t thickness;
        /* the closest pair of open ends: squared distance, indices; -1: none */
        struct {
            int32_t gap_squared, gap_ends[2];
        };
        /* regions */
        struct {
            /* flood fill: labels that are filled, the label, neighbours that belong to a pixel's
             * component, waiting pixels */
            int32_t *labels;
            int32_t label, neighbours, waiting;
            /* numbers of labels; those seen in the pass that measures them */
            int32_t component_count, face_count, seen_components, seen_faces;
            /* area of the largest component; regions beyond max_outlines */
            int32_t largest_area, excess;
        };
        /* tracing */
        struct {
            silhouette_crack start, at;
            int32_t is_stored, is_following;
            /* points so far, those before the outline; point that is smoothed */
            int32_t point_count, first_point, point;
            /* points as traced: the two before the smoothed one, the first two of the outline */
            cairn_vec2 before[2], head[2];
        };
    };
    int32_t is_drawing;
    cairn_silhouette_measure measure;
    /* CAIRN_MORE: in work; CAIRN_OK: the result is complete; else there is none */
    cairn_status status;
    /* resume points of the extraction, of the labelling and of a phase */
    int32_t resume, label_resume, phase_resume;
    /* work units charged for the current item */
    int32_t units_charged;
};

/* Work units of a pass over a row. */
static inline int32_t silhouette_row_units(const cairn_silhouette *s)
{
    return (s->width + SILHOUETTE_PIXELS_PER_UNIT - 1) / SILHOUETTE_PIXELS_PER_UNIT;
}

/* Squared diagonal of the bounding box of the ink, pixels^2. */
static inline int64_t silhouette_squared_diagonal(const cairn_silhouette *s)
{
    return (int64_t)s->measure.ink_width * s->measure.ink_width +
           (int64_t)s->measure.ink_height * s->measure.ink_height;
}

/* Ends the extraction. */
static inline void silhouette_refuse(cairn_silhouette *s, cairn_silhouette_refusal refusal,
                                     cairn_status status)
{
    s->measure.refusal = refusal;
    s->status = status;
}

/* ---- Phases: each returns 1 when done and 0 when the budget is used up; a refusal sets the
 * status ---- */

/* silhouette_ink.c: binarization into ink; the bounding box of the ink. */
int cairn_silhouette_binarize(cairn_silhouette *s, cairn_budget *budget);

/* silhouette_ink.c: whether the ink is a drawing. */
int cairn_silhouette_measure_lines(cairn_silhouette *s, cairn_budget *budget);

/* silhouette_lines.c: bridges gaps between open line ends, the narrowest first. */
int cairn_silhouette_bridge(cairn_silhouette *s, cairn_budget *budget);

/* silhouette_regions.c: connected-component labelling. */
int cairn_silhouette_label(cairn_silhouette *s, cairn_budget *budget);

/* silhouette_regions.c: selects the regions that get outlines. */
int cairn_silhouette_select(cairn_silhouette *s, cairn_budget *budget);

/* silhouette_trace.c: traces and smooths the outlines. */
int cairn_silhouette_trace(cairn_silhouette *s, cairn_budget *budget);

#endif
