/* mapper: online 2-D pose-graph SLAM: from a stream of laser scans to poses and a keyframe map.
 *
 * Method.
 *
 * 1. Line segments and evenly spaced points are fitted to each scan (module scan).
 * 2. The scan is registered against a local map of nearby keyframes by ICP (module icp). The
 *    initial pose comes from odometry, or from a constant-velocity model without odometry.
 * 3. A scan that shows enough new surface becomes a keyframe.
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
#include "cairn/scan.h"
#include "cairn/scan_set.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Maximum number of keyframes in the local map that a scan is matched against. */
#define CAIRN_MAPPER_MAX_LOCAL_KEYFRAMES 64

/* Parameters of loop-closure detection. A return to a known place is searched for within the
 * uncertainty that has accumulated along the path. Defaults in parentheses. */
typedef struct cairn_mapper_loop_params {
    /* maximum number of loop closures, 1 ... 2^22; 0: loop closure is off (4096) */
    int32_t max_loops;
    /* maximum number of blocks in the graph's sparse Cholesky factor, see block_solver (32768) */
    int32_t max_fill;
    /* work units that loop closure and graph optimization may use per scan, >= 1 (8000) */
    int32_t units_per_scan;
    /* keyframes around a candidate that form the target map of the match, 1 ... 64 (9) */
    int32_t target_keyframes;
    /* minimum difference of keyframe indices for a loop closure, >= 1 (25) */
    int32_t min_keyframe_gap;
    /* number of consistent closures that a wide search requires, 1 ... 8 (3) */
    int32_t min_consistent;
    /* m, > 0: maximum distance between the scan centroids of a candidate and the query, beyond the
     * path uncertainty (3) */
    cairn_real candidate_radius;
    /* m, > 0: half side of the largest search window (4) */
    cairn_real search_radius;
    /* m, > 0: a search within this radius is local and needs no consistent closures (0.6) */
    cairn_real local_search_radius;
    /* nats: minimum log odds of a closure, by scan_match and the path prior (2) */
    cairn_real min_log_odds;
    /* maximum share of points in observed free space of an accepted closure, in [0, 1] (0.1) */
    cairn_real max_free_space_violation;
    /* m, > 0: standard deviation added to every link (0.01) */
    cairn_real sigma;
    /* rad, > 0: likewise in heading (0.004) */
    cairn_real sigma_theta;
    /* a closure whose chi-squared (squared Mahalanobis distance) exceeds this value after an
     * optimization is removed as an outlier, > 0 (50) */
    cairn_real max_chi2;
} cairn_mapper_loop_params;

typedef struct cairn_mapper_params {
    cairn_scan_params scan;
    /* the mapper sets the capacities of icp itself */
    cairn_icp_params icp;
    /* the mapper sets max_scans, max_segments and max_points itself */
    cairn_force_field_params field;
    cairn_mapper_loop_params loop;
    /* maximum number of keyframes, 1 ... 2^20 (1024) */
    int32_t max_keyframes;
    /* capacity for segments of all keyframes, scan.max_segments ... 2^24 (32768) */
    int32_t max_keyframe_segments;
    /* capacity for points of all keyframes, scan.max_points ... 2^24 (131072) */
    int32_t max_keyframe_points;
    /* 1: the most redundant keyframe is culled before one of the three capacities is exceeded.
     * Requires loop closure, local_span > 0, and max_keyframes greater than local_span,
     * loop.min_keyframe_gap plus window_free, and window, plus 1. 0: the mapper stops with
     * CAIRN_FULL (0) */
    int32_t cull_keyframes;
    /* capacity for the points of the local map, 1 ... 2^20, at least one keyframe; the same for the
     * window of the force field. The farthest or oldest keyframes are left out beyond it (4096) */
    int32_t max_local_points;
    /* keyframes in the local map, 1 ... CAIRN_MAPPER_MAX_LOCAL_KEYFRAMES (15) */
    int32_t local_keyframes;
    /* of which the most recent ones, the others being the nearest: 1 ... local_keyframes (3) */
    int32_t local_recent;
    /* the local map uses only this number of most recent keyframes, >= local_recent; 0: all (25) */
    int32_t local_span;
    /* m, > 0: maximum distance of the nearest keyframes (4) */
    cairn_real local_radius;
    /* m, > 0: translation since the last keyframe that starts a new keyframe (0.5) */
    cairn_real keyframe_distance;
    /* rad, > 0: rotation since the last keyframe that starts a new keyframe (0.5) */
    cairn_real keyframe_angle;
    /* a scan with a smaller overlap also becomes a keyframe, in [0, 1] (0.6) */
    cairn_real keyframe_min_overlap;
    /* keyframes in the sliding window of the force field, 2 ... 64; 0: no force field (8) */
    int32_t window;
    /* of which the most recent ones may move, 1 ... window - 1 (3) */
    int32_t window_free;
    /* work units that the force field may use per scan, >= 1 (32000) */
    int32_t window_units;
    /* odometry noise: standard deviation of translation per metre travelled (0.3) */
    cairn_real odometry_distance;
    /* standard deviation of rotation per radian turned (0.3) */
    cairn_real odometry_turn;
    /* m, > 0: minimum standard deviation of translation (0.01) */
    cairn_real odometry_distance_min;
    /* rad, > 0: minimum standard deviation of rotation (0.005) */
    cairn_real odometry_turn_min;
    /* constant-velocity model without odometry: standard deviation of translation per metre of the
     * previous motion (0.3) */
    cairn_real motion_distance;
    /* standard deviation of rotation per radian of the previous motion (0.3) */
    cairn_real motion_turn;
    /* m, > 0: minimum standard deviation of translation (0.03) */
    cairn_real motion_distance_min;
    /* rad, > 0: minimum standard deviation of rotation (0.02) */
    cairn_real motion_turn_min;
    /* minimum overlap of a valid match: share of the scan's points with a correspondence (0.3) */
    cairn_real min_overlap;
    /* 1: a match of low confidence is searched for globally in a window by scan_match; 0: never
     * (1) */
    int32_t search;
    /* work units that the matches of a scan and its search may use, >= 1; a search that needs more
     * fails (155000) */
    int32_t search_units;
} cairn_mapper_params;

