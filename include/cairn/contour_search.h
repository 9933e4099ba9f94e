/* contour_search: detection of the contours of a known shape in an image of edge strengths.
 *
 * Two objects, both stepped: a tokenizer extracts the straight segments of an edge image (edge_chain,
 * edge_segment); a search detects a model and, on request, its mirror image among them
 * (contour_grouping), and deforms the model's outline to the edges. On a desktop contour_search_run
 * runs both with memory of the heap that fits the image. Image coordinates, pixels.
 *
 * Limits: one size per position is found in each band of sizes. A part of an object that is farther
 * from its predicted position than 0.16 sizes is not found. Of objects closer to each other than
 * 0.3 sizes only the best is reported (non-maximum suppression). */
#ifndef CAIRN_CONTOUR_SEARCH_H
#define CAIRN_CONTOUR_SEARCH_H

#include "cairn/contour_grouping.h"
#include "cairn/edge_segment.h"
#include "cairn/object.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Greatest side of an image, px, greatest number of segments of a search, and default capacity of a
 * tokenizer. More pieces of segments than the third are subsampled. */
#define CAIRN_CONTOUR_SEARCH_MAX_SIDE     8192
#define CAIRN_CONTOUR_SEARCH_MAX_SEGMENTS (INT32_C(1) << 22)
#define CAIRN_CONTOUR_SEARCH_MAX_TOKENS   32768

/* The tokens of an image: straight edge segments, uncut. contour_grouping cuts them into pieces,
 * which its default mode calls tokens. */
typedef struct cairn_contour_search_tokens {
    cairn_segment *lines; /* [count] */
    int32_t *chain;       /* [count] chain index of each segment */
    /* [count] 0 ... 1: rank of its strength, the share of the total edge length that is weaker */
    cairn_real *strength_rank;
    /* number of segments and of chains */
    int32_t count, chain_count;
    int32_t width, height;  /* px, size of the image */
    cairn_real mean_length; /* px, mean length of the segments */
    size_t pool_bytes;      /* bytes of pool memory used */
    /* Of the mode as written only. */
    cairn_real look_ahead; /* px, look-ahead L */
    cairn_vec2 *ends;      /* [end_count] px: end points of chains of high mean edge strength */
    /* number of end points */
    int32_t end_count;
} cairn_contour_search_tokens;

/* Parameters of a tokenizer; defaults in brackets. */
typedef struct cairn_contour_search_tokenizer_params {
    /* px, 1 ... CAIRN_CONTOUR_SEARCH_MAX_SIDE (640 and 480): largest image */
    int32_t max_width, max_height;
    /* 1 ... 2^28 (100,000): capacity for edge pixels */
    int32_t max_edges;
    /* 1 ... 2^28 (10,000): capacity for chains */
    int32_t max_chains;
    /* 1 ... 2^26 (10,000): capacity for polyline segments before cutting */
    int32_t max_lines;
    /* 1 ... 2^23 (CAIRN_CONTOUR_SEARCH_MAX_TOKENS): capacity for tokens, virtual segments included
     * also where they are left out */
    int32_t max_segments;
    /* 1 ... 255 (1): weaker pixels are not edges */
    int32_t min_strength;
    /* 0 or 1 (0): 1: edgels instead of segments, short straight pieces at even steps along the
     * chains */
    int32_t edgels;
    /* CAIRN_MODE_DEFAULT or CAIRN_MODE_AS_WRITTEN (CAIRN_MODE_DEFAULT): as written (Adluru 2008, 2.6
     * and 2.7) also the virtual segments at junctions, whose chain is -1, and the end points of
     * strong chains. No cut leaves a piece below 10 px, where the text goes down to edgels in the
     * worst case, as shorter ones give more extensions than a particle tries; lines lie within 2.5
     * px of their chain, which covers more of known objects than 1.5 px. Edgels are 3 px long, one
     * every 3 pixels of a chain. */
    int32_t mode;
    /* >= 0, finite (1): as written: a chain is strong when its mean strength is at least this
     * multiple of the length-weighted mean of all */
    cairn_real strong;
} cairn_contour_search_tokenizer_params;

