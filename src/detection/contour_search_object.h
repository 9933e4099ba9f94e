/* contour_search_object: the search object, shared by the sources of contour_search that search.
 * Private to the folder detection. */
#ifndef CAIRN_DETECTION_CONTOUR_SEARCH_OBJECT_H
#define CAIRN_DETECTION_CONTOUR_SEARCH_OBJECT_H

#include "src/detection/contour_search_fit.h"

/* Observation of the filter of the grouping, while it is under way. */
typedef struct contour_search_observation {
    int32_t resume, units_charged;
    /* the next of the particles, and the clusters of those before it */
    int32_t particle, count, mode_count;
} contour_search_observation;

/* What differs between the modes of a search in the observation of their filters. */
typedef struct contour_search_observer {
    /* units of the grouping between two observations */
    int32_t units_between;
    /* 1: the particles before the first step are observed, too, where there is a callback */
    int32_t initial;
    /* Returns the cluster of a particle, one of mode_count or a new one, which it stores. */
    int32_t (*mode_of)(cairn_contour_search *search, int32_t particle, int32_t mode_count);
    /* Ends an observation; NULL: nothing to do. */
    void (*end)(cairn_contour_search *search, int32_t count);
} contour_search_observer;

struct cairn_contour_search {
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
    int32_t last_step, units_to_observation;

    /* ---- Of a candidate: its refinement ---- */
    int32_t candidate, cursor; /* cursor: a segment, a sample or a disc of it */
    contour_search_refinement refinement;
    cairn_contour_search_object object;
    cairn_real rigid_evidence; /* nats, of the grouping */

    union {
        contour_search_observation observation;
        /* ---- Non-maximum suppression ---- */
        struct {
            detection_sort sort;
            int32_t kept; /* cursor: an object */
        };
    };
    cairn_contour_search_params params;
};

/* Starts to observe the filter of a grouping that begins (contour_search_observe.c). */
void cairn_contour_search_begin_observed(cairn_contour_search *search,
                                         const contour_search_observer *observer);

/* Steps the grouping, and observes the filter each time that the grouping has used the units
 * between two observations, and at the end, whatever the budgets are. Sets search->status.
 * 1: complete.
 *
 * max_steps: of the grouping; later ones are not observed */
int cairn_contour_search_step_observed(cairn_contour_search *search, cairn_budget *budget,
                                       const contour_search_observer *observer, int32_t max_steps);

/* The mode as written (contour_search_written.c). The step sets search->status. 1: complete. */
cairn_status cairn_contour_search_written_begin(cairn_contour_search *search);
int cairn_contour_search_written_step(cairn_contour_search *search, cairn_budget *budget);

/* Elements of trace and mode_counts of a result: one for each step of the grouping. */
size_t cairn_contour_search_step_capacity(const cairn_contour_search_params *params);

#endif
