/* mapper: online 2-D pose-graph SLAM: from a stream of laser scans to poses and a keyframe map.
 *
 * Method.
 *
 * 1. Line segments and evenly spaced points are fitted to each scan (module scan).
 * 2. The scan is registered against a local map of nearby keyframes by ICP (module icp). The
 *    initial pose comes from odometry, or from a constant-velocity model without odometry. After a
 *    match of low confidence the scan is relocalized in a window (module scan_match). Without
 *    odometry, the translation along a direction that no wall across constrains, as in a corridor,
 *    comes from the ranges of the scan and of the one before, beam by beam; where these do not
 *    observe it, the predicted velocity is kept, with a larger covariance. On rough surfaces, as
 *    hedges, where matches scatter, they are averaged with odometry that the log has shown to be good.
 * 3. A scan becomes a keyframe when the robot has moved or turned enough since the last keyframe,
 *    or when the scan overlaps too little with the local map. Scans in a row without a match, with
 *    odometry, are none (up to eight, or 2 m): a person may stand before the robot, or turn it, and
 *    the next scan is searched for in all headings.
 * 4. A new keyframe starts a sliding-window refinement over the last keyframes by force field
 *    simulation (Adluru 2008, section 7.3.6, online FFS).
 * 5. Keyframes are the nodes of a pose_graph. Each new keyframe is searched for at older keyframes
 *    that it may have returned to (module scan_match). An unambiguous match that is consistent with
 *    the path and with free space becomes a loop closure, and the graph is optimized.
 * 6. With cull_keyframes the most redundant keyframe is removed when memory runs out. Its links are
 *    passed to a neighbour in the graph (approximate marginalization).
 *
 * A scan that is no keyframe is stored relative to a reference keyframe. Its pose is the keyframe's
 * current pose composed with the relative pose, so it follows later corrections. Steps 4 to 6 take
 * a fixed share of the work units of every scan, which bounds the cost of a scan.
 *
 *     add(scan) -> step(budget) until CAIRN_OK -> read(), keyframe_pose() ... ; after the last scan
 *     settle(budget) until CAIRN_OK */
#ifndef CAIRN_MAPPER_H
#define CAIRN_MAPPER_H

#include "cairn/force_field.h"
#include "cairn/icp.h"
#include "cairn/object.h"
#include "cairn/scan.h"
#include "cairn/scan_set.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Maximum number of keyframes in the local map that a scan is matched against. */
#define CAIRN_MAPPER_MAX_LOCAL_KEYFRAMES 64

/* Parameters of loop-closure detection. A return to a known place is searched for within three
 * standard deviations of the drift accumulated along the path in the pose graph, at most
 * search_radius: accumulated drift of more than search_radius in x or y is not closed. Defaults in
 * brackets. */
typedef struct cairn_mapper_loop_params {
    /* 0 ... 2^22 (4096): maximum number of links besides those between successive keyframes: loop
     * closures, and sequential constraints to other submaps. Further ones are dropped, see
     * state.capacity_exceeded. 0: no loop closure, no pose graph */
    int32_t max_loops;
    /* 0 ... 2^26 (32768): maximum number of blocks in the graph's sparse Cholesky factor, see
     * block_solver. Beyond it the graph is no longer optimized, until a keyframe is culled. */
    int32_t max_fill;
    /* >= 1 (8000): work units that loop closure and graph optimization may use per scan;
     * fewer delay closures (state.pending_keyframes) */
    int32_t units_per_scan;
    /* 1 ... 64 (9): keyframes around a candidate that form the target map of the match */
    int32_t target_keyframes;
    /* >= 1 (25): a loop closure joins keyframes whose indices differ by more than this */
    int32_t min_keyframe_gap;
    /* 1 ... 8 (3): number of consistent closures that a wide search requires; fewer accept
     * returns sooner, and more false ones */
    int32_t min_consistent;
    /* m, > 0 (3): maximum distance between the scan centroids of a candidate and the query, beyond
     * the search radius */
    cairn_real candidate_radius;
    /* m, > 0 (4): half side of the largest search window; a larger accumulated drift is not closed.
     * A larger window needs more cells of scan_match. */
    cairn_real search_radius;
    /* m, > 0 (0.6): a search of a smaller radius is local and needs no consistent closures */
    cairn_real local_search_radius;
    /* nats, any (2): minimum log odds of a closure by scan_match; in a wide search also less half
     * the squared Mahalanobis distance from the prior of the path */
    cairn_real min_log_odds;
    /* 0 ... 1 (0.1): maximum share of points in observed free space of an accepted closure */
    cairn_real max_free_space_violation;
    /* m, > 0 (0.01): standard deviation added to every link in x and y */
    cairn_real sigma;
    /* rad, > 0 (0.004): likewise in heading */
    cairn_real sigma_theta;
    /* > 0 (50): a closure whose chi-squared (squared Mahalanobis distance) exceeds this value after
     * an optimization is removed as an outlier */
    cairn_real max_chi2;
} cairn_mapper_loop_params;

