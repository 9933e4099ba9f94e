/* scan_match: where was this scan taken, as seen from another scan or a local map? With a guess, or
 * with none at all.
 *
 * The target is a union of scans (or any oriented points) that the caller adds part by part; the
 * query is one scan. The answer is a ranked list of hypotheses with covariances, and a verdict:
 * found, ambiguous, or none.
 *
 *     clear_target() -> add_target() ... -> begin(query) -> step(budget) until CAIRN_OK -> read()
 *
 * Mode `correlative` searches the whole window (position and heading; the full circle and all
 * positions if asked) and refines what it finds by point-to-line distances at full resolution.
 * Mode `shape` is after Adluru 2008, chapter 6, with what an unknown heading needs; mode
 * `as_written` is that chapter as it is printed. */
#ifndef CAIRN_SCAN_MATCH_H
#define CAIRN_SCAN_MATCH_H

#include "cairn/scan.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_scan_match cairn_scan_match;

typedef int32_t cairn_scan_match_mode;
enum {
    CAIRN_SCAN_MATCH_CORRELATIVE = CAIRN_MODE_DEFAULT,
    /* Adluru 2008, 6.2-6.4: see cairn_scan_match_as_written() */
    CAIRN_SCAN_MATCH_AS_WRITTEN = CAIRN_MODE_AS_WRITTEN,
    /* common subsequence of directions and angular histograms, after the same */
    CAIRN_SCAN_MATCH_SHAPE = 2,
    /* Parts of mode `shape`, to see what each is worth: */
    /* the common subsequence alone */
    CAIRN_SCAN_MATCH_SHAPE_COMMON = 3,
    /* and the colinear filter, in its strict form */
    CAIRN_SCAN_MATCH_SHAPE_COLINEAR = 4,
    /* and the segment filter and its translation: all but ICP */
    CAIRN_SCAN_MATCH_SHAPE_SEGMENTS = 5,
    /* all but the colinear filter */
    CAIRN_SCAN_MATCH_SHAPE_LINES = 6,
    /* The same parts of mode `as_written`: */
    CAIRN_SCAN_MATCH_AS_WRITTEN_COMMON = 7,
    CAIRN_SCAN_MATCH_AS_WRITTEN_COLINEAR = 8,
    CAIRN_SCAN_MATCH_AS_WRITTEN_SEGMENTS = 9,
    CAIRN_SCAN_MATCH_AS_WRITTEN_LINES = 10
};

typedef struct cairn_scan_match_params {
    cairn_scan_match_mode mode;
    /* evenly spaced points of all parts, 1 ... 2^20 */
    int32_t max_target;
    /* dense points of all parts, 0 ... 2^20; 0: none are kept */
    int32_t max_dense;
    /* parts whose beams are kept, 0 ... 4096; 0: no part's free space is known */
    int32_t max_views;
    /* evenly spaced points of the query, 1 ... 2^20 */
    int32_t max_query;
    /* 1 ... 64 */
    int32_t max_hypotheses;
    /* 1 ... 1024: poses that the search hands on to be refined; the more, the smaller the
     * overlap at which a match is still found, and the dearer */
    int32_t max_candidates;
    /* 25 ... 65536, of 2 by 2 spacings: a window that has more is cut about its middle. See
     * cairn_scan_match_cells() */
    int32_t max_cells;
    /* 1: in a search without a window a query point votes for a pose once, however many parts of
     * the target saw what it would lie on, so that what was seen seldom is found, too; 0: once
     * for each point there. */
    int32_t once;
    /* m, >= 0.001: of the evenly spaced points; lengths of the search are multiples of it */
    cairn_real spacing;
    /* least standard deviation of a point across its line that is believed, m, > 0 */
    cairn_real sigma;
    /* a direction is not observable when its information is less than this share of the best
     * one's, in [0, 1) */
    cairn_real weak_ratio;
} cairn_scan_match_params;

