/* What the parts of self_similarity share. */
#ifndef CAIRN_SELF_SIMILARITY_WORK_H
#define CAIRN_SELF_SIMILARITY_WORK_H

#include "cairn/curve_evolution.h"
#include "cairn/inner_distance.h"
#include "cairn/self_similarity.h"

enum { SIMILARITY_VERTICES = 32, SIMILARITY_KEPT = 32 };
/* Of a fit: where the axis ends, its bend, its skew. */
enum { SIMILARITY_VARIABLES = 4 };
/* Of a coarse scan: so many samples apart. */
enum { SIMILARITY_STRIDE = 2 };
/* Units: cells of a warp's table. */
enum { SIMILARITY_CELLS_A_UNIT = 8 };

typedef int32_t similarity_phase;
enum {
    SIMILARITY_IDLE,
    SIMILARITY_INNER,
    SIMILARITY_EVOLVE,
    SIMILARITY_COMPARE,
    SIMILARITY_SPLIT,
    SIMILARITY_SCAN,
    SIMILARITY_FIT,
    SIMILARITY_COMPARE_NEAR,
    SIMILARITY_SLIDE,
    SIMILARITY_SCAN_NEAR,
    SIMILARITY_BLEND,
    SIMILARITY_TURN,
    SIMILARITY_JUDGE,
    SIMILARITY_DONE
};

/* A cut of the outline. Places are in samples, along the outline. */
typedef struct similarity_cut {
    cairn_real place[2]; /* of the ends, 0 <= place < points */
    cairn_real from[2], to[2];
    cairn_real cost; /* by which it is ranked */
    cairn_real misfit, warp;
    cairn_real whole; /* misfit, bend and skew: what the cut costs where joints explain nothing */
    cairn_real close; /* the misfit of the outline alone, with distances that end to count early */
    cairn_real bend, skew;
    int32_t vertices, division;
} similarity_cut;

/* Cuts apart from each other, best first. */
typedef struct similarity_list {
    similarity_cut cuts[SIMILARITY_KEPT];
    int32_t count;
} similarity_list;

/* Which samples lie on either side of an axis: every stride-th, without its ends. */
typedef struct similarity_sides {
    int32_t first[2], count[2];
    int32_t stride;
} similarity_sides;

/* Both arcs taken back to a straight axis, the second turned over and walked backward, each with
 * the ends of the axis. */
typedef struct similarity_flat {
    cairn_vec2 *points[2]; /* [count] */
    int32_t count[2];
} similarity_flat;

/* A cut with its arcs laid flat. */
typedef struct similarity_trial {
    similarity_cut cut;
    similarity_sides sides;
    similarity_flat flat;
    cairn_vec2 *room; /* [points + 4] */
    int32_t *near;    /* [points] for each sample the side of the other arc that is nearest */
} similarity_trial;

struct cairn_self_similarity {
    cairn_self_similarity_params params;
    cairn_inner_distance *inner;
    cairn_curve_evolution *evolution;
    /* [points + hole_points] */
    cairn_vec2 *samples;
    /* the same, of a shape that may be refused yet */
    cairn_vec2 *next;
    /* samples[points ...]: those of holes */
    int32_t holes, hole_count[CAIRN_SYMMETRY_OUTLINES];
    /* [points * points] c(i, k) of eq. 4.4 */
    cairn_real *unlike;
    /* [2 * points] two rows of a warp */
    cairn_real *sum;
    /* [2 * points] */
    int32_t *steps;
    /* [points] samples of both arcs as they are warped */
    int32_t *walk;
    similarity_list list;
    similarity_phase phase;
    int32_t paid;
    /* what the phase is at */
    int32_t i, k;
    /* The level that is searched. */
    int32_t level, division;
    int32_t vertex[SIMILARITY_VERTICES];
    /* Re-ranked. */
    cairn_vec2 *smooth;      /* [points] */
    cairn_vec2 *nudged;      /* [points + 4] arcs laid flat a little off */
    cairn_vec2 *flat_holes;  /* [hole_points] */
    cairn_real *residual;    /* [(1 + SIMILARITY_VARIABLES) * points] */
    similarity_list scanned; /* what is to be fitted */
    similarity_trial trial[2];
    int32_t current; /* the trial that stands */
    int32_t round;   /* of the fit */
    int32_t warped;  /* of scanned: the first so many come from the scan of joints */
    int32_t robust;  /* 1: trials are judged by what lies close, limbs may have turned */
    cairn_real damping;
    cairn_real span;    /* the greatest inner distance */
    cairn_real jointed; /* 0: a bend and a skew explain the shape; 1: they do not */
    /* Rotations: sums over the samples of a turn, how many turns fit. */
    cairn_real turned, size;
    int32_t fitting;
    /* The result. */
    cairn_symmetry_axis axes[CAIRN_SYMMETRY_AXES];
    int32_t axis_count, ties, rotations;
    cairn_symmetry_verdict verdict;
    int64_t comparisons;
};

