/* What the parts of mapper share: mapper.c (scan by scan), mapper_create.c (params and memory),
 * mapper_front.c (its match), mapper_search.c (the search of one in doubt), mapper_keys.c (key
 * scans, local map), mapper_window.c (force field over the last key scans), mapper_loop.c (loops
 * that close), mapper_tie.c (on what key scans hang), mapper_graph.c (correction of all key
 * scans), mapper_cover.c (how well key scans are covered by others), mapper_release.c (key scans
 * that go). */
#ifndef CAIRN_MAPPING_MAPPER_WORK_H
#define CAIRN_MAPPING_MAPPER_WORK_H

#include "cairn/mapper.h"
#include "cairn/pose_graph.h"
#include "cairn/scan_match.h"

enum {
    /* of what a key scan saw free */
    MAPPER_BEARINGS = 256,
    /* places at which a key scan is looked for */
    MAPPER_MAX_CANDIDATES = 3,
    /* key scans on which one hangs besides the one before */
    MAPPER_MAX_ANCHORS = 2,
    /* closures that wait for others to agree */
    MAPPER_PENDING = 32,
    /* that can be read */
    MAPPER_LOOP_EVENTS = 64,
    /* likewise */
    MAPPER_CULLING_EVENTS = 64,
    /* key scans by which one may be covered */
    MAPPER_REDUNDANCY_NEIGHBOURS = 8,
    /* of what a key scan saw, free and surfaces */
    MAPPER_SAMPLES = 128,
    /* key scans of the local map in which a scan in doubt is searched for */
    MAPPER_SEARCH_KEYFRAMES = 5,
    /* places that a search refines */
    MAPPER_SEARCH_CANDIDATES = 32
};

/* Standard deviations of what is in doubt, m and rad. */
static const cairn_real MAPPER_LOW_CONFIDENCE_M = CAIRN_REAL(0.3),
                        MAPPER_LOW_CONFIDENCE_RAD = CAIRN_REAL(0.15);
static const cairn_real MAPPER_MIN_INFORMATION_RATIO =
    /* share of information along a direction that is hardly told */
    CAIRN_REAL(0.05);
/* m, of the widest search of a scan in doubt, beyond its motion */
static const cairn_real MAPPER_WIDE_SEARCH_M = 1;

/* m: motions that lead so far apart are tried both */
static const cairn_real MAPPER_DISTINCT_M = CAIRN_REAL(0.05);
static const cairn_real MAPPER_DISTINCT_RAD = CAIRN_REAL(0.02);
/* m and rad out of the way */
static const cairn_real MAPPER_PRIOR_SCALE = CAIRN_REAL(0.1);

typedef int32_t mapper_phase;
enum {
    MAPPER_IDLE = 0,
    MAPPER_FIT_LINES,           /* lines of the new scan */
    MAPPER_SELECT_LOCAL,        /* key scans near the predicted pose */
    MAPPER_BUILD_TARGET,        /* local map out of them */
    MAPPER_MATCH,               /* from the prediction */
    MAPPER_MATCH_ALTERNATIVE,   /* from another motion */
    MAPPER_BUILD_SEARCH_TARGET, /* local map of the search */
    MAPPER_SEARCH,              /* of a match in doubt */
    MAPPER_MATCH_FOUND,         /* from what it found */
    MAPPER_MATCH_CONSTRAINED, /* from the prediction, which decides where few points tell otherwise */
    MAPPER_STORE,             /* result, and a key scan if it is one */
    MAPPER_BACKGROUND         /* force field, then loops and graph, for their share of the scan */
};

typedef int32_t mapper_window_phase;
enum {
    WINDOW_IDLE = 0,
    WINDOW_FILL, /* key scans into the force field */
    WINDOW_RUN
};

typedef int32_t mapper_loop_phase;
enum {
    LOOP_IDLE = 0,
    LOOP_RESET_PATHS,   /* of the distances */
    LOOP_PATH_VARIANCE, /* how far a path from the query can have gone astray, for every key scan */
    LOOP_SELECT_CANDIDATES, /* candidates */
    LOOP_BEGIN_CANDIDATE,   /* the one at hand, from the beginning */
    LOOP_BUILD_TARGET,      /* the map around it */
    LOOP_MATCH,
    LOOP_OPTIMIZE,
    LOOP_COVER,  /* how well key scans are covered; one of them goes then */
    LOOP_COMPACT /* the room that it leaves */
};

