/* cairn_group: the parts of `cairn group`: the page that plays a search. */
#ifndef CAIRN_TOOLS_CAIRN_GROUP_H
#define CAIRN_TOOLS_CAIRN_GROUP_H

#include "cairn/contour_file.h"

/* What the page shows: the particles after every step. */
typedef struct group_record {
    cairn_grouping_particle *particles; /* of all steps */
    int32_t *first;                     /* [steps + 1] */
    int32_t steps, capacity, particle_capacity;
    int32_t mirrored_from; /* the first step with the mirrored model; steps: none */
    int32_t lacking;       /* 1: there was no memory */
    /* Of the mode as written: the walk of the heaviest particle after every step. */
    cairn_grouping_disc *discs; /* of all steps */
    int32_t *walk;              /* [steps + 1] */
    int32_t walks, walk_capacity, disc_capacity;
    double look_ahead; /* px */
} group_record;

/* For cairn_contour_search_params.on_step; the context is a group_record, all 0 at first. */
void group_record_step(void *context, const cairn_grouping_particle *particles, int32_t count,
                       int32_t mirrored);
/* For on_walk. */
void group_record_walk(void *context, const cairn_grouping_disc *discs, int32_t count);
void group_record_free(group_record *record);

/* Writes the page. CAIRN_IO, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status group_record_write(const group_record *record,
                                              const cairn_contour_picture *picture,
                                              const char *path, cairn_file_error *error);

#endif
