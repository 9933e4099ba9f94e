/* scan_match: scan matching and relocalization: the pose of a scan relative to another scan or a
 * local map, with or without an initial guess.
 *
 * The target is a union of scans (or any oriented points) that the caller adds part by part; the
 * query is one scan. The result is a ranked list of hypotheses with covariances, and a verdict:
 * found, ambiguous, or none.
 *
 *     clear_target() -> add_target() ... -> begin(query) -> step(budget) until CAIRN_OK -> read()
 *
 * Mode CORRELATIVE searches the whole window (position and heading; the full circle and all
 * positions without a window), and refines the best candidates by point-to-line ICP at full
 * resolution. Mode SHAPE is after Adluru 2008, chapter 6, extended to an unknown heading; mode
 * AS_WRITTEN is that chapter as it is printed. */
#ifndef CAIRN_SCAN_MATCH_H
#define CAIRN_SCAN_MATCH_H

#include "cairn/visibility.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Scan matching without an initial pose. */
typedef struct cairn_scan_match cairn_scan_match;

/* Method of matching. */
typedef int32_t cairn_scan_match_mode;
enum {
    /* correlative search over translations and headings, refined by ICP */
    CAIRN_SCAN_MATCH_CORRELATIVE = CAIRN_MODE_DEFAULT,
    /* Adluru 2008, 6.2-6.4: see cairn_scan_match_as_written() */
    CAIRN_SCAN_MATCH_AS_WRITTEN = CAIRN_MODE_AS_WRITTEN,
    /* longest common subsequence of directions and angular histograms, after the same chapter */
    CAIRN_SCAN_MATCH_SHAPE = 2,
    /* as written without ICP: the pose by shape alone */
    CAIRN_SCAN_MATCH_AS_WRITTEN_SEGMENTS = 3
};

/* Parameters; defaults in brackets. */
typedef struct cairn_scan_match_params {
    /* any (CAIRN_SCAN_MATCH_CORRELATIVE): method */
    cairn_scan_match_mode mode;
    /* 1 ... 2^20 (2048): evenly spaced points of all target parts */
    int32_t max_target;
    /* 0 ... 2^20 (4096): dense points of all target parts; 0: none are kept */
    int32_t max_dense;
    /* 0 ... 4096 (16): target parts whose visibility profiles are kept; 0: no free space is
     * known */
    int32_t max_views;
    /* 1 ... 2^20 (1024): evenly spaced points of the query */
    int32_t max_query;
    /* 1 ... 64 (8): reported hypotheses */
    int32_t max_hypotheses;
    /* 1 ... 1024 (128): candidates of the search that are refined; with more, a match is still
     * found at a smaller overlap, at a higher cost */
    int32_t max_candidates;
    /* 25 ... 65536 (65536): cells of 2 by 2 spacings in the vote accumulator: a larger window is
     * cut about its middle. See cairn_scan_match_cells(). */
    int32_t max_cells;
    /* 0 or 1 (1): search without a window: 1: each query point votes for a pose at most once, so
     * that poses on rarely seen surfaces are found; 0: once for each target point there */
    int32_t vote_once;
    /* m, >= 0.001, <= 1e5 (0.10): spacing of the evenly spaced points; cells and gates of the
     * search are multiples of it */
    cairn_real spacing;
    /* m, > 0, <= 1e5 (0.01): lower bound of the estimated standard deviation of a point across its
     * line */
    cairn_real min_sigma;
    /* >= 0, < 1 (0.001): a direction is unobservable when its information is below this share of
     * the best direction's */
    cairn_real weak_ratio;
} cairn_scan_match_params;

/* Returns the default parameters. */
cairn_scan_match_params cairn_scan_match_default(void);

/* Returns the params of Adluru 2008, 6.2 to 6.4, as printed: points are the readings of
 * cairn_scan_match_readings(), target parts are whole scans in the order in which they were taken.
 * The heading is known to the window's angle about the start (2 degrees without a window), tried
 * every degree; the position is unknown, and the window's distance is not read. Params: 4,812
 * target and 1,604 query points, one hypothesis, no dense points, no views; otherwise as the
 * default.
 *
 * Thresholds of the thesis; d is the mean distance of the pairs of the segment whose translation is
 * tried:
 * - similar directions: within 10 degrees;
 * - angular histogram: 36 bins, points within 0.5 m; similar when at most 2 bins differ by more
 *   than 0.25;
 * - segments: the list of pairs is cut at jumps of 0.30 m; a segment is dropped beyond
 *   2 d + 0.20 m;
 * - overlap: points within d + 0.40 m;
 * - ICP: at most 20 iterations.
 *
 * Choices, where the text is silent:
 * - a histogram is divided by its fullest bin, in steps of 1/255, and counts bearings in the frame
 *   of the map;
 * - the query lies at the start's position when the collinear filter evaluates the directions of
 *   the correspondences' vectors (a vector of length 0 passes); the filter is applied once, before
 *   the list is cut into segments;
 * - the pairs of the segment whose translation is tried are compared with its mean distance like
 *   all others;
 * - a query point counts for the overlap when any target point of a direction within 10 degrees is
 *   near enough, and its partner is the nearest of these; of equal overlaps the first rotation
 *   wins;
 * - ICP is point to point in closed form; its distance threshold is the mean distance of the
 *   overlapping points in the pose that the iteration starts from.
 * The thesis has no verdict: the verdict and the log odds are the library's own and change nothing
 * in the pose. */
