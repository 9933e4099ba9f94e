/* Internal state and functions shared by the source files of module mapper:
 *
 * - mapper.c: what happens to a scan, from its prediction to the work in the background
 * - mapper_create.c: params, validation, memory
 * - mapper_front.c: front end: motion prediction, odometry health
 * - mapper_match.c: the match of a scan
 * - mapper_odometry.c: noise of the odometry, learnt; matches that contradict it
 * - mapper_search.c: relocalization search for a match of low confidence
 * - mapper_keyframes.c: keyframe storage, local map, visibility profiles
 * - mapper_ranges.c: translation along a weakly observable direction, from the ranges
 * - mapper_share.c: the units that the work in the background takes of a scan
 * - mapper_window.c: sliding-window refinement by the force field
 * - mapper_loop.c: loop-closure detection and verification
 * - mapper_constraint.c: covariances of sequential constraints, reference keyframes
 * - mapper_graph.c: pose graph and its optimization
 * - mapper_uncertainty.c: uncertainty of keyframes in the map
 * - mapper_redundancy.c: redundancy scores of keyframes
 * - mapper_capacity.c: capacity for keyframes: whether one must or may be culled
 * - mapper_culling.c: keyframe culling */
#ifndef CAIRN_MAPS_MAPPER_WORK_H
#define CAIRN_MAPS_MAPPER_WORK_H

#include "cairn/mapper.h"
#include "cairn/pose_graph.h"
#include "cairn/scan_match.h"
#include "src/base/object.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_mapper_parameters;

enum {
    /* loop-closure candidates per keyframe */
    MAPPER_MAX_CANDIDATES = 3,
    /* constraints of a keyframe to earlier submaps, besides the one to its predecessor */
    MAPPER_MAX_ANCHORS = 2,
    /* closures that wait for consistent ones (ring buffer) */
    MAPPER_MAX_PENDING = 32,
    /* loop events that can be read (ring buffer) */
    MAPPER_LOOP_EVENTS = 64,
    /* culling events that can be read (ring buffer) */
    MAPPER_CULLING_EVENTS = 64,
    /* nearest earlier keyframes that may observe the same samples */
    MAPPER_REDUNDANCY_NEIGHBOURS = 8,
    /* samples of a keyframe's visibility profile, half free space and half surface */
    MAPPER_SAMPLES = 128,
    /* keyframes of the local map in the target of a relocalization search */
    MAPPER_SEARCH_KEYFRAMES = 5,
    /* hypotheses that a relocalization search refines */
    MAPPER_SEARCH_CANDIDATES = 32,
    /* translations along a weakly observable direction */
    MAPPER_MAX_TRIALS = 240
};

/* Standard deviations added to a match of low confidence, m and rad. */
static const cairn_real MAPPER_LOW_CONFIDENCE_M = CAIRN_REAL(0.3),
                        MAPPER_LOW_CONFIDENCE_RAD = CAIRN_REAL(0.15);
/* A direction with a smaller ratio of smallest to largest information is weakly observable. */
static const cairn_real MAPPER_MIN_INFORMATION_RATIO = CAIRN_REAL(0.05);
/* shortest horizontal part of a weak direction that is a translation; it may be a turn */
static const cairn_real MAPPER_MIN_TRANSLATION = CAIRN_REAL(0.7);
/* m: standard deviation between odometry and matches after a stretch, before any is learnt. */
static const cairn_real MAPPER_INITIAL_ODOMETRY_M = CAIRN_REAL(0.1);
/* m: half side of the wide relocalization search window, plus the motion of the scan. */
static const cairn_real MAPPER_WIDE_SEARCH_M = 1;
/* m and rad: standard deviation of the motion of a scan without a match, added to that of the
 * odometry: a person may stand before the robot and push it. */
static const cairn_real MAPPER_UNMATCHED_M = CAIRN_REAL(0.3),
                        MAPPER_UNMATCHED_RAD = CAIRN_REAL(0.5);

