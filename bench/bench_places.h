/* Pictures of maps of places: side by side, and the poses with their errors (as in Adluru 2008,
 * figures 6.7 and 6.6). */
#ifndef CAIRN_BENCH_PLACES_H
#define CAIRN_BENCH_PLACES_H

#include "bench/bench_score.h"
#include "tools/cairn_places_picture.h"

enum { BENCH_PANELS = PLACES_PANELS };

/* Distances in m, and angles in degrees, of poses from the truth; all [count]. */
void bench_pose_errors(const sim_pose *truth, const sim_pose *poses, int32_t count, double *metres,
                       double *degrees);

/* The scans at the poses of each panel, the last of them true; each [count]. 0: a line on
 * standard error. */
int bench_draw_maps(const char *path, const char *heading, const char *const titles[BENCH_PANELS],
                    const sim_scan *scans, int32_t count,
                    const sim_pose *const poses[BENCH_PANELS]);

/* errors-SEED.svg: true and found poses of the scans, and their errors drawn larger. */
int bench_draw_errors(const char *folder, uint64_t seed, const sim_scan *scans, int32_t count,
                      const sim_pose *poses);

#endif
