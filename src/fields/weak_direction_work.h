/* Private state of the weak_direction module. */
#ifndef CAIRN_FIELDS_WEAK_DIRECTION_WORK_H
#define CAIRN_FIELDS_WEAK_DIRECTION_WORK_H

#include "cairn/weak_direction.h"
#include "src/base/object.h"
#include "src/base/step.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_weak_direction_parameters;

/* Trial translations, and bins of the thickness histogram. */
enum { WEAK_DIRECTION_MAX_TRIALS = 401, WEAK_DIRECTION_THICKNESS_BINS = 100 };

/* A scan in no submap; until the submaps are numbered a scan with an observable pose, afterwards
 * the submap of those scans. */
enum {
    WEAK_DIRECTION_NO_SUBMAP = -1,
    WEAK_DIRECTION_OBSERVABLE = -2,
    WEAK_DIRECTION_FIXED_SUBMAP = 0
};

/* Scans that are visited for a work unit. */
enum { WEAK_DIRECTION_SCANS_PER_UNIT = 16 };

typedef struct weak_direction_scan {
    cairn_pose initial, map_scan;
    /* weakly observable direction, in the map; translation along it so far, m */
    cairn_vec2 along, translation;
    cairn_real deviation; /* standard deviation along it, m */
} weak_direction_scan;

/* A wall: a segment of a scan, in the map, free side on the left. */
typedef struct weak_direction_wall {
    cairn_vec2 middle, direction;
    cairn_real half_length; /* half of its length, m */
    cairn_real weight;      /* 1 over the number of segments of its submap on the same wall */
    int32_t submap;
} weak_direction_wall;

typedef struct weak_direction_submap {
    cairn_vec2 along;
    /* m: sum over its scans of the initial position less the current one */
    cairn_vec2 initial_offset;
    /* 0: merged into another */
    int32_t scans;
} weak_direction_submap;

/* A scan of the moving submap and one of the fixed one; NO_SUBMAP: none. */
typedef struct weak_direction_scan_pair {
    int32_t scan, fixed_scan;
} weak_direction_scan_pair;

/* A trial translation. */
typedef struct weak_direction_trial {
    cairn_real nats; /* log-likelihood of the terms evaluated so far, nats */
    /* next pair of scans to evaluate, or one after it; scan_count: all are evaluated */
    int32_t scan, fixed_scan;
    weak_direction_scan_pair first_pair; /* pair that was evaluated before all others */
    int32_t is_begun;
} weak_direction_trial;

/* A bin of the thickness histogram: weight of its pairs of faces, and weighted sum of their
 * distances, m. */
typedef struct weak_direction_bin {
    cairn_real weight, sum;
} weak_direction_bin;

/* A submap and one of a lower number. */
typedef struct weak_direction_submap_pair {
    /* best translation along the direction of the first, m */
    cairn_real translation;
    /* nats to the best competing translation; below 0: not evaluated since either submap changed */
    cairn_real margin;
} weak_direction_submap_pair;

/* Clustering: a scan, and one before it that it is compared with. */
struct weak_direction_clustering {
    int32_t scan, other;
};

/* A phase over all scans or all walls: the next one. */
struct weak_direction_items {
    int32_t next;
    /* 1: walls of the fixed submap are gathered, 0: of the weak ones */
    int32_t gathers_fixed;
    /* submap whose walls are weighed; NO_SUBMAP: all */
    int32_t weighed;
    cairn_pose map_initial; /* frame of the initial poses in the map */
};

/* Search for the best translation of a submap against another one. */
struct weak_direction_search {
    /* m: step of the translations, and expected translation; its variance, m^2 */
    cairn_real step, expected, variance;
    /* trial translations in steps: first, first + 1, ...; the last may be the zero translation */
    int32_t first_step, trial_count;
    /* index of the zero translation */
    int32_t zero_trial;
    /* thickness: a wall of the moving submap, and one of the fixed submap that may be its opposite
     * face; the distance of the faces, m, and its change per m of translation */
    int32_t wall, face;
    cairn_real gap, slope;
    /* the trial that is evaluated, NO_SUBMAP: none, and the pair of scans */
    int32_t trial;
    weak_direction_scan_pair pair;
    /* the best trial; the trial to take, that one or zero; NO_SUBMAP: not known yet */
    int32_t leading_trial, best_trial;
    /* pair of scans with a clear violation at the last trial that had one */
    weak_direction_scan_pair violating_pair;
};