/* Parameters; defaults in brackets. */
typedef struct cairn_mapper_params {
    /* preprocessing of a scan */
    cairn_scan_params scan;
    /* the mapper sets the capacities of icp itself */
    cairn_icp_params icp;
    /* the mapper sets max_scans, max_segments and max_points itself */
    cairn_force_field_params field;
    /* loop closure */
    cairn_mapper_loop_params loop;
    /* 1 ... 2^20 (1024): maximum number of keyframes */
    int32_t max_keyframes;
    /* scan.max_segments ... 2^24 (32768): capacity for segments of all keyframes */
    int32_t max_keyframe_segments;
    /* scan.max_points ... 2^24 (131072): capacity for points of all keyframes */
    int32_t max_keyframe_points;
    /* 0 or 1 (0): 1: the most redundant keyframe is culled before one of the three capacities is
     * exceeded. Requires loop closure, local_span > 0, and max_keyframes - 1 greater than each of:
     * local_span; window; loop.min_keyframe_gap + window_free (without a force field:
     * loop.min_keyframe_gap). 0: the mapper stops with CAIRN_FULL. */
    int32_t cull_keyframes;
    /* 1 ... 2^20 (4096): capacity for the points of the local map, at least one keyframe; the same
     * for the window of the force field. The farthest or oldest keyframes are left out beyond
     * it. */
    int32_t max_local_points;
    /* 1 ... CAIRN_MAPPER_MAX_LOCAL_KEYFRAMES (15): keyframes in the local map */
    int32_t local_keyframes;
    /* 1 ... local_keyframes (3): the most recent keyframes among them; the others are the
     * nearest */
    int32_t local_recent;
    /* 0 or >= local_recent (25): the local map uses only this number of most recent keyframes; 0:
     * all */
    int32_t local_span;
    /* m, > 0 (4): maximum distance of the nearest keyframes */
    cairn_real local_radius;
    /* m, > 0 (0.5): translation since the last keyframe that starts a new keyframe */
    cairn_real keyframe_distance;
    /* rad, > 0 (0.5): rotation since the last keyframe that starts a new keyframe */
    cairn_real keyframe_angle;
    /* 0 ... 1 (0.6): a scan with a smaller overlap also becomes a keyframe */
    cairn_real keyframe_min_overlap;
    /* 0 or 2 ... 64 (8): keyframes in the sliding window of the force field; 0: no force field */
    int32_t window;
    /* 1 ... window - 1 (3): the most recent keyframes of the window, which may move */
    int32_t window_free;
    /* >= 1 (32000): work units that the force field may use per scan */
    int32_t window_units;
    /* m per m, >= 0 (0.3): odometry noise: standard deviation of translation per metre travelled */
    cairn_real odometry_distance;
    /* rad per rad, >= 0 (0.3): standard deviation of rotation per radian turned */
    cairn_real odometry_turn;
    /* m, > 0 (0.01): minimum standard deviation of translation */
    cairn_real odometry_distance_min;
    /* rad, > 0 (0.005): minimum standard deviation of rotation */
    cairn_real odometry_turn_min;
    /* m, 0 ... 10 (0): standard deviation of odometry after 3 m, where it is known. Turns count 3 m
     * per rad. Matches that contradict it or scatter about it are rejected or averaged by it without
     * waiting until it is learnt; the prior of a match is that of odometry_distance and
     * odometry_turn. 0: learnt from the matches */
    cairn_real odometry_sigma;
    /* m per m, >= 0 (0.3): constant-velocity model without odometry: standard deviation of
     * translation per metre of the previous motion */
    cairn_real motion_distance;
    /* rad per rad, >= 0 (0.3): standard deviation of rotation per radian of the previous motion */
    cairn_real motion_turn;
    /* m, > 0 (0.03): minimum standard deviation of translation */
    cairn_real motion_distance_min;
    /* rad, > 0 (0.02): minimum standard deviation of rotation */
    cairn_real motion_turn_min;
    /* 0 ... 1 (0.3): minimum overlap of a valid match: share of the scan's points with a
     * correspondence */
    cairn_real min_overlap;
    /* 0 or 1 (1): 1: after a match of low confidence the scan is relocalized by scan_match, in a
     * window of up to 1 m plus the motion about the prediction; 0: never */
    int32_t search;
    /* >= 1 (200000): work units that the matches of a scan and its search may use, up to 4 times as
     * many after an interval in which scans are missing; a search that needs more fails */
    int32_t search_units;
} cairn_mapper_params;

