/* Internal structures of module self_similarity. */
#ifndef CAIRN_PARTS_SELF_SIMILARITY_WORK_H
#define CAIRN_PARTS_SELF_SIMILARITY_WORK_H

#include "cairn/curve_evolution.h"
#include "cairn/inner_distance.h"
#include "cairn/self_similarity.h"
#include "src/base/object.h"
#include "src/base/step.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_self_similarity_parameters;

enum { SELF_SIMILARITY_MAX_VERTICES = 32, SELF_SIMILARITY_MAX_CUTS = 32 };
/* Variables of the fit: both end positions, bend, skew. */
enum { SELF_SIMILARITY_VARIABLES = 4 };
/* Stride of the coarse scan, samples. */
enum { SELF_SIMILARITY_SCAN_STRIDE = 2 };
/* Cells of a warping table per work unit. */
enum { SELF_SIMILARITY_CELLS_PER_UNIT = 8 };

/* A cut of the outline at two positions. Positions are in samples along the outline. */
typedef struct self_similarity_cut {
    cairn_real position[2]; /* Positions of the ends, 0 <= position < outline_samples. */
    /* The two arcs. */
    cairn_real from[2], to[2];
    cairn_real cost; /* Ranking cost. */
    /* As in cairn_self_similarity_axis. */
    cairn_real mirror_residual, dtw_cost;
    /* Mirror residual plus the penalties of bend and skew: cost without articulation. */
    cairn_real mirror_cost;
    /* Residual of the outline alone, truncated at the inlier distance. */
    cairn_real truncated_residual;
    /* Bend, rad, and skew (tangent) of the axis. */
    cairn_real bend, skew;
    /* Evolution level and division, as in cairn_self_similarity_axis. */
    int32_t vertices, division;
} self_similarity_cut;

/* Cuts after non-maximum suppression, in order of increasing cost. */
typedef struct self_similarity_list {
    self_similarity_cut cuts[SELF_SIMILARITY_MAX_CUTS];
    int32_t count;
} self_similarity_list;

/* A cyclic run of `count` vertices of an evolution level from `first`. */
typedef struct self_similarity_run {
    int32_t first, count;
} self_similarity_run;

/* The samples of both arcs: every stride-th, without the ends. */
typedef struct self_similarity_sides {
    /* First sample and number of samples of each arc. */
    int32_t first[2], count[2];
    int32_t stride;
} self_similarity_sides;

/* Both arcs in axis coordinates, the second reflected and reversed, each with the ends of the
 * axis. */
typedef struct self_similarity_axis_arcs {
    cairn_vec2 *points[2]; /* [count] */
    int32_t count[2];
} self_similarity_axis_arcs;

/* A cut and its arcs in axis coordinates. */
typedef struct self_similarity_trial {
    self_similarity_cut cut;
    self_similarity_sides sides;
    self_similarity_axis_arcs axis_arcs;
    cairn_vec2 *buffer; /* [outline_samples + 4] */
    /* [outline_samples] For each sample the nearest segment of the other arc. */
    int32_t *nearest_segment;
} self_similarity_trial;

