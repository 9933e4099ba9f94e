/* What the files of the aligner room share. */
#ifndef CAIRN_MAPPING_ALIGNER_WORK_H
#define CAIRN_MAPPING_ALIGNER_WORK_H

#include "cairn/aligner.h"
#include "cairn/rigid_motion.h"

enum {
    /* bearings of a table, evenly over the diamond |x| + |y| = 1 */
    ALIGNER_BINS = 512,
    /* of them, as coarse bearings */
    ALIGNER_SECTORS = 32,
    /* directions by which walls are found */
    ALIGNER_WAYS = 16,
    /* lists of walls by direction and place */
    ALIGNER_TILES = 1024,
    /* hypotheses of which the surest is kept */
    ALIGNER_BLOCK = 32,
    /* points of a scan that follow each other, in one circle */
    ALIGNER_PATCH = 8,
    /* also the most segments of a scan that a table can name */
    ALIGNER_NO_SEGMENT = 255,
    /* relative poses of one pair that are compared */
    ALIGNER_TRIALS = 12,
    /* of these enter the list at most */
    ALIGNER_KEPT = 4,
    /* scans that one is held against, ... */
    ALIGNER_NEAREST = 24,
    /* ... and with those that it is among the nearest of, at most */
    ALIGNER_PARTNERS = 48,
    /* times as many cells as shifts */
    ALIGNER_VOTES = 4,
    /* places of a scan in the raster that are tried, ... */
    ALIGNER_FINDS = 12,
    /* ... and along its walls */
    ALIGNER_SLIDES = 16,
    /* round of the joint solution from which on segments keep their walls */
    ALIGNER_KEEP_FROM = 7
};

/* Units of budget: a unit is about three points looked up, or eight pairs of scans that are far
 * from each other. */
enum { ALIGNER_POINTS_OF_UNIT = 3, ALIGNER_FAR_OF_UNIT = 8 };

enum { MOST_PASSED = 64 }; /* scans far from the one at hand, in one item */

/* A surface of a scan, in its frame, with the moments of the hits on it. */
typedef struct aligner_segment {
    cairn_vec2 a, direction;
    cairn_real length;
    cairn_real weight;  /* sum of 1 / variance across the line; 0: no hits */
    cairn_vec2 mean;    /* of the hits, weighted */
    cairn_sym2 spread;  /* weighted squares about the mean */
    cairn_real least;   /* of them across the hits' own best line */
    int32_t scan, wall; /* wall: -1 none */
    int32_t stub;       /* 1: a few hits, too short for a direction of its own */
} aligner_segment;

typedef struct aligner_point {
    cairn_vec2 position;
    int32_t segment;
} aligner_point;

/* A circle about ALIGNER_PATCH points. */
typedef struct aligner_patch {
    cairn_vec2 middle;
    cairn_real radius;
} aligner_patch;

/* A scan that may be a partner. */
typedef struct aligner_near {
    cairn_real nearness;
    int32_t scan;
} aligner_near;

/* What is seen in each direction. */
typedef struct aligner_table {
    uint16_t range[ALIGNER_BINS];       /* in reach / 65535; 0: unknown */
    uint16_t farthest[ALIGNER_SECTORS]; /* of the ranges in a sector and in both beside it */
    uint8_t segment[ALIGNER_BINS];      /* counted from the scan's first; ALIGNER_NO_SEGMENT */
} aligner_table;

/* Sums of a Gauss-Newton step of a rigid body about a centre. */
typedef struct aligner_sums {
    cairn_normal_equations equations;
    int32_t pairs;
} aligner_sums;

typedef struct aligner_scan {
    int32_t first_point, end_point, first_segment, end_segment, first_patch;
    /* of the circle about sensor and points */
    cairn_vec2 sensor, middle;
    cairn_real radius;
    /* from the origin of its frame to the far side of the circle */
    cairn_real extent;
    /* middle of the directions that are seen, from the sensor */
    cairn_vec2 axis;
    /* of what is seen to either side of it; cosine <= 0: half a turn or more */
    cairn_real view_cosine, view_sine;
    cairn_pose initial;
    /* cluster; next member of it, -1 */
    int32_t part, next;
    /* 1: it could be slid along what it shared with others */
    int32_t weak;
    /* ALIGNER_JOINED, ... */
    int32_t stirred;
    /* equal for scans that have joined another cluster together */
    int32_t joined;
    /* unit direction of the first unknown of the joint solution */
    cairn_vec2 frame;
    /* information when it was relaxed last, and the gradient that has come upon it since */
    aligner_sums pull;
    /* 1: placed by the last alignment that has ended */
    int32_t held;
    cairn_real support;
    /* nats for its place in the largest cluster, when that was looked at last */
    cairn_real evidence;
    int32_t partner_count;
} aligner_scan;

