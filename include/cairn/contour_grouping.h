/* contour_grouping: the contour of a known object among edge segments.
 *
 * The result is a list of edge segments of the image, never the model's own outline. Image
 * coordinates, pixels, radians. Two modes:
 *
 * CAIRN_MODE_DEFAULT: hypothesis generation and fitting. Every pair of tokens (pieces of segments)
 * that suits a sample of the model is a hypothesis; the best places are fitted by dynamic
 * programming along the model's outline, and so are the ends of a particle filter's walks that
 * begin there. Ablation (docs/accuracy.md): `particles` matters, because it is the number of
 * hypotheses that are kept as well; neither term of the filter's weights does: without them the
 * same is found, in clutter, of hidden objects and of several. A walk's weights decide nothing
 * here.
 *
 * CAIRN_MODE_AS_WRITTEN: Adluru 2008, chapter 2: a particle filter that walks through the symmetric
 * points of pairs of segments; the segments of the best walk of each mode of the posterior are the
 * result, unchanged. One size is searched, the geometric mean of min_size and max_size; objects are
 * neither turned nor mirrored. Choices, where the text is silent:
 * - ds of (2.12) is the angle between the displacements, rad, plus the difference of their lengths
 *   in mean radii of the model; of displacements shorter than a mean radius the angle counts in
 *   proportion. r and R of (2.13) are in mean radii of the model, too.
 * - N is 1 at its mean. The posterior of a walk is the product of (2.13) divided by Delta_p
 *   (`stop`, 0.5) in every step: the walk ends when the greatest one is below 1. Of a mode the walk
 *   of the greatest posterior over all steps is kept; two walks are of one mode when they share
 *   half of the segments of the shorter one.
 * - The first particles: symmetric points of pairs of which one segment ends within L of an end
 *   point of a strong chain, in both senses of the walk and of the model's path, drawn by (2.10)
 *   times (2.13).
 * - Both sides grow in every step, each by one of the ten segments nearest to its open end, from
 *   the end nearer to it. A segment is explored when its middle lies in the polygon between both
 *   sides.
 * - Radii out of the model's range: by more than R_sigma.
 * - A particle has at most 8 followers. */
#ifndef CAIRN_CONTOUR_GROUPING_H
#define CAIRN_CONTOUR_GROUPING_H

#include "cairn/particle_filter.h"
#include "cairn/shape_model.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_grouping_params {
    int32_t mode;                  /* CAIRN_MODE_DEFAULT, CAIRN_MODE_AS_WRITTEN */
    int32_t max_width, max_height; /* px, of the image, 1 ... 8192 (1024 and 1024) */
    /* 1 ... 2^20 (8192). Default: pieces of segments, of more every n-th is left out; as
     * written: segments, begin() refuses more. */
    int32_t max_tokens;
    int32_t max_samples;  /* of a model's paths, 1 ... 1024 (64) */
    int32_t max_outline;  /* samples of a model's outline, 1 ... 4096 (512) */
    int32_t particles;    /* 1 ... 4096 (300) */
    int32_t max_objects;  /* 1 ... 64 (8) */
    int32_t use_model;    /* 0: steps are not weighed by the model (1) */
    int32_t use_skeleton; /* 0: steps are not drawn by the symmetry of their points (1) */
    /* token, deform, turn, missing, min_score and min_evidence are of the default mode alone. */
    /* px, > 0: segments are cut into pieces of this length (10) */
    cairn_real token;
    /* > 0, of the object's size: sigma of places on the contour (0.025) */
    cairn_real deform;
    /* rad, > 0: sigma of its directions (15 degrees) */
    cairn_real turn;
    /* rad, > 0: S, sigma of a loss of symmetry from one step to the next (45 degrees) */
    cairn_real symmetry;
    /* 0 ... 1, > 0: likelihood of a side that is not seen (0.3) */
    cairn_real missing;
    /* 0 ... 1, > 0: the walk ends when the best likelihood of a step, in the mean, is below; as
     * written Delta_p, see above (0.3; as written 0.5). */
    cairn_real stop;
    cairn_real min_score;    /* 0 ... 1: objects of which less is seen are not reported (0.2) */
    cairn_real min_evidence; /* >= 0: nor those with less evidence (13) */
    uint64_t seed;
    /* Of the mode as written alone. */
    /* symmetric points of all pairs of segments, 1 ... 2^22; of more the most symmetric are kept
     * (65,536) */
    int32_t max_points;
    /* of a walk, 2 ... 1024 (128) */
    int32_t max_steps;
    /* > 0: D_sigma of (2.13) (0.7) */
    cairn_real path_sigma;
    /* > 0: R_sigma of (2.13), in mean radii of the model (0.2) */
    cairn_real radius_sigma;
} cairn_grouping_params;