/* Source of the pose of a scan. */
typedef int32_t cairn_mapper_verdict;
enum {
    CAIRN_MAPPER_FIRST = 0,      /* the first scan defines the map frame */
    CAIRN_MAPPER_MATCHED = 1,    /* scan matching succeeded */
    CAIRN_MAPPER_PREDICTED = 2,  /* no match: predicted by odometry or velocity */
    CAIRN_MAPPER_NO_FEATURES = 3 /* predicted; the scan has no segments */
};

typedef struct cairn_mapper_result {
    cairn_mapper_verdict verdict;
    /* index of the reference keyframe of the scan; the scan itself when it is a keyframe */
    int32_t keyframe;
    /* pose of the scan in the frame of its reference keyframe, m and rad */
    cairn_pose keyframe_scan;
    /* pose of the scan in the map at the time of the match, m and rad */
    cairn_pose map_scan;
    /* covariance of the match, 3 x 3 row-major over (x, y, theta) in the map frame, m and rad;
     * zeros for FIRST; always finite */
    cairn_real covariance[9];
    /* share of the scan's points with a correspondence; 0 without a match */
    cairn_real overlap;
    /* 1: the scan was stored as a keyframe */
    int32_t is_keyframe;
} cairn_mapper_result;

/* Counters over the whole life of the mapper. */
typedef struct cairn_mapper_state {
    int64_t scans;
    /* scans without a match, those without features included */
    int64_t predicted;
    /* scans with a weakly observable direction, those without a match included */
    int64_t unobservable;
    /* scans whose match from the velocity model was better than that from odometry */
    int64_t odometry_rejected;
    /* scans whose match deviates from odometry by more than two standard deviations */
    int64_t odometry_contradicted;
    /* scans whose match had low confidence and was searched for */
    int64_t searched;
    /* scans whose match still has low confidence; their covariance is inflated */
    int64_t low_confidence;
    int32_t keyframes;
    /* work units charged so far */
    int64_t units;
    /* potential P(g) at the end of the last force field run */
    cairn_real potential;
    /* loop closures in the graph, outliers excluded */
    int32_t loops;
    /* number of events of cairn_mapper_loop_at() */
    int32_t loop_events;
    /* keyframes that loop-closure detection has not processed yet */
    int32_t pending_keyframes;
    /* number of graph optimizations */
    int32_t graph_solutions;
    /* 1: the graph has no capacity for more links; 2: its factor has none for more blocks; 0:
     * neither */
    int32_t capacity_exceeded;
    /* number of events of cairn_mapper_culling_at() */
    int32_t culled_keyframes;
} cairn_mapper_state;

/* Outcome of a loop-closure candidate. */
typedef int32_t cairn_mapper_loop_verdict;
enum {
    CAIRN_MAPPER_LOOP_ACCEPTED = 0,
    /* waits for consistent closures */
    CAIRN_MAPPER_LOOP_PENDING = 1,
    /* no match found, or below min_log_odds */
    CAIRN_MAPPER_LOOP_NO_MATCH = 2,
    /* several matches of nearly the same score (perceptual aliasing) */
    CAIRN_MAPPER_LOOP_AMBIGUOUS = 3,
    /* too many points lie in space that was observed free */
    CAIRN_MAPPER_LOOP_FREE_SPACE_VIOLATION = 4,
    /* accepted earlier, then removed as an outlier after a graph optimization */
    CAIRN_MAPPER_LOOP_OUTLIER = 5,
    /* the log odds do not outweigh the squared Mahalanobis distance from the path prior */
    CAIRN_MAPPER_LOOP_UNLIKELY = 6
};

