/* contour_search_fit: deformation of a model's outline to the edges around an object (deformable
 * template matching). Private to the folder detection. */
#ifndef CAIRN_DETECTION_CONTOUR_SEARCH_FIT_H
#define CAIRN_DETECTION_CONTOUR_SEARCH_FIT_H

#include "src/detection/contour_search_work.h"

/* Direction bins over half a turn, and cells along a side of the window, which is one and a half
 * object sizes. */
enum { CONTOUR_SEARCH_FIELD_BINS = 12, CONTOUR_SEARCH_FIELD_SIDE = 192 };
/* Cost of a cell without an edge in reach. */
#define CONTOUR_SEARCH_FIELD_MAX_COST CAIRN_REAL(30.0)

/* ---- Likelihoods of edges, also in the field and the score of object_detect ---- */

/* rad, standard deviation of an edge's direction; an edge contributes to directions within this many
 * of them. */
#define CONTOUR_SEARCH_ANGLE_SIGMA      CAIRN_REAL(0.35)
#define CONTOUR_SEARCH_MAX_ANGLE_SIGMAS CAIRN_REAL(2.2)
/* Lower bound of the likelihood ratio 2 s of an edge of strength rank s in [0, 1], object against
 * background. */
#define CONTOUR_SEARCH_MIN_STRENGTH_RATIO CAIRN_REAL(0.2)
/* Least background likelihood. */
#define CONTOUR_SEARCH_MIN_BACKGROUND CAIRN_REAL(0.02)
/* Probability that a piece of an outline has no edge: 1 - detection probability. */
#define CONTOUR_SEARCH_OCCLUSION_PROBABILITY CAIRN_REAL(0.25)
/* Share of the size: pieces of an outline of this length are treated as independent. */
#define CONTOUR_SEARCH_PIECE_LENGTH CAIRN_REAL(0.08)
/* Score weight of the evidence before deformation; that after deformation has weight 1. */
enum { CONTOUR_SEARCH_RIGID_EVIDENCE_WEIGHT = 2 };

/* ---- The field ---- */

/* A segment while it is rasterized. */
typedef struct contour_search_segment {
    int32_t index, steps;     /* steps: along it, two a cell */
    cairn_real angle;         /* rad, direction */
    cairn_real strength_cost; /* cost by strength rank */
} contour_search_segment;

/* Oriented distance field around an object. */
typedef struct contour_search_field {
    /* [BINS * SIDE * SIDE] edge proximity per direction, while it is computed its negative log; where
     * is_llr is set the log-likelihood ratio (nats) of an outline sample there */
    cairn_real *value;
    /* [BINS * SIDE * SIDE / 32] bits */
    uint32_t *is_llr;
    /* buffer for one direction and its border, then for kept proximities, while the field is computed */
    cairn_real *plane;
    union {
        /* mean edge proximity of each direction over the window: the background likelihood */
        cairn_real background[CONTOUR_SEARCH_FIELD_BINS];
        /* the segment that is rasterized before */
        contour_search_segment segment;
    };
    /* px, corner of the window */
    cairn_vec2 corner;
    /* px, cell size */
    cairn_real cell_size;
    const cairn_contour_search_tokens *tokens;
    int32_t resume, segment_resume, units_charged;
    /* direction; row of the window, or step along the segment; 1: the direction has an edge in the
     * window */
    int32_t bin, row, has_edge;
    /* sum of the edge proximities of the direction so far */
    cairn_real sum;
} contour_search_field;

/* Allocates the arrays of a field; field: NULL, from a counting pool. */
void cairn_contour_search_field_take(contour_search_field *field, cairn_pool *pool);
/* Starts to compute the field around a position, px, for an object of a size, px. */
void cairn_contour_search_field_begin(contour_search_field *field,
                                      const cairn_contour_search_tokens *tokens, cairn_vec2 origin,
                                      cairn_real size);
/* Resumes. 0: the budget is used up; 1: complete. Cost: about 450,000 cells, 55,000 units, and 1 unit
 * for 12 cells of every segment in the window. */
int cairn_contour_search_field_step(contour_search_field *field, cairn_budget *budget);
/* Direction bin of a vector; and the difference, rad, -pi/2 ... pi/2, of an angle in -pi ... pi from
 * the middle of a bin. */
int32_t cairn_contour_search_field_bin(cairn_vec2 direction);
cairn_real cairn_contour_search_field_deviation(cairn_real angle, int32_t bin);

