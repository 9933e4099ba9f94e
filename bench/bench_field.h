/* bench_field: the scenes of chapter 7 of the thesis, and the errors of poses against ground
 * truth. */
#ifndef CAIRN_BENCH_FIELD_H
#define CAIRN_BENCH_FIELD_H

#include "cairn/geometry.h"
#include "sim/arena.h"

enum { MOST_STEPS = 1000 };

/* One scene: the scans, their true and their initial poses. */
typedef struct scene {
    const char *name;
    sim_arena *arena;
    sim_survey *survey;
    const sim_scan *scans;
    sim_pose *truth, *start, *poses; /* [count] */
    cairn_pose *history;             /* [(steps + 1) * count] */
    double sigma[MOST_STEPS];        /* of the steps */
    int32_t count, steps, drive;
} scene;

/* How far poses are off. */
typedef struct field_error {
    double metres, degrees;               /* means over the scans, after the best common motion */
    double median_metres, median_degrees; /* medians */
} field_error;

/* Makes a scene; trans, rot: m and degrees, uniform +- disturbance of the poses, NaN for the
 * scene's own. 0 and a line on standard error when the scene cannot be made. */
int field_scene_make(scene *s, const char *name, uint64_t seed, double trans, double rot);
void field_scene_free(scene *s);

field_error field_error_of(const scene *s, const sim_pose *poses);

/* Where a drive returns: mean error of the relative position of scans within 1.5 m of each other, a
 * quarter of the drive apart; NaN when there are none. */
double field_gap(const scene *s, const sim_pose *poses);

/* Mean motion from the start to these poses, m and degrees, after the best common motion. */
field_error field_moved(const scene *s, const sim_pose *poses);

#endif
