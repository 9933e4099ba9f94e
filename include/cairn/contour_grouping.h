/* contour_grouping: detection of instances of one shape model by grouping edge segments into object
 * contours.
 *
 * The result lists edge segments of the image, never the model's own outline. Image coordinates,
 * pixels, radians. Two modes:
 *
 * CAIRN_MODE_DEFAULT: hypothesis generation and verification. Every pair of tokens (short pieces of
 * segments) that matches the two sides of a model sample generates a pose hypothesis. The best
 * hypotheses are refined by dynamic programming along the model's outline. So are the final poses
 * of a particle filter that starts from these hypotheses. Ablation (docs/lab/group.md): the
 * parameter `particles` matters, because it also limits the number of hypotheses. Neither term of
 * the filter's weights matters: without them the same objects are found in clutter, under occlusion
 * and with several instances.
 *
 * CAIRN_MODE_AS_WRITTEN: Adluru 2008, chapter 2. A particle filter moves through the symmetric
 * points of pairs of segments. The segments of the best trajectory of each posterior mode are the
 * result, unchanged. One size is searched, the geometric mean of min_size and max_size. Objects are
 * neither rotated nor mirrored. Choices against the letter of the text: (2.11) counts in the
 * weights, copies of a resampled particle remain one particle (both below; the letter was
 * measured), one side may keep its segment, no cut leaves a piece below 10 px. Choices where it
 * leaves details open:
 * - ds of (2.12) is the angle between the displacements, rad, plus the difference of their lengths
 *   in 0.3 sizes. D_1 is 0 and has no direction: only the first point is compared with it. r and R
 *   of (2.13) are in mean radii of the model.
 * - N is 1 at its mean. The posterior of a trajectory is the product over its steps of (2.11) times
 *   (2.13), divided by Delta_p (stop_likelihood, 0.5). The filter ends when the greatest posterior
 *   is below 1. Of each mode the trajectory of the greatest posterior over all steps is kept, if
 *   that is at least 1. Two trajectories belong to one mode when they share half of the segments of
 *   the shorter one.
 * - Initial particles: symmetric points within L of an end point of a strong chain. Each is used in
 *   both directions of travel and of the model's path. They are sampled in proportion to (2.10)
 *   times (2.13).
 * - Each side grows by one of the 31 segments nearest to its open end, entered at the nearer end.
 *   One of the sides may keep its segment, whose gap is 0: at a concave corner one side has many
 *   segments where the other has a point. The mass of such a step is multiplied by Delta_p.
 * - A segment is explored when its midpoint lies in the polygon between both sides, a symmetric
 *   point when it lies there itself. Self-intersection: new pieces are compared with both sides but
 *   the last two segments of their own, which a virtual segment overlaps, and with each other; the
 *   skeleton's new step with the skeleton and the sides before; new pieces not with the skeleton.
 * - Symmetric points: normals deviate by at most 75 degrees from the line between both edgels, in
 *   the mean by at most 45 degrees (symmetric_point.h).
 * - Radii may leave the model's range by at most R_sigma.
 * - A particle has exp(H) followers, at most 16, each of them once, drawn by (2.11). Their weights
 *   are w times (2.13) times (2.11), so that (2.11) counts twice where not all candidates follow;
 *   in (2.9) it cancels. Copies of a resampled particle remain one particle of their total weight,
 *   as copies of equal weights would draw mostly the same followers. Both were measured:
 *   docs/lab/group.md. Of more than N followers the N heaviest are kept. */
#ifndef CAIRN_CONTOUR_GROUPING_H
#define CAIRN_CONTOUR_GROUPING_H

