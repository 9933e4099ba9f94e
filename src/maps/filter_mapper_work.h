/* Internal state shared by filter_mapper.c (params, memory, scan by scan) and
 * filter_mapper_propose.c (proposal and weight of a particle). */
#ifndef CAIRN_MAPS_FILTER_MAPPER_WORK_H
#define CAIRN_MAPS_FILTER_MAPPER_WORK_H

#include "cairn/filter_mapper.h"
#include "cairn/neighbours.h"
#include "src/base/object.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_filter_mapper_parameters;

/* A node of the tree of paths: one keyframe of a path; its ancestors are the keyframes before. */
typedef struct filter_mapper_path_state {
    cairn_pose map_keyframe;
    cairn_real log_weight; /* nats: log p(z | maps, x) p(x | motion) of the drawn candidate */
    int32_t keyframe;
} filter_mapper_path_state;

/* A keyframe of a local map. */
typedef struct filter_mapper_local_keyframe {
    cairn_pose map_keyframe;
    cairn_real distance; /* m^2, squared distance from the expected pose */
    int32_t keyframe;
} filter_mapper_local_keyframe;

enum { FILTER_MAPPER_RECENT_MAP = 0, FILTER_MAPPER_OLD_MAP = 1, FILTER_MAPPER_LOCAL_MAPS = 2 };

/* The recent or the old part of a particle's map near the current keyframe. */
typedef struct filter_mapper_local_map {
    /* nearest keyframes, sorted by distance */
    filter_mapper_local_keyframe nearest[CAIRN_FILTER_MAPPER_MAX_LOCAL_KEYFRAMES];
    int32_t count;
    cairn_point_grid *points;
    cairn_vec2 *direction; /* [max_local_points] tangent directions of the points */
} filter_mapper_local_map;

/* A mode of the proposal distribution: a Gaussian by the principal axes of its covariance; sigma in
 * m and rad, mixed along an axis. */
typedef struct filter_mapper_proposal_mode {
    cairn_pose mean;
    cairn_real axis[3][3], sigma[3];
} filter_mapper_proposal_mode;

/* A particle's proposal for the current keyframe, in progress. */
typedef struct filter_mapper_proposal {
    /* Resume points: of the whole, of its current phase. */
    int32_t resume, phase_resume;
    int32_t units_charged;
    /* Current local map; keyframe of it or point of the scan; candidate. */
    int32_t map_index, cursor, candidate;
    const filter_mapper_path_state *ancestor;
    cairn_pose expected;
    filter_mapper_local_map maps[FILTER_MAPPER_LOCAL_MAPS];
    filter_mapper_proposal_mode modes[FILTER_MAPPER_LOCAL_MAPS];
    int32_t mode_count;
    filter_mapper_path_state candidates[CAIRN_FILTER_MAPPER_MAX_CANDIDATES];
    cairn_real cost; /* nats: cost of the current candidate */
} filter_mapper_proposal;

struct cairn_filter_mapper {
    cairn_filter_mapper_params params;
    cairn_mapper *front;
    cairn_particle_filter *filter;
    cairn_icp *icp;
    cairn_oriented_point *points; /* [scan.max_points] buffer of one keyframe */
    cairn_random random;
    filter_mapper_proposal proposal;

    int32_t is_pending;        /* 1: a scan is to be processed */
    int32_t resume;            /* resume point of its processing */
    cairn_status status;       /* of the module that processes it */
    int32_t keyframe_count;    /* in the filter */
    cairn_pose motion;         /* from the previous keyframe to the current one */
    cairn_real sigma_distance; /* m: standard deviation of that motion */
    cairn_real sigma_theta;    /* rad: likewise */
    int64_t revisit_matches, units;
};

/* Returns the callbacks of the particle filter. */
cairn_particle_filter_model cairn_filter_mapper_model(cairn_filter_mapper *mapper);

#endif
