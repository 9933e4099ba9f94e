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

typedef int32_t filter_mapper_propose_stage;
enum {
    FILTER_MAPPER_PROPOSE_IDLE = 0,
    FILTER_MAPPER_PROPOSE_BEGIN,
    FILTER_MAPPER_PROPOSE_EMPTY, /* remove the previous particle's points */
    FILTER_MAPPER_PROPOSE_WALK,  /* select nearby keyframes along the path */
    FILTER_MAPPER_PROPOSE_CLEAR, /* clear the target of the match */
    FILTER_MAPPER_PROPOSE_FILL,  /* add the current local map to the match and its grid */
    FILTER_MAPPER_PROPOSE_MATCH,
    FILTER_MAPPER_PROPOSE_DRAW,
    FILTER_MAPPER_PROPOSE_WEIGH,
    FILTER_MAPPER_PROPOSE_OFFER
};

/* A particle's proposal for the current keyframe, in progress. */
typedef struct filter_mapper_proposal {
    filter_mapper_propose_stage stage;
    int32_t cursor, candidate;
    int32_t units_charged;
    int32_t map_index; /* current local map */
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

    int32_t front_is_active;   /* 1: the front-end mapper processes the scan */
    int32_t keyframe_count;    /* in the filter */
    cairn_pose motion;         /* from the previous keyframe to the current one */
    cairn_real sigma_distance; /* m: standard deviation of that motion */
    cairn_real sigma_theta;    /* rad: likewise */
    int64_t revisit_matches, units;
};

/* Returns the callbacks of the particle filter. */
cairn_particle_filter_model cairn_filter_mapper_model(cairn_filter_mapper *mapper);

#endif
