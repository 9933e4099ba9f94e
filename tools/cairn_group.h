/* Recording of a search of `cairn group` for the page of --report. */
#ifndef CAIRN_TOOLS_CAIRN_GROUP_H
#define CAIRN_TOOLS_CAIRN_GROUP_H

#include "cairn/contour_file.h"

/* The particles after every step of the particle filter. */
typedef struct group_record {
    cairn_contour_grouping_particle *particles; /* [first[steps]] of all steps, in order */
    int32_t *first;                             /* [steps + 1] */
    int32_t steps, capacity, particle_capacity;
    int32_t mirrored_from; /* the first step with the mirrored model; steps: none */
    int32_t out_of_memory; /* 1: an allocation failed */
    /* Mode as written: the sequence of symmetric points (discs) of the particle of largest weight
     * after every step. */
    cairn_contour_grouping_disc *discs; /* of all steps */
    int32_t *walk;                      /* [steps + 1] */
    int32_t walks, walk_capacity, disc_capacity;
    /* Steps of the skeletons of other particles after every step; skeleton: [walks + 1] */
    cairn_segment *skeletons;
    int32_t *skeleton;
    int32_t skeleton_capacity, step_capacity;
    double look_ahead; /* px */
} group_record;

/* For cairn_contour_search_params.on_step; the context is a group_record, all 0 at first. */
void group_record_step(void *context, const cairn_contour_grouping_particle *particles,
                       int32_t count, int32_t mirrored);
/* For on_walk. */
void group_record_walk(void *context, const cairn_contour_grouping_disc *discs, int32_t count,
                       int32_t rank);
void group_record_free(group_record *record);

/* Writes the page. CAIRN_IO, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status group_record_write(const group_record *record,
                                              const cairn_contour_file_picture *picture,
                                              const char *path, cairn_file_error *error);

#endif