/* m and rad: two motion hypotheses that differ by more are both tried. */
static const cairn_real MAPPER_DISTINCT_M = CAIRN_REAL(0.05);
static const cairn_real MAPPER_DISTINCT_RAD = CAIRN_REAL(0.02);
/* m and rad: unit of a pose's deviation from the predicted motion in match scores. */
static const cairn_real MAPPER_PRIOR_SCALE = CAIRN_REAL(0.1);

/* A link of the pose graph as loop-closure detection uses it: an adjacency list with variances. It
 * has the index of the graph's link. Variances in m^2 and rad^2. */
typedef struct mapper_link {
    int32_t first, second;
    int32_t next[2]; /* next link of first and of second; -1: none */
    cairn_real variance, heading_variance;
    cairn_vec2 anisotropy;        /* m^2, in the frame of second; see mapper_loop.c */
    cairn_real error_probability; /* of a loop closure */
    int32_t is_loop, dropped;
} mapper_link;

/* A loop-closure candidate: an older keyframe that may show the same place as the query. */
typedef struct mapper_candidate {
    int32_t keyframe;
    cairn_real cost; /* m: distance of the scan centroids, plus penalties */
} mapper_candidate;

/* A closure that waits for consistent closures. */
typedef struct mapper_pending {
    cairn_mapper_loop event;
    int32_t accepted;
    cairn_sym3 covariance; /* in the frame of second */
} mapper_pending;

/* What the heading of a keyframe rests on, the most certain first: odometry that agrees with the
 * matches, the match alone, or nothing certain, as scans without a match lie before it. */
enum { MAPPER_HEADING_BY_ODOMETRY, MAPPER_HEADING_BY_MATCH, MAPPER_HEADING_UNKNOWN };

/* Sequential constraints of a keyframe: the covariance relative to its predecessor, and to other
 * submaps that constrain it better. Covariances are in the keyframe's own frame, m and rad. See
 * mapper_constraint.c. */
typedef struct mapper_constraint {
    cairn_sym3 covariance; /* relative to the predecessor */
    int32_t anchors[MAPPER_MAX_ANCHORS];
    cairn_sym3 anchor_covariance[MAPPER_MAX_ANCHORS];
    int32_t anchor_count;
    int32_t low_confidence;
    int32_t heading;           /* MAPPER_HEADING_...: what its heading rests on */
    int32_t submap;            /* submap of mutually rigid keyframes: index of its first one */
    cairn_real position_sigma; /* m, standard deviation of its position by all constraints */
} mapper_constraint;

/* A keyframe, and the distance by which it is sorted. */
typedef struct mapper_neighbour {
    cairn_real distance;
    int32_t keyframe;
} mapper_neighbour;

/* Redundancy of keyframes, and the computation in progress. See mapper_redundancy.c. */
typedef struct mapper_redundancy {
    /* [max_keyframes] redundancy score: coverage that culling would lose, in samples; small is
     * redundant; -1: unknown */
    cairn_real *score;
    /* [max_keyframes] m^2, squared distance to the farthest neighbour considered */
    cairn_real *neighbour_radius2;
    /* Resume point, and units charged for the operation that waits. */
    uint16_t resume;
    int32_t units_charged;
    int32_t keyframe; /* the one whose score is computed */
    /* nearest keyframes before it, sorted by squared distance, m^2 */
    mapper_neighbour neighbours[MAPPER_REDUNDANCY_NEIGHBOURS];
    int32_t neighbour_count, neighbour;
    int32_t most_redundant; /* keyframe that is culled next */
    /* number of neighbours that observe each sample */
    uint8_t observer_counts[MAPPER_SAMPLES];
} mapper_redundancy;

/* The match of a query with one candidate, in progress. */
typedef struct mapper_candidate_match {
    uint16_t resume;
    int32_t keyframe, end; /* of the target map: the next one to add, and one past the last */
} mapper_candidate_match;

