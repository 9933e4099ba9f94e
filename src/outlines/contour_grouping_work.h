/* Shared definitions of the contour_grouping sources. */
#ifndef CAIRN_OUTLINES_CONTOUR_GROUPING_WORK_H
#define CAIRN_OUTLINES_CONTOUR_GROUPING_WORK_H

#include "src/base/object.h"
#include "src/base/step.h"
#include "src/containers/cell_grid.h"
#include "src/outlines/contour_grouping_variants.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_contour_grouping_parameters;

/* Cell sides, px: of the token index, and of the edge-orientation map for hypothesis generation. */
enum { CONTOUR_GROUPING_TOKEN_CELL_PX = 8, CONTOUR_GROUPING_EDGE_CELL_PX = 4 };
/* Quantized directions of a chord between two tokens, over the full circle. */
enum { CONTOUR_GROUPING_CHORD_DIRECTIONS = 64 };
/* Greatest number of tokens matched to one side in a step, followers of a particle, and candidate
 * states of a step (each side may also be unmatched). */
enum {
    CONTOUR_GROUPING_MAX_SIDE_TOKENS = 3,
    CONTOUR_GROUPING_MAX_FOLLOWERS = 4,
    CONTOUR_GROUPING_MAX_CANDIDATES =
        (CONTOUR_GROUPING_MAX_SIDE_TOKENS + 1) * (CONTOUR_GROUPING_MAX_SIDE_TOKENS + 1)
};
/* States of an outline sample in the dynamic program: occluded, or matched to one of the nearest
 * tokens. */
enum { CONTOUR_GROUPING_MAX_NODES = 5 };

/* A token: a short piece of a segment. */
typedef struct contour_grouping_token {
    cairn_vec2 middle, direction; /* px, midpoint; unit direction */
    cairn_real half_length;       /* px */
    /* index of its segment in the input */
    int32_t segment;
    int32_t chain;   /* chain index; consecutive tokens of a chain are adjacent, in order */
    int32_t is_used; /* 1: claimed by an object */
} contour_grouping_token;

/* Search data of a token. The tokens of a cell are contiguous in memory, and so are the cells of a
 * row. */
typedef struct contour_grouping_sorted_token {
    cairn_vec2 middle, direction;
    cairn_real half_length;
    int32_t token;
} contour_grouping_sorted_token;

/* A node of the dynamic program: one state of an outline sample. */
typedef struct contour_grouping_node {
    cairn_real value; /* nats, score of the best path that ends here */
    /* cost: half the squared distance in sigmas; offset: signed distance across the outline in
     * sigmas */
    cairn_real cost, offset;
    int32_t token;       /* -1: occluded */
    int32_t predecessor; /* state of the previous sample on the best path */
} contour_grouping_node;

/* A pose hypothesis. */
typedef struct contour_grouping_hypothesis {
    cairn_similarity pose;
    cairn_real size; /* px, size when generated */
    /* edge coverage of the outline when generated, 0 ... 1; evidence (nats) after refinement */
    cairn_real score;
    /* model sample that generated it */
    int32_t sample;
} contour_grouping_hypothesis;

/* Half-open range of model samples whose chords may have one direction. */
typedef struct contour_grouping_sample_range {
    int16_t from, to;
} contour_grouping_sample_range;

/* Sums for the least-squares similarity transform: weight, weighted squared norms, dot and cross
 * products, and weighted coordinate sums of both point sets. */
typedef struct contour_grouping_fit_sums {
    cairn_real weight, model_squared, dot, cross;
    cairn_vec2 model, image;
} contour_grouping_fit_sums;

/* State of a particle: one step of its trajectory along the model's path. */
typedef struct contour_grouping_state {
    cairn_similarity pose;
    contour_grouping_fit_sums sums;
    cairn_vec2 offset[2];     /* px, offset of the contour from the posed model on either side */
    cairn_vec2 last_point[2]; /* px, last matched point on either side */
    cairn_vec2 centre;        /* px, centre of the symmetric point */
    /* px, rad, of the symmetric point */
    cairn_real radius, deviation;
    /* px, mean gap to the previous matched points */
    cairn_real gap;
    int32_t token[2]; /* -1: unmatched */
    int32_t sample, start;
} contour_grouping_state;

