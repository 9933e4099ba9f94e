/* virtual_scan: hypotheses about the environment's structure (lines, rectangles, ellipses) as an
 * extra scan for the alignment.
 *
 *     begin -> add_scan ... -> step until CAIRN_OK -> hypotheses and points, which go to
 *     cairn_force_field_set_extra()
 *
 * Man-made environments have straight walls and rectangular rooms, visible in the whole map even
 * where no single scan shows them.
 *
 * Method.
 *
 * 1. The points of all scans at their current poses vote for lines and ellipses (Hough transform);
 *    rectangles are assembled from their segments.
 * 2. All are sampled as the points of one more scan, the virtual scan, which attracts the others in
 *    the next step of the alignment.
 * 3. It is rebuilt from the real scans alone each time: unsupported hypotheses vanish (Adluru 2008,
 *    chapter 8, algorithm 2).
 *
 * The weight of a hypothesis needs no manual setting. A point of it weighs at most as much as one
 * real scan that saw the whole outline, in proportion to the observed share of the outline. A line
 * or an ellipse counts only when it joins walls of several scans, since one scan knows its own
 * walls better.
 *
 * Mode as written (cairn_virtual_scan_as_written): section 8.4. Lines come from the Hough transform
 * as written (hough.h) of all points. The strength of a line is its number of inliers divided by
 * that of the strongest line, so that it compares with a real point's weight of 1. Rectangles come
 * from segments merged to prototypes, four of them nearly parallel and perpendicular, by their
 * slopes, lengths and distances; directions are not oriented. One scan suffices for a hypothesis,
 * and sigma has no effect. Choices, where the text gives no number:
 *
 * - A line has 40 points and more.
 * - Rectangles have the thresholds of the default mode. Segments within 0.15 m and over gaps of up
 *   to 3 m are one side. Sides are 1 m and longer; 30 % of each and 55 % of the outline are
 *   covered. Angles are within 10 degrees of right ones. (rectangle: merge_distance, merge_gap,
 *   min_side, min_side_coverage, min_coverage, max_angle_error.)
 * - Of rectangles whose corners are within 0.30 m of each other only the strongest stays.
 * - A rectangle's strength is the covered share of its outline, reduced with the square of the
 *   deviation from right angles.
 * - Points of the virtual scan are as far apart as real ones (0.10 m), of weight 1 at strength
 *   1. */
#ifndef CAIRN_VIRTUAL_SCAN_H
#define CAIRN_VIRTUAL_SCAN_H

#include "cairn/ellipse.h"
#include "cairn/hough.h"
#include "cairn/object.h"
#include "cairn/rectangle.h"
#include "cairn/scan_set.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Kind of a hypothesis: the three built-in ones, and those of the caller. */
typedef int32_t cairn_virtual_scan_hypothesis_kind;
enum {
    /* line, from hough */
    CAIRN_VIRTUAL_SCAN_LINE = 0,
    /* rectangle */
    CAIRN_VIRTUAL_SCAN_RECTANGLE = 1,
    /* circle or ellipse */
    CAIRN_VIRTUAL_SCAN_ELLIPSE = 2,
    CAIRN_VIRTUAL_SCAN_CALLER = 3 /* and above: the caller's kinds in order of their addition */
};

/* A structure that the scans suggest. */
typedef struct cairn_virtual_scan_hypothesis {
    /* kind of the structure */
    cairn_virtual_scan_hypothesis_kind kind;
    /* range of its points in the virtual scan */
    int32_t first_point, end_point;
    /* scans that observe it; 0: not counted */
    int32_t observing_scans;
    /* 0 ... 1: observed share of the outline; of a line as written its votes divided by the
     * maximum */
    cairn_real strength;
    /* weight of each of its points */
    cairn_real weight;
} cairn_virtual_scan_hypothesis;

/* The map that hypotheses are derived from, at the current poses of the scans. */
typedef struct cairn_virtual_scan_map {
    const cairn_oriented_point *points; /* [point_count] */
    const int32_t *point_scan;          /* [point_count] slot of the scan */
    const cairn_segment *segments;      /* [segment_count], free side on the left */
    const int32_t *segment_scan;        /* [segment_count] */
    /* number of points and of segments */
    int32_t point_count, segment_count;
    cairn_real sigma; /* m: position uncertainty of the scans */
} cairn_virtual_scan_map;