/* A link of the graph as the search for loops sees it; its number is that in the graph. */
typedef struct mapper_link {
    int32_t first, second;
    int32_t next[2]; /* the next link of first and of second; -1: none */
    cairn_real variance, heading_variance;
    int32_t is_loop, dropped;
} mapper_link;

/* A place at which the query may be. */
typedef struct mapper_candidate {
    int32_t key;
    cairn_real distance; /* m, between what both see */
} mapper_candidate;

/* A closure that waits for others to agree. */
typedef struct mapper_pending {
    int32_t first, second;
    int32_t accepted;
    cairn_pose first_second;
    cairn_sym3 covariance; /* in the frame of second */
} mapper_pending;

/* How a key scan hangs on others: on the one before, and on those that tell what that one does
 * not. Covariances are in its own frame. See mapper_tie.c. */
typedef struct mapper_tie {
    cairn_sym3 covariance; /* seen from the one before */
    int32_t anchors[MAPPER_MAX_ANCHORS];
    cairn_sym3 anchor_covariance[MAPPER_MAX_ANCHORS];
    int32_t anchor_count;
    int32_t doubtful;
    int32_t piece; /* of the map, of key scans that are rigid among each other: its first one */
    cairn_real position_sigma; /* m, standard deviation of its place by all of them */
} mapper_tie;

/* How well key scans are covered by others, and which one is being looked at. See
 * mapper_cover.c. */
typedef struct mapper_cover {
    /* [max_keys] of what a key scan shows, what would go with it; -1: not known */
    cairn_real *score;
    /* [max_keys] m^2, to the farthest key scan that may cover it */
    cairn_real *neighbour_radius2;
    int32_t key;
    /* key scans before it, the nearest first */
    int32_t neighbours[MAPPER_REDUNDANCY_NEIGHBOURS];
    cairn_real neighbour_distance2[MAPPER_REDUNDANCY_NEIGHBOURS];
    int32_t neighbour_count, next_neighbour;
    /* by so many of them */
    uint8_t observer_counts[MAPPER_SAMPLES];
} mapper_cover;

typedef struct mapper_loop {
    cairn_pose_graph *graph;
    mapper_link *links;           /* [max_keys + max_loops] */
    int32_t *first_link;          /* [max_keys] of a key scan; -1: none */
    mapper_tie *ties;             /* [max_keys] by the match with which a key scan came */
    cairn_real *variance;         /* [max_keys] m^2, of the path to the query */
    cairn_real *heading_variance; /* [max_keys] rad^2 */
    int32_t *heap;                /* [max_keys] key scans by variance */
    int32_t *heap_position;       /* [max_keys] their places; -1: not in it, -2: done */
    int32_t heap_count;
    int32_t link_count;
    int32_t entered; /* key scans in the graph */

    mapper_loop_phase phase;
    int32_t quota; /* units left of the scan's share */
    int32_t cursor;
    int32_t query;                      /* key scan that is looked for */
    cairn_oriented_point *query_points; /* [scan.max_points] */
    cairn_beam *query_beams;            /* [MAPPER_BEARINGS] */
    cairn_scan_match_part query_part;
    mapper_candidate candidates[MAPPER_MAX_CANDIDATES];
    int32_t candidate_count, candidate;
    mapper_candidate best_of_run; /* the best of the run of key scans at hand */
    int32_t in_run;
    int32_t target_from, target_end;

    mapper_pending pending[MAPPER_PENDING];
    int32_t pending_count;         /* ever */
    int32_t fresh;                 /* closures since the last solution */
    int32_t keyframes_since_solve; /* key scans since the last solution */
    cairn_real largest_chi2;       /* the largest chi2 of these closures */
    int32_t settling;              /* 1: the last scan is in, all is to be settled */
    int32_t factor_full;           /* 1: the factor has no room */
    int32_t culling;               /* 1: key scans go until there is some room again */
    mapper_cover redundancy;
    cairn_mapper_loop events[MAPPER_LOOP_EVENTS];
} mapper_loop;

struct cairn_mapper {
    cairn_mapper_params params;
    cairn_scan *scan;
    cairn_icp *icp;
    cairn_force_field *field;
    cairn_scan_set *keys;
    int32_t key_count;
    int32_t *slot;        /* [max_keys] of a key scan in the set */
    cairn_pose *key_pose; /* [max_keys] map_key */
    /* One key scan on its way into the local map or the force field. */
    /* [scan.max_points] */
    cairn_oriented_point *points;
    /* [scan.max_segments] */
    cairn_segment *segments;
    /* [scan.max_segments + 1] */
    int32_t *first_point;
    /* [MAPPER_BEARINGS] */
    cairn_beam *beams;
    /* [max_keys * MAPPER_BEARINGS] by slot, cm by bearing, 0: nothing known; NULL when nobody
     * asks */
    uint16_t *sight;