/* Correlative; 2048 target points, 4096 dense ones, 16 views, 1024 query points, 8 hypotheses,
 * 128 candidates, 65536 cells, once, spacing 0.10 m, sigma 0.01 m, weak below 0.001. */
cairn_scan_match_params cairn_scan_match_default(void);

/* Adluru 2008, 6.2 to 6.4, as printed: points are the readings of cairn_scan_match_readings(),
 * target parts are whole scans in the order in which they were taken. The heading is known to the
 * window's angle about the start (2 degrees without a window), tried every degree; the position is
 * unknown, and the window's distance is not read. Thresholds are those of the thesis: 10 degrees;
 * 36 bins, 0.5 m, 2 bins, 0.25; 0.30 m, 2 d + 0.20 m; d + 0.40 m; 20 iterations. Params: 4,812
 * target and 1,604 query points, one hypothesis, no dense points, no views; otherwise as the
 * default.
 *
 * Choices, where the text is silent:
 * - a histogram is divided by its fullest bin, in steps of 1/255, and counts bearings in the frame
 *   of the map;
 * - the query lies at the start's position when the colinear filter looks where the vectors of
 *   correspondences point (a vector of length 0 passes); the filter is applied once, before the
 *   list is cut into segments;
 * - the pairs of the segment whose translation is tried are held to its mean distance like all
 *   others;
 * - a query point counts for the overlap when any target point of a direction within 10 degrees is
 *   near enough, and its partner is the nearest of these; of equal overlaps the first rotation
 *   wins;
 * - ICP is point to point in closed form; its distance threshold is the mean distance of the
 *   overlapping points in the pose that the iteration starts from.
 * The thesis has no verdict: that and the evidence are the library's own and change nothing in
 * the pose. */
cairn_scan_match_params cairn_scan_match_as_written(void);

/* rad: as written a heading is known to +-this (6.3). */
#define CAIRN_SCAN_MATCH_WRITTEN_HEADING (2 * CAIRN_PI / 180)

/* A scan, or a piece of a map, in a frame of its own. The arrays are the caller's and are only
 * read. */
typedef struct cairn_scan_match_part {
    /* [count] every `spacing` along the surfaces, in the order of the scan */
    const cairn_oriented_point *points;
    /* [dense_count] at full resolution: cairn_scan_match_dense(); NULL: none */
    const cairn_oriented_point *dense;
    /* [beam_count] what the sensor saw free; NULL: not known */
    const cairn_beam *beams;
    int32_t count, dense_count, beam_count;
} cairn_scan_match_part;

/* Half sizes of the search about the start pose. The truth is taken to lie anywhere in the
 * window alike: what the scans do not tell stays in the window, and hypotheses outside are not
 * reported. */
typedef struct cairn_scan_match_window {
    cairn_real distance; /* m, >= 0, in x and in y of the target's frame, of the query's origin */
    cairn_real angle;    /* rad, >= 0; >= pi: the full circle */
} cairn_scan_match_window;

typedef struct cairn_scan_match_hypothesis {
    cairn_pose target_query; /* the query's frame in the target's */
    /* Row-major over (x, y, theta) of target_query, in the target's frame. What nothing is known
     * of has a standard deviation of 100 m. */
    cairn_real covariance[9];
    /* share of the query's points that lie on a target's surface of their direction */
    cairn_real overlap;
    /* the same with each point weighed by its distance from the surface: 1 on it, half at 0.3
     * spacings */
    cairn_real fit;
    /* of the query's points that lie on a surface or in space that the target saw free: share of
     * the latter; 0 where nothing is known of free space */
    cairn_real contradiction;
    /* the same of the target's points in what the query saw */
    cairn_real target_contradiction;
    /* what ranks: 0 ... 1, grows with the fit, falls with the contradictions */
    cairn_real score;
    /* log odds that this is the pose and no chance likeness of places that share nothing; a
     * measured rule over the above, the number of points and the best rival's score */
    cairn_real evidence;
    /* robust standard deviation of the points across the lines, m, >= params.sigma */
    cairn_real sigma;
    /* The least observable motion about the query's centroid: unit vector over (x, y, theta
     * times `radius`) in the target's frame, sign free, and its information as a share of the
     * best observable motion's. */
    cairn_real weak[3];
    cairn_real weak_ratio;
    cairn_real radius;  /* of the query's points about their centroid, root mean square, m */
    int32_t observable; /* how many of three independent motions the match tells: 3 is good */
    int32_t pairs;      /* points paired at the end */
} cairn_scan_match_hypothesis;

