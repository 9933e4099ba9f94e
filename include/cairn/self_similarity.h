/* self_similarity: axes of mirror symmetry of a shape (bilateral symmetry detection), also of
 * shapes that are skewed, articulated, bent or noisy.
 *
 * Method:
 * 1. As written in the thesis (CAIRN_MODE_AS_WRITTEN): two critical points of discrete curve
 *    evolution cut the outline into two arcs. Each outline sample has a descriptor, its inner
 *    distances to all other samples. Dynamic time warping compares the two arcs: their
 *    dissimilarity is the least sum of descriptor distances along a path from corner to corner of
 *    the arcs' matrix (eq. 4.1 to 4.4). The cut of least dissimilarity over 16 levels is the axis.
 * 2. By default (CAIRN_MODE_DEFAULT) the sum is divided by the path length, and cuts between
 *    critical points are tried as well.
 * 3. The best cuts are re-ranked by the mirror residual of one arc to the other. A bend and a skew
 *    of the whole shape are fitted and removed first (Levenberg-Marquardt).
 * 4. If bend and skew do not explain the shape, cuts are re-ranked by parts. A limb that turned at
 *    a joint matches its counterpart up to a rigid motion.
 *
 * Choices of the mode as written, where the text is silent or misprinted:
 * - N = 96 outline samples; the text gives no number. Holes are outside of the shape.
 * - D' begins at the point itself, as D does. Eq. 4.3 as printed is shifted by one sample.
 * - The norm of eq. 4.4 is Euclidean, in units of sqrt(N) times the greatest distance. That is one
 *   factor for all cuts of a shape, so the ranking does not depend on it.
 * - If two arcs share no end point, the axis ends halfway between their ends.
 * - Among equal cuts the coarser level wins.
 * - Ties, rotations and the axes after the first are not in the text.
 *
 * Source: Adluru 2008, chapter 4. */
#ifndef CAIRN_SELF_SIMILARITY_H
#define CAIRN_SELF_SIMILARITY_H

#include "cairn/curve.h"
#include "cairn/object.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Capacity of the list of axes. */
#define CAIRN_SELF_SIMILARITY_MAX_AXES 16
/* Greatest number of outlines of a shape. */
#define CAIRN_SELF_SIMILARITY_MAX_OUTLINES 16

/* Parameters; defaults in brackets. */
typedef struct cairn_self_similarity_params {
    /* CAIRN_MODE_DEFAULT or CAIRN_MODE_AS_WRITTEN (CAIRN_MODE_DEFAULT): method; the default one
     * re-ranks the axes */
    int32_t mode;
    /* 16 ... 512 (96): samples of the outline */
    int32_t outline_samples;
    /* 0 or 4 ... 512 (48): greatest number of samples of all holes together; 0: holes are filled */
    int32_t hole_samples;
    /* 4 ... 32 (5): vertices of the coarsest evolution level */
    int32_t min_vertices;
    /* min_vertices ... 32 (20): vertices of the finest level, at most outline_samples */
    int32_t max_vertices;
    /* >= 0 (0.01): relative tie tolerance: axes whose dissimilarity exceeds the best by at most
     * this ratio tie with it */
    cairn_real tie_ratio;
    /* >= 0 (0.001): absolute tie tolerance of the dissimilarity */
    cairn_real tie_floor;
    /* share of the outline's length, > 0, <= 0.25 (0.05): non-maximum-suppression radius: axes with
     * all ends closer are one */
    cairn_real separation;
} cairn_self_similarity_params;

/* Detector of symmetry axes of an outline. */
typedef struct cairn_self_similarity cairn_self_similarity;

/* Returns the default parameters. */
cairn_self_similarity_params cairn_self_similarity_default(void);

/* Returns CAIRN_MODE_AS_WRITTEN with the thesis's 5 to 20 vertices and the other values as
 * above. */