/* A cluster: scans whose poses are known to each other. */
typedef struct aligner_cluster {
    int32_t head, size;
    int32_t stamp; /* changes with every change of its poses */
} aligner_cluster;

/* What is left of the initial poses of a cluster after its motion as a whole: sums over its
 * scans. */
typedef struct aligner_fit {
    int32_t stamp;         /* of the cluster then */
    cairn_transform gauge; /* that motion: near the best, but not quite */
    cairn_vec2 origin;     /* amid the scans after it */
    cairn_real count;
    cairn_vec2 u, e;            /* of places from the origin, and of errors */
    cairn_real uu, ee, ue, uxe; /* of squares and products of these */
    cairn_real turn, turns;     /* of errors of headings and of their squares */
    cairn_real cosine, sine;    /* of these errors */
    cairn_real far, turned;     /* the greatest error along an axis, and of a heading */
    cairn_real radius;          /* of a place from the origin */
    int32_t learnt;             /* stamp of the cluster when squares and squares_angle were found */
    cairn_real squares, squares_angle;
} aligner_fit;

/* A relative pose of two scans: `first` as seen from `second`. */
typedef struct aligner_hypothesis {
    int32_t first, second;
    cairn_pose second_first;
    /* nats; by the last look, and with its rivals taken into account */
    cairn_real score, key;
    /* of the clusters at that look; -1: none yet */
    int32_t first_stamp, second_stamp;
    int32_t state;
    /* links to more hypotheses of the first and of the second scan, -1; a link is 2 * index +
     * side */
    int32_t next[2];
} aligner_hypothesis;

/* A scan that has joined another cluster, and one that others pull at. */
enum { ALIGNER_JOINED = 1, ALIGNER_MET = 2 };

/* States of a hypothesis whose look is fresh, and of one that is out. */
enum { ALIGNER_LOOKED = 1, ALIGNER_COMPARED = 2, ALIGNER_SURE = 3, ALIGNER_OUT = 4 };

typedef struct aligner_count {
    cairn_real same, other, through; /* points on the same surface, at another one, in free space */
} aligner_count;

/* A look at cluster (or single scan) `moving` against cluster `fixed`, through the pose
 * fixed_moving. */
typedef struct aligner_look {
    int32_t active;
    int32_t moving, fixed; /* clusters */
    cairn_transform pose;  /* fixed_moving */
    int32_t round, rounds; /* of refinement, then one of counting */
    int32_t outer, inner;  /* the clusters, the smaller one first */
    int32_t at, partner;   /* member of outer at hand, and which of its partners */
    cairn_vec2 centre;
    aligner_sums sums;
    aligner_count count; /* what the scans show of each other, ... */
    cairn_real evidence; /* ... in nats */
    cairn_real least;    /* counting ends when the evidence falls to it */
    cairn_real prior;    /* nats of the initial poses */
    cairn_real weak[3];  /* unit motion about the centre that the points tell least of: m, m, rad */
} aligner_look;

/* Relaxation of the scans of a cluster, one by one: all, or those that have joined it and those
 * that meet them. */
typedef struct aligner_relax {
    int32_t active, all;
    int32_t old; /* partners at hand: 0: those that the scan has not met yet, 1: the others */
    int32_t cluster, round, rounds;
    cairn_real gate;
    int32_t i, partner;                   /* scan at hand, and which of its partners */
    aligner_sums pairs[ALIGNER_PARTNERS]; /* what it has in common with each */
    aligner_sums sums;
} aligner_relax;

typedef enum aligner_phase {
    ALIGNER_NEAR,
    ALIGNER_MUTUAL,
    ALIGNER_PAIRS,
    ALIGNER_TRIALS_OF_PAIR,
    ALIGNER_OPEN,
    ALIGNER_PICK,
    ALIGNER_LOOKED_AT,
    ALIGNER_RIVALS,
    ALIGNER_WEIGHED,
    ALIGNER_SHIFTED,
    ALIGNER_CLOSE,
    ALIGNER_REPAIR,
    ALIGNER_DRAW,
    ALIGNER_SEARCH,
    ALIGNER_TRY,
    ALIGNER_PLACE,
    ALIGNER_SETTLE,
    ALIGNER_ASSOCIATE,
    ALIGNER_LINK,
    ALIGNER_SOLVE,
    ALIGNER_SLIDE,
    ALIGNER_SLIDE_TRY,
    ALIGNER_MARGINALS,
    ALIGNER_DONE
} aligner_phase;

