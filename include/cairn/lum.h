/* lum: global alignment after Lu and Milios: all scans at once, by links of closest points and one
 * linear system.
 *
 * Two scans are linked when more than `min_pairs` points of one have their nearest point of the
 * other within `distance`. In every iteration the closest points of each link give a measured
 * difference of the two poses with its covariance, and all differences are met at once in the least
 * squares sense (Lu and Milios 1997; Adluru 2008, chapter 10). The first scan stays. Scans that no
 * links join to it keep the place of the first of their piece, and are told.
 *
 * Optionally the scans are first registered one after the other, as 3DTK, the implementation of the
 * thesis, does.
 *
 * Mode as written (cairn_lum_as_written): section 10.3.2, and nothing more. Links are built
 * once, from the initial poses, between scans with more than 5 closest pairs within 0.20 m; a
 * point's nearest point counts whatever the directions of the two; every link weighs by the
 * covariance that its own pairs give; there is no registration before. Choices: closest points
 * are looked for from the later scan of a link to the earlier one; a variance below (0.1 mm)^2
 * counts as that, as pairs that fit exactly have none; a link with 5 pairs or fewer in a later
 * iteration is left out of that iteration; the end is when no scan moves farther than 0.1 mm, or
 * 500 iterations. The 6-D method on 2-D scans is the 2-D one (section 10.3.2, last paragraph),
 * which this is. */
#ifndef CAIRN_LUM_H
#define CAIRN_LUM_H

#include "cairn/block_solver.h"
#include "cairn/scan.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_lum cairn_lum;

/* In brackets the defaults. */
typedef struct cairn_lum_params {
    /* 1 ... 2^16 (64) */
    int32_t max_scans;
    /* of all scans, 1 ... 2^24 (8192) */
    int32_t max_points;
    /* 1 ... 2^24 (2016: all pairs of 64 scans) */
    int32_t max_links;
    /* of the solver, see block_solver (2016) */
    int32_t max_fill;
    /* >= 2; links have more pairs than these (5) */
    int32_t min_pairs;
    /* >= 1 (500) */
    int32_t max_iterations;
    /* links are looked for anew after so many iterations; 0: never (0, as in the thesis) */
    int32_t rebuild;
    /* m, > 0: of a pair at most (0.20) */
    cairn_real distance;
    /* rad, (0, pi]: largest angle between the oriented directions of a pair; pi: any, as in the
     * thesis, which pulls the two faces of a wall together (60 degrees) */
    cairn_real direction_gate;
    /* m, > 0: least standard deviation of a pair that is believed (0.02: with less the links of
     * a few pairs that happen to agree outweigh all others) */
    cairn_real sigma;
    /* m, > 0: done when no scan moves farther, its turn counted at 1 m (0.0001) */
    cairn_real converged;
    /* Sequential registration, before the first links are looked for: scan after scan is brought
     * to those that are placed by iterative closest points (icp, point to line), the best match
     * first. What a scan starts from is its pose moved as those of the placed scans have moved.
     * 0: none (0); 1: links of 0.20 m alone keep what is nearly right and do not find what is
     * far. */
    int32_t registers;
    /* CAIRN_MODE_DEFAULT; CAIRN_MODE_AS_WRITTEN: rebuild, direction_gate, sigma and registers
     * are not read (CAIRN_MODE_DEFAULT) */
    int32_t mode;
    /* m, >= distance: of a pair at first (0.7) */
    cairn_real register_gate;
    /* rad, [0, pi]: also tried with its start turned so much, both ways (10 degrees) */
    cairn_real register_turn;
    /* m, >= 0: points of a scan nearer to the one before are left out of it (0.08) */
    cairn_real register_spacing;
} cairn_lum_params;

cairn_lum_params cairn_lum_default(void);

/* Mode as written, with the thesis's constants where it has any: see above. */
cairn_lum_params cairn_lum_as_written(void);

typedef int32_t cairn_lum_verdict;
enum {
    /* or nothing begun */
    CAIRN_LUM_RUNNING = 0,
    CAIRN_LUM_CONVERGED = 1,
    CAIRN_LUM_OUT_OF_ITERATIONS = 2,
    /* the links do not determine a pose; the poses are those of the last iteration */
    CAIRN_LUM_SINGULAR = 3
};

typedef struct cairn_lum_state {
    cairn_lum_verdict verdict;
    int32_t scans;
    int32_t iterations;
    int32_t links;
    /* of scans that links join; 1 is good */
    int32_t pieces;
    /* scans that registration has matched with others */
    int32_t registered;
    /* of points, in the last iteration */
    int64_t pairs;
    /* W of eq. 10.2 before the last iteration's step: of its measured differences, with their
     * covariances */
    cairn_real error;
    /* m: the largest of the last iteration */
    cairn_real motion;
} cairn_lum_state;

/* 0 for params that create() would refuse. */
size_t cairn_lum_memory(const cairn_lum_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_lum_create(cairn_lum **lum, cairn_pool *pool,
                                            const cairn_lum_params *params);

/* Forgets all scans and what runs. */
void cairn_lum_clear(cairn_lum *lum);

/* Adds points[0 ... count-1] at the pose map_scan; they are copied. CAIRN_BAD_ARGUMENT: count <
 * 0, NULL with count > 0, a coordinate beyond 1e6 m, a direction whose length is not 1 within 1
 * %, or an alignment runs. CAIRN_NOT_FINITE. CAIRN_FULL: more scans or points than params allow.
 * *fault, when not NULL, tells the point. Linear in the points. */
CAIRN_CHECKED cairn_status cairn_lum_add_scan(cairn_lum *lum, const cairn_oriented_point *points,
                                              int32_t count, cairn_pose map_scan,
                                              cairn_fault *fault);

/* Starts to align from the poses as they are. CAIRN_EMPTY: no scans. CAIRN_BAD_ARGUMENT: an
 * alignment runs. Linear in max_points with registration, else in the scans. */
CAIRN_CHECKED cairn_status cairn_lum_begin(cairn_lum *lum);

/* CAIRN_OK: nothing left to do, the verdict stands. CAIRN_MORE: go on. CAIRN_FULL: more links or
 * more fill than params allow; the poses are those of the last iteration. Costs 4 units a point
 * of a link, and what the solver takes; a registration three matches for each two scans, see
 * icp. */
CAIRN_CHECKED cairn_status cairn_lum_step(cairn_lum *lum, cairn_budget *budget);

/* As step(), but also returns CAIRN_OK at the end of the registration and of every iteration. */
CAIRN_CHECKED cairn_status cairn_lum_iterate(cairn_lum *lum, cairn_budget *budget);

/* State after the last whole iteration. */
cairn_lum_state cairn_lum_read(const cairn_lum *lum);

/* Pose of an index below `scans` after the last whole iteration. */
cairn_pose cairn_lum_pose(const cairn_lum *lum, int32_t scan);

/* 1 when links join the scan, of an index below `scans`, to the first. Right once links have
 * been looked for. */
int32_t cairn_lum_is_joined(const cairn_lum *lum, int32_t scan);

#ifdef __cplusplus
}
#endif

#endif