#include "cairn/object.h"
#include "cairn/particle_filter.h"
#include "cairn/shape_model.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Parameters; defaults in brackets. */
typedef struct cairn_contour_grouping_params {
    /* CAIRN_MODE_DEFAULT or CAIRN_MODE_AS_WRITTEN (CAIRN_MODE_DEFAULT): method */
    int32_t mode;
    /* px, 1 ... 8192 (1024 and 1024): size of the image */
    int32_t max_width, max_height;
    /* 1 ... 2^20 (8192): capacity for tokens. Default mode: pieces of segments; a longer list is
     * subsampled evenly. As written: segments; begin() refuses more. */
    int32_t max_tokens;
    /* 1 ... 1024 (64): samples of a model's paths */
    int32_t max_samples;
    /* 1 ... 4096 (512): samples of a model's outline */
    int32_t max_outline;
    /* 1 ... 4096 (300): particles of the filter, also the maximum number of hypotheses */
    int32_t particles;
    /* 1 ... 64 (8): greatest number of reported objects */
    int32_t max_objects;
    /* px, > 0 (10): length of the tokens that segments are cut into; default mode only */
    cairn_real token_length;
    /* share of the object's size, > 0 (0.025): standard deviation of contour positions; default
     * mode only */
    cairn_real deform_sigma;
    /* rad, > 0 (15 degrees): standard deviation of contour directions; default mode only */
    cairn_real turn_sigma;
    /* rad, > 0 (45 degrees): S_sigma, standard deviation of the loss of symmetry per step;
     * CAIRN_REAL_MAX: the proposal ignores symmetry */
    cairn_real symmetry_sigma;
    /* > 0, <= 1 (0.3): likelihood of a side that matches no token; default mode only */
    cairn_real missing_likelihood;
    /* > 0, <= 1 (0.3): the filter ends when the best mean likelihood per step falls below. As
     * written (0.5 there): Delta_p, see above. */
    cairn_real stop_likelihood;
    /* 0 ... 1 (0.2): least score of a reported object; default mode only */
    cairn_real min_score;
    /* nats, >= 0 (13): least evidence of a reported object; default mode only */
    cairn_real min_evidence;
    /* any (1): seed of the random numbers */
    uint64_t seed;
    /* 1 ... 2^22 (65,536): symmetric points of all pairs of segments; of more the most symmetric
     * are kept; as written only */
    int32_t max_points;
    /* 2 ... 1024 (128): steps of a trajectory; as written only */
    int32_t max_steps;
    /* > 0 (0.7): D_sigma of (2.13), standard deviation of the displacement dissimilarity; as
     * written only */
    cairn_real path_sigma;
    /* mean radii of the model, > 0 (0.2): R_sigma of (2.13), standard deviation of the radius; as
     * written only */
    cairn_real radius_sigma;
} cairn_contour_grouping_params;

/* The shape model to search for and the segments of the image. */
typedef struct cairn_contour_grouping_input {
    /* [count] px; must stay valid until step() returns CAIRN_OK */
    const cairn_segment *segments;
    /* number of segments */
    int32_t count;
    /* px */
    int32_t width, height;
    /* must stay valid, too */
    const cairn_shape_model *model;
    /* px, > 0: range of the object's size, the diagonal of its bounding box */
    cairn_real min_size, max_size;
    /* rad, within -pi ... pi: range of the rotation from the model to the object, from x to y */
    cairn_real min_turn, max_turn;
    /* px, > 0: G_sigma of Adluru 2008, mean length of the segments, as computed by edge_segment */
    cairn_real mean_length;
    /* Mode as written only. */
    /* px, > 0: look-ahead L, mean + half the standard deviation of the segment lengths before
     * cutting, as computed by edge_segment */
    cairn_real look_ahead;
    /* [end_count] px, end points of strong chains, where trajectories start, at most 2 max_tokens;
     * must stay valid, too */
    const cairn_vec2 *ends;
    /* number of end points */
    int32_t end_count;
} cairn_contour_grouping_input;

/* One detected object. Similarity transform from the model: image = origin + scale * (cosine,
 * -sine; sine, cosine) * model. Differences of the mode as written follow "as written". */
typedef struct cairn_contour_grouping_object {
    /* nats: approximate log-likelihood ratio of its segments, object against background. As
     * written: the log posterior of its trajectory. */
    cairn_real evidence;
    /* 0 ... 1: matched share of the outline, weighted by the quality of the match. As written: the
     * share of the model's longest path that was traversed. */
    cairn_real score;
    /* px; as written: mean over the trajectory's discs */
    cairn_vec2 origin;
    /* px; as written: the searched size */
    cairn_real size;
    /* rad, rotation; as written 0 */
    cairn_real turn;
    /* its segments: segments[first ... first + count - 1] of the result */
    int32_t first, count;
    /* matched segment of each outline sample: outline_segments[first_outline ... first_outline +
     * outline_count - 1] of the result */
    int32_t first_outline;
    /* path samples with at least one matched side; as written: discs of the trajectory */
    int32_t matched_samples;
    /* model sample at which its trajectory began */
    int32_t start_sample;
} cairn_contour_grouping_object;