/* Extractor of the tokens of an image, and the tokens of its last image. */
typedef struct cairn_contour_search_tokenizer cairn_contour_search_tokenizer;

/* Returns the default parameters of a tokenizer. */
cairn_contour_search_tokenizer_params cairn_contour_search_tokenizer_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_contour_search_tokenizer_check(
    const cairn_contour_search_tokenizer_params *params, cairn_object_fault *fault);

/* Returns the memory of a tokenizer in bytes; 0 for params that create() rejects. */
size_t cairn_contour_search_tokenizer_memory(const cairn_contour_search_tokenizer_params *params);

/* Creates a tokenizer. CAIRN_BAD_ARGUMENT: invalid params. CAIRN_NO_MEMORY: the pool is too
 * small. */
CAIRN_CHECKED cairn_status
cairn_contour_search_tokenizer_create(cairn_contour_search_tokenizer **tokenizer, cairn_pool *pool,
                                      const cairn_contour_search_tokenizer_params *params);

/* Starts on an image of edge strengths, 0 where there is no edge, and discards earlier results. The
 * image must stay valid until step() returns CAIRN_OK. CAIRN_BAD_ARGUMENT: NULL, an invalid view.
 * CAIRN_FULL: larger than the capacities. Constant time.
 *
 * strengths: image of edge strengths */
CAIRN_CHECKED cairn_status cairn_contour_search_tokenizer_begin(
    cairn_contour_search_tokenizer *tokenizer, cairn_raster_u8_view strengths);

/* Resumes. CAIRN_MORE: the budget is used up. CAIRN_OK: the tokens are complete, or nothing was
 * begun. CAIRN_FULL: edge pixels, chains, lines or segments beyond the capacities; the extraction
 * ends without tokens. Cost: that of cairn_edge_chain_step() and cairn_edge_segment_step(), and 1
 * unit for every 4 px of the tokens. */
CAIRN_CHECKED cairn_status cairn_contour_search_tokenizer_step(
    cairn_contour_search_tokenizer *tokenizer, cairn_budget *budget);

/* Returns the tokens; empty until step() returns CAIRN_OK; the pointers are valid until the next
 * begin(). */
cairn_contour_search_tokens
cairn_contour_search_tokenizer_read(const cairn_contour_search_tokenizer *tokenizer);

/* One disc of an object's skeleton. */
typedef struct cairn_contour_search_disc {
    /* px; the symmetric point of both sides where both are matched, else the model's prediction */
    cairn_vec2 centre;
    /* px */
    cairn_real radius;
    /* matched segments on the left and on the right, -1: unmatched */
    int32_t side[2];
    /* sample of the model */
    int32_t sample;
} cairn_contour_search_disc;

/* A sample of the model's outline, deformed to the image: the predicted contour where no edge
 * is. */
typedef struct cairn_contour_search_place {
    /* px, position and tangent direction */
    cairn_oriented_point point;
    /* segment of the contour along the sample; -1: unmatched */
    int32_t segment;
    /* index of the model's closed outline that the sample belongs to */
    int32_t outline_index;
} cairn_contour_search_place;

/* Quality of the fit of a deformed outline, independent of its surroundings. */
typedef struct cairn_contour_search_shape {
    /* 0 ... 1, mean over the samples of the deformed outline of exp(-d^2 / 2 - s^2 / 2) of the best
     * edge; d: distance in units of 0.012 sizes, s: sine of the angle in units of 0.35 */
    cairn_real edge_proximity;
    /* 0 ... 2, mean of 1 - cos of the angle between the deformed and the model outline */
    cairn_real tangent_deviation;
    /* 0 ... 1, rms residual of the best affine transform from the model outline to the deformed
     * one, in object sizes */
    cairn_real deformation;
} cairn_contour_search_shape;

/* One detected object. found.evidence: score of the grouping, a linear combination that was fitted
 * to images and is not calibrated: deformed_evidence + 2 rigid_evidence + 20 edge_proximity
 * - 100 tangent_deviation - 4500 deformation^2 + 60 found.score - 58. It is no log-likelihood
 * ratio, and not comparable with the evidence of contour_grouping, which is. The tangent deviation
 * is measured against the model rotated as the object is. found.score: the matched share of the
 * outline. As written both are those of contour_grouping. */
