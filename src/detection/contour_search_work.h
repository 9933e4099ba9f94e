/* contour_search_work: shared definitions of the contour_search sources. Private to the folder
 * detection. */
#ifndef CAIRN_DETECTION_CONTOUR_SEARCH_WORK_H
#define CAIRN_DETECTION_CONTOUR_SEARCH_WORK_H

#include "cairn/contour_search.h"
#include "cairn/small_matrix.h"
#include "src/detection/contour_search_ends.h"
#include "src/detection/detection_sort.h"

/* Normal equations of a least-squares affine transform; initially zero. */
typedef struct contour_search_affine_sums {
    cairn_sym3 points;
    cairn_real right[2][3];
} contour_search_affine_sums;

/* Adds a pair of points.
 *
 * weighted: the partner of `point`, times the weight */
void cairn_contour_search_affine_add(contour_search_affine_sums *sums, cairn_vec2 point,
                                     cairn_real weight, cairn_vec2 weighted);
/* Solves for the rows of the transform; 0: singular. */
int32_t cairn_contour_search_affine_solve(const contour_search_affine_sums *sums,
                                          cairn_real map[2][3]);
/* Transforms a point. */
static inline cairn_vec2 contour_search_affine_point(cairn_real map[2][3], cairn_vec2 p)
{
    cairn_vec2 mapped = {map[0][0] * p.x + map[0][1] * p.y + map[0][2],
                         map[1][0] * p.x + map[1][1] * p.y + map[1][2]};

    return mapped;
}

/* Distance of a point to a segment, px. */
cairn_real cairn_contour_search_point_distance(cairn_segment line, cairn_vec2 p);

/* Index of the outline sample nearest to a point; *distance to it. Cost: linear. */
int32_t cairn_contour_search_nearest_sample(const cairn_oriented_point *outline, int32_t count,
                                            cairn_vec2 point, cairn_real *distance);

/* Units of the begin of a grouping in a band of sizes, and of the model's mirror image before. */
static inline int32_t contour_search_band_units(const cairn_shape_model *model)
{
    return 1 + model->sample_count + model->outline_count;
}

/* Segments that cairn_contour_search_segment_at() compares in a unit. */
enum { CONTOUR_SEARCH_LINES_PER_UNIT = 6 };

/* The listed segment that an outline sample of an object of a size (px) lies on: the nearest one
 * nearly parallel to it; -1: none. Cost: linear. */
int32_t cairn_contour_search_segment_at(const cairn_segment *lines, const int32_t *list,
                                        int32_t count, cairn_real size, cairn_oriented_point point);

/* One past the last segment of the chain whose first segment is `from`. */
int32_t cairn_contour_search_end_of_chain(const cairn_contour_search_tokens *tokens, int32_t from);

/* Checks tokens for a search with capacity for max_lines segments. CAIRN_FULL, CAIRN_BAD_ARGUMENT,
 * CAIRN_NOT_FINITE; *fault: index of the segment. Cost: linear. */
cairn_status cairn_contour_search_tokens_check(const cairn_contour_search_tokens *tokens,
                                               int32_t max_lines, cairn_fault *fault);

/* Number of bands of sizes, in each of which a search keeps only the best size at one position; and
 * the bounds of one of them, px. */
int32_t cairn_contour_search_band_count(cairn_real min_size, cairn_real max_size);
cairn_real cairn_contour_search_band_bound(cairn_real min_size, cairn_real max_size, int32_t bands,
                                           int32_t index);

/* A deformed outline, fitted to the image. */
typedef struct contour_search_fitted_outline {
    const cairn_oriented_point *outline; /* [outline_count] px */
    int32_t outline_count;
    cairn_vec2 origin; /* px */
    cairn_real size;   /* px */
} contour_search_fitted_outline;

/* Positions on the deformed outline of the gaps in the model's drawing. */
typedef struct contour_search_gaps {
    cairn_vec2 at[CAIRN_SHAPE_MODEL_MAX_GAPS]; /* px */
    int32_t count;
} contour_search_gaps;

/* Place of a segment in the order of the outline. */
typedef struct contour_search_order {
    int32_t sample, segment;
} contour_search_order;

/* Following of edges beyond the outline. */
typedef struct contour_search_extension {
    /* px, box that the midpoints of segments must lie in */
    cairn_vec2 box_min, box_max;
    /* px, greatest length of an extension */
    cairn_real max_length;
    /* least cosines of the turning angle along a chain and between chains */
    cairn_real chain_cosine, junction_cosine;
    /* extension only near the gaps */
    int32_t only_near_gaps;
    /* px, radius around a gap */
    cairn_real gap_radius;
    /* [max_lines] px, length of edges from the outline to the end of each segment; CAIRN_REAL_MAX:
     * not selected */
    cairn_real *length;
} contour_search_extension;

/* Collection of the segments of an outline: those along it, those between two of them on one chain,
 * those that continue beyond the last ones along the outline, and near the gaps also segments that
 * continue from them in any direction (contour_search_complete.c). */
typedef struct contour_search_collector {
    /* [count] result: the segments in the order of the outline */
    contour_search_order *order; /* [max_lines] */
    int32_t count;

    const cairn_contour_search_tokens *tokens;
    contour_search_fitted_outline fitted;
    contour_search_gaps gaps;
    uint8_t *selected; /* [max_lines] */
    int32_t *listed;   /* [max_lines] first and last segments of chains near the object */
    contour_search_ends ends;
    contour_search_extension extension;
    detection_sort sort;
    int32_t resume, phase_resume, units_charged;
    /* cursor: a segment, the first of a chain, or an end in the list; neighbour_count: of that end;
     * has_grown: the round has added a segment */
    int32_t listed_count, cursor, neighbour_count, round, has_grown;
} contour_search_collector;

/* Allocates the arrays; collector: NULL, from a counting pool. */
void cairn_contour_search_collector_take(contour_search_collector *collector, cairn_pool *pool,
                                         int32_t max_lines);
/* Starts. tokens and fitted->outline must stay valid. gaps: NULL, none. */
void cairn_contour_search_collect_begin(contour_search_collector *collector,
                                        const cairn_contour_search_tokens *tokens,
                                        const contour_search_fitted_outline *fitted,
                                        const contour_search_gaps *gaps);
/* Resumes. 0: the budget is used up; 1: complete. Cost: for each segment near the object 1 unit for
 * 16 outline samples every 3 px. */
int cairn_contour_search_collect_step(contour_search_collector *collector, cairn_budget *budget);

#endif
