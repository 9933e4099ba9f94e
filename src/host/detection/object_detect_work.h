/* object_detect_work: shared definitions of the object_detect sources. Internal to the host
 * library. */
#ifndef CAIRN_HOST_OBJECT_DETECT_WORK_H
#define CAIRN_HOST_OBJECT_DETECT_WORK_H

#include "cairn/curve.h"
#include "cairn/object_detect.h"
#include "src/host/detection/contour_search_fit.h"

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
    cairn_curve *curves; /* [count] */
    cairn_vec2 *points;
    int32_t count;
    cairn_real max_length; /* px, greatest length of a chain */
} object_detect_chains;

struct cairn_object_detect_field {
    const cairn_contour_search_tokens *tokens;
    cairn_object_detect_params params;
    object_detect_level level[OBJECT_DETECT_MAX_LEVELS];
    int32_t levels;
    object_detect_chains chains;
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

/* Computes the scores of a box by its appearance. */
static inline cairn_appearance_result
cairn_object_detect_appearance_of(const cairn_object_detect_field *field, const cairn_real box[4])
{
    cairn_appearance_field *appearance = field->params.appearance;
    cairn_budget budget = {CAIRN_UNBOUNDED};

    if (cairn_appearance_begin_box(appearance, box) == CAIRN_OK)
        while (cairn_appearance_step(appearance, &budget) == CAIRN_MORE)
            budget.left = CAIRN_UNBOUNDED;
    return cairn_appearance_read(appearance);
}

/* Reports the start of a stage to the callback. */
static inline void cairn_object_detect_report_stage(const cairn_object_detect_field *field,
                                                    cairn_object_detect_stage stage)
{
    if (field->params.on_stage != NULL)
        field->params.on_stage(field->params.on_stage_context, stage);
}

/* Greatest numbers of hypotheses of one model, and of parts of a hypothesis. */
enum { OBJECT_DETECT_MAX_HYPOTHESES = 128, OBJECT_DETECT_MAX_PARTS = 64 };
/* As written: greatest number of configurations of the model, and again of its mirror image; enough
 * for all of 20 near votes of 4 bundles for each of 48 votes. */
enum { OBJECT_DETECT_MAX_WRITTEN_HYPOTHESES = 1 << 16 };

/* An object hypothesis from matched parts. */
typedef struct object_detect_hypothesis {
    cairn_vec2 origin; /* px, position of the model's origin */
    cairn_real size;   /* px */
    cairn_real score, distance, agreement;
    cairn_real left, top, right, bottom; /* px, as written: bounding box of the fragments */
    int32_t mirrored;
    int32_t first_part, part_count; /* range in parts[] */
} object_detect_hypothesis;

typedef struct object_detect_hypotheses {
    object_detect_hypothesis *list;
    cairn_object_detect_part *parts;
    int32_t count, part_count, bundles;
} object_detect_hypotheses;

/* A grouped object and the bounding box of the model at its pose. */
typedef struct object_detect_grouping {
    cairn_contour_grouping_object found; /* first, first_outline: unused */
    cairn_real box[4];                   /* px: left, top, right, bottom */
    int32_t mirrored;
} object_detect_grouping;

/* Greatest numbers of objects of one grouping search, and of all searches (bands of sizes, for the
 * model and its mirror image). */
enum {
    OBJECT_DETECT_MAX_OBJECTS_PER_SEARCH = 12,
    OBJECT_DETECT_MAX_GROUPINGS = 22 * OBJECT_DETECT_MAX_OBJECTS_PER_SEARCH
};

typedef struct object_detect_groupings {
    object_detect_grouping *list; /* [count] by descending evidence */
    int32_t count;
} object_detect_groupings;

/* Detects the model by contour grouping among the edges of a field, over the sizes of its params.
 * CAIRN_NO_MEMORY, or as cairn_contour_grouping_begin(). The result must be freed on failure,
 * too. */
cairn_status cairn_object_detect_group(object_detect_groupings *made,
                                       const cairn_object_detect_field *field,
                                       const cairn_shape_model *model);
void cairn_object_detect_group_free(object_detect_groupings *made);

/* Returns the greatest evidence (nats) of a grouped object that coincides with a detection; 0:
 * none. */
cairn_real cairn_object_detect_grouped_evidence(const object_detect_groupings *made,
                                                const cairn_object_detection *detection);

/* Builds the polylines of all chains. Returns 0 when out of memory; the result must be freed then,
 * too. */
int cairn_object_detect_chains_make(object_detect_chains *chains,
                                    const cairn_contour_search_tokens *tokens);
void cairn_object_detect_chains_free(object_detect_chains *chains);

/* Similarity transform (x, y) -> (a x - b y, b x + a y) + shift. */
typedef struct object_detect_similarity {
    cairn_real a, b;
    cairn_vec2 shift;
} object_detect_similarity;

/* Returns the rigid (inlier) proximity: the mean weight of the inliers of one similarity transform
 * of the model outline, 0 ... 1 (object_detect_agree.c). proximity: [outline_count] edge proximity
 * of each sample; weight: [outline_count] scratch. map: the transform with the greatest agreement,
 * relative to the outline's origin and in its sizes, set when the result is > 0. Cost: about 40
 * passes over the samples. */
cairn_real cairn_object_detect_rigid_proximity(const contour_search_fitted_outline *fitted,
                                               const cairn_oriented_point *reference,
                                               const cairn_real *proximity, cairn_real *weight,
                                               object_detect_similarity *map);

/* Replaces the deformed outline by the model outline at the transform; updates the detection's
 * origin and size. */
void cairn_object_detect_place_outline(const object_detect_similarity *map,
                                       const cairn_oriented_point *reference,
                                       contour_search_fit *fit, cairn_object_detection *detection);

/* Finds hypotheses by parts. CAIRN_NO_MEMORY; CAIRN_EMPTY: an outline of zero length. On failure
 * there is nothing to free. */
cairn_status cairn_object_detect_parts(object_detect_hypotheses *made,
                                       const cairn_object_detect_field *field,
                                       const cairn_shape_model *model);
void cairn_object_detect_parts_free(object_detect_hypotheses *made);

static inline int cairn_object_detect_is_as_written(const cairn_object_detect_field *field)
{
    return field->params.mode == CAIRN_MODE_AS_WRITTEN;
}

/* As written (object_detect_written.c). Computes the bounding box of a hypothesis' fragments, and
 * samples points[count] at even steps along all of them. Returns 0 when their length is zero. */
int cairn_object_detect_written_sample(const cairn_object_detect_field *field,
                                       object_detect_hypothesis *hypothesis,
                                       const cairn_object_detect_part *parts, cairn_vec2 *points,
                                       int32_t count);
/* Hash set of sets of chains, so that hypotheses of the same chains are compared once. begin:
 * capacity: greatest number of sets; returns 0 when out of memory. add: returns 1 for a new set, 0
 * for a duplicate. */
typedef struct object_detect_chain_sets {
    /* [capacity] ascending, padded with -1 */
    int32_t (*chains)[CAIRN_PART_MAX_BUNDLES];
    /* [mask + 1] hash table: index of a set; -1: empty */
    int32_t *slots;
    uint32_t mask;
    int32_t count;
} object_detect_chain_sets;
int cairn_object_detect_chain_sets_begin(object_detect_chain_sets *sets, int32_t capacity);
int cairn_object_detect_chain_sets_add(object_detect_chain_sets *sets,
                                       const cairn_object_detect_part *parts, int32_t count);
void cairn_object_detect_chain_sets_free(object_detect_chain_sets *sets);

/* Creates a detection for every hypothesis: found->found only, on the heap. */
cairn_status cairn_object_detect_written_add(cairn_object_detections *found,
                                             const object_detect_hypotheses *made,
                                             const cairn_object_detect_field *field);
/* Adds the lines of the fragments and the model's outline at the voted centroid to the detections
 * of found->found. */
cairn_status cairn_object_detect_written_outlines(cairn_object_detections *found,
                                                  const cairn_object_detect_field *field,
                                                  const cairn_shape_model *model);

#endif