typedef struct cairn_contour_search_object {
    /* found.first: index of its first segment in segments[] below; found.first_outline: 0 */
    cairn_contour_grouping_object found;
    /* 1: an instance of the mirrored model */
    int32_t mirrored;
    /* discs[first_disc ... + disc_count - 1] */
    int32_t first_disc;
    /* the model's samples, path by path; in the mode as written the steps of the trajectory */
    int32_t disc_count;
    /* outline[first_outline ... + outline_count - 1] */
    int32_t first_outline;
    /* the model's; 0 in the mode as written, which deforms no outline */
    int32_t outline_count;
    /* nats: log-likelihood ratio of the edges along the outline, before deformation (similarity
     * transform of the model) and after it, less the deformation cost; both divided by the
     * outline's length over the object's size */
    cairn_real rigid_evidence, deformed_evidence;
    /* how the outline was deformed */
    cairn_contour_search_shape shape;
} cairn_contour_search_object;

/* The objects found in an image, and diagnostics of the search. The arrays are those of the search,
 * valid until the next begin(). */
typedef struct cairn_contour_search_result {
    /* [object_count] by descending found.evidence, after non-maximum suppression */
    cairn_contour_search_object *objects;
    /* [segment_count] indices of the tokens' lines, object by object, in the order of the model's
     * outline */
    int32_t *segments;
    /* [disc_count] skeletons, object by object */
    cairn_contour_search_disc *discs;
    /* [outline_count] outline samples, object by object */
    cairn_contour_search_place *outline;
    /* [steps] of the filter, for the model and for its mirror image */
    cairn_contour_grouping_trace *trace[2];
    /* [steps] number of clusters of particles: clusters of model poses; as written: of start
     * points */
    int32_t *mode_counts[2];
    /* filter steps, and number of hypotheses; of the model and of its mirror image */
    int32_t steps[2], hypothesis_counts[2];
    /* lengths of the arrays above */
    int32_t object_count, segment_count, disc_count, outline_count;
    /* greatest matched share of all hypotheses, reported or not */
    cairn_real best_score;
    /* greatest found.evidence of all hypotheses */
    cairn_real best_evidence;
    /* bytes of pool memory that the search takes */
    size_t pool_bytes;
    /* CAIRN_MODE_... of the search */
    int32_t mode;
    /* Mode as written only. */
    /* symmetric points; those dropped beyond the capacity, the least symmetric ones */
    int32_t point_count, points_dropped;
    /* extensions of trajectories beyond the memory for candidates, dropped */
    int32_t candidates_dropped;
    /* CAIRN_CONTOUR_GROUPING_...: termination reason of the filter */
    int32_t end_reason;
} cairn_contour_search_result;

/* Returns the name of a CAIRN_CONTOUR_GROUPING_... termination reason: "no start", "posterior", "no
 * follower", "steps", "histories"; "" for other values.
 *
 * end: any number */
const char *cairn_contour_search_end_text(int32_t end);

/* Parameters of the search; defaults in brackets. */
typedef struct cairn_contour_search_params {
    /* the grouping of the search, with its capacities: max_width and max_height of the image,
     * max_tokens of the pieces of segments, max_samples and max_outline of the model; its objects
     * are refined */
    cairn_contour_grouping_params grouping;
    /* 1 ... CAIRN_CONTOUR_SEARCH_MAX_SEGMENTS (8192): capacity for segments of an image */
    int32_t max_segments;
    /* finite (34): least found.evidence of a reported object, its score, which is not
     * calibrated */
    cairn_real min_evidence;
    /* finite (0.3): least matched share of a reported object */
    cairn_real min_score;
    /* px, > 0 (from the image's size): range of the object's size, the diagonal of its bounding
     * box; by default from a tenth of the image's diagonal to the whole, at least 24 */
    cairn_real min_size, max_size;
    /* rad, finite (-15 degrees and 15 degrees): range of the rotation */
    cairn_real min_turn, max_turn;
    /* 0 or 1 (1): 1: the mirrored model is searched, too */
    int32_t mirror;
    /* any (NULL): called with the particles after every filter step, in the mode as written with the
     * initial ones, too; NULL: no callback */
    void (*on_step)(void *context, const cairn_contour_grouping_particle *particles, int32_t count,
                    int32_t mirrored);
    /* any (NULL): passed to on_step and on_walk */
    void *context;
    /* any (NULL): mode as written: called after on_step with the trajectory of the particle of
     * greatest weight, whose rank is 0, then with those of at most 15 others, evenly chosen, whose
     * ranks follow; NULL: no callback */
    void (*on_walk)(void *context, const cairn_contour_grouping_disc *discs, int32_t count,
                    int32_t rank);
} cairn_contour_search_params;