/* Diagnostics of one step of the particle filter. */
typedef struct cairn_contour_grouping_trace {
    /* effective sample size */
    cairn_real n_eff;
    /* nats, of the best particle, mean over its steps; as written: of the greatest posterior */
    cairn_real log_likelihood;
    /* followers drawn, whether the population was resampled, and particles afterwards */
    int32_t followers, resampled, particles;
} cairn_contour_grouping_trace;

/* The objects found, and their segments. */
typedef struct cairn_contour_grouping_result {
    const cairn_contour_grouping_object *objects; /* [object_count] by descending evidence */
    /* Indices of the input's segments, object by object, in the order of the outline. As written:
     * the left side in the direction of travel, then the right side backwards. */
    const int32_t *segments;
    /* Segment index at each sample of the model's outline, -1: unmatched; object by object. As
     * written: only at the outline samples nearest to the model samples of the discs. */
    const int32_t *outline_segments;
    const cairn_contour_grouping_trace *trace; /* [steps] */
    /* number of objects, of their segments in all, and of filter steps */
    int32_t object_count, segment_count, steps;
    /* Pose hypotheses generated from pairs of tokens. As written: start states that the initial
     * particles are sampled from, four per symmetric point near an end of a strong chain. */
    int32_t hypothesis_count;
    /* pieces of segments; as written: segments */
    int32_t token_count;
    /* score of the pose with the most evidence, reported or not; as written: of the first object */
    cairn_real best_score;
    /* nats, its evidence */
    cairn_real best_evidence;
    /* Mode as written only. */
    int32_t point_count, points_dropped; /* symmetric points; those dropped beyond max_points */
    /* states that were not proposed because the memory for 100 per particle was used up: those of
     * the particles that come last, which are mostly the heaviest */
    int32_t candidates_dropped;
    /* CAIRN_CONTOUR_GROUPING_...: termination reason of the filter */
    int32_t end_reason;
} cairn_contour_grouping_result;

/* Termination reasons of the filter in the mode as written. */
enum {
    /* no symmetric point within the model's radii lies near an end of a strong chain */
    CAIRN_CONTOUR_GROUPING_NO_START = 0,
    /* the greatest posterior fell below 1 */
    CAIRN_CONTOUR_GROUPING_POSTERIOR = 1,
    /* no particle has a successor */
    CAIRN_CONTOUR_GROUPING_NO_FOLLOWER = 2,
    /* max_steps reached */
    CAIRN_CONTOUR_GROUPING_STEPS = 3,
    /* the memory for the particles' histories is exhausted */
    CAIRN_CONTOUR_GROUPING_HISTORIES = 4
};

/* Grouping of contour tokens to objects by a particle filter. */
typedef struct cairn_contour_grouping cairn_contour_grouping;

/* Returns the default parameters. */
cairn_contour_grouping_params cairn_contour_grouping_default(void);

