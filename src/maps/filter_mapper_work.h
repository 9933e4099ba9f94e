/* Internal state shared by filter_mapper.c (params, memory, scan by scan), filter_mapper_propose.c
 * (proposal and weight of a particle), filter_mapper_correct.c (drift and correction of paths). */
#ifndef CAIRN_MAPS_FILTER_MAPPER_WORK_H
#define CAIRN_MAPS_FILTER_MAPPER_WORK_H

#include "cairn/filter_mapper.h"
#include "cairn/neighbours.h"
#include "cairn/scan_match.h"
#include "src/base/object.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_filter_mapper_parameters;

/* Keyframes of a path that are visited for one unit. */
enum { FILTER_MAPPER_WALKED_PER_UNIT = 8 };

/* A node of the tree of paths: one keyframe of a path; its ancestors are the keyframes before. */
typedef struct filter_mapper_path_state {
    cairn_pose map_keyframe;
    /* Covariance relative to the first keyframe, along the axes of the map, m and rad. */
    cairn_sym3 drift;
    cairn_real log_weight; /* nats: logarithm of the weight of the drawn candidate */
    int32_t keyframe;
    int32_t revisited; /* keyframe of the old map to which a match ties this one; -1: none */
} filter_mapper_path_state;

/* A keyframe of the old map. */
typedef struct filter_mapper_local_keyframe {
    const filter_mapper_path_state *state;
    cairn_real distance; /* m^2, squared distance from the expected pose */
} filter_mapper_local_keyframe;

/* The old part of a particle's map near the current keyframe. */
typedef struct filter_mapper_old_map {
    /* nearest keyframes, sorted by distance */
    filter_mapper_local_keyframe nearest[CAIRN_FILTER_MAPPER_MAX_LOCAL_KEYFRAMES];
    int32_t count;
    cairn_point_grid *points;
    cairn_vec2 *direction; /* [max_local_points] tangent directions of the points */
} filter_mapper_old_map;

/* Starts of the match against the old map. Modes of a proposal: the matches with the largest
 * overlap, and the motion. */
enum {
    FILTER_MAPPER_LINE_STARTS = 15,                           /* along an axis of the drift */
    FILTER_MAPPER_MAX_STARTS = FILTER_MAPPER_LINE_STARTS + 1, /* and by shape */
    FILTER_MAPPER_MAX_MATCHES = 3,
    FILTER_MAPPER_MAX_MODES = FILTER_MAPPER_MAX_MATCHES + 1
};

/* A mode of the proposal distribution: a Gaussian by the principal axes of its covariance; sigma in
 * m and rad, mixed along an axis. */
typedef struct filter_mapper_proposal_mode {
    cairn_pose mean;
    cairn_real axis[3][3], sigma[3];
    cairn_real overlap; /* of the match; 0 of the motion */
} filter_mapper_proposal_mode;

/* The pose of the current keyframe relative to an old one, by their shapes. */
typedef struct filter_mapper_shape {
    int32_t keyframe; /* the old one */
    int32_t is_found;
    cairn_pose keyframe_scan;
} filter_mapper_shape;

/* Most particles have the same nearest old keyframe: a pair is matched once. */
enum { FILTER_MAPPER_KNOWN_SHAPES = 8 };

/* A particle's proposal for the current keyframe, in progress. */
typedef struct filter_mapper_proposal {
    /* Resume points: of the whole, of its current phase, of the start by shape. */
    int32_t resume, phase_resume, shape_resume;
    int32_t units_charged;
    /* Keyframe of the map or point of the scan; start; candidate. */
    int32_t cursor, start, candidate;
    const filter_mapper_path_state *ancestor;
    filter_mapper_path_state expected; /* the keyframe by the motion alone */
    filter_mapper_old_map map;
    /* Covariance of the expected pose relative to the map, its inverse, and half the logarithm of
     * its determinant. */
    cairn_sym3 relative, information;
    cairn_real log_spread;
    cairn_pose starts[FILTER_MAPPER_MAX_STARTS];
    int32_t start_count;
    filter_mapper_proposal_mode modes[FILTER_MAPPER_MAX_MODES];
    int32_t mode_count;
    filter_mapper_path_state candidates[CAIRN_FILTER_MAPPER_MAX_CANDIDATES];
    cairn_real gain; /* nats: gain of the current candidate */
} filter_mapper_proposal;

/* The correction of the paths that have closed a loop, in progress. */
typedef struct filter_mapper_correction {
    int32_t resume, units_charged;
    int32_t particle;
    int32_t keyframe;                          /* keyframe that is revisited */
    const filter_mapper_path_state *revisited; /* its state, or a later one while it is sought */
    filter_mapper_path_state *state;           /* state that was corrected last */
    cairn_pose expected;                       /* pose of the last keyframe before the correction */
    cairn_real force[3];                       /* S^-1 e, see filter_mapper_correct.c */
} filter_mapper_correction;

struct cairn_filter_mapper {
    cairn_mapper *front;
    cairn_particle_filter *filter;
    cairn_icp *icp;
    cairn_scan_match *shape; /* NULL: without shape prior */
    /* [min(shape_count, FILTER_MAPPER_KNOWN_SHAPES)] matches of the current keyframe by shape; of
     * more the last ones */
    filter_mapper_shape shapes[FILTER_MAPPER_KNOWN_SHAPES];
    int32_t shape_count;
    cairn_oriented_point *points; /* [scan.max_points] buffer of one keyframe */
    cairn_random random;
    filter_mapper_proposal proposal;
    filter_mapper_correction correction;

    int32_t is_pending;           /* 1: a scan is to be processed */
    int32_t resume;               /* resume point of its processing */
    cairn_status status;          /* of the module that processes it */
    int32_t keyframe_count;       /* in the filter */
    cairn_pose motion;            /* from the previous keyframe to the current one */
    cairn_sym3 motion_covariance; /* of that motion, along the axes of the current keyframe */
    int64_t revisit_matches, shape_matches, shape_starts, units;
    cairn_filter_mapper_params params;
};

/* Returns the callbacks of the particle filter. */
cairn_particle_filter_model cairn_filter_mapper_model(cairn_filter_mapper *mapper);

/* Returns the drift of a state after a rigid motion of its body to another pose, along the axes of
 * the map. */
cairn_sym3 cairn_filter_mapper_carry(const filter_mapper_path_state *state, cairn_pose to);

/* Returns the covariance of the motion to the current keyframe, along the axes of the map.
 *
 * theta: heading of the keyframe in the map, rad */
cairn_sym3 cairn_filter_mapper_motion_covariance(const cairn_filter_mapper *mapper,
                                                 cairn_real theta);

/* Returns the current keyframe by the motion alone, after the last one of a path. */
filter_mapper_path_state cairn_filter_mapper_predict(const cairn_filter_mapper *mapper,
                                                     const filter_mapper_path_state *last);

/* Returns the covariance of a keyframe relative to an earlier one, along the axes of the map. */
cairn_sym3 cairn_filter_mapper_relative_drift(const filter_mapper_path_state *earlier,
                                              const filter_mapper_path_state *later);

/* Sets e to the small motion from one pose to another, along the axes of the map, m and rad. */
void cairn_filter_mapper_displacement(cairn_pose from, cairn_pose to, cairn_real e[3]);

/* Corrects the paths of all particles that have closed a loop at the current keyframe. Returns 1
 * when done. */
int cairn_filter_mapper_correct(cairn_filter_mapper *mapper, cairn_budget *budget);

#endif