cairn_scan_match_params cairn_scan_match_as_written(void);

/* rad: half the window of headings as written (6.3). */
#define CAIRN_SCAN_MATCH_WRITTEN_HEADING (2 * CAIRN_PI / 180)

/* A scan, or a part of a map, in a frame of its own. The arrays are the caller's and are only
 * read. */
typedef struct cairn_scan_match_part {
    /* [count] every `spacing` along the surfaces, in the order of the scan */
    const cairn_oriented_point *points;
    /* [dense_count] at full resolution: see cairn_scan_match_dense(); NULL: none */
    const cairn_oriented_point *dense;
    /* [beam_count] beams for the free space; NULL: unknown */
    const cairn_scan_beam *beams;
    /* lengths of the arrays above */
    int32_t count, dense_count, beam_count;
} cairn_scan_match_part;

/* Search window: half sizes about the start pose; hypotheses outside are not reported. The
 * refinement at full resolution has a Gaussian prior of the variance of a uniform one: standard
 * deviations of 0.577 times the half sizes, so that unobservable directions stay near the start. */
typedef struct cairn_scan_match_window {
    cairn_real distance; /* m, >= 0, of the query's origin in x and in y of the target's frame */
    cairn_real angle;    /* rad, >= 0; >= pi: the full circle */
} cairn_scan_match_window;

/* A pose at which query and target agree. */
typedef struct cairn_scan_match_hypothesis {
    cairn_pose target_query; /* pose of the query's frame in the target's */
    /* Row-major over (x, y, theta) of target_query in m and rad, in the target's frame: inverse of
     * the scaled information of the observable directions, with a window also of its prior. An
     * unobservable direction has the prior's standard deviation, without a window 100 m. A floor of
     * 0.015 spacings is added in all directions. Valid for independent errors of the points; points
     * of one fitted segment share its error, so that true errors are larger. */
    cairn_real covariance[9];
    /* share of the query's points on a target surface of their direction, 0 ... 1 */
    cairn_real overlap;
    /* the same with each point weighted by its distance from the surface: 1 on it, half at 0.3
     * spacings */
    cairn_real fit;
    /* Free-space violation, 0 ... 1: of the query's points on a surface or in the target's free
     * space, the share of the latter; 0 where no free space is known. */
    cairn_real free_space_violation;
    /* free-space violation of the target's points in the query's visibility profile, likewise */
    cairn_real target_free_space_violation;
    /* rank: 0 ... 1, grows with the fit, falls with the free-space violations */
    cairn_real score;
    /* log odds of the pose against a chance similarity of places without overlap; a calibrated
     * regression over the fields above, the number of points and the best competing score */
    cairn_real log_odds;
    /* m, >= params.min_sigma: robust standard deviation of the points across the lines */
    cairn_real sigma;
    /* Least observable direction, about the query's centroid: unit vector over (x, y, theta times
     * radius) in the target's frame, sign free. weak_ratio is its information as a share of the
     * best observable direction's. */
    cairn_real weak_direction[3];
    /* information of the least observable direction as a share of that of the best, 0 ... 1 */
    cairn_real weak_ratio;
    cairn_real radius; /* m: root mean square distance of the query's points from their centroid */
    int32_t observable_dof; /* observable degrees of freedom, 0 ... 3 */
    int32_t pairs;          /* inlier pairs of the last refinement */
} cairn_scan_match_hypothesis;

/* Outcome of a match. */
typedef int32_t cairn_scan_match_verdict;
enum {
    /* running, or nothing was begun */
    CAIRN_SCAN_MATCH_RUNNING = 0,
    /* the first hypothesis is accepted */
    CAIRN_SCAN_MATCH_FOUND = 1,
    /* several hypotheses are acceptable or equally good, or a competing one is likely by itself and
     * violates no free space although it explains less, or a direction is unobservable: all are
     * listed */
    CAIRN_SCAN_MATCH_AMBIGUOUS = 2,
    /* no hypothesis fits well enough; those listed, if any, are rejected */
    CAIRN_SCAN_MATCH_NONE = 3
};

