/* Private state of the lum module. */
#ifndef CAIRN_POSES_LUM_WORK_H
#define CAIRN_POSES_LUM_WORK_H

#include "cairn/icp.h"
#include "cairn/lum.h"
#include "cairn/registration.h"
#include "src/base/object.h"
#include "src/base/step.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_lum_parameters;

/* Units of a point that is associated, of a pair of scans or a link, of a scan that is moved, and
 * of the end of an iteration; scans, links or points in a unit that are only listed; blocks of the
 * equations in a unit that are set to 0; pairs of scans in a unit whose circles are compared. */
enum {
    LUM_UNITS_PER_POINT = 4,
    LUM_UNITS_PER_LINK = 4,
    LUM_UNITS_PER_SCAN = 1,
    LUM_UNITS_PER_COMMIT = 1,
    LUM_LISTED_PER_UNIT = 4,
    LUM_CLEARED_PER_UNIT = 16,
    LUM_CIRCLES_PER_UNIT = 8
};

struct lum_scan {
    int32_t first, end; /* range of its points */
    cairn_pose pose;
    cairn_real radius; /* m: greatest distance of its points from its origin */
};

/* Sums over the pairs of two scans. */
struct lum_sums {
    cairn_registration_points points; /* of weight 1, m^2 */
    int32_t pairs;
};

/* Sequential registration: scan after scan against the placed ones. */
struct lum_register {
    /* NULL: no registration; its target is the union of the placed scans */
    cairn_icp *icp;
    /* [max_points] subsampled points of all scans */
    cairn_oriented_point *points;
    /* [max_scans + 1] first subsampled point of each scan */
    int32_t *first;
    /* [max_scans] initial poses */
    cairn_pose *initial;
    /* [max_scans] poses of the placed scans */
    cairn_pose *placed;
    /* [max_scans] */
    int32_t *is_placed;
    /* least-squares motion of the initial poses onto the placed ones */
    cairn_pose motion;
    /* current trial: scan, and index of its start heading */
    int32_t scan, turn_index;
    int32_t placed_count;
    struct {
        cairn_real score;
        cairn_pose pose;
        int32_t scan; /* -1: none yet */
    } best;           /* best match of this round; without one at its end a seed, of score 0 */
};

struct cairn_lum {
    cairn_lum_state state;
    cairn_block_solver *solver;
    struct lum_register registration;
    cairn_real least_cosine; /* cosine of the direction gate */
    struct lum_scan *scans;
    int32_t *root;          /* [max_scans] first scan of the connected component */
    cairn_vec2 *points;     /* [max_points] */
    cairn_vec2 *directions; /* [max_points] */
    int32_t *heads;         /* [2 max_points] */
    int32_t *next;          /* [max_points] */
    /* [max_links] */
    struct lum_link {
        int32_t first, second;
    } * links;
    cairn_real (*right)[3];
    cairn_rigid_motion motion; /* small motions of the map about its centre: m, m, rad */
    struct lum_sums sums;
    /* of the current pair of scans: the first scan's frame in the second's */
    cairn_transform second_first;
    cairn_transform map_first;
    int32_t point_count;
    /* 1: an alignment is under way; 1: iterate() returns, at the end of the registration or of an
     * iteration */
    uint8_t is_running, is_committed;
    /* Resume points of the alignment, of its current phase, and of the current pair of scans. */
    uint16_t resume, phase_resume, pair_resume;
    /* Units charged for the operation that waits. */
    int32_t units_charged;
    /* current pair of scans, and point of the second */
    int32_t first, second, point;
    /* current link or scan */
    int32_t index;
    int64_t pairs;
    cairn_real chi2, max_motion;
    /* Status of the alignment, and of the solver's last phase. */
    cairn_status outcome, solver_status;
    cairn_lum_params params;
};

/* ---- lum_link.c: closest points, and the normal equations of a link ---- */

/* Inserts the scan's points into its hash buckets. */
void cairn_lum_fill_buckets(cairn_lum *lum, const struct lum_scan *scan);

/* Starts the data association of two scans at their current poses. */
void cairn_lum_begin_pairs(cairn_lum *lum, int32_t first, int32_t second);

/* Associates the next point of the second scan and adds its terms. */
void cairn_lum_add_pair(cairn_lum *lum);

/* Adds the normal equations of link `index`, once all points have been associated.
 * CAIRN_NOT_FINITE, CAIRN_BAD_ARGUMENT: statuses of the solver. */
CAIRN_CHECKED cairn_status cairn_lum_add_link(cairn_lum *lum, int32_t index);

/* ---- lum_register.c ---- */

/* Params of the ICP of the registration. */
cairn_icp_params cairn_lum_register_icp(const cairn_lum_params *params);

/* Stores the subsampled points of the scan that was added last. */
void cairn_lum_register_add(cairn_lum *lum, const cairn_oriented_point *points, int32_t count);

/* Starts the registration from the current poses. */
void cairn_lum_register_begin(cairn_lum *lum);

/* Registers the scans, which then have their registered poses. Returns 1 when done and 0 when the
 * budget is used up. */
int cairn_lum_register_scans(cairn_lum *lum, cairn_budget *budget);

#endif