typedef int32_t cairn_scan_match_verdict;
enum {
    /* or nothing begun */
    CAIRN_SCAN_MATCH_RUNNING = 0,
    /* the first hypothesis is it */
    CAIRN_SCAN_MATCH_FOUND = 1,
    /* others are as good, or would do by themselves, or a direction of motion is not observable:
     * see them all */
    CAIRN_SCAN_MATCH_AMBIGUOUS = 2,
    /* nothing fits well enough; hypotheses, if any, are the best of the bad */
    CAIRN_SCAN_MATCH_NONE = 3
};

typedef struct cairn_scan_match_result {
    /* [count], best first; valid until the next begin() */
    const cairn_scan_match_hypothesis *hypotheses;
    int32_t count;
    cairn_scan_match_verdict verdict;
} cairn_scan_match_result;

/* What the last match cost. */
typedef struct cairn_scan_match_measure {
    int64_t units;
    int32_t worst_step; /* units of the dearest item */
    int32_t candidates; /* poses that the search handed on */
    int32_t fits;       /* poses that were refined */
} cairn_scan_match_measure;

/* 0 for params that create() would refuse. */
size_t cairn_scan_match_memory(const cairn_scan_match_params *params);

/* max_cells for windows of half this side, m, at most 65536. */
int32_t cairn_scan_match_cells(cairn_real distance, cairn_real spacing);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_scan_match_create(cairn_scan_match **match, cairn_pool *pool,
                                                   const cairn_scan_match_params *params);

/* The points and beams of a scan as a part; without dense points. */
cairn_scan_match_part cairn_scan_match_part_of(const cairn_scan_view *view);

/* Dense points of a scan: the end of every beam that hit and has another hit beside it, with the
 * direction of the line through the hits about it. dense: [view->beam_count]. Returns how many.
 * Cost: linear in the beams. */
int32_t cairn_scan_match_dense(const cairn_scan_view *view, cairn_oriented_point *dense);

/* Readings with directions, as mode `as_written` takes them (Adluru 2008, 6.2.1): the end of
 * every beam that hit, in the order of the scan, with the direction of the nearest segment.
 * readings: [view->beam_count]. Returns the number of readings; 0 for a scan without segments.
 * Cost: beams times segments. */
int32_t cairn_scan_match_readings(const cairn_scan_view *view, cairn_oriented_point *readings);

/* Forgets the target, the last result and a match that is running. Constant time. */
void cairn_scan_match_clear_target(cairn_scan_match *match);

/* Adds a part, mapped by target_part, to the target; it is copied. CAIRN_BAD_ARGUMENT: NULL, a
 * negative count, NULL with a count > 0, a direction whose length is not 1 within 1 %, a match
 * is running. CAIRN_NOT_FINITE; coordinates are finite and within CAIRN_SCAN_EXTENT. CAIRN_FULL:
 * max_target, max_dense or max_views is used up (with max_dense or max_views 0 the dense points
 * or beams are left out instead). *fault, when not NULL, tells the point. Cost: linear. */
CAIRN_CHECKED cairn_status cairn_scan_match_add_target(cairn_scan_match *match,
                                                       const cairn_scan_match_part *part,
                                                       cairn_pose target_part, cairn_fault *fault);

