/* What the parts of filter_mapper share: filter_mapper.c (params, memory, scan by scan) and
 * filter_mapper_propose.c (what a particle makes of a key scan). */
#ifndef CAIRN_MAPPING_FILTER_MAPPER_WORK_H
#define CAIRN_MAPPING_FILTER_MAPPER_WORK_H

#include "cairn/filter_mapper.h"
#include "cairn/neighbours.h"

/* One key scan of a path; the states before it in the tree are the key scans before. */
typedef struct path_state {
    cairn_pose map_key;
    cairn_real log_weight; /* of the candidate that it was: log p(z | maps, x) p(x | motion) */
    int32_t key;
} path_state;

/* A key scan of a local map. */
typedef struct local_key {
    cairn_pose map_key;
    cairn_real distance; /* squared, from where the particle is expected */
    int32_t key;
} local_key;

enum { RECENT = 0, OLD = 1, LOCAL_MAPS = 2 };

/* A part of a particle's map around the key scan at hand. */
typedef struct local_map {
    local_key list[CAIRN_FILTER_MAPPER_LOCAL_MOST]; /* the nearest ones, by distance */
    int32_t count;
    cairn_point_grid *points;
    cairn_vec2 *direction; /* [max_local_points] of the points */
} local_map;

/* Where candidates are drawn: a normal distribution by the axes of its ellipsoid. */
typedef struct place {
    cairn_pose mean;
    cairn_real axis[3][3], sigma[3];
} place;

typedef int32_t propose_stage;
enum {
    PROPOSE_IDLE = 0,
    PROPOSE_BEGIN,
    PROPOSE_EMPTY, /* what the local maps hold of the particle before */
    PROPOSE_WALK,  /* along the path, which key scans are near */
    PROPOSE_CLEAR, /* the target of the match */
    PROPOSE_FILL,  /* the local map at hand into the match and its grid */
    PROPOSE_MATCH,
    PROPOSE_DRAW,
    PROPOSE_WEIGH,
    PROPOSE_OFFER
};

/* A particle's work on the key scan at hand. */
typedef struct proposing {
    propose_stage stage;
    int32_t cursor, candidate;
    int32_t paid;
    int32_t which; /* local map at hand */
    const path_state *ancestor;
    cairn_pose expected;
    local_map map[LOCAL_MAPS];
    place place[LOCAL_MAPS];
    int32_t place_count;
    path_state candidates[CAIRN_FILTER_MAPPER_CANDIDATES_MOST];
    cairn_real cost; /* of the candidate at hand */
} proposing;

struct cairn_filter_mapper {
    cairn_filter_mapper_params params;
    cairn_mapper *front;
    cairn_particle_filter *filter;
    cairn_icp *icp;
    cairn_oriented_point *oriented; /* [scan.max_points] a key scan on its way into a local map */
    cairn_random random;
    proposing at;

    int32_t in_front;          /* 1: the mapper that goes ahead is at the scan */
    int32_t keys;              /* in the filter */
    cairn_pose motion;         /* to the key scan at hand, from the one before */
    cairn_real sigma_distance; /* of that motion, m ... */
    cairn_real sigma_turn;     /* ... and rad */
    int64_t returns, units;
};

/* The model of the filter. */
cairn_particle_model cairn_filter_mapper_model(cairn_filter_mapper *mapper);

#endif