/* The search for returns of one keyframe to places before it, in progress. See mapper_loop.c. */
typedef struct mapper_return_search {
    uint16_t resume;
    int32_t query;                      /* keyframe that a return is searched for */
    cairn_oriented_point *query_points; /* [scan.max_points] */
    cairn_scan_match_part query_part;
    /* [max_keyframes] m^2, accumulated along the path in the graph to the query */
    cairn_real *variance;
    /* [max_keyframes] m^2, likewise, along the axes of the map */
    cairn_vec2 *anisotropy;
    /* [max_keyframes] rad^2, likewise */
    cairn_real *heading_variance;
    /* [max_keyframes] binary min-heap of keyframes by variance */
    int32_t *heap;
    /* [max_keyframes] position in the heap; -1: not in it, -2: taken out, the variance is final */
    int32_t *heap_position;
    int32_t heap_count; /* keyframes in the heap */
    int32_t keyframe;   /* whose links are relaxed; that is tested as a candidate */
    int32_t link;       /* of that keyframe, the next one to relax */
    mapper_candidate candidates[MAPPER_MAX_CANDIDATES];
    int32_t candidate_count, candidate;
    mapper_candidate
        best_of_group; /* best candidate of the current group of successive keyframes */
    int32_t in_group;  /* 1: a group of candidates is open */
    mapper_candidate_match match;
} mapper_return_search;

typedef struct mapper_loop {
    cairn_pose_graph *graph;
    mapper_link *links; /* [max_keyframes + max_loops] */
    /* [max_keyframes] head of the adjacency list of a keyframe; -1: none */
    int32_t *first_link;
    /* [max_keyframes] of the match that stored the keyframe */
    mapper_constraint *constraints;
    int32_t link_count;
    int32_t graph_keyframes; /* keyframes in the pose graph */

    /* Resume points: of the whole, of an optimization, of a culling; units charged for the operation
     * that waits. */
    uint16_t resume, optimize_resume, cull_resume;
    int32_t units_charged;
    cairn_status graph_status; /* of the optimization */
    int32_t may_cull;          /* 1: a keyframe may be culled now */
    mapper_return_search returns;

    mapper_pending pending[MAPPER_MAX_PENDING];
    int32_t pending_count;         /* total over the mapper's life */
    int32_t unsolved_closures;     /* closures since the last optimization */
    int32_t keyframes_since_solve; /* keyframes added since the last optimization */
    cairn_real largest_chi2;       /* largest chi-squared of the unsolved closures */
    int32_t settling;              /* 1: settle() is running, all pending work is finished */
    int32_t factor_full;           /* 1: the factor of the graph has no capacity: no optimization */
    int32_t culling;               /* 1: keyframes are culled until there is some capacity again */
    mapper_redundancy redundancy;
    cairn_mapper_loop events[MAPPER_LOOP_EVENTS];
} mapper_loop;

/* Odometry against matches and, since the anchor, the last pose where both agreed, against the poses
 * of the map. See mapper_odometry.c. */
typedef struct mapper_odometry {
    /* smoothed share of scans that agree with odometry, 0 ... 1 */
    cairn_real health;
    /* factor of the noise after a disagreement, >= 1 */
    cairn_real noise_scale;
    /* m: added to the predicted motion after a disagreement */
    cairn_vec2 bias;
    cairn_pose by_odometry, by_poses; /* motions since the anchor */
    cairn_real distance;              /* m, by odometry since the anchor */
    int32_t is_uncertain;             /* 1: not all matches since were well observed */
    int32_t samples;                  /* stretches learnt from */
    cairn_real sigma;     /* m: standard deviation of the deviation after a stretch, learnt */
    cairn_real deviation; /* m, of the last contradiction */
    /* medians: m, of the residuals' standard deviation; m and rad, of what a match deviates from the
     * odometry */
    cairn_real residual, scatter_m, scatter_rad;
    cairn_real variance_m, variance_rad; /* m^2, rad^2: of the pose, where matches scatter */
    /* contradictions in a row by matches that may be those of returns that travel, and the last
     * ones of them that move as the odometry does */
    int32_t contradictions, confirmations;
} mapper_odometry;

/* The relocalization search of a scan, in progress. See mapper_search.c. */
typedef struct mapper_relocalization {
    uint16_t resume;
    int32_t units_charged;
    int32_t is_wide;     /* 1: in the wide window */
    int32_t is_complete; /* 1: the window was searched to its end */
    /* 1: its best hypothesis is the current match; another one is accepted, which has this pose */
    int32_t is_confirmed, is_found;
    cairn_pose pose;
} mapper_relocalization;

