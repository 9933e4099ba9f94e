/* Private state of the weak_direction module. */
#ifndef CAIRN_ALIGNMENT_WEAK_DIRECTION_WORK_H
#define CAIRN_ALIGNMENT_WEAK_DIRECTION_WORK_H

#include "cairn/weak_direction.h"
#include "src/base/object.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_weak_direction_parameters;

/* Trial translations, and bins of the thickness histogram. */
enum { WEAK_DIRECTION_MAX_TRIALS = 401, WEAK_DIRECTION_THICKNESS_BINS = 100 };

/* A scan in no submap, and the submap of the scans with observable poses. */
enum { WEAK_DIRECTION_NO_SUBMAP = -1, WEAK_DIRECTION_FIXED_SUBMAP = 0 };

typedef int32_t weak_direction_phase;
enum {
    WEAK_DIRECTION_ADD_SCANS,     /* scans are being added */
    WEAK_DIRECTION_CLUSTER,       /* connected components of the weak scans */
    WEAK_DIRECTION_NUMBER,        /* submaps */
    WEAK_DIRECTION_WALLS,         /* walls of the submaps */
    WEAK_DIRECTION_WEIGHT,        /* weight of each wall */
    WEAK_DIRECTION_WEIGHT_MERGED, /* the same, of a merged submap */
    WEAK_DIRECTION_HISTOGRAM,     /* thickness histogram */
    WEAK_DIRECTION_NEXT_PAIR,     /* choice of a pair of submaps, or merge */
    WEAK_DIRECTION_THICKNESS,     /* thickness term of the trials */
    WEAK_DIRECTION_FREE_SPACE,    /* free-space violations of the trials */
    WEAK_DIRECTION_DONE
};

typedef struct weak_direction_scan {
    cairn_pose initial, map_scan;
    /* weakly observable direction, in the map; translation along it so far, m */
    cairn_vec2 along, translation;
    cairn_real deviation; /* standard deviation along it, m */
    int32_t is_weak;
    int32_t submap; /* while scans are clustered the lowest scan of the cluster */
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

/* A submap and one of a lower number. */
typedef struct weak_direction_submap_pair {
    /* best translation along the direction of the first, m */
    cairn_real translation;
    /* nats to the best competing translation; below 0: not evaluated since either submap changed */
    cairn_real margin;
} weak_direction_submap_pair;

struct cairn_weak_direction {
    cairn_weak_direction_params params;
    /* [max_scans] */
    weak_direction_scan *scans;
    /* [max_scans] initial poses of the scans with observable poses, ... */
    cairn_pose *fixed_initial;
    /* [max_scans] ... and their poses in the map */
    cairn_pose *fixed_map;
    /* [max_walls] */
    weak_direction_wall *walls;
    /* [max_submaps + 1] */
    weak_direction_submap *submaps;
    /* [max_submaps (max_submaps + 1) / 2] pair of submap k with h at k (k - 1) / 2 + h */
    weak_direction_submap_pair *pairs;
    /* [MAX_TRIALS + 1] */
    weak_direction_trial *trials;
    /* [MAX_TRIALS + 1] log-likelihood of the current wall, the best over all faces it may belong
     * to */
    cairn_real *fits;
    /* [THICKNESS_BINS] histogram: weight of the pairs of faces at this distance, ... */
    cairn_real *thickness_weight;
    /* [THICKNESS_BINS] ... and the weighted sum of their distances, m */
    cairn_real *thickness_sum;
    const cairn_aligner *aligner;
    const cairn_scan_set *set;
    /* submaps include the fixed one */
    int32_t scan_count, wall_count, submap_count;
    int32_t added_scans;
    /* m: standard deviation of the initial positions */
    cairn_real initial_sigma;
    weak_direction_phase phase;
    int32_t item, inner_item, units_due;
    /* 1: walls of the fixed submap are gathered, after those of the weak ones */
    int32_t gathers_fixed;
    /* the current pair of submaps */
    int32_t moving, fixed;
    /* trial translations in steps: first, first + 1, ...; the last may be the zero translation */
    int32_t first_step, trial_count;
    /* index of the zero translation */
    int32_t zero_trial;
    /* the best trial; the trial to take, that one or zero; NO_SUBMAP: not known yet */
    int32_t leading_trial, best_trial;
    /* pair of scans with a clear violation at the last trial that had one */
    weak_direction_scan_pair violating_pair;
    cairn_real step, expected, variance;
    cairn_weak_direction_result result;
};

static inline cairn_real
cairn_weak_direction_trial_translation(const cairn_weak_direction *weak_direction, int32_t i)
{
    return i == weak_direction->zero_trial
               ? 0
               : (cairn_real)(weak_direction->first_step + i) * weak_direction->step;
}

static inline weak_direction_submap_pair *
cairn_weak_direction_pair(cairn_weak_direction *weak_direction, int32_t moving, int32_t fixed)
{
    return &weak_direction->pairs[moving * (moving - 1) / 2 + fixed];
}

/* ---- weak_direction_walls.c: items; each returns its units ---- */

int32_t cairn_weak_direction_walls_item(cairn_weak_direction *weak_direction);
int32_t cairn_weak_direction_weight_item(cairn_weak_direction *weak_direction);
int32_t cairn_weak_direction_histogram_item(cairn_weak_direction *weak_direction);

/* Adds the thickness term of a wall of the moving submap, at every trial, against the walls of the
 * fixed one. */
int32_t cairn_weak_direction_thickness_item(cairn_weak_direction *weak_direction);

/* ---- weak_direction_translate.c ---- */

/* Starts the trials of a submap against one of a lower number: thickness, then free-space
 * violations, then the next pair. Returns the units. */
int32_t cairn_weak_direction_begin_pair(cairn_weak_direction *weak_direction, int32_t moving,
                                        int32_t fixed);
int32_t cairn_weak_direction_free_space_item(cairn_weak_direction *weak_direction);

#endif
