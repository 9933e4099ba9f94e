/* contour_search_object: the search object, shared by the sources of contour_search that search.
 * Private to the folder detection. */
#ifndef CAIRN_DETECTION_CONTOUR_SEARCH_OBJECT_H
#define CAIRN_DETECTION_CONTOUR_SEARCH_OBJECT_H

#include "src/detection/contour_search_fit.h"

struct cairn_contour_search {
    cairn_contour_search_params params;
    cairn_contour_grouping *grouping;
    cairn_contour_search_result result;
    int32_t is_complete;

    /* ---- Of a search ---- */
    cairn_contour_search_tokens tokens;
    const cairn_shape_model *model;
    /* mirror image of the model */
    cairn_shape_model mirrored;
    cairn_shape_model_sample *mirrored_samples; /* [max_samples] */
    cairn_oriented_point *mirrored_outline;     /* [max_outline] */
    /* below 0: the error that ends the search */
    cairn_status status;
    int32_t is_pending, resume, candidate_resume, units_charged;
    int32_t bands, band, is_mirrored;

    /* ---- Of a band: the grouping, and the observation of its filter ---- */
    cairn_contour_grouping_particle *particles; /* [particles] */
    int32_t *mode;                              /* [particles] first particle of each cluster */
    cairn_contour_grouping_disc *walk;          /* [max_steps] as written: a trajectory */
    cairn_vec2 *starts;                         /* [particles] px, as written: start points */
    int32_t last_step, units_to_callback;

    /* ---- Of a candidate: its refinement ---- */
    int32_t candidate, cursor; /* cursor: a segment, a sample or a disc of it */
    contour_search_refinement refinement;
    cairn_contour_search_object object;
    cairn_real rigid_evidence; /* nats, of the grouping */

    /* ---- Non-maximum suppression ---- */
    detection_sort sort;
    int32_t kept; /* cursor: an object */
};

/* Steps the grouping, and observes the filter every units_per_callback units and at the end, whatever
 * the budgets are (contour_search_observe.c). The observation returns its units. Sets search->status.
 * 1: complete. */
int cairn_contour_search_step_observed(cairn_contour_search *search, cairn_budget *budget,
                                       int32_t units_per_callback,
                                       int32_t (*observe_filter)(cairn_contour_search *));

/* The mode as written (contour_search_written.c). The step sets search->status. 1: complete. */
cairn_status cairn_contour_search_written_begin(cairn_contour_search *search);
int cairn_contour_search_written_step(cairn_contour_search *search, cairn_budget *budget);

/* Elements of trace and mode_counts of a result: one for each step of the grouping. */
size_t cairn_contour_search_step_capacity(const cairn_contour_search_params *params);

#endif