/* Returns the default parameters; sizes from a tenth of the image's diagonal, at least 24 px, to
 * the whole.
 *
 * width, height: size of the image, px */
cairn_contour_search_params cairn_contour_search_default(int32_t width, int32_t height);

/* Returns the params of the mode as written: no mirror image, no rotation. The searched size is the
 * geometric mean of min_size and max_size.
 *
 * width, height: size of the image, px */
cairn_contour_search_params cairn_contour_search_as_written(int32_t width, int32_t height);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names, of the
 * search or of its grouping, is out of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_contour_search_check(const cairn_contour_search_params *params,
                                                      cairn_object_fault *fault);

/* Search for the instances of a model. */
typedef struct cairn_contour_search cairn_contour_search;

/* Returns the memory of a search in bytes; 0 for params that create() rejects. It holds all
 * candidates of all bands of sizes: with one band and without the mirror image it is least. */
size_t cairn_contour_search_memory(const cairn_contour_search_params *params);

/* Creates a search. CAIRN_BAD_ARGUMENT: invalid params. CAIRN_NO_MEMORY: the pool is too small. */
CAIRN_CHECKED cairn_status cairn_contour_search_create(cairn_contour_search **search,
                                                       cairn_pool *pool,
                                                       const cairn_contour_search_params *params);

/* Starts to detect a model among tokens, and discards earlier results. Both must stay valid until
 * step() returns CAIRN_OK, the tokens as long as the result is used. CAIRN_BAD_ARGUMENT: NULL, a
 * model that cairn_shape_model_check() refuses, an image or a range of sizes or rotations that
 * cairn_contour_grouping_begin() refuses. CAIRN_FULL: image, segments or model beyond the
 * capacities. CAIRN_NOT_FINITE: a segment (*fault: its index) or the model. A refused call changes
 * nothing. Cost: linear.
 *
 * tokens: segments of the image
 * model: model to search */
CAIRN_CHECKED cairn_status cairn_contour_search_begin(cairn_contour_search *search,
                                                      const cairn_contour_search_tokens *tokens,
                                                      const cairn_shape_model *model,
                                                      cairn_fault *fault);

/* Resumes. CAIRN_MORE: the budget is used up. CAIRN_OK: the result is complete, or nothing was
 * begun. Errors of cairn_contour_grouping_step() end the search. Cost: that of the grouping for each
 * band of sizes and for the mirror image; for each of its objects about 50,000 units for the field
 * around it, 1000 for each outline sample, 1 for 16 outline samples and every 3 px of the segments
 * near it, and 1 for 4 pairs of an outline sample and a segment. A call exceeds its budget by at
 * most the last item: the segments of one chain near the object, each 1 unit per 16 outline
 * samples. */
CAIRN_CHECKED cairn_status cairn_contour_search_step(cairn_contour_search *search,
                                                     cairn_budget *budget);

/* Returns the result; empty until step() returns CAIRN_OK. */
cairn_contour_search_result cairn_contour_search_read(const cairn_contour_search *search);

/* Finds the next run of outline samples, at or after sample `from`, that no segment of the contour
 * matches: samples *first ... *first + *count - 1 are predicted, not observed. A run ends at the
 * end of an outline. Returns 0 when there is none. Cost: linear.
 *
 * result: result of a search
 * object: one of its objects
 * from: sample of the object's outline, from 0
 * first, count: set to the run */
int cairn_contour_search_completed(const cairn_contour_search_result *result,
                                   const cairn_contour_search_object *object, int32_t from,
                                   int32_t *first, int32_t *count);

#ifdef __cplusplus
}
#endif

#endif
