/* mapper: from scans, one after another, to poses.
 *
 * Each scan is fitted (scan), matched against the key scans near by (icp), starting from the
 * odometry where there is one and from the last motion otherwise, and, when it shows enough that is
 * new, kept as a key scan. A new key scan lets the force field run over the window of the last key
 * scans (Adluru 2008, section 7.3.6, online FFS). Scans hang on key scans: the pose of a scan is
 * that of its key scan, which may still move, composed with its place seen from there.
 *
 * Key scans are linked in a pose_graph. Each one is looked for (scan_match) at the older ones that
 * it may have come back to; what is found, agrees with what else is known, and has no rival, closes
 * a loop, and all key scans are corrected. That takes a fixed share of every scan's steps, so that
 * no scan costs much more than another.
 *
 * A mapper that runs on and on can release key scans (params.release): before one more has no room,
 * the one goes of whose free space and surfaces the key scans before it show most. Its links pass
 * to a neighbour, with what they know, and so do the scans that hang on it.
 *
 *
 *     add(scan) -> step(budget) until CAIRN_OK -> read(), key_pose() ... ; after the last one
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

/* The most key scans that a scan is matched against. */
#define CAIRN_MAPPER_LOCAL_MOST 64

/* Loops. A path that comes back is looked for where it may be, given how far its links can have
 * led it astray. */
typedef struct cairn_mapper_loop_params {
    /* closures in all, 1 ... 2^22; 0: no loops are closed (4096) */
    int32_t max_loops;
    /* blocks of the graph's factor, see block_solver (32768) */
    int32_t max_fill;
    /* of budget that loops and graph may take of every scan, >= 1 (8000) */
    int32_t units;
    /* key scans of the map around a candidate, 1 ... 64 (9) */
    int32_t keys;
    /* a path that is shorter than so many key scans is no loop, >= 1 (25) */
    int32_t gap;
    /* so many closures must agree when the search is wide, 1 ... 8 (3) */
    int32_t agree;
    /* m, > 0: candidates see things within so far of what the key scan sees (3) */
    cairn_real radius;
    /* m, > 0: half side of the widest search (4) */
    cairn_real window;
    /* m, > 0: a search within so far is not wide (0.6) */
    cairn_real window_near;
    /* of scan_match and the path, log odds, that a closure needs (2) */
    cairn_real evidence;
    /* share of points in free space that a closure may have, in [0, 1] (0.1) */
    cairn_real contradiction;
    /* m, > 0: standard deviation that every link has at least ... (0.01) */
    cairn_real sigma;
    /* ... rad, > 0 (0.004) */
    cairn_real sigma_turn;
    /* a closure with e^T Omega e beyond this after a correction is dropped, > 0 (50) */
    cairn_real outlier;
} cairn_mapper_loop_params;

typedef struct cairn_mapper_params {
    cairn_scan_params scan;
    /* its capacities are set by the mapper */
    cairn_icp_params icp;
    /* likewise max_scans */
    cairn_force_field_params field;
    cairn_mapper_loop_params loop;
    /* key scans in all, 1 ... 2^20 (1024) */
    int32_t max_keys;
    /* segments of all key scans, scan.max_segments ... 2^24 (32768) */
    int32_t max_key_segments;
    /* points of all key scans, scan.max_points ... 2^24 (131072) */
    int32_t max_key_points;
    /* 1: before these have no room for one more, the best covered key scan is released. That
     * needs loops, a local_span, and more key scans than local_span, gap and window and one
     * more. 0: then the mapper is full (0) */
    int32_t release;
    /* of all key scans of the local map, 1 ... 2^20, one key scan always has room; likewise of
     * the force field's window. Where there are more, the farthest, or oldest, are left out
     * (4096) */
    int32_t max_local_points;
    /* key scans to match against, 1 ... CAIRN_MAPPER_LOCAL_MOST (15) */
    int32_t local_keys;
    /* of these so many are the last ones, the others the nearest: 1 ... local_keys (3) */
    int32_t local_recent;
    /* of the last so many, >= local_recent; 0: of all (25) */
    int32_t local_span;
    /* m, > 0: the nearest ones are at most so far (4) */
    cairn_real local_radius;
    /* m, > 0, and ... (0.5) */
    cairn_real key_distance;
    /* ... rad, > 0: what lies between key scans (0.5) */
    cairn_real key_turn;
    /* a scan of less support is a key scan, too, in [0, 1] (0.6) */
    cairn_real key_support;
    /* key scans of the force field, 2 ... 64; 0: no force field (8) */
    int32_t window;
    /* of these so many may move, 1 ... window - 1 (3) */
    int32_t window_free;
    /* of budget that the force field may take of every scan, >= 1 (32000) */
    int32_t window_units;
    /* odometry is wrong by this share of the way ... (0.3) */
    cairn_real odometry_distance;
    /* ... and of the turn (0.3) */
    cairn_real odometry_turn;
    /* m, and at least by this (0.01) */
    cairn_real odometry_distance_min;
    /* rad, and at least by this (0.005) */
    cairn_real odometry_turn_min;
    /* without odometry: of the motion before, the next one differs by this share ... */
    cairn_real motion_distance;
    /* ... likewise its turn (0.3 and 0.3) ... */
    cairn_real motion_turn;
    /* m, > 0, and at least by this (0.03) */
    cairn_real motion_distance_min;
    /* rad, > 0 (0.02) */
    cairn_real motion_turn_min;
    /* share of the scan's points with partners, less than 0.1 m off, that a match needs (0.3) */
    cairn_real min_support;
    /* 1: where a match is in doubt, scan_match searches; 0: the match stays as it is (1) */
    int32_t search;
    /* Of budget that the matches of a scan and a search may take, >= 1; a search that takes more
     * finds nothing (155000). */
    int32_t search_units;
} cairn_mapper_params;