/* ---- The fit ---- */

/* A deformed outline and its score, and the state of its deformation. */
typedef struct contour_search_fit {
    /* [max_outline] px, deformed samples and their directions */
    cairn_oriented_point *outline;
    /* [max_outline] log-likelihood ratio (nats) of each sample's edges, object against
     * background */
    cairn_real *llr;
    /* [max_outline] index of the closed outline of each sample */
    int32_t *outline_index;
    /* nats, total log-likelihood ratio less the deformation cost */
    cairn_real evidence;
    /* length of the outline, in object sizes */
    cairn_real length;
    /* pose of the deformed outline, after the last step */
    cairn_contour_grouping_object object;

    /* ---- Of the deformation ---- */
    contour_search_field *field;
    const cairn_shape_model *model;
    /* [max_outline] px, base positions that shifts are relative to */
    cairn_vec2 *base;
    /* [(2 * max_outline + 1) * labels] score of the best path to each label */
    cairn_real *path_value;
    /* [max_outline * labels] score of each sample at each label */
    cairn_real *sample_llr;
    /* log-likelihood ratio where no edge is in reach, per direction */
    cairn_real no_edge_llr[CONTOUR_SEARCH_FIELD_BINS];
    /* edge proximity of such a cell */
    cairn_real no_edge_proximity;
    /* size: px, of the object; spacing: of the samples, share of the size */
    cairn_real size, spacing;
    /* total cost of relative shifts, and of the affine transform's anisotropy */
    cairn_real deformation_cost, aspect_cost;
    /* grid of the current round */
    int32_t grid_radius, grid_width, label_count;
    /* px, grid step */
    cairn_real step;
    int32_t resume, outline_resume, units_charged, round;
    /* samples first ... end - 1 of the current outline; place on its path; label on the way back */
    int32_t first, end, place, label;
    /* row of the grid in which the current sample is scored */
    int32_t grid_row;
} contour_search_fit;

/* Allocates the arrays for outlines of max_outline samples; fit: NULL, from a counting pool. */
void cairn_contour_search_fit_take(contour_search_fit *fit, cairn_pool *pool, int32_t max_outline);
/* Starts to deform the outline of the model at the object's pose to the edges of the field. Field
 * and model must stay valid. */
void cairn_contour_search_fit_begin(contour_search_fit *fit, contour_search_field *field,
                                    const cairn_shape_model *model,
                                    const cairn_contour_grouping_object *object);
/* Resumes. 0: the budget is used up; 1: complete. Cost: about 500 units for each sample of the
 * outline, and 2 for each cell used. */
int cairn_contour_search_fit_step(contour_search_fit *fit, cairn_budget *budget);

/* ---- The shape quality ---- */

/* The model outline that a deformed outline is compared with. */
typedef struct contour_search_reference {
    /* [outline_count] of the model, mirrored if the object is */
    const cairn_oriented_point *outline;
    /* unit vector of the model's x axis in the image; (1, 0): the object's rotation counts as
     * deviation */
    cairn_vec2 rotation;
} contour_search_reference;

/* The shape quality of a deformed outline, independent of its surroundings, while it is computed
 * (contour_search_shape.c). */
typedef struct contour_search_measure {
    cairn_contour_search_shape shape;
    int32_t *list;         /* [max_lines] lines near the outline */
    cairn_real *proximity; /* [max_outline] edge proximity of each sample, 0 ... 1 */
    const cairn_contour_search_tokens *tokens;
    contour_search_fitted_outline fitted;
    const int32_t *outline_index;
    contour_search_reference reference;
    cairn_real sum;
    int32_t resume, cursor, count, units_charged;
} contour_search_measure;

/* Allocates the arrays; measure: NULL, from a counting pool. */
void cairn_contour_search_measure_take(contour_search_measure *measure, cairn_pool *pool,
                                       int32_t max_lines, int32_t max_outline);
/* Starts. outline_index: outline indices of the fit. All must stay valid. */
void cairn_contour_search_measure_begin(contour_search_measure *measure,
                                        const cairn_contour_search_tokens *tokens,
                                        const contour_search_fitted_outline *fitted,
                                        const int32_t *outline_index,
                                        const contour_search_reference *reference);
/* Resumes. 0: the budget is used up; 1: complete. Cost: 1 unit for 4 pairs of a sample and a segment
 * in the box of the outline. */
int cairn_contour_search_measure_step(contour_search_measure *measure, cairn_budget *budget);

#endif
