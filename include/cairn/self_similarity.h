/* self_similarity: the axes that divide a shape into two parts most alike: of mirror symmetry, also
 * of shapes that are skewed, bent at their joints, bent as a whole, or noisy.
 *
 * As written in the thesis (CAIRN_MODE_AS_WRITTEN): the outline is cut at two critical points
 * (discrete curve evolution) into two arcs, and the arcs are compared by what their points see of
 * the shape, their inner distances to all of its outline: the dissimilarity is the least sum of
 * distances along a path from corner to corner of their matrix (Adluru 2008, chapter 4, eq. 4.1 to
 * 4.4); the least one of all cuts on 16 levels is the axis. By default it is re-ranked: the sum is
 * divided by the path's length, places between critical points are tried, too, and the best cuts
 * are judged once more by how well one side is the mirror image of the other when a bend and a skew
 * of the whole are taken back; where those do not explain the shape, by its parts: what turned at a
 * joint looks the same on both sides up to a motion.
 *
 * Choices of the mode as written, where the text is silent or misprinted: N = 96 samples of the
 * outline (no number is given), holes of the shape are outside, D' begins at the point itself as
 * D does (eq. 4.3 as printed is shifted by one sample), the norm of eq. 4.4 is Euclidean and
 * told in units of sqrt(N) times the greatest distance (one factor for all cuts of a shape: no
 * order changes, on a level or across levels), levels that discrete curve evolution does not
 * reach without touching itself are left out, an axis ends halfway between the arcs' ends where
 * they share none, of equal cuts the coarser level's is the better one. Ties, rotations and the
 * list behind the first axis are not of the text. */
#ifndef CAIRN_SELF_SIMILARITY_H
#define CAIRN_SELF_SIMILARITY_H

#include "cairn/curve.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The most axes that are listed. */
#define CAIRN_SYMMETRY_AXES 16
/* The most outlines of a shape. */
#define CAIRN_SYMMETRY_OUTLINES 16

typedef struct cairn_self_similarity_params {
    /* CAIRN_MODE_DEFAULT: re-ranked, or CAIRN_MODE_AS_WRITTEN (DEFAULT) */
    int32_t mode;
    /* samples of the outline, 16 ... 512 (96) */
    int32_t points;
    /* samples of all holes together at most, 0: holes are filled, or 4 ... 512 (48) */
    int32_t hole_points;
    /* of the coarsest level, 4 ... 32 (5) */
    int32_t least_vertices;
    /* of the finest, least_vertices ... 32, at most `points` (20) */
    int32_t most_vertices;
    /* >= 0, of the best dissimilarity: axes no worse than that are as good (0.01) */
    cairn_real tie;
    /* >= 0: so is what differs less than that (0.001) */
    cairn_real tie_floor;
    /* > 0 ... 0.25, of the outline: axes whose ends are all nearer are one (0.05) */
    cairn_real separation;
} cairn_self_similarity_params;

typedef struct cairn_self_similarity cairn_self_similarity;

/* The values in brackets above. */
cairn_self_similarity_params cairn_self_similarity_default(void);

/* CAIRN_MODE_AS_WRITTEN, the thesis's 5 to 20 vertices, the other values as above. */
cairn_self_similarity_params cairn_self_similarity_as_written(void);

/* 0 for params that create() would refuse. Grows with the square of the points. */
size_t cairn_self_similarity_memory(const cairn_self_similarity_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_self_similarity_create(cairn_self_similarity **similarity,
                                                        cairn_pool *pool,
                                                        const cairn_self_similarity_params *params);

/* Starts on a shape: outlines[0] its outline, the others holes in it, in either sense; they are
 * sampled here and need not stay. CAIRN_BAD_ARGUMENT: NULL, count below 1, an outline of fewer
 * than 3 vertices or that is not closed. CAIRN_FULL: more than CAIRN_SYMMETRY_OUTLINES outlines.
 * CAIRN_NOT_FINITE: a vertex, or coordinates so large that lengths and areas are not.
 * CAIRN_EMPTY: an outline without area. Cost: linear in the vertices. */
CAIRN_CHECKED cairn_status cairn_self_similarity_begin(cairn_self_similarity *similarity,
                                                       const cairn_curve *outlines, int32_t count);

/* Goes on. CAIRN_MORE: the budget is used up. CAIRN_OK: the result stands, or nothing was begun. */
CAIRN_CHECKED cairn_status cairn_self_similarity_step(cairn_self_similarity *similarity,
                                                      cairn_budget *budget);

/* Part of the outline, in shares of its length from the first vertex of outlines[0], in the
 * sense of its vertices: from `from`, which is below 1, on to `to`, which may be up to from + 1;
 * as written an arc may be one critical point, from == to. */
typedef struct cairn_symmetry_arc {
    cairn_real from, to;
} cairn_symmetry_arc;

typedef struct cairn_symmetry_axis {
    /* where the axis leaves the outline */
    cairn_vec2 end[2];
    /* the same in shares of the outline's length, 0 ... 1; arc[0] begins at place[0] */
    cairn_real place[2];
    /* the two parts, what lies between critical points left out */
    cairn_symmetry_arc arc[2];
    /* >= 0, of the greatest inner distance: by which axes are ranked; as written c(S, T) */
    cairn_real dissimilarity;
    /* of that: how far one arc is from the mirror image of the other in the mean; 0 as written */
    cairn_real misfit;
    /* and, of a quarter of it: how unlike stretches of the arcs are; 0: no limbs turned */
    cairn_real warp;
    /* rad, by which the axis turns from end[0] to end[1]; 0 as written */
    cairn_real bend;
    /* tangent of the angle by which ribs lean against the axis; 0 as written */
    cairn_real skew;
    /* The line in which one arc, mirrored, lies best on the other: a point of it and its
     * direction, of length 1. Of an axis that neither bends nor leans it is the axis itself,
     * told by all samples and not by its ends alone. As written: that through both ends. */
    cairn_vec2 mirror_point, mirror_along;
    int32_t vertices; /* of the level that it was found on; 0: between critical points */
    int32_t division; /* 1 ... 4 of the thesis; 0 when re-ranked */
} cairn_symmetry_axis;

typedef int32_t cairn_symmetry_verdict;
enum {
    /* one axis is better than all others */
    CAIRN_SYMMETRY_ONE = 0,
    /* several are as good: the first `ties` of the list */
    CAIRN_SYMMETRY_MANY = 1,
    /* there is no single axis: those as good as the best end all over the outline */
    CAIRN_SYMMETRY_ROUND = 2
};

typedef struct cairn_self_similarity_result {
    /* [count], best first: local minima of dissimilarity */
    const cairn_symmetry_axis *axes;
    int32_t count;
    /* axes as good as the best, itself counted */
    int32_t ties;
    cairn_symmetry_verdict verdict;
    /* the shape looks the same after so many turns of a whole one: 1: not; 0: after any */
    int32_t rotations;
    /* [sample_count] of the outline, evenly along it from its first vertex */
    const cairn_vec2 *samples;
    int32_t sample_count;
    /* of two arcs */
    int64_t comparisons;
} cairn_self_similarity_result;

/* All zero until step() returns CAIRN_OK; valid until the next begin(). */
cairn_self_similarity_result cairn_self_similarity_read(const cairn_self_similarity *similarity);

#ifdef __cplusplus
}
#endif

#endif