/* Source of the pose of a scan. */
typedef int32_t cairn_mapper_verdict;
enum {
    CAIRN_MAPPER_FIRST = 0,      /* the first scan defines the map frame */
    CAIRN_MAPPER_MATCHED = 1,    /* scan matching succeeded */
    CAIRN_MAPPER_PREDICTED = 2,  /* no match: predicted by odometry or velocity */
    CAIRN_MAPPER_NO_FEATURES = 3 /* predicted: no surface point was fitted to the scan */
};

/* Pose of the last finished scan, and how it was found. */
typedef struct cairn_mapper_result {
    /* how the pose was found */
    cairn_mapper_verdict verdict;
    /* index of the reference keyframe of the scan; the scan itself when it is a keyframe */
    int32_t keyframe;
    /* pose of the scan in the frame of its reference keyframe, m and rad */
    cairn_pose keyframe_scan;
    /* pose of the scan in the map at the time of the match, m and rad */
    cairn_pose map_scan;
    /* Covariance of the scan's registration against the local map, given that map, its prior from
     * odometry or velocity included: not the uncertainty of the pose in the map, which grows with
     * the path. 3 x 3 row-major over (x, y, theta) along the axes of the map at the time of the
     * match, m and rad; later corrections do not rotate it. Inflated for a match of low confidence;
     * without healthy odometry, or after a jump, also along a weakly observable direction. Always
     * finite. All zeros without a match (FIRST, PREDICTED, NO_FEATURES), which means unknown, not
     * exact: read the verdict first. */
    cairn_real covariance[9];
    /* share of the scan's points with a correspondence; 0 without a match */
    cairn_real overlap;
    /* 1: the scan was stored as a keyframe */
    int32_t is_keyframe;
} cairn_mapper_result;

/* Counters over the whole life of the mapper. */
typedef struct cairn_mapper_state {
    /* number of finished scans */
    int64_t scans;
    /* scans without a match, those without features included */
    int64_t predicted;
    /* scans with a weakly observable direction, those without a match included */
    int64_t unobservable;
    /* scans whose match from the velocity model was better than that from odometry */
    int64_t odometry_rejected;
    /* scans whose match deviates from odometry by more than two standard deviations */
    int64_t odometry_contradicted;
    /* scans with a relocalization search, since their match had low confidence */
    int64_t searched;
    /* scans whose match still has low confidence; their covariance is inflated */
    int64_t low_confidence;
    /* number of keyframes */
    int32_t keyframes;
    /* work units charged so far */
    int64_t units;
    /* potential P(g) at the end of the last force field run */
    cairn_real potential;
    /* loop closures in the graph, outliers excluded */
    int32_t loops;
    /* number of events of cairn_mapper_loop_at() */
    int32_t loop_events;
    /* keyframes not yet processed by loop-closure detection; the last window_free are left out */
    int32_t pending_keyframes;
    /* number of graph optimizations */
    int32_t graph_solutions;
    /* 1: the graph has no capacity for more links, and a loop closure was refused without an event;
     * 2: its factor has none for more blocks, and the graph is not optimized until a keyframe is
     * culled; 0: neither */
    int32_t capacity_exceeded;
    /* number of events of cairn_mapper_culling_at() */
    int32_t culled_keyframes;
    /* matches rejected since they contradict the odometry, and stretches of the path where that
     * happened: returns may travel with the robot (floor ahead of a tilted scanner, legs, trailer).
     * The pose is predicted by odometry */
    int32_t matches_rejected, stretches_rejected;
} cairn_mapper_state;