/* The least warp of first[] onto second[], lists of samples, each of 1 ... points: its sum and
 * its pairs. */
typedef struct similarity_warp {
    cairn_real sum;
    int32_t pairs;
} similarity_warp;
similarity_warp cairn_similarity_warp(cairn_self_similarity *s, const int32_t *first,
                                      int32_t first_count, const int32_t *second,
                                      int32_t second_count);

/* Keeps a cut unless a better one is near, in place of worse ones that are. */
void cairn_similarity_offer(const cairn_self_similarity *s, similarity_list *list,
                            const similarity_cut *cut);

/* Where the outline is at a place, 0 <= place < points; samples: [points], those of the outline
 * or the smoothed ones. */
cairn_vec2 cairn_similarity_point(const cairn_self_similarity *s, const cairn_vec2 *samples,
                                  cairn_real place);

/* Samples of all holes together. */
int32_t cairn_similarity_hole_samples(const cairn_self_similarity *s);

/* The thesis's search over levels, pairs and divisions. */
void cairn_similarity_split_begin(cairn_self_similarity *s);
cairn_status cairn_similarity_split_step(cairn_self_similarity *s, cairn_budget *budget);

/* ---- Arcs as mirror images of each other ---- */

similarity_sides cairn_similarity_sides(const cairn_self_similarity *s, const similarity_cut *cut,
                                        int32_t stride);
similarity_flat cairn_similarity_lay(const cairn_self_similarity *s, const similarity_cut *cut,
                                     const similarity_sides *sides, cairn_vec2 *room);

/* Lays a trial's cut flat and sets its misfit and cost. */
void cairn_similarity_try(cairn_self_similarity *s, similarity_trial *trial, int32_t stride);

/* The bend and skew that a cut's ends and what lies between them speak for. */
void cairn_similarity_guess(const cairn_self_similarity *s, similarity_cut *cut);

/* Keeps places on the outline, bend and skew within what is looked at. */
void cairn_similarity_limit(const cairn_self_similarity *s, similarity_cut *cut);

/* Units of a trial. */
int32_t cairn_similarity_trial_units(const cairn_self_similarity *s, int32_t stride);

/* Fits the cut of the standing trial; CAIRN_OK: it is as good as it gets. */
void cairn_similarity_fit_begin(cairn_self_similarity *s, const similarity_cut *cut);
cairn_status cairn_similarity_fit_step(cairn_self_similarity *s, cairn_budget *budget);

/* Fits the mirror line of an axis from where it lies; and its units. Needs the span. */
void cairn_similarity_mirror(const cairn_self_similarity *s, const similarity_cut *cut,
                             cairn_symmetry_axis *axis);
int32_t cairn_similarity_mirror_units(const cairn_self_similarity *s);

/* ---- Re-ranking: one function for each of its phases ---- */

void cairn_similarity_scan_begin(cairn_self_similarity *s);
cairn_status cairn_similarity_scan_step(cairn_self_similarity *s, cairn_budget *budget);
void cairn_similarity_fits_begin(cairn_self_similarity *s);
cairn_status cairn_similarity_fits_step(cairn_self_similarity *s, cairn_budget *budget);

/* Whether the ends of the cut at samples i > k are far enough apart both ways round; that cut. */
int cairn_similarity_makes_cut(const cairn_self_similarity *s, int32_t i, int32_t k);
similarity_cut cairn_similarity_cut_at(int32_t i, int32_t k);

/* Puts the first `most` cuts of a list behind the first `kept` of those that are to be looked
 * at. */
void cairn_similarity_line_up(cairn_self_similarity *s, int32_t kept, const similarity_list *list,
                              int32_t most);

/* Makes the cut between the places of its ends a division of all of the outline. */
void cairn_similarity_set_arcs(const cairn_self_similarity *s, similarity_cut *cut);

/* Re-ranking where limbs turned at joints. */
cairn_status cairn_similarity_near_step(cairn_self_similarity *s, cairn_budget *budget);
cairn_status cairn_similarity_slide_step(cairn_self_similarity *s, cairn_budget *budget);
void cairn_similarity_scan_near_begin(cairn_self_similarity *s);
cairn_status cairn_similarity_scan_near_step(cairn_self_similarity *s, cairn_budget *budget);
void cairn_similarity_blend_begin(cairn_self_similarity *s);
cairn_status cairn_similarity_blend_step(cairn_self_similarity *s, cairn_budget *budget);

/* After which turns the shape looks the same. */
void cairn_similarity_turn_begin(cairn_self_similarity *s);
cairn_status cairn_similarity_turn_step(cairn_self_similarity *s, cairn_budget *budget);

#endif
