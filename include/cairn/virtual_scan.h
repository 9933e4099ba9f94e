/* virtual_scan: hypotheses about the world that help the alignment of scans.
 *
 *     begin -> add_scan ... -> step until CAIRN_OK -> hypotheses and points, which go to
 *     cairn_force_field_set_extra()
 *
 * Man-made places have straight walls and rectangular rooms, and show them in the whole map where
 * no scan does. From all scans as they lie, lines and ellipses are voted for by their points and
 * rectangles are put together from their segments; all are laid out as the points of one more scan,
 * the virtual one, that attracts the others in the next step of the alignment. It is made anew from
 * the real scans alone each time: what the next map does not support is gone (Adluru 2008, chapter
 * 8, algorithm 2).
 *
 * How much a hypothesis weighs follows from it, not from a setting by hand: a point of it weighs at
 * most what one real scan that saw it whole would add, in proportion to the share of its outline
 * that scans do show; and a line or an ellipse counts only when it brings together walls of several
 * scans, since one scan knows its own walls better.
 *
 * Mode as written (cairn_virtual_scan_as_written): section 8.4. Lines come from the Hough
 * transform as written (hough.h) of all points; the strength of a line is the number of points
 * that take part in it, by that of the strongest line, as a strength is to compare with a real
 * point's weight of 1. Rectangles come from segments merged to prototypes, four of them near
 * parallel and near perpendicular, by their slopes, lengths and distances; faces of walls are
 * not told apart. No other condition is put to a hypothesis, and sigma changes nothing. Choices,
 * where the text gives no number: lines of 40 points and more; points of the virtual scan as far
 * apart as real ones (0.10 m); weight 1 of strength 1; a rectangle's strength is the covered
 * share of its outline, less with the square of the deviation from right angles. */
#ifndef CAIRN_VIRTUAL_SCAN_H
#define CAIRN_VIRTUAL_SCAN_H

#include "cairn/ellipse.h"
#include "cairn/hough.h"
#include "cairn/rectangle.h"
#include "cairn/scan_set.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What kind a hypothesis is of: the three that are built in, and those of the caller. */
typedef int32_t cairn_hypothesis_kind;
enum {
    CAIRN_HYPOTHESIS_LINE = 0,
    CAIRN_HYPOTHESIS_RECTANGLE = 1,
    CAIRN_HYPOTHESIS_ELLIPSE = 2,
    CAIRN_HYPOTHESIS_CALLER = 3 /* and above: the caller's kinds in their order */
};

typedef struct cairn_hypothesis {
    cairn_hypothesis_kind kind;
    /* of the virtual scan */
    int32_t first_point, end_point;
    /* that show it; 0: not asked for */
    int32_t scans;
    /* 0 ... 1, share of the outline that is seen; of a line as written its votes by the most */
    cairn_real strength;
    /* of each of its points */
    cairn_real weight;
} cairn_hypothesis;

/* The map that hypotheses are made from, as the scans lie. */
typedef struct cairn_virtual_map {
    const cairn_oriented_point *points; /* [point_count] */
    const int32_t *point_scan;          /* [point_count] slot of the scan */
    const cairn_segment *segments;      /* [segment_count], free side on the left */
    const int32_t *segment_scan;        /* [segment_count] */
    int32_t point_count, segment_count;
    cairn_real sigma; /* m, how far the scans may still be off */
} cairn_virtual_map;

/* A kind of the caller: triangles, say. begin() takes the map, which stays until the detection
 * has ended; step() is as all steps; count() is asked then; outline() writes at most `room`
 * points every `spacing` along hypothesis i, tells its strength (0 ... 1) and returns how many
 * points there are. A status below 0 ends the detection with it. */
typedef cairn_status (*cairn_hypothesis_begin)(void *state, const cairn_virtual_map *map);
typedef cairn_status (*cairn_hypothesis_step)(void *state, cairn_budget *budget);
typedef int32_t (*cairn_hypothesis_count)(const void *state);
typedef int32_t (*cairn_hypothesis_outline)(const void *state, int32_t i, cairn_real spacing,
                                            cairn_oriented_point *points, int32_t room,
                                            cairn_real *strength);

typedef struct cairn_hypothesis_detector {
    void *state; /* the caller's */
    cairn_hypothesis_begin begin;
    cairn_hypothesis_step step;
    cairn_hypothesis_count count;
    cairn_hypothesis_outline outline;
} cairn_hypothesis_detector;

