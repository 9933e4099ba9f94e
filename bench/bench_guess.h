/* bench_guess: test cases for hypotheses of virtual scans: detectors alone, a box observed from two
 * sides, a false hypothesis, and the error of extrapolated straight walls. */
#ifndef CAIRN_BENCH_GUESS_H
#define CAIRN_BENCH_GUESS_H

#include "cairn/virtual_scan.h"
#include "sim/arena.h"

/* Evaluates the ellipse detector of virtual_scan in scenes like those of the rectangles: 60 % of
 * every outline in two segments, with noise and clutter walls. Adds the numbers of true ellipses,
 * detections and false positives. Returns 0 on failure. */
int bench_guess_ellipses(uint64_t seed, int32_t *there, int32_t *found, int32_t *wrong);

enum { BENCH_BOX_SCANS = 4, BENCH_BOX_BEAMS = 361 };

/* A flat box in a room and two scans of 110 degrees from opposite sides; neither scan observes both
 * long sides. */
typedef struct bench_box {
    double thickness; /* m */
    float range[BENCH_BOX_SCANS][BENCH_BOX_BEAMS];
    int32_t is_box[BENCH_BOX_SCANS][BENCH_BOX_BEAMS]; /* 1: the beam has hit a long side of it */
    sim_scan scans[BENCH_BOX_SCANS];
} bench_box;

void bench_box_draw(bench_box *box, uint64_t seed);

/* m between the long sides as scans at these poses show them; below 0 when their order is
 * reversed */
double bench_box_thickness(const bench_box *box, const sim_pose *poses);

/* Hits on collinear walls of the arena, at these poses: sum of the squared distances from the
 * common line of each wall that several scans show, and the number of hits. */
void bench_guess_straightness(const sim_arena *arena, const sim_scan *scans, const sim_pose *poses,
                              int32_t count, double *squares, double *hits);

/* A detector of the caller that reports a false rectangle in detection `when` (0: the first) and
 * never again. */
typedef struct bench_false_rectangle {
    cairn_rectangle rectangle;
    int32_t when, detections;
    double spacing; /* m, between the points of hypotheses */
} bench_false_rectangle;

/* A random false rectangle of room size among the scans at start[0 ... count-1], reported in the
 * second detection. */
bench_false_rectangle bench_false_rectangle_draw(const sim_pose *start, int32_t count,
                                                 uint64_t seed);

cairn_virtual_scan_hypothesis_detector bench_lie_detector(bench_false_rectangle *lie);

/* 1 when a hypothesis of some weight lies along most of that rectangle's outline. */
int bench_false_rectangle_is_accepted(const bench_false_rectangle *lie,
                                      const cairn_virtual_scan *hypotheses);

/* A line of JSON for each hypothesis of the last detection, with its step. */
void bench_guess_print(const cairn_virtual_scan *hypotheses, int32_t step);

#endif
