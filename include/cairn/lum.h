/* lum: global scan alignment after Lu and Milios: a pose graph of closest-point links, solved as
 * one linear system per iteration.
 *
 * Two scans are linked when more than min_pairs points of one have their nearest point of the other
 * within max_pair_distance. In every iteration the closest points of each link give a measured
 * relative pose with its covariance. All links are then satisfied together by linear least squares
 * (Lu and Milios 1997; Adluru 2008, chapter 10). The first scan is fixed. Scans outside its
 * connected component keep the place of the first scan of their own component, and are reported.
 *
 * Optional sequential registration before the first links, as 3DTK does, the implementation of the
 * thesis.
 *
 * Mode as written (cairn_lum_as_written): section 10.3.2, and nothing more. Links are built once,
 * from the initial poses, between scans with more than 5 closest pairs within 0.20 m. The nearest
 * point counts whatever the two directions are. Every link is weighted by the covariance of its own
 * pairs. There is no prior registration. Choices: closest points are searched from the later scan
 * of a link to the earlier one; a variance below (0.1 mm)^2 is set to that value, as exact pairs
 * have none; a link with 5 pairs or fewer in a later iteration is left out of that iteration; the
 * solution ends when no scan moves farther than 0.1 mm, or after 500 iterations. The 6-D method on
 * 2-D scans is the 2-D one (section 10.3.2, last paragraph), which is implemented here. */
#ifndef CAIRN_LUM_H
#define CAIRN_LUM_H

#include "cairn/block_solver.h"
#include "cairn/object.h"
#include "cairn/scan.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Joint alignment of scans by Lu and Milios. */
typedef struct cairn_lum cairn_lum;

/* Parameters; defaults in brackets. */
typedef struct cairn_lum_params {
    /* 1 ... 2^16 (64): number of scans */
    int32_t max_scans;
    /* 1 ... 2^24 (8192): points of all scans together */
    int32_t max_points;
    /* 1 ... 2^24 (2016): capacity for links; all pairs of 64 scans by default */
    int32_t max_links;
    /* 0 ... 2^26 (2016): blocks of the Cholesky factor, see block_solver */
    int32_t max_fill;
    /* >= 2 (5): a link has more pairs than this */
    int32_t min_pairs;
    /* >= 1 (500): greatest number of iterations */
    int32_t max_iterations;
    /* >= 0 (0): iterations between two searches for links; 0: links are built once, as in the
     * thesis */
    int32_t rebuild_interval;
    /* m, > 0, <= 1e6 (0.20): greatest distance of a closest-point pair */
    cairn_real max_pair_distance;
    /* rad, > 0, <= pi (60 degrees): greatest angle between the oriented directions of a pair; pi:
     * any, as in the thesis, which attracts the two faces of a wall to each other */
    cairn_real direction_gate;
    /* m, > 0, <= 1e6 (0.02): lower bound of the standard deviation of a pair; with less, links of a
     * few pairs that agree by chance outweigh all others */
    cairn_real min_sigma;
    /* m, > 0, <= 1e6 (0.0001): converged when no scan moves farther, rotations counted at a radius
     * of 1 m */
    cairn_real converged_distance;
    /* 0 or 1 (0): 1: sequential registration before the first search for links. Scan after scan is
     * matched with the placed scans by ICP (icp, point to line), the best match first. The start
     * pose is the scan's pose moved by the mean motion of the placed scans. It helps from poor
     * initial poses: links within 0.20 m alone keep nearly correct poses and do not find distant
     * ones. */
    int32_t sequential_registration;
    /* CAIRN_MODE_DEFAULT or CAIRN_MODE_AS_WRITTEN (CAIRN_MODE_DEFAULT): as written,
     * rebuild_interval, direction_gate, min_sigma and sequential_registration are not read */
    int32_t mode;
    /* m, >= max_pair_distance, <= 1e6 (0.7): distance gate of the registration's first
     * iteration */
    cairn_real registration_gate;
    /* rad, 0 ... pi (10 degrees): offset of two further start headings, to both sides */
    cairn_real registration_angle;
    /* m, >= 0, <= 1e6 (0.08): registration skips points of a scan nearer to the point before */
    cairn_real registration_spacing;
} cairn_lum_params;