/* Starts a detection of a caller's kind, such as triangles. A status below 0 ends the detection
 * with it.
 *
 * state: that of the detector
 * map: the map, which stays valid until the detection has ended */
typedef cairn_status (*cairn_virtual_scan_hypothesis_begin)(void *state,
                                                            const cairn_virtual_scan_map *map);

/* Works on the detection, as all steps. A status below 0 ends the detection with it.
 *
 * state: that of the detector */
typedef cairn_status (*cairn_virtual_scan_hypothesis_step)(void *state, cairn_budget *budget);

/* Returns the number of hypotheses, after the last step.
 *
 * state: that of the detector */
typedef int32_t (*cairn_virtual_scan_hypothesis_count)(const void *state);

/* Writes the points along a hypothesis and returns their number.
 *
 * state: that of the detector
 * i: index of the hypothesis
 * spacing: distance of the points, m
 * points: [capacity] set to at most `capacity` points
 * strength: set to the strength, 0 ... 1 */
typedef int32_t (*cairn_virtual_scan_hypothesis_outline)(const void *state, int32_t i,
                                                         cairn_real spacing,
                                                         cairn_oriented_point *points,
                                                         int32_t capacity, cairn_real *strength);

/* Callbacks that detect a caller's kind of structure. */
typedef struct cairn_virtual_scan_hypothesis_detector {
    void *state; /* of the caller */
    /* starts a detection on a map */
    cairn_virtual_scan_hypothesis_begin begin;
    /* works on the detection */
    cairn_virtual_scan_hypothesis_step step;
    /* number of hypotheses found */
    cairn_virtual_scan_hypothesis_count count;
    /* points along a hypothesis */
    cairn_virtual_scan_hypothesis_outline outline;
} cairn_virtual_scan_hypothesis_detector;

/* Parameters; defaults in brackets. */
typedef struct cairn_virtual_scan_params {
    /* 1 ... 2^20 (64): bound of the slots of the scans */
    int32_t max_scans;
    /* 1 ... 2^24 (4096): capacity for points of the map */
    int32_t max_points;
    /* 1 ... 2^20 (1024): capacity for segments of the map */
    int32_t max_segments;
    /* 1 ... 1024 (64): maximum number of hypotheses */
    int32_t max_hypotheses;
    /* 1 ... 2^24 (4096): capacity for points of the virtual scan */
    int32_t max_virtual;
    /* 0 ... 16 (2): maximum number of the caller's detectors */
    int32_t max_detectors;
    /* 0 or 1 (1): 1: detect lines */
    int32_t lines;
    /* 0 or 1 (1): 1: detect rectangles */
    int32_t rectangles;
    /* 0 or 1 (1): 1: detect circles and ellipses */
    int32_t ellipses;
    /* >= 1 (2): every n-th of the scans' points votes for lines and ellipses */
    int32_t stride;
    /* m, > 0, <= 1e6 (0.10): distance of the virtual scan's points */
    cairn_real spacing;
    /* >= 0, <= 1e6 (1): weight of a point of a hypothesis of strength 1 */
    cairn_real weight;
    /* sigma, > 0, <= 1 (0.3): maximum distance of an inlier from its line or ellipse */
    cairn_real distance_per_sigma;
    /* rad per m of sigma, > 0, <= 1e6 (0.2): maximum deviation of an inlier's direction, within 4
     * to 10 degrees */
    cairn_real angle_per_sigma;
    /* >= 1 (2): minimum number of scans that a line or ellipse joins */
    int32_t min_scans;
    /* CAIRN_MODE_DEFAULT or CAIRN_MODE_AS_WRITTEN (CAIRN_MODE_DEFAULT): as written, ellipses,
     * stride, distance_per_sigma, angle_per_sigma, min_scans, min_wall_length, hough.mode and
     * rectangle.oriented are ignored */
    int32_t mode;
    /* m, >= 0, <= 1e6 (0.5): minimum length of wall of a scan on it for the scan to count */
    cairn_real min_wall_length;
    /* its tolerances are minimum values, for sigma 0 */
    cairn_hough_params hough;
    /* its max_segments is ignored */
    cairn_rectangle_params rectangle;
    /* its tolerances are minimum values as well */
    cairn_ellipse_params ellipse;
} cairn_virtual_scan_params;