typedef struct aligner_find {
    cairn_pose pose;
    cairn_real score;
} aligner_find;

/* A straight surface that scans share, in the map. */
typedef struct aligner_wall {
    cairn_vec2 normal;
    cairn_real offset, low, high; /* n p = offset; extent along the direction */
    int32_t next;                 /* wall of its list, -1 */
    int32_t tile;                 /* the list that it is in */
    cairn_vec2 middle;
    cairn_real weight;
    cairn_sym2 spread;
    int32_t scans; /* that see it; 2: two or more */
    int32_t first_scan, node;
} aligner_wall;

struct cairn_aligner {
    cairn_aligner_params params;
    aligner_scan *scans;
    /* [max_scans + 1] in the frame of the cluster; the last for a scan that is tried */
    cairn_transform *poses;
    aligner_table *tables;
    /* [max_scans + 1] */
    aligner_cluster *clusters;
    /* [max_scans + 1] */
    aligner_fit *fits;
    aligner_segment *segments;
    aligner_point *points;
    /* [max_scans * ALIGNER_PARTNERS] */
    uint16_t *partners;
    /* [max_points / ALIGNER_PATCH + max_scans] */
    aligner_patch *patches;
    /* [max_hypotheses] */
    aligner_hypothesis *hypotheses;
    /* [max_scans] to the first hypothesis of a scan, -1 */
    int32_t *links;
    /* [max_hypotheses / ALIGNER_BLOCK + 1] of each block, -1: none */
    int32_t *surest;
    /* [max_segments + max_stubs] */
    aligner_wall *walls;
    /* [max_segments + max_stubs] */
    int32_t *order;
    /* [max_cells] */
    uint16_t *cells;
    /* [max_cells / ALIGNER_VOTES] */
    int32_t *votes;
    /* [3 * nodes] */
    cairn_real *rhs;
    /* [ALIGNER_BINS] unit directions of the bins */
    cairn_vec2 *bearings;
    /* [max_scans] */
    cairn_aligner_pose *results;
    cairn_block_solver *solver;

    int32_t scan_count, segment_count, stub_count, point_count, patch_count, hypothesis_count,
        wall_count, node_count;
    /* of the initial poses, as learnt */
    cairn_real sigma, sigma_angle;
    /* clusters and poses are those of an alignment of the scans that are there */
    int32_t has_ended;
    /* only scans that are not held are looked for */
    int32_t again;
    /* gives stamps */
    int32_t changes;
    /* the commit point that iterate() returned at last */
    int32_t shown;

    aligner_phase phase;
    int32_t debt;
    aligner_look look;
    aligner_relax relax;
    /* Pairs, hypotheses, repairs: what is at hand. */
    int32_t i, j, k, l;
    aligner_near nearest[ALIGNER_NEAREST]; /* nearness falls */
    int32_t nearest_count;
    int32_t second;           /* of the pair at hand */
    cairn_transform expected; /* of it, by the initial poses, ... */
    cairn_real least_cosine;  /* ... and of the headings that are off most */
    aligner_hypothesis trial[ALIGNER_TRIALS];
    int32_t trial_count, trial_at;
    int32_t chosen, side;
    int32_t rival_scan, rival_link, looked; /* rival at hand, and the one that is looked at, -1 */
    cairn_real odds;                        /* of all that have been compared */
    cairn_real rest;                        /* evidence of the better of the shifted poses */
    cairn_real shift[3];
    cairn_vec2 shift_centre;
    /* Search. */
    int32_t side_cells, half_window, turns, turn, repairs, slides, changed;
    /* in which a scan slides */
    cairn_vec2 along;
    /* of the raster */
    cairn_vec2 corner;
    cairn_real cell;
    cairn_pose predicted;
    aligner_find find[ALIGNER_SLIDES];
    int32_t find_count, find_at;
    /* of the scan looked for */
    cairn_transform before, best;
    cairn_real before_score, best_score;
    /* the rest: the largest cluster when the search began */
    int32_t largest;
    /* its cluster, -1: part of the rest */
    int32_t home;
    /* the cluster that is moved: home as a whole, or scan_count for the scan alone */
    int32_t moving;
    int32_t round, stage, at;
    /* a wall of each list, -1; at the end the long ones of each direction */
    int32_t tiles[ALIGNER_TILES + ALIGNER_WAYS];
    /* m, largest step of the joint solution */
    cairn_real moved;
    /* 1: no scan slides any more */
    int32_t settled;
    /* of the segment that is added next */
    int32_t link;
    /* of the part gauge_part */
    cairn_transform gauge;
    int32_t gauge_part;
    /* chi-squared of the solution per degree of freedom, >= 1 */
    cairn_real margin;
    int32_t freedom;
    /* chi-squared and m^2 beyond which a segment loses weight */
    cairn_real tolerance, loose;
    cairn_aligner_result result;
};

