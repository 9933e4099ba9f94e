/* object_detect_work: the edge field of object_detect, and definitions shared by its sources. Private
 * to the folder detection. */
#ifndef CAIRN_DETECTION_OBJECT_DETECT_WORK_H
#define CAIRN_DETECTION_OBJECT_DETECT_WORK_H

#include "cairn/curve.h"
#include "cairn/object_detect.h"
#include "src/detection/contour_search_fit.h"

/* Direction bins over half a turn; cells per object size; margin around the image, cells, without
 * known edges; greatest number of levels of the scale pyramid; greatest number of cells along an
 * image's side. */
enum {
    OBJECT_DETECT_BINS = CONTOUR_SEARCH_FIELD_BINS,
    OBJECT_DETECT_CELLS_PER_SIZE = 40,
    OBJECT_DETECT_MARGIN_CELLS = 28,
    OBJECT_DETECT_MAX_LEVELS = 42,
    OBJECT_DETECT_MAX_SIDE_CELLS = 2000
};

/* Log-likelihood ratios of edges for objects of one size: one level of the scale pyramid. */
typedef struct object_detect_level {
    cairn_real size, cell_size; /* px, object size and cell size */
    int32_t width, height;      /* cells of the image; rows have margins on both sides */
    /* [BINS][height + 2 MARGIN][width + 2 MARGIN] nats, log-likelihood ratio of an outline
     * sample */
    float *llr;
} object_detect_level;

/* Method PARTS: the edge chains as polylines, by chain index; chains too short for segments have no
 * points. */
typedef struct object_detect_chains {
    cairn_curve *curves; /* [count], capacity max_chains */
    cairn_vec2 *points;  /* [2 max_segments] */
    int32_t count;
} object_detect_chains;

extern const cairn_parameters cairn_object_detect_parameters;

struct cairn_object_detect_field {
    cairn_contour_search_tokens tokens;
    object_detect_level level[OBJECT_DETECT_MAX_LEVELS];
    int32_t levels;
    object_detect_chains chains;

    /* ---- While it is computed ---- */
    float *cost;      /* [cells of the first level] of one direction */
    cairn_real *sums; /* [(height + 1)][width + 1] summed-area table */
    float *strip;     /* a row or column with its margins */
    /* [max_segments] rad, and nats: direction and cost by strength of each segment */
    cairn_real *angle, *strength_cost;
    /* CAIRN_EMPTY: no image; CAIRN_MORE: under way; CAIRN_OK: complete */
    cairn_status status;
    int32_t resume, units_charged;
    int32_t cursor; /* a segment, or a row or column of cells */
    union {
        struct {
            int32_t direction_resume;
            int16_t index, bin; /* of a level, of a direction */
        };
        int32_t next_point; /* of chains.points */
    };
    cairn_object_detect_params params;
};

static inline size_t cairn_object_detect_row(const object_detect_level *level)
{
    return (size_t)level->width + 2 * OBJECT_DETECT_MARGIN_CELLS;
}

static inline size_t cairn_object_detect_layer(const object_detect_level *level)
{
    return cairn_object_detect_row(level) *
           ((size_t)level->height + 2 * OBJECT_DETECT_MARGIN_CELLS);
}

static inline int cairn_object_detect_is_as_written(const cairn_object_detect_params *params)
{
    return params->mode == CAIRN_MODE_AS_WRITTEN;
}

/* 1 when the candidates are grouped, too. */
static inline int cairn_object_detect_needs_grouping(const cairn_object_detect_params *params)
{
    return params->method == CAIRN_OBJECT_DETECT_EVIDENCE &&
           (params->occluded || params->verify > 0);
}

/* The levels of the pyramid for the sizes of the params and images of a size: sizes and cells.
 * Returns their number; of images up to max_width and max_height. */
int32_t cairn_object_detect_set_levels(object_detect_level *level,
                                       const cairn_object_detect_params *params, int32_t width,
                                       int32_t height);

/* Builds the polyline of one chain (object_detect_parts.c): the consecutive segments from ... to - 1
 * of it, into points. */
void cairn_object_detect_add_chain(object_detect_chains *chains,
                                   const cairn_contour_search_tokens *tokens, int32_t from,
                                   int32_t to, cairn_vec2 *points);

#endif
