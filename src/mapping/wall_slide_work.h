/* What the files of the wall_slide room share. */
#ifndef CAIRN_MAPPING_WALL_SLIDE_WORK_H
#define CAIRN_MAPPING_WALL_SLIDE_WORK_H

#include "cairn/wall_slide.h"

/* Shifts that are tried, and the histogram of thicknesses. */
enum { SLIDE_SHIFTS = 401, SLIDE_BINS = 100 };

/* A scan that is in no part, and the part of those that lie firmly. */
enum { SLIDE_NONE = -1, SLIDE_FIRM = 0 };

typedef int32_t slide_phase;
enum {
    SLIDE_GATHER,
    SLIDE_TIE,
    SLIDE_NUMBER,
    SLIDE_WALLS,
    SLIDE_SHARE,
    SLIDE_SHARE_AGAIN,
    SLIDE_LEARN,
    SLIDE_NEXT,
    SLIDE_THICKNESS,
    SLIDE_OBJECT,
    SLIDE_DONE
};

typedef struct slide_scan {
    cairn_pose start, map_scan;
    cairn_vec2 along, shift; /* in which it may slide, in the map; by how much it did */
    cairn_real deviation;    /* m, standard, of that */
    int32_t is_loose;
    int32_t part; /* while ties are looked for the least scan that it is tied to */
} slide_scan;

/* A straight piece of what a scan shows, in the map, free side on the left. */
typedef struct slide_wall {
    cairn_vec2 middle, direction;
    cairn_real half;  /* m, of its length */
    cairn_real share; /* 1 over the pieces of its part that show the same wall */
    int32_t part;
} slide_wall;

typedef struct slide_part {
    cairn_vec2 along;
    cairn_vec2 off; /* m: sum over its scans of where they started, less where they are */
    int32_t scans;  /* 0: joined to another */
} slide_part;

/* A scan of the moving part and one of the fixed one; SLIDE_NONE: none. */
typedef struct slide_two {
    int32_t scan, partner;
} slide_two;

/* A shift that is tried. */
typedef struct slide_trial {
    cairn_real nats;       /* for it, by what has been looked at */
    int32_t scan, partner; /* that are looked at next, or one after them; scan_count: no more */
    slide_two first;       /* that are looked at before all others */
    int32_t is_begun;
} slide_trial;

/* A part against one of a lesser number. */
typedef struct slide_pair {
    /* m along its direction, the best, ... */
    cairn_real shift;
    /* ... nats that any other place has less; below 0: not weighed since either has changed */
    cairn_real surer;
} slide_pair;

struct cairn_wall_slide {
    cairn_wall_slide_params params;
    /* [max_scans] */
    slide_scan *scans;
    /* [max_scans] starts of the firm scans, ... */
    cairn_pose *from;
    /* [max_scans] ... and where they are */
    cairn_pose *to;
    /* [max_walls] */
    slide_wall *walls;
    /* [max_parts + 1] */
    slide_part *parts;
    /* [max_parts (max_parts + 1) / 2] of part k with h at k (k - 1) / 2 + h */
    slide_pair *pairs;
    /* [SLIDE_SHIFTS + 1] */
    slide_trial *trials;
    /* [SLIDE_SHIFTS + 1] of the wall at hand, best of all that it may belong to */
    cairn_real *fits;
    /* [SLIDE_BINS] pairs of faces so far apart, ... */
    cairn_real *bins;
    /* [SLIDE_BINS] ... and the sum of their distances */
    cairn_real *gaps;
    const cairn_aligner *aligner;
    const cairn_scan_set *set;
    /* the firm one included */
    int32_t scan_count, wall_count, part_count;
    int32_t added;
    /* m, of the initial poses */
    cairn_real spread;
    slide_phase phase;
    int32_t i, j, debt;
    /* the parts at hand */
    int32_t moving, fixed;
    /* that are tried, in steps: first, first + 1, ...; the last may be staying, ... */
    int32_t first_shift, shifts;
    /* ... which is this one */
    int32_t stay;
    /* the best shift; the one to take, that or staying; SLIDE_NONE: not known yet */
    int32_t leaves, best;
    /* that have spoken plainly against the last shift against which any have */
    slide_two objector;
    cairn_real step, expected, variance;
    cairn_wall_slide_result result;
};

static inline cairn_real cairn_slide_shift(const cairn_wall_slide *x, int32_t i)
{
    return i == x->stay ? 0 : (cairn_real)(x->first_shift + i) * x->step;
}

static inline slide_pair *cairn_slide_pair(cairn_wall_slide *x, int32_t moving, int32_t fixed)
{
    return &x->pairs[moving * (moving - 1) / 2 + fixed];
}

/* ---- wall_slide_walls.c: items, each returns its units ---- */

int32_t cairn_slide_walls_item(cairn_wall_slide *x);
int32_t cairn_slide_share_item(cairn_wall_slide *x);
int32_t cairn_slide_learn_item(cairn_wall_slide *x);

/* A wall of the moving part, at every shift, against those of the fixed one. */
int32_t cairn_slide_thickness_item(cairn_wall_slide *x);

/* ---- wall_slide_shift.c ---- */

/* A part is to be tried against one of a lesser number: thickness first, then objections, then
 * SLIDE_NEXT. */
int32_t cairn_slide_begin_pair(cairn_wall_slide *x, int32_t moving, int32_t fixed);
int32_t cairn_slide_object_item(cairn_wall_slide *x);

#endif
