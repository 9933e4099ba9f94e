/* files: writes a survey as a CARMEN log, its ground truth, and the arena as JSON and as a picture.
 *
 * Numbers are written without the locale. All four functions return 0, or -1 on a write error. */
#ifndef CAIRN_SIM_FILES_H
#define CAIRN_SIM_FILES_H

#include <stdio.h>

#include "sim/arena.h"

#ifdef __cplusplus
extern "C" {
#endif

/* CARMEN log: comments, PARAM lines, then ODOM and FLASER (a field of view of 180 degrees) or
 * ROBOTLASER1 (any other) per scan. poses: [scans] for the log, NULL: the odometry. A beam without
 * return is written as range_max, a dropped one as
 * 0. command: a line for the comment, may be NULL. */
int32_t sim_write_log(const sim_survey *survey, const sim_pose *poses, const char *command,
                      FILE *file);

/* index,x,y,theta,place,heading,stamp with 17 digits: m, rad, s. */
int32_t sim_write_truth(const sim_survey *survey, FILE *file);

/* Options, bodies and edges with their numbers. */
int32_t sim_write_json(const sim_arena *arena, FILE *file);

/* SVG: floor, free space of the scans, bodies, the robot's trajectory, places and headings, a
 * scale. */
int32_t sim_write_picture(const sim_survey *survey, FILE *file);

#ifdef __cplusplus
}
#endif

#endif