/* Outcome of a loop-closure candidate. */
typedef int32_t cairn_mapper_loop_verdict;
enum {
    /* a link of the graph */
    CAIRN_MAPPER_LOOP_ACCEPTED = 0,
    /* waits for consistent closures; there is no later event when it never finds them */
    CAIRN_MAPPER_LOOP_PENDING = 1,
    /* no match found, or below min_log_odds */
    CAIRN_MAPPER_LOOP_NO_MATCH = 2,
    /* several matches of nearly the same score (perceptual aliasing) */
    CAIRN_MAPPER_LOOP_AMBIGUOUS = 3,
    /* too many points lie in space that was observed free */
    CAIRN_MAPPER_LOOP_FREE_SPACE_VIOLATION = 4,
    /* accepted earlier, then removed as an outlier after a graph optimization */
    CAIRN_MAPPER_LOOP_OUTLIER = 5,
    /* below min_log_odds after subtraction of half the squared Mahalanobis distance from the prior
     * of the path */
    CAIRN_MAPPER_LOOP_UNLIKELY = 6
};

/* Evidence for and against a loop-closure candidate. */
typedef struct cairn_mapper_loop_evidence {
    /* m: standard deviation of the position of the second keyframe relative to the first, by the
     * path between them in the pose graph */
    cairn_real path_sigma;
    /* nats: half the squared Mahalanobis distance of the match from the prior of that path */
    cairn_real prior_distance;
    /* 0 ... 1: score of the second hypothesis as a share of that of the match; 0: no second one */
    cairn_real competing_score;
    /* 0 ... 1: free-space violation of the match, the greater one of both directions */
    cairn_real free_space_violation;
} cairn_mapper_loop_evidence;

/* A loop event: a candidate and its outcome. */
typedef struct cairn_mapper_loop {
    int32_t first, second; /* keyframes, the older one first */
    /* measured pose of second in the frame of first; the identity for NO_MATCH without any
     * hypothesis, and for OUTLIER */
    cairn_pose first_second;
    /* outcome of the candidate */
    cairn_mapper_loop_verdict verdict;
    /* of the match; all zero for NO_MATCH without any hypothesis, and for OUTLIER */
    cairn_mapper_loop_evidence evidence;
    /* probability, 0.001 ... 1, that an accepted closure with this evidence is off by more than 0.2 m
     * or 2 degrees; 1 without a hypothesis and for OUTLIER */
    cairn_real error_probability;
} cairn_mapper_loop;

/* Returns the probability, 0.001 ... 1, that an accepted loop closure with this evidence is off by
 * more than 0.2 m or 2 degrees: a logistic regression to closures of generated drives
 * (bench/scenes --fit). Constant time.
 *
 * evidence: as an event has it */
cairn_real cairn_mapper_loop_error_probability(const cairn_mapper_loop_evidence *evidence);

/* Mapper of a scan stream. */
typedef struct cairn_mapper cairn_mapper;

/* Returns the default parameters. scan, icp and field have their own defaults, except that the
 * force field starts with a small sigma. */
cairn_mapper_params cairn_mapper_default(void);

/* Returns the defaults sized for max_keyframes keyframes of a scanner with max_beams beams: 160
 * points, 40 segments, 4 loop closures and 40 factor blocks per keyframe. The memory is then a
 * constant plus a multiple of max_keyframes, see docs/memory.md.
 *
 * max_keyframes: capacity for keyframes, >= 1
 * max_beams: most beams of a scan, >= 1 */
cairn_mapper_params cairn_mapper_default_for(int32_t max_keyframes, int32_t max_beams);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_mapper_check(const cairn_mapper_params *params,
                                              cairn_object_fault *fault);

