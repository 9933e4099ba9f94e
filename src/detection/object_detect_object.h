/* object_detect_object: the detector, shared by the sources of object_detect. Private to the folder
 * detection. */
#ifndef CAIRN_DETECTION_OBJECT_DETECT_OBJECT_H
#define CAIRN_DETECTION_OBJECT_DETECT_OBJECT_H

#include "cairn/fragment_match.h"
#include "cairn/part_configuration.h"
#include "cairn/shape_context.h"
#include "src/detection/object_detect_work.h"

/* Aspect ratios of the model that are searched. */
enum { OBJECT_DETECT_ASPECTS = 5 };

/* A variant of the model: an aspect ratio, mirrored or not. */
typedef struct object_detect_variant {
    cairn_oriented_point *outline; /* [count] */
    float box[4];                  /* left, top, right, bottom of the outline, in sizes */
    int32_t mirrored;
} object_detect_variant;

/* A candidate. */
typedef struct object_detect_peak {
    /* nats: score with the size prior, and log-likelihood ratio of the undeformed outline */
    float score, rigid;
    float x, y, size; /* px */
    int32_t variant;
    float turn;         /* rad, rotation */
    int32_t hypothesis; /* hypothesis by parts; -1: none */
} object_detect_peak;

/* Greatest numbers of hypotheses of one model, and of parts of a hypothesis. */
enum { OBJECT_DETECT_MAX_HYPOTHESES = 128, OBJECT_DETECT_MAX_PARTS = 64 };
/* As written: greatest number of configurations of the model, and again of its mirror image; enough
 * for all of 20 near votes of 4 bundles for each of 48 votes. */
enum { OBJECT_DETECT_MAX_WRITTEN_HYPOTHESES = 1 << 16 };
/* Points of the outline, and as written of a hypothesis, for the comparison; points of all parts of
 * a configuration. */
enum { OBJECT_DETECT_OUTLINE_POINTS = 64, OBJECT_DETECT_PART_POINTS = 128 };

/* An object hypothesis from matched parts. */
typedef struct object_detect_hypothesis {
    cairn_vec2 origin; /* px, position of the model's origin */
    cairn_real size;   /* px */
    cairn_real score, distance, agreement;
    cairn_real left, top, right, bottom; /* px, as written: bounding box of the fragments */
    int32_t mirrored;
    int32_t first_part, part_count; /* range in parts[] */
} object_detect_hypothesis;

/* Hash set of sets of chains, so that hypotheses of the same chains are compared once, as
 * written. */
typedef struct object_detect_chain_sets {
    /* [capacity] ascending, padded with -1 */
    int32_t (*chains)[CAIRN_PART_MAX_BUNDLES];
    /* [mask + 1] hash table: index of a set; -1: empty */
    int32_t *slots;
    uint32_t mask;
    int32_t count;
} object_detect_chain_sets;

/* Search for hypotheses by parts (object_detect_parts.c). */
typedef struct object_detect_part_search {
    object_detect_hypothesis *list; /* [count] */
    cairn_object_detect_part *parts;
    int32_t count, part_count, bundles;

    cairn_part_bundle_builder *builder;
    cairn_fragment_matcher *matcher;
    cairn_part_configurator *configurator;
    cairn_shape_context *context;
    cairn_vec2 *first_outline;            /* [max_outline] */
    cairn_oriented_point *samples;        /* mirrored samples of the fragments */
    cairn_part_configuration_vote *votes; /* [fragments * matches] */
    int32_t *match_of;                    /* [fragments * matches] match of each vote */
    object_detect_chain_sets sets;
    cairn_part_bundle_model model; /* fragments of the model or of its mirror image */
    cairn_vec2 outline[OBJECT_DETECT_OUTLINE_POINTS];
    int32_t outline_count;
    cairn_vec2 points[OBJECT_DETECT_PART_POINTS]; /* of the hypothesis that is compared */
    cairn_fragment_match_result matches;
    cairn_part_configuration_result configurations;
    /* cursor: a configuration */
    int32_t resume, compare_resume, units_charged, mirrored, cursor;
} object_detect_part_search;

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

