/* Private state of the weak_direction module. */
#ifndef CAIRN_MAPPING_WALL_SLIDE_WORK_H
#define CAIRN_MAPPING_WALL_SLIDE_WORK_H

#include "cairn/wall_slide.h"

/* Trial translations, and bins of the thickness histogram. */
enum { SLIDE_SHIFTS = 401, SLIDE_BINS = 100 };

/* A scan in no submap, and the submap of the scans with observable poses. */
enum { SLIDE_NONE = -1, SLIDE_FIRM = 0 };

typedef int32_t slide_phase;
enum {
    SLIDE_GATHER,      /* scans are being added */
    SLIDE_TIE,         /* connected components of the weak scans */
    SLIDE_NUMBER,      /* submaps */
    SLIDE_WALLS,       /* walls of the submaps */
    SLIDE_SHARE,       /* weight of each wall */
    SLIDE_SHARE_AGAIN, /* the same, of a merged submap */
    SLIDE_LEARN,       /* thickness histogram */
    SLIDE_NEXT,        /* choice of a pair of submaps, or merge */
    SLIDE_THICKNESS,   /* thickness term of the trials */
    SLIDE_OBJECT,      /* free-space violations of the trials */
    SLIDE_DONE
};

typedef struct slide_scan {
    cairn_pose start, map_scan;
    /* weakly observable direction, in the map; translation along it so far, m */
    cairn_vec2 along, shift;
    cairn_real deviation; /* standard deviation along it, m */
    int32_t is_loose;
    int32_t part; /* while scans are clustered the lowest scan of the cluster */
} slide_scan;

/* A wall: a segment of a scan, in the map, free side on the left. */
typedef struct slide_wall {
    cairn_vec2 middle, direction;
    cairn_real half;  /* half of its length, m */
    cairn_real share; /* 1 over the number of segments of its submap on the same wall */
    int32_t part;
} slide_wall;

typedef struct slide_part {
    cairn_vec2 along;
    cairn_vec2 off; /* m: sum over its scans of the initial position less the current one */
    int32_t scans;  /* 0: merged into another */
} slide_part;

/* A scan of the moving submap and one of the fixed one; NO_SUBMAP: none. */
typedef struct slide_two {
    int32_t scan, partner;
} slide_two;

/* A trial translation. */
typedef struct slide_trial {
    cairn_real nats; /* log-likelihood of the terms evaluated so far, nats */
    /* next pair of scans to evaluate, or one after it; scan_count: all are evaluated */
    int32_t scan, partner;
    slide_two first; /* pair that was evaluated before all others */
    int32_t is_begun;
} slide_trial;

/* A submap and one of a lower number. */
typedef struct slide_pair {
    /* best translation along the direction of the first, m */
    cairn_real shift;
    /* nats to the best competing translation; below 0: not evaluated since either submap changed */
    cairn_real surer;
} slide_pair;

struct cairn_wall_slide {
    cairn_wall_slide_params params;
    /* [max_scans] */
    slide_scan *scans;
    /* [max_scans] initial poses of the scans with observable poses, ... */
    cairn_pose *from;
    /* [max_scans] ... and their poses in the map */
    cairn_pose *to;
    /* [max_walls] */
    slide_wall *walls;
    /* [max_submaps + 1] */
    slide_part *parts;
    /* [max_submaps (max_submaps + 1) / 2] pair of submap k with h at k (k - 1) / 2 + h */
    slide_pair *pairs;
    /* [MAX_TRIALS + 1] */
    slide_trial *trials;
    /* [MAX_TRIALS + 1] log-likelihood of the current wall, the best over all faces it may belong
     * to */
    cairn_real *fits;
    /* [THICKNESS_BINS] histogram: weight of the pairs of faces at this distance, ... */
    cairn_real *bins;
    /* [THICKNESS_BINS] ... and the weighted sum of their distances, m */
    cairn_real *gaps;
    const cairn_aligner *aligner;
    const cairn_scan_set *set;
    /* submaps include the fixed one */
    int32_t scan_count, wall_count, part_count;
    int32_t added;
    /* m: standard deviation of the initial positions */
    cairn_real spread;
    slide_phase phase;
    int32_t i, j, debt;
    /* the current pair of submaps */
    int32_t moving, fixed;
    /* trial translations in steps: first, first + 1, ...; the last may be the zero translation */
    int32_t first_shift, shifts;
    /* index of the zero translation */
    int32_t stay;
    /* the best trial; the trial to take, that one or zero; NO_SUBMAP: not known yet */
    int32_t leaves, best;
    /* pair of scans with a clear violation at the last trial that had one */
    slide_two objector;
    cairn_real step, expected, variance;
    cairn_wall_slide_result result;
};

static inline cairn_real cairn_slide_shift(const cairn_wall_slide *slide, int32_t i)
{
    return i == slide->stay ? 0 : (cairn_real)(slide->first_shift + i) * slide->step;
}

static inline slide_pair *cairn_slide_pair(cairn_wall_slide *slide, int32_t moving, int32_t fixed)
{
    return &slide->pairs[moving * (moving - 1) / 2 + fixed];
}

/* ---- wall_slide_walls.c: items; each returns its units ---- */

int32_t cairn_slide_walls_item(cairn_wall_slide *slide);
int32_t cairn_slide_share_item(cairn_wall_slide *slide);
int32_t cairn_slide_learn_item(cairn_wall_slide *slide);

/* Adds the thickness term of a wall of the moving submap, at every trial, against the walls of the
 * fixed one. */
int32_t cairn_slide_thickness_item(cairn_wall_slide *slide);

/* ---- wall_slide_shift.c ---- */

/* Starts the trials of a submap against one of a lower number: thickness, then free-space
 * violations, then the next pair. Returns the units. */
int32_t cairn_slide_begin_pair(cairn_wall_slide *slide, int32_t moving, int32_t fixed);
int32_t cairn_slide_object_item(cairn_wall_slide *slide);

#endif