/* Returns the bytes that create() takes from the pool; 0 for invalid params. */
size_t cairn_mapper_memory(const cairn_mapper_params *params);

/* Creates a mapper in the pool. CAIRN_BAD_ARGUMENT: NULL or invalid params. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_mapper_create(cairn_mapper **mapper, cairn_pool *pool,
                                               const cairn_mapper_params *params);

/* Takes the next scan; its arrays are copied. odometry: pose of the base in the odometry frame at
 * the first beam, m and rad; NULL: none. CAIRN_MORE: the scan is taken; call step() until it
 * returns CAIRN_OK. CAIRN_BUSY: the previous scan is still being processed, nothing was taken: step
 * first, then add this scan again. Statuses of cairn_scan_begin. CAIRN_NOT_FINITE: odometry is not
 * finite. CAIRN_BAD_ARGUMENT: odometry is farther than 1e9 m from its origin. CAIRN_FULL: no
 * capacity for another keyframe. An odometry step longer than CAIRN_SCAN_EXTENT is ignored.
 *
 * input: ranges, angles and poses */
CAIRN_CHECKED cairn_status cairn_mapper_add(cairn_mapper *mapper, const cairn_scan_input *input,
                                            const cairn_pose *odometry, cairn_fault *fault);

/* Continues processing the current scan. CAIRN_MORE: the budget is used up. CAIRN_OK: the scan has
 * its pose. CAIRN_FULL: the scan has its pose, but there was no capacity to store it as a keyframe;
 * the mapper accepts no further scan. Every operation is charged before it is done; see also the
 * steps of scan, icp, scan_match and pose_graph. The largest ones add the points of a keyframe to
 * the target of a match, one a unit, or take the poses of the graph, four keyframes or eight links a
 * unit. */
CAIRN_CHECKED cairn_status cairn_mapper_step(cairn_mapper *mapper, cairn_budget *budget);

/* Maps a scan: add(), and steps without a limit until the scan has its pose. For callers who do not
 * count ticks; where add() and step() are used, too, CAIRN_BUSY as for add(). Statuses of both.
 * Cost: up to max(4 search_units, loop.units_per_scan) and a multiple of max_local_points, in one
 * call.
 *
 * input: ranges, angles and poses
 * odometry: pose of the base in the odometry frame at the first beam, m and rad; NULL: none */
CAIRN_CHECKED cairn_status cairn_mapper_map(cairn_mapper *mapper, const cairn_scan_input *input,
                                            const cairn_pose *odometry, cairn_fault *fault);

/* Finishes the current scan and all pending loop-closure and graph work. CAIRN_MORE: the budget is
 * used up. CAIRN_OK: nothing is pending; more scans may follow. CAIRN_FULL as step(). */
CAIRN_CHECKED cairn_status cairn_mapper_settle(cairn_mapper *mapper, cairn_budget *budget);

/* Returns the result of the last finished scan. */
cairn_mapper_result cairn_mapper_read(const cairn_mapper *mapper);

/* Returns map_odom, the pose of the odometry frame in the map: the pose of the last finished scan
 * in the map is map_odom composed with its odometry. map_odom jumps at loop closures; the odometry
 * never does. After scans without odometry it keeps its last value; the identity before any
 * odometry. */
cairn_pose cairn_mapper_map_odom(const cairn_mapper *mapper);

/* Returns the last scan as points and segments in its own frame; valid until the next add. */
cairn_scan_view cairn_mapper_view(const cairn_mapper *mapper);

/* Returns the current pose of a keyframe in the map, 0 <= keyframe < keyframes; outside the
 * identity.
 *
 * keyframe: index of the keyframe */
cairn_pose cairn_mapper_keyframe_pose(const cairn_mapper *mapper, int32_t keyframe);

/* Returns segments and points of all keyframes, each in its own frame. */
const cairn_scan_set *cairn_mapper_keyframes(const cairn_mapper *mapper);

/* Returns the index of a keyframe in the set of cairn_mapper_keyframes(); both are equal until a
 * keyframe is culled.
 *
 * keyframe: 0 ... keyframes - 1 */
int32_t cairn_mapper_keyframe_slot(const cairn_mapper *mapper, int32_t keyframe);