/* The scan that is being placed: prediction and match. */
typedef struct mapper_current {
    uint16_t resume; /* of the match */
    /* 1: its odometry is usable; the motion since the previous scan by it */
    int32_t has_odometry;
    cairn_pose by_odometry;
    /* predicted motion since the previous scan, and a second hypothesis */
    cairn_pose motion, alternative_motion;
    /* predicted pose in the map */
    cairn_pose predicted;
    /* 1: odometry is healthy and predicts the motion */
    int32_t uses_odometry;
    /* 1: `match` is valid */
    int32_t has_match;
    /* best match so far, and the contribution of each keyframe of the local map to it */
    cairn_icp_result match;
    cairn_icp_parts parts;
    /* 1: the match is constrained by the odometry prior in weakly observable directions */
    int32_t is_constrained;
    /* 1: the pose of the match is its average with the odometry */
    int32_t is_averaged;
    /* 1: the match has low confidence even after a search */
    int32_t low_confidence;
    /* m: standard deviation along a weakly observable direction; MAPPER_LOW_CONFIDENCE_M where the
     * ranges do not observe it, either */
    cairn_real weak_sigma;
    /* inflation of the match covariance in the map, 3 x 3 row-major, m and rad */
    cairn_real extra_covariance[9];
    mapper_relocalization relocalization;
    /* work units used by the search and by ICP */
    int32_t search_units_used, match_units_used;
} mapper_current;

/* The scan before: what predicts the next motion. */
typedef struct mapper_previous {
    cairn_pose pose; /* in the map, m and rad */
    /* 1: it had odometry */
    int32_t has_odometry;
    cairn_pose odometry;
    /* motion by the match, and exponentially smoothed */
    cairn_pose motion, smoothed_motion;
    /* m per scan in the scan's frame: smoothed velocity estimate */
    cairn_vec2 velocity;
    /* smoothed quality of matches; 0: none yet */
    cairn_real quality;
    /* ns: stamp, and interval to the scan before it */
    int64_t stamp, span;
    int32_t usual_span; /* 2^16 ns: smoothed interval; 0: none yet */
    int32_t intervals;  /* usual ones in the last interval, 1 ... 4 */
} mapper_previous;

/* The translation along a weakly observable direction, from the ranges of the scan and of the one
 * before. See mapper_ranges.c. Translations are in m along that direction. */
typedef struct mapper_ranges {
    uint16_t resume;
    int32_t units_charged;
    /* of the previous scan: [scan.max_beams] ends of its beams as seen from its sensor, in its frame;
     * (0, 0): without a hit */
    cairn_vec2 *ends;
    int32_t count;
    cairn_real sense; /* 1: their bearing increases, -1: decreases */
    cairn_vec2 sensor;
    cairn_vec2 along; /* weakly observable direction in the map, unit length */
    /* shift from the match, m: of the prediction and its standard deviation, of trial 0 */
    cairn_real predicted, change_sigma, first;
    int32_t trial, trials, best;
    cairn_real cost[MAPPER_MAX_TRIALS]; /* nats */
    int32_t neighbour;                  /* the earlier beam of the two about a point */
    int32_t compared, best_compared;    /* beams of the current trial, of the best one */
} mapper_ranges;

/* The last finished scan, for the pose of the odometry frame in the map. */
typedef struct mapper_finished {
    int32_t has_odometry; /* 1: the last finished scan had odometry */
    cairn_pose odometry;  /* of the last finished scan */
    cairn_pose map_odom;  /* of the last scan with odometry, at that time */
} mapper_finished;

/* The local map: keyframes that scans are matched to. */
typedef struct mapper_target {
    /* the most recent ones first, then by distance, m */
    mapper_neighbour keyframes[CAIRN_MAPPER_MAX_LOCAL_KEYFRAMES];
    int32_t count;
    /* 1: keyframes were added or moved since it was built */
    int32_t is_stale;
    /* predicted pose for which it was built */
    cairn_pose pose;
    /* its keyframes in the search target; 0: other content */
    int32_t search_count;
    /* Selection of its keyframes, in progress. */
    uint16_t resume;
    int32_t units_charged;
    int32_t keyframe; /* that is looked at */
    int32_t entry;    /* of `keyframes`, that is added */
} mapper_target;