/* What is searched, and in what. */
typedef struct cairn_grouping_input {
    /* [count] px, must stay until step() returns CAIRN_OK */
    const cairn_segment *segments;
    int32_t count;
    /* px */
    int32_t width, height;
    /* must stay, too */
    const cairn_shape_model *model;
    /* px, > 0: of the diagonal of the object's box */
    cairn_real min_size, max_size;
    /* rad, within -pi ... pi: from the model to the object, from x to y */
    cairn_real min_turn, max_turn;
    /* px, > 0: G of Adluru 2008, mean length of segments, as from edge_segment */
    cairn_real mean_length;
    /* Of the mode as written alone. */
    /* px, > 0: L, mean + half the deviation of the lengths before the cuts, as from edge_segment */
    cairn_real look_ahead;
    /* [end_count] px, end points of the strong chains, where walks start; must stay, too */
    const cairn_vec2 *ends;
    int32_t end_count;
} cairn_grouping_input;

/* One object. image = origin + scale * (cosine, -sine; sine, cosine) * model. Where a field
 * differs in the mode as written, that is said behind "as written". */
typedef struct cairn_grouped_object {
    /* About the logarithm of how much likelier its segments are with the object than by chance;
     * as written the logarithm of its walk's posterior. */
    cairn_real evidence;
    /* 0 ... 1: how much of the outline was seen, and how well; as written the share of the
     * model's longest path that was walked along. */
    cairn_real score;
    /* px; as written the mean over the walk's discs */
    cairn_vec2 origin;
    /* px; as written the one that is searched */
    cairn_real size;
    /* rad; as written 0 */
    cairn_real turn;
    /* segments[first ... first + count - 1] of the result */
    int32_t first, count;
    /* along[along ... along + outline_count - 1]: which part of the model was seen, and by what */
    int32_t along;
    /* samples of the paths of which a side was seen; as written discs of the walk */
    int32_t seen;
    /* the sample of the model at which its walk began */
    int32_t start;
} cairn_grouped_object;

/* One step of the walk. */
typedef struct cairn_grouping_trace {
    cairn_real n_eff;
    /* of the best particle, mean over its steps; as written of the greatest posterior */
    cairn_real log_likelihood;
    int32_t followers, resampled, particles;
} cairn_grouping_trace;

typedef struct cairn_grouping_result {
    const cairn_grouped_object *objects; /* [object_count] that of most evidence first */
    /* Indices of the input's segments, object by object, in the order of the outline; as written
     * those left of the walk, on its way, then those right of it, on the way back. */
    const int32_t *segments;
    /* Index of the segment at each sample of the model's outline, -1: not seen; object by
     * object; as written at the samples nearest to those of the walk's discs alone. */
    const int32_t *along;
    const cairn_grouping_trace *trace; /* [steps] */
    int32_t object_count, segment_count, steps;
    /* Hypotheses: places that suit the model by a pair of tokens; as written states that the
     * first particles were drawn from, four of each symmetric point about an end of a strong
     * chain. */
    int32_t starts;
    /* pieces of segments; as written segments */
    int32_t token_count;
    /* the score of the place with most evidence, reported or not; as written of the first object */
    cairn_real best;
    /* and its evidence */
    cairn_real best_evidence;
    /* Of the mode as written alone. */
    int32_t points, points_dropped; /* symmetric points; beyond max_points */
    int32_t end;                    /* CAIRN_GROUPING_...: why the walk ended */
} cairn_grouping_result;

/* Why a walk of the mode as written ended. */
enum {
    /* no symmetric point of the model's radii lies about an end of a strong chain */
    CAIRN_GROUPING_NO_START = 0,
    /* the greatest posterior fell below 1 */
    CAIRN_GROUPING_POSTERIOR = 1,
    /* no particle could go on */
    CAIRN_GROUPING_NO_FOLLOWER = 2,
    /* max_steps */
    CAIRN_GROUPING_STEPS = 3,
    /* the memory for the histories of the particles is used up */
    CAIRN_GROUPING_HISTORIES = 4
};