/* Returns the mode as written with the constants of the thesis. */
cairn_contour_grouping_params cairn_contour_grouping_as_written(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_contour_grouping_check(const cairn_contour_grouping_params *params,
                                                        cairn_object_fault *fault);

/* Returns the bytes that create() takes from the pool; 0 for params that create() would refuse.
 * Default mode: about 5 KB per particle, independent of the length of the paths, and 100 bytes per
 * token. As written: about 13 KB per particle, 110 bytes per token, 80 per symmetric point, and 110
 * per object and step. */
size_t cairn_contour_grouping_memory(const cairn_contour_grouping_params *params);

/* Creates a grouping in the pool. CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status
cairn_contour_grouping_create(cairn_contour_grouping **grouping, cairn_pool *pool,
                              const cairn_contour_grouping_params *params);

/* Starts the search in one image and discards earlier results. CAIRN_BAD_ARGUMENT: NULL, an empty
 * range, an invalid model. CAIRN_FULL: an image or a model beyond the params; as written also more
 * than max_tokens segments or 2 max_tokens ends of chains. CAIRN_NOT_FINITE: a number of the
 * input. Cost: linear in the model.
 *
 * input: tokens, model and ranges of the pose */
CAIRN_CHECKED cairn_status cairn_contour_grouping_begin(cairn_contour_grouping *grouping,
                                                        const cairn_contour_grouping_input *input);

/* Resumes the search. CAIRN_MORE: the budget is exhausted. CAIRN_OK: the result is complete, or no
 * search is running. CAIRN_NOT_FINITE: a segment (as written also an end of a chain) is not finite.
 * CAIRN_FULL, default mode only: segments of more than 2^24 tokens. Both errors end the search.
 *
 * Cost in the default mode: one unit per 16 pairs of tokens and one per combination of a pair (at
 * most 2^22 pairs) and a model sample; about 60 units per particle and sample in the filter; 12
 * units per outline sample for every hypothesis and every final pose, up to five times, and for
 * every object nine times. Cost as written: that of cairn_symmetric_point_step(); two path samples
 * per start; per particle and step 60 units, 12 for each earlier step, one per segment end in the
 * look-ahead circles and one per pair of the nearest 31; more for long trajectories. */
CAIRN_CHECKED cairn_status cairn_contour_grouping_step(cairn_contour_grouping *grouping,
                                                       cairn_budget *budget);

/* Returns the result; all zero until step() returns CAIRN_OK; valid until the next begin(). */
cairn_contour_grouping_result cairn_contour_grouping_read(const cairn_contour_grouping *grouping);

/* A particle of the filter: the current pose of the model and the disc of the last step. As
 * written: the model is placed so that its sample coincides with the disc, at the searched size and
 * without rotation, and both sides are matched. */
typedef struct cairn_contour_grouping_particle {
    cairn_vec2 origin; /* px */
    cairn_real size;   /* px */
    cairn_real turn;   /* rad, rotation */
    cairn_vec2 centre; /* px */
    cairn_real radius; /* px */
    /* logarithm of the weight, nats; normalized after every step, 0 before the first */
    cairn_real log_weight;
    int32_t sample;        /* of the model */
    int32_t matched_sides; /* 0 ... 2: matched sides of the disc */
} cairn_contour_grouping_particle;

/* Writes the first `most` particles after the last completed filter step into particles[] and
 * returns their total number: 0 before the first particles and without hypotheses. *steps, when not
 * NULL: number of completed steps. Cost: linear.
 *
 * particles: [most] set to the first particles */
int32_t cairn_contour_grouping_particles(const cairn_contour_grouping *grouping,
                                         cairn_contour_grouping_particle *particles, int32_t most,
                                         int32_t *steps);

/* One symmetric point of a trajectory in the mode as written. Sides in image coordinates (y down):
 * 0 left of the direction of travel, 1 right. */
typedef struct cairn_contour_grouping_disc {
    /* px */
    cairn_vec2 centre;
    /* px */
    cairn_real radius;
    /* rad, deviation of the edge normals from perfect symmetry */
    cairn_real deviation;
    /* px: open ends of both sides, the centres of the look-ahead circles */
    cairn_vec2 open_end[2];
    /* segment indices of the input */
    int32_t segment[2];
    /* sample of the model's longest path that is nearest by (2.12) */
    int32_t sample;
    /* nats, of the trajectory up to this step: sum of the logarithms of (2.11) times (2.13) over
     * stop_likelihood */
    cairn_real log_posterior;
} cairn_contour_grouping_disc;

/* Writes the first `most` discs of a particle's trajectory, from its start to the last step, into
 * discs[] and returns their total number: 0 for an unknown particle and in the default mode. Cost:
 * linear.
 *
 * particle: index of the particle
 * discs: [most] set to the first discs */
int32_t cairn_contour_grouping_history(const cairn_contour_grouping *grouping, int32_t particle,
                                       cairn_contour_grouping_disc *discs, int32_t most);

/* Writes the first `most` discs of the skeleton of an object of the result and returns their total
 * number, as cairn_contour_grouping_history() does for a particle.
 *
 * discs: [most] set to the first discs
 * object: index of the object in the result */
int32_t cairn_contour_grouping_skeleton(const cairn_contour_grouping *grouping, int32_t object,
                                        cairn_contour_grouping_disc *discs, int32_t most);

#ifdef __cplusplus
}
#endif

#endif
