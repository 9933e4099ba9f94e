/* What the files of the lum room share. */
#ifndef CAIRN_MAPPING_LUM_WORK_H
#define CAIRN_MAPPING_LUM_WORK_H

#include "cairn/icp.h"
#include "cairn/lum.h"

enum { LUM_UNITS_POINT = 4, LUM_UNITS_LINK = 4 };

enum {
    LUM_IDLE,
    LUM_REGISTER,
    LUM_SEARCH,
    LUM_ANALYZE,
    LUM_MEASURE,
    LUM_FACTOR,
    LUM_SOLVE,
    LUM_MOVE
};

struct lum_scan {
    int32_t first, end; /* of its points */
    cairn_pose pose;
    cairn_real reach; /* m, of its points from its origin */
};

/* Sums over the pairs of two scans, about the centre. */
struct lum_sums {
    cairn_real x, y, squares;      /* of the middles */
    cairn_real zx, zy, turn, miss; /* of z: components, middle x z, |z|^2 */
    int32_t pairs;
};

/* One scan after the other against those that are placed. */
struct lum_register {
    /* NULL: no registration; its target are the scans that are placed */
    cairn_icp *icp;
    /* [max_points] of all scans, thinned */
    cairn_oriented_point *points;
    /* [max_scans + 1] of a scan's thinned points */
    int32_t *first;
    /* [max_scans] as they were */
    cairn_pose *start;
    /* [max_scans] */
    cairn_pose *placed;
    /* [max_scans] */
    int32_t *is_placed;
    /* of start onto placed */
    cairn_pose motion;
    /* trial at hand */
    int32_t scan, turn;
    int32_t placed_count;
    /* 1: icp runs */
    int32_t matching;
    struct {
        cairn_real score;
        cairn_pose pose;
        int32_t scan; /* -1: none yet */
    } best;           /* of this round */
};

struct cairn_lum {
    cairn_lum_params params;
    cairn_lum_state state;
    cairn_block_solver *solver;
    struct lum_register registers;
    cairn_real least_cosine; /* of the direction gate */
    struct lum_scan *scans;
    int32_t *root;          /* [max_scans] first scan of its piece */
    cairn_vec2 *points;     /* [max_points] */
    cairn_vec2 *directions; /* [max_points] */
    int32_t *heads;         /* [2 max_points] */
    int32_t *next;          /* [max_points] */
    struct lum_link {
        int32_t first, second;
        /* [max_links] */
    } * links;
    cairn_real (*right)[3];
    cairn_vec2 centre;
    struct lum_sums sums;
    /* of the pair of scans at hand: the first scan's frame from the second's */
    cairn_transform second_first;
    cairn_transform map_first;
    int32_t point_count;
    int32_t stage, debt, committed;
    /* pair of scans and point at hand */
    int32_t first, second, point;
    /* link or scan at hand */
    int32_t at;
    int64_t pairs;
    cairn_real error, motion;
    cairn_status outcome;
};

/* ---- lum_link.c: pairs of points, and what they ask of two scans ---- */

/* Puts the scan's points into buckets. */
void cairn_lum_fill_buckets(cairn_lum *lum, const struct lum_scan *scan);

/* Begins to look for pairs of two scans where they are now ... */
void cairn_lum_begin_pairs(cairn_lum *lum, int32_t first, int32_t second);

/* ... with the next point of the second ... */
void cairn_lum_add_pair(cairn_lum *lum);

/* ... and adds the equations of the link of this index, once all points have been looked at.
 * CAIRN_NOT_FINITE, CAIRN_BAD_ARGUMENT: of the solver. */
CAIRN_CHECKED cairn_status cairn_lum_add_link(cairn_lum *lum, int32_t index);

/* ---- lum_register.c ---- */

/* Sets the pointers but that of the ICP. */
void cairn_lum_register_carve(struct lum_register *r, cairn_pool *pool,
                              const cairn_lum_params *params);

cairn_icp_params cairn_lum_register_icp(const cairn_lum_params *params);

/* Keeps the thinned points of the scan that was added last. */
void cairn_lum_register_add(cairn_lum *lum, const cairn_oriented_point *points, int32_t count);

void cairn_lum_register_begin(cairn_lum *lum);

/* Begins the next match or ends a round, while none is running; 1 when all scans have been
 * placed that can be, and their poses are those of the map. */
int32_t cairn_lum_register_next(cairn_lum *lum, int32_t *units);

/* The ICP has ended. */
void cairn_lum_register_matched(cairn_lum *lum);

#endif