/* A culling event: a keyframe was removed. Higher keyframe indices decrease by one from then on.
 * Results, loop events and links that are read later use the new indices. */
typedef struct cairn_mapper_culling {
    int32_t keyframe; /* index before the culling */
    /* its neighbour in the graph, index after the culling; the attached scans move to it */
    int32_t reference;
    cairn_pose reference_keyframe; /* pose of the culled keyframe in the frame of reference */
} cairn_mapper_culling;

/* Returns culling event 0 <= index < state.culled_keyframes. Only the last 64 are stored: index is
 * taken modulo 64. Outside: keyframe -1. Few keyframes are culled per step(), so reading after each
 * step misses none. */
cairn_mapper_culling cairn_mapper_culling_at(const cairn_mapper *mapper, int32_t index);

/* Reattaches a relative pose after a culling: maps the keyframe index and, for the culled keyframe,
 * the pose relative to it.
 *
 * culling: event of cairn_mapper_culling_at()
 * keyframe: index of the keyframe, changed when it moves
 * keyframe_scan: pose of the scan in the frame of the keyframe, changed likewise */
void cairn_mapper_reattach(cairn_mapper_culling culling, int32_t *keyframe,
                           cairn_pose *keyframe_scan);

/* Returns loop event 0 <= index < state.loop_events. Only the last 64 are stored: index is taken
 * modulo 64. Outside: first and second are -1. */
cairn_mapper_loop cairn_mapper_loop_at(const cairn_mapper *mapper, int32_t index);

/* A link (edge, relative-pose constraint) of the keyframe graph: a sequential constraint, a
 * constraint to another keyframe of the local map, a loop closure, or their composition by culled
 * keyframes. */
typedef struct cairn_mapper_link {
    /* keyframes that the link joins */
    int32_t first, second;
    /* measured pose of second in the frame of first */
    cairn_pose first_second;
    cairn_sym3 information; /* inverse covariance of first_second, in the frame of second */
    /* 1: a loop closure; 1: excluded from the graph as an outlier */
    int32_t is_loop, is_outlier;
    /* of a loop closure: probability that it is wrong, as in cairn_mapper_loop; 0 of others */
    cairn_real error_probability;
} cairn_mapper_link;

/* Returns the number of links; 0 without loop closure. The last keyframes get theirs in
 * settle(). */
int32_t cairn_mapper_link_count(const cairn_mapper *mapper);

/* Returns link 0 <= index < link_count; outside first and second are -1. */
cairn_mapper_link cairn_mapper_link_at(const cairn_mapper *mapper, int32_t index);

/* What uncertain links leave open of the pose of a keyframe relative to the first one. */
typedef struct cairn_mapper_uncertainty {
    /* m^2: of x plus of y */
    cairn_real position_variance;
    /* m rad: heading variance times the way from where the heading became uncertain; with several
     * such places the sum */
    cairn_vec2 covariance;
    cairn_real heading_variance; /* rad^2 */
} cairn_mapper_uncertainty;

/* Finds the uncertainty of all keyframes in the map: 0 unless the robot was lost on every path to the
 * first keyframe, over matches of low confidence, scans without a match and loop closures with an
 * error probability of 0.1 or more. Drift over certain matches is not counted, nor a heading where the
 * odometry agrees with the matches. A robot that was lost leaves mostly more than 0.35 m (square root
 * of position_variance) on all that follows, until a loop is closed, or scans match earlier keyframes
 * again; best after settle(). CAIRN_BAD_ARGUMENT: NULL, or not one for each keyframe.
 * CAIRN_UNSUPPORTED: without loop closure there is no graph. Cost: all links two to five times, at
 * worst once per keyframe, in one call; no memory.
 *
 * keyframes: [count] filled in, by keyframe
 * count: state.keyframes */
CAIRN_CHECKED cairn_status cairn_mapper_find_uncertainty(const cairn_mapper *mapper,
                                                         cairn_mapper_uncertainty *keyframes,
                                                         int32_t count);

/* Returns the counters. */
cairn_mapper_state cairn_mapper_measure(const cairn_mapper *mapper);

#ifdef __cplusplus
}
#endif

#endif