    mapper_phase phase;
    int32_t cursor;       /* within the phase */
    int32_t window_quota; /* units left of the force field's share of the scan */
    mapper_window_phase window_phase;
    int32_t window_first, window_end; /* key scans of the force field */
    int32_t window_cursor;            /* of these, the next one to fill in */
    int32_t full;
    int32_t scans_since_keyframe; /* scans since the last key scan */

    /* of the scan at hand */
    int32_t has_odometry;
    cairn_pose by_odometry;
    /* where the scan before is */
    cairn_pose last;
    /* that is predicted */
    cairn_pose motion;
    /* that is tried, too */
    cairn_pose alternative_motion;
    cairn_pose predicted;
    /* 1: the odometry is what is predicted */
    int32_t trusts_odometry;
    /* in odometry, 0 ... 1 */
    cairn_real odometry_health;
    /* >= 1: so many times what odometry may be wrong by, after it was */
    cairn_real odometry_noise_scale;
    /* m: what is added to odometry, after it was wrong */
    cairn_vec2 odometry_bias;
    /* m^2, rad^2: of the motion since the last key scan */
    cairn_real motion_variance, motion_heading_variance;
    /* m, a scan, in its own frame */
    cairn_vec2 velocity;
    /* of matches; 0: none yet */
    cairn_real mean_quality;

    int32_t finished_has_odometry; /* 1: the last scan that is done came with odometry, ... */
    cairn_pose finished_odometry;  /* ... this one */
    cairn_pose map_odom;           /* of the last scan before that had one, as it was then */

    int32_t had_odometry; /* of the last scan taken in */
    cairn_pose last_odometry;
    cairn_pose last_motion;
    cairn_pose smoothed_motion;    /* the same, smoothed */
    int64_t last_stamp, last_span; /* ns: of the scan before, and since the one before that */

    /* key scans of the local map, the last ones first, then by distance */
    int32_t local[CAIRN_MAPPER_LOCAL_MOST];
    cairn_real local_distance[CAIRN_MAPPER_LOCAL_MOST];
    int32_t local_count;
    /* 1: key scans were added or moved since the local map was made */
    int32_t target_stale;
    cairn_pose target_pose;
    /* the better one so far ... */
    cairn_icp_result match;
    /* ... and which key scan of the local map told what of it */
    cairn_icp_parts parts;
    int32_t has_match;
    /* 1: few points spoke against the odometry, which stands */
    int32_t is_constrained;
    /* 1: also after a search */
    int32_t low_confidence;
    /* of the scan in doubt, and for loops; NULL when nobody searches */
    cairn_scan_match *search;
    /* covariance in the map that the doubt adds */
    cairn_real extra_covariance[9];
    /* of this scan */
    int32_t searches;
    /* Where the last search would have placed its scan, too far from where odometry leads. */
    cairn_pose hypothesis;
    cairn_real hypothesis_log_odds; /* log odds */
    int64_t hypothesis_scan;        /* number of that scan, from 1; 0: none */
    int32_t hypothesis_is_new;      /* 1: the scan before left none */
    int32_t search_target_count;    /* key scans of the local map that it has; 0: other things */
    int32_t search_units_used,
        match_units_used; /* units, by the search and by the matches of this scan */

    mapper_loop loop; /* its graph is NULL without loops */
    cairn_mapper_result result;
    cairn_mapper_state state;
    cairn_mapper_release releases[MAPPER_CULLING_EVENTS];
};

/* ---- mapper_create.c ---- */

/* Room for the points of so many key scans together. */
int32_t cairn_mapper_local_points(const cairn_mapper_params *params, int32_t keys);

/* So many of the last key scans are never released. */
int32_t cairn_mapper_last_kept(const cairn_mapper_params *params);

/* ---- mapper_keys.c ---- */

static inline const cairn_scan_set_scan *cairn_mapper_key_scan(const cairn_mapper *mapper,
                                                               int32_t key)
{
    return &mapper->keys->scans[mapper->slot[key]];
}

static inline int32_t cairn_mapper_point_count(const cairn_mapper *mapper, int32_t key)
{
    const cairn_scan_set_scan *scan = cairn_mapper_key_scan(mapper, key);

    return scan->end_point - scan->first_point;
}