/* How the pose of a scan was found. */
typedef int32_t cairn_mapper_verdict;
enum {
    CAIRN_MAPPER_FIRST = 0,     /* the first scan defines the map */
    CAIRN_MAPPER_MATCHED = 1,   /* by match */
    CAIRN_MAPPER_PREDICTED = 2, /* no match: odometry, or the last motion */
    CAIRN_MAPPER_BLIND = 3      /* as predicted, the scan shows nothing */
};

typedef struct cairn_mapper_result {
    cairn_mapper_verdict verdict;
    /* index of the key scan on which the scan hangs; may be the scan itself */
    int32_t key;
    /* the scan seen from its key scan */
    cairn_pose key_scan;
    /* at the time of the match */
    cairn_pose map_scan;
    /* of the match, row-major over x, y, theta in the map; zeros for FIRST, NaN-free always */
    cairn_real covariance[9];
    /* share of the scan's points with partners; 0 without a match */
    cairn_real support;
    /* 1: the scan was kept as a key scan */
    int32_t is_key;
} cairn_mapper_result;

/* Measurements over the mapper's whole life. */
typedef struct cairn_mapper_state {
    int64_t scans;
    /* scans that could not be matched, blind ones included */
    int64_t predicted;
    /* scans that hardly tell where they are along some direction, these included */
    int64_t unobservable;
    /* scans whose match from the last motion was better than that from odometry */
    int64_t odometry_rejected;
    /* scans whose match is beyond two standard deviations of odometry */
    int64_t odometry_contradicted;
    /* scans whose match was in doubt ... */
    int64_t searched;
    /* ... and still is; their covariance says so */
    int64_t doubtful;
    int32_t keys;
    /* of budget */
    int64_t units;
    /* of the last run of the force field */
    cairn_real potential;
    /* closures in the graph */
    int32_t loops;
    /* of cairn_mapper_loop_at() */
    int32_t loop_events;
    /* key scans that have not been looked for yet */
    int32_t waiting;
    /* corrections of all key scans */
    int32_t solutions;
    /* 1: the graph has no room for links, 2: ... nor its factor for blocks */
    int32_t lacks_room;
    /* of cairn_mapper_release_at() */
    int32_t releases;
} cairn_mapper_state;

/* What became of a closure. */
typedef int32_t cairn_mapper_loop_verdict;
enum {
    CAIRN_MAPPER_LOOP_ACCEPTED = 0,
    /* until others agree */
    CAIRN_MAPPER_LOOP_WAITING = 1,
    /* the match found nothing */
    CAIRN_MAPPER_LOOP_NONE = 2,
    /* it found several places */
    CAIRN_MAPPER_LOOP_AMBIGUOUS = 3,
    /* points stand in space that was seen free */
    CAIRN_MAPPER_LOOP_CONTRADICTED = 4,
    /* accepted once, but the graph as a whole speaks against it */
    CAIRN_MAPPER_LOOP_DROPPED = 5,
    /* it leads too far from where the path led for what speaks for it */
    CAIRN_MAPPER_LOOP_UNLIKELY = 6
};

typedef struct cairn_mapper_loop {
    int32_t first, second;   /* key scans, the older one first */
    cairn_pose first_second; /* as matched; the identity for NONE */
    cairn_mapper_loop_verdict verdict;
} cairn_mapper_loop;

typedef struct cairn_mapper cairn_mapper;

/* The values in brackets; scans, match and field as their own defaults but for a force field
 * that starts small. */
cairn_mapper_params cairn_mapper_default(void);

/* The same for so many key scans of a scanner of so many beams: room for 160 points and 40
 * segments of each, and for 4 closures and 40 blocks of the graph's factor. What the mapper
 * takes is then a part that does not depend on the key scans and so much for each of them, see
 * docs/memory.md. */
