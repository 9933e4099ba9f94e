/* object_detect: detection of objects of a class in the edges of an image, from one model of the
 * outline.
 *
 * Method EVIDENCE is template matching over a scale pyramid, a probabilistic form of oriented
 * chamfer matching: at every position, size and aspect ratio the template's score is the
 * log-likelihood ratio of the edges along the model's outline against background clutter. The best
 * candidates are refined by deforming the outline to the edges (contour_search), and verified by
 * contour grouping. Method PARTS generates candidates as the thesis does: fragments of the outline
 * are matched to edge chains and vote for the object's position (generalized Hough transform).
 * Image coordinates, pixels. Formula and constants of the score: docs/architecture.md.
 *
 * Two objects, both stepped: a field holds the edges of an image, once for all models; a detector
 * detects one model after the other in it. On a desktop object_detect_run runs both with memory of
 * the heap that fits the image.
 *
 * Limits: objects are upright, within the given sizes, and have an aspect ratio of about 0.64 to
 * 1.56 times the model's; the deformation starts from there.
 *
 * As written (CAIRN_MODE_AS_WRITTEN): the hypotheses are all configurations of the K nearest of all
 * votes, pruned by their summed similarity. They are ranked by the shape context distance of their
 * edge fragments to the whole outline, with appearance by eq. 5.1. Boxes are the bounding boxes of
 * the fragments. No outline is deformed, grouped or verified, and no mirror image is searched.
 * Choices where the text leaves details open:
 * - those of part_bundle, fragment_match and part_configuration;
 * - configurations with a sum of similarity below 0.5 are pruned; of the rest the 65,536 greatest
 *   are kept. That exceeds the number that K = 20 near votes of 4 bundles give;
 * - a match votes whatever its similarity, but within the searched sizes;
 * - configurations of the same edge fragments are one hypothesis, that of the greatest sum;
 * - the shape of a hypothesis is its whole edge fragments, 64 even points against 64 of the
 *   outline, without warping first;
 * - the distance is the sum of the mean costs of the best matches in both directions (Belongie et
 *   al. 2002);
 * - non-maximum suppression keeps the best of the boxes whose intersection over union exceeds
 *   `overlap`;
 * - d_app of eq. 5.1 is the distance to the nearest positive support vector, the word histograms
 *   of the training set that the model keeps, as in the experiments (section 5.4.2); with
 *   `appearance_nearest` 0 it is 1 - the probability of the support vector machine (section
 *   5.3.2). */
#ifndef CAIRN_OBJECT_DETECT_H
#define CAIRN_OBJECT_DETECT_H

#include "cairn/appearance.h"
#include "cairn/contour_search.h"
#include "cairn/object.h"
#include "cairn/part_bundle.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Method of detection. */
typedef int32_t cairn_object_detect_method;
enum {
    /* template matching at all positions and sizes, scored by log-likelihood ratio */
    CAIRN_OBJECT_DETECT_EVIDENCE = 0,
    /* configurations of parts, ranked by shape contexts (Adluru 2008, chapter 5) */
    CAIRN_OBJECT_DETECT_PARTS = 1
};

/* Bundles of a model's fragments in method PARTS. */
typedef int32_t cairn_object_detect_bundles;
enum {
    /* at most one fragment per bundle */
    CAIRN_OBJECT_DETECT_BUNDLES = 0,
    /* only the longest fragment of each bundle is matched */
    CAIRN_OBJECT_DETECT_BUNDLES_OF_ONE = 1,
    /* each fragment is a bundle of its own */
    CAIRN_OBJECT_DETECT_NO_BUNDLES = 2
};

/* Stages of a search, in order; method PARTS runs the first two for the model and again for its
 * mirror image. */
typedef int32_t cairn_object_detect_stage;
enum {
    CAIRN_OBJECT_DETECT_VOTES = 0,  /* candidates are generated; PARTS: by votes of fragments */
    CAIRN_OBJECT_DETECT_SCORES = 1, /* outlines deformed to the edges; PARTS: shapes compared */
    CAIRN_OBJECT_DETECT_BOXES = 2   /* non-maximum suppression; PARTS: outlines deformed, too */
};