typedef struct cairn_grouping cairn_grouping;

/* The values in brackets above, seed 1. */
cairn_grouping_params cairn_grouping_default(void);

/* The mode as written with the constants of the thesis. */
cairn_grouping_params cairn_grouping_as_written(void);

/* 0 for params that create() would refuse. Default: about 5 KB for every particle, whatever the
 * length of the paths; 100 bytes for every token. As written: about 13 KB for every particle, 90
 * bytes for every token, 80 for every symmetric point, and for every object 110 a step. */
size_t cairn_grouping_memory(const cairn_grouping_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_grouping_create(cairn_grouping **grouping, cairn_pool *pool,
                                                 const cairn_grouping_params *params);

/* Starts on an image; what was found before is gone. CAIRN_BAD_ARGUMENT: NULL, a range that is
 * not one, a bad model. CAIRN_FULL: an image or a model beyond the params; as written also more
 * than max_tokens segments. CAIRN_NOT_FINITE: a number of the input. Cost: linear in the model. */
CAIRN_CHECKED cairn_status cairn_grouping_begin(cairn_grouping *grouping,
                                                const cairn_grouping_input *input);

/* Goes on. CAIRN_MORE: the budget is used up. CAIRN_OK: the result stands, or nothing was begun.
 * CAIRN_NOT_FINITE: a segment (as written also an end of a chain) is not finite; CAIRN_FULL, in
 * the default mode: segments of more than 2^24 tokens; given up. Cost in the default mode: a
 * unit for every 16 pairs of tokens, and for each pair and sample of the model that go together
 * (of 2^22 pairs at most); the walk some 60 units a particle and sample; every start, every
 * walk's end and nine times every object 12 units a sample of the outline, the first two up to
 * five times. Cost as written: that of cairn_symmetric_point_step(); two samples of the path for
 * each start; every particle and step 60 units and 12 for each step before, one for each end in
 * its circles and for each pair of the nearest ten, more with the length of the walk. */
CAIRN_CHECKED cairn_status cairn_grouping_step(cairn_grouping *grouping, cairn_budget *budget);

/* All zero until step() returns CAIRN_OK; valid until the next begin(). */
cairn_grouping_result cairn_grouping_read(const cairn_grouping *grouping);

/* A particle of the walk: the model where it lies now, and the disc of the step that was last.
 * As written the model is where that disc has its sample, at the size that is searched,
 * unturned, and both sides are seen. */
typedef struct cairn_grouping_particle {
    cairn_vec2 origin; /* px */
    cairn_real size;   /* px */
    cairn_real turn;   /* rad */
    cairn_vec2 centre; /* px */
    cairn_real radius; /* px */
    cairn_real log_weight;
    int32_t sample; /* of the model */
    int32_t sides;  /* 0 ... 2: how many of the disc's were seen */
} cairn_grouping_particle;

/* The particles after the last step of the walk that ended, the first `most` of them into
 * particles[]; their number, 0 before the walk and where there was none. *steps, when not NULL:
 * steps that have ended. Cost: linear. */
int32_t cairn_grouping_particles(const cairn_grouping *grouping, cairn_grouping_particle *particles,
                                 int32_t most, int32_t *steps);

/* One symmetric point of a walk of the mode as written. Sides: 0 left of the walk in image
 * coordinates (y down), 1 right. */
typedef struct cairn_grouping_disc {
    /* px */
    cairn_vec2 centre;
    /* px */
    cairn_real radius;
    /* rad */
    cairn_real deviation;
    /* px: the open ends of both sides, about which the robot looks ahead */
    cairn_vec2 open[2];
    /* of the input */
    int32_t segment[2];
    /* of the model's longest path, nearest by (2.12) */
    int32_t sample;
    /* of the walk up to here, sum of the logarithms of (2.13) over `stop` */
    cairn_real log_posterior;
} cairn_grouping_disc;

/* The walk of a particle, from its start to the last step, the first `most` discs of it into
 * discs[]; their number, 0 where there is no such particle and in the default mode. Cost:
 * linear. */
int32_t cairn_grouping_history(const cairn_grouping *grouping, int32_t particle,
                               cairn_grouping_disc *discs, int32_t most);

/* The same of an object of the result: its skeleton. */
int32_t cairn_grouping_skeleton(const cairn_grouping *grouping, int32_t object,
                                cairn_grouping_disc *discs, int32_t most);

#ifdef __cplusplus
}
#endif

#endif
