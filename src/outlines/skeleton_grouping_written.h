/* Internal structures of skeleton_grouping in CAIRN_MODE_AS_WRITTEN. */
#ifndef CAIRN_OUTLINES_SKELETON_GROUPING_WRITTEN_H
#define CAIRN_OUTLINES_SKELETON_GROUPING_WRITTEN_H

#include "src/outlines/skeleton_grouping_work.h"

/* Greatest numbers of edgels of a look-ahead circle and of followers of a particle; beyond them
 * one in N is taken, evenly. */
enum { SKELETON_GROUPING_WRITTEN_MAX_EDGELS = 48, SKELETON_GROUPING_WRITTEN_MAX_FOLLOWERS = 256 };

/* Two edgels and their centre point (fig. 3.2). */
typedef struct skeleton_grouping_written_pair {
    /* Centre point, px. */
    cairn_vec2 centre;
    /* Contact points; normals oriented towards the centre. */
    cairn_vec2 contact[2], inward[2];
    /* Delta: angle between the normal and the vector to the centre, rad. */
    cairn_real deviation[2];
    /* Radius, px. */
    cairn_real radius;
    int32_t edgel[2];
    int32_t is_crossing; /* 1: its axis or contour crosses the trajectory so far. */
} skeleton_grouping_written_pair;

/* Conditions on a pair of edgels. */
typedef struct skeleton_grouping_written_limits {
    cairn_real min_radius, max_radius; /* Range of the radius, px. */
    cairn_real max_deviation;          /* Greatest mean deviation, rad. */
    /* Cosine of 2 max_deviation, the limit of a single deviation. */
    cairn_real min_cosine;
} skeleton_grouping_written_limits;

/* One state of a trajectory, x_t: a pose of the thesis's "virtual robot". */
typedef struct skeleton_grouping_written_state {
    /* contact[0] belongs to one contour, contact[1] to the other, along the whole
     * trajectory. */
    skeleton_grouping_written_pair pair;
    /* Unit vector: direction of the sum of the four vectors between the previous and the new
     * edgels. */
    cairn_vec2 heading;
    /* Logarithm of (3.7) relative to its maximum; 0 for the first pose. */
    cairn_real log_step;
    /* Logarithm of the number of followers of the previous pose. */
    cairn_real log_followers;
} skeleton_grouping_written_state;

/* An edgel in a look-ahead circle. */
typedef struct skeleton_grouping_written_candidate {
    cairn_vec2 position;
    int32_t edgel;
    int32_t is_inside; /* 1: inside the contour so far. */
    /* 1: on the contour so far, or its connection crosses the contour. */
    int32_t is_culled;
} skeleton_grouping_written_candidate;

struct skeleton_grouping_written {
    skeleton_grouping_written_candidate candidates[2][SKELETON_GROUPING_WRITTEN_MAX_EDGELS];
    skeleton_grouping_written_pair pairs[SKELETON_GROUPING_WRITTEN_MAX_FOLLOWERS];
    /* Pairs so far; one in `stride` is kept. */
    int64_t pairs_seen, stride;
    int32_t candidate_count[2], pair_count;
};

skeleton_grouping_written_limits
cairn_skeleton_grouping_written_limits_of(const cairn_skeleton_grouping *skeleton,
                                          cairn_real margin);

/* Returns 1 if two edgels have a centre point. Cost: about two units. */
int cairn_skeleton_grouping_written_pair(const cairn_skeleton_grouping *skeleton,
                                         const skeleton_grouping_written_limits *rule,
                                         int32_t first, int32_t second,
                                         skeleton_grouping_written_pair *pair);

/* The phases that differ from the default. CPs: centres_found is the number of stored ones. */
int cairn_skeleton_grouping_written_centres(cairn_skeleton_grouping *skeleton,
                                            cairn_budget *budget);
int cairn_skeleton_grouping_written_walks(cairn_skeleton_grouping *skeleton, cairn_budget *budget);

/* Returns 1 if the CP's edgels lie on opposite sides of its line at about equal distances. */
int cairn_skeleton_grouping_is_mirrored(const cairn_skeleton_grouping *skeleton,
                                        const skeleton_grouping_centre *centre,
                                        const cairn_polyline_segment *segment);

cairn_particle_filter_model
cairn_skeleton_grouping_written_model(cairn_skeleton_grouping *skeleton);

#endif