/* ---- aligner_beams.c: scans ---- */

void cairn_aligner_fill_scan(cairn_aligner *x, const cairn_scan_view *view, cairn_pose initial);

/* ---- aligner_scan.c: pairs of scans ---- */

/* The bin of a bearing. */
static inline int32_t cairn_aligner_bin_of(cairn_real x, cairn_real y)
{
    cairn_real ax = cairn_abs(x), ay = cairn_abs(y), sum = ax + ay, place;

    if (!(sum > 0))
        return 0;
    place = ay / sum; /* by one division and no arc tangent */
    place = x < 0 ? 2 - place : place;
    place = y < 0 ? 4 - place : place;
    return (int32_t)(place / 4 * ALIGNER_BINS) & (ALIGNER_BINS - 1);
}

cairn_transform cairn_aligner_between(cairn_transform a_b, cairn_transform a_c);
cairn_transform cairn_aligner_compose(cairn_transform a_b, cairn_transform b_c);
cairn_transform cairn_aligner_inverse(cairn_transform a_b);
cairn_pose cairn_aligner_to_pose(cairn_transform t);

/* Points of `from` (its frame seen from `to` as to_from) in the view of `to`; returns how many
 * were looked up, those that were passed over counted in part. Stops when the evidence cannot
 * come above `least` any more. */
int32_t cairn_aligner_count_points(const cairn_aligner *x, int32_t from, int32_t to,
                                   cairn_transform to_from, cairn_real gate, cairn_real least,
                                   aligner_count *count);
cairn_real cairn_aligner_evidence(const cairn_aligner *x, aligner_count count);

/* Both ways. */
int32_t cairn_aligner_count_pair(const cairn_aligner *x, int32_t first, int32_t second,
                                 cairn_transform second_first, cairn_real gate,
                                 aligner_count *count);
/* Adds the rows of the points of `from`, which move with sign +1, against the surfaces of `to`;
 * with sign -1 `to` moves. Both poses in one frame, in which centre is, too. Returns as
 * count_points. */
int32_t cairn_aligner_pull(const cairn_aligner *x, int32_t from, int32_t to,
                           cairn_transform map_from, cairn_transform map_to, cairn_real gate,
                           cairn_real sign, cairn_vec2 centre, aligner_sums *sums);

/* Moves a pose by (x, y, turn) about a centre. */
cairn_transform cairn_aligner_moved(cairn_transform pose, cairn_vec2 centre,
                                    const cairn_real motion[3]);

/* Solves for the motion; 0 when there is too little. */
int32_t cairn_aligner_solve(const aligner_sums *sums, cairn_real motion[3]);

/* 0 when a circle in the map lies wholly outside of what a scan sees, also when it is turned by
 * up to `turned` either way. */
int cairn_aligner_may_see(const aligner_scan *scan, cairn_transform map_scan, cairn_real turned,
                          cairn_vec2 middle, cairn_real radius);

/* The k-th scan that a scan is held against; each is a partner of the other. */
static inline int32_t cairn_aligner_partner(const cairn_aligner *x, int32_t scan, int32_t k)
{
    return x->partners[ALIGNER_PARTNERS * scan + k];
}

/* 1 when a scan is one of the first `most` partners of another. */
int cairn_aligner_has_partner(const cairn_aligner *x, int32_t scan, int32_t partner, int32_t most);

/* 1 when the circles of two scans meet and each may see into the other's. */
int32_t cairn_aligner_may_meet(const cairn_aligner *x, int32_t i, int32_t j, cairn_transform map_i,
                               cairn_transform map_j);

/* How many patches of two scans the other one may show, j seen from i as i_j. */
int32_t cairn_aligner_shown(const cairn_aligner *x, int32_t i, int32_t j, cairn_transform i_j);
int32_t cairn_aligner_points_of(const cairn_aligner *x, int32_t scan);
int32_t cairn_aligner_near(cairn_transform a, cairn_transform b, cairn_real metres,
                           cairn_real cosine);