/* Pending relocalization hypothesis: the pose of the last search's scan, rejected for its distance
 * from odometry. */
typedef struct mapper_hypothesis {
    cairn_pose pose;     /* m and rad */
    cairn_real log_odds; /* nats */
    int64_t scan;        /* number of that scan, from 1; 0: none */
} mapper_hypothesis;

/* The force field over the most recent keyframes. */
typedef struct mapper_window {
    uint16_t resume;
    int32_t units_charged;
    int32_t is_active; /* 1: a run is in progress */
    /* its keyframes: first, and one past the last */
    int32_t first, end;
    int32_t keyframe; /* next one to add; end: all are in, and move */
} mapper_window;

/* Work units that are left of the current scan's shares. */
typedef struct mapper_shares {
    int32_t window; /* of the force field */
    int32_t loop;   /* of loop closure and graph */
} mapper_shares;

struct cairn_mapper {
    cairn_mapper_params params;
    cairn_scan *scan;
    cairn_icp *icp;
    cairn_force_field *field;
    cairn_scan_set *keyframes;
    int32_t keyframe_count;
    int32_t *slot;             /* [max_keyframes] index of a keyframe in the set */
    cairn_pose *keyframe_pose; /* [max_keyframes] in the map, m and rad */
    /* Buffers of one keyframe on its way into the local map or the force field:
     * [scan.max_points] */
    cairn_oriented_point *points;
    /* [scan.max_segments] */
    cairn_segment *segments;
    /* [scan.max_segments + 1] */
    int32_t *first_point;
    /* [max_keyframes * CAIRN_VISIBILITY_BINS] ranges of the visibility profiles by slot; NULL when
     * no module uses them */
    uint16_t *visibility;

    int32_t is_pending;           /* 1: a scan is to be processed */
    uint16_t resume;              /* resume point of its processing */
    int32_t units_charged;        /* for the operation that waits */
    cairn_status status;          /* of the current scan or of settle(): that of a refused call */
    int32_t full;                 /* 1: no capacity, the mapper accepts no further scan */
    int32_t scans_since_keyframe; /* scans since the last keyframe */
    /* Scans in a row without a match, with odometry; their way ahead by odometry, m. 0: matched, or given
     * up. */
    int32_t unmatched;
    cairn_real unmatched_m;
    /* m^2, rad^2: variance of the predicted motion since the last keyframe */
    cairn_real motion_variance, motion_heading_variance;

    mapper_shares shares;
    mapper_window window;
    mapper_current current;
    mapper_previous previous;
    mapper_ranges ranges;
    mapper_finished finished;
    mapper_odometry odometry;
    mapper_target target;
    mapper_hypothesis hypothesis;
    /* serves relocalization and loop closure; NULL without both */
    cairn_scan_match *search;
    mapper_loop loop; /* its graph is NULL without loop closure */
    cairn_mapper_result result;
    cairn_mapper_state state;
    cairn_mapper_culling cullings[MAPPER_CULLING_EVENTS];
};

/* ---- mapper_create.c ---- */

/* Returns the capacity for the points of `count` keyframes together. */
int32_t cairn_mapper_local_points(const cairn_mapper_params *params, int32_t count);

/* Returns the number of most recent keyframes that are never culled. */
int32_t cairn_mapper_protected_count(const cairn_mapper_params *params);

/* ---- mapper_keyframes.c ---- */

/* Returns the pose of keyframe `second` relative to keyframe `first`. */
cairn_pose cairn_mapper_relative_pose(const cairn_mapper *mapper, int32_t first, int32_t second);

/* Adds a keyframe to a list [capacity] of the nearest ones, sorted by distance, unless it is full of
 * keyframes that are not farther. */
void cairn_mapper_add_neighbour(mapper_neighbour *list, int32_t *count, int32_t capacity,
                                mapper_neighbour neighbour);

static inline const cairn_scan_set_scan *cairn_mapper_keyframe_record(const cairn_mapper *mapper,
                                                                      int32_t keyframe)
{
    return &mapper->keyframes->scans[mapper->slot[keyframe]];
}