struct cairn_self_similarity {
    cairn_self_similarity_params params;
    cairn_inner_distance *inner;
    cairn_curve_evolution *evolution;
    /* [outline_samples + hole_samples] */
    cairn_vec2 *samples;
    /* The same for a new shape, until begin() accepts it. */
    cairn_vec2 *next_samples;
    /* Number of holes and of their samples; samples[outline_samples ...]. */
    int32_t hole_total, hole_count[CAIRN_SELF_SIMILARITY_MAX_OUTLINES];
    /* [outline_samples^2] c(i, k) of eq. 4.4. */
    cairn_real *descriptor_distance;
    /* [2 * outline_samples] Two rows of the warping table: least sums. */
    cairn_real *dtw_sum;
    /* [2 * outline_samples] Lengths of the warping paths. */
    int32_t *dtw_length;
    /* [outline_samples] Samples of both arcs to be aligned. */
    int32_t *dtw_samples;
    /* Ranked cuts. */
    self_similarity_list list;
    /* Re-ranking. */
    cairn_vec2 *smoothed;   /* [outline_samples] Smoothed samples. */
    cairn_vec2 *perturbed;  /* [outline_samples + 4] Arcs with a perturbed variable. */
    cairn_vec2 *axis_holes; /* [hole_samples] Hole samples in axis coordinates. */
    /* [(1 + SELF_SIMILARITY_VARIABLES) * outline_samples] Residuals and Jacobian. */
    cairn_real *residual;
    self_similarity_list candidates; /* Cuts to be fitted. */
    self_similarity_trial trial[2];
    int32_t current_trial; /* Index of the accepted trial. */
    /* 1: trials are ranked by the residual truncated for articulated shapes. */
    int32_t robust;
    cairn_real max_distance; /* Greatest inner distance. */
    /* Degree of articulation, 0 ... 1; 0: bend and skew explain the shape. */
    cairn_real articulation;
    /* The result. */
    cairn_self_similarity_axis axes[CAIRN_SELF_SIMILARITY_MAX_AXES];
    int32_t axis_count, tie_count, rotation_order;
    cairn_self_similarity_verdict verdict;
    int64_t comparison_count;

    /* 1: axes are to be found; 1: the result is complete. */
    int32_t is_pending, is_complete;
    /* Resume points of the whole, of its current phase, and of a fit. */
    int32_t resume, phase_resume, fit_resume;
    /* Units charged for the next operation. */
    int32_t units_charged;

    /* State of a phase; no two of these phases are under way at a time. */
    union {
        /* Pairs of samples: sample indices; sum of both indices of an anti-diagonal. */
        struct {
            int32_t first_sample, second_sample, diagonal;
        };
        /* Search on evolution levels: level, positions in its list of vertices of both ends of the
         * cut, division, sample index of each vertex, runs S and T of the division. */
        struct {
            int32_t level, first_end, second_end, division;
            int32_t vertex[SELF_SIMILARITY_MAX_VERTICES];
            self_similarity_run run[2];
        };
        /* Fits: the candidate and the iteration; number of leading candidates from the scan for
         * articulated shapes; damping factor of the Levenberg-Marquardt method. */
        struct {
            int32_t candidate, iteration, scanned_count;
            cairn_real damping;
        };
        /* Rotational symmetry: order, sample, centroid of the outline, rotation by 1/order turn,
         * sums of the residuals and of the radii, number of matching orders. */
        struct {
            int32_t order, sample, matching_orders;
            cairn_vec2 centre;
            cairn_transform turn;
            cairn_real residual_sum, radius_sum;
        };
        /* Report: index of the axis. */
        int32_t axis;
    };
};

/* 1 in the mode as written, without re-ranking. */
static inline int self_similarity_is_as_written(const cairn_self_similarity *similarity)
{
    return similarity->params.mode == CAIRN_MODE_AS_WRITTEN;
}

/* Sets the distance of the descriptors of two samples. */
static inline void self_similarity_set_distance(cairn_self_similarity *similarity, int32_t i,
                                                int32_t k, cairn_real distance)
{
    int32_t n = similarity->params.outline_samples;

    similarity->descriptor_distance[i * n + k] = similarity->descriptor_distance[k * n + i] =
        distance;
}

/* ---- Cuts ---- */

/* Inserts a cut with non-maximum suppression: it is dropped if a better cut lies within the
 * radius, and replaces worse cuts within the radius. */
void cairn_self_similarity_insert(const cairn_self_similarity *similarity,
                                  self_similarity_list *list, const self_similarity_cut *cut);

/* Returns the outline point at a position, 0 <= position < outline_samples, by linear
 * interpolation; samples: [outline_samples], original or smoothed. */
