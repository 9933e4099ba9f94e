/* aligner: many scans with little overlap at once, from poor initial poses and without landmarks.
 *
 *     add_scan ... -> begin -> step until CAIRN_OK -> read, pose_of
 *
 * Pairs of scans propose how they may lie to each other; parts that agree grow together, the surest
 * first; scans that lie badly are looked for anew in all the rest; last, all poses and all walls
 * that they share are solved for together, which also tells how well each pose is known; scans that
 * little holds are slid along their walls until others meet. Evidence for a relative pose is what
 * one scan shows where the other one shows the same, oriented, surface; evidence against it, and by
 * far the sharper, is what one shows where the other looked through.
 *
 * The order of the scans tells nothing and does not matter, beyond ties. The result does not
 * depend on the budgets. */
#ifndef CAIRN_ALIGNER_H
#define CAIRN_ALIGNER_H

#include "cairn/block_solver.h"
#include "cairn/scan.h"

#ifdef __cplusplus
extern "C" {
#endif

/* In brackets the defaults. */
typedef struct cairn_aligner_params {
    /* 1 ... 2^16 (64) */
    int32_t max_scans;
    /* of all scans, 1 ... 2^24 (1024) */
    int32_t max_segments;
    /* >= 0, <= 2^24: surfaces too short for a segment, of all scans; others are left out (256) */
    int32_t max_stubs;
    /* of all scans, 1 ... 2^24 (4096) */
    int32_t max_points;
    /* 1 ... 2^24: of more relative poses of pairs than these the best are kept (1536) */
    int32_t max_hypotheses;
    /* blocks of the joint solution, as in cairn_block_solver_params (2048) */
    int32_t max_fill;
    /* 64 ... 2^24, of the raster in which a scan is looked for; fewer make it coarser (25600) */
    int32_t max_cells;
    /* m, > 0: x and y of an initial pose are off by at most about that (0.6), ... */
    cairn_real spread;
    /* rad, > 0, <= pi: ... and its heading by that (35 degrees) */
    cairn_real spread_angle;
    /* m, > 0: what is seen beyond is not used (30) */
    cairn_real reach;
    /* m, > 0: standard deviation of a range (0.01) */
    cairn_real sigma;
    /* >= 0, nats: what a point costs that another scan looked through; 0: nothing (1.5) */
    cairn_real contradiction;
    /* not 0: surfaces have a free side; 0: as lines, modulo half a turn (1) */
    int32_t oriented;
    /* >= 0: times that scans which lie badly are looked for anew (2) */
    int32_t max_repairs;
    /* >= 0: iterations of the joint solution, each time; 0: no walls, no covariances (10) */
    int32_t max_rounds;
    /* > 0, nats: parts grow together only above it, rivals taken into account (1) */
    cairn_real least_evidence;
    /* m, > 0: a pose is observable when its standard deviation (x and y together) ... (0.05) */
    cairn_real observable;
    /* rad, > 0: ... and that of its heading are below these (1 degree) */
    cairn_real observable_angle;
} cairn_aligner_params;

/* Whether and why the aligner stands. */
typedef int32_t cairn_aligner_verdict;
enum {
    CAIRN_ALIGNER_RUNNING = 0,
    /* one part, the joint solution came to rest */
    CAIRN_ALIGNER_CONVERGED = 1,
    /* it did not within max_rounds */
    CAIRN_ALIGNER_OUT_OF_STEPS = 2,
    /* parts that do not see each other, or nothing to join: see `parts` */
    CAIRN_ALIGNER_SPLIT = 3,
    /* the joint solution needs more than max_fill blocks: poses without covariances */
    CAIRN_ALIGNER_NO_FILL = 4
};

/* Directions that are observable. */
enum { CAIRN_ALIGNER_X = 1, CAIRN_ALIGNER_Y = 2, CAIRN_ALIGNER_THETA = 4 };

/* What is known of a scan. Parts lie where their initial poses say, in the mean. */
typedef struct cairn_aligner_pose {
    cairn_pose map_scan;
    /* row-major over (x, y, theta), in the map, with the anchor of its part given. For scans
     * outside part 0 that of the initial pose */
    cairn_real covariance[9];
    /* nats that all other scans give for the pose, less what speaks against it */
    cairn_real support;
    /* CAIRN_ALIGNER_X | ...; each by its own standard deviation */
    int32_t observable;
    /* 1: in part 0 with all of its pose observable */
    int32_t placed;
    /* 0: the largest */
    int32_t part;
} cairn_aligner_pose;

typedef struct cairn_aligner_result {
    cairn_aligner_verdict verdict;
    /* of scans that show anything */
    int32_t parts;
    /* scans of part 0 */
    int32_t largest;
    /* scans of part 0 that are observable */
    int32_t placed;
    /* scan that covariances are relative to; -1: none */
    int32_t anchor;
    /* relative poses that were kept */
    int32_t hypotheses;
    /* that found no room */
    int32_t dropped;
    /* that joined parts */
    int32_t merges;
    /* scans that were found elsewhere, or late */
    int32_t moved;
    /* of the joint solution */
    int32_t rounds;
    /* shared by two scans or more */
    int32_t walls;
    /* blocks of the joint solution, at most */
    int32_t fill;
    /* m, standard deviation of x and of y of the initial poses, as learnt */
    cairn_real spread;
    /* rad, of their headings */
    cairn_real spread_angle;
    /* of budget, by all steps */
    int64_t units;
    /* units of the dearest item */
    int32_t worst_step;
} cairn_aligner_result;

typedef struct cairn_aligner cairn_aligner;

/* The defaults above. */
cairn_aligner_params cairn_aligner_default(void);

/* 0 for params that create() would refuse. */
size_t cairn_aligner_memory(const cairn_aligner_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_aligner_create(cairn_aligner **aligner, cairn_pool *pool,
                                                const cairn_aligner_params *params);

/* Copies what is needed of a scan, with the initial pose map_scan; its index is the number of scans
 * before it. A scan that shows nothing stays where it is. Ends an alignment that is running.
 *
 * CAIRN_BAD_ARGUMENT: NULL, negative counts, first_point that does not rise from 0 to
 * point_count, coordinates beyond 1e6 m. CAIRN_NOT_FINITE. CAIRN_FULL: more scans, segments or
 * points than params allow. *fault, when not NULL, says what and where. Cost: beams times
 * segments of the scan. */
CAIRN_CHECKED cairn_status cairn_aligner_add_scan(cairn_aligner *aligner,
                                                  const cairn_scan_view *view, cairn_pose map_scan,
                                                  cairn_fault *fault);

/* Gives a scan another initial pose. Ends an alignment that is running. CAIRN_BAD_ARGUMENT:
 * NULL, no such scan, a pose beyond 1e6 m. CAIRN_NOT_FINITE. Linear in the scans the first time
 * after an alignment, then constant time. */
CAIRN_CHECKED cairn_status cairn_aligner_start_at(cairn_aligner *aligner, int32_t scan,
                                                  cairn_pose map_scan);

/* Forgets all scans. Constant time. */
void cairn_aligner_clear(cairn_aligner *aligner);

/* Starts an alignment from the initial poses. CAIRN_BAD_ARGUMENT: NULL. CAIRN_EMPTY: no scans.
 * Linear in the scans. */
CAIRN_CHECKED cairn_status cairn_aligner_begin(cairn_aligner *aligner);

/* Starts from the alignment that ended last: the scans that it has placed stay together, those
 * that it has not are looked for anew about map_scan[i], in the map of its result, which becomes
 * their initial pose; as something else has moved them, which turns walls parallel, within 0.4
 * of the turns of begin(). When none is found elsewhere the result stays as it is; else all are
 * solved for together again. map_scan: [scans], not read of scans that are placed. CAIRN_EMPTY:
 * no alignment has ended since scans were added or one was begun. CAIRN_BAD_ARGUMENT: NULL, a
 * pose beyond 1e6 m. CAIRN_NOT_FINITE. Linear in the scans; the steps pay for the scans that are
 * looked for alone unless one is found. */
CAIRN_CHECKED cairn_status cairn_aligner_begin_again(cairn_aligner *aligner,
                                                     const cairn_pose *map_scan);

/* Goes on. CAIRN_MORE: the budget is used up. CAIRN_OK: nothing left to do. An item is a pair of
 * segments, a pair of scans, or a line of the raster. A scan is held against at most 48 others,
 * the nearest by the initial poses. Cost of the whole: near linear in scans of the same density
 * but for looking at the poses of each pair of them once. */
CAIRN_CHECKED cairn_status cairn_aligner_step(cairn_aligner *aligner, cairn_budget *budget);

/* As step(), but also returns CAIRN_OK at the next commit point, so that the alignment can be
 * watched: parts have been joined or relaxed, a scan was found elsewhere or stays, an iteration
 * of the joint solution is done. */
CAIRN_CHECKED cairn_status cairn_aligner_iterate(cairn_aligner *aligner, cairn_budget *budget);

/* Whether step() has anything left to do. */
int32_t cairn_aligner_running(const cairn_aligner *aligner);

/* A scan as it stands at the last commit point; identity and -1 for a scan that is not there.
 * Between commit points nothing that is useful. *part, when not NULL: a number that the scans of
 * a part share, 0 ... scan_count - 1, which another part may have had before. Linear in the
 * part. */
cairn_pose cairn_aligner_pose_now(const cairn_aligner *aligner, int32_t scan, int32_t *part);

/* ---- The result: the initial poses until step() returns CAIRN_OK ---- */

int32_t cairn_aligner_scan_count(const cairn_aligner *aligner);

/* 1 when the last joint solution has two scans on a wall that they share, when the first, seen
 * from the second as second_first, lies on it with the other to 0.03 m, and when it runs across
 * `along`, by 30 degrees or more; so neither can be shifted that way without the other. along:
 * unit, in the frame of the first scan. 0 for scans that are not there, and while an alignment
 * is running. Cost: *units, when not NULL: segments of the one times those of the other at most. */
int32_t cairn_aligner_share_wall(const cairn_aligner *aligner, int32_t first, int32_t second,
                                 cairn_pose second_first, cairn_vec2 along, int32_t *units);

/* 1 when two scans are near enough by their initial poses to be held against each other. Cost: a
 * quarter of a unit. */
int32_t cairn_aligner_are_partners(const cairn_aligner *aligner, int32_t first, int32_t second);

/* What speaks against a relative pose of two scans, nats, 0 or less: surfaces of the one where
 * the other has looked through, or has seen another surface. 0 for scans that are not there or
 * cannot meet so. Cost: *units, when not NULL: one for each of their points. */
cairn_real cairn_aligner_objection(const cairn_aligner *aligner, int32_t first, int32_t second,
                                   cairn_pose second_first, int32_t *units);

cairn_aligner_result cairn_aligner_read(const cairn_aligner *aligner);

/* All zero for a scan that is not there. */
cairn_aligner_pose cairn_aligner_pose_of(const cairn_aligner *aligner, int32_t scan);

#ifdef __cplusplus
}
#endif

#endif