/* The hypotheses of a match. */
typedef struct cairn_scan_match_result {
    /* [count], best first; valid until the next begin() */
    const cairn_scan_match_hypothesis *hypotheses;
    /* number of hypotheses */
    int32_t count;
    /* outcome of the match */
    cairn_scan_match_verdict verdict;
} cairn_scan_match_result;

/* Cost of the last match. */
typedef struct cairn_scan_match_measure {
    /* work units charged */
    int64_t units;
    int32_t worst_step;  /* units charged for the most expensive operation */
    int32_t candidates;  /* candidate poses of the search */
    int32_t refinements; /* poses that were refined */
} cairn_scan_match_measure;

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_scan_match_check(const cairn_scan_match_params *params,
                                                  cairn_object_fault *fault);

/* Returns the bytes that create() takes; 0 for params that create() would refuse. */
size_t cairn_scan_match_memory(const cairn_scan_match_params *params);

/* Returns max_cells for search windows of half side `distance`, m, at most 65536.
 *
 * distance: half side of the largest window, m
 * spacing: params.spacing, m */
int32_t cairn_scan_match_cells(cairn_real distance, cairn_real spacing);

/* Creates the object in memory of the pool. CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_scan_match_create(cairn_scan_match **match, cairn_pool *pool,
                                                   const cairn_scan_match_params *params);

/* Returns the points and beams of a scan as a part, without dense points.
 *
 * view: scan, whose arrays the part refers to */
cairn_scan_match_part cairn_scan_match_part_of(const cairn_scan_view *view);

/* Writes the dense points of a scan: the end of every hit beside another hit, with the direction of
 * the line through the neighbouring hits. dense: [view->beam_count]. Returns their number. Cost:
 * linear in the beams.
 *
 * view: scan with its beams */
int32_t cairn_scan_match_dense(const cairn_scan_view *view, cairn_oriented_point *dense);

/* Writes the readings with directions that mode AS_WRITTEN takes (Adluru 2008, 6.2.1): the end of
 * every hit, in the order of the scan, with the direction of the nearest segment. readings:
 * [view->beam_count]. Returns the number of readings; 0 for a scan without segments. Cost: beams
 * times segments.
 *
 * view: scan with its beams and segments */
int32_t cairn_scan_match_readings(const cairn_scan_view *view, cairn_oriented_point *readings);

/* Removes the target and the last result, and cancels a running match. Constant time. */
void cairn_scan_match_clear_target(cairn_scan_match *match);

/* Adds a part, mapped by target_part, to the target; it is copied. CAIRN_BAD_ARGUMENT: NULL, a
 * negative count, NULL with a count > 0, a coordinate beyond CAIRN_SCAN_EXTENT, a direction whose
 * length is not 1 within 1 %, a match is running. CAIRN_NOT_FINITE. CAIRN_FULL: max_target,
 * max_dense or max_views is used up (with max_dense or max_views 0 the dense points or beams are
 * left out instead). *fault, when not NULL, gives the index of the point. Cost: linear. */
CAIRN_CHECKED cairn_status cairn_scan_match_add_target(cairn_scan_match *match,
                                                       const cairn_scan_match_part *part,
                                                       cairn_pose target_part, cairn_fault *fault);

/* Adds the visibility profile of a target part that the caller keeps, mapped by target_view,
 * instead of the part's beams; it is copied. CAIRN_BAD_ARGUMENT: NULL, not CAIRN_VISIBILITY_BINS bins, a
 * match is running, a pose, sensor or step beyond CAIRN_SCAN_EXTENT, a step that is not > 0.
 * CAIRN_NOT_FINITE: pose, sensor or step. CAIRN_FULL: max_views is used up (with max_views 0 the
 * profile is left out instead). Constant time.
 *
 * visibility: profile in the frame of its part */
CAIRN_CHECKED cairn_status cairn_scan_match_add_view(cairn_scan_match *match,
                                                     const cairn_visibility *visibility,
                                                     cairn_pose target_view, cairn_fault *fault);

/* Starts to match a query, whose arrays must not change until step() returns CAIRN_OK; a running
 * match is cancelled. window NULL: global search over every position at which query and target can
 * touch, and every heading (start is not used). A query or target without points gives the verdict
 * NONE. CAIRN_BAD_ARGUMENT: NULL, a query or start as in add_target(), a window that is
 * negative. CAIRN_NOT_FINITE. CAIRN_FULL: more than max_query points. Cost: linear in the query.
 *
 * query: points and beams of the query
 * start: initial pose of the query in the target's frame
 * window: range of poses about start; NULL: global search */