/* Parameters; defaults in brackets. */
typedef struct cairn_object_detect_params {
    /* px, 8 ... 16384 (from the image's size): range of the diagonal of
     * the object's box, min_size <= max_size, min_size at least a fiftieth of the image's longer
     * side; by default from a tenth of the image's diagonal to the whole, at least 24 */
    cairn_real min_size, max_size;
    /* 0 or 1 (1): 1: the mirrored model is searched, too; as written 0 */
    int32_t mirror;
    /* 1 ... 64 (30): candidates that are refined */
    int32_t candidates;
    /* 0 ... 1 (0.2): non-maximum suppression threshold. Of two detections whose intersection over
     * union is greater, the lower-scoring one is suppressed. It is also suppressed when more than
     * 0.8 of the smaller box is covered by the other; not as written. */
    cairn_real overlap;
    /* finite (0): least score of a reported detection, before appearance counts; as written -100:
     * all are reported */
    cairn_real min_score;
    /* any (CAIRN_OBJECT_DETECT_EVIDENCE): method of detection */
    cairn_object_detect_method method;
    /* any (CAIRN_OBJECT_DETECT_BUNDLES): method PARTS: how fragments are bundled */
    cairn_object_detect_bundles bundles;
    /* any (NULL): [cut_count] manually chosen fragments of the first outline; NULL: chosen by
     * rule */
    const cairn_part_bundle_cut *cuts;
    /* >= 0 (0): number of cuts */
    int32_t cut_count;
    /* 1 ... 64 (2): chains that vote for each fragment; 2 in the thesis */
    int32_t matches;
    /* 1 ... 64 (20): nearest votes that the configurations around a vote are formed from */
    int32_t nearest;
    /* 0 or 1 (0): 1: only around the modes of the votes, found by mean shift */
    int32_t modes_only;
    /* any (NULL): appearance of the same image, whose words are complete, for the score of a box;
     * NULL: not used */
    cairn_appearance_field *appearance;
    /* 0 ... 1000 (8): weight of the appearance distance, lambda of the thesis. 8 suits the shape
     * distances of PARTS, 0 to 1; with EVIDENCE 1 and 2 were measured (docs/lab/detect.md). */
    cairn_real appearance_weight;
    /* any (NULL): called when a stage begins; NULL: no callback */
    void (*on_stage)(void *context, cairn_object_detect_stage stage);
    /* any (NULL): passed to on_stage */
    void *on_stage_context;
    /* 0 or 1 (0): 1, method EVIDENCE: objects may be partly occluded and have the model's own
     * shape. Only inliers of one similarity transform of the model's outline count
     * (rigid_proximity). The log-likelihood ratio of a contour grouped there is added. Grouped
     * contours add up to `candidates` more candidates. Outlines are placed by that transform and
     * not deformed. In clutter it raises the number of false positives. */
    int32_t occluded;
    /* 0 ... 100 (0.08): method EVIDENCE: weight in the score of the log-likelihood ratio of a
     * contour grouped at the detection (grouped_evidence; contour_grouping). Grouping takes more
     * than half the time of a search. 0: no grouping, except with `occluded`, which has its own
     * weight for it. */
    cairn_real verify;
    /* CAIRN_MODE_DEFAULT or CAIRN_MODE_AS_WRITTEN (CAIRN_MODE_DEFAULT): as written: method PARTS
     * only */
    int32_t mode;
    /* 0 or 1 (0): 0: appearance is the probability of the support vector machine (Adluru 2008,
     * section 5.3.2); 1, as written only and its default: 1 - the distance to the nearest positive
     * support vector, one of the training histograms (section 5.4.2) */
    int32_t appearance_nearest;
    /* Capacities. */
    /* px, 1 ... CAIRN_CONTOUR_SEARCH_MAX_SIDE (from the image's size): largest image */
    int32_t max_width, max_height;
    /* 1 ... CAIRN_CONTOUR_SEARCH_MAX_SEGMENTS (8192): segments of an image */
    int32_t max_segments;
    /* 1 ... CAIRN_CONTOUR_SEARCH_MAX_TOKENS (8192): pieces of segments in contour grouping; of more
     * a part is used */
    int32_t max_tokens;
    /* 1 ... 1024 (128): samples of a model's paths */
    int32_t max_samples;
    /* 3 ... 4096 (512): samples of a model's outline */
    int32_t max_outline;
    /* 1 ... 2^24 (10,000): chains of an image; method PARTS only */
    int32_t max_chains;
    /* px, > 0, <= 1e6 (8192): length of a chain; method PARTS only */
    cairn_real max_chain_length;
    /* 4096 ... 2^24 (65,536): peaks of the score maps; where the capacity may not suffice the worse
     * half is discarded; method EVIDENCE only */
    int32_t max_peaks;
    /* >= 1 (256): detections after non-maximum suppression; as written only */
    int32_t max_detections;
} cairn_object_detect_params;