/* Returns the default parameters. */
cairn_lum_params cairn_lum_default(void);

/* Returns the params of the mode as written, with the thesis's constants where it has any. */
cairn_lum_params cairn_lum_as_written(void);

/* How an alignment has ended. */
typedef int32_t cairn_lum_verdict;
enum {
    /* running, or nothing was begun */
    CAIRN_LUM_RUNNING = 0,
    /* no scan moved farther than converged_distance */
    CAIRN_LUM_CONVERGED = 1,
    /* max_iterations were done without convergence */
    CAIRN_LUM_OUT_OF_ITERATIONS = 2,
    /* the links do not determine all poses; the poses are those of the last iteration */
    CAIRN_LUM_SINGULAR = 3
};

/* State after the last complete iteration. */
typedef struct cairn_lum_state {
    /* running, or how the alignment has ended */
    cairn_lum_verdict verdict;
    /* number of scans */
    int32_t scans;
    /* complete iterations */
    int32_t iterations;
    /* number of links between scans */
    int32_t links;
    /* connected components of the link graph; 1 is good */
    int32_t components;
    /* scans that the sequential registration matched */
    int32_t registered_scans;
    /* closest-point pairs of the last iteration */
    int64_t pairs;
    /* W of eq. 10.2 before the last iteration's step: the sum of chi-squared over the links */
    cairn_real chi2;
    /* m: largest motion of a scan in the last iteration */
    cairn_real max_motion;
} cairn_lum_state;

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_lum_check(const cairn_lum_params *params,
                                           cairn_object_fault *fault);

/* Returns the bytes that create() takes; 0 for params that create() would refuse. */
size_t cairn_lum_memory(const cairn_lum_params *params);

/* Creates the object in memory of the pool. CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_lum_create(cairn_lum **lum, cairn_pool *pool,
                                            const cairn_lum_params *params);

/* Removes all scans and cancels a running alignment. */
void cairn_lum_clear(cairn_lum *lum);

/* Adds points[0 ... count-1] at the pose map_scan; they are copied. CAIRN_BAD_ARGUMENT: count < 0,
 * NULL with count > 0, a coordinate beyond 1e6 m, a direction whose length is not 1 within 1 %, or
 * an alignment is running. CAIRN_NOT_FINITE. CAIRN_FULL: more scans or points than params allow.
 * *fault, when not NULL, gives the index of the point. Linear in the points.
 *
 * points: [count] in the frame of the scan; directions of length 1 */
CAIRN_CHECKED cairn_status cairn_lum_add_scan(cairn_lum *lum, const cairn_oriented_point *points,
                                              int32_t count, cairn_pose map_scan,
                                              cairn_fault *fault);

/* Starts to align from the current poses. CAIRN_EMPTY: no scans. CAIRN_BAD_ARGUMENT: an alignment
 * is running. Linear in max_points with registration, else in the scans. */
CAIRN_CHECKED cairn_status cairn_lum_begin(cairn_lum *lum);

/* Continues the alignment. CAIRN_OK: it has ended; the verdict is valid. CAIRN_MORE: the budget is
 * used up. CAIRN_FULL: more links or more fill than params allow; the poses are those of the last
 * iteration. Cost: 4 units per point of a link, plus the solver's; a search for links 1 unit per 8
 * pairs of scans; a registration takes three matches per pair of scans, see icp. */
CAIRN_CHECKED cairn_status cairn_lum_step(cairn_lum *lum, cairn_budget *budget);

/* Continues like step(), but also returns CAIRN_OK at the end of the registration and of every
 * iteration. */
CAIRN_CHECKED cairn_status cairn_lum_iterate(cairn_lum *lum, cairn_budget *budget);

/* Returns the state after the last complete iteration. */
cairn_lum_state cairn_lum_read(const cairn_lum *lum);

/* Returns the pose of scan < scans after the last complete iteration; outside the identity.
 *
 * scan: index of the scan */
cairn_pose cairn_lum_pose(const cairn_lum *lum, int32_t scan);

/* Returns 1 when scan < scans is in the connected component of the first scan; outside 0. Valid
 * once links have been searched for.
 *
 * scan: index of the scan */
int32_t cairn_lum_is_connected(const cairn_lum *lum, int32_t scan);

#ifdef __cplusplus
}
#endif

#endif