/* Starts to match a query, whose arrays must stay until step() returns CAIRN_OK; a match that is
 * running is dropped. window NULL: every position at which query and target can touch, and every
 * heading (start is not used). A query or target without points gives the verdict NONE.
 * CAIRN_BAD_ARGUMENT: NULL, counts and directions as in add_target(), a window that is negative.
 * CAIRN_NOT_FINITE. CAIRN_FULL: more than max_query points. Cost: linear in the query. */
CAIRN_CHECKED cairn_status cairn_scan_match_begin(cairn_scan_match *match,
                                                  const cairn_scan_match_part *query,
                                                  cairn_pose start,
                                                  const cairn_scan_match_window *window,
                                                  cairn_fault *fault);

/* Starts the ICP of mode `as_written` alone, from a start pose: for parts of a scan that was
 * matched as a whole (decoupled ICP, Adluru 2008, 6.5.1). Points overlap up to the distance of
 * the last match with this target, up to 0.40 m when there was none. Statuses as begin();
 * CAIRN_BAD_ARGUMENT, too, in a mode that has no such ICP. Cost: linear in the query. */
CAIRN_CHECKED cairn_status cairn_scan_match_begin_icp(cairn_scan_match *match,
                                                      const cairn_scan_match_part *query,
                                                      cairn_pose start, cairn_fault *fault);

/* CAIRN_OK: nothing left to do, the verdict stands. CAIRN_MORE: go on. CAIRN_BAD_ARGUMENT: NULL. */
CAIRN_CHECKED cairn_status cairn_scan_match_step(cairn_scan_match *match, cairn_budget *budget);

/* The result; no hypotheses and RUNNING until step() returns CAIRN_OK. */
cairn_scan_match_result cairn_scan_match_read(const cairn_scan_match *match);

cairn_scan_match_measure cairn_scan_match_measured(const cairn_scan_match *match);

/* ---- What the modes of shape saw, for pictures, once step() has returned CAIRN_OK: of the
 * rotation of the query that won, before ICP; when nothing overlapped, of the last one that was
 * tried. In modes SHAPE and SHAPE_SEGMENTS the filters are applied twice, without the points
 * that have only a straight line about them and with them; this is the time that won. ---- */

/* How far a pair of points came. */
typedef int32_t cairn_scan_match_stage;
enum {
    CAIRN_SCAN_MATCH_COLINEAR = 0, /* in the common subsequence; dropped by the colinear filter */
    CAIRN_SCAN_MATCH_APART = 1,    /* dropped with its segment */
    CAIRN_SCAN_MATCH_KEPT = 2      /* by all filters of the mode */
};

typedef struct cairn_scan_match_pair {
    int32_t query, target; /* evenly spaced points; those of the target through all its parts */
    cairn_scan_match_stage stage;
} cairn_scan_match_pair;

/* Pairs of the common subsequence; 0 in mode correlative, after begin_icp(), while a match is
 * running, and without points. */
int32_t cairn_scan_match_pair_count(const cairn_scan_match *match);

/* Pair 0 <= index < pair_count, in the order of the scans. Logarithmic in the pairs. */
cairn_scan_match_pair cairn_scan_match_pair_at(const cairn_scan_match *match, int32_t index);

/* How the query lay when pairs were looked for: its heading is that of the rotation, its
 * position that of the start; the identity in mode correlative, while a match is running, and
 * without points. */
cairn_pose cairn_scan_match_pair_pose(const cairn_scan_match *match);

#define CAIRN_SCAN_MATCH_BINS 36

/* The angular histogram of a query point: shares of the fullest bin, over bearings from 0 on, as
 * the query was turned. CAIRN_BAD_ARGUMENT: NULL, no such point; CAIRN_EMPTY: there are no
 * pairs. */
CAIRN_CHECKED cairn_status cairn_scan_match_histogram(const cairn_scan_match *match, int32_t point,
                                                      cairn_real share[CAIRN_SCAN_MATCH_BINS]);

#ifdef __cplusplus
}
#endif

#endif
