/* place_map: global localization of scans from several places against each other, and one map of
 * all, with no odometry and no initial guess.
 *
 * At each place one or several scans were taken whose poses within the place are known (a turning
 * robot, a head with several scanners). The relative poses of the places are unknown. All pairs of
 * places are matched with unknown position and heading. Each hypothesis gets a log-likelihood ratio
 * from the visibility profiles of the two places (surface on surface against surface in free
 * space). The largest consistent set of poses is found by consensus. Every place is then matched
 * again with the map of all others, and the poses are refined by ICP (after Adluru 2008, chapter 6,
 * with all pairs in place of the last three scans; mode as written is that chapter as printed).
 *
 *     clear() -> add_scan() ... -> begin() -> step(budget) until CAIRN_OK
 *         -> read(), place_of(), scan_pose() */
#ifndef CAIRN_PLACE_MAP_H
#define CAIRN_PLACE_MAP_H

#include "cairn/aligner.h"
#include "cairn/icp.h"
#include "cairn/object.h"
#include "cairn/pose_consensus.h"
#include "cairn/scan_match.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Map of places, each a set of scans with known relative poses. */
typedef struct cairn_place_map cairn_place_map;

/* Method by which places are put together. */
typedef int32_t cairn_place_map_mode;
enum {
    /* all places are matched with each other, and pose_consensus chooses among the hypotheses */
    CAIRN_PLACE_MAP_CONSENSUS = CAIRN_MODE_DEFAULT,
    /* Adluru 2008, chapter 6: see cairn_place_map_as_written() */
    CAIRN_PLACE_MAP_AS_WRITTEN = CAIRN_MODE_AS_WRITTEN
};

/* Whether and how the scans of a place are aligned individually at the end; their poses within the
 * place may have small errors. */
typedef int32_t cairn_place_map_decoupling;
enum {
    /* the scans of a place keep their relative poses */
    CAIRN_PLACE_MAP_COUPLED = 0,
    /* by ICP: as written against the target of their place (Adluru 2008, section 6.5.1), else
     * against all other scans */
    CAIRN_PLACE_MAP_BY_ICP = 1,
    /* jointly, by cairn/aligner.h, which also relocalizes single wrong scans */
    CAIRN_PLACE_MAP_JOINTLY = 2
};

/* Parameters; defaults in brackets. */
typedef struct cairn_place_map_params {
    /* any (CAIRN_PLACE_MAP_CONSENSUS): method */
    cairn_place_map_mode mode;
    /* 2 ... 256 (16): number of places */
    int32_t max_places;
    /* >= max_places, <= 2^16 (64): scans of all places together */
    int32_t max_scans;
    /* >= 1, <= 2^20 / max_places (1024): evenly spaced points of one place */
    int32_t max_place_points;
    /* >= 1, <= 2^20 / max_places (2048): beams of one place */
    int32_t max_place_beams;
    /* >= 1 (3): as written: number of places before that a place is matched with */
    int32_t recent_places;
    /* >= 0 (4): rounds in which every place is matched again with the map of the others */
    int32_t rematch_rounds;
    /* >= 0 (10): sweeps of the ICP refinement over all places */
    int32_t refinement_sweeps;
    /* any (CAIRN_PLACE_MAP_COUPLED): individual alignment of the scans at the end */
    cairn_place_map_decoupling decoupled;
    /* m, > 0, <= 1e6 (8): half the side of a place's visibility grid */
    cairn_real visibility_reach;
    /* m, > 0, <= 1e6 (0.05): side of the cells of the visibility grid */
    cairn_real visibility_cell;
    /* m, > 0, <= 1e6 (0.10): distance to a surface within which another surface counts as the same
     * */
    cairn_real visibility_margin;
    /* nats, > 0, <= 1e6 (0.05): log-likelihood ratio of a point of one place, in the visibility
     * grid of the other: on a surface of its direction */
    cairn_real surface_nats;
    /* nats, > 0, <= 1e6 (0.25): likewise: a dynamic-object candidate (small isolated body) on such
     * a body */
    cairn_real dynamic_nats;
    /* nats, > 0, <= 1e6 (0.3): likewise: on the opposite face of a wall, saturating with their
     * number */
    cairn_real opposite_face_nats;
    /* nats, > 0, <= 1e6 (0.65): likewise: on a surface too rough to have a direction */
    cairn_real rough_surface_nats;
    /* nats per m^2, >= 0, <= 1e6 (1.6): log-likelihood ratio of the area that both places measured
     * free */
    cairn_real free_area_nats;
    /* nats, > 0, <= 1e6 (0.6): penalty of a free-space violation, a point in space that the other
     * place measured free */
    cairn_real free_space_penalty;
    /* 0 ... 1 (0.05): factor on the penalty of points of dynamic-object candidates, which may have
     * moved */
    cairn_real dynamic_factor;
    /* nats, >= 0, <= 1e6 (0): subtracted from every hypothesis, as the best of many random ones
     * reaches this ratio by chance */
    cairn_real chance_nats;
    /* scan matching; max_target ... max_query are not read */
    cairn_scan_match_params match;
    /* consensus; max_nodes is not read */
    cairn_pose_consensus_params consensus;
    /* joint alignment; max_scans and max_points are not read, nor any field unless JOINTLY */
    cairn_aligner_params aligner;
} cairn_place_map_params;

