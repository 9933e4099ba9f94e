/* object_detect_work: what the parts of object_detect share. Internal to the host library. */
#ifndef CAIRN_HOST_OBJECT_DETECT_WORK_H
#define CAIRN_HOST_OBJECT_DETECT_WORK_H

#include "cairn/curve.h"
#include "cairn/object_detect.h"
#include "src/host/contour_search_fit.h"

/* Directions over half a turn; cells along an object's size, and round the picture, where no
 * edge is known; sizes from the least to the largest that there may be; cells along a picture's
 * side at most. */
enum {
    DETECT_BINS = CONTOUR_FIELD_BINS,
    DETECT_CELLS_PER_SIZE = 40,
    DETECT_MARGIN_CELLS = 28,
    DETECT_MAX_PLANES = 42,
    DETECT_MAX_SIDE_CELLS = 2000
};

/* What edges are worth for objects of one size. */
typedef struct detect_plane {
    cairn_real size, cell_size; /* px */
    int32_t width, height;      /* cells of the picture; rows have margins on both sides */
    float *llr;                 /* [BINS][height + 2 MARGIN][width + 2 MARGIN] */
} detect_plane;

/* PARTS: the chains of the edges as polylines, by their numbers; those that are too short for
 * segments have no points. */
typedef struct detect_chains {
    cairn_curve *curves; /* [count] */
    cairn_vec2 *points;
    int32_t count;
    cairn_real max_length; /* px */
} detect_chains;

struct cairn_detect_field {
    const cairn_contour_tokens *tokens;
    cairn_object_detect_params params;
    detect_plane plane[DETECT_MAX_PLANES];
    int32_t planes;
    detect_chains chains;
};

static inline size_t cairn_detect_row(const detect_plane *plane)
{
    return (size_t)plane->width + 2 * DETECT_MARGIN_CELLS;
}

static inline size_t cairn_detect_layer(const detect_plane *plane)
{
    return cairn_detect_row(plane) * ((size_t)plane->height + 2 * DETECT_MARGIN_CELLS);
}

static inline void cairn_detect_report_stage(const cairn_detect_field *field,
                                             cairn_detect_stage stage)
{
    if (field->params.on_stage != NULL)
        field->params.on_stage(field->params.on_stage_context, stage);
}

/* Hypotheses of one model at most, and parts of each. */
enum { DETECT_MAX_HYPOTHESES = 128, DETECT_MAX_PARTS = 64 };
/* As written: configurations of the model at most, and again of its mirror image: all that 20
 * near votes of 4 bundles make for each of 48 votes. */
enum { DETECT_MAX_WRITTEN_HYPOTHESES = 1 << 16 };

/* An object by its parts. */
typedef struct detect_hypothesis {
    cairn_vec2 origin; /* px, of the model */
    cairn_real size;   /* px */
    cairn_real score, distance, agreement;
    cairn_real left, top, right, bottom; /* px, as written: the box about the fragments */
    int32_t mirrored;
    int32_t first_part, part_count; /* of parts[] */
} detect_hypothesis;

typedef struct detect_hypotheses {
    detect_hypothesis *list;
    cairn_detected_part *parts;
    int32_t count, part_count, bundles;
} detect_hypotheses;

/* What was grouped: where, and the box of the model there. */
typedef struct detect_grouping {
    cairn_grouped_object found; /* first, along: nothing */
    double box[4];              /* px: left, top, right, bottom */
    int32_t mirrored;
} detect_grouping;

/* Objects of one search of the grouping, and searches (bands of sizes, the model as it is and
 * mirrored) at most. */
enum {
    DETECT_MAX_OBJECTS_PER_SEARCH = 12,
    DETECT_MAX_GROUPINGS = 22 * DETECT_MAX_OBJECTS_PER_SEARCH
};

typedef struct detect_groupings {
    detect_grouping *list; /* [count] most evidence first */
    int32_t count;
} detect_groupings;

/* Groups the model's contour among the edges of a field, in the sizes of its params.
 * CAIRN_NO_MEMORY, or as cairn_grouping_begin(). On failure there is something to free, too. */
cairn_status cairn_detect_group(detect_groupings *made, const cairn_detect_field *field,
                                const cairn_shape_model *model);
void cairn_detect_group_free(detect_groupings *made);

/* The most evidence of what is grouped where a detection is; 0: nothing is. */
cairn_real cairn_detect_grouped_evidence(const detect_groupings *made, const cairn_detection *o);

/* 0: there is no memory; then, too, there is something to free. */
int cairn_detect_chains_make(detect_chains *chains, const cairn_contour_tokens *tokens);
void cairn_detect_chains_free(detect_chains *chains);

/* The similarity map x -> (a x - b y, b x + a y) + shift. */
typedef struct detect_similarity {
    cairn_real a, b;
    cairn_vec2 shift;
} detect_similarity;

/* How much of an outline agrees on one map of the drawn one, 0 ... 1 (object_detect_agree.c).
 * near: [outline_count] how near an edge is to each sample; weight: [outline_count] is
 * overwritten. map: where most of the outline agrees that it lies, from its origin in its sizes,
 * when it is > 0. Cost: some 40 passes over the samples. */
cairn_real cairn_detect_rigid_proximity(const contour_fitted_outline *laid,
                                        const cairn_oriented_point *drawn, const cairn_real *near,
                                        cairn_real *weight, detect_similarity *map);

/* Lays the drawn outline there in place of the bent one; origin and size of the detection become
 * those. */
void cairn_detect_place_outline(const detect_similarity *laid, const cairn_oriented_point *drawn,
                                contour_fit *fit, cairn_detection *o);

/* CAIRN_NO_MEMORY, CAIRN_EMPTY: an outline without length. On failure there is nothing to free. */
cairn_status cairn_detect_parts(detect_hypotheses *made, const cairn_detect_field *field,
                                const cairn_shape_model *model);
void cairn_detect_parts_free(detect_hypotheses *made);

static inline int cairn_detect_is_as_written(const cairn_detect_field *field)
{
    return field->params.mode == CAIRN_MODE_AS_WRITTEN;
}

/* As written (object_detect_written.c). The fragments of a hypothesis: its box, and
 * points[count] at even steps along all of them. 0: they have no length. */
int cairn_detect_written_sample(const cairn_detect_field *field, detect_hypothesis *h,
                                const cairn_detected_part *parts, cairn_vec2 *points,
                                int32_t count);
/* Sets of chains that hypotheses are made of, so that each is compared once. begin: 0: there is
 * no memory; room: sets at most. add: 1: it is a new one, 0: it was added before. */
typedef struct detect_chain_sets {
    /* [room] ascending, behind the last -1 */
    int32_t (*chains)[CAIRN_PART_BUNDLES];
    /* [mask + 1] of the hash table: index of a set; -1: none */
    int32_t *slots;
    uint32_t mask;
    int32_t count;
} detect_chain_sets;
int cairn_detect_chain_sets_begin(detect_chain_sets *sets, int32_t room);
int cairn_detect_chain_sets_add(detect_chain_sets *sets, const cairn_detected_part *parts,
                                int32_t count);
void cairn_detect_chain_sets_free(detect_chain_sets *sets);

/* Detections of all hypotheses: found->found alone, from the heap. */
cairn_status cairn_detect_written_add(cairn_detections *found, const detect_hypotheses *made,
                                      const cairn_detect_field *field);
/* The lines of the fragments, and the model's outline where its centroid was voted to be; for
 * those in found->found. */
cairn_status cairn_detect_written_outlines(cairn_detections *found, const cairn_detect_field *field,
                                           const cairn_shape_model *model);

#endif