/* ---- Items: each does a bounded piece of work and returns its units ---- */

int32_t cairn_aligner_partner_item(cairn_aligner *x);
int32_t cairn_aligner_pairs_item(cairn_aligner *x);
int32_t cairn_aligner_look_item(cairn_aligner *x);
int32_t cairn_aligner_relax_item(cairn_aligner *x);
int32_t cairn_aligner_merge_item(cairn_aligner *x);

/* All hypotheses that join clusters are open, and then the surest is picked; again: what has
 * moved may let clusters join that could not before. */
void cairn_aligner_begin_open(cairn_aligner *x, int32_t again);
int32_t cairn_aligner_repair_item(cairn_aligner *x);
int32_t cairn_aligner_joint_item(cairn_aligner *x);

int32_t cairn_aligner_slide_item(cairn_aligner *x);
int32_t cairn_aligner_sort_item(cairn_aligner *x);
int32_t cairn_aligner_associate_item(cairn_aligner *x);

/* ---- aligner_wall.c ---- */

static inline int cairn_aligner_keeps_walls(const cairn_aligner *x)
{
    return x->round >= ALIGNER_KEEP_FROM;
}

/* How badly a segment fits a wall, m; negative: it does not. */
cairn_real cairn_aligner_misfit(const cairn_aligner *x, const aligner_segment *s,
                                const aligner_wall *wall);

/* The wall that a segment fits best, of equal ones the first; -1: it fits none. *passed: lists
 * and walls looked at. */
int32_t cairn_aligner_find_wall(const cairn_aligner *x, const aligner_segment *s, int32_t *passed);

/* The direction along a wall, free side on the left. */
cairn_vec2 cairn_aligner_along(const aligner_wall *wall);

/* 1 when a segment, with that direction in the map, may be part of a wall. */
int cairn_aligner_same_line(const aligner_wall *wall, const aligner_segment *s,
                            cairn_vec2 direction);

/* ---- aligner_joint.c and aligner_slide.c ---- */

/* What the walls, were they known, tell of the pose of a scan. */
cairn_sym3 cairn_aligner_own_information(const cairn_aligner *x, int32_t scan);

/* After the joint solution; slide_item goes on with more of it, or to the marginals. */
void cairn_aligner_begin_slides(cairn_aligner *x);
void cairn_aligner_end_slides(cairn_aligner *x, int32_t changed);
void cairn_aligner_put_back(cairn_aligner *x, int32_t cluster, cairn_transform pose);

/* The joint solution cannot be had: on without it. */
void cairn_aligner_give_up(cairn_aligner *x, cairn_status status);

/* aligner_cluster.c */
void cairn_aligner_begin_clusters(cairn_aligner *x);
/* least: nats; counting ends when the evidence has fallen to it, and what is left would hardly
 * bring it back. */
void cairn_aligner_begin_look(cairn_aligner *x, int32_t moving, int32_t fixed, cairn_transform pose,
                              int32_t rounds, cairn_real least);
void cairn_aligner_begin_relax(cairn_aligner *x, int32_t cluster, cairn_real gate, int32_t rounds,
                               int32_t all);
void cairn_aligner_insert(cairn_aligner *x, int32_t scan, int32_t cluster);
void cairn_aligner_remove(cairn_aligner *x, int32_t scan);
int32_t cairn_aligner_largest(const cairn_aligner *x);
int32_t cairn_aligner_join(cairn_aligner *x, int32_t moving, int32_t fixed, cairn_transform pose);

/* ---- aligner_prior.c ---- */

/* Nats of the initial poses for the pose of cluster `moving` in `fixed`; charges for it. */
cairn_real cairn_aligner_prior(cairn_aligner *x, int32_t moving, int32_t fixed,
                               cairn_transform pose);

/* Learns the standard deviations of the initial poses from all clusters; charges for it. */
void cairn_aligner_learn_spread(cairn_aligner *x);

/* The motion of a cluster as a whole that brings its scans nearest to their initial poses.
 * Linear in the cluster. */
cairn_transform cairn_aligner_gauge(const cairn_aligner *x, int32_t cluster);

/* Called before a scan enters a cluster (sign 1) or leaves it (-1). */
void cairn_aligner_fit_scan(cairn_aligner *x, int32_t scan, int32_t cluster, int32_t sign);

#endif