/* Returns the default parameters; match with 40 hypotheses of 768 candidates and vote_once 0;
 * consensus with 4096 hypotheses, ambiguous from 1e-5, significant from 12 nats. */
cairn_place_map_params cairn_place_map_default(void);

/* Returns the params of Adluru 2008, chapter 6, as printed: mode AS_WRITTEN, matches by
 * cairn_scan_match_as_written(), 2,048 readings a place, scans of a place decoupled by ICP;
 * otherwise as the default. Each place is matched with the union of the recent_places (3) before
 * it, its heading known: the frames of all places have one heading up to 2 degrees (the window in
 * which rotations are tried); their positions are unknown. Each scan of the place is then aligned
 * individually with the same target (6.5.1), before the next place is matched. match.mode is
 * AS_WRITTEN or one of its parts; without ICP in it, decoupled is COUPLED. Not read:
 * max_place_beams, rematch_rounds, refinement_sweeps, and all weights of the likelihood
 * (visibility_reach ... chance_nats, consensus, aligner).
 *
 * Choices, where the text is silent:
 * - the scans of a place, one after the other, are one sequence and one set of points for the
 *   histograms (the "complete scan");
 * - a place starts from the position of the place before it, and from the heading of the first;
 * - scans are decoupled right after the ICP of their place, with its target, its overlap distance
 *   and its rules;
 * - a place without any correspondence left is a component of its own, and no target of another.
 * The thesis reports no ambiguity: `ambiguous` and `support` are 0. */
