/* place_map: a map of scans from several places, with no odometry and no guess.
 *
 * At each place one or several scans were taken whose poses within the place are known (a turning
 * robot, a head with several scanners); how the places lie to each other is not. All pairs of
 * places are matched with unknown position and heading, each hypothesis is weighed by what the two
 * saw of each other (surface on surface against surface in free space), the poses that agree best
 * are found by consensus, every place is matched again with the map of all others, and the poses
 * are refined (after Adluru 2008, chapter 6, with all pairs in place of the last three scans; mode
 * `as_written` is that chapter as printed).
 *
 *     clear() -> add_scan() ... -> begin() -> step(budget) until CAIRN_OK -> read(), place(),
 *     scan() */
#ifndef CAIRN_PLACE_MAP_H
#define CAIRN_PLACE_MAP_H

#include "cairn/aligner.h"
#include "cairn/icp.h"
#include "cairn/pose_consensus.h"
#include "cairn/scan_match.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_place_map cairn_place_map;

typedef int32_t cairn_place_map_mode;
enum {
    CAIRN_PLACE_MAP_CONSENSUS = CAIRN_MODE_DEFAULT,
    /* Adluru 2008, chapter 6: see cairn_place_map_as_written() */
    CAIRN_PLACE_MAP_AS_WRITTEN = CAIRN_MODE_AS_WRITTEN,
    /* each place to the union of the last `recent` ones, in order, by params.match */
    CAIRN_PLACE_MAP_SEQUENTIAL = 2
};

/* Whether and how the scans of a place, whose poses within it may be a little off, are aligned
 * each by itself at the end. */
typedef int32_t cairn_place_map_decoupling;
enum {
    CAIRN_PLACE_MAP_COUPLED = 0,
    /* one after the other with all others, as in the thesis */
    CAIRN_PLACE_MAP_BY_ICP = 1,
    /* all at once, by cairn/aligner.h, which also mends single scans that lie wrongly */
    CAIRN_PLACE_MAP_JOINTLY = 2
};

typedef struct cairn_place_map_params {
    cairn_place_map_mode mode;
    /* 2 ... 256 */
    int32_t max_places;
    /* >= max_places: of all places */
    int32_t max_scans;
    /* evenly spaced points of one place, >= 1 */
    int32_t max_place_points;
    /* of one place, >= 1 */
    int32_t max_place_beams;
    /* >= 1: places that the sequential mode matches with */
    int32_t recent;
    /* >= 0: times at most that every place is matched again with the map of the others */
    int32_t rounds;
    /* >= 0: of the refinement */
    int32_t sweeps;
    cairn_place_map_decoupling decoupled;
    /* m, > 0: how far from a place what it saw is kept */
    cairn_real sight_reach;
    /* m, > 0: side of the cells that keep it */
    cairn_real sight_cell;
    /* m, > 0: of a surface, within which another surface may lie */
    cairn_real sight_margin;
    /* nats, > 0, for a point on a surface of its direction of the other place, ... */
    cairn_real for_point;
    /* ... > 0, for one of a small round body on such a body of the other place, ... */
    cairn_real for_floating;
    /* ... > 0, for one on the other side of a wall, less when they are many, ... */
    cairn_real for_back;
    /* ... > 0, for one on a surface that is too rough to have a direction, ... */
    cairn_real for_rough;
    /* ... and, >= 0, for every square metre that both saw free; ... */
    cairn_real for_free;
    /* ... > 0, against the pose for a point in space that the other saw free; ... */
    cairn_real against_point;
    /* in [0, 1]: times this for points of small bodies, which may have moved meanwhile */
    cairn_real floating;
    /* nats, >= 0, that are taken off hypotheses, as the best of many reach them by chance */
    cairn_real chance;
    /* its max_target ... max_query are not read */
    cairn_scan_match_params match;
    /* its max_nodes is not read */
    cairn_pose_consensus_params consensus;
    /* its max_scans and max_points are not read, nor any unless JOINTLY */
    cairn_aligner_params aligner;
} cairn_place_map_params;

/* Consensus; 16 places, 64 scans, 1024 points and 2048 beams a place; 3 recent; 4 rounds, 10
 * sweeps, coupled; sight 8 m, 0.05 m, margin 0.10 m; 0.05, 0.25, 0.3, 0.65 and 1.6 nats for and
 * 0.6 against, floating 0.05; chance 0; of the match 40 hypotheses of 768 candidates, once 0; of
 * the consensus 4096 hypotheses, ambiguous from 1e-5, believed from 12 nats. */
cairn_place_map_params cairn_place_map_default(void);