struct cairn_weak_direction {
    /* The correction of the input. Submaps include the fixed one. */
    int32_t scan_count, wall_count, submap_count;
    /* [max_scans] */
    weak_direction_scan *scans;
    /* [max_scans] Submap of each scan. While they are clustered the sets of the scans with a weakly
     * observable direction (disjoint_sets.h). */
    int32_t *submap;
    /* [max_walls] */
    weak_direction_wall *walls;
    /* [max_submaps + 1] */
    weak_direction_submap *submaps;
    /* [MAX_TRIALS + 1] */
    weak_direction_trial *trials;
    /* the current pair, NULL: none, and its submaps */
    weak_direction_submap_pair *pair;
    int32_t moving, fixed;
    /* Resume points of the correction, of its phase, of the search for the best trial, and of the
     * evaluation of a pair of scans. */
    int32_t resume, phase_resume, trial_resume, pair_resume;
    int32_t units_charged;
    /* What lives only inside of a phase. */
    union {
        struct weak_direction_clustering clustering;
        struct weak_direction_items items;
        struct weak_direction_search search;
    } phase;
    /* [MAX_TRIALS + 1] log-likelihood of the current wall, the best over all faces it may belong
     * to */
    cairn_real *fits;
    /* [max_submaps (max_submaps + 1) / 2] pair of submap k with h at k (k - 1) / 2 + h */
    weak_direction_submap_pair *pairs;
    /* [THICKNESS_BINS] histogram of the distances of pairs of faces */
    weak_direction_bin *bins;

    /* The input. */
    const cairn_aligner *aligner;
    const cairn_scan_set *set;
    /* [max_scans] initial poses of the scans with observable poses, ... */
    cairn_pose *fixed_initial;
    /* [max_scans] ... and their poses in the map */
    cairn_pose *fixed_map;
    int32_t added_scans;
    cairn_real initial_sigma; /* m: standard deviation of the initial positions */

    /* Between calls. 1: there is no input, or its correction has ended. */
    int32_t has_ended;
    cairn_weak_direction_result result;
    cairn_weak_direction_params params;
};

/* m: translation of a trial. */
static inline cairn_real
cairn_weak_direction_trial_translation(const cairn_weak_direction *weak_direction, int32_t i)
{
    const struct weak_direction_search *search = &weak_direction->phase.search;

    return i == search->zero_trial ? 0 : (cairn_real)(search->first_step + i) * search->step;
}

/* Pairs of `weak` submaps and the fixed one. */
static inline int32_t cairn_weak_direction_pairs_of(int32_t weak)
{
    return weak * (weak + 1) / 2;
}

/* 1 when two axes are parallel. */
static inline int cairn_weak_direction_are_parallel(cairn_vec2 a, cairn_vec2 b)
{
    return cairn_abs(cairn_vec2_dot(a, b)) >= CAIRN_REAL(0.99);
}

/* Segments of a scan. */
static inline int32_t cairn_weak_direction_segments_of(const cairn_weak_direction *weak_direction,
                                                       int32_t scan)
{
    const cairn_scan_set_scan *of = &weak_direction->set->scans[scan];

    return of->end_segment - of->first_segment;
}

/* ---- Phases: steps that return 1 when done, 0 when the budget is used up; or items of scans or
 * walls, and their units ---- */

/* ---- weak_direction_cluster.c ---- */

/* Connected components of the scans with a weakly observable direction. */
int cairn_weak_direction_cluster(cairn_weak_direction *weak_direction, cairn_budget *budget);

/* Fits the initial poses of the fixed submap to their poses in the map. */
void cairn_weak_direction_fit_initial_poses(cairn_weak_direction *weak_direction);

/* Numbers the submap of a scan. */
void cairn_weak_direction_number_scan(cairn_weak_direction *weak_direction, int32_t scan);

/* ---- weak_direction_walls.c ---- */

/* Units of a scan whose walls are gathered, and gathers them. */
int32_t cairn_weak_direction_gather_units(const cairn_weak_direction *weak_direction, int32_t scan);
void cairn_weak_direction_gather_walls(cairn_weak_direction *weak_direction, int32_t scan);

/* Units of a wall that is weighed, and sets its weight. */
int32_t cairn_weak_direction_weigh_units(const cairn_weak_direction *weak_direction, int32_t wall);
void cairn_weak_direction_weigh_wall(cairn_weak_direction *weak_direction, int32_t wall);

/* Units of a wall whose distances are added to the histogram, and adds them; after the last one the
 * most common thickness is set. */
int32_t cairn_weak_direction_bin_units(const cairn_weak_direction *weak_direction, int32_t wall);
void cairn_weak_direction_bin_wall(cairn_weak_direction *weak_direction, int32_t wall);

/* Adds the thickness term of the walls of the moving submap, against those of the fixed one, to
 * every trial. */
int cairn_weak_direction_add_thickness(cairn_weak_direction *weak_direction, cairn_budget *budget);

/* ---- weak_direction_translate.c ---- */

/* Sets the trials of the moving submap against the fixed one, each with the log-likelihood of the
 * initial poses. */
int cairn_weak_direction_begin_trials(cairn_weak_direction *weak_direction, cairn_budget *budget);

/* Finds the best translation and its margin: subtracts free-space violations, best trial first. */
int cairn_weak_direction_search_trials(cairn_weak_direction *weak_direction, cairn_budget *budget);

#endif