/* Returns the default parameters; sizes from a tenth of the image's diagonal, at least 24 px, to
 * the whole.
 *
 * width, height: size of the image, px */
cairn_object_detect_params cairn_object_detect_default(int32_t width, int32_t height);

/* Returns the params of CAIRN_MODE_AS_WRITTEN, method PARTS, with the thesis's constants: 2 matches
 * per fragment, K = 20, lambda = 8; no verification.
 *
 * width, height: size of the image, px */
cairn_object_detect_params cairn_object_detect_as_written(int32_t width, int32_t height);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_object_detect_check(const cairn_object_detect_params *params,
                                                     cairn_object_fault *fault);

/* One detection. rigid_evidence: mean log-likelihood ratio (nats) of the edges over the samples of
 * the model's outline, object against background, before deformation; position, size and aspect
 * ratio alone are fitted. deformed_evidence: the same after deformation, less the deformation
 * cost. */
typedef struct cairn_object_detection {
    cairn_real left, top, right, bottom; /* px, bounding box of the deformed outline */
    /* Linear combination of rigid_evidence, deformed_evidence, edge_proximity, tangent_deviation,
     * deformation, the box's aspect ratio, the size over the image's diagonal, and
     * grouped_evidence; not a probability, not calibrated. With `occluded`: of rigid_proximity,
     * grouped_evidence and that size. Formula: docs/architecture.md. */
    cairn_real score;
    /* nats, log-likelihood ratio of the outline before and after deformation */
    cairn_real rigid_evidence, deformed_evidence;
    /* total length of the segments over that of the outline */
    cairn_real outline_coverage;
    /* 0 ... 1, mean over the samples of the deformed outline of exp(-d^2 / 2 - s^2 / 2) of the best
     * edge; d: distance in units of 0.012 sizes, s: sine of the angle in units of 0.35 */
    cairn_real edge_proximity;
    /* 0 ... 2, mean of 1 - cos of the angle between the deformed and the model outline */
    cairn_real tangent_deviation;
    /* 0 ... 1, rms residual of the best affine transform from the model outline to the deformed
     * one, in object sizes */
    cairn_real deformation;
    /* 0 ... 1, inlier proximity: edge_proximity times the weight of each sample as an inlier of one
     * similarity transform of the model outline (position, size, rotation; no aspect ratio) */
    cairn_real rigid_proximity;
    /* nats, greatest log-likelihood ratio of a contour found by grouping that coincides with this
     * box (intersection over union of at least a half). All sizes and rotations of up to 15 degrees
     * either way are searched. 0: none, or no grouping. */
    cairn_real grouped_evidence;
    /* px, position of the model's origin */
    cairn_vec2 origin;
    /* px, diagonal of the model's box */
    cairn_real size;
    /* 1: an instance of the mirrored model */
    int32_t mirrored;
    /* segments along the outline: segments[first_segment ... + segment_count - 1] */
    int32_t first_segment;
    /* number of these segments */
    int32_t segment_count;
    /* outline[first_outline ... + outline_count - 1] */
    int32_t first_outline;
    /* number of samples of the model's outline */
    int32_t outline_count;
    /* Of method PARTS, else 0. There, and for candidates by grouping, rigid_evidence is 0 and score
     * = 1 - shape_distance. Appearance reduces a score by appearance_weight (1 - appearance). */
    /* shape context distance of the parts to the outline, with a penalty for missing parts */
    cairn_real shape_distance;
    /* sum of the similarities of the parts less the spread of their votes (part_configuration) */
    cairn_real configuration_score;
    /* parts[first_part ... first_part + part_count - 1] */
    int32_t first_part, part_count;
    /* 0 ... 1: probability that the box shows the class, or its similarity to the training set; 0
     * without appearance */
    cairn_real appearance;
} cairn_object_detection;

/* A fragment of the model's outline (part_bundle, by rule) matched in the image. */
typedef struct cairn_object_detect_part {
    int32_t bundle, fragment, chain; /* chain: index in the tokens */
    int32_t reversed;                /* 1: the chain runs opposite to the outline */
    cairn_real similarity;           /* 0 ... 1 */
    cairn_real from, to;             /* px, matched interval along the chain */
} cairn_object_detect_part;

/* The detections in an image. segments and outline also contain entries of suppressed detections.
 * The arrays are those of the detector, valid until its next begin(). */
typedef struct cairn_object_detections {
    cairn_object_detection *found;       /* [count] by descending score */
    int32_t *segments;                   /* [segment_count] indices of the tokens' lines */
    cairn_contour_search_place *outline; /* [outline_count] */
    cairn_object_detect_part *parts;     /* [part_count] */
    /* lengths of the arrays above */
    int32_t count, segment_count, outline_count, part_count;
    int32_t bundle_count;   /* bundles of the model; 0: not detected by parts */
    int32_t has_appearance; /* 1: the scores include appearance */
} cairn_object_detections;