/* Detection of the model by contour grouping (object_detect_group.c). */
typedef struct object_detect_group_search {
    object_detect_grouping *list; /* [count] by descending evidence, after the last step */
    int32_t count;
    cairn_contour_grouping *grouping;
    cairn_shape_model mirrored_model;
    cairn_shape_model_sample *samples; /* [max_samples] of the mirror image */
    cairn_oriented_point *outline;     /* [max_outline] of the mirror image */
    detection_sort sort;
    int32_t resume, units_charged, mirrored, bands, band;
} object_detect_group_search;

/* Rigid proximity: the mean weight of the inliers of one similarity transform of the model outline,
 * 0 ... 1 (object_detect_agree.c). */
typedef struct object_detect_agreement {
    /* mean weight of the best transform, relative to the outline's origin and in its sizes, and that
     * transform where the weight is above 0 */
    cairn_real best;
    cairn_similarity map;
    cairn_real *weight; /* [max_outline] */
    contour_search_fitted_outline fitted;
    const cairn_oriented_point *reference; /* [outline_count] */
    const cairn_real *proximity;           /* [outline_count] edge proximity of each sample */
    int32_t resume, start, units_charged;
} object_detect_agreement;

/* Score map of a variant of the model at a level, while its peaks are collected. */
typedef struct object_detect_map {
    int32_t level, variant, sample, row;
    /* layer of the level that the sample looks at, and its shift, cells */
    int32_t dx, dy;
    const float *layer;
} object_detect_map;

/* A candidate while it is refined. */
typedef struct object_detect_candidate {
    int32_t index;
    cairn_real segment_length; /* px, of the segments copied so far */
    cairn_shape_model model;   /* its variant of the model */
} object_detect_candidate;

struct cairn_object_detector {
    cairn_object_detections result;

    /* ---- Of an image and a model ---- */
    cairn_object_detect_field *field;
    const cairn_shape_model *model;
    /* below 0: the error that ends the detection */
    cairn_status status;
    int32_t is_pending, is_complete, units_charged;
    /* Resume points: of the whole, of its mode, of a phase, of an item, of a score of appearance. */
    int32_t resume, mode_resume, phase_resume, item_resume, appearance_resume;
    /* Item of a loop; of peaks or detections: those kept by non-maximum suppression. */
    int32_t cursor, kept;
    union {
        object_detect_map map;
        object_detect_candidate candidate;
    };
    detection_sort sort;

    /* ---- Candidates ---- */
    cairn_oriented_point *outlines; /* outlines of all variants */
    object_detect_variant variants[2 * OBJECT_DETECT_ASPECTS];
    int32_t variant_count, count;
    object_detect_peak *peaks; /* [count], capacity max_peaks */
    float *sum;                /* [cells of a level] score map */
    object_detect_part_search parts;
    object_detect_group_search group;

    /* ---- Refinement ---- */
    contour_search_refinement refinement;
    object_detect_agreement agreement;
    cairn_object_detect_params params;
};

/* The detection of the current candidate or hypothesis, behind those that were kept. */
static inline cairn_object_detection *
cairn_object_detect_current(const cairn_object_detector *detector)
{
    return &detector->result.found[detector->result.count];
}

/* Reports the start of a stage to the callback. */
static inline void cairn_object_detect_report_stage(const cairn_object_detector *detector,
                                                    cairn_object_detect_stage stage)
{
    if (detector->params.on_stage != NULL)
        detector->params.on_stage(detector->params.on_stage_context, stage);
}

/* Steps return 1 when they are complete; 0 when the budget is used up, or when detector->status was
 * set to an error. */

/* ---- object_detect_keep.c ---- */

/* Copies the scores of a hypothesis by parts. */
void cairn_object_detect_set_part_scores(const object_detect_hypothesis *hypothesis,
                                         cairn_object_detection *detection);
/* Adds the appearance of the current detection's box to its score, and keeps the detection when its
 * score before is high enough. */
int cairn_object_detect_keep_step(cairn_object_detector *detector, cairn_budget *budget);