cairn_place_map_params cairn_place_map_as_written(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_place_map_check(const cairn_place_map_params *params,
                                                 cairn_object_fault *fault);

/* Returns the bytes that create() takes; 0 for params that create() would refuse. */
size_t cairn_place_map_memory(const cairn_place_map_params *params);

/* Creates the object in memory of the pool. CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_place_map_create(cairn_place_map **map, cairn_pool *pool,
                                                  const cairn_place_map_params *params);

/* ---- Which scans of a log are a place ---- */

/* Grouping of the scans of a log into places; all zero at the start, but for the first two. */
typedef struct cairn_place_map_grouping {
    /* >= 0: scans of a place, at evenly spaced headings, whatever their poses; 0: consecutive scans
     * within 0.5 m of the first one of a place, by their poses, belong to it */
    int32_t headings;
    /* 1: the frame of a place has the heading of the log's frame, so that its first scan keeps its
     * own, as mode as written needs it; 0: the frame is the pose of its first scan. Not read with
     * headings. */
    int32_t keep_heading;
    /* scans added, and places so far */
    int32_t scans, places;
    /* first scan of the last place */
    int32_t first;
    /* its pose in the log, m and rad */
    cairn_pose start;
} cairn_place_map_grouping;

/* Adds the next scan of a log to the last place, or to a new one, and returns its place, as
 * cairn_place_map_add_scan() takes it. A pose that is not finite begins a place; with its
 * place_scan add_scan() refuses the scan. Constant time. (The places of Adluru 2008, chapter 6, are
 * those of a robot that stops and turns; which scans belong together is given there.)
 *
 * grouping: of the scans before it
 * pose: of the scan in the log, m and rad; not read with headings
 * place_scan: set to the pose of the scan in the frame of its place */
int32_t cairn_place_map_group(cairn_place_map_grouping *grouping, cairn_pose pose,
                              cairn_pose *place_scan);

/* ---- The map ---- */

/* Removes all scans. Constant time. */
void cairn_place_map_clear(cairn_place_map *map);

/* Adds a scan of a place; the needed data are copied. The scans of a place come together: `place`
 * is that of the last scan or the next one. place_scan: pose of the scan in the frame of the place.
 * CAIRN_BAD_ARGUMENT: NULL, another place. CAIRN_NOT_FINITE. CAIRN_FULL: max_places, max_scans,
 * max_place_points, max_place_beams or the aligner's max_segments is used up. *fault, when not
 * NULL, names the field. Cost: linear in the scan.
 *
 * view: scan with its segments, points and beams
 * place: index of the place */
CAIRN_CHECKED cairn_status cairn_place_map_add_scan(cairn_place_map *map, int32_t place,
                                                    const cairn_scan_view *view,
                                                    cairn_pose place_scan, cairn_fault *fault);

/* Starts a map of all places. CAIRN_EMPTY: no scans. CAIRN_BAD_ARGUMENT: NULL. Linear
 * in places and points. */
CAIRN_CHECKED cairn_status cairn_place_map_begin(cairn_place_map *map);

/* Mode as written: starts to map the places that were added since the last map was complete; the
 * places before keep their poses. Without a complete map, as begin(). CAIRN_UNSUPPORTED: another
 * mode; statuses of begin(). Cost: linear in the places added. */
CAIRN_CHECKED cairn_status cairn_place_map_extend(cairn_place_map *map);

/* Mode as written: sets the pose of a scan of the last complete map, such as the result of another
 * aligner; places that extend() adds are matched with the scan in this pose. map_place stays.
 * CAIRN_UNSUPPORTED: another mode; CAIRN_BAD_ARGUMENT: NULL, a scan that is not in the map, a pose
 * beyond the limit; CAIRN_NOT_FINITE. Constant time.
 *
 * scan: index of the scan, in the order of add_scan() */
CAIRN_CHECKED cairn_status cairn_place_map_move_scan(cairn_place_map *map, int32_t scan,
                                                     cairn_pose map_scan);

/* Continues. CAIRN_OK: the map is complete. CAIRN_MORE: the budget is used up. CAIRN_BAD_ARGUMENT:
 * NULL. Every operation is charged before it is done; see also the steps of scan_match,
 * pose_consensus, icp and aligner. The largest ones clear a visibility grid, 1024 cells a unit, look
 * up the points and free cells of two places in each other's grids, six a unit, or copy the points
 * of a scan, 16 a unit. */
CAIRN_CHECKED cairn_status cairn_place_map_step(cairn_place_map *map, cairn_budget *budget);

/* ---- The result: empty until step() returns CAIRN_OK ---- */

/* Result of a map, and counts of the work done. */
typedef struct cairn_place_map_result {
    /* placed: places in the largest component */
    int32_t places, placed;
    /* connected components of the map; 1 is good */
    int32_t components;
    /* places with a competing pose, with weak links to the rest, or without overlap with it */
    int32_t ambiguous;
    /* scan_match runs */
    int32_t matches;
    /* hypotheses that were scored and added to the consensus */
    int32_t hypotheses;
    /* scans that were aligned individually */
    int32_t decoupled;
    /* nats: log-likelihood ratio of the map, and of the best competing map found; 0: none */
    cairn_real total, competing_total;
    /* work units charged */
    int64_t units;
} cairn_place_map_result;

/* Returns the result; all zero until step() returns CAIRN_OK. */
cairn_place_map_result cairn_place_map_read(const cairn_place_map *map);

/* Estimate of a place. */
typedef struct cairn_place_map_place {
    /* in the frame of its component: that of the component's first place */
    cairn_pose map_place;
    /* nats: log-likelihood ratio of the pose given the other places of the component; 0 as
     * written */
    cairn_real support;
    /* connected component; 0: the largest */
    int32_t component;
    /* 1: in a submap other than the component's largest, or see cairn_place_map_alternative(), or
     * error_probability above 0.3 of a place that is not alone */
    int32_t ambiguous;
    /* number of alternative poses */
    int32_t alternatives;
    /* submap within the component; 0: the largest; the links between submaps may be due to
     * chance */
    int32_t submap;
    /* nats: the weakest link between the place and most of its component, see
     * cairn_pose_consensus_estimate; 0 as written */
    cairn_real link_support;
    /* probability, 0.001 ... 1, that the place is wrong relative to most of its component (by more
     * than 0.10 m or 2 degrees), from link_support, and from support and that of the best
     * alternative (consensus.max_alternatives 0: of none), and whether the consensus reports it as
     * ambiguous: a fit to generated arenas with people and with places of other arenas. 1 for a place
     * that is alone, and as written, where there is no such estimate. */
    cairn_real error_probability;
} cairn_place_map_place;

/* Returns the estimate of a place; all zero for a place that does not exist.
 *
 * place: index of the place */
cairn_place_map_place cairn_place_map_place_of(const cairn_place_map *map, int32_t place);

/* Returns an alternative pose of a place, the most probable first; see
 * cairn_pose_consensus_alternative().
 *
 * index: 0 ... number of alternatives - 1
 * place: index of the place */
cairn_pose_consensus_competing_pose cairn_place_map_alternative(const cairn_place_map *map,
                                                                int32_t place, int32_t index);

/* Returns the pose of a scan in the frame of its component, scans counted in the order of
 * add_scan(); map_place composed with place_scan unless the scan was aligned individually. The
 * identity for a scan that does not exist.
 *
 * scan: index of the scan, in the order of add_scan() */
cairn_pose cairn_place_map_scan_pose(const cairn_place_map *map, int32_t scan);

/* Returns 1 when the joint alignment determines the pose of this scan individually; 0 when the pose
 * follows from that of its place, the scan does not exist, or scans are not aligned jointly.
 *
 * scan: index of the scan, in the order of add_scan() */
int32_t cairn_place_map_scan_is_aligned(const cairn_place_map *map, int32_t scan);

#ifdef __cplusplus
}
#endif

#endif
