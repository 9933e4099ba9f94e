/* contour_search_object: the search object, shared by contour_search.c and contour_search_written.c.
 * Private to the folder detection. */
#ifndef CAIRN_DETECTION_CONTOUR_SEARCH_OBJECT_H
#define CAIRN_DETECTION_CONTOUR_SEARCH_OBJECT_H

#include "src/detection/contour_search_fit.h"

/* Phases: GROUP for each band of sizes, those from FIELD to SCORE for each of its objects, SORT and
 * SUPPRESS at the end; as written WRITTEN alone. */
enum {
    CONTOUR_SEARCH_IDLE,
    CONTOUR_SEARCH_GROUP,
    CONTOUR_SEARCH_FIELD,
    CONTOUR_SEARCH_FIT,
    CONTOUR_SEARCH_COLLECT,
    CONTOUR_SEARCH_MEASURE,
    CONTOUR_SEARCH_COPY,
    CONTOUR_SEARCH_OUTLINE,
    CONTOUR_SEARCH_DISCS,
    CONTOUR_SEARCH_SCORE,
    CONTOUR_SEARCH_SORT,
    CONTOUR_SEARCH_SUPPRESS,
    CONTOUR_SEARCH_DONE,
    CONTOUR_SEARCH_WRITTEN
};

struct cairn_contour_search {
    cairn_contour_search_params params;
    cairn_contour_grouping *grouping;
    cairn_contour_search_result result;
    cairn_contour_search_tokens tokens;
    const cairn_shape_model *model;
    /* mirror image of the model */
    cairn_shape_model mirrored;
    cairn_shape_model_sample *mirrored_samples; /* [max_samples] */
    cairn_oriented_point *mirrored_outline;     /* [max_outline] */

    /* observation of the filter */
    cairn_contour_grouping_particle *particles; /* [particles] */
    int32_t *mode;                              /* [particles] first particle of each cluster */
    cairn_contour_grouping_disc *walk;          /* [max_steps] as written: a trajectory */
    cairn_vec2 *starts;                         /* [particles] px, as written: start points */
    int32_t last_step, units_to_callback;

    /* refinement of a candidate */
    contour_search_field field;
    contour_search_fit fit;
    contour_search_collector collector;
    contour_search_measure measure;
    cairn_contour_search_object object;
    cairn_real rigid_evidence; /* nats, of the grouping */

    int32_t phase, cursor, units_charged;
    /* of the band and of the candidate */
    int32_t bands, band, is_mirrored, candidate;
    /* non-maximum suppression */
    detection_sort sort;
    int32_t kept;
};

/* Steps the grouping, and observes the filter every units_per_callback units and at the end, whatever
 * the budgets are. The observation returns its units. */
cairn_status cairn_contour_search_step_observed(cairn_contour_search *search, cairn_budget *budget,
                                                int32_t units_per_callback,
                                                int32_t (*observe_filter)(cairn_contour_search *));

/* The mode as written (contour_search_written.c). */
cairn_status cairn_contour_search_written_begin(cairn_contour_search *search);
cairn_status cairn_contour_search_written_step(cairn_contour_search *search, cairn_budget *budget);

/* Elements of trace and mode_counts of a result: one for each step of the grouping. */
size_t cairn_contour_search_step_capacity(const cairn_contour_search_params *params);

#endif