cairn_vec2 cairn_self_similarity_point(const cairn_self_similarity *similarity,
                                       const cairn_vec2 *samples, cairn_real position);

/* Returns whether both arcs between samples i > k are long enough; returns that cut. */
int cairn_self_similarity_is_valid_cut(const cairn_self_similarity *similarity, int32_t i,
                                       int32_t k);
self_similarity_cut cairn_self_similarity_cut_at(int32_t i, int32_t k);

/* Sets the arcs of a cut to the whole outline between its ends. */
void cairn_self_similarity_set_arcs(const cairn_self_similarity *similarity,
                                    self_similarity_cut *cut);

/* Truncates the candidates to `kept` and appends the first `most` cuts of a list. */
void cairn_self_similarity_append_candidates(cairn_self_similarity *similarity, int32_t kept,
                                             const self_similarity_list *list, int32_t most);

/* Returns the number of samples of all holes. */
int32_t cairn_self_similarity_hole_samples(const cairn_self_similarity *similarity);

/* Dynamic time warping of first[] and second[], lists of 1 ... outline_samples samples: least
 * sum and length of its path. */
typedef struct self_similarity_alignment {
    cairn_real sum;
    int32_t length;
} self_similarity_alignment;
self_similarity_alignment cairn_self_similarity_align(cairn_self_similarity *similarity,
                                                      const int32_t *first, int32_t first_count,
                                                      const int32_t *second, int32_t second_count);

/* ---- Mirror residual ---- */

self_similarity_sides cairn_self_similarity_sides(const cairn_self_similarity *similarity,
                                                  const self_similarity_cut *cut, int32_t stride);
self_similarity_axis_arcs cairn_self_similarity_unbend(const cairn_self_similarity *similarity,
                                                       const self_similarity_cut *cut,
                                                       const self_similarity_sides *sides,
                                                       cairn_vec2 *buffer);

/* Transforms a trial's arcs to axis coordinates and sets its residuals and cost. */
void cairn_self_similarity_evaluate(cairn_self_similarity *similarity, self_similarity_trial *trial,
                                    int32_t stride);

/* Estimates bend and skew from paired points of both arcs. */
void cairn_self_similarity_estimate(const cairn_self_similarity *similarity,
                                    self_similarity_cut *cut);

/* Wraps the positions to the outline and clamps bend and skew to their bounds. */
void cairn_self_similarity_clamp(const cairn_self_similarity *similarity, self_similarity_cut *cut);

/* Returns the cost of an evaluation in units. */
int32_t cairn_self_similarity_evaluate_cost(const cairn_self_similarity *similarity,
                                            int32_t stride);

/* Fits the mirror line of an axis from its initial line; its cost in units. Requires
 * max_distance. */
void cairn_self_similarity_mirror(const cairn_self_similarity *similarity,
                                  const self_similarity_cut *cut, cairn_self_similarity_axis *axis);
int32_t cairn_self_similarity_mirror_cost(const cairn_self_similarity *similarity);

/* ---- Phases: each returns 1 when done and 0 when the budget is used up ---- */

/* Searches all levels, vertex pairs and divisions, as in the thesis. */
int cairn_self_similarity_search(cairn_self_similarity *similarity, cairn_budget *budget);

/* Re-ranks the cuts by mirror residual, and estimates the degree of articulation. */
int cairn_self_similarity_rank(cairn_self_similarity *similarity, cairn_budget *budget);

/* Re-ranks the cuts of an articulated shape. */
int cairn_self_similarity_rank_articulated(cairn_self_similarity *similarity, cairn_budget *budget);

/* Fits the cut of the current trial, within a phase. */
int cairn_self_similarity_fit(cairn_self_similarity *similarity, cairn_budget *budget);

/* Estimates the order of rotational symmetry. */
int cairn_self_similarity_rotation(cairn_self_similarity *similarity, cairn_budget *budget);

#endif