cairn_self_similarity_params cairn_self_similarity_as_written(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_self_similarity_check(const cairn_self_similarity_params *params,
                                                       cairn_object_fault *fault);

/* Returns the memory of a detector in bytes; 0 for params that create() rejects. Grows with the
 * square of the samples. */
size_t cairn_self_similarity_memory(const cairn_self_similarity_params *params);

/* Creates a detector. CAIRN_BAD_ARGUMENT: invalid params. CAIRN_NO_MEMORY: the pool is too
 * small. */
CAIRN_CHECKED cairn_status cairn_self_similarity_create(cairn_self_similarity **similarity,
                                                        cairn_pool *pool,
                                                        const cairn_self_similarity_params *params);

/* Starts on a shape: outlines[0] is its outline, the others are holes, in either orientation.
 * They are sampled here and may be freed afterwards. CAIRN_BAD_ARGUMENT: NULL, count below 1, an
 * outline of fewer than 3 vertices or an open outline. CAIRN_FULL: more than
 * CAIRN_SELF_SIMILARITY_MAX_OUTLINES outlines. CAIRN_NOT_FINITE: a vertex, or coordinates so
 * large that lengths or areas overflow. CAIRN_EMPTY: an outline without area. Cost: linear in
 * the vertices.
 *
 * outlines: [count] closed outlines */
CAIRN_CHECKED cairn_status cairn_self_similarity_begin(cairn_self_similarity *similarity,
                                                       const cairn_curve *outlines, int32_t count);

/* Resumes the computation. CAIRN_MORE: the budget is used up. CAIRN_OK: the result is complete,
 * or nothing was begun. */
CAIRN_CHECKED cairn_status cairn_self_similarity_step(cairn_self_similarity *similarity,
                                                      cairn_budget *budget);

/* An arc of the outline. Positions are shares of the outline's length from the first vertex of
 * outlines[0], in the order of its vertices. 0 <= from < 1, from <= to <= from + 1. As written
 * an arc may be one critical point, from == to. */
typedef struct cairn_self_similarity_arc {
    /* start and end, shares of the outline's length */
    cairn_real from, to;
} cairn_self_similarity_arc;

/* An axis that divides the outline into two similar arcs. */
typedef struct cairn_self_similarity_axis {
    /* End points of the axis on the outline, in the units of the outline. */
    cairn_vec2 end[2];
    /* Positions of the end points, shares of the outline's length, 0 ... 1; arc[0] begins at
     * position[0]. */
    cairn_real position[2];
    /* The two arcs; stretches between critical points are left out. */
    cairn_self_similarity_arc arc[2];
    /* Ranking score, >= 0, relative to the greatest inner distance; as written c(S, T). */
    cairn_real dissimilarity;
    /* Mean mirror residual of one arc to the other, relative to the greatest inner distance; 0
     * as written. */
    cairn_real mirror_residual;
    /* Mean dynamic-time-warping cost of the arcs, relative to a quarter of the greatest inner
     * distance; 0: no articulated limbs. */
    cairn_real dtw_cost;
    /* Bend: change of the axis direction from end[0] to end[1], rad; 0 as written. */
    cairn_real bend;
    /* Skew: tangent of the angle between the ribs and the normal of the axis; 0 as written. */
    cairn_real skew;
    /* Mirror line that fits one arc best to the other: a point on the line and its unit
     * direction. Without bend and skew it is the axis itself, estimated from all samples and not
     * from its ends alone. As written: the line through both ends. */
    cairn_vec2 mirror_point, mirror_direction;
    /* Vertices of the evolution level of the cut; 0: a cut between critical points. */
    int32_t vertices;
    /* Division of the cyclic sequence, 1 ... 4 as in the thesis; 0 when re-ranked. */
    int32_t division;
} cairn_self_similarity_axis;

/* Whether the best axis is unique. */
typedef int32_t cairn_self_similarity_verdict;
enum {
    /* One axis is better than all others. */
    CAIRN_SELF_SIMILARITY_SINGLE = 0,
    /* Several axes tie: the first tie_count of the list. */
    CAIRN_SELF_SIMILARITY_MULTIPLE = 1,
    /* Circular symmetry: no single axis, the tied axes end all over the outline. */
    CAIRN_SELF_SIMILARITY_CIRCULAR = 2
};

/* The axes of a shape and its rotational symmetry. */
typedef struct cairn_self_similarity_result {
    /* [count] Local minima of the dissimilarity, best first. */
    const cairn_self_similarity_axis *axes;
    /* Number of axes. */
    int32_t count;
    /* Axes that tie with the best, itself included. */
    int32_t tie_count;
    /* Whether the best axis is unique. */
    cairn_self_similarity_verdict verdict;
    /* Order n of rotational symmetry: a rotation by 1/n turn maps the shape to itself. 1: none;
     * 0: any angle. */
    int32_t rotation_order;
    /* [sample_count] Equidistant samples of the outline from its first vertex. */
    const cairn_vec2 *samples;
    /* Number of outline samples. */
    int32_t sample_count;
    /* Number of arc comparisons. */
    int64_t comparison_count;
} cairn_self_similarity_result;

/* Returns the result. All zero until step() returns CAIRN_OK; valid until the next begin(). */
cairn_self_similarity_result cairn_self_similarity_read(const cairn_self_similarity *similarity);

#ifdef __cplusplus
}
#endif

#endif
