/* wall_slide: parts of an alignment that nothing but long walls holds, slid along these to where
 * they belong.
 *
 *     begin -> add every scan -> step until CAIRN_OK -> read, shift_of
 *
 * Scans that show a hallway and the rooms beside it hang together by walls of one direction
 * only: along it, whole parts of the map may lie decimetres off, and each scan by itself is at
 * rest. Such parts are found from the covariances of the alignment and from the walls that their
 * scans share. What tells where they belong is that no scan shows a surface where another has
 * looked through; the initial poses, of all their scans together; and a hypothesis about the
 * world: the two faces of a wall, which no scan sees both, are as far apart as those of the
 * other walls of the map. How much that weighs is learnt from the walls whose faces the map
 * holds firmly: nothing where each is of another thickness (cf. Adluru 2008, chapter 8: a box
 * seen from two sides). The two parts whose place to each other is surest join first, then what
 * that tells of the others; a part for which that gains less than 2 nats stays where it is. */
#ifndef CAIRN_WALL_SLIDE_H
#define CAIRN_WALL_SLIDE_H

#include "cairn/aligner.h"
#include "cairn/scan_set.h"

#ifdef __cplusplus
extern "C" {
#endif

/* In brackets the defaults. */
typedef struct cairn_wall_slide_params {
    /* 1 ... 2^16 (64) */
    int32_t max_scans;
    /* straight pieces of all scans that are looked at, 1 ... 2^16; others are left out, first
     * those of scans that lie firmly (1024) */
    int32_t max_walls;
    /* that slide, 1 ... 64; others stay (24) */
    int32_t max_parts;
    /* not 0: walls are as thick as elsewhere in the map (1) */
    int32_t thickness;
    /* m, > 0: standard deviation from which on a scan may slide (0.03) */
    cairn_real loose;
    /* m, > 0: that across the direction of the slide is at most this (0.05) */
    cairn_real firm;
    /* rad, > 0: and that of the heading (1 degree) */
    cairn_real firm_angle;
    /* m, > 0: shifts are tried so far apart, or 401 over 6 standard deviations (0.02) */
    cairn_real step;
    /* m, > 0: standard deviation of the thickness of walls that are alike (0.02) */
    cairn_real tolerance;
} cairn_wall_slide_params;

typedef struct cairn_wall_slide_result {
    int32_t parts;        /* that may slide */
    int32_t joined;       /* of these, that have found their place */
    int32_t slid;         /* scans that are elsewhere now */
    int32_t left_out;     /* walls and parts for which there was no room */
    cairn_real thickness; /* m, of most walls; 0: none was seen from both sides */
    cairn_real alike;     /* 0 ... 1, share of the walls that have it, doubted while they are few */
    int64_t units;        /* of budget */
} cairn_wall_slide_result;

typedef struct cairn_wall_slide cairn_wall_slide;

/* The defaults above. */
cairn_wall_slide_params cairn_wall_slide_default(void);

/* 0 for params that create() would refuse. */
size_t cairn_wall_slide_memory(const cairn_wall_slide_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_wall_slide_create(cairn_wall_slide **slide, cairn_pool *pool,
                                                   const cairn_wall_slide_params *params);

/* 1 when an alignment has put a scan into its largest part, and knows its heading and one
 * direction well but not the other: such scans may slide. Constant time. */
int32_t cairn_wall_slide_is_loose(const cairn_wall_slide *slide, const cairn_aligner_pose *aligned);

/* Starts with the scans of an alignment that has ended, and the same scans, in the same slots,
 * in a set. Both stay as they are until the last step. spread: m, > 0, standard deviation of x
 * and of y of the starts that add() brings, as the alignment from them has learnt it; one that
 * went on from other poses (cairn_aligner_begin_again) tells of those. CAIRN_BAD_ARGUMENT: NULL,
 * such a spread, an aligner that is running, or with other scans than the set. CAIRN_FULL: more
 * scans than params allow. Linear in params. */
CAIRN_CHECKED cairn_status cairn_wall_slide_begin(cairn_wall_slide *slide,
                                                  const cairn_aligner *aligner,
                                                  const cairn_scan_set *set, cairn_real spread);

/* The next scan: where it was before the alignment, and where that has put it.
 * CAIRN_BAD_ARGUMENT: NULL, all are there, or poses beyond 1e6 m. CAIRN_NOT_FINITE. Constant
 * time. */
CAIRN_CHECKED cairn_status cairn_wall_slide_add(cairn_wall_slide *slide, cairn_pose start,
                                                const cairn_aligner_pose *aligned);

/* Goes on. CAIRN_MORE: the budget is used up. CAIRN_OK: nothing left to do. CAIRN_BAD_ARGUMENT:
 * NULL. CAIRN_EMPTY: scans are missing. Next to nothing where no scan may slide; else walls
 * times walls, and for every two parts the trial of shifts: most with one or two of their scans,
 * the best with all that meet, each as much as a look of the aligner's. An item is a wall
 * against all others, or two scans at one shift. */
CAIRN_CHECKED cairn_status cairn_wall_slide_step(cairn_wall_slide *slide, cairn_budget *budget);

/* ---- The result: all zero until step() returns CAIRN_OK ---- */

cairn_wall_slide_result cairn_wall_slide_read(const cairn_wall_slide *slide);

/* By how much to shift a scan, m, in the map; 0 for one that stays, and for one that is not
 * there. */
cairn_vec2 cairn_wall_slide_shift_of(const cairn_wall_slide *slide, int32_t scan);

#ifdef __cplusplus
}
#endif

#endif