/* A key scan as it was when it came, but without its beams; valid until the next call. */
cairn_scan_view cairn_mapper_key_view(cairn_mapper *mapper, int32_t key);

/* Begins to choose the key scans of the local map; one key scan a call then. 1 when all have
 * been looked at. */
void cairn_mapper_begin_local(cairn_mapper *mapper);
int32_t cairn_mapper_select_local(cairn_mapper *mapper);

/* 1 when the local map does not serve the predicted pose. */
int32_t cairn_mapper_needs_local(const cairn_mapper *mapper);

/* Adds the chosen key scan at the cursor to the local map. */
cairn_status cairn_mapper_add_local(cairn_mapper *mapper, cairn_budget *budget);

/* Copies the points of a key scan, in its own frame; returns how many. */
int32_t cairn_mapper_key_points(const cairn_mapper *mapper, int32_t key,
                                cairn_oriented_point *points);

/* Keeps what a key scan saw free; gives it back as beams: [MAPPER_BEARINGS]. Returns how many. */
void cairn_mapper_keep_sight(cairn_mapper *mapper, int32_t key, const cairn_scan_view *view);
int32_t cairn_mapper_sight(const cairn_mapper *mapper, int32_t key, cairn_beam *beams);

/* The bearing in which something is seen, and the direction of its middle. */
int32_t cairn_mapper_bearing_of(cairn_vec2 d);
cairn_vec2 cairn_mapper_bearing_direction(int32_t bearing);

/* A key scan as a part of a match, its points and beams copied to the arrays. */
cairn_scan_match_part cairn_mapper_key_part(const cairn_mapper *mapper, int32_t key,
                                            cairn_oriented_point *points, cairn_beam *beams);

/* ---- mapper_window.c ---- */

/* Lets the force field begin with the last key scans; what it is at is dropped. */
void cairn_mapper_begin_window(cairn_mapper *mapper);

/* Goes on with it. CAIRN_MORE: the budget is used up. CAIRN_OK: nothing is left to do. */
cairn_status cairn_mapper_window_step(cairn_mapper *mapper, cairn_budget *budget);

/* Ends it with the poses that it has found so far. */
void cairn_mapper_end_window(cairn_mapper *mapper);

/* Takes over the poses that the force field has found so far. */
void cairn_mapper_read_window(cairn_mapper *mapper);

/* ---- mapper_front.c ---- */

/* m */
static inline cairn_real cairn_mapper_way(cairn_pose motion)
{
    return cairn_sqrt(motion.x * motion.x + motion.y * motion.y);
}

/* The motion during the sweep of the next scan, which is by_odometry (NULL: none) away from the
 * last one. */
cairn_pose cairn_mapper_sweep_motion(const cairn_mapper *mapper, const cairn_scan_input *input,
                                     const cairn_pose *by_odometry);

/* Predicts the scan from where the one before is, and by how its odometry has moved. */
void cairn_mapper_predict(cairn_mapper *mapper, cairn_pose last, cairn_pose by_odometry);
cairn_status cairn_mapper_begin_match(cairn_mapper *mapper);

/* A match has ended: chooses what comes next. */
cairn_status cairn_mapper_end_match(cairn_mapper *mapper);

/* The match is chosen; when few points speak against odometry it is run once more. */
cairn_status cairn_mapper_end_choice(cairn_mapper *mapper);

/* Where the scan may be after a motion that is told by odometry (or by the motion before). */
cairn_pose_prior cairn_mapper_prior_of(const cairn_mapper *mapper, cairn_pose motion,
                                       int32_t is_odometry);

/* Squared distance of a pose from the prediction or from standing still, whichever is nearer, in
 * units of m and rad; 4 at most. */
cairn_real cairn_mapper_out_of_the_way(const cairn_mapper *mapper, cairn_pose pose,
                                       cairn_real unit);

/* 1 when a pose is farther from the prediction than motions change from scan to scan. */
int32_t cairn_mapper_is_far(const cairn_mapper *mapper, cairn_pose pose);

/* What its motion tells of the scan at hand. */
cairn_pose_prior cairn_mapper_prior(const cairn_mapper *mapper);

/* The scan has its match, or none: how good are matches, can odometry be believed? */
void cairn_mapper_learn(cairn_mapper *mapper);

/* The motion that the next scan is expected to repeat. */
cairn_pose cairn_mapper_next_motion(cairn_mapper *mapper, cairn_pose motion);