/* The map of Adluru 2008, chapter 6, as printed: mode `as_written`, matches by
 * cairn_scan_match_as_written(), 2,048 readings a place, scans of a place decoupled by ICP;
 * otherwise as the default. Each place is matched with the union of the `recent` (3) places before
 * it, its heading known: the frames of all places have one heading up to 2 degrees (the window in
 * which rotations are tried), where they lie is unknown. Then each of its scans is aligned by
 * itself with the same target (6.5.1), and the next place is matched. match.mode is AS_WRITTEN or
 * one of its parts; without ICP in it, decoupled is COUPLED. Not read: max_place_beams, rounds,
 * sweeps, and all that weighs evidence (sight_reach ... chance, consensus, aligner).
 *
 * Choices, where the text is silent:
 * - the scans of a place, one after the other, are one sequence and one set of points for the
 *   histograms (the "complete scan");
 * - a place starts from the position of the place before it, and from the heading of the first;
 * - scans are decoupled right after the ICP of their place, with its target, its overlap distance
 *   and its rules;
 * - a place none of whose correspondences are left lies in a part of its own, and is no target of
 *   another.
 * The thesis does not tell doubtful places: `ambiguous` and `support` are 0. */
cairn_place_map_params cairn_place_map_as_written(void);

/* 0 for params that create() would refuse. */
size_t cairn_place_map_memory(const cairn_place_map_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_place_map_create(cairn_place_map **map, cairn_pool *pool,
                                                  const cairn_place_map_params *params);

/* Forgets all scans. Constant time. */
void cairn_place_map_clear(cairn_place_map *map);

/* Adds a scan of a place; what is needed of it is copied. The scans of a place come together:
 * `place` is that of the last scan or the next one. place_scan: the frame of the scan in that of
 * the place. CAIRN_BAD_ARGUMENT: NULL, another place. CAIRN_NOT_FINITE. CAIRN_FULL: max_places,
 * max_scans, max_place_points, max_place_beams or the aligner's max_segments is used up. *fault,
 * when not NULL, tells what. Cost: linear in the scan. */
CAIRN_CHECKED cairn_status cairn_place_map_add_scan(cairn_place_map *map, int32_t place,
                                                    const cairn_scan_view *view,
                                                    cairn_pose place_scan, cairn_fault *fault);

/* Starts to map. CAIRN_EMPTY: no scans. CAIRN_BAD_ARGUMENT: NULL. Constant time. */
CAIRN_CHECKED cairn_status cairn_place_map_begin(cairn_place_map *map);

/* As written: starts to map the places that were added since the last map was complete; those
 * before stay where they are. Without a complete map, as begin(). CAIRN_UNSUPPORTED: another
 * mode; statuses of begin(). Cost: linear in the places added. */
CAIRN_CHECKED cairn_status cairn_place_map_extend(cairn_place_map *map);

/* As written: moves a scan of the last complete map, say to where another aligner has it; places
 * that extend() adds are matched with it there. map_place stays. CAIRN_UNSUPPORTED: another
 * mode; CAIRN_BAD_ARGUMENT: NULL, a scan that is not in the map, a pose too far off;
 * CAIRN_NOT_FINITE. Constant time. */
CAIRN_CHECKED cairn_status cairn_place_map_move_scan(cairn_place_map *map, int32_t scan,
                                                     cairn_pose map_scan);

/* CAIRN_OK: nothing left to do. CAIRN_MORE. CAIRN_BAD_ARGUMENT: NULL. */
CAIRN_CHECKED cairn_status cairn_place_map_step(cairn_place_map *map, cairn_budget *budget);

/* ---- The result: empty until step() returns CAIRN_OK ---- */

typedef struct cairn_place_map_result {
    /* placed: in the largest part */
    int32_t places, placed;
    /* 1: the map hangs together */
    int32_t parts;
    /* places that could as well lie elsewhere, or have nothing in common with the rest */
    int32_t ambiguous;
    /* of scan_match */
    int32_t matches;
    /* that were weighed into the consensus */
    int32_t hypotheses;
    /* scans that were aligned by themselves */
    int32_t decoupled;
    /* nats of the map, and of the best other map that was found; 0: none */
    cairn_real total, rival;
    int64_t units;
} cairn_place_map_result;

cairn_place_map_result cairn_place_map_read(const cairn_place_map *map);

typedef struct cairn_place_map_place {
    /* in the frame of its part: that of its first place */
    cairn_pose map_place;
    /* nats that the others of the part give for it; 0 in sequential mode */
    cairn_real support;
    /* 0: the largest */
    int32_t part;
    /* 1: of another island, or see cairn_place_map_alternative() */
    int32_t ambiguous;
    int32_t alternatives;
    /* 0: the largest of its part; what hangs at that by what may be chance is another one */
    int32_t island;
} cairn_place_map_place;

/* All zero for a place that is not there. */
cairn_place_map_place cairn_place_map_place_of(const cairn_place_map *map, int32_t place);

/* Where a place could lie as well, the heaviest first; see cairn_pose_consensus_alternative(). */
cairn_consensus_alternative cairn_place_map_alternative(const cairn_place_map *map, int32_t place,
                                                        int32_t index);

/* Pose of a scan in its part's frame, scans counted in the order in which they came; map_place
 * with place_scan unless it was aligned by itself. The identity for a scan that is not there. */
cairn_pose cairn_place_map_scan_pose(const cairn_place_map *map, int32_t scan);

/* 1 when the joint alignment tells the pose of this scan by itself; 0 when it rests on the pose
 * of its place, is not there, or scans are not aligned jointly. */
int32_t cairn_place_map_scan_is_aligned(const cairn_place_map *map, int32_t scan);

#ifdef __cplusplus
}
#endif

#endif