typedef struct cairn_mapper_loop {
    int32_t first, second;   /* keyframes, the older one first */
    cairn_pose first_second; /* as matched; the identity for NO_MATCH */
    cairn_mapper_loop_verdict verdict;
} cairn_mapper_loop;

typedef struct cairn_mapper cairn_mapper;

/* Returns the default parameters, given in parentheses above. scan, icp and field have their own
 * defaults, except that the force field starts with a small sigma. */
cairn_mapper_params cairn_mapper_default(void);

/* Returns the defaults sized for max_keyframes keyframes of a scanner with max_beams beams: 160
 * points, 40 segments, 4 loop closures and 40 factor blocks per keyframe. The memory is then a
 * constant plus a multiple of max_keyframes, see docs/memory.md. */
cairn_mapper_params cairn_mapper_default_for(int32_t max_keys, int32_t max_beams);

/* Returns the bytes that create() takes from the pool; 0 for invalid params. */
size_t cairn_mapper_memory(const cairn_mapper_params *params);

/* Creates a mapper in the pool. CAIRN_BAD_ARGUMENT: NULL or invalid params. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_mapper_create(cairn_mapper **mapper, cairn_pool *pool,
                                               const cairn_mapper_params *params);

/* Starts processing the next scan; its arrays are copied. odometry: pose of the base in the
 * odometry frame at the first beam, m and rad; NULL: none. CAIRN_MORE: the previous scan is still
 * being processed; call step() first, nothing was taken. Statuses of cairn_scan_begin.
 * CAIRN_NOT_FINITE: odometry is not finite. CAIRN_BAD_ARGUMENT: odometry is farther than 1e9 m from
 * its origin. CAIRN_FULL: no capacity for another keyframe. An odometry step longer than
 * CAIRN_SCAN_EXTENT is ignored. */
CAIRN_CHECKED cairn_status cairn_mapper_add(cairn_mapper *mapper, const cairn_scan_input *input,
                                            const cairn_pose *odometry, cairn_fault *fault);

/* Continues processing the current scan. CAIRN_MORE: the budget is used up. CAIRN_OK: the scan has
 * its pose. CAIRN_FULL: the scan has its pose, but there was no capacity to store it as a keyframe;
 * the mapper accepts no further scan. */
CAIRN_CHECKED cairn_status cairn_mapper_step(cairn_mapper *mapper, cairn_budget *budget);

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
 * identity. */
cairn_pose cairn_mapper_keyframe_pose(const cairn_mapper *mapper, int32_t keyframe);

/* Returns segments and points of all keyframes, each in its own frame. keyframe_slot() maps a
 * keyframe index, 0 <= keyframe < keyframes, to its index in the set (outside: -1); both are
 * equal until a keyframe is culled. */
const cairn_scan_set *cairn_mapper_keyframes(const cairn_mapper *mapper);
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
 * the pose relative to it. */
void cairn_mapper_reattach(cairn_mapper_culling culling, int32_t *keyframe,
                           cairn_pose *keyframe_scan);

/* Returns loop event 0 <= index < state.loop_events. Only the last 64 are stored: index is taken
 * modulo 64. Outside: first and second are -1. */
cairn_mapper_loop cairn_mapper_loop_at(const cairn_mapper *mapper, int32_t index);

/* A link (edge, relative-pose constraint) of the keyframe graph: a sequential constraint, a
 * constraint to another keyframe of the local map, a loop closure, or their composition by culled
 * keyframes. */
typedef struct cairn_mapper_link {
    int32_t first, second;
    cairn_pose first_second;
    cairn_sym3 information; /* inverse covariance of first_second, in the frame of second */
    int32_t is_loop, is_outlier;
} cairn_mapper_link;

/* Returns the number of links; 0 without loop closure. The last keyframes get theirs in
 * settle(). */
int32_t cairn_mapper_link_count(const cairn_mapper *mapper);

/* Returns link 0 <= index < link_count; outside first and second are -1. */
cairn_mapper_link cairn_mapper_link_at(const cairn_mapper *mapper, int32_t index);

/* Returns the counters. */
cairn_mapper_state cairn_mapper_measure(const cairn_mapper *mapper);

#ifdef __cplusplus
}
#endif

#endif