/* ---- object_detect_candidates.c ---- */

/* Creates the variants of the model and its mirror image. */
void cairn_object_detect_variants_add(cairn_object_detector *detector);
/* Returns 1 when all variants of the outline are inside the margins of a field. */
int cairn_object_detect_variants_are_inside_margin(const cairn_shape_model *model);
/* Collects the peaks of the score maps of all levels and variants. */
int cairn_object_detect_peaks_step(cairn_object_detector *detector, cairn_budget *budget);
/* Makes peaks of the hypotheses by parts. */
void cairn_object_detect_peaks_of_parts(cairn_object_detector *detector);
/* Starts to sort the peaks; then non-maximum suppression. */
void cairn_object_detect_sort_peaks(cairn_object_detector *detector);
int cairn_object_detect_suppress_step(cairn_object_detector *detector, cairn_budget *budget);

/* ---- object_detect_group.c ---- */

/* Allocates the arrays and the grouping; group: NULL, from a counting pool. */
void cairn_object_detect_group_take(object_detect_group_search *group, cairn_pool *pool,
                                    const cairn_object_detect_params *params);
/* Starts to detect the model by contour grouping over the sizes of the params. */
void cairn_object_detect_group_begin(cairn_object_detector *detector);
/* Resumes. Errors of cairn_contour_grouping_begin() and _step(). */
int cairn_object_detect_group_step(cairn_object_detector *detector, cairn_budget *budget);
/* Returns the greatest evidence (nats) of a grouped object that coincides with a detection; 0:
 * none. */
cairn_real cairn_object_detect_grouped_evidence(const object_detect_group_search *group,
                                                const cairn_object_detection *detection);

/* ---- object_detect_agree.c ---- */

/* Starts. fitted, reference and proximity must stay valid. */
void cairn_object_detect_agree_begin(object_detect_agreement *agreement,
                                     const contour_search_fitted_outline *fitted,
                                     const cairn_oriented_point *reference,
                                     const cairn_real *proximity);
/* Resumes. Cost: 9 items of 4 units for each sample. */
int cairn_object_detect_agree_step(object_detect_agreement *agreement, cairn_budget *budget);
/* Replaces the deformed outline by the model outline at the transform; updates the detection's
 * origin and size. */
void cairn_object_detect_place_outline(const cairn_similarity *map,
                                       const cairn_oriented_point *reference,
                                       contour_search_fit *fit, cairn_object_detection *detection);

/* ---- object_detect_parts.c, object_detect_written.c ---- */

/* Allocates the arrays and the nested objects; search: NULL, from a counting pool. */
void cairn_object_detect_parts_take(object_detect_part_search *search, cairn_pool *pool,
                                    const cairn_object_detect_params *params);
/* Starts on the model. Statuses of cairn_part_bundle_begin(). */
cairn_status cairn_object_detect_parts_begin(cairn_object_detector *detector);
int cairn_object_detect_parts_step(cairn_object_detector *detector, cairn_budget *budget);

/* As written: computes the bounding box of a hypothesis' fragments, and samples points[count] at
 * even steps along all of them. Returns 0 when their length is zero. */
int cairn_object_detect_written_sample(const cairn_object_detect_field *field,
                                       object_detect_hypothesis *hypothesis,
                                       const cairn_object_detect_part *parts, cairn_vec2 *points,
                                       int32_t count);
/* Empties the sets; adds one: returns 1 for a new set, 0 for a duplicate. */
void cairn_object_detect_chain_sets_clear(object_detect_chain_sets *sets);
int cairn_object_detect_chain_sets_add(object_detect_chain_sets *sets,
                                       const cairn_object_detect_part *parts, int32_t count);
/* Creates a detection for every hypothesis. */
int cairn_object_detect_written_step(cairn_object_detector *detector, cairn_budget *budget);
/* Adds the lines of the fragments and the model's outline at the voted centroid to the detections.
 * CAIRN_FULL: more than max_detections. */
int cairn_object_detect_written_outlines_step(cairn_object_detector *detector,
                                              cairn_budget *budget);

#endif