/* Limits and weights that follow from the input. */
typedef struct contour_grouping_limits {
    /* unit vector of the middle of the rotation range; cosine of half the range */
    cairn_vec2 middle_rotation;
    cairn_real min_rotation_cosine;
    /* px, greatest distance between the two sides of a sample */
    cairn_real max_chord;
    /* px^2, squared size range, widened for rounding errors */
    cairn_real min_size_squared, max_size_squared;
    /* squared cosine of half the rotation range, reduced for rounding errors; < 0: all rotations */
    cairn_real min_cosine_squared;
    /* logarithm of missing_likelihood */
    cairn_real log_missing;
    /* nats per piece of outline, penalty for dense edges */
    cairn_real clutter_cost;
    /* mean distance of the outline's samples, share of the size */
    cairn_real spacing;
    contour_grouping_sample_range chord_samples[CONTOUR_GROUPING_CHORD_DIRECTIONS];
} contour_grouping_limits;

/* The posed outline and its match to the tokens. */
typedef struct contour_grouping_outline {
    /* [max_outline] matched token of each sample, -1: occluded */
    int32_t *match;
    /* [max_outline] cost of each match, half the squared distance in sigmas */
    cairn_real *cost;
    /* [max_outline] px, deformation: offset of the contour from the posed outline; and its next
     * iterate */
    cairn_vec2 *shift, *next_shift;
    /* [max_outline] distance to the nearest matched sample, in samples */
    int32_t *match_distance;
    /* [max_outline] curvature weight of each sample, 0 straight ... 1 sharp */
    cairn_real *curvature;
    /* [max_outline * CONTOUR_GROUPING_MAX_NODES] */
    contour_grouping_node *nodes;
    /* pose, its evidence, and the greatest evidence of any pose so far, nats */
    cairn_similarity pose;
    cairn_real evidence, max_evidence;
    /* 1: the current object is accepted, and its own tokens are being listed */
    int32_t is_listing;
    /* sample of the match, and nodes of the previous one; round of a refinement */
    int32_t sample, node_count, round;
} contour_grouping_outline;

/* Pieces of all segments, which may exceed max_tokens; pieces cut so far. */
typedef struct contour_grouping_pieces {
    int32_t count, cut;
    cairn_real length; /* px, of all tokens */
} contour_grouping_pieces;

/* What was found so far. */
typedef struct contour_grouping_found {
    int32_t hypothesis_count, object_count, segment_count, step_count, generated_count;
    cairn_real best_score, best_evidence;
} contour_grouping_found;

struct cairn_contour_grouping {
    cairn_contour_grouping_input input;
    /* state of the mode as written; NULL in the default mode */
    struct contour_grouping_written *written;
    cairn_particle_filter *filter;
    contour_grouping_token *tokens;
    /* [max_tokens] ordered by cell */
    contour_grouping_sorted_token *sorted_tokens;
    /* [cells + 1] first token of each cell in sorted_tokens */
    int32_t *cell_start;
    /* [edge cells] bit set of quantized edge directions near each cell */
    uint8_t *edge_map;
    /* [particles] */
    contour_grouping_hypothesis *hypotheses;
    /* [max_samples] */
    cairn_contour_grouping_trace *trace;
    /* [max_objects * max_outline] */
    int32_t *segments;
    cairn_contour_grouping_object *objects;
    /* [max_objects * max_outline] matched segment of each sample of an object's outline */
    int32_t *along;
    contour_grouping_pieces pieces;
    int32_t token_count;
    /* cells of the tokens; of the edge-orientation map */
    cell_grid grid, edge_grid;
    /* 1: the filter holds the particles of this image */
    int32_t has_particles;
    contour_grouping_limits limits;
    contour_grouping_outline outline;
    contour_grouping_found found;