/* In brackets the defaults. */
typedef struct cairn_virtual_scan_params {
    /* 1 ... 2^20: slots of the scans are below (64) */
    int32_t max_scans;
    /* of the map, 1 ... 2^24 (4096) */
    int32_t max_points;
    /* of the map, 1 ... 2^20 (1024) */
    int32_t max_segments;
    /* 1 ... 1024 (64) */
    int32_t max_hypotheses;
    /* points of the virtual scan, 1 ... 2^24 (4096) */
    int32_t max_virtual;
    /* of the caller, 0 ... 16 (2) */
    int32_t max_detectors;
    /* not 0: lines (1) */
    int32_t lines;
    /* not 0: rectangles (1) */
    int32_t rectangles;
    /* not 0: circles and ellipses (1) */
    int32_t ellipses;
    /* >= 1: one in so many of the scans' points votes for lines and ellipses (2) */
    int32_t stride;
    /* m, > 0: of the virtual scan's points (0.10) */
    cairn_real spacing;
    /* >= 0: of points of a hypothesis of strength 1 (1) */
    cairn_real weight;
    /* in sigma, > 0: how far from a line or ellipse its points may be ... (0.3) */
    cairn_real line_support;
    /* rad per m of sigma, > 0: ... and how far off in direction, from 4 to 10 degrees (0.2) */
    cairn_real line_angle;
    /* >= 1: that a line or ellipse brings together (2) */
    int32_t least_scans;
    /* CAIRN_MODE_DEFAULT; CAIRN_MODE_AS_WRITTEN: ellipses, stride, line_support, line_angle,
     * least_scans, least_length, hough.mode and rectangle.oriented are not read
     * (CAIRN_MODE_DEFAULT) */
    int32_t mode;
    /* m, >= 0: of walls that a scan has on it to count (0.5) */
    cairn_real least_length;
    /* its tolerances are the least ones, at sigma 0 */
    cairn_hough_params hough;
    /* its max_segments is not read */
    cairn_rectangle_params rectangle;
    /* its tolerances are the least ones, too */
    cairn_ellipse_params ellipse;
} cairn_virtual_scan_params;

typedef struct cairn_virtual_scan cairn_virtual_scan;

/* The defaults above; hough with 72 angles, 128 distances and steps of 0.10 m, rectangles with
 * sides from 1 m of whose outline 55 % is seen. */
cairn_virtual_scan_params cairn_virtual_scan_default(void);

/* Mode as written: see above. */
cairn_virtual_scan_params cairn_virtual_scan_as_written(void);

/* 0 for params that create() would refuse. */
size_t cairn_virtual_scan_memory(const cairn_virtual_scan_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_virtual_scan_create(cairn_virtual_scan **virtual_scan,
                                                     cairn_pool *pool,
                                                     const cairn_virtual_scan_params *params);

/* Adds a kind of hypothesis; its number is CAIRN_HYPOTHESIS_CALLER and up. CAIRN_BAD_ARGUMENT:
 * NULL, or a missing function. CAIRN_FULL: max_detectors are there. */
CAIRN_CHECKED cairn_status cairn_virtual_scan_add_detector(
    cairn_virtual_scan *virtual_scan, const cairn_hypothesis_detector *detector);

/* Starts a new map; a detection under way is given up, the last result stays. sigma: m, how far
 * scans may still be off, such as that of the force field. CAIRN_BAD_ARGUMENT: NULL, or sigma
 * not >= 0 or beyond 1e6. */
CAIRN_CHECKED cairn_status cairn_virtual_scan_begin(cairn_virtual_scan *virtual_scan,
                                                    cairn_real sigma);

/* Adds a scan of a set as it lies. Before the first step. CAIRN_BAD_ARGUMENT: NULL, no such
 * scan, a pose that is not finite or beyond 1e6 m, or a detection that has begun its steps.
 * CAIRN_FULL: more points or segments than params allow; nothing was added. Linear in the scan. */
CAIRN_CHECKED cairn_status cairn_virtual_scan_add_scan(cairn_virtual_scan *virtual_scan,
                                                       const cairn_scan_set *set, int32_t scan,
                                                       cairn_pose map_scan);

/* Goes on with the detection. CAIRN_MORE: the budget is used up. CAIRN_OK: it has ended, or none
 * was begun. Statuses of the caller's detectors. Costs those of hough, rectangle and ellipse,
 * and a unit for four points and line and for four virtual points. */
CAIRN_CHECKED cairn_status cairn_virtual_scan_step(cairn_virtual_scan *virtual_scan,
                                                   cairn_budget *budget);

/* ---- The result of the last detection that ended ---- */

/* The strongest lines first, then rectangles, ellipses, the caller's kinds. */
const cairn_hypothesis *cairn_virtual_scan_hypotheses(const cairn_virtual_scan *virtual_scan,
                                                      int32_t *count);

/* The virtual scan: points in the map with the weight of each. */
const cairn_oriented_point *cairn_virtual_scan_points(const cairn_virtual_scan *virtual_scan,
                                                      const cairn_real **weights, int32_t *count);

/* Hypotheses and points for which there was no room. */
int32_t cairn_virtual_scan_dropped(const cairn_virtual_scan *virtual_scan);

#ifdef __cplusplus
}
#endif

#endif