/* Returns the number of points of a keyframe. */
int32_t cairn_mapper_point_count(const cairn_mapper *mapper, int32_t keyframe);

/* Returns a keyframe as stored, without its beams; valid until the next call. */
cairn_scan_view cairn_mapper_keyframe_view(cairn_mapper *mapper, int32_t keyframe);

/* Returns 1 when the local map is stale or too far from the predicted pose. */
int32_t cairn_mapper_needs_local(const cairn_mapper *mapper);

/* Selects the keyframes near the predicted pose and builds the local map of them; returns 1 when
 * done. */
int cairn_mapper_build_local(cairn_mapper *mapper, cairn_budget *budget);

/* Returns the visibility profile of a keyframe, in its frame. */
cairn_visibility cairn_mapper_visibility(const cairn_mapper *mapper, int32_t keyframe);

/* Returns the points of a keyframe as input of a match, copied to the array. */
cairn_scan_match_part cairn_mapper_keyframe_part(const cairn_mapper *mapper, int32_t keyframe,
                                                 cairn_oriented_point *points);

/* Adds a keyframe with its visibility profile to the target of the search, at a cost of
 * cairn_mapper_search_target_units(). Returns 0 when it is full. */
int cairn_mapper_add_search_target(cairn_mapper *mapper, int32_t keyframe);

static inline int32_t cairn_mapper_search_target_units(const cairn_mapper *mapper, int32_t keyframe)
{
    return 2 + cairn_mapper_point_count(mapper, keyframe);
}

/* ---- mapper_share.c ---- */

/* Sets the shares of a scan. */
void cairn_mapper_begin_shares(cairn_mapper *mapper);

/* Returns 1 when another operation of the background may begin: budget and share are not used
 * up. */
int cairn_mapper_may_begin(const cairn_mapper *mapper, const cairn_budget *budget);

/* Charges an operation of the background before it is done, to the budget and to the scan's share.
 * Returns 1 when it is charged and may be done. charge_first() does not begin it when the share is
 * used up; charge_next() charges what belongs to the operation before.
 *
 * charged: units charged for the operation that waits */
int cairn_mapper_charge_first(cairn_mapper *mapper, cairn_budget *budget, int32_t *charged,
                              int32_t units);
int cairn_mapper_charge_next(cairn_mapper *mapper, cairn_budget *budget, int32_t *charged,
                             int32_t units);

/* Runs a step of a nested object on what is left of budget and share; returns 1 at its end. */
int cairn_mapper_run_in_share(cairn_mapper *mapper, cairn_budget *budget,
                              int (*step)(cairn_mapper *, cairn_budget *));

/* ---- mapper_window.c ---- */

/* Restarts the force field with the last keyframes; a run in progress is discarded. */
void cairn_mapper_begin_window(cairn_mapper *mapper);

/* Continues the force field run; returns 1 at its end. */
int cairn_mapper_window_step(cairn_mapper *mapper, cairn_budget *budget);

/* Returns 1 when a run has all its keyframes, which it moves. */
static inline int32_t cairn_mapper_window_runs(const cairn_mapper *mapper)
{
    return mapper->window.is_active && mapper->window.keyframe == mapper->window.end;
}

/* Ends the run with the poses reached so far. */
void cairn_mapper_end_window(cairn_mapper *mapper);

/* Copies the poses that the force field has reached so far. */
void cairn_mapper_read_window(cairn_mapper *mapper);

/* ---- mapper_front.c ---- */

/* Returns the length of a motion's translation, m. */
static inline cairn_real cairn_mapper_translation(cairn_pose motion)
{
    return cairn_sqrt(motion.x * motion.x + motion.y * motion.y);
}

/* Returns 1 when two poses differ by more than a distance, m, or an angle, rad. */
int32_t cairn_mapper_differ(cairn_pose a, cairn_pose b, cairn_real distance, cairn_real angle);

/* Returns the motion during the sweep of the next scan, for motion compensation (deskewing).
 * by_odometry: motion since the last scan; NULL: none. */