/* ---- The field ---- */

/* The edge field of an image, in which all models are searched: computed once per image. */
typedef struct cairn_object_detect_field cairn_object_detect_field;

/* Returns the memory of a field in bytes; 0 for params that create() rejects. Method EVIDENCE: 48
 * bytes for each cell of each size, margins of 28 cells included; a cell is 1/40 of the size. */
size_t cairn_object_detect_field_memory(const cairn_object_detect_params *params);

/* Creates a field. CAIRN_BAD_ARGUMENT: invalid params. CAIRN_NO_MEMORY: the pool is too small. */
CAIRN_CHECKED cairn_status cairn_object_detect_field_create(
    cairn_object_detect_field **field, cairn_pool *pool, const cairn_object_detect_params *params);

/* Starts on an image, for all sizes within the params. The tokens must stay valid as long as the
 * field is used. CAIRN_BAD_ARGUMENT: NULL, no image, a segment of no chain. CAIRN_FULL: image,
 * segments or chains beyond the capacities. CAIRN_NOT_FINITE: a segment (*fault: its index). A
 * refused call changes nothing. Cost: linear.
 *
 * tokens: segments and chains of the image */
CAIRN_CHECKED cairn_status
cairn_object_detect_field_begin(cairn_object_detect_field *field,
                                const cairn_contour_search_tokens *tokens, cairn_fault *fault);

/* Resumes. CAIRN_MORE: the budget is used up. CAIRN_OK: the field is complete, or nothing was begun.
 * Cost: about 20 units for each cell of each size, and 1 for 12 cells of every segment, direction
 * and size. A call exceeds its budget by at most one segment in one direction. */
CAIRN_CHECKED cairn_status cairn_object_detect_field_step(cairn_object_detect_field *field,
                                                          cairn_budget *budget);

/* ---- The detector ---- */

/* Detector of the instances of a model. */
typedef struct cairn_object_detector cairn_object_detector;

/* Returns the memory of a detector in bytes; 0 for params that create() rejects. */
size_t cairn_object_detect_memory(const cairn_object_detect_params *params);

/* Creates a detector. CAIRN_BAD_ARGUMENT: invalid params. CAIRN_NO_MEMORY: the pool is too small. */
CAIRN_CHECKED cairn_status cairn_object_detect_create(cairn_object_detector **detector,
                                                      cairn_pool *pool,
                                                      const cairn_object_detect_params *params);

/* Starts to detect a model in a complete field of the same method and sizes. Both must stay valid
 * until step() returns CAIRN_OK. CAIRN_BAD_ARGUMENT, CAIRN_NOT_FINITE: a model that
 * cairn_shape_model_check() refuses. CAIRN_BAD_ARGUMENT: a model with fewer than 3 outline samples,
 * without width or height, or with a sample 0.54 of its size or farther from its origin along an
 * axis; a field of other params. CAIRN_EMPTY: a field that is not complete. CAIRN_FULL: a model
 * beyond the capacities. Method PARTS: also the statuses of cairn_part_bundle_begin() (CAIRN_EMPTY,
 * CAIRN_FULL, CAIRN_BAD_ARGUMENT: cuts), after which the last result is lost; else a refused call
 * changes nothing. Cost: linear.
 *
 * model: model to detect */
CAIRN_CHECKED cairn_status cairn_object_detect_begin(cairn_object_detector *detector,
                                                     cairn_object_detect_field *field,
                                                     const cairn_shape_model *model,
                                                     cairn_fault *fault);

/* Resumes. CAIRN_MORE: the budget is used up. CAIRN_OK: the detections are complete, or nothing was
 * begun. CAIRN_FULL: as written more than max_detections remain. Errors of the parts' modules and of
 * cairn_contour_grouping_step() end the search, too. Cost: method EVIDENCE 1 unit for 64 cells of
 * each size, variant and outline sample; the grouping; for each candidate what contour_search takes.
 * A call exceeds its budget by at most the item that contour_search states. */
CAIRN_CHECKED cairn_status cairn_object_detect_step(cairn_object_detector *detector,
                                                    cairn_budget *budget);

/* Returns the detections; empty until step() returns CAIRN_OK. */
cairn_object_detections cairn_object_detect_read(const cairn_object_detector *detector);

#ifdef __cplusplus
}
#endif

#endif