cairn_mapper_params cairn_mapper_default_for(int32_t max_keys, int32_t max_beams);

/* 0 for params that create() would refuse. */
size_t cairn_mapper_memory(const cairn_mapper_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_mapper_create(cairn_mapper **mapper, cairn_pool *pool,
                                               const cairn_mapper_params *params);

/* Takes in the next scan; its arrays are copied. odometry: the base in the odometry's frame at
 * the first beam, NULL when there is none. CAIRN_MORE when the scan before is still being worked
 * on: step() first, nothing was taken. Statuses of cairn_scan_begin; CAIRN_NOT_FINITE for an
 * odometry that is not finite, CAIRN_BAD_ARGUMENT for one farther than 1e9 m from its origin. An
 * odometry that is more than CAIRN_SCAN_EXTENT from that of the scan before tells nothing of the
 * motion between. CAIRN_FULL: no room for one more key scan. */
CAIRN_CHECKED cairn_status cairn_mapper_add(cairn_mapper *mapper, const cairn_scan_input *input,
                                            const cairn_pose *odometry, cairn_fault *fault);

/* Goes on with the scan at hand. CAIRN_MORE: the budget is used up. CAIRN_OK: the scan has its
 * pose. CAIRN_FULL: it should have become a key scan but there was no room; it has its pose, and
 * the mapper takes no further scan. */
CAIRN_CHECKED cairn_status cairn_mapper_step(cairn_mapper *mapper, cairn_budget *budget);

/* Finishes what loops and graph have to do with all scans so far, the scan at hand first.
 * CAIRN_MORE: the budget is used up. CAIRN_OK: all is done; more scans may follow. CAIRN_FULL as
 * step(). */
CAIRN_CHECKED cairn_status cairn_mapper_settle(cairn_mapper *mapper, cairn_budget *budget);

/* The result of the last scan that was done. */
cairn_mapper_result cairn_mapper_read(const cairn_mapper *mapper);

/* The frame of the odometry seen in the map: map_base of the last scan that is done is this,
 * composed with its odometry. It jumps when loops close, the product of both does so too,
 * odometry alone never does. After scans without odometry it is as it was before them; the
 * identity before any. */
cairn_pose cairn_mapper_map_odom(const cairn_mapper *mapper);

/* The last scan as points and segments in its own frame; valid until the next add. */
cairn_scan_view cairn_mapper_view(const cairn_mapper *mapper);

/* Pose of key scan 0 <= key < keys now. */
cairn_pose cairn_mapper_key_pose(const cairn_mapper *mapper, int32_t key);

/* Segments and points of the key scans, each in its own frame; and which of its scans key scan 0
 * <= key < keys is: the one of its own number as long as none was released. */
const cairn_scan_set *cairn_mapper_keys(const cairn_mapper *mapper);
int32_t cairn_mapper_key_slot(const cairn_mapper *mapper, int32_t key);

/* A key scan that was released. Those after it count one less from then on; results, loops and
 * links that are read later are in the numbers of that time. */
typedef struct cairn_mapper_release {
    int32_t key;         /* as it counted before */
    int32_t onto;        /* what hung on it hangs on this one, as it counts afterwards, ... */
    cairn_pose onto_key; /* ... from which it was seen there */
} cairn_mapper_release;

/* Release 0 <= index < state.releases, of which the last 64 can be read; older ones are those 64
 * later. One step() releases few: who reads them after each misses none. */
cairn_mapper_release cairn_mapper_release_at(const cairn_mapper *mapper, int32_t index);

/* Takes what hangs on a key scan, and is seen from there, through a release. */
void cairn_mapper_rehang(cairn_mapper_release release, int32_t *key, cairn_pose *key_scan);

/* Event 0 <= index < loop_events, of which the last 64 can be read; older ones are those 64
 * later. */
cairn_mapper_loop cairn_mapper_loop_at(const cairn_mapper *mapper, int32_t index);

/* A link of the graph of key scans: to the one before, to others of its local map, or a closure;
 * or what such links say together by way of key scans that were released. */
typedef struct cairn_mapper_link {
    int32_t first, second;
    cairn_pose first_second;
    cairn_sym3 information; /* of first_second, in the frame of second */
    int32_t is_loop, dropped;
} cairn_mapper_link;

/* Links there are; the last key scans have theirs after settle(). Without loops there are none. */
int32_t cairn_mapper_link_count(const cairn_mapper *mapper);

/* 0 <= index < link_count. */
cairn_mapper_link cairn_mapper_link_at(const cairn_mapper *mapper, int32_t index);

cairn_mapper_state cairn_mapper_measure(const cairn_mapper *mapper);

#ifdef __cplusplus
}
#endif

#endif