/* Detection of structures, and the virtual scan along them. */
typedef struct cairn_virtual_scan cairn_virtual_scan;

/* Returns the default parameters; hough with 72 angles, 128 distances and steps of 0.10 m,
 * rectangles with sides from 1 m of whose outline 55 % is observed. */
cairn_virtual_scan_params cairn_virtual_scan_default(void);

/* Returns the params of the mode as written, see above. */
cairn_virtual_scan_params cairn_virtual_scan_as_written(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_virtual_scan_check(const cairn_virtual_scan_params *params,
                                                    cairn_object_fault *fault);

/* Returns the bytes that create() takes from the pool; 0 for invalid params. */
size_t cairn_virtual_scan_memory(const cairn_virtual_scan_params *params);

/* Creates an object in the pool. CAIRN_BAD_ARGUMENT: NULL or invalid params. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_virtual_scan_create(cairn_virtual_scan **virtual_scan,
                                                     cairn_pool *pool,
                                                     const cairn_virtual_scan_params *params);

/* Adds a kind of hypothesis; its number is CAIRN_VIRTUAL_SCAN_CALLER and up. CAIRN_BAD_ARGUMENT:
 * NULL, or a missing function. CAIRN_FULL: max_detectors exist.
 *
 * detector: callbacks, which are copied */
CAIRN_CHECKED cairn_status cairn_virtual_scan_add_detector(
    cairn_virtual_scan *virtual_scan, const cairn_virtual_scan_hypothesis_detector *detector);

/* Starts a new map; a detection in progress is abandoned, the last result stays. sigma: m, position
 * uncertainty of the scans, such as that of the force field. CAIRN_BAD_ARGUMENT: NULL, or sigma not
 * >= 0 or beyond 5e5. */
CAIRN_CHECKED cairn_status cairn_virtual_scan_begin(cairn_virtual_scan *virtual_scan,
                                                    cairn_real sigma);

/* Adds a scan of a set at its current pose, before the first step. CAIRN_BAD_ARGUMENT: NULL, no
 * such scan, a pose beyond 5e5 m, or a detection that has begun its steps. CAIRN_NOT_FINITE: the
 * pose. CAIRN_FULL: more points or segments than params allow; nothing was added. Linear in the
 * scan.
 *
 * set: the scans
 * scan: slot of the scan */
CAIRN_CHECKED cairn_status cairn_virtual_scan_add_scan(cairn_virtual_scan *virtual_scan,
                                                       const cairn_scan_set *set, int32_t scan,
                                                       cairn_pose map_scan);

/* Continues the detection. CAIRN_MORE: the budget is used up. CAIRN_OK: it has ended, or none was
 * begun. Statuses of the caller's detectors. Costs those of hough, rectangle and ellipse, a unit
 * for four points per line, and one for four virtual points. */
CAIRN_CHECKED cairn_status cairn_virtual_scan_step(cairn_virtual_scan *virtual_scan,
                                                   cairn_budget *budget);

/* ---- Result of the last detection that has ended ---- */

/* Returns the hypotheses: the strongest lines first, then rectangles, ellipses, the caller's
 * kinds.
 *
 * count: set to the number of hypotheses */
const cairn_virtual_scan_hypothesis *
cairn_virtual_scan_hypotheses(const cairn_virtual_scan *virtual_scan, int32_t *count);

/* Returns the virtual scan: points in the map with the weight of each.
 *
 * weights: set to [count] weights
 * count: set to the number of points */
const cairn_oriented_point *cairn_virtual_scan_points(const cairn_virtual_scan *virtual_scan,
                                                      const cairn_real **weights, int32_t *count);

/* Returns the number of hypotheses and points beyond the capacities. */
int32_t cairn_virtual_scan_dropped(const cairn_virtual_scan *virtual_scan);

#ifdef __cplusplus
}
#endif

#endif