    /* 1: objects are to be found; 1: the result is complete */
    int32_t is_pending, is_complete;
    /* < 0: the error that ended the search */
    cairn_status status;
    /* resume points: of the whole, of its current phase, of a refinement, of a match */
    int32_t resume, phase_resume, refine_resume, match_resume;
    /* work units charged for the next operation; in the running callback */
    int32_t units_charged, callback_units_charged;
    /* state of a phase; no two of these phases are under way at a time */
    union {
        /* tokens: cell, segment and token */
        struct {
            int32_t cell, segment, token;
        };
        /* hypotheses: cell of the edge-orientation map; first and second token of a pair */
        struct {
            int32_t edge_cell, first, second;
        };
        /* filter: hypotheses at which particles started; 1: another step follows */
        struct {
            int32_t started, is_filtering;
        };
        /* objects: the hypothesis, particle or object that is matched; final poses recorded; path or
         * outline sample of the object that is listed */
        struct {
            int32_t candidate, end_count, sample;
        };
    };
    cairn_contour_grouping_params params;
};

/* Adds a weighted point pair (model point, image point) to the sums. */
void cairn_contour_grouping_add_point(contour_grouping_fit_sums *sums, cairn_vec2 m, cairn_vec2 p,
                                      cairn_real weight);
/* Least-squares similarity transform of the sums (Umeyama, closed form); `otherwise` when it is
 * degenerate. */
cairn_similarity cairn_contour_grouping_fit_pose(const contour_grouping_fit_sums *sums,
                                                 const cairn_similarity *otherwise);

/* Sums of a prior that pulls the fit towards a pose with the weight of `weight` points. */
contour_grouping_fit_sums cairn_contour_grouping_pose_prior(const cairn_similarity *pose,
                                                            cairn_real weight);

/* Finds the tokens nearest to a contour point and its direction, at most `most`, by ascending cost
 * (half the squared distance in sigmas). Returns their number. */
int32_t cairn_contour_grouping_match_tokens(const cairn_contour_grouping *grouping, cairn_vec2 at,
                                            cairn_vec2 direction, cairn_real sigma, int32_t most,
                                            int32_t *token, cairn_real *cost);

/* Nearest point on a token's segment to p. */
cairn_vec2 cairn_contour_grouping_nearest_point(const cairn_contour_grouping *grouping,
                                                int32_t token, cairn_vec2 p);

/* Callbacks of the particle filter. */
cairn_particle_filter_model cairn_contour_grouping_filter_model(cairn_contour_grouping *grouping);

/* Precomputation from the model: for hypotheses; for the outline. */
void cairn_contour_grouping_begin_hypotheses(cairn_contour_grouping *grouping);
void cairn_contour_grouping_begin_outline(cairn_contour_grouping *grouping);

/* The clutter cost, from the length of the tokens. */
void cairn_contour_grouping_set_clutter_cost(cairn_contour_grouping *grouping);

/* ---- Steps: each returns 1 when done; 0 when the budget is used up, or when `status` was set to
 * an error ---- */

/* Deforms the outline to its matches, sample by sample, for the next matching while the tokens of
 * an object are listed. */
int cairn_contour_grouping_deform_outline(cairn_contour_grouping *grouping, cairn_budget *budget);

/* Matches the posed outline to the tokens: match[], cost[], evidence. */
int cairn_contour_grouping_match_outline(cairn_contour_grouping *grouping, cairn_budget *budget);

/* Refines the pose iteratively. */
int cairn_contour_grouping_refine_pose(cairn_contour_grouping *grouping, cairn_budget *budget);

/* The phases, in order: tokens, hypotheses from pairs of tokens, refinement of the hypotheses, the
 * particle filter, refinement of the particles' final poses, and selection of the objects by
 * non-maximum suppression. */
int cairn_contour_grouping_make_tokens(cairn_contour_grouping *grouping, cairn_budget *budget);
int cairn_contour_grouping_generate_hypotheses(cairn_contour_grouping *grouping,
                                               cairn_budget *budget);
int cairn_contour_grouping_refine_hypotheses(cairn_contour_grouping *grouping,
                                             cairn_budget *budget);
int cairn_contour_grouping_run_filter(cairn_contour_grouping *grouping, cairn_budget *budget);
int cairn_contour_grouping_refine_particles(cairn_contour_grouping *grouping, cairn_budget *budget);
int cairn_contour_grouping_select_objects(cairn_contour_grouping *grouping, cairn_budget *budget);

#endif