cairn_pose cairn_mapper_sweep_motion(const cairn_mapper *mapper, const cairn_scan_input *input,
                                     const cairn_pose *by_odometry);

/* Predicts the pose of the scan from the previous pose and the odometry since then. */
void cairn_mapper_predict(cairn_mapper *mapper);

/* Returns the quality of a match: overlap times exp(-sigma / 5 cm), sigma being the residual
 * standard deviation. */
cairn_real cairn_mapper_quality(const cairn_icp_result *match);

/* Returns the prior of the scan's pose after a motion from odometry or from the velocity model. */
cairn_rigid_motion_pose_prior cairn_mapper_prior_of(const cairn_mapper *mapper, cairn_pose motion,
                                                    int32_t is_odometry);

/* Returns the squared distance of a pose from the prediction or from standing still, whichever is
 * less, in units of m and rad; at most 4. */
cairn_real cairn_mapper_prior_deviation(const cairn_mapper *mapper, cairn_pose pose,
                                        cairn_real unit);

/* Returns 1 when a pose deviates from the prediction by more than motions change between scans. */
int32_t cairn_mapper_is_motion_outlier(const cairn_mapper *mapper, cairn_pose pose);

/* Returns the motion prior of the current scan. */
cairn_rigid_motion_pose_prior cairn_mapper_prior(const cairn_mapper *mapper);

/* Updates match quality, odometry health, noise scale and bias from the current scan's match. */
void cairn_mapper_update_motion_model(cairn_mapper *mapper);

/* Returns the motion that the velocity model predicts for the next scan. */
cairn_pose cairn_mapper_next_motion(cairn_mapper *mapper, cairn_pose motion);

/* ---- mapper_match.c ---- */

/* Matches the scan with the local map; returns 1 when done. Sets current.match. */
int cairn_mapper_match(cairn_mapper *mapper, cairn_budget *budget);

/* ---- mapper_ranges.c ---- */

/* Keeps the ends of the current scan's beams for the next scan. */
void cairn_mapper_keep_ranges(cairn_mapper *mapper);

/* Finds the translation of the current match along its weakly observable direction; returns 1 when
 * done. Sets current.match and current.weak_sigma. */
int cairn_mapper_compare_ranges(cairn_mapper *mapper, cairn_budget *budget);

/* ---- mapper_odometry.c ---- */

/* Sets the noise of the odometry: as stated in the params, or before any is learnt. */
void cairn_mapper_begin_odometry(cairn_mapper *mapper);

/* Learns how far matches scatter from the current scan's match; averages it with the odometry, or
 * drops it when it has low confidence: the pose is then predicted by odometry. */
void cairn_mapper_weigh_match(cairn_mapper *mapper);

/* Learns the noise of the odometry from the current scan's match, or rejects the match: the pose is
 * then predicted by odometry. */
void cairn_mapper_check_match(cairn_mapper *mapper);

/* Returns 1 where surfaces are rough, and matches scatter about odometry that is known. */
int32_t cairn_mapper_matches_scatter(const cairn_mapper *mapper);

/* Returns 1 while matches are rejected. */
int32_t cairn_mapper_is_rejecting(const cairn_mapper *mapper);

/* Returns the standard deviation, m, after another sample. samples: number before; deviation: m */
cairn_real cairn_mapper_learnt_sigma(cairn_real sigma, int32_t samples, cairn_real deviation);

/* ---- mapper_search.c ---- */

/* Searches for the scan among the nearby keyframes; returns 1 when done, or when its units are used
 * up. Sets current.relocalization and current.low_confidence. */
int cairn_mapper_relocalize(cairn_mapper *mapper, cairn_budget *budget);

/* ---- mapper_loop.c ---- */

/* Returns 1 when the second hypothesis scores nearly as well as the first (ambiguity ratio). */
int32_t cairn_mapper_is_ambiguous(const cairn_scan_match_result *result);

/* Gives the match object to a relocalization search; the current loop candidate restarts later. */
void cairn_mapper_preempt_loop_match(cairn_mapper *mapper);

/* Returns the number of keyframes that loop-closure detection has not processed; those in the window
 * of the force field do not count. */