CAIRN_CHECKED cairn_status cairn_scan_match_begin(cairn_scan_match *match,
                                                  const cairn_scan_match_part *query,
                                                  cairn_pose start,
                                                  const cairn_scan_match_window *window,
                                                  cairn_fault *fault);

/* Sets the visibility profile of the query that begin() was given last, instead of its beams; it is
 * copied. Called before the first step(). CAIRN_BAD_ARGUMENT: NULL, not CAIRN_VISIBILITY_BINS bins,
 * no match was begun, a profile as in add_view(). CAIRN_NOT_FINITE: sensor or step. Constant time.
 *
 * visibility: profile in the frame of the query */
CAIRN_CHECKED cairn_status cairn_scan_match_set_query_view(cairn_scan_match *match,
                                                           const cairn_visibility *visibility,
                                                           cairn_fault *fault);

/* Starts the ICP of mode AS_WRITTEN alone, from a start pose: for parts of a scan that was matched
 * as a whole (decoupled ICP, Adluru 2008, 6.5.1). Points overlap up to the distance of the last
 * match with this target, up to 0.40 m when there was none. Statuses as begin(); CAIRN_BAD_ARGUMENT
 * also in a mode without this ICP. Cost: linear in the query.
 *
 * query: as for begin()
 * start: initial pose of the query in the target's frame */
CAIRN_CHECKED cairn_status cairn_scan_match_begin_icp(cairn_scan_match *match,
                                                      const cairn_scan_match_part *query,
                                                      cairn_pose start, cairn_fault *fault);

/* Continues the match. CAIRN_OK: it has ended; the verdict is valid. CAIRN_MORE: the budget is used
 * up. CAIRN_BAD_ARGUMENT: NULL. */
CAIRN_CHECKED cairn_status cairn_scan_match_step(cairn_scan_match *match, cairn_budget *budget);

/* Returns the result; no hypotheses and RUNNING until step() returns CAIRN_OK. */
cairn_scan_match_result cairn_scan_match_read(const cairn_scan_match *match);

/* Returns the statistics of the last match. */
cairn_scan_match_measure cairn_scan_match_measured(const cairn_scan_match *match);

/* ---- Correspondences of the shape modes, for pictures, once step() has returned CAIRN_OK. They
 * are those of the winning rotation of the query, before ICP. Without any overlap they are those of
 * the last rotation tried. Modes SHAPE and SHAPE_SEGMENTS apply the filters twice, without and with
 * the points that have only a straight line about them. The better application is reported. ---- */

/* Filter that a correspondence passed or failed. */
typedef int32_t cairn_scan_match_stage;
enum {
    /* in the common subsequence; rejected by the collinear filter */
    CAIRN_SCAN_MATCH_REJECTED_COLINEAR = 0,
    /* rejected with its segment */
    CAIRN_SCAN_MATCH_REJECTED_SEGMENT = 1,
    /* accepted by all filters of the mode */
    CAIRN_SCAN_MATCH_ACCEPTED = 2
};

/* A pair of query and target points that a match of directions has found. */
typedef struct cairn_scan_match_pair {
    int32_t query, target; /* evenly spaced points; target points are counted through all parts */
    /* stage of the method that the pair has reached */
    cairn_scan_match_stage stage;
} cairn_scan_match_pair;

/* Returns the number of pairs of the common subsequence; 0 in mode CORRELATIVE, after begin_icp(),
 * while a match is running, and without points. */
int32_t cairn_scan_match_pair_count(const cairn_scan_match *match);

/* Returns pair 0 <= index < pair_count, in the order of the scans. Logarithmic in the pairs. */
cairn_scan_match_pair cairn_scan_match_pair_at(const cairn_scan_match *match, int32_t index);

/* Returns the pose of the query in which pairs were searched: the heading of the rotation, the
 * position of the start; the identity in mode CORRELATIVE, while a match is running, and without
 * points. */
cairn_pose cairn_scan_match_pair_pose(const cairn_scan_match *match);

/* Bins of an angular histogram over a whole turn. */
#define CAIRN_SCAN_MATCH_BINS 36

/* Writes the angular histogram of a query point: shares of the fullest bin, over bearings from 0
 * on, in the query's rotation. CAIRN_BAD_ARGUMENT: NULL, no such point; CAIRN_EMPTY: there are no
 * pairs.
 *
 * share: set to the shares, 0 ... 1
 * point: index of the evenly spaced point */
CAIRN_CHECKED cairn_status cairn_scan_match_histogram(const cairn_scan_match *match, int32_t point,
                                                      cairn_real share[CAIRN_SCAN_MATCH_BINS]);

#ifdef __cplusplus
}
#endif

#endif