/* ---- mapper_search.c ---- */

/* Fills the target of the search with the key scans near by, one by one; then it begins. */
cairn_status cairn_mapper_search_target(cairn_mapper *mapper, cairn_budget *budget);

/* Goes on with the search, which ends when it has taken its share of units. */
cairn_status cairn_mapper_search_step(cairn_mapper *mapper, cairn_budget *budget);

/* ---- mapper_loop.c ---- */

/* 1 when the second hypothesis is as good as the first. */
int32_t cairn_mapper_has_rival(const cairn_scan_match_result *result);

/* Writes down what became of a closure. */
void cairn_mapper_loop_tell(cairn_mapper *mapper, int32_t first, int32_t second,
                            cairn_pose first_second, cairn_mapper_loop_verdict verdict);

/* Gives the match to the search of a scan in doubt; that of a candidate begins anew later. */
void cairn_mapper_yield_match(cairn_mapper *mapper);

/* Goes on with what loops and graph have to do; with until_room no longer than there is no room
 * for one more key scan. CAIRN_OK: nothing for now. */
cairn_status cairn_mapper_loop_step(cairn_mapper *mapper, cairn_budget *budget, int32_t until_room);

/* ---- mapper_tie.c ---- */

/* The key scan that tells best where the scan at hand is, which is none itself. */
int32_t cairn_mapper_hang_on(const cairn_mapper *mapper);

/* On what the scan at hand, the last one kept, hangs as a key scan. */
void cairn_mapper_tie(const cairn_mapper *mapper, mapper_tie *tie);

/* ---- mapper_graph.c ---- */

/* Puts the next key scan into the graph, linked to the one before. */
cairn_status cairn_mapper_enter(cairn_mapper *mapper);

/* Adds a link that closes a loop. covariance: of first_second, in the frame of second.
 * CAIRN_FULL: no room for links. */
cairn_status cairn_mapper_add_closure(cairn_mapper *mapper, int32_t first, int32_t second,
                                      cairn_pose first_second, cairn_sym3 covariance);

/* 1 when it is time to correct the key scans. */
int32_t cairn_mapper_wants_solution(const cairn_mapper *mapper);
cairn_status cairn_mapper_solve_step(cairn_mapper *mapper, cairn_budget *budget);

/* Hangs an end (0: first, 1: second) of a link on its key scan. */
void cairn_mapper_hang_link(mapper_loop *loop, int32_t link, int32_t end);

/* e^T Omega e of a measured pose at the poses as they are. */
cairn_real cairn_mapper_strain_of(const cairn_mapper *mapper, int32_t first, int32_t second,
                                  cairn_pose first_second, cairn_sym3 covariance);

/* Row-major covariance of a pose in the map, turned into the pose's own frame, with what all
 * measurements share added. */
cairn_sym3 cairn_mapper_own_covariance(const cairn_mapper *mapper, const cairn_real covariance[9],
                                       cairn_real theta);

/* ---- mapper_cover.c ---- */

/* Begins with the first key scan; goes on with the next item of work. 1 when all key scans
 * before `end` have their loss. */
void cairn_mapper_begin_cover(cairn_mapper *mapper);
int32_t cairn_mapper_cover_item(cairn_mapper *mapper, int32_t end, cairn_budget *budget);

/* The key scan before `end` that is covered best; the first one never is. */
int32_t cairn_mapper_best_covered(const cairn_mapper *mapper, int32_t end);

/* What is known of the cover is wrong: of all key scans, and where one of them goes. */
void cairn_mapper_forget_cover(cairn_mapper *mapper);
void cairn_mapper_uncover(cairn_mapper *mapper, int32_t gone);

/* ---- mapper_release.c ---- */

/* 1 when key scans are released and there is no room for one more. */
int32_t cairn_mapper_must_release(const cairn_mapper *mapper);

/* 1 when there is little room and some may go; once some go, until there is more of it. */
int32_t cairn_mapper_may_release(cairn_mapper *mapper);

/* 1 when loops are so far behind that key scans may soon lack room for want of others that may
 * go. */
int32_t cairn_mapper_is_behind(const cairn_mapper *mapper);

/* Key scans before this one may go. */
int32_t cairn_mapper_release_end(const cairn_mapper *mapper);

/* Releases a key scan; what it takes of the set is room again after packing. */
cairn_status cairn_mapper_release_key(cairn_mapper *mapper, int32_t key, cairn_budget *budget);

#endif