int32_t cairn_mapper_pending_keyframes(const cairn_mapper *mapper);

/* Continues loop closure, graph optimization and culling; returns 1 when there is nothing to do
 * now. */
int cairn_mapper_loop_step(cairn_mapper *mapper, cairn_budget *budget);

/* ---- mapper_constraint.c ---- */

/* Returns the reference keyframe of the current scan: the one relative to which its pose is most
 * certain. The scan is no keyframe itself. */
int32_t cairn_mapper_choose_reference(const cairn_mapper *mapper);

/* Computes the sequential constraints of the current scan, the last keyframe stored. */
void cairn_mapper_constrain_keyframe(const cairn_mapper *mapper, mapper_constraint *constraint);

/* ---- mapper_graph.c ---- */

/* Records a loop-closure event. */
void cairn_mapper_record_loop(cairn_mapper *mapper, const cairn_mapper_loop *event);

/* Adds the next keyframe to the pose graph with its sequential constraints. */
cairn_status cairn_mapper_add_to_graph(cairn_mapper *mapper);

/* Adds a loop-closure link. covariance: of first_second, in the frame of second. CAIRN_FULL: no
 * capacity for links. */
cairn_status cairn_mapper_add_closure(cairn_mapper *mapper, const cairn_mapper_loop *event,
                                      cairn_sym3 covariance);

/* Returns 1 when the graph should be optimized. */
int32_t cairn_mapper_needs_optimization(const cairn_mapper *mapper);

/* Optimizes the graph and applies the solution; returns 1 when done. */
int cairn_mapper_optimize(cairn_mapper *mapper, cairn_budget *budget);

/* Attaches an end (0: first, 1: second) of a link to the adjacency list of its keyframe. */
void cairn_mapper_attach_link(mapper_loop *loop, int32_t link, int32_t end);

/* Sets the variances of a link from its covariance, in the frame of second. */
void cairn_mapper_set_link_variances(mapper_link *link, cairn_sym3 covariance);

/* Returns e^T Omega e, the chi-squared of a relative measurement at the current poses. */
cairn_real cairn_mapper_chi2(const cairn_mapper *mapper, int32_t first, int32_t second,
                             cairn_pose first_second, cairn_sym3 covariance);

/* Returns the covariance of a link: rotates the row-major covariance of a pose from the map into
 * the pose's own frame, and adds the noise floor of all links, loop.sigma and loop.sigma_theta. */
cairn_sym3 cairn_mapper_own_covariance(const cairn_mapper *mapper, const cairn_real covariance[9],
                                       cairn_real theta);

/* ---- mapper_redundancy.c ---- */

/* Returns 1 when all keyframes that may be culled have a score, 0 when the budget is used up. */
int cairn_mapper_score_redundancy(cairn_mapper *mapper, cairn_budget *budget);

/* Returns the most redundant keyframe of those that may be culled; never the first one. */
int32_t cairn_mapper_most_redundant(const cairn_mapper *mapper);

/* Invalidates the redundancy scores: of all keyframes, and of those near a culled one. */
void cairn_mapper_invalidate_redundancy(cairn_mapper *mapper);
void cairn_mapper_invalidate_redundancy_near(cairn_mapper *mapper, int32_t gone);

/* ---- mapper_capacity.c ---- */

/* Returns the end of the keyframes that may be culled. */
int32_t cairn_mapper_cull_end(const cairn_mapper *mapper);

/* Returns 1 when culling is on and there is no capacity for another keyframe. */
int32_t cairn_mapper_must_cull(const cairn_mapper *mapper);

/* Returns 1 when capacity is low and a keyframe may be culled; has hysteresis. */
int32_t cairn_mapper_may_cull(cairn_mapper *mapper);

/* Returns 1 when loop closure lags so far behind that too few keyframes may be culled soon. */
int32_t cairn_mapper_loops_lag(const cairn_mapper *mapper);

/* ---- mapper_culling.c ---- */

/* Culls the most redundant keyframe: redirects its links, renumbers, packs the scan set. Returns 1
 * when done. */
int cairn_mapper_cull(cairn_mapper *mapper, cairn_budget *budget);

#endif
